//! Gene networks of Acary, de Jong and Brogliato (2014): synthesis goes on and off at thresholds of concentrations.

use super::{function, set, system, Problem};
use switchback::error::Result;
use switchback::expr::{Cond, Expr, Graph};
use switchback::func::Dims;
use switchback::ocp::{CostAt, Ocp};
use switchback::settings::{DcsForm, Settings};
use switchback::system::System;

pub fn all() -> Vec<Result<Problem>> {
    vec![two_genes_control(), irma_control()]
}

fn on<'g>(g: &'g Graph, c: Cond<'g>) -> Expr<'g> {
    c.select(g.constant(1.0), g.constant(0.0))
}

/// Two genes, each expressed in a band of both concentrations; `inducer` adds to the first.
fn two_genes(g: &Graph, d: Dims) -> System {
    let (a, b) = (g.x(0), g.x(1));
    let inducer = if d.u > 0 { g.u(0) } else { g.constant(0.0) };
    let first = 40.0 * on(g, a.gt(4.0) & b.lt(8.0)) - 4.5 * a + inducer;
    let second = 40.0 * on(g, a.lt(8.0) & b.gt(4.0)) - 1.5 * b;
    system(g, d, &[first, second])
}

/// The synthetic network IRMA with galactose: five genes of yeast, concentrations in 0.01, minutes.
fn irma(g: &Graph, d: Dims) -> System {
    let [cbf1, gal4, swi5, gal80, ash1] = [g.x(0), g.x(1), g.x(2), g.x(3), g.x(4)];
    let inducer = if d.u > 0 { g.u(0) } else { g.constant(0.0) };
    let rhs = [
        0.011 + 0.09 * on(g, gal80.gt(4.0)) + inducer - 0.05 * cbf1,
        0.03 + 15.0 * on(g, cbf1.gt(1.0)) - 0.04 * gal4,
        0.06 + 1.8 * on(g, gal4.gt(6.0)) - 0.05 * swi5,
        on(g, gal4.gt(1.0)) * (0.05 + 3.0 * (1.0 - on(g, swi5.gt(3.5)))) - 0.02 * gal80,
        0.075 + 1.5 * on(g, gal4.gt(8.0)) - 0.6 * ash1,
    ];
    system(g, d, &rhs)
}

/// Name, system, initial state and duration of the networks without a control.
pub fn free() -> Vec<(&'static str, System, Vec<f64>, f64)> {
    let g = Graph::new();
    let d = |x| Dims { x, u: 0, p: 0 };
    vec![
        ("two-genes", two_genes(&g, d(2)), vec![5.0, 5.0], 1.0),
        ("irma", irma(&g, d(5)), vec![1.1, 9.0, 4.0, 5.0, 1.5], 1000.0),
    ]
}

/// The relaxation of the first problem is of the size of a product of weight and distance to a threshold.
fn relaxed(form: DcsForm) -> Settings {
    Settings { sigma_init: 10.0, dcs_form: form as i64, ..set(4, 2) }
}

fn two_genes_control() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 2, u: 1, p: 0 };
    let mut o = Ocp::new(&two_genes(&g, d), 0.5, 10, &relaxed(DcsForm::Auto))?;
    o.set_x0(&[5.0, 5.0])?;
    o.set_u_bounds(&[0.0], &[40.0])?;
    o.add_least_squares(function(&g, d, "u", &[g.u(0)]), &[0.001], &[0.0], CostAt::Running)?;
    o.add_least_squares(function(&g, d, "x", &[g.x(0), g.x(1)]), &[1.0, 1.0], &[8.5, 0.0], CostAt::Running)?;
    Ok(Problem {
        name: "two-genes",
        see: "a pulse of the inducer lets the first gene win the race: at 8 it shuts the other one off",
        ocp: o,
        time: "time",
        states: &["gene a", "gene b"],
        controls: &["inducer"],
        horizon: None,
    })
}

fn irma_control() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 5, u: 1, p: 0 };
    let mut o = Ocp::new(&irma(&g, d), 160.0, 8, &relaxed(DcsForm::Heaviside))?;
    o.set_x0(&[1.1, 9.0, 4.0, 5.0, 1.5])?;
    o.set_u_bounds(&[0.0], &[0.1])?;
    o.add_least_squares(function(&g, d, "u", &[g.u(0)]), &[1000.0], &[0.0], CostAt::Running)?;
    o.add_least_squares(function(&g, d, "swi5", &[g.x(2)]), &[1.0], &[20.0], CostAt::Terminal)?;
    Ok(Problem {
        name: "irma",
        see: "a little inducer keeps CBF1 above its threshold longer, so SWI5 falls later",
        ocp: o,
        time: "time / min",
        states: &["CBF1", "", "SWI5", "GAL80", "ASH1"],
        controls: &["inducer"],
        horizon: None,
    })
}
