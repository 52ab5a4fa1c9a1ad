//! Costs at the nodes: gradients and Hessians.

use super::evaluate::Many;
use super::nodes::Nodes;
use crate::func::EvalResult;
use crate::ocp::CostAt;
use crate::qp::StageQp;
use crate::system::SharedFunction;

/// `s_k (f − y_k)ᵀ W (f − y_k)` at a range of nodes.
pub(super) struct Squares {
    pub f: Many,
    /// First node; as many follow as there are points.
    pub first: usize,
    /// Multiplied by the lengths of the stages: an integral, by its value at the start of every stage.
    pub by_length: bool,
    /// `W`, `[n_out²]`, symmetric; whether it is diagonal.
    pub weights: Vec<f64>,
    /// Those that count from the next preparation on, where there are any.
    next_weights: Vec<f64>,
    has_next: bool,
    diagonal: bool,
    /// `y`, one for every node.
    pub references: Vec<f64>,
    weighted: Vec<f64>,
    rows: Vec<f64>,
}

/// A cost without further structure, `s_k L(x, u)`.
pub(super) struct General {
    f: Many,
    first: usize,
    by_length: bool,
}

/// All costs.
pub(super) struct Costs {
    pub squares: Vec<Squares>,
    pub general: Vec<General>,
    row: Vec<f64>,
}

/// Nodes of a term: the starts of the stages, their ends, or the last.
fn nodes_of(place: CostAt, n: usize) -> (usize, usize) {
    match place {
        CostAt::Running => (0, n),
        CostAt::ControlGrid => (1, n),
        CostAt::Terminal => (n, 1),
    }
}

/// Hessian blocks that are put together apart from the program, because they may have to be made convex: `[(n + 1) · (nx + nu)²]`,
/// lower triangles.
pub(super) type Blocks<'a> = Option<&'a mut [f64]>;

impl Squares {
    pub fn new(
        f: &SharedFunction,
        weights: &[f64],
        references: &[f64],
        place: CostAt,
        n: usize,
        second: bool,
    ) -> Squares {
        let (first, count) = nodes_of(place, n);
        let f = Many::new(f, count, second);
        let r = f.n_out();
        let mut own = Squares {
            first,
            by_length: place == CostAt::Running,
            weights: vec![0.0; r * r],
            next_weights: vec![0.0; r * r],
            has_next: false,
            diagonal: true,
            references: vec![0.0; r * count],
            weighted: vec![0.0; r * count],
            rows: vec![0.0; r * (f.dims.x + f.dims.u)],
            f,
        };
        own.keep_weights(weights);
        own.take_weights();
        own.set_references(references);
        own
    }

    /// The diagonal of `W`, or all of it, of which the symmetric part counts: from [`Squares::take_weights`] on.
    pub fn keep_weights(&mut self, weights: &[f64]) {
        let r = self.f.n_out();
        let diagonal = weights.len() == r;
        self.has_next = true;
        for (k, own) in self.next_weights.iter_mut().enumerate() {
            *own = match diagonal {
                true if k % (r + 1) == 0 => weights[k / (r + 1)],
                true => 0.0,
                false => 0.5 * (weights[k] + weights[k % r * r + k / r]),
            };
        }
    }

    /// Takes over what was kept; is there something?
    pub fn take_weights(&mut self) -> bool {
        if !self.has_next {
            return false;
        }
        let r = self.f.n_out();
        std::mem::swap(&mut self.weights, &mut self.next_weights);
        self.diagonal = self.weights.iter().enumerate().all(|(k, w)| k % (r + 1) == 0 || *w == 0.0);
        std::mem::take(&mut self.has_next)
    }

    /// One reference for all nodes, or one for each.
    pub fn set_references(&mut self, y: &[f64]) {
        let r = self.f.n_out();
        for (k, own) in self.references.chunks_exact_mut(r.max(1)).enumerate() {
            let from = if y.len() > r { k * r } else { 0 };
            own.copy_from_slice(&y[from..from + r]);
        }
    }

