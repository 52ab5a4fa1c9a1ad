//! The path of relaxed problems: `σ` tied to the barrier parameter.
//!
//! First the problem with `σ = σ_0` is solved (the plateau: this one decides which local optimum is found); then a
//! ladder `σ ← max(σ_end, min(κ σ, σ^1.5))`, `μ ≤ ρ σ`, every rung only to `E ≤ 10 ρ σ` with all multipliers passed on.
//! A rung whose steps stay short first gets the barrier back that belongs to its relaxation, as after a long plateau iterates
//! hug their bounds; where that does not help, or the path jams, it is taken back to where the last one was left, and one
//! between is tried. The barrier of a user's program is far below its relaxation ([`LIGHT`]): which member of a pair goes to zero
//! is then decided by the objective, not by the barrier.
//!
//! Far from feasible points steps are cut to a hundredth, while multipliers of bounds go most of their way at each of them: they
//! inflate, and with them the Hessian of the Lagrangian gets so indefinite that the shift that mends it leaves nothing of the
//! objective. A barrier that gets stronger adds to that. So where all of a row of short steps had to be shifted, the multipliers are
//! estimated anew first.
//!
//! `σ_0` is a guess. At the end of the plateau the multipliers of the relaxed rows tell what it costs: `σ Σ y` is the
//! derivative of the optimal objective with respect to `ln σ`. Where that weighs in the scaled objective the first
//! problem was not a relaxation that lets the objective choose, and one with a larger `σ` is solved from there. As this doubles the
//! iterations of many programs that it does not change the answer of, only paths with an objective of the usual weight do so.

use std::ops::Range;

use super::settings::MpccSettings;
use crate::nlp::{lower_barrier, Advance, Continuation, Level, Measures, Monotone};

/// The schedule of the Scholtes relaxation.
#[derive(Debug, Clone)]
pub struct Scholtes {
    settings: MpccSettings,
    rows: Range<usize>,
    start: Level,
    end: f64,
    on_plateau: bool,
    raises: usize,
    /// Iterations on the present rung.
    stays: usize,
    /// Short steps in a row.
    short: usize,
    /// The last relaxation that was solved.
    solved: f64,
    /// Smallest reduction, after a rung that was too far.
    gentle: f64,
    /// Is this the program of a user? Of what knows its start, a discretisation, the ladder is as steep as it is.
    given: bool,
    /// Is the price of the first relaxation asked? Its objective has a scale that this can be compared with.
    priced: bool,
    /// How often the first relaxation was enlarged.
    enlarged: usize,
    /// Barrier parameter at which the present first problem counts as solved.
    plateau_mu: f64,
    /// Iterations of the first relaxed problem and of those behind it, those before this path went on included; nothing where these may take as many as
    /// they want.
    spent: Option<Spent>,
    /// Short steps in a row whose Hessian was shifted.
    shifted: usize,
    /// Were multipliers of the first relaxed problem estimated anew?
    renewed: bool,
}

/// Iterations of a path.
#[derive(Debug, Clone, Copy, Default)]
pub struct Spent {
    plateau: usize,
    rungs: usize,
}

