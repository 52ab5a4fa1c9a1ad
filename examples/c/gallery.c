/* Optimal control of systems that switch, from the literature; each from its default start. The problems are those of
 * examples/python/optimal_gallery.py and of `report gallery`, with the same costs.
 *
 * Writes a table (c_gallery.csv), and of every problem the trajectory (c_gallery_NAME.csv) with plots of states and
 * controls. */
#include "expressions.h"

#include <string.h>

static const double PI = 3.141592653589793;

enum { MOST = 8 };

struct problem {
    const char *name, *see;
    struct sizes n;
    /* What the states and controls are called; a state whose name begins with '-' is not drawn. */
    const char *states[MOST], *controls[2];
    swb_ocp *(*make)(struct sizes n);
};

static swb_ocp *sliding_mode(struct sizes n)
{
    const expr q1 = state(0), q2 = state(1), v1 = state(2), v2 = state(3), u1 = control(0), u2 = control(1);
    const expr c1 = add(q1, times(0.15, square(q2))), c2 = sub(q2, times(0.05, mul(square(q1), q1)));
    const expr rhs[] = {sub(v1, sign_of(c1)), sub(v2, sign_of(c2)), u1, u2}, position[] = {q1, q2};
    const double start[] = {2.0 * PI / 3.0, PI / 3.0, 0.0, 0.0}, goal[] = {-PI / 6.0, -PI / 4.0};
    const double most[] = {INFINITY, INFINITY, 2.0, 2.0}, least[] = {-INFINITY, -INFINITY, -2.0, -2.0};
    const double u_most[] = {10.0, 10.0}, u_least[] = {-10.0, -10.0};
    swb_ocp *ocp = problem_of(system_of(n, rhs), n, 4.0, 3, 4);
    TRY(swb_ocp_set_initial_state(ocp, start, 4));
    TRY(swb_ocp_set_control_bounds(ocp, u_least, 2, u_most, 2));
    TRY(swb_ocp_set_state_bounds(ocp, least, 4, most, 4));
    add_rate(ocp, n, add(add(square(u1), square(u2)), add(square(v1), square(v2))));
    add_goal(ocp, n, position, goal, 2);
    return ocp;
}

static swb_ocp *turbo_car(struct sizes n)
{
    const expr q = state(0), v = state(1), u = control(0);
    const expr rhs[] = {v, where(above(v, 15.0), times(3.0, u), u)}, x[] = {q, v};
    const double start[] = {0.0, 0.0}, goal[] = {200.0, 0.0}, u_most = 5.0, u_least = -5.0;
    const double most[] = {INFINITY, 25.0}, least[] = {-INFINITY, -25.0};
    swb_ocp *ocp = problem_of(system_of(n, rhs), n, 10.0, 2, 3);
    TRY(swb_ocp_set_initial_state(ocp, start, 2));
    TRY(swb_ocp_set_control_bounds(ocp, &u_least, 1, &u_most, 1));
    TRY(swb_ocp_set_state_bounds(ocp, least, 2, most, 2));
    add_rate(ocp, n, number(1.0));
    add_goal(ocp, n, x, goal, 2);
    TRY(swb_ocp_set_free_time(ocp, SWB_FREE_TIME_HORIZON, 1.0, 40.0));
    return ocp;
}

