/* main.c - a program of two files: this one includes the header plainly and sees the declarations only; the
   implementation is compiled in pathtracer_impl.c.

   build:  cc -O2 -I. examples/two_files/main.c examples/two_files/pathtracer_impl.c -o two_files -lm -pthread
   run:    ./two_files

   Renders the furnace, a closed box whose walls emit 1 and reflect 1/2. Light 1 + 1/2 + 1/4 + ... = 2 comes
   from everywhere, so every pixel should be 2. Prints the mean over the picture and its standard error; exit
   status 0 if the mean is 2 within five standard errors. */

#include "pathtracer.h"

#include <stdlib.h>

/* Mean of the green band and its standard error, from the spread of the pixels: they are independent. */
static void mean_of_picture(const pt_film *film, double *mean, double *standard_error)
{
    pt_stats stats = PT_STATS_INIT;
    int x, y;

    for (y = 0; y < film->height; y++)
        for (x = 0; x < film->width; x++) pt_stats_add(&stats, pt_film_pixel(film, x, y).g);
    *mean = stats.mean;
    *standard_error = pt_stats_standard_error(&stats);
}

static int check_furnace(const pt_film *film, const pt_report *report)
{
    const double exact = 2;
    double mean, standard_error;
    int ok;

    mean_of_picture(film, &mean, &standard_error);
    /* The second term is for sums that are exact but for rounding. */
    ok = fabs(mean - exact) <= 5 * standard_error + 1e-6 * exact;
    printf("furnace: mean %.6f +- %.6f, should be %g: %s\n", mean, standard_error, exact,
           ok ? "good" : "WRONG");
    printf("%u samples per pixel, %.2f s\n", (unsigned)report->spp, report->wall_seconds);
    return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}

int main(void)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    pt_render_desc desc = pt_render_defaults();
    pt_result result;
    int status = EXIT_FAILURE;

    result = pt_scene_furnace(&scene, &desc.camera);
    desc.width = desc.height = 64;
    desc.spp = 16;
    if (result == PT_OK) result = pt_render(&scene, &desc, &film, &report);
    if (result == PT_OK) status = check_furnace(&film, &report);
    else fprintf(stderr, "%s\n", scene.error != PT_OK ? pt_scene_error(&scene) : pt_result_string(result));
    pt_report_free(&report);
    pt_film_free(&film);
    pt_scene_free(&scene);
    return status;
}
