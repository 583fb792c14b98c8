/* render.c - renders a canonical scene or a model from the command line, and says how wrong the picture still is.

   build:  cc -O2 -I. examples/render.c -o render -lm -pthread
   run:    ./render cornell --spp 64 -o cornell.png
           ./render teapot.obj -o teapot.png
           ./render --help

   Prints the table of error against run time on stdout; progress, warnings and errors go to stderr.
   Exit status: 0 the pictures are written, 1 something could not be done, 2 the command line is wrong,
   130 interrupted by Ctrl-C, 143 by SIGTERM (what was finished by then is written).

   The parts: render/options.h reads the command line, render/subject.h makes the scene, render/films.h keeps
   checkpoints, joins and compares, render/pictures.h writes. Here: the render itself. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <ctype.h>
#include <errno.h>
#include <float.h>
#include <signal.h>
#include <stdlib.h>

/* C99 cannot ask whether stderr is a terminal, and whether a name is that of a device; these systems can. */
#if defined(_WIN32)
#include <io.h>
#define STDERR_IS_TERMINAL() (_isatty(_fileno(stderr)) != 0)
#elif defined(__unix__) || defined(__APPLE__)
#include <sys/stat.h>
#include <unistd.h>
#define STDERR_IS_TERMINAL() (isatty(2) != 0)
#define IS_POSIX 1
#else
#define STDERR_IS_TERMINAL() 0
#endif

#include "render/options.h"
#include "render/subject.h"
#include "render/films.h"
#include "render/pictures.h"

/* A render under way. It is made in steps, calls of pt_render that each continue the film, so that checkpoints and
   Ctrl-C lose little; the film does not depend on where the steps end. */
typedef struct job {
    tool *t;
    pt_scene scene;
    pt_film film;
    pt_report report;      /* of all steps                                                                 */
    float *reference;
    uint32_t first, last;  /* samples per pixel at the start (a checkpoint's), and the most; 0 = no limit      */
    uint32_t saved_spp;    /* of the last checkpoint, and when that was written                            */
    double saved;
    double start, cpu_start, relmse; /* clocks at the start; latest estimate, -1 = none                    */
    double shown;          /* wall seconds at which progress was last shown                                */
    int line_length;       /* characters of the progress line that stand on the terminal                   */
} job;

/* ---- Ctrl-C ---------------------------------------------------------------------------------------- */

static volatile sig_atomic_t interrupted = 0;

/* The first signal asks the render to stop; the second one ends the program as usual. */
static void on_signal(int number)
{
    interrupted = number;
    signal(number, SIG_DFL);
}

/* One that is ignored stays so: for a program in the background Ctrl-C is not meant, with nohup the hang-up. */
static void catch_signal(int number)
{
    if (signal(number, on_signal) == SIG_IGN) signal(number, SIG_IGN);
}

static void catch_signals(void)
{
    catch_signal(SIGINT);
    catch_signal(SIGTERM); /* batch systems send it when time is up */
#ifdef IS_POSIX
    catch_signal(SIGHUP); /* the terminal is gone */
#endif
}

/* ---- progress -------------------------------------------------------------------------------------- */

static void format_time_left(char *out, size_t size, double seconds)
{
    if (!(seconds >= 0) || seconds > 1000 * 3600.0) out[0] = '\0'; /* not known, or nothing that one waits for */
    else if (seconds < 100) snprintf(out, size, "  %.1f s left", seconds);
    else if (seconds < 100 * 60) snprintf(out, size, "  %.0f min left", seconds / 60);
    else snprintf(out, size, "  %.0f h left", seconds / 3600);
}

/* From the samples done in this run and those to come, and from the time budgets. */
static double seconds_left(const job *j, double spp)
{
    const pt_render_desc *d = &j->t->desc;
    double wall = pt_wall_seconds() - j->start, made = spp - j->first, left = HUGE_VAL;

    if (j->last > 0 && made > 0) left = wall * (j->last - spp) / made;
    if (d->seconds > 0) left = fmin(left, fmax(0, d->seconds - wall));
    return left;
}

/* "12.5 of 64 samples  3.42 M rays/s  error 4.1 %  6.2 s left", without what is not known yet. */
static int format_progress(const job *j, char *out, size_t size, const pt_progress *p)
{
    char goal[32] = "", error[32] = "", left[32];
    double relmse = p->relmse >= 0 ? p->relmse : j->relmse;

    if (j->last > 0) snprintf(goal, sizeof goal, " of %.0f", (double)j->last);
    if (relmse >= 0) snprintf(error, sizeof error, "  error %.3g %%", 100 * sqrt(relmse));
    format_time_left(left, sizeof left, seconds_left(j, p->spp));
    return snprintf(out, size, "%.1f%s samples  %.2f M rays/s%s%s", p->spp, goal, 1e-6 * p->rays_per_second, error, left);
}

