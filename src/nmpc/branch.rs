//! Alternatives to the plan where a system sticks.
//!
//! A control that holds a sticking system changes nothing as long as it does not break away: the derivatives of the states by it
//! are exactly zero, and a quadratic program at such a point never moves it. Where the plan has stages of this kind the problem is
//! therefore also linearised at plans that break away in them, to either side; all programs are prepared, the feedback solves
//! them all and takes the one with the lowest predicted cost.
//!
//! States are simulated from the predicted one on under the controls of a plan, so that every point is a solution of the dynamics with
//! the switches it has, and costs of plans can be compared.
//!
//! Where controls choose among values the alternatives are other [sequences](super::choices) of them.

use super::choices::Choosing;
use super::iterate::{Iterate, Step};
use super::linearise::{Linearisation, Model};
use crate::func::{EvalError, EvalResult};
use crate::ocp::Sequence;
use crate::qp::{QpSolution, QpSolver, QpStatus, StageQp, Terms};

type Evaluated<T> = std::result::Result<T, EvalError>;

/// How far beyond break-away alternatives begin, in widths of the interval of controls that stick.
const BEYOND: [f64; 2] = [0.05, 0.5];
/// Share of its cost by which a plan must become better to be taken for better.
const BETTER: f64 = 1e-9;
/// Halvings of a step at most.
const HALVINGS: usize = 4;
/// Halvings of the step of the feedback at most; what is still too long is not made.
const PROBES: usize = 2;

/// How much is done for a plan.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    /// Iterations at most.
    pub inner: usize,
    /// They end where one gains less than this share of the cost.
    pub tol: f64,
    /// Price per unit of violation of rows that have none.
    pub price: f64,
    /// The state is not the one that the plan was made for: plans that begin at a bound of a control are tried besides.
    pub disturbed: bool,
}

/// Control `j` in the stages `first..end` at another value.
#[derive(Clone, Copy)]
struct Flip {
    first: usize,
    end: usize,
    j: usize,
    value: f64,
}

/// An alternative: a plan with its linearisation, its cost, and what the cost of a solution of its program is more than the program says.
struct Branch {
    at: Iterate,
    lin: Linearisation,
    cost: f64,
    offset: f64,
}

/// All that belongs to alternatives of a plan.
pub(super) struct Branches {
    others: Vec<Branch>,
    /// Those that are prepared lead.
    used: usize,
    /// Of the plan itself.
    cost: f64,
    offset: f64,
    /// The state all plans begin at.
    pub x0: Vec<f64>,
    base: Iterate,
    trial: Iterate,
    step: Step,
    break_away: Vec<Option<[f64; 2]>>,
    flips: Vec<Flip>,
    /// The choices of the controls, if there are any.
    pub choices: Option<Choosing>,
}

/// What the choice among the programs was.
pub(super) struct Choice {
    /// An alternative is in the place of the plan's linearisation now.
    pub taken: bool,
    /// Programs solved, and their iterations.
    pub qps: u64,
    pub iterations: u64,
}

impl Branches {
    /// `most` alternatives; `solver` makes what solves the programs.
    pub fn new(
        model: &Model,
        qp: &StageQp,
        most: usize,
        solver: impl Fn() -> crate::error::Result<Box<dyn QpSolver>>,
        kind: super::HessianKind,
    ) -> crate::error::Result<Branches> {
        let zeros = || Iterate::zeros(qp.n, qp.nx, qp.nu, qp.rows.len());
        let branch = |_| -> crate::error::Result<Branch> {
            let lin = Linearisation::new(model, qp.clone(), solver()?, kind);
            Ok(Branch { at: zeros(), lin, cost: f64::INFINITY, offset: f64::INFINITY })
        };
        Ok(Branches {
            others: (0..most).map(branch).collect::<crate::error::Result<_>>()?,
            used: 0,
            cost: f64::INFINITY,
            offset: f64::INFINITY,
            x0: vec![0.0; qp.nx],
            base: zeros(),
            trial: zeros(),
            step: Step { of: 0, solution: QpSolution::new(qp) },
            break_away: vec![None; qp.n * qp.nu],
            flips: Vec::with_capacity(most),
            choices: None,
        })
    }

