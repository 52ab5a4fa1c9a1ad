//! The model functions of many subsystems or states in one program.

use super::{Field, Sliding, Sub};
use crate::dcs::Drift;
use crate::event::guard::Guards;
use crate::event::sets;
use crate::func::{Bundle, Function, PartList, Point};

/// Of fewer subsystems every function is called by itself: that costs as much, and nothing beforehand.
const FEWEST: usize = 4;
/// With so many states that their drifts are worth to be taken together, that is no longer so.
pub(super) const MANY_STATES: usize = 8;

/// The program, and which of its parts is what.
pub(super) struct Bundled {
    program: Box<dyn Bundle>,
    /// The drifts, and the states that their values belong to.
    drifts: PartList,
    drift_rows: Vec<usize>,
    /// Of every state, the parts that are single outputs of drifts and move it.
    singles: Vec<Vec<usize>>,
    /// The part of the first mode of every subsystem.
    modes: Vec<usize>,
    /// The values of the active modes: those of every subsystem have places of their own, which hold all of its modes.
    active: PartList,
    places: Vec<usize>,
    values: Vec<f64>,
    /// The active cells that are listed, and whether they are the present ones.
    cells: Vec<Vec<usize>>,
    pub(super) listed: bool,
    /// Of the first active mode of every subsystem: its values, and the states they move. Of the others: their places among the
    /// columns of `D`, their values, and those of the first one.
    firsts: Vec<(u32, u32)>,
    others: Vec<(u32, u32, u32)>,
    indicators: PartList,
    /// The guards of all discrete states.
    guards: PartList,
    /// Guards and resets are among the parts, and which parts the resets are.
    with_transitions: bool,
    resets: Vec<Option<usize>>,
    /// Those that the indicators of the first subsystem are, and the guard of every transition.
    first_indicator: usize,
    of_guards: Vec<Option<usize>>,
    /// Room for the values of parts.
    room: Vec<f64>,
}

impl Bundled {
    /// None where the functions do not allow for it, or there are few of them.
    pub(super) fn new(nx: usize, drifts: &[Drift], subs: &[Sub], guards: &Guards) -> Option<Bundled> {
        if subs.len() < FEWEST && nx < MANY_STATES {
            return None;
        }
        let mut parts: Vec<(&dyn Function, std::ops::Range<usize>)> =
            drifts.iter().map(|d| (d.f.as_ref(), 0..d.f.n_out())).collect();
        let singles = parts.len();
        for d in drifts {
            parts.extend((0..d.f.n_out()).map(|i| (d.f.as_ref(), i..i + 1)));
        }
        let mut modes = Vec::with_capacity(subs.len());
        for s in subs {
            modes.push(parts.len());
            let nr = s.rows.len();
            let n_modes = s.n_out.checked_div(nr).unwrap_or(0);
            parts.extend((0..n_modes).map(|m| (s.modes.as_ref(), m * nr..(m + 1) * nr)));
        }
        let indicators = parts.len();
        parts.extend(subs.iter().map(|s| (s.indicators.as_ref(), 0..s.n_q)));
        let first_guard = parts.len();
        let mut all = parts.clone();
        // notes are not watched
        all.extend(guards.all.iter().filter(|g| g.n > 0).map(|g| (g.transition.guard.as_ref(), 0..g.n)));
        let mut resets = Vec::with_capacity(guards.all.len());
        for g in &guards.all {
            resets.push(g.transition.reset.as_ref().map(|_| all.len()));
            all.extend(g.transition.reset.iter().map(|r| (r.f.as_ref(), 0..r.rows.len())));
        }
        // functions of other kinds are asked one by one
        let whole = all.first()?.0.bundle(&all);
        let (with_transitions, resets) = (whole.is_some(), if whole.is_some() { resets } else { Vec::new() });
        let program = whole.or_else(|| parts.first()?.0.bundle(&parts))?;
        let drift_rows: Vec<usize> = drifts.iter().flat_map(|d| d.rows.iter().copied()).collect();
        let mut cells = 0;
        let mut place = |s: &Sub| {
            cells += s.cells.len() * s.rows.len();
            cells - s.cells.len() * s.rows.len()
        };
        let places = subs.iter().map(&mut place).collect();
        let mut of_states = vec![Vec::new(); nx];
        drift_rows.iter().zip(singles..).for_each(|(&r, part)| of_states[r].push(part));
        let mut b = Bundled {
            drifts: PartList::default(),
            singles: of_states,
            room: vec![0.0; drift_rows.len().max(subs.iter().map(|s| s.rows.len()).max().unwrap_or(0))],
            values: vec![0.0; cells],
            drift_rows,
            modes,
            active: PartList::default(),
            places,
            cells: Vec::new(),
            listed: false,
            firsts: Vec::new(),
            others: Vec::new(),
            indicators: PartList::default(),
            guards: PartList::default(),
            with_transitions,
            resets,
            first_indicator: indicators,
            of_guards: Vec::new(),
            program,
        };
        b.list_drifts(singles, drifts);
        let mut all = subs.iter().enumerate().map(|(k, s)| (indicators + k, s.q0));
        b.program.list(&mut all, &mut b.indicators);
        let known = guards.all.iter().filter(|g| g.n > 0).enumerate().filter(|_| with_transitions);
        let mut all = known.map(|(i, g)| (first_guard + i, g.q));
        b.program.list(&mut all, &mut b.guards);
        let mut part = first_guard..;
        let watched = guards.all.iter().map(|g| if g.n > 0 { part.next() } else { None });
        b.of_guards = watched.filter(|_| with_transitions).collect();
        Some(b)
    }

