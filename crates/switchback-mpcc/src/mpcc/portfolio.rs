//! What a solve goes on with where its path ends without a solution: other strategies, within the same limits.
//!
//! The first path is the fastest on most programs, and no strategy is the best on all: where it ends at a point that is
//! no solution, the others follow one after the other, each with a share of the iterations that are left, and the first
//! solution ends the search. The solution of a relaxation, where that is all there is, comes after them. Only then is it asked
//! whether there is a feasible point at all ([`violation`]).
//!
//! Which local optimum a path leads to is chance where there are several. With [`Portfolio::Agree`] paths on which the objective
//! weighs differently follow a solution until two have the same objective, which is a sign that there are no others; the best one is
//! kept. Such a path ends where the solution of its relaxed problem is no better than the best answer: feasible sets shrink with
//! the relaxation, so that what follows on it is no better either.

use super::branches::Place;
use super::claims::Shown;
use super::problem::{Mpcc, Side};
use super::proposer::{ActiveSetProposer, NoProposals};
use super::scaling::Weight;
use super::settings::MpccSettings;
use super::solver::{MpccSolver, Polish, Solution};
use super::violation::{self, Violation};
use super::Warm;
use crate::mpcc::certificate::BStationarity;
use crate::nlp::{Bounds, Control, Outcome, INFINITE};
use crate::settings::{Homotopy, Portfolio, Relaxation};
use crate::stop;

/// How an answer was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum FoundBy {
    /// The path that the settings describe.
    #[default]
    Path = 0,
    /// The path from the pairs as they were given, instead of centred ones.
    AsGiven = 1,
    /// Product multipliers are not limited.
    Unlimited = 2,
    /// Every relaxed problem is solved before the next one.
    Outer = 3,
    /// The elastic mode in the maximum norm.
    Elastic = 4,
    /// From a point that minimises the violation of the constraints.
    Feasible = 5,
    /// The path with an objective that weighs much more beside barrier and relaxation.
    Heavy = 6,
    /// The path with an objective that weighs less than in `Heavy` and more than usual.
    Middle = 7,
    /// A branch that a model of the program at another answer promises to be better.
    Models = 8,
    /// The path with factors of one instead of those by gradients, or the other way round.
    OtherScaling = 9,
    /// By branch and bound.
    Branches = 10,
}

impl FoundBy {
    /// Name as in reports.
    pub fn name(self) -> &'static str {
        match self {
            FoundBy::Path => "path",
            FoundBy::AsGiven => "as_given",
            FoundBy::Unlimited => "unlimited",
            FoundBy::Outer => "outer",
            FoundBy::Elastic => "elastic",
            FoundBy::Feasible => "feasible",
            FoundBy::Heavy => "heavy",
            FoundBy::Middle => "middle",
            FoundBy::Models => "models",
            FoundBy::OtherScaling => "other_scaling",
            FoundBy::Branches => "branches",
        }
    }
}

/// The order in which they are tried.
const ORDER: [FoundBy; 6] =
    [FoundBy::OtherScaling, FoundBy::Elastic, FoundBy::Heavy, FoundBy::Outer, FoundBy::Unlimited, FoundBy::AsGiven];
/// Those that follow a solution until two agree, and the weights of the objective on them.
const OPINIONS: [(FoundBy, Weight); 2] = [(FoundBy::Middle, Weight::More), (FoundBy::Heavy, Weight::Heavy)];
/// Iterations of one of them, as a multiple of those of the solution they follow.
const OPINION_SHARE: f64 = 3.0;
/// Share of the objective up to which two answers have the same one.
const SAME: f64 = 1e-5;
/// Share of the iterations that the path gets where others may follow, and that is kept for the search of a feasible point.
const PATH_SHARE: f64 = 0.5;
const KEPT_SHARE: f64 = 0.15;
/// Share of the objective by which the solution of a relaxation has to be better than an exact one to be the answer instead.
const RELAXED_SHARE: f64 = 1e-3;
/// Violation of the least violated point that counts as none, relative to scaled rows above 1.
const MET: f64 = 1e-8;
/// First relaxation of a path to the least violation beside the usual one.
const WIDE: f64 = 100.0;
/// Share by which one violation has to be below another to be lower.
const LOWER: f64 = 1e-6;

