/* render.c - renders a canonical scene from the command line, and says how wrong the picture still is.

   build:  cc -O2 -I. examples/render.c -o render -lm -pthread
   run:    ./render cornell --spp 64 -o cornell.png

   Prints the table of error against run time on stdout; progress, warnings and errors go to stderr.
   Exit status: 0 the pictures are written, 1 something could not be done, 2 the command line is wrong,
   130 interrupted by Ctrl-C (what was finished by then is written). */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <ctype.h>
#include <errno.h>
#include <signal.h>
#include <stdlib.h>

/* C99 cannot ask whether stderr is a terminal; these systems can. */
#if defined(_WIN32)
#include <io.h>
#define STDERR_IS_TERMINAL() (_isatty(_fileno(stderr)) != 0)
#elif defined(__unix__) || defined(__APPLE__)
#include <unistd.h>
#define STDERR_IS_TERMINAL() (isatty(2) != 0)
#else
#define STDERR_IS_TERMINAL() 0
#endif

enum { EXIT_OK = 0, EXIT_FAILED = 1, EXIT_USAGE = 2, EXIT_INTERRUPTED = 130 };
enum { MAX_OUTPUTS = 16 };

/* How progress is shown: one line that is overwritten, or a new line now and then for a log file. */
typedef enum progress_style { PROGRESS_AUTO = 0, PROGRESS_LINE, PROGRESS_PLAIN, PROGRESS_OFF } progress_style;

typedef struct tool {
    const char *scene_name;
    pt_render_desc desc;
    double exposure;
    const char *outputs[MAX_OUTPUTS];
    int output_count;
    const char *csv, *svg;
    char default_output[64];
    int verbose;
    progress_style style;
    double last_shown;     /* wall seconds at which progress was last shown                               */
    int line_length;       /* characters of the progress line that stand on the terminal                  */
    pt_lpe lpe;             /* of --only */
} tool;

/* ---- Ctrl-C ---------------------------------------------------------------------------------------- */

static volatile sig_atomic_t interrupted = 0;

/* The first Ctrl-C asks the render to stop; the second one ends the program as usual. */
static void on_interrupt(int number)
{
    interrupted = 1;
    signal(number, SIG_DFL);
}

/* ---- the command line ------------------------------------------------------------------------------ */

static void print_help(void)
{
    fputs("usage: render [SCENE] [options]    renders a canonical scene (default: cornell)\n"
          "  -o FILE           picture: .png, .ppm, .pfm (linear floats); may be repeated;\n"
          "                    default: SCENE.png\n"
          "  --size WxH        pixels (256x256)\n"
          "  --spp N           samples per pixel (64; no limit with one of the next three)\n"
          "  --seconds S       stop after S seconds of wall time, at the end of a pass\n"
          "  --cpu-seconds S   ... of CPU time, all threads together\n"
          "  --error E         stop when the estimated relative error is below E (0.05)\n"
          "  --method NAME     rendering method (path); see --list\n"
          "  --sampler NAME    sobol (default), independent, stratified (needs --spp only)\n"
          "  --filter NAME     pixel filter: box (default), tent, gaussian\n"
          "  --only WORDS      only light along such paths, as 'LS+DE' or 'L(S|D)*DDE': a light-path\n"
          "                    expression over L D G S V E\n"
          "  --branching N     directions per hit of method branching (4)\n"
          "  --seed N          other random numbers (0)\n"
          "  --max-edges N     longest path: 1 lights seen, 2 direct light, ... (no limit)\n"
          "  --roulette R      throughput (default), none, or a survival probability\n"
          "  --threads N       (0: as many as the machine has); same picture for any N\n"
          "  --exposure X      factor of the brightness in .png and .ppm (1)\n"
          "  --csv FILE        error against run time as a table\n"
          "  --svg FILE        ... as a plot\n"
          "  --progress STYLE  line, plain (new lines), off (default: line on a terminal)\n"
          "  --verbose         also says what the scene holds and needs\n"
          "  --list            scenes, methods and samplers\n"
          "  --help            this text                  Ctrl-C keeps the finished passes\n",
          stdout);
}

