/* stress_report.c: sets the rows of the stress suite side by side.

       stress_report FLOAT.txt DOUBLE.txt OUT.csv OUT.html

   Reads what tests/stress.c printed in both precisions; prints the table, writes it as CSV and as HTML with plots of
   error against scale and offset, compares the pictures of the twin, and ends with the numeric constants of the header
   that act as tolerances, each with the line where it is derived. Exits 1 if a row failed, if the two outputs do not
   belong together, or if a constant of the list is not in the header any more. */

#define PT_STATIC
#include "pathtracer.h"

#include <stdlib.h>

enum { MAX_ROWS = 4096, MAX_FIELD = 16, BLOCKS = 64, MAX_SCENES = 64, MAX_LATER = 32 };

/* One row of one precision; the fields point into its text. */
typedef struct half {
    char *field[MAX_FIELD];
} half;
enum {
    GROUP = 1,
    NAME,
    QUANTITY,
    SCALE,
    OFFSET,
    GOT,
    EXACT,
    ERROR,
    UNIT,
    BOUND,
    VERDICT,
    NANS,
    SECONDS,
    WHY,
    FIELDS
};

typedef struct output {
    char *text;
    half row[MAX_ROWS];
    int rows;
    struct {
        const char *name;
        double block[BLOCKS];
        int blocks;
    } scene[MAX_SCENES];
    int scenes;
    char *later[MAX_LATER];
    int laters, complete, lost; /* lost: rows that are not rows */
} output;

/* ---- reading ----------------------------------------------------------------------------------------- */

static char *read_all(const char *path)
{
    FILE *const file = fopen(path, "rb");
    char *text = NULL;
    size_t room = 1 << 16, n = 0, got = 1;
    while (file && got > 0) {
        char *const grown = (char *)realloc(text, room *= 2);
        if (!grown) break;
        text = grown;
        got = fread(text + n, 1, room - n - 1, file);
        n += got;
        text[n] = '\0';
    }
    if (file) fclose(file);
    return text;
}

static int cut(char *line, char **field)
{
    int n = 0;
    for (field[n++] = line; n < MAX_FIELD && (line = strchr(line, '|')) != NULL;) {
        *line++ = '\0';
        field[n++] = line;
    }
    return n;
}

static void take_twin(output *o, char **field)
{
    int k = o->scenes - 1;
    if (k < 0 || strcmp(o->scene[k].name, field[1]) != 0) {
        if (o->scenes == MAX_SCENES) return;
        k = o->scenes++;
        o->scene[k].name = field[1];
    }
    if (o->scene[k].blocks < BLOCKS) o->scene[k].block[o->scene[k].blocks++] = strtod(field[3], NULL);
}

static int read_output(output *o, const char *path)
{
    char *line, *next;
    o->text = read_all(path);
    for (line = o->text; line && *line; line = next) {
        char *field[MAX_FIELD];
        next = strchr(line, '\n');
        if (next) *next++ = '\0';
        if (strncmp(line, "stress: ", 8) == 0) o->complete = 1;
        if (strncmp(line, "later|", 6) == 0 && o->laters < MAX_LATER) o->later[o->laters++] = line + 6;
        if (strncmp(line, "twin|", 5) == 0 && cut(line, field) == 4) take_twin(o, field);
        if (strncmp(line, "row|", 4) == 0) {
            if (o->rows < MAX_ROWS && cut(line, o->row[o->rows].field) == FIELDS) o->rows++;
            else o->lost++;
        }
        if (!next) break;
    }
    return o->complete;
}

static int same_case(const half *a, const half *b)
{
    return strcmp(a->field[GROUP], b->field[GROUP]) == 0 && strcmp(a->field[NAME], b->field[NAME]) == 0 &&
           strcmp(a->field[QUANTITY], b->field[QUANTITY]) == 0;
}

