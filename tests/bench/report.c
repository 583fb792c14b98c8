/* report.c - error against run time for every canonical scene: which method and which points are worth their seconds?

   build:  cc -O2 -ffp-contract=off -I. tests/bench/report.c -o report -lm -pthread
   run:    ./report DIRECTORY [--seconds S] [--scene NAME] [--method NAME] [--size N] [--flags TEXT]

   Each scene is rendered with every method and sampler at 1, 2, 4, ... samples per pixel, each time with other random
   numbers (rows of one render share their samples, and would make every order look better than it is). The error is
   the true one, against a reference that is rendered when it is missing and kept in DIRECTORY/references; its own
   error is subtracted. --seconds is about how long all of that takes (60); times are CPU seconds of one thread. Without
   --scene, cost against size comes on top: meshes of 10^2 to 10^7 triangles, within 8 GiB. --flags says on the page how
   this program was compiled.

   Writes DIRECTORY/index.html, error_vs_time.csv, cost.csv, and the plots and pictures that the page shows.

   Exit status: 0, or 1 if a scene could not be rendered or a file not be written. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <stdarg.h>
#include <stdlib.h>

#if defined(__clang__)
#define COMPILER "clang " __clang_version__
#elif defined(__GNUC__)
#define COMPILER "gcc " __VERSION__
#else
#define COMPILER "a compiler that does not say its name"
#endif

enum { MAX_ROWS = 24, MAX_CURVES = 20, REPEATS = 8 };

/* Error against time of one method with one sampler, from independent renders. */
typedef struct curve {
    const pt_method *method;
    pt_sampler_kind sampler;
    int single_net;              /* all samples in one half: no error estimate, better points              */
    char label[48], file[64];
    const char *body;            /* of the integrator, that the driver chose                               */
    int count;
    uint32_t spp[MAX_ROWS];
    double seconds[MAX_ROWS], relmse[MAX_ROWS], rmse[MAX_ROWS], estimated[MAX_ROWS];
    double mean, efficiency, order, order_error; /* of the last render; 1 / (relMSE s); slope of the root  */
    float *picture;              /* of the last render                                                     */
} curve;

typedef struct reference {
    pt_film film;
    float *rgb;
    double relmse, mean;         /* its own error as the halves tell it; mean luminance                    */
    pt_stats mis, plain;         /* mean luminance of independent renders of both methods                  */
} reference;

typedef struct job {
    const char *directory, *only_scene, *only_method, *flags;
    double seconds;              /* of one curve: its last render takes about half of them                 */
    double reference_seconds;
    int size;
    FILE *csv, *cost, *html;
    int failed;
} job;

/* ---- small things ------------------------------------------------------------------------------------------ */

static char *text_of(char *buffer, size_t size, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(buffer, size, format, arguments);
    va_end(arguments);
    return buffer;
}

static double luminance_mean(const pt_film *film)
{
    double sum = 0;
    int x, y;
    for (y = 0; y < film->height; y++)
        for (x = 0; x < film->width; x++) {
            const pt_rgbd c = pt_film_pixel(film, x, y);
            sum += pt_luminance(c.r, c.g, c.b);
        }
    return sum / ((double)film->width * film->height);
}

static float *pixels_of(const pt_film *film)
{
    float *const rgb = (float *)malloc((size_t)film->width * (size_t)film->height * 3 * sizeof *rgb);
    int x, y;
    for (y = 0; rgb && y < film->height; y++)
        for (x = 0; x < film->width; x++) {
            const pt_rgbd c = pt_film_pixel(film, x, y);
            float *const p = rgb + 3 * ((size_t)y * (size_t)film->width + (size_t)x);
            p[0] = (float)c.r;
            p[1] = (float)c.g;
            p[2] = (float)c.b;
        }
    return rgb;
}

static pt_render_desc desc_of(const job *j, const pt_camera *camera, const char *method, uint64_t seed)
{
    pt_render_desc desc = pt_render_defaults();
    desc.camera = *camera;
    desc.width = desc.height = j->size;
    desc.method = method;
    desc.seed = seed;
    desc.threads = 1;
    return desc;
}

/* ---- references -------------------------------------------------------------------------------------------- */

/* The kept film of this scene, continued until it has taken its seconds; a film of another scene, camera or version of
   the header is begun anew. */
static pt_result make_reference(const job *j, const pt_scene *scene, const pt_camera *camera, const char *name,
                                reference *r)
{
    pt_render_desc desc = desc_of(j, camera, "path", 1001);
    pt_report report = PT_REPORT_INIT;
    pt_error own;
    char path[512];
    pt_result result = PT_ERROR_FILE;
    text_of(path, sizeof path, "%s/references/%s-%d.film", j->directory, name, j->size);
    if (pt_film_read(path, &r->film) == PT_OK) {
        desc.spp = pt_film_spp(&r->film);
        result = pt_render(scene, &desc, &r->film, NULL);
        if (result != PT_OK) pt_film_free(&r->film);
    }
    if (result != PT_OK) {
        desc.spp = 0;
        desc.cpu_seconds = j->reference_seconds;
        result = pt_render(scene, &desc, &r->film, &report);
        if (result == PT_OK) result = pt_film_write(path, &r->film);
        pt_report_free(&report);
    }
    if (result != PT_OK) return result;
    r->relmse = pt_film_error_estimate(&r->film, &own) ? own.relmse : 0;
    r->mean = luminance_mean(&r->film);
    r->rgb = pixels_of(&r->film);
    return r->rgb ? PT_OK : PT_ERROR_MEMORY;
}

/* A second opinion on the reference: means of independent renders by sampling lights and surfaces, and by hitting
   lamps only. Both converge to the same; where the second does so too slowly its spread says it. */
