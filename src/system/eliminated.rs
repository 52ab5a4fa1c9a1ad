//! Systems without their algebraic equations: functions at the solution of these, with derivatives.

use std::ops::Range;
use std::sync::Arc;

use super::algebraic::{Algebraic, Solver};
use super::complementary::Combination;
use super::held::{bends_of, Taken};
use super::linear::states;
use super::{Direction, Regions, Reset, Rule, SetValued, SharedFunction, Subsystem, System, Transition};
use crate::error::{Error, Result};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// What a function gives for the algebraic states.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum OwnRows {
    /// Outputs like all others.
    Plain,
    /// Outputs that are equations: zero, as nothing moves these states.
    Zero,
    /// Outputs that are guesses: without derivatives.
    Guess,
}

/// A function of the states with a derivative: the others are those that solve the equations.
pub(super) struct Eliminated {
    f: SharedFunction,
    algebraic: Arc<Algebraic>,
    own: OwnRows,
    /// Parameters behind those of the system.
    more_p: usize,
    /// Where the outputs are those of one of several modes: the number of the subsystem, and outputs of a mode.
    switched: Option<(usize, usize)>,
    n_out: usize,
    /// Of every output whether it is one for an algebraic state.
    is_own: Vec<bool>,
    jac: Pattern,
    /// Where the entries of the Jacobian go that are not by algebraic states.
    direct: Vec<(usize, usize)>,
    /// Entry, unknown (an algebraic state or a weight), and where what comes by it goes, one place for each of its columns.
    through: Vec<(usize, usize, Range<usize>)>,
    /// The weight of the modes among the unknowns, and where what comes by it in every output goes.
    by_weight: Option<(usize, Vec<Range<usize>>)>,
    places: Vec<usize>,
    /// Inputs of the Hessian, ascending; empty where it is zero.
    inputs: Vec<usize>,
    hess: Pattern,
    /// Algebraic states that count in it.
    bends: bool,
}

/// How the outputs of a function are taken.
#[derive(Clone, Copy)]
pub(super) struct Outputs<'a> {
    pub(super) own: OwnRows,
    /// States of the outputs, where these have any.
    pub(super) rows: &'a [usize],
    pub(super) switched: Option<(usize, usize)>,
    /// Outputs behind those of the function, which are zero.
    pub(super) more: usize,
    /// Parameters behind those of the system that the outer function takes; the function may take them, too.
    pub(super) more_p: usize,
    /// Are there no second derivatives?
    pub(super) first_order: bool,
}