static swb_ocp *cart_pole(struct sizes n)
{
    const expr q = state(0), a = state(1), v = state(2), w = state(3), force = control(0);
    const expr push = sub(force, times(2.0, sign_of(v))), reach = add(number(1.0), times(0.1, square(sine(a))));
    const expr swing = times(0.1, sine(a));
    const expr cart = add(push, mul(swing, add(square(w), times(9.81, cosine(a)))));
    const expr pole = add(mul(cosine(a), add(push, mul(swing, square(w)))), times(1.1 * 9.81, sine(a)));
    const expr rhs[] = {v, w, quotient(cart, reach), quotient(sub(number(0.0), pole), reach)}, x[] = {q, a, v, w};
    const double start[] = {1.0, 0.0, 0.0, 0.0}, goal[] = {0.0, PI, 0.0, 0.0}, u_most = 30.0, u_least = -30.0;
    const double t[] = {0.0, 1.0, 4.0}, one = 1.0, zero = 0.0;
    /* the pole is up soon */
    const double guess[] = {1.0, 0.0, 0.0, 0.0, 0.0, PI, 0.0, 0.0, 0.0, PI, 0.0, 0.0};
    const double running[] = {1.0, 100.0, 1.0, 1.0}, terminal[] = {100.0, 100.0, 10.0, 10.0};
    swb_ocp *ocp = problem_of(system_of(n, rhs), n, 4.0, 5, 2);
    TRY(swb_ocp_set_initial_state(ocp, start, 4));
    TRY(swb_ocp_set_control_bounds(ocp, &u_least, 1, &u_most, 1));
    TRY(swb_ocp_set_state_guess(ocp, t, 3, guess, 12));
    add_squares(ocp, n, x, running, 4, goal, 4, SWB_COST_AT_RUNNING);
    add_squares(ocp, n, &force, &one, 1, &zero, 1, SWB_COST_AT_RUNNING);
    add_squares(ocp, n, x, terminal, 4, goal, 4, SWB_COST_AT_TERMINAL);
    return ocp;
}

static swb_ocp *motor(struct sizes n)
{
    const expr a = state(0), b = state(1), va = state(2), vb = state(3), i = state(4), voltage = control(0);
    const expr spring = add(times(8.0, sub(a, b)), times(0.2, sub(va, vb)));
    const expr rhs[] = {va, vb, sub(times(5.0, i), spring), sub(spring, times(0.8, sign_of(vb))),
                        times(10.0, sub(sub(voltage, va), times(0.5, i)))};
    const expr x[] = {a, b, va, vb, i};
    const double start[5] = {0.0}, goal[] = {1.0, 1.0, 0.0, 0.0, 0.0}, u_most = 4.0, u_least = -4.0;
    swb_ocp *ocp = problem_of(system_of(n, rhs), n, 3.0, 4, 3);
    TRY(swb_ocp_set_initial_state(ocp, start, 5));
    TRY(swb_ocp_set_control_bounds(ocp, &u_least, 1, &u_most, 1));
    add_rate(ocp, n, add(square(voltage), times(0.1, square(i))));
    add_goal(ocp, n, x, goal, 5);
    return ocp;
}

static swb_ocp *blocks(struct sizes n)
{
    const expr q1 = state(0), q2 = state(1), q3 = state(2), force = control(0);
    const expr springs[] = {sub(q2, times(2.0, q1)), add(sub(q1, times(2.0, q2)), q3), add(sub(q2, q3), force)};
    const double start[] = {-1.0, 1.0, -1.0, -1.0, 1.0, 1.0}, goal[] = {-1.0, 0.0, 1.0, 0.0, 0.0, 0.0};
    const double ones[] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0}, hundreds[] = {100.0, 100.0, 100.0, 100.0, 100.0, 100.0};
    const double u_most = 10.0, u_least = -10.0, zero = 0.0;
    expr rhs[6], x[6];
    swb_ocp *ocp;
    int k;
    for (k = 0; k < 3; k++) {
        const expr v = state(3 + k);
        x[k] = state(k);
        x[3 + k] = rhs[k] = v;
        rhs[3 + k] = sub(sub(springs[k], v), times(0.3, sign_of(v)));
    }
    ocp = problem_of(system_of(n, rhs), n, 5.0, 3, 4);
    TRY(swb_ocp_set_initial_state(ocp, start, 6));
    TRY(swb_ocp_set_control_bounds(ocp, &u_least, 1, &u_most, 1));
    add_squares(ocp, n, &force, ones, 1, &zero, 1, SWB_COST_AT_RUNNING);
    add_squares(ocp, n, x, ones, 6, goal, 6, SWB_COST_AT_RUNNING);
    add_squares(ocp, n, x, hundreds, 6, goal, 6, SWB_COST_AT_TERMINAL);
    return ocp;
}

