/* Lesson 04: the notation of light paths

   QUESTION   Which light does a method find, and which light can it never find?

   IDEA       Light path notation tells what happened to light on its way: L lamp, D diffuse reflection, S mirror or
              glass, V volumetric scattering, E eye. Regular expressions name sets of such words: (S|D)* is any number
              of surfaces, S+ one or more, D? one or none. The slides' rows, and LE, which they leave out:

                  LE               the lamp itself
                  L(D|S)E          direct lighting                 local lighting, lesson 02: its D
                  L(S|D)S+E        seen in mirrors                 classical ray tracing
                  LS+DE            caustics
                  L(S|D)*DDE       colour bleeding
                  L(S|D)+DS+E      caustics and bleeding in mirrors
                  L(S|D)+D(S|D)*E  "others"                        all but the first two: indirect lighting

              The last row overlaps with three rows above it: of the 2^k words with k surfaces it has all that have a D
              after the first letter, 2^k - 2, but only 2^(k-2) - 1 of them are in no row above. Read as "the first row
              that matches" they are a partition, whose light adds up to all light transport. Whitted finds LD?S*E, 2
              words of 2^k. In a white sphere of radius 1, albedo rho, around a point lamp of flux Phi every wall point
              has the same light from k > 1 diffuse reflections, wherever the lamp is: LDDE is rho^2 Phi / (4 pi^2),
              each D more multiplies it by rho, and LDD+E has rho^2 Phi / (4 pi^2 (1 - rho)). Here rho = 1/2, Phi = 1.

   PICTURE    A box with a mirror and a glass ball: above direct, in mirrors, caustics, below the last three rows.

   BUILD      cc -O2 -I.. 04_light_paths.c -o 04_light_paths -lm -pthread
   RUN        ./04_light_paths [samples] [output]

   PRINTS     k surfaces: words, direct, mirrors, caustic, bleeding, in mirrors, others, the slides' others
                4     16    0    2    1    4    6    3   14

   WORDS      light path notation 光路传输记法; caustics 焦散; color bleeding 颜色扩散; indirect lighting 间接光照;
              direct lighting 直接光照; volumetric scattering 体积散射; light transport 光传输

   HEADER     [PT-11] pt_lpe_compile, pt_lpe_class, pt_observer, [PT-10] pt_film_class, [PT-19] pt_scene_diffuse_sphere

   SOURCES    Heckbert: Adaptive Radiosity Textures for Bidirectional Ray Tracing, 1990; [Vea97] 8.3; the slides

   Before: lesson 03. Next: lesson 05, distribution ray tracing. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { SIZE = 128, LONGEST = 10, MAX_EDGES = EX == 1 ? 3 : 0, MISTAKE = EX == 2 || EX == 3 };
enum { EMISSION, DIRECT, MIRRORS, CAUSTIC, BLEEDING, IN_MIRRORS, OTHERS, ROWS };

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

/* The slides' rows, with . for (S|D); a path belongs to the first one that matches its word. */
static const char *const rows[ROWS] = {"LE",     "L.E",     "L.S+E", EX == 3 ? "LDS+E" : "LS+DE",
                                       "L.*DDE", "L.+DS+E", "L.+D.*E"};
static const char *const whitted = "LD?S*E";

/* Does the expression match all of the word? A letter or . may have * (any number), + (at least one) or ? behind it. */
static int my_match(const char *expression, const char *word)
{
    int one = *word && (*expression == '.' || *expression == *word);
    if (!*expression) return !*word;
    switch (expression[1]) {
    case '*': return my_match(expression + 2, word) || (one && my_match(expression, word + 1));
    case '+': return one && (my_match(expression + 2, word + 1) || my_match(expression, word + 1));
    case '?': return my_match(expression + 2, word) || (one && my_match(expression + 2, word + 1));
    default: return one && my_match(expression + 1, word + 1);
    }
}

static int my_class(const char *word)
{
    int which = 0;
    while (which < OTHERS && !my_match(rows[which], word)) which++;
    return which;
}

/* What the header's observer adds up for one path: light by my rows. */
static void my_observer(void *user, const char *word, int edges, pt_rgbd value)
{
    (void)edges;
    ((double *)user)[my_class(word)] += value.g;
}

/* ---- both ---- */

/* All words with k letters: is each in one row, in the same as the header says, and how many has each row? */
static void count_words(const pt_lpe *slides, const pt_lpe *tree)
{
    int same = 1, right = 1;
    printf("k surfaces: words, direct, mirrors, caustic, bleeding, in mirrors, others, the slides' others\n");
    for (int k = 1; k <= LONGEST; k++) {
        int n = 1 << k, count[ROWS] = {0}, literal = 0, found = 0, sum = 0;
        for (int i = 0; i < n; i++) {
            char word[LONGEST + 3] = "L";
            for (int j = 0; j < k; j++) word[1 + j] = (i >> j & 1) ? 'S' : 'D';
            word[1 + k] = 'E';
            count[my_class(word)]++;
            literal += my_match(rows[OTHERS], word);
            found += my_match(whitted, word);
            same &= my_class(word) == pt_lpe_class(slides, word);
            same &= my_match(whitted, word) == (pt_lpe_class(tree, word) == 0);
        }
        printf("%3d %6d", k, n);
        for (int which = DIRECT; which < ROWS; which++) printf(" %4d", count[which]);
        printf(" %4d\n", literal);
        if (EX == 2) count[OTHERS] = literal; /* the slides' rows as they stand */
        for (int which = EMISSION; which < ROWS; which++) sum += count[which];
        right &= sum == n && found == 2 && (k == 1 || (literal == n - 2 && count[OTHERS] == n / 4 - 1));
    }
    check(right, "the rows add up to 2^k words, others have 2^(k-2) - 1, Whitted 2, as computed");
    check(same, "each word is in the row that the header puts it in, and Whitted's words are LD?S*E");
}

