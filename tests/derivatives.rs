//! Jacobian and Hessian of the discretised problem against differences, for every option, with a model whose
//! functions all depend on states, controls, parameters and time.

mod common;
use common::models::add_sides;
use common::*;
use std::sync::Arc;
use switchback::dcs::{Dcs, FormOptions};
use switchback::fesd::{Boundary, Durations, Fesd, Options, PathAt, PathConstraint, Spec, Terminal};
use switchback::func::{check_derivatives, Callback, CheckSettings, Dims, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::mpcc::Mpcc;
use switchback::nlp::Nlp;
use switchback::settings::{Cross, DcsForm, RkFamily, Settings, StageForm, StepEquilibration};
use switchback::system::{Inclusion, Regions, SetValued, SharedFunction, Subsystem, System};

const DIMS: Dims = Dims { x: 2, u: 1, p: 2 };

/// Numbers in [−1, 1] that look random and are always the same.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    fn take(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }
}

/// `a'z + z'Bz/2 + sin d'z` with full derivatives, `z = (x, u, p, t)`; without `timed` no dependence on `t`.
fn general(seed: u64, n_out: usize, timed: bool) -> SharedFunction {
    general_of(DIMS, seed, n_out, timed)
}

fn general_of(dims: Dims, seed: u64, n_out: usize, timed: bool) -> SharedFunction {
    let n = dims.n_in() - usize::from(!timed);
    let mut r = Numbers(seed);
    let terms: Vec<(Vec<f64>, Vec<f64>, Vec<f64>)> = (0..n_out)
        .map(|_| {
            let (a, mut b, d) = (r.take(n), r.take(n * n), r.take(n));
            for i in 0..n {
                for j in 0..i {
                    b[i * n + j] = b[j * n + i];
                }
            }
            (a, b, d)
        })
        .collect();
    let terms = Arc::new(terms);
    let z = move |at: &Point| -> Vec<f64> {
        let all = at.x.iter().chain(at.u).chain(at.p).chain(std::iter::once(&at.t));
        all.take(n).copied().collect()
    };
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let (t0, t1, t2) = (terms.clone(), terms.clone(), terms);
    let f = Callback::new("general", dims, n_out, move |at, o| {
        let z = z(at);
        for (o, (a, b, d)) in o.iter_mut().zip(t0.iter()) {
            let bz: Vec<f64> = b.chunks(n).map(|row| dot(row, &z)).collect();
            *o = dot(a, &z) + 0.5 * dot(&bz, &z) + dot(d, &z).sin();
        }
        0
    });
    let columns: Vec<usize> = (0..n * n_out).map(|k| k / n_out).collect();
    let rows: Vec<usize> = (0..n * n_out).map(|k| k % n_out).collect();
    let jac = Pattern::from_triplets(n_out, dims.n_in(), &rows, &columns).0;
    let f = f
        .with_jacobian(jac, move |at, o| {
            let z = z(at);
            for (k, (a, b, d)) in t1.iter().enumerate() {
                let c = dot(d, &z).cos();
                for j in 0..n {
                    o[j * n_out + k] = a[j] + dot(&b[j * n..(j + 1) * n], &z) + c * d[j];
                }
            }
            0
        })
        .unwrap();
    let upper: Vec<(usize, usize)> = (0..n).flat_map(|j| (0..=j).map(move |i| (i, j))).collect();
    let hess = models::pattern(dims.n_in(), dims.n_in(), &upper);
    let f = f
        .with_hessian(hess, move |at, w, o| {
            let z = z(at);
            for ((_, b, d), w) in t2.iter().zip(w) {
                let s = dot(d, &z).sin();
                for (o, &(i, j)) in o.iter_mut().zip(&upper) {
                    *o += w * (b[i * n + j] - s * d[i] * d[j]);
                }
            }
            0
        })
        .unwrap();
    Arc::new(f)
}

