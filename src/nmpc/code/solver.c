/* ---- memory: all of it, with that of the controller or of the estimator in OWN ---- */

enum { OUT = 0, IN = 1, BEYOND = 2 };
enum { SOLVED, STUCK, CONTRADICTION };

/* One bound of a constraint in the interior point: slack t, multiplier l, violation s with its multiplier n. */
typedef struct {
    real t, l, s, n;       /* where it is */
    real gap, slope;       /* what is left of h + s - t = 0, and of the derivative by s */
    real dt, dl, ds, dn;   /* the step */
    real by_t, by_s;       /* centres less products */
    int on, soft, linear;
} side_t;

/* A Riccati recursion: [L; Y] of every stage, the value of every node, and from which stage on they are valid. */
typedef struct {
    real panel[N * NW * NU];
    real value[(N + 1) * NX * NX];
#if FREE
    /* Cholesky's factor of the first value and the weight of the arrival. */
    real first[NX * NX];
#endif
    int valid;
} recursion_t;

static struct {
    OWN
    /* The program: blocks [R S; S' Q], [B A], rows [D C], gradient, gaps, bounds less the point. */
    real hess[(N + 1) * NW * NW], f[N * NX * NW], rows[ROOM(ROWS) * NW];
    real grad[(N + 1) * NW], c[N * NX], lower[ALL], upper[ALL];
    /* The solver. */
    recursion_t free, now;
    real want_u[N * NU], want_rows[ROOM(ROWS)], have_u[N * NU], have_rows[ROOM(ROWS)];
    unsigned char want_fixed[N * NU], have_fixed[N * NU];
    real base[ALL], reach[ALL], y[ALL], aim[ALL], dv[ALL], kept_y[ALL], sign[ALL];
    unsigned char state[ALL];
    signed char pointed[ALL], tried[ALL];
    side_t sides[2 * ALL];
    real z[(N + 1) * NW], g[(N + 1) * NW], gy[(N + 1) * NW], dz[(N + 1) * NW], kept[(N + 1) * NW];
    real gaps[N * NX], values[ROOM(ROWS)], free_values[ROOM(ROWS)];
    real lp[N * NU], p[(N + 1) * NX], lambda[(N + 1) * NX];
    /* Scratch of a stage. */
    real block[NW * NW], pf[NX * NW], h[NX], m[NW];
#if FREE
    real arrival[NX * NX];
#endif
    real cov[NX * NX], gain[NU * NX], closed[NX * NX], product[NX * NX], noise[NX * NU];
    real price;
    int elastic, has_gaps, is_solution, iterations;
} w;

const unsigned long PREFIX(arena_bytes) = (unsigned long)sizeof w;

static void copy(int n, const real *from, real *to) {
    int i;
    for (i = 0; i < n; i++)
        to[i] = from[i];
}

static void fill(int n, real v, real *to) {
    int i;
    for (i = 0; i < n; i++)
        to[i] = v;
}

static real dot(int n, const real *a, const real *b) {
    real s = 0;
    int i;
    for (i = 0; i < n; i++)
        s += a[i] * b[i];
    return s;
}

static void axpy(int n, real f, const real *a, real *to) {
    int i;
    for (i = 0; i < n; i++)
        to[i] += f * a[i];
}

/* y += A x, y += A' x, with m x n entries, columns ld apart. */
static void gemv(int m, int n, const real *a, int ld, const real *x, real *y) {
    int j;
    for (j = 0; j < n; j++)
        axpy(m, x[j], &a[j * ld], y);
}

static void gemv_transposed(int m, int n, const real *a, int ld, const real *x, real *y) {
    int j;
    for (j = 0; j < n; j++)
        y[j] += dot(m, &a[j * ld], x);
}

/* L v = b and L' v = b in place. */
static void forth(int n, const real *l, int ld, real *v) {
    int j;
    for (j = 0; j < n; j++) {
        v[j] /= l[j + j * ld];
        axpy(n - j - 1, -v[j], &l[j + 1 + j * ld], &v[j + 1]);
    }
}

static void back(int n, const real *l, int ld, real *v) {
    int j;
    for (j = n - 1; j >= 0; j--)
        v[j] = (v[j] - dot(n - j - 1, &l[j + 1 + j * ld], &v[j + 1])) / l[j + j * ld];
}

static real absolute(real v) {
    return v < 0 ? -v : v;
}

static int is_finite(real v) {
    return v - v == 0;
}

static int all_finite(int n, const real *v) {
    int i;
    for (i = 0; i < n; i++)
        if (!is_finite(v[i]))
            return 0;
    return 1;
}

static real larger(real a, real b) {
    return a > b ? a : b;
}

static real smaller(real a, real b) {
    return a < b ? a : b;
}

static real within(real v, real lower, real upper) {
    return smaller(larger(v, lower), upper);
}

/* ---- Riccati recursions ---- */