    /// Alternatives that are prepared.
    pub fn used(&self) -> usize {
        self.used
    }

    /// Does something to the programs of all alternatives.
    pub fn each(&mut self, mut change: impl FnMut(&mut Linearisation)) {
        self.others.iter_mut().for_each(|b| change(&mut b.lin));
    }

    /// Nothing is prepared any more.
    pub fn forget(&mut self) {
        self.used = 0;
        self.others.iter_mut().for_each(|b| b.lin.reset());
    }

    /// Simulates the plan from `x0`, improves it and its alternatives, and linearises all. Returns the iterations made on the plan.
    pub fn prepare(
        &mut self,
        model: &mut Model,
        lin: &mut Linearisation,
        plan: &mut Iterate,
        effort: Effort,
    ) -> Evaluated<usize> {
        if self.choices.is_some() {
            return self.prepare_choices(model, lin, plan, effort);
        }
        self.used = 0;
        self.base.copy_from(plan);
        let mut search = Search { model, trial: &mut self.trial, step: &mut self.step, x0: &self.x0, effort };
        self.cost = search.start(lin, plan)?;
        self.break_away.copy_from_slice(lin.break_away());
        let (cost, done) = search.improve(lin, plan, self.cost)?;
        self.cost = cost;
        self.offset = search.probe(lin, cost)?;
        list_flips(search.model, &self.break_away, &self.base.u, self.others.len(), &mut self.flips);
        if effort.disturbed {
            list_bounds(search.model, self.others.len(), &mut self.flips);
        }
        for flip in &self.flips {
            let b = &mut self.others[self.used];
            b.at.copy_from(&self.base);
            let nu = search.model.nodes.nu;
            (flip.first..flip.end).for_each(|k| b.at.u[k * nu + flip.j] = flip.value);
            self.used += usize::from(search.prepare(b)?);
        }
        Ok(done)
    }

    /// The same where controls choose: the cheapest sequence is the plan, those that come next are the alternatives. What was not compared with all
    /// others is compared with those next to it, as often as there are iterations.
    fn prepare_choices(
        &mut self,
        model: &mut Model,
        lin: &mut Linearisation,
        plan: &mut Iterate,
        effort: Effort,
    ) -> Evaluated<usize> {
        let mut least = f64::INFINITY;
        loop {
            let (done, knows_all) = self.compare_sequences(model, lin, plan, effort)?;
            self.take_cheapest(lin, plan);
            let settled = knows_all || self.cost.is_nan() || self.cost >= least - BETTER * least.abs();
            if settled || effort.inner <= 1 {
                return Ok(done);
            }
            least = self.cost;
        }
    }

    /// Sequences from the plan's on, each with its program; whether all there are were compared.
    fn compare_sequences(
        &mut self,
        model: &mut Model,
        lin: &mut Linearisation,
        plan: &mut Iterate,
        effort: Effort,
    ) -> Evaluated<(usize, bool)> {
        self.used = 0;
        plan.x[..self.x0.len()].copy_from_slice(&self.x0);
        let Some(choices) = self.choices.take() else { return Err(EvalError::Recoverable) };
        let knows_all = choices.knows_all();
        let plans = self.list_sequences(&choices, model, plan, effort);
        self.choices = Some(choices);
        let mut plans = plans?.into_iter();
        let Some(first) = plans.next() else { return Err(EvalError::Recoverable) };
        plan.u.copy_from_slice(&first);
        self.base.copy_from(plan);
        let mut search = Search { model, trial: &mut self.trial, step: &mut self.step, x0: &self.x0, effort };
        let cost = search.start(lin, plan)?;
        let (cost, done) = search.improve(lin, plan, cost)?;
        self.cost = cost;
        self.offset = search.probe(lin, cost)?;
        for u in plans {
            let b = &mut self.others[self.used];
            b.at.copy_from(&self.base);
            b.at.u.copy_from_slice(&u);
            self.used += usize::from(search.prepare(b)?);
        }
        Ok((done, knows_all))
    }

