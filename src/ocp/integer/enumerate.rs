//! All sequences of choices by simulation, where nothing but choices is free.
//!
//! Sequences with the same beginning have its simulation in common, so that a sequence costs about two stages. A beginning is left where it costs
//! more than the best sequence, with the least that the rest can cost: bounds of the cost rate over all states say that. What is cheaper than the best
//! becomes it where its program meets the constraints. Costs are those of simulations throughout, so that like is compared with like.

use std::rc::Rc;

use super::levels::Levels;
use super::space::{Choices, Ended};
use super::Proof;
use crate::error::Result;
use crate::event::Outcome;
use crate::func::Point;
use crate::nlp::Control;
use crate::ocp::accuracy::{values, Answer, Replay};
use crate::ocp::extend::Extended;
use crate::ocp::request::Request;
use crate::ocp::{stage_times, Durations, Ocp};
use crate::search::Budget;
use crate::system::SharedFunction;

/// Relative tolerance of the simulations.
const TOLERANCE: f64 = 1e-8;
/// Share of its size by which a condition is missed where no program of the sequence can meet it: that of a simulation is off by less.
const MISSED: f64 = 1e-2;

/// A beginning of sequences.
struct Beginning {
    sequence: Vec<u16>,
    /// The cost so far, then the states.
    reached: Vec<f64>,
    /// The least that a sequence costs which begins like this.
    least: f64,
}

/// Costs and conditions in the variables that are simulated.
pub(super) struct Simulated<'a> {
    ocp: &'a Ocp,
    levels: Rc<Levels>,
    e: Extended,
    replay: Replay,
    params: Vec<f64>,
    /// Controls that do not choose are fixed.
    controls: Vec<f64>,
    /// The start of every stage, then the end of the last one.
    times: Vec<f64>,
    /// The least that is left to pay behind every stage.
    left: Vec<f64>,
}

impl Ocp {
    /// Is nothing free but choices, so that a simulation says what they cost?
    pub(super) fn is_of_choices_alone(&self) -> bool {
        let chooses = |j: usize| self.system.choices().iter().any(|c| c.control == j);
        let fixed = (0..self.system.dims().u).all(|j| chooses(j) || self.u_bounds[0][j] == self.u_bounds[1][j]);
        let priced = self.soft.iter().all(|s| s.cost.is_some());
        fixed
            && priced
            && self.x0_bounds[0] == self.x0_bounds[1]
            && self.time == Durations::Fixed
            && self.complementarity.is_empty()
            && !self.linear.contains(&true)
            // those are not simulated by events
            && (self.is_simulated() || self.projected.is_some() || self.system.is_of_modes_alone())
            && !self.free_params().contains(&true)
    }

    /// Goes through all sequences within a limit of work, from the best one that is known.
    pub(super) fn enumerate(
        &self,
        space: &mut Choices,
        mut simulated: Simulated,
        best: Option<&Ended>,
        (most, budget): (f64, &mut Budget),
        control: &mut Control,
    ) -> Result<Proof> {
        let mut incumbent = f64::INFINITY;
        if let Some(best) = best {
            incumbent = simulated.cost(&best.sequence, budget)?;
            if incumbent.is_nan() {
                return Ok(Proof::none());
            }
        }
        // where nothing but costs is stated every sequence that can be simulated is one to be compared, and the best alone is solved for
        let free = self.is_unconstrained();
        let (mut better, mut cheapest, mut doubt) = (None, None, false);
        let mut stack = vec![simulated.start()];
        while let Some(b) = stack.pop() {
            if b.least >= incumbent {
                continue;
            }
            if budget.is_over() || budget.spent() >= most {
                doubt = true;
                break;
            }
            if b.sequence.len() < simulated.levels.n() * simulated.levels.n_stages() {
                let mut next = simulated.stages(&b, budget)?;
                // the cheapest is the next to be looked at
                next.sort_by(|a, b| b.least.total_cmp(&a.least));
                stack.append(&mut next);
                continue;
            }
            if !simulated.levels.is_held(&b.sequence) {
                continue;
            }
            if free {
                (incumbent, cheapest) = (b.least, Some(b.sequence));
                continue;
            }
            match space.solve_sequence(b.sequence, budget, control)? {
                Some(one) if one.is_solution() => (incumbent, better) = (b.least, Some(one)),
                Some(one) => doubt |= !one.is_impossible(),
                None => doubt = true,
            }
        }
        if let Some(sequence) = cheapest {
            better = space.solve_sequence(sequence, budget, control)?.filter(Ended::is_solution);
            doubt |= better.is_none();
        }
        match doubt {
            true => Ok(Proof { better, ..Proof::none() }),
            false => Ok(Proof { better, gap: TOLERANCE, is_complete: true }),
        }
    }

