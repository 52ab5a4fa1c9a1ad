//! Quadratic programs (10.5) at points of the optimisation.

use super::choices;
use super::constraints::Constraints;
use super::cost::Costs;
use super::iterate::{Iterate, Step};
use super::nodes::Nodes;
use super::quasi_newton::BlockUpdates;
use super::stage::{Evaluations, Stage, Starts};
use crate::func::EvalResult;
use crate::linalg::dense::{axpy, dot, gemv, gemv_transposed, mirror_eigenvalues, Left};
use crate::qp::{QpSolution, QpSolver, QpStatus, StageQp, Terms};

/// Eigenvalues of a Hessian block are at least this share of its largest entry where it had to be made convex.
const CONVEX: f64 = 1e-8;
/// A proximal term of controls that move nothing is this share of the largest curvature that they have in the horizon: small beside it, and
/// large beside its rounding.
const HELD: f64 = 1e-8;
/// Share of their size up to which steps are rounding: a few hundred operations.
const ROUNDING: f64 = 256.0 * f64::EPSILON;

/// Sources of the Hessian of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HessianKind {
    /// Gauss-Newton for least squares; costs without structure have their own Hessian, made convex node by node.
    GaussNewton,
    /// Hessian of the Lagrangian, made convex node by node.
    Exact,
    /// Approximation of the Hessian of the Lagrangian, updated from gradients node by node.
    QuasiNewton,
}

/// Functions of the problem with room for their values.
pub(super) struct Model {
    pub nodes: Nodes,
    pub stage: Box<dyn Stage>,
    pub costs: Costs,
    pub constraints: Constraints,
    pub u_lower: Vec<f64>,
    pub u_upper: Vec<f64>,
    /// The system switches: its stages are simulated by events.
    pub switches: bool,
    /// Whether a control chooses among values.
    pub chooses: Vec<bool>,
    /// Control evaluations of costs and constraints, and those of the stages.
    pub evaluations: Evaluations,
    /// Counts changes of parameters and times.
    pub revision: u64,
}

impl Model {
    /// Evaluations so far, those of the dynamics included.
    pub fn evaluations(&self) -> Evaluations {
        let (own, stage) = (self.evaluations, self.stage.evaluations());
        Evaluations {
            values: own.values + stage.values,
            jacobians: own.jacobians + stage.jacobians,
            adjoints: own.adjoints + stage.adjoints,
            hessians: own.hessians + stage.hessians,
        }
    }
}

/// A quadratic program and the point it belongs to.
pub(super) struct Linearisation {
    /// Counts the points: a step knows which one it belongs to.
    stamp: u64,
    /// Where vectors were evaluated last; steps start here.
    point: Iterate,
    /// Where matrices were evaluated last, with the gradient of the cost there.
    base_x: Vec<f64>,
    base_u: Vec<f64>,
    base_grad_x: Vec<f64>,
    base_grad_u: Vec<f64>,
    /// The gradient is made of the one at that point; else it is that of the Lagrangian where the vectors were evaluated.
    from_base: bool,
    pub qp: StageQp,
    solver: Box<dyn QpSolver>,
    ready: bool,
    kind: HessianKind,
    /// `ψ`, `A`, `B` of an evaluation that may fail on the way.
    next: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    gx: Vec<f64>,
    gu: Vec<f64>,
    /// Hessian blocks before they are made convex.
    blocks: Vec<f64>,
    work: Vec<f64>,
    row: Vec<f64>,
    updates: Option<BlockUpdates>,
    /// The revision whose Hessian the program has, where that depends on nothing else.
    hessian_of: Option<u64>,
    dx0: Vec<f64>,
    /// What is taken off every solution: the part of the step to the predicted state that was found too long.
    held_x: Vec<f64>,
    held_u: Vec<f64>,
    /// Of the last [`Linearisation::roll_out`], `[n · nu]`: where controls that move nothing begin to.
    break_away: Vec<Option<[f64; 2]>>,
}

/// The start of stage `k` from the states `x` up to it and the controls `u` of all stages.
fn start<'a>(nodes: &'a Nodes, k: usize, x: &'a [f64], u: &'a [f64]) -> Starts<'a> {
    let (nx, nu, np) = (nodes.nx, nodes.nu, nodes.np);
    Starts {
        x: &x[k * nx..],
        u: &u[k * nu..(k + 1) * nu],
        p: &nodes.p[k * np..(k + 1) * np],
        t: &nodes.t[k..=k],
        h: &nodes.h[k..=k],
    }
}

