//! Numbers at both ends of the ranges of their options, denormal ones among them: a simulation, a control problem and a
//! program end with a result or an error in words, and the object goes on working.

#[path = "../examples/report/models.rs"]
mod models;
#[path = "../crates/switchback-mpcc/tests/common/textbook/mod.rs"]
mod textbook;

use switchback::event;
use switchback::mpcc::{MpccSettings, MpccSolver};
use switchback::nlp::{Control, Outcome};
use switchback::ocp::Ocp;
use switchback::settings::{Bound, Homotopy, Kind, OptionInfo, Ordering, Relaxation, Settings, Value, OPTIONS};
use switchback::sim::Simulator;

/// Iterations are enough to get into every phase, and no solve takes long.
fn base() -> Settings {
    Settings { n_fe: 2, max_iter: 120, max_time: 3.0, adapt_rounds: 2, adapt_elements: 60, ..Settings::default() }
}

/// Both ends of the range, and what is next to an open one.
fn ends(o: &OptionInfo) -> Vec<Value> {
    let end = |b: Bound, inward: f64| match b {
        Bound::Closed(v) => vec![v],
        // the next numbers: denormal beside zero, the largest beside infinity
        Bound::Open(0.0) => vec![5e-324, 1e-310, 1e-200],
        Bound::Open(v) if v.is_infinite() => vec![f64::MAX.copysign(v), 1e100_f64.copysign(v)],
        Bound::Open(v) => vec![v + inward * f64::EPSILON * v.abs()],
    };
    let mut all = end(o.min, 1.0);
    all.extend(end(o.max, -1.0));
    if o.min.value() == 0.0 && o.kind == Kind::Float && o.contains(5e-324) {
        all.push(5e-324);
    }
    match o.kind {
        Kind::Float => all.into_iter().map(Value::Float).collect(),
        _ => all.into_iter().map(|v| Value::Int(v as i64)).collect(),
    }
}

/// Settings with one option at an end of its range, and what they are called.
fn settings() -> Vec<(String, Settings)> {
    let mut all = Vec::new();
    for o in OPTIONS.iter().filter(|o| !matches!(o.kind, Kind::Enum(_))) {
        for value in ends(o) {
            for relaxation in [Relaxation::Scholtes, Relaxation::L1Penalty] {
                let mut s = base();
                s.set_by_name(o.name, value.clone()).unwrap();
                // what belongs together
                s.sigma_min = s.sigma_min.min(s.sigma_init);
                s.relaxation = relaxation as i64;
                if o.name == "accuracy_tol" || o.name.starts_with("adapt") {
                    s.adapt_tol = if o.name == "adapt_tol" { s.adapt_tol } else { 1e-3 };
                }
                // a limit that is lifted is not what is tried here
                (s.max_time, s.max_iter) = (s.max_time.min(3.0), s.max_iter.min(200));
                // another number of elements or stage points is another problem: as large as it is cheap
                (s.n_fe, s.adapt_elements) = (s.n_fe.min(40), s.adapt_elements.min(60));
                if relaxation == Relaxation::L1Penalty && o.setup_only {
                    continue;
                }
                all.push((format!("{} = {value:?}, {}", o.name, relaxation.name()), s));
            }
        }
    }
    all
}

#[test]
fn control_problems() {
    control_problems_with(0);
}

#[test]
fn control_problems_with_other_settings() {
    control_problems_with(1);
}

/// With every second of the settings from this one on: two tests run beside each other.
fn control_problems_with(first_of: usize) {
    let sys = models::switching('b');
    let mut ocp = Ocp::new(&sys, 2.0, 2, &base()).unwrap();
    let d = sys.dims();
    let square = |at: &switchback::func::Point, o: &mut [f64]| o[0] = at.x[0] * at.x[0];
    let f = models::smooth(
        "M",
        d,
        1,
        square,
        &[(0, 0)],
        |at, o| o[0] = 2.0 * at.x[0],
        &[(0, 0)],
        |_, w, o| o[0] = 2.0 * w[0],
    );
    ocp.set_mayer(f).unwrap();
    ocp.set_x0_bounds(&[-0.5], &[0.4]).unwrap();
    let first = ocp.solve(&mut Control::default()).unwrap().clone();
    assert_eq!(first.outcome, Outcome::Solved, "{}", first.message);
    for (what, s) in settings().into_iter().skip(first_of).step_by(2) {
        ocp.set_settings(&s).unwrap();
        match ocp.solve(&mut Control::default()) {
            Ok(r) => assert!(r.outcome == Outcome::Solved || !r.message.is_empty(), "{what}: {:?} unsaid", r.outcome),
            Err(e) => assert!(e.to_string().len() > 20, "{what}: {e}"),
        }
    }
    ocp.set_settings(&base()).unwrap();
    let last = ocp.solve(&mut Control::default()).unwrap();
    assert_eq!((last.cost.to_bits(), last.stats.iterations), (first.cost.to_bits(), first.stats.iterations));
}

