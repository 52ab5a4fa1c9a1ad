//! Small programs of the literature, with and without complementarity, whose answers are known.
//!
//! Problems are written as formulas ([`tape`]); `classics`, `bilevel`, `equilibria`, `pathological`, `smooth` and
//! `planted` hold them by kind. What is known of a problem is derived by hand or follows from the enumeration of its
//! branches, which `tests/textbook.rs` repeats.
#![allow(dead_code)]

pub mod tape;

mod bilevel;
pub mod branches;
mod classics;
mod equilibria;
mod pathological;
pub mod planted;
mod smooth;

use switchback_mpcc::mpcc::{
    BStationarity, CertSettings, Certificate, Certifier, Lifted, Local, Member, Mpcc, MpccSettings, MpccSolver,
    Solution,
};
use switchback_mpcc::nlp::{Bounds, Control, Nlp, Outcome};

pub use switchback_mpcc::mpcc::Stationarity as Stat;
pub use tape::{affine, sum, Ex, Program};

pub const INF: f64 = f64::INFINITY;

/// What a problem has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expect {
    Optimal,
    Infeasible,
    Unbounded,
}

/// What is known of a problem.
#[derive(Debug, Clone)]
pub struct Known {
    pub expect: Expect,
    /// Global minimum, NaN where it is not known.
    pub f: f64,
    /// A global minimiser, when given.
    pub x: Option<Vec<f64>>,
    /// Strongest stationarity of that minimiser.
    pub stat: Option<Stat>,
    /// Objectives of local minimisers that are not global.
    pub local: Vec<f64>,
    /// Stationary points that are no minimisers.
    pub traps: Vec<(Vec<f64>, Stat)>,
}

/// A problem with its answer.
#[derive(Debug, Clone)]
pub struct Problem<P = Program> {
    pub name: String,
    /// Where it comes from.
    pub source: &'static str,
    pub program: P,
    pub bounds: Bounds,
    pub members: Vec<(Member, Member)>,
    /// Starting points; the first is the usual one.
    pub starts: Vec<Vec<f64>>,
    pub known: Known,
}

/// A problem being written down.
#[derive(Default)]
pub struct Model {
    x: Vec<(f64, f64, f64)>,
    objective: Option<Ex>,
    rows: Vec<(Ex, f64, f64)>,
    pairs: Vec<(Ex, Ex)>,
    starts: Vec<Vec<f64>>,
    known: Option<Known>,
}

impl Model {
    /// A variable between bounds, with its starting value.
    pub fn var(&mut self, lower: f64, upper: f64, start: f64) -> Ex {
        self.x.push((lower, upper, start));
        Ex::variable(self.x.len() - 1)
    }
    /// Variables with the same bounds.
    pub fn vars(&mut self, lower: f64, upper: f64, starts: &[f64]) -> Vec<Ex> {
        starts.iter().map(|&s| self.var(lower, upper, s)).collect()
    }
    /// Free variables.
    pub fn free(&mut self, starts: &[f64]) -> Vec<Ex> {
        self.vars(-INF, INF, starts)
    }
    /// Variables that are not negative.
    pub fn positive(&mut self, starts: &[f64]) -> Vec<Ex> {
        self.vars(0.0, INF, starts)
    }
    pub fn minimise(&mut self, f: Ex) {
        self.objective = Some(f);
    }
    /// `lower ≤ e ≤ upper`.
    pub fn row(&mut self, lower: f64, e: Ex, upper: f64) {
        self.rows.push((e, lower, upper));
    }
    /// `e = 0`.
    pub fn zero(&mut self, e: Ex) {
        self.row(0.0, e, 0.0);
    }
    /// `e ≥ bound`.
    pub fn at_least(&mut self, e: Ex, bound: f64) {
        self.row(bound, e, INF);
    }
    /// `e ≤ bound`.
    pub fn at_most(&mut self, e: Ex, bound: f64) {
        self.row(-INF, e, bound);
    }
    /// `0 ≤ a ⊥ b ≥ 0`.
    pub fn pair(&mut self, a: Ex, b: Ex) {
        self.pairs.push((a, b));
    }
    /// One more starting point.
    pub fn start(&mut self, x: &[f64]) {
        self.starts.push(x.to_vec());
    }
    /// The global minimum.
    pub fn optimal(&mut self, f: f64) -> &mut Known {
        self.expect(Expect::Optimal, f)
    }
    pub fn infeasible(&mut self) {
        self.expect(Expect::Infeasible, f64::NAN);
    }
    pub fn unbounded(&mut self) {
        self.expect(Expect::Unbounded, f64::NEG_INFINITY);
    }
    fn expect(&mut self, expect: Expect, f: f64) -> &mut Known {
        self.known.insert(Known { expect, f, x: None, stat: None, local: Vec::new(), traps: Vec::new() })
    }

