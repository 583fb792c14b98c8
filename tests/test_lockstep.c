/* test_lockstep.c: paths that walk together find what paths find one at a time [PT-11b]: exact integrals, agreement with
   pti_path, the same bits whoever renders, lanes, numbers, densities, hits, and what is left to pti_path.
   tests/test_lockstep_plain.c, _avx2.c and _avx512.c are a selection of the same in other lanes. */

#define PT_STATIC /* it looks at private functions */
#ifndef LOCK_PROGRAM
#define LOCK_PROGRAM "test_lockstep"
#define LOCK_MAIN 1
#endif
#include "pt_lock.h"
#include "pt_floats.h"

#if PTI_HAS_LOCKSTEP

#ifdef LOCK_WIDTH
#define WHOLE 0 /* checks that could differ with the lanes */
#else
#define WHOLE 1
#endif

/* ---- exact integrals: furnaces ------------------------------------------------------------------------------ */

/* Closed scenes whose surfaces all emit 1 and reflect rho: radiance 1 + rho + rho^2 + ... everywhere. */
enum { BOX, BOX_OF_QUADS, TURNED, TURNED_QUADS, FANS, BALL, SHELLS, THINGS, WEDGE, FAR_OFF, LITTLE, TOUCHING, THIN_WEDGE, FURNACES };
static const char *const furnace_names[FURNACES] = {
    "box of rectangles", "box of quads", "turned box", "turned box of quads", "turned box of triangles", "ball from inside",
    "between two balls", "room with things", "wedge of 10 degrees", "turned box far off", "turned box of 1e-6", "things that touch", "wedge of 2 degrees"};

/* A prism: its sides z = 0 and 1, and three along z. */
static void add_wedge(pt_scene *s, const place *at, double height, int m)
{
    const double p[6][3] = {{0, 0, 0}, {1, 0, 0}, {1, height, 0}, {0, 0, 1}, {1, 0, 1}, {1, height, 1}};
    const double along[3] = {0, 0, 1};
    int k, i;
    for (k = 0; k < 3; k++) {
        double edge[3];
        for (i = 0; i < 3; i++) edge[i] = p[(k + 1) % 3][i] - p[k][i];
        add_face(s, PARALLELOGRAM, at, p[k], along, edge, m);
    }
    pt_add_triangle(s, put(at, p[0], 1), put(at, p[1], 1), put(at, p[2], 1), m);
    pt_add_triangle(s, put(at, p[3], 1), put(at, p[5], 1), put(at, p[4], 1), m);
}

static void add_things(pt_scene *s, double lift, int m)
{
    const place box = {0, 1, -0.4, -0.6 + lift, -0.3}, quads = {0, 0.5, 0.5, -0.7 + lift, 0.1}, fan = {0.5, 0.3, 0.1, 0.4, -0.4};
    add_cube(s, PARALLELOGRAM, &box, -0.4, 0.4, 1, m);
    add_cube(s, QUAD, &quads, -0.6, 0.3, 1, m);
    add_cube(s, FAN, &fan, -0.8, 0.8, 1, m);
    add_ball(s, &HERE, -0.4, 0.1 + 2 * lift, -0.3, 0.3, m); /* without lift they stand on the floor and on each other, */
    add_ball(s, &HERE, 0.7, 0.5, lift > 0 ? -0.5 : -0.9, 0.18, m); /* and one is half in the wall         */
}

/* by_tree: it asks its tree; for that a speck is added, but where the scene has no choice as it is. 2: and lanes for its walls. */
static const char *const TREE_NAMES[3] = {"", ", by its tree", ", tree and walls"};
static stage furnace(int kind, double rho, int by_tree)
{
    static const place places[FURNACES] = {{0, 1, 0, 0, 0},      {0, 1, 0.3, 0.2, 0.1}, {0.7, 1, 0, 0, 0},       {0.4, 1, 0, 0, 0}, {0.9, 1, 0.1, 0, -1},
                                           {0, 1, 0, 0, 0},      {0, 1, 0, 0.5, 0},     {0, 1, 0, 0, 0},         {0.3, 1, 0, 0, 0}, {0.7, 1, 70, -40, 30},
                                           {0.7, 1e-6, 1e-6, 0, 0}, {0, 1, 0, 0, 0}, {0.3, 1, 0, 0, 0}};
    static const int made[FURNACES] = {PARALLELOGRAM, QUAD, PARALLELOGRAM, QUAD, FAN, 0, 0, PARALLELOGRAM, 0, FAN, QUAD, QUAD, 0};
    const place *at = &places[kind];
    const int wedge = kind == WEDGE || kind == THIN_WEDGE;
    stage s;
    int m;
    memset(&s, 0, sizeof s);
    m = material_of(&s.scene, pt_material_diffuse(grey(rho)), 1);
    s.camera = camera_at(at, 0.1, 0, 0.8, 0, 0.05, -1, 70);
    if (kind == BALL || kind == SHELLS) add_ball(&s.scene, at, 0, 0, 0, 1, m);
    else if (wedge) add_wedge(&s.scene, at, kind == WEDGE ? 0.176 : 0.035, m);
    else add_cube(&s.scene, made[kind], at, -1, 1, 0, m);
    if (kind == SHELLS) add_ball(&s.scene, at, 0.1, 0, -0.2, 0.5, m);
    if (wedge) s.camera = camera_at(at, 0.9, 0.02, 0.5, 0, 0, 0.4, 0.1); /* it looks at the edge, on which a row of paths lands */
    if (kind == THINGS || kind == TOUCHING) add_things(&s.scene, kind == THINGS ? 0.05 : 0, m);
    if (by_tree == 1 && kind != THIN_WEDGE) add_speck(&s.scene, at);
    if (by_tree == 2) add_crowd(&s.scene, at);
    commit(&s);
    return s;
}

/* Every path of k edges gives 1 + rho + ... + rho^(k-1), and walks k edges: not one may get out. Along the edges of things in the
   room and where they touch, one in a million edges may get in, or between them and out: those strips are some e = 1e-6 wide. */
static double walk_to_the_end(int kind, double rho, int k, uint32_t spp, int by_tree)
{
    const int width = 29, height = 23, touching = kind == TOUCHING || kind == THINGS;
    const double r = (double)(pt_real)rho, exact = (1 - pow(r, k)) / (1 - r), paths = (double)spp * width * height;
    const char *name = label("%s%s, %d edges", furnace_names[kind], TREE_NAMES[by_tree], k);
    stage s = furnace(kind, rho, by_tree);
    pt_render_desc d = desc_of(&s, width, height, spp);
    pt_film film;
    uint64_t rays;
    int wrong = 0, i, h;
    d.method = "path-plain";
    d.li.max_edges = k;
    d.li.roulette = PT_ROULETTE_NONE;
    film = render(&s, &d, by_tree ? 2 : 1, &rays);
    for (h = 0; h < 2; h++)
        for (i = 0; i < width * height; i++) wrong += memcmp(film.half[h] + 3 * i, film.half[0], 3 * sizeof film.half[0][0]) != 0;
    pt_check((double)rays == paths * k || (touching && (double)rays >= (1 - 1e-6 * k) * paths * k), name, "%.0f of %.0f edges are missing", paths * k - (double)rays,
             paths * k);
    pt_check(wrong <= (touching ? 4 + (by_tree == 2 ? 0 : 0.6e-6) * paths * k : 0), name, "%d of %d sums of pixels differ from the first, after %.0f edges", wrong, 2 * width * height,
             paths * k);
    /* k products and k sums in float */
    pt_check(fabs(film.half[0][0] / (0.5 * spp) - exact) <= 2 * k * PTI_2_M24 * exact, name, "%.9g, exactly %.9g", film.half[0][0] / (0.5 * spp), exact);
    if (pt_test.is_verbose) printf("       %s: %d wrong of %.0f\n", name, wrong, paths);
    pt_film_free(&film);
    pt_scene_free(&s.scene);
    return (double)rays;
}

/* Has its tree walls if it is crowded? */
static int has_walls(int kind) { return kind != BALL && kind != SHELLS && kind != THIN_WEDGE; }

static void no_way_out(void)
{
    double edges = 0;
    int kind;
    for (kind = 0; kind < FURNACES; kind++) {
        const uint32_t few = pt_test.is_short ? 1 : WHOLE ? 3 : 2, more = kind == THINGS ? 6 * few : few;
        if (kind != THIN_WEDGE) edges += walk_to_the_end(kind, 0.999, 500, 2 * more, 0);
        if (WHOLE || kind == WEDGE) edges += walk_to_the_end(kind, 0.9, 10, kind == THIN_WEDGE ? 2 : 8 * few, kind == THIN_WEDGE);
        if (WHOLE || kind == FANS) edges += walk_to_the_end(kind, 0.999, 200, 2, 1);
        if (WHOLE ? has_walls(kind) : kind == FANS) edges += walk_to_the_end(kind, 0.999, kind == THINGS ? 500 : 200, 2 * more, 2);
    }
    printf("edges walked in closed scenes: %.4g\n", edges);
}

/* Rooms whose walls emit 1, reflect 0.9, and are asked in lanes; meshes in them, of albedo 1, are for the tree. No path leaves the
   room, so that every one walks to the end; and none gets into a thing, where it would see no wall again: the first 40 walls
   give 98 % of all light. But from less than e above a wall that a thing stands on, and along edges, a path in a million
   edges may be lost: turned, they are far off, and e is 1e-4. */
enum { IN_THE_AIR, ON_THE_FLOOR, THROUGH_THE_FLOOR, BLOCK_ON_THE_FLOOR, FROM_WALL_TO_WALL, SHEET_ON_THE_FLOOR, HALF_OF_WALLS, FURNISHED };
static const char *const furnished_names[FURNISHED] = {"a ball in the air", "a ball that touches the floor", "a ball through the floor", "a block on the floor",
                                                       "a block from wall to wall", "a sheet 1e-5 above the floor", "a block, half of walls"};

/* Sides of a box, of n x n quads, or, if they are low and n < 0, of one. */
static void add_block(pt_scene *s, const place *at, const double low[3], const double high[3], int parts, int m)
{
    int axis, side, i, j, k;
    for (axis = 0; axis < 3; axis++)
        for (side = 0; side < 2; side++) {
            const int n = parts > 0 ? parts : side ? -parts : 1;
            for (i = 0; i < n; i++)
                for (j = 0; j < n; j++) {
                    const int a = (axis + 1 + !side) % 3, b = (axis + 1 + side) % 3;
                    pt_vec3 v[4];
                    for (k = 0; k < 4; k++) {
                        double p[3];
                        p[axis] = side ? high[axis] : low[axis];
                        p[a] = low[a] + (high[a] - low[a]) * (i + (k == 1 || k == 2)) / n;
                        p[b] = low[b] + (high[b] - low[b]) * (j + (k >= 2)) / n;
                        v[k] = put(at, p, 1);
                    }
                    pt_add_quad(s, v[0], v[1], v[2], v[3], m);
                }
        }
}

/* A ball of triangles without normals of its own. */
static void add_flat_ball(pt_scene *s, const place *at, double y, double r, int m)
{
    enum { AROUND = 24, UP = 12 };
    int i, j, k;
    for (j = 0; j < UP; j++)
        for (i = 0; i < AROUND; i++) {
            pt_vec3 v[4];
            for (k = 0; k < 4; k++) {
                const double a = 2 * PT_PI * ((i + (k == 1 || k == 2)) % AROUND) / AROUND, b = PT_PI * (j + (k >= 2)) / UP, w = j + (k >= 2) == UP ? 0 : sin(b);
                const double p[3] = {r * w * cos(a), y + r * cos(b), r * w * sin(a)};
                v[k] = put(at, p, 1);
            }
            if (j > 0) pt_add_triangle(s, v[0], v[1], v[2], m);
            if (j + 1 < UP) pt_add_triangle(s, v[0], v[2], v[3], m);
        }
}

/* refuse: something that leaves its walls to the tree. */
enum { NOTHING, NORMALS, SHARP, MATERIALS, FAR_EYE, REFUSALS };
static const char *const refusal_names[REFUSALS] = {"nothing", "shading normals", "a wedge of 2 degrees", "many materials", "a far eye"};

/* Turned, they are far off, too: rounding is 140 times as large. */
static stage furnished(int kind, double turn, double rho, int refuse)
{
    static const double on[3] = {-0.5, -1, -0.4}, block[3] = {0.4, -0.3, 0.5}, low_block[3] = {0.6, 0.1, 0.6}, low[3] = {-1, -1, -0.4}, high[3] = {1, -0.3, 0.5};
    static const double sheet[2][3] = {{-0.7, -1 + 1e-5, -0.7}, {0.6, -1 + 2e-5, 0.8}};
    const place at = {turn, 1, 200 * turn, -70 * turn, 100 * turn};
    stage s;
    int wall, m;
    memset(&s, 0, sizeof s);
    wall = material_of(&s.scene, pt_material_diffuse(grey(rho)), 1);
    m = pt_add_material(&s.scene, pt_material_diffuse(grey(1)));
    add_cube(&s.scene, PARALLELOGRAM, &at, -1, 1, 0, wall);
    if (kind <= THROUGH_THE_FLOOR) add_flat_ball(&s.scene, &at, kind == IN_THE_AIR ? 0 : kind == ON_THE_FLOOR ? -0.5 : -0.7, 0.5, m);
    if (kind == BLOCK_ON_THE_FLOOR) add_block(&s.scene, &at, on, block, 4, m);
    if (kind == FROM_WALL_TO_WALL) add_block(&s.scene, &at, low, high, 5, m);
    if (kind == HALF_OF_WALLS) add_block(&s.scene, &at, on, low_block, -6, m);
    if (kind == SHEET_ON_THE_FLOOR) add_block(&s.scene, &at, sheet[0], sheet[1], 5, m);
    if (refuse == NORMALS) {
        const pt_vec3 v[3] = {v3(-0.9, 0.9, -0.9), v3(0.9, 0.9, -0.9), v3(0, 0.9, 0.9)}, n[3] = {v3(0.1, -1, 0), v3(0, -1, 0), v3(0, -1, 0.1)};
        const uint32_t index[3] = {0, 1, 2};
        pt_add_mesh(&s.scene, v, n, NULL, 3, index, 1, m);
    }
    if (refuse == SHARP) pt_add_quad(&s.scene, v3(-1, -1, -1), v3(-1, -1, 1), v3(1, -0.93, 1), v3(1, -0.93, -1), m);
    while (refuse == MATERIALS && s.scene.material_count < 60) diffuse(&s.scene, 0.1, 0.1, 0.1);
    s.camera = camera_at(&at, 0.1, 0.5, 0.8, 0, -0.3, -1, 70);
    commit(&s);
    return s;
}

