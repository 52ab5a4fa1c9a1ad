//! Derivatives of accelerations and forces, by differentiating the equations they solve.
//!
//! With `R = M a − f_v − Σ (n λ + B τ)` and the held components `C = (g̈, ṡ)`, both at fixed `a` and forces,
//!
//! ```text
//! M da − F dλ = −∂R/∂z,    G da = −∂C/∂z
//! ```
//!
//! where the columns `z` are state, parameters, controls, time. Impacts solve the same equations with the change of velocity
//! in the place of `a` and impulses in that of forces.

use std::sync::Arc;

use super::dynamics::{dot, At, Dynamics};
use super::mode;
use crate::func::{EvalResult, Function, Point};
use crate::system::{Inertia, Kind};

/// Where the columns of a pattern go: `x`, `u`, `p` and what follows it, `t` become `x`, `p`, `u`, `t`; none for what stands
/// behind the parameters.
#[derive(Clone)]
pub(super) struct Columns {
    nx: usize,
    nu: usize,
    np: usize,
    /// Derivatives along this direction take the place of all columns.
    along: Option<Arc<[f64]>>,
}

impl Columns {
    pub(super) fn of(&self, col: usize, last: usize) -> Option<usize> {
        let Columns { nx, nu, np, .. } = *self;
        match col {
            c if c == last => Some(nx + np + nu),
            c if c < nx => Some(c),
            c if c < nx + nu => Some(c + np),
            c if c < nx + nu + np => Some(c - nu),
            _ => None,
        }
    }

    /// Number of columns.
    pub(super) fn n(&self) -> usize {
        match self.along {
            None => self.nx + self.nu + self.np + 1,
            Some(_) => 1,
        }
    }
}

/// Adds `sign` times the derivatives of `f` to rows of `n_z` columns: output `i` to row `rows(i)`.
pub(super) fn add_jacobian(
    f: &dyn Function,
    at: &At,
    columns: &Columns,
    rows: &dyn Fn(usize) -> Option<(usize, f64)>,
    out: &mut [f64],
    room: (&mut [f64], &mut [f64]),
) -> EvalResult {
    let p = f.jac_pattern();
    if p.nnz() == 0 {
        return Ok(());
    }
    f.jacobian(at, &mut room.0[..p.nnz()], room.1)?;
    let (last, n_z) = (p.n_cols() - 1, columns.n());
    for col in 0..p.n_cols() {
        let Some(to) = columns.of(col, last) else { continue };
        let (to, weight) = match &columns.along {
            None => (to, 1.0),
            Some(along) if along[to] == 0.0 => continue,
            Some(along) => (0, along[to]),
        };
        for e in p.range(col) {
            if let Some((row, sign)) = rows(p.row_idx()[e]) {
                out[row * n_z + to] += sign * weight * room.0[e];
            }
        }
    }
    Ok(())
}

/// What a derivative is taken of: accelerations and forces, or changes of velocity and impulses.
pub(super) struct Given<'a> {
    /// Accelerations.
    pub(super) a: &'a [f64],
    /// Forces of all contacts.
    pub(super) forces: &'a [super::Forces],
    /// Modes of all contacts.
    pub(super) modes: &'a [Vec<usize>],
}

/// Memory of those who differentiate.
#[derive(Default)]
pub(super) struct Linearised {
    a: Vec<f64>,
    forces: Vec<super::Forces>,
    /// Derivatives of what is held, of its forces, and of the friction of a contact, row-major.
    held: Vec<f64>,
    rates: Vec<f64>,
    friction: Vec<f64>,
    column: Vec<f64>,
    lambda: Vec<f64>,
    /// Of the whole state and of all forces.
    pub(super) jacobian: Vec<f64>,
    pub(super) of_forces: Vec<f64>,
    pub(super) row: Vec<f64>,
}

/// As many zeros.
pub(super) fn zeros(v: &mut Vec<f64>, n: usize) -> &mut [f64] {
    v.clear();
    v.resize(n, 0.0);
    v
}

impl Dynamics {
    pub(super) fn columns(&self, at: &At) -> Columns {
        Columns { nx: at.x.len(), nu: at.u.len(), np: at.p.len(), along: self.along.clone() }
    }

