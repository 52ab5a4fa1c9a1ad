//! Answers do not depend on the units a model is written in.

use num_rational::BigRational;
use num_traits::{Signed, Zero};
use switchback::event::{Engine, Options, Outcome};
use switchback::expr::{Expr, Graph};
use switchback::func::{Function, Point};
use switchback::model::{Built, Model, NoteKind};
use switchback::system::Regions;

#[path = "../examples/report/expression_models.rs"]
mod expression_models;
#[path = "common/gallery.rs"]
mod gallery;
#[path = "../examples/report/models.rs"]
mod models;
#[path = "common/units.rs"]
mod units;

use units::{scaled, Units};

/// Numbers without order, the same every time.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % n as u64) as usize
    }

    fn in_unit(&mut self) -> f64 {
        self.below(1 << 30) as f64 / (1u64 << 30) as f64
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }
}

/// `2^±40` and `10^±12`, and none.
const FACTORS: [f64; 6] = [1.0, 1.0, 1_099_511_627_776.0, 1.0 / 1_099_511_627_776.0, 1e12, 1e-12];

fn built(name: &str, g: &Graph, rhs: &[Expr]) -> Built {
    Model::from_rhs(name, 0, 1, rhs).and_then(|m| m.build(g)).unwrap()
}

/// Models whose reduction has something to do.
fn reduced() -> Vec<Built> {
    let g = Graph::new();
    let (x, y, p) = (g.x(0), g.x(1), g.p(0));
    let ladder = (0..10).fold(g.constant(0.0), |v, k| (x - 0.1 * f64::from(k)).gt(0.0).select(v + 1.0, 2.0 * v));
    let rings = (0..4).fold(y, |v, k| (x * x + y * y).gt(f64::from(k + 1)).select(v * 0.5, v + f64::from(k)));
    let lines = (x - 1.0).gt(0.0).select((y - 1.0).gt(0.0).select(x, 1.0), (x + y - 2.0).gt(0.0).select(y, 2.0));
    let never = (x.powi(4) + y.exp()).sign() + (x.sin() - 3.0).sign() * y;
    vec![
        built("ladder", &g, &[ladder, -x]),
        built("rings", &g, &[rings, -x]),
        built("lines", &g, &[lines, -x]),
        built("never", &g, &[never, x.clip(-1.0, 1.0) + y.dead_zone(0.25) * p]),
        built("network", &g, &[((x - y).abs() - 1.0).max(0.0) - (x + y).abs().min(2.0), (x.max(y) - p).sign()]),
    ]
}

fn all_models() -> Vec<Built> {
    use expression_models as e;
    let mut all = vec![
        e::oscillator(),
        e::sliding_mode(),
        e::blocks(),
        e::coulomb(),
        e::zeno(),
        e::stick_slip(),
        e::arm(),
        gallery::turbo_car().1,
        gallery::two_genes().1,
        gallery::relay_feedback().1,
        gallery::tank_cascade().1,
        gallery::motor().1,
    ];
    all.extend(['a', 'b', 'c', 'd'].map(e::switching));
    all.extend(reduced());
    all
}

fn evaluate(f: &dyn Function, at: &Point) -> Option<Vec<f64>> {
    let (mut out, mut work) = (vec![0.0; f.n_out()], vec![0.0; f.work_len()]);
    f.value(at, &mut out, &mut work).ok().map(|()| out)
}

/// Right-hand side of the region a point is in; none on a boundary, or where something is not defined.
fn rhs_at(b: &Built, at: &Point) -> Option<Vec<f64>> {
    let mut out = match b.system.f0() {
        Some(f) => evaluate(f.as_ref(), at)?,
        None => vec![0.0; at.x.len()],
    };
    for s in b.system.subsystems() {
        let Regions::Signs { psi, signs } = &s.regions else { return None };
        let (psi, modes) = (evaluate(psi.as_ref(), at)?, evaluate(s.modes.as_ref(), at)?);
        let holds = |i: &usize| (0..psi.len()).all(|j| f64::from(signs[i * psi.len() + j]) * psi[j] >= 0.0);
        let inside: Vec<usize> = (0..s.n_modes).filter(holds).collect();
        let &[mode] = &inside[..] else { return None };
        for (r, &state) in s.rows.iter().enumerate() {
            out[state] += modes[mode * s.rows.len() + r];
        }
    }
    Some(out)
}