static void walls_left_to_the_tree(void)
{
    int i;
    for (i = 0; i < REFUSALS; i++) {
        stage s = furnished(IN_THE_AIR, 0, 0.9, i);
        pti_lockstep ready;
        memset(&ready, 0, sizeof ready);
        pt_check(pti_lockstep_make_tree(&ready, &s.scene, v3(1, 1, i == FAR_EYE ? 1e5 : 1)) && ready.walls == (i ? 0 : 6), refusal_names[i], "%d walls are for lanes", ready.walls);
        pt_scene_free(&s.scene);
    }
}

static void furnished_rooms(void)
{
    const int k = 200, width = 29, height = 23;
    const uint32_t spp = pt_test.is_short ? 2 : WHOLE ? 10 : 4;
    double edges = 0;
    int kind, turned;
    for (kind = 0; kind < FURNISHED; kind++)
        for (turned = 0; turned < 2; turned++) {
            const char *name = label("%s%s", furnished_names[kind], turned ? ", turned" : "");
            stage s = furnished(kind, 0.7 * turned, 0.9, NOTHING);
            pt_render_desc d = desc_of(&s, width, height, spp);
            const double r = (double)(pt_real)0.9, most = spp / 2 / (1 - r), all = (double)spp * width * height * k;
            const double lost = kind == IN_THE_AIR ? 0 : 4 + 2e-6 * all; /* paths: so many, and 4 more by chance */
            pti_lockstep ready;
            pt_film film;
            uint64_t rays;
            int wrong = 0, i;
            memset(&ready, 0, sizeof ready);
            pt_check(pti_lockstep_make_tree(&ready, &s.scene, v3(1, 1, 1)) && ready.walls == (kind == HALF_OF_WALLS ? 9 : 6), name, "%d walls are for lanes", ready.walls);
            d.method = "path-plain";
            d.li.max_edges = k;
            d.li.roulette = PT_ROULETTE_NONE;
            film = render(&s, &d, 2, &rays);
            pt_check((double)rays <= all && (double)rays >= all - lost * k, name, "%.0f of %.0f edges are missing", all - (double)rays, all);
            for (i = 0; i < 3 * width * height; i++) wrong += !(fmin(film.half[0][i], film.half[1][i]) > 0.98 * most && fmax(film.half[0][i], film.half[1][i]) < 1.00001 * most);
            pt_check(wrong <= 3 * lost, name, "%d pixels have less or more than all light", wrong);
            edges += (double)rays;
            pt_film_free(&film);
            pt_scene_free(&s.scene);
        }
    printf("edges walked in furnished rooms: %.4g\n", edges);
}

/* Paths that end by roulette: 1 / (1 - rho) in the mean. Light sampling alone has no variance where walls meet, so it is asked
   in balls only. Where a tree is asked for all, roulette begins a quarter as high: four times the samples see as much. */
static void furnace_mean(int kind, double rho, const char *method, int max_edges, uint32_t spp, double bound, int by_tree)
{
    const double r = (double)(pt_real)rho, exact = max_edges ? (1 - pow(r, max_edges)) / (1 - r) : 1 / (1 - r);
    stage s = furnace(kind, rho, by_tree);
    pt_render_desc d = desc_of(&s, 8, 6, samples(by_tree == 1 ? 4 * spp : spp));
    picture p;
    d.method = method;
    d.li.max_edges = max_edges;
    p = pictures(&s, d, RENDERS, 1000u + 10000u * (uint64_t)kind, 1 + (by_tree > 0));
    pt_check_mean(label("%s, rho %g, %s%s%s", furnace_names[kind], rho, method, max_edges ? ", 5 edges" : "", TREE_NAMES[by_tree]), &p.whole, exact, 4 * PTI_2_M24 * exact,
                  bound, PT_TEST_MEANS, "light is lost or counted twice");
    pt_scene_free(&s.scene);
}

static void furnaces(void)
{
    int kind;
    pt_test_source("a closed scene that emits 1 and reflects rho: 1/(1 - rho)");
    for (kind = 0; kind < TOUCHING; kind++) {
        furnace_mean(kind, 0.5, "path", 0, 120, 0.006, 0);
        furnace_mean(kind, 0.9, "path", 5, 60, 0.006, 0);
        if (kind == BOX || kind == SHELLS) furnace_mean(kind, 0.9, "path", 0, 60, 0.01, 0);
        if (kind == BOX || kind == FANS || kind == SHELLS) furnace_mean(kind, 0.5, "path-plain", 0, 120, 0.006, 0);
        if (kind == BOX) furnace_mean(kind, 0.999, "path", 0, 1, 0.1, 0);
        if (kind == FANS) furnace_mean(kind, 0.999, "path-plain", 0, 1, 0.1, 0);
        if (kind == TURNED || kind == THINGS || kind == SHELLS) furnace_mean(kind, 0.5, "path", 0, 60, 0.01, 1);
        if (kind == TURNED || kind == THINGS || kind == FANS) furnace_mean(kind, 0.5, "path", 0, 60, 0.01, 2);
    }
}

/* ---- exact integrals: irradiance ---------------------------------------------------------------------------- */

/* A floor of albedo 1/2 under one lamp: radiance E / (2 pi), seen by a camera that sees next to one point of it. */
static void irradiance(void)
{
    static const char *const names[6] = {"rectangle", "parallelogram", "triangle", "sphere", "sphere at the horizon", "two triangles"};
    static const char *const methods[2] = {"path", "path-plain"};
    int lamp_kind, m;
    pt_test_source("pt_irradiance_polygon (Lambert), pt_irradiance_sphere");
    for (lamp_kind = 0; lamp_kind < 6; lamp_kind++)
        for (m = 0; m < 2; m++) {
            const double corner[3] = {-0.3, 1.1, -0.7}, e1[3] = {1.2, 0, 0}, e2[3] = {0, 0, 0.9}, slanted[3] = {0.9, 0.3, -0.2}, up[3] = {0.3, -0.4, 1};
            const int flat = lamp_kind < 3 || lamp_kind == 5;
            const double *a = lamp_kind == 0 ? e1 : slanted, *b = lamp_kind == 0 ? e2 : up;
            const pt_vec3 p = v3(0.2, 0, 0.1), n = v3(0, 1, 0);
            pt_vec3 v[4];
            stage s;
            pt_render_desc d;
            picture got;
            double e;
            int glow, k;
            memset(&s, 0, sizeof s);
            glow = lamp(&s.scene, 3, 3, 3);
            pt_add_parallelogram(&s.scene, v3(-3, 0, -3), v3(0, 0, 6), v3(6, 0, 0), diffuse(&s.scene, 0.5, 0.5, 0.5));
            for (k = 0; k < 4; k++) {
                const int i = k == 1 || k == 2, j = k >= 2;
                v[k] = v3(corner[0] + i * a[0] + j * b[0], corner[1] + i * a[1] + j * b[1], corner[2] + i * a[2] + j * b[2]);
            }
            if (lamp_kind < 2) add_face(&s.scene, PARALLELOGRAM, &HERE, corner, a, b, glow); /* they look down */
            if (lamp_kind == 2) pt_add_triangle(&s.scene, v[0], v[1], v[2], glow);
            if (lamp_kind == 5) pt_add_triangle(&s.scene, v[0], v[1], v[2], glow), pt_add_triangle(&s.scene, v[0], v[2], v3(-0.9, 1.2, 0.5), glow);
            if (lamp_kind == 5) v[3] = v3(-0.9, 1.2, 0.5);
            e = flat ? pt_irradiance_polygon(3, p, n, v, lamp_kind == 2 ? 3 : 4) : 0;
            if (lamp_kind == 5) e = pt_irradiance_polygon(3, p, n, v, 3), v[1] = v[2], v[2] = v[3], e += pt_irradiance_polygon(3, p, n, v, 3);
            if (!flat) {
                const double y = lamp_kind == 3 ? 1 : 0.1, far = sqrt(0.25 + y * y);
                pt_add_sphere(&s.scene, v3(0.6, y, 0.4), (pt_real)0.3, glow);
                e = pt_irradiance_sphere(3, 0.3, far, y / far);
            }
            s.camera = pt_camera_look_at(v3(-1, 1.5, -1.2), p, v3(0, 1, 0), (pt_real)0.001);
            commit(&s);
            d = desc_of(&s, 4, 4, samples(m == 1 ? 512 : 256));
            d.li.max_edges = 2;
            d.method = methods[m];
            got = pictures(&s, d, RENDERS, 200000u + 100u * (uint64_t)(3 * lamp_kind + m), 1);
            pt_check_mean(label("floor under a %s, %s", names[lamp_kind], methods[m]), &got.whole, 0.5 * e / PT_PI, 2e-5 * e, m == 1 ? 0.05 : 0.01,
                          PT_TEST_MEANS, "the density of a light, or a cosine");
            pt_scene_free(&s.scene);
        }
}

/* ---- the film is a function of the scene and the samples ----------------------------------------------------- */

static int same_film(const pt_film *a, const pt_film *b)
{
    const size_t n = 3 * sizeof(double) * (size_t)a->width * (size_t)a->height;
    return a->width == b->width && a->height == b->height && a->fingerprint == b->fingerprint && a->samples[0] == b->samples[0] &&
           a->samples[1] == b->samples[1] && n > 0 && memcmp(a->half[0], b->half[0], n) == 0 && memcmp(a->half[1], b->half[1], n) == 0;
}

/* Runs the tasks from the last one. */
static void backwards(void *user, int count, void (*task)(void *context, int index), void *context)
{
    (void)user;
    while (count-- > 0) task(context, count);
}

static void same_bits(void)
{
    static const int threads[3] = {1, 2, 7}, tile[4] = {1, 5, 16, 64}, kinds[4] = {SPHERES, MANY_LAMPS, GLOWING, SMOOTH};
    int r, i, k;
    for (r = 0; r < 4; r++) {
        const int body = r < 3 ? 1 : 2;
        stage s = room(kinds[r]);
        pt_render_desc d = desc_of(&s, 37, 19, 7);
        pt_film first, other;
        uint64_t rays, again;
        if (r == 1) d.sampler = PT_SAMPLER_INDEPENDENT;
        if (r == 2) d.single_net = 1;
        if (r == 2) d.camera.lens_radius = (pt_real)0.02;
        if (kinds[r] == SMOOTH) d.li.max_edges = 24;
        first = render(&s, &d, body, &rays);
        for (i = 0; i < 3; i++)
            for (k = 0; k < 4; k++) {
                const char *name = label("%s, %d threads, tiles of %d", room_names[kinds[r]], threads[i], tile[k]);
                d.threads = threads[i];
                d.tile = tile[k];
                other = render(&s, &d, body, &again);
                pt_check(same_film(&first, &other), name, "the films differ");
                pt_check(again == rays, name, "%.0f rays instead of %.0f: empty lanes count", (double)again, (double)rays);
                pt_film_free(&other);
            }
        d.tile = 6;
        d.parallel = backwards;
        other = render(&s, &d, body, NULL);
        pt_check(same_film(&first, &other), room_names[kinds[r]], "the films differ if the last tile comes first");
        pt_film_free(&other);
        d.seed++;
        other = render(&s, &d, body, NULL);
        pt_check(memcmp(first.half[0], other.half[0], 3 * sizeof(double) * 37 * 19) != 0, room_names[kinds[r]], "another seed changes nothing");
        pt_film_free(&other);
        pt_film_free(&first);
        pt_scene_free(&s.scene);
    }
}

/* 8 samples, then 24 more, are 32 at once; so are parts of the samples merged, but for the order of sums. */
static void passes(void)
{
    int kind, single;
    for (kind = PT_SAMPLER_SOBOL; kind <= PT_SAMPLER_INDEPENDENT; kind++)
        for (single = 0; single < 2; single++) {
            stage s = room(MANY_LAMPS);
            pt_render_desc d = desc_of(&s, 20, 11, 32);
            pt_film whole, film = PT_FILM_INIT, part[3];
            double worst = 0;
            int i, h;
            d.sampler = (pt_sampler_kind)kind;
            d.single_net = single;
            whole = render(&s, &d, 1, NULL);
            d.spp = 8;
            pt_check(pt_render(&s.scene, &d, &film, NULL) == PT_OK, "8 samples", "fails");
            d.spp = 32;
            d.tile = 7;
            pt_check(pt_render(&s.scene, &d, &film, NULL) == PT_OK && same_film(&film, &whole), "8 samples, then 24 more", "are not 32 at once");
            pt_film_free(&film);
            for (i = 0; i < 3; i++) {
                static const uint32_t begin[4] = {0, 3, 12, 32};
                d.first_sample = begin[i];
                d.spp = begin[i + 1] - begin[i];
                part[i] = render(&s, &d, 1, NULL);
            }
            pt_check(pt_film_merge(&part[2], &part[0]) == PT_OK && pt_film_merge(&part[2], &part[1]) == PT_OK, "films of parts of the samples", "do not merge");
            for (h = 0; h < 2; h++)
                for (i = 0; i < 3 * 20 * 11; i++) {
                    const double a = part[2].half[h][i], b = whole.half[h][i];
                    if (a != b) worst = fmax(worst, fabs(a - b) / fmax(fabs(a), fabs(b)));
                }
            pt_check(worst <= 1e-12 && pt_film_spp(&part[2]) == 32, "films of parts of the samples", "are off by %g", worst);
            for (i = 0; i < 3; i++) pt_film_free(&part[i]);
            pt_film_free(&whole);
            pt_scene_free(&s.scene);
        }
}

/* One sample in each half: other random numbers, and about the same light. */
static void halves(void)
{
    int kind, i, same = 0;
    for (kind = PT_SAMPLER_SOBOL; kind <= PT_SAMPLER_INDEPENDENT; kind++) {
        stage s = room(MANY_LAMPS);
        pt_render_desc d = desc_of(&s, 30, 30, 2);
        double sum[2] = {0, 0};
        pt_film film;
        d.sampler = (pt_sampler_kind)kind;
        film = render(&s, &d, 1, NULL);
        for (i = 0; i < 30 * 30; i++) {
            sum[0] += film.half[0][3 * i];
            sum[1] += film.half[1][3 * i];
            same += memcmp(film.half[0] + 3 * i, film.half[1] + 3 * i, 3 * sizeof(double)) == 0;
        }
        pt_check(same < 300, pt_sampler_name(d.sampler), "%d of 900 pixels are the same in both halves", same);
        pt_check(sum[0] > 0.5 * sum[1] && sum[1] > 0.5 * sum[0], pt_sampler_name(d.sampler), "%g in one half, %g in the other", sum[0], sum[1]);
        pt_film_free(&film);
        pt_scene_free(&s.scene);
    }
}

static int stop_at_once(void *user) { return ++*(int *)user >= 1; }
static int stop_progress(void *user, const pt_progress *p) { return ++*(int *)user >= 1 && p->seconds >= 0; }