    /// Adds `∂/∂z (M a − Σ (n λ + B τ))` at fixed `a` and forces to rows of `out`, with the dependence of the friction of
    /// sliding contacts on everything but `λ`.
    pub(super) fn add_reactions(&mut self, at: &At, given: &Given, out: &mut [f64]) -> EvalResult {
        let m = self.mechanics.clone();
        let (n_v, columns) = (m.n_v, self.columns(at));
        let n_z = columns.n();
        if let Inertia::Varying { product, .. } = &m.inertia {
            self.extend(at, None, given.a, &[]);
            let room = (&mut self.buffer[..], &mut self.work[..]);
            let there = Point { p: &self.extended, ..*at };
            add_jacobian(product.as_ref(), &there, &columns, &|i| Some((i, 1.0)), out, room)?;
        }
        for (i, set) in given.modes.iter().enumerate() {
            if set[0] == mode::OPEN {
                continue;
            }
            let c = &m.contacts[i];
            self.extend(at, Some(i), given.a, &given.forces[i][..1 + c.n_tangents]);
            let there = Point { p: &self.extended, ..*at };
            let room = (&mut self.buffer[..], &mut self.work[..]);
            let force = |i: usize| (i < n_v).then_some((i, -1.0));
            add_jacobian(c.reaction.as_ref(), &there, &columns, &force, out, room)?;
            if !Dynamics::slides(set[0]) {
                continue;
            }
            // τ = −μ λ d: λ ∂(μ d) along the tangents
            let mut own = std::mem::take(&mut self.linearised.friction);
            self.friction_direction(at, i, set[0], &mut own)?;
            let (lambda, b) = (given.forces[i][0], &self.blocks[i]);
            for (k, row) in own.chunks_exact(n_z).enumerate() {
                for (z, v) in row.iter().enumerate().filter(|(_, v)| **v != 0.0) {
                    for (r, t) in b.tangent(k).iter().enumerate() {
                        out[r * n_z + z] += lambda * v * t;
                    }
                }
            }
            self.linearised.friction = own;
        }
        Ok(())
    }

    /// Derivatives of friction and sliding velocity of contact `i`, one row after the other.
    pub(super) fn add_motion(&mut self, at: &At, i: usize, columns: &Columns, out: &mut [f64]) -> EvalResult {
        let c = &self.mechanics.contacts[i];
        let (n_v, room) = (self.mechanics.n_v, (&mut self.buffer[..], &mut self.work[..]));
        let row = |r: usize| match r {
            1 => Some((0, 1.0)),
            r => c.sliding_at(n_v, r).map(|k| (1 + k, 1.0)),
        };
        let weights = if c.kind == Kind::Switch { &self.weights[..] } else { &[] };
        let there = Dynamics::weighted(weights, &mut self.extended, at);
        add_jacobian(c.motion.as_ref(), &there, columns, &row, out, room)
    }

    /// Derivatives of the coefficient of friction of contact `i` for sticking, added to a row.
    pub(super) fn add_bound(&mut self, at: &At, i: usize, columns: &Columns, out: &mut [f64]) -> EvalResult {
        let c = &self.mechanics.contacts[i];
        if c.kind == Kind::Switch {
            // its bound is 1
            return Ok(());
        }
        let (place, room) = (c.stiction_at(self.mechanics.n_v), (&mut self.buffer[..], &mut self.work[..]));
        let row = |r: usize| (r == place).then_some((0, 1.0));
        add_jacobian(c.motion.as_ref(), at, columns, &row, out, room)
    }

    /// Derivatives of `μ d` of a contact that slides, `d` the direction it slides in, one row for every tangent.
    fn friction_direction(&mut self, at: &At, i: usize, m: usize, own: &mut Vec<f64>) -> EvalResult {
        let (n_t, columns) = (self.mechanics.contacts[i].n_tangents, self.columns(at));
        let n_z = columns.n();
        self.add_motion(at, i, &columns, zeros(own, (1 + n_t) * n_z))?;
        let (d, b) = (self.direction(i, m), &self.blocks[i]);
        let size = b.sliding[0].hypot(b.sliding[1]);
        let turns = n_t == 2 && !self.has_no_direction(i);
        let (dmu, ds) = own.split_at_mut(n_z);
        for z in 0..n_z {
            let along = if turns { d[0] * ds[z] + d[1] * ds[n_z + z] } else { 0.0 };
            for k in 0..n_t {
                let turn = if turns { (ds[k * n_z + z] - d[k] * along) / size } else { 0.0 };
                ds[k * n_z + z] = dmu[z] * d[k] + b.friction * turn;
            }
        }
        own.drain(..n_z);
        Ok(())
    }

