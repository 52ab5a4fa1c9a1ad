//! What the tests of the whole library share.
#![allow(dead_code)]

#[path = "../../examples/report/models.rs"]
pub mod models;

use switchback::dcs::Dcs;
use switchback::fesd::{Fesd, Options, Spec};
use switchback::nlp::{Control, Outcome};
use switchback::settings::{Discretisation, OcpStart, RkFamily, Settings};
use switchback::sim::{SimResult, Simulator};
use switchback::system::System;

#[allow(unused_imports)]
pub use switchback::settings::Discretisation::{Fesd as FESD, Standard as STANDARD};
#[allow(unused_imports)]
pub use switchback::settings::RkFamily::{Explicit, GaussLegendre, RadauIia};

pub fn settings(family: RkFamily, n_s: i64, n_fe: i64, discretisation: Discretisation) -> Settings {
    let (rk_family, discretisation) = (family as i64, discretisation as i64);
    Settings { rk_family, n_s, n_fe, discretisation, ocp_start: OcpStart::Homotopy as i64, ..Settings::default() }
}

/// Simulates in equal steps and expects that it works.
pub fn simulate(sys: &System, set: &Settings, x0: &[f64], t_end: f64, n: usize) -> (SimResult, Vec<f64>) {
    let mut s = Simulator::new(sys, set).unwrap();
    s.set_state(0.0, x0).unwrap();
    let r = s.run(t_end, n, &mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved, "step {} of {n}, t = {}, {set:?}", r.steps, s.time());
    (r, s.state().to_vec())
}

pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

pub fn assert_near(found: &[f64], exact: &[f64], tol: f64, what: &str) {
    let e = distance(found, exact);
    assert!(e <= tol, "{what}: off by {e:e}, allowed {tol:e}: {found:?}, exact {exact:?}");
}

/// Discretises a system without costs.
pub fn discretise(sys: &System, set: &Settings, n_stages: usize, duration: f64) -> Fesd {
    let (dcs, options) = (Dcs::stewart(sys).unwrap(), Options::from_settings(set).unwrap());
    let spec = Spec::new(dcs, options, vec![set.n_fe as usize; n_stages]);
    Fesd::new(spec, duration).unwrap()
}

/// The same with all starts of the portfolio, of which the best answer is kept.
#[allow(dead_code)]
pub fn from_all_starts(settings: Settings) -> Settings {
    Settings { ocp_start: OcpStart::Portfolio as i64, ..settings }
}