impl Linearisation {
    pub fn new(model: &Model, qp: StageQp, solver: Box<dyn QpSolver>, kind: HessianKind) -> Linearisation {
        let (n, nx, nu) = (qp.n, qp.nx, qp.nu);
        let width = nx + nu;
        let has_blocks = kind != HessianKind::GaussNewton || !model.costs.general.is_empty();
        Linearisation {
            stamp: 0,
            point: Iterate::zeros(n, nx, nu, qp.rows.len()),
            base_x: vec![0.0; (n + 1) * nx],
            base_u: vec![0.0; n * nu],
            base_grad_x: vec![0.0; (n + 1) * nx],
            base_grad_u: vec![0.0; n * nu],
            from_base: true,
            solver,
            ready: false,
            kind,
            next: vec![0.0; n * nx],
            a: vec![0.0; qp.a.len()],
            b: vec![0.0; qp.b.len()],
            gx: vec![0.0; (n + 1) * nx],
            gu: vec![0.0; n * nu],
            blocks: vec![0.0; if has_blocks { (n + 1) * width * width } else { 0 }],
            work: vec![0.0; 2 * width * width + width],
            row: vec![0.0; width],
            updates: (kind == HessianKind::QuasiNewton).then(|| BlockUpdates::new(n, nx, nu, qp.rows.len())),
            hessian_of: None,
            dx0: vec![0.0; nx],
            held_x: vec![0.0; (n + 1) * nx],
            held_u: vec![0.0; n * nu],
            break_away: vec![None; n * nu],
            qp,
        }
    }

    /// Is there a program to solve?
    pub fn is_ready(&self) -> bool {
        self.ready
    }

    /// The point that steps start from.
    pub fn point(&self) -> &Iterate {
        &self.point
    }

    /// Iterations of the last quadratic program, none where there is no program.
    pub fn qp_iterations(&self) -> usize {
        if self.ready {
            self.solver.iterations()
        } else {
            0
        }
    }

    /// Simulates the stages one after the other: from the first state and the controls of `at` to all other states, with
    /// derivatives for [`Linearisation::linearise_rolled`]. The program stays as it is.
    pub fn roll_out(&mut self, model: &mut Model, at: &mut Iterate) -> EvalResult {
        let (n, nx, nu) = (self.qp.n, self.qp.nx, self.qp.nu);
        for k in 0..n {
            let (before, after) = at.x.split_at_mut((k + 1) * nx);
            let starts = start(&model.nodes, k, before, &at.u);
            let (a, b) = (&mut self.a[k * nx * nx..(k + 1) * nx * nx], &mut self.b[k * nx * nu..(k + 1) * nx * nu]);
            model.stage.linearise(&starts, &mut after[..nx], a, b, None)?;
            (0..nu).for_each(|j| self.break_away[k * nu + j] = model.stage.break_away(j));
        }
        self.next.copy_from_slice(&at.x[nx..]);
        Ok(())
    }

    /// As [`Linearisation::roll_out`] without derivatives.
    pub fn simulate(model: &mut Model, at: &mut Iterate) -> EvalResult {
        (0..model.nodes.n).try_for_each(|k| Linearisation::simulate_stage(model, at, k))
    }

    /// Stage `k` of it.
    pub fn simulate_stage(model: &mut Model, at: &mut Iterate, k: usize) -> EvalResult {
        let nx = model.nodes.nx;
        let (before, after) = at.x.split_at_mut((k + 1) * nx);
        let starts = start(&model.nodes, k, before, &at.u);
        model.stage.values(&starts, &mut after[..nx])
    }

    /// Controls that moved nothing in the last [`Linearisation::roll_out`], with the values at which they begin to.
    pub fn break_away(&self) -> &[Option<[f64; 2]>] {
        &self.break_away
    }

    /// [`Linearisation::linearise`] at the point of the last [`Linearisation::roll_out`].
    pub fn linearise_rolled(&mut self, model: &mut Model, at: &Iterate) -> EvalResult {
        let Model { nodes, costs, constraints, evaluations, .. } = model;
        nodes.solve(&at.x, &at.u)?;
        costs.evaluate(nodes, &at.x, &at.u, false)?;
        constraints.linearise(nodes, &at.x, &at.u)?;
        evaluations.values += 1;
        evaluations.jacobians += 1;
        self.take_over(model, at)
    }

    /// Level D: values, Jacobians, Hessian and factors at a point. On failure the program before stays, to be solved further.
    pub fn linearise(&mut self, model: &mut Model, at: &Iterate) -> EvalResult {
        self.evaluate(model, at)?;
        self.take_over(model, at)
    }