static pt_result second_opinion(const job *j, const pt_scene *scene, const pt_camera *camera, reference *r)
{
    static const char *const methods[2] = {"path", "path-plain"};
    pt_result result = PT_OK;
    int m, k;
    for (m = 0; m < 2; m++)
        for (k = 0; k < REPEATS && result == PT_OK; k++) {
            pt_render_desc desc = desc_of(j, camera, methods[m], 2000 + (uint64_t)(10 * k + m));
            pt_film film = PT_FILM_INIT;
            desc.spp = 0;
            desc.cpu_seconds = 0.25 * j->reference_seconds / REPEATS;
            result = pt_render(scene, &desc, &film, NULL);
            if (result == PT_OK) pt_stats_add(m ? &r->plain : &r->mis, luminance_mean(&film));
            pt_film_free(&film);
        }
    return result;
}

/* What both say, as a sentence. Welch's test; a relative standard error above 1/10 is no opinion. */
static void describe_reference(const reference *r, char *out, size_t size)
{
    const double a = pt_stats_standard_error(&r->mis), b = pt_stats_standard_error(&r->plain);
    const double z = a + b > 0 ? (r->plain.mean - r->mis.mean) / sqrt(a * a + b * b) : 0;
    if (!(r->plain.mean > 0) || b > 0.1 * r->plain.mean || fabs(z) > 6)
        text_of(out, size,
                "Only one method converges here: path tracing with light sampling has the mean %.5g (standard error %.2g), "
                "plain path tracing in the same time %.5g (%.2g).",
                r->mis.mean, a, r->plain.mean, b);
    else
        text_of(out, size,
                "Two methods agree on the mean of the picture: %.5g (standard error %.2g) with light sampling, %.5g (%.2g) "
                "by plain path tracing; they differ by %.1f standard errors.",
                r->mis.mean, a, r->plain.mean, b, fabs(z));
}

/* ---- curves ------------------------------------------------------------------------------------------------ */

/* The t with P(T > t) = p for n degrees of freedom. */
static double student_quantile(double p, double n)
{
    double low = 0, high = 1000;
    int i;
    for (i = 0; i < 60; i++) {
        const double middle = 0.5 * (low + high);
        *(pt_student_sf(middle, n) > p ? &low : &high) = middle;
    }
    return high;
}

/* Slope of log y over log x by least squares, and half the width of its 95 % confidence interval. */
static void fit_order(curve *c)
{
    double sx = 0, sy = 0, xx = 0, xy = 0, rest = 0;
    int i, n = 0;
    c->order = c->order_error = 0;
    for (i = 0; i < c->count; i++)
        if (c->relmse[i] > 0) {
            sx += log(c->seconds[i]);
            sy += 0.5 * log(c->relmse[i]);
            n++;
        }
    if (n < 4) return;
    for (i = 0; i < c->count; i++)
        if (c->relmse[i] > 0) {
            const double x = log(c->seconds[i]) - sx / n, y = 0.5 * log(c->relmse[i]) - sy / n;
            xx += x * x;
            xy += x * y;
        }
    c->order = xy / xx;
    for (i = 0; i < c->count; i++)
        if (c->relmse[i] > 0) {
            const double e = 0.5 * log(c->relmse[i]) - sy / n - c->order * (log(c->seconds[i]) - sx / n);
            rest += e * e;
        }
    c->order_error = student_quantile(0.025, n - 2) * sqrt(rest / (n - 2) / xx);
}

/* One more row, from a render of its own: 0 when the curve is at its end. */
static int add_row(const job *j, const pt_scene *scene, const pt_camera *camera, const reference *r, curve *c)
{
    pt_render_desc desc = desc_of(j, camera, c->method->name, 3000 + (uint64_t)c->count);
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    const pt_report_row *row;
    const uint32_t spp = 1u << c->count;
    int more = 0;
    desc.sampler = c->sampler;
    desc.single_net = c->single_net;
    desc.spp = spp;
    desc.reference = r->rgb;
    if (!c->method->follows) desc.li.branching = 4;
    if (c->method->li == pt_method_find("branching")->li) desc.li.max_edges = 4; /* grows as 4^edges */
    if (pt_render(scene, &desc, &film, &report) == PT_OK && report.row_count > 0) {
        row = &report.rows[report.row_count - 1];
        c->spp[c->count] = spp;
        c->seconds[c->count] = row->cpu_seconds;
        c->relmse[c->count] = row->true_error.relmse - r->relmse;
        c->rmse[c->count] = row->true_error.rmse;
        c->estimated[c->count] = row->estimated ? row->error.relmse : 0;
        more = row->cpu_seconds < 0.5 * j->seconds && c->relmse[c->count] > r->relmse && c->count + 1 < MAX_ROWS;
        c->count++;
        c->body = report.body;
        free(c->picture);
        c->picture = pixels_of(&film);
        c->mean = luminance_mean(&film);
        if (c->relmse[c->count - 1] > 0) c->efficiency = 1 / (c->relmse[c->count - 1] * row->cpu_seconds);
    }
    pt_report_free(&report);
    pt_film_free(&film);
    return more;
}

static void add_curve(curve *curves, int *count, const pt_method *method, pt_sampler_kind sampler, int single_net)
{
    curve *const c = &curves[*count];
    if (*count == MAX_CURVES) return;
    memset(c, 0, sizeof *c);
    c->method = method;
    c->sampler = sampler;
    c->single_net = single_net;
    text_of(c->label, sizeof c->label, "%s, %s%s", method->name, pt_sampler_name(sampler), single_net ? ", one net" : "");
    text_of(c->file, sizeof c->file, "%s-%s%s", method->name, pt_sampler_name(sampler), single_net ? "-one" : "");
    (*count)++;
}

