//! Impacts: velocities behind them, and the derivatives of these.
//!
//! ```text
//! M (v⁺ − v⁻) = Σ_i (n_i Λ_i + B_i T_i),    0 ≤ Λ_i ⊥ ġ_i⁺ + e_i ġ_i⁻ ≥ 0,    friction between T_i and s_i⁺
//! ```
//!
//! Newton's law of restitution with Coulomb's law for impulses, J. J. Moreau, *Unilateral contact and dry friction in finite
//! freedom dynamics*, in: Nonsmooth Mechanics and Applications (1988); (8.3), (8.4) of the thesis for one contact without
//! friction.
//!
//! Constraints are held, `ċ⁺ = 0` by a `Λ` of either sign; friction at joints is a finite force and has no impulse. What sticks by more
//! than it slides with does so under forces: impulses know the coefficient of sliding only.

use super::dynamics::{dot, At, Dynamics, Forces, Row};
use super::least_norm::LeastNorm;
use super::mode;
use super::problem::{Part, Problem, Solution, Solutions, State};
use super::sensitivity::{add_jacobian, Given};
use crate::func::{EvalError, EvalResult, Point};
use crate::system::{Inertia, Kind};

/// What one contact contributes to an impact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Impulse {
    /// The contact.
    pub(crate) contact: usize,
    /// Rate of its gap before and behind.
    pub(crate) rates: [f64; 2],
    /// Normal and tangential impulses.
    pub(crate) impulse: Forces,
    /// Its state during the impact.
    pub(crate) state: State,
    /// The restitution that counted.
    pub(crate) restitution: f64,
    /// A normal impulse that is rounding of the velocities before.
    pub(crate) noise: f64,
    /// What rounding of all impulses may make of the rate behind.
    pub(crate) rounding: f64,
}

/// An impact.
#[derive(Debug, Clone, Default)]
pub(crate) struct Impact {
    /// Every contact that took part, also those without impulse.
    pub(crate) parts: Vec<Impulse>,
    /// There is one solution only.
    pub(crate) unique: bool,
    /// That there are no other solutions is proven.
    pub(crate) proven: bool,
    /// Other impulses have the same effect.
    pub(crate) redundant: bool,
}

impl Dynamics {
    /// Writes `W = G M⁻¹ Gᵀ` of all components of these contacts to a problem without contacts; `G M⁻¹`, column by column,
    /// is left in the dynamics.
    pub(super) fn delassus(&mut self, contacts: impl Iterator<Item = usize>, problem: &mut Problem) {
        let n_v = self.mechanics.n_v;
        self.forget_rows();
        for contact in contacts {
            let n = self.mechanics.contacts[contact].n_tangents;
            self.rows.extend((0..=n).map(|component| Row { contact, component }));
        }
        for r in &self.rows {
            let from = self.y.len();
            self.y.extend_from_slice(self.blocks[r.contact].column(r.component));
            self.mass.solve(&mut self.y[from..]);
        }
        problem.clear();
        for r in &self.rows {
            let g = self.blocks[r.contact].row(r.component);
            problem.matrix.extend(self.y.chunks_exact(n_v).map(|y| dot(g, y)));
        }
    }

    /// What takes part in an impact of these contacts, where it is not just these: constraints do, and friction at joints does not, as it
    /// is a finite force.
    fn struck(&self, contacts: &[(usize, Option<f64>)]) -> Option<Vec<(usize, Option<f64>)>> {
        let all = &self.mechanics.contacts;
        if all.iter().all(|c| c.kind.opens()) {
            return None;
        }
        let mut list: Vec<_> = contacts.iter().copied().filter(|c| all[c.0].kind == Kind::Unilateral).collect();
        let held = (0..all.len()).filter(|i| all[*i].kind == Kind::Bilateral);
        list.extend(held.map(|i| (i, Some(0.0))));
        Some(list)
    }