/// A drift, a subsystem with two modes, one with three of which one is a union of two cells, one with indicators.
fn system(timed: bool) -> System {
    let mut s = System::new(DIMS.x, DIMS.u, DIMS.p).unwrap();
    s.set_f0(general(1, 2, timed)).unwrap();
    add_sides(&mut s, &[1], general(2, 2, timed), general(3, 1, timed));
    s.add_subsystem(Subsystem {
        rows: vec![1, 0],
        modes: general(4, 6, timed),
        n_modes: 3,
        regions: Regions::Signs { psi: general(5, 2, timed), signs: vec![1, 0, -1, 1, -1, -1] },
    })
    .unwrap();
    s.add_subsystem(Subsystem {
        rows: vec![0],
        modes: general(6, 2, timed),
        n_modes: 2,
        regions: Regions::Indicators(general(7, 2, timed)),
    })
    .unwrap();
    s
}

fn spec(set: &Settings, timed: bool) -> Spec {
    spec_of(&system(timed), set, timed)
}

fn spec_of(system: &System, set: &Settings, timed: bool) -> Spec {
    let path = [PathAt::ControlGrid, PathAt::Elements, PathAt::StagePoints].into_iter().enumerate().map(|(k, at)| {
        PathConstraint { f: general(20 + k as u64, 2, timed), lower: vec![-1.0; 2], upper: vec![1.0; 2], at }
    });
    let both = general_of(Dims { x: 2 * DIMS.x, ..DIMS }, 13, 2, timed);
    let dcs = Dcs::new(system, FormOptions::from_settings(set).unwrap()).unwrap();
    let options = Options::from_settings(set).unwrap();
    Spec {
        lagrange: Some(general(10, 1, timed)),
        mayer: Some(general(11, 1, timed)),
        path: path.collect(),
        terminal: vec![Terminal { f: general(12, 2, timed), lower: vec![0.0; 2], upper: vec![0.0; 2] }],
        boundary: vec![Boundary { f: both, lower: vec![0.0; 2], upper: vec![0.0; 2] }],
        ..Spec::new(dcs, options, vec![set.n_fe as usize; 2])
    }
}

fn problem(set: &Settings, timed: bool) -> Fesd {
    let mut p = Fesd::new(spec(set, timed), 0.9).unwrap();
    p.set_params(&[0.3, -0.7]).unwrap();
    p
}

/// Compares every entry, those outside the pattern included.
fn compare(p: &mut Fesd, what: &str) {
    let (n, m) = (p.n(), p.m());
    let mut r = Numbers(99);
    let w: Vec<f64> = (0..n).map(|_| 0.5 + 0.4 * r.next()).collect();
    let y = r.take(m);
    let obj = 0.7;
    let (jp, hp) = (p.jac_pattern().clone(), p.hess_pattern().clone());
    assert!(hp.is_upper());
    let (mut grad, mut jac, mut c) = (vec![0.0; n], vec![0.0; jp.nnz()], vec![0.0; m]);
    p.eval(&w, &mut c).unwrap();
    p.derivatives(&w, &mut grad, &mut jac).unwrap();
    let mut hess = vec![0.0; hp.nnz()];
    p.hessian(&w, obj, &y, &mut hess).unwrap();
    let lagrangian = |p: &mut Fesd, w: &[f64]| -> (f64, Vec<f64>, Vec<f64>) {
        let (mut c, mut g, mut j) = (vec![0.0; m], vec![0.0; n], vec![0.0; jp.nnz()]);
        let f = p.eval(w, &mut c).unwrap();
        p.derivatives(w, &mut g, &mut j).unwrap();
        let gl =
            (0..n).map(|v| obj * g[v] + jp.range(v).zip(jp.rows(v)).map(|(k, &i)| j[k] * y[i]).sum::<f64>()).collect();
        (f, c, gl)
    };
    let e = 1e-5;
    let mut v = w.clone();
    for j in 0..n {
        v[j] = w[j] + e;
        let (fp, cp, gp) = lagrangian(p, &v);
        v[j] = w[j] - e;
        let (fm, cm, gm) = lagrangian(p, &v);
        v[j] = w[j];
        let d = (fp - fm) / (2.0 * e);
        assert!((grad[j] - d).abs() < 1e-7 * (1.0 + d.abs()), "{what}: gradient {j}: {} and {d}", grad[j]);
        for i in 0..m {
            let given = jp.get(i, j).map_or(0.0, |k| jac[k]);
            let d = (cp[i] - cm[i]) / (2.0 * e);
            assert!((given - d).abs() < 1e-7 * (1.0 + d.abs()), "{what}: row {i}, column {j}: {given} and {d}");
        }
        for i in 0..=j {
            let given = hp.get(i, j).map_or(0.0, |k| hess[k]);
            let d = (gp[i] - gm[i]) / (2.0 * e);
            assert!((given - d).abs() < 1e-7 * (1.0 + d.abs()), "{what}: Hessian ({i}, {j}): {given} and {d}");
        }
    }
}

