//! Evaluation of the discretised problem: values, Jacobian and Hessian through fixed maps.
//!
//! One traversal writes every derivative entry; run once with a recorder it gives the pattern, run with the
//! map of that pattern it fills the values, so the two cannot drift apart. Model functions are evaluated
//! once per point into a cache.

use super::eta;
use super::layout::{ElementIndex, Layout, PathAt, Spec};
use crate::error::{Error, Result};
use crate::func::{EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::mpcc::{Mpcc, Side};
use crate::nlp::{Bounds, Nlp};
use crate::settings::StepEquilibration;
use crate::system::SharedFunction;
use crate::tableau::Tableau;

/// A function at a point of the grid, and where its values lie in the cache.
#[derive(Debug, Clone, Copy)]
struct Call {
    f: usize,
    x: usize,
    u: usize,
    val: usize,
    jac: usize,
    hess: usize,
    /// Weights of the Hessian.
    wgt: usize,
}

/// Calls of one element.
#[derive(Debug, Clone, Default)]
struct ElementCalls {
    /// Per stage point, per drift.
    drift: Vec<Vec<Call>>,
    /// Per stage point, per subsystem.
    modes: Vec<Vec<Call>>,
    ind: Vec<Vec<Call>>,
    ind_end: Vec<Call>,
    lagrange: Vec<Call>,
}

/// Buffers of the traversals, taken out of the problem while it is read.
#[derive(Debug, Default)]
struct Scratch {
    /// Right-hand side at a point.
    f: Vec<f64>,
    /// Local variables of an η term.
    local: Vec<f64>,
}

/// Values of all functions at all points.
#[derive(Debug, Clone, Default)]
struct Cache {
    val: Vec<f64>,
    jac: Vec<f64>,
    hess: Vec<f64>,
    wgt: Vec<f64>,
    work: Vec<f64>,
}

/// A multiplier with the wrong sign.
#[derive(Debug, Clone, Copy)]
pub struct Violation<'a> {
    /// Element.
    pub element: usize,
    /// Cell.
    pub cell: usize,
    /// `θ` or `λ`?
    pub of_theta: bool,
    /// State there.
    pub x: &'a [f64],
    /// Time there, where the model has a clock.
    pub t: Option<f64>,
}

/// Receives the entries of a sparse matrix in a fixed order.
trait Sink {
    fn add(&mut self, row: usize, col: usize, v: f64);
}

#[derive(Default)]
struct Recorder {
    rows: Vec<usize>,
    cols: Vec<usize>,
}

impl Sink for Recorder {
    fn add(&mut self, row: usize, col: usize, _: f64) {
        self.rows.push(row);
        self.cols.push(col);
    }
}

struct Writer<'a> {
    map: &'a [u32],
    k: usize,
    values: &'a mut [f64],
}

impl Sink for Writer<'_> {
    #[inline]
    fn add(&mut self, _: usize, _: usize, v: f64) {
        self.values[self.map[self.k] as usize] += v;
        self.k += 1;
    }
}

/// Adds to the upper triangle.
#[inline]
fn add_sym<S: Sink>(sink: &mut S, i: usize, j: usize, v: f64) {
    if i <= j {
        sink.add(i, j, v);
    } else {
        sink.add(j, i, v);
    }
}

/// The discretised problem.
pub struct Fesd {
    spec: Spec,
    tableau: Tableau,
    l: Layout,
    functions: Vec<SharedFunction>,
    /// Column patterns of the functions as (column, row) lists, in CSC order.
    jac_cols: Vec<Vec<(u32, u32)>>,
    hess_cols: Vec<Vec<(u32, u32)>>,
    calls: Vec<Call>,
    ecalls: Vec<ElementCalls>,
    ind_start: Vec<Call>,
    path: Vec<Call>,
    /// First path row of each path call.
    path_rows: Vec<usize>,
    terminal: Vec<Call>,
    mayer: Option<Call>,
    cache: Cache,
    jac: Pattern,
    jac_map: Vec<u32>,
    hess: Pattern,
    hess_map: Vec<u32>,
    /// Derivative at 0 of the polynomial through the values at 0 and at the nodes.
    slope: Vec<f64>,
    params: Vec<f64>,
    /// Length of a control stage.
    duration: f64,
    polishing: bool,
    scratch: Scratch,
    evaluations: usize,
}

impl Fesd {
    /// Discretises `spec`; `duration` is the length of one control stage.
    pub fn new(spec: Spec, duration: f64) -> Result<Fesd> {
        let tableau = Tableau::new(spec.options.family, spec.options.n_s)?;
        let l = Layout::new(&spec, &tableau)?;
        let mut b = Builder { functions: Vec::new(), calls: Vec::new(), sizes: [0; 4] };
        let mut ecalls = Vec::with_capacity(l.elements.len());
        let mut ind_start = Vec::new();
        let u0 = l.u[0];
        if l.fesd {
            for s in spec.dcs.subsystems() {
                ind_start.push(b.call(&s.indicators, l.x0, u0));
            }
        }
        for e in &l.elements {
            let mut ec = ElementCalls::default();
            for i in 0..tableau.n_s {
                let x = e.x[i];
                ec.drift.push(spec.dcs.drifts().iter().map(|d| b.call(&d.f, x, e.u)).collect());
                ec.modes.push(spec.dcs.subsystems().iter().map(|s| b.call(&s.modes, x, e.u)).collect());
                ec.ind.push(spec.dcs.subsystems().iter().map(|s| b.call(&s.indicators, x, e.u)).collect());
                if let Some(f) = &spec.lagrange {
                    ec.lagrange.push(b.call(f, x, e.u));
                }
            }
            if e.lambda_end.is_some() {
                ec.ind_end = spec.dcs.subsystems().iter().map(|s| b.call(&s.indicators, e.x_end, e.u)).collect();
            }
            ecalls.push(ec);
        }
        let (mut path, mut path_rows) = (Vec::new(), l.row_path.clone());
        for p in &spec.path {
            for k in 0..spec.n_stages {
                let els = &l.elements[k * spec.n_fe..(k + 1) * spec.n_fe];
                path.push(b.call(&p.f, els[0].x_start, l.u[k]));
                match p.at {
                    PathAt::ControlGrid => path.push(b.call(&p.f, els[spec.n_fe - 1].x_end, l.u[k])),
                    PathAt::Elements => {
                        path.extend(els.iter().map(|e| b.call(&p.f, e.x_end, l.u[k])).collect::<Vec<_>>())
                    }
                    PathAt::StagePoints => {
                        for e in els {
                            path.extend(e.x.iter().map(|&x| b.call(&p.f, x, l.u[k])).collect::<Vec<_>>());
                        }
                    }
                }
            }
        }
        path_rows.truncate(path.len());
        let last = l.elements[l.elements.len() - 1].x_end;
        let u_last = l.u[spec.n_stages - 1];
        let terminal = spec.terminal.iter().map(|t| b.call(&t.f, last, u_last)).collect();
        let mayer = spec.mayer.as_ref().map(|f| b.call(f, last, u_last));
        let Builder { functions, calls, sizes } = b;
        let work = functions.iter().map(|f| f.work_len()).max().unwrap_or(0);
        let list = |p: &Pattern| -> Vec<(u32, u32)> {
            (0..p.n_cols()).flat_map(|j| p.rows(j).iter().map(move |&i| (j as u32, i as u32))).collect()
        };
        let mut f = Fesd {
            jac_cols: functions.iter().map(|f| list(f.jac_pattern())).collect(),
            hess_cols: functions.iter().map(|f| list(f.hess_pattern())).collect(),
            functions,
            calls,
            ecalls,
            ind_start,
            path,
            path_rows,
            terminal,
            mayer,
            cache: Cache {
                val: vec![0.0; sizes[0]],
                jac: vec![0.0; sizes[1]],
                hess: vec![0.0; sizes[2]],
                wgt: vec![0.0; sizes[3]],
                work: vec![0.0; work],
            },
            jac: Pattern::empty(0, 0),
            jac_map: Vec::new(),
            hess: Pattern::empty(0, 0),
            hess_map: Vec::new(),
            slope: slope_weights(&tableau.c),
            params: vec![0.0; spec.dcs.dims().p],
            duration,
            polishing: false,
            scratch: Scratch { f: vec![0.0; l.nx], local: vec![0.0; eta::n_local(l.n_cells)] },
            evaluations: 0,
            tableau,
            l,
            spec,
        };
        let w = vec![1.0; f.l.n];
        let mut rec = Recorder::default();
        let mut scratch = std::mem::take(&mut f.scratch);
        f.jacobian_entries(&w, &mut scratch.f, &mut rec);
        let (p, map) = Pattern::from_triplets(f.l.m, f.l.n, &rec.rows, &rec.cols);
        f.jac = p;
        f.jac_map = map.into_iter().map(|k| k as u32).collect();
        let y = vec![1.0; f.l.m];
        let mut rec = Recorder::default();
        f.hessian_entries(&w, 1.0, &y, &mut scratch.local, &mut rec);
        f.scratch = scratch;
        let (p, map) = Pattern::from_triplets(f.l.n, f.l.n, &rec.rows, &rec.cols);
        f.hess = p;
        f.hess_map = map.into_iter().map(|k| k as u32).collect();
        Ok(f)
    }

