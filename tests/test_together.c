/* test_together.c: pictures of paths that walk together [PT-11b] are those of paths one at a time: every canonical scene that
   the lockstep takes, rooms with all that it knows, and all options. Renders have other seeds; means over the picture and
   over its blocks are compared. LONG=1 takes eight times the samples and asks for 0.4 of the bounds. */

#include "pt_lock.h"

#if PTI_HAS_LOCKSTEP

static void rooms(void)
{
    int kind, by_tree;
    pt_test_source("pti_path");
    for (kind = 0; kind < ROOMS; kind++) {
        const uint32_t spp = kind == ROUND ? 192 : 48; /* the points of its lamp are outside for the most part */
        stage s = room(kind);
        pt_render_desc d = desc_of(&s, 9, 6, samples(spp));
        picture b;
        if (kind == SMOOTH) d.li.max_edges = 24; /* shading normals can keep a path in a ball of glass for ever */
        b = pictures(&s, d, RENDERS, 300500u + 1000u * (uint64_t)kind, 0);
        pt_scene_free(&s.scene);
        for (by_tree = kind == SMOOTH; by_tree < 3; by_tree++) {
            picture a;
            s = room_of(kind, by_tree);
            d.spp = samples(by_tree == 1 ? 2 * spp : spp); /* roulette begins lower where a tree is asked for all */
            a = pictures(&s, d, RENDERS, 300000u + 1000u * (uint64_t)kind + 100u * (uint64_t)by_tree, 1 + (by_tree > 0));
            compare(label("%s%s", room_names[kind], by_tree == 2 ? ", tree and walls" : by_tree ? ", by its tree" : ""), &a, &b, within(0.05));
            pt_scene_free(&s.scene);
        }
    }
}

/* All scenes of [PT-19] that it takes. */
static void canonical(void)
{
    int count, i, taken = 0;
    const pt_scene_entry *entry = pt_scenes(&count);
    pt_test_source("pti_path");
    for (i = 0; i < count; i++) {
        pt_report report = PT_REPORT_INIT;
        pt_film film = PT_FILM_INIT;
        pt_render_desc d;
        stage s;
        memset(&s, 0, sizeof s);
        pt_check(entry[i].make(&s.scene, &s.camera) == PT_OK, entry[i].name, "cannot be made");
        d = desc_of(&s, 2, 2, 1);
        pt_check(pt_render(&s.scene, &d, &film, &report) == PT_OK, entry[i].name, "does not render");
        if (strncmp(report.body, "lockstep", 8) == 0) {
            const int by_tree = strstr(report.body, "-tree") != NULL;
            const int caustic = strcmp(entry[i].name, "glass-ball") == 0 || strcmp(entry[i].name, "veach-plates") == 0 ||
                                strcmp(entry[i].name, "caustic-ring") == 0; /* or a small lamp, seen */
            picture a, b;
            d = desc_of(&s, 12, 9, samples(caustic ? 192 : strcmp(entry[i].name, "furnace") == 0 ? 16 : 64));
            a = pictures(&s, d, RENDERS, 400000u + 1000u * (uint64_t)i, 1 + by_tree);
            b = pictures(&s, d, RENDERS, 400500u + 1000u * (uint64_t)i, 0);
            compare(entry[i].name, &a, &b, within(caustic ? 0.35 : 0.1));
            taken++;
        }
        pt_film_free(&film);
        pt_report_free(&report);
        pt_scene_free(&s.scene);
    }
    pt_check(taken >= 5, "canonical scenes in lockstep", "%d", taken);
}

/* What changes no expectation, against one picture of paths one at a time. */
static void one_expectation(void)
{
    enum { WAYS = 18 };
    static const char *const names[WAYS] = {
        "balance heuristic", "power heuristic", "maximum heuristic", "path-light", "path-plain", "constant roulette",
        "constant roulette 0.5 from 2 on", "roulette scale 1", "roulette scale 1/2", "roulette scale 30", "roulette from 1 on", "roulette from 9 on",
        "independent", "single net", "independent, single net", "tiles of 1", "first sample 5", "path-plain, roulette from 1 on"};
    stage s = room(MANY_LAMPS);
    const pt_render_desc plain = desc_of(&s, 9, 6, samples(96));
    const picture b = pictures(&s, plain, RENDERS, 500000, 0);
    int k;
    pt_test_source("pti_path");
    for (k = 0; k < WAYS; k++) {
        pt_render_desc d = plain;
        picture a;
        if (k < 3) d.li.heuristic = k == 0 ? PT_HEURISTIC_BALANCE : k == 1 ? PT_HEURISTIC_POWER : PT_HEURISTIC_MAXIMUM;
        if (k == 3) d.method = "path-light";
        if (k == 4 || k == 17) d.method = "path-plain";
        if (k == 5 || k == 6) d.li.roulette = PT_ROULETTE_CONSTANT;
        if (k == 6) d.li.roulette_survival = (pt_real)0.5;
        if (k == 6) d.li.roulette_start = 2;
        if (k == 7) d.li.roulette_scale = 1;
        if (k == 8) d.li.roulette_scale = (pt_real)0.5;
        if (k == 9) d.li.roulette_scale = 30;
        if (k == 10 || k == 17) d.li.roulette_start = 1;
        if (k == 11) d.li.roulette_start = 9;
        if (k == 12 || k == 14) d.sampler = PT_SAMPLER_INDEPENDENT;
        if (k == 13 || k == 14) d.single_net = 1;
        if (k == 15) d.tile = 1;
        if (k == 16) d.first_sample = 5;
        if (k == 3 || k == 4 || k == 6 || k == 14 || k == 17) d.spp *= 2;
        a = pictures(&s, d, RENDERS, 500100u + 100u * (uint64_t)k, 1);
        compare(names[k], &a, &b, within(0.03));
    }
    pt_scene_free(&s.scene);
}