/* Labels of one case may stand for several rows in order: the search goes on where the last one ended. */
static const half *find(const output *o, const half *r, int *from)
{
    int i;
    for (i = 0; i < o->rows; i++) {
        const int k = (*from + i) % o->rows;
        if (!same_case(&o->row[k], r)) continue;
        *from = k + 1;
        return &o->row[k];
    }
    return NULL;
}

/* ---- table, CSV -------------------------------------------------------------------------------------- */

static const char *of(const half *h, int field) { return h ? h->field[field] : "-"; }

static void print_row(const half *f, const half *d)
{
    const half *const any = f ? f : d;
    printf("%-10s %-46.46s %-30.30s %10s %-12.12s %8s %-6s %10s %8s %-6s %8s %8s\n", any->field[GROUP],
           any->field[NAME], any->field[QUANTITY], of(f, ERROR), any->field[UNIT], of(f, BOUND),
           of(f, VERDICT), of(d, ERROR), of(d, BOUND), of(d, VERDICT), of(f, SECONDS), of(d, SECONDS));
    if (f && f->field[WHY][0]) printf("           float: %s\n", f->field[WHY]);
    if (d && d->field[WHY][0]) printf("           double: %s\n", d->field[WHY]);
}

static void csv_text(FILE *csv, const char *text)
{
    fputc('"', csv);
    for (; *text; text++) fprintf(csv, *text == '"' ? "\"%c" : "%c", *text);
    fputc('"', csv);
}

static void csv_row(FILE *csv, const half *f, const half *d)
{
    static const int numbers[8] = {GOT, EXACT, ERROR, BOUND, VERDICT, NANS, SECONDS, WHY};
    const half *const any = f ? f : d;
    int k, p;
    for (k = GROUP; k <= QUANTITY; k++) {
        csv_text(csv, any->field[k]);
        fputc(',', csv);
    }
    fprintf(csv, "%s,%s,%s", any->field[SCALE], any->field[OFFSET], any->field[UNIT]);
    for (p = 0; p < 2; p++)
        for (k = 0; k < 8; k++) {
            const half *const h = p ? d : f;
            fputc(',', csv);
            if (h && numbers[k] == WHY)
                csv_text(csv, h->field[WHY]);
            else if (h)
                fputs(h->field[numbers[k]], csv);
        }
    fputc('\n', csv);
}

/* ---- plots -------------------------------------------------------------------------------------------- */

/* Rows whose name begins with `name` and whose quantity is `quantity`: error against scale or offset. */
typedef struct plot {
    const char *title, *group, *name, *quantity, *x_label;
    int x;
} plot;
static const plot PLOTS[] = {
    {"Distance to a triangle: error in bounds of [PT-06]", "shapes", "triangle", "t", "scale", SCALE},
    {"Distance to a sphere: error in bounds", "shapes", "sphere", "t", "scale", SCALE},
    {"Distance to a triangle, translated: error in bounds", "shapes", "triangle", "t", "translation / size",
     OFFSET},
    {"Furnace, a sphere: paths that leak, of 4000", "self", "sphere,", "paths that leak or meet their start",
     "offset / size", OFFSET},
    {"Furnace, a box of triangles: paths that leak, of 4000", "self", "box of triangles",
     "paths that leak or meet their start", "offset / size", OFFSET},
    {"Furnace, a ball of triangles: paths that leak, of 4000", "self", "ball of triangles",
     "paths that leak or meet their start", "offset / size", OFFSET},
    {"Furnace, albedo 1 - x: z of the mean", "transport", "furnace, albedo", "mean", "1 - albedo", SCALE},
    {"Lamp of radius x: z of the mean", "transport", "lamp of radius", "mean", "radius", SCALE},
    {"Corner, x from the wall: z of the mean", "transport", "corner", "mean", "distance", SCALE}};

static int in_plot(const plot *p, const half *h)
{
    return strcmp(h->field[GROUP], p->group) == 0 && strcmp(h->field[QUANTITY], p->quantity) == 0 &&
           strncmp(h->field[NAME], p->name, strlen(p->name)) == 0 && strtod(h->field[p->x], NULL) > 0;
}

