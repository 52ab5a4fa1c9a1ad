//! Systems without their algebraic equations: functions at the solution of these, with derivatives.

use std::ops::Range;
use std::sync::Arc;

use super::algebraic::{mode_at, Algebraic, Solver};
use super::{Direction, Regions, Reset, Rule, SharedFunction, Subsystem, System, Transition};
use crate::error::{Error, Result};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// What a function gives for the algebraic states.
#[derive(Clone, Copy, PartialEq, Eq)]
enum OwnRows {
    /// Outputs like all others.
    Plain,
    /// Outputs that are equations: zero, as nothing moves these states.
    Zero,
    /// Outputs that are guesses: without derivatives.
    Guess,
}

/// A function of the states with a derivative: the others are those that solve the equations.
pub(crate) struct Eliminated {
    f: SharedFunction,
    algebraic: Arc<Algebraic>,
    own: OwnRows,
    /// Where the outputs are those of one of several modes: the number of the subsystem, and outputs of a mode.
    switched: Option<(usize, usize)>,
    n_out: usize,
    /// Of every output whether it is one for an algebraic state.
    is_own: Vec<bool>,
    jac: Pattern,
    /// Where the entries of the Jacobian go that are not by algebraic states.
    direct: Vec<(usize, usize)>,
    /// Entry, algebraic state, and where what comes by it goes, one place for each of its columns.
    through: Vec<(usize, usize, Range<usize>)>,
    places: Vec<usize>,
    /// Inputs of the Hessian, ascending; empty where it is zero.
    inputs: Vec<usize>,
    hess: Pattern,
    /// Algebraic states that count in it.
    bends: bool,
}

/// How the outputs of a function are taken.
#[derive(Clone, Copy)]
struct Taken<'a> {
    own: OwnRows,
    /// States of the outputs, where these have any.
    rows: &'a [usize],
    switched: Option<(usize, usize)>,
    /// Outputs behind those of the function, which are zero.
    more: usize,
}

