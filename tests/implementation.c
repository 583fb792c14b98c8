/* implementation.c: the implementation that the test programs share; each has its own if it is built alone. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
