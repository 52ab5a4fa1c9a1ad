//! Which sequence of barrier problems a strategy is solved by.
//!
//! Coupled: the ladder of [`Scholtes`] for relaxations; for penalties the rule of Leyffer, López-Calva and Nocedal
//! (SIAM J. Optim. 17, 2006), which raises `ρ` while pairs, or elastic rows, stay more open than `μ^0.4`; `σ` a multiple of `μ` for
//! Raghunathan and Biegler. Outer: every problem to the tolerance, from a larger barrier parameter again; penalties as [`Penalties`] says.

use std::ops::Range;

use super::homotopy::{Scholtes, Spent};
use super::penalties::Penalties;
use super::relaxation::Sequence;
use super::relaxed::Structure;
use super::scaling::Weight;
use super::settings::MpccSettings;
use super::solver::KEPT_RELAXATION;
use crate::nlp::{lower_barrier, Advance, Continuation, Level, Measures};
use crate::settings::Homotopy;

/// The rule of a strategy.
#[derive(Debug, Clone)]
pub(super) enum Path {
    Coupled(Scholtes),
    Penalties(Penalties),
    Rule(Rule),
}

impl Path {
    /// From the first problem to the relaxation, or the barrier problem, `end`.
    pub fn new(s: MpccSettings, st: &Structure, end: f64) -> Path {
        let sequence = st.strategy().sequence();
        let sigma = match sequence {
            Sequence::Relaxation => s.sigma_init,
            Sequence::Penalty => 1.0 / s.penalty_init,
            Sequence::Barrier(chi) => chi * s.mu_init,
        };
        match (sequence, s.homotopy) {
            (Sequence::Relaxation, Homotopy::Coupled) => {
                let path = Scholtes::new(s, st.sigma_rows(), end);
                Path::Coupled(path.of(st.scaling.is_by_units(), st.scaling.weight == Weight::Plain))
            }
            (Sequence::Penalty, Homotopy::Outer) => {
                Path::Penalties(Penalties::new(s, st.sigma_rows(), Level { mu: s.mu_init, sigma }, end))
            }
            _ => Path::Rule(Rule::new(s, st, Level { mu: s.mu_init, sigma }, end)),
        }
    }

    /// Goes on from `level`.
    pub fn resume(s: MpccSettings, st: &Structure, level: Level, end: f64) -> Path {
        match (st.strategy().sequence(), s.homotopy) {
            (Sequence::Relaxation, Homotopy::Coupled) => {
                let path = Scholtes::resume(s, st.sigma_rows(), level, end);
                Path::Coupled(path.of(st.scaling.is_by_units(), st.scaling.weight == Weight::Plain))
            }
            (Sequence::Penalty, Homotopy::Outer) => Path::Penalties(Penalties::new(s, st.sigma_rows(), level, end)),
            _ => Path::Rule(Rule::new(s, st, level, end)),
        }
    }

    /// The same as one of several strategies, after so many iterations of it: what creeps ends.
    pub fn after(self, spent: Option<Spent>) -> Path {
        match self {
            Path::Coupled(p) => Path::Coupled(p.after(spent)),
            other => other,
        }
    }

    /// Iterations so far, where they are counted.
    pub fn spent(&self) -> Option<Spent> {
        match self {
            Path::Coupled(p) => p.spent(),
            _ => None,
        }
    }

    fn rule(&mut self) -> &mut dyn Continuation {
        match self {
            Path::Coupled(p) => p,
            Path::Penalties(p) => p,
            Path::Rule(p) => p,
        }
    }
}

impl Continuation for Path {
    fn start(&mut self) -> Level {
        self.rule().start()
    }
    fn advance(&mut self, m: &Measures) -> Advance {
        self.rule().advance(m)
    }
    fn jammed(&mut self, m: &Measures) -> Option<Level> {
        self.rule().jammed(m)
    }
    fn relaxed_rows(&self) -> Range<usize> {
        match self {
            Path::Coupled(p) => p.relaxed_rows(),
            Path::Penalties(p) => p.relaxed_rows(),
            Path::Rule(p) => p.rows.clone(),
        }
    }
    fn recentres(&self) -> bool {
        matches!(self, Path::Rule(p) if p.settings.homotopy == Homotopy::Outer && p.sequence == Sequence::Relaxation)
    }
    fn corrects(&self) -> bool {
        matches!(self, Path::Coupled(p) if p.corrects())
    }
}