impl Eliminated {
    pub(super) fn function(f: &SharedFunction, algebraic: &Arc<Algebraic>, taken: Outputs) -> SharedFunction {
        let (a, p) = (algebraic, f.jac_pattern());
        let z = a.z.clone();
        let n = taken.switched.map_or(f.n_out(), |s| s.1);
        let mut is_own = vec![false; n + taken.more];
        if taken.own != OwnRows::Plain {
            is_own.iter_mut().zip(taken.rows).for_each(|(o, r)| *o = z.contains(r));
        }
        let unknown = |c: usize| a.unknown(a.input_of(f, c));
        let depends = (0..p.n_cols()).any(|c| unknown(c).is_some() && !p.rows(c).is_empty());
        let is_same = f.dims().p == a.dims.p + taken.more_p;
        if !depends && !is_own.contains(&true) && a.loops.is_empty() && is_same {
            return f.clone();
        }
        let outer = Dims { p: a.dims.p + taken.more_p, ..a.outer() };
        let outer_input = |c: usize| match c.checked_sub(a.dims.n_in() + a.n_weights()) {
            // a parameter that the system has not
            Some(k) => outer.n_in() - 1 - taken.more_p + k,
            None if c + 1 == a.dims.n_in() => outer.n_in() - 1,
            None => a.outer_input(c),
        };
        let (mut out_rows, mut out_cols) = (Vec::new(), Vec::new());
        let (mut direct, mut through) = (Vec::new(), Vec::new());
        let mut touched: Vec<usize> = Vec::new();
        for (c, entries) in p.columns() {
            for e in entries {
                let r = p.row_idx()[e] % n;
                if is_own[r] {
                    continue;
                }
                let at = out_rows.len();
                if let Some(i) = unknown(c) {
                    let columns = &a.blocks[a.block_of[i]].columns;
                    out_rows.extend(columns.iter().map(|_| r));
                    out_cols.extend(columns.iter().map(|c| outer_input(*c)));
                    touched.extend_from_slice(columns);
                    through.push((e, i, at..at + columns.len()));
                } else {
                    out_rows.push(r);
                    out_cols.push(outer_input(a.input_of(f, c)));
                    direct.push((e, at));
                }
            }
        }
        let weight = taken.switched.and_then(|(k, _)| a.loops[k].weight).map(|w| a.z.len() + w);
        let by_weight = weight.map(|w| {
            let columns = &a.blocks[a.block_of[w]].columns;
            let own = (0..n).map(|r| {
                let at = out_rows.len();
                if is_own[r] {
                    return at..at;
                }
                out_rows.extend(columns.iter().map(|_| r));
                out_cols.extend(columns.iter().map(|c| outer_input(*c)));
                at..at + columns.len()
            });
            let own = own.collect();
            touched.extend_from_slice(columns);
            (w, own)
        });
        let n_in = outer.n_in();
        let (jac, places) = Pattern::from_triplets(is_own.len(), n_in, &out_rows, &out_cols);
        direct.iter_mut().for_each(|d| d.1 = places[d.1]);
        let bends = !(a.affine || through.is_empty() && by_weight.is_none());
        if by_weight.is_some() {
            // a weight multiplies the whole of an output
            let own = (0..p.n_cols()).filter(|c| !p.rows(*c).is_empty() && unknown(*c).is_none());
            touched.extend(own.map(|c| a.input_of(f, c)));
        }
        let own_hessian = f.hess_pattern();
        if !taken.first_order && (bends || own_hessian.nnz() > 0) {
            for (c, entries) in own_hessian.columns() {
                for e in entries {
                    for i in [own_hessian.row_idx()[e], c] {
                        match unknown(i) {
                            Some(k) => touched.extend_from_slice(&a.blocks[a.block_of[k]].columns),
                            None => touched.push(a.input_of(f, i)),
                        }
                    }
                }
            }
            touched.sort_unstable();
            touched.dedup();
        } else {
            touched.clear();
        }
        let (mut hess_rows, mut hess_cols) = (Vec::new(), Vec::new());
        for (k, c) in touched.iter().enumerate() {
            hess_rows.extend(touched[..=k].iter().map(|c| outer_input(*c)));
            hess_cols.extend(std::iter::repeat_n(outer_input(*c), k + 1));
        }
        let hess = Pattern::from_triplets(n_in, n_in, &hess_rows, &hess_cols).0;
        Arc::new(Eliminated {
            f: f.clone(),
            algebraic: algebraic.clone(),
            own: taken.own,
            more_p: taken.more_p,
            switched: taken.switched,
            n_out: is_own.len(),
            is_own,
            jac,
            direct,
            through,
            by_weight,
            places,
            inputs: touched,
            hess,
            bends,
        })
    }

    /// The outputs of the function that are these under a mode.
    fn inner(&self, rows: &Range<usize>, mode: usize) -> Range<usize> {
        let (n, by) = self.switched.map_or((self.f.n_out(), 0), |(_, n)| (n, n * mode));
        by + rows.start.min(n)..by + rows.end.min(n)
    }

    /// The point of the function where the solver is with these states and the weights behind them; and how the outputs of modes are taken.
    fn there<'a>(&self, x: &'a [f64], at: &Point<'a>) -> Point<'a> {
        let d = self.f.dims();
        Point { x: &x[..d.x], p: &at.p[..d.p], ..*at }
    }

    /// The point of the system.
    fn of_system<'a>(&self, at: &Point<'a>) -> Point<'a> {
        Point { p: &at.p[..self.algebraic.dims.p], ..*at }
    }

    /// How the outputs of modes are taken together where the solver is.
    fn taken(&self, s: &mut Solver) -> Taken {
        let a = &*self.algebraic;
        s.w.copy_from_slice(&s.full[a.dims.x..]);
        self.switched.map_or(([(0, 1.0, 0.0); 2], 1), |(k, _)| a.taken(s, k))
    }
}

