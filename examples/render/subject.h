/* subject.h - a part of render.c: what is rendered. A canonical scene comes with its camera and its lights; a model
   from a file is turned and moved, framed by a camera, and lit if it brings no light of its own. */

/* The box of a model, and which way is up. */
typedef struct extent {
    pt_vec3 lo, hi, centre;
    double radius;              /* half the diagonal                                                       */
    pt_vec3 right, up, front;   /* unit, at right angles; front is where the eye stands by default         */
} extent;

static pt_vec3 vec3_of(const triple *t)
{
    return pt_v3((pt_real)t->v[0], (pt_real)t->v[1], (pt_real)t->v[2]);
}

/* a + s b */
static pt_vec3 along(pt_vec3 a, double s, pt_vec3 b)
{
    return pt_v3_add(a, pt_v3_scale(b, (pt_real)s));
}

/* One line on stderr about the subject; 0, for returning. */
static int subject_error(const tool *t, const char *sentence)
{
    fprintf(stderr, "render: %s: %s\n", t->words[0], sentence);
    return 0;
}

/* ---- placing a model -------------------------------------------------------------------------------- */

/* --rotate about the x axis, then y, then z; then --scale; then --translate: rows of (A | t). */
static void placement_of(const tool *t, double m[3][4])
{
    double s[3], c[3];
    int k, i;

    for (k = 0; k < 3; k++) {
        s[k] = sin(t->rotate.v[k] * (PT_PI / 180));
        c[k] = cos(t->rotate.v[k] * (PT_PI / 180));
    }
    m[0][0] = c[2] * c[1];
    m[0][1] = c[2] * s[1] * s[0] - s[2] * c[0];
    m[0][2] = c[2] * s[1] * c[0] + s[2] * s[0];
    m[1][0] = s[2] * c[1];
    m[1][1] = s[2] * s[1] * s[0] + c[2] * c[0];
    m[1][2] = s[2] * s[1] * c[0] - c[2] * s[0];
    m[2][0] = -s[1];
    m[2][1] = c[1] * s[0];
    m[2][2] = c[1] * c[0];
    for (k = 0; k < 3; k++) {
        for (i = 0; i < 3; i++) m[k][i] *= t->scale;
        m[k][3] = t->translate.v[k];
    }
}

/* Tells what the loader had to pass over. */
static void tell_warnings(const pt_obj_info *info)
{
    uint32_t i, shown = info->warning_count < PT_OBJ_WARNINGS ? info->warning_count : PT_OBJ_WARNINGS;

    for (i = 0; i < shown; i++) fprintf(stderr, "render: warning: %s\n", info->warnings[i]);
    if (info->warning_count > shown)
        fprintf(stderr, "render: ... and %u more such warnings\n", (unsigned)(info->warning_count - shown));
}

/* --verbose */
static void tell_contents(const tool *t, const pt_obj_info *info)
{
    fprintf(stderr, "%s: triangles %u, vertices %u, materials %u, textures %u; left out: faces without area %u, lines %u\n",
            t->words[0], (unsigned)info->triangles, (unsigned)info->vertices, (unsigned)info->materials,
            (unsigned)info->textures, (unsigned)info->degenerate_faces, (unsigned)info->skipped_lines);
    fprintf(stderr, "%s: from %g,%g,%g to %g,%g,%g\n", t->words[0], (double)info->lo.x, (double)info->lo.y,
            (double)info->lo.z, (double)info->hi.x, (double)info->hi.y, (double)info->hi.z);
}

/* The axes: up as asked for, front towards +z, or, where that is up, towards -y. 0: --up has no length. */
static int upright(const tool *t, extent *e)
{
    static const pt_vec3 z = {0, 0, 1}, minus_y = {0, -1, 0};
    pt_vec3 f;

    e->up = t->up.given ? pt_v3_normalize(vec3_of(&t->up)) : pt_v3(0, 1, 0);
    if (!(pt_v3_length(e->up) > 0)) return 0;
    f = fabs((double)e->up.z) < 0.9 ? z : minus_y;
    e->front = pt_v3_normalize(along(f, -(double)pt_v3_dot(f, e->up), e->up));
    e->right = pt_v3_cross(e->up, e->front);
    return 1;
}