/* What changes it, each against its own picture. */
static void own_expectation(void)
{
    enum { WAYS = 13 };
    static const struct {
        const char *name, *method;
        int room, edges;
        pt_roulette roulette;
        double lens, near, radius;
        pt_filter filter;
        uint32_t spp;
    } ways[WAYS] = {{"1 edge", NULL, MANY_LAMPS, 1, PT_ROULETTE_THROUGHPUT, 0, 0, 0, PT_FILTER_BOX, 128},
                    {"2 edges", NULL, MANY_LAMPS, 2, PT_ROULETTE_THROUGHPUT, 0, 0, 0, PT_FILTER_BOX, 64},
                    {"3 edges", NULL, GLASS_BOX, 3, PT_ROULETTE_THROUGHPUT, 0, 0, 0, PT_FILTER_BOX, 64},
                    {"5 edges", NULL, SPHERES, 5, PT_ROULETTE_CONSTANT, 0, 0, 0, PT_FILTER_BOX, 32},
                    {"3 edges, path-light", "path-light", SPHERES, 3, PT_ROULETTE_THROUGHPUT, 0, 0, 0, PT_FILTER_BOX, 64},
                    {"3 edges, no roulette", NULL, MANY_LAMPS, 3, PT_ROULETTE_NONE, 0, 0, 0, PT_FILTER_BOX, 64},
                    {"3 edges, path-plain", "path-plain", MANY_LAMPS, 3, PT_ROULETTE_THROUGHPUT, 0, 0, 0, PT_FILTER_BOX, 128},
                    {"thin lens", NULL, MANY_LAMPS, 0, PT_ROULETTE_THROUGHPUT, 0.2, 0, 0, PT_FILTER_BOX, 32},
                    {"near distance", NULL, IN_GLASS, 0, PT_ROULETTE_THROUGHPUT, 0, 0.9, 0, PT_FILTER_BOX, 32},
                    {"thin lens, wide tent", NULL, SPHERES, 0, PT_ROULETTE_THROUGHPUT, 0.05, 0.3, 2, PT_FILTER_TENT, 32},
                    {"Gaussian", NULL, MANY_LAMPS, 4, PT_ROULETTE_THROUGHPUT, 0, 0, 0, PT_FILTER_GAUSSIAN, 32},
                    {"wide box", NULL, SPHERES, 0, PT_ROULETTE_THROUGHPUT, 0, 0, 3, PT_FILTER_BOX, 32},
                    {"upright, wide angle", NULL, MANY_LAMPS, 0, PT_ROULETTE_THROUGHPUT, 0, 0, 0, PT_FILTER_BOX, 32}};
    int k;
    pt_test_source("pti_path");
    for (k = 0; k < WAYS; k++) {
        stage s = room(ways[k].room);
        pt_render_desc d = desc_of(&s, 9, 6, samples(ways[k].spp));
        picture a, b;
        d.method = ways[k].method;
        d.li.max_edges = ways[k].edges;
        d.li.roulette = ways[k].roulette;
        d.camera.lens_radius = (pt_real)ways[k].lens;
        d.camera.focus_distance = (pt_real)1.5;
        d.camera.near_distance = (pt_real)ways[k].near;
        d.filter = ways[k].filter;
        d.filter_radius = ways[k].radius;
        if (k == WAYS - 1) d.width = 4, d.height = 15, d.camera.tan_half = 2;
        a = pictures(&s, d, RENDERS, 600000u + 1000u * (uint64_t)k, 1);
        b = pictures(&s, d, RENDERS, 600500u + 1000u * (uint64_t)k, 0);
        compare(ways[k].name, &a, &b, within(0.08));
        pt_scene_free(&s.scene);
    }
}

#endif

int main(int argc, char **argv)
{
    pt_test_begin("test_together", argc, argv);
#if PTI_HAS_LOCKSTEP
    PT_TEST(rooms);
    PT_TEST(canonical);
    PT_TEST(one_expectation);
    PT_TEST(own_expectation);
#endif
    return pt_test_end();
}