/// Where the violation is minimised from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Opinion {
    /// The point that the solve ended at.
    Near,
    /// By the whole path, the start of the solve with the larger member of every pair at zero, and the smaller one in its place.
    OtherSides,
    /// By the whole path, the start of the solve, with a first relaxation that lets the violation fall through products that are large.
    WidePath,
    /// By the whole path, the start of the solve.
    WholePath,
    /// The point that this path ended at, with the smaller member of every pair at zero.
    NearItsEnd,
}

/// What one more point says about the least violation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Weighed {
    /// It is a minimiser, and the lowest so far.
    Lowest,
    /// It is above the lowest so far.
    Higher,
    /// It is lower and no minimiser: one near it has to be found.
    Doubtful,
    /// Nothing is shown any more.
    Nothing,
}

/// What the point is that an opinion ended at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Minimiser,
    Elsewhere,
    /// A limit ended it on the way.
    Cut,
}

/// `least` is the violation of the lowest minimiser so far, `found` that of another point.
fn weigh(opinion: Opinion, least: Option<f64>, found: f64, end: End) -> Weighed {
    let lower = least.is_none_or(|least| found < (1.0 - LOWER) * least);
    let higher = least.is_some_and(|least| found > (1.0 + LOWER) * least);
    match end {
        End::Minimiser if lower && opinion == Opinion::Near => Weighed::Lowest,
        // least violations that differ are those of different places: there may be a lower one yet
        End::Minimiser if lower || higher => Weighed::Nothing,
        // where it was going to is not known
        End::Cut => Weighed::Nothing,
        _ if !lower => Weighed::Higher,
        _ if opinion == Opinion::WholePath => Weighed::Doubtful,
        _ => Weighed::Nothing,
    }
}

impl MpccSolver {
    /// Is there no answer yet, and a reason to go on?
    pub(super) fn is_open(&self) -> bool {
        matches!(self.solution.outcome, Outcome::Stalled | Outcome::Infeasible | Outcome::MaxIter)
            && self.solution.polish != Polish::Done
            && stop::requested().is_none()
            && self.iterations_left() > 0
    }

    /// Is there an answer, and room to look for a better one?
    fn may_be_better(&self) -> bool {
        self.solution.outcome == Outcome::Solved && stop::requested().is_none() && self.iterations_left() > 0
    }

    pub(super) fn iterations_left(&self) -> usize {
        self.settings.max_iter.saturating_sub(self.solution.stats.iterations)
    }

    /// May other strategies follow? Without a polish the answer is that of the relaxation that was asked for.
    pub(super) fn has_others(&self) -> bool {
        self.policy.goes_on && self.settings.portfolio != Portfolio::Off && self.settings.polish
    }

    /// Iterations of the path: those of others that may follow are kept.
    pub(super) fn path_iterations(&self) -> usize {
        let all = self.settings.max_iter;
        if !self.has_others() {
            return all;
        }
        all.min((PATH_SHARE * self.shared_iterations() as f64).ceil() as usize)
    }

    /// Iterations that the strategies share: not fewer than usual. Fewer that are allowed cut the same solve earlier, so that a program
    /// is solved by every limit from the iterations on that it takes.
    fn shared_iterations(&self) -> usize {
        self.settings.max_iter.max(MpccSettings::default().max_iter)
    }

