//! The discretised problem: evaluation of the model at all points, cost, starting point, and the interface to the solver.
//!
//! Model functions are evaluated once per point into a cache; everything else reads from there.

use super::assemble::{first_weights, slope_weights, Recorder, Writer};
use super::branch::Exit;
use super::calls::Builder;
pub(super) use super::calls::Call;
use super::clearance::Clearance;
use super::eta;
use super::inside::Nodes;
use super::layout::{Durations, ElementIndex, Layout, PathAt, Spec, StartIndex};
use super::places::{Note, Part};
use super::size;
use crate::error::{finite, Error, Result};
use crate::func::{EvalError, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;
use crate::nlp::Nlp;
use crate::settings::StepEquilibration;
use crate::stop;
use crate::system::SharedFunction;
use crate::tableau::Tableau;

/// Calls of one element.
#[derive(Debug, Clone, Default)]
pub(super) struct ElementCalls {
    /// Per stage point, per drift; the combined right-hand side alone where there is one.
    pub(super) drift: Vec<Vec<Call>>,
    /// Per stage point, per term; none with a combined right-hand side.
    pub(super) modes: Vec<Vec<Call>>,
    /// Per stage point, per inclusion.
    pub(super) included: Vec<Vec<Call>>,
    /// Per stage point, per source of indicators.
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
    /// Inputs of the call at hand.
    pub(super) point: Vec<f64>,
    /// The last function without a value.
    pub(super) note: Note,
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
    /// For every column `(x, u, p, t)` at every point: a variable, or behind the variables a constant.
    pub(super) inputs: Vec<u32>,
    /// Parameters of every stage, then a zero.
    pub(super) constants: Vec<f64>,
    pub(super) ecalls: Vec<ElementCalls>,
    pub(super) ind_start: Vec<Vec<Call>>,
    pub(super) drift_start: Vec<Call>,
    pub(super) path: Vec<Call>,
    /// First path row of each path call.
    pub(super) path_rows: Vec<usize>,
    pub(super) terminal: Vec<Call>,
    pub(super) boundary: Vec<Call>,
    /// Path complementarities.
    pub(super) complementarity: Vec<Call>,
    /// Costs at points: at the end, and at the ends of the stages.
    pub(super) mayer: Vec<Call>,
    pub(super) cache: Cache,
    pub(super) jac: Pattern,
    pub(super) jac_map: Vec<u32>,
    pub(super) hess: Pattern,
    pub(super) hess_map: Vec<u32>,
    /// Derivative at 0 of the polynomial through the values at 0 and at the nodes.
    pub(super) slope: Vec<f64>,
    /// Weights of the values at the stage points in the first less the polynomial through the others.
    pub(super) first: Vec<f64>,
    /// Weights of the values at the stage points in the polynomial through them at the end.
    pub(super) last: Vec<f64>,
    pub(super) params: Vec<f64>,
    /// Lengths of the control stages; to start from where they are variables.
    pub(super) durations: Vec<f64>,
    pub(super) polishing: bool,
    pub(super) exit: Exit,
    /// What branch problems keep clear of.
    pub(super) clearance: Option<Clearance>,
    /// Weights of the stage values in the value at the end of an element.
    pub(super) end_weights: Vec<f64>,
    pub(super) scratch: Scratch,
    pub(super) evaluations: usize,
    /// Sizes of the variables; empty: all 1.
    pub(super) sizes: Vec<f64>,
    /// What the weights of the penalties on step sizes are multiples of.
    pub(super) guidance_unit: f64,
}

impl Fesd {
    /// Discretises `spec`; `duration` is the length of every control stage.
    pub fn new(spec: Spec, duration: f64) -> Result<Fesd> {
        let tableau = Tableau::new(spec.options.family, spec.options.n_s)?;
        size::check(&spec)?;
        let l = Layout::new(&spec, &tableau)?;
        let mut b = Builder::new(&spec, &l);
        let form = spec.dcs.form();
        let mut ecalls = Vec::with_capacity(l.elements.len());
        let mut ind_start = Vec::new();
        for s in &l.starts {
            let e = &l.elements[s.element];
            let at = b.point(e.x_start, e.stage);
            ind_start.push(form.sources.iter().map(|f| b.call(f, at)).collect());
        }
        let mut drift_start = Vec::new();
        if l.row_z0.is_some() {
            let at = b.point(l.x0, 0);
            drift_start = spec.dcs.drifts().iter().map(|d| b.call(&d.f, at)).collect();
        }
        for e in &l.elements {
            let mut ec = ElementCalls::default();
            for (&x, &theta) in e.x.iter().zip(&e.theta) {
                let at = b.point(x, e.stage);
                match spec.dcs.combined() {
                    Some(c) => {
                        let at = b.point_with(x, c.alpha.iter().map(|a| theta + a), e.stage);
                        ec.drift.push(vec![b.call(&c.f, at)]);
                        ec.modes.push(Vec::new());
                    }
                    None => {
                        ec.drift.push(spec.dcs.drifts().iter().map(|d| b.call(&d.f, at)).collect());
                        ec.modes.push(form.terms.iter().map(|t| b.call(&t.modes, at)).collect());
                    }
                }
                ec.ind.push(form.sources.iter().map(|f| b.call(f, at)).collect());
                if let Some(f) = &spec.lagrange {
                    ec.lagrange.push(b.call(f, at));
                }
                let included = form.inclusions.iter().map(|i| {
                    let at = b.point_with(x, i.alpha.iter().map(|a| theta + a), e.stage);
                    b.call(&i.f, at)
                });
                ec.included.push(included.collect());
            }
            if e.lambda_end.is_some() {
                let at = b.point(e.x_end, e.stage);
                ec.ind_end = form.sources.iter().map(|f| b.call(f, at)).collect();
            }
            ecalls.push(ec);
        }
        let mut path = Vec::new();
        for p in &spec.path {
            for k in 0..spec.n_stages() {
                let els = l.stage(k);
                let mut points = vec![els[0].x_start];
                match p.at {
                    PathAt::ControlGrid => points.push(els[els.len() - 1].x_end),
                    PathAt::Elements => points.extend(els.iter().map(|e| e.x_end)),
                    PathAt::StagePoints => points.extend(els.iter().flat_map(|e| &e.x)),
                }
                for x in points {
                    let at = b.point(x, k);
                    path.push(b.call(&p.f, at));
                }
            }
        }
        for i in &spec.inside {
            let e = &l.elements[i.element];
            let nodes = Nodes::new(e, &tableau, i.share);
            let at = b.points(&nodes.at, e.stage);
            path.push(b.call(&nodes.function(&spec.path[i.path].f, &spec, &l), at));
        }
        let path_rows = l.row_path.clone();
        let last = &l.elements[l.elements.len() - 1];
        let end = b.point(last.x_end, last.stage);
        let terminal = spec.terminal.iter().map(|t| b.call(&t.f, end)).collect();
        let mut mayer: Vec<Call> = spec.mayer.iter().map(|f| b.call(f, end)).collect();
        if let Some(f) = &spec.grid_cost {
            for k in 0..spec.n_stages() {
                let els = l.stage(k);
                let at = b.point(els[els.len() - 1].x_end, k);
                mayer.push(b.call(f, at));
            }
        }
        let both = b.ends(l.x0, last.x_end, last.stage);
        let boundary = spec.boundary.iter().map(|c| b.call(&c.f, both)).collect();
        let mut complementarity = Vec::new();
        for p in &spec.complementarity {
            for k in 0..spec.n_stages() {
                let els = l.stage(k);
                let points: Vec<usize> = match p.at {
                    PathAt::ControlGrid => vec![els[els.len() - 1].x_end],
                    PathAt::Elements => els.iter().map(|e| e.x_end).collect(),
                    PathAt::StagePoints => els.iter().flat_map(|e| e.x.iter().copied()).collect(),
                };
                for x in points {
                    let at = b.point(x, k);
                    complementarity.push(b.call(&p.f, at));
                }
            }
        }
        let Builder { functions, calls, sizes, inputs, .. } = b;
        let longest = functions.iter().map(|f| f.dims().t_col() + 1).max().unwrap_or(0);
        let n_params = spec.dcs.dims().p;
        let work = functions.iter().map(|f| f.work_len()).max().unwrap_or(0);
        let list = |p: &Pattern| -> Vec<(u32, u32)> {
            (0..p.n_cols()).flat_map(|j| p.rows(j).iter().map(move |&i| (j as u32, i as u32))).collect()
        };
        let mut last = vec![0.0; tableau.n_s];
        tableau.interpolation_weights(1.0, &mut last);
        let mut f = Fesd {
            jac_cols: functions.iter().map(|f| list(f.jac_pattern())).collect(),
            hess_cols: functions.iter().map(|f| list(f.hess_pattern())).collect(),
            functions,
            calls,
            inputs,
            constants: vec![0.0; spec.n_stages() * n_params + 1],
            ecalls,
            ind_start,
            drift_start,
            path,
            path_rows,
            terminal,
            boundary,
            complementarity,
            mayer,
            cache: Cache {
                val: vec![0.0; sizes[0]],
                jac: vec![0.0; sizes[1]],
                hess: vec![0.0; sizes[2]],
                wgt: vec![0.0; sizes[3]],
                work: vec![0.0; work],
                point: vec![0.0; longest],
                note: Note { inputs: vec![0.0; longest], ..Note::default() },
            },
            jac: Pattern::empty(0, 0),
            jac_map: Vec::new(),
            hess: Pattern::empty(0, 0),
            hess_map: Vec::new(),
            slope: slope_weights(&tableau),
            first: first_weights(&tableau),
            last,
            params: vec![0.0; n_params],
            durations: vec![duration; spec.n_stages()],
            polishing: false,
            exit: Exit::Slope,
            clearance: None,
            end_weights: tableau.boundary_weights().unwrap_or_default(),
            scratch: Scratch { f: vec![0.0; l.nx], local: vec![0.0; eta::n_local(l.n_cells)] },
            evaluations: 0,
            sizes: Vec::new(),
            guidance_unit: 1.0,
            tableau,
            l,
            spec,
        };
        let w = vec![1.0; f.l.n];
        let mut rec = Recorder::default();
        let mut scratch = std::mem::take(&mut f.scratch);
        f.jacobian_entries(&w, &mut scratch.f, &mut scratch.local, &mut rec);
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

    /// Lengths of the control stages; to start from where they are variables.
    pub fn durations(&self) -> &[f64] {
        &self.durations
    }

    /// Sets the weight of the soft step equilibration.
    pub fn set_rho_h(&mut self, rho_h: f64) {
        self.spec.options.rho_h = rho_h;
    }

    /// Sets the length of all control stages.
    pub fn set_duration(&mut self, duration: f64) {
        self.durations.fill(duration);
    }

    /// Sets the lengths of the control stages `[n_stages]`, all positive.
    pub fn set_durations(&mut self, durations: &[f64]) -> Result<()> {
        finite("stage length", durations, self.durations.len())?;
        if let Some(k) = durations.iter().position(|d| *d <= 0.0) {
            return Err(Error::Range(format!("stage {k} has the length {}: it must be positive", durations[k])));
        }
        self.durations.copy_from_slice(durations);
        Ok(())
    }

    /// Sets the parameters `p[np]`; those that are variables start there.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        finite("parameter", p, self.params.len())?;
        self.params.copy_from_slice(p);
        for k in 0..self.spec.n_stages() {
            self.constants[k * p.len()..(k + 1) * p.len()].copy_from_slice(p);
        }
        Ok(())
    }

    /// Sets the parameters of one control stage.
    pub fn set_stage_params(&mut self, stage: usize, p: &[f64]) -> Result<()> {
        let n = self.params.len();
        finite("parameter", p, n)?;
        if stage >= self.spec.n_stages() {
            return Err(Error::Range(format!("stage {stage} of {}", self.spec.n_stages())));
        }
        self.constants[stage * n..(stage + 1) * n].copy_from_slice(p);
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

    /// Length of the elements of a stage of the given length.
    pub(super) fn h_nominal(&self, stage: usize) -> f64 {
        self.durations[stage] / self.spec.n_fe[stage] as f64
    }

    pub(super) fn h_of(&self, e: &ElementIndex, w: &[f64]) -> f64 {
        e.h.map_or_else(|| self.h_nominal(e.stage), |j| w[j])
    }

    /// Length of a stage in terms of the variable behind it: the variable, and the share of the stage in it.
    pub(super) fn free_length(&self, stage: usize) -> Option<(usize, f64)> {
        let share = match self.spec.durations {
            Durations::Horizon => self.durations[stage] / self.durations.iter().sum::<f64>(),
            _ => 1.0,
        };
        self.l.time[stage].map(|v| (v, share))
    }

    /// Lengths of the control stages at a point.
    pub fn stage_lengths(&self, w: &[f64]) -> Vec<f64> {
        (0..self.spec.n_stages())
            .map(|k| self.free_length(k).map_or(self.durations[k], |(v, share)| share * w[v]))
            .collect()
    }

    /// The variables behind the lengths of the stages: the same one for all where only the horizon is free.
    pub fn time_places(&self) -> &[Option<usize>] {
        &self.l.time
    }

    /// The variables behind the parameters.
    pub fn param_places(&self) -> &[Option<usize>] {
        &self.l.params
    }

    /// Parameters at a point, those of the first stage where they differ.
    pub fn params_at(&self, w: &[f64]) -> Vec<f64> {
        self.l.params.iter().zip(&self.constants).map(|(v, c)| v.map_or(*c, |j| w[j])).collect()
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
    /// `u_at(stage, u)` (at the start of the stage where they are linear), equal steps, multipliers of equal share,
    /// parameters and stage lengths as set.
    pub fn guess(
        &self,
        w: &mut [f64],
        t0: f64,
        mut x_at: impl FnMut(f64, &mut [f64]),
        mut u_at: impl FnMut(usize, &mut [f64]),
    ) {
        let l = &self.l;
        let nx_user = self.spec.dcs.dims().x;
        let n_stages = self.spec.n_stages();
        w.fill(0.0);
        for (v, &p) in l.params.iter().zip(&self.params) {
            if let Some(j) = *v {
                w[j] = p;
            }
        }
        let mut controls = vec![0.0; n_stages * l.nu];
        for (k, u) in controls.chunks_mut(l.nu.max(1)).enumerate() {
            u_at(k, u);
        }
        let mut put_x = |w: &mut [f64], at: usize, t: f64, stage: usize, share: f64| {
            x_at(t, &mut w[at..at + nx_user]);
            if let Some(c) = self.spec.dcs.clock() {
                w[at + c] = t0 + t;
            }
            for (j, r) in l.linear.iter().enumerate() {
                if let Some(r) = *r {
                    let (a, b) = (controls[stage * l.nu + j], controls[(stage + 1).min(n_stages - 1) * l.nu + j]);
                    w[at + r] = a + share * (b - a);
                }
            }
        };
        put_x(w, l.x0, 0.0, 0, 0.0);
        for s in &l.starts {
            self.guess_multipliers(w, s.lambda);
            self.clear_absent(s, w);
        }
        for (k, &u) in l.u.iter().enumerate() {
            for (j, r) in l.linear.iter().enumerate() {
                let now = controls[k * l.nu + j];
                let next = controls[(k + 1).min(n_stages - 1) * l.nu + j];
                w[u + j] = if r.is_some() { (next - now) / self.durations[k] } else { now };
            }
            if let Some((v, share)) = self.free_length(k) {
                w[v] = self.durations[k] / share;
            }
        }
        let mut start = 0.0;
        for e in &l.elements {
            let (n_fe, h) = (self.spec.n_fe[e.stage] as f64, self.h_nominal(e.stage));
            let t = start + e.n as f64 * h;
            if let Some(j) = e.h {
                w[j] = h;
            }
            for i in 0..e.x.len() {
                let c = self.tableau.c[i];
                put_x(w, e.x[i], t + c * h, e.stage, (e.n as f64 + c) / n_fe);
                self.fill_multipliers(w, e.theta[i], e.lambda[i]);
            }
            if e.row_end.is_some() {
                put_x(w, e.x_end, t + h, e.stage, (e.n as f64 + 1.0) / n_fe);
            }
            if let Some(j) = e.lambda_end {
                self.guess_multipliers(w, j);
            }
            self.write_sums(w, e);
            if e.n + 1 == self.spec.n_fe[e.stage] {
                start += self.durations[e.stage];
            }
        }
    }

    /// Multipliers of half the size of their indicators.
    fn guess_multipliers(&self, w: &mut [f64], lambda: usize) {
        for j in lambda..lambda + self.l.n_cells {
            w[j] = LAMBDA_GUESS * self.size(j);
        }
    }

    /// Makes the multipliers zero that a start does not have.
    pub(super) fn clear_absent(&self, s: &StartIndex, w: &mut [f64]) {
        if s.whole {
            return;
        }
        let [cells, mus] = s.members(self.spec.dcs.form());
        (0..self.l.n_cells).filter(|c| !cells.contains(c)).for_each(|c| w[s.lambda + c] = 0.0);
        (0..self.l.n_mu).filter(|m| !mus.contains(m)).for_each(|m| w[s.mu + m] = 0.0);
    }

    /// Sizes of the states, those behind the user's included.
    pub fn state_sizes(&self) -> Vec<f64> {
        (self.l.x0..self.l.x0 + self.l.nx).map(|j| self.size(j)).collect()
    }

    /// Size of a variable.
    pub(super) fn size(&self, j: usize) -> f64 {
        self.sizes.get(j).copied().unwrap_or(1.0)
    }

    fn fill_multipliers(&self, w: &mut [f64], theta: usize, lambda: usize) {
        for cells in &self.spec.dcs.form().simplices {
            w[theta + cells.start..theta + cells.end].fill(1.0 / cells.len() as f64);
        }
        for c in self.spec.dcs.form().multipliers.iter().cloned().flatten() {
            w[theta + c] = LAMBDA_GUESS * self.size(theta + c);
        }
        self.guess_multipliers(w, lambda);
        self.write_products(w, theta);
    }

    /// Makes the weights that are products what they stand for.
    pub(super) fn write_products(&self, w: &mut [f64], theta: usize) {
        for (k, factors) in self.spec.dcs.form().products.iter().enumerate() {
            w[theta + self.l.n_cells + k] = factors.iter().map(|f| w[theta + f]).product();
        }
    }

    /// Makes the lifted sums what they stand for.
    pub(super) fn write_sums(&self, w: &mut [f64], e: &ElementIndex) {
        for c in 0..self.l.n_cells {
            if e.row_sum_theta.is_some() {
                w[e.sum_theta + c] = e.theta.iter().map(|&j| w[j + c]).sum();
            }
            if e.row_sum_lambda.is_some() {
                w[e.sum_lambda + c] = self.l.lambdas(e, c).map(|j| w[j + c]).sum();
            }
        }
    }

    /// First indices of the initial value and of the controls of every stage.
    pub fn places(&self) -> (usize, Vec<usize>) {
        (self.l.x0, self.l.u.clone())
    }

    /// States of an element that are the linear controls, as numbers behind those of the user.
    pub fn ramps(&self) -> Vec<usize> {
        self.l.linear.iter().flatten().copied().collect()
    }

    /// First index of the states at the end of the horizon.
    pub fn end_place(&self) -> usize {
        self.l.elements[self.l.elements.len() - 1].x_end
    }

    /// Length of the horizon: what is given, and variables with their factors.
    pub fn horizon_places(&self) -> (f64, Vec<(usize, f64)>) {
        let free: Vec<Option<(usize, f64)>> = (0..self.spec.n_stages()).map(|k| self.free_length(k)).collect();
        let given = free.iter().zip(&self.durations).filter(|f| f.0.is_none()).map(|f| f.1).sum();
        (given, free.into_iter().flatten().collect())
    }

    /// The variables that are lengths of elements, in the order of time; none on a fixed grid.
    pub fn lengths(&self) -> Vec<Option<usize>> {
        self.l.elements.iter().map(|e| e.h).collect()
    }

    /// Controls of a point at the start of every stage, `[n_stages · nu]`.
    pub fn controls(&self, w: &[f64]) -> Vec<f64> {
        self.controls_at(w, |k| self.l.stage(k)[0].x_start)
    }

    /// Controls of a point at the end of every stage, `[n_stages · nu]`: others than at the start where they are linear.
    pub fn control_ends(&self, w: &[f64]) -> Vec<f64> {
        self.controls_at(w, |k| self.l.elements[self.l.first[k + 1] - 1].x_end)
    }

    /// User states at the start and at the end of every element `[(n_elements + 1) · nx]`.
    pub fn end_states(&self, w: &[f64]) -> Vec<f64> {
        let nx = self.spec.dcs.dims().x;
        let ends = std::iter::once(self.l.x0).chain(self.l.elements.iter().map(|e| e.x_end));
        ends.flat_map(|x| w[x..x + nx].iter().copied()).collect()
    }

    fn controls_at(&self, w: &[f64], state: impl Fn(usize) -> usize) -> Vec<f64> {
        let value = |k: usize, j: usize| w[self.l.linear[j].map_or(self.l.u[k] + j, |r| state(k) + r)];
        (0..self.spec.n_stages()).flat_map(|k| (0..self.l.nu).map(move |j| (k, j))).map(|(k, j)| value(k, j)).collect()
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
        for c in &self.mayer {
            f += self.cache.val[c.val];
        }
        f
    }

    pub(super) fn soft_weight(&self) -> f64 {
        let soft = matches!(self.spec.options.equilibration, StepEquilibration::Mean | StepEquilibration::Difference);
        if soft {
            self.guidance_weight()
        } else {
            0.0
        }
    }

    /// The soft step equilibration: deviations of a step from a reference.
    pub(super) fn soft_terms(&self) -> impl Iterator<Item = (usize, Reference)> + '_ {
        let mean = self.spec.options.equilibration == StepEquilibration::Mean;
        self.l
            .elements
            .windows(2)
            .filter_map(move |p| match (p[0].h, p[1].h) {
                (Some(a), Some(b)) if p[1].n > 0 && !mean => Some((b, Reference::Variable(a, 1.0))),
                _ => None,
            })
            .chain(self.l.elements.iter().filter_map(move |e| {
                let h = e.h.filter(|_| mean)?;
                let nominal = |(v, share)| Reference::Variable(v, share / self.spec.n_fe[e.stage] as f64);
                Some((h, self.free_length(e.stage).map_or(Reference::Value(self.h_nominal(e.stage)), nominal)))
            }))
            .filter(|_| self.l.fesd)
    }

    /// What the objective has beside the user's cost at a point, outside of the polish.
    pub fn guidance(&mut self, w: &[f64]) -> f64 {
        let mut scratch = std::mem::take(&mut self.scratch);
        let eta = self.eta_value(w, &mut scratch.local);
        self.scratch = scratch;
        self.soft_value(w) + eta
    }

    fn soft_value(&self, w: &[f64]) -> f64 {
        self.soft_weight() * self.soft_terms().map(|(a, b)| (w[a] - b.value(w)).powi(2)).sum::<f64>()
    }

    pub(super) fn evaluate_values(&mut self, w: &[f64]) -> EvalResult {
        let mut cache = std::mem::take(&mut self.cache);
        let r = self.at_all_points(w, &mut cache, Part::Value, |c, f, at, cache| {
            f.value(at, &mut cache.val[c.val..c.val + f.n_out()], &mut cache.work)
        });
        self.cache = cache;
        self.evaluations += self.calls.len();
        r
    }

    pub(super) fn evaluate_jacobians(&mut self, w: &[f64]) -> EvalResult {
        let mut cache = std::mem::take(&mut self.cache);
        let r = self.at_all_points(w, &mut cache, Part::Jacobian, |c, f, at, cache| match self.jac_cols[c.f].len() {
            0 => Ok(()),
            n => f.jacobian(at, &mut cache.jac[c.jac..c.jac + n], &mut cache.work),
        });
        self.cache = cache;
        self.evaluations += self.calls.len();
        r
    }

    fn evaluate_hessians(&mut self, w: &[f64]) -> EvalResult {
        let mut cache = std::mem::take(&mut self.cache);
        let r = self.at_all_points(w, &mut cache, Part::Hessian, |c, f, at, cache| match self.hess_cols[c.f].len() {
            0 => Ok(()),
            n => {
                let weights = &cache.wgt[c.wgt..c.wgt + f.n_out()];
                f.hessian(at, weights, &mut cache.hess[c.hess..c.hess + n], &mut cache.work)
            }
        });
        self.cache = cache;
        self.evaluations += self.calls.len();
        r
    }

    /// Calls `evaluate` for every call with its inputs, gathered once for neighbours at the same point.
    fn at_all_points(
        &self,
        w: &[f64],
        cache: &mut Cache,
        part: Part,
        evaluate: impl Fn(&Call, &dyn Function, &Point, &mut Cache) -> EvalResult,
    ) -> EvalResult {
        let mut buffer = std::mem::take(&mut cache.point);
        let mut gathered = usize::MAX;
        cache.note.age += usize::from(part == Part::Value);
        let r = self.calls.iter().try_for_each(|c| {
            if stop::requested().is_some() {
                return Err(EvalError::Stopped);
            }
            let f = self.functions[c.f].as_ref();
            let d = f.dims();
            let at = &mut buffer[..=d.t_col()];
            if gathered != c.inputs {
                for (v, &j) in at.iter_mut().zip(&self.inputs[c.inputs..]) {
                    let j = j as usize;
                    *v = if j < w.len() { w[j] } else { self.constants[j - w.len()] };
                }
                gathered = c.inputs;
            }
            let (x, rest) = at.split_at(d.x);
            let (u, rest) = rest.split_at(d.u);
            let found = evaluate(c, f, &Point { t: rest[d.p], x, u, p: &rest[..d.p] }, cache);
            if let Err(error @ (EvalError::Recoverable | EvalError::Fatal(_))) = found {
                let note = &mut cache.note;
                (note.call, note.part, note.age) = (Some(*c), Some((part, error)), 0);
                note.inputs[..d.n_in()].copy_from_slice(&buffer[..d.n_in()]);
                note.t = self.time_of(c, w);
            }
            found
        });
        cache.point = buffer;
        r
    }
}

/// What a step is compared with.
#[derive(Debug, Clone, Copy)]
pub(super) enum Reference {
    /// A number.
    Value(f64),
    /// A multiple of a variable.
    Variable(usize, f64),
}

impl Reference {
    pub(super) fn value(self, w: &[f64]) -> f64 {
        match self {
            Reference::Value(v) => v,
            Reference::Variable(j, s) => s * w[j],
        }
    }
}

/// First guess of the multipliers `λ`.
const LAMBDA_GUESS: f64 = 0.5;

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
        self.constraint_values(w, c, &mut scratch.f, &mut scratch.local);
        let eta = self.eta_value(w, &mut scratch.local);
        self.scratch = scratch;
        Ok(self.user_cost(w) + self.soft_value(w) + eta)
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
        for c in &self.mayer {
            for (p, &(col, _)) in self.jac_cols[c.f].iter().enumerate() {
                if let Some(v) = self.var(c, col) {
                    grad[v] += self.cache.jac[c.jac + p];
                }
            }
        }
        let rho = 2.0 * self.soft_weight();
        for (a, b) in self.soft_terms() {
            let d = rho * (w[a] - b.value(w));
            grad[a] += d;
            if let Reference::Variable(b, s) = b {
                grad[b] -= s * d;
            }
        }
        jac.fill(0.0);
        let map = std::mem::take(&mut self.jac_map);
        let mut scratch = std::mem::take(&mut self.scratch);
        if let Some(shape) = self.eta_penalty() {
            let weight = self.guidance_weight();
            for (a, b) in self.eta_pairs() {
                self.load_eta(a, b, w, &mut scratch.local);
                for k in 0..scratch.local.len() {
                    grad[self.eta_vars(a, b, k)] += weight * eta::gradient(shape, self.l.n_cells, &scratch.local, k);
                }
            }
        }
        let mut writer = Writer { map: &map, k: 0, values: jac };
        self.jacobian_entries(w, &mut scratch.f, &mut scratch.local, &mut writer);
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