    /// Adds the gradient of the gap of contact `i` to a row, and that of its rate to the next one if there is one.
    pub(crate) fn gap_gradient(&mut self, at: &At, i: usize, out: &mut [f64]) -> EvalResult {
        let columns = self.columns(at);
        let n_rows = out.len() / columns.n();
        let room = (&mut self.buffer[..], &mut self.work[..]);
        let pick = |k: usize| (k < n_rows).then_some((k, 1.0));
        add_jacobian(self.mechanics.contacts[i].gap.as_ref(), at, &columns, &pick, out, room)
    }

    /// Adds the gradients of friction and sliding velocity of contact `i` to rows.
    pub(crate) fn friction_gradients(&mut self, at: &At, i: usize, out: &mut [f64]) -> EvalResult {
        let columns = self.columns(at);
        self.add_motion(at, i, &columns, out)
    }

    /// Adds the gradient of the coefficient of friction of contact `i` for sticking to a row.
    pub(crate) fn bound_gradient(&mut self, at: &At, i: usize, out: &mut [f64]) -> EvalResult {
        let columns = self.columns(at);
        self.add_bound(at, i, &columns, out)
    }

    /// The parameters, then accelerations and forces, as the functions of a contact, or of none, take them: those of a switch know the
    /// weights of all switches, and where its own is given it has no force.
    pub(super) fn extend(&mut self, at: &At, contact: Option<usize>, a: &[f64], forces: &[f64]) {
        let switch = contact.and_then(|i| self.switch(i));
        self.extended.clear();
        self.extended.extend_from_slice(at.p);
        if switch.is_some() {
            self.extended.extend_from_slice(&self.weights);
        }
        self.extended.extend_from_slice(a);
        match switch.filter(|k| self.weights[*k] != 0.0) {
            Some(_) => self.extended.resize(self.extended.len() + forces.len(), 0.0),
            None => self.extended.extend_from_slice(forces),
        }
    }

    /// Jacobian of the derivative of the state under the modes of all contacts, row-major with the columns `x`, `p`, `u`,
    /// `t`; with `forces` also that of the forces, three rows for every contact.
    pub(crate) fn jacobian(
        &mut self,
        at: &At,
        modes: &[Vec<usize>],
        out: &mut [f64],
        forces: Option<&mut [f64]>,
    ) -> EvalResult {
        self.accelerate(at, modes)?;
        self.linearise(at, modes, out, forces)
    }

    /// Derivatives of accelerations and forces along the motion: of the state (`n_q + n_v` values), and three for every
    /// contact.
    pub(super) fn along_motion(
        &mut self,
        at: &At,
        modes: &[Vec<usize>],
        out: &mut [f64],
        forces: &mut [f64],
    ) -> EvalResult {
        self.accelerate(at, modes)?;
        let n_q = self.mechanics.n_q;
        let mut flow = vec![0.0; at.x.len() + at.p.len() + at.u.len() + 1];
        flow[..at.x.len()].copy_from_slice(&self.smooth);
        flow[n_q..n_q + self.acceleration.len()].copy_from_slice(&self.acceleration);
        if let Some(t) = flow.last_mut() {
            *t = 1.0;
        }
        self.along = Some(flow.into());
        let r = self.linearise(at, modes, out, Some(forces));
        if r.is_err() {
            self.along = None;
        }
        r
    }

    /// Derivatives are those of all columns again.
    pub(super) fn along_nothing(&mut self) {
        self.along = None;
    }

