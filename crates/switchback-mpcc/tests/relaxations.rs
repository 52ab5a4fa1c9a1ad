//! Every relaxation and penalty on programs whose answers and stationary points are known.

#[path = "common/textbook/mod.rs"]
mod textbook;

use switchback_mpcc::mpcc::relaxation::{strategy, SigmaIn, Softness, Strategy};
use switchback_mpcc::mpcc::{Mpcc, MpccSettings, Polish};
use switchback_mpcc::nlp::Outcome;
use switchback_mpcc::settings::{Homotopy, Relaxation};
use textbook::{all, problem, Expect, Found, Problem, Stat, Verdict};

fn relaxations() -> impl Iterator<Item = Relaxation> {
    (0..).map_while(Relaxation::from_i64)
}

const HOMOTOPIES: [Homotopy; 2] = [Homotopy::Coupled, Homotopy::Outer];

/// From the starting points as they are: where a symmetric one decides, it is on purpose.
fn settings(relaxation: Relaxation, homotopy: Homotopy) -> MpccSettings {
    MpccSettings { relaxation, homotopy, centre_pairs: false, max_iter: 1000, ..MpccSettings::default() }
}

/// Solves without the polish: the point is the limit of the strategy.
fn raw(p: &Problem, relaxation: Relaxation, homotopy: Homotopy, start: &[f64]) -> Found {
    p.solve(MpccSettings { polish: false, ..settings(relaxation, homotopy) }, start)
}

/// `½ ‖w − c‖²` over one pair; for `c_0 > c_1 > 0` the minimiser is `(c_0, 0)` with multipliers `(0, −c_1)`.
fn square(c: [f64; 2]) -> Problem {
    problem("square", "", |m| {
        let x = m.positive(&[1.0, 1.0]);
        m.minimise(0.5 * (x[0] - c[0]).sq() + 0.5 * (x[1] - c[1]).sq());
        m.pair(x[0], x[1]);
        m.optimal(0.5 * c[1] * c[1]).at(&[c[0], 0.0], Stat::S).local(&[0.5 * c[0] * c[0]]);
    })
}

