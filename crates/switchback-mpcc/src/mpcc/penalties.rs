//! Exact penalties one after the other, each in a problem of its own: the elastic mode.
//!
//! A penalty is large enough from where no multiplier of the rows it stands for exceeds it; nobody knows it, and a larger one than needed makes
//! problems that are hard to solve. So each problem is solved as far as it says whether its penalty is large enough, and once pairs are nearly closed
//! the next one goes on from there with a barrier parameter that suits it. Where multipliers of the pairs have no limit the conditions of optimality are met to a few
//! digits and no further; a point that keeps them to [`ACCEPTED`] is accepted (A. Waechter, L. T. Biegler, Math. Program. 106, 2006, have
//! the same rule), and one more barrier parameter is tried from it.

use std::ops::Range;

use super::settings::MpccSettings;
use crate::nlp::{lower_barrier, Advance, Continuation, Level, Measures};

/// Factor from one penalty to the next, and the inverse of the largest.
const FACTOR: f64 = 10.0;
const LEAST_SIGMA: f64 = 1e-8;
/// Products that count as none at a stop, as a multiple of it.
const PRODUCTS: f64 = 10.0;
/// The stop from which answers are kept: products of 1e-7.
pub(super) const KEPT: f64 = 1e-8;
/// Scaled error, and violation of the rows, of an answer.
const ACCEPTED: f64 = 1e-5;
const VIOLATION: f64 = 1e-7;
/// Barrier parameter to which a problem is solved that only says whether its penalty is large enough, as a share of the inverse of that; and the
/// largest one of answers at the stop they are kept from. Behind it that is the tolerance.
const ASKED_SHARE: f64 = 1e-4;
const KEPT_BARRIER: f64 = 1e-7;
/// Largest product over the one that the barrier alone leaves, up to which a penalty is large enough.
const LEFT_BY_BARRIER: f64 = 10.0;
/// Product above which pairs are open.
const OPEN: f64 = 1e-4;
/// Share of the product that the last penalty has left from which one has not closed pairs further, and so many of them in a row that end it: the point
/// is one from which no step closes them.
const CLOSED_BY: f64 = 0.5;
const IDLE: usize = 3;
/// A product that has grown by this factor is unbounded.
const GROWS: f64 = 1e3;
/// Iterations after which an almost feasible problem counts as solved, and its violation.
const ITERATIONS: usize = 30;
const ALMOST: f64 = 1e-4;

/// The schedule; `σ` is the inverse of the penalty.
#[derive(Debug, Clone)]
pub(super) struct Penalties {
    settings: MpccSettings,
    rows: Range<usize>,
    start: Level,
    end: f64,
    /// Iterations on the present barrier problem.
    stays: usize,
    /// Is this penalty large enough?
    enough: bool,
    /// Least product since the last penalty, and the one that was left by it.
    least: f64,
    last: f64,
    /// Penalties in a row that have not closed the pairs further.
    idle: usize,
}

impl Penalties {
    /// From `start` until products count as none at the stop `end`.
    pub fn new(settings: MpccSettings, rows: Range<usize>, start: Level, end: f64) -> Penalties {
        Penalties {
            settings,
            rows,
            start,
            end,
            stays: 0,
            enough: false,
            least: f64::INFINITY,
            last: f64::INFINITY,
            idle: 0,
        }
    }

    fn floor(&self, sigma: f64) -> f64 {
        let asked = ASKED_SHARE * sigma;
        match self.enough {
            false => asked,
            true if self.end >= KEPT => asked.min(KEPT_BARRIER.max(self.settings.tol)),
            true => asked.min(self.settings.tol),
        }
    }

    fn lower(&mut self, level: Level) -> Advance {
        self.stays = 0;
        Advance::To(Level { mu: lower_barrier(level.mu, self.floor(level.sigma)), ..level })
    }

    /// The next penalty. Where pairs are open, or the last penalty has not closed them further, its problem begins with the barrier parameter of the
    /// first one: from a smaller one it would stay where it is, a point that no penalty closes the pairs of.
    fn tighten(&mut self, level: Level, product: f64) -> Advance {
        self.idle = if product > CLOSED_BY * self.last { self.idle + 1 } else { 0 };
        if level.sigma < 2.0 * LEAST_SIGMA || self.idle >= IDLE {
            return Advance::GiveUp;
        }
        (self.stays, self.enough, self.least) = (0, false, f64::INFINITY);
        let sigma = level.sigma / FACTOR;
        let s = &self.settings;
        let open = product > OPEN || product * FACTOR > self.last;
        self.last = product;
        let mu = if open { s.mu_init } else { s.mu_init.min(s.mu_over_sigma * sigma) };
        Advance::To(Level { mu, sigma })
    }
}

