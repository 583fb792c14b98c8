/* Lesson 04: the notation of light paths

   QUESTION   Which light does a method find, and which light can it never find?

   IDEA       Write down what happened to the light on its way: L lamp, D diffuse reflection, S mirror or
              glass, V volume, E eye. A kind of light is then a set of words, and a regular expression names
              it: (S|D)* is any number of surfaces, S+ one or more, D? one or none. The slides' rows, with
              what they leave out:

                  LE               the lamp itself                 (not on the slides)
                  L(D|S)E          direct light                    local lighting, lesson 02: its D
                  L(S|D)S+E        seen in mirrors                 classical ray tracing
                  LS+DE            caustics
                  L(S|D)*DDE       colour bleeding
                  L(S|D)+DS+E      caustics and bleeding in mirrors
                  L(S|D)+D(S|D)*E  "others"

              The last row of the slides overlaps with three rows above it: of the 2^k words with k surfaces
              it has all that have a D after the first letter, 2^k - 2, but only 2^(k-2) - 1 of them are in no
              row above. Read as "the first row that matches" the rows are a partition: each word is in
              exactly one, and so the light of all rows adds up to the whole. Whitted's tree finds LD?S*E: 2
              words of 2^k. In a white sphere of radius 1, albedo rho, around a lamp of flux Phi that is a
              point, every wall point has the same light from k diffuse reflections, wherever the lamp is:
              LDDE is rho^2 Phi / (4 pi^2), each D more multiplies it by rho, so LDD+E = L(S|D)*DDE has rho^2
              Phi / (4 pi^2 (1 - rho)).

   BUILD      cc -O2 -I.. 04_light_paths.c -o 04_light_paths -lm -pthread
   RUN        ./04_light_paths [samples] [output]

   PRINTS     k surfaces: words, direct, mirrors, caustic, bleeding, in mirrors, others, the slides' others
                4     16    0    2    1    4    6    3   14

   WORDS      light path notation 光路传输记法; caustics 焦散; color bleeding 颜色扩散; indirect lighting 间接光照;
              direct lighting 直接光照; volumetric scattering 体积散射; light transport 光传输

   HEADER     [PT-11] pt_lpe_compile, pt_lpe_class, pt_lpe_slides, pt_observer, [PT-19]
              pt_scene_diffuse_sphere, pt_scene_cornell_spheres, [PT-10] pt_film_class

   SOURCES    Heckbert: Adaptive Radiosity Textures for Bidirectional Ray Tracing, 1990; the lecture's slide
              on the notation of light paths; [Vea97] 8.3

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
    printf("%s %s\n", ok ? "ok    " : "FAIL  ", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact,
           pt_stats_standard_error(s), seconds);
}

/* ---- mine ---- */

/* Does the word x (k letters between L and E, D or S) belong to a row, taken literally? */
static int my_matches(int which, const char *x, int k)
{
    int mirrors = 0, first = k, i; /* S letters before the eye; the place of the first D */
    while (mirrors < k && x[k - 1 - mirrors] == 'S') mirrors++;
    for (i = k - 1; i >= 0; i--)
        if (x[i] == 'D') first = i;
    switch (which) {
    case EMISSION: return k == 0;
    case DIRECT: return k == 1;
    case MIRRORS: return k >= 2 && mirrors >= k - 1;                      /* L(S|D)S+E       */
    case CAUSTIC: return k >= 2 && first == k - 1;                        /* LS+DE           */
    case BLEEDING: return k >= 2 && x[k - 1] == 'D' && x[k - 2] == 'D';   /* L(S|D)*DDE      */
    case IN_MIRRORS: return mirrors >= 1 && k - mirrors >= 2;             /* L(S|D)+DS+E     */
    default: return k >= 2 && k - mirrors >= 2;                           /* L(S|D)+D(S|D)*E */
    }
}

/* The first row that matches. word: "LDSE". */
static int my_class(const char *word)
{
    char x[64] = "";
    int k = (int)strlen(word) - 2, i, which;
    for (i = 0; i < k && i < 63; i++) x[i] = word[EX == 3 ? k - i : i + 1]; /* words begin at the lamp */
    for (which = 0; which < OTHERS; which++)
        if (my_matches(which, x, k)) break;
    return which;
}