/* Is it time for another line? On a terminal always; in a log file every two seconds at first, then every tenth
   of the time that has passed. */
static int progress_due(const job *j, double now)
{
    if (j->t->progress == PROGRESS_OFF) return 0;
    return j->t->progress == PROGRESS_LINE || now - j->shown >= fmax(2, 0.1 * (now - j->start));
}

/* Called by the renderer about ten times a second, from one thread at a time. Non-zero stops it. */
static int show_progress(void *user, const pt_progress *p)
{
    job *j = (job *)user;
    double now = pt_wall_seconds();
    char line[160];
    int length;

    if (progress_due(j, now)) {
        length = format_progress(j, line, sizeof line, p);
        j->shown = now;
        if (j->t->progress == PROGRESS_LINE) fprintf(stderr, "\r%-*s", j->line_length, line);
        else fprintf(stderr, "%s\n", line);
        fflush(stderr);
        j->line_length = length;
    }
    return interrupted != 0;
}

/* Wipes the progress line, so that what follows starts on a clean one. */
static void end_progress(job *j)
{
    if (j->t->progress == PROGRESS_LINE && j->line_length > 0) fprintf(stderr, "\r%*s\r", j->line_length, "");
    j->line_length = 0;
}

/* ---- steps ------------------------------------------------------------------------------------------ */

static int is_doubling(uint32_t spp)
{
    return (spp & (spp - 1)) == 0;
}

/* Samples that fit into ten seconds, the most that Ctrl-C then loses (or one sample), and into what is left of the time
   budgets and until the next checkpoint. */
static double samples_in_time(const job *j, uint32_t done)
{
    const pt_render_desc *d = &j->t->desc;
    double wall = j->report.wall_seconds, made = (double)done - j->first, time;

    if (made <= 0 || !(wall > 0)) return HUGE_VAL; /* not known yet: the next doubling */
    time = 10;
    if (j->t->checkpoint) time = fmin(time, fmax(0, j->t->every - (pt_wall_seconds() - j->saved)));
    if (d->seconds > 0) time = fmin(time, d->seconds - (pt_wall_seconds() - j->start));
    if (d->cpu_seconds > 0)
        time = fmin(time, (d->cpu_seconds - (pt_cpu_seconds() - j->cpu_start)) * wall / j->report.cpu_seconds);
    return time * made / wall;
}

/* The sample count at which the next step ends: the next doubling, where a row of the table is due and the error is
   asked; earlier if time does not reach that far. A stratified render is one step. */
static uint32_t next_end(const job *j, uint32_t done)
{
    uint64_t end = 1, most = j->last ? j->last : UINT32_MAX - 1 - j->t->desc.first_sample;
    double fit = samples_in_time(j, done);

    if (j->t->desc.sampler == PT_SAMPLER_STRATIFIED) return (uint32_t)most;
    while (end <= done) end *= 2;
    if (end > most) end = most;
    if (fit < (double)(end - done)) end = done + (fit > 1 ? (uint64_t)fit : 1);
    return (uint32_t)end;
}

/* Which budget is used up; NULL = none. Times count from the start of this run; at least one sample is made. */
static const char *budget_used(const job *j)
{
    const pt_render_desc *d = &j->t->desc;
    uint32_t spp = pt_film_spp(&j->film);

    if (j->last > 0 && spp >= j->last) return "samples";
    if (spp == UINT32_MAX - 1 - d->first_sample) return "sample indices used up";
    if (spp == j->first) return NULL;
    if (d->seconds > 0 && pt_wall_seconds() - j->start >= d->seconds) return "seconds";
    if (d->cpu_seconds > 0 && pt_cpu_seconds() - j->cpu_start >= d->cpu_seconds) return "CPU seconds";
    if (d->target_error > 0 && is_doubling(spp) && j->relmse >= 0 && sqrt(j->relmse) < d->target_error) return "error";
    return NULL;
}

/* Room for one more row of the table: a row at the end of a step counts only until the next one, unless its sample
   count is a doubling. NULL without memory. */
