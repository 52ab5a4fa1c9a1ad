//! Mechanical systems with unilateral contacts and friction.
//!
//! ```text
//! q̇ = N(q) v,    M(q) v̇ = f_v(q,v,u,p,t) + Σ_i (n_i λ_i + B_i τ_i),
//! 0 ≤ λ_i ⊥ g_i(q,t) ≥ 0,    ‖τ_i‖ ≤ μ_i λ_i,  τ_i opposite to the sliding velocity s_i
//! ```
//!
//! with the gap `g_i`, its rate `ġ_i = n_iᵀ v + ∂g_i/∂t`, the sliding velocity `s_i = B_iᵀ v + …` of no, one or two
//! components, the friction coefficient `μ_i` and the coefficient of restitution `e_i` (section 8.1 of the thesis, with
//! coordinates `q` whose rates need not be the velocities `v`). The state is `x = (q, v)`.
//!
//! Beside contacts that close stand dry friction at joints, `|τ_i| ≤ F_i` with a bound that is given, and constraints, `c_i(q, t) = 0` or
//! `A_i v + b_i = 0`, whose force has either sign: contacts without a normal, and contacts that never open ([`Kind`]).
//!
//! `λ_i` works on `ġ_i` and `τ_i` on `s_i`: where there is friction, gap and tangents are lengths, or `μ` means something
//! else.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Inclusion, SetValued, SharedFunction, System};
use crate::error::{Error, Result};
use crate::func::{Dims, Function};
use crate::memory::sizes;

/// Laws for several contacts that close at once; they differ, and which is right is a matter of the bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum ImpactLaw {
    /// Newton's law for all contacts at once, in one complementarity problem (Moreau).
    #[default]
    Newton = 0,
    /// Newton's law for one contact after the other, the one that closes fastest first, until none closes.
    Sequential = 1,
}

/// The matrix `M(q)`.
#[derive(Clone)]
#[non_exhaustive]
pub enum Inertia {
    /// The unit matrix.
    Identity,
    /// Constant entries, row-major `n_v × n_v`.
    Constant(Vec<f64>),
    /// Depends on the state, time or parameters.
    Varying {
        /// `M`, row-major `n_v × n_v` outputs.
        matrix: SharedFunction,
        /// `M a` as `n_v` outputs; the parameters are those of the system, then `a`.
        product: SharedFunction,
    },
}

/// Levels that contacts act on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Order {
    /// Velocities: mechanical systems, whose gaps are functions of coordinates.
    #[default]
    Second,
    /// States directly: projected systems and sweeping processes, `ẋ = f + Σ ∇c_i λ_i` with `0 ≤ λ_i ⊥ c_i(x, t) ≥ 0`
    /// (sections 4.3.6, 4.3.7). The states take the place of the velocities, and nothing jumps. There are no
    /// coordinates but integrals along the motion, which nothing depends on.
    First,
}

/// A contact as a function of what it touches alone, for scenes with many: its cost does not grow with the scene. Contacts
/// of bodies alike may share the functions.
///
/// The states of both functions are the coordinates that are listed, then the velocities that are listed, then the other states that
/// are; controls, parameters and time are those of the system.
#[derive(Clone)]
pub struct Local {
    /// Coordinates that occur, increasing.
    pub coordinates: Vec<usize>,
    /// Velocities that occur, increasing.
    pub velocities: Vec<usize>,
    /// States beside coordinates and velocities that occur, increasing.
    pub others: Vec<usize>,
    /// The gap, one output. With [`crate::func::Function::bounds`] it is known how long the contact stays open.
    pub gap: SharedFunction,
    /// What the gap is never less than, together with those of other contacts that have it too.
    pub separation: Option<Arc<Separation>>,
    /// [`Local::rows_len`] outputs: the rate of the gap, `μ`, `e`, the entries of `n` of the velocities listed, then for
    /// every tangent `s` and the entries of its column of `B`.
    pub rows: SharedFunction,
}

/// A lower bound of the gaps of several contacts, as of two bodies the distance of spheres around them. Where it is positive all of them are open.
#[derive(Clone)]
pub struct Separation {
    /// Coordinates that occur, increasing. They are the states of the function.
    pub coordinates: Vec<usize>,
    /// The bound, one output; controls, parameters and time are those of the system.
    pub distance: SharedFunction,
}

