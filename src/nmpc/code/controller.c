/* ---- the problem: dynamics, costs, constraints at a point ---- */

static real time_of(int k) {
    return T[k];
}

/* The control that counts at a node: at the last one that of the last stage. */
static const real *control_at(const real *u, int k) {
    return &u[(k < N ? k : N - 1) * NU];
}

/* One stage of Runge-Kutta steps; with f also its derivatives [B A]. */
static int stage_of(int k, const real *x, const real *u, real *next, real *f) {
    const real step = H[k] / STEPS;
    int q, i, j, e, col, r;
    copy(NX, x, next);
    if (f != 0) {
        fill(NX * NW, 0, w.s);
        for (i = 0; i < NX; i++)
            w.s[i + (NU + i) * NX] = 1;
    }
    for (q = 0; q < STEPS; q++) {
        for (i = 0; i < RK; i++) {
            real z[NX];
            real *own = &w.sk[i * NX * NW];
            copy(NX, next, z);
            for (j = 0; j < i; j++)
                axpy(NX, RK_A[i * RK + j] * step, &w.k[j * NX], z);
            if (call_value(0, time_of(k) + ((real)q + RK_C[i]) * step, z, u, w.params, &w.k[i * NX]) != 0)
                return 0;
            if (f == 0)
                continue;
            if (call_jacobian(0, time_of(k) + ((real)q + RK_C[i]) * step, z, u, w.params, w.jac) != 0)
                return 0;
            copy(NX * NW, w.s, w.sz);
            for (j = 0; j < i; j++)
                axpy(NX * NW, RK_A[i * RK + j] * step, &w.sk[j * NX * NW], w.sz);
            fill(NX * NW, 0, own);
            e = 0;
            for (col = 0; col < NX + NU; col++) {
                for (; e < (int)FUN_COLS[0][col + 1]; e++) {
                    const int row = (int)FUN_ROWS[0][e];
                    if (col >= NX) {
                        own[row + (col - NX) * NX] += w.jac[e];
                        continue;
                    }
                    for (r = 0; r < NW; r++)
                        own[row + r * NX] += w.jac[e] * w.sz[col + r * NX];
                }
            }
        }
        for (i = 0; i < RK; i++) {
            axpy(NX, RK_B[i] * step, &w.k[i * NX], next);
            if (f != 0)
                axpy(NX * NW, RK_B[i] * step, &w.sk[i * NX * NW], w.s);
        }
    }
    if (f != 0)
        copy(NX * NW, w.s, f);
    return all_finite(NX, next) && (f == 0 || all_finite(NX * NW, f));
}

/* Value of a function at a node of the point, and its derivatives by [u x] row by row. */
static int function_at(int fun, int k) {
    const real *x = &w.at_x[k * NX], *u = control_at(w.at_u, k);
    int e = 0, col;
    if (call_value(fun, time_of(k), x, u, w.params, w.value) != 0 || call_jacobian(fun, time_of(k), x, u, w.params, w.jac) != 0)
        return 0;
    fill(FUN_OUT[fun] * NW, 0, w.line);
    for (col = 0; col < NX + NU; col++)
        for (; e < (int)FUN_COLS[fun][col + 1]; e++)
            if (col < NX || k < N)
                w.line[(int)FUN_ROWS[fun][e] * NW + (col < NX ? NU + col : col - NX)] += w.jac[e];
    return all_finite(FUN_OUT[fun], w.value) && all_finite(FUN_OUT[fun] * NW, w.line);
}

/* Gradient of the cost at the point, and its Hessian where that is wanted: 2 s J' W (f - y), 2 s J' W J. */
static int costs(int second) {
    int term, q, i, j, a, b;
    fill((N + 1) * NW, 0, w.grad);
    if (second)
        fill((N + 1) * NW * NW, 0, w.hess);
    for (term = 0; term < TERMS; term++) {
        const int outs = FUN_OUT[1 + term];
        const real *weights = &WEIGHTS[TERM_WEIGHTS[term]];
        for (q = 0; q < TERM_COUNT[term]; q++) {
            const int k = TERM_FIRST[term] + q;
            const real *y = &w.references[TERM_REFERENCES[term] + q * outs];
            const real scale = 2 * (TERM_BY_LENGTH[term] ? H[k] : 1);
            if (!function_at(1 + term, k))
                return 0;
            for (i = 0; i < outs; i++) {
                for (j = 0; j < outs; j++) {
                    const real weight = scale * weights[i * outs + j];
                    const real *left = &w.line[i * NW], *right = &w.line[j * NW];
                    if (weight == 0)
                        continue;
                    axpy(NW, weight * (w.value[j] - y[j]), left, &w.grad[k * NW]);
                    for (a = 0; second && a < NW; a++)
                        for (b = 0; b < NW; b++)
                            w.hess[k * NW * NW + a + b * NW] += weight * left[a] * right[b];
                }
            }
        }
    }
    return 1;
}