/// What the reduction decides: states, switching functions, regions, modes and cells of every group, and how many remarks
/// of what kind. The order of groups and the signs of switching functions follow the order of writing, which other units
/// change.
fn structure(b: &Built) -> String {
    let of = |g: &switchback::model::Group| {
        let zeros = g.signs.iter().filter(|s| **s == 0).count();
        let n_psi = g.switching_functions.len();
        format!("{:?}: {n_psi} {} {} {} {zeros}", g.states, g.n_regions, g.n_modes, g.n_cells)
    };
    let mut groups: Vec<String> = b.report.groups.iter().map(of).collect();
    groups.sort();
    let notes = [NoteKind::Dropped, NoteKind::Merged, NoteKind::Warning].map(|k| b.report.notes_of(k).count());
    format!("{groups:?} {notes:?} {}", b.report.n_smooth)
}

/// The same modes, switching functions and values in units that are powers of two or of ten.
#[test]
fn reduction_does_not_depend_on_units() {
    let mut n = Numbers(12);
    let (mut compared, mut tried) = (0, 0);
    for b in all_models() {
        let nx = b.dims.x;
        for round in 0..8 {
            let mut units = Units::same(nx);
            units.x.iter_mut().for_each(|x| *x = n.pick(&FACTORS));
            if round > 1 {
                units.t = n.pick(&FACTORS);
                units.p = n.pick(&FACTORS);
                units.psi = n.pick(&FACTORS);
            }
            let other = scaled(&b, &units);
            assert_eq!(
                structure(&b),
                structure(&other),
                "{} in {units:?}\n{}\n{}",
                b.report.name,
                b.report,
                other.report
            );
            for _ in 0..6 {
                let x: Vec<f64> = (0..nx).map(|_| 6.0 * n.in_unit() - 3.0).collect();
                let (u, p, t) = (vec![0.3; b.dims.u], vec![0.7; b.dims.p], 1.3);
                let here = rhs_at(&b, &Point { t, x: &x, u: &u, p: &p });
                let x: Vec<f64> = x.iter().zip(&units.x).map(|(x, f)| x / f).collect();
                let p: Vec<f64> = p.iter().map(|p| p / units.p).collect();
                let there = rhs_at(&other, &Point { t: t / units.t, x: &x, u: &u, p: &p });
                tried += 1;
                let (Some(here), Some(there)) = (here, there) else { continue };
                compared += 1;
                for i in 0..nx {
                    let (a, b) = (here[i], there[i] * units.x[i] / units.t);
                    assert!((a - b).abs() < 1e-10 * (1.0 + a.abs()), "state {i}: {a} {b} in {units:?}");
                }
            }
        }
    }
    assert!(2 * compared > tried, "{compared} of {tried} points were compared");
}

/// Values of all modes of the only state, whatever the regions are.
fn values(b: &Built) -> Vec<f64> {
    let at = Point { t: 0.0, x: &[0.5, 0.25], u: &[], p: &[0.0] };
    let base = b.system.f0().and_then(|f| evaluate(f.as_ref(), &at)).map_or(0.0, |v| v[0]);
    match b.system.subsystems() {
        [] => vec![base],
        [s] => evaluate(s.modes.as_ref(), &at).unwrap().iter().step_by(s.rows.len()).map(|v| v + base).collect(),
        _ => panic!("one group expected"),
    }
}