/// Iterations that all rungs may take where other strategies may follow: so many, and the same as a multiple of those of the first problem. Of 210
/// programs of fourteen kinds that the path solves two took more, and another strategy solved them; a path that takes more creeps, mostly to nothing.
const RUNGS: usize = 250;
const RUNGS_SHARE: usize = 3;
/// Iterations after which an almost feasible rung counts as done: where the multipliers have no limit the error
/// never gets small, and the next rung, or the polish, decides more than further iterations.
const RUNG_ITERATIONS: usize = 30;
/// Error at which the plateau ends, over its last barrier parameter.
const PLATEAU_ERROR: f64 = 10.0;
/// A step shorter than this is a short one.
const SHORT: f64 = 0.1;
/// Short steps in a row that say a level is too far away.
const PATIENT_STEPS: usize = 8;
/// Short steps in a row that say the barrier is too weak for the relaxation.
const HUGGING_STEPS: usize = 3;
/// Share of the barrier parameter that belongs to a relaxation below which it is weak.
const HUGGED: f64 = 0.9;
/// Iterations at the end of the plateau after which a feasible point counts as its solution, as on a rung.
const PLATEAU_ITERATIONS: usize = 20;
/// Barrier parameter of a rung of a user's program, over the one that belongs to its relaxation. The barrier moves a variable of reduced
/// gradient `g` by `μ/g`, the relaxation moves the other member of its pair by the order of `σ`: with `μ = ρ σ` parts of the objective
/// below `ρ` times its largest derivative do not decide which one it is that goes to zero. Rungs are left as loosely as with the whole
/// one: it is the barrier that counts, errors of that size do not.
const LIGHT: f64 = 0.01;
/// The same that a rung gets whose steps stay short.
const CENTRING: f64 = 0.3;
/// Share of one unit of the scaled objective from which the price of the first relaxation counts, the factor by which that is
/// then enlarged, with the barrier parameter it begins at, relative to the first one, and how often. The barrier parameter that the
/// larger one is solved to is larger by the same factor: solved further, its iterates hug bounds that the rungs down to the first
/// relaxation take them away from again.
const PRICE: f64 = 0.7;
const ENLARGEMENT: f64 = 100.0;
const ENLARGED_MU: f64 = 0.2;
const MAX_ENLARGEMENTS: usize = 1;

impl Scholtes {
    /// A path from the initial relaxation to `sigma_end`.
    pub fn new(settings: MpccSettings, rows: Range<usize>, sigma_end: f64) -> Scholtes {
        let start = Level { mu: settings.mu_init, sigma: settings.sigma_init };
        Scholtes { on_plateau: start.sigma > sigma_end, ..Scholtes::resume(settings, rows, start, sigma_end) }
    }

    /// A path that goes on from `level`.
    pub fn resume(settings: MpccSettings, rows: Range<usize>, level: Level, sigma_end: f64) -> Scholtes {
        Scholtes {
            rows,
            start: level,
            end: sigma_end,
            on_plateau: false,
            raises: 0,
            stays: 0,
            short: 0,
            solved: level.sigma,
            gentle: 0.0,
            given: false,
            priced: false,
            enlarged: 0,
            plateau_mu: settings.plateau_mu,
            spent: None,
            shifted: 0,
            renewed: false,
            settings,
        }
    }

    /// This path for the program of a user (`given`), whose first relaxation may be enlarged where it weighs (`priced`).
    pub fn of(self, given: bool, priced: bool) -> Scholtes {
        Scholtes { given, priced: given && priced, ..self }
    }

    /// This path as one of several strategies, after so many iterations of it: what creeps ends.
    pub fn after(self, spent: Option<Spent>) -> Scholtes {
        Scholtes { spent, ..self }
    }

    /// Iterations so far, where they are counted.
    pub fn spent(&self) -> Option<Spent> {
        self.spent
    }

    /// Counts an iteration. Do the rungs take more than another strategy would?
    fn creeps(&mut self) -> bool {
        let Some(spent) = &mut self.spent else { return false };
        *(if self.on_plateau { &mut spent.plateau } else { &mut spent.rungs }) += 1;
        spent.rungs > RUNGS.max(RUNGS_SHARE * spent.plateau)
    }

    /// The barrier parameter that a rung begins with.
    fn barrier(&self, sigma: f64) -> f64 {
        let share = if self.given { LIGHT } else { 1.0 };
        share * self.settings.mu_over_sigma * sigma
    }

    fn rung(&mut self, sigma: f64, mu: f64) -> Level {
        let s = &self.settings;
        let next = (s.sigma_factor * sigma).min(sigma.powf(s.sigma_exponent)).max(self.gentle * sigma);
        self.stays = 0;
        self.short = 0;
        self.solved = sigma;
        let sigma = next.max(self.end);
        Level { sigma, mu: self.barrier(sigma).min(mu) }
    }

    /// The relaxation that was made use of: with the largest product for `σ` this point solves the same problem.
    fn reached(&self, m: &Measures) -> f64 {
        if self.rows.is_empty() || !self.given {
            m.level.sigma
        } else {
            m.level.sigma.min(m.pair_product).max(self.end)
        }
    }

