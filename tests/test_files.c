/* test_files.c: models, pictures and films as files. What a file says is what the scene gets; what is broken, cut,
   hostile or too large is refused with a sentence, without a crash, a leak or memory that its size does not bear out;
   and a disk that is full loses nothing that was there.

       cc -O2 -ffp-contract=off -I. tests/test_files.c -o test_files -lm -pthread && ./test_files

   Run it in the project's top directory. Nothing here is statistical; the mutants of files are the same in each run. */

#include <stddef.h>

static void *pool_alloc(size_t size, void *user);
static void *pool_realloc(void *pointer, size_t size, void *user);
static void pool_free(void *pointer, void *user);
#define PT_MALLOC(size, user) pool_alloc(size, user)
#define PT_REALLOC(pointer, size, user) pool_realloc(pointer, size, user)
#define PT_FREE(pointer, user) pool_free(pointer, user)

#define PT_STATIC /* its own memory functions need an implementation of its own, and it looks at private ones */
#include "pt_test.h"
#include <locale.h>
#ifdef PTI_HAS_FSYNC
#include <sys/stat.h>
#endif

/* ---- memory that counts and fails ------------------------------------------------------------------- */

static struct {
    long live;      /* blocks that were not freed                                                    */
    long calls;     /* requests so far                                                               */
    long fail_at;   /* the request that fails, counted from 1; 0 = none                              */
    size_t largest; /* the largest request so far                                                    */
} pool;

static int pool_refuses(size_t size)
{
    if (size > pool.largest) pool.largest = size;
    return ++pool.calls == pool.fail_at || size > (size_t)1 << 30;
}

static void *pool_alloc(size_t size, void *user)
{
    void *const p = pool_refuses(size) ? NULL : malloc(size);
    (void)user;
    if (p) memset(p, 0xa5, size); /* nobody may count on zeros */
    pool.live += p != NULL;
    return p;
}

static void *pool_realloc(void *pointer, size_t size, void *user)
{
    void *const p = pool_refuses(size) ? NULL : realloc(pointer, size);
    (void)user;
    pool.live += p != NULL && pointer == NULL;
    return p;
}

static void pool_free(void *pointer, void *user)
{
    (void)user;
    pool.live--;
    free(pointer);
}

static void pool_start(long fail_at)
{
    pool.calls = 0;
    pool.largest = 0;
    pool.fail_at = fail_at;
}

/* ---- files and scenes ------------------------------------------------------------------------------- */

static pt_rgb grey(double v) { return pt_rgb_grey((pt_real)v); }
static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }
static int same3(pt_vec3 a, pt_vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
static double far3(pt_vec3 a, pt_vec3 b) { return (double)pt_v3_length(pt_v3_sub(a, b)); }

/* The path of a file of this test; holds for the next three calls. It does not begin as the program's own name, which
   a mutant that is cut short could name. */
static const char *path_of(const char *name)
{
    static const char *place;
    if (!place) {
        FILE *const probe = fopen("build/test/of_files.probe", "wb");
        place = probe ? "build/test/of_files." : "of_files.";
        if (probe) fclose(probe);
        remove("build/test/of_files.probe");
    }
    return label("%s%s", place, name);
}

/* A new file each time: some file systems write one that is cut to nothing and filled again to the disk at once. */
static void write_bytes(const char *name, const void *data, size_t size)
{
    FILE *file;
    remove(path_of(name));
    file = fopen(path_of(name), "wb");
    if (!file || fwrite(data, 1, size, file) != size)
        pt_check(0, "a file of the test", "%s cannot be written", name);
    if (file) fclose(file);
}

static void write_text(const char *name, const char *text) { write_bytes(name, text, strlen(text)); }

/* A whole file, to be freed; NULL if there is none. */
static unsigned char *slurp(const char *path, size_t *size)
{
    FILE *const file = fopen(path, "rb");
    unsigned char *data = NULL;
    long n = -1;
    if (file && fseek(file, 0, SEEK_END) == 0) n = ftell(file);
    if (n >= 0) data = (unsigned char *)malloc((size_t)n + 1);
    *size = data ? (size_t)n : 0;
    if (data) rewind(file);
    if (data && fread(data, 1, *size, file) != *size) *size = 0;
    if (file) fclose(file);
    return data;
}

static int is_there(const char *path)
{
    FILE *const file = fopen(path, "rb");
    if (file) fclose(file);
    return file != NULL;
}

/* Loads a text as OBJ into an empty scene. */
static pt_result load(pt_scene *scene, const char *text, const pt_obj_options *options, pt_obj_info *info)
{
    pt_scene_free(scene);
    write_text("model.obj", text);
    return pt_load_obj(scene, path_of("model.obj"), options, info);
}

static pt_vec3 corner_of(const pt_scene *s, uint32_t triangle, int k)
{
    return s->positions[s->triangles[triangle].v[k]];
}

/* ---- OBJ: which triangles --------------------------------------------------------------------------- */

/* A unit square in the plane z = 0, and a corner above. */
#define SQUARE "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"

/* What must come out: corners as letters of the square (a b c d), or e = (2,3,4). */
static const struct {
    const char *name, *text, *triangles;
} FORMS[] = {
    {"a triangle", SQUARE "f 1 2 3\n", "abc"},
    {"no line end at the end", SQUARE "f 1 2 3", "abc"},
    {"a quad", SQUARE "f 1 2 3 4\n", "abcacd"},
    {"negative indices", SQUARE "f -4 -3 -2\nv 2 3 4\nf -1 1 -4\n", "abceab"},
    {"negative indices count from where they stand", SQUARE "f -4 -3 -1\nv 2 3 4\nf -5 -3 -1\n", "abdace"},
    {"indices with vt and vn",
     SQUARE "vt 0 0\nvn 0 0 1\nf 1/1 2/1 3/1\nf 1//1 2//1 3//1\nf 1/1/1 3/-1/-1 4/1/1\n", "abcabcacd"},
    {"slashes without index", SQUARE "f 1/ 2// 3//\n", "abc"},
    {"CR LF", "v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nf 1 2 3\r\n", "abc"},
    {"CR alone", "v 0 0 0\rv 1 0 0\rv 1 1 0\rf 1 2 3\r", "abc"},
    {"tabs and blanks", "\tv  0\t0 0 \nv\t1 0\t\t0\n  v 1 1 0\nf\t1 2\t3 \t\n", "abc"},
    {"comments", "# f 1 1 1\nv 0 0 0 # v 5 5 5\nv 1 0 0\n#\n\n   # x\nv 1 1 0\nf 1 2 3 # 1 2\n", "abc"},
    {"a comment that ends with a backslash", "# C:\\models\\\n" SQUARE "f 1 2 3\n", "abc"},
    {"lines that go on", "v 0 \\\n0 0\nv 1 0 0\nv 1\\\r\n 1 0\nf 1 \\\n 2\\\n 3\n", "abc"},
    {"colours and weights", "v 0 0 0 0.5 0.5 0.5\nv 1 0 0 1.0\nv 1 1 0 x y\nf 1 2 3\n", "abc"},
    {"a byte order mark", "\xef\xbb\xbf" SQUARE "f 1 2 3\n", "abc"},
    {"groups and smoothing", "o x y\ng\ng a b\ns off\n" SQUARE "s 1\nf 1 2 3\ng z\nf 1 3 4\n", "abcacd"},
    {"what is no face", SQUARE "l 1 2 3\np 1\ncurv 0 1 2\nvp 1 2\nf 1 2 3\n", "abc"},
    {"numbers of all forms", "v -0 +0 .0\nv 1. 0e9 -0.0e-5\nv 1e0 0.1e1 0E+00\nf 1 2 3\n", "abc"}};

static pt_vec3 letter(char c)
{
    const pt_vec3 p[5] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {2, 3, 4}};
    return p[c - 'a'];
}

static void obj_forms(void)
{
    size_t i, k;
    for (i = 0; i < sizeof FORMS / sizeof FORMS[0]; i++) {
        const char *const want = FORMS[i].triangles;
        const size_t count = strlen(want) / 3;
        pt_scene s = PT_SCENE_INIT;
        pt_obj_info info;
        const pt_result r = load(&s, FORMS[i].text, NULL, &info);
        int wrong =
            r != PT_OK || s.triangle_count != count || info.triangles != s.triangle_count || info.error[0];
        for (k = 0; !wrong && k < 3 * s.triangle_count; k++)
            wrong += !same3(corner_of(&s, (uint32_t)(k / 3), (int)(k % 3)), letter(want[k]));
        pt_check(!wrong, FORMS[i].name, "%s, %u triangles, first wrong corner %d: %s", pt_result_string(r),
                 (unsigned)s.triangle_count, (int)k - 1, info.error);
        pt_check(r == PT_OK && pt_commit(&s) == PT_OK && s.degenerate_count == 0,
                 label("%s, commit", FORMS[i].name), "%s", pt_scene_error(&s));
        pt_scene_free(&s);
    }
}

/* What the info says of a file with everything in it. */
static void obj_counts(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    const char *const text = SQUARE "v 9 9 9\nv 5 5 5\nvn 0 0 1\nf 1 2 3 4\nf 1//1 2//1 3//1\nf 1 1 2\nf 1 2 "
                                    "1\nf 6 6 6\nf 1 2\nf 1\nf\nl 1 2\nbevel on\n";
    r = load(&s, text, NULL, &info);
    pt_check(r == PT_OK, "a file with everything", "%s", info.error);
    pt_check(info.triangles == 3 && info.vertices == 7 && s.position_count == 7, "triangles and vertices",
             "%u and %u", (unsigned)info.triangles, (unsigned)info.vertices);
    pt_check(info.degenerate_faces == 6 && info.skipped_lines == 2, "degenerate faces and skipped lines",
             "%u and %u", (unsigned)info.degenerate_faces, (unsigned)info.skipped_lines);
    pt_check(info.materials == 1 && info.textures == 0 && info.emissive_triangles == 0, "materials", "%u",
             (unsigned)info.materials);
    pt_check(same3(info.lo, v3(0, 0, 0)) && same3(info.hi, v3(1, 1, 0)),
             "bounds of triangles, not of unused vertices", "up to %g", (double)info.hi.x);
    pt_check(info.warning_count == 1 && strstr(info.warnings[0], "model.obj:16: 'l'"),
             "the first skipped line", "%u, '%s'", (unsigned)info.warning_count, info.warnings[0]);
    pt_check(s.material_count == 1 && s.materials[0].kind == PT_MATERIAL_DIFFUSE &&
                 s.materials[0].albedo.g == (pt_real)0.8,
             "a material for faces without", "is none");
    pt_check(s.mesh_count == 2, "meshes", "%u", (unsigned)s.mesh_count);
    pt_check(pt_load_obj(&s, path_of("model.obj"), NULL, NULL) == PT_OK && s.triangle_count == 6 &&
                 s.position_count == 14 && s.material_count == 2,
             "a second model in the scene, without info", "%u triangles", (unsigned)s.triangle_count);
    pt_check(same3(corner_of(&s, 3, 1), v3(1, 0, 0)) && pt_commit(&s) == PT_OK && same3(s.hi, v3(1, 1, 0)),
             "the second model", "has other corners");
    pt_scene_free(&s);
}

/* A polygon of n corners around 0 in a plane, at radius r(i); star-shaped, so its area is a sum. */
static size_t polygon_text(char *text, int n, int kind, double *area)
{
    const pt_vec3 x = pt_v3_normalize(v3(1, 2, 2)), y = pt_v3_normalize(v3(2, 1, -2));
    size_t size = 0;
    int i;
    double px = 0, py = 0, fx = 0, fy = 0;
    *area = 0;
    for (i = 0; i < n; i++) {
        const double phi = 2 * PT_PI * i / n,
                     u = kind == 0   ? 1
                         : kind == 1 ? (i % 2 ? 1 : 0.25)
                                     : 0.2 + (double)(pt_hash64((uint64_t)(100 * n + i)) % 1000u) / 1000;
        const double cx = floor(1e4 * u * cos(phi)) / 1e4, cy = floor(1e4 * u * sin(phi)) / 1e4;
        if (i == 0) fx = cx, fy = cy;
        *area += 0.5 * (px * cy - py * cx);
        px = cx;
        py = cy;
        size += (size_t)sprintf(text + size, "v %.9f %.9f %.9f\n", cx * (double)x.x + cy * (double)y.x,
                                cx * (double)x.y + cy * (double)y.y, cx * (double)x.z + cy * (double)y.z);
    }
    *area += 0.5 * (px * fy - py * fx);
    size += (size_t)sprintf(text + size, "f");
    for (i = 1; i <= n; i++) size += (size_t)sprintf(text + size, " %d", i);
    return size;
}

/* Sums of areas along the normal and of their sizes: equal if no triangle is turned over. */
static void areas(const pt_scene *s, pt_vec3 normal, double *along, double *size)
{
    uint32_t i;
    *along = *size = 0;
    for (i = 0; i < s->triangle_count; i++) {
        const pt_vec3 n = pt_v3_cross(pt_v3_sub(corner_of(s, i, 1), corner_of(s, i, 0)),
                                      pt_v3_sub(corner_of(s, i, 2), corner_of(s, i, 0)));
        *along += 0.5 * (double)pt_v3_dot(n, normal);
        *size += 0.5 * (double)pt_v3_length(n);
    }
}

/* Polygons: n - 2 triangles that cover it once. */
static void obj_polygons(void)
{
    static const int sizes[7] = {4, 5, 7, 12, 60, 400, 1000};
    static char text[200000];
    const pt_vec3 normal = pt_v3_cross(pt_v3_normalize(v3(1, 2, 2)), pt_v3_normalize(v3(2, 1, -2)));
    int i, kind;
    for (kind = 0; kind < 3; kind++)
        for (i = 0; i < 7; i++) {
            double area, along, size;
            pt_scene s = PT_SCENE_INIT;
            pt_obj_info info;
            pt_result r;
            polygon_text(text, sizes[i], kind, &area);
            r = load(&s, text, NULL, &info);
            pt_check(r == PT_OK && info.triangles == (uint32_t)sizes[i] - 2 && info.warning_count == 0,
                     label("polygon of %d corners, kind %d", sizes[i], kind), "%u triangles, %s",
                     (unsigned)info.triangles, info.warnings[0]);
            areas(&s, normal, &along, &size);
            pt_check_near(label("polygon of %d corners, kind %d, area", sizes[i], kind), along, area,
                          1e-4 * area, "triangles overlap or are missing");
            pt_check_near(label("polygon of %d corners, kind %d, orientation", sizes[i], kind), size, area,
                          1e-4 * area, "a triangle is turned over");
            pt_scene_free(&s);
        }
}