    /// What was discretised.
    pub fn spec(&self) -> &Spec {
        &self.spec
    }

    /// The Runge-Kutta method.
    pub fn tableau(&self) -> &Tableau {
        &self.tableau
    }

    pub(super) fn layout(&self) -> &Layout {
        &self.l
    }

    /// Length of a control stage.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Sets the length of the control stages.
    pub fn set_duration(&mut self, duration: f64) {
        self.duration = duration;
    }

    /// Sets the parameters `p[np]`.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        if p.len() != self.params.len() {
            return Err(Error::Dimension(format!("{} parameters given, the model has {}", p.len(), self.params.len())));
        }
        if let Some(i) = p.iter().position(|v| !v.is_finite()) {
            return Err(Error::Range(format!("parameter {i} is {}", p[i])));
        }
        self.params.copy_from_slice(p);
        Ok(())
    }

    /// The parameters.
    pub fn params(&self) -> &[f64] {
        &self.params
    }

    /// Evaluations of single model functions so far.
    pub fn model_evaluations(&self) -> usize {
        self.evaluations
    }

    fn h_nominal(&self) -> f64 {
        self.duration / self.spec.n_fe as f64
    }

    fn h_of(&self, e: &ElementIndex, w: &[f64]) -> f64 {
        e.h.map_or_else(|| self.h_nominal(), |j| w[j])
    }

    /// Bounds of the relaxed problem: signs of the multipliers, step sizes, rows. States, controls and the
    /// initial value are left free for the caller.
    pub fn bounds(&self) -> Bounds {
        let l = &self.l;
        let mut b = Bounds::free(l.n, l.m);
        b.cl.fill(0.0);
        b.cu.fill(0.0);
        let nonneg = |b: &mut Bounds, from: usize| b.xl[from..from + l.n_cells].fill(0.0);
        if let Some(j) = l.lambda0 {
            nonneg(&mut b, j);
        }
        for e in &l.elements {
            for i in 0..e.x.len() {
                nonneg(&mut b, e.theta[i]);
                nonneg(&mut b, e.lambda[i]);
            }
            if let Some(j) = e.lambda_end {
                nonneg(&mut b, j);
            }
            if e.row_sum_lambda.is_some() {
                nonneg(&mut b, e.sum_lambda);
            }
            if l.sums {
                nonneg(&mut b, e.sum_theta);
            }
            let slopes = e.row_slope.map_or(0..0, |r| r..r + l.n_cells);
            for i in slopes.chain(e.row_equal) {
                b.cl[i] = f64::NEG_INFINITY;
                b.cu[i] = f64::INFINITY;
            }
        }
        self.write_durations(&mut b);
        let mut rows = l.row_path.iter();
        for p in &self.spec.path {
            let n_calls = self.path.iter().filter(|c| self.same(c.f, &p.f)).count();
            for _ in 0..n_calls {
                if let Some(&r) = rows.next() {
                    b.cl[r..r + p.lower.len()].copy_from_slice(&p.lower);
                    b.cu[r..r + p.upper.len()].copy_from_slice(&p.upper);
                }
            }
        }
        for (t, &r) in self.spec.terminal.iter().zip(&l.row_terminal) {
            b.cl[r..r + t.lower.len()].copy_from_slice(&t.lower);
            b.cu[r..r + t.upper.len()].copy_from_slice(&t.upper);
        }
        b
    }

    /// Lets the multipliers that are not fixed take any sign: with an active set for every element the equations
    /// are square, and the signs show where that set is wrong. The multipliers at a given initial value follow
    /// from it: a value that is on a switching surface up to rounding would contradict `λ_{0,0} = 0`.
    pub fn free_signs(&self, b: &mut Bounds) {
        let l = &self.l;
        if let Some(lambda0) = l.lambda0 {
            // one active cell per subsystem keeps λ = 0: it says what μ is
            let mut j = lambda0;
            for sub in self.spec.dcs.subsystems() {
                let cells = j..j + sub.cells.len();
                let pinned = cells.clone().find(|&j| b.xu[j] == 0.0);
                for j in cells.filter(|&j| Some(j) != pinned) {
                    b.xl[j] = f64::NEG_INFINITY;
                    b.xu[j] = f64::INFINITY;
                }
                j += sub.cells.len();
            }
            if l.elements[0].row_sum_lambda.is_some() {
                let j = l.elements[0].sum_lambda;
                b.xu[j..j + l.n_cells].fill(f64::INFINITY);
            }
        }
        let mut free = |from: usize| {
            for j in (from..from + l.n_cells).filter(|&j| b.xu[j] != 0.0) {
                b.xl[j] = f64::NEG_INFINITY;
            }
        };
        for e in &l.elements {
            e.theta.iter().chain(&e.lambda).chain(&e.lambda_end).for_each(|&j| free(j));
            if e.row_sum_lambda.is_some() {
                free(e.sum_lambda);
            }
            if l.sums {
                free(e.sum_theta);
            }
        }
    }

    /// The first `λ` below `-tol_lambda` or `θ` below `-tol_theta` in the order of time: element, cell, and whether it is a `θ`; with the
    /// states at that point.
    ///
    /// The `θ` that ends a sliding mode according to `sides` is left out at the end of its element; those at the very end
    /// have the tolerance `tol_end`: a mode may leave there, or begin to.
    pub fn first_violation<'a>(
        &self,
        w: &'a [f64],
        sides: &[Side],
        tol_lambda: f64,
        tol_theta: f64,
        tol_end: f64,
    ) -> Option<Violation<'a>> {
        let (l, nx) = (&self.l, self.spec.dcs.dims().x);
        for (element, e) in l.elements.iter().enumerate() {
            let ends = e.lambda_end.map(|lam| (e.x_end, None, lam));
            let stages = (0..e.x.len()).map(|i| (e.x[i], Some(e.theta[i]), e.lambda[i]));
            let last = e.theta.last().copied();
            for (x, theta, lambda) in stages.chain(ends) {
                for cell in 0..l.n_cells {
                    let next = sides.get((element + 1) * l.n_cells + cell);
                    let at_end = theta == last;
                    let theta = theta.filter(|_| !at_end || next != Some(&Side::Second));
                    let tol_theta = if at_end && next.is_none() { tol_end } else { tol_theta };
                    let of_theta = theta.is_some_and(|j| w[j + cell] < -tol_theta);
                    if of_theta || w[lambda + cell] < -tol_lambda {
                        let t = self.spec.dcs.clock().map(|c| w[x + c]);
                        return Some(Violation { element, cell, of_theta, x: &w[x..x + nx], t });
                    }
                }
            }
        }
        None
    }

    /// State at the start of an element, and the time where the model has a clock.
    pub fn start_of<'a>(&self, element: usize, w: &'a [f64]) -> (&'a [f64], Option<f64>) {
        let x = self.l.elements[element].x_start;
        (&w[x..x + self.spec.dcs.dims().x], self.spec.dcs.clock().map(|c| w[x + c]))
    }

    /// Number of cells, over all subsystems.
    pub fn n_cells(&self) -> usize {
        self.l.n_cells
    }

    /// True when elements have free lengths.
    pub fn detects_switches(&self) -> bool {
        self.l.fesd
    }

    /// Rewrites the bounds that depend on the length of a control stage.
    pub fn write_durations(&self, b: &mut Bounds) {
        let (h, g) = (self.h_nominal(), self.spec.options.gamma_h);
        for e in &self.l.elements {
            if let Some(j) = e.h {
                b.xl[j] = (1.0 - g) * h;
                b.xu[j] = if self.spec.n_fe == 1 { f64::INFINITY } else { (1.0 + g) * h };
            }
        }
        for &r in &self.l.row_time {
            b.cl[r] = self.duration;
            b.cu[r] = self.duration;
        }
    }

    fn same(&self, f: usize, g: &SharedFunction) -> bool {
        std::sync::Arc::ptr_eq(&self.functions[f], g)
    }

    /// Sets bounds of all user states along the horizon, the initial value excepted.
    pub fn bound_states(&self, b: &mut Bounds, lower: &[f64], upper: &[f64]) {
        for e in &self.l.elements {
            let ends = e.row_end.map(|_| e.x_end);
            for &x in e.x.iter().chain(&ends) {
                b.xl[x..x + lower.len()].copy_from_slice(lower);
                b.xu[x..x + upper.len()].copy_from_slice(upper);
            }
        }
    }

    /// Sets bounds of the initial value; `t0` is the clock, if there is one.
    pub fn bound_initial(&self, b: &mut Bounds, lower: &[f64], upper: &[f64], t0: f64) {
        let x = self.l.x0;
        b.xl[x..x + lower.len()].copy_from_slice(lower);
        b.xu[x..x + upper.len()].copy_from_slice(upper);
        if let Some(c) = self.spec.dcs.clock() {
            b.xl[x + c] = t0;
            b.xu[x + c] = t0;
        }
    }

    /// Sets bounds of the control of stage `k`.
    pub fn bound_control(&self, b: &mut Bounds, k: usize, lower: &[f64], upper: &[f64]) {
        let u = self.l.u[k];
        b.xl[u..u + lower.len()].copy_from_slice(lower);
        b.xu[u..u + upper.len()].copy_from_slice(upper);
    }

    /// Writes a starting point: states by `x_at(t, x)` with `t` from the start of the horizon, controls by
    /// `u_at(stage, u)`, equal steps, multipliers of equal share.
    pub fn guess(
        &self,
        w: &mut [f64],
        t0: f64,
        mut x_at: impl FnMut(f64, &mut [f64]),
        mut u_at: impl FnMut(usize, &mut [f64]),
    ) {
        let l = &self.l;
        let h = self.h_nominal();
        let nx_user = self.spec.dcs.dims().x;
        w.fill(0.0);
        let mut put_x = |w: &mut [f64], at: usize, t: f64| {
            x_at(t, &mut w[at..at + nx_user]);
            if let Some(c) = self.spec.dcs.clock() {
                w[at + c] = t0 + t;
            }
        };
        put_x(w, l.x0, 0.0);
        if let Some(j) = l.lambda0 {
            w[j..j + l.n_cells].fill(LAMBDA_GUESS);
        }
        for (k, &u) in l.u.iter().enumerate() {
            u_at(k, &mut w[u..u + l.nu]);
        }
        for (i_e, e) in l.elements.iter().enumerate() {
            let t = i_e as f64 * h;
            if let Some(j) = e.h {
                w[j] = h;
            }
            for i in 0..e.x.len() {
                put_x(w, e.x[i], t + self.tableau.c[i] * h);
                self.fill_multipliers(w, e.theta[i], e.lambda[i]);
            }
            if e.row_end.is_some() {
                put_x(w, e.x_end, t + h);
            }
            if let Some(j) = e.lambda_end {
                w[j..j + l.n_cells].fill(LAMBDA_GUESS);
            }
            self.write_sums(w, e);
        }
    }

    fn fill_multipliers(&self, w: &mut [f64], theta: usize, lambda: usize) {
        let mut c0 = 0;
        for s in self.spec.dcs.subsystems() {
            let n = s.cells.len();
            w[theta + c0..theta + c0 + n].fill(1.0 / n as f64);
            c0 += n;
        }
        w[lambda..lambda + c0].fill(LAMBDA_GUESS);
    }

    /// Makes the lifted sums what they stand for.
    pub(super) fn write_sums(&self, w: &mut [f64], e: &ElementIndex) {
        for c in 0..self.l.n_cells {
            if e.row_sum_theta.is_some() {
                w[e.sum_theta + c] = e.theta.iter().map(|&j| w[j + c]).sum();
            }
            if e.row_sum_lambda.is_some() {
                let all = e.lambda_start.iter().chain(&e.lambda).chain(&e.lambda_end);
                w[e.sum_lambda + c] = all.map(|&j| w[j + c]).sum();
            }
        }
    }

    /// First indices of the initial value and of the controls of every stage.
    pub fn places(&self) -> (usize, Vec<usize>) {
        (self.l.x0, self.l.u.clone())
    }

    /// Controls of a point, `[n_stages · nu]`.
    pub fn controls(&self, w: &[f64]) -> Vec<f64> {
        self.l.u.iter().flat_map(|&u| w[u..u + self.l.nu].to_vec()).collect()
    }

    /// The user's cost at a point: Lagrange and Mayer terms, nothing that only guides the homotopy.
    pub fn cost(&mut self, w: &[f64]) -> std::result::Result<f64, EvalError> {
        self.evaluate_values(w)?;
        Ok(self.user_cost(w))
    }

    fn user_cost(&self, w: &[f64]) -> f64 {
        let mut f = 0.0;
        for (e, ec) in self.l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for (b, c) in self.tableau.b.iter().zip(&ec.lagrange) {
                f += h * b * self.cache.val[c.val];
            }
        }
        if let Some(c) = &self.mayer {
            f += self.cache.val[c.val];
        }
        f
    }

    fn soft_weight(&self) -> f64 {
        let soft = matches!(self.spec.options.equilibration, StepEquilibration::Mean | StepEquilibration::Difference);
        if self.polishing || !soft {
            0.0
        } else {
            self.spec.options.rho_h
        }
    }

    /// Pairs (step, reference) of the soft step equilibration: deviations `w[a] − w[b]` or `w[a] − h̄`.
    fn soft_terms(&self) -> impl Iterator<Item = (usize, Option<usize>)> + '_ {
        let mean = self.spec.options.equilibration == StepEquilibration::Mean;
        self.l
            .elements
            .windows(2)
            .filter_map(move |p| match (p[0].h, p[1].h) {
                (Some(a), Some(b)) if p[1].n > 0 && !mean => Some((b, Some(a))),
                _ => None,
            })
            .chain(self.l.elements.iter().filter_map(move |e| e.h.filter(|_| mean).map(|h| (h, None))))
    }

    fn point<'a>(&'a self, c: &Call, w: &'a [f64]) -> Point<'a> {
        let d = self.spec.dcs.dims();
        Point {
            t: self.spec.dcs.clock().map_or(0.0, |k| w[c.x + k]),
            x: &w[c.x..c.x + d.x],
            u: &w[c.u..c.u + d.u],
            p: &self.params,
        }
    }

    fn evaluate_values(&mut self, w: &[f64]) -> EvalResult {
        let (mut val, mut work) = (std::mem::take(&mut self.cache.val), std::mem::take(&mut self.cache.work));
        let r = self.calls.iter().try_for_each(|c| {
            let f = &self.functions[c.f];
            f.value(&self.point(c, w), &mut val[c.val..c.val + f.n_out()], &mut work)
        });
        self.evaluations += self.calls.len();
        self.cache.val = val;
        self.cache.work = work;
        r
    }

    fn evaluate_jacobians(&mut self, w: &[f64]) -> EvalResult {
        let (mut jac, mut work) = (std::mem::take(&mut self.cache.jac), std::mem::take(&mut self.cache.work));
        let r = self.calls.iter().try_for_each(|c| {
            let (f, n) = (&self.functions[c.f], self.jac_cols[c.f].len());
            if n == 0 {
                return Ok(());
            }
            f.jacobian(&self.point(c, w), &mut jac[c.jac..c.jac + n], &mut work)
        });
        self.evaluations += self.calls.len();
        self.cache.jac = jac;
        self.cache.work = work;
        r
    }

    fn evaluate_hessians(&mut self, w: &[f64]) -> EvalResult {
        let (mut hess, mut work) = (std::mem::take(&mut self.cache.hess), std::mem::take(&mut self.cache.work));
        let r = self.calls.iter().try_for_each(|c| {
            let (f, n) = (&self.functions[c.f], self.hess_cols[c.f].len());
            if n == 0 {
                return Ok(());
            }
            let weights = &self.cache.wgt[c.wgt..c.wgt + f.n_out()];
            f.hessian(&self.point(c, w), weights, &mut hess[c.hess..c.hess + n], &mut work)
        });
        self.evaluations += self.calls.len();
        self.cache.hess = hess;
        self.cache.work = work;
        r
    }

    /// Variable behind input column `col` of a call; none for parameters.
    #[inline]
    fn var(&self, c: &Call, col: u32) -> Option<usize> {
        let d = self.spec.dcs.dims();
        let col = col as usize;
        if col < d.x {
            Some(c.x + col)
        } else if col < d.x + d.u {
            Some(c.u + col - d.x)
        } else if col == d.t_col() {
            self.spec.dcs.clock().map(|k| c.x + k)
        } else {
            None
        }
    }

    /// `out[r]` = right-hand side at stage point `i` of an element.
    fn rhs(&self, e: &ElementIndex, ec: &ElementCalls, i: usize, w: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (d, c) in self.spec.dcs.drifts().iter().zip(&ec.drift[i]) {
            for (o, &r) in d.rows.iter().enumerate() {
                out[r] += self.cache.val[c.val + o];
            }
        }
        let mut theta = e.theta[i];
        for (s, c) in self.spec.dcs.subsystems().iter().zip(&ec.modes[i]) {
            let nr = s.rows.len();
            for cell in &s.cells {
                for (o, &r) in s.rows.iter().enumerate() {
                    out[r] += w[theta] * self.cache.val[c.val + cell.mode * nr + o];
                }
                theta += 1;
            }
        }
        if let Some(k) = self.spec.dcs.clock() {
            out[k] = 1.0;
        }
    }

    /// Rows `g − λ − μ e` at one point.
    fn indicator_rows(&self, calls: &[Call], row: usize, lambda: usize, mu: usize, w: &[f64], c: &mut [f64]) {
        let mut cell_index = 0;
        for (k, (s, call)) in self.spec.dcs.subsystems().iter().zip(calls).enumerate() {
            for cell in &s.cells {
                let g: f64 = cell.weights.iter().enumerate().map(|(j, v)| v * self.cache.val[call.val + j]).sum();
                c[row + cell_index] = g - w[lambda + cell_index] - w[mu + k];
                cell_index += 1;
            }
        }
    }

    fn constraint_values(&self, w: &[f64], c: &mut [f64], f: &mut [f64]) {
        let (l, t) = (&self.l, &self.tableau);
        let n_s = t.n_s;
        if let Some(lam) = l.lambda0 {
            self.indicator_rows(&self.ind_start, l.row_alg0, lam, l.mu0, w, c);
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for i in 0..n_s {
                self.rhs(e, ec, i, w, f);
                for r in 0..l.nx {
                    let xs = w[e.x_start + r];
                    if l.values_form {
                        let a_inv = t.a_inv.as_deref().unwrap_or(&[]);
                        let d: f64 = (0..n_s).map(|j| a_inv[i * n_s + j] * (w[e.x[j] + r] - xs)).sum();
                        c[e.row_dyn[i] + r] = d - h * f[r];
                    } else {
                        let d: f64 = (0..n_s).map(|j| t.a(i, j) * w[e.v[j] + r]).sum();
                        c[e.row_dyn[i] + r] = w[e.v[i] + r] - f[r];
                        c[e.row_conv[i] + r] = w[e.x[i] + r] - xs - h * d;
                    }
                }
                self.indicator_rows(&ec.ind[i], e.row_alg[i], e.lambda[i], e.mu[i], w, c);
                let mut theta = e.theta[i];
                for (k, s) in self.spec.dcs.subsystems().iter().enumerate() {
                    c[e.row_norm[i] + k] = w[theta..theta + s.cells.len()].iter().sum::<f64>() - 1.0;
                    theta += s.cells.len();
                }
            }
            if let Some(row) = e.row_end {
                for r in 0..l.nx {
                    let xs = w[e.x_start + r];
                    let step: f64 = if l.values_form {
                        (0..n_s).map(|j| self.end_weight(j) * (w[e.x[j] + r] - xs)).sum()
                    } else {
                        h * (0..n_s).map(|j| t.b[j] * w[e.v[j] + r]).sum::<f64>()
                    };
                    c[row + r] = w[e.x_end + r] - xs - step;
                }
            }
            if let Some(lam) = e.lambda_end {
                self.indicator_rows(&ec.ind_end, e.row_end_alg, lam, e.mu_end, w, c);
            }
            if let Some(row) = e.row_sum_theta {
                for k in 0..l.n_cells {
                    c[row + k] = w[e.sum_theta + k] - e.theta.iter().map(|&j| w[j + k]).sum::<f64>();
                }
            }
            if let Some(row) = e.row_sum_lambda {
                for k in 0..l.n_cells {
                    let all = e.lambda_start.iter().chain(&e.lambda).chain(&e.lambda_end);
                    c[row + k] = w[e.sum_lambda + k] - all.map(|&j| w[j + k]).sum::<f64>();
                }
            }
            if let (Some(row), Some(start)) = (e.row_slope, e.lambda_start) {
                for k in 0..l.n_cells {
                    let points = std::iter::once(&start).chain(&e.lambda);
                    c[row + k] = points.chain(&e.lambda_end).zip(&self.slope).map(|(&j, d)| d * w[j + k]).sum();
                }
            }
        }
        for (k, &row) in l.row_time.iter().enumerate() {
            let els = &l.elements[k * self.spec.n_fe..(k + 1) * self.spec.n_fe];
            c[row] = els.iter().map(|e| self.h_of(e, w)).sum();
        }
        for p in l.elements.windows(2) {
            if let Some(row) = p[1].row_equal {
                c[row] = self.h_of(&p[1], w) - self.h_of(&p[0], w);
            }
        }
        for (call, &row) in self.path.iter().zip(&self.path_rows).chain(self.terminal.iter().zip(&l.row_terminal)) {
            let n = self.functions[call.f].n_out();
            c[row..row + n].copy_from_slice(&self.cache.val[call.val..call.val + n]);
        }
    }

    fn end_weight(&self, j: usize) -> f64 {
        // b'A^{-1}
        let t = &self.tableau;
        let a_inv = t.a_inv.as_deref().unwrap_or(&[]);
        (0..t.n_s).map(|i| t.b[i] * a_inv[i * t.n_s + j]).sum()
    }

    /// Local variables of the η term between two elements.
    fn eta_vars(&self, a: &ElementIndex, b: &ElementIndex, k: usize) -> usize {
        let n = self.l.n_cells;
        match (k / n.max(1), k % n.max(1)) {
            (0, i) => a.sum_lambda + i,
            (1, i) => b.sum_lambda + i,
            (2, i) => a.sum_theta + i,
            (3, i) => b.sum_theta + i,
            (_, i) => if i == 0 { a.h } else { b.h }.unwrap_or(0),
        }
    }

    /// Neighbouring elements of one control stage with an η term between them.
    fn eta_pairs(&self) -> impl Iterator<Item = (&ElementIndex, &ElementIndex)> {
        let on = self.l.eta;
        self.l.elements.windows(2).filter(move |p| on && p[1].n > 0).map(|p| (&p[0], &p[1]))
    }

    fn eta_weight(&self) -> f64 {
        if self.polishing {
            0.0
        } else {
            self.spec.options.rho_h
        }
    }

    fn eta_value(&self, w: &[f64], local: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        for (a, b) in self.eta_pairs() {
            self.load_eta(a, b, w, local);
            sum += eta::value(self.l.n_cells, local);
        }
        self.eta_weight() * sum
    }

    fn load_eta(&self, a: &ElementIndex, b: &ElementIndex, w: &[f64], out: &mut [f64]) {
        for (k, o) in out.iter_mut().enumerate() {
            *o = w[self.eta_vars(a, b, k)];
        }
    }

    fn indicator_jac<S: Sink>(&self, calls: &[Call], row: usize, lambda: usize, mu: usize, s: &mut S) {
        let mut first = 0;
        for (k, (sub, call)) in self.spec.dcs.subsystems().iter().zip(calls).enumerate() {
            for (p, &(col, o)) in self.jac_cols[call.f].iter().enumerate() {
                if let Some(v) = self.var(call, col) {
                    for (c, cell) in sub.cells.iter().enumerate() {
                        let weight = cell.weights[o as usize];
                        if weight != 0.0 {
                            s.add(row + first + c, v, weight * self.cache.jac[call.jac + p]);
                        }
                    }
                }
            }
            for c in 0..sub.cells.len() {
                s.add(row + first + c, lambda + first + c, -1.0);
                s.add(row + first + c, mu + k, -1.0);
            }
            first += sub.cells.len();
        }
    }

    /// Writes all Jacobian entries in a fixed order.
    fn jacobian_entries<S: Sink>(&self, w: &[f64], f: &mut [f64], s: &mut S) {
        let (l, t) = (&self.l, &self.tableau);
        let n_s = t.n_s;
        if let Some(lam) = l.lambda0 {
            self.indicator_jac(&self.ind_start, l.row_alg0, lam, l.mu0, s);
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for i in 0..n_s {
                let row = e.row_dyn[i];
                // coefficient of the right-hand side in these rows
                let coef = if l.values_form { -h } else { -1.0 };
                self.rhs_jac(e, ec, i, row, coef, w, s);
                if l.values_form {
                    if let Some(hv) = e.h {
                        self.rhs(e, ec, i, w, f);
                        for r in 0..l.nx {
                            s.add(row + r, hv, -f[r]);
                        }
                    }
                    let a_inv = t.a_inv.as_deref().unwrap_or(&[]);
                    for r in 0..l.nx {
                        let mut sum = 0.0;
                        for j in 0..n_s {
                            s.add(row + r, e.x[j] + r, a_inv[i * n_s + j]);
                            sum += a_inv[i * n_s + j];
                        }
                        s.add(row + r, e.x_start + r, -sum);
                    }
                } else {
                    for r in 0..l.nx {
                        s.add(row + r, e.v[i] + r, 1.0);
                        let conv = e.row_conv[i] + r;
                        s.add(conv, e.x[i] + r, 1.0);
                        s.add(conv, e.x_start + r, -1.0);
                        let mut sum = 0.0;
                        for j in 0..n_s {
                            if t.a(i, j) != 0.0 {
                                s.add(conv, e.v[j] + r, -h * t.a(i, j));
                                sum += t.a(i, j) * w[e.v[j] + r];
                            }
                        }
                        if let Some(hv) = e.h {
                            s.add(conv, hv, -sum);
                        }
                    }
                }
                self.indicator_jac(&ec.ind[i], e.row_alg[i], e.lambda[i], e.mu[i], s);
                let mut theta = e.theta[i];
                for (k, sub) in self.spec.dcs.subsystems().iter().enumerate() {
                    for _ in &sub.cells {
                        s.add(e.row_norm[i] + k, theta, 1.0);
                        theta += 1;
                    }
                }
            }
            if let Some(row) = e.row_end {
                for r in 0..l.nx {
                    s.add(row + r, e.x_end + r, 1.0);
                    let mut sum = 0.0;
                    for j in 0..n_s {
                        if l.values_form {
                            let d = self.end_weight(j);
                            s.add(row + r, e.x[j] + r, -d);
                            sum += d;
                        } else {
                            s.add(row + r, e.v[j] + r, -h * t.b[j]);
                            sum += t.b[j] * w[e.v[j] + r];
                        }
                    }
                    if l.values_form {
                        s.add(row + r, e.x_start + r, sum - 1.0);
                    } else {
                        s.add(row + r, e.x_start + r, -1.0);
                        if let Some(hv) = e.h {
                            s.add(row + r, hv, -sum);
                        }
                    }
                }
            }
            if let Some(lam) = e.lambda_end {
                self.indicator_jac(&ec.ind_end, e.row_end_alg, lam, e.mu_end, s);
            }
            for c in 0..l.n_cells {
                if let Some(row) = e.row_sum_theta {
                    s.add(row + c, e.sum_theta + c, 1.0);
                    for &j in &e.theta {
                        s.add(row + c, j + c, -1.0);
                    }
                }
                if let Some(row) = e.row_sum_lambda {
                    s.add(row + c, e.sum_lambda + c, 1.0);
                    for &j in e.lambda_start.iter().chain(&e.lambda).chain(&e.lambda_end) {
                        s.add(row + c, j + c, -1.0);
                    }
                }
                if let (Some(row), Some(start)) = (e.row_slope, e.lambda_start) {
                    for (&j, &d) in std::iter::once(&start).chain(&e.lambda).chain(&e.lambda_end).zip(&self.slope) {
                        if d != 0.0 {
                            s.add(row + c, j + c, d);
                        }
                    }
                }
            }
        }
        for e in &l.elements {
            if let Some(hv) = e.h {
                s.add(l.row_time[e.stage], hv, 1.0);
            }
        }
        for p in l.elements.windows(2) {
            if let (Some(row), Some(a), Some(b)) = (p[1].row_equal, p[0].h, p[1].h) {
                s.add(row, b, 1.0);
                s.add(row, a, -1.0);
            }
        }
        for (call, &row) in self.path.iter().zip(&self.path_rows).chain(self.terminal.iter().zip(&l.row_terminal)) {
            for (p, &(col, o)) in self.jac_cols[call.f].iter().enumerate() {
                if let Some(v) = self.var(call, col) {
                    s.add(row + o as usize, v, self.cache.jac[call.jac + p]);
                }
            }
        }
    }

    /// Derivatives of `coef · f` at a stage point with respect to its inputs and `θ`.
    #[allow(clippy::too_many_arguments)]
    fn rhs_jac<S: Sink>(
        &self,
        e: &ElementIndex,
        ec: &ElementCalls,
        i: usize,
        row: usize,
        coef: f64,
        w: &[f64],
        s: &mut S,
    ) {
        for (d, c) in self.spec.dcs.drifts().iter().zip(&ec.drift[i]) {
            for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                if let Some(v) = self.var(c, col) {
                    s.add(row + d.rows[o as usize], v, coef * self.cache.jac[c.jac + p]);
                }
            }
        }
        let mut first = e.theta[i];
        for (sub, c) in self.spec.dcs.subsystems().iter().zip(&ec.modes[i]) {
            let nr = sub.rows.len();
            for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                if let Some(v) = self.var(c, col) {
                    let (mode, r) = (o as usize / nr, o as usize % nr);
                    let theta = self.mode_weight(sub, first, mode, w);
                    s.add(row + sub.rows[r], v, coef * theta * self.cache.jac[c.jac + p]);
                }
            }
            for (k, cell) in sub.cells.iter().enumerate() {
                for (o, &r) in sub.rows.iter().enumerate() {
                    s.add(row + r, first + k, coef * self.cache.val[c.val + cell.mode * nr + o]);
                }
            }
            first += sub.cells.len();
        }
    }

    /// Σ θ over the cells of a mode.
    #[inline]
    fn mode_weight(&self, sub: &crate::dcs::Stewart, theta: usize, mode: usize, w: &[f64]) -> f64 {
        sub.cells.iter().enumerate().filter(|(_, c)| c.mode == mode).map(|(k, _)| w[theta + k]).sum()
    }

    /// Weights with which the Hessian of every call enters.
    fn hessian_weights(&mut self, w: &[f64], obj: f64, y: &[f64]) {
        let mut wgt = std::mem::take(&mut self.cache.wgt);
        wgt.fill(0.0);
        let l = &self.l;
        let indicator = |wgt: &mut [f64], calls: &[Call], row: usize| {
            let mut k = row;
            for (sub, c) in self.spec.dcs.subsystems().iter().zip(calls) {
                for cell in &sub.cells {
                    for (j, v) in cell.weights.iter().enumerate() {
                        wgt[c.wgt + j] += y[k] * v;
                    }
                    k += 1;
                }
            }
        };
        if l.lambda0.is_some() {
            indicator(&mut wgt, &self.ind_start, l.row_alg0);
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            let coef = if l.values_form { -h } else { -1.0 };
            for i in 0..self.tableau.n_s {
                let row = e.row_dyn[i];
                for (d, c) in self.spec.dcs.drifts().iter().zip(&ec.drift[i]) {
                    for (o, &r) in d.rows.iter().enumerate() {
                        wgt[c.wgt + o] += coef * y[row + r];
                    }
                }
                let mut theta = e.theta[i];
                for (sub, c) in self.spec.dcs.subsystems().iter().zip(&ec.modes[i]) {
                    let nr = sub.rows.len();
                    for cell in &sub.cells {
                        for (o, &r) in sub.rows.iter().enumerate() {
                            wgt[c.wgt + cell.mode * nr + o] += coef * y[row + r] * w[theta];
                        }
                        theta += 1;
                    }
                }
                indicator(&mut wgt, &ec.ind[i], e.row_alg[i]);
                if let Some(c) = ec.lagrange.get(i) {
                    wgt[c.wgt] += obj * h * self.tableau.b[i];
                }
            }
            if e.lambda_end.is_some() {
                indicator(&mut wgt, &ec.ind_end, e.row_end_alg);
            }
        }
        for (call, &row) in self.path.iter().zip(&self.path_rows).chain(self.terminal.iter().zip(&l.row_terminal)) {
            for o in 0..self.functions[call.f].n_out() {
                wgt[call.wgt + o] += y[row + o];
            }
        }
        if let Some(c) = &self.mayer {
            wgt[c.wgt] += obj;
        }
        self.cache.wgt = wgt;
    }

    /// Writes all Hessian entries in a fixed order; the Hessians of the calls are in the cache.
    fn hessian_entries<S: Sink>(&self, w: &[f64], obj: f64, y: &[f64], local: &mut [f64], s: &mut S) {
        let (l, t) = (&self.l, &self.tableau);
        let n_s = t.n_s;
        for c in &self.calls {
            for (p, &(col, row)) in self.hess_cols[c.f].iter().enumerate() {
                if let (Some(a), Some(b)) = (self.var(c, row), self.var(c, col)) {
                    add_sym(s, a, b, self.cache.hess[c.hess + p]);
                }
            }
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            let coef = if l.values_form { -h } else { -1.0 };
            for i in 0..n_s {
                let row = e.row_dyn[i];
                let hv = e.h.filter(|_| l.values_form);
                for (d, c) in self.spec.dcs.drifts().iter().zip(&ec.drift[i]) {
                    if let Some(hv) = hv {
                        for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                            if let Some(v) = self.var(c, col) {
                                add_sym(s, v, hv, -y[row + d.rows[o as usize]] * self.cache.jac[c.jac + p]);
                            }
                        }
                    }
                }
                let mut first = e.theta[i];
                for (sub, c) in self.spec.dcs.subsystems().iter().zip(&ec.modes[i]) {
                    let nr = sub.rows.len();
                    for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                        let Some(v) = self.var(c, col) else { continue };
                        let (mode, r) = (o as usize / nr, o as usize % nr);
                        let yj = y[row + sub.rows[r]] * self.cache.jac[c.jac + p];
                        for (k, _) in sub.cells.iter().enumerate().filter(|(_, cell)| cell.mode == mode) {
                            add_sym(s, v, first + k, coef * yj);
                        }
                        if let Some(hv) = hv {
                            add_sym(s, v, hv, -self.mode_weight(sub, first, mode, w) * yj);
                        }
                    }
                    if let Some(hv) = hv {
                        for (k, cell) in sub.cells.iter().enumerate() {
                            let f: f64 = sub
                                .rows
                                .iter()
                                .enumerate()
                                .map(|(o, &r)| y[row + r] * self.cache.val[c.val + cell.mode * nr + o])
                                .sum();
                            add_sym(s, first + k, hv, -f);
                        }
                    }
                    first += sub.cells.len();
                }
                if let (false, Some(hv)) = (l.values_form, e.h) {
                    for j in 0..n_s {
                        if t.a(i, j) != 0.0 {
                            for r in 0..l.nx {
                                add_sym(s, e.v[j] + r, hv, -y[e.row_conv[i] + r] * t.a(i, j));
                            }
                        }
                    }
                }
                if let (Some(c), Some(hv)) = (ec.lagrange.get(i), e.h) {
                    for (p, &(col, _)) in self.jac_cols[c.f].iter().enumerate() {
                        if let Some(v) = self.var(c, col) {
                            add_sym(s, v, hv, obj * t.b[i] * self.cache.jac[c.jac + p]);
                        }
                    }
                }
            }
            if let (Some(row), false, Some(hv)) = (e.row_end, l.values_form, e.h) {
                for j in 0..n_s {
                    for r in 0..l.nx {
                        add_sym(s, e.v[j] + r, hv, -y[row + r] * t.b[j]);
                    }
                }
            }
        }
        let rho = 2.0 * obj * self.soft_weight();
        for (a, b) in self.soft_terms() {
            add_sym(s, a, a, rho);
            if let Some(b) = b {
                add_sym(s, b, b, rho);
                add_sym(s, a, b, -rho);
            }
        }
        let weight = obj * self.eta_weight();
        for (a, b) in self.eta_pairs() {
            self.load_eta(a, b, w, local);
            for k in 0..local.len() {
                for j in 0..=k {
                    let v = if weight == 0.0 { 0.0 } else { weight * eta::hessian(l.n_cells, local, j, k) };
                    add_sym(s, self.eta_vars(a, b, j), self.eta_vars(a, b, k), v);
                }
            }
        }
    }
}

