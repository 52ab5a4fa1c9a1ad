//! Interrupts and time limits in every phase: no model function is called once a call has been asked to end, what was found
//! before stays the answer, and the object is as good as new.

mod common;
use common::models::*;
use common::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::Arc;
use switchback::error::{Error, Result};
use switchback::func::{Callback, Dims};
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Ocp, OcpResult};
use switchback::settings::{InitialGuess, Settings};
use switchback::stop::Stop;
use switchback::system::{Regions, SharedFunction, Subsystem, System};

const DIMS: Dims = Dims { x: 1, u: 1, p: 1 };

/// Counts the calls of the model, and raises a flag at one of them.
#[derive(Clone, Default)]
struct Tripwire {
    calls: Arc<AtomicUsize>,
    at: Arc<AtomicUsize>,
    flag: Arc<AtomicBool>,
}

impl Tripwire {
    fn step(&self) {
        if self.calls.fetch_add(1, Relaxed) + 1 == self.at.load(Relaxed) {
            self.flag.store(true, Relaxed);
        }
    }

    /// A function whose derivatives are differences, so that these are part of the phases.
    fn function(&self, name: &str, n_out: usize, f: fn(f64, f64, f64, &mut [f64])) -> SharedFunction {
        let wire = self.clone();
        let all = pattern(n_out, 4, &(0..n_out).flat_map(|i| (0..3).map(move |j| (i, j))).collect::<Vec<_>>());
        let c = Callback::new(name, DIMS, n_out, move |at, out| {
            wire.step();
            f(at.x[0], at.u[0], at.p[0], out);
            0
        });
        Arc::new(c.with_jacobian_pattern(all).unwrap())
    }

    fn count(&self, body: impl FnOnce() -> Result<Outcome>) -> (usize, Result<Outcome>) {
        self.calls.store(0, Relaxed);
        self.flag.store(false, Relaxed);
        let r = body();
        (self.calls.load(Relaxed), r)
    }
}

/// `ẋ = −p sign(x) + u`, from 1 towards a goal, at the cost of `∫ (x − 1/2)² + u²`.
fn relay(wire: &Tripwire, set: &Settings, goal: Option<f64>) -> Ocp {
    let mut s = System::new(1, 1, 1).unwrap();
    let modes = wire.function("modes", 2, |_, u, p, o| {
        o[0] = u - p;
        o[1] = u + p;
    });
    let psi = wire.function("psi", 1, |x, _, _, o| o[0] = x);
    let regions = Regions::Signs { psi, signs: vec![1, -1] };
    s.add_subsystem(Subsystem { rows: vec![0], modes, n_modes: 2, regions }).unwrap();
    let mut o = Ocp::new(&s, 2.0, 3, set).unwrap();
    o.set_lagrange(wire.function("L", 1, |x, u, _, o| o[0] = (x - 0.5).powi(2) + u * u)).unwrap();
    if let Some(goal) = goal {
        let f = wire.function("end", 1, |x, _, _, o| o[0] = x);
        o.add_terminal(f, &[goal], &[goal]).unwrap();
    }
    o.set_x0(&[1.0]).unwrap();
    o.set_params(&[1.0]).unwrap();
    o.set_u_bounds(&[-0.5], &[0.5]).unwrap();
    o
}

/// Interrupts `run` at some of its model calls, the last one among them: not one follows. `check` sees how it ended.
fn interrupt_everywhere(
    wire: &Tripwire,
    o: &mut Ocp,
    what: &str,
    run: impl Fn(&mut Ocp, &mut Control) -> Result<Outcome>,
    mut check: impl FnMut(usize, &Result<Outcome>, &Ocp),
) {
    wire.at.store(usize::MAX, Relaxed);
    let stop = Stop::on(&wire.flag);
    let (all, whole) = wire.count(|| run(o, &mut Control::of(stop.clone())));
    let whole = whole.unwrap();
    let before = o.result().cloned();
    let places = 40;
    for k in 0..places {
        let at = 1 + (all - 1) * k / (places - 1);
        wire.at.store(at, Relaxed);
        let (calls, end) = wire.count(|| run(o, &mut Control::of(stop.clone())));
        assert_eq!(calls, at, "{what}: of {all} calls the {at}th interrupts, {calls} were made; {end:?}");
        check(at, &end, o);
    }
    // as good as new
    wire.at.store(usize::MAX, Relaxed);
    let (_, again) = wire.count(|| run(o, &mut Control::of(stop.clone())));
    assert_eq!(again.unwrap(), whole, "{what}");
    if let (Some(a), Some(b)) = (before, o.result()) {
        assert_eq!((&a.controls, a.cost.to_bits()), (&b.controls, b.cost.to_bits()), "{what}");
    }
}