static void print_list(void)
{
    int count, i;
    const pt_scene_entry *scenes = pt_scenes(&count);
    const pt_method *methods;

    printf("scenes:\n");
    for (i = 0; i < count; i++) printf("  %-18s %s\n", scenes[i].name, scenes[i].summary);
    methods = pt_methods(&count);
    printf("methods (the first is the default):\n");
    for (i = 0; i < count; i++) printf("  %-18s %s\n", methods[i].name, methods[i].summary);
    printf("samplers (the first is the default):\n");
    for (i = PT_SAMPLER_SOBOL; i < PT_SAMPLER_GIVEN; i++)
        printf("  %s\n", pt_sampler_name((pt_sampler_kind)i));
}

/* One line on stderr that names what was wrong; for returning from an option's function. */
static int bad_value(const char *option, const char *value, const char *wanted)
{
    fprintf(stderr, "render: %s '%s': must be %s\n", option, value, wanted);
    return EXIT_USAGE;
}

/* A decimal number, nothing before or after it, not above `high`: 1 and *out, else 0. Written with
   strtoull alone, "-1" would be a large number and " 7" would pass. */
static int parse_whole(const char *text, uint64_t high, uint64_t *out)
{
    char *end;
    unsigned long long v;

    if (!isdigit((unsigned char)text[0])) return 0;
    errno = 0;
    v = strtoull(text, &end, 10);
    if (*end != '\0' || errno == ERANGE || v > high) return 0;
    *out = v;
    return 1;
}

/* A decimal floating-point number, low < x <= high; no "inf", "nan" or hexadecimal. */
static int parse_real(const char *text, double low, double high, double *out)
{
    char *end;
    double v;

    if (text[0] == '\0' || text[strspn(text, "0123456789+-.eE")] != '\0') return 0;
    v = strtod(text, &end);
    if (*end != '\0' || !(v > low && v <= high)) return 0;
    *out = v;
    return 1;
}

/* The file name's extension in lower case without the dot, "" if there is none. */
static void extension_of(const char *path, char out[8])
{
    const char *dot = strrchr(path, '.');
    size_t i = 0;

    if (dot && !strpbrk(dot, "/\\")) {
        for (dot++; dot[i] && i < 7; i++) out[i] = (char)tolower((unsigned char)dot[i]);
        if (dot[i]) i = 0;
    }
    out[i] = '\0';
}

/* One option with a value each. They return EXIT_OK or EXIT_USAGE. */
typedef int (*option_fn)(tool *t, const char *name, const char *value);

static int set_output(tool *t, const char *name, const char *value)
{
    char ext[8];

    extension_of(value, ext);
    if (strcmp(ext, "png") != 0 && strcmp(ext, "ppm") != 0 && strcmp(ext, "pfm") != 0)
        return bad_value(name, value, "a file name that ends in .png, .ppm or .pfm");
    if (t->output_count == MAX_OUTPUTS) return bad_value(name, value, "one of at most 16 pictures");
    t->outputs[t->output_count++] = value;
    return EXIT_OK;
}

static int set_size(tool *t, const char *name, const char *value)
{
    char width[8] = "";
    const char *x = strchr(value, 'x');
    uint64_t w, h;

    if (x && x - value < (ptrdiff_t)sizeof width) memcpy(width, value, (size_t)(x - value));
    if (!x || !parse_whole(width, 65536, &w) || !parse_whole(x + 1, 65536, &h) || w == 0 || h == 0)
        return bad_value(name, value, "WxH with both in 1..65536, such as 640x480");
    t->desc.width = (int)w;
    t->desc.height = (int)h;
    return EXIT_OK;
}

static int set_spp(tool *t, const char *name, const char *value)
{
    uint64_t n;

    if (!parse_whole(value, UINT32_MAX - 1, &n) || n == 0) return bad_value(name, value, "in 1..4294967294");
    t->desc.spp = (uint32_t)n;
    return EXIT_OK;
}

static int set_seconds(tool *t, const char *name, const char *value)
{
    int ok = parse_real(value, 0, 1e9, &t->desc.seconds);

    return ok ? EXIT_OK : bad_value(name, value, "in (0, 1e9]");
}

