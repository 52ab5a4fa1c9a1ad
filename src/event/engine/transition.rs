//! From one active set to the next: what vanishes at a point, which sets may follow, the first step under them.

use super::control::UNSEEN;
use super::limit_set::Origin;
use super::{recover, Engine, Progress, EPS};
use crate::dcs::filippov::{differ, time_ahead, Excursion};
use crate::error::Result;
use crate::event::field::Formed;
use crate::event::sets;
use crate::event::tape::Time;
use crate::event::watch::{self, Scale, Watch};
use crate::event::{Contact, Outcome, Zeno};
use crate::func::EvalError;

impl Engine {
    /// Finds the active set of the present point and prepares the first step.
    pub(super) fn begin(&mut self, t_stop: f64) -> Result<()> {
        if self.field.has_contacts() {
            return self.begin_scene(t_stop);
        }
        let mut before = std::mem::take(&mut self.before);
        sets::assign(&mut before, &self.field.active);
        let r = self.begin_from(&before, t_stop);
        self.before = before;
        r
    }

    /// The same behind the active set `before`, which is empty where a run begins.
    fn begin_from(&mut self, before: &[Vec<usize>], t_stop: f64) -> Result<()> {
        let first = before.iter().any(Vec::is_empty) || before.is_empty();
        let found = match self.settle_start(first)? {
            true => recover(self.begin_inner(first).map(Some), None)?,
            false => None,
        };
        if found.is_none() {
            self.fail(Outcome::NoContinuation, "the system is not defined at this point".into());
        }
        if self.log.outcome == Outcome::NoContinuation {
            let sets = self.field.active.clone();
            self.go_through(&sets, false)?;
            return Ok(());
        }
        let Some(unique) = found.filter(|_| self.log.outcome == Outcome::Reached) else { return Ok(()) };
        if !first {
            self.log(before, f64::NAN, None, unique);
        }
        self.check_discrete()?;
        if self.notes.is_some() {
            self.note_start()?;
        }
        self.derivatives.time_row.fill(0.0);
        self.start_off(t_stop, "system")
    }

    pub(super) fn begin_inner(&mut self, first: bool) -> std::result::Result<bool, EvalError> {
        let time = if std::mem::take(&mut self.calendar.behind) { Time::Unknown } else { Time::Fixed };
        self.mark_time(time);
        let unique = self.locate(first, self.t_stop - self.t)?;
        if self.log.outcome == Outcome::NoContinuation && self.options.zeno != Zeno::Stop {
            // the run may begin in a limit set
            let failure = (self.log.outcome, std::mem::take(&mut self.log.reason));
            self.log.outcome = Outcome::Reached;
            match self.enter_limit_set(1.0, self.t, Origin::Inside) {
                Ok(Some(_)) => return Ok(unique),
                _ => (self.log.outcome, self.log.reason) = failure,
            }
        }
        if self.log.outcome == Outcome::Reached {
            self.enter()?;
            self.project_sensitivity()?;
            self.calendar.recent.start.0 = self.t;
            self.calendar.recent.start.1.copy_from_slice(&self.functions.q0);
        }
        self.log.one_sided |= !unique;
        self.log.ambiguous |= !unique;
        Ok(unique)
    }

    /// A time over which the solution hardly changes. A step that only fills what was left of the way says nothing about
    /// that: the one that the tolerances allow does; before the first one, all that is known is how far it goes.
    pub(super) fn usual_step(&self) -> f64 {
        let wanted = if self.stepper.h > 0.0 { self.stepper.h.min(self.options.h_max) } else { self.t_stop - self.t };
        self.stepper.step.h.abs().max(wanted).max(1e3 * EPS * self.t.abs())
    }

