//! Controls that choose among values: which sequences a plan may have.
//!
//! A plan has a value of every choice in every stage, and its quadratic program keeps them. Which sequence is the best is asked in the preparation, at the
//! predicted state. All sequences are compared where that is within the limit of the problem (`search_exact`), otherwise those next to the plan. Where
//! other controls are free each is improved by steps of its program. The sequences that come next to the best are prepared, too, and the feedback takes the one that is
//! cheapest at the measured state.
//!
//! What was chosen at the last samples counts for dwell times: values are held for as long as they have to be, also over the start of the horizon.

use super::iterate::Iterate;
use super::linearise::{Linearisation, Model};
use crate::error::Result;
use crate::func::EvalError;
use crate::ocp::{Levels, Ocp, PastChoice, Sequence};
use crate::qp::StageQp;

/// The choices of a problem.
pub(super) struct Choosing {
    levels: Levels,
    /// All sequences are compared.
    all: bool,
    /// Nothing but choices is free.
    alone: bool,
    /// Length of the first stage: the time between two samples.
    sample: f64,
}

impl Choosing {
    /// Those of a problem, if it has any.
    ///
    /// # Errors
    /// [`crate::error::Error::Range`] where no value of a choice is within the bounds of its control.
    pub fn new(ocp: &Ocp) -> Result<Option<Choosing>> {
        let s = ocp.statement();
        if s.system.choices().is_empty() {
            return Ok(None);
        }
        let levels = Levels::new(ocp)?;
        let d = s.system.dims();
        let chooses = |j: usize| (0..levels.n()).any(|c| levels.control(c) == j);
        let alone = (0..d.u).all(|j| chooses(j) || s.u_bounds[0][j] == s.u_bounds[1][j]);
        let ways: f64 = (0..levels.n()).map(|c| levels.values(c).len() as f64).product();
        let n = s.n_stages as i32;
        // one stage is simulated for every beginning of a sequence; with other controls all of them, and their derivatives
        let stages = match alone {
            true => (1..=n).map(|k| ways.powi(k)).sum::<f64>(),
            false => ways.powi(n) * f64::from(n) * (1 + d.x + d.u) as f64,
        };
        let all = stages * d.x as f64 <= s.settings.search_exact;
        Ok(Some(Choosing { levels, all, alone, sample: s.durations[0] }))
    }

    /// Are all sequences compared, so that the best one is known?
    pub fn knows_all(&self) -> bool {
        self.all
    }

    /// Is nothing but choices free, so that a simulation says what a sequence costs?
    pub fn is_alone(&self) -> bool {
        self.alone
    }

    /// The allowed sequence that is nearest to controls `[n · nu]`, written to them.
    pub fn keep(&self, u: &mut [f64]) -> Sequence {
        let sequence = self.levels.nearest(u);
        self.levels.write(&sequence, u);
        sequence
    }

    /// Writes the values of a sequence into controls `[n · nu]`.
    pub fn write(&self, sequence: &[u16], u: &mut [f64]) {
        self.levels.write(sequence, u);
    }

    /// A sample has passed with these controls.
    pub fn pass(&mut self, u: &[f64]) {
        for c in 0..self.levels.n() {
            let value = u[self.levels.control(c)];
            let near = |v: &f64| (v - value).abs();
            let places = self.levels.values(c).iter().enumerate();
            let at = places.min_by(|a, b| near(a.1).total_cmp(&near(b.1))).map_or(0, |e| e.0 as u16);
            let time = match self.levels.before(c) {
                // what is there at the start may be left at any time, as in the problem
                None => f64::INFINITY,
                Some(held) if held.at == at => held.time + self.sample,
                Some(_) => self.sample,
            };
            self.levels.set_before(c, Some(PastChoice { at, time }));
        }
    }

    /// Samples have passed of which only the last controls are known: values may have changed with each.
    pub fn pass_unseen(&mut self, u: &[f64]) {
        self.pass(u);
        for c in 0..self.levels.n() {
            if let Some(held) = self.levels.before(c) {
                self.levels.set_before(c, Some(PastChoice { time: self.sample, ..held }));
            }
        }
    }

    /// Nothing was chosen yet.
    pub fn forget(&mut self) {
        (0..self.levels.n()).for_each(|c| self.levels.set_before(c, None));
    }