static int riccati_stage(recursion_t *q, const real *weight_u, const real *weight_rows, const unsigned char *fixed, int k) {
    const real *next = &q->value[(k < N ? k + 1 : 0) * NX * NX], *f = &w.f[(k < N ? k : 0) * NX * NW];
    real *b = w.block;
    int i, j, l, r;
    copy(NW * NW, &w.hess[k * NW * NW], b);
    for (r = ROW_FIRST[k]; r < ROW_FIRST[k + 1]; r++)
        if (weight_rows[r] != 0)
            for (j = 0; j < NW; j++)
                axpy(NW - j, weight_rows[r] * w.rows[r * NW + j], &w.rows[r * NW + j], &b[j * (NW + 1)]);
    if (k < N) {
        real *panel = &q->panel[k * NW * NU];
        fill(NX * NW, 0, w.pf);
        for (j = 0; j < NW; j++)
            gemv(NX, NX, next, NX, &f[j * NX], &w.pf[j * NX]);
        for (j = 0; j < NW; j++)
            for (i = j; i < NW; i++)
                b[i + j * NW] += dot(NX, &f[i * NX], &w.pf[j * NX]);
        for (j = 0; j < NU; j++) {
            if (fixed[k * NU + j]) {
                fill(NW - j, 0, &b[j * (NW + 1)]);
                for (l = 0; l < j; l++)
                    b[j + l * NW] = 0;
                b[j * (NW + 1)] = 1;
            } else {
                b[j * (NW + 1)] += weight_u[k * NU + j];
            }
        }
        /* Cholesky's factor of the controls, and of what is below them */
        for (j = 0; j < NU; j++) {
            const real scale = absolute(b[j * (NW + 1)]);
            real root;
            for (l = 0; l < j; l++)
                axpy(NW - j, -b[j + l * NW], &b[j + l * NW], &b[j * (NW + 1)]);
            root = b[j * (NW + 1)];
            if (!(root > NU * EPSILON * scale) || !is_finite(root))
                return 0;
            root = SQRT(root);
            b[j * (NW + 1)] = root;
            for (i = j + 1; i < NW; i++)
                b[i + j * NW] /= root;
        }
        copy(NW * NU, b, panel);
        for (j = NU; j < NW; j++)
            for (l = 0; l < NU; l++)
                axpy(NW - j, -b[j + l * NW], &b[j + l * NW], &b[j * (NW + 1)]);
    }
    for (j = 0; j < NX; j++)
        for (i = j; i < NX; i++) {
            const real v = b[NU + i + (NU + j) * NW];
            q->value[k * NX * NX + i + j * NX] = v;
            q->value[k * NX * NX + j + i * NX] = v;
        }
    return all_finite(NX * NX, &q->value[k * NX * NX]);
}

#if FREE
/* The factor for the first state, where that is free. */
static int first_of(recursion_t *q) {
    int i, j, l;
    for (j = 0; j < NX * NX; j++)
        q->first[j] = q->value[j] + w.arrival[j];
    for (j = 0; j < NX; j++) {
        real *own = &q->first[j * (NX + 1)];
        const real scale = absolute(*own);
        for (l = 0; l < j; l++)
            axpy(NX - j, -q->first[j + l * NX], &q->first[j + l * NX], own);
        if (!(*own > NX * EPSILON * scale) || !is_finite(*own)) {
            q->valid = N + 1;
            return 0;
        }
        *own = SQRT(*own);
        for (i = 1; i < NX - j; i++)
            own[i] /= *own;
    }
    return 1;
}
#endif

static int riccati(recursion_t *q, const real *weight_u, const real *weight_rows, const unsigned char *fixed) {
    while (q->valid > 0) {
        if (!riccati_stage(q, weight_u, weight_rows, fixed, q->valid - 1))
            return 0;
        q->valid--;
    }
#if FREE
    return first_of(q);
#else
    return 1;
#endif
}

/* A Newton step to dz: back with the gradient gy, forth from dx0. */
static void sweeps(const recursion_t *q, const unsigned char *fixed, const real *dx0) {
    int k, j;
    copy(NX, &w.gy[N * NW + NU], &w.p[N * NX]);
    for (k = N - 1; k >= 0; k--) {
        const real *panel = &q->panel[k * NW * NU];
        copy(NX, &w.p[(k + 1) * NX], w.h);
        if (w.has_gaps)
            gemv(NX, NX, &q->value[(k + 1) * NX * NX], NX, &w.gaps[k * NX], w.h);
        copy(NW, &w.gy[k * NW], w.m);
        gemv_transposed(NX, NW, &w.f[k * NX * NW], NX, w.h, w.m);
        for (j = 0; j < NU; j++)
            if (fixed != 0 && fixed[k * NU + j])
                w.m[j] = 0;
        forth(NU, panel, NW, w.m);
        copy(NU, w.m, &w.lp[k * NU]);
        for (j = 0; j < NU; j++)
            axpy(NX, -w.m[j], &panel[NU + j * NW], &w.m[NU]);
        copy(NX, &w.m[NU], &w.p[k * NX]);
    }
#if FREE
    /* (P + W) dx = W dx0 - p */
    for (j = 0; j < NX; j++)
        w.dz[NU + j] = -w.p[j];
    gemv(NX, NX, w.arrival, NX, dx0, &w.dz[NU]);
    forth(NX, q->first, NX, &w.dz[NU]);
    back(NX, q->first, NX, &w.dz[NU]);
#else
    copy(NX, dx0, &w.dz[NU]);
#endif
    for (k = 0; k <= N; k++) {
        real *u = &w.dz[k * NW], *x = &u[NU];
        copy(NX, &w.p[k * NX], &w.lambda[k * NX]);
        gemv(NX, NX, &q->value[k * NX * NX], NX, x, &w.lambda[k * NX]);
        if (k == N) {
            fill(NU, 0, u);
            break;
        }
        copy(NU, &w.lp[k * NU], u);
        gemv_transposed(NX, NU, &q->panel[k * NW * NU + NU], NW, x, u);
        back(NU, &q->panel[k * NW * NU], NW, u);
        for (j = 0; j < NU; j++)
            u[j] = -u[j];
        if (w.has_gaps)
            copy(NX, &w.gaps[k * NX], &u[NW + NU]);
        else
            fill(NX, 0, &u[NW + NU]);
        gemv(NX, NW, &w.f[k * NX * NW], NX, u, &u[NW + NU]);
    }
}

