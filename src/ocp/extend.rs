//! From what the user states to what is discretised: references and slacks become parameters and controls of their own
//! behind the user's.

use super::rewire::Rewire;
use super::squares::Squares;
use super::terms::{sum_of_squares, Stack};
use super::{CostAt, Norm, Ocp};
use crate::error::Result;
use crate::fesd::{Boundary, PathAt, PathConstraint, PathPairs, Terminal};
use crate::func::{Dims, Maximum};
use crate::system::{combination, SharedFunction, System};

const INF: f64 = f64::INFINITY;

/// `(r − y)ᵀ W (r − y)`.
#[derive(Clone)]
pub(crate) struct LeastSquares {
    pub f: SharedFunction,
    pub weights: Vec<f64>,
    /// `[n]`, or `[n_stages · n]`.
    pub references: Vec<f64>,
    pub place: CostAt,
}

/// `0 ≤ a ⊥ b ≥ 0` along the horizon.
#[derive(Clone)]
pub(crate) struct Complementarity {
    pub a: SharedFunction,
    pub b: SharedFunction,
    pub at: PathAt,
}

/// A constraint whose violation is penalised.
#[derive(Clone)]
pub(crate) struct Soft {
    pub f: SharedFunction,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// `None` at the end of the horizon.
    pub at: Option<PathAt>,
    pub norm: Norm,
    pub weight: f64,
    /// A kink of this cost rather than a constraint of the user: one slack is the maximum of 0 and of all outputs, and its price is a part
    /// of the cost.
    pub cost: Option<CostOf>,
}

/// Which cost a kink belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CostOf {
    /// The cost rate.
    Running,
    /// The cost at the end.
    Terminal,
}

impl Soft {
    /// The kinks of a cost.
    pub fn kinks(of: CostOf, kinks: &[Maximum]) -> impl Iterator<Item = Soft> + '_ {
        kinks.iter().map(move |k| Soft {
            f: k.of.clone(),
            lower: vec![-INF; k.of.n_out()],
            upper: vec![0.0; k.of.n_out()],
            at: (of == CostOf::Running).then_some(PathAt::ControlGrid),
            norm: if k.squared { Norm::L2 } else { Norm::L1 },
            weight: k.weight,
            cost: Some(of),
        })
    }

    /// What [`Soft::kinks`] made this of.
    pub fn maximum(&self) -> Maximum {
        Maximum { weight: self.weight, of: self.f.clone(), squared: self.norm == Norm::L2 }
    }

    /// Is the slack of a stage what the cost has there at every moment: does a kink along the horizon see nothing that moves within a stage?
    pub fn holds_within_stages(&self, linear: &[bool]) -> bool {
        let (d, pattern) = (self.f.dims(), self.f.jac_pattern());
        let moves = |c: usize| c < d.x || c == d.t_col() || linear.get(c - d.x).is_some_and(|l| *l);
        self.cost != Some(CostOf::Running) || !(0..d.n_in()).any(|c| moves(c) && !pattern.rows(c).is_empty())
    }

    fn n_slacks(&self) -> usize {
        if self.norm == Norm::Linf || self.cost.is_some() {
            1
        } else {
            self.f.n_out()
        }
    }

    /// Slacks of their own in every control stage, rather than common ones of the horizon.
    pub fn by_stage(&self) -> bool {
        self.at.is_some() && self.norm != Norm::Linf
    }

    /// What slacks of these values cost, over a time `duration` where they belong to a stage.
    pub fn penalty(&self, slacks: &[f64], duration: f64) -> f64 {
        let sum: f64 = match self.norm {
            Norm::L2 => slacks.iter().map(|s| s * s).sum(),
            _ => slacks.iter().sum(),
        };
        self.weight * sum * if self.by_stage() { duration } else { 1.0 }
    }
}

/// Share of the usual length of a stage up to which one has no length. An interior point leaves a slack without a price where it
/// is, and one at this price at the tolerance of the program divided by it.
const EMPTY: f64 = 1e-6;