    /// Controls of plans that are worth a program: that of the plan first, or where all sequences are known the cheapest.
    fn list_sequences(
        &mut self,
        choices: &Choosing,
        model: &mut Model,
        plan: &mut Iterate,
        effort: Effort,
    ) -> Evaluated<Vec<Vec<f64>>> {
        let own = choices.keep(&mut plan.u);
        let most = self.others.len() + 1;
        let Branches { others, trial, step, base, x0, .. } = self;
        base.copy_from(plan);
        let mut room = if choices.is_alone() { None } else { others.last_mut() };
        let steps = Effort { inner: effort.inner.max(1), ..effort };
        let mut cost = |model: &mut Model, at: &Iterate| {
            let Some(b) = &mut room else { return merit(model, at, effort.price) };
            b.at.copy_from(at);
            let mut search = Search { model, trial, step, x0, effort: steps };
            let cost = search.start(&mut b.lin, &mut b.at)?;
            Ok(search.improve(&mut b.lin, &mut b.at, cost)?.0)
        };
        let mut found = choices.candidates(model, base, most, &mut cost)?;
        if !choices.knows_all() {
            // it was improved before, and is improved further
            found.retain(|s| *s != own);
            found.insert(0, own);
            found.truncate(most);
        }
        let controls = |sequence: &Sequence| {
            let mut u = plan.u.clone();
            choices.write(sequence, &mut u);
            u
        };
        Ok(found.iter().map(controls).collect())
    }

    /// Brings references `y` of term `k` into the programs of all alternatives, and into the costs of all plans; that of the plan
    /// itself changes by `change`.
    pub fn embed_references(&mut self, model: &mut Model, k: usize, y: &[f64], change: f64) -> EvalResult {
        self.offset += change;
        for b in &mut self.others[..self.used] {
            b.offset += b.lin.embed_references(model, k, y)?;
        }
        Ok(())
    }

    /// Puts the cheapest alternative in the place of the plan where it is better: for plans that were solved to the end.
    pub fn take_cheapest(&mut self, lin: &mut Linearisation, plan: &mut Iterate) {
        let costs = self.others[..self.used].iter().map(|b| b.cost).enumerate();
        let Some((i, cost)) = costs.min_by(|a, b| a.1.total_cmp(&b.1)) else { return };
        if cost < self.cost {
            let b = &mut self.others[i];
            std::mem::swap(lin, &mut b.lin);
            std::mem::swap(plan, &mut b.at);
            std::mem::swap(&mut self.cost, &mut b.cost);
            std::mem::swap(&mut self.offset, &mut b.offset);
        }
    }

    /// Solves the programs of all alternatives for a state and puts the best one in the place of `lin`, whose program is solved,
    /// if it is cheaper by the share `margin`. `solved`: is there a solution of `lin`?
    pub fn choose(
        &mut self,
        lin: &mut Linearisation,
        x: &[f64],
        terms: &Terms,
        (price, margin, solved): (f64, f64, bool),
    ) -> Choice {
        let mut choice = Choice { taken: false, qps: 0, iterations: 0 };
        if self.used == 0 {
            return choice;
        }
        let mut keep = f64::INFINITY;
        if solved {
            lin.step(&mut self.step);
            keep = self.offset + lin.predicted_change(&self.step, price);
        }
        let mut best: Option<(usize, f64)> = None;
        for (i, b) in self.others[..self.used].iter_mut().enumerate() {
            if terms.over(0) {
                break;
            }
            let status = b.lin.solve(x, &Terms { deadline: terms.deadline, ..Terms::default() });
            choice.qps += 1;
            choice.iterations += b.lin.qp_iterations() as u64;
            if status != QpStatus::Solved {
                continue;
            }
            b.lin.step(&mut self.step);
            let cost = b.offset + b.lin.predicted_change(&self.step, price);
            if cost < best.map_or(f64::INFINITY, |b| b.1) {
                best = Some((i, cost));
            }
        }
        // infinite where nothing else is there
        let limit = if keep.is_finite() { keep - margin * keep.abs() } else { f64::INFINITY };
        if let Some((i, _)) = best.filter(|b| b.1 < limit) {
            std::mem::swap(lin, &mut self.others[i].lin);
            choice.taken = true;
        }
        choice
    }
}

