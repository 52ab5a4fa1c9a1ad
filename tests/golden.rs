//! What the solver spends on problems of reference, as committed: iterations, factorisations, evaluations, trajectory for
//! trajectory. A difference is not a mistake, but somebody should have meant it. The kernels of programs, of finite elements
//! and of events have to do exactly the work of the record. Searches have a band around it, since a change of their order
//! that finds another way to the solution changes all counts; what they find, and how large the programs are, is exact.
//!
//! `SWB_WRITE_GOLDEN=1 cargo test --test golden` writes the file anew; the difference belongs into the same commit as
//! what causes it.

#[path = "common/contacts.rs"]
#[allow(dead_code)]
mod contacts;
#[path = "../examples/report/models.rs"]
mod models;
#[path = "common/optimal/mod.rs"]
mod optimal;
#[path = "../crates/switchback-mpcc/tests/common/textbook/mod.rs"]
mod textbook;

use std::collections::BTreeMap;
use switchback::event::{self, Options};
use switchback::mpcc::MpccSettings;
use switchback::nlp::{Control, Statistics};
use switchback::ocp::Jumps;
use switchback::settings::{DcsForm, OcpStart, Settings};
use switchback::sim::Simulator;
use switchback::system::System;

/// Named counts of one problem.
type Counts = BTreeMap<String, BTreeMap<String, usize>>;

fn counts(named: &[(&str, usize)]) -> BTreeMap<String, usize> {
    named.iter().map(|&(name, n)| (name.to_string(), n)).collect()
}

fn of(s: &Statistics) -> Vec<(&'static str, usize)> {
    vec![("iterations", s.iterations), ("factorisations", s.factorisations), ("evaluations", s.evaluations)]
}

/// Counts that are equal on every machine: no time, no rounding.
fn measure() -> Counts {
    let mut all = Counts::new();
    for p in textbook::all() {
        for (k, start) in p.starts.iter().enumerate() {
            // the path, also of programs that branch and bound ends without one
            let found = p.solve(MpccSettings { branch_work: 0.0, ..MpccSettings::default() }, start);
            all.insert(format!("textbook {} from start {k}", p.name), counts(&of(&found.solution.stats)));
        }
    }
    for mut p in optimal::all() {
        let homotopy = Settings { ocp_start: OcpStart::Homotopy as i64, ..*p.ocp.settings() };
        p.ocp.set_settings(&homotopy).unwrap();
        let r = p.ocp.solve(&mut Control::default()).unwrap();
        let mut c = of(&r.stats);
        c.extend([("variables", r.dimensions.0), ("rows", r.dimensions.1), ("pairs", r.dimensions.2)]);
        c.push(("switches", r.trajectory.switches.len()));
        all.insert(format!("gallery {}", p.name), counts(&c));
    }
    let scenes = [
        ("example 8.19", contacts::example_819(Jumps::Auto)),
        ("three carts", contacts::three_carts()),
        ("ball in cup", contacts::ball_in_cup()),
    ];
    for (name, mut ocp) in scenes {
        let r = ocp.solve(&mut Control::default()).unwrap();
        let mut c = of(&r.stats);
        c.extend([("variables", r.dimensions.0), ("rows", r.dimensions.1), ("pairs", r.dimensions.2)]);
        c.push(("impacts", r.contacts.as_ref().map_or(0, |c| c.impacts.len())));
        all.insert(format!("contacts {name}"), counts(&c));
    }
    for (name, sys, x0, t_end, n) in simulated() {
        for form in [DcsForm::Stewart, DcsForm::Heaviside] {
            let set = Settings { n_s: 3, n_fe: 3, dcs_form: form as i64, ..Settings::default() };
            let mut s = Simulator::new(&sys, &set).unwrap();
            s.set_state(0.0, &x0).unwrap();
            let r = s.run(t_end, n, &mut Control::default()).unwrap();
            let mut c = of(&r.stats);
            c.extend([("homotopies", r.homotopies), ("elements", r.trajectory.elements.len())]);
            c.extend([("steps", r.steps), ("switches", r.trajectory.switches.len())]);
            all.insert(format!("fesd {name} {}", form.name()), counts(&c));
        }
        let r = event::simulate(&sys, &Options::with_tolerance(1e-9, 1e-9), 0.0, &x0, t_end).unwrap();
        let c = [("steps", r.stats.steps), ("evaluations", r.stats.evaluations), ("switches", r.stats.switches)];
        all.insert(format!("event {name}"), counts(&c));
    }
    all
}

