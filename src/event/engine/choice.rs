//! The choice among the continuations of a point.

use super::Engine;
use crate::dcs::filippov::{decide_pair, distinct, FilippovProblem, FilippovSolution};
use crate::event::field::{Apart, Known, Open};
use crate::event::sets;
use crate::event::watch::Watch;
use crate::event::{Ambiguity, Branching, Continuation, Doubt, Outcome};
use crate::func::EvalError;

impl Engine {
    /// Makes the best continuation among `candidates` the active set; `length` is a time over which the solution
    /// hardly changes. Says whether it is unique.
    pub(super) fn choose(&mut self, candidates: &[Vec<usize>], length: f64) -> std::result::Result<bool, EvalError> {
        if candidates.iter().all(|c| c.len() == 1) {
            self.field.set_active(candidates);
            return Ok(true);
        }
        let room = (&mut self.stepper.node[..], &mut self.stepper.step.f[..]);
        if let Some(k) = decide_pair(&mut self.field, self.t, &self.x, candidates, room, &mut self.set)? {
            sets::copy(&mut self.field.active, candidates);
            self.field.active[k].clone_from(&self.set);
            self.field.take_active();
            return Ok(true);
        }
        let mut apart = std::mem::take(&mut self.apart);
        let r = self.choose_apart(candidates, length, &mut apart);
        self.apart = apart;
        r
    }

    /// The same where several subsystems have a choice, or one whose rates leave a doubt.
    fn choose_apart(
        &mut self,
        candidates: &[Vec<usize>],
        length: f64,
        apart: &mut Apart,
    ) -> std::result::Result<bool, EvalError> {
        self.field.decide_apart((self.t, &self.x), candidates, apart)?;
        self.choose_open(candidates, length, apart)
    }

    /// The same behind a switch, where watch `l` vanishes with this slope: the velocity is that before it, at this point.
    pub(super) fn choose_behind(
        &mut self,
        candidates: &[Vec<usize>],
        length: f64,
        (l, slope): (usize, f64),
    ) -> std::result::Result<bool, EvalError> {
        let many = candidates.iter().filter(|c| c.len() > 1).nth(1).is_some();
        if !self.arrived || self.field.in_limit_set() {
            return self.choose(candidates, length);
        }
        let mut apart = std::mem::take(&mut self.apart);
        if !many {
            sets::assign(&mut apart.sets, &self.field.active);
            apart.open.clear();
            apart.open.extend((0..candidates.len()).filter(|k| candidates[*k].len() == 2));
            let mut all = candidates.iter().zip(&self.field.active);
            let alone = all.all(|(c, set)| c.len() == 2 || sets::same_set(c, set));
            let ends = alone && self.lets_go(l, slope * length, &mut apart);
            if ends {
                self.field.set_active(&apart.sets);
            }
            self.apart = apart;
            return if ends { Ok(true) } else { self.choose(candidates, length) };
        }
        let known = self.field.decide_changed((self.t, &self.x, &self.f), candidates, &mut apart);
        let r = match known {
            Ok(Known::Little) => self.choose_apart(candidates, length, &mut apart),
            Ok(Known::ButOpen) if self.lets_go(l, slope * length, &mut apart) => {
                self.field.set_active(&apart.sets);
                Ok(true)
            }
            Ok(_) => self.choose_open(candidates, length, &mut apart),
            Err(e) => Err(e),
        };
        self.apart = apart;
        r
    }

    /// Does the sliding mode whose weight vanishes end here, the weight falling by `fall` in the time over which the solution hardly
    /// changes? On a surface that attracts, `θ_a = r_b / (r_b − r_a)` with `r_b − r_a > 0`: where `θ_a` passes zero, so does the rate
    /// `r_b` of the surface under the other mode, in the direction that leads away from it, which is the condition of second order. The
    /// other mode is then the active set.
    fn lets_go(&self, l: usize, fall: f64, apart: &mut Apart) -> bool {
        /// A fall that leaves no doubt.
        const CLEAR: f64 = -1e-6;
        let Watch::Leave { sub, cell } = self.functions.watches[l] else { return false };
        if apart.open[..] != [sub] || fall.is_nan() || fall > CLEAR || !self.field.slides_alone(sub) {
            return false;
        }
        apart.sets[sub].retain(|c| *c != cell);
        true
    }

    /// Makes the best continuation of what is open the active set.
    fn choose_open(
        &mut self,
        candidates: &[Vec<usize>],
        length: f64,
        apart: &mut Apart,
    ) -> std::result::Result<bool, EvalError> {
        if apart.open.is_empty() {
            self.field.set_active(&apart.sets);
            return Ok(true);
        }
        let found = self.continuations(candidates, length, apart)?;
        if self.log.outcome != Outcome::Reached {
            return Ok(false);
        }
        if found.is_empty() {
            return Ok(self.arbitrate(candidates));
        }
        if let [only] = &found[..] {
            let goes_on = only.sets == self.field.active;
            self.field.set_active(&only.sets);
            // a velocity that a rule has selected is one of many
            return Ok(goes_on || !self.field.is_selected());
        }
        let name = |s: &FilippovSolution| Continuation {
            modes: s.sets.iter().enumerate().map(|(k, set)| self.field.modes_of(k, set)).collect(),
            velocity: s.velocity.clone(),
        };
        let continuations = found.iter().map(name).collect();
        if let Some(taken) = self.branch(continuations) {
            self.field.set_active(&found[taken].sets);
        }
        Ok(false)
    }