/* Walls that lose nothing: a path has some 2^24 edges and more. Neither a poll, a callback nor a budget waits for its end. */
static void endless(void)
{
    stage s = furnace(BALL, 1, 0);
    pt_render_desc d = desc_of(&s, 16, 16, 4);
    int way;
    for (way = 0; way < 4; way++) {
        pt_film film = PT_FILM_INIT;
        pt_report report = PT_REPORT_INIT;
        pt_result result;
        int calls = 0;
        d = desc_of(&s, 16, 16, 4);
        d.threads = way == 0 ? 1 : 2;
        if (way == 0) d.li.poll = stop_at_once, d.li.poll_user = &calls;
        if (way == 1) d.progress = stop_progress, d.progress_user = &calls;
        if (way == 2) d.seconds = 0.1;
        if (way == 3) d.cpu_seconds = 0.1;
        result = pt_render(&s.scene, &d, &film, &report);
        pt_check(result == (way < 2 ? PT_ERROR_CANCELLED : PT_OK) && pt_film_spp(&film) == 0 && report.spp == 0,
                 label("stopped inside a path, way %d", way), "%s, %u samples", pt_result_string(result), (unsigned)pt_film_spp(&film));
        pt_check(strncmp(report.body, "lockstep", 8) == 0 && (way > 1 || calls >= 1), label("stopped inside a path, way %d", way), "%s, %d calls",
                 report.body, calls);
        pt_film_free(&film);
        pt_report_free(&report);
    }
    pt_scene_free(&s.scene);
}

/* What was rendered before a render is cancelled stays, and can be gone on with. */
typedef struct stopper {
    int calls;
    double spp;
} stopper;
static int stop_later(void *user, const pt_progress *p)
{
    stopper *t = (stopper *)user;
    t->calls++;
    t->spp = p->spp;
    return p->spp >= 4;
}
static void cancelled(void)
{
    stage s = room(SPHERES);
    pt_render_desc d = desc_of(&s, 48, 40, 1000000);
    pt_film film = PT_FILM_INIT, whole;
    pt_report report = PT_REPORT_INIT;
    stopper t = {0, 0};
    pt_result result;
    d.progress = stop_later;
    d.progress_user = &t;
    result = pt_render(&s.scene, &d, &film, &report);
    pt_check(result == PT_ERROR_CANCELLED && t.calls > 0 && report.spp >= 2 && report.spp < 1000000 && report.spp == pt_film_spp(&film), "cancelled",
             "%s, %u samples", pt_result_string(result), (unsigned)report.spp);
    d.progress = NULL;
    d.spp = report.spp + 3;
    pt_check(pt_render(&s.scene, &d, &film, NULL) == PT_OK, "cancelled, then continued", "fails");
    whole = render(&s, &d, 1, NULL);
    pt_check(same_film(&film, &whole), "cancelled, then continued", "is not the undisturbed film");
    pt_film_free(&film);
    pt_film_free(&whole);
    d.spp = 0;
    d.cpu_seconds = 0.05;
    pt_check(pt_render(&s.scene, &d, &film, &report) == PT_OK && report.spp > 0 && strcmp(report.stopped_by, "CPU seconds") == 0, "a budget of CPU seconds",
             "%u samples, stopped by %s", (unsigned)report.spp, report.stopped_by);
    pt_film_free(&film);
    pt_report_free(&report);
    pt_scene_free(&s.scene);
}

/* ---- time: no path is caught in glass -------------------------------------------------------------------------- */

/* Glass: a box in a room; a ball that touches a wide floor, seen in the gap there, and one that stands in it. */
static stage glass_scene(int kind)
{
    const double y = kind == 1 ? 0.4 : 0.1;
    stage s;
    if (kind == 0) return room(GLASS_BOX);
    memset(&s, 0, sizeof s);
    pt_add_parallelogram(&s.scene, v3(-50, 0, -50), v3(0, 0, 100), v3(100, 0, 0), diffuse(&s.scene, 0.9, 0.9, 0.9));
    add_ball(&s.scene, &HERE, 0, y, 0, 0.4, pt_add_material(&s.scene, pt_material_dielectric((pt_real)1.5)));
    add_ball(&s.scene, &HERE, 0, 5, 0, 2, lamp(&s.scene, 1, 1, 1));
    s.camera = kind == 1 ? camera_at(&HERE, 0, 0.02, 1, 0, 0, 0, 0.7) : camera_at(&HERE, 0, 0.3, 1, 0, 0, 0.38, 1);
    commit(&s);
    return s;
}

static double rays_a_path(const stage *s, int lockstep, int renders, uint32_t spp)
{
    double edges = 0;
    int k;
    for (k = 0; k < renders; k++) {
        pt_render_desc d = desc_of(s, 9, 6, spp);
        uint64_t rays;
        pt_film film;
        d.seed = 301000u + (uint64_t)k;
        d.no_lockstep = !lockstep;
        d.li.max_edges = 1 << 20;
        d.li.roulette_scale = 4;
        film = render(s, &d, lockstep, &rays);
        edges += (double)rays;
        pt_film_free(&film);
    }
    return edges / (54.0 * spp * renders);
}

/* A ray that gets into glass at an angle that no refraction gives is reflected totally for ever, or until it comes by where it
   got in: then paths are longer than one at a time. */
static void not_caught(void)
{
    static const char *const names[3] = {"box of glass", "glass ball on the floor", "glass ball in the floor"};
    int kind;
    for (kind = 0; kind < 3; kind++) {
        const int few = pt_test.is_short || !WHOLE;
        stage s = glass_scene(kind);
        const double a = rays_a_path(&s, 1, few ? 16 : 32, kind == 0 || few ? 64 : 128), b = rays_a_path(&s, 0, 16, 32);
        pt_check(fabs(a - b) < 0.08 * b, names[kind], "%.2f rays a path, one at a time %.2f", a, b);
        if (pt_test.is_verbose) printf("       %s: %.2f rays a path, one at a time %.2f\n", names[kind], a, b);
        pt_scene_free(&s.scene);
    }
}

/* ---- lanes ------------------------------------------------------------------------------------------------ */

static double between(pt_pcg32 *rng, double low, double high) { return low + (high - low) * pt_pcg32_double(rng); }

static uint32_t odd_word(pt_pcg32 *rng)
{
    static const uint32_t odd[8] = {0, 1, 0x7fffffffu, 0x80000000u, 0xffffffffu, 0xfffffffeu, 0x55555555u, 0x0000ffffu};
    const uint32_t k = pt_pcg32_next(rng) % 16;
    return k < 8 ? odd[k] : pt_pcg32_next(rng);
}

static void words(void)
{
    static const char *const names[12] = {"add", "mul", "xor", "or", "and", "shl", "shr", "spread", "reverse", "set", "masks", "scramble"};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(1), 1);
    int wrong[12] = {0}, i, k;
    for (i = 0; i < (int)pt_test_samples(20000); i++) {
        pti_lane_row x, y, r[12];
        const int n = i % 32;
        const unsigned all = ~0u >> (32 - PTI_WIDTH), a = pt_pcg32_next(&rng) & all, b = pt_pcg32_next(&rng) & all;
        for (k = 0; k < PTI_WIDTH; k++) {
            x.bits[k] = odd_word(&rng);
            y.bits[k] = odd_word(&rng);
        }
        r[0].u = pti_uw_add(x.u, y.u);
        r[1].u = pti_uw_mul(x.u, y.u);
        r[2].u = pti_uw_xor(x.u, y.u);
        r[3].u = pti_uw_or(x.u, y.u);
        r[4].u = pti_uw_and(x.u, y.u);
        r[5].u = pti_uw_shl(x.u, n);
        r[6].u = pti_uw_shr(x.u, n);
        r[7].u = pti_uw_spread(x.u);
        r[8].u = pti_lock_reverse(x.u);
        r[9].u = pti_uw_set(x.bits[i % PTI_WIDTH]);
        r[11].u = pti_lock_scramble(x.u, y.u);
        for (k = 0; k < PTI_WIDTH; k++) {
            const uint32_t p = x.bits[k], q = y.bits[k];
            wrong[0] += r[0].bits[k] != p + q;
            wrong[1] += r[1].bits[k] != p * q;
            wrong[2] += r[2].bits[k] != (p ^ q);
            wrong[3] += r[3].bits[k] != (p | q);
            wrong[4] += r[4].bits[k] != (p & q);
            wrong[5] += r[5].bits[k] != p << n;
            wrong[6] += r[6].bits[k] != p >> n;
            wrong[7] += r[7].bits[k] != (p >> 31 ? 0xffffffffu : 0);
            wrong[8] += r[8].bits[k] != pti_reverse_bits(p);
            wrong[9] += r[9].bits[k] != x.bits[i % PTI_WIDTH];
            wrong[11] += r[11].bits[k] != pti_laine_karras(p, q);
        }
        wrong[10] += pti_mw_bits(pti_mw_of_bits(a)) != a || pti_mw_bits(pti_mw_of_bits(~0u)) != all;
        wrong[10] += pti_mw_bits(pti_mw_and(pti_mw_of_bits(a), pti_mw_of_bits(b))) != (a & b);
        wrong[10] += pti_mw_bits(pti_mw_or(pti_mw_of_bits(a), pti_mw_of_bits(b))) != (a | b);
    }
    for (k = 0; k < 12; k++) pt_check(wrong[k] == 0, label("words of lanes, %s", names[k]), "%d lanes differ from C", wrong[k]);
}

static void floats(void)
{
    static const char *const names[14] = {"add", "sub", "mul", "div", "min", "max", "sqrt", "abs", "select", "lt", "le", "madd", "nmadd", "words and tables"};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(2), 2);
    float table[64];
    int wrong[14] = {0}, i, k;
    for (k = 0; k < 64; k++) table[k] = hostile_float(&rng);
    for (i = 0; i < (int)pt_test_samples(20000); i++) {
        pti_lane_row x, y, z, w, r[11], from, to, got;
        unsigned less, at_most;
        for (k = 0; k < PTI_WIDTH; k++) {
            x.v[k] = hostile_float(&rng);
            y.v[k] = pt_pcg32_next(&rng) % 4 ? hostile_float(&rng) : x.v[k];
            z.v[k] = hostile_float(&rng);
            w.bits[k] = pt_pcg32_next(&rng) >> 8;
        }
        r[0].f = pti_fw_add(x.f, y.f);
        r[1].f = pti_fw_sub(x.f, y.f);
        r[2].f = pti_fw_mul(x.f, y.f);
        r[3].f = pti_fw_div(x.f, y.f);
        r[4].f = pti_fw_min(x.f, y.f);
        r[5].f = pti_fw_max(x.f, y.f);
        r[6].f = pti_fw_sqrt(x.f);
        r[7].f = pti_fw_abs(x.f);
        r[8].f = pti_fw_select(pti_fw_lt(x.f, y.f), x.f, z.f);
        r[9].f = pti_fw_madd(x.f, y.f, z.f);
        r[10].f = pti_fw_nmadd(x.f, y.f, z.f);
        less = pti_mw_bits(pti_fw_lt(x.f, y.f));
        at_most = pti_mw_bits(pti_fw_le(x.f, y.f));
        from.f = pti_fw_from_words(w.u);
        to.u = pti_uw_from_floats(pti_fw_add(from.f, pti_fw_set(0.25f)));
        got.f = pti_fw_gather(table, pti_uw_and(w.u, pti_uw_set(63)));
        for (k = 0; k < PTI_WIDTH; k++) {
            const float a = x.v[k], b = y.v[k], c = z.v[k];
            wrong[0] += !same_float(r[0].v[k], a + b);
            wrong[1] += !same_float(r[1].v[k], a - b);
            wrong[2] += !same_float(r[2].v[k], a * b);
            wrong[3] += !same_float(r[3].v[k], a / b);
            wrong[4] += memcmp(&r[4].v[k], a < b ? &a : &b, sizeof a) != 0;
            wrong[5] += memcmp(&r[5].v[k], a > b ? &a : &b, sizeof a) != 0;
            wrong[6] += !same_float(r[6].v[k], sqrtf(a));
            wrong[7] += !same_float(r[7].v[k], fabsf(a));
            wrong[8] += memcmp(&r[8].v[k], a < b ? &a : &c, sizeof a) != 0;
            wrong[9] += (less >> k & 1) != (a < b);
            wrong[10] += (at_most >> k & 1) != (a <= b);
            wrong[11] += !same_float(r[9].v[k], a * b + c) && !same_float(r[9].v[k], fmaf(a, b, c));
            wrong[12] += !same_float(r[10].v[k], c - a * b) && !same_float(r[10].v[k], fmaf(-a, b, c));
            wrong[13] += !same_float(from.v[k], (float)w.bits[k]) || !same_float(got.v[k], table[w.bits[k] & 63]);
            wrong[13] += w.bits[k] < 1u << 22 && to.bits[k] != w.bits[k];
        }
        wrong[9] += (less >> (PTI_WIDTH - 1) >> 1) != 0;
        wrong[10] += (at_most >> (PTI_WIDTH - 1) >> 1) != 0;
    }
    for (k = 0; k < 14; k++) pt_check(wrong[k] == 0, label("floats of lanes, %s", names[k]), "%d lanes differ from C", wrong[k]);
}

/* The bounds of the series; pti_lock_turn doubles the angle twice, and with it the error. */
static void angles(void)
{
    double worst[4] = {0, 0, 0, 0};
    int i, k;
    for (i = -50000; i < 50000; i++) {
        pti_lane_row x, s, c;
        for (k = 0; k < PTI_WIDTH; k++) x.v[k] = (float)(PT_PI / 4 * (i + k / (double)PTI_WIDTH) / 50000);
        if (i + 1 == 50000) x.v[PTI_WIDTH - 1] = (float)(PT_PI / 4);
        pti_fw_sincos(x.f, &s.f, &c.f);
        for (k = 0; k < PTI_WIDTH; k++) {
            worst[0] = fmax(worst[0], fabs((double)s.v[k] - sin((double)x.v[k])));
            worst[1] = fmax(worst[1], fabs((double)c.v[k] - cos((double)x.v[k])));
        }
        for (k = 0; k < PTI_WIDTH; k++) x.v[k] = (float)((i + 50000 + k / (double)PTI_WIDTH) / 100000);
        pti_lock_turn(x.f, &c.f, &s.f);
        for (k = 0; k < PTI_WIDTH; k++) {
            worst[2] = fmax(worst[2], fabs((double)s.v[k] - sin(2 * PT_PI * (double)x.v[k])));
            worst[3] = fmax(worst[3], fabs((double)c.v[k] - cos(2 * PT_PI * (double)x.v[k])));
        }
    }
    pt_check(worst[0] < PTI_2_M24 && worst[1] < 2 * PTI_2_M24, "sine and cosine", "off by %.3g and %.3g of 2^-24", worst[0] / PTI_2_M24, worst[1] / PTI_2_M24);
    pt_check(worst[2] < 16 * PTI_2_M24 && worst[3] < 16 * PTI_2_M24, "sine and cosine of a turn", "off by %.3g and %.3g of 2^-24", worst[2] / PTI_2_M24,
             worst[3] / PTI_2_M24);
}

/* ---- numbers --------------------------------------------------------------------------------------------------- */

