//! Scenes and projected systems without their algebraic equations and inclusions: all their functions at the solution of these.
//!
//! ```text
//! M v̇ = f_v(q, v, z, y, α) + contact forces,    0 = h(q, v, z, y, u, p, t),    α_j ∈ γ(ψ_j)
//! ```
//!
//! `y` follows the other states wherever forces are evaluated, also behind an impact, which may change it at once. Gaps and directions of
//! forces depend on no `y`: their rates would be those of `y`. What an inclusion adds in the row of a velocity is a force.
//!
//! A weight holds its surface where the forces of contacts have nothing to do with it, see [`held`](super::held): the rate of its function
//! is known from `f_v` and `h` alone then. The others cross their surfaces.

use std::sync::Arc;

use super::algebraic::Algebraic;
use super::complementary::Combination;
use super::eliminated::{Eliminated, Outputs, OwnRows};
use super::{Contact, Inertia, Kind, Mechanics, Order, SharedFunction, System};
use crate::error::{Error, Result};

impl Mechanics {
    /// States whose rates the forces of contacts may change, or switches: those are not known before the forces are.
    pub(super) fn pushed(&self) -> Vec<bool> {
        let mut pushed = vec![false; self.n_states()];
        let own_p = self.smooth.dims().p - self.n_switches;
        let d = self.smooth.dims();
        for k in 0..self.n_switches {
            self.smooth.jac_pattern().rows(d.x + d.u + own_p + k).iter().for_each(|r| pushed[*r] = true);
        }
        for c in &self.contacts {
            let f = &c.reaction;
            let (d, n_forces) = (f.dims(), 1 + c.n_tangents);
            for k in d.p - n_forces..d.p {
                let rows = f.jac_pattern().rows(d.x + d.u + k).iter().filter(|r| **r < self.n_v);
                rows.for_each(|r| pushed[self.n_q + r] = true);
            }
        }
        if !matches!(self.inertia, Inertia::Identity) {
            // forces are not derivatives
            pushed[self.velocities()].fill(true);
        }
        pushed
    }
}

impl System {
    /// The equations of motion with their algebraic states and inclusions eliminated.
    pub(super) fn eliminated_mechanics(&self, a: &Arc<Algebraic>, m: &Mechanics) -> Result<Mechanics> {
        self.check_beside(m)?;
        let more = a.outer().x - self.dims.x;
        let all: Vec<usize> = (0..self.dims.x).collect();
        let plain = Outputs { own: OwnRows::Plain, rows: &[], switched: None, more: 0, more_p: 0, first_order: true };
        let with = |f: &SharedFunction, more_p: usize| Eliminated::function(f, a, Outputs { more_p, ..plain });
        let zero = Outputs { own: OwnRows::Zero, more_p: m.n_switches, ..plain };
        let mut smooth = Eliminated::function(&m.smooth, a, Outputs { rows: &all, more, ..zero });
        if !self.inclusions.is_empty() {
            let mut terms: Vec<Vec<(usize, usize, f64)>> = (0..smooth.n_out()).map(|o| vec![(0, o, 1.0)]).collect();
            let mut sources = vec![smooth.clone()];
            for (i, f) in self.inclusions.iter().zip(&a.inclusions) {
                i.rows.iter().enumerate().for_each(|(o, r)| terms[*r].push((sources.len(), o, 1.0)));
                sources.push(Eliminated::function(f, a, Outputs { rows: &i.rows, ..zero }));
            }
            smooth = Arc::new(Combination::new(smooth.name().to_owned(), sources, terms));
        }
        let inertia = match &m.inertia {
            Inertia::Varying { matrix, product } => {
                Inertia::Varying { matrix: with(matrix, 0), product: with(product, m.n_v) }
            }
            constant => constant.clone(),
        };
        let contact = |c: &Contact| {
            let weights = if c.kind == Kind::Switch { m.n_switches } else { 0 };
            let mut motion = with(&c.motion, weights);
            if c.kind == Kind::Switch && more > 0 {
                // the derivatives of its function by the states that are new stand before that by time
                let last = motion.n_out() - 1;
                let mut rows: Vec<Vec<(usize, usize, f64)>> = (0..last).map(|o| vec![(0, o, 1.0)]).collect();
                rows.resize(last + more, Vec::new());
                rows.push(vec![(0, last, 1.0)]);
                motion = Arc::new(Combination::new(motion.name().to_owned(), vec![motion], rows));
            }
            Contact {
                gap: with(&c.gap, 0),
                motion,
                reaction: with(&c.reaction, weights + m.n_v + 1 + c.n_tangents),
                ..c.clone()
            }
        };
        let contacts = m.contacts.iter().map(contact).collect();
        Ok(Mechanics { n_z: m.n_z + more, smooth, inertia, contacts, projection: None, ..m.clone() })
    }

    /// Says what algebraic states and inclusions beside contacts may not do.
    fn check_beside(&self, m: &Mechanics) -> Result<()> {
        let z = self.algebraic_states();
        let second = m.order == Order::Second;
        if let Some((k, i)) =
            self.inclusions.iter().enumerate().find(|(_, i)| second && i.rows.iter().any(|r| *r < m.n_q))
        {
            return Err(Error::Unsupported(format!(
                "inclusion {k} drives the rows {:?} of a scene with {} coordinates: coordinates move with the velocities; drive a velocity, which \
                 takes it as a force, or a further state",
                i.rows, m.n_q
            )));
        }
        if z.is_empty() {
            return Ok(());
        }
        if second && m.n_switches == 0 && z.start < m.n_q + m.n_v {
            return Err(Error::Dimension(format!(
                "the algebraic states {z:?} of a scene reach into its {} coordinates and {} velocities: they are the last of the further states",
                m.n_q, m.n_v
            )));
        }
        let d = m.smooth.dims();
        let p = m.smooth.jac_pattern();
        let weights = d.x + d.u + d.p - m.n_switches..d.x + d.u + d.p;
        if let Some(r) = weights.flat_map(|c| p.rows(c)).find(|r| z.contains(r)) {
            return Err(Error::Unsupported(format!(
                "the algebraic equation in the row of state {r} switches as forces of the scene do: write what switches there smoothly, or \
                 switch forces alone"
            )));
        }
        let by = |f: &SharedFunction, is_free: &dyn Fn(usize) -> bool| {
            let mut columns = z.clone();
            columns.find(|c| f.jac_pattern().rows(*c).iter().any(|r| !is_free(*r)))
        };
        let error = |what: &str, i: usize| {
            Err(Error::Unsupported(format!(
                "{what} depends on the algebraic state {i}, whose rate it would need: forces, bounds and coefficients of friction and the rates of \
                 further states may; write gaps, constraints and what slides in states with a derivative"
            )))
        };
        if let Inertia::Varying { matrix, .. } = &m.inertia {
            if let Some(i) = by(matrix, &|_| false) {
                return error("the inertia", i);
            }
        }
        for c in &m.contacts {
            let push = Contact::motion_len(m.n_v, c.n_tangents)..;
            let free = |r: usize| match c.kind {
                Kind::Switch => r == 1 || push.contains(&r),
                _ => r == 1 || r == c.stiction_at(m.n_v),
            };
            let found = by(&c.gap, &|r| !second && r > 0).or_else(|| by(&c.motion, &free));
            if let Some(i) = found {
                return error(&c.name, i);
            }
        }
        Ok(())
    }
}