impl Continuation for Penalties {
    fn start(&mut self) -> Level {
        self.start
    }

    fn advance(&mut self, m: &Measures) -> Advance {
        let Level { mu, sigma } = m.level;
        let product = m.pair_product.max(m.elastic);
        self.stays += 1;
        self.least = self.least.min(product);
        let stuck = self.stays > ITERATIONS && m.primal <= ALMOST;
        if m.error > 10.0 * mu && !stuck {
            let unbounded = product > GROWS * self.least.max(1.0);
            return if unbounded && !self.enough { self.tighten(m.level, product) } else { Advance::Stay };
        }
        if mu > self.floor(sigma) {
            return self.lower(m.level);
        }
        let reached = product <= PRODUCTS * self.end.max(KEPT);
        if self.end > KEPT && reached {
            return Advance::Done;
        }
        if !self.enough {
            self.enough = reached || product <= LEFT_BY_BARRIER * mu * sigma;
            if self.enough && mu > self.floor(sigma) {
                return self.lower(m.level);
            }
        }
        match (self.enough, reached) {
            (true, true) if m.error0 <= ACCEPTED && m.primal <= VIOLATION => Advance::Done,
            (true, true) if stuck => Advance::GiveUp,
            (true, true) => Advance::Stay,
            _ => self.tighten(m.level, product),
        }
    }

    fn relaxed_rows(&self) -> Range<usize> {
        self.rows.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is measured at the solution of the problem of a level, whose largest product is this.
    fn solved(level: Level, product: f64) -> Measures {
        Measures {
            level,
            error: level.mu,
            error0: level.mu,
            primal: 0.0,
            dual: 0.0,
            pair_product: product,
            rounding: 1e-16,
            alpha: 1.0,
            shift: 0.0,
            pair_min: product,
            elastic: 0.0,
            pull: 0.0,
        }
    }

    /// The level at which a path ends whose problems leave this product, with how it does, and the levels at which penalties begin.
    fn follow(end: f64, product: impl Fn(Level) -> f64) -> (Advance, Level, Vec<Level>) {
        let settings = MpccSettings::default();
        let mut level = Level { mu: settings.mu_init, sigma: 1.0 };
        let mut path = Penalties::new(settings, 0..1, level, end);
        let mut begun = vec![level];
        for _ in 0..1000 {
            match path.advance(&solved(level, product(level))) {
                Advance::To(next) => {
                    if next.sigma < level.sigma {
                        begun.push(next);
                    }
                    level = next;
                }
                Advance::Stay => {}
                end => return (end, level, begun),
            }
        }
        panic!("no end");
    }

    /// Products fall with the penalty until it is large enough: then they are what the barrier leaves, and the problem is solved further.
    #[test]
    fn a_penalty_that_is_large_enough_is_solved_to_the_end() {
        let (end, level, begun) = follow(KEPT, |l| if l.sigma > 2e-3 { l.sigma.powi(3) } else { l.mu * l.sigma });
        assert_eq!((end, begun.len()), (Advance::Done, 4));
        assert!(level.mu <= KEPT_BARRIER && (level.sigma - 1e-3).abs() < 1e-12, "{level:?}");
        // open pairs begin again with the first barrier parameter, those nearly closed with a small one
        assert_eq!(begun[2].mu, MpccSettings::default().mu_init);
        assert!(begun[3].mu <= 1e-4, "{begun:?}");
    }

    /// Pairs that no penalty closes are given up, and never an answer, however well the problems are solved.
    #[test]
    fn pairs_that_stay_open_are_no_answer() {
        for open in [1e-6, 5e-4, 0.3] {
            let (end, level, begun) = follow(KEPT, |_| open);
            assert_eq!(end, Advance::GiveUp, "{open}");
            assert!(begun.len() <= IDLE + 1 && level.sigma >= 1e-4, "{open} {level:?}");
        }
    }

    /// Points that are not solved to the tolerance are answers where they keep the error of an accepted one, and not otherwise.
    #[test]
    fn an_error_that_gets_no_smaller_is_accepted_or_not() {
        let level = Level { mu: KEPT_BARRIER, sigma: 1e-3 };
        let ends = |error: f64| {
            let mut path = Penalties::new(MpccSettings::default(), 0..1, level, KEPT);
            let m = Measures { error, error0: error, ..solved(level, 1e-9) };
            (0..100).map(|_| path.advance(&m)).find(|a| *a != Advance::Stay)
        };
        assert_eq!(ends(0.9 * ACCEPTED), Some(Advance::Done));
        assert_eq!(ends(2.0 * ACCEPTED), Some(Advance::GiveUp));
    }
}