static int set_cpu_seconds(tool *t, const char *name, const char *value)
{
    int ok = parse_real(value, 0, 1e9, &t->desc.cpu_seconds);

    return ok ? EXIT_OK : bad_value(name, value, "in (0, 1e9]");
}

static int set_error(tool *t, const char *name, const char *value)
{
    int ok = parse_real(value, 0, 1e6, &t->desc.target_error);

    return ok ? EXIT_OK : bad_value(name, value, "above 0, such as 0.05");
}

static int set_method(tool *t, const char *name, const char *value)
{
    t->desc.method = value;
    return pt_method_find(value) ? EXIT_OK : bad_value(name, value, "the name of a method; see --list");
}

static int set_sampler(tool *t, const char *name, const char *value)
{
    int i;

    for (i = PT_SAMPLER_SOBOL; i < PT_SAMPLER_GIVEN; i++)
        if (strcmp(value, pt_sampler_name((pt_sampler_kind)i)) == 0) {
            t->desc.sampler = (pt_sampler_kind)i;
            return EXIT_OK;
        }
    return bad_value(name, value, "the name of a sampler; see --list");
}

static int set_filter(tool *t, const char *name, const char *value)
{
    static const char *const names[3] = {"box", "tent", "gaussian"};
    int i;

    for (i = 0; i < 3; i++)
        if (strcmp(value, names[i]) == 0) {
            t->desc.filter = (pt_filter)i;
            return EXIT_OK;
        }
    return bad_value(name, value, "box, tent or gaussian");
}

static int set_only(tool *t, const char *name, const char *value)
{
    const char *why;

    if (pt_lpe_compile(&t->lpe, &value, 1, &why) == PT_OK) {
        t->desc.li.lpe = &t->lpe;
        return EXIT_OK;
    }
    fprintf(stderr, "render: %s '%s': %s\n", name, value, why);
    return EXIT_USAGE;
}

static int set_branching(tool *t, const char *name, const char *value)
{
    uint64_t n;

    if (!parse_whole(value, 1024, &n) || n < 1) return bad_value(name, value, "in 1..1024");
    t->desc.li.branching = (int)n;
    return EXIT_OK;
}

static int set_seed(tool *t, const char *name, const char *value)
{
    int ok = parse_whole(value, UINT64_MAX, &t->desc.seed);

    return ok ? EXIT_OK : bad_value(name, value, "a whole number below 2^64");
}

static int set_max_edges(tool *t, const char *name, const char *value)
{
    uint64_t n;

    if (!parse_whole(value, INT32_MAX, &n)) return bad_value(name, value, "a whole number, 0 for no limit");
    t->desc.li.max_edges = (int)n;
    return EXIT_OK;
}

static int set_roulette(tool *t, const char *name, const char *value)
{
    double p = 0;

    if (strcmp(value, "throughput") == 0) {
        t->desc.li.roulette = PT_ROULETTE_THROUGHPUT;
    } else if (strcmp(value, "none") == 0) {
        t->desc.li.roulette = PT_ROULETTE_NONE;
    } else if (parse_real(value, 0, 1, &p) && (pt_real)p > 0 && (pt_real)p < 1) {
        t->desc.li.roulette = PT_ROULETTE_CONSTANT;
        t->desc.li.roulette_survival = (pt_real)p;
    } else {
        return bad_value(name, value, "throughput, none, or a probability between 0 and 1");
    }
    return EXIT_OK;
}

static int set_threads(tool *t, const char *name, const char *value)
{
    uint64_t n;

    if (!parse_whole(value, 1024, &n)) return bad_value(name, value, "in 0..1024 (0: all)");
    t->desc.threads = (int)n;
    return EXIT_OK;
}

static int set_exposure(tool *t, const char *name, const char *value)
{
    return parse_real(value, 0, 1e30, &t->exposure) ? EXIT_OK : bad_value(name, value, "a factor above 0");
}

static int set_csv(tool *t, const char *name, const char *value)
{
    t->csv = value;
    return value[0] ? EXIT_OK : bad_value(name, value, "a file name");
}

static int set_svg(tool *t, const char *name, const char *value)
{
    t->svg = value;
    return value[0] ? EXIT_OK : bad_value(name, value, "a file name");
}