    /// Are there no constraints?
    fn is_unconstrained(&self) -> bool {
        let [lower, upper] = &self.x_bounds;
        self.path.is_empty()
            && self.terminal.is_empty()
            && self.boundary.is_empty()
            && lower.iter().chain(upper).all(|v| v.is_infinite())
    }
}

impl<'a> Simulated<'a> {
    pub fn new(ocp: &'a Ocp, levels: Rc<Levels>, best: Option<&Ended>, request: &Request) -> Result<Simulated<'a>> {
        let e = ocp.simulated_costs()?;
        let params = ocp.extended_params(&e);
        let (n, nx) = (ocp.n_stages, ocp.system.dims().x);
        let usual = ocp.prior_sizes();
        let mut states = vec![0.0; n * nx];
        if let Some(best) = best {
            for k in 0..n {
                let last = best.result.trajectory.elements.iter().rev().find(|e| e.stage == k);
                last.into_iter().for_each(|e| states[k * nx..(k + 1) * nx].copy_from_slice(&e.x1));
            }
        }
        let cost = best.map_or(0.0, |b| b.result.cost_reached);
        let controls = ocp.within_bounds(ocp.control_guess());
        let answer = Answer {
            usual: &usual,
            t0: ocp.t0,
            x0: &ocp.x0_bounds[0],
            durations: &ocp.durations,
            controls: &controls,
            control_ends: &controls,
            linear: &ocp.linear,
            params: &params,
            states: &states,
            beside: &[],
            cost,
            cost_size: ocp.cost_size(cost),
            mayer: e.mayer.as_ref(),
            grid_cost: e.grid_cost.as_ref(),
            tol: TOLERANCE,
            terminal: Vec::new(),
            path: Vec::new(),
            x_bounds: [&[], &[]],
        };
        let replay = Replay::new(&e.system, ocp.projected.as_ref(), e.lagrange.as_ref(), &answer, &request.options)?;
        let times = stage_times(ocp.t0, &ocp.durations);
        let mut all = Simulated { ocp, levels, e, replay, params, controls, times, left: Vec::new() };
        all.left = all.least_left();
        Ok(all)
    }

    /// The least that stages from every one on can cost, and the end: bounds over all states within theirs and all values of the choices.
    fn least_left(&self) -> Vec<f64> {
        let (ocp, d) = (self.ocp, self.e.system.dims());
        let n = ocp.n_stages;
        let [low, high] = self.levels.widest();
        let [lower, upper] = self.levels.bounds(ocp, &low, &high);
        let nu = ocp.system.dims().u;
        let [x_low, x_high] = &ocp.x_bounds;
        let least = |f: Option<&SharedFunction>, k: usize, (start, end): (f64, f64)| -> f64 {
            let Some(f) = f else { return 0.0 };
            let p = &self.params[k * d.p..(k + 1) * d.p];
            let (mut out, mut most) = (vec![f64::NAN], vec![f64::NAN]);
            let at_low = Point { t: start, x: x_low, u: &lower[k * nu..(k + 1) * nu], p };
            let at_high = Point { t: end, x: x_high, u: &upper[k * nu..(k + 1) * nu], p };
            let known = f.bounds(&at_low, &at_high, &mut out, &mut most, &mut vec![0.0; 2 * f.work_len()]);
            if known && !out[0].is_nan() {
                out[0]
            } else {
                f64::NEG_INFINITY
            }
        };
        let end = self.times[n];
        let mut left = vec![least(self.e.mayer.as_ref(), n - 1, (end, end)); n + 1];
        for k in (0..n).rev() {
            let (start, t) = (self.times[k], self.times[k + 1]);
            let running = ocp.durations[k] * least(self.e.lagrange.as_ref(), k, (start, t));
            left[k] = left[k + 1] + running + least(self.e.grid_cost.as_ref(), k, (t, t));
        }
        left
    }

    /// The work of simulating all sequences, none of them left before its end: a sequence of many takes as long as the last of its stages, as all others
    /// have it in common.
    pub fn work_of_all(&mut self, budget: &mut Budget) -> Result<f64> {
        let (n, m) = (self.levels.n_stages(), self.levels.n());
        let rows: f64 = (0..m).map(|c| self.levels.values(c).len() as f64).product();
        let before = budget.spent();
        self.cost(&vec![0; n * m], budget)?;
        let stage = (budget.spent() - before) / n as f64;
        Ok(stage * (0..n).map(|k| rows.powi(k as i32 + 1)).sum::<f64>())
    }

    fn start(&self) -> Beginning {
        let reached = std::iter::once(0.0).chain(self.ocp.x0_bounds[0].iter().copied()).collect();
        Beginning { sequence: Vec::new(), reached, least: self.left[0] }
    }

    /// What a sequence costs; NaN where its simulation does not get to the end.
    fn cost(&mut self, sequence: &[u16], budget: &mut Budget) -> Result<f64> {
        let mut at = self.start();
        for row in sequence.chunks_exact(self.levels.n()) {
            match self.stage(&at, row, budget)? {
                Some(next) => at = next,
                None => return Ok(f64::NAN),
            }
        }
        Ok(at.least)
    }

    /// All ways on from a beginning.
    fn stages(&mut self, b: &Beginning, budget: &mut Budget) -> Result<Vec<Beginning>> {
        let mut out = Vec::new();
        let mut row = vec![0u16; self.levels.n()];
        loop {
            if self.levels.may_follow(&b.sequence, &row) {
                let next = self.stage(b, &row, budget)?;
                out.extend(next.filter(|next| self.may_meet(next)));
            }
            // the next row, counted up from its last place
            let more = |c: &usize| usize::from(row[*c]) + 1 < self.levels.values(*c).len();
            let Some(c) = (0..row.len()).rev().find(more) else { return Ok(out) };
            row[c] += 1;
            row[c + 1..].fill(0);
        }
    }

    /// A stage on from a beginning; nothing where the simulation does not get to its end.
    fn stage(&mut self, b: &Beginning, row: &[u16], budget: &mut Budget) -> Result<Option<Beginning>> {
        let (m, nu) = (self.levels.n(), self.ocp.system.dims().u);
        let k = b.sequence.len() / m;
        let sequence = [&b.sequence[..], row].concat();
        let mut u = self.controls[k * nu..(k + 1) * nu].to_vec();
        for c in 0..m {
            u[self.levels.control(c)] = self.levels.values(c)[usize::from(row[c])];
        }
        let np = self.e.system.dims().p;
        let p = &self.params[k * np..(k + 1) * np];
        let (start, t) = (self.times[k], self.times[k + 1]);
        self.replay.reinit(start, &b.reached)?;
        let outcome = self.replay.advance(t, &u, p)?;
        budget.simulated(b.reached.len(), self.replay.steps());
        if outcome != Outcome::Reached {
            return Ok(None);
        }
        let mut reached = self.replay.state().to_vec();
        let at = Point { t, x: &reached[1..], u: &u, p };
        let more = self.e.grid_cost.as_ref().map_or(0.0, |f| values(f, &at)[0]);
        let is_last = k + 1 == self.ocp.n_stages;
        let end = self.e.mayer.as_ref().filter(|_| is_last).map_or(0.0, |f| values(f, &at)[0]);
        reached[0] += more;
        let least = reached[0] + if is_last { end } else { self.left[k + 1] };
        Ok((!least.is_nan()).then_some(Beginning { sequence, reached, least }))
    }

    /// May a program that begins like this meet the bounds of the states, and at the end the conditions there?
    fn may_meet(&self, b: &Beginning) -> bool {
        let x = &b.reached[1..];
        let within = |v: f64, l: f64, u: f64| {
            let size = [v, l, u].into_iter().filter(|v| v.is_finite()).fold(0f64, |m, v| m.max(v.abs()));
            v >= l - MISSED * size && v <= u + MISSED * size
        };
        let [lower, upper] = &self.ocp.x_bounds;
        if !x.iter().zip(lower.iter().zip(upper)).all(|(v, (l, u))| within(*v, *l, *u)) {
            return false;
        }
        let (m, n) = (self.levels.n(), self.ocp.n_stages);
        if b.sequence.len() < m * n {
            return true;
        }
        let (nu, np) = (self.ocp.system.dims().u, self.e.system.dims().p);
        let mut u = self.controls.clone();
        self.levels.write(&b.sequence, &mut u);
        let at = Point { t: self.times[n], x, u: &u[(n - 1) * nu..], p: &self.params[(n - 1) * np..] };
        self.e
            .terminal
            .iter()
            .all(|c| values(&c.f, &at).iter().zip(c.lower.iter().zip(&c.upper)).all(|(v, (l, u))| within(*v, *l, *u)))
    }
}