static swb_ocp *tanks(struct sizes n)
{
    const expr upper = state(0), lower = state(1), inflow = control(0);
    const expr over = where(above(upper, 1.0), times(4.0, sub(upper, number(1.0))), number(0.0));
    const expr rhs[] = {sub(sub(inflow, over), times(0.1, upper)), sub(over, times(0.3, lower))};
    const double start[] = {0.2, 0.0}, u_most = 1.0, u_least = 0.0, ten = 10.0, level = 0.8, tenth = 0.1, zero = 0.0;
    swb_ocp *ocp = problem_of(system_of(n, rhs), n, 10.0, 4, 3);
    TRY(swb_ocp_set_initial_state(ocp, start, 2));
    TRY(swb_ocp_set_control_bounds(ocp, &u_least, 1, &u_most, 1));
    add_squares(ocp, n, &lower, &ten, 1, &level, 1, SWB_COST_AT_RUNNING);
    add_squares(ocp, n, &inflow, &tenth, 1, &zero, 1, SWB_COST_AT_RUNNING);
    return ocp;
}

static swb_ocp *friction(struct sizes n)
{
    const expr q = state(0), v = state(1), rhs[] = {v, times(-1.0, mul(parameter(0), sign_of(v)))};
    const double start[] = {0.0, 1.0}, first = 0.6, least = 0.05, most = 2.0, one = 1.0, mu = 0.37;
    double data[8], t;
    swb_ocp *ocp = problem_of(system_of(n, rhs), n, 4.0, 2, 2);
    int k;
    for (k = 0; k < 8; k++) {
        t = 4.0 * (k + 1) / 8.0;
        data[k] = t < 1.0 / mu ? t - 0.5 * mu * t * t : 0.5 / mu;
    }
    TRY(swb_ocp_set_initial_state(ocp, start, 2));
    TRY(swb_ocp_set_params(ocp, &first, 1));
    TRY(swb_ocp_set_param_bounds(ocp, &least, 1, &most, 1));
    add_squares(ocp, n, &q, &one, 1, data, 8, SWB_COST_AT_CONTROL_GRID);
    return ocp;
}

/* Where two switches are the same one, a period apart. */
static int again(const swb_run *run, const swb_event *a, const swb_event *b, int64_t nx)
{
    double t[2], x[2 * MOST], distance = 0.0;
    int64_t i;
    if (a->before != b->before || a->after != b->after || a->subsystem != b->subsystem)
        return 0;
    t[0] = a->t;
    t[1] = b->t;
    TRY(swb_run_evaluate(run, t, 2, 0, x, 2 * nx));
    for (i = 0; i < nx; i++)
        distance = hypot(distance, x[i] - x[nx + i]);
    return distance < 1e-6;
}

/* A limit cycle: a long simulation comes close to it; a problem with a free horizon and equal ends finds it. The problem
 * needs a condition that says where on the cycle to begin, and a cost that keeps it near what was seen, for an
 * equilibrium is periodic, too. With sign -1 the second half of the period is the negative of the first. */
