/* ---- the model: dynamics and measurements at a node ---- */

/* One stage of Runge-Kutta steps from x under the control u; with a also its derivatives by x. */
static int stage_of(real t, const real *x, const real *u, const real *p, real *next, real *a) {
    const real step = LENGTH / STEPS;
    int q, i, j, e, col, r;
    copy(NX, x, next);
    if (a != 0) {
        fill(NX * NX, 0, w.s);
        for (i = 0; i < NX; i++)
            w.s[i * (NX + 1)] = 1;
    }
    for (q = 0; q < STEPS; q++) {
        for (i = 0; i < RK; i++) {
            const real at = t + ((real)q + RK_C[i]) * step;
            real z[NX];
            real *own = &w.sk[i * NX * NX];
            copy(NX, next, z);
            for (j = 0; j < i; j++)
                axpy(NX, RK_A[i * RK + j] * step, &w.k[j * NX], z);
            if (call_value(0, at, z, u, p, &w.k[i * NX]) != 0)
                return 0;
            if (a == 0)
                continue;
            if (call_jacobian(0, at, z, u, p, w.jac) != 0)
                return 0;
            copy(NX * NX, w.s, w.sz);
            for (j = 0; j < i; j++)
                axpy(NX * NX, RK_A[i * RK + j] * step, &w.sk[j * NX * NX], w.sz);
            fill(NX * NX, 0, own);
            e = 0;
            for (col = 0; col < NX; col++)
                for (; e < (int)FUN_COLS[0][col + 1]; e++) {
                    const int row = (int)FUN_ROWS[0][e];
                    for (r = 0; r < NX; r++)
                        own[row + r * NX] += w.jac[e] * w.sz[col + r * NX];
                }
        }
        for (i = 0; i < RK; i++) {
            axpy(NX, RK_B[i] * step, &w.k[i * NX], next);
            if (a != 0)
                axpy(NX * NX, RK_B[i] * step, &w.sk[i * NX * NX], w.s);
        }
    }
    if (a != 0)
        copy(NX * NX, w.s, a);
    return all_finite(NX, next) && (a == 0 || all_finite(NX * NX, a));
}

static real time_of(int k) {
    const unsigned long before = (unsigned long)(N - k);
    return START_T + (real)(w.samples > before ? w.samples - before : 0) * LENGTH;
}

static const real *params_at(int k) {
    return &w.window_p[k * NP];
}

/* The measurement at a node, and its derivatives by the state row by row. */
static int measurement_at(int k) {
    const real *x = &w.window_x[k * NX], *u = &w.window_u[k * MU];
    int e = 0, col;
    if (call_value(1, time_of(k), x, u, params_at(k), w.value) != 0 || call_jacobian(1, time_of(k), x, u, params_at(k), w.jac) != 0)
        return 0;
    fill(NY * NX, 0, w.line);
    for (col = 0; col < NX; col++)
        for (; e < (int)FUN_COLS[1][col + 1]; e++)
            w.line[(int)FUN_ROWS[1][e] * NX + col] += w.jac[e];
    return all_finite(NY, w.value) && all_finite(NY * NX, w.line);
}

/* ---- the arrival cost: a mean, and a root of its covariance ---- */

/* Makes an array lower triangular by reflections of its columns. */
static void triangular(int rows, int cols, real *m) {
    int i, j, r;
    for (i = 0; i < rows && i < cols; i++) {
        real *v = &m[i * cols + i];
        real largest = 0, rest = 0, norm = 0, to, half;
        for (j = 0; j < cols - i; j++) {
            largest = larger(largest, absolute(v[j]));
            if (j > 0)
                rest = larger(rest, absolute(v[j]));
        }
        if (largest == 0 || rest == 0)
            continue;
        for (j = 0; j < cols - i; j++)
            norm += v[j] / largest * (v[j] / largest);
        norm = largest * SQRT(norm);
        to = v[0] > 0 ? -norm : norm;
        v[0] -= to;
        half = -to * v[0];
        for (r = i + 1; r < rows; r++) {
            real *other = &m[r * cols + i];
            axpy(cols - i, -dot(cols - i, v, other) / half, v, other);
        }
        fill(cols - i, 0, v);
        v[0] = to;
    }
}