    /// Tries the other strategies where the path has no solution. What was found before stays where they have none.
    pub(super) fn go_on(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        (interior, centred): (bool, bool),
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        for strategy in ORDER {
            let better = self.settings.portfolio == Portfolio::All && self.may_be_better();
            if !better && !self.is_open() {
                return;
            }
            let useless = match strategy {
                FoundBy::AsGiven => !centred,
                FoundBy::Unlimited => !self.settings.convexify_pairs,
                FoundBy::Outer => self.settings.homotopy == Homotopy::Outer,
                FoundBy::Elastic => self.settings.relaxation == Relaxation::LinfPenalty,
                FoundBy::Heavy => !self.settings.scaling,
                FoundBy::OtherScaling => false,
                FoundBy::Path | FoundBy::Feasible | FoundBy::Middle | FoundBy::Models | FoundBy::Branches => true,
            };
            if useless {
                continue;
            }
            let allowed = self.settings.max_iter;
            let used = self.solution.stats.iterations;
            let shared = self.shared_iterations();
            let kept = (KEPT_SHARE * shared as f64) as usize;
            let limit = allowed.min(used + shared.saturating_sub(used + kept) / 2);
            self.attempt(strategy, limit, |s| {
                if strategy == FoundBy::Elastic {
                    return s.try_elastic(p, bounds, x0, control, proposer);
                }
                let given = s.settings;
                match strategy {
                    FoundBy::Unlimited => s.settings.convexify_pairs = false,
                    FoundBy::Outer => s.settings.homotopy = Homotopy::Outer,
                    FoundBy::OtherScaling => {
                        s.settings.scaling = !given.scaling;
                        s.scale(p, bounds, x0);
                    }
                    _ => {}
                }
                let weight = if strategy == FoundBy::Heavy { Weight::Heavy } else { Weight::Plain };
                let centre = interior && centred && strategy != FoundBy::AsGiven;
                s.follow_weighed(p, bounds, x0, (weight, centre), control, proposer);
                s.settings = given;
                if strategy == FoundBy::OtherScaling {
                    s.scale(p, bounds, x0);
                }
            });
        }
    }

    /// Looks for another answer with iterations up to the `limit`. What was found before stays where it says more.
    fn attempt<R>(&mut self, strategy: FoundBy, limit: usize, body: impl FnOnce(&mut Self) -> R) -> R {
        let before = self.solution.clone();
        (self.solution.polish, self.solution.found_by) = (Polish::None, strategy);
        let allowed = std::mem::replace(&mut self.settings.max_iter, limit);
        let said = body(self);
        self.settings.max_iter = allowed;
        self.keep(before, strategy);
        said
    }

    /// The path on which the objective has another weight.
    fn follow_weighed(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        (weight, centre): (Weight, bool),
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        let other = weight != Weight::Plain;
        if other {
            self.weigh_objective(p, bounds, x0, weight);
        }
        self.follow(p, bounds, x0, centre, control, proposer);
        self.doubt_relaxed();
        if other {
            self.weigh_objective(p, bounds, x0, Weight::Plain);
        }
    }

    /// Follows other paths than that of the solution, until two have answers of the same objective. The best answer is kept.
    pub(super) fn compare(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        centre: bool,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        let exact = self.solution.polish == Polish::Done;
        if self.settings.portfolio != Portfolio::Agree || !self.settings.scaling || !exact {
            return;
        }
        let allowed = self.settings.max_iter;
        let each = (OPINION_SHARE * self.solution.stats.iterations as f64).ceil() as usize;
        for (strategy, weight) in OPINIONS {
            if !self.may_be_better() {
                return;
            }
            let best = self.solution.objective;
            let limit = allowed.min(self.solution.stats.iterations + each);
            let agrees = self.attempt(strategy, limit, |s| {
                s.rival = Some(best);
                s.follow_weighed(p, bounds, x0, (weight, centre), control, proposer);
                s.rival = None;
                let found = &s.solution;
                let close = (found.objective - best).abs() <= SAME * (s.st.scaling.one() + best.abs());
                found.outcome == Outcome::Solved && close
            });
            if agrees {
                break;
            }
        }
    }