    /// Differentiates the equations of motion at the point of the last accelerations.
    fn linearise(
        &mut self,
        at: &At,
        modes: &[Vec<usize>],
        out: &mut [f64],
        mut forces: Option<&mut [f64]>,
    ) -> EvalResult {
        let m = self.mechanics.clone();
        let (n_q, n_v, columns) = (m.n_q, m.n_v, self.columns(at));
        let n_z = columns.n();
        out.fill(0.0);
        let room = (&mut self.buffer[..], &mut self.work[..]);
        // the rows of velocities are those of equations that are solved below
        let sign = |i: usize| Some((i, if (n_q..n_q + n_v).contains(&i) { -1.0 } else { 1.0 }));
        let there = Dynamics::weighted(&self.weights, &mut self.extended, at);
        add_jacobian(m.smooth.as_ref(), &there, &columns, &sign, out, room)?;
        let mut l = std::mem::take(&mut self.linearised);
        l.a.clone_from(&self.acceleration);
        l.forces.clone_from(&self.forces);
        let given = Given { a: &l.a, forces: &l.forces, modes };
        self.add_reactions(at, &given, &mut out[n_q * n_z..])?;
        let held = zeros(&mut l.held, self.rows.len() * n_z);
        for r in 0..self.rows.len() {
            let row = self.rows[r];
            let c = &m.contacts[row.contact];
            self.extend(at, Some(row.contact), &l.a, &l.forces[row.contact][..1 + c.n_tangents]);
            let there = Point { p: &self.extended, ..*at };
            let room = (&mut self.buffer[..], &mut self.work[..]);
            let pick = |i: usize| (i == n_v + row.component).then_some((r, 1.0));
            add_jacobian(c.reaction.as_ref(), &there, &columns, &pick, held, room)?;
        }
        self.solve_linearised(&mut out[n_q * n_z..], &mut l, n_z);
        if let Some(forces) = &mut forces {
            forces.fill(0.0);
            for (row, rates) in self.rows.iter().zip(l.rates.chunks_exact(n_z)) {
                let to = (3 * row.contact + row.component) * n_z;
                forces[to..to + n_z].copy_from_slice(rates);
            }
            self.add_friction(at, modes, forces, &mut l.friction)?;
        }
        self.linearised = l;
        Ok(())
    }

    /// Solves `M da − F dλ = −R`, `G da = −C` for all columns: `R` (`n_v` rows) becomes `da`, and `C` what is held; writes
    /// `dλ` to the rates.
    fn solve_linearised(&mut self, r: &mut [f64], l: &mut Linearised, n_z: usize) {
        let n_v = self.mechanics.n_v;
        let m = self.rows.len();
        let (column, lambda) = (zeros(&mut l.column, n_v), zeros(&mut l.lambda, m));
        let all = zeros(&mut l.rates, m * n_z);
        for z in 0..n_z {
            (0..n_v).for_each(|i| column[i] = -r[i * n_z + z]);
            self.mass.solve(column);
            for (i, row) in self.rows.iter().enumerate() {
                lambda[i] = -l.held[i * n_z + z] - dot(self.blocks[row.contact].row(row.component), column);
            }
            if m > 0 {
                self.held.solve(lambda);
            }
            for (i, y) in self.y.chunks_exact(n_v).enumerate() {
                column.iter_mut().zip(y).for_each(|(c, y)| *c += lambda[i] * y);
                all[i * n_z + z] = lambda[i];
            }
            (0..n_v).for_each(|i| r[i * n_z + z] = column[i]);
        }
    }

    /// The friction of sliding contacts follows their normal forces: rows `τ` from rows `λ`.
    fn add_friction(
        &mut self,
        at: &At,
        modes: &[Vec<usize>],
        forces: &mut [f64],
        turning: &mut Vec<f64>,
    ) -> EvalResult {
        let n_z = self.columns(at).n();
        for (i, set) in modes.iter().enumerate().filter(|(_, s)| Dynamics::slides(s[0])) {
            self.friction_direction(at, i, set[0], turning)?;
            let (d, mu, lambda) = (self.direction(i, set[0]), self.blocks[i].friction, self.forces[i][0]);
            let (normal, tangential) = forces[3 * i * n_z..(3 * i + 3) * n_z].split_at_mut(n_z);
            for (k, (own, turning)) in tangential.chunks_exact_mut(n_z).zip(turning.chunks_exact(n_z)).enumerate() {
                for ((o, dl), v) in own.iter_mut().zip(normal.iter()).zip(turning) {
                    *o = -d[k] * mu * dl - lambda * v;
                }
            }
        }
        Ok(())
    }
}