    /// The next level while the first relaxed problem is solved.
    fn advance_plateau(&mut self, m: &Measures) -> Advance {
        let Level { mu, sigma } = m.level;
        let s = self.settings;
        if mu > self.plateau_mu {
            if m.error <= 10.0 * mu {
                self.short = 0;
                return Advance::To(Level { mu: lower_barrier(mu, self.plateau_mu), sigma });
            }
        } else {
            self.stays += 1;
            let solved = m.error <= PLATEAU_ERROR * self.plateau_mu || (self.given && self.stays > PLATEAU_ITERATIONS);
            if solved && m.primal <= s.plateau_viol {
                // what the barrier adds to the multipliers of rows that do not bind is no price
                let price = m.pull - mu * self.rows.len() as f64;
                if self.priced && price > PRICE && self.enlarged < MAX_ENLARGEMENTS {
                    self.enlarged += 1;
                    self.plateau_mu *= ENLARGEMENT;
                    (self.stays, self.short) = (0, 0);
                    return Advance::To(Level { mu: ENLARGED_MU * s.mu_init, sigma: ENLARGEMENT * sigma });
                }
                self.on_plateau = false;
                return Advance::To(self.rung(self.reached(m), mu));
            }
        }
        self.shifted = if m.alpha < SHORT && m.shift > 0.0 { self.shifted + 1 } else { 0 };
        let inflated = self.short > PATIENT_STEPS && self.shifted >= PATIENT_STEPS;
        if self.given && inflated && !self.renewed {
            self.renewed = true;
            (self.stays, self.short) = (0, 0);
            return Advance::Renew;
        }
        if self.short > PATIENT_STEPS && self.raises < s.sigma_retries {
            // the iterates hug their bounds: a stronger barrier moves them away
            self.raises += 1;
            (self.stays, self.short) = (0, 0);
            return Advance::To(Level { mu: 10.0 * mu, sigma });
        }
        Advance::Stay
    }

    /// A rung between the last one that was solved and `sigma`, unless they are close.
    fn between(&mut self, sigma: f64) -> Option<Level> {
        if self.raises >= self.settings.sigma_retries || self.solved < 2.0 * sigma {
            return None;
        }
        self.raises += 1;
        self.stays = 0;
        self.short = 0;
        self.gentle = (sigma / self.solved).sqrt();
        let sigma = (sigma * self.solved).sqrt();
        Some(Level { sigma, mu: self.settings.mu_over_sigma * sigma })
    }
}

impl Continuation for Scholtes {
    fn start(&mut self) -> Level {
        self.start
    }

    fn advance(&mut self, m: &Measures) -> Advance {
        let Level { mu, sigma } = m.level;
        let s = self.settings;
        self.short = if m.alpha < SHORT { self.short + 1 } else { 0 };
        if self.creeps() {
            return Advance::GiveUp;
        }
        if self.on_plateau {
            return self.advance_plateau(m);
        }
        self.stays += 1;
        let stuck = self.stays > RUNG_ITERATIONS && m.primal <= (10.0 * sigma).max(1e-4);
        // as loose as if the barrier parameter were the whole one
        if m.error > 10.0 * mu.max(s.mu_over_sigma * sigma) && !stuck {
            let centring = CENTRING * s.mu_over_sigma * sigma;
            if self.given && self.short >= HUGGING_STEPS && mu < HUGGED * centring {
                self.short = 0;
                return Advance::To(Level { mu: centring, sigma });
            }
            if self.short > PATIENT_STEPS {
                if let Some(level) = self.between(sigma) {
                    return Advance::Back(level);
                }
            }
            return Advance::Stay;
        }
        if sigma > self.end {
            return Advance::To(self.rung(self.reached(m), mu));
        }
        // the last rung: the barrier goes below the relaxation
        if m.error0 <= s.tol.max(self.end) && m.primal <= s.tol.max(self.end) {
            return Advance::Done;
        }
        let floor = 0.1 * s.tol.max(self.end);
        if stuck {
            if self.end > s.sigma_min {
                Advance::Done
            } else {
                Advance::GiveUp
            }
        } else if mu > floor {
            Advance::To(Level { mu: lower_barrier(mu, floor), sigma })
        } else {
            Advance::Stay
        }
    }

