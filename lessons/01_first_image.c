/* Lesson 01: the first image

   QUESTION   How does a list of shapes become a picture?

   IDEA       One ray for each pixel, backwards, from the eye of a camera into the scene. It asks each shape for an
              intersection, and the nearest one in front of the eye decides what the pixel shows. With h the
              vertical field of view and a the width of the picture over its height:

                  ray         o + t d,  d = forward + x a tan(h/2) right + y tan(h/2) up,  x, y in [-1, 1]
                  sphere      |o + t d - c|^2 = r^2, c its centre.  If |d| = 1:  t = -b - sqrt(b^2 - q),
                              b = d.(o-c),  q = |o-c|^2 - r^2
                  triangle    o + t d = v0 + u e1 + v e2  with u, v >= 0, u + v <= 1 (v0 a corner): Cramer's rule

              Row 0 of a picture is its top, so y falls while the row rises. Light is computed in linear numbers; a
              file holds sRGB codes, a curve close to a power of 1/2.2 (gamma correction): half the light has code
              188, not 128. How much of the picture does a shape cover? The image plane at distance 1 shows the area
              4 a tan^2(h/2). A ball of radius r at distance s, on the axis, is a circle of radius r / sqrt(s^2 - r^2)
              there; a triangle parallel to the plane at distance z is 1/z as wide and as high, so its area is divided
              by z^2. Here h = 40 degrees, a = 320/240, r = 1, s = z = 5, the triangle 1 wide and 2.25 high: of 0.7065
              they cover pi/24 and 0.045, shares of 0.1853 and 0.06369, and counting random rays must give them.

   PICTURE    Triangle and ball, coloured by their normals: red, green and blue are x, y and z, -1 dark and 1 bright.

   BUILD      cc -O2 -I.. 01_first_image.c -o 01_first_image -lm -pthread
   RUN        ./01_first_image [samples] [output]

   PRINTS     shape            samples     estimate        exact  std.error  seconds
              my ball             1024     0.189453     0.185271      0.012    0.000
              my ball            16384     0.185852     0.185271      0.003    0.001
              my ball           262144     0.185291     0.185271    0.00076    0.014

   WORDS      ray 光线; camera 相机; pixel 像素; image plane 像平面; sphere 球; triangle 三角形; intersection 求交;
              normal 法线; gamma correction 伽马校正

   HEADER     [PT-01] pt_srgb_byte, [PT-06] pt_intersect_sphere, pt_intersect_triangle, [PT-10] pt_camera_ray,
              [PT-17] pt_write_ppm_bytes, pt_write_png_bytes

   SOURCES    Moeller, Trumbore: Fast, Minimum Storage Ray/Triangle Intersection, 1997; [Hai19] and [Woo13]:
              what the header does, because b^2 - q loses its digits for small balls far away and because two
              triangles that share an edge must leave no gap; IEC 61966-2-1 (sRGB)

   Before: nothing. Next: lesson 02, local lighting. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { WIDTH = 320, HEIGHT = 240, MISTAKE = EX == 2 || EX == 3 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact,
           pt_stats_standard_error(s), seconds);
}

/* ---- mine ---- */

static const double vfov = EX == 1 ? 60 : 40; /* degrees from the bottom of the picture to its top */
static const pt_vec3 eye = {0, 0, 5};         /* looks along -z */
static const pt_vec3 corner[3] = {{-2.25, -1, 0}, {-1.25, -1, 0}, {-1.75, 1.25, 0}};

/* The ray through image point (x, y), both in [0, 1], y = 0 at the top. Right is +x, up is +y. */
static pt_ray my_camera_ray(double x, double y)
{
    double half = tan(vfov * PT_PI / 360), aspect = (double)WIDTH / HEIGHT;
    pt_ray ray;
    ray.o = eye;
    ray.d = pt_v3_normalize(pt_v3((pt_real)((2 * x - 1) * aspect * half), (pt_real)((1 - 2 * y) * half), -1));
    ray.tmax = (pt_real)1e30;
    return ray;
}

/* The ball around the origin with radius 1. d has length 1, so the quadratic equation begins with t^2. */
static int my_ball(const pt_ray *ray, double *t)
{
    double b = (double)pt_v3_dot(ray->d, ray->o), q = (double)pt_v3_dot(ray->o, ray->o) - 1;
    double root = b * b - q;
    if (root < 0) return 0; /* the line passes by */
    root = sqrt(root);
    *t = -b - root;                           /* where it enters ... */
    if (*t <= 0 || EX == 2) *t = -b + root;   /* ... or, from inside, where it leaves */
    return *t > 0;
}

/* Cramer's rule for o + t d = v0 + u e1 + v e2, with the determinants written as dot and cross products. */
static int my_triangle(const pt_ray *ray, double *t)
{
    pt_vec3 e1 = pt_v3_sub(corner[1], corner[0]), e2 = pt_v3_sub(corner[2], corner[0]);
    pt_vec3 s = pt_v3_sub(ray->o, corner[0]), p = pt_v3_cross(ray->d, e2), q = pt_v3_cross(s, e1);
    double det = (double)pt_v3_dot(p, e1), u, v;
    if (det == 0) return 0; /* seen edge-on */
    u = (double)pt_v3_dot(p, s) / det;
    v = (double)pt_v3_dot(q, ray->d) / det;
    *t = (double)pt_v3_dot(q, e2) / det;
    return u >= 0 && v >= 0 && u + v <= 1 && *t > 0;
}