impl Algebraic {
    /// Adds `v` times the second derivative by `i` and `j`, inputs of all of the system or weights behind them, to `out`: an upper triangle over
    /// `inputs`.
    fn add_bend(&self, s: &Solver, inputs: &[usize], (i, j): (usize, usize), v: f64, out: &mut [f64]) {
        let (own_i, own_j) = ([i], [j]);
        let (ci, vi) = self.follows(s, &own_i);
        let (cj, vj) = self.follows(s, &own_j);
        let place = |c: &usize| inputs.binary_search(c).unwrap_or(0);
        for (a, va) in ci.iter().zip(vi) {
            for (b, vb) in cj.iter().zip(vj) {
                let (ka, kb) = (place(a), place(b));
                if i == j && ka > kb {
                    continue;
                }
                let (low, high) = (ka.min(kb), ka.max(kb));
                let twice = if i != j && ka == kb { 2.0 } else { 1.0 };
                out[high * (high + 1) / 2 + low] += twice * v * va * vb;
            }
        }
    }
}

impl Function for Eliminated {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        let outer = self.algebraic.outer();
        Dims { p: outer.p + self.more_p, ..outer }
    }
    fn n_out(&self) -> usize {
        self.n_out
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        let f = &self.f;
        f.jac_pattern().nnz() + f.hess_pattern().nnz() + f.n_out() + f.work_len()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.value_rows(at, 0..self.n_out, out, work)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.jacobian_rows(at, 0..self.n_out, out, work)
    }
    fn value_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let a = &*self.algebraic;
        let mut s = a.lock();
        a.settle(&mut s, &self.of_system(at))?;
        let (taken, n_taken) = self.taken(&mut s);
        let there = self.there(&s.full, at);
        match self.switched {
            None => self.f.value_rows(&there, self.inner(&rows, 0), &mut out[..self.f.n_out()], work)?,
            Some((_, n)) => {
                let (own, work) = work.split_at_mut(self.f.n_out());
                out.fill(0.0);
                for (mode, weight, _) in &taken[..n_taken] {
                    let inner = self.inner(&rows, *mode);
                    self.f.value_rows(&there, inner.clone(), own, work)?;
                    inner.for_each(|o| out[o % n] += weight * own[o]);
                }
            }
        }
        let first_more = self.switched.map_or(self.f.n_out(), |s| s.1);
        out[first_more..].fill(0.0);
        if self.own == OwnRows::Zero {
            out.iter_mut().zip(&self.is_own).filter(|o| *o.1).for_each(|(o, _)| *o = 0.0);
        }
        Ok(())
    }
    fn jacobian_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let a = &*self.algebraic;
        let (entries, work) = work.split_at_mut(self.f.jac_pattern().nnz());
        let mut s = a.lock();
        a.settle(&mut s, &self.of_system(at))?;
        a.differentiate(&mut s, &self.of_system(at))?;
        let (taken, n_taken) = self.taken(&mut s);
        let there = self.there(&s.full, at);
        out.fill(0.0);
        for (mode, weight, slope) in &taken[..n_taken] {
            let inner = self.inner(&rows, *mode);
            self.f.jacobian_rows(&there, inner.clone(), entries, work)?;
            let all = inner.len() == self.f.n_out();
            let pattern = self.f.jac_pattern();
            let of_rows = |e: usize| all || inner.contains(&pattern.row_idx()[e]);
            self.direct.iter().filter(|d| of_rows(d.0)).for_each(|(e, to)| out[*to] += weight * entries[*e]);
            for (e, z, places) in self.through.iter().filter(|d| of_rows(d.0)) {
                let (_, slopes) = a.slopes(&s, *z);
                self.places[places.clone()].iter().zip(slopes).for_each(|(to, v)| out[*to] += weight * entries[*e] * v);
            }
            let Some((w, ranges)) = self.by_weight.as_ref().filter(|_| *slope != 0.0) else { continue };
            let (own, work) = work.split_at_mut(self.f.n_out());
            self.f.value_rows(&there, inner.clone(), own, work)?;
            let (_, slopes) = a.slopes(&s, *w);
            for (o, places) in inner.zip(&ranges[rows.start.min(ranges.len())..]) {
                let to = self.places[places.clone()].iter().zip(slopes);
                to.for_each(|(to, v)| out[*to] += slope * own[o] * v);
            }
        }
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        if self.inputs.is_empty() {
            return Ok(());
        }
        let (a, f) = (&*self.algebraic, &self.f);
        let mut guard = a.lock();
        let s = &mut *guard;
        a.settle(s, &self.of_system(at))?;
        let x = s.full.clone();
        a.differentiate(s, &self.of_system(at))?;
        let (taken, n_taken) = self.taken(s);
        let there = self.there(&x, at);
        let input = |c: usize| a.input_of(f, c);
        let n = self.switched.map_or(f.n_out(), |s| s.1);
        let mut bends = Vec::new();
        let mut by_unknown = vec![0.0; a.block_of.len()];
        let column = self.by_weight.as_ref().map(|(w, _)| a.dims.n_in() + w - a.z.len());
        for (mode, weight, slope) in &taken[..n_taken] {
            let mut own = vec![0.0; f.n_out()];
            for o in self.inner(&(0..n), *mode).filter(|o| !self.is_own[o % n]) {
                own[o] = weights[o % n];
            }
            let (jac, work) = work.split_at_mut(f.jac_pattern().nnz());
            let (hess, work) = work.split_at_mut(f.hess_pattern().nnz());
            bends_of((f, &there, &input), &own, (*weight, *slope, column), (hess, jac, work), &mut bends)?;
            if !self.bends {
                continue;
            }
            f.jacobian(&there, jac, work)?;
            for (e, z, _) in &self.through {
                by_unknown[*z] += weight * own[f.jac_pattern().row_idx()[*e]] * jac[*e];
            }
            if let Some((w, _)) = self.by_weight.as_ref().filter(|_| *slope != 0.0) {
                let (value, work) = work.split_at_mut(f.n_out());
                f.value(&there, value, work)?;
                by_unknown[*w] += slope * own.iter().zip(value).map(|(o, v)| o * *v).sum::<f64>();
            }
        }
        if self.bends {
            let multipliers = a.multipliers(s, &by_unknown);
            let own = Point { x: &x[..a.dims.x], ..self.of_system(at) };
            bends.extend(a.bends_of_equations(s, &own, &multipliers)?);
        }
        bends.iter().filter(|b| b.2 != 0.0).for_each(|(i, j, v)| a.add_bend(s, &self.inputs, (*i, *j), *v, out));
        Ok(())
    }
    fn is_serial(&self) -> bool {
        self.f.is_serial() || self.algebraic.parts.iter().any(|p| p.f.is_serial())
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.f.jacobian_is_approximate() || self.algebraic.parts.iter().any(|p| p.f.jacobian_is_approximate())
    }
    fn hessian_is_approximate(&self) -> bool {
        self.f.hessian_is_approximate() || self.algebraic.parts.iter().any(|p| p.f.hessian_is_approximate())
    }
}

