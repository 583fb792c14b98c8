/* options.h - a part of render.c: the tool's settings, and the command line that makes them.

   All options stand in one table: a name, the function that reads the value, the field that it sets, what
   values are allowed, and in which of the tool's modes the option means anything. */

enum { EXIT_OK = 0, EXIT_FAILED = 1, EXIT_USAGE = 2, EXIT_SIGNAL = 128 /* plus the signal's number */ };
enum { MAX_OUTPUTS = 16 };

/* What the tool is asked to do; an option says for which of these it is. */
enum {
    MODE_SCENE = 1,   /* render a canonical scene                                                          */
    MODE_MODEL = 2,   /* render an OBJ file                                                                */
    MODE_MERGE = 4,   /* join films                                                                        */
    MODE_COMPARE = 8, /* compare two pictures                                                              */
    MODE_RENDER = MODE_SCENE | MODE_MODEL,
    MODE_FILMS = MODE_RENDER | MODE_MERGE
};

/* How progress is shown: one line that is overwritten, or a new line now and then for a log file. */
enum { PROGRESS_AUTO = 0, PROGRESS_LINE, PROGRESS_PLAIN, PROGRESS_OFF };

/* A number for each axis or colour band. */
typedef struct triple {
    int given;
    double v[3];
} triple;

/* The settings. All zero is the default of nearly everything. */
typedef struct tool {
    char **words;          /* the arguments that are no options: a scene, a model, films, pictures         */
    int word_count;
    int mode;              /* MODE_X                                                                       */
    int merge, compare, list, help, verbose, progress;

    pt_render_desc desc;   /* size, budgets, method, sampler, light-path expression, ...                   */
    pt_lpe lpe;            /* of --only                                                                    */
    int filter, sampler;
    double survival;       /* of --roulette                                                                */
    uint32_t shard, shards; /* --shard: from 1 on; 0 of 0 is the whole                                     */

    triple eye, look_at, up, sky, rotate, translate;
    double fov, aperture, focus, scale, lamp;
    const char *sky_image;
    int floor;

    const char *outputs[MAX_OUTPUTS];
    int output_count;
    char default_output[512];
    double exposure;
    int ppm;               /* index of ppm_names                                                           */
    const char *albedo, *normal, *depth, *error_map, *film, *csv, *svg, *reference;
    const char *checkpoint;
    double every;
    int resume;
} tool;

/* The value of an option; `field` is where it goes. EXIT_OK or EXIT_USAGE. */
typedef struct option option;
struct option {
    const char *name;
    int (*set)(tool *t, const option *o, const char *value);
    size_t field;              /* offset in struct tool                                                    */
    int modes;                 /* in which it means anything                                               */
    double low, high;          /* set_real: low < value <= high; set_whole: low <= value <= high           */
    const char *wanted;        /* for the message: "must be ..."                                           */
    const char *const *names;  /* set_name                                                                 */
};

/* ---- values ---------------------------------------------------------------------------------------- */

/* One line on stderr that names what was wrong and what is allowed. */
static int bad_value(const option *o, const char *value, const char *wanted)
{
    fprintf(stderr, "render: %s '%s': must be %s\n", o->name, value, wanted);
    return EXIT_USAGE;
}