static void sobol_points(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(3), 3);
    int wrong = 0, i, d, k;
    for (i = 0; i < 3000; i++)
        for (d = 0; d < 4; d++) {
            pti_lane_row n, x;
            for (k = 0; k < PTI_WIDTH; k++) n.bits[k] = odd_word(&rng);
            x.u = pti_lock_sobol(n.u, d);
            for (k = 0; k < PTI_WIDTH; k++) wrong += x.bits[k] != pti_sobol_reversed(n.bits[k], d);
        }
    pt_check(wrong == 0, "Sobol points in lanes", "%d are others", wrong);
}

/* The numbers of the film and of the first vertex are those that pt_sampler has for these dimensions. */
static void sampler_numbers(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(4), 4);
    int wrong[8] = {0}, i, lane, k;
    stage s = room(SPHERES);
    pti_lockstep ready;
    pti_lock_work *work = (pti_lock_work *)calloc(1, sizeof *work);
    if (!work || !pti_lockstep_make(&ready, &s.scene, s.camera.position)) {
        pt_check(0, "numbers of the sampler", "no memory, or no scene for lanes");
        return;
    }
    work->k = &ready;
    for (i = 0; i < (int)pt_test_samples(2000); i++) {
        const uint64_t seed = ((uint64_t)odd_word(&rng) << 32) | odd_word(&rng);
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, seed, 0);
        pti_lock_batch batch;
        pti_lane_row row[PTI_ROWS], film[4], got[8];
        pti_lock_numbers u;
        uint64_t stream[PTI_WIDTH];
        uint32_t index[PTI_WIDTH];
        memset(&batch, 0, sizeof batch);
        memset(row, 0, sizeof row);
        for (lane = 0; lane < PTI_WIDTH; lane++) {
            pti_lock_seeds seeds;
            memset(&seeds, 0xff, sizeof seeds);
            stream[lane] = i % 2 ? pt_pcg32_next(&rng) % 100000 : ((uint64_t)pt_pcg32_next(&rng) << 3);
            index[lane] = i % 3 ? pt_pcg32_next(&rng) % 1000 : odd_word(&rng);
            pti_lock_seed(&seeds, &sampler, stream[lane]);
            pti_lock_lane(&batch, row, lane, &seeds, index[lane]);
        }
        pti_lock_draw(work, &batch, row, 1, 0, film, &u);
        got[0].f = film[0].f;
        got[1].f = film[1].f;
        got[2].f = u.bsdf0;
        got[3].f = u.bsdf1;
        got[4].f = u.light0;
        got[5].f = u.light1;
        got[6].f = u.which;
        got[7].f = u.lobe;
        for (lane = 0; lane < PTI_WIDTH; lane++) {
            static const uint32_t dimension[8] = {PT_DIM_FILM, PT_DIM_FILM + 1, 4 + PT_DIM_BSDF, 4 + PT_DIM_BSDF + 1, 4 + PT_DIM_LIGHT, 4 + PT_DIM_LIGHT + 1,
                                                  4 + PT_DIM_LIGHT_CHOICE, 4 + PT_DIM_LOBE};
            pt_sampler_start(&sampler, stream[lane], index[lane]);
            for (k = 0; k < 8; k++) {
                pt_sampler_seek(&sampler, dimension[k]);
                wrong[k] += got[k].v[lane] != pt_sampler_1d(&sampler);
            }
        }
    }
    for (k = 0; k < 8; k++) pt_check(wrong[k] == 0, label("number %d of the sampler in lanes", k), "%d are others", wrong[k]);
    free(work);
    pt_scene_free(&s.scene);
}

/* xoroshiro64* as published, in C. */
static uint32_t plain_xoroshiro(uint32_t s[2])
{
    const uint32_t result = s[0] * 0x9e3779bbu, t = s[1] ^ s[0];
    s[0] = ((s[0] << 26) | (s[0] >> 6)) ^ t ^ (t << 9);
    s[1] = (t << 13) | (t >> 19);
    return result;
}

static void generator(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(5), 5);
    pti_lane_row a, b, x;
    uint32_t state[PTI_WIDTH][2];
    int wrong = 0, i, k;
    for (k = 0; k < PTI_WIDTH; k++) {
        state[k][0] = a.bits[k] = odd_word(&rng);
        state[k][1] = b.bits[k] = odd_word(&rng) | 1u;
    }
    for (i = 0; i < 20000; i++) {
        x.f = pti_lock_next(&a.u, &b.u);
        for (k = 0; k < PTI_WIDTH; k++) wrong += x.v[k] != (float)(plain_xoroshiro(state[k]) >> 8) / 16777216 || !(x.v[k] < 1);
    }
    for (k = 0; k < PTI_WIDTH; k++) wrong += a.bits[k] != state[k][0] || b.bits[k] != state[k][1];
    pt_check(wrong == 0, "xoroshiro64* in lanes", "%d numbers are others", wrong);
}

/* Pairs of numbers that must be independent: of one path, of neighbours in the picture, of samples in a row. 16 x 16 cells. */
enum { PAIRS = 6 };
static const char *const pair_names[PAIRS] = {"numbers 1 and 2 of a path",      "numbers 7 and 8",  "the first of neighbours", "the second of samples in a row",
                                              "the first of both halves", "numbers 1 and 3, of seeds in a row"};

static void first_numbers(uint64_t seed, uint64_t stream, uint32_t index, double x[8])
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, seed, 0);
    pti_lock_seeds seeds;
    pti_lock_batch batch;
    pti_lane_row row[PTI_ROWS], value;
    int k;
    memset(&seeds, 0xff, sizeof seeds);
    memset(row, 0, sizeof row);
    pti_lock_seed(&seeds, &sampler, stream);
    for (k = 0; k < PTI_WIDTH; k++) pti_lock_lane(&batch, row, k, &seeds, index);
    for (k = 0; k < 8; k++) {
        value.f = pti_lock_next(&row[PTI_ROW_A].u, &row[PTI_ROW_B].u);
        x[k] = (double)value.v[k % PTI_WIDTH];
    }
}

static void numbers_of_paths(void)
{
    static double observed[PAIRS][256], expected[256], all[2][256];
    const int n = (int)pt_test_all_samples(120000);
    const uint64_t seed = pt_test_seed(700000);
    int i, k;
    pt_test_source("uniform numbers");
    memset(observed, 0, sizeof observed);
    memset(all, 0, sizeof all);
    for (i = 0; i < n; i++) {
        double x[8], y[8], pair[PAIRS][2];
        const uint64_t pixel = (uint64_t)i / 40, other = i % 4 == 0 ? 2 * pixel + 2 : i % 4 == 1 ? 2 * pixel : i % 4 == 2 ? 2 * pixel + 1 : 2 * pixel;
        const uint32_t index = (uint32_t)i % 40;
        first_numbers(seed, 2 * pixel, index, x);
        if (i % 4 == 0) first_numbers(seed, other, index, y);                 /* the pixel on the right */
        else if (i % 4 == 1) first_numbers(seed, other, index + 1, y);        /* the next sample        */
        else if (i % 4 == 2) first_numbers(seed, other, index, y);            /* the other half         */
        else first_numbers(seed + 1, other, index, y);
        pair[0][0] = x[0], pair[0][1] = x[1];
        pair[1][0] = x[6], pair[1][1] = x[7];
        pair[2][0] = pair[4][0] = x[0], pair[2][1] = pair[4][1] = y[0];
        pair[3][0] = x[1], pair[3][1] = y[1];
        pair[5][0] = x[0], pair[5][1] = y[2];
        for (k = 0; k < PAIRS; k++)
            if (k < 2 || (k == 2 && i % 4 == 0) || (k == 3 && i % 4 == 1) || (k == 4 && i % 4 == 2) || (k == 5 && i % 4 == 3))
                observed[k][(int)(16 * pair[k][0]) + 16 * (int)(16 * pair[k][1])]++;
        for (k = 0; k < 8; k++) {
            all[0][(int)(256 * x[k])]++;
            all[1][(int)(65536 * x[k]) & 255]++; /* what comes below the first eight bits */
        }
    }
    for (k = 0; k < PAIRS; k++) {
        double total = 0;
        for (i = 0; i < 256; i++) total += observed[k][i];
        for (i = 0; i < 256; i++) expected[i] = total / 256;
        pt_check_chi2(pair_names[k], observed[k], expected, 256, "paths share random numbers");
    }
    for (i = 0; i < 256; i++) expected[i] = 8.0 * n / 256;
    pt_check_chi2("bits 0 to 7 of all", all[0], expected, 256, "not uniform");
    pt_check_chi2("bits 8 to 15 of all", all[1], expected, 256, "not uniform");
}

/* ---- densities ------------------------------------------------------------------------------------------------- */

static void set3(pti_lane_row row[3], int lane, pt_vec3 v)
{
    row[0].v[lane] = (float)v.x;
    row[1].v[lane] = (float)v.y;
    row[2].v[lane] = (float)v.z;
}
static pti_d3 get3(const pti_lane_row row[3], int lane) { return pti_d((double)row[0].v[lane], (double)row[1].v[lane], (double)row[2].v[lane]); }

static pt_vec3 any_direction(pt_pcg32 *rng)
{
    const float x = (float)(pt_pcg32_next(rng) >> 8) / 16777216, y = (float)(pt_pcg32_next(rng) >> 8) / 16777216;
    return pt_warp_sphere(pt_v2(x, y));
}

/* Cells of two numbers that are uniform in [0,1] if the density is right. */
enum { CELLS = 24 };
typedef struct cells {
    double observed[CELLS * CELLS];
    int n, out;
} cells;
static void count_cell(cells *c, double x, double y)
{
    c->n++;
    if (!(x > -1e-5 && x < 1 + 1e-5 && y > -1e-5 && y < 1 + 1e-5)) c->out++;
    else {
        const int i = (int)fmin(fmax(CELLS * x, 0), CELLS - 1), j = (int)fmin(fmax(CELLS * y, 0), CELLS - 1);
        c->observed[CELLS * i + j]++;
    }
}
static void check_cells(const char *name, const cells *c)
{
    double expected[CELLS * CELLS];
    int i;
    for (i = 0; i < CELLS * CELLS; i++) expected[i] = (double)c->n / (CELLS * CELLS);
    pt_check(c->out == 0, name, "%d of %d are where the density is 0", c->out, c->n);
    pt_check_chi2(name, c->observed, expected, CELLS * CELLS, "samples do not follow their density");
}

/* Azimuth about n as a number in [0,1). */
static double azimuth(pt_vec3 n, pti_d3 w)
{
    const pt_frame f = pt_frame_from_normal(n);
    return (atan2(pti_d_dot(w, pti_d_from(f.t)), pti_d_dot(w, pti_d_from(f.s))) + PT_PI) / (2 * PT_PI);
}

static pti_fw draws(pt_pcg32 *rng)
{
    pti_lane_row r;
    int k;
    for (k = 0; k < PTI_WIDTH; k++) r.v[k] = (float)(pt_pcg32_next(rng) >> 8) / 16777216;
    return r.f;
}

static void cosines(void)
{
    static cells c;
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(710000), 6);
    const int n = (int)pt_test_all_samples(20000);
    double length = 0, off = 0;
    int i, k, below = 0;
    pt_test_source("density cos / pi");
    memset(&c, 0, sizeof c);
    for (i = 0; i < n; i++) {
        pti_lane_row normal[3], out[3], z;
        for (k = 0; k < PTI_WIDTH; k++) set3(normal, k, i % 50 ? any_direction(&rng) : v3(0, 0, k % 2 ? 1 : -1));
        pti_row3_set(out, pti_lock_cosine(pti_row3(normal), draws(&rng), draws(&rng), &z.f));
        for (k = 0; k < PTI_WIDTH; k++) {
            const pti_d3 w = get3(out, k), m = get3(normal, k);
            const double cosine = pti_d_dot(w, m);
            length = fmax(length, fabs(pti_d_length(w) - 1));
            off = fmax(off, fabs(cosine - (double)z.v[k]));
            below += !(z.v[k] > 0) || !(cosine > -1e-6);
            count_cell(&c, fmin(cosine * cosine, 1), azimuth(v3(m.x, m.y, m.z), w));
        }
    }
    pt_check(length < 4 * PTI_2_M24 && off < 16 * PTI_2_M24 && below == 0, "directions by the cosine", "lengths off by %.3g, cosines by %.3g of 2^-24, %d from below",
             length / PTI_2_M24, off / PTI_2_M24, below);
    check_cells("directions by the cosine", &c);
}

/* Metal against the double arithmetic of [PT-04], which has its own tests. */
static void fresnel_of_metal(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(715000), 6);
    double worst = 0;
    int i, k;
    for (i = 0; i < (int)pt_test_samples(20000); i++) {
        pti_lane_row c, eta, kappa, f;
        c.f = draws(&rng);
        for (k = 0; k < PTI_WIDTH; k++) {
            eta.v[k] = (float)pow(10, between(&rng, -6, 2));
            kappa.v[k] = i % 7 ? (float)pow(10, between(&rng, -2, 5)) : 0;
            if (i % 11 == 0) c.v[k] = k % 2 ? 1.0f : 0.0f;
        }
        f.f = pti_lock_fresnel(c.f, eta.f, kappa.f);
        for (k = 0; k < PTI_WIDTH; k++) {
            /* near the critical angle of eta < 1 the root of the cosine's rounding is left: so what is asked is the value at a point nearby */
            const double x = (double)c.v[k], n = (double)eta.v[k], m = (double)kappa.v[k], u4 = 4 * PTI_2_M24;
            const double slope = fabs(pt_fresnel_conductor(x + u4, n, m) - pt_fresnel_conductor(fmax(0, x - u4), n, m)) +
                                 fabs(pt_fresnel_conductor(x, n * (1 + u4), m) - pt_fresnel_conductor(x, n * (1 - u4), m));
            const double off = fabs((double)f.v[k] - pt_fresnel_conductor(x, n, m)) - slope;
            if (!(off <= worst)) worst = off;
        }
    }
    pt_check(worst < 64 * PTI_2_M24, "reflection of metal", "off by %.3g of 2^-24", worst / PTI_2_M24);
}

/* How far off a value is, of what floats may be: directions are off by 4 u, and half vectors by 4 u / (o.h), which is
   16 u / alpha / (o.h) of a density; a cosine is off by 4 u. */
static double facet_error(double got, double exact, const pti_pair *p, double alpha)
{
    const double oh = 0.5 * pti_d_length(pti_d_add(p->o, p->i));
    return fabs(got - exact) / ((16 / (alpha * oh) + 16 / p->i.z + 16 / p->o.z + 64) * PTI_2_M24 * exact);
}

typedef struct facet_errors {
    double density, value, weight, direction, sides;
    int dead, lanes;
} facet_errors;