    fn finish(mut self, name: &str, source: &'static str) -> Problem {
        let mut members = Vec::new();
        for (a, b) in std::mem::take(&mut self.pairs) {
            let pair = (self.member(a), self.member(b));
            members.push(pair);
        }
        let mut bounds = Bounds::free(self.x.len(), self.rows.len());
        for (j, v) in self.x.iter().enumerate() {
            (bounds.xl[j], bounds.xu[j]) = (v.0, v.1);
        }
        for (i, r) in self.rows.iter().enumerate() {
            (bounds.cl[i], bounds.cu[i]) = (r.1, r.2);
        }
        let rows: Vec<Ex> = self.rows.iter().map(|r| r.0).collect();
        let program = Program::new(self.x.len(), self.objective.expect("an objective"), &rows);
        let mut starts = vec![self.x.iter().map(|v| v.2).collect()];
        starts.append(&mut self.starts);
        let known = self.known.expect("an answer");
        Problem { name: name.to_string(), source, program, bounds, members, starts, known }
    }

    /// A variable that may be zero is a member as it is; everything else becomes a row.
    fn member(&mut self, e: Ex) -> Member {
        match e.as_variable() {
            Some(j) if self.x[j].0 <= 0.0 && self.x[j].1 > 0.0 => Member::Variable(j),
            _ => {
                self.at_least(e, 0.0);
                Member::Row(self.rows.len() - 1)
            }
        }
    }
}

impl Known {
    /// A global minimiser and the strongest stationarity it has.
    pub fn at(&mut self, x: &[f64], stat: Stat) -> &mut Known {
        self.x = Some(x.to_vec());
        self.stat = Some(stat);
        self
    }
    /// Objectives of further local minimisers.
    pub fn local(&mut self, f: &[f64]) -> &mut Known {
        self.local.extend_from_slice(f);
        self
    }
    /// A stationary point that is none.
    pub fn trap(&mut self, x: &[f64], stat: Stat) -> &mut Known {
        self.traps.push((x.to_vec(), stat));
        self
    }
}

/// Writes down a problem.
pub fn problem(name: &str, source: &'static str, write: impl FnOnce(&mut Model)) -> Problem {
    tape::clear();
    let mut m = Model::default();
    write(&mut m);
    m.finish(name, source)
}

/// Every problem.
pub fn all() -> Vec<Problem> {
    let mut out = classics::all();
    out.append(&mut bilevel::all());
    out.append(&mut equilibria::all());
    out.append(&mut pathological::all());
    out.append(&mut smooth::all());
    out.append(&mut planted::all());
    out
}

/// Reproducible numbers in `[-1, 1)`; `positive` ones in `[0.3, 1.3)`.
pub struct Numbers(u64);

impl Numbers {
    pub fn new(seed: u64) -> Numbers {
        Numbers(seed)
    }
    pub fn next(&mut self) -> f64 {
        // Knuth's multiplier; the high bits are the random ones
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    pub fn vector(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }
    pub fn positive(&mut self) -> f64 {
        0.3 + self.next().abs()
    }
}

/// What the solver made of a problem.
pub struct Found {
    pub solution: Solution,
    /// What the point is, where there are pairs and the solver calls it a solution.
    pub certificate: Option<Certificate>,
    /// The point, without lifted members.
    pub x: Vec<f64>,
    /// Largest `min(G, H)` over the pairs, and the largest violation of anything else, at that point.
    pub pair_min: f64,
    pub violation: f64,
}

/// Relative error of an objective.
pub fn relative(f: f64, exact: f64) -> f64 {
    (f - exact).abs() / exact.abs().max(1.0)
}

/// Accuracy of objectives.
pub const ACCURACY: f64 = 1e-7;

/// A verdict and its reason.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// The global minimum, or the fact that there is none.
    Pass,
    /// A local minimum that is listed.
    Local,
    Fail(String),
}

impl<P: Nlp + Clone> Problem<P> {
    pub fn lifted(&self) -> (Lifted<P>, Bounds) {
        let mut lifted = Lifted::new(self.program.clone(), &self.members).expect("pairs that exist");
        let bounds = lifted.bounds(&self.bounds).expect("bounds that admit zero");
        (lifted, bounds)
    }