    /// Sequences by what they cost from the first state of `at`, the cheapest first, at most so many: all there are where that is within the limit, else
    /// those next to that of `at`, and it. Other controls are those of `at` where `cost` is asked, which is room for simulations, too. Sequences that
    /// cannot be simulated are left out.
    ///
    /// # Errors
    /// Those of functions that end everything.
    pub fn candidates(
        &self,
        model: &mut Model,
        at: &mut Iterate,
        most: usize,
        mut cost: impl FnMut(&mut Model, &Iterate) -> std::result::Result<f64, EvalError>,
    ) -> std::result::Result<Vec<Sequence>, EvalError> {
        let mut found: Vec<(f64, Sequence)> = Vec::with_capacity(most + 1);
        let mut keep = |model: &mut Model, at: &Iterate, sequence: &[u16]| {
            let cost = match cost(model, at) {
                Ok(cost) if cost.is_finite() => cost,
                Ok(_) | Err(EvalError::Recoverable) => return Ok(()),
                Err(e) => return Err(e),
            };
            let place = found.partition_point(|c| c.0 <= cost);
            if place < most {
                found.insert(place, (cost, sequence.to_vec()));
                found.truncate(most);
            }
            Ok(())
        };
        if self.all {
            self.go_through(model, at, &mut Vec::new(), &mut keep)?;
            return Ok(found.into_iter().map(|c| c.1).collect());
        }
        let own = self.levels.nearest(&at.u);
        let next = self.levels.next_to(&own).into_iter().map(|c| c.sequence);
        for sequence in std::iter::once(own.clone()).chain(next) {
            self.levels.write(&sequence, &mut at.u);
            match Linearisation::simulate(model, at) {
                Ok(()) => keep(model, at, &sequence)?,
                Err(EvalError::Recoverable) => {}
                Err(e) => return Err(e),
            }
        }
        Ok(found.into_iter().map(|c| c.1).collect())
    }

    /// All sequences that begin like this one, whose stages are simulated.
    fn go_through(
        &self,
        model: &mut Model,
        at: &mut Iterate,
        begun: &mut Sequence,
        keep: &mut impl FnMut(&mut Model, &Iterate, &[u16]) -> std::result::Result<(), EvalError>,
    ) -> std::result::Result<(), EvalError> {
        let m = self.levels.n();
        let k = begun.len() / m;
        if k == self.levels.n_stages() {
            return if self.levels.is_held(begun) { keep(model, at, begun) } else { Ok(()) };
        }
        let nu = model.nodes.nu;
        let mut row = vec![0u16; m];
        loop {
            if self.levels.may_follow(begun, &row) {
                (0..m).for_each(|c| at.u[k * nu + self.levels.control(c)] = self.levels.values(c)[usize::from(row[c])]);
                match Linearisation::simulate_stage(model, at, k) {
                    Ok(()) => {
                        begun.extend(&row);
                        self.go_through(model, at, begun, keep)?;
                        begun.truncate(k * m);
                    }
                    Err(EvalError::Recoverable) => {}
                    Err(e) => return Err(e),
                }
            }
            // the next row, counted up from its last place
            let more = |c: &usize| usize::from(row[*c]) + 1 < self.levels.values(*c).len();
            let Some(c) = (0..m).rev().find(more) else { return Ok(()) };
            row[c] += 1;
            row[c + 1..].fill(0);
        }
    }
}

/// Takes controls that choose out of a program whose plan has made its choices: they do not move.
pub(super) fn fix(chooses: &[bool], qp: &mut StageQp) {
    let (nx, nu) = (qp.nx, qp.nu);
    for j in (0..nu).filter(|j| chooses[*j]) {
        for k in 0..qp.n {
            qp.b[(k * nu + j) * nx..][..nx].fill(0.0);
            (0..nx).for_each(|i| qp.hess_xu[(k * nx + i) * nu + j] = 0.0);
            for i in 0..nu {
                qp.hess_u[(k * nu + i) * nu + j] = 0.0;
                qp.hess_u[(k * nu + j) * nu + i] = 0.0;
            }
            qp.hess_u[(k * nu + j) * nu + j] = 1.0;
        }
        qp.row_u.iter_mut().skip(j).step_by(nu).for_each(|v| *v = 0.0);
    }
    fix_vectors(chooses, qp);
}

/// The part of it that belongs to vectors.
pub(super) fn fix_vectors(chooses: &[bool], qp: &mut StageQp) {
    let nu = qp.nu;
    for v in [&mut qp.grad_u, &mut qp.u_lower, &mut qp.u_upper] {
        v.iter_mut().enumerate().filter(|e| chooses[e.0 % nu]).for_each(|e| *e.1 = 0.0);
    }
}
