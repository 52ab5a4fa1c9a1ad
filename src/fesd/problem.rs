//! The discretised problem: evaluation of the model at all points, cost, starting point, and the interface to the solver.
//!
//! Model functions are evaluated once per point into a cache; everything else reads from there.

use super::assemble::{slope_weights, Recorder, Writer};
use super::branch::Exit;
use super::eta;
use super::layout::{ElementIndex, Layout, PathAt, Spec};
use crate::error::{Error, Result};
use crate::func::{EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::nlp::Nlp;
use crate::settings::StepEquilibration;
use crate::system::SharedFunction;
use crate::tableau::Tableau;

/// A function at a point of the grid, and where its values lie in the cache.
#[derive(Debug, Clone, Copy)]
pub(super) struct Call {
    pub(super) f: usize,
    pub(super) x: usize,
    pub(super) u: usize,
    pub(super) val: usize,
    pub(super) jac: usize,
    pub(super) hess: usize,
    /// Weights of the Hessian.
    pub(super) wgt: usize,
}

/// Calls of one element.
#[derive(Debug, Clone, Default)]
pub(super) struct ElementCalls {
    /// Per stage point, per drift.
    pub(super) drift: Vec<Vec<Call>>,
    /// Per stage point, per subsystem.
    pub(super) modes: Vec<Vec<Call>>,
    pub(super) ind: Vec<Vec<Call>>,
    pub(super) ind_end: Vec<Call>,
    pub(super) lagrange: Vec<Call>,
}

/// Buffers of the traversals, taken out of the problem while it is read.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// Right-hand side at a point.
    pub(super) f: Vec<f64>,
    /// Local variables of an η term.
    pub(super) local: Vec<f64>,
}

/// Values of all functions at all points.
#[derive(Debug, Clone, Default)]
pub(super) struct Cache {
    pub(super) val: Vec<f64>,
    pub(super) jac: Vec<f64>,
    pub(super) hess: Vec<f64>,
    pub(super) wgt: Vec<f64>,
    pub(super) work: Vec<f64>,
}

/// The discretised problem.
pub struct Fesd {
    pub(super) spec: Spec,
    pub(super) tableau: Tableau,
    pub(super) l: Layout,
    pub(super) functions: Vec<SharedFunction>,
    /// Column patterns of the functions as (column, row) lists, in CSC order.
    pub(super) jac_cols: Vec<Vec<(u32, u32)>>,
    pub(super) hess_cols: Vec<Vec<(u32, u32)>>,
    pub(super) calls: Vec<Call>,
    pub(super) ecalls: Vec<ElementCalls>,
    pub(super) ind_start: Vec<Call>,
    pub(super) path: Vec<Call>,
    /// First path row of each path call.
    pub(super) path_rows: Vec<usize>,
    pub(super) terminal: Vec<Call>,
    pub(super) mayer: Option<Call>,
    pub(super) cache: Cache,
    pub(super) jac: Pattern,
    pub(super) jac_map: Vec<u32>,
    pub(super) hess: Pattern,
    pub(super) hess_map: Vec<u32>,
    /// Derivative at 0 of the polynomial through the values at 0 and at the nodes.
    pub(super) slope: Vec<f64>,
    pub(super) params: Vec<f64>,
    /// Length of a control stage.
    pub(super) duration: f64,
    pub(super) polishing: bool,
    pub(super) exit: Exit,
    /// Weights of the stage values in the value at the end of an element.
    pub(super) end_weights: Vec<f64>,
    pub(super) scratch: Scratch,
    pub(super) evaluations: usize,
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
            exit: Exit::Slope,
            end_weights: tableau.boundary_weights().unwrap_or_default(),
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

    pub(super) fn h_nominal(&self) -> f64 {
        self.duration / self.spec.n_fe as f64
    }

    pub(super) fn h_of(&self, e: &ElementIndex, w: &[f64]) -> f64 {
        e.h.map_or_else(|| self.h_nominal(), |j| w[j])
    }

    /// Number of cells, over all subsystems.
    pub fn n_cells(&self) -> usize {
        self.l.n_cells
    }

    /// True when elements have free lengths.
    pub fn detects_switches(&self) -> bool {
        self.l.fesd
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

    pub(super) fn fill_multipliers(&self, w: &mut [f64], theta: usize, lambda: usize) {
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

    /// The variables that are lengths of elements, in the order of time; none on a fixed grid.
    pub fn lengths(&self) -> Vec<Option<usize>> {
        self.l.elements.iter().map(|e| e.h).collect()
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

    pub(super) fn user_cost(&self, w: &[f64]) -> f64 {
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

    pub(super) fn soft_weight(&self) -> f64 {
        let soft = matches!(self.spec.options.equilibration, StepEquilibration::Mean | StepEquilibration::Difference);
        if self.polishing || !soft {
            0.0
        } else {
            self.spec.options.rho_h
        }
    }

    /// Pairs (step, reference) of the soft step equilibration: deviations `w[a] − w[b]` or `w[a] − h̄`.
    pub(super) fn soft_terms(&self) -> impl Iterator<Item = (usize, Option<usize>)> + '_ {
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

    pub(super) fn point<'a>(&'a self, c: &Call, w: &'a [f64]) -> Point<'a> {
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