fn solve(o: &mut Ocp, control: &mut Control) -> Result<Outcome> {
    o.solve(control).map(|r| r.outcome)
}

fn is_end(end: &Result<Outcome>, whole: Outcome) -> bool {
    matches!(end, Err(Error::Interrupted)) || matches!(end, Ok(o) if *o == Outcome::Stopped || *o == whole)
}

/// Starting simulation, path, polish, certificate, comparison.
#[test]
fn a_solve_ends_at_the_model_call_that_interrupts_it() {
    let wire = Tripwire::default();
    let set =
        Settings { initial_guess: InitialGuess::Simulation as i64, mode_search: 2, ..settings(RadauIia, 2, 2, FESD) };
    let mut o = relay(&wire, &set, None);
    let mut kept = 0;
    interrupt_everywhere(&wire, &mut o, "solve", solve, |_, end, o| {
        assert!(is_end(end, Outcome::Solved), "{end:?}");
        // what was found before a stop is kept, and the outcome says that there was one
        if let (Ok(Outcome::Solved | Outcome::Stopped), Some(r)) = (end, o.result()) {
            if *end.as_ref().unwrap() == Outcome::Solved {
                assert!(r.cost.is_finite() && r.cost == r.cost_reached, "{}", r.message);
            }
            if r.message.contains("interrupted in the comparison") {
                kept += 1;
                assert!(r.error().is_nan());
            }
        }
    });
    assert!(kept > 0, "no interrupt fell into the comparison");
}

/// The search for the constraint that cannot be met.
#[test]
fn an_explanation_ends_at_the_model_call_that_interrupts_it() {
    let wire = Tripwire::default();
    let mut o = relay(&wire, &settings(RadauIia, 2, 2, FESD), Some(50.0));
    interrupt_everywhere(&wire, &mut o, "explain", solve, |_, end, _| {
        assert!(
            is_end(end, Outcome::Infeasible) || matches!(end, Ok(Outcome::Stalled)),
            "{end:?}: what is not shown is not claimed"
        );
    });
}

#[test]
fn adaptation_and_sensitivity_end_at_the_model_call_that_interrupts_them() {
    let wire = Tripwire::default();
    let set = settings(RadauIia, 2, 2, FESD);
    let mut o = relay(&wire, &set, None);
    solve(&mut o, &mut Control::default()).unwrap();
    let sensitivity = |o: &mut Ocp, c: &mut Control| c.stop.scope(|| o.sensitivity()).map(|_| Outcome::Solved);
    interrupt_everywhere(&wire, &mut o, "sensitivity", sensitivity, |_, end, _| {
        assert!(is_end(end, Outcome::Solved), "{end:?}");
    });
    let mut o = relay(&wire, &Settings { adapt_tol: 1e-7, ..set }, None);
    wire.at.store(usize::MAX, Relaxed);
    let (all, _) = wire.count(|| solve(&mut o, &mut Control::default()));
    for k in 1..8 {
        wire.at.store(all * k / 8, Relaxed);
        let mut o = relay(&wire, &Settings { adapt_tol: 1e-7, ..set }, None);
        let (calls, end) = wire.count(|| solve(&mut o, &mut Control::of(Stop::on(&wire.flag))));
        assert_eq!(calls, all * k / 8);
        assert!(is_end(&end, Outcome::Solved), "{end:?}");
    }
}

/// Where time is over from the beginning nothing of the model is called but what the structure needs, and the point that is
/// handed out says that its residuals are not known.
#[test]
fn a_time_limit_of_zero_calls_no_model_function() {
    let wire = Tripwire::default();
    let set = Settings { max_time: 0.0, ..settings(RadauIia, 2, 2, FESD) };
    let mut o = relay(&wire, &set, None);
    let (calls, end) = wire.count(|| solve(&mut o, &mut Control::default()));
    assert_eq!((calls, end), (0, Ok(Outcome::MaxTime)));
    let r: OcpResult = o.result().unwrap().clone();
    assert!(r.cost.is_nan() && r.residuals.dual.is_nan() && r.message.contains("max_time"), "{}", r.message);
    assert!(r.accuracy.is_some_and(|a| a.terminal.is_nan() && !a.reached()));
}
