//! The equations of a scene that is built already, read back from the functions of its system.

use crate::error::{Error, Result};
use crate::expr::{Dag, Id};
use crate::scene::{expressions_of, ContactEquations, Equations, Sliding};
use crate::system::{Inertia, Mechanics, Order, SharedFunction};

/// Equations of motion and contacts in expressions of `dag`.
///
/// # Errors
/// [`Error::Unsupported`] for projected systems and for functions that are no expressions.
pub(super) fn equations(dag: &mut Dag, m: &Mechanics) -> Result<Equations> {
    if m.order == Order::First {
        return Err(Error::Unsupported("a projected system has no velocities: it is no mechanical scene".into()));
    }
    m.check_plain("time-freezing")?;
    let mut rates = load(dag, &m.smooth)?;
    let force = rates.split_off(m.n_q);
    let inertia = match &m.inertia {
        Inertia::Identity => None,
        Inertia::Constant(entries) => Some(entries.iter().map(|v| dag.constant(*v)).collect()),
        Inertia::Varying { matrix, .. } => Some(load(dag, matrix)?),
    };
    let mut contacts = Vec::with_capacity(m.contacts.len());
    for c in &m.contacts {
        let (gap, motion) = (load(dag, &c.gap)?, load(dag, &c.motion)?);
        let (friction, restitution) = (motion[1], motion[2]);
        let (normal, tangents) = motion[3..].split_at(m.n_v);
        // behind the velocity of a tangent stands the part of its rate without accelerations
        let tangent = |t: &[Id]| Sliding { rate: t[0], along: t[2..].to_vec() };
        let frictionless = dag.as_const(friction) == Some(0.0);
        let tangents = if frictionless { &[][..] } else { tangents };
        contacts.push(ContactEquations {
            name: c.name.clone(),
            gap: gap[0],
            rate: gap[1],
            normal: normal.to_vec(),
            sliding: tangents.chunks_exact(2 + m.n_v).map(tangent).collect(),
            friction,
            restitution,
        });
    }
    Ok(Equations { rates, force, inertia, contacts })
}

fn load(dag: &mut Dag, f: &SharedFunction) -> Result<Vec<Id>> {
    expressions_of(dag, f.as_ref()).unwrap_or_else(|| {
        let name = f.name();
        Err(Error::Unsupported(format!("time-freezing: function '{name}' of the scene is not made of expressions")))
    })
}