/// The weight of a loop, as an output: times a sign, less what it is at an end of its interval.
struct WeightAt {
    algebraic: Arc<Algebraic>,
    unknown: usize,
    sign: f64,
    end: f64,
    jac: Pattern,
    inputs: Vec<usize>,
    hess: Pattern,
}

impl WeightAt {
    fn new(a: &Arc<Algebraic>, weight: usize, sign: f64, end: f64) -> WeightAt {
        let unknown = a.z.len() + weight;
        let inputs = a.blocks[a.block_of[unknown]].columns.clone();
        let outer: Vec<usize> = inputs.iter().map(|c| a.outer_input(*c)).collect();
        let n = a.outer().n_in();
        let jac = Pattern::from_triplets(1, n, &vec![0; outer.len()], &outer).0;
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for (k, c) in outer.iter().enumerate() {
            rows.extend(&outer[..=k]);
            cols.extend(std::iter::repeat_n(*c, k + 1));
        }
        let hess = Pattern::from_triplets(n, n, &rows, &cols).0;
        WeightAt { algebraic: a.clone(), unknown, sign, end, jac, inputs, hess }
    }
}

impl Function for WeightAt {
    fn name(&self) -> &str {
        "weight of a mode"
    }
    fn dims(&self) -> Dims {
        self.algebraic.outer()
    }
    fn n_out(&self) -> usize {
        1
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        let a = &*self.algebraic;
        let mut s = a.lock();
        a.settle(&mut s, at)?;
        out[0] = self.sign * (s.full[a.dims.x + self.unknown - a.z.len()] - self.end);
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        let a = &*self.algebraic;
        let mut s = a.lock();
        a.settle(&mut s, at)?;
        a.differentiate(&mut s, at)?;
        out.iter_mut().zip(a.slopes(&s, self.unknown).1).for_each(|(o, v)| *o = self.sign * v);
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], _: &mut [f64]) -> EvalResult {
        let a = &*self.algebraic;
        let mut guard = a.lock();
        let s = &mut *guard;
        a.settle(s, at)?;
        a.differentiate(s, at)?;
        s.w.copy_from_slice(&s.full[a.dims.x..]);
        let x = s.full[..a.dims.x].to_vec();
        let mut by_unknown = vec![0.0; a.block_of.len()];
        by_unknown[self.unknown] = self.sign * weights[0];
        let multipliers = a.multipliers(s, &by_unknown);
        out.fill(0.0);
        for (i, j, v) in a.bends_of_equations(s, &Point { x: &x, ..*at }, &multipliers)? {
            a.add_bend(s, &self.inputs, (i, j), v, out);
        }
        Ok(())
    }
    fn is_serial(&self) -> bool {
        self.algebraic.parts.iter().any(|p| p.f.is_serial())
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.algebraic.parts.iter().any(|p| p.f.jacobian_is_approximate())
    }
    fn hessian_is_approximate(&self) -> bool {
        self.algebraic.parts.iter().any(|p| p.f.hessian_is_approximate())
    }
}

