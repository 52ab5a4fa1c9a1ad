//! A solver that has been set up solves without allocating.

#[path = "common/counting.rs"]
mod counting;
use counting::count;

mod common;

use common::models::{sliding_mode, smooth, PI, SLIDING_X0};
use common::*;
use switchback::dcs::Dcs;
use switchback::fesd::{Fesd, Options, Spec, Terminal};
use switchback::mpcc::{MpccSettings, MpccSolver, Polish};
use switchback::nlp::{Control, Nlp, Outcome};
use switchback::settings::{Homotopy, Relaxation, RkFamily, Settings};

fn problem(set: &Settings) -> Fesd {
    let sys = sliding_mode();
    let d = sys.dims();
    let l = smooth(
        "L",
        d,
        1,
        |at, o| o[0] = at.u[0] * at.u[0] + at.u[1] * at.u[1],
        &[(0, 4), (0, 5)],
        |at, o| {
            o[0] = 2.0 * at.u[0];
            o[1] = 2.0 * at.u[1];
        },
        &[(4, 4), (5, 5)],
        |_, w, o| o.fill(2.0 * w[0]),
    );
    let e = models::affine("e", d, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
    let q = vec![-PI / 6.0, -PI / 4.0];
    let (dcs, options) = (Dcs::stewart(&sys).unwrap(), Options::from_settings(set).unwrap());
    let spec = Spec {
        lagrange: Some(l),
        terminal: vec![Terminal { f: e, lower: q.clone(), upper: q }],
        ..Spec::new(dcs, options, vec![set.n_fe as usize; 3])
    };
    Fesd::new(spec, 4.0 / 3.0).unwrap()
}

/// Allocations of a solve of an object that has solved before, and how both ended.
fn second_solve(set: &Settings, settings: MpccSettings) -> (usize, [(Outcome, Polish); 2]) {
    let mut p = problem(set);
    let mut bounds = p.bounds();
    p.bound_initial(&mut bounds, &SLIDING_X0, &SLIDING_X0, 0.0);
    for k in 0..3 {
        p.bound_control(&mut bounds, k, &[-10.0; 2], &[10.0; 2]);
    }
    let mut w = vec![0.0; p.n()];
    p.guess(&mut w, 0.0, |_, x| x.copy_from_slice(&SLIDING_X0), |_, u| u.fill(0.0));
    let mut solver = MpccSolver::new(&mut p, settings).unwrap();
    let first = solver.solve(&mut p, &bounds, &w, &mut Control::default());
    let first = (first.outcome, first.polish);
    let before = count();
    let second = solver.solve(&mut p, &bounds, &w, &mut Control::default());
    let second = (second.outcome, second.polish);
    (count() - before, [first, second])
}

#[test]
fn the_second_solve_allocates_nothing() {
    let cases: [(RkFamily, i64); 3] = [(RadauIia, 2), (GaussLegendre, 2), (Explicit, 2)];
    assert!(count() > 0, "the counter must count");
    for (family, n_s) in cases {
        for disc in [FESD, STANDARD] {
            let set = settings(family, n_s, 3, disc);
            let (n, ended) = second_solve(&set, MpccSettings::default());
            assert_eq!(n, 0, "{family:?} {n_s} {disc:?}: {n} allocations");
            assert_eq!(ended[0], ended[1]);
        }
    }
}

#[test]
fn a_solve_that_is_cut_short_allocates_nothing() {
    for max_iter in [0, 1, 7, 30] {
        let short = MpccSettings { max_iter, ..MpccSettings::default() };
        let (n, _) = second_solve(&settings(RadauIia, 2, 3, FESD), short);
        assert_eq!(n, 0, "max_iter = {max_iter}: {n} allocations");
    }
}

#[test]
fn no_strategy_allocates_in_a_solve() {
    for relaxation in (0..).map_while(Relaxation::from_i64) {
        for homotopy in [Homotopy::Coupled, Homotopy::Outer] {
            let with = MpccSettings { relaxation, homotopy, max_iter: 200, ..MpccSettings::default() };
            let (n, ended) = second_solve(&settings(RadauIia, 2, 3, FESD), with);
            assert_eq!(n, 0, "{relaxation:?} {homotopy:?}: {n} allocations");
            assert_eq!(ended[0], ended[1]);
        }
    }
}