    /// Finds the active set of the present point: that of its region (`first`), or, at a surface, what continues the present
    /// one. Says whether it is unique.
    pub(super) fn locate(&mut self, first: bool, length: f64) -> std::result::Result<bool, EvalError> {
        let t = self.t;
        let kept = self.kept_modes();
        // modes on demand are formed from the signs at the point, whatever the present ones are
        let first = first || self.field.is_on_demand();
        self.field.begin_modes(t, &self.x, &kept)?;
        self.field.watched(t, &self.x)?;
        self.field.watched_gradients(t, &self.x)?;
        self.functions.zero.fill(false);
        if !first {
            self.keep_surfaces();
            for l in 0..self.functions.watches.len() {
                if let (Watch::Enter { a, .. }, true) = (self.functions.watches[l], self.functions.depart[l] > 0) {
                    self.functions.zero[a] = true;
                }
            }
        }
        for k in 0..self.field.subs.len() {
            let s = &self.field.subs[k];
            let least = (0..s.n_q).map(|j| self.field.q[s.q0 + j]).fold(f64::INFINITY, f64::min);
            let mut active = usize::MAX;
            for j in 0..s.n_q {
                let a = s.q0 + j;
                let w = Watch::Enter { sub: k, a, b: None, sign: 1.0 };
                let tol = 1e-13 * w.scale(&self.field.dq, &self.field, t, &self.x).value;
                let v = self.field.q[a] - if s.signs { 0.0 } else { least };
                // other controls or parameters may have put a surface elsewhere
                self.functions.zero[a] &= (self.field.q[a] - self.functions.q0[a]).abs() <= tol;
                self.functions.zero[a] |= v.abs() <= tol.max(self.functions.levels[a]);
                if v == 0.0 {
                    active = active.min(j);
                }
            }
            if first && !self.field.is_on_demand() {
                // any valid cell: what follows is decided below
                let cell = if s.signs { self.region(k) } else { active.min(s.n_q - 1) };
                let cell = s.first + cell;
                let set = &mut self.field.active[k];
                set.clear();
                set.push(cell);
            }
        }
        self.field.take_active();
        if !self.form_modes(&kept)? {
            return Ok(true);
        }
        let candidates = self.candidates();
        let r = self.choose(&candidates, length);
        self.candidates = candidates;
        r
    }

    /// Modes on demand that must not be forgotten: the present ones and those of the last step.
    pub(super) fn kept_modes(&self) -> Vec<usize> {
        match self.field.is_on_demand() {
            true => self.field.active.iter().chain(&self.stepper.step_sets).flatten().copied().collect(),
            false => Vec::new(),
        }
    }

    /// Forms the modes around the present point, where they are formed on demand; says whether the simulation goes on.
    pub(super) fn form_modes(&mut self, kept: &[usize]) -> std::result::Result<bool, EvalError> {
        if !self.field.is_on_demand() {
            return Ok(true);
        }
        match self.field.form_modes((self.t, &self.x, &self.f), &mut self.functions.zero, kept)? {
            Formed::Yes => Ok(true),
            Formed::No(why) => {
                self.fail(Outcome::NoContinuation, why);
                Ok(false)
            }
        }
    }

    /// The cell of the signs at the present point.
    pub(super) fn region(&self, k: usize) -> usize {
        let s = &self.field.subs[k];
        let g = |c: usize| -> f64 {
            s.cells[c].weights.iter().enumerate().map(|(j, w)| w * self.field.q[s.q0 + j].signum()).sum()
        };
        (0..s.cells.len()).min_by(|a, b| g(*a).total_cmp(&g(*b))).unwrap_or(0)
    }

    /// Marks the indicators that are tied by the present sliding modes as zero.
    pub(super) fn keep_surfaces(&mut self) {
        for (s, set) in self.field.subs.iter().zip(&self.field.active) {
            if set.len() < 2 {
                continue;
            }
            for j in 0..s.n_q {
                let w = |c: usize| s.cells[c - s.first].weights[j];
                let tied =
                    if s.signs { set.iter().any(|c| w(*c) * w(set[0]) < 0.0) } else { set.contains(&(s.first + j)) };
                self.functions.zero[s.q0 + j] |= tied;
            }
        }
    }

