//! A scene taken apart: equations of motion and contacts as expressions, for other formulations of the same mechanics.

use super::{Builder, Part, Scene};
use crate::error::{Error, Result};
use crate::expr::{Block, Dag, Id};
use crate::system::Order;

/// One direction of sliding: its velocity, and the gradient of that with respect to the velocities.
#[derive(Debug, Clone)]
pub struct Sliding {
    /// The component of the sliding velocity.
    pub rate: Id,
    /// Its gradient `[n_v]`: the column of `B`.
    pub along: Vec<Id>,
}

/// A contact in expressions.
#[derive(Debug, Clone)]
pub struct ContactEquations {
    /// Its name.
    pub name: String,
    /// The gap.
    pub gap: Id,
    /// The rate of the gap.
    pub rate: Id,
    /// The gradient of the rate with respect to the velocities `[n_v]`: the normal.
    pub normal: Vec<Id>,
    /// Directions of sliding; none without friction.
    pub sliding: Vec<Sliding>,
    /// Coefficient of friction.
    pub friction: Id,
    /// Coefficient of restitution.
    pub restitution: Id,
}

/// A scene in expressions of its graph, checked as by [`Scene::build_in`].
#[derive(Debug, Clone)]
pub struct Equations {
    /// Rates of the coordinates `[n_q]`.
    pub rates: Vec<Id>,
    /// Forces `[n_v]`.
    pub force: Vec<Id>,
    /// Inertia, row-major `n_v × n_v`; none: the unit matrix.
    pub inertia: Option<Vec<Id>>,
    /// Contacts that can close within the bounds of the coordinates.
    pub contacts: Vec<ContactEquations>,
}

impl Scene {
    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of states, controls and parameters.
    pub fn names(&self) -> &crate::model::Names {
        &self.names
    }

    /// Number of contacts that were added.
    pub fn n_contacts(&self) -> usize {
        self.contacts.len()
    }

    /// The scene in expressions.
    ///
    /// # Errors
    /// Those of [`Scene::build_in`], and [`Error::Unsupported`] for projected systems.
    pub fn equations(&self, dag: &mut Dag) -> Result<Equations> {
        if self.order == Order::First {
            return Err(Error::Unsupported("a projected system has no velocities: it is no mechanical scene".into()));
        }
        // what can be wrong is said there
        let built = self.build_in(dag)?.system;
        built.check_without_transitions("time-freezing")?;
        built.mechanics().map_or(Ok(()), |m| m.check_plain("time-freezing"))?;
        let mut b = Builder::new(self, dag);
        let (rates, force) = (b.rates()?, b.force()?);
        let (_, kept) = b.reachable()?;
        let mut contacts = Vec::new();
        for k in kept {
            let Part::Contact(c, _) = &self.contacts[k] else { continue };
            let rate = b.frame().along_motion(c.gap, &rates)?;
            let normal = b.along(rate)?;
            let frictionless = b.dag.as_const(c.friction) == Some(0.0);
            let mut sliding = Vec::new();
            for &tangent in if frictionless { &[][..] } else { &c.tangents } {
                let moves = b.depends(tangent, Block::X, self.n_q);
                let rate = if moves { tangent } else { b.frame().along_motion(tangent, &rates)? };
                let along = b.along(rate)?;
                sliding.push(Sliding { rate, along });
            }
            let (name, gap) = (c.name.clone(), c.gap);
            let (friction, restitution) = (c.friction, c.restitution);
            contacts.push(ContactEquations { name, gap, rate, normal, sliding, friction, restitution });
        }
        Ok(Equations { rates, force, inertia: self.inertia.clone(), contacts })
    }
}

impl Builder<'_> {
    /// The gradient of a rate with respect to the velocities.
    fn along(&mut self, rate: Id) -> Result<Vec<Id>> {
        let frame = &mut self.frame();
        let v = frame.velocities();
        frame.dag.dense_jacobian(&[rate], &v)
    }
}