static void look_at_facets(const pt_scene *s, const pti_lockstep *ready, int which, pt_pcg32 *rng, facet_errors *worst)
{
    const pt_material *m = &s->materials[which];
    const double a = (double)m->roughness * (double)m->roughness;
    pti_lane_row normal[3], d[3], axis[2][3], o[3], i[3], density, next[3], weight[3], reflected[3], of_reflected, u[2];
    pti_lock_surface at;
    pti_lock_facets f;
    pti_w3 w = pti_w3_make(pti_fw_set(1), pti_fw_set(1), pti_fw_set(1));
    pti_mw above;
    pt_bsdf b;
    int k;
    memset(&b, 0, sizeof b);
    b.material = m;
    b.albedo = grey(1);
    for (k = 0; k < PTI_WIDTH; k++) {
        const pt_vec3 n = any_direction(rng), back = any_direction(rng);
        set3(normal, k, n);
        set3(d, k, pt_v3_scale(back, pt_v3_dot(n, back) > 0 ? -1.0f : 1.0f));
    }
    at.n = pti_row3(normal);
    at.cosine = pti_fw_abs(pti_w3_dot(at.n, pti_row3(d)));
    at.i = pti_uw_set((uint32_t)which);
    u[0].f = draws(rng);
    u[1].f = draws(rng);
    pti_lock_find_facets(ready, &at, pti_row3(d), &f);
    pti_row3_set(next, pti_lock_glossy(ready, &at, &f, u[0].f, u[1].f, &density.f, &w, &above));
    pti_row3_set(weight, w);
    pti_row3_set(axis[0], f.s);
    pti_row3_set(axis[1], f.t);
    pti_row3_set(o, f.o);
    pti_row3_set(i, pti_w3_make(pti_w3_dot(pti_row3(next), f.s), pti_w3_dot(pti_row3(next), f.t), pti_w3_dot(pti_row3(next), at.n)));
    pti_row3_set(reflected, pti_lock_reflect(ready, &at, &f, pti_row3(i), &of_reflected.f));
    for (k = 0; k < PTI_WIDTH; k++) {
        const pti_d3 from = get3(o, k), h = pti_ggx_visible_draw(from, a, (double)u[0].v[k], (double)u[1].v[k]);
        const pti_d3 exact = pti_d_sub(pti_d_scale(h, 2 * pti_d_dot(from, h)), from);
        const int alive = pti_mw_bits(above) >> k & 1;
        double f_cos;
        pti_pair p;
        p.o = from;
        p.i = get3(i, k);
        p.eta = 1;
        worst->lanes++;
        worst->dead += !alive;
        worst->sides += fabs(exact.z) > 64 * PTI_2_M24 && alive != (exact.z > 0);
        if (!alive || p.i.z < 1e-3 || from.z < 1e-3) continue;
        worst->direction = fmax(worst->direction, pti_d_length(pti_d_sub(p.i, exact)) / PTI_2_M24);
        f_cos = (double)pti_eval_microfacet(&b, &p, PT_RADIANCE).g * p.i.z;
        worst->density = fmax(worst->density, facet_error((double)density.v[k], pti_pdf_microfacet(&b, &p), &p, a));
        worst->density = fmax(worst->density, facet_error((double)of_reflected.v[k], pti_pdf_microfacet(&b, &p), &p, a));
        worst->value = fmax(worst->value, facet_error((double)reflected[1].v[k], f_cos, &p, a));
        worst->weight = fmax(worst->weight, facet_error((double)weight[1].v[k] * pti_pdf_microfacet(&b, &p), f_cos, &p, a));
    }
}

static void facets(void)
{
    enum { ALPHAS = 6 };
    static const double alphas[ALPHAS] = {5e-4, 5e-3, 0.02, 0.1, 0.5, 1};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(716000), 6);
    pti_lockstep ready;
    stage s;
    int i, k;
    memset(&s, 0, sizeof s);
    for (k = 0; k < ALPHAS; k++) {
        const double corner[3] = {k, 0, 0}, x[3] = {0.8, 0, 0}, y[3] = {0, 0, 0.8};
        pt_material m = pt_material_conductor(rgb(0.14, 0.37, 1.44), rgb(3.98, 2.38, 1.6), (pt_real)sqrt(alphas[k]));
        add_face(&s.scene, PARALLELOGRAM, &HERE, corner, x, y, pt_add_material(&s.scene, m));
    }
    commit(&s);
    pt_check(pti_lockstep_make(&ready, &s.scene, v3(0, 0, 0)), "facets", "not for lanes");
    for (k = 0; k < ALPHAS; k++) {
        facet_errors worst;
        memset(&worst, 0, sizeof worst);
        for (i = 0; i < (int)pt_test_samples(20000); i++) look_at_facets(&s.scene, &ready, k, &rng, &worst);
        /* a point of the cap that is nearly opposite leaves a short normal, off by u over its length */
        pt_check(worst.direction < 1024 && worst.sides == 0, label("facets, alpha %g", alphas[k]), "directions are off by %.3g of 2^-24, %g on the wrong side",
                 worst.direction, worst.sides);
        pt_check(worst.density < 1, label("facets, alpha %g", alphas[k]), "density off by %.3g of its bound", worst.density);
        pt_check(worst.value < 1 && worst.weight < 1, label("facets, alpha %g", alphas[k]), "value off by %.3g, weight by %.3g of the bound", worst.value, worst.weight);
        pt_check(worst.dead < worst.lanes / 3, label("facets, alpha %g", alphas[k]), "%d of %d paths end", worst.dead, worst.lanes);
        if (pt_test.is_verbose) printf("       alpha %g: %g %g %g %g %d\n", alphas[k], worst.direction, worst.density, worst.value, worst.weight, worst.dead);
    }
    pt_scene_free(&s.scene);
}

/* Points of lights, and the density that goes with them: a ball seen from three places, a parallelogram, a triangle. */
enum { OUTSIDE, NEAR_BY, INSIDE, FLAT, CORNERED, LIT };
static const char *const lit_names[LIT] = {"ball from outside", "ball from near by", "ball from inside", "parallelogram", "triangle"};
static const double BALL_RADIUS = 0.4;

typedef struct lit {
    cells c;
    double density, height, off; /* of the samples; how far points are off, and directions, in e */
} lit;

/* 1 - cos of the cone in which the ball is seen; all directions from inside. */
static double cone_of(int kind, double distance)
{
    const double sine = BALL_RADIUS / distance;
    return kind == INSIDE ? 2 : sine * sine / (1 + sqrt(1 - sine * sine));
}

static void ball_points(const pti_lockstep *ready, int kind, int light, pt_vec3 p, const pti_lock_numbers *u, lit *out)
{
    const pti_d3 centre = pti_d(0.3, -0.2, 0.5), eye = pti_d_from(p), way = pti_d_sub(centre, eye), axis = pti_d_normalize(way);
    const double e = (double)ready->e, lifted = BALL_RADIUS + (kind == INSIDE ? -2 : 2) * e;
    pti_lane_row from[3], q[3], to[3], d;
    pti_w3 point, direction;
    int k;
    for (k = 0; k < PTI_WIDTH; k++) set3(from, k, p);
    d.f = pti_lock_ball_point(ready, pti_uw_set((uint32_t)light), pti_row3(from), u, &point, &direction);
    pti_row3_set(q, point);
    pti_row3_set(to, direction);
    out->density = (double)d.v[0];
    for (k = 0; k < PTI_WIDTH; k++) {
        const pti_d3 at = get3(q, k), w = get3(to, k), seen = pti_d_sub(at, eye);
        out->height = fmax(out->height, fabs(pti_d_length(pti_d_sub(at, centre)) - lifted) / e);
        out->off = fmax(out->off, pti_d_length(pti_d_sub(seen, pti_d_scale(w, pti_d_length(seen)))) / e);
        count_cell(&out->c, (1 - pti_d_dot(w, axis)) / cone_of(kind, pti_d_length(way)), azimuth(v3(axis.x, axis.y, axis.z), w));
    }
}

static pti_d3 lit_row(const pti_lockstep *ready, int row, int light)
{
    return pti_d((double)ready->light[row][light], (double)ready->light[row + 1][light], (double)ready->light[row + 2][light]);
}

static void flat_points(const pti_lockstep *ready, int kind, int light, const pti_lock_numbers *u, lit *out)
{
    const pti_d3 x = lit_row(ready, PTI_LIT_E1, light), y = lit_row(ready, PTI_LIT_E2, light), n = pti_d_normalize(pti_d_cross(x, y));
    const double xx = pti_d_dot(x, x), yy = pti_d_dot(y, y), xy = pti_d_dot(x, y), e = (double)ready->e;
    pti_lane_row q[3], d;
    pti_w3 point, normal;
    int k;
    d.f = pti_lock_flat_point(ready, pti_uw_set((uint32_t)light), u, &point, &normal);
    pti_row3_set(q, point);
    out->density = (double)d.v[0];
    for (k = 0; k < PTI_WIDTH; k++) {
        const pti_d3 r = pti_d_sub(get3(q, k), lit_row(ready, PTI_LIT_P, light));
        const double a = (pti_d_dot(r, x) * yy - pti_d_dot(r, y) * xy) / (xx * yy - xy * xy), b = (pti_d_dot(r, y) * xx - pti_d_dot(r, x) * xy) / (xx * yy - xy * xy);
        out->height = fmax(out->height, fabs(pti_d_dot(r, n) - 2 * e) / e);
        if (kind == FLAT) count_cell(&out->c, a, b);
        else count_cell(&out->c, (a + b) * (a + b), a + b > 1e-4 ? b / (a + b) : 0.5);
    }
}

/* The light of that kind, and what the density should be. */
static int find_light(const pt_scene *s, const pti_lockstep *ready, int kind, pt_vec3 p, double *exact)
{
    const pt_shape shape = kind < FLAT ? PT_SHAPE_SPHERE : kind == FLAT ? PT_SHAPE_PARALLELOGRAM : PT_SHAPE_TRIANGLE;
    int k, light = 0;
    for (k = 0; k < ready->light_count; k++)
        if ((ready->light[PTI_LIT_RADIUS][k] > 0 ? OUTSIDE : ready->light[PTI_LIT_TRIANGLE][k] > 0 ? CORNERED : FLAT) == (kind < FLAT ? OUTSIDE : kind)) light = k;
    for (k = 0; k < (int)s->light_count; k++)
        if (s->primitives[s->lights[k].primitive].shape == shape)
            *exact = s->lights[k].pmf / (kind < FLAT ? 2 * PT_PI * cone_of(kind, pti_d_length(pti_d_between(p, v3(0.3, -0.2, 0.5)))) : s->lights[k].area);
    return light;
}

static void lights(void)
{
    static lit out;
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(720000), 7);
    stage s;
    pti_lockstep ready;
    int kind, i;
    memset(&s, 0, sizeof s);
    add_ball(&s.scene, &HERE, 0.3, -0.2, 0.5, BALL_RADIUS, lamp(&s.scene, 1, 1, 1));
    pt_add_parallelogram(&s.scene, v3(1, 0.2, 0.1), v3(0.3, 0.5, -0.2), v3(-0.4, 0.1, 0.6), lamp(&s.scene, 2, 1, 0));
    pt_add_triangle(&s.scene, v3(-1, 0.2, 0.1), v3(-0.3, 0.8, -0.2), v3(-0.4, 0.1, 0.9), lamp(&s.scene, 0, 1, 3));
    commit(&s);
    pt_test_source("uniform in the cone, or per area");
    pt_check(pti_lockstep_make(&ready, &s.scene, v3(0, 0, 0)), "lights", "not for lanes");
    for (kind = 0; kind < LIT; kind++) {
        const pt_vec3 p = kind == OUTSIDE ? v3(-0.9, 1.2, 0.1) : kind == NEAR_BY ? v3(0.3, -0.2, 0.5 + 1.01 * BALL_RADIUS) : v3(0.4, -0.3, 0.3);
        double exact = 0;
        const int light = find_light(&s.scene, &ready, kind, p, &exact);
        memset(&out, 0, sizeof out);
        for (i = 0; i < (int)pt_test_all_samples(10000); i++) {
            pti_lock_numbers u;
            memset(&u, 0, sizeof u);
            u.light0 = draws(&rng);
            u.light1 = draws(&rng);
            if (kind < FLAT) ball_points(&ready, kind, light, p, &u, &out);
            else flat_points(&ready, kind, light, &u, &out);
        }
        pt_check(fabs(out.density - exact) <= 1e-5 * exact, lit_names[kind], "density %.8g, exactly %.8g", out.density, exact);
        pt_check(out.height <= 1 && out.off <= 8, lit_names[kind], "points are off by %.3g e, from the direction drawn by %.3g e", out.height, out.off);
        check_cells(label("points of a %s", lit_names[kind]), &out.c);
    }
    pt_scene_free(&s.scene);
}

/* Each light is chosen as often as its density says, the two triangles of a parallelogram as one. Each has a colour of its own. */
static void choice(void)
{
    enum { LAMPS = 6 };
    static const double red[LAMPS] = {1, 2, 3, 4, 0.001, 5};
    double sum = 0;
    pti_lockstep k;
    stage s;
    int m[LAMPS], i, wrong = 0, count = 0;
    uint32_t j;
    memset(&s, 0, sizeof s);
    for (i = 0; i < LAMPS; i++) m[i] = lamp(&s.scene, red[i], 0.3, 0.2);
    pt_add_quad(&s.scene, v3(0.1, 0, 0.3), v3(0.9, 0.2, 0.2), v3(0.8, 0.7, 0.6), v3(0, 0.5, 0.7), m[0]);
    pt_add_triangle(&s.scene, v3(-1, 0.2, 0.1), v3(-0.3, 0.8, -0.2), v3(-0.4, 0.1, 0.9), m[1]);
    pt_add_parallelogram(&s.scene, v3(1, -0.2, 0.1), v3(0, 0.5, 0), v3(0, 0, 0.6), m[2]);
    add_ball(&s.scene, &HERE, 0.3, -0.2, 0.5, 0.4, m[3]);
    add_ball(&s.scene, &HERE, -0.3, -0.2, 0.5, 0.2, m[4]);
    pt_add_quad(&s.scene, v3(-1, -1, -1), v3(1, -1, -1), v3(1, -1, 1), v3(-1, -1, 1), m[5]);
    commit(&s);
    if (!pti_lockstep_make(&k, &s.scene, v3(0, 0, 0)) || k.light_count != LAMPS || k.sphere_lights != 2 || k.chosen[0] != 0) {
        pt_check(0, "choice of lights", "%d lights", k.light_count);
        return;
    }
    for (i = 0; i < LAMPS; i++) {
        const double share = (i + 1 < LAMPS ? (double)k.chosen[i + 1] : 1) - (double)k.chosen[i];
        const int flat = k.light[PTI_LIT_RADIUS][i] <= 0;
        double pmf = 0, area = 0;
        for (j = 0; j < s.scene.light_count; j++) {
            const pt_light *l = &s.scene.lights[j];
            if ((float)s.scene.materials[pti_primitive_material(&s.scene, &s.scene.primitives[l->primitive])].emission.r != k.light[PTI_LIT_EMISSION][i]) continue;
            pmf += l->pmf;
            area += l->area;
            count++;
        }
        sum += share;
        wrong += !(fabs(share - pmf) <= PTI_2_M24); /* two boundaries, each rounded to a multiple of 2^-24 */
        wrong += fabs((double)k.light[PTI_LIT_DENSITY][i] - (flat ? share / area : share)) > 1e-6 * (flat ? share / area : share);
    }
    pt_check(wrong == 0 && count == 8 && fabs(sum - 1) < 1e-12, "choice of lights", "%d wrong, %d matched, in all %.9g", wrong, count, sum);
    pt_scene_free(&s.scene);
}

