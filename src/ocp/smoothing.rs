//! Starts by smoothing: the problem with smooth weights on fixed steps, wide first and then narrower, is a sequence of
//! ordinary nonlinear programs, each of which starts from the last. Wide problems have few local optima. Every ladder
//! of widths goes to the width at which costs can be compared; those that differ go on to the narrowest one, whose answer
//! says which controls to simulate, see [`super::sequence`].

use super::nominal::{quantile, sample};
use super::request::Request;
use super::solve::{Built, Start};
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::func::Point;
use crate::mpcc::{Solution, Warm};
use crate::nlp::{Control, Nlp, Outcome, Statistics};
use crate::settings::{Discretisation, InitialGuess};
use crate::sim::SolveOptions;
use crate::system::{SharedFunction, Widths};

/// A smoothed problem: width in units of the sizes of the switching functions, barrier parameter it begins with, tolerance.
type Rung = (f64, f64, f64);

/// A point that a ladder begins from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum From {
    /// The guess.
    Guess,
    /// The same, with states that go straight to one that meets the terminal conditions instead of staying as they are at the start.
    Straight,
    /// Random controls within their bounds.
    Random(usize),
}

/// Where ladders begin, the likeliest first: the width, and the point.
const FIRST: [(f64, From); 4] = [(1.0, From::Guess), (0.1, From::Guess), (1.0, From::Straight), (10.0, From::Guess)];
/// Further ladders. They begin narrow: wide problems lead to the same optimum from everywhere.
const MORE: [(f64, From); 4] =
    [(0.3, From::Random(1)), (0.3, From::Random(2)), (0.3, From::Random(3)), (0.3, From::Random(4))];
/// Where a ladder begins from a plan that is known, and where it ends.
const PLAN: [Rung; 2] = [(0.1, 1e-2, 1e-3), NARROWEST];
/// What every ladder goes through from its first width down; at the last one the costs are compared.
const COMMON: [Rung; 3] = [(1.0, 1e-2, 1e-2), (0.3, 1e-2, 1e-2), (0.1, 1e-2, 1e-3)];
/// The last one. A narrower one is not resolved by the grid: its optima are those of the grid.
const NARROWEST: Rung = (0.03, 1e-3, 1e-3);
/// Barrier parameter and tolerance of the first problem of a ladder.
const OPENING: [f64; 2] = [0.1, 1e-2];
/// Difference of the costs of ladders, relative, from which they are different.
const DIFFERENT: f64 = 1e-3;
/// Finite elements of the whole horizon at least, and stages of the method.
const ELEMENTS: usize = 40;
const STAGES: usize = 2;
/// Iterations of one program, work of one in iterations times variables, and the iterations that are left of them at least for that.
const ITERATIONS: usize = 150;
const WORK: usize = 500_000;
const AT_LEAST: usize = 40;

/// The smoothed problem, built once for all ladders.
pub(super) struct Smoother {
    ocp: Ocp,
    built: Box<Built>,
    widths: Widths,
    /// Switching functions of the system.
    functions: Vec<SharedFunction>,
    /// Sizes of the switching functions in the simulations, and along the path of a ladder.
    sizes: Vec<f64>,
    stage_params: Vec<f64>,
    w0: Vec<f64>,
    /// A guess that goes straight to the target, where there is one.
    straight: Option<Vec<f64>>,
    options: SolveOptions,
    /// What all of them took.
    pub spent: Statistics,
    /// Iterations that are left.
    left: usize,
    /// Ladders that were asked for, and what they ended at: the costs at which they are compared, and answers.
    asked: usize,
    ended: Vec<(f64, Vec<OcpResult>)>,
}

/// How far a ladder got.
struct Climber {
    sizes: Vec<f64>,
    at: Solution,
}