/// Weights of `λ` at the start, the stage points and the end of an element in its slope at the start: the derivative
/// at 0 of the polynomial through the start and the stage points. An explicit method knows the slope from the first
/// point its first stage leads to.
fn slope_weights(c: &[f64]) -> Vec<f64> {
    if c[0] == 0.0 {
        let mut w = vec![0.0; c.len() + 2];
        let (first, at) = c.iter().enumerate().find(|(_, &c)| c > 0.0).map_or((c.len(), 1.0), |(i, &c)| (i, c));
        w[0] = -1.0 / at;
        w[first + 1] = 1.0 / at;
        return w;
    }
    let nodes: Vec<f64> = std::iter::once(0.0).chain(c.iter().copied()).collect();
    let others = |j: usize| nodes.iter().enumerate().filter(move |&(k, _)| k != j).map(|(_, v)| *v);
    (0..nodes.len())
        .map(|j| match j {
            0 => -others(0).map(|v| 1.0 / v).sum::<f64>(),
            _ => {
                let inner: f64 = others(j).filter(|&v| v != 0.0).map(|v| -v / (nodes[j] - v)).product();
                inner / nodes[j]
            }
        })
        .collect()
}

/// First guess of the multipliers `λ`.
const LAMBDA_GUESS: f64 = 0.5;