static void *field_of(tool *t, const option *o)
{
    return (char *)t + o->field;
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

/* A decimal floating-point number in the first `length` characters; no "inf", "nan" or hexadecimal. */
static int parse_real(const char *text, size_t length, double *out)
{
    char copy[64], *end;

    if (length == 0 || length >= sizeof copy) return 0;
    memcpy(copy, text, length);
    copy[length] = '\0';
    if (copy[strspn(copy, "0123456789+-.eE")] != '\0') return 0;
    *out = strtod(copy, &end);
    return *end == '\0' && fabs(*out) <= DBL_MAX;
}

/* "X,Y,Z", each at most 1e18 in magnitude. */
static int parse_triple(const char *text, triple *out)
{
    int k;

    for (k = 0; k < 3; k++) {
        size_t length = strcspn(text, ",");
        if (!parse_real(text, length, &out->v[k]) || fabs(out->v[k]) > PT_MAX_COORDINATE) return 0;
        if ((text[length] == ',') != (k < 2)) return 0;
        text += length + 1;
    }
    out->given = 1;
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

static int has_extension(const char *path, const char *extension)
{
    char ext[8];

    extension_of(path, ext);
    return strcmp(ext, extension) == 0;
}

static int is_picture_name(const char *path)
{
    return has_extension(path, "png") || has_extension(path, "ppm") || has_extension(path, "pfm");
}

/* ---- one function for each kind of value ------------------------------------------------------------ */

static int set_flag(tool *t, const option *o, const char *value)
{
    (void)value; /* an option without one */
    *(int *)field_of(t, o) = 1;
    return EXIT_OK;
}

static int set_text(tool *t, const option *o, const char *value)
{
    *(const char **)field_of(t, o) = value;
    return value[0] ? EXIT_OK : bad_value(o, value, "a file name");
}

static int set_real(tool *t, const option *o, const char *value)
{
    double v;

    if (!parse_real(value, strlen(value), &v) || !(v > o->low && v <= o->high)) return bad_value(o, value, o->wanted);
    *(double *)field_of(t, o) = v;
    return EXIT_OK;
}

static int set_whole(tool *t, const option *o, const char *value)
{
    uint64_t v;

    if (!parse_whole(value, (uint64_t)o->high, &v) || (double)v < o->low) return bad_value(o, value, o->wanted);
    *(int *)field_of(t, o) = (int)v;
    return EXIT_OK;
}

static int set_triple(tool *t, const option *o, const char *value)
{
    return parse_triple(value, (triple *)field_of(t, o)) ? EXIT_OK : bad_value(o, value, o->wanted);
}

/* One of o->names; the field is its index. */
static int set_name(tool *t, const option *o, const char *value)
{
    int i;

    for (i = 0; o->names[i]; i++)
        if (strcmp(value, o->names[i]) == 0) {
            *(int *)field_of(t, o) = i;
            return EXIT_OK;
        }
    return bad_value(o, value, o->wanted);
}

/* ---- options with values of their own ----------------------------------------------------------------- */

static int set_picture(tool *t, const option *o, const char *value)
{
    if (!is_picture_name(value)) return bad_value(o, value, "a file name that ends in .png, .ppm or .pfm");
    *(const char **)field_of(t, o) = value;
    return EXIT_OK;
}

static int set_output(tool *t, const option *o, const char *value)
{
    option slot = *o;

    if (t->output_count == MAX_OUTPUTS) return bad_value(o, value, "one of at most 16 pictures");
    slot.field += (size_t)t->output_count++ * sizeof t->outputs[0];
    return set_picture(t, &slot, value);
}

static int set_size(tool *t, const option *o, const char *value)
{
    char width[8] = "";
    const char *x = strchr(value, 'x');
    uint64_t w, h;

    if (x && x - value < (ptrdiff_t)sizeof width) memcpy(width, value, (size_t)(x - value));
    if (!x || !parse_whole(width, 65536, &w) || !parse_whole(x + 1, 65536, &h) || w == 0 || h == 0)
        return bad_value(o, value, o->wanted);
    t->desc.width = (int)w;
    t->desc.height = (int)h;
    return EXIT_OK;
}

static int set_spp(tool *t, const option *o, const char *value)
{
    uint64_t n;

    if (!parse_whole(value, UINT32_MAX - 1, &n) || n == 0) return bad_value(o, value, o->wanted);
    t->desc.spp = (uint32_t)n;
    return EXIT_OK;
}

static int set_seed(tool *t, const option *o, const char *value)
{
    return parse_whole(value, UINT64_MAX, &t->desc.seed) ? EXIT_OK : bad_value(o, value, o->wanted);
}

/* "must be one of a, b, c" for what the header has a list of. */
static int not_in_list(const option *o, const char *value, const char *(*name)(int i))
{
    const char *n;
    int i;

    fprintf(stderr, "render: %s '%s': must be one of", o->name, value);
    for (i = 0; (n = name(i)) != NULL; i++) fprintf(stderr, "%s %s", i ? "," : "", n);
    fputc('\n', stderr);
    return EXIT_USAGE;
}

static const char *method_name(int i)
{
    int count;
    const pt_method *methods = pt_methods(&count);

    return i < count ? methods[i].name : NULL;
}

static int set_method(tool *t, const option *o, const char *value)
{
    t->desc.method = value;
    return pt_method_find(value) ? EXIT_OK : not_in_list(o, value, method_name);
}

static int set_only(tool *t, const option *o, const char *value)
{
    const char *why;

    if (pt_lpe_compile(&t->lpe, &value, 1, &why) == PT_OK) {
        t->desc.li.lpe = &t->lpe;
        return EXIT_OK;
    }
    fprintf(stderr, "render: %s '%s': %s\n", o->name, value, why);
    return EXIT_USAGE;
}

static int set_roulette(tool *t, const option *o, const char *value)
{
    double p = 0;

    if (strcmp(value, "throughput") == 0) {
        t->desc.li.roulette = PT_ROULETTE_THROUGHPUT;
    } else if (strcmp(value, "none") == 0) {
        t->desc.li.roulette = PT_ROULETTE_NONE;
    } else if (parse_real(value, strlen(value), &p) && (pt_real)p > 0 && (pt_real)p < 1) {
        t->desc.li.roulette = PT_ROULETTE_CONSTANT;
        t->desc.li.roulette_survival = (pt_real)p;
    } else {
        return bad_value(o, value, o->wanted);
    }
    return EXIT_OK;
}

/* A radiance, three of them, or a picture. */
static int set_sky(tool *t, const option *o, const char *value)
{
    double v;
    int k;

    t->sky_image = NULL;
    t->sky.given = 1;
    if (is_picture_name(value)) {
        t->sky_image = value;
        return EXIT_OK;
    }
    if (parse_real(value, strlen(value), &v)) t->sky.v[0] = t->sky.v[1] = t->sky.v[2] = v;
    else if (!parse_triple(value, &t->sky)) return bad_value(o, value, o->wanted);
    for (k = 0; k < 3; k++)
        if (!(t->sky.v[k] >= 0 && t->sky.v[k] <= 1e18)) return bad_value(o, value, o->wanted);
    return EXIT_OK;
}

static int set_shard(tool *t, const option *o, const char *value)
{
    char part[12] = "";
    const char *slash = strchr(value, '/');
    uint64_t i, n;

    if (slash && slash - value < (ptrdiff_t)sizeof part) memcpy(part, value, (size_t)(slash - value));
    if (!slash || !parse_whole(part, UINT32_MAX - 1, &i) || !parse_whole(slash + 1, UINT32_MAX - 1, &n) || i < 1 || i > n)
        return bad_value(o, value, o->wanted);
    t->shard = (uint32_t)i;
    t->shards = (uint32_t)n;
    return EXIT_OK;
}

/* ---- the table -------------------------------------------------------------------------------------- */

static const char *const ppm_names[] = {"p6", "p6-16", "p3", "p3-16", NULL}; /* as pt_ppm_kind */
static const char *const filter_names[] = {"box", "tent", "gaussian", NULL};
static const char *const sampler_names[] = {"sobol", "independent", "stratified", NULL};
static const char *const progress_names[] = {"auto", "line", "plain", "off", NULL};

static const char a_picture[] = "a file name that ends in .png, .ppm or .pfm";
static const char a_point[] = "X,Y,Z";
static const char above_zero[] = "a number above 0";

#define AT(member) offsetof(tool, member)
static const option option_table[] = {
    {"-o", set_output, AT(outputs), MODE_FILMS, 0, 0, a_picture, NULL},
    {"--size", set_size, 0, MODE_RENDER, 0, 0, "WxH with both in 1..65536, such as 640x480", NULL},
    {"--exposure", set_real, AT(exposure), MODE_FILMS, 0, 1e30, above_zero, NULL},
    {"--ppm", set_name, AT(ppm), MODE_FILMS, 0, 0, "p6, p6-16, p3 or p3-16", ppm_names},
    {"--albedo", set_picture, AT(albedo), MODE_FILMS, 0, 0, a_picture, NULL},
    {"--normal", set_picture, AT(normal), MODE_FILMS, 0, 0, a_picture, NULL},
    {"--depth", set_picture, AT(depth), MODE_FILMS, 0, 0, a_picture, NULL},
    {"--error-map", set_picture, AT(error_map), MODE_FILMS, 0, 0, a_picture, NULL},
    {"--eye", set_triple, AT(eye), MODE_RENDER, 0, 0, a_point, NULL},
    {"--look-at", set_triple, AT(look_at), MODE_RENDER, 0, 0, a_point, NULL},
    {"--up", set_triple, AT(up), MODE_RENDER, 0, 0, a_point, NULL},
    {"--fov", set_real, AT(fov), MODE_RENDER, 0, 179.9, "an angle in degrees above 0 and at most 179.9", NULL},
    {"--aperture", set_real, AT(aperture), MODE_RENDER, 0, 1e18, above_zero, NULL},
    {"--focus", set_real, AT(focus), MODE_RENDER, 0, 1e18, above_zero, NULL},
    {"--rotate", set_triple, AT(rotate), MODE_MODEL, 0, 0, "X,Y,Z in degrees", NULL},
    {"--scale", set_real, AT(scale), MODE_MODEL, 0, 1e18, above_zero, NULL},
    {"--translate", set_triple, AT(translate), MODE_MODEL, 0, 0, a_point, NULL},
    {"--floor", set_flag, AT(floor), MODE_MODEL, 0, 0, NULL, NULL},
    {"--sky", set_sky, 0, MODE_MODEL, 0, 0, "a radiance of 0 or more, R,G,B, or a picture: .pfm, .ppm or .png", NULL},
    {"--lamp", set_real, AT(lamp), MODE_MODEL, 0, 1e18, "a radiance above 0", NULL},
    {"--spp", set_spp, 0, MODE_RENDER, 0, 0, "in 1..4294967294", NULL},
    {"--seconds", set_real, AT(desc.seconds), MODE_RENDER, 0, 1e9, "above 0 and at most 1e9", NULL},
    {"--cpu-seconds", set_real, AT(desc.cpu_seconds), MODE_RENDER, 0, 1e9, "above 0 and at most 1e9", NULL},
    {"--error", set_real, AT(desc.target_error), MODE_RENDER, 0, 1e6, "above 0, such as 0.05", NULL},
    {"--method", set_method, 0, MODE_RENDER, 0, 0, NULL, NULL},
    {"--sampler", set_name, AT(sampler), MODE_RENDER, 0, 0, "sobol, independent or stratified", sampler_names},
    {"--filter", set_name, AT(filter), MODE_RENDER, 0, 0, "box, tent or gaussian", filter_names},
    {"--seed", set_seed, 0, MODE_RENDER, 0, 0, "a whole number below 2^64", NULL},
    {"--only", set_only, 0, MODE_RENDER, 0, 0, NULL, NULL},
    {"--max-edges", set_whole, AT(desc.li.max_edges), MODE_RENDER, 0, 2147483647.0, "a whole number, 0 for no limit", NULL},
    {"--roulette", set_roulette, 0, MODE_RENDER, 0, 0, "throughput, none, or a probability between 0 and 1", NULL},
    {"--branching", set_whole, AT(desc.li.branching), MODE_RENDER, 1, 1024, "in 1..1024", NULL},
    {"--threads", set_whole, AT(desc.threads), MODE_RENDER, 0, 1024, "in 0..1024 (0: all)", NULL},
    {"--csv", set_text, AT(csv), MODE_RENDER, 0, 0, NULL, NULL},
    {"--svg", set_text, AT(svg), MODE_RENDER, 0, 0, NULL, NULL},
    {"--reference", set_text, AT(reference), MODE_RENDER, 0, 0, NULL, NULL},
    {"--progress", set_name, AT(progress), ~0, 0, 0, "auto, line, plain or off", progress_names},
    {"--verbose", set_flag, AT(verbose), MODE_RENDER, 0, 0, NULL, NULL},
    {"--film", set_text, AT(film), MODE_FILMS, 0, 0, NULL, NULL},
    {"--checkpoint", set_text, AT(checkpoint), MODE_RENDER, 0, 0, NULL, NULL},
    {"--every", set_real, AT(every), MODE_RENDER, 0, 1e9, "seconds above 0 and at most 1e9", NULL},
    {"--resume", set_flag, AT(resume), MODE_RENDER, 0, 0, NULL, NULL},
    {"--shard", set_shard, 0, MODE_RENDER, 0, 0, "I/N with I in 1..N, such as 3/8", NULL},
    {"--merge", set_flag, AT(merge), MODE_MERGE, 0, 0, NULL, NULL},
    {"--compare", set_flag, AT(compare), MODE_COMPARE, 0, 0, NULL, NULL},
    {"--list", set_flag, AT(list), ~0, 0, 0, NULL, NULL},
    {"--help", set_flag, AT(help), ~0, 0, 0, NULL, NULL},
    {"-h", set_flag, AT(help), ~0, 0, 0, NULL, NULL},
};
enum { OPTION_COUNT = sizeof option_table / sizeof option_table[0] };

/* ---- help ------------------------------------------------------------------------------------------- */

static void print_help(void)
{
    fputs("usage: render [SCENE | MODEL.obj] [options]  renders it (default: cornell)\n"
          "       render --merge A.film B.film ... [-o FILE] [--film FILE]   joins shards\n"
          "       render --compare A B                  how far picture or film A is from B\n"
          "Picture  -o FILE           .png, .ppm, .pfm (linear); repeatable (SCENE.png)\n"
          "         --size WxH        pixels (256x256)\n"
          "         --exposure X      factor of brightness in .png and .ppm (1)\n"
          "         --ppm FORM        p6 (default), p3 is text, p6-16, p3-16 have 16 bits\n"
          "         --albedo FILE  --normal FILE  --depth FILE     of what the eye meets\n"
          "         --error-map FILE  estimated relative error of each pixel\n"
          "Camera   --eye X,Y,Z  --look-at X,Y,Z  --up X,Y,Z  --fov DEGREES (vertical)\n"
          "         --aperture R  --focus D    lens radius, distance that is sharp\n"
          "                           (default: the scene's own; a model is framed)\n"
          "Model    --rotate X,Y,Z  --scale S  --translate X,Y,Z    degrees; in this order\n"
          "         --floor           a grey floor under it\n"
          "         --sky L           light from all around: radiance, R,G,B, or a picture\n"
          "         --lamp L          a round lamp in the sky, left above the eye: radiance\n"
          "Budget   --spp N           samples per pixel (64; no limit with one of the next)\n"
          "         --seconds S  --cpu-seconds S     time of the clock, of all threads\n"
          "         --error E         until the estimated relative error is below E\n"
          "Method   --method NAME  --sampler NAME     see --list\n"
          "         --filter NAME     of the pixel: box (default), tent, gaussian\n"
          "         --only WORDS      light along such paths only: 'LS+DE', 'L(S|D)*DDE'\n"
          "         --max-edges N     longest path: 1 lights, 2 direct light, ... (any)\n"
          "         --roulette R      throughput (default), none, or a survival probability\n"
          "         --branching N     directions per hit of method branching (4)\n"
          "         --seed N          other random numbers (0)\n"
          "         --threads N       (0: all there are); the same picture for any N\n"
          "Report   --csv FILE  --svg FILE     error against time; the table is on stdout\n"
          "         --reference FILE  a converged picture, for true errors in the table\n"
          "         --progress STYLE  line, plain, off (line on a terminal, else plain)\n"
          "         --verbose         what the scene holds and needs\n"
          "         --list            scenes, methods, samplers\n"
          "Long     --film FILE       the sums of all samples, for --merge and --compare\n"
          "         --checkpoint FILE that film, every --every S seconds (60), at the end\n"
          "         --resume          go on from the checkpoint, if there is one\n"
          "         --shard I/N       the I-th of N parts of the samples, into a film\n"
          "Ctrl-C keeps what is done.  Exit: 0 done, 1 failed, 2 command line, 130 Ctrl-C\n",
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

/* ---- reading the command line ----------------------------------------------------------------------- */

static int usage_error(const char *what, const char *sentence)
{
    fprintf(stderr, "render: %s: %s\n", what, sentence);
    return EXIT_USAGE;
}

/* Takes one option: "--name", "--name value" or "--name=value". Moves *i to the last argument that it used and notes
   the option in `given`. */
static int take_option(tool *t, int argc, char **argv, int *i, char *given)
{
    const char *arg = argv[*i], *equals = strncmp(arg, "--", 2) == 0 ? strchr(arg, '=') : NULL;
    size_t length = equals ? (size_t)(equals - arg) : strlen(arg);
    int k;

    for (k = 0; k < OPTION_COUNT; k++) {
        const option *o = &option_table[k];
        if (strlen(o->name) != length || strncmp(o->name, arg, length) != 0) continue;
        given[k] = 1;
        if (o->set == set_flag) return equals ? usage_error(o->name, "takes no value") : set_flag(t, o, NULL);
        if (equals) return o->set(t, o, equals + 1);
        if (*i + 1 == argc) return usage_error(o->name, "needs a value; see --help");
        return o->set(t, o, argv[++*i]);
    }
    return usage_error(arg, "there is no such option; see --help");
}

static const char *scene_name(int i)
{
    int count;
    const pt_scene_entry *scenes = pt_scenes(&count);

    return i < count ? scenes[i].name : NULL;
}

/* What the words on the command line mean, which also tells the mode. */
static int finish_words(tool *t)
{
    static const option scene = {"scene", NULL, 0, 0, 0, 0, NULL, NULL};
    static char cornell[] = "cornell", *fallback[1] = {cornell};

    if (t->merge && t->compare) return usage_error("--merge", "not together with --compare");
    t->mode = t->merge ? MODE_MERGE : t->compare ? MODE_COMPARE : MODE_SCENE;
    if (t->merge && t->word_count < 1) return usage_error("--merge", "needs the names of films");
    if (t->compare && t->word_count != 2) return usage_error("--compare", "needs two pictures or films");
    if (t->merge || t->compare) return EXIT_OK;
    if (t->word_count > 1) return usage_error(t->words[1], "one scene or model at a time");
    if (t->word_count == 0) t->words = fallback;
    if (has_extension(t->words[0], "obj")) t->mode = MODE_MODEL;
    else if (!pt_scene_find(t->words[0])) return not_in_list(&scene, t->words[0], scene_name);
    return EXIT_OK;
}

/* Options that mean nothing in this mode are a mistake, not something to pass over. */
static int check_modes(const tool *t, const char *given)
{
    int k;

    for (k = 0; k < OPTION_COUNT; k++)
        if (given[k] && !(option_table[k].modes & t->mode))
            return usage_error(option_table[k].name, t->mode == MODE_MERGE     ? "means nothing with --merge"
                                                : t->mode == MODE_COMPARE ? "means nothing with --compare"
                                                : option_table[k].modes == MODE_MODEL
                                                    ? "is for a model (a file that ends in .obj)"
                                                    : "means nothing here");
    return EXIT_OK;
}

/* Combinations that single options cannot see. */
static int check_combinations(const tool *t)
{
    const pt_render_desc *d = &t->desc;
    int timed = d->seconds > 0 || d->cpu_seconds > 0 || d->target_error > 0;

    if (d->li.roulette == PT_ROULETTE_NONE && d->li.max_edges == 0)
        return usage_error("--roulette none", "needs --max-edges, or no path would ever end");
    if (t->sampler == PT_SAMPLER_STRATIFIED && timed)
        return usage_error("--sampler stratified", "needs a known number of samples; drop --seconds, --cpu-seconds and --error");
    if (t->sampler == PT_SAMPLER_STRATIFIED && (t->checkpoint || t->shards))
        return usage_error("--sampler stratified", "its samples belong to one pass; not with --checkpoint or --shard");
    if (t->shards && timed && d->spp == 0) return usage_error("--shard", "needs --spp, the samples of the whole picture");
    if (t->resume && !t->checkpoint) return usage_error("--resume", "needs --checkpoint FILE");
    if (t->every > 0 && !t->checkpoint) return usage_error("--every", "needs --checkpoint FILE");
    if (t->error_map && d->li.lpe) return usage_error("--error-map", "is not known for one class of paths; not with --only");
    if (d->li.lpe && !pt_method_find(d->method)->classes)
        return usage_error("--only", "this method cannot tell paths apart; path and distribution can");
    return EXIT_OK;
}

/* The words' end of a path without directories and extension: "a/b/teapot.obj" gives "teapot". */
static void base_name(const char *path, char *out, size_t size)
{
    const char *from = path + strlen(path);
    size_t length;

    while (from > path && from[-1] != '/' && from[-1] != '\\') from--;
    length = strcspn(from, ".");
    if (length >= size) length = size - 1;
    memcpy(out, from, length);
    out[length] = '\0';
}

/* Without -o and --film: a picture, or of a shard a film, named after the scene. */
static void default_outputs(tool *t)
{
    char base[256];

    if (t->mode == MODE_COMPARE || t->output_count > 0 || t->film) return;
    base_name(t->words[0], base, sizeof base);
    if (t->shards) {
        snprintf(t->default_output, sizeof t->default_output, "%s-%u-of-%u.film", base, (unsigned)t->shard, (unsigned)t->shards);
        t->film = t->default_output;
        return;
    }
    snprintf(t->default_output, sizeof t->default_output, "%s.png", t->mode == MODE_MERGE ? "merged" : base);
    t->outputs[t->output_count++] = t->default_output;
}

/* The samples of shard I of N. Shards begin at even samples where there are enough, so that each half of the film
   gets as many samples as the other. */
static int choose_samples(tool *t)
{
    pt_render_desc *d = &t->desc;
    uint64_t begin, end;

    if (d->spp == 0 && !(d->seconds > 0 || d->cpu_seconds > 0 || d->target_error > 0)) d->spp = 64;
    if (t->shards == 0) return EXIT_OK;
    if (d->spp < t->shards) return usage_error("--shard", "fewer samples than shards: give more --spp");
    begin = (uint64_t)d->spp * (t->shard - 1) / t->shards;
    end = (uint64_t)d->spp * t->shard / t->shards;
    if (d->spp / t->shards >= 2) {
        begin &= ~UINT64_C(1);
        if (t->shard < t->shards) end &= ~UINT64_C(1);
    }
    d->first_sample = (uint32_t)begin;
    d->spp = (uint32_t)(end - begin);
    return EXIT_OK;
}

/* Fills the tool from the arguments: EXIT_OK, or EXIT_USAGE after one line on stderr. */
static int parse_arguments(tool *t, int argc, char **argv)
{
    char given[OPTION_COUNT] = {0};
    int i, status = EXIT_OK;

    t->words = argv + 1; /* the words move to the front, over options that were read already */
    for (i = 1; i < argc && status == EXIT_OK; i++)
        if (argv[i][0] == '-') status = take_option(t, argc, argv, &i, given);
        else t->words[t->word_count++] = argv[i];
    if (status != EXIT_OK || t->help || t->list) return status;
    status = finish_words(t);
    if (status == EXIT_OK) status = check_modes(t, given);
    if (status == EXIT_OK) status = check_combinations(t);
    if (status == EXIT_OK) status = choose_samples(t);
    if (status != EXIT_OK) return status;
    t->desc.filter = (pt_filter)t->filter;
    t->desc.sampler = (pt_sampler_kind)t->sampler;
    t->desc.aov = t->albedo || t->normal || t->depth;
    default_outputs(t);
    return EXIT_OK;
}