static swb_ocp *cycle(struct sizes n, const expr *rhs, const double *start, double end, double sign, int64_t n_s, int64_t n_fe)
{
    enum { POINTS = 401 };
    struct sizes ends = {2 * n.x, 0, 0, n.n_stages};
    swb_system *system = system_of(n, rhs);
    swb_integrator *integrator;
    swb_run *run;
    swb_run_info info;
    swb_event *events;
    swb_function *f;
    swb_ocp *ocp;
    int32_t outcome;
    int64_t i, k, first, longest;
    double period, length, from, x0[MOST], velocity[MOST], zeros[MOST] = {0.0}, ones[MOST];
    double *t = allocate(POINTS, sizeof *t), *x = allocate(POINTS * n.x, sizeof *x);
    expr closed[MOST], phase = number(0.0), states[MOST];

    TRY(swb_integrator_create(system, NULL, &integrator));
    TRY(swb_integrator_set_int(integrator, "dense", 1));
    TRY(swb_integrator_set_double(integrator, "rtol", 1e-12));
    TRY(swb_integrator_set_double(integrator, "atol", 1e-13));
    TRY(swb_integrator_reinit(integrator, 0.0, start, n.x));
    TRY(swb_integrator_advance(integrator, end, &outcome));
    TRY(swb_integrator_get_run(integrator, &run));
    TRY(swb_run_get_info(run, &info, sizeof info));
    events = allocate(info.n_events, sizeof *events);
    TRY(swb_run_events(run, events, info.n_events, sizeof *events));
    k = info.n_events - 1;
    for (first = k - 1; first >= 0 && !again(run, &events[first], &events[k], n.x); first--)
        ;
    if (first < 0) {
        fprintf(stderr, "the simulation has found no cycle\n");
        exit(1);
    }
    period = events[k].t - events[first].t;
    length = sign < 0.0 ? 0.5 * period : period;
    /* begin away from switches: in the middle of the longest time without one */
    for (longest = first, i = first; i < k; i++)
        if (events[i + 1].t - events[i].t > events[longest + 1].t - events[longest].t)
            longest = i;
    from = 0.5 * (events[longest].t + events[longest + 1].t) - period;
    TRY(swb_run_evaluate(run, &from, 1, 0, x0, n.x));
    TRY(swb_run_evaluate(run, &from, 1, 1, velocity, n.x));

    ocp = problem_of(system, n, length, n_s, n_fe);
    TRY(swb_ocp_set_free_time(ocp, SWB_FREE_TIME_HORIZON, 0.8 * length, 1.25 * length));
    for (i = 0; i < n.x; i++) {
        states[i] = state(i);
        ones[i] = 1.0;
        closed[i] = sub(state(n.x + i), times(sign, state(i)));
        phase = add(phase, times(velocity[i], sub(state(i), number(x0[i]))));
    }
    f = outputs(ends, closed, n.x);
    TRY(swb_ocp_add_boundary(ocp, f, zeros, n.x, zeros, n.x));
    swb_function_free(f);
    f = outputs(ends, &phase, 1);
    TRY(swb_ocp_add_boundary(ocp, f, zeros, 1, zeros, 1));
    swb_function_free(f);
    for (i = 0; i < n.n_stages; i++)
        t[i] = from + length * (double)(i + 1) / (double)n.n_stages;
    TRY(swb_run_evaluate(run, t, n.n_stages, 0, x, n.n_stages * n.x));
    add_squares(ocp, n, states, ones, n.x, x, n.n_stages * n.x, SWB_COST_AT_CONTROL_GRID);
    for (i = 0; i < POINTS; i++)
        t[i] = from + length * (double)i / (POINTS - 1);
    TRY(swb_run_evaluate(run, t, POINTS, 0, x, POINTS * n.x));
    for (i = 0; i < POINTS; i++)
        t[i] -= from;
    TRY(swb_ocp_set_state_guess(ocp, t, POINTS, x, POINTS * n.x));
    free(t);
    free(x);
    free(events);
    swb_run_free(run);
    swb_integrator_free(integrator);
    return ocp;
}

static swb_ocp *relay_cycle(struct sizes n)
{
    const double omega = 10.0, zeta = 0.05, start[] = {0.0, -0.001, -0.02};
    const expr y = state(0), a = state(1), b = state(2), s = sign_of(y);
    const expr rhs[] = {sub(add(times(-(2.0 * zeta * omega + 1.0), y), a), s),
                        add(add(times(-(2.0 * zeta * omega + omega * omega), y), b), times(2.0, s)),
                        sub(times(-omega * omega, y), s)};
    return cycle(n, rhs, start, 60.0, -1.0, 6, 4);
}

/* Between a block of speed v and a belt of speed 0.2: it falls with the speed of slip. */
static expr belt(expr v, double strength)
{
    return where(above(v, 0.2), quotient(number(-strength), add(number(0.8), v)),
                 quotient(number(strength), sub(number(1.2), v)));
}

static swb_ocp *stick_slip(struct sizes n)
{
    const expr q = state(0), v = state(1), rhs[] = {v, sub(belt(v, 1.0), q)};
    const double start[] = {-0.8, -1.0};
    return cycle(n, rhs, start, 60.0, 1.0, 6, 3);
}