    /// Is the relaxed problem just recorded no better than the answer that this path competes with? The barrier keeps its objective
    /// above the optimal one by its parameter for each bound, as long as the problem is like a convex one.
    pub(super) fn is_beaten(&self) -> bool {
        let Some(best) = self.rival else { return false };
        let (b, scaling) = (&self.bounds, &self.st.scaling);
        let finite = |lower: &[f64], upper: &[f64]| -> usize {
            let sides = lower.iter().zip(upper).filter(|(l, u)| l < u);
            sides.map(|(l, u)| usize::from(*l > -INFINITE) + usize::from(*u < INFINITE)).sum()
        };
        let gap = self.ipm.level().mu * (finite(&b.xl, &b.xu) + finite(&b.cl, &b.cu)) as f64 / scaling.objective;
        self.solution.objective - gap >= best + SAME * (scaling.one() + best.abs())
    }

    /// The solution of a small relaxation is an answer where there is no exact one, or no exact one that is as good: its products are as
    /// small as tolerances, its objective is no better than an exact one could be by more than that.
    pub(super) fn settle_for_relaxed(&mut self) {
        let Some(relaxed) = self.relaxed_answer.take() else { return };
        let s = &self.solution;
        let stopped = matches!(s.outcome, Outcome::MaxTime | Outcome::Stopped);
        let solved = s.outcome == Outcome::Solved;
        let share = RELAXED_SHARE * (self.st.scaling.one() + s.objective.abs());
        if !stopped && (!solved || relaxed.objective < s.objective - share) {
            let stats = s.stats;
            self.solution = Solution { stats, ..relaxed };
        }
    }

    /// Where the last relaxed problem is solved and no exact point was found, others are tried before it is the answer.
    pub(super) fn doubt_relaxed(&mut self) {
        if self.solution.outcome == Outcome::Solved && self.solution.polish == Polish::Rejected {
            self.keep_relaxed(self.solution.clone());
            self.solution.outcome = Outcome::Stalled;
        }
    }

    /// Keeps the better one of two solutions of small relaxations.
    pub(super) fn keep_relaxed(&mut self, new: Solution) {
        if self.relaxed_answer.as_ref().is_none_or(|old| new.objective < old.objective) {
            self.relaxed_answer = Some(new);
        }
    }

