/* own_threads.c - renders on the program's own thread pool instead of the header's threads.

   build:  cc -O2 -I. examples/own_threads.c -o own_threads -lm -pthread        (POSIX threads)
   run:    ./own_threads

   A program that has a pool already (a game, a simulation) does not want a library to start threads of its
   own. It hands pt_render a function that runs a loop on the pool: desc.parallel. The picture does not depend
   on who runs the loop: this program renders with both and compares the sums of all pixels bit for bit.
   Prints one line for each render and the verdict; exit status 0 if the two pictures are the same. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <pthread.h>

/* ---- a small pool: threads that wait for a loop, share its indices, and wait again ------------------ */

enum { POOL_THREADS = 3 };

typedef struct pool {
    pthread_t threads[POOL_THREADS];
    int started;
    pthread_mutex_t lock;
    pthread_cond_t work, done;         /* there is a loop, or the pool closes; a loop has ended            */
    void (*task)(void *context, int index);
    void *context;
    int next, count, finished;         /* indices handed out, in the loop, and done                        */
    int closing;
} pool;

/* Takes one index under the lock, runs it without, counts it. Called and left with the lock held. */
static void pool_step(pool *p)
{
    int index = p->next++;

    pthread_mutex_unlock(&p->lock);
    p->task(p->context, index);
    pthread_mutex_lock(&p->lock);
    if (++p->finished == p->count) pthread_cond_signal(&p->done);
}

static void *pool_thread(void *user)
{
    pool *p = (pool *)user;

    pthread_mutex_lock(&p->lock);
    for (;;) {
        while (p->next == p->count && !p->closing) pthread_cond_wait(&p->work, &p->lock);
        if (p->closing) break;
        pool_step(p);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

/* 0 if the pool could not be made. Fewer threads than wanted are no failure: the caller works too. */
static int pool_open(pool *p)
{
    memset(p, 0, sizeof *p);
    if (pthread_mutex_init(&p->lock, NULL) != 0) return 0;
    if (pthread_cond_init(&p->work, NULL) != 0) {
        pthread_mutex_destroy(&p->lock);
        return 0;
    }
    if (pthread_cond_init(&p->done, NULL) != 0) {
        pthread_cond_destroy(&p->work);
        pthread_mutex_destroy(&p->lock);
        return 0;
    }
    while (p->started < POOL_THREADS &&
           pthread_create(&p->threads[p->started], NULL, pool_thread, p) == 0)
        p->started++;
    return 1;
}

static void pool_close(pool *p)
{
    int i;

    pthread_mutex_lock(&p->lock);
    p->closing = 1;
    pthread_cond_broadcast(&p->work);
    pthread_mutex_unlock(&p->lock);
    for (i = 0; i < p->started; i++) pthread_join(p->threads[i], NULL);
    pthread_cond_destroy(&p->done);
    pthread_cond_destroy(&p->work);
    pthread_mutex_destroy(&p->lock);
}

/* What desc.parallel wants: runs task(context, i) for every i in 0..count-1 and returns when all are done. */
static void pool_parallel(void *user, int count, void (*task)(void *context, int index), void *context)
{
    pool *p = (pool *)user;

    pthread_mutex_lock(&p->lock);
    p->task = task;
    p->context = context;
    p->next = p->finished = 0;
    p->count = count;
    pthread_cond_broadcast(&p->work);
    while (p->next < p->count) pool_step(p);
    while (p->finished < p->count) pthread_cond_wait(&p->done, &p->lock);
    pthread_mutex_unlock(&p->lock);
}

/* ---- the comparison ---------------------------------------------------------------------------------- */

static pt_result render(const pt_scene *scene, const pt_render_desc *desc, pt_film *film, const char *label)
{
    pt_report report = PT_REPORT_INIT;
    pt_result result = pt_render(scene, desc, film, &report);

    if (result == PT_OK)
        printf("%-20s %u samples per pixel in %.2f s, %.2f s of CPU time\n", label, (unsigned)report.spp,
               report.wall_seconds, report.cpu_seconds);
    else
        fprintf(stderr, "%s: %s\n", label, pt_result_string(result));
    pt_report_free(&report);
    return result;
}

static int same_bits(const pt_film *a, const pt_film *b)
{
    size_t size = (size_t)a->width * (size_t)a->height * 3 * sizeof(double);

    return memcmp(a->half[0], b->half[0], size) == 0 && memcmp(a->half[1], b->half[1], size) == 0;
}

/* Renders with the header's threads and with the pool; 0 if both films hold the same bits. */
static int compare(const pt_scene *scene, const pt_camera *camera, pool *p)
{
    pt_film theirs = PT_FILM_INIT, ours = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    int status = 1;

    desc.camera = *camera;
    desc.width = 160;
    desc.height = 120;
    desc.spp = 16;
    if (render(scene, &desc, &theirs, "the header's threads") == PT_OK) {
        desc.parallel = pool_parallel;
        desc.parallel_user = p;
        if (render(scene, &desc, &ours, "the program's pool") == PT_OK) {
            status = same_bits(&theirs, &ours) ? 0 : 1;
            printf("the pictures are %s\n", status == 0 ? "the same, bit for bit" : "DIFFERENT");
        }
    }
    pt_film_free(&ours);
    pt_film_free(&theirs);
    return status;
}

int main(void)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    pool p;
    int status = 1;

    if (pt_scene_cornell_spheres(&scene, &camera) != PT_OK) {
        fprintf(stderr, "%s\n", pt_scene_error(&scene));
    } else if (!pool_open(&p)) {
        fprintf(stderr, "the thread pool could not be made\n");
    } else {
        status = compare(&scene, &camera, &p);
        pool_close(&p);
    }
    pt_scene_free(&scene);
    return status;
}
