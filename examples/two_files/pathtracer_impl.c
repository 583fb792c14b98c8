/* pathtracer_impl.c - the one file of the program that holds the implementation. It is compiled once and
   seldom again; all other files include the header plainly. Switches such as PT_DOUBLE must be the same in
   every file, so give them on the command line. How to build: see main.c. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