/// A system without algebraic equations, and those that it follows.
pub(crate) struct Elimination {
    /// Its transitions are those of the stated system, and behind them those that change the mode of a subsystem in the equations.
    pub(crate) system: System,
    pub(crate) algebraic: Arc<Algebraic>,
    /// The algebraic states as a function of the others.
    pub(crate) unknowns: SharedFunction,
}

impl System {
    /// The system with its algebraic states, and the weights of its inclusions, eliminated; none where it has neither. It has the same states: nothing moves the algebraic ones, which
    /// hold a guess. Behind them are the modes of the subsystems that switch in the equations.
    ///
    /// # Errors
    /// Those of [`Algebraic::new`]; [`Error::Unsupported`] with multipliers of constraints.
    pub(crate) fn eliminated(&self) -> Result<Option<Elimination>> {
        if self.n_z == 0 && self.inclusions.is_empty() {
            return Ok(None);
        }
        self.validate_for_events()?;
        if let Some(k) = self.inclusions.iter().position(|i| i.set != SetValued::Step) {
            return Err(Error::Unsupported(format!(
                "inclusion {k} has multipliers of constraints, which events do not follow: state them as a projected system, or simulate \
                 the system with finite elements"
            )));
        }
        let algebraic = Arc::new(Algebraic::new(self)?);
        let (a, nx) = (&algebraic, self.dims.x);
        let all: Vec<usize> = (0..nx).collect();
        let none = Outputs { own: OwnRows::Plain, rows: &[], switched: None, more: 0, more_p: 0, first_order: false };
        let plain = |f: &SharedFunction| Eliminated::function(f, a, none);
        let mut system = System {
            dims: a.outer(),
            n_z: 0,
            algebraic: None,
            combined: None,
            subsystems: Vec::new(),
            inclusions: Vec::new(),
            ..self.clone()
        };
        let zero = Outputs { own: OwnRows::Zero, ..none };
        let of_f0 = Outputs { rows: &all, more: a.loops.len() + a.n_weights(), ..zero };
        system.f0 = self.f0.as_ref().map(|f| Eliminated::function(f, a, of_f0));
        for (k, s) in self.subsystems.iter().enumerate() {
            let switched = a.loops.iter().position(|l| l.subsystem == k).map(|l| (l, s.rows.len()));
            if switched.is_some() && s.rows.iter().all(|r| a.z.contains(r)) {
                continue;
            }
            let rows: Vec<usize> = (0..s.n_modes).flat_map(|_| s.rows.iter().copied()).collect();
            let modes = Eliminated::function(&s.modes, a, Outputs { rows: &rows, switched, ..zero });
            let regions = match &s.regions {
                Regions::Signs { psi, signs } => Regions::Signs { psi: plain(psi), signs: signs.clone() },
                Regions::Indicators(g) => Regions::Indicators(plain(g)),
            };
            let n_modes = if switched.is_some() { 1 } else { s.n_modes };
            system.subsystems.push(Subsystem { rows: s.rows.clone(), modes, n_modes, regions });
        }
        if let Some(m) = &self.mechanics {
            system.mechanics = Some(Arc::new(self.eliminated_mechanics(a, m)?));
        }
        let flows = if self.mechanics.is_some() { &[][..] } else { &self.inclusions };
        for (i, f) in flows.iter().zip(&a.inclusions) {
            let modes = Eliminated::function(f, a, Outputs { rows: &i.rows, ..zero });
            let regions = Regions::Signs { psi: plain(&i.psi), signs: vec![0; i.psi.n_out()] };
            system.subsystems.push(Subsystem { rows: i.rows.clone(), modes, n_modes: 1, regions });
        }
        for t in &mut system.transitions {
            t.guard = plain(&t.guard);
            if let Some(r) = &mut t.reset {
                let f = Eliminated::function(&r.f, a, Outputs { own: OwnRows::Guess, rows: &r.rows, ..none });
                *r = Reset { f, ..r.clone() };
            }
        }
        let next = |guard: SharedFunction, k: usize, [from, to]: [usize; 2]| Transition {
            guard,
            clauses: Vec::new(),
            direction: Direction::Rising,
            from: vec![(nx + k, from as f64)],
            reset: None,
            to: vec![(nx + k, to as f64)],
            rule: Rule::default(),
        };
        for (k, l) in a.loops.iter().enumerate() {
            let crosses = |terms: &[(usize, f64)]| {
                let f = l.functions();
                let sum = vec![terms.iter().map(|(o, weight)| (0, *o, *weight)).collect()];
                plain(&(Arc::new(Combination::new(f.name().into(), vec![f.clone()], sum)) as SharedFunction))
            };
            for mode in 0..l.n_modes {
                for (terms, to) in l.exits(mode) {
                    let guard = crosses(&terms);
                    let held = l.between(mode, to).map(|held| next(guard.clone(), k, [mode, held]));
                    system.transitions.push(next(guard, k, [mode, to]));
                    // no discrete state has two values: it is made in place of the one before it, and never by itself
                    system
                        .transitions
                        .extend(held.map(|t| Transition { from: vec![t.from[0], (t.from[0].0, -1.0)], ..t }));
                }
            }
            for (i, h) in l.held.iter().enumerate() {
                let (mode, weight) = (l.n_modes + i, l.weight.unwrap_or(0));
                for (sign, end, to) in [(-1.0, 0.0, h.low), (1.0, 1.0, h.high)] {
                    system.transitions.push(next(Arc::new(WeightAt::new(a, weight, sign, end)), k, [mode, to]));
                }
                let exits = l.exits_of_held(h);
                system.transitions.extend(exits.iter().map(|(terms, to)| next(crosses(terms), k, [mode, *to])));
            }
        }
        let z: Vec<usize> = self.algebraic_states().collect();
        let own = states("algebraic states", self.dims, &z);
        let unknowns = plain(&own);
        Ok(Some(Elimination { system, algebraic, unknowns }))
    }
}