impl Ocp {
    /// The largest slack of the relaxed constraints, and what all slacks cost, with parameters and controls of the extended problem. Slacks of a stage
    /// that has no length have no price: their values say nothing.
    pub(super) fn relaxation(&self, e: &Extended, params: &[f64], controls: &[f64], durations: &[f64]) -> (f64, f64) {
        let usual = self.horizon / self.n_stages as f64;
        let (mut most, mut cost) = (0f64, 0.0);
        for (soft, at) in self.soft.iter().zip(&e.slacks).filter(|(s, _)| s.cost.is_none()) {
            let mut count = |slacks: &[f64], h: f64| {
                if !soft.by_stage() || h > EMPTY * usual {
                    most = slacks.iter().fold(most, |m, v| v.max(m));
                }
                cost += soft.penalty(slacks, h);
            };
            match at {
                Slacks::Params(r) => count(&params[r.clone()], 1.0),
                Slacks::Controls(r) => {
                    let stages = controls.chunks_exact(e.system.dims().u).zip(durations);
                    stages.for_each(|(u, h)| count(&u[r.clone()], *h));
                }
            }
        }
        (most, cost)
    }
}

/// Where the slacks of a soft constraint are.
#[derive(Debug, Clone)]
pub(super) enum Slacks {
    /// These parameters.
    Params(std::ops::Range<usize>),
    /// These controls, in every stage.
    Controls(std::ops::Range<usize>),
}

/// What the user states, all of it.
pub(super) struct Statement<'a> {
    pub system: &'a System,
    pub lagrange: Option<&'a SharedFunction>,
    pub mayer: Option<&'a SharedFunction>,
    pub path: &'a [PathConstraint],
    pub terminal: &'a [Terminal],
    pub boundary: &'a [Boundary],
    pub squares: &'a [LeastSquares],
    pub soft: &'a [Soft],
    pub complementarity: &'a [Complementarity],
}

/// The problem with its own parameters and controls.
pub(super) struct Extended {
    pub system: System,
    pub lagrange: Option<SharedFunction>,
    pub mayer: Option<SharedFunction>,
    pub grid_cost: Option<SharedFunction>,
    pub path: Vec<PathConstraint>,
    pub terminal: Vec<Terminal>,
    pub boundary: Vec<Boundary>,
    pub complementarity: Vec<PathPairs>,
    /// Of every soft constraint.
    pub slacks: Vec<Slacks>,
    /// First parameter of the references of every least-squares term.
    pub references: Vec<usize>,
    /// Parameters that are slacks.
    pub slack_params: std::ops::Range<usize>,
    /// Parameters of every stage in the last solve.
    pub params: Vec<f64>,
}

