/* films.h - a part of render.c: films and pictures as files. Checkpoints, joining the films of shards, and how far
   two pictures are from each other. */

enum { PATH_SIZE = 4000 }; /* the header's writers take a little more                                    */

/* Can it be opened? Says nothing about what is in it. */
static int is_there(const char *path)
{
    FILE *f = fopen(path, "rb");

    if (f) fclose(f);
    return f != NULL;
}

static int file_error(const char *path, const char *sentence)
{
    fprintf(stderr, "render: '%s': %s\n", path, sentence);
    return 0;
}

/* Says what became of a file; 1 if it was written. */
static int tell_written(const char *path, pt_result result)
{
    if (result == PT_OK) fprintf(stderr, "wrote %s\n", path);
    else fprintf(stderr, "render: cannot write '%s': %s\n", path, pt_result_string(result));
    return result == PT_OK;
}

/* ---- checkpoints ------------------------------------------------------------------------------------- */

/* path with something behind it; NULL if that is too long. */
static const char *with_suffix(const char *path, const char *suffix, char out[PATH_SIZE])
{
    int length = snprintf(out, PATH_SIZE, "%s%s", path, suffix);

    return length > 0 && length < PATH_SIZE ? out : NULL;
}

/* Renames a file over another one. Only POSIX replaces by itself. */
static int replace_file(const char *from, const char *to)
{
#if defined(_WIN32)
    remove(to);
#endif
    return rename(from, to) == 0;
}

/* Writes FILE.new, which is complete and on the disk before anything else happens; then FILE becomes FILE.1, and
   FILE.new becomes FILE. At every moment FILE or FILE.1 is whole, and a disk that is full takes neither away. */
static int write_checkpoint(const char *path, const pt_film *film)
{
    char fresh[PATH_SIZE], last[PATH_SIZE];
    pt_result result;

    if (!with_suffix(path, ".new", fresh) || !with_suffix(path, ".1", last)) return file_error(path, "the name is too long");
    result = pt_film_write(fresh, film);
    if (result == PT_OK && is_there(path) && !replace_file(path, last)) result = PT_ERROR_FILE;
    if (result == PT_OK && !replace_file(fresh, path)) result = PT_ERROR_FILE;
    if (result == PT_OK) return 1;
    fprintf(stderr, "render: cannot write the checkpoint '%s': %s\n", path, pt_result_string(result));
    return 0;
}

/* For --resume: the newest checkpoint that is whole, or an empty film if there is none at all. 0 after one line on
   stderr if there are some, but all are damaged. */
static int read_checkpoint(const char *path, pt_film *film)
{
    char last[PATH_SIZE];
    const char *names[2];
    int k, seen = 0;

    names[0] = path;
    names[1] = with_suffix(path, ".1", last);
    if (!names[1]) return file_error(path, "the name is too long");
    for (k = 0; k < 2; k++) {
        pt_result result;
        if (!is_there(names[k])) continue;
        seen = 1;
        result = pt_film_read(names[k], film);
        if (result == PT_OK) {
            fprintf(stderr, "resumed from '%s' at %u samples per pixel\n", names[k], (unsigned)pt_film_spp(film));
            return 1;
        }
        fprintf(stderr, "render: the checkpoint '%s' is damaged or no film (%s)%s\n", names[k], pt_result_string(result),
                k == 0 && is_there(names[1]) ? "; trying the one before" : "");
    }
    if (!seen) fprintf(stderr, "no checkpoint '%s' yet: starting from the beginning\n", path);
    return !seen;
}

/* Before a render without --resume: would it write over a checkpoint that somebody may want? */
static int checkpoint_is_free(const char *path)
{
    char last[PATH_SIZE];

    if (!with_suffix(path, ".1", last)) return file_error(path, "the name is too long");
    if (is_there(path)) return file_error(path, "this checkpoint exists; --resume goes on from it, or remove it first");
    if (is_there(last)) return file_error(last, "this checkpoint exists; --resume goes on from it, or remove it first");
    return 1;
}

/* ---- reading ---------------------------------------------------------------------------------------- */

/* A picture as a film of one sample: it has no halves, and so no estimate of its error. */
static pt_result film_of_picture(const char *path, pt_film *film)
{
    pt_image image = PT_IMAGE_INIT;
    pt_result result = pt_read_image(path, &image);
    size_t k, n = 3 * (size_t)image.width * (size_t)image.height;

    if (result == PT_OK) result = pt_film_make(film, image.width, image.height, 0);
    for (k = 0; result == PT_OK && k < n; k++) film->half[0][k] = (double)image.rgb[k];
    if (result == PT_OK) film->samples[0] = 1;
    pt_image_free(&image);
    return result;
}

/* A picture by its extension, or else a film. 0 after one line on stderr. */
static int read_any(const char *path, pt_film *film)
{
    int picture = is_picture_name(path);
    pt_result result;

    if (!is_there(path)) {
        fprintf(stderr, "render: cannot read '%s': %s\n", path, strerror(errno));
        return 0;
    }
    result = picture ? film_of_picture(path, film) : pt_film_read(path, film);
    if (result == PT_OK && pt_film_spp(film) > 0) return 1;
    if (result == PT_OK) return file_error(path, "holds no samples");
    if (result == PT_ERROR_FILE) return file_error(path, picture ? "damaged, or no picture" : "damaged, or no film");
    return file_error(path, pt_result_string(result));
}