static swb_ocp *stick_slip_2(struct sizes n)
{
    const expr q1 = state(0), q2 = state(1), v1 = state(2), v2 = state(3), spring = times(0.2, sub(q2, q1));
    const expr rhs[] = {v1, v2, add(sub(spring, q1), belt(v1, 1.0)), sub(belt(v2, 1.3), add(spring, q2))};
    const double start[] = {0.5, 0.3, 0.2, 0.2};
    return cycle(n, rhs, start, 400.0, 1.0, 6, 2);
}

static swb_ocp *two_genes(struct sizes n)
{
    const expr a = state(0), b = state(1), inducer = control(0), x[] = {a, b};
    /* one by one: in which order arguments are evaluated is up to the compiler, and the order of switching functions is that of the model */
    const expr much_a = above(a, 4.0), little_b = below(b, 8.0), make_a = times(40.0, on(both(much_a, little_b)));
    const expr little_a = below(a, 8.0), much_b = above(b, 4.0), make_b = times(40.0, on(both(little_a, much_b)));
    const expr rhs[] = {add(sub(make_a, times(4.5, a)), inducer), sub(make_b, times(1.5, b))};
    const double start[] = {5.0, 5.0}, u_most = 40.0, u_least = 0.0, small = 0.001, zero = 0.0;
    const double ones[] = {1.0, 1.0}, goal[] = {8.5, 0.0};
    swb_ocp *ocp = problem_of(system_of(n, rhs), n, 0.5, 4, 2);
    /* distances to thresholds are of the size 10, and so are their products with weights at the start */
    TRY(swb_ocp_set_double(ocp, "sigma_init", 10.0));
    TRY(swb_ocp_set_initial_state(ocp, start, 2));
    TRY(swb_ocp_set_control_bounds(ocp, &u_least, 1, &u_most, 1));
    add_squares(ocp, n, &inducer, &small, 1, &zero, 1, SWB_COST_AT_RUNNING);
    add_squares(ocp, n, x, ones, 2, goal, 2, SWB_COST_AT_RUNNING);
    return ocp;
}

static swb_ocp *irma(struct sizes n)
{
    const expr cbf1 = state(0), gal4 = state(1), swi5 = state(2), gal80 = state(3), ash1 = state(4), inducer = control(0);
    const expr unless = sub(number(1.0), on(above(swi5, 3.5)));
    const expr rhs[] = {
        sub(add(add(number(0.011), times(0.09, on(above(gal80, 4.0)))), inducer), times(0.05, cbf1)),
        sub(add(number(0.03), times(15.0, on(above(cbf1, 1.0)))), times(0.04, gal4)),
        sub(add(number(0.06), times(1.8, on(above(gal4, 6.0)))), times(0.05, swi5)),
        sub(mul(on(above(gal4, 1.0)), add(number(0.05), times(3.0, unless))), times(0.02, gal80)),
        sub(add(number(0.075), times(1.5, on(above(gal4, 8.0)))), times(0.6, ash1)),
    };
    const double start[] = {1.1, 9.0, 4.0, 5.0, 1.5}, u_most = 0.1, u_least = 0.0;
    const double effort = 1000.0, zero = 0.0, one = 1.0, level = 20.0;
    swb_ocp *ocp = problem_of(system_of(n, rhs), n, 160.0, 4, 2);
    TRY(swb_ocp_set_double(ocp, "sigma_init", 10.0));
    TRY(swb_ocp_set_string(ocp, "dcs_form", "heaviside"));
    TRY(swb_ocp_set_initial_state(ocp, start, 5));
    TRY(swb_ocp_set_control_bounds(ocp, &u_least, 1, &u_most, 1));
    add_squares(ocp, n, &inducer, &effort, 1, &zero, 1, SWB_COST_AT_RUNNING);
    add_squares(ocp, n, &swi5, &one, 1, &level, 1, SWB_COST_AT_TERMINAL);
    return ocp;
}

