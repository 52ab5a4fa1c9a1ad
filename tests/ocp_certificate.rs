//! What an answer is as a point of the control problem: verdicts, derivatives, kinks, directions.

use std::path::Path;
use std::sync::Arc;
use switchback::document::{read, Document};
use switchback::event::{Engine, Options};
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::model::Model;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{CostAt, Ocp, OcpResult, Optimality, Verdict};
use switchback::settings::{OcpStart, Settings};
use switchback::system::{SharedFunction, System};

fn load(name: &str, start: OcpStart) -> Ocp {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("benches/optima/{name}.json"));
    let Document::Ocp(mut ocp) = read(&std::fs::read_to_string(path).unwrap(), &[]).unwrap() else {
        panic!("{name} is no optimal control problem")
    };
    let set = Settings { ocp_start: start as i64, ..*ocp.settings() };
    ocp.set_settings(&set).unwrap();
    *ocp
}

fn solve(ocp: &mut Ocp) -> (OcpResult, Optimality) {
    let r = ocp.solve(&mut Control::default()).unwrap().clone();
    assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "{}", r.message);
    let o = r.optimality.clone().expect("the comparison is on");
    (r, o)
}

/// Exact optima: paths that bend where speeds change, whose switches lie between stages, and smooth ones.
#[test]
fn exact_optima_are_certified() {
    let cases = [
        ("snell_3", Verdict::Kink),
        ("zermelo_river", Verdict::Kink),
        ("friction_move_02", Verdict::LocalOptimum),
        ("friction_energy", Verdict::LocalOptimum),
        ("sailing", Verdict::LocalOptimum),
        ("stewart", Verdict::LocalOptimum),
        ("friction_estimation", Verdict::LocalOptimum),
        ("brachistochrone", Verdict::LocalOptimum),
    ];
    for (name, verdict) in cases {
        let (_, o) = solve(&mut load(name, OcpStart::Portfolio));
        assert_eq!(o.verdict, verdict, "{name}: {o:?}");
        assert_eq!(o.kinks.is_empty(), verdict == Verdict::LocalOptimum, "{name}");
        assert!(o.residual < 1e-3 && o.direction.is_empty(), "{name}: {o:?}");
    }
}

/// The homotopy ends at a point of the discretisation that is none of the control problem; the portfolio does not.
#[test]
fn answers_that_can_be_bettered_are_not_certified() {
    let (poor, o) = solve(&mut load("landing", OcpStart::Homotopy));
    assert_eq!(o.verdict, Verdict::NotOptimal, "{o:?}");
    assert!(o.direction.iter().any(|d| *d != 0.0));
    let (good, o) = solve(&mut load("landing", OcpStart::Portfolio));
    assert_eq!(o.verdict, Verdict::LocalOptimum, "{o:?}");
    assert!(good.cost < 0.995 * poor.cost, "{} and {}", good.cost, poor.cost);
}

fn function(g: &Graph, d: Dims, outputs: &[Expr]) -> SharedFunction {
    Arc::new(g.function("end", d, outputs).unwrap())
}