static int set_progress(tool *t, const char *name, const char *value)
{
    if (strcmp(value, "line") == 0) t->style = PROGRESS_LINE;
    else if (strcmp(value, "plain") == 0) t->style = PROGRESS_PLAIN;
    else if (strcmp(value, "off") == 0) t->style = PROGRESS_OFF;
    else return bad_value(name, value, "line, plain or off");
    return EXIT_OK;
}

static const struct {
    const char *name;
    option_fn set;
} options[] = {
    {"-o", set_output},           {"--size", set_size},           {"--spp", set_spp},
    {"--seconds", set_seconds},   {"--cpu-seconds", set_cpu_seconds}, {"--error", set_error},
    {"--method", set_method},     {"--sampler", set_sampler},     {"--seed", set_seed},
    {"--max-edges", set_max_edges}, {"--roulette", set_roulette}, {"--threads", set_threads},
    {"--exposure", set_exposure}, {"--csv", set_csv},             {"--svg", set_svg},
    {"--progress", set_progress}, {"--filter", set_filter},       {"--only", set_only},
    {"--branching", set_branching},
};

/* Takes one option: "--name value", or "--name=value" for the long ones. Moves *i to the last argument that
   it used. */
static int take_option(tool *t, int argc, char **argv, int *i)
{
    char *arg = argv[*i];
    char *equals = strncmp(arg, "--", 2) == 0 ? strchr(arg, '=') : NULL;
    size_t length = equals ? (size_t)(equals - arg) : strlen(arg), k;

    for (k = 0; k < sizeof options / sizeof options[0]; k++) {
        const char *name = options[k].name;
        if (strlen(name) != length || strncmp(name, arg, length) != 0) continue;
        if (equals) return options[k].set(t, name, equals + 1);
        if (*i + 1 == argc) {
            fprintf(stderr, "render: %s needs a value; see --help\n", name);
            return EXIT_USAGE;
        }
        return options[k].set(t, name, argv[++*i]);
    }
    fprintf(stderr, "render: there is no option '%s'; see --help\n", arg);
    return EXIT_USAGE;
}

static int take_scene_name(tool *t, const char *name)
{
    if (t->scene_name) {
        fprintf(stderr, "render: '%s': one scene at a time, and it is %s already\n", name, t->scene_name);
        return EXIT_USAGE;
    }
    if (!pt_scene_find(name)) {
        fprintf(stderr, "render: there is no scene '%s'; see --list\n", name);
        return EXIT_USAGE;
    }
    t->scene_name = name;
    return EXIT_OK;
}

/* What single options cannot see, and the defaults that depend on them. */
static int finish_options(tool *t)
{
    if (t->desc.li.roulette == PT_ROULETTE_NONE && t->desc.li.max_edges == 0) {
        fprintf(stderr, "render: --roulette none: needs --max-edges, or no path would ever end\n");
        return EXIT_USAGE;
    }
    if (t->desc.sampler == PT_SAMPLER_STRATIFIED &&
        (t->desc.seconds > 0 || t->desc.cpu_seconds > 0 || t->desc.target_error > 0)) {
        fprintf(stderr, "render: --sampler stratified: needs a known number of samples; "
                        "drop --seconds, --cpu-seconds and --error\n");
        return EXIT_USAGE;
    }
    if (!t->scene_name) t->scene_name = "cornell";
    if (t->output_count == 0) {
        snprintf(t->default_output, sizeof t->default_output, "%s.png", t->scene_name);
        t->outputs[t->output_count++] = t->default_output;
    }
    if (t->style == PROGRESS_AUTO) t->style = STDERR_IS_TERMINAL() ? PROGRESS_LINE : PROGRESS_PLAIN;
    return EXIT_OK;
}

/* Fills the tool from the arguments. *done: nothing is left to do (--help, --list). */
static int parse_arguments(tool *t, int argc, char **argv, int *done)
{
    int i, status;

    for (i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
            print_help();
            *done = 1;
            return EXIT_OK;
        }
        if (strcmp(argv[i], "--list") == 0) {
            print_list();
            *done = 1;
            return EXIT_OK;
        }
        if (strcmp(argv[i], "--verbose") == 0) t->verbose = 1;
        else if ((status = argv[i][0] == '-' ? take_option(t, argc, argv, &i)
                                             : take_scene_name(t, argv[i])) != EXIT_OK)
            return status;
    }
    return finish_options(t);
}