/* The box around all triangles, its middle and its axes. */
static int measure(const tool *t, const pt_obj_info *info, extent *e)
{
    if (!upright(t, e)) return subject_error(t, "--up has no direction");
    e->lo = info->lo;
    e->hi = info->hi;
    e->centre = pt_v3_scale(pt_v3_add(e->lo, e->hi), (pt_real)0.5);
    e->radius = 0.5 * (double)pt_v3_length(pt_v3_sub(e->hi, e->lo));
    return e->radius > 0 ? 1 : subject_error(t, "all its vertices are one point");
}

/* Corner k = 0..7 of the box, seen from its centre. */
static pt_vec3 box_corner(const extent *e, int k)
{
    return pt_v3_sub(pt_v3(k & 1 ? e->lo.x : e->hi.x, k & 2 ? e->lo.y : e->hi.y, k & 4 ? e->lo.z : e->hi.z), e->centre);
}

/* ---- framing ---------------------------------------------------------------------------------------- */

/* How far from the centre the eye must be for a corner of the box to lie on the edge of the picture, at most:
   depth z >= |x| / tan of half the angle, for the corner farthest out. */
static double framing_distance(const extent *e, const pt_camera *axes, double aspect)
{
    double tan_y = (double)axes->tan_half, tan_x = tan_y * aspect, distance = 0;
    int k;

    for (k = 0; k < 8; k++) {
        pt_vec3 v = box_corner(e, k);
        double towards = -(double)pt_v3_dot(v, axes->forward);
        distance = fmax(distance, towards + fabs((double)pt_v3_dot(v, axes->right)) / tan_x);
        distance = fmax(distance, towards + fabs((double)pt_v3_dot(v, axes->up)) / tan_y);
    }
    return distance;
}

/* A camera in front, to the right and above, that sees all of the box and a rim of a twentieth. */
static pt_camera frame_model(const tool *t, const extent *e)
{
    const pt_real fov = (pt_real)(t->fov > 0 ? t->fov : 40);
    const double aspect = (double)t->desc.width / (double)t->desc.height;
    pt_vec3 way = pt_v3_normalize(along(along(e->front, 0.5, e->right), 0.4, e->up));
    pt_camera axes = pt_camera_look_at(along(e->centre, e->radius, way), e->centre, e->up, fov);

    return pt_camera_look_at(along(e->centre, 1.05 * framing_distance(e, &axes, aspect), way), e->centre, e->up, fov);
}

/* What --eye, --look-at, --up, --fov, --aperture and --focus change about a camera. `target` is what it looks at, `up` is up
   for all that is seen: the camera's own axis leans with its view. 0: the view is not possible. */
static int adjust_camera(const tool *t, pt_vec3 target, pt_vec3 up, pt_camera *c)
{
    const double fov = t->fov > 0 ? t->fov : 2 * atan((double)c->tan_half) * 180 / PT_PI;
    pt_camera was = *c;

    if (t->look_at.given) target = vec3_of(&t->look_at);
    if (t->eye.given || t->look_at.given || t->up.given) {
        *c = pt_camera_look_at(t->eye.given ? vec3_of(&t->eye) : was.position, target,
                               t->up.given ? vec3_of(&t->up) : up, (pt_real)fov);
        c->lens_radius = was.lens_radius;
        c->focus_distance = was.focus_distance;
        c->near_distance = was.near_distance;
    } else if (t->fov > 0) {
        c->tan_half = (pt_real)tan(fov * (PT_PI / 360));
    }
    if (t->aperture > 0) {
        c->lens_radius = (pt_real)t->aperture;
        c->focus_distance = pt_v3_dot(pt_v3_sub(target, c->position), c->forward);
    }
    if (t->focus > 0) c->focus_distance = (pt_real)t->focus;
    return c->tan_half > 0 ? 1 : subject_error(t, "no such camera: the eye is what it looks at, or --up lies along the view");
}