    /// The continuations among `candidates` of the subsystems that are open, one for every velocity: the present active set
    /// first if it is one of them, then by the number of active cells, then by index.
    fn continuations(
        &mut self,
        candidates: &[Vec<usize>],
        length: f64,
        apart: &Apart,
    ) -> std::result::Result<Vec<FilippovSolution>, EvalError> {
        let own: Vec<Vec<usize>> = apart.open.iter().map(|&k| candidates[k].clone()).collect();
        let present: Vec<Vec<usize>> = apart.open.iter().map(|&k| self.field.active[k].clone()).collect();
        let kept = own.iter().zip(&present).map(|(c, p)| c.len() == p.len()).collect();
        let mut open = Open { field: &mut self.field, apart };
        let problem = FilippovProblem::new(&mut open, self.t, &self.x, &own)?.keep(kept);
        let (mut found, decisions) = problem.solutions(&mut open, length)?;
        // one evaluation at the point and one ahead of it
        self.field.counts.values += 2 * decisions;
        if found.is_empty() {
            found.extend(problem.nearest());
        }
        let same = |s: &FilippovSolution| {
            let mut sets = s.sets.iter().zip(&present);
            sets.all(|(a, b)| a.len() == b.len() && a.iter().all(|c| b.contains(c)))
        };
        if let Some(i) = found.iter().position(same) {
            found[..=i].rotate_right(1);
        }
        for s in &mut found {
            let mut sets = apart.sets.clone();
            for (set, &k) in std::mem::take(&mut s.sets).into_iter().zip(&apart.open) {
                sets[k] = set;
            }
            s.sets = sets;
        }
        self.select(&mut found, candidates, apart, length)?;
        Ok(distinct(&self.field, &self.x, found))
    }

    /// Several continuations: notes them and decides.
    pub(super) fn branch(&mut self, continuations: Vec<Continuation>) -> Option<usize> {
        let n_sub = self.field.active.len();
        let n = continuations.len();
        let mut b = Branching {
            t: self.t,
            x: self.state().to_vec(),
            before: self.all_modes((0..n_sub).map(|k| self.field.modes(k)).collect()),
            continuations: match &self.algebraic {
                None => continuations,
                Some(a) => continuations
                    .into_iter()
                    .map(|c| Continuation {
                        modes: self.all_modes(c.modes),
                        velocity: c.velocity[..a.n_states()].to_vec(),
                    })
                    .collect(),
            },
            taken: None,
        };
        b.taken = match (&mut self.decider, self.options.ambiguity) {
            (Some(decide), _) => decide(&b).filter(|i| *i < n),
            (None, Ambiguity::First) => Some(0),
            (None, Ambiguity::Stop) => None,
            (None, Ambiguity::Prefer) => {
                let rank = |c: &Continuation| -> Vec<Vec<usize>> {
                    let each = c.modes.iter().zip(&self.options.preferred).map(|(modes, list)| {
                        let place = |m: &usize| list.iter().position(|p| p == m).unwrap_or(usize::MAX);
                        let mut ranks: Vec<usize> = modes.iter().map(place).collect();
                        ranks.sort_unstable();
                        ranks
                    });
                    each.collect()
                };
                (0..n).min_by_key(|i| rank(&b.continuations[*i]))
            }
        };
        let taken = b.taken;
        if taken.is_none() {
            let text = format!("the continuation is not unique: {n} active sets are possible");
            self.fail(Outcome::Ambiguous, text);
        }
        if self.log.branchings.len() < self.options.max_log {
            self.log.branchings.push(b);
        }
        taken
    }

    /// No active set satisfies the conditions: asks who knows more.
    fn arbitrate(&mut self, candidates: &[Vec<usize>]) -> bool {
        let doubt = Doubt { t: self.t, x: &self.x, u: &self.field.u, p: &self.field.p };
        let Some(modes) = self.arbiter.as_mut().and_then(|a| a(doubt)) else {
            self.fail(Outcome::NoContinuation, "no active set satisfies the conditions (6.19)".into());
            return true;
        };
        // the candidates with these modes, one for each where modes have several cells
        let sets: Option<Vec<Vec<usize>>> = candidates
            .iter()
            .zip(&self.field.subs)
            .zip(modes.iter())
            .map(|((c, s), modes)| {
                let cell = |m: &usize| c.iter().copied().find(|c| s.cells[c - s.first].mode == *m);
                let mut set = modes.iter().map(cell).collect::<Option<Vec<usize>>>()?;
                set.sort_unstable();
                set.dedup();
                (!set.is_empty()).then_some(set)
            })
            .collect();
        match sets.filter(|s| s.len() == candidates.len()) {
            Some(sets) => self.field.set_active(&sets),
            None => {
                let text = format!("the arbiter names the modes {modes:?}, which do not meet at this point");
                self.fail(Outcome::NoContinuation, text);
            }
        }
        true
    }
}