static pt_report_row *new_row(pt_report *r)
{
    pt_report_row *rows = r->rows;

    if (r->row_count > 0 && !is_doubling(r->rows[r->row_count - 1].spp)) return &r->rows[r->row_count - 1];
    if (r->row_count == r->row_capacity) {
        rows = (pt_report_row *)realloc(r->rows, (r->row_capacity + 16) * sizeof *rows);
        if (!rows) return NULL;
        r->rows = rows;
        r->row_capacity += 16;
    }
    return &rows[r->row_count++];
}

/* Adds a step to the table. After --resume, efficiencies are unknown: the time of the samples before is. */
static int add_step(job *j, const pt_report *step)
{
    pt_report *r = &j->report, sum = *step;
    uint32_t i;

    for (i = 0; i < step->row_count; i++) {
        pt_report_row *row = new_row(r);
        double relmse;
        if (!row) return 0;
        *row = step->rows[i];
        row->cpu_seconds += r->cpu_seconds;
        row->wall_seconds += r->wall_seconds;
        row->rays += r->rays;
        relmse = row->has_true_error ? row->true_error.relmse : row->error.relmse;
        row->efficiency = relmse > 0 && row->cpu_seconds > 0 && j->first == 0 ? 1 / (relmse * row->cpu_seconds) : 0;
        if (row->estimated) j->relmse = row->error.relmse;
    }
    sum.alloc_user = r->alloc_user;
    sum.rows = r->rows;
    sum.row_count = r->row_count;
    sum.row_capacity = r->row_capacity;
    sum.cpu_seconds += r->cpu_seconds;
    sum.wall_seconds += r->wall_seconds;
    sum.rays += r->rays;
    sum.nonfinite += r->nonfinite;
    *r = sum;
    return 1;
}

/* One call of pt_render, up to next_end. */
static pt_result render_step(job *j)
{
    pt_render_desc d = j->t->desc;
    pt_report step = PT_REPORT_INIT;
    pt_result result;

    d.spp = next_end(j, pt_film_spp(&j->film));
    d.target_error = 0; /* asked at doublings only, so that where it ends does not depend on time */
    d.cpu_seconds = 0;
    if (d.seconds > 0) d.seconds = fmax(0.001, d.seconds - (pt_wall_seconds() - j->start)); /* for endless paths */
    d.progress = show_progress;
    d.progress_user = j;
    d.reference = j->reference;
    result = pt_render(&j->scene, &d, &j->film, &step);
    if (!add_step(j, &step)) result = PT_ERROR_MEMORY;
    pt_report_free(&step);
    return result;
}

/* Writes a checkpoint if it is time, or if this is the last one. 0 if that fails, which does not stop the render. */
static int save(job *j, int last)
{
    uint32_t spp = pt_film_spp(&j->film);

    if (!j->t->checkpoint || spp == j->saved_spp) return 1;
    if (!last && pt_wall_seconds() - j->saved < j->t->every) return 1;
    end_progress(j);
    j->saved = pt_wall_seconds();
    if (!write_checkpoint(j->t->checkpoint, &j->film)) return 0;
    j->saved_spp = spp;
    return 1;
}

/* Is the film that was resumed one of this picture? Asked by a render that has nothing to do. */
static pt_result check_film(job *j)
{
    pt_render_desc d = j->t->desc;
    pt_report none = PT_REPORT_INIT;
    pt_result result;

    if (j->first == 0) return PT_OK;
    d.spp = j->first;
    d.seconds = d.cpu_seconds = d.target_error = 0;
    result = pt_render(&j->scene, &d, &j->film, &none);
    if (!add_step(j, &none)) result = PT_ERROR_MEMORY;
    pt_report_free(&none);
    return result;
}

/* Steps until a budget is used up, or a signal comes. */
static pt_result run_steps(job *j)
{
    pt_result result = check_film(j);
    const char *stopped = NULL;
    uint32_t before;

    while (result == PT_OK && !interrupted && !(stopped = budget_used(j))) {
        before = pt_film_spp(&j->film);
        result = render_step(j);
        if (pt_film_spp(&j->film) == before) break; /* a path outlasted the time, or an error */
        if (result == PT_OK) save(j, 0);
    }
    if (stopped || interrupted) j->report.stopped_by = stopped ? stopped : interrupted == SIGINT ? "Ctrl-C" : "a signal";
    return result;
}

/* ---- before and after the render ------------------------------------------------------------------- */

