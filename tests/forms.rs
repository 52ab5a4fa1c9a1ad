//! Stewart's and the Heaviside form of the same problem: the same trajectories, the same switches, the same optimum.

mod common;
use common::models::{self, smooth};
use common::*;
use std::sync::Arc;
use switchback::func::{Callback, Dims};
use switchback::nlp::{Control, Outcome};
use switchback::ocp::Ocp;
use switchback::settings::{DcsForm, Settings};
use switchback::sim::{SimResult, Simulator};
use switchback::system::{Inclusion, Regions, SetValued, Subsystem, System};

fn with(form: DcsForm, set: Settings) -> Settings {
    Settings { dcs_form: form as i64, ..set }
}

/// Simulates in both forms and compares switches and states.
fn agree(sys: &System, set: Settings, x0: &[f64], t_end: f64, n: usize, what: &str) -> [SimResult; 2] {
    let (a, xa) = simulate(sys, &with(DcsForm::Stewart, set), x0, t_end, n);
    let (b, xb) = simulate(sys, &with(DcsForm::Heaviside, set), x0, t_end, n);
    assert!(distance(&xa, &xb) < 1e-9, "{what}: {xa:?} and {xb:?}");
    let log = |r: &SimResult| -> Vec<_> {
        r.trajectory.switches.iter().map(|s| (s.subsystem, s.kind, s.before.clone(), s.after.clone())).collect()
    };
    assert_eq!(log(&a), log(&b), "{what}");
    for (s, h) in a.trajectory.switches.iter().zip(&b.trajectory.switches) {
        assert!((s.t - h.t).abs() < 1e-9, "{what}: switches at {} and {}", s.t, h.t);
    }
    assert!(!a.trajectory.switches.is_empty(), "{what}: nothing switches");
    [a, b]
}

#[test]
fn simulations_agree() {
    for (family, n_s) in [(RadauIia, 2), (RadauIia, 3), (GaussLegendre, 2), (Explicit, 4)] {
        let set = settings(family, n_s, 2, FESD);
        let what = format!("{family:?} {n_s}");
        agree(&models::oscillator(), set, &models::OSCILLATOR_X0, 1.5, 20, &what);
    }
    for case in ['a', 'b', 'c'] {
        let set = settings(RadauIia, 3, 3, FESD);
        agree(&models::switching(case), set, &[-0.9], 2.0, 7, &format!("case {case}"));
    }
    agree(&models::blocks(), settings(RadauIia, 3, 3, FESD), &[-1.0, 1.0, -1.0, 1.0, 1.0, 1.0], 3.0, 30, "blocks");
}

/// Four quadrants with one field each: crossings, then a sliding mode on one axis.
fn quadrants() -> System {
    let d = Dims { x: 2, u: 0, p: 0 };
    let modes = models::affine("F", d, &[1.0, -1.0, 1.0, 0.5, -0.4, -1.0, -0.2, 1.0], &[]);
    let psi = models::affine("psi", d, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
    let mut s = System::new(2, 0, 0).unwrap();
    let regions = Regions::Signs { psi, signs: vec![1, 1, 1, -1, -1, 1, -1, -1] };
    s.add_subsystem(Subsystem { rows: vec![0, 1], modes, n_modes: 4, regions }).unwrap();
    s
}

#[test]
fn regions_of_two_switching_functions_agree() {
    let [r, h] = agree(&quadrants(), settings(RadauIia, 2, 3, FESD), &[-0.5, 0.3], 2.0, 10, "quadrants");
    assert_eq!(r.trajectory.modes, vec![4]);
    // eight weights and multipliers of two switching functions against four regions
    assert_eq!((r.trajectory.elements[0].lambda.len(), h.trajectory.elements[0].lambda.len()), (8, 8));
    assert_eq!((r.trajectory.elements[0].mu.len(), h.trajectory.elements[0].mu.len()), (2, 0));
}

#[test]
fn optima_agree() {
    let solve = |form| {
        let set = with(form, Settings { n_s: 2, n_fe: 3, ..Settings::default() });
        let mut ocp: Ocp = models::sliding_ocp(&set);
        let r = ocp.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved);
        (r.cost, r.trajectory.switches.len())
    };
    let (a, b) = (solve(DcsForm::Stewart), solve(DcsForm::Heaviside));
    assert!((a.0 - b.0).abs() < 1e-8 * a.0, "{a:?} and {b:?}");
    assert_eq!(a.1, b.1);
}