/* The root from an array of so many columns. Its diagonal stays above a share of the deviations of the start. */
static void take_root(int cols) {
    int i, j;
    triangular(NX, cols, w.array);
    for (i = 0; i < NX; i++) {
        real *own = &w.root[i * NX];
        real least;
        copy(NX, &w.array[i * cols], own);
        for (j = i + 1; j < NX; j++)
            own[j] = 0;
        least = larger(absolute(own[i]), FLOOR * DEVIATIONS[i]);
        own[i] = own[i] < 0 ? -least : least;
    }
}

/* What a measurement adds: the one of the node of w.line, with residuals that are no number where nothing was measured. */
static void add_measurement(const real *residual) {
    enum { W = NY + NX };
    real row[NY];
    int i, j, k;
    fill(W * W, 0, w.array);
    for (i = 0; i < NY; i++) {
        const int there = is_finite(residual[i]);
        w.array[i * W + i] = there ? SIGMA[i] : 1;
        row[i] = there ? residual[i] : 0;
        for (j = 0; there && j < NX; j++)
            for (k = j; k < NX; k++)
                w.array[i * W + NY + j] += w.line[i * NX + k] * w.root[k * NX + j];
    }
    for (i = 0; i < NX; i++)
        copy(NX, &w.root[i * NX], &w.array[(NY + i) * W + NY]);
    triangular(W, W, w.array);
    for (i = 0; i < NY; i++)
        row[i] = (row[i] - dot(i, &w.array[i * W], row)) / w.array[i * W + i];
    for (i = 0; i < NX; i++) {
        w.mean[i] += dot(NY, &w.array[(NY + i) * W], row);
        copy(NX, &w.array[(NY + i) * W + NY], &w.root[i * NX]);
    }
}

static void add_noise(int cols) {
    int j;
    for (j = 0; j < NOISY; j++)
        w.array[NOISY_STATES[j] * cols + NX + j] = PROCESS[j];
}

/* A stage that ends at f with the derivatives a, from x. */
static void pass(const real *f, const real *a, const real *x) {
    enum { W = NX + NOISY };
    real next[NX];
    int i, j, k;
    fill(NX * W, 0, w.array);
    for (i = 0; i < NX; i++) {
        next[i] = f[i];
        for (k = 0; k < NX; k++)
            next[i] += a[i + k * NX] * (w.mean[k] - x[k]);
        for (j = 0; j < NX; j++)
            for (k = j; k < NX; k++)
                w.array[i * W + j] += a[i + k * NX] * w.root[k * NX + j];
    }
    add_noise(W);
    take_root(W);
    copy(NX, next, w.mean);
}

/* A stage of which nothing is known but its noise and its end. */
static void follow_stage(const real *x) {
    enum { W = NX + NOISY };
    int i;
    fill(NX * W, 0, w.array);
    for (i = 0; i < NX; i++)
        copy(NX, &w.root[i * NX], &w.array[i * W]);
    add_noise(W);
    take_root(W);
    copy(NX, x, w.mean);
}

/* The weight of the arrival cost: the inverse of the covariance. */
static void arrival_weight(void) {
    int i, j, k;
    fill(NX * NX, 0, w.array);
    for (i = 0; i < NX; i++) {
        real *own = &w.array[i * NX];
        own[i] = 1;
        for (k = 0; k < i; k++)
            axpy(NX, -w.root[i * NX + k], &w.array[k * NX], own);
        for (j = 0; j < NX; j++)
            own[j] /= w.root[i * (NX + 1)];
    }
    fill(NX * NX, 0, w.arrival);
    for (k = 0; k < NX; k++)
        for (j = 0; j < NX; j++)
            axpy(NX, w.array[k * NX + j], &w.array[k * NX], &w.arrival[j * NX]);
}

/* ---- the estimator ---- */

static int has(int k, int i) {
    return k >= N - w.filled && ((k == N && !w.estimated) || is_finite(w.window_y[k * NY + i]));
}