    /// Solves from one of the starting points.
    pub fn solve(&self, settings: MpccSettings, start: &[f64]) -> Found {
        let (mut p, bounds) = self.lifted();
        let w0 = p.start(start);
        let mut solver = MpccSolver::new(&mut p, settings).expect("a structure");
        let solution = solver.solve(&mut p, &bounds, &w0, &mut Control::default()).clone();
        let x = solution.x[..start.len()].to_vec();
        let (violation, pair_min) = self.violation(&x);
        let certificate = (solution.outcome == Outcome::Solved && !self.members.is_empty())
            .then(|| self.certify(&solution.x, Some((&solution.y, &solution.z))));
        Found { solution, certificate, x, pair_min, violation }
    }

    /// What the point `w` of the lifted problem is; multipliers are found when they are not given.
    pub fn certify(&self, w: &[f64], multipliers: Option<(&[f64], &[f64])>) -> Certificate {
        let (mut p, bounds) = self.lifted();
        let (n, m) = (p.n(), p.m());
        let (mut c, mut grad, mut jac_values) = (vec![0.0; m], vec![0.0; n], vec![0.0; p.jac_pattern().nnz()]);
        p.eval(w, &mut c).expect("a value at the point");
        p.derivatives(w, &mut grad, &mut jac_values).expect("derivatives at the point");
        let none = (vec![0.0; m], vec![0.0; n]);
        let (y, z) = multipliers.unwrap_or((&none.0, &none.1));
        let mut certifier = Certifier::new(p.jac_pattern(), p.pairs()).expect("a structure");
        let jac = p.jac_pattern();
        let local =
            Local { x: w, c: &c, grad: &grad, jac, jac_values: &jac_values, bounds: &bounds, pairs: p.pairs(), y, z };
        certifier.certify(&local, &CertSettings::default(), &mut Control::default())
    }

    /// What the point `x` of the problem as it is written is.
    pub fn certify_at(&self, x: &[f64]) -> Certificate {
        let (mut p, _) = self.lifted();
        let w = p.start(x);
        self.certify(&w, None)
    }

    /// Largest violation of bounds and rows at `x`, and the largest `|min(G, H)|`.
    pub fn violation(&self, x: &[f64]) -> (f64, f64) {
        let mut program = self.program.clone();
        let mut c = vec![0.0; program.m()];
        if program.eval(x, &mut c).is_err() {
            return (INF, INF);
        }
        let b = &self.bounds;
        let outside = |v: f64, l: f64, u: f64| (l - v).max(v - u).max(0.0);
        let of_bounds = x.iter().zip(b.xl.iter().zip(&b.xu)).map(|(v, (l, u))| outside(*v, *l, *u));
        let of_rows = c.iter().zip(b.cl.iter().zip(&b.cu)).map(|(v, (l, u))| outside(*v, *l, *u));
        let value = |m: Member| match m {
            Member::Variable(j) => x[j],
            Member::Row(i) => c[i],
            _ => unreachable!("the problems have variables and rows as members"),
        };
        let of_pairs = self.members.iter().map(|&(a, b)| value(a).min(value(b)).abs());
        (of_bounds.chain(of_rows).fold(0.0, f64::max), of_pairs.fold(0.0, f64::max))
    }

    /// Compares with what is known.
    pub fn judge(&self, found: &Found) -> Verdict {
        let (s, known) = (&found.solution, &self.known);
        let fail = |why: String| Verdict::Fail(why);
        match known.expect {
            Expect::Infeasible if matches!(s.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) => {
                return Verdict::Pass;
            }
            Expect::Unbounded if s.outcome == Outcome::Diverging => return Verdict::Pass,
            Expect::Optimal if s.outcome == Outcome::Solved => {}
            _ => return fail(format!("ended as {}", s.outcome.name())),
        }
        if found.violation > 1e-7 || found.pair_min > 1e-7 {
            return fail(format!("not feasible: rows {:.1e}, pairs {:.1e}", found.violation, found.pair_min));
        }
        if known.f.is_nan() || relative(s.objective, known.f) <= ACCURACY {
            return match (&found.certificate, known.stat) {
                (Some(c), _) if c.b == BStationarity::No => fail("a minimiser is certified to have a descent".into()),
                (Some(c), Some(t)) if c.stationarity as i32 > t as i32 => {
                    fail(format!("certified as {}, not {}", c.stationarity.name(), t.name()))
                }
                _ => Verdict::Pass,
            };
        }
        if s.objective < known.f {
            return fail(format!("below the minimum by {:.1e}", known.f - s.objective));
        }
        if known.local.iter().any(|&f| relative(s.objective, f) <= ACCURACY) {
            return Verdict::Local;
        }
        for (x, stat) in &known.traps {
            if x.iter().zip(&found.x).all(|(a, b)| (a - b).abs() < 1e-4) {
                return fail(format!("stopped at a {}-stationary trap", stat.name()));
            }
        }
        fail(format!("objective off by {:.1e}", relative(s.objective, known.f)))
    }
}