/* Polygons that are none, or too large to be cut well. */
static const struct {
    const char *name, *text;
    unsigned triangles, degenerate, warnings;
    double area;
} ODD[] = {
    {"a quad that is not convex", "v 0 0 0\nv 1 0 0\nv 0.25 0.25 0\nv 0 1 0\nf 1 2 3 4\n", 2, 0, 0, 0.25},
    {"the same from its inner corner", "v 0.25 0.25 0\nv 0 1 0\nv 0 0 0\nv 1 0 0\nf 1 2 3 4\n", 2, 0, 0,
     0.25},
    {"a corner on an edge", "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\n", 3, 0, 0, 4},
    {"a corner on each edge",
     "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 2 1 0\nv 2 2 0\nv 1 2 0\nv 0 2 0\nv 0 1 0\nf 1 2 3 4 5 6 7 8\n", 6, 0, 0,
     4},
    {"a corner twice", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 2 3 4\n", 2, 0, 0, 4},
    {"a hole tied to the rim",
     "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 1 1 0\nv 1 3 0\nv 3 3 0\nv 3 1 0\nf 1 2 3 4 1 5 6 7 8 5\n", 8, 0,
     0, 12},
    {"a bow tie", "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nf 1 2 3 4\n", 2, 0, 1, -1},
    {"all on a line", "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 4 0 0\nv 0 1 0\nf 1 2 3 4 5\nf 1 2 6\n", 1, 1, 0,
     0.5},
    {"all in a point", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 1 1\nf 1 2 3\n", 1, 1, 0, 0.5}};

static void obj_odd_polygons(void)
{
    static char text[400000];
    size_t i, size = 0;
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    double along, whole;
    for (i = 0; i < sizeof ODD / sizeof ODD[0]; i++) {
        r = load(&s, ODD[i].text, NULL, &info);
        pt_check(r == PT_OK && info.triangles == ODD[i].triangles &&
                     info.degenerate_faces == ODD[i].degenerate && info.warning_count == ODD[i].warnings,
                 ODD[i].name, "%u triangles, %u degenerate faces, %u warnings: %s", (unsigned)info.triangles,
                 (unsigned)info.degenerate_faces, (unsigned)info.warning_count, info.warnings[0]);
        areas(&s, v3(0, 0, 1), &along, &whole);
        pt_check(ODD[i].area < 0 || (along == ODD[i].area && whole == ODD[i].area),
                 label("%s, area", ODD[i].name), "%g and %g", along, whole);
    }
    polygon_text(text, 1500, 1, &along);
    r = load(&s, text, NULL, &info);
    pt_check(r == PT_OK && info.warning_count == 1 && strstr(info.warnings[0], "1024"),
             "a star of 1500 corners", "%s", info.warnings[0]);
    polygon_text(text, 5000, 0, &along);
    r = load(&s, text, NULL, &info);
    pt_check(r == PT_OK && info.triangles > 4000 && s.position_count <= 5000, "a disk of 5000 corners",
             "%u triangles", (unsigned)info.triangles);
    for (i = 0; i < 3; i++) size += (size_t)sprintf(text + size, "v %d %d 0\n", (int)i % 2, (int)i / 2);
    text[size++] = 'f';
    memset(text + size, ' ', 300000); /* a very long line */
    strcpy(text + size + 300000, "1 2 3\n");
    r = load(&s, text, NULL, &info);
    pt_check(r == PT_OK && info.triangles == 1, "a line of 300000 bytes", "%s", info.error);
    pt_scene_free(&s);
}

/* ---- OBJ: numbers ----------------------------------------------------------------------------------- */

static double number_of(const char *text)
{
    const char *at = text;
    double value = -7;
    return pti_take_number(&at, &value) && *at == 0 ? value : -7;
}

/* Against the C library's strtod, in the locale C: equal where it is promised, and elsewhere as near as it is. */
static void numbers(void)
{
    static const char *const none[8] = {"", "-", ".", "+.", "e5", "nan", "inf", "-.e1"};
    static const char *const some[12] = {"0",
                                         "-0",
                                         "1",
                                         "0.1",
                                         "123456789012345678",
                                         "1e22",
                                         "1e-22",
                                         "9007199254740991e22",
                                         "3.4e38",
                                         "1.7976931348623157e308",
                                         "4.9e-324",
                                         "1e-400"};
    uint64_t h = 1;
    int i, unequal = 0, far = 0;
    char text[64];
    for (i = 0; i < 8; i++) pt_check(number_of(none[i]) == -7, label("'%s'", none[i]), "is a number");
    for (i = 0; i < 11; i++)
        pt_check_near(label("'%s'", some[i]), number_of(some[i]), strtod(some[i], NULL),
                      0x1p-48 * fabs(strtod(some[i], NULL)), "");
    pt_check(number_of(some[11]) == 0 && number_of("1e999") == HUGE_VAL &&
                 number_of("-1e99999999999999999999") == -HUGE_VAL,
             "ends of the range", "wrong");
    pt_check(number_of("0.00000000000000000000000000000000000000001e41") == 1 &&
                 number_of("100000000000000000000000000000e-29") == 1,
             "long numbers of size 1", "wrong");
    for (i = 0; i < 100000; i++) {
        double got, exact;
        h = pt_hash64(h + (uint64_t)i);
        sprintf(text, "%s%llu.%0*llue%d", h & 1 ? "-" : "", (unsigned long long)(h >> 40),
                1 + (int)((h >> 1) % 7), (unsigned long long)(h >> 20) % 10, (int)((h >> 8) % 15));
        unequal += number_of(text) != strtod(text, NULL);
        sprintf(text, "%llu.%llue%d", (unsigned long long)(h >> 3), (unsigned long long)h,
                (int)((h >> 8) % 280) - 10);
        got = number_of(text);
        exact = strtod(text, NULL);
        far += !(fabs(got - exact) <= 0x1p-48 * fabs(exact));
    }
    pt_check(unequal == 0, "15 digits and small exponents: rounded correctly", "%d of 100000 differ",
             unequal);
    pt_check(far == 0, "any digits and exponents: 48 bits", "%d of 100000 are farther", far);
}

/* A locale with a comma changes nothing: in a process that has one, 0.5 is a half. */
static void locales(void)
{
    static const char *const names[8] = {"de_DE.UTF-8",         "de_DE.utf8", "de_DE",
                                         "fr_FR.UTF-8",         "fr_FR.utf8", "pl_PL.UTF-8",
                                         "German_Germany.1252", "it_IT.UTF-8"};
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    int i, found = 0;
    for (i = 0; i < 8 && !found; i++)
        found = setlocale(LC_ALL, names[i]) != NULL && localeconv()->decimal_point[0] == ',';
    if (!found) printf("skip   no locale with a decimal comma is installed\n");
    r = load(&s, "v 0.5 0 0\nv 1.25e0 0 0\nv 0 1.5 0\nf 1 2 3\n", NULL, &info);
    pt_check(r == PT_OK && same3(corner_of(&s, 0, 0), v3(0.5, 0, 0)) && same3(info.hi, v3(1.25, 1.5, 0)),
             "a locale with a decimal comma", "%s", info.error);
    r = load(&s, "v 0,5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", NULL, &info);
    pt_check(r == PT_ERROR_FILE && strstr(info.error, "model.obj:1: 'v'"), "a comma in the file", "%s",
             info.error);
    setlocale(LC_ALL, "C");
    pt_scene_free(&s);
}

/* ---- OBJ: normals, coordinates, transforms ---------------------------------------------------------- */

/* What a ray along -z through (x, y) hits. */
static int look(const pt_scene *s, double x, double y, pt_hit *hit)
{
    pt_ray ray = {{0, 0, 50}, {0, 0, -1}, (pt_real)1e30};
    ray.o.x = (pt_real)x;
    ray.o.y = (pt_real)y;
    return pt_intersect(s, &ray, hit);
}

static void obj_normals(void)
{
    /* one face each with both, with vn, with vt, with nothing, with a vn of zero, with vn at two corners */
    static const char text[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nv 3 0 0\nv 2 1 0\nv 4 0 0\nv 5 0 0\nv 4 "
                               "1 0\nv 6 0 0\nv 7 0 0\nv 6 1 0\n"
                               "v 8 0 0\nv 9 0 0\nv 8 1 0\nv 10 0 0\nv 11 0 0\nv 10 1 0\n"
                               "vn 3 0 4\nvn 0 0 0\nvn nan 0 1\nvt 0.25 0.5\nvt 0.75 0.5\nvt 0.25 1.5 7\n"
                               "f 1/1/1 2/2/1 3/3/1\nf 4//1 5//1 6//1\nf 7/1 8/2 9/3\nf 10 11 12\nf 13//2 "
                               "14//2 15//3\nf 16//1 17//1 18\n";
    static const int has_vn[6] = {1, 1, 0, 0, 0, 0}, has_vt[6] = {1, 0, 1, 0, 0, 0};
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    int i;
    r = load(&s, text, NULL, &info);
    pt_check(r == PT_OK && pt_commit(&s) == PT_OK && info.warning_count == 2 && info.vertices == 18,
             "normals and coordinates", "%s", info.error);
    pt_check(strstr(info.warnings[0], "model.obj:20: a normal") &&
                 strstr(info.warnings[1], "model.obj:21: a normal"),
             "normals that are none", "'%s'", info.warnings[0]);
    for (i = 0; i < 6; i++) {
        pt_hit hit;
        const int found = look(&s, 2 * i + 0.25, 0.25, &hit);
        pt_check(found && same3(hit.ng, v3(0, 0, 1)) &&
                     far3(hit.ns, has_vn[i] ? v3(0.6, 0, 0.8) : v3(0, 0, 1)) < 1e-6,
                 label("normal of face %d", i), "%g %g %g", (double)hit.ns.x, (double)hit.ns.y,
                 (double)hit.ns.z);
        pt_check(found && (!has_vt[i] ||
                           (fabs((double)hit.uv.x - 0.375) < 1e-6 && fabs((double)hit.uv.y - 0.75) < 1e-6)),
                 label("coordinates of face %d", i), "%g %g", (double)hit.uv.x, (double)hit.uv.y);
    }
    pt_check(pt_scene_needs(&s) & PT_NEEDS_SHADING_NORMALS && pt_scene_needs(&s) & PT_NEEDS_UVS, "needs",
             "%x", pt_scene_needs(&s));
    r = load(&s, SQUARE "vn 0 0 1\nvt 0 0\nf 1 2 3\n", NULL, &info);
    pt_check(r == PT_OK && pt_commit(&s) == PT_OK && s.normal_count == 0 && s.uv_count == 0,
             "normals that no face uses", "%u", (unsigned)s.normal_count);
    r = load(&s, SQUARE "vt nan x\nvt 1e30\nvt\nf 1/1 2/2 3/3\n", NULL, &info);
    pt_check(r == PT_OK && info.warning_count == 3 && s.uvs[1].x == 0, "vt that are none", "%u warnings",
             (unsigned)info.warning_count);
    pt_scene_free(&s);
}

/* A transform moves corners by A p + t and normals by the inverse transposed; a mirror keeps the outside outside. */
static void obj_transform(void)
{
    static const char text[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 1 1 1\nf 2//1 3//1 4//1\n";
    pt_obj_options o;
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    pt_vec3 n;
    int mirrored;
    for (mirrored = 0; mirrored < 2; mirrored++) {
        memset(&o, 0, sizeof o);
        o.transform[0][0] = mirrored ? -2 : 2;
        o.transform[1][2] = -3;
        o.transform[2][1] = 1;
        o.transform[0][3] = 10;
        o.transform[1][3] = 20;
        o.transform[2][3] = 30;
        r = load(&s, text, &o, &info);
        pt_check(r == PT_OK, "a transform", "%s", info.error);
        pt_check(same3(corner_of(&s, 0, 0), v3(mirrored ? 8 : 12, 20, 30)) &&
                     same3(corner_of(&s, 0, mirrored ? 2 : 1), v3(10, 20, 31)) &&
                     same3(corner_of(&s, 0, mirrored ? 1 : 2), v3(10, 17, 30)),
                 label("corners, %d", mirrored), "%g %g %g", (double)corner_of(&s, 0, 1).x,
                 (double)corner_of(&s, 0, 1).y, (double)corner_of(&s, 0, 1).z);
        pt_check(same3(info.lo, v3(mirrored ? 8 : 10, 17, 30)) &&
                     same3(info.hi, v3(mirrored ? 10 : 12, 20, 31)),
                 label("bounds, %d", mirrored), "%g %g", (double)info.lo.x, (double)info.hi.x);
        n = pt_v3_normalize(
            v3(mirrored ? -0.5 : 0.5, -1.0 / 3, 1)); /* of the plane that the triangle is in now */
        pt_check(far3(s.normals[0], n) < 1e-6, label("normals, %d", mirrored), "%g %g %g",
                 (double)s.normals[0].x, (double)s.normals[0].y, (double)s.normals[0].z);
        n = pt_v3_cross(pt_v3_sub(corner_of(&s, 0, 1), corner_of(&s, 0, 0)),
                        pt_v3_sub(corner_of(&s, 0, 2), corner_of(&s, 0, 0)));
        pt_check(far3(pt_v3_normalize(n), s.normals[0]) < 1e-6, label("outside, %d", mirrored), "is inside");
    }
    o.transform[0][0] = 0;
    r = load(&s, text, &o, &info);
    pt_check(r == PT_ERROR_ARGUMENT && strstr(info.error, "inverse"), "a transform without inverse", "%s",
             info.error);
    o.transform[0][0] = (double)NAN;
    r = load(&s, text, &o, &info);
    pt_check(r == PT_ERROR_ARGUMENT, "a transform that is not a number", "%s", info.error);
    memset(&o, 0, sizeof o);
    o.transform[1][3] = HUGE_VAL;
    r = load(&s, text, &o, &info);
    pt_check(r == PT_ERROR_ARGUMENT, "an infinite translation", "%s", info.error);
    memset(&o, 0, sizeof o);
    o.transform[0][0] = o.transform[1][1] = o.transform[2][2] = 1e19;
    r = load(&s, text, &o, &info);
    pt_check(r == PT_ERROR_FILE && strstr(info.error, "model.obj:2: a coordinate"), "a model of 1e19", "%s",
             info.error);
    memset(&o, 0, sizeof o);
    o.emission_scale = -1;
    r = load(&s, text, &o, &info);
    pt_check(r == PT_ERROR_ARGUMENT && strstr(info.error, "emission"), "a negative emission", "%s",
             info.error);
    memset(&o, 0, sizeof o);
    o.flags = PT_OBJ_MATERIAL;
    r = load(&s, text, &o, &info);
    pt_check(r == PT_ERROR_ARGUMENT && strstr(info.error, "material"), "a material that does not exist", "%s",
             info.error);
    pt_add_material(&s, pt_material_mirror(grey(1)));
    write_text("model.obj", text);
    pt_check(pt_load_obj(&s, path_of("model.obj"), &o, &info) == PT_OK && s.material_count == 1 &&
                 info.materials == 0 && s.triangles[0].material == 0,
             "a material of one's own", "%s", info.error);
    pt_scene_free(&s);
}

/* ---- OBJ: errors ------------------------------------------------------------------------------------ */

static const struct {
    const char *text, *sentence;
} BROKEN[] = {{"", "model.obj: holds no triangle"},
              {"v 0 0 0\n", "model.obj: holds no triangle"},
              {"hello world\n", "model.obj: holds no triangle"},
              {SQUARE "f 1 1 1\n", "model.obj: holds no triangle"},
              {"v 0 0\n", "model.obj:1: 'v' without"},
              {"v 0 0 x\n", "model.obj:1: 'v' without"},
              {"\n\nv 0 0 1x\n", "model.obj:3: 'v' without"},
              {"v 0 0 nan\n", "model.obj:1: 'v' without"},
              {"v 0 0 1e19\n", "model.obj:1: a coordinate"},
              {"v 0 -1e999 0\n", "model.obj:1: a coordinate"},
              {SQUARE "f 1 2 5\n", "model.obj:5: index '5' points nowhere"},
              {SQUARE "f 1 2 0\n", "model.obj:5: index '0' points nowhere"},
              {SQUARE "f 1 2 -5\n", "model.obj:5: index '-5' points nowhere"},
              {SQUARE "f 1 2 -0\n", "model.obj:5: index '-0' points nowhere"},
              {SQUARE "f 1 2 x\n", "model.obj:5: index 'x' points nowhere"},
              {SQUARE "f 1 2 99999999999999999999999\n", "points nowhere"},
              {SQUARE "f 1 2 4294967297\n", "points nowhere"},
              {SQUARE "f 1/1 2/1 3/1\n", "model.obj:5: index '1' points nowhere"},
              {SQUARE "vt 0 0\nf 1/1 2/1 3/2\n", "model.obj:6: index '2' points nowhere"},
              {SQUARE "vn 0 0 1\nf 1//1 2//1 3//-2\n", "model.obj:6: index '-2' points nowhere"},
              {SQUARE "vt 0 0\nvn 0 0 1\nf 1/1/1/1 2 3\n", "model.obj:7: no corner of a face: '1/1/1/1'"},
              {SQUARE "f 1 2 3x\n", "model.obj:5: no corner of a face: '3x'"},
              {SQUARE "f 1 2 3.5\n", "model.obj:5: no corner"},
              {SQUARE "f 1 2 \\\n\\\n 9\n", "model.obj:7: index '9'"},
              {"# \\\nv 1 2\n", "model.obj:2: 'v' without"}};

static void obj_errors(void)
{
    pt_scene s = PT_SCENE_INIT, none = PT_SCENE_INIT;
    pt_obj_info info;
    size_t i;
    pt_add_triangle(&s, v3(0, 0, 0), v3(1, 0, 0), v3(0, 1, 0),
                    pt_add_material(&s, pt_material_emitter(grey(1))));
    pt_commit(&s);
    for (i = 0; i < sizeof BROKEN / sizeof BROKEN[0]; i++) {
        pt_hit hit;
        pt_result r;
        write_text("model.obj", BROKEN[i].text);
        r = pt_load_obj(&s, path_of("model.obj"), NULL, &info);
        pt_check(r == PT_ERROR_FILE && strstr(info.error, BROKEN[i].sentence), BROKEN[i].sentence, "%s: '%s'",
                 pt_result_string(r), info.error);
        pt_check(s.error == PT_OK && s.committed && s.triangle_count == 1 && s.material_count == 1 &&
                     s.position_count == 3 && look(&s, 0.2, 0.2, &hit) && info.triangles == 0,
                 label("after %s", BROKEN[i].sentence), "the scene has changed");
    }
    write_bytes("model.obj", "v 0 0 0\0v", 9);
    pt_check(pt_load_obj(&s, path_of("model.obj"), NULL, &info) == PT_ERROR_FILE &&
                 strstr(info.error, "not a text"),
             "bytes that are no text", "%s", info.error);
    remove(path_of("model.obj"));
    pt_check(pt_load_obj(&s, path_of("model.obj"), NULL, &info) == PT_ERROR_FILE &&
                 strstr(info.error, "of_files.model.obj: cannot be read"),
             "no file", "%s", info.error);
    pt_check(pt_load_obj(&s, NULL, NULL, &info) == PT_ERROR_FILE &&
                 pt_load_obj(&s, "", NULL, NULL) == PT_ERROR_FILE &&
                 pt_load_obj(&s, "tests", NULL, NULL) != PT_OK,
             "no path, and a directory", "%s", info.error);
    pt_check(s.committed && s.triangle_count == 1, "after them", "the scene has changed");
    pt_add_sphere(&none, v3(0, 0, 0), -1, 0);
    pt_check(pt_load_obj(&none, path_of("model.obj"), NULL, &info) == PT_ERROR_SCENE &&
                 strstr(info.error, "radius"),
             "a scene that is wrong already", "%s", info.error);
    pt_scene_free(&none);
    pt_scene_free(&s);
}

/* More than 2 GiB: refused by its size. The file has a hole, and takes no room where the file system knows holes. */
static void obj_huge(void)
{
#ifdef PTI_HAS_FSYNC
    pt_scene s = PT_SCENE_INIT;
    pt_image image = PT_IMAGE_INIT;
    pt_obj_info info;
    const char *const path = path_of("huge.obj");
    FILE *const file = fopen(path, "wb");
    const int made = file && fputs("v 0 0 0\n", file) >= 0 && fflush(file) == 0 &&
                     ftruncate(fileno(file), (off_t)1 << 31) == 0;
    if (file) fclose(file);
    pool_start(0);
    if (made) {
        pt_check(pt_load_obj(&s, path, NULL, &info) == PT_ERROR_FILE &&
                     strstr(info.error, "huge.obj: is larger than 2 GiB"),
                 "2 GiB", "%s", info.error);
        pt_check(pt_read_image(path, &image) == PT_ERROR_FILE && pool.largest < 65536, "2 GiB as picture",
                 "%lu bytes were asked for", (unsigned long)pool.largest);
    } else
        printf("skip   no file of 2 GiB can be made here\n");
    remove(path);
    pt_scene_free(&s);
#endif
}

/* ---- MTL -------------------------------------------------------------------------------------------- */

#define TRIANGLE "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"

/* A material's lines, and what it must become. Numbers of a kind that has none are 0. */
static const struct {
    const char *lines;
    pt_material_kind kind;
    double albedo, emission, ior, roughness, specular, exponent, head_on; /* of the red band */
    unsigned warnings;
} MATERIALS[] = {
    {"Kd 0.5 0.25 0", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0.5\n", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0},
    {"Ka 1 1 1\nTf 1 1 1\n", PT_MATERIAL_DIFFUSE, 0.8, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0 0 0\nKe 3 2 1\n", PT_MATERIAL_DIFFUSE, 0, 3, 0, 0, 0, 0, 0, 0},
    {"Kd 0.5 0.5 0.5\nKs 0.25 0.25 0.25\nNs 40\nillum 2", PT_MATERIAL_PHONG, 0.5, 0, 0, 0, 0.25, 40, 0, 0},
    {"Kd 0.5 0.5 0.5\nKs 0.25 0.25 0.25\nNs 40", PT_MATERIAL_PHONG, 0.5, 0, 0, 0, 0.25, 40, 0, 0},
    {"Kd 0.5 0.5 0.5\nKs 0.25 0.25 0.25\nNs 40\nillum 1", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0.75 0 0\nKs 0.25 0.75 0.5\nNs 9", PT_MATERIAL_PHONG, 0.75, 0, 0, 0, 0.25, 9, 0, 0},
    {"Kd 1 0 0\nKs 1 0 0\nNs 9", PT_MATERIAL_PHONG, 0.5, 0, 0, 0, 0.5, 9, 0, 1},
    {"Kd 0.5 0.5 0.5\nKs 0.9 0.9 0.9\nNs 0\nillum 2", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0.5 0.5 0.5\nKs 0 0 0\nNs 40\nillum 2", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0.01 0.01 0.01\nKs 0.75 0.5 0.5\nNs 1000\nillum 5", PT_MATERIAL_MIRROR, 0.75, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0 0 0\nKs 0.75 0.5 0.5\nillum 3", PT_MATERIAL_MIRROR, 0.75, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0.5 0 0\nKs 0.25 0.25 0.25\nillum 3\nNs 7", PT_MATERIAL_PHONG, 0.5, 0, 0, 0, 0.25, 7, 0, 0},
    {"Kd 0 0 0\nKs 0.75 0.5 0.5\nillum 5\nPr 0.25", PT_MATERIAL_CONDUCTOR, 1, 0, 0, 0.25, 0, 0, 0.75, 0},
    {"Kd 0.9 0.6 0.25\nPm 1\nPr 0.5", PT_MATERIAL_CONDUCTOR, 1, 0, 0, 0.5, 0, 0, 0.9, 0},
    {"Kd 1 1 1\nPm 0.5", PT_MATERIAL_CONDUCTOR, 1, 0, 0, 0, 0, 0, 1, 0},
    {"Kd 0 1 1\nPm 1\nillum 7", PT_MATERIAL_CONDUCTOR, 1, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0.5 0.5 0.5\nPm 0.25", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0.5 0.5 0.5\nillum 7\nNi 1.25", PT_MATERIAL_DIELECTRIC, 0, 0, 1.25, 0, 0, 0, 0, 0},
    {"illum 4", PT_MATERIAL_DIELECTRIC, 0, 0, 1.5, 0, 0, 0, 0, 0},
    {"illum 6\nNi 2", PT_MATERIAL_DIELECTRIC, 0, 0, 2, 0, 0, 0, 0, 0},
    {"illum 9\nNi 1\nPr 0.5", PT_MATERIAL_DIELECTRIC, 0, 0, 1, 0.5, 0, 0, 0, 0},
    {"d 0.25\nillum 2\nKs 1 1 1", PT_MATERIAL_DIELECTRIC, 0, 0, 1.5, 0, 0, 0, 0, 0},
    {"Tr 0.75", PT_MATERIAL_DIELECTRIC, 0, 0, 1.5, 0, 0, 0, 0, 0},
    {"d 1\nTr 1\nKd 0.5", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0},
    {"d 0.75\nKd 0.5", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0},
    {"Kd 0.5\nPr 0\nNi 1.25\nKs 1 1 1", PT_MATERIAL_COAT, 0.5, 0, 1.25, 0, 0, 0, 0, 0},
    {"Kd 0.5\nPr 0.03", PT_MATERIAL_COAT, 0.5, 0, 1.5, 0, 0, 0, 0, 0},
    {"Kd 0.5\nPr 0.5\nNi 3", PT_MATERIAL_BLINN, 0.5, 0, 0, 0, 0.25, 30, 0, 0},
    {"Kd 0.5\nPr 1\nPm 0\nNi 3\nKs 1 1 1\nNs 5", PT_MATERIAL_BLINN, 0.5, 0, 0, 0, 0.25, 0, 0, 0},
    {"Kd 1\nPr 1\nNi 3", PT_MATERIAL_BLINN, 0.8, 0, 0, 0, 0.2, 0, 0, 1},
    {"Kd 2 -1 0.5", PT_MATERIAL_DIFFUSE, 1, 0, 0, 0, 0, 0, 0, 1},
    {"Kd 0.5\nNi 0\nillum 7", PT_MATERIAL_DIELECTRIC, 0, 0, 1.5, 0, 0, 0, 0, 1},
    {"Kd 0.5\nKs 0.5\nNs 1e9", PT_MATERIAL_PHONG, 0.5, 0, 0, 0, 0.5, 1e6, 0, 1},
    {"Ke 1e40 0 0\nKd 0", PT_MATERIAL_DIFFUSE, 0, 1e30, 0, 0, 0, 0, 0, 1},
    {"Kd spectral a.rfl\nKs\nillum x", PT_MATERIAL_DIFFUSE, 0.8, 0, 0, 0, 0, 0, 0, 3},
    {"Kd 0.5 0.5", PT_MATERIAL_DIFFUSE, 0.8, 0, 0, 0, 0, 0, 0, 1},
    {"Kd 0.5 # 1 1", PT_MATERIAL_DIFFUSE, 0.5, 0, 0, 0, 0, 0, 0, 0}};

static void mtl_table(void)
{
    char text[200];
    size_t i;
    write_text("model.obj", "mtllib of_files.model.mtl\n" TRIANGLE "usemtl a\nf 1 2 3\n");
    for (i = 0; i < sizeof MATERIALS / sizeof MATERIALS[0]; i++) {
        pt_scene s = PT_SCENE_INIT;
        pt_obj_info info;
        pt_material m;
        int bad;
        sprintf(text, "newmtl b\nKd 1 0 1\nnewmtl a\n%s\n", MATERIALS[i].lines);
        write_text("model.mtl", text);
        pt_check(pt_load_obj(&s, path_of("model.obj"), NULL, &info) == PT_OK && s.material_count == 1 &&
                     s.materials[0].kind == MATERIALS[i].kind,
                 MATERIALS[i].lines, "kind %d: %s", s.material_count ? (int)s.materials[0].kind : -1,
                 info.error);
        if (s.material_count == 0) continue;
        m = s.materials[0];
        bad = fabs((double)m.albedo.r - MATERIALS[i].albedo) > 1e-7 ||
              !((double)m.emission.r >= 0.9999999 * MATERIALS[i].emission &&
                (double)m.emission.r <= 1.0000001 * MATERIALS[i].emission) ||
              m.ior != (pt_real)MATERIALS[i].ior || m.roughness != (pt_real)MATERIALS[i].roughness ||
              fabs((double)m.specular.r - MATERIALS[i].specular) > 1e-7 ||
              fabs((double)m.exponent - MATERIALS[i].exponent) > 1e-6 * MATERIALS[i].exponent;
        pt_check(!bad, label("%s: numbers", MATERIALS[i].lines),
                 "albedo %g, emission %g, ior %g, roughness %g, specular %g, exponent %g", (double)m.albedo.r,
                 (double)m.emission.r, (double)m.ior, (double)m.roughness, (double)m.specular.r,
                 (double)m.exponent);
        if (m.kind == PT_MATERIAL_CONDUCTOR) {
            double last = pt_fresnel_conductor(1, (double)m.eta.r, (double)m.k.r);
            int c, falls = 0;
            pt_check_near(label("%s: reflectance head on", MATERIALS[i].lines), last, MATERIALS[i].head_on,
                          2e-6, "");
            for (c = 99; c >= 0; c--) {
                const double next = pt_fresnel_conductor(c / 100.0, (double)m.eta.r, (double)m.k.r);
                falls += next < last - 1e-12;
                last = next;
            }
            pt_check(falls == 0, label("%s: reflectance towards grazing angles", MATERIALS[i].lines),
                     "falls %d times", falls);
        }
        pt_check(info.warning_count == MATERIALS[i].warnings &&
                     info.emissive_triangles == (MATERIALS[i].emission > 0),
                 label("%s: warnings", MATERIALS[i].lines), "%u: %s", (unsigned)info.warning_count,
                 info.warnings[0]);
        pt_scene_free(&s);
    }
}

/* Names, files and the order of things. */
static void mtl_files(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    pt_obj_options o;
    uint32_t k;
    write_text("a b.mtl", "Kd 1 1 1\nnewmtl a\nKd 0.25\n  newmtl  two words \t\n\tKd\t0.5\nnewmtl a\nKd "
                          "1\nfoo 1 2\nmap_Bump x.png\n");
    write_text("c.mtl", "\xef\xbb\xbf# c\r\nnewmtl c\r\nKd 0.75\r\nKe 1 \\\r\n1 1\r\n");
    memset(&o, 0, sizeof o);
    o.emission_scale = 2.5;
    r = load(&s,
             "mtllib of_files.a b.mtl\nmtllib .\\of_files.c.mtl nowhere.mtl\n" TRIANGLE
             "f 1 2 3\nusemtl two words  \nf 1 2 3\nusemtl a\nf 1 2 3\nusemtl c\nf 1 2 3\nusemtl d\nf 1 2 "
             "3\nusemtl a\nf 1 2 3\nusemtl c\nf 3 2 1\n",
             &o, &info);
    pt_check(r == PT_OK, "several MTL files", "%s", info.error);
    pt_check(s.material_count == 4 && info.materials == 4 && s.triangle_count == 7,
             "materials that are used, once each", "%u", (unsigned)s.material_count);
    for (k = 0; k < s.triangle_count && s.triangle_count == 7; k++) {
        static const double albedo[7] = {0.8, 0.5, 0.25, 0.75, 0.8, 0.25, 0.75};
        pt_check(s.materials[s.triangles[k].material].albedo.r == (pt_real)albedo[k],
                 label("material of face %u", (unsigned)k), "%g",
                 (double)s.materials[s.triangles[k].material].albedo.r);
    }
    pt_check(info.emissive_triangles == 2 && s.materials[s.triangles[3].material].emission.b == (pt_real)2.5,
             "emission scaled", "%u emissive", (unsigned)info.emissive_triangles);
    pt_check(info.warning_count == 2 && strstr(info.warnings[0], "model.obj:2: cannot read 'nowhere.mtl'") &&
                 strstr(info.warnings[1], "model.obj:16: no newmtl 'd'"),
             "what is missing", "%u: %s; %s", (unsigned)info.warning_count, info.warnings[0],
             info.warnings[1]);
    pt_check(info.skipped_lines == 3, "lines that are skipped", "%u", (unsigned)info.skipped_lines);
    o.flags = PT_OBJ_NO_MTL;
    r = load(&s, "mtllib of_files.a b.mtl\n" TRIANGLE "usemtl a\nf 1 2 3\n", &o, &info);
    pt_check(r == PT_OK && s.materials[0].albedo.r == (pt_real)0.8 && info.warning_count == 0,
             "PT_OBJ_NO_MTL", "%s", info.warnings[0]);
    r = load(&s, "mtllib no.mtl\nmtllib of_files.model.obj\nmtllib\n" TRIANGLE "usemtl a\nusemtl\nf 1 2 3\n",
             NULL, &info);
    pt_check(r == PT_OK && info.warning_count == 4, "MTL files that are none", "%u warnings",
             (unsigned)info.warning_count);
    for (k = 0; k < 3; k++)
        pt_check(info.warnings[k][0] != 0, "a sentence for each", "warning %u has none", (unsigned)k);
    remove(path_of("a b.mtl"));
    remove(path_of("c.mtl"));
    pt_scene_free(&s);
}

/* Warnings beyond the eighth are counted; names are cut, and what is no letter is shown as such. */
static void mtl_warnings(void)
{
    static char text[3000];
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    int i;
    size_t n = (size_t)sprintf(text, TRIANGLE "usemtl a\x1b[31m\x7f\nusemtl ");
    memset(text + n, 'x', 500);
    n += 500;
    for (i = 0; i < 10; i++) n += (size_t)sprintf(text + n, "\nusemtl %d", i);
    strcpy(text + n, "\nf 1 2 3\n");
    r = load(&s, text, NULL, &info);
    pt_check(r == PT_OK && info.warning_count == 12, "twelve warnings", "%u", (unsigned)info.warning_count);
    pt_check(strstr(info.warnings[0], ":7: no newmtl 'a?[31m?'") &&
                 strstr(info.warnings[7], ":14: no newmtl '5'"),
             "the first and the eighth", "'%s' '%s'", info.warnings[0], info.warnings[7]);
    pt_check(strlen(info.warnings[1]) < 120 && strstr(info.warnings[1], "xxxx'"), "a name of 500 letters",
             "'%s'", info.warnings[1]);
    pt_scene_free(&s);
}

/* ---- textures --------------------------------------------------------------------------------------- */

static void mtl_textures(void)
{
    static const unsigned char rgb[12] = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
    static const float bright[3] = {4, -1, 0.5f};
    static const char *const mtl =
        "newmtl a\nKd 0.5\nmap_Kd -s 2 3 4 -clamp on -o 0.5 of_files.map one.png\nnewmtl b\nmap_Kd "
        ".\\of_files.map one.png\nnewmtl c\nKd 0 0 0\nmap_Kd of_files.map.pfm\n"
        "newmtl d\nKd 0.25\nmap_Kd of_files.map.jpg\nnewmtl e\nillum 7\nmap_Kd of_files.map.pfm\nnewmtl "
        "f\nKd 0.5\nmap_Kd\nnewmtl g\nmap_Kd -s\n";
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    pt_obj_options o;
    pt_hit hit;
    const pt_texture *a, *b;
    pt_check(pt_write_png_bytes(path_of("map one.png"), rgb, 2, 2) == PT_OK &&
                 pt_write_pfm_floats(path_of("map.pfm"), bright, 1, 1) == PT_OK,
             "two pictures", "cannot be written");
    write_text("map.jpg", "\xff\xd8\xff no PNG");
    write_text("tex.mtl", mtl);
    r = load(&s,
             "mtllib of_files.tex.mtl\n" TRIANGLE
             "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\nusemtl c\nf 1 2 3\nf 3 2 1\nusemtl d\nf 1/1 "
             "2/2 3/3\nusemtl e\nf 1 2 3\nusemtl f\nf 1 2 3\nusemtl g\nf 1 2 3\n",
             NULL, &info);
    pt_check(r == PT_OK && s.material_count == 7 && info.textures == 2, "textures", "%u: %s",
             (unsigned)info.textures, info.error);
    if (s.material_count != 7) return;
    a = s.materials[0].texture;
    b = s.materials[1].texture;
    pt_check(a && b && a != b && a->rgb == b->rgb && a->width == 2 && a->height == 2,
             "two materials with one picture", "it is read twice");
    pt_check(a && a->scale.x == 2 && a->scale.y == 3 && b->scale.x == 1 && b->scale.y == 1, "option -s",
             "%g %g", a ? (double)a->scale.x : 0, a ? (double)a->scale.y : 0);
    pt_check(s.materials[0].albedo.r == (pt_real)0.5 && s.materials[1].albedo.r == 1 &&
                 s.materials[2].albedo.r == 1,
             "Kd beside a picture", "%g", (double)s.materials[1].albedo.r);
    pt_check(s.materials[2].texture && s.materials[2].texture->rgb[0] == 1 &&
                 s.materials[2].texture->rgb[1] == 0 && s.materials[2].texture->rgb[2] == 0.5f,
             "a reflectance", "is not in [0,1]");
    pt_check(s.materials[3].texture == NULL && s.materials[3].albedo.r == (pt_real)0.25 &&
                 s.materials[4].texture == NULL && s.materials[5].texture == NULL &&
                 s.materials[6].texture == NULL,
             "no picture", "there is one");
    pt_check(info.warning_count == 4 && strstr(info.warnings[0], "tex.mtl:3: option '-clamp'") &&
                 strstr(info.warnings[1], "tex.mtl:3: option '-o'") &&
                 strstr(info.warnings[2], "model.obj:13: a face with a picture has no vt") &&
                 strstr(info.warnings[3], "tex.mtl:9: no PPM, PFM or PNG: 'of_files.map.jpg'; Kd"),
             "options and files that are skipped", "%u: %s; %s; %s", (unsigned)info.warning_count,
             info.warnings[1], info.warnings[2], info.warnings[3]);
    pt_check(pt_commit(&s) == PT_OK && pt_scene_needs(&s) & PT_NEEDS_TEXTURES && look(&s, 0.25, 0.25, &hit),
             "the textured scene", "%s", pt_scene_error(&s));
    pt_check(pt_texture_eval(b, pt_v2((pt_real)0.25, (pt_real)0.75), v3(0, 0, 0)).r == 1 &&
                 pt_texture_eval(b, pt_v2((pt_real)0.75, (pt_real)0.25), v3(0, 0, 0)).b == 1,
             "pixels", "are turned");
    memset(&o, 0, sizeof o);
    o.flags = PT_OBJ_NO_TEXTURES;
    r = load(&s, "mtllib of_files.tex.mtl\n" TRIANGLE "usemtl a\nf 1 2 3\n", &o, &info);
    pt_check(r == PT_OK && s.materials[0].texture == NULL && info.textures == 0, "PT_OBJ_NO_TEXTURES",
             "there is one");
    pt_scene_free(&s);
    remove(path_of("map.jpg"));
    remove(path_of("map.pfm"));
    remove(path_of("map one.png"));
    remove(path_of("tex.mtl"));
}

/* Paths are relative to the file that names them. */
static void relative_paths(void)
{
#ifdef PTI_HAS_FSYNC
    static const unsigned char rgb[3] = {9, 99, 199};
    char place[200], text[800];
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    strcpy(place, path_of("dir"));
    mkdir(place, 0777);
    pt_check(pt_write_ppm_bytes(label("%s/a.ppm", place), rgb, 1, 1) == PT_OK, "a picture in a directory",
             "cannot be written");
    write_text("dir/a.mtl", "newmtl a\nmap_Kd a.ppm\n");
    write_text("dir/b.obj", "mtllib a.mtl\n" TRIANGLE "usemtl a\nf 1/1 2/2 3/3\n");
    pt_check(pt_load_obj(&s, label("%s/b.obj", place), NULL, &info) == PT_OK && info.textures == 1 &&
                 info.warning_count == 0,
             "beside the model", "%s", info.warnings[0]);
    pt_scene_free(&s);
    r = load(&s, "mtllib of_files.dir\\a.mtl\n" TRIANGLE "usemtl a\nf 1/1 2/2 3/3\n", NULL, &info);
    pt_check(r == PT_OK && info.textures == 1, "below the model, with a backslash", "%s", info.warnings[0]);
    pt_scene_free(&s);
    if (getcwd(text, 400)) {
        FILE *const file = fopen(label("%s/c.mtl", place), "wb");
        if (file) fprintf(file, "newmtl a\nmap_Kd %s/%s/a.ppm\n", text, place);
        if (file) fclose(file);
        r = load(&s, "mtllib of_files.dir/c.mtl\n" TRIANGLE "usemtl a\nf 1/1 2/2 3/3\n", NULL, &info);
        pt_check(r == PT_OK && info.textures == 1, "an absolute path", "%s", info.warnings[0]);
    }
    pt_scene_free(&s);
    remove(label("%s/a.mtl", place));
    remove(label("%s/b.obj", place));
    remove(label("%s/c.mtl", place));
    remove(label("%s/a.ppm", place));
    rmdir(place);
#endif
}

/* A scene from a file renders to the bits of the same scene made by calls. */
static void obj_renders_the_same(void)
{
    static const pt_real box[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                                      {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};
    static const int faces[6][4] = {{1, 2, 3, 4}, {8, 7, 6, 5}, {1, 5, 6, 2},
                                    {2, 6, 7, 3}, {3, 7, 8, 4}, {5, 1, 4, 8}};
    pt_scene a = PT_SCENE_INIT, b = PT_SCENE_INIT;
    pt_film film[2] = {PT_FILM_INIT, PT_FILM_INIT};
    pt_render_desc d = pt_render_defaults();
    pt_obj_info info;
    pt_result r;
    char text[1000];
    size_t n = (size_t)sprintf(text, "mtllib of_files.box.mtl\nusemtl wall\n");
    int i, k, wall, lamp;
    write_text("box.mtl", "newmtl wall\nKd 0.75 0.5 0.25\nnewmtl lamp\nKd 0 0 0\nKe 4 4 4\n");
    for (i = 0; i < 8; i++)
        n += (size_t)sprintf(text + n, "v %g %g %g\n", (double)box[i][0], (double)box[i][1],
                             (double)box[i][2]);
    wall = pt_add_material(&b, pt_material_diffuse(pt_rgb3((pt_real)0.75, (pt_real)0.5, (pt_real)0.25)));
    lamp = pt_add_material(&b, pt_material_emitter(grey(4)));
    for (i = 0; i < 6; i++) {
        pt_vec3 v[4];
        for (k = 0; k < 4; k++)
            v[k] = pt_v3(box[faces[i][k] - 1][0], box[faces[i][k] - 1][1], box[faces[i][k] - 1][2]);
        n += (size_t)sprintf(text + n, "%sf %d %d %d %d\n", i == 5 ? "usemtl lamp\n" : "", faces[i][0],
                             faces[i][1], faces[i][2], faces[i][3]);
        pt_add_quad(&b, v[0], v[1], v[2], v[3], i == 5 ? lamp : wall);
    }
    r = load(&a, text, NULL, &info);
    pt_check(r == PT_OK && info.emissive_triangles == 2 && pt_commit(&a) == PT_OK && pt_commit(&b) == PT_OK,
             "a box", "%s", info.error);
    d.camera = pt_camera_look_at(v3(-0.9, 0, 0), v3(0, 0, 0), v3(0, 1, 0), 70);
    d.width = 16;
    d.height = 12;
    d.spp = 4;
    pt_check(pt_render(&a, &d, &film[0], NULL) == PT_OK && pt_render(&b, &d, &film[1], NULL) == PT_OK,
             "two renders", "fail");
    pt_check(film[0].half[0] && film[1].half[0] &&
                 memcmp(film[0].half[0], film[1].half[0], 3 * 16 * 12 * sizeof(double)) == 0 &&
                 pt_film_pixel(&film[0], 8, 6).r > 0,
             "two boxes", "differ");
    for (i = 0; i < 2; i++) pt_film_free(&film[i]);
    pt_scene_free(&a);
    pt_scene_free(&b);
    remove(path_of("box.mtl"));
}

/* ---- pictures --------------------------------------------------------------------------------------- */

/* CRC-32 and CRC-64 bit by bit, to be compared with those of the header. */
static uint32_t crc32_of(const unsigned char *data, size_t size)
{
    uint32_t crc = 0xffffffffu;
    size_t i;
    int k;
    for (i = 0; i < size; i++)
        for (crc ^= data[i], k = 0; k < 8; k++) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
    return ~crc;
}

static uint64_t crc64_of(const unsigned char *data, size_t size)
{
    uint64_t crc = UINT64_MAX;
    size_t i;
    int k;
    for (i = 0; i < size; i++)
        for (crc ^= data[i], k = 0; k < 8; k++)
            crc = crc & 1 ? crc >> 1 ^ UINT64_C(0xc96c5795d7870f42) : crc >> 1;
    return ~crc;
}

/* The published check values of these codes: of the letters 123456789. */
static void checksums(void)
{
    const unsigned char *const digits = (const unsigned char *)"123456789";
    pti_crc64 c;
    pti_crc64_start(&c);
    pti_crc64_add(&c, digits, 4);
    pti_crc64_add(&c, digits + 4, 5);
    pt_check(~c.sum == UINT64_C(0x995dc9bbdf1939fa) && crc64_of(digits, 9) == ~c.sum, "CRC-64", "%llx",
             (unsigned long long)~c.sum);
    pt_check(pti_crc32(0, digits, 9) == 0xcbf43926u &&
                 pti_crc32(pti_crc32(0, digits, 5), digits + 5, 4) == 0xcbf43926u &&
                 crc32_of(digits, 9) == 0xcbf43926u,
             "CRC-32", "%x", (unsigned)pti_crc32(0, digits, 9));
    pt_check(pti_adler32((const unsigned char *)"Wikipedia", 9) == 0x11e60398u, "Adler-32", "%x",
             (unsigned)pti_adler32((const unsigned char *)"Wikipedia", 9));
}

/* Codes of too many short words are refused; too few are a code in which some words mean nothing. */
static void huffman_codes(void)
{
    static const unsigned char lengths[5][4] = {
        {1, 1, 1, 0}, {2, 2, 1, 2}, {1, 2, 3, 3}, {0, 15, 0, 1}, {0, 0, 0, 0}};
    static const unsigned char bits[2] = {0xdb, 0xff}; /* 110 then 111, from the lowest bit */
    static pti_huffman h;
    static pti_inflater s;
    int i;
    for (i = 0; i < 5; i++)
        pt_check(pti_huffman_make(&h, lengths[i], 4) == (i >= 2), label("code %d", i), "is %s",
                 i >= 2 ? "refused" : "taken");
    memset(&s, 0, sizeof s);
    s.in = bits;
    s.end = bits + 2;
    pt_check(pti_huffman_make(&h, lengths[2], 4) && h.longest == 3 && pti_take_symbol(&s, &h) == 2 &&
                 pti_take_symbol(&s, &h) == 2,
             "words of a code", "are read in another order");
    pt_check(pti_take_symbol(&s, &h) == 3 && pti_take_symbol(&s, &h) == 3 && pti_take_symbol(&s, &h) == 3 &&
                 s.missing == 0,
             "words of a code to the end", "other symbols");
    s.in = bits;
    s.count = s.missing = 0;
    s.buffer = 0;
    pt_check(pti_huffman_make(&h, lengths[3], 4) && pti_take_symbol(&s, &h) == -1, "a word without meaning",
             "is a symbol");
}

typedef struct png {
    int width, height, depth, type, interlaced, colours;
    unsigned char data[40000], raw[20000], stream[30000];
    size_t size, raw_size, stream_size;
} png;

static void put32(unsigned char *to, uint32_t v)
{
    int k;
    for (k = 0; k < 4; k++) to[k] = (unsigned char)(v >> (24 - 8 * k));
}

static void put_chunk(png *p, const char *type, const unsigned char *data, size_t size)
{
    unsigned char *const to = p->data + p->size;
    put32(to, (uint32_t)size);
    memcpy(to + 4, type, 4);
    if (size > 0) memcpy(to + 8, data, size);
    put32(to + 8 + size, crc32_of(to + 4, size + 4));
    p->size += size + 12;
}

static int png_channels(int type) { return type == 2 ? 3 : type == 4 ? 2 : type == 6 ? 4 : 1; }

/* Sample c of a pixel: any code, but within the palette. */
static uint32_t png_sample(const png *p, int x, int y, int c)
{
    const uint32_t h =
        (uint32_t)pt_hash64((uint64_t)(x + 100 * y + 10000 * c + 1000000 * p->depth + 100000000 * p->type)) >>
        3;
    return p->type == 3 ? h % (uint32_t)p->colours : h & ((1u << p->depth) - 1);
}

static int paeth_of(int a, int b, int c)
{
    const int q = a + b - c, pa = abs(q - a), pb = abs(q - b), pc = abs(q - c);
    return pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
}

/* The rows of one pass (every dx-th column from x0 on, ...), filtered by 0, 1, 2, 3, 4 in turns. */
static void png_rows(png *p, int x0, int y0, int dx, int dy)
{
    const int channels = png_channels(p->type), bits = channels * p->depth, pixel = bits < 8 ? 1 : bits / 8;
    unsigned char row[2][1024];
    int x, y, c, k, count = 0, n = 0;
    for (x = x0; x < p->width; x += dx) n++;
    memset(row, 0, sizeof row);
    for (y = y0; n > 0 && y < p->height; y += dy, count++) {
        unsigned char *const now = row[count % 2], *const up = row[1 - count % 2];
        const int size = (n * bits + 7) / 8, filter = count % 5;
        int at = 0;
        memset(now, 0, sizeof row[0]);
        for (x = x0; x < p->width; x += dx)
            for (c = 0; c < channels; c++, at += p->depth) {
                const uint32_t v = png_sample(p, x, y, c);
                if (p->depth == 16)
                    now[at / 8] = (unsigned char)(v >> 8), now[at / 8 + 1] = (unsigned char)(v & 255u);
                else
                    now[at / 8] = (unsigned char)(now[at / 8] | v << (8 - p->depth - at % 8));
            }
        p->raw[p->raw_size++] = (unsigned char)filter;
        for (k = 0; k < size; k++) {
            const int a = k < pixel ? 0 : now[k - pixel], b = up[k], d = k < pixel ? 0 : up[k - pixel];
            const int guess = filter == 0   ? 0
                              : filter == 1 ? a
                              : filter == 2 ? b
                              : filter == 3 ? (a + b) / 2
                                            : paeth_of(a, b, d);
            p->raw[p->raw_size++] = (unsigned char)(now[k] - guess);
        }
    }
}

/* A zlib stream of stored blocks of `block` bytes; the header's own writer makes those with fixed codes. */
static void png_store(png *p, size_t block)
{
    size_t at = 0;
    p->stream[0] = 0x78;
    p->stream[1] = 0x01;
    p->stream_size = 2;
    do {
        const size_t n = p->raw_size - at < block ? p->raw_size - at : block;
        unsigned char *const to = p->stream + p->stream_size;
        to[0] = at + n == p->raw_size;
        to[1] = (unsigned char)(n & 255u);
        to[2] = (unsigned char)(n >> 8);
        to[3] = (unsigned char)~to[1];
        to[4] = (unsigned char)~to[2];
        memcpy(to + 5, p->raw + at, n);
        p->stream_size += n + 5;
        at += n;
    } while (at < p->raw_size);
    put32(p->stream + p->stream_size, pti_adler32(p->raw, p->raw_size));
    p->stream_size += 4;
}

/* Signature, head, palette, a chunk that may be skipped, the stream in pieces, end. */
static void png_assemble(png *p, size_t piece)
{
    unsigned char head[13] = {0}, palette[768];
    size_t at;
    int k;
    memcpy(p->data, "\x89PNG\r\n\x1a\n", 8);
    p->size = 8;
    put32(head, (uint32_t)p->width);
    put32(head + 4, (uint32_t)p->height);
    head[8] = (unsigned char)p->depth;
    head[9] = (unsigned char)p->type;
    head[12] = (unsigned char)p->interlaced;
    put_chunk(p, "IHDR", head, 13);
    for (k = 0; k < 768; k++) palette[k] = (unsigned char)(k * 37 + 11);
    put_chunk(p, "tEXt", (const unsigned char *)"Title", 5);
    if (p->type == 3) put_chunk(p, "PLTE", palette, 3 * (size_t)p->colours);
    for (at = 0; at < p->stream_size; at += piece)
        put_chunk(p, "IDAT", p->stream + at, p->stream_size - at < piece ? p->stream_size - at : piece);
    put_chunk(p, "IEND", NULL, 0);
}

static void png_make(png *p, int width, int height, int depth, int type, int interlaced)
{
    static const unsigned char pass[7][4] = {{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4},
                                             {0, 2, 2, 4}, {1, 0, 2, 2}, {0, 1, 1, 2}};
    int k;
    p->width = width;
    p->height = height;
    p->depth = depth;
    p->type = type;
    p->interlaced = interlaced;
    p->colours = depth < 8 ? 1 << depth : 200;
    p->raw_size = 0;
    for (k = 0; k < 7 && interlaced; k++) png_rows(p, pass[k][0], pass[k][1], pass[k][2], pass[k][3]);
    if (!interlaced) png_rows(p, 0, 0, 1, 1);
    png_store(p, 300);
    png_assemble(p, 700);
}

/* What pixel (x, y) of such a file is in linear light. */
static float png_expected(const png *p, int x, int y, int k)
{
    const uint32_t v = png_sample(p, x, y, png_channels(p->type) >= 3 ? k : 0);
    if (p->type == 3) return (float)pt_srgb_decode((double)(((3 * v + (uint32_t)k) * 37 + 11) & 255u) / 255);
    return (float)pt_srgb_decode(v / (double)((1u << p->depth) - 1));
}

static png the_png; /* large, so that it is not on the stack */

static void png_kinds(void)
{
    static const int kinds[15][2] = {{1, 0}, {2, 0}, {4, 0}, {8, 0}, {16, 0}, {8, 2}, {16, 2}, {1, 3},
                                     {2, 3}, {4, 3}, {8, 3}, {8, 4}, {16, 4}, {8, 6}, {16, 6}};
    static const int sizes[6][2] = {{13, 11}, {1, 1}, {2, 5}, {5, 1}, {3, 3}, {32, 9}};
    png *const p = &the_png;
    int kind, size, interlaced, x, y, k;
    for (kind = 0; kind < 15; kind++)
        for (interlaced = 0; interlaced < 2; interlaced++)
            for (size = 0; size < 6; size++) {
                pt_image image = PT_IMAGE_INIT;
                int wrong = 0;
                png_make(p, sizes[size][0], sizes[size][1], kinds[kind][0], kinds[kind][1], interlaced);
                write_bytes("a.png", p->data, p->size);
                wrong = pt_read_image(path_of("a.png"), &image) != PT_OK || image.width != p->width ||
                        image.height != p->height;
                for (y = 0; !wrong && y < p->height; y++)
                    for (x = 0; x < p->width; x++)
                        for (k = 0; k < 3; k++)
                            wrong += image.rgb[3 * (y * p->width + x) + k] != png_expected(p, x, y, k);
                pt_check(!wrong,
                         label("PNG of %d x %d, %d bits, type %d%s", p->width, p->height, p->depth, p->type,
                               interlaced ? ", interlaced" : ""),
                         "%d values are wrong, or it is refused", wrong);
                pt_image_free(&image);
            }
    remove(path_of("a.png"));
}

/* The zlib stream, at its level 9 with codes of its own, of a picture of 20 x 16 whose bytes are 6 x, 10 y, x y / 4,
   filtered by 0 to 4 in turns. */
static const unsigned char DYNAMIC[320] = {
    120, 218, 157, 210, 193, 75,  132, 64,  20,  199, 241, 159, 142, 186, 177, 107, 108, 43,  219, 102,
    5,   82,  100, 80,  194, 146, 60,  66,  58,  8,   129, 65,  237, 201, 147, 39,  79,  30,  30,  158,
    164, 131, 127, 204, 251, 123, 115, 221, 86,  220, 172, 96,  149, 15,  195, 187, 12,  227, 124, 25,
    0,   176, 0,   27,  112, 0,   23,  240, 0,   31,  8,   128, 16,  136, 128, 24,  72,  128, 13,  144,
    2,   25,  144, 3,   5,   80,  2,   21,  80,  3,   26,  166, 219, 205, 123, 218, 81,  179, 222, 108,
    110, 105, 61,  122, 143, 234, 49,  122, 204, 134, 194, 18,  202, 108, 104, 135, 244, 86,  55,  116,
    84,  235, 123, 48,  182, 199, 54,  63,  63,  18,  193, 34,  205, 38,  221, 33,  229, 146, 233, 145,
    229, 211, 36,  160, 147, 144, 166, 17,  205, 98,  178, 19,  58,  221, 208, 60,  165, 179, 140, 22,
    57,  57,  5,   45,  75,  58,  175, 104, 85,  211, 133, 214, 4,   109, 27,  232, 35,  214, 46,  216,
    152, 102, 10,  107, 12,  170, 252, 200, 51,  100, 236, 236, 130, 117, 95,  63,  134, 222, 163, 254,
    152, 25,  22,  235, 54,  155, 14,  79,  92,  158, 122, 108, 251, 60,  15,  120, 17,  242, 50,  226,
    85,  204, 151, 9,   95,  111, 216, 75,  249, 38,  227, 187, 156, 239, 11,  126, 40,  57,  168, 120,
    93,  243, 147, 134, 79,  180, 183, 87,  123, 71,  204, 250, 232, 231, 213, 6,   123, 199, 97,  161,
    95,  107, 25,  195, 90,  253, 96,  255, 164, 234, 24,  131, 85,  96,  137, 178, 101, 226, 200, 204,
    149, 185, 39,  142, 47,  171, 64,  174, 66,  241, 34,  185, 141, 229, 62,  145, 199, 141, 172, 83,
    9,   51,  121, 206, 229, 165, 144, 184, 148, 215, 74,  222, 106, 249, 248, 2,   195, 243, 55,  129};

static void png_make_dynamic(png *p)
{
    p->width = 20;
    p->height = 16;
    p->depth = 8;
    p->type = 2;
    p->interlaced = 0;
    memcpy(p->stream, DYNAMIC, sizeof DYNAMIC);
    p->stream_size = sizeof DYNAMIC;
    png_assemble(p, 100);
}

static void png_codes(void)
{
    png *const p = &the_png;
    pt_image image = PT_IMAGE_INIT;
    unsigned char *const rgb = p->raw;
    int i, wrong = 0, size;
    png_make_dynamic(p);
    write_bytes("a.png", p->data, p->size);
    pt_check(pt_read_image(path_of("a.png"), &image) == PT_OK && image.width == 20 && image.height == 16,
             "PNG with codes of its own", "is refused");
    for (i = 0; i < 960 && image.rgb; i++) {
        const int x = i / 3 % 20, y = i / 60, v = i % 3 == 0 ? 6 * x : i % 3 == 1 ? 10 * y : x * y / 4;
        wrong += image.rgb[i] != (float)pt_srgb_decode(v / 255.0);
    }
    pt_check(wrong == 0, "PNG with codes of its own, pixels", "%d are wrong", wrong);
    for (size = 1; size <= 64; size *= 4) { /* what is written is read: flat parts, noise, long repetitions */
        for (i = 0; i < 3 * size * 64; i++)
            rgb[i] = (unsigned char)(i < 96 * size ? (int)(pt_hash64((uint64_t)i) & 255u)
                                     : i % 12 == 0 ? 200
                                                   : i / 3000);
        pt_check(pt_write_png_bytes(path_of("a.png"), rgb, size, 64) == PT_OK &&
                     pt_read_image(path_of("a.png"), &image) == PT_OK,
                 "PNG with fixed codes", "cannot be written and read");
        for (i = 0, wrong = 0; i < 3 * size * 64 && image.rgb; i++)
            wrong += image.rgb[i] != (float)pt_srgb_decode(rgb[i] / 255.0);
        pt_check(wrong == 0, label("PNG with fixed codes of %d x 64", size), "%d are wrong", wrong);
    }
    pt_image_free(&image);
    remove(path_of("a.png"));
}

/* No byte of a PNG is beyond a check: each changed, and each length cut, is refused. */
static void png_damage(void)
{
    png *const p = &the_png;
    pt_image image = PT_IMAGE_INIT;
    size_t i;
    int k, taken = 0;
    png_make_dynamic(p);
    pool_start(0);
    for (i = 0; i < p->size; i++)
        for (k = 0; k < 2; k++) {
            const unsigned char was = p->data[i];
            p->data[i] = (unsigned char)(was ^ (k ? 255u : 1u << i % 8));
            write_bytes("a.png", p->data, p->size);
            taken += pt_read_image(path_of("a.png"), &image) != PT_ERROR_FILE || image.rgb != NULL;
            p->data[i] = was;
        }
    pt_check(taken == 0, "a byte changed", "%d are not refused", taken);
    for (i = 0, taken = 0; i < p->size; i++) {
        write_bytes("a.png", p->data, i);
        taken += pt_read_image(path_of("a.png"), &image) != PT_ERROR_FILE || image.rgb != NULL;
    }
    pt_check(taken == 0, "a PNG that is cut", "%d are not refused", taken);
    pt_check(pool.largest < 200000, "damaged PNG, memory", "%lu bytes were asked for",
             (unsigned long)pool.largest);
    p->width = p->height = 65536; /* 12 GB, say 320 bytes */
    png_assemble(p, 1000);
    write_bytes("a.png", p->data, p->size);
    pt_check(pt_read_image(path_of("a.png"), &image) == PT_ERROR_FILE && pool.largest < 200000,
             "a PNG that promises much", "%lu bytes were asked for", (unsigned long)pool.largest);
    remove(path_of("a.png"));
}

/* Heads, chunks and streams that are wrong in one place, with right checksums. */
static void png_wrong(void)
{
    static const struct {
        const char *name;
        int depth, type, interlaced, width, accepted;
    } heads[9] = {
        {"as it is", 8, 2, 0, 13, 1},        {"depth 3", 3, 0, 0, 13, 0},     {"depth 0", 0, 2, 0, 13, 0},
        {"16-bit palette", 16, 3, 0, 13, 0}, {"4-bit RGB", 4, 2, 0, 13, 0},   {"type 1", 8, 1, 0, 13, 0},
        {"type 7", 8, 7, 0, 13, 0},          {"interlace 2", 8, 2, 2, 13, 0}, {"width 0", 8, 2, 0, 0, 0}};
    png *const p = &the_png;
    pt_image image = PT_IMAGE_INIT;
    int i;
    for (i = 0; i < 9; i++) {
        png_make(p, 13, 11, 8, 2, 0);
        p->depth = heads[i].depth;
        p->type = heads[i].type;
        p->interlaced = heads[i].interlaced;
        p->width = heads[i].width;
        png_assemble(p, 700);
        write_bytes("a.png", p->data, p->size);
        pt_check((pt_read_image(path_of("a.png"), &image) == PT_OK) == heads[i].accepted,
                 label("PNG with %s", heads[i].name), "is %s", heads[i].accepted ? "refused" : "taken");
    }
    for (i = 0; i < 11; i++) {
        png_make(p, 13, 11, i == 7 ? 2 : 8, i == 7 ? 3 : 2, 0);
        if (i == 0) p->raw[0] = 5; /* no such filter */
        if (i == 1) p->raw_size--;
        if (i == 2) p->raw[p->raw_size++] = 0;
        png_store(p, i == 3 ? 20000 : 300);
        if (i == 3) p->stream[0] = 0x79;
        if (i == 4) p->stream[1] = 0x21; /* a dictionary; still a multiple of 31 with 0x78? */
        if (i == 5) p->stream[2] = 7;    /* no such block */
        if (i == 6) p->stream[5] ^= 1;   /* length and complement */
        if (i == 7) p->colours = 2;      /* the file uses four */
        if (i == 8) p->stream_size -= 3;
        if (i == 9) p->stream[p->stream_size - 1] ^= 1; /* of the Adler-32 */
        if (i == 10) p->stream[20] ^= 1;                /* a byte of the picture */
        png_assemble(p, 700);
        write_bytes("a.png", p->data, p->size);
        pt_check(pt_read_image(path_of("a.png"), &image) == PT_ERROR_FILE && !image.rgb,
                 label("PNG stream %d", i), "is taken");
    }
    png_make(p, 13, 11, 8, 3, 0);
    memcpy(p->data + 37, "tRNX", 4); /* a chunk that says it may be skipped; then one that must not be */
    put32(p->data + 37 + 9, crc32_of(p->data + 37, 9));
    write_bytes("a.png", p->data, p->size);
    pt_check(pt_read_image(path_of("a.png"), &image) == PT_OK, "an unknown chunk", "is not skipped");
    memcpy(p->data + 37, "TRNX", 4);
    put32(p->data + 37 + 9, crc32_of(p->data + 37, 9));
    write_bytes("a.png", p->data, p->size);
    pt_check(pt_read_image(path_of("a.png"), &image) == PT_ERROR_FILE, "an unknown chunk that is needed",
             "is skipped");
    pt_image_free(&image);
    remove(path_of("a.png"));
}

/* A film of 2 x 2 pixels whose values are given; splats in one half. */
static pt_film small_film(void)
{
    static const double values[12] = {0, 0.25, 0.5, 1, 2, -1, 0.1, 0.2, 0.3, 0.003, 0.9, 1e-3};
    pt_film f = PT_FILM_INIT;
    int k;
    if (pt_film_make(&f, 2, 2, 0) != PT_OK) return f;
    f.samples[0] = 1;
    for (k = 0; k < 12; k++) f.half[0][k] = values[k];
    return f;
}

static void ppm_kinds(void)
{
    static const char *const heads[4] = {"P6\n2 2\n255\n", "P6\n2 2\n65535\n", "P3\n2 2\n255\n",
                                         "P3\n2 2\n65535\n"};
    pt_film f = small_film();
    pt_image image = PT_IMAGE_INIT;
    int kind, k;
    for (kind = 0; kind < 4; kind++) {
        const double most = kind % 2 ? 65535 : 255;
        size_t size, n = strlen(heads[kind]);
        unsigned char *data;
        char text[200] = "";
        int wrong = 0;
        pt_check(pt_write_ppm_as(path_of("a.ppm"), &f, 0.5, (pt_ppm_kind)kind) == PT_OK,
                 label("PPM kind %d", kind), "is not written");
        data = slurp(path_of("a.ppm"), &size);
        pt_check(data && size >= n && memcmp(data, heads[kind], n) == 0, label("PPM kind %d, head", kind),
                 "is another");
        for (k = 0; k < 12; k++) {
            const double v = 0.5 * f.half[0][k];
            const unsigned code = (unsigned)(most * pt_srgb_encode(v > 0 ? v < 1 ? v : 1 : 0) + 0.5);
            if (kind >= 2)
                sprintf(text + strlen(text), "%u%c", code, k % 3 == 2 ? '\n' : ' ');
            else if (kind == 1)
                wrong += size != n + 24 || data[n + 2 * (size_t)k] != code >> 8 ||
                         data[n + 2 * (size_t)k + 1] != (code & 255u);
            else
                wrong += size != n + 12 || data[n + (size_t)k] != code || code != pt_srgb_byte(v);
        }
        if (kind >= 2) wrong = size != n + strlen(text) || memcmp(data + n, text, strlen(text)) != 0;
        pt_check(!wrong, label("PPM kind %d, values", kind), "are others");
        pt_check(pt_read_image(path_of("a.ppm"), &image) == PT_OK && image.width == 2 && image.height == 2,
                 label("PPM kind %d, read", kind), "is refused");
        for (k = 0; k < 12 && image.rgb; k++) {
            const double v = 0.5 * f.half[0][k], clipped = v > 0 ? v < 1 ? v : 1 : 0;
            wrong += !(fabs(pt_srgb_encode((double)image.rgb[k]) - pt_srgb_encode(clipped)) <= 0.51 / most);
        }
        pt_check(!wrong, label("PPM kind %d, read values", kind), "%d are off by more than half a step",
                 wrong);
        free(data);
    }
    pt_check(pt_write_ppm_as(path_of("a.ppm"), &f, -1, PT_PPM_P6) == PT_ERROR_ARGUMENT &&
                 pt_write_ppm_as(path_of("a.ppm"), &f, (double)NAN, PT_PPM_P6) == PT_ERROR_ARGUMENT &&
                 pt_write_ppm_as(path_of("a.ppm"), &f, 1, (pt_ppm_kind)4) == PT_ERROR_ARGUMENT &&
                 pt_write_ppm_as("no/such/place", &f, 1, PT_PPM_P3) == PT_ERROR_FILE,
             "PPM that cannot be", "is written");
    pool_start(1);
    pt_check(pt_write_ppm_as(path_of("a.ppm"), &f, 1, PT_PPM_P3) == PT_ERROR_MEMORY, "PPM without memory",
             "is written");
    pool_start(0);
    pt_film_free(&f);
    pt_check(pt_write_ppm_as(path_of("a.ppm"), &f, 1, PT_PPM_P6) == PT_ERROR_ARGUMENT, "PPM of an empty film",
             "is written");
    pt_image_free(&image);
    remove(path_of("a.ppm"));
}

/* Text and large values: what each file's first value is, or -1: refused. */
static void ppm_heads(void)
{
    static const struct {
        const char *text;
        size_t size;
        double first;
    } files[] = {{"P3 1 1 255 255 0 0", 18, 1},
                 {"P3 1 1 255 255 0 0\n", 19, 1},
                 {"P3\n#x\n1 1 #y\n1\n1 # z 0\n0\n1", 27, 1},
                 {"P3 1 1 1000 500 1000 0", 22, 0.5},
                 {"P3 1 1 65535 65535 0 1", 22, 1},
                 {"P3 1 1 255 256 0 0", 18, -1},
                 {"P3 1 1 255 1 0", 14, -1},
                 {"P3 1 1 255 1 -1 0", 17, -1},
                 {"P3 1 1 255 1 x 0", 16, -1},
                 {"P3 1 1 65536 1 1 0", 18, -1},
                 {"P3 1 1 0 0 0 0", 14, -1},
                 {"P3 65536 65536 255 1 1 1", 24, -1},
                 {"P6 1 1 1 \1\0\1", 12, 1},
                 {"P6 1 1 1 \2\0\1", 12, -1},
                 {"P6 1 1 256 \1\0\0\1\0\0", 17, 1},
                 {"P6 1 1 256 \1\1\0\1\0\0", 17, -1},
                 {"P6 1 1 256 \1\0\0\1\0", 16, -1},
                 {"P6 1 1 255 \377\0\1", 14, 1},
                 {"P6 1 1 255 \377\0", 13, -1},
                 {"P5 1 1 255 abc", 14, -1},
                 {"P4 1 1 abc", 10, -1}};
    pt_image image = PT_IMAGE_INIT;
    size_t i;
    for (i = 0; i < sizeof files / sizeof files[0]; i++) {
        pt_result r;
        write_bytes("a.ppm", files[i].text, files[i].size);
        r = pt_read_image(path_of("a.ppm"), &image);
        pt_check((r == PT_OK) == (files[i].first >= 0) &&
                     (r == PT_OK ? image.rgb[0] == (float)pt_srgb_decode(files[i].first)
                                 : r == PT_ERROR_FILE && !image.rgb),
                 files[i].text, "%s, %g", pt_result_string(r), image.rgb ? (double)image.rgb[0] : -1);
    }
    pt_image_free(&image);
    remove(path_of("a.ppm"));
}

/* ---- films ------------------------------------------------------------------------------------------ */

static int same_doubles(const double *a, const double *b, size_t n)
{
    return (a == NULL) == (b == NULL) && (!a || memcmp(a, b, n * sizeof *a) == 0);
}

/* The same bits in all that a film has? */
static int same_film(const pt_film *a, const pt_film *b)
{
    const size_t n = (size_t)a->width * (size_t)a->height;
    int h, same = a->width == b->width && a->height == b->height && a->class_count == b->class_count &&
                  a->range_count == b->range_count && a->fingerprint == b->fingerprint &&
                  a->nonfinite == b->nonfinite;
    for (h = 0; h < 2; h++)
        same = same && a->samples[h] == b->samples[h] && same_doubles(a->half[h], b->half[h], 3 * n) &&
               same_doubles(a->splat[h], b->splat[h], 3 * n);
    same = same && same_doubles(a->albedo, b->albedo, 3 * n) && same_doubles(a->normal, b->normal, 3 * n) &&
           same_doubles(a->depth, b->depth, n) &&
           same_doubles(a->classes, b->classes, 3 * n * (size_t)a->class_count);
    return same &&
           (a->range_count == 0 || memcmp(a->ranges, b->ranges, a->range_count * sizeof *a->ranges) == 0);
}

typedef struct picture {
    pt_scene scene;
    pt_lpe lpe;
    pt_render_desc desc;
} picture;

static int picture_make(picture *p, int width, int height, uint32_t spp, int everything)
{
    static const char *const classes[2] = {"LDE", "LD+E"};
    pt_camera camera;
    memset(p, 0, sizeof *p);
    p->desc = pt_render_defaults();
    if (pt_scene_cornell(&p->scene, &camera) != PT_OK) return 0;
    p->desc.camera = camera;
    p->desc.width = width;
    p->desc.height = height;
    p->desc.spp = spp;
    p->desc.threads = 1;
    p->desc.aov = everything;
    if (!everything) return 1;
    p->desc.li.lpe = &p->lpe;
    return pt_lpe_compile(&p->lpe, classes, 2, NULL) == PT_OK;
}

static void film_round_trips(void)
{
    int k;
    for (k = 0; k < 6; k++) { /* plain; all layers; splats; two ranges; class; no samples */
        picture p;
        pt_film f = PT_FILM_INIT, g = PT_FILM_INIT, h = PT_FILM_INIT;
        pt_splat_list list = PT_SPLAT_LIST_INIT;
        pt_result r = PT_OK;
        if (!picture_make(&p, k == 1 ? 33 : 7, k == 1 ? 21 : 5, 3, k > 0)) return;
        if (k < 5)
            r = pt_render(&p.scene, &p.desc, &f, NULL);
        else
            r = pt_film_make(&f, 3, 2, 1);
        if (k == 2) r = pt_splat_add(&list, 3, 1, grey(0.125));
        if (k == 2 && r == PT_OK) r = pt_film_add_splats(&f, &list);
        p.desc.first_sample = 10;
        if (k == 3) r = pt_render(&p.scene, &p.desc, &g, NULL);
        if (k == 3 && r == PT_OK) r = pt_film_merge(&f, &g);
        if (k == 4) r = pt_film_class(&f, 1, &g);
        f.nonfinite = 5 + (uint64_t)k;
        pt_check(r == PT_OK && pt_film_write(path_of("a.film"), k == 4 ? &g : &f) == PT_OK,
                 label("film %d", k), "%s", pt_result_string(r));
        h.alloc_user = &p;
        pt_check(pt_film_read(path_of("a.film"), &h) == PT_OK && same_film(k == 4 ? &g : &f, &h) &&
                     h.alloc_user == &p,
                 label("film %d, read", k), "is another");
        pt_check(pt_film_read(path_of("a.film"), &h) == PT_OK &&
                     pt_film_write(path_of("b.film"), &h) == PT_OK,
                 label("film %d, read twice and written", k), "fails");
        {
            size_t size[2];
            unsigned char *const a = slurp(path_of("a.film"), &size[0]), *const b = slurp(path_of("b.film"),
                                                                                          &size[1]);
            pt_check(a && b && size[0] == size[1] && memcmp(a, b, size[0]) == 0, label("film %d, files", k),
                     "differ");
            pt_check(a && crc64_of(a, size[0] - 8) == pti_get_little(a + size[0] - 8, 8),
                     label("film %d, CRC", k), "is wrong");
            free(a);
            free(b);
        }
        pt_splat_list_free(&list);
        pt_film_free(&f);
        pt_film_free(&g);
        pt_film_free(&h);
        pt_scene_free(&p.scene);
    }
    remove(path_of("a.film"));
    remove(path_of("b.film"));
}

/* Interrupted, written, read and resumed: the bits of a render that was never interrupted. */
static void film_resumes(void)
{
    picture p;
    pt_film whole = PT_FILM_INIT, part = PT_FILM_INIT;
    uint32_t spp;
    if (!picture_make(&p, 16, 16, 16, 1)) return;
    pt_check(pt_render(&p.scene, &p.desc, &whole, NULL) == PT_OK, "an undisturbed render", "fails");
    for (spp = 1; spp <= 16; spp += 5) {
        p.desc.spp = spp;
        pt_check(pt_render(&p.scene, &p.desc, &part, NULL) == PT_OK &&
                     pt_film_write(path_of("a.film"), &part) == PT_OK,
                 label("until %u samples", (unsigned)spp), "fails");
        pt_film_free(&part);
        pt_check(pt_film_read(path_of("a.film"), &part) == PT_OK && pt_film_spp(&part) == spp,
                 label("read at %u samples", (unsigned)spp), "fails");
    }
    pt_check(same_film(&whole, &part), "resumed three times from files", "other bits");
    p.desc.seed = 1;
    p.desc.spp = 17;
    pt_check(pt_render(&p.scene, &p.desc, &part, NULL) == PT_ERROR_MISMATCH, "a film of another render",
             "is continued");
    pt_film_free(&whole);
    pt_film_free(&part);
    pt_scene_free(&p.scene);
    remove(path_of("a.film"));
}

/* A film file with every layer, small enough to try each byte. */
static unsigned char *film_bytes(size_t *size)
{
    picture p;
    pt_film f = PT_FILM_INIT;
    unsigned char *data = NULL;
    *size = 0;
    if (picture_make(&p, 2, 1, 3, 1) && pt_render(&p.scene, &p.desc, &f, NULL) == PT_OK &&
        pti_film_need_splat(&f, 0) && pt_film_write(path_of("a.film"), &f) == PT_OK)
        data = slurp(path_of("a.film"), size);
    remove(path_of("a.film"));
    pt_film_free(&f);
    pt_scene_free(&p.scene);
    pt_check(data != NULL, "a film file", "cannot be made");
    return data;
}

static void film_damage(void)
{
    size_t size, i;
    unsigned char *const data = film_bytes(&size);
    pt_film f = PT_FILM_INIT;
    int bit, taken = 0;
    for (i = 0; data && i < size; i++)
        for (bit = 0; bit < 9; bit++) {
            const unsigned char was = data[i];
            data[i] = (unsigned char)(bit < 8 ? was ^ 1u << bit : 255u - was);
            write_bytes("a.film", data, size);
            taken += pt_film_read(path_of("a.film"), &f) != PT_ERROR_FILE || f.half[0] || f.width;
            data[i] = was;
        }
    pt_check(taken == 0, "a byte of a film changed", "%d are not refused", taken);
    for (i = 0, taken = 0; data && i < size; i++) {
        write_bytes("a.film", data, i);
        taken += pt_film_read(path_of("a.film"), &f) != PT_ERROR_FILE || f.half[0];
    }
    pt_check(taken == 0, "a film that is cut", "%d are not refused", taken);
    for (i = 0, taken = 0; data && i < size; i++) { /* the file of another render from byte i on */
        const unsigned char was = data[size - 1 - i];
        memmove(data + size - 1 - i, data + size - i, i);
        write_bytes("a.film", data, size - 1);
        taken += pt_film_read(path_of("a.film"), &f) != PT_ERROR_FILE;
        memmove(data + size - i, data + size - 1 - i, i);
        data[size - 1 - i] = was;
    }
    pt_check(taken == 0, "a byte of a film lost", "%d are not refused", taken);
    remove(path_of("a.film"));
    pt_check(pt_film_read(path_of("a.film"), &f) == PT_ERROR_FILE &&
                 pt_film_read(NULL, &f) == PT_ERROR_FILE && pt_film_read("tests", &f) == PT_ERROR_FILE,
             "no film", "is read");
    free(data);
}

/* Fields of the head changed, with the right checksum. */
static void film_heads(void)
{
    static const struct {
        int at, bytes;
        uint64_t value;
        pt_result result;
    } fields[] = {{8, 4, 2, PT_ERROR_MISMATCH},
                  {8, 4, 0, PT_ERROR_MISMATCH},
                  {0, 1, 'P', PT_ERROR_FILE},
                  {12, 4, 99, PT_OK},
                  {16, 4, 99, PT_OK},
                  {20, 4, 0, PT_ERROR_FILE},
                  {20, 4, 0xf6, PT_ERROR_FILE},
                  {20, 4, 0xe7, PT_ERROR_FILE},
                  {20, 4, 0x77, PT_ERROR_FILE},
                  {20, 4, 0x1f7, PT_ERROR_FILE},
                  {20, 4, 0xfb, PT_OK},
                  {24, 4, 1, PT_ERROR_FILE},
                  {24, 4, 0, PT_ERROR_FILE},
                  {24, 4, 0xffffffff, PT_ERROR_FILE},
                  {24, 4, 65537, PT_ERROR_FILE},
                  {28, 4, 65536, PT_ERROR_FILE},
                  {28, 4, 0x80000000, PT_ERROR_FILE},
                  {32, 4, 0, PT_ERROR_FILE},
                  {32, 4, 1024, PT_ERROR_FILE},
                  {32, 4, 0xffffffff, PT_ERROR_FILE},
                  {36, 4, 0, PT_ERROR_FILE},
                  {36, 4, 2, PT_ERROR_FILE},
                  {36, 4, 0xffffffff, PT_ERROR_FILE},
                  {40, 4, 3, PT_ERROR_FILE},
                  {44, 4, 0xffffffff, PT_ERROR_FILE},
                  {48, 8, 77, PT_OK},
                  {56, 8, 77, PT_OK},
                  {64, 4, 3, PT_ERROR_FILE},
                  {64, 4, 1, PT_ERROR_FILE},
                  {68, 4, 4, PT_ERROR_FILE},
                  {68, 4, 0, PT_ERROR_FILE}};
    size_t size, i;
    unsigned char *const data = film_bytes(&size), *const copy = data ? (unsigned char *)malloc(size) : NULL;
    pt_film f = PT_FILM_INIT;
    for (i = 0; copy && i < sizeof fields / sizeof fields[0]; i++) {
        pt_result r;
        memcpy(copy, data, size);
        pti_put_little(copy + fields[i].at, fields[i].value, fields[i].bytes);
        pti_put_little(copy + size - 8, crc64_of(copy, size - 8), 8);
        write_bytes("a.film", copy, size);
        pool_start(0);
        r = pt_film_read(path_of("a.film"), &f);
        pt_check(r == fields[i].result && (r == PT_OK) == (f.half[0] != NULL),
                 label("byte %d of a film is %llx", fields[i].at, (unsigned long long)fields[i].value), "%s",
                 pt_result_string(r));
        pt_check(pool.largest <= 4096, "memory for it", "%lu bytes were asked for",
                 (unsigned long)pool.largest);
        if (fields[i].at == 48) pt_check(f.fingerprint == 77, "fingerprint", "is lost");
        if (fields[i].at == 56) pt_check(f.nonfinite == 77, "count of what was not finite", "is lost");
        if (fields[i].at == 20 && r == PT_OK)
            pt_check(f.splat[0] == NULL && f.splat[1] != NULL, "splats of the other half", "are lost");
    }
    pt_film_free(&f);
    free(data);
    free(copy);
    remove(path_of("a.film"));
}

/* Films that are none are not written. */
static void film_arguments(void)
{
    pt_film f = PT_FILM_INIT;
    pt_check(pt_film_write(path_of("a.film"), &f) == PT_ERROR_ARGUMENT, "an empty film", "is written");
    pt_check(pt_film_make(&f, 2, 2, 0) == PT_OK && pt_film_add_range(&f, 0, 4) == PT_OK, "a film",
             "is not made");
    f.samples[0] = 2;
    pt_check(pt_film_write(path_of("a.film"), &f) == PT_ERROR_ARGUMENT,
             "a film with two samples in a range of four", "is written");
    f.samples[1] = 2;
    pt_check(pt_film_write(path_of("a.film"), &f) == PT_OK &&
                 pt_film_write("no/such/place", &f) == PT_ERROR_FILE &&
                 pt_film_write(NULL, &f) == PT_ERROR_FILE,
             "a film with four", "is not written");
    f.class_count = 1025;
    pt_check(pt_film_write(path_of("a.film"), &f) == PT_ERROR_ARGUMENT, "a film without its classes",
             "is written");
    f.class_count = 0;
    pt_film_free(&f);
    remove(path_of("a.film"));
}

/* ---- a full disk ------------------------------------------------------------------------------------ */

/* /dev/full takes no byte; what stands under the name stays, and no .part is left. */
static void full_disk(void)
{
#ifdef PTI_HAS_FSYNC
    static const unsigned char rgb[3] = {1, 2, 3};
    static const float pixel[3] = {1, 2, 3};
    pt_film f = small_film();
    pt_report report = PT_REPORT_INIT;
    const pt_report *const reports[1] = {&report};
    char path[200], part[200];
    int k;
    strcpy(path, path_of("kept"));
    strcpy(part, path_of("kept.part"));
    if (!is_there("/dev/full")) printf("skip   there is no /dev/full here\n");
    for (k = 0; k < 10 && is_there("/dev/full"); k++) {
        pt_result r = PT_OK;
        size_t size;
        unsigned char *data;
        write_text("kept", "what was there");
        if (symlink("/dev/full", part) != 0) break;
        if (k < 4) r = pt_write_ppm_as(path, &f, 1, (pt_ppm_kind)k);
        if (k == 4) r = pt_write_ppm_bytes(path, rgb, 1, 1);
        if (k == 5) r = pt_write_pfm_floats(path, pixel, 1, 1);
        if (k == 6) r = pt_write_png_bytes(path, rgb, 1, 1);
        if (k == 7) r = pt_film_write(path, &f);
        if (k == 8) r = pt_report_write_csv(&report, path);
        if (k == 9) r = pt_report_write_svg(reports, NULL, 1, NULL, path);
        data = slurp(path, &size);
        pt_check(r == PT_ERROR_FILE && data && size == 14 && memcmp(data, "what was there", 14) == 0 &&
                     !is_there(part),
                 label("writer %d on a full disk", k), "%s", pt_result_string(r));
        free(data);
    }
    remove(path);
    mkdir(path, 0777); /* a name that cannot be taken */
    pt_check(pt_film_write(path, &f) == PT_ERROR_FILE && !is_there(part), "a directory under the name",
             "is replaced, or something is left");
    rmdir(path);
    pt_film_free(&f);
#endif
}

/* ---- no memory -------------------------------------------------------------------------------------- */

/* A model with all that asks for memory, in a scene that has something. */
static pt_result load_all(pt_scene *s)
{
    pt_obj_info info;
    return pt_load_obj(s, path_of("model.obj"), NULL, &info);
}

static void failing_memory(void)
{
    static char text[8000];
    static const unsigned char rgb[12] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
    size_t n = (size_t)sprintf(text, "mtllib of_files.fail.mtl\n");
    long k, before;
    int i, kind;
    size_t size;
    unsigned char *const film = film_bytes(&size);
    pt_scene s = PT_SCENE_INIT;
    write_text("fail.mtl",
               "newmtl a\nmap_Kd of_files.fail.png\nnewmtl b\nKe 1\nnewmtl c\nmap_Kd of_files.fail.png\n");
    pt_check(pt_write_png_bytes(path_of("fail.png"), rgb, 2, 2) == PT_OK, "a picture", "cannot be written");
    for (i = 0; i < 60; i++) n += (size_t)sprintf(text + n, "v %d %d 0\nvt %d 0\nvn 0 0 1\n", i, i * i, i);
    for (i = 0; i < 10; i++)
        n += (size_t)sprintf(text + n,
                             "usemtl %c\nf 1/1/1 2/2/2 %d/3/3\nf 3 4 %d\nf 5 6 7 8 9 10 11 12 13 %d\n",
                             "abcd"[i % 4], 7 * i % 50 + 3, i + 5, i + 14);
    write_text("model.obj", text);
    pt_add_sphere(&s, v3(0, 0, 0), 1, pt_add_material(&s, pt_material_emitter(grey(1))));
    pt_commit(&s);
    before = pool.live;
    for (k = 1; k < 1000; k++) {
        pt_result r;
        pool_start(k);
        r = load_all(&s);
        pool_start(0);
        if (r == PT_OK) break;
        pt_check(r == PT_ERROR_MEMORY && s.error == PT_OK && s.material_count == 1 && s.triangle_count == 0 &&
                     s.position_count == 0 && s.mesh_count == 0 && s.owned_count == 0 && s.committed,
                 label("a model without request %ld", k), "%s, or the scene has changed",
                 pt_result_string(r));
    }
    pt_check(k > 40 && s.triangle_count > 50 && s.material_count == 5 && pt_commit(&s) == PT_OK,
             "a model with all requests", "%ld requests, %u triangles", k, (unsigned)s.triangle_count);
    pt_scene_free(&s);
    pt_check(pool.live <= before && pool.live == 0, "models without memory, leaks", "%ld blocks", pool.live);
    for (kind = 0; kind < 3; kind++) { /* pictures and a film */
        write_bytes("a.film", film, size);
        write_text("a.ppm", "P3 1 1 255 1 2 3");
        for (k = 1; k < 100; k++) {
            pt_image image = PT_IMAGE_INIT;
            pt_film f = PT_FILM_INIT;
            pt_result r;
            pool_start(k);
            r = kind == 2 ? pt_film_read(path_of("a.film"), &f)
                          : pt_read_image(path_of(kind ? "fail.png" : "a.ppm"), &image);
            pool_start(0);
            pt_check(r == PT_OK || (r == PT_ERROR_MEMORY && !image.rgb && !f.half[0]),
                     label("file %d without request %ld", kind, k), "%s", pt_result_string(r));
            pt_image_free(&image);
            pt_film_free(&f);
            if (r == PT_OK) break;
        }
        pt_check(k > 2 && k < 100 && pool.live == 0, label("file %d without memory, leaks", kind),
                 "%ld blocks after %ld requests", pool.live, k);
    }
    free(film);
    remove(path_of("fail.mtl"));
    remove(path_of("fail.png"));
    remove(path_of("a.film"));
    remove(path_of("a.ppm"));
}

/* ---- mutants of files ------------------------------------------------------------------------------- */

static uint64_t fuzz_state;

static uint32_t below(uint32_t n)
{
    fuzz_state = pt_hash64(fuzz_state + 0x9e3779b97f4a7c15u);
    return (uint32_t)((fuzz_state >> 32) % n);
}

#define FUZZ_MOST 16384
static struct {
    unsigned char data[FUZZ_MOST];
    size_t size;
} mutant;

static void mutant_start(const void *data, size_t size)
{
    memcpy(mutant.data, data, size);
    mutant.size = size;
}

static void mutant_insert(size_t at, const void *data, size_t size)
{
    if (mutant.size + size > FUZZ_MOST) return;
    memmove(mutant.data + at + size, mutant.data + at, mutant.size - at);
    memcpy(mutant.data + at, data, size);
    mutant.size += size;
}

static void mutant_delete(size_t at, size_t size)
{
    if (at > mutant.size) return;
    if (size > mutant.size - at) size = mutant.size - at;
    memmove(mutant.data + at, mutant.data + at + size, mutant.size - at - size);
    mutant.size -= size;
}

/* Where a line, or a word, that holds byte `at` begins, and how long it is with what ends it. */
static size_t mutant_part(size_t at, int words, size_t *size)
{
    const char *const ends = words ? " \n/\t" : "\n";
    size_t begin = at, end = at;
    while (begin > 0 && !memchr(ends, mutant.data[begin - 1], strlen(ends))) begin--;
    while (end < mutant.size && !memchr(ends, mutant.data[end], strlen(ends))) end++;
    *size = end - begin + (!words && end < mutant.size);
    return begin;
}

/* One change of a text: a byte, a word for another of the list, or a line. */
static void mutate_text(const char *const *words, uint32_t count)
{
    const size_t at = below((uint32_t)mutant.size);
    const char *const word = words[below(count)];
    unsigned char line[512];
    size_t size, begin;
    switch (below(9)) {
    case 0:
        mutant.data[at] = (unsigned char)below(256);
        break;
    case 1:
        mutant.size = at + 1;
        break;
    case 2:
        mutant_delete(at, below(8));
        break;
    case 3:
        mutant_insert(at, word, strlen(word));
        break;
    case 4:
        begin = mutant_part(at, 0, &size);
        mutant_delete(begin, size);
        break;
    case 5: /* a line once more, elsewhere */
        begin = mutant_part(at, 0, &size);
        if (size > sizeof line) size = sizeof line;
        memcpy(line, mutant.data + begin, size);
        begin = mutant_part(below((uint32_t)mutant.size), 0, &begin);
        mutant_insert(begin, line, size);
        break;
    default:
        begin = mutant_part(at, 1, &size);
        mutant_delete(begin, size);
        mutant_insert(begin, word, strlen(word));
    }
    if (mutant.size == 0) mutant_insert(0, "\n", 1);
}

/* One change of bytes. */
static void mutate_bytes(void)
{
    static const unsigned char extremes[6] = {0, 1, 127, 128, 254, 255};
    const size_t at = below((uint32_t)mutant.size);
    switch (below(6)) {
    case 0:
        mutant.data[at] = (unsigned char)(mutant.data[at] ^ 1u << below(8));
        break;
    case 1:
        mutant.data[at] = extremes[below(6)];
        break;
    case 2:
        mutant.data[at] = (unsigned char)below(256);
        break;
    case 3:
        mutant.size = at + 1;
        break;
    case 4:
        mutant_delete(at, 1 + below(4));
        break;
    default:
        mutant_insert(at, mutant.data + below((uint32_t)(mutant.size - at)), 1);
    }
    if (mutant.size == 0) mutant_insert(0, "\n", 1);
}

/* What came of the mutants of a format. A list of all that are wrong would be long: the first is told. */
typedef struct tally {
    const char *name;
    int taken, refused, wrong, first;
    size_t greed; /* bytes asked for beyond what the size of the file bears out */
} tally;

static void tally_add(tally *t, int i, int taken, int ok)
{
    *(taken ? &t->taken : &t->refused) += 1;
    if (!ok && t->wrong++ == 0) t->first = i;
}

static void tally_end(const tally *t, int least)
{
    pt_check(t->wrong == 0, label("mutants of %s", t->name), "%d of %d break a promise, the first is %d",
             t->wrong, t->taken + t->refused, t->first);
    pt_check(t->greed == 0, label("mutants of %s, memory", t->name), "%lu bytes were asked for",
             (unsigned long)t->greed);
    pt_check(pt_test.is_short || (t->taken >= least && t->refused >= least),
             label("mutants of %s are of both kinds", t->name), "%d taken, %d refused", t->taken, t->refused);
    pt_check(pool.live == 0, label("mutants of %s, leaks", t->name), "%ld blocks", pool.live);
    printf("note   mutants of %-4s: %d taken, %d refused\n", t->name, t->taken, t->refused);
}

static int fuzz_count(int n) { return pt_test.is_short ? n / 16 : n; }

static const char *const OBJ_WORDS[] = {"0",
                                        "1",
                                        "-1",
                                        "2",
                                        "-9",
                                        "8",
                                        "99999999999",
                                        "-99999999999",
                                        "4294967297",
                                        "1e999",
                                        "-1e38",
                                        "1e-320",
                                        "nan",
                                        "0.1",
                                        "1e17",
                                        "/",
                                        "//",
                                        "1//1",
                                        "1/1/1",
                                        "-1/-1/-1",
                                        "3/",
                                        "\\\n",
                                        "#",
                                        "\r",
                                        "\n",
                                        "\nv ",
                                        "\nvn 0 0 0\n",
                                        "vt",
                                        "\nf ",
                                        "usemtl",
                                        "mtllib of_files.fuzz.mtl",
                                        "mtllib",
                                        "s",
                                        "o",
                                        "a",
                                        "b",
                                        "\xff",
                                        "f 1 2 3 4 5 6 7 8",
                                        "f -1 -2 -3 -4 -5"};
static const char OBJ_SEED[] =
    "# a model\nmtllib of_files.fuzz.mtl\no x\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0\nv 0.25 0.25 "
    "0.125\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1 0\nvn 0 0 1\nvn 1e-3 -2.5e2 0.5\ng a b\nusemtl a\n"
    "f 1/1/1 2/2/1 3/3/2 4/4/1\ns 1\nusemtl b\nf 1//1 2//2 5//1\nv 5 0 0\nv 5 5 0\\\n\nv 0 5 0\nf -1 -2 -3 5 "
    "4\nusemtl c\nf 1 2 3 4 5 6 7\nl 1 2\r\nf 1/1 2/2 3/3\n";
static const char *const MTL_WORDS[] = {"newmtl",
                                        "newmtl a\n",
                                        "Kd",
                                        "Ks",
                                        "Ke",
                                        "Ni",
                                        "Ns",
                                        "d",
                                        "Tr",
                                        "illum",
                                        "Pr",
                                        "Pm",
                                        "map_Kd",
                                        "map_Kd of_files.fuzz.png\n",
                                        "-s",
                                        "-o",
                                        "-clamp on",
                                        "-mm",
                                        "-1",
                                        "0",
                                        "2",
                                        "7",
                                        "3",
                                        "0.5",
                                        "1e99",
                                        "-1e99",
                                        "nan",
                                        "\\\n",
                                        "\n",
                                        "#",
                                        "a",
                                        "b",
                                        "of_files.fuzz.png",
                                        "/",
                                        "\\",
                                        "\xff",
                                        "1 1 1"};
static const char MTL_SEED[] =
    "# materials\nnewmtl a\nKd 0.5 0.25 1\nKs 0.25 0.25 0.25\nNs 30\nillum 2\nmap_Kd -s 2 2 "
    "of_files.fuzz.png\nnewmtl b\nKa 0 0 0\nKe 3 2 1\nd 0.25\nTr 0.5\nNi 1.5\r\nTf 1 1 1\n"
    "newmtl c\nKd 0.5\nPr 0.25\nPm 1\nmap_Kd of_files.fuzz.png\nillum 5\n";

/* A scene from a mutant is sound: indices in range, and it can be committed and hit. */
static int scene_is_sound(pt_scene *s)
{
    pt_hit hit;
    uint32_t i;
    int k;
    for (i = 0; i < s->triangle_count; i++) {
        const pt_triangle *const t = &s->triangles[i];
        const pt_mesh *const m = &s->meshes[t->mesh];
        if (t->mesh < 0 || (uint32_t)t->mesh >= s->mesh_count || t->material < 0 ||
            (uint32_t)t->material >= s->material_count)
            return 0;
        for (k = 0; k < 3; k++)
            if (t->v[k] >= s->position_count ||
                (m->has_normals && t->v[k] + m->normal_offset >= s->normal_count) ||
                (m->has_uvs && t->v[k] + m->uv_offset >= s->uv_count))
                return 0;
    }
    if (pt_commit(s) != PT_OK || s->degenerate_count != 0) return 0;
    for (k = 0; k < 4; k++)
        if (look(s, 0.1 + 0.3 * k, 0.15, &hit) && !pti_finite((double)hit.ns.x)) return 0;
    return 1;
}

/* Loads model.obj; `size` bytes are read in all. */
static void fuzz_load(tally *t, int i, size_t size)
{
    pt_scene s = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result r;
    pool_start(0);
    r = pt_load_obj(&s, path_of("model.obj"), NULL, &info);
    if (pool.largest > 200000 + 64 * size)
        t->greed = pool.largest; /* what a picture needs to be inflated is in it */
    if (r == PT_OK)
        tally_add(t, i, 1,
                  info.triangles == s.triangle_count && info.triangles > 0 && info.error[0] == 0 &&
                      scene_is_sound(&s));
    else
        tally_add(t, i, 0,
                  r == PT_ERROR_FILE && info.error[0] && s.error == PT_OK && s.material_count == 0 &&
                      s.triangle_count == 0 && s.owned_count == 0);
    pt_scene_free(&s);
}

static void fuzz_models(void)
{
    static const unsigned char rgb[3] = {9, 99, 199};
    tally obj = {"OBJ", 0, 0, 0, 0, 0}, mtl = {"MTL", 0, 0, 0, 0, 0};
    int i;
    uint32_t k;
    fuzz_state = 1;
    pt_check(pt_write_png_bytes(path_of("fuzz.png"), rgb, 1, 1) == PT_OK, "a picture", "cannot be written");
    write_text("fuzz.mtl", MTL_SEED);
    for (i = 0; i < fuzz_count(2000); i++) {
        mutant_start(OBJ_SEED, sizeof OBJ_SEED - 1);
        for (k = 1 + below(4); k > 0; k--) mutate_text(OBJ_WORDS, sizeof OBJ_WORDS / sizeof OBJ_WORDS[0]);
        write_bytes("model.obj", mutant.data, mutant.size);
        fuzz_load(&obj, i, mutant.size + sizeof MTL_SEED);
    }
    tally_end(&obj, 100);
    write_text("model.obj", OBJ_SEED);
    for (i = 0; i < fuzz_count(2000); i++) {
        mutant_start(MTL_SEED, sizeof MTL_SEED - 1);
        for (k = 1 + below(6); k > 0; k--) mutate_text(MTL_WORDS, sizeof MTL_WORDS / sizeof MTL_WORDS[0]);
        write_bytes("fuzz.mtl", mutant.data, mutant.size);
        fuzz_load(&mtl, i, mutant.size + sizeof OBJ_SEED);
    }
    mtl.refused += 100; /* whatever an MTL file says, the model is loaded */
    tally_end(&mtl, 100);
    pt_check(mtl.refused == 100, "mutants of MTL", "%d models are refused", mtl.refused - 100);
    remove(path_of("fuzz.png"));
    remove(path_of("fuzz.mtl"));
}

/* Reads the mutant as a picture. */
static void fuzz_picture(tally *t, int i)
{
    pt_image image = PT_IMAGE_INIT;
    size_t k, bad = 0;
    pt_result r;
    write_bytes("fuzz.picture", mutant.data, mutant.size);
    pool_start(0);
    r = pt_read_image(path_of("fuzz.picture"), &image);
    if (r == PT_OK) {
        for (k = 0; k < 3 * (size_t)image.width * (size_t)image.height; k++)
            bad += image.rgb[k] == 12345; /* each can be read */
        tally_add(t, i, 1, bad == 0 && image.width > 0 && image.height > 0);
    } else {
        tally_add(t, i, 0, r == PT_ERROR_FILE && !image.rgb && image.width == 0);
        if (pool.largest > 150000 + 1100 * mutant.size) t->greed = pool.largest;
    }
    pt_image_free(&image);
}

static const char *const PICTURE_WORDS[] = {
    "0",   "1",   "2",   "3",  "255", "256", "65535", "65536", "65537", "-1", "99999999999", "1e9",  "-1.0",
    "1.0", "0.0", "nan", "P3", "P5",  "P6",  "PF",    "Pf",    "#",     "\n", " ",           "\377", "# x\n"};

static void fuzz_pictures(void)
{
    static const struct {
        const char *text;
        size_t head; /* of which most mutants change something */
    } seeds[6] = {{"P6\n3 2\n255\n", 11},  {"P6 # x\n3 1\n65535\n", 17}, {"P3\n2 1\n255\n1 2 3\n4 5 6\n", 23},
                  {"PF\n2 1\n-1.0\n", 12}, {"PF\n1 2\n1.0\n", 11},       {"PF 2 1 -0.5e3\n", 14}};
    tally t[2] = {{"PPM", 0, 0, 0, 0, 0}, {"PFM", 0, 0, 0, 0, 0}};
    int format, i;
    uint32_t k;
    fuzz_state = 2;
    for (format = 0; format < 2; format++) {
        for (i = 0; i < fuzz_count(1500); i++) {
            const int seed = 3 * format + (int)below(3);
            unsigned char data[24];
            for (k = 0; k < 24; k++) data[k] = (unsigned char)below(256);
            mutant_start(seeds[seed].text, seeds[seed].head);
            if (below(4) > 0) mutate_text(PICTURE_WORDS, sizeof PICTURE_WORDS / sizeof PICTURE_WORDS[0]);
            if (seed != 2) mutant_insert(mutant.size, data, format ? 24 : 18);
            for (k = below(3); k > 0; k--) mutate_bytes();
            fuzz_picture(&t[format], i);
        }
        tally_end(&t[format], 100);
    }
    remove(path_of("fuzz.picture"));
}

/* The IDAT of a PNG of one piece whose stream the mutant is. */
static void png_around_mutant(png *p)
{
    memcpy(p->stream, mutant.data, mutant.size);
    p->stream_size = mutant.size;
    png_assemble(p, 20000);
}

/* Four ways to spoil a PNG: its bytes; a chunk, with the right checksum; the deflate stream; the rows, well compressed. */
static void fuzz_png(void)
{
    tally t = {"PNG", 0, 0, 0, 0, 0};
    png *const p = &the_png;
    uint32_t k;
    int i;
    fuzz_state = 3;
    for (i = 0; i < fuzz_count(3000); i++) {
        const int way = (int)below(4);
        const uint32_t type = below(7) == 1 ? 1 : (uint32_t) "\0\2\3\4\6\0\2"[below(7)],
                       depth = below(4) ? 8 : 1u << below(5);
        if (way == 2 || below(3) == 0)
            png_make_dynamic(p);
        else
            png_make(p, 1 + (int)below(20), 1 + (int)below(9),
                     type == 0 || type == 3 ? (int)(depth > 8 && type == 3 ? 8 : depth)
                     : depth == 16          ? 16
                                            : 8,
                     (int)type, (int)below(2));
        if (way == 3 && p->raw_size > 0) {
            for (k = 1 + below(3); k > 0; k--)
                p->raw[below((uint32_t)p->raw_size)] = (unsigned char)below(256);
            p->raw_size -= below(8) == 0;
            png_store(p, 1 + below(2000));
            png_assemble(p, 700);
        } else if (way >= 2) {
            mutant_start(p->stream, p->stream_size);
            for (k = below(3); k > 0; k--) mutate_bytes();
            if (below(2)) mutant.data[2 + below(60)] = (unsigned char)below(256); /* where the codes are */
            png_around_mutant(p);
        }
        mutant_start(p->data, p->size);
        if (way == 0)
            for (k = below(4); k > 0; k--) mutate_bytes();
        if (way == 1) { /* the k-th chunk */
            size_t at = 8;
            for (k = below(5); k > 0 && at + 12 < mutant.size; k--)
                at += 12 + (size_t)pti_from_big_endian(mutant.data + at);
            if (at + 12 < mutant.size) {
                const size_t size = pti_from_big_endian(mutant.data + at);
                mutant.data[at + 4 + below((uint32_t)size + 4)] = (unsigned char)below(below(2) ? 9 : 256);
                put32(mutant.data + at + 8 + size, crc32_of(mutant.data + at + 4, size + 4));
            }
        }
        fuzz_picture(&t, i);
    }
    tally_end(&t, 100);
    remove(path_of("fuzz.picture"));
}

static void fuzz_films(void)
{
    static const uint64_t extremes[10] = {0, 1, 2, 3, 4, 255, 65536, 0x7fffffff, 0x80000000u, 0xffffffffu};
    tally t = {"film", 0, 0, 0, 0, 0};
    size_t size;
    unsigned char *const data = film_bytes(&size);
    uint32_t k;
    int i;
    fuzz_state = 4;
    for (i = 0; data && i < fuzz_count(2000); i++) {
        pt_film f = PT_FILM_INIT;
        pt_rgbd c;
        pt_result r;
        mutant_start(data, size);
        for (k = below(3); k > 0; k--) pti_put_little(mutant.data + 4 * below(20), extremes[below(10)], 4);
        for (k = below(3); k > 0; k--)
            mutant.data[below((uint32_t)mutant.size)] ^= (unsigned char)(1u << below(8));
        if (below(4) == 0) mutate_bytes();
        if (mutant.size >= 8 && below(8) > 0)
            pti_put_little(mutant.data + mutant.size - 8, crc64_of(mutant.data, mutant.size - 8), 8);
        write_bytes("fuzz.film", mutant.data, mutant.size);
        pool_start(0);
        r = pt_film_read(path_of("fuzz.film"), &f);
        if (pool.largest > mutant.size + 64) t.greed = pool.largest;
        c = pt_film_pixel(&f, f.width - 1, f.height - 1);
        if (r == PT_OK)
            tally_add(&t, i, 1,
                      f.half[0] && f.half[1] && f.width == 2 && f.height == 1 && f.class_count == 3 &&
                          (c.r < 1e300 || !(c.r < 1e300)));
        else
            tally_add(&t, i, 0,
                      (r == PT_ERROR_FILE || r == PT_ERROR_MISMATCH) && !f.half[0] && !f.ranges &&
                          f.width == 0);
        pt_film_free(&f);
    }
    tally_end(&t, 100);
    free(data);
    remove(path_of("fuzz.film"));
}

/* Is the table of that file read? A refusal asks for no memory unless the size is right. */
static void fuzz_table(tally *t, int i, const char *name, int whole)
{
    pt_measured m = PT_MEASURED_INIT;
    pt_result r;
    pool_start(0);
    r = pt_measured_read(path_of(name), &m);
    if (!whole && pool.largest > 4096) t->greed = pool.largest;
    tally_add(t, i, r == PT_OK, r == PT_OK ? m.value && m.cdf[90] == 1 : r == PT_ERROR_FILE && !m.value);
    pt_measured_free(&m);
}

/* The table has 35 MB: some mutants are that file changed in place and changed back, where it is soon found; most have
   the head and a few values. */
static void fuzz_tables(void)
{
    const size_t whole = 12 + 24 * (size_t)PT_MEASURED_CELLS;
    tally t = {"MERL", 0, 0, 0, 0, 0};
    unsigned char *const data = (unsigned char *)calloc(whole, 1);
    FILE *file;
    uint32_t k;
    int i;
    if (!data) return;
    fuzz_state = 5;
    memcpy(data, "\x5a\0\0\0\x5a\0\0\0\xb4\0\0\0", 12);
    for (i = 0; i < fuzz_count(1000); i++) {
        mutant_start(data, 12 + 8 * below(40));
        for (k = below(4); k > 0; k--) mutate_bytes();
        write_bytes("fuzz.merl", mutant.data, mutant.size);
        fuzz_table(&t, i, "fuzz.merl", 0);
    }
    write_bytes("fuzz.merl", data, whole - 1);
    fuzz_table(&t, i++, "fuzz.merl", 0);
    write_bytes("fuzz.merl", data, whole);
    fuzz_table(&t, i++, "fuzz.merl", 1);
    for (; i < fuzz_count(1030); i++) {
        const long at = below(4) == 0 ? (long)(8 * below(6000) + 12) : (long)below(12);
        unsigned char now[8];
        memcpy(now, data + at, 8);
        for (k = 0; k < 8; k++) now[k] = (unsigned char)(now[k] ^ (1 + below(255)));
        file = fopen(path_of("fuzz.merl"), "rb+");
        if (!file) break;
        fseek(file, at, SEEK_SET);
        (void)fwrite(now, 1, at < 12 ? 1 + below(3) : 8, file);
        fflush(file);
        fuzz_table(&t, i, "fuzz.merl", 1);
        fseek(file, at, SEEK_SET);
        (void)fwrite(data + at, 1, 8, file);
        fclose(file);
    }
    tally_end(&t, 1);
    free(data);
    remove(path_of("fuzz.merl"));
}

static void nothing_left(void)
{
    remove(path_of("model.obj"));
    remove(path_of("model.mtl"));
    pt_check(pool.live == 0, "all is freed", "%ld blocks are left", pool.live);
}

int main(int argc, char **argv)
{
    pt_test_begin("test_files", argc, argv);
    PT_TEST_EXACT(obj_forms);
    PT_TEST_EXACT(obj_counts);
    PT_TEST_EXACT(obj_polygons);
    PT_TEST_EXACT(obj_odd_polygons);
    PT_TEST_EXACT(numbers);
    PT_TEST_EXACT(locales);
    PT_TEST_EXACT(obj_normals);
    PT_TEST_EXACT(obj_transform);
    PT_TEST_EXACT(obj_errors);
    PT_TEST_EXACT(obj_huge);
    PT_TEST_EXACT(mtl_table);
    PT_TEST_EXACT(mtl_files);
    PT_TEST_EXACT(mtl_warnings);
    PT_TEST_EXACT(mtl_textures);
    PT_TEST_EXACT(relative_paths);
    PT_TEST_EXACT(obj_renders_the_same);
    PT_TEST_EXACT(checksums);
    PT_TEST_EXACT(huffman_codes);
    PT_TEST_EXACT(png_kinds);
    PT_TEST_EXACT(png_codes);
    PT_TEST_EXACT(png_damage);
    PT_TEST_EXACT(png_wrong);
    PT_TEST_EXACT(ppm_kinds);
    PT_TEST_EXACT(ppm_heads);
    PT_TEST_EXACT(film_round_trips);
    PT_TEST_EXACT(film_resumes);
    PT_TEST_EXACT(film_damage);
    PT_TEST_EXACT(film_heads);
    PT_TEST_EXACT(film_arguments);
    PT_TEST_EXACT(full_disk);
    PT_TEST_EXACT(failing_memory);
    PT_TEST_EXACT(fuzz_models);
    PT_TEST_EXACT(fuzz_pictures);
    PT_TEST_EXACT(fuzz_png);
    PT_TEST_EXACT(fuzz_films);
    PT_TEST_EXACT(fuzz_tables);
    PT_TEST_EXACT(nothing_left);
    return pt_test_end();
}
