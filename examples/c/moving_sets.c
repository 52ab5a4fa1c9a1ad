/* Optimal control of projected systems and sweeping processes: bodies without inertia that push each other, and a vehicle
 * in a frame that moves. Nothing is said of when constraints act. The problems are those of
 * examples/python/moving_sets.py, with the same costs.
 *
 * Writes a table (c_moving_sets.csv), and of every problem the states (c_moving_sets_NAME.svg): dashed lines are times at
 * which a constraint begins or ends to act. */
#include "expressions.h"

enum { MOST = 6, POINTS = 301 };

struct problem {
    const char *name, *see;
    struct sizes n;
    double horizon;
    const char *states[MOST];
    swb_ocp *(*make)(const struct problem *p);
};

/* A problem with the velocities f of the states where nothing holds them, and constraints c >= 0. */
static swb_ocp *projected(const struct problem *p, const expr *f, const char *const *names, const expr *c, int64_t n_c)
{
    swb_scene *scene;
    swb_system *system;
    swb_ocp *ocp;
    int64_t i;
    TRY(swb_scene_create_projected(p->name, p->n.x, p->n.u, 0, NULL, &scene));
    TRY(swb_scene_set_force(scene, graph, f, p->n.x));
    for (i = 0; i < n_c; i++)
        TRY(swb_scene_add_contact(scene, graph, names[i], c[i], NULL, 0, -1, -1, NULL));
    TRY(swb_scene_build(scene, graph));
    TRY(swb_scene_system(scene, &system));
    swb_scene_free(scene);
    TRY(swb_ocp_create(system, p->horizon, p->n.n_stages, NULL, &ocp));
    swb_system_free(system);
    return ocp;
}

static void bound_controls(swb_ocp *ocp, double most)
{
    const double low[] = {-most, -most}, high[] = {most, most};
    TRY(swb_ocp_set_control_bounds(ocp, low, 2, high, 2));
}

/* A disc with a control pushes two others, which nothing else moves, to the right. All have the radius 1/2. */
static swb_ocp *discs(const struct problem *p)
{
    const expr none = number(0.0), f[] = {control(0), control(1), none, none, none, none}, x[] = {state(2), state(4)};
    const char *const names[] = {"0-1", "0-2", "1-2"};
    const double start[] = {-1.5, 0.05, 0.0, 0.4, 0.4, -0.9}, goal[] = {1.2, 1.4};
    expr apart[3];
    swb_ocp *ocp;
    int i, j, k = 0;
    for (i = 1; i < 3; i++)
        for (j = 0; j < i; j++) {
            const expr dx = sub(state(2 * i), state(2 * j)), dy = sub(state(2 * i + 1), state(2 * j + 1));
            apart[k++] = times(0.5, sub(add(square(dx), square(dy)), number(1.0)));
        }
    ocp = projected(p, f, names, apart, 3);
    TRY(swb_ocp_set_initial_state(ocp, start, 6));
    bound_controls(ocp, 2.0);
    add_rate(ocp, p->n, add(square(control(0)), square(control(1))));
    add_goal(ocp, p->n, x, goal, 2);
    return ocp;
}

/* A gate that hangs at the origin and is pushed open by a body of the radius 0.1; it falls back by itself, slowly, and has a
 * stop. */
static swb_ocp *gate(const struct problem *p)
{
    const expr x = state(0), y = state(1), a = state(2), f[] = {control(0), control(1), times(-0.4, a)};
    const expr leaf = sub(sub(mul(y, sine(a)), mul(x, cosine(a))), number(0.1)), stop = add(a, number(0.02));
    const expr held[] = {leaf, stop};
    const char *const names[] = {"leaf", "stop"};
    const double start[] = {-1.0, 0.8, 0.0}, least = 0.9, most = INFINITY;
    swb_ocp *ocp = projected(p, f, names, held, 2);
    swb_function *end = outputs(p->n, &a, 1);
    TRY(swb_ocp_set_initial_state(ocp, start, 3));
    bound_controls(ocp, 2.0);
    add_rate(ocp, p->n, add(square(control(0)), square(control(1))));
    TRY(swb_ocp_add_terminal(ocp, end, &least, 1, &most, 1));
    swb_function_free(end);
    return ocp;
}

/* A vehicle with little power in a frame that swings and turns: it is carried along, and has to be at a place in the end. */
static swb_ocp *vehicle(const struct problem *p)
{
    const expr x = state(0), y = state(1), t = input(SWB_INPUT_T, 0), f[] = {control(0), control(1)}, place[] = {x, y};
    const expr right = sub(x, times(0.9, sine(times(1.3, t)))), c = cosine(times(0.4, t)), s = sine(times(0.4, t));
    const expr along = add(mul(right, c), mul(y, s)), across = sub(mul(y, c), mul(right, s));
    const expr inside[] = {sub(number(0.5), along), add(number(0.5), along), sub(number(0.3), across),
                           add(number(0.3), across)};
    const char *const names[] = {"right", "left", "top", "bottom"};
    const double start[] = {0.0, 0.0}, goal[] = {-0.55, 0.3};
    swb_ocp *ocp = projected(p, f, names, inside, 4);
    TRY(swb_ocp_set_initial_state(ocp, start, 2));
    bound_controls(ocp, 0.3);
    add_rate(ocp, p->n, add(square(control(0)), square(control(1))));
    add_goal(ocp, p->n, place, goal, 2);
    return ocp;
}