    /// Cells that may be active next to the present point, by the signs of the indicators that are not zero.
    pub(super) fn candidates(&mut self) -> Vec<Vec<usize>> {
        let mut all = std::mem::take(&mut self.candidates);
        let mut ruled_out = std::mem::take(&mut self.ruled_out);
        all.resize(self.field.active.len(), Vec::new());
        for ((s, set), c) in self.field.subs.iter().zip(&self.field.active).zip(&mut all) {
            c.clear();
            let marked = self.functions.zero[s.q0..s.q0 + s.n_q].contains(&true);
            if let (&[cell], true, false) = (&set[..], s.signs && !self.field.is_on_demand(), marked) {
                // away from its surfaces it goes on as it is
                let w = &s.cells[cell - s.first].weights;
                if w.iter().zip(&self.field.q[s.q0..]).all(|(w, q)| w * q < 0.0) {
                    c.push(cell);
                    continue;
                }
            }
            if let Some(near) = self.field.near_cells() {
                c.extend(near);
            } else if s.signs && s.n_q == 1 && marked {
                c.extend((0..s.cells.len()).map(|c| s.first + c));
                if s.cells.len() == 2 && s.cells[0].mode != s.cells[1].mode {
                    continue;
                }
            } else if s.signs {
                let fits = |cell: &usize| {
                    let w = &s.cells[*cell].weights;
                    let agrees = |j: &usize| self.functions.zero[s.q0 + j] || w[*j] * self.field.q[s.q0 + j] <= 0.0;
                    // what excluded a cell the last time mostly does so again
                    let last = &mut ruled_out[s.first + cell];
                    if *last < s.n_q && !agrees(last) {
                        return false;
                    }
                    match (0..s.n_q).find(|j| !agrees(j)) {
                        Some(j) => *last = j,
                        None => return true,
                    }
                    false
                };
                c.extend((0..s.cells.len()).filter(fits).map(|c| s.first + c));
            } else {
                c.extend((0..s.cells.len()).filter(|j| self.functions.zero[s.q0 + j]).map(|j| s.first + j));
            }
            for &a in set {
                if !c.contains(&a) && (c.is_empty() || !s.signs) {
                    c.push(a);
                }
            }
            c.sort_unstable();
            let mode = |c: usize| s.cells[c - s.first].mode;
            if c.iter().all(|&a| mode(a) == mode(c[0])) {
                c.truncate(1);
            }
        }
        self.ruled_out = ruled_out;
        all
    }

    /// Notes what a switch does not touch: subsystems that go on as before, none of whose functions vanishes.
    fn note_kept(&mut self, before: &[Vec<usize>]) {
        self.keeps = true;
        for (k, s) in self.field.subs.iter().enumerate() {
            let goes_on = sets::same_set(&before[k], &self.field.active[k]);
            self.kept[k] = goes_on && before[k].len() == 1 && !self.functions.zero[s.q0..s.q0 + s.n_q].contains(&true);
        }
    }