impl Eliminated {
    fn function(f: &SharedFunction, algebraic: &Arc<Algebraic>, taken: Taken) -> SharedFunction {
        let (a, p) = (algebraic, f.jac_pattern());
        let z = a.z.clone();
        let n = taken.switched.map_or(f.n_out(), |s| s.1);
        let mut is_own = vec![false; n + taken.more];
        if taken.own != OwnRows::Plain {
            is_own.iter_mut().zip(taken.rows).for_each(|(o, r)| *o = z.contains(r));
        }
        let depends = z.clone().any(|c| !p.rows(c).is_empty());
        if !depends && !is_own.contains(&true) && a.loops.is_empty() {
            return f.clone();
        }
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
                if z.contains(&c) {
                    let columns = &a.blocks[a.block_of[c - z.start]].columns;
                    out_rows.extend(columns.iter().map(|_| r));
                    out_cols.extend(columns.iter().map(|c| a.outer_input(*c)));
                    touched.extend_from_slice(columns);
                    through.push((e, c - z.start, at..at + columns.len()));
                } else {
                    out_rows.push(r);
                    out_cols.push(a.outer_input(c));
                    direct.push((e, at));
                }
            }
        }
        let n_in = a.outer().n_in();
        let (jac, places) = Pattern::from_triplets(is_own.len(), n_in, &out_rows, &out_cols);
        direct.iter_mut().for_each(|d| d.1 = places[d.1]);
        let bends = !a.affine && !through.is_empty();
        let own_hessian = f.hess_pattern();
        if bends || own_hessian.nnz() > 0 {
            for (c, entries) in own_hessian.columns() {
                for e in entries {
                    for i in [own_hessian.row_idx()[e], c] {
                        match z.contains(&i) {
                            true => touched.extend_from_slice(&a.blocks[a.block_of[i - z.start]].columns),
                            false => touched.push(i),
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
            hess_rows.extend(touched[..=k].iter().map(|c| a.outer_input(*c)));
            hess_cols.extend(std::iter::repeat_n(a.outer_input(*c), k + 1));
        }
        let hess = Pattern::from_triplets(n_in, n_in, &hess_rows, &hess_cols).0;
        Arc::new(Eliminated {
            f: f.clone(),
            algebraic: algebraic.clone(),
            own: taken.own,
            switched: taken.switched,
            n_out: is_own.len(),
            is_own,
            jac,
            direct,
            through,
            places,
            inputs: touched,
            hess,
            bends,
        })
    }

    /// The outputs of the function that are these, under the modes of a point.
    fn inner(&self, rows: &Range<usize>, x: &[f64]) -> Range<usize> {
        let a = &*self.algebraic;
        let (n, by) = match self.switched {
            Some((k, n)) => (n, n * mode_at(x[a.dims.x + k], a.loops[k].n_modes)),
            None => (self.f.n_out(), 0),
        };
        by + rows.start.min(n)..by + rows.end.min(n)
    }

    /// Adds `v` times the second derivative by inputs `i` and `j` of all of the system to `out`.
    fn add_bend(&self, s: &Solver, (i, j): (usize, usize), v: f64, out: &mut [f64]) {
        let a = &*self.algebraic;
        let (own_i, own_j) = ([i], [j]);
        let (ci, vi) = a.follows(s, &own_i);
        let (cj, vj) = a.follows(s, &own_j);
        let place = |c: &usize| self.inputs.binary_search(c).unwrap_or(0);
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
        self.algebraic.outer()
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
        let entries = f.jac_pattern().nnz() + f.hess_pattern().nnz() + f.n_out();
        self.algebraic.dims.x + entries + f.work_len()
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
        a.settle(&mut s, at)?;
        let inner = self.inner(&rows, at.x);
        let there = Point { x: &s.full, ..*at };
        match self.switched {
            None => self.f.value_rows(&there, inner, &mut out[..self.f.n_out()], work)?,
            Some((_, n)) => {
                let (own, work) = work.split_at_mut(self.f.n_out());
                self.f.value_rows(&there, inner.clone(), own, work)?;
                inner.for_each(|o| out[o % n] = own[o]);
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
        a.settle(&mut s, at)?;
        a.differentiate(&mut s, at)?;
        let inner = self.inner(&rows, at.x);
        self.f.jacobian_rows(&Point { x: &s.full, ..*at }, inner.clone(), entries, work)?;
        let all = inner.len() == self.f.n_out();
        let pattern = self.f.jac_pattern();
        let of_rows = |e: usize| all || inner.contains(&pattern.row_idx()[e]);
        out.fill(0.0);
        self.direct.iter().filter(|d| of_rows(d.0)).for_each(|(e, to)| out[*to] += entries[*e]);
        for (e, z, places) in self.through.iter().filter(|d| of_rows(d.0)) {
            let (_, slopes) = a.slopes(&s, *z);
            self.places[places.clone()].iter().zip(slopes).for_each(|(to, v)| out[*to] += entries[*e] * v);
        }
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        if self.inputs.is_empty() {
            return Ok(());
        }
        let (a, f) = (&*self.algebraic, &self.f);
        let (x, work) = work.split_at_mut(a.dims.x);
        let (jac, work) = work.split_at_mut(f.jac_pattern().nnz());
        let (hess, work) = work.split_at_mut(f.hess_pattern().nnz());
        let (own, work) = work.split_at_mut(f.n_out());
        own.fill(0.0);
        let n = self.switched.map_or(f.n_out(), |s| s.1);
        for o in self.inner(&(0..n), at.x).filter(|o| !self.is_own[o % n]) {
            own[o] = weights[o % n];
        }
        let mut guard = a.lock();
        let s = &mut *guard;
        a.settle(s, at)?;
        x.copy_from_slice(&s.full);
        a.differentiate(s, at)?;
        let there = Point { x, ..*at };
        f.hessian(&there, own, hess, work)?;
        if self.bends {
            f.jacobian(&there, jac, work)?;
        }
        for (c, entries) in f.hess_pattern().columns() {
            for e in entries {
                self.add_bend(s, (f.hess_pattern().row_idx()[e], c), hess[e], out);
            }
        }
        if !self.bends {
            return Ok(());
        }
        // multipliers of the equations
        let mut by_z = vec![0.0; a.z.len()];
        for (e, z, _) in &self.through {
            by_z[*z] += own[f.jac_pattern().row_idx()[*e]] * jac[*e];
        }
        let mut multipliers = vec![0.0; by_z.len()];
        for (b, lu) in a.blocks.iter().zip(&mut s.lus) {
            let column = &mut s.column[..b.rows.len()];
            column.iter_mut().zip(&b.unknowns).for_each(|(c, i)| *c = -by_z[*i]);
            lu.solve_transposed(column);
            b.rows.iter().zip(column).for_each(|(r, c)| multipliers[*r] = *c);
        }
        for p in &a.parts {
            let mut own = vec![0.0; p.f.n_out()];
            p.outputs(&s.modes).zip(&p.equations).for_each(|(o, e)| own[o] = multipliers[*e]);
            let n = p.f.hess_pattern().nnz();
            if own.iter().all(|v| *v == 0.0) || n == 0 {
                continue;
            }
            let mut bend = vec![0.0; n];
            p.f.hessian(&there, &own, &mut bend, &mut s.work)?;
            for (c, entries) in p.f.hess_pattern().columns() {
                for e in entries.filter(|e| bend[*e] != 0.0) {
                    self.add_bend(s, (p.f.hess_pattern().row_idx()[e], c), bend[e], out);
                }
            }
        }
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

/// The algebraic states themselves, as outputs.
struct Unknowns {
    dims: Dims,
    z: Range<usize>,
    jac: Pattern,
    hess: Pattern,
}

impl Function for Unknowns {
    fn name(&self) -> &str {
        "algebraic states"
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.jac.n_rows()
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
        out.copy_from_slice(&at.x[self.z.clone()]);
        Ok(())
    }
    fn jacobian(&self, _: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out.fill(1.0);
        Ok(())
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
}

/// A sum of outputs of a function.
struct Sum {
    f: SharedFunction,
    terms: Vec<(usize, f64)>,
    jac: Pattern,
    /// Where the entries of the Jacobian go, and their weights.
    places: Vec<(usize, usize, f64)>,
}

impl Sum {
    fn new(f: &SharedFunction, terms: &[(usize, f64)]) -> Sum {
        let p = f.jac_pattern();
        let (mut cols, mut of) = (Vec::new(), Vec::new());
        for (c, entries) in p.columns() {
            for e in entries {
                if let Some((_, w)) = terms.iter().find(|t| t.0 == p.row_idx()[e]) {
                    cols.push(c);
                    of.push((e, *w));
                }
            }
        }
        let (jac, map) = Pattern::from_triplets(1, p.n_cols(), &vec![0; cols.len()], &cols);
        let places = of.into_iter().zip(map).map(|((e, w), to)| (e, to, w)).collect();
        Sum { f: f.clone(), terms: terms.to_vec(), jac, places }
    }
}

impl Function for Sum {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        self.f.dims()
    }
    fn n_out(&self) -> usize {
        1
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        self.f.hess_pattern()
    }
    fn work_len(&self) -> usize {
        self.f.n_out().max(self.f.jac_pattern().nnz()) + self.f.work_len()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let (own, work) = work.split_at_mut(self.f.n_out());
        self.f.value(at, own, work)?;
        out[0] = self.terms.iter().map(|(o, w)| w * own[*o]).sum();
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let (own, work) = work.split_at_mut(self.f.jac_pattern().nnz());
        self.f.jacobian(at, own, work)?;
        out.fill(0.0);
        self.places.iter().for_each(|(e, to, w)| out[*to] += w * own[*e]);
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let (own, work) = work.split_at_mut(self.f.n_out());
        own.fill(0.0);
        self.terms.iter().for_each(|(o, w)| own[*o] = w * weights[0]);
        self.f.hessian(at, own, out, work)
    }
    fn is_serial(&self) -> bool {
        self.f.is_serial()
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.f.jacobian_is_approximate()
    }
    fn hessian_is_approximate(&self) -> bool {
        self.f.hessian_is_approximate()
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
    /// The system with its algebraic states eliminated; none where it has none. It has the same states: nothing moves the algebraic ones, which
    /// hold a guess. Behind them are the modes of the subsystems that switch in the equations.
    ///
    /// # Errors
    /// Those of [`Algebraic::new`]; [`Error::Unsupported`] with inclusions.
    pub(crate) fn eliminated(&self) -> Result<Option<Elimination>> {
        if self.n_z == 0 {
            return Ok(None);
        }
        self.validate()?;
        if !self.inclusions.is_empty() {
            return Err(Error::Unsupported(
                "inclusions in a system with algebraic equations: simulate it with finite elements".into(),
            ));
        }
        let algebraic = Arc::new(Algebraic::new(self)?);
        let (a, nx) = (&algebraic, self.dims.x);
        let all: Vec<usize> = (0..nx).collect();
        let none = Taken { own: OwnRows::Plain, rows: &[], switched: None, more: 0 };
        let plain = |f: &SharedFunction| Eliminated::function(f, a, none);
        let mut system =
            System { dims: a.outer(), n_z: 0, algebraic: None, combined: None, subsystems: Vec::new(), ..self.clone() };
        let zero = Taken { own: OwnRows::Zero, ..none };
        let of_f0 = Taken { rows: &all, more: a.loops.len(), ..zero };
        system.f0 = self.f0.as_ref().map(|f| Eliminated::function(f, a, of_f0));
        for (k, s) in self.subsystems.iter().enumerate() {
            let switched = a.loops.iter().position(|l| l.subsystem == k).map(|l| (l, s.rows.len()));
            if switched.is_some() && s.rows.iter().all(|r| a.z.contains(r)) {
                continue;
            }
            let rows: Vec<usize> = (0..s.n_modes).flat_map(|_| s.rows.iter().copied()).collect();
            let modes = Eliminated::function(&s.modes, a, Taken { rows: &rows, switched, ..zero });
            let regions = match &s.regions {
                Regions::Signs { psi, signs } => Regions::Signs { psi: plain(psi), signs: signs.clone() },
                Regions::Indicators(g) => Regions::Indicators(plain(g)),
            };
            let n_modes = if switched.is_some() { 1 } else { s.n_modes };
            system.subsystems.push(Subsystem { rows: s.rows.clone(), modes, n_modes, regions });
        }
        for t in &mut system.transitions {
            t.guard = plain(&t.guard);
            if let Some(r) = &mut t.reset {
                let f = Eliminated::function(&r.f, a, Taken { own: OwnRows::Guess, rows: &r.rows, ..none });
                *r = Reset { f, ..r.clone() };
            }
        }
        for (k, l) in a.loops.iter().enumerate() {
            for mode in 0..l.n_modes {
                for (terms, next) in l.exits(mode) {
                    let guard: SharedFunction = Arc::new(Sum::new(l.functions(), &terms));
                    system.transitions.push(Transition {
                        guard: plain(&guard),
                        clauses: Vec::new(),
                        direction: Direction::Rising,
                        from: vec![(nx + k, mode as f64)],
                        reset: None,
                        to: vec![(nx + k, next as f64)],
                        rule: Rule::default(),
                    });
                }
            }
        }
        let (nz, n, z) = (self.n_z, self.dims.n_in(), self.algebraic_states());
        let rows: Vec<usize> = (0..nz).collect();
        let cols: Vec<usize> = z.clone().collect();
        let jac = Pattern::from_triplets(nz, n, &rows, &cols).0;
        let own: SharedFunction = Arc::new(Unknowns { dims: self.dims, z, jac, hess: Pattern::empty(n, n) });
        let unknowns = plain(&own);
        Ok(Some(Elimination { system, algebraic, unknowns }))
    }
}