    /// Changes the velocities of `x` by an impact of these contacts, which have no gap. `restitution` of each may differ from
    /// that of the model, and `size` is what counts as the size of its rate. None where there is no solution.
    ///
    /// Without a `collision` no contact closes and no forces continue the motion: impulses bring the sliding to rest (Painlevé's
    /// paradox; F. Génot, B. Brogliato, *New results on Painlevé paradoxes*, Eur. J. Mech. A/Solids 18 (1999)).
    pub(crate) fn impact(
        &mut self,
        at: &At,
        contacts: &[(usize, Option<f64>)],
        collision: bool,
        size: &dyn Fn(usize, &Dynamics) -> f64,
        x: &mut [f64],
    ) -> Result<Option<Impact>, EvalError> {
        self.mass.load(&self.mechanics, at, &mut self.work)?;
        let list = self.struck(contacts);
        let contacts = list.as_deref().unwrap_or(contacts);
        for &(i, _) in contacts {
            self.load_gap(at, i)?;
            self.load_contact(at, i)?;
        }
        let mut problem = std::mem::take(&mut self.problem);
        self.delassus(contacts.iter().map(|c| c.0), &mut problem);
        problem.free.resize(self.rows.len(), 0.0);
        let mut first = 0;
        for &(i, e) in contacts {
            let b = &self.blocks[i];
            let e = e.unwrap_or(b.restitution);
            problem.free[first] = (1.0 + e) * b.gap[1];
            let n_t = self.mechanics.contacts[i].n_tangents;
            problem.free[first + 1..=first + n_t].copy_from_slice(&b.sliding[..n_t]);
            let (friction, kind) = (b.friction, self.mechanics.contacts[i].kind);
            let size = size(i, self);
            problem.parts.push(Part {
                first,
                n_t,
                friction,
                stiction: friction,
                kind,
                slides: None,
                given: None,
                size,
            });
            first += 1 + n_t;
        }
        let found = problem.solve(&mut self.room);
        let out = self.impact_of(&problem, &found, contacts, collision, (&at.x[self.mechanics.n_q..], x));
        problem.clear();
        self.problem = problem;
        Ok(out)
    }

    /// The impact that a solution stands for; the velocities of `x` become those behind it.
    fn impact_of(
        &self,
        problem: &Problem,
        found: &Solutions,
        contacts: &[(usize, Option<f64>)],
        collision: bool,
        (before, x): (&[f64], &mut [f64]),
    ) -> Option<Impact> {
        let (n_q, n_v) = (self.mechanics.n_q, self.mechanics.n_v);
        // without a collision nothing at all solves the problem, too: the other solution is meant
        let some = |s: &&Solution| collision || s.r.iter().any(|r| *r != 0.0);
        let s = found.all.iter().find(some)?;
        for (r, y) in s.r.iter().zip(self.y.chunks_exact(n_v)) {
            x[n_q..].iter_mut().zip(y).for_each(|(v, y)| *v += r * y);
        }
        let mut out = Impact {
            unique: found.all.len() == 1,
            proven: found.proven,
            redundant: found.redundant,
            ..Impact::default()
        };
        for (k, &(contact, e)) in contacts.iter().enumerate() {
            let (p, b) = (&problem.parts[k], &self.blocks[contact]);
            let (rate, restitution) = (b.gap[1], e.unwrap_or(b.restitution));
            let mut impulse = [0.0; 3];
            impulse[..=p.n_t].copy_from_slice(&s.r[p.first..=p.first + p.n_t]);
            let after = match s.states[k] {
                // what the law says, without the rounding of the sums
                State::Open => s.z[p.first] - restitution * rate,
                _ => -restitution * rate,
            };
            // velocities that cancel leave their rounding, and that is no impact
            let terms = b.normal.iter().zip(before).map(|(n, v)| (n * v).abs()).sum::<f64>();
            let w = problem.matrix[p.first * self.rows.len() + p.first];
            let noise = if w > 0.0 { 64.0 * f64::EPSILON * terms / w } else { 0.0 };
            let rounding = 64.0 * f64::EPSILON * (terms + problem.scale(p, p.first, &s.r));
            let (rates, state) = ([rate, after], s.states[k]);
            out.parts.push(Impulse { contact, rates, impulse, state, restitution, noise, rounding });
        }
        Some(out)
    }