    /// The outputs of the drifts one by one where many of them are alike and have little in common, else as they are.
    fn list_drifts(&mut self, singles: usize, drifts: &[Drift]) {
        let whole: usize = (0..singles).map(|k| self.program.operations(k).0).sum();
        let (mut apart, mut alike) = (0, 0);
        for k in singles..singles + self.drift_rows.len() {
            let (n, many) = self.program.operations(k);
            apart += n;
            alike += if many { n } else { 0 };
        }
        if 2 * apart <= 3 * whole && 2 * alike >= apart {
            let mut all = (0..self.drift_rows.len()).map(|i| (singles + i, i));
            self.program.list(&mut all, &mut self.drifts);
            return;
        }
        let mut at = 0;
        let mut all = drifts.iter().enumerate().map(|(k, d)| {
            at += d.rows.len();
            (k, at - d.rows.len())
        });
        self.program.list(&mut all, &mut self.drifts);
    }

    /// The smooth part of the right-hand side; `direct` where the values of the drifts are those of all states in order.
    fn drift(&mut self, direct: bool, out: &mut [f64]) -> bool {
        if direct {
            return self.program.evaluate_list(&self.drifts, out);
        }
        let finite = self.program.evaluate_list(&self.drifts, &mut self.room);
        out.fill(0.0);
        self.room.iter().zip(&self.drift_rows).for_each(|(v, &r)| out[r] += v);
        finite
    }

    /// The parts of the cells `set` of subsystem `k`, with the places of their values.
    fn parts<'a>(&self, s: &'a Sub, k: usize, set: &'a [usize]) -> impl Iterator<Item = (usize, usize)> + 'a {
        let (mode, at) = (self.modes[k], self.places[k]);
        set.iter().enumerate().map(move |(i, cell)| (mode + s.cells[cell - s.first].mode, at + i * s.rows.len()))
    }

    /// Are guards and resets among the parts?
    pub(super) fn has_transitions(&self) -> bool {
        self.with_transitions
    }

    /// Operations that every point costs, whatever is evaluated there.
    pub(super) fn common_operations(&self) -> usize {
        self.program.common_operations()
    }

    /// The point at which parts are evaluated.
    pub(super) fn move_to(&mut self, at: &Point) {
        self.program.move_to(at);
    }

    /// The same with another value of one input.
    #[inline]
    pub(super) fn set_input(&mut self, input: usize, value: f64) {
        self.program.set_input(input, value);
    }

    /// The parts that are single outputs of drifts and move state `i`.
    pub(super) fn singles_of(&self, i: usize) -> &[usize] {
        &self.singles[i]
    }