/* The values of a film, three floats a pixel; NULL without memory. */
static float *floats_of(const pt_film *film)
{
    float *rgb = (float *)malloc(3 * (size_t)film->width * (size_t)film->height * sizeof *rgb), *at = rgb;
    int x, y;

    for (y = 0; rgb && y < film->height; y++)
        for (x = 0; x < film->width; x++) {
            pt_rgbd c = pt_film_pixel(film, x, y);
            *at++ = (float)c.r;
            *at++ = (float)c.g;
            *at++ = (float)c.b;
        }
    return rgb;
}

/* The picture of --reference; NULL after one line on stderr. */
static float *read_reference(const char *path, int width, int height)
{
    pt_film film = PT_FILM_INIT;
    float *rgb = NULL;

    if (read_any(path, &film)) {
        if (film.width != width || film.height != height)
            fprintf(stderr, "render: --reference '%s': is %d x %d pixels, the picture %d x %d\n", path, film.width,
                    film.height, width, height);
        else if ((rgb = floats_of(&film)) == NULL) file_error(path, pt_result_string(PT_ERROR_MEMORY));
    }
    pt_film_free(&film);
    return rgb;
}

/* ---- merge ------------------------------------------------------------------------------------------ */

/* Adds one more film: 1, or 0 after one line on stderr. */
static int merge_one(const char *path, pt_film *sum)
{
    pt_film film = PT_FILM_INIT;
    int ok = 0;

    if (is_picture_name(path)) return file_error(path, "is a picture; only films can be merged");
    if (!read_any(path, &film)) return 0;
    if (sum->width != film.width || sum->height != film.height)
        file_error(path, "its size differs from that of the films before");
    else if (sum->fingerprint != film.fingerprint)
        file_error(path, "not the same picture: scene, camera, method, sampler, seed, precision or version differ");
    else if (pt_film_merge(sum, &film) != PT_OK) file_error(path, "has samples that a film before has too, or other layers");
    else ok = 1;
    pt_film_free(&film);
    return ok;
}

/* Adds the films in the order in which they are given. */
static int merge_films(const tool *t, pt_film *sum)
{
    int k;

    if (is_picture_name(t->words[0])) return file_error(t->words[0], "is a picture; only films can be merged");
    if (!read_any(t->words[0], sum)) return 0;
    for (k = 1; k < t->word_count; k++)
        if (!merge_one(t->words[k], sum)) return 0;
    return 1;
}

/* The samples of a film and its estimated error, as one line on stdout. */
static void describe_film(const pt_film *film, int parts)
{
    pt_error e;

    printf("%d film%s, %d x %d pixels, %u samples per pixel", parts, parts == 1 ? "" : "s", film->width, film->height,
           (unsigned)pt_film_spp(film));
    if (film->range_count > 1) printf(" in %u ranges: some are missing", (unsigned)film->range_count);
    if (pt_film_error_estimate(film, &e)) printf("; estimated RMSE %.6g, relMSE %.6g", e.rmse, e.relmse);
    printf("\n");
}

/* ---- compare ---------------------------------------------------------------------------------------- */

/* Value k of half h of a film as a mean. */
static double half_value(const pt_film *film, int h, size_t k)
{
    return (film->half[h][k] + (film->splat[h] ? film->splat[h][k] : 0)) / film->samples[h];
}

/* The estimated variance of value k of the whole, from the halves: see pt_film_error_estimate. */
static double value_variance(const pt_film *film, size_t k)
{
    double a = film->samples[0], b = film->samples[1], d = half_value(film, 0, k) - half_value(film, 1, k);

    return a * b / ((a + b) * (a + b)) * d * d;
}

static double whole_value(const pt_film *film, size_t k)
{
    double sum = 0;
    int h;

    for (h = 0; h < 2; h++) sum += film->half[h][k] + (film->splat[h] ? film->splat[h][k] : 0);
    return sum / pt_film_spp(film);
}

/* What the blocks of two films say. */
typedef struct block_report {
    int count, above3, differ;  /* blocks times bands; |z| > 3; different although both are without noise      */
    double square, worst;       /* sum of z squared; z of largest magnitude                                */
    int worst_x, worst_y;
} block_report;

/* The difference of two means over a block in standard errors, one band. Pixels are independent of each other, so the
   variances of n pixels add up; a block of 16 x 16 has enough of them for z to be nearly normal. */