impl Ocp {
    /// The smoothed problem; `None` where the system has none.
    pub(super) fn smoother(&self, known: &Sizes, request: &Request, control: &mut Control) -> Result<Option<Smoother>> {
        let Ok((system, widths)) = self.system.smoothed() else { return Ok(None) };
        if widths.is_empty() {
            return Ok(None);
        }
        let mut ocp = self.blank();
        (ocp.system, ocp.modes) = (system, None);
        let options = smoothed_options(&request.options);
        ocp.n_fe = self.elements(&options).iter().map(|n| (*n).max(ELEMENTS.div_ceil(self.n_stages))).collect();
        known.psi.iter().enumerate().for_each(|(k, s)| widths.set(k, *s));
        ocp.build(Start::Cold, &options)?;
        let Some(mut built) = ocp.built.take() else {
            return Err(Error::Internal("the smoothed problem was not built".into()));
        };
        let stage_params = ocp.prepare(&mut built)?;
        built.set_sizes(known);
        let (w0, _) = ocp.starting_point(&mut built.problem, &built.extended, &stage_params, &options, control)?;
        let mut straight = None;
        if let (Some(x1), None) = (self.target(), &self.x_guess) {
            let (x0, horizon) = (&w0[built.identifier.x0_at..][..x1.len()], self.durations.iter().sum());
            ocp.set_x_guess(&[0.0, horizon], &[x0, &x1[..]].concat())?;
            let (w1, _) = ocp.starting_point(&mut built.problem, &built.extended, &stage_params, &options, control)?;
            straight = Some(w1);
        }
        let spent = Statistics::default();
        let functions = self.system.switching_functions();
        Ok(Some(Smoother {
            ocp,
            built,
            widths,
            functions,
            sizes: known.psi.clone(),
            stage_params,
            w0,
            straight,
            spent,
            left: options.solver.max_iter,
            asked: 0,
            ended: Vec::new(),
            options,
        }))
    }
}

impl Smoother {
    /// A ladder down to the width at which costs are compared; `None` where it has no beginning, or ends before.
    fn ladder(&mut self, (first, from): (f64, From), control: &mut Control) -> Option<Climber> {
        let w0 = self.beginning(from, control)?;
        let rungs: Vec<Rung> = COMMON.into_iter().filter(|r| r.0 < first).collect();
        let opened = self.open(first, &w0, control)?;
        self.climb(opened, &rungs, control)
    }

    /// The answer that a ladder is at, and that of its last rung where that has one.
    fn finish(&mut self, c: Climber, last: Rung, control: &mut Control) -> Vec<OcpResult> {
        let first = self.read(&c);
        let last = self.climb(c, &[last], control);
        std::iter::once(first).chain(last.map(|c| self.read(&c))).collect()
    }

    /// What the next ladder ends at, which is what an earlier one does where both cost the same at the width at which costs are compared. `None` where
    /// there is none left.
    pub fn next_ladder(&mut self, control: &mut Control) -> Option<Vec<OcpResult>> {
        while let Some(next) = FIRST.into_iter().chain(MORE).nth(self.asked) {
            self.asked += 1;
            let Some(c) = self.ladder(next, control) else { continue };
            let cost = c.at.objective;
            if let Some(o) = self.ended.iter().find(|o| is_same(o.0, cost)) {
                return Some(o.1.clone());
            }
            let answers = self.finish(c, NARROWEST, control);
            self.ended.push((cost, answers.clone()));
            return Some(answers);
        }
        None
    }

    /// Variables of the smoothed problem.
    pub fn n(&self) -> usize {
        self.built.problem.n()
    }

    /// One ladder from the guess, which is an earlier plan: near it, but not bound to its modes. `None` where it was asked for before, or has no solution.
    pub fn plan_ladder(&mut self, control: &mut Control) -> Option<Vec<OcpResult>> {
        if std::mem::replace(&mut self.asked, 1) > 0 {
            return None;
        }
        let [(width, mu, tol), last] = PLAN;
        let w0 = self.w0.clone();
        let sizes = self.sizes.clone();
        let at = self.solve(&sizes, width, &Warm { x: &w0, y: &[], z: &[] }, [mu, tol], control)?;
        let c = Climber { sizes: self.sizes_along(&at.x), at };
        Some(self.finish(c, last, control))
    }

    fn read(&mut self, c: &Climber) -> OcpResult {
        let Smoother { ocp, built, stage_params, .. } = self;
        ocp.read(&mut built.problem, &c.at, &built.extended, stage_params)
    }

