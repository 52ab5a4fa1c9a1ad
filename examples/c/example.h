/* Small helpers of the examples: stop at an error, functions with dense derivatives, line plots as SVG. */
#ifndef EXAMPLE_H
#define EXAMPLE_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <switchback.h>

/* Ends the program with the message of the library if a call fails. */
#define TRY(call)                                                                                     \
    do {                                                                                              \
        if ((call) != SWB_OK) {                                                                       \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, swb_last_error());                     \
            exit(1);                                                                                  \
        }                                                                                             \
    } while (0)

static inline void *allocate(int64_t n, size_t size)
{
    void *p = calloc((size_t)n + 1, size);
    if (!p)
        exit(1);
    return p;
}

/* A function of states and controls; derivatives by differences. */
static inline swb_function *function(const char *name, int64_t nx, int64_t nu, int64_t n_out, swb_value_fn value,
                                     void *user_data)
{
    swb_function *f;
    TRY(swb_function_create(name, nx, nu, 0, n_out, value, user_data, NULL, &f));
    return f;
}

/* --- plots ---------------------------------------------------------------------------------------- */

struct plot {
    FILE *file;
    double x0, x1, y0, y1;
    int n_curves;
};

#define PLOT_W 720.0
#define PLOT_H 440.0
#define PLOT_LEFT 60.0
#define PLOT_RIGHT 130.0
#define PLOT_TOP 36.0
#define PLOT_BOTTOM 44.0

static inline double plot_x(const struct plot *p, double x)
{
    return PLOT_LEFT + (x - p->x0) / (p->x1 - p->x0) * (PLOT_W - PLOT_LEFT - PLOT_RIGHT);
}

static inline double plot_y(const struct plot *p, double y)
{
    return PLOT_H - PLOT_BOTTOM - (y - p->y0) / (p->y1 - p->y0) * (PLOT_H - PLOT_TOP - PLOT_BOTTOM);
}

/* A step 1, 2 or 5 times a power of ten, some six of which fill the range. */
static inline double plot_tick(double range)
{
    double step = pow(10.0, floor(log10(range / 6.0)));
    double ratio = range / 6.0 / step;
    return step * (ratio < 1.5 ? 1.0 : ratio < 3.5 ? 2.0 : ratio < 7.5 ? 5.0 : 10.0);
}

/* Opens folder/name and draws the frame for x in [x0, x1], y in [y0, y1]. */
static inline struct plot plot_open(const char *folder, const char *name, const char *title, const char *x_label,
                                    double x0, double x1, double y0, double y1)
{
    struct plot p = {NULL, x0, x1, y0, y1, 0};
    char path[512];
    double step, v;

    mkdir(folder, 0777);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    p.file = fopen(path, "w");
    if (!p.file) {
        perror(path);
        exit(1);
    }
    fprintf(p.file,
            "<svg xmlns='http://www.w3.org/2000/svg' width='%g' height='%g' font-family='sans-serif' font-size='12'>\n"
            "<rect width='100%%' height='100%%' fill='white'/>\n"
            "<text x='%g' y='20' font-size='15'>%s</text>\n"
            "<text x='%g' y='%g' text-anchor='middle'>%s</text>\n",
            PLOT_W, PLOT_H, PLOT_LEFT, title, plot_x(&p, 0.5 * (x0 + x1)), PLOT_H - 8.0, x_label);
    step = plot_tick(x1 - x0);
    for (v = ceil(x0 / step) * step; v <= x1 + 1e-9 * step; v += step)
        fprintf(p.file,
                "<line x1='%g' x2='%g' y1='%g' y2='%g' stroke='#ddd'/>\n"
                "<text x='%g' y='%g' text-anchor='middle'>%g</text>\n",
                plot_x(&p, v), plot_x(&p, v), plot_y(&p, y0), plot_y(&p, y1), plot_x(&p, v), plot_y(&p, y0) + 16.0,
                fabs(v) < 1e-9 * step ? 0.0 : v);
    step = plot_tick(y1 - y0);
    for (v = ceil(y0 / step) * step; v <= y1 + 1e-9 * step; v += step)
        fprintf(p.file,
                "<line x1='%g' x2='%g' y1='%g' y2='%g' stroke='#ddd'/>\n"
                "<text x='%g' y='%g' text-anchor='end'>%g</text>\n",
                plot_x(&p, x0), plot_x(&p, x1), plot_y(&p, v), plot_y(&p, v), PLOT_LEFT - 6.0, plot_y(&p, v) + 4.0,
                fabs(v) < 1e-9 * step ? 0.0 : v);
    return p;
}

static inline const char *plot_colour(struct plot *p, const char *label)
{
    static const char *const colours[] = {"#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf"};
    const char *colour = colours[p->n_curves % 6];
    double y = PLOT_TOP + 16.0 * p->n_curves++;
    fprintf(p->file,
            "<line x1='%g' x2='%g' y1='%g' y2='%g' stroke='%s' stroke-width='2'/><text x='%g' y='%g'>%s</text>\n",
            PLOT_W - PLOT_RIGHT + 10.0, PLOT_W - PLOT_RIGHT + 30.0, y, y, colour, PLOT_W - PLOT_RIGHT + 36.0, y + 4.0,
            label);
    return colour;
}

/* A line through n points; y[i * stride] belongs to x[i * x_stride]. */
static inline void plot_line(struct plot *p, const char *label, const double *x, int x_stride, const double *y,
                             int stride, int64_t n)
{
    int64_t i;
    fprintf(p->file, "<polyline fill='none' stroke-width='1.8' stroke='%s' points='", plot_colour(p, label));
    for (i = 0; i < n; i++)
        fprintf(p->file, "%.2f,%.2f ", plot_x(p, x[i * x_stride]), plot_y(p, y[i * stride]));
    fprintf(p->file, "'/>\n");
}

/* A piecewise constant line: y[i * stride] between x[i] and x[i + 1], for n intervals. */
static inline void plot_steps(struct plot *p, const char *label, const double *x, const double *y, int stride, int64_t n)
{
    int64_t i;
    fprintf(p->file, "<polyline fill='none' stroke-width='1.8' stroke='%s' points='", plot_colour(p, label));
    for (i = 0; i < n; i++)
        fprintf(p->file, "%.2f,%.2f %.2f,%.2f ", plot_x(p, x[i]), plot_y(p, y[i * stride]), plot_x(p, x[i + 1]),
                plot_y(p, y[i * stride]));
    fprintf(p->file, "'/>\n");
}

/* A vertical line. */
static inline void plot_mark(struct plot *p, double x)
{
    fprintf(p->file, "<line x1='%g' x2='%g' y1='%g' y2='%g' stroke='#888' stroke-dasharray='4 3'/>\n", plot_x(p, x),
            plot_x(p, x), plot_y(p, p->y0), plot_y(p, p->y1));
}

static inline void plot_close(struct plot *p)
{
    fprintf(p->file, "</svg>\n");
    fclose(p->file);
}

#endif