/* What the measurements of a node cost. */
static int write_node(int k) {
    real *hess = &w.hess[k * NW * NW], *grad = &w.grad[k * NW];
    int i, j, l;
    fill(NW * NW, 0, hess);
    fill(NW, 0, grad);
    for (j = 0; k < N && j < NU; j++) {
        hess[j * (NW + 1)] = INVERSE_PROCESS[j];
        grad[j] = hess[j * (NW + 1)] * w.window_w[k * NU + j];
    }
    if (k < N - w.filled)
        return 1;
    if (!measurement_at(k))
        return 0;
    for (i = 0; i < NY; i++) {
        const real weight = 1 / (SIGMA[i] * SIGMA[i]);
        real gap = w.window_y[k * NY + i] - w.value[i];
        if (!has(k, i))
            continue;
        gap = is_finite(gap) ? gap : 0;
        for (j = 0; j < NX; j++) {
            grad[NU + j] -= weight * w.line[i * NX + j] * gap;
            for (l = 0; l < NX; l++)
                hess[NU + l + (NU + j) * NW] += weight * w.line[i * NX + j] * w.line[i * NX + l];
        }
    }
    return 1;
}

/* The program at the window, and its factors. */
static int linearise(void) {
    const int idle = N - w.filled;
    int k, i, j;
    w.ready = w.is_solution = 0;
    for (k = 0; k < N; k++) {
        const real *x = &w.window_x[k * NX];
        real *f = &w.f[k * NX * NW], *c = &w.c[k * NX];
        fill(NX * NW, 0, f);
        if (k < idle) {
            for (i = 0; i < NX; i++)
                f[(NU + i) * NX + i] = 1;
            copy(NX, x, c);
        } else {
            if (!stage_of(time_of(k), x, &w.window_u[(k + 1) * MU], params_at(k), c, &f[NU * NX]))
                return 0;
            for (j = 0; j < NOISY; j++) {
                f[j * NX + NOISY_STATES[j]] = 1;
                c[NOISY_STATES[j]] += w.window_w[k * NU + j];
            }
        }
        axpy(NX, -1, &w.window_x[(k + 1) * NX], c);
    }
    for (k = 0; k <= N; k++)
        if (!write_node(k))
            return 0;
    for (k = 0; k <= N; k++)
        for (i = ROW_FIRST[k]; i < ROW_FIRST[k + 1]; i++) {
            const real v = w.window_x[k * NX + ROW_OUT[i]];
            fill(NW, 0, &w.rows[i * NW]);
            w.rows[i * NW + NU + ROW_OUT[i]] = 1;
            w.base[N * NU + i] = absolute(v);
            w.lower[N * NU + i] = k < idle ? -INFINITY : ROW_LOWER[i] - v;
            w.upper[N * NU + i] = k < idle ? INFINITY : ROW_UPPER[i] - v;
        }
    for (i = 0; i < N * NU; i++) {
        w.lower[i] = -INFINITY;
        w.upper[i] = INFINITY;
        w.base[i] = 0;
    }
    arrival_weight();
    w.ready = factors();
    return w.ready;
}

/* The first node leaves the window: what it knows of the second one is kept. */
static void leave(void) {
    real residual[NY], next[NX];
    const real *x = w.window_x;
    int i, j, known = measurement_at(0);
    for (i = 0; known && i < NY; i++) {
        residual[i] = w.window_y[i] - w.value[i];
        for (j = 0; j < NX; j++)
            residual[i] -= w.line[i * NX + j] * (w.mean[j] - x[j]);
    }
    known = known && stage_of(time_of(0), x, &w.window_u[MU], params_at(0), next, w.closed);
    if (!known) {
        follow_stage(&w.window_x[NX]);
        return;
    }
    add_measurement(residual);
    pass(next, w.closed, x);
}

static void move_on(int n, int size, real *v) {
    int i;
    for (i = 0; i < (n - 1) * size; i++)
        v[i] = v[i + size];
}

static void begin_once(void) {
    if (!w.started)
        PREFIX(reset)(START_X);
}