/// A model with the value `Σ 2^k [ψ_k > 0]`: every sign pattern has a value of its own.
fn numbered(g: &Graph, psi: &[Expr]) -> Built {
    let zero = g.constant(0.0);
    let code = psi.iter().enumerate().fold(zero, |v, (k, &psi)| psi.gt(0.0).select(v + f64::from(1u32 << k), v));
    built("patterns", g, &[code, g.constant(1.0)])
}

fn exact(v: f64) -> BigRational {
    BigRational::from_float(v).unwrap()
}

/// A polynomial in two variables: coefficient and powers of every term.
type Polynomial = Vec<(f64, i32, i32)>;

fn expression<'g>(g: &'g Graph, p: &Polynomial) -> Expr<'g> {
    let (x, y) = (g.x(0), g.x(1));
    let term = |&(c, i, j): &(f64, i32, i32)| match (i, j) {
        (0, 0) => g.constant(c),
        _ => g.constant(c) * x.powi(i) * y.powi(j),
    };
    p.iter().map(term).sum()
}

fn value(p: &Polynomial, x: &BigRational, y: &BigRational) -> BigRational {
    p.iter().map(|&(c, i, j)| exact(c) * x.pow(i) * y.pow(j)).sum()
}

/// The number of the pattern of these values; none on a boundary.
fn code(values: &[BigRational]) -> Option<f64> {
    let bit = |(k, v): (usize, &BigRational)| {
        if v.is_zero() {
            None
        } else {
            Some(f64::from(u8::from(v.is_positive())) * f64::from(1u32 << k))
        }
    };
    values.iter().enumerate().map(bit).sum()
}

/// No sign pattern that a point has, evaluated exactly, is ever left out.
#[test]
fn no_pattern_that_occurs_is_dropped() {
    let mut n = Numbers(77);
    for case in 0..150 {
        let (a, b) = (n.pick(&FACTORS), n.pick(&FACTORS));
        let k = 1 + n.below(4);
        let psi: Vec<Polynomial> = (0..k)
            .map(|_| {
                let row = n.pick(&FACTORS);
                let mut p: Polynomial = Vec::new();
                for (i, j) in [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (4, 0), (0, 3)] {
                    if n.below(3) == 0 || ((i, j) == (0, 0) && n.below(2) == 0) {
                        let c = if n.below(2) == 0 { (n.below(9) as f64) - 4.0 } else { 4.0 * n.in_unit() - 2.0 };
                        if c != 0.0 {
                            p.push((c * row * a.powi(i) * b.powi(j), i, j));
                        }
                    }
                }
                p.push((row * b, 0, 1));
                p.sort_by_key(|t| (t.1, t.2));
                p.dedup_by_key(|t| (t.1, t.2));
                p
            })
            .collect();
        let g = Graph::new();
        let exprs: Vec<Expr> = psi.iter().map(|p| expression(&g, p)).collect();
        let found = values(&numbered(&g, &exprs));
        for _ in 0..60 {
            let size = 10f64.powi(n.below(7) as i32 - 3);
            let (x, y) = (size * (2.0 * n.in_unit() - 1.0) / a, size * (2.0 * n.in_unit() - 1.0) / b);
            let at: Vec<BigRational> = psi.iter().map(|p| value(p, &exact(x), &exact(y))).collect();
            if let Some(code) = code(&at) {
                assert!(found.contains(&code), "case {case}: {psi:?} at {x:e}, {y:e} is {code}, not among {found:?}");
            }
        }
    }
}

