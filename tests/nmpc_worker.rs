//! Preparations on a thread of their own: the same controls as without, and a control in time where a preparation is late.

#[path = "common/counting.rs"]
mod counting;

use counting::count;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::sync::Arc;
use std::time::{Duration, Instant};
use switchback::error::Error;
use switchback::func::{Callback, Dims};
use switchback::linalg::csc::Pattern;
use switchback::nmpc::*;
use switchback::ocp::{CostAt, Ocp};
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

const DIMS: Dims = Dims { x: 2, u: 1, p: 0 };

/// What the model does besides its work.
#[derive(Clone, Default)]
struct Gate {
    /// Functions wait while it is closed, at most two seconds.
    closed: Arc<AtomicBool>,
    /// A function is waiting.
    reached: Arc<AtomicBool>,
    /// Functions panic.
    broken: Arc<AtomicBool>,
    calls: Arc<AtomicUsize>,
}

impl Gate {
    fn pass(&self) {
        self.calls.fetch_add(1, SeqCst);
        assert!(!self.broken.load(SeqCst), "a function of the model is broken");
        let start = Instant::now();
        while self.closed.load(SeqCst) && start.elapsed() < Duration::from_secs(2) {
            self.reached.store(true, SeqCst);
            std::thread::sleep(Duration::from_micros(50));
        }
    }

    fn wait_until_reached(&self) {
        while !self.reached.load(SeqCst) {
            std::thread::yield_now();
        }
    }
}

/// A pendulum that is to hang still, `x' = (ω, u − sin θ)`, without constraints but on the control.
fn problem(gate: &Gate) -> Ocp {
    horizon(gate, 10)
}

fn horizon(gate: &Gate, stages: usize) -> Ocp {
    let make = |name: &str, n_out: usize, f: fn(&[f64], f64, &mut [f64])| -> SharedFunction {
        let gate = gate.clone();
        let (rows, columns): (Vec<usize>, Vec<usize>) = (0..n_out).flat_map(|i| (0..3).map(move |j| (i, j))).unzip();
        let (pattern, _) = Pattern::from_triplets(n_out, DIMS.n_in(), &rows, &columns);
        let c = Callback::new(name, DIMS, n_out, move |at, out| {
            gate.pass();
            f(at.x, at.u[0], out);
            0
        });
        Arc::new(c.with_jacobian_pattern(pattern).unwrap())
    };
    let mut system = System::new(2, 1, 0).unwrap();
    system.set_f0(make("f", 2, |x, u, o| o.copy_from_slice(&[x[1], u - x[0].sin()]))).unwrap();
    let mut ocp = Ocp::new(&system, 0.1 * stages as f64, stages, &Settings::default()).unwrap();
    ocp.add_least_squares(
        make("cost", 3, |x, u, o| o.copy_from_slice(&[x[0], x[1], u])),
        &[2.0, 0.5, 0.1],
        &[0.0; 3],
        CostAt::Running,
    )
    .unwrap();
    ocp.add_least_squares(make("end", 2, |x, _, o| o.copy_from_slice(x)), &[5.0, 1.0], &[0.0; 2], CostAt::Terminal)
        .unwrap();
    ocp.set_u_bounds(&[-3.0], &[3.0]).unwrap();
    ocp.set_x_guess(&[0.0], &[0.1, 0.0]).unwrap();
    ocp
}

fn options(scheme: Scheme, level: Level, deadline: f64) -> Options {
    Options {
        scheme,
        level,
        deadline,
        shift: true,
        family: Some(Family::Explicit),
        n_s: 4,
        steps: 1,
        ..Options::default()
    }
}

/// The next state of a plant, near that of the model.
fn plant(x: [f64; 2], u: f64) -> [f64; 2] {
    let h = 0.1;
    [x[0] + h * x[1] + 0.5 * h * h * (u - x[0].sin()), x[1] + h * (u - x[0].sin())]
}

fn worker(gate: &Gate, options: &Options) -> Worker {
    let mut c = Nmpc::new(&problem(gate), options).unwrap();
    c.initialise(&[0.3, 0.0], 50).unwrap();
    Worker::new(c, &Arc::default())
}

/// Where there is time enough the thread changes nothing, to the bit, and the caller's side allocates nothing.
#[test]
fn the_same_controls_as_without_a_thread() {
    let gate = Gate::default();
    for (scheme, level) in
        [(Scheme::Rti, Level::D0), (Scheme::Mli, Level::C), (Scheme::AsRti, Level::D0), (Scheme::Asc, Level::D0)]
    {
        let options = options(scheme, level, f64::INFINITY);
        let mut plain = Nmpc::new(&problem(&gate), &options).unwrap();
        plain.initialise(&[0.3, 0.0], 50).unwrap();
        let mut other = worker(&gate, &options);
        assert_eq!(other.sizes(), [10, 2, 1]);
        let mut x = [0.3, 0.0];
        for k in 0..30 {
            let (mut u, mut v) = ([0.0], [f64::NAN]);
            plain.prepare(None).unwrap();
            let before = count();
            assert!(other.prepare(None).unwrap());
            let prepared = if k % 3 == 0 { Some(other.wait().unwrap()) } else { None };
            let info = other.feedback(&x, &mut v).unwrap();
            // the thread is made by the first one
            assert!(k == 0 || count() == before, "{scheme:?}: sample {k}");
            assert!(prepared.is_none_or(|p| p.ready));
            let expected = plain.feedback(&x, &mut u).unwrap();
            assert_eq!((info.source, info.iterations), (expected.source, expected.iterations));
            assert_eq!(u[0].to_bits(), v[0].to_bits(), "{scheme:?} {level:?}: sample {k}");
            x = plant(x, u[0]);
        }
        let plan = other.with(|c| Ok(c.plan().clone())).unwrap();
        assert_eq!(&plan, plain.plan());
        let monitor = other.with(|c| Ok(*c.monitor())).unwrap();
        assert_eq!(monitor.sources, plain.monitor().sources);
        assert_eq!(monitor.evaluations, plain.monitor().evaluations);
    }
}

