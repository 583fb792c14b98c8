/* pictures.h - a part of render.c: writing what a film holds. The picture itself, and layers of it turned into
   pictures: albedo, normal, depth, and the estimated error. */

/* A file that is written is replaced as a whole; a device such as /dev/null, or a directory, must not be. */
static int is_replaceable(const char *path)
{
#ifdef IS_POSIX
    struct stat s;

    if (stat(path, &s) == 0 && !S_ISREG(s.st_mode)) return file_error(path, "cannot be written: it is no regular file");
#else
    (void)path;
#endif
    return 1;
}

/* Can this file be written? Found out before the work, not after it, with the name that the writer begins with; an
   existing file stays as it is. */
static int is_writable(const char *path)
{
    char part[PATH_SIZE];
    FILE *f;

    if (!is_replaceable(path)) return 0;
    if (!with_suffix(path, ".part", part)) return file_error(path, "the name is too long");
    f = fopen(part, "wb");
    if (!f) {
        fprintf(stderr, "render: cannot write '%s': %s\n", path, strerror(errno));
        return 0;
    }
    fclose(f);
    remove(part);
    return 1;
}

static int all_writable(const tool *t)
{
    const char *const single[] = {t->albedo, t->normal, t->depth, t->error_map, t->film, t->csv, t->svg, t->checkpoint};
    size_t k;
    int i;

    for (i = 0; i < t->output_count; i++)
        if (!is_writable(t->outputs[i])) return 0;
    for (k = 0; k < sizeof single / sizeof single[0]; k++)
        if (single[k] && !is_writable(single[k])) return 0;
    return 1;
}

/* ---- layers ----------------------------------------------------------------------------------------- */

/* One value of a layer from the film; `shown`: for a .png or .ppm, where values must be in [0,1], else for a .pfm,
   which holds the number itself. k = 3 pixel + band. */
typedef double (*layer_fn)(const pt_film *film, size_t k, double scale, int shown);

static double albedo_value(const pt_film *film, size_t k, double scale, int shown)
{
    (void)scale;
    (void)shown;
    return film->albedo[k] / pt_film_spp(film);
}

/* Shown as usual, 0 for -1 and 1 for 1; the writer's sRGB transfer is undone, so that bytes are linear in it. */
static double normal_value(const pt_film *film, size_t k, double scale, int shown)
{
    double n = film->normal[k] / pt_film_spp(film);

    (void)scale;
    return shown ? pt_srgb_decode(fmin(1, fmax(0, 0.5 + 0.5 * n))) : n;
}

/* Shown bright where near, a fifth as bright at the greatest depth, black where nothing is met. */
static double depth_value(const pt_film *film, size_t k, double scale, int shown)
{
    double z = film->depth[k / 3] / pt_film_spp(film);

    if (!shown) return z;
    return z > 0 ? pt_srgb_decode(1 - 0.8 * z / scale) : 0;
}

/* The root of one value's share of the estimated relMSE: their mean square over the picture is that estimate. */
static double error_value(const pt_film *film, size_t k, double scale, int shown)
{
    double r = whole_value(film, k), e = value_variance(film, k);

    (void)shown;
    return e > 0 ? sqrt(e / (r * r + 0.01 * scale * scale)) : 0;
}

static double greatest_depth(const pt_film *film)
{
    size_t i, n = (size_t)film->width * (size_t)film->height;
    double most = 0;

    for (i = 0; i < n; i++) most = fmax(most, film->depth[i] / pt_film_spp(film));
    return most;
}

/* ---- writing ---------------------------------------------------------------------------------------- */

static pt_result write_picture(const tool *t, const char *path, const pt_film *film, double exposure)
{
    if (has_extension(path, "pfm")) return pt_write_pfm(path, film);
    if (has_extension(path, "png")) return pt_write_png(path, film, exposure);
    return pt_write_ppm_as(path, film, exposure, (pt_ppm_kind)t->ppm);
}

/* Writes a layer, if it is asked for, as a film of one sample. 1 unless that fails. */
static int write_layer(const tool *t, const char *path, const pt_film *film, layer_fn value, double scale)
{
    pt_film picture = PT_FILM_INIT;
    size_t k, n = 3 * (size_t)film->width * (size_t)film->height;
    int shown, ok;
    pt_result result;

    if (!path) return 1;
    shown = !has_extension(path, "pfm");
    result = pt_film_make(&picture, film->width, film->height, 0);
    for (k = 0; result == PT_OK && k < n; k++) picture.half[0][k] = value(film, k, scale, shown);
    picture.samples[0] = 1;
    if (result == PT_OK) result = write_picture(t, path, &picture, 1);
    ok = tell_written(path, result);
    pt_film_free(&picture);
    return ok;
}

/* Albedo, normal, depth and error. */
static int write_layers(const tool *t, const pt_film *film)
{
    pt_error e;
    int ok = 1;

    if ((t->albedo || t->normal || t->depth) && !film->albedo) {
        fprintf(stderr, "render: the films hold no albedo, normal and depth; "
                        "render them with one of --albedo, --normal, --depth\n");
        return 0;
    }
    if (t->error_map && !pt_film_error_estimate(film, &e)) {
        fprintf(stderr, "render: --error-map: an error is estimated from two samples per pixel on\n");
        ok = 0;
    } else {
        ok &= write_layer(t, t->error_map, film, error_value, mean_of(film));
    }
    ok &= write_layer(t, t->albedo, film, albedo_value, 0);
    ok &= write_layer(t, t->normal, film, normal_value, 0);
    return ok & write_layer(t, t->depth, film, depth_value, film->depth ? greatest_depth(film) : 0);
}

/* Writes every picture and film that was asked for, even if one of them fails. With --only, which a film remembers by
   its classes, the picture shows the class of the expression. */
static int write_pictures(const tool *t, const pt_film *film)
{
    pt_film only = PT_FILM_INIT;
    const pt_film *picture = film->class_count > 0 ? &only : film;
    pt_result result = film->class_count > 0 ? pt_film_class(film, 0, &only) : PT_OK;
    int i, ok = 1;

    if (t->film) ok &= tell_written(t->film, pt_film_write(t->film, film));
    for (i = 0; i < t->output_count; i++)
        ok &= tell_written(t->outputs[i], result != PT_OK ? result : write_picture(t, t->outputs[i], picture, t->exposure));
    pt_film_free(&only);
    return write_layers(t, film) & ok;
}