    /// The program of the functions that were evaluated last.
    fn take_over(&mut self, model: &mut Model, at: &Iterate) -> EvalResult {
        let (nx, nu) = (self.qp.nx, self.qp.nu);
        self.stamp += 1;
        self.held_x.fill(0.0);
        self.held_u.fill(0.0);
        self.point.copy_from(at);
        self.base_x.copy_from_slice(&at.x);
        self.base_u.copy_from_slice(&at.u);
        std::mem::swap(&mut self.qp.a, &mut self.a);
        std::mem::swap(&mut self.qp.b, &mut self.b);
        self.write_vectors(model);
        model.constraints.write_jacobian(&model.nodes, &mut self.qp, &mut self.row);
        self.qp.grad_x.fill(0.0);
        self.qp.grad_u.fill(0.0);
        model.costs.add_gradient(&model.nodes, &mut self.qp.grad_x, &mut self.qp.grad_u);
        self.base_grad_x.copy_from_slice(&self.qp.grad_x);
        self.base_grad_u.copy_from_slice(&self.qp.grad_u);
        self.from_base = true;
        self.write_hessian(model);
        if let Some(updates) = &mut self.updates {
            updates.update(&self.qp, &self.point, nx, nu);
            updates.write(&mut self.qp);
        }
        if model.chooses.contains(&true) {
            // the Hessian is written anew at the next point
            self.hessian_of = None;
            choices::fix(&model.chooses, &mut self.qp);
        }
        self.ready = self.solver.prepare(&self.qp);
        if !self.ready {
            self.hold_free_controls();
            self.ready = self.solver.prepare(&self.qp);
        }
        Ok(())
    }

    /// Where controls move nothing that has a price, the program has no unique solution: a proximal term, small beside what these controls
    /// cost elsewhere in the horizon, makes the solution the one that moves them least. It is one of the step, not of the control: where
    /// iterations end they end at a solution of the problem as it is.
    fn hold_free_controls(&mut self) {
        let (n, nx, nu) = (self.qp.n, self.qp.nx, self.qp.nu);
        // V = Q + Aᵀ V A without feedback: R + Bᵀ V B are blocks of the Hessian in all controls
        let largest = &mut self.row[..nu];
        let (value, rest) = self.work.split_at_mut(nx * nx);
        let (product, rest) = rest.split_at_mut(nx * nx);
        let column = &mut rest[..nx];
        value.copy_from_slice(&self.qp.hess_x[n * nx * nx..]);
        largest.fill(0.0);
        let times = |value: &[f64], by: &[f64], out: &mut [f64]| {
            out.fill(0.0);
            gemv(nx, nx, Left { v: value, ld: nx }, by, out);
        };
        for k in (0..n).rev() {
            for (j, b) in self.qp.b[k * nx * nu..(k + 1) * nx * nu].chunks_exact(nx).enumerate() {
                times(value, b, column);
                largest[j] = largest[j].max(self.qp.hess_u[k * nu * nu + j * (nu + 1)] + dot(b, column));
            }
            for (a, out) in self.qp.a[k * nx * nx..].chunks_exact(nx).take(nx).zip(product.chunks_exact_mut(nx)) {
                times(value, a, out);
            }
            value.copy_from_slice(&self.qp.hess_x[k * nx * nx..(k + 1) * nx * nx]);
            for (product, out) in product.chunks_exact(nx).zip(value.chunks_exact_mut(nx)) {
                gemv_transposed(nx, nx, self.qp.a(k), product, out);
            }
        }
        for k in 0..n {
            for (j, size) in self.row[..nu].iter().enumerate() {
                // what moves nothing anywhere stays where it is, whatever its curvature
                let size = if *size > 0.0 { HELD * size } else { 1.0 };
                self.qp.hess_u[k * nu * nu + j * (nu + 1)] += size;
            }
        }
        // it is written anew at the next point
        self.hessian_of = None;
    }