static const struct problem PROBLEMS[] = {
    {"discs", "one disc pushes two others: contacts come and go", {6, 2, 0, 20}, 5.0,
     {"x0", "y0", "x1", "y1", "x2", "y2"}, discs},
    {"gate", "the gate is pushed as far as it must be open in the end", {3, 2, 0, 15}, 3.0, {"x", "y", "angle"}, gate},
    {"vehicle", "the frame carries the vehicle along", {2, 2, 0, 20}, 4.0, {"x", "y"}, vehicle},
};

static void draw(const char *folder, const struct problem *p, const swb_trajectory *r)
{
    const int64_t nx = p->n.x;
    double t[POINTS], *x = allocate(POINTS * nx, sizeof *x), low = INFINITY, high = -INFINITY;
    swb_trajectory_info info;
    swb_switch *switches;
    char name[128];
    struct plot plot;
    int64_t i, j;

    TRY(swb_trajectory_get_info(r, &info, sizeof info));
    switches = allocate(info.n_switches, sizeof *switches);
    TRY(swb_trajectory_switches(r, switches, info.n_switches, sizeof *switches));
    for (i = 0; i < POINTS; i++)
        t[i] = info.t_start + (info.t_end - info.t_start) * (double)i / (POINTS - 1);
    TRY(swb_trajectory_state_at(r, t, POINTS, x, POINTS * nx));
    for (i = 0; i < POINTS * nx; i++) {
        low = fmin(low, x[i]);
        high = fmax(high, x[i]);
    }
    snprintf(name, sizeof name, "c_moving_sets_%s.svg", p->name);
    plot = plot_open(folder, name, p->see, "time", t[0], t[POINTS - 1], low - 0.05 * (high - low), high + 0.05 * (high - low));
    for (i = 0; i < info.n_switches; i++)
        plot_mark(&plot, switches[i].t);
    for (j = 0; j < nx; j++)
        plot_line(&plot, p->states[j], t, 1, x + j, (int)nx, POINTS);
    plot_close(&plot);
    free(switches);
    free(x);
}

/* Solves, prints and draws; true if it is solved and certified. */
static int run(const char *folder, const struct problem *p, FILE *table)
{
    swb_ocp *ocp;
    swb_trajectory *r;
    swb_trajectory_info info;
    swb_stats stats;
    swb_accuracy accuracy;
    swb_optimality optimality;
    int32_t outcome;
    double cost;

    TRY(swb_expr_create(&graph));
    ocp = p->make(p);
    swb_expr_free(graph);
    TRY(swb_ocp_solve(ocp, &outcome));
    TRY(swb_ocp_get_cost(ocp, &cost));
    TRY(swb_ocp_get_stats(ocp, &stats, sizeof stats));
    TRY(swb_ocp_get_accuracy(ocp, &accuracy, sizeof accuracy));
    TRY(swb_ocp_get_optimality(ocp, &optimality, sizeof optimality));
    TRY(swb_ocp_get_trajectory(ocp, &r));
    TRY(swb_trajectory_get_info(r, &info, sizeof info));
    printf("%-8s %-8s %13.9f  %-14s %7.1e  %8d  %5d  %7.1f\n", p->name, swb_outcome_name(outcome), cost,
           optimality.verdict == SWB_VERDICT_LOCAL_OPTIMUM ? "local optimum" : "not certified", accuracy.terminal,
           (int)info.n_switches, (int)stats.iterations, 1e3 * stats.time_total);
    fprintf(table, "%s,%s,%.17g,%d,%.17g,%d\n", p->name, swb_outcome_name(outcome), cost, (int)optimality.verdict,
            accuracy.terminal, (int)info.n_switches);
    draw(folder, p, r);
    swb_trajectory_free(r);
    swb_ocp_free(ocp);
    return outcome == SWB_OUTCOME_SOLVED && optimality.verdict == SWB_VERDICT_LOCAL_OPTIMUM;
}

/* moving_sets [FOLDER] */
int main(int argc, char **argv)
{
    const char *folder = argc > 1 ? argv[1] : "out";
    char path[512];
    int failed = 0;
    size_t k;
    FILE *table;
    mkdir(folder, 0777);
    snprintf(path, sizeof path, "%s/c_moving_sets.csv", folder);
    table = fopen(path, "w");
    if (!table) {
        perror(path);
        return 1;
    }
    fprintf(table, "problem,outcome,cost,verdict,error,switches\n");
    printf("problem  outcome           cost  verdict           E(T)  switches    it       ms\n");
    for (k = 0; k < sizeof PROBLEMS / sizeof PROBLEMS[0]; k++)
        failed += !run(folder, &PROBLEMS[k], table);
    fclose(table);
    printf("table and plots: %s/c_moving_sets*\n", folder);
    return failed;
}