/* Path tracing in all its forms with all samplers; the other methods, which leave out light, with one. */
static int list_curves(const job *j, curve *curves)
{
    int methods, m, s, count = 0;
    const pt_method *const all = pt_methods(&methods);
    for (m = 0; m < methods; m++) {
        if (j->only_method && strcmp(j->only_method, all[m].name) != 0) continue;
        for (s = PT_SAMPLER_SOBOL; s < PT_SAMPLER_GIVEN; s++)
            if (all[m].follows || s == PT_SAMPLER_SOBOL) add_curve(curves, &count, &all[m], (pt_sampler_kind)s, 0);
        if (m == 0) add_curve(curves, &count, &all[m], PT_SAMPLER_SOBOL, 1);
    }
    return count;
}

/* ---- plots ------------------------------------------------------------------------------------------------- */

static const char *const COLOURS[10] = {"#1f77b4", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd",
                                        "#17becf", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22"};

typedef struct plot {
    FILE *file;
    double x0, x1, y0, y1; /* log10 of the ends */
} plot;

/* The names stand below in two columns, so that letters can be read also where the page is narrow. */
enum { PLOT_W = 560, PLOT_H = 420, LEFT = 80, RIGHT = 24, TOP = 20, BOTTOM = 60, NAME_W = 228, NAME_H = 18 };

static double plot_x(const plot *p, double x) { return LEFT + (log10(x) - p->x0) / (p->x1 - p->x0) * (PLOT_W - LEFT - RIGHT); }
static double plot_y(const plot *p, double y)
{
    return PLOT_H - BOTTOM - (log10(y) - p->y0) / (p->y1 - p->y0) * (PLOT_H - TOP - BOTTOM);
}

static void plot_frame(const plot *p, const char *x_title, const char *y_title, int names)
{
    const int height = PLOT_H + NAME_H * ((names + 1) / 2) + 6;
    double v;
    fprintf(p->file,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" font-family=\"sans-serif\" font-size=\"13\">\n"
            "<rect width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n",
            PLOT_W, height, PLOT_W, height);
    for (v = p->x0; v <= p->x1; v++)
        fprintf(p->file,
                "<path d=\"M%.1f %dV%d\" stroke=\"#ddd\"/><text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%g</text>\n",
                plot_x(p, pow(10, v)), TOP, PLOT_H - BOTTOM, plot_x(p, pow(10, v)), PLOT_H - BOTTOM + 18, pow(10, v));
    for (v = p->y0; v <= p->y1; v++)
        fprintf(p->file,
                "<path d=\"M%d %.1fH%d\" stroke=\"#ddd\"/><text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%g</text>\n", LEFT,
                plot_y(p, pow(10, v)), PLOT_W - RIGHT, LEFT - 8, plot_y(p, pow(10, v)) + 4, pow(10, v));
    fprintf(p->file, "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">%s</text>\n", (LEFT + PLOT_W - RIGHT) / 2,
            PLOT_H - BOTTOM + 38, x_title);
    fprintf(p->file, "<text transform=\"translate(18 %d) rotate(-90)\" text-anchor=\"middle\">%s</text>\n",
            (TOP + PLOT_H - BOTTOM) / 2, y_title);
}

/* The name of line k, with a piece of it. */
static void plot_name(const plot *p, int k, const char *colour, const char *stroke, const char *label)
{
    const int x = LEFT - 50 + k % 2 * (NAME_W + 40), y = PLOT_H + NAME_H * (k / 2);
    fprintf(p->file, "<path d=\"M%d %dh26\" stroke=\"%s\"%s/><text x=\"%d\" y=\"%d\">%s</text>\n", x, y, colour, stroke, x + 34,
            y + 4, label);
}

/* A dashed line of slope -1/2 through (x, y), within the frame; k: where its name stands. */
static void plot_slope(const plot *p, double x, double y, int k)
{
    const double lx = log10(x), ly = log10(y), from = fmax(p->x0, lx - 2 * (p->y1 - ly)), to = fmin(p->x1, lx + 2 * (ly - p->y0));
    fprintf(p->file, "<path d=\"M%.1f %.1fL%.1f %.1f\" stroke=\"#999\" stroke-dasharray=\"5 4\"/>\n", plot_x(p, pow(10, from)),
            plot_y(p, pow(10, ly - 0.5 * (from - lx))), plot_x(p, pow(10, to)), plot_y(p, pow(10, ly - 0.5 * (to - lx))));
    plot_name(p, k, "#999", " stroke-dasharray=\"5 4\"", "slope -1/2");
}

static void plot_line(const plot *p, const double *x, const double *y, int count, const char *label, int k)
{
    const char *const stroke = k < 10 ? " stroke-width=\"2\"" : " stroke-width=\"2\" stroke-dasharray=\"3 3\"";
    int i;
    fprintf(p->file, "<polyline fill=\"none\" stroke=\"%s\"%s points=\"", COLOURS[k % 10], stroke);
    for (i = 0; i < count; i++)
        if (y[i] > 0) fprintf(p->file, "%.1f,%.1f ", plot_x(p, x[i]), plot_y(p, y[i]));
    fprintf(p->file, "\"/>\n");
    plot_name(p, k, COLOURS[k % 10], stroke, label);
}

/* Makes the axes hold a point; they end at whole decades. */
static void plot_hold(plot *p, double x, double y)
{
    if (!(x > 0) || !(y > 0)) return;
    p->x0 = fmin(p->x0, floor(log10(x)));
    p->x1 = fmax(p->x1, ceil(log10(x)));
    p->y0 = fmin(p->y0, floor(log10(y)));
    p->y1 = fmax(p->y1, ceil(log10(y)));
}

static int plot_curves(const char *path, const curve *curves, int count)
{
    plot p = {NULL, 1e9, -1e9, 1e9, -1e9};
    double root[MAX_ROWS];
    int k, i;
    if ((p.file = fopen(path, "w")) == NULL) return 0;
    for (k = 0; k < count; k++)
        for (i = 0; i < curves[k].count; i++) plot_hold(&p, curves[k].seconds[i], sqrt(fmax(0, curves[k].relmse[i])));
    if (p.x1 <= p.x0) p.x1 = p.x0 + 1;
    if (p.y1 <= p.y0) p.y1 = p.y0 + 1;
    plot_frame(&p, "CPU seconds", "relative error: square root of relMSE", count + 1);
    for (k = 0; k < count; k++) {
        for (i = 0; i < curves[k].count; i++) root[i] = sqrt(fmax(0, curves[k].relmse[i]));
        if (k == 0 && curves[0].count > 0) plot_slope(&p, curves[0].seconds[0], root[0], count);
        plot_line(&p, curves[k].seconds, root, curves[k].count, curves[k].label, k);
    }
    fprintf(p.file, "</svg>\n");
    return fclose(p.file) == 0;
}

/* ---- pictures ---------------------------------------------------------------------------------------------- */

/* The brightness that fits most of the picture: its mean becomes a middle grey. */
static int write_picture(const job *j, const char *scene, const char *name, const float *rgb, const float *minus, double scale)
{
    const size_t n = (size_t)j->size * (size_t)j->size * 3;
    unsigned char *const bytes = (unsigned char *)malloc(n);
    char path[512];
    size_t i;
    int ok;
    if (!bytes || !rgb) {
        free(bytes);
        return 0;
    }
    for (i = 0; i < n; i++) bytes[i] = pt_srgb_byte(scale * (minus ? fabs((double)rgb[i] - (double)minus[i]) : (double)rgb[i]));
    text_of(path, sizeof path, "%s/%s-%s.png", j->directory, scene, name);
    ok = pt_write_png_bytes(path, bytes, j->size, j->size) == PT_OK;
    free(bytes);
    return ok;
}

/* ---- the page ---------------------------------------------------------------------------------------------- */

static const char *const STYLE =
    "body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}"
    "h2{margin-top:3rem;border-top:1px solid #ccc;padding-top:1rem}"
    "img{max-width:100%;height:auto}table{border-collapse:collapse;font-size:14px}"
    "td,th{padding:.2rem .6rem;text-align:right;border-bottom:1px solid #ddd}td:first-child,th:first-child{text-align:left}"
    ".scroll{overflow-x:auto}.plot img{width:42rem}td{white-space:nowrap}code{overflow-wrap:anywhere}.tiles{display:grid;grid-template-columns:repeat(auto-fill,minmax(17rem,1fr));gap:.8rem 1.2rem}"
    ".tiles figure{margin:0;break-inside:avoid}.tiles img{width:49%;margin-right:1%;image-rendering:pixelated}figcaption{font-size:13px;line-height:1.3}"
    "nav a{margin-right:.8rem;white-space:nowrap}"
    "@media print{body{max-width:none;margin:0;font-size:11px}h2{break-before:page}table{font-size:9px}td,th{padding:.1rem .3rem}"
    ".scroll{overflow:visible}.plot img{width:26rem}.tiles{grid-template-columns:repeat(4,1fr)}figcaption{font-size:9px}}";

/* Text that may hold what HTML reads as its own. */
static void write_escaped(FILE *f, const char *text)
{
    for (; *text; text++)
        if (*text == '<') fputs("&lt;", f);
        else if (*text == '&') fputs("&amp;", f);
        else fputc(*text, f);
}

/* What follows `key` and blanks in a file of lines, where there is such a file; else "". */
static const char *line_of(const char *path, const char *key, char *buffer, int size)
{
    FILE *const f = fopen(path, "r");
    const char *found = "";
    while (f && !*found && fgets(buffer, size, f))
        if (strncmp(buffer, key, strlen(key)) == 0) {
            buffer[strcspn(buffer, "\n")] = 0;
            found = buffer + strlen(key);
            found += strspn(found, " \t:");
        }
    if (f) fclose(f);
    return found;
}

static void write_machine(const job *j)
{
    char buffer[256];
    const char *const machine = line_of("/proc/cpuinfo", "model name", buffer, sizeof buffer);
    fprintf(j->html, "<p>Machine: ");
    write_escaped(j->html, *machine ? machine : "one that does not say its name");
    fprintf(j->html, ", one thread. Compiler: %s. Flags: <code>", COMPILER);
    write_escaped(j->html, j->flags ? j->flags : "not told");
    fprintf(j->html, "</code>.</p>\n<nav>");
}

static void begin_page(const job *j)
{
    int count, i;
    const pt_scene_entry *const scenes = pt_scenes(&count);
    fprintf(j->html,
            "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
            "content=\"width=device-width,initial-scale=1\"><title>Error against run time</title><style>%s</style></head><body>\n"
            "<h1>Error against run time</h1>\n",
            STYLE);
    fprintf(j->html,
            "<p>pathtracer.h %s, %s, %d x %d pixels. Each row of a curve is a render of its own, "
            "with its own random numbers; errors are true ones, against a converged reference whose own error is "
            "subtracted. relMSE is the mean of (I - R)<sup>2</sup> / (R<sup>2</sup> + (0.1 mean luminance of "
            "R)<sup>2</sup>); the estimate of a render, which has no reference, takes I for R, and so sees bright speckles "
            "as less wrong than they are; efficiency is 1 / (relMSE &times; CPU seconds) of the last row, the order is the slope of "
            "the curve with its 95 %% confidence: where that is wide, a few bright speckles decide, and efficiencies are as much "
            "luck. Ratios hold on one machine in one run; absolute seconds do not.</p>\n",
            PT_VERSION_STRING, sizeof(pt_real) == 4 ? "float" : "double", j->size, j->size);
    write_machine(j);
    for (i = 0; i < count; i++)
        if (!j->only_scene || strcmp(j->only_scene, scenes[i].name) == 0)
            fprintf(j->html, "<a href=\"#%s\">%s</a>\n", scenes[i].name, scenes[i].name);
    if (!j->only_scene) fprintf(j->html, "<a href=\"#cost\">cost against size</a>");
    fprintf(j->html, "</nav>\n");
    fprintf(j->csv, "scene,method,sampler,one_net,spp,cpu_seconds,relmse,rmse,estimated_relmse,reference_relmse\n");
}

/* Efficiency of plain path tracing with independent points, to which all others are compared; 0 = not there. */
static double plain_efficiency(const curve *curves, int count)
{
    int k;
    for (k = 0; k < count; k++)
        if (strcmp(curves[k].method->name, "path-plain") == 0 && curves[k].sampler == PT_SAMPLER_INDEPENDENT)
            return curves[k].efficiency;
    return 0;
}

static void write_table(const job *j, const curve *curves, int count, const reference *r)
{
    const double plain = plain_efficiency(curves, count);
    int k;
    fprintf(j->html, "<div class=\"scroll\"><table><tr><th>method, sampler</th><th>body</th><th>spp</th><th>CPU&nbsp;s</th><th>relative "
                     "error</th><th>estimated</th><th>efficiency</th><th>over plain</th><th>order</th><th>mean - "
                     "reference</th></tr>\n");
    for (k = 0; k < count; k++) {
        const curve *const c = &curves[k];
        const int last = c->count - 1;
        if (last < 0) continue;
        fprintf(j->html, "<tr><td>%s</td><td>%s</td><td>%lu</td><td>%.3f</td><td>%.4f</td>", c->label, c->body,
                (unsigned long)c->spp[last], c->seconds[last], sqrt(fmax(0, c->relmse[last])));
        if (c->estimated[last] > 0) fprintf(j->html, "<td>%.4f</td>", sqrt(c->estimated[last]));
        else fprintf(j->html, "<td></td>");
        fprintf(j->html, c->efficiency < 100 ? "<td>%.3g</td>" : "<td>%.0f</td>", c->efficiency);
        if (plain > 0 && c->method->follows) fprintf(j->html, "<td>%.2f</td>", c->efficiency / plain);
        else fprintf(j->html, "<td></td>");
        if (c->order_error > 0 && c->method->follows) fprintf(j->html, "<td>%.2f &plusmn; %.2f</td>", c->order, c->order_error);
        else fprintf(j->html, "<td></td>");
        fprintf(j->html, "<td>%+.2f %%</td></tr>\n", 100 * (c->mean / r->mean - 1));
    }
    fprintf(j->html, "</table></div>\n");
}

static void write_tiles(job *j, const char *scene, const curve *curves, int count, const reference *r)
{
    const double exposure = r->mean > 0 ? 0.25 / r->mean : 1;
    char name[96];
    int k;
    j->failed += !write_picture(j, scene, "reference", r->rgb, NULL, exposure);
    fprintf(j->html, "<p>At about equal time, and beside each picture its error, four times as bright.</p>\n"
                     "<div class=\"tiles\"><figure><img src=\"%s-reference.png\" alt=\"reference\"><figcaption>reference, %lu "
                     "spp</figcaption></figure>\n",
            scene, (unsigned long)pt_film_spp(&r->film));
    for (k = 0; k < count; k++) {
        const curve *const c = &curves[k];
        if (c->count == 0 || c->single_net) continue;
        j->failed += !write_picture(j, scene, c->file, c->picture, NULL, exposure);
        j->failed += !write_picture(j, scene, text_of(name, sizeof name, "%s-error", c->file), c->picture, r->rgb, 4 * exposure);
        fprintf(j->html,
                "<figure><img src=\"%s-%s.png\" alt=\"%s\"><img src=\"%s-%s-error.png\" alt=\"error of %s\">"
                "<figcaption>%s, %.2f s</figcaption></figure>\n",
                scene, c->file, c->label, scene, c->file, c->label, c->label, c->seconds[c->count - 1]);
    }
    fprintf(j->html, "</div>\n");
}

static void write_rows(const job *j, const char *scene, const curve *c, const reference *r)
{
    int i;
    for (i = 0; i < c->count; i++)
        fprintf(j->csv, "%s,%s,%s,%d,%lu,%.6g,%.6g,%.6g,%.6g,%.3g\n", scene, c->method->name, pt_sampler_name(c->sampler),
                c->single_net, (unsigned long)c->spp[i], c->seconds[i], c->relmse[i], c->rmse[i], c->estimated[i], r->relmse);
}

/* How many times the efficiency of two independent half-nets one net for all samples has: mean of the logarithms over all
   sample counts that both have. */
static double price_of_halves(const curve *one, const curve *halves)
{
    double sum = 0;
    int i, n = 0;
    for (i = 0; i < one->count && i < halves->count; i++)
        if (one->relmse[i] > 0 && halves->relmse[i] > 0) {
            sum += log(halves->relmse[i] * halves->seconds[i] / (one->relmse[i] * one->seconds[i]));
            n++;
        }
    return n ? exp(sum / n) : 0;
}

static void write_price(const job *j, const curve *curves, int count)
{
    int k, i;
    for (k = 0; k < count; k++)
        for (i = 0; i < count; i++)
            if (curves[k].single_net && !curves[i].single_net && curves[i].method == curves[k].method &&
                curves[i].sampler == curves[k].sampler && curves[i].efficiency > 0)
                fprintf(j->html,
                        "<p>The price of independent half-nets: one net for all samples, which cannot tell its own error, has "
                        "%.2f times the efficiency, in the mean over all sample counts.</p>\n",
                        price_of_halves(&curves[k], &curves[i]));
}

/* ---- cost against size --------------------------------------------------------------------------------------- */

enum { RAYS = 200000, SIZES = 6, TREES = 2, DEPTHS = 7 };

/* What the tree costs that pt_commit makes. */
typedef struct growth {
    double build[SIZES], ray[SIZES], shadow[SIZES]; /* CPU seconds; nanoseconds a ray                      */
    double bytes[SIZES];         /* a triangle                                                             */
} growth;

/* A bumpy torus of 2 u v triangles, u = 4 v. */
static int add_torus(pt_scene *scene, uint32_t u, uint32_t v)
{
    const int m = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey((pt_real)0.5)));
    pt_vec3 *const corner = (pt_vec3 *)malloc((size_t)u * v * sizeof *corner);
    uint32_t *const index = (uint32_t *)malloc((size_t)u * v * 6 * sizeof *index);
    uint32_t i, j, n = 0;
    int ok;
    for (i = 0; corner && i < u; i++)
        for (j = 0; j < v; j++) {
            const double a = 2 * PT_PI * i / u, b = 2 * PT_PI * j / v, r = 0.4 + 0.05 * sin(9 * a) * sin(5 * b);
            corner[i * v + j] = pt_v3((pt_real)((1 + r * cos(b)) * cos(a)), (pt_real)(r * sin(b)), (pt_real)((1 + r * cos(b)) * sin(a)));
        }
    for (i = 0; index && i < u; i++)
        for (j = 0; j < v; j++) {
            const uint32_t right = (i + 1) % u * v, up = (j + 1) % v, quad[6] = {i * v + j, right + j, right + up, i * v + j, right + up, i * v + up};
            memcpy(index + n, quad, sizeof quad);
            n += 6;
        }
    ok = corner && index && pt_add_mesh(scene, corner, NULL, NULL, u * v, index, 2 * u * v, m) >= 0;
    free(corner);
    free(index);
    return ok;
}