/* How far constraints move for a unit of their multiplier: bounds of controls by themselves, rows with all controls, by covariances of the
   system under its feedback law with white noise. */
static void reaches(void) {
    int k, i, j, l, r;
    for (i = 0; i < N * NU; i++) {
        fill(NU, 0, w.m);
        w.m[i % NU] = 1;
        forth(NU, &w.free.panel[i / NU * NW * NU], NW, w.m);
        w.reach[i] = dot(NU, w.m, w.m);
    }
    if (ROWS == 0)
        return;
    fill(NX * NX, 0, w.cov);
#if FREE
    for (j = 0; j < NX; j++) {
        w.cov[j * (NX + 1)] = 1;
        forth(NX, w.free.first, NX, &w.cov[j * NX]);
        back(NX, w.free.first, NX, &w.cov[j * NX]);
    }
#endif
    for (k = 0; k <= N; k++) {
        const real *panel = &w.free.panel[(k < N ? k : 0) * NW * NU], *f = &w.f[(k < N ? k : 0) * NX * NW];
        for (i = 0; k < N && i < NX; i++) {
            for (j = 0; j < NU; j++)
                w.gain[j + i * NU] = -panel[NU + i + j * NW];
            back(NU, panel, NW, &w.gain[i * NU]);
        }
        for (r = ROW_FIRST[k]; r < ROW_FIRST[k + 1]; r++) {
            copy(NW, &w.rows[r * NW], w.m);
            if (k < N) {
                gemv_transposed(NU, NX, w.gain, NU, w.m, &w.m[NU]);
                forth(NU, panel, NW, w.m);
            }
            fill(NX, 0, w.h);
            gemv(NX, NX, w.cov, NX, &w.m[NU], w.h);
            w.reach[N * NU + r] = dot(NX, &w.m[NU], w.h) + dot(NU, w.m, w.m);
        }
        if (k == N)
            break;
        copy(NX * NX, &f[NU * NX], w.closed);
        fill(NX * NX, 0, w.product);
        for (j = 0; j < NX; j++)
            gemv(NX, NU, f, NX, &w.gain[j * NU], &w.closed[j * NX]);
        for (j = 0; j < NX; j++)
            gemv(NX, NX, w.closed, NX, &w.cov[j * NX], &w.product[j * NX]);
        fill(NX * NX, 0, w.cov);
        for (j = 0; j < NX; j++)
            for (l = 0; l < NX; l++)
                axpy(NX, w.closed[j + l * NX], &w.product[l * NX], &w.cov[j * NX]);
        copy(NX * NU, f, w.noise);
        for (j = 0; j < NU; j++) {
            for (i = 0; i < NX; i++)
                w.noise[i + j * NX] /= panel[j + j * NW];
            for (l = j + 1; l < NU; l++)
                axpy(NX, -panel[l + j * NW], &w.noise[j * NX], &w.noise[l * NX]);
        }
        for (j = 0; j < NX; j++)
            for (l = 0; l < NU; l++)
                axpy(NX, w.noise[j + l * NX], &w.noise[l * NX], &w.cov[j * NX]);
    }
}

/* ---- the active set ---- */

static int place_of(int i) {
    return i / NU * NW + i % NU;
}

static real value_of(int i) {
    return i < N * NU ? w.z[place_of(i)] : w.values[i - N * NU];
}

static real bound_of(int i) {
    return w.sign[i] > 0 ? w.upper[i] : w.lower[i];
}

static int is_hard(int i) {
    return i < N * NU || (!is_finite(ROW_LINEAR[i - N * NU]) && !w.elastic);
}

static real linear_of(int i) {
    return is_finite(ROW_LINEAR[i - N * NU]) ? ROW_LINEAR[i - N * NU] : w.price;
}

static real quadratic_of(int i) {
    return ROW_QUADRATIC[i - N * NU];
}

static int is_equation(int i) {
    return w.lower[i] == w.upper[i] && is_hard(i);
}

static int stays_beyond(int i) {
    return w.reach[i] == 0 || (!is_hard(i) && linear_of(i) == 0);
}

static real size_of(int i, real largest, real bound) {
    real s = 0;
    int j;
    if (i < N * NU)
        return largest + absolute(bound) + w.base[i];
    for (j = 0; j < NW; j++)
        s += absolute(w.rows[(i - N * NU) * NW + j] * w.z[ROW_NODE[i - N * NU] * NW + j]);
    return s + absolute(bound) + w.base[i];
}

static real stiff(int i) {
    return STIFF / w.reach[i];
}