    fn jammed(&mut self, m: &Measures) -> Option<Level> {
        if self.on_plateau || self.raises >= self.settings.sigma_retries / 2 {
            return None;
        }
        self.between(m.level.sigma)
    }

    fn relaxed_rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// On the way down; the first problem decides which local optimum is found, and is left to plain steps.
    fn corrects(&self) -> bool {
        self.given && !self.on_plateau
    }
}

/// The monotone barrier rule for a branch problem, which may have no solution: it gives up when the violation has
/// stopped falling.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    rule: Monotone,
    best: f64,
    since: usize,
    patience: usize,
}

/// Iterations without a violation half as large that end a branch.
const PATIENCE: usize = 5;
/// The same from a point that may be far from a solution.
const FAR_PATIENCE: usize = 30;
/// Violation from which more of them are worth it.
const CLOSE: f64 = 1e-6;

impl Branch {
    pub fn new(rule: Monotone) -> Branch {
        Branch { rule, best: f64::INFINITY, since: 0, patience: PATIENCE }
    }

    /// The same from a point that may be far from a solution.
    pub fn far(rule: Monotone) -> Branch {
        Branch { patience: FAR_PATIENCE, ..Branch::new(rule) }
    }
}

impl Continuation for Branch {
    fn start(&mut self) -> Level {
        self.rule.start()
    }
    fn advance(&mut self, m: &Measures) -> Advance {
        if m.primal <= 0.5 * self.best {
            self.best = m.primal;
            self.since = 0;
        } else {
            self.since += 1;
        }
        let patience = if m.primal > CLOSE { self.patience } else { self.patience.max(3 * PATIENCE) };
        if self.since > patience && m.primal > m.rounding.max(1e-9) {
            return Advance::GiveUp;
        }
        self.rule.advance(m)
    }
}

/// Newton's method on a square system: done at rounding, or where it no longer gets better close to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settle {
    primal_tol: f64,
    dual_tol: f64,
    consistency: f64,
    best: f64,
    since: usize,
    steps: usize,
}

/// Scaled error of a square system that is as good as rounding allows.
const SETTLED: f64 = 1e-11;
/// Newton steps that do not help, and Newton steps in all, before a square system is given up.
const WAIT: usize = 2;
const MAX_STEPS: usize = 20;

impl Settle {
    /// `steepness` is the size of the gradient of the objective, which rounding is relative to.
    pub fn new(primal_tol: f64, consistency: f64, steepness: f64) -> Settle {
        Settle { primal_tol, dual_tol: SETTLED * steepness, consistency, best: f64::INFINITY, since: 0, steps: 0 }
    }
}