/* ---- progress -------------------------------------------------------------------------------------- */

static void format_time_left(char *out, size_t size, double seconds)
{
    if (seconds < 0 || seconds > 1000 * 3600.0) out[0] = '\0'; /* not known, or nothing that one waits for */
    else if (seconds < 100) snprintf(out, size, "  %.1f s left", seconds);
    else if (seconds < 100 * 60) snprintf(out, size, "  %.0f min left", seconds / 60);
    else snprintf(out, size, "  %.0f h left", seconds / 3600);
}

/* "12.5 of 64 samples  3.42 M rays/s  error 4.1 %  6.2 s left", without what is not known yet. */
static int format_progress(char *out, size_t size, const pt_progress *p)
{
    char goal[32] = "", error[32] = "", left[32];

    if (p->spp_target > 0) snprintf(goal, sizeof goal, " of %.0f", p->spp_target);
    if (p->relmse >= 0) snprintf(error, sizeof error, "  error %.3g %%", 100 * sqrt(p->relmse));
    format_time_left(left, sizeof left, p->seconds_left);
    return snprintf(out, size, "%.1f%s samples  %.2f M rays/s%s%s", p->spp, goal, 1e-6 * p->rays_per_second,
                    error, left);
}

/* Called by the renderer about ten times a second, from one thread at a time. Non-zero stops it. */
static int show_progress(void *user, const pt_progress *p)
{
    tool *t = (tool *)user;
    double now = pt_wall_seconds();
    char line[160];
    int length;

    if (t->style != PROGRESS_OFF && (t->style == PROGRESS_LINE || now - t->last_shown >= 2)) {
        length = format_progress(line, sizeof line, p);
        t->last_shown = now;
        if (t->style == PROGRESS_LINE) fprintf(stderr, "\r%-*s", t->line_length, line);
        else fprintf(stderr, "%s\n", line);
        fflush(stderr);
        t->line_length = length;
    }
    return interrupted != 0;
}

/* Wipes the progress line, so that what follows starts on a clean one. */
static void end_progress(const tool *t)
{
    if (t->style == PROGRESS_LINE && t->line_length > 0) fprintf(stderr, "\r%*s\r", t->line_length, "");
}

/* ---- before and after the render ------------------------------------------------------------------- */

/* Can this file be written? Found out before the work, not after it; an existing file stays as it is. */
static int is_writable(const char *path)
{
    FILE *f = fopen(path, "rb");
    int exists = f != NULL;

    if (f) fclose(f);
    f = fopen(path, exists ? "r+b" : "wb");
    if (!f) {
        fprintf(stderr, "render: cannot write '%s': %s\n", path, strerror(errno));
        return 0;
    }
    fclose(f);
    if (!exists) remove(path);
    return 1;
}

static int all_writable(const tool *t)
{
    int i;

    for (i = 0; i < t->output_count; i++)
        if (!is_writable(t->outputs[i])) return 0;
    return (!t->csv || is_writable(t->csv)) && (!t->svg || is_writable(t->svg));
}

/* What the scene holds (--verbose), and what the method will not show of it. */
static void describe_scene(const tool *t, const pt_scene *scene)
{
    char words[256];
    int count;
    const pt_method *method = t->desc.method ? pt_method_find(t->desc.method) : pt_methods(&count);

    if (t->verbose)
        fprintf(stderr, "scene %s: %u primitives, %u lights; needs %s\n", t->scene_name,
                (unsigned)scene->primitive_count, (unsigned)scene->light_count,
                pt_scene_needs_string(scene, words, sizeof words));
    if (method && (pt_scene_needs(scene) & ~method->handles) != 0)
        fprintf(stderr, "render: warning: method %s cannot show all of scene %s: %s\n", method->name,
                t->scene_name, method->summary);
}