impl Separation {
    /// Groups of contacts with the same bound: the group of each contact, and the bounds.
    pub fn groups<'a>(contacts: impl Iterator<Item = Option<&'a Local>>) -> (Vec<Option<usize>>, Vec<Arc<Separation>>) {
        let mut known = BTreeMap::new();
        let mut all = Vec::new();
        let group = |l: &Local, all: &mut Vec<Arc<Separation>>, known: &mut BTreeMap<usize, usize>| {
            let s = l.separation.as_ref()?;
            Some(*known.entry(Arc::as_ptr(s) as usize).or_insert_with(|| {
                all.push(s.clone());
                all.len() - 1
            }))
        };
        let of = contacts.map(|l| l.and_then(|l| group(l, &mut all, &mut known))).collect();
        (of, all)
    }
}

impl Local {
    /// Coordinates of the gap and of its lower bound, increasing.
    pub fn touched(&self) -> Vec<usize> {
        let mut all = self.coordinates.clone();
        all.extend(self.separation.iter().flat_map(|s| &s.coordinates));
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Outputs of [`Local::rows`], without the one for sticking.
    pub fn rows_len(n_velocities: usize, n_tangents: usize) -> usize {
        3 + n_velocities + n_tangents * (1 + n_velocities)
    }
}

/// What a contact is: what of it is held, and by which force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Kind {
    /// Bodies that touch and part: a force that pushes only, with friction in proportion to it.
    #[default]
    Unilateral,
    /// Dry friction at a joint: nothing closes and there is no normal. The coefficient of friction is the bound of the force itself,
    /// which may depend on velocities and controls, too.
    Joint,
    /// A constraint: closed at all times, by a force of either sign, without friction.
    Bilateral,
    /// A switch of forces or of rates of further states: a weight in [-1, 1] that is the sign of a switching function `ψ`, and where `ψ`
    /// stays at zero what keeps it there. It is told like dry friction whose "sliding velocity" is `ψ` and whose bound is 1; other than
    /// friction it pushes along a column of its own.
    Switch,
}

impl Kind {
    /// Can it open?
    pub fn opens(self) -> bool {
        self == Kind::Unilateral
    }

    /// Is there no normal: dry friction at a joint, a switch?
    pub fn has_no_normal(self) -> bool {
        matches!(self, Kind::Joint | Kind::Switch)
    }
}

/// One contact.
#[derive(Clone)]
pub struct Contact {
    /// Name in messages and reports.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Is what friction can hold larger than what it does to something that slides? Then the rows of both have one more output, at the end: the
    /// coefficient for sticking.
    pub stiction: bool,
    /// Components of the sliding velocity: 0 without friction, 1 in the plane, 2 in space.
    pub n_tangents: usize,
    /// Gap and its rate, two outputs. Of a joint both are zero; of a constraint on velocities the gap is.
    pub gap: SharedFunction,
    /// Data of the contact forces, [`Contact::motion_len`] outputs: `g̈ − nᵀ v̇`, `μ`, `e`, `n` (`n_v` values), then for
    /// every tangent `s`, `ṡ − Bᵀ v̇` and its column of `B` (`n_v` values).
    ///
    /// Of a switch, `s` is its switching function and `B` the gradient of that with respect to the velocities. Behind them stand
    /// the column that its force pushes along (`n_v` values), and the gradient of `s` with respect to all states and time.
    /// The parameters of this function, and of the next one, are those of the system, then the weights of all switches.
    pub motion: SharedFunction,
    /// `n λ + B τ` (`n_v` values), `g̈`, and `ṡ` of every tangent; the parameters are those of the system, then `v̇`, `λ`,
    /// `τ`. Its derivatives are those of the equations of motion.
    pub reaction: SharedFunction,
    /// The functions above of the coordinates it touches alone, for time stepping; none in projected systems.
    pub local: Option<Local>,
}

impl Contact {
    /// Outputs of [`Contact::motion`], without the one for sticking.
    pub fn motion_len(n_v: usize, n_tangents: usize) -> usize {
        3 + n_v + n_tangents * (2 + n_v)
    }

    /// Outputs of [`Contact::motion`] of a switch.
    pub fn switch_len(n_v: usize, nx: usize) -> usize {
        Contact::motion_len(n_v, 1) + n_v + nx + 1
    }

    /// Place of the coefficient of friction for sticking among these outputs.
    pub(crate) fn stiction_at(&self, n_v: usize) -> usize {
        if self.stiction {
            Contact::motion_len(n_v, self.n_tangents)
        } else {
            1
        }
    }