/* LD?S*E, as a program reads it: from the eye back to the lamp. */
static int my_whitted_finds(const char *word)
{
    size_t i = strlen(word) - 2;
    while (word[i] == 'S') i--;
    if (word[i] == 'D') i--;
    return i == 0;
}

/* ---- both ---- */

/* All words with k letters: is each in one row, in the same as the header says, and how many has each row? */
static void count_words(const pt_lpe *slides, const pt_lpe *whitted)
{
    int k, i, j, which, same = 1, found_same = 1, right = 1;
    printf("k surfaces: words, direct, mirrors, caustic, bleeding, in mirrors, others, the slides' others\n");
    for (k = 1; k <= LONGEST; k++) {
        int n = 1 << k, count[ROWS] = {0}, literal = 0, finds = 0;
        for (i = 0; i < n; i++) {
            char word[LONGEST + 3] = "L";
            for (j = 0; j < k; j++) word[1 + j] = (i >> j & 1) ? 'S' : 'D';
            word[1 + k] = 'E';
            which = my_class(word);
            count[which]++;
            literal += my_matches(OTHERS, word + 1, k);
            finds += my_whitted_finds(word);
            same &= which == pt_lpe_class(slides, word);
            found_same &= my_whitted_finds(word) == (pt_lpe_class(whitted, word) == 0);
        }
        printf("%3d %6d", k, n);
        for (which = DIRECT; which < ROWS; which++) printf(" %4d", count[which]);
        if (EX == 2) count[OTHERS] = literal; /* the slides' rows as they stand */
        printf(" %4d\n", literal);
        for (which = 0, j = 0; which < ROWS; which++) j += count[which];
        right &=
            j == n && finds == 2 && literal == (k > 1 ? n - 2 : 0) && (k < 2 || count[OTHERS] == n / 4 - 1);
    }
    check(right, "the rows add up to 2^k words, others have 2^(k-2) - 1, Whitted 2, as computed");
    check(same, "each word is in the row that the header puts it in");
    check(found_same, "Whitted's words are the header's LD?S*E");
}

/* What the observer adds up for one path: light by my rows. */
static void my_observer(void *user, const char *word, int edges, pt_rgbd value)
{
    (void)edges;
    ((double *)user)[my_class(word)] += value.g;
}

/* Colour bleeding in the white sphere: random rays from its middle. */
static void table(const pt_lpe *slides, double most)
{
    const double direct = 0.25 / (4 * PT_PI * PT_PI), exact = MAX_EDGES == 3 ? direct : 2 * direct;
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 5, 0);
    pt_stats mine = PT_STATS_INIT, header = PT_STATS_INIT;
    pt_li_options options = {0};
    double seconds = pt_cpu_seconds(), sum[ROWS], n, most_off = 0;
    uint32_t i = 0;
    check(pt_scene_diffuse_sphere(&scene, &camera) == PT_OK, "the sphere is ready");
    options.max_edges = MAX_EDGES;
    options.observer = my_observer;
    options.observer_user = sum;
    options.lpe = slides;
    printf("%-14s %9s %12s %12s %10s %8s\n", "class", "samples", "estimate", "exact", "std.error", "seconds");
    for (n = floor(most / 256); n <= most; n *= 16) {
        for (; mine.n < n; i++) {
            pt_rgbd classes[16] = {{0, 0, 0}};
            pt_li_info info = {0};
            pt_vec2 at;
            pt_ray ray;
            int which;
            info.classes = classes;
            for (which = 0; which < ROWS; which++) sum[which] = 0;
            pt_sampler_start(&sampler, 0, i);
            at = pt_sampler_2d(&sampler); /* two calls as arguments of one: who knows which comes first? */
            ray = pt_camera_ray(&camera, 1, at.x, at.y, pt_v2(0, 0));
            pt_li_path(&scene, &ray, &sampler, &options, &info);
            pt_stats_add(&mine, sum[BLEEDING]);
            pt_stats_add(&header, classes[BLEEDING].g);
            most_off = fmax(most_off, fabs(sum[BLEEDING] - classes[BLEEDING].g));
        }
        row("my bleeding", &mine, exact, pt_cpu_seconds() - seconds);
        row("pt bleeding", &header, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(mine.mean - exact) <= 5 * pt_stats_standard_error(&mine),
          "within 5 standard errors of the exact radiance");
    check(most_off < 1e-6, "path by path, my rows get the light that the header's get");
    pt_scene_free(&scene);
}

