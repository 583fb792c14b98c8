/* cpp_user.cpp - the header in a C++11 program: owners that free, a mesh from vectors, a lambda for progress.

   build:  c++ -O2 -std=c++11 -I. examples/cpp_user.cpp -o cpp_user -lm -pthread
   run:    ./cpp_user

   Renders a faceted ball of reflectance 1/2 under a sky of radiance 1 and nothing else. A convex body sees
   the whole sky over each of its points and never itself, so every pixel on it should be 1/2: the furnace
   test. Writes cpp_user.png, prints the mean over the middle of the picture; exit status 0 if it is 1/2
   within five standard errors. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <cmath>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <vector>

/* The C objects with a destructor; not to be copied. */
struct Scene {
    pt_scene c = PT_SCENE_INIT;
    Scene() = default;
    Scene(const Scene &) = delete;
    Scene &operator=(const Scene &) = delete;
    ~Scene() { pt_scene_free(&c); }
};

struct Film {
    pt_film c = PT_FILM_INIT;
    Film() = default;
    Film(const Film &) = delete;
    Film &operator=(const Film &) = delete;
    ~Film() { pt_film_free(&c); }
};

static void must(pt_result result, const char *sentence)
{
    if (result != PT_OK) throw std::runtime_error(sentence);
}

/* A ball of `rings` x `sectors` facets around the origin. Facets are seen from outside in counter-clockwise
   order, so that their normals point outwards. */
static void add_ball(pt_scene &scene, int material, unsigned rings, unsigned sectors)
{
    std::vector<pt_vec3> points;
    std::vector<uint32_t> indices;

    for (unsigned i = 0; i <= rings; i++)
        for (unsigned j = 0; j < sectors; j++) {
            const double theta = PT_PI * i / rings, phi = 2 * PT_PI * j / sectors;
            points.push_back(pt_v3(static_cast<pt_real>(std::sin(theta) * std::cos(phi)),
                                   static_cast<pt_real>(std::cos(theta)),
                                   static_cast<pt_real>(std::sin(theta) * std::sin(phi))));
        }
    for (unsigned i = 0; i < rings; i++)
        for (unsigned j = 0; j < sectors; j++) {
            const unsigned a = i * sectors + j, b = i * sectors + (j + 1) % sectors;
            const unsigned quad[6] = {a, b, b + sectors, a, b + sectors, a + sectors};
            indices.insert(indices.end(), quad, quad + 6);
        }
    if (pt_add_mesh(&scene, points.data(), nullptr, nullptr, static_cast<uint32_t>(points.size()),
                    indices.data(), static_cast<uint32_t>(indices.size() / 3), material) < 0)
        throw std::runtime_error(pt_scene_error(&scene));
}

static void make_scene(pt_scene &scene)
{
    const int grey = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(static_cast<pt_real>(0.5))));

    add_ball(scene, grey, 16, 32);
    pt_set_environment(&scene, pt_rgb_grey(1));
    must(pt_commit(&scene), pt_scene_error(&scene));
}

static void render(const pt_scene &scene, pt_film &film, pt_report *report)
{
    pt_render_desc desc = pt_render_defaults();

    desc.camera = pt_camera_look_at(pt_v3(0, 1, 5), pt_v3(0, 0, 0), pt_v3(0, 1, 0), 30);
    desc.width = desc.height = 128;
    desc.spp = 64;
    desc.progress = [](void *, const pt_progress *p) { return p->seconds > 60 ? 1 : 0; };
    const pt_result result = pt_render(&scene, &desc, &film, report);
    must(result, pt_result_string(result));
}

/* The middle quarter of the picture lies on the ball. */
static bool check(const pt_film &film)
{
    const double exact = 0.5;
    pt_stats stats = PT_STATS_INIT;

    for (int y = film.height * 3 / 8; y < film.height * 5 / 8; y++)
        for (int x = film.width * 3 / 8; x < film.width * 5 / 8; x++)
            pt_stats_add(&stats, pt_film_pixel(&film, x, y).g);
    const double error = pt_stats_standard_error(&stats);
    /* The second term is for values that are exact but for rounding. */
    const bool ok = std::fabs(stats.mean - exact) <= 5 * error + 1e-6 * exact;
    std::printf("ball under a white sky: mean %.6f +- %.6f, should be %g: %s\n", stats.mean, error, exact,
                ok ? "good" : "WRONG");
    return ok;
}

int main()
{
    try {
        Scene scene;
        Film film;

        make_scene(scene.c);
        render(scene.c, film.c, nullptr);
        must(pt_write_png("cpp_user.png", &film.c, 1), "cpp_user.png could not be written");
        std::printf("wrote cpp_user.png\n");
        return check(film.c) ? 0 : 1;
    } catch (const std::exception &e) {
        std::fprintf(stderr, "cpp_user: %s\n", e.what());
        return 1;
    }
}