    /// Prepares the first step under a new active set.
    pub(super) fn enter(&mut self) -> std::result::Result<(), EvalError> {
        let t = self.t;
        self.field.forget_neighbours();
        self.field.scale_constraints(t, &self.x)?;
        match self.field.rhs(t, &self.x, &mut self.f) {
            Err(EvalError::Recoverable) => {
                // a mode that begins here may need the last digit
                for k in 0..self.field.subs.len() {
                    let cell = self.field.active[k][0];
                    self.field.nudge(cell, &mut self.x);
                }
                self.field.rhs(t, &self.x, &mut self.f)?;
            }
            r => r?,
        }
        self.stepper.node.copy_from_slice(&self.x);
        let slides = self.field.n_alg() > 0 && !self.field.has_contacts() && !self.field.in_limit_set();
        if self.field.project(t, &mut self.x)? {
            if self.has_moved() {
                self.field.rhs(t, &self.x, &mut self.f)?;
            }
            self.field.watched(t, &self.x)?;
        } else if slides {
            self.field.watched_beside(t, &self.x)?;
        } else {
            self.field.watched(t, &self.x)?;
        }
        self.field.watched_gradients(t, &self.x)?;
        self.functions.q0.copy_from_slice(&self.field.q);
        self.functions.dq0.copy_from_slice(&self.field.dq);
        self.stepper.fresh = true;
        self.stepper.slid = 0;
        self.stepper.alpha_start.clear();
        self.stepper.alpha_start.extend_from_slice(&self.field.alpha[..self.field.n_alg()]);
        self.field.find_carried(&self.x);
        self.choose_outputs()?;
        watch::list(&self.field, &mut self.functions.watches);
        self.functions.looked.clear();
        self.functions.looked.extend(0..self.functions.watches.len());
        if self.field.has_contacts() {
            self.field.contact_sizes(t, &self.x)?;
        }
        // what few of many functions ask for
        let mut pace = None;
        for l in 0..self.functions.watches.len() {
            let w = self.functions.watches[l];
            let value = w.value(&self.functions.q0, &self.field);
            self.functions.w0[l] = value;
            self.functions.depart[l] = 0;
            if w.is_leave() {
                self.functions.depart[l] = u8::from(value <= 1e-9);
                continue;
            }
            let kept = self.keeps && matches!(w, Watch::Enter { sub, .. } if self.kept[sub]);
            if kept || !self.field.looks_at(&w) {
                continue;
            }
            if let Watch::Contact { .. } = w {
                self.functions.depart[l] = self.contact_departs(w, value);
                continue;
            }
            if self.is_level(&w, value) {
                self.functions.depart[l] = 2;
                continue;
            }
            let (scale, rate) = w.scale_and_rate(&self.functions.dq0, &self.field, (t, &self.x), &self.f);
            if value <= 64.0 * EPS * scale.value || value <= 8.0 * EPS * rate.abs() * t.abs() {
                // fast enough for a zero of order one: compared with the states moving by their sizes
                let rises = match w {
                    Watch::Guard { .. } => {
                        w.rises(&self.functions.dq0, &self.field, &self.f) && rate > self.rate_noise(&w)?
                    }
                    _ => {
                        let pace = *pace.get_or_insert_with(|| self.field.pace(&self.x, &self.f));
                        rate > 1e-9 * scale.reach * pace || self.rises_slowly(&w, rate, &scale, pace)?
                    }
                };
                self.functions.depart[l] = if rises { 1 } else { 2 };
            }
        }
        self.stepper.stiff_mode = self.begins_stiff();
        self.stepper.implicit = self.begins_implicit();
        self.stepper.stiff_steps = 0;
        Ok(())
    }

    /// Does a watched function that is zero rise by more than its rounding, however slowly it begins to? Weights are those that a step begins with.
    fn rises_slowly(&mut self, w: &Watch, rate: f64, scale: &Scale, pace: f64) -> std::result::Result<bool, EvalError> {
        let rounding = 64.0 * EPS * scale.value;
        if !matches!(w, Watch::Enter { .. }) || rate <= 64.0 * EPS * scale.reach * pace {
            return Ok(false);
        }
        let ahead = time_ahead(&self.field, &self.x, &self.f, self.usual_step());
        let mut there = std::mem::take(&mut self.stepper.node);
        let mut velocity = std::mem::take(&mut self.stepper.step.f);
        there.iter_mut().zip(self.x.iter().zip(&self.f)).for_each(|(y, (x, f))| *y = x + ahead * f);
        let r = self.field.rhs(self.t + ahead, &there, &mut velocity);
        let r = r.and_then(|()| self.field.watched_gradients(self.t + ahead, &there));
        let growth = (w.rate(&self.field.dq, &self.field, &velocity) - rate) / ahead;
        self.stepper.step.f = velocity;
        self.stepper.node = there;
        let n = self.field.n_alg();
        self.field.alpha[..n].copy_from_slice(&self.stepper.alpha_start);
        match r {
            Err(EvalError::Recoverable) => return Ok(false),
            r => r?,
        }
        self.field.watched_gradients(self.t, &self.x)?;
        Ok(Excursion { rate, growth, rounding }.is_seen())
    }