    /// The tangent whose sliding velocity is this output.
    pub(crate) fn sliding_at(&self, n_v: usize, output: usize) -> Option<usize> {
        let behind = output.checked_sub(3 + n_v)?;
        (behind % (2 + n_v) == 0).then_some(behind / (2 + n_v)).filter(|k| *k < self.n_tangents)
    }
}

/// A projected system in the form that finite elements take: `ẋ = smooth + push`, with second derivatives.
#[derive(Clone)]
pub struct Projection {
    /// The derivatives of all states without constraints.
    pub smooth: SharedFunction,
    /// Derivatives that the multipliers `λ` add, `M⁻¹ Σ ∇c_i λ_i`; its states are those of the system, then one multiplier for each constraint.
    pub push: SharedFunction,
    /// The constraints `c ≥ 0`.
    pub constraints: SharedFunction,
}

/// Equations of motion with contacts.
#[derive(Clone)]
pub struct Mechanics {
    /// Level that the contacts act on: velocities, or states directly.
    pub order: Order,
    /// Coordinates `q`, the first states.
    pub n_q: usize,
    /// Velocities `v`, the states behind them.
    pub n_v: usize,
    /// States `z` beside these, the last ones: `ż = h(q, v, z, u, p, t)`. Forces and the bounds of friction at joints may depend on them,
    /// contacts and inertia do not.
    pub n_z: usize,
    /// Switches, the last of the contacts. Where there are any, states beside coordinates and velocities count as velocities of unit inertia,
    /// so that one problem has all that changes at once.
    pub n_switches: usize,
    /// Pairs of switches, by their numbers among them, whose weights are multiplied with each other in forces or rates.
    pub products: Vec<[usize; 2]>,
    /// `N v` (`n_q` values), `f_v` (`n_v` values), then `h`. The parameters are those of the system, then the weight of every switch: its sign,
    /// or 0 where it is found with the contact forces.
    pub smooth: SharedFunction,
    /// The matrix `M`.
    pub inertia: Inertia,
    /// The contacts.
    pub contacts: Vec<Contact>,
    /// Law for several contacts that close at once.
    pub law: ImpactLaw,
    /// Bounds of the coordinates that contacts were left out for: nothing is known where they are left. Empty, or one for
    /// every coordinate.
    pub bounds: Vec<Option<(f64, f64)>>,
    /// The form for finite elements, of a projected system that is made of expressions.
    pub projection: Option<Projection>,
}

impl Mechanics {
    /// Length of the state.
    pub fn n_states(&self) -> usize {
        self.n_q + self.n_v + self.n_z
    }

    /// Places of the velocities in the state.
    pub(crate) fn velocities(&self) -> std::ops::Range<usize> {
        self.n_q..self.n_q + self.n_v
    }

    /// Is something true of one of its functions?
    pub(super) fn any_function(&self, is: &dyn Fn(&dyn Function) -> bool) -> bool {
        let is = |f: &SharedFunction| is(f.as_ref());
        let inertia = match &self.inertia {
            Inertia::Varying { matrix, product } => is(matrix) || is(product),
            _ => false,
        };
        let contact = |c: &Contact| {
            let bound = |l: &'_ Local| l.separation.as_ref().is_some_and(|s| is(&s.distance));
            if c.local.as_ref().is_some_and(bound) {
                return true;
            }
            let local = c.local.iter().flat_map(|l| [&l.gap, &l.rows]);
            [&c.gap, &c.motion, &c.reaction].into_iter().chain(local).any(is)
        };
        inertia || is(&self.smooth) || self.contacts.iter().any(contact)
    }

    /// An error where there is more than coordinates, velocities, and contacts that close, push and slide under one coefficient of friction, for
    /// those who cannot follow that.
    pub(crate) fn check_plain(&self, who: &str) -> Result<()> {
        if self.n_z > 0 {
            return Err(Error::Unsupported(format!(
                "{who} cannot follow the {} states that a scene has beside coordinates and velocities: simulate it \
                 event-driven or by time stepping",
                self.n_z
            )));
        }
        self.check_contacts(who)
    }

    /// The same, but for states beside coordinates and velocities.
    pub(crate) fn check_contacts(&self, who: &str) -> Result<()> {
        for c in &self.contacts {
            let what = match c.kind {
                Kind::Unilateral if c.stiction => "sticks by another friction than it slides with",
                Kind::Unilateral => continue,
                Kind::Joint => "is dry friction at a joint",
                Kind::Bilateral => "is a constraint that is always closed",
                Kind::Switch => {
                    return Err(Error::Unsupported(format!(
                        "{who} cannot follow the {}, a switch of forces or rates: simulate the scene event-driven",
                        c.name
                    )))
                }
            };
            return Err(Error::Unsupported(format!(
                "{who} cannot follow {}, which {what}: simulate the scene event-driven or by time stepping",
                c.name
            )));
        }
        Ok(())
    }