/// Plans that break away: the controls that move nothing, in the first stages in a row where they do not, then in the next, at values
/// beyond break-away to either side, the smaller ones first.
fn list_flips(model: &Model, break_away: &[Option<[f64; 2]>], u: &[f64], most: usize, out: &mut Vec<Flip>) {
    let (n, nu) = (model.nodes.n, model.nodes.nu);
    out.clear();
    let inert = |k: usize, j: usize| break_away[k * nu + j];
    let zone = |from: usize, j: usize| {
        let first = (from..n).find(|k| inert(*k, j).is_some())?;
        Some(first..(first..n).find(|k| inert(*k, j).is_none()).unwrap_or(n))
    };
    for which in 0..n {
        for beyond in BEYOND {
            for j in 0..nu {
                let mut stages = zone(0, j);
                for _ in 0..which {
                    stages = stages.and_then(|s| zone(s.end, j));
                }
                let Some(stages) = stages else { continue };
                let Some([lower, upper]) = inert(stages.start, j) else { continue };
                let own = u[stages.start * nu + j];
                let width = match (lower.is_finite(), upper.is_finite()) {
                    (true, true) => upper - lower,
                    (true, false) => own - lower,
                    _ => upper - own,
                };
                for (edge, sign) in [(upper, 1.0), (lower, -1.0)] {
                    let value = (edge + sign * beyond * width).max(model.u_lower[j]).min(model.u_upper[j]);
                    let moves = edge.is_finite() && sign * (value - edge) > 0.0;
                    if moves && out.len() < most {
                        out.push(Flip { first: stages.start, end: stages.end, j, value });
                    }
                }
            }
        }
        if out.len() >= most || (0..nu).all(|j| zone(0, j).is_none()) {
            return;
        }
    }
}

/// Plans whose first stages have a control at one of its bounds: of half the horizon, then of a quarter.
fn list_bounds(model: &Model, most: usize, out: &mut Vec<Flip>) {
    let (n, nu) = (model.nodes.n, model.nodes.nu);
    for part in [2, 4] {
        for j in 0..nu {
            for value in [model.u_lower[j], model.u_upper[j]] {
                if value.is_finite() && out.len() < most {
                    out.push(Flip { first: 0, end: n.div_ceil(part), j, value });
                }
            }
        }
    }
}

/// Plans from one state.
struct Search<'a> {
    model: &'a mut Model,
    trial: &'a mut Iterate,
    step: &'a mut Step,
    x0: &'a [f64],
    effort: Effort,
}