/// Lines in the plane have exactly the cells an arrangement of lines has: every cell touches a point where two lines
/// meet, so the four sides of all these points are all of them.
#[test]
fn lines_have_the_cells_of_their_arrangement() {
    let mut n = Numbers(5);
    for case in 0..120 {
        let (a, b) = (n.pick(&FACTORS), n.pick(&FACTORS));
        let k = 2 + n.below(4);
        let lines: Vec<[f64; 3]> = (0..k)
            .map(|i| {
                let row = n.pick(&FACTORS);
                let whole = n.below(2) == 0;
                let mut c = || if whole { n.below(7) as f64 - 3.0 } else { 4.0 * n.in_unit() - 2.0 };
                let (p, q, r) = (c(), c(), c());
                // the first two meet
                let (p, q) =
                    if i < 2 { (if i == 0 { 1.5 } else { p }, if i == 0 { 0.0 } else { 2.5 }) } else { (p, q) };
                [p * row * a, q * row * b, r * row]
            })
            .collect();
        if lines.iter().any(|l| l[0] == 0.0 && l[1] == 0.0) {
            continue;
        }
        let g = Graph::new();
        let exprs: Vec<Expr> = lines.iter().map(|l| l[0] * g.x(0) + l[1] * g.x(1) + l[2]).collect();
        let mut found = values(&numbered(&g, &exprs));
        let mut cells: Vec<f64> = Vec::new();
        let mut general = true;
        let q: Vec<[BigRational; 3]> = lines.iter().map(|l| l.map(exact)).collect();
        for i in 0..k {
            for j in 0..i {
                let det = &q[i][0] * &q[j][1] - &q[i][1] * &q[j][0];
                if det.is_zero() {
                    // parallel lines count, equal ones do not
                    general &= !(&q[i][0] * &q[j][2] - &q[i][2] * &q[j][0]).is_zero()
                        || !(&q[i][1] * &q[j][2] - &q[i][2] * &q[j][1]).is_zero();
                    continue;
                }
                let x = (&q[i][1] * &q[j][2] - &q[i][2] * &q[j][1]) / &det;
                let y = (&q[i][2] * &q[j][0] - &q[i][0] * &q[j][2]) / &det;
                let at: Vec<BigRational> = q.iter().map(|l| &l[0] * &x + &l[1] * &y + &l[2]).collect();
                general &= at.iter().filter(|v| v.is_zero()).count() == 2;
                if !general {
                    break;
                }
                for side in 0..4 {
                    let mut near = at.clone();
                    near[i] = exact(if side & 1 == 0 { 1.0 } else { -1.0 });
                    near[j] = exact(if side & 2 == 0 { 1.0 } else { -1.0 });
                    cells.extend(code(&near));
                }
            }
        }
        if !general {
            continue;
        }
        cells.sort_by(f64::total_cmp);
        cells.dedup();
        found.sort_by(f64::total_cmp);
        assert_eq!(found, cells, "case {case}: {lines:?}");
    }
}

/// The end of a simulation; the absolute tolerances are in the units of the states, whose `sizes` are given.
fn simulate(b: &Built, x0: &[f64], sizes: &[f64], t: f64) -> Result<Vec<f64>, String> {
    let atol = sizes.iter().map(|s| 1e-10 * s).collect();
    let options = Options { rtol: vec![1e-10], atol, ..Options::default() };
    let mut e = Engine::new(&b.system, &options).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.advance(t).unwrap();
    let run = e.into_run();
    match run.outcome {
        Outcome::Reached => Ok(run.x),
        other => Err(format!("{other:?}: {}", run.reason)),
    }
}

/// Thresholds of ten or twelve digits are switches.
#[test]
fn large_thresholds_are_kept() {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let all = [
        x - 1e10,
        x - 1e11,
        x * 1e-6 - 1e5,
        x * x + y * y - 1e12,
        x.powi(3) - 1e12,
        x.powi(4) - 1e12,
        x.powi(4) * 5.670_374_419e-8 - 1e300,
    ];
    for psi in all {
        let b = built("m", &g, &[psi.sign(), 0.0 * x]);
        assert_eq!(b.report.n_switching_functions(), 1, "{}", b.report);
        assert_eq!(b.report.notes_of(NoteKind::Dropped).count(), 0, "{}", b.report);
    }
}