    /// The part of a mode of subsystem `k`.
    pub(super) fn mode_of(&self, k: usize, mode: usize) -> usize {
        self.modes[k] + mode
    }

    /// Writes a part; false where a value is not finite.
    #[inline]
    pub(super) fn evaluate_part(&mut self, part: usize, out: &mut [f64]) -> bool {
        self.program.evaluate(part, out)
    }

    /// The first indicator of subsystem `k`; NaN where it is not finite.
    pub(super) fn evaluate_indicator(&mut self, k: usize) -> f64 {
        self.evaluate_one(self.first_indicator + k)
    }

    /// The guard of transition `g`, of one output; NaN where it is not finite.
    pub(super) fn evaluate_guard(&mut self, g: usize) -> f64 {
        self.of_guards[g].map_or(f64::NAN, |part| self.evaluate_one(part))
    }

    fn evaluate_one(&mut self, part: usize) -> f64 {
        let mut v = [0.0];
        if self.program.evaluate(part, &mut v) {
            v[0]
        } else {
            f64::NAN
        }
    }

    /// Writes the states that the reset of transition `g` names; false where a value is not finite.
    pub(super) fn evaluate_reset(&mut self, g: usize, out: &mut [f64]) -> bool {
        self.resets[g].is_some_and(|part| self.program.evaluate(part, out))
    }

    /// Lists the active modes; where some are listed already, only what has changed.
    fn list(&mut self, subs: &[Sub], active: &[Vec<usize>], sliding: &Sliding) {
        let mut list = std::mem::take(&mut self.active);
        if self.cells.is_empty() {
            let mut all = subs.iter().enumerate().flat_map(|(k, s)| self.parts(s, k, &active[k]));
            self.program.list(&mut all, &mut list);
        }
        for (k, s) in
            subs.iter().enumerate().filter(|(k, _)| self.cells.get(*k).is_some_and(|c| !sets::same_set(c, &active[*k])))
        {
            let gone: Vec<_> = self.parts(s, k, &self.cells[k]).collect();
            let new: Vec<_> = self.parts(s, k, &active[k]).collect();
            self.program.exchange(&gone, &new, &mut list);
        }
        self.active = list;
        sets::assign(&mut self.cells, &active[..subs.len()]);
        self.firsts.clear();
        self.others.clear();
        let mut pair = 0;
        for (s, (set, &at)) in subs.iter().zip(active.iter().zip(&self.places)) {
            let (at, nr) = (at as u32, s.rows.len() as u32);
            self.firsts.extend(s.rows.iter().zip(at..).map(|(&r, v)| (v, r as u32)));
            for i in 1..set.len() as u32 {
                let d = sliding.place_of_column(pair) as u32;
                self.others.extend((0..nr).map(|r| (d + r, at + i * nr + r, at + r)));
                pair += 1;
            }
        }
        self.listed = true;
    }

    /// Evaluates the active modes, and adds the first ones to the states they move.
    fn active(&mut self, subs: &[Sub], active: &[Vec<usize>], sliding: &Sliding, out: &mut [f64]) -> bool {
        if !self.listed {
            self.list(subs, active, sliding);
        }
        let finite = self.program.evaluate_list(&self.active, &mut self.values);
        self.active.constants_known = finite;
        self.firsts.iter().for_each(|&(v, r)| out[r as usize] += self.values[v as usize]);
        finite
    }
}

/// All that follows says whether it has succeeded. Where a value is not finite the functions are asked one by one, which
/// says more about it.
impl Field {
    /// Are there so many model functions that evaluating all of them for one of them is to be avoided?
    pub(in crate::event) fn many_functions(&self) -> bool {
        self.bundle.is_some()
    }

    /// The values of the drifts are those of all states in order.
    fn drifts_directly(&self) -> bool {
        self.direct && self.drifts.len() == 1
    }