/* Rays between random points of a sphere about the torus. */
static pt_ray *make_rays(void)
{
    pt_ray *const ray = (pt_ray *)malloc(RAYS * sizeof *ray);
    pt_pcg32 rng = pt_pcg32_make(77, 7);
    int i, k;
    for (i = 0; ray && i < RAYS; i++) {
        pt_real u[4];
        for (k = 0; k < 4; k++) u[k] = (pt_real)pt_pcg32_double(&rng);
        ray[i].o = pt_v3_scale(pt_warp_sphere(pt_v2(u[0], u[1])), 2);
        ray[i].d = pt_v3_normalize(pt_v3_sub(pt_v3_scale(pt_warp_sphere(pt_v2(u[2], u[3])), 2), ray[i].o));
        ray[i].tmax = (pt_real)1e30;
    }
    return ray;
}

/* A ray's cost, repeated for a fifth of a second; any: any hit is asked for, not the nearest. */
static double nanoseconds(const pt_scene *scene, const pt_ray *ray, int any)
{
    const double start = pt_cpu_seconds();
    double seconds, traced = 0;
    volatile int hits = 0;
    pt_hit hit;
    int i;
    do {
        for (i = 0; i < RAYS; i++) hits = hits + (any ? pt_occluded(scene, &ray[i]) : pt_intersect(scene, &ray[i], &hit));
        traced += RAYS;
        seconds = pt_cpu_seconds() - start;
    } while (seconds < 0.2);
    return 1e9 * seconds / traced;
}