    /// Derivatives of the state behind an impact with respect to state, parameters, controls and time before it, row-major
    /// with the columns `x`, `p`, `u`, `t`. `at` is before the impact, `after` the state behind it.
    pub(crate) fn impact_jacobian(&mut self, at: &At, after: &[f64], impact: &Impact, out: &mut [f64]) -> EvalResult {
        let m = self.mechanics.clone();
        let (n_q, n_v, columns) = (m.n_q, m.n_v, self.columns(at));
        let n_z = columns.n();
        out.fill(0.0);
        (0..at.x.len()).for_each(|i| out[i * n_z + i] = 1.0);
        let behind = Point { x: after, ..*at };
        let mut modes = vec![vec![mode::OPEN]; m.contacts.len()];
        let mut impulses = vec![[0.0; 3]; m.contacts.len()];
        self.forget_rows();
        for p in impact.parts.iter().filter(|p| p.state != State::Open) {
            let i = p.contact;
            self.load_contact(&behind, i)?;
            impulses[i] = p.impulse;
            self.rows.push(Row { contact: i, component: 0 });
            modes[i][0] = match p.state {
                State::Slides(d) if m.contacts[i].n_tangents == 1 && d[0] < 0.0 => mode::SLIDES_BACK,
                State::Slides(_) => mode::SLIDES,
                _ => {
                    let n = m.contacts[i].n_tangents;
                    self.rows.extend((1..=n).map(|component| Row { contact: i, component }));
                    mode::CLOSED
                }
            };
        }
        let rows = self.rows.clone();
        if rows.is_empty() {
            return Ok(());
        }
        let velocities = m.velocities();
        let delta: Vec<f64> = after[velocities.clone()].iter().zip(&at.x[velocities]).map(|(a, b)| a - b).collect();
        let mut r = vec![0.0; (n_v + rows.len()) * n_z];
        let given = Given { a: &delta, forces: &impulses, modes: &modes };
        self.add_reactions(&behind, &given, &mut r[..n_v * n_z])?;
        for (k, row) in rows.iter().enumerate() {
            let c = &m.contacts[row.contact];
            let place = n_v + k;
            let room = (&mut self.buffer[..], &mut self.work[..]);
            if row.component > 0 {
                let output = 3 + n_v + (row.component - 1) * (2 + n_v);
                let pick = |i: usize| (i == output).then_some((place, 1.0));
                add_jacobian(c.motion.as_ref(), &behind, &columns, &pick, &mut r, room)?;
                continue;
            }
            let part = impact.parts.iter().find(|p| p.contact == row.contact);
            let Some(part) = part else { continue };
            let e = part.restitution;
            let pick = |w: f64| move |i: usize| (i == 1).then_some((place, w));
            add_jacobian(c.gap.as_ref(), &behind, &columns, &pick(1.0), &mut r, (&mut *room.0, &mut *room.1))?;
            if e != 0.0 {
                add_jacobian(c.gap.as_ref(), at, &columns, &pick(e), &mut r, (&mut *room.0, &mut *room.1))?;
                let own = |i: usize| (i == 2).then_some((place, part.rates[0]));
                add_jacobian(c.motion.as_ref(), at, &columns, &own, &mut r, room)?;
            }
        }
        let mut solver = self.impact_matrix(&behind, &modes, &impulses, &rows)?;
        let n = n_v + rows.len();
        let mut column = vec![0.0; n];
        for z in 0..n_z {
            (0..n).for_each(|i| column[i] = -r[i * n_z + z]);
            solver.solve(&mut column);
            (0..n_v).for_each(|i| out[(n_q + i) * n_z + z] += column[i]);
        }
        Ok(())
    }

    /// The matrix of the equations of an impact, factored: `M` with the turning of friction in space, force directions,
    /// what is held.
    fn impact_matrix(
        &mut self,
        at: &At,
        modes: &[Vec<usize>],
        impulses: &[Forces],
        rows: &[Row],
    ) -> Result<LeastNorm, EvalError> {
        let (n_v, m) = (self.mechanics.n_v, rows.len());
        let n = n_v + m;
        let mut solver = LeastNorm::with_capacity(n);
        let a = solver.clear(n);
        match &self.mechanics.inertia {
            Inertia::Identity => (0..n_v).for_each(|i| a[i * n + i] = 1.0),
            Inertia::Constant(e) => {
                (0..n_v).for_each(|i| a[i * n..i * n + n_v].copy_from_slice(&e[i * n_v..(i + 1) * n_v]))
            }
            Inertia::Varying { matrix, .. } => {
                let e = &mut self.buffer[..n_v * n_v];
                matrix.value(at, e, &mut self.work)?;
                (0..n_v).for_each(|i| a[i * n..i * n + n_v].copy_from_slice(&e[i * n_v..(i + 1) * n_v]));
            }
        }
        for (j, r) in rows.iter().enumerate() {
            let (b, set) = (&self.blocks[r.contact], modes[r.contact][0]);
            let mut force = b.row(r.component).to_vec();
            (0..n_v).for_each(|i| a[(n_v + j) * n + i] = force[i]);
            if r.component == 0 && Dynamics::slides(set) {
                let n_t = self.mechanics.contacts[r.contact].n_tangents;
                let d = self.direction(r.contact, set);
                for k in 0..n_t {
                    force.iter_mut().zip(b.tangent(k)).for_each(|(f, t)| *f -= b.friction * d[k] * t);
                }
                let size = b.sliding[0].hypot(b.sliding[1]);
                if n_t == 2 && !self.has_no_direction(r.contact) {
                    let weight = b.friction * impulses[r.contact][0] / size;
                    for (k, l) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        let turn = weight * (f64::from(u8::from(k == l)) - d[k] * d[l]);
                        for i in 0..n_v {
                            for h in 0..n_v {
                                a[i * n + h] += turn * b.tangent(k)[i] * b.tangent(l)[h];
                            }
                        }
                    }
                }
            }
            (0..n_v).for_each(|i| a[i * n + n_v + j] = -force[i]);
        }
        if solver.factorise() {
            Ok(solver)
        } else {
            Err(EvalError::Recoverable)
        }
    }
}