/// Problems with strict complementarity, from several starting points. Without any relaxation the interior-point
/// method may stop at a point where linearised constraints have no common solution (thesis, section 2.4.1).
#[test]
fn every_strategy_solves_small_problems() {
    let names = ["jr1", "kth1", "scholtes1", "scholtes5", "bard1", "stackelberg1", "nash1", "df1"];
    let mut problems: Vec<Problem> = all().into_iter().filter(|p| names.contains(&p.name.as_str())).collect();
    assert_eq!(problems.len(), names.len());
    problems.push(square([1.0, 0.25]));
    let mut bad = Vec::new();
    for homotopy in HOMOTOPIES {
        for relaxation in relaxations() {
            for p in &problems {
                // the elastic variable of the outer loop moves too slowly there
                let slow = relaxation == Relaxation::Elastic && homotopy == Homotopy::Outer && p.name == "stackelberg1";
                if slow || relaxation == Relaxation::Direct && p.name == "scholtes1" {
                    continue;
                }
                for start in &p.starts {
                    let found = p.solve(settings(relaxation, homotopy), start);
                    if let Verdict::Fail(why) = p.judge(&found) {
                        bad.push(format!("{relaxation:?} {homotopy:?} {} {start:?}: {why}", p.name));
                    } else if found.solution.polish != Polish::Done {
                        bad.push(format!("{relaxation:?} {homotopy:?} {} {start:?}: not polished", p.name));
                    }
                }
            }
        }
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}

/// Without the polish as well, to the accuracy of its parameter; the multipliers of the pair come out of the rows,
/// bounds and penalties.
#[test]
fn multipliers_of_the_pair_are_recovered() {
    for (c, homotopy) in [([1.0, 0.25], Homotopy::Coupled), ([1.0, -0.5], Homotopy::Outer)] {
        for relaxation in relaxations() {
            let f = raw(&square(c), relaxation, homotopy, &[0.7, 0.1]);
            // curvature is all that holds the multipliers of the direct form
            let accuracy = if relaxation == Relaxation::Direct { 1e-3 } else { 1e-4 };
            let (s, what) = (&f.solution, format!("{relaxation:?}: {:?} {:?}", f.x, f.solution.z));
            assert!(matches!(s.outcome, Outcome::Solved), "{what} {:?}", s.outcome);
            assert!((s.x[0] - c[0]).abs() < 1e-4 && s.x[1].abs() < 1e-4, "{what}");
            assert!(s.z[0].abs() < accuracy && (s.z[1] + c[1]).abs() < accuracy, "{what}");
            assert!((s.objective - 0.5 * c[1] * c[1]).abs() < 1e-4, "{what}");
        }
    }
}

/// With one pair the sum of the products is the product.
#[test]
fn one_lump_of_one_pair_is_scholtes_relaxation() {
    let p = square([1.0, 0.25]);
    let [a, b] = [Relaxation::Scholtes, Relaxation::ScholtesLumped]
        .map(|r| p.solve(settings(r, Homotopy::Coupled), &p.starts[0]).solution);
    assert_eq!((a.x, a.objective.to_bits(), a.stats.iterations), (b.x, b.objective.to_bits(), b.stats.iterations));
}

/// Slope of `log ‖x(σ) − x*‖` over `log σ`, of the program as it is written: a factor of the objective decides which of the two
/// minimisers of a square a relaxation leads to.
fn rate(p: &Problem, relaxation: Relaxation, exact: &[f64]) -> f64 {
    let error = |sigma_min: f64| {
        let s = MpccSettings {
            sigma_min,
            polish: false,
            scaling: false,
            tol: 1e-12,
            ..settings(relaxation, Homotopy::Outer)
        };
        let x = p.solve(s, &[0.9, 0.2]).x;
        x.iter().zip(exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    (error(1e-3) / error(1e-5)).log10() / 2.0
}

/// Under strict complementarity `x(σ)` has a distance `O(σ)` (Ralph and Wright, Optim. Methods Softw. 19, 2004); at a
/// biactive point smoothing costs a root. Strips along the axes are `√σ` wide here.
#[test]
fn distance_of_the_relaxed_solution() {
    let strict = square([1.0, 0.25]);
    for (relaxation, slope) in [
        (Relaxation::Scholtes, 1.0),
        (Relaxation::ScholtesEq, 1.0),
        (Relaxation::FischerBurmeister, 1.0),
        (Relaxation::NaturalResidual, 1.0),
        (Relaxation::ChenChenKanzow, 1.0),
        (Relaxation::KanzowSchwartz, 0.5),
    ] {
        let r = rate(&strict, relaxation, &[1.0, 0.0]);
        assert!((r - slope).abs() < 0.05, "{relaxation:?}: {r}");
    }
    let biactive = problem("sum", "", |m| {
        let x = m.positive(&[1.0, 1.0]);
        m.minimise(x[0] + x[1] + x[0].sq());
        m.pair(x[0], x[1]);
        m.optimal(0.0);
    });
    for relaxation in [Relaxation::ScholtesEq, Relaxation::FischerBurmeister, Relaxation::NaturalResidual] {
        let r = rate(&biactive, relaxation, &[0.0, 0.0]);
        assert!((r - 0.5).abs() < 0.05, "{relaxation:?}: {r}");
    }
}

/// Smallest residual of `∇f + Σ y ∇Φ = 0` over the curve that bounds the relaxed set near the corner, for
/// `∇f = (−1, −1)`, and where it is.
fn nearest_to_stationary(s: &dyn Strategy, sigma: f64) -> (f64, f64, f64) {
    let q = Softness::new(sigma);
    let over = |a: f64, b: f64| {
        let j = s.jet(0, a, b, &q);
        j.v - if s.sigma_in() == SigmaIn::Bound { sigma } else { 0.0 }
    };
    let mut best = (f64::INFINITY, 0.0, 0.0);
    for k in 0..=200 {
        let angle = std::f64::consts::FRAC_PI_2 * (0.1 + 0.8 * f64::from(k) / 200.0);
        let (sin, cos) = angle.sin_cos();
        // along the ray the row leaves its bound once, from below
        let (mut lo, mut hi) = (0.5 * q.root, 20.0 * q.root);
        for _ in 0..80 {
            let mid = 0.5 * (lo + hi);
            if over(mid * cos, mid * sin) > 0.0 {
                hi = mid;
            } else {
                lo = mid;
            }
        }
        let (a, b) = (hi * cos, hi * sin);
        let d = s.jet(0, a, b, &q).d;
        let norm = d.0.hypot(d.1);
        if norm < 1e-12 {
            continue;
        }
        let y = ((d.0 + d.1) / (norm * norm)).max(0.0);
        let residual = (y * d.0 - 1.0).hypot(y * d.1 - 1.0);
        if residual < best.0 {
            best = (residual, a, b);
        }
    }
    best
}

/// Table 2.1. The origin is C-stationary, not M-stationary, for an objective that falls in both members (Hoheisel, Kanzow
/// and Schwartz, Math. Program. 137, 2013): the relaxations of class C have stationary points that go there with `σ`,
/// those of class M have none near the corner. (Stationary points of the first kind are no minimisers, and a
/// method that looks at second derivatives does not stop there.)
#[test]
fn limit_points_of_exact_stationary_points() {
    use Relaxation::*;
    for sigma in [1e-2, 1e-4, 1e-6f64] {
        for r in [
            Scholtes,
            ScholtesEq,
            LinFukushima,
            SteffensenUlbrich,
            SteffensenUlbrichPoly,
            FischerBurmeister,
            NaturalResidual,
            ChenChenKanzow,
        ] {
            let (residual, a, b) = nearest_to_stationary(strategy(r), sigma);
            assert!(residual < 1e-6 && a.max(b) < 2.0 * sigma.sqrt(), "{r:?}: {residual} at ({a}, {b})");
        }
        for r in [Kadrani, KanzowSchwartz] {
            let (residual, ..) = nearest_to_stationary(strategy(r), sigma);
            assert!(residual > 0.99, "{r:?}: {residual}");
        }
    }
}

/// Members and multipliers below this are zero.
const ZERO: f64 = 1e-3;
/// Multipliers above this have no limit.
const UNBOUNDED: f64 = 1e3;

/// Type of stationarity the recovered multipliers show; none where they have no limit.
fn class(p: &Problem, found: &Found) -> Option<Stat> {
    let s = &found.solution;
    let (lifted, _) = p.lifted();
    let mut worst = Stat::S;
    for &(a, b) in lifted.pairs() {
        let (nu, xi) = (s.z[a], s.z[b]);
        if nu.abs().max(xi.abs()) > UNBOUNDED {
            return None;
        }
        if s.x[a].max(s.x[b]) > ZERO {
            continue;
        }
        let sign = |v: f64| if v.abs() <= ZERO { 0 } else { v.signum() as i32 };
        let here = match (sign(nu), sign(xi)) {
            (0 | 1, 0 | 1) => Stat::S,
            (0, _) | (_, 0) => Stat::M,
            (-1, -1) => Stat::C,
            _ => Stat::A,
        };
        if here as i32 > worst as i32 {
            worst = here;
        }
    }
    Some(worst)
}

/// No strategy ends, solved to its tolerance, at a point weaker than its class in Table 2.1 (C for the smoothed
/// functions, which it does not list).
#[test]
fn no_limit_is_weaker_than_clarke() {
    use Relaxation::*;
    let mut seen = 0;
    let small = |p: &&Problem| (1..=4).contains(&p.members.len()) && p.known.expect == Expect::Optimal;
    // where more rows are active than there are variables, multipliers are not unique
    let unique = |p: &&Problem| !["ralph1", "one point"].contains(&p.name.as_str());
    for p in all().iter().filter(small).filter(unique) {
        for r in relaxations().filter(|r| *r != Direct) {
            let found = raw(p, r, Homotopy::Outer, &p.starts[0]);
            if found.solution.outcome != Outcome::Solved {
                continue;
            }
            if let Some(c) = class(p, &found) {
                seen += 1;
                // M of Kadrani and Kanzow-Schwartz is that of exact KKT points, tested above; inexact ones may tend to less
                // (C. Kanzow, A. Schwartz, SIAM J. Optim. 25, 2015)
                assert!(
                    c as i32 <= Stat::C as i32,
                    "{r:?} at {:?} of {}: {c:?} {:?}",
                    found.x,
                    p.name,
                    found.solution.z
                );
            }
        }
    }
    assert!(seen > 300, "{seen}");
}

/// Drives a way from rest to rest in the shortest time, with a drive that pulls `boost` times as hard above the speed `threshold`
/// (implicit Euler, Heaviside form); the members of the pairs in units of their own.
fn car(way: f64, threshold: f64, boost: f64, units: [f64; 2]) -> Problem {
    const STAGES: usize = 25;
    problem("car with two gears", "", |m| {
        let n = STAGES as f64;
        let time = m.var(1.0, 100.0, 10.0);
        let step = time / n;
        let (mut q, mut v) = (None, None);
        for k in 1..=STAGES {
            let u = m.var(-5.0, 5.0, 1.0);
            let (next, speed) = (m.free(&[way * k as f64 / n])[0], m.var(-1.0, 25.0, 5.0));
            let gear = m.var(0.0, 1.0, 0.5);
            let (above, below) = (m.positive(&[0.5])[0], m.positive(&[0.5])[0]);
            let since = |now, before: Option<_>| if let Some(before) = before { now - before } else { now };
            m.zero(since(next, q) - step * speed);
            m.zero(since(speed, v) - step * u * ((boost - 1.0) * gear + 1.0));
            m.zero(speed - above + below - threshold);
            m.pair(units[0] * gear, units[1] * below);
            m.pair(units[0] * (1.0 - gear), units[1] * above);
            (q, v) = (Some(next), Some(speed));
        }
        m.zero(q.unwrap() - way);
        m.zero(v.unwrap() * 1.0);
        m.minimise(time * 1.0);
        m.optimal(f64::NAN);
    })
}

/// Products of ten and more are what the optimum needs on its way: with a first relaxation of one the times are up to two and
/// a half times as long. IPOPT in elastic mode in the maximum norm finds 12.5, 8.8889, 12 and 6.
#[test]
fn the_first_relaxation_lets_the_objective_choose() {
    for (way, threshold, boost, peer) in
        [(150.0, 10.0, 3.0, 12.5), (100.0, 8.0, 2.5, 8.8889), (180.0, 12.0, 2.0, 12.0), (60.0, 6.0, 3.0, 6.0)]
    {
        let solve = |units| {
            let p = car(way, threshold, boost, units);
            p.solve(MpccSettings::default(), &p.starts[0]).solution
        };
        let usual = solve([1.0, 1.0]);
        assert_eq!((usual.outcome, usual.polish), (Outcome::Solved, Polish::Done));
        assert!(usual.objective <= 1.0001 * peer, "{way}: {} instead of {peer}", usual.objective);
        for units in [[1024.0, 1.0], [1.0, 1.0 / 256.0], [0.125, 64.0]] {
            let other = solve(units);
            assert_eq!(other.outcome, Outcome::Solved);
            assert_eq!(
                (other.objective, other.stats.iterations),
                (usual.objective, usual.stats.iterations),
                "{units:?}"
            );
        }
    }
}