static void begin(void) {
    int i;
    for (i = 0; i < ALL; i++) {
        if (is_equation(i))
            w.state[i] = IN;
        if (w.state[i] == OUT)
            continue;
        if (!is_finite(bound_of(i)))
            w.state[i] = OUT;
        else if (w.state[i] == BEYOND && is_hard(i))
            w.state[i] = IN;
        if (i >= N * NU && w.reach[i] == 0)
            w.state[i] = OUT;
    }
}

static void clear_weights(void) {
    int i;
    fill(N * NU, 0, w.want_u);
    fill(ROWS, 0, w.want_rows);
    for (i = 0; i < N * NU; i++)
        w.want_fixed[i] = 0;
}

/* Weights of the active set, fixed controls to their bounds; is it empty? */
static int place(void) {
    int i, empty = 1;
    clear_weights();
    for (i = 0; i < ALL; i++) {
        if (w.state[i] == OUT)
            continue;
        empty = 0;
        if (i < N * NU) {
            w.want_fixed[i] = 1;
            if (w.z[place_of(i)] != bound_of(i))
                w.has_gaps = 1;
            w.z[place_of(i)] = bound_of(i);
        } else {
            w.want_rows[i - N * NU] = w.state[i] == BEYOND ? 2 * quadratic_of(i) : stiff(i);
        }
    }
    return empty;
}

static int factorise(void) {
    int k, i, last = -1;
    for (k = N; k >= 0 && last < 0; k--) {
        for (i = k * NU; k < N && i < (k + 1) * NU; i++)
            if (w.want_fixed[i] != w.have_fixed[i] || w.want_u[i] != w.have_u[i])
                last = k;
        for (i = ROW_FIRST[k]; i < ROW_FIRST[k + 1]; i++)
            if (w.want_rows[i] != w.have_rows[i])
                last = k;
    }
    if (last >= 0) {
        if (w.now.valid < last + 1)
            w.now.valid = last + 1;
        copy(N * NU, w.want_u, w.have_u);
        copy(ROWS, w.want_rows, w.have_rows);
        for (i = 0; i < N * NU; i++)
            w.have_fixed[i] = w.want_fixed[i];
    }
    return riccati(&w.now, w.have_u, w.have_rows, w.have_fixed);
}

/* Gradient of the cost, values of rows and gaps of the dynamics at z. */
static void evaluate(void) {
    int k, r;
    for (k = 0; k <= N; k++) {
        const real *z = &w.z[k * NW];
        copy(NW, &w.grad[k * NW], &w.g[k * NW]);
        gemv(NW, NW, &w.hess[k * NW * NW], NW, z, &w.g[k * NW]);
        for (r = ROW_FIRST[k]; r < ROW_FIRST[k + 1]; r++)
            w.values[r] = dot(NW, &w.rows[r * NW], z);
        if (w.has_gaps && k < N) {
            copy(NX, &w.c[k * NX], &w.gaps[k * NX]);
            gemv(NX, NW, &w.f[k * NX * NW], NX, z, &w.gaps[k * NX]);
            axpy(NX, -1, &z[NW + NU], &w.gaps[k * NX]);
        }
    }
}

static void newton(const real *x0, int empty) {
    real dx0[NX];
    int i;
    copy((N + 1) * NW, w.g, w.gy);
    for (i = 0; i < N * NU; i++)
        w.gy[place_of(i)] += w.aim[i];
    for (i = N * NU; i < ALL; i++)
        if (w.aim[i] != 0)
            axpy(NW, w.aim[i], &w.rows[(i - N * NU) * NW], &w.gy[ROW_NODE[i - N * NU] * NW]);
    for (i = 0; i < NX; i++)
        dx0[i] = x0[i] - w.z[NU + i];
    if (empty)
        sweeps(&w.free, 0, dx0);
    else
        sweeps(&w.now, w.have_fixed, dx0);
}

static void aim_at_active(void) {
    int i;
    fill(ALL, 0, w.aim);
    for (i = N * NU; i < ALL; i++) {
        const real beyond = w.values[i - N * NU] - bound_of(i);
        if (w.state[i] == IN)
            w.aim[i] = w.y[i] + stiff(i) * beyond;
        else if (w.state[i] == BEYOND)
            w.aim[i] = w.sign[i] * linear_of(i) + 2 * quadratic_of(i) * beyond;
    }
}

static void multipliers_of_active(void) {
    int i, r;
    for (i = N * NU; i < ALL; i++) {
        r = i - N * NU;
        w.y[i] = w.aim[i];
        if (w.want_rows[r] != 0)
            w.y[i] += w.want_rows[r] * dot(NW, &w.rows[r * NW], &w.dz[ROW_NODE[r] * NW]);
    }
    for (i = 0; i < N * NU; i++) {
        const int k = i / NU, j = i % NU;
        real slope;
        w.y[i] = 0;
        if (w.state[i] == OUT)
            continue;
        slope = w.g[k * NW + j] + dot(NX, &w.f[k * NX * NW + j * NX], &w.lambda[(k + 1) * NX]);
        for (r = ROW_FIRST[k]; r < ROW_FIRST[k + 1]; r++)
            slope += w.rows[r * NW + j] * w.y[N * NU + r];
        w.y[i] = -slope;
    }
}

/* The step, and what is known at its end. */
static void make_newton_step(void) {
    axpy((N + 1) * NW, 1, w.dz, w.z);
    w.has_gaps = 0;
    evaluate();
    multipliers_of_active();
}