    /// All functions at a point; nothing of the program changes.
    fn evaluate(&mut self, model: &mut Model, at: &Iterate) -> EvalResult {
        let Model { nodes, stage, costs, constraints, evaluations, .. } = model;
        let (nx, exact) = (nodes.nx, self.kind == HessianKind::Exact);
        nodes.solve(&at.x, &at.u)?;
        costs.evaluate(nodes, &at.x, &at.u, exact)?;
        constraints.linearise(nodes, &at.x, &at.u)?;
        evaluations.values += 1;
        evaluations.jacobians += 1;
        let starts = Starts { x: &at.x[..nodes.n * nx], u: &at.u, p: &nodes.p, t: &nodes.t, h: &nodes.h };
        let second = if exact {
            constraints.hessians(nodes, &at.row_mu)?;
            evaluations.hessians += 1;
            let width = nx + nodes.nu;
            self.blocks.fill(0.0);
            Some((&at.lambda[nx..], &mut self.blocks[..nodes.n * width * width]))
        } else {
            None
        };
        stage.linearise(&starts, &mut self.next, &mut self.a, &mut self.b, second)
    }

    /// Constraints as seen from the point: what is left of the dynamics, bounds.
    fn write_vectors(&mut self, model: &Model) {
        let nx = self.qp.nx;
        let gap = self.next.iter().zip(&self.point.x[nx..]);
        self.qp.c.iter_mut().zip(gap).for_each(|(c, (psi, x))| *c = psi - x);
        self.embed_control_bounds(model);
        model.constraints.write_bounds(&mut self.qp);
    }

    /// Brings the bounds of the controls into the program.
    pub fn embed_control_bounds(&mut self, model: &Model) {
        let write = |to: &mut [f64], bound: &[f64]| {
            for (k, v) in to.iter_mut().enumerate() {
                *v = bound[k % bound.len()] - self.point.u[k];
            }
        };
        write(&mut self.qp.u_lower, &model.u_lower);
        write(&mut self.qp.u_upper, &model.u_upper);
        self.qp.u_base.iter_mut().zip(&self.point.u).for_each(|(b, u)| *b = u.abs());
        choices::fix_vectors(&model.chooses, &mut self.qp);
    }

    /// Brings the bounds of the states into the program.
    pub fn embed_state_bounds(&mut self, model: &Model) {
        model.constraints.write_state_bounds(&self.point.x, &mut self.qp);
    }

    /// Forgets what was learned of the Hessian: the cost is another one.
    pub fn forget_updates(&mut self) {
        if let Some(u) = &mut self.updates {
            u.reset();
        }
    }

    fn write_hessian(&mut self, model: &mut Model) {
        let exact = self.kind == HessianKind::Exact;
        let constant = self.kind == HessianKind::GaussNewton && model.nodes.nz == 0 && model.costs.is_quadratic();
        if constant && self.hessian_of == Some(model.revision) {
            return;
        }
        self.hessian_of = constant.then_some(model.revision);
        self.qp.hess_x.fill(0.0);
        self.qp.hess_xu.fill(0.0);
        self.qp.hess_u.fill(0.0);
        if self.blocks.is_empty() {
            model.costs.add_hessian(&model.nodes, &mut self.qp, None, false);
            return;
        }
        if !exact {
            self.blocks.fill(0.0);
        }
        model.costs.add_hessian(&model.nodes, &mut self.qp, Some(&mut self.blocks), exact);
        if exact {
            model.constraints.add_hessian(&model.nodes, &mut self.blocks);
        }
        self.convexify();
    }

    /// Adds the blocks to the Hessian of the program, node by node, and mirrors the eigenvalues of the sum that are not
    /// positive.
    fn convexify(&mut self) {
        let (n, nx, nu) = (self.qp.n, self.qp.nx, self.qp.nu);
        let width = nx + nu;
        for k in 0..=n {
            let used = if k == n { nx } else { width };
            let block = &self.blocks[k * width * width..(k + 1) * width * width];
            let (m, work) = self.work.split_at_mut(width * width);
            let mut largest = 0.0f64;
            for b in 0..used {
                for a in b..used {
                    let own = match (a < nx, b < nx) {
                        (true, true) => self.qp.hess_x[k * nx * nx + a + b * nx],
                        (false, true) => self.qp.hess_xu[k * nu * nx + (a - nx) + b * nu],
                        _ => self.qp.hess_u[k * nu * nu + (a - nx) + (b - nx) * nu],
                    };
                    let v = own + block[a + b * width];
                    (m[a + b * used], m[b + a * used]) = (v, v);
                    largest = largest.max(v.abs());
                }
            }
            mirror_eigenvalues(used, &mut m[..used * used], &mut work[..used * used + used], CONVEX * largest);
            for b in 0..used {
                for a in 0..used {
                    let v = m[a + b * used];
                    match (a < nx, b < nx) {
                        (true, true) => self.qp.hess_x[k * nx * nx + a + b * nx] = v,
                        (false, true) => self.qp.hess_xu[k * nu * nx + (a - nx) + b * nu] = v,
                        (false, false) => self.qp.hess_u[k * nu * nu + (a - nx) + (b - nx) * nu] = v,
                        _ => {}
                    }
                }
            }
        }
    }