/* ---- hits ------------------------------------------------------------------------------------------------------ */

/* Some primitives in and around [-1,1]^3, each with a colour of its own, its number / 128. Things fit into a room. */
enum { FEW = 20 };
static int soup(stage *s, pt_pcg32 *rng, int walls)
{
    int i;
    memset(s, 0, sizeof *s);
    for (i = 0; i < 64; i++) diffuse(&s->scene, (i + 1) / 128.0, 0.5, 0.5);
    for (i = 0; i < FEW; i++) {
        const int kind = (int)(pt_pcg32_next(rng) % 5), axis = (int)(pt_pcg32_next(rng) % 3);
        const pt_vec3 at = v3(between(rng, -0.7, 0.7), between(rng, -0.7, 0.7), between(rng, -0.7, 0.7));
        const double size = between(rng, 0.05, 0.5);
        const pt_vec3 a = pt_v3_scale(any_direction(rng), (pt_real)size), b = pt_v3_scale(any_direction(rng), (pt_real)size);
        const double x[3] = {size, 0, 0}, y[3] = {0, size, 0};
        if (kind == 0) pt_add_sphere(&s->scene, at, (pt_real)(0.5 * size), i);
        if (kind == 1) pt_add_parallelogram(&s->scene, at, v3(x[axis], x[(axis + 1) % 3], x[(axis + 2) % 3]), v3(y[axis], y[(axis + 1) % 3], y[(axis + 2) % 3]), i);
        if (kind == 2) pt_add_parallelogram(&s->scene, at, a, b, i);
        if (kind == 3) pt_add_triangle(&s->scene, at, pt_v3_add(at, a), pt_v3_add(at, b), i);
        if (kind == 4) pt_add_quad(&s->scene, at, pt_v3_add(at, a), pt_v3_add(pt_v3_add(at, a), b), pt_v3_add(at, b), i);
    }
    if (walls) {
        const double low[3] = {-1.5, -1.5, -1.5}, high[3] = {1.5, 1.5, 1.5};
        int m[6];
        for (i = 0; i < 6; i++) m[i] = FEW + i;
        add_box(&s->scene, PARALLELOGRAM, &HERE, low, high, (int)(pt_pcg32_next(rng) % 2), m);
    }
    return pt_commit(&s->scene) == PT_OK;
}

/* The same test in double from the rows that lanes have: distance along the ray, distance inside the edges, |cos|; for a sphere
   those of the first root beyond 0, and how deep the ray goes into it. */
typedef struct exact_hit {
    double t, margin, cosine;
} exact_hit;

static double row_at(const float *row, pti_d3 p) { return (double)row[0] * p.x + (double)row[1] * p.y + (double)row[2] * p.z + (double)row[3]; }

static exact_hit exact_test(const pti_lockstep *k, int i, pti_d3 o, pti_d3 d)
{
    const float *at = k->at[i];
    exact_hit h = {-1, -1, 1};
    if (i >= k->begin[PTI_LOCK_SPHERES]) {
        const pti_d3 f = pti_d_sub(o, pti_d((double)at[0], (double)at[1], (double)at[2]));
        const double b = -pti_d_dot(f, d), l = pti_d_length(pti_d_add(f, pti_d_scale(d, b))), r = (double)at[3];
        const double root = sqrt(fmax(0, (r - l) * (r + l)));
        h.t = b - root > 0 ? b - root : b + root;
        h.margin = r - l;
        h.cosine = root / r;
    } else if (i < k->begin[PTI_LOCK_QUADS]) {
        const int axis = i < k->begin[1] ? 0 : i < k->begin[2] ? 1 : 2;
        const double oo[3] = {o.x, o.y, o.z}, dd[3] = {d.x, d.y, d.z};
        double y, z;
        h.t = ((double)at[0] - oo[axis]) / dd[axis];
        y = oo[(axis + 1) % 3] + h.t * dd[(axis + 1) % 3];
        z = oo[(axis + 2) % 3] + h.t * dd[(axis + 2) % 3];
        h.margin = fmin(fmin(y - (double)at[1], (double)at[2] - y), fmin(z - (double)at[3], (double)at[4] - z));
        h.cosine = fabs(dd[axis]);
    } else {
        const double slope = row_at(at, d) - (double)at[3];
        pti_d3 p;
        h.t = -row_at(at, o) / slope;
        p = pti_d_add(o, pti_d_scale(d, h.t));
        h.margin = fmin(row_at(at + 4, p), row_at(at + 8, p));
        if (i >= k->begin[PTI_LOCK_TRIANGLES]) h.margin = fmin(h.margin, row_at(at + 12, p));
        else h.margin = fmin(h.margin, fmin((double)at[12] - row_at(at + 4, p), (double)at[13] - row_at(at + 8, p)));
        h.cosine = fabs(slope);
    }
    return h;
}

/* How far e can move a hit along the ray, and a sphere's twice as far. */
static double blur(const pti_lockstep *k, int i, const exact_hit *h)
{
    return (i >= k->begin[PTI_LOCK_SPHERES] ? 2 : 1) * (double)k->e / fmax(h->cosine, 1e-9);
}

/* No edge so near that the lanes' slack of 2 blur decides, no beginning or end, and no other hit where the nearest is: then lanes
   must say what [PT-06] says. */
static int is_clear(const pti_lockstep *k, pti_d3 o, pti_d3 d, double nearest, double end)
{
    int i;
    for (i = 0; i < k->begin[PTI_LOCK_CLASSES]; i++) {
        const exact_hit h = exact_test(k, i, o, d);
        const double b = blur(k, i, &h), edge = i >= k->begin[PTI_LOCK_SPHERES] ? 4 * (double)k->e : 3 * b;
        if (!(h.t > -b && h.t < nearest + b) || h.margin < -edge) continue;
        if (h.margin < edge || h.t < b || fabs(h.t - end) < b || (fabs(h.t - nearest) < b && fabs(h.t - nearest) > 1e-9)) return 0;
    }
    return 1;
}

static double exact_nearest(const pti_lockstep *k, pti_d3 o, pti_d3 d, int *which)
{
    double best = HUGE_VAL;
    int i;
    *which = -1;
    for (i = 0; i < k->begin[PTI_LOCK_CLASSES]; i++) {
        const exact_hit h = exact_test(k, i, o, d);
        if (h.t > 0 && h.t < best && h.margin >= 0) best = h.t, *which = i;
    }
    return best;
}

static void hits(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(6), 8);
    const int scenes = WHOLE && !pt_test.is_short ? 60 : 15;
    int wrong = 0, misplaced = 0, unclear = 0, rays = 0, met = 0, n, i, k;
    double worst = 0;
    for (n = 0; n < scenes; n++) {
        pti_lockstep ready;
        stage s;
        if (!soup(&s, &rng, n % 2)) {
            pt_check(0, "soup", "%s", pt_scene_error(&s.scene));
            return;
        }
        if (!pti_lockstep_make(&ready, &s.scene, v3(2, 2, 2))) { /* a sliver may be too small */
            pt_scene_free(&s.scene);
            continue;
        }
        for (i = 0; i < 400; i++) {
            pti_lane_row o[3], d[3], t, number;
            pti_lock_best best;
            for (k = 0; k < PTI_WIDTH; k++) {
                set3(o, k, v3(between(&rng, -1.4, 1.4), between(&rng, -1.4, 1.4), between(&rng, -1.4, 1.4)));
                set3(d, k, any_direction(&rng));
                if (i % 20 == 0) set3(d, k, v3(i % 40 ? 1 : 0, 0, i % 40 ? 0 : -1)); /* along an axis */
            }
            best.t = best.margin = pti_fw_set(PTI_LOCK_FAR);
            best.i = pti_fw_set(0);
            pti_lock_ask(&ready, pti_row3(o), pti_row3(d), ready.e, &best, 0);
            t.f = best.t;
            number.f = best.i;
            for (k = 0; k < PTI_WIDTH; k++) {
                pt_ray ray;
                pt_hit hit;
                int which, hit_at_all;
                const double nearest = exact_nearest(&ready, get3(o, k), get3(d, k), &which);
                ray.o = pt_v3(o[0].v[k], o[1].v[k], o[2].v[k]);
                ray.d = pt_v3(d[0].v[k], d[1].v[k], d[2].v[k]);
                ray.tmax = (pt_real)HUGE_VAL;
                rays++;
                if (!is_clear(&ready, get3(o, k), get3(d, k), nearest, HUGE_VAL)) {
                    unclear++;
                    continue;
                }
                hit_at_all = pt_intersect(&s.scene, &ray, &hit);
                wrong += hit_at_all != (t.v[k] < PTI_LOCK_FAR);
                if (!hit_at_all || !(t.v[k] < PTI_LOCK_FAR)) continue;
                met++;
                wrong += hit.material != (int)(128 * ready.of[PTI_OF_ALBEDO][(int)number.v[k]] + 0.5f) - 1;
                {
                    const exact_hit h = exact_test(&ready, which, get3(o, k), get3(d, k));
                    const double off = fabs((double)t.v[k] - (double)hit.t) / blur(&ready, which, &h);
                    worst = fmax(worst, off);
                    misplaced += !(off <= 1);
                }
            }
        }
        pt_scene_free(&s.scene);
    }
    pt_check(rays > 1500 * scenes && met > rays / 4 && unclear < rays / 500, "hits", "%d rays, %d hits, %d too close to call", rays, met, unclear);
    pt_check(wrong == 0, "hits", "%d of %d are not those of pt_intersect", wrong, rays);
    pt_check(misplaced == 0, "hits", "%d of %d are farther off than rounding can move them; at most %.3g of that", misplaced, met, worst);
    if (pt_test.is_verbose) printf("       %d rays, %d hits, %d too close to call, t off by %.3g of its bound\n", rays, met, unclear, worst);
}

/* Between points of surfaces that see each other: is something in between? Walls of a room are not asked, and need not be. */
static void shadows(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(7), 9);
    const int scenes = WHOLE && !pt_test.is_short ? 60 : 15;
    int wrong = 0, unclear = 0, rays = 0, blocked = 0, left_out = 0, n, i, k;
    for (n = 0; n < scenes; n++) {
        pti_lockstep ready;
        stage s;
        if (!soup(&s, &rng, n % 4 != 3) || !pti_lockstep_make(&ready, &s.scene, v3(1, 1, 1))) {
            pt_scene_free(&s.scene);
            continue;
        }
        for (k = 0; k < PTI_LOCK_SPHERES; k++) left_out += ready.begin[k + 1] - ready.blockers[k];
        for (i = 0; i < 300; i++) {
            pti_lane_row o[3], d[3], q[2][3], normal[2][3], far;
            pti_lock_best best;
            unsigned met, landed[2];
            int end;
            for (end = 0; end < 2; end++) { /* two points of surfaces */
                pti_lock_surface surface;
                for (k = 0; k < PTI_WIDTH; k++) {
                    set3(o, k, v3(between(&rng, -1.4, 1.4), between(&rng, -1.4, 1.4), between(&rng, -1.4, 1.4)));
                    set3(d, k, any_direction(&rng));
                }
                best.t = best.margin = pti_fw_set(PTI_LOCK_FAR);
                best.i = pti_fw_set(0);
                pti_lock_ask(&ready, pti_row3(o), pti_row3(d), ready.e, &best, 0);
                landed[end] = pti_mw_bits(pti_fw_lt(best.t, pti_fw_set(PTI_LOCK_FAR)));
                surface.met = pti_mw_of_bits(landed[end]);
                pti_lock_face(&ready, &surface, pti_lock_land(&ready, pti_row3(o), pti_row3(d), &best, &surface), pti_row3(d));
                pti_row3_set(normal[end], surface.n);
                pti_row3_set(q[end], pti_w3_along(surface.n, pti_lock_lift(&ready, &surface, surface.n), surface.p));
            }
            for (k = 0; k < PTI_WIDTH; k++) {
                const pti_d3 way = pti_d_sub(get3(q[1], k), get3(q[0], k));
                const double length = pti_d_length(way);
                far.v[k] = (float)length;
                set3(d, k, v3(way.x / length, way.y / length, way.z / length));
            }
            best.t = far.f;
            met = pti_mw_bits(pti_lock_ask(&ready, pti_row3(q[0]), pti_row3(d), ready.e, &best, 1));
            for (k = 0; k < PTI_WIDTH; k++) {
                int which;
                pt_ray ray;
                const double nearest = exact_nearest(&ready, get3(q[0], k), get3(d, k), &which), length = (double)far.v[k];
                if (!(landed[0] & landed[1] & 1u << k) || length < 0.01) continue;
                if (!(pti_d_dot(get3(normal[0], k), get3(d, k)) > 0 && pti_d_dot(get3(normal[1], k), get3(d, k)) < 0)) continue; /* no light goes that way */
                rays++;
                if (!is_clear(&ready, get3(q[0], k), get3(d, k), fmin(nearest, length), length)) {
                    unclear++;
                    continue;
                }
                ray.o = pt_v3(q[0][0].v[k], q[0][1].v[k], q[0][2].v[k]);
                ray.d = pt_v3(d[0].v[k], d[1].v[k], d[2].v[k]);
                ray.tmax = far.v[k];
                blocked += pt_occluded(&s.scene, &ray);
                wrong += pt_occluded(&s.scene, &ray) != (int)(met >> k & 1);
            }
        }
        pt_scene_free(&s.scene);
    }
    pt_check(rays > 600 * scenes && blocked > rays / 20 && blocked < rays - rays / 20 && unclear < rays / 50 && left_out > scenes, "shadows",
             "%d rays, %d blocked, %d too close to call, %d planes not asked", rays, blocked, unclear, left_out);
    pt_check(wrong == 0, "shadows", "%d of %d are not those of pt_occluded", wrong, rays);
    if (pt_test.is_verbose) printf("       %d rays, %d blocked, %d too close to call, %d planes not asked\n", rays, blocked, unclear, left_out);
}

/* ---- what is left to paths one at a time ----------------------------------------------------------------------- */

static void nobody(void *user, const char *word, int edges, pt_rgbd value)
{
    (void)user;
    (void)word;
    (void)edges;
    (void)value;
}