/* The next active set by the signs at the point: the number of changes, or -1 where a row is violated that nothing can move. */
static int revise(int *open) {
    real largest = 0;
    int i, changes = 0;
    *open = 0;
    for (i = 0; i < N * NU; i++)
        largest = larger(largest, absolute(w.z[place_of(i)]));
    for (i = 0; i < ALL; i++) {
        const real lower = w.lower[i], upper = w.upper[i], v = value_of(i);
        real bound, tolerance, beyond, multiplier, most;
        if (w.state[i] == OUT) {
            const int up = v - upper > lower - v;
            beyond = up ? v - upper : lower - v;
            bound = up ? upper : lower;
            if (!(beyond > 0) || beyond <= FEASIBLE * size_of(i, largest, bound))
                continue;
            w.sign[i] = (real)(up ? 1 : -1);
            changes++;
            if (w.reach[i] == 0 && is_hard(i))
                return -1;
            w.state[i] = (unsigned char)(stays_beyond(i) ? BEYOND : IN);
            continue;
        }
        bound = bound_of(i);
        tolerance = FEASIBLE * size_of(i, largest, bound);
        beyond = w.sign[i] * (v - bound);
        if (w.state[i] == BEYOND) {
            if (beyond < -tolerance) {
                w.state[i] = (unsigned char)(stays_beyond(i) ? OUT : IN);
                w.y[i] = w.sign[i] * linear_of(i);
                changes++;
            }
            continue;
        }
        if (i >= N * NU && absolute(beyond) > tolerance)
            *open = 1;
        if (is_equation(i))
            continue;
        multiplier = w.sign[i] * w.y[i];
        most = is_hard(i) ? INFINITY : linear_of(i);
        if (multiplier * w.reach[i] < -tolerance) {
            if (lower == upper) {
                w.sign[i] = -w.sign[i];
                if (-multiplier > most) {
                    w.state[i] = BEYOND;
                    changes++;
                }
            } else {
                w.state[i] = OUT;
                w.y[i] = 0;
                changes++;
            }
        } else if ((multiplier - most) * w.reach[i] > tolerance) {
            w.state[i] = BEYOND;
            changes++;
        }
    }
    return changes;
}

static int settle(const real *x0, int patience) {
    int fewest = ALL + 1, vain = 0, corrections = 0, known = 0, pass, i;
    for (pass = 0; pass < MOST; pass++) {
        const int gaps_before = w.has_gaps;
        int empty, changes, open, stiff_rows = 0;
        w.iterations++;
        empty = place();
        if (!known || (w.has_gaps && !gaps_before))
            evaluate();
        aim_at_active();
        if (!empty && !factorise())
            return STUCK;
        newton(x0, empty);
        make_newton_step();
        for (i = N * NU; i < ALL; i++)
            if (w.state[i] == IN)
                stiff_rows = 1;
        if (!known && stiff_rows) {
            /* a step from far away loses digits to the weights of rows, and signs with them: the next one is short */
            aim_at_active();
            newton(x0, empty);
            make_newton_step();
        }
        known = 1;
        changes = revise(&open);
        if (changes < 0)
            return CONTRADICTION;
        if (changes == 0) {
            if (!open && (corrections > 0 || !stiff_rows))
                return SOLVED;
            if (corrections == CORRECTIONS)
                return STUCK;
            corrections++;
        } else if (changes < fewest) {
            fewest = changes;
            vain = 0;
        } else {
            vain++;
            if (vain > patience)
                return STUCK;
        }
    }
    return STUCK;
}

/* ---- the interior point ---- */

/* The solution without constraints, and how far it violates them, in units of the cost. */
static real start(const real *x0) {
    real most = 0;
    int i;
    fill((N + 1) * NW, 0, w.z);
    fill(ALL, 0, w.aim);
    w.has_gaps = 1;
    evaluate();
    newton(x0, 1);
    copy((N + 1) * NW, w.dz, w.z);
    w.has_gaps = 0;
    evaluate();
    copy(ROWS, w.values, w.free_values);
    for (i = 0; i < ALL; i++) {
        const real beyond = larger(value_of(i) - w.upper[i], w.lower[i] - value_of(i));
        if (beyond > 0 && w.reach[i] > 0)
            most = larger(most, beyond * beyond / w.reach[i]);
    }
    return most;
}

/* What it costs to cut the controls of the point off at their bounds, by the derivative there. */
static real cost_of_cutting(void) {
    real most = 0, before[NX], own[NX];
    int k, j;
    copy((N + 1) * NW, w.z, w.kept);
    for (k = 0; k < N; k++) {
        real *z = &w.kept[k * NW], *next = &z[NW + NU];
        for (j = 0; j < NU; j++)
            z[j] = within(z[j], w.lower[k * NU + j], w.upper[k * NU + j]);
        copy(NX, &w.c[k * NX], next);
        gemv(NX, NW, &w.f[k * NX * NW], NX, z, next);
    }
    fill(NX, 0, own);
    for (k = N; k >= 0; k--) {
        copy(NW, &w.grad[k * NW], w.m);
        gemv(NW, NW, &w.hess[k * NW * NW], NW, &w.kept[k * NW], w.m);
        copy(NX, &w.m[NU], before);
        if (k < N) {
            gemv_transposed(NX, NU, &w.f[k * NX * NW], NX, own, w.m);
            gemv_transposed(NX, NX, &w.f[k * NX * NW + NU * NX], NX, own, before);
            for (j = 0; j < NU; j++) {
                const real cost = absolute(w.m[j] * (w.z[k * NW + j] - w.kept[k * NW + j]));
                if (is_finite(cost))
                    most = larger(most, cost);
            }
        }
        copy(NX, before, own);
    }
    return most;
}