/// A block with dry friction on a spring that is pushed; the cost is a state of its own.
fn block() -> (System, Ocp) {
    let g = Graph::new();
    let d = Dims { x: 3, u: 1, p: 0 };
    let (q, v, u) = (g.x(0), g.x(1), g.u(0));
    let cost = u * u + (q - 1.0) * (q - 1.0);
    let rhs = [v, u - q - 0.3 * v.sign(), cost];
    let system = Model::from_rhs("block", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let mut o =
        Ocp::new(&system, 3.0, 6, &Settings { ocp_start: OcpStart::Homotopy as i64, ..Settings::default() }).unwrap();
    o.set_x0(&[-1.0, 0.0, 0.0]).unwrap();
    o.set_u_bounds(&[-5.0], &[5.0]).unwrap();
    let end = [g.x(2) + 10.0 * (q - 1.0) * (q - 1.0) + 10.0 * v * v];
    o.set_mayer(function(&g, d, &end)).unwrap();
    (system, o)
}

/// Where nothing holds at the end, the derivatives with respect to the controls are those of the simulated cost, whether the
/// controls are at bounds or not.
#[test]
fn the_gradient_is_that_of_the_simulated_cost() {
    let (system, mut ocp) = block();
    let options = Options::with_tolerance(1e-12, 1e-12);
    let mut engine = Engine::new(&system, &options).unwrap();
    let mut cost = |u: &[f64]| -> f64 {
        engine.reinit(0.0, &[-1.0, 0.0, 0.0]).unwrap();
        for (k, u) in u.iter().enumerate() {
            engine.set_controls(&[*u]).unwrap();
            assert_eq!(engine.advance(0.5 * (k + 1) as f64).unwrap(), switchback::event::Outcome::Reached);
        }
        let x = engine.state();
        x[2] + 10.0 * (x[0] - 1.0).powi(2) + 10.0 * x[1] * x[1]
    };
    // within these bounds the optimum is at a bound in some stages, where derivatives do not vanish
    ocp.set_u_bounds(&[-0.2], &[0.4]).unwrap();
    let (r, o) = solve(&mut ocp);
    assert_eq!(o.verdict, Verdict::LocalOptimum, "{o:?}");
    let (h, mut steep) = (1e-5, 0);
    for k in 0..6 {
        let mut moved = r.controls.clone();
        let mut at = |step: f64| {
            moved[k] = r.controls[k] + step;
            cost(&moved)
        };
        let slope = (at(h) - at(-h)) / (2.0 * h);
        steep += usize::from(slope.abs() > 0.1);
        assert!((slope - o.gradient[k]).abs() < 1e-4, "{k}: {slope} and {}", o.gradient[k]);
    }
    assert!(steep > 0, "no derivative stands out: {:?}", o.gradient);
}

/// `x' = u + c(x)` is slower beyond zero, and what is gained by going on is worth it before zero and not behind: the best is to end
/// there, which is a kink at the end of the horizon. The derivatives of neither side vanish, a convex combination does.
#[test]
fn a_kink_at_the_end_of_the_horizon_is_found_by_descent() {
    let g = Graph::new();
    let d = Dims { x: 1, u: 1, p: 0 };
    let (x, u) = (g.x(0), g.u(0));
    let rhs = [u + x.gt(0.0).select(0.2, 1.0)];
    let system = Model::from_rhs("slower", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    for n in [1, 3] {
        let mut o = Ocp::new(&system, 1.0, n, &Settings::default()).unwrap();
        o.set_x0(&[-1.0]).unwrap();
        o.set_u_bounds(&[-3.0], &[3.0]).unwrap();
        o.set_lagrange(function(&g, d, &[0.5 * u * u + 0.5 * u])).unwrap();
        o.set_mayer(function(&g, d, &[1.0 - x])).unwrap();
        let (r, o) = solve(&mut o);
        assert!(
            (r.cost - 1.0).abs() < 1e-9 && r.controls.iter().all(|u| u.abs() < 1e-9),
            "{} {:?}",
            r.cost,
            r.controls
        );
        assert_eq!(o.verdict, Verdict::Kink, "{o:?}");
        assert!(o.residual > 0.1 && o.reason.contains("descent") && o.direction.is_empty(), "{o:?}");
    }
}

/// An optimum that costs nothing is one: what is left of its cost is rounding, which nothing is measured by.
#[test]
fn an_optimum_that_costs_nothing_is_certified() {
    let g = Graph::new();
    let rhs = [g.x(1), g.u(0) - 0.5 * g.x(1).sign()];
    let system = Model::from_rhs("block", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let mut ocp = Ocp::new(&system, 2.0, 5, &Settings::default()).unwrap();
    ocp.set_lagrange(function(&g, Dims { x: 2, u: 1, p: 0 }, &[g.u(0) * g.u(0)])).unwrap();
    ocp.set_x0(&[0.0, 0.0]).unwrap();
    let (r, o) = solve(&mut ocp);
    assert_eq!(o.verdict, Verdict::LocalOptimum, "{o:?}");
    assert!(r.cost.abs() < 1e-12, "{}", r.cost);
}

/// A ramp that linear controls track exactly: what a sum of squares usually costs says how small a cost is nothing.
#[test]
fn squares_that_vanish_are_certified() {
    let g = Graph::new();
    let system = Model::from_rhs("cart", 1, 0, &[g.u(0)]).and_then(|m| m.build(&g)).unwrap().system;
    let mut ocp = Ocp::new(&system, 2.0, 4, &Settings::default()).unwrap();
    ocp.set_x0(&[0.0]).unwrap();
    ocp.set_linear_controls(&[true]).unwrap();
    let of = |e| function(&g, Dims { x: 1, u: 1, p: 0 }, &[e]);
    ocp.add_least_squares(of(g.x(0)), &[1.0], &[0.25, 0.5, 0.75, 1.0], CostAt::ControlGrid).unwrap();
    ocp.add_least_squares(of(g.u(0) * g.u(0)), &[1e-4], &[0.25], CostAt::Running).unwrap();
    let (r, o) = solve(&mut ocp);
    assert_eq!(o.verdict, Verdict::LocalOptimum, "{o:?}");
    assert!(r.cost.abs() < 1e-12 && r.controls.iter().all(|u| (u - 0.5).abs() < 1e-4), "{} {:?}", r.cost, r.controls);
}

/// A mass with dry friction moved by many control stages, to its exact optimum: the velocity is a parabola, so the cost is `0.3² · 4` and
/// that of a double integrator with constant controls. The search takes a few times what the homotopy takes, however many stages a
/// switch of its first answer is off by.
#[test]
fn a_search_with_many_stages_takes_a_few_times_what_the_homotopy_takes() {
    let move_mass = |start: OcpStart, stages: usize| {
        let g = Graph::new();
        let rhs = [g.x(1), g.u(0) - 0.3 * g.x(1).sign()];
        let system = Model::from_rhs("mass", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
        let set = Settings { ocp_start: start as i64, ..Settings::default() };
        let mut ocp = Ocp::new(&system, 4.0, stages, &set).unwrap();
        let dims = Dims { x: 2, u: 1, p: 0 };
        ocp.set_lagrange(function(&g, dims, &[g.u(0) * g.u(0)])).unwrap();
        ocp.add_terminal(function(&g, dims, &[g.x(0), g.x(1)]), &[1.0, 0.0], &[1.0, 0.0]).unwrap();
        ocp.set_u_bounds(&[-2.0], &[2.0]).unwrap();
        ocp.set_x0(&[0.0, 0.0]).unwrap();
        let (r, o) = solve(&mut ocp);
        let exact = 0.36 + 0.1875 / (1.0 - (stages as f64).powi(-2));
        assert!((r.cost - exact).abs() < 1e-9, "{} instead of {exact}", r.cost);
        assert_eq!(o.verdict, Verdict::LocalOptimum, "{o:?}");
        r.stats.iterations
    };
    let (search, homotopy) = (move_mass(OcpStart::Portfolio, 500), move_mass(OcpStart::Homotopy, 500));
    assert!(search <= 4 * homotopy, "{search} iterations, {homotopy} of the homotopy");
}