/* Colour bleeding in the white sphere, along one ray: it is the same everywhere. */
static void table(const pt_lpe *slides, double most)
{
    const double exact = (MAX_EDGES == 3 ? 1 : 2) * 0.25 / (4 * PT_PI * PT_PI);
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    pt_ray ray = {{0, 0, 0}, {1, 2, 3}, 9};
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 5, 0);
    pt_stats mine = PT_STATS_INIT, header = PT_STATS_INIT;
    pt_li_options options = {.max_edges = MAX_EDGES, .observer = my_observer, .lpe = slides};
    double seconds = pt_cpu_seconds();
    check(pt_scene_diffuse_sphere(&scene, &camera) == PT_OK, "the sphere is ready");
    printf("%-14s %9s %12s %12s %10s %8s\n", "class", "samples", "estimate", "exact", "std.error", "seconds");
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (mine.n < n) {
            double sum[ROWS] = {0};
            pt_rgbd classes[PT_LPE_EXPRESSIONS + 1] = {{0, 0, 0}};
            pt_li_info info = {.classes = classes};
            options.observer_user = sum;
            pt_sampler_start(&sampler, 0, (uint32_t)mine.n);
            pt_li_path(&scene, &ray, &sampler, &options, &info);
            pt_stats_add(&mine, sum[BLEEDING]);
            pt_stats_add(&header, classes[BLEEDING].g);
        }
        row("my bleeding", &mine, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(mine.mean - exact) <= 5 * pt_stats_standard_error(&mine), "within 5 standard errors of the exact value");
    check(fabs(mine.mean - header.mean) < 1e-9, "my rows get the light that the header's get");
    pt_scene_free(&scene);
}

/* The box with a mirror and a glass ball: one picture for each row, and its share of the light. */
static void picture(const pt_lpe *slides, const char *output)
{
    static unsigned char rgb[6 * SIZE * SIZE * 3];
    pt_render_desc desc = pt_render_defaults();
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT, part = PT_FILM_INIT;
    double light[ROWS] = {0}, sum = 0, whole = 0;
    char path[1024];
    desc.width = desc.height = SIZE, desc.li.lpe = slides;
    desc.spp = getenv("SHORT") ? 4 : 32;
    check(pt_scene_cornell_spheres(&scene, &desc.camera) == PT_OK && pt_render(&scene, &desc, &film, NULL) == PT_OK,
          "the box is rendered, one picture for each row");
    for (int i = 0; i < SIZE * SIZE; i++) whole += pt_film_pixel(&film, i % SIZE, i / SIZE).g;
    for (int which = EMISSION; which < ROWS && pt_film_class(&film, which, &part) == PT_OK; which++) {
        for (int i = 0; i < SIZE * SIZE; i++) {
            int x = i % SIZE + (which - 1) % 3 * SIZE, y = i / SIZE + (which - 1) / 3 * SIZE;
            pt_rgbd v = pt_film_pixel(&part, i % SIZE, i / SIZE);
            double band[3] = {v.r, v.g, v.b};
            light[which] += v.g;
            if (which == EMISSION) continue;
            for (int c = 0; c < 3; c++) rgb[3 * (y * 3 * SIZE + x) + c] = pt_srgb_byte(3 * band[c]);
        }
        sum += light[which];
        pt_film_free(&part);
    }
    printf("light in the picture of the box, the lamp itself left out:\n");
    for (int which = DIRECT; which < ROWS; which++)
        printf("%5.1f %%  %s\n", 100 * light[which] / (whole - light[EMISSION]), rows[which]);
    check(fabs(sum / whole - 1) < 1e-9, "the rows add up to the whole picture");
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, 3 * SIZE, 2 * SIZE) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, 3 * SIZE, 2 * SIZE) == PT_OK, "and as PNG");
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 65536) / (getenv("SHORT") ? 16 : 1);
    pt_lpe slides, tree;
    check(pt_lpe_compile(&slides, pt_lpe_slides(), PT_LPE_SLIDES_COUNT, NULL) == PT_OK &&
          pt_lpe_compile(&tree, &whitted, 1, NULL) == PT_OK, "the header reads the rows");
    count_words(&slides, &tree);
    table(&slides, most);
    picture(&slides, argc > 2 ? argv[2] : "04_light_paths");
    printf("What to see: local lighting finds most of the first row, Whitted the first two, and two fifths neither.\n");

    printf("lesson 04: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: paths of at most three edges (-DEX=1). What is left of colour bleeding in the white sphere? Answer:
       LDDE alone, half of it: 0.006333 instead of 0.01267, for rho = 1/2.
   (2) Break: take the slides' last row as it stands (-DEX=2): the rows have more words than there are. Or write the
       caustics from the eye to the lamp, LDS+E (-DEX=3): the row is empty, for those are diffuse things in mirrors.
   (3) Extend: to which row belongs LSDDSE, and which method of lessons 02 to 05 draws it? Answer: in mirrors; none. */
