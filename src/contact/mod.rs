//! Motion with contacts: accelerations and forces under given contact modes, impacts, and which modes may follow.
//!
//! A contact is open, closed (sticking where there is friction), or sliding. Under given modes the equations
//!
//! ```text
//! M v̇ = f_v + Σ_i (n_i λ_i + B_i τ_i),   g̈_i = 0 where closed,   ṡ_i = 0 where it sticks,   τ_i = −μ_i λ_i s_i/‖s_i‖ where it slides
//! ```
//!
//! are linear in `v̇` and the forces ([`Dynamics`]). Which modes may follow at a point, and what an impact does to the
//! velocities, are complementarity problems of the same form ([`problem`]).

mod breakaway;
mod dynamics;
mod impact;
mod inertia;
mod inverse;
mod least_energy;
mod least_norm;
mod lemke;
mod modes;
pub(crate) mod problem;
mod sensitivity;
mod share;

pub(crate) use dynamics::{Block, Dynamics, Forces};
pub(crate) use impact::Impulse;
pub(crate) use modes::{Choice, Closed, Follow, ZERO};

/// Modes of a contact, as results number them.
pub(crate) mod mode {
    /// No force.
    pub(crate) const OPEN: usize = 0;
    /// Closed; with friction, sticking.
    pub(crate) const CLOSED: usize = 1;
    /// Sliding: in the plane along the tangent, in space in any direction.
    pub(crate) const SLIDES: usize = 2;
    /// Sliding against the tangent, in the plane.
    pub(crate) const SLIDES_BACK: usize = 3;
}