/* Linear light to an 8-bit code: straight near black, a power above. */
static unsigned char my_srgb_byte(double x)
{
    double code = EX == 3 ? x : x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
    return (unsigned char)(255 * fmin(fmax(code, 0), 1) + 0.5);
}

/* A picture is three bytes a pixel, row by row from the top, behind a line of text: the format PPM. */
static int my_write_ppm(const char *path, const unsigned char *rgb)
{
    FILE *file = fopen(path, "wb");
    size_t written;
    if (!file) return 0;
    fprintf(file, "P6\n%d %d\n255\n", WIDTH, HEIGHT);
    written = fwrite(rgb, 3, WIDTH * HEIGHT, file);
    return fclose(file) == 0 && written == WIDTH * HEIGHT;
}

/* ---- both ---- */

/* Which shape a ray meets first, 0 none, 1 ball, 2 triangle, by my functions or the header's; and where. */
static int nearest(const pt_ray *ray, int mine, double *t)
{
    double flat = 0, b[2];
    int ball = mine ? my_ball(ray, t) : pt_intersect_sphere(ray, pt_v3(0, 0, 0), 1, t);
    int triangle = mine ? my_triangle(ray, &flat)
                        : pt_intersect_triangle(ray, corner[0], corner[1], corner[2], &flat, b);
    if (!triangle || (ball && *t < flat)) return ball;
    *t = flat;
    return 2;
}

/* The share of the picture that shape 1 or 2 covers, by n random rays: a table row for each n. */
static void table(const char *name, int shape, int mine, double exact, double most)
{
    pt_camera camera = pt_camera_look_at(eye, pt_v3(0, 0, 0), pt_v3(0, 1, 0), (pt_real)vfov);
    pt_pcg32 random = pt_pcg32_make(1, (uint64_t)(2 * shape + mine));
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds(), t;
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) {
            double x = pt_pcg32_double(&random), y = pt_pcg32_double(&random);
            pt_ray ray = my_camera_ray(x, y);
            if (!mine) ray = pt_camera_ray(&camera, (pt_real)WIDTH / HEIGHT, (pt_real)x, (pt_real)y, pt_v2(0, 0));
            pt_stats_add(&s, nearest(&ray, mine, &t) == shape);
        }
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s), "within 5 standard errors of the exact share");
}

/* One ray through the middle of each pixel. The colour is that of the normal: (n + 1) / 2. */
static void picture(const char *output)
{
    static unsigned char rgb[WIDTH * HEIGHT * 3];
    char path[1024];
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        pt_ray ray = my_camera_ray((i % WIDTH + 0.5) / WIDTH, (i / WIDTH + 0.5) / HEIGHT);
        double t = 0, sky = 0.05 + 0.15 * i / (WIDTH * HEIGHT);
        int shape = nearest(&ray, 1, &t);
        pt_vec3 n = pt_v3(0, 0, 1); /* of the triangle; that of the ball is the point itself */
        if (shape == 1) n = pt_v3_add(ray.o, pt_v3_scale(ray.d, (pt_real)t));
        rgb[3 * i] = my_srgb_byte(shape ? 0.5 + 0.5 * (double)n.x : sky);
        rgb[3 * i + 1] = my_srgb_byte(shape ? 0.5 + 0.5 * (double)n.y : sky);
        rgb[3 * i + 2] = my_srgb_byte(shape ? 0.5 + 0.5 * (double)n.z : sky);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(my_write_ppm(path, rgb), "the picture was written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "and by the header as PNG");
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 262144) / (getenv("SHORT") ? 16 : 1), t = 0;
    double half = tan(vfov * PT_PI / 360), whole = 4 * half * half * WIDTH / HEIGHT;
    double ball = PT_PI * 1 / (25 - 1) / whole, triangle = 0.5 * 1 * 2.25 / 25 / whole;
    pt_ray middle = my_camera_ray(0.5, 0.5);
    int code, equal = 0;

    printf("%-14s %9s %12s %12s %10s %8s\n", "shape", "samples", "estimate", "exact", "std.error", "seconds");
    table("my ball", 1, 1, ball, most);
    table("pt ball", 1, 0, ball, most);
    table("my triangle", 2, 1, triangle, most);
    table("pt triangle", 2, 0, triangle, most);
    printf("What to see: 16 times the rays, 16 times the seconds, a quarter of the error.\n");

    check(nearest(&middle, 1, &t) == 1 && fabs(t - 4) < 1e-5, "the middle ray meets the ball first, at distance 4");
    for (code = 0; code < 256; code++) equal += my_srgb_byte(code / 255.0) == pt_srgb_byte(code / 255.0);
    check(equal == 256, "my sRGB codes are the header's");
    check(my_srgb_byte(0.5) == 188, "half the light has code 188");
    picture(argc > 2 ? argv[2] : "01_first_image");

    printf("lesson 01: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: the field of view grows from 40 to 60 degrees (-DEX=1). By which factor do both shares fall?
       Answer: (tan 20 / tan 30)^2 = 0.3974, so the ball covers 0.07363. All checks still pass.
   (2) Break: take the root where the ray leaves the ball (-DEX=2). Which check fails, and why do the shares
       not change? Answer: "at distance 4" (it is 6 now); a line that leaves the ball has entered it. Then
       write linear light to the file (-DEX=3): both checks of sRGB fail, and the picture is too dark.
   (3) Extend: put a second ball of radius 1/2 at (0, 0, 2), in front of the first, and count the rays that
       meet the first ball first. Answer: (pi / 24 - pi (1/4) / (9 - 1/4)) / 0.70652 = 0.05823; neither the
       ball nor the camera moved: a share of what is seen is no property of the shape alone. */