    /// Lengths of references: for one node, for all.
    pub fn reference_sizes(&self) -> [usize; 2] {
        [self.f.n_out(), self.references.len()]
    }

    fn scale(&self, nodes: &Nodes, point: usize) -> f64 {
        if self.by_length {
            nodes.h[self.first + point]
        } else {
            1.0
        }
    }

    /// Values, and `2 s W (f − y)`; the cost itself.
    fn values(&mut self, nodes: &Nodes, x: &[f64], u: &[f64]) -> std::result::Result<f64, crate::func::EvalError> {
        let (r, count) = (self.f.n_out(), self.f.n);
        for q in 0..count {
            nodes.put(self.first + q, x, u, &mut self.f, q);
        }
        self.f.values()?;
        let mut cost = 0.0;
        for q in 0..count {
            let s = self.scale(nodes, q);
            let gap = |i: usize| self.f.value[i * count + q] - self.references[q * r + i];
            for i in 0..r {
                let w: f64 = if self.diagonal {
                    self.weights[i * (r + 1)] * gap(i)
                } else {
                    (0..r).map(|j| self.weights[i * r + j] * gap(j)).sum()
                };
                cost += s * w * gap(i);
                self.weighted[q * r + i] = 2.0 * s * w;
            }
        }
        Ok(cost)
    }

    /// What other references `y` change at a point: adds the change of the gradient, and returns that of the cost. The references stay.
    fn change(
        &mut self,
        nodes: &Nodes,
        [x, u, y]: [&[f64]; 3],
        [gx, gu, row]: [&mut [f64]; 3],
    ) -> std::result::Result<f64, crate::func::EvalError> {
        self.values(nodes, x, u)?;
        self.f.jacobians()?;
        let (r, count) = (self.f.n_out(), self.f.n);
        let mut cost = 0.0;
        for q in 0..count {
            let s = self.scale(nodes, q);
            let from = if y.len() > r { q * r } else { 0 };
            let shift = |i: usize| self.references[q * r + i] - y[from + i];
            for i in 0..r {
                // (f − y)' W (f − y) with f − y = gap + shift
                let w: f64 = (0..r).map(|j| self.weights[i * r + j] * shift(j)).sum();
                let gap = self.f.value[i * count + q] - self.references[q * r + i];
                cost += s * w * (2.0 * gap + shift(i));
                self.weighted[q * r + i] = 2.0 * s * w;
            }
        }
        self.add_gradient(nodes, gx, gu, row);
        Ok(cost)
    }

    fn evaluate(&mut self, nodes: &Nodes, x: &[f64], u: &[f64], second: bool) -> EvalResult {
        self.values(nodes, x, u)?;
        self.f.jacobians()?;
        if second && !self.f.is_affine() {
            let r = self.f.n_out();
            for q in 0..self.f.n {
                let weighted = &self.weighted[q * r..(q + 1) * r];
                self.f.set_weights(q, weighted.iter().copied());
            }
            self.f.hessians()?;
        }
        Ok(())
    }

    fn add_gradient(&self, nodes: &Nodes, gx: &mut [f64], gu: &mut [f64], row: &mut [f64]) {
        let (r, count) = (self.f.n_out(), self.f.n);
        for q in 0..count {
            row.fill(0.0);
            for (e, &(i, c)) in self.f.jac_entries.iter().enumerate() {
                let v = self.f.jac[e * count + q] * self.weighted[q * r + i];
                nodes.add_derivative(self.first + q, c, v, row);
            }
            give(nodes, self.first + q, row, gx, gu);
        }
    }

    /// Adds `2 s Jᵀ W J`.
    fn add_hessian(&mut self, nodes: &Nodes, qp: &mut StageQp) {
        let (r, count, width) = (self.f.n_out(), self.f.n, nodes.nx + nodes.nu);
        for q in 0..count {
            let k = self.first + q;
            let rows = &mut self.rows[..r * width];
            rows.fill(0.0);
            for (e, &(i, c)) in self.f.jac_entries.iter().enumerate() {
                nodes.add_derivative(k, c, self.f.jac[e * count + q], &mut rows[i * width..(i + 1) * width]);
            }
            let s = 2.0 * if self.by_length { nodes.h[k] } else { 1.0 };
            for i in 0..r {
                for j in 0..r {
                    let w = s * self.weights[i * r + j];
                    if w != 0.0 {
                        add_product(qp, k, w, &rows[i * width..(i + 1) * width], &rows[j * width..(j + 1) * width]);
                    }
                }
            }
        }
    }
}