/* The table on stdout, the files, and what the user should know about them. */
static int deliver(job *j)
{
    const tool *t = j->t;
    const pt_report *reports[1];
    int ok;

    if (j->report.row_count > 0) pt_report_print(&j->report, stdout);
    else describe_film(&j->film, 1); /* a checkpoint that was complete */
    ok = fflush(stdout) == 0 && !ferror(stdout);
    ok &= save(j, 1);
    ok &= write_pictures(t, &j->film);
    if (t->csv) ok &= tell_written(t->csv, pt_report_write_csv(&j->report, t->csv));
    reports[0] = &j->report;
    if (t->svg) ok &= tell_written(t->svg, pt_report_write_svg(reports, NULL, 1, t->words[0], t->svg));
    if (j->film.nonfinite > 0)
        fprintf(stderr, "render: warning: %.0f contributions were not finite and count as zero\n", (double)j->film.nonfinite);
    return ok;
}

/* What came of the steps; the exit status. */
static int conclude(job *j, pt_result result)
{
    const tool *t = j->t;
    int ok;

    end_progress(j);
    if (result == PT_ERROR_MISMATCH && t->resume) {
        file_error(t->checkpoint, "the checkpoint is of another picture: "
                                  "scene, camera, size, method, sampler, seed, layers, samples or version");
        return EXIT_FAILED;
    }
    if (result != PT_OK && result != PT_ERROR_CANCELLED) {
        fprintf(stderr, "render: %s: %s\n", t->words[0], j->report.error ? j->report.error : pt_result_string(result));
        return EXIT_FAILED;
    }
    if (pt_film_spp(&j->film) == 0) {
        fprintf(stderr, "render: %s before the first pass was finished; nothing is written\n",
                interrupted ? "interrupted" : "out of time");
        return interrupted ? EXIT_SIGNAL + (int)interrupted : EXIT_FAILED;
    }
    ok = deliver(j);
    if (interrupted)
        fprintf(stderr, "render: interrupted; kept the finished passes, %u samples per pixel\n", (unsigned)pt_film_spp(&j->film));
    return !ok ? EXIT_FAILED : interrupted ? EXIT_SIGNAL + (int)interrupted : EXIT_OK;
}

/* The film to start with: empty, or a checkpoint's. */
static int open_checkpoint(job *j)
{
    const tool *t = j->t;

    if (!t->checkpoint) return 1;
    return t->resume ? read_checkpoint(t->checkpoint, &j->film) : checkpoint_is_free(t->checkpoint);
}

/* Everything but the command line of a render. */
static int render_subject(job *j)
{
    tool *t = j->t;

    if (!all_writable(t) || !open_checkpoint(j) || !make_subject(t, &j->scene)) return EXIT_FAILED;
    if (t->reference && !(j->reference = read_reference(t->reference, t->desc.width, t->desc.height))) return EXIT_FAILED;
    j->first = j->saved_spp = pt_film_spp(&j->film);
    j->last = t->desc.spp;
    j->relmse = -1;
    j->start = j->saved = j->shown = pt_wall_seconds();
    j->cpu_start = pt_cpu_seconds();
    catch_signals();
    return conclude(j, run_steps(j));
}

static int run_render(tool *t)
{
    static job j;
    int status;

    j.t = t;
    status = render_subject(&j);
    free(j.reference);
    pt_report_free(&j.report);
    pt_film_free(&j.film);
    pt_scene_free(&j.scene);
    return status;
}

static int run_merge(const tool *t)
{
    pt_film film = PT_FILM_INIT;
    int ok = all_writable(t) && merge_films(t, &film);

    if (ok) {
        describe_film(&film, t->word_count);
        ok = write_pictures(t, &film);
    }
    pt_film_free(&film);
    return ok ? EXIT_OK : EXIT_FAILED;
}

int main(int argc, char **argv)
{
    static tool t; /* all zero, which is the default of nearly everything */
    int status;

    t.exposure = t.scale = 1;
    t.desc.width = t.desc.height = 256;
    status = parse_arguments(&t, argc, argv);
    if (status != EXIT_OK) return status;
    if (t.help || t.list) {
        if (t.help) print_help();
        else print_list();
        return fflush(stdout) == 0 ? EXIT_OK : EXIT_FAILED;
    }
#ifdef IS_POSIX
    signal(SIGPIPE, SIG_IGN); /* where nobody reads the table any more, the pictures are written all the same */
#endif
    if (t.progress == PROGRESS_AUTO) t.progress = STDERR_IS_TERMINAL() ? PROGRESS_LINE : PROGRESS_PLAIN;
    if (!(t.every > 0)) t.every = 60;
    return t.mode == MODE_MERGE ? run_merge(&t) : t.mode == MODE_COMPARE ? run_compare(&t) : run_render(&t);
}