    /// Is the state so far from that at the nodes that the velocity has to be evaluated again? Where that is much work, not for
    /// so little of the tolerances.
    fn has_moved(&self) -> bool {
        let moved = |i: usize| (self.x[i] - self.stepper.node[i]).abs() > UNSEEN * self.tolerance_of(i);
        !self.field.many_functions() || (0..self.nx).any(moved)
    }

    /// Switches at the present point, where watch `l` vanishes.
    pub(super) fn switch(&mut self, l: usize, slope: f64, grown: f64) -> Result<Progress> {
        self.foresight.note_late(self.source(&self.functions.watches[l]), self.t);
        self.note_levels(l);
        match self.functions.watches[l] {
            Watch::Guard { .. } => return self.jump(l, slope, grown),
            Watch::Contact { .. } => return self.contact_event(l, slope, grown),
            _ => {}
        }
        let mut before = std::mem::take(&mut self.before);
        sets::assign(&mut before, &self.field.active);
        let within = self.field.in_limit_set();
        if within && self.stay_in_limit_set(l, &before)? {
            self.before = before;
            self.stepper.h = grown;
            return Ok(self.accumulate()?.unwrap_or(Progress::Switched));
        }
        let r = self.switch_inner(l, slope, &before);
        let mut known = recover(r.map(|()| true), false)?;
        if !known && !within && recover(self.settle_on_marked(), false)? {
            self.field.set_active(&before);
            let r = self.switch_inner(l, slope, &before);
            known = recover(r.map(|()| true), false)?;
        }
        if !known || self.log.outcome == Outcome::NoContinuation {
            if let Some(p) = self.rescue(&before, if within { Origin::Inside } else { Origin::Outside })? {
                self.stepper.h = grown;
                return Ok(p);
            }
        }
        if !known || self.log.outcome == Outcome::NoContinuation {
            if !known && self.log.outcome == Outcome::Reached {
                self.fail(Outcome::NoContinuation, "the modes around the switch are not defined there".into());
            }
            let p = self.go_through(&before, true)?.unwrap_or(Progress::Done);
            self.before = before;
            return Ok(p);
        }
        self.before = before;
        self.stepper.h = grown;
        self.stepper.err_before = 1e-4;
        if self.log.outcome != Outcome::Reached {
            return Ok(Progress::Done);
        }
        if self.stepper.step_implicit && !self.stepper.implicit {
            // a sliding mode says nothing about how fast the mode behind it is
            self.stepper.h = self.initial_step(grown)?;
        }
        self.begin_as_before();
        if let Some(p) = self.accumulate()? {
            return Ok(p);
        }
        Ok(Progress::Switched)
    }

    /// Where the location of a switch leaves the state behind the boundary of a mode by more than its rounding, that mode may
    /// not be defined there: puts it onto the surfaces that are marked, if they are less than a tenth of the tolerances away. Says
    /// whether it has moved.
    fn settle_on_marked(&mut self) -> std::result::Result<bool, EvalError> {
        /// Part of the tolerances.
        const NEAR: f64 = 0.1;
        let mut moved = false;
        for _ in 0..2 {
            self.field.watched(self.t, &self.x)?;
            self.field.watched_gradients(self.t, &self.x)?;
            for j in (0..self.field.subs.len()).flat_map(|k| self.field.surfaces(k)) {
                let (q, g) = (self.field.q[j], self.field.gradient_row(j));
                let reach = self.reach_of(j);
                if !self.functions.zero[j] || q == 0.0 || q.abs() > NEAR * reach {
                    continue;
                }
                let size = |i: usize| Some(self.field.size(i, self.x[i])).filter(|s| *s > 0.0).unwrap_or(1.0);
                let total: f64 = g.states().map(|(i, g)| (g * size(i)).powi(2)).sum();
                let moves: Vec<(usize, f64)> = g.states().map(|(i, g)| (i, q / total * g * size(i).powi(2))).collect();
                for (i, by) in moves {
                    self.x[i] -= by;
                    if self.x[i].abs() <= 4.0 * EPS * self.field.floor[i] {
                        self.x[i] = 0.0;
                    }
                    moved = true;
                }
            }
        }
        Ok(moved)
    }