static void compare_block(const pt_film *a, const pt_film *b, const int box[4], int band, block_report *r)
{
    double difference = 0, variance = 0, z;
    int x, y;

    for (y = box[1]; y < box[3]; y++)
        for (x = box[0]; x < box[2]; x++) {
            size_t k = 3 * ((size_t)y * (size_t)a->width + (size_t)x) + (size_t)band;
            difference += whole_value(a, k) - whole_value(b, k);
            variance += value_variance(a, k) + value_variance(b, k);
        }
    r->count++;
    if (!(variance > 0)) {
        r->differ += difference != 0;
        return;
    }
    z = difference / sqrt(variance);
    r->square += z * z;
    r->above3 += fabs(z) > 3;
    if (fabs(z) <= fabs(r->worst)) return;
    r->worst = z;
    r->worst_x = box[0];
    r->worst_y = box[1];
}

/* Blocks of 16 pixels a side or a little more, the same number of pixels in each but for rounding. */
static block_report compare_blocks(const pt_film *a, const pt_film *b)
{
    block_report r = {0, 0, 0, 0, 0, 0, 0};
    int columns = a->width / 16 ? a->width / 16 : 1, rows = a->height / 16 ? a->height / 16 : 1, i, band;

    for (i = 0; i < columns * rows; i++) {
        int c = i % columns, y = i / columns, box[4];
        box[0] = (int)((int64_t)a->width * c / columns);
        box[2] = (int)((int64_t)a->width * (c + 1) / columns);
        box[1] = (int)((int64_t)a->height * y / rows);
        box[3] = (int)((int64_t)a->height * (y + 1) / rows);
        for (band = 0; band < 3; band++) compare_block(a, b, box, band, &r);
    }
    return r;
}

static void print_blocks(const pt_film *a, const pt_film *b)
{
    block_report r;

    if (!a->samples[0] || !a->samples[1] || !b->samples[0] || !b->samples[1]) {
        printf("blocks      not known: a picture has no variance; --film keeps it\n");
        return;
    }
    r = compare_blocks(a, b);
    printf("blocks      %d values (blocks of 16 x 16, three bands): z rms %.3g, worst %+.3g at pixel %d,%d; %d above 3 "
           "(by luck %.2g)\n", r.count, sqrt(r.square / r.count), r.worst, r.worst_x, r.worst_y, r.above3, 0.0027 * r.count);
    if (r.differ) printf("            %d differ although neither film has any noise there\n", r.differ);
    if (a->fingerprint == b->fingerprint && a->ranges[0].begin < b->ranges[b->range_count - 1].end &&
        b->ranges[0].begin < a->ranges[a->range_count - 1].end)
        printf("            the films are of the same picture and may share samples: z is then too small\n");
}

static double mean_of(const pt_film *film)
{
    double sum = 0, n = (double)film->width * film->height;
    size_t k;

    for (k = 0; k < 3 * (size_t)film->width * (size_t)film->height; k += 3)
        sum += pt_luminance(whole_value(film, k), whole_value(film, k + 1), whole_value(film, k + 2)) / n;
    return sum;
}

/* The measures of pt_error with film b as the truth R; in double, where pt_film_error has a reference in float. And the
   largest difference of two values, over the largest value of b. */
static pt_error film_difference(const pt_film *a, const pt_film *b, double mean, double *largest)
{
    pt_error e = {0, 0, 0};
    double n = 3.0 * a->width * a->height, gap = 0, most = 0;
    size_t k;

    for (k = 0; k < 3 * (size_t)a->width * (size_t)a->height; k++) {
        double r = whole_value(b, k), d = whole_value(a, k) - r;
        e.rmse += d * d / n;
        if (d != 0) e.relmse += d * d / (r * r + 0.01 * mean * mean) / n; /* both black: 0, not 0/0 */
        e.relmse_001 += d * d / (r * r + 0.01) / n;
        gap = fmax(gap, fabs(d));
        most = fmax(most, fabs(r));
    }
    e.rmse = sqrt(e.rmse);
    *largest = gap > 0 ? gap / most : 0;
    return e;
}

static void print_comparison(const tool *t, const pt_film *a, const pt_film *b)
{
    double mean_a = mean_of(a), mean_b = mean_of(b), largest;
    pt_error e = film_difference(a, b, mean_b, &largest);

    printf("%s against %s, %d x %d pixels\n", t->words[0], t->words[1], a->width, a->height);
    printf("RMSE        %.6g\nrelMSE      %.6g\nrelMSE_001  %.6g\n", e.rmse, e.relmse, e.relmse_001);
    printf("largest     %.6g of the brightest value\n", largest);
    printf("mean        luminance %.6g against %.6g\n", mean_a, mean_b);
    print_blocks(a, b);
}

/* --compare: the first against the second, which is taken as the truth. Returns the exit status. */
static int run_compare(const tool *t)
{
    pt_film a = PT_FILM_INIT, b = PT_FILM_INIT;
    int ok = read_any(t->words[0], &a) && read_any(t->words[1], &b);

    if (ok && (a.width != b.width || a.height != b.height)) {
        fprintf(stderr, "render: --compare: '%s' is %d x %d pixels, '%s' %d x %d\n", t->words[0], a.width, a.height,
                t->words[1], b.width, b.height);
        ok = 0;
    }
    if (ok) print_comparison(t, &a, &b);
    pt_film_free(&a);
    pt_film_free(&b);
    return ok ? EXIT_OK : EXIT_FAILED;
}