/// `x' = 1 − 2α₁`, `y' = α₁α₂ − ½` as a function of steps; the same as a system of modes.
#[test]
fn an_inclusion_is_the_system_of_its_modes() {
    let d = Dims { x: 2, u: 0, p: 0 };
    let psi = models::affine("psi", d, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
    let f = smooth(
        "f",
        Dims { x: 4, ..d },
        2,
        |at, o| {
            o[0] = 1.0 - 1.5 * at.x[2];
            o[1] = at.x[2] * at.x[3] - 0.5;
        },
        &[(0, 2), (1, 2), (1, 3)],
        |at, o| o.copy_from_slice(&[-1.5, at.x[3], at.x[2]]),
        &[(2, 3)],
        |_, w, o| o[0] = w[1],
    );
    let mut s = System::new(2, 0, 0).unwrap();
    s.add_inclusion(Inclusion { rows: vec![0, 1], f, psi: psi.clone(), set: SetValued::Step }).unwrap();
    let modes = models::affine("F", d, &[-0.5, 0.5, -0.5, -0.5, 1.0, -0.5, 1.0, -0.5], &[]);
    let mut m = System::new(2, 0, 0).unwrap();
    let regions = Regions::Signs { psi, signs: vec![1, 1, 1, -1, -1, 1, -1, -1] };
    m.add_subsystem(Subsystem { rows: vec![0, 1], modes, n_modes: 4, regions }).unwrap();
    let set = settings(RadauIia, 2, 3, FESD);
    let (r, x) = simulate(&s, &set, &[-0.3, 0.4], 1.5, 5);
    let (_, xm) = simulate(&m, &with(DcsForm::Heaviside, set), &[-0.3, 0.4], 1.5, 5);
    // x reaches 0 at 0.3 and stays: α₁ = 2/3; y falls to 0 by −½ and −½ + ⅔ > 0 never lets it
    let exact = [0.0, 0.4 - 0.5 * 0.3 + (2.0 / 3.0 - 0.5) * 1.2];
    assert_near(&x, &exact, 1e-8, "inclusion");
    assert_near(&xm, &exact, 1e-8, "modes");
    // the switching functions of an inclusion are reported as two modes each
    assert_eq!(r.trajectory.modes, vec![2, 2]);
    assert_eq!(r.trajectory.switches.len(), 1);
    assert!((r.trajectory.switches[0].t - 0.3).abs() < 1e-9);
}

#[test]
fn what_inclusions_cannot_do_is_said() {
    let d = Dims { x: 1, u: 0, p: 0 };
    let psi = models::affine("psi", d, &[0.0], &[(0, 0, 1.0)]);
    let wrong = Arc::new(Callback::new("f", d, 1, |_, o| {
        o[0] = 0.0;
        0
    }));
    let mut s = System::new(1, 0, 0).unwrap();
    let e = s
        .add_inclusion(Inclusion { rows: vec![0], f: wrong, psi: psi.clone(), set: SetValued::Step })
        .unwrap_err()
        .to_string();
    assert!(e.contains("expected (2, 0, 0): the states, then one step for each of the 1 switching functions"), "{e}");
    let right = models::affine("f", Dims { x: 2, ..d }, &[1.0], &[(0, 1, -2.0)]);
    s.add_inclusion(Inclusion { rows: vec![0], f: right, psi, set: SetValued::Step }).unwrap();
    let e = switchback::dcs::Dcs::stewart(&s).err().unwrap().to_string();
    assert!(e.contains("have no modes"), "{e}");
    assert!(Simulator::new(&s, &Settings::default()).is_ok());
}