    /// Where the field has a kink and no jump, both sides continue the motion. If the state is beyond such a surface, where a zero of the dense
    /// output alone has put it, or has come to it again and again without leaving its side, as where values and rates are rounding,
    /// the other side is the active set now; says whether it is.
    fn goes_over_kink(&mut self, l: usize) -> std::result::Result<bool, EvalError> {
        /// Attempts to stay.
        const AGAIN: usize = 4;
        /// Fields that differ by this part on the surface are one.
        const KINK: f64 = 1e-9;
        let Watch::Enter { sub, a: j, .. } = self.functions.watches[l] else { return Ok(false) };
        let (&[here], &[a, b]) = (&self.field.active[sub][..], &self.candidates[sub][..]) else { return Ok(false) };
        if self.field.in_limit_set() {
            return Ok(false);
        }
        self.field.watched(self.t, &self.x)?;
        self.field.watched_gradients(self.t, &self.x)?;
        let w = self.functions.watches[l];
        let value = w.value(&self.field.q, &self.field);
        let beyond = value < -1e3 * EPS * w.scale(&self.field.dq, &self.field, self.t, &self.x).value;
        if !beyond && self.calendar.crowd < AGAIN {
            return Ok(false);
        }
        let mut at = self.x.clone();
        if beyond && self.field.subs[sub].signs {
            let (q, g) = (self.field.q[j], self.field.gradient_row(j));
            let size = |i: usize| Some(self.field.size(i, self.x[i])).filter(|s| *s > 0.0).unwrap_or(1.0);
            let total: f64 = g.states().map(|(i, g)| (g * size(i)).powi(2)).sum();
            g.states().filter(|_| total > 0.0).for_each(|(i, g)| at[i] -= q / total * g * size(i).powi(2));
        }
        let present = self.field.active.clone();
        let mut other = present.clone();
        other[sub] = vec![if here == a { b } else { a }];
        let mut known = self.field.rhs(self.t, &at, &mut self.stepper.node);
        if known.is_ok() {
            self.field.set_active(&other);
            known = self.field.rhs(self.t, &at, &mut self.stepper.step.f);
        }
        let one = known.is_ok() && !differ(&self.field, &self.x, [&self.stepper.node, &self.stepper.step.f], KINK);
        if !one {
            self.field.set_active(&present);
        }
        match known {
            Ok(()) | Err(EvalError::Recoverable) => Ok(one),
            Err(e) => Err(e),
        }
    }

    /// Velocity before a switch at the present point, and what is watched there with its gradients.
    pub(super) fn arrive(&mut self) -> std::result::Result<(), EvalError> {
        let t = self.t;
        self.arrived = true;
        if std::mem::take(&mut self.known_end) {
            return self.field.watched_gradients(t, &self.x);
        }
        // a mode that ends here may have no value any more: its velocity just before serves as well
        match self.field.rhs(t, &self.x, &mut self.stepper.node) {
            Ok(()) => self.f.copy_from_slice(&self.stepper.node),
            Err(EvalError::Recoverable) => self.arrived = false,
            Err(e) => return Err(e),
        }
        self.field.watched(t, &self.x)?;
        self.field.watched_gradients(t, &self.x)
    }