static void enter(real mu) {
    int i, up;
    for (i = 0; i < ALL; i++) {
        const int equation = is_equation(i), hard = is_hard(i);
        const real v = value_of(i), unit = SQRT(mu * w.reach[i]);
        w.y[i] = 0;
        if (equation && i < N * NU) {
            if (w.z[place_of(i)] != w.lower[i])
                w.has_gaps = 1;
            w.z[place_of(i)] = w.lower[i];
        }
        for (up = 0; up < 2; up++) {
            const real h = up ? w.upper[i] - v : v - w.lower[i];
            side_t *s = &w.sides[2 * i + up];
            s->on = is_finite(h) && !equation && w.reach[i] > 0;
            s->soft = 0;
            s->linear = 0;
            s->t = s->l = s->s = s->n = s->gap = s->slope = s->dt = s->dl = s->ds = s->dn = s->by_t = s->by_s = 0;
            if (!s->on)
                continue;
            s->soft = !hard;
            s->linear = !hard && linear_of(i) > 0;
            s->t = larger(absolute(h), unit);
            s->l = mu / s->t;
            if (s->linear) {
                real most;
                s->s = unit;
                most = linear_of(i) + 2 * quadratic_of(i) * s->s;
                s->l = smaller(s->l, most / 2);
                s->n = most - s->l;
            } else if (s->soft) {
                s->s = s->l / (2 * quadratic_of(i));
            }
        }
    }
}

static real stiffness_of(const side_t *s, real quadratic) {
    return 2 * quadratic + (s->linear ? s->n / s->s : 0);
}

static real push_of(const side_t *s) {
    return s->slope + (s->linear ? s->by_s / s->s : 0);
}

static void aim_inside(real mu, int corrected) {
    int i, up;
    for (i = 0; i < ALL; i++) {
        const real v = value_of(i);
        real weight = 0, aim = 0;
        if (i >= N * NU && is_equation(i) && w.reach[i] > 0) {
            weight = stiff(i);
            aim = w.y[i] + weight * (v - w.lower[i]);
        }
        if (w.reach[i] == 0 && !is_hard(i)) {
            const real beyond = larger(larger(v - w.upper[i], w.lower[i] - v), 0);
            aim = beyond > 0 ? (v > w.upper[i] ? 1 : -1) * (linear_of(i) + 2 * quadratic_of(i) * beyond) : 0;
            w.y[i] = aim;
        }
        for (up = 0; up < 2; up++) {
            side_t *s = &w.sides[2 * i + up];
            real over = 0, own, scale;
            if (!s->on)
                continue;
            s->gap = (up ? w.upper[i] - v : v - w.lower[i]) + s->s - s->t;
            s->by_t = mu - s->t * s->l - (corrected ? s->dt * s->dl : 0);
            own = s->gap;
            if (s->soft) {
                s->slope = s->l + s->n - linear_of(i) - 2 * quadratic_of(i) * s->s;
                if (s->linear)
                    s->by_s = mu - s->s * s->n - (corrected ? s->ds * s->dn : 0);
                over = 1 / stiffness_of(s, quadratic_of(i));
                own += push_of(s) * over;
            }
            scale = s->t + s->l * over;
            weight += s->l / scale;
            aim += (up ? 1 : -1) * (s->l + (s->by_t - s->l * own) / scale);
        }
        if (i < N * NU) {
            w.want_u[i] = weight;
            w.want_fixed[i] = (unsigned char)(w.lower[i] == w.upper[i]);
        } else {
            w.want_rows[i - N * NU] = weight;
        }
        w.aim[i] = aim;
    }
}

static real shorter(real longest, real v, real d) {
    return v + longest * d < 0 ? -v / d : longest;
}

/* How slacks and multipliers move with the step; the longest share of it that keeps them positive. */
static real follow(void) {
    real longest = 2; /* what is longer than the whole step is cut off */
    int i, up;
    for (i = 0; i < ALL; i++) {
        if (i < N * NU)
            w.dv[i] = w.dz[place_of(i)];
        else
            w.dv[i] = dot(NW, &w.rows[(i - N * NU) * NW], &w.dz[ROW_NODE[i - N * NU] * NW]);
        for (up = 0; up < 2; up++) {
            side_t *s = &w.sides[2 * i + up];
            const real dh = up ? -w.dv[i] : w.dv[i];
            real over = 0, own = 0;
            if (!s->on)
                continue;
            if (s->soft) {
                over = 1 / stiffness_of(s, quadratic_of(i));
                own = push_of(s) * over;
            }
            s->dl = (s->by_t - s->l * (s->gap + own + dh)) / (s->t + s->l * over);
            s->ds = s->soft ? s->dl * over + own : 0;
            s->dt = dh + s->ds + s->gap;
            longest = shorter(shorter(longest, s->t, s->dt), s->l, s->dl);
            if (s->linear) {
                s->dn = (s->by_s - s->n * s->ds) / s->s;
                longest = shorter(shorter(longest, s->s, s->ds), s->n, s->dn);
            }
        }
    }
    return longest;
}