/* Memory of the tree that rays walk. */
static double bytes_of_tree(const pt_scene *scene, pt_tree tree)
{
#if PTI_HAS_WIDE
    if (tree == PT_TREE_DEFAULT) return (double)scene->wide.bytes;
#endif
    (void)tree;
    return (double)scene->bvh.node_count * (double)sizeof *scene->bvh.nodes + (double)scene->primitive_count * (double)sizeof *scene->bvh.order;
}

/* One mesh with one tree; 0 if there was no memory for it. */
static int grow_mesh(job *j, uint32_t v, pt_tree tree, const pt_ray *ray, growth *g, int k)
{
    const char *const name = tree == PT_TREE_BINARY ? "binary" : "wide";
    const double count = 8.0 * v * v;
    pt_scene scene = PT_SCENE_INIT;
    double start;
    int ok;
    scene.tree = tree;
    scene.threads = 1;
    ok = add_torus(&scene, 4 * v, v);
    start = pt_cpu_seconds();
    ok = ok && pt_commit(&scene) == PT_OK;
    if (ok) {
        g->build[k] = pt_cpu_seconds() - start;
        g->bytes[k] = bytes_of_tree(&scene, tree) / count;
        g->ray[k] = nanoseconds(&scene, ray, 0);
        g->shadow[k] = nanoseconds(&scene, ray, 1);
        fprintf(j->cost, "build,%.0f,%s,%.6g,CPU s\n", count, name, g->build[k]);
        fprintf(j->cost, "tree,%.0f,%s,%.6g,bytes a triangle\n", count, name, g->bytes[k]);
        fprintf(j->cost, "nearest hit,%.0f,%s,%.6g,ns\n", count, name, g->ray[k]);
        fprintf(j->cost, "any hit,%.0f,%s,%.6g,ns\n", count, name, g->shadow[k]);
        fprintf(stderr, "%8.0f triangles, %-6s tree: built in %.3f s, %.0f ns a nearest hit\n", count, name, g->build[k], g->ray[k]);
    }
    pt_scene_free(&scene);
    return ok;
}

