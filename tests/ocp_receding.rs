//! Horizons that move on: warm solves after `shift` beside cold ones, with a plant that is not the model.

use std::sync::Arc;
use switchback::event::{Engine, Options, Outcome as Ended};
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::model::Model;
use switchback::nlp::Control;
use switchback::ocp::{Ocp, OcpResult};
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};

const INTERVAL: f64 = 0.2;
const STAGES: usize = 10;

fn rate<'g>(g: &'g Graph) -> Expr<'g> {
    let (q, v, u) = (g.x(0), g.x(1), g.u(0));
    10.0 * (q - 1.0) * (q - 1.0) + v * v + 0.05 * u * u
}

/// A block with dry friction on a spring; with the cost as the last state where that is asked for.
fn block(g: &Graph, friction: f64, cost: bool) -> System {
    let (q, v, u) = (g.x(0), g.x(1), g.u(0));
    let mut rhs = vec![v, u - 0.5 * q - friction * v.sign()];
    rhs.extend(cost.then(|| rate(g)));
    Model::from_rhs("block", 1, 0, &rhs).and_then(|m| m.build(g)).unwrap().system
}

fn problem() -> Ocp {
    let g = Graph::new();
    let d = Dims { x: 2, u: 1, p: 0 };
    let one = |e: Expr| -> SharedFunction { Arc::new(g.function("cost", d, &[e]).unwrap()) };
    let mut o = Ocp::new(&block(&g, 0.5, false), INTERVAL * STAGES as f64, STAGES, &Settings::default()).unwrap();
    o.set_u_bounds(&[-3.0], &[3.0]).unwrap();
    o.set_lagrange(one(rate(&g))).unwrap();
    let (q, v) = (g.x(0), g.x(1));
    o.set_mayer(one(20.0 * (q - 1.0) * (q - 1.0) + 2.0 * v * v)).unwrap();
    o
}

/// Cost of a closed loop of `n` samples with a push in the middle, and iterations of the solves after the first.
fn closed_loop(n: usize, warm: bool) -> (f64, usize) {
    let g = Graph::new();
    let mut plant = Engine::new(&block(&g, 0.55, true), &Options::with_tolerance(1e-9, 1e-10)).unwrap();
    let mut o = problem();
    let (mut x, mut iterations) = (vec![0.0; 3], 0);
    for k in 0..n {
        if k == n / 2 {
            x[0] -= 0.4;
        }
        o.set_x0(&x[..2]).unwrap();
        let r: OcpResult = if k > 0 && warm {
            o.shift().unwrap();
            o.solve_warm(&mut Control::default()).unwrap().clone()
        } else {
            o.solve(&mut Control::default()).unwrap().clone()
        };
        assert!(r.cost.is_finite(), "sample {k}: {}", r.message);
        iterations += if k > 0 { r.stats.iterations } else { 0 };
        plant.reinit(0.0, &x).unwrap();
        plant.set_controls(&r.controls[..1]).unwrap();
        assert_eq!(plant.advance(INTERVAL).unwrap(), Ended::Reached);
        x = plant.state().to_vec();
    }
    (x[2], iterations)
}

#[test]
fn a_warm_solve_after_a_shift_is_as_good_as_a_cold_one() {
    let ((cold, cold_its), (warm, warm_its)) = (closed_loop(12, false), closed_loop(12, true));
    assert!((warm - cold).abs() < 5e-3 * cold, "{warm} and {cold}");
    assert!(2 * warm_its < cold_its, "{warm_its} and {cold_its}");
}