/// Adds `w l rᵀ` to the Hessian of a node.
fn add_product(qp: &mut StageQp, k: usize, w: f64, left: &[f64], right: &[f64]) {
    let (nx, nu) = (qp.nx, qp.nu);
    let last = k == qp.n;
    for (a, &l) in left.iter().enumerate().filter(|e| *e.1 != 0.0) {
        for (b, &r) in right.iter().enumerate().filter(|e| *e.1 != 0.0) {
            let v = w * l * r;
            if a < nx && b < nx {
                qp.hess_x[k * nx * nx + a + b * nx] += v;
            } else if last {
                continue;
            } else if a >= nx && b < nx {
                qp.hess_xu[k * nu * nx + (a - nx) + b * nu] += v;
            } else if a >= nx {
                qp.hess_u[k * nu * nu + (a - nx) + (b - nx) * nu] += v;
            }
        }
    }
}

/// A row of derivatives by `(x, u)` to the gradients of a node.
pub(super) fn give(nodes: &Nodes, k: usize, row: &[f64], gx: &mut [f64], gu: &mut [f64]) {
    let (nx, nu) = (nodes.nx, nodes.nu);
    gx[k * nx..(k + 1) * nx].iter_mut().zip(row).for_each(|(g, v)| *g += v);
    if k < nodes.n {
        gu[k * nu..(k + 1) * nu].iter_mut().zip(&row[nx..]).for_each(|(g, v)| *g += v);
    }
}

/// Adds the Hessian entries of point `q` of a function to the block of its node, with the derivatives of the algebraic states.
pub(super) fn add_block(nodes: &Nodes, f: &Many, q: usize, k: usize, blocks: &mut [f64]) {
    let width = nodes.nx + nodes.nu;
    let n_inputs = nodes.nx + nodes.nz + nodes.nu;
    let block = &mut blocks[k * width * width..(k + 1) * width * width];
    for (e, &(i, j)) in f.hess_entries.iter().enumerate() {
        let v = f.hess[e * f.n + q] * if i == j { 0.5 } else { 1.0 };
        if v == 0.0 || i >= n_inputs || j >= n_inputs {
            continue;
        }
        for b in 0..width {
            let (rb, lb) = (entry(nodes, k, j, b), entry(nodes, k, i, b));
            if rb == 0.0 && lb == 0.0 {
                continue;
            }
            for a in b..width {
                block[a + b * width] += v * (entry(nodes, k, i, a) * rb + entry(nodes, k, j, a) * lb);
            }
        }
    }
}

/// Derivative of input column `c` by entry `b` of `(x, u)` at node `k`.
fn entry(nodes: &Nodes, k: usize, c: usize, b: usize) -> f64 {
    let (nx, nz) = (nodes.nx, nodes.nz);
    if k == nodes.n && b >= nx {
        0.0
    } else if c < nx {
        f64::from(c == b)
    } else if c < nx + nz {
        nodes.z_by[(k * nz + c - nx) * (nx + nodes.nu) + b]
    } else {
        f64::from(c - nz == b)
    }
}

impl General {
    pub fn new(f: &SharedFunction, place: CostAt, n: usize) -> General {
        let (first, count) = nodes_of(place, n);
        General { f: Many::new(f, count, true), first, by_length: place == CostAt::Running }
    }

    fn scale(&self, nodes: &Nodes, q: usize) -> f64 {
        if self.by_length {
            nodes.h[self.first + q]
        } else {
            1.0
        }
    }

