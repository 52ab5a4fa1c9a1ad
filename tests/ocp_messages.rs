//! What optimal control problems without a solution say of themselves.

mod common;
use common::models::*;
use common::*;
use std::sync::Arc;
use switchback::expr::Graph;
use switchback::func::{Callback, Dims};
use switchback::model::Model;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Ocp, OcpResult};
use switchback::settings::{OcpStart, Settings};
use switchback::system::{SharedFunction, System};

const DI: Dims = Dims { x: 2, u: 1, p: 0 };

/// `q' = v, v' = u` with the given right-hand side.
fn from_rest(f0: SharedFunction, bound: f64, set: &Settings) -> Ocp {
    let mut s = System::new(2, 1, 0).unwrap();
    s.set_f0(f0).unwrap();
    let mut o = Ocp::new(&s, 1.0, 10, set).unwrap();
    o.set_x0(&[0.0; 2]).unwrap();
    o.set_u_bounds(&[-bound], &[bound]).unwrap();
    let goal = affine("goal", DI, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
    o.add_terminal(goal, &[1.0, 0.0], &[1.0, 0.0]).unwrap();
    o
}

fn dynamics() -> SharedFunction {
    affine("f0", DI, &[0.0; 2], &[(0, 1, 1.0), (1, 2, 1.0)])
}

fn run(o: &mut Ocp) -> OcpResult {
    let r = o.solve(&mut Control::default()).unwrap().clone();
    println!("{:?} {:?}: {}", r.outcome, r.polish, r.message);
    r
}

#[test]
fn a_goal_out_of_reach_is_named_with_its_distance() {
    // from rest to rest in a time of 1 over a distance of 1 needs an acceleration of 4; with 2 one gets half as far
    let set = settings(RadauIia, 2, 2, FESD);
    let r = run(&mut from_rest(dynamics(), 2.0, &set));
    assert_eq!(r.outcome, Outcome::Infeasible);
    assert!(r.cost.is_nan() && r.cost_reached.is_finite());
    assert!(
        r.message.contains("terminal constraint 0 ('goal') row 0 cannot be met: off by 0.5000 at best"),
        "{}",
        r.message
    );
    assert!(!r.message.contains("row 1"), "{}", r.message);
    // what can be met says nothing
    let r = run(&mut from_rest(dynamics(), 5.0, &set));
    assert_eq!((r.outcome, &r.message[..]), (Outcome::Solved, ""));
    // switches on the way, and a second goal at 0, which wins; bounds of states
    // (with elements for the switches of wherever a problem without solution ends)
    let mut o = sliding_ocp(&settings(RadauIia, 2, 3, FESD));
    let e = affine("far", o.system().dims(), &[0.0], &[(0, 0, 1.0)]);
    o.add_terminal(e, &[100.0], &[100.0]).unwrap();
    let r = run(&mut o);
    assert!(r.message.contains("('far') row 0 cannot be met: off by 100"), "{}", r.message);
    let mut o = from_rest(dynamics(), 5.0, &set);
    o.set_x0(&[0.0, 1.0]).unwrap();
    o.set_x_bounds(&[f64::NEG_INFINITY; 2], &[f64::INFINITY, 0.5]).unwrap();
    let r = run(&mut o);
    assert!(r.message.contains("the bound of state 1 cannot be met in stage 0: off by 0."), "{}", r.message);
    let quiet = Settings { explain: 0, ..set };
    assert!(!run(&mut from_rest(dynamics(), 2.0, &quiet)).message.contains("at best"));
}

#[test]
fn a_domain_that_ends_on_the_way_is_named() {
    for (code, word) in [(0, "returned NaN"), (3, "is not defined"), (-7, "returned the code -7")] {
        let f = Callback::new("engine", DI, 2, move |at, o| {
            o[0] = at.x[1];
            o[1] = if at.x[0] > 0.5 && code == 0 { f64::NAN } else { at.u[0] };
            if at.x[0] > 0.5 {
                code
            } else {
                0
            }
        });
        let r = run(&mut from_rest(Arc::new(f.linear()), 10.0, &settings(RadauIia, 2, 2, FESD)));
        assert_ne!(r.outcome, Outcome::Solved);
        let m = &r.message;
        assert!(m.contains(&format!("the smooth part 'engine' of the right-hand side {word} in stage ")), "{m}");
        assert!(m.contains("element ") && m.contains(" at t = 0.") && m.contains("x = (0.5"), "{m}");
    }
}

#[test]
fn a_mode_without_a_value_is_named() {
    // x' = 1 for x < 0, √(1/2 − x) + u beyond: the goal is where that ends
    let d = Dims { x: 1, u: 1, p: 0 };
    let mut s = System::new(1, 1, 0).unwrap();
    let modes = Callback::new("speeds", d, 2, |at, o| {
        o[0] = (0.5 - at.x[0]).sqrt() + 2.0 + at.u[0];
        o[1] = 1.0;
        0
    });
    add_sides(&mut s, &[0], Arc::new(modes), affine("psi", d, &[0.0], &[(0, 0, 1.0)]));
    let mut o = Ocp::new(&s, 1.0, 4, &settings(RadauIia, 2, 2, FESD)).unwrap();
    o.set_x0(&[-0.3]).unwrap();
    o.set_u_bounds(&[-1.0], &[1.0]).unwrap();
    o.add_terminal(affine("goal", d, &[0.0], &[(0, 0, 1.0)]), &[1.0], &[1.0]).unwrap();
    let r = run(&mut o);
    assert_ne!(r.outcome, Outcome::Solved);
    assert!(r.message.contains("mode 0 of subsystem 0 ('speeds') returned NaN in stage "), "{}", r.message);
}

/// A clock `c' = 1` and gates that open at given times; `q' = u + Σ gates`.
fn gates(times: &[f64], n_fe: i64) -> Ocp {
    let d = DI;
    let mut s = System::new(2, 1, 0).unwrap();
    s.set_f0(affine("f0", d, &[1.0, 0.0], &[(1, 2, 1.0)])).unwrap();
    for t in times {
        add_sides(&mut s, &[1], affine("gate", d, &[1.0, 0.0], &[]), affine("psi", d, &[-t], &[(0, 0, 1.0)]));
    }
    let mut o = Ocp::new(&s, 4.0, 4, &settings(RadauIia, 2, n_fe, FESD)).unwrap();
    o.set_x0(&[0.0; 2]).unwrap();
    o.set_u_bounds(&[-1.0], &[1.0]).unwrap();
    let effort = Callback::new("u2", d, 1, |at, o| {
        o[0] = at.u[0] * at.u[0] + at.x[1] * at.x[1];
        0
    });
    o.set_lagrange(Arc::new(effort)).unwrap();
    o
}

#[test]
fn too_few_elements_are_counted() {
    // two gates inside of stage 2, three inside of stage 1
    let r = run(&mut gates(&[2.3, 2.6], 2));
    assert!(r.outcome != Outcome::Solved || r.polish != Polish::Done);
    assert!(r.message.contains("stage 2, element "), "{}", r.message);
    assert!(
        r.message.contains("add elements: the simulation of the controls has 2 switches in the stage"),
        "{}",
        r.message
    );
    let r = run(&mut gates(&[1.2, 1.5, 1.9, 3.5], 3));
    assert!(r.message.contains("stage 1, element ") && r.message.contains("3 switches in the stage"), "{}", r.message);
    // one more element each is enough
    let mut o = gates(&[2.3, 2.6], 2);
    o.set_elements(&[2, 2, 3, 2]).unwrap();
    let r = run(&mut o);
    assert_eq!((r.outcome, r.polish, &r.message[..]), (Outcome::Solved, Polish::Done, ""));
}

#[test]
fn limits_are_named() {
    let set = Settings { max_iter: 5, ..settings(RadauIia, 2, 3, FESD) };
    let r = run(&mut sliding_ocp(&set));
    assert!(r.message.contains("max_iter = 5 iterations are not enough"), "{}", r.message);
    assert!(r.message.contains("stage ") && r.message.contains("violation"), "{}", r.message);
}

/// The end lies on a switching surface, where the mode behind it is open: whatever becomes of the search, controls that can be simulated
/// are not called controls for which the dynamics have no solution.
#[test]
fn dynamics_that_can_be_simulated_are_not_blamed() {
    let g = Graph::new();
    let (a, b, c, zero) = (g.x(0), g.x(1), g.x(2), g.constant(0.0));
    let rhs =
        [c.lt(0.4).select(1.0, zero) + g.u(0) - a, a.gt(0.5).select(1.2, zero) - b, b.gt(0.6).select(1.0, zero) - c];
    let system = Model::from_rhs("relays", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let set = Settings { ocp_start: OcpStart::Homotopy as i64, ..settings(RadauIia, 2, 3, FESD) };
    let mut o = Ocp::new(&system, 8.0, 16, &set).unwrap();
    o.set_x0(&[0.0, 0.2, 0.7]).unwrap();
    o.set_u_bounds(&[-0.4], &[0.4]).unwrap();
    let d = Dims { x: 3, u: 1, p: 0 };
    o.add_terminal(affine("goal", d, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]), &[0.5, 0.3], &[0.5, 0.3]).unwrap();
    let r = run(&mut o);
    assert!(!r.message.contains("not even for the dynamics"), "{}", r.message);
    if r.outcome != Outcome::Solved {
        assert!(r.message.contains("the dynamics have solutions"), "{}", r.message);
    }
}