    fn check(&self, system: &System) -> Result<()> {
        let own = system.dims;
        if self.n_states() != own.x {
            let (q, v, z) = (self.n_q, self.n_v, self.n_z);
            return Err(Error::Dimension(format!(
                "{q} coordinates, {v} velocities and {z} other states make no state of {}",
                own.x
            )));
        }
        sizes::check("contacts", &[self.contacts.len()])?;
        let first_switch = self.contacts.iter().position(|c| c.kind == Kind::Switch).unwrap_or(self.contacts.len());
        if self.contacts[first_switch..].iter().any(|c| c.kind != Kind::Switch)
            || self.contacts.len() - first_switch != self.n_switches
        {
            return Err(Error::Dimension(format!(
                "the switches of a scene are the last of its contacts: {} are expected behind contact {first_switch} of {}",
                self.n_switches,
                self.contacts.len()
            )));
        }
        let check = |f: &SharedFunction, more: usize, n_out: usize| {
            let expected = Dims { p: own.p + more, ..own };
            if f.dims() != expected || f.n_out() != n_out {
                let (name, d, n) = (f.name(), f.dims(), f.n_out());
                return Err(Error::Dimension(format!(
                    "function '{name}' has {n} outputs of inputs {d:?}, expected {n_out} of {expected:?}"
                )));
            }
            Ok(())
        };
        if let Some(p) = self.products.iter().find(|p| p[0].max(p[1]) >= self.n_switches) {
            return Err(Error::Range(format!(
                "there are {} switches, and a product of numbers {p:?}",
                self.n_switches
            )));
        }
        check(&self.smooth, self.n_switches, own.x)?;
        match &self.inertia {
            Inertia::Identity => {}
            Inertia::Constant(m) if m.len() == self.n_v * self.n_v => {}
            Inertia::Constant(m) => {
                let (n, n_v) = (m.len(), self.n_v);
                return Err(Error::Dimension(format!("the inertia has {n} entries, expected {n_v} x {n_v}")));
            }
            Inertia::Varying { matrix, product } => {
                check(matrix, 0, self.n_v * self.n_v)?;
                check(product, self.n_v, self.n_v)?;
            }
        }
        for c in &self.contacts {
            if c.n_tangents > 2 {
                let (name, n) = (&c.name, c.n_tangents);
                return Err(Error::Range(format!("contact {name} has {n} tangents: there are up to two")));
            }
            if c.kind.has_no_normal() && c.n_tangents != 1 || c.kind == Kind::Bilateral && c.n_tangents > 0 {
                let (name, n) = (&c.name, c.n_tangents);
                return Err(Error::Range(format!(
                    "{name} has {n} tangents: dry friction at a joint has one, a constraint has none"
                )));
            }
            check(&c.gap, 0, 2)?;
            let (weights, length) = match c.kind {
                Kind::Switch => (self.n_switches, Contact::switch_len(self.n_v, own.x)),
                _ => (0, Contact::motion_len(self.n_v, c.n_tangents) + usize::from(c.stiction)),
            };
            check(&c.motion, weights, length)?;
            check(&c.reaction, weights + self.n_v + 1 + c.n_tangents, self.n_v + 1 + c.n_tangents)?;
            self.check_local(c, own)?;
        }
        Ok(())
    }