    /// Scales anew, with an objective of another weight.
    fn weigh_objective(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64], weight: Weight) {
        self.st.scaling.weight = weight;
        self.scale(p, bounds, x0);
    }

    /// Keeps the present solution, or the one of before where that says more.
    pub(super) fn keep(&mut self, before: Solution, strategy: FoundBy) {
        let rank = |s: &Solution| match s.outcome {
            Outcome::Solved => 0,
            Outcome::MaxTime | Outcome::Stopped => 1,
            Outcome::Infeasible | Outcome::LocallyInfeasible => 2,
            Outcome::Stalled => 3,
            Outcome::MaxIter => 4,
            _ => 5,
        };
        let worse = |s: &Solution, t: &Solution| {
            let value = |s: &Solution| match s.outcome {
                Outcome::Solved => s.objective,
                _ => s.residuals.primal.max(s.residuals.pair_product),
            };
            let of = |s: &Solution| (rank(s), value(s));
            let ((i, a), (j, b)) = (of(s), of(t));
            i > j || (i == j && (a >= b || a.is_nan()))
        };
        self.solution.found_by = strategy;
        if worse(&self.solution, &before) {
            let stats = self.solution.stats;
            self.solution = Solution { stats, ..before };
        }
    }

    /// The elastic mode, by a solver of its own: its programs have a variable more.
    fn try_elastic(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        let settings = MpccSettings {
            relaxation: Relaxation::LinfPenalty,
            homotopy: Homotopy::Outer,
            max_iter: self.iterations_left(),
            portfolio: Portfolio::Off,
            ..self.settings
        };
        let mut solver = match self.elastic.take() {
            Some(s) => s,
            None => match MpccSolver::new(p, settings) {
                Ok(s) => Box::new(s),
                Err(_) => return,
            },
        };
        solver.settings = settings;
        solver.exact_rows = true;
        solver.is_part = true;
        solver.solve_with(p, bounds, x0, control, proposer);
        let mut stats = self.solution.stats;
        stats.add(&solver.solution.stats);
        self.solution.clone_from(&solver.solution);
        self.solution.stats = stats;
        self.elastic = Some(solver);
    }

    /// Where nothing has a solution: a point that violates the constraints least. If it violates nothing its branch is
    /// solved from there; if its certificate says that no step lowers the violation the program is infeasible, as far as
    /// this can be said from near the point; otherwise that stays open. As the violation of a program that has a solution
    /// may have such points, too, the claim needs further opinions: whole paths to the least violation from the start `x0`, one
    /// from the other sides of its pairs, one with a wide first relaxation and one with the usual one, must not come to another
    /// one. Where the usual one ends lower at a point that is not shown to be a minimiser, the branch in which the smaller
    /// member of every pair is zero is asked; where that comes lower, too, nothing is claimed.
    pub(super) fn find_least_violation(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        shown: Shown,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        let asked = self.has_others() || self.solution.outcome == Outcome::Infeasible;
        if self.is_part || !(asked && self.is_open()) {
            return self.retract();
        }
        if let Some(place) = &shown.place {
            return self.go_on_from_place(p, bounds, x0, place, control, proposer);
        }
        let Ok(mut st) = violation::Structure::new(p) else { return self.retract() };
        st.weights.copy_from_slice(&self.st.scaling.rows);
        let mut least: Option<Solution> = None;
        let mut claimable = true;
        let mut from = self.solution.x.clone();
        let mut end: Option<Solution> = None;
        let opinions = [Opinion::Near, Opinion::WidePath, Opinion::OtherSides, Opinion::WholePath, Opinion::NearItsEnd];
        // what is shown needs no further opinion
        let asked = if shown.empty { 1 } else { opinions.len() };
        for opinion in opinions.into_iter().take(asked) {
            match opinion {
                Opinion::Near => {}
                Opinion::WidePath | Opinion::OtherSides | Opinion::WholePath => from.copy_from_slice(x0),
                Opinion::NearItsEnd if claimable && end.is_some() => {}
                Opinion::NearItsEnd => break,
            }
            // where nothing can be claimed any more there may still be a point that violates nothing
            if opinion != Opinion::Near && (stop::requested().is_some() || self.iterations_left() == 0) {
                claimable = false;
                break;
            }
            let attempt = self.minimise_violation(p, &st, bounds, (&from, end.as_ref()), opinion, control);
            let Some((found, met)) = attempt else {
                claimable = false;
                break;
            };
            let solved = found.outcome == Outcome::Solved && found.polish == Polish::Done;
            if solved && found.objective <= met {
                let n = p.n();
                self.enter_feasible(p, bounds, &found.sides, &found.x[..n], control, proposer);
                if self.solution.outcome == Outcome::Solved {
                    return;
                }
                claimable = false;
                continue;
            }
            let certified = solved && found.certificate.b == BStationarity::Yes;
            let point = match found.outcome {
                _ if certified => End::Minimiser,
                Outcome::MaxIter | Outcome::MaxTime | Outcome::Stopped => End::Cut,
                _ => End::Elsewhere,
            };
            match weigh(opinion, least.as_ref().map(|l| l.objective), found.objective, point) {
                Weighed::Lowest => least = Some(found),
                Weighed::Higher => {}
                Weighed::Doubtful => {
                    // it may have come lower only because it had not arrived
                    from.copy_from_slice(&found.x[..p.n()]);
                    for &(a, b) in p.pairs() {
                        let smaller = self.in_order((a, b), &from).0;
                        from[smaller] = 0.0;
                    }
                    end = Some(found);
                }
                Weighed::Nothing => claimable = false,
            }
        }
        let least = least.filter(|_| claimable);
        self.solution.outcome = if shown.empty { Outcome::Infeasible } else { Outcome::LocallyInfeasible };
        self.solution.polish = Polish::None;
        let Some(least) = least else {
            if !shown.empty {
                self.solution.outcome = stop::requested().map_or(Outcome::Stalled, Outcome::from);
            }
            return;
        };
        self.solution.x.copy_from_slice(&least.x[..p.n()]);
        self.solution.y.copy_from_slice(&least.y);
        self.solution.sides.copy_from_slice(&least.sides);
        self.solution.found_by = FoundBy::Feasible;
    }

    /// The point of least violation near that of the solve, with its multipliers, for a program that is shown to have no point; that
    /// of the solve where there are no iterations left for another one.
    pub(super) fn end_at_least_violation(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) {
        let Ok(mut st) = violation::Structure::new(p) else { return };
        st.weights.copy_from_slice(&self.st.scaling.rows);
        let from = self.solution.x.clone();
        let attempt = self.minimise_violation(p, &st, bounds, (&from, None), Opinion::Near, control);
        if let Some((least, _)) = attempt.filter(|a| a.0.outcome == Outcome::Solved) {
            self.solution.x.copy_from_slice(&least.x[..p.n()]);
            self.solution.y.copy_from_slice(&least.y);
        }
    }

    /// Solves the branch of a point that is known, at which all rows hold. Where that has no solution the objective may fall without end.
    fn go_on_from_place(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        place: &Place,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        self.enter_feasible(p, bounds, &place.sides, &place.x, control, proposer);
        if self.solution.outcome != Outcome::Solved {
            self.retract();
            self.find_ray(p, bounds, x0);
        }
    }

    /// The program of the least violation solved from the first of `from`, whose multipliers are those of the second where they
    /// are known; and the violation that counts as none. `None` where its functions have no value.
    fn minimise_violation(
        &mut self,
        p: &mut dyn Mpcc,
        st: &violation::Structure,
        bounds: &Bounds,
        (from, known): (&[f64], Option<&Solution>),
        opinion: Opinion,
        control: &mut Control,
    ) -> Option<(Solution, f64)> {
        let mut c = vec![0.0; p.m()];
        p.eval(from, &mut c).ok()?;
        let met = MET * c.iter().zip(&st.weights).fold(1f64, |a, (c, w)| a.max((c * w).abs()));
        let mut start = st.point(from, &c, bounds);
        if opinion == Opinion::OtherSides {
            for &(a, b) in p.pairs() {
                let (small, large) = self.in_order((a, b), &start);
                let sizes = &self.st.scaling.sizes;
                (start[small], start[large]) = (start[large] / sizes[large] * sizes[small], 0.0);
            }
        }
        let own = st.bounds(bounds);
        let settings = MpccSettings {
            relaxation: Relaxation::Scholtes,
            polish: true,
            square_newton: true,
            certify: true,
            max_iter: self.iterations_left(),
            portfolio: Portfolio::Off,
            centre_pairs: self.settings.centre_pairs && opinion != Opinion::OtherSides,
            sigma_init: if opinion == Opinion::WidePath { WIDE } else { 1.0 } * self.settings.sigma_init,
            ..self.settings
        };
        let (y, z) = (vec![0.0; p.m()], vec![0.0; start.len()]);
        let (y, z) = known.map_or((&y, &z), |s| (&s.y, &s.z));
        let mut program = Violation { inner: p, st };
        let mut solver = MpccSolver::new(&mut program, settings).ok()?;
        solver.st.scaling.as_given = true;
        solver.is_part = true;
        if matches!(opinion, Opinion::Near | Opinion::NearItsEnd) {
            solver.solve_warm(&mut program, &own, &Warm { x: &start, y, z }, control, &mut NoProposals);
        } else {
            solver.solve_with(&mut program, &own, &start, control, &mut NoProposals);
        }
        self.solution.stats.add(&solver.solution.stats);
        Some((solver.solution, met))
    }

    /// The members of a pair, the smaller one first: in the units of the solver, their own may differ.
    fn in_order(&self, (a, b): (usize, usize), x: &[f64]) -> (usize, usize) {
        let sizes = &self.st.scaling.sizes;
        if x[a] / sizes[a] <= x[b] / sizes[b] {
            (a, b)
        } else {
            (b, a)
        }
    }

    /// There is no proof that the program is infeasible.
    fn retract(&mut self) {
        if self.solution.outcome == Outcome::Infeasible {
            self.solution.outcome = stop::requested().map_or(Outcome::Stalled, Outcome::from);
        }
    }

    /// Solves the branch `sides` from its feasible point `x[n]`, and follows descents from there.
    pub(super) fn enter_feasible(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        sides: &[Side],
        x: &[f64],
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        let before = self.solution.clone();
        self.sides.copy_from_slice(sides);
        self.st.start(x, &mut self.point);
        self.close = true;
        let mut ok = self.try_point(p, bounds, control);
        if !ok && stop::requested().is_none() {
            // what violates nothing may be far from what is best in its branch
            self.sides.copy_from_slice(sides);
            self.st.start(x, &mut self.point);
            ok = self.try_far(p, bounds, control);
        }
        if ok {
            self.record_exact(p, control);
            self.improve(p, bounds, control, proposer);
            self.judge(p, bounds, control);
        } else {
            self.retract();
        }
        self.close = false;
        p.set_polishing(false);
        self.keep(before, FoundBy::Feasible);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A claim is taken back by another minimiser, by a point that lies lower, and where a limit cut the second opinion short.
    #[test]
    fn the_second_opinion_can_take_back_a_claim() {
        use End::{Cut, Elsewhere, Minimiser};
        use Opinion::{Near, NearItsEnd, WholePath, WidePath};
        assert_eq!(weigh(Near, None, 0.6, Minimiser), Weighed::Lowest);
        assert_eq!(weigh(Near, None, 0.6, Elsewhere), Weighed::Nothing);
        assert_eq!(weigh(WholePath, Some(0.6), 0.6, Minimiser), Weighed::Higher);
        assert_eq!(weigh(WholePath, Some(0.6), 0.7, Elsewhere), Weighed::Higher);
        // a point below that is no minimiser says that the lowest one was not
        assert_eq!(weigh(WidePath, Some(0.6), 0.6, Minimiser), Weighed::Higher);
        assert_eq!(weigh(WidePath, Some(0.6), 0.03, Elsewhere), Weighed::Nothing);
        for found in [0.03, 0.7] {
            assert_eq!(weigh(WidePath, Some(0.6), found, Minimiser), Weighed::Nothing);
            assert_eq!(weigh(WholePath, Some(0.6), found, Minimiser), Weighed::Nothing);
            assert_eq!(weigh(WholePath, Some(0.6), found, Cut), Weighed::Nothing);
        }
        // first the branch next to it is asked
        assert_eq!(weigh(WholePath, Some(0.6), 0.03, Elsewhere), Weighed::Doubtful);
        assert_eq!(weigh(NearItsEnd, Some(0.6), 0.03, Elsewhere), Weighed::Nothing);
        assert_eq!(weigh(NearItsEnd, Some(0.6), 0.03, Minimiser), Weighed::Nothing);
        assert_eq!(weigh(NearItsEnd, Some(0.6), 19.0, Cut), Weighed::Nothing);
        assert_eq!(weigh(NearItsEnd, Some(0.6), f64::NAN, Elsewhere), Weighed::Higher);
    }
}