/// Collects functions and calls.
struct Builder {
    functions: Vec<SharedFunction>,
    calls: Vec<Call>,
    /// Lengths of values, Jacobians, Hessians, weights.
    sizes: [usize; 4],
}

impl Builder {
    fn call(&mut self, f: &SharedFunction, x: usize, u: usize) -> Call {
        let index = self.functions.iter().position(|g| std::sync::Arc::ptr_eq(f, g)).unwrap_or_else(|| {
            self.functions.push(f.clone());
            self.functions.len() - 1
        });
        let [val, jac, hess, wgt] = self.sizes;
        let c = Call { f: index, x, u, val, jac, hess, wgt };
        let add = [f.n_out(), f.jac_pattern().nnz(), f.hess_pattern().nnz(), f.n_out()];
        for (s, a) in self.sizes.iter_mut().zip(add) {
            *s += a;
        }
        self.calls.push(c);
        c
    }
}

impl Nlp for Fesd {
    fn n(&self) -> usize {
        self.l.n
    }
    fn m(&self) -> usize {
        self.l.m
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }

    fn eval(&mut self, w: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        self.evaluate_values(w)?;
        let mut scratch = std::mem::take(&mut self.scratch);
        self.constraint_values(w, c, &mut scratch.f);
        let eta = self.eta_value(w, &mut scratch.local);
        self.scratch = scratch;
        let rho = self.soft_weight();
        let h = self.h_nominal();
        let soft: f64 = self.soft_terms().map(|(a, b)| (w[a] - b.map_or(h, |b| w[b])).powi(2)).sum();
        Ok(self.user_cost(w) + rho * soft + eta)
    }