impl Continuation for Settle {
    fn start(&mut self) -> Level {
        Level { mu: 1e-12, sigma: 0.0 }
    }
    fn advance(&mut self, m: &Measures) -> Advance {
        let error = m.primal.max(m.dual);
        let primal_tol = self.primal_tol.max(m.rounding);
        if m.primal <= primal_tol && m.dual <= self.dual_tol {
            return Advance::Done;
        }
        self.since = if error <= 0.5 * self.best { 0 } else { self.since + 1 };
        self.best = self.best.min(error);
        self.steps += 1;
        if self.since > WAIT || self.steps > MAX_STEPS {
            // an active set that is consistent up to the tolerance of the data
            return if m.primal <= self.consistency.max(primal_tol) && m.dual <= 100.0 * self.dual_tol {
                Advance::Done
            } else {
                Advance::GiveUp
            };
        }
        Advance::Stay
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Multipliers that inflated along short steps are estimated anew, once; the barrier is what is raised where curvature is no matter.
    #[test]
    fn inflated_multipliers_are_renewed_before_the_barrier_rises() {
        let settings = MpccSettings::default();
        let level = Level { mu: settings.mu_init, sigma: settings.sigma_init };
        let after_short_steps = |path: &mut Scholtes, shift: f64| {
            let m = Measures {
                level,
                error: 1e3,
                error0: 1e3,
                primal: 1.0,
                dual: 1e3,
                pair_product: 1.0,
                rounding: 1e-16,
                alpha: 1e-2,
                shift,
                pair_min: 1.0,
                elastic: 0.0,
                pull: 0.0,
            };
            (0..=PATIENT_STEPS).map(|_| path.advance(&m)).last()
        };
        let raised = Some(Advance::To(Level { mu: 10.0 * level.mu, ..level }));
        let path = || Scholtes::new(MpccSettings { plateau_mu: 1e-4, ..settings }, 0..1, 1e-8).of(true, false);
        let mut shifted = path();
        assert_eq!(after_short_steps(&mut shifted, 1.0), Some(Advance::Renew));
        assert_eq!(after_short_steps(&mut shifted, 1.0), raised);
        assert_eq!(after_short_steps(&mut path(), 0.0), raised);
    }

    /// Rungs that take more iterations than they may end the path where other strategies may follow, in this run of it or the next.
    #[test]
    fn what_creeps_is_given_up_where_others_may_follow() {
        let settings = MpccSettings::default();
        let level = Level { mu: 1e-6, sigma: 1e-4 };
        let m = Measures {
            level,
            error: 1.0,
            error0: 1.0,
            primal: 1.0,
            dual: 1.0,
            pair_product: 1e-4,
            rounding: 1e-16,
            alpha: 0.5,
            shift: 0.0,
            pair_min: 1e-4,
            elastic: 0.0,
            pull: 0.0,
        };
        let path = |spent| Scholtes::resume(settings, 0..1, level, 1e-8).of(true, false).after(spent);
        let given_up = |path: &mut Scholtes| (1..=2 * RUNGS).find(|_| path.advance(&m) == Advance::GiveUp);
        assert_eq!(given_up(&mut path(None)), None);
        let mut first = path(Some(Spent::default()));
        assert_eq!(given_up(&mut first), Some(RUNGS + 1));
        assert_eq!(given_up(&mut path(first.spent())), Some(1));
    }

    /// A first relaxation that weighs is enlarged once, and the barrier parameter that it is solved to with it.
    #[test]
    fn the_barrier_of_an_enlarged_relaxation_ends_with_it() {
        let settings = MpccSettings { plateau_mu: 1e-4, ..MpccSettings::default() };
        let mut path = Scholtes::new(settings, 0..1, 1e-8).of(true, true);
        let mut ask = |level: Level| {
            path.advance(&Measures {
                level,
                error: 0.0,
                error0: 0.0,
                primal: 0.0,
                dual: 0.0,
                pair_product: level.sigma,
                rounding: 1e-16,
                alpha: 1.0,
                shift: 0.0,
                pair_min: 1.0,
                elastic: 0.0,
                pull: 2.0 * PRICE,
            })
        };
        let first = Level { mu: 1e-4, sigma: settings.sigma_init };
        let Advance::To(large) = ask(first) else { panic!("not enlarged") };
        assert_eq!(large.sigma, ENLARGEMENT * first.sigma);
        assert!(large.mu > ENLARGEMENT * first.mu);
        let end = Level { mu: ENLARGEMENT * first.mu, ..large };
        assert_eq!(ask(large), Advance::To(end));
        let Advance::To(rung) = ask(end) else { panic!("solved further") };
        assert!(rung.sigma < large.sigma && rung.mu <= end.mu);
    }

    /// The barrier of a user's program stays far below the relaxation, that of a discretisation, whose start is near, as near as the option
    /// says. It never rises on the way down.
    #[test]
    fn the_barrier_leaves_the_choice_to_the_objective() {
        let settings = MpccSettings::default();
        let ratio = |given: bool, mu: f64| {
            let level = Level { mu: 1.0, sigma: 0.1 };
            let next = Scholtes::resume(settings, 0..1, level, 1e-8).of(given, false).rung(level.sigma, mu);
            next.mu / next.sigma
        };
        assert!((ratio(false, 1.0) - settings.mu_over_sigma).abs() < 1e-15);
        assert!(ratio(true, 1.0) <= 0.1 * settings.mu_over_sigma);
        assert!(ratio(true, 1e-9) < ratio(true, 1.0));
    }
}