/* 10^2 to 10^7 triangles, as close as 8 v^2 comes. */
static void grow_meshes(job *j, double *count, growth *g)
{
    pt_ray *const ray = make_rays();
    int k;
    for (k = 0; ray && k < SIZES; k++) {
        const uint32_t v = (uint32_t)(sqrt(pow(10, k + 2) / 8) + 0.5);
        count[k] = 8.0 * v * v;
        j->failed += !grow_mesh(j, v, PT_TREE_DEFAULT, ray, &g[0], k);
        j->failed += !grow_mesh(j, v, PT_TREE_BINARY, ray, &g[1], k);
    }
    j->failed += !ray;
    free(ray);
}

static int plot_pairs(const char *path, const double *x, const double *const *y, const char *const *labels, int lines, int rows,
                      const char *x_title, const char *y_title)
{
    plot p = {NULL, 1e9, -1e9, 1e9, -1e9};
    int k, i;
    if ((p.file = fopen(path, "w")) == NULL) return 0;
    for (k = 0; k < lines; k++)
        for (i = 0; i < rows; i++) plot_hold(&p, x[i], y[k][i]);
    if (p.x1 <= p.x0) p.x1 = p.x0 + 1;
    if (p.y1 <= p.y0) p.y1 = p.y0 + 1;
    plot_frame(&p, x_title, y_title, lines);
    for (k = 0; k < lines; k++) plot_line(&p, x, y[k], rows, labels[k], k);
    fprintf(p.file, "</svg>\n");
    return fclose(p.file) == 0;
}