static void plot_points(FILE *html, const plot *p, const output *o, const double range[2], double top,
                        int is_double)
{
    int i;
    for (i = 0; i < o->rows; i++) {
        const half *const h = &o->row[i];
        double x, y;
        if (!in_plot(p, h)) continue;
        x = 50 + 400 * (log10(strtod(h->field[p->x], NULL)) - range[0]) / fmax(range[1] - range[0], 1);
        y = 170 - 140 * fmin(strtod(h->field[ERROR], NULL), top) / top;
        if (is_double)
            fprintf(html, "<rect x='%.1f' y='%.1f' width='6' height='6' fill='#b23' fill-opacity='.6'/>\n",
                    x - 3, y - 3);
        else
            fprintf(html,
                    "<circle cx='%.1f' cy='%.1f' r='4' fill='none' stroke='#25b' stroke-width='1.5'/>\n", x,
                    y);
    }
}

static void draw_plot(FILE *html, const plot *p, const output *o)
{
    double range[2] = {HUGE_VAL, -HUGE_VAL}, top = 0;
    int i, k;
    for (k = 0; k < 2; k++)
        for (i = 0; i < o[k].rows; i++) {
            const half *const h = &o[k].row[i];
            if (!in_plot(p, h)) continue;
            range[0] = fmin(range[0], log10(strtod(h->field[p->x], NULL)));
            range[1] = fmax(range[1], log10(strtod(h->field[p->x], NULL)));
            if (strtod(h->field[ERROR], NULL) < HUGE_VAL) top = fmax(top, strtod(h->field[ERROR], NULL));
        }
    if (!(range[1] >= range[0])) return;
    top = top > 0 ? 1.1 * top : 1;
    fprintf(html,
            "<svg width='500' height='220' font-family='sans-serif' font-size='11'>\n<text x='50' y='16' "
            "font-size='12'>%s</text>\n",
            p->title);
    fprintf(html,
            "<path d='M50 25V170H460' fill='none' stroke='#888'/><text x='2' y='34'>%.3g</text><text x='30' "
            "y='174'>0</text>\n",
            top);
    fprintf(html,
            "<text x='50' y='188'>1e%.3g</text><text x='430' y='188'>1e%.3g</text><text x='200' "
            "y='206'>%s</text>\n",
            range[0], range[1], p->x_label);
    plot_points(html, p, &o[0], range, top, 0);
    plot_points(html, p, &o[1], range, top, 1);
    fprintf(html, "</svg>\n");
}

static void html_cell(FILE *html, const char *text)
{
    fputs("<td>", html);
    for (; *text; text++) {
        if (*text == '<')
            fputs("&lt;", html);
        else if (*text == '&')
            fputs("&amp;", html);
        else
            fputc(*text, html);
    }
    fputs("</td>", html);
}

static void html_row(FILE *html, const half *f, const half *d)
{
    static const int shown[4] = {ERROR, BOUND, VERDICT, SECONDS};
    const half *const any = f ? f : d;
    const int bad =
        (f && strcmp(f->field[VERDICT], "FAIL") == 0) || (d && strcmp(d->field[VERDICT], "FAIL") == 0);
    int k;
    fprintf(html, bad ? "<tr style='background:#fcc'>" : "<tr>");
    for (k = GROUP; k <= QUANTITY; k++) html_cell(html, any->field[k]);
    html_cell(html, any->field[UNIT]);
    for (k = 0; k < 4; k++) html_cell(html, of(f, shown[k]));
    for (k = 0; k < 4; k++) html_cell(html, of(d, shown[k]));
    html_cell(html, f && f->field[WHY][0] ? f->field[WHY] : d ? d->field[WHY] : "");
    fprintf(html, "</tr>\n");
}

