//! Modes that are formed where they are needed ([`System::on_demand`](crate::system::System::on_demand)).
//!
//! There are a few *slots* for modes, each with a sign pattern. At a point the patterns of interest are the present ones and, where
//! switching functions vanish, their neighbours: those with other signs of the functions that vanish, and of all functions further
//! down the signs that their values have then. The switching functions are evaluated under the patterns of interest, one *group* of
//! them for every pattern; a function whose upstream signs agree in two patterns is the same function in both, and counts once. What
//! decides between the patterns are the functions that all of them have in common, so the conditions (6.19) are those of a system with
//! as many cells as there are patterns, whatever the number of all patterns is.

use std::sync::Arc;

use super::Field;
use crate::dcs::Cell;
use crate::event::watch::Watch;
use crate::func::{Dims, EvalError, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;
use crate::system::{OnDemand, Signed};

/// Patterns that may meet at a point: those of two surfaces.
pub(super) const TOGETHER: usize = 4;
/// Numbers of modes that are formed on demand: those at a point, those before the switch there, and those of the last step. A number
/// is given to another mode when its own has been left.
pub const SLOTS: usize = 3 * TOGETHER;
/// A value of at most this part of the sizes of its terms is rounding.
const ROUNDING: f64 = 1e-12;
/// A change of the velocity of at most this part of its size is none.
const CONTINUOUS: f64 = 1e-9;

/// Where the entries of several copies of a function stand in the Jacobian of all of them.
struct Layout {
    pattern: Pattern,
    places: Vec<Vec<usize>>,
}

impl Layout {
    fn new(base: &Pattern, copies: usize) -> Layout {
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for copy in 0..copies {
            for c in 0..base.n_cols() {
                for &r in base.rows(c) {
                    rows.push(copy * base.n_rows() + r);
                    cols.push(c);
                }
            }
        }
        let (pattern, map) = Pattern::from_triplets(copies * base.n_rows(), base.n_cols(), &rows, &cols);
        let n = base.nnz();
        Layout { pattern, places: (0..copies).map(|k| map[k * n..(k + 1) * n].to_vec()).collect() }
    }
}

/// A function under several sign patterns, one after the other; zero under those that are not there.
struct Copies {
    name: &'static str,
    f: Arc<dyn Signed>,
    layout: Arc<Layout>,
    signs: Vec<Option<Arc<[f64]>>>,
    none: Pattern,
}

impl Function for Copies {
    fn name(&self) -> &str {
        self.name
    }
    fn dims(&self) -> Dims {
        self.f.dims()
    }
    fn n_out(&self) -> usize {
        self.f.n_out() * self.signs.len()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.layout.pattern
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.none
    }
    fn work_len(&self) -> usize {
        self.f.work_len() + self.f.jac_pattern().nnz()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        for (signs, out) in self.signs.iter().zip(out.chunks_exact_mut(self.f.n_out().max(1))) {
            match signs {
                Some(signs) => self.f.value(at, signs, out, work)?,
                None => out.fill(0.0),
            }
        }
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        for copy in 0..self.signs.len() {
            self.jacobian_of(copy, at, out, work)?;
        }
        Ok(())
    }
    fn value_rows(&self, at: &Point, rows: std::ops::Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let n = self.f.n_out();
        match self.signs.get(rows.start / n.max(1)) {
            Some(Some(signs)) if rows.len() == n => self.f.value(at, signs, &mut out[rows], work),
            _ => self.value(at, out, work),
        }
    }
    fn jacobian_rows(&self, at: &Point, rows: std::ops::Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        match rows.len() == self.f.n_out() {
            true => self.jacobian_of(rows.start / self.f.n_out().max(1), at, out, work),
            false => self.jacobian(at, out, work),
        }
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Err(EvalError::Recoverable)
    }
    fn is_serial(&self) -> bool {
        self.f.is_serial()
    }
}

impl Copies {
    fn jacobian_of(&self, copy: usize, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let places = &self.layout.places[copy];
        match &self.signs[copy] {
            Some(signs) => {
                let (entries, work) = work.split_at_mut(places.len());
                self.f.jacobian(at, signs, entries, work)?;
                places.iter().zip(entries).for_each(|(to, v)| out[*to] = *v);
            }
            None => places.iter().for_each(|to| out[*to] = 0.0),
        }
        Ok(())
    }
}

/// A switching function that is not common to all patterns of interest.
struct Own {
    /// Its place among the functions of all groups, and the sign that it has.
    function: usize,
    sign: f64,
    /// The slots whose patterns have it.
    slots: Vec<usize>,
}

/// The patterns that there are.
pub(super) struct Demand {
    system: Arc<OnDemand>,
    modes: Arc<Layout>,
    groups: Arc<Layout>,
    /// Sign patterns of the slots: 1 for positive, 0 for negative.
    patterns: Vec<Option<Arc<[f64]>>>,
    /// The slots of the patterns of interest, one for every group of functions.
    near: Vec<usize>,
    own: Vec<Own>,
    /// Column of the time.
    t_col: usize,
    q: Vec<f64>,
    entries: Vec<f64>,
    work: Vec<f64>,
}

impl Demand {
    pub(super) fn new(system: &Arc<OnDemand>) -> Demand {
        let (rhs, psi) = (&system.rhs, &system.psi);
        Demand {
            modes: Arc::new(Layout::new(rhs.jac_pattern(), SLOTS)),
            groups: Arc::new(Layout::new(psi.jac_pattern(), TOGETHER)),
            patterns: vec![None; SLOTS],
            near: Vec::new(),
            own: Vec::new(),
            t_col: psi.dims().t_col(),
            q: vec![0.0; psi.n_out()],
            entries: vec![0.0; psi.jac_pattern().nnz()],
            work: vec![0.0; psi.work_len().max(rhs.work_len())],
            system: system.clone(),
        }
    }

    /// The modes of all slots as one function.
    pub(super) fn modes(&self) -> Arc<dyn Function> {
        let none = Pattern::from_triplets(0, 0, &[], &[]).0;
        let (f, layout) = (self.system.rhs.clone(), self.modes.clone());
        Arc::new(Copies { name: "modes", f, layout, signs: self.patterns.clone(), none })
    }

    /// The switching functions of all groups as one function.
    pub(super) fn indicators(&self) -> Arc<dyn Function> {
        let none = Pattern::from_triplets(0, 0, &[], &[]).0;
        let mut signs: Vec<_> = self.near.iter().map(|&s| self.patterns[s].clone()).collect();
        signs.resize(TOGETHER, None);
        let (f, layout) = (self.system.psi.clone(), self.groups.clone());
        Arc::new(Copies { name: "psi", f, layout, signs, none })
    }

    pub(super) fn n_functions(&self) -> usize {
        self.system.psi.n_out()
    }

    pub(super) fn cells(&self) -> Vec<Cell> {
        (0..SLOTS).map(|mode| Cell { mode, weights: vec![0.0; TOGETHER * self.n_functions()] }).collect()
    }

    pub(super) fn is_affine(&self) -> bool {
        self.system.psi.is_affine()
    }

    /// Values of the switching functions under a pattern.
    fn values(&mut self, at: &Point, signs: &[f64]) -> EvalResult {
        self.system.psi.value(at, signs, &mut self.q, &mut self.work)
    }

    /// Rates of the switching functions for a velocity, and the sizes of their values where all states have the given sizes.
    fn rates(
        &mut self,
        at: &Point,
        signs: &[f64],
        (velocity, sizes): (&[f64], &[f64]),
    ) -> Result<(Vec<f64>, Vec<f64>), EvalError> {
        self.system.psi.jacobian(at, signs, &mut self.entries, &mut self.work)?;
        let (mut rates, mut scales) = (vec![0.0; self.q.len()], vec![0.0; self.q.len()]);
        let p = self.system.psi.jac_pattern();
        let columns = (0..velocity.len()).map(|c| (c, velocity[c], sizes[c])).chain([(self.t_col, 1.0, at.t.abs())]);
        for (c, v, size) in columns {
            for k in p.range(c) {
                rates[p.row_idx()[k]] += self.entries[k] * v;
                scales[p.row_idx()[k]] += (self.entries[k] * size).abs();
            }
        }
        Ok((rates, scales))
    }

    /// Puts a pattern into a slot that is not among `keep`, or finds the slot that it has.
    fn place(&mut self, signs: &[f64], keep: &[usize]) -> Option<usize> {
        if let Some(s) = self.patterns.iter().position(|p| p.as_deref() == Some(signs)) {
            return Some(s);
        }
        let free = |s: &usize| !keep.contains(s);
        let slot = (0..SLOTS).find(|s| self.patterns[*s].is_none() && free(s)).or_else(|| (0..SLOTS).find(free))?;
        self.patterns[slot] = Some(signs.into());
        Some(slot)
    }

    /// Is function `j` the same in the patterns of two slots?
    fn same(&self, j: usize, a: usize, b: usize) -> bool {
        match (&self.patterns[a], &self.patterns[b]) {
            (Some(p), Some(q)) => self.system.upstream[j].iter().all(|&i| p[i] == q[i]),
            _ => false,
        }
    }
}

/// What became of the modes at a point.
pub(in crate::event) enum Formed {
    /// The patterns of interest have slots.
    Yes,
    /// They cannot be told: why.
    No(String),
}

impl Field {
    pub(in crate::event) fn is_on_demand(&self) -> bool {
        self.demand.is_some()
    }

    /// Finds the pattern at a point from the values of the switching functions there, and makes it the present one.
    pub(in crate::event) fn begin_modes(&mut self, t: f64, x: &[f64], keep: &[usize]) -> EvalResult {
        let Some(mut d) = self.demand.take() else { return Ok(()) };
        let at = Point { t, x, u: &self.u, p: &self.p };
        let mut signs = match self.active[0].first().and_then(|s| d.patterns[*s].clone()) {
            Some(p) => p.to_vec(),
            None => vec![0.0; d.n_functions()],
        };
        let sizes: Vec<f64> = x.iter().enumerate().map(|(i, v)| self.size(i, *v)).collect();
        let mut found = Ok(());
        for _ in 0..=signs.len() {
            found = d.values(&at, &signs);
            let scales = found.and_then(|()| d.rates(&at, &signs, (x, &sizes)));
            let scales = match scales {
                Ok((_, scales)) => scales,
                Err(e) => {
                    found = Err(e);
                    break;
                }
            };
            let mut changed = false;
            for j in 0..signs.len() {
                let positive = if d.q[j] > 0.0 { 1.0 } else { 0.0 };
                if d.q[j].abs() > ROUNDING * scales[j] && positive != signs[j] {
                    signs[j] = positive;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        let slot = d.place(&signs, keep);
        self.demand = Some(d);
        found?;
        let slot = slot.ok_or(EvalError::Recoverable)?;
        self.interest(&[slot]);
        self.active[0].clear();
        self.active[0].push(slot);
        Ok(())
    }

    /// Makes the patterns of these slots those of interest.
    pub(in crate::event) fn interest(&mut self, near: &[usize]) {
        let Some(d) = &mut self.demand else { return };
        d.near = near.to_vec();
        let n = d.n_functions();
        let s = &mut self.subs[0];
        s.cells.iter_mut().for_each(|c| c.weights.fill(0.0));
        d.own.clear();
        let sign = |slot: usize, j: usize| d.patterns[slot].as_ref().map_or(0.0, |p| 2.0 * p[j] - 1.0);
        for j in 0..n {
            if near.iter().all(|&c| d.same(j, near[0], c)) {
                for &c in near {
                    s.cells[c].weights[j] = -sign(c, j);
                }
                continue;
            }
            for (g, &first) in near.iter().enumerate() {
                if near[..g].iter().any(|&c| d.same(j, c, first)) {
                    continue;
                }
                let slots: Vec<usize> = near.iter().copied().filter(|&c| d.same(j, first, c)).collect();
                // a surface with a kink at another one at the point is not watched there
                if slots.iter().all(|&c| sign(c, j) == sign(first, j)) {
                    d.own.push(Own { function: g * n + j, sign: sign(first, j), slots });
                }
            }
        }
        (s.modes, s.indicators) = (d.modes(), d.indicators());
        self.valid.gradients = false;
        self.valid.rows = false;
    }

    /// Only the active patterns are of interest from here on.
    pub(in crate::event) fn forget_neighbours(&mut self) {
        let Some(d) = &self.demand else { return };
        if d.near != self.active[0] && !self.active[0].is_empty() {
            let active = self.active[0].clone();
            self.interest(&active);
        }
    }

    /// The patterns of interest, in the order of slots.
    pub(in crate::event) fn near_cells(&self) -> Option<Vec<usize>> {
        let mut near = self.demand.as_ref()?.near.clone();
        near.sort_unstable();
        Some(near)
    }

    /// Functions that are watched under some of the active patterns only.
    pub(in crate::event) fn own_watches(&self, out: &mut Vec<Watch>) {
        let Some(d) = &self.demand else { return };
        for o in d.own.iter().filter(|o| o.slots.iter().any(|s| self.active[0].contains(s))) {
            out.push(Watch::Enter { sub: 0, a: o.function, b: None, sign: o.sign });
        }
    }

    /// Forms the modes around a point where the functions marked in `zero` vanish: makes them the patterns of interest and evaluates
    /// the functions under them. `velocity` is that of the present mode; slots in `keep` keep their patterns.
    pub(in crate::event) fn form_modes(
        &mut self,
        (t, x, velocity): (f64, &[f64], &[f64]),
        zero: &mut [bool],
        keep: &[usize],
    ) -> Result<Formed, EvalError> {
        let Some(mut d) = self.demand.take() else { return Ok(Formed::Yes) };
        let formed = self.patterns_around(&mut d, (t, x, velocity), zero, keep);
        let n = d.n_functions();
        self.demand = Some(d);
        let (near, vanish) = match formed? {
            Ok(near) => near,
            Err(why) => return Ok(Formed::No(why)),
        };
        self.interest(&near);
        zero[..TOGETHER * n].fill(false);
        vanish.iter().for_each(|&j| zero[j] = true);
        self.watched(t, x)?;
        self.watched_gradients(t, x)?;
        Ok(Formed::Yes)
    }

    /// Slots of the patterns around a point, and the functions that vanish there.
    #[allow(clippy::type_complexity)]
    fn patterns_around(
        &self,
        d: &mut Demand,
        (t, x, velocity): (f64, &[f64], &[f64]),
        zero: &[bool],
        keep: &[usize],
    ) -> Result<Result<(Vec<usize>, Vec<usize>), String>, EvalError> {
        let n = d.n_functions();
        let active = &self.active[0];
        let present: Vec<Arc<[f64]>> = active.iter().filter_map(|s| d.patterns[*s].clone()).collect();
        let Some(first) = present.first().cloned() else { return Err(EvalError::Recoverable) };
        let mut keep = keep.to_vec();
        keep.extend(active);
        let marked =
            |j: usize| (0..d.near.len()).any(|g| zero[g * n + j] && active.iter().any(|&a| d.same(j, d.near[g], a)));
        let vanish: Vec<usize> = (0..n).filter(|&j| marked(j)).collect();
        let tied = |j: &usize| present.iter().any(|p| p[*j] != first[*j]);
        let (mut split, fresh): (Vec<usize>, Vec<usize>) = vanish.iter().partition(|j| tied(j));
        let at = Point { t, x, u: &self.u, p: &self.p };
        let mut fresh = fresh;
        if split.is_empty() && fresh.len() == 1 {
            split = std::mem::take(&mut fresh);
        }
        let mut found = self.assigned(d, &at, (&present, velocity), &split, &fresh)?;
        let smooth = match &found {
            Some(_) if fresh.is_empty() || present.len() == 1 => true,
            Some(patterns) => self.is_continuous(d, &at, &present, patterns)?,
            None => false,
        };
        if !smooth {
            // functions that vanish with a jump of the velocity: all their signs
            split.append(&mut fresh);
            if 1 << split.len() > TOGETHER {
                return Ok(Err(format!(
                    "{} switching functions vanish at once, and the velocity jumps there: modes on demand are formed around two",
                    split.len()
                )));
            }
            found = self.assigned(d, &at, (&present, velocity), &split, &[])?;
        }
        let mut near = Vec::new();
        for p in found.unwrap_or_default() {
            match d.place(&p, &keep) {
                Some(slot) => {
                    keep.push(slot);
                    if !near.contains(&slot) {
                        near.push(slot);
                    }
                }
                None => return Ok(Err("there is no room for the modes around this point".into())),
            }
        }
        // where a surface has a kink at another one that vanishes too, (6.19) has no common gradient
        let decides = |j: &&usize| near.iter().any(|&c| d.patterns[c].as_ref().is_some_and(|p| p[**j] != first[**j]));
        let apart = |j: &&usize| !near.iter().all(|&c| d.same(**j, near[0], c));
        if near.len() > 2 && split.iter().filter(decides).any(|j| apart(&j)) {
            return Ok(Err(
                "two surfaces meet of which one has a kink at the other: modes on demand do not decide there".into(),
            ));
        }
        Ok(Ok((near, vanish)))
    }

    /// Patterns for all signs of the functions `split`, with the signs of the functions `fresh` along the motion and those of the others
    /// that follow. None where the signs along the motion contradict each other.
    fn assigned(
        &self,
        d: &mut Demand,
        at: &Point,
        (present, velocity): (&[Arc<[f64]>], &[f64]),
        split: &[usize],
        fresh: &[usize],
    ) -> Result<Option<Vec<Vec<f64>>>, EvalError> {
        let mut out = Vec::new();
        for m in 0..1usize << split.len() {
            let wanted = |k: usize| (m >> k & 1) as f64;
            let fits = |p: &&Arc<[f64]>| split.iter().enumerate().all(|(k, &j)| p[j] == wanted(k));
            let mut signs = present.iter().find(fits).unwrap_or(&present[0]).to_vec();
            let mut fixed = vec![false; signs.len()];
            split.iter().chain(fresh).for_each(|&j| fixed[j] = true);
            // from a pattern whose values are those of its signs, so that what follows is seen to change
            let from = signs.clone();
            split.iter().enumerate().for_each(|(k, &j)| signs[j] = wanted(k));
            self.follow_from(d, at, (&from, &mut signs), &fixed)?;
            if !self.settle_signs(d, at, (&mut signs, &fixed), fresh, present.len() == 1, velocity)? {
                return Ok(None);
            }
            if !out.contains(&signs) {
                out.push(signs);
            }
        }
        Ok(Some(out))
    }

    /// The signs that follow from those of `signs`, where `from` had signs that fit its values.
    fn follow_from(
        &self,
        d: &mut Demand,
        at: &Point,
        (from, signs): (&[f64], &mut [f64]),
        fixed: &[bool],
    ) -> EvalResult {
        if from == signs {
            return Ok(());
        }
        d.values(at, from)?;
        let mut before = d.q.clone();
        for _ in 0..=signs.len() {
            d.values(at, signs)?;
            let mut changed = false;
            for j in 0..signs.len() {
                let q = d.q[j];
                // a value that stays what it was, on the other side by rounding, keeps its sign
                let moved = (q - before[j]).abs() > 0.5 * q.abs();
                let positive = if q > 0.0 { 1.0 } else { 0.0 };
                if !fixed[j] && moved && positive != signs[j] {
                    signs[j] = positive;
                    changed = true;
                }
            }
            before.copy_from_slice(&d.q);
            if !changed {
                break;
            }
        }
        Ok(())
    }

    /// Gives the functions `fresh` the signs that they have along the motion: of the mode itself (`own`), or with the given velocity.
    /// False where each changes the other.
    fn settle_signs(
        &self,
        d: &mut Demand,
        at: &Point,
        (signs, fixed): (&mut Vec<f64>, &[bool]),
        fresh: &[usize],
        own: bool,
        velocity: &[f64],
    ) -> Result<bool, EvalError> {
        if fresh.is_empty() {
            return Ok(true);
        }
        let sizes: Vec<f64> = at.x.iter().enumerate().map(|(i, v)| self.size(i, *v)).collect();
        let mut v = velocity.to_vec();
        for _ in 0..2 * fresh.len() + 2 {
            if own {
                d.system.rhs.value(at, signs, &mut v, &mut d.work)?;
            }
            let (rates, scales) = d.rates(at, signs, (&v, &sizes))?;
            let pace = self.pace(at.x, &v);
            let from = signs.clone();
            for &j in fresh {
                // what does not move keeps its sign
                if rates[j].abs() > ROUNDING * scales[j] * pace {
                    signs[j] = if rates[j] > 0.0 { 1.0 } else { 0.0 };
                }
            }
            if *signs == from {
                return Ok(true);
            }
            self.follow_from(d, at, (&from, signs), fixed)?;
        }
        Ok(false)
    }

    /// Is the velocity of every new pattern that of the present one with the same signs of what slides?
    fn is_continuous(
        &self,
        d: &mut Demand,
        at: &Point,
        present: &[Arc<[f64]>],
        patterns: &[Vec<f64>],
    ) -> Result<bool, EvalError> {
        let nx = self.nx;
        let (mut a, mut b) = (vec![0.0; nx], vec![0.0; nx]);
        for p in patterns {
            let distance = |r: &&Arc<[f64]>| r.iter().zip(p).filter(|(a, b)| a != b).count();
            let Some(nearest) = present.iter().min_by_key(distance) else { continue };
            d.system.rhs.value(at, p, &mut a, &mut d.work)?;
            d.system.rhs.value(at, nearest, &mut b, &mut d.work)?;
            let jump: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            if self.pace(at.x, &jump) > CONTINUOUS * self.pace(at.x, &a).max(self.pace(at.x, &b)) {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