/// Heating at 1900 a second below 1000, at 100 above: the switch of the law of radiation is at `x⁴ = 1e12`.
#[test]
fn a_radiation_law_switches() {
    let g = Graph::new();
    let x = g.x(0);
    let b = built("radiation", &g, &[1e3 - 900.0 * (x.powi(4) - 1e12).sign()]);
    let exact = 1000.0 + (1.0 - 1000.0 / 1900.0) * 100.0;
    let end = simulate(&b, &[0.0], &[1e3], 1.0).unwrap()[0];
    assert!((end - exact).abs() < 1e-8 * exact, "{end}, not {exact}");
}

/// A model nobody would write in these units but for the people of its field: state, time, and the exact end.
struct Field {
    built: Built,
    x0: Vec<f64>,
    t: f64,
    end: f64,
}

fn fields() -> Vec<Field> {
    let mut all = Vec::new();
    let mut add = |name: &str, rhs: &dyn Fn(&Graph) -> Vec<f64>, make: &dyn Fn(&Graph) -> Built, t: f64, end: f64| {
        let g = Graph::new();
        let built = make(&g);
        assert_eq!(built.report.n_switching_functions(), 1, "{name}: {}", built.report);
        all.push(Field { built, x0: rhs(&g), t, end });
    };
    // A salt precipitates where the product of two concentrations is above 1.8e-33.
    let end = 6e-17 + 1.5 * 3e-17;
    add(
        "precipitation",
        &|_| vec![0.0, 3e-17],
        &|g| {
            let (c, d) = (g.x(0), g.x(1));
            built("precipitation", g, &[4e-17 - (c * d).gt(1.8e-33).select(1e-17, 0.0), 0.0 * c])
        },
        3.0,
        end,
    );
    // Debts of a state with interest, repaid above 60 percent of its product.
    let t1 = (10.0f64 / 9.5).ln() / 0.05;
    let end = 4e12 * (0.05 * (3.0 - t1)).exp() + 2e12;
    add(
        "debts",
        &|_| vec![5.5e12, 1e13],
        &|g| {
            let (debt, product) = (g.x(0), g.x(1));
            built("debts", g, &[0.05 * debt + debt.gt(0.6 * product).select(-1e11, 2e11), 0.0 * debt])
        },
        3.0,
        end,
    );
    // The wind of a star is slower behind its shock; metres and seconds.
    add("wind", &|_| vec![1e17], &|g| built("wind", g, &[g.x(0).gt(4.6e17).select(1.5e5, 4.5e5)]), 1.2e12, 5.2e17);
    // A femtofarad is charged by a nanoampere until a diode opens.
    let end = 0.7 + 1e-3 * (1.0 - (-1e9f64 * 1.3e-6).exp());
    add(
        "diode",
        &|_| vec![0.0],
        &|g| {
            let v = g.x(0);
            built("diode", g, &[(1e-9 - v.gt(0.7).select(1e-6 * (v - 0.7), 0.0)) / 1e-15])
        },
        2e-6,
        end,
    );
    // Something leaves the sphere of geostationary orbits and is slowed down.
    let at = (1.7778e15f64 - 1e14).sqrt();
    let end = at + 1e3 * (2e4 - at / 3e3);
    add(
        "orbit",
        &|_| vec![0.0, 1e7],
        &|g| {
            let (x, y) = (g.x(0), g.x(1));
            built("orbit", g, &[(x * x + y * y).gt(1.7778e15).select(1e3, 3e3), 0.0 * y])
        },
        2e4,
        end,
    );
    all
}

#[test]
fn models_in_the_units_of_their_fields() {
    let mut wrong = Vec::new();
    for f in fields() {
        let mut sizes = f.x0.clone();
        sizes[0] = f.end;
        match simulate(&f.built, &f.x0, &sizes, f.t) {
            Ok(x) if (x[0] - f.end).abs() < 1e-7 * f.end.abs() => {}
            other => wrong.push(format!("{}: {other:?}, not {:e}", f.built.report.name, f.end)),
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