/* CPU seconds of a picture of 4 samples whose paths end after so many edges; 0: it could not be rendered. */
static double seconds_of_edges(const job *j, const pt_scene *scene, const pt_camera *camera, int edges, int one_at_a_time,
                               const char **body)
{
    pt_render_desc desc = desc_of(j, camera, "path", 5);
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    double seconds = 0;
    desc.spp = 4;
    desc.li.max_edges = edges;
    desc.li.roulette = PT_ROULETTE_NONE;
    desc.no_lockstep = one_at_a_time;
    if (pt_render(scene, &desc, &film, &report) == PT_OK) seconds = report.cpu_seconds;
    *body = report.body;
    pt_report_free(&report);
    pt_film_free(&film);
    return seconds;
}

/* Nanoseconds a path: the least of three pictures, since what else the machine does only adds. */
static double cost_of_edges(job *j, const pt_scene_entry *entry, int edges, int one_at_a_time)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    const char *body = "";
    double least = 0;
    int k;
    if (entry->make(&scene, &camera) == PT_OK)
        for (k = 0; k < 3; k++) {
            const double seconds = seconds_of_edges(j, &scene, &camera, edges, one_at_a_time, &body);
            least = k == 0 ? seconds : fmin(least, seconds);
        }
    least *= 1e9 / (4.0 * j->size * j->size);
    if (least > 0) fprintf(j->cost, "path of at most so many edges in %s,%d,%s,%.6g,ns\n", entry->name, edges, body, least);
    else j->failed++;
    pt_scene_free(&scene);
    return least;
}

/* A closed box, whose walls let every path go on, and one that paths leave by its open side. */
static void cost_of_depth(job *j)
{
    double edges[DEPTHS], cost[4][DEPTHS];
    const double *const lines[4] = {cost[0], cost[1], cost[2], cost[3]};
    const char *const labels[4] = {"furnace, as it is rendered", "furnace, one at a time", "cornell, as it is rendered",
                                   "cornell, one at a time"};
    char path[512];
    int k, i;
    for (k = 0; k < DEPTHS; k++) {
        edges[k] = 1 << k;
        for (i = 0; i < 4; i++) cost[i][k] = cost_of_edges(j, pt_scene_find(i < 2 ? "furnace" : "cornell"), 1 << k, i % 2);
    }
    j->failed += !plot_pairs(text_of(path, sizeof path, "%s/cost-depth.svg", j->directory), edges, lines, labels, 4, DEPTHS,
                             "longest path, edges", "nanoseconds a path");
}

static void write_cost(const job *j, const growth *g, double seconds)
{
    char buffer[256];
    const char *const memory = line_of("/proc/self/status", "VmHWM", buffer, sizeof buffer);
    fprintf(j->html, "<h2 id=\"cost\">Cost against size</h2>\n<p>A bumpy torus of 10<sup>2</sup> to 10<sup>7</sup> triangles, "
                     "%d rays between random points of a sphere about it, by the wide tree, which is the default, and by the "
                     "binary one, which finds the same hits; and longer and longer paths without roulette, in a closed box and "
                     "in the Cornell box, which they leave by its open side. One thread; all of this took %.0f CPU seconds",
            RAYS, seconds);
    if (*memory) fprintf(j->html, " and at most %.1f GiB of memory", strtod(memory, NULL) / 1048576);
    fprintf(j->html, ".</p>\n<h3>Rays</h3>\n<div class=\"plot\"><img src=\"cost-rays.svg\" alt=\"nanoseconds a ray against "
                     "triangles\"></div>\n<h3>Building</h3>\n<p>With 10<sup>7</sup> triangles the wide tree takes %.0f bytes a triangle, the "
                     "binary one %.0f.</p>\n<div class=\"plot\"><img src=\"cost-build.svg\" alt=\"seconds to "
                     "build against triangles\"></div>\n<h3>Depth</h3>\n<div class=\"plot\"><img src=\"cost-depth.svg\" "
                     "alt=\"nanoseconds a path against its longest length\"></div>\n",
            g[0].bytes[SIZES - 1], g[1].bytes[SIZES - 1]);
}