/* The box with a mirror and a glass ball: shares of the rows, and pictures of four of them. */
static void picture(const pt_lpe *slides, double spp, const char *output)
{
    static unsigned char rgb[4 * SIZE * SIZE * 3];
    static const char *const name[] = {"",         "direct",     "mirrors", "caustic",
                                       "bleeding", "in mirrors", "others"};
    pt_render_desc desc = pt_render_defaults();
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    double whole = 0, sum = 0, share[ROWS] = {0};
    int which, i;
    char path[1024];
    desc.width = desc.height = SIZE;
    desc.spp = (uint32_t)spp;
    desc.threads = 1;
    desc.li.lpe = slides;
    check(pt_scene_cornell_spheres(&scene, &desc.camera) == PT_OK &&
              pt_render(&scene, &desc, &film, NULL) == PT_OK,
          "the box is rendered, one picture for each row");
    for (i = 0; i < SIZE * SIZE; i++) whole += pt_film_pixel(&film, i % SIZE, i / SIZE).g;
    for (which = EMISSION; which < ROWS; which++) {
        int panel = which == EMISSION ? 4 : which - DIRECT; /* direct, mirrors, caustic, bleeding */
        pt_film part = PT_FILM_INIT;
        if (pt_film_class(&film, which, &part) != PT_OK) break;
        for (i = 0; i < SIZE * SIZE; i++) {
            pt_rgbd v = pt_film_pixel(&part, i % SIZE, i / SIZE);
            unsigned char *to =
                rgb + 3 * ((i / SIZE + panel / 2 * SIZE) * 2 * SIZE + i % SIZE + panel % 2 * SIZE);
            share[which] += v.g / whole;
            if (panel < 4)
                to[0] = pt_srgb_byte(3 * v.r), to[1] = pt_srgb_byte(3 * v.g), to[2] = pt_srgb_byte(3 * v.b);
        }
        sum += share[which];
        pt_film_free(&part);
    }
    printf("light in the picture of the box, the lamp itself left out:\n");
    for (which = DIRECT; which < ROWS; which++)
        printf("%-12s %5.1f %%  %s\n", name[which], 100 * share[which] / (1 - share[EMISSION]),
               which == DIRECT    ? "found by local lighting"
               : which == MIRRORS ? "found by Whitted"
                                  : "found by neither");
    check(fabs(sum - 1) < 1e-9, "the rows add up to the whole picture");
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, 2 * SIZE, 2 * SIZE) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, 2 * SIZE, 2 * SIZE) == PT_OK, "and as PNG");
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 65536) / (getenv("SHORT") ? 16 : 1);
    static const char *const tree[] = {"LD?S*E"};
    pt_lpe slides, whitted;
    check(pt_lpe_compile(&slides, pt_lpe_slides(), PT_LPE_SLIDES_COUNT, NULL) == PT_OK &&
              pt_lpe_compile(&whitted, tree, 1, NULL) == PT_OK, "the header reads the rows");
    count_words(&slides, &whitted);
    table(&slides, most);
    picture(&slides, getenv("SHORT") ? 4 : 32, argc > 2 ? argv[2] : "04_light_paths");
    printf(
        "What to see: two fifths of the light were found by nobody. \"Others\" are few, but not nothing.\n");
    printf("lesson 04: %d passed, %d failed\n", passed, failed);
    if (MISTAKE)
        printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: paths of at most three edges (-DEX=1). What is left of colour bleeding in the white sphere?
       Answer: LDDE alone, half of it: 0.006333 instead of 0.01267, for rho = 1/2.
   (2) Break: take the slides' last row as it stands (-DEX=2): the rows have more words than there are. Or
       read the words from the eye (-DEX=3): a caustic LSDE becomes a diffuse thing seen in a mirror, LDSE.
   (3) Extend: class LSDDSE, and find a method of this course's first five lessons that draws it.
       Answer: in mirrors, L(S|D)+DS+E; none does. */
