//! What users of the crates write first: a model of expressions, a simulation, an optimal control problem; and a program with a pair.

use std::sync::Arc;

use switchback::event::{Kind, Options};
use switchback::settings::RkFamily;
use switchback::{simulate, Error, Graph, Model, Ocp, Outcome, Settings, SolveControl};
use switchback_mpcc::mpcc::{Lifted, Member};
use switchback_mpcc::nlp::{Bounds, CallbackNlp};
use switchback_mpcc::{Callback, Dims, MpccSettings, MpccSolver};

fn main() -> switchback::Result<()> {
    // A mass with dry friction: x' = v, v' = u - 0.3 sign(v).
    let g = Graph::new();
    let (v, u) = (g.x(1), g.u(0));
    let built = Model::from_rhs("friction", 1, 0, &[v, u - 0.3 * v.sign()])?.build(&g)?;

    // With u = 0 it slides until it sticks at v(0)/0.3, after a way of v(0)²/0.6.
    let run = simulate(&built.system, &Options::with_tolerance(1e-10, 1e-10), 0.0, &[0.0, 1.0], 5.0)?;
    let stick = &run.switches[0];
    assert_eq!((run.switches.len(), stick.kind), (1, Kind::Enter));
    assert!((stick.t - 1.0 / 0.3).abs() < 1e-9 && (run.x[0] - 1.0 / 0.6).abs() < 1e-9, "{run:?}");

    // From rest to rest over a way of 1 in the time 2 with the least ∫ u²/2 dt: v > 0, so that friction is constant,
    // u = 0.3 + 1.5 - 1.5 t and the cost is ∫ (1.8 - 1.5 t)²/2 dt = 0.84; controls that are constant on eight stages cost
    // 1.5²(h²/12) more than the mean of the squares, scaled to go the same way.
    let settings = Settings { rk_family: RkFamily::RadauIia as i64, n_s: 2, ..Settings::default() };
    let mut ocp = Ocp::new(&built.system, 2.0, 8, &settings)?;
    assert!(matches!(ocp.set_x0(&[0.0]), Err(Error::Dimension(_))));
    ocp.set_x0(&[0.0, 0.0])?;
    ocp.set_lagrange(Arc::new(g.function("L", built.dims, &[0.5 * u * u])?))?;
    ocp.add_terminal(Arc::new(g.function("e", built.dims, &[g.x(0), v])?), &[1.0, 0.0], &[1.0, 0.0])?;
    let answer = ocp.solve(&mut SolveControl::default())?;
    assert_eq!(answer.outcome, Outcome::Solved, "{}", answer.message);
    // w = u - 0.3 has Σ h w = 0 and Σ h w_k t_k = -1 (t_k: middles), so w_k = -c (t_k - 1) with c = 1/Σ h (t_k - 1)².
    let h = 0.25;
    let spread: f64 = (0..8).map(|k| h * ((k as f64 + 0.5) * h - 1.0_f64).powi(2)).sum();
    let exact = 0.5 * (1.0 / spread + 2.0 * 0.3 * 0.3);
    assert!((answer.cost - exact).abs() < 1e-8 * exact, "cost {}, exact {exact}", answer.cost);

    println!("t = {:.12}, cost = {:.12}", stick.t, answer.cost);
    pair()
}

/// min (x - 1)² + (y - 2)² with 0 ≤ x ⊥ y ≥ 0: the better branch has y = 2.
fn pair() -> switchback_mpcc::Result<()> {
    let cost = Callback::new("cost", Dims { x: 2, u: 0, p: 0 }, 1, |at, out| {
        out[0] = (at.x[0] - 1.0).powi(2) + (at.x[1] - 2.0).powi(2);
        0
    });
    let program = CallbackNlp::new(2, 0, Arc::new(cost), None)?;
    let mut problem = Lifted::new(program, &[(Member::Variable(0), Member::Variable(1))])?;
    let bounds = problem.bounds(&Bounds { xl: vec![0.0; 2], ..Bounds::free(2, 0) })?;
    let start = problem.start(&[0.5, 0.5]);
    let mut solver = MpccSolver::new(&mut problem, MpccSettings::default())?;
    let answer = solver.solve(&mut problem, &bounds, &start, &mut SolveControl::default());
    assert_eq!(answer.outcome, Outcome::Solved);
    assert!(answer.x[0] == 0.0 && (answer.x[1] - 2.0).abs() < 1e-6, "{:?}", answer.x);
    println!("x = {:?}", answer.x);
    Ok(())
}