    fn derivatives(&mut self, w: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        self.evaluate_jacobians(w)?;
        grad.fill(0.0);
        for (e, ec) in self.l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for (b, c) in self.tableau.b.iter().zip(&ec.lagrange) {
                for (p, &(col, _)) in self.jac_cols[c.f].iter().enumerate() {
                    if let Some(v) = self.var(c, col) {
                        grad[v] += h * b * self.cache.jac[c.jac + p];
                    }
                }
                if let Some(hv) = e.h {
                    grad[hv] += b * self.cache.val[c.val];
                }
            }
        }
        if let Some(c) = &self.mayer {
            for (p, &(col, _)) in self.jac_cols[c.f].iter().enumerate() {
                if let Some(v) = self.var(c, col) {
                    grad[v] += self.cache.jac[c.jac + p];
                }
            }
        }
        let (rho, h) = (2.0 * self.soft_weight(), self.h_nominal());
        for (a, b) in self.soft_terms() {
            let d = rho * (w[a] - b.map_or(h, |b| w[b]));
            grad[a] += d;
            if let Some(b) = b {
                grad[b] -= d;
            }
        }
        jac.fill(0.0);
        let map = std::mem::take(&mut self.jac_map);
        let mut scratch = std::mem::take(&mut self.scratch);
        let weight = self.eta_weight();
        for (a, b) in self.eta_pairs() {
            self.load_eta(a, b, w, &mut scratch.local);
            for k in 0..scratch.local.len() {
                grad[self.eta_vars(a, b, k)] += weight * eta::gradient(self.l.n_cells, &scratch.local, k);
            }
        }
        self.jacobian_entries(w, &mut scratch.f, &mut Writer { map: &map, k: 0, values: jac });
        self.jac_map = map;
        self.scratch = scratch;
        Ok(())
    }

    fn hessian(&mut self, w: &[f64], obj: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        self.hessian_weights(w, obj, y);
        self.evaluate_hessians(w)?;
        hess.fill(0.0);
        let map = std::mem::take(&mut self.hess_map);
        let mut scratch = std::mem::take(&mut self.scratch);
        self.hessian_entries(w, obj, y, &mut scratch.local, &mut Writer { map: &map, k: 0, values: hess });
        self.hess_map = map;
        self.scratch = scratch;
        Ok(())
    }
}