/* ---- floor and light -------------------------------------------------------------------------------- */

/* A grey square below the box, twenty times as wide as its radius. */
static void add_floor(pt_scene *scene, const extent *e)
{
    const double side = 20 * e->radius;
    int grey = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey((pt_real)0.5))), k;
    pt_vec3 corner;
    double lowest = HUGE_VAL;

    for (k = 0; k < 8; k++) lowest = fmin(lowest, (double)pt_v3_dot(box_corner(e, k), e->up));
    corner = along(along(along(e->centre, lowest, e->up), -side / 2, e->right), -side / 2, e->front);
    pt_add_parallelogram(scene, corner, pt_v3_scale(e->front, (pt_real)side), pt_v3_scale(e->right, (pt_real)side), grey);
}

/* Where --lamp shines from: left above and behind the eye. */
static pt_vec3 lamp_direction(const extent *e, const pt_camera *c)
{
    return pt_v3_normalize(along(along(e->up, -0.8, c->right), -0.7, c->forward));
}

/* Adds the lamp to a picture of the sky: a disc of a quarter of a steradian, cos = 1 - 0.25 / (2 pi). Being part of the
   sky it needs no light of its own, and is sampled as much as its brightness deserves. */
static void paint_lamp(float *rgb, int width, int height, pt_vec3 way, double radiance)
{
    int x, y, k;

    for (y = 0; y < height; y++)
        for (x = 0; x < width; x++) {
            /* longitude from -z, see pt_set_environment_image */
            const double theta = (y + 0.5) / height * PT_PI, phi = ((x + 0.5) / width - 0.5) * 2 * PT_PI;
            pt_vec3 w = pt_v3((pt_real)(sin(theta) * sin(phi)), (pt_real)cos(theta), (pt_real)(-sin(theta) * cos(phi)));
            if ((double)pt_v3_dot(w, way) < 1 - 0.25 / (2 * PT_PI)) continue;
            for (k = 0; k < 3; k++) rgb[3 * ((size_t)y * (size_t)width + (size_t)x) + (size_t)k] += (float)radiance;
        }
}

/* Lights the scene by a picture in memory and the lamp. */
static void add_sky_picture(pt_scene *scene, pt_image *sky, pt_vec3 way, double lamp)
{
    if (lamp > 0) paint_lamp(sky->rgb, sky->width, sky->height, way, lamp);
    pt_set_environment_image(scene, sky->rgb, sky->width, sky->height, 1);
}

/* A sky of one radiance. With a lamp it is a picture whose pixels are a degree wide. */
static int add_even_sky(const tool *t, pt_scene *scene, const double radiance[3], pt_vec3 way, double lamp)
{
    enum { WIDTH = 360, HEIGHT = 180 };
    pt_image sky = PT_IMAGE_INIT;
    size_t i;

    if (!(lamp > 0)) {
        pt_set_environment(scene, pt_rgb3((pt_real)radiance[0], (pt_real)radiance[1], (pt_real)radiance[2]));
        return 1;
    }
    sky.width = WIDTH;
    sky.height = HEIGHT;
    sky.rgb = (float *)malloc(3 * (size_t)WIDTH * HEIGHT * sizeof *sky.rgb);
    if (!sky.rgb) return subject_error(t, pt_result_string(PT_ERROR_MEMORY));
    for (i = 0; i < 3 * (size_t)WIDTH * HEIGHT; i++) sky.rgb[i] = (float)radiance[i % 3];
    add_sky_picture(scene, &sky, way, lamp);
    free(sky.rgb);
    return 1;
}

/* --sky with a picture. */
static int add_sky_file(const tool *t, pt_scene *scene, pt_vec3 way)
{
    pt_image sky = PT_IMAGE_INIT;

    if (pt_read_image(t->sky_image, &sky) != PT_OK) {
        fprintf(stderr, "render: --sky '%s': cannot be read as a picture\n", t->sky_image);
        return 0;
    }
    add_sky_picture(scene, &sky, way, t->lamp);
    pt_image_free(&sky);
    return 1;
}