static pt_result write_picture(const char *path, const pt_film *film, double exposure)
{
    char ext[8];

    extension_of(path, ext);
    if (strcmp(ext, "pfm") == 0) return pt_write_pfm(path, film);
    return strcmp(ext, "ppm") == 0 ? pt_write_ppm(path, film, exposure) : pt_write_png(path, film, exposure);
}

/* Says what became of a file; 1 if it was written. */
static int tell_written(const char *path, pt_result result)
{
    if (result == PT_OK) fprintf(stderr, "wrote %s\n", path);
    else fprintf(stderr, "render: cannot write '%s': %s\n", path, pt_result_string(result));
    return result == PT_OK;
}

/* Writes everything that was asked for, even if one of the files fails. */
static int write_all(const tool *t, const pt_film *film, const pt_report *report)
{
    const pt_report *reports[1];
    pt_film only = PT_FILM_INIT; /* --only: the class of the expression instead of the whole */
    pt_result result = t->desc.li.lpe ? pt_film_class(film, 0, &only) : PT_OK;
    int i, ok = 1;

    for (i = 0; i < t->output_count; i++)
        ok &= tell_written(t->outputs[i], result == PT_OK ? write_picture(t->outputs[i], t->desc.li.lpe ? &only : film, t->exposure) : result);
    pt_film_free(&only);
    if (t->csv) ok &= tell_written(t->csv, pt_report_write_csv(report, t->csv));
    reports[0] = report;
    if (t->svg) ok &= tell_written(t->svg, pt_report_write_svg(reports, NULL, 1, t->scene_name, t->svg));
    return ok;
}

/* The table on stdout, the files, and what the user should know about them. */
static int deliver(const tool *t, pt_result result, const pt_film *film, const pt_report *report)
{
    int ok;

    if (result != PT_OK && result != PT_ERROR_CANCELLED) {
        fprintf(stderr, "render: %s: %s\n", t->scene_name,
                report->error ? report->error : pt_result_string(result));
        return EXIT_FAILED;
    }
    if (result == PT_ERROR_CANCELLED && pt_film_spp(film) == 0) {
        fprintf(stderr, "render: interrupted before the first pass was finished; nothing is written\n");
        return EXIT_INTERRUPTED;
    }
    pt_report_print(report, stdout);
    ok = fflush(stdout) == 0 && !ferror(stdout);
    ok &= write_all(t, film, report);
    if (report->nonfinite > 0)
        fprintf(stderr, "render: warning: %.0f contributions were not finite and count as zero\n",
                (double)report->nonfinite);
    if (result == PT_ERROR_CANCELLED)
        fprintf(stderr, "render: interrupted; kept the finished passes, %u samples per pixel\n",
                (unsigned)pt_film_spp(film));
    if (!ok) return EXIT_FAILED;
    return result == PT_ERROR_CANCELLED ? EXIT_INTERRUPTED : EXIT_OK;
}

/* Makes the scene, renders it, delivers; frees everything. */
static int run(tool *t)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    pt_result result = pt_scene_find(t->scene_name)->make(&scene, &t->desc.camera);
    int status = EXIT_FAILED;

    if (result != PT_OK) {
        fprintf(stderr, "render: scene %s: %s\n", t->scene_name,
                result == PT_ERROR_SCENE ? pt_scene_error(&scene) : pt_result_string(result));
    } else {
        describe_scene(t, &scene);
        result = pt_render(&scene, &t->desc, &film, &report);
        end_progress(t);
        status = deliver(t, result, &film, &report);
    }
    pt_report_free(&report);
    pt_film_free(&film);
    pt_scene_free(&scene);
    return status;
}

int main(int argc, char **argv)
{
    static tool t; /* all zero, which is the default of nearly everything */
    int done = 0, status;

    t.exposure = 1;
    status = parse_arguments(&t, argc, argv, &done);
    if (status != EXIT_OK || done) return status;
    if (!all_writable(&t)) return EXIT_FAILED;
    t.desc.progress = show_progress;
    t.desc.progress_user = &t;
    t.last_shown = pt_wall_seconds();
    if (signal(SIGINT, on_interrupt) == SIG_IGN) signal(SIGINT, SIG_IGN); /* in the background: not meant */
    return run(&t);
}