static const struct problem PROBLEMS[] = {
    {"sliding-mode", "two curves catch the state one after the other, and let it go again", {4, 2, 0, 6},
     {"q1", "q2", "v1", "v2"}, {"u1", "u2"}, sliding_mode},
    {"turbo-car", "the car gets over 15 m/s as soon as it can, where the turbo helps, and brakes late", {2, 1, 0, 10},
     {"-position", "speed in m/s"}, {"acceleration"}, turbo_car},
    {"cart-pole", "the cart swings the pole up against its dry friction", {4, 1, 0, 40},
     {"position in m", "angle in rad", "speed in m/s", "turn in rad/s"}, {"force in N"}, cart_pole},
    {"motor", "friction holds the load until the spring is wound up", {5, 1, 0, 12},
     {"motor in rad", "load in rad", "motor in rad/s", "load in rad/s", "current in A"}, {"voltage in V"}, motor},
    {"blocks", "the force on the last block drags the others along, one after the other", {6, 1, 0, 10},
     {"position 1", "position 2", "position 3", "speed 1", "speed 2", "speed 3"}, {"force on 3"}, blocks},
    {"tanks", "the upper tank is filled past its brim: the only way to the lower one", {2, 1, 0, 10},
     {"upper level", "lower level"}, {"inflow"}, tanks},
    {"friction", "the friction coefficient is found from eight measurements", {2, 0, 1, 8},
     {"position", "speed"}, {NULL}, friction},
    {"relay-cycle", "half a limit cycle of a relay feedback; twice it slides along y = 0", {3, 0, 0, 8},
     {"y", "a", "b"}, {NULL}, relay_cycle},
    {"stick-slip", "a limit cycle: the block sticks to the belt until the spring tears it off", {2, 0, 0, 6},
     {"position", "speed"}, {NULL}, stick_slip},
    {"stick-slip-2", "a limit cycle: between the slips of one block and of the other both stick", {4, 0, 0, 10},
     {"position 1", "position 2", "speed 1", "speed 2"}, {NULL}, stick_slip_2},
    {"two-genes", "a pulse of the inducer lets gene a win the race: at 8 it shuts the other one off", {2, 1, 0, 10},
     {"gene a", "gene b"}, {"inducer"}, two_genes},
    {"irma", "a little inducer keeps CBF1 above its threshold longer, so SWI5 falls later", {5, 1, 0, 8},
     {"CBF1", "-GAL4", "SWI5", "GAL80", "ASH1"}, {"inducer"}, irma},
};

static FILE *open_in(const char *folder, const char *name)
{
    char path[512];
    FILE *file;
    mkdir(folder, 0777);
    snprintf(path, sizeof path, "%s/c_gallery%s%s.csv", folder, *name ? "_" : "", name);
    file = fopen(path, "w");
    if (!file) {
        perror(path);
        exit(1);
    }
    return file;
}

/* Smallest and largest of some columns of a table, with a margin. */
static void range(const double *x, int64_t n, int64_t stride, const char *const *names, double *low, double *high)
{
    int64_t i, j;
    *low = INFINITY;
    *high = -INFINITY;
    for (j = 0; j < stride; j++)
        for (i = 0; i < n && names[j][0] != '-'; i++) {
            *low = fmin(*low, x[i * stride + j]);
            *high = fmax(*high, x[i * stride + j]);
        }
    *low -= 0.05 * (*high - *low) + 1e-9;
    *high += 0.05 * (*high - *low) + 1e-9;
}