#[test]
fn the_model_functions_are_right() {
    let at = Point { t: 0.4, x: &[0.2, -0.3], u: &[0.7], p: &[0.1, 0.9] };
    for timed in [true, false] {
        let f = general(4, 6, timed);
        let settings = CheckSettings { parameters: true, ..CheckSettings::default() };
        let report = check_derivatives(f.as_ref() as &dyn Function, &at, &settings).unwrap();
        assert!(report.passed(), "{:?}", report.mismatches);
    }
}

/// Every combination of the options for one family.
fn all_options(family: RkFamily, n_s: i64, forms: &[StageForm]) {
    // the forms of equilibration do not know the pairs but through the sums they share
    let equilibrations = |cross| match cross {
        Cross::Element => vec![None, Mean, Difference, EtaProduct, EtaSquared, EtaEquation, EtaSaturated],
        _ => vec![Difference, EtaProduct],
    };
    use StepEquilibration::{Difference, EtaEquation, EtaProduct, EtaSaturated, EtaSquared, Mean, None};
    for &form in forms {
        for cross in [Cross::Element, Cross::Stage, Cross::Point, Cross::Full] {
            for equilibration in equilibrations(cross) {
                let mut set = settings(family, n_s, 2, FESD);
                set.stage_form = form as i64;
                set.cross = cross as i64;
                set.step_equilibration = equilibration as i64;
                let what = format!("{family:?} {n_s}, {form:?}, {cross:?}, {equilibration:?}");
                let mut p = problem(&set, true);
                compare(&mut p, &what);
                p.set_polishing(true);
                compare(&mut p, &format!("{what}, polishing"));
            }
        }
        let mut set = settings(family, n_s, 2, STANDARD);
        set.stage_form = form as i64;
        compare(&mut problem(&set, true), &format!("{family:?} {n_s}, {form:?}, standard"));
    }
    compare(&mut problem(&settings(family, n_s, 3, FESD), false), &format!("{family:?} {n_s} without time"));
}

/// Three switching functions with all eight regions, and an inclusion in two steps.
fn deep(driven: usize) -> System {
    let mut s = System::new(DIMS.x, DIMS.u, DIMS.p).unwrap();
    s.set_f0(general(1, 2, true)).unwrap();
    let signs = (0..8).flat_map(|i| (0..3).map(move |j| if i >> (2 - j) & 1 == 0 { 1 } else { -1 })).collect();
    let regions = Regions::Signs { psi: general(3, 3, true), signs };
    s.add_subsystem(Subsystem { rows: vec![driven], modes: general(2, 8, true), n_modes: 8, regions }).unwrap();
    let f = general_of(Dims { x: DIMS.x + 2, ..DIMS }, 4, 1, true);
    s.add_inclusion(Inclusion { rows: vec![driven], f, psi: general(5, 2, true), set: SetValued::Step }).unwrap();
    add_sides(&mut s, &[driven], general(6, 2, true), general(7, 1, true));
    s
}

#[test]
fn heaviside_form_inclusions_and_algebraic_equations() {
    for (family, n_s, disc) in [(RadauIia, 2, FESD), (GaussLegendre, 2, FESD), (RadauIia, 1, STANDARD)] {
        for form in BOTH {
            for (lift_depth, driven) in [(2, 0), (3, 1)] {
                let mut set = settings(family, n_s, 2, disc);
                (set.stage_form, set.lift_depth, set.dcs_form) = (form as i64, lift_depth, DcsForm::Heaviside as i64);
                let mut s = deep(driven);
                let what = format!("{family:?}, {disc:?}, {form:?}, depth {lift_depth}, row {driven}");
                compare(&mut Fesd::new(spec_of(&s, &set, true), 0.9).unwrap(), &what);
                s.set_algebraic(1, Some(general(8, 1, true))).unwrap();
                compare(&mut Fesd::new(spec_of(&s, &set, true), 0.9).unwrap(), &format!("{what}, algebraic"));
            }
        }
    }
}

