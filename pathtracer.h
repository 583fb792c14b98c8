/* pathtracer.h - v0.6.4 - a path tracer in one C99 header: render by the rendering equation,
   know how wrong the picture still is, and how long that took.      MIT-0 or public domain, see the end.

   Do this in exactly ONE C or C++ file, and include the header plainly everywhere else:

       #define PATHTRACER_IMPLEMENTATION
       #include "pathtracer.h"

   build:  cc -O2 program.c -lm -pthread          (C99 or later, C++11 or later; nothing else is needed)

   A WHOLE PROGRAM (examples/minimal.c; a test takes it from here, compiles it and runs it)

       #define PATHTRACER_IMPLEMENTATION
       #include "pathtracer.h"

       int main(void)
       {
           pt_scene scene = PT_SCENE_INIT;
           pt_film film = PT_FILM_INIT;
           pt_report report = PT_REPORT_INIT;
           pt_render_desc desc = pt_render_defaults();

           int white = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(0.75)));
           int lamp = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(10)));
           pt_add_sphere(&scene, pt_v3(0, 1, 0), 1, white);
           pt_add_parallelogram(&scene, pt_v3(-4, 0, -4), pt_v3(0, 0, 8), pt_v3(8, 0, 0), white);
           pt_add_parallelogram(&scene, pt_v3(-1, 4, -1), pt_v3(2, 0, 0), pt_v3(0, 0, 2), lamp);
           if (pt_commit(&scene) != PT_OK) {
               fprintf(stderr, "%s\n", pt_scene_error(&scene));
               pt_scene_free(&scene);
               return 1;
           }

           desc.camera = pt_camera_look_at(pt_v3(0, 1, 6), pt_v3(0, 1, 0), pt_v3(0, 1, 0), 40);
           desc.width = 320;
           desc.height = 240;
           desc.spp = 64;
           pt_result result = pt_render(&scene, &desc, &film, &report);
           if (result == PT_OK) result = pt_write_ppm("out.ppm", &film, 1);
           if (result == PT_OK) pt_report_print(&report, stdout);
           else fprintf(stderr, "%s\n", pt_result_string(result));
           pt_film_free(&film);
           pt_report_free(&report);
           pt_scene_free(&scene);
           return result != PT_OK;
       }

   CONTENTS (search for the tag, [PT-07] say: its first find declares, its second implements)

       [PT-00] configuration: switches, memory, results, threads, clocks
       [PT-01] vectors, frames, colour
       [PT-02] random numbers and samplers
       [PT-03] statistics and Monte Carlo estimates
       [PT-04] sampling warps, each with its density
       [PT-05] radiometry: solid angles, irradiance, spectra
       [PT-06] shapes and rays: intersection, error bounds, where the next ray starts
       [PT-07] bounding volume hierarchy
       [PT-07b] the wide tree, and small scenes without a tree: eight boxes, triangles or spheres at a time
       [PT-08] materials (BSDFs)
       [PT-09] lights
       [PT-10] scene, camera, film
       [PT-11] integrators: path tracing, Whitted, distribution, branching; light-path expressions
       [PT-11b] lockstep: path tracing with 8 or 16 paths at a time
       [PT-17] files: pictures (PPM, PFM, PNG), films, models (OBJ with MTL)
       [PT-18] render driver: passes, threads, budgets, error against run time
       [PT-19] canonical scenes

   Sections stand in the order in which they use each other: the implementation, cut off after any
   section, still compiles. Numbers 12 to 16 are kept free for methods that trace from the lights.

   SWITCHES (define before the include, the same in every file)

       PT_DOUBLE           pt_real is double instead of float: the accuracy twin
       PT_STATIC           every function is static; implies the implementation
       PTDEF               what stands before every public function (default: extern, or static)
       PT_NO_THREADS       one thread, no pthread
       PT_NO_STDIO         no FILE, no printing; implies PT_NO_FILES
       PT_NO_FILES         no files: pictures, films, tables; implies PT_NO_OBJ
       PT_NO_OBJ           no models from OBJ files
       PT_NO_BVH           linear search instead of a tree; implies that there is no wide one
       PT_NO_SIMD          no lanes: the binary tree, which is 1.5 to 4 times slower, and paths one at a time
       PT_NO_INTRINSICS    lanes in plain C, also where the compiler aims at SSE2 or AVX2 (-mavx2 -mfma, -march=native)
       PT_NO_ENVIRONMENT   no light from the background
       PT_NO_MICROFACET    no rough metal and glass, no smooth metal, no Oren-Nayar
       PT_NO_PHONG         no Phong and Blinn-Phong
       PT_NO_COAT          no diffuse base under a smooth coat
       PT_NO_MEASURED      no measured tables in the MERL layout
       PT_NO_TEXTURES      no textures on albedo
       PT_NO_WHITTED       only path tracing: no local, Whitted, distribution and branching method
       PT_NO_LPE           no light-path expressions
       PT_NO_OBSERVER      no callback with the letters L D G S E of each path
       PT_NO_REPORT        no rows of error against run time, no CSV, no SVG (the error estimate stays)
       PT_NO_SCENES        no canonical scenes
       PT_ONLY_PATH        only the method "path": implies PT_NO_WHITTED, _LPE, _OBSERVER and _SCENES
       PT_MALLOC(size,user) PT_REALLOC(pointer,size,user) PT_FREE(pointer,user)   all three or none
       PT_ASSERT(x)        default: nothing
       PT_ALLOW_FAST_MATH  lifts the refusal of -ffast-math; NaN checks and the watertight test then
                           promise nothing

   CONVENTIONS

       Right-handed, y up. wo and wi are unit vectors that both point AWAY from the surface.
       f is the BSDF without the cosine. A density says its measure in its name: _w per solid angle,
       _a per area, _l per length. The geometric normal ng is never flipped: (v1-v0)x(v2-v0) for a
       triangle, edge1 x edge2 for a parallelogram, from the centre for a sphere. Opaque surfaces
       scatter on both sides; triangles and parallelograms emit on the side of ng only, spheres on
       both. Radiance is in W sr^-1 m^-2 per colour band, linear light; image row 0 is the top.
       Angles are in radians unless a name ends in _deg. Path length counts EDGES: 1 = an emitter
       seen by the camera, 2 = that and direct light, k+2 = "k bounces" of the lecture slides.
       Descriptors may be zero-initialised; zero means the default named at each field.

   NUMBERS

       Decisions (does this ray meet this sphere, which side of this edge) are made in double from
       the pt_real input. No constant is tuned to the size of a scene: rays start at an offset that
       follows from the rounding error of their own origin ([PT-06]). Sums over samples are double.
       Scenes of at most 64 materials, diffuse, mirror, smooth glass, metal, and 64 area lights are
       rendered by paths that walk in lockstep ([PT-11b]), in float; up to 64 primitives, and the walls of
       larger scenes, are decided in float as well, between primitives that are wider by the rounding of a
       hit. desc.no_lockstep asks for one path at a time; the two agree in the mean, not in their bits.
       Build with -ffp-contract=off when two builds or two instances of the path integrator must give
       the same bits: a fused multiply-add rounds once where two operations round twice, and a
       compiler may fuse differently in each copy. Hits and misses of triangles do not depend on it.

   LIMITS (`make stress` prints the figures, float and double side by side)

       Coordinates and radii: up to PT_MAX_COORDINATE = 1e18; larger ones, infinity and NaN are refused
       with a sentence. Hits and misses are those of exact arithmetic on the rounded input at scales
       from 1e-45 to 1e30 and translations to 1e7, in every build.
       Far from the origin: closed shapes are closed up to 10^6 of their own sizes away in float, 10^10 in
       double. At 2^23 sizes a float can no longer tell the corners of a box from its middle; at
       10^12 sizes, in double, 2 to 3 of 4,000 paths of 12 edges leave a box.
       Solid angles: relative error below 1e-11 from 1e-12 sr to nearly 4 pi; a sphere seen from its own
       surface 4e-8.
       Albedo: roulette survives with at most 1 - 2^-24, so the mean is right up to that, and the
       time of a path in a closed scene grows as 1 / (1 - albedo).
       Radiance: 1e-9 to 1e9 in one picture to 15 digits in double, exactly in float; what a float
       cannot hold (above 3.4e38) is infinite, counts as 0 and is reported (nonfinite).

   WHAT IT DOES NOT DO (today)

       Participating media, motion, spectra other than for making RGB values, light scattered more than
       once within a rough surface, and light paths traced from the light. A point light seen through glass or
       in a mirror, and a caustic of a point light, have probability zero in path tracing from the
       eye: they are black, not noisy.

   SOURCES

       [Arv90] Arvo, Kirk: Particle Transport and Image Synthesis, 1990
       [Arv95] Arvo: Stratified Sampling of Spherical Triangles, 1995
       [Bla21] Blackman, Vigna: Scrambled Linear Pseudorandom Number Generators, ACM TOMS 47(4), 2021
       [Bur20] Burley: Practical Hash-based Owen Scrambling, JCGT 9(4), 2020
       [Che83] Chan, Golub, LeVeque: Algorithms for Computing the Sample Variance, 1983
       [Coo84] Cook, Porter, Carpenter: Distributed Ray Tracing, 1984
       [Duf17] Duff et al.: Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017
       [Dup23] Dupuy, Benyoub: Sampling Visible GGX Normals with Spherical Caps, 2023
       [Gul14] Gulbrandsen: Artist Friendly Metallic Fresnel, JCGT 3(4), 2014
       [Hai19] Haines, Guenther, Akenine-Moeller: Precision Improvements for Ray/Sphere Intersection,
               Ray Tracing Gems ch. 7, 2019
       [Hei14] Heitz: Understanding the Masking-Shadowing Function, JCGT 3(2), 2014
       [Hei18] Heitz: Sampling the GGX Distribution of Visible Normals, JCGT 7(4), 2018
       [How10] Howell: A Catalog of Radiation Heat Transfer Configuration Factors, 3rd edition, 2010
       [Ize13] Ize: Robust BVH Ray Traversal, JCGT 2(2), 2013
       [Joe08] Joe, Kuo: Constructing Sobol Sequences with Better Two-Dimensional Projections, 2008
       [Kaj86] Kajiya: The Rendering Equation, 1986
       [Ken13] Kensler: Correlated Multi-Jittered Sampling, Pixar memo 13-01, 2013
       [Laf94] Lafortune, Willems: Using the Modified Phong Reflectance Model, 1994
       [Lai13] Laine, Karras, Aila: Megakernels Considered Harmful: Wavefront Path Tracing on GPUs, HPG 2013
       [Lam60] Lambert: Photometria, 1760 (polygon irradiance; see Arvo, Applications of Irradiance
               Tensors, 1995)
       [Mat03] Matusik, Pfister, Brand, McMillan: A Data-Driven Reflectance Model, 2003
       [One14] O'Neill: PCG, a Family of Better Random Number Generators, 2014
       [Oos83] Van Oosterom, Strackee: The Solid Angle of a Plane Triangle, 1983
       [Ore94] Oren, Nayar: Generalization of Lambert's Reflectance Model, 1994
       [PBR]   Pharr, Jakob, Humphreys: Physically Based Rendering, 4th edition, 2023
       [Rus98] Rusinkiewicz: A New Change of Variables for Efficient BRDF Representation, 1998
       [Sch94] Schlick: An Inexpensive BRDF Model for Physically-based Rendering, 1994
       [Shi97] Shirley, Chiu: A Low Distortion Map Between Disk and Square, 1997
       [Sny96] Snyder: Area Light Sources for Real-Time Graphics, 1996
       [Spe62] Spencer, Murty: General Ray-Tracing Procedure, J. Optical Society 52(6), 1962
       [Ste11] Stafford: Better Bit Mixing, 2011 (finaliser used by Java's SplittableRandom)
       [Ure13] Urena, Fajardo, King: An Area-Preserving Parametrization for Spherical Rectangles, 2013
       [Vea97] Veach: Robust Monte Carlo Methods for Light Transport Simulation, 1997
       [Veg21] Vegdahl: Building a Better LK Hash, 2021
       [Vos91] Vose: A Linear Algorithm for Generating Random Numbers with a Given Distribution, 1991
       [Wal07] Walter, Marschner, Li, Torrance: Microfacet Models for Refraction, 2007
       [Wal08] Wald, Benthin, Boulos: Getting Rid of Packets, IEEE Symposium on Interactive Ray Tracing, 2008
       [Wal26] Walsh: reflectance of diffuse light, 1926; see Duntley, J. Optical Society 32, 1942
       [Whi80] Whitted: An Improved Illumination Model for Shaded Display, 1980
       [Woo13] Woop, Benthin, Wald: Watertight Ray/Triangle Intersection, JCGT 2(1), 2013
       [Yli17] Ylitie, Karras, Laine: Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs,
               High-Performance Graphics 2017
*/

#ifndef PATHTRACER_H
#define PATHTRACER_H

/* =====================================================================================================
   [PT-00] CONFIGURATION: declarations
   ===================================================================================================== */

#define PT_VERSION_MAJOR 0
#define PT_VERSION_MINOR 6
#define PT_VERSION_PATCH 4
#define PT_VERSION_STRING "0.6.4"

#if (defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0) || \
     defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || defined(_M_FP_FAST)) && \
    !defined(PT_ALLOW_FAST_MATH)
#error "pathtracer.h: -ffast-math and its kin remove the checks for NaN and the guarantees of [PT-06]; see PT_ALLOW_FAST_MATH"
#endif
#if ((defined(__FLT_EVAL_METHOD__) && (__FLT_EVAL_METHOD__ < 0 || __FLT_EVAL_METHOD__ > 1)) || \
     (defined(_M_IX86_FP) && _M_IX86_FP < 2)) && !defined(PT_ALLOW_FAST_MATH)
#error "pathtracer.h: x87 arithmetic rounds twice, and when it does is the compiler's; -msse2 -mfpmath=sse (/arch:SSE2) does not"
#endif

/* The switches, normalised once: below this table only PTI_HAS_X is asked. */
#ifdef PT_ONLY_PATH
#ifndef PT_NO_WHITTED
#define PT_NO_WHITTED
#endif
#ifndef PT_NO_LPE
#define PT_NO_LPE
#endif
#ifndef PT_NO_OBSERVER
#define PT_NO_OBSERVER
#endif
#ifndef PT_NO_SCENES
#define PT_NO_SCENES
#endif
#define PTI_HAS_ALL_METHODS 0
#else
#define PTI_HAS_ALL_METHODS 1
#endif
#if defined(PT_NO_STDIO) && !defined(PT_NO_FILES)
#define PT_NO_FILES
#endif
#ifdef PT_NO_THREADS
#define PTI_HAS_THREADS 0
#elif (defined(__GNUC__) && (defined(__unix__) || defined(__APPLE__) || defined(_WIN32))) || defined(_MSC_VER)
#define PTI_HAS_THREADS 1 /* where threads and atomic counters are known */
#else
#define PTI_HAS_THREADS 0
#endif
#ifdef PT_NO_STDIO
#define PTI_HAS_STDIO 0
#else
#define PTI_HAS_STDIO 1
#endif
#ifdef PT_NO_FILES
#define PTI_HAS_FILES 0
#else
#define PTI_HAS_FILES 1
#endif
#if defined(PT_NO_OBJ) || defined(PT_NO_FILES)
#define PTI_HAS_OBJ 0
#else
#define PTI_HAS_OBJ 1
#endif
#ifdef PT_NO_BVH
#define PTI_HAS_BVH 0
#else
#define PTI_HAS_BVH 1
#endif
#ifdef PT_NO_SIMD
#define PTI_HAS_SIMD 0
#else
#define PTI_HAS_SIMD 1
#endif
#ifdef PT_DOUBLE
#define PTI_HAS_WIDE 0 /* its lanes are float */
#else
#define PTI_HAS_WIDE (PTI_HAS_SIMD && PTI_HAS_BVH)
#endif
#define PTI_HAS_LOCKSTEP PTI_HAS_WIDE
#ifdef PT_NO_ENVIRONMENT
#define PTI_HAS_ENVIRONMENT 0
#else
#define PTI_HAS_ENVIRONMENT 1
#endif
#ifdef PT_NO_MICROFACET
#define PTI_HAS_MICROFACET 0
#else
#define PTI_HAS_MICROFACET 1
#endif
#ifdef PT_NO_PHONG
#define PTI_HAS_PHONG 0
#else
#define PTI_HAS_PHONG 1
#endif
#ifdef PT_NO_COAT
#define PTI_HAS_COAT 0
#else
#define PTI_HAS_COAT 1
#endif
#ifdef PT_NO_MEASURED
#define PTI_HAS_MEASURED 0
#else
#define PTI_HAS_MEASURED 1
#endif
#ifdef PT_NO_TEXTURES
#define PTI_HAS_TEXTURES 0
#else
#define PTI_HAS_TEXTURES 1
#endif
#ifdef PT_NO_WHITTED
#define PTI_HAS_WHITTED 0
#else
#define PTI_HAS_WHITTED 1
#endif
#ifdef PT_NO_LPE
#define PTI_HAS_LPE 0
#else
#define PTI_HAS_LPE 1
#endif
#ifdef PT_NO_OBSERVER
#define PTI_HAS_OBSERVER 0
#else
#define PTI_HAS_OBSERVER 1
#endif
#ifdef PT_NO_REPORT
#define PTI_HAS_REPORT 0
#else
#define PTI_HAS_REPORT 1
#endif
#ifdef PT_NO_SCENES
#define PTI_HAS_SCENES 0
#else
#define PTI_HAS_SCENES 1
#endif

#ifdef PT_STATIC
#ifndef PATHTRACER_IMPLEMENTATION
#define PATHTRACER_IMPLEMENTATION
#endif
#endif

/* Strict -std=c99 hides POSIX clocks. Where no libc header has been read yet, ask for them; elsewhere the
   wall clock falls back to whole seconds, and pt_report says so (wall_resolution). */
#if defined(PATHTRACER_IMPLEMENTATION) && defined(__STRICT_ANSI__) && !defined(_POSIX_C_SOURCE) && \
    !defined(_FEATURES_H) && !defined(_GNU_SOURCE) && (defined(__unix__) || defined(__APPLE__))
#define _POSIX_C_SOURCE 200809L
#endif

#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <string.h>
#if PTI_HAS_STDIO
#include <stdio.h>
#endif

#ifndef PTDEF
#ifdef PT_STATIC
#if defined(__GNUC__)
#define PTDEF static __attribute__((unused))
#else
#define PTDEF static
#endif
#else
#define PTDEF extern
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* The working precision: float, or double with PT_DOUBLE. */
#ifdef PT_DOUBLE
typedef double pt_real;
#else
typedef float pt_real;
#endif

/* What a function that can fail returns. */
typedef enum pt_result {
    PT_OK = 0,
    PT_ERROR_ARGUMENT,      /* an argument outside its documented range                                    */
    PT_ERROR_MEMORY,        /* an allocation failed; everything of the call was freed                      */
    PT_ERROR_SCENE,         /* the scene is wrong; pt_scene_error() names the item                         */
    PT_ERROR_NOT_COMMITTED, /* the scene was changed, or never committed, since pt_commit                  */
    PT_ERROR_LEFT_OUT,      /* the scene or call needs what a PT_NO_X switch left out                      */
    PT_ERROR_CANCELLED,     /* the callback asked to stop; finished passes are in the film                 */
    PT_ERROR_MISMATCH,      /* films that do not belong together, or whose samples overlap                 */
    PT_ERROR_FILE           /* a file could not be read, or not written; then nothing but a whole one has its name */
} pt_result;

/* The name of a result as a short sentence. Never NULL, also for values outside the enum. */
PTDEF const char *pt_result_string(pt_result result);

/* Wall-clock seconds since an arbitrary start; monotonic where the system has such a clock. */
PTDEF double pt_wall_seconds(void);

/* CPU seconds that this process has used so far, over all its threads. */
PTDEF double pt_cpu_seconds(void);

/* The step of pt_wall_seconds in seconds: below 1e-6 usually, 1 where only time() is visible (see the note
   on -std=c99 above). */
PTDEF double pt_wall_resolution(void);

/* How many threads this machine can run at once; 1 without threads or where it cannot be found out. */
PTDEF int pt_hardware_threads(void);

/* Runs task(context, i) for every i in 0..count-1, in any order, on any threads, and returns when all are
   done. A user's own thread pool provides one. */
typedef void (*pt_parallel_fn)(void *user, int count, void (*task)(void *context, int index), void *context);

/* =====================================================================================================
   [PT-01] VECTORS, FRAMES, COLOUR: declarations
   ===================================================================================================== */

typedef struct pt_vec2 {
    pt_real x, y;
} pt_vec2;

typedef struct pt_vec3 {
    pt_real x, y, z;
} pt_vec3;

/* Three bands of linear light: radiance, reflectance or a weight. Not a vector in space. */
typedef struct pt_rgb {
    pt_real r, g, b;
} pt_rgb;

/* The same in double: what sums over edges, samples or pixels. */
typedef struct pt_rgbd {
    double r, g, b;
} pt_rgbd;

/* An orthonormal right-handed frame; n is the local z axis. */
typedef struct pt_frame {
    pt_vec3 s, t, n;
} pt_frame;

#define PT_PI 3.14159265358979323846

static inline pt_vec2 pt_v2(pt_real x, pt_real y) { pt_vec2 v = {x, y}; return v; }
static inline pt_vec3 pt_v3(pt_real x, pt_real y, pt_real z) { pt_vec3 v = {x, y, z}; return v; }
static inline pt_vec3 pt_v3_add(pt_vec3 a, pt_vec3 b) { return pt_v3(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline pt_vec3 pt_v3_sub(pt_vec3 a, pt_vec3 b) { return pt_v3(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline pt_vec3 pt_v3_scale(pt_vec3 a, pt_real k) { return pt_v3(a.x * k, a.y * k, a.z * k); }
static inline pt_vec3 pt_v3_neg(pt_vec3 a) { return pt_v3(-a.x, -a.y, -a.z); }
static inline pt_real pt_v3_dot(pt_vec3 a, pt_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline pt_vec3 pt_v3_cross(pt_vec3 a, pt_vec3 b)
{
    return pt_v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/* Euclidean length. Overflows or underflows where the square of a component does. */
PTDEF pt_real pt_v3_length(pt_vec3 a);

/* a / |a|, computed in double so that every non-zero finite float vector has a direction; the zero vector
   stays zero. */
PTDEF pt_vec3 pt_v3_normalize(pt_vec3 a);

/* An orthonormal frame around the unit vector n, for every n including (0,0,-1) and signed zeros
   [Duf17]. */
PTDEF pt_frame pt_frame_from_normal(pt_vec3 n);

/* From frame coordinates to world coordinates, and back. */
static inline pt_vec3 pt_frame_to_world(const pt_frame *f, pt_vec3 v)
{
    return pt_v3_add(pt_v3_add(pt_v3_scale(f->s, v.x), pt_v3_scale(f->t, v.y)), pt_v3_scale(f->n, v.z));
}
static inline pt_vec3 pt_frame_to_local(const pt_frame *f, pt_vec3 v)
{
    return pt_v3(pt_v3_dot(f->s, v), pt_v3_dot(f->t, v), pt_v3_dot(f->n, v));
}

static inline pt_rgb pt_rgb3(pt_real r, pt_real g, pt_real b) { pt_rgb c = {r, g, b}; return c; }
static inline pt_rgbd pt_rgbd3(double r, double g, double b) { pt_rgbd c = {r, g, b}; return c; }
static inline pt_rgb pt_rgb_grey(pt_real v) { return pt_rgb3(v, v, v); }
static inline pt_rgb pt_rgb_add(pt_rgb a, pt_rgb b) { return pt_rgb3(a.r + b.r, a.g + b.g, a.b + b.b); }
static inline pt_rgb pt_rgb_mul(pt_rgb a, pt_rgb b) { return pt_rgb3(a.r * b.r, a.g * b.g, a.b * b.b); }
static inline pt_rgb pt_rgb_scale(pt_rgb a, pt_real k) { return pt_rgb3(a.r * k, a.g * k, a.b * k); }
static inline pt_real pt_rgb_max(pt_rgb a)
{
    pt_real m = a.r > a.g ? a.r : a.g;
    return m > a.b ? m : a.b;
}

/* Luminance Y of linear sRGB (IEC 61966-2-1 primaries, D65 white): the middle row of the RGB to XYZ matrix;
   white (1,1,1) has luminance 1. */
PTDEF double pt_luminance(double r, double g, double b);

/* The sRGB transfer curve from linear light to the encoded value, both in [0,1] [IEC 61966-2-1]. */
PTDEF double pt_srgb_encode(double linear);
/* Its inverse. */
PTDEF double pt_srgb_decode(double encoded);

/* Linear light to an 8-bit sRGB code: clipped to [0,1], rounded to nearest; NaN and negative give 0,
   +infinity gives 255. */
PTDEF unsigned char pt_srgb_byte(double linear);

/* =====================================================================================================
   [PT-02] RANDOM NUMBERS AND SAMPLERS: declarations
   ===================================================================================================== */

/* PCG32 [One14], XSH-RR with 64 bits of state: the published generator and stream. */
typedef struct pt_pcg32 {
    uint64_t state, inc;
} pt_pcg32;

/* Seeds as pcg32_srandom_r(seed, stream) does. */
PTDEF pt_pcg32 pt_pcg32_make(uint64_t seed, uint64_t stream);
/* The next 32 random bits. */
PTDEF uint32_t pt_pcg32_next(pt_pcg32 *rng);
/* Skips delta draws in O(log delta); a negative step is its two's complement. */
PTDEF void pt_pcg32_advance(pt_pcg32 *rng, uint64_t delta);
/* The next number in [0,1), from 53 random bits (two draws). */
PTDEF double pt_pcg32_double(pt_pcg32 *rng);

/* Mixes 64 bits: a bijection in which each input bit flips each output bit with probability near 1/2
   [Ste11]. */
PTDEF uint64_t pt_hash64(uint64_t x);

/* The top bits of a random word as a number in [0,1), never 1: 24 bits for float, 32 for double. */
PTDEF pt_real pt_real_from_u32(uint32_t x);

/* Point n (0-based, binary order) of dimension d = 0..3 of the Sobol sequence with the direction numbers of
   [Joe08], as a 32-bit fraction. */
PTDEF uint32_t pt_sobol_u32(uint32_t n, int d);

/* Owen scrambling of a 32-bit fraction by hashing: flips each bit by a random function of the bits above it
   and of the seed [Bur20, Veg21]. */
PTDEF uint32_t pt_owen_scramble(uint32_t x, uint32_t seed);

typedef enum pt_sampler_kind {
    PT_SAMPLER_SOBOL = 0,   /* Owen-scrambled Sobol points in padded sets of four dimensions               */
    PT_SAMPLER_INDEPENDENT, /* a hash of (seed, stream, sample, dimension): counter-based, no state        */
    PT_SAMPLER_STRATIFIED,  /* jittered strata in 1-D and 2-D; needs the number of samples beforehand      */
    PT_SAMPLER_GIVEN        /* numbers that the caller supplies (a Markov chain, a test)                   */
} pt_sampler_kind;

/* A source of uniform numbers for one sample of one stream (a pixel, say). Dimension d of sample i of
   stream s depends only on (kind, seed, s, i, d), so samples may be taken in any order on any thread.
   Make one with pt_sampler_make; the fields are for reading. */
typedef struct pt_sampler {
    pt_sampler_kind kind;
    uint32_t count;          /* samples per stream; only PT_SAMPLER_STRATIFIED uses it                     */
    uint64_t seed, key;      /* the seed, and its hash with the stream                                     */
    uint32_t index;          /* which sample of the stream                                                 */
    uint32_t dimension;      /* the next dimension                                                         */
    uint32_t set, set_index; /* Sobol: the padded set in use (plus one) and its shuffled index             */
    const double *given;     /* PT_SAMPLER_GIVEN: the numbers,                                             */
    size_t given_count;      /*   how many there are,                                                      */
    size_t given_missing;    /*   and how many draws went beyond them (answered by independent numbers)    */
} pt_sampler;

/* A sampler of one of the first three kinds. count is the number of samples that each stream will get
   (PT_SAMPLER_STRATIFIED; 0 is taken as 1), and is ignored by the others. */
PTDEF pt_sampler pt_sampler_make(pt_sampler_kind kind, uint64_t seed, uint32_t count);
/* A sampler that hands out u[0], u[1], ... (each in [0,1)); the array stays the caller's. */
PTDEF pt_sampler pt_sampler_make_given(const double *u, size_t count);
/* Begins sample `index` of `stream`, at dimension 0. */
PTDEF void pt_sampler_start(pt_sampler *s, uint64_t stream, uint32_t index);
/* Goes to a dimension, so that each decision has its own one whatever was drawn before it. */
PTDEF void pt_sampler_seek(pt_sampler *s, uint32_t dimension);
/* The next one, or two, numbers in [0,1). A pair is well spread in 2-D if it starts at an even dimension. */
PTDEF pt_real pt_sampler_1d(pt_sampler *s);
PTDEF pt_vec2 pt_sampler_2d(pt_sampler *s);

/* Which dimension decides what. Edges count from 1. */
#define PT_DIM_FILM 0u                                       /* 2: position within the pixel             */
#define PT_DIM_LENS 2u                                       /* 2: position on the lens                  */
#define PT_DIM_EDGE(k) (4u + 8u * (uint32_t)((k) - 1))       /* decisions at the end of edge k, plus:    */
#define PT_DIM_BSDF 0u                                       /*   2: direction from the BSDF             */
#define PT_DIM_LIGHT 2u                                      /*   2: point on the light                  */
#define PT_DIM_LIGHT_CHOICE 4u                               /*   1: which light                         */
#define PT_DIM_LOBE 5u                                       /*   1: which lobe of the BSDF              */
#define PT_DIM_ROULETTE 6u                                   /*   1: Russian roulette                    */

/* =====================================================================================================
   [PT-03] STATISTICS AND ESTIMATES: declarations
   ===================================================================================================== */

/* Running moments of a sample; mergeable, in double. Start from PT_STATS_INIT. */
typedef struct pt_stats {
    double n;          /* how many values                                                                  */
    double mean;       /* their mean                                                                       */
    double m2, m3;     /* sums of the 2nd and 3rd powers of deviations from the mean                       */
} pt_stats;

#ifdef __cplusplus
#define PTI_ZERO_INIT {}
#else
#define PTI_ZERO_INIT {0}
#endif
#define PT_STATS_INIT PTI_ZERO_INIT

/* Adds one value (Welford's update, with the third moment). */
PTDEF void pt_stats_add(pt_stats *s, double x);
/* Adds all of b to a, as if a had seen b's values [Che83]. */
PTDEF void pt_stats_merge(pt_stats *a, const pt_stats *b);
/* Unbiased variance of one value, standard error of the mean, sample skewness; 0 where n is too small. */
PTDEF double pt_stats_variance(const pt_stats *s);
PTDEF double pt_stats_standard_error(const pt_stats *s);
PTDEF double pt_stats_skewness(const pt_stats *s);

/* Upper tail P(X > x) of the standard normal, Student's t with df > 0, and chi-squared with df > 0 degrees
   of freedom; relative accuracy holds far into the tail (Student: up to df = 1e7). */
PTDEF double pt_normal_sf(double x);
PTDEF double pt_student_sf(double x, double df);
PTDEF double pt_chi2_sf(double x, double df);
/* The x with pt_normal_sf(x) = p, for p in (0,1). */
PTDEF double pt_normal_isf(double p);

/* How multiple importance sampling weighs techniques: by the squares of their densities, by the densities, or
   all to the largest [Vea97] 9.2. */
typedef enum pt_heuristic { PT_HEURISTIC_POWER = 0, PT_HEURISTIC_BALANCE, PT_HEURISTIC_MAXIMUM } pt_heuristic;

/* The weight of technique 1 with density p1 against technique 2 with density p2, as a ratio that cannot
   overflow. p1 = 0 gives 0; equal densities share. */
PTDEF double pt_mis_weight(double p1, double p2, pt_heuristic heuristic);

/* An integrand on the unit cube: u holds `dimensions` numbers in [0,1). */
typedef double (*pt_integrand)(const double *u, void *user);

/* A way to draw points x: warp takes u in [0,1)^d to x, density gives its density at x (also for points that
   another technique drew). */
typedef struct pt_technique {
    void (*warp)(const double *u, double *x, void *user);
    double (*density)(const double *x, void *user);
    void *user;
} pt_technique;

/* What to integrate and with which numbers. */
typedef struct pt_integral {
    pt_integrand f;          /* over [0,1)^dimensions, or over the points of a technique                   */
    void *user;
    int dimensions;          /* in [1, 64]                                                                 */
    uint32_t n;              /* values of the estimator to average, >= 32                                  */
    pt_sampler_kind sampler; /* the first three kinds; Sobol and stratified: 32 independent randomisations
                                of n / 32 points each, whose spread gives the standard error               */
    uint64_t seed;
} pt_integral;

/* What an estimate of an integral reports. */
typedef struct pt_estimate {
    double value, standard_error; /* the mean, and the standard deviation of that mean                     */
    double evaluations;           /* how often f was called                                                */
    double seconds;               /* CPU seconds                                                           */
    double efficiency;            /* 1 / (standard_error^2 * seconds); 0 if one of them is 0               */
    pt_stats units;               /* the independent values behind it: n values, or 32 means               */
} pt_estimate;

/* Estimators of the integral, each unbiased. PT_ERROR_ARGUMENT for values outside the ranges named. */

/* The mean of f(u): plain Monte Carlo, stratified or quasi-random, as p->sampler says. */
PTDEF pt_result pt_estimate_mean(const pt_integral *p, pt_estimate *out);
/* The mean of (f(u) + f(1 - u)) / 2: exact for integrands that are odd about the centre of the cube. */
PTDEF pt_result pt_estimate_antithetic(const pt_integral *p, pt_estimate *out);
/* Importance sampling: the mean of f(x) / density(x). The density must be positive wherever f is not zero. */
PTDEF pt_result pt_estimate_importance(const pt_integral *p, const pt_technique *technique, pt_estimate *out);
/* Control variate: the mean of f(u) - c (g(u) - G) with a g whose integral G is known; g gets p->user. */
PTDEF pt_result pt_estimate_control(const pt_integral *p, pt_integrand g, double g_integral, double c,
                                    pt_estimate *out);
/* Multiple importance sampling with counts[i] in [0, 1024] samples of each of `count` techniques, in [1, 8], a value
   [Vea97] 9.2; and with one sample a value, from technique i with probability share[i]: the shares sum to 1. */
PTDEF pt_result pt_estimate_mis(const pt_integral *p, const pt_technique *techniques, const int *counts, int count,
                                pt_heuristic heuristic, pt_estimate *out);
PTDEF pt_result pt_estimate_mis_one(const pt_integral *p, const pt_technique *techniques, const double *shares,
                                    int count, pt_heuristic heuristic, pt_estimate *out);
/* Russian roulette: f(u) / q with probability q in (0,1], else 0 without calling f [Arv90]. */
PTDEF pt_result pt_estimate_roulette(const pt_integral *p, double q, pt_estimate *out);
/* Splitting: the first `outer` numbers are drawn once, the others `splits` times [Arv90]. */
PTDEF pt_result pt_estimate_splitting(const pt_integral *p, int outer, int splits, pt_estimate *out);

/* Probabilities of a deviation at least as large as the one seen, if there is no bias (two-sided): of a mean
   against its exact value (Student, n - 1 degrees of freedom), of two means (Welch), and of counts against
   expected counts (chi-squared, cells pooled from the left until 5 are expected). 1 where n is too small. */
PTDEF double pt_p_value_mean(const pt_stats *s, double exact);
PTDEF double pt_p_value_equal_means(const pt_stats *a, const pt_stats *b);
PTDEF double pt_p_value_counts(const double *observed, const double *expected, int cells);
/* Half the width of the interval that contains the true mean with the given confidence in (0,1); at most 1e9
   standard errors. */
PTDEF double pt_stats_interval(const pt_stats *s, double confidence);

/* =====================================================================================================
   [PT-04] SAMPLING WARPS: declarations. u is uniform on [0,1)^2; local directions have z along the axis.
   ===================================================================================================== */

/* Uniform point of the unit disk by the concentric map [Shi97]; density 1/pi per area. */
PTDEF pt_vec2 pt_warp_disk(pt_vec2 u);
PTDEF pt_real pt_warp_disk_pdf_a(void);
/* Uniform direction of the hemisphere z >= 0; density 1/(2 pi) per solid angle. */
PTDEF pt_vec3 pt_warp_hemisphere(pt_vec2 u);
PTDEF pt_real pt_warp_hemisphere_pdf_w(pt_vec3 w);
/* Cosine-weighted direction of the hemisphere (Malley); density cos/pi. z is never below 2^-12 (float). */
PTDEF pt_vec3 pt_warp_cosine(pt_vec2 u);
PTDEF pt_real pt_warp_cosine_pdf_w(pt_vec3 w);
/* Uniform direction of the sphere; density 1/(4 pi). */
PTDEF pt_vec3 pt_warp_sphere(pt_vec2 u);
PTDEF pt_real pt_warp_sphere_pdf_w(void);
/* Uniform direction of the cone around +z with 1 - cos(half angle) = omc in (0,2]; density 1/(2 pi omc).
   Takes 1 - cos rather than cos, because cos of a small angle has lost it. */
PTDEF pt_vec3 pt_warp_cone(pt_vec2 u, double omc);
PTDEF double pt_warp_cone_pdf_w(double omc);
/* Uniform point of a triangle as barycentric weights of its second and third corner; density 1/area. */
PTDEF pt_vec2 pt_warp_triangle(pt_vec2 u);

/* A triangle seen from a point, to sample by solid angle. */
typedef struct pt_spherical_triangle {
    double a[3], b[3], t[3];  /* directions to corners a and b; unit tangent at a of the arc from a to c    */
    double arc;               /* length of that arc                                                        */
    double ab1, triple, bt;   /* 1 + a.b, |a.(b x t)|, b.t                                                 */
    double solid_angle;       /* sr, in [0, 2 pi]                                                          */
} pt_spherical_triangle;

/* Prepares; returns the solid angle in sr, 0 if p lies in the plane of the triangle or the triangle has no
   area. Relative accuracy holds for tiny triangles too. */
PTDEF double pt_spherical_triangle_make(pt_spherical_triangle *s, pt_vec3 p, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2);
/* A direction uniform over the triangle; density 1/solid_angle. */
PTDEF pt_vec3 pt_spherical_triangle_sample(const pt_spherical_triangle *s, pt_vec2 u);

/* A rectangle seen from a point, to sample by solid angle [Ure13]. */
typedef struct pt_spherical_rectangle {
    double x[3], y[3], z[3];  /* frame: the edges, and the normal towards p                                */
    double x0, x1, y0, y1, z0;
    double b0, b1, k;
    int as_triangles;         /* 1: sample it as two spherical triangles                                   */
    double solid_angle;       /* sr, in [0, 2 pi)                                                          */
} pt_spherical_rectangle;

/* Prepares for the rectangle corner + s e1 + t e2, 0 <= s, t <= 1, e1 perpendicular to e2. Returns the solid
   angle, 0 if p lies in its plane. */
PTDEF double pt_spherical_rectangle_make(pt_spherical_rectangle *s, pt_vec3 p, pt_vec3 corner, pt_vec3 e1,
                                         pt_vec3 e2);
/* A direction uniform over the rectangle; density 1/solid_angle. */
PTDEF pt_vec3 pt_spherical_rectangle_sample(const pt_spherical_rectangle *s, pt_vec2 u);

/* A table that draws index i with probability weight[i] / sum of weights in constant time [Vos91]. */
typedef struct pt_alias_entry {
    double threshold;  /* keep this index if the remainder of u is below,                                  */
    double pmf;        /* its probability,                                                                 */
    uint32_t alias;    /* else take this one                                                               */
} pt_alias_entry;
typedef struct pt_alias {
    pt_alias_entry *entries;
    uint32_t count;
} pt_alias;

/* Builds a table over `count` weights, finite and >= 0. All zero, or count 0: an empty table (count = 0). */
PTDEF pt_result pt_alias_make(pt_alias *table, const double *weights, uint32_t count, void *alloc_user);
/* Draws an index of a non-empty table with u in [0,1); *pmf is its probability, never 0. */
PTDEF uint32_t pt_alias_sample(const pt_alias *table, double u, double *pmf);
PTDEF void pt_alias_free(pt_alias *table, void *alloc_user);

/* =====================================================================================================
   [PT-05] RADIOMETRY: declarations
   ===================================================================================================== */

/* Lumens per watt at 555 nm, where the eye sees best (K_m of the SI; 683.002 for the tabulated V). A photometric
   quantity is the radiometric one weighted by 683 V(lambda): flux W - lm, intensity W/sr - cd, irradiance W/m^2
   - lx, radiance W/(sr m^2) - cd/m^2; the functions below serve both. */
#define PT_LUMENS_PER_WATT 683.002

/* Flux (W or lm) of a point source of the same intensity in all directions, a Lambertian surface's exitance
   pi L, and the power of a spot of intensity I whose falloff is a smoothstep in the cosine, from 1 at cos_start
   to 0 at cos_end < cos_start. */
PTDEF double pt_flux_point(double intensity);
PTDEF double pt_exitance(double radiance);
PTDEF double pt_flux_spot(double intensity, double cos_start, double cos_end);
/* The inverses, for lamps that are sold by their flux: intensity of a point light of that flux, radiance of a
   Lambertian surface of that area (one side). */
PTDEF double pt_intensity_of_flux(double flux);
PTDEF double pt_radiance_of_flux(double flux, double area);
/* The flux per band in W of a lamp of that many lumens with the colour's ratios of bands: 683.002 lm/W times
   its luminance is the luminous flux. Black for a black colour. */
PTDEF pt_rgbd pt_watts_from_lumens(double lumens, pt_rgb colour);

/* Solid angle in sr of a cap of half angle theta in [0, pi]; of a triangle seen from p [Oos83]; of a rectangle
   corner + s e1 + t e2 (e1, e2 perpendicular); of a simple flat polygon of count >= 3 corners; of a disk of
   radius r > 0 in a plane at distance h > 0, its centre `offset` aside of the foot of p. */
PTDEF double pt_solid_angle_cap(double theta);
PTDEF double pt_solid_angle_triangle(pt_vec3 p, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2);
PTDEF double pt_solid_angle_rectangle(pt_vec3 p, pt_vec3 corner, pt_vec3 e1, pt_vec3 e2);
PTDEF double pt_solid_angle_polygon(pt_vec3 p, const pt_vec3 *v, int count);
PTDEF double pt_solid_angle_disk(double r, double h, double offset);

/* Irradiance in W/m^2 at distance d from a point source of radiant intensity I W/sr; cos_theta at the
   receiver (0 below the horizon). For a spot, multiply by pt_spot_falloff. */
PTDEF double pt_irradiance_point(double intensity, double d, double cos_theta);
PTDEF double pt_spot_falloff(double cos_axis, double cos_start, double cos_end);
/* ... from a sphere of radius r and uniform radiance L whose centre is at distance d > r in a direction with
   cosine cos_theta; what is below the receiver's horizon does not count. */
PTDEF double pt_irradiance_sphere(double radiance, double r, double d, double cos_theta);
/* ... from a disk of radius r in a plane parallel to the receiver at distance h > 0, its centre `offset` aside. */
PTDEF double pt_irradiance_disk(double radiance, double r, double h, double offset);
/* ... at p with normal n from a polygon of uniform radiance, by Lambert's formula [Lam60], the part below the
   horizon cut off. Both sides of the polygon count as emitting. count in [3, 32]. */
PTDEF double pt_irradiance_polygon(double radiance, pt_vec3 p, pt_vec3 n, const pt_vec3 *v, int count);

/* Form factors F_12: the fraction of the flux that leaves 1 (uniform, diffuse) and reaches 2 [How10]. All
   lengths > 0. Opposed rectangles a x b at distance c; rectangles w x l and h x l at right angles on the common
   edge l; coaxial disks r1 and r2 at distance h; a sphere and a coaxial disk of radius r, its plane at h from
   the sphere's centre. */
PTDEF double pt_form_factor_parallel(double a, double b, double c);
PTDEF double pt_form_factor_perpendicular(double w, double h, double l);
PTDEF double pt_form_factor_disks(double r1, double r2, double h);
PTDEF double pt_form_factor_sphere_disk(double r, double h);

/* Spectral radiance of a black body at a wavelength in nm, W sr^-1 m^-2 nm^-1, by Planck's law with the SI's
   constants; and its luminous efficacy in lm/W (12.4 at 2700 K: an incandescent lamp). T > 0 in K. */
PTDEF double pt_blackbody(double nm, double kelvin);
PTDEF double pt_blackbody_efficacy(double kelvin);

/* A spectrum as a table: value[i] at wavelength nm[i], rising; linear in between. */
typedef struct pt_spectrum {
    const double *nm, *value;
    int count;
    int zero_outside; /* 0 = the end values go on outside the table, 1 = nothing from the last entry on    */
} pt_spectrum;

/* The value at a wavelength in nm. */
PTDEF double pt_spectrum_at(const pt_spectrum *s, double nm);
/* CIE 1931 2-degree colour matching functions at nm (360..830, zero outside), from the 5 nm table by cubic
   interpolation; and the relative power of illuminant D65, 100 at 560 nm. */
PTDEF void pt_cie_xyz(double nm, double xyz[3]);
PTDEF double pt_cie_d65(double nm);
/* XYZ (Y = 1 for white) to linear sRGB; may be negative outside the gamut. */
PTDEF pt_rgbd pt_xyz_to_rgb(const double xyz[3]);
/* A reflectance spectrum to the RGB that it has under D65: XYZ by 1 nm sums, Y of a perfect white = 1. */
PTDEF pt_rgbd pt_reflectance_to_rgb(const pt_spectrum *reflectance);
/* An emission spectrum to RGB, normalised so that the constant spectrum 1 has Y = 1. */
PTDEF pt_rgbd pt_emission_to_rgb(const pt_spectrum *emission);

/* =====================================================================================================
   [PT-06] SHAPES AND RAYS: declarations
   ===================================================================================================== */

/* o + t d for 0 < t < tmax (tmax itself excluded). d need not have unit length; t is in units of d. */
typedef struct pt_ray {
    pt_vec3 o, d;
    pt_real tmax;
} pt_ray;

typedef enum pt_shape { PT_SHAPE_TRIANGLE = 0, PT_SHAPE_PARALLELOGRAM, PT_SHAPE_SPHERE } pt_shape;

/* Where a ray met a surface. */
typedef struct pt_hit {
    pt_real t;
    pt_vec3 p, p_error;  /* the point, and a bound of its rounding error per coordinate                    */
    pt_vec3 p_low, p_low_error; /* what rounding took from p (0 with PT_DOUBLE), and the error of p + p_low */
    pt_vec3 ng, ns;      /* unit geometric and shading normal, the second on the side of the first         */
    pt_vec2 uv;          /* texture coordinates; barycentric or edge weights where a mesh has none         */
    pt_real u, v;        /* position within the primitive: weights of corners 2 and 3, of edge 1 and 2     */
    int primitive;       /* number in the committed scene                                                  */
    pt_shape shape;
    int material;        /* index of its material                                                          */
    int light;           /* index of its light, -1 if it does not emit                                     */
} pt_hit;

/* Unit roundoff of pt_real, and Higham's gamma(n) = n u / (1 - n u): n roundings change a value by no more
   than this relative amount. */
PTDEF double pt_gamma(int n);

/* A ray from a point known up to p_error, on the side of ng into which w points. The origin is moved along
   ng by the error bound and rounded away from the surface, so that it cannot meet that surface again by
   rounding. */
PTDEF pt_ray pt_spawn_ray(pt_vec3 p, pt_vec3 p_error, pt_vec3 ng, pt_vec3 w);
/* The same from p towards q, both ends moved off their surfaces; d = q - p and tmax = 1. A point without a
   surface (a point light) has nq = 0 and q_error = 0. */
PTDEF pt_ray pt_spawn_ray_to(pt_vec3 p, pt_vec3 p_error, pt_vec3 np, pt_vec3 q, pt_vec3 q_error, pt_vec3 nq);

/* Does the ray meet the sphere? t in (0, tmax). */
PTDEF int pt_intersect_sphere(const pt_ray *ray, pt_vec3 centre, pt_real radius, double *t);
/* Does the ray meet the triangle? Watertight: two triangles that share an edge (the same two points) leave no
   gap [Woo13]. Edges and corners count as inside, a triangle seen edge-on does not. b: weights of corners 2
   and 3. */
PTDEF int pt_intersect_triangle(const pt_ray *ray, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2, double *t, double b[2]);
/* May the ray meet the box lo..hi? Conservative: never says no where exact arithmetic says yes. */
PTDEF int pt_intersect_box(const pt_ray *ray, pt_vec3 lo, pt_vec3 hi);

/* =====================================================================================================
   [PT-07] BOUNDING VOLUME HIERARCHY: declarations
   ===================================================================================================== */

#if PTI_HAS_BVH
/* An inner node has count 0 and its children at first and first + 1; a leaf has `count` entries of the
   tree's order array from `first`. */
typedef struct pt_bvh_node {
    pt_vec3 lo, hi;
    uint32_t first, count;
} pt_bvh_node;

/* A binary tree over boxes, built top down by the surface area heuristic with bins. */
typedef struct pt_bvh {
    pt_bvh_node *nodes;
    uint32_t *order;     /* permutation of the primitives, leaf by leaf                                    */
    uint32_t node_count, primitive_count;
    int depth;           /* edges from the root to the deepest leaf; at most PT_BVH_MAX_DEPTH              */
} pt_bvh;

#define PT_BVH_MAX_DEPTH 64

/* Builds over `count` boxes: lo[i] <= hi[i], all finite. O(n log n), deterministic. count 0 gives an empty
   tree. */
PTDEF pt_result pt_bvh_build(pt_bvh *bvh, const pt_vec3 *lo, const pt_vec3 *hi, uint32_t count,
                             void *alloc_user);
PTDEF void pt_bvh_free(pt_bvh *bvh, void *alloc_user);
#endif

/* =====================================================================================================
   [PT-07b] WIDE TREE: declarations
   ===================================================================================================== */

/* How a committed scene finds what a ray hits. All find the same, bit for bit. */
typedef enum pt_tree {
    PT_TREE_DEFAULT = 0,     /* the fastest of this build                                                  */
    PT_TREE_BINARY,          /* the tree of [PT-07], where the build has it                                */
    PT_TREE_NONE             /* none: every primitive is asked                                             */
} pt_tree;

#if PTI_HAS_WIDE
/* A tree of eight children a node over all primitives of a scene; made and freed with it. */
typedef struct pt_wide {
    void *memory;
    unsigned char *arena;    /* nodes and leaves, within memory                                            */
    size_t bytes;            /* of the arena; 0 = no tree                                                  */
    uint32_t root, things;   /* of all, and of all but walls                                               */
    uint32_t triangles;      /* primitives below this number are triangles                                 */
    uint32_t wall_count, walls[32]; /* large flat primitives, if there are no more of them                 */
    int plane_blocks, sphere_blocks; /* a small scene has these instead of a tree                          */
    float extent;            /* the largest coordinate, in magnitude                                       */
} pt_wide;
#endif

/* =====================================================================================================
   [PT-08] MATERIALS: declarations
   ===================================================================================================== */

typedef enum pt_material_kind {
    PT_MATERIAL_DIFFUSE = 0, /* Lambert: f = albedo / pi, on both sides                                    */
    PT_MATERIAL_MIRROR,      /* perfect mirror on both sides, reflectance = albedo                         */
    PT_MATERIAL_DIELECTRIC,  /* glass: exact Fresnel reflection and refraction; rough: GGX [Wal07]         */
    PT_MATERIAL_CONDUCTOR,   /* metal: exact Fresnel of eta and k, times albedo; rough: GGX, on both sides */
    PT_MATERIAL_OREN_NAYAR,  /* rough diffuse [Ore94], qualitative model; roughness = sigma in radians     */
    PT_MATERIAL_PHONG,       /* albedo / pi + specular (n+2)/(2 pi) cos^n of the angle to the mirror ray   */
    PT_MATERIAL_BLINN,       /* albedo / pi + specular N(n) cos^n of the half vector, N: 1 at the normal   */
    PT_MATERIAL_COAT,        /* diffuse base under a smooth dielectric coat, all inner reflections counted */
    PT_MATERIAL_MEASURED     /* a table in the MERL layout, times albedo, on both sides                    */
} pt_material_kind;

#if PTI_HAS_TEXTURES
typedef enum pt_texture_kind {
    PT_TEXTURE_IMAGE = 0,    /* bilinear, repeated in both directions                                      */
    PT_TEXTURE_CHECKER,      /* a and b in turns, one square per unit of uv times scale                    */
    PT_TEXTURE_FUNCTION      /* whatever the function returns                                              */
} pt_texture_kind;

/* A colour that varies over a surface. It multiplies the albedo of the materials that point to it, and must
   live as long as they do; every value must be in [0,1] (an image is checked, a function is trusted). */
typedef struct pt_texture {
    pt_texture_kind kind;
    const float *rgb;        /* image: width * height * 3 linear values, rows from the top (v = 1)         */
    int width, height;
    pt_vec2 scale;           /* repeats per unit of uv; 0 = 1                                              */
    pt_rgb a, b;             /* checker                                                                    */
    pt_rgb (*function)(void *user, pt_vec2 uv, pt_vec3 p); /* uv (unscaled) and point                      */
    void *user;
} pt_texture;

/* Its value. */
PTDEF pt_rgb pt_texture_eval(const pt_texture *texture, pt_vec2 uv, pt_vec3 p);
#endif

#if PTI_HAS_MEASURED
/* An isotropic BRDF as a table in the MERL layout [Mat03]: 90 x 90 x 180 cells of theta_h (by its square
   root), theta_d, phi_d. (The slides' theta_i, theta_o, |phi_i - phi_o| is what was measured; the table is of
   the half vector and the difference angles.) Start from PT_MEASURED_INIT. */
#define PT_MEASURED_CELLS 1458000
typedef struct pt_measured {
    void *alloc_user;
    double *value;           /* three planes of cells (R, G, B), each as in the file: f times 1500, 1500/1.15,
                                1500/1.66; negative where nothing was measured (counts as 0)               */
    double cdf[91];          /* of theta_h, for sampling                                                   */
} pt_measured;
#define PT_MEASURED_INIT PTI_ZERO_INIT

/* A BRDF in 1/sr: wo and wi are unit, with z along the normal, both above the surface. */
typedef pt_rgb (*pt_brdf_fn)(void *user, pt_vec3 wo, pt_vec3 wi);
/* One scattering event: from wo to wi with its weight f cos / pdf; 0: absorbed, or left below. */
typedef int (*pt_scatter_fn)(void *user, pt_vec3 wo, pt_pcg32 *random, pt_vec3 *wi, pt_rgb *weight);

/* The cell of a pair of directions, 0..PT_MEASURED_CELLS - 1. */
PTDEF int pt_measured_index(pt_vec3 wo, pt_vec3 wi);
/* The directions at the centre of a cell; 0 if one of them is below the surface. */
PTDEF int pt_measured_directions(int index, pt_vec3 *wo, pt_vec3 *wi);
/* The value of the cell in 1/sr. */
PTDEF pt_rgb pt_measured_eval(const pt_measured *m, pt_vec3 wo, pt_vec3 wi);
/* A virtual gonioreflectometer that knows the BRDF: its value at the centre of each cell, which must be finite and not
   negative. Cells whose centre is below the horizon stay unmeasured. Allocates 35 MB. */
PTDEF pt_result pt_measured_fill(pt_measured *m, pt_brdf_fn f, void *user);
/* One that does not, as a real one: it counts what `samples` rays that come in by the cosine scatter into
   each cell, and divides by what a white diffuse standard scatters there. Cells are joined in blocks of
   block^3 (a divisor of 90) so that each gets enough. This measures whatever scatter does: a BSDF, or paths
   traced in a piece of micro-geometry. Cells beyond reach stay unmeasured. */
PTDEF pt_result pt_measured_scatter(pt_measured *m, pt_scatter_fn scatter, void *user, uint64_t samples, int block,
                                    uint64_t seed);
PTDEF void pt_measured_free(pt_measured *m);
#endif

/* What a surface is made of. Zero is a black diffuse surface. Textures and tables stay the caller's. */
typedef struct pt_material {
    pt_material_kind kind;
    pt_rgb albedo;           /* reflectance in [0,1]; 0 = black. Dielectric: not used                      */
    pt_rgb emission;         /* emitted radiance >= 0, W sr^-1 m^-2; 0 = does not emit                     */
    pt_real ior;             /* index of refraction inside over outside, > 0; 0 = 1.5. Dielectric; coat > 1 */
    pt_real roughness;       /* in [0,1], 0 = smooth. GGX has alpha = roughness^2                          */
    pt_rgb eta, k;           /* conductor: complex index over that of the outside; eta > 0, k >= 0         */
    pt_rgb specular;         /* Phong, Blinn: reflectance of the glossy lobe; albedo + specular <= 1       */
    pt_real exponent;        /* Phong, Blinn: n in [0, 1e6]                                                */
#if PTI_HAS_TEXTURES
    const pt_texture *texture; /* multiplies the albedo; NULL = none                                       */
#endif
#if PTI_HAS_MEASURED
    const pt_measured *measured;
#endif
    int medium_inside;       /* medium ids of the two sides of the surface; 0 = vacuum. Stored for the     */
    int medium_outside;      /*   volumetric methods; must be 0 as long as there are none                  */
} pt_material;

PTDEF pt_material pt_material_diffuse(pt_rgb albedo);
/* Emission with black albedo. */
PTDEF pt_material pt_material_emitter(pt_rgb radiance);
PTDEF pt_material pt_material_mirror(pt_rgb reflectance);
PTDEF pt_material pt_material_dielectric(pt_real ior);
#if PTI_HAS_MICROFACET
PTDEF pt_material pt_material_rough_dielectric(pt_real ior, pt_real roughness);
/* eta and k per band; gold is about (0.14, 0.37, 1.44) and (3.98, 2.38, 1.60). */
PTDEF pt_material pt_material_conductor(pt_rgb eta, pt_rgb k, pt_real roughness);
/* Standard deviation sigma of the facets' angle in radians, at most 1. */
PTDEF pt_material pt_material_oren_nayar(pt_rgb albedo, pt_real sigma);
#endif
#if PTI_HAS_PHONG
PTDEF pt_material pt_material_phong(pt_rgb albedo, pt_rgb specular, pt_real exponent);
PTDEF pt_material pt_material_blinn(pt_rgb albedo, pt_rgb specular, pt_real exponent);
#endif
#if PTI_HAS_COAT
PTDEF pt_material pt_material_coat(pt_rgb albedo, pt_real ior);
#endif
#if PTI_HAS_MEASURED
PTDEF pt_material pt_material_measured(const pt_measured *table);
#endif

/* Kinds of scattering. Each lobe of a BSDF has one letter of the light-path alphabet. */
enum {
    PT_LOBE_DIFFUSE = 1,   /* D */
    PT_LOBE_GLOSSY = 2,    /* G */
    PT_LOBE_SPECULAR = 4,  /* S: a delta distribution; eval and pdf of it are 0 everywhere                 */
    PT_LOBE_ALL = 7
};

/* What is transported along wo: radiance (paths from the eye) or importance (paths from a light). Refraction
   scales radiance by the squared ratio of indices, importance not [Vea97] 5.2. */
typedef enum pt_transport { PT_RADIANCE = 0, PT_IMPORTANCE } pt_transport;

/* A material at a point. */
typedef struct pt_bsdf {
    const pt_material *material;
    pt_frame frame;          /* around the shading normal                                                  */
    pt_vec3 ng;              /* decides which side a direction is on                                       */
    pt_rgb albedo;           /* the material's, times its texture                                          */
    unsigned lobes;          /* which PT_LOBE_X it has                                                     */
} pt_bsdf;

/* One sampled direction. */
typedef struct pt_bsdf_sample_result {
    pt_vec3 wi;              /* where the path goes on (unit)                                              */
    pt_rgb weight;           /* f |cos| / pdf: the factor of the throughput                                */
    pt_real pdf_w;           /* density of wi per solid angle; for a delta lobe its probability            */
    pt_real pdf_rev_w;       /* the same with wo and wi exchanged                                          */
    unsigned lobe;           /* which PT_LOBE_X was sampled                                                */
    pt_real eta;             /* index on the side of wi over that of wo; 1 for reflection                  */
} pt_bsdf_sample_result;

/* The BSDF of a material at a hit. */
PTDEF pt_bsdf pt_bsdf_make(const pt_material *m, const pt_hit *hit);
/* f(wo, wi) in 1/sr, without cosine, summed over the lobes of the mask. Delta lobes give 0. The correction of
   importance transport for shading normals ([Vea97] 5.3) is the caller's. */
PTDEF pt_rgb pt_bsdf_eval(const pt_bsdf *b, pt_vec3 wo, pt_vec3 wi, pt_transport mode, unsigned lobes);
/* Density per solid angle with which pt_bsdf_sample, given wo, draws wi; 0 for delta lobes. */
PTDEF pt_real pt_bsdf_pdf_w(const pt_bsdf *b, pt_vec3 wo, pt_vec3 wi, pt_transport mode);
/* Draws wi; u_lobe chooses the lobe, u the direction. 0: nothing was sampled (the path ends). */
PTDEF int pt_bsdf_sample(const pt_bsdf *b, pt_vec3 wo, double u_lobe, pt_vec2 u, pt_transport mode,
                         pt_bsdf_sample_result *out);

/* Fresnel reflectance of a smooth dielectric for light polarised across (s) and in (p) the plane of incidence,
   and their mean r, that of unpolarised light. cos_i in [0,1], eta = index on the far side over that on the
   near side, > 0. cos_t: cosine of refraction, 0 at total reflection (then all are 1). */
typedef struct pt_fresnel {
    double rs, rp, r, cos_t;
} pt_fresnel;
PTDEF pt_fresnel pt_fresnel_make(double cos_i, double eta);
/* The mean alone. */
PTDEF double pt_fresnel_dielectric(double cos_i, double eta, double *cos_t);
/* Schlick's approximation r0 + (1 - r0)(1 - cos)^5 [Sch94]: from the near side of the larger index the cosine
   is that of refraction, and 1 at total reflection. For comparison: the materials use the exact formula. */
PTDEF double pt_fresnel_schlick(double cos_i, double eta);
/* Mean reflectance of diffuse (cosine-distributed) light at a smooth dielectric. */
PTDEF double pt_fresnel_diffuse(double eta);
#if PTI_HAS_MICROFACET
/* Reflectance of unpolarised light at a metal of index eta - i k over that of the near side. */
PTDEF double pt_fresnel_conductor(double cos_i, double eta, double k);
/* The GGX microfacet distribution [Wal07] around z: density of normals per area and solid angle, Smith's masking
   function G1, and the density of the normals that are visible from wo. alpha > 0. */
PTDEF double pt_ggx_d(pt_vec3 h, double alpha);
PTDEF double pt_ggx_g1(pt_vec3 w, double alpha);
PTDEF double pt_ggx_visible_pdf_w(pt_vec3 wo, pt_vec3 h, double alpha);
/* Draws a visible normal; wo above the surface. */
PTDEF pt_vec3 pt_ggx_visible_sample(pt_vec3 wo, double alpha, pt_vec2 u);
#endif

/* =====================================================================================================
   [PT-09] LIGHTS: declarations
   ===================================================================================================== */

typedef enum pt_light_kind {
    PT_LIGHT_AREA = 0,       /* an emissive primitive                                                      */
    PT_LIGHT_POINT,          /* intensity I W/sr in all directions                                         */
    PT_LIGHT_SPOT,           /* the same within a cone, with a smooth rim                                  */
    PT_LIGHT_DIRECTIONAL,    /* parallel light of a given irradiance from infinity                         */
    PT_LIGHT_ENVIRONMENT     /* radiance from infinity: constant or an image                               */
} pt_light_kind;

/* A light of the committed scene. */
typedef struct pt_light {
    pt_light_kind kind;
    int primitive;           /* area: which one                                                            */
    pt_vec3 position;        /* point, spot                                                                */
    pt_vec3 direction;       /* spot, directional: where the light goes (unit)                             */
    double omc_start, omc_end; /* spot: 1 - cos of the angles of full intensity, and of none               */
    pt_rgb emission;         /* radiance (environment: its mean), intensity, or irradiance (directional)   */
    double area;             /* area: m^2                                                                  */
    double pmf;              /* probability to be chosen: its share of the power                           */
} pt_light;

/* Light that arrives at a point from one sampled direction. */
typedef struct pt_light_sample_result {
    pt_vec3 wi;              /* unit direction from the point to the light                                 */
    pt_vec3 p, p_error, n;   /* the point on the light and its normal; n = 0 for delta lights, environment */
    pt_real distance;        /* to p; larger than the scene for lights at infinity                         */
    pt_rgb radiance;         /* what arrives if nothing is in between; delta lights: irradiance across wi  */
    double pdf_w;            /* density per solid angle given this light; 1 for delta lights               */
    int delta;               /* 1: point, spot, directional: no other technique can find this light        */
    int infinite;            /* 1: the light is at infinity                                                */
} pt_light_sample_result;

/* Light that leaves a light. */
typedef struct pt_light_emission_result {
    pt_vec3 p, p_error, n;   /* where (n = 0 unless an area light)                                         */
    pt_vec3 w;               /* and into which direction                                                   */
    pt_rgb radiance;         /* emitted radiance, intensity (point, spot) or irradiance (directional)      */
    double pdf_a;            /* density of p per area; 1 for point and spot. At infinity: on a disk across
                                w as wide as the scene                                                     */
    double pdf_w;            /* density of w per solid angle given p; directional: 1                       */
    double cos_n;            /* |w . n|; 1 unless an area light                                            */
} pt_light_emission_result;

/* =====================================================================================================
   [PT-10] SCENE, CAMERA, FILM: declarations
   ===================================================================================================== */

typedef struct pt_triangle {
    uint32_t v[3];           /* indices of positions                                                       */
    int material;
    int mesh;                /* which mesh it came with                                                    */
} pt_triangle;

/* Per-vertex data of a mesh: add the offset to an index of positions; none if has_x is 0. */
typedef struct pt_mesh {
    int64_t normal_offset, uv_offset;
    int has_normals, has_uvs;
} pt_mesh;

typedef struct pt_sphere {
    pt_vec3 centre;
    pt_real radius;
    int material;
} pt_sphere;

typedef struct pt_parallelogram {
    pt_vec3 corner, edge1, edge2;
    int material;
} pt_parallelogram;

/* A light that no ray can hit. */
typedef struct pt_delta_light {
    pt_light_kind kind;      /* point, spot or directional                                                 */
    pt_vec3 position, direction;
    pt_rgb intensity;        /* directional: irradiance across the direction                               */
    double omc_start, omc_end; /* spot: 1 - cos of its angles                                              */
} pt_delta_light;

/* An environment image with the distribution of its light over its pixels: rows by rows[], columns within row y
   by columns[y (width + 1) ...]. */
typedef struct pt_environment_map {
    float *rgb;              /* width * height * 3, rows from the zenith (+y)                              */
    double *rows, *columns;  /* cumulative                                                                 */
    int width, height;
    double scale;            /* of the values                                                              */
} pt_environment_map;

/* One entry of the committed scene's list of primitives: a kind and an index into the array of that kind. */
typedef struct pt_primitive {
    pt_shape shape;
    uint32_t index;
    int light;               /* -1 if it does not emit                                                     */
} pt_primitive;

/* What a scene uses; pt_scene_needs returns the union. Materials stand in the order of their kinds, lights in
   that of theirs. */
enum {
    PT_NEEDS_TRIANGLES = 1 << 0,
    PT_NEEDS_PARALLELOGRAMS = 1 << 1,
    PT_NEEDS_SPHERES = 1 << 2,
    PT_NEEDS_SHADING_NORMALS = 1 << 3,
    PT_NEEDS_UVS = 1 << 4,
    PT_NEEDS_DIFFUSE = 1 << 5,
    PT_NEEDS_MIRROR = 1 << 6,
    PT_NEEDS_DIELECTRIC = 1 << 7,
    PT_NEEDS_CONDUCTOR = 1 << 8,
    PT_NEEDS_OREN_NAYAR = 1 << 9,
    PT_NEEDS_PHONG = 1 << 10,
    PT_NEEDS_BLINN = 1 << 11,
    PT_NEEDS_COAT = 1 << 12,
    PT_NEEDS_MEASURED = 1 << 13,
    PT_NEEDS_ROUGHNESS = 1 << 14, /* rough glass or metal                                                  */
    PT_NEEDS_TEXTURES = 1 << 15,
    PT_NEEDS_AREA_LIGHTS = 1 << 16,
    PT_NEEDS_POINT_LIGHTS = 1 << 17,
    PT_NEEDS_SPOT_LIGHTS = 1 << 18,
    PT_NEEDS_DIRECTIONAL_LIGHTS = 1 << 19,
    PT_NEEDS_ENVIRONMENT = 1 << 20,
    PT_NEEDS_ENVIRONMENT_IMAGE = 1 << 21,
    PT_NEEDS_BVH = 1 << 22,
    PT_NEEDS_ALL = (1 << 23) - 1
};

/* A scene: add to it, pt_commit it, render it, free it. Start from PT_SCENE_INIT. The fields are for reading,
   but alloc_user, which is handed to PT_MALLOC and its kin, and those that say how pt_commit works. */
typedef struct pt_scene {
    void *alloc_user;
    /* how pt_commit works */
    pt_tree tree;            /* which tree rays walk                                                       */
    int threads;             /* 0 = as many as the machine has                                             */
    pt_parallel_fn parallel; /* NULL = own threads                                                         */
    void *parallel_user;
    /* added by the user */
    pt_material *materials;
    pt_vec3 *positions, *normals;
    pt_vec2 *uvs;
    pt_triangle *triangles;
    pt_mesh *meshes;
    pt_sphere *spheres;
    pt_parallelogram *parallelograms;
    pt_delta_light *delta_lights;
    uint32_t material_count, position_count, normal_count, uv_count, triangle_count, mesh_count, sphere_count,
        parallelogram_count, delta_light_count;
    uint32_t material_capacity, position_capacity, normal_capacity, uv_capacity, triangle_capacity,
        mesh_capacity, sphere_capacity, parallelogram_capacity, delta_light_capacity;
    void **owned;            /* blocks that live as long as the scene: the textures of loaded models       */
    uint32_t owned_count, owned_capacity;
    pt_rgb environment;      /* constant radiance, or the mean of the image                                */
#if PTI_HAS_ENVIRONMENT
    pt_environment_map map;  /* rgb = NULL: constant                                                       */
#endif
    /* made by pt_commit */
    pt_primitive *primitives;
    pt_light *lights;
    uint32_t primitive_count, light_count;
    pt_alias light_table;
#if PTI_HAS_BVH
    pt_bvh bvh;              /* PT_TREE_BINARY, or a build without the wide one                            */
#endif
#if PTI_HAS_WIDE
    pt_wide wide;
#endif
    pt_vec3 lo, hi;          /* bounds of all primitives                                                   */
    uint32_t degenerate_count; /* triangles and parallelograms without area: left out, never hit           */
    unsigned needs;
    int environment_light;   /* its light index, -1 without                                                */
    int committed;
    pt_result error;
    char error_text[160];
} pt_scene;

#define PT_SCENE_INIT PTI_ZERO_INIT

/* Each returns the new item's id (>= 0), or -1 and leaves the scene's first error in pt_scene_error. All
   numbers must be finite; coordinates at most PT_MAX_COORDINATE in magnitude. */
PTDEF int pt_add_material(pt_scene *scene, pt_material material);
PTDEF int pt_add_triangle(pt_scene *scene, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2, int material);
/* Four corners in order, as the triangles (v0,v1,v2) and (v0,v2,v3). Returns the first triangle's id. */
PTDEF int pt_add_quad(pt_scene *scene, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2, pt_vec3 v3, int material);
PTDEF int pt_add_parallelogram(pt_scene *scene, pt_vec3 corner, pt_vec3 edge1, pt_vec3 edge2, int material);
/* radius > 0 */
PTDEF int pt_add_sphere(pt_scene *scene, pt_vec3 centre, pt_real radius, int material);
/* An indexed mesh: 3 * triangle_count indices below vertex_count. normals and uvs have vertex_count entries
   or are NULL; normals need not be unit, but not zero. Everything is copied. Returns the mesh's id. */
PTDEF int pt_add_mesh(pt_scene *scene, const pt_vec3 *positions, const pt_vec3 *normals, const pt_vec2 *uvs,
                      uint32_t vertex_count, const uint32_t *indices, uint32_t triangle_count, int material);
/* intensity >= 0 in W/sr */
PTDEF int pt_add_point_light(pt_scene *scene, pt_vec3 position, pt_rgb intensity);
/* A spot light: intensity >= 0 in W/sr along the axis `direction` and up to start_deg from it, falling smoothly
   (pt_spot_falloff) to 0 at end_deg; 0 <= start_deg < end_deg <= 180. */
PTDEF int pt_add_spot_light(pt_scene *scene, pt_vec3 position, pt_vec3 direction, pt_rgb intensity, double start_deg,
                            double end_deg);
/* Parallel light that goes along `direction`, irradiance >= 0 in W/m^2 across it. */
PTDEF int pt_add_directional_light(pt_scene *scene, pt_vec3 direction, pt_rgb irradiance);
#if PTI_HAS_ENVIRONMENT
/* Constant radiance >= 0 from every direction that leaves the scene. Returns 0, or -1. */
PTDEF int pt_set_environment(pt_scene *scene, pt_rgb radiance);
/* Radiance from a latitude-longitude image times `scale`: rows from the zenith (+y), the middle column is -z, the
   column right of it towards +x. rgb: width * height * 3 finite values >= 0, copied. Sampled in proportion to
   luminance and solid angle of each pixel; constant over a pixel. Returns 0, or -1. */
PTDEF int pt_set_environment_image(pt_scene *scene, const float *rgb, int width, int height, double scale);
/* The radiance that arrives from direction w (unit). */
PTDEF pt_rgb pt_environment_radiance(const pt_scene *scene, pt_vec3 w);
#endif

/* Coordinates, edges and radii beyond this are refused: squares of distances must stay in range, and a
   float has no digits left for a picture there. */
#define PT_MAX_COORDINATE 1e18

/* Makes the scene ready: primitives, lights, tree, needs mask. May be called again after additions. Returns
   the scene's first error. A scene without any primitive is allowed. */
PTDEF pt_result pt_commit(pt_scene *scene);
/* The first error as a sentence that names the item: "material 3: ior -1 is not positive". Never NULL. */
PTDEF const char *pt_scene_error(const pt_scene *scene);
/* The PT_NEEDS_X mask of a committed scene, and the same in words, written to buffer and returned. */
PTDEF unsigned pt_scene_needs(const pt_scene *scene);
PTDEF const char *pt_scene_needs_string(const pt_scene *scene, char *buffer, size_t size);
/* Frees everything; the scene is as PT_SCENE_INIT made it, alloc_user kept. */
PTDEF void pt_scene_free(pt_scene *scene);

/* The nearest hit in (0, tmax), with everything filled in. Equal distances: the lower primitive wins. */
PTDEF int pt_intersect(const pt_scene *scene, const pt_ray *ray, pt_hit *hit);
/* Is there any hit in (0, tmax)? */
PTDEF int pt_occluded(const pt_scene *scene, const pt_ray *ray);

/* Chooses a light by power, u in [0,1). -1 if the scene has none. */
PTDEF int pt_light_choose(const pt_scene *scene, double u, double *pmf);
/* Samples the light as seen from p; 0 if it cannot light p (behind it, no extent). Area lights by solid
   angle. */
PTDEF int pt_light_sample(const pt_scene *scene, int light, pt_vec3 p, pt_vec2 u, pt_light_sample_result *out);
/* The density per solid angle at p with which pt_light_sample finds what a ray from p along w (unit) hit: `hit` on
   an area light, or NULL for the environment. Without the probability of the choice. */
PTDEF double pt_light_pdf_w(const pt_scene *scene, int light, pt_vec3 p, pt_vec3 w, const pt_hit *hit);
/* Samples a ray that leaves the light: a point with u_p, a direction with u_w, u_side chooses the side of a
   sphere. */
PTDEF int pt_light_sample_le(const pt_scene *scene, int light, pt_vec2 u_p, pt_vec2 u_w, pt_real u_side,
                             pt_light_emission_result *out);
/* Its two densities, for emission into w from any point that has normal n. `light` must exist. */
PTDEF void pt_light_pdf_le(const pt_scene *scene, int light, pt_vec3 n, pt_vec3 w, double *pdf_a,
                           double *pdf_w);
/* Radiance that hit's surface emits towards wo. */
PTDEF pt_rgb pt_hit_emission(const pt_scene *scene, const pt_hit *hit, pt_vec3 wo);

/* A pinhole or thin-lens camera. Image points have x from the left, y from the top, both in [0,1]. */
typedef struct pt_camera {
    pt_vec3 position, right, up, forward; /* unit, right = forward x up                                    */
    pt_real tan_half;        /* tangent of half the vertical field of view; 0 = not set                    */
    pt_real lens_radius;     /* 0 = pinhole                                                                */
    pt_real focus_distance;  /* of the plane in focus, along forward; 0 = 1                                */
    pt_real near_distance;   /* nothing nearer than this, along forward, is seen; 0 = everything is        */
} pt_camera;

/* From eye towards target, `up` upwards in the picture (not parallel to the view), vfov_deg in (0,180). A
   camera that cannot be made has tan_half 0, which pt_render refuses. */
PTDEF pt_camera pt_camera_look_at(pt_vec3 eye, pt_vec3 target, pt_vec3 up, pt_real vfov_deg);
/* Vertical field of view in degrees of a film of that height behind a lens of that focal length (the same unit). */
PTDEF double pt_vfov_deg_of_film(double film_height, double focal_length);
/* The ray through image point (x,y) of a picture with aspect = width / height; lens in [0,1)^2. */
PTDEF pt_ray pt_camera_ray(const pt_camera *camera, pt_real aspect, pt_real x, pt_real y, pt_vec2 lens);

/* What a point p sends to the camera. */
typedef struct pt_camera_we_result {
    pt_vec3 wi;              /* unit direction from p to the lens                                          */
    pt_vec3 lens;            /* the point on the lens                                                      */
    pt_real x, y;            /* image point                                                                */
    double distance;
    double we;               /* importance, 1/(sr m^2), such that a picture of constant radiance L measures
                                L in the mean over the image                                               */
    double pdf_w;            /* density per solid angle at p with which the lens point was sampled: for a
                                pinhole distance^2 / cos (a point has density 1), so that
                                beta f |cos| we / pdf_w is the contribution                                */
    double cos_lens;
} pt_camera_we_result;

/* Importance of the camera at p [Vea97] 8.3, [PBR] 16.1.1. 0: p is not in the picture. */
PTDEF int pt_camera_we(const pt_camera *camera, pt_real aspect, pt_vec3 p, pt_vec2 lens,
                       pt_camera_we_result *out);
/* Densities of a camera ray: of its lens point per area (1 for a pinhole) and of its direction. */
PTDEF void pt_camera_pdf(const pt_camera *camera, pt_real aspect, pt_vec3 direction, double *pdf_a,
                         double *pdf_w);

/* How a pixel weighs the image around its centre. Filters are sampled, not weighted with: a sample belongs to one
   pixel, which is then the plain mean of its samples. */
typedef enum pt_filter {
    PT_FILTER_BOX = 0,       /* the square of half width `radius`; default 0.5: the pixel itself           */
    PT_FILTER_TENT,          /* a pyramid of half width `radius`; default 1                                */
    PT_FILTER_GAUSSIAN       /* sigma = radius / 3, cut off at the circle of that radius; default 1.5      */
} pt_filter;

/* A point of the filter in pixels from the centre, each with density proportional to the filter; radius 0 = the
   default. */
PTDEF pt_vec2 pt_filter_sample(pt_filter filter, double radius, pt_vec2 u);

/* A range of sample indices, the end excluded. */
typedef struct pt_range {
    uint32_t begin, end;
} pt_range;

/* Sums per pixel, row by row from the top, three values each. Samples with even index go to half A, odd ones
   to half B; the halves are independent, so that their difference tells the error. Start from
   PT_FILM_INIT. */
typedef struct pt_film {
    void *alloc_user;
    double *half[2];         /* width * height * 3 sums                                                    */
    double *splat[2];        /* contributions of light paths, NULL without; same scale                     */
    double *albedo, *normal; /* width * height * 3 sums over all samples, NULL unless asked for            */
    double *depth;           /* width * height: sums of distances from the ray's origin, misses add 0      */
    double *classes;         /* class_count pictures of width * height * 3 sums, one for each class of light
                                paths, NULL unless asked for; together they are the whole                  */
    int class_count;
    int width, height;
    uint32_t samples[2];     /* per pixel, in each half                                                    */
    pt_range *ranges;        /* which samples are in: disjoint, rising                                     */
    uint32_t range_count, range_capacity;
    uint64_t fingerprint;    /* of scene, camera, method, sampler, seed, precision, version                */
    uint64_t nonfinite;      /* contributions that were NaN or infinite and counted as zero                */
} pt_film;

#define PT_FILM_INIT PTI_ZERO_INIT

/* A contribution of a light path to a pixel. */
typedef struct pt_splat {
    uint32_t pixel;
    uint32_t half;
    pt_rgb value;
} pt_splat;

/* Contributions collected by one task; lists are added to the film in the order of the tasks, so the sums do
   not depend on which thread ran which. Start from all zero. */
typedef struct pt_splat_list {
    void *alloc_user;
    pt_splat *items;
    size_t count, capacity;
} pt_splat_list;

#define PT_SPLAT_LIST_INIT PTI_ZERO_INIT

/* An empty film of width x height pixels, each in [1, 65536]. aov != 0 adds albedo, normal and depth. Frees
   what the film held. */
PTDEF pt_result pt_film_make(pt_film *film, int width, int height, int aov);
/* Makes room for that many classes of light paths in an empty film. */
PTDEF pt_result pt_film_make_classes(pt_film *film, int class_count);
/* The picture of one class as a film of its own, for the writers: `out` is made anew; its halves are not told
   apart, so it has no error estimate. */
PTDEF pt_result pt_film_class(const pt_film *film, int index, pt_film *out);
/* The value of a pixel: the mean over all samples, splats included; black outside and in an empty film. */
PTDEF pt_rgbd pt_film_pixel(const pt_film *film, int x, int y);
/* All samples per pixel. */
PTDEF uint32_t pt_film_spp(const pt_film *film);
/* Notes that samples begin..end are in. Refuses overlap. */
PTDEF pt_result pt_film_add_range(pt_film *film, uint32_t begin, uint32_t end);
/* Adds the sums of b to a. Both must have the same size and fingerprint, and no sample in common. */
PTDEF pt_result pt_film_merge(pt_film *a, const pt_film *b);
/* Appends to a list; grows it. */
PTDEF pt_result pt_splat_add(pt_splat_list *list, uint32_t pixel, uint32_t half, pt_rgb value);
/* Adds a list to the film's splat layer (made on first use). */
PTDEF pt_result pt_film_add_splats(pt_film *film, const pt_splat_list *list);
PTDEF void pt_splat_list_free(pt_splat_list *list);
PTDEF void pt_film_free(pt_film *film);

/* How wrong a picture is. rmse: root of the mean squared error over pixels and bands. relmse: mean of
   (I-R)^2 / (R^2 + (0.1 * mean luminance of R)^2). relmse_001: mean of (I-R)^2 / (R^2 + 0.01). */
typedef struct pt_error {
    double rmse, relmse, relmse_001;
} pt_error;

/* The error estimated from the two halves, without a reference: nA nB / (nA + nB)^2 * (A-B)^2 is an unbiased
   estimate of a pixel's squared error if nA = nB, or if a half's variance falls as 1/n (Sobol points beat that,
   so odd counts overestimate a little). It cannot see what both halves miss. R is the picture itself: while a
   picture is mostly noise, relmse divides by that noise, comes out too small, and may rise with the samples; rmse
   does neither. 0 if unknown (one half empty). */
PTDEF int pt_film_error_estimate(const pt_film *film, pt_error *out);
/* The error against a reference picture of the same size (rows from the top, RGB). */
PTDEF void pt_film_error(const pt_film *film, const float *reference, pt_error *out);

/* =====================================================================================================
   [PT-11] INTEGRATORS: declarations
   ===================================================================================================== */

typedef enum pt_roulette {
    PT_ROULETTE_THROUGHPUT = 0, /* survive with min(1 - 2^-24, roulette_scale * largest band of throughput, corrected
                                   for eta^2)                                                              */
    PT_ROULETTE_CONSTANT,       /* survive with roulette_survival, as the slides' P_RR                       */
    PT_ROULETTE_NONE            /* only max_edges ends a path: needs max_edges > 0                           */
} pt_roulette;

#if PTI_HAS_OBSERVER
/* Told of each contribution to a path's radiance, for light-path expressions: `word` reads from the light to
   the eye over L D G S E ("LDDE"), `value` is already weighted. With more than PT_WORD_MAX letters between L
   and E the last ones before the eye are kept and '*' stands for L and the others. Values of one path sum to
   its radiance up to rounding; observing changes no random number. Where a surface has lobes of two letters, light
   that was sampled is told lobe by lobe, but a path goes on under the letter of the lobe that was drawn: exact
   classes are what light-path expressions are for. */
typedef void (*pt_observer)(void *user, const char *word, int edges, pt_rgbd value);
#define PT_WORD_MAX 60
#endif

#if PTI_HAS_LPE
/* Light-path expressions: regular expressions over words that read from the light to the eye, L first, E last,
   between them one letter for each surface: D diffuse, G glossy (rough), S specular (mirror, glass), V volume.
   '.' is any of DGSV, [DG] one of a set, ( ) group, | or, * any number, + one or more, ? one or none. A list of
   expressions divides light into classes: a path belongs to the first that matches, what none matches to one
   more class at the end, so that the classes add up to the whole. */
#define PT_LPE_EXPRESSIONS 16 /* most expressions of a list */
#define PT_LPE_STATES 64
typedef struct pt_lpe {
    int class_count;            /* expressions + 1                                                         */
    int state_count;
    unsigned char next[PT_LPE_STATES][5]; /* automaton from the eye (state 0: E was read) by D G S V       */
    unsigned char class_of[PT_LPE_STATES]; /* the class of the path if the light comes now                 */
} pt_lpe;
/* The rows of the slides, G counted as D: emission, direct, specular, caustic, colour bleeding, reflected
   caustic or bleeding, other, volume; and the words LE | L(D|S)E | L(S|D)S+E | LS+DE | L(S|D)*DDE | ... */
#define PT_LPE_SLIDES_COUNT 8
PTDEF const char *const *pt_lpe_slides(void);
/* Compiles a list. *error (may be NULL): what is wrong with it. PT_ERROR_ARGUMENT: not an expression, more than
   64 letters in one, or an automaton of more than PT_LPE_STATES states. */
PTDEF pt_result pt_lpe_compile(pt_lpe *lpe, const char *const *expressions, int count, const char **error);
/* The class of a word such as "LSDE", -1 if it is no word. */
PTDEF int pt_lpe_class(const pt_lpe *lpe, const char *word);
#endif

/* How to follow a path; zero is the default. */
typedef struct pt_li_options {
    int max_edges;              /* 0 = no limit; see CONVENTIONS                                           */
    pt_roulette roulette;
    pt_real roulette_survival;  /* PT_ROULETTE_CONSTANT: in (0, 1); 0 = 0.8                                */
    pt_real roulette_scale;     /* PT_ROULETTE_THROUGHPUT: > 1 lets paths live longer, which pays where edges are cheap
                                   and their numbers well spread; 0 = 4 in lockstep where lanes ask for all
                                   primitives or for walls, else 1                                         */
    int roulette_start;         /* edges before the first roulette, >= 1; 0 = 1 if constant, else 3        */
    pt_heuristic heuristic;     /* of multiple importance sampling                                         */
#if PTI_HAS_WHITTED
    int branching;              /* method "branching": directions per hit; 0 = 4                           */
    pt_rgb ambient;             /* method "local": the slides' ambient light, times albedo                 */
#endif
#if PTI_HAS_LPE
    const pt_lpe *lpe;          /* path methods and "distribution": classes to tell apart, NULL = none     */
#endif
    int (*poll)(void *user);    /* asked every 2^16 edges of a path, from the thread that renders it;
                                   non-zero ends it (NULL = never)                                         */
    void *poll_user;
#if PTI_HAS_OBSERVER
    pt_observer observer;       /* NULL = none. Called from the rendering threads                          */
    void *observer_user;
#endif
} pt_li_options;

/* What else is known of a path. */
typedef struct pt_li_info {
    uint64_t rays;              /* rays traced, shadow rays included (added to)                            */
    int edges;                  /* edges of the path, shadow edges not counted                             */
    int cancelled;              /* 1: ended by poll; the result means nothing                                 */
    int hit;                    /* 1: the first ray met a surface, and these are set:                      */
    pt_rgb albedo;
    pt_vec3 normal;
    pt_real depth;
#if PTI_HAS_LPE
    pt_rgbd *classes;           /* with options->lpe: class_count sums, added to; not NULL then            */
#endif
} pt_li_info;

/* Estimates the radiance that arrives along a ray, from however far (tmax and the length of d do not matter).
   The one signature of every camera-path method. */
typedef pt_rgbd (*pt_li_fn)(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                            const pt_li_options *options, pt_li_info *info);

/* Path tracing [Kaj86] with light sampling and BSDF sampling combined by multiple importance sampling. */
PTDEF pt_rgbd pt_li_path(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                         const pt_li_options *options, pt_li_info *info);
#if PTI_HAS_ALL_METHODS
/* Plain: light is found by hitting it only. Point lights are never found. */
PTDEF pt_rgbd pt_li_path_plain(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                               const pt_li_options *options, pt_li_info *info);
/* Light sampling only: a light that is hit counts only where it could not be sampled (seen directly or after
   a delta lobe). */
PTDEF pt_rgbd pt_li_path_light(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                               const pt_li_options *options, pt_li_info *info);
#endif
#if PTI_HAS_WHITTED
/* Methods of the time before path tracing; what each leaves out is the point of having it. max_edges 0 means 12
   edges for "whitted" and "distribution", 4 for "branching"; "whitted" and "branching" follow at most 64. Both "local"
   and "whitted" leave out light from the environment, which has no middle, but show it as background.
   local: the slides' L = ka Ia + sum of (I/r^2) (kd max(0, n.l) + ks max(0, n.h)^p), no shadows, no reflections; kd,
   ks, p are albedo, specular, exponent (a mirror, which has no kd of its own, shows its albedo: white); every light as
   if all of it came from its middle. */
PTDEF pt_rgbd pt_li_local(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler, const pt_li_options *options,
                          pt_li_info *info);
/* Whitted's tree [Whi80]: shadow rays to the middle of every light, mirror and refracted rays followed both; paths
   L(D|G)?S*E. Deterministic but for the pixel: hard shadows. */
PTDEF pt_rgbd pt_li_whitted(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler, const pt_li_options *options,
                            pt_li_info *info);
/* Distribution ray tracing [Coo84]: pixel, lens, lights and gloss are sampled, light between diffuse surfaces is
   not: paths L(D|G|S)?(G|S)*E. */
PTDEF pt_rgbd pt_li_distribution(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                                 const pt_li_options *options, pt_li_info *info);
/* The slides' first solver of the rendering equation: options->branching directions at every hit, light found by
   hitting it; rays grow as branching^edges. */
PTDEF pt_rgbd pt_li_branching(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                              const pt_li_options *options, pt_li_info *info);
#endif

/* =====================================================================================================
   [PT-17] FILES: declarations
   ===================================================================================================== */

#if PTI_HAS_FILES
/* All that is written goes to path.part first, is flushed, synced to the disk where the system shows how (POSIX
   fsync, Windows _commit; nowhere with strict -std=c99 after another header), and then renamed: under `path` stands
   what was there before or the whole new file, also when the disk is full. PT_ERROR_FILE if not; path.part is removed.

   The film's picture times `exposure` (>= 0), clipped, with the sRGB transfer; PPM is binary (P6) with 8 bits, PNG
   has 8 bits. PFM: linear float, rows from the bottom, little-endian. */
PTDEF pt_result pt_write_ppm(const char *path, const pt_film *film, double exposure);
PTDEF pt_result pt_write_pfm(const char *path, const pt_film *film);
PTDEF pt_result pt_write_png(const char *path, const pt_film *film, double exposure);
/* PPM as binary numbers (P6) or as text (P3), one pixel a line, with 8 or with 16 bits (values to 65535; in P6 the
   more significant byte first). */
typedef enum pt_ppm_kind { PT_PPM_P6 = 0, PT_PPM_P6_16, PT_PPM_P3, PT_PPM_P3_16 } pt_ppm_kind;
PTDEF pt_result pt_write_ppm_as(const char *path, const pt_film *film, double exposure, pt_ppm_kind kind);
/* The same from plain arrays: rows from the top, three bytes or three floats a pixel. What PNG needs to work
   in is allocated with user = NULL. PNG: at most 600 megapixels. */
PTDEF pt_result pt_write_ppm_bytes(const char *path, const unsigned char *rgb, int width, int height);
PTDEF pt_result pt_write_png_bytes(const char *path, const unsigned char *rgb, int width, int height);
PTDEF pt_result pt_write_pfm_floats(const char *path, const float *rgb, int width, int height);

/* The whole state of a film (at most 1024 classes), bit for bit: sums of both halves and of splats, albedo, normal,
   depth, classes, counts, ranges of samples, fingerprint. A render that goes on with a film from a file ends with
   the bits of one that was never interrupted. PT_ERROR_ARGUMENT for an empty film, and for one whose ranges do not
   hold as many samples as it counts. */
PTDEF pt_result pt_film_write(const char *path, const pt_film *film);
/* Reads it; what the film held is freed first. PT_ERROR_FILE: not there, not a film, truncated or changed (a 64-bit
   checksum covers every byte, and is asked before memory is). PT_ERROR_MISMATCH: a whole film in another version of
   the format. Then, and without memory, the film stays empty. */
PTDEF pt_result pt_film_read(const char *path, pt_film *film);

/* A picture in memory: width * height * 3 linear values, rows from the top. Start from PT_IMAGE_INIT. */
typedef struct pt_image {
    void *alloc_user;
    float *rgb;
    int width, height;
} pt_image;
#define PT_IMAGE_INIT PTI_ZERO_INIT
/* Reads a picture, whatever its name: PFM (PF, either byte order; linear), PPM (P6 and P3, values up to 65535) or PNG
   (all colour types and depths, interlaced too; alpha is dropped), whose sRGB transfer is undone. A file that is
   truncated, beyond 2 GiB, larger than 65536 pixels a side or anything else, or whose checksums (PNG) are wrong, is
   PT_ERROR_FILE, and the image stays empty. Memory is asked for only where the size of the file bears it out. */
PTDEF pt_result pt_read_image(const char *path, pt_image *image);
PTDEF void pt_image_free(pt_image *image);

#if PTI_HAS_MEASURED
/* A table as a file in the MERL format: three 32-bit integers 90 90 180, then the three planes as 64-bit floats, all
   little-endian. Other sizes, truncated files, NaN and values beyond 1e30 are PT_ERROR_FILE. */
PTDEF pt_result pt_measured_write(const char *path, const pt_measured *m);
PTDEF pt_result pt_measured_read(const char *path, pt_measured *m);
#endif
#endif

#if PTI_HAS_OBJ
enum {
    PT_OBJ_MATERIAL = 1,     /* faces without a material get options.material, not a diffuse grey of 0.8   */
    PT_OBJ_NO_MTL = 2,       /* no MTL file is read: all faces are without a material                      */
    PT_OBJ_NO_TEXTURES = 4   /* map_Kd is ignored                                                          */
};

/* How to load a model; zero means the default. Start from PT_OBJ_OPTIONS_INIT. */
typedef struct pt_obj_options {
    double transform[3][4];  /* rows of (A | t): p becomes A p + t; all zero = as it is. A needs an inverse; if it
                                mirrors, corners are reordered, so that outside stays outside              */
    double emission_scale;   /* >= 0: multiplies Ke; 0 = 1                                                 */
    int material;            /* see PT_OBJ_MATERIAL                                                        */
    unsigned flags;          /* PT_OBJ_X                                                                   */
} pt_obj_options;

#define PT_OBJ_OPTIONS_INIT PTI_ZERO_INIT
#define PT_OBJ_WARNINGS 8
/* What was loaded, and what was not. */
typedef struct pt_obj_info {
    uint32_t triangles, vertices;  /* that the scene got; vertices are combinations of v, vt and vn        */
    uint32_t emissive_triangles;
    uint32_t materials, textures;  /* that faces use, and the scene got                                    */
    uint32_t degenerate_faces;     /* that have no area: left out                                          */
    uint32_t skipped_lines;        /* whose keyword means nothing here (curves, lines, other maps)         */
    pt_vec3 lo, hi;                /* box of all triangles, transformed                                    */
    uint32_t warning_count;        /* all of them,                                                         */
    char warnings[PT_OBJ_WARNINGS][160]; /* and the first as sentences: "model.obj:12: ..."                */
    char error[160];               /* why nothing was loaded; empty if all went well                       */
} pt_obj_info;

/* Adds a model from a Wavefront OBJ file, and the materials that its faces use from the MTL files that it names (paths
   are relative to the file that names them, with / or \). options NULL: all defaults; info may be NULL. pt_commit is
   the caller's. The scene owns the textures.

   Of OBJ: v (colours and weights after it are ignored), vt, vn, f with any corners, indices from 1, or negative from
   the latest, mtllib, usemtl. Polygons are cut into triangles in their own plane, concave ones too. Groups and smoothing
   groups are ignored: without vn a face is flat. Of MTL: Kd, Ks, Ke, Ns, Ni, d, Tr, illum, Pr, Pm and map_Kd with its
   option -s (others are skipped with a warning). The first line that fits says what a material becomes:

       Pm >= 0.5                         metal of reflectance Kd head on, roughness Pr
       illum 4, 6, 7, 9, or d < 0.5      glass of index Ni (1.5 without), roughness Pr: closed, clear
       illum 3, 5 and Ks >= Kd           mirror of reflectance Ks; with Pr > 0 metal as above
       Pr < 0.04                         diffuse Kd under a smooth coat of index Ni (1.5 without)
       Pr                                diffuse Kd and Blinn-Phong as wide as roughness Pr, of reflectance
                                         ((Ni - 1) / (Ni + 1))^2
       Ks > 0, Ns > 0, illum not 0 or 1  diffuse Kd and Phong with Ks and exponent Ns (energy-conserving)
       else                              diffuse Kd

   Kd is 0.8 without a line, 1 if it is black or missing beside a map_Kd. Kd + Ks above 1 is scaled down, with a warning.
   Ke is emitted by whatever it is, on the outside (counter-clockwise). Tf and Ka are ignored. What cannot be read of
   materials and textures is a warning, and what stands above is used instead.

   PT_ERROR_FILE: no file, more than 2 GiB, a number that is none or not finite, an index out of range, no triangle.
   PT_ERROR_LEFT_OUT: a material needs what a PT_NO_X switch left out; pt_scene_error and info.error name it, and the
   scene is wrong from then on. PT_ERROR_ARGUMENT: options out of range. PT_ERROR_MEMORY. After an error nothing has
   been added. */
PTDEF pt_result pt_load_obj(pt_scene *scene, const char *path, const pt_obj_options *options, pt_obj_info *info);
#endif

/* =====================================================================================================
   [PT-18] RENDER DRIVER: declarations
   ===================================================================================================== */

/* A rendering method: a row of pt_methods. */
typedef struct pt_method {
    const char *name;
    const char *summary;
    pt_li_fn li;                /* camera-path methods: the general body                                   */
    unsigned handles;           /* PT_NEEDS_X of scenes it can render; the rest is black or missing        */
    int follows;                /* 1: it follows paths to their end: the mean is the whole radiance but for what
                                   `handles` leaves out; 0: it leaves out classes of paths by design       */
    int classes;                /* 1: it can tell classes of light paths apart                             */
} pt_method;

/* All methods of this build; pt_method_count of them. The first is the default. */
PTDEF const pt_method *pt_methods(int *count);
/* By name, NULL if there is none; the name NULL means the default. */
PTDEF const pt_method *pt_method_find(const char *name);

/* State of a running render, for the callback. */
typedef struct pt_progress {
    double spp, spp_target;     /* samples per pixel done so far (with the part of the running pass), and the
                                   goal; 0 if no count is known                                            */
    double seconds;             /* wall seconds since the start                                            */
    double seconds_left;        /* estimate; -1 = unknown                                                  */
    double rays_per_second;
    double relmse;              /* latest estimate; -1 = unknown                                           */
} pt_progress;

/* What to render; zero means the default named. pt_render_defaults() is all zero but the spp. */
typedef struct pt_render_desc {
    pt_camera camera;           /* required                                                                */
    int width, height;          /* pixels; 0 = 256                                                         */
    uint32_t spp;               /* samples per pixel, the most if another budget is set too; 0 = no limit,
                                   if another budget is set, else 64                                       */
    double seconds;             /* wall seconds; 0 = no limit. Budgets end at whole passes; a path of more
                                   than 2^16 edges that outlasts one takes its pass with it, which favours
                                   short paths: negligible unless a closed scene loses next to nothing     */
    double cpu_seconds;         /* CPU seconds of the process; 0 = no limit                                */
    double target_error;        /* stop when sqrt(estimated relmse) is below; 0 = no limit. Stopping by an
                                   estimate biases the result by O(1/n)                                    */
    uint32_t first_sample;      /* index of the first sample: a shard of a larger picture; 0. Stratified
                                   shards are nets of their own and do not merge                           */
    const char *method;         /* NULL = "path"                                                           */
    pt_sampler_kind sampler;    /* 0 = Sobol                                                               */
    uint64_t seed;              /* every value, 0 too, is a seed                                           */
    pt_li_options li;
    pt_filter filter;           /* 0 = box                                                                 */
    double filter_radius;       /* pixels; 0 = the filter's default                                        */
    int threads;                /* 0 = as many as the machine has                                          */
    int tile;                   /* edge of a tile in pixels; 0 = 16. No influence on the picture           */
    int aov;                    /* 1: also albedo, normal and depth                                        */
    int single_net;             /* 1: all samples in one half: better Sobol points, no error estimate      */
    int general_body;           /* 1: always the general instance of the integrator (for comparison)       */
    int no_lockstep;            /* 1: paths one after the other, also where several could walk together    */
    const float *reference;     /* a converged picture, width * height * 3, for the true error; NULL       */
    double reference_mse_001;   /* that reference's own error, subtracted from relmse_001                  */
    pt_parallel_fn parallel;    /* NULL = own threads                                                      */
    void *parallel_user;
    int (*progress)(void *user, const pt_progress *progress); /* about ten times a second (a pixel's samples
                                   of one pass, or 2^16 edges, apart at least), from one thread at a time;
                                   non-zero cancels: the running pass is dropped                           */
    void *progress_user;
} pt_render_desc;

/* One row of error against run time, cumulative since the start of the render. */
typedef struct pt_report_row {
    uint32_t spp;
    double cpu_seconds, wall_seconds;
    uint64_t rays;
    int estimated;              /* 1: the error is estimated from the halves, 0: unknown                   */
    pt_error error;             /* estimated                                                               */
    double efficiency;          /* 1 / (relmse * CPU seconds), of the true error if there is a reference   */
    int has_true_error;         /* 1: a reference was given                                                */
    pt_error true_error;
} pt_report_row;

/* What a render tells of itself. Start from PT_REPORT_INIT; a second render starts it anew. */
typedef struct pt_report {
    void *alloc_user;
    pt_report_row *rows;        /* after 1, 2, 4, ... samples, and at the end                              */
    uint32_t row_count, row_capacity;
    int width, height, threads;
    uint32_t spp;               /* samples per pixel reached                                               */
    double cpu_seconds, wall_seconds, wall_resolution;
    uint64_t rays;
    uint64_t nonfinite;         /* contributions that were NaN or infinite, counted as zero                */
    const char *method, *sampler, *stopped_by, *body; /* static strings                                    */
    const char *error;          /* why pt_render refused, as a sentence; NULL if it did not                */
    unsigned needs;
} pt_report;

#define PT_REPORT_INIT PTI_ZERO_INIT

/* All defaults: spp 64, the rest zero. */
PTDEF pt_render_desc pt_render_defaults(void);
/* Renders a committed scene. film: an empty one is made; a film of the same fingerprint that holds samples
   from first_sample on without a gap is continued until it has spp in all; anything else is
   PT_ERROR_MISMATCH. report may be NULL. On PT_ERROR_CANCELLED the film holds all finished passes.
   film = function of (scene, camera, method, options, seed, sample range): the same bits for any number of
   threads, tile size and pass length. */
PTDEF pt_result pt_render(const pt_scene *scene, const pt_render_desc *desc, pt_film *film, pt_report *report);
/* Name of a sampler. */
PTDEF const char *pt_sampler_name(pt_sampler_kind kind);
/* Frees the rows; the report is as PT_REPORT_INIT made it. */
PTDEF void pt_report_free(pt_report *report);
#if PTI_HAS_STDIO && PTI_HAS_REPORT
/* The table of error against run time as text. */
PTDEF void pt_report_print(const pt_report *report, FILE *file);
#endif
#if PTI_HAS_FILES && PTI_HAS_REPORT
/* The rows as CSV with a header line; true errors are empty without a reference. */
PTDEF pt_result pt_report_write_csv(const pt_report *report, const char *path);
/* Error against CPU seconds on log-log axes as an SVG picture: one line for each of `count` reports, and the
   slope -1/2 of Monte Carlo. labels[i] may be NULL (the method's name). */
PTDEF pt_result pt_report_write_svg(const pt_report *const *reports, const char *const *labels, int count,
                                    const char *title, const char *path);
#endif

/* =====================================================================================================
   [PT-19] CANONICAL SCENES: declarations
   ===================================================================================================== */

#if PTI_HAS_SCENES
/* A scene with its camera. */
typedef struct pt_scene_entry {
    const char *name;
    const char *summary;
    pt_result (*make)(pt_scene *scene, pt_camera *camera); /* fills an empty scene and commits it          */
} pt_scene_entry;

/* All scenes; pt_scene_find by name, NULL if there is none. */
PTDEF const pt_scene_entry *pt_scenes(int *count);
PTDEF const pt_scene_entry *pt_scene_find(const char *name);

/* The Cornell box from its measured data, in millimetres; lamp at y = 548.79, albedo 0.78. */
PTDEF pt_result pt_scene_cornell(pt_scene *scene, pt_camera *camera);
/* ... without its blocks; and with a mirror and a glass sphere instead of them. */
PTDEF pt_result pt_scene_cornell_empty(pt_scene *scene, pt_camera *camera);
PTDEF pt_result pt_scene_cornell_spheres(pt_scene *scene, pt_camera *camera);
/* The closed box [-1/2,1/2]^3, emission 1 and albedo 1/2 on every wall: radiance 2 everywhere. */
PTDEF pt_result pt_scene_furnace(pt_scene *scene, pt_camera *camera);
/* Inside a diffuse sphere of radius 1, albedo 1/2, a point light of 1 W at (0.6, 0.2, -0.3): all indirect
   radiance is rho^2 Phi / (4 pi^2 (1 - rho)). */
PTDEF pt_result pt_scene_diffuse_sphere(pt_scene *scene, pt_camera *camera);
/* A glass ball on a floor under a small bright lamp: a caustic that plain path tracing finds by luck. */
PTDEF pt_result pt_scene_glass_ball(pt_scene *scene, pt_camera *camera);
/* K. Beason's smallpt box: walls are spheres of radius 1e5. */
PTDEF pt_result pt_scene_smallpt(pt_scene *scene, pt_camera *camera);
/* Veach's plates: four lamps of equal power and rising size, seen in four metal plates of rising roughness. */
PTDEF pt_result pt_scene_veach_plates(pt_scene *scene, pt_camera *camera);
/* SmallVCM's room with a glossy floor, a mirror and a glass sphere. */
PTDEF pt_result pt_scene_glossy_box(pt_scene *scene, pt_camera *camera);
/* The nephroid of a mirroring ring. */
PTDEF pt_result pt_scene_caustic_ring(pt_scene *scene, pt_camera *camera);
#if PTI_HAS_ENVIRONMENT
/* Endless water over a diffuse floor under a uniform sky: a closed form for every direction. */
PTDEF pt_result pt_scene_pool(pt_scene *scene, pt_camera *camera);
#if PTI_HAS_TEXTURES
/* A sphere of each material; textured floor, image environment. */
PTDEF pt_result pt_scene_materials(pt_scene *scene, pt_camera *camera);
#endif
#endif

/* Measured reflectance of the Cornell box walls and emission of its lamp, as tables; and the linear RGB that
   pt_scene_cornell makes of them. name: "white", "red", "green" or "lamp"; any other gives an empty table and
   black. */
PTDEF pt_spectrum pt_cornell_spectrum(const char *name);
PTDEF pt_rgb pt_cornell_rgb(const char *name);
#endif

#ifdef __cplusplus
}
#endif

#endif /* PATHTRACER_H */

/* ============================================================================================== */
/* ===================================== IMPLEMENTATION ========================================= */
/* ============================================================================================== */

#if defined(PATHTRACER_IMPLEMENTATION) && !defined(PTI_IMPLEMENTED)
#define PTI_IMPLEMENTED

/* =====================================================================================================
   [PT-00] CONFIGURATION: implementation
   =====================================================================================================
   Everything that touches the operating system or the compiler stands here: memory, clocks, threads, and
   the macro on which the promises of [PT-06] rest. */

#if defined(PT_MALLOC) && defined(PT_REALLOC) && defined(PT_FREE)
#elif !defined(PT_MALLOC) && !defined(PT_REALLOC) && !defined(PT_FREE)
#include <stdlib.h>
#define PT_MALLOC(size, user) ((void)(user), malloc(size))
#define PT_REALLOC(pointer, size, user) ((void)(user), realloc(pointer, size))
#define PT_FREE(pointer, user) ((void)(user), free(pointer))
#else
#error "pathtracer.h: define all of PT_MALLOC, PT_REALLOC and PT_FREE, or none"
#endif

#ifndef PT_ASSERT
#define PT_ASSERT(x) ((void)0)
#endif

#if !PTI_HAS_SIMD || defined(PT_NO_INTRINSICS)
#define PTI_LANES 0
#elif defined(__AVX2__)
#define PTI_LANES 2
#include <immintrin.h>
#elif defined(__SSE2__) || defined(_M_X64)
#define PTI_LANES 1
#include <emmintrin.h>
#else
#define PTI_LANES 0
#endif
#if PTI_HAS_WIDE && defined(__linux__)
#include <sys/mman.h>
#endif

#include <time.h>
#if defined(_WIN32)
#ifndef WIN32_LEAN_AND_MEAN
#define WIN32_LEAN_AND_MEAN
#endif
#ifndef NOMINMAX
#define NOMINMAX
#endif
#include <windows.h>
#include <io.h>
#elif defined(__unix__) || defined(__APPLE__)
#if PTI_HAS_THREADS
#include <pthread.h>
#endif
#include <unistd.h>
#if defined(_GNU_SOURCE) || (defined(_POSIX_C_SOURCE) && _POSIX_C_SOURCE >= 200809L) || \
    (!defined(_POSIX_C_SOURCE) && !defined(__STRICT_ANSI__))
#define PTI_HAS_FSYNC 1 /* the C library shows it */
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* A literal in the working precision; powers of two (C++11 has no hexadecimal ones). */
#define PTI_R(x) ((pt_real)(x))
#define PTI_2_M24 5.9604644775390625e-8
#define PTI_2_M32 2.3283064365386962890625e-10
#define PTI_2_M53 1.1102230246251565404e-16

#if defined(__OPTIMIZE__)
#define PTI_INLINE static inline __attribute__((always_inline, unused))
#elif defined(__GNUC__)
#define PTI_INLINE static inline __attribute__((unused)) /* -O0: quick to compile, and to step through */
#else
#define PTI_INLINE static inline
#endif

/* PTI_FENCE(x) hands x through unchanged but hides from the compiler how it was made, so that a product
   cannot be fused with a later addition: fma(a,b,-c*d) is not antisymmetric in (a,b) and (c,d), a*b - c*d is
   ([PT-06] lives on that). */
#if defined(__GNUC__) && (defined(__x86_64__) || defined(__SSE2_MATH__))
#define PTI_FENCE(x) __asm__("" : "+x"(x))
#elif defined(__GNUC__) && defined(__aarch64__)
#define PTI_FENCE(x) __asm__("" : "+w"(x))
#elif defined(__GNUC__)
#define PTI_FENCE(x) __asm__("" : "+m"(x))
#else
#define PTI_FENCE(x) pti_fence(&(x))
static void pti_fence(double *x)
{
    volatile double v = *x;
    *x = v;
}
#endif

/* Counters and flags that threads share. PTI_TAKE is true for the one thread that finds the flag free. Where
   no atomic operations are known there is one thread (and a user's own pool must be one thread, too). */
#if defined(_MSC_VER)
#include <intrin.h>
typedef __int64 pti_counter;
#define PTI_LOAD(p) (*(const volatile __int64 *)(p))
#define PTI_STORE(p, v) ((void)_InterlockedExchange64(p, v))
#define PTI_ADD(p, v) _InterlockedExchangeAdd64(p, v)
#define PTI_TAKE(p) (_InterlockedExchange64(p, 1) == 0)
#else
typedef long pti_counter; /* 32 bits on 32-bit machines: no call into a library for atomics */
#if defined(__GNUC__)
#define PTI_LOAD(p) __atomic_load_n(p, __ATOMIC_ACQUIRE)
#define PTI_STORE(p, v) __atomic_store_n(p, v, __ATOMIC_RELEASE)
#define PTI_ADD(p, v) __atomic_fetch_add(p, v, __ATOMIC_ACQ_REL)
#define PTI_TAKE(p) (__atomic_exchange_n(p, 1, __ATOMIC_ACQUIRE) == 0)
#else
#define PTI_LOAD(p) (*(p))
#define PTI_STORE(p, v) ((void)(*(p) = (v)))
#define PTI_ADD(p, v) ((*(p) += (v)) - (v))
#define PTI_TAKE(p) (*(p) == 0 && (*(p) = 1) != 0)
#endif
#endif

PTDEF const char *pt_result_string(pt_result result)
{
    switch (result) {
    case PT_OK: return "no error";
    case PT_ERROR_ARGUMENT: return "an argument is outside its documented range";
    case PT_ERROR_MEMORY: return "out of memory";
    case PT_ERROR_SCENE: return "the scene is wrong (pt_scene_error names the item)";
    case PT_ERROR_NOT_COMMITTED: return "the scene was not committed after its last change";
    case PT_ERROR_LEFT_OUT: return "this needs a feature that a PT_NO_X switch left out";
    case PT_ERROR_CANCELLED: return "cancelled by the callback";
    case PT_ERROR_MISMATCH: return "the films do not belong together";
    case PT_ERROR_FILE: return "the file could not be read or written";
    }
    return "unknown result";
}

/* count * size bytes, NULL if that overflows or there is no memory. Zero bytes ask for one, so that NULL
   always means failure. */
static void *pti_alloc(size_t count, size_t size, void *user)
{
    (void)user;
    if (size != 0 && count > (SIZE_MAX - 1) / size) return NULL;
    return PT_MALLOC(count * size + (count * size == 0), user);
}

static void *pti_alloc_zero(size_t count, size_t size, void *user)
{
    void *p = pti_alloc(count, size, user);
    if (p) memset(p, 0, count * size);
    return p;
}

static void pti_free(void *p, void *user)
{
    (void)user;
    if (p) PT_FREE(p, user);
}

/* Makes room for `need` elements in the array whose pointer is at `array`; grows by half. 0 = failed, the
   array is as it was. */
static int pti_reserve(void *array, uint32_t *capacity, size_t need, size_t size, void *user)
{
    size_t wanted = (size_t)*capacity + *capacity / 2 + 8;
    void *p;
    (void)user;
    if (need <= *capacity) return 1;
    if (wanted < need) wanted = need;
    if (wanted > 0x7fffffffu || wanted > SIZE_MAX / size) return 0;
    memcpy(&p, array, sizeof p); /* a T * is not a void * */
    p = PT_REALLOC(p, wanted * size, user);
    if (!p) return 0;
    memcpy(array, &p, sizeof p);
    *capacity = (uint32_t)wanted;
    return 1;
}

PTDEF double pt_wall_seconds(void)
{
#if defined(_WIN32)
    LARGE_INTEGER count, frequency;
    QueryPerformanceCounter(&count);
    QueryPerformanceFrequency(&frequency);
    return (double)count.QuadPart / (double)frequency.QuadPart;
#elif defined(CLOCK_MONOTONIC)
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
#elif defined(TIME_UTC)
    struct timespec t;
    timespec_get(&t, TIME_UTC);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
#else
    return (double)time(NULL);
#endif
}

PTDEF double pt_wall_resolution(void)
{
#if defined(_WIN32) || defined(CLOCK_MONOTONIC) || defined(TIME_UTC)
    return 1e-9;
#else
    return 1;
#endif
}

PTDEF double pt_cpu_seconds(void)
{
#if defined(_WIN32)
    FILETIME made, ended, kernel, user;
    ULARGE_INTEGER k, u;
    if (!GetProcessTimes(GetCurrentProcess(), &made, &ended, &kernel, &user)) return 0;
    k.LowPart = kernel.dwLowDateTime;
    k.HighPart = kernel.dwHighDateTime;
    u.LowPart = user.dwLowDateTime;
    u.HighPart = user.dwHighDateTime;
    return 1e-7 * ((double)k.QuadPart + (double)u.QuadPart);
#elif defined(CLOCK_PROCESS_CPUTIME_ID)
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
#else
    return (double)clock() / (double)CLOCKS_PER_SEC;
#endif
}

PTDEF int pt_hardware_threads(void)
{
#if defined(_WIN32)
    SYSTEM_INFO info;
    GetSystemInfo(&info);
    return !PTI_HAS_THREADS || info.dwNumberOfProcessors < 1 ? 1 : (int)info.dwNumberOfProcessors;
#elif !PTI_HAS_THREADS || !defined(_SC_NPROCESSORS_ONLN)
    return 1;
#else
    long n = sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n > 1024 ? 1024 : (int)n;
#endif
}

/* A loop shared by several threads. */
typedef struct pti_loop {
    pti_counter next;
    int count;
    void (*task)(void *context, int index);
    void *context;
} pti_loop;

static void pti_loop_run(pti_loop *loop)
{
    for (;;) {
        pti_counter i = PTI_ADD(&loop->next, 1);
        if (i >= loop->count) return;
        loop->task(loop->context, (int)i);
    }
}

#define PTI_MAX_THREADS 256

#if PTI_HAS_THREADS

#if defined(_WIN32)
typedef HANDLE pti_thread;
static DWORD WINAPI pti_loop_thread(LPVOID loop)
{
    pti_loop_run((pti_loop *)loop);
    return 0;
}
static int pti_thread_start(pti_thread *thread, pti_loop *loop)
{
    *thread = CreateThread(NULL, 0, pti_loop_thread, loop, 0, NULL);
    return *thread != NULL;
}
static void pti_thread_join(pti_thread thread)
{
    WaitForSingleObject(thread, INFINITE);
    CloseHandle(thread);
}
#else
typedef pthread_t pti_thread;
static void *pti_loop_thread(void *loop)
{
    pti_loop_run((pti_loop *)loop);
    return NULL;
}
static int pti_thread_start(pti_thread *thread, pti_loop *loop)
{
    return pthread_create(thread, NULL, pti_loop_thread, loop) == 0;
}
static void pti_thread_join(pti_thread thread)
{
    pthread_join(thread, NULL);
}
#endif

#endif /* PTI_HAS_THREADS */

/* task(context, i) for all i in 0..count-1 on up to `threads` threads, this one included. A thread that
   cannot be started is done without. */
static void pti_parallel(int threads, int count, void (*task)(void *, int), void *context)
{
    pti_loop loop;
#if PTI_HAS_THREADS
    pti_thread others[PTI_MAX_THREADS];
    int started = 0;
#endif
    loop.next = 0;
    loop.count = count;
    loop.task = task;
    loop.context = context;
    (void)threads;
#if PTI_HAS_THREADS
    while (started + 1 < threads && started + 1 < count && started < PTI_MAX_THREADS && pti_thread_start(&others[started], &loop))
        started++;
#endif
    pti_loop_run(&loop);
#if PTI_HAS_THREADS
    while (started > 0) pti_thread_join(others[--started]);
#endif
}

/* =====================================================================================================
   [PT-01] VECTORS, FRAMES, COLOUR: implementation
   ===================================================================================================== */

/* The C library's functions in the working precision. */
#ifdef PT_DOUBLE
#define pti_sqrt sqrt
#define pti_sin sin
#define pti_cos cos
#define pti_fabs fabs
#define pti_copysign copysign
#define PTI_REAL_MAX 1.7976931348623157e308
#define PTI_UNIT_ROUNDOFF PTI_2_M53
#else
#define pti_sqrt sqrtf
#define pti_sin sinf
#define pti_cos cosf
#define pti_fabs fabsf
#define pti_copysign copysignf
#define PTI_REAL_MAX 3.40282346638528860e38f
#define PTI_UNIT_ROUNDOFF PTI_2_M24
#endif

/* Three doubles: where a decision must not depend on the working precision. */
typedef struct pti_d3 {
    double x, y, z;
} pti_d3;

PTI_INLINE pti_d3 pti_d(double x, double y, double z) { pti_d3 v = {x, y, z}; return v; }
PTI_INLINE pti_d3 pti_d_from(pt_vec3 a) { return pti_d((double)a.x, (double)a.y, (double)a.z); }
PTI_INLINE pt_vec3 pti_d_to(pti_d3 a) { return pt_v3((pt_real)a.x, (pt_real)a.y, (pt_real)a.z); }
PTI_INLINE pti_d3 pti_d_add(pti_d3 a, pti_d3 b) { return pti_d(a.x + b.x, a.y + b.y, a.z + b.z); }
PTI_INLINE pti_d3 pti_d_sub(pti_d3 a, pti_d3 b) { return pti_d(a.x - b.x, a.y - b.y, a.z - b.z); }
PTI_INLINE pti_d3 pti_d_scale(pti_d3 a, double k) { return pti_d(a.x * k, a.y * k, a.z * k); }
PTI_INLINE double pti_d_dot(pti_d3 a, pti_d3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
PTI_INLINE double pti_d_length(pti_d3 a) { return sqrt(pti_d_dot(a, a)); }
PTI_INLINE pti_d3 pti_d_cross(pti_d3 a, pti_d3 b)
{
    return pti_d(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
PTI_INLINE pti_d3 pti_d_between(pt_vec3 from, pt_vec3 to)
{
    return pti_d_sub(pti_d_from(to), pti_d_from(from));
}

/* a / |a|. Squares outside [1e-270, 1e270] may have lost digits to under- or overflow: then scale first. */
static pti_d3 pti_d_normalize(pti_d3 a)
{
    double l2 = pti_d_dot(a, a);
    if (!(l2 > 1e-270 && l2 < 1e270)) {
        double m = fmax(fabs(a.x), fmax(fabs(a.y), fabs(a.z)));
        if (!(m > 0)) return a;
        a = pti_d(a.x / m, a.y / m, a.z / m);
        l2 = pti_d_dot(a, a);
    }
    return pti_d_scale(a, 1 / sqrt(l2));
}

PTDEF pt_real pt_v3_length(pt_vec3 a)
{
    return pti_sqrt(pt_v3_dot(a, a));
}

PTDEF pt_vec3 pt_v3_normalize(pt_vec3 a)
{
    return pti_d_to(pti_d_normalize(pti_d_from(a)));
}

PTDEF pt_frame pt_frame_from_normal(pt_vec3 n)
{
    /* [Duf17] listing 3. copysign keeps 1 + |n.z| away from zero for both signs of n.z, -0 included. */
    pt_frame f;
    pt_real sign = pti_copysign(PTI_R(1), n.z);
    pt_real a = -1 / (sign + n.z);
    pt_real b = n.x * n.y * a;
    f.s = pt_v3(1 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    f.t = pt_v3(b, sign + n.y * n.y * a, -n.y);
    f.n = n;
    return f;
}

PTDEF double pt_luminance(double r, double g, double b)
{
    return 0.2126728514056225 * r + 0.7151521552878179 * g + 0.07217499330655958 * b;
}

PTDEF double pt_srgb_encode(double linear)
{
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055;
}

PTDEF double pt_srgb_decode(double encoded)
{
    return encoded <= 0.040449936 ? encoded / 12.92 : pow((encoded + 0.055) / 1.055, 2.4);
}

PTDEF unsigned char pt_srgb_byte(double linear)
{
    /* Written so that NaN takes the first way: a cast of NaN to an integer is undefined. */
    double v = linear > 0 ? (linear < 1 ? linear : 1.0) : 0.0;
    return (unsigned char)(255 * pt_srgb_encode(v) + 0.5);
}

static int pti_finite(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7ff0000000000000u) != 0x7ff0000000000000u;
}
static int pti_rgb_finite(pt_rgb c)
{
    return pti_finite((double)c.r) && pti_finite((double)c.g) && pti_finite((double)c.b);
}
PTI_INLINE int pti_rgb_black(pt_rgb c) { return !(c.r > 0 || c.g > 0 || c.b > 0); }

#if PTI_HAS_SIMD

/* LANES: pti_f8 is eight floats, pti_m8 eight truth values. One table of operations has columns for AVX, for SSE (two
   halves) and for C, whose loops compilers turn into what the machine has. min and max are x < y ? x : y and
   x > y ? x : y, so y where one of them is NaN. All columns give the same bits, but for madd and nmadd, which may round
   once or twice (-ffp-contract=fast may make one of them of a mul and an add). What is loaded or stored begins at a
   multiple of 32 bytes; swap exchanges the first four with the last. */
#if PTI_LANES == 2
typedef __m256 pti_f8, pti_m8;
#define PTI_F8(T, name, avx, sse, plain) \
    PTI_INLINE T name(pti_f8 x, pti_f8 y) { (void)y; return avx; }
PTI_INLINE pti_f8 pti_f8_set(float x) { return _mm256_set1_ps(x); }
PTI_INLINE pti_f8 pti_f8_load(const float *p) { return _mm256_load_ps(p); }
PTI_INLINE void pti_f8_store(float *p, pti_f8 x) { _mm256_store_ps(p, x); }
PTI_INLINE pti_f8 pti_f8_select(pti_m8 m, pti_f8 x, pti_f8 y) { return _mm256_blendv_ps(y, x, m); }
PTI_INLINE pti_f8 pti_f8_swap(pti_f8 x) { return _mm256_permute2f128_ps(x, x, 1); }
PTI_INLINE unsigned pti_m8_bits(pti_m8 m) { return (unsigned)_mm256_movemask_ps(m); }
#elif PTI_LANES == 1
typedef struct pti_f8 {
    __m128 a, b;
} pti_f8, pti_m8;
#define PTI_F8(T, name, avx, sse, plain)                   \
    PTI_INLINE T name(pti_f8 p, pti_f8 q)                  \
    {                                                      \
        { const __m128 x = p.a, y = q.a; (void)y; p.a = sse; } \
        { const __m128 x = p.b, y = q.b; (void)y; p.b = sse; } \
        return p;                                          \
    }
PTI_INLINE pti_f8 pti_f8_pair(__m128 a, __m128 b) { pti_f8 r; r.a = a; r.b = b; return r; }
PTI_INLINE pti_f8 pti_f8_set(float x) { return pti_f8_pair(_mm_set1_ps(x), _mm_set1_ps(x)); }
PTI_INLINE pti_f8 pti_f8_load(const float *p) { return pti_f8_pair(_mm_load_ps(p), _mm_load_ps(p + 4)); }
PTI_INLINE void pti_f8_store(float *p, pti_f8 x) { _mm_store_ps(p, x.a); _mm_store_ps(p + 4, x.b); }
PTI_INLINE pti_f8 pti_f8_swap(pti_f8 x) { return pti_f8_pair(x.b, x.a); }
PTI_INLINE pti_f8 pti_f8_select(pti_m8 m, pti_f8 x, pti_f8 y)
{
    return pti_f8_pair(_mm_or_ps(_mm_and_ps(m.a, x.a), _mm_andnot_ps(m.a, y.a)), _mm_or_ps(_mm_and_ps(m.b, x.b), _mm_andnot_ps(m.b, y.b)));
}
PTI_INLINE unsigned pti_m8_bits(pti_m8 m) { return (unsigned)_mm_movemask_ps(m.a) | (unsigned)_mm_movemask_ps(m.b) << 4; }
#else
typedef struct pti_f8 {
    float v[8];
} pti_f8;
typedef struct pti_m8 {
    int32_t v[8]; /* 0 or -1 */
} pti_m8;
#define PTI_F8(T, name, avx, sse, plain)        \
    PTI_INLINE T name(pti_f8 p, pti_f8 q)       \
    {                                           \
        T r;                                    \
        int i;                                  \
        for (i = 0; i < 8; i++) {               \
            const float x = p.v[i], y = q.v[i]; \
            (void)y;                            \
            r.v[i] = plain;                     \
        }                                       \
        return r;                               \
    }
PTI_INLINE pti_f8 pti_f8_load(const float *p) { pti_f8 r; memcpy(r.v, p, sizeof r.v); return r; }
PTI_INLINE void pti_f8_store(float *p, pti_f8 x) { memcpy(p, x.v, sizeof x.v); }
PTI_INLINE pti_f8 pti_f8_set(float x)
{
    pti_f8 r;
    int i;
    for (i = 0; i < 8; i++) r.v[i] = x;
    return r;
}
PTI_INLINE pti_f8 pti_f8_swap(pti_f8 x)
{
    pti_f8 r;
    int i;
    for (i = 0; i < 8; i++) r.v[i] = x.v[i ^ 4];
    return r;
}
PTI_INLINE pti_f8 pti_f8_select(pti_m8 m, pti_f8 x, pti_f8 y)
{
    int i;
    for (i = 0; i < 8; i++) x.v[i] = m.v[i] ? x.v[i] : y.v[i];
    return x;
}
PTI_INLINE unsigned pti_m8_bits(pti_m8 m)
{
    static const int32_t bit[8] = {1, 2, 4, 8, 16, 32, 64, 128};
    int32_t bits = 0;
    int i;
    for (i = 0; i < 8; i++) bits += m.v[i] & bit[i]; /* a sum that compilers know how to do four at a time */
    return (unsigned)bits;
}
#endif

PTI_F8(pti_f8, pti_f8_add, _mm256_add_ps(x, y), _mm_add_ps(x, y), x + y)
PTI_F8(pti_f8, pti_f8_sub, _mm256_sub_ps(x, y), _mm_sub_ps(x, y), x - y)
PTI_F8(pti_f8, pti_f8_mul, _mm256_mul_ps(x, y), _mm_mul_ps(x, y), x * y)
PTI_F8(pti_f8, pti_f8_div, _mm256_div_ps(x, y), _mm_div_ps(x, y), x / y)
PTI_F8(pti_f8, pti_f8_min, _mm256_min_ps(x, y), _mm_min_ps(x, y), x < y ? x : y)
PTI_F8(pti_f8, pti_f8_max, _mm256_max_ps(x, y), _mm_max_ps(x, y), x > y ? x : y)
PTI_F8(pti_m8, pti_f8_lt, _mm256_cmp_ps(x, y, _CMP_LT_OQ), _mm_cmplt_ps(x, y), x < y ? -1 : 0)
PTI_F8(pti_m8, pti_f8_le, _mm256_cmp_ps(x, y, _CMP_LE_OQ), _mm_cmple_ps(x, y), x <= y ? -1 : 0)
PTI_F8(pti_f8, pti_f8_root, _mm256_sqrt_ps(x), _mm_sqrt_ps(x), sqrtf(x))
PTI_F8(pti_f8, pti_f8_flip, _mm256_xor_ps(x, _mm256_and_ps(y, _mm256_set1_ps(-0.0f))), _mm_xor_ps(x, _mm_and_ps(y, _mm_set1_ps(-0.0f))),
       y < 0 ? -x : x) /* -x where y is negative */
PTI_F8(pti_f8, pti_f8_unsign, _mm256_andnot_ps(y, x), _mm_andnot_ps(y, x), fabsf(x)) /* y = -0 */
PTI_INLINE pti_f8 pti_f8_sqrt(pti_f8 x) { return pti_f8_root(x, x); }
PTI_INLINE pti_f8 pti_f8_abs(pti_f8 x) { return pti_f8_unsign(x, pti_f8_set(-0.0f)); }
/* x y + z and z - x y */
#if PTI_LANES == 2 && defined(__FMA__)
PTI_INLINE pti_f8 pti_f8_madd(pti_f8 x, pti_f8 y, pti_f8 z) { return _mm256_fmadd_ps(x, y, z); }
PTI_INLINE pti_f8 pti_f8_nmadd(pti_f8 x, pti_f8 y, pti_f8 z) { return _mm256_fnmadd_ps(x, y, z); }
#else
PTI_INLINE pti_f8 pti_f8_madd(pti_f8 x, pti_f8 y, pti_f8 z) { return pti_f8_add(pti_f8_mul(x, y), z); }
PTI_INLINE pti_f8 pti_f8_nmadd(pti_f8 x, pti_f8 y, pti_f8 z) { return pti_f8_sub(z, pti_f8_mul(x, y)); }
#endif

/* Of long functions of lanes: loops in C, inlined by the hundred, take compilers seconds. */
#if PTI_LANES > 0
#define PTI_INLINE8 PTI_INLINE
#else
#define PTI_INLINE8 static
#endif

/* Lanes as numbers. */
typedef union pti_lanes {
    pti_f8 f;
    float v[8];
    uint32_t bits[8];
} pti_lanes;

/* The smallest lane. */
PTI_INLINE float pti_f8_least(pti_f8 x)
{
#if PTI_LANES > 0
#if PTI_LANES == 2
    __m128 m = _mm_min_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps(x, 1));
#else
    __m128 m = _mm_min_ps(x.a, x.b);
#endif
    m = _mm_min_ps(m, _mm_movehl_ps(m, m));
    return _mm_cvtss_f32(_mm_min_ss(m, _mm_shuffle_ps(m, m, 1)));
#else
    float m = x.v[0];
    int i;
    for (i = 1; i < 8; i++) m = x.v[i] < m ? x.v[i] : m;
    return m;
#endif
}

/* The number of the lowest bit that is set. */
PTI_INLINE int pti_lowest_bit(unsigned bits)
{
#if defined(__GNUC__)
    return __builtin_ctz(bits);
#else
    int i = 0;
    while (!(bits >> i & 1)) i++;
    return i;
#endif
}

#endif /* PTI_HAS_SIMD */

/* =====================================================================================================
   [PT-02] RANDOM NUMBERS AND SAMPLERS: implementation
   =====================================================================================================
   A Monte Carlo picture is a function of its random numbers. Here each number is a function of (seed,
   stream, sample, dimension) and nothing else: no state is handed on from one sample to the next, so any
   thread may take any sample, a render may stop and go on, and two estimators see the same numbers for the
   same decision.

   Independent numbers are a hash of that tuple. Sobol points are well spread: of 2^m points exactly one
   lies in each of the 2^m boxes of many shapes, so a smooth integrand's error falls almost like 1/N
   instead of 1/sqrt(N). Owen's scrambling randomises them without destroying that: it permutes the halves of
   every dyadic interval at random, every point becomes uniform, and the estimate unbiased. More than four
   dimensions are made by padding: sets of four, each with its points in an own random order [Bur20]. */

PTDEF pt_pcg32 pt_pcg32_make(uint64_t seed, uint64_t stream)
{
    pt_pcg32 rng;
    rng.state = 0;
    rng.inc = (stream << 1) | 1;
    pt_pcg32_next(&rng);
    rng.state += seed;
    pt_pcg32_next(&rng);
    return rng;
}

PTDEF uint32_t pt_pcg32_next(pt_pcg32 *rng)
{
    uint64_t old = rng->state;
    uint32_t xorshifted = (uint32_t)(((old >> 18) ^ old) >> 27);
    uint32_t rot = (uint32_t)(old >> 59);
    rng->state = old * 6364136223846793005u + rng->inc;
    return (xorshifted >> rot) | (xorshifted << ((32u - rot) & 31u));
}

PTDEF void pt_pcg32_advance(pt_pcg32 *rng, uint64_t delta)
{
    /* k steps of x -> a x + c are one step x -> a' x + c'; (a', c') by repeated squaring. */
    uint64_t mul = 6364136223846793005u, add = rng->inc, total_mul = 1, total_add = 0;
    for (; delta; delta >>= 1) {
        if (delta & 1) {
            total_mul *= mul;
            total_add = total_add * mul + add;
        }
        add = (mul + 1) * add;
        mul *= mul;
    }
    rng->state = total_mul * rng->state + total_add;
}

PTDEF double pt_pcg32_double(pt_pcg32 *rng)
{
    uint64_t high = pt_pcg32_next(rng) >> 5, low = pt_pcg32_next(rng) >> 6; /* 27 and 26 bits */
    return (double)((high << 26) | low) * PTI_2_M53;
}

#if PTI_HAS_WHITTED || PTI_HAS_MEASURED
static pt_vec2 pti_pcg32_pair(pt_pcg32 *rng)
{
    pt_vec2 u;
    u.x = pt_real_from_u32(pt_pcg32_next(rng));
    u.y = pt_real_from_u32(pt_pcg32_next(rng));
    return u;
}
#endif

PTDEF uint64_t pt_hash64(uint64_t x)
{
    /* [Ste11] variant 13; a zero input is moved away from its fixed point. */
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

PTDEF pt_real pt_real_from_u32(uint32_t x)
{
#ifdef PT_DOUBLE
    return (double)x * PTI_2_M32;
#else
    return (float)(x >> 8) * (float)PTI_2_M24; /* 24 bits: rounding all 32 would give 1 for the largest */
#endif
}

/* A number in [0,1) cut (never rounded up to 1) to the working precision. */
PTI_INLINE pt_real pti_cut(double u)
{
    if (!(u > 0)) return 0; /* NaN too */
#ifdef PT_DOUBLE
    return fmin(u, 1 - PTI_2_M53);
#else
    return (float)(int32_t)(fmin(u, 1 - PTI_2_M24) * 16777216.0) * (float)PTI_2_M24;
#endif
}

PTI_INLINE uint32_t pti_reverse_bits(uint32_t x)
{
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

/* Columns of the matrices of dimensions 2 and 3, made from (s, a, m) = (2, 1, {1,3}) and (3, 1, {1,3,1}) by the recurrence
   of [Joe08]; their bits are reversed. */
static const uint32_t pti_sobol_columns[2][32] = {
    {0x00000001u, 0x00000003u, 0x00000006u, 0x00000009u, 0x00000017u, 0x0000003au, 0x00000071u, 0x000000a3u,
     0x00000116u, 0x00000339u, 0x00000677u, 0x000009aau, 0x00001601u, 0x00003903u, 0x00007706u, 0x0000aa09u,
     0x00010117u, 0x0003033au, 0x00060671u, 0x000909a3u, 0x00171616u, 0x003a3939u, 0x00717777u, 0x00a3aaaau,
     0x01170001u, 0x033a0003u, 0x06710006u, 0x09a30009u, 0x16160017u, 0x3939003au, 0x77770071u, 0xaaaa00a3u},
    {0x00000001u, 0x00000003u, 0x00000004u, 0x0000000au, 0x0000001fu, 0x0000002eu, 0x00000045u, 0x000000c9u,
     0x0000011bu, 0x000002a4u, 0x0000079au, 0x00000b67u, 0x0000101eu, 0x0000302du, 0x00004041u, 0x0000a0c3u,
     0x0001f104u, 0x0002e28au, 0x000457dfu, 0x000c9baeu, 0x0011a105u, 0x002a7289u, 0x0079e7dbu, 0x00b6dba4u,
     0x0100011au, 0x030002a7u, 0x0400079eu, 0x0a000b6du, 0x1f001001u, 0x2e003003u, 0x45004004u, 0xc900a00au}
};

/* Sobol point n of dimension d with its bits reversed (the first binary digit is bit 0). Dimension 0 is the
   van der Corput sequence, whose reversed bits are n itself. The matrix of dimension 1 is Pascal's triangle
   modulo 2: a Kronecker power of ((1 1)(0 1)), hence five masked shifts. Dimensions 2 and 3 sum columns. */
static uint32_t pti_sobol_reversed(uint32_t n, int d)
{
    uint32_t x = 0;
    int bit;
    if (d == 0) return n;
    if (d == 1) {
        n ^= (n >> 1) & 0x55555555u;
        n ^= (n >> 2) & 0x33333333u;
        n ^= (n >> 4) & 0x0f0f0f0fu;
        n ^= (n >> 8) & 0x00ff00ffu;
        return n ^ ((n >> 16) & 0x0000ffffu);
    }
    for (bit = 0; n; bit++, n >>= 1) x ^= pti_sobol_columns[d - 2][bit] & (0u - (n & 1u));
    return x;
}

/* Hashes so that each bit depends on itself and the bits below it only: multiplications carry upwards.
   Constants of [Veg21]. */
PTI_INLINE uint32_t pti_laine_karras(uint32_t x, uint32_t seed)
{
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

PTDEF uint32_t pt_sobol_u32(uint32_t n, int d)
{
    return pti_reverse_bits(pti_sobol_reversed(n, d & 3));
}

PTDEF uint32_t pt_owen_scramble(uint32_t x, uint32_t seed)
{
    return pti_reverse_bits(pti_laine_karras(pti_reverse_bits(x), seed));
}

PTDEF pt_sampler pt_sampler_make(pt_sampler_kind kind, uint64_t seed, uint32_t count)
{
    pt_sampler s;
    memset(&s, 0, sizeof s);
    s.kind = kind;
    s.seed = seed;
    s.count = count ? count : 1;
    pt_sampler_start(&s, 0, 0);
    return s;
}

PTDEF pt_sampler pt_sampler_make_given(const double *u, size_t count)
{
    pt_sampler s = pt_sampler_make(PT_SAMPLER_GIVEN, 0, 1);
    s.given = u;
    s.given_count = count;
    return s;
}

PTDEF void pt_sampler_start(pt_sampler *s, uint64_t stream, uint32_t index)
{
    s->key = pt_hash64(pt_hash64(s->seed) ^ stream);
    s->index = index;
    s->dimension = 0;
    s->set = 0;
}

PTDEF void pt_sampler_seek(pt_sampler *s, uint32_t dimension)
{
    s->dimension = dimension;
}

/* 64 random bits for a dimension of the stream; `use` keeps different uses apart. */
PTI_INLINE uint64_t pti_sampler_hash(const pt_sampler *s, uint32_t dimension, uint32_t use)
{
    return pt_hash64(s->key ^ (((uint64_t)use << 32) | dimension));
}

static double pti_draw_independent(const pt_sampler *s, uint32_t dimension)
{
    return (double)(pti_sampler_hash(s, dimension, s->index ^ 0x80000000u) >> 11) * PTI_2_M53;
}

/* Two dimensions share one hash: its halves seed their scramblings. */
static double pti_draw_sobol(pt_sampler *s, uint32_t dimension)
{
    uint64_t seeds = pti_sampler_hash(s, dimension >> 1, 1);
    uint32_t seed = (uint32_t)((dimension & 1) ? seeds >> 32 : seeds);
    if (s->set != (dimension >> 2) + 1) {
        s->set = (dimension >> 2) + 1;
        s->set_index = pt_owen_scramble(s->index, (uint32_t)pti_sampler_hash(s, s->set, 2));
    }
    /* 32 scrambled digits, and 21 random ones below, so that rare choices have their probability too */
    return ((double)pti_reverse_bits(pti_laine_karras(pti_sobol_reversed(s->set_index, dimension & 3), seed)) +
            (double)(pt_hash64(seeds ^ dimension) >> 43) * (1 / 2097152.0)) * PTI_2_M32;
}

/* A random permutation of 0..n-1 at i: rounds of odd multiplication and xor-shift are a bijection on the
   smallest power of two above; walking the cycle until the value is below n makes one of 0..n-1; a turn at
   the end makes each place equally likely [Ken13]. */
static uint32_t pti_permute(uint32_t i, uint32_t n, uint64_t seed)
{
    uint32_t mask = n - 1, shift, round;
    mask |= mask >> 1;
    mask |= mask >> 2;
    mask |= mask >> 4;
    mask |= mask >> 8;
    mask |= mask >> 16;
    for (shift = 1; ((uint64_t)mask >> (2 * shift)) != 0; shift++) {}
    do {
        for (round = 0; round < 4; round++) {
            uint64_t key = pt_hash64(seed + round);
            i = (i * ((uint32_t)key | 1u) + (uint32_t)(key >> 32)) & mask;
            i ^= i >> shift;
        }
    } while (i >= n);
    return (uint32_t)((i + pt_hash64(seed + 4) % n) % n); /* in 64 bits; a random turn makes each value equally likely */
}

/* Stratum `index` of `cells` in a random order; a new order each time all are used up. */
static uint32_t pti_stratum(const pt_sampler *s, uint32_t dimension, uint32_t cells)
{
    return pti_permute(s->index % cells, cells, pti_sampler_hash(s, dimension, 3 + s->index / cells));
}

static double pti_draw_stratified(const pt_sampler *s, uint32_t dimension)
{
    return ((double)pti_stratum(s, dimension, s->count) + pti_draw_independent(s, dimension)) / (double)s->count;
}

static double pti_draw_given(pt_sampler *s, uint32_t dimension)
{
    if (dimension < s->given_count) return s->given[dimension];
    s->given_missing++;
    return pti_draw_independent(s, dimension);
}

/* The next number in double. */
static double pti_draw(pt_sampler *s)
{
    uint32_t dimension = s->dimension++;
    switch (s->kind) {
    case PT_SAMPLER_SOBOL: return pti_draw_sobol(s, dimension);
    case PT_SAMPLER_STRATIFIED: return pti_draw_stratified(s, dimension);
    case PT_SAMPLER_GIVEN: return pti_draw_given(s, dimension);
    case PT_SAMPLER_INDEPENDENT: break;
    }
    return pti_draw_independent(s, dimension);
}

PTDEF pt_real pt_sampler_1d(pt_sampler *s)
{
    return pti_cut(pti_draw(s));
}

/* A jittered grid of nx x ny >= count cells. If some cells stay empty, which ones is random: each sample is
   uniform all the same. */
static pt_vec2 pti_pair_stratified(pt_sampler *s)
{
    uint32_t d = s->dimension, nx = (uint32_t)sqrt((double)s->count), ny, cell;
    double jx = pti_draw_independent(s, d), jy = pti_draw_independent(s, d + 1);
    if (nx < 1) nx = 1;
    ny = s->count / nx + (s->count % nx != 0);
    cell = pti_stratum(s, d, nx * ny);
    s->dimension = d + 2;
    return pt_v2(pti_cut(((double)(cell % nx) + jx) / (double)nx), pti_cut(((double)(cell / nx) + jy) / (double)ny));
}

PTDEF pt_vec2 pt_sampler_2d(pt_sampler *s)
{
    pt_vec2 u;
    if (s->kind == PT_SAMPLER_STRATIFIED) return pti_pair_stratified(s);
    u.x = pt_sampler_1d(s);
    u.y = pt_sampler_1d(s);
    return u;
}

/* =====================================================================================================
   [PT-03] STATISTICS AND ESTIMATES: implementation
   =====================================================================================================
   The estimator of an integral I = int f(x) dx is the mean of f(X)/p(X) over points X of density p: its
   expectation is I for every p that is positive wherever f is not zero. Its standard error is sigma/sqrt(N),
   and sigma is estimated from the same values. So every number comes with its own error bar, and a test can
   say how improbable a deviation is. */

PTDEF void pt_stats_add(pt_stats *s, double x)
{
    double delta = x - s->mean, n = s->n + 1, step = delta / n, term = delta * step * s->n;
    s->mean += step;
    s->m3 += term * step * (n - 2) - 3 * step * s->m2;
    s->m2 += term;
    s->n = n;
}

PTDEF void pt_stats_merge(pt_stats *a, const pt_stats *b)
{
    double n = a->n + b->n, delta = b->mean - a->mean;
    if (b->n == 0) return;
    if (a->n == 0) {
        *a = *b;
        return;
    }
    a->m3 += b->m3 + delta * delta * delta * a->n * b->n * (a->n - b->n) / (n * n) +
             3 * delta * (a->n * b->m2 - b->n * a->m2) / n;
    a->m2 += b->m2 + delta * delta * a->n * b->n / n;
    a->mean += delta * b->n / n;
    a->n = n;
}

PTDEF double pt_stats_variance(const pt_stats *s)
{
    return s->n > 1 ? s->m2 / (s->n - 1) : 0;
}

PTDEF double pt_stats_standard_error(const pt_stats *s)
{
    return s->n > 1 ? sqrt(pt_stats_variance(s) / s->n) : 0;
}

PTDEF double pt_stats_skewness(const pt_stats *s)
{
    return s->m2 > 0 ? sqrt(s->n) * s->m3 / (s->m2 * sqrt(s->m2)) : 0;
}

PTDEF double pt_normal_sf(double x)
{
    return 0.5 * erfc(x * 0.70710678118654752440);
}

PTDEF double pt_normal_isf(double p)
{
    double lo = -40, hi = 40; /* the tail beyond 40 is below the smallest double */
    int i;
    for (i = 0; i < 100; i++) {
        double mid = 0.5 * (lo + hi);
        if (pt_normal_sf(mid) > p) lo = mid;
        else hi = mid;
    }
    return 0.5 * (lo + hi);
}

/* ln Gamma(x) for x > 0 by Stirling's series [DLMF 5.11.1], exact to 1e-16 from x = 10 on; below, by the
   recurrence. The C library's lgamma writes a global. */
static double pti_log_gamma(double x)
{
    double shift = 0, r;
    for (; x < 10; x++) shift += log(x);
    r = 1 / (x * x);
    r = (1 / 12.0 - r * (1 / 360.0 - r * (1 / 1260.0 - r * (1 / 1680.0 - r * (1 / 1188.0 - r * 691 / 360360.0))))) / x;
    return (x - 0.5) * log(x) - x + 0.91893853320467274178 + r - shift;
}

/* One step of Lentz' evaluation of a continued fraction b0 + a1/(b1 + a2/(b2 + ...)). */
static double pti_lentz(double *f, double *c, double *d, double a, double b)
{
    double tiny = 1e-300, step;
    *d = b + a * *d;
    if (fabs(*d) < tiny) *d = tiny;
    *c = b + a / *c;
    if (fabs(*c) < tiny) *c = tiny;
    *d = 1 / *d;
    step = *c * *d;
    *f *= step;
    return step;
}

/* Regularised incomplete beta function I_x(a,b) by its continued fraction [DLMF 8.17.22], which converges
   fast for x < (a+1)/(a+b+2). */
static double pti_beta_fraction(double x, double a, double b)
{
    double f = 1, c = 1, d = 0;
    double front = exp(pti_log_gamma(a + b) - pti_log_gamma(a) - pti_log_gamma(b) + a * log(x) + b * log1p(-x)) / a;
    int i;
    for (i = 1; i < 10000; i++) {
        double m = i / 2, step;
        if (i & 1) step = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
        else step = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
        if (fabs(pti_lentz(&f, &c, &d, step, 1) - 1) < 1e-16) break;
    }
    return front / f;
}

PTDEF double pt_student_sf(double x, double df)
{
    /* P(T > x) = I_z(df/2, 1/2) / 2 with z = df / (df + x^2), for x >= 0. */
    double y = x * x / df, z = 1 / (1 + y), tail;
    if (x < 0) return 1 - pt_student_sf(-x, df);
    if (y == 0) return 0.5;
    if (z < (df / 2 + 1) / (df / 2 + 2.5)) tail = pti_beta_fraction(z, df / 2, 0.5);
    else tail = 1 - pti_beta_fraction(y / (1 + y), 0.5, df / 2);
    return 0.5 * tail;
}

PTDEF double pt_chi2_sf(double x, double df)
{
    /* Q(a, y) with a = df/2, y = x/2: series of P for y < a + 1 [DLMF 8.11.4], else the continued fraction
       of Q [DLMF 8.9.2]. */
    double a = df / 2, y = x / 2, front, sum = 0, term, f, c, d;
    int i;
    if (!(x > 0)) return 1;
    if (x > 1e300) return 0;
    front = exp(a * log(y) - y - pti_log_gamma(a));
    if (y < a + 1) {
        term = 1 / a;
        for (i = 1; i < 100000 && term > 1e-17 * sum; i++) {
            sum += term;
            term *= y / (a + i);
        }
        return 1 - front * sum;
    }
    f = c = y + 1 - a; /* >= 2 - rounding here */
    d = 0;
    for (i = 1; i < 100000; i++)
        if (fabs(pti_lentz(&f, &c, &d, -i * (i - a), y + 2 * i + 1 - a) - 1) < 1e-16) break;
    return front / f;
}

PTDEF double pt_p_value_mean(const pt_stats *s, double exact)
{
    double se = pt_stats_standard_error(s);
    if (!(se > 0)) return s->mean == exact || s->n < 2 ? 1 : 0;
    return 2 * pt_student_sf(fabs(s->mean - exact) / se, s->n - 1);
}

PTDEF double pt_p_value_equal_means(const pt_stats *a, const pt_stats *b)
{
    /* Welch: degrees of freedom after Satterthwaite. */
    double va, vb, v;
    if (a->n < 2 || b->n < 2) return 1;
    va = pt_stats_variance(a) / a->n;
    vb = pt_stats_variance(b) / b->n;
    v = va + vb;
    if (!(v > 0)) return a->mean == b->mean ? 1 : 0;
    return 2 * pt_student_sf(fabs(a->mean - b->mean) / sqrt(v),
                             v * v / (va * va / (a->n - 1) + vb * vb / (b->n - 1)));
}

PTDEF double pt_p_value_counts(const double *observed, const double *expected, int cells)
{
    double o = 0, e = 0, chi2 = 0, last_o = 0, last_e = 0;
    int i, used = 0;
    for (i = 0; i < cells; i++) {
        o += observed[i];
        e += expected[i];
        if (e < 5) continue;
        if (used > 0) chi2 += (last_o - last_e) * (last_o - last_e) / last_e;
        last_o = o;
        last_e = e;
        o = e = 0;
        used++;
    }
    if (used < 2) return 1;
    last_o += o; /* what is left joins the last cell */
    last_e += e;
    chi2 += (last_o - last_e) * (last_o - last_e) / last_e;
    return pt_chi2_sf(chi2, used - 1);
}

PTDEF double pt_stats_interval(const pt_stats *s, double confidence)
{
    double lo = 0, hi = 1e9, p = (1 - confidence) / 2;
    int i;
    if (s->n < 2) return HUGE_VAL;
    for (i = 0; i < 100; i++) { /* the quantile of Student's t by bisection */
        double mid = 0.5 * (lo + hi);
        if (pt_student_sf(mid, s->n - 1) > p) lo = mid;
        else hi = mid;
    }
    return hi * pt_stats_standard_error(s);
}

PTDEF double pt_mis_weight(double p1, double p2, pt_heuristic heuristic)
{
    double r;
    if (!(p1 > 0)) return 0;
    if (p1 == p2) return 0.5; /* two infinite ones too */
    if (heuristic == PT_HEURISTIC_MAXIMUM) return p1 > p2;
    r = p2 / p1;
    return heuristic == PT_HEURISTIC_POWER ? 1 / (1 + r * r) : 1 / (1 + r);
}

/* An estimator at work: value() draws what it needs from the sampler and returns one value, whose expectation
   is the integral. */
typedef struct pti_estimator {
    const pt_integral *p;
    double (*value)(struct pti_estimator *e);
    pt_sampler sampler;
    double calls;
    const pt_technique *techniques;
    const int *counts;
    const double *shares;
    int technique_count;
    pt_heuristic heuristic;
    pt_integrand g;
    double g_integral, coefficient, survival;
    int outer, splits;
} pti_estimator;

static double pti_call(pti_estimator *e, const double *x)
{
    e->calls++;
    return e->p->f(x, e->p->user);
}

static void pti_draw_numbers(pti_estimator *e, double *u, int from, int to)
{
    int d;
    for (d = from; d < to; d++) u[d] = pti_draw(&e->sampler);
}

static double pti_value_mean(pti_estimator *e)
{
    double u[64];
    pti_draw_numbers(e, u, 0, e->p->dimensions);
    return pti_call(e, u);
}

static double pti_value_antithetic(pti_estimator *e)
{
    double u[64], v[64];
    int d;
    pti_draw_numbers(e, u, 0, e->p->dimensions);
    for (d = 0; d < e->p->dimensions; d++) v[d] = fmin(1 - u[d], 1 - PTI_2_M53);
    return 0.5 * (pti_call(e, u) + pti_call(e, v));
}

static double pti_value_control(pti_estimator *e)
{
    double u[64];
    pti_draw_numbers(e, u, 0, e->p->dimensions);
    return pti_call(e, u) - e->coefficient * (e->g(u, e->p->user) - e->g_integral);
}

/* Weight of technique i for point x: (n_i p_i)^k / sum (n_j p_j)^k, k = 1, 2 or infinity, as ratios to n_i p_i. */
static double pti_technique_weight(const pti_estimator *e, int i, double own, const double *x)
{
    double sum = 1;
    int j;
    for (j = 0; j < e->technique_count; j++) {
        double n = e->shares ? e->shares[j] : e->counts[j], r;
        if (j == i || !(n > 0)) continue;
        r = n * e->techniques[j].density(x, e->techniques[j].user) / own;
        if (e->heuristic == PT_HEURISTIC_MAXIMUM) {
            if (r > 1 || (r == 1 && j < i)) return 0; /* a tie goes to the first */
        } else {
            sum += e->heuristic == PT_HEURISTIC_POWER ? r * r : r;
        }
    }
    return 1 / sum;
}

/* One sample of technique i, weighted, over its density times n. */
static double pti_technique_value(pti_estimator *e, int i, double n)
{
    const pt_technique *t = &e->techniques[i];
    double u[64], x[64], own;
    pti_draw_numbers(e, u, 0, e->p->dimensions);
    t->warp(u, x, t->user);
    own = n * t->density(x, t->user);
    if (!(own > 0)) return 0;
    return pti_call(e, x) * pti_technique_weight(e, i, own, x) / own;
}

static double pti_value_mis(pti_estimator *e)
{
    double sum = 0;
    int i, k;
    for (i = 0; i < e->technique_count; i++)
        for (k = 0; k < e->counts[i]; k++) sum += pti_technique_value(e, i, e->counts[i]);
    return sum;
}

static double pti_value_mis_one(pti_estimator *e)
{
    double u = pti_draw(&e->sampler);
    int i;
    for (i = 0; i < e->technique_count - 1 && u >= e->shares[i]; i++) u -= e->shares[i];
    return pti_technique_value(e, i, e->shares[i]);
}

static double pti_value_roulette(pti_estimator *e)
{
    double u[64];
    if (!(pti_draw(&e->sampler) < e->survival)) return 0;
    pti_draw_numbers(e, u, 0, e->p->dimensions);
    return pti_call(e, u) / e->survival;
}

static double pti_value_splitting(pti_estimator *e)
{
    double u[64], sum = 0;
    int k;
    pti_draw_numbers(e, u, 0, e->outer);
    for (k = 0; k < e->splits; k++) {
        pti_draw_numbers(e, u, e->outer, e->p->dimensions);
        sum += pti_call(e, u);
    }
    return sum / e->splits;
}

/* Averages p->n values. Independent numbers: every value is a unit of the statistics. Else: every randomised
   point set is. */
static pt_result pti_estimate(pti_estimator *e, const pt_integral *p, double (*value)(pti_estimator *), pt_estimate *out)
{
    uint32_t sets = p->sampler == PT_SAMPLER_INDEPENDENT ? p->n : 32, points, set, i;
    double start = pt_cpu_seconds(), se;
    memset(out, 0, sizeof *out);
    if (!value || !p->f || p->dimensions < 1 || p->dimensions > 64 || p->n < 32) return PT_ERROR_ARGUMENT;
    if ((int)p->sampler < 0 || p->sampler >= PT_SAMPLER_GIVEN) return PT_ERROR_ARGUMENT;
    points = p->n / sets;
    e->p = p;
    e->calls = 0;
    e->sampler = pt_sampler_make(p->sampler, p->seed, points);
    for (set = 0; set < sets; set++) {
        double sum = 0;
        for (i = 0; i < points; i++) {
            pt_sampler_start(&e->sampler, set, i);
            sum += value(e);
        }
        pt_stats_add(&out->units, sum / points);
    }
    se = pt_stats_standard_error(&out->units);
    out->value = out->units.mean;
    out->standard_error = se;
    out->evaluations = e->calls;
    out->seconds = pt_cpu_seconds() - start;
    out->efficiency = se > 0 && out->seconds > 0 ? 1 / (se * se * out->seconds) : 0;
    return PT_OK;
}

PTDEF pt_result pt_estimate_mean(const pt_integral *p, pt_estimate *out)
{
    pti_estimator e;
    memset(&e, 0, sizeof e);
    return pti_estimate(&e, p, pti_value_mean, out);
}

PTDEF pt_result pt_estimate_antithetic(const pt_integral *p, pt_estimate *out)
{
    pti_estimator e;
    memset(&e, 0, sizeof e);
    return pti_estimate(&e, p, pti_value_antithetic, out);
}

PTDEF pt_result pt_estimate_importance(const pt_integral *p, const pt_technique *technique, pt_estimate *out)
{
    static const int once = 1;
    return pt_estimate_mis(p, technique, &once, 1, PT_HEURISTIC_BALANCE, out);
}

PTDEF pt_result pt_estimate_control(const pt_integral *p, pt_integrand g, double g_integral, double c, pt_estimate *out)
{
    pti_estimator e;
    memset(&e, 0, sizeof e);
    e.g = g;
    e.g_integral = g_integral;
    e.coefficient = c;
    return pti_estimate(&e, p, g && pti_finite(g_integral) && pti_finite(c) ? pti_value_control : NULL, out);
}

PTDEF pt_result pt_estimate_mis(const pt_integral *p, const pt_technique *techniques, const int *counts, int count,
                                pt_heuristic heuristic, pt_estimate *out)
{
    pti_estimator e;
    int i, all = 0, ok = techniques && counts && count >= 1 && count <= 8;
    memset(&e, 0, sizeof e);
    for (i = 0; ok && i < count; i++) {
        ok = counts[i] >= 0 && counts[i] <= 1024;
        all += ok ? counts[i] : 0;
    }
    e.techniques = techniques;
    e.counts = counts;
    e.technique_count = count;
    e.heuristic = heuristic;
    return pti_estimate(&e, p, ok && all > 0 ? pti_value_mis : NULL, out);
}

PTDEF pt_result pt_estimate_mis_one(const pt_integral *p, const pt_technique *techniques, const double *shares,
                                    int count, pt_heuristic heuristic, pt_estimate *out)
{
    pti_estimator e;
    double sum = 0;
    int i, ok = techniques && shares && count >= 1 && count <= 8;
    memset(&e, 0, sizeof e);
    for (i = 0; ok && i < count; i++) {
        ok = shares[i] >= 0;
        sum += shares[i];
    }
    e.techniques = techniques;
    e.shares = shares;
    e.technique_count = count;
    e.heuristic = heuristic;
    /* a sum of up to eight rounded shares is off by no more than eight roundings */
    return pti_estimate(&e, p, ok && fabs(sum - 1) <= 8 * PTI_2_M53 ? pti_value_mis_one : NULL, out);
}

PTDEF pt_result pt_estimate_roulette(const pt_integral *p, double q, pt_estimate *out)
{
    pti_estimator e;
    memset(&e, 0, sizeof e);
    e.survival = q;
    return pti_estimate(&e, p, q > 0 && q <= 1 ? pti_value_roulette : NULL, out);
}

PTDEF pt_result pt_estimate_splitting(const pt_integral *p, int outer, int splits, pt_estimate *out)
{
    pti_estimator e;
    memset(&e, 0, sizeof e);
    e.outer = outer;
    e.splits = splits;
    return pti_estimate(&e, p, outer >= 1 && outer < p->dimensions && splits >= 1 ? pti_value_splitting : NULL, out);
}

/* =====================================================================================================
   [PT-04] SAMPLING WARPS: implementation
   =====================================================================================================
   A warp takes uniform numbers to points of a wanted density p: if x = g(u), then p(x) = 1 / |det g'(u)|.
   Each stands beside its density, and nobody else writes that density down. Small angles are the trap: the
   cosine of a cone of half angle 1e-4 has lost half its digits, so nothing here is computed as 1 - cos. */

/* Shirley and Chiu's map of the square a, b in [-1,1] to polar coordinates of the disk: concentric squares
   become concentric circles [Shi97]. */
static pt_vec2 pti_concentric(pt_real a, pt_real b, pt_real *radius)
{
    pt_real r, phi;
    if (a == 0 && b == 0) {
        *radius = 0;
        return pt_v2(0, 0);
    }
    if (pti_fabs(a) > pti_fabs(b)) {
        r = a;
        phi = PTI_R(PT_PI / 4) * (b / a);
    } else {
        r = b;
        phi = PTI_R(PT_PI / 2) - PTI_R(PT_PI / 4) * (a / b);
    }
    *radius = pti_fabs(r);
    return pt_v2(r * pti_cos(phi), r * pti_sin(phi));
}

PTDEF pt_vec2 pt_warp_disk(pt_vec2 u)
{
    pt_real r;
    return pti_concentric(2 * u.x - 1, 2 * u.y - 1, &r);
}

PTDEF pt_real pt_warp_disk_pdf_a(void)
{
    return PTI_R(1 / PT_PI);
}

PTDEF pt_vec3 pt_warp_hemisphere(pt_vec2 u)
{
    pt_real r = pti_sqrt((1 - u.x) * (1 + u.x)), phi = PTI_R(2 * PT_PI) * u.y;
    return pt_v3(r * pti_cos(phi), r * pti_sin(phi), u.x);
}

PTDEF pt_real pt_warp_hemisphere_pdf_w(pt_vec3 w)
{
    return w.z >= 0 ? PTI_R(1 / (2 * PT_PI)) : 0;
}

PTDEF pt_vec3 pt_warp_cosine(pt_vec2 u)
{
    /* u stands for the cell [u, u + 2 h) of the generator's grid; its centre u + h keeps a and b inside
       (-1, 1), so that r < 1 and z > 0: a direction with z = 0 would have density 0. */
    const pt_real h = PTI_R(PTI_UNIT_ROUNDOFF);
    pt_real r;
    pt_vec2 d = pti_concentric(2 * u.x - 1 + h, 2 * u.y - 1 + h, &r);
    return pt_v3(d.x, d.y, pti_sqrt((1 - r) * (1 + r)));
}

PTDEF pt_real pt_warp_cosine_pdf_w(pt_vec3 w)
{
    return w.z > 0 ? w.z * PTI_R(1 / PT_PI) : 0;
}

PTDEF pt_vec3 pt_warp_sphere(pt_vec2 u)
{
    pt_real r = 2 * pti_sqrt(u.x * (1 - u.x)), phi = PTI_R(2 * PT_PI) * u.y;
    return pt_v3(r * pti_cos(phi), r * pti_sin(phi), 1 - 2 * u.x);
}

PTDEF pt_real pt_warp_sphere_pdf_w(void)
{
    return PTI_R(1 / (4 * PT_PI));
}

PTDEF pt_vec3 pt_warp_cone(pt_vec2 u, double omc)
{
    /* x = 1 - cos is uniform on [0, omc]; sin^2 = x (2 - x). */
    double x = (double)u.x * omc, r = sqrt(x * (2 - x)), phi = 2 * PT_PI * (double)u.y;
    return pt_v3((pt_real)(r * cos(phi)), (pt_real)(r * sin(phi)), (pt_real)(1 - x));
}

PTDEF double pt_warp_cone_pdf_w(double omc)
{
    return 1 / (2 * PT_PI * omc);
}

PTDEF pt_vec2 pt_warp_triangle(pt_vec2 u)
{
    pt_real s = pti_sqrt(u.x);
    return pt_v2(s * (1 - u.y), s * u.y);
}

/* --- spherical triangle ---

   Let a, b, c be the unit directions to the corners. [Oos83]: the solid angle E satisfies
       tan(E/2) = |a . (b x c)| / (1 + a.b + b.c + c.a).
   Put c(s) = cos(s) a + sin(s) t on the arc from a to c (t its unit tangent at a). Divide above and below by
   1 + cos(s), with h = s/2:
       tan(E/2) = V sin(h) / ((1 + a.b) cos(h) + (b.t) sin(h)),      V = |a . (b x t)|.
   This gives the solid angle of the whole (s = arc), and solved for h it is the sampling of [Arv95]: the part
   of the triangle up to c(s) has solid angle u E where
       tan(h) = (1 + a.b) sin(u E/2) / (V cos(u E/2) - (b.t) sin(u E/2)).
   V and b.t are formed from the chord b - a, and that from the corners before they are normalised; so the
   relative error stays small for tiny triangles, where Arvo's sum of angles minus pi loses everything. */

/* w/|w| - v/|v| without cancellation: (e - a (|w| - |v|)) / |w| with e = w - v, a = v/|v| and
   |w| - |v| = e.(v + w) / (|v| + |w|). */
static pti_d3 pti_chord(pti_d3 v, pti_d3 w, pti_d3 a)
{
    pti_d3 e = pti_d_sub(w, v);
    double lv = pti_d_length(v), lw = pti_d_length(w);
    return pti_d_scale(pti_d_sub(e, pti_d_scale(a, pti_d_dot(e, pti_d_add(v, w)) / (lv + lw))), 1 / lw);
}

static double pti_spherical_triangle_setup(pt_spherical_triangle *s, pti_d3 v0, pti_d3 v1, pti_d3 v2)
{
    pti_d3 a = pti_d_normalize(v0), b = pti_d_normalize(v1), ab = pti_chord(v0, v1, a), ac = pti_chord(v0, v2, a), t;
    double e, h;
    t = pti_d_sub(ac, pti_d_scale(a, pti_d_dot(a, ac)));
    t = pti_d_normalize(t);
    s->arc = 2 * asin(fmin(1, pti_d_length(ac) / 2));
    s->triple = fabs(pti_d_dot(ab, pti_d_cross(t, a)));
    s->bt = pti_d_dot(ab, t);
    s->ab1 = 1 + pti_d_dot(a, b);
    s->a[0] = a.x; s->a[1] = a.y; s->a[2] = a.z;
    s->b[0] = b.x; s->b[1] = b.y; s->b[2] = b.z;
    s->t[0] = t.x; s->t[1] = t.y; s->t[2] = t.z;
    h = s->arc / 2;
    e = 2 * atan2(s->triple * sin(h), s->ab1 * cos(h) + s->bt * sin(h));
    s->solid_angle = s->triple > 0 && e > 0 ? e : 0;
    return s->solid_angle;
}

PTDEF double pt_spherical_triangle_make(pt_spherical_triangle *s, pt_vec3 p, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2)
{
    return pti_spherical_triangle_setup(s, pti_d_between(p, v0), pti_d_between(p, v1), pti_d_between(p, v2));
}

static pti_d3 pti_spherical_triangle_direction(const pt_spherical_triangle *s, double u0, double u1)
{
    pti_d3 a = pti_d(s->a[0], s->a[1], s->a[2]), b = pti_d(s->b[0], s->b[1], s->b[2]);
    pti_d3 t = pti_d(s->t[0], s->t[1], s->t[2]), c, bc;
    double half = 0.5 * u0 * s->solid_angle, arc, x;
    arc = 2 * atan2(s->ab1 * sin(half), s->triple * cos(half) - s->bt * sin(half));
    c = pti_d_add(pti_d_scale(a, cos(arc)), pti_d_scale(t, sin(arc)));
    /* On the arc from b to c, 1 - cos is uniform; at c it is |c - b|^2 / 2. */
    bc = pti_d_sub(c, b);
    x = 0.5 * u1 * pti_d_dot(bc, bc);
    bc = pti_d_normalize(pti_d_sub(bc, pti_d_scale(b, pti_d_dot(b, bc))));
    return pti_d_add(pti_d_scale(b, 1 - x), pti_d_scale(bc, sqrt(fmax(0, x * (2 - x)))));
}

PTDEF pt_vec3 pt_spherical_triangle_sample(const pt_spherical_triangle *s, pt_vec2 u)
{
    return pti_d_to(pti_spherical_triangle_direction(s, (double)u.x, (double)u.y));
}

/* --- spherical rectangle [Ure13] ---

   In the frame of the rectangle (x, y along the edges, z towards p, so that the plane is z = z0 < 0) the part
   up to abscissa x has a solid angle that can be inverted in closed form; along the remaining line the
   ordinate follows from the sine of its elevation. The angles enter as a sum minus 2 pi: an error of 2^-53
   (2 pi + what acos makes of an argument near 1 or -1), which for a small or nearly edge-on rectangle is more
   than 2^-24 of its solid angle. Such a rectangle is sampled as two spherical triangles, which have no such
   loss. */

/* Rounding error of acos(x), in units of 2^-53: its slope. */
static double pti_acos_slope(double x)
{
    return 1 / sqrt(fmax(PTI_2_M53, (1 - x) * (1 + x)));
}

/* d: the corner relative to p. */
static double pti_spherical_rectangle_setup(pt_spherical_rectangle *s, pti_d3 d, pti_d3 d1, pti_d3 d2)
{
    pti_d3 opposite = pti_d_add(pti_d_add(d, d1), d2);
    pti_d3 x = pti_d_normalize(d1), y = pti_d_normalize(d2), z = pti_d_cross(x, y);
    pt_spherical_triangle half;
    double n0, n2, n3;
    s->z0 = pti_d_dot(d, z);
    if (s->z0 > 0) {
        s->z0 = -s->z0;
        z = pti_d_scale(z, -1);
    }
    s->x[0] = x.x; s->x[1] = x.y; s->x[2] = x.z;
    s->y[0] = y.x; s->y[1] = y.y; s->y[2] = y.z;
    s->z[0] = z.x; s->z[1] = z.y; s->z[2] = z.z;
    s->x0 = pti_d_dot(d, x);
    s->y0 = pti_d_dot(d, y);
    s->x1 = s->x0 + pti_d_length(d1);
    s->y1 = s->y0 + pti_d_length(d2);
    /* z components of the unit normals of the four planes through p and an edge */
    n0 = -s->y0 / hypot(s->y0, s->z0);
    n2 = s->y1 / hypot(s->y1, s->z0);
    n3 = -s->x0 / hypot(s->x0, s->z0);
    s->b0 = n0;
    s->b1 = n2;
    s->k = 2 * PT_PI - acos(fmax(-1, fmin(1, -n2 * n3))) - acos(fmax(-1, fmin(1, -n3 * n0)));
    s->solid_angle = pti_spherical_triangle_setup(&half, d, pti_d_add(d, d1), opposite);
    s->solid_angle += pti_spherical_triangle_setup(&half, d, opposite, pti_d_add(d, d2));
    if (!(s->z0 < 0)) s->solid_angle = 0;
    s->as_triangles = PTI_2_M53 * (2 * PT_PI + pti_acos_slope(n2 * n3) + pti_acos_slope(n3 * n0)) > PTI_2_M24 * s->solid_angle;
    return s->solid_angle;
}

PTDEF double pt_spherical_rectangle_make(pt_spherical_rectangle *s, pt_vec3 p, pt_vec3 corner, pt_vec3 e1,
                                         pt_vec3 e2)
{
    return pti_spherical_rectangle_setup(s, pti_d_between(p, corner), pti_d_from(e1), pti_d_from(e2));
}

static pti_d3 pti_spherical_rectangle_halves(const pt_spherical_rectangle *s, double u0, double u1)
{
    pti_d3 v00 = pti_d(s->x0, s->y0, s->z0), v10 = pti_d(s->x1, s->y0, s->z0);
    pti_d3 v11 = pti_d(s->x1, s->y1, s->z0), v01 = pti_d(s->x0, s->y1, s->z0);
    pt_spherical_triangle half;
    double first = pti_spherical_triangle_setup(&half, v00, v10, v11) / s->solid_angle;
    if (u0 < first) return pti_spherical_triangle_direction(&half, u0 / first, u1);
    pti_spherical_triangle_setup(&half, v00, v11, v01);
    return pti_spherical_triangle_direction(&half, (u0 - first) / (1 - first), u1);
}

static pti_d3 pti_spherical_rectangle_local(const pt_spherical_rectangle *s, double u0, double u1)
{
    double au = u0 * s->solid_angle + s->k, fu = (cos(au) * s->b0 - s->b1) / sin(au);
    double cu = copysign(1 / sqrt(fu * fu + s->b0 * s->b0), fu), xu, d, h0, h1, h, yv;
    cu = fmax(-1, fmin(1, cu));
    xu = -cu * s->z0 / sqrt((1 - cu) * (1 + cu));
    xu = fmax(s->x0, fmin(s->x1, xu));
    d = hypot(xu, s->z0);
    h0 = s->y0 / hypot(d, s->y0);
    h1 = s->y1 / hypot(d, s->y1);
    h = h0 + u1 * (h1 - h0);
    yv = h * d / sqrt((1 - h) * (1 + h));
    yv = fmax(s->y0, fmin(s->y1, yv));
    return pti_d(xu, yv, s->z0);
}

static pti_d3 pti_spherical_rectangle_direction(const pt_spherical_rectangle *s, double u0, double u1)
{
    pti_d3 x = pti_d(s->x[0], s->x[1], s->x[2]), y = pti_d(s->y[0], s->y[1], s->y[2]);
    pti_d3 z = pti_d(s->z[0], s->z[1], s->z[2]), l;
    if (s->as_triangles) l = pti_spherical_rectangle_halves(s, u0, u1);
    else l = pti_spherical_rectangle_local(s, u0, u1);
    l = pti_d_add(pti_d_add(pti_d_scale(x, l.x), pti_d_scale(y, l.y)), pti_d_scale(z, l.z));
    return pti_d_normalize(l);
}

PTDEF pt_vec3 pt_spherical_rectangle_sample(const pt_spherical_rectangle *s, pt_vec2 u)
{
    return pti_d_to(pti_spherical_rectangle_direction(s, (double)u.x, (double)u.y));
}

/* --- discrete distributions --- */

/* [Vos91]: columns of equal height 1/n; each holds one index and, above its threshold, an alias that fills it
   up. `stack` holds the indices that are still too small from the left, those too large from the right. */
static void pti_alias_fill(pt_alias *table, double *scaled, uint32_t *stack)
{
    uint32_t n = table->count, i, low = 0, high = n;
    for (i = 0; i < n; i++) {
        scaled[i] = table->entries[i].pmf * n;
        if (scaled[i] < 1) stack[low++] = i;
        else stack[--high] = i;
    }
    while (low > 0 && high < n) {
        uint32_t s = stack[--low], l = stack[high];
        table->entries[s].threshold = scaled[s];
        table->entries[s].alias = l;
        scaled[l] -= 1 - scaled[s];
        if (scaled[l] < 1) {
            high++;
            stack[low++] = l;
        }
    }
    /* What is left is full up to rounding. */
    while (high < n) table->entries[stack[high++]].threshold = 1;
    while (low > 0) table->entries[stack[--low]].threshold = 1;
}

PTDEF pt_result pt_alias_make(pt_alias *table, const double *weights, uint32_t count, void *alloc_user)
{
    double sum = 0, *scaled;
    uint32_t i, *stack;
    table->entries = NULL;
    table->count = 0;
    for (i = 0; i < count; i++) {
        if (!(weights[i] >= 0) || !pti_finite(weights[i])) return PT_ERROR_ARGUMENT;
        sum += weights[i];
    }
    if (!pti_finite(sum)) return PT_ERROR_ARGUMENT;
    if (!(sum > 0)) return PT_OK;
    table->entries = (pt_alias_entry *)pti_alloc_zero(count, sizeof *table->entries, alloc_user);
    scaled = (double *)pti_alloc(count, sizeof *scaled, alloc_user);
    stack = (uint32_t *)pti_alloc(count, sizeof *stack, alloc_user);
    if (table->entries && scaled && stack) {
        table->count = count;
        for (i = 0; i < count; i++) {
            table->entries[i].pmf = weights[i] / sum;
            table->entries[i].alias = i;
        }
        pti_alias_fill(table, scaled, stack);
    } else {
        pti_free(table->entries, alloc_user);
        table->entries = NULL;
    }
    pti_free(scaled, alloc_user);
    pti_free(stack, alloc_user);
    return table->entries ? PT_OK : PT_ERROR_MEMORY;
}

PTDEF uint32_t pt_alias_sample(const pt_alias *table, double u, double *pmf)
{
    double scaled = u > 0 ? u * table->count : 0;
    uint32_t i = (uint32_t)fmin(scaled, 4294967295.0);
    PT_ASSERT(table->count > 0);
    if (i >= table->count) i = table->count - 1; /* u * n may round up to n */
    if (scaled - i >= table->entries[i].threshold) i = table->entries[i].alias;
    *pmf = table->entries[i].pmf;
    return i;
}

PTDEF void pt_alias_free(pt_alias *table, void *alloc_user)
{
    pti_free(table->entries, alloc_user);
    table->entries = NULL;
    table->count = 0;
}

/* =====================================================================================================
   [PT-05] RADIOMETRY: implementation
   =====================================================================================================
   Flux is energy per time (W); intensity I = dPhi/domega (W/sr) is what a point source sends into a
   direction; irradiance E = dPhi/dA (W/m^2) is what falls on a surface; radiance L = d^2Phi/(domega dA cos)
   is what a ray carries, the same at both its ends. E = int L cos domega over the hemisphere; the closed forms
   below are that integral for simple lights, and the tests hold the samplers against them. */

PTDEF double pt_flux_point(double intensity)
{
    return 4 * PT_PI * intensity;
}

PTDEF double pt_exitance(double radiance)
{
    return PT_PI * radiance; /* int L cos over the hemisphere */
}

PTDEF double pt_intensity_of_flux(double flux)
{
    return flux / (4 * PT_PI);
}

PTDEF double pt_radiance_of_flux(double flux, double area)
{
    return flux / (PT_PI * area);
}

PTDEF pt_rgbd pt_watts_from_lumens(double lumens, pt_rgb colour)
{
    double r = (double)colour.r, g = (double)colour.g, b = (double)colour.b, y = pt_luminance(r, g, b);
    double k = y > 0 ? lumens / (PT_LUMENS_PER_WATT * y) : 0;
    return pt_rgbd3(k * r, k * g, k * b);
}

PTDEF double pt_flux_spot(double intensity, double cos_start, double cos_end)
{
    /* 2 pi int I falloff dcos; a smoothstep has the mean 1/2 */
    return 2 * PT_PI * intensity * (1 - 0.5 * (cos_start + cos_end));
}

/* The falloff from 1 - cos of the three angles. */
static double pti_spot_falloff(double omc_axis, double omc_start, double omc_end)
{
    double x = fmax(0, fmin(1, (omc_end - omc_axis) / (omc_end - omc_start)));
    return x * x * (3 - 2 * x);
}

PTDEF double pt_spot_falloff(double cos_axis, double cos_start, double cos_end)
{
    return pti_spot_falloff(1 - cos_axis, 1 - cos_start, 1 - cos_end);
}

PTDEF double pt_solid_angle_cap(double theta)
{
    double s = sin(theta / 2);
    return 4 * PT_PI * s * s; /* 2 pi (1 - cos theta) without the cancellation */
}

PTDEF double pt_solid_angle_triangle(pt_vec3 p, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2)
{
    pt_spherical_triangle s;
    return pt_spherical_triangle_make(&s, p, v0, v1, v2);
}

PTDEF double pt_solid_angle_rectangle(pt_vec3 p, pt_vec3 corner, pt_vec3 e1, pt_vec3 e2)
{
    pt_spherical_rectangle s;
    return pt_spherical_rectangle_make(&s, p, corner, e1, e2);
}

PTDEF double pt_solid_angle_polygon(pt_vec3 p, const pt_vec3 *v, int count)
{
    /* A fan of triangles from v[0], each with the sign of its winding as seen from p. */
    double sum = 0;
    int i;
    for (i = 1; i + 1 < count; i++) {
        pti_d3 a = pti_d_between(p, v[0]), n = pti_d_cross(pti_d_between(v[0], v[i]), pti_d_between(v[0], v[i + 1]));
        sum += copysign(pt_solid_angle_triangle(p, v[0], v[i], v[i + 1]), pti_d_dot(a, n));
    }
    return fabs(sum);
}

PTDEF double pt_solid_angle_disk(double r, double h, double offset)
{
    /* int (1 - cos theta) dphi along the rim, phi around the foot of p. With the rim at angle psi of the disk,
       rho^2 = o^2 + r^2 + 2 o r cos psi, s = sqrt(h^2 + rho^2):  dphi = (r^2 + o r cos psi)/rho^2 dpsi and
       (1 - h/s)/rho^2 = 1/(s (s + h)). The integrand is smooth and periodic: the trapezoidal rule converges
       faster than any power; it is doubled until it stands still. */
    double sum = 0, last = -1, value = 0;
    uint32_t n, i;
    for (n = 8; n <= 1u << 20; n *= 2) {
        for (i = (n == 8 ? 0 : 1); i < n; i += (n == 8 ? 1 : 2)) {
            double c = cos(2 * PT_PI * i / n), s = sqrt(h * h + offset * offset + r * r + 2 * offset * r * c);
            sum += (r * r + offset * r * c) / (s * (s + h));
        }
        value = 2 * PT_PI * sum / n;
        if (fabs(value - last) <= 4 * PTI_2_M53 * value) break;
        last = value;
    }
    return value;
}

PTDEF double pt_irradiance_point(double intensity, double d, double cos_theta)
{
    return intensity * fmax(0, cos_theta) / (d * d);
}

PTDEF double pt_irradiance_sphere(double radiance, double r, double d, double cos_theta)
{
    /* Above the horizon pi L s^2 cos, s = r/d. Cut by the horizon (|cos| < s): [Sny96]. */
    double s = r / d, c = cos_theta, x, y, w;
    if (c >= s) return PT_PI * radiance * s * s * c;
    if (c <= -s) return 0;
    x = sqrt((1 - s) * (1 + s)) / s;
    y = -x * c / sqrt((1 - c) * (1 + c));
    w = sqrt((1 - c) * (1 + c) * fmax(0, (1 - y) * (1 + y)));
    return radiance * ((c * acos(fmax(-1, fmin(1, y))) - x * w) * s * s + atan2(w, x));
}

PTDEF double pt_irradiance_disk(double radiance, double r, double h, double offset)
{
    double a = h * h + offset * offset, b = a + r * r, root = sqrt(b * b - 4 * offset * offset * r * r);
    /* pi L / 2 (1 - (a - r^2)/root), the difference multiplied out where it would cancel */
    if (a < r * r) return 0.5 * PT_PI * radiance * (1 + (r * r - a) / root);
    return 2 * PT_PI * radiance * r * r * h * h / (root * (root + a - r * r));
}

/* x (sqrt(1+y^2) atan(x / sqrt(1+y^2)) - atan(x)) without cancellation for small x and y: the difference of
   two arcs by one, and m = sqrt(1+y^2) - 1 multiplied out. */
static double pti_parallel_term(double x, double y)
{
    double y1 = sqrt(1 + y * y), m = y * y / (1 + y1);
    return x * (m * atan(x / y1) - atan(x * m / (y1 + x * x)));
}

PTDEF double pt_form_factor_parallel(double a, double b, double c)
{
    double x = a / c, y = b / c;
    return 2 / (PT_PI * x * y) *
           (0.5 * log1p(x * x * y * y / (1 + x * x + y * y)) + pti_parallel_term(x, y) + pti_parallel_term(y, x));
}

PTDEF double pt_form_factor_perpendicular(double w, double h, double l)
{
    double x = w / l, y = h / l, x2 = x * x, y2 = y * y, d = sqrt(x2 + y2), all = 1 + x2 + y2;
    double logs = log((1 + x2) * (1 + y2) / all) + x2 * log(x2 * all / ((1 + x2) * (x2 + y2))) +
                  y2 * log(y2 * all / ((1 + y2) * (x2 + y2)));
    return (x * atan(1 / x) + y * atan(1 / y) - d * atan(1 / d) + 0.25 * logs) / (PT_PI * x);
}

PTDEF double pt_form_factor_disks(double r1, double r2, double h)
{
    double x = 1 + (h * h + r2 * r2) / (r1 * r1), q = 2 * r2 / r1;
    return 0.5 * q * q / (x + sqrt((x - q) * (x + q))); /* (x - sqrt(x^2 - q^2)) / 2 */
}

PTDEF double pt_form_factor_sphere_disk(double r, double h)
{
    double s = sqrt(h * h + r * r);
    return 0.5 * r * r / (s * (s + h)); /* (1 - h/s) / 2 */
}

PTDEF double pt_blackbody(double nm, double kelvin)
{
    const double h = 6.62607015e-34, c = 299792458, k = 1.380649e-23; /* exact by definition of the SI */
    double lambda = nm * 1e-9;
    return 2 * h * c * c / (lambda * lambda * lambda * lambda * lambda) / expm1(h * c / (lambda * k * kelvin)) * 1e-9;
}

/* The part of a polygon with n . v > 0 (v relative to the receiver); out has room for 2 * count corners (a
   polygon that is not convex may be cut many times). */
static int pti_clip_horizon(const pti_d3 *v, int count, pti_d3 n, pti_d3 *out)
{
    int i, kept = 0;
    for (i = 0; i < count; i++) {
        pti_d3 a = v[i], b = v[(i + 1) % count];
        double ha = pti_d_dot(a, n), hb = pti_d_dot(b, n);
        if (ha > 0) out[kept++] = a;
        if ((ha > 0) != (hb > 0)) out[kept++] = pti_d_add(a, pti_d_scale(pti_d_sub(b, a), ha / (ha - hb)));
    }
    return kept;
}

PTDEF double pt_irradiance_polygon(double radiance, pt_vec3 p, pt_vec3 n, const pt_vec3 *v, int count)
{
    /* [Lam60]: E = L/2 sum over edges of (angle of the edge) * (unit normal of its plane through p) . n */
    pti_d3 in[32], out[64], nd = pti_d_from(n);
    double sum = 0;
    int i, kept;
    if (count < 3 || count > 32) return 0;
    for (i = 0; i < count; i++) in[i] = pti_d_between(p, v[i]);
    kept = pti_clip_horizon(in, count, nd, out);
    for (i = 0; i < kept; i++) {
        pti_d3 a = pti_d_normalize(out[i]), b = pti_d_normalize(out[(i + 1) % kept]), axis = pti_d_cross(a, b);
        double s = pti_d_length(axis);
        if (s > 0) sum += atan2(s, pti_d_dot(a, b)) * pti_d_dot(axis, nd) / s;
    }
    return 0.5 * radiance * fabs(sum);
}

PTDEF double pt_spectrum_at(const pt_spectrum *s, double nm)
{
    int i, last = s->count - 1;
    if (last < 0) return 0;
    if (nm < s->nm[0] || nm >= s->nm[last])
        return s->zero_outside ? 0 : nm < s->nm[0] ? s->value[0] : s->value[last];
    for (i = 0; i < last - 1 && nm > s->nm[i + 1];) i++;
    return s->value[i] + (s->value[i + 1] - s->value[i]) * (nm - s->nm[i]) / (s->nm[i + 1] - s->nm[i]);
}

/* CIE 1931 2-degree standard observer and illuminant D65, 360 to 830 nm in steps of 5 nm
   [ISO/CIE 11664-1 and 11664-2]: xbar, ybar, zbar, S. */
#define PTI_CIE_COUNT 95
static const double pti_cie[PTI_CIE_COUNT][4] = {
    {0.0001299, 3.917e-06, 0.0006061, 46.6383}, {0.0002321, 6.965e-06, 0.001086, 49.3637},
    {0.0004149, 1.239e-05, 0.001946, 52.0891}, {0.0007416, 2.202e-05, 0.003486, 51.0323},
    {0.001368, 3.9e-05, 0.006450001, 49.9755}, {0.002236, 6.4e-05, 0.01054999, 52.3118},
    {0.004243, 0.00012, 0.02005001, 54.6482}, {0.00765, 0.000217, 0.03621, 68.7015},
    {0.01431, 0.000396, 0.06785001, 82.7549}, {0.02319, 0.00064, 0.1102, 87.1204},
    {0.04351, 0.00121, 0.2074, 91.486}, {0.07763, 0.00218, 0.3713, 92.4589},
    {0.13438, 0.004, 0.6456, 93.4318}, {0.21477, 0.0073, 1.0390501, 90.057},
    {0.2839, 0.0116, 1.3856, 86.6823}, {0.3285, 0.01684, 1.62296, 95.7736},
    {0.34828, 0.023, 1.74706, 104.865}, {0.34806, 0.0298, 1.7826, 110.936},
    {0.3362, 0.038, 1.77211, 117.008}, {0.3187, 0.048, 1.7441, 117.41},
    {0.2908, 0.06, 1.6692, 117.812}, {0.2511, 0.0739, 1.5281, 116.336},
    {0.19536, 0.09098, 1.28764, 114.861}, {0.1421, 0.1126, 1.0419, 115.392},
    {0.09564, 0.13902, 0.8129501, 115.923}, {0.05795001, 0.1693, 0.6162, 112.367},
    {0.03201, 0.20802, 0.46518, 108.811}, {0.0147, 0.2586, 0.3533, 109.082},
    {0.0049, 0.323, 0.272, 109.354}, {0.0024, 0.4073, 0.2123, 108.578},
    {0.0093, 0.503, 0.1582, 107.802}, {0.0291, 0.6082, 0.1117, 106.296},
    {0.06327, 0.71, 0.07824999, 104.79}, {0.1096, 0.7932, 0.05725001, 106.239},
    {0.1655, 0.862, 0.04216, 107.689}, {0.2257499, 0.9148501, 0.02984, 106.047},
    {0.2904, 0.954, 0.0203, 104.405}, {0.3597, 0.9803, 0.0134, 104.225},
    {0.4334499, 0.9949501, 0.008749999, 104.046}, {0.5120501, 1, 0.005749999, 102.023},
    {0.5945, 0.995, 0.0039, 100}, {0.6784, 0.9786, 0.002749999, 98.1671},
    {0.7621, 0.952, 0.0021, 96.3342}, {0.8425, 0.9154, 0.0018, 96.0611},
    {0.9163, 0.87, 0.001650001, 95.788}, {0.9786, 0.8163, 0.0014, 92.2368},
    {1.0263, 0.757, 0.0011, 88.6856}, {1.0567, 0.6949, 0.001, 89.3459},
    {1.0622, 0.631, 0.0008, 90.0062}, {1.0456, 0.5668, 0.0006, 89.8026},
    {1.0026, 0.503, 0.00034, 89.5991}, {0.9384, 0.4412, 0.00024, 88.6489},
    {0.8544499, 0.381, 0.00019, 87.6987}, {0.7514, 0.321, 0.0001, 85.4936},
    {0.6424, 0.265, 4.999999e-05, 83.2886}, {0.5419, 0.217, 3e-05, 83.4939},
    {0.4479, 0.175, 2e-05, 83.6992}, {0.3608, 0.1382, 1e-05, 81.863},
    {0.2835, 0.107, 0, 80.0268}, {0.2187, 0.0816, 0, 80.1207},
    {0.1649, 0.061, 0, 80.2146}, {0.1212, 0.04458, 0, 81.2462},
    {0.0874, 0.032, 0, 82.2778}, {0.0636, 0.0232, 0, 80.281},
    {0.04677, 0.017, 0, 78.2842}, {0.0329, 0.01192, 0, 74.0027},
    {0.0227, 0.00821, 0, 69.7213}, {0.01584, 0.005723, 0, 70.6652},
    {0.01135916, 0.004102, 0, 71.6091}, {0.008110916, 0.002929, 0, 72.979},
    {0.005790346, 0.002091, 0, 74.349}, {0.004109457, 0.001484, 0, 67.9765},
    {0.002899327, 0.001047, 0, 61.604}, {0.00204919, 0.00074, 0, 65.7448},
    {0.001439971, 0.00052, 0, 69.8856}, {0.0009999493, 0.0003611, 0, 72.4863},
    {0.0006900786, 0.0002492, 0, 75.087}, {0.0004760213, 0.0001719, 0, 69.3398},
    {0.0003323011, 0.00012, 0, 63.5927}, {0.0002348261, 8.48e-05, 0, 55.0054},
    {0.0001661505, 6e-05, 0, 46.4182}, {0.000117413, 4.24e-05, 0, 56.6118},
    {8.307527e-05, 3e-05, 0, 66.8054}, {5.870652e-05, 2.12e-05, 0, 65.0941},
    {4.150994e-05, 1.499e-05, 0, 63.3828}, {2.935326e-05, 1.06e-05, 0, 63.8434},
    {2.067383e-05, 7.4657e-06, 0, 64.304}, {1.455977e-05, 5.2578e-06, 0, 61.8779},
    {1.025398e-05, 3.7029e-06, 0, 59.4519}, {7.221456e-06, 2.6078e-06, 0, 55.7054},
    {5.085868e-06, 1.8366e-06, 0, 51.959}, {3.581652e-06, 1.2934e-06, 0, 54.6998},
    {2.522525e-06, 9.1093e-07, 0, 57.4406}, {1.776509e-06, 6.4153e-07, 0, 58.8765},
    {1.251141e-06, 4.5181e-07, 0, 60.3125}
};

PTDEF void pt_cie_xyz(double nm, double xyz[3])
{
    /* The cubic through the four nearest entries: close to the 1 nm tables of the standard (1e-5). */
    double x = (nm - 360) / 5, f, w[4];
    int i, k;
    xyz[0] = xyz[1] = xyz[2] = 0;
    if (!(nm >= 360 && nm <= 830)) return;
    i = (int)x;
    if (i < 1) i = 1;
    if (i > PTI_CIE_COUNT - 3) i = PTI_CIE_COUNT - 3;
    f = x - i;
    w[0] = -f * (f - 1) * (f - 2) / 6;
    w[1] = (f + 1) * (f - 1) * (f - 2) / 2;
    w[2] = -(f + 1) * f * (f - 2) / 2;
    w[3] = (f + 1) * f * (f - 1) / 6;
    for (k = 0; k < 12; k++) xyz[k % 3] += w[k / 3] * pti_cie[i - 1 + k / 3][k % 3];
}

PTDEF double pt_cie_d65(double nm)
{
    double x = (nm - 360) / 5;
    int i;
    if (!(nm >= 360 && nm <= 830)) return 0;
    i = x < PTI_CIE_COUNT - 2 ? (int)x : PTI_CIE_COUNT - 2;
    return pti_cie[i][3] + (x - i) * (pti_cie[i + 1][3] - pti_cie[i][3]); /* linear by definition */
}

PTDEF double pt_blackbody_efficacy(double kelvin)
{
    /* 683 int B V / (sigma T^4 / pi), sigma = 2 pi^5 k^4 / (15 h^3 c^2) */
    double sum = 0, bar[3], t2 = kelvin * kelvin;
    int nm;
    for (nm = 360; nm <= 830; nm++) {
        pt_cie_xyz(nm, bar);
        sum += bar[1] * pt_blackbody(nm, kelvin);
    }
    return PT_LUMENS_PER_WATT * sum / (5.670374419184429e-8 * t2 * t2 / PT_PI);
}

PTDEF pt_rgbd pt_xyz_to_rgb(const double xyz[3])
{
    /* inverse of the matrix whose columns are the sRGB primaries, scaled to D65 white */
    return pt_rgbd3(3.240454162114105 * xyz[0] - 1.537138512797717 * xyz[1] - 0.4985314095560162 * xyz[2],
                    -0.9692660305051868 * xyz[0] + 1.876010845446694 * xyz[1] + 0.0415560175303498 * xyz[2],
                    0.0556434309591147 * xyz[0] - 0.2040259135167538 * xyz[1] + 1.057225188223179 * xyz[2]);
}

/* XYZ of a spectrum, under D65 (light = 1) or as it is (light = 0), divided by what the constant 1 has in Y. */
static pt_rgbd pti_spectrum_to_rgb(const pt_spectrum *s, int light)
{
    double xyz[3] = {0, 0, 0}, white = 0, bar[3], power;
    int nm, k;
    for (nm = 360; nm <= 830; nm++) {
        pt_cie_xyz(nm, bar);
        power = light ? pt_cie_d65(nm) : 1;
        white += power * bar[1];
        power *= pt_spectrum_at(s, nm);
        for (k = 0; k < 3; k++) xyz[k] += power * bar[k];
    }
    for (k = 0; k < 3; k++) xyz[k] /= white;
    return pt_xyz_to_rgb(xyz);
}

PTDEF pt_rgbd pt_reflectance_to_rgb(const pt_spectrum *reflectance)
{
    return pti_spectrum_to_rgb(reflectance, 1);
}

PTDEF pt_rgbd pt_emission_to_rgb(const pt_spectrum *emission)
{
    return pti_spectrum_to_rgb(emission, 0);
}

/* =====================================================================================================
   [PT-06] SHAPES AND RAYS: implementation
   =====================================================================================================
   Two questions decide whether a picture has cracks and speckles: does this ray meet this shape, and where
   does the next ray start? Both are answered without any length that somebody has chosen.

   Decisions are made in double from the pt_real input. A sphere's discriminant is formed from the distance of
   its centre to the ray, (r - l)(r + l), not as b^2 - 4ac, which cancels for far and for huge spheres [Hai19].
   A triangle is tested by the signs of three edge functions after a shear that makes the ray the z axis
   [Woo13]; here those signs are EXACT for the sheared corners: a*b - c*d of doubles has the sign of the
   difference of the two rounded products, because rounding is monotonic, and where these are equal the signs
   of their rounding errors decide (fma gives them exactly). Two triangles that share an edge see the same
   sheared corners, so a ray falls on one side of the edge for both or on the edge for both: no gap.

   A computed point is off its surface by rounding; its error bound travels with it in pt_hit. The next ray
   starts at the point moved along the normal by that bound, each coordinate rounded away from the surface
   ([PBR] 6.8): the least offset that is safe, at any scale. */

PTDEF double pt_gamma(int n)
{
    return n * PTI_UNIT_ROUNDOFF / (1 - n * PTI_UNIT_ROUNDOFF);
}

/* A ray made ready for the shapes. */
typedef struct pti_ray {
    double o[3], d[3];
    int kx, ky, kz;         /* the axes, z the longest of d                                                */
    double sx, sy, sz;      /* shear and scale that take d to (0,0,1)                                      */
    double end;             /* tmax: what may lie at it, or beyond it by rounding, is not hit              */
} pti_ray;

/* From an origin and a direction in double. Paths carry the origin with the digits that pt_real loses: far from the
   coordinate origin a rounded hit point would lie behind the neighbouring wall of an edge. */
PTI_INLINE void pti_ray_set(pti_ray *r, pti_d3 o, pti_d3 d, double end)
{
    static const signed char x_of[6] = {1, 2, 0, 2, 0, 1}, y_of[6] = {2, 0, 1, 1, 2, 0};
    const double x = fabs(d.x), y = fabs(d.y), z = fabs(d.z);
    const int z_last = z > (x > y ? x : y), y_last = !(x > y) & !z_last; /* no branches: no one can foretell them */
    int k;
    r->end = end;
    r->o[0] = o.x; r->o[1] = o.y; r->o[2] = o.z;
    r->d[0] = d.x; r->d[1] = d.y; r->d[2] = d.z;
    r->kz = 2 * z_last | y_last;
    k = r->kz + 3 * (r->d[r->kz] < 0); /* x and y exchanged keep the winding of triangles */
    r->kx = x_of[k];
    r->ky = y_of[k];
    r->sz = 1 / r->d[r->kz];
    r->sx = r->d[r->kx] * r->sz;
    r->sy = r->d[r->ky] * r->sz;
}

static pti_ray pti_ray_from(pti_d3 o, pti_d3 d, double end)
{
    pti_ray r;
    pti_ray_set(&r, o, d, end);
    return r;
}

PTI_INLINE void pti_ray_set_real(pti_ray *r, const pt_ray *ray)
{
    pti_ray_set(r, pti_d_from(ray->o), pti_d_from(ray->d), ray->tmax >= PTI_REAL_MAX ? HUGE_VAL : (double)ray->tmax); /* NaN stays */
}

static pti_ray pti_ray_make(const pt_ray *ray)
{
    pti_ray r;
    pti_ray_set_real(&r, ray);
    return r;
}

/* a * b - c * d with the exact sign; swapping the two products negates the result exactly. */
PTI_INLINE double pti_edge(double a, double b, double c, double d)
{
    double p = a * b, q = c * d;
    PTI_FENCE(p);
    PTI_FENCE(q);
    if (p == q) return fma(a, b, -p) - fma(c, d, -q);
    return p - q;
}

/* A corner relative to the origin, sheared: (x, y) across the ray, z along it in units of d. x, y, z: its coordinates
   along the axes of the ray. */
PTI_INLINE pti_d3 pti_shear_axes(const pti_ray *r, pt_real x, pt_real y, pt_real z)
{
    const double c = (double)z - r->o[r->kz];
    double px = r->sx * c, py = r->sy * c;
    PTI_FENCE(px);
    PTI_FENCE(py);
    return pti_d((double)x - r->o[r->kx] - px, (double)y - r->o[r->ky] - py, r->sz * c);
}

PTI_INLINE pt_real pti_along(const pt_vec3 *v, int axis)
{
    pt_real x;
    memcpy(&x, (const char *)v + (size_t)axis * sizeof x, sizeof x);
    return x;
}

PTI_INLINE pti_d3 pti_shear(const pti_ray *r, const pt_vec3 *v)
{
    return pti_shear_axes(r, pti_along(v, r->kx), pti_along(v, r->ky), pti_along(v, r->kz));
}

/* Are not all sign bits the same? One branch: no one can foretell each sign. */
PTI_INLINE int pti_signs_differ(double a, double b, double c)
{
    uint64_t x, y, z;
    memcpy(&x, &a, sizeof x);
    memcpy(&y, &b, sizeof y);
    memcpy(&z, &c, sizeof z);
    return ((x ^ y) | (x ^ z)) >> 63 != 0;
}

/* The largest of three magnitudes. */
PTI_INLINE double pti_max3(double a, double b, double c)
{
    a = fabs(a);
    b = fabs(b);
    c = fabs(c);
    if (b > a) a = b;
    return c > a ? c : a;
}

/* Bound of the rounding error of the depth u a.z + v b.z + w c.z before it is divided by det ([PBR] 6.8.7): an
   origin on the plane of the triangle may come out in front of it by no more than this. Relative errors, in
   units of e = 2^-53: z 3 (difference, reciprocal, product), x and y 5 of their own and the sheared-off part,
   an edge function 2 and what x and y bring in, the sum 3. */
PTI_INLINE double pti_depth_error(const pti_ray *r, pti_d3 a, pti_d3 b, pti_d3 c, double u, double v, double w)
{
    const double e = PTI_2_M53 * (1 + 16 * PTI_2_M53);
    double x = pti_max3(a.x, b.x, c.x), y = pti_max3(a.y, b.y, c.y), z = pti_max3(a.z, b.z, c.z);
    double sheared = z * fabs(r->d[r->kz]), edge = pti_max3(u, v, w);
    double dx = 5 * e * (x + sheared), dy = 5 * e * (y + sheared), dz = 3 * e * z;
    double dedge = 2 * (2 * e * x * y + dy * x + dx * y);
    return 3 * (3 * e * edge * z + dedge * z + dz * edge);
}

/* Of the sheared corners a, b, c: t in (0, tmax) and weights of b and c. */
PTI_INLINE int pti_sheared_triangle(const pti_ray *r, pti_d3 a, pti_d3 b, pti_d3 c, double tmax, double *t, double *b1,
                                    double *b2)
{
    const double u = pti_edge(c.x, b.y, c.y, b.x), v = pti_edge(a.x, c.y, a.y, c.x), w = pti_edge(b.x, a.y, b.y, a.x);
    double det, depth, error, p, q;
    if (pti_signs_differ(u, v, w) && ((u < 0) + (v < 0) + (w < 0)) * ((u > 0) + (v > 0) + (w > 0)) != 0) return 0;
    det = u + v + w;
    if (det == 0) return 0; /* seen edge-on */
    p = u * a.z;
    q = v * b.z;
    depth = w * c.z;
    PTI_FENCE(p);
    PTI_FENCE(q);
    PTI_FENCE(depth);
    depth += p + q;
    if (!(depth / det > 0 && depth / det < tmax)) return 0; /* NaN misses */
    error = pti_depth_error(r, a, b, c, u, v, w);
    if (!(fabs(depth) > error)) return 0; /* the origin may lie on it, */
    if (!(fabs(depth) + error < r->end * fabs(det))) return 0; /* or the end of a shadow ray */
    *t = depth / det;
    *b1 = v / det;
    *b2 = w / det;
    return 1;
}

PTI_INLINE int pti_triangle(const pti_ray *r, const pt_vec3 *v0, const pt_vec3 *v1, const pt_vec3 *v2, double tmax,
                            double *t, double *b1, double *b2)
{
    return pti_sheared_triangle(r, pti_shear(r, v0), pti_shear(r, v1), pti_shear(r, v2), tmax, t, b1, b2);
}

/* The corners in order, rounded to pt_real as a user's own sums would be: then a neighbour with the same
   corners leaves no gap. */
PTI_INLINE void pti_parallelogram_corners(const pt_parallelogram *s, pt_vec3 v[4])
{
    v[0] = s->corner;
    v[1] = pt_v3_add(s->corner, s->edge1);
    v[2] = pt_v3_add(v[1], s->edge2);
    v[3] = pt_v3_add(s->corner, s->edge2);
}

/* A parallelogram is two triangles that share the diagonal from the corner; u and v are the weights of its
   edges, u >= v in the first triangle. Rounded corners may fold it, so that a ray meets both: then the first decides, also
   where it is beyond tmax, so that the answer does not depend on what was tested before. */
static int pti_parallelogram(const pti_ray *r, const pt_vec3 c[4], double tmax, double *t, double *u, double *v)
{
    double b1, b2;
    if (pti_triangle(r, &c[0], &c[1], &c[2], HUGE_VAL, t, &b1, &b2)) {
        *u = b1 + b2;
        *v = b2;
        return *t < tmax;
    }
    if (pti_triangle(r, &c[0], &c[2], &c[3], tmax, t, &b1, &b2)) {
        *u = b1;
        *v = b1 + b2;
        return 1;
    }
    return 0;
}

/* [Hai19]: with f = o - c and b = -f.d, the foot of the perpendicular is l = f + (b/a) d, and the
   discriminant is a (r - |l|)(r + |l|). The root that would cancel comes from the product of both,
   (|f| - r)(|f| + r). */
static int pti_sphere(const pti_ray *r, pt_vec3 centre, double radius, double tmax, double *t)
{
    pti_d3 d = pti_d(r->d[0], r->d[1], r->d[2]);
    pti_d3 f = pti_d_sub(pti_d(r->o[0], r->o[1], r->o[2]), pti_d_from(centre));
    double a = pti_d_dot(d, d), b = -pti_d_dot(f, d), l, root, q, c, length, t0, t1;
    l = pti_d_length(pti_d_add(f, pti_d_scale(d, b / a)));
    if (!(l <= radius)) return 0;
    root = sqrt(a * (radius - l) * (radius + l));
    q = b + copysign(root, b);
    length = pti_d_length(f);
    c = (length - radius) * (length + radius);
    if (q == 0) return 0; /* both roots are 0: a tangent at the origin */
    t0 = c / q;
    t1 = q / a;
    if (t0 > t1) {
        double swap = t0;
        t0 = t1;
        t1 = swap;
    }
    if (!(t0 > 0)) t0 = t1;
    if (!(t0 > 0 && t0 < tmax)) return 0;
    /* the end of a shadow ray may lie on it: 16 roundings of the distances that went into t0 */
    if (!(t0 + 16 * PTI_2_M53 * (length + radius) / sqrt(a) < r->end)) return 0;
    *t = t0;
    return 1;
}

PTDEF int pt_intersect_sphere(const pt_ray *ray, pt_vec3 centre, pt_real radius, double *t)
{
    pti_ray r = pti_ray_make(ray);
    return radius > 0 && pti_sphere(&r, centre, (double)radius, (double)ray->tmax, t);
}

/* Is the normal (v1-v0)x(v2-v0) different from zero in double? */
static int pti_triangle_has_area(pt_vec3 v0, pt_vec3 v1, pt_vec3 v2)
{
    pti_d3 a = pti_d_between(v0, v1), b = pti_d_between(v0, v2);
    return pti_edge(a.y, b.z, a.z, b.y) != 0 || pti_edge(a.z, b.x, a.x, b.z) != 0 || pti_edge(a.x, b.y, a.y, b.x) != 0;
}

PTDEF int pt_intersect_triangle(const pt_ray *ray, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2, double *t, double b[2])
{
    pti_ray r = pti_ray_make(ray);
    return pti_triangle_has_area(v0, v1, v2) && pti_triangle(&r, &v0, &v1, &v2, (double)ray->tmax, t, &b[0], &b[1]);
}

/* A ray made ready for boxes: o and 1/d, rounded; 1/0 = infinity. */
typedef struct pti_slabs {
    pt_real origin[3], inverse[3];
} pti_slabs;

static pti_slabs pti_slabs_from(const pti_ray *r)
{
    pti_slabs s;
    int k;
    for (k = 0; k < 3; k++) {
        s.origin[k] = (pt_real)r->o[k];
        s.inverse[k] = 1 / (pt_real)r->d[k];
    }
    return s;
}

/* Slabs [Ize13]. Near and far face are chosen by the sign of 1/d; the comparisons keep the old value where
   0 * infinity gave NaN (origin on a face, ray inside its plane), which is the conservative answer. A far
   distance is the product of three rounded operations; widening it by 1 + 2 gamma(3) outweighs the errors of
   both distances. *entry: where the box begins. */
PTI_INLINE int pti_box(const pti_slabs *r, pt_vec3 lo, pt_vec3 hi, pt_real tmax, pt_real *entry)
{
    const pt_real pad = PTI_R(1 + 9 * PTI_UNIT_ROUNDOFF); /* 1 + 2 gamma(4), rounded up: d, 1/d, -, * */
    pt_real t0 = 0, t1 = tmax, n, f;
    n = ((r->inverse[0] < 0 ? hi.x : lo.x) - r->origin[0]) * r->inverse[0];
    f = ((r->inverse[0] < 0 ? lo.x : hi.x) - r->origin[0]) * r->inverse[0] * pad;
    if (n > t0) t0 = n;
    if (f < t1) t1 = f;
    n = ((r->inverse[1] < 0 ? hi.y : lo.y) - r->origin[1]) * r->inverse[1];
    f = ((r->inverse[1] < 0 ? lo.y : hi.y) - r->origin[1]) * r->inverse[1] * pad;
    if (n > t0) t0 = n;
    if (f < t1) t1 = f;
    n = ((r->inverse[2] < 0 ? hi.z : lo.z) - r->origin[2]) * r->inverse[2];
    f = ((r->inverse[2] < 0 ? lo.z : hi.z) - r->origin[2]) * r->inverse[2] * pad;
    if (n > t0) t0 = n;
    if (f < t1) t1 = f;
    *entry = t0;
    return t0 <= t1;
}

PTDEF int pt_intersect_box(const pt_ray *ray, pt_vec3 lo, pt_vec3 hi)
{
    const pti_ray r = pti_ray_make(ray);
    const pti_slabs slabs = pti_slabs_from(&r);
    pt_real entry;
    return lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z && pti_box(&slabs, lo, hi, ray->tmax, &entry);
}

/* The next representable number upwards, or downwards. */
static pt_real pti_next(pt_real x, int up)
{
#ifdef PT_DOUBLE
    uint64_t bits, sign = (uint64_t)1 << 63;
#else
    uint32_t bits, sign = 0x80000000u;
#endif
    if (x == 0) x = 0; /* -0 becomes +0 */
    memcpy(&bits, &x, sizeof bits);
    if (bits == 0) bits = up ? 1u : sign | 1u;
    else if (((bits & sign) == 0) == (up != 0)) bits++;
    else bits--;
    memcpy(&x, &bits, sizeof bits);
    return x;
}

static pt_real pti_round_away(pt_real p, pt_real offset)
{
    pt_real moved = p + offset;
    return offset > 0 ? pti_next(moved, 1) : offset < 0 ? pti_next(moved, 0) : moved;
}

/* p moved off its surface to the side of n (unit) for w.n >= 0, else to the other: by d = sum |n_k| err_k,
   the largest distance from the true plane that the error allows ([PBR] 6.8.6). */
static pt_vec3 pti_offset(pt_vec3 p, pt_vec3 error, pt_vec3 n, pt_vec3 w)
{
    pt_real d = pti_fabs(n.x) * error.x + pti_fabs(n.y) * error.y + pti_fabs(n.z) * error.z;
    if (pt_v3_dot(n, w) < 0) d = -d;
    return pt_v3(pti_round_away(p.x, d * n.x), pti_round_away(p.y, d * n.y), pti_round_away(p.z, d * n.z));
}

PTDEF pt_ray pt_spawn_ray(pt_vec3 p, pt_vec3 p_error, pt_vec3 ng, pt_vec3 w)
{
    pt_ray ray;
    ray.o = pti_offset(p, p_error, ng, w);
    ray.d = w;
    ray.tmax = PTI_REAL_MAX;
    return ray;
}

PTDEF pt_ray pt_spawn_ray_to(pt_vec3 p, pt_vec3 p_error, pt_vec3 np, pt_vec3 q, pt_vec3 q_error, pt_vec3 nq)
{
    /* The direction q - o is rounded once per coordinate, which moves the end by up to u |d_k|: that belongs
       to the error of q. */
    const pt_real u = PTI_R(PTI_UNIT_ROUNDOFF);
    pt_vec3 d = pt_v3_sub(q, p);
    pt_ray ray;
    ray.o = pti_offset(p, p_error, np, d);
    q_error = pt_v3_add(q_error, pt_v3(u * pti_fabs(d.x), u * pti_fabs(d.y), u * pti_fabs(d.z)));
    ray.d = pt_v3_sub(pti_offset(q, q_error, nq, pt_v3_neg(d)), ray.o);
    ray.tmax = 1;
    return ray;
}

/* The origin of a ray that leaves a hit into w, as pt_spawn_ray has it, but with all digits of the hit: moved along
   ng by the error of p + p_low and of the sum below. */
static pti_d3 pti_leave(const pt_hit *hit, pt_vec3 w)
{
    pti_d3 p = pti_d_add(pti_d_from(hit->p), pti_d_from(hit->p_low)), n = pti_d_from(hit->ng);
    pti_d3 e = pti_d_add(pti_d_from(hit->p_low_error), pti_d_scale(pti_d(fabs(p.x), fabs(p.y), fabs(p.z)), 4 * PTI_2_M53));
    double d = fabs(n.x) * e.x + fabs(n.y) * e.y + fabs(n.z) * e.z;
    return pti_d_add(p, pti_d_scale(n, pt_v3_dot(hit->ng, w) < 0 ? -d : d));
}

/* The shadow ray from a hit towards a point of a light, both ends moved off their surfaces. */
static pti_ray pti_shadow_ray(const pt_hit *hit, pt_vec3 w, pt_vec3 q, pt_vec3 q_error, pt_vec3 nq)
{
    pti_d3 o = pti_leave(hit, w);
    return pti_ray_from(o, pti_d_sub(pti_d_from(pti_offset(q, q_error, nq, pt_v3_neg(w))), o), 1);
}

/* The corners of a flat primitive, and how many: a triangle has v[3] = v[2]. */
PTI_INLINE int pti_corners(const pt_scene *scene, const pt_primitive *p, pt_vec3 v[4])
{
    const pt_triangle *s;
    if (p->shape == PT_SHAPE_PARALLELOGRAM) {
        pti_parallelogram_corners(&scene->parallelograms[p->index], v);
        return 4;
    }
    s = &scene->triangles[p->index];
    v[0] = scene->positions[s->v[0]];
    v[1] = scene->positions[s->v[1]];
    v[2] = v[3] = scene->positions[s->v[2]];
    return 3;
}

/* The nearest hit so far. */
typedef struct pti_best {
    double t, u, v;
    int primitive;
} pti_best;

/* Primitive i must be hit before this to be nearer than `best`, or as near and lower in number: then the answer does
   not depend on the order of the tests. */
PTI_INLINE double pti_before(const pti_best *best, int i)
{
    return best->primitive > i ? best->t * (1 + 2 * PTI_2_M53) : best->t;
}

PTI_INLINE int pti_keep(pti_best *best, int i, double t, double u, double v)
{
    if (t > best->t) return 0;
    best->t = t;
    best->u = u;
    best->v = v;
    best->primitive = i;
    return 1;
}

/* Tests flat primitive i, of three or four corners, for t in (0, best->t]. */
static int pti_test_flat(const pti_ray *r, const pt_vec3 *c, int corners, int i, pti_best *best)
{
    const double tmax = pti_before(best, i);
    double t, u, v;
    return (corners == 3 ? pti_triangle(r, &c[0], &c[1], &c[2], tmax, &t, &u, &v)
                         : pti_parallelogram(r, c, tmax, &t, &u, &v)) && pti_keep(best, i, t, u, v);
}

/* Tests primitive i of the scene. */
PTI_INLINE int pti_test(const pt_scene *scene, const pti_ray *r, int i, pti_best *best)
{
    const pt_primitive *p = &scene->primitives[i];
    double t;
    pt_vec3 c[4];
    if (p->shape == PT_SHAPE_SPHERE) {
        const pt_sphere *s = &scene->spheres[p->index];
        return pti_sphere(r, s->centre, (double)s->radius, pti_before(best, i), &t) && pti_keep(best, i, t, 0, 0);
    }
    return pti_test_flat(r, c, pti_corners(scene, p, c), i, best);
}

/* Error of a point computed in double from terms of magnitude m and then rounded to pt_real. Sixteen
   roundings of 2^-53 cover the shear, the edge functions, the division and the weighted sum. */
PTI_INLINE pt_real pti_point_error(pt_real p, double m)
{
    return PTI_R(PTI_UNIT_ROUNDOFF) * pti_fabs(p) + (pt_real)(16 * PTI_2_M53 * m);
}

static pti_d3 pti_d_abs(pti_d3 a)
{
    return pti_d(fabs(a.x), fabs(a.y), fabs(a.z));
}

static void pti_set_point(pt_hit *hit, pti_d3 p, pti_d3 magnitude)
{
    hit->p = pti_d_to(p);
    hit->p_error = pt_v3(pti_point_error(hit->p.x, magnitude.x), pti_point_error(hit->p.y, magnitude.y),
                         pti_point_error(hit->p.z, magnitude.z));
    /* rounding the rest once more leaves an error of u^2 |p| */
    hit->p_low = pti_d_to(pti_d_sub(p, pti_d_from(hit->p)));
    hit->p_low_error = pti_d_to(pti_d_add(pti_d_scale(magnitude, 16 * PTI_2_M53), pti_d_scale(pti_d_abs(p), PTI_UNIT_ROUNDOFF * PTI_UNIT_ROUNDOFF)));
}

/* Position, error bound and normal of a triangle at weights b1, b2 of its corners 1 and 2. */
static void pti_fill_triangle(pt_hit *hit, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2, double b1, double b2)
{
    pti_d3 a = pti_d_from(v0), b = pti_d_from(v1), c = pti_d_from(v2), p;
    p = pti_d_add(pti_d_scale(a, 1 - b1 - b2), pti_d_add(pti_d_scale(b, b1), pti_d_scale(c, b2)));
    pti_set_point(hit, p, pti_d_add(pti_d_abs(a), pti_d_add(pti_d_abs(b), pti_d_abs(c))));
    hit->ng = pti_d_to(pti_d_normalize(pti_d_cross(pti_d_sub(b, a), pti_d_sub(c, a))));
    hit->ns = hit->ng;
}

/* The same for any flat primitive at its hit's u and v. */
static void pti_fill_flat(const pt_scene *scene, const pt_primitive *p, double u, double v, pt_hit *hit)
{
    pt_vec3 c[4];
    if (pti_corners(scene, p, c) == 3) pti_fill_triangle(hit, c[0], c[1], c[2], u, v);
    else if (u >= v) pti_fill_triangle(hit, c[0], c[1], c[2], u - v, v);
    else pti_fill_triangle(hit, c[0], c[2], c[3], u, v - u);
}

/* Shading normal and texture coordinates, where the mesh has them. */
static void pti_fill_mesh(const pt_scene *scene, const pt_triangle *s, pt_hit *hit)
{
    const pt_mesh *mesh = &scene->meshes[s->mesh];
    pt_real w = 1 - hit->u - hit->v;
    if (mesh->has_normals) {
        const pt_vec3 *n = scene->normals;
        pt_vec3 sum = pt_v3_scale(n[s->v[0] + mesh->normal_offset], w);
        sum = pt_v3_add(sum, pt_v3_scale(n[s->v[1] + mesh->normal_offset], hit->u));
        sum = pt_v3_normalize(pt_v3_add(sum, pt_v3_scale(n[s->v[2] + mesh->normal_offset], hit->v)));
        if (pt_v3_dot(sum, hit->ng) < 0) sum = pt_v3_neg(sum);
        if (pt_v3_dot(sum, sum) > PTI_R(0.5)) hit->ns = sum; /* normals that cancel leave the geometric one */
    }
    if (mesh->has_uvs) {
        const pt_vec2 *t = scene->uvs;
        pt_vec2 a = t[s->v[0] + mesh->uv_offset], b = t[s->v[1] + mesh->uv_offset], c = t[s->v[2] + mesh->uv_offset];
        hit->uv = pt_v2(w * a.x + hit->u * b.x + hit->v * c.x, w * a.y + hit->u * b.y + hit->v * c.y);
    }
}

/* The point of a sphere in the (not normalised) direction n from its centre: projected back onto the sphere, so
   that the error of a distance along a ray does not matter. */
static void pti_fill_sphere(const pt_sphere *s, pti_d3 n, pt_hit *hit)
{
    pti_d3 c = pti_d_from(s->centre);
    double r = (double)s->radius;
    n = pti_d_normalize(n);
    pti_set_point(hit, pti_d_add(c, pti_d_scale(n, r)), pti_d_add(pti_d_abs(c), pti_d(r, r, r)));
    hit->ng = hit->ns = pti_d_to(n);
}

static int pti_primitive_material(const pt_scene *scene, const pt_primitive *p)
{
    return p->shape == PT_SHAPE_TRIANGLE        ? scene->triangles[p->index].material
           : p->shape == PT_SHAPE_PARALLELOGRAM ? scene->parallelograms[p->index].material
                                                : scene->spheres[p->index].material;
}

/* Everything about the hit. */
static void pti_fill(const pt_scene *scene, const pti_ray *r, const pti_best *best, pt_hit *hit)
{
    const pt_primitive *p = &scene->primitives[best->primitive];
    hit->t = (pt_real)best->t;
    hit->u = (pt_real)best->u;
    hit->v = (pt_real)best->v;
    hit->uv = pt_v2(hit->u, hit->v);
    hit->primitive = best->primitive;
    hit->shape = p->shape;
    hit->light = p->light;
    hit->material = pti_primitive_material(scene, p);
    if (p->shape == PT_SHAPE_SPHERE) {
        const pt_sphere *s = &scene->spheres[p->index];
        const double t = best->t;
        pti_d3 q = pti_d(r->o[0] + t * r->d[0], r->o[1] + t * r->d[1], r->o[2] + t * r->d[2]);
        pti_fill_sphere(s, pti_d_sub(q, pti_d_from(s->centre)), hit);
        return;
    }
    pti_fill_flat(scene, p, best->u, best->v, hit);
    if (p->shape == PT_SHAPE_TRIANGLE) pti_fill_mesh(scene, &scene->triangles[p->index], hit);
}

/* =====================================================================================================
   [PT-07] BOUNDING VOLUME HIERARCHY: implementation
   =====================================================================================================
   A tree of boxes: a ray that misses a box misses all in it. Where to split? The chance that a random ray
   which meets a box also meets a box inside is the ratio of their areas, so the expected cost of a split is
   C = 1 + (A_left n_left + A_right n_right) / A (surface area heuristic). Sixteen bins an axis are tried. Where
   no split helps or all centres coincide, the list is halved; below depth 32 it always is, so no tree is deeper
   than 32 + log2(n) <= 63, and a fixed stack is enough. */

PTI_INLINE pt_vec3 pti_lower(pt_vec3 a, pt_vec3 b)
{
    return pt_v3(a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z);
}

PTI_INLINE pt_vec3 pti_upper(pt_vec3 a, pt_vec3 b)
{
    return pt_v3(a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y, a.z > b.z ? a.z : b.z);
}

/* Smallest box around a primitive. */
static void pti_primitive_box(const pt_scene *scene, const pt_primitive *p, pt_vec3 *lo, pt_vec3 *hi)
{
    pt_vec3 v[4];
    if (p->shape == PT_SHAPE_SPHERE) {
        const pt_sphere *s = &scene->spheres[p->index];
        pt_vec3 c = s->centre;
        pt_real r = s->radius;
        *lo = pt_v3(pti_next(c.x - r, 0), pti_next(c.y - r, 0), pti_next(c.z - r, 0));
        *hi = pt_v3(pti_next(c.x + r, 1), pti_next(c.y + r, 1), pti_next(c.z + r, 1));
        return;
    }
    pti_corners(scene, p, v); /* a triangle has v[3] = v[2] */
    *lo = pti_lower(pti_lower(v[0], v[1]), pti_lower(v[2], v[3]));
    *hi = pti_upper(pti_upper(v[0], v[1]), pti_upper(v[2], v[3]));
}

#if PTI_HAS_BVH

/* A box of doubles that grows; areas of large boxes do not fit into float. */
typedef struct pti_bounds {
    double lo[3], hi[3];
} pti_bounds;

static pti_bounds pti_bounds_empty(void)
{
    pti_bounds b;
    int k;
    for (k = 0; k < 3; k++) {
        b.lo[k] = HUGE_VAL;
        b.hi[k] = -HUGE_VAL;
    }
    return b;
}

static void pti_bounds_add(pti_bounds *b, pt_vec3 lo, pt_vec3 hi)
{
    const double l[3] = {(double)lo.x, (double)lo.y, (double)lo.z}, h[3] = {(double)hi.x, (double)hi.y, (double)hi.z};
    int k;
    for (k = 0; k < 3; k++) {
        if (l[k] < b->lo[k]) b->lo[k] = l[k];
        if (h[k] > b->hi[k]) b->hi[k] = h[k];
    }
}

#define PTI_BINS 16
#define PTI_LEAF_MAX 8

static void pti_bounds_join(pti_bounds *b, const pti_bounds *other)
{
    int k;
    for (k = 0; k < 3; k++) {
        if (other->lo[k] < b->lo[k]) b->lo[k] = other->lo[k];
        if (other->hi[k] > b->hi[k]) b->hi[k] = other->hi[k];
    }
}

static double pti_bounds_half_area(const pti_bounds *b)
{
    double x = b->hi[0] - b->lo[0], y = b->hi[1] - b->lo[1], z = b->hi[2] - b->lo[2];
    return x >= 0 ? x * y + y * z + z * x : 0;
}

/* Twice the centre of a box along an axis. */
PTI_INLINE double pti_centre(pt_vec3 lo, pt_vec3 hi, int axis)
{
    return axis == 0 ? (double)lo.x + (double)hi.x : axis == 1 ? (double)lo.y + (double)hi.y : (double)lo.z + (double)hi.z;
}

typedef struct pti_bin {
    pti_bounds bounds;
    uint32_t count;
} pti_bin;

typedef struct pti_split {
    int axis, bin; /* a primitive goes left if its centre falls into a bin below this one                  */
    double cost;
} pti_split;

/* What the builder works on. */
typedef struct pti_builder {
    pt_bvh *bvh;
    const pt_vec3 *lo, *hi;
} pti_builder;

static int pti_bin_of(double c, double lo, double scale)
{
    double x = (c - lo) * scale;
    return x < PTI_BINS - 1 ? (x > 0 ? (int)x : 0) : PTI_BINS - 1; /* clamped before the cast, also NaN */
}

/* The best of the 15 planes between the bins of one axis; sweeps from both sides. */
static void pti_sweep(const pti_bin *bins, int axis, pti_split *best)
{
    double right[PTI_BINS];
    pti_bounds box = pti_bounds_empty();
    uint32_t count = 0;
    int i;
    for (i = PTI_BINS - 1; i > 0; i--) {
        pti_bounds_join(&box, &bins[i].bounds);
        count += bins[i].count;
        right[i] = pti_bounds_half_area(&box) * count;
    }
    box = pti_bounds_empty();
    count = 0;
    for (i = 1; i < PTI_BINS; i++) {
        double cost;
        pti_bounds_join(&box, &bins[i - 1].bounds);
        count += bins[i - 1].count;
        cost = pti_bounds_half_area(&box) * count + right[i];
        if (cost < best->cost) {
            best->cost = cost;
            best->axis = axis;
            best->bin = i;
        }
    }
}

/* The best split of order[begin..end), axis -1 if all centres coincide. */
static pti_split pti_find_split(const pti_builder *b, uint32_t begin, uint32_t end, pti_bounds *centres)
{
    pti_bin bins[3][PTI_BINS];
    pti_split best;
    double scale[3];
    uint32_t i;
    int k, j;
    *centres = pti_bounds_empty();
    for (i = begin; i < end; i++) {
        uint32_t p = b->bvh->order[i];
        pt_vec3 c = pt_v3_add(b->lo[p], b->hi[p]);
        pti_bounds_add(centres, c, c);
    }
    for (k = 0; k < 3; k++) {
        double extent = centres->hi[k] - centres->lo[k];
        scale[k] = extent > 0 ? PTI_BINS / extent : 0;
        for (j = 0; j < PTI_BINS; j++) {
            bins[k][j].bounds = pti_bounds_empty();
            bins[k][j].count = 0;
        }
    }
    for (i = begin; i < end; i++) {
        uint32_t p = b->bvh->order[i];
        for (k = 0; k < 3; k++) {
            pti_bin *bin = &bins[k][pti_bin_of(pti_centre(b->lo[p], b->hi[p], k), centres->lo[k], scale[k])];
            pti_bounds_add(&bin->bounds, b->lo[p], b->hi[p]);
            bin->count++;
        }
    }
    best.axis = -1;
    best.bin = 0;
    best.cost = HUGE_VAL;
    for (k = 0; k < 3; k++)
        if (scale[k] > 0) pti_sweep(bins[k], k, &best);
    return best;
}

/* Moves what goes left to the front; returns the first of the right. */
static uint32_t pti_partition(const pti_builder *b, uint32_t begin, uint32_t end, const pti_split *s,
                              const pti_bounds *centres)
{
    double lo = centres->lo[s->axis], scale = PTI_BINS / (centres->hi[s->axis] - lo);
    uint32_t *order = b->bvh->order, left = begin, i;
    for (i = begin; i < end; i++) {
        uint32_t p = order[i];
        if (pti_bin_of(pti_centre(b->lo[p], b->hi[p], s->axis), lo, scale) < s->bin) {
            order[i] = order[left];
            order[left++] = p;
        }
    }
    return left;
}

static pti_bounds pti_range_bounds(const pti_builder *b, uint32_t begin, uint32_t end)
{
    pti_bounds box = pti_bounds_empty();
    uint32_t i;
    for (i = begin; i < end; i++) pti_bounds_add(&box, b->lo[b->bvh->order[i]], b->hi[b->bvh->order[i]]);
    return box;
}

/* Where to cut order[begin..end), or 0 for a leaf. Cost of a box test : cost of a primitive = 1 : 1. */
static uint32_t pti_cut_list(const pti_builder *b, uint32_t begin, uint32_t end, const pti_bounds *box, int depth)
{
    uint32_t n = end - begin, middle = begin + n / 2, cut;
    pti_bounds centres;
    pti_split split;
    double area = pti_bounds_half_area(box);
    if (n <= 1) return 0;
    if (depth >= PT_BVH_MAX_DEPTH / 2) return n <= PTI_LEAF_MAX ? 0 : middle;
    split = pti_find_split(b, begin, end, &centres);
    if (split.axis < 0) return n <= PTI_LEAF_MAX ? 0 : middle;
    if (n <= PTI_LEAF_MAX && split.cost + area >= area * n) return 0;
    cut = pti_partition(b, begin, end, &split, &centres);
    return cut > begin && cut < end ? cut : middle;
}

/* Splits until nothing is left to split; the stack holds nodes with their depth. */
static void pti_build_nodes(const pti_builder *b)
{
    uint32_t stack[2 * PT_BVH_MAX_DEPTH];
    int depths[2 * PT_BVH_MAX_DEPTH], top = 0;
    pt_bvh *bvh = b->bvh;
    stack[0] = 0;
    depths[0] = 0;
    bvh->nodes[0].first = 0;
    bvh->nodes[0].count = bvh->primitive_count;
    bvh->node_count = 1;
    for (top = 1; top > 0;) {
        pt_bvh_node *node = &bvh->nodes[stack[--top]];
        uint32_t begin = node->first, end = begin + node->count, cut;
        int depth = depths[top];
        pti_bounds box = pti_range_bounds(b, begin, end);
        node->lo = pt_v3((pt_real)box.lo[0], (pt_real)box.lo[1], (pt_real)box.lo[2]);
        node->hi = pt_v3((pt_real)box.hi[0], (pt_real)box.hi[1], (pt_real)box.hi[2]);
        if (depth > bvh->depth) bvh->depth = depth;
        cut = pti_cut_list(b, begin, end, &box, depth);
        if (cut == 0) continue;
        node->first = bvh->node_count;
        node->count = 0;
        bvh->nodes[bvh->node_count].first = begin;
        bvh->nodes[bvh->node_count].count = cut - begin;
        bvh->nodes[bvh->node_count + 1].first = cut;
        bvh->nodes[bvh->node_count + 1].count = end - cut;
        stack[top] = bvh->node_count + 1;
        depths[top++] = depth + 1;
        stack[top] = bvh->node_count;
        depths[top++] = depth + 1;
        bvh->node_count += 2;
    }
}

PTDEF pt_result pt_bvh_build(pt_bvh *bvh, const pt_vec3 *lo, const pt_vec3 *hi, uint32_t count, void *alloc_user)
{
    pti_builder b;
    uint32_t i;
    memset(bvh, 0, sizeof *bvh);
    if (count == 0) return PT_OK;
    if (count > 0x7fffffffu) return PT_ERROR_ARGUMENT;
    bvh->nodes = (pt_bvh_node *)pti_alloc(2 * (size_t)count, sizeof *bvh->nodes, alloc_user);
    bvh->order = (uint32_t *)pti_alloc(count, sizeof *bvh->order, alloc_user);
    if (!bvh->nodes || !bvh->order) {
        pt_bvh_free(bvh, alloc_user);
        return PT_ERROR_MEMORY;
    }
    for (i = 0; i < count; i++) bvh->order[i] = i;
    bvh->primitive_count = count;
    b.bvh = bvh;
    b.lo = lo;
    b.hi = hi;
    pti_build_nodes(&b);
    return PT_OK;
}

PTDEF void pt_bvh_free(pt_bvh *bvh, void *alloc_user)
{
    pti_free(bvh->nodes, alloc_user);
    pti_free(bvh->order, alloc_user);
    memset(bvh, 0, sizeof *bvh);
}

/* best->t as a limit for boxes, rounded up. */
PTI_INLINE pt_real pti_box_limit(double t)
{
    return (pt_real)t * PTI_R(1 + 16 * PTI_UNIT_ROUNDOFF);
}

/* Walks the tree, near child first; any = 1 stops at the first hit. */
static int pti_traverse(const pt_scene *scene, const pti_ray *r, pti_best *best, int any)
{
    const pt_bvh_node *nodes = scene->bvh.nodes, *node = nodes;
    const pti_slabs slabs = pti_slabs_from(r);
    uint32_t stack[PT_BVH_MAX_DEPTH + 1];
    pt_real entries[PT_BVH_MAX_DEPTH + 1], limit = pti_box_limit(best->t), e0, e1;
    int top = 0, found = 0;
    uint32_t i;
    if (!pti_box(&slabs, node->lo, node->hi, limit, &e0)) return 0;
    for (;;) {
        if (node->count > 0) {
            for (i = 0; i < node->count; i++) {
                if (!pti_test(scene, r, (int)scene->bvh.order[node->first + i], best)) continue;
                if (any) return 1;
                found = 1;
                limit = pti_box_limit(best->t);
            }
        } else {
            const pt_bvh_node *a = &nodes[node->first], *b = a + 1;
            int in_a = pti_box(&slabs, a->lo, a->hi, limit, &e0), in_b = pti_box(&slabs, b->lo, b->hi, limit, &e1);
            if (in_a && in_b) {
                int swap = e1 < e0;
                stack[top] = node->first + (swap ? 0u : 1u);
                entries[top++] = swap ? e0 : e1;
                node = swap ? b : a;
                continue;
            }
            if (in_a || in_b) {
                node = in_a ? a : b;
                continue;
            }
        }
        do {
            if (top == 0) return found;
            top--;
        } while (entries[top] > limit);
        node = &nodes[stack[top]];
    }
}

#endif /* PTI_HAS_BVH */

/* =====================================================================================================
   [PT-07b] WIDE TREE: implementation
   =====================================================================================================
   Optional, and nobody needs it to understand anything: the answers of the tree of [PT-07], bit for bit, two to
   four times as fast (make bench-embree compares it with Embree). Eight boxes or triangles are tested at a time, one in each lane ([PT-01]).

   Lanes are float, and float cannot decide: [PT-06] decides in double, exactly. So a lane only asks whether a primitive
   MAY be hit. It computes in float what [PT-06] computes in double, and a bound of the difference, and says no, or yes, where
   the bound allows no other answer. What it does not deny, little more than one primitive for each hit, goes to [PT-06], or,
   where it is certain, only through its arithmetic, once no nearer one is found. So rounding costs time, never a hit: the
   wide tree, the binary tree and the linear search agree, and a lane may use fused multiply-adds where there are some.

   Below, u = 2^-24 is the roundoff of float: each operation is off by u of its result. S is a length that no coordinate of
   a ray's origin and of the scene exceeds, and no way between them along an axis. It is kept between 2^-16 and 2^40: then no
   product of three lengths, 24 S^3 at most, overflows, and every bound is so far above 2^-126, the smallest of them
   160 (1.1 u S)^3, that what underflows, or counts as zero in some modes of processors, does not matter. Scenes that are
   smaller than 2^-24 or larger than 2^39 get the tree of [PT-07].

   What makes it fast [Wal08], [Yli17], in the order of what each gave: nodes of eight children, so that a ray visits a
   third of the nodes and tests their boxes at the price of one; leaves of eight triangles, stored as rows of lanes; nodes and
   leaves in one piece of memory, in the order of a walk, and fetched as soon as a ray is known to meet them; no branches on
   what cannot be foretold; and a walk that does not wait for numbers in double. Cost for n primitives: about 50 n bytes,
   O(n log n) to build. */

#if PTI_HAS_WIDE

#define PTI_U 5.9604644775390625e-8f
#define PTI_LEAST_SPAN 1.52587891e-5f
#define PTI_MOST_SPAN 1.09951163e12f

/* Nodes and leaves lie in an arena of lines of 64 bytes, as the cache has them. A reference is the number of a line times 8,
   plus what lies there; without that it is the offset in bytes over 8. */
enum { PTI_NODE = 0, PTI_TRIANGLES = 1, PTI_SPHERES = 2 };

/* Rows of lower, then of upper faces, x y z each. A lane without a child has lower > upper. */
typedef struct pti_node8 {
    float box[6][8];
    uint32_t child[8], unused[8];
} pti_node8;

/* Rows x y z of three corners, and primitives. A lane without a triangle has NaN: no comparison with it holds. */
typedef struct pti_triangle8 {
    float v[9][8];
    uint32_t id[8];
} pti_triangle8;

/* A lane without a sphere has one far away. */
typedef struct pti_sphere8 {
    float centre[3][8], radius[8];
    uint32_t id[8];
} pti_sphere8;

/* Memory from a multiple of 64 bytes on; if it is much, of 2 MiB, the size of a page of which few are enough. *memory is what
   is to be freed. */
static void *pti_alloc_lines(size_t bytes, void **memory, void *user)
{
    const size_t page = (size_t)1 << 21, step = bytes < 2 * page ? 64 : page;
    unsigned char *lines;
    *memory = bytes > SIZE_MAX - step ? NULL : pti_alloc(bytes + step, 1, user);
    if (!*memory) return NULL;
    lines = (unsigned char *)(((uintptr_t)*memory + step - 1) / step * step);
#ifdef MADV_HUGEPAGE
    if (step == page) madvise(lines, bytes / page * page, MADV_HUGEPAGE);
#endif
    return lines;
}

/* SMALL SCENES. Up to 64 primitives need no tree: every lane says where its primitive may begin, no later than the hit, and
   primitives are tested by [PT-06] in that order, until what is left begins behind the nearest hit. That is one test for most
   rays, and no branch that depends on the ray but the last.

   Memory is no matter here, so a lane keeps what saves time: the plane of its primitive and the weights of a point in it,
   as linear functions of the point. Two triangles in a row that make a parallelogram share a lane, as the sides of rooms and
   boxes mostly do. */
#define PTI_SMALL 64        /* lanes, of planes, then of spheres                                           */

/* The plane n.p + n3 = 0; weights u = U.p + U3, v = V.p + V3 and w = 1 - u - v of a point p in it, for a parallelogram
   w = 1 - max(u, v). */
typedef struct pti_plane8 {
    float n[4][8], u[4][8], v[4][8];
    float steep[8];         /* G: the 1-norms of U, V and the gradient of w are no larger                  */
    float both[8];          /* 1 for a parallelogram, else 0                                               */
} pti_plane8;

/* What to test: a primitive and, of a flat one, the corners of it or of a half. */
typedef struct pti_tested {
    pt_vec3 corner[3];
    int id, half;           /* 1, 2: of a parallelogram                                                    */
    uint32_t unused[5];
} pti_tested;

/* tested[PTI_SMALL + i]: the half of lane i where v > u. */
typedef struct pti_small {
    pti_plane8 planes[PTI_SMALL / 8];
    pti_sphere8 spheres[PTI_SMALL / 8];
    pti_lanes tag[PTI_SMALL / 4]; /* bits 0, 1, 2, ...: numbers of what is tested                           */
    pti_tested tested[2 * PTI_SMALL];
} pti_small;

/* Sphere `id` in lane i; 0 there: a lane without one. */
static void pti_write_sphere(const pt_scene *scene, pti_sphere8 *out, uint32_t i, uint32_t id, int there)
{
    const pt_sphere *s = &scene->spheres[scene->primitives[id].index];
    out->id[i] = id;
    out->centre[0][i] = there ? s->centre.x : 1e30f;
    out->centre[1][i] = s->centre.y;
    out->centre[2][i] = s->centre.z;
    out->radius[i] = s->radius;
}

/* Are triangles a and b halves of a parallelogram, up to the rounding of its corners? Then c are its corners, the diagonal
   from the first, and a is the half of its first edge. */
static int pti_is_parallelogram(const pt_vec3 *a, const pt_vec3 *b, double extent, pt_vec3 *c)
{
    int i, j;
    for (i = 0; i < 9; i++) {
        const pt_vec3 p = a[i % 3], e = a[(i + 1) % 3], q = a[(i + 2) % 3], f = b[(i / 3 + 2) % 3];
        const pti_d3 off = pti_d_sub(pti_d_between(p, e), pti_d_between(f, q));
        j = i / 3;
        if (memcmp(&p, &b[j], sizeof p) || memcmp(&q, &b[(j + 1) % 3], sizeof q)) continue;
        if (pti_max3(off.x, off.y, off.z) > 2 * (double)PTI_U * extent) continue;
        c[0] = p;
        c[1] = e;
        c[2] = q;
        c[3] = f;
        return 1;
    }
    return 0;
}

/* Lane i; 0 there: one without anything, where u = -10^30. The normal of a sliver is known to some 2^-51 |e1| |e2| only: where
   it is not much longer, and where numbers overflow, NaN leaves the answer to the test in double. */
static void pti_write_plane(pti_plane8 *out, uint32_t i, const pt_vec3 *c, int corners, int there)
{
    const pti_d3 o = pti_d_from(c[0]), e1 = pti_d_between(c[0], c[1]), e2 = pti_d_between(c[0], c[corners - 1]);
    const pti_d3 n = pti_d_cross(e1, e2), u = pti_d_cross(e2, n), v = pti_d_cross(n, e1);
    const double longest = pti_max3(n.x, n.y, n.z), square = pti_d_dot(n, n);
    const double known = longest > 1e-6 * pti_max3(e1.x, e1.y, e1.z) * pti_max3(e2.x, e2.y, e2.z) ? 1 : HUGE_VAL - HUGE_VAL;
    const double row[3][4] = {{n.x, n.y, n.z, -pti_d_dot(n, o)}, {u.x, u.y, u.z, -pti_d_dot(u, o)}, {v.x, v.y, v.z, -pti_d_dot(v, o)}};
    double steep[3] = {0, 0, 0};
    int k;
    for (k = 0; k < 4; k++) {
        out->n[k][i] = (float)(row[0][k] / longest * known);
        out->u[k][i] = there ? (float)(row[1][k] / square) : k < 3 ? 0 : -1e30f;
        out->v[k][i] = there ? (float)(row[2][k] / square) : 0;
        if (k == 3) continue;
        steep[0] += fabs(row[1][k] / square);
        steep[1] += fabs(row[2][k] / square);
        steep[2] += fabs((row[1][k] + row[2][k]) / square);
    }
    out->steep[i] = there ? (float)(pti_max3(steep[0], steep[1], steep[2]) * (1 + 4 * (double)PTI_U)) : 0;
    out->both[i] = corners == 4;
}

/* Lane `lane` from primitive i on; how many it takes. */
static uint32_t pti_write_flat(const pt_scene *scene, pti_small *out, uint32_t lane, uint32_t i, uint32_t flats)
{
    pti_tested *a = &out->tested[lane], *b = &out->tested[PTI_SMALL + lane];
    pti_plane8 *plane = &out->planes[lane / 8];
    const int there = i < flats;
    pt_vec3 c[4], d[4], all[4];
    int corners;
    a->id = b->id = (int)(there ? i : flats - 1);
    corners = pti_corners(scene, &scene->primitives[a->id], c);
    a->half = corners == 4 ? 1 : 0;
    b->half = 2 * a->half;
    memcpy(a->corner, c, sizeof a->corner);
    memcpy(b->corner, c, sizeof b->corner);
    if (b->half) memcpy(b->corner + 1, c + 2, 2 * sizeof *c);
    if (corners == 3 && i + 1 < flats && pti_corners(scene, &scene->primitives[i + 1], d) == 3 &&
        pti_is_parallelogram(c, d, (double)scene->wide.extent, all)) {
        b->id++;
        memcpy(b->corner, d, sizeof b->corner);
        pti_write_plane(plane, lane % 8, all, 4, 1);
        return 2;
    }
    pti_write_plane(plane, lane % 8, c, corners, there);
    return 1;
}

/* Planes of `flats` primitives, then spheres. 0 = no memory. */
static int pti_build_small(const pt_scene *scene, pt_wide *wide, uint32_t flats)
{
    const uint32_t count = scene->primitive_count;
    pti_small *out = (pti_small *)pti_alloc_lines(sizeof *out, &wide->memory, scene->alloc_user);
    uint32_t i, lane = 0;
    if (!out) return 0;
    wide->arena = (unsigned char *)out;
    wide->bytes = sizeof *out;
    for (i = 0; i < 2 * PTI_SMALL; i++) out->tag[i / 8].bits[i % 8] = i;
    for (i = 0; i < flats || lane % 8 > 0; lane++) i += pti_write_flat(scene, out, lane, i, flats);
    wide->plane_blocks = (int)(lane / 8);
    for (i = 0; flats + i < count || i % 8 > 0; i++, lane++) {
        const uint32_t id = flats + i < count ? flats + i : count - 1;
        out->tested[lane].id = out->tested[PTI_SMALL + lane].id = (int)id;
        pti_write_sphere(scene, &out->spheres[i / 8], i % 8, id, flats + i < count);
    }
    wide->sphere_blocks = (int)(i / 8);
    return 1;
}

/* BUILDING. First a binary tree as in [PT-07], by the surface area heuristic with bins; but eight triangles cost what one
   does, so a side costs its area times ceil(n / 8), and eight are a leaf, but for large ones: walls are better off apart, and
   are parted from the rest first. Then, of all ways in which nodes of up to eight children can be cut from that tree, the one
   whose nodes and leaves have the least area together: with c(n, k) the least cost of subtree n in at most k slots of a
   parent [Yli17],

       c(n, 1) = A(n) for a leaf,    A(n) + min_j c(left, j) + c(right, 8 - j)    for a node of its own,
       c(n, k) = min( c(n, k-1), min_j c(left, j) + c(right, k-j) ).

   Short lists are sorted rather than binned. Bins would as soon part sixteen boxes into ten and six as into eight and eight:
   three leaves instead of two, with a third of the lanes empty. A box is kept as {-lo, hi}: one max of lanes joins two. The tree is the same for any number of threads: one thread
   splits until pieces are small, and each piece is a task. */
#define PTI_WIDE_BINS 16
#define PTI_PIECES 256
#define PTI_WIDE_DEPTH 32   /* deeper down lists are halved, and end within 28 levels                      */
#define PTI_TOP 8           /* from this depth on no cut leaves less than four boxes on a side             */
#define PTI_CUT 0.1f        /* a leaf of more than a 30th of the surface of a cube around the scene is cut where that pays */
#define PTI_WALL 0.03f      /* flat primitives whose box has a 100th of the surface of a cube around the scene are walls, */
#define PTI_WALLS 32        /* unless there are more of them                                               */
#define PTI_LONG 65536      /* of lists this long or longer every fifth box is binned                      */
#define PTI_SHORT 24        /* lists of up to these are sorted, and cut anywhere: a multiple of 8, from 20 (pti_build_binary) to 32 */

/* Some boxes joined, and {-least, greatest} of twice their centres. */
typedef struct pti_joined {
    pti_lanes box, centres;
} pti_joined;

typedef struct pti_binary {
    float lo[3], hi[3];
    uint32_t first, count;  /* range of boxes                                                              */
    uint32_t child;         /* the first of two, side by side; 0 = leaf                                    */
    float cost[7];          /* c(n, 1) ... c(n, 7)                                                         */
} pti_binary;

typedef struct pti_piece {
    uint32_t node;
    int depth;
    pti_joined all;
} pti_piece;

/* A lane holds a triangle, one half of a parallelogram, or a sphere, in this order. */
typedef struct pti_wide_builder {
    const pt_scene *scene;
    pti_lanes *boxes;       /* bits[3]: the lane                                                           */
    pti_binary *nodes;
    unsigned char *arena;   /* NULL while bytes are counted                                                */
    size_t used;            /* bytes of it                                                                 */
    pti_counter next;       /* node                                                                        */
    float wall, cut;        /* half of the surface of a wall's box, and of a leaf that is cut              */
    uint32_t triangles, flats; /* lanes below these hold triangles, triangles and halves                   */
    uint32_t walls;         /* the first boxes are these lanes' of walls                                   */
    uint32_t top[8];        /* the children of the root                                                    */
    uint32_t piece_size;
    int piece_count, top_count;
    pti_piece pieces[PTI_PIECES];
} pti_wide_builder;

/* Half of the surface of a box; with coordinates below 2^39 and counts below 2^29 no sum of costs overflows. */
PTI_INLINE float pti_box_area(const float *v)
{
    const float x = v[4] + v[0], y = v[5] + v[1], z = v[6] + v[2];
    return x * y + y * z + z * x;
}

/* A box goes left if (twice its centre along `axis` - lo) scale < plane. axis -1: the first `middle` do. */
typedef struct pti_parting {
    int axis;
    float lo, scale, plane, cost;
    uint32_t middle;
} pti_parting;

typedef struct pti_wide_bins {
    pti_lanes box[PTI_SHORT];
    uint32_t count[PTI_SHORT];
} pti_wide_bins;

/* The best plane between `count` bins of an axis, if it is better than *best; `few` boxes at least on each side. */
static void pti_sweep_blocks(const pti_wide_bins *bins, int count, uint32_t few, pti_parting p, pti_parting *best)
{
    const pti_f8 none = pti_f8_set(-HUGE_VALF);
    float right[PTI_SHORT];
    pti_f8 joined = none;
    pti_lanes box;          /* joined once more, in memory, where single lanes are read                    */
    uint32_t n = 0;
    int i;
    for (i = count - 1; i > 0; i--) {
        box.f = joined = pti_f8_max(joined, bins->box[i].f);
        n += bins->count[i];
        right[i] = n >= few ? pti_box_area(box.v) * (float)((n + 7) / 8) : HUGE_VALF;
    }
    joined = none;
    for (n = 0, i = 1; i < count; i++) {
        box.f = joined = pti_f8_max(joined, bins->box[i - 1].f);
        n += bins->count[i - 1];
        if (n < few) continue;
        p.cost = pti_box_area(box.v) * (float)((n + 7) / 8) + right[i];
        p.plane = (float)i;
        if (p.cost < best->cost) *best = p;
    }
}

PTI_INLINE void pti_put_in_bin(pti_wide_bins *bins, float place, const pti_lanes *box)
{
    const int i = (int)place;
    bins->box[i].f = pti_f8_max(box->f, bins->box[i].f);
    bins->count[i]++;
}

/* Twice the centre of a box, from `from` on, scaled: lanes 4 to 6. */
PTI_INLINE pti_f8 pti_box_place(const pti_lanes *box, const pti_lanes *from, const pti_lanes *scale)
{
    return pti_f8_mul(pti_f8_sub(pti_f8_sub(box->f, pti_f8_swap(box->f)), from->f), scale->f);
}

/* Puts a box into its bin of each axis. */
PTI_INLINE void pti_put_in_bins(pti_wide_bins *bins, const pti_lanes *box, const pti_lanes *from, const pti_lanes *scale)
{
    pti_lanes place;
    place.f = pti_box_place(box, from, scale);
    pti_put_in_bin(&bins[0], place.v[4], box);
    pti_put_in_bin(&bins[1], place.v[5], box);
    pti_put_in_bin(&bins[2], place.v[6], box);
}

/* Every box, or every step-th. If two in a row fall into one bin, the second waits until the first is stored: so, unless there are
   few, every second one goes to a second set of bins, and the sets are joined in the end. */
static void pti_fill_bins(const pti_lanes *boxes, uint32_t n, uint32_t step, const pti_lanes *from, const pti_lanes *scale, pti_wide_bins *bins)
{
    pti_wide_bins more[3], *odd = n < 64 ? bins : more;
    uint32_t i;
    int k, j;
    for (k = 0; k < 3; k++)
        for (j = 0; j < PTI_WIDE_BINS; j++) {
            odd[k].box[j].f = bins[k].box[j].f = pti_f8_set(-HUGE_VALF);
            odd[k].count[j] = bins[k].count[j] = 0;
        }
    for (i = 0; i + step < n; i += 2 * step) {
        pti_put_in_bins(bins, &boxes[i], from, scale);
        pti_put_in_bins(odd, &boxes[i + step], from, scale);
    }
    if (i < n) pti_put_in_bins(bins, &boxes[i], from, scale);
    for (k = 0; k < 3 && odd == more; k++)
        for (j = 0; j < PTI_WIDE_BINS; j++) {
            bins[k].box[j].f = pti_f8_max(bins[k].box[j].f, odd[k].box[j].f);
            bins[k].count[j] += odd[k].count[j];
        }
}

typedef union pti_keys {
    pti_f8 f[PTI_SHORT / 8];
    float v[PTI_SHORT];
    uint32_t bits[PTI_SHORT];
} pti_keys;

/* Each box of a short list has a bin of its own, numbered by its rank: how many keys are less. A key is 1 + place, its last five
   bits replaced by the number of the box: so no two are equal, centres closer than 2^-18 of the extent stay in the order of the
   list, and no key is so small that a processor might take it for zero. */
static void pti_sort_bins(const pti_lanes *boxes, uint32_t n, const pti_lanes *from, const pti_lanes *scale, pti_wide_bins *bins)
{
    const pti_f8 one = pti_f8_set(1), zero = pti_f8_set(0);
    pti_keys key[3];
    pti_lanes rank;
    uint32_t i, j, k, eight;
    for (i = 0; i < (n + 7) / 8 * 8; i++) {
        pti_lanes place;
        place.f = pti_box_place(&boxes[i < n ? i : 0], from, scale);
        for (k = 0; k < 3; k++) {
            key[k].v[i] = 1 + place.v[4 + k];
            key[k].bits[i] = (key[k].bits[i] & ~(uint32_t)31) | i;
        }
    }
    for (k = 0; k < 3; k++)
        for (eight = 0; eight < n; eight += 8) {
            rank.f = zero;
            for (j = 0; j < n; j++)
                rank.f = pti_f8_add(rank.f, pti_f8_select(pti_f8_lt(pti_f8_set(key[k].v[j]), key[k].f[eight / 8]), one, zero));
            for (i = eight; i < n && i < eight + 8; i++) {
                bins[k].box[(int)rank.v[i - eight]] = boxes[i];
                bins[k].count[i] = 1;
            }
        }
}

/* The best plane of each axis along which centres differ. */
static void pti_sweep_axes(const pti_wide_bins *bins, int count, uint32_t few, const pti_parting *p, pti_parting *best)
{
    int k;
    for (k = 0; k < 3; k++)
        if (p[k].scale > 0) pti_sweep_blocks(&bins[k], count, few, p[k], best);
}

/* Improves on *best, which comes as a halving of infinite cost, if the centres differ. A short list is put in the order of the best
   axis, and *best says how many of the first go left. Of a very long one a sample tells where to part it, unless all of that
   falls into one bin. */
static void pti_find_parting(const pti_wide_builder *b, uint32_t begin, uint32_t end, const float *centres, uint32_t few, pti_parting *best)
{
    const uint32_t n = end - begin;
    const uint32_t step = n < PTI_LONG ? 1 : 5;
    const int sort = n <= PTI_SHORT, count = sort ? (int)n : PTI_WIDE_BINS;
    pti_wide_bins bins[3];
    pti_parting p[3];
    pti_lanes from, scale;  /* of lanes 4 to 6; the others take numbers that cost no time                  */
    int k;
    from.f = pti_f8_set(1);
    scale.f = pti_f8_set(0);
    for (k = 0; k < 3; k++) {
        const float extent = centres[4 + k] + centres[k];
        p[k] = *best;
        p[k].axis = k;
        p[k].lo = -centres[k];
        p[k].scale = extent > 1e-30f ? (sort ? 1 : (float)count) * (1 - 4 * PTI_U) / extent : 0; /* place < count */
        from.v[4 + k] = p[k].lo;
        scale.v[4 + k] = p[k].scale;
    }
    if (sort) pti_sort_bins(b->boxes + begin, n, &from, &scale, bins);
    else pti_fill_bins(b->boxes + begin, n, step, &from, &scale, bins);
    pti_sweep_axes(bins, count, few, p, best);
    if (step > 1 && best->axis < 0) {
        pti_fill_bins(b->boxes + begin, n, 1, &from, &scale, bins);
        pti_sweep_axes(bins, count, few, p, best);
    }
    if (!sort || best->axis < 0) return;
    memcpy(b->boxes + begin, bins[best->axis].box, n * sizeof *b->boxes);
    best->axis = -1;
    best->middle = (uint32_t)best->plane;
}

static void pti_join(const pti_lanes *boxes, uint32_t n, pti_joined *all)
{
    uint32_t i;
    all->box.f = all->centres.f = pti_f8_set(-HUGE_VALF);
    for (i = 0; i < n; i++) {
        const pti_f8 box = boxes[i].f;
        all->box.f = pti_f8_max(all->box.f, box);
        all->centres.f = pti_f8_max(all->centres.f, pti_f8_sub(box, pti_f8_swap(box)));
    }
}

/* Moves what goes left to the front, without branches, and joins both sides; returns the first of the right. */
static uint32_t pti_part(pti_wide_builder *b, uint32_t begin, uint32_t end, const pti_parting *p, pti_joined side[2])
{
    const pti_f8 none = pti_f8_set(-HUGE_VALF), plane = pti_f8_set(p->plane);
    const int k = p->axis;
    pti_f8 left_box = none, left_centres = none, right_box = none, right_centres = none;
    uint32_t i, left = begin;
    if (k < 0) {
        left += p->middle;
        pti_join(b->boxes + begin, p->middle, &side[0]);
        pti_join(b->boxes + left, end - left, &side[1]);
        return left;
    }
    for (i = begin; i < end; i++) {
        const pti_lanes box = b->boxes[i];
        const float from = box.v[4 + k] - box.v[k], along = from - p->lo, place = along * p->scale; /* each rounded, as lanes are */
        const pti_m8 goes_left = pti_f8_lt(pti_f8_set(place), plane);
        const pti_f8 centre = pti_f8_sub(box.f, pti_f8_swap(box.f));
        left_box = pti_f8_max(left_box, pti_f8_select(goes_left, box.f, none));
        right_box = pti_f8_max(right_box, pti_f8_select(goes_left, none, box.f));
        left_centres = pti_f8_max(left_centres, pti_f8_select(goes_left, centre, none));
        right_centres = pti_f8_max(right_centres, pti_f8_select(goes_left, none, centre));
        b->boxes[i] = b->boxes[left];
        b->boxes[left] = box;
        left += place < p->plane;
    }
    side[0].box.f = left_box;
    side[0].centres.f = left_centres;
    side[1].box.f = right_box;
    side[1].centres.f = right_centres;
    return left;
}

static float pti_node_area(const pti_binary *n)
{
    const float box[8] = {-n->lo[0], -n->lo[1], -n->lo[2], 0, n->hi[0], n->hi[1], n->hi[2], 0};
    return pti_box_area(box);
}

/* c(n, k) of a node whose children have theirs. */
static void pti_collapse(const pti_wide_builder *b, pti_binary *n)
{
    const float *l = b->nodes[n->child].cost, *r = b->nodes[n->child + 1].cost;
    float best[9];
    int k, j;
    for (k = 2; k <= 8; k++) {
        best[k] = HUGE_VALF;
        for (j = 1; j < k; j++)
            if (l[j - 1] + r[k - j - 1] < best[k]) best[k] = l[j - 1] + r[k - j - 1];
    }
    n->cost[0] = pti_node_area(n) + best[8];
    for (k = 2; k <= 7; k++) n->cost[k - 1] = best[k] < n->cost[k - 2] ? best[k] : n->cost[k - 2];
}

/* Node n, whose range is known, and all below it. pieces: what is small is left for later. First walls are parted from the
   rest, and then flat primitives from spheres.

   How many nodes? Depths 0 to 7 have 255 at most, depth 8 has 256. From there on n boxes make one leaf, or n / 4 at most: a plane
   leaves four or more on each side, and so does the halving of more than PTI_SHORT; fewer are halved only where all centres are
   one or the tree is too deep, thus to the end, into ceil(n / 8) leaves. L leaves are 2 L - 1 nodes: 256 + lanes / 2 in all. */
static void pti_build_binary(pti_wide_builder *b, uint32_t n, const pti_joined *all, int depth, int pieces)
{
    pti_binary *node = &b->nodes[n];
    const uint32_t begin = node->first, end = begin + node->count;
    const float area = pti_box_area(all->box.v);
    const uint32_t kinds = begin < b->walls ? b->walls : b->flats;
    const int mixed = depth < 2 && begin < kinds && kinds < end, leaf = node->count <= 8 && !mixed;
    pti_parting p = {-1, 0, 0, 0, HUGE_VALF, (node->count / 2 + 7) / 8 * 8};
    pti_joined side[2];
    uint32_t middle, k;
    for (k = 0; k < 3; k++) {
        node->lo[k] = -all->box.v[k];
        node->hi[k] = all->box.v[4 + k];
    }
    node->child = 0;
    for (k = 0; k < 7; k++) node->cost[k] = area;
    if (leaf && (depth >= PTI_TOP || area < b->cut)) return;
    if (pieces && n > 0 && !leaf && node->count <= b->piece_size && b->piece_count < PTI_PIECES) {
        const pti_piece piece = {n, depth, *all};
        b->pieces[b->piece_count++] = piece;
        return;
    }
    if (mixed) p.middle = kinds - begin;
    else if (depth < PTI_WIDE_DEPTH) pti_find_parting(b, begin, end, all->centres.v, depth < PTI_TOP ? 1 : 4, &p);
    if (leaf && !(p.cost < area)) return;
    middle = pti_part(b, begin, end, &p, side);
    node->child = (uint32_t)PTI_ADD(&b->next, 2);
    for (k = 0; k < 2; k++) {
        b->nodes[node->child + k].first = k ? middle : begin;
        b->nodes[node->child + k].count = k ? end - middle : middle - begin;
        pti_build_binary(b, node->child + k, &side[k], depth + 1, pieces);
    }
    pti_collapse(b, node);
}

static void pti_build_piece(void *context, int i)
{
    pti_wide_builder *b = (pti_wide_builder *)context;
    pti_build_binary(b, b->pieces[i].node, &b->pieces[i].all, b->pieces[i].depth, 0);
}

/* The nodes that become children of a node with `slots` of them, as the costs chose. */
static int pti_gather(const pti_binary *nodes, uint32_t n, int slots, uint32_t *children, int count)
{
    const float *cost = nodes[n].cost, *l, *r;
    int j, best = 1;
    while (slots > 1 && slots < 8 && !(cost[slots - 1] < cost[slots - 2])) slots--;
    if (slots == 1 || nodes[n].child == 0) {
        children[count] = n;
        return count + 1;
    }
    l = nodes[nodes[n].child].cost;
    r = nodes[nodes[n].child + 1].cost;
    for (j = 2; j < slots; j++)
        if (l[j - 1] + r[slots - j - 1] < l[best - 1] + r[slots - best - 1]) best = j;
    count = pti_gather(nodes, nodes[n].child, best, children, count);
    return pti_gather(nodes, nodes[n].child + 1, slots - best, children, count);
}

/* The primitive of which lane `lane` holds all or, if it is odd, the second half. */
static uint32_t pti_lane_primitive(const pti_wide_builder *b, uint32_t lane)
{
    const uint32_t halves = lane < b->triangles ? 0 : lane < b->flats ? lane + 1 - b->triangles : b->flats - b->triangles;
    return lane - halves / 2;
}

static void pti_write_triangles(const pti_wide_builder *b, const pti_binary *leaf, pti_triangle8 *out)
{
    const float nan = HUGE_VALF - HUGE_VALF;
    uint32_t i, k;
    for (i = 0; i < 8; i++) {
        pt_vec3 v[4] = {{nan, nan, nan}, {nan, nan, nan}, {nan, nan, nan}, {nan, nan, nan}};
        uint32_t half = 0;
        out->id[i] = 0;
        if (i < leaf->count) {
            const uint32_t lane = b->boxes[leaf->first + i].bits[3];
            half = lane < b->triangles ? 0 : (lane - b->triangles) & 1;
            out->id[i] = pti_lane_primitive(b, lane);
            pti_corners(b->scene, &b->scene->primitives[out->id[i]], v);
        }
        for (k = 0; k < 3; k++) {
            const pt_vec3 c = v[k > 0 ? k + half : 0];
            out->v[3 * k][i] = c.x;
            out->v[3 * k + 1][i] = c.y;
            out->v[3 * k + 2][i] = c.z;
        }
    }
}

static uint32_t pti_write_leaf(pti_wide_builder *b, const pti_binary *leaf)
{
    const uint32_t reference = (uint32_t)(b->used / 64) << 3;
    void *out = b->arena ? b->arena + b->used : NULL;
    uint32_t i;
    if (b->boxes[leaf->first].bits[3] < b->flats) {
        if (out) pti_write_triangles(b, leaf, (pti_triangle8 *)out);
        b->used += sizeof(pti_triangle8);
        return reference | PTI_TRIANGLES;
    }
    for (i = 0; out && i < 8; i++)
        pti_write_sphere(b->scene, (pti_sphere8 *)out, i,
                         pti_lane_primitive(b, b->boxes[leaf->first + (i < leaf->count ? i : 0)].bits[3]), i < leaf->count);
    b->used += (sizeof(pti_sphere8) + 63) / 64 * 64;
    return reference | PTI_SPHERES;
}

/* The children of node n, and their count. What has most area for each of its lanes comes last: shadow rays begin there, since
   it is likely to be hit and quick to ask. */
static int pti_children(const pti_binary *nodes, uint32_t n, uint32_t *children)
{
    const int count = pti_gather(nodes, n, 8, children, 0);
    float area[8];
    int i, j;
    for (i = 0; i < count; i++) {
        const uint32_t child = children[i];
        const float a = pti_node_area(&nodes[child]) / (float)nodes[child].count;
        for (j = i; j > 0 && area[j - 1] > a; j--) {
            area[j] = area[j - 1];
            children[j] = children[j - 1];
        }
        area[j] = a;
        children[j] = child;
    }
    return count;
}

/* Writes, or counts, subtree n: a node, its leaves, what is below it. Returns the reference. */
static uint32_t pti_write_tree(pti_wide_builder *b, uint32_t n)
{
    const uint32_t reference = (uint32_t)(b->used / 64) << 3;
    pti_node8 *out = b->arena ? (pti_node8 *)(void *)(b->arena + b->used) : NULL;
    uint32_t children[8], child;
    int count, i, k, inner;
    if (b->nodes[n].child == 0) return pti_write_leaf(b, &b->nodes[n]);
    b->used += sizeof *out;
    count = pti_children(b->nodes, n, children);
    if (n == 0) {
        memcpy(b->top, children, (size_t)count * sizeof *children);
        b->top_count = count;
    }
    for (i = 0; out && i < 8; i++) {
        out->child[i] = out->unused[i] = 0;
        for (k = 0; k < 3; k++) {
            out->box[k][i] = i < count ? b->nodes[children[i]].lo[k] : HUGE_VALF;
            out->box[3 + k][i] = i < count ? b->nodes[children[i]].hi[k] : -HUGE_VALF;
        }
    }
    for (inner = 0; inner < 2; inner++)
        for (i = 0; i < count; i++) {
            if ((b->nodes[children[i]].child != 0) != inner) continue;
            child = pti_write_tree(b, children[i]);
            if (out) out->child[i] = child;
        }
    return reference;
}

/* All boxes, those of walls first, and all of them joined. */
static pti_joined pti_fill_boxes(pti_wide_builder *b, pt_wide *wide, uint32_t lanes)
{
    pti_joined all;
    uint32_t i;
    b->walls = wide->wall_count = 0;
    for (i = 0; i < lanes; i++) {
        const uint32_t id = pti_lane_primitive(b, i);
        pti_lanes box;
        pt_vec3 lo, hi;
        pti_primitive_box(b->scene, &b->scene->primitives[id], &lo, &hi);
        box.v[0] = -lo.x; box.v[1] = -lo.y; box.v[2] = -lo.z; box.bits[3] = i;
        box.v[4] = hi.x; box.v[5] = hi.y; box.v[6] = hi.z; box.v[7] = 0;
        b->boxes[i] = box;
        if (i >= b->flats || !(pti_box_area(box.v) > b->wall)) continue;
        b->boxes[i] = b->boxes[b->walls];
        b->boxes[b->walls++] = box;
        if (wide->wall_count > 0 && wide->walls[wide->wall_count - 1] == id) continue; /* its second half */
        if (wide->wall_count == PTI_WALLS) {
            b->wall = HUGE_VALF;
            return pti_fill_boxes(b, wide, lanes);
        }
        wide->walls[wide->wall_count++] = id;
    }
    pti_join(b->boxes, lanes, &all);
    return all;
}

/* The binary tree. The costs of the nodes above the pieces come last, upwards. */
static void pti_build_nodes_of(pti_wide_builder *b, pt_wide *wide, uint32_t lanes)
{
    const pt_scene *scene = b->scene;
    const pt_vec3 size = pt_v3_sub(scene->hi, scene->lo);
    const float widest = (float)fmax(pti_max3((double)size.x, (double)size.y, (double)size.z), 1e-30);
    pti_joined all;
    pti_counter n;
    b->wall = PTI_WALL * widest * widest;
    b->cut = PTI_CUT * widest * widest;
    all = pti_fill_boxes(b, wide, lanes);
    b->piece_size = lanes / 64 > 4096 ? lanes / 64 : 4096;
    b->next = 1;
    b->nodes[0].first = 0;
    b->nodes[0].count = lanes;
    pti_build_binary(b, 0, &all, 0, 1);
    n = b->next;
    if (scene->parallel) scene->parallel(scene->parallel_user, b->piece_count, pti_build_piece, b);
    else pti_parallel(scene->threads > 0 ? scene->threads : pt_hardware_threads(), b->piece_count, pti_build_piece, b);
    while (n-- > 0)
        if (b->nodes[n].child) pti_collapse(b, &b->nodes[n]);
}

/* Writes, or counts, a second root without the children that hold walls; the first parting put nothing else there. If all are walls,
   or none, there is no need of it. */
static void pti_write_things(pti_wide_builder *b, pt_wide *wide)
{
    const pti_node8 *root = (const pti_node8 *)(const void *)b->arena; /* the first of the arena */
    pti_node8 *out = b->arena ? (pti_node8 *)(void *)(b->arena + b->used) : NULL;
    int i, k;
    wide->things = wide->root;
    if (b->walls == 0 || b->walls == b->nodes[0].count) {
        wide->wall_count = 0;
        return;
    }
    wide->things = (uint32_t)(b->used / 64) << 3;
    b->used += sizeof *out;
    if (!out) return;
    *out = *root;
    for (i = 0; i < b->top_count; i++) {
        if (b->nodes[b->top[i]].first >= b->walls) continue;
        out->child[i] = 0;
        for (k = 0; k < 3; k++) {
            out->box[k][i] = HUGE_VALF;
            out->box[3 + k][i] = -HUGE_VALF;
        }
    }
}

/* Over primitives of which `triangles` are triangles, then halves / 2 parallelograms, the rest spheres. 0 = no memory. */
static int pti_build_wide_tree(const pt_scene *scene, pt_wide *wide, uint32_t triangles, uint32_t halves)
{
    const uint32_t lanes = scene->primitive_count + halves / 2, nodes = lanes / 2 + 512;
    const size_t places = (size_t)lanes + 2 * (size_t)nodes; /* a node has the size of two boxes */
    void *user = scene->alloc_user, *memory = NULL;
    pti_wide_builder b;
    int ok;
    memset(&b, 0, sizeof b);
    b.nodes = places > SIZE_MAX / sizeof(pti_lanes) ? NULL : (pti_binary *)pti_alloc_lines(places * sizeof(pti_lanes), &memory, user);
    ok = b.nodes != NULL;
    if (ok) {
        b.scene = scene;
        b.triangles = wide->triangles = triangles;
        b.flats = triangles + halves;
        b.boxes = (pti_lanes *)(void *)(b.nodes + nodes);
        pti_build_nodes_of(&b, wide, lanes);
        pti_write_tree(&b, 0);
        pti_write_things(&b, wide);
        if (b.used / 64 < (size_t)1 << 29) b.arena = wide->arena = (unsigned char *)pti_alloc_lines(b.used, &wide->memory, user);
        ok = b.arena != NULL;
    }
    if (ok) {
        wide->bytes = b.used;
        b.used = 0;
        wide->root = pti_write_tree(&b, 0);
        pti_write_things(&b, wide);
    }
    pti_free(memory, user);
    return ok;
}

/* What pt_commit calls: 1, or 0 without memory, or -1 if there are more than 2^29 lanes, or numbers too small or large. */
static int pti_build_wide(const pt_scene *scene, pt_wide *wide)
{
    const double low = pti_max3((double)scene->lo.x, (double)scene->lo.y, (double)scene->lo.z);
    const double high = pti_max3((double)scene->hi.x, (double)scene->hi.y, (double)scene->hi.z);
    uint32_t count[3] = {0, 0, 0}, flats, i;
    memset(wide, 0, sizeof *wide);
    wide->extent = (float)fmax(low, high);
    for (i = 0; i < scene->primitive_count; i++) count[scene->primitives[i].shape]++;
    flats = count[PT_SHAPE_TRIANGLE] + count[PT_SHAPE_PARALLELOGRAM];
    if ((size_t)scene->primitive_count + count[PT_SHAPE_PARALLELOGRAM] > (size_t)1 << 29) return -1;
    if (!(wide->extent > PTI_LEAST_SPAN / 256 && wide->extent < PTI_MOST_SPAN / 2)) return -1;
    if ((flats + 7) / 8 + (count[PT_SHAPE_SPHERE] + 7) / 8 <= PTI_SMALL / 8) return pti_build_small(scene, wide, flats);
    return pti_build_wide_tree(scene, wide, count[PT_SHAPE_TRIANGLE], 2 * count[PT_SHAPE_PARALLELOGRAM]);
}

/* A RAY for lanes, with what bounds their errors. */
typedef struct pti_ray8 {
    float o[3], d[3];
    float span;             /* S                                                                           */
    float reach;            /* m: all |d| together                                                         */
    double unit;            /* t unit is the t of d above                                                  */
    /* for a tree: boxes, t = face * inverse + near (or far), and offsets of the rows of faces */
    float inverse[3], near[3], far[3];
    unsigned near_row[3], far_row[3];
    /* triangles: offsets of the rows of the axes x y z of [PT-06], shear, and errors: D and K below, and that of z */
    unsigned x, y, z;
    float sx, sy, across, edge, along;
} pti_ray8;

/* A direction far from length 1 is measured in its longest component, so that o/d does not overflow. Apart from what follows,
   so that nothing of it is done for other rays. */
static pt_vec3 pti_ray8_measure(const pti_ray *r)
{
    const double unit = fabs(r->d[r->kz]);
    return pt_v3((pt_real)(r->d[0] / unit), (pt_real)(r->d[1] / unit), (pt_real)(r->d[2] / unit));
}

/* 0: a ray that is not finite or from beyond 2^40: the linear search takes it. */
PTI_INLINE int pti_ray8_make(pti_ray8 *w, const pti_ray *r, float extent)
{
    int k;
    for (k = 0; k < 3; k++) {
        w->o[k] = (float)r->o[k];
        w->d[k] = (float)r->d[k];
    }
    w->unit = 1;
    w->reach = fabsf(w->d[0]) + fabsf(w->d[1]) + fabsf(w->d[2]);
    w->span = fabsf(w->o[0]) + fabsf(w->o[1]) + fabsf(w->o[2]) + extent + PTI_LEAST_SPAN;
    if (!(w->reach > 1e-6f && w->reach < 1e6f)) {
        const pt_vec3 d = pti_ray8_measure(r);
        w->unit = fabs(r->d[r->kz]);
        w->d[0] = d.x;
        w->d[1] = d.y;
        w->d[2] = d.z;
        w->reach = fabsf(d.x) + fabsf(d.y) + fabsf(d.z);
        if (!(w->reach < 4)) return 0; /* nor is NaN */
    }
    return w->span < PTI_MOST_SPAN && r->end == r->end;
}

/* One axis of boxes [Ize13]: with q = 1/d as rounded, face * q - o * q is off by at most 5 u (|t| + |o q|), and |t| up to the
   end of the scene is at most S |q|: with the error of o, 7 u S |q|. A direction so flat that q might overflow is taken as
   f = 2^-26 m, m the 1-norm of d: until the end of the scene, at t <= 3 S / m, the ray moves by at most f t either way, so that
   faces are put off by at most 2 t <= 2 u S |q|. */
PTI_INLINE void pti_ray8_axis(pti_ray8 *w, unsigned k)
{
    const float flat = w->reach * 1.49011612e-8f;
    const float q = 1 / (fabsf(w->d[k]) < flat ? flat : w->d[k]), from = -w->o[k] * q, off = 12 * PTI_U * w->span * fabsf(q);
    w->inverse[k] = q;
    w->near[k] = from - off;
    w->far[k] = from + off;
    w->near_row[k] = 32 * (q < 0 ? k + 3 : k);
    w->far_row[k] = 32 * (q < 0 ? k : k + 3);
}

PTI_INLINE void pti_ray8_for_tree(pti_ray8 *w, const pti_ray *r)
{
    float skew;
    pti_ray8_axis(w, 0);
    pti_ray8_axis(w, 1);
    pti_ray8_axis(w, 2);
    w->x = 32 * (unsigned)r->kx;
    w->y = 32 * (unsigned)r->ky;
    w->z = 32 * (unsigned)r->kz;
    w->sx = (float)r->sx;
    w->sy = (float)r->sy;
    skew = fabsf(w->sx) > fabsf(w->sy) ? fabsf(w->sx) : fabsf(w->sy);
    w->across = (3.1f + 7.1f * skew) * PTI_U * w->span;
    w->edge = (16.1f + 32.1f * skew) * PTI_U * w->span;
    w->along = 12 * PTI_U * w->span;
}

/* A limit of t in units of w->d, rounded up, finite; and a time that is certainly before it. */
#define PTI_SOON 1e-30f     /* starts are told in this range                                               */
#define PTI_NEVER 3.4028e38f
PTI_INLINE float pti_ray8_limit(const pti_ray8 *w, double t)
{
    const float limit = (float)(t * w->unit) * (1 + 4 * PTI_U) + 2 * PTI_SOON;
    return limit < 3.4e38f ? limit : 3.4e38f;
}
PTI_INLINE float pti_ray8_before(float limit) { return limit * (1 - 16 * PTI_U) - 4 * PTI_SOON; }

PTI_INLINE pti_f8 pti_row(const void *p, unsigned offset)
{
    return pti_f8_load((const float *)(const void *)((const char *)p + offset));
}

/* The children whose boxes the ray may meet by the limit, and where they begin. */
PTI_INLINE8 unsigned pti_node_lanes(const pti_node8 *n, const pti_ray8 *w, float limit, pti_lanes *begin)
{
    const pti_f8 qx = pti_f8_set(w->inverse[0]), qy = pti_f8_set(w->inverse[1]), qz = pti_f8_set(w->inverse[2]);
    const pti_f8 near_x = pti_f8_madd(pti_row(n->box, w->near_row[0]), qx, pti_f8_set(w->near[0]));
    const pti_f8 near_y = pti_f8_madd(pti_row(n->box, w->near_row[1]), qy, pti_f8_set(w->near[1]));
    const pti_f8 near_z = pti_f8_madd(pti_row(n->box, w->near_row[2]), qz, pti_f8_set(w->near[2]));
    const pti_f8 far_x = pti_f8_madd(pti_row(n->box, w->far_row[0]), qx, pti_f8_set(w->far[0]));
    const pti_f8 far_y = pti_f8_madd(pti_row(n->box, w->far_row[1]), qy, pti_f8_set(w->far[1]));
    const pti_f8 far_z = pti_f8_madd(pti_row(n->box, w->far_row[2]), qz, pti_f8_set(w->far[2]));
    const pti_f8 end = pti_f8_min(pti_f8_min(far_x, far_y), pti_f8_min(far_z, pti_f8_set(limit)));
    begin->f = pti_f8_max(pti_f8_max(near_x, near_y), pti_f8_max(near_z, pti_f8_set(0)));
    return pti_m8_bits(pti_f8_le(begin->f, end));
}

PTI_INLINE pti_f8 pti_edge8(pti_f8 a, pti_f8 b, pti_f8 c, pti_f8 d) { return pti_f8_nmadd(c, d, pti_f8_mul(a, b)); }

PTI_INLINE pti_f8 pti_largest8(pti_f8 a, pti_f8 b, pti_f8 c)
{
    return pti_f8_max(pti_f8_abs(a), pti_f8_max(pti_f8_abs(b), pti_f8_abs(c)));
}

/* Eight triangles against a ray: z of the corners a, b, c, relative to the origin; the edge functions, their least and greatest,
   and the bound of their errors. */
typedef struct pti_edges8 {
    pti_f8 az, bz, cz, u, v, w, low, high, error;
} pti_edges8;

/* As in [PT-06]: corners relative to the origin, sheared; U = c x b, V = a x c, W = b x a.

   With s the larger |shear|, a sheared x = c.x - s z is off by at most u (4 s |z| + 2 |x|) for two differences, the shear and a
   product, each rounded once, and by (1 + s) u |o| for the rounding of the origin: by D = (3 + 7 s) u S in all, as |z| <= S and
   |x| <= (1 + s) S. With M = X + D, X the largest |x| and |y|, factors of edge functions are at most M, so these are off by
   4 M (D + u M) <= E = K (X + D), K = (16 + 32 s) u S. */
PTI_INLINE8 void pti_edge_lanes(const pti_triangle8 *p, const pti_ray *r, const pti_ray8 *w, pti_edges8 *e)
{
    const pti_f8 ox = pti_f8_set(w->o[r->kx]), oy = pti_f8_set(w->o[r->ky]), oz = pti_f8_set(w->o[r->kz]);
    const pti_f8 sx = pti_f8_set(w->sx), sy = pti_f8_set(w->sy);
    const pti_f8 az = pti_f8_sub(pti_row(p->v[0], w->z), oz), bz = pti_f8_sub(pti_row(p->v[3], w->z), oz);
    const pti_f8 cz = pti_f8_sub(pti_row(p->v[6], w->z), oz), ax = pti_f8_nmadd(sx, az, pti_f8_sub(pti_row(p->v[0], w->x), ox));
    const pti_f8 bx = pti_f8_nmadd(sx, bz, pti_f8_sub(pti_row(p->v[3], w->x), ox));
    const pti_f8 cx = pti_f8_nmadd(sx, cz, pti_f8_sub(pti_row(p->v[6], w->x), ox));
    const pti_f8 ay = pti_f8_nmadd(sy, az, pti_f8_sub(pti_row(p->v[0], w->y), oy));
    const pti_f8 by = pti_f8_nmadd(sy, bz, pti_f8_sub(pti_row(p->v[3], w->y), oy));
    const pti_f8 cy = pti_f8_nmadd(sy, cz, pti_f8_sub(pti_row(p->v[6], w->y), oy));
    const pti_f8 wide = pti_f8_max(pti_largest8(ax, bx, cx), pti_largest8(ay, by, cy));
    const pti_f8 eu = pti_edge8(cx, by, cy, bx), ev = pti_edge8(ax, cy, ay, cx), ew = pti_edge8(bx, ay, by, ax);
    e->az = az;
    e->bz = bz;
    e->cz = cz;
    e->u = eu;
    e->v = ev;
    e->w = ew;
    e->low = pti_f8_min(eu, pti_f8_min(ev, ew));
    e->high = pti_f8_max(eu, pti_f8_max(ev, ew));
    e->error = pti_f8_madd(wide, pti_f8_set(w->edge), pti_f8_set(w->edge * w->across));
}

/* Depth times determinant: t |d.z| |det| and, in *off, what it is off by; *det: |det|. With N = U a.z + V b.z + W c.z and the
   z of a hit, N - z det is sum dU (a.z - z) + sum U da.z and roundings. Depths are at most e apart, and U, V, W have one sign
   but for E: so it is off by 3 E e + (|det| + 6 E) 7 u S, and by 4 u |det| S more for the roundings of d, t and the limit. */
PTI_INLINE8 pti_f8 pti_depth_lanes(const pti_edges8 *e, const pti_ray *r, const pti_ray8 *w, pti_f8 *det, pti_f8 *off)
{
    const pti_f8 sum = pti_f8_mul(pti_f8_add(e->u, pti_f8_add(e->v, e->w)), pti_f8_set(w->d[r->kz] < 0 ? -1.0f : 1.0f));
    const pti_f8 depth = pti_f8_madd(e->u, e->az, pti_f8_madd(e->v, e->bz, pti_f8_mul(e->w, e->cz)));
    const pti_f8 last = pti_f8_max(e->az, pti_f8_max(e->bz, e->cz)), first = pti_f8_min(e->az, pti_f8_min(e->bz, e->cz));
    const pti_f8 weigh = pti_f8_madd(pti_f8_sub(last, first), pti_f8_set(3.1f), pti_f8_set(4 * w->along));
    *det = pti_f8_abs(sum);
    *off = pti_f8_madd(e->error, weigh, pti_f8_mul(*det, pti_f8_set(w->along)));
    return pti_f8_flip(depth, sum);
}

/* Where eight triangles are hit: at t with t |d.z| det = depth, up to off. */
typedef struct pti_depths8 {
    pti_lanes depth, det, off;
} pti_depths8;

/* Which of eight triangles may be hit by the limit? *sure: which of these certainly are; both bounds are at least 100 times what
   pti_depth_error allows for. If there are none, *sure and *at are left alone. */
PTI_INLINE unsigned pti_triangle_lanes(const pti_triangle8 *p, const pti_ray *r, const pti_ray8 *w, float limit, unsigned *sure, pti_depths8 *at)
{
    const pti_f8 zero = pti_f8_set(0);
    pti_edges8 e;
    unsigned lanes;
    pti_edge_lanes(p, r, w, &e);
    lanes = pti_m8_bits(pti_f8_le(zero, pti_f8_max(pti_f8_add(e.low, e.error), pti_f8_sub(e.error, e.high))));
    if (lanes) {
        const float flat = fabsf(w->d[r->kz]), end = limit * flat < 2 * w->span ? limit * flat : 2 * w->span;
        pti_f8 det, off;
        const pti_f8 depth = pti_depth_lanes(&e, r, w, &det, &off);
        const pti_f8 before = pti_f8_sub(pti_f8_madd(det, pti_f8_set(end), off), depth);
        const pti_f8 last = pti_f8_mul(det, pti_f8_set(pti_ray8_before(limit) * flat)); /* det 0: may be NaN, not sure */
        const pti_f8 clear = pti_f8_sub(pti_f8_min(depth, pti_f8_sub(last, depth)), pti_f8_add(off, off));
        const pti_f8 inside = pti_f8_sub(pti_f8_max(e.low, pti_f8_sub(zero, e.high)), e.error);
        lanes &= pti_m8_bits(pti_f8_le(zero, pti_f8_min(before, pti_f8_add(depth, off))));
        *sure = pti_m8_bits(pti_f8_lt(zero, pti_f8_min(inside, clear)));
        at->depth.f = depth;
        at->det.f = det;
        at->off.f = off;
    }
    return lanes;
}

/* Where do eight spheres begin? PTI_NEVER for those that cannot be hit; no later than the hit for the others.

   The foot of the perpendicular from the centre is l = f + b d with f = o - c and b = -f.d / d.d. f is off by 2 u S a
   coordinate and b |d| by 31 u S, along the ray; so |l| is off by at most 47 u S, and with the radius r + 64 u S the question
   and the half chord are on one safe side, with r - 64 u S on the other; 48 u S more cover b. Where the longest half chord ends
   before the origin, all of the sphere is behind; where even the shortest begins before it, the origin is inside, and what is
   hit is the end: in a room of huge spheres that puts the walls in their order. */
PTI_INLINE8 pti_f8 pti_sphere_lanes(const pti_sphere8 *p, const pti_ray8 *w)
{
    const pti_f8 dx = pti_f8_set(w->d[0]), dy = pti_f8_set(w->d[1]), dz = pti_f8_set(w->d[2]), zero = pti_f8_set(0);
    const pti_f8 fx = pti_f8_sub(pti_f8_set(w->o[0]), pti_f8_load(p->centre[0]));
    const pti_f8 fy = pti_f8_sub(pti_f8_set(w->o[1]), pti_f8_load(p->centre[1]));
    const pti_f8 fz = pti_f8_sub(pti_f8_set(w->o[2]), pti_f8_load(p->centre[2]));
    const float square = w->d[0] * w->d[0] + w->d[1] * w->d[1] + w->d[2] * w->d[2], u = PTI_U * w->span, per = 1 / sqrtf(square);
    const pti_f8 b = pti_f8_mul(pti_f8_madd(fx, dx, pti_f8_madd(fy, dy, pti_f8_mul(fz, dz))), pti_f8_set(-1 / square));
    const pti_f8 lx = pti_f8_madd(b, dx, fx), ly = pti_f8_madd(b, dy, fy), lz = pti_f8_madd(b, dz, fz);
    const pti_f8 r = pti_f8_load(p->radius), most = pti_f8_add(r, pti_f8_set(64 * u)), l2 = pti_f8_madd(lx, lx, pti_f8_madd(ly, ly, pti_f8_mul(lz, lz)));
    const pti_f8 left = pti_f8_sub(pti_f8_mul(most, most), l2), longest = pti_f8_add(pti_f8_sqrt(pti_f8_max(left, zero)), pti_f8_set(48 * u));
    const pti_f8 half = pti_f8_mul(longest, pti_f8_set((1 + 8 * PTI_U) * per));
    const pti_f8 seen = pti_f8_select(pti_f8_lt(left, zero), left, pti_f8_add(b, half)); /* < 0: missed, or behind */
    pti_f8 start = pti_f8_sub(b, half);
    if (pti_m8_bits(pti_f8_lt(start, zero)) & pti_m8_bits(pti_f8_le(zero, seen))) { /* perhaps inside */
        const pti_f8 least = pti_f8_max(pti_f8_sub(r, pti_f8_set(64 * u)), zero), sure = pti_f8_sub(pti_f8_mul(least, least), l2);
        const pti_f8 shortest = pti_f8_sub(pti_f8_sqrt(pti_f8_max(sure, zero)), pti_f8_set(48 * u));
        const pti_f8 inner = pti_f8_mul(shortest, pti_f8_set((1 - 8 * PTI_U) * per));
        start = pti_f8_select(pti_f8_lt(b, inner), pti_f8_add(b, inner), start);
    }
    return pti_f8_select(pti_f8_lt(seen, zero), pti_f8_set(PTI_NEVER), pti_f8_max(start, pti_f8_set(PTI_SOON)));
}

/* A child that waits: its reference, and above it the bits of where its box begins, in the order of floats >= 0. */
typedef uint64_t pti_waiting;
#define PTI_WAITING (7 * 60 + 8) /* every level leaves at most seven */

PTI_INLINE const unsigned char *pti_place(const pt_wide *tree, uint32_t reference)
{
    return tree->arena + ((size_t)(reference & ~7u) << 3);
}

PTI_INLINE void pti_fetch_line(const void *p)
{
#if defined(__GNUC__)
    __builtin_prefetch(p);
#else
    (void)p;
#endif
}
PTI_INLINE void pti_fetch(const unsigned char *p)
{
    pti_fetch_line(p);
    pti_fetch_line(p + 64);
    pti_fetch_line(p + 128);
    pti_fetch_line(p + 192);
    pti_fetch_line(p + 256);
}

PTI_INLINE pti_waiting pti_child(const pt_wide *tree, const pti_node8 *n, int i, const pti_lanes *begin)
{
    pti_fetch(tree->arena + ((size_t)n->child[i] << 3));
    return (uint64_t)begin->bits[i] << 32 | n->child[i];
}

/* The nearest of the children in `lanes`, two or more; the others wait, the nearest of them on top. any: the last of them is
   taken, the others wait as they are. */
PTI_INLINE uint32_t pti_choose(const pt_wide *tree, const pti_node8 *n, unsigned lanes, const pti_lanes *begin, pti_waiting *stack,
                               int *top, int any)
{
    pti_waiting near = pti_child(tree, n, pti_lowest_bit(lanes), begin);
    const int bottom = *top;
    for (lanes &= lanes - 1; lanes; lanes &= lanes - 1) {
        const pti_waiting child = pti_child(tree, n, pti_lowest_bit(lanes), begin), far = any || child < near ? near : child;
        int k = (*top)++;
        near = any || child < near ? child : near;
        for (; !any && k > bottom && stack[k - 1] < far; k--) stack[k] = stack[k - 1];
        stack[k] = far;
    }
    return (uint32_t)near;
}

/* A corner in lane i, of which v is x, as pti_shear takes it. */
PTI_INLINE pti_d3 pti_shear_lane(const pti_ray *r, const float *v)
{
    return pti_shear_axes(r, v[8 * r->kx], v[8 * r->ky], v[8 * r->kz]);
}

/* pti_edge where the products differ. */
PTI_INLINE double pti_sure_edge(double a, double b, double c, double d)
{
    double p = a * b, q = c * d;
    PTI_FENCE(p);
    PTI_FENCE(q);
    return p - q;
}

/* Keeps what is hit for certain, if it is nearer than the best: the numbers of pti_sheared_triangle without its questions.
   half: 1 or 2 for the halves of a parallelogram, with its u and v; 0 for a triangle. */
PTI_INLINE int pti_keep_sure(pti_d3 a, pti_d3 b, pti_d3 c, int half, int id, pti_best *best)
{
    const double u = pti_sure_edge(c.x, b.y, c.y, b.x), v = pti_sure_edge(a.x, c.y, a.y, c.x), w = pti_sure_edge(b.x, a.y, b.y, a.x);
    const double det = u + v + w;
    double p = u * a.z, q = v * b.z, depth = w * c.z, b1, b2;
    PTI_FENCE(p);
    PTI_FENCE(q);
    PTI_FENCE(depth);
    depth = (depth + (p + q)) / det;
    if (!(depth < pti_before(best, id))) return 0;
    b1 = v / det;
    b2 = w / det;
    return pti_keep(best, id, depth, half == 1 ? b1 + b2 : b1, half == 2 ? b1 + b2 : b2);
}

/* Tests a lane as pti_test does; the corners of a triangle are at hand. */
PTI_INLINE int pti_test_lane(const pt_scene *scene, const pti_ray *r, const pti_triangle8 *p, int i, pti_best *best)
{
    const int id = (int)p->id[i];
    pti_d3 a, b, c;
    double t, u, v;
    if (id >= (int)scene->wide.triangles) return pti_test(scene, r, id, best);
    a = pti_shear_lane(r, &p->v[0][i]);
    b = pti_shear_lane(r, &p->v[3][i]);
    c = pti_shear_lane(r, &p->v[6][i]);
    return pti_sheared_triangle(r, a, b, c, pti_before(best, id), &t, &u, &v) && pti_keep(best, id, t, u, v);
}

/* A triangle that is hit for certain, whose numbers wait until it is known that nothing nearer is hit: not before `from`. */
typedef struct pti_later {
    const pti_triangle8 *leaf; /* NULL: none                                                               */
    int lane;
    float from;
} pti_later;

PTI_INLINE void pti_keep_later(const pti_ray *r, const pti_later *h, pti_best *best)
{
    const pti_triangle8 *p = h->leaf;
    const int i = h->lane;
    pti_keep_sure(pti_shear_lane(r, &p->v[0][i]), pti_shear_lane(r, &p->v[3][i]), pti_shear_lane(r, &p->v[6][i]), 0, (int)p->id[i], best);
}

/* Lane i is hit for certain, at a t between `from` and `to`: the second `off` is more than what is rounded here, 5 u of what is
   below 2 S. Behind the limit it is dropped: then something nearer is known. If it is nearer for certain than the one that
   waits, that one is dropped; else that one is computed now, and this one waits. */
PTI_INLINE void pti_put_off(const pt_scene *scene, const pti_triangle8 *p, int i, const pti_depths8 *at, const pti_ray *r, const pti_ray8 *w,
                            float *limit, pti_later *h, pti_best *best)
{
    const float inverse = 1 / (at->det.v[i] * fabsf(w->d[r->kz])), depth = at->depth.v[i], off = 2 * at->off.v[i];
    const float from = (depth - off) * inverse, to = (depth + off) * inverse;
    if (from > *limit) return;
    if (h->leaf && !(to < h->from)) pti_keep_later(r, h, best);
    h->leaf = p;
    h->lane = i;
    h->from = from;
    pti_fetch_line(&scene->primitives[p->id[i]]); /* for pti_fill; where no triangle was without area, its index is this number */
    pti_fetch_line(&scene->triangles[p->id[i]]);
    if (to < *limit) *limit = to;
}

/* Tests what a leaf holds: is anything found? any: the first that is found will do. Else *limit is lowered to the nearest. */
PTI_INLINE int pti_test_leaf(const pt_scene *scene, uint32_t leaf, const pti_ray *r, const pti_ray8 *w, float *limit, pti_later *h, pti_best *best,
                             int any)
{
    const void *p = pti_place(&scene->wide, leaf);
    const pti_triangle8 *triangles = (const pti_triangle8 *)p;
    const int flat = (leaf & 7) == PTI_TRIANGLES;
    pti_depths8 at;
    unsigned sure = 0, lanes = flat ? pti_triangle_lanes(triangles, r, w, *limit, &sure, &at)
                                    : pti_m8_bits(pti_f8_le(pti_sphere_lanes((const pti_sphere8 *)p, w), pti_f8_set(*limit)));
    int found = 0;
    if (any && sure) return 1;
    for (; lanes; lanes &= lanes - 1) {
        const int i = pti_lowest_bit(lanes);
        if ((sure >> i & 1) && triangles->id[i] < scene->wide.triangles) {
            pti_put_off(scene, triangles, i, &at, r, w, limit, h, best);
            found = 1;
        } else if (flat ? pti_test_lane(scene, r, triangles, i, best) : pti_test(scene, r, (int)((const pti_sphere8 *)p)->id[i], best)) {
            const float end = pti_ray8_limit(w, best->t);
            if (any) return 1;
            *limit = end < *limit ? end : *limit;
            found = 1;
        }
    }
    return found;
}

/* Walks the tree from a reference on, near children first; any = 1: the last children first, until something is hit. */
PTI_INLINE int pti_traverse_wide(const pt_scene *scene, const pti_ray *r, const pti_ray8 *w, uint32_t at, pti_best *best, int any)
{
    const pt_wide *tree = &scene->wide;
    pti_waiting stack[PTI_WAITING];
    pti_later later = {NULL, 0, 0};
    uint32_t limit_bits;
    float limit = pti_ray8_limit(w, best->t);
    int top = 0, found = 0;
    memcpy(&limit_bits, &limit, sizeof limit_bits);
    for (;;) {
        if ((at & 7) == PTI_NODE) {
            const pti_node8 *n = (const pti_node8 *)(const void *)(tree->arena + ((size_t)at << 3)); /* PTI_NODE is 0 */
            pti_lanes begin;
            const unsigned lanes = pti_node_lanes(n, w, limit, &begin);
            if (lanes & (lanes - 1)) {
                at = pti_choose(tree, n, lanes, &begin, stack, &top, any);
                continue;
            }
            if (lanes) {
                at = n->child[pti_lowest_bit(lanes)];
                pti_fetch(tree->arena + ((size_t)at << 3));
                continue;
            }
        } else if (pti_test_leaf(scene, at, r, w, &limit, &later, best, any)) {
            if (any) return 1;
            found = 1;
            memcpy(&limit_bits, &limit, sizeof limit_bits);
        }
        do {
            if (top == 0) {
                if (later.leaf) pti_keep_later(r, &later, best);
                return found;
            }
            top--;
        } while (!any && stack[top] >> 32 > limit_bits);
        at = (uint32_t)stack[top];
    }
}

/* rows[0] x + rows[1] y + rows[2] z + w */
PTI_INLINE pti_f8 pti_dot8(const float rows[4][8], pti_f8 x, pti_f8 y, pti_f8 z, pti_f8 w)
{
    return pti_f8_madd(pti_f8_load(rows[0]), x, pti_f8_madd(pti_f8_load(rows[1]), y, pti_f8_madd(pti_f8_load(rows[2]), z, w)));
}

/* What eight planes say: t and how far it may be off (X); the least weight, v - u, and a bound of the error of u, v and w. */
typedef struct pti_planes8 {
    pti_f8 t, off, inside, more, error;
} pti_planes8;

/* n.o + n3 is off by 36 u S (9 of these for the rounded corners of a parallelogram), n.d by 14 u m, so t by X = 96 u S / |n.d|.
   As |n.d| <= m, m X is at least 96 u S: so u, v and w are off by at most 3 G m X. Nothing is said of a lane where n is
   not known or where numbers overflow: NaN is not < 0. */
PTI_INLINE8 void pti_plane_lanes(const pti_plane8 *p, const pti_ray8 *w, pti_planes8 *h)
{
    const pti_f8 ox = pti_f8_set(w->o[0]), oy = pti_f8_set(w->o[1]), oz = pti_f8_set(w->o[2]), zero = pti_f8_set(0);
    const pti_f8 dx = pti_f8_set(w->d[0]), dy = pti_f8_set(w->d[1]), dz = pti_f8_set(w->d[2]), one = pti_f8_set(1);
    const pti_f8 inverse = pti_f8_div(pti_f8_set(-1), pti_dot8(p->n, dx, dy, dz, zero));
    const pti_f8 t = pti_f8_mul(pti_dot8(p->n, ox, oy, oz, pti_f8_load(p->n[3])), inverse);
    const pti_f8 u = pti_f8_madd(t, pti_dot8(p->u, dx, dy, dz, zero), pti_dot8(p->u, ox, oy, oz, pti_f8_load(p->u[3])));
    const pti_f8 v = pti_f8_madd(t, pti_dot8(p->v, dx, dy, dz, zero), pti_dot8(p->v, ox, oy, oz, pti_f8_load(p->v[3])));
    const pti_f8 less = pti_f8_min(u, v), rest = pti_f8_madd(pti_f8_load(p->both), less, pti_f8_sub(pti_f8_sub(one, u), v));
    const pti_f8 off = pti_f8_mul(pti_f8_abs(inverse), pti_f8_set(96 * PTI_U * w->span));
    h->t = t;
    h->off = off;
    h->inside = pti_f8_min(less, rest);
    h->more = pti_f8_sub(v, u);
    h->error = pti_f8_mul(off, pti_f8_mul(pti_f8_load(p->steep), pti_f8_set(3 * w->reach)));
}

/* Where they begin, as spheres do. */
PTI_INLINE pti_f8 pti_plane_starts(const pti_planes8 *h)
{
    const pti_f8 seen = pti_f8_min(pti_f8_add(h->inside, h->error), pti_f8_add(h->t, h->off));
    return pti_f8_select(pti_f8_lt(seen, pti_f8_set(0)), pti_f8_set(PTI_NEVER), pti_f8_max(pti_f8_sub(h->t, h->off), pti_f8_set(PTI_SOON)));
}

/* Which may be hit by the limit? *margin > 0: is hit for certain. A hit is at t <= 3 S / m, and 2 G S >= 1, for no edge is
   longer than 2 S along an axis: so what t must be clear of, with clear = 2 S / m times the error of weights, is at least
   288 u S / m and 3 X, which is more than the limit was rounded by. */
PTI_INLINE unsigned pti_planes_within(const pti_planes8 *h, float limit, float clear, pti_f8 *margin)
{
    const pti_f8 within = pti_f8_min(h->t, pti_f8_sub(pti_f8_set(limit), h->t));
    const pti_f8 seen = pti_f8_min(pti_f8_add(h->inside, h->error), pti_f8_add(within, h->off));
    *margin = pti_f8_min(pti_f8_nmadd(h->error, pti_f8_set(clear), within), pti_f8_nmadd(h->error, pti_f8_set(2), h->inside));
    return 255 ^ pti_m8_bits(pti_f8_lt(seen, pti_f8_set(0)));
}

/* x >= 0 with its lowest seven bits replaced by those of a tag. */
PTI_INLINE float pti_tagged(float x, float tag)
{
    uint32_t a, b;
    memcpy(&a, &x, sizeof a);
    memcpy(&b, &tag, sizeof b);
    a = (a & ~(uint32_t)127) | b;
    memcpy(&x, &a, sizeof x);
    return x;
}
PTI_F8(pti_f8, pti_f8_tag, _mm256_or_ps(_mm256_and_ps(x, _mm256_castsi256_ps(_mm256_set1_epi32(~127))), y),
       _mm_or_ps(_mm_and_ps(x, _mm_castsi128_ps(_mm_set1_epi32(~127))), y), pti_tagged(x, y))

/* The latest start of what is hit by a limit: 127 units of the last place are at most 2^-16 of it. */
PTI_INLINE float pti_last_start(float limit) { return limit + limit * (256 * PTI_U); }

/* Where the lanes begin, block by block, and what planes say. The lowest seven bits of a start are the number of what is to be
   tested: so no two are equal, and the least of them says who it is. */
typedef struct pti_starts {
    pti_lanes t[PTI_SMALL / 8], inside[PTI_SMALL / 8], more[PTI_SMALL / 8], error[PTI_SMALL / 8];
    float clear, end;       /* S / m; where no hit is known                                                */
    int planes, count;
} pti_starts;

/* The first start behind `last`; what is beyond the limit is not looked for. */
PTI_INLINE float pti_next_start(const pti_starts *s, float last, float limit)
{
    const pti_f8 none = pti_f8_set(HUGE_VALF), from = pti_f8_set(last);
    pti_f8 least = none;
    int i;
    for (i = 0; i < s->count; i++) least = pti_f8_min(least, pti_f8_select(pti_f8_lt(from, s->t[i].f), s->t[i].f, none));
    return pti_m8_bits(pti_f8_le(least, pti_f8_set(limit))) ? pti_f8_least(least) : HUGE_VALF;
}

/* Tests all of a lane. */
static int pti_test_both(const pt_scene *scene, const pti_ray *r, const pti_tested *e, pti_best *best)
{
    const int hit = pti_test(scene, r, e->id, best);
    return e[PTI_SMALL].id == e->id ? hit : hit | pti_test(scene, r, e[PTI_SMALL].id, best);
}

/* Tests what is known to be the only half of a lane that can be hit; sure: and certainly is. */
PTI_INLINE int pti_test_half(const pti_ray *r, const pti_tested *e, int sure, pti_best *best)
{
    const pti_d3 a = pti_shear(r, &e->corner[0]), b = pti_shear(r, &e->corner[1]), c = pti_shear(r, &e->corner[2]);
    double t, u, v;
    if (sure) return pti_keep_sure(a, b, c, e->half, e->id, best);
    return pti_sheared_triangle(r, a, b, c, pti_before(best, e->id), &t, &u, &v) &&
           pti_keep(best, e->id, t, e->half == 1 ? u + v : u, e->half == 2 ? u + v : v);
}

/* Tests what a start tells of: one half of a lane, if that is certain, as pti_planes_within has it, else all of it. Where it is
   certain that it is hit, t is at most start + 2 X, apart from the tag, so that *limit, of starts, does not have to wait for
   numbers in double: 2 X < clear < start. */
PTI_INLINE int pti_test_start(const pt_scene *scene, const pti_ray *r, const pti_ray8 *w, const pti_starts *s, float start, float *limit, pti_best *best)
{
    const pti_tested *e = ((const pti_small *)(const void *)scene->wide.arena)->tested;
    uint32_t at, block, i;
    memcpy(&at, &start, sizeof at);
    at %= 2 * PTI_SMALL;
    block = at % PTI_SMALL / 8;
    i = at % 8;
    if ((int)block < s->planes && fabsf(s->more[block].v[i]) > 2 * s->error[block].v[i]) {
        const float error = 2 * s->error[block].v[i], clear = error * s->clear;
        if (s->inside[block].v[i] > error && start > clear && 2 * start < s->end) {
            const float last = pti_last_start(pti_last_start(start) + clear);
            *limit = last < *limit ? last : *limit;
            return pti_test_half(r, e + at, 1, best);
        }
        if (!pti_test_half(r, e + at, 0, best)) return 0;
    } else if (!pti_test_both(scene, r, e + at % PTI_SMALL, best)) {
        return 0;
    }
    *limit = pti_last_start(pti_ray8_limit(w, best->t));
    return 1;
}

/* The nearest, in the order of starts. */
PTI_INLINE int pti_nearest_small(const pt_scene *scene, const pti_ray *r, const pti_ray8 *w, pti_best *best)
{
    const pti_small *small = (const pti_small *)(const void *)scene->wide.arena;
    const pti_f8 zero = pti_f8_set(0);
    pti_f8 least = pti_f8_set(HUGE_VALF);
    pti_planes8 h;
    pti_starts s;
    float start, limit;
    int found = 0, i;
    s.clear = w->span / w->reach;
    s.end = pti_ray8_limit(w, best->t);
    limit = pti_last_start(s.end);
    s.planes = scene->wide.plane_blocks;
    s.count = s.planes + scene->wide.sphere_blocks;
    for (i = 0; i < s.planes; i++) {
        pti_plane_lanes(&small->planes[i], w, &h);
        s.t[i].f = pti_f8_tag(pti_plane_starts(&h), pti_f8_select(pti_f8_lt(zero, h.more), small->tag[PTI_SMALL / 8 + i].f, small->tag[i].f));
        s.inside[i].f = h.inside;
        s.more[i].f = h.more;
        s.error[i].f = h.error;
        least = pti_f8_min(least, s.t[i].f);
    }
    for (; i < s.count; i++) {
        s.t[i].f = pti_f8_tag(pti_sphere_lanes(&small->spheres[i - s.planes], w), small->tag[i].f);
        least = pti_f8_min(least, s.t[i].f);
    }
    for (start = pti_f8_least(least); start <= limit; start = pti_next_start(&s, start, limit))
        found |= pti_test_start(scene, r, w, &s, start, &limit, best);
    return found;
}

/* Any, in no order. */
PTI_INLINE int pti_any_small(const pt_scene *scene, const pti_ray *r, const pti_ray8 *w, pti_best *best)
{
    const pti_small *small = (const pti_small *)(const void *)scene->wide.arena;
    const int planes = scene->wide.plane_blocks, count = planes + scene->wide.sphere_blocks;
    const float end = pti_ray8_limit(w, best->t), clear = 2 * w->span / w->reach;
    pti_f8 sure = pti_f8_set(0), margin;
    pti_planes8 h;
    uint64_t may = 0;
    int i;
    for (i = 0; i < planes; i++) {
        pti_plane_lanes(&small->planes[i], w, &h);
        may |= (uint64_t)pti_planes_within(&h, end, clear, &margin) << 8 * i;
        sure = pti_f8_max(margin, sure);
    }
    if (pti_m8_bits(pti_f8_lt(pti_f8_set(0), sure))) return 1;
    for (; i < count; i++) may |= (uint64_t)pti_m8_bits(pti_f8_le(pti_sphere_lanes(&small->spheres[i - planes], w), pti_f8_set(end))) << 8 * i;
    for (i = 0; i < PTI_SMALL && may >> i; i++)
        if ((may >> i & 1) && pti_test_both(scene, r, &small->tested[i], best)) return 1;
    return 0;
}

/* What is not a wall, up to best->t: the nearest or any; -1: not a ray for lanes. */
static int pti_nearest_thing(const pt_scene *scene, const pti_ray *r, pti_best *best)
{
    pti_ray8 w;
    if (!pti_ray8_make(&w, r, scene->wide.extent)) return -1;
    pti_ray8_for_tree(&w, r);
    return pti_traverse_wide(scene, r, &w, scene->wide.things, best, 0);
}
static int pti_any_thing(const pt_scene *scene, const pti_ray *r, pti_best *best)
{
    pti_ray8 w;
    if (!pti_ray8_make(&w, r, scene->wide.extent)) return -1;
    pti_ray8_for_tree(&w, r);
    return pti_traverse_wide(scene, r, &w, scene->wide.things, best, 1);
}

/* What pti_search calls: the nearest hit or any; -1: not a ray for lanes. */
PTI_INLINE int pti_search_wide(const pt_scene *scene, const pti_ray *r, pti_best *best, int any)
{
    pti_ray8 w;
    if (!pti_ray8_make(&w, r, scene->wide.extent)) return -1;
    if (scene->wide.plane_blocks + scene->wide.sphere_blocks > 0) return any ? pti_any_small(scene, r, &w, best) : pti_nearest_small(scene, r, &w, best);
    pti_ray8_for_tree(&w, r);
    return pti_traverse_wide(scene, r, &w, scene->wide.root, best, any);
}

#endif /* PTI_HAS_WIDE */

/* =====================================================================================================
   [PT-08] MATERIALS: implementation
   =====================================================================================================
   The BSDF f(wo, wi) is the radiance scattered into wo per irradiance from wi. Three functions belong
   together: eval gives f, sample draws wi with a density close to f |cos|, pdf gives that density. They must
   agree: E[f |cos| / pdf] over sample's directions is the albedo, which a test checks for each material.
   Delta lobes (mirror, glass) have no finite f: their sample carries the weight f |cos| / pdf, in which the
   delta cancels, and eval and pdf are zero, because no other technique finds that direction.

   On which side a direction lies is decided by the geometric normal, cosines are of the shading normal. A
   direction on the right side of one and the wrong side of the other scatters nothing, in eval and sample
   alike. */

static pt_material pti_material_of_kind(pt_material_kind kind, pt_rgb albedo)
{
    pt_material m;
    memset(&m, 0, sizeof m);
    m.kind = kind;
    m.albedo = albedo;
    return m;
}

PTDEF pt_material pt_material_diffuse(pt_rgb albedo)
{
    return pti_material_of_kind(PT_MATERIAL_DIFFUSE, albedo);
}

PTDEF pt_material pt_material_emitter(pt_rgb radiance)
{
    pt_material m = pt_material_diffuse(pt_rgb_grey(0));
    m.emission = radiance;
    return m;
}

PTDEF pt_material pt_material_mirror(pt_rgb reflectance)
{
    return pti_material_of_kind(PT_MATERIAL_MIRROR, reflectance);
}

PTDEF pt_material pt_material_dielectric(pt_real ior)
{
    pt_material m = pti_material_of_kind(PT_MATERIAL_DIELECTRIC, pt_rgb_grey(0));
    m.ior = ior;
    return m;
}

#if PTI_HAS_MICROFACET
PTDEF pt_material pt_material_rough_dielectric(pt_real ior, pt_real roughness)
{
    pt_material m = pt_material_dielectric(ior);
    m.roughness = roughness;
    return m;
}

PTDEF pt_material pt_material_conductor(pt_rgb eta, pt_rgb k, pt_real roughness)
{
    pt_material m = pti_material_of_kind(PT_MATERIAL_CONDUCTOR, pt_rgb_grey(1));
    m.eta = eta;
    m.k = k;
    m.roughness = roughness;
    return m;
}

PTDEF pt_material pt_material_oren_nayar(pt_rgb albedo, pt_real sigma)
{
    pt_material m = pti_material_of_kind(PT_MATERIAL_OREN_NAYAR, albedo);
    m.roughness = sigma;
    return m;
}
#endif

#if PTI_HAS_PHONG
PTDEF pt_material pt_material_phong(pt_rgb albedo, pt_rgb specular, pt_real exponent)
{
    pt_material m = pti_material_of_kind(PT_MATERIAL_PHONG, albedo);
    m.specular = specular;
    m.exponent = exponent;
    return m;
}

PTDEF pt_material pt_material_blinn(pt_rgb albedo, pt_rgb specular, pt_real exponent)
{
    pt_material m = pt_material_phong(albedo, specular, exponent);
    m.kind = PT_MATERIAL_BLINN;
    return m;
}
#endif

#if PTI_HAS_COAT
PTDEF pt_material pt_material_coat(pt_rgb albedo, pt_real ior)
{
    pt_material m = pti_material_of_kind(PT_MATERIAL_COAT, albedo);
    m.ior = ior;
    return m;
}
#endif

#if PTI_HAS_MEASURED
PTDEF pt_material pt_material_measured(const pt_measured *table)
{
    pt_material m = pti_material_of_kind(PT_MATERIAL_MEASURED, pt_rgb_grey(1));
    m.measured = table;
    return m;
}
#endif

/* --- Fresnel --- */

PTDEF pt_fresnel pt_fresnel_make(double cos_i, double eta)
{
    /* Fresnel's r_s = (c - eta t)/(c + eta t) and r_p = (eta c - t)/(eta c + t) with the numerators multiplied
       out by Snell's law eta^2 (1 - t^2) = 1 - c^2, so that nothing cancels for eta near 1:
           r_s = -(eta-1)(eta+1) / (c + eta t)^2
           r_p =  (eta-1)(eta+1) ((c eta)^2 - (1-c)(1+c)) / (eta (eta c + t))^2
       t^2 = 1 - (1 - c^2)/eta^2, in the form that keeps digits near c = 0 and near c = 1. */
    double e = eta, c = fmin(1, fabs(cos_i)), d = (e - 1) * (e + 1), t2, t, rs, rp;
    pt_fresnel f = {1, 1, 1, 0};
    t2 = c * c < 0.5 ? (d + c * c) / (e * e) : 1 - (1 - c) * (1 + c) / (e * e);
    if (!(t2 > 0)) return f;
    t = sqrt(t2);
    f.cos_t = t;
    f.rs = f.rp = f.r = 0;
    if (d == 0) return f;
    rs = -d / ((c + e * t) * (c + e * t));
    rp = d * ((c * e) * (c * e) - (1 - c) * (1 + c)) / (e * e * (e * c + t) * (e * c + t));
    f.rs = fmin(1, rs * rs);
    f.rp = fmin(1, rp * rp);
    f.r = 0.5 * (f.rs + f.rp);
    return f;
}

PTDEF double pt_fresnel_dielectric(double cos_i, double eta, double *cos_t)
{
    pt_fresnel f = pt_fresnel_make(cos_i, eta);
    *cos_t = f.cos_t;
    return f.r;
}

PTDEF double pt_fresnel_schlick(double cos_i, double eta)
{
    double r0 = (eta - 1) / (eta + 1), c = fmin(1, fabs(cos_i)), x;
    r0 *= r0;
    if (eta < 1) {
        c = 1 - (1 - c) * (1 + c) / (eta * eta);
        if (!(c > 0)) return 1;
        c = sqrt(c);
    }
    x = (1 - c) * (1 - c);
    return r0 + (1 - r0) * x * x * (1 - c);
}

PTDEF double pt_fresnel_diffuse(double eta)
{
    /* 2 int R(c) c dc in closed form [Wal26]; from the dense side by 1 - R = (1 - R')/eta^2, the reciprocity of
       diffuse transmission. The terms cancel to the order of (eta-1)^2 near 1: below 1.0001 the first order
       (eta-1)/3 is nearer, off by less than 4e-8. */
    double n = eta, n2 = n * n, n4 = n2 * n2, a = n2 + 1, b = n4 - 1;
    if (eta < 1) return 1 - (1 - pt_fresnel_diffuse(1 / eta)) * eta * eta;
    if (eta < 1.0001) return (eta - 1) / 3;
    return 0.5 + (n - 1) * (3 * n + 1) / (6 * (n + 1) * (n + 1)) +
           n2 * (n2 - 1) * (n2 - 1) / (a * a * a) * log((n - 1) / (n + 1)) - 2 * n * n2 * (n2 + 2 * n - 1) / (a * b) +
           8 * n4 * (n4 + 1) / (a * b * b) * log(n);
}

#if PTI_HAS_MICROFACET
PTDEF double pt_fresnel_conductor(double cos_i, double eta, double k)
{
    /* With a^2 + b^2 and a of the refracted wave, [PBR] 9.3.6 in real numbers. a^2 = (ab + t)/2 is written as
       (eta k)^2 * 2 / (ab - t) where t < 0, so that it does not cancel. */
    double c = fmin(1, fabs(cos_i)), c2 = c * c, s2 = (1 - c) * (1 + c), t = eta * eta - k * k - s2, m = 2 * eta * k, ab, a, rs, rp;
    ab = sqrt(t * t + m * m);
    if (ab == 0) return 1; /* at the critical angle of a k of 0 */
    a = sqrt(t >= 0 ? 0.5 * (ab + t) : 0.5 * m * m / (ab - t));
    rs = (ab + c2 - 2 * a * c) / (ab + c2 + 2 * a * c);
    rp = rs * (ab * c2 + s2 * s2 - 2 * a * c * s2) / (ab * c2 + s2 * s2 + 2 * a * c * s2);
    return fmin(1, fmax(0, 0.5 * (rs + rp)));
}

/* --- GGX [Wal07]: D = alpha^2 / (pi (alpha^2 cos^2 + sin^2)^2), with sin^2 from x and y, which keeps its digits
   at the peak. Lambda = (sqrt(1 + alpha^2 tan^2) - 1) / 2, without the difference. Masking and shadowing of two
   directions is the height-correlated 1 / (1 + Lambda + Lambda) [Hei14], for reflection and refraction. --- */

static double pti_ggx_d(pti_d3 h, double a)
{
    double k = a * h.z * h.z + (h.x * h.x + h.y * h.y) / a;
    return 1 / (PT_PI * k * k);
}

static double pti_ggx_lambda(pti_d3 w, double a)
{
    double t = a * sqrt(w.x * w.x + w.y * w.y) / fabs(w.z);
    return t < 1e8 ? 0.5 * t * t / (1 + sqrt(1 + t * t)) : 0.5 * (t - 1); /* beyond 2^26 the same to rounding, and no overflow */
}

/* Density of the visible normals D G1 (o . h) / cos [Hei18] 3, o above. */
static double pti_ggx_visible(pti_d3 o, pti_d3 h, double a)
{
    return pti_ggx_d(h, a) * fmax(0, pti_d_dot(o, h)) / (o.z * (1 + pti_ggx_lambda(o, a)));
}

/* A visible normal: stretched by alpha the facets are a hemisphere, whose visible part, seen along o, reflects
   into a spherical cap; a uniform point of the cap gives the normal half way to it [Dup23]. */
static pti_d3 pti_ggx_visible_draw(pti_d3 o, double a, double u0, double u1)
{
    pti_d3 s = pti_d_normalize(pti_d(a * o.x, a * o.y, o.z)), h;
    double phi = 2 * PT_PI * u0, z = (1 - u1) * (1 + s.z) - s.z, r = sqrt(fmax(0, (1 - z) * (1 + z)));
    h = pti_d(s.x + r * cos(phi), s.y + r * sin(phi), s.z + z);
    return pti_d_normalize(pti_d(a * h.x, a * h.y, h.z));
}

PTDEF double pt_ggx_d(pt_vec3 h, double alpha)
{
    return h.z > 0 ? pti_ggx_d(pti_d_from(h), alpha) : 0;
}

PTDEF double pt_ggx_g1(pt_vec3 w, double alpha)
{
    return w.z > 0 ? 1 / (1 + pti_ggx_lambda(pti_d_from(w), alpha)) : 0;
}

PTDEF double pt_ggx_visible_pdf_w(pt_vec3 wo, pt_vec3 h, double alpha)
{
    return wo.z > 0 && h.z > 0 ? pti_ggx_visible(pti_d_from(wo), pti_d_from(h), alpha) : 0;
}

PTDEF pt_vec3 pt_ggx_visible_sample(pt_vec3 wo, double alpha, pt_vec2 u)
{
    return pti_d_to(pti_ggx_visible_draw(pti_d_from(wo), alpha, (double)u.x, (double)u.y));
}
#endif

#if PTI_HAS_TEXTURES
/* --- textures --- */

static pt_rgb pti_texel(const pt_texture *t, double x, double y)
{
    const float *c;
    int column = (int)(x - t->width * floor(x / t->width)), row = (int)(y - t->height * floor(y / t->height));
    if (column >= t->width) column = 0; /* rounding of a tiny negative x */
    if (row >= t->height) row = 0;
    c = t->rgb + 3 * ((size_t)row * (size_t)t->width + (size_t)column);
    return pt_rgb3((pt_real)c[0], (pt_real)c[1], (pt_real)c[2]);
}

static pt_rgb pti_rgb_mix(pt_rgb a, pt_rgb b, double t)
{
    return pt_rgb3((pt_real)((1 - t) * (double)a.r + t * (double)b.r), (pt_real)((1 - t) * (double)a.g + t * (double)b.g),
                   (pt_real)((1 - t) * (double)a.b + t * (double)b.b));
}

PTDEF pt_rgb pt_texture_eval(const pt_texture *t, pt_vec2 uv, pt_vec3 p)
{
    double u = (double)uv.x * (t->scale.x != 0 ? (double)t->scale.x : 1), v = (double)uv.y * (t->scale.y != 0 ? (double)t->scale.y : 1);
    double x, y, fx, fy;
    if (t->kind == PT_TEXTURE_FUNCTION) return t->function(t->user, uv, p);
    if (t->kind == PT_TEXTURE_CHECKER) return fmod(floor(u) + floor(v), 2) == 0 ? t->a : t->b;
    x = u * t->width - 0.5; /* the value of a pixel is that of its centre */
    y = (1 - v) * t->height - 0.5;
    fx = x - floor(x);
    fy = y - floor(y);
    x = floor(x);
    y = floor(y);
    return pti_rgb_mix(pti_rgb_mix(pti_texel(t, x, y), pti_texel(t, x + 1, y), fx),
                       pti_rgb_mix(pti_texel(t, x, y + 1), pti_texel(t, x + 1, y + 1), fx), fy);
}

/* Texture coordinates of a hit: those of its shape; a sphere has longitude (from -z over +x) and latitude. */
static pt_vec2 pti_hit_uv(const pt_hit *hit)
{
    pti_d3 n = pti_d_from(hit->ng);
    if (hit->shape != PT_SHAPE_SPHERE) return hit->uv;
    return pt_v2((pt_real)(0.5 + atan2(n.x, -n.z) / (2 * PT_PI)), (pt_real)(1 - acos(fmax(-1, fmin(1, n.y))) / PT_PI));
}
#endif

#if PTI_HAS_MEASURED
/* --- measured tables [Mat03], half vector and difference angles [Rus98] --- */

#define PTI_MERL_H 90
#define PTI_MERL_D 90
#define PTI_MERL_PHI 180

/* f = raw * scale. */
static const double pti_merl_scale[3] = {1.0 / 1500, 1.15 / 1500, 1.66 / 1500};

static int pti_clamp_int(double x, int most)
{
    return x > 0 ? (x < most ? (int)x : most) : 0;
}

/* The cell of two directions above the surface. */
static int pti_merl_index(pti_d3 o, pti_d3 i)
{
    pti_d3 h = pti_d_normalize(pti_d_add(o, i)), d;
    double s = sqrt(h.x * h.x + h.y * h.y), c = s > 0 ? h.x / s : 1, n = s > 0 ? h.y / s : 0, x, phi;
    x = c * i.x + n * i.y;             /* wi turned by -phi_h about z, */
    d = pti_d(h.z * x - s * i.z, c * i.y - n * i.x, s * x + h.z * i.z); /* then by -theta_h about y */
    phi = atan2(d.y, d.x);
    if (phi < 0) phi += PT_PI; /* reciprocity: phi_d and phi_d + pi are the same */
    return pti_clamp_int(phi / PT_PI * PTI_MERL_PHI, PTI_MERL_PHI - 1) +
           PTI_MERL_PHI * (pti_clamp_int(atan2(sqrt(d.x * d.x + d.y * d.y), d.z) * (2 / PT_PI) * PTI_MERL_D, PTI_MERL_D - 1) +
                           PTI_MERL_D * pti_clamp_int(sqrt(atan2(s, h.z) * (2 / PT_PI)) * PTI_MERL_H, PTI_MERL_H - 1));
}

/* theta_h at the lower end of ring i. */
static double pti_merl_theta_h(double i)
{
    return i * i / (PTI_MERL_H * PTI_MERL_H) * (PT_PI / 2);
}

PTDEF int pt_measured_index(pt_vec3 wo, pt_vec3 wi)
{
    return pti_merl_index(pti_d_from(wo), pti_d_from(wi));
}

static int pti_merl_directions(int index, pti_d3 *o, pti_d3 *i)
{
    double th = pti_merl_theta_h(index / (PTI_MERL_PHI * PTI_MERL_D) + 0.5);
    double td = (index / PTI_MERL_PHI % PTI_MERL_D + 0.5) * (PT_PI / 2) / PTI_MERL_D, phi = (index % PTI_MERL_PHI + 0.5) * PT_PI / PTI_MERL_PHI;
    pti_d3 d = pti_d(sin(td) * cos(phi), sin(td) * sin(phi), cos(td)), h = pti_d(sin(th), 0, cos(th));
    *i = pti_d(h.z * d.x + h.x * d.z, d.y, h.z * d.z - h.x * d.x);
    *o = pti_d_sub(pti_d_scale(h, 2 * cos(td)), *i);
    return i->z > 0 && o->z > 0;
}

PTDEF int pt_measured_directions(int index, pt_vec3 *wo, pt_vec3 *wi)
{
    pti_d3 o, i;
    int above = pti_merl_directions(index, &o, &i);
    *wo = pti_d_to(o);
    *wi = pti_d_to(i);
    return above;
}

static pt_rgb pti_merl_value(const pt_measured *m, int index)
{
    const double *v = m->value + index;
    return pt_rgb3((pt_real)(fmax(0, v[0]) * pti_merl_scale[0]), (pt_real)(fmax(0, v[PT_MEASURED_CELLS]) * pti_merl_scale[1]),
                   (pt_real)(fmax(0, v[2 * PT_MEASURED_CELLS]) * pti_merl_scale[2]));
}

PTDEF pt_rgb pt_measured_eval(const pt_measured *m, pt_vec3 wo, pt_vec3 wi)
{
    return wo.z > 0 && wi.z > 0 ? pti_merl_value(m, pt_measured_index(wo, wi)) : pt_rgb_grey(0);
}

/* Solid angle of a ring of theta_h: 2 pi (cos a - cos b), without the difference. */
static double pti_merl_ring(int i)
{
    double a = pti_merl_theta_h(i), b = pti_merl_theta_h(i + 1);
    return 4 * PT_PI * sin(0.5 * (a + b)) * sin(0.5 * (b - a));
}

/* The distribution of theta_h from which directions are drawn: each ring by its mean value. */
static void pti_merl_finish(pt_measured *m)
{
    const int ring = PTI_MERL_D * PTI_MERL_PHI;
    int i, k;
    m->cdf[0] = 0;
    for (i = 0; i < PTI_MERL_H; i++) {
        double sum = 0;
        for (k = i * ring; k < (i + 1) * ring; k++) {
            pt_rgb c = pti_merl_value(m, k);
            sum += (double)c.r + (double)c.g + (double)c.b;
        }
        m->cdf[i + 1] = m->cdf[i] + sum * pti_merl_ring(i);
    }
    for (i = 0; i <= PTI_MERL_H; i++) m->cdf[i] = m->cdf[PTI_MERL_H] > 0 ? m->cdf[i] / m->cdf[PTI_MERL_H] : (double)i / PTI_MERL_H;
    m->cdf[PTI_MERL_H] = 1;
}

static pt_result pti_merl_make(pt_measured *m)
{
    pt_measured_free(m);
    m->value = (double *)pti_alloc(3 * (size_t)PT_MEASURED_CELLS, sizeof *m->value, m->alloc_user);
    return m->value ? PT_OK : PT_ERROR_MEMORY;
}

static void pti_merl_set(pt_measured *m, int index, int measured, double r, double g, double b)
{
    m->value[index] = measured ? r / pti_merl_scale[0] : -1;
    m->value[index + PT_MEASURED_CELLS] = measured ? g / pti_merl_scale[1] : -1;
    m->value[index + 2 * PT_MEASURED_CELLS] = measured ? b / pti_merl_scale[2] : -1;
}

PTDEF pt_result pt_measured_fill(pt_measured *m, pt_brdf_fn f, void *user)
{
    pt_result result = pti_merl_make(m);
    int i;
    if (result != PT_OK) return result;
    for (i = 0; i < PT_MEASURED_CELLS; i++) {
        pt_vec3 wo, wi;
        int above = pt_measured_directions(i, &wo, &wi);
        pt_rgb c = above ? f(user, wo, wi) : pt_rgb_grey(0);
        if (!pti_rgb_finite(c) || !(c.r >= 0 && c.g >= 0 && c.b >= 0)) {
            pt_measured_free(m);
            return PT_ERROR_ARGUMENT;
        }
        pti_merl_set(m, i, above, (double)c.r, (double)c.g, (double)c.b);
    }
    pti_merl_finish(m);
    return PT_OK;
}

/* Index of a cell's block among blocks of b^3 cells. */
static size_t pti_merl_block(int index, int b)
{
    size_t h = (size_t)(index / (PTI_MERL_PHI * PTI_MERL_D) / b), d = (size_t)(index / PTI_MERL_PHI % PTI_MERL_D / b);
    return (size_t)(index % PTI_MERL_PHI / b) + (size_t)(PTI_MERL_PHI / b) * (d + (size_t)(PTI_MERL_D / b) * h);
}

PTDEF pt_result pt_measured_scatter(pt_measured *m, pt_scatter_fn scatter, void *user, uint64_t samples, int block,
                                    uint64_t seed)
{
    pt_pcg32 random = pt_pcg32_make(seed, 0);
    double *sums;
    uint64_t s;
    int i;
    if (block < 1 || PTI_MERL_H % block != 0) return PT_ERROR_ARGUMENT;
    sums = (double *)pti_alloc(4 * (size_t)(PT_MEASURED_CELLS / (block * block * block)), sizeof *sums, m->alloc_user);
    if (!sums || pti_merl_make(m) != PT_OK) {
        pti_free(sums, m->alloc_user);
        return PT_ERROR_MEMORY;
    }
    memset(sums, 0, 4 * (size_t)(PT_MEASURED_CELLS / (block * block * block)) * sizeof *sums);
    for (s = 0; s < samples; s++) {
        pt_vec3 wo, wi;
        pt_rgb w;
        wo = pt_warp_cosine(pti_pcg32_pair(&random));
        wi = pt_warp_cosine(pti_pcg32_pair(&random));
        sums[4 * pti_merl_block(pt_measured_index(wo, wi), block) + 3] += 1; /* what the standard does */
        if (scatter(user, wo, &random, &wi, &w) && wi.z > 0) {
            double *sum = sums + 4 * pti_merl_block(pt_measured_index(wo, wi), block);
            sum[0] += (double)w.r;
            sum[1] += (double)w.g;
            sum[2] += (double)w.b;
        }
    }
    for (i = 0; i < PT_MEASURED_CELLS; i++) {
        const double *sum = sums + 4 * pti_merl_block(i, block), n = PT_PI * sum[3];
        pti_merl_set(m, i, n > 0, sum[0] / n, sum[1] / n, sum[2] / n);
    }
    pti_free(sums, m->alloc_user);
    pti_merl_finish(m);
    return PT_OK;
}

PTDEF void pt_measured_free(pt_measured *m)
{
    pti_free(m->value, m->alloc_user);
    m->value = NULL;
}
#endif

/* --- the BSDF of a hit --- */

/* A lobe narrower than the rounding of directions is a delta lobe: its density would overflow and nothing could
   evaluate it. Glass of index 1 does not bend, however rough. */
static int pti_is_smooth(const pt_material *m)
{
    return (double)m->roughness * (double)m->roughness < PTI_UNIT_ROUNDOFF || (m->kind == PT_MATERIAL_DIELECTRIC && m->ior == 1);
}

static double pti_ior(const pt_material *m)
{
    return m->ior > 0 ? (double)m->ior : 1.5;
}

static unsigned pti_material_lobes(const pt_material *m, pt_rgb albedo)
{
    unsigned base = pti_rgb_black(albedo) ? 0u : (unsigned)PT_LOBE_DIFFUSE;
    switch (m->kind) {
    case PT_MATERIAL_DIFFUSE:
    case PT_MATERIAL_OREN_NAYAR: return base;
    case PT_MATERIAL_MIRROR: return PT_LOBE_SPECULAR;
    case PT_MATERIAL_DIELECTRIC:
    case PT_MATERIAL_CONDUCTOR: return pti_is_smooth(m) ? PT_LOBE_SPECULAR : PT_LOBE_GLOSSY;
    case PT_MATERIAL_PHONG:
    case PT_MATERIAL_BLINN: return base | (pti_rgb_black(m->specular) ? 0u : (unsigned)PT_LOBE_GLOSSY);
    case PT_MATERIAL_COAT: return base | PT_LOBE_SPECULAR;
    case PT_MATERIAL_MEASURED: return PT_LOBE_GLOSSY;
    }
    return 0;
}

PTDEF pt_bsdf pt_bsdf_make(const pt_material *m, const pt_hit *hit)
{
    pt_bsdf b;
    b.material = m;
    b.frame = pt_frame_from_normal(hit->ns);
    b.ng = hit->ng;
    b.albedo = m->albedo;
#if PTI_HAS_TEXTURES
    if (m->texture) b.albedo = pt_rgb_mul(b.albedo, pt_texture_eval(m->texture, pti_hit_uv(hit), hit->p));
#endif
    b.lobes = pti_material_lobes(m, b.albedo);
    return b;
}

/* +1 if w is on the side of ng, -1 on the other. */
PTI_INLINE pt_real pti_side(const pt_bsdf *b, pt_vec3 w)
{
    return pt_v3_dot(w, b->ng) >= 0 ? PTI_R(1) : PTI_R(-1);
}

/* Cosine of wi with the shading normal on wo's side, 0 if reflection from wo to wi is impossible. */
PTI_INLINE pt_real pti_reflection_cosine(const pt_bsdf *b, pt_vec3 wo, pt_vec3 wi)
{
    pt_real side = pti_side(b, wo), c = side * pt_v3_dot(wi, b->frame.n);
    return c > 0 && side * pt_v3_dot(wi, b->ng) > 0 ? c : 0;
}

/* A density in the working precision. Where both directions graze from opposite sides it can exceed any range; the
   weight f cos / pdf is then 0 to rounding. */
static pt_real pti_density(double p)
{
    return p < (double)PTI_REAL_MAX ? (pt_real)p : PTI_REAL_MAX;
}

/* Two directions around the shading normal, mirrored so that wo is above; eta as seen from wo. */
typedef struct pti_pair {
    pti_d3 o, i;
    double eta;
} pti_pair;

/* Unit again: a length that was rounded by u is a factor of 1 + n u in cos^n. */
static pti_d3 pti_to_local(const pt_bsdf *b, pt_vec3 w, double side)
{
    pti_d3 d = pti_d_from(w);
    return pti_d_normalize(pti_d(pti_d_dot(d, pti_d_from(b->frame.s)), pti_d_dot(d, pti_d_from(b->frame.t)), side * pti_d_dot(d, pti_d_from(b->frame.n))));
}

/* From the local direction to the world's, on the side of ng that its z says: 0 if the shading normal and the
   geometric one disagree about that. */
static int pti_to_world(const pt_bsdf *b, pti_d3 local, double side, pt_vec3 *w)
{
    pti_d3 s = pti_d_scale(pti_d_from(b->frame.s), local.x), t = pti_d_scale(pti_d_from(b->frame.t), local.y);
    *w = pti_d_to(pti_d_normalize(pti_d_add(pti_d_add(s, t), pti_d_scale(pti_d_from(b->frame.n), side * local.z))));
    return side * local.z * (double)pt_v3_dot(*w, b->ng) > 0;
}

/* wo alone; 0 if it is below the shading normal. */
static int pti_pair_begin(const pt_bsdf *b, pt_vec3 wo, pti_pair *p, double *side)
{
    *side = (double)pti_side(b, wo);
    p->o = pti_to_local(b, wo, *side);
    p->eta = *side > 0 ? pti_ior(b->material) : 1 / pti_ior(b->material);
    return p->o.z > 0;
}

/* Both; 0 if the two normals disagree about their sides. */
static int pti_pair_make(const pt_bsdf *b, pt_vec3 wo, pt_vec3 wi, pti_pair *p)
{
    double side;
    if (!pti_pair_begin(b, wo, p, &side)) return 0;
    p->i = pti_to_local(b, wi, side);
    return p->i.z * side * (double)pt_v3_dot(wi, b->ng) > 0;
}

#if PTI_HAS_MICROFACET
/* --- rough metal and glass --- */

static double pti_alpha(const pt_bsdf *b)
{
    return (double)b->material->roughness * (double)b->material->roughness;
}

/* The half vector on o's side, of reflection or of refraction [Wal07] (16); 0 if it is no visible facet's. */
static int pti_half_vector(const pti_pair *p, pti_d3 *h)
{
    int reflected = p->i.z > 0;
    *h = pti_d_normalize(pti_d_add(p->o, pti_d_scale(p->i, reflected ? 1 : p->eta)));
    if (h->z < 0) *h = pti_d_scale(*h, -1);
    return pti_d_dot(p->o, *h) > 0 && (pti_d_dot(p->i, *h) > 0) == reflected;
}

/* Density of i per density of the half vector: [Wal07] (14) and (17). */
static double pti_half_jacobian(const pti_pair *p, pti_d3 h)
{
    double oh = pti_d_dot(p->o, h), ih = pti_d_dot(p->i, h), d = oh + p->eta * ih;
    return p->i.z > 0 ? 1 / (4 * oh) : p->eta * p->eta * fabs(ih) / (d * d);
}

static pt_rgb pti_conductor_fresnel(const pt_bsdf *b, double c)
{
    const pt_material *m = b->material;
    pt_rgb f = pt_rgb3((pt_real)pt_fresnel_conductor(c, (double)m->eta.r, (double)m->k.r),
                       (pt_real)pt_fresnel_conductor(c, (double)m->eta.g, (double)m->k.g),
                       (pt_real)pt_fresnel_conductor(c, (double)m->eta.b, (double)m->k.b));
    return pt_rgb_mul(f, b->albedo);
}

/* f of rough metal and rough glass: F D G2 / (4 cos cos) or [Wal07] (21), in which D G1 (o.h)/cos times the
   Jacobian is the density, so that f = density * G2 / (G1 cos_i). */
static pt_rgb pti_eval_microfacet(const pt_bsdf *b, const pti_pair *p, pt_transport mode)
{
    double a = pti_alpha(b), lo, f, r;
    pti_d3 h;
    if (b->material->kind == PT_MATERIAL_CONDUCTOR && p->i.z < 0) return pt_rgb_grey(0);
    if (!pti_half_vector(p, &h)) return pt_rgb_grey(0);
    lo = pti_ggx_lambda(p->o, a);
    f = pti_ggx_visible(p->o, h, a) * pti_half_jacobian(p, h) * (1 + lo) / ((1 + lo + pti_ggx_lambda(p->i, a)) * fabs(p->i.z));
    if (b->material->kind == PT_MATERIAL_CONDUCTOR) return pt_rgb_scale(pti_conductor_fresnel(b, pti_d_dot(p->o, h)), (pt_real)f);
    r = pt_fresnel_make(pti_d_dot(p->o, h), p->eta).r;
    if (p->i.z > 0) return pt_rgb_grey((pt_real)(f * r));
    return pt_rgb_grey((pt_real)(f * (1 - r) / (mode == PT_RADIANCE ? p->eta * p->eta : 1))); /* [Vea97] 5.2 */
}

static double pti_pdf_microfacet(const pt_bsdf *b, const pti_pair *p)
{
    double f = 1;
    pti_d3 h;
    if (!pti_half_vector(p, &h)) return 0;
    if (b->material->kind == PT_MATERIAL_DIELECTRIC) f = pt_fresnel_make(pti_d_dot(p->o, h), p->eta).r;
    if (p->i.z < 0) f = b->material->kind == PT_MATERIAL_DIELECTRIC ? 1 - f : 0;
    return f * pti_ggx_visible(p->o, h, pti_alpha(b)) * pti_half_jacobian(p, h);
}

static int pti_sample_microfacet(const pt_bsdf *b, pt_vec3 wo, double u_lobe, pt_vec2 u, pt_transport mode,
                                 pt_bsdf_sample_result *out)
{
    double a = pti_alpha(b), side, c, lo, g, r = 1;
    pt_fresnel f = {1, 1, 1, 0};
    pti_pair p;
    pti_d3 h;
    if (!pti_pair_begin(b, wo, &p, &side)) return 0;
    h = pti_ggx_visible_draw(p.o, a, (double)u.x, (double)u.y);
    c = pti_d_dot(p.o, h);
    if (!(c > 0)) return 0;
    if (b->material->kind == PT_MATERIAL_DIELECTRIC) f = pt_fresnel_make(c, p.eta);
    if (u_lobe < f.r) {
        p.i = pti_d_sub(pti_d_scale(h, 2 * c), p.o);
        if (!(p.i.z > 0)) return 0;
        r = f.r;
    } else {
        p.i = pti_d_sub(pti_d_scale(h, c / p.eta - f.cos_t), pti_d_scale(p.o, 1 / p.eta));
        if (!(p.i.z < 0)) return 0;
        r = 1 - f.r;
        out->eta = (pt_real)p.eta;
    }
    if (!pti_to_world(b, p.i, side, &out->wi)) return 0;
    lo = pti_ggx_lambda(p.o, a);
    g = (1 + lo) / (1 + lo + pti_ggx_lambda(p.i, a)); /* f cos / pdf = F G2 / G1 [Hei18] (19) */
    if (p.i.z < 0 && mode == PT_RADIANCE) g /= p.eta * p.eta;
    out->weight = b->material->kind == PT_MATERIAL_CONDUCTOR ? pt_rgb_scale(pti_conductor_fresnel(b, c), (pt_real)g) : pt_rgb_grey((pt_real)g);
    out->pdf_w = pti_density(r * pti_ggx_visible(p.o, h, a) * pti_half_jacobian(&p, h));
    out->pdf_rev_w = pt_bsdf_pdf_w(b, out->wi, wo, mode == PT_RADIANCE ? PT_IMPORTANCE : PT_RADIANCE);
    out->lobe = PT_LOBE_GLOSSY;
    return out->pdf_w > 0;
}

/* [Ore94] eq. 30 with sigma in radians: albedo/pi (A + B max(0, cos dphi) sin(a) tan(b)), a and b the larger and
   the smaller angle. sin a tan b cos dphi = (x x + y y) / max(cos, cos). The model is a fit: its albedo reaches 1.0152
   times `albedo` at grazing angles, for sigma about 0.2. */
static pt_rgb pti_eval_oren_nayar(const pt_bsdf *b, const pti_pair *p)
{
    double s2 = (double)b->material->roughness * (double)b->material->roughness;
    double a = 1 - 0.5 * s2 / (s2 + 0.33), c = 0.45 * s2 / (s2 + 0.09), t = p->o.x * p->i.x + p->o.y * p->i.y;
    return pt_rgb_scale(b->albedo, (pt_real)((a + c * fmax(0, t) / fmax(p->o.z, p->i.z)) / PT_PI));
}
#endif

#if PTI_HAS_PHONG
/* --- Phong and Blinn-Phong --- */

/* cos^n of the glossy lobe, about the mirror direction or of the half vector, and the cosine o.h for the latter. */
static double pti_phong_power(const pt_bsdf *b, const pti_pair *p, double *oh)
{
    pti_d3 h;
    double c;
    *oh = 1;
    if (b->material->kind == PT_MATERIAL_PHONG) {
        c = p->o.z * p->i.z - p->o.x * p->i.x - p->o.y * p->i.y;
    } else {
        h = pti_d_normalize(pti_d_add(p->o, p->i));
        *oh = pti_d_dot(p->o, h);
        c = h.z;
        if (!(*oh > 0)) { /* opposite directions, by rounding: no facet sees both */
            *oh = 1;
            return 0;
        }
    }
    return c > 0 ? pow(fmin(1, c), (double)b->material->exponent) : 0;
}

/* (n+2)/(2 pi) [Laf94]; for the half vector the exact constant that makes the albedo 1 along the normal. */
static double pti_phong_norm(const pt_bsdf *b)
{
    double n = (double)b->material->exponent;
    if (b->material->kind == PT_MATERIAL_PHONG) return (n + 2) / (2 * PT_PI);
    return (n + 2) * (n + 4) / (8 * PT_PI * (pow(2, -0.5 * n) + n));
}

/* How often the glossy lobe is drawn. */
static double pti_phong_share(const pt_bsdf *b)
{
    const pt_rgb s = b->material->specular, a = b->albedo;
    double glossy = fmax((double)s.r, fmax((double)s.g, (double)s.b)), diffuse = fmax((double)a.r, fmax((double)a.g, (double)a.b));
    return glossy > 0 ? glossy / (glossy + diffuse) : 0;
}

static pt_rgb pti_eval_phong(const pt_bsdf *b, const pti_pair *p, unsigned lobes)
{
    double oh;
    pt_rgb d = pt_rgb_grey(0), g = pt_rgb_grey(0);
    if (lobes & PT_LOBE_DIFFUSE) d = pt_rgb_scale(b->albedo, PTI_R(1 / PT_PI));
    if (lobes & PT_LOBE_GLOSSY) g = pt_rgb_scale(b->material->specular, (pt_real)(pti_phong_norm(b) * pti_phong_power(b, p, &oh)));
    return pt_rgb_add(d, g);
}

/* (n+1)/(2 pi) cos^n, of the mirror direction or, over 4 o.h, of the half vector; and the cosine. */
static double pti_pdf_phong(const pt_bsdf *b, const pti_pair *p)
{
    double share = pti_phong_share(b), oh, power = pti_phong_power(b, p, &oh), g;
    g = ((double)b->material->exponent + 1) / (2 * PT_PI) * power;
    if (b->material->kind == PT_MATERIAL_BLINN) g /= 4 * oh;
    return share * g + (1 - share) * p->i.z / PT_PI;
}

/* A direction about the mirror direction, or reflected at a half vector, with density cos^n. */
static pti_d3 pti_draw_phong(const pt_bsdf *b, pti_d3 o, pt_vec2 u)
{
    double c = pow(1 - (double)u.x, 1 / ((double)b->material->exponent + 1)), s = sqrt((1 - c) * (1 + c)), phi = 2 * PT_PI * (double)u.y;
    pti_d3 l = pti_d(s * cos(phi), s * sin(phi), c), f[3];
    pt_frame frame;
    if (b->material->kind == PT_MATERIAL_BLINN) return pti_d_sub(pti_d_scale(l, 2 * pti_d_dot(o, l)), o);
    frame = pt_frame_from_normal(pti_d_to(pti_d(-o.x, -o.y, o.z)));
    f[0] = pti_d_scale(pti_d_from(frame.s), l.x);
    f[1] = pti_d_scale(pti_d_from(frame.t), l.y);
    f[2] = pti_d_scale(pti_d_from(frame.n), l.z);
    return pti_d_normalize(pti_d_add(f[0], pti_d_add(f[1], f[2])));
}
#endif

#if PTI_HAS_COAT
/* --- coat: what the interface lets through is scattered by the base and reflected back to it any number of times:
   (1-F_o)(1-F_i) albedo / (pi n^2 (1 - albedo R)), R the inner reflectance of diffuse light. With albedo 1 the
   whole reflects exactly 1: the diffuse transmission (1 - R_outer)/n^2 is 1 - R. --- */

static pt_rgb pti_coat_base(const pt_bsdf *b, double r)
{
    pt_rgb a = b->albedo;
    return pt_rgb3((pt_real)((double)a.r / (1 - (double)a.r * r)), (pt_real)((double)a.g / (1 - (double)a.g * r)),
                   (pt_real)((double)a.b / (1 - (double)a.b * r)));
}

static pt_rgb pti_eval_coat(const pt_bsdf *b, const pti_pair *p)
{
    double n = pti_ior(b->material), r = pt_fresnel_diffuse(1 / n);
    double t = (1 - pt_fresnel_make(p->o.z, n).r) * (1 - pt_fresnel_make(p->i.z, n).r);
    return pt_rgb_scale(pti_coat_base(b, r), (pt_real)(t / (PT_PI * n * n)));
}

/* How often the interface is drawn: by its share of what is reflected. */
static double pti_coat_share(const pt_bsdf *b, double cos_o)
{
    double n = pti_ior(b->material), r = pt_fresnel_diffuse(1 / n), f = pt_fresnel_make(cos_o, n).r;
    pt_rgb a = pti_coat_base(b, r);
    return f / (f + (1 - f) * (1 - r) * fmax((double)a.r, fmax((double)a.g, (double)a.b)));
}
#endif

#if PTI_HAS_MEASURED
/* --- measured: half of the directions by the cosine, half by the half vector --- */

static double pti_pdf_measured(const pt_bsdf *b, const pti_pair *p)
{
    pti_d3 h = pti_d_normalize(pti_d_add(p->o, p->i));
    int ring = pti_clamp_int(sqrt(atan2(sqrt(h.x * h.x + h.y * h.y), h.z) * (2 / PT_PI)) * PTI_MERL_H, PTI_MERL_H - 1);
    double ph = (b->material->measured->cdf[ring + 1] - b->material->measured->cdf[ring]) / pti_merl_ring(ring);
    return 0.5 * p->i.z / PT_PI + (pti_d_dot(p->o, h) > 0 ? 0.5 * ph / (4 * pti_d_dot(p->o, h)) : 0);
}

static pti_d3 pti_draw_measured(const pt_bsdf *b, pti_d3 o, pt_vec2 u)
{
    const double *cdf = b->material->measured->cdf;
    double phi = 2 * PT_PI * (double)u.y, x, c, s;
    pti_d3 h;
    int i = 0;
    while (i < PTI_MERL_H - 1 && (double)u.x >= cdf[i + 1]) i++;
    x = ((double)u.x - cdf[i]) / (cdf[i + 1] - cdf[i]); /* uniform in the ring: in 1 - cos = 2 sin^2(theta/2) */
    s = sin(0.5 * pti_merl_theta_h(i));
    c = sin(0.5 * pti_merl_theta_h(i + 1));
    x = (1 - x) * s * s + x * c * c;
    c = 1 - 2 * x;
    s = 2 * sqrt(x * (1 - x));
    h = pti_d(s * cos(phi), s * sin(phi), c);
    return pti_d_sub(pti_d_scale(h, 2 * pti_d_dot(o, h)), o);
}
#endif

PTDEF pt_rgb pt_bsdf_eval(const pt_bsdf *b, pt_vec3 wo, pt_vec3 wi, pt_transport mode, unsigned lobes)
{
    const pt_rgb black = pt_rgb_grey(0);
    pti_pair p;
    (void)mode;
    lobes &= b->lobes;
    if (!(lobes & (PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY))) return black;
    if (b->material->kind == PT_MATERIAL_DIFFUSE)
        return pti_reflection_cosine(b, wo, wi) > 0 ? pt_rgb_scale(b->albedo, PTI_R(1 / PT_PI)) : black;
    if (!pti_pair_make(b, wo, wi, &p)) return black;
#if PTI_HAS_MICROFACET
    if (b->material->kind == PT_MATERIAL_CONDUCTOR || b->material->kind == PT_MATERIAL_DIELECTRIC) return pti_eval_microfacet(b, &p, mode);
#endif
    if (p.i.z < 0) return black; /* the rest reflect only */
    switch (b->material->kind) {
#if PTI_HAS_MICROFACET
    case PT_MATERIAL_OREN_NAYAR: return pti_eval_oren_nayar(b, &p);
#endif
#if PTI_HAS_PHONG
    case PT_MATERIAL_PHONG:
    case PT_MATERIAL_BLINN: return pti_eval_phong(b, &p, lobes);
#endif
#if PTI_HAS_COAT
    case PT_MATERIAL_COAT: return lobes & PT_LOBE_DIFFUSE ? pti_eval_coat(b, &p) : black;
#endif
#if PTI_HAS_MEASURED
    case PT_MATERIAL_MEASURED: return pt_rgb_mul(pti_merl_value(b->material->measured, pti_merl_index(p.o, p.i)), b->albedo);
#endif
    default: return black;
    }
}

PTDEF pt_real pt_bsdf_pdf_w(const pt_bsdf *b, pt_vec3 wo, pt_vec3 wi, pt_transport mode)
{
    pti_pair p;
    (void)mode;
    if (!(b->lobes & (PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY))) return 0;
    if (b->material->kind == PT_MATERIAL_DIFFUSE) return pt_warp_cosine_pdf_w(pt_v3(0, 0, pti_reflection_cosine(b, wo, wi)));
    if (!pti_pair_make(b, wo, wi, &p)) return 0;
#if PTI_HAS_MICROFACET
    if (b->material->kind == PT_MATERIAL_CONDUCTOR || b->material->kind == PT_MATERIAL_DIELECTRIC) return pti_density(pti_pdf_microfacet(b, &p));
#endif
    if (p.i.z < 0) return 0;
    switch (b->material->kind) {
#if PTI_HAS_MICROFACET
    case PT_MATERIAL_OREN_NAYAR: return (pt_real)(p.i.z / PT_PI);
#endif
#if PTI_HAS_PHONG
    case PT_MATERIAL_PHONG:
    case PT_MATERIAL_BLINN: return pti_density(pti_pdf_phong(b, &p));
#endif
#if PTI_HAS_COAT
    case PT_MATERIAL_COAT: return (pt_real)((1 - pti_coat_share(b, p.o.z)) * p.i.z / PT_PI);
#endif
#if PTI_HAS_MEASURED
    case PT_MATERIAL_MEASURED: return pti_density(pti_pdf_measured(b, &p));
#endif
    default: return 0;
    }
}

static int pti_sample_diffuse(const pt_bsdf *b, pt_vec3 wo, pt_vec2 u, pt_bsdf_sample_result *out)
{
    pt_vec3 local = pt_warp_cosine(u);
    local.z *= pti_side(b, wo);
    out->wi = pt_frame_to_world(&b->frame, local);
    out->weight = b->albedo;
    out->pdf_w = pt_bsdf_pdf_w(b, wo, out->wi, PT_RADIANCE);
    out->pdf_rev_w = pt_bsdf_pdf_w(b, out->wi, wo, PT_RADIANCE);
    out->lobe = PT_LOBE_DIFFUSE;
    return out->pdf_w > 0;
}

/* The normal of a mirror or of glass on wo's side: the shading normal, or the geometric one where wo is
   behind that. */
static pti_d3 pti_specular_normal(const pt_bsdf *b, pt_vec3 wo, double *cos_o)
{
    double side = (double)pti_side(b, wo);
    pti_d3 n = pti_d_scale(pti_d_from(b->frame.n), side);
    *cos_o = pti_d_dot(n, pti_d_from(wo));
    if (*cos_o > 0) return n;
    n = pti_d_scale(pti_d_from(b->ng), side);
    *cos_o = fmax(0, pti_d_dot(n, pti_d_from(wo)));
    return n;
}

static int pti_sample_reflection(const pt_bsdf *b, pt_vec3 wo, pti_d3 n, double cos_o, pt_bsdf_sample_result *out)
{
    out->wi = pti_d_to(pti_d_normalize(pti_d_sub(pti_d_scale(n, 2 * cos_o), pti_d_from(wo))));
    out->lobe = PT_LOBE_SPECULAR;
    return pti_side(b, wo) * pt_v3_dot(out->wi, b->ng) > 0;
}

static int pti_sample_dielectric(const pt_bsdf *b, pt_vec3 wo, double u_lobe, pt_transport mode,
                                 pt_bsdf_sample_result *out)
{
    double ior = pti_ior(b->material), cos_o, cos_t, f, eta;
    pti_d3 n = pti_specular_normal(b, wo, &cos_o), w;
    eta = pti_side(b, wo) > 0 ? ior : 1 / ior;
    f = pt_fresnel_dielectric(cos_o, eta, &cos_t);
    if (u_lobe < f) {
        out->pdf_w = out->pdf_rev_w = (pt_real)f;
        return pti_sample_reflection(b, wo, n, cos_o, out);
    }
    w = pti_d_sub(pti_d_scale(n, cos_o / eta - cos_t), pti_d_scale(pti_d_from(wo), 1 / eta));
    out->wi = pti_d_to(pti_d_normalize(w));
    out->pdf_w = out->pdf_rev_w = (pt_real)(1 - f);
    if (mode == PT_RADIANCE) out->weight = pt_rgb_grey((pt_real)(1 / (eta * eta))); /* [Vea97] 5.2 */
    out->eta = (pt_real)eta;
    out->lobe = PT_LOBE_SPECULAR;
    return pti_side(b, wo) * pt_v3_dot(out->wi, b->ng) < 0;
}

#if PTI_HAS_MICROFACET || PTI_HAS_PHONG || PTI_HAS_COAT || PTI_HAS_MEASURED
/* A direction of one lobe with the weight f cos / pdf of the whole: `glossy` by `draw`, otherwise by the cosine. */
static int pti_sample_mixture(const pt_bsdf *b, pt_vec3 wo, pt_vec2 u, pti_d3 (*draw)(const pt_bsdf *, pti_d3, pt_vec2), unsigned lobe,
                              pt_bsdf_sample_result *out)
{
    double side, k;
    pt_vec3 cosine;
    pti_pair p;
    if (!pti_pair_begin(b, wo, &p, &side)) return 0;
    cosine = pt_warp_cosine(u);
    p.i = draw ? draw(b, p.o, u) : pti_d_from(cosine);
    if (!(p.i.z > 0) || !pti_to_world(b, p.i, side, &out->wi)) return 0;
    out->pdf_w = pt_bsdf_pdf_w(b, wo, out->wi, PT_RADIANCE);
    out->pdf_rev_w = pt_bsdf_pdf_w(b, out->wi, wo, PT_RADIANCE);
    if (!(out->pdf_w > 0)) return 0;
    k = fabs((double)pt_v3_dot(out->wi, b->frame.n)) / (double)out->pdf_w;
    out->weight = pt_rgb_scale(pt_bsdf_eval(b, wo, out->wi, PT_RADIANCE, PT_LOBE_ALL), (pt_real)k);
    out->lobe = lobe;
    return 1;
}
#endif

#if PTI_HAS_COAT
static int pti_sample_coat(const pt_bsdf *b, pt_vec3 wo, double u_lobe, pt_vec2 u, pt_bsdf_sample_result *out)
{
    double cos_o, share;
    pti_d3 n = pti_specular_normal(b, wo, &cos_o);
    share = pti_coat_share(b, cos_o);
    if (!(u_lobe < share)) return pti_sample_mixture(b, wo, u, NULL, PT_LOBE_DIFFUSE, out);
    out->pdf_w = out->pdf_rev_w = (pt_real)share;
    out->weight = pt_rgb_grey((pt_real)(pt_fresnel_make(cos_o, pti_ior(b->material)).r / share));
    return pti_sample_reflection(b, wo, n, cos_o, out);
}
#endif

/* A mirror, or smooth metal. */
static int pti_sample_mirror(const pt_bsdf *b, pt_vec3 wo, pt_bsdf_sample_result *out)
{
    double cos_o;
    pti_d3 n = pti_specular_normal(b, wo, &cos_o);
    out->weight = b->albedo;
#if PTI_HAS_MICROFACET
    if (b->material->kind == PT_MATERIAL_CONDUCTOR) out->weight = pti_conductor_fresnel(b, cos_o);
#endif
    out->pdf_w = out->pdf_rev_w = 1;
    return pti_sample_reflection(b, wo, n, cos_o, out);
}

PTDEF int pt_bsdf_sample(const pt_bsdf *b, pt_vec3 wo, double u_lobe, pt_vec2 u, pt_transport mode,
                         pt_bsdf_sample_result *out)
{
    if (!b->lobes) return 0;
    out->eta = 1;
    out->weight = pt_rgb_grey(1);
    switch (b->material->kind) {
    case PT_MATERIAL_DIFFUSE: return pti_sample_diffuse(b, wo, u, out);
    case PT_MATERIAL_DIELECTRIC:
        if (b->lobes & PT_LOBE_SPECULAR) return pti_sample_dielectric(b, wo, u_lobe, mode, out);
        break;
#if PTI_HAS_MICROFACET
    case PT_MATERIAL_OREN_NAYAR: return pti_sample_mixture(b, wo, u, NULL, PT_LOBE_DIFFUSE, out);
#endif
#if PTI_HAS_PHONG
    case PT_MATERIAL_PHONG:
    case PT_MATERIAL_BLINN:
        if (u_lobe < pti_phong_share(b)) return pti_sample_mixture(b, wo, u, pti_draw_phong, PT_LOBE_GLOSSY, out);
        return pti_sample_mixture(b, wo, u, NULL, PT_LOBE_DIFFUSE, out);
#endif
#if PTI_HAS_COAT
    case PT_MATERIAL_COAT: return pti_sample_coat(b, wo, u_lobe, u, out);
#endif
#if PTI_HAS_MEASURED
    case PT_MATERIAL_MEASURED: return pti_sample_mixture(b, wo, u, u_lobe < 0.5 ? pti_draw_measured : NULL, PT_LOBE_GLOSSY, out);
#endif
    default:
        if (b->lobes & PT_LOBE_SPECULAR) return pti_sample_mirror(b, wo, out);
        break;
    }
#if PTI_HAS_MICROFACET
    return pti_sample_microfacet(b, wo, u_lobe, u, mode, out);
#else
    return 0;
#endif
}

/* =====================================================================================================
   [PT-09] LIGHTS: implementation
   =====================================================================================================
   Direct light is the integral of f L cos over the directions in which lights are seen. Sampling it by the
   area of a light puts cos'/d^2 into the integrand, which explodes where the light is near; sampling it by
   the solid angle under which the light is seen leaves f cos only. So: spheres by the cone that they fill,
   rectangles and triangles by their spherical images. The density is one over that solid angle for each, and
   pt_light_pdf_w computes it from the same functions that the samplers use. */

/* Are these corners a rectangle? Exactly a parallelogram, and perpendicular up to the rounding of unit edges:
   4 u of the angle changes the solid angle by no more than that. */
static int pti_is_rectangle(const pt_vec3 v[4])
{
    pti_d3 a = pti_d_between(v[0], v[1]), b = pti_d_between(v[0], v[3]), c = pti_d_between(v[3], v[2]);
    return a.x == c.x && a.y == c.y && a.z == c.z &&
           fabs(pti_d_dot(a, b)) <= 4 * PTI_UNIT_ROUNDOFF * pti_d_length(a) * pti_d_length(b);
}

/* How a flat light is seen from a point. */
typedef struct pti_flat {
    pt_spherical_triangle half[2];
    pt_spherical_rectangle rectangle;
    int is_rectangle;
    double solid_angle;
    pti_d3 corner, n;       /* a corner relative to the point, and the (unscaled) normal                   */
    pti_d3 warp;            /* how far a parallelogram's rounded corners are off that plane, a coordinate  */
} pti_flat;

/* Sets up for a triangle or parallelogram light; 0 if p is behind it or in its plane. */
static int pti_flat_make(pti_flat *f, const pt_scene *scene, const pt_primitive *primitive, pt_vec3 p)
{
    pt_vec3 v[4];
    int corners = pti_corners(scene, primitive, v);
    f->warp = pti_d_add(pti_d_abs(pti_d_from(v[1])), pti_d_add(pti_d_abs(pti_d_from(v[2])), pti_d_abs(pti_d_from(v[3]))));
    f->warp = pti_d_scale(f->warp, corners == 4 ? PTI_UNIT_ROUNDOFF : 0);
    f->corner = pti_d_between(p, v[0]);
    f->n = pti_d_cross(pti_d_between(v[0], v[1]), pti_d_between(v[0], v[2]));
    if (!(pti_d_dot(f->corner, f->n) < 0)) return 0;
    f->is_rectangle = corners == 4 && pti_is_rectangle(v);
    if (f->is_rectangle) {
        f->solid_angle = pti_spherical_rectangle_setup(&f->rectangle, f->corner, pti_d_between(v[0], v[1]), pti_d_between(v[0], v[3]));
    } else {
        f->solid_angle = pt_spherical_triangle_make(&f->half[0], p, v[0], v[1], v[2]);
        f->half[1].solid_angle = 0;
        if (corners == 4) f->solid_angle += pt_spherical_triangle_make(&f->half[1], p, v[0], v[2], v[3]);
    }
    return f->solid_angle > 0;
}

static pti_d3 pti_flat_direction(const pti_flat *f, double u0, double u1)
{
    double first;
    if (f->is_rectangle) return pti_spherical_rectangle_direction(&f->rectangle, u0, u1);
    first = f->half[0].solid_angle / f->solid_angle;
    if (u0 < first || f->half[1].solid_angle == 0)
        return pti_spherical_triangle_direction(&f->half[0], fmin(1, u0 / first), u1);
    return pti_spherical_triangle_direction(&f->half[1], (u0 - first) / (1 - first), u1);
}

static int pti_sample_flat(const pt_scene *scene, const pt_primitive *primitive, pt_vec3 p, pt_vec2 u,
                           pt_light_sample_result *out)
{
    pti_flat f;
    pti_d3 w, q, o = pti_d_from(p), size;
    double t;
    if (!pti_flat_make(&f, scene, primitive, p)) return 0;
    w = pti_d_normalize(pti_flat_direction(&f, (double)u.x, (double)u.y)); /* nearly edge-on it loses digits */
    t = pti_d_dot(f.corner, f.n) / pti_d_dot(w, f.n);
    if (!(t > 0) || !pti_finite(t)) return 0;
    q = pti_d_add(o, pti_d_scale(w, t));
    size = pti_d_add(pti_d_abs(pti_d_add(o, f.corner)), pti_d_add(pti_d_abs(o), pti_d(t, t, t)));
    out->p = pti_d_to(q);
    out->p_error = pt_v3(pti_point_error(out->p.x, size.x) + (pt_real)f.warp.x, pti_point_error(out->p.y, size.y) + (pt_real)f.warp.y,
                         pti_point_error(out->p.z, size.z) + (pt_real)f.warp.z);
    out->n = pti_d_to(pti_d_normalize(f.n));
    out->wi = pti_d_to(w);
    out->distance = (pt_real)t;
    out->pdf_w = 1 / f.solid_angle;
    return 1;
}

/* 1 - cos of the half angle under which a sphere is seen from outside: s^2 / (1 + sqrt(1 - s^2)), s = r/d. */
static double pti_sphere_omc(double r, double d)
{
    double s = r / d;
    return s * s / (1 + sqrt((1 - s) * (1 + s)));
}

static int pti_sample_sphere_light(const pt_sphere *s, pt_vec3 p, pt_vec2 u, pt_light_sample_result *out)
{
    pti_d3 axis = pti_d_between(p, s->centre), w;
    double r = (double)s->radius, d = pti_d_length(axis), t, x, sin2;
    pt_frame frame;
    pt_vec3 l;
    pt_hit hit;
    if (d > r) {
        double omc = pti_sphere_omc(r, d), phi = 2 * PT_PI * (double)u.y;
        frame = pt_frame_from_normal(pti_d_to(pti_d_normalize(axis)));
        x = (double)u.x * omc;
        sin2 = x * (2 - x);
        l = pt_frame_to_world(&frame, pt_v3((pt_real)cos(phi), (pt_real)sin(phi), 0));
        w = pti_d_add(pti_d_scale(axis, (1 - x) / d), pti_d_scale(pti_d_from(l), sqrt(sin2)));
        t = d * (1 - x) - sqrt(fmax(0, r * r - d * d * sin2)); /* the near side */
        out->pdf_w = pt_warp_cone_pdf_w(omc);
    } else {
        w = pti_d_from(pt_warp_sphere(u));
        x = pti_d_dot(w, axis);
        t = x + sqrt(fmax(0, (r - d) * (r + d) + x * x)); /* the far side */
        out->pdf_w = (double)pt_warp_sphere_pdf_w();
    }
    pti_fill_sphere(s, pti_d_sub(pti_d_scale(w, t), axis), &hit);
    out->p = hit.p;
    out->p_error = hit.p_error;
    out->n = hit.ng;
    out->wi = pti_d_to(pti_d_normalize(w));
    out->distance = (pt_real)t;
    return t > 0;
}

/* Larger than the scene, seen from p. */
static pt_real pti_far_distance(const pt_scene *scene, pt_vec3 p)
{
    return 2 * pt_v3_length(pt_v3_sub(scene->hi, scene->lo)) + pt_v3_length(pt_v3_sub(p, scene->lo));
}

#if PTI_HAS_ENVIRONMENT
/* --- environment image: pixel (x, y) is a rectangle of azimuth and polar angle; its solid angle is
   2 pi / width (cos a - cos b). A row is drawn by the light in it, then a column, then a point that is uniform in
   solid angle: the density is the pixel's share of the light over its solid angle, whatever the resolution. --- */

static double pti_map_solid_angle(const pt_environment_map *m, int y)
{
    double a = PT_PI * y / m->height, b = PT_PI * (y + 1) / m->height;
    return 4 * PT_PI / m->width * sin(0.5 * (a + b)) * sin(0.5 * (b - a));
}

/* The pixel that a direction is in. */
static void pti_map_pixel(const pt_environment_map *m, pt_vec3 w, int *x, int *y)
{
    pti_d3 d = pti_d_from(w);
    *x = (int)((0.5 + atan2(d.x, -d.z) / (2 * PT_PI)) * m->width);
    *y = (int)(atan2(sqrt(d.x * d.x + d.z * d.z), d.y) / PT_PI * m->height);
    if (*x >= m->width) *x = 0; /* azimuth pi is -pi */
    if (*y >= m->height) *y = m->height - 1;
}

static pt_rgb pti_map_value(const pt_environment_map *m, int x, int y)
{
    const float *c = m->rgb + 3 * ((size_t)y * (size_t)m->width + (size_t)x);
    return pt_rgb3((pt_real)((double)c[0] * m->scale), (pt_real)((double)c[1] * m->scale), (pt_real)((double)c[2] * m->scale));
}

static double pti_map_pdf_w(const pt_environment_map *m, int x, int y)
{
    const double *columns = m->columns + (size_t)y * ((size_t)m->width + 1);
    return (m->rows[y + 1] - m->rows[y]) * (columns[x + 1] - columns[x]) / pti_map_solid_angle(m, y);
}

/* The interval of a cumulative list (count + 1 numbers from 0 to 1) that holds u, and where in it u lies. */
static int pti_find_interval(const double *cdf, int count, double u, double *rest)
{
    int lo = 0, hi = count;
    while (hi - lo > 1) {
        int middle = lo + (hi - lo) / 2;
        if (cdf[middle] <= u) lo = middle;
        else hi = middle;
    }
    *rest = cdf[hi] > cdf[lo] ? fmin(1, (u - cdf[lo]) / (cdf[hi] - cdf[lo])) : 0.5;
    return lo;
}

static pt_vec3 pti_map_draw(const pt_environment_map *m, pt_vec2 u, int *x, int *y)
{
    double fx, fy, a, b, z, s, phi;
    *y = pti_find_interval(m->rows, m->height, (double)u.x, &fy);
    *x = pti_find_interval(m->columns + (size_t)*y * ((size_t)m->width + 1), m->width, (double)u.y, &fx);
    a = sin(0.5 * PT_PI * *y / m->height);
    b = sin(0.5 * PT_PI * (*y + 1) / m->height);
    z = (1 - fy) * a * a + fy * b * b; /* (1 - cos theta) / 2 */
    s = 2 * sqrt(z * (1 - z));
    phi = 2 * PT_PI * ((*x + fx) / m->width - 0.5);
    return pti_d_to(pti_d(s * sin(phi), 1 - 2 * z, -s * cos(phi)));
}

PTDEF pt_rgb pt_environment_radiance(const pt_scene *scene, pt_vec3 w)
{
    int x, y;
    if (!scene->map.rgb) return scene->environment;
    pti_map_pixel(&scene->map, w, &x, &y);
    return pti_map_value(&scene->map, x, y);
}

/* Density of a direction from the environment. */
static double pti_environment_pdf_w(const pt_scene *scene, pt_vec3 w)
{
    int x, y;
    if (!scene->map.rgb) return (double)pt_warp_sphere_pdf_w();
    pti_map_pixel(&scene->map, w, &x, &y);
    return pti_map_pdf_w(&scene->map, x, y);
}

/* A direction from the environment with its radiance and density. */
static pt_vec3 pti_environment_draw(const pt_scene *scene, pt_vec2 u, pt_rgb *radiance, double *pdf_w)
{
    pt_vec3 w;
    int x, y;
    if (scene->map.rgb) {
        w = pti_map_draw(&scene->map, u, &x, &y);
        pti_map_pixel(&scene->map, w, &x, &y); /* as everybody else will look it up: rounding may cross an edge */
        *radiance = pti_map_value(&scene->map, x, y);
        *pdf_w = pti_map_pdf_w(&scene->map, x, y);
        return w;
    }
    *radiance = scene->environment;
    *pdf_w = (double)pt_warp_sphere_pdf_w();
    return pt_warp_sphere(u);
}
#endif

static void pti_sample_infinite(const pt_scene *scene, const pt_light *light, pt_vec3 p, pt_vec2 u, pt_light_sample_result *out)
{
    out->infinite = 1;
    out->distance = pti_far_distance(scene, p);
    out->p_error = out->n = pt_v3(0, 0, 0);
    out->delta = light->kind == PT_LIGHT_DIRECTIONAL;
    out->pdf_w = 1;
    out->wi = pt_v3_neg(light->direction);
#if PTI_HAS_ENVIRONMENT
    if (!out->delta) out->wi = pti_environment_draw(scene, u, &out->radiance, &out->pdf_w);
#endif
    (void)u;
    out->p = pt_v3_add(p, pt_v3_scale(out->wi, out->distance));
}

/* 1 - cos of the angle between w and the axis of a spot: half the square of their difference, which keeps its digits
   for narrow cones. */
static double pti_off_axis(const pt_light *light, pt_vec3 w)
{
    pti_d3 d = pti_d_sub(pti_d_normalize(pti_d_from(w)), pti_d_normalize(pti_d_from(light->direction)));
    return 0.5 * pti_d_dot(d, d);
}

/* Is w in the cone of a spot? A direction drawn at its rim was rounded, by up to 4 u of angle, which is a relative
   change of 2 * 4 u / angle of 1 - cos = angle^2 / 2. */
static int pti_in_spot(const pt_light *light, pt_vec3 w)
{
    return pti_off_axis(light, w) <= light->omc_end + 8 * PTI_UNIT_ROUNDOFF * sqrt(light->omc_end);
}

/* Intensity of a point or spot light in direction w, which goes away from it. */
static pt_rgb pti_intensity(const pt_light *light, pt_vec3 w)
{
    if (light->kind != PT_LIGHT_SPOT) return light->emission;
    return pt_rgb_scale(light->emission, (pt_real)pti_spot_falloff(pti_off_axis(light, w), light->omc_start, light->omc_end));
}

static int pti_sample_point_light(const pt_light *light, pt_vec3 p, pt_light_sample_result *out)
{
    pti_d3 d = pti_d_between(p, light->position);
    double d2 = pti_d_dot(d, d);
    pt_rgb i;
    if (!(d2 > 0)) return 0;
    out->wi = pti_d_to(pti_d_normalize(d));
    out->distance = (pt_real)sqrt(d2);
    out->p = light->position;
    out->p_error = out->n = pt_v3(0, 0, 0);
    i = pti_intensity(light, pt_v3_neg(out->wi));
    out->radiance = pt_rgb3((pt_real)((double)i.r / d2), (pt_real)((double)i.g / d2), (pt_real)((double)i.b / d2));
    out->pdf_w = 1;
    out->delta = 1;
    return !pti_rgb_black(i);
}

PTDEF int pt_light_sample(const pt_scene *scene, int light, pt_vec3 p, pt_vec2 u, pt_light_sample_result *out)
{
    const pt_light *l;
    const pt_primitive *primitive;
    if (light < 0 || (uint32_t)light >= scene->light_count) return 0;
    l = &scene->lights[light];
    out->delta = out->infinite = 0;
    out->radiance = l->emission;
    if (l->kind == PT_LIGHT_POINT || l->kind == PT_LIGHT_SPOT) return pti_sample_point_light(l, p, out);
    if (l->kind != PT_LIGHT_AREA) {
        pti_sample_infinite(scene, l, p, u, out);
        return 1;
    }
    primitive = &scene->primitives[l->primitive];
    if (primitive->shape == PT_SHAPE_SPHERE) return pti_sample_sphere_light(&scene->spheres[primitive->index], p, u, out);
    return pti_sample_flat(scene, primitive, p, u, out);
}

PTDEF double pt_light_pdf_w(const pt_scene *scene, int light, pt_vec3 p, pt_vec3 w, const pt_hit *hit)
{
    const pt_primitive *primitive;
    pti_flat f;
    (void)w;
    if (light < 0 || (uint32_t)light >= scene->light_count) return 0;
#if PTI_HAS_ENVIRONMENT
    if (scene->lights[light].kind == PT_LIGHT_ENVIRONMENT) return hit ? 0 : pti_environment_pdf_w(scene, w);
#endif
    if (scene->lights[light].kind != PT_LIGHT_AREA || !hit || hit->primitive != scene->lights[light].primitive) return 0;
    primitive = &scene->primitives[hit->primitive];
    if (primitive->shape == PT_SHAPE_SPHERE) {
        const pt_sphere *s = &scene->spheres[primitive->index];
        double r = (double)s->radius, d = pti_d_length(pti_d_between(p, s->centre));
        return d > r ? pt_warp_cone_pdf_w(pti_sphere_omc(r, d)) : (double)pt_warp_sphere_pdf_w();
    }
    return pti_flat_make(&f, scene, primitive, p) ? 1 / f.solid_angle : 0;
}

PTDEF int pt_light_choose(const pt_scene *scene, double u, double *pmf)
{
    *pmf = 0;
    return scene->light_table.count == 0 ? -1 : (int)pt_alias_sample(&scene->light_table, u, pmf);
}

/* Radius of the sphere around the scene's box; 1 for an empty scene. */
static double pti_scene_radius(const pt_scene *scene)
{
    double r = 0.5 * pti_d_length(pti_d_between(scene->lo, scene->hi));
    return r > 0 ? r : 1;
}

/* A uniform point of an area light with its normal. */
static void pti_light_point(const pt_scene *scene, const pt_primitive *primitive, pt_vec2 u, pt_hit *hit)
{
    if (primitive->shape == PT_SHAPE_TRIANGLE) u = pt_warp_triangle(u);
    if (primitive->shape == PT_SHAPE_SPHERE)
        pti_fill_sphere(&scene->spheres[primitive->index], pti_d_from(pt_warp_sphere(u)), hit);
    else pti_fill_flat(scene, primitive, (double)u.x, (double)u.y, hit);
}

static void pti_le_area(const pt_scene *scene, const pt_light *l, pt_vec2 u_p, pt_vec2 u_w, pt_real u_side,
                        pt_light_emission_result *out)
{
    const pt_primitive *primitive = &scene->primitives[l->primitive];
    pt_vec3 local = pt_warp_cosine(u_w);
    pt_frame frame;
    pt_hit hit;
    pti_light_point(scene, primitive, u_p, &hit);
    if (primitive->shape == PT_SHAPE_SPHERE && u_side < PTI_R(0.5)) local.z = -local.z;
    frame = pt_frame_from_normal(hit.ng);
    out->p = hit.p;
    out->p_error = hit.p_error;
    out->n = hit.ng;
    out->w = pt_frame_to_world(&frame, local);
    out->cos_n = fabs((double)local.z);
}

/* From a disk across the direction, as wide as the scene and before it. */
static void pti_le_infinite(const pt_scene *scene, const pt_light *l, pt_vec2 u_p, pt_vec2 u_w, pt_light_emission_result *out)
{
    pti_d3 centre = pti_d_scale(pti_d_add(pti_d_from(scene->lo), pti_d_from(scene->hi)), 0.5);
    double r = pti_scene_radius(scene);
    pt_vec2 disk = pt_warp_disk(u_p);
    pt_frame frame;
    out->w = l->direction;
#if PTI_HAS_ENVIRONMENT
    if (l->kind == PT_LIGHT_ENVIRONMENT) {
        double pdf_w;
        out->w = pt_v3_neg(pti_environment_draw(scene, u_w, &out->radiance, &pdf_w));
    }
#endif
    (void)u_w;
    frame = pt_frame_from_normal(out->w);
    out->p = pti_d_to(pti_d_add(centre, pti_d_scale(pti_d_from(pt_frame_to_world(&frame, pt_v3(disk.x, disk.y, -1))), r)));
}

PTDEF int pt_light_sample_le(const pt_scene *scene, int light, pt_vec2 u_p, pt_vec2 u_w, pt_real u_side,
                             pt_light_emission_result *out)
{
    const pt_light *l;
    pt_frame frame;
    if (light < 0 || (uint32_t)light >= scene->light_count) return 0;
    l = &scene->lights[light];
    out->radiance = l->emission;
    out->p_error = out->n = pt_v3(0, 0, 0);
    out->cos_n = 1;
    if (l->kind == PT_LIGHT_AREA) {
        pti_le_area(scene, l, u_p, u_w, u_side, out);
    } else if (l->kind == PT_LIGHT_POINT || l->kind == PT_LIGHT_SPOT) {
        out->p = l->position;
        out->w = pt_warp_sphere(u_w);
        if (l->kind == PT_LIGHT_SPOT) {
            frame = pt_frame_from_normal(l->direction);
            out->w = pt_frame_to_world(&frame, pt_warp_cone(u_w, l->omc_end));
            out->radiance = pti_intensity(l, out->w);
        }
    } else {
        pti_le_infinite(scene, l, u_p, u_w, out);
    }
    pt_light_pdf_le(scene, light, out->n, out->w, &out->pdf_a, &out->pdf_w);
    return out->pdf_w > 0;
}

PTDEF void pt_light_pdf_le(const pt_scene *scene, int light, pt_vec3 n, pt_vec3 w, double *pdf_a, double *pdf_w)
{
    const pt_light *l = &scene->lights[light];
    double r = pti_scene_radius(scene), c = (double)pt_v3_dot(n, w);
    *pdf_a = 1;
    *pdf_w = (double)pt_warp_sphere_pdf_w();
    switch (l->kind) {
    case PT_LIGHT_POINT: return;
    case PT_LIGHT_SPOT: *pdf_w = pti_in_spot(l, w) ? pt_warp_cone_pdf_w(l->omc_end) : 0; return;
    case PT_LIGHT_DIRECTIONAL: *pdf_w = 1; break;
    case PT_LIGHT_ENVIRONMENT:
#if PTI_HAS_ENVIRONMENT
        *pdf_w = pti_environment_pdf_w(scene, pt_v3_neg(w));
#endif
        break;
    case PT_LIGHT_AREA:
        *pdf_a = 1 / l->area;
        if (scene->primitives[l->primitive].shape == PT_SHAPE_SPHERE) *pdf_w = fabs(c) / (2 * PT_PI); /* both sides */
        else *pdf_w = fmax(0, c) / PT_PI;
        return;
    }
    *pdf_a = 1 / (PT_PI * r * r);
}

PTDEF pt_rgb pt_hit_emission(const pt_scene *scene, const pt_hit *hit, pt_vec3 wo)
{
    if (hit->light < 0) return pt_rgb_grey(0);
    if (hit->shape != PT_SHAPE_SPHERE && !(pt_v3_dot(wo, hit->ng) > 0)) return pt_rgb_grey(0);
    return scene->materials[hit->material].emission;
}

/* =====================================================================================================
   [PT-10] SCENE, CAMERA, FILM: implementation
   ===================================================================================================== */

/* --- text without stdio and without a locale --- */

/* Appends to a string in a buffer of `size` bytes; what does not fit is cut. */
static void pti_append(char *buffer, size_t size, const char *text)
{
    size_t n = strlen(buffer);
    while (*text && n + 1 < size) buffer[n++] = *text++;
    buffer[n] = 0;
}

static void pti_append_integer(char *buffer, size_t size, uint64_t value)
{
    char digits[24];
    int i = 23;
    digits[i] = 0;
    do {
        digits[--i] = (char)('0' + (int)(value % 10));
        value /= 10;
    } while (value);
    pti_append(buffer, size, digits + i);
}

/* Up to six significant digits, as %g would print in the C locale; whole numbers as they are. */
static void pti_append_real(char *buffer, size_t size, double x)
{
    char text[40] = "";
    uint64_t m;
    int e, digits = 6, i;
    if (!pti_finite(x)) {
        pti_append(buffer, size, x != x ? "nan" : x < 0 ? "-inf" : "inf");
        return;
    }
    if (x < 0) pti_append(buffer, size, "-");
    x = fabs(x);
    if (x < 1e15 && x == floor(x)) { /* whole numbers keep all their digits */
        pti_append_integer(buffer, size, (uint64_t)x);
        return;
    }
    e = x > 0 ? (int)floor(log10(x)) : 0;
    m = (uint64_t)(x / pow(10, e) * 1e5 + 0.5); /* d.ddddd as an integer */
    if (m >= 1000000) {
        m /= 10;
        e++;
    }
    while (digits > 1 && m % 10 == 0) {
        m /= 10;
        digits--;
    }
    if (e < -4 || e >= 6) { /* d.ddde+-x */
        pti_append_integer(text, sizeof text, m);
        if (digits > 1) {
            memmove(text + 2, text + 1, (size_t)digits);
            text[1] = '.';
        }
        pti_append(text, sizeof text, e < 0 ? "e-" : "e");
        pti_append_integer(text, sizeof text, (uint64_t)(e < 0 ? -e : e));
    } else if (e < 0) { /* 0.000ddd */
        pti_append(text, sizeof text, "0.");
        for (i = -1; i > e; i--) pti_append(text, sizeof text, "0");
        pti_append_integer(text, sizeof text, m);
    } else { /* ddd.ddd */
        for (i = digits; i <= e; i++) m *= 10;
        pti_append_integer(text, sizeof text, m);
        if (digits > e + 1) {
            memmove(text + e + 2, text + e + 1, (size_t)(digits - e));
            text[e + 1] = '.';
        }
    }
    pti_append(buffer, size, text);
}

/* --- scene --- */

/* Keeps the first error: "<item> <number>: <what>". Returns -1 for the pt_add_x. */
static int pti_scene_fail(pt_scene *scene, pt_result result, const char *item, uint32_t number, const char *what)
{
    if (scene->error != PT_OK) return -1;
    scene->error = result;
    scene->error_text[0] = 0;
    pti_append(scene->error_text, sizeof scene->error_text, item);
    pti_append(scene->error_text, sizeof scene->error_text, " ");
    pti_append_integer(scene->error_text, sizeof scene->error_text, number);
    pti_append(scene->error_text, sizeof scene->error_text, ": ");
    pti_append(scene->error_text, sizeof scene->error_text, what);
    return -1;
}

/* The same about a value: "<item> <number>: <name> <value> <what>". */
static int pti_scene_fail_value(pt_scene *scene, const char *item, uint32_t number, const char *name, double value,
                                const char *what)
{
    char text[120] = "";
    pti_append(text, sizeof text, name);
    pti_append(text, sizeof text, " ");
    pti_append_real(text, sizeof text, value);
    pti_append(text, sizeof text, " ");
    pti_append(text, sizeof text, what);
    return pti_scene_fail(scene, PT_ERROR_SCENE, item, number, text);
}

static int pti_scene_no_memory(pt_scene *scene, const char *item, uint32_t number)
{
    return pti_scene_fail(scene, PT_ERROR_MEMORY, item, number, "out of memory");
}

/* Appends one element to an array of the scene; its index, or -1. */
#define PTI_PUSH(scene, item, array, number, capacity, value) \
    (pti_reserve(&(scene)->array, &(scene)->capacity, (size_t)(scene)->number + 1, sizeof *(scene)->array, \
                 (scene)->alloc_user) \
         ? ((scene)->array[(scene)->number] = (value), (scene)->committed = 0, (int)(scene)->number++) \
         : pti_scene_no_memory(scene, item, (scene)->number))

/* The value that is out of range in v, or 0 and *bad = 0. */
static int pti_coordinate_bad(pt_vec3 v, double *bad)
{
    const double c[3] = {(double)v.x, (double)v.y, (double)v.z};
    int k;
    for (k = 0; k < 3; k++)
        if (!(fabs(c[k]) <= PT_MAX_COORDINATE)) {
            *bad = c[k];
            return 1;
        }
    return 0;
}

static int pti_check_coordinates(pt_scene *scene, const char *item, uint32_t number, const pt_vec3 *v, uint32_t count)
{
    double bad;
    uint32_t i;
    for (i = 0; i < count; i++)
        if (pti_coordinate_bad(v[i], &bad)) {
            pti_scene_fail_value(scene, item, number, "coordinate", bad, "is not finite or beyond 1e18");
            return 0;
        }
    return 1;
}

static int pti_check_material_id(pt_scene *scene, const char *item, uint32_t number, int material)
{
    if (material >= 0 && (uint32_t)material < scene->material_count) return 1;
    pti_scene_fail_value(scene, item, number, "material", (double)material, "does not exist");
    return 0;
}

/* Each band in [0, max]. */
static int pti_check_rgb(pt_scene *scene, const char *item, uint32_t number, const char *name, pt_rgb c, double max)
{
    const double v[3] = {(double)c.r, (double)c.g, (double)c.b};
    int k;
    for (k = 0; k < 3; k++)
        if (!(v[k] >= 0 && v[k] <= max) || !pti_finite(v[k])) {
            pti_scene_fail_value(scene, item, number, name, v[k], max > 1 ? "is negative or not finite" : "is outside [0,1]");
            return 0;
        }
    return 1;
}

/* Can a picture of this size be held: up to 65536 pixels a side, and its bytes in a size_t? */
static int pti_pixels_fit(int width, int height)
{
    return width >= 1 && height >= 1 && width <= 65536 && height <= 65536 && (uint64_t)width * (uint64_t)height <= SIZE_MAX / (3 * sizeof(double));
}

#if PTI_HAS_TEXTURES || PTI_HAS_ENVIRONMENT
/* 1 if every value is finite and not negative. */
static int pti_check_pixels(pt_scene *scene, const char *item, uint32_t number, const float *rgb, size_t count, double max)
{
    size_t i;
    for (i = 0; i < count; i++)
        if (!(rgb[i] >= 0 && (double)rgb[i] <= max) || !pti_finite((double)rgb[i])) {
            pti_scene_fail_value(scene, item, number, "pixel value", (double)rgb[i], max > 1 ? "is negative or not finite" : "is outside [0,1]");
            return 0;
        }
    return 1;
}
#endif

/* The switch that left a material out, NULL if none did. */
static const char *pti_material_left_out(const pt_material *m)
{
    switch (m->kind) {
    case PT_MATERIAL_CONDUCTOR:
    case PT_MATERIAL_OREN_NAYAR: return PTI_HAS_MICROFACET ? NULL : "conductors and Oren-Nayar were left out: PT_NO_MICROFACET";
    case PT_MATERIAL_DIELECTRIC: return PTI_HAS_MICROFACET || pti_is_smooth(m) ? NULL : "rough glass was left out: PT_NO_MICROFACET";
    case PT_MATERIAL_PHONG:
    case PT_MATERIAL_BLINN: return PTI_HAS_PHONG ? NULL : "Phong and Blinn-Phong were left out: PT_NO_PHONG";
    case PT_MATERIAL_COAT: return PTI_HAS_COAT ? NULL : "coats were left out: PT_NO_COAT";
    case PT_MATERIAL_MEASURED: return PTI_HAS_MEASURED ? NULL : "measured tables were left out: PT_NO_MEASURED";
    default: return NULL;
    }
}

/* What the kinds ask of their own parameters. */
static int pti_check_kind(pt_scene *scene, uint32_t n, const pt_material *m)
{
    pt_rgb sum = pt_rgb_add(m->albedo, m->specular);
    double most = fmax((double)sum.r, fmax((double)sum.g, (double)sum.b));
    if (m->kind == PT_MATERIAL_PHONG || m->kind == PT_MATERIAL_BLINN) {
        if (!pti_check_rgb(scene, "material", n, "specular", m->specular, 1)) return 0;
        if (most > 1 + 2 * PTI_UNIT_ROUNDOFF) return !pti_scene_fail_value(scene, "material", n, "albedo + specular", most, "is above 1");
        if (!(m->exponent >= 0 && (double)m->exponent <= 1e6))
            return !pti_scene_fail_value(scene, "material", n, "exponent", (double)m->exponent, "is outside [0, 1e6]");
    }
    if (m->kind == PT_MATERIAL_COAT && !(pti_ior(m) > 1))
        return !pti_scene_fail_value(scene, "material", n, "ior", (double)m->ior, "of a coat is not above 1");
    if (m->kind == PT_MATERIAL_CONDUCTOR) {
        if (!pti_check_rgb(scene, "material", n, "eta", m->eta, HUGE_VAL) || !pti_check_rgb(scene, "material", n, "k", m->k, HUGE_VAL)) return 0;
        if (!(m->eta.r > 0 && m->eta.g > 0 && m->eta.b > 0)) return !pti_scene_fail(scene, PT_ERROR_SCENE, "material", n, "eta is not positive");
    }
#if PTI_HAS_MEASURED
    if (m->kind == PT_MATERIAL_MEASURED && !(m->measured && m->measured->value))
        return !pti_scene_fail(scene, PT_ERROR_SCENE, "material", n, "has no measured table");
#endif
    return 1;
}

#if PTI_HAS_TEXTURES
static int pti_check_texture(pt_scene *scene, uint32_t n, const pt_texture *t)
{
    if ((int)t->kind < 0 || t->kind > PT_TEXTURE_FUNCTION)
        return !pti_scene_fail_value(scene, "material", n, "texture kind", (double)t->kind, "is unknown");
    if (!pti_finite((double)t->scale.x) || !pti_finite((double)t->scale.y))
        return !pti_scene_fail(scene, PT_ERROR_SCENE, "material", n, "texture scale is not finite");
    if (t->kind == PT_TEXTURE_CHECKER)
        return pti_check_rgb(scene, "material", n, "texture a", t->a, 1) && pti_check_rgb(scene, "material", n, "texture b", t->b, 1);
    if (t->kind == PT_TEXTURE_FUNCTION) return t->function ? 1 : !pti_scene_fail(scene, PT_ERROR_SCENE, "material", n, "texture has no function");
    if (!t->rgb || !pti_pixels_fit(t->width, t->height))
        return !pti_scene_fail(scene, PT_ERROR_SCENE, "material", n, "texture image is empty or larger than 65536 x 65536");
    return pti_check_pixels(scene, "material", n, t->rgb, 3 * (size_t)t->width * (size_t)t->height, 1);
}
#endif

PTDEF int pt_add_material(pt_scene *scene, pt_material material)
{
    uint32_t n = scene->material_count;
    const char *left_out;
    if ((int)material.kind < 0 || material.kind > PT_MATERIAL_MEASURED)
        return pti_scene_fail_value(scene, "material", n, "kind", (double)material.kind, "is unknown");
    if (!pti_check_rgb(scene, "material", n, "albedo", material.albedo, 1)) return -1;
    if (!pti_check_rgb(scene, "material", n, "emission", material.emission, HUGE_VAL)) return -1;
    if (!(material.ior >= 0) || !pti_finite((double)material.ior))
        return pti_scene_fail_value(scene, "material", n, "ior", (double)material.ior, "is negative or not finite");
    if (!(material.roughness >= 0 && material.roughness <= 1))
        return pti_scene_fail_value(scene, "material", n, "roughness", (double)material.roughness, "is outside [0,1]");
    left_out = pti_material_left_out(&material);
    if (left_out) return pti_scene_fail(scene, PT_ERROR_LEFT_OUT, "material", n, left_out);
    if (!pti_check_kind(scene, n, &material)) return -1;
#if PTI_HAS_TEXTURES
    if (material.texture && !pti_check_texture(scene, n, material.texture)) return -1;
#endif
    if (material.medium_inside != 0 || material.medium_outside != 0)
        return pti_scene_fail(scene, PT_ERROR_LEFT_OUT, "material", n, "media need a volumetric method");
    return PTI_PUSH(scene, "material", materials, material_count, material_capacity, material);
}

/* Is the data of a mesh in order? */
static int pti_check_mesh(pt_scene *scene, const char *item, uint32_t n, const pt_vec3 *positions, const pt_vec3 *normals,
                          const pt_vec2 *uvs, uint32_t vertex_count, const uint32_t *indices, uint32_t triangle_count)
{
    uint32_t i;
    if (vertex_count > 0x7fffffffu - scene->position_count || triangle_count > 0x2aaaaaaau - scene->triangle_count)
        return !pti_scene_fail(scene, PT_ERROR_ARGUMENT, item, n, "too many vertices or triangles");
    if ((!positions && vertex_count) || (!indices && triangle_count))
        return !pti_scene_fail(scene, PT_ERROR_ARGUMENT, item, n, "positions or indices are NULL");
    if (!pti_check_coordinates(scene, item, n, positions, vertex_count)) return 0;
    if (normals && !pti_check_coordinates(scene, item, n, normals, vertex_count)) return 0;
    for (i = 0; normals && i < vertex_count; i++)
        if (normals[i].x == 0 && normals[i].y == 0 && normals[i].z == 0)
            return !pti_scene_fail_value(scene, item, n, "normal", (double)i, "is zero");
    for (i = 0; uvs && i < vertex_count; i++)
        if (!pti_finite((double)uvs[i].x) || !pti_finite((double)uvs[i].y))
            return !pti_scene_fail_value(scene, item, n, "texture coordinate", (double)i, "is not finite");
    for (i = 0; i < 3 * triangle_count; i++)
        if (indices[i] >= vertex_count)
            return !pti_scene_fail_value(scene, item, n, "index", (double)indices[i], "is beyond the vertices");
    return 1;
}

/* Adds a mesh that error messages call `item` number n. */
static int pti_add_mesh(pt_scene *scene, const char *item, uint32_t n, const pt_vec3 *positions, const pt_vec3 *normals,
                        const pt_vec2 *uvs, uint32_t vertex_count, const uint32_t *indices, uint32_t triangle_count, int material)
{
    uint32_t base = scene->position_count, i;
    void *user = scene->alloc_user;
    pt_mesh mesh;
    int id = (int)scene->mesh_count;
    if (!pti_check_material_id(scene, item, n, material)) return -1;
    if (!pti_check_mesh(scene, item, n, positions, normals, uvs, vertex_count, indices, triangle_count)) return -1;
    if (!pti_reserve(&scene->positions, &scene->position_capacity, (size_t)base + vertex_count, sizeof *positions, user) ||
        !pti_reserve(&scene->triangles, &scene->triangle_capacity, (size_t)scene->triangle_count + triangle_count,
                     sizeof *scene->triangles, user) ||
        (normals && !pti_reserve(&scene->normals, &scene->normal_capacity, (size_t)scene->normal_count + vertex_count,
                                 sizeof *normals, user)) ||
        (uvs && !pti_reserve(&scene->uvs, &scene->uv_capacity, (size_t)scene->uv_count + vertex_count, sizeof *uvs, user)))
        return pti_scene_no_memory(scene, item, n);
    mesh.has_normals = normals != NULL;
    mesh.has_uvs = uvs != NULL;
    mesh.normal_offset = (int64_t)scene->normal_count - base;
    mesh.uv_offset = (int64_t)scene->uv_count - base;
    if (PTI_PUSH(scene, item, meshes, mesh_count, mesh_capacity, mesh) < 0) return -1;
    for (i = 0; i < vertex_count; i++) {
        scene->positions[scene->position_count++] = positions[i];
        if (normals) scene->normals[scene->normal_count++] = normals[i];
        if (uvs) scene->uvs[scene->uv_count++] = uvs[i];
    }
    for (i = 0; i < triangle_count; i++) {
        pt_triangle *t = &scene->triangles[scene->triangle_count++];
        t->v[0] = base + indices[3 * (size_t)i];
        t->v[1] = base + indices[3 * (size_t)i + 1];
        t->v[2] = base + indices[3 * (size_t)i + 2];
        t->material = material;
        t->mesh = id;
    }
    return id;
}

PTDEF int pt_add_mesh(pt_scene *scene, const pt_vec3 *positions, const pt_vec3 *normals, const pt_vec2 *uvs,
                      uint32_t vertex_count, const uint32_t *indices, uint32_t triangle_count, int material)
{
    return pti_add_mesh(scene, "mesh", scene->mesh_count, positions, normals, uvs, vertex_count, indices, triangle_count, material);
}

PTDEF int pt_add_triangle(pt_scene *scene, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2, int material)
{
    static const uint32_t indices[3] = {0, 1, 2};
    const pt_vec3 v[3] = {v0, v1, v2};
    int id = (int)scene->triangle_count;
    return pti_add_mesh(scene, "triangle", (uint32_t)id, v, NULL, NULL, 3, indices, 1, material) < 0 ? -1 : id;
}

PTDEF int pt_add_quad(pt_scene *scene, pt_vec3 v0, pt_vec3 v1, pt_vec3 v2, pt_vec3 v3, int material)
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    const pt_vec3 v[4] = {v0, v1, v2, v3};
    int id = (int)scene->triangle_count;
    return pti_add_mesh(scene, "quad of triangle", (uint32_t)id, v, NULL, NULL, 4, indices, 2, material) < 0 ? -1 : id;
}

PTDEF int pt_add_parallelogram(pt_scene *scene, pt_vec3 corner, pt_vec3 edge1, pt_vec3 edge2, int material)
{
    uint32_t n = scene->parallelogram_count;
    const pt_parallelogram p = {corner, edge1, edge2, material};
    const pt_vec3 v[3] = {corner, edge1, edge2};
    if (!pti_check_coordinates(scene, "parallelogram", n, v, 3)) return -1;
    if (!pti_check_material_id(scene, "parallelogram", n, material)) return -1;
    return PTI_PUSH(scene, "parallelogram", parallelograms, parallelogram_count, parallelogram_capacity, p);
}

PTDEF int pt_add_sphere(pt_scene *scene, pt_vec3 centre, pt_real radius, int material)
{
    uint32_t n = scene->sphere_count;
    const pt_sphere s = {centre, radius, material};
    if (!pti_check_coordinates(scene, "sphere", n, &centre, 1)) return -1;
    if (!(radius > 0 && (double)radius <= PT_MAX_COORDINATE))
        return pti_scene_fail_value(scene, "sphere", n, "radius", (double)radius, "is not in (0, 1e18]");
    if (!pti_check_material_id(scene, "sphere", n, material)) return -1;
    return PTI_PUSH(scene, "sphere", spheres, sphere_count, sphere_capacity, s);
}

static int pti_add_delta_light(pt_scene *scene, const char *item, const pt_delta_light *l)
{
    uint32_t n = scene->delta_light_count;
    if (!pti_check_coordinates(scene, item, n, &l->position, 1) || !pti_check_coordinates(scene, item, n, &l->direction, 1)) return -1;
    if (!pti_check_rgb(scene, item, n, "intensity", l->intensity, HUGE_VAL)) return -1;
    if (l->kind != PT_LIGHT_POINT && !(pt_v3_dot(l->direction, l->direction) > PTI_R(0.5)))
        return pti_scene_fail(scene, PT_ERROR_SCENE, item, n, "its direction is zero");
    if (l->kind == PT_LIGHT_SPOT && !(l->omc_start < l->omc_end))
        return pti_scene_fail(scene, PT_ERROR_SCENE, item, n, "its angles are not 0 <= start < end <= 180 degrees");
    return PTI_PUSH(scene, item, delta_lights, delta_light_count, delta_light_capacity, *l);
}

static pt_delta_light pti_delta_light(pt_light_kind kind, pt_vec3 position, pt_vec3 direction, pt_rgb intensity)
{
    pt_delta_light l;
    memset(&l, 0, sizeof l);
    l.kind = kind;
    l.position = position;
    l.direction = pt_v3_normalize(direction);
    l.intensity = intensity;
    return l;
}

PTDEF int pt_add_point_light(pt_scene *scene, pt_vec3 position, pt_rgb intensity)
{
    pt_delta_light l = pti_delta_light(PT_LIGHT_POINT, position, pt_v3(0, 0, 0), intensity);
    return pti_add_delta_light(scene, "point light", &l);
}

PTDEF int pt_add_spot_light(pt_scene *scene, pt_vec3 position, pt_vec3 direction, pt_rgb intensity, double start_deg,
                            double end_deg)
{
    pt_delta_light l = pti_delta_light(PT_LIGHT_SPOT, position, direction, intensity);
    int ok = start_deg >= 0 && start_deg < end_deg && end_deg <= 180;
    if (ok) {
        double a = sin(start_deg * (PT_PI / 360)), b = sin(end_deg * (PT_PI / 360));
        l.omc_start = 2 * a * a;
        l.omc_end = 2 * b * b;
    }
    return pti_add_delta_light(scene, "spot light", &l);
}

PTDEF int pt_add_directional_light(pt_scene *scene, pt_vec3 direction, pt_rgb irradiance)
{
    pt_delta_light l = pti_delta_light(PT_LIGHT_DIRECTIONAL, pt_v3(0, 0, 0), direction, irradiance);
    return pti_add_delta_light(scene, "directional light", &l);
}

#if PTI_HAS_ENVIRONMENT
static void pti_map_free(pt_scene *scene)
{
    pti_free(scene->map.rgb, scene->alloc_user);
    pti_free(scene->map.rows, scene->alloc_user);
    pti_free(scene->map.columns, scene->alloc_user);
    memset(&scene->map, 0, sizeof scene->map);
}

PTDEF int pt_set_environment(pt_scene *scene, pt_rgb radiance)
{
    if (!pti_check_rgb(scene, "environment", 0, "radiance", radiance, HUGE_VAL)) return -1;
    pti_map_free(scene);
    scene->environment = radiance;
    scene->committed = 0;
    return 0;
}

/* Turns the weights w[1..count] into a cumulative list from 0 to 1, evenly where all are 0; their sum. */
static double pti_accumulate(double *w, int count)
{
    double sum = 0;
    int i;
    w[0] = 0;
    for (i = 1; i <= count; i++) w[i] = sum += w[i];
    for (i = 1; i <= count; i++) w[i] = sum > 0 ? w[i] / sum : (double)i / count;
    w[count] = 1;
    return sum;
}

/* The distribution of a map's light, and its mean radiance over the sphere. */
static pt_rgb pti_map_finish(pt_environment_map *m)
{
    pt_rgbd mean = pt_rgbd3(0, 0, 0);
    int x, y;
    for (y = 0; y < m->height; y++) {
        double *columns = m->columns + (size_t)y * ((size_t)m->width + 1), w = pti_map_solid_angle(m, y);
        for (x = 0; x < m->width; x++) {
            pt_rgb c = pti_map_value(m, x, y);
            columns[x + 1] = pt_luminance((double)c.r, (double)c.g, (double)c.b);
            mean = pt_rgbd3(mean.r + w * (double)c.r, mean.g + w * (double)c.g, mean.b + w * (double)c.b);
        }
        m->rows[y + 1] = pti_accumulate(columns, m->width) * w;
    }
    pti_accumulate(m->rows, m->height);
    return pt_rgb3((pt_real)(mean.r / (4 * PT_PI)), (pt_real)(mean.g / (4 * PT_PI)), (pt_real)(mean.b / (4 * PT_PI)));
}

PTDEF int pt_set_environment_image(pt_scene *scene, const float *rgb, int width, int height, double scale)
{
    pt_environment_map m;
    size_t pixels;
    if (!rgb || !pti_pixels_fit(width, height))
        return pti_scene_fail(scene, PT_ERROR_ARGUMENT, "environment", 0, "the image is empty or larger than 65536 x 65536");
    if (!(scale >= 0) || !pti_finite(scale)) return pti_scene_fail_value(scene, "environment", 0, "scale", scale, "is negative or not finite");
    pixels = (size_t)width * (size_t)height;
    if (!pti_check_pixels(scene, "environment", 0, rgb, 3 * pixels, scale > 1 ? (double)PTI_REAL_MAX / scale : HUGE_VAL)) return -1;
    pti_map_free(scene);
    m.width = width;
    m.height = height;
    m.scale = scale;
    m.rgb = (float *)pti_alloc(3 * pixels, sizeof *m.rgb, scene->alloc_user);
    m.rows = (double *)pti_alloc((size_t)height + 1, sizeof *m.rows, scene->alloc_user);
    m.columns = (double *)pti_alloc((size_t)height * ((size_t)width + 1), sizeof *m.columns, scene->alloc_user);
    scene->map = m;
    if (!m.rgb || !m.rows || !m.columns) {
        pti_map_free(scene);
        return pti_scene_no_memory(scene, "environment", 0);
    }
    memcpy(m.rgb, rgb, 3 * pixels * sizeof *rgb);
    scene->environment = pti_map_finish(&scene->map);
    scene->committed = 0;
    return 0;
}
#endif

/* Its area; that of a parallelogram is the one of its edges. */
static double pti_primitive_area(const pt_scene *scene, const pt_primitive *p)
{
    pt_vec3 v[4];
    double area;
    int corners;
    if (p->shape == PT_SHAPE_SPHERE) {
        const double r = (double)scene->spheres[p->index].radius;
        return 4 * PT_PI * r * r;
    }
    corners = pti_corners(scene, p, v);
    area = pti_d_length(pti_d_cross(pti_d_between(v[0], v[1]), pti_d_between(v[0], v[3])));
    return corners == 3 ? area / 2 : area;
}

/* Appends a primitive, unless it has no area (or one of a parallelogram's rounded halves has none). */
static void pti_add_primitive(pt_scene *scene, pt_shape shape, uint32_t index)
{
    const pt_primitive p = {shape, index, -1};
    pt_vec3 v[4];
    int corners = shape == PT_SHAPE_SPHERE ? 0 : pti_corners(scene, &p, v);
    if ((corners >= 3 && !pti_triangle_has_area(v[0], v[1], v[2])) || (corners == 4 && !pti_triangle_has_area(v[0], v[2], v[3])))
        scene->degenerate_count++;
    else scene->primitives[scene->primitive_count++] = p;
}

/* The list of all primitives that can be hit. */
static int pti_commit_primitives(pt_scene *scene)
{
    size_t count = (size_t)scene->triangle_count + scene->parallelogram_count + scene->sphere_count;
    uint32_t i;
    if (count > 0x7fffffffu) return 0;
    scene->primitives = (pt_primitive *)pti_alloc(count, sizeof *scene->primitives, scene->alloc_user);
    if (!scene->primitives) return 0;
    for (i = 0; i < scene->triangle_count; i++) pti_add_primitive(scene, PT_SHAPE_TRIANGLE, i);
    for (i = 0; i < scene->parallelogram_count; i++) pti_add_primitive(scene, PT_SHAPE_PARALLELOGRAM, i);
    for (i = 0; i < scene->sphere_count; i++) pti_add_primitive(scene, PT_SHAPE_SPHERE, i);
    return 1;
}

/* Up to this many primitives are tested one by one: there a tree does not pay (make bench). */
#define PTI_LINEAR_MAX 4

static void pti_find_bounds(pt_scene *scene)
{
    uint32_t i;
    pti_primitive_box(scene, &scene->primitives[0], &scene->lo, &scene->hi);
    for (i = 1; i < scene->primitive_count; i++) {
        pt_vec3 lo, hi;
        pti_primitive_box(scene, &scene->primitives[i], &lo, &hi);
        scene->lo = pti_lower(lo, scene->lo);
        scene->hi = pti_upper(hi, scene->hi);
    }
}

#if PTI_HAS_BVH
/* Widens a box by what rounding the origin of a ray that starts in the scene may move it: u times the largest
   coordinate, and as much for each of the two roundings here. */
static void pti_widen(const pt_scene *scene, pt_vec3 *lo, pt_vec3 *hi)
{
    const pt_vec3 a = scene->lo, b = scene->hi;
    const pt_vec3 e = pt_v3((pt_real)(3 * PTI_UNIT_ROUNDOFF * fmax(fabs((double)a.x), fabs((double)b.x))),
                            (pt_real)(3 * PTI_UNIT_ROUNDOFF * fmax(fabs((double)a.y), fabs((double)b.y))),
                            (pt_real)(3 * PTI_UNIT_ROUNDOFF * fmax(fabs((double)a.z), fabs((double)b.z))));
    *lo = pt_v3_sub(*lo, e);
    *hi = pt_v3_add(*hi, e);
}

static int pti_commit_binary(pt_scene *scene)
{
    const uint32_t n = scene->primitive_count;
    pt_vec3 *boxes = (pt_vec3 *)pti_alloc(2 * (size_t)n, sizeof *boxes, scene->alloc_user);
    uint32_t i;
    int ok = boxes != NULL;
    for (i = 0; ok && i < n; i++) {
        pti_primitive_box(scene, &scene->primitives[i], &boxes[i], &boxes[n + i]);
        pti_widen(scene, &boxes[i], &boxes[n + i]);
    }
    ok = ok && pt_bvh_build(&scene->bvh, boxes, boxes + n, n, scene->alloc_user) == PT_OK;
    pti_free(boxes, scene->alloc_user);
    return ok;
}
#endif

/* Bounds and a tree, if it pays. */
static int pti_commit_tree(pt_scene *scene)
{
    const int wanted = scene->primitive_count > PTI_LINEAR_MAX && scene->tree != PT_TREE_NONE;
    if (scene->primitive_count > 0) pti_find_bounds(scene);
#if PTI_HAS_WIDE
    if (wanted && scene->tree == PT_TREE_DEFAULT) {
        const int built = pti_build_wide(scene, &scene->wide);
        if (built >= 0) return built;
    }
#endif
#if PTI_HAS_BVH
    if (wanted) return pti_commit_binary(scene);
#endif
    (void)wanted;
    return 1;
}

/* Power of a light for its share of the samples: pi A L seen from one side, 4 pi I, that of a spot; from infinity
   what enters the sphere around the scene: E times its cross-section, pi L times its area. */
static double pti_light_power(const pt_scene *scene, const pt_light *l)
{
    double r = pti_scene_radius(scene);
    double mean = ((double)l->emission.r + (double)l->emission.g + (double)l->emission.b) / 3;
    if (l->kind == PT_LIGHT_AREA) return PT_PI * l->area * mean;
    if (l->kind == PT_LIGHT_POINT) return pt_flux_point(mean);
    if (l->kind == PT_LIGHT_SPOT) return pt_flux_spot(mean, 1 - l->omc_start, 1 - l->omc_end);
    if (l->kind == PT_LIGHT_DIRECTIONAL) return PT_PI * r * r * mean;
    return PT_PI * mean * 4 * PT_PI * r * r;
}

static void pti_collect_lights(pt_scene *scene)
{
    uint32_t i;
    pt_light l;
    for (i = 0; i < scene->primitive_count; i++) {
        pt_primitive *p = &scene->primitives[i];
        memset(&l, 0, sizeof l);
        l.emission = scene->materials[pti_primitive_material(scene, p)].emission;
        if (pti_rgb_black(l.emission)) continue;
        l.primitive = (int)i;
        l.area = pti_primitive_area(scene, p);
        p->light = (int)scene->light_count;
        scene->lights[scene->light_count++] = l;
    }
    for (i = 0; i < scene->delta_light_count; i++) {
        memset(&l, 0, sizeof l);
        l.kind = scene->delta_lights[i].kind;
        l.primitive = -1;
        l.position = scene->delta_lights[i].position;
        l.direction = scene->delta_lights[i].direction;
        l.omc_start = scene->delta_lights[i].omc_start;
        l.omc_end = scene->delta_lights[i].omc_end;
        l.emission = scene->delta_lights[i].intensity;
        if (!pti_rgb_black(l.emission)) scene->lights[scene->light_count++] = l;
    }
    if (PTI_HAS_ENVIRONMENT && !pti_rgb_black(scene->environment)) {
        memset(&l, 0, sizeof l);
        l.kind = PT_LIGHT_ENVIRONMENT;
        l.primitive = -1;
        l.emission = scene->environment;
        scene->environment_light = (int)scene->light_count;
        scene->lights[scene->light_count++] = l;
    }
}

static int pti_commit_lights(pt_scene *scene)
{
    size_t most = (size_t)scene->primitive_count + scene->delta_light_count + 1;
    double *power;
    uint32_t i;
    int ok;
    scene->lights = (pt_light *)pti_alloc(most, sizeof *scene->lights, scene->alloc_user);
    power = (double *)pti_alloc(most, sizeof *power, scene->alloc_user);
    ok = scene->lights && power;
    if (ok) {
        pti_collect_lights(scene);
        for (i = 0; i < scene->light_count; i++) power[i] = pti_light_power(scene, &scene->lights[i]);
        ok = pt_alias_make(&scene->light_table, power, scene->light_count, scene->alloc_user) == PT_OK;
        for (i = 0; ok && i < scene->light_table.count; i++) scene->lights[i].pmf = scene->light_table.entries[i].pmf;
    }
    pti_free(power, scene->alloc_user);
    return ok;
}

static unsigned pti_find_needs(const pt_scene *scene)
{
    unsigned needs = 0;
    uint32_t i;
    for (i = 0; i < scene->primitive_count; i++) {
        const pt_primitive *p = &scene->primitives[i];
        const pt_material *m = &scene->materials[pti_primitive_material(scene, p)];
        needs |= (unsigned)PT_NEEDS_TRIANGLES << p->shape | (unsigned)PT_NEEDS_DIFFUSE << m->kind;
        if ((m->kind == PT_MATERIAL_DIELECTRIC || m->kind == PT_MATERIAL_CONDUCTOR) && !pti_is_smooth(m)) needs |= PT_NEEDS_ROUGHNESS;
#if PTI_HAS_TEXTURES
        if (m->texture) needs |= PT_NEEDS_TEXTURES;
#endif
        if (p->shape == PT_SHAPE_TRIANGLE) {
            const pt_mesh *mesh = &scene->meshes[scene->triangles[p->index].mesh];
            if (mesh->has_normals) needs |= PT_NEEDS_SHADING_NORMALS;
            if (mesh->has_uvs) needs |= PT_NEEDS_UVS;
        }
    }
    for (i = 0; i < scene->light_count; i++) needs |= (unsigned)PT_NEEDS_AREA_LIGHTS << scene->lights[i].kind;
#if PTI_HAS_ENVIRONMENT
    if (scene->environment_light >= 0 && scene->map.rgb) needs |= PT_NEEDS_ENVIRONMENT_IMAGE;
#endif
#if PTI_HAS_BVH
    if (scene->bvh.node_count > 0) needs |= PT_NEEDS_BVH;
#endif
#if PTI_HAS_WIDE
    if (scene->wide.bytes > 0 && scene->wide.plane_blocks + scene->wide.sphere_blocks == 0) needs |= PT_NEEDS_BVH;
#endif
    return needs;
}

/* Frees the blocks that the scene owns, but for the first `keep`. */
static void pti_disown(pt_scene *scene, uint32_t keep)
{
    while (scene->owned_count > keep) pti_free(scene->owned[--scene->owned_count], scene->alloc_user);
}

/* Frees what pt_commit made. */
static void pti_uncommit(pt_scene *scene)
{
    pti_free(scene->primitives, scene->alloc_user);
    pti_free(scene->lights, scene->alloc_user);
    pt_alias_free(&scene->light_table, scene->alloc_user);
#if PTI_HAS_BVH
    pt_bvh_free(&scene->bvh, scene->alloc_user);
#endif
#if PTI_HAS_WIDE
    pti_free(scene->wide.memory, scene->alloc_user);
    memset(&scene->wide, 0, sizeof scene->wide);
#endif
    scene->primitives = NULL;
    scene->lights = NULL;
    scene->primitive_count = scene->light_count = scene->degenerate_count = 0;
    scene->environment_light = -1;
    scene->lo = scene->hi = pt_v3(0, 0, 0);
    scene->needs = 0;
    scene->committed = 0;
}

PTDEF pt_result pt_commit(pt_scene *scene)
{
    if (scene->error != PT_OK) return scene->error;
    pti_uncommit(scene);
    scene->error_text[0] = 0;
    if (!pti_commit_primitives(scene) || !pti_commit_tree(scene) || !pti_commit_lights(scene)) {
        pti_uncommit(scene);
        pti_append(scene->error_text, sizeof scene->error_text, "pt_commit: out of memory");
        return PT_ERROR_MEMORY; /* the scene itself is whole: it may be committed again */
    }
    scene->needs = pti_find_needs(scene);
    scene->committed = 1;
    return PT_OK;
}

PTDEF const char *pt_scene_error(const pt_scene *scene)
{
    return scene->error_text[0] ? scene->error_text : pt_result_string(PT_OK);
}

PTDEF unsigned pt_scene_needs(const pt_scene *scene)
{
    return scene->needs;
}

PTDEF const char *pt_scene_needs_string(const pt_scene *scene, char *buffer, size_t size)
{
    static const char *const names[23] = {"triangles", "parallelograms", "spheres", "shading normals", "texture coordinates",
        "diffuse", "mirror", "dielectric", "conductor", "oren-nayar", "phong", "blinn-phong", "coat", "measured", "roughness",
        "textures", "area lights", "point lights", "spot lights", "directional lights", "environment", "environment image", "tree"};
    int i;
    if (size == 0) return "";
    buffer[0] = 0;
    for (i = 0; i < 23; i++)
        if (scene->needs & (1u << i)) {
            if (buffer[0]) pti_append(buffer, size, ", ");
            pti_append(buffer, size, names[i]);
        }
    return buffer;
}

PTDEF void pt_scene_free(pt_scene *scene)
{
    void *user = scene->alloc_user;
    pti_uncommit(scene);
    pti_disown(scene, 0);
    pti_free(scene->owned, user);
    pti_free(scene->materials, user);
    pti_free(scene->positions, user);
    pti_free(scene->normals, user);
    pti_free(scene->uvs, user);
    pti_free(scene->triangles, user);
    pti_free(scene->meshes, user);
    pti_free(scene->spheres, user);
    pti_free(scene->parallelograms, user);
    pti_free(scene->delta_lights, user);
#if PTI_HAS_ENVIRONMENT
    pti_map_free(scene);
#endif
    memset(scene, 0, sizeof *scene);
    scene->alloc_user = user;
}

/* The nearest hit, or any. */
PTI_INLINE int pti_search(const pt_scene *scene, const pti_ray *r, double tmax, pti_best *best, int any)
{
    int i, n = (int)scene->primitive_count, found = 0;
    best->t = tmax;
    best->u = best->v = 0;
    best->primitive = -1;
#if PTI_HAS_WIDE
    if (scene->wide.bytes > 0 && (found = pti_search_wide(scene, r, best, any)) >= 0) return found;
    found = 0;
#endif
#if PTI_HAS_BVH
    if (scene->bvh.node_count > 0) return pti_traverse(scene, r, best, any);
#endif
    for (i = 0; i < n; i++)
        if (pti_test(scene, r, i, best)) {
            if (any) return 1;
            found = 1;
        }
    return found;
}

static int pti_intersect(const pt_scene *scene, const pti_ray *r, pt_hit *hit)
{
    pti_best best;
    if (!pti_search(scene, r, r->end >= (double)PTI_REAL_MAX ? (double)PTI_REAL_MAX : r->end, &best, 0)) return 0;
    pti_fill(scene, r, &best, hit);
    return 1;
}

static int pti_occluded(const pt_scene *scene, const pti_ray *r)
{
    pti_best best;
    return pti_search(scene, r, r->end >= (double)PTI_REAL_MAX ? (double)PTI_REAL_MAX : r->end, &best, 1);
}

PTDEF int pt_intersect(const pt_scene *scene, const pt_ray *ray, pt_hit *hit)
{
    pti_ray r;
    pti_ray_set_real(&r, ray);
    return pti_intersect(scene, &r, hit);
}

PTDEF int pt_occluded(const pt_scene *scene, const pt_ray *ray)
{
    pti_ray r;
    pti_ray_set_real(&r, ray);
    return pti_occluded(scene, &r);
}

/* --- camera --- */

PTDEF pt_camera pt_camera_look_at(pt_vec3 eye, pt_vec3 target, pt_vec3 up, pt_real vfov_deg)
{
    pt_camera c;
    pti_d3 forward = pti_d_normalize(pti_d_between(eye, target)), right, upward;
    double bad;
    memset(&c, 0, sizeof c);
    right = pti_d_cross(forward, pti_d_normalize(pti_d_from(up)));
    if (!(pti_d_length(right) > 8 * PTI_UNIT_ROUNDOFF)) return c; /* parallel up to rounding, or NaN */
    right = pti_d_normalize(right);
    upward = pti_d_cross(right, forward);
    if (pti_coordinate_bad(eye, &bad) || pti_coordinate_bad(target, &bad)) return c;
    if (!(vfov_deg > 0 && vfov_deg < 180)) return c;
    c.position = eye;
    c.forward = pti_d_to(forward);
    c.right = pti_d_to(right);
    c.up = pti_d_to(upward);
    c.tan_half = (pt_real)tan((double)vfov_deg * (PT_PI / 360));
    c.focus_distance = 1;
    return c;
}

PTDEF double pt_vfov_deg_of_film(double film_height, double focal_length)
{
    return 2 * atan(0.5 * film_height / focal_length) * 180 / PT_PI;
}

PTI_INLINE pt_real pti_focus(const pt_camera *c)
{
    return c->focus_distance > 0 ? c->focus_distance : PTI_R(1);
}

/* A point of the lens. */
PTI_INLINE pt_vec3 pti_lens_point(const pt_camera *c, pt_vec2 lens)
{
    pt_vec2 d;
    if (!(c->lens_radius > 0)) return c->position;
    d = pt_warp_disk(lens);
    return pt_v3_add(c->position, pt_v3_add(pt_v3_scale(c->right, d.x * c->lens_radius), pt_v3_scale(c->up, d.y * c->lens_radius)));
}

PTDEF pt_ray pt_camera_ray(const pt_camera *c, pt_real aspect, pt_real x, pt_real y, pt_vec2 lens)
{
    pt_vec3 d = pt_v3_add(c->forward, pt_v3_add(pt_v3_scale(c->right, (2 * x - 1) * c->tan_half * aspect),
                                                pt_v3_scale(c->up, (1 - 2 * y) * c->tan_half)));
    pt_ray ray;
    ray.o = pti_lens_point(c, lens);
    ray.tmax = PTI_REAL_MAX;
    if (c->lens_radius > 0) /* all rays of an image point meet in the plane in focus */
        d = pt_v3_sub(pt_v3_add(c->position, pt_v3_scale(d, pti_focus(c))), ray.o);
    ray.d = pt_v3_normalize(d);
    if (c->near_distance > 0)
        ray.o = pt_v3_add(ray.o, pt_v3_scale(ray.d, c->near_distance / pt_v3_dot(ray.d, c->forward)));
    return ray;
}

/* Area of the image in a plane at distance 1, and of the lens (1 stands for a pinhole). */
static double pti_image_area(const pt_camera *c, pt_real aspect)
{
    return 4 * (double)c->tan_half * (double)c->tan_half * (double)aspect;
}
static double pti_lens_area(const pt_camera *c)
{
    return c->lens_radius > 0 ? PT_PI * (double)c->lens_radius * (double)c->lens_radius : 1;
}

PTDEF int pt_camera_we(const pt_camera *c, pt_real aspect, pt_vec3 p, pt_vec2 lens, pt_camera_we_result *out)
{
    pti_d3 d, to, forward = pti_d_from(c->forward);
    double z, cos_lens, distance, tan_half = (double)c->tan_half, focus = (double)pti_focus(c), x, y;
    out->lens = pti_lens_point(c, lens);
    d = pti_d_between(out->lens, p);
    z = pti_d_dot(d, forward);
    if (!(z > (double)c->near_distance)) return 0;
    distance = pti_d_length(d);
    cos_lens = z / distance;
    /* where this ray crosses the plane in focus, relative to the centre of the lens */
    to = pti_d_add(pti_d_between(c->position, out->lens), pti_d_scale(d, focus / z));
    x = pti_d_dot(to, pti_d_from(c->right)) / (focus * tan_half * (double)aspect);
    y = pti_d_dot(to, pti_d_from(c->up)) / (focus * tan_half);
    if (!(fabs(x) < 1 && fabs(y) < 1)) return 0;
    out->x = (pt_real)(0.5 + 0.5 * x);
    out->y = (pt_real)(0.5 - 0.5 * y);
    out->wi = pti_d_to(pti_d_scale(d, -1 / distance));
    out->distance = distance;
    out->cos_lens = cos_lens;
    out->we = 1 / (pti_image_area(c, aspect) * pti_lens_area(c) * cos_lens * cos_lens * cos_lens * cos_lens);
    out->pdf_w = distance * distance / (pti_lens_area(c) * cos_lens);
    return 1;
}

PTDEF void pt_camera_pdf(const pt_camera *c, pt_real aspect, pt_vec3 direction, double *pdf_a, double *pdf_w)
{
    double cos_lens = (double)pt_v3_dot(direction, c->forward);
    *pdf_a = 1 / pti_lens_area(c);
    *pdf_w = cos_lens > 0 ? 1 / (pti_image_area(c, aspect) * cos_lens * cos_lens * cos_lens) : 0;
}

static double pti_tent(double u)
{
    return u < 0.5 ? sqrt(2 * u) - 1 : 1 - sqrt(2 * (1 - u));
}

PTDEF pt_vec2 pt_filter_sample(pt_filter filter, double radius, pt_vec2 u)
{
    double r, phi, x = (double)u.x, y = (double)u.y;
    if (filter == PT_FILTER_GAUSSIAN) { /* -2 ln of a uniform number is the square of a radius [PBR] A.4.4 */
        radius = radius > 0 ? radius : 1.5;
        r = radius / 3 * sqrt(-2 * log(1 + x * expm1(-4.5)));
        phi = 2 * PT_PI * y;
        return pt_v2((pt_real)(r * cos(phi)), (pt_real)(r * sin(phi)));
    }
    if (filter == PT_FILTER_TENT) {
        radius = radius > 0 ? radius : 1;
        return pt_v2((pt_real)(radius * pti_tent(x)), (pt_real)(radius * pti_tent(y)));
    }
    radius = radius > 0 ? radius : 0.5;
    return pt_v2((pt_real)(radius * (2 * x - 1)), (pt_real)(radius * (2 * y - 1)));
}

/* --- film --- */

PTDEF void pt_film_free(pt_film *film)
{
    void *user = film->alloc_user;
    int h;
    for (h = 0; h < 2; h++) {
        pti_free(film->half[h], user);
        pti_free(film->splat[h], user);
    }
    pti_free(film->albedo, user);
    pti_free(film->normal, user);
    pti_free(film->depth, user);
    pti_free(film->classes, user);
    pti_free(film->ranges, user);
    memset(film, 0, sizeof *film);
    film->alloc_user = user;
}

PTDEF pt_result pt_film_make(pt_film *film, int width, int height, int aov)
{
    size_t n;
    pt_film_free(film);
    if (width < 1 || height < 1 || width > 65536 || height > 65536) return PT_ERROR_ARGUMENT;
    n = (size_t)width * (size_t)height;
    if (n > SIZE_MAX / (6 * sizeof(double))) return PT_ERROR_MEMORY;
    film->half[0] = (double *)pti_alloc_zero(3 * n, sizeof(double), film->alloc_user);
    film->half[1] = (double *)pti_alloc_zero(3 * n, sizeof(double), film->alloc_user);
    if (aov) {
        film->albedo = (double *)pti_alloc_zero(3 * n, sizeof(double), film->alloc_user);
        film->normal = (double *)pti_alloc_zero(3 * n, sizeof(double), film->alloc_user);
        film->depth = (double *)pti_alloc_zero(n, sizeof(double), film->alloc_user);
    }
    if (!film->half[0] || !film->half[1] || (aov && (!film->albedo || !film->normal || !film->depth))) {
        pt_film_free(film);
        return PT_ERROR_MEMORY;
    }
    film->width = width;
    film->height = height;
    return PT_OK;
}

PTDEF pt_result pt_film_make_classes(pt_film *film, int class_count)
{
    size_t n = 3 * (size_t)film->width * (size_t)film->height;
    if (class_count < 1 || !film->half[0]) return PT_ERROR_ARGUMENT;
    if (n > SIZE_MAX / sizeof(double) / (size_t)class_count) return PT_ERROR_MEMORY;
    pti_free(film->classes, film->alloc_user);
    film->classes = (double *)pti_alloc_zero(n * (size_t)class_count, sizeof(double), film->alloc_user);
    film->class_count = film->classes ? class_count : 0;
    return film->classes ? PT_OK : PT_ERROR_MEMORY;
}

PTDEF pt_result pt_film_class(const pt_film *film, int index, pt_film *out)
{
    size_t n = 3 * (size_t)film->width * (size_t)film->height;
    pt_result result;
    if (index < 0 || index >= film->class_count) return PT_ERROR_ARGUMENT;
    result = pt_film_make(out, film->width, film->height, 0);
    if (result != PT_OK) return result;
    memcpy(out->half[0], film->classes + n * (size_t)index, n * sizeof(double));
    out->samples[0] = film->samples[0] + film->samples[1];
    return PT_OK;
}

PTDEF uint32_t pt_film_spp(const pt_film *film)
{
    return film->samples[0] + film->samples[1];
}

/* Value k (three a pixel) of half h (0, 1, or 2 for both) as a mean. */
static double pti_film_value(const pt_film *film, int h, size_t k)
{
    double sum = 0, n = 0;
    int i;
    for (i = 0; i < 2; i++) {
        if (h != 2 && h != i) continue;
        n += film->samples[i];
        sum += film->half[i][k] + (film->splat[i] ? film->splat[i][k] : 0);
    }
    return n > 0 ? sum / n : 0;
}

PTDEF pt_rgbd pt_film_pixel(const pt_film *film, int x, int y)
{
    size_t k = 3 * ((size_t)y * (size_t)film->width + (size_t)x);
    if (!film->half[0] || x < 0 || y < 0 || x >= film->width || y >= film->height) return pt_rgbd3(0, 0, 0);
    return pt_rgbd3(pti_film_value(film, 2, k), pti_film_value(film, 2, k + 1), pti_film_value(film, 2, k + 2));
}

PTDEF pt_result pt_film_add_range(pt_film *film, uint32_t begin, uint32_t end)
{
    pt_range *r;
    uint32_t i, at;
    if (begin >= end) return PT_ERROR_ARGUMENT;
    for (at = 0; at < film->range_count && film->ranges[at].end <= begin; at++) {}
    for (i = 0; i < film->range_count; i++)
        if (begin < film->ranges[i].end && film->ranges[i].begin < end) return PT_ERROR_MISMATCH;
    if (!pti_reserve(&film->ranges, &film->range_capacity, (size_t)film->range_count + 1, sizeof *film->ranges,
                     film->alloc_user))
        return PT_ERROR_MEMORY;
    r = film->ranges;
    memmove(r + at + 1, r + at, (film->range_count - at) * sizeof *r);
    r[at].begin = begin;
    r[at].end = end;
    film->range_count++;
    for (i = 0; i + 1 < film->range_count;) { /* join neighbours */
        if (r[i].end != r[i + 1].begin) {
            i++;
            continue;
        }
        r[i].end = r[i + 1].end;
        film->range_count--;
        memmove(r + i + 1, r + i + 2, (film->range_count - i - 1) * sizeof *r);
    }
    return PT_OK;
}

static void pti_add_array(double *a, const double *b, size_t n)
{
    size_t i;
    for (i = 0; a && b && i < n; i++) a[i] += b[i];
}

/* Makes the splat layer of one half. */
static int pti_film_need_splat(pt_film *film, int h)
{
    size_t n = 3 * (size_t)film->width * (size_t)film->height;
    if (!film->splat[h]) film->splat[h] = (double *)pti_alloc_zero(n, sizeof(double), film->alloc_user);
    return film->splat[h] != NULL;
}

PTDEF pt_result pt_film_merge(pt_film *a, const pt_film *b)
{
    size_t n = (size_t)a->width * (size_t)a->height;
    pt_film ranges = PT_FILM_INIT; /* only its ranges are used: tried before anything is changed */
    pt_result result = PT_OK;
    uint32_t i;
    int h;
    if (a->width != b->width || a->height != b->height || a->fingerprint != b->fingerprint) return PT_ERROR_MISMATCH;
    if ((a->albedo != NULL) != (b->albedo != NULL) || a->class_count != b->class_count) return PT_ERROR_MISMATCH;
    ranges.alloc_user = a->alloc_user;
    for (i = 0; i < a->range_count && result == PT_OK; i++) result = pt_film_add_range(&ranges, a->ranges[i].begin, a->ranges[i].end);
    for (i = 0; i < b->range_count && result == PT_OK; i++) result = pt_film_add_range(&ranges, b->ranges[i].begin, b->ranges[i].end);
    for (h = 0; h < 2; h++)
        if (result == PT_OK && b->splat[h] && !pti_film_need_splat(a, h)) result = PT_ERROR_MEMORY;
    if (result != PT_OK) {
        pti_free(ranges.ranges, a->alloc_user);
        return result;
    }
    pti_free(a->ranges, a->alloc_user);
    a->ranges = ranges.ranges;
    a->range_count = ranges.range_count;
    a->range_capacity = ranges.range_capacity;
    for (h = 0; h < 2; h++) {
        pti_add_array(a->half[h], b->half[h], 3 * n);
        pti_add_array(a->splat[h], b->splat[h], 3 * n);
        a->samples[h] += b->samples[h];
    }
    pti_add_array(a->albedo, b->albedo, 3 * n);
    pti_add_array(a->normal, b->normal, 3 * n);
    pti_add_array(a->depth, b->depth, n);
    pti_add_array(a->classes, b->classes, 3 * n * (size_t)a->class_count);
    a->nonfinite += b->nonfinite;
    return PT_OK;
}

PTDEF pt_result pt_splat_add(pt_splat_list *list, uint32_t pixel, uint32_t half, pt_rgb value)
{
    if (list->count == list->capacity) {
        size_t wanted = list->capacity + list->capacity / 2 + 64;
        void *p = wanted > SIZE_MAX / sizeof *list->items ? NULL : PT_REALLOC(list->items, wanted * sizeof *list->items, list->alloc_user);
        if (!p) return PT_ERROR_MEMORY;
        list->items = (pt_splat *)p;
        list->capacity = wanted;
    }
    list->items[list->count].pixel = pixel;
    list->items[list->count].half = half;
    list->items[list->count++].value = value;
    return PT_OK;
}

PTDEF pt_result pt_film_add_splats(pt_film *film, const pt_splat_list *list)
{
    size_t pixels = (size_t)film->width * (size_t)film->height, i;
    for (i = 0; i < list->count; i++) {
        const pt_splat *s = &list->items[i];
        double *sum;
        if (s->pixel >= pixels || s->half > 1) return PT_ERROR_ARGUMENT;
        if (!pti_film_need_splat(film, (int)s->half)) return PT_ERROR_MEMORY;
        if (!pti_rgb_finite(s->value)) {
            film->nonfinite++;
            continue;
        }
        sum = film->splat[s->half] + 3 * (size_t)s->pixel;
        sum[0] += (double)s->value.r;
        sum[1] += (double)s->value.g;
        sum[2] += (double)s->value.b;
    }
    return PT_OK;
}

PTDEF void pt_splat_list_free(pt_splat_list *list)
{
    void *user = list->alloc_user;
    pti_free(list->items, user);
    memset(list, 0, sizeof *list);
    list->alloc_user = user;
}

/* Value k of the reference, or of the film itself. */
static double pti_reference_value(const pt_film *film, const float *reference, size_t k)
{
    return reference ? (double)reference[k] : pti_film_value(film, 2, k);
}

/* The error against a reference, or without one the estimate from the halves with R = I. */
static void pti_film_error(const pt_film *film, const float *reference, pt_error *out)
{
    size_t n = (size_t)film->width * (size_t)film->height, k;
    double a = film->samples[0], b = film->samples[1], share = a * b / ((a + b) * (a + b));
    double mean = 0, square = 0, relative = 0, relative_001 = 0;
    for (k = 0; k < 3 * n; k += 3)
        mean += pt_luminance(pti_reference_value(film, reference, k), pti_reference_value(film, reference, k + 1),
                             pti_reference_value(film, reference, k + 2)) / (double)n;
    for (k = 0; k < 3 * n; k++) {
        double r = pti_reference_value(film, reference, k), d, e;
        d = reference ? pti_film_value(film, 2, k) - r : pti_film_value(film, 0, k) - pti_film_value(film, 1, k);
        e = reference ? d * d : share * d * d;
        square += e;
        if (e > 0) relative += e / (r * r + 0.01 * mean * mean); /* a black picture without error: 0, not 0/0 */
        relative_001 += e / (r * r + 0.01);
    }
    out->rmse = sqrt(square / (3.0 * (double)n));
    out->relmse = relative / (3.0 * (double)n);
    out->relmse_001 = relative_001 / (3.0 * (double)n);
}

PTDEF int pt_film_error_estimate(const pt_film *film, pt_error *out)
{
    memset(out, 0, sizeof *out);
    if (film->samples[0] == 0 || film->samples[1] == 0) return 0;
    pti_film_error(film, NULL, out);
    return 1;
}

PTDEF void pt_film_error(const pt_film *film, const float *reference, pt_error *out)
{
    pti_film_error(film, reference, out);
}

/* =====================================================================================================
   [PT-11] INTEGRATORS: implementation
   =====================================================================================================
   The rendering equation [Kaj86]

       L(x, wo) = Le(x, wo) + int f(wo, wi) L(y, -wi) |cos| dwi,      y = what x sees along wi,

   has L on both sides. Put in itself k times, it is a sum over paths of 1, 2, 3, ... edges. Path tracing walks
   from the eye, one random direction at each surface, and keeps the throughput

       beta = product over the vertices of f |cos| / p,

   so that beta * Le at every emitter met has the expectation of that sum. Three estimators share the walk:
   plain (light only where the walk hits it), light sampling (at each vertex one point on a light is asked
   for; hitting it later must then NOT count, or it would count twice), and both, weighted by multiple
   importance sampling [Vea97] 9.2: w = p^2 / (p^2 + q^2) for the technique with density p against the other.
   The weight belongs to the emission, not to beta.

   Russian roulette [Arv90] ends the walk without bias: go on with probability q, and divide beta by q. For any
   q > 0 that depends on the past only the expectation is unchanged. With q = throughput, beta stays near 1
   after each survival; its variance is finite for every albedo below 1, whereas a cap of q such as 0.95 makes
   it infinite in a closed scene with albedo above sqrt(0.95). q is at most 1 - 2^-24, so that every walk ends.
   Refraction scales radiance by 1/eta^2, which is undone again on the way out: roulette ignores that factor.

   The body is written once, with the features a scene may need as a constant mask: pti_path below is compiled
   for each mask that the driver picks from. */

enum { PTI_TECHNIQUE_PLAIN, PTI_TECHNIQUE_LIGHT, PTI_TECHNIQUE_MIS, PTI_TECHNIQUE_DISTRIBUTION };

#if PTI_HAS_LPE || PTI_HAS_WHITTED || PTI_HAS_OBSERVER
/* The share of lobe `lobe` in the whole BSDF at a direction, per band; 0 where the whole is 0. */
static pt_rgbd pti_lobe_share(const pt_bsdf *bsdf, pt_vec3 wo, pt_vec3 wi, unsigned lobe)
{
    pt_rgb f = pt_bsdf_eval(bsdf, wo, wi, PT_RADIANCE, lobe), all = pt_bsdf_eval(bsdf, wo, wi, PT_RADIANCE, PT_LOBE_ALL);
    return pt_rgbd3(all.r > 0 ? (double)f.r / (double)all.r : 0, all.g > 0 ? (double)f.g / (double)all.g : 0,
                    all.b > 0 ? (double)f.b / (double)all.b : 0);
}
#endif

#if PTI_HAS_LPE
/* --- light-path expressions --- Each letter of an expression is a position. Which positions may begin a word,
   end it, and follow each other is found while parsing (Glushkov's automaton); read backwards, from the eye, a
   state is a set of positions, one 64-bit set for each expression, and all states that can occur are numbered. */

/* A part of an expression: may it be empty, where it may begin and end. */
typedef struct pti_regex {
    uint64_t first, last;
    int nullable;
} pti_regex;

typedef struct pti_parser {
    const char *at;
    const char *error;
    int depth, count;
    uint64_t letters[6];     /* positions of L D G S V E                                                   */
    uint64_t before[64];     /* positions that may stand just before this one                              */
    pti_regex (*parse)(struct pti_parser *p); /* a whole expression: what stands in parentheses            */
} pti_parser;

static const char pti_alphabet[] = "LDGSVE";

/* A position that takes each of the letters in the set. */
static pti_regex pti_position(pti_parser *p, unsigned set)
{
    pti_regex r = {0, 0, 0};
    int k;
    if (p->count == 64) p->error = "an expression has more than 64 letters";
    if (p->error) return r;
    for (k = 0; k < 6; k++)
        if (set & (1u << k)) p->letters[k] |= UINT64_C(1) << p->count;
    r.first = r.last = UINT64_C(1) << p->count++;
    return r;
}

static unsigned pti_letter_bit(char c)
{
    const char *at = c ? strchr(pti_alphabet, c) : NULL;
    return at ? 1u << (at - pti_alphabet) : 0;
}

static pti_regex pti_parse_atom(pti_parser *p)
{
    unsigned set = 0;
    pti_regex r = {0, 0, 0};
    char c = *p->at;
    if (c) p->at++;
    if (c == '(') {
        if (++p->depth > 32) p->error = "parentheses are nested too deeply";
        if (!p->error) r = p->parse(p);
        p->depth--;
        if (*p->at == ')') p->at++;
        else if (!p->error) p->error = "a parenthesis is not closed";
        return r;
    }
    if (c == '[') {
        for (; pti_letter_bit(*p->at); p->at++) set |= pti_letter_bit(*p->at);
        if (*p->at == ']' && set) p->at++;
        else p->error = "a set of letters is empty or not closed";
        return pti_position(p, set);
    }
    set = c == '.' ? 0x1eu : pti_letter_bit(c);
    if (!set) p->error = "a letter other than L D G S V E stands in an expression";
    return pti_position(p, set);
}

/* The positions in `after` may follow those in `before`. */
static void pti_follow(pti_parser *p, uint64_t before, uint64_t after)
{
    int k;
    for (k = 0; k < p->count; k++)
        if (after >> k & 1) p->before[k] |= before;
}

static pti_regex pti_parse_sequence(pti_parser *p)
{
    pti_regex all = {0, 0, 1};
    while (!p->error && *p->at && *p->at != ')' && *p->at != '|') {
        pti_regex r = pti_parse_atom(p);
        for (; !p->error && (*p->at == '*' || *p->at == '+' || *p->at == '?'); p->at++) {
            if (*p->at != '?') pti_follow(p, r.last, r.first);
            if (*p->at != '+') r.nullable = 1;
        }
        pti_follow(p, all.last, r.first);
        if (all.nullable) all.first |= r.first;
        all.last = r.nullable ? all.last | r.last : r.last;
        all.nullable &= r.nullable;
    }
    return all;
}

static pti_regex pti_parse_or(pti_parser *p)
{
    pti_regex all = pti_parse_sequence(p);
    while (!p->error && *p->at == '|') {
        pti_regex r;
        p->at++;
        r = pti_parse_sequence(p);
        all.first |= r.first;
        all.last |= r.last;
        all.nullable |= r.nullable;
    }
    return all;
}

/* The automaton of a list while it is being made. */
typedef struct pti_lpe_maker {
    pti_parser parser[PT_LPE_EXPRESSIONS];
    pti_regex whole[PT_LPE_EXPRESSIONS];
    uint64_t states[PT_LPE_STATES][PT_LPE_EXPRESSIONS];
    int count;
} pti_lpe_maker;

/* The positions that may stand just before those of the set, if their letter is that one. */
static uint64_t pti_step_back(const pti_parser *p, uint64_t set, int letter)
{
    uint64_t result = 0;
    int k;
    for (k = 0; k < p->count; k++)
        if (set >> k & 1) result |= p->before[k];
    return result & p->letters[letter];
}

/* The number of a state, a new one if it has not occurred; -1: too many. */
static int pti_lpe_state(pti_lpe_maker *m, pt_lpe *lpe, const uint64_t *set)
{
    int n;
    for (n = 0; n < lpe->state_count; n++)
        if (memcmp(m->states[n], set, sizeof m->states[n]) == 0) return n;
    if (n == PT_LPE_STATES) return -1;
    memcpy(m->states[n], set, sizeof m->states[n]);
    lpe->state_count++;
    return n;
}

/* Finds all states from the eye on; 0: too many. */
static int pti_lpe_states(pti_lpe_maker *m, pt_lpe *lpe)
{
    uint64_t set[PT_LPE_EXPRESSIONS] = {0};
    int s, k, c, n;
    for (k = 0; k < m->count; k++) set[k] = m->whole[k].last & m->parser[k].letters[5];
    lpe->state_count = 0;
    pti_lpe_state(m, lpe, set);
    for (s = 0; s < lpe->state_count; s++) {
        lpe->class_of[s] = (unsigned char)m->count;
        for (k = m->count - 1; k >= 0; k--)
            if (pti_step_back(&m->parser[k], m->states[s][k], 0) & m->whole[k].first) lpe->class_of[s] = (unsigned char)k;
        for (c = 1; c < 5; c++) {
            for (k = 0; k < m->count; k++) set[k] = pti_step_back(&m->parser[k], m->states[s][k], c);
            n = pti_lpe_state(m, lpe, set);
            if (n < 0) return 0;
            lpe->next[s][c - 1] = (unsigned char)n;
        }
    }
    return 1;
}

PTDEF pt_result pt_lpe_compile(pt_lpe *lpe, const char *const *expressions, int count, const char **error)
{
    pti_lpe_maker m;
    const char *why = NULL;
    int k;
    memset(lpe, 0, sizeof *lpe);
    memset(&m, 0, sizeof m);
    if (count < 0 || count > PT_LPE_EXPRESSIONS || (count > 0 && !expressions)) why = "a list has 0 to 16 expressions";
    for (k = 0; k < count && !why; k++) {
        pti_parser *p = &m.parser[k];
        p->at = expressions[k] ? expressions[k] : "";
        p->parse = pti_parse_or;
        m.whole[k] = pti_parse_or(p);
        why = p->error ? p->error : *p->at ? "a parenthesis was not opened" : m.whole[k].nullable ? "an expression is empty" : NULL;
    }
    m.count = count;
    if (!why && !pti_lpe_states(&m, lpe)) why = "the expressions need more than 64 states";
    if (error) *error = why;
    if (why) memset(lpe, 0, sizeof *lpe);
    else lpe->class_count = count + 1;
    return why ? PT_ERROR_ARGUMENT : PT_OK;
}

PTDEF int pt_lpe_class(const pt_lpe *lpe, const char *word)
{
    size_t n = strlen(word), i;
    unsigned s = 0;
    if (n < 2 || word[0] != 'L' || word[n - 1] != 'E' || lpe->class_count == 0) return -1;
    for (i = n - 2; i > 0; i--) {
        const char *at = strchr("DGSV", word[i]);
        if (!at || !word[i]) return -1;
        s = lpe->next[s][at - "DGSV"];
    }
    return lpe->class_of[s];
}

PTDEF const char *const *pt_lpe_slides(void)
{
    static const char *const rows[PT_LPE_SLIDES_COUNT] = {"LE", "L[DGS]E", "L[SDG]S+E", "LS+[DG]E", "L[SDG]*[DG][DG]E",
                                                          "L[SDG]+[DG]S+E", "L[SDG]+[DG][SDG]*E", "L.*V.*E"};
    return rows;
}

static int pti_letter_index(unsigned lobe)
{
    return lobe == PT_LOBE_DIFFUSE ? 0 : lobe == PT_LOBE_GLOSSY ? 1 : 2;
}

/* The whole of beta begins in state 0. */
static void pti_share_start(const pt_lpe *lpe, pt_rgbd *share)
{
    memset(share, 0, (size_t)lpe->state_count * sizeof *share);
    share[0] = pt_rgbd3(1, 1, 1);
}

/* Adds a contribution to the classes, divided as the path so far is; lobe: one more letter before L, or 0. */
static void pti_classify(const pt_lpe *lpe, const pt_rgbd *share, pt_rgbd *classes, unsigned lobe, pt_rgbd c)
{
    int s;
    for (s = 0; s < lpe->state_count; s++) {
        pt_rgbd *sum = &classes[lpe->class_of[lobe ? lpe->next[s][pti_letter_index(lobe)] : s]];
        sum->r += c.r * share[s].r;
        sum->g += c.g * share[s].g;
        sum->b += c.b * share[s].b;
    }
}

/* Moves what is in each state by the letters of a scattering, in proportion to their parts of the BSDF at the
   direction drawn: the classes get their exact integrals, whichever lobe drew it. */
static void pti_advance(const pt_lpe *lpe, pt_rgbd *share, const pt_bsdf *bsdf, pt_vec3 wo, const pt_bsdf_sample_result *sample, int without_diffuse)
{
    pt_rgbd next[PT_LPE_STATES];
    pt_rgbd d = pt_rgbd3(0, 0, 0);
    int s, mixed = sample->lobe != PT_LOBE_SPECULAR && (bsdf->lobes & PT_LOBE_DIFFUSE) && (bsdf->lobes & PT_LOBE_GLOSSY);
    if (mixed && !without_diffuse) d = pti_lobe_share(bsdf, wo, sample->wi, PT_LOBE_DIFFUSE);
    memset(next, 0, (size_t)lpe->state_count * sizeof *next);
    for (s = 0; s < lpe->state_count; s++) {
        pt_rgbd *to = &next[lpe->next[s][mixed ? 1 : pti_letter_index(sample->lobe)]], *diffuse = &next[lpe->next[s][0]];
        to->r += share[s].r * (1 - d.r);
        to->g += share[s].g * (1 - d.g);
        to->b += share[s].b * (1 - d.b);
        diffuse->r += share[s].r * d.r;
        diffuse->g += share[s].g * d.g;
        diffuse->b += share[s].b * d.b;
    }
    memcpy(share, next, (size_t)lpe->state_count * sizeof *next);
}
#endif


/* Features that an instance of the integrator may leave out. */
enum {
    PTI_WITH_SPECULAR = 1,
    PTI_WITH_ENVIRONMENT = 2,
    PTI_WITH_OBSERVER = 4,
    PTI_WITH_LPE = 8,
    PTI_WITH_ALL = PTI_WITH_SPECULAR | (PTI_HAS_ENVIRONMENT ? PTI_WITH_ENVIRONMENT : 0) |
                   (PTI_HAS_OBSERVER ? PTI_WITH_OBSERVER : 0) | (PTI_HAS_LPE ? PTI_WITH_LPE : 0)
};

/* A walk under way. */
typedef struct pti_walk {
    const pt_scene *scene;
    pt_sampler *sampler;
    const pt_li_options *options;
    pti_d3 o;               /* where the last edge starts,                                                 */
    pt_vec3 d;              /*   and its direction (unit)                                                  */
    pt_vec3 p;              /* o, rounded to the side of its surface that it is on: lights are seen from it */
    pt_hit hit;
    pt_rgbd beta;           /* throughput                                                                  */
    double eta2;            /* product of eta^2 over the refractions so far                                */
    pt_rgbd sum;            /* radiance found                                                              */
    pt_real pdf_w;          /* density of the last direction,                                              */
    int specular;           /*   1 if it came from a delta lobe (or from the camera)                       */
    int edges;
    uint64_t rays;
#if PTI_HAS_OBSERVER
    char letters[PT_WORD_MAX];
#endif
#if PTI_HAS_LPE
    const pt_lpe *lpe;      /* NULL = no classes wanted                                                    */
    pt_rgbd *classes;       /* where they are added                                                        */
    pt_rgbd share[PT_LPE_STATES]; /* how much of beta is in which state of the automaton                   */
#endif
} pti_walk;

/* Are contributions to be told lobe by lobe? */
PTI_INLINE int pti_is_watched(const pti_walk *w, const unsigned features)
{
#if PTI_HAS_OBSERVER
    if ((features & PTI_WITH_OBSERVER) && w->options->observer) return 1;
#endif
#if PTI_HAS_LPE
    if ((features & PTI_WITH_LPE) && w->lpe) return 1;
#endif
    (void)w;
    (void)features;
    return 0;
}

#if PTI_HAS_OBSERVER
static char pti_letter(unsigned lobe)
{
    return lobe == PT_LOBE_DIFFUSE ? 'D' : lobe == PT_LOBE_GLOSSY ? 'G' : 'S';
}

/* Tells the observer of a contribution over `edges` edges; letters[0..edges-2] lead from the eye. */
static void pti_observe(const pti_walk *w, int edges, pt_rgbd value)
{
    char word[PT_WORD_MAX + 4];
    int letters = edges - 1, n = 0, i;
    if (letters > PT_WORD_MAX) {
        letters = PT_WORD_MAX;
        word[n++] = '*';
    } else {
        word[n++] = 'L';
    }
    for (i = letters - 1; i >= 0; i--) word[n++] = w->letters[i];
    word[n++] = 'E';
    word[n] = 0;
    w->options->observer(w->options->observer_user, word, edges, value);
}
#endif

/* Tells observer and classes of a contribution; lobe: of the surface that a light was sampled from, 0 if the walk
   hit it. */
PTI_INLINE void pti_tell(pti_walk *w, pt_rgbd c, int edges, unsigned lobe, const unsigned features)
{
#if PTI_HAS_OBSERVER
    if ((features & PTI_WITH_OBSERVER) && w->options->observer) {
        if (lobe && edges - 1 <= PT_WORD_MAX) w->letters[edges - 2] = pti_letter(lobe);
        pti_observe(w, edges, c);
    }
#endif
#if PTI_HAS_LPE
    if ((features & PTI_WITH_LPE) && w->lpe) pti_classify(w->lpe, w->share, w->classes, lobe, c);
#endif
    (void)w;
    (void)c;
    (void)edges;
    (void)lobe;
    (void)features;
}

/* Adds beta * value * weight, and returns it. */
PTI_INLINE pt_rgbd pti_add_light(pti_walk *w, pt_rgb value, double weight)
{
    pt_rgbd c = pt_rgbd3(w->beta.r * (double)value.r * weight, w->beta.g * (double)value.g * weight,
                         w->beta.b * (double)value.b * weight);
    w->sum.r += c.r;
    w->sum.g += c.g;
    w->sum.b += c.b;
    return c;
}

#if PTI_HAS_OBSERVER || PTI_HAS_LPE
/* Tells of a contribution, added as a whole, by the lobes that scattered it: watching changes no bit of the sum. */
static void pti_tell_lobes(pti_walk *w, const pt_bsdf *bsdf, pt_vec3 wi, pt_rgbd c, const unsigned features)
{
    pt_rgbd d = pt_rgbd3(0, 0, 0);
    int diffuse = (bsdf->lobes & PT_LOBE_DIFFUSE) != 0, glossy = (bsdf->lobes & PT_LOBE_GLOSSY) != 0;
    if (diffuse && glossy) d = pti_lobe_share(bsdf, pt_v3_neg(w->d), wi, PT_LOBE_DIFFUSE);
    else if (diffuse) d = pt_rgbd3(1, 1, 1);
    if (diffuse) pti_tell(w, pt_rgbd3(c.r * d.r, c.g * d.g, c.b * d.b), w->edges + 1, PT_LOBE_DIFFUSE, features);
    if (glossy) pti_tell(w, pt_rgbd3(c.r * (1 - d.r), c.g * (1 - d.g), c.b * (1 - d.b)), w->edges + 1, PT_LOBE_GLOSSY, features);
}
#endif

/* Emission that the last direction found: all of it where no other technique could, its share otherwise. */
PTI_INLINE double pti_emission_weight(const pti_walk *w, int light, const pt_hit *hit, const int technique)
{
    double p;
    if (technique == PTI_TECHNIQUE_PLAIN || w->specular) return 1;
    if (technique == PTI_TECHNIQUE_LIGHT) return 0;
    p = w->scene->lights[light].pmf * pt_light_pdf_w(w->scene, light, w->p, w->d, hit);
    return pt_mis_weight((double)w->pdf_w, p, w->options->heuristic);
}

/* Is nothing between a hit and the sampled point of a light? */
static int pti_reaches(const pt_scene *scene, const pt_hit *hit, const pt_light_sample_result *ls)
{
    pti_ray r = ls->infinite ? pti_ray_from(pti_leave(hit, ls->wi), pti_d_from(ls->wi), HUGE_VAL)
                             : pti_shadow_ray(hit, ls->wi, ls->p, ls->p_error, ls->n);
    return !pti_occluded(scene, &r);
}

/* Asks one point of one light for its light at the current vertex. */
PTI_INLINE void pti_direct(pti_walk *w, const pt_bsdf *bsdf, pt_vec3 wo, const unsigned features, const int technique)
{
    uint32_t dimension = PT_DIM_EDGE(w->edges);
    pt_light_sample_result ls;
    pt_real c;
    pt_vec2 u;
    pt_rgb f;
    pt_rgbd sum;
    double pmf, p, weight;
    int light;
    if ((features & PTI_WITH_SPECULAR) && !(bsdf->lobes & (PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY))) return;
    pt_sampler_seek(w->sampler, dimension + PT_DIM_LIGHT_CHOICE);
    light = pt_light_choose(w->scene, pti_draw(w->sampler), &pmf);
    if (light < 0) return;
    pt_sampler_seek(w->sampler, dimension + PT_DIM_LIGHT);
    u = pt_sampler_2d(w->sampler);
    if (!pt_light_sample(w->scene, light, pti_offset(w->hit.p, w->hit.p_error, w->hit.ng, wo), u, &ls)) return;
    f = pt_bsdf_eval(bsdf, wo, ls.wi, PT_RADIANCE, PT_LOBE_ALL);
    if (pti_rgb_black(f)) return;
    w->rays++;
    if (!pti_reaches(w->scene, &w->hit, &ls)) return;
    c = pti_fabs(pt_v3_dot(ls.wi, bsdf->frame.n));
    p = pmf * ls.pdf_w;
    weight = technique >= PTI_TECHNIQUE_MIS && !ls.delta
                 ? pt_mis_weight(p, (double)pt_bsdf_pdf_w(bsdf, wo, ls.wi, PT_RADIANCE), w->options->heuristic) : 1.0;
#if PTI_HAS_WHITTED
    if (technique == PTI_TECHNIQUE_DISTRIBUTION) { /* light on the diffuse part is sampled only: see pti_drop_diffuse */
        pt_rgb d = pt_bsdf_eval(bsdf, wo, ls.wi, PT_RADIANCE, PT_LOBE_DIFFUSE), g = pt_bsdf_eval(bsdf, wo, ls.wi, PT_RADIANCE, PT_LOBE_GLOSSY);
        pti_tell(w, pti_add_light(w, pt_rgb_mul(d, ls.radiance), (double)c / p), w->edges + 1, PT_LOBE_DIFFUSE, features);
        pti_tell(w, pti_add_light(w, pt_rgb_mul(g, ls.radiance), weight * (double)c / p), w->edges + 1, PT_LOBE_GLOSSY, features);
        return;
    }
#endif
    sum = pti_add_light(w, pt_rgb_mul(f, ls.radiance), weight * ((double)c / p));
#if PTI_HAS_OBSERVER || PTI_HAS_LPE
    if (pti_is_watched(w, features)) pti_tell_lobes(w, bsdf, ls.wi, sum, features);
#endif
    (void)sum;
}

#if PTI_HAS_WHITTED
/* Takes the diffuse part out of the direction just drawn: light that it would find is left to light sampling
   alone. */
static void pti_drop_diffuse(pti_walk *w, const pt_bsdf *bsdf, pt_vec3 wo, const pt_bsdf_sample_result *s)
{
    pt_rgbd share;
    if (s->lobe == PT_LOBE_SPECULAR || !(bsdf->lobes & PT_LOBE_DIFFUSE)) return;
    share = pti_lobe_share(bsdf, wo, s->wi, PT_LOBE_GLOSSY);
    w->beta = pt_rgbd3(w->beta.r * share.r, w->beta.g * share.g, w->beta.b * share.b);
}
#endif

/* Draws the next direction; 0 = the walk ends. */
PTI_INLINE int pti_extend(pti_walk *w, const pt_bsdf *bsdf, pt_vec3 wo, const unsigned features, const int technique)
{
    uint32_t dimension = PT_DIM_EDGE(w->edges);
    pt_bsdf_sample_result s;
    pt_vec2 u;
    double u_lobe = 0;
    pt_sampler_seek(w->sampler, dimension + PT_DIM_BSDF);
    u = pt_sampler_2d(w->sampler);
    if (features & PTI_WITH_SPECULAR) {
        if (bsdf->material->kind != PT_MATERIAL_DIFFUSE) {
            pt_sampler_seek(w->sampler, dimension + PT_DIM_LOBE);
            u_lobe = pti_draw(w->sampler);
        }
        if (!pt_bsdf_sample(bsdf, wo, u_lobe, u, PT_RADIANCE, &s)) return 0;
        w->specular = s.lobe == PT_LOBE_SPECULAR;
        w->eta2 *= (double)s.eta * (double)s.eta;
#if PTI_HAS_LPE
        if ((features & PTI_WITH_LPE) && w->lpe) pti_advance(w->lpe, w->share, bsdf, wo, &s, technique == PTI_TECHNIQUE_DISTRIBUTION);
#endif
    } else {
        if (!pti_sample_diffuse(bsdf, wo, u, &s)) return 0;
        w->specular = 0;
    }
#if PTI_HAS_OBSERVER
    if ((features & PTI_WITH_OBSERVER) && w->edges <= PT_WORD_MAX) w->letters[w->edges - 1] = pti_letter(s.lobe);
#endif
    w->pdf_w = s.pdf_w;
    w->beta = pt_rgbd3(w->beta.r * (double)s.weight.r, w->beta.g * (double)s.weight.g, w->beta.b * (double)s.weight.b);
#if PTI_HAS_WHITTED
    if (technique == PTI_TECHNIQUE_DISTRIBUTION) pti_drop_diffuse(w, bsdf, wo, &s);
#endif
    (void)technique;
    w->o = pti_leave(&w->hit, s.wi);
    w->p = pti_offset(w->hit.p, w->hit.p_error, w->hit.ng, s.wi);
    w->d = s.wi;
    return w->beta.r > 0 || w->beta.g > 0 || w->beta.b > 0;
}

/* Russian roulette; 0 = the walk ends. */
PTI_INLINE int pti_roulette(pti_walk *w)
{
    const pt_li_options *o = w->options;
    int constant = o->roulette == PT_ROULETTE_CONSTANT;
    int start = o->roulette_start > 0 ? o->roulette_start : constant ? 1 : 3;
    double q;
    if (o->roulette == PT_ROULETTE_NONE || w->edges < start) return 1;
    if (constant) q = o->roulette_survival > 0 ? (double)o->roulette_survival : 0.8;
    else q = (o->roulette_scale > 0 ? (double)o->roulette_scale : 1) * fmax(w->beta.r, fmax(w->beta.g, w->beta.b)) * w->eta2;
    q = fmin(q, 1 - PTI_2_M24);
    pt_sampler_seek(w->sampler, PT_DIM_EDGE(w->edges) + PT_DIM_ROULETTE);
    if (!(pti_draw(w->sampler) < q)) return 0;
    w->beta = pt_rgbd3(w->beta.r / q, w->beta.g / q, w->beta.b / q);
    return 1;
}

/* What the first surface is, for the auxiliary pictures. */
static void pti_describe_first_hit(const pt_hit *hit, const pt_bsdf *bsdf, pt_li_info *info)
{
    const pt_material *m = bsdf->material;
    info->hit = 1;
    info->albedo = m->kind == PT_MATERIAL_DIELECTRIC ? pt_rgb_grey(1) : pt_rgb_add(bsdf->albedo, m->specular);
    info->normal = hit->ns;
    info->depth = hit->t;
}

/* Emission of the background where the walk leaves the scene. */
PTI_INLINE void pti_contribute_environment(pti_walk *w, const int technique, const unsigned features)
{
#if PTI_HAS_ENVIRONMENT
    pt_rgb emission = pt_environment_radiance(w->scene, w->d);
    if (!pti_rgb_black(emission))
        pti_tell(w, pti_add_light(w, emission, pti_emission_weight(w, w->scene->environment_light, NULL, technique)), w->edges, 0, features);
#endif
    (void)w;
    (void)technique;
    (void)features;
}

PTI_INLINE pt_rgbd pti_path(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler, const pt_li_options *options,
                            pt_li_info *info, const unsigned features, const int technique)
{
    pti_walk w;
    w.scene = scene;
    w.sampler = sampler;
    w.options = options;
    w.o = pti_d_from(ray->o);
    w.p = ray->o;
    w.d = pt_v3_normalize(ray->d); /* its negative is wo, whose cosines must be cosines */
    w.beta = pt_rgbd3(1, 1, 1);
    w.eta2 = 1;
    w.sum = pt_rgbd3(0, 0, 0);
    w.pdf_w = 0;
    w.specular = 1; /* what the camera sees directly, nothing else finds */
    w.rays = 0;
#if PTI_HAS_LPE
    if (features & PTI_WITH_LPE) {
        w.lpe = options->lpe;
        w.classes = info->classes;
        if (w.lpe) pti_share_start(w.lpe, w.share);
    }
#endif
    info->hit = 0;
    info->cancelled = 0;
    for (w.edges = 1;; w.edges++) {
        pti_ray edge = pti_ray_from(w.o, pti_d_from(w.d), HUGE_VAL);
        pt_vec3 wo = pt_v3_neg(w.d);
        pt_rgb emission;
        pt_bsdf bsdf;
        w.rays++;
        if (!pti_intersect(scene, &edge, &w.hit)) {
            if ((features & PTI_WITH_ENVIRONMENT) && scene->environment_light >= 0)
                pti_contribute_environment(&w, technique, features);
            break;
        }
        bsdf = pt_bsdf_make(&scene->materials[w.hit.material], &w.hit);
        if (w.edges == 1) pti_describe_first_hit(&w.hit, &bsdf, info);
        if (w.hit.light >= 0) {
            emission = pt_hit_emission(scene, &w.hit, wo);
            if (!pti_rgb_black(emission))
                pti_tell(&w, pti_add_light(&w, emission, pti_emission_weight(&w, w.hit.light, &w.hit, technique)), w.edges, 0, features);
        }
        if (w.edges == options->max_edges) break;
        if (!bsdf.lobes) break; /* black */
        if (technique != PTI_TECHNIQUE_PLAIN) pti_direct(&w, &bsdf, wo, features, technique);
        if (!pti_extend(&w, &bsdf, wo, features, technique) || !pti_roulette(&w)) break;
        if ((w.edges & 0xffff) == 0 && options->poll && options->poll(options->poll_user)) {
            info->cancelled = 1;
            break;
        }
    }
    info->rays += w.rays;
    info->edges = w.edges;
    return w.sum;
}

/* The general instance; the technique is asked at run time, which costs nothing next to a ray. */
static pt_rgbd pti_path_general(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                                const pt_li_options *options, pt_li_info *info, int technique)
{
    return pti_path(scene, ray, sampler, options, info, PTI_WITH_ALL, technique);
}

/* The instance for scenes that are diffuse throughout, without environment and observer. */
static pt_rgbd pti_path_diffuse(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                                const pt_li_options *options, pt_li_info *info)
{
    return pti_path(scene, ray, sampler, options, info, 0, PTI_TECHNIQUE_MIS);
}

PTDEF pt_rgbd pt_li_path(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler, const pt_li_options *options,
                         pt_li_info *info)
{
    return pti_path_general(scene, ray, sampler, options, info, PTI_TECHNIQUE_MIS);
}

#if PTI_HAS_ALL_METHODS
PTDEF pt_rgbd pt_li_path_plain(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                               const pt_li_options *options, pt_li_info *info)
{
    return pti_path_general(scene, ray, sampler, options, info, PTI_TECHNIQUE_PLAIN);
}

PTDEF pt_rgbd pt_li_path_light(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                               const pt_li_options *options, pt_li_info *info)
{
    return pti_path_general(scene, ray, sampler, options, info, PTI_TECHNIQUE_LIGHT);
}
#endif

#if PTI_HAS_WHITTED
/* --- before path tracing --- */

/* Light from the middle of light k as if all of it came from there: irradiance across the direction; 0: none. */
static int pti_middle_of_light(const pt_scene *scene, int k, const pt_hit *hit, pt_vec3 wo, pt_light_sample_result *ls)
{
    const pt_light *l = &scene->lights[k];
    int ball = l->kind == PT_LIGHT_AREA && scene->primitives[l->primitive].shape == PT_SHAPE_SPHERE; /* a cone has its axis at 0 */
    if (!pt_light_sample(scene, k, pti_offset(hit->p, hit->p_error, hit->ng, wo), pt_v2(ball ? 0 : PTI_R(0.5), PTI_R(0.5)), ls)) return 0;
    ls->radiance = pt_rgb3((pt_real)((double)ls->radiance.r / ls->pdf_w), (pt_real)((double)ls->radiance.g / ls->pdf_w),
                           (pt_real)((double)ls->radiance.b / ls->pdf_w));
    return 1;
}

static void pti_add_product(pt_rgbd *sum, pt_rgbd beta, pt_rgb value, double k)
{
    sum->r += beta.r * (double)value.r * k;
    sum->g += beta.g * (double)value.g * k;
    sum->b += beta.b * (double)value.b * k;
}

/* A ray of a tree: origin, direction (unit). */
typedef struct pti_twig {
    pti_d3 o;
    pt_vec3 d;
} pti_twig;

static pti_twig pti_twig_from(const pt_hit *hit, pt_vec3 w)
{
    pti_twig t;
    t.o = pti_leave(hit, w);
    t.d = w;
    return t;
}

/* Its first hit with BSDF and emission. 0: it left the scene, and `emission` is the background's. */
static int pti_look(const pt_scene *scene, const pti_twig *twig, pt_hit *hit, pt_bsdf *bsdf, pt_rgb *emission, pt_li_info *info)
{
    pti_ray r = pti_ray_from(twig->o, pti_d_from(twig->d), HUGE_VAL);
    info->rays++;
    *emission = pt_rgb_grey(0);
    if (!pti_intersect(scene, &r, hit)) {
#if PTI_HAS_ENVIRONMENT
        *emission = pt_environment_radiance(scene, twig->d);
#endif
        return 0;
    }
    *emission = pt_hit_emission(scene, hit, pt_v3_neg(twig->d));
    *bsdf = pt_bsdf_make(&scene->materials[hit->material], hit);
    return 1;
}

/* What the methods below share at their start. */
static pti_twig pti_first_twig(const pt_ray *ray, pt_li_info *info)
{
    pti_twig r;
    r.o = pti_d_from(ray->o);
    r.d = pt_v3_normalize(ray->d);
    info->hit = info->cancelled = 0;
    info->edges = 1;
    return r;
}

PTDEF pt_rgbd pt_li_local(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler, const pt_li_options *options,
                          pt_li_info *info)
{
    const pt_rgbd one = pt_rgbd3(1, 1, 1);
    pti_twig r = pti_first_twig(ray, info);
    pt_vec3 wo = pt_v3_neg(r.d), n;
    pt_light_sample_result ls;
    pt_rgb emission;
    pt_rgbd sum = pt_rgbd3(0, 0, 0);
    pt_bsdf bsdf;
    pt_hit hit;
    uint32_t k;
    int seen = pti_look(scene, &r, &hit, &bsdf, &emission, info);
    (void)sampler;
    pti_add_product(&sum, one, emission, 1);
    if (!seen) return sum;
    pti_describe_first_hit(&hit, &bsdf, info);
    pti_add_product(&sum, one, pt_rgb_mul(options->ambient, bsdf.albedo), 1);
    n = pt_v3_scale(hit.ns, pti_side(&bsdf, wo));
    for (k = 0; k < scene->light_count; k++) {
        double nl, nh;
        if (scene->lights[k].kind == PT_LIGHT_ENVIRONMENT || !pti_middle_of_light(scene, (int)k, &hit, wo, &ls)) continue;
        nl = fmax(0, (double)pt_v3_dot(n, ls.wi));
        nh = fmax(0, (double)pt_v3_dot(n, pt_v3_normalize(pt_v3_add(wo, ls.wi))));
        pti_add_product(&sum, one, pt_rgb_mul(bsdf.albedo, ls.radiance), nl);
        pti_add_product(&sum, one, pt_rgb_mul(bsdf.material->specular, ls.radiance), pow(nh, (double)bsdf.material->exponent));
    }
    return sum;
}

/* A ray of the tree that waits to be followed. */
typedef struct pti_branch {
    pti_twig ray;
    pt_rgbd beta;
    int edges;
} pti_branch;

enum { PTI_TREE_EDGES = 12, PTI_TREE_MOST = 64 };

/* Direct light at a vertex of the tree from the middle of each light. */
static void pti_whitted_direct(const pt_scene *scene, const pti_branch *b, const pt_hit *hit, const pt_bsdf *bsdf, pt_rgbd *sum, pt_li_info *info)
{
    pt_vec3 wo = pt_v3_neg(b->ray.d);
    pt_light_sample_result ls;
    uint32_t k;
    for (k = 0; k < scene->light_count; k++) {
        pt_rgb f;
        if (scene->lights[k].kind == PT_LIGHT_ENVIRONMENT || !pti_middle_of_light(scene, (int)k, hit, wo, &ls)) continue;
        f = pt_bsdf_eval(bsdf, wo, ls.wi, PT_RADIANCE, PT_LOBE_ALL);
        if (pti_rgb_black(f)) continue;
        info->rays++;
        if (!pti_reaches(scene, hit, &ls)) continue;
        pti_add_product(sum, b->beta, pt_rgb_mul(f, ls.radiance), fabs((double)pt_v3_dot(ls.wi, bsdf->frame.n)));
    }
}

/* Puts the specular continuations of a vertex on the stack: both, reflection and refraction, each with its whole
   weight: that of the sample times the probability with which it would be drawn. */
static int pti_whitted_branch(const pti_branch *b, const pt_hit *hit, const pt_bsdf *bsdf, pti_branch *stack)
{
    int k, n = 0;
    for (k = 0; k < 2; k++) {
        pt_bsdf_sample_result s;
        pt_vec3 wo = pt_v3_neg(b->ray.d);
        if (!pt_bsdf_sample(bsdf, wo, k == 0 ? 0 : 1 - PTI_2_M53, pt_v2(PTI_R(0.5), PTI_R(0.5)), PT_RADIANCE, &s)) continue;
        if (s.lobe != PT_LOBE_SPECULAR || !(s.pdf_w > 0)) continue;
        stack[n].beta = pt_rgbd3(0, 0, 0);
        pti_add_product(&stack[n].beta, b->beta, s.weight, (double)s.pdf_w);
        stack[n].ray = pti_twig_from(hit, s.wi);
        stack[n++].edges = b->edges + 1;
        if (s.pdf_w >= 1) break; /* nothing is left for the other */
    }
    return n;
}

PTDEF pt_rgbd pt_li_whitted(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler, const pt_li_options *options,
                            pt_li_info *info)
{
    pti_branch stack[PTI_TREE_MOST + 2], b; /* a vertex takes one off and puts at most two on, an edge deeper */
    pt_rgbd sum = pt_rgbd3(0, 0, 0);
    int most = options->max_edges > 0 ? options->max_edges : PTI_TREE_EDGES, top = 1;
    (void)sampler;
    if (most > PTI_TREE_MOST) most = PTI_TREE_MOST;
    stack[0].ray = pti_first_twig(ray, info);
    stack[0].beta = pt_rgbd3(1, 1, 1);
    stack[0].edges = 1;
    while (top > 0) {
        pt_rgb emission;
        pt_bsdf bsdf;
        pt_hit hit;
        int seen;
        b = stack[--top];
        if ((info->rays & 0xffff) == 0 && options->poll && options->poll(options->poll_user)) {
            info->cancelled = 1;
            break;
        }
        seen = pti_look(scene, &b.ray, &hit, &bsdf, &emission, info);
        pti_add_product(&sum, b.beta, emission, 1);
        if (!seen) continue;
        if (b.edges == 1) pti_describe_first_hit(&hit, &bsdf, info);
        if (b.edges > info->edges) info->edges = b.edges;
        if (b.edges >= most) continue;
        pti_whitted_direct(scene, &b, &hit, &bsdf, &sum, info);
        top += pti_whitted_branch(&b, &hit, &bsdf, stack + top);
    }
    return sum;
}

PTDEF pt_rgbd pt_li_distribution(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                                 const pt_li_options *options, pt_li_info *info)
{
    pt_li_options o = *options;
    if (o.max_edges == 0) o.max_edges = PTI_TREE_EDGES;
    return pti_path_general(scene, ray, sampler, &o, info, PTI_TECHNIQUE_DISTRIBUTION);
}

/* The branching solver under way. */
typedef struct pti_solver {
    const pt_scene *scene;
    const pt_li_options *options;
    pt_li_info *info;
    pt_pcg32 random;
    int branching, most;
} pti_solver;

/* L(ray) = Le + 1/N sum of f cos / p L(next): the equation itself. The depth is at most PTI_TREE_MOST. */
static pt_rgbd pti_solve(pti_solver *s, const pti_twig *ray, int edges)
{
    pt_rgbd sum = pt_rgbd3(0, 0, 0);
    pt_rgb emission;
    pt_bsdf bsdf;
    pt_hit hit;
    int k, seen = pti_look(s->scene, ray, &hit, &bsdf, &emission, s->info);
    pti_add_product(&sum, pt_rgbd3(1, 1, 1), emission, 1);
    if (!seen) return sum;
    if (edges == 1) pti_describe_first_hit(&hit, &bsdf, s->info);
    if (edges > s->info->edges) s->info->edges = edges;
    for (k = 0; k < s->branching && edges < s->most && !s->info->cancelled; k++) {
        pt_bsdf_sample_result b;
        pti_twig next;
        pt_vec2 u = pti_pcg32_pair(&s->random);
        if ((s->info->rays & 0xffff) == 0 && s->options->poll && s->options->poll(s->options->poll_user)) s->info->cancelled = 1;
        if (!pt_bsdf_sample(&bsdf, pt_v3_neg(ray->d), pt_pcg32_double(&s->random), u, PT_RADIANCE, &b)) continue;
        next = pti_twig_from(&hit, b.wi);
        pti_add_product(&sum, pti_solve(s, &next, edges + 1), b.weight, 1.0 / s->branching);
    }
    return sum;
}

PTDEF pt_rgbd pt_li_branching(const pt_scene *scene, const pt_ray *ray, pt_sampler *sampler,
                              const pt_li_options *options, pt_li_info *info)
{
    pti_twig r = pti_first_twig(ray, info);
    pti_solver s;
    s.scene = scene;
    s.options = options;
    s.info = info;
    s.branching = options->branching > 0 ? options->branching : 4;
    s.most = options->max_edges > 0 ? options->max_edges : 4;
    if (s.most > PTI_TREE_MOST) s.most = PTI_TREE_MOST;
    pt_sampler_seek(sampler, PT_DIM_EDGE(1)); /* a tree needs more numbers than a path has dimensions: a stream of its own */
    s.random = pt_pcg32_make((uint64_t)(pti_draw(sampler) * 9007199254740992.0), pt_hash64(sampler->key ^ sampler->index));
    return pti_solve(&s, &r, 1);
}
#endif


/* =====================================================================================================
   [PT-11b] LOCKSTEP: implementation
   =====================================================================================================
   A path of a small scene spends its time on a few dozen multiplications at a time, one path after the other. Here as
   many paths as the machine has lanes walk together: each instruction takes one step of all of them, and a lane whose
   path has ended takes the next path from a queue ([Lai13] for GPUs; here it is the lanes of one core). In scenes of more
   than 64 primitives lanes ask for the walls ([PT-07b]) and the tree for one ray after the other,
   if it may come near what is in it before it meets a wall. The estimator is that of pti_path, with three differences that
   change no expectation:

   - Lights are sampled by area (spheres by their cone), which has no bound where a light touches a surface, so never
     without the weights of multiple importance sampling [Vea97] 9.2: the method "path-light" is left to pti_path. Where
     direct light from a near, large lamp is all there is, the solid angle of pti_path has up to 8 times less variance, for
     ten times the time; where light goes on from surface to surface, the two are alike.
   - The numbers of the camera and of the first vertex are those of the sampler, Owen-scrambled points by default; all
     later ones come from a generator in each lane, xoroshiro64* [Bla21], seeded by a hash of pixel and sample. So a
     path is a function of (seed, pixel, sample) alone, whatever lane it is in and whoever is beside it.
   - Decisions are made in float. A hit point is put back on the plane of its primitive, in a distance of at least
     16 e from the primitive's edges, and the next ray starts 2 e above it; e is the bound of the distance of a computed
     point from its plane (derived at pti_lockstep_make). Primitives are wider by what rounding can do to a hit, so
     that no ray passes between two that share an edge. Scenes with parts smaller than 2048 e, or with edges sharper than
     8 degrees, ask their tree. A ball that touches a wall is not seen from within sqrt(4 e r) of the contact. The tree
     decides as ever, also where a ray meets a wall so near an edge that rounding might, and its hits keep their digits; but
     from a wall nothing is seen that lies closer to it than 2 e. Without walls, e is that of the lamps, whose points are in
     float.

   A shadow ray starts and ends on surfaces. A plane that has all surfaces on one side cannot come between two points
   of them: the walls of a room are not asked. Parallelograms whose edges follow two axes are tested by three
   multiplications and four comparisons.

   Walls that are huge spheres ("shells") are asked by their height at a point, which needs neither centre nor radius, if the
   scene is of spheres, the camera has no lens, and shells that no light shines from and none sees through are around the
   start of its rays. Where walls meet they have no edges to keep from: all are unbounded, and the first is the one. A ray from
   inside is behind a shell where its end is. Rows of the picture whose rays may start outside are left to pti_path. The boxes
   of the spheres must bound the room, so rooms that are turned against the axes ask their tree. */

#if PTI_HAS_LOCKSTEP

/* --- lanes: pti_fw floats, pti_mw truth values, pti_uw words of 32 bits, PTI_WIDTH of each --- */

#if PTI_LANES == 2 && defined(__AVX512F__) && defined(__AVX512DQ__)
#define PTI_WIDTH 16
typedef __m512 pti_fw;
typedef __mmask16 pti_mw;
typedef __m512i pti_uw;
#define PTI_FW(T, name, wide) \
    PTI_INLINE T pti_fw_##name(pti_fw x, pti_fw y) { (void)y; return wide; }
PTI_FW(pti_fw, add, _mm512_add_ps(x, y))
PTI_FW(pti_fw, sub, _mm512_sub_ps(x, y))
PTI_FW(pti_fw, mul, _mm512_mul_ps(x, y))
PTI_FW(pti_fw, div, _mm512_div_ps(x, y))
PTI_FW(pti_fw, min, _mm512_min_ps(x, y))
PTI_FW(pti_fw, max, _mm512_max_ps(x, y))
PTI_FW(pti_mw, lt, _mm512_cmplt_ps_mask(x, y))
PTI_FW(pti_mw, le, _mm512_cmple_ps_mask(x, y))
PTI_INLINE pti_fw pti_fw_sqrt(pti_fw x) { return _mm512_sqrt_ps(x); }
PTI_INLINE pti_fw pti_fw_abs(pti_fw x) { return _mm512_abs_ps(x); }
PTI_INLINE pti_fw pti_fw_set(float x) { return _mm512_set1_ps(x); }
PTI_INLINE pti_fw pti_fw_madd(pti_fw x, pti_fw y, pti_fw z) { return _mm512_fmadd_ps(x, y, z); }
PTI_INLINE pti_fw pti_fw_nmadd(pti_fw x, pti_fw y, pti_fw z) { return _mm512_fnmadd_ps(x, y, z); }
PTI_INLINE pti_fw pti_fw_select(pti_mw m, pti_fw x, pti_fw y) { return _mm512_mask_blend_ps(m, y, x); }
PTI_INLINE unsigned pti_mw_bits(pti_mw m) { return m; }
PTI_INLINE pti_mw pti_mw_of_bits(unsigned bits) { return (pti_mw)bits; }
PTI_INLINE pti_mw pti_mw_and(pti_mw a, pti_mw b) { return (pti_mw)(a & b); }
PTI_INLINE pti_mw pti_mw_or(pti_mw a, pti_mw b) { return (pti_mw)(a | b); }
#else
#define PTI_WIDTH 8
typedef pti_f8 pti_fw;
typedef pti_m8 pti_mw;
#define pti_fw_add pti_f8_add
#define pti_fw_sub pti_f8_sub
#define pti_fw_mul pti_f8_mul
#define pti_fw_div pti_f8_div
#define pti_fw_min pti_f8_min
#define pti_fw_max pti_f8_max
#define pti_fw_lt pti_f8_lt
#define pti_fw_le pti_f8_le
#define pti_fw_sqrt pti_f8_sqrt
#define pti_fw_abs pti_f8_abs
#define pti_fw_set pti_f8_set
#define pti_fw_madd pti_f8_madd
#define pti_fw_nmadd pti_f8_nmadd
#define pti_fw_select pti_f8_select
#define pti_mw_bits pti_m8_bits
#if PTI_LANES == 2
typedef __m256i pti_uw;
PTI_INLINE pti_mw pti_mw_and(pti_mw a, pti_mw b) { return _mm256_and_ps(a, b); }
PTI_INLINE pti_mw pti_mw_or(pti_mw a, pti_mw b) { return _mm256_or_ps(a, b); }
PTI_INLINE pti_mw pti_mw_of_bits(unsigned bits)
{
    const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    return _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32((int)bits), bit), bit));
}
#elif PTI_LANES == 1
typedef struct pti_uw {
    __m128i a, b;
} pti_uw;
PTI_INLINE pti_mw pti_mw_and(pti_mw x, pti_mw y) { return pti_f8_pair(_mm_and_ps(x.a, y.a), _mm_and_ps(x.b, y.b)); }
PTI_INLINE pti_mw pti_mw_or(pti_mw x, pti_mw y) { return pti_f8_pair(_mm_or_ps(x.a, y.a), _mm_or_ps(x.b, y.b)); }
PTI_INLINE pti_mw pti_mw_of_bits(unsigned bits)
{
    const __m128i low = _mm_setr_epi32(1, 2, 4, 8), high = _mm_setr_epi32(16, 32, 64, 128), x = _mm_set1_epi32((int)bits);
    return pti_f8_pair(_mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(x, low), low)),
                       _mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(x, high), high)));
}
/* The low halves of products: SSE2 multiplies the even lanes only. */
PTI_INLINE __m128i pti_mul4(__m128i x, __m128i y)
{
    const __m128i even = _mm_mul_epu32(x, y), odd = _mm_mul_epu32(_mm_srli_epi64(x, 32), _mm_srli_epi64(y, 32));
    return _mm_unpacklo_epi32(_mm_shuffle_epi32(even, _MM_SHUFFLE(0, 0, 2, 0)), _mm_shuffle_epi32(odd, _MM_SHUFFLE(0, 0, 2, 0)));
}
#else
typedef struct pti_uw {
    uint32_t v[8];
} pti_uw;
PTI_INLINE pti_mw pti_mw_and(pti_mw x, pti_mw y)
{
    int i;
    for (i = 0; i < 8; i++) x.v[i] &= y.v[i];
    return x;
}
PTI_INLINE pti_mw pti_mw_or(pti_mw x, pti_mw y)
{
    int i;
    for (i = 0; i < 8; i++) x.v[i] |= y.v[i];
    return x;
}
PTI_INLINE pti_mw pti_mw_of_bits(unsigned bits)
{
    pti_mw m;
    int i;
    for (i = 0; i < 8; i++) m.v[i] = -(int32_t)(bits >> i & 1);
    return m;
}
#endif
#endif

/* Operations on words; n: how far a shift goes. */
#if PTI_WIDTH == 16
#define PTI_UW(name, wide, avx, sse, plain) \
    PTI_INLINE pti_uw pti_uw_##name(pti_uw x, pti_uw y, int n) { (void)y; (void)n; return wide; }
PTI_INLINE pti_uw pti_uw_set(uint32_t x) { return _mm512_set1_epi32((int)x); }
#elif PTI_LANES == 2
#define PTI_UW(name, wide, avx, sse, plain) \
    PTI_INLINE pti_uw pti_uw_##name(pti_uw x, pti_uw y, int n) { (void)y; (void)n; return avx; }
PTI_INLINE pti_uw pti_uw_set(uint32_t x) { return _mm256_set1_epi32((int)x); }
#elif PTI_LANES == 1
#define PTI_UW(name, wide, avx, sse, plain)                                    \
    PTI_INLINE pti_uw pti_uw_##name(pti_uw p, pti_uw q, int n)                  \
    {                                                                          \
        { const __m128i x = p.a, y = q.a; (void)y; (void)n; p.a = sse; }       \
        { const __m128i x = p.b, y = q.b; (void)y; (void)n; p.b = sse; }       \
        return p;                                                              \
    }
PTI_INLINE pti_uw pti_uw_set(uint32_t x)
{
    pti_uw r;
    r.a = r.b = _mm_set1_epi32((int)x);
    return r;
}
#else
#define PTI_UW(name, wide, avx, sse, plain)                     \
    PTI_INLINE pti_uw pti_uw_##name(pti_uw p, pti_uw q, int n)   \
    {                                                           \
        int i;                                                  \
        for (i = 0; i < 8; i++) {                               \
            const uint32_t x = p.v[i], y = q.v[i];              \
            (void)y;                                            \
            (void)n;                                            \
            p.v[i] = plain;                                     \
        }                                                       \
        return p;                                               \
    }
PTI_INLINE pti_uw pti_uw_set(uint32_t x)
{
    pti_uw r;
    int i;
    for (i = 0; i < 8; i++) r.v[i] = x;
    return r;
}
#endif
PTI_UW(sum, _mm512_add_epi32(x, y), _mm256_add_epi32(x, y), _mm_add_epi32(x, y), x + y)
PTI_UW(product, _mm512_mullo_epi32(x, y), _mm256_mullo_epi32(x, y), pti_mul4(x, y), x * y)
PTI_UW(xor2, _mm512_xor_si512(x, y), _mm256_xor_si256(x, y), _mm_xor_si128(x, y), x ^ y)
PTI_UW(or2, _mm512_or_si512(x, y), _mm256_or_si256(x, y), _mm_or_si128(x, y), x | y)
PTI_UW(and2, _mm512_and_si512(x, y), _mm256_and_si256(x, y), _mm_and_si128(x, y), x & y)
PTI_UW(left, _mm512_sll_epi32(x, _mm_cvtsi32_si128(n)), _mm256_slli_epi32(x, n), _mm_slli_epi32(x, n), x << n)
PTI_UW(right, _mm512_srl_epi32(x, _mm_cvtsi32_si128(n)), _mm256_srli_epi32(x, n), _mm_srli_epi32(x, n), x >> n)
PTI_UW(sign, _mm512_srai_epi32(x, 31), _mm256_srai_epi32(x, 31), _mm_srai_epi32(x, 31), 0u - (x >> 31))
PTI_INLINE pti_uw pti_uw_spread(pti_uw x) { return pti_uw_sign(x, x, 0); } /* the highest bit in all places */
PTI_INLINE pti_uw pti_uw_add(pti_uw x, pti_uw y) { return pti_uw_sum(x, y, 0); }
PTI_INLINE pti_uw pti_uw_mul(pti_uw x, pti_uw y) { return pti_uw_product(x, y, 0); }
PTI_INLINE pti_uw pti_uw_xor(pti_uw x, pti_uw y) { return pti_uw_xor2(x, y, 0); }
PTI_INLINE pti_uw pti_uw_or(pti_uw x, pti_uw y) { return pti_uw_or2(x, y, 0); }
PTI_INLINE pti_uw pti_uw_and(pti_uw x, pti_uw y) { return pti_uw_and2(x, y, 0); }
PTI_INLINE pti_uw pti_uw_shl(pti_uw x, int n) { return pti_uw_left(x, x, n); }
PTI_INLINE pti_uw pti_uw_shr(pti_uw x, int n) { return pti_uw_right(x, x, n); }

/* Lanes as numbers. */
typedef union pti_lane_row {
    pti_fw f;
    pti_uw u;
    float v[PTI_WIDTH];
    uint32_t bits[PTI_WIDTH];
} pti_lane_row;

/* Words below 2^24 as floats, floats in [0, 2^24) as words, and table[index]. */
#if PTI_WIDTH == 16
PTI_INLINE pti_fw pti_fw_from_words(pti_uw x) { return _mm512_cvtepi32_ps(x); }
PTI_INLINE pti_uw pti_uw_from_floats(pti_fw x) { return _mm512_cvttps_epi32(x); }
#elif PTI_LANES == 2
PTI_INLINE pti_fw pti_fw_from_words(pti_uw x) { return _mm256_cvtepi32_ps(x); }
PTI_INLINE pti_uw pti_uw_from_floats(pti_fw x) { return _mm256_cvttps_epi32(x); }
#else
PTI_INLINE pti_fw pti_fw_from_words(pti_uw x)
{
    pti_lane_row r;
    int i;
    r.u = x;
    for (i = 0; i < PTI_WIDTH; i++) r.v[i] = (float)(int32_t)r.bits[i];
    return r.f;
}
PTI_INLINE pti_uw pti_uw_from_floats(pti_fw x)
{
    pti_lane_row r;
    int i;
    r.f = x;
    for (i = 0; i < PTI_WIDTH; i++) r.bits[i] = (uint32_t)(int32_t)r.v[i];
    return r.u;
}
#endif
#if PTI_WIDTH == 16 && defined(__OPTIMIZE__) /* without it a macro of the compiler's, with warnings */
PTI_INLINE pti_fw pti_fw_gather(const float *table, pti_uw index) { return _mm512_i32gather_ps(index, table, 4); }
#elif PTI_WIDTH == 8 && PTI_LANES == 2
PTI_INLINE pti_fw pti_fw_gather(const float *table, pti_uw index) { return _mm256_i32gather_ps(table, index, 4); }
#else
PTI_INLINE pti_fw pti_fw_gather(const float *table, pti_uw index)
{
    pti_lane_row r;
    int i;
    r.u = index;
    for (i = 0; i < PTI_WIDTH; i++) r.v[i] = table[r.bits[i]];
    return r.f;
}
#endif

/* Vectors, one in each lane. */
typedef struct pti_w3 {
    pti_fw x, y, z;
} pti_w3;
PTI_INLINE pti_w3 pti_w3_make(pti_fw x, pti_fw y, pti_fw z)
{
    pti_w3 r;
    r.x = x;
    r.y = y;
    r.z = z;
    return r;
}
PTI_INLINE pti_w3 pti_w3_sub(pti_w3 a, pti_w3 b) { return pti_w3_make(pti_fw_sub(a.x, b.x), pti_fw_sub(a.y, b.y), pti_fw_sub(a.z, b.z)); }
PTI_INLINE pti_w3 pti_w3_scale(pti_w3 a, pti_fw k) { return pti_w3_make(pti_fw_mul(a.x, k), pti_fw_mul(a.y, k), pti_fw_mul(a.z, k)); }
PTI_INLINE pti_w3 pti_w3_mul(pti_w3 a, pti_w3 b) { return pti_w3_make(pti_fw_mul(a.x, b.x), pti_fw_mul(a.y, b.y), pti_fw_mul(a.z, b.z)); }
/* k d + o */
PTI_INLINE pti_w3 pti_w3_along(pti_w3 d, pti_fw k, pti_w3 o)
{
    return pti_w3_make(pti_fw_madd(d.x, k, o.x), pti_fw_madd(d.y, k, o.y), pti_fw_madd(d.z, k, o.z));
}
/* a.b + c */
PTI_INLINE pti_fw pti_w3_dot_add(pti_w3 a, pti_w3 b, pti_fw c)
{
    return pti_fw_madd(a.x, b.x, pti_fw_madd(a.y, b.y, pti_fw_madd(a.z, b.z, c)));
}
PTI_INLINE pti_fw pti_w3_dot(pti_w3 a, pti_w3 b) { return pti_fw_madd(a.x, b.x, pti_fw_madd(a.y, b.y, pti_fw_mul(a.z, b.z))); }
PTI_INLINE pti_w3 pti_w3_select(pti_mw m, pti_w3 a, pti_w3 b)
{
    return pti_w3_make(pti_fw_select(m, a.x, b.x), pti_fw_select(m, a.y, b.y), pti_fw_select(m, a.z, b.z));
}
PTI_INLINE pti_w3 pti_w3_set(const float v[3]) { return pti_w3_make(pti_fw_set(v[0]), pti_fw_set(v[1]), pti_fw_set(v[2])); }
PTI_INLINE pti_w3 pti_w3_normalize(pti_w3 a) { return pti_w3_scale(a, pti_fw_div(pti_fw_set(1), pti_fw_sqrt(pti_w3_dot(a, a)))); }

/* sin and cos of x in [-pi/4, pi/4], by their series: off by less than 2^-24 and 2^-23. */
PTI_INLINE8 void pti_fw_sincos(pti_fw x, pti_fw *s, pti_fw *c)
{
    const pti_fw q = pti_fw_mul(x, x);
    pti_fw p = pti_fw_madd(q, pti_fw_set(1 / 362880.f), pti_fw_set(-1 / 5040.f));
    p = pti_fw_madd(q, p, pti_fw_set(1 / 120.f));
    p = pti_fw_madd(q, p, pti_fw_set(-1 / 6.f));
    *s = pti_fw_madd(pti_fw_mul(q, p), x, x);
    p = pti_fw_madd(q, pti_fw_set(1 / 40320.f), pti_fw_set(-1 / 720.f));
    p = pti_fw_madd(q, p, pti_fw_set(1 / 24.f));
    p = pti_fw_madd(q, p, pti_fw_set(-0.5f));
    *c = pti_fw_madd(q, p, pti_fw_set(1));
}

/* --- the scene, made ready --- */

enum { PTI_LOCK_MAX = 64, PTI_LOCK_CLASSES = 7, PTI_LOCK_QUADS = 3, PTI_LOCK_TRIANGLES = 4, PTI_LOCK_SPHERES = 5, PTI_LOCK_SHELLS = 6 };

/* What a lane looks up of the primitive it has hit, and of the light it has chosen. */
enum {
    PTI_OF_N, PTI_OF_D = 3,         /* flat: the plane n.p + d = 0 */
    PTI_OF_CENTRE = 4, PTI_OF_DEPTH = 7, /* centroid and its distance to the nearest edge; centre of a sphere */
    PTI_OF_RADIUS = 8,              /* 0: flat */
    PTI_OF_ALBEDO = 9, PTI_OF_KIND = 12, PTI_OF_IOR = 13, PTI_OF_LIGHT = 14,
    PTI_OF_ALPHA = 15, PTI_OF_ETA = 16, PTI_OF_K = 19, /* of metal; alpha 0: smooth                         */
    PTI_OF_TANGENT = 22, PTI_OF_HEIGHT = 25, PTI_OF_BEND = 26, PTI_OF_COUNT = 27 /* of shells, as in `at`; centre: foot */
};
enum {
    PTI_LIT_P, PTI_LIT_E1 = 3, PTI_LIT_E2 = 6, PTI_LIT_N = 9, /* corner, edges, normal; centre of a sphere   */
    PTI_LIT_EMISSION = 12, PTI_LIT_DENSITY = 15, /* probability / area; sphere: probability                 */
    PTI_LIT_RADIUS = 16, PTI_LIT_TRIANGLE = 17, PTI_LIT_COUNT = 18
};

typedef struct pti_lockstep {
    /* classes 0, 1, 2: rectangles across x, y, z; parallelograms; triangles; spheres; shells. Those of class c stand from begin[c] on,
       first those that can block a shadow ray, up to blockers[c] */
    int begin[PTI_LOCK_CLASSES + 1], blockers[PTI_LOCK_CLASSES];
    float at[PTI_LOCK_MAX][16];     /* rectangle: place, from, to along the next axis, and along the one after, side of ng. Others: rows
                                       x, y, z, 1 of the height above the plane and of the distances from edges: two, and
                                       the distances of the opposite edges, or three. Sphere: centre, radius. Shell: foot,
                                       bend, tangent, height                                                         */
    float of[PTI_OF_COUNT][PTI_LOCK_MAX], light[PTI_LIT_COUNT][PTI_LOCK_MAX], chosen[PTI_LOCK_MAX];
    int light_count, sphere_lights, specular, metal, rough; /* specular: something is not diffuse; some metal; some rough one */
    int shading;                    /* some shading normals                                                */
    float e, e_camera;              /* how far a computed point may be off its plane; the same for rays of the camera */
    const pt_scene *tree;           /* of more than that: what is not a wall is asked for one ray after the other  */
    int walls;                      /* then `of` has these first, and a column for each material; without walls e is of lamps */
    double plane[PTI_WALLS][4];     /* n.p + d = 0 of walls                                                    */
    int from[PTI_WALLS], to[PTI_WALLS]; /* the primitives that each is                                         */
    float box[6];                   /* around what is in the tree: lower, then upper                          */
} pti_lockstep;

/* A primitive while the scene is being made ready: 0 (sphere), 3 or 4 corners. */
typedef struct pti_lock_item {
    pt_vec3 c[4];
    double radius;
    int corners, kind, material, light, twin; /* twin: the other triangle's light, or -1                    */
    int blocks, from, to;   /* from, to: primitives                                                        */
} pti_lock_item;

/* Across which axis is it a rectangle along the other two? -1: it is none. */
static int pti_lock_axis(const pti_lock_item *q)
{
    const pti_d3 a = pti_d_between(q->c[0], q->c[1]), b = pti_d_between(q->c[0], q->c[3]);
    const int none[3] = {a.x == 0 && b.x == 0, a.y == 0 && b.y == 0, a.z == 0 && b.z == 0};
    if (q->corners != 4 || (a.x != 0) + (a.y != 0) + (a.z != 0) != 1 || (b.x != 0) + (b.y != 0) + (b.z != 0) != 1) return -1;
    return none[0] ? 0 : none[1] ? 1 : none[2] ? 2 : -1;
}

static void pti_lock_single(const pt_scene *scene, const pt_primitive *p, pti_lock_item *q)
{
    memset(q, 0, sizeof *q);
    q->material = pti_primitive_material(scene, p);
    q->light = p->light;
    q->twin = -1;
    q->kind = PTI_LOCK_SPHERES;
    if (p->shape != PT_SHAPE_SPHERE) {
        q->corners = pti_corners(scene, p, q->c);
        return;
    }
    q->c[0] = scene->spheres[p->index].centre;
    q->radius = (double)scene->spheres[p->index].radius;
}

/* Item from primitive i (and perhaps i + 1, which then is its other half); how many it takes. */
static uint32_t pti_lock_collect(const pt_scene *scene, uint32_t i, double extent, pti_lock_item *q)
{
    const pt_primitive *p = &scene->primitives[i];
    pt_vec3 other[4], all[4];
    pti_lock_single(scene, p, q);
    q->from = q->to = (int)i;
    if (q->corners == 0) return 1;
    if (q->corners == 3 && i + 1 < scene->primitive_count && p[1].shape == PT_SHAPE_TRIANGLE && pti_corners(scene, &p[1], other) == 3 &&
        pti_primitive_material(scene, &p[1]) == q->material && pti_is_parallelogram(q->c, other, extent, all)) {
        memcpy(q->c, all, sizeof all);
        q->corners = 4;
        q->twin = p[1].light;
        q->to++;
    }
    q->kind = pti_lock_axis(q);
    if (q->kind < 0) q->kind = q->corners == 4 ? PTI_LOCK_QUADS : PTI_LOCK_TRIANGLES;
    return (uint32_t)(q->to - q->from) + 1;
}

static pti_d3 pti_lock_normal(const pti_lock_item *q)
{
    return pti_d_normalize(pti_d_cross(pti_d_between(q->c[0], q->c[1]), pti_d_between(q->c[0], q->c[q->corners - 1])));
}

/* Can it come between two points of the scene's surfaces? Not a plane with all of them on one side of it. */
static int pti_lock_blocks(const pti_lock_item *q, const pti_lock_item *all, int count, double e)
{
    double low = 0, high = 0;
    pti_d3 n;
    int i, k;
    if (q->corners == 0) return 1;
    n = pti_lock_normal(q);
    for (i = 0; i < count; i++)
        for (k = 0; k < (all[i].corners ? all[i].corners : 1); k++) {
            const double h = pti_d_dot(n, pti_d_between(q->c[0], all[i].c[k]));
            low = fmin(low, h - all[i].radius);
            high = fmax(high, h + all[i].radius);
        }
    return low < -e && high > e;
}

/* Do two flat items meet at an edge under an angle with a cosine above 0.99 (8 degrees)? There a point 16 e from the edge may be
   less than 2 e from the other one. */
static int pti_lock_wedge(const pti_lock_item *a, const pti_lock_item *b, double e)
{
    pti_d3 into[2];
    int i, j, k;
    for (i = 0; i < a->corners; i++)
        for (j = 0; j < b->corners; j++) {
            const pti_d3 t = pti_d_normalize(pti_d_between(b->c[j], b->c[(j + 1) % b->corners]));
            const pti_d3 p = pti_d_between(b->c[j], a->c[i]), q = pti_d_between(b->c[j], a->c[(i + 1) % a->corners]);
            const double x = pti_d_dot(p, t), y = pti_d_dot(q, t), end = pti_d_dot(pti_d_between(b->c[j], b->c[(j + 1) % b->corners]), t);
            if (pti_d_length(pti_d_cross(p, t)) > e || pti_d_length(pti_d_cross(q, t)) > e) continue;
            if (fmin(fmax(x, y), end) - fmax(fmin(x, y), 0) < e) continue; /* one beside the other */
            for (k = 0; k < 2; k++) {
                const pti_lock_item *s = k ? b : a;
                const pti_d3 d = pti_d_between(b->c[j], s->c[((k ? j : i) + 2) % s->corners]);
                into[k] = pti_d_normalize(pti_d_sub(d, pti_d_scale(t, pti_d_dot(d, t))));
            }
            if (pti_d_dot(into[0], into[1]) > 0.99) return 1;
        }
    return 0;
}

/* The mean of the corners, or the centre. */
static pti_d3 pti_lock_middle(const pti_lock_item *q)
{
    pti_d3 sum = pti_d_from(q->c[0]);
    int i;
    for (i = 1; i < q->corners; i++) sum = pti_d_add(sum, pti_d_from(q->c[i]));
    return q->corners ? pti_d_scale(sum, 1.0 / q->corners) : sum;
}

/* row: x, y, z, 1 of the height of a point above the plane through a across s (unit). */
static void pti_lock_row(float *row, pti_d3 s, pt_vec3 a)
{
    row[0] = (float)s.x;
    row[1] = (float)s.y;
    row[2] = (float)s.z;
    row[3] = (float)-pti_d_dot(s, pti_d_from(a));
}

/* Writes what is tested; the distance of the centroid from the nearest edge. */
static double pti_lock_write_flat(const pti_lock_item *q, float *at)
{
    const int b = (q->kind + 1) % 3, c = (q->kind + 2) % 3;
    const pti_d3 n = pti_lock_normal(q), middle = pti_lock_middle(q);
    double depth = HUGE_VAL;
    int i, k;
    for (i = 0; i < q->corners; i++) {
        const pti_d3 inwards = pti_d_normalize(pti_d_cross(n, pti_d_between(q->c[i], q->c[(i + 1) % q->corners])));
        const double d = pti_d_dot(inwards, pti_d_sub(middle, pti_d_from(q->c[i])));
        depth = fmin(depth, d);
        if (q->kind == PTI_LOCK_QUADS && i != 0 && i != 3) continue;
        if (q->kind >= PTI_LOCK_QUADS) pti_lock_row(at + (i == 0 ? 4 : q->corners == 4 ? 8 : 4 + 4 * i), inwards, q->c[i]);
        if (q->kind == PTI_LOCK_QUADS) at[i == 0 ? 12 : 13] = (float)(2 * d);
    }
    if (q->kind >= PTI_LOCK_QUADS) {
        pti_lock_row(at, n, q->c[0]);
        return depth;
    }
    at[0] = (float)pti_along(&q->c[0], q->kind);
    for (k = 0; k < 2; k++) {
        const float x = (float)pti_along(&q->c[0], k ? c : b), y = (float)pti_along(&q->c[2], k ? c : b);
        at[1 + 2 * k] = x < y ? x : y;
        at[2 + 2 * k] = x < y ? y : x;
    }
    at[5] = (float)(q->kind == 0 ? n.x : q->kind == 1 ? n.y : n.z); /* 1 or -1 */
    return depth;
}

static void pti_lock_put(float (*table)[PTI_LOCK_MAX], int row, int i, pti_d3 v)
{
    table[row][i] = (float)v.x;
    table[row + 1][i] = (float)v.y;
    table[row + 2][i] = (float)v.z;
}

/* A light of one item; its probability is a multiple of 2^-24, as the number that chooses is. */
static void pti_lock_write_light(pti_lockstep *k, const pt_scene *scene, const pti_lock_item *q, pti_d3 n, double *sum)
{
    const pt_material *m = &scene->materials[q->material];
    const int i = k->light_count++;
    const double before = floor(*sum * 16777216 + 0.5) / 16777216;
    double area = scene->lights[q->light].area, pmf = scene->lights[q->light].pmf;
    if (q->twin >= 0) {
        area += scene->lights[q->twin].area;
        pmf += scene->lights[q->twin].pmf;
    }
    *sum += pmf;
    pmf = floor(*sum * 16777216 + 0.5) / 16777216 - before;
    k->chosen[i] = (float)before;
    pti_lock_put(k->light, PTI_LIT_P, i, pti_d_from(q->c[0]));
    pti_lock_put(k->light, PTI_LIT_E1, i, pti_d_between(q->c[0], q->c[1]));
    pti_lock_put(k->light, PTI_LIT_E2, i, q->corners ? pti_d_between(q->c[0], q->c[q->corners - 1]) : pti_d(0, 0, 0));
    pti_lock_put(k->light, PTI_LIT_N, i, n);
    pti_lock_put(k->light, PTI_LIT_EMISSION, i, pti_d((double)m->emission.r, (double)m->emission.g, (double)m->emission.b));
    k->light[PTI_LIT_DENSITY][i] = (float)(q->corners ? pmf / area : pmf);
    k->light[PTI_LIT_RADIUS][i] = (float)q->radius;
    k->light[PTI_LIT_TRIANGLE][i] = q->corners == 3;
    k->sphere_lights += q->corners == 0;
}

static void pti_lock_write_material(pti_lockstep *k, const pt_material *m, int i)
{
    pti_lock_put(k->of, PTI_OF_ALBEDO, i, pti_d((double)m->albedo.r, (double)m->albedo.g, (double)m->albedo.b));
    k->of[PTI_OF_KIND][i] = (float)m->kind;
    k->of[PTI_OF_IOR][i] = (float)pti_ior(m);
    k->specular |= m->kind != PT_MATERIAL_DIFFUSE;
    if (m->kind != PT_MATERIAL_CONDUCTOR) return;
    k->of[PTI_OF_ALPHA][i] = pti_is_smooth(m) ? 0 : (float)m->roughness * (float)m->roughness;
    pti_lock_put(k->of, PTI_OF_ETA, i, pti_d((double)m->eta.r, (double)m->eta.g, (double)m->eta.b));
    pti_lock_put(k->of, PTI_OF_K, i, pti_d((double)m->k.r, (double)m->k.g, (double)m->k.b));
    k->metal = 1;
    k->rough |= !pti_is_smooth(m);
}

/* A shell is a sphere so large beside the room within that its centre and radius have no digits for that. With q = p - a from a
   point a of it near the room, the foot, (|p - c|^2 - r^2) / 2 r is bend |q|^2 + tangent.q + height, with bend = 1 / 2 r and
   tangent = (a - c) / r: all numbers of the size of the room, as for a plane, which has bend 0 [Spe62]. That is the height of p
   above it, up to its square / 2 r; the tangent points out, and 1 / r there is the curvature. */
static void pti_lock_write_shell(pti_lockstep *k, const pti_lock_item *q, int i)
{
    const double r = q->radius;
    const pti_d3 foot = pti_d_from(q->c[1]), a = pti_d_sub(foot, pti_d_from(q->c[0])), tangent = pti_d_scale(a, 1 / r);
    const double bend = 0.5 / r, height = (pti_d_length(a) - r) * (pti_d_length(a) + r) * bend;
    const double row[8] = {foot.x, foot.y, foot.z, bend, tangent.x, tangent.y, tangent.z, height};
    int j;
    for (j = 0; j < 8; j++) k->at[i][j] = (float)row[j];
    pti_lock_put(k->of, PTI_OF_CENTRE, i, foot);
    pti_lock_put(k->of, PTI_OF_TANGENT, i, tangent);
    k->of[PTI_OF_HEIGHT][i] = (float)height;
    k->of[PTI_OF_BEND][i] = (float)bend;
}

/* Writes item q as number i, but for its light; returns its smallest measure: from the middle to an edge, across a ball. */
static double pti_lock_write(pti_lockstep *k, const pt_scene *scene, const pti_lock_item *q, int i)
{
    pti_d3 n = pti_d(0, 0, 0);
    double depth = q->radius;
    if (q->corners) {
        n = pti_lock_normal(q);
        depth = pti_lock_write_flat(q, k->at[i]);
    } else {
        k->at[i][0] = (float)q->c[0].x;
        k->at[i][1] = (float)q->c[0].y;
        k->at[i][2] = (float)q->c[0].z;
        k->at[i][3] = (float)q->radius;
    }
    pti_lock_put(k->of, PTI_OF_N, i, n);
    k->of[PTI_OF_D][i] = (float)-pti_d_dot(n, pti_d_from(q->c[0]));
    if (k->tree) {
        k->plane[i][0] = n.x;
        k->plane[i][1] = n.y;
        k->plane[i][2] = n.z;
        k->plane[i][3] = -pti_d_dot(n, pti_d_from(q->c[0]));
        k->from[i] = q->from;
        k->to[i] = q->to;
    }
    pti_lock_put(k->of, PTI_OF_CENTRE, i, pti_lock_middle(q));
    k->of[PTI_OF_DEPTH][i] = (float)depth;
    k->of[PTI_OF_RADIUS][i] = (float)q->radius;
    if (q->kind == PTI_LOCK_SHELLS) pti_lock_write_shell(k, q, i);
    pti_lock_write_material(k, &scene->materials[q->material], i);
    k->of[PTI_OF_LIGHT][i] = (float)q->light;
    return q->corners ? depth : 2 * depth;
}

/* Rough metal: the density of GGX facets at a half vector that is off by 3 u is off by 6 u / alpha of itself at most, where
   u = 2^-24: 7e-4 from the alpha on that is taken, and more where the way out grazes the facet, by the cosine there. The
   squares of eta and k have room in a float. */
static int pti_lock_takes(const pt_material *m)
{
    const double most = fmax(pti_max3((double)m->eta.r, (double)m->eta.g, (double)m->eta.b), pti_max3((double)m->k.r, (double)m->k.g, (double)m->k.b));
    if (m->kind == PT_MATERIAL_DIELECTRIC) return pti_is_smooth(m);
    return m->kind != PT_MATERIAL_CONDUCTOR || (most < 1e6 && (pti_is_smooth(m) || (double)m->roughness * (double)m->roughness >= 1 / 2048.));
}

/* Does a scene need nothing else, but perhaps `more`? */
static int pti_lock_knows(const pt_scene *scene, unsigned more)
{
    const unsigned known = more | PT_NEEDS_TRIANGLES | PT_NEEDS_PARALLELOGRAMS | PT_NEEDS_SPHERES | PT_NEEDS_DIFFUSE | PT_NEEDS_MIRROR |
                           PT_NEEDS_DIELECTRIC | PT_NEEDS_CONDUCTOR | PT_NEEDS_ROUGHNESS | PT_NEEDS_UVS | PT_NEEDS_AREA_LIGHTS | PT_NEEDS_BVH;
    return (scene->needs & ~known) == 0 && scene->primitive_count > 0;
}

static int pti_lock_bright(const pti_lockstep *k)
{
    int j;
    for (j = 0; j < k->light_count; j++)
        if (!(k->light[PTI_LIT_DENSITY][j] > 0)) return 0; /* too dim for 24 bits */
    return 1;
}

#define PTI_LOCK_LEAST 1e-15 /* the square of a thousandth of it is a float with all its digits */

/* Is the smallest thing large enough beside e, and for squares and densities of lengths in float? */
static int pti_lock_large(const pti_lockstep *k, double smallest) { return smallest > 2048 * (double)k->e && smallest > PTI_LOCK_LEAST; }

/* Writes items class by class, what blocks first, and lights as they come where `sum` adds up their probabilities; the smallest
   measure. */
static double pti_lock_write_items(pti_lockstep *k, const pt_scene *scene, const pti_lock_item *items, int count, double *sum)
{
    double smallest = HUGE_VAL;
    int kind, blocks, j, n = 0;
    for (kind = 0; kind < PTI_LOCK_CLASSES; kind++) {
        k->begin[kind] = n;
        for (blocks = 1; blocks >= 0; blocks--) {
            for (j = 0; j < count; j++) {
                const pti_lock_item *q = &items[j];
                if (q->kind != kind || q->blocks != blocks) continue;
                smallest = fmin(smallest, pti_lock_write(k, scene, q, n));
                if (sum && q->light >= 0) {
                    k->of[PTI_OF_LIGHT][n] = (float)k->light_count;
                    pti_lock_write_light(k, scene, q, q->corners ? pti_lock_normal(q) : pti_d(0, 0, 0), sum);
                }
                n++;
            }
            if (blocks) k->blockers[kind] = n;
        }
    }
    k->begin[PTI_LOCK_CLASSES] = n;
    return smallest;
}

/* Which of them block, seen by `all` there is; 0: two of them are a wedge. */
static int pti_lock_relate(pti_lock_item *items, int count, int all, double e)
{
    int i, j;
    for (j = 0; j < count; j++) {
        items[j].blocks = pti_lock_blocks(&items[j], items, all, e);
        for (i = 0; i < j; i++)
            if (pti_lock_wedge(&items[j], &items[i], 4 * e)) return 0;
    }
    return 1;
}

/* How far a computed point may be off its plane. With u = 2^-24 and all coordinates at most x, the height n.p + d of a point is
   computed with an error of 3 roundings of at most 3.5 x each, putting the point back on the plane rounds its coordinates once
   (1.8 u x), and a plane is off its corners by the roundings of n and d (4.4 u x): all together below 17 u x = e. */
static float pti_lock_error(double x) { return (float)(17 * PTI_2_M24 * x); }

static double pti_lock_extent(const pt_scene *scene)
{
    return fmax(pti_max3((double)scene->lo.x, (double)scene->lo.y, (double)scene->lo.z),
                pti_max3((double)scene->hi.x, (double)scene->hi.y, (double)scene->hi.z));
}

/* Has a primitive shading normals? */
static int pti_lock_smooth(const pt_scene *scene, uint32_t i)
{
    const pt_primitive *p = &scene->primitives[i];
    return p->shape == PT_SHAPE_TRIANGLE && scene->meshes[scene->triangles[p->index].mesh].has_normals;
}

/* The walls of the scene's tree, and the corners of its box in two items more; 0: not all are items, or some have
   shading normals. */
static int pti_lock_collect_walls(const pt_scene *scene, pti_lock_item *items)
{
    const pt_wide *tree = &scene->wide;
    const pt_vec3 a = scene->lo, b = scene->hi;
    uint32_t i = 0;
    int count = 0, k;
    while (i < tree->wall_count) {
        const uint32_t id = tree->walls[i], taken = pti_lock_collect(scene, id, (double)tree->extent, &items[count++]);
        if (taken == 2 && (i + 1 == tree->wall_count || tree->walls[i + 1] != id + 1)) return 0;
        if (pti_lock_smooth(scene, id) || pti_lock_smooth(scene, id + taken - 1)) return 0;
        i += taken;
    }
    for (k = 0; k < 2; k++) {
        const pt_real z = k ? b.z : a.z;
        pti_lock_item *q = &items[count + k];
        memset(q, 0, sizeof *q);
        q->corners = 4;
        q->c[0] = pt_v3(a.x, a.y, z);
        q->c[1] = pt_v3(b.x, a.y, z);
        q->c[2] = pt_v3(b.x, b.y, z);
        q->c[3] = pt_v3(a.x, b.y, z);
    }
    return count;
}

/* The box around all but walls. */
static void pti_lock_write_box(pti_lockstep *k, const pt_wide *tree)
{
    const pti_node8 *root = (const pti_node8 *)(const void *)pti_place(tree, tree->things);
    int i, j;
    for (i = 0; i < 3; i++) {
        k->box[i] = root->box[i][0];
        k->box[3 + i] = root->box[3 + i][0];
        for (j = 1; j < 8; j++) {
            if (root->box[i][j] < k->box[i]) k->box[i] = root->box[i][j];
            if (root->box[3 + i][j] > k->box[3 + i]) k->box[3 + i] = root->box[3 + i][j];
        }
    }
}

/* Lets lanes ask for the walls of a scene that is ready otherwise, if they and its lamps (of that smallest measure) are large
   beside what rounding is in all of the scene, and as seen from the eye; else all is left to the tree. */
static void pti_lockstep_make_walls(pti_lockstep *k, const pt_scene *scene, pt_vec3 eye, double smallest)
{
    const double x = pti_lock_extent(scene), from = fmax(x, pti_max3((double)eye.x, (double)eye.y, (double)eye.z));
    pti_lock_item items[PTI_WALLS + 2];
    pti_lockstep all = *k;
    int count, i;
    if (scene->wide.wall_count == 0) return;
    count = pti_lock_collect_walls(scene, items);
    if (count == 0 || count + (int)scene->material_count > PTI_LOCK_MAX) return;
    all.e = pti_lock_error(x);
    all.e_camera = pti_lock_error(from);
    if (!pti_lock_relate(items, count, count + 2, (double)all.e)) return;
    smallest = fmin(smallest, pti_lock_write_items(&all, scene, items, count, NULL));
    if (!pti_lock_large(&all, smallest) || !(smallest > 64 * (double)all.e_camera) || !(x < 1e15)) return;
    for (i = 0; i < (int)scene->material_count; i++) pti_lock_write_material(&all, &scene->materials[i], count + i);
    pti_lock_write_box(&all, &scene->wide);
    all.walls = count;
    *k = all;
}

/* Makes a scene of any size ready, whose rays are asked of its tree. Lamps are few, and as large beside e as what a small scene is
   made of: their points are in float. */
static int pti_lockstep_make_tree(pti_lockstep *k, const pt_scene *scene, pt_vec3 eye)
{
    double smallest = HUGE_VAL, sum = 0, x = 0;
    uint32_t i, j;
    if (!pti_lock_knows(scene, PT_NEEDS_SHADING_NORMALS) || scene->material_count > PTI_LOCK_MAX || scene->light_count > PTI_LOCK_MAX) return 0;
    memset(k, 0, sizeof *k);
    k->tree = scene;
    k->shading = (scene->needs & PT_NEEDS_SHADING_NORMALS) != 0;
    for (i = 0; i < scene->material_count; i++) {
        if (!pti_lock_takes(&scene->materials[i])) return 0;
        pti_lock_write_material(k, &scene->materials[i], (int)i);
    }
    for (i = 0; i < scene->light_count; i++) {
        pti_lock_item q;
        float unused[16];
        pti_lock_single(scene, &scene->primitives[scene->lights[i].primitive], &q);
        for (j = 0; j < (q.corners ? (uint32_t)q.corners : 1); j++)
            x = fmax(x, q.radius + pti_max3(fabs((double)q.c[j].x), fabs((double)q.c[j].y), fabs((double)q.c[j].z)));
        q.kind = PTI_LOCK_TRIANGLES;
        smallest = fmin(smallest, q.corners ? pti_lock_write_flat(&q, unused) : 2 * q.radius);
        pti_lock_write_light(k, scene, &q, q.corners ? pti_lock_normal(&q) : pti_d(0, 0, 0), &sum);
    }
    k->e = pti_lock_error(x);
    if (!pti_lock_bright(k) || !pti_lock_large(k, smallest) || !(x < 1e15)) return 0;
    pti_lockstep_make_walls(k, scene, eye, smallest);
    return 1;
}

/* Makes a small scene ready that is these items, seen from such places, with coordinates up to x; 0: it is not one for lanes. */
static int pti_lockstep_make_items(pti_lockstep *k, const pt_scene *scene, pti_lock_item *items, int count, double x)
{
    double smallest, sum = 0;
    int j;
    for (j = 0; j < count; j++)
        if (!pti_lock_takes(&scene->materials[items[j].material])) return 0;
    if (!pti_lock_relate(items, count, count, (double)k->e)) return 0;
    smallest = pti_lock_write_items(k, scene, items, count, &sum);
    return pti_lock_bright(k) && pti_lock_large(k, smallest) && smallest > 64 * (double)k->e_camera && x < 1e15;
}

/* Makes a small scene ready; 0: it is not one for lanes, or not seen from such a place. */
static int pti_lockstep_make(pti_lockstep *k, const pt_scene *scene, pt_vec3 eye)
{
    const double x = pti_lock_extent(scene), from = fmax(x, pti_max3((double)eye.x, (double)eye.y, (double)eye.z));
    pti_lock_item items[PTI_LOCK_MAX];
    uint32_t i;
    int count = 0;
    if (!pti_lock_knows(scene, 0) || scene->primitive_count > PTI_LOCK_MAX) return 0;
    memset(k, 0, sizeof *k);
    k->e = pti_lock_error(x);
    k->e_camera = pti_lock_error(from);
    for (i = 0; i < scene->primitive_count; count++) i += pti_lock_collect(scene, i, x, &items[count]);
    return pti_lockstep_make_items(k, scene, items, count, x);
}

/* Is a point, and what rounding makes of it, inside all shells? */
static int pti_lock_inside(const pti_lockstep *k, pt_vec3 p)
{
    int i, j;
    for (i = k->begin[PTI_LOCK_SHELLS]; i < k->begin[PTI_LOCK_CLASSES]; i++) {
        const float *at = k->at[i], v[3] = {(float)p.x, (float)p.y, (float)p.z};
        double height = (double)at[7];
        for (j = 0; j < 3; j++) {
            const double q = (double)v[j] - (double)at[j];
            height += q * ((double)at[3] * q + (double)at[4 + j]);
        }
        if (!(height < -4 * (double)k->e)) return 0;
    }
    return 1;
}

/* Do two shells meet in the room, around `middle` with half its diagonal, at less than 8 degrees? They do so along a circle, and
   everywhere at the same angle. */
static int pti_lock_sharp(const pti_lock_item *a, const pti_lock_item *b, pti_d3 middle, double diagonal)
{
    const pti_d3 between = pti_d_between(a->c[0], b->c[0]), to = pti_d_sub(middle, pti_d_from(a->c[0]));
    const double r = a->radius, d = pti_d_length(between), cosine = (r * r + b->radius * b->radius - d * d) / (2 * r * b->radius);
    double at, ring, along, across;
    if (!(fabs(cosine) < 1 && cosine < -0.99)) return 0; /* one in the other: the outer is never seen */
    at = (d * d + r * r - b->radius * b->radius) / (2 * d);
    ring = sqrt(fmax(0, (r - at) * (r + at)));
    along = pti_d_dot(to, between) / d;
    across = sqrt(fmax(0, pti_d_dot(to, to) - along * along));
    return hypot(along - at, across - ring) < 1.01 * diagonal;
}

/* The box of the room that shells make: all is in it that a path from inside them can come to. */
static void pti_lock_room(const pti_lock_item *items, int count, double lo[3], double hi[3])
{
    int j, i;
    for (i = 0; i < 3; i++) {
        lo[i] = -HUGE_VAL;
        hi[i] = HUGE_VAL;
    }
    for (j = 0; j < count; j++)
        for (i = 0; i < 3 && items[j].kind == PTI_LOCK_SHELLS; i++) {
            lo[i] = fmax(lo[i], (double)pti_along(&items[j].c[0], i) - items[j].radius);
            hi[i] = fmin(hi[i], (double)pti_along(&items[j].c[0], i) + items[j].radius);
        }
}

/* Makes a scene of spheres ready some of which are shells: all those around `start`, where a ray of the camera starts. No path from
   inside gets out of them, since they are not glass. A height has three times the roundings that it has above a plane: those
   of q, of a square, and of one product more. */
static int pti_lockstep_make_shells(pti_lockstep *k, const pt_scene *scene, pt_vec3 start)
{
    double lo[3], hi[3], x = 0, balls = 0, diagonal = 0;
    pti_lock_item items[PTI_LOCK_MAX];
    pti_d3 middle;
    int count, i, j;
    if (!pti_lock_knows(scene, 0) || scene->primitive_count > PTI_LOCK_MAX) return 0;
    memset(k, 0, sizeof *k);
    count = (int)scene->primitive_count;
    for (j = 0; j < count; j++) {
        pti_lock_item *q = &items[j];
        pti_lock_single(scene, &scene->primitives[j], q);
        q->from = q->to = j;
        if (q->corners) return 0;
        if (q->light < 0 && scene->materials[q->material].kind != PT_MATERIAL_DIELECTRIC && pti_d_length(pti_d_between(q->c[0], start)) < q->radius) q->kind = PTI_LOCK_SHELLS;
        else balls = fmax(balls, q->radius + pti_max3(fabs((double)q->c[0].x), fabs((double)q->c[0].y), fabs((double)q->c[0].z)));
    }
    pti_lock_room(items, count, lo, hi);
    for (i = 0; i < 3; i++) {
        x = fmax(x, fmax(fabs(lo[i]), fabs(hi[i])));
        diagonal = hypot(diagonal, (hi[i] - lo[i]) / 2);
    }
    if (!(x < 1e15)) return 0; /* no shells */
    middle = pti_d((lo[0] + hi[0]) / 2, (lo[1] + hi[1]) / 2, (lo[2] + hi[2]) / 2);
    for (j = 0; j < count; j++) {
        pti_lock_item *q = &items[j];
        const pti_d3 out = pti_d_sub(middle, pti_d_from(q->c[0])), centre = pti_d_from(q->c[0]);
        if (q->kind != PTI_LOCK_SHELLS) continue;
        if (!(pti_d_length(out) > 0)) return 0;
        q->c[1] = pti_d_to(pti_d_add(centre, pti_d_scale(pti_d_normalize(out), q->radius)));
        x = fmax(x, pti_max3(fabs((double)q->c[1].x), fabs((double)q->c[1].y), fabs((double)q->c[1].z)));
        for (i = 0; i < j; i++)
            if (items[i].kind == PTI_LOCK_SHELLS && pti_lock_sharp(q, &items[i], middle, diagonal)) return 0;
    }
    k->e = k->e_camera = pti_lock_error(fmax(3 * x, balls));
    for (j = 0; j < count; j++)
        if (items[j].kind == PTI_LOCK_SHELLS && !(items[j].radius < 1e14 * (double)k->e)) return 0; /* for the height, in double */
    return pti_lockstep_make_items(k, scene, items, count, fmax(x, balls));
}

/* --- rays --- */

#define PTI_LOCK_FAR 3e38f

/* The nearest hit of a ray in each lane so far. */
typedef struct pti_lock_best {
    pti_fw t, i, margin;    /* distance, number of the primitive, distance to its nearest edge              */
    pti_fw key;             /* PTI_LOCK_CAREFUL: what they are ordered by                                  */
} pti_lock_best;

/* What is asked: the nearest hit; whether there is any before best->t; the nearest, where it was met outside its edges. A ray
   that passes outside a convex edge by less than rounding meets both planes there, the far one, from behind, before the
   near one. So what is met by its slack alone is ordered by t - 2 slack from its front, t + 2 slack from behind. */
enum { PTI_LOCK_NEAREST, PTI_LOCK_ANY, PTI_LOCK_CAREFUL };

/* A primitive that is met at t, `margin` inside its edges; slack > 0 from its front. */
PTI_INLINE8 pti_mw pti_lock_keep(pti_lock_best *best, pti_fw t, pti_fw margin, pti_fw slack, int i, const int how)
{
    const pti_fw zero = pti_fw_set(0);
    pti_mw met = pti_mw_and(pti_fw_lt(zero, t), pti_fw_le(zero, pti_fw_add(margin, pti_fw_abs(slack))));
    if (how == PTI_LOCK_CAREFUL) {
        const pti_fw key = pti_fw_sub(t, pti_fw_select(pti_fw_lt(margin, zero), pti_fw_add(slack, slack), zero));
        met = pti_mw_and(met, pti_mw_and(pti_fw_lt(key, best->key), pti_fw_lt(t, pti_fw_set(PTI_LOCK_FAR))));
        best->key = pti_fw_select(met, key, best->key);
    } else {
        met = pti_mw_and(met, pti_fw_lt(t, best->t));
    }
    if (how == PTI_LOCK_ANY) return met;
    best->t = pti_fw_select(met, t, best->t);
    best->i = pti_fw_select(met, pti_fw_set((float)i), best->i);
    best->margin = pti_fw_select(met, margin, best->margin);
    return met;
}

/* Rectangles across axis `kind`, whose coordinates are o.x, d.x after a turn of the axes. */
PTI_INLINE8 pti_mw pti_lock_rectangles(const pti_lockstep *k, int kind, pti_w3 o, pti_w3 d, float e, pti_lock_best *best, pti_mw met, const int how)
{
    const pti_fw inverse = pti_fw_div(pti_fw_set(1), d.x), slack = pti_fw_mul(inverse, pti_fw_set(-2 * e));
    const int end = how == PTI_LOCK_ANY ? k->blockers[kind] : k->begin[kind + 1];
    int i;
    for (i = k->begin[kind]; i < end; i++) {
        const float *at = k->at[i];
        const pti_fw t = pti_fw_mul(pti_fw_sub(pti_fw_set(at[0]), o.x), inverse);
        const pti_fw y = pti_fw_madd(t, d.y, o.y), z = pti_fw_madd(t, d.z, o.z);
        const pti_fw my = pti_fw_min(pti_fw_sub(y, pti_fw_set(at[1])), pti_fw_sub(pti_fw_set(at[2]), y));
        const pti_fw mz = pti_fw_min(pti_fw_sub(z, pti_fw_set(at[3])), pti_fw_sub(pti_fw_set(at[4]), z));
        const pti_mw hit = pti_lock_keep(best, t, pti_fw_min(my, mz), pti_fw_mul(slack, pti_fw_set(at[5])), i, how);
        if (how == PTI_LOCK_ANY) met = pti_mw_or(met, hit);
    }
    return met;
}

PTI_INLINE8 pti_fw pti_lock_height(const float *row, pti_w3 p)
{
    return pti_w3_dot_add(pti_w3_set(row), p, pti_fw_set(row[3]));
}

PTI_INLINE8 pti_mw pti_lock_flats(const pti_lockstep *k, int kind, pti_w3 o, pti_w3 d, float e, pti_lock_best *best, pti_mw met, const int how)
{
    const int end = how == PTI_LOCK_ANY ? k->blockers[kind] : k->begin[kind + 1];
    int i;
    for (i = k->begin[kind]; i < end; i++) {
        const float *at = k->at[i];
        const pti_fw inverse = pti_fw_div(pti_fw_set(-1), pti_w3_dot(pti_w3_set(at), d));
        const pti_fw t = pti_fw_mul(pti_lock_height(at, o), inverse);
        const pti_w3 p = pti_w3_along(d, t, o);
        const pti_fw u = pti_lock_height(at + 4, p), v = pti_lock_height(at + 8, p);
        pti_fw margin = pti_fw_min(u, v);
        pti_mw hit;
        if (kind == PTI_LOCK_TRIANGLES) margin = pti_fw_min(margin, pti_lock_height(at + 12, p));
        else margin = pti_fw_min(margin, pti_fw_min(pti_fw_sub(pti_fw_set(at[12]), u), pti_fw_sub(pti_fw_set(at[13]), v)));
        hit = pti_lock_keep(best, t, margin, pti_fw_mul(inverse, pti_fw_set(2 * e)), i, how);
        if (how == PTI_LOCK_ANY) met = pti_mw_or(met, hit);
    }
    return met;
}

/* As pti_sphere does it, for d of length 1. A ray that starts less than 5 e inside comes from something that touches the
   ball, and does not see it. */
PTI_INLINE8 pti_mw pti_lock_balls(const pti_lockstep *k, pti_w3 o, pti_w3 d, pti_lock_best *best, pti_mw met, const int how)
{
    const pti_fw zero = pti_fw_set(0);
    int i;
    for (i = k->begin[PTI_LOCK_SPHERES]; i < k->begin[PTI_LOCK_SHELLS]; i++) {
        const pti_w3 f = pti_w3_sub(o, pti_w3_set(k->at[i]));
        const pti_fw r = pti_fw_set(k->at[i][3]), b = pti_fw_sub(zero, pti_w3_dot(f, d)), far = pti_fw_sqrt(pti_w3_dot(f, f));
        const pti_w3 foot = pti_w3_along(d, b, f);
        const pti_fw l = pti_fw_sqrt(pti_w3_dot(foot, foot)), square = pti_fw_mul(pti_fw_sub(r, l), pti_fw_add(r, l));
        const pti_fw root = pti_fw_sqrt(pti_fw_max(square, zero)), c = pti_fw_mul(pti_fw_sub(far, r), pti_fw_add(far, r));
        const pti_fw q = pti_fw_select(pti_fw_lt(b, zero), pti_fw_sub(b, root), pti_fw_add(b, root)), t0 = pti_fw_div(c, q);
        const pti_fw first = pti_fw_min(t0, q), t = pti_fw_select(pti_fw_lt(zero, first), first, pti_fw_max(t0, q));
        const pti_mw grazed = pti_mw_and(pti_fw_lt(c, zero), pti_fw_lt(pti_fw_sub(r, far), pti_fw_set(5 * k->e)));
        const pti_fw margin = pti_fw_select(pti_mw_or(grazed, pti_fw_lt(square, zero)), pti_fw_set(-1), pti_fw_set(PTI_LOCK_FAR));
        const pti_mw hit = pti_lock_keep(best, t, margin, zero, i, how);
        if (how == PTI_LOCK_ANY) met = pti_mw_or(met, hit);
    }
    return met;
}

/* Along a ray from inside the height is height + t (b + bend t), and rises through 0 once. Rounding may have put the origin
   outside, where walls meet: then a ray that leads out hits at once. What is above 0 at t lies behind the shell. */
#define PTI_LOCK_SHELL 1e37f /* the margin of what has no edges, but is no ball */
PTI_INLINE8 pti_mw pti_lock_shells(const pti_lockstep *k, pti_w3 o, pti_w3 d, pti_lock_best *best, pti_mw met, const int how)
{
    const pti_fw zero = pti_fw_set(0);
    int i;
    for (i = k->begin[PTI_LOCK_SHELLS]; i < k->begin[PTI_LOCK_CLASSES]; i++) {
        const float *at = k->at[i];
        const pti_w3 q = pti_w3_sub(o, pti_w3_set(at)), tangent = pti_w3_set(at + 4);
        const pti_fw bend = pti_fw_set(at[3]), c = pti_fw_madd(bend, pti_w3_dot(q, q), pti_w3_dot_add(tangent, q, pti_fw_set(at[7])));
        const pti_fw b = pti_fw_madd(pti_fw_add(bend, bend), pti_w3_dot(q, d), pti_w3_dot(tangent, d));
        if (how == PTI_LOCK_ANY) {
            met = pti_mw_or(met, pti_fw_lt(zero, pti_fw_madd(best->t, pti_fw_madd(bend, best->t, b), c)));
        } else {
            const pti_fw root = pti_fw_sqrt(pti_fw_max(pti_fw_nmadd(pti_fw_mul(pti_fw_set(4), bend), c, pti_fw_mul(b, b)), zero));
            const pti_fw soon = pti_fw_max(pti_fw_div(pti_fw_mul(pti_fw_set(-2), c), pti_fw_add(b, root)), pti_fw_set(1e-30f));
            const pti_fw late = pti_fw_div(pti_fw_sub(root, b), pti_fw_add(bend, bend));
            pti_lock_keep(best, pti_fw_select(pti_fw_lt(zero, b), soon, late), pti_fw_set(PTI_LOCK_SHELL), zero, i, how);
        }
    }
    return met;
}

/* All primitives against a ray in each lane, d of length 1. PTI_LOCK_ANY: those that can block. */
PTI_INLINE8 pti_mw pti_lock_ask(const pti_lockstep *k, pti_w3 o, pti_w3 d, float e, pti_lock_best *best, const int how)
{
    pti_mw met = pti_mw_of_bits(0);
    if (k->begin[1] > k->begin[0]) met = pti_lock_rectangles(k, 0, o, d, e, best, met, how);
    if (k->begin[2] > k->begin[1])
        met = pti_lock_rectangles(k, 1, pti_w3_make(o.y, o.z, o.x), pti_w3_make(d.y, d.z, d.x), e, best, met, how);
    if (k->begin[3] > k->begin[2])
        met = pti_lock_rectangles(k, 2, pti_w3_make(o.z, o.x, o.y), pti_w3_make(d.z, d.x, d.y), e, best, met, how);
    met = pti_lock_flats(k, PTI_LOCK_QUADS, o, d, e, best, met, how);
    met = pti_lock_flats(k, PTI_LOCK_TRIANGLES, o, d, e, best, met, how);
    met = pti_lock_balls(k, o, d, best, met, how);
    return pti_lock_shells(k, o, d, best, met, how);
}

/* Is there something before t that blocks? */
static pti_mw pti_lock_any(const pti_lockstep *k, pti_w3 o, pti_w3 d, pti_fw t)
{
    pti_lock_best end;
    end.t = t;
    end.i = end.margin = end.key = pti_fw_set(0);
    return pti_lock_ask(k, o, d, k->e, &end, PTI_LOCK_ANY);
}

/* The nearest hits. Only lanes that need it take the careful answer: what a lane finds is its own matter. */
static void pti_lock_nearest(const pti_lockstep *k, pti_w3 o, pti_w3 d, float e, pti_lock_best *best)
{
    pti_lock_best careful;
    pti_mw doubtful;
    best->t = best->margin = best->key = pti_fw_set(PTI_LOCK_FAR);
    best->i = pti_fw_set(0);
    careful = *best;
    pti_lock_ask(k, o, d, e, best, PTI_LOCK_NEAREST);
    doubtful = pti_fw_lt(best->margin, pti_fw_set(0));
    if (!pti_mw_bits(doubtful)) return;
    pti_lock_ask(k, o, d, e, &careful, PTI_LOCK_CAREFUL);
    best->t = pti_fw_select(doubtful, careful.t, best->t);
    best->i = pti_fw_select(doubtful, careful.i, best->i);
    best->margin = pti_fw_select(doubtful, careful.margin, best->margin);
}

/* --- numbers --- */

/* xoroshiro64* [Bla21]: a + b -> 24 bits of each lane as a float in [0,1). */
PTI_INLINE8 pti_fw pti_lock_next(pti_uw *a, pti_uw *b)
{
    const pti_uw r = pti_uw_mul(*a, pti_uw_set(0x9e3779bbu)), x = pti_uw_xor(*a, *b);
    *a = pti_uw_xor(pti_uw_xor(pti_uw_or(pti_uw_shl(*a, 26), pti_uw_shr(*a, 6)), x), pti_uw_shl(x, 9));
    *b = pti_uw_or(pti_uw_shl(x, 13), pti_uw_shr(x, 19));
    return pti_fw_mul(pti_fw_from_words(pti_uw_shr(r, 8)), pti_fw_set((float)PTI_2_M24));
}

PTI_INLINE pti_uw pti_lock_masked(pti_uw x, int n, uint32_t mask) /* the bits of both, n apart, exchanged */
{
    const pti_uw m = pti_uw_set(mask);
    return pti_uw_or(pti_uw_shl(pti_uw_and(x, m), n), pti_uw_and(pti_uw_shr(x, n), m));
}
PTI_INLINE pti_uw pti_lock_reverse(pti_uw x)
{
    x = pti_uw_or(pti_uw_shl(x, 16), pti_uw_shr(x, 16));
    x = pti_lock_masked(x, 8, 0x00ff00ffu);
    x = pti_lock_masked(x, 4, 0x0f0f0f0fu);
    x = pti_lock_masked(x, 2, 0x33333333u);
    return pti_lock_masked(x, 1, 0x55555555u);
}

/* pti_laine_karras and pti_sobol_reversed in lanes. */
PTI_INLINE8 pti_uw pti_lock_scramble(pti_uw x, pti_uw seed)
{
    x = pti_uw_xor(x, pti_uw_mul(x, pti_uw_set(0x3d20adeau)));
    x = pti_uw_add(x, seed);
    x = pti_uw_mul(x, pti_uw_or(pti_uw_shr(seed, 16), pti_uw_set(1)));
    x = pti_uw_xor(x, pti_uw_mul(x, pti_uw_set(0x05526c56u)));
    return pti_uw_xor(x, pti_uw_mul(x, pti_uw_set(0x53a22864u)));
}
static pti_uw pti_lock_sobol(pti_uw n, int d)
{
    static const int shift[5] = {1, 2, 4, 8, 16};
    static const uint32_t mask[5] = {0x55555555u, 0x33333333u, 0x0f0f0f0fu, 0x00ff00ffu, 0x0000ffffu};
    pti_uw x = pti_uw_set(0);
    int i;
    if (d == 0) return n;
    if (d == 1) {
        for (i = 0; i < 5; i++) n = pti_uw_xor(n, pti_uw_and(pti_uw_shr(n, shift[i]), pti_uw_set(mask[i])));
        return n;
    }
    for (i = 0; i < 32; i++) { /* the bit, all over the word, chooses */
        const pti_uw bit = pti_uw_spread(pti_uw_shl(n, 31 - i));
        x = pti_uw_xor(x, pti_uw_and(bit, pti_uw_set(pti_sobol_columns[d - 2][i])));
    }
    return x;
}

/* --- paths --- */

/* The state of a path, a row of lanes each. Density < 0: the last direction came from a delta lobe, or the camera. */
enum {
    PTI_ROW_O, PTI_ROW_D = 3, PTI_ROW_BETA = 6, PTI_ROW_SUM = 9, PTI_ROW_DENSITY = 12, PTI_ROW_ETA2, PTI_ROW_A, PTI_ROW_B,
    PTI_ROW_SLOT, PTI_ROW_EDGES, PTI_ROW_LOW, PTI_ROWS = PTI_ROW_LOW + 3 /* low: what a float takes from the origin */
};

/* The decisions of one vertex. */
typedef struct pti_lock_numbers {
    pti_fw which, light0, light1, bsdf0, bsdf1, lobe;
} pti_lock_numbers;

/* What is hit. */
typedef struct pti_lock_surface {
    pti_uw i;
    pti_w3 p, n, ng;        /* point; normals, for shading and of the surface, on the side the path came from */
    pti_fw cosine, facing;  /* of the way back and these normals                                           */
    pti_mw met, front, ball; /* anything at all; from the side of ng; a sphere                             */
    pti_fw kind, light;     /* of its material; number of its light, or -1                                */
} pti_lock_surface;

PTI_INLINE pti_w3 pti_row3(const pti_lane_row *row) { return pti_w3_make(row[0].f, row[1].f, row[2].f); }
PTI_INLINE void pti_row3_set(pti_lane_row *row, pti_w3 v)
{
    row[0].f = v.x;
    row[1].f = v.y;
    row[2].f = v.z;
}
PTI_INLINE pti_w3 pti_gather3(const float (*table)[PTI_LOCK_MAX], int row, pti_uw i)
{
    return pti_w3_make(pti_fw_gather(table[row], i), pti_fw_gather(table[row + 1], i), pti_fw_gather(table[row + 2], i));
}

/* The side of a surface, with normal n, that the path came from. */
PTI_INLINE8 void pti_lock_face(const pti_lockstep *k, pti_lock_surface *s, pti_w3 n, pti_w3 d)
{
    const pti_fw along = pti_w3_dot(n, d);
    s->front = pti_fw_lt(along, pti_fw_set(0));
    s->cosine = s->facing = pti_fw_abs(along);
    s->n = s->ng = pti_w3_select(s->front, n, pti_w3_scale(n, pti_fw_set(-1)));
    s->kind = k->specular ? pti_fw_gather(k->of[PTI_OF_KIND], s->i) : pti_fw_set((float)PT_MATERIAL_DIFFUSE);
}

/* The point at t, put back on its surface and away from its edges; the normal there. */
PTI_INLINE8 pti_w3 pti_lock_land(const pti_lockstep *k, pti_w3 o, pti_w3 d, const pti_lock_best *best, pti_lock_surface *s)
{
    const pti_fw zero = pti_fw_set(0), inset = pti_fw_set(16 * k->e);
    const pti_mw brim = pti_fw_lt(best->margin, inset);
    pti_w3 n;
    s->i = pti_uw_from_floats(best->i);
    s->p = pti_w3_along(d, best->t, o);
    n = pti_gather3(k->of, PTI_OF_N, s->i);
    s->p = pti_w3_along(n, pti_fw_sub(zero, pti_w3_dot_add(n, s->p, pti_fw_gather(k->of[PTI_OF_D], s->i))), s->p);
    if (pti_mw_bits(brim)) {
        const pti_fw depth = pti_fw_gather(k->of[PTI_OF_DEPTH], s->i);
        const pti_fw share = pti_fw_div(pti_fw_sub(inset, best->margin), pti_fw_sub(depth, best->margin));
        s->p = pti_w3_along(pti_w3_sub(pti_gather3(k->of, PTI_OF_CENTRE, s->i), s->p), pti_fw_select(brim, share, zero), s->p);
    }
    s->ball = pti_fw_lt(pti_fw_set(1e38f), best->margin);
    if (pti_mw_bits(s->ball)) { /* n = 0 for spheres, so p is as it was */
        const pti_w3 centre = pti_gather3(k->of, PTI_OF_CENTRE, s->i), out = pti_w3_normalize(pti_w3_sub(s->p, centre));
        n = pti_w3_select(s->ball, out, n);
        s->p = pti_w3_select(s->ball, pti_w3_along(out, pti_fw_gather(k->of[PTI_OF_RADIUS], s->i), centre), s->p);
    }
    if (k->begin[PTI_LOCK_SHELLS] < k->begin[PTI_LOCK_CLASSES]) {
        const pti_mw shell = pti_mw_and(pti_fw_le(pti_fw_set(PTI_LOCK_SHELL), best->margin), pti_fw_lt(best->margin, pti_fw_set(1e38f)));
        const pti_w3 p = pti_w3_along(d, best->t, o), q = pti_w3_sub(p, pti_gather3(k->of, PTI_OF_CENTRE, s->i));
        const pti_w3 tangent = pti_gather3(k->of, PTI_OF_TANGENT, s->i);
        const pti_fw bend = pti_fw_gather(k->of[PTI_OF_BEND], s->i), lift = pti_w3_dot_add(tangent, q, pti_fw_gather(k->of[PTI_OF_HEIGHT], s->i));
        const pti_w3 out = pti_w3_normalize(pti_w3_along(q, pti_fw_add(bend, bend), tangent));
        n = pti_w3_select(shell, out, n);
        s->p = pti_w3_select(shell, pti_w3_along(out, pti_fw_sub(pti_fw_set(0), pti_fw_madd(bend, pti_w3_dot(q, q), lift)), p), s->p);
    }
    s->light = pti_fw_gather(k->of[PTI_OF_LIGHT], s->i);
    return n;
}

/* The ray of a lane, with all digits of its origin. */
static pti_ray pti_lock_ray(const pti_lane_row *row, int lane)
{
    double o[3];
    int k;
    for (k = 0; k < 3; k++) o[k] = (double)row[PTI_ROW_O + k].v[lane] + (double)row[PTI_ROW_LOW + k].v[lane];
    return pti_ray_from(pti_d(o[0], o[1], o[2]), pti_d((double)row[PTI_ROW_D].v[lane], (double)row[PTI_ROW_D + 1].v[lane], (double)row[PTI_ROW_D + 2].v[lane]), HUGE_VAL);
}

/* Lanes whose rays may come within 4 e of what is in the tree by t = end: slabs as in pti_ray8_axis, whose errors e covers. */
PTI_INLINE8 unsigned pti_lock_boxed(const pti_lockstep *k, pti_w3 o, pti_w3 d, float e, pti_fw end)
{
    const pti_fw from[3] = {o.x, o.y, o.z}, along[3] = {d.x, d.y, d.z}, flat = pti_fw_set(1e-8f), zero = pti_fw_set(0);
    pti_fw begin = zero;
    int i;
    for (i = 0; i < 3; i++) {
        const pti_fw q = pti_fw_div(pti_fw_set(1), pti_fw_select(pti_fw_lt(pti_fw_abs(along[i]), flat), flat, along[i]));
        const pti_fw a = pti_fw_mul(pti_fw_sub(pti_fw_set(k->box[i] - 4 * e), from[i]), q);
        const pti_fw b = pti_fw_mul(pti_fw_sub(pti_fw_set(k->box[3 + i] + 4 * e), from[i]), q);
        begin = pti_fw_max(begin, pti_fw_min(a, b));
        end = pti_fw_min(end, pti_fw_max(a, b));
    }
    return pti_mw_bits(pti_fw_le(begin, end));
}

/* What paths in lanes have met in a scene with a tree: a wall, or, where that is -1, what the hit tells. */
typedef struct pti_lock_met {
    pt_hit hit[PTI_WIDTH];
    int wall[PTI_WIDTH];
} pti_lock_met;

/* Height above a wall, or along its normal. */
PTI_INLINE double pti_lock_along(const double *plane, const double *v) { return plane[0] * v[0] + plane[1] * v[1] + plane[2] * v[2]; }

/* Asks the tree for the ray of a lane: what is before the wall it meets, or at all (-1). In double, so that what lies on a wall is
   seen. */
static int pti_lock_meet_tree(const pti_lockstep *k, const pti_ray *r, int wall, pt_hit *hit)
{
    pti_best best = {(double)PTI_REAL_MAX, 0, 0, -1};
    int found;
    if (wall >= 0) {
        const double *plane = k->plane[wall], t = -(pti_lock_along(plane, r->o) + plane[3]) / pti_lock_along(plane, r->d);
        if (t > 0 && t < best.t) best.t = t;
    }
    found = pti_nearest_thing(k->tree, r, &best);
    if (found < 0) return pti_intersect(k->tree, r, hit);
    if (found) pti_fill(k->tree, r, &best, hit);
    return found;
}

/* The nearest wall that lanes find, unless a ray meets it so near an edge, 2 slacks of pti_lock_keep, that rounding may decide: then
   all is asked in double, since the other side of that edge may be in the tree. Returns the lanes that meet what is in it. */
static unsigned pti_lock_nearest_wall(const pti_lockstep *k, const pti_lane_row *row, unsigned active, float e, pt_hit *hits,
                                      pti_lock_best *best)
{
    const pti_w3 d = pti_row3(row + PTI_ROW_D);
    pti_lane_row t, i, margin;
    unsigned told = 0;
    pti_fw along;
    pti_lock_nearest(k, pti_row3(row + PTI_ROW_O), d, e, best);
    along = pti_fw_abs(pti_w3_dot(pti_gather3(k->of, PTI_OF_N, pti_uw_from_floats(best->i)), d));
    active &= pti_mw_bits(pti_fw_lt(pti_fw_mul(best->margin, along), pti_fw_set(4 * e)));
    if (!active) return 0;
    t.f = best->t;
    i.f = best->i;
    margin.f = best->margin;
    for (; active; active &= active - 1) {
        const int lane = pti_lowest_bit(active);
        const pti_ray r = pti_lock_ray(row, lane);
        pt_hit *hit = &hits[lane];
        const int found = pti_intersect(k->tree, &r, hit);
        int wall = 0;
        while (found && wall < k->walls && (hit->primitive < k->from[wall] || hit->primitive > k->to[wall])) wall++;
        told |= (unsigned)(found && wall == k->walls) << lane;
        t.v[lane] = found ? hit->t : PTI_LOCK_FAR;
        i.v[lane] = (float)(wall < k->walls ? wall : 0);
        margin.v[lane] = found ? 0 : PTI_LOCK_FAR;
    }
    best->t = t.f;
    best->i = i.f;
    best->margin = margin.f;
    return told;
}

/* pti_lock_nearest and pti_lock_land for scenes with a tree. */
static void pti_lock_meet(const pti_lockstep *k, const pti_lane_row *row, unsigned active, float e, pti_lock_met *met,
                          pti_lock_best *best, pti_lock_surface *s)
{
    const pti_w3 d = pti_row3(row + PTI_ROW_D), zero = pti_w3_scale(d, pti_fw_set(0));
    pti_lane_row p[3], n[3], ns[3], t, i, light;
    unsigned balls = 0, asks = active, told = 0;
    pti_w3 normal = zero;
    s->p = zero;
    s->i = pti_uw_set(0);
    s->light = pti_fw_set(-1);
    best->t = pti_fw_set(PTI_LOCK_FAR);
    if (k->walls > 0) {
        const pti_w3 o = pti_row3(row + PTI_ROW_O);
        pti_fw off;
        told = pti_lock_nearest_wall(k, row, active, e, met->hit, best);
        normal = pti_lock_land(k, o, d, best, s);
        off = pti_fw_div(pti_fw_set(4 * e), pti_fw_abs(pti_w3_dot(normal, d)));
        asks &= told | pti_lock_boxed(k, o, d, e, pti_fw_add(best->t, off));
    }
    pti_row3_set(p, s->p);
    pti_row3_set(n, normal);
    pti_row3_set(ns, normal);
    t.f = best->t;
    i.u = s->i;
    light.f = s->light;
    for (; active; active &= active - 1) {
        const int lane = pti_lowest_bit(active);
        pt_hit *hit = &met->hit[lane];
        met->wall[lane] = k->walls > 0 && t.v[lane] < PTI_LOCK_FAR ? (int)i.bits[lane] : -1;
        if (!(asks >> lane & 1)) continue;
        if (!(told >> lane & 1)) {
            const pti_ray r = pti_lock_ray(row, lane);
            if (!(k->walls > 0 ? pti_lock_meet_tree(k, &r, met->wall[lane], hit) : pti_intersect(k->tree, &r, hit))) continue;
        }
        met->wall[lane] = -1;
        t.v[lane] = hit->t;
        i.bits[lane] = (uint32_t)(k->walls + hit->material);
        light.v[lane] = (float)hit->light;
        balls |= (unsigned)(hit->shape == PT_SHAPE_SPHERE) << lane;
        p[0].v[lane] = hit->p.x, p[1].v[lane] = hit->p.y, p[2].v[lane] = hit->p.z;
        n[0].v[lane] = hit->ng.x, n[1].v[lane] = hit->ng.y, n[2].v[lane] = hit->ng.z;
        ns[0].v[lane] = hit->ns.x, ns[1].v[lane] = hit->ns.y, ns[2].v[lane] = hit->ns.z;
    }
    best->t = t.f;
    s->i = i.u;
    s->p = pti_row3(p);
    s->ball = pti_mw_of_bits(balls);
    s->light = light.f;
    pti_lock_face(k, s, pti_row3(n), d);
    if (!k->shading) return;
    s->n = pti_w3_select(s->front, pti_row3(ns), pti_w3_scale(pti_row3(ns), pti_fw_set(-1)));
    s->cosine = pti_fw_sub(pti_fw_set(0), pti_w3_dot(s->n, d));
}

/* Where the ray from what a lane has met in direction w starts for the tree; lifted: where it starts for walls. */
static pti_d3 pti_lock_origin(const pti_lock_met *met, int lane, const pti_lane_row *lifted, const pti_lane_row *w)
{
    if (met->wall[lane] >= 0) return pti_d((double)lifted[0].v[lane], (double)lifted[1].v[lane], (double)lifted[2].v[lane]);
    return pti_leave(&met->hit[lane], pt_v3(w[0].v[lane], w[1].v[lane], w[2].v[lane]));
}

/* Shadow rays in a scene with a tree, from hits (o for lanes) to points q of lights that are moved off: the lanes that something
   blocks. */
static pti_mw pti_lock_blocked(const pti_lockstep *k, const pti_lock_met *met, unsigned active, pti_w3 o, pti_w3 q, pti_w3 w,
                               pti_fw distance)
{
    pti_lane_row from[3], to[3], d[3];
    unsigned blocked = 0;
    if (k->walls > 0) {
        blocked = active & pti_mw_bits(pti_lock_any(k, o, w, distance));
        active &= ~blocked & pti_lock_boxed(k, o, w, k->e, distance);
    }
    pti_row3_set(from, o);
    pti_row3_set(to, q);
    pti_row3_set(d, w);
    for (; active; active &= active - 1) {
        const int lane = pti_lowest_bit(active);
        const pti_d3 start = pti_lock_origin(met, lane, from, d);
        const pti_d3 end = pti_d((double)to[0].v[lane], (double)to[1].v[lane], (double)to[2].v[lane]);
        const pti_ray r = pti_ray_from(start, pti_d_sub(end, start), 1);
        pti_best best = {1, 0, 0, -1};
        int found = k->walls > 0 ? pti_any_thing(k->tree, &r, &best) : -1;
        if (found < 0) found = pti_occluded(k->tree, &r);
        blocked |= (unsigned)found << lane;
    }
    return pti_mw_of_bits(blocked);
}

/* The next origins of lanes; lifted: those from walls. */
static void pti_lock_depart(pti_lane_row *row, const pti_lock_met *met, pti_w3 lifted, unsigned active)
{
    pti_row3_set(row + PTI_ROW_O, lifted);
    for (; active; active &= active - 1) {
        const int lane = pti_lowest_bit(active);
        const pti_d3 o = pti_lock_origin(met, lane, row + PTI_ROW_O, row + PTI_ROW_D);
        const double all[3] = {o.x, o.y, o.z};
        int k;
        for (k = 0; k < 3; k++) {
            row[PTI_ROW_O + k].v[lane] = (float)all[k];
            row[PTI_ROW_LOW + k].v[lane] = (float)(all[k] - (double)row[PTI_ROW_O + k].v[lane]);
        }
    }
}

PTI_INLINE pti_mw pti_lock_is(const pti_lock_surface *s, pt_material_kind kind)
{
    const pti_fw x = pti_fw_set((float)kind);
    return pti_mw_and(pti_fw_le(s->kind, x), pti_fw_le(x, s->kind));
}

/* pt_mis_weight in lanes. */
PTI_INLINE8 pti_fw pti_lock_weight(pti_fw p, pti_fw q, pt_heuristic heuristic)
{
    const pti_fw one = pti_fw_set(1), ratio = pti_fw_div(q, p);
    if (heuristic == PT_HEURISTIC_BALANCE) return pti_fw_div(one, pti_fw_add(one, ratio));
    if (heuristic == PT_HEURISTIC_MAXIMUM)
        return pti_fw_select(pti_fw_lt(q, p), one, pti_fw_select(pti_fw_le(q, p), pti_fw_set(0.5f), pti_fw_set(0)));
    return pti_fw_div(one, pti_fw_madd(ratio, ratio, one));
}

/* 1 - cos of the cone under which spheres are seen from d2 away, squared; 2 where p is inside. */
PTI_INLINE8 pti_fw pti_lock_cone(pti_fw radius, pti_fw d2)
{
    const pti_fw s2 = pti_fw_div(pti_fw_mul(radius, radius), d2), one = pti_fw_set(1);
    const pti_fw omc = pti_fw_div(s2, pti_fw_add(one, pti_fw_sqrt(pti_fw_max(pti_fw_set(0), pti_fw_sub(one, s2)))));
    return pti_fw_select(pti_fw_lt(s2, one), omc, pti_fw_set(2));
}

/* Adds the emission of what is hit, weighted. */
PTI_INLINE8 void pti_lock_emission(const pti_lockstep *k, const pti_lock_surface *s, const pti_lock_best *best, pti_lane_row *row,
                                  int technique, pt_heuristic heuristic)
{
    const pti_fw zero = pti_fw_set(0), one = pti_fw_set(1), q = row[PTI_ROW_DENSITY].f;
    const pti_mw lit = pti_mw_and(s->met, pti_mw_and(pti_fw_le(zero, s->light), pti_mw_or(s->front, s->ball)));
    const pti_mw delta = pti_fw_lt(q, zero);
    pti_uw light;
    pti_w3 value;
    pti_fw p, weight = one;
    if (!pti_mw_bits(lit)) return;
    light = pti_uw_from_floats(pti_fw_max(zero, s->light));
    value = pti_w3_mul(pti_row3(row + PTI_ROW_BETA), pti_gather3(k->light, PTI_LIT_EMISSION, light));
    if (technique != PTI_TECHNIQUE_PLAIN) {
        const pti_fw density = pti_fw_gather(k->light[PTI_LIT_DENSITY], light);
        p = pti_fw_div(pti_fw_mul(density, pti_fw_mul(best->t, best->t)), s->facing);
        if (k->sphere_lights && pti_mw_bits(pti_mw_and(lit, s->ball))) {
            const pti_w3 c = pti_w3_sub(pti_gather3(k->light, PTI_LIT_P, light), pti_row3(row + PTI_ROW_O));
            const pti_fw cone = pti_lock_cone(pti_fw_gather(k->light[PTI_LIT_RADIUS], light), pti_w3_dot(c, c));
            const pti_fw omc = pti_fw_select(s->front, cone, pti_fw_set(2)); /* from within also where the origin lies on the ball */
            p = pti_fw_select(s->ball, pti_fw_div(density, pti_fw_mul(pti_fw_set((float)(2 * PT_PI)), omc)), p);
        }
        weight = pti_fw_select(delta, one, pti_lock_weight(q, p, heuristic));
    }
    weight = pti_fw_select(lit, weight, zero);
    pti_row3_set(row + PTI_ROW_SUM, pti_w3_along(value, weight, pti_row3(row + PTI_ROW_SUM)));
}

/* The two unit vectors that make a frame with n [Duf17]. */
PTI_INLINE8 void pti_lock_frame(pti_w3 n, pti_w3 *s, pti_w3 *t)
{
    const pti_fw zero = pti_fw_set(0), one = pti_fw_set(1), sign = pti_fw_select(pti_fw_lt(n.z, zero), pti_fw_set(-1), one);
    const pti_fw a = pti_fw_div(pti_fw_set(-1), pti_fw_add(sign, n.z)), b = pti_fw_mul(pti_fw_mul(n.x, n.y), a);
    const pti_fw sx = pti_fw_mul(sign, n.x);
    *s = pti_w3_make(pti_fw_madd(pti_fw_mul(sx, n.x), a, one), pti_fw_mul(sign, b), pti_fw_sub(zero, sx));
    *t = pti_w3_make(b, pti_fw_madd(pti_fw_mul(n.y, n.y), a, sign), pti_fw_sub(zero, n.y));
}

/* cos and sin of 2 pi u: twice the double angle of a quarter. */
PTI_INLINE8 void pti_lock_turn(pti_fw u, pti_fw *c, pti_fw *s)
{
    pti_fw x, y;
    int i;
    pti_fw_sincos(pti_fw_mul(pti_fw_sub(u, pti_fw_set(0.5f)), pti_fw_set((float)(PT_PI / 2))), &y, &x);
    for (i = 0; i < 2; i++) {
        const pti_fw twice = pti_fw_add(y, y);
        y = pti_fw_mul(twice, x);
        x = pti_fw_nmadd(twice, pti_fw_mul(pti_fw_set(0.5f), twice), pti_fw_set(1));
    }
    *c = pti_fw_sub(pti_fw_set(0), x); /* a half turn was taken off u */
    *s = pti_fw_sub(pti_fw_set(0), y);
}

/* How far along s->ng the next ray starts, if it goes to w: 2 e off the surface, 8 e inside balls. A point of a wall that touches
   a ball can start no more than 3 e inside it: so pti_lock_balls tells them apart. */
PTI_INLINE8 pti_fw pti_lock_lift(const pti_lockstep *k, const pti_lock_surface *s, pti_w3 w)
{
    const pti_fw zero = pti_fw_set(0), along = pti_w3_dot(s->ng, w);
    const pti_fw out = pti_fw_select(s->front, along, pti_fw_sub(zero, along));
    const pti_fw far = pti_fw_select(pti_mw_and(s->ball, pti_fw_lt(out, zero)), pti_fw_set(8 * k->e), pti_fw_set(2 * k->e));
    return pti_fw_select(pti_fw_lt(along, zero), pti_fw_sub(zero, far), far);
}

PTI_INLINE int pti_count_bits(unsigned x)
{
    int n = 0;
    for (; x; x &= x - 1) n++;
    return n;
}

/* pt_fresnel_conductor in lanes. */
PTI_INLINE8 pti_fw pti_lock_fresnel(pti_fw c, pti_fw eta, pti_fw k)
{
    const pti_fw zero = pti_fw_set(0), one = pti_fw_set(1), half = pti_fw_set(0.5f), c2 = pti_fw_mul(c, c);
    const pti_fw s2 = pti_fw_mul(pti_fw_sub(one, c), pti_fw_add(one, c)), m = pti_fw_mul(pti_fw_add(eta, eta), k);
    const pti_fw t = pti_fw_sub(pti_fw_mul(pti_fw_sub(eta, k), pti_fw_add(eta, k)), s2), ab = pti_fw_sqrt(pti_fw_madd(t, t, pti_fw_mul(m, m)));
    const pti_fw below = pti_fw_mul(half, pti_fw_div(pti_fw_mul(m, m), pti_fw_sub(ab, t))), above = pti_fw_mul(half, pti_fw_add(ab, t));
    const pti_fw a = pti_fw_sqrt(pti_fw_select(pti_fw_lt(t, zero), below, above)), ac = pti_fw_mul(pti_fw_add(a, a), c);
    const pti_fw x = pti_fw_add(ab, c2), y = pti_fw_madd(ab, c2, pti_fw_mul(s2, s2)), z = pti_fw_mul(ac, s2);
    const pti_fw rs = pti_fw_div(pti_fw_sub(x, ac), pti_fw_add(x, ac)), rp = pti_fw_mul(rs, pti_fw_div(pti_fw_sub(y, z), pti_fw_add(y, z)));
    return pti_fw_select(pti_fw_lt(zero, ab), pti_fw_mul(half, pti_fw_add(rs, rp)), one);
}

/* What metal reflects under the cosine c. */
PTI_INLINE8 pti_w3 pti_lock_metal(const pti_lockstep *k, pti_uw i, pti_fw c)
{
    const pti_w3 eta = pti_gather3(k->of, PTI_OF_ETA, i), kappa = pti_gather3(k->of, PTI_OF_K, i);
    return pti_w3_make(pti_lock_fresnel(c, eta.x, kappa.x), pti_lock_fresnel(c, eta.y, kappa.y), pti_lock_fresnel(c, eta.z, kappa.z));
}

/* GGX facets: a frame with the normal, the direction back in it, alpha and its reciprocal. */
typedef struct pti_lock_facets {
    pti_w3 s, t, o;
    pti_fw alpha, inverse;
    pti_mw rough;           /* lanes on them; the others have an alpha of 1                                 */
} pti_lock_facets;

PTI_INLINE8 void pti_lock_find_facets(const pti_lockstep *k, const pti_lock_surface *s, pti_w3 d, pti_lock_facets *f)
{
    const pti_fw zero = pti_fw_set(0), alpha = pti_fw_gather(k->of[PTI_OF_ALPHA], s->i);
    f->rough = pti_fw_lt(zero, alpha);
    f->alpha = pti_fw_select(f->rough, alpha, pti_fw_set(1));
    f->inverse = pti_fw_div(pti_fw_set(1), f->alpha);
    pti_lock_frame(s->n, &f->s, &f->t);
    f->o = pti_w3_make(pti_fw_sub(zero, pti_w3_dot(d, f->s)), pti_fw_sub(zero, pti_w3_dot(d, f->t)), s->cosine);
}

/* cos (1 + Lambda) of a direction above the facets, with tan^2 written without its denominator: (z + sqrt(z^2 + a^2 sin^2)) / 2. */
PTI_INLINE8 pti_fw pti_lock_masked_cosine(const pti_lock_facets *f, pti_w3 w)
{
    const pti_fw q = pti_fw_mul(pti_fw_mul(f->alpha, f->alpha), pti_fw_madd(w.x, w.x, pti_fw_mul(w.y, w.y)));
    return pti_fw_mul(pti_fw_set(0.5f), pti_fw_add(w.z, pti_fw_sqrt(pti_fw_madd(w.z, w.z, q))));
}

/* The density of the direction that half vector h reflects into: D G1 (o.h) / cos / (4 o.h), see [PT-04]. */
PTI_INLINE8 pti_fw pti_lock_facet_density(const pti_lock_facets *f, pti_w3 h, pti_fw masked_o)
{
    const pti_fw r2 = pti_fw_madd(h.x, h.x, pti_fw_mul(h.y, h.y)), kd = pti_fw_madd(f->alpha, pti_fw_mul(h.z, h.z), pti_fw_mul(r2, f->inverse));
    return pti_fw_div(pti_fw_set((float)(0.25 / PT_PI)), pti_fw_mul(pti_fw_mul(kd, kd), masked_o));
}

/* G2 / G1 = (1 + Lambda(o)) / (1 + Lambda(o) + Lambda(i)), with both cosines multiplied in; 0 for i at the horizon. */
PTI_INLINE8 pti_fw pti_lock_shadowing(const pti_lock_facets *f, pti_w3 i, pti_fw masked_o)
{
    const pti_fw above = pti_fw_mul(masked_o, i.z), masked_i = pti_lock_masked_cosine(f, i);
    return pti_fw_div(above, pti_fw_madd(f->o.z, pti_fw_sub(masked_i, i.z), above));
}

/* BRDF times cosine, but for the albedo, into i (of the frame, above); *density of i. */
PTI_INLINE8 pti_w3 pti_lock_reflect(const pti_lockstep *k, const pti_lock_surface *s, const pti_lock_facets *f, pti_w3 i, pti_fw *density)
{
    const pti_w3 h = pti_w3_normalize(pti_w3_along(f->o, pti_fw_set(1), i));
    const pti_fw masked_o = pti_lock_masked_cosine(f, f->o);
    *density = pti_lock_facet_density(f, h, masked_o);
    return pti_w3_scale(pti_lock_metal(k, s->i, pti_w3_dot(f->o, h)), pti_fw_mul(*density, pti_lock_shadowing(f, i, masked_o)));
}

/* A direction by a visible normal, as pti_ggx_visible_draw; its density, and weight multiplied. *above: it is. */
PTI_INLINE8 pti_w3 pti_lock_glossy(const pti_lockstep *k, const pti_lock_surface *s, const pti_lock_facets *f, pti_fw u0, pti_fw u1, pti_fw *density,
                                  pti_w3 *weight, pti_mw *above)
{
    const pti_fw zero = pti_fw_set(0), one = pti_fw_set(1), masked_o = pti_lock_masked_cosine(f, f->o);
    const pti_w3 o = pti_w3_normalize(pti_w3_make(pti_fw_mul(f->alpha, f->o.x), pti_fw_mul(f->alpha, f->o.y), f->o.z));
    const pti_fw top = pti_fw_add(one, o.z), rise = pti_fw_mul(pti_fw_sub(one, u1), top); /* z + o.z of the point of the cap */
    const pti_fw low = pti_fw_div(pti_fw_madd(o.x, o.x, pti_fw_mul(o.y, o.y)), top);      /* 1 - o.z, with all its digits   */
    const pti_fw r = pti_fw_sqrt(pti_fw_mul(pti_fw_mul(u1, top), pti_fw_add(rise, low)));  /* of (1 - z) (1 + z)             */
    pti_fw cosine, sinus, c;
    pti_w3 h, i, next;
    pti_lock_turn(u0, &cosine, &sinus);
    h = pti_w3_make(pti_fw_mul(f->alpha, pti_fw_madd(r, cosine, o.x)), pti_fw_mul(f->alpha, pti_fw_madd(r, sinus, o.y)), rise);
    h = pti_w3_normalize(h);
    c = pti_w3_dot(f->o, h);
    i = pti_w3_sub(pti_w3_scale(h, pti_fw_add(c, c)), f->o);
    *density = pti_lock_facet_density(f, h, masked_o);
    *weight = pti_w3_mul(*weight, pti_w3_scale(pti_lock_metal(k, s->i, c), pti_lock_shadowing(f, i, masked_o)));
    next = pti_w3_normalize(pti_w3_along(f->s, i.x, pti_w3_along(f->t, i.y, pti_w3_scale(s->n, i.z))));
    *above = pti_mw_and(pti_mw_and(pti_fw_lt(zero, c), pti_fw_lt(zero, i.z)), pti_fw_lt(zero, pti_w3_dot(s->n, next)));
    return next;
}

/* What is known of the lights chosen; one light is the same for all lanes. */
PTI_INLINE pti_fw pti_lit(const pti_lockstep *k, int row, pti_uw light)
{
    return k->light_count == 1 ? pti_fw_set(k->light[row][0]) : pti_fw_gather(k->light[row], light);
}
PTI_INLINE pti_w3 pti_lit3(const pti_lockstep *k, int row, pti_uw light)
{
    return pti_w3_make(pti_lit(k, row, light), pti_lit(k, row + 1, light), pti_lit(k, row + 2, light));
}

/* A point of spheres: in the cone seen from p, or, from inside, in any direction. *q: the point, moved 2 e off to the side
   of p; *to: the direction that was drawn, which from 2 e inside the sphere is not that of q; density per solid angle. */
PTI_INLINE8 pti_fw pti_lock_ball_point(const pti_lockstep *k, pti_uw light, pti_w3 p, const pti_lock_numbers *u, pti_w3 *q, pti_w3 *to)
{
    const pti_fw zero = pti_fw_set(0), one = pti_fw_set(1), r = pti_lit(k, PTI_LIT_RADIUS, light);
    const pti_w3 centre = pti_lit3(k, PTI_LIT_P, light), c = pti_w3_sub(centre, p);
    const pti_fw d2 = pti_w3_dot(c, c), d = pti_fw_sqrt(d2), omc = pti_lock_cone(r, d2);
    const pti_mw inside = pti_fw_le(pti_fw_set(2), omc);
    const pti_fw x = pti_fw_mul(u->light0, omc), sine2 = pti_fw_mul(x, pti_fw_sub(pti_fw_set(2), x)), sine = pti_fw_sqrt(sine2);
    const pti_fw rest = pti_fw_sqrt(pti_fw_max(zero, pti_fw_nmadd(d2, sine2, pti_fw_mul(r, r))));
    const pti_fw middle = pti_fw_mul(d, pti_fw_sub(one, x)); /* of the chord */
    const pti_fw t = pti_fw_select(inside, pti_fw_add(middle, rest), pti_fw_sub(middle, rest));
    pti_w3 axis = pti_w3_scale(c, pti_fw_div(one, d)), s, v, w;
    pti_fw cosine, sinus, across, along;
    axis = pti_w3_select(pti_fw_lt(zero, d), axis, pti_w3_make(zero, zero, one));
    pti_lock_frame(axis, &s, &v);
    pti_lock_turn(u->light1, &cosine, &sinus);
    *to = pti_w3_along(s, pti_fw_mul(sine, cosine), pti_w3_along(v, pti_fw_mul(sine, sinus), pti_w3_scale(axis, pti_fw_sub(one, x))));
    /* from the centre: t (1 - x) - d along the axis, without what cancels there from afar */
    across = pti_fw_mul(t, sine);
    along = pti_fw_mul(rest, pti_fw_sub(one, x));
    along = pti_fw_nmadd(d, sine2, pti_fw_select(inside, along, pti_fw_sub(zero, along)));
    w = pti_w3_along(s, pti_fw_mul(across, cosine), pti_w3_along(v, pti_fw_mul(across, sinus), pti_w3_scale(axis, along)));
    w = pti_w3_normalize(w);
    *q = pti_w3_along(w, pti_fw_add(r, pti_fw_select(inside, pti_fw_set(-2 * k->e), pti_fw_set(2 * k->e))), centre);
    return pti_fw_div(pti_lit(k, PTI_LIT_DENSITY, light), pti_fw_mul(pti_fw_set((float)(2 * PT_PI)), omc));
}

/* A point of a flat light, moved 2 e off its front; density per area. */
PTI_INLINE8 pti_fw pti_lock_flat_point(const pti_lockstep *k, pti_uw light, const pti_lock_numbers *u, pti_w3 *q, pti_w3 *n)
{
    const pti_fw triangle = pti_lit(k, PTI_LIT_TRIANGLE, light), root = pti_fw_sqrt(u->light0);
    const pti_mw is_triangle = pti_fw_lt(pti_fw_set(0), triangle);
    const pti_fw a = pti_fw_select(is_triangle, pti_fw_nmadd(root, u->light1, root), u->light0);
    const pti_fw b = pti_fw_select(is_triangle, pti_fw_mul(root, u->light1), u->light1);
    *n = pti_lit3(k, PTI_LIT_N, light);
    *q = pti_w3_along(*n, pti_fw_set(2 * k->e), pti_lit3(k, PTI_LIT_P, light));
    *q = pti_w3_along(pti_lit3(k, PTI_LIT_E1, light), a, *q);
    *q = pti_w3_along(pti_lit3(k, PTI_LIT_E2, light), b, *q);
    return pti_lit(k, PTI_LIT_DENSITY, light);
}

/* Asks a point of a light for its light; how many rays that took. met: for trees; f: NULL where nothing is rough. */
PTI_INLINE8 int pti_lock_direct(const pti_lockstep *k, const pti_lock_surface *s, const pti_lock_met *met, const pti_lock_facets *f,
                               pti_w3 albedo, pti_mw active, const pti_lock_numbers *u, pti_lane_row *row, pt_heuristic heuristic)
{
    const pti_fw zero = pti_fw_set(0);
    const pti_w3 o = pti_w3_along(s->ng, pti_lock_lift(k, s, s->ng), s->p);
    pti_fw number = zero, density, distance2, distance, here, there, p, other, weight;
    pti_w3 q, n, w, to, value;
    pti_mw flat = pti_mw_of_bits(~0u), blocked;
    pti_uw light;
    int i, rays;
    for (i = 1; i < k->light_count; i++) number = pti_fw_select(pti_fw_le(pti_fw_set(k->chosen[i]), u->which), pti_fw_set((float)i), number);
    light = pti_uw_from_floats(number);
    density = pti_lock_flat_point(k, light, u, &q, &n);
    if (k->sphere_lights) {
        pti_w3 ball;
        const pti_fw per_angle = pti_lock_ball_point(k, light, o, u, &ball, &to);
        flat = pti_fw_le(pti_lit(k, PTI_LIT_RADIUS, light), zero);
        q = pti_w3_select(flat, q, ball);
        density = pti_fw_select(flat, density, per_angle);
    }
    w = pti_w3_sub(q, o);
    distance2 = pti_w3_dot(w, w);
    distance = pti_fw_sqrt(distance2);
    w = pti_w3_scale(w, pti_fw_div(pti_fw_set(1), distance));
    here = pti_w3_dot(s->n, k->sphere_lights ? pti_w3_select(flat, w, to) : w);
    there = pti_fw_sub(zero, pti_w3_dot(n, w));
    p = pti_fw_select(flat, pti_fw_div(pti_fw_mul(density, distance2), there), density);
    active = pti_mw_and(active, pti_mw_and(pti_fw_lt(zero, here), pti_fw_lt(zero, p)));
    if (k->shading) active = pti_mw_and(active, pti_fw_lt(zero, pti_w3_dot(s->ng, w)));
    rays = pti_count_bits(pti_mw_bits(active));
    if (rays == 0) return 0;
    other = pti_fw_mul(here, pti_fw_set((float)(1 / PT_PI)));
    value = pti_w3_scale(albedo, other);
    if (f && pti_mw_bits(f->rough)) {
        pti_fw of_facets;
        const pti_w3 reflected = pti_lock_reflect(k, s, f, pti_w3_make(pti_w3_dot(w, f->s), pti_w3_dot(w, f->t), here), &of_facets);
        const pti_mw some = pti_mw_and(f->rough, active); /* elsewhere there may be no number */
        value = pti_w3_select(some, pti_w3_mul(albedo, reflected), value);
        other = pti_fw_select(some, of_facets, other);
    }
    weight = pti_fw_div(pti_lock_weight(p, other, heuristic), p);
    blocked = k->tree ? pti_lock_blocked(k, met, pti_mw_bits(active), o, q, w, distance) : pti_lock_any(k, o, w, distance);
    weight = pti_fw_select(active, pti_fw_select(blocked, zero, weight), zero);
    value = pti_w3_mul(value, pti_w3_mul(pti_row3(row + PTI_ROW_BETA), pti_lit3(k, PTI_LIT_EMISSION, light)));
    pti_row3_set(row + PTI_ROW_SUM, pti_w3_along(value, weight, pti_row3(row + PTI_ROW_SUM)));
    return rays;
}

/* A direction about n by the cosine, as pt_warp_cosine has it; *z: the cosine. */
PTI_INLINE8 pti_w3 pti_lock_cosine(pti_w3 n, pti_fw u, pti_fw v, pti_fw *z)
{
    const pti_fw two = pti_fw_set(2), shift = pti_fw_set((float)(PTI_2_M24 - 1)), one = pti_fw_set(1);
    const pti_fw a = pti_fw_madd(two, u, shift), b = pti_fw_madd(two, v, shift);
    const pti_mw wide = pti_fw_lt(pti_fw_abs(b), pti_fw_abs(a));
    const pti_fw r = pti_fw_select(wide, a, b), other = pti_fw_select(wide, b, a);
    pti_fw sine, cosine;
    pti_w3 s, t;
    pti_fw_sincos(pti_fw_mul(pti_fw_div(other, r), pti_fw_set((float)(PT_PI / 4))), &sine, &cosine);
    *z = pti_fw_sqrt(pti_fw_mul(pti_fw_sub(one, r), pti_fw_add(one, r)));
    pti_lock_frame(n, &s, &t);
    s = pti_w3_scale(s, pti_fw_mul(r, pti_fw_select(wide, cosine, sine)));
    return pti_w3_normalize(pti_w3_along(n, *z, pti_w3_along(t, pti_fw_mul(r, pti_fw_select(wide, sine, cosine)), s)));
}

/* Mirrors and glass: the next direction, and what beta is multiplied by. */
PTI_INLINE8 pti_w3 pti_lock_specular(const pti_lockstep *k, const pti_lock_surface *s, pti_w3 d, pti_fw u, pti_w3 *weight, pti_lane_row *row)
{
    const pti_fw one = pti_fw_set(1), zero = pti_fw_set(0), two_cosines = pti_fw_add(s->cosine, s->cosine);
    const pti_fw ior = pti_fw_gather(k->of[PTI_OF_IOR], s->i), eta = pti_fw_select(s->front, pti_fw_div(one, ior), ior);
    const pti_fw sine2 = pti_fw_mul(pti_fw_mul(eta, eta), pti_fw_mul(pti_fw_sub(one, s->cosine), pti_fw_add(one, s->cosine)));
    const pti_fw other = pti_fw_sqrt(pti_fw_max(zero, pti_fw_sub(one, sine2)));
    const pti_fw rs = pti_fw_div(pti_fw_nmadd(other, pti_fw_set(1), pti_fw_mul(eta, s->cosine)), pti_fw_madd(eta, s->cosine, other));
    const pti_fw rp = pti_fw_div(pti_fw_nmadd(eta, other, s->cosine), pti_fw_madd(eta, other, s->cosine));
    const pti_fw half = pti_fw_mul(pti_fw_set(0.5f), pti_fw_madd(rs, rs, pti_fw_mul(rp, rp)));
    const pti_fw fresnel = pti_fw_select(pti_fw_lt(sine2, one), half, one);
    const pti_mw glass = pti_lock_is(s, PT_MATERIAL_DIELECTRIC), bent = pti_mw_and(glass, pti_fw_le(fresnel, u));
    const pti_fw eta2 = pti_fw_mul(eta, eta);
    const pti_w3 mirrored = pti_w3_along(s->n, two_cosines, d);
    const pti_w3 refracted = pti_w3_along(s->n, pti_fw_nmadd(other, one, pti_fw_mul(eta, s->cosine)), pti_w3_scale(d, eta));
    const pti_w3 grey = pti_w3_make(pti_fw_select(bent, eta2, one), pti_fw_select(bent, eta2, one), pti_fw_select(bent, eta2, one));
    if (k->metal) *weight = pti_w3_select(pti_lock_is(s, PT_MATERIAL_CONDUCTOR), pti_w3_mul(*weight, pti_lock_metal(k, s->i, s->cosine)), *weight);
    *weight = pti_w3_select(glass, grey, *weight);
    row[PTI_ROW_ETA2].f = pti_fw_select(bent, pti_fw_div(row[PTI_ROW_ETA2].f, eta2), row[PTI_ROW_ETA2].f);
    return pti_w3_normalize(pti_w3_select(bent, refracted, mirrored));
}

/* Mirrors, smooth metal and glass take the geometric normal where the path comes from behind the shading normal, as
   pti_specular_normal. */
PTI_INLINE8 void pti_lock_smooth_normal(const pti_lockstep *k, pti_lock_surface *s)
{
    const pti_fw zero = pti_fw_set(0);
    const pti_mw smooth = pti_mw_and(pti_fw_lt(zero, s->kind), pti_fw_le(pti_fw_gather(k->of[PTI_OF_ALPHA], s->i), zero)); /* diffuse is 0 */
    const pti_mw behind = pti_mw_and(smooth, pti_fw_le(s->cosine, zero));
    s->n = pti_w3_select(behind, s->ng, s->n);
    s->cosine = pti_fw_select(behind, s->facing, s->cosine);
}

/* The next direction of every lane, its density (-1 of delta lobes), and weight multiplied; lanes of *go that it ends leave it. */
PTI_INLINE8 pti_w3 pti_lock_scatter(const pti_lockstep *k, pti_lock_surface *s, const pti_lock_facets *f, pti_w3 d, const pti_lock_numbers *u,
                                   pti_w3 *weight, pti_fw *density, pti_lane_row *row, pti_mw *go)
{
    const pti_mw all = pti_mw_of_bits(~0u), diffuse = k->specular ? pti_lock_is(s, PT_MATERIAL_DIFFUSE) : all;
    pti_fw cosine;
    pti_w3 next = pti_lock_cosine(s->n, u->bsdf0, u->bsdf1, &cosine);
    if (k->shading && k->specular) pti_lock_smooth_normal(k, s);
    *density = pti_fw_mul(cosine, pti_fw_set((float)(1 / PT_PI)));
    if (k->specular && pti_mw_bits(diffuse) != pti_mw_bits(all)) {
        pti_w3 before = *weight;
        next = pti_w3_select(diffuse, next, pti_lock_specular(k, s, d, u->lobe, weight, row));
        *density = pti_fw_select(diffuse, *density, pti_fw_set(-1));
        if (f && pti_mw_bits(f->rough)) {
            pti_fw of_facets;
            pti_mw above;
            next = pti_w3_select(f->rough, pti_lock_glossy(k, s, f, u->bsdf0, u->bsdf1, &of_facets, &before, &above), next);
            *weight = pti_w3_select(f->rough, before, *weight);
            *density = pti_fw_select(f->rough, of_facets, *density);
            *go = pti_mw_and(*go, pti_mw_or(above, pti_fw_le(pti_fw_gather(k->of[PTI_OF_ALPHA], s->i), pti_fw_set(0))));
        }
    }
    if (k->shading) { /* both normals must agree on the sides */
        const pti_fw zero = pti_fw_set(0), sides = pti_fw_mul(pti_w3_dot(s->n, next), pti_w3_dot(s->ng, next));
        *go = pti_mw_and(*go, pti_mw_and(pti_fw_lt(zero, sides), pti_mw_or(diffuse, pti_fw_lt(zero, s->cosine))));
    }
    return next;
}

/* Russian roulette, as pti_roulette; the lanes that go on. Edges are cheap where rays go through the scene in lanes. */
PTI_INLINE8 pti_mw pti_lock_roulette(const pti_lockstep *k, const pt_li_options *options, pti_lane_row *row, pti_w3 *beta, pti_fw u)
{
    const int constant = options->roulette == PT_ROULETTE_CONSTANT;
    const int start = options->roulette_start > 0 ? options->roulette_start : constant ? 1 : 3;
    const float cheap = k->tree && k->walls == 0 ? 1 : 4;
    const pti_fw scale = pti_fw_set(options->roulette_scale > 0 ? (float)options->roulette_scale : cheap);
    pti_fw q = pti_fw_mul(pti_fw_mul(scale, pti_fw_max(beta->x, pti_fw_max(beta->y, beta->z))), row[PTI_ROW_ETA2].f);
    const pti_mw due = pti_fw_le(pti_fw_set((float)start), pti_fw_from_words(row[PTI_ROW_EDGES].u));
    if (constant) q = pti_fw_set(options->roulette_survival > 0 ? (float)options->roulette_survival : 0.8f);
    q = pti_fw_min(q, pti_fw_set((float)(1 - PTI_2_M24)));
    q = pti_fw_select(due, q, pti_fw_set(1));
    *beta = pti_w3_scale(*beta, pti_fw_div(pti_fw_set(1), q));
    return pti_fw_lt(u, q);
}

/* What all walks of a task share, and those under way. */
enum { PTI_LOCK_SLOTS = 2048, PTI_LOCK_QUEUE = 64 };
typedef struct pti_lock_work {
    const pti_lockstep *k;
    const pt_li_options *options;
    int technique, queued, cancelled, describes; /* describes: `seen` is wanted                            */
    unsigned alive;                 /* lanes that hold a path                                              */
    uint64_t rays;
    unsigned hit;                   /* lanes whose first edge met something, and what that is: albedo,     */
    pti_lane_row seen[7];           /*   normal, distance                                                  */
    pti_lane_row row[PTI_ROWS];
    pti_lock_met met;               /* what lanes have met, where a tree is asked                           */
    uint32_t queue[PTI_LOCK_QUEUE][PTI_ROWS]; /* paths that wait for a lane                                */
    double slots[PTI_LOCK_SLOTS][3]; /* what each path has found                                           */
} pti_lock_work;

/* What the first surface is, for the auxiliary pictures: as pti_describe_first_hit. */
static void pti_lock_describe(pti_lock_work *w, const pti_lock_surface *s, const pti_lock_best *best)
{
    const pti_fw one = pti_fw_set(1), side = pti_fw_select(s->front, one, pti_fw_set(-1));
    const pti_w3 grey = pti_w3_make(one, one, one), albedo = pti_gather3(w->k->of, PTI_OF_ALBEDO, s->i);
    w->hit = pti_mw_bits(s->met);
    pti_row3_set(w->seen, pti_w3_select(pti_lock_is(s, PT_MATERIAL_DIELECTRIC), grey, albedo));
    pti_row3_set(w->seen + 3, pti_w3_scale(s->n, side));
    w->seen[6].f = best->t;
}

/* The next edge of the paths in `row`, where `active`, as in pti_path; the lanes that go on. */
static unsigned pti_lock_vertex(pti_lock_work *w, pti_lane_row *row, unsigned active, const pti_lock_numbers *u, pti_fw u_roulette, int first)
{
    const pti_lockstep *k = w->k;
    const pt_li_options *options = w->options;
    const pti_w3 o = pti_row3(row + PTI_ROW_O), d = pti_row3(row + PTI_ROW_D);
    const pti_fw zero = pti_fw_set(0);
    pti_lock_surface s;
    pti_lock_facets f;
    const pti_lock_facets *facets = NULL;
    pti_lock_best best;
    pti_w3 weight, beta, next;
    pti_fw density;
    pti_mw go;
    w->rays += (uint64_t)pti_count_bits(active);
    if (k->tree) {
        pti_lock_meet(k, row, active, first ? k->e_camera : k->e, &w->met, &best, &s);
    } else {
        pti_lock_nearest(k, o, d, first ? k->e_camera : k->e, &best);
        pti_lock_face(k, &s, pti_lock_land(k, o, d, &best, &s), d);
    }
    s.met = pti_mw_and(pti_mw_of_bits(active), pti_fw_lt(best.t, pti_fw_set(PTI_LOCK_FAR)));
    if (first && w->describes) pti_lock_describe(w, &s, &best);
    pti_lock_emission(k, &s, &best, row, w->technique, options->heuristic);
    go = s.met;
    if (options->max_edges > 0) go = pti_mw_and(go, pti_fw_lt(pti_fw_from_words(row[PTI_ROW_EDGES].u), pti_fw_set((float)options->max_edges)));
    if (!pti_mw_bits(go)) return 0;
    weight = pti_gather3(k->of, PTI_OF_ALBEDO, s.i);
    if (k->rough) pti_lock_find_facets(k, &s, d, &f), facets = &f;
    if (w->technique != PTI_TECHNIQUE_PLAIN && k->light_count > 0) {
        pti_mw asks = k->specular ? pti_mw_and(go, pti_lock_is(&s, PT_MATERIAL_DIFFUSE)) : go;
        if (facets) asks = pti_mw_or(asks, pti_mw_and(pti_mw_and(go, pti_fw_lt(zero, s.cosine)), facets->rough));
        w->rays += (uint64_t)pti_lock_direct(k, &s, &w->met, facets, weight, asks, u, row, options->heuristic);
    }
    next = pti_lock_scatter(k, &s, facets, d, u, &weight, &density, row, &go);
    beta = pti_w3_mul(pti_row3(row + PTI_ROW_BETA), weight);
    go = pti_mw_and(go, pti_fw_lt(zero, pti_fw_max(beta.x, pti_fw_max(beta.y, beta.z))));
    if (options->roulette != PT_ROULETTE_NONE) go = pti_mw_and(go, pti_lock_roulette(k, options, row, &beta, u_roulette));
    pti_row3_set(row + PTI_ROW_BETA, beta);
    pti_row3_set(row + PTI_ROW_D, next);
    next = pti_w3_along(s.ng, pti_lock_lift(k, &s, next), s.p);
    if (k->tree) pti_lock_depart(row, &w->met, next, pti_mw_bits(go));
    else pti_row3_set(row + PTI_ROW_O, next);
    row[PTI_ROW_DENSITY].f = density;
    row[PTI_ROW_EDGES].u = pti_uw_add(row[PTI_ROW_EDGES].u, pti_uw_set(1));
    return pti_mw_bits(go);
}

/* Moves what paths have found to their slots. */
static void pti_lock_flush(pti_lock_work *w, pti_lane_row *row, unsigned lanes)
{
    for (; lanes; lanes &= lanes - 1) {
        const int i = pti_lowest_bit(lanes);
        double *slot = w->slots[row[PTI_ROW_SLOT].bits[i]];
        int k;
        for (k = 0; k < 3; k++) {
            slot[k] += (double)row[PTI_ROW_SUM + k].v[i];
            row[PTI_ROW_SUM + k].v[i] = 0;
        }
    }
}

/* Later vertices, until no more than `rest` paths wait (and, at 0, none walks). A path's sum is emptied into its slot every 64
   edges, so that its float never grows far above what is added. */
static void pti_lock_walk(pti_lock_work *w, int rest)
{
    const unsigned all = ~0u >> (32 - PTI_WIDTH);
    pti_lane_row *row = w->row;
    uint32_t steps = 0;
    while (w->queued > rest || (rest == 0 && w->alive)) {
        pti_lock_numbers u;
        unsigned free_lanes = all & ~w->alive, on, full;
        pti_uw a, b;
        pti_fw zero = pti_fw_set(0), roulette;
        for (; free_lanes && w->queued > 0; free_lanes &= free_lanes - 1) {
            const uint32_t *path = w->queue[--w->queued];
            const int i = pti_lowest_bit(free_lanes);
            int k;
            for (k = 0; k < PTI_ROWS; k++) row[k].bits[i] = path[k];
            w->alive |= 1u << i;
        }
        a = row[PTI_ROW_A].u;
        b = row[PTI_ROW_B].u;
        u.which = w->k->light_count > 1 ? pti_lock_next(&a, &b) : zero;
        u.light0 = pti_lock_next(&a, &b);
        u.light1 = pti_lock_next(&a, &b);
        u.bsdf0 = pti_lock_next(&a, &b);
        u.bsdf1 = pti_lock_next(&a, &b);
        u.lobe = w->k->specular ? pti_lock_next(&a, &b) : zero;
        roulette = pti_lock_next(&a, &b);
        row[PTI_ROW_A].u = a;
        row[PTI_ROW_B].u = b;
        on = pti_lock_vertex(w, row, w->alive, &u, roulette, 0);
        full = w->alive & pti_mw_bits(pti_fw_lt(pti_fw_from_words(pti_uw_and(row[PTI_ROW_EDGES].u, pti_uw_set(63))), pti_fw_set(1)));
        pti_lock_flush(w, row, (w->alive & ~on) | full);
        w->alive &= on;
        if ((++steps & 0xfff) == 0 && w->options->poll && w->options->poll(w->options->poll_user)) {
            w->cancelled = 1;
            return;
        }
    }
}

/* The first vertex: `active` paths start with these numbers; those that go on wait. */
static void pti_lock_start(pti_lock_work *w, pti_lane_row *row, unsigned active, const pti_lock_numbers *u)
{
    const pti_fw one = pti_fw_set(1), zero = pti_fw_set(0);
    pti_uw a = row[PTI_ROW_A].u, b = row[PTI_ROW_B].u;
    const pti_fw roulette = pti_lock_next(&a, &b);
    unsigned on;
    row[PTI_ROW_A].u = a;
    row[PTI_ROW_B].u = b;
    pti_row3_set(row + PTI_ROW_BETA, pti_w3_make(one, one, one));
    pti_row3_set(row + PTI_ROW_SUM, pti_w3_make(zero, zero, zero));
    row[PTI_ROW_DENSITY].f = pti_fw_set(-1);
    row[PTI_ROW_ETA2].f = one;
    row[PTI_ROW_EDGES].u = pti_uw_set(1);
    pti_row3_set(row + PTI_ROW_LOW, pti_w3_make(zero, zero, zero));
    on = pti_lock_vertex(w, row, active, u, roulette, 1);
    pti_lock_flush(w, row, active & ~on);
    for (on &= active; on; on &= on - 1) {
        const int i = pti_lowest_bit(on);
        uint32_t *path = w->queue[w->queued++];
        int k;
        for (k = 0; k < PTI_ROWS; k++) path[k] = row[k].bits[i];
    }
    if (w->queued > PTI_LOCK_QUEUE - PTI_WIDTH) pti_lock_walk(w, PTI_WIDTH);
}

#endif /* PTI_HAS_LOCKSTEP */

/* =====================================================================================================
   [PT-17] FILES: implementation
   =====================================================================================================
   Writing: every file is written under a temporary name, synced, and renamed when it is whole; a checkpoint is thus
   the last one or the one before, never half of one.

   Reading: a file is a stranger. It is read whole, or its size is known, before memory is asked for; each count is
   compared with what is left of it, each index with what it points into, and each number with its range. Files of
   more than 2 GiB are refused, but for films. Numbers in texts are parsed here: strtod would obey the locale.

   Models: one pass over the text, in time that grows as its length does. Each combination of v, vt and vn becomes one
   vertex, found by its hash; a material is added when a face first needs it, and a picture is read once. Only cutting a
   polygon that is not convex takes longer than its corners are many, and is therefore limited to 1024 of them.

   A film file: 64 bytes of head (see pti_film_head), the ranges of samples (first and end, 32 bits each), the sums as
   64-bit floats in the order of pti_film_plane, and the CRC-64 of all that [ECMA 182, reflected]. Everything is
   little-endian. A CRC finds every change within 8 consecutive bytes, and misses others once in 2^64. */

#if PTI_HAS_FILES

/* Hands what the system still holds of a flushed file to the disk; 0: that failed. */
static int pti_sync(FILE *file)
{
#ifdef PTI_HAS_FSYNC
    return fsync(fileno(file)) == 0;
#elif defined(_WIN32)
    return _commit(_fileno(file)) == 0;
#else
    (void)file;
    return 1;
#endif
}

typedef struct pti_writer {
    FILE *file;
    char temporary[4096];
    int failed;
} pti_writer;

static int pti_writer_open(pti_writer *w, const char *path)
{
    w->file = NULL;
    w->failed = 0;
    if (!path || !*path || strlen(path) + 8 > sizeof w->temporary) return 0;
    w->temporary[0] = 0;
    pti_append(w->temporary, sizeof w->temporary, path);
    pti_append(w->temporary, sizeof w->temporary, ".part");
    w->file = fopen(w->temporary, "wb");
    return w->file != NULL;
}

static void pti_write(pti_writer *w, const void *data, size_t size)
{
    if (fwrite(data, 1, size, w->file) != size) w->failed = 1;
}

static void pti_write_text(pti_writer *w, const char *text)
{
    pti_write(w, text, strlen(text));
}

/* Closes, and gives the file its name if all went well. */
static pt_result pti_writer_close(pti_writer *w, const char *path)
{
    if (fflush(w->file) != 0 || !pti_sync(w->file)) w->failed = 1;
    if (fclose(w->file) != 0) w->failed = 1;
#if defined(_WIN32)
    if (!w->failed && !MoveFileExA(w->temporary, path, MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH)) w->failed = 1;
#else
    if (!w->failed && rename(w->temporary, path) != 0) w->failed = 1;
#endif
    if (w->failed) remove(w->temporary);
    return w->failed ? PT_ERROR_FILE : PT_OK;
}

PTDEF pt_result pt_write_ppm_bytes(const char *path, const unsigned char *rgb, int width, int height)
{
    char head[64] = "P6\n";
    pti_writer w;
    if (!rgb || !pti_pixels_fit(width, height)) return PT_ERROR_ARGUMENT;
    if (!pti_writer_open(&w, path)) return PT_ERROR_FILE;
    pti_append_integer(head, sizeof head, (uint64_t)width);
    pti_append(head, sizeof head, " ");
    pti_append_integer(head, sizeof head, (uint64_t)height);
    pti_append(head, sizeof head, "\n255\n");
    pti_write_text(&w, head);
    pti_write(&w, rgb, 3 * (size_t)width * (size_t)height);
    return pti_writer_close(&w, path);
}

PTDEF pt_result pt_write_pfm_floats(const char *path, const float *rgb, int width, int height)
{
    char head[64] = "PF\n";
    pti_writer w;
    int x, y, k;
    if (!rgb || !pti_pixels_fit(width, height)) return PT_ERROR_ARGUMENT;
    if (!pti_writer_open(&w, path)) return PT_ERROR_FILE;
    pti_append_integer(head, sizeof head, (uint64_t)width);
    pti_append(head, sizeof head, " ");
    pti_append_integer(head, sizeof head, (uint64_t)height);
    pti_append(head, sizeof head, "\n-1.0\n"); /* negative: little-endian */
    pti_write_text(&w, head);
    for (y = height - 1; y >= 0; y--)
        for (x = 0; x < 3 * width; x++) {
            unsigned char bytes[4];
            uint32_t bits;
            memcpy(&bits, &rgb[3 * (size_t)y * (size_t)width + (size_t)x], 4);
            for (k = 0; k < 4; k++) bytes[k] = (unsigned char)((bits >> (8 * k)) & 255u);
            pti_write(&w, bytes, 4);
        }
    return pti_writer_close(&w, path);
}

/* A value as a code of 0..most with the sRGB transfer, as pt_srgb_byte does it. */
static uint32_t pti_srgb_code(double linear, double most)
{
    double v = linear > 0 ? (linear < 1 ? linear : 1.0) : 0.0;
    return (uint32_t)(most * pt_srgb_encode(v) + 0.5);
}

/* One row of a film as PPM; P3: one pixel a line. Returns how many bytes of `out`, 18 a pixel at most. */
static size_t pti_ppm_row(const pt_film *film, int y, double exposure, pt_ppm_kind kind, char *out)
{
    size_t row = 3 * (size_t)film->width, k, n = 0;
    int is_long = kind == PT_PPM_P6_16 || kind == PT_PPM_P3_16;
    for (k = 0; k < row; k++) {
        uint32_t code = pti_srgb_code(exposure * pti_film_value(film, 2, row * (size_t)y + k), is_long ? 65535 : 255);
        if (kind == PT_PPM_P3 || kind == PT_PPM_P3_16) {
            out[n] = 0;
            pti_append_integer(out + n, 8, code);
            n += strlen(out + n);
            out[n++] = k % 3 == 2 ? '\n' : ' ';
        } else {
            if (is_long) out[n++] = (char)(unsigned char)(code >> 8);
            out[n++] = (char)(unsigned char)(code & 255u);
        }
    }
    return n;
}

PTDEF pt_result pt_write_ppm_as(const char *path, const pt_film *film, double exposure, pt_ppm_kind kind)
{
    char head[64] = "";
    char *row;
    pti_writer w;
    int y;
    if (!film->half[0] || !(exposure >= 0) || !pti_finite(exposure) || (int)kind < 0 || kind > PT_PPM_P3_16) return PT_ERROR_ARGUMENT;
    row = (char *)pti_alloc((size_t)film->width, 18, film->alloc_user);
    if (!row) return PT_ERROR_MEMORY;
    if (!pti_writer_open(&w, path)) {
        pti_free(row, film->alloc_user);
        return PT_ERROR_FILE;
    }
    pti_append(head, sizeof head, kind == PT_PPM_P6 || kind == PT_PPM_P6_16 ? "P6\n" : "P3\n");
    pti_append_integer(head, sizeof head, (uint64_t)film->width);
    pti_append(head, sizeof head, " ");
    pti_append_integer(head, sizeof head, (uint64_t)film->height);
    pti_append(head, sizeof head, kind == PT_PPM_P6_16 || kind == PT_PPM_P3_16 ? "\n65535\n" : "\n255\n");
    pti_write_text(&w, head);
    for (y = 0; y < film->height; y++) pti_write(&w, row, pti_ppm_row(film, y, exposure, kind, row));
    pti_free(row, film->alloc_user);
    return pti_writer_close(&w, path);
}

/* --- films --- */

static void pti_put_little(unsigned char *to, uint64_t v, int bytes)
{
    int k;
    for (k = 0; k < bytes; k++) to[k] = (unsigned char)((v >> (8 * k)) & 255u);
}

static uint64_t pti_get_little(const unsigned char *from, int bytes)
{
    uint64_t v = 0;
    int k;
    for (k = 0; k < bytes; k++) v |= (uint64_t)from[k] << (8 * k);
    return v;
}

/* A running CRC-64: a byte at a time with a table of what each byte does. */
typedef struct pti_crc64 {
    uint64_t sum, table[256];
} pti_crc64;

static void pti_crc64_start(pti_crc64 *c)
{
    int i, k;
    for (i = 0; i < 256; i++) {
        uint64_t v = (uint64_t)i;
        for (k = 0; k < 8; k++) v = (v >> 1) ^ (0xc96c5795d7870f42u & (0u - (v & 1u)));
        c->table[i] = v;
    }
    c->sum = UINT64_MAX;
}

static void pti_crc64_add(pti_crc64 *c, const unsigned char *data, size_t size)
{
    uint64_t sum = c->sum;
    for (; size > 0; size--) sum = c->table[(sum ^ *data++) & 255u] ^ (sum >> 8);
    c->sum = sum;
}

enum { PTI_FILM_HEAD = 64, PTI_FILM_FORMAT = 1, PTI_FILM_PLANES = 8, PTI_FILM_CLASSES = 1024, PTI_FILM_CHUNK = 4096 };

/* Where the film keeps plane i, and how many values a pixel it has. */
static double **pti_film_plane(pt_film *film, int i, size_t *channels)
{
    double **planes[PTI_FILM_PLANES] = {&film->half[0], &film->half[1], &film->splat[0], &film->splat[1],
                                        &film->albedo,  &film->normal,  &film->depth,    &film->classes};
    *channels = i == 7 ? 3 * (size_t)film->class_count : i == 6 ? 1 : 3;
    return planes[i];
}

/* Bit i: plane i is there. */
static uint32_t pti_film_planes(pt_film *film)
{
    uint32_t planes = 0;
    size_t channels;
    int i;
    for (i = 0; i < PTI_FILM_PLANES; i++)
        if (*pti_film_plane(film, i, &channels)) planes |= 1u << i;
    return planes;
}

/* Can there be a film with these planes: both halves, all of albedo, normal and depth or none, classes if counted? */
static int pti_film_planes_fit(const pt_film *film, uint32_t planes)
{
    uint32_t aov = planes & 0x70u;
    return (planes & 3u) == 3u && planes < 1u << PTI_FILM_PLANES && (aov == 0 || aov == 0x70u) && film->class_count >= 0 &&
           film->class_count <= PTI_FILM_CLASSES && (planes >> 7 != 0) == (film->class_count > 0);
}

/* Are the ranges disjoint and rising, with as many samples as the film counts? Without ranges any count will do. */
static int pti_film_ranges_fit(const pt_film *film)
{
    uint64_t count = 0, last = 0;
    uint32_t i;
    for (i = 0; i < film->range_count; i++) {
        const pt_range r = film->ranges[i];
        if (r.begin >= r.end || (i > 0 && r.begin <= last)) return 0;
        count += r.end - r.begin;
        last = r.end;
    }
    return film->range_count == 0 || count == (uint64_t)film->samples[0] + film->samples[1];
}

/* Bytes of the file of such a film: below 2^48, as pictures have at most 2^32 pixels. */
static uint64_t pti_film_file_size(pt_film *film, uint32_t planes)
{
    uint64_t pixels = (uint64_t)film->width * (uint64_t)film->height, size = PTI_FILM_HEAD + 8 * (uint64_t)film->range_count + 8;
    size_t channels;
    int i;
    for (i = 0; i < PTI_FILM_PLANES; i++) {
        pti_film_plane(film, i, &channels);
        if (planes >> i & 1u) size += 8 * channels * pixels;
    }
    return size;
}

/* The head: 8 letters, of which the line end shows a transfer as text; version of the format; then how this build
   calls itself, for whoever looks; planes; sizes; counts; the fingerprint. */
static void pti_film_head(pt_film *film, unsigned char *b)
{
    memcpy(b, "ptfilm\r\n", 8);
    pti_put_little(b + 8, PTI_FILM_FORMAT, 4);
    pti_put_little(b + 12, sizeof(pt_real), 4);
    pti_put_little(b + 16, PT_VERSION_MAJOR << 16 | PT_VERSION_MINOR << 8 | PT_VERSION_PATCH, 4);
    pti_put_little(b + 20, pti_film_planes(film), 4);
    pti_put_little(b + 24, (uint64_t)film->width, 4);
    pti_put_little(b + 28, (uint64_t)film->height, 4);
    pti_put_little(b + 32, (uint64_t)film->class_count, 4);
    pti_put_little(b + 36, film->range_count, 4);
    pti_put_little(b + 40, film->samples[0], 4);
    pti_put_little(b + 44, film->samples[1], 4);
    pti_put_little(b + 48, film->fingerprint, 8);
    pti_put_little(b + 56, film->nonfinite, 8);
}

static void pti_film_put(pti_writer *w, pti_crc64 *crc, const unsigned char *data, size_t size)
{
    pti_crc64_add(crc, data, size);
    pti_write(w, data, size);
}

static void pti_film_put_doubles(pti_writer *w, pti_crc64 *crc, const double *values, size_t count)
{
    unsigned char chunk[PTI_FILM_CHUNK];
    while (count > 0) {
        size_t n = count < PTI_FILM_CHUNK / 8 ? count : (size_t)PTI_FILM_CHUNK / 8, k;
        for (k = 0; k < n; k++) {
            uint64_t bits;
            memcpy(&bits, &values[k], 8);
            pti_put_little(chunk + 8 * k, bits, 8);
        }
        pti_film_put(w, crc, chunk, 8 * n);
        values += n;
        count -= n;
    }
}

PTDEF pt_result pt_film_write(const char *path, const pt_film *film)
{
    pt_film f = *film; /* the same arrays, for reading */
    size_t pixels = (size_t)f.width * (size_t)f.height, channels;
    unsigned char b[PTI_FILM_HEAD];
    pti_crc64 crc;
    pti_writer w;
    uint32_t i;
    int k;
    if (!f.half[0] || !pti_film_planes_fit(&f, pti_film_planes(&f)) || !pti_film_ranges_fit(&f)) return PT_ERROR_ARGUMENT;
    if (!pti_writer_open(&w, path)) return PT_ERROR_FILE;
    pti_crc64_start(&crc);
    pti_film_head(&f, b);
    pti_film_put(&w, &crc, b, PTI_FILM_HEAD);
    for (i = 0; i < f.range_count; i++) {
        pti_put_little(b, f.ranges[i].begin, 4);
        pti_put_little(b + 4, f.ranges[i].end, 4);
        pti_film_put(&w, &crc, b, 8);
    }
    for (k = 0; k < PTI_FILM_PLANES; k++) {
        const double *values = *pti_film_plane(&f, k, &channels);
        if (values) pti_film_put_doubles(&w, &crc, values, pixels * channels);
    }
    pti_put_little(b, ~crc.sum, 8);
    pti_write(&w, b, 8);
    return pti_writer_close(&w, path);
}

/* --- reading --- */

/* Bytes of an open file, -1 if it has no size (a pipe, say); what is read next is its first byte. */
static int64_t pti_file_size(FILE *file)
{
    int64_t size = -1;
#if defined(_WIN32)
    if (_fseeki64(file, 0, SEEK_END) == 0) size = _ftelli64(file);
#else
    if (fseek(file, 0, SEEK_END) == 0) size = (int64_t)ftell(file);
#endif
    rewind(file);
    return size;
}

/* Does the file end with the CRC-64 of all that stands before? */
static int pti_film_is_whole(FILE *file, uint64_t size)
{
    unsigned char chunk[PTI_FILM_CHUNK];
    pti_crc64 crc;
    pti_crc64_start(&crc);
    for (size -= 8; size > 0;) {
        size_t n = size < PTI_FILM_CHUNK ? (size_t)size : (size_t)PTI_FILM_CHUNK;
        if (fread(chunk, 1, n, file) != n) return 0;
        pti_crc64_add(&crc, chunk, n);
        size -= n;
    }
    return fread(chunk, 1, 8, file) == 8 && pti_get_little(chunk, 8) == ~crc.sum;
}

static int pti_get_doubles(FILE *file, double *values, size_t count)
{
    unsigned char chunk[PTI_FILM_CHUNK];
    while (count > 0) {
        size_t n = count < PTI_FILM_CHUNK / 8 ? count : (size_t)PTI_FILM_CHUNK / 8, k;
        if (fread(chunk, 8, n, file) != n) return 0;
        for (k = 0; k < n; k++) {
            uint64_t bits = pti_get_little(chunk + 8 * k, 8);
            memcpy(&values[k], &bits, 8);
        }
        values += n;
        count -= n;
    }
    return 1;
}

/* An empty film with the planes, and room for the ranges, of the one that `head` tells of. */
static pt_result pti_film_make_planes(pt_film *film, const pt_film *head, uint32_t planes)
{
    pt_result result = pt_film_make(film, head->width, head->height, (planes & 0x70u) != 0);
    int h;
    for (h = 0; h < 2; h++)
        if (result == PT_OK && (planes >> (2 + h) & 1u) && !pti_film_need_splat(film, h)) result = PT_ERROR_MEMORY;
    if (result == PT_OK && head->class_count > 0) result = pt_film_make_classes(film, head->class_count);
    if (result == PT_OK && !pti_reserve(&film->ranges, &film->range_capacity, head->range_count, sizeof *film->ranges, film->alloc_user))
        result = PT_ERROR_MEMORY;
    return result;
}

static int pti_film_get_ranges(FILE *file, pt_film *film, uint32_t count)
{
    unsigned char b[8];
    for (film->range_count = 0; film->range_count < count; film->range_count++) {
        if (fread(b, 1, 8, file) != 8) return 0;
        film->ranges[film->range_count].begin = (uint32_t)pti_get_little(b, 4);
        film->ranges[film->range_count].end = (uint32_t)pti_get_little(b + 4, 4);
    }
    return pti_film_ranges_fit(film);
}

/* The fields of a head; 0: no film has such ones. */
static int pti_film_parse_head(pt_film *head, const unsigned char *b, uint32_t *planes)
{
    memset(head, 0, sizeof *head);
    *planes = (uint32_t)pti_get_little(b + 20, 4);
    if (pti_get_little(b + 24, 4) > 65536 || pti_get_little(b + 28, 4) > 65536 || pti_get_little(b + 32, 4) > PTI_FILM_CLASSES) return 0;
    head->width = (int)pti_get_little(b + 24, 4);
    head->height = (int)pti_get_little(b + 28, 4);
    head->class_count = (int)pti_get_little(b + 32, 4);
    head->range_count = (uint32_t)pti_get_little(b + 36, 4);
    head->samples[0] = (uint32_t)pti_get_little(b + 40, 4);
    head->samples[1] = (uint32_t)pti_get_little(b + 44, 4);
    head->fingerprint = pti_get_little(b + 48, 8);
    head->nonfinite = pti_get_little(b + 56, 8);
    return pti_pixels_fit(head->width, head->height) && pti_film_planes_fit(head, *planes);
}

static pt_result pti_film_read(FILE *file, pt_film *film)
{
    unsigned char b[PTI_FILM_HEAD];
    int64_t size = pti_file_size(file);
    pt_film head;
    size_t channels;
    uint32_t planes;
    pt_result result;
    int k;
    if (size < PTI_FILM_HEAD + 8 || fread(b, 1, PTI_FILM_HEAD, file) != PTI_FILM_HEAD) return PT_ERROR_FILE;
    if (memcmp(b, "ptfilm\r\n", 8) != 0) return PT_ERROR_FILE;
    rewind(file);
    if (!pti_film_is_whole(file, (uint64_t)size)) return PT_ERROR_FILE;
    if (pti_get_little(b + 8, 4) != PTI_FILM_FORMAT) return PT_ERROR_MISMATCH;
    if (!pti_film_parse_head(&head, b, &planes) || pti_film_file_size(&head, planes) != (uint64_t)size) return PT_ERROR_FILE;
    result = pti_film_make_planes(film, &head, planes);
    if (result != PT_OK) return result;
    film->samples[0] = head.samples[0];
    film->samples[1] = head.samples[1];
    film->fingerprint = head.fingerprint;
    film->nonfinite = head.nonfinite;
    if (fseek(file, PTI_FILM_HEAD, SEEK_SET) != 0 || !pti_film_get_ranges(file, film, head.range_count)) return PT_ERROR_FILE;
    for (k = 0; k < PTI_FILM_PLANES; k++) {
        double *values = *pti_film_plane(film, k, &channels);
        if (values && !pti_get_doubles(file, values, (size_t)film->width * (size_t)film->height * channels)) return PT_ERROR_FILE;
    }
    return PT_OK;
}

PTDEF pt_result pt_film_read(const char *path, pt_film *film)
{
    pt_result result = PT_ERROR_FILE;
    FILE *file = path ? fopen(path, "rb") : NULL;
    pt_film_free(film);
    if (!file) return result;
    result = pti_film_read(file, film);
    fclose(file);
    if (result != PT_OK) pt_film_free(film);
    return result;
}

#if PTI_HAS_MEASURED
static const unsigned char pti_merl_head[12] = {90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0};

PTDEF pt_result pt_measured_write(const char *path, const pt_measured *m)
{
    pti_writer w;
    size_t i;
    int k;
    if (!m->value) return PT_ERROR_ARGUMENT;
    if (!pti_writer_open(&w, path)) return PT_ERROR_FILE;
    pti_write(&w, pti_merl_head, sizeof pti_merl_head);
    for (i = 0; i < 3 * (size_t)PT_MEASURED_CELLS; i++) {
        unsigned char bytes[8];
        uint64_t bits;
        memcpy(&bits, &m->value[i], 8);
        for (k = 0; k < 8; k++) bytes[k] = (unsigned char)((bits >> (8 * k)) & 255u);
        pti_write(&w, bytes, 8);
    }
    return pti_writer_close(&w, path);
}

static int pti_merl_read_values(FILE *file, double *value)
{
    unsigned char b[12];
    size_t i;
    if (fread(b, 1, 12, file) != 12 || memcmp(b, pti_merl_head, 12) != 0) return 0;
    if (!pti_get_doubles(file, value, 3 * (size_t)PT_MEASURED_CELLS)) return 0;
    for (i = 0; i < 3 * (size_t)PT_MEASURED_CELLS; i++)
        if (!(fabs(value[i]) <= 1e30)) return 0; /* NaN, or no BRDF: sums and floats must hold it */
    return 1;
}

PTDEF pt_result pt_measured_read(const char *path, pt_measured *m)
{
    FILE *file = path ? fopen(path, "rb") : NULL;
    pt_result result = file && pti_file_size(file) >= 12 + 24 * (int64_t)PT_MEASURED_CELLS ? pti_merl_make(m) : PT_ERROR_FILE;
    if (result == PT_OK && !pti_merl_read_values(file, m->value)) result = PT_ERROR_FILE;
    if (file) fclose(file);
    if (result == PT_OK) pti_merl_finish(m);
    else pt_measured_free(m);
    return result;
}
#endif

/* --- PNG: zlib stream of one deflate block with fixed Huffman codes (RFC 1950, 1951, PNG specification) --- */

typedef struct pti_bits {
    unsigned char *data;    /* large enough for the worst case: 9 bits a byte                              */
    size_t size;
    uint32_t buffer;
    int count;
} pti_bits;

/* Least significant bit first. */
static void pti_put_bits(pti_bits *b, uint32_t value, int count)
{
    b->buffer |= value << b->count;
    for (b->count += count; b->count >= 8; b->count -= 8) {
        b->data[b->size++] = (unsigned char)(b->buffer & 255u);
        b->buffer >>= 8;
    }
}

/* Huffman codes go most significant bit first. */
static void pti_put_code(pti_bits *b, uint32_t code, int count)
{
    pti_put_bits(b, pti_reverse_bits(code) >> (32 - count), count);
}

/* A literal or length symbol of the fixed code [RFC 1951 3.2.6]. */
static void pti_put_symbol(pti_bits *b, uint32_t s)
{
    if (s < 144) pti_put_code(b, 0x30 + s, 8);
    else if (s < 256) pti_put_code(b, 0x190 + s - 144, 9);
    else if (s < 280) pti_put_code(b, s - 256, 7);
    else pti_put_code(b, 0xc0 + s - 280, 8);
}

/* Length 3..257 and distance 1..32768 [RFC 1951 3.2.5]: both codes grow like logarithms, with 4 or 2 steps an
   octave and the rest in extra bits. */
static void pti_put_match(pti_bits *b, uint32_t length, uint32_t distance)
{
    uint32_t l = length - 3, d = distance - 1, extra = 0;
    while ((l >> extra) >= 8) extra++;
    if (l < 8) pti_put_symbol(b, 257 + l);
    else pti_put_symbol(b, 257 + 4 * extra + (l >> extra));
    pti_put_bits(b, l & ((1u << extra) - 1), (int)extra);
    for (extra = 0; (d >> extra) >= 4;) extra++;
    pti_put_code(b, d < 4 ? d : 2 * extra + (d >> extra), 5);
    pti_put_bits(b, d & ((1u << extra) - 1), (int)extra);
}

#define PTI_HASH_SIZE 32768u

/* LZ77 with one candidate for each hash of three bytes: enough for flat parts of pictures; noise has no
   repetitions to find. */
static void pti_deflate(pti_bits *b, const unsigned char *data, size_t size, size_t *heads)
{
    size_t i = 0, k;
    for (k = 0; k < PTI_HASH_SIZE; k++) heads[k] = SIZE_MAX;
    pti_put_bits(b, 1, 1); /* last block */
    pti_put_bits(b, 1, 2); /* fixed codes */
    while (i < size) {
        uint32_t length = 0;
        size_t at = SIZE_MAX;
        if (i + 3 <= size) {
            uint32_t h = (uint32_t)data[i] | (uint32_t)data[i + 1] << 8 | (uint32_t)data[i + 2] << 16;
            h = (h * 2654435761u) >> 17;
            at = heads[h];
            heads[h] = i;
        }
        if (at != SIZE_MAX && i - at <= 32768)
            while (length < 257 && i + length < size && data[at + length] == data[i + length]) length++;
        if (length >= 3) {
            pti_put_match(b, length, (uint32_t)(i - at));
            i += length;
        } else {
            pti_put_symbol(b, data[i++]);
        }
    }
    pti_put_symbol(b, 256);
    if (b->count > 0) pti_put_bits(b, 0, 8 - b->count);
}

/* The neighbour (left a, above p, above left c) that is nearest to a + p - c (Paeth). */
static int pti_paeth(int a, int p, int c)
{
    int da = p > c ? p - c : c - p, dp = a > c ? a - c : c - a, dc = a + p - 2 * c;
    if (dc < 0) dc = -dc;
    return (da <= dp && da <= dc ? a : dp <= dc ? p : c);
}

/* One row through PNG filter 4: each byte less that neighbour. out: the filter's number and 3 * width bytes. */
static void pti_png_row(const unsigned char *rgb, int width, int y, unsigned char *out)
{
    size_t stride = 3 * (size_t)width, k;
    const unsigned char *row = rgb + (size_t)y * stride;
    out[0] = 4;
    for (k = 0; k < stride; k++) {
        int a = k < 3 ? 0 : row[k - 3], p = y == 0 ? 0 : row[k - stride], c = y == 0 || k < 3 ? 0 : row[k - stride - 3];
        out[1 + k] = (unsigned char)(row[k] - pti_paeth(a, p, c));
    }
}

/* Four bits at a time: what each of the 16 does to the rest. */
static uint32_t pti_crc32(uint32_t crc, const unsigned char *data, size_t size)
{
    static const uint32_t table[16] = {0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4, 0x4db26158, 0x5005713c,
                                       0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c, 0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};
    size_t i;
    crc = ~crc;
    for (i = 0; i < size; i++) {
        crc = table[(crc ^ data[i]) & 15u] ^ (crc >> 4);
        crc = table[(crc ^ (uint32_t)data[i] >> 4) & 15u] ^ (crc >> 4);
    }
    return ~crc;
}

static uint32_t pti_adler32(const unsigned char *data, size_t size)
{
    uint32_t a = 1, b = 0;
    size_t i;
    for (i = 0; i < size; i++) {
        a = (a + data[i]) % 65521u;
        b = (b + a) % 65521u;
    }
    return b << 16 | a;
}

static void pti_big_endian(unsigned char *p, uint32_t v)
{
    p[0] = (unsigned char)(v >> 24);
    p[1] = (unsigned char)((v >> 16) & 255u);
    p[2] = (unsigned char)((v >> 8) & 255u);
    p[3] = (unsigned char)(v & 255u);
}

static const unsigned char pti_png_signature[8] = {137, 80, 78, 71, 13, 10, 26, 10};

static void pti_png_chunk(pti_writer *w, const char *type, const unsigned char *data, size_t size)
{
    unsigned char head[8], tail[4];
    pti_big_endian(head, (uint32_t)size);
    memcpy(head + 4, type, 4);
    pti_big_endian(tail, pti_crc32(pti_crc32(0, head + 4, 4), data, size));
    pti_write(w, head, 8);
    pti_write(w, data, size);
    pti_write(w, tail, 4);
}

/* The zlib stream of all rows; 0 = no memory. */
static int pti_png_compress(const unsigned char *rgb, int width, int height, void *user, pti_bits *b)
{
    size_t stride = 3 * (size_t)width + 1, size = stride * (size_t)height;
    unsigned char *raw = (unsigned char *)pti_alloc(size, 1, user);
    size_t *heads = (size_t *)pti_alloc(PTI_HASH_SIZE, sizeof *heads, user);
    int y, ok;
    memset(b, 0, sizeof *b);
    b->data = (unsigned char *)pti_alloc(size + size / 8 + 64, 1, user);
    ok = raw && heads && b->data;
    for (y = 0; ok && y < height; y++) pti_png_row(rgb, width, y, raw + (size_t)y * stride);
    if (ok) {
        b->data[b->size++] = 0x78;
        b->data[b->size++] = 0x01;
        pti_deflate(b, raw, size, heads);
        pti_big_endian(b->data + b->size, pti_adler32(raw, size));
        b->size += 4;
    }
    pti_free(raw, user);
    pti_free(heads, user);
    if (!ok) pti_free(b->data, user);
    return ok;
}

static pt_result pti_write_png(const char *path, const unsigned char *rgb, int width, int height, void *user)
{
    unsigned char header[13] = {0, 0, 0, 0, 0, 0, 0, 0, 8, 2, 0, 0, 0}; /* 8 bits, RGB */
    pti_writer w;
    pti_bits b;
    if (!rgb || !pti_pixels_fit(width, height)) return PT_ERROR_ARGUMENT;
    if (3.4 * width * height > 2147483647.0) return PT_ERROR_ARGUMENT; /* a chunk is shorter than 2^31 */
    if (!pti_png_compress(rgb, width, height, user, &b)) return PT_ERROR_MEMORY;
    if (!pti_writer_open(&w, path)) {
        pti_free(b.data, user);
        return PT_ERROR_FILE;
    }
    pti_big_endian(header, (uint32_t)width);
    pti_big_endian(header + 4, (uint32_t)height);
    pti_write(&w, pti_png_signature, 8);
    pti_png_chunk(&w, "IHDR", header, 13);
    pti_png_chunk(&w, "IDAT", b.data, b.size);
    pti_png_chunk(&w, "IEND", header, 0);
    pti_free(b.data, user);
    return pti_writer_close(&w, path);
}

PTDEF pt_result pt_write_png_bytes(const char *path, const unsigned char *rgb, int width, int height)
{
    return pti_write_png(path, rgb, width, height, NULL);
}

/* The film as 8-bit sRGB; NULL = no memory. */
static unsigned char *pti_film_bytes(const pt_film *film, double exposure)
{
    size_t n = 3 * (size_t)film->width * (size_t)film->height, k;
    unsigned char *rgb = (unsigned char *)pti_alloc(n, 1, film->alloc_user);
    for (k = 0; rgb && k < n; k++) rgb[k] = pt_srgb_byte(exposure * pti_film_value(film, 2, k));
    return rgb;
}

static pt_result pti_write_film(const char *path, const pt_film *film, double exposure, int png)
{
    unsigned char *rgb;
    pt_result result;
    if (!film->half[0] || !(exposure >= 0) || !pti_finite(exposure)) return PT_ERROR_ARGUMENT;
    rgb = pti_film_bytes(film, exposure);
    if (!rgb) return PT_ERROR_MEMORY;
    if (png) result = pti_write_png(path, rgb, film->width, film->height, film->alloc_user);
    else result = pt_write_ppm_bytes(path, rgb, film->width, film->height);
    pti_free(rgb, film->alloc_user);
    return result;
}

PTDEF pt_result pt_write_ppm(const char *path, const pt_film *film, double exposure)
{
    return pti_write_film(path, film, exposure, 0);
}

PTDEF pt_result pt_write_png(const char *path, const pt_film *film, double exposure)
{
    return pti_write_film(path, film, exposure, 1);
}

PTDEF pt_result pt_write_pfm(const char *path, const pt_film *film)
{
    size_t n = 3 * (size_t)film->width * (size_t)film->height, k;
    float *rgb;
    pt_result result;
    if (!film->half[0]) return PT_ERROR_ARGUMENT;
    rgb = (float *)pti_alloc(n, sizeof *rgb, film->alloc_user);
    if (!rgb) return PT_ERROR_MEMORY;
    for (k = 0; k < n; k++) rgb[k] = (float)pti_film_value(film, 2, k);
    result = pt_write_pfm_floats(path, rgb, film->width, film->height);
    pti_free(rgb, film->alloc_user);
    return result;
}

/* --- pictures, reading --- */

/* A whole file in memory, with a 0 behind it. PT_ERROR_FILE: it cannot be read; PT_ERROR_ARGUMENT: it is beyond 2 GiB. */
static pt_result pti_read_file(const char *path, void *user, unsigned char **bytes, size_t *size)
{
    FILE *file = path ? fopen(path, "rb") : NULL;
    int64_t n = file ? pti_file_size(file) : -1;
    pt_result result = n < 0 ? PT_ERROR_FILE : n > 0x7fffffff ? PT_ERROR_ARGUMENT : PT_OK;
    *bytes = NULL;
    *size = result == PT_OK ? (size_t)n : 0;
    if (result == PT_OK) {
        *bytes = (unsigned char *)pti_alloc(*size + 1, 1, user);
        result = *bytes ? PT_OK : PT_ERROR_MEMORY;
    }
    if (result == PT_OK) {
        if (fread(*bytes, 1, *size, file) != *size) result = PT_ERROR_FILE;
        (*bytes)[*size] = 0;
    }
    if (file) fclose(file);
    if (result != PT_OK) pti_free(*bytes, user);
    return result;
}

PTDEF void pt_image_free(pt_image *image)
{
    pti_free(image->rgb, image->alloc_user);
    image->rgb = NULL;
    image->width = image->height = 0;
}

/* Asks for the memory of a picture. */
static pt_result pti_image_make(pt_image *image, int width, int height)
{
    image->rgb = (float *)pti_alloc(3 * (size_t)width * (size_t)height, sizeof *image->rgb, image->alloc_user);
    if (!image->rgb) return PT_ERROR_MEMORY;
    image->width = width;
    image->height = height;
    return PT_OK;
}

/* Codes 0..most of the sRGB curve to linear light: from a table where that is short. */
typedef struct pti_levels {
    uint32_t most;
    float value[256];
} pti_levels;

static void pti_levels_make(pti_levels *l, uint32_t most)
{
    uint32_t i;
    l->most = most;
    for (i = 0; i < 256 && i <= most; i++) l->value[i] = (float)pt_srgb_decode(i / (double)most);
}

static float pti_level(const pti_levels *l, uint32_t code)
{
    return code < 256 ? l->value[code] : (float)pt_srgb_decode(code / (double)l->most);
}

/* What is left of a file. */
typedef struct pti_bytes {
    const unsigned char *at, *end;
} pti_bytes;

static int pti_next_byte(pti_bytes *b)
{
    return b->at < b->end ? *b->at++ : -1;
}

static int pti_is_blank(int c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
}

/* The next word of a PNM file: blanks and comments before it are skipped, one blank after it is taken. 0: none, or too
   long. */
static int pti_read_word(pti_bytes *b, char *word, size_t size)
{
    size_t n = 0;
    int c = pti_next_byte(b);
    for (; pti_is_blank(c) || c == '#'; c = pti_next_byte(b))
        if (c == '#')
            while (c != '\n' && c >= 0) c = pti_next_byte(b);
    for (; c >= 0 && !pti_is_blank(c); c = pti_next_byte(b)) {
        if (n + 1 >= size) return 0;
        word[n++] = (char)c;
    }
    word[n] = 0;
    return n > 0;
}

/* A whole number of at most 6 digits; -1: it is none. */
static int pti_read_count(pti_bytes *b)
{
    char word[8];
    int value = 0, i;
    if (!pti_read_word(b, word, sizeof word) || strlen(word) > 6) return -1;
    for (i = 0; word[i]; i++) {
        if (word[i] < '0' || word[i] > '9') return -1;
        value = 10 * value + (word[i] - '0');
    }
    return value;
}

/* P6 or P3 after these letters. A value has at least 1 byte, 2 as text or if it can be above 255. */
static pt_result pti_read_ppm(pti_bytes *b, pt_image *image, int is_text)
{
    int width = pti_read_count(b), height = pti_read_count(b), most = pti_read_count(b), bytes = is_text || most > 255 ? 2 : 1, code = 0;
    size_t count, k;
    pti_levels levels;
    pt_result result;
    if (!pti_pixels_fit(width, height) || most < 1 || most > 65535) return PT_ERROR_FILE;
    count = 3 * (size_t)width * (size_t)height;
    if (((size_t)(b->end - b->at) + (size_t)is_text) / (size_t)bytes < count) return PT_ERROR_FILE;
    result = pti_image_make(image, width, height);
    if (result != PT_OK) return result;
    pti_levels_make(&levels, (uint32_t)most);
    for (k = 0; k < count; k++) {
        if (is_text) code = pti_read_count(b);
        else code = bytes == 1 ? b->at[k] : b->at[2 * k] << 8 | b->at[2 * k + 1];
        if (code < 0 || code > most) return PT_ERROR_FILE;
        image->rgb[k] = pti_level(&levels, (uint32_t)code);
    }
    return PT_OK;
}

/* Is this the scale of a PFM: a number that is not 0? Its sign tells the byte order, its size nothing. */
static int pti_is_scale(const char *word)
{
    return strspn(word, "+-.0123456789eE") == strlen(word) && strcspn(word, "123456789") < strcspn(word, "eE");
}

/* PF after these letters. */
static pt_result pti_read_pfm(pti_bytes *b, pt_image *image)
{
    char word[32];
    int width = pti_read_count(b), height = pti_read_count(b), y, k;
    size_t row, i;
    pt_result result;
    if (!pti_pixels_fit(width, height) || !pti_read_word(b, word, sizeof word) || !pti_is_scale(word)) return PT_ERROR_FILE;
    row = 3 * (size_t)width;
    if ((size_t)(b->end - b->at) / 4 / row < (size_t)height) return PT_ERROR_FILE;
    result = pti_image_make(image, width, height);
    for (y = 0; result == PT_OK && y < height; y++) {
        float *to = image->rgb + row * (size_t)(height - 1 - y); /* PFM begins at the bottom */
        for (i = 0; i < row; i++, b->at += 4) {
            uint32_t bits = 0;
            for (k = 0; k < 4; k++) bits |= (uint32_t)b->at[word[0] == '-' ? k : 3 - k] << (8 * k);
            memcpy(&to[i], &bits, 4);
        }
    }
    return result;
}

/* --- PNG, reading: any deflate stream, by canonical Huffman codes --- */

/* A Huffman code as a table: the next `longest` bits are the index of symbol * 16 + length of its code; 0: no code. */
typedef struct pti_huffman {
    int longest;
    uint16_t entry[32768];
} pti_huffman;

/* What is read and what is made of it. */
typedef struct pti_inflater {
    const unsigned char *in, *end;
    uint64_t buffer;
    int count, missing;     /* bits in the buffer; bytes asked for beyond the end                          */
    unsigned char *out;
    size_t made, size;
    pti_huffman literal, distance;
} pti_inflater;

/* The next bits, at most 32, least significant first; beyond the end they are 0. */
static uint32_t pti_peek_bits(pti_inflater *s, int count)
{
    while (s->count < count) {
        if (s->in < s->end) s->buffer |= (uint64_t)*s->in++ << s->count;
        else s->missing++;
        s->count += 8;
    }
    return (uint32_t)(s->buffer & (((uint64_t)1 << count) - 1));
}

static uint32_t pti_take_bits(pti_inflater *s, int count)
{
    uint32_t bits = pti_peek_bits(s, count);
    s->buffer >>= count;
    s->count -= count;
    return bits;
}

/* The table of a code from the lengths of its words [RFC 1951 3.2.2]; 0: there cannot be so many short ones. */
static int pti_huffman_make(pti_huffman *h, const unsigned char *lengths, int symbols)
{
    uint32_t count[16] = {0}, next[16] = {0}, k;
    int i, l;
    for (i = 0; i < symbols; i++) count[lengths[i]]++;
    count[0] = 0;
    for (h->longest = 0, l = 1; l < 16; l++) {
        next[l] = (next[l - 1] + count[l - 1]) << 1;
        if (next[l] + count[l] > 1u << l) return 0;
        if (count[l] > 0) h->longest = l;
    }
    memset(h->entry, 0, sizeof h->entry[0] << h->longest);
    for (i = 0; i < symbols; i++) {
        l = lengths[i];
        if (l == 0) continue;
        for (k = pti_reverse_bits(next[l]++) >> (32 - l); k < 1u << h->longest; k += 1u << l) h->entry[k] = (uint16_t)(i << 4 | l);
    }
    return 1;
}

/* The next symbol, -1: none has such a code. */
static int pti_take_symbol(pti_inflater *s, const pti_huffman *h)
{
    int entry = h->entry[pti_peek_bits(s, h->longest)];
    pti_take_bits(s, entry & 15);
    return entry ? entry >> 4 : -1;
}

/* A repetition [RFC 1951 3.2.5]; see pti_put_match. */
static int pti_inflate_match(pti_inflater *s, int code)
{
    int extra = code < 8 || code == 28 ? 0 : code / 4 - 1, d;
    size_t length, distance, k;
    length = code == 28 ? 258 : code < 8 ? (size_t)code + 3 : 3 + ((size_t)(4 + code % 4) << extra);
    length += pti_take_bits(s, extra);
    d = pti_take_symbol(s, &s->distance);
    extra = d < 4 ? 0 : d / 2 - 1;
    if (code > 28 || d < 0 || d > 29) return 0;
    distance = d < 4 ? (size_t)d + 1 : 1 + ((size_t)(2 + d % 2) << extra);
    distance += pti_take_bits(s, extra);
    if (distance > s->made || length > s->size - s->made) return 0;
    for (k = 0; k < length; k++) s->out[s->made + k] = s->out[s->made + k - distance];
    s->made += length;
    return 1;
}

/* The symbols of a block. Where the input has ended it ends too, as nothing but zeros follows. */
static int pti_inflate_symbols(pti_inflater *s)
{
    int symbol;
    while ((symbol = pti_take_symbol(s, &s->literal)) != 256) {
        if (symbol < 0 || s->missing > 8) return 0;
        if (symbol > 256) {
            if (!pti_inflate_match(s, symbol - 257)) return 0;
        } else {
            if (s->made == s->size) return 0;
            s->out[s->made++] = (unsigned char)symbol;
        }
    }
    return 1;
}

static int pti_inflate_stored(pti_inflater *s)
{
    uint32_t length, complement;
    pti_take_bits(s, s->count % 8);
    length = pti_take_bits(s, 16);
    complement = pti_take_bits(s, 16);
    if (length != (complement ^ 0xffffu) || length > s->size - s->made) return 0;
    for (; length > 0 && s->missing == 0; length--) s->out[s->made++] = (unsigned char)pti_take_bits(s, 8);
    return s->missing == 0;
}

/* The codes that a block brings: the lengths of their words, themselves coded [RFC 1951 3.2.7]. */
static int pti_inflate_codes(pti_inflater *s)
{
    static const unsigned char order[19] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};
    unsigned char lengths[320] = {0};
    int literals = (int)pti_take_bits(s, 5) + 257, distances = (int)pti_take_bits(s, 5) + 1, codes = (int)pti_take_bits(s, 4) + 4, i;
    for (i = 0; i < codes; i++) lengths[order[i]] = (unsigned char)pti_take_bits(s, 3);
    if (!pti_huffman_make(&s->literal, lengths, 19)) return 0;
    memset(lengths, 0, sizeof lengths);
    for (i = 0; i < literals + distances;) {
        int symbol = pti_take_symbol(s, &s->literal), times = 1, value = symbol;
        if (symbol < 0 || (symbol == 16 && i == 0)) return 0;
        if (symbol == 16) times = 3 + (int)pti_take_bits(s, 2);
        if (symbol == 17) times = 3 + (int)pti_take_bits(s, 3);
        if (symbol == 18) times = 11 + (int)pti_take_bits(s, 7);
        if (symbol >= 16) value = symbol == 16 ? lengths[i - 1] : 0;
        if (times > literals + distances - i) return 0;
        for (; times > 0; times--) lengths[i++] = (unsigned char)value;
    }
    return pti_huffman_make(&s->literal, lengths, literals) && pti_huffman_make(&s->distance, lengths + literals, distances);
}

/* The fixed codes [RFC 1951 3.2.6]. */
static int pti_inflate_fixed(pti_inflater *s)
{
    unsigned char lengths[288];
    int i;
    for (i = 0; i < 288; i++) lengths[i] = i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : 8;
    if (!pti_huffman_make(&s->literal, lengths, 288)) return 0;
    memset(lengths, 5, 32);
    return pti_huffman_make(&s->distance, lengths, 32);
}

/* A zlib stream [RFC 1950] that must make exactly s->size bytes with the right checksum. */
static int pti_inflate(pti_inflater *s)
{
    uint32_t method = pti_take_bits(s, 8), flags = pti_take_bits(s, 8), last = 0, sum = 0;
    int k;
    if ((method & 15u) != 8 || method >> 4 > 7 || (method << 8 | flags) % 31 != 0 || (flags & 32u)) return 0;
    while (!last) {
        uint32_t kind;
        last = pti_take_bits(s, 1);
        kind = pti_take_bits(s, 2);
        if (kind == 3 || (kind == 0 && !pti_inflate_stored(s))) return 0;
        if (kind == 1 && !pti_inflate_fixed(s)) return 0;
        if (kind == 2 && !pti_inflate_codes(s)) return 0;
        if (kind > 0 && !pti_inflate_symbols(s)) return 0;
    }
    pti_take_bits(s, s->count % 8);
    for (k = 0; k < 4; k++) sum = sum << 8 | pti_take_bits(s, 8);
    return s->missing == 0 && s->made == s->size && sum == pti_adler32(s->out, s->size);
}

/* The head of a PNG, its palette, and its compressed data. */
typedef struct pti_png {
    uint32_t width, height;
    int depth, type, channels, is_interlaced;
    unsigned char palette[768];
    uint32_t colours;
    size_t size;
} pti_png;

static uint32_t pti_from_big_endian(const unsigned char *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

/* Colour types: 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGB and alpha, each with its depths. */
static int pti_png_head(pti_png *p, const unsigned char *d, uint32_t length)
{
    static const int channels[7] = {1, 0, 3, 1, 2, 0, 4};
    if (length != 13 || p->depth != 0 || d[9] > 6 || d[10] != 0 || d[11] != 0 || d[12] > 1) return 0;
    p->width = pti_from_big_endian(d);
    p->height = pti_from_big_endian(d + 4);
    p->depth = d[8];
    p->type = d[9];
    p->channels = channels[p->type];
    p->is_interlaced = d[12];
    if (p->width > 65536 || p->height > 65536 || !pti_pixels_fit((int)p->width, (int)p->height) || p->channels == 0) return 0;
    if (p->depth == 8) return 1;
    if (p->depth == 16) return p->type != 3;
    return (p->depth == 1 || p->depth == 2 || p->depth == 4) && (p->type == 0 || p->type == 3);
}

/* Reads the chunks; compressed data is moved together to the beginning of the file's bytes. */
static int pti_png_chunks(pti_png *p, unsigned char *file, size_t size)
{
    size_t at = 8;
    memset(p, 0, sizeof *p);
    for (;;) {
        unsigned char *chunk = file + at, *d = chunk + 8;
        uint32_t length = size - at < 12 ? UINT32_MAX : pti_from_big_endian(chunk);
        if (length > size - at || length + 12 > size - at) return 0;
        if (pti_crc32(0, chunk + 4, length + 4) != pti_from_big_endian(d + length)) return 0;
        if (memcmp(chunk + 4, "IHDR", 4) == 0) {
            if (!pti_png_head(p, d, length)) return 0;
        } else if (p->depth == 0) {
            return 0; /* it must be the first */
        } else if (memcmp(chunk + 4, "PLTE", 4) == 0) {
            if (length % 3 != 0 || length > 768 || length == 0) return 0;
            memcpy(p->palette, d, length);
            p->colours = length / 3;
        } else if (memcmp(chunk + 4, "IDAT", 4) == 0) {
            memmove(file + p->size, d, length);
            p->size += length;
        } else if (memcmp(chunk + 4, "IEND", 4) == 0) {
            return 1;
        } else if (!(chunk[4] & 32)) {
            return 0; /* needed for display, says its first letter */
        }
        at += 12 + (size_t)length;
    }
}

/* A picture of every dx-th column and dy-th row; an interlaced PNG has seven. */
typedef struct pti_png_pass {
    uint32_t x, y, dx, dy, width, height;
    size_t row;              /* bytes                                                                      */
} pti_png_pass;

static pti_png_pass pti_png_pass_make(const pti_png *p, int k)
{
    static const unsigned char x[7] = {0, 4, 0, 2, 0, 1, 0}, dx[7] = {8, 8, 4, 4, 2, 2, 1};
    static const unsigned char y[7] = {0, 0, 4, 0, 2, 0, 1}, dy[7] = {8, 8, 8, 4, 4, 2, 2};
    pti_png_pass s = {0, 0, 1, 1, 0, 0, 0};
    if (p->is_interlaced) {
        s.x = x[k];
        s.y = y[k];
        s.dx = dx[k];
        s.dy = dy[k];
    }
    s.width = (p->width - s.x + s.dx - 1) / s.dx; /* 0 where p->width <= x < dx: unsigned numbers wrap back */
    s.height = s.width == 0 ? 0 : (p->height - s.y + s.dy - 1) / s.dy;
    s.row = ((size_t)s.width * (size_t)(p->channels * p->depth) + 7) / 8;
    return s;
}

/* Undoes the filter of a row of `size` bytes, whose number stands before it; `up` is the row above, NULL: none. */
static int pti_png_unfilter(unsigned char *row, const unsigned char *up, size_t size, size_t pixel)
{
    size_t k;
    int filter = row[-1];
    if (filter > 4) return 0;
    for (k = 0; k < size; k++) {
        int a = k < pixel ? 0 : row[k - pixel], p = up ? up[k] : 0, c = up && k >= pixel ? up[k - pixel] : 0;
        const int guess[5] = {0, a, p, (a + p) / 2, filter == 4 ? pti_paeth(a, p, c) : 0};
        row[k] = (unsigned char)(row[k] + guess[filter]);
    }
    return 1;
}

/* Sample i of a row. */
static uint32_t pti_png_sample(const unsigned char *row, size_t i, int depth)
{
    size_t bit = i * (size_t)depth;
    if (depth == 16) return (uint32_t)row[2 * i] << 8 | row[2 * i + 1];
    return ((uint32_t)row[bit / 8] >> (8 - depth - (int)(bit % 8))) & ((1u << depth) - 1);
}

/* Linear light of pixel i of a row; 0: beyond the palette. */
static int pti_png_pixel(const pti_png *p, const pti_levels *levels, const unsigned char *row, size_t i, float *to)
{
    uint32_t v;
    int k;
    for (k = 0; k < 3; k++) {
        v = pti_png_sample(row, i * (size_t)p->channels + (size_t)(p->channels >= 3 ? k : 0), p->depth);
        if (p->type == 3 && v >= p->colours) return 0;
        to[k] = pti_level(levels, p->type == 3 ? p->palette[3 * v + (uint32_t)k] : v);
    }
    return 1;
}

static int pti_png_picture(const pti_png *p, unsigned char *raw, pt_image *image)
{
    size_t pixel = (size_t)(p->channels * p->depth + 7) / 8;
    pti_levels levels;
    uint32_t x, y;
    int k;
    pti_levels_make(&levels, p->type == 3 ? 255 : (1u << p->depth) - 1);
    for (k = 0; k < (p->is_interlaced ? 7 : 1); k++) {
        pti_png_pass s = pti_png_pass_make(p, k);
        for (y = 0; y < s.height; y++, raw += s.row + 1) {
            float *to = image->rgb + 3 * ((size_t)(s.y + y * s.dy) * p->width + s.x);
            if (!pti_png_unfilter(raw + 1, y > 0 ? raw - s.row : NULL, s.row, pixel)) return 0;
            for (x = 0; x < s.width; x++)
                if (!pti_png_pixel(p, &levels, raw + 1, x, to + 3 * (size_t)x * s.dx)) return 0;
        }
    }
    return 1;
}

/* Inflates and decodes; the picture's own memory is asked for last, when all checksums are right. No deflate stream is
   longer than 1032 times its bytes: 258 for 2 bits. */
static pt_result pti_read_png(unsigned char *file, size_t size, pt_image *image)
{
    pt_result result = PT_ERROR_FILE;
    pti_inflater *s;
    uint64_t raw = 0;
    pti_png p;
    int k;
    if (!pti_png_chunks(&p, file, size)) return PT_ERROR_FILE;
    for (k = 0; k < (p.is_interlaced ? 7 : 1); k++) {
        pti_png_pass pass = pti_png_pass_make(&p, k);
        raw += ((uint64_t)pass.row + 1) * pass.height;
    }
    if (raw / 1032 > p.size || raw > SIZE_MAX) return PT_ERROR_FILE;
    s = (pti_inflater *)pti_alloc_zero(1, sizeof *s, image->alloc_user);
    if (!s) return PT_ERROR_MEMORY;
    s->in = file;
    s->end = file + p.size;
    s->size = (size_t)raw;
    s->out = (unsigned char *)pti_alloc(s->size, 1, image->alloc_user);
    if (!s->out) result = PT_ERROR_MEMORY;
    else if (pti_inflate(s)) result = pti_image_make(image, (int)p.width, (int)p.height);
    if (result == PT_OK && !pti_png_picture(&p, s->out, image)) result = PT_ERROR_FILE;
    pti_free(s->out, image->alloc_user);
    pti_free(s, image->alloc_user);
    return result;
}

PTDEF pt_result pt_read_image(const char *path, pt_image *image)
{
    unsigned char *file;
    char word[8];
    size_t size;
    pti_bytes b;
    pt_result result;
    pt_image_free(image);
    result = pti_read_file(path, image->alloc_user, &file, &size);
    if (result != PT_OK) return result == PT_ERROR_MEMORY ? result : PT_ERROR_FILE;
    b.at = file;
    b.end = file + size;
    result = PT_ERROR_FILE;
    if (size >= 8 && memcmp(file, pti_png_signature, 8) == 0) result = pti_read_png(file, size, image);
    else if (!pti_read_word(&b, word, sizeof word)) result = PT_ERROR_FILE;
    else if (strcmp(word, "P6") == 0 || strcmp(word, "P3") == 0) result = pti_read_ppm(&b, image, word[1] == '3');
    else if (strcmp(word, "PF") == 0) result = pti_read_pfm(&b, image);
    pti_free(file, image->alloc_user);
    if (result != PT_OK) pt_image_free(image);
    return result;
}

#if PTI_HAS_OBJ
/* --- models: OBJ and MTL --- */

/* Where in a text the reading is. A 0 ends the text; \n, \r or both end a line, unless a \ stands before. */
typedef struct pti_text {
    const char *at;
    uint32_t line;
} pti_text;

static int pti_is_line_end(int c)
{
    return c == '\n' || c == '\r' || c == 0;
}

/* Goes over blanks; 0: the line ends here. */
static int pti_skip_blanks(pti_text *t)
{
    for (;; t->at++) {
        if (t->at[0] == '\\' && t->at[1] != 0 && pti_is_line_end(t->at[1])) {
            t->at += t->at[1] == '\r' && t->at[2] == '\n' ? 2 : 1;
            t->line++;
        } else if (*t->at != ' ' && *t->at != '\t') {
            return !pti_is_line_end(*t->at);
        }
    }
}

static int pti_word_ends(const char *p)
{
    return *p == ' ' || *p == '\t' || pti_is_line_end(*p) || (p[0] == '\\' && pti_is_line_end(p[1]));
}

/* The next word of the line, and its length; 0: there is none. */
static size_t pti_take_word(pti_text *t, const char **word)
{
    pti_skip_blanks(t);
    for (*word = t->at; !pti_word_ends(t->at);) t->at++;
    return (size_t)(t->at - *word);
}

static int pti_word_is(const char *word, size_t size, const char *text)
{
    return strlen(text) == size && memcmp(word, text, size) == 0;
}

/* The rest of the line without the blanks around it: names may have blanks. */
static size_t pti_take_rest(pti_text *t, const char **rest)
{
    size_t n;
    pti_skip_blanks(t);
    *rest = t->at;
    n = strcspn(t->at, "\r\n");
    t->at += n;
    while (n > 0 && pti_is_blank((*rest)[n - 1])) n--;
    return n;
}

static void pti_next_line(pti_text *t)
{
    while (pti_skip_blanks(t)) t->at++;
    if (*t->at) t->at += t->at[0] == '\r' && t->at[1] == '\n' ? 2 : 1;
    t->line++;
}

/* m 10^e. Both m < 2^53 and 10^22 are exact doubles, so that for |e| <= 22 the one operation rounds correctly. Beyond
   are at most 20 roundings: relative error below 2^-48 where the result is not subnormal. */
static double pti_scale_10(uint64_t m, int64_t e)
{
    static const double ten[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                   1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    double x = (double)m;
    e = e < -400 ? -400 : e > 400 ? 400 : e; /* m < 10^19: 0 or infinite long before */
    for (; e > 22; e -= 22) x *= 1e22;
    for (; e < -22; e += 22) x /= 1e22;
    return e < 0 ? x / ten[-e] : x * ten[e];
}

/* A decimal number, in every locale with a point; goes behind it. Digits after the 19th count as zeros. 0: there is
   none. */
static int pti_take_number(const char **at, double *value)
{
    const char *p = *at;
    int minus = *p == '-', digits = 0, fraction = 0, less;
    int64_t e = 0, more = 0;
    uint64_t m = 0;
    if (*p == '-' || *p == '+') p++;
    for (; (*p >= '0' && *p <= '9') || (*p == '.' && !fraction); p++) {
        if (*p == '.') {
            fraction = 1;
        } else if (m < 1000000000000000000u) {
            m = 10 * m + (uint64_t)(*p - '0');
            e -= fraction;
            digits = 1;
        } else {
            e += !fraction;
        }
    }
    if (!digits) return 0;
    if ((*p == 'e' || *p == 'E') && (p[1] == '-' || p[1] == '+' ? (p[2] >= '0' && p[2] <= '9') : (p[1] >= '0' && p[1] <= '9'))) {
        less = p[1] == '-';
        for (p += p[1] == '-' || p[1] == '+' ? 2 : 1; *p >= '0' && *p <= '9'; p++)
            if (more < 1000000000) more = 10 * more + (*p - '0');
        e += less ? -more : more;
    }
    *at = p;
    *value = minus ? -pti_scale_10(m, e) : pti_scale_10(m, e);
    return 1;
}

/* Up to `most` numbers of the line; how many, or -1: a word is no number. */
static int pti_take_numbers(pti_text *t, double *values, int most)
{
    int n = 0;
    while (n < most && pti_skip_blanks(t) && *t->at != '#')
        if (!pti_take_number(&t->at, &values[n++]) || !pti_word_ends(t->at)) return -1;
    return n;
}

/* A hash table of numbers of things that are kept elsewhere. */
typedef struct pti_slot {
    uint32_t hash, id;      /* id + 1; 0: free                                                             */
} pti_slot;
typedef struct pti_table {
    pti_slot *slots;
    size_t capacity;        /* a power of two, at least twice the count                                    */
    size_t count;
} pti_table;

/* Makes room for one more; 0: no memory. */
static int pti_table_reserve(pti_table *t, void *user)
{
    pti_table more;
    size_t i, at;
    if (2 * (t->count + 1) <= t->capacity) return 1;
    more.count = t->count;
    more.capacity = t->capacity > 0 ? 2 * t->capacity : 64;
    more.slots = (pti_slot *)pti_alloc_zero(more.capacity, sizeof *more.slots, user);
    if (!more.slots) return 0;
    for (i = 0; i < t->capacity; i++) {
        if (t->slots[i].id == 0) continue;
        for (at = t->slots[i].hash & (more.capacity - 1); more.slots[at].id != 0;) at = (at + 1) & (more.capacity - 1);
        more.slots[at] = t->slots[i];
    }
    pti_free(t->slots, user);
    *t = more;
    return 1;
}

/* The slot of the thing that `same` finds equal to the key, or the free one where it belongs. */
static pti_slot *pti_table_find(const pti_table *t, uint32_t hash, int (*same)(const void *key, uint32_t id), const void *key)
{
    size_t at = hash & (t->capacity - 1);
    while (t->slots[at].id != 0 && !(t->slots[at].hash == hash && same(key, t->slots[at].id - 1))) at = (at + 1) & (t->capacity - 1);
    return &t->slots[at];
}

#define PTI_NONE UINT32_MAX

/* A corner of a face: indices of v, vt, vn; PTI_NONE: without. */
typedef struct pti_corner {
    uint32_t v, vt, vn;
} pti_corner;

/* What a newmtl says; texts are places in the pool of the loader, 0: none. */
typedef struct pti_mtl {
    double kd[3], ks[3], ke[3], ns, ni, d, pr, pm, tr, illum, scale[2];
    unsigned given;          /* bits in the order of pti_mtl_keys                                          */
    uint32_t name, file, line, map;
    int id;                  /* in the scene, -1: not yet                                                  */
} pti_mtl;

enum { PTI_MTL_KD = 1, PTI_MTL_NI = 16, PTI_MTL_D = 32, PTI_MTL_PR = 64, PTI_MTL_PM = 128, PTI_MTL_ILLUM = 512 };

/* Its numbers, and the range that they are kept in: that of pt_material, of the format (Ni), or what fits a float. */
static const struct {
    char key[6];
    unsigned char count;
    unsigned short offset;
    double lo, hi;
} pti_mtl_keys[10] = {{"Kd", 3, offsetof(pti_mtl, kd), 0, 1},     {"Ks", 3, offsetof(pti_mtl, ks), 0, 1},
                      {"Ke", 3, offsetof(pti_mtl, ke), 0, 1e30},  {"Ns", 1, offsetof(pti_mtl, ns), 0, 1e6},
                      {"Ni", 1, offsetof(pti_mtl, ni), 0.001, 10}, {"d", 1, offsetof(pti_mtl, d), 0, 1},
                      {"Pr", 1, offsetof(pti_mtl, pr), 0, 1},     {"Pm", 1, offsetof(pti_mtl, pm), 0, 1},
                      {"Tr", 1, offsetof(pti_mtl, tr), 0, 1},     {"illum", 1, offsetof(pti_mtl, illum), 0, 10}};

/* A picture and its path in the pool. */
typedef struct pti_picture {
    uint32_t path;
    pt_image image;
} pti_picture;

enum { PTI_TOLD_SCALED = 1, PTI_TOLD_NO_VT = 2, PTI_TOLD_SKIPPED = 4 };

/* A loader. */
typedef struct pti_obj {
    pt_scene *scene;
    pt_obj_options options;
    pt_obj_info *info;
    pt_result result;
    const char *file;        /* what is being read, and where                                              */
    pti_text text;
    double cofactor[3][3];   /* for normals: the inverse transposed, times a positive factor               */
    int mirrors;
    pt_vec3 *v, *vn;
    pt_vec2 *vt;
    pti_corner *corners;     /* the vertices of the mesh: each combination once                            */
    pti_corner *face;        /* the corners of the current one                                             */
    pti_mtl *mtls;
    char *pool;
    uint32_t v_count, vn_count, vt_count, corner_count, face_count, mtl_count, pool_count;
    uint32_t v_capacity, vn_capacity, vt_capacity, corner_capacity, face_capacity, mtl_capacity, pool_capacity;
    pti_table corner_table, name_table;
    uint32_t library;        /* the MTL file that was read last                                            */
    int across, upward;      /* the axes on which the current face is looked at                            */
    int mesh[4];             /* of the scene, for triangles without and with vn (2) and vt (1); -1: none   */
    int mesh_count;
    int material;            /* of mtls, for the faces to come, -1: none                                   */
    int plain;               /* of the scene, for faces without, -1: not yet                               */
    unsigned told;           /* PTI_TOLD_X: what is said once                                              */
#if PTI_HAS_TEXTURES
    pti_picture *pictures;   /* that were read, owned by the scene                                         */
    uint32_t picture_count, picture_capacity;
#endif
} pti_obj;

/* "<file>:<line>: <what>'<name>'<end>"; a name is cut at 60 bytes, and what is no letter is shown as '?'. */
static void pti_obj_say(const pti_obj *o, char *text, const char *what, const char *name, size_t size, const char *end)
{
    const size_t room = sizeof o->info->error;
    const char *file = o->file, *p;
    char letters[64] = "'";
    size_t n = 1;
    for (p = file; *p; p++)
        if (*p == '/' || *p == '\\') file = p + 1;
    text[0] = 0;
    pti_append(text, 64, file);
    if (o->text.line > 0) {
        pti_append(text, room, ":");
        pti_append_integer(text, room, o->text.line);
    }
    pti_append(text, room, ": ");
    pti_append(text, room, what);
    for (; n <= size && n < 61; n++) letters[n] = (char)((unsigned char)name[n - 1] < 32 || name[n - 1] == 127 ? '?' : name[n - 1]);
    letters[n] = '\'';
    if (size > 0) pti_append(text, room, letters);
    pti_append(text, room, end);
}

static void pti_obj_warn_of(pti_obj *o, const char *what, const char *name, size_t size, const char *end)
{
    uint32_t n = o->info->warning_count++;
    if (n < PT_OBJ_WARNINGS) pti_obj_say(o, o->info->warnings[n], what, name, size, end);
}

static void pti_obj_warn(pti_obj *o, const char *what)
{
    pti_obj_warn_of(o, what, "", 0, "");
}

/* A warning that is given once however often it is due. */
static void pti_obj_tell_of(pti_obj *o, unsigned told, const char *name, size_t size, const char *end)
{
    if (!(o->told & told)) pti_obj_warn_of(o, "", name, size, end);
    o->told |= told;
}

/* Ends the loading; returns 0. */
static int pti_obj_fail_of(pti_obj *o, pt_result result, const char *what, const char *name, size_t size, const char *end)
{
    o->result = result;
    pti_obj_say(o, o->info->error, what, name, size, end);
    return 0;
}

static int pti_obj_fail(pti_obj *o, pt_result result, const char *what)
{
    return pti_obj_fail_of(o, result, what, "", 0, "");
}

static int pti_obj_no_memory(pti_obj *o)
{
    return pti_obj_fail(o, PT_ERROR_MEMORY, "out of memory");
}

/* Appends one element to an array of the loader, or fails. */
#define PTI_OBJ_PUSH(o, array, number, capacity, value) \
    (pti_reserve(&(o)->array, &(o)->capacity, (size_t)(o)->number + 1, sizeof *(o)->array, (o)->scene->alloc_user) \
         ? ((o)->array[(o)->number++] = (value), 1) \
         : pti_obj_no_memory(o))

/* Keeps a text; where it stands in the pool, 0: no memory. */
static uint32_t pti_obj_keep(pti_obj *o, const char *text, size_t size)
{
    uint32_t at = o->pool_count > 0 ? o->pool_count : 1;
    if (!pti_reserve(&o->pool, &o->pool_capacity, (size_t)at + size + 1, 1, o->scene->alloc_user)) {
        pti_obj_no_memory(o);
        return 0;
    }
    memcpy(o->pool + at, text, size);
    o->pool[at + size] = 0;
    o->pool_count = (uint32_t)(at + size + 1);
    return at;
}

/* Keeps the path of a file that the current one names: beside it unless the name is absolute. */
static uint32_t pti_obj_path(pti_obj *o, const char *name, size_t size)
{
    size_t n = strlen(o->file);
    uint32_t at, i;
    while (n > 0 && o->file[n - 1] != '/' && o->file[n - 1] != '\\') n--;
    if (size > 2 && name[0] == '.' && (name[1] == '/' || name[1] == '\\')) {
        name += 2;
        size -= 2;
    }
    if (name[0] == '/' || name[0] == '\\' || (size > 1 && name[1] == ':')) n = 0;
    at = pti_obj_keep(o, o->file, n);
    if (at > 0) o->pool_count--; /* goes on behind */
    if (at == 0 || !pti_obj_keep(o, name, size)) return 0;
    for (i = at + (uint32_t)n; o->pool[i]; i++)
        if (o->pool[i] == '\\') o->pool[i] = '/';
    return at;
}

/* Opens a text in place of the current one. */
static pt_result pti_obj_open(pti_obj *o, const char *path, unsigned char **bytes)
{
    size_t size;
    pt_result result = pti_read_file(path, o->scene->alloc_user, bytes, &size);
    if (result == PT_OK && memchr(*bytes, 0, size)) {
        pti_free(*bytes, o->scene->alloc_user);
        result = PT_ERROR_SCENE; /* no text */
    }
    if (result != PT_OK) return result;
    o->file = path;
    o->text.at = (const char *)*bytes;
    if (strncmp(o->text.at, "\xef\xbb\xbf", 3) == 0) o->text.at += 3; /* a byte order mark */
    o->text.line = 1;
    return PT_OK;
}

/* --- MTL --- */

typedef struct pti_name_key {
    const pti_obj *o;
    const char *name;
    size_t size;
} pti_name_key;

static int pti_same_name(const void *key, uint32_t id)
{
    const pti_name_key *k = (const pti_name_key *)key;
    return pti_word_is(k->name, k->size, k->o->pool + k->o->mtls[id].name);
}

/* The slot of a material's name; NULL: no memory. */
static pti_slot *pti_obj_name(pti_obj *o, const char *name, size_t size, uint32_t *hash)
{
    const pti_name_key key = {o, name, size};
    uint64_t h = size;
    size_t i;
    for (i = 0; i < size; i++) h = pt_hash64(h ^ (uint64_t)(unsigned char)name[i]);
    *hash = (uint32_t)h;
    if (!pti_table_reserve(&o->name_table, o->scene->alloc_user)) return NULL;
    return pti_table_find(&o->name_table, *hash, pti_same_name, &key);
}

/* newmtl: a material of that name; if there is one already, that stays. */
static int pti_mtl_begin(pti_obj *o)
{
    const char *name;
    size_t size = pti_take_rest(&o->text, &name);
    uint32_t hash;
    pti_slot *slot;
    pti_mtl m;
    memset(&m, 0, sizeof m);
    m.id = -1;
    m.d = m.scale[0] = m.scale[1] = 1;
    m.line = o->text.line;
    m.name = pti_obj_keep(o, name, size);
    if (m.name > 0) m.file = pti_obj_keep(o, o->file, strlen(o->file));
    if (m.file == 0 || !PTI_OBJ_PUSH(o, mtls, mtl_count, mtl_capacity, m)) return 0;
    slot = pti_obj_name(o, name, size, &hash);
    if (!slot) return pti_obj_no_memory(o);
    if (slot->id != 0) return 1;
    slot->hash = hash;
    slot->id = o->mtl_count;
    o->name_table.count++;
    return 1;
}

/* A line of numbers. Outside their range they are moved into it; only Ni is then as if it were not there. */
static void pti_mtl_number(pti_obj *o, pti_mtl *m, int key)
{
    const char *name = pti_mtl_keys[key].key;
    double v[3], *to = (double *)(void *)((char *)m + pti_mtl_keys[key].offset);
    double lo = pti_mtl_keys[key].lo, hi = pti_mtl_keys[key].hi;
    int count = pti_mtl_keys[key].count, n = pti_take_numbers(&o->text, v, count), k, outside = 0;
    if (n != 1 && n != count) {
        pti_obj_warn_of(o, "", name, strlen(name), " without its numbers is ignored");
        return;
    }
    for (k = 0; k < count; k++) {
        to[k] = v[n == 1 ? 0 : k];
        outside |= !(to[k] >= lo && to[k] <= hi);
        to[k] = to[k] > lo ? (to[k] < hi ? to[k] : hi) : lo;
    }
    if (outside) pti_obj_warn_of(o, "", name, strlen(name), " is out of range");
    if (!(outside && 1 << key == PTI_MTL_NI)) m->given |= 1u << key;
}

/* map_Kd: options, then a name. -s u v is how often the picture is repeated; the others are skipped. */
static int pti_mtl_map(pti_obj *o, pti_mtl *m)
{
    static const char *const options[12] = {"-s",      "-o",      "-t",  "-mm",     "-bm",      "-clamp",
                                            "-blendu", "-blendv", "-cc", "-texres", "-imfchan", "-boost"};
    const char *word;
    size_t size;
    for (;;) {
        pti_text before = o->text;
        double v[3] = {1, 1, 1}, unused;
        int k, n = 0;
        size = pti_take_word(&o->text, &word);
        for (k = 0; k < 12 && !pti_word_is(word, size, options[k]);) k++;
        if (k == 12) {
            o->text = before;
            break;
        }
        for (; n < 3 && pti_skip_blanks(&o->text); n++) { /* its numbers, or one word */
            before = o->text;
            if (pti_take_number(&before.at, k == 0 ? &v[n] : &unused) && pti_word_ends(before.at)) o->text = before;
            else break;
        }
        if (n == 0) pti_take_word(&o->text, &before.at);
        if (k > 0) pti_obj_warn_of(o, "option ", word, size, " of map_Kd is skipped");
        for (n = 0; k == 0 && n < 2; n++) m->scale[n] = fabs(v[n]) <= 1e6 ? v[n] : 1;
    }
    size = pti_take_rest(&o->text, &word);
    m->map = size > 0 ? pti_obj_path(o, word, size) : 0;
    return o->result == PT_OK;
}

static int pti_mtl_line(pti_obj *o)
{
    const char *word;
    size_t size = pti_take_word(&o->text, &word);
    pti_mtl *m = o->mtl_count > 0 ? &o->mtls[o->mtl_count - 1] : NULL;
    int k;
    if (size == 0 || *word == '#') {
        o->text.at += strcspn(o->text.at, "\r\n"); /* a comment does not go on */
        return 1;
    }
    if (pti_word_is(word, size, "newmtl")) return pti_mtl_begin(o);
    if (m && pti_word_is(word, size, "map_Kd")) return pti_mtl_map(o, m);
    for (k = 0; m && k < 10; k++)
        if (pti_word_is(word, size, pti_mtl_keys[k].key)) {
            pti_mtl_number(o, m, k);
            return 1;
        }
    if (!pti_word_is(word, size, "Ka") && !pti_word_is(word, size, "Tf")) o->info->skipped_lines++;
    return 1;
}

/* Reads an MTL file; 0: it cannot be read, or memory ended. */
static int pti_mtl_read(pti_obj *o, const char *name, size_t size)
{
    const char *file = o->file;
    pti_text text = o->text;
    unsigned char *bytes;
    char *path;
    pt_result result;
    uint32_t at = pti_obj_path(o, name, size);
    if (at == 0) return 0;
    if (o->library > 0 && strcmp(o->pool + at, o->pool + o->library) == 0) return 1;
    path = (char *)pti_alloc(strlen(o->pool + at) + 1, 1, o->scene->alloc_user); /* the pool moves as it grows */
    if (!path) return pti_obj_no_memory(o);
    memcpy(path, o->pool + at, strlen(o->pool + at) + 1);
    result = pti_obj_open(o, path, &bytes);
    if (result == PT_OK) {
        uint32_t first = o->mtl_count;
        o->library = at;
        for (; *o->text.at && o->result == PT_OK; pti_next_line(&o->text))
            if (!pti_mtl_line(o)) break;
        if (first == o->mtl_count) pti_obj_warn(o, "no newmtl in it");
        pti_free(bytes, o->scene->alloc_user);
    }
    pti_free(path, o->scene->alloc_user);
    o->file = file;
    o->text = text;
    if (result == PT_ERROR_MEMORY) pti_obj_no_memory(o);
    return result == PT_OK && o->result == PT_OK;
}

/* mtllib: one name that may have blanks, or several that have none. */
static int pti_obj_libraries(pti_obj *o)
{
    pti_text line = o->text;
    const char *name;
    size_t size = pti_take_rest(&o->text, &name);
    if ((o->options.flags & PT_OBJ_NO_MTL) || (size > 0 && pti_mtl_read(o, name, size))) return 1;
    o->text = line;
    while (o->result == PT_OK && (size = pti_take_word(&o->text, &name)) > 0)
        if (!pti_mtl_read(o, name, size) && o->result == PT_OK) pti_obj_warn_of(o, "cannot read ", name, size, "");
    return o->result == PT_OK;
}

/* --- materials --- */

static pt_rgb pti_mtl_rgb(const double *v, double factor)
{
    return pt_rgb3((pt_real)(v[0] * factor), (pt_real)(v[1] * factor), (pt_real)(v[2] * factor));
}

static double pti_mtl_max(const double *v)
{
    return fmax(v[0], fmax(v[1], v[2]));
}

/* A metal of given reflectance r head on. Of all n - i k with that r the one of smallest n, for which n^2 + k^2 = 1, has
   a reflectance that only rises towards grazing angles [Gul14]. r is kept 2^-20 below 1, as n must not be 0. */
static pt_material pti_mtl_metal(const double *reflectance, double roughness)
{
    pt_material m = pti_material_of_kind(PT_MATERIAL_CONDUCTOR, pt_rgb_grey(1));
    double n[3], k[3];
    int i;
    for (i = 0; i < 3; i++) {
        double r = fmin(reflectance[i], 1 - 9.5367431640625e-7);
        n[i] = (1 - r) / (1 + r);
        k[i] = 2 * sqrt(r) / (1 + r);
    }
    m.eta = pti_mtl_rgb(n, 1);
    m.k = pti_mtl_rgb(k, 1);
    m.roughness = (pt_real)roughness;
    return m;
}

/* Diffuse and glossy; together they reflect at most 1. */
static pt_material pti_mtl_glossy(pti_obj *o, const pti_mtl *s, pt_material_kind kind, const double *kd, const double *ks, double exponent)
{
    pt_material m = pti_material_of_kind(kind, pt_rgb_grey(0));
    double most = 1;
    int k;
    for (k = 0; k < 3; k++) most = fmax(most, kd[k] + ks[k]);
    if (most > 1)
        pti_obj_tell_of(o, PTI_TOLD_SCALED, o->pool + s->name, strlen(o->pool + s->name),
                        ": diffuse and specular exceed 1 and are scaled down, here and elsewhere");
    m.albedo = pti_mtl_rgb(kd, 1 / most);
    m.specular = pti_mtl_rgb(ks, 1 / most);
    m.exponent = (pt_real)exponent;
    return m;
}

/* Kd as it is used: white beside a picture that it would blacken. */
static void pti_mtl_diffuse(const pti_mtl *s, double *kd)
{
    int k, white = s->map > 0 && (!(s->given & PTI_MTL_KD) || pti_mtl_max(s->kd) == 0);
    for (k = 0; k < 3; k++) kd[k] = white ? 1 : s->given & PTI_MTL_KD ? s->kd[k] : 0.8;
}

/* The table above pt_load_obj. GGX of roughness Pr has alpha = Pr^2, about as wide as a Blinn-Phong lobe of exponent
   2 / alpha^2 - 2 [Wal07]; that would be above 1e6 for Pr < 0.04. */
static pt_material pti_mtl_surface(pti_obj *o, const pti_mtl *s)
{
    double kd[3], ks[3], d = s->given & PTI_MTL_D ? s->d : 1 - s->tr, pr = s->given & PTI_MTL_PR ? s->pr : 0;
    double ior = s->given & PTI_MTL_NI ? s->ni : 1.5, f0 = (ior - 1) / (ior + 1);
    int illum = s->given & PTI_MTL_ILLUM ? (int)s->illum : 2;
    pt_material m;
    pti_mtl_diffuse(s, kd);
    if (s->given & PTI_MTL_PM && s->pm >= 0.5) {
        m = pti_mtl_metal(kd, pr);
    } else if (illum == 4 || illum == 6 || illum == 7 || illum == 9 || d < 0.5) {
        m = pt_material_dielectric((pt_real)ior);
        m.roughness = (pt_real)pr;
    } else if ((illum == 3 || illum == 5) && pti_mtl_max(s->ks) > 0 && pti_mtl_max(s->ks) >= pti_mtl_max(kd)) {
        m = pr > 0 ? pti_mtl_metal(s->ks, pr) : pt_material_mirror(pti_mtl_rgb(s->ks, 1));
    } else if (s->given & PTI_MTL_PR && pr < 0.04) {
        m = pti_material_of_kind(PT_MATERIAL_COAT, pti_mtl_rgb(kd, 1));
        m.ior = (pt_real)fmax(ior, 1.001);
    } else if (s->given & PTI_MTL_PR) {
        ks[0] = ks[1] = ks[2] = f0 * f0;
        m = pti_mtl_glossy(o, s, PT_MATERIAL_BLINN, kd, ks, 2 / (pr * pr * pr * pr) - 2);
    } else if (pti_mtl_max(s->ks) > 0 && s->ns > 0 && illum > 1) {
        m = pti_mtl_glossy(o, s, PT_MATERIAL_PHONG, kd, s->ks, s->ns);
    } else {
        m = pt_material_diffuse(pti_mtl_rgb(kd, 1));
    }
    return m;
}

#if PTI_HAS_TEXTURES
/* Gives a block to the scene; 0: no memory, the block is freed. */
static int pti_scene_own(pt_scene *scene, void *block)
{
    void *user = scene->alloc_user;
    int ok = block && pti_reserve(&scene->owned, &scene->owned_capacity, (size_t)scene->owned_count + 1, sizeof *scene->owned, user);
    if (ok) scene->owned[scene->owned_count++] = block;
    else pti_free(block, user);
    return ok;
}

/* The picture of a path, read once; NULL: it cannot be read (a warning), or no memory. */
static const pt_image *pti_obj_picture(pti_obj *o, uint32_t path)
{
    const char *name = o->pool + path;
    pti_picture p;
    size_t i;
    pt_result result;
    for (i = 0; i < o->picture_count; i++)
        if (strcmp(o->pool + o->pictures[i].path, name) == 0) return &o->pictures[i].image;
    memset(&p, 0, sizeof p);
    p.path = path;
    p.image.alloc_user = o->scene->alloc_user;
    result = pt_read_image(name, &p.image);
    if (result == PT_ERROR_FILE) {
        const char *last = strrchr(name, '/') ? strrchr(name, '/') + 1 : name;
        pti_obj_warn_of(o, "no PPM, PFM or PNG: ", last, strlen(last), "; Kd alone is used");
    }
    if (result == PT_ERROR_MEMORY) pti_obj_no_memory(o);
    if (result != PT_OK) return NULL;
    for (i = 0; i < 3 * (size_t)p.image.width * (size_t)p.image.height; i++) { /* a reflectance; a PFM may hold anything */
        float v = p.image.rgb[i];
        p.image.rgb[i] = v > 0 ? (v < 1 ? v : 1) : 0;
    }
    if (!pti_scene_own(o->scene, p.image.rgb)) {
        pti_obj_no_memory(o);
        return NULL;
    }
    if (!PTI_OBJ_PUSH(o, pictures, picture_count, picture_capacity, p)) return NULL;
    o->info->textures++;
    return &o->pictures[o->picture_count - 1].image;
}
#endif

/* Lets the picture of map_Kd multiply the albedo; what does not come from Kd goes without. */
static int pti_obj_texture(pti_obj *o, const pti_mtl *s, pt_material *m)
{
    int wanted = s->map > 0 && !(o->options.flags & PT_OBJ_NO_TEXTURES) && m->kind != PT_MATERIAL_DIELECTRIC && m->kind != PT_MATERIAL_MIRROR;
#if PTI_HAS_TEXTURES
    const pt_image *image;
    pt_texture *t;
    if (!wanted) return 1;
    image = pti_obj_picture(o, s->map);
    if (!image) return o->result == PT_OK;
    t = (pt_texture *)pti_alloc_zero(1, sizeof *t, o->scene->alloc_user);
    if (!pti_scene_own(o->scene, t)) return pti_obj_no_memory(o);
    t->rgb = image->rgb;
    t->width = image->width;
    t->height = image->height;
    t->scale = pt_v2((pt_real)s->scale[0], (pt_real)s->scale[1]);
    m->texture = t;
#else
    if (wanted)
        pti_scene_fail(o->scene, PT_ERROR_LEFT_OUT, "material", o->scene->material_count, "textures were left out: PT_NO_TEXTURES");
#endif
    return 1;
}

/* Adds a material to the scene; its id, -1: the loading has ended. */
static int pti_obj_add_material(pti_obj *o, pt_material m)
{
    int id = o->scene->error == PT_OK ? pt_add_material(o->scene, m) : -1;
    if (id >= 0) o->info->materials++;
    else pti_obj_fail(o, o->scene->error, pt_scene_error(o->scene));
    return id;
}

/* The scene's material of a newmtl, added when a face first needs it. Sentences name its line. */
static int pti_obj_mtl_id(pti_obj *o, pti_mtl *s)
{
    const char *file = o->file;
    pti_text text = o->text;
    pt_material m;
    double scale = o->options.emission_scale > 0 ? o->options.emission_scale : 1, ke[3];
    int k;
    if (s->id >= 0) return s->id;
    o->file = o->pool + s->file;
    o->text.line = s->line;
    for (k = 0; k < 3; k++) ke[k] = fmin(s->ke[k] * scale, pti_mtl_keys[2].hi);
    m = pti_mtl_surface(o, s);
    m.emission = pti_mtl_rgb(ke, 1);
    if (pti_obj_texture(o, s, &m)) s->id = pti_obj_add_material(o, m);
    o->file = file;
    o->text = text;
    return s->id;
}

static int pti_obj_material(pti_obj *o)
{
    if (o->material >= 0) return pti_obj_mtl_id(o, &o->mtls[o->material]);
    if (o->plain < 0) o->plain = pti_obj_add_material(o, pt_material_diffuse(pt_rgb_grey(PTI_R(0.8))));
    return o->plain;
}

static int pti_obj_use(pti_obj *o)
{
    const char *name;
    size_t size = pti_take_rest(&o->text, &name);
    uint32_t hash;
    const pti_slot *slot;
    if (o->options.flags & PT_OBJ_NO_MTL) return 1;
    slot = pti_obj_name(o, name, size, &hash);
    if (!slot) return pti_obj_no_memory(o);
    o->material = (int)slot->id - 1;
    if (slot->id == 0) pti_obj_warn_of(o, "no newmtl ", name, size, "");
    return 1;
}

/* --- vertices and faces --- */

static int pti_obj_position(pti_obj *o)
{
    double p[3], q[3], bad;
    const double (*a)[4] = (const double (*)[4])o->options.transform;
    pt_vec3 v;
    int k;
    if (pti_take_numbers(&o->text, p, 3) != 3) return pti_obj_fail(o, PT_ERROR_FILE, "'v' without three numbers");
    for (k = 0; k < 3; k++) {
        q[k] = a[k][0] * p[0] + a[k][1] * p[1] + a[k][2] * p[2] + a[k][3];
        if (!(fabs(q[k]) <= PT_MAX_COORDINATE)) return pti_obj_fail(o, PT_ERROR_FILE, "a coordinate beyond 1e18");
    }
    v = pt_v3((pt_real)q[0], (pt_real)q[1], (pt_real)q[2]);
    if (pti_coordinate_bad(v, &bad)) return pti_obj_fail(o, PT_ERROR_FILE, "a coordinate beyond 1e18");
    return PTI_OBJ_PUSH(o, v, v_count, v_capacity, v);
}

/* A normal that is none is kept as 0. */
static int pti_obj_normal(pti_obj *o)
{
    const double (*c)[3] = (const double (*)[3])o->cofactor;
    double v[3];
    pti_d3 n = pti_d(0, 0, 0);
    if (pti_take_numbers(&o->text, v, 3) == 3)
        n = pti_d_normalize(pti_d(c[0][0] * v[0] + c[0][1] * v[1] + c[0][2] * v[2], c[1][0] * v[0] + c[1][1] * v[1] + c[1][2] * v[2],
                                  c[2][0] * v[0] + c[2][1] * v[1] + c[2][2] * v[2]));
    if (!(pti_d_dot(n, n) > 0.5)) {
        pti_obj_warn(o, "a normal that is 0 or no number: faces with it are flat");
        n = pti_d(0, 0, 0);
    }
    return PTI_OBJ_PUSH(o, vn, vn_count, vn_capacity, pti_d_to(n));
}

static int pti_obj_uv(pti_obj *o)
{
    double v[2] = {0, 0};
    if (pti_take_numbers(&o->text, v, 2) < 1 || !(fabs(v[0]) <= PT_MAX_COORDINATE && fabs(v[1]) <= PT_MAX_COORDINATE)) {
        pti_obj_warn(o, "'vt' that is no number or beyond 1e18 is taken as 0");
        v[0] = v[1] = 0;
    }
    return PTI_OBJ_PUSH(o, vt, vt_count, vt_capacity, pt_v2((pt_real)v[0], (pt_real)v[1]));
}

/* An index: from 1, or negative from the latest; 0: the loading has ended. */
static int pti_obj_index(pti_obj *o, uint32_t count, uint32_t *index)
{
    const char *p = o->text.at, *word = p;
    int minus = *p == '-';
    uint64_t i = 0;
    for (p += minus; *p >= '0' && *p <= '9'; p++)
        if (i < 10000000000u) i = 10 * i + (uint64_t)(*p - '0');
    if (i == 0 || i > count) return pti_obj_fail_of(o, PT_ERROR_FILE, "index ", word, strcspn(word, " \t\r\n"), " points nowhere");
    o->text.at = p;
    *index = (uint32_t)(minus ? count - i : i - 1);
    return 1;
}

/* v, v/vt, v//vn or v/vt/vn */
static int pti_obj_corner(pti_obj *o)
{
    const char *word = o->text.at;
    pti_corner c = {PTI_NONE, PTI_NONE, PTI_NONE};
    if (!pti_obj_index(o, o->v_count, &c.v)) return 0;
    if (*o->text.at == '/') {
        o->text.at++;
        if (*o->text.at != '/' && !pti_word_ends(o->text.at) && !pti_obj_index(o, o->vt_count, &c.vt)) return 0;
    }
    if (*o->text.at == '/') {
        o->text.at++;
        if (!pti_word_ends(o->text.at) && !pti_obj_index(o, o->vn_count, &c.vn)) return 0;
    }
    if (!pti_word_ends(o->text.at)) return pti_obj_fail_of(o, PT_ERROR_FILE, "no corner of a face: ", word, strcspn(word, " \t\r\n"), "");
    return PTI_OBJ_PUSH(o, face, face_count, face_capacity, c);
}

typedef struct pti_corner_key {
    const pti_corner *corners;
    pti_corner corner;
} pti_corner_key;

static int pti_same_corner(const void *key, uint32_t id)
{
    const pti_corner_key *k = (const pti_corner_key *)key;
    return memcmp(&k->corners[id], &k->corner, sizeof k->corner) == 0;
}

/* The vertex of a corner; PTI_NONE: no memory. */
static uint32_t pti_obj_vertex(pti_obj *o, const pti_corner *c)
{
    const pti_corner_key key = {o->corners, *c};
    uint32_t hash = (uint32_t)pt_hash64(pt_hash64((uint64_t)c->v << 32 | c->vt) ^ c->vn);
    pti_slot *slot;
    if (!pti_table_reserve(&o->corner_table, o->scene->alloc_user)) {
        pti_obj_no_memory(o);
        return PTI_NONE;
    }
    slot = pti_table_find(&o->corner_table, hash, pti_same_corner, &key);
    if (slot->id == 0) {
        if (!PTI_OBJ_PUSH(o, corners, corner_count, corner_capacity, *c)) return PTI_NONE;
        slot->hash = hash;
        slot->id = o->corner_count;
        o->corner_table.count++;
    }
    return slot->id - 1;
}

/* Widens the box. */
static void pti_obj_widen(pt_obj_info *info, pt_vec3 p)
{
    const pt_vec3 lo = info->lo, hi = info->hi;
    info->lo = pt_v3(p.x < lo.x ? p.x : lo.x, p.y < lo.y ? p.y : lo.y, p.z < lo.z ? p.z : lo.z);
    info->hi = pt_v3(p.x > hi.x ? p.x : hi.x, p.y > hi.y ? p.y : hi.y, p.z > hi.z ? p.z : hi.z);
}

/* Adds the triangle of three corners of the face, if it has an area. Its vertices are counted from those that the scene
   gets in the end. */
static int pti_obj_triangle(pti_obj *o, uint32_t i, uint32_t j, uint32_t k, int material)
{
    const uint32_t corner[3] = {i, o->mirrors ? k : j, o->mirrors ? j : k};
    const pti_corner *f = o->face;
    pt_scene *scene = o->scene;
    pt_triangle t;
    int n, *mesh = &o->mesh[(f->vn != PTI_NONE ? 2 : 0) + (f->vt != PTI_NONE ? 1 : 0)];
    if (!pti_triangle_has_area(o->v[f[i].v], o->v[f[j].v], o->v[f[k].v])) return 1;
    if (*mesh < 0) *mesh = (int)scene->mesh_count + o->mesh_count++;
    t.material = material;
    t.mesh = *mesh;
    if (o->info->triangles == 0) o->info->lo = o->info->hi = o->v[f[i].v];
    for (n = 0; n < 3; n++) {
        t.v[n] = pti_obj_vertex(o, &f[corner[n]]);
        if (t.v[n] == PTI_NONE) return 0;
        t.v[n] += scene->position_count;
        pti_obj_widen(o->info, o->v[f[corner[n]].v]);
    }
    if (!pti_reserve(&scene->triangles, &scene->triangle_capacity, (size_t)scene->triangle_count + 1, sizeof t, scene->alloc_user))
        return pti_obj_no_memory(o);
    scene->triangles[scene->triangle_count++] = t;
    o->info->triangles++;
    if (!pti_rgb_black(scene->materials[material].emission)) o->info->emissive_triangles++;
    return 1;
}

static double pti_obj_along(const pti_obj *o, uint32_t corner, int axis)
{
    const pt_vec3 *p = &o->v[o->face[corner].v];
    return (double)(axis == 0 ? p->x : axis == 1 ? p->y : p->z);
}

/* Twice the area of three corners as the face is looked at: positive if they turn to the left. */
static double pti_obj_turn(const pti_obj *o, uint32_t a, uint32_t b, uint32_t c)
{
    double x = pti_obj_along(o, a, o->across), y = pti_obj_along(o, a, o->upward);
    return (pti_obj_along(o, b, o->across) - x) * (pti_obj_along(o, c, o->upward) - y) -
           (pti_obj_along(o, b, o->upward) - y) * (pti_obj_along(o, c, o->across) - x);
}

/* Looks at the face along the axis that is nearest to its normal (the sum of the areas of a fan), from outside. */
static void pti_obj_look(pti_obj *o)
{
    double area[3] = {0, 0, 0};
    uint32_t i;
    int k, best = 0;
    for (k = 0; k < 3; k++) {
        o->across = (k + 1) % 3;
        o->upward = (k + 2) % 3;
        for (i = 1; i + 1 < o->face_count; i++) area[k] += pti_obj_turn(o, 0, i, i + 1);
        if (fabs(area[k]) > fabs(area[best])) best = k;
    }
    o->across = (best + (area[best] < 0 ? 2 : 1)) % 3;
    o->upward = (best + (area[best] < 0 ? 1 : 2)) % 3;
}

static int pti_same_point(pt_vec3 a, pt_vec3 b)
{
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

/* Does nothing of the polygon lie in the triangle at its i-th corner, which turns to the left? Corners that lie on those
   of the triangle do not count: a hole is often tied to its rim by a double edge. */
static int pti_obj_is_ear(const pti_obj *o, const uint32_t *ring, uint32_t n, uint32_t i, uint32_t *work)
{
    uint32_t a = ring[(i + n - 1) % n], b = ring[i], c = ring[(i + 1) % n], k;
    if (!(pti_obj_turn(o, a, b, c) > 0)) return 0;
    for (k = 0; k < n; k++) {
        const pti_corner *f = o->face;
        const pt_vec3 *v = o->v, d = v[f[ring[k]].v];
        *work += 1;
        if (pti_obj_turn(o, a, b, ring[k]) < 0 || pti_obj_turn(o, b, c, ring[k]) < 0 || pti_obj_turn(o, c, a, ring[k]) < 0) continue;
        if (!pti_same_point(d, v[f[a].v]) && !pti_same_point(d, v[f[b].v]) && !pti_same_point(d, v[f[c].v])) return 0;
    }
    return 1;
}

/* A polygon of more corners is cut as a fan if it is not convex; so is what is left after that much work. */
enum { PTI_EARS_MAX = 1024, PTI_EARS_WORK = 1 << 24 };

/* Cuts off one ear after the other: a simple polygon has two. A corner on a straight line is none yet, so that no edge
   is left with a corner of a neighbour in its middle. */
static int pti_obj_cut(pti_obj *o, int material)
{
    uint32_t ring[PTI_EARS_MAX], n = o->face_count, i, failed = 0, work = 0, ears;
    int ok = 1;
    for (i = 0; i < n; i++) ring[i] = i;
    for (i = 1; ok && n > 3 && failed < n && work < PTI_EARS_WORK;) {
        if (pti_obj_is_ear(o, ring, n, i, &work)) {
            ok = pti_obj_triangle(o, ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n], material);
            memmove(ring + i, ring + i + 1, (n - i - 1) * sizeof *ring);
            i = i < --n ? i : 0;
            failed = 0;
        } else {
            i = (i + 1) % n;
            failed++;
        }
    }
    ears = o->info->triangles;
    for (i = 1; ok && i + 1 < n; i++) ok = pti_obj_triangle(o, ring[0], ring[i], ring[i + 1], material);
    if (n > 3 && o->info->triangles > ears) pti_obj_warn(o, "a polygon that crosses itself: some of it is cut as a fan");
    return ok;
}

static int pti_obj_polygon(pti_obj *o, int material)
{
    uint32_t n = o->face_count, i;
    int convex = 1;
    if (n > 3) pti_obj_look(o);
    for (i = 0; convex && n > 3 && i < n; i++) convex = pti_obj_turn(o, i, (i + 1) % n, (i + 2) % n) > 0;
    if (!convex && n <= PTI_EARS_MAX) return pti_obj_cut(o, material);
    if (!convex) pti_obj_warn(o, "a polygon of more than 1024 corners that is not convex is cut as a fan");
    for (i = 1; i + 1 < n; i++)
        if (!pti_obj_triangle(o, 0, i, i + 1, material)) return 0;
    return 1;
}

static int pti_obj_face(pti_obj *o)
{
    uint32_t before = o->info->triangles, i;
    int material, has_vt = 1, has_vn = 1;
    o->face_count = 0;
    while (pti_skip_blanks(&o->text) && *o->text.at != '#')
        if (!pti_obj_corner(o)) return 0;
    for (i = 0; i < o->face_count; i++) {
        const pti_corner *c = &o->face[i];
        has_vt &= c->vt != PTI_NONE;
        has_vn = has_vn && c->vn != PTI_NONE && pt_v3_dot(o->vn[c->vn], o->vn[c->vn]) > 0;
    }
    for (i = 0; i < o->face_count; i++) {
        if (!has_vt) o->face[i].vt = PTI_NONE;
        if (!has_vn) o->face[i].vn = PTI_NONE;
    }
    material = pti_obj_material(o);
    if (material < 0 || !pti_obj_polygon(o, material)) return 0;
#if PTI_HAS_TEXTURES
    if (!has_vt && o->scene->materials[material].texture)
        pti_obj_tell_of(o, PTI_TOLD_NO_VT, "", 0, "a face with a picture has no vt, here and elsewhere: each triangle shows its corner");
#endif
    if (o->info->triangles == before) o->info->degenerate_faces++;
    return 1;
}

/* --- the whole --- */

static int pti_obj_line(pti_obj *o)
{
    const char *word;
    size_t size = pti_take_word(&o->text, &word);
    if (size == 0 || *word == '#') {
        o->text.at += strcspn(o->text.at, "\r\n"); /* a comment does not go on */
        return 1;
    }
    if (pti_word_is(word, size, "v")) return pti_obj_position(o);
    if (pti_word_is(word, size, "f")) return pti_obj_face(o);
    if (pti_word_is(word, size, "vn")) return pti_obj_normal(o);
    if (pti_word_is(word, size, "vt")) return pti_obj_uv(o);
    if (pti_word_is(word, size, "usemtl")) return pti_obj_use(o);
    if (pti_word_is(word, size, "mtllib")) return pti_obj_libraries(o);
    if (pti_word_is(word, size, "g") || pti_word_is(word, size, "o") || pti_word_is(word, size, "s")) return 1;
    pti_obj_tell_of(o, PTI_TOLD_SKIPPED, word, size, " is skipped, and what else is no face");
    o->info->skipped_lines++;
    return 1;
}

static int pti_obj_read(pti_obj *o, const char *path)
{
    unsigned char *bytes;
    pt_result result;
    o->file = path ? path : "";
    result = pti_obj_open(o, path, &bytes);
    if (result == PT_ERROR_MEMORY) return pti_obj_no_memory(o);
    if (result == PT_ERROR_ARGUMENT) return pti_obj_fail(o, PT_ERROR_FILE, "is larger than 2 GiB");
    if (result == PT_ERROR_SCENE) return pti_obj_fail(o, PT_ERROR_FILE, "is not a text");
    if (result != PT_OK) return pti_obj_fail(o, PT_ERROR_FILE, "cannot be read");
    for (; *o->text.at && o->result == PT_OK; pti_next_line(&o->text))
        if (!pti_obj_line(o)) break;
    pti_free(bytes, o->scene->alloc_user);
    if (o->result == PT_OK && o->info->triangles == 0) {
        o->text.line = 0;
        pti_obj_fail(o, PT_ERROR_FILE, "holds no triangle with an area");
    }
    return o->result == PT_OK;
}

/* The transform and what follows from it. */
static int pti_obj_prepare(pti_obj *o)
{
    double (*a)[4] = o->options.transform, zero = 0, det = 0;
    int i, k;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 4; k++) zero = fmax(zero, a[i][k] == 0 ? 0 : 1); /* NaN too is not 0 */
    for (i = 0; zero == 0 && i < 3; i++) a[i][i] = 1;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++) {
            const double *b = a[(i + 1) % 3], *c = a[(i + 2) % 3];
            o->cofactor[i][k] = b[(k + 1) % 3] * c[(k + 2) % 3] - b[(k + 2) % 3] * c[(k + 1) % 3];
        }
    for (k = 0; k < 3; k++) det += a[0][k] * o->cofactor[0][k];
    if (det == 0 || !pti_finite(det) || !pti_finite(a[0][3] + a[1][3] + a[2][3]))
        return pti_obj_fail(o, PT_ERROR_ARGUMENT, "the transform is not finite or has no inverse");
    o->mirrors = det < 0;
    for (i = 0; o->mirrors && i < 3; i++)
        for (k = 0; k < 3; k++) o->cofactor[i][k] = -o->cofactor[i][k];
    if (!(o->options.emission_scale >= 0) || !pti_finite(o->options.emission_scale))
        return pti_obj_fail(o, PT_ERROR_ARGUMENT, "the scale of the emission is negative or not finite");
    if (!(o->options.flags & PT_OBJ_MATERIAL)) return 1;
    o->plain = o->options.material;
    if (o->plain >= 0 && (uint32_t)o->plain < o->scene->material_count) return 1;
    return pti_obj_fail(o, PT_ERROR_ARGUMENT, "the material of the options does not exist");
}

/* Gives the vertices to the scene, for which all memory is asked first. Those without vt or vn have 0 there, and no
   triangle that looks. */
static int pti_obj_finish(pti_obj *o)
{
    pt_scene *s = o->scene;
    void *user = s->alloc_user;
    int has_vn = o->mesh[2] >= 0 || o->mesh[3] >= 0, has_vt = o->mesh[1] >= 0 || o->mesh[3] >= 0, k;
    uint32_t base = s->position_count, n = o->corner_count, i;
    if (!pti_reserve(&s->positions, &s->position_capacity, (size_t)base + n, sizeof *s->positions, user) ||
        (has_vn && !pti_reserve(&s->normals, &s->normal_capacity, (size_t)s->normal_count + n, sizeof *s->normals, user)) ||
        (has_vt && !pti_reserve(&s->uvs, &s->uv_capacity, (size_t)s->uv_count + n, sizeof *s->uvs, user)) ||
        !pti_reserve(&s->meshes, &s->mesh_capacity, (size_t)s->mesh_count + 4, sizeof *s->meshes, user))
        return pti_obj_no_memory(o);
    for (k = 0; k < 4; k++) {
        if (o->mesh[k] < 0) continue;
        s->meshes[o->mesh[k]].has_normals = k >= 2;
        s->meshes[o->mesh[k]].has_uvs = k % 2;
        s->meshes[o->mesh[k]].normal_offset = (int64_t)s->normal_count - base;
        s->meshes[o->mesh[k]].uv_offset = (int64_t)s->uv_count - base;
        s->mesh_count++;
    }
    for (i = 0; i < n; i++) {
        const pti_corner *c = &o->corners[i];
        s->positions[s->position_count++] = o->v[c->v];
        if (has_vn) s->normals[s->normal_count++] = c->vn == PTI_NONE ? pt_v3(0, 0, 0) : o->vn[c->vn];
        if (has_vt) s->uvs[s->uv_count++] = c->vt == PTI_NONE ? pt_v2(0, 0) : o->vt[c->vt];
    }
    o->info->vertices = n;
    s->committed = 0;
    return 1;
}

static void pti_obj_free(pti_obj *o)
{
    void *user = o->scene->alloc_user;
    pti_free(o->v, user);
    pti_free(o->vn, user);
    pti_free(o->vt, user);
    pti_free(o->corners, user);
    pti_free(o->face, user);
    pti_free(o->mtls, user);
    pti_free(o->pool, user);
    pti_free(o->corner_table.slots, user);
    pti_free(o->name_table.slots, user);
#if PTI_HAS_TEXTURES
    pti_free(o->pictures, user);
#endif
}

PTDEF pt_result pt_load_obj(pt_scene *scene, const char *path, const pt_obj_options *options, pt_obj_info *info)
{
    const uint32_t materials = scene->material_count, triangles = scene->triangle_count, owned = scene->owned_count;
    const int committed = scene->committed;
    pt_obj_info unseen;
    pti_obj o;
    memset(&o, 0, sizeof o);
    o.scene = scene;
    o.info = info ? info : &unseen;
    o.file = path ? path : "";
    o.material = o.plain = o.mesh[0] = o.mesh[1] = o.mesh[2] = o.mesh[3] = -1;
    if (options) o.options = *options;
    memset(o.info, 0, sizeof *o.info);
    if (scene->error != PT_OK) {
        pti_obj_fail(&o, scene->error, pt_scene_error(scene));
        return o.result;
    }
    if (pti_obj_prepare(&o) && pti_obj_read(&o, path)) pti_obj_finish(&o);
    if (o.result != PT_OK) {
        pti_disown(scene, owned);
        scene->material_count = materials;
        scene->triangle_count = triangles;
        scene->committed = committed;
        o.info->triangles = o.info->emissive_triangles = o.info->materials = o.info->textures = 0;
        o.info->lo = o.info->hi = pt_v3(0, 0, 0);
    }
    if (o.result == PT_ERROR_MEMORY) { /* the scene itself is whole */
        scene->error = PT_OK;
        scene->error_text[0] = 0;
    }
    pti_obj_free(&o);
    return o.result;
}
#endif /* PTI_HAS_OBJ */

#endif /* PTI_HAS_FILES */

/* =====================================================================================================
   [PT-18] RENDER DRIVER: implementation
   =====================================================================================================
   A render is a sequence of passes over the film, each a range of samples; after each the error is estimated
   and the budgets are asked. A pass works on a copy of the sums and replaces them when it is complete, so that
   a cancelled pass leaves no trace. Samples of a pixel are added in the order of their index, by whichever
   thread has the tile; nothing else is shared, and so the film is the same bits for any threads, tiles and
   passes. */

PTDEF const pt_method *pt_methods(int *count)
{
    enum {
        ALL = PT_NEEDS_ALL,
        HIT = ALL & ~(PT_NEEDS_POINT_LIGHTS | PT_NEEDS_SPOT_LIGHTS | PT_NEEDS_DIRECTIONAL_LIGHTS), /* lights that can be hit */
        SEEN = ALL & ~(PT_NEEDS_ENVIRONMENT | PT_NEEDS_ENVIRONMENT_IMAGE)                          /* lights with a middle   */
    };
    static const pt_method methods[] = {
        {"path", "path tracing, light and BSDF sampling combined (MIS)", pt_li_path, ALL, 1, 1},
#if PTI_HAS_ALL_METHODS
        {"path-light", "path tracing, light sampling only", pt_li_path_light, ALL, 1, 1},
        {"path-plain", "path tracing, light found by hitting it", pt_li_path_plain, HIT, 1, 1},
#endif
#if PTI_HAS_WHITTED
        {"local", "local Phong lighting of the slides, without shadows", pt_li_local, SEEN, 0, 0},
        {"whitted", "Whitted: a tree of mirror and refracted rays, hard shadows", pt_li_whitted, SEEN, 0, 0},
        {"distribution", "distribution ray tracing: pixel, lens, lights, gloss", pt_li_distribution, ALL, 0, 1},
        {"branching", "the slides' solver: N directions at every hit", pt_li_branching, HIT, 0, 0},
#endif
    };
    *count = (int)(sizeof methods / sizeof methods[0]);
    return methods;
}

PTDEF const pt_method *pt_method_find(const char *name)
{
    int count, i;
    const pt_method *m = pt_methods(&count);
    for (i = 0; i < count; i++)
        if (strcmp(m[i].name, name ? name : "path") == 0) return &m[i];
    return NULL;
}

/* The smallest instance of the method's body that covers the scene. */
static pt_li_fn pti_pick_instance(const pt_method *method, const pt_scene *scene, const pt_render_desc *desc,
                                  const char **body)
{
    const unsigned diffuse = PT_NEEDS_TRIANGLES | PT_NEEDS_PARALLELOGRAMS | PT_NEEDS_SPHERES | PT_NEEDS_SHADING_NORMALS |
                             PT_NEEDS_UVS | PT_NEEDS_DIFFUSE | PT_NEEDS_AREA_LIGHTS | PT_NEEDS_POINT_LIGHTS | PT_NEEDS_BVH;
    int observed = 0;
#if PTI_HAS_OBSERVER
    observed = desc->li.observer != NULL;
#endif
#if PTI_HAS_LPE
    observed |= desc->li.lpe != NULL;
#endif
    *body = "general";
    if (method->li != pt_li_path || desc->general_body || observed || (scene->needs & ~diffuse)) return method->li;
    *body = "diffuse";
    return pti_path_diffuse;
}

#if PTI_HAS_LOCKSTEP
/* Where the ray through a point of the picture, in pixels, starts, if the camera has no lens. */
static pt_vec3 pti_camera_start(const pt_render_desc *d, double x, double y)
{
    const pt_camera *c = &d->camera;
    const double wide = (double)c->tan_half / d->height, near = (double)c->near_distance;
    const pti_d3 right = pti_d_scale(pti_d_from(c->right), (2 * x - d->width) * wide), up = pti_d_scale(pti_d_from(c->up), (d->height - 2 * y) * wide);
    return pti_d_to(pti_d_add(pti_d_from(c->position), pti_d_scale(pti_d_add(pti_d_from(c->forward), pti_d_add(right, up)), near)));
}

/* Do all rays of pixels x0..x1 of row y start inside the shells? Those of the corners do, and what is inside has no dents. */
static int pti_lock_row_inside(const pti_lockstep *k, const pt_render_desc *d, double x0, double x1, double y)
{
    const double rim = d->filter == PT_FILTER_BOX && !(d->filter_radius > 0) ? 0 : fmax(d->filter_radius, 8);
    int i;
    for (i = 0; i < 4; i++)
        if (!pti_lock_inside(k, pti_camera_start(d, i & 1 ? x1 + rim : x0 - rim, i & 2 ? y + 1 + rim : y - rim))) return 0;
    return 1;
}

/* A room of shells, seen from inside but for a rim of at most a tenth: rows there are left to paths one at a time. */
static int pti_pick_shells(pti_lockstep *k, const pt_scene *scene, const pt_render_desc *d)
{
    const double w = d->width, h = d->height;
    int i;
    if (d->camera.lens_radius > 0 || !pti_lockstep_make_shells(k, scene, pti_camera_start(d, w / 2, h / 2))) return 0;
    for (i = 0; i < 4; i++)
        if (!pti_lock_inside(k, pti_camera_start(d, (i & 1 ? 0.95 : 0.05) * w, (i & 2 ? 0.95 : 0.05) * h))) return 0;
    return 1;
}

/* Can paths walk together here? Then the scene is made ready for that, and *technique is the method's. */
static int pti_pick_lockstep(const pt_method *method, const pt_scene *scene, const pt_render_desc *d, pti_lockstep *out, int *technique)
{
    const pt_camera *c = &d->camera;
    const pt_real ahead = c->lens_radius + c->near_distance * (1 + c->tan_half * (1 + (pt_real)d->width / (pt_real)d->height));
    const pt_vec3 eye = pt_v3(pti_fabs(c->position.x) + ahead, pti_fabs(c->position.y) + ahead, pti_fabs(c->position.z) + ahead);
    *technique = PTI_TECHNIQUE_MIS;
#if PTI_HAS_ALL_METHODS
    if (method->li == pt_li_path_plain) *technique = PTI_TECHNIQUE_PLAIN;
#endif
    if (method->li != pt_li_path && *technique == PTI_TECHNIQUE_MIS) return 0;
#if PTI_HAS_OBSERVER
    if (d->li.observer) return 0;
#endif
#if PTI_HAS_LPE
    if (d->li.lpe) return 0;
#endif
    if (d->no_lockstep || d->general_body || d->sampler == PT_SAMPLER_STRATIFIED) return 0;
    if (d->li.max_edges >= 1 << 24 || d->li.roulette_start >= 1 << 24) return 0; /* they are counted in floats */
    if (pti_lockstep_make(out, scene, eye)) return 1;
    if (pti_pick_shells(out, scene, d)) return 1;
    return pti_lockstep_make_tree(out, scene, eye);
}
#endif

PTDEF const char *pt_sampler_name(pt_sampler_kind kind)
{
    switch (kind) {
    case PT_SAMPLER_SOBOL: return "sobol";
    case PT_SAMPLER_INDEPENDENT: return "independent";
    case PT_SAMPLER_STRATIFIED: return "stratified";
    case PT_SAMPLER_GIVEN: return "given";
    }
    return "unknown";
}

PTDEF pt_render_desc pt_render_defaults(void)
{
    pt_render_desc d;
    memset(&d, 0, sizeof d);
    d.spp = 64;
    return d;
}

/* --- fingerprint --- */

static void pti_hash_word(uint64_t *h, uint64_t x)
{
    *h = pt_hash64(*h ^ x);
}
static void pti_hash_double(uint64_t *h, double x)
{
    uint64_t bits;
    if (x == 0) x = 0; /* -0 renders as 0 does */
    memcpy(&bits, &x, sizeof bits);
    pti_hash_word(h, bits);
}
static void pti_hash_vec(uint64_t *h, pt_vec3 v)
{
    pti_hash_double(h, (double)v.x);
    pti_hash_double(h, (double)v.y);
    pti_hash_double(h, (double)v.z);
}
static void pti_hash_rgb(uint64_t *h, pt_rgb c)
{
    pti_hash_vec(h, pt_v3(c.r, c.g, c.b));
}
static void pti_hash_text(uint64_t *h, const char *text)
{
    for (; *text; text++) pti_hash_word(h, (unsigned char)*text);
}

/* Textures and tables. A texture that is a function is known by its scale only. */
static void pti_hash_borrowed(uint64_t *h, const pt_material *m)
{
    size_t i;
#if PTI_HAS_TEXTURES
    const pt_texture *t = m->texture;
    if (t) {
        pti_hash_word(h, (uint64_t)t->kind << 32 | (uint64_t)t->width);
        pti_hash_word(h, (uint64_t)t->height);
        pti_hash_vec(h, pt_v3(t->scale.x, t->scale.y, 0));
        pti_hash_rgb(h, t->a);
        pti_hash_rgb(h, t->b);
        for (i = 0; t->kind == PT_TEXTURE_IMAGE && i < 3 * (size_t)t->width * (size_t)t->height; i++) pti_hash_double(h, (double)t->rgb[i]);
    }
#endif
#if PTI_HAS_MEASURED
    for (i = 0; m->measured && i < 3 * (size_t)PT_MEASURED_CELLS; i++) pti_hash_double(h, m->measured->value[i]);
#endif
    (void)h;
    (void)m;
    (void)i;
}

static void pti_hash_lights(uint64_t *h, const pt_scene *s)
{
    uint32_t i;
    for (i = 0; i < s->delta_light_count; i++) {
        pti_hash_word(h, (uint64_t)s->delta_lights[i].kind);
        pti_hash_vec(h, s->delta_lights[i].position);
        pti_hash_vec(h, s->delta_lights[i].direction);
        pti_hash_rgb(h, s->delta_lights[i].intensity);
        pti_hash_double(h, s->delta_lights[i].omc_start);
        pti_hash_double(h, s->delta_lights[i].omc_end);
    }
    pti_hash_rgb(h, s->environment);
#if PTI_HAS_ENVIRONMENT
    if (s->map.rgb) {
        size_t k;
        pti_hash_word(h, (uint64_t)s->map.width << 32 | (uint64_t)s->map.height);
        pti_hash_double(h, s->map.scale);
        for (k = 0; k < 3 * (size_t)s->map.width * (size_t)s->map.height; k++) pti_hash_double(h, (double)s->map.rgb[k]);
    }
#endif
}

static void pti_hash_scene(uint64_t *h, const pt_scene *s)
{
    uint32_t i;
    pti_hash_word(h, (uint64_t)s->material_count << 32 | s->position_count);
    pti_hash_word(h, (uint64_t)s->normal_count << 32 | s->triangle_count);
    pti_hash_word(h, (uint64_t)s->sphere_count << 32 | s->parallelogram_count);
    for (i = 0; i < s->mesh_count; i++)
        pti_hash_word(h, s->meshes[i].has_normals ? (uint64_t)s->meshes[i].normal_offset : UINT64_MAX);
    for (i = 0; i < s->material_count; i++) {
        pti_hash_word(h, (uint64_t)s->materials[i].kind);
        pti_hash_rgb(h, s->materials[i].albedo);
        pti_hash_rgb(h, s->materials[i].emission);
        pti_hash_double(h, (double)s->materials[i].ior);
        pti_hash_double(h, (double)s->materials[i].roughness);
        pti_hash_rgb(h, s->materials[i].eta);
        pti_hash_rgb(h, s->materials[i].k);
        pti_hash_rgb(h, s->materials[i].specular);
        pti_hash_double(h, (double)s->materials[i].exponent);
        pti_hash_borrowed(h, &s->materials[i]);
    }
    for (i = 0; i < s->position_count; i++) pti_hash_vec(h, s->positions[i]);
    for (i = 0; i < s->normal_count; i++) pti_hash_vec(h, s->normals[i]);
    for (i = 0; i < s->uv_count; i++) pti_hash_vec(h, pt_v3(s->uvs[i].x, s->uvs[i].y, 0));
    for (i = 0; i < s->triangle_count; i++) {
        pti_hash_word(h, (uint64_t)s->triangles[i].v[0] << 32 | s->triangles[i].v[1]);
        pti_hash_word(h, (uint64_t)s->triangles[i].v[2] << 32 | (uint32_t)s->triangles[i].material);
        pti_hash_word(h, (uint64_t)s->triangles[i].mesh);
    }
    for (i = 0; i < s->sphere_count; i++) {
        pti_hash_vec(h, s->spheres[i].centre);
        pti_hash_double(h, (double)s->spheres[i].radius);
        pti_hash_word(h, (uint64_t)s->spheres[i].material);
    }
    for (i = 0; i < s->parallelogram_count; i++) {
        pti_hash_vec(h, s->parallelograms[i].corner);
        pti_hash_vec(h, s->parallelograms[i].edge1);
        pti_hash_vec(h, s->parallelograms[i].edge2);
        pti_hash_word(h, (uint64_t)s->parallelograms[i].material);
    }
    pti_hash_lights(h, s);
}

/* What the bits of a film depend on. `planned` is the sample count of the stratified sampler, else 0. */
static uint64_t pti_fingerprint(const pt_scene *scene, const pt_render_desc *d, const pt_method *method, const char *body, uint32_t planned)
{
    uint64_t h = sizeof(pt_real);
    const pt_camera *c = &d->camera;
    pti_hash_text(&h, PT_VERSION_STRING);
    pti_hash_scene(&h, scene);
    pti_hash_vec(&h, c->position);
    pti_hash_vec(&h, c->right);
    pti_hash_vec(&h, c->up);
    pti_hash_vec(&h, c->forward);
    pti_hash_vec(&h, pt_v3(c->tan_half, c->lens_radius, c->focus_distance));
    pti_hash_double(&h, (double)c->near_distance);
    pti_hash_word(&h, (uint64_t)d->width << 32 | (uint64_t)d->height);
    pti_hash_text(&h, method->name);
    pti_hash_text(&h, body);
    pti_hash_word(&h, (uint64_t)d->sampler << 32 | planned);
    pti_hash_word(&h, d->seed);
    pti_hash_word(&h, (uint64_t)d->li.max_edges << 32 | (uint64_t)d->li.roulette << 16 | (uint64_t)d->li.heuristic);
    pti_hash_double(&h, (double)d->li.roulette_survival);
    pti_hash_double(&h, (double)d->li.roulette_scale);
    pti_hash_word(&h, (uint64_t)d->li.roulette_start << 1 | (uint64_t)(d->single_net != 0));
    pti_hash_word(&h, (uint64_t)d->filter);
    pti_hash_double(&h, d->filter_radius);
#if PTI_HAS_WHITTED
    pti_hash_word(&h, (uint64_t)d->li.branching);
    pti_hash_rgb(&h, d->li.ambient);
#endif
#if PTI_HAS_LPE
    if (d->li.lpe) {
        int state, letter;
        for (state = 0; state < d->li.lpe->state_count; state++)
            for (letter = 0; letter < 4; letter++)
                pti_hash_word(&h, (uint64_t)d->li.lpe->class_of[state] << 8 | d->li.lpe->next[state][letter]);
    }
#endif
    return h;
}

/* --- one pass --- */

/* What the tasks of a pass share. */
typedef struct pti_pass {
    const pt_scene *scene;
    const pt_render_desc *desc;
    pt_li_fn li;
    pt_li_options options;
    pt_film *film;          /* the copy that the pass works on                                             */
    uint32_t begin, end;    /* samples                                                                     */
    uint32_t planned;       /* samples a half (stratified)                                                 */
    int columns, tiles;
    double start, cpu_start, last_call, relmse;
    uint64_t rays_before;   /* rays of the passes before this one                                          */
    pti_counter rays, pixels, nonfinite; /* of this pass so far                                            */
    pti_counter asking;     /* taken by the thread that asks the user                                      */
    pti_counter cancel;     /* 1: the user wants to stop, 2: a path outlasted the time budget              */
#if PTI_HAS_LOCKSTEP
    const pti_lockstep *lockstep; /* NULL: paths one at a time                                             */
    int technique;
#endif
} pti_pass;

static int pti_rgbd_finite(pt_rgbd c)
{
    return pti_finite(c.r) && pti_finite(c.g) && pti_finite(c.b);
}

static void pti_add3(double *sum, double r, double g, double b)
{
    sum[0] += r;
    sum[1] += g;
    sum[2] += b;
}

/* The camera's ray through a point of pixel (x, y) that the filter takes u to. */
static pt_ray pti_pixel_ray(const pt_render_desc *d, pt_real x, pt_real y, pt_vec2 u, pt_vec2 lens)
{
    if (d->filter != PT_FILTER_BOX || d->filter_radius > 0) {
        u = pt_filter_sample(d->filter, d->filter_radius, u);
        u = pt_v2(u.x + PTI_R(0.5), u.y + PTI_R(0.5));
    }
    return pt_camera_ray(&d->camera, (pt_real)d->width / (pt_real)d->height, (x + u.x) / (pt_real)d->width, (y + u.y) / (pt_real)d->height, lens);
}

/* One sample of one pixel, added to the film. */
static void pti_render_sample(pti_pass *p, pt_sampler *sampler, int x, int y, uint32_t sample, pt_li_info *info)
{
    const pt_render_desc *d = p->desc;
    pt_film *film = p->film;
    size_t pixel = (size_t)y * (size_t)d->width + (size_t)x;
    uint32_t half = d->single_net ? 0 : sample & 1u;
    pt_vec2 u, lens = pt_v2(0, 0);
    pt_rgbd L;
    pt_ray ray;
#if PTI_HAS_LPE
    pt_rgbd classes[PT_LPE_EXPRESSIONS + 1];
    int k;
#endif
    int finite;
    /* Each half is a net of its own: another stream. */
    pt_sampler_start(sampler, 2 * (uint64_t)pixel + half, d->single_net ? sample : sample >> 1);
    u = pt_sampler_2d(sampler);
    if (d->camera.lens_radius > 0) lens = pt_sampler_2d(sampler);
    ray = pti_pixel_ray(d, (pt_real)x, (pt_real)y, u, lens);
#if PTI_HAS_LPE
    info->classes = classes;
    if (film->classes) memset(classes, 0, sizeof classes);
#endif
    L = p->li(p->scene, &ray, sampler, &p->options, info);
    if (info->cancelled) return; /* and with it the whole pass */
    finite = pti_rgbd_finite(L);
    if (finite) pti_add3(film->half[half] + 3 * pixel, L.r, L.g, L.b);
    else PTI_ADD(&p->nonfinite, 1);
#if PTI_HAS_LPE
    for (k = 0; finite && k < film->class_count; k++)
        pti_add3(film->classes + 3 * (pixel + (size_t)k * (size_t)d->width * (size_t)d->height), classes[k].r, classes[k].g, classes[k].b);
#endif
    if (!film->albedo || !info->hit) return;
    pti_add3(film->albedo + 3 * pixel, (double)info->albedo.r, (double)info->albedo.g, (double)info->albedo.b);
    pti_add3(film->normal + 3 * pixel, (double)info->normal.x, (double)info->normal.y, (double)info->normal.z);
    film->depth[pixel] += (double)info->depth;
}

/* Calls the user's callback if it is time and no other thread does; a wish to stop is noted. */
static void pti_ask_user(pti_pass *p)
{
    const pt_render_desc *d = p->desc;
    double wall, share;
    pt_progress now;
    if (!d->progress || !PTI_TAKE(&p->asking)) return;
    wall = pt_wall_seconds();
    if (wall - p->last_call >= 0.1) {
        p->last_call = wall;
        share = (double)PTI_LOAD(&p->pixels) / ((double)d->width * d->height);
        now.spp = p->begin - d->first_sample + share * (p->end - p->begin);
        now.spp_target = d->spp;
        now.seconds = wall - p->start;
        now.rays_per_second = now.seconds > 0 ? ((double)p->rays_before + (double)PTI_LOAD(&p->rays)) / now.seconds : 0;
        now.relmse = p->relmse;
        now.seconds_left = now.spp > 0 && d->spp ? now.seconds * (d->spp - now.spp) / now.spp : HUGE_VAL;
        if (d->seconds > 0) now.seconds_left = fmin(now.seconds_left, fmax(0, d->seconds - now.seconds));
        if (!pti_finite(now.seconds_left)) now.seconds_left = -1;
        if (d->progress(d->progress_user, &now)) PTI_STORE(&p->cancel, 1);
    }
    PTI_STORE(&p->asking, 0);
}

/* Asked from inside long paths: is it time to give up this pass? */
static int pti_poll(void *context)
{
    pti_pass *p = (pti_pass *)context;
    const pt_render_desc *d = p->desc;
    pti_ask_user(p);
    if (d->li.poll && d->li.poll(d->li.poll_user)) PTI_STORE(&p->cancel, 1);
    if (d->seconds > 0 && pt_wall_seconds() - p->start >= d->seconds) PTI_STORE(&p->cancel, 2);
    if (d->cpu_seconds > 0 && pt_cpu_seconds() - p->cpu_start >= d->cpu_seconds) PTI_STORE(&p->cancel, 2);
    return PTI_LOAD(&p->cancel) != 0;
}

#if PTI_HAS_LOCKSTEP
/* --- a tile in lockstep --- */

/* What the sampler's numbers of a pixel and half are made with: the orders of three sets of four dimensions, and scramblings. */
typedef struct pti_lock_seeds {
    uint64_t stream, key;
    uint32_t order[3], film[2], bsdf[2], light[2], choice[2];
} pti_lock_seeds;

static void pti_lock_pair(const pt_sampler *s, uint32_t dimension, uint32_t seeds[2])
{
    const uint64_t both = pti_sampler_hash(s, dimension >> 1, 1);
    seeds[0] = (uint32_t)both;
    seeds[1] = (uint32_t)(both >> 32);
}

static void pti_lock_seed(pti_lock_seeds *out, pt_sampler *s, uint64_t stream)
{
    uint32_t k;
    if (out->stream == stream) return;
    pt_sampler_start(s, stream, 0);
    out->stream = stream;
    out->key = s->key;
    for (k = 0; k < 3; k++) out->order[k] = (uint32_t)pti_sampler_hash(s, k + 1, 2);
    pti_lock_pair(s, PT_DIM_FILM, out->film);
    pti_lock_pair(s, PT_DIM_EDGE(1) + PT_DIM_BSDF, out->bsdf);
    pti_lock_pair(s, PT_DIM_EDGE(1) + PT_DIM_LIGHT, out->light);
    pti_lock_pair(s, PT_DIM_EDGE(1) + PT_DIM_LIGHT_CHOICE, out->choice);
}

/* Which paths start together: pixel, sample, and rows of seeds. */
typedef struct pti_lock_batch {
    pti_lane_row index, order[3], film[2], bsdf[2], light[2], choice[2];
    pti_lane_row x, y;
} pti_lock_batch;

static void pti_lock_lane(pti_lock_batch *b, pti_lane_row *row, int lane, const pti_lock_seeds *s, uint32_t index)
{
    const uint64_t walk = pt_hash64(s->key ^ ((uint64_t)0x6c6f636bu << 32 | index)); /* a use of its own */
    int k;
    b->index.bits[lane] = index;
    for (k = 0; k < 3; k++) b->order[k].bits[lane] = s->order[k];
    for (k = 0; k < 2; k++) {
        b->film[k].bits[lane] = s->film[k];
        b->bsdf[k].bits[lane] = s->bsdf[k];
        b->light[k].bits[lane] = s->light[k];
        b->choice[k].bits[lane] = s->choice[k];
    }
    row[PTI_ROW_A].bits[lane] = (uint32_t)walk;
    row[PTI_ROW_B].bits[lane] = (uint32_t)(walk >> 32) | 1u; /* never both 0 */
}

/* Dimension d of the set whose points have these numbers, 24 bits. */
PTI_INLINE pti_fw pti_lock_point(pti_uw n, int d, pti_uw seed)
{
    const pti_uw x = pti_lock_reverse(pti_lock_scramble(pti_lock_sobol(n, d), seed));
    return pti_fw_mul(pti_fw_from_words(pti_uw_shr(x, 8)), pti_fw_set((float)PTI_2_M24));
}
PTI_INLINE pti_uw pti_lock_order(const pti_lock_batch *b, int set)
{
    return pti_lock_reverse(pti_lock_scramble(pti_lock_reverse(b->index.u), b->order[set].u));
}

/* Numbers of the film (and lens), and of the first vertex. */
static void pti_lock_draw(const pti_lock_work *w, const pti_lock_batch *b, pti_lane_row *row, int sobol, int lens, pti_lane_row film[4], pti_lock_numbers *u)
{
    const pti_fw zero = pti_fw_set(0);
    u->which = u->lobe = film[2].f = film[3].f = zero;
    if (sobol) {
        const pti_uw n = pti_lock_order(b, 0), m = pti_lock_order(b, 1);
        film[0].f = pti_lock_point(n, 0, b->film[0].u);
        film[1].f = pti_lock_point(n, 1, b->film[1].u);
        u->bsdf0 = pti_lock_point(m, 0, b->bsdf[0].u);
        u->bsdf1 = pti_lock_point(m, 1, b->bsdf[1].u);
        u->light0 = pti_lock_point(m, 2, b->light[0].u);
        u->light1 = pti_lock_point(m, 3, b->light[1].u);
        if (w->k->light_count > 1 || w->k->specular) {
            const pti_uw l = pti_lock_order(b, 2);
            u->which = pti_lock_point(l, 0, b->choice[0].u);
            u->lobe = pti_lock_point(l, 1, b->choice[1].u);
        }
    } else {
        u->bsdf0 = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        u->bsdf1 = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        u->light0 = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        u->light1 = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        u->which = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        u->lobe = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        film[0].f = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        film[1].f = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
    }
    if (lens) {
        film[2].f = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        film[3].f = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
    }
}

/* Rays of a pinhole through these points of the picture, all lanes at once. */
static void pti_lock_pinhole(const pt_render_desc *d, const pti_lock_batch *b, pti_lane_row film[4], pti_lane_row *row)
{
    const pt_camera *c = &d->camera;
    const float axes[3][3] = {{c->right.x, c->right.y, c->right.z}, {c->up.x, c->up.y, c->up.z}, {c->forward.x, c->forward.y, c->forward.z}};
    const float wide = 2 * c->tan_half / (float)d->height, half_x = (float)d->width / 2, half_y = (float)d->height / 2;
    const pti_fw x = pti_fw_sub(pti_fw_add(b->x.f, film[0].f), pti_fw_set(half_x)), y = pti_fw_sub(pti_fw_set(half_y), pti_fw_add(b->y.f, film[1].f));
    const pti_w3 across = pti_w3_along(pti_w3_set(axes[0]), pti_fw_mul(x, pti_fw_set(wide)), pti_w3_set(axes[2]));
    pti_row3_set(row + PTI_ROW_D, pti_w3_normalize(pti_w3_along(pti_w3_set(axes[1]), pti_fw_mul(y, pti_fw_set(wide)), across)));
    pti_row3_set(row + PTI_ROW_O, pti_w3_make(pti_fw_set(c->position.x), pti_fw_set(c->position.y), pti_fw_set(c->position.z)));
}

/* The camera's ray of each lane, as in pti_render_sample. */
static void pti_lock_camera(const pt_render_desc *d, const pti_lock_batch *b, pti_lane_row film[4], pti_lane_row *row, int count)
{
    int i;
    if (d->filter == PT_FILTER_BOX && !(d->filter_radius > 0) && !(d->camera.lens_radius > 0) && !(d->camera.near_distance > 0)) {
        pti_lock_pinhole(d, b, film, row);
        return;
    }
    for (i = 0; i < count; i++) {
        const pt_vec2 u = pt_v2(film[0].v[i], film[1].v[i]);
        const pt_ray ray = pti_pixel_ray(d, b->x.v[i], b->y.v[i], u, pt_v2(film[2].v[i], film[3].v[i]));
        row[PTI_ROW_O].v[i] = ray.o.x;
        row[PTI_ROW_O + 1].v[i] = ray.o.y;
        row[PTI_ROW_O + 2].v[i] = ray.o.z;
        row[PTI_ROW_D].v[i] = ray.d.x;
        row[PTI_ROW_D + 1].v[i] = ray.d.y;
        row[PTI_ROW_D + 2].v[i] = ray.d.z;
    }
}

/* Where a tile's paths have got to: they go through the samples of a pixel, then to the next pixel of the row. */
typedef struct pti_lock_cursor {
    int x, y;
    uint32_t sample;
} pti_lock_cursor;

PTI_INLINE void pti_lock_advance(const pti_pass *p, const int box[4], pti_lock_cursor *at)
{
    if (++at->sample < p->end) return;
    at->sample = p->begin;
    if (++at->x < box[2]) return;
    at->x = box[0];
    at->y++;
}

/* Adds what the first edge of lane i met. */
static void pti_lock_add_seen(pt_film *film, const pti_lock_work *w, int i, const pti_lock_cursor *at, int width)
{
    const size_t pixel = (size_t)at->y * (size_t)width + (size_t)at->x;
    const pti_lane_row *s = w->seen;
    if (!(w->hit >> i & 1)) return;
    pti_add3(film->albedo + 3 * pixel, (double)s[0].v[i], (double)s[1].v[i], (double)s[2].v[i]);
    pti_add3(film->normal + 3 * pixel, (double)s[3].v[i], (double)s[4].v[i], (double)s[5].v[i]);
    film->depth[pixel] += (double)s[6].v[i];
}

/* The next `count` paths of a tile, each in its slot, added to the film in order. */
static void pti_lock_run(pti_pass *p, pti_lock_work *w, pt_sampler *sampler, const int box[4], pti_lock_cursor *at, uint32_t count)
{
    const pt_render_desc *d = p->desc;
    pti_lock_cursor from = *at, seen = *at;
    pti_lock_seeds seeds[2];
    pti_lock_batch batch;
    pti_lane_row row[PTI_ROWS], film[4];
    uint32_t j, i;
    memset(seeds, 0xff, sizeof seeds);
    memset(&batch, 0, sizeof batch);
    memset(row, 0, sizeof row);
    memset(w->slots, 0, sizeof w->slots);
    for (j = 0; j < count && !w->cancelled; j += PTI_WIDTH) {
        const uint32_t lanes = count - j < PTI_WIDTH ? count - j : PTI_WIDTH;
        pti_lock_numbers u;
        for (i = 0; i < lanes; i++, pti_lock_advance(p, box, at)) {
            const uint32_t half = d->single_net ? 0 : at->sample & 1u;
            const uint64_t pixel = (uint64_t)at->y * (uint64_t)d->width + (uint64_t)at->x;
            batch.x.v[i] = (float)at->x;
            batch.y.v[i] = (float)at->y;
            pti_lock_seed(&seeds[half], sampler, 2 * pixel + half);
            pti_lock_lane(&batch, row, (int)i, &seeds[half], d->single_net ? at->sample : at->sample >> 1);
            row[PTI_ROW_SLOT].bits[i] = j + i;
        }
        pti_lock_draw(w, &batch, row, d->sampler == PT_SAMPLER_SOBOL, d->camera.lens_radius > 0, film, &u);
        pti_lock_camera(d, &batch, film, row, (int)lanes);
        pti_lock_start(w, row, ~0u >> (32 - lanes), &u);
        for (i = 0; i < lanes && w->describes; i++, pti_lock_advance(p, box, &seen)) pti_lock_add_seen(p->film, w, (int)i, &seen, d->width);
    }
    pti_lock_walk(w, 0);
    for (j = 0; j < count && !w->cancelled; j++, pti_lock_advance(p, box, &from)) {
        const double *L = w->slots[j];
        double *sum = p->film->half[d->single_net ? 0 : from.sample & 1u] + 3 * ((size_t)from.y * (size_t)d->width + (size_t)from.x);
        if (pti_rgbd_finite(pt_rgbd3(L[0], L[1], L[2]))) pti_add3(sum, L[0], L[1], L[2]);
        else PTI_ADD(&p->nonfinite, 1);
    }
}

/* pti_render_tile in lockstep. */
static void pti_lock_tile(pti_pass *p, const int box[4], pt_sampler *sampler)
{
    const uint64_t n = p->end - p->begin, all = (uint64_t)(box[2] - box[0]) * (uint64_t)(box[3] - box[1]) * n;
    pti_lock_cursor at;
    uint64_t j, done = 0;
    pti_lock_work w;
    w.k = p->lockstep;
    w.options = &p->options;
    w.technique = p->technique;
    w.queued = w.cancelled = 0;
    w.describes = p->film->albedo != NULL;
    w.alive = 0;
    memset(w.row, 0, sizeof w.row);
    at.x = box[0];
    at.y = box[1];
    at.sample = p->begin;
    for (j = 0; j < all && !w.cancelled && !PTI_LOAD(&p->cancel); j += PTI_LOCK_SLOTS) {
        const uint64_t end = all - j < PTI_LOCK_SLOTS ? all : j + PTI_LOCK_SLOTS;
        w.rays = 0;
        pti_lock_run(p, &w, sampler, box, &at, (uint32_t)(end - j));
        PTI_ADD(&p->rays, (pti_counter)w.rays);
        PTI_ADD(&p->pixels, (pti_counter)(end / n - done));
        done = end / n;
        pti_ask_user(p);
    }
}
#endif

/* A task: one tile, all samples of the pass. */
static void pti_render_tile(void *context, int index)
{
    pti_pass *p = (pti_pass *)context;
    const pt_render_desc *d = p->desc;
    int x0 = (index % p->columns) * d->tile, y0 = (index / p->columns) * d->tile;
    int x1 = x0 + d->tile < d->width ? x0 + d->tile : d->width, y1 = y0 + d->tile < d->height ? y0 + d->tile : d->height;
    pt_sampler sampler = pt_sampler_make(d->sampler, d->seed, p->planned);
    pt_li_info info;
    uint32_t s;
    int x, y, together = y0, alone = y0; /* rows up to `together` and from `alone` on: paths one at a time  */
#if PTI_HAS_LOCKSTEP
    if (p->lockstep) {
        int box[4] = {x0, y0, x1, y1};
        while (box[1] < y1 && !pti_lock_row_inside(p->lockstep, d, x0, x1, box[1])) box[1]++;
        while (box[3] > box[1] && !pti_lock_row_inside(p->lockstep, d, x0, x1, box[3] - 1)) box[3]--;
        together = box[1];
        alone = box[3];
        if (together < alone) pti_lock_tile(p, box, &sampler);
    }
#endif
    for (y = y0; y < y1; y++)
        for (x = x0; x < x1 && (y < together || y >= alone); x++) {
            info.rays = 0;
            for (s = p->begin; s < p->end && !PTI_LOAD(&p->cancel); s++) pti_render_sample(p, &sampler, x, y, s, &info);
            PTI_ADD(&p->rays, (pti_counter)info.rays);
            PTI_ADD(&p->pixels, 1);
            pti_ask_user(p);
        }
}

enum { PTI_FILM_LAYERS = 6 };

/* The sums of a film, in the order of `layer`; NULL where a layer is not there. */
static double **pti_film_layer(pt_film *film, int layer, size_t *channels)
{
    double **layers[PTI_FILM_LAYERS] = {&film->half[0], &film->half[1], &film->albedo, &film->normal, &film->depth, &film->classes};
    *channels = layer == 5 ? 3 * (size_t)film->class_count : layer == 4 ? 1 : 3;
    return layers[layer];
}

/* Renders samples begin..end on a copy of the sums; if all went well, the copy becomes the film. */
static pt_result pti_render_pass(pti_pass *p, pt_film *film, uint32_t begin, uint32_t end)
{
    const pt_render_desc *d = p->desc;
    size_t pixels = (size_t)d->width * (size_t)d->height, channels;
    uint32_t odd = d->single_net ? 0 : end / 2 - begin / 2; /* odd samples in the range */
    pt_result result;
    int k;
    p->begin = begin;
    p->end = end;
    p->rays = p->pixels = p->nonfinite = 0;
    for (k = 0; k < PTI_FILM_LAYERS; k++) {
        double *from = *pti_film_layer(film, k, &channels), *to = *pti_film_layer(p->film, k, &channels);
        if (from) memcpy(to, from, pixels * channels * sizeof *to);
    }
    if (d->parallel) d->parallel(d->parallel_user, p->tiles, pti_render_tile, p);
    else pti_parallel(d->threads, p->tiles, pti_render_tile, p);
    p->rays_before += (uint64_t)p->rays;
    if (p->cancel) return PT_ERROR_CANCELLED;
    result = pt_film_add_range(film, begin, end);
    if (result != PT_OK) return result;
    film->samples[0] += end - begin - odd;
    film->samples[1] += odd;
    film->nonfinite += (uint64_t)p->nonfinite;
    for (k = 0; k < PTI_FILM_LAYERS; k++) {
        double **a = pti_film_layer(film, k, &channels), **b = pti_film_layer(p->film, k, &channels), *swap = *a;
        *a = *b;
        *b = swap;
    }
    return PT_OK;
}

/* --- the sequence of passes --- */

/* Brings the report up to date, and appends a row: after 1, 2, 4, ... samples and at the end. */
static pt_result pti_report_pass(pti_pass *p, pt_report *report, const pt_film *film, int row_due)
{
    pt_error error;
    int estimated = pt_film_error_estimate(film, &error);
    p->relmse = estimated ? error.relmse : -1;
    report->spp = pt_film_spp(film);
#if PTI_HAS_REPORT
    if (row_due && (report->row_count == 0 || report->rows[report->row_count - 1].spp != report->spp)) {
        const pt_render_desc *d = p->desc;
        pt_report_row *row;
        double relmse = error.relmse;
        if (!pti_reserve(&report->rows, &report->row_capacity, (size_t)report->row_count + 1, sizeof *row, report->alloc_user))
            return PT_ERROR_MEMORY;
        row = &report->rows[report->row_count++];
        memset(row, 0, sizeof *row);
        row->spp = report->spp;
        row->cpu_seconds = report->cpu_seconds;
        row->wall_seconds = report->wall_seconds;
        row->rays = report->rays;
        row->estimated = estimated;
        row->error = error;
        row->has_true_error = d->reference != NULL;
        if (d->reference) {
            pt_film_error(film, d->reference, &row->true_error);
            row->true_error.relmse_001 -= d->reference_mse_001;
            relmse = row->true_error.relmse;
        }
        row->efficiency = relmse > 0 && row->cpu_seconds > 0 ? 1 / (relmse * row->cpu_seconds) : 0;
    }
#else
    (void)row_due;
#endif
    return PT_OK;
}

/* Unit vectors at right angles, up to the rounding of their making? */
static int pti_camera_ok(const pt_camera *c)
{
    const double e = 64 * PTI_UNIT_ROUNDOFF;
    pti_d3 f = pti_d_from(c->forward), r = pti_d_from(c->right), u = pti_d_from(c->up);
    double bad;
    return !pti_coordinate_bad(c->position, &bad) && fabs(pti_d_dot(f, f) - 1) < e && fabs(pti_d_dot(r, r) - 1) < e &&
           fabs(pti_d_dot(u, u) - 1) < e && fabs(pti_d_dot(f, r)) < e && fabs(pti_d_dot(f, u)) < e && fabs(pti_d_dot(r, u)) < e;
}

static void pti_fill_defaults(pt_render_desc *d)
{
    if (d->width == 0) d->width = 256;
    if (d->height == 0) d->height = 256;
    if (d->tile == 0) d->tile = 16;
    if (d->spp == 0 && !(d->seconds > 0 || d->cpu_seconds > 0 || d->target_error > 0)) d->spp = 64;
    if (d->threads == 0) d->threads = pt_hardware_threads();
    if (d->threads > PTI_MAX_THREADS) d->threads = PTI_MAX_THREADS;
}

static int pti_not_negative(double x)
{
    return x >= 0 && pti_finite(x);
}

/* The switch that left a method out, NULL if none did. */
static const char *pti_method_left_out(const char *name)
{
    static const char *const names[6] = {"path-light", "path-plain", "local", "whitted", "distribution", "branching"};
    int k;
    for (k = 0; k < 6; k++)
        if (strcmp(names[k], name) == 0) return k < 2 ? "desc.method was left out: PT_ONLY_PATH" : "desc.method was left out: PT_NO_WHITTED";
    return NULL;
}

/* What is wrong with a desc (its defaults filled in), NULL if nothing. */
static const char *pti_check_desc(const pt_render_desc *d)
{
    const pt_camera *c = &d->camera;
    const pt_li_options *o = &d->li;
    int timed = d->seconds > 0 || d->cpu_seconds > 0 || d->target_error > 0;
    if (d->width < 1 || d->width > 65536) return "desc.width is not in 1..65536";
    if (d->height < 1 || d->height > 65536) return "desc.height is not in 1..65536";
    if (d->tile < 1 || d->tile > 65536) return "desc.tile is not in 1..65536";
    if ((d->width / d->tile + 1.0) * (d->height / d->tile + 1.0) > 2147483647.0) return "desc.tile is too small for the picture";
    if (d->threads < 1) return "desc.threads is negative";
    if (!(c->tan_half > 0) || !pti_finite((double)c->tan_half)) return "desc.camera is not set, or its view is not possible";
    if (!pti_camera_ok(c)) return "desc.camera: position is not finite, or axes are not orthonormal";
    if (!pti_not_negative((double)c->lens_radius)) return "desc.camera.lens_radius is negative or not finite";
    if (!pti_not_negative((double)c->focus_distance)) return "desc.camera.focus_distance is negative or not finite";
    if (!pti_not_negative((double)c->near_distance)) return "desc.camera.near_distance is negative or not finite";
    if (!(d->seconds >= 0)) return "desc.seconds is negative";
    if (!(d->cpu_seconds >= 0)) return "desc.cpu_seconds is negative";
    if (!(d->target_error >= 0)) return "desc.target_error is negative";
    if ((int)d->sampler < 0 || d->sampler >= PT_SAMPLER_GIVEN) return "desc.sampler is not sobol, independent or stratified";
    if (d->sampler == PT_SAMPLER_STRATIFIED && timed) return "the stratified sampler needs a sample count, not a time or error budget";
    if (d->single_net && d->target_error > 0) return "desc.single_net has no error estimate for desc.target_error";
    if (d->first_sample == UINT32_MAX || d->spp > UINT32_MAX - 1 - d->first_sample) return "desc.first_sample + desc.spp is beyond 2^32 - 2";
    if (o->max_edges < 0) return "desc.li.max_edges is negative";
    if (o->roulette_start < 0) return "desc.li.roulette_start is negative";
    if ((int)o->roulette < 0 || o->roulette > PT_ROULETTE_NONE) return "desc.li.roulette is unknown";
    if ((int)o->heuristic < 0 || o->heuristic > PT_HEURISTIC_MAXIMUM) return "desc.li.heuristic is unknown";
    if (!(o->roulette_survival >= 0 && o->roulette_survival < 1)) return "desc.li.roulette_survival is not in [0,1)";
    if (!pti_not_negative((double)o->roulette_scale)) return "desc.li.roulette_scale is negative or not finite";
    if ((int)d->filter < 0 || d->filter > PT_FILTER_GAUSSIAN) return "desc.filter is unknown";
    if (!(d->filter_radius >= 0 && d->filter_radius <= 64)) return "desc.filter_radius is not in [0, 64]";
#if PTI_HAS_WHITTED
    if (o->branching < 0 || o->branching > 1024) return "desc.li.branching is not in 0..1024";
    if (!pti_rgb_finite(o->ambient)) return "desc.li.ambient is not finite";
#endif
    if (o->roulette == PT_ROULETTE_NONE && o->max_edges == 0) return "without roulette desc.li.max_edges must end the paths";
    if (!pt_method_find(d->method)) return pti_method_left_out(d->method) ? pti_method_left_out(d->method) : "desc.method is unknown";
#if PTI_HAS_LPE
    if (o->lpe && !pt_method_find(d->method)->classes) return "desc.li.lpe: this method cannot tell classes of light paths apart";
    if (o->lpe && (o->lpe->class_count < 1 || o->lpe->state_count < 1)) return "desc.li.lpe was not compiled";
#endif
    return NULL;
}

/* How many classes of light paths are wanted. */
static int pti_class_count(const pt_render_desc *d)
{
#if PTI_HAS_LPE
    if (d->li.lpe) return d->li.lpe->class_count;
#endif
    (void)d;
    return 0;
}

/* An empty film is made; a filled one must be of this picture and reach from first_sample without a gap. */
static pt_result pti_prepare_film(pt_film *film, const pt_render_desc *d, uint64_t fingerprint)
{
    pt_result result;
    if (film->half[0] && film->range_count > 0) {
        if (film->fingerprint != fingerprint || film->width != d->width || film->height != d->height) return PT_ERROR_MISMATCH;
        if (film->range_count != 1 || film->ranges[0].begin != d->first_sample) return PT_ERROR_MISMATCH;
        return (film->albedo != NULL) == (d->aov != 0) && film->class_count == pti_class_count(d) ? PT_OK : PT_ERROR_MISMATCH;
    }
    result = pt_film_make(film, d->width, d->height, d->aov);
    if (result == PT_OK && pti_class_count(d) > 0) result = pt_film_make_classes(film, pti_class_count(d));
    film->fingerprint = fingerprint;
    return result;
}

/* The end of the next pass: doubling, cut to what the remaining time is likely to allow. */
static uint32_t pti_next_end(const pt_render_desc *d, uint32_t done, uint32_t made, double wall, double cpu)
{
    uint64_t end = 1, most = d->spp ? d->spp : UINT32_MAX - 1 - d->first_sample;
    double left = HUGE_VAL;
    while (end <= done) end *= 2;
    if (end > most) end = most;
    if (made > 0 && d->seconds > 0) left = (d->seconds - wall) * made / wall;
    if (made > 0 && d->cpu_seconds > 0) left = fmin(left, (d->cpu_seconds - cpu) * made / cpu);
    if (left < (double)(end - done)) end = done + (left > 1 ? (uint64_t)left : 1);
    return (uint32_t)end;
}

/* Which budget is used up after `made` new samples; NULL = none. */
static const char *pti_budget_used(const pti_pass *p, const pt_report *report, uint32_t made)
{
    const pt_render_desc *d = p->desc;
    if (d->spp && report->spp >= d->spp) return "samples";
    if (made == 0) return NULL;
    if (d->seconds > 0 && report->wall_seconds >= d->seconds) return "seconds";
    if (d->cpu_seconds > 0 && report->cpu_seconds >= d->cpu_seconds) return "CPU seconds";
    if (d->target_error > 0 && p->relmse >= 0 && sqrt(p->relmse) < d->target_error) return "error";
    return NULL;
}

/* Renders passes until a budget is used up. */
static pt_result pti_run_passes(pti_pass *p, pt_film *film, pt_report *report)
{
    const pt_render_desc *d = p->desc;
    uint64_t nonfinite = film->nonfinite;
    uint32_t first = pt_film_spp(film), done, end;
    pt_result result = PT_OK;
    report->spp = first;
    while (result == PT_OK && !(report->stopped_by = pti_budget_used(p, report, report->spp - first))) {
        done = report->spp;
        end = pti_next_end(d, done, done - first, report->wall_seconds, report->cpu_seconds);
        if (end <= done) {
            report->stopped_by = "sample indices used up";
            break;
        }
        result = pti_render_pass(p, film, d->first_sample + done, d->first_sample + end);
        report->wall_seconds = pt_wall_seconds() - p->start;
        report->cpu_seconds = pt_cpu_seconds() - p->cpu_start;
        report->rays = p->rays_before;
        report->nonfinite = film->nonfinite - nonfinite;
        if (result == PT_OK) result = pti_report_pass(p, report, film, (end & (end - 1)) == 0);
    }
    if (result == PT_ERROR_MEMORY) report->stopped_by = "memory";
    if (result == PT_ERROR_CANCELLED) report->stopped_by = p->cancel == 2 ? "time, inside a path" : "cancelled";
    if (result == PT_ERROR_CANCELLED && p->cancel == 2) result = PT_OK; /* a budget is no failure */
    if (report->spp > first && result != PT_ERROR_MEMORY && pti_report_pass(p, report, film, 1) != PT_OK) result = PT_ERROR_MEMORY;
    return result;
}

/* Starts a report anew: its rows are kept as room. */
static void pti_report_start(pt_report *r, const pt_render_desc *d)
{
    pt_report old = *r;
    memset(r, 0, sizeof *r);
    r->alloc_user = old.alloc_user;
    r->rows = old.rows;
    r->row_capacity = old.row_capacity;
    r->width = d->width;
    r->height = d->height;
    r->threads = d->parallel ? 0 : PTI_HAS_THREADS ? d->threads : 1;
    r->wall_resolution = pt_wall_resolution();
    r->sampler = pt_sampler_name(d->sampler);
}

/* pt_render after its arguments were found in order. */
static pt_result pti_render(pti_pass *p, pt_film *film, pt_report *report)
{
    const pt_render_desc *d = p->desc;
    const pt_method *method = pt_method_find(d->method);
    pt_film copy = PT_FILM_INIT;
    pt_result result;
#if PTI_HAS_LOCKSTEP
    pti_lockstep lockstep;
#endif
    if (d->sampler == PT_SAMPLER_STRATIFIED) p->planned = d->single_net ? d->first_sample + d->spp : (d->first_sample + d->spp + 1) / 2;
    p->li = pti_pick_instance(method, p->scene, d, &report->body);
#if PTI_HAS_LOCKSTEP
    if (pti_pick_lockstep(method, p->scene, d, &lockstep, &p->technique)) {
        p->lockstep = &lockstep;
        report->body = PTI_WIDTH == 16 ? (lockstep.tree ? "lockstep16-tree" : "lockstep16") : lockstep.tree ? "lockstep8-tree" : "lockstep8";
    }
#endif
    p->options = d->li;
    p->options.poll = pti_poll;
    p->options.poll_user = p;
    p->film = &copy;
    p->relmse = -1;
    p->columns = (d->width + d->tile - 1) / d->tile;
    p->tiles = p->columns * ((d->height + d->tile - 1) / d->tile);
    report->method = method->name;
    report->needs = p->scene->needs;
    result = pti_prepare_film(film, d, pti_fingerprint(p->scene, d, method, report->body, p->planned));
    if (result == PT_ERROR_MISMATCH) report->error = "the film holds another picture, or other samples";
    copy.alloc_user = film->alloc_user;
    if (result == PT_OK) result = pt_film_make(&copy, d->width, d->height, d->aov);
    if (result == PT_OK && film->class_count > 0) result = pt_film_make_classes(&copy, film->class_count);
    if (result == PT_OK) result = pti_run_passes(p, film, report);
    pt_film_free(&copy);
    return result;
}

PTDEF pt_result pt_render(const pt_scene *scene, const pt_render_desc *desc, pt_film *film, pt_report *report)
{
    pt_render_desc d = *desc;
    pt_report own = PT_REPORT_INIT;
    pt_result result = PT_ERROR_ARGUMENT;
    pti_pass p;
    memset(&p, 0, sizeof p);
    own.alloc_user = film->alloc_user;
    if (!report) report = &own;
    pti_fill_defaults(&d);
    pti_report_start(report, &d);
    p.scene = scene;
    p.desc = &d;
    p.start = p.last_call = pt_wall_seconds();
    p.cpu_start = pt_cpu_seconds();
    report->error = pti_check_desc(&d);
    if (!pt_method_find(d.method) && pti_method_left_out(d.method)) result = PT_ERROR_LEFT_OUT;
    if (!scene->committed) {
        result = scene->error != PT_OK ? scene->error : PT_ERROR_NOT_COMMITTED;
        report->error = scene->error != PT_OK ? scene->error_text : pt_result_string(result);
    }
    if (!report->error) result = pti_render(&p, film, report);
    pt_report_free(&own);
    return result;
}

PTDEF void pt_report_free(pt_report *report)
{
    void *user = report->alloc_user;
    pti_free(report->rows, user);
    memset(report, 0, sizeof *report);
    report->alloc_user = user;
}

#if PTI_HAS_STDIO && PTI_HAS_REPORT

static void pti_print_number(FILE *file, double value, int width, int known)
{
    char text[40] = "";
    int i;
    if (known) pti_append_real(text, sizeof text, value);
    else pti_append(text, sizeof text, "unknown");
    fputc(' ', file);
    for (i = (int)strlen(text) + 1; i < width; i++) fputc(' ', file);
    fputs(text, file);
}

PTDEF void pt_report_print(const pt_report *report, FILE *file)
{
    uint32_t i;
    int truth = report->row_count > 0 && report->rows[0].has_true_error;
    fprintf(file, "%s, %s sampler, %s body, %d x %d pixels, ", report->method ? report->method : "no render",
            report->sampler ? report->sampler : "no", report->body ? report->body : "no", report->width, report->height);
    if (report->threads > 0) fprintf(file, "%d thread%s\n", report->threads, report->threads == 1 ? "" : "s");
    else fprintf(file, "the caller's threads\n");
    fprintf(file, "       spp       CPU s      wall s     Mrays/s   est. RMSE  est. relMSE  efficiency%s\n",
            truth ? "   true RMSE true relMSE" : "");
    for (i = 0; i < report->row_count; i++) {
        const pt_report_row *r = &report->rows[i];
        fprintf(file, "%10lu", (unsigned long)r->spp);
        pti_print_number(file, r->cpu_seconds, 12, 1);
        pti_print_number(file, r->wall_seconds, 12, 1);
        pti_print_number(file, r->wall_seconds > 0 ? 1e-6 * (double)r->rays / r->wall_seconds : 0, 12, r->wall_seconds > 0);
        pti_print_number(file, r->error.rmse, 12, r->estimated);
        pti_print_number(file, r->error.relmse, 12, r->estimated);
        pti_print_number(file, r->efficiency, 12, r->efficiency > 0);
        if (truth) pti_print_number(file, r->true_error.rmse, 12, 1);
        if (truth) pti_print_number(file, r->true_error.relmse, 12, 1);
        fputc('\n', file);
    }
    fprintf(file, "stopped by %s at %lu samples per pixel; %lu contributions were not finite\n",
            report->stopped_by ? report->stopped_by : "nothing", (unsigned long)report->spp, (unsigned long)report->nonfinite);
    if (report->wall_resolution > 1e-3) fprintf(file, "this build sees a wall clock of whole seconds only\n");
}

#endif

#if PTI_HAS_FILES && PTI_HAS_REPORT

static void pti_write_real(pti_writer *w, double x)
{
    char text[40] = "";
    pti_append_real(text, sizeof text, x);
    pti_write_text(w, text);
}

PTDEF pt_result pt_report_write_csv(const pt_report *report, const char *path)
{
    pti_writer w;
    uint32_t i;
    int k;
    if (!pti_writer_open(&w, path)) return PT_ERROR_FILE;
    pti_write_text(&w, "method,sampler,width,height,threads,spp,cpu_seconds,wall_seconds,rays,rmse,relmse,relmse_001,"
                       "efficiency,true_rmse,true_relmse,true_relmse_001\n");
    for (i = 0; i < report->row_count; i++) {
        const pt_report_row *r = &report->rows[i];
        double v[14];
        v[0] = report->width; v[1] = report->height; v[2] = report->threads;
        v[3] = r->spp; v[4] = r->cpu_seconds; v[5] = r->wall_seconds; v[6] = (double)r->rays;
        v[7] = r->error.rmse; v[8] = r->error.relmse; v[9] = r->error.relmse_001; v[10] = r->efficiency;
        v[11] = r->true_error.rmse; v[12] = r->true_error.relmse; v[13] = r->true_error.relmse_001;
        pti_write_text(&w, report->method);
        pti_write_text(&w, ",");
        pti_write_text(&w, report->sampler);
        for (k = 0; k < 14; k++) {
            char count[24] = "";
            pti_write_text(&w, ",");
            if ((k >= 7 && k < 10 && !r->estimated) || (k == 10 && !(r->efficiency > 0)) || (k > 10 && !r->has_true_error)) continue;
            if (k < 4 || k == 6) { /* counts keep all their digits */
                pti_append_integer(count, sizeof count, k == 6 ? r->rays : (uint64_t)v[k]);
                pti_write_text(&w, count);
            } else {
                pti_write_real(&w, v[k]);
            }
        }
        pti_write_text(&w, "\n");
    }
    return pti_writer_close(&w, path);
}

/* --- SVG: error against CPU seconds on log-log axes --- */

/* Decades shown, and where they lie in the picture. */
typedef struct pti_axes {
    double x0, x1, y0, y1;  /* log10 of the ends                                                           */
} pti_axes;

#define PTI_SVG_W 640.0
#define PTI_SVG_H 440.0
#define PTI_SVG_LEFT 84.0
#define PTI_SVG_RIGHT 150.0
#define PTI_SVG_TOP 40.0
#define PTI_SVG_BOTTOM 55.0

static double pti_svg_x(const pti_axes *a, double log_x)
{
    return PTI_SVG_LEFT + (log_x - a->x0) / (a->x1 - a->x0) * (PTI_SVG_W - PTI_SVG_LEFT - PTI_SVG_RIGHT);
}
static double pti_svg_y(const pti_axes *a, double log_y)
{
    return PTI_SVG_H - PTI_SVG_BOTTOM - (log_y - a->y0) / (a->y1 - a->y0) * (PTI_SVG_H - PTI_SVG_TOP - PTI_SVG_BOTTOM);
}

/* The point of a row: log10 of CPU seconds and of the square root of relmse; 0 = not known. */
static int pti_svg_point(const pt_report_row *r, double *x, double *y)
{
    double e = r->has_true_error ? r->true_error.relmse : r->estimated ? r->error.relmse : 0;
    if (!(r->cpu_seconds > 0 && e > 0)) return 0;
    *x = log10(r->cpu_seconds);
    *y = 0.5 * log10(e);
    return 1;
}

static pti_axes pti_svg_axes(const pt_report *const *reports, int count)
{
    pti_axes a;
    double x, y;
    uint32_t i;
    int k;
    a.x0 = a.y0 = HUGE_VAL;
    a.x1 = a.y1 = -HUGE_VAL;
    for (k = 0; k < count; k++)
        for (i = 0; i < reports[k]->row_count; i++) {
            if (!pti_svg_point(&reports[k]->rows[i], &x, &y)) continue;
            a.x0 = fmin(a.x0, x);
            a.x1 = fmax(a.x1, x);
            a.y0 = fmin(a.y0, y);
            a.y1 = fmax(a.y1, y);
        }
    if (!(a.x1 >= a.x0)) a.x0 = a.y0 = a.x1 = a.y1 = 0;
    a.x0 = floor(a.x0); /* whole decades */
    a.y0 = floor(a.y0);
    a.x1 = fmax(a.x0 + 1, ceil(a.x1));
    a.y1 = fmax(a.y0 + 1, ceil(a.y1));
    return a;
}

static void pti_svg_number(pti_writer *w, const char *before, double value)
{
    pti_write_text(w, before);
    pti_write_real(w, floor(10 * value + 0.5) / 10);
}

static void pti_svg_line(pti_writer *w, double x0, double y0, double x1, double y1, const char *style)
{
    pti_svg_number(w, "<line x1=\"", x0);
    pti_svg_number(w, "\" y1=\"", y0);
    pti_svg_number(w, "\" x2=\"", x1);
    pti_svg_number(w, "\" y2=\"", y1);
    pti_write_text(w, "\" ");
    pti_write_text(w, style);
    pti_write_text(w, "/>\n");
}

static void pti_svg_escaped(pti_writer *w, const char *text)
{
    for (; *text; text++) {
        if (*text == '<') pti_write_text(w, "&lt;");
        else if (*text == '&') pti_write_text(w, "&amp;");
        else pti_write(w, text, 1);
    }
}

static void pti_svg_text(pti_writer *w, double x, double y, const char *anchor, const char *extra, const char *text)
{
    pti_svg_number(w, "<text x=\"", x);
    pti_svg_number(w, "\" y=\"", y);
    pti_write_text(w, "\" text-anchor=\"");
    pti_write_text(w, anchor);
    pti_write_text(w, "\" ");
    pti_write_text(w, extra);
    pti_write_text(w, ">");
    pti_svg_escaped(w, text);
    pti_write_text(w, "</text>\n");
}

static void pti_svg_grid(pti_writer *w, const pti_axes *a)
{
    double left = PTI_SVG_LEFT, right = PTI_SVG_W - PTI_SVG_RIGHT, top = PTI_SVG_TOP, bottom = PTI_SVG_H - PTI_SVG_BOTTOM, v;
    for (v = a->x0; v <= a->x1; v++) {
        char text[40] = "";
        pti_append_real(text, sizeof text, pow(10, v));
        pti_svg_line(w, pti_svg_x(a, v), top, pti_svg_x(a, v), bottom, "stroke=\"#ddd\"");
        pti_svg_text(w, pti_svg_x(a, v), bottom + 18, "middle", "", text);
    }
    for (v = a->y0; v <= a->y1; v++) {
        char text[40] = "";
        pti_append_real(text, sizeof text, pow(10, v));
        pti_svg_line(w, left, pti_svg_y(a, v), right, pti_svg_y(a, v), "stroke=\"#ddd\"");
        pti_svg_text(w, left - 8, pti_svg_y(a, v) + 4, "end", "", text);
    }
    pti_svg_text(w, (left + right) / 2, PTI_SVG_H - 14, "middle", "", "CPU seconds");
    pti_svg_text(w, 16, (top + bottom) / 2, "middle", "transform=\"rotate(-90 16 212.5)\"", "square root of relMSE");
}

/* A dashed line of slope -1/2 through (x, y), cut to the axes. */
static void pti_svg_slope(pti_writer *w, const pti_axes *a, double x, double y)
{
    double x0 = fmax(a->x0, x - 2 * (a->y1 - y)), x1 = fmin(a->x1, x + 2 * (y - a->y0));
    pti_svg_line(w, pti_svg_x(a, x0), pti_svg_y(a, y - 0.5 * (x0 - x)), pti_svg_x(a, x1), pti_svg_y(a, y - 0.5 * (x1 - x)),
                 "stroke=\"#999\" stroke-dasharray=\"5 4\"");
    pti_svg_text(w, pti_svg_x(a, x1) - 4, pti_svg_y(a, y - 0.5 * (x1 - x)) - 6, "end", "fill=\"#777\"", "slope -1/2");
}

static void pti_svg_curve(pti_writer *w, const pti_axes *a, const pt_report *r, const char *label, int k)
{
    static const char *const colours[8] = {"#1f77b4", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#17becf", "#8c564b", "#7f7f7f"};
    double x, y;
    uint32_t i;
    char style[80] = "fill=\"";
    pti_append(style, sizeof style, colours[k % 8]);
    pti_append(style, sizeof style, "\"");
    pti_write_text(w, "<polyline fill=\"none\" stroke-width=\"2\" stroke=\"");
    pti_write_text(w, colours[k % 8]);
    pti_write_text(w, "\" points=\"");
    for (i = 0; i < r->row_count; i++)
        if (pti_svg_point(&r->rows[i], &x, &y)) {
            pti_svg_number(w, "", pti_svg_x(a, x));
            pti_svg_number(w, ",", pti_svg_y(a, y));
            pti_write_text(w, " ");
        }
    pti_write_text(w, "\"/>\n");
    pti_svg_text(w, PTI_SVG_W - PTI_SVG_RIGHT + 12, PTI_SVG_TOP + 14 + 18 * k, "start", style, label);
}

PTDEF pt_result pt_report_write_svg(const pt_report *const *reports, const char *const *labels, int count,
                                    const char *title, const char *path)
{
    pti_writer w;
    pti_axes a;
    double x = 0, y = 0;
    uint32_t i;
    int k, found = 0;
    if (!reports || count < 1) return PT_ERROR_ARGUMENT;
    if (!pti_writer_open(&w, path)) return PT_ERROR_FILE;
    a = pti_svg_axes(reports, count);
    pti_write_text(&w, "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"640\" height=\"440\" viewBox=\"0 0 640 440\" "
                       "font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"640\" height=\"440\" fill=\"#fff\"/>\n");
    pti_svg_text(&w, PTI_SVG_LEFT, 24, "start", "font-size=\"16\"", title ? title : "error against run time");
    pti_svg_grid(&w, &a);
    for (i = 0; i < reports[0]->row_count && !found; i++) found = pti_svg_point(&reports[0]->rows[i], &x, &y);
    if (found) pti_svg_slope(&w, &a, x, y);
    for (k = 0; k < count; k++) {
        const char *label = labels && labels[k] ? labels[k] : reports[k]->method;
        pti_svg_curve(&w, &a, reports[k], label ? label : "", k);
    }
    pti_write_text(&w, "</svg>\n");
    return pti_writer_close(&w, path);
}

#endif /* PTI_HAS_FILES && PTI_HAS_REPORT */

/* =====================================================================================================
   [PT-19] CANONICAL SCENES: implementation
   =====================================================================================================
   Scenes with a known answer, or known to everybody. Each function says where its numbers come from. */

#if PTI_HAS_SCENES

/* --- the Cornell box: Cornell University Program of Computer Graphics, Cornell Box Data --- */

/* Measured reflectances, 400 to 700 nm in steps of 4 nm: white, green, red. */
#define PTI_WALL_COUNT 76
static const double pti_walls[3][PTI_WALL_COUNT] = {
    {0.343, 0.445, 0.551, 0.624, 0.665, 0.687, 0.708, 0.723, 0.715, 0.710, 0.745, 0.758, 0.739, 0.767,
     0.777, 0.765, 0.751, 0.745, 0.748, 0.729, 0.745, 0.757, 0.753, 0.750, 0.746, 0.747, 0.735, 0.732,
     0.739, 0.734, 0.725, 0.721, 0.733, 0.725, 0.732, 0.743, 0.744, 0.748, 0.728, 0.716, 0.733, 0.726,
     0.713, 0.740, 0.754, 0.764, 0.752, 0.736, 0.734, 0.741, 0.740, 0.732, 0.745, 0.755, 0.751, 0.744,
     0.731, 0.733, 0.744, 0.731, 0.712, 0.708, 0.729, 0.730, 0.727, 0.707, 0.703, 0.729, 0.750, 0.760,
     0.751, 0.739, 0.724, 0.730, 0.740, 0.737},
    {0.092, 0.096, 0.098, 0.097, 0.098, 0.095, 0.095, 0.097, 0.095, 0.094, 0.097, 0.098, 0.096, 0.101,
     0.103, 0.104, 0.107, 0.109, 0.112, 0.115, 0.125, 0.140, 0.160, 0.187, 0.229, 0.285, 0.343, 0.390,
     0.435, 0.464, 0.472, 0.476, 0.481, 0.462, 0.447, 0.441, 0.426, 0.406, 0.373, 0.347, 0.337, 0.314,
     0.285, 0.277, 0.266, 0.250, 0.230, 0.207, 0.186, 0.171, 0.160, 0.148, 0.141, 0.136, 0.130, 0.126,
     0.123, 0.121, 0.122, 0.119, 0.114, 0.115, 0.117, 0.117, 0.118, 0.120, 0.122, 0.128, 0.132, 0.139,
     0.144, 0.146, 0.150, 0.152, 0.157, 0.159},
    {0.040, 0.046, 0.048, 0.053, 0.049, 0.050, 0.053, 0.055, 0.057, 0.056, 0.059, 0.057, 0.061, 0.061,
     0.060, 0.062, 0.062, 0.062, 0.061, 0.062, 0.060, 0.059, 0.057, 0.058, 0.058, 0.058, 0.056, 0.055,
     0.056, 0.059, 0.057, 0.055, 0.059, 0.059, 0.058, 0.059, 0.061, 0.061, 0.063, 0.063, 0.067, 0.068,
     0.072, 0.080, 0.090, 0.099, 0.124, 0.154, 0.192, 0.255, 0.287, 0.349, 0.402, 0.443, 0.487, 0.513,
     0.558, 0.584, 0.620, 0.606, 0.609, 0.651, 0.612, 0.610, 0.650, 0.638, 0.627, 0.620, 0.630, 0.628,
     0.642, 0.639, 0.657, 0.639, 0.635, 0.642}
};

PTDEF pt_spectrum pt_cornell_spectrum(const char *name)
{
    static const double wall_nm[PTI_WALL_COUNT] = {
        400, 404, 408, 412, 416, 420, 424, 428, 432, 436, 440, 444, 448, 452, 456, 460, 464, 468, 472,
        476, 480, 484, 488, 492, 496, 500, 504, 508, 512, 516, 520, 524, 528, 532, 536, 540, 544, 548,
        552, 556, 560, 564, 568, 572, 576, 580, 584, 588, 592, 596, 600, 604, 608, 612, 616, 620, 624,
        628, 632, 636, 640, 644, 648, 652, 656, 660, 664, 668, 672, 676, 680, 684, 688, 692, 696, 700
    };
    static const double lamp_nm[4] = {400, 500, 600, 700}, lamp[4] = {0, 8, 15.6, 18.4};
    static const char *const names[3] = {"white", "green", "red"};
    pt_spectrum s;
    int k;
    s.nm = lamp_nm;
    s.value = lamp;
    s.count = strcmp(name, "lamp") == 0 ? 4 : 0;
    s.zero_outside = 1;
    for (k = 0; k < 3; k++)
        if (strcmp(name, names[k]) == 0) {
            s.nm = wall_nm;
            s.value = pti_walls[k];
            s.count = PTI_WALL_COUNT;
            s.zero_outside = 0;
        }
    return s;
}

PTDEF pt_rgb pt_cornell_rgb(const char *name)
{
    /* Light to RGB as emission, walls to the RGB they have under D65: a renderer of three bands multiplies
       those, which is close to, but not the same as, multiplying spectra. */
    pt_spectrum s = pt_cornell_spectrum(name);
    pt_rgbd c = s.zero_outside ? pt_emission_to_rgb(&s) : pt_reflectance_to_rgb(&s);
    return pt_rgb3((pt_real)c.r, (pt_real)c.g, (pt_real)c.b);
}

/* The 16 quads in mm: four corners, and the wall they are made of (0 white, 1 green, 2 red, 3 lamp). Not all
   are parallelograms, and the red wall is not even flat: each is two triangles. The lamp is lowered from the
   ceiling's 548.8 to 548.79, where it would coincide with it. */
typedef struct pti_cornell_quad {
    pt_real v[12];
    int wall;
} pti_cornell_quad;

#define PTI_CORNELL_ROOM 6
static const pti_cornell_quad pti_cornell_quads[16] = {
    {{PTI_R(552.8), 0, 0, 0, 0, 0, 0, 0, PTI_R(559.2), PTI_R(549.6), 0, PTI_R(559.2)}, 0},
    {{343, PTI_R(548.79), 227, 343, PTI_R(548.79), 332, 213, PTI_R(548.79), 332, 213, PTI_R(548.79), 227}, 3},
    {{556, PTI_R(548.8), 0, 556, PTI_R(548.8), PTI_R(559.2), 0, PTI_R(548.8), PTI_R(559.2), 0, PTI_R(548.8), 0}, 0},
    {{PTI_R(549.6), 0, PTI_R(559.2), 0, 0, PTI_R(559.2), 0, PTI_R(548.8), PTI_R(559.2), 556, PTI_R(548.8), PTI_R(559.2)}, 0},
    {{0, 0, PTI_R(559.2), 0, 0, 0, 0, PTI_R(548.8), 0, 0, PTI_R(548.8), PTI_R(559.2)}, 1},
    {{PTI_R(552.8), 0, 0, PTI_R(549.6), 0, PTI_R(559.2), 556, PTI_R(548.8), PTI_R(559.2), 556, PTI_R(548.8), 0}, 2},
    {{130, 165, 65, 82, 165, 225, 240, 165, 272, 290, 165, 114}, 0},
    {{290, 0, 114, 290, 165, 114, 240, 165, 272, 240, 0, 272}, 0},
    {{130, 0, 65, 130, 165, 65, 290, 165, 114, 290, 0, 114}, 0},
    {{82, 0, 225, 82, 165, 225, 130, 165, 65, 130, 0, 65}, 0},
    {{240, 0, 272, 240, 165, 272, 82, 165, 225, 82, 0, 225}, 0},
    {{423, 330, 247, 265, 330, 296, 314, 330, 456, 472, 330, 406}, 0},
    {{423, 0, 247, 423, 330, 247, 472, 330, 406, 472, 0, 406}, 0},
    {{472, 0, 406, 472, 330, 406, 314, 330, 456, 314, 0, 456}, 0},
    {{314, 0, 456, 314, 330, 456, 265, 330, 296, 265, 0, 296}, 0},
    {{265, 0, 296, 265, 330, 296, 423, 330, 247, 423, 0, 247}, 0}
};

static pt_vec3 pti_at(const pt_real *v)
{
    return pt_v3(v[0], v[1], v[2]);
}

/* The first `count` quads, and the camera. */
static void pti_cornell_build(pt_scene *scene, pt_camera *camera, int count)
{
    int material[4], i;
    pt_material lamp = pt_material_diffuse(pt_rgb_grey(PTI_R(0.78)));
    lamp.emission = pt_cornell_rgb("lamp");
    material[0] = pt_add_material(scene, pt_material_diffuse(pt_cornell_rgb("white")));
    material[1] = pt_add_material(scene, pt_material_diffuse(pt_cornell_rgb("green")));
    material[2] = pt_add_material(scene, pt_material_diffuse(pt_cornell_rgb("red")));
    material[3] = pt_add_material(scene, lamp);
    for (i = 0; i < count; i++) {
        const pti_cornell_quad *q = &pti_cornell_quads[i];
        pt_add_quad(scene, pti_at(q->v), pti_at(q->v + 3), pti_at(q->v + 6), pti_at(q->v + 9), material[q->wall]);
    }
    /* film 25 mm square behind a lens of 35 mm */
    *camera = pt_camera_look_at(pt_v3(278, 273, -800), pt_v3(278, 273, 0), pt_v3(0, 1, 0),
                                (pt_real)pt_vfov_deg_of_film(0.025, 0.035));
}

PTDEF pt_result pt_scene_cornell(pt_scene *scene, pt_camera *camera)
{
    pti_cornell_build(scene, camera, 16);
    return pt_commit(scene);
}

PTDEF pt_result pt_scene_cornell_empty(pt_scene *scene, pt_camera *camera)
{
    pti_cornell_build(scene, camera, PTI_CORNELL_ROOM);
    return pt_commit(scene);
}

PTDEF pt_result pt_scene_cornell_spheres(pt_scene *scene, pt_camera *camera)
{
    pti_cornell_build(scene, camera, PTI_CORNELL_ROOM);
    pt_add_sphere(scene, pt_v3(390, 100, 370), 100, pt_add_material(scene, pt_material_mirror(pt_rgb_grey(PTI_R(0.98)))));
    pt_add_sphere(scene, pt_v3(165, 100, 190), 100, pt_add_material(scene, pt_material_dielectric(PTI_R(1.5))));
    return pt_commit(scene);
}

/* --- scenes with closed forms --- */

PTDEF pt_result pt_scene_furnace(pt_scene *scene, pt_camera *camera)
{
    pt_material wall = pt_material_diffuse(pt_rgb_grey(PTI_R(0.5)));
    int m, k;
    wall.emission = pt_rgb_grey(1);
    m = pt_add_material(scene, wall);
    for (k = 0; k < 6; k++) { /* axis k % 3, side k / 3; edge1 x edge2 points inwards */
        pt_real side = k < 3 ? PTI_R(-0.5) : PTI_R(0.5), c[3], a[3] = {0, 0, 0}, b[3] = {0, 0, 0};
        int axis = k % 3;
        c[0] = c[1] = c[2] = PTI_R(-0.5);
        c[axis] = side;
        a[(axis + (k < 3 ? 1 : 2)) % 3] = 1;
        b[(axis + (k < 3 ? 2 : 1)) % 3] = 1;
        pt_add_parallelogram(scene, pti_at(c), pti_at(a), pti_at(b), m);
    }
    *camera = pt_camera_look_at(pt_v3(0, 0, PTI_R(0.4)), pt_v3(0, 0, -1), pt_v3(0, 1, 0), 60);
    return pt_commit(scene);
}

PTDEF pt_result pt_scene_diffuse_sphere(pt_scene *scene, pt_camera *camera)
{
    int m = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey(PTI_R(0.5))));
    pt_add_sphere(scene, pt_v3(0, 0, 0), 1, m);
    pt_add_point_light(scene, pt_v3(PTI_R(0.6), PTI_R(0.2), PTI_R(-0.3)), pt_rgb_grey((pt_real)(1 / (4 * PT_PI))));
    *camera = pt_camera_look_at(pt_v3(0, 0, PTI_R(0.9)), pt_v3(PTI_R(0.3), 0, -1), pt_v3(0, 1, 0), 70);
    return pt_commit(scene);
}

PTDEF pt_result pt_scene_glass_ball(pt_scene *scene, pt_camera *camera)
{
    int floor_material = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey(PTI_R(0.8))));
    int glass = pt_add_material(scene, pt_material_dielectric(PTI_R(1.5)));
    int lamp = pt_add_material(scene, pt_material_emitter(pt_rgb_grey(200)));
    pt_add_parallelogram(scene, pt_v3(-4, 0, -4), pt_v3(0, 0, 8), pt_v3(8, 0, 0), floor_material);
    pt_add_sphere(scene, pt_v3(0, PTI_R(0.5), 0), PTI_R(0.4), glass);
    pt_add_sphere(scene, pt_v3(PTI_R(1.5), 3, 0), PTI_R(0.1), lamp);
    *camera = pt_camera_look_at(pt_v3(0, PTI_R(1.2), PTI_R(3.2)), pt_v3(0, PTI_R(0.3), 0), pt_v3(0, 1, 0), 40);
    return pt_commit(scene);
}

/* K. Beason, smallpt. Its eye is outside the box: rays start at 140 along the view, behind the front wall. The
   picture is 0.5135 high at distance 1. */
PTDEF pt_result pt_scene_smallpt(pt_scene *scene, pt_camera *camera)
{
    static const struct {
        double x, y, z, r, red, green, blue;
        int kind; /* 0 diffuse, 1 mirror, 2 glass, 3 lamp */
    } s[9] = {{1e5 + 1, 40.8, 81.6, 1e5, 0.75, 0.25, 0.25, 0},  {-1e5 + 99, 40.8, 81.6, 1e5, 0.25, 0.25, 0.75, 0},
              {50, 40.8, 1e5, 1e5, 0.75, 0.75, 0.75, 0},        {50, 40.8, -1e5 + 170, 1e5, 0, 0, 0, 0},
              {50, 1e5, 81.6, 1e5, 0.75, 0.75, 0.75, 0},        {50, -1e5 + 81.6, 81.6, 1e5, 0.75, 0.75, 0.75, 0},
              {27, 16.5, 47, 16.5, 0.999, 0.999, 0.999, 1},     {73, 16.5, 78, 16.5, 0.999, 0.999, 0.999, 2},
              {50, 681.6 - 0.27, 81.6, 600, 12, 12, 12, 3}};
    pt_vec3 eye = pt_v3(50, 52, PTI_R(295.6)), d = pt_v3(0, PTI_R(-0.042612), -1);
    int i;
    for (i = 0; i < 9; i++) {
        pt_rgb c = pt_rgb3((pt_real)s[i].red, (pt_real)s[i].green, (pt_real)s[i].blue);
        pt_material m = s[i].kind == 1   ? pt_material_mirror(c)
                        : s[i].kind == 2 ? pt_material_dielectric(PTI_R(1.5))
                        : s[i].kind == 3 ? pt_material_emitter(c)
                                         : pt_material_diffuse(c);
        pt_add_sphere(scene, pt_v3((pt_real)s[i].x, (pt_real)s[i].y, (pt_real)s[i].z), (pt_real)s[i].r,
                      pt_add_material(scene, m));
    }
    *camera = pt_camera_look_at(eye, pt_v3_add(eye, d), pt_v3(0, 1, 0), (pt_real)pt_vfov_deg_of_film(0.5135, 1));
    camera->near_distance = 140;
    return pt_commit(scene);
}

/* Four spheres of equal power and four plates of rising roughness; after E. Veach and L. Guibas, 1995, with the
   positions of S. Marschner's reconstruction. The plates are aluminium; alpha = roughness^2. */
PTDEF pt_result pt_scene_veach_plates(pt_scene *scene, pt_camera *camera)
{
    static const struct {
        double x, y, z, r, emission;
    } lamp[5] = {{-3.75, 0, 0, 0.03333, 901.803}, {-1.25, 0, 0, 0.1, 100}, {1.25, 0, 0, 0.3, 11.1111}, {3.75, 0, 0, 0.9, 1.23457}, {0, 4, 3, 1, 1}};
    static const double plate[4][5] = {{-2.70651, 0.25609, -2.08375, -0.526323, 0.005}, /* y, z of both edges, alpha */
                                       {-3.28825, 1.36972, -2.83856, 0.476536, 0.02},
                                       {-3.73096, 2.70046, -3.43378, 1.74564, 0.05},
                                       {-3.99615, 4.0667, -3.82069, 3.08221, 0.1}};
    int dark = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey(PTI_R(0.1)))), i;
    for (i = 0; i < 5; i++)
        pt_add_sphere(scene, pt_v3((pt_real)lamp[i].x, (pt_real)lamp[i].y, (pt_real)lamp[i].z), (pt_real)lamp[i].r,
                      pt_add_material(scene, pt_material_emitter(pt_rgb_grey((pt_real)lamp[i].emission))));
    for (i = 0; i < 4; i++) {
        pt_material m = pti_material_of_kind(PT_MATERIAL_CONDUCTOR, pt_rgb_grey(1));
        m.eta = pt_rgb3(PTI_R(1.66), PTI_R(0.88), PTI_R(0.52));
        m.k = pt_rgb3(PTI_R(9.22), PTI_R(6.27), PTI_R(4.84));
        m.roughness = (pt_real)sqrt(plate[i][4]);
        pt_add_parallelogram(scene, pt_v3(-4, (pt_real)plate[i][0], (pt_real)plate[i][1]), pt_v3(8, 0, 0),
                             pt_v3(0, (pt_real)(plate[i][2] - plate[i][0]), (pt_real)(plate[i][3] - plate[i][1])), pt_add_material(scene, m));
    }
    pt_add_parallelogram(scene, pt_v3(-10, PTI_R(-4.14615), -10), pt_v3(0, 0, 30), pt_v3(20, 0, 0), dark);
    pt_add_parallelogram(scene, pt_v3(-10, -10, -2), pt_v3(20, 0, 0), pt_v3(0, 20, 0), dark);
    *camera = pt_camera_look_at(pt_v3(0, 6, PTI_R(27.5)), pt_v3(0, PTI_R(-1.5), PTI_R(2.5)), pt_v3(0, 1, 0), PTI_R(16.8));
    return pt_commit(scene);
}

/* A room with a glossy floor, a mirror and a glass sphere; measures after I. Georgiev, SmallVCM, with y up. */
PTDEF pt_result pt_scene_glossy_box(pt_scene *scene, pt_camera *camera)
{
    const pt_real x0 = PTI_R(-1.27029), x1 = PTI_R(1.28975), y0 = PTI_R(-1.28002), y1 = PTI_R(1.28002), z0 = PTI_R(-1.30455), z1 = PTI_R(1.25549);
    const pt_real high = PTI_R(0.803922), low = PTI_R(0.156863), lamp_y = PTI_R(1.26002), q = PTI_R(0.25);
    pt_material m = pti_material_of_kind(PT_MATERIAL_PHONG, pt_rgb_grey(PTI_R(0.1)));
    int white = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey(high))), glossy;
    m.specular = pt_rgb_grey(PTI_R(0.7));
    m.exponent = 90;
    glossy = pt_add_material(scene, m);
    pt_add_parallelogram(scene, pt_v3(x0, y0, z0), pt_v3(0, 0, z1 - z0), pt_v3(x1 - x0, 0, 0), glossy);
    pt_add_parallelogram(scene, pt_v3(x0, y1, z0), pt_v3(x1 - x0, 0, 0), pt_v3(0, 0, z1 - z0), white);
    pt_add_parallelogram(scene, pt_v3(x0, y0, z0), pt_v3(x1 - x0, 0, 0), pt_v3(0, y1 - y0, 0),
                         pt_add_material(scene, pt_material_diffuse(pt_rgb3(low, PTI_R(0.172549), high))));
    pt_add_parallelogram(scene, pt_v3(x0, y0, z0), pt_v3(0, y1 - y0, 0), pt_v3(0, 0, z1 - z0),
                         pt_add_material(scene, pt_material_diffuse(pt_rgb3(low, high, PTI_R(0.172549)))));
    pt_add_parallelogram(scene, pt_v3(x1, y0, z0), pt_v3(0, 0, z1 - z0), pt_v3(0, y1 - y0, 0),
                         pt_add_material(scene, pt_material_diffuse(pt_rgb3(high, PTI_R(0.152941), PTI_R(0.152941)))));
    pt_add_sphere(scene, pt_v3(PTI_R(-0.53885), y0 + PTI_R(0.5), PTI_R(-0.02453)), PTI_R(0.5), pt_add_material(scene, pt_material_mirror(pt_rgb_grey(1))));
    pt_add_sphere(scene, pt_v3(PTI_R(0.55831), y0 + PTI_R(0.5), PTI_R(-0.02453)), PTI_R(0.5), pt_add_material(scene, pt_material_dielectric(PTI_R(1.6))));
    pt_add_parallelogram(scene, pt_v3(-q, lamp_y, -q), pt_v3(2 * q, 0, 0), pt_v3(0, 0, 2 * q), /* normal down */
                         pt_add_material(scene, pt_material_emitter(pt_rgb_grey(PTI_R(25.0333)))));
    *camera = pt_camera_look_at(pt_v3(PTI_R(-0.0439815), PTI_R(0.222539), PTI_R(4.12529)),
                                pt_v3(PTI_R(-0.0370953), PTI_R(0.1683229), PTI_R(3.126785)), pt_v3(0, 1, 0), 45);
    return pt_commit(scene);
}

/* The caustic of a ring that mirrors inside: light from far away forms a nephroid on the floor, its cusp half a
   radius from the axis. The lamp is a sphere 8 away, 7 degrees wide, so that paths from the eye can hit it. */
PTDEF pt_result pt_scene_caustic_ring(pt_scene *scene, pt_camera *camera)
{
    enum { SEGMENTS = 512 };
    pt_vec3 position[2 * SEGMENTS], normal[2 * SEGMENTS];
    uint32_t index[6 * SEGMENTS], i;
    int mirror = pt_add_material(scene, pt_material_mirror(pt_rgb_grey(PTI_R(0.95))));
    int floor_material = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey(PTI_R(0.7))));
    for (i = 0; i < SEGMENTS; i++) {
        double phi = 2 * PT_PI * i / (double)SEGMENTS;
        uint32_t a = 2 * i, b = 2 * ((i + 1) % SEGMENTS), *t = index + 6 * i;
        position[a] = pt_v3((pt_real)cos(phi), 0, (pt_real)sin(phi));
        position[a + 1] = pt_v3(position[a].x, PTI_R(0.4), position[a].z);
        normal[a] = normal[a + 1] = pt_v3(-position[a].x, 0, -position[a].z);
        t[0] = a; t[1] = b; t[2] = a + 1;
        t[3] = b; t[4] = b + 1; t[5] = a + 1;
    }
    pt_add_mesh(scene, position, normal, NULL, 2 * SEGMENTS, index, 2 * SEGMENTS, mirror);
    pt_add_parallelogram(scene, pt_v3(-3, 0, -3), pt_v3(0, 0, 6), pt_v3(6, 0, 0), floor_material);
    pt_add_sphere(scene, pt_v3(PTI_R(-7.15542), PTI_R(3.57771), 0), PTI_R(0.5), pt_add_material(scene, pt_material_emitter(pt_rgb_grey(250))));
    *camera = pt_camera_look_at(pt_v3(0, PTI_R(3.4), PTI_R(2.2)), pt_v3(0, 0, PTI_R(0.1)), pt_v3(0, 1, 0), 40);
    return pt_commit(scene);
}

#if PTI_HAS_ENVIRONMENT
/* Water (index 1.33) one deep over a diffuse floor (albedo 1/2) under a sky of radiance 1; side walls that mirror
   make it endless. Seen at an angle of incidence with Fresnel reflectance F the radiance is exactly
   F + (1-F)/n^2 albedo (1 - Rd) / (1 - albedo Rd'), Rd and Rd' the diffuse reflectances from above and below. */
PTDEF pt_result pt_scene_pool(pt_scene *scene, pt_camera *camera)
{
    int bottom = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey(PTI_R(0.5))));
    int water = pt_add_material(scene, pt_material_dielectric(PTI_R(1.33)));
    int wall = pt_add_material(scene, pt_material_mirror(pt_rgb_grey(1)));
    pt_add_parallelogram(scene, pt_v3(-2, -1, -2), pt_v3(0, 0, 4), pt_v3(4, 0, 0), bottom);
    pt_add_parallelogram(scene, pt_v3(-2, 0, -2), pt_v3(0, 0, 4), pt_v3(4, 0, 0), water);
    pt_add_parallelogram(scene, pt_v3(-2, -1, -2), pt_v3(4, 0, 0), pt_v3(0, 1, 0), wall);
    pt_add_parallelogram(scene, pt_v3(-2, -1, 2), pt_v3(4, 0, 0), pt_v3(0, 1, 0), wall);
    pt_add_parallelogram(scene, pt_v3(-2, -1, -2), pt_v3(0, 0, 4), pt_v3(0, 1, 0), wall);
    pt_add_parallelogram(scene, pt_v3(2, -1, -2), pt_v3(0, 0, 4), pt_v3(0, 1, 0), wall);
    pt_set_environment(scene, pt_rgb_grey(1));
    *camera = pt_camera_look_at(pt_v3(0, PTI_R(0.5), PTI_R(1.9)), pt_v3(0, 0, PTI_R(0.6)), pt_v3(0, 1, 0), 50);
    return pt_commit(scene);
}

#if PTI_HAS_TEXTURES
/* Every material as a sphere, on a checkered floor under a sky with a sun. */
PTDEF pt_result pt_scene_materials(pt_scene *scene, pt_camera *camera)
{
    enum { WIDTH = 64, HEIGHT = 32, COUNT = 10 };
    static const pt_texture checker = {PT_TEXTURE_CHECKER, NULL, 0, 0, {80, 80}, {PTI_R(0.25), PTI_R(0.25), PTI_R(0.25)},
                                       {PTI_R(0.75), PTI_R(0.75), PTI_R(0.75)}, NULL, NULL};
    static const double gold[6] = {0.143, 0.374, 1.442, 3.983, 2.386, 1.603};
    static const struct {
        pt_material_kind kind;
        double roughness, specular, exponent;
        double colour[3];
    } list[COUNT] = {{PT_MATERIAL_DIFFUSE, 0, 0, 0, {0.6, 0.15, 0.1}},       {PT_MATERIAL_OREN_NAYAR, 0.6, 0, 0, {0.6, 0.15, 0.1}},
                     {PT_MATERIAL_PHONG, 0, 0.4, 60, {0.1, 0.25, 0.5}},      {PT_MATERIAL_BLINN, 0, 0.4, 240, {0.1, 0.25, 0.5}},
                     {PT_MATERIAL_COAT, 0, 0, 0, {0.05, 0.4, 0.15}},         {PT_MATERIAL_MIRROR, 0, 0, 0, {0.95, 0.95, 0.95}},
                     {PT_MATERIAL_CONDUCTOR, 0.15, 0, 0, {1, 1, 1}},         {PT_MATERIAL_CONDUCTOR, 0.55, 0, 0, {1, 1, 1}},
                     {PT_MATERIAL_DIELECTRIC, 0, 0, 0, {0, 0, 0}},           {PT_MATERIAL_DIELECTRIC, 0.4, 0, 0, {0, 0, 0}}};
    float sky[3 * WIDTH * HEIGHT];
    pt_material floor_material = pt_material_diffuse(pt_rgb_grey(1));
    int x, y, i;
    for (y = 0; y < HEIGHT; y++)
        for (x = 0; x < WIDTH; x++) {
            float *c = sky + 3 * (y * WIDTH + x), up = 1 - 2 * (float)y / (float)HEIGHT;
            c[0] = up > 0 ? 0.5f + 0.1f * (1 - up) : 0.15f;
            c[1] = up > 0 ? 0.65f + 0.1f * (1 - up) : 0.14f;
            c[2] = up > 0 ? 0.95f : 0.12f;
            if (y >= 7 && y <= 9 && x >= 12 && x <= 15) c[0] = c[1] = c[2] = 20; /* a hazy sun to the left behind the camera */
        }
    pt_set_environment_image(scene, sky, WIDTH, HEIGHT, 1);
    floor_material.texture = &checker;
    pt_add_parallelogram(scene, pt_v3(-40, 0, -60), pt_v3(0, 0, 80), pt_v3(80, 0, 0), pt_add_material(scene, floor_material));
    for (i = 0; i < COUNT; i++) {
        pt_material m = pti_material_of_kind(list[i].kind, pt_rgb3((pt_real)list[i].colour[0], (pt_real)list[i].colour[1], (pt_real)list[i].colour[2]));
        m.roughness = (pt_real)list[i].roughness;
        m.specular = pt_rgb_grey((pt_real)list[i].specular);
        m.exponent = (pt_real)list[i].exponent;
        m.ior = PTI_R(1.5);
        m.eta = pt_rgb3((pt_real)gold[0], (pt_real)gold[1], (pt_real)gold[2]);
        m.k = pt_rgb3((pt_real)gold[3], (pt_real)gold[4], (pt_real)gold[5]);
        pt_add_sphere(scene, pt_v3((pt_real)(1.15 * (i % 5 - 2)), PTI_R(0.5), (pt_real)(1.3 * (i / 5) - 0.4)), PTI_R(0.5), pt_add_material(scene, m));
    }
    *camera = pt_camera_look_at(pt_v3(0, PTI_R(3.2), PTI_R(6.5)), pt_v3(0, PTI_R(0.35), PTI_R(0.1)), pt_v3(0, 1, 0), 40);
    return pt_commit(scene);
}
#endif
#endif

PTDEF const pt_scene_entry *pt_scenes(int *count)
{
    static const pt_scene_entry scenes[] = {
        {"cornell", "the Cornell box from its measured data", pt_scene_cornell},
        {"cornell-empty", "the Cornell box without its blocks", pt_scene_cornell_empty},
        {"cornell-spheres", "the Cornell box with a mirror and a glass sphere", pt_scene_cornell_spheres},
        {"furnace", "closed box, emission 1, albedo 1/2: radiance 2", pt_scene_furnace},
        {"diffuse-sphere", "point light in a diffuse sphere: uniform indirect light", pt_scene_diffuse_sphere},
        {"glass-ball", "caustic of a glass ball under a small lamp", pt_scene_glass_ball},
        {"smallpt", "smallpt's box: walls are spheres of radius 1e5", pt_scene_smallpt},
        {"veach-plates", "four lamps in four plates: light sampling, BSDF sampling, both", pt_scene_veach_plates},
        {"glossy-box", "glossy floor, mirror and glass; caustics found by hitting the lamp only", pt_scene_glossy_box},
        {"caustic-ring", "nephroid in a mirror ring; found by hitting the lamp only", pt_scene_caustic_ring},
#if PTI_HAS_ENVIRONMENT
        {"pool", "water over a diffuse floor under a uniform sky: exact at every angle", pt_scene_pool},
#if PTI_HAS_TEXTURES
        {"materials", "every material under a sky with a sun", pt_scene_materials},
#endif
#endif
    };
    *count = (int)(sizeof scenes / sizeof scenes[0]);
    return scenes;
}

PTDEF const pt_scene_entry *pt_scene_find(const char *name)
{
    int count, i;
    const pt_scene_entry *s = pt_scenes(&count);
    for (i = 0; name && i < count; i++)
        if (strcmp(s[i].name, name) == 0) return &s[i];
    return NULL;
}

#endif /* PTI_HAS_SCENES */

#ifdef __cplusplus
}
#endif

#endif /* PATHTRACER_IMPLEMENTATION */

/*
   VERSION HISTORY

   0.6.4 (2026-11-23)  rooms whose walls are huge spheres are rendered in lockstep without a tree: smallpt's box in 0.2 of the
                       time with AVX-512, 0.45 with SSE2.
   0.6.3 (2026-11-23)  spheres seen from inside are tried in the order of their far walls, and lockstep without lanes of walls
                       ends paths as early as one path at a time does: smallpt's box in 0.45 of the time.
   0.6.2 (2026-11-23)  the wide tree sorts short lists instead of binning them: 3 to 15 % less memory, rays of a room in 0.85
                       to 0.95 of the time; it is built in 0.85 to 0.9 of the time with AVX2, 0.6 with SSE2.
   0.6.1 (2026-11-23)  the wide tree computes what a ray hits in double once, when nothing nearer is left, and shadow rays
                       begin with large primitives: the same hits, for the rays of a room in 0.8 to 0.95 of the time.
   0.6.0 (2026-11-23)  lockstep asks for the walls of a room in lanes, and the tree only for what is not a wall: meshes in
                       rooms take about 0.6 of the time.
   0.5.1 (2026-11-22)  lockstep mended: mirrors and glass seen from behind their shading normals, pictures that hung on
                       the size of tiles by a bit, rooms below 1e-15, small lamps far off.
   0.5.0 (2026-11-22)  paths walk in lockstep in scenes of any size, with metal, rough and smooth, and shading normals.
   0.4.0 (2026-11-22)  SIMD lanes (PT_NO_SIMD and PT_NO_INTRINSICS leave them out): a wide tree of eight children a node,
                       built on several threads, and lanes for small scenes find the same hits faster (scene.tree chooses);
                       small scenes of diffuse surfaces, mirrors and glass are rendered by paths that walk in lockstep
                       (desc.no_lockstep); li.roulette_scale; pt_parallel_fn stands with the threads, since pt_commit uses
                       it, too.
   0.3.0 (2026-11-22)  models (pt_load_obj: OBJ with MTL and textures), PNG and all PPM read, film files with a checksum
                       (pt_film_write, pt_film_read), PPM of four kinds, files synced before they are renamed; rays keep
                       the digits that float loses, so that nothing leaks far from the origin; x87 is refused.
   0.2.0 (2026-11-22)  what the lecture names up to importance sampling: GGX metal and glass, measured eta and k,
                       Phong, Blinn-Phong, Oren-Nayar, coat, MERL tables and a virtual gonioreflectometer, textures;
                       spot, parallel and image environment light; pixel filters; local, Whitted, distribution and
                       branching methods; light-path expressions; five more scenes. pt_light_pdf_w takes the
                       direction; pt_point_light is pt_delta_light.
   0.1.0 (2026-11-22)  first version: path tracing (plain, light sampling, MIS) of diffuse, mirror and glass
                       surfaces under area, point and constant environment lights; four samplers; error
                       against run time in every report; Cornell box and six more scenes.

   LICENCE: this software is available under two licences; choose the one you prefer.

   A. MIT No Attribution (MIT-0)

   Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated
   documentation files (the "Software"), to deal in the Software without restriction, including without
   limitation the rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the
   Software, and to permit persons to whom the Software is furnished to do so.

   THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED
   TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL
   THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF
   CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER
   DEALINGS IN THE SOFTWARE.

   B. Public domain

   This is free and unencumbered software released into the public domain. Anyone is free to copy, modify,
   publish, use, compile, sell, or distribute this software, either in source code form or as a compiled binary,
   for any purpose, commercial or non-commercial, and by any means.

   The Sobol direction numbers of two dimensions in [PT-02] follow S. Joe and F. Y. Kuo (new-joe-kuo-6), whose
   notice reads: Copyright (c) 2008, Frances Y. Kuo and Stephen Joe. All rights reserved. Redistribution and
   use in source and binary forms, with or without modification, are permitted under the three-clause BSD
   conditions; provided as is, without warranty.
*/