static void draw(const char *folder, const struct problem *p, const swb_trajectory *r, const double *u, const double *lengths)
{
    enum { POINTS = 301 };
    const int64_t nx = p->n.x, nu = p->n.u;
    double t[POINTS], *x = allocate(POINTS * nx, sizeof *x), *grid = allocate(p->n.n_stages + 1, sizeof *grid), low, high;
    swb_trajectory_info info;
    char name[128];
    struct plot plot;
    FILE *table = open_in(folder, p->name);
    int64_t i, j;

    TRY(swb_trajectory_get_info(r, &info, sizeof info));
    for (i = 0; i < POINTS; i++)
        t[i] = info.t_start + (info.t_end - info.t_start) * (double)i / (POINTS - 1);
    TRY(swb_trajectory_state_at(r, t, POINTS, x, POINTS * nx));
    fprintf(table, "time");
    for (j = 0; j < nx; j++)
        fprintf(table, ",%s", p->states[j] + (p->states[j][0] == '-'));
    for (i = 0; i < POINTS; i++) {
        fprintf(table, "\n%.17g", t[i]);
        for (j = 0; j < nx; j++)
            fprintf(table, ",%.17g", x[i * nx + j]);
    }
    fprintf(table, "\n");
    fclose(table);

    range(x, POINTS, nx, p->states, &low, &high);
    snprintf(name, sizeof name, "c_gallery_%s.svg", p->name);
    plot = plot_open(folder, name, p->see, "time", t[0], t[POINTS - 1], low, high);
    for (j = 0; j < nx; j++)
        if (p->states[j][0] != '-')
            plot_line(&plot, p->states[j], t, 1, x + j, (int)nx, POINTS);
    plot_close(&plot);
    if (nu > 0) {
        grid[0] = t[0];
        for (i = 0; i < p->n.n_stages; i++)
            grid[i + 1] = grid[i] + lengths[i];
        range(u, p->n.n_stages, nu, p->controls, &low, &high);
        snprintf(name, sizeof name, "c_gallery_%s_controls.svg", p->name);
        plot = plot_open(folder, name, p->name, "time", t[0], t[POINTS - 1], low, high);
        for (j = 0; j < nu; j++)
            plot_steps(&plot, p->controls[j], grid, u + j, (int)nu, p->n.n_stages);
        plot_close(&plot);
    }
    free(x);
    free(grid);
}

/* Solves, prints and draws; true if it is solved. */
static int run(const char *folder, const struct problem *p, FILE *table)
{
    swb_ocp *ocp;
    swb_trajectory *r;
    swb_stats stats;
    swb_residuals residuals;
    swb_accuracy accuracy;
    int32_t outcome;
    int64_t i;
    double cost, horizon = 0.0;
    double *u = allocate(p->n.n_stages * p->n.u, sizeof *u), *lengths = allocate(p->n.n_stages, sizeof *lengths);

    TRY(swb_expr_create(&graph));
    ocp = p->make(p->n);
    swb_expr_free(graph);
    TRY(swb_ocp_solve(ocp, &outcome));
    TRY(swb_ocp_get_cost(ocp, &cost));
    TRY(swb_ocp_get_stats(ocp, &stats, sizeof stats));
    TRY(swb_ocp_get_residuals(ocp, &residuals, sizeof residuals));
    TRY(swb_ocp_get_accuracy(ocp, &accuracy, sizeof accuracy));
    TRY(swb_ocp_get_controls(ocp, u, p->n.n_stages * p->n.u));
    TRY(swb_ocp_get_durations(ocp, lengths, p->n.n_stages));
    TRY(swb_ocp_get_trajectory(ocp, &r));
    for (i = 0; i < p->n.n_stages; i++)
        horizon += lengths[i];
    printf("%-13s %-8s %13.8f  %12.9f  %7.1e  %7.1e  %5d  %7.1f\n", p->name, swb_outcome_name(outcome), cost, horizon,
           residuals.primal, accuracy.terminal, (int)stats.iterations, 1e3 * stats.time_total);
    printf("    %s\n", p->see);
    fprintf(table, "%s,%s,%.17g,%.17g,%.17g\n", p->name, swb_outcome_name(outcome), cost, horizon, accuracy.terminal);
    draw(folder, p, r, u, lengths);
    swb_trajectory_free(r);
    swb_ocp_free(ocp);
    free(u);
    free(lengths);
    return outcome == SWB_OUTCOME_SOLVED;
}

/* gallery [FOLDER [PROBLEM]] */
int main(int argc, char **argv)
{
    const char *folder = argc > 1 ? argv[1] : "out";
    int failed = 0;
    size_t k;
    FILE *table = open_in(folder, "");
    fprintf(table, "problem,outcome,cost,horizon,error\n");
    printf("problem       outcome           cost       horizon   primal     E(T)     it       ms\n");
    for (k = 0; k < sizeof PROBLEMS / sizeof PROBLEMS[0]; k++)
        if (argc < 3 || strcmp(argv[2], PROBLEMS[k].name) == 0)
            failed += !run(folder, &PROBLEMS[k], table);
    fclose(table);
    printf("tables and plots: %s/c_gallery*\n", folder);
    return failed;
}