impl Search<'_> {
    /// Simulates, improves and linearises an alternative; false where there is none.
    fn prepare(&mut self, b: &mut Branch) -> Evaluated<bool> {
        let found = self.start(&mut b.lin, &mut b.at);
        let found = found.and_then(|cost| self.improve(&mut b.lin, &mut b.at, cost));
        match found.and_then(|(cost, _)| self.probe(&mut b.lin, cost).map(|offset| (cost, offset))) {
            Ok((cost, offset)) if b.lin.is_ready() => {
                (b.cost, b.offset) = (cost, offset);
                Ok(true)
            }
            Ok(_) | Err(EvalError::Recoverable) => Ok(false),
            Err(e) => Err(e),
        }
    }

    /// Simulates a plan and linearises there; its cost.
    fn start(&mut self, lin: &mut Linearisation, at: &mut Iterate) -> Evaluated<f64> {
        at.x[..self.x0.len()].copy_from_slice(self.x0);
        lin.roll_out(self.model, at)?;
        let cost = merit(self.model, at, self.effort.price)?;
        lin.linearise_rolled(self.model, at)?;
        Ok(cost)
    }

    /// Steps of the quadratic program, each as long as it lowers the cost of the simulated plan. Returns the cost, and the steps.
    fn improve(&mut self, lin: &mut Linearisation, at: &mut Iterate, mut cost: f64) -> Evaluated<(f64, usize)> {
        for done in 0..self.effort.inner {
            if !lin.is_ready() || !self.solve(lin) {
                return Ok((cost, done));
            }
            lin.step(self.step);
            let Some(better) = self.shorten(lin, cost)? else { return Ok((cost, done)) };
            std::mem::swap(at, self.trial);
            lin.linearise_rolled(self.model, at)?;
            let gain = cost - better;
            cost = better;
            if gain <= self.effort.tol * cost.abs() {
                return Ok((cost, done + 1));
            }
        }
        Ok((cost, self.effort.inner))
    }

    /// Simulates the step that the feedback would make from the predicted state, and holds back what of it is too long. Returns what the
    /// cost is without the change that the program predicts: at any state, the sum of both is the cost that is expected.
    fn probe(&mut self, lin: &mut Linearisation, cost: f64) -> Evaluated<f64> {
        if !lin.is_ready() || !self.solve(lin) {
            return Ok(cost);
        }
        lin.step(self.step);
        let mut found = (0.0, cost);
        let mut t = 1.0;
        for _ in 0..=PROBES {
            if !self.take_share(lin, t) {
                break;
            }
            let value = Linearisation::simulate(self.model, self.trial);
            match value.and_then(|()| merit(self.model, self.trial, self.effort.price)) {
                Ok(c) if c < cost => {
                    found = (t, c);
                    break;
                }
                Ok(_) | Err(EvalError::Recoverable) => {}
                Err(e) => return Err(e),
            }
            t *= 0.5;
        }
        lin.hold(self.step, found.0);
        Ok(found.1 - lin.predicted_change(self.step, self.effort.price))
    }

    fn solve(&mut self, lin: &mut Linearisation) -> bool {
        let status = lin.solve(self.x0, &Terms::default());
        if status == QpStatus::Infeasible {
            let elastic = Terms { elastic: Some(self.effort.price), ..Terms::default() };
            return lin.solve(self.x0, &elastic) == QpStatus::Solved;
        }
        status == QpStatus::Solved
    }

    /// The longest of a few shares of a step that lowers the cost; the plan is the trial then.
    fn shorten(&mut self, lin: &mut Linearisation, cost: f64) -> Evaluated<Option<f64>> {
        let mut t = 1.0;
        for _ in 0..=HALVINGS {
            if !self.take_share(lin, t) {
                break;
            }
            let value = lin.roll_out(self.model, self.trial);
            match value.and_then(|()| merit(self.model, self.trial, self.effort.price)) {
                Ok(c) if c < cost - BETTER * cost.abs() => return Ok(Some(c)),
                Ok(_) | Err(EvalError::Recoverable) => {}
                Err(e) => return Err(e),
            }
            t *= 0.5;
        }
        Ok(None)
    }

    /// Makes the share `t` of the step the trial, which is still to be simulated; false where that is the plan that the step begins at, as all
    /// shorter shares are then.
    fn take_share(&mut self, lin: &Linearisation, t: f64) -> bool {
        lin.advance(self.step, t, self.trial);
        self.keep_bounds();
        self.trial.x[..self.x0.len()].copy_from_slice(self.x0);
        self.trial.u != lin.point().u
    }

    fn keep_bounds(&mut self) {
        let nu = self.model.nodes.nu;
        for (i, u) in self.trial.u.iter_mut().enumerate() {
            *u = u.max(self.model.u_lower[i % nu]).min(self.model.u_upper[i % nu]);
        }
    }
}

/// Cost of a simulated plan with the prices of its violations.
fn merit(model: &mut Model, at: &Iterate, price: f64) -> Evaluated<f64> {
    let Model { nodes, costs, constraints, .. } = model;
    nodes.solve(&at.x, &at.u)?;
    let cost = costs.value(nodes, &at.x, &at.u)?;
    let done: EvalResult = constraints.values(nodes, &at.x, &at.u);
    done?;
    let [hard, priced] = constraints.violation();
    Ok(cost + priced + price * hard)
}
