/* Expressions of one graph with short names, and problems made of them. */
#ifndef EXPRESSIONS_H
#define EXPRESSIONS_H

#include "example.h"

/* The graph that all expressions of the program belong to, and the number of an expression in it. */
static swb_expr *graph;
typedef int64_t expr;

static inline expr number(double value)
{
    expr out;
    TRY(swb_expr_constants(graph, &value, 1, &out, 1));
    return out;
}

static inline expr input(int32_t block, int64_t index)
{
    expr out;
    TRY(swb_expr_inputs(graph, block, index, &out, 1));
    return out;
}

static inline expr unary(int32_t op, expr a)
{
    expr out;
    TRY(swb_expr_apply(graph, op, &a, NULL, NULL, &out, 1));
    return out;
}

static inline expr binary(int32_t op, expr a, expr b)
{
    expr out;
    TRY(swb_expr_apply(graph, op, &a, &b, NULL, &out, 1));
    return out;
}

static inline expr where(expr condition, expr yes, expr no)
{
    expr out;
    TRY(swb_expr_apply(graph, SWB_OPERATOR_WHERE, &condition, &yes, &no, &out, 1));
    return out;
}

static inline expr state(int64_t i) { return input(SWB_INPUT_X, i); }
static inline expr control(int64_t i) { return input(SWB_INPUT_U, i); }
static inline expr parameter(int64_t i) { return input(SWB_INPUT_P, i); }
static inline expr add(expr a, expr b) { return binary(SWB_OPERATOR_ADD, a, b); }
static inline expr sub(expr a, expr b) { return binary(SWB_OPERATOR_SUB, a, b); }
static inline expr mul(expr a, expr b) { return binary(SWB_OPERATOR_MUL, a, b); }
static inline expr quotient(expr a, expr b) { return binary(SWB_OPERATOR_DIV, a, b); }
static inline expr times(double factor, expr a) { return mul(number(factor), a); }
static inline expr square(expr a) { return mul(a, a); }
static inline expr sine(expr a) { return unary(SWB_OPERATOR_SIN, a); }
static inline expr cosine(expr a) { return unary(SWB_OPERATOR_COS, a); }
static inline expr sign_of(expr a) { return unary(SWB_OPERATOR_SIGN, a); }

/* The condition a > 0, and conditions joined. */
static inline expr positive(expr a) { return unary(SWB_OPERATOR_POSITIVE, a); }
static inline expr both(expr a, expr b) { return binary(SWB_OPERATOR_AND, a, b); }
static inline expr above(expr a, double threshold) { return positive(sub(a, number(threshold))); }
static inline expr below(expr a, double threshold) { return positive(sub(number(threshold), a)); }
static inline expr on(expr condition) { return where(condition, number(1.0), number(0.0)); }

/* Numbers of variables of a model, and of control stages. */
struct sizes {
    int64_t x, u, p, n_stages;
};

/* A function for costs and constraints. */
static inline swb_function *outputs(struct sizes n, const expr *f, int64_t n_f)
{
    swb_function *out;
    TRY(swb_expr_function(graph, "f", n.x, n.u, n.p, f, n_f, &out));
    return out;
}

/* The system of a model given by the derivatives of its states. */
static inline swb_system *system_of(struct sizes n, const expr *rhs)
{
    swb_model *model;
    swb_system *system;
    TRY(swb_model_create(graph, "model", n.x, n.u, n.p, rhs, NULL, NULL, &model));
    TRY(swb_model_system(model, &system));
    swb_model_free(model);
    return system;
}

/* A problem of a system, which is freed: the problem keeps what it needs. */
static inline swb_ocp *problem_of(swb_system *system, struct sizes n, double horizon, int64_t n_s, int64_t n_fe)
{
    swb_ocp *ocp;
    TRY(swb_ocp_create(system, horizon, n.n_stages, NULL, &ocp));
    TRY(swb_ocp_set_int(ocp, "n_s", n_s));
    TRY(swb_ocp_set_int(ocp, "n_fe", n_fe));
    swb_system_free(system);
    return ocp;
}

static inline void add_rate(swb_ocp *ocp, struct sizes n, expr f)
{
    swb_function *rate = outputs(n, &f, 1);
    TRY(swb_ocp_set_lagrange(ocp, rate));
    swb_function_free(rate);
}

/* f = goal at the end. */
static inline void add_goal(swb_ocp *ocp, struct sizes n, const expr *f, const double *goal, int64_t n_f)
{
    swb_function *end = outputs(n, f, n_f);
    TRY(swb_ocp_add_terminal(ocp, end, goal, n_f, goal, n_f));
    swb_function_free(end);
}

/* The sum of weight (f - reference)^2; n_r references, one for each f or for each f in each stage. */
static inline void add_squares(swb_ocp *ocp, struct sizes n, const expr *f, const double *weights, int64_t n_f,
                               const double *references, int64_t n_r, int32_t at)
{
    swb_function *residuals = outputs(n, f, n_f);
    TRY(swb_ocp_add_least_squares(ocp, residuals, weights, n_f, references, n_r, at));
    swb_function_free(residuals);
}

#endif