    fn values(&mut self, nodes: &Nodes, x: &[f64], u: &[f64]) -> std::result::Result<f64, crate::func::EvalError> {
        for q in 0..self.f.n {
            nodes.put(self.first + q, x, u, &mut self.f, q);
        }
        self.f.values()?;
        Ok((0..self.f.n).map(|q| self.scale(nodes, q) * self.f.value[q]).sum())
    }

    fn evaluate(&mut self, nodes: &Nodes, x: &[f64], u: &[f64]) -> EvalResult {
        self.values(nodes, x, u)?;
        self.f.jacobians()?;
        for q in 0..self.f.n {
            let s = self.scale(nodes, q);
            self.f.set_weights(q, std::iter::once(s));
        }
        self.f.hessians()
    }

    fn add_gradient(&self, nodes: &Nodes, gx: &mut [f64], gu: &mut [f64], row: &mut [f64]) {
        for q in 0..self.f.n {
            row.fill(0.0);
            let s = self.scale(nodes, q);
            for (e, &(_, c)) in self.f.jac_entries.iter().enumerate() {
                nodes.add_derivative(self.first + q, c, s * self.f.jac[e * self.f.n + q], row);
            }
            give(nodes, self.first + q, row, gx, gu);
        }
    }
}

impl Costs {
    pub fn new(squares: Vec<Squares>, general: Vec<General>, width: usize) -> Costs {
        Costs { squares, general, row: vec![0.0; width] }
    }

    /// Is the cost quadratic in states and controls?
    pub fn is_quadratic(&self) -> bool {
        self.general.is_empty() && self.squares.iter().all(|s| s.f.is_affine())
    }

    /// Values and derivatives at a point, kept for [`Costs::add_gradient`] and [`Costs::add_hessian`].
    pub fn evaluate(&mut self, nodes: &Nodes, x: &[f64], u: &[f64], second: bool) -> EvalResult {
        self.squares.iter_mut().try_for_each(|s| s.evaluate(nodes, x, u, second))?;
        self.general.iter_mut().try_for_each(|g| g.evaluate(nodes, x, u))
    }

    /// The cost of a point.
    pub fn value(&mut self, nodes: &Nodes, x: &[f64], u: &[f64]) -> std::result::Result<f64, crate::func::EvalError> {
        let mut sum = 0.0;
        for s in &mut self.squares {
            sum += s.values(nodes, x, u)?;
        }
        for g in &mut self.general {
            sum += g.values(nodes, x, u)?;
        }
        Ok(sum)
    }

    /// What references `y` of term `k` would change at `(x, u)`: of the gradient, added to `gx` and `gu`, and of the cost.
    pub fn change_references(
        &mut self,
        nodes: &Nodes,
        k: usize,
        [x, u, y]: [&[f64]; 3],
        [gx, gu]: [&mut [f64]; 2],
    ) -> std::result::Result<f64, crate::func::EvalError> {
        self.squares[k].change(nodes, [x, u, y], [gx, gu, &mut self.row])
    }

    pub fn add_gradient(&mut self, nodes: &Nodes, gx: &mut [f64], gu: &mut [f64]) {
        let row = &mut self.row;
        self.squares.iter().for_each(|s| s.add_gradient(nodes, gx, gu, row));
        self.general.iter().for_each(|g| g.add_gradient(nodes, gx, gu, row));
    }

    /// Adds the Gauss-Newton Hessians of the squares to the program, and to `blocks` what need not be convex: Hessians of costs
    /// without structure, and with `second` the curvature of residuals.
    pub fn add_hessian(&mut self, nodes: &Nodes, qp: &mut StageQp, blocks: Blocks, second: bool) {
        self.squares.iter_mut().for_each(|s| s.add_hessian(nodes, qp));
        let Some(blocks) = blocks else { return };
        for g in &self.general {
            (0..g.f.n).for_each(|q| add_block(nodes, &g.f, q, g.first + q, blocks));
        }
        if second {
            for s in self.squares.iter().filter(|s| !s.f.is_affine()) {
                (0..s.f.n).for_each(|q| add_block(nodes, &s.f, q, s.first + q, blocks));
            }
        }
    }
}