void PREFIX(reset)(const real *x0) {
    int i, k;
    copy(NX, x0, w.mean);
    fill(NX * NX, 0, w.root);
    for (i = 0; i < NX; i++)
        w.root[i * (NX + 1)] = DEVIATIONS[i];
    if (!w.started)
        copy(NP, START_P, w.params);
    for (k = 0; k <= N; k++) {
        copy(NX, x0, &w.window_x[k * NX]);
        copy(NP, w.params, &w.window_p[k * NP]);
    }
    fill(N * NU, 0, w.window_w);
    fill((N + 1) * MU, 0, w.window_u);
    fill((N + 1) * NY, NAN, w.window_y);
    fill(ALL, 0, w.y);
    for (i = 0; i < ALL; i++) {
        w.state[i] = OUT;
        w.sign[i] = 1;
    }
    w.samples = 0;
    w.filled = w.estimated = w.elastic = 0;
    w.price = 1;
    w.started = 1;
    (void)linearise();
}

int PREFIX(prepare)(const real *u) {
    real next[NX];
    begin_once();
    if (!stage_of(time_of(N), &w.window_x[N * NX], u, params_at(N), next, 0))
        copy(NX, &w.window_x[N * NX], next);
    if (w.filled == N)
        leave();
    move_on(N + 1, NX, w.window_x);
    move_on(N, NU, w.window_w);
    move_on(N + 1, MU, w.window_u);
    move_on(N + 1, NP, w.window_p);
    move_on(N + 1, NY, w.window_y);
    fill(NU, 0, &w.window_w[(N - 1) * NU]);
    copy(MU, u, &w.window_u[N * MU]);
    copy(NP, w.params, &w.window_p[N * NP]);
    fill(NY, NAN, &w.window_y[N * NY]);
    copy(NX, next, &w.window_x[N * NX]);
    w.samples++;
    w.filled = w.filled < N ? w.filled + 1 : N;
    w.estimated = 0;
    shift_active();
    return linearise();
}

/* A step of Gauss and Newton; its size by the deviations of the start. */
static int improve(real *size) {
    real mean[NX];
    int i, source = 0, end;
    for (i = 0; i < NX; i++)
        mean[i] = w.mean[i] - w.window_x[i];
    *size = 0;
    w.elastic = 0;
    w.iterations = 0;
    end = solve(mean);
    if (end != SOLVED) {
        real scale = cost_of_rows();
        if (!(scale > 0 && is_finite(scale))) {
            scale = 0;
            for (i = 0; i < (N + 1) * NW; i++)
                if (i % NW >= NU)
                    scale = larger(scale, absolute(w.grad[i]));
            scale = scale > 0 ? scale : 1;
        }
        w.price = ELASTIC * scale;
        w.elastic = 1;
        end = solve(mean);
        w.elastic = 0;
        source = violates() ? 1 : 0;
    }
    if (end == STUCK)
        source = 2;
    if (!all_finite((N + 1) * NW, w.z))
        return 3;
    for (i = 0; i < (N + 1) * NX; i++) {
        const real d = w.z[i / NX * NW + NU + i % NX];
        w.window_x[i] += d;
        *size = larger(*size, absolute(d) / DEVIATIONS[i % NX]);
    }
    for (i = 0; i < N * NU; i++)
        w.window_w[i] += w.z[place_of(i)];
    return source;
}

int PREFIX(estimate)(const real *y, real *x) {
    int source = 3, done, i, complete = 1;
    begin_once();
    if (!w.estimated) {
        for (i = 0; i < NY; i++)
            complete = complete && y[i] == y[i];
        copy(NY, y, &w.window_y[N * NY]);
        w.estimated = 1;
        if (w.ready)
            w.ready = write_node(N) && (complete || factors());
        for (done = 0; done < ITERATIONS; done++) {
            real size;
            if (done > 0)
                (void)linearise();
            if (!w.ready)
                break;
            source = improve(&size);
            if (source == 3 || size <= TOLERANCE)
                break;
        }
    }
    copy(NX, &w.window_x[N * NX], x);
    return source;
}

int PREFIX(set_params)(const real *p) {
    if (!all_finite(NP, p))
        return 0;
    begin_once();
    copy(NP, p, w.params);
    return 1;
}

const real *PREFIX(states)(void) {
    return w.window_x;
}

int PREFIX(filled)(void) {
    return w.filled;
}

int PREFIX(iterations)(void) {
    return w.iterations;
}