enum {
    TEXTURE, SKY, MAP, POINT, SPOT, SUN, ROUGH, METAL, INDEX, COAT, GLASS, LPE, OBSERVER, GENERAL, STRATIFIED, MANY, DIM, WHITTED, LONG_PATHS,
    LATE, SWITCH, REFUSED
};
static const char *const refused_names[REFUSED] = {
    "a texture", "a sky", "an environment image", "a point light", "a spot light", "a directional light", "rough diffuse",
    "metal too smooth for floats", "metal of a huge index", "a coat", "rough glass", "light-path expressions", "an observer", "the general body", "the stratified sampler",
    "65 lamps", "a light too dim for 24 bits", "another method", "paths of 2^24 edges", "roulette from 2^24 on", "no_lockstep"};

static void add_refused(stage *s, int what)
{
    static const pt_texture checker = {PT_TEXTURE_CHECKER, NULL, 0, 0, {8, 8}, {(pt_real)0.25, (pt_real)0.25, (pt_real)0.25},
                                       {(pt_real)0.75, (pt_real)0.75, (pt_real)0.75}, NULL, NULL};
    static const float sky[6] = {1, 1, 1, 0.5f, 0.5f, 2};
    pt_material m = pt_material_diffuse(grey(0.5));
    int k, i;
    if (what == MANY) m.emission = grey(1);
    if (what == TEXTURE) m.texture = &checker;
    if (what == ROUGH) m = pt_material_oren_nayar(grey(0.5), (pt_real)0.3);
    if (what == METAL) m = pt_material_conductor(grey(1), grey(3), (pt_real)0.022);
    if (what == INDEX) m = pt_material_conductor(grey(1), grey(2e6), 0);
    if (what == COAT) m = pt_material_coat(grey(0.5), (pt_real)1.5);
    if (what == GLASS) m = pt_material_rough_dielectric((pt_real)1.5, (pt_real)0.2);
    if (what == DIM) m.emission = grey(1e-9);
    k = pt_add_material(&s->scene, m);
    add_ball(&s->scene, &HERE, 0, 0.4, 0, what == DIM ? 0.01 : 0.2, k);
    for (i = 0; what == MANY && i < 65; i++) add_ball(&s->scene, &HERE, -0.9 + 0.2 * (i % 8), -0.9, -0.9 + 0.2 * (i / 8), 0.05, k);
    if (what == SKY) pt_set_environment(&s->scene, grey(1));
    if (what == MAP) pt_set_environment_image(&s->scene, sky, 2, 1, 1);
    if (what == POINT) pt_add_point_light(&s->scene, v3(0, 0.7, 0), grey(1));
    if (what == SPOT) pt_add_spot_light(&s->scene, v3(0, 0.7, 0), v3(0, -1, 0), grey(1), 20, 40);
    if (what == SUN) pt_add_directional_light(&s->scene, v3(0.1, -1, 0), grey(1));
}

static void refused(void)
{
    static const char *const words[1] = {"LDE"};
    int what;
    for (what = 0; what < REFUSED; what++) {
        stage s = room(SPHERES);
        pt_film film, plain;
        pt_render_desc d;
        pt_lpe lpe;
        add_refused(&s, what);
        commit(&s);
        d = desc_of(&s, 12, 9, 2);
        if (what == LPE && pt_lpe_compile(&lpe, words, 1, NULL) == PT_OK) d.li.lpe = &lpe;
        if (what == OBSERVER) d.li.observer = nobody;
        d.general_body = what == GENERAL;
        if (what == STRATIFIED) d.sampler = PT_SAMPLER_STRATIFIED;
        if (what == WHITTED) d.method = "whitted";
        if (what == LONG_PATHS) d.li.max_edges = 1 << 24;
        if (what == LATE) d.li.roulette_start = 1 << 24, d.li.roulette = PT_ROULETTE_CONSTANT, d.li.roulette_survival = (pt_real)0.5, d.li.max_edges = 9;
        d.no_lockstep = what == SWITCH;
        film = render(&s, &d, 0, NULL);
        d.no_lockstep = 1;
        plain = render(&s, &d, 0, NULL);
        pt_check(same_film(&film, &plain), refused_names[what], "is another picture than that of paths one at a time");
        pt_film_free(&film);
        pt_film_free(&plain);
        pt_scene_free(&s.scene);
    }
}

/* The auxiliary pictures are those of the same camera rays, one at a time; to ask for them changes no bit of the picture. */
static void layers_of(int kind)
{
    const int body = kind == SMOOTH ? 2 : 1;
    stage s = room(kind);
    pt_render_desc d = desc_of(&s, 40, 30, 8);
    pt_film film, plain, without;
    int i, same, hits = 0, off = 0;
    if (kind == SMOOTH) d.li.max_edges = 24; /* shading normals can keep a path in a ball of glass for ever */
    without = render(&s, &d, body, NULL);
    d.aov = 1;
    film = render(&s, &d, body, NULL);
    d.no_lockstep = 1;
    plain = render(&s, &d, 0, NULL);
    same = memcmp(film.half[0], without.half[0], 3600 * sizeof(double)) == 0 && memcmp(film.half[1], without.half[1], 3600 * sizeof(double)) == 0;
    pt_check(same, label("auxiliary pictures, %s", room_names[kind]), "asking for them changes the picture");
    for (i = 0; i < 1200; i++) {
        int k, wrong = fabs(film.depth[i] - plain.depth[i]) > 1e-5 * plain.depth[i];
        for (k = 3 * i; k < 3 * i + 3; k++) wrong |= fabs(film.albedo[k] - plain.albedo[k]) > 1e-5 || fabs(film.normal[k] - plain.normal[k]) > 1e-4;
        off += wrong;
        hits += plain.depth[i] > 0;
    }
    /* a ray at the rim of a ball turns its normal by the root of its rounding */
    pt_check(hits > 600 && off <= 12, label("auxiliary pictures, %s", room_names[kind]),
             "%d of %d pixels differ from those of paths one at a time", off, hits);
    pt_film_free(&film);
    pt_film_free(&plain);
    pt_film_free(&without);
    pt_scene_free(&s.scene);
}

static void layers(void)
{
    layers_of(SPHERES);
    layers_of(IN_GLASS); /* seen from behind */
    layers_of(ROUND);
    layers_of(SMOOTH); /* by its tree, and walls in lanes */
}

/* A square of side 2 about (0, y, 0) with shading normals 60 degrees off its own, towards x. up: does it look up? */
static void add_tilted(pt_scene *s, double y, int up, int material)
{
    const double side = up ? 1 : -1;
    const pt_vec3 p[4] = {v3(-1, y, -side), v3(-1, y, side), v3(1, y, side), v3(1, y, -side)}, n = v3(sqrt(0.75), 0.5 * side, 0);
    const pt_vec3 normals[4] = {n, n, n, n};
    const uint32_t index[6] = {0, 1, 2, 0, 2, 3};
    pt_add_mesh(s, p, normals, NULL, 4, index, 2, material);
}

/* A lamp that lies behind a surface, but before its shading normals, lights nothing of it: exactly. */
static void behind_surfaces(void)
{
    static const char *const methods[2] = {"path", "path-plain"};
    int m, i;
    for (m = 0; m < 2; m++) {
        double sum = 0;
        stage s;
        pt_render_desc d;
        pt_film film;
        memset(&s, 0, sizeof s);
        add_tilted(&s.scene, 0, 1, diffuse(&s.scene, 0.9, 0.9, 0.9));
        pt_add_parallelogram(&s.scene, v3(1.5, -1, 1), v3(0, 0.8, 0), v3(0, 0, -2), material_of(&s.scene, pt_material_emitter(grey(9)), 9));
        s.camera = camera_at(&HERE, 0, 3, 0.1, 0, 0, 0, 12);
        commit(&s);
        d = desc_of(&s, 12, 9, 64);
        d.method = methods[m];
        film = render(&s, &d, 2, NULL);
        for (i = 0; i < 3 * 12 * 9; i++) sum += film.half[0][i] + film.half[1][i];
        pt_check(sum == 0, label("a lamp behind a surface, %s", methods[m]), "it brings %g", sum);
        pt_film_free(&film);
        pt_scene_free(&s.scene);
    }
}

/* Behind their shading normals mirrors, smooth metal and glass go by the geometric ones: the same picture as of paths one at a
   time, and a mirror in a white furnace stays white. */
static void behind_normals(void)
{
    int what;
    for (what = 0; what < 3; what++) {
        double sum[2] = {0, 0};
        stage s;
        int no, i;
        memset(&s, 0, sizeof s);
        add_tilted(&s.scene, 0, 1, pt_add_material(&s.scene, what == 0 ? pt_material_mirror(grey(1)) : what == 1 ? pt_material_conductor(grey(1.5), grey(4), 0) : pt_material_dielectric((pt_real)1.5)));
        pt_add_sphere(&s.scene, v3(0, 0, 0), 50, lamp(&s.scene, 1, 1, 1));
        s.camera = camera_at(&HERE, -3, 0.5, 0, 0, 0, 0, 10);
        commit(&s);
        for (no = 0; no < 2; no++) {
            pt_render_desc d = desc_of(&s, 12, 9, 64);
            pt_film film;
            d.no_lockstep = no;
            film = render(&s, &d, no ? 0 : 2, NULL);
            for (i = 0; i < 3 * 12 * 9; i++) sum[no] += (film.half[0][i] + film.half[1][i]) / (64. * 3 * 12 * 9);
            pt_film_free(&film);
        }
        pt_check(fabs(sum[0] - sum[1]) < (what == 2 ? 0.01 : 1e-5) && (what != 0 || fabs(sum[0] - 1) < 1e-5), label("behind shading normals, material %d", what),
                 "%.7g, one at a time %.7g", sum[0], sum[1]);
        pt_scene_free(&s.scene);
    }
}

static stage boxed(const place *at)
{
    static const double corner[3] = {-0.5, 0.9, -0.5}, along[3] = {1, 0, 0}, across[3] = {0, 0, 1};
    stage s;
    int m;
    memset(&s, 0, sizeof s);
    m = diffuse(&s.scene, 0.6, 0.6, 0.6);
    add_cube(&s.scene, PARALLELOGRAM, at, -1, 1, 0, m);
    add_cube(&s.scene, PARALLELOGRAM, at, -0.45, 0.45, 1, m);
    add_face(&s.scene, PARALLELOGRAM, at, corner, along, across, lamp(&s.scene, 5, 5, 5));
    s.camera = camera_at(at, 0.1, 0.1, 0.95, 0, -0.1, -1, 65);
    commit(&s);
    return s;
}

/* What a path finds does not depend on those beside it: tiles of other sizes give the same bits, also where coordinates are
   so large that one lane in thousands must be asked again. */
static void alone(void)
{
    static const place far_off = {0, 6, 1150, 1150, 1150};
    stage s = boxed(&far_off);
    pt_render_desc d = desc_of(&s, 96, 96, 64);
    pt_film film[2];
    int k;
    d.li.max_edges = 8;
    for (k = 0; k < 2; k++) {
        d.tile = k ? 5 : 16;
        film[k] = render(&s, &d, 1, NULL);
    }
    pt_check(same_film(&film[0], &film[1]), "tiles of 16 and of 5", "other bits");
    pt_film_free(&film[0]);
    pt_film_free(&film[1]);
    pt_scene_free(&s.scene);
}

/* A room of 1e-20, whose squares no float holds, is left to paths one at a time. */
static void tiny(void)
{
    static const place at = {0, 1e-20, 0, 0, 0};
    stage s = boxed(&at);
    const pt_render_desc d = desc_of(&s, 12, 9, 8);
    pt_film film = render(&s, &d, 0, NULL);
    pt_check(film.half[0][0] > 0, "a room of 1e-20", "is black");
    pt_film_free(&film);
    pt_scene_free(&s.scene);
}

/* A lamp of radius 1, 10^7 from the wall that it lights, does not shade itself. */
static void far_lamp(void)
{
    const double far_off = 1e7;
    double sum[2] = {0, 0};
    stage s;
    int no, i;
    memset(&s, 0, sizeof s);
    pt_add_sphere(&s.scene, v3(0, 0, 0), 1, lamp(&s.scene, 1, 1, 1));
    pt_add_parallelogram(&s.scene, v3(-far_off, -far_off, -far_off), v3(2 * far_off, 0, 0), v3(0, 2 * far_off, 0), diffuse(&s.scene, 0.8, 0.8, 0.8));
    s.camera = camera_at(&HERE, 0, 0.01 * far_off, -0.2 * far_off, 0, 0, -far_off, 40);
    commit(&s);
    for (no = 0; no < 2; no++) {
        pt_render_desc d = desc_of(&s, 12, 9, 64);
        pt_film film;
        d.li.max_edges = 2;
        d.no_lockstep = no;
        film = render(&s, &d, no ? 0 : 2, NULL);
        for (i = 0; i < 3 * 12 * 9; i++) sum[no] += film.half[0][i] + film.half[1][i];
        pt_film_free(&film);
    }
    pt_check(sum[1] > 0 && fabs(sum[0] / sum[1] - 1) < 1e-3, "a small lamp far off", "%g, one at a time %g", sum[0], sum[1]);
    pt_scene_free(&s.scene);
}

/* The shading normals of a lamp do not matter to its light. */
static void tilted_lamp(void)
{
    stage s;
    pt_render_desc d;
    picture a, b;
    memset(&s, 0, sizeof s);
    pt_add_parallelogram(&s.scene, v3(-2, 0, -2), v3(0, 0, 4), v3(4, 0, 0), diffuse(&s.scene, 0.8, 0.8, 0.8));
    add_tilted(&s.scene, 0.5, 0, lamp(&s.scene, 1, 1, 1));
    s.camera = camera_at(&HERE, 0.3, 0.45, 2, 0, 0, -0.5, 50);
    commit(&s);
    d = desc_of(&s, 9, 6, samples(60));
    d.li.max_edges = 2;
    a = pictures(&s, d, RENDERS, 910000, 2);
    b = pictures(&s, d, RENDERS, 910500, 0);
    pt_test_source("pti_path");
    compare("a lamp with shading normals", &a, &b, within(0.03));
    pt_scene_free(&s.scene);
}

/* ---- walls that are huge spheres ------------------------------------------------------------------------------- */

/* A room of six of them, each of a colour of its own (number / 128), with balls that stand on the floor, in a corner, and in a wall. */
static stage round_room(const place *at, double r, int with_balls)
{
    stage s;
    int m[6], i;
    memset(&s, 0, sizeof s);
    for (i = 0; i < 6; i++) m[i] = diffuse(&s.scene, (i + 1) / 128.0, 0.999, 0.999);
    add_shells(&s.scene, at, r, m);
    if (with_balls) {
        add_ball(&s.scene, at, 0.3, -0.7, -0.4, 0.3, pt_add_material(&s.scene, pt_material_mirror(grey(0.999))));
        add_ball(&s.scene, at, -0.5, -0.6, 0, 0.4, pt_add_material(&s.scene, pt_material_dielectric((pt_real)1.5)));
        add_ball(&s.scene, at, 0.8, 0.8, 0.8, 0.2, m[0]);
        add_ball(&s.scene, at, -1.1, 0.5, 0.4, 0.35, m[1]);
    }
    s.camera = camera_at(at, 0.1, 0, 0.8, 0, 0.05, -1, 70);
    commit(&s);
    return s;
}

