/* scenes.c: a contact sheet. One picture with every canonical scene, the lecture's bounce study, one scene by every
   method, and one scene taken apart into the slides' classes of light paths.

       cc -O2 -I.. scenes.c -o scenes -lm -pthread && ./scenes 64 scenes.png

   Arguments: samples per pixel (64) and the file to write (scenes.png). Prints, tile by tile, the estimated error
   and the seconds it took. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <stdlib.h>

enum { TILE_W = 160, TILE_H = 120, COLUMNS = 6, GAP = 4 };

typedef struct sheet {
    unsigned char *rgb;
    int width, height, tiles, rows;
    uint32_t spp;
} sheet;

/* Copies a film into the next tile, from row to row; the mean of all its samples, in sRGB. */
static void place(sheet *s, const pt_film *film, double exposure)
{
    int x, y, left = GAP + s->tiles % COLUMNS * (TILE_W + GAP), top = GAP + s->tiles / COLUMNS * (TILE_H + GAP);
    for (y = 0; y < TILE_H; y++)
        for (x = 0; x < TILE_W; x++) {
            const pt_rgbd c = pt_film_pixel(film, x, y);
            unsigned char *to = s->rgb + 3 * ((size_t)(top + y) * (size_t)s->width + (size_t)(left + x));
            to[0] = pt_srgb_byte(exposure * c.r);
            to[1] = pt_srgb_byte(exposure * c.g);
            to[2] = pt_srgb_byte(exposure * c.b);
        }
    s->tiles++;
}

static void new_row(sheet *s)
{
    while (s->tiles % COLUMNS != 0) s->tiles++;
}

/* Renders a scene into `film`; 0 and a sentence if it cannot be. */
static int render(const sheet *s, const char *name, const char *method, int max_edges, const pt_lpe *lpe, const char *label,
                  pt_film *film)
{
    const pt_scene_entry *entry = pt_scene_find(name);
    pt_render_desc desc = pt_render_defaults();
    pt_scene scene = PT_SCENE_INIT;
    pt_report report = PT_REPORT_INIT;
    pt_result result = entry ? entry->make(&scene, &desc.camera) : PT_ERROR_ARGUMENT;
    pt_error error;
    if (result == PT_OK) {
        desc.width = TILE_W;
        desc.height = TILE_H;
        desc.spp = s->spp;
        desc.method = method;
        desc.li.max_edges = max_edges;
        desc.li.lpe = lpe;
        desc.filter = PT_FILTER_GAUSSIAN;
        result = pt_render(&scene, &desc, film, &report);
    }
    if (result != PT_OK)
        printf("%-28s %s\n", label, report.error ? report.error : pt_scene_error(&scene));
    else if (pt_film_error_estimate(film, &error))
        printf("%-28s %-12s %5lu %10.4f %10.2f %10.2f\n", label, method ? method : "path", (unsigned long)report.spp, sqrt(error.relmse),
               report.cpu_seconds, 1e-6 * (double)report.rays);
    fflush(stdout);
    pt_report_free(&report);
    pt_scene_free(&scene);
    return result == PT_OK;
}

static int tile(sheet *s, const char *name, const char *method, int max_edges, const char *label)
{
    pt_film film = PT_FILM_INIT;
    int ok = render(s, name, method, max_edges, NULL, label, &film);
    if (ok) place(s, &film, strcmp(name, "furnace") == 0 ? 0.25 : 1);
    pt_film_free(&film);
    return ok;
}

/* All classes of the slides from one render. Each picture is as bright as it is: they add up to the whole. */
static int classes(sheet *s, const char *name)
{
    pt_film film = PT_FILM_INIT, one = PT_FILM_INIT;
    pt_lpe lpe;
    int k, ok = pt_lpe_compile(&lpe, pt_lpe_slides(), PT_LPE_SLIDES_COUNT, NULL) == PT_OK && render(s, name, NULL, 0, &lpe, "classes of paths", &film);
    for (k = 0; ok && k < COLUMNS; k++) {
        ok = pt_film_class(&film, k, &one) == PT_OK;
        if (ok) place(s, &one, 1);
        printf("    %s\n", pt_lpe_slides()[k]);
    }
    pt_film_free(&one);
    pt_film_free(&film);
    return ok;
}

static int draw(sheet *s)
{
    static const int bounces[COLUMNS] = {0, 1, 2, 4, 8, 16};
    int count, k, ok = 1;
    const pt_scene_entry *scenes = pt_scenes(&count);
    const pt_method *methods;
    printf("%-28s %-12s %5s %10s %10s %10s\n", "tile", "method", "spp", "est. error", "CPU s", "Mrays");
    for (k = 0; k < count; k++) ok &= tile(s, scenes[k].name, NULL, 0, scenes[k].name);
    new_row(s);
    for (k = 0; k < COLUMNS; k++) {
        char label[32];
        snprintf(label, sizeof label, "cornell, %d bounces", bounces[k]);
        ok &= tile(s, "cornell", NULL, bounces[k] + 2, label);
    }
    new_row(s);
    methods = pt_methods(&count);
    for (k = 1; k < count; k++) ok &= tile(s, "cornell-spheres", methods[k].name, 0, "cornell-spheres");
    new_row(s);
    ok &= classes(s, "cornell-spheres");
    new_row(s);
    return ok;
}

int main(int argc, char **argv)
{
    const char *path = argc > 2 ? argv[2] : "scenes.png";
    sheet s;
    int count, ok;
    (void)pt_scenes(&count);
    s.spp = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 64;
    s.rows = (count + COLUMNS - 1) / COLUMNS + 3;
    s.tiles = 0;
    s.width = GAP + COLUMNS * (TILE_W + GAP);
    s.height = GAP + s.rows * (TILE_H + GAP);
    s.rgb = (unsigned char *)calloc((size_t)s.width * (size_t)s.height, 3);
    if (!s.rgb || s.spp == 0) {
        fprintf(stderr, "usage: scenes [samples] [file.png]\n");
        free(s.rgb);
        return 1;
    }
    ok = draw(&s);
    if (pt_write_png_bytes(path, s.rgb, s.width, s.height) != PT_OK) {
        fprintf(stderr, "%s: %s\n", path, pt_result_string(PT_ERROR_FILE));
        ok = 0;
    }
    if (ok) printf("wrote %s (%d x %d)\n", path, s.width, s.height);
    free(s.rgb);
    return !ok;
}
