//! Where programs of a given mode sequence start: states of a motion, with the weights and multipliers that belong to them.

mod common;
use common::*;
use std::sync::Arc;
use switchback::dcs::{Dcs, FormOptions};
use switchback::fesd::{Fesd, Options, Spec};
use switchback::func::{Callback, Dims};
use switchback::mpcc::Side;
use switchback::nlp::Nlp;
use switchback::settings::{DcsForm, Settings};
use switchback::system::{Regions, Subsystem, System};

/// `x₁` where the motion slides along `x₂ = 0`, with weights 1/4 and 3/4: their sum times the modes is `(1.625, 0)`.
const SPEED: f64 = 1.625;

/// Two switching functions, `x₂` and `x₁ + 1`, and four modes: products of weights in Heaviside's form.
fn quadrants() -> System {
    let d = Dims { x: 2, u: 0, p: 0 };
    let psi = Callback::new("psi", d, 2, |at, o| {
        o.copy_from_slice(&[at.x[1], at.x[0] + 1.0]);
        0
    });
    let modes = Callback::new("modes", d, 8, |_, o| {
        o.copy_from_slice(&[0.5, -3.0, 2.0, 1.0, 9.0, 9.0, 7.0, -8.0]);
        0
    });
    let mut s = System::new(2, 0, 0).unwrap();
    let regions = Regions::Signs { psi: Arc::new(psi), signs: vec![1, 1, -1, 1, 1, -1, -1, -1] };
    s.add_subsystem(Subsystem { rows: vec![0, 1], modes: Arc::new(modes), n_modes: 4, regions }).unwrap();
    s
}

fn violation(v: &[f64], lower: &[f64], upper: &[f64]) -> f64 {
    v.iter().zip(lower.iter().zip(upper)).fold(0.0, |m: f64, (v, (l, u))| m.max(l - v).max(v - u))
}

/// The states of a sliding mode alone lead to a point where all equations hold, in both forms.
#[test]
fn weights_of_a_sliding_mode_fit_its_motion() {
    let (n_fe, length) = (2, 0.4);
    for form in [DcsForm::Stewart, DcsForm::Heaviside] {
        let set = Settings { dcs_form: form as i64, ..settings(RadauIia, 3, n_fe, FESD) };
        let dcs = Dcs::new(&quadrants(), FormOptions::from_settings(&set).unwrap()).unwrap();
        let active = dcs.from_regions(&[true, true, false, false]);
        let sides: Vec<Side> = active.iter().map(|a| if *a { Side::First } else { Side::Second }).collect();
        let spec = Spec::new(dcs, Options::from_settings(&set).unwrap(), vec![n_fe as usize]);
        let mut p = Fesd::new(spec, 2.0 * length).unwrap();
        let motion = |t: f64, x: &mut [f64]| x.copy_from_slice(&[SPEED * t, 0.0]);
        let mut bounds = p.bounds();
        p.bound_initial(&mut bounds, &[0.0; 2], &[0.0; 2], 0.0);
        let (mut w, mut c) = (vec![0.0; p.n()], vec![0.0; p.m()]);
        p.guess(&mut w, 0.0, motion, |_, _| ());
        let sides = sides.repeat(2);
        p.guess_active_set(&mut w, 0.0, &[length; 2], &sides, motion);
        p.fit_weights(&mut w, &sides);
        p.eval(&w, &mut c).unwrap();
        let off = violation(&c, &bounds.cl, &bounds.cu).max(violation(&w, &bounds.xl, &bounds.xu));
        // a share of 1e-10 of the equal weights stays
        assert!(off < 1e-9, "{form:?}: {off:e}");
    }
}
