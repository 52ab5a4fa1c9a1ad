#include <stdio.h>
#include <switchback.h>

/* A ball falls from a height of 1 on a floor, bounces with restitution 0.8, and comes to rest. */
int main(void)
{
    const double numbers[2] = {-9.81, 0.8}, start[2] = {1.0, 0.0}; /* gravity, restitution; height, velocity */
    int64_t height, id[2];
    double x[2];
    int32_t outcome;
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;
    swb_run *run = NULL;
    swb_run_info info;

    if (swb_expr_create(&graph) || swb_expr_inputs(graph, SWB_INPUT_X, 0, &height, 1) ||
        swb_expr_constants(graph, numbers, 2, id, 2) || swb_scene_create("ball", 1, 1, 0, 0, NULL, &scene) ||
        swb_scene_set_force(scene, graph, &id[0], 1) ||
        swb_scene_add_contact(scene, graph, "floor", height, NULL, 0, -1, id[1], NULL) || swb_scene_build(scene, graph) ||
        swb_scene_system(scene, &system) || swb_integrator_create(system, NULL, &integrator) ||
        swb_integrator_reinit(integrator, 0.0, start, 2) || swb_integrator_advance(integrator, 6.0, &outcome) ||
        swb_integrator_get_state(integrator, x, 2) || swb_integrator_get_run(integrator, &run) ||
        swb_run_get_info(run, &info, sizeof info)) {
        fprintf(stderr, "%s\n", swb_last_error());
        return 1;
    }
    printf("%d impacts, then at rest: height %g, velocity %g\n", (int)info.n_impacts, x[0], x[1]);
    swb_run_free(run);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(graph);
    return outcome != SWB_RUN_OUTCOME_REACHED;
}