static real complementarity(real t) {
    real sum = 0;
    int i, count = 0;
    for (i = 0; i < 2 * ALL; i++) {
        const side_t *s = &w.sides[i];
        if (!s->on)
            continue;
        sum += (s->t + t * s->dt) * (s->l + t * s->dl);
        count++;
        if (s->linear) {
            sum += (s->s + t * s->ds) * (s->n + t * s->dn);
            count++;
        }
    }
    return count > 0 ? sum / (real)count : 0;
}

static void make_step(real t) {
    int i, up;
    axpy((N + 1) * NW, t, w.dz, w.z);
    for (i = 0; i < ALL; i++) {
        if (i >= N * NU && is_equation(i) && w.reach[i] > 0)
            w.y[i] += t * (w.aim[i] + stiff(i) * w.dv[i] - w.y[i]);
        for (up = 0; up < 2; up++) {
            side_t *s = &w.sides[2 * i + up];
            s->t += t * s->dt;
            s->l += t * s->dl;
            s->s += t * s->ds;
            s->n += t * s->dn;
            s->dt = s->dl = s->ds = s->dn = 0;
        }
    }
}

/* The active set that slacks and multipliers point to: is it that of the last iterate, and not the one that was tried? */
static int point(void) {
    int i, up, same = 1, tried = 1;
    for (i = 0; i < ALL; i++) {
        signed char sign = 0;
        real most = 1;
        for (up = 0; up < 2; up++) {
            const side_t *s = &w.sides[2 * i + up];
            real ratio;
            if (!s->on)
                continue;
            ratio = s->l * w.reach[i] / s->t;
            if (ratio > most) {
                most = ratio;
                sign = (signed char)(up ? 1 : -1);
                if (s->soft && s->s > s->n * w.reach[i])
                    sign = (signed char)(2 * sign);
            }
        }
        same = same && w.pointed[i] == sign;
        tried = tried && w.tried[i] == sign;
        w.pointed[i] = sign;
    }
    return same && !tried;
}

static void adopt(void) {
    int i;
    for (i = 0; i < ALL; i++) {
        const int sign = w.pointed[i];
        if (is_equation(i)) {
            w.state[i] = IN;
            continue;
        }
        if (w.reach[i] == 0)
            continue;
        w.state[i] = (unsigned char)(sign == 0 ? OUT : (sign == 1 || sign == -1) ? IN : BEYOND);
        if (sign != 0)
            w.sign[i] = (real)(sign > 0 ? 1 : -1);
        w.y[i] = w.sides[2 * i + 1].l - w.sides[2 * i].l;
    }
}

/* Do the multipliers of rows prove that these contradict each other (Farkas)? */
static int contradicts(void) {
    real sum = 0, terms = 0, left = 0, own[NX], before[NX], after[NU];
    int k, r, j, any = 0;
    for (r = 0; r < ROWS; r++)
        any = any || is_hard(N * NU + r);
    if (w.has_gaps || !any)
        return 0;
    fill(NX, 0, own);
    for (k = N; k >= 0; k--) {
        fill(NX, 0, before);
        fill(NU, 0, after);
        if (k < N) {
            gemv_transposed(NX, NU, &w.f[k * NX * NW], NX, own, after);
            gemv_transposed(NX, NX, &w.f[k * NX * NW + NU * NX], NX, own, before);
        }
        for (r = ROW_FIRST[k]; r < ROW_FIRST[k + 1]; r++) {
            const int i = N * NU + r;
            const real *row = &w.rows[r * NW];
            real y, value, bound;
            if (!is_hard(i))
                continue;
            y = w.lower[i] == w.upper[i] ? w.y[i] : w.sides[2 * i + 1].l - w.sides[2 * i].l;
            if (y == 0)
                continue;
            value = dot(NW, row, &w.z[k * NW]);
            bound = y > 0 ? w.upper[i] : w.lower[i];
            sum += y * (value - bound);
            terms += absolute(y * value) + absolute(y * bound);
            axpy(NU, y, row, after);
            axpy(NX, y, &row[NU], before);
        }
        for (j = 0; k < N && j < NU; j++) {
            const real d = after[j], u = w.z[k * NW + j];
            const real to = d > 0 ? w.lower[k * NU + j] : w.upper[k * NU + j];
            if (is_finite(to)) {
                sum += d * (to - u);
                terms += absolute(d * u) + absolute(d * to);
            } else {
                left = larger(left, larger(absolute(d * u), d * d * w.reach[k * NU + j]));
            }
        }
        copy(NX, before, own);
    }
#if FREE
    for (j = 0; j < NX; j++)
        left = larger(left, absolute(own[j] * w.z[NU + j]));
#endif
    return sum > FARKAS * terms && left <= FARKAS * sum;
}

