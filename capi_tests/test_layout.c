/* Layout and numbers of the ABI. Lines are added at the end of each group; a change of a line is a break. */
#include <stddef.h>

#include "check.h"

#define FIELD(position, name) AT(swb_settings, position, name)
#define AT(type, position, name) CHECK(offsetof(type, name) == (size_t)8 * (position))

int main(void)
{
    FIELD(0, struct_size);
    FIELD(1, rk_family);
    FIELD(2, n_s);
    FIELD(3, n_fe);
    FIELD(4, discretisation);
    FIELD(5, stage_form);
    FIELD(6, cross);
    FIELD(7, step_equilibration);
    FIELD(8, rho_h);
    FIELD(9, gamma_h);
    FIELD(10, tol);
    FIELD(11, max_iter);
    FIELD(12, max_time);
    FIELD(13, mu_init);
    FIELD(14, sigma_init);
    FIELD(15, sigma_min);
    FIELD(16, sigma_factor);
    FIELD(17, sigma_exponent);
    FIELD(18, mu_over_sigma);
    FIELD(19, plateau_mu);
    FIELD(20, plateau_viol);
    FIELD(21, polish);
    FIELD(22, polish_tol);
    FIELD(23, initial_guess);
    FIELD(24, log_level);
    FIELD(25, linear_solver);
    FIELD(26, ordering);
    CHECK(sizeof(swb_settings) == (size_t)8 * 27);

    CHECK(sizeof(swb_status) == 4);
    CHECK(SWB_OK == 0 && SWB_ERR_NULL == -1 && SWB_ERR_DIMENSION == -2 && SWB_ERR_RANGE == -3);
    CHECK(SWB_ERR_STATE == -4 && SWB_ERR_UNSUPPORTED == -5 && SWB_ERR_OPTION == -6);
    CHECK(SWB_ERR_USER == -20 && SWB_ERR_NONFINITE == -21 && SWB_ERR_INTERRUPTED == -23);
    CHECK(SWB_ERR_NUMERIC == -30 && SWB_ERR_LIBRARY == -50 && SWB_ERR_INTERNAL == -99);

    CHECK(SWB_RK_FAMILY_RADAU_IIA == 0 && SWB_RK_FAMILY_GAUSS_LEGENDRE == 1 && SWB_RK_FAMILY_EXPLICIT == 2);
    CHECK(SWB_DISCRETISATION_FESD == 0 && SWB_DISCRETISATION_STANDARD == 1);
    CHECK(SWB_STAGE_FORM_AUTO == 0 && SWB_STAGE_FORM_VALUES == 1 && SWB_STAGE_FORM_DERIVATIVES == 2);
    CHECK(SWB_CROSS_ELEMENT == 0 && SWB_CROSS_STAGE == 1 && SWB_CROSS_FULL == 2);
    CHECK(SWB_STEP_EQUILIBRATION_NONE == 0 && SWB_STEP_EQUILIBRATION_MEAN == 1);
    CHECK(SWB_STEP_EQUILIBRATION_DIFFERENCE == 2 && SWB_STEP_EQUILIBRATION_ETA_PRODUCT == 3);
    CHECK(SWB_POLISH_OFF == 0 && SWB_POLISH_ON == 1);
    CHECK(SWB_INITIAL_GUESS_CONSTANT == 0 && SWB_INITIAL_GUESS_SIMULATION == 1);
    CHECK(SWB_LOG_LEVEL_SILENT == 0 && SWB_LOG_LEVEL_ERROR == 1 && SWB_LOG_LEVEL_WARNING == 2);
    CHECK(SWB_LOG_LEVEL_INFO == 3 && SWB_LOG_LEVEL_DEBUG == 4 && SWB_LOG_LEVEL_TRACE == 5);
    CHECK(SWB_LINEAR_SOLVER_AUTO == 0 && SWB_LINEAR_SOLVER_SUITESPARSE == 1 && SWB_LINEAR_SOLVER_FAER == 2);
    CHECK(SWB_ORDERING_AMD == 0 && SWB_ORDERING_NATURAL == 1);
    CHECK(SWB_KIND_INT == 0 && SWB_KIND_FLOAT == 1 && SWB_KIND_ENUM == 2);

    AT(swb_residuals, 0, struct_size);
    AT(swb_residuals, 1, primal);
    AT(swb_residuals, 2, dual);
    AT(swb_residuals, 3, complementarity);
    AT(swb_residuals, 4, pair_product);
    AT(swb_residuals, 5, pair_min);
    CHECK(sizeof(swb_residuals) == (size_t)8 * 6);
    AT(swb_stats, 0, struct_size);
    AT(swb_stats, 1, iterations);
    AT(swb_stats, 2, factorisations);
    AT(swb_stats, 3, evaluations);
    AT(swb_stats, 4, restoration_iterations);
    AT(swb_stats, 5, polish_iterations);
    AT(swb_stats, 6, max_delta_w);
    AT(swb_stats, 7, time_eval);
    AT(swb_stats, 8, time_linalg);
    AT(swb_stats, 9, time_total);
    AT(swb_stats, 10, time_build);
    AT(swb_stats, 11, n_variables);
    AT(swb_stats, 12, n_constraints);
    AT(swb_stats, 13, n_pairs);
    AT(swb_stats, 14, n_steps);
    AT(swb_stats, 15, n_homotopies);
    CHECK(sizeof(swb_stats) == (size_t)8 * 16);
    AT(swb_iteration_info, 0, struct_size);
    AT(swb_iteration_info, 1, iter);
    AT(swb_iteration_info, 2, objective);
    AT(swb_iteration_info, 3, inf_pr);
    AT(swb_iteration_info, 4, inf_du);
    AT(swb_iteration_info, 5, mu);
    AT(swb_iteration_info, 6, sigma);
    AT(swb_iteration_info, 7, inf_cc);
    AT(swb_iteration_info, 8, step);
    AT(swb_iteration_info, 9, delta_w);
    AT(swb_iteration_info, 10, alpha_du);
    AT(swb_iteration_info, 11, alpha_pr);
    AT(swb_iteration_info, 12, trials);
    AT(swb_iteration_info, 13, phase);
    CHECK(sizeof(swb_iteration_info) == (size_t)8 * 14);
    AT(swb_trajectory_info, 0, struct_size);
    AT(swb_trajectory_info, 1, nx);
    AT(swb_trajectory_info, 2, n_elements);
    AT(swb_trajectory_info, 3, n_s);
    AT(swb_trajectory_info, 4, n_subsystems);
    AT(swb_trajectory_info, 5, n_modes);
    AT(swb_trajectory_info, 6, n_switches);
    AT(swb_trajectory_info, 7, t_start);
    AT(swb_trajectory_info, 8, t_end);
    CHECK(sizeof(swb_trajectory_info) == (size_t)8 * 9);
    AT(swb_switch, 0, struct_size);
    AT(swb_switch, 1, t);
    AT(swb_switch, 2, element);
    AT(swb_switch, 3, subsystem);
    AT(swb_switch, 4, kind);
    AT(swb_switch, 5, before);
    AT(swb_switch, 6, after);
    CHECK(sizeof(swb_switch) == (size_t)8 * 7);
    AT(swb_point, 0, t);
    AT(swb_point, 1, x);
    AT(swb_point, 2, u);
    AT(swb_point, 3, p);
    CHECK(sizeof(swb_point) == (size_t)8 * 4);

    CHECK(SWB_OUTCOME_SOLVED == 0);
    CHECK(SWB_OUTCOME_MAX_ITER == 1);
    CHECK(SWB_OUTCOME_MAX_TIME == 2);
    CHECK(SWB_OUTCOME_STOPPED == 3);
    CHECK(SWB_OUTCOME_INFEASIBLE == 4);
    CHECK(SWB_OUTCOME_STALLED == 5);
    CHECK(SWB_OUTCOME_DIVERGING == 6);
    CHECK(SWB_OUTCOME_FAILED == 7);
    CHECK(SWB_POLISHED_NONE == 0);
    CHECK(SWB_POLISHED_DONE == 1);
    CHECK(SWB_POLISHED_REJECTED == 2);
    CHECK(SWB_INPUT_X == 1);
    CHECK(SWB_INPUT_U == 2);
    CHECK(SWB_INPUT_P == 4);
    CHECK(SWB_INPUT_T == 8);
    CHECK(SWB_SWITCH_KIND_CROSS == 0);
    CHECK(SWB_SWITCH_KIND_ENTER == 1);
    CHECK(SWB_SWITCH_KIND_LEAVE == 2);
    CHECK(SWB_PATH_AT_CONTROL_GRID == 0);
    CHECK(SWB_PATH_AT_ELEMENTS == 1);
    CHECK(SWB_PATH_AT_STAGE_POINTS == 2);
    CHECK(SWB_MEMBER_VARIABLE == 0);
    CHECK(SWB_MEMBER_CONSTRAINT == 1);
    return CHECK_DONE();
}