impl Mpcc for Fesd {
    fn pairs(&self) -> &[(usize, usize)] {
        &self.l.pairs
    }
    fn n_groups(&self) -> usize {
        self.l.n_groups
    }
    fn group(&self, pair: usize) -> usize {
        self.l.groups[pair]
    }
    fn set_polishing(&mut self, on: bool) {
        self.polishing = on;
    }

    /// The active set of every element is `sides`: `λ`, or `θ`, is zero at all its points. Where it does not
    /// change, neighbouring steps are equal. Where components only leave it, a sliding mode ends: the first of them
    /// leaves with `λ̇ = 0`, which is `θ = 0` up to the error of the method but, unlike that, never lets `λ` fall below
    /// zero afterwards. At the start of a control stage, where `θ` may jump with the control, it is `λ̇ ≥ 0`.
    fn branch(&self, sides: &[Side], b: &mut Bounds) {
        let l = &self.l;
        let fix = |b: &mut Bounds, j: usize| {
            b.xl[j] = 0.0;
            b.xu[j] = 0.0;
        };
        if !l.fesd {
            for (k, &(lam, theta)) in l.pairs.iter().enumerate() {
                fix(b, if sides[l.groups[k]] == Side::First { lam } else { theta });
            }
            return;
        }
        let n = l.n_cells;
        for (i_e, e) in l.elements.iter().enumerate() {
            // equal steps need no bound, and one would stop a switch on its way to the optimum
            if let Some(h) = e.h.filter(|_| self.spec.options.gamma_h >= 1.0) {
                b.xu[h] = f64::INFINITY;
            }
            let active = |c: usize| sides[i_e * n + c] == Side::First;
            for c in 0..n {
                if active(c) {
                    for &j in e.lambda_start.iter().chain(&e.lambda).chain(&e.lambda_end) {
                        fix(b, j + c);
                    }
                    if e.row_sum_lambda.is_some() {
                        fix(b, e.sum_lambda + c);
                    }
                } else {
                    for &j in &e.theta {
                        fix(b, j + c);
                    }
                    if l.sums {
                        fix(b, e.sum_theta + c);
                    }
                }
            }
            if i_e == 0 {
                continue;
            }
            let before = |c: usize| sides[(i_e - 1) * n + c] == Side::First;
            if let Some(row) = e.row_slope {
                for c in (0..n).filter(|&c| before(c) && !active(c)) {
                    b.cl[row + c] = 0.0;
                }
            }
            let Some(row) = e.row_equal else { continue };
            let enters = (0..n).any(|c| active(c) && !before(c));
            let leaves = (0..n).find(|&c| before(c) && !active(c));
            match (enters, leaves) {
                (false, None) => {
                    b.cl[row] = 0.0;
                    b.cu[row] = 0.0;
                }
                (false, Some(c)) => {
                    let last = l.elements[i_e - 1].theta[self.tableau.n_s - 1] + c;
                    if let Some(slope) = e.row_slope {
                        b.cu[slope + c] = 0.0;
                        b.xl[last] = f64::NEG_INFINITY;
                    }
                }
                (true, _) => {}
            }
        }
    }
}