impl Extended {
    pub fn new(s: &Statement) -> Result<Extended> {
        let d = s.system.dims();
        let mut wide = d;
        let mut references = Vec::new();
        for q in s.squares {
            references.push(wide.p);
            wide.p += q.f.n_out();
        }
        let first_slack = wide.p;
        let slacks: Vec<Slacks> = s
            .soft
            .iter()
            .map(|c| {
                let n = c.n_slacks();
                let at = if c.by_stage() { &mut wide.u } else { &mut wide.p };
                *at += n;
                let range = *at - n..*at;
                if c.by_stage() {
                    Slacks::Controls(range)
                } else {
                    Slacks::Params(range)
                }
            })
            .collect();
        let w = Rewire::widen(d, wide);
        let (mut running, mut ending, mut at_grid) = (Vec::new(), Vec::new(), Vec::new());
        running.extend(s.lagrange.map(|f| w.function(f)));
        ending.extend(s.mayer.map(|f| w.function(f)));
        for (q, &at) in s.squares.iter().zip(&references) {
            let f = Squares::of(&q.f, wide, wide.x + wide.u + at, &q.weights)?;
            match q.place {
                CostAt::Running => running.push(f),
                CostAt::ControlGrid => at_grid.push(f),
                CostAt::Terminal => ending.push(f),
            }
        }
        let mut path: Vec<PathConstraint> =
            s.path.iter().map(|c| PathConstraint { f: w.function(&c.f), ..c.clone() }).collect();
        let mut terminal: Vec<Terminal> =
            s.terminal.iter().map(|c| Terminal { f: w.function(&c.f), ..c.clone() }).collect();
        for (c, at) in s.soft.iter().zip(&slacks) {
            let columns: Vec<usize> = match at {
                Slacks::Controls(r) => r.clone().map(|k| wide.x + k).collect(),
                Slacks::Params(r) => r.clone().map(|k| wide.x + wide.u + k).collect(),
            };
            let (f, lower, upper) = relaxed(c, &w, wide, &columns);
            match c.at {
                Some(at) => path.push(PathConstraint { f, lower, upper, at }),
                None => terminal.push(Terminal { f, lower, upper }),
            }
            let cost = match c.norm {
                Norm::L2 => sum_of_squares("relaxation", wide, columns, c.weight),
                _ => combination("relaxation", wide, vec![columns.iter().map(|&k| (k, c.weight)).collect()]),
            };
            if c.by_stage() { &mut running } else { &mut ending }.push(cost);
        }
        let both = Rewire::widen(Dims { x: 2 * d.x, ..d }, Dims { x: 2 * d.x, ..wide });
        let boundary = s.boundary.iter().map(|c| Boundary { f: both.function(&c.f), ..c.clone() }).collect();
        let all = || (0..wide.n_in()).collect::<Vec<usize>>();
        let sides = |c: &Complementarity| -> PathPairs {
            let name = format!("{} and {}", c.a.name(), c.b.name());
            let parts = vec![(w.function(&c.a), all()), (w.function(&c.b), all())];
            PathPairs { f: Stack::of(&name, wide, parts), at: c.at }
        };
        let complementarity = s.complementarity.iter().map(sides).collect();
        let total = |name: &str, mut terms: Vec<SharedFunction>| match terms.len() {
            0 => None,
            1 => terms.pop(),
            _ => Some(Stack::sum(name, wide, terms)),
        };
        Ok(Extended {
            system: w.system(s.system)?,
            lagrange: total("running cost", running),
            mayer: total("terminal cost", ending),
            grid_cost: total("cost at the control grid", at_grid),
            path,
            terminal,
            boundary,
            complementarity,
            slacks,
            references,
            slack_params: first_slack..wide.p,
            params: Vec::new(),
        })
    }
}

/// `c + s ≥ lower`, `c − s ≤ upper`; of a kink the latter alone.
fn relaxed(c: &Soft, w: &Rewire, to: Dims, slacks: &[usize]) -> (SharedFunction, Vec<f64>, Vec<f64>) {
    let n = c.f.n_out();
    let slack = |i: usize| slacks[if slacks.len() == 1 { 0 } else { i }];
    let all: Vec<usize> = (0..to.n_in()).collect();
    let f = w.function(&c.f);
    if c.cost.is_some() {
        let shift = combination("slack", to, (0..n).map(|_| vec![(slack(0), -1.0)]).collect());
        return (Stack::sum(c.f.name(), to, vec![f, shift]), c.lower.clone(), c.upper.clone());
    }
    let twice = Stack::of(c.f.name(), to, vec![(f.clone(), all.clone()), (f, all)]);
    let shifts = (0..2 * n).map(|i| vec![(slack(i % n), if i < n { 1.0 } else { -1.0 })]).collect();
    let f = Stack::sum(c.f.name(), to, vec![twice, combination("slack", to, shifts)]);
    let none = vec![INF; n];
    let lower = c.lower.iter().copied().chain(none.iter().map(|v| -v)).collect();
    let upper = none.iter().chain(&c.upper).copied().collect();
    (f, lower, upper)
}