#[test]
fn simulations() {
    for case in ['b', 'c'] {
        let sys = models::switching(case);
        for (what, s) in settings().into_iter().filter(|s| s.1.relaxation == Relaxation::Scholtes as i64) {
            // by finite elements of either kind: with the planned active sets, and by the homotopy alone
            for polish in [s.polish, 0] {
                let s = Settings { polish, max_iter: s.max_iter.min(80), n_fe: s.n_fe.min(12), ..s };
                let mut sim = match Simulator::new(&sys, &s) {
                    Ok(sim) => sim,
                    Err(e) => {
                        assert!(e.to_string().len() > 20, "{what}: {e}");
                        continue;
                    }
                };
                sim.set_state(0.0, &[-0.5]).unwrap();
                let r = sim.run(2.0, 2, &mut Control::default()).unwrap();
                if r.outcome == Outcome::Solved {
                    let exact = if case == 'c' { 0.5 } else { 0.0 };
                    let tol = if s.n_s == 1 || polish == 0 { 0.5 } else { 0.1 };
                    assert!((sim.state()[0] - exact).abs() < tol, "{what}: ends at {}", sim.state()[0]);
                }
            }
        }
    }
}

#[test]
fn programs() {
    let problems = textbook::all();
    let chosen = ["ralph1", "scholtes3", "bard1", "desilva", "gauvin"];
    let small: Vec<_> =
        problems.iter().filter(|p| chosen.contains(&p.name.as_str()) || p.name.contains("hs071")).collect();
    assert!(small.len() >= 3, "{:?}", problems.iter().map(|p| &p.name).collect::<Vec<_>>());
    for (what, s) in settings() {
        for p in &small {
            let (mut lifted, bounds) = p.lifted();
            let w0 = lifted.start(&p.starts[0]);
            let own = MpccSettings::from(&s);
            let first = MpccSettings { relaxation: own.relaxation, ..MpccSettings::default() };
            let mut solver = MpccSolver::new(&mut lifted, first).unwrap();
            solver.settings = own;
            solver.solve(&mut lifted, &bounds, &w0, &mut Control::default());
            solver.settings = first;
            let again = solver.solve(&mut lifted, &bounds, &w0, &mut Control::default()).objective.to_bits();
            let mut fresh = MpccSolver::new(&mut lifted, solver.settings).unwrap();
            let new = fresh.solve(&mut lifted, &bounds, &w0, &mut Control::default()).objective.to_bits();
            assert_eq!(again, new, "{what}: {} after a solve at the end of the range", p.name);
        }
    }
}

/// What the layers take is that of the settings, also where the layer has another name for it.
#[test]
fn options_arrive_in_the_layers() {
    let mut s = Settings::default();
    for (name, value) in [
        ("integration", "radau5"),
        ("rtol", "1e-5"),
        ("atol", "1e-6"),
        ("h_init", "0.1"),
        ("h_max", "0.5"),
        ("max_steps", "7"),
        ("max_switches", "8"),
        ("zeno", "time_stepping"),
        ("ambiguity", "prefer"),
        ("selection", "norm"),
        ("dense", "on"),
        ("sensitivity", "on"),
        ("adjoint", "on"),
        ("max_iter", "11"),
        ("max_soc", "2"),
        ("restore_tiny", "off"),
        ("polish", "off"),
        ("homotopy", "outer"),
        ("ordering", "natural"),
    ] {
        s.set_by_name(name, value).unwrap();
    }
    let o = event::Options::from(&s);
    assert_eq!((&o.rtol[..], &o.atol[..], o.h0, o.h_max), (&[1e-5][..], &[1e-6][..], 0.1, 0.5));
    assert_eq!((o.method, o.max_steps, o.max_log), (event::Method::Radau5, 7, 8));
    assert_eq!((o.zeno, o.ambiguity), (event::Zeno::TimeStepping, event::Ambiguity::Prefer));
    assert_eq!((o.dense, o.adjoint, o.selection), (true, true, event::Selection::Norm));
    assert_eq!(o.sensitivity, event::Sensitivity::On);
    let m = MpccSettings::from(&s);
    assert_eq!((m.max_iter, m.max_soc, m.restore_tiny, m.polish), (11, 2, false, false));
    assert_eq!((m.homotopy, m.ordering), (Homotopy::Outer, Ordering::Natural));
    let ipm = m.ipm();
    assert_eq!((ipm.max_iter, ipm.max_soc, ipm.restore_tiny, ipm.ordering), (11, 2, false, Ordering::Natural));
    let mut first = switchback::nlp::IpmSettings::default();
    m.update_ipm(&mut first);
    assert_eq!((first.max_iter, first.max_soc, first.restore_tiny, first.ordering), (11, 2, false, Ordering::Amd));
}