static void cost_of_size(job *j)
{
    static double count[SIZES];
    static growth g[TREES];
    const double *const rays[4] = {g[0].ray, g[0].shadow, g[1].ray, g[1].shadow}, *const builds[2] = {g[0].build, g[1].build};
    const char *const ray_labels[4] = {"nearest hit, wide tree", "any hit, wide tree", "nearest hit, binary", "any hit, binary"};
    const char *const build_labels[2] = {"wide tree", "binary tree"};
    const double start = pt_cpu_seconds();
    char path[512];
    j->cost = fopen(text_of(path, sizeof path, "%s/cost.csv", j->directory), "w");
    if (!j->cost) {
        j->failed++;
        return;
    }
    fprintf(j->cost, "what,size,by,value,unit\n");
    grow_meshes(j, count, g);
    cost_of_depth(j);
    j->failed += fclose(j->cost) != 0;
    j->failed += !plot_pairs(text_of(path, sizeof path, "%s/cost-rays.svg", j->directory), count, rays, ray_labels, 4, SIZES,
                             "triangles", "nanoseconds a ray");
    j->failed += !plot_pairs(text_of(path, sizeof path, "%s/cost-build.svg", j->directory), count, builds, build_labels, 2, SIZES,
                             "triangles", "CPU seconds to build");
    write_cost(j, g, pt_cpu_seconds() - start);
}

/* ---- all --------------------------------------------------------------------------------------------------- */

static void one_scene(job *j, const pt_scene_entry *entry)
{
    static curve curves[MAX_CURVES];
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    reference r;
    char text[640], needs[512];
    int count = 0, k;
    memset(&r, 0, sizeof r);
    if (entry->make(&scene, &camera) != PT_OK || make_reference(j, &scene, &camera, entry->name, &r) != PT_OK ||
        second_opinion(j, &scene, &camera, &r) != PT_OK) {
        fprintf(stderr, "report: %s could not be rendered\n", entry->name);
        j->failed++;
    } else {
        count = list_curves(j, curves);
        for (k = 0; k < count; k++) {
            while (add_row(j, &scene, &camera, &r, &curves[k])) {}
            fit_order(&curves[k]);
            write_rows(j, entry->name, &curves[k], &r);
            fprintf(stderr, "%-16s %-28s %7lu spp  %8.3f s  error %.4f\n", entry->name, curves[k].label,
                    curves[k].count ? (unsigned long)curves[k].spp[curves[k].count - 1] : 0ul,
                    curves[k].count ? curves[k].seconds[curves[k].count - 1] : 0,
                    curves[k].count ? sqrt(fmax(0, curves[k].relmse[curves[k].count - 1])) : 0);
        }
        describe_reference(&r, text, sizeof text);
        fprintf(j->html, "<h2 id=\"%s\">%s</h2>\n<p>%s. It needs: %s. Reference: %lu spp, relative error %.2g. %s</p>\n",
                entry->name, entry->name, entry->summary, pt_scene_needs_string(&scene, needs, sizeof needs),
                (unsigned long)pt_film_spp(&r.film), sqrt(r.relmse), text);
        text_of(text, sizeof text, "%s/%s.svg", j->directory, entry->name);
        j->failed += !plot_curves(text, curves, count);
        fprintf(j->html, "<div class=\"plot\"><img src=\"%s.svg\" alt=\"error against CPU seconds, log-log\"></div>\n", entry->name);
        write_table(j, curves, count, &r);
        write_price(j, curves, count);
        write_tiles(j, entry->name, curves, count, &r);
    }
    for (k = 0; k < count; k++) free(curves[k].picture);
    free(r.rgb);
    pt_film_free(&r.film);
    pt_scene_free(&scene);
}

static int parse(job *j, int argc, char **argv)
{
    int i, count;
    double total = 60;
    (void)pt_scenes(&count);
    j->directory = argc > 1 ? argv[1] : NULL;
    j->size = 64;
    for (i = 2; i + 1 < argc; i += 2) {
        if (strcmp(argv[i], "--seconds") == 0) total = strtod(argv[i + 1], NULL);
        else if (strcmp(argv[i], "--scene") == 0) j->only_scene = argv[i + 1];
        else if (strcmp(argv[i], "--method") == 0) j->only_method = argv[i + 1];
        else if (strcmp(argv[i], "--flags") == 0) j->flags = argv[i + 1];
        else if (strcmp(argv[i], "--size") == 0) j->size = (int)strtol(argv[i + 1], NULL, 10);
        else return 0;
    }
    if (j->only_scene && !pt_scene_find(j->only_scene)) return 0;
    if (j->only_method && !pt_method_find(j->only_method)) return 0;
    if (j->only_scene) count = 1;
    j->reference_seconds = 0.4 * total / count;
    j->seconds = 0.4 * total / count / 14; /* curves of a scene; each takes about as long as it is given */
    return j->directory && i == argc && total > 0 && j->size >= 8 && j->size <= 1024;
}

int main(int argc, char **argv)
{
    static job j;
    char path[512];
    int count, i;
    const pt_scene_entry *const scenes = pt_scenes(&count);
    if (!parse(&j, argc, argv)) {
        fprintf(stderr, "usage: report DIRECTORY [--seconds S] [--scene NAME] [--method NAME] [--size N] [--flags TEXT]\n");
        return 2;
    }
    j.html = fopen(text_of(path, sizeof path, "%s/index.html", j.directory), "w");
    j.csv = fopen(text_of(path, sizeof path, "%s/error_vs_time.csv", j.directory), "w");
    if (!j.html || !j.csv) {
        fprintf(stderr, "report: cannot write into '%s'\n", j.directory);
        return 1;
    }
    begin_page(&j);
    for (i = 0; i < count; i++)
        if (!j.only_scene || strcmp(j.only_scene, scenes[i].name) == 0) one_scene(&j, &scenes[i]);
    if (!j.only_scene) cost_of_size(&j);
    fprintf(j.html, "</body></html>\n");
    j.failed += fclose(j.html) != 0;
    j.failed += fclose(j.csv) != 0;
    if (j.failed == 0) printf("wrote %s/index.html\n", j.directory);
    return j.failed != 0;
}
