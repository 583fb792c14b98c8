/* mpi_render.c - one picture over the ranks of an MPI program: each renders a shard of the samples, rank 0 adds them up.

   build:  mpicc -O2 -I. examples/mpi_render.c -o mpi_render -lm -pthread
   run:    mpirun -n 4 ./mpi_render cornell 64 cornell.png 1

   Arguments: a canonical scene (cornell), samples per pixel (64), the file to write (mpi.png; .film keeps the sums),
   threads of each rank (1).

   A film is a sum over samples, so that spreading a picture needs nothing but disjoint ranges of sample indices
   (desc.first_sample) and pt_film_merge. Rank 0 adds the others in the order of their ranks, whichever is ready
   first: the same bits in every run with as many ranks, and the sum of a single run but for the order of additions
   (1e-12 relative at most). Exit status 0 if the file is written. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <mpi.h>
#include <stdlib.h>

enum { WIDTH = 256, HEIGHT = 256, TAG = 1 };

typedef struct work {
    const char *scene, *output;
    uint32_t spp;
    int rank, ranks, threads;
} work;

/* Samples begin..end of this rank: as many as the others' or one more. */
static pt_range share_of(const work *w)
{
    pt_range r;

    r.begin = (uint32_t)((uint64_t)w->spp * (uint64_t)w->rank / (uint64_t)w->ranks);
    r.end = (uint32_t)((uint64_t)w->spp * ((uint64_t)w->rank + 1) / (uint64_t)w->ranks);
    return r;
}

static pt_result render_share(const work *w, pt_film *film)
{
    const pt_scene_entry *entry = pt_scene_find(w->scene);
    pt_scene scene = PT_SCENE_INIT;
    pt_render_desc desc = pt_render_defaults();
    pt_range share = share_of(w);
    pt_result result = entry && share.end > share.begin ? entry->make(&scene, &desc.camera) : PT_ERROR_ARGUMENT;

    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.threads = w->threads;
    desc.first_sample = share.begin;
    desc.spp = share.end - share.begin;
    if (result == PT_OK) result = pt_render(&scene, &desc, film, NULL);
    pt_scene_free(&scene);
    return result;
}

/* The sums of one half, row by row: a message counts its items in an int. */
static void send_half(const double *half)
{
    int y;

    for (y = 0; y < HEIGHT; y++) MPI_Send(half + (size_t)y * 3 * WIDTH, 3 * WIDTH, MPI_DOUBLE, 0, TAG, MPI_COMM_WORLD);
}

static void receive_half(double *half, int rank)
{
    int y;

    for (y = 0; y < HEIGHT; y++)
        MPI_Recv(half + (size_t)y * 3 * WIDTH, 3 * WIDTH, MPI_DOUBLE, rank, TAG, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
}

/* What else a film is, as whole numbers: its samples, and that it is the same picture. */
enum { NUMBERS = 6 };

static void send_film(const pt_film *film)
{
    uint64_t n[NUMBERS];

    n[0] = film->samples[0];
    n[1] = film->samples[1];
    n[2] = film->ranges[0].begin;
    n[3] = film->ranges[0].end;
    n[4] = film->fingerprint;
    n[5] = film->nonfinite;
    MPI_Send(n, NUMBERS, MPI_UINT64_T, 0, TAG, MPI_COMM_WORLD);
    send_half(film->half[0]);
    send_half(film->half[1]);
}

static pt_result receive_film(pt_film *film, int rank)
{
    uint64_t n[NUMBERS];

    MPI_Recv(n, NUMBERS, MPI_UINT64_T, rank, TAG, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    receive_half(film->half[0], rank);
    receive_half(film->half[1], rank);
    film->samples[0] = (uint32_t)n[0];
    film->samples[1] = (uint32_t)n[1];
    film->fingerprint = n[4];
    film->nonfinite = n[5];
    return pt_film_add_range(film, (uint32_t)n[2], (uint32_t)n[3]);
}

/* Rank 0 takes the films in the order of the ranks; the others hand theirs over. */
static pt_result reduce(const work *w, pt_film *film)
{
    pt_result result = PT_OK;
    int rank;

    if (w->rank > 0) send_film(film);
    for (rank = 1; w->rank == 0 && rank < w->ranks; rank++) {
        pt_film other = PT_FILM_INIT;
        pt_result one = pt_film_make(&other, WIDTH, HEIGHT, 0);
        if (one != PT_OK) MPI_Abort(MPI_COMM_WORLD, 1); /* the sender waits for us */
        one = receive_film(&other, rank);
        if (one == PT_OK) one = pt_film_merge(film, &other);
        if (result == PT_OK) result = one;
        pt_film_free(&other);
    }
    return result;
}

/* On rank 0: the picture, or for a name that ends in .film the sums. */
static pt_result write_result(const work *w, const pt_film *film)
{
    size_t length = strlen(w->output);
    int sums = length > 5 && strcmp(w->output + length - 5, ".film") == 0;
    pt_result result = sums ? pt_film_write(w->output, film) : pt_write_png(w->output, film, 1);
    pt_error error;

    if (result == PT_OK && pt_film_error_estimate(film, &error))
        printf("%s: %d rank%s, %u samples per pixel, estimated relMSE %.6g\n", w->output, w->ranks,
               w->ranks == 1 ? "" : "s", (unsigned)pt_film_spp(film), error.relmse);
    return result;
}

int main(int argc, char **argv)
{
    work w;
    pt_film film = PT_FILM_INIT;
    pt_result result;
    int level, mine, worst;

    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level); /* threads render, only this one talks */
    MPI_Comm_rank(MPI_COMM_WORLD, &w.rank);
    MPI_Comm_size(MPI_COMM_WORLD, &w.ranks);
    w.scene = argc > 1 ? argv[1] : "cornell";
    w.spp = argc > 2 ? (uint32_t)strtoul(argv[2], NULL, 10) : 64;
    w.output = argc > 3 ? argv[3] : "mpi.png";
    w.threads = argc > 4 ? atoi(argv[4]) : 1;

    result = render_share(&w, &film);
    mine = (int)result;
    MPI_Allreduce(&mine, &worst, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD); /* one that failed has nothing to send */
    if (worst == 0) worst = (int)reduce(&w, &film);
    if (worst == 0 && w.rank == 0) worst = (int)write_result(&w, &film);
    if (worst != 0 && w.rank == 0)
        fprintf(stderr, "mpi_render: %s, %u samples: %s\n", w.scene, (unsigned)w.spp, pt_result_string((pt_result)worst));
    pt_film_free(&film);
    MPI_Finalize();
    return worst != 0;
}