    fn check_local(&self, c: &Contact, own: Dims) -> Result<()> {
        let (Some(l), name) = (&c.local, &c.name) else { return Ok(()) };
        let lists = [
            ("coordinates", &l.coordinates, self.n_q),
            ("velocities", &l.velocities, self.n_v),
            ("other states", &l.others, self.n_z),
        ];
        for (what, list, n) in lists {
            if list.iter().any(|&i| i >= n) || list.windows(2).any(|w| w[0] >= w[1]) {
                return Err(Error::Range(format!(
                    "contact {name}: the {what} it touches are {list:?}: they must increase, and there are {n}"
                )));
            }
        }
        if let Some(s) = &l.separation {
            let (d, n) = (Dims { x: s.coordinates.len(), ..own }, s.distance.n_out());
            let known = s.coordinates.iter().all(|&i| i < self.n_q) && s.coordinates.windows(2).all(|w| w[0] < w[1]);
            if !known || s.distance.dims() != d || n != 1 {
                return Err(Error::Dimension(format!(
                    "contact {name}: the lower bound of its gap is one output of the coordinates {:?}, which must increase; it                      has {n} of inputs {:?}",
                    s.coordinates,
                    s.distance.dims()
                )));
            }
        }
        let dims = Dims { x: l.coordinates.len() + l.velocities.len() + l.others.len(), ..own };
        let lengths = [1, Local::rows_len(l.velocities.len(), c.n_tangents) + usize::from(c.stiction)];
        for (f, n) in [&l.gap, &l.rows].into_iter().zip(lengths) {
            if f.dims() != dims || f.n_out() != n {
                let (name, d, k) = (f.name(), f.dims(), f.n_out());
                return Err(Error::Dimension(format!(
                    "function '{name}' has {k} outputs of inputs {d:?}, expected {n} of {dims:?}"
                )));
            }
        }
        Ok(())
    }
}

impl System {
    /// A mechanical system with contacts, without anything else.
    pub fn of_mechanics(mechanics: Mechanics, nu: usize, np: usize) -> Result<System> {
        let mut system = System::new(mechanics.n_states(), nu, np)?;
        mechanics.check(&system)?;
        system.mechanics = Some(Arc::new(mechanics));
        Ok(system)
    }

    /// Its equations of motion with contacts, if it has any.
    pub fn mechanics(&self) -> Option<&Arc<Mechanics>> {
        self.mechanics.as_ref()
    }

    /// The system as finite elements take it: a projected system is an inclusion in the multipliers of its constraints, others stay as
    /// they are.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for projected systems that are not made of expressions.
    pub fn with_multipliers(&self) -> Result<Cow<'_, System>> {
        let Some(m) = self.mechanics.as_ref().filter(|m| m.order == Order::First) else {
            return Ok(Cow::Borrowed(self));
        };
        self.check_alone()?;
        if !self.transitions.is_empty() {
            return Err(Error::Unsupported(
                "finite elements do not follow transitions (guards with resets or discrete states) of projected systems: simulate the \
                 system event-driven"
                    .into(),
            ));
        }
        m.check_contacts("finite elements")?;
        let Some(p) = &m.projection else {
            return Err(Error::Unsupported(
                "finite elements need second derivatives of a projected system: make it of expressions".into(),
            ));
        };
        let mut out = System::new(self.dims.x, self.dims.u, self.dims.p)?;
        out.set_f0(p.smooth.clone())?;
        if p.constraints.n_out() > 0 {
            let rows = (0..self.dims.x).collect();
            let (f, psi) = (p.push.clone(), p.constraints.clone());
            out.add_inclusion(Inclusion { rows, f, psi, set: SetValued::Multiplier })?;
        }
        out.choices.clone_from(&self.choices);
        Ok(Cow::Owned(out))
    }

    /// An error where something stands beside contacts that event-driven simulation alone follows.
    pub(super) fn check_alone(&self) -> Result<()> {
        if self.mechanics.is_some() && (self.n_z > 0 || self.algebraic.is_some() || !self.inclusions.is_empty()) {
            return Err(Error::Unsupported(
                "algebraic states and inclusions beside contacts are followed by events alone: simulate the system event-driven, or write \
                 the scene without them"
                    .into(),
            ));
        }
        Ok(())
    }

    /// An error where something beside contacts moves the states: that is part of `f_v`.
    pub(super) fn check_no_flow_beside(&self) -> Result<()> {
        if self.mechanics.is_some() && (self.f0.is_some() || !self.subsystems.is_empty()) {
            return Err(Error::Unsupported(
                "a scene with contacts takes no f0 and no subsystems beside it: write forces, and what switches in them, into the scene".into(),
            ));
        }
        Ok(())
    }

    /// An error where the system has contacts, for those who cannot follow them.
    pub(crate) fn check_without_contacts(&self, who: &str) -> Result<()> {
        match &self.mechanics {
            None => Ok(()),
            Some(_) => Err(Error::Unsupported(format!(
                "{who} cannot follow contacts: simulate the scene event-driven or by time stepping"
            ))),
        }
    }
}

impl std::fmt::Debug for Mechanics {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let names: Vec<&str> = self.contacts.iter().map(|c| &c.name[..]).collect();
        f.debug_struct("Mechanics").field("n_q", &self.n_q).field("n_v", &self.n_v).field("contacts", &names).finish()
    }
}