static void html_head(FILE *html, const output *o)
{
    size_t k;
    fprintf(
        html,
        "<!DOCTYPE html><html lang='en'><head><meta charset='utf-8'><title>pathtracer.h: stress</title>"
        "<style>body{font:13px sans-serif;margin:2em}table{border-collapse:collapse}td,th{border:1px solid "
        "#ccc;"
        "padding:1px 6px;text-align:left}</style></head><body>\n<h1>Where floating-point numbers end</h1>\n"
        "<p>Blue circles: float. Red squares: double. An error counts against the exact value for the "
        "rounded input.</p>\n");
    for (k = 0; k < sizeof PLOTS / sizeof PLOTS[0]; k++) draw_plot(html, &PLOTS[k], o);
    fprintf(html, "<table><tr><th>group</th><th>case</th><th>quantity</th><th>unit</th><th>float "
                  "error</th><th>bound</th><th></th>"
                  "<th>s</th><th>double error</th><th>bound</th><th></th><th>s</th><th>limit</th></tr>\n");
}

/* ---- the twin ----------------------------------------------------------------------------------------- */

/* Float and double drew the same random numbers, up to the digits of each: their pictures differ by rounding, and where
   a decision fell the other way. The first is at most 256 u (8 edges of 32 roundings); the second has no bias, so that
   the mean difference over 64 blocks is 0 within Student's t. */
static int compare_twins(const output *o)
{
    int k, i, bad = 0;
    printf("\nthe twin: float minus double, same random numbers, mean over the picture, relative to it\n");
    for (k = 0; k < o[0].scenes; k++) {
        pt_stats d = PT_STATS_INIT, mean = PT_STATS_INIT;
        double t, bound, se;
        if (k >= o[1].scenes || strcmp(o[0].scene[k].name, o[1].scene[k].name) != 0 ||
            o[0].scene[k].blocks != BLOCKS || o[1].scene[k].blocks != BLOCKS) {
            printf("FAIL   %s was not rendered in both\n", o[0].scene[k].name);
            bad++;
            continue;
        }
        for (i = 0; i < BLOCKS; i++) {
            pt_stats_add(&d, o[0].scene[k].block[i] - o[1].scene[k].block[i]);
            pt_stats_add(&mean, o[1].scene[k].block[i]);
        }
        se = pt_stats_standard_error(&d);
        for (t = 0; pt_student_sf(t, BLOCKS - 1) > 1e-9; t += 0.01) {
        }
        bound = t * se + 256 * 0x1p-24 * mean.mean;
        bad += !(fabs(d.mean) <= bound);
        printf("%s %-20s %+.2e  standard error %.1e  bound %.1e\n",
               fabs(d.mean) <= bound ? "ok    " : "FAIL  ", o[0].scene[k].name, d.mean / mean.mean,
               se / mean.mean, bound / mean.mean);
    }
    return bad + (o[0].scenes != o[1].scenes || o[0].scenes == 0);
}

/* ---- constants ------------------------------------------------------------------------------------------ */