/// A preparation that does not come back in time: the law of the last plan answers within the deadline, nearly as the program would
/// have, then the preparation is used, and the controller knows what happened.
#[test]
fn late_preparations_do_not_hold_samples_up() {
    let gate = Gate::default();
    let set = options(Scheme::Rti, Level::D0, 0.02);
    let mut w = worker(&gate, &set);
    let mut x = [0.3, 0.0];
    let mut u = [0.0];
    w.prepare(None).unwrap();
    w.wait().unwrap();
    assert_eq!(w.feedback(&x, &mut u).unwrap().source, Source::Qp);
    x = plant(x, u[0]);
    let mut late = 0.0f64;
    for missed in 1..=3 {
        if missed == 1 {
            gate.closed.store(true, SeqCst);
        }
        assert_eq!(w.prepare(None).unwrap(), missed == 1, "one preparation at a time");
        gate.wait_until_reached();
        x[0] += 0.01;
        let start = Instant::now();
        let info = w.feedback(&x, &mut u).unwrap();
        // the gate stays closed for two seconds: this did not wait for it
        assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
        assert_eq!(info.source, Source::Tangent);
        // the solution of what is left of the horizon of the plan
        let mut ideal = Nmpc::new(&horizon(&Gate::default(), 10 - missed), &set).unwrap();
        ideal.initialise(&x, 50).unwrap();
        let best = ideal.plan().u()[0];
        late = late.max((u[0] - best).abs());
        assert!((u[0] - best).abs() < 1e-3 * best.abs(), "{} instead of {best}", u[0]);
        x = plant(x, u[0]);
    }
    assert!(late > 1e-9, "an affine law is not exact");
    let mut no_state = [0.0];
    assert_eq!(w.feedback(&[f64::NAN, 0.0], &mut no_state).unwrap().source, Source::Plan);
    x = plant(x, no_state[0]);
    gate.closed.store(false, SeqCst);
    assert!(w.wait().unwrap().ready);
    assert_eq!(w.feedback(&x, &mut u).unwrap().source, Source::Qp);
    let monitor = w.with(|c| Ok(*c.monitor())).unwrap();
    assert_eq!(monitor.sources, [2, 0, 3, 1, 0]);
    assert_eq!(monitor.feedback.count, 6);
}

/// An interrupt ends the preparation that runs and no other; the controller goes on.
#[test]
fn interrupts_end_preparations() {
    let gate = Gate::default();
    let flag = Arc::new(AtomicBool::new(false));
    let mut c = Nmpc::new(&problem(&gate), &options(Scheme::AsRti, Level::D0, f64::INFINITY)).unwrap();
    c.initialise(&[0.3, 0.0], 50).unwrap();
    let mut w = Worker::new(c, &flag);
    let mut u = [0.0];
    assert!(matches!(w.wait(), Err(Error::State(_))));
    for k in 0..5 {
        gate.reached.store(false, SeqCst);
        gate.closed.store(true, SeqCst);
        w.prepare(Some(&[0.3, 0.01])).unwrap();
        gate.wait_until_reached();
        flag.store(true, SeqCst);
        gate.closed.store(false, SeqCst);
        assert_eq!(w.wait().unwrap_err(), Error::Interrupted, "{k}");
        let info = w.feedback(&[0.3, 0.0], &mut u).unwrap();
        assert!(matches!(info.source, Source::Qp), "{info:?}");
        w.prepare(None).unwrap();
        assert!(w.wait().unwrap().ready);
    }
    assert!(w.prepare(Some(&[f64::NAN, 0.0])).is_err());
    assert!(w.prepare(Some(&[0.0])).is_err());
    assert!(w.feedback(&[0.0], &mut u).is_err());
}

/// A model that panics ends the preparation; the program before is used further, and the controller goes on when the model does.
#[test]
fn a_broken_model_leaves_controls() {
    let gate = Gate::default();
    let mut w = worker(&gate, &options(Scheme::Rti, Level::D0, f64::INFINITY));
    let mut u = [0.0];
    w.prepare(None).unwrap();
    w.feedback(&[0.3, 0.0], &mut u).unwrap();
    gate.broken.store(true, SeqCst);
    for _ in 0..3 {
        w.prepare(None).unwrap();
        assert!(matches!(w.wait(), Err(Error::User { .. })));
        assert_eq!(w.feedback(&[0.2, 0.0], &mut u).unwrap().source, Source::Qp);
    }
    gate.broken.store(false, SeqCst);
    w.prepare(None).unwrap();
    assert!(w.wait().unwrap().ready);
}

/// A worker that is dropped while it works ends first.
#[test]
fn dropped_while_it_works() {
    let gate = Gate::default();
    let mut w = worker(&gate, &options(Scheme::Rti, Level::D0, f64::INFINITY));
    gate.closed.store(true, SeqCst);
    w.prepare(None).unwrap();
    gate.wait_until_reached();
    let opener = gate.clone();
    let thread = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(20));
        opener.closed.store(false, SeqCst);
    });
    drop(w);
    let calls = gate.calls.load(SeqCst);
    thread.join().unwrap();
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!(gate.calls.load(SeqCst), calls, "the model is called after the worker is gone");
}