/// Name, system, initial state, duration, steps.
fn simulated() -> Vec<(&'static str, System, Vec<f64>, f64, usize)> {
    vec![
        ("oscillator", models::oscillator(), models::OSCILLATOR_X0.to_vec(), models::PI / 2.0, 10),
        ("crossing", models::switching('a'), vec![-1.0], 2.0, 7),
        ("sliding", models::switching('b'), vec![-0.5], 2.0, 7),
        ("leaving", models::switching('c'), vec![-0.5], 2.0, 7),
        ("blocks", models::blocks(), vec![-1.0, 1.0, -1.0, -1.0, 1.0, 1.0], 12.0, 60),
        ("coulomb", models::coulomb(), vec![1.0, 0.2], 20.0, 50),
    ]
}

/// Counts of these are the work of a search.
const SEARCHES: &str = "contacts ";
const WORK: [&str; 3] = ["iterations", "factorisations", "evaluations"];
/// By which factor a search may do less or more work than recorded. The orders in which a search tries as many neighbours differ
/// by less; what costs more than this is slower, whatever the order.
const BAND: usize = 2;

/// Whether counts of a problem are those of the record.
fn agrees(name: &str, recorded: &BTreeMap<String, usize>, found: &BTreeMap<String, usize>) -> bool {
    recorded.len() == found.len()
        && recorded.iter().all(|(what, &before)| {
            let searched = name.starts_with(SEARCHES) && WORK.contains(&what.as_str());
            found.get(what).is_some_and(|&now| {
                if searched {
                    now <= BAND * before && before <= BAND * now
                } else {
                    now == before
                }
            })
        })
}

#[test]
fn the_bands_are_for_the_work_of_searches_alone() {
    let record = counts(&[("iterations", 100), ("variables", 7)]);
    let agree = |name, found: &[(&str, usize)]| agrees(name, &record, &counts(found));
    assert!(
        agree("contacts a", &[("iterations", 50), ("variables", 7)])
            && agree("contacts a", &[("iterations", 200), ("variables", 7)])
    );
    assert!(
        !agree("contacts a", &[("iterations", 49), ("variables", 7)])
            && !agree("contacts a", &[("iterations", 201), ("variables", 7)])
    );
    assert!(
        !agree("contacts a", &[("iterations", 100), ("variables", 8)]) && !agree("contacts a", &[("iterations", 100)])
    );
    assert!(
        !agree("event a", &[("iterations", 101), ("variables", 7)])
            && agree("event a", &[("iterations", 100), ("variables", 7)])
    );
}

#[test]
fn the_work_is_that_of_the_record() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/golden.json");
    let found = measure();
    if std::env::var_os("SWB_WRITE_GOLDEN").is_some() {
        std::fs::write(path, serde_json::to_string_pretty(&found).unwrap() + "\n").unwrap();
    }
    let recorded: Counts = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut differences = Vec::new();
    for name in recorded.keys().chain(found.keys().filter(|k| !recorded.contains_key(*k))) {
        let (before, now) = (recorded.get(name), found.get(name));
        if !before.zip(now).is_some_and(|(before, now)| agrees(name, before, now)) {
            differences.push(format!("{name}: recorded {before:?}, now {now:?}"));
        }
    }
    assert!(
        differences.is_empty(),
        "the solver does other work than recorded (SWB_WRITE_GOLDEN=1 writes the record anew):\n{}",
        differences.join("\n")
    );
}