static int interior(const real *x0, real scale) {
    real first, mu, left = 1;
    int pass, i;
    enter(scale);
    for (i = 0; i < ALL; i++)
        w.pointed[i] = w.tried[i] = -128;
    clear_weights();
    first = mu = complementarity(0);
    for (pass = 0; pass < MOST; pass++) {
        real after, centre, t;
        w.iterations++;
        evaluate();
        aim_inside(0, 0);
        if (!factorise())
            break;
        newton(x0, 0);
        after = larger(complementarity(smaller(follow(), 1)), 0);
        centre = mu > 0 ? mu * smaller(after / mu * (after / mu) * (after / mu), 1) : 0;
        aim_inside(centre, 1);
        newton(x0, 0);
        t = smaller(BOUNDARY * follow(), 1);
        if (!(t > EPSILON))
            break;
        make_step(t);
        left *= 1 - t;
        if (left == 0)
            w.has_gaps = 0;
        mu = complementarity(0);
        if (!is_finite(mu))
            return STUCK;
        if (left > EPSILON && contradicts())
            return CONTRADICTION;
        if (point()) {
            const int gaps = w.has_gaps;
            copy((N + 1) * NW, w.z, w.kept);
            copy(ALL, w.y, w.kept_y);
            adopt();
            for (i = 0; i < ALL; i++)
                w.tried[i] = w.pointed[i];
            if (settle(x0, 0) == SOLVED)
                return SOLVED;
            copy((N + 1) * NW, w.kept, w.z);
            copy(ALL, w.kept_y, w.y);
            w.has_gaps = gaps;
        }
        if (mu <= EPSILON * first && left <= EPSILON)
            break;
    }
    if (mu <= NEARLY * first && left <= NEARLY) {
        adopt();
        return SOLVED;
    }
    return STUCK;
}

static int solve(const real *x0) {
    const int near = w.is_solution;
    int i, end;
    w.is_solution = 0;
    begin();
    for (i = 0; i < ALL; i++)
        if (is_hard(i) && !(w.lower[i] <= w.upper[i])) {
            (void)start(x0);
            return CONTRADICTION;
        }
    if (near)
        copy((N + 1) * NW, w.z, w.kept);
    else
        fill((N + 1) * NW, 0, w.kept);
    if (w.elastic)
        (void)start(x0);
    /* near its solution a step is short and loses no digits to the weights of rows */
    copy((N + 1) * NW, w.kept, w.z);
    w.has_gaps = !near;
    end = settle(x0, PATIENCE);
    if (end == CONTRADICTION)
        (void)start(x0);
    if (end == STUCK) {
        real scale = start(x0);
        scale = larger(scale, cost_of_cutting());
        if (scale > 0)
            end = interior(x0, scale);
    }
    w.is_solution = end == SOLVED && all_finite((N + 1) * NW, w.z);
    return end;
}

/* What it costs to meet rows one by one, per unit of violation. */
static real cost_of_rows(void) {
    real cost = 0, sum = 0, spread[NX], next[NX];
    int k, r, i, j;
    fill(NX, FREE ? INFINITY : 0, spread);
    for (k = 0; k <= N; k++) {
        for (r = ROW_FIRST[k]; r < ROW_FIRST[k + 1]; r++) {
            const real beyond = larger(w.free_values[r] - w.upper[N * NU + r], w.lower[N * NU + r] - w.free_values[r]);
            const real own = w.reach[N * NU + r];
            if (beyond > 0 && own > 0 && !is_finite(ROW_LINEAR[r])) {
                real span = 0, v;
                for (j = 0; j < NW; j++)
                    if (w.rows[r * NW + j] != 0)
                        span += absolute(w.rows[r * NW + j]) * (j < NU ? w.upper[(k < N ? k : 0) * NU + j] - w.lower[(k < N ? k : 0) * NU + j] : spread[j - NU]);
                v = smaller(beyond, span);
                cost += v * v / (2 * own);
                sum += v;
            }
        }
        if (k == N)
            break;
        fill(NX, 0, next);
        for (j = 0; j < NW; j++)
            for (i = 0; i < NX; i++)
                if (w.f[k * NX * NW + i + j * NX] != 0)
                    next[i] += absolute(w.f[k * NX * NW + i + j * NX]) * (j < NU ? w.upper[k * NU + j] - w.lower[k * NU + j] : spread[j - NU]);
        copy(NX, next, spread);
    }
    return sum > 0 ? cost / sum : 0;
}

static int violates(void) {
    int i;
    for (i = N * NU; i < ALL; i++)
        if (!is_finite(ROW_LINEAR[i - N * NU]) && w.state[i] == BEYOND)
            return 1;
    return 0;
}

/* The active set moves on by one stage. */
static void shift_active(void) {
    int i, k, to;
    for (i = 0; i < ALL; i++) {
        const unsigned char state = w.state[i];
        const real sign = w.sign[i], y = w.y[i];
        w.state[i] = OUT;
        to = i - NU;
        if (i >= N * NU) {
            k = ROW_NODE[i - N * NU];
            to = -1;
            if (k > 0) {
                const int j = ROW_FIRST[k - 1] + (i - N * NU - ROW_FIRST[k]);
                if (j < ROW_FIRST[k])
                    to = N * NU + j;
            }
        }
        if (to >= 0) {
            w.state[to] = state;
            w.sign[to] = sign;
            w.y[to] = y;
        }
    }
}

/* Factors of a program that is written; 0 where it has none. */
static int factors(void) {
    clear_weights();
    w.free.valid = w.now.valid = N + 1;
    if (!riccati(&w.free, w.want_u, w.want_rows, w.want_fixed))
        return 0;
    reaches();
    if (!all_finite(ALL, w.reach))
        return 0;
    if (!place())
        (void)factorise();
    return 1;
}