    /// Right-hand side where nothing slides.
    pub(super) fn bundled_rhs(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> bool {
        let direct = self.drifts_directly();
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        b.drift(direct, out) & b.active(&self.subs, &self.active, &self.sliding, out)
    }

    /// The smooth part of the right-hand side.
    pub(super) fn bundled_drift(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> bool {
        let direct = self.drifts_directly();
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        b.drift(direct, out)
    }

    /// Adds the cells `sets` of those subsystems that are `decided`, with the weight `theta` of the first one where there are
    /// two.
    pub(super) fn add_bundled(
        &mut self,
        (t, x): (f64, &[f64]),
        decided: &[bool],
        (sets, theta): (&[Vec<usize>], &[f64]),
        out: &mut [f64],
    ) -> bool {
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        let own: Vec<(usize, f64, usize)> = (0..sets.len())
            .filter(|k| decided[*k])
            .flat_map(|k| {
                let weights = if sets[k].len() > 1 { [theta[k], 1.0 - theta[k]] } else { [1.0, 0.0] };
                sets[k].iter().zip(weights).map(move |(cell, w)| (k, w, *cell))
            })
            .collect();
        let mut at = 0;
        let mut all = own.iter().map(|&(k, _, cell)| {
            let s = &self.subs[k];
            at += s.rows.len();
            (b.modes[k] + s.cells[cell - s.first].mode, at - s.rows.len())
        });
        let mut list = PartList::default();
        b.program.list(&mut all, &mut list);
        let mut values = vec![0.0; at];
        if !b.program.evaluate_list(&list, &mut values) {
            return false;
        }
        let mut values = values.into_iter();
        for (k, weight, _) in own {
            self.subs[k].rows.iter().zip(&mut values).for_each(|(&r, v)| out[r] += weight * v);
        }
        true
    }

    /// `b` and `D` of a sliding mode.
    pub(super) fn bundled_parts(&mut self, t: f64, x: &[f64]) -> bool {
        let direct = self.drifts_directly();
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        let base = &mut self.base[..];
        let finite = b.drift(direct, base) & b.active(&self.subs, &self.active, &self.sliding, base);
        for &(d, v, first) in &b.others {
            self.sliding.d[d as usize] = b.values[v as usize] - b.values[first as usize];
        }
        finite
    }

    /// The weight of a cell of a subsystem that slides on one surface and whose rate depends on the mode of no other that slides,
    /// by the few functions that it depends on; none where that is not so. Gradients, which are constant, are known.
    pub(in crate::event) fn weight_alone(&mut self, cell: usize, t: f64, x: &[f64]) -> Option<f64> {
        let k = self.owner[cell];
        let i = self.first_pair[k];
        if self.first_pair[k + 1] != i + 1 || !self.valid.constant || !self.valid.rows || !self.sliding.is_alone(i) {
            return None;
        }
        let b = self.bundle.as_mut()?;
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        let pair = self.pairs[i];
        let (mut rate, mut finite) = (self.sliding.rate_by_time(pair, i), true);
        for (state, g) in self.sliding.row_of_states(pair, i) {
            for &part in &b.singles[state] {
                let mut v = [0.0];
                finite &= b.program.evaluate(part, &mut v);
                rate += g * v[0];
            }
        }
        let mut along = |b: &mut Bundled, subs: &[Sub], o: usize, cell: usize| {
            let s = &subs[o];
            let own = &mut b.room[..s.rows.len()];
            finite &= b.program.evaluate(b.modes[o] + s.cells[cell - s.first].mode, own);
            self.sliding.along_modes(pair, i, o, own)
        };
        for o in self.sliding.dependencies(k).filter(|o| *o != k) {
            rate += along(b, &self.subs, o, self.active[o][0]);
        }
        let (first, second) = (along(b, &self.subs, k, pair.base), along(b, &self.subs, k, pair.cell));
        let alpha = -(rate + first) / (second - first);
        (finite && alpha.is_finite()).then_some(if cell == pair.cell { alpha } else { 1.0 - alpha })
    }

    /// All guards, also of other discrete states.
    pub(super) fn bundled_guards(&mut self, t: f64, x: &[f64]) -> bool {
        let Some(b) = self.bundle.as_mut().filter(|b| b.with_transitions) else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        b.program.evaluate_list(&b.guards, &mut self.q)
    }

    /// All indicator functions.
    pub(super) fn bundled_indicators(&mut self, t: f64, x: &[f64]) -> bool {
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        b.program.evaluate_list(&b.indicators, &mut self.q)
    }
}
