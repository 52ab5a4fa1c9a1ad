//! A bilevel program: the leader pays for what the follower does.
//!
//! ```text
//! min (x - 3)² + (y - 2)²   over 0 ≤ x ≤ 8,   where y solves   min (y - 1)²   s.t.   y ≤ x,   y ≥ 0
//! ```
//!
//! The conditions of first order of the follower take his place: `2 (y - 1) + λ - μ = 0`, `0 ≤ x - y ⊥ λ ≥ 0`, `0 ≤ y ⊥ μ ≥ 0`.
//! For `x ≥ 1` he chooses `y = 1`, and the leader `x = 3` with the cost 1; for `x ≤ 1` he chooses `y = x`, which costs 5 at least.

use std::sync::Arc;

use switchback_mpcc::mpcc::{Lifted, Member};
use switchback_mpcc::nlp::{Bounds, CallbackNlp};
use switchback_mpcc::{Callback, Control, Dims, MpccSettings, MpccSolver, Outcome};

fn main() -> switchback_mpcc::Result<()> {
    // w = (x, y, λ, μ)
    let dims = Dims { x: 4, u: 0, p: 0 };
    let cost = Callback::new("cost", dims, 1, |at, out| {
        out[0] = (at.x[0] - 3.0).powi(2) + (at.x[1] - 2.0).powi(2);
        0
    });
    let follower = Callback::new("follower", dims, 2, |at, out| {
        let [x, y, lambda, mu] = [at.x[0], at.x[1], at.x[2], at.x[3]];
        out[0] = 2.0 * (y - 1.0) + lambda - mu;
        out[1] = x - y;
        0
    });
    let program = CallbackNlp::new(4, 0, Arc::new(cost), Some(Arc::new(follower)))?;
    let pairs = [(Member::Row(1), Member::Variable(2)), (Member::Variable(1), Member::Variable(3))];
    let mut problem = Lifted::new(program, &pairs)?;

    let inf = f64::INFINITY;
    let bounds = problem.bounds(&Bounds {
        xl: vec![0.0; 4],
        xu: vec![8.0, inf, inf, inf],
        cl: vec![0.0, 0.0],
        cu: vec![0.0, inf],
    })?;
    let start = problem.start(&[0.5, 0.5, 0.1, 0.1]);

    let mut solver = MpccSolver::new(&mut problem, MpccSettings::default())?;
    let found = solver.solve(&mut problem, &bounds, &start, &mut Control::default());
    println!("{:?} after {} iterations", found.outcome, found.stats.iterations);
    println!("x = {:.9}, y = {:.9}, cost = {:.9}", found.x[0], found.x[1], found.objective);
    println!("stationarity {}, B-stationary: {}", found.certificate.stationarity.name(), found.certificate.b.name());
    assert_eq!(found.outcome, Outcome::Solved);
    assert!((found.x[0] - 3.0).abs() < 1e-6 && (found.x[1] - 1.0).abs() < 1e-6);
    Ok(())
}