static int constraints(void) {
    int r, fun = -1, node = -1;
    for (r = 0; r < ROWS; r++) {
        real *row = &w.rows[r * NW], value;
        const int k = ROW_NODE[r], out = ROW_OUT[r];
        if (ROW_FUN[r] == 0) {
            fill(NW, 0, row);
            row[NU + out] = 1;
            value = w.at_x[k * NX + out];
        } else {
            if ((fun != ROW_FUN[r] || node != k) && !function_at(ROW_FUN[r], k))
                return 0;
            fun = ROW_FUN[r];
            node = k;
            copy(NW, &w.line[out * NW], row);
            value = w.value[out];
        }
        w.lower[N * NU + r] = ROW_LOWER[r] - value;
        w.base[N * NU + r] = absolute(value);
        w.upper[N * NU + r] = ROW_UPPER[r] - value;
    }
    return 1;
}

/* ---- the controller ---- */

/* Takes the price that the last program asks for, where that is far from the one that is there; is it a higher one? */
static int adapt_price(void) {
    const real asked = ELASTIC * cost_of_rows();
    int more;
    if (GIVEN_PRICE > 0 || asked == 0 || !is_finite(asked) || (asked <= APART * w.price && w.price <= APART * asked))
        return 0;
    more = asked > w.price;
    w.price = asked;
    return more;
}

static void default_price(void) {
    real largest = 0;
    int i;
    if (GIVEN_PRICE > 0)
        w.price = GIVEN_PRICE;
    if (w.price > 0)
        return;
    for (i = 0; i < (N + 1) * NW; i++)
        largest = larger(largest, absolute(w.grad[i]));
    w.price = ELASTIC * (largest > 0 ? largest : 1);
}

/* The program, with rows at a price where they cannot all be met; *violated says whether some are. */
static int solve_program(const real *dx0, int *violated) {
    int end = STUCK;
    w.iterations = 0;
    *violated = 0;
    if (!w.violating) {
        w.elastic = 0;
        end = solve(dx0);
        if (end == SOLVED)
            return end;
        (void)adapt_price();
    }
    w.elastic = 1;
    default_price();
    end = solve(dx0);
    if (end == SOLVED && adapt_price())
        end = solve(dx0);
    w.elastic = 0;
    w.violating = end != SOLVED || violates();
    *violated = w.violating;
    return end;
}

/* The plan becomes the point plus the step of the last solution. */
static void advance(void) {
    int k;
    for (k = 0; k <= N; k++) {
        copy(NX, &w.at_x[k * NX], &w.x[k * NX]);
        axpy(NX, 1, &w.z[k * NW + NU], &w.x[k * NX]);
        if (k < N) {
            copy(NU, &w.at_u[k * NU], &w.u[k * NU]);
            axpy(NU, 1, &w.z[k * NW], &w.u[k * NU]);
        }
    }
}

static void control_bounds(void) {
    int i;
    for (i = 0; i < N * NU; i++) {
        w.lower[i] = w.u_lower[i % NU] - w.at_u[i];
        w.base[i] = absolute(w.at_u[i]);
        w.upper[i] = w.u_upper[i % NU] - w.at_u[i];
    }
}

static int linearise(void) {
    int k;
    w.ready = w.is_solution = 0;
    copy((N + 1) * NX, w.x, w.at_x);
    copy(N * NU, w.u, w.at_u);
    for (k = 0; k < N; k++) {
        real *c = &w.c[k * NX];
        if (!stage_of(k, &w.x[k * NX], &w.u[k * NU], c, &w.f[k * NX * NW]))
            return 0;
        axpy(NX, -1, &w.x[(k + 1) * NX], c);
    }
    if (!costs(1) || !constraints())
        return 0;
    control_bounds();
    w.ready = factors();
    return w.ready;
}

static void finish(void) {
    if (w.pending == 0)
        return;
    if (w.pending == 1) {
        advance();
        w.entry = 1;
    } else {
        w.entry++;
    }
    w.pending = 0;
    w.has_prediction = w.seen && INNER > 0 && stage_of(0, w.measured, w.applied, w.predicted, 0);
}

static void shift(void) {
    int i;
    for (i = 0; i < N * NX; i++)
        w.x[i] = w.x[i + NX];
    for (i = 0; i + NU < N * NU; i++)
        w.u[i] = w.u[i + NU];
    shift_active();
}

