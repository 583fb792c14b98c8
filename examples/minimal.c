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