/* Text of the header, as it stands there, and why the number is what it is. */
typedef struct constant {
    const char *code, *why;
} constant;
static const constant CONSTANTS[] = {
    {"return n * PTI_UNIT_ROUNDOFF / (1 - n * PTI_UNIT_ROUNDOFF);", "gamma(n), Higham: n roundings"},
    {"const double e = PTI_2_M53 * (1 + 16 * PTI_2_M53);",
     "depth of a triangle: sums of roundings listed there; the factor covers the bound's own"},
    {"return 3 * (3 * e * edge * z + dedge * z + dz * edge);",
     "three terms, each with its edge function's and depth's error"},
    {"t0 + 16 * PTI_2_M53 * (length + radius) / sqrt(a) < r->end",
     "end of a shadow ray at a sphere: 16 roundings of the distances"},
    {"PTI_R(1 + 9 * PTI_UNIT_ROUNDOFF)", "slabs: 1 + 2 gamma(4), rounded up: d, 1/d, -, *"},
    {"return (pt_real)t * PTI_R(1 + 16 * PTI_UNIT_ROUNDOFF);",
     "limit for boxes: t rounded up to pt_real, and the slabs' own error"},
    {"best->t * (1 + 2 * PTI_2_M53)", "ties: t in (0, best], with the rounding of the comparison's product"},
    {"(pt_real)(16 * PTI_2_M53 * m)",
     "hit point: 16 roundings of double: shear, edge functions, division, weighted sum"},
    {"pti_d_scale(pti_d_abs(p), PTI_UNIT_ROUNDOFF * PTI_UNIT_ROUNDOFF)",
     "p + p_low: rounding the rest once more leaves u^2 |p|"},
    {"pti_d_scale(pti_d(fabs(p.x), fabs(p.y), fabs(p.z)), 4 * PTI_2_M53)",
     "start of the next ray: the sums p + p_low and p + offset"},
    {"3 * PTI_UNIT_ROUNDOFF * fmax(fabs((double)a.x), fabs((double)b.x))",
     "boxes of the tree: a ray's origin rounded to pt_real, and two roundings there"},
    {"q = fmin(q, 1 - PTI_2_M24);",
     "roulette ends every path at last: option PT_ROULETTE_THROUGHPUT, unbiased"},
    {"return fmin(u, 1 - PTI_2_M53);", "numbers in [0,1) of double: the largest below 1"},
    {"fmin(u, 1 - PTI_2_M24) * 16777216.0", "numbers in [0,1) of float: 24 bits, cut"},
    {"const pt_real h = PTI_R(PTI_UNIT_ROUNDOFF);",
     "cosine warp: the middle of the random number's cell keeps z > 0"},
    {"if (!(l2 > 1e-270 && l2 < 1e270)) {",
     "normalising: squares outside have lost digits to under- or overflow: scale first"},
    {"return 1 / sqrt(fmax(PTI_2_M53, (1 - x) * (1 + x)));",
     "slope of acos where it is steepest: an estimate for the next line"},
    {"> PTI_2_M24 * s->solid_angle;",
     "a rectangle is sampled as triangles where [Ure13] would lose more than a float has"},
    {"fabs(sum - 1) <= 8 * PTI_2_M53", "shares of at most 8 techniques sum to 1: one rounding each"},
    {"fabs(pti_d_dot(a, b)) <= 4 * PTI_UNIT_ROUNDOFF * pti_d_length(a) * pti_d_length(b);",
     "are edges perpendicular? products and sum of rounded edges"},
    {"light->omc_end + 8 * PTI_UNIT_ROUNDOFF * sqrt(light->omc_end)",
     "rim of a spot: error of 1 - cos of a rounded direction"},
    {"most > 1 + 2 * PTI_UNIT_ROUNDOFF", "albedo + specular <= 1, up to the rounding of both"},
    {"if (!(pti_d_length(right) > 8 * PTI_UNIT_ROUNDOFF)) return c;",
     "view parallel to up, up to rounding of both unit vectors"},
    {"const double e = 64 * PTI_UNIT_ROUNDOFF;", "what an instance of the integrator may differ in sums"},
    {"PT_MAX_COORDINATE 1e18", "squares of distances stay below 1e37 < the largest float"}};

/* The line on which a text stands in the header's implementation, 0 = nowhere. */
static int line_of(const char *header, const char *code)
{
    const char *const at = header ? strstr(header, code) : NULL;
    int line = 1;
    const char *c;
    if (!at) return 0;
    for (c = header; c < at; c++) line += *c == '\n';
    return line;
}