    /// Level B: values of the constraints at a point, the gradient by (10.11); level C: by (10.12), with an adjoint sweep. Matrices
    /// stay. On failure nothing has changed.
    pub fn refresh(&mut self, model: &mut Model, at: &Iterate, adjoint: bool) -> EvalResult {
        let Model { nodes, stage, costs, constraints, evaluations, .. } = model;
        let (n, nx) = (self.qp.n, self.qp.nx);
        nodes.solve(&at.x, &at.u)?;
        let starts = Starts { x: &at.x[..n * nx], u: &at.u, p: &nodes.p, t: &nodes.t, h: &nodes.h };
        evaluations.values += 1;
        if adjoint {
            costs.evaluate(nodes, &at.x, &at.u, false)?;
            constraints.linearise(nodes, &at.x, &at.u)?;
            let gx = &mut self.gx[..n * nx];
            stage.adjoint(&starts, &at.lambda[nx..], &mut self.next, gx, &mut self.gu)?;
            self.gx[n * nx..].fill(0.0);
            evaluations.adjoints += 1;
            costs.add_gradient(nodes, &mut self.gx, &mut self.gu);
            constraints.add_transposed(nodes, &at.row_mu, &mut self.gx, &mut self.gu, &mut self.row);
            self.subtract_frozen(at);
        } else {
            constraints.values(nodes, &at.x, &at.u)?;
            stage.values(&starts, &mut self.next)?;
        }
        self.stamp += 1;
        self.point.copy_from(at);
        self.write_vectors(model);
        self.from_base = !adjoint;
        if adjoint {
            self.qp.grad_x.copy_from_slice(&self.gx);
            self.qp.grad_u.copy_from_slice(&self.gu);
        } else {
            self.frozen_gradient();
        }
        self.solver.refresh(&self.qp);
        Ok(())
    }

    /// By how much the values of the dynamics at the point of the program, behind a step of length one that its frozen matrices gave, are
    /// off: the size of the correction that they ask for, followed with the feedback `gain` of the program, relative to the scale of states and
    /// controls. Without the last stage, where the point has been shifted: what is there repeats the one before. `work[2 nx + nu]`.
    pub fn mismatch(&self, gain: &[f64], stages: usize, scale: &[f64], work: &mut [f64]) -> f64 {
        let (nx, nu) = (self.qp.nx, self.qp.nu);
        let (own, rest) = work.split_at_mut(nx);
        let (next, u) = rest.split_at_mut(nx);
        own.fill(0.0);
        let mut largest = 0.0f64;
        for k in 0..stages {
            u.fill(0.0);
            gemv(nu, nx, Left { v: &gain[k * nu * nx..], ld: nu }, own, u);
            self.qp.step(k, own, u, next);
            own.copy_from_slice(next);
            let all = own.iter().chain(&*u).zip(scale);
            // NaN counts
            largest = all.fold(largest, |m, (v, s)| if v.abs() / s <= m { m } else { v.abs() / s });
        }
        largest
    }

    /// Up to which size steps are rounding, `out[nx + nu]`: of states that of the terms of the dynamics, of controls what the feedback
    /// `gain` of the program makes of that, each the largest of the horizon. A controller at rest has controls that are nothing else.
    pub fn rounding(&self, at: &Iterate, gain: &[f64], out: &mut [f64]) {
        let (n, nx, nu) = (self.qp.n, self.qp.nx, self.qp.nu);
        let (of_x, of_u) = out.split_at_mut(nx);
        of_x.iter_mut()
            .enumerate()
            .for_each(|(i, f)| *f = at.x.iter().skip(i).step_by(nx).fold(0.0, |m, v| v.abs().max(m)));
        of_u.iter_mut()
            .enumerate()
            .for_each(|(j, f)| *f = at.u.iter().skip(j).step_by(nu).fold(0.0, |m, v| v.abs().max(m)));
        for k in 0..n {
            let (x, u) = (&at.x[k * nx..(k + 1) * nx], &at.u[k * nu..(k + 1) * nu]);
            for (i, f) in of_x.iter_mut().enumerate() {
                let terms = |m: &[f64], by: &[f64]| -> f64 {
                    by.iter().enumerate().map(|(j, v)| (m[i + j * nx] * v).abs()).sum()
                };
                *f = f.max(terms(&self.qp.a[k * nx * nx..], x) + terms(&self.qp.b[k * nx * nu..], u));
            }
        }
        for k in 0..n {
            for (j, f) in of_u.iter_mut().enumerate() {
                let gain = &gain[k * nu * nx..(k + 1) * nu * nx];
                *f = f.max(of_x.iter().enumerate().map(|(i, x)| gain[j + i * nu].abs() * x).sum());
            }
        }
        for b in self.qp.b.chunks_exact(nx * nu) {
            for (i, f) in of_x.iter_mut().enumerate() {
                *f = f.max(of_u.iter().enumerate().map(|(j, u)| b[i + j * nx].abs() * u).sum());
            }
        }
        out.iter_mut().for_each(|f| *f *= ROUNDING);
    }

