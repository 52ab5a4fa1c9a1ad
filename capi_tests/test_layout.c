/* Layout and numbers of the ABI. Lines are added at the end of each group; a change of a line is a break. */
#include <stddef.h>

#include "check.h"

#define FIELD(position, name) CHECK(offsetof(swb_settings, name) == 8 * (position))

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
    CHECK(sizeof(swb_settings) == (size_t)8 * 25);

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
    CHECK(SWB_KIND_INT == 0 && SWB_KIND_FLOAT == 1 && SWB_KIND_ENUM == 2);
    return CHECK_DONE();
}