const BOTH: [StageForm; 2] = [StageForm::Values, StageForm::Derivatives];

#[test]
fn radau_iia() {
    all_options(RadauIia, 1, &BOTH);
    all_options(RadauIia, 2, &BOTH);
}

#[test]
fn gauss_legendre() {
    all_options(GaussLegendre, 1, &BOTH);
    all_options(GaussLegendre, 2, &BOTH);
}

#[test]
fn stages_at_the_ends() {
    use switchback::settings::RkFamily::{LobattoIiia, LobattoIiib, LobattoIiic, RadauIa};
    for (family, n_s) in [(RadauIa, 1), (RadauIa, 2), (LobattoIiic, 3)] {
        for form in BOTH {
            let set = Settings { stage_form: form as i64, ..settings(family, n_s, 2, FESD) };
            compare(&mut problem(&set, true), &format!("{family:?} {n_s}, {form:?}"));
        }
    }
    for family in [LobattoIiia, LobattoIiib] {
        compare(&mut problem(&settings(family, 3, 2, FESD), true), &format!("{family:?} 3"));
    }
}

#[test]
fn explicit() {
    all_options(Explicit, 1, &[StageForm::Derivatives]);
    all_options(Explicit, 3, &[StageForm::Derivatives]);
}

#[test]
fn other_durations_and_parameters() {
    let mut p = problem(&settings(RadauIia, 2, 2, FESD), true);
    p.set_duration(0.3);
    p.set_params(&[1.5, 0.2]).unwrap();
    compare(&mut p, "changed");
    let mut p = problem(&settings(GaussLegendre, 2, 2, STANDARD), true);
    p.set_duration(0.3);
    compare(&mut p, "changed, standard");
}

/// Linear controls, parameters that are variables, stages of different lengths and numbers of elements, lengths that are
/// variables.
#[test]
fn everything_that_can_be_a_variable() {
    for durations in [Durations::Fixed, Durations::Horizon, Durations::Stages] {
        for disc in [FESD, STANDARD] {
            for (gamma_h, equilibration) in [(1.0, StepEquilibration::Difference), (0.5, StepEquilibration::Mean)] {
                for form in BOTH {
                    let mut set = settings(GaussLegendre, 2, 2, disc);
                    (set.gamma_h, set.stage_form) = (gamma_h, form as i64);
                    set.step_equilibration = equilibration as i64;
                    let spec = Spec {
                        n_fe: vec![1, 2],
                        durations,
                        linear: vec![true],
                        free_params: vec![true, false],
                        ..spec(&set, true)
                    };
                    let mut p = Fesd::new(spec, 0.9).unwrap();
                    p.set_durations(&[0.9, 0.4]).unwrap();
                    p.set_params(&[0.3, -0.7]).unwrap();
                    p.set_stage_params(1, &[0.3, 0.2]).unwrap();
                    compare(&mut p, &format!("{durations:?}, {disc:?}, gamma {gamma_h}, {form:?}"));
                }
            }
        }
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let set = settings(RadauIia, 2, 2, FESD);
    let refused = |change: &dyn Fn(&mut Spec)| {
        let mut spec = spec(&set, true);
        change(&mut spec);
        Fesd::new(spec, 1.0).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert!(refused(&|s| s.n_fe = vec![2, 0]).contains("one finite element"));
    assert!(refused(&|s| s.linear = vec![true; 2]).contains("2 entries for the linear controls, expected 1"));
    assert!(refused(&|s| s.free_params = vec![true]).contains("1 entries for the free parameters, expected 2"));
    assert!(refused(&|s| s.boundary[0].f = general(1, 2, true)).contains("expected (4, 1, 2)"));
}