/* Not one path gets out: all walk to their last edge. */
static void shells_are_closed(void)
{
    static const struct {
        place at;
        double r;
    } rooms[8] = {{{0, 1, 0, 0, 0}, 64},      {{0, 1, 0, 0, 0}, 1e3},      {{0, 1, 0, 0, 0}, 1e5},     {{0, 1, 0.3, -0.1, 0.2}, 1e5},
                  {{0, 1, 0, 0, 0}, 8388608}, {{0, 1, 7, -4, 3}, 1e4}, {{0, 1e-6, 2e-7, 0, 0}, 1e4}, {{0, 1e6, 0, 0, 0}, 1e4}};
    double edges = 0;
    int i, k;
    for (i = 0; i < 8; i++) {
        stage s = round_room(&rooms[i].at, rooms[i].r, 1);
        pt_render_desc d = desc_of(&s, 29, 23, pt_test.is_short ? 2 : WHOLE ? 16 : 4);
        const double paths = 29.0 * 23 * d.spp;
        d.li.roulette = PT_ROULETTE_NONE;
        for (k = 2; k <= 500; k *= 250) {
            uint64_t rays;
            pt_film film;
            d.method = "path-plain";
            d.li.max_edges = k;
            film = render(&s, &d, 1, &rays);
            pt_check((double)rays == paths * k, label("room %d of huge spheres, %d edges", i, k), "%.0f of %.0f are missing", paths * k - (double)rays, paths * k);
            edges += (double)rays;
            pt_film_free(&film);
        }
        pt_scene_free(&s.scene);
    }
    printf("edges walked in rooms of huge spheres: %.4g\n", edges);
}

/* Points that lanes find are on their spheres, of whose roots in double they are; lamps within are seen, those behind are not. */
static void shell_hits(void)
{
    static const double radius[4] = {512, 1e4, 1e5, 8388608};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(61), 8);
    int n, i, j, k, rays = 0, off = 0, other = 0, turned = 0, unsure = 0, blind = 0;
    double worst = 0;
    for (n = 0; n < 4; n++) {
        stage s = round_room(&HERE, radius[n], 0);
        pti_lockstep ready;
        if (!pti_lockstep_make_shells(&ready, &s.scene, v3(0, 0, 0))) {
            pt_check(0, "shells", "not for lanes");
            return;
        }
        for (i = 0; i < (int)pt_test_samples(2000); i++) {
            pti_lane_row o[3], d[3], p[3], normal[3], number, end;
            pti_lock_best best;
            pti_lock_surface surface;
            unsigned hidden;
            for (k = 0; k < PTI_WIDTH; k++) {
                /* anywhere, on a plane in front of a wall, or where rounding may put what is on a wall */
                const double edge = i % 3 == 1 ? 0.9 : 1 - 1.01 / radius[n] - 1e-5, y = between(&rng, -edge, edge), z = between(&rng, -edge, edge);
                const double wall = 1 - (y * y + z * z) / (radius[n] + sqrt(radius[n] * radius[n] - y * y - z * z));
                if (i % 3 == 2) set3(o, k, v3(wall + between(&rng, -1, 1) * (double)ready.e, y, z));
                else set3(o, k, v3(i % 3 == 1 ? between(&rng, -edge, edge) : edge, y, z));
                set3(d, k, any_direction(&rng));
                end.v[k] = (float)between(&rng, 0, 4);
            }
            pti_lock_nearest(&ready, pti_row3(o), pti_row3(d), ready.e, &best);
            pti_row3_set(normal, pti_lock_land(&ready, pti_row3(o), pti_row3(d), &best, &surface));
            pti_row3_set(p, surface.p);
            number.f = best.i;
            hidden = pti_mw_bits(pti_lock_any(&ready, pti_row3(o), pti_row3(d), end.f));
            for (k = 0; k < PTI_WIDTH; k++) {
                const int found = (int)(128 * ready.of[PTI_OF_ALBEDO][(int)number.v[k]] + 0.5f) - 1;
                double height, most = -HUGE_VAL, least = HUGE_VAL;
                pti_d3 out;
                const pti_d3 end_of_ray = pti_d_add(get3(o, k), pti_d_scale(get3(d, k), (double)end.v[k]));
                for (j = 0; j < 6; j++) {
                    const pti_d3 centre = pti_d_from(s.scene.spheres[j].centre);
                    const double r = (double)s.scene.spheres[j].radius;
                    height = pti_d_length(pti_d_sub(get3(p, k), centre)) - r;
                    if (j == found) off += !(fabs(height) <= (double)ready.e), worst = fmax(worst, fabs(height) / (double)ready.e);
                    most = fmax(most, height);
                    least = fmin(least, r - pti_d_length(pti_d_sub(end_of_ray, centre)));
                }
                out = pti_d_sub(get3(p, k), pti_d_from(s.scene.spheres[found].centre));
                rays++;
                other += !(most <= 2 * (double)ready.e);
                turned += !(pti_d_dot(pti_d_normalize(out), get3(normal, k)) > 1 - 1e-6);
                unsure += fabs(least) <= (double)ready.e;
                blind += fabs(least) > (double)ready.e && (hidden >> k & 1) != (least < 0);
            }
        }
        pt_scene_free(&s.scene);
    }
    pt_check(off == 0, "shells", "%d of %d points are farther off than e; at most %.3g e", off, rays, worst);
    pt_check(other == 0, "shells", "%d of %d points are behind another one", other, rays);
    pt_check(turned == 0, "shells", "%d of %d normals are not those of the sphere", turned, rays);
    pt_check(blind == 0 && unsure < rays / 1000, "shells", "%d of %d shadow rays are wrong, %d too close to call", blind, rays, unsure);
    if (pt_test.is_verbose) printf("       %d rays, points off by %.3g e\n", rays, worst);
}

/* Rooms that are left to the tree. */
static void no_shells(void)
{
    enum { SHARP_EDGE, GLASS_WALL, LENS, GLOWING_WALL, FLAT_THING, EYE_OUTSIDE, TOO_WIDE, ASKEW, WAYS };
    static const char *const names[WAYS] = {"walls that meet at 5 degrees", "a wall of glass",       "a camera with a lens", "a wall that glows", "a flat thing in it",
                                            "a camera half outside",        "too large for a height", "turned against the axes"};
    static const place turned = {0.7, 1, 0, 0, 0};
    int what;
    for (what = 0; what < WAYS; what++) {
        const double r = 1e4, wide = 1073741824, tilt = 5 * PT_PI / 180, above = cos(tilt) - 0.9 * sin(tilt);
        stage s = round_room(what == ASKEW ? &turned : &HERE, r, 1);
        pt_render_desc d;
        pt_film film;
        if (what == SHARP_EDGE) {
            add_ball(&s.scene, &HERE, (r + above) * sin(tilt), -(r + above) * cos(tilt), 0, r, 0);
            s.camera = camera_at(&HERE, 0.9, -0.95, 0.8, 0.9, -0.95, -1, 5);
        }
        if (what == TOO_WIDE) add_ball(&s.scene, &HERE, wide, 0, 0, wide, 0);
        if (what == GLASS_WALL) add_ball(&s.scene, &HERE, 0, 1.1 - r, 0, r, pt_add_material(&s.scene, pt_material_dielectric((pt_real)1.5)));
        if (what == GLOWING_WALL) add_ball(&s.scene, &HERE, 0, 1.1 - r, 0, r, material_of(&s.scene, pt_material_diffuse(grey(0.5)), 1));
        if (what == FLAT_THING) pt_add_triangle(&s.scene, v3(-0.9, 0.9, 0), v3(0, 0.9, 0), v3(0, 0.9, 0.9), 0);
        commit(&s);
        d = desc_of(&s, 12, 9, 2);
        d.li.max_edges = 9;
        if (what == LENS) d.camera.lens_radius = (pt_real)0.01, d.camera.focus_distance = 1;
        if (what == EYE_OUTSIDE) d.camera.near_distance = (pt_real)1.7;
        film = render(&s, &d, what == GLOWING_WALL ? -1 : 2, NULL);
        pt_film_free(&film);
        pt_scene_free(&s.scene);
        if (pt_test.is_verbose) printf("       %s\n", names[what]);
    }
}

/* Rows of which some rays start outside are those of paths one at a time; the others are not. */
static void shell_rows(void)
{
    stage s;
    pt_render_desc d;
    pt_film film, plain;
    int y, k, same[2] = {0, 0};
    memset(&s, 0, sizeof s);
    pt_check(pt_scene_smallpt(&s.scene, &s.camera) == PT_OK, "smallpt", "cannot be made");
    d = desc_of(&s, 256, 256, 2);
    d.li.max_edges = 6;
    d.tile = 48;
    film = render(&s, &d, 1, NULL);
    d.no_lockstep = 1;
    plain = render(&s, &d, 0, NULL);
    for (y = 0; y < 256; y++) {
        int equal = 1;
        for (k = 0; k < 2; k++) equal &= memcmp(film.half[k] + 768 * y, plain.half[k] + 768 * y, 768 * sizeof(double)) == 0;
        same[y > 1] += equal;
    }
    pt_check(same[0] == 2 && same[1] == 0, "rows that start outside", "%d of the first 2 rows, and %d of the others, are those of paths one at a time", same[0], same[1]);
    pt_film_free(&film);
    pt_film_free(&plain);
    pt_scene_free(&s.scene);
}

/* Just inside of what it takes. */
static void taken(void)
{
    int what;
    for (what = 0; what < 9; what++) { /* the last three by the tree */
        stage s = room(SPHERES);
        pt_render_desc d;
        pt_film film;
        int k;
        if (what == 0) add_ball(&s.scene, &HERE, 0, 0.4, 0, 0.00125, 0); /* 2048 e = 0.0021 */
        if (what == 5) add_ball(&s.scene, &HERE, 0, 0.4, 0, 0.1, pt_add_material(&s.scene, pt_material_conductor(grey(1), grey(9e5), (pt_real)0.0222)));
        if (what == 6) add_ball(&s.scene, &HERE, 0, 0.4, 0, 0.001, 0);
        while ((what == 1 || what == 7) && s.scene.sphere_count + s.scene.parallelogram_count + s.scene.triangle_count < (what == 1 ? 64 : 65)) {
            k = (int)s.scene.sphere_count;
            add_ball(&s.scene, &HERE, -0.9 + 0.2 * (k % 8), -0.9, -0.9 + 0.2 * (k / 8), 0.05, 0);
        }
        commit(&s);
        d = desc_of(&s, 12, 9, 2);
        if (what == 2) d.camera = pt_camera_look_at(v3(0, 0, 1000), v3(0, 0, 0), v3(0, 1, 0), (pt_real)0.1);
        if (what == 3) d.li.max_edges = (1 << 24) - 1;
        if (what == 4) d.sampler = PT_SAMPLER_INDEPENDENT;
        if (what == 8) d.camera = pt_camera_look_at(v3(0, 0, 20000), v3(0, 0, 0), v3(0, 1, 0), (pt_real)0.01);
        film = render(&s, &d, what >= 6 ? 2 : 1, NULL);
        if (pt_test.is_verbose) printf("       taken, way %d\n", what);
        pt_film_free(&film);
        pt_scene_free(&s.scene);
    }
}

#endif /* PTI_HAS_LOCKSTEP */

/* Of test_together.c, what the variants need. */
static inline void two_rooms(void)
{
    static const int kinds[2] = {GLASS_BOX, MANY_LAMPS};
    int i;
    pt_test_source("pti_path");
    for (i = 0; i < 2; i++) {
        stage s = room(kinds[i]);
        const pt_render_desc d = desc_of(&s, 9, 6, samples(48));
        const picture a = pictures(&s, d, RENDERS, 800000u + 1000u * (uint64_t)i, 1), b = pictures(&s, d, RENDERS, 800500u + 1000u * (uint64_t)i, 0);
        compare(room_names[kinds[i]], &a, &b, within(0.05));
        pt_scene_free(&s.scene);
    }
}

static int lockstep(int argc, char **argv)
{
    pt_test_begin(LOCK_PROGRAM, argc, argv);
#if PTI_HAS_LOCKSTEP
    printf("lanes: %d, %s\n", PTI_WIDTH, PTI_WIDTH == 16 ? "AVX-512" : PTI_LANES == 2 ? "AVX2" : PTI_LANES == 1 ? "SSE2" : "C");
#ifdef LOCK_WIDTH
    pt_check(PTI_WIDTH == LOCK_WIDTH && PTI_LANES == LOCK_LANES, "lanes", "%d, and lanes of 8 of kind %d: not what this program is for", PTI_WIDTH, PTI_LANES);
#endif
    PT_TEST_EXACT(no_way_out);
    PT_TEST_EXACT(furnished_rooms);
    PT_TEST_EXACT(shells_are_closed);
    PT_TEST_EXACT(shell_hits);
    if (WHOLE) {
        PT_TEST(furnaces);
        PT_TEST(irradiance);
        PT_TEST_EXACT(passes);
        PT_TEST_EXACT(halves);
        PT_TEST_EXACT(endless);
        PT_TEST_EXACT(cancelled);
        PT_TEST_EXACT(refused);
        PT_TEST_EXACT(layers);
        PT_TEST_EXACT(taken);
        PT_TEST_EXACT(no_shells);
        PT_TEST_EXACT(shell_rows);
        PT_TEST_EXACT(walls_left_to_the_tree);
        PT_TEST_EXACT(behind_surfaces);
        PT_TEST_EXACT(behind_normals);
        PT_TEST_EXACT(alone);
        PT_TEST_EXACT(tiny);
        PT_TEST_EXACT(far_lamp);
        PT_TEST(tilted_lamp);
    } else {
        PT_TEST(two_rooms);
    }
    PT_TEST_EXACT(same_bits);
    PT_TEST_EXACT(not_caught);
    PT_TEST_EXACT(words);
    PT_TEST_EXACT(floats);
    PT_TEST_EXACT(angles);
    PT_TEST_EXACT(sobol_points);
    PT_TEST_EXACT(sampler_numbers);
    PT_TEST_EXACT(generator);
    PT_TEST(numbers_of_paths);
    PT_TEST(cosines);
    PT_TEST_EXACT(fresnel_of_metal);
    PT_TEST_EXACT(facets);
    PT_TEST(lights);
    PT_TEST_EXACT(choice);
    PT_TEST_EXACT(hits);
    PT_TEST_EXACT(shadows);
#endif
    return pt_test_end();
}

#ifdef LOCK_MAIN
int main(int argc, char **argv) { return lockstep(argc, argv); }
#endif