static int list_constants(void)
{
    char *const header = read_all("pathtracer.h");
    int bad = 0;
    size_t k;
    printf("\nconstants of the header that act as tolerances, and the line of their derivation\n");
    for (k = 0; k < sizeof CONSTANTS / sizeof CONSTANTS[0]; k++) {
        const int line = line_of(header, CONSTANTS[k].code);
        if (line)
            printf("%5d  %-68s %s\n", line, CONSTANTS[k].code, CONSTANTS[k].why);
        else
            printf("FAIL   not in pathtracer.h any more: %s\n", CONSTANTS[k].code);
        bad += !line;
    }
    free(header);
    return bad;
}

/* ---- all ------------------------------------------------------------------------------------------------- */

static void count_verdicts(const output *o, const char *name, int *bad)
{
    int i, ok = 0, limit = 0, fail = 0;
    long nan = 0;
    double seconds = 0;
    for (i = 0; i < o->rows; i++) {
        const half *const h = &o->row[i];
        ok += strcmp(h->field[VERDICT], "ok") == 0;
        limit += strcmp(h->field[VERDICT], "limit") == 0;
        fail += strcmp(h->field[VERDICT], "FAIL") == 0;
        nan += strtol(h->field[NANS], NULL, 10);
        if (strcmp(h->field[GROUP], "whole") == 0) seconds = strtod(h->field[SECONDS], NULL);
    }
    printf("%-7s %d rows: %d ok, %d limits, %d failed; %ld not finite; %.0f s\n", name, o->rows, ok, limit,
           fail, nan, seconds);
    if (o->lost) printf("FAIL   %d rows of %s could not be read\n", o->lost, name);
    *bad += fail + o->lost + (o->rows == 0) + !o->complete;
}

/* Both precisions in one list: the rows of float, then those that double alone has. */
static void write_rows(const output *o, FILE *csv, FILE *html)
{
    int i, from = 0, back = 0;
    for (i = 0; i < o[0].rows; i++) {
        const half *const d = find(&o[1], &o[0].row[i], &from);
        print_row(&o[0].row[i], d);
        csv_row(csv, &o[0].row[i], d);
        html_row(html, &o[0].row[i], d);
    }
    for (i = 0; i < o[1].rows; i++) {
        if (find(&o[0], &o[1].row[i], &back)) continue;
        print_row(NULL, &o[1].row[i]);
        csv_row(csv, NULL, &o[1].row[i]);
        html_row(html, NULL, &o[1].row[i]);
    }
}

int main(int argc, char **argv)
{
    static output o[2];
    FILE *csv, *html;
    int k, bad = 0;
    if (argc != 5) return 2;
    for (k = 0; k < 2; k++)
        if (!read_output(&o[k], argv[1 + k])) printf("FAIL   %s is not complete\n", argv[1 + k]);
    csv = fopen(argv[3], "w");
    html = fopen(argv[4], "w");
    if (!csv || !html) return 2;
    fprintf(csv, "group,case,quantity,scale,offset,unit");
    for (k = 0; k < 2; k++) {
        const char *const p = k ? "double" : "float";
        fprintf(csv, ",%s_got,%s_exact,%s_error,%s_bound,%s_verdict,%s_not_finite,%s_seconds,%s_limit", p, p,
                p, p, p, p, p, p);
    }
    fprintf(csv, "\n");
    html_head(html, o);
    printf("%-10s %-46s %-30s %10s %-12s %8s %-6s %10s %8s %-6s %8s %8s\n", "group", "case", "quantity",
           "float", "unit", "bound", "", "double", "bound", "", "s float", "s double");
    write_rows(o, csv, html);
    fprintf(html, "</table></body></html>\n");
    bad += fclose(csv) != 0;
    bad += fclose(html) != 0;
    for (k = 0; k < o[0].laters; k++) printf("later  %s\n", o[0].later[k]);
    bad += compare_twins(o);
    bad += list_constants();
    printf("\n");
    count_verdicts(&o[0], "float", &bad);
    count_verdicts(&o[1], "double", &bad);
    printf("stress: %d passed, %d failed\n", o[0].rows + o[1].rows, bad);
    for (k = 0; k < 2; k++) free(o[k].text);
    return bad != 0;
}