    /// The point that a ladder begins from, where there is such a one.
    fn beginning(&mut self, from: From, control: &mut Control) -> Option<Vec<f64>> {
        let k = match from {
            From::Guess => return Some(self.w0.clone()),
            From::Straight => return self.straight.clone(),
            From::Random(k) => k,
        };
        let u = self.ocp.random_starts(k + 1, 0).pop()?;
        self.ocp.set_u_guess(&u).ok()?;
        let Smoother { ocp, built, stage_params, options, .. } = self;
        let start = ocp.starting_point(&mut built.problem, &built.extended, stage_params, options, control);
        start.ok().map(|(w, _)| w)
    }

    /// The first problem of a ladder, from `w0`; its answer shows the sizes of the switching functions.
    fn open(&mut self, width: f64, w0: &[f64], control: &mut Control) -> Option<Climber> {
        let from = Warm { x: w0, y: &[], z: &[] };
        let sizes = self.sizes.clone();
        let at = self.solve(&sizes, width, &from, OPENING, control)?;
        let sizes = self.sizes_along(&at.x);
        Some(Climber { sizes, at })
    }

    /// Goes through the rungs from the point of a climber; `None` where the first of them has no solution.
    fn climb(&mut self, mut c: Climber, rungs: &[Rung], control: &mut Control) -> Option<Climber> {
        for &(width, mu, tol) in rungs {
            let Solution { x, y, z, .. } = &c.at;
            c.at = self.solve(&c.sizes, width, &Warm { x, y, z }, [mu, tol], control)?;
        }
        Some(c)
    }

    /// One smoothed problem; `None` where it has no solution nearby.
    fn solve(
        &mut self,
        sizes: &[f64],
        width: f64,
        from: &Warm,
        accuracy: [f64; 2],
        control: &mut Control,
    ) -> Option<Solution> {
        sizes.iter().enumerate().for_each(|(k, s)| self.widths.set(k, width * s));
        let Built { problem, solver, bounds, .. } = &mut *self.built;
        // a large problem that takes long is one that another ladder may come to sooner
        let allowed = ITERATIONS.min((WORK / problem.n().max(1)).max(AT_LEAST));
        let outcome = solver.solve_loosely(problem, bounds, from, accuracy, allowed.min(self.left), control);
        let s = solver.solution();
        self.spent.add(&s.stats);
        self.left -= s.stats.iterations.min(self.left);
        // what has not converged is a start as good as any
        let far = s.residuals.primal > 0.1;
        (matches!(outcome, Outcome::Solved | Outcome::Stalled | Outcome::MaxIter) && !far).then(|| s.clone())
    }

    /// Sizes of the switching functions along a point; those of the simulations where they vanish.
    fn sizes_along(&self, w: &[f64]) -> Vec<f64> {
        let (problem, n_stages) = (&self.built.problem, self.ocp.n_stages);
        let (nx, nu, np) = (self.ocp.system.dims().x, self.ocp.system.dims().u, self.ocp.system.dims().p);
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); self.sizes.len()];
        let (states, controls, n_fe) = (problem.end_states(w), problem.controls(w), &problem.spec().n_fe);
        let (wide, wide_p) = (controls.len() / n_stages, self.stage_params.len() / n_stages);
        let stages = n_fe.iter().enumerate().flat_map(|(k, &n)| std::iter::repeat_n(k, n));
        let points = states.chunks_exact(states.len() / (1 + n_fe.iter().sum::<usize>())).skip(1);
        for (x, k) in points.zip(stages) {
            let (u, p) = (&controls[k * wide..k * wide + nu], &self.stage_params[k * wide_p..k * wide_p + np]);
            sample(&self.functions, &Point { t: self.ocp.t0, x: &x[..nx], u, p }, &mut values);
        }
        values.into_iter().zip(&self.sizes).map(|(v, k)| quantile(v).unwrap_or(*k)).collect()
    }
}

/// Are these costs of one ladder?
fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= DIFFERENT * a.abs().max(b.abs())
}

/// Radau IIA on fixed steps, solved loosely.
fn smoothed_options(o: &SolveOptions) -> SolveOptions {
    let mut o = o.with_radau_iia();
    o.discretisation.discretisation = Discretisation::Standard;
    o.discretisation.n_s = STAGES;
    o.initial_guess = InitialGuess::Constant;
    o.solver.polish = false;
    o.solver.certify = false;
    o
}