    pub(super) fn switch_inner(
        &mut self,
        l: usize,
        slope: f64,
        before: &[Vec<usize>],
    ) -> std::result::Result<(), EvalError> {
        let t = self.t;
        // the search in the step has shown which functions stay away from zero
        let searched = self.known_end;
        self.arrive()?;
        self.functions.zero.fill(false);
        let (mut rate, mut cosine, mut grazing) = (slope, f64::NAN, false);
        for m in 0..self.functions.watches.len() {
            if searched && m != l && !self.functions.suspect[m] {
                continue;
            }
            let w = self.functions.watches[m];
            match w {
                Watch::Enter { a, b, .. } => {
                    let v = w.value(&self.field.q, &self.field);
                    let (scale, r) = w.scale_and_rate(&self.field.dq, &self.field, (t, &self.x), &self.f);
                    if m == l {
                        let size = self.f.iter().map(|v| v * v).sum::<f64>().sqrt();
                        rate = r;
                        cosine = r / (w.steepness(&self.field.dq, &self.field) * size);
                        grazing = match &self.functions.flat {
                            Some(flat) => flat.coarse,
                            None => r.abs() < 1e-6 * scale.reach * self.field.pace(&self.x, &self.f),
                        };
                    }
                    let near = 64.0 * EPS * scale.value + 8.0 * EPS * r.abs() * t.abs().max(self.stepper.step.h);
                    if m == l || v.abs() <= near.max(self.level(&w)) {
                        self.functions.zero[a] = true;
                        if let Some(b) = b {
                            self.functions.zero[b] = true;
                        }
                    }
                }
                Watch::Leave { .. } | Watch::Guard { .. } | Watch::Contact { .. } => {}
            }
        }
        self.keep_surfaces();
        self.f_before.copy_from_slice(&self.f);
        self.differentiate_time(l)?;
        let kept = self.kept_modes();
        if !self.form_modes(&kept)? {
            return Ok(());
        }
        let candidates = self.candidates();
        let length = self.usual_step();
        let unique = self.choose_behind(&candidates, length, (l, slope));
        self.candidates = candidates;
        let unique = unique?;
        if self.log.outcome != Outcome::Reached {
            return Ok(());
        }
        let same = sets::same(&self.field.active, before) && !self.goes_over_kink(l)?;
        if same {
            // nothing changes: a grazing contact, or a first step too long for its signs
            self.calendar.crowd += 1;
            if let (Watch::Enter { sub, .. }, true) = (self.functions.watches[l], self.calendar.crowd == 1) {
                self.touch(Contact { t, subsystem: sub, rate, transversality: cosine });
            }
        } else {
            let crossed = match self.functions.watches[l] {
                // the rate of a zero of higher order says nothing about the next one
                Watch::Enter { a, b: None, .. } if self.functions.flat.is_none() => Some((a, rate)),
                _ => None,
            };
            let source = self.source(&self.functions.watches[l]);
            self.remember(source, crossed);
        }
        if searched && !same {
            self.note_kept(before);
        }
        let entered = self.enter();
        self.keeps = false;
        entered?;
        self.log.one_sided |= grazing;
        if !same {
            let f = std::mem::take(&mut self.f_before);
            self.differentiate_jump(&f);
            self.f_before = f;
            self.log.one_sided |= !unique;
            self.log.ambiguous |= !unique;
        }
        self.project_sensitivity()?;
        if self.calendar.crowd > 0 && same {
            // a weight that has not vanished has no zero to be divided out
            if !self.functions.watches[l].is_leave() || self.functions.w0[l] <= EPS.sqrt() {
                self.functions.depart[l] = self.functions.depart[l].max(2);
            }
        }
        if self.calendar.crowd > 20 {
            self.fail(Outcome::NoContinuation, "the signs of the active set contradict each other".into());
        }
        self.log(before, rate, Some(cosine), unique);
        // guards that vanish here too
        self.make_held()
    }
}