void PREFIX(reset)(void) {
    int i;
    copy((N + 1) * NX, START_X, w.x);
    copy(N * NU, START_U, w.u);
    copy(NU, START_U, w.applied);
    copy(NU, U_LOWER, w.u_lower);
    copy(NU, U_UPPER, w.u_upper);
    copy(NP, START_P, w.params);
    copy(REFERENCES, START_REFERENCES, w.references);
    fill(ALL, 0, w.y);
    for (i = 0; i < ALL; i++) {
        w.state[i] = OUT;
        w.sign[i] = 1;
    }
    w.price = 0;
    w.elastic = w.is_solution = w.ready = w.prepared = w.pending = w.seen = w.unshifted = w.has_prediction = w.violating = w.entry = 0;
    w.started = 1;
}

int PREFIX(prepare)(void) {
    int inner, violated;
    if (!w.started)
        PREFIX(reset)();
    finish();
    if (SHIFT && w.unshifted) {
        shift();
        w.entry = w.entry > 0 ? w.entry - 1 : 0;
    }
    w.unshifted = 0;
    for (inner = 0; w.has_prediction && inner < INNER; inner++) {
        real dx0[NX];
        int i;
        if (!linearise())
            break;
        for (i = 0; i < NX; i++)
            dx0[i] = w.predicted[i] - w.at_x[i];
        if (solve_program(dx0, &violated) != SOLVED || !all_finite((N + 1) * NW, w.z))
            break;
        advance();
        w.entry = 0;
    }
    (void)linearise();
    /* where rows could not be met the active set is far from that of any other program: solve it for the state that is predicted */
    if (w.violating && w.ready && w.entry <= N) {
        const real *next = w.has_prediction ? w.predicted : &w.x[w.entry * NX];
        real dx0[NX];
        int i;
        for (i = 0; i < NX; i++)
            dx0[i] = next[i] - w.at_x[i];
        (void)solve_program(dx0, &violated);
    }
    w.prepared = 1;
    return w.ready;
}

int PREFIX(feedback)(const real *x, real *u) {
    int source = 3, i, end, violated = 0;
    if (!w.started)
        PREFIX(reset)();
    if (w.pending != 0)
        w.entry++;
    w.prepared = 0;
    w.seen = all_finite(NX, x);
    if (w.seen && w.ready) {
        real dx0[NX];
        for (i = 0; i < NX; i++)
            dx0[i] = x[i] - w.at_x[i];
        end = solve_program(dx0, &violated);
        source = violated ? 1 : 0;
        if (end == STUCK) {
            if (!all_finite((N + 1) * NW, w.z))
                (void)start(dx0);
            source = 2;
        }
        for (i = 0; i < NU; i++)
            u[i] = w.at_u[i] + w.z[i];
        if (!all_finite((N + 1) * NW, w.z))
            source = 3;
    }
    w.pending = source <= 1 ? 1 : 2;
    if (source == 3) {
        if (w.entry < N) {
            copy(NU, &w.u[w.entry * NU], u);
        } else {
            copy(NU, w.applied, u);
            source = 4;
        }
    }
    for (i = 0; i < NU; i++)
        u[i] = within(u[i], w.u_lower[i], w.u_upper[i]);
    if (w.seen)
        copy(NX, x, w.measured);
    w.unshifted = w.seen;
    copy(NU, u, w.applied);
    return source;
}

int PREFIX(set_reference)(int term, const real *y) {
    int i;
    if (term < 0 || term >= TERMS || !all_finite(FUN_OUT[1 + term], y))
        return 0;
    if (!w.started)
        PREFIX(reset)();
    finish();
    for (i = 0; i < TERM_COUNT[term]; i++)
        copy(FUN_OUT[1 + term], y, &w.references[TERM_REFERENCES[term] + i * FUN_OUT[1 + term]]);
    w.is_solution = 0;
    if (w.prepared && w.ready && !costs(0))
        w.ready = 0;
    return 1;
}

int PREFIX(set_control_bounds)(const real *lower, const real *upper) {
    int i;
    for (i = 0; i < NU; i++)
        if (!(lower[i] <= upper[i]))
            return 0;
    if (!w.started)
        PREFIX(reset)();
    finish();
    copy(NU, lower, w.u_lower);
    copy(NU, upper, w.u_upper);
    if (w.ready)
        control_bounds();
    return 1;
}

int PREFIX(set_params)(const real *p) {
    if (!all_finite(NP, p))
        return 0;
    if (!w.started)
        PREFIX(reset)();
    finish();
    copy(NP, p, w.params);
    return 1;
}

const real *PREFIX(plan_x)(void) {
    finish();
    return w.x;
}

const real *PREFIX(plan_u)(void) {
    finish();
    return w.u;
}

int PREFIX(iterations)(void) {
    return w.iterations;
}