/* The sky and the lamp that are asked for; for a model without any light, a weak sky and a lamp, which give a white
   surface that faces the lamp a radiance just below 1. */
static int light_model(const tool *t, pt_scene *scene, pt_vec3 way, int emits)
{
    static const double dim[3] = {0.25, 0.25, 0.25};

    if (t->sky_image) return add_sky_file(t, scene, way);
    if (t->sky.given || t->lamp > 0) return add_even_sky(t, scene, t->sky.v, way, t->lamp);
    if (emits) return 1;
    fprintf(stderr, "render: %s has no light of its own: added a sky (--sky 0.25) and a lamp (--lamp 9)\n", t->words[0]);
    return add_even_sky(t, scene, dim, way, 9);
}

/* ---- the subject ------------------------------------------------------------------------------------ */

static int commit_subject(const tool *t, pt_scene *scene)
{
    pt_result result = pt_commit(scene);

    return result == PT_OK ? 1 : subject_error(t, result == PT_ERROR_SCENE ? pt_scene_error(scene) : pt_result_string(result));
}

static int make_model(tool *t, pt_scene *scene)
{
    pt_obj_options options = {{{0}}, 0, 0, 0};
    pt_obj_info info;
    pt_result result;
    extent e;

    memset(&e, 0, sizeof e);
    placement_of(t, options.transform);
    result = pt_load_obj(scene, t->words[0], &options, &info);
    if (result != PT_OK && info.error[0]) fprintf(stderr, "render: %s\n", info.error); /* it names the file */
    else if (result != PT_OK) return subject_error(t, pt_result_string(result));
    if (result != PT_OK) return 0;
    tell_warnings(&info);
    if (t->verbose) tell_contents(t, &info);
    if (!measure(t, &info, &e)) return 0;
    t->desc.camera = frame_model(t, &e);
    if (!adjust_camera(t, e.centre, e.up, &t->desc.camera)) return 0;
    if (t->floor) add_floor(scene, &e);
    return light_model(t, scene, lamp_direction(&e, &t->desc.camera), info.emissive_triangles > 0) && commit_subject(t, scene);
}

static int make_canonical(tool *t, pt_scene *scene)
{
    pt_camera *c = &t->desc.camera;
    pt_result result = pt_scene_find(t->words[0])->make(scene, c);
    pt_ray ray;
    pt_hit hit;

    if (result != PT_OK) return subject_error(t, result == PT_ERROR_SCENE ? pt_scene_error(scene) : pt_result_string(result));
    ray = pt_camera_ray(c, 1, (pt_real)0.5, (pt_real)0.5, pt_v2(0, 0)); /* what it looks at */
    return adjust_camera(t, pt_intersect(scene, &ray, &hit) ? hit.p : pt_v3_add(c->position, c->forward), pt_v3(0, 1, 0), c);
}

/* What the scene holds (--verbose), and what the method will not show of it. */
static void describe_subject(const tool *t, const pt_scene *scene)
{
    char words[256];
    const pt_method *method = pt_method_find(t->desc.method);

    if (t->verbose)
        fprintf(stderr, "%s: primitives %u, lights %u; needs %s\n", t->words[0], (unsigned)scene->primitive_count,
                (unsigned)scene->light_count, pt_scene_needs_string(scene, words, sizeof words));
    if (method && (pt_scene_needs(scene) & ~method->handles) != 0)
        fprintf(stderr, "render: warning: method %s cannot show all of %s: %s\n", method->name, t->words[0], method->summary);
}

/* Fills the scene and the camera: 1, or 0 after one line on stderr. */
static int make_subject(tool *t, pt_scene *scene)
{
    double start = pt_wall_seconds();

    if (!(t->mode == MODE_MODEL ? make_model(t, scene) : make_canonical(t, scene))) return 0;
    if (t->verbose) fprintf(stderr, "%s: ready after %.2f s\n", t->words[0], pt_wall_seconds() - start);
    describe_subject(t, scene);
    return 1;
}