/// Share of the barrier parameter's exponent the pairs may stay open by (Leyffer et al., section 4).
const GAMMA: f64 = 0.4;
/// A complementarity that has not fallen by this share over the history is not falling.
const FALLS: f64 = 0.99;
const HISTORY: usize = 10;
/// Factor of the penalty parameter, and the inverse of its largest value.
const RHO_FACTOR: f64 = 10.0;
const SIGMA_OF_RHO_MAX: f64 = 1e-8;
/// Barrier parameter at which a relaxed problem on the way counts as solved, as a share of its relaxation: what the barrier adds to
/// the products is lost beside that.
const SOLVED_SHARE: f64 = 1e-4;
/// Iterations after which an almost feasible problem counts as solved.
const PROBLEM_ITERATIONS: usize = 100;

/// Barrier problems whose `σ` does not follow the ladder.
#[derive(Debug, Clone)]
pub(super) struct Rule {
    settings: MpccSettings,
    sequence: Sequence,
    rows: Range<usize>,
    start: Level,
    end: f64,
    /// Iterations on the present barrier problem.
    stays: usize,
    /// Products of the last iterations, newest first.
    history: [f64; HISTORY],
}

impl Rule {
    fn new(settings: MpccSettings, st: &Structure, start: Level, end: f64) -> Rule {
        let sequence = st.strategy().sequence();
        Rule { settings, sequence, rows: st.sigma_rows(), start, end, stays: 0, history: [f64::INFINITY; HISTORY] }
    }

    /// The last barrier parameter of a problem with this relaxation or penalty.
    fn floor(&self, sigma: f64) -> f64 {
        let s = &self.settings;
        let least = 0.1 * if s.homotopy == Homotopy::Coupled { s.tol.max(self.end) } else { s.tol };
        let loose = self.sequence == Sequence::Relaxation && sigma > KEPT_RELAXATION;
        least.max(if loose { SOLVED_SHARE * sigma } else { 0.0 })
    }

    /// The next barrier problem of the same relaxation.
    fn lower(&mut self, level: Level) -> Advance {
        self.stays = 0;
        let mu = lower_barrier(level.mu, self.floor(level.sigma));
        let sigma = match self.sequence {
            Sequence::Barrier(chi) => chi * mu,
            _ => level.sigma,
        };
        Advance::To(Level { mu, sigma })
    }

    /// The next relaxation; `None` after the last. `open`: do the pairs ask for it?
    fn tighten(&mut self, level: Level, open: bool) -> Option<Level> {
        let s = &self.settings;
        let sigma = match self.sequence {
            Sequence::Relaxation if level.sigma > self.end => (s.sigma_factor * level.sigma).max(self.end),
            Sequence::Penalty if open && level.sigma > SIGMA_OF_RHO_MAX => level.sigma / RHO_FACTOR,
            _ => return None,
        };
        self.stays = 0;
        self.history.fill(f64::INFINITY);
        let mu = match self.sequence {
            Sequence::Relaxation => s.mu_init.min(sigma * s.mu_over_sigma),
            _ => level.mu,
        };
        Some(Level { mu, sigma })
    }

    /// Does the product of the pairs say that this penalty is too small? It is no longer falling.
    fn too_weak(&mut self, product: f64) -> bool {
        let largest = self.history.iter().fold(0f64, |a, v| a.max(*v));
        self.history.rotate_right(1);
        self.history[0] = product;
        largest.is_finite() && product > FALLS * largest
    }
}

impl Continuation for Rule {
    fn start(&mut self) -> Level {
        self.start
    }

    fn advance(&mut self, m: &Measures) -> Advance {
        let Level { mu, sigma } = m.level;
        let floor = self.floor(sigma);
        let mut open = m.pair_min.max(m.elastic) > mu.powf(GAMMA);
        self.stays += 1;
        let stuck = self.stays > PROBLEM_ITERATIONS && m.primal <= 1e-4;
        let penalty = self.sequence == Sequence::Penalty;
        if m.error > 10.0 * mu && !stuck {
            if penalty && open && self.too_weak(m.pair_product) {
                return self.tighten(m.level, open).map_or(Advance::Stay, Advance::To);
            }
            return Advance::Stay;
        }
        if penalty && open {
            return self.tighten(m.level, open).map_or(Advance::GiveUp, Advance::To);
        }
        if mu > floor {
            return self.lower(m.level);
        }
        let tol = 10.0 * floor;
        if !stuck && (m.error0 > tol || m.primal > tol) {
            return Advance::Stay;
        }
        open |= m.pair_product.max(m.elastic) > 10.0 * self.settings.tol.max(self.end);
        match self.tighten(m.level, open) {
            Some(level) => Advance::To(level),
            // what is stuck at a stop on the way is near enough to go on from
            None if (stuck && self.end <= self.settings.sigma_min) || (open && penalty) => Advance::GiveUp,
            None => Advance::Done,
        }
    }
}