    /// Brings references `y` of least-squares term `k` into the program: its gradient changes, nothing else. Returns the change of the
    /// cost of the point. The references of the model are still the old ones.
    pub fn embed_references(
        &mut self,
        model: &mut Model,
        k: usize,
        y: &[f64],
    ) -> std::result::Result<f64, crate::func::EvalError> {
        if !self.ready {
            return Ok(0.0);
        }
        let Model { nodes, costs, .. } = model;
        let (x, u) = if self.from_base { (&self.base_x, &self.base_u) } else { (&self.point.x, &self.point.u) };
        nodes.solve(x, u)?;
        self.gx.fill(0.0);
        self.gu.fill(0.0);
        let change = costs.change_references(nodes, k, [x, u, y], [&mut self.gx, &mut self.gu])?;
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t += f);
        add(&mut self.qp.grad_x, &self.gx);
        add(&mut self.qp.grad_u, &self.gu);
        if self.from_base {
            add(&mut self.base_grad_x, &self.gx);
            add(&mut self.base_grad_u, &self.gu);
        }
        if let Some(updates) = &mut self.updates {
            updates.change_gradient(&self.gx, &self.gu);
        }
        choices::fix_vectors(&model.chooses, &mut self.qp);
        self.solver.refresh(&self.qp);
        Ok(change)
    }

    /// Brings the parameters of the model into the program as far as they change vectors: the gradient, and with `values` those of the
    /// dynamics and of the rows at `at`, the point of the program. Matrices stay.
    pub fn embed_params(&mut self, model: &mut Model, at: &Iterate, values: bool) -> EvalResult {
        if !self.from_base {
            return self.refresh(model, at, true);
        }
        let Model { nodes, costs, .. } = model;
        nodes.solve(&self.base_x, &self.base_u)?;
        costs.evaluate(nodes, &self.base_x, &self.base_u, false)?;
        self.gx.fill(0.0);
        self.gu.fill(0.0);
        costs.add_gradient(nodes, &mut self.gx, &mut self.gu);
        if let Some(updates) = &mut self.updates {
            updates.set_gradient(&self.gx, &self.gu);
        }
        self.base_grad_x.copy_from_slice(&self.gx);
        self.base_grad_u.copy_from_slice(&self.gu);
        if values {
            self.refresh(model, at, false)?;
        }
        Ok(())
    }

    /// `− Âᵀ λ − Ĉᵀ μ`, which the program's own matrices bring back.
    fn subtract_frozen(&mut self, at: &Iterate) {
        let (n, nx, nu) = (self.qp.n, self.qp.nx, self.qp.nu);
        let row = &mut self.row;
        for k in 0..n {
            let lambda = &at.lambda[(k + 1) * nx..(k + 2) * nx];
            row.fill(0.0);
            gemv_transposed(nx, nx, Left { v: &self.qp.a[k * nx * nx..], ld: nx }, lambda, &mut row[..nx]);
            gemv_transposed(nx, nu, Left { v: &self.qp.b[k * nx * nu..], ld: nx }, lambda, &mut row[nx..]);
            self.gx[k * nx..(k + 1) * nx].iter_mut().zip(&*row).for_each(|(g, v)| *g -= v);
            self.gu[k * nu..(k + 1) * nu].iter_mut().zip(&row[nx..]).for_each(|(g, v)| *g -= v);
        }
        for (i, mu) in at.row_mu.iter().enumerate().filter(|e| *e.1 != 0.0) {
            let k = self.qp.rows[i].node;
            let c = &self.qp.row_x[i * nx..(i + 1) * nx];
            self.gx[k * nx..(k + 1) * nx].iter_mut().zip(c).for_each(|(g, c)| *g -= mu * c);
            if k < n {
                let d = &self.qp.row_u[i * nu..(i + 1) * nu];
                self.gu[k * nu..(k + 1) * nu].iter_mut().zip(d).for_each(|(g, d)| *g -= mu * d);
            }
        }
    }

    /// `â + Â (w − ŵ)`
    fn frozen_gradient(&mut self) {
        let (n, nx, nu) = (self.qp.n, self.qp.nx, self.qp.nu);
        let qp = &mut self.qp;
        qp.grad_x.copy_from_slice(&self.base_grad_x);
        qp.grad_u.copy_from_slice(&self.base_grad_u);
        for k in 0..=n {
            for j in 0..nx {
                let d = self.point.x[k * nx + j] - self.base_x[k * nx + j];
                let q = &qp.hess_x[k * nx * nx + j * nx..][..nx];
                qp.grad_x[k * nx..(k + 1) * nx].iter_mut().zip(q).for_each(|(g, q)| *g += q * d);
                if k < n {
                    let s = &qp.hess_xu[k * nu * nx + j * nu..][..nu];
                    qp.grad_u[k * nu..(k + 1) * nu].iter_mut().zip(s).for_each(|(g, s)| *g += s * d);
                }
            }
            for j in 0..if k < n { nu } else { 0 } {
                let d = self.point.u[k * nu + j] - self.base_u[k * nu + j];
                let r = &qp.hess_u[k * nu * nu + j * nu..][..nu];
                qp.grad_u[k * nu..(k + 1) * nu].iter_mut().zip(r).for_each(|(g, r)| *g += r * d);
                for i in 0..nx {
                    qp.grad_x[k * nx + i] += qp.hess_xu[k * nu * nx + j + i * nu] * d;
                }
            }
        }
    }

    /// Solves the program with the initial value embedded. No function is evaluated.
    pub fn solve(&mut self, x0: &[f64], terms: &Terms) -> QpStatus {
        if !self.ready {
            return QpStatus::Failed;
        }
        self.difference(x0);
        self.solver.solve(&self.qp, &self.dx0, terms)
    }

    fn difference(&mut self, x0: &[f64]) {
        self.dx0.iter_mut().zip(x0.iter().zip(&self.point.x)).for_each(|(d, (x0, x))| *d = x0 - x);
    }

    /// The first control of the last solution.
    pub fn first_control(&self, u0: &mut [f64]) {
        let own = self.point.u.iter().zip(self.solver.controls()).zip(&self.held_u);
        u0.iter_mut().zip(own).for_each(|(u, ((point, step), held))| *u = point + step - held);
    }

    /// Of what is known where the program is not solved the control that costs least, by the program, with `price` per unit of violation: that of its last
    /// iterate, of the affine law, of the point itself. Each is followed by the affine law, cut off at the bounds of the controls. `gains` is room for
    /// that of the program.
    pub fn cheapest_control(&mut self, x0: &[f64], price: f64, gains: &mut [f64], step: &mut Step, u0: &mut [f64]) {
        self.difference(x0);
        if !self.solver.gains(gains) {
            return self.first_control(u0);
        }
        let (nx, nu, qp, dx0) = (self.qp.nx, self.qp.nu, &self.qp, &self.dx0);
        let QpSolution { x, u, .. } = &mut step.solution;
        let (free_x, free_u) = (&mut self.gx, &mut self.gu);
        free_u.copy_from_slice(self.solver.tangent(qp, dx0));
        free_x[..nx].copy_from_slice(dx0);
        qp.roll_out(free_u, free_x);
        x[..nx].copy_from_slice(dx0);
        let mut least = f64::INFINITY;
        for which in 0..3 {
            for k in 0..qp.n {
                let (before, after) = x.split_at_mut((k + 1) * nx);
                let (own, u) = (&before[k * nx..], &mut u[k * nu..(k + 1) * nu]);
                match (k, which) {
                    (0, 0) => u.copy_from_slice(&self.solver.controls()[..nu]),
                    (0, 1) => u.fill(0.0),
                    _ => {
                        u.copy_from_slice(&free_u[k * nu..(k + 1) * nu]);
                        for (i, (x, free)) in own.iter().zip(&free_x[k * nx..(k + 1) * nx]).enumerate() {
                            axpy(x - free, &gains[(k * nx + i) * nu..(k * nx + i + 1) * nu], u);
                        }
                    }
                }
                let bounds = qp.u_lower[k * nu..].iter().zip(&qp.u_upper[k * nu..]);
                u.iter_mut().zip(bounds).for_each(|(u, (l, h))| *u = u.max(*l).min(*h));
                qp.step(k, own, u, &mut after[..nx]);
            }
            let cost = qp.objective(x, u, price);
            if which == 0 || cost < least {
                least = cost;
                let own = self.point.u.iter().zip(u.iter()).zip(&self.held_u);
                u0.iter_mut().zip(own).for_each(|(u, ((point, step), held))| *u = point + step - held);
            }
        }
    }

    /// The first control is this one: until [`Linearisation::embed_control_bounds`].
    pub fn fix_first_control(&mut self, u: &[f64]) {
        for (j, u) in u.iter().enumerate() {
            let step = u - self.point.u[j];
            (self.qp.u_lower[j], self.qp.u_upper[j]) = (step, step);
        }
    }

    /// What it costs to meet rows one by one, per unit of violation: the scale of prices.
    pub fn cost_of_rows(&mut self) -> f64 {
        self.solver.cost_of_rows(&self.qp)
    }

    /// Does the last solution violate rows that have no price of their own?
    pub fn violates(&self) -> bool {
        self.solver.violates(&self.qp)
    }

    /// By how much the controls of every stage, `[n · nu · nx]`, follow a change of its state where no constraint is active; false where
    /// there is no program.
    pub fn gains(&self, out: &mut [f64]) -> bool {
        self.ready && self.solver.gains(out)
    }

    /// The first control without regard of constraints but its own bounds.
    pub fn tangent_control(&mut self, x0: &[f64], u0: &mut [f64]) {
        self.difference(x0);
        let step = self.solver.tangent(&self.qp, &self.dx0);
        let bounds = self.qp.u_lower.iter().zip(&self.qp.u_upper);
        for ((u, (point, step)), (l, h)) in u0.iter_mut().zip(self.point.u.iter().zip(step)).zip(bounds) {
            *u = point + step.max(*l).min(*h);
        }
    }

    /// What a step adds to the cost by the program; rows that may not be violated have `price` per unit.
    pub fn predicted_change(&self, step: &Step, price: f64) -> f64 {
        debug_assert_eq!(step.of, self.stamp, "a step of another linearisation");
        self.qp.objective(&step.solution.x, &step.solution.u, price)
    }

    /// The last solution with states and multipliers, as a step of this point.
    pub fn step(&mut self, out: &mut Step) {
        out.of = self.stamp;
        self.solver.expand(&self.qp, &mut out.solution);
        let less = |v: &mut [f64], by: &[f64]| v.iter_mut().zip(by).for_each(|(v, b)| *v -= b);
        less(&mut out.solution.x, &self.held_x);
        less(&mut out.solution.u, &self.held_u);
    }

    /// Of a step that belongs to this point only a share `t` is to be made: the rest is taken off this and all later solutions.
    pub fn hold(&mut self, step: &mut Step, t: f64) {
        debug_assert_eq!(step.of, self.stamp, "a step of another linearisation");
        let rest = |held: &mut [f64], v: &mut [f64]| {
            for (held, v) in held.iter_mut().zip(v) {
                *held += (1.0 - t) * *v;
                *v *= t;
            }
        };
        rest(&mut self.held_x, &mut step.solution.x);
        rest(&mut self.held_u, &mut step.solution.u);
    }

    /// The point a share `t` of a step leads to; multipliers are those of the step at `t = 1`.
    pub fn advance(&self, step: &Step, t: f64, out: &mut Iterate) {
        debug_assert_eq!(step.of, self.stamp, "a step of another linearisation");
        let s: &QpSolution = &step.solution;
        let blend = |to: &mut [f64], from: &[f64], by: &[f64]| {
            to.iter_mut().zip(from.iter().zip(by)).for_each(|(o, (p, d))| *o = p + t * d);
        };
        blend(&mut out.x, &self.point.x, &s.x);
        blend(&mut out.u, &self.point.u, &s.u);
        let mix = |to: &mut [f64], from: &[f64], by: &[f64]| {
            to.iter_mut().zip(from.iter().zip(by)).for_each(|(o, (p, d))| *o = p + t * (d - p));
        };
        mix(&mut out.lambda, &self.point.lambda, &s.lambda);
        mix(&mut out.u_mu, &self.point.u_mu, &s.u_mu);
        mix(&mut out.row_mu, &self.point.row_mu, &s.row_mu);
    }

    /// Moves the guess of the active set by a stage.
    pub fn shift(&mut self) {
        self.solver.shift(&self.qp);
    }

    /// Forgets program and guesses.
    pub fn reset(&mut self) {
        self.ready = false;
        self.solver.reset();
        self.forget_updates();
    }
}
