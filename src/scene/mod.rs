//! Scenes: mechanical systems with contacts, written as expressions.
//!
//! ```text
//! q̇ = N(q) v,    M(q) v̇ = f_v(q,v,u,p,t) + contact forces,    0 ≤ λ_i ⊥ g_i(q,t) ≥ 0,   friction
//! ```
//!
//! Beside contacts stand dry friction at joints ([`Friction`]) and constraints ([`Constraint`]). Forces and the rates of further states may
//! switch.
//!
//! The user writes coordinates, inertia, forces and gaps; normals, the rates of gaps, what is centrifugal in them and all
//! derivatives follow by differentiation (section 8.1 of the thesis). In the graph the states are `q`, then `v`.
//!
//! Only what a scene needs is there: contacts without tangents have no friction, a constant inertia is factored once, and a
//! contact that the bounds of the coordinates prove to be open is left out ([`Report`]).
//!
//! ```
//! use switchback::event::{simulate, Options};
//! use switchback::expr::Graph;
//! use switchback::scene::{Contact, Scene};
//!
//! // a ball that falls on a floor and bounces once
//! let g = Graph::new();
//! let (y, one) = (g.x(0), g.constant(1.0));
//! let mut scene = Scene::new("ball", 1, 1, 0, 0).unwrap();
//! scene.set_force(0, g.constant(-9.81).id()).unwrap();
//! scene.add_contact(Contact { restitution: one.id(), ..Contact::new(&g, "floor", y) }).unwrap();
//! let built = scene.build(&g).unwrap();
//! let run = simulate(&built.system, &Options::default(), 0.0, &[1.0, 0.0], 0.6).unwrap();
//! assert_eq!(run.impacts.len(), 1);
//! ```

mod embedded;
mod parts;
mod report;
mod saved;
mod shape;
mod switches;

use std::collections::BTreeMap;
use std::sync::Arc;

pub use embedded::{embedding_of, expressions_of, saved_expressions, Embedding};
pub use parts::{ContactEquations, Equations, Sliding};
pub use report::{ContactReport, Dropped, Report};
pub use saved::SavedScene;

use self::shape::{Excerpt, Flaw, Frame, Parts, Places, Shape};
use crate::error::{Error, Result};
use crate::expr::{Block, Dag, Expr, ExprFunction, Graph, Id, SavedGraph};
use crate::func::Dims;
use crate::memory::sizes;
use crate::model::bounds::{Bounds, Interval, ALL};
use crate::model::{is_state, transition, Clock, Names, Pwm, Transition};
use crate::system::Projection;
use crate::system::{self, ImpactLaw, Inertia, Kind, Mechanics, Order, Separation, SharedFunction, System};

/// A contact as the user states it.
#[derive(Debug, Clone)]
pub struct Contact {
    /// Name in messages, reports and results.
    pub name: String,
    /// The gap, a smooth expression of coordinates, parameters and time: positive where the bodies are apart.
    pub gap: Id,
    /// Up to two tangents: expressions of coordinates, parameters and time whose rates are the components of the sliding
    /// velocity, or, where they contain velocities, that component itself, linear in them. None: no friction.
    pub tangents: Vec<Id>,
    /// Coefficient of friction, an expression of coordinates, parameters and time that is not negative.
    pub friction: Id,
    /// Coefficient of restitution between 0 and 1, an expression like the one before.
    pub restitution: Id,
}

impl Contact {
    /// A contact without friction and restitution.
    pub fn new(graph: &Graph, name: &str, gap: Expr) -> Contact {
        let zero = graph.constant(0.0).id();
        Contact { name: name.to_owned(), gap: gap.id(), tangents: Vec::new(), friction: zero, restitution: zero }
    }
}

/// Dry friction at a joint, or wherever something slides under a load of its own: a force `τ` along the sliding velocity `s = Bᵀ v + …`,
/// opposite to it, with a bound that is given.
///
/// ```text
/// τ = −F s/|s| where it slides,    |τ| ≤ F_s where s = 0,    0 ≤ F ≤ F_s
/// ```
///
/// A bound that depends on `s` makes a curve of Stribeck. An impact does not know this friction: it is a finite force.
#[derive(Debug, Clone)]
pub struct Friction {
    /// Name in messages, reports and results, where it stands among the contacts.
    pub name: String,
    /// What slides: an expression of coordinates, parameters and time whose rate is the sliding velocity, or, where it contains velocities,
    /// that velocity itself, linear in them. The force is in its unit: a torque for an angle.
    pub sliding: Id,
    /// The bound `F`, a smooth expression of states, controls, parameters and time that is not negative.
    pub bound: Id,
    /// The bound `F_s` for sticking, not less than the other; None: the same.
    pub stiction: Option<Id>,
}

impl Friction {
    /// Friction that sticks by the bound it slides with.
    pub fn new(name: &str, sliding: Expr, bound: Expr) -> Friction {
        Friction { name: name.to_owned(), sliding: sliding.id(), bound: bound.id(), stiction: None }
    }
}

/// A constraint: `c(q, p, t) = 0`, or `A(q) v + b = 0` where the expression contains velocities. It is a contact that never opens: its force
/// has either sign, and in impacts it has an impulse.
#[derive(Debug, Clone)]
pub struct Constraint {
    /// Name in messages, reports and results, where it stands among the contacts.
    pub name: String,
    /// What is zero: a smooth expression of coordinates, parameters and time, or one that is linear in the velocities.
    pub zero: Id,
}

impl Constraint {
    /// A constraint of this name.
    pub fn new(name: &str, zero: Expr) -> Constraint {
        Constraint { name: name.to_owned(), zero: zero.id() }
    }
}

/// What stands among the contacts of a scene.
#[derive(Debug, Clone)]
enum Part {
    Contact(Contact, More),
    Friction(Friction),
    Constraint(Constraint),
}

/// What a contact may have besides.
#[derive(Debug, Clone, Copy, Default)]
struct More {
    /// The coefficient of friction for sticking if that is another.
    stiction: Option<Id>,
    /// A lower bound of the gap.
    separation: Option<Id>,
}

impl Part {
    fn name(&self) -> &str {
        match self {
            Part::Contact(c, _) => &c.name,
            Part::Friction(f) => &f.name,
            Part::Constraint(c) => &c.name,
        }
    }

    /// The gap of a contact that can open.
    fn gap(&self) -> Option<Id> {
        match self {
            Part::Contact(c, _) => Some(c.gap),
            _ => None,
        }
    }
}

/// A part of a scene as the functions of a contact are made of it.
#[derive(Debug, Clone)]
struct Stated {
    contact: Contact,
    kind: Kind,
    stiction: Option<Id>,
}

/// A scene: sizes, equations of motion, contacts.
#[derive(Debug, Clone)]
pub struct Scene {
    name: String,
    n_q: usize,
    n_v: usize,
    nu: usize,
    np: usize,
    names: Names,
    rates: Option<Vec<Id>>,
    inertia: Option<Vec<Id>>,
    force: Vec<Option<Id>>,
    /// Rates of the states beside coordinates and velocities.
    states: Vec<Option<Id>>,
    /// Values that the last of these, which are discrete, begin with.
    discrete: Vec<f64>,
    transitions: Vec<Transition>,
    contacts: Vec<Part>,
    /// Contacts by their gaps and by their names.
    by_gap: BTreeMap<Id, usize>,
    by_name: BTreeMap<String, usize>,
    law: ImpactLaw,
    bounds: Vec<Option<(f64, f64)>>,
    order: Order,
    /// So many of the velocities, the last ones, are states beside coordinates and velocities: see [`Scene::widened`].
    beside: usize,
}

/// The system made of a scene, with the report on it.
#[derive(Clone)]
pub struct Built {
    /// The system.
    pub system: System,
    /// Its parts, and what was left out.
    pub report: Report,
    /// Sizes: states (coordinates, then velocities), controls, parameters.
    pub dims: Dims,
    /// Names of the states, controls and parameters.
    pub names: Names,
}

impl Scene {
    /// A scene with `n_q` coordinates, `n_v` velocities, `nu` controls and `np` parameters, without forces and contacts. The
    /// inertia is the unit matrix, and, where there are as many coordinates as velocities, `q̇ = v`.
    pub fn new(name: &str, n_q: usize, n_v: usize, nu: usize, np: usize) -> Result<Scene> {
        if n_q == 0 || n_v == 0 {
            return Err(Error::Dimension("a scene needs at least one coordinate and one velocity".into()));
        }
        sizes::check("coordinates, velocities, controls or parameters", &[n_q, n_v, nu, np])?;
        Ok(Scene {
            name: name.to_owned(),
            n_q,
            n_v,
            nu,
            np,
            names: Names::default(),
            rates: None,
            inertia: None,
            force: vec![None; n_v],
            states: Vec::new(),
            discrete: Vec::new(),
            transitions: Vec::new(),
            contacts: Vec::new(),
            by_gap: BTreeMap::new(),
            by_name: BTreeMap::new(),
            law: ImpactLaw::default(),
            bounds: vec![None; n_q],
            order: Order::Second,
            beside: 0,
        })
    }

    /// A scene that has `n_z` states `z` beside coordinates and velocities, `ż = h(q, v, z, u, p, t)`: currents of motors, controllers,
    /// temperatures. In the graph they stand behind the velocities. Forces and the bounds of friction at joints may depend on them.
    pub fn with_states(name: &str, n_q: usize, n_v: usize, n_z: usize, nu: usize, np: usize) -> Result<Scene> {
        sizes::check("states beside coordinates and velocities", &[n_z])?;
        Ok(Scene { states: vec![None; n_z], ..Scene::new(name, n_q, n_v, nu, np)? })
    }

    /// A projected system or first-order sweeping process: `ẋ = f + Σ ∇c_i λ_i`, `0 ≤ λ_i ⊥ c_i(x, t) ≥ 0` (sections 4.3.6,
    /// 4.3.7). The states stand for velocities everywhere: [`Scene::set_force`] sets `f`, the gaps of contacts are the `c_i`,
    /// functions of states, parameters and time, without tangents and restitution.
    pub fn projected(name: &str, nx: usize, nu: usize, np: usize) -> Result<Scene> {
        if nx == 0 {
            return Err(Error::Dimension("a projected system needs at least one state".into()));
        }
        Ok(Scene { n_q: 0, bounds: vec![None; nx], order: Order::First, ..Scene::new(name, 1, nx, nu, np)? })
    }

    /// Sizes of state, controls and parameters.
    pub fn dims(&self) -> Dims {
        Dims { x: self.n_q + self.n_v + self.states.len(), u: self.nu, p: self.np }
    }

    /// Coordinates and velocities.
    pub fn sizes(&self) -> (usize, usize) {
        (self.n_q, self.n_v)
    }

    /// States beside coordinates and velocities, discrete ones with them.
    pub fn n_states(&self) -> usize {
        self.states.len()
    }

    /// Names for reports and messages; those of the states are coordinates, velocities, and what is beside them.
    pub fn set_names(&mut self, names: Names) {
        self.names = names;
    }

    /// Sets `q̇ = N(q) v`: one expression for every coordinate, linear in the velocities.
    pub fn set_rates(&mut self, rates: &[Id]) -> Result<()> {
        self.expect("rates of coordinates", rates.len(), self.n_q)?;
        self.rates = Some(rates.to_vec());
        Ok(())
    }

    /// Sets the inertia matrix, row-major `n_v × n_v`: symmetric, positive definite at every point that is reached.
    pub fn set_inertia(&mut self, entries: &[Id]) -> Result<()> {
        self.expect("entries of the inertia matrix", entries.len(), self.n_v * self.n_v)?;
        self.inertia = Some(entries.to_vec());
        Ok(())
    }

    /// Sets the force on velocity `i`: all that stands beside `M v̇` but contact forces. It may switch, with `sign`, `where` and tables of
    /// states, controls, parameters and time.
    pub fn set_force(&mut self, i: usize, force: Id) -> Result<()> {
        let n = self.n_v;
        let place = self.force.get_mut(i);
        *place.ok_or_else(|| Error::Range(format!("velocity {i} does not exist: the scene has {n}")))? = Some(force);
        Ok(())
    }

    /// Adds a discrete state with its name and the value it begins with where nothing else is given, and returns its place among all states: the
    /// last one. Nothing drives it but transitions.
    ///
    /// # Errors
    /// [`Error::NonFinite`] for a value that is no number.
    pub fn add_discrete(&mut self, name: &str, initial: f64) -> Result<usize> {
        crate::error::finite("initial value of discrete state", &[initial], 1)?;
        let place = self.dims().x;
        self.states.push(None);
        self.discrete.push(initial);
        if !name.is_empty() || !self.names.x.is_empty() {
            self.names.x.resize(place, String::new());
            self.names.x.push(name.to_owned());
        }
        Ok(place)
    }

    /// Values that the discrete states begin with; they are the last states.
    pub fn discrete(&self) -> &[f64] {
        &self.discrete
    }

    /// Adds a transition and returns its index; what is wrong with it is said when the scene is built. A reset may move bodies, but not into each
    /// other, nor the states of a projected system out of their set: that ends the run.
    pub fn add_transition(&mut self, t: Transition) -> Result<usize> {
        self.transitions.push(t);
        Ok(self.transitions.len() - 1)
    }

    /// Adds a clock, which counts in a discrete state of the scene, and returns the index of its first transition.
    ///
    /// # Errors
    /// Those of [`Clock::transitions`].
    pub fn add_clock(&mut self, dag: &mut Dag, clock: &Clock) -> Result<usize> {
        self.add_strikes(clock.count, clock.transitions(dag))
    }

    /// Adds pulse-width modulation, see [`Scene::add_clock`].
    ///
    /// # Errors
    /// Those of [`Pwm::transitions`]; [`Error::Unsupported`] for projected systems.
    pub fn add_pwm(&mut self, dag: &mut Dag, pwm: &Pwm) -> Result<usize> {
        self.add_strikes(pwm.count, pwm.transitions(dag))
    }

    fn add_strikes(&mut self, count: usize, all: Result<Vec<Transition>>) -> Result<usize> {
        is_state(count, self.dims().x)?;
        let first = self.transitions.len();
        self.transitions.extend(all?);
        Ok(first)
    }

    /// The transitions in the order they were added.
    pub fn transitions(&self) -> &[Transition] {
        &self.transitions
    }

    /// Sets the rate `h_i` of state `i` beside coordinates and velocities: an expression of states, controls, parameters and time, which may switch.
    pub fn set_state_rate(&mut self, i: usize, rate: Id) -> Result<()> {
        let n = self.states.len() - self.discrete.len();
        let place = self.states[..n].get_mut(i);
        *place.ok_or_else(|| {
            Error::Range(format!("state {i} beside coordinates and velocities does not exist: the scene has {n}"))
        })? = Some(rate);
        Ok(())
    }

    /// Adds a contact and returns its index.
    pub fn add_contact(&mut self, c: Contact) -> Result<usize> {
        let (k, name) = (self.contacts.len(), &c.name);
        if c.tangents.len() > 2 {
            return Err(Error::Range(format!(
                "contact {name} has {} tangents: one in the plane, two in space",
                c.tangents.len()
            )));
        }
        if let Some(other) = self.by_gap.get(&c.gap).and_then(|&o| self.contacts.get(o)) {
            return Err(Error::State(format!(
                "contact {name} has the gap of contact {}: the same contact twice would share its force at will",
                other.name()
            )));
        }
        self.check_name(name)?;
        self.by_gap.insert(c.gap, k);
        Ok(self.add(Part::Contact(c, More::default())))
    }

    /// Sets the coefficient of friction by which a contact sticks, where it is larger than that by which it slides: an expression of
    /// coordinates, parameters and time. Impacts know the coefficient of sliding only.
    ///
    /// # Errors
    /// [`Error::Range`] for an index that is not that of a contact with tangents.
    pub fn set_stiction(&mut self, contact: usize, stiction: Id) -> Result<()> {
        match self.contacts.get_mut(contact) {
            Some(Part::Contact(c, more)) if !c.tangents.is_empty() => {
                more.stiction = Some(stiction);
                Ok(())
            }
            Some(part) => Err(Error::Range(format!("{} is no contact with tangents: it cannot stick", part.name()))),
            None => {
                Err(Error::Range(format!("contact {contact} does not exist: the scene has {}", self.contacts.len())))
            }
        }
    }

    /// Gives a lower bound of the gap of a contact, an expression of coordinates, parameters and time, as of two bodies the distance of spheres
    /// around them. Contacts with the same expression are not looked at while it is positive. Nothing checks that the gap is not less.
    ///
    /// # Errors
    /// [`Error::Range`] for an index that is not that of a contact.
    pub fn set_separation(&mut self, contact: usize, separation: Id) -> Result<()> {
        match self.contacts.get_mut(contact) {
            Some(Part::Contact(_, more)) => {
                more.separation = Some(separation);
                Ok(())
            }
            Some(part) => Err(Error::Range(format!("{} is no contact: it has no gap", part.name()))),
            None => {
                Err(Error::Range(format!("contact {contact} does not exist: the scene has {}", self.contacts.len())))
            }
        }
    }

    /// Adds dry friction at a joint and returns its index among the contacts.
    ///
    /// # Errors
    /// [`Error::State`] for a name that is there already, [`Error::Unsupported`] for projected systems.
    pub fn add_friction(&mut self, f: Friction) -> Result<usize> {
        self.check_name(&f.name)?;
        self.check_mechanical("dry friction")?;
        Ok(self.add(Part::Friction(f)))
    }

    /// Adds a constraint and returns its index among the contacts.
    ///
    /// # Errors
    /// [`Error::State`] for a name that is there already, [`Error::Unsupported`] for projected systems.
    pub fn add_constraint(&mut self, c: Constraint) -> Result<usize> {
        self.check_name(&c.name)?;
        self.check_mechanical("a constraint that is always closed")?;
        Ok(self.add(Part::Constraint(c)))
    }

    fn check_name(&self, name: &str) -> Result<()> {
        if self.by_name.contains_key(name) {
            return Err(Error::State(format!("there is a contact {name} already: give each a name of its own")));
        }
        Ok(())
    }

    fn check_mechanical(&self, what: &str) -> Result<()> {
        if self.order == Order::First {
            return Err(Error::Unsupported(format!("a projected system has no velocities, and takes no {what}")));
        }
        Ok(())
    }

    fn add(&mut self, part: Part) -> usize {
        let k = self.contacts.len();
        self.by_name.insert(part.name().to_owned(), k);
        self.contacts.push(part);
        k
    }

    /// Sets the law for several contacts that close at once.
    pub fn set_law(&mut self, law: ImpactLaw) {
        self.law = law;
    }

    /// States that coordinate `i` stays between `low` and `high`: contacts that cannot close there are left out. A simulation
    /// that leaves the bounds ends with an error if something was left out for them. An infinite bound says nothing about its
    /// side; two take back what was said before.
    ///
    /// # Errors
    /// [`Error::Range`] for a coordinate that does not exist, and for bounds between which no number is.
    pub fn set_bounds(&mut self, i: usize, low: f64, high: f64) -> Result<()> {
        let n = self.bounds.len();
        if low.is_nan() || high.is_nan() {
            return Err(Error::Range(format!(
                "the bounds of coordinate {i} are {low} and {high}: where there is no bound give -inf or inf"
            )));
        }
        if low > high || low == f64::INFINITY || high == f64::NEG_INFINITY {
            return Err(Error::Range(format!(
                "the bounds of coordinate {i} are {low} and {high}: the lower comes first"
            )));
        }
        let place = self.bounds.get_mut(i);
        let known = low.is_finite() || high.is_finite();
        *place.ok_or_else(|| Error::Range(format!("coordinate {i} does not exist: the scene has {n}")))? =
            known.then_some((low, high));
        Ok(())
    }

    fn expect(&self, what: &str, n: usize, expected: usize) -> Result<()> {
        if n != expected {
            return Err(Error::Dimension(format!("{}: {n} {what}, expected {expected}", self.name)));
        }
        Ok(())
    }

    /// Builds the system with the expressions of a [`Graph`].
    pub fn build(&self, graph: &Graph) -> Result<Built> {
        self.build_in(&mut graph.dag())
    }

    /// Builds the system.
    ///
    /// # Errors
    /// [`Error::State`] if a force or the rates of the coordinates are missing, [`Error::Range`] if a gap depends on
    /// velocities or controls, or not on coordinates, or something is not linear where it has to be,
    /// [`Error::Unsupported`] for operators that switch elsewhere than in forces and rates of further states, and those of [`ExprFunction::new`].
    pub fn build_in(&self, dag: &mut Dag) -> Result<Built> {
        Builder::new(self, dag).build()
    }
}

/// The steps of [`Scene::build_in`].
struct Builder<'a> {
    scene: &'a Scene,
    dag: &'a mut Dag,
    /// Functions of what contacts touch, by their expressions: bodies alike share them.
    alike: BTreeMap<String, Arc<Shape>>,
    /// Lower bounds of gaps, and their functions by expressions.
    separations: BTreeMap<Id, Arc<Separation>>,
    distances: BTreeMap<String, SharedFunction>,
}

impl<'a> Builder<'a> {
    fn new(scene: &'a Scene, dag: &'a mut Dag) -> Builder<'a> {
        Builder { scene, dag, alike: BTreeMap::new(), separations: BTreeMap::new(), distances: BTreeMap::new() }
    }
}

impl Builder<'_> {
    fn build(mut self) -> Result<Built> {
        let s = self.scene;
        let rates = self.rates()?;
        let force = self.force()?;
        if let Some(switching) = self.switching(&force)? {
            return self.build_switching(&rates, switching);
        }
        self.assemble(s, rates, force, Vec::new(), None)
    }

    /// The system, with the switches of `smooth`; the report is on the scene `s` as it was stated.
    fn assemble(
        mut self,
        stated: &Scene,
        rates: Vec<Id>,
        force: Vec<Id>,
        mut switches: Vec<system::Contact>,
        smooth: Option<(SharedFunction, Vec<[usize; 2]>)>,
    ) -> Result<Built> {
        let s = self.scene;
        let dims = s.dims();
        let (dropped, kept) = self.reachable()?;
        let mut contacts = Vec::new();
        for &k in &kept {
            contacts.push(self.contact(k, &rates)?);
        }
        let (smooth, products) = match smooth {
            Some(known) => known,
            None => {
                let mut smooth = rates.clone();
                smooth.extend_from_slice(&force);
                smooth.extend(self.state_rates()?);
                (self.function("smooth", dims, &smooth)?, Vec::new())
            }
        };
        let n_switches = switches.len();
        contacts.append(&mut switches);
        let inertia = self.inertia()?;
        // elements take no flow that switches
        let projection = if n_switches > 0 { None } else { self.projection(&force)? };
        let bounds = if dropped.is_empty() { Vec::new() } else { s.bounds.clone() };
        let mechanics = Mechanics {
            order: s.order,
            n_q: s.n_q,
            n_v: s.n_v,
            n_z: s.states.len(),
            n_switches,
            products,
            smooth,
            inertia,
            contacts,
            law: s.law,
            bounds,
            projection,
        };
        let mut report = Report::new(stated, &mechanics, &kept, dropped);
        for (line, &k) in report.contacts.iter_mut().zip(&kept) {
            line.inner = stated.contacts[k].gap().map_or(0, |gap| self.dag.inner_unknowns(&[gap]));
        }
        report.transitions = stated.transitions.iter().map(|t| t.text(self.dag, &s.names)).collect();
        let mut system = System::of_mechanics(mechanics, dims.u, dims.p)?;
        for (k, t) in stated.transitions.iter().enumerate() {
            let f = transition::functions(self.dag, k, dims, &s.names, t)?;
            system.add_transition(f.made(t))?;
            system.add_known_times(&f.times)?;
        }
        Ok(Built { system, report, dims, names: s.names.clone() })
    }

    fn text(&self, id: Id) -> String {
        self.dag.text_with(id, &|block, i| self.scene.names.of(block, i))
    }

    /// Refuses conditions, and what switches where switches are not for.
    fn check_value(&self, what: &str, id: Id) -> Result<()> {
        if self.dag.is_condition(id) {
            return Err(Error::Range(format!("{what} is a condition: choose values with where")));
        }
        if self.dag.has_floor(&[id]) {
            return Err(Error::Unsupported(format!(
                "{what} has floor, which jumps again and again: a scene does not take it"
            )));
        }
        Ok(())
    }

    /// Refuses what switches or is a condition.
    fn check_smooth(&self, what: &str, id: Id) -> Result<()> {
        if self.dag.is_condition(id) {
            return Err(Error::Range(format!("{what} is a condition: choose values with where")));
        }
        match self.dag.switches_of(&[id]).first().and_then(|&s| self.dag.switching_function(s)) {
            Some(psi) => Err(Error::Unsupported(format!(
                "{what} switches where {} vanishes: only forces and the rates of further states may, and the flow of a projected \
                 system; what pushes on one side only is a contact, dry friction is the friction of one",
                self.text(psi)
            ))),
            None => Ok(()),
        }
    }

    /// `q̇` as expressions.
    fn rates(&mut self) -> Result<Vec<Id>> {
        let s = self.scene;
        if s.order == Order::First {
            return Ok(Vec::new());
        }
        let Some(rates) = &s.rates else {
            if s.n_q != s.n_v {
                return Err(Error::State(format!(
                    "{}: {} coordinates and {} velocities: say how the coordinates move (set_rates)",
                    s.name, s.n_q, s.n_v
                )));
            }
            return Ok((0..s.n_v).map(|i| self.dag.input(Block::X, s.n_q + i)).collect());
        };
        for (i, &r) in rates.iter().enumerate() {
            let what = format!("the rate of {}", s.names.of(Block::X, i));
            self.check_smooth(&what, r)?;
            self.check_beside(&what, r)?;
            self.check_linear(&what, r)?;
        }
        Ok(rates.clone())
    }

    /// The rates of the states beside coordinates and velocities.
    fn state_rates(&mut self) -> Result<Vec<Id>> {
        let s = self.scene;
        let mut out = Vec::with_capacity(s.states.len());
        let driven = s.states.len() - s.discrete.len();
        for (i, h) in s.states.iter().enumerate() {
            if i >= driven {
                out.push(self.dag.constant(0.0));
                continue;
            }
            let name = s.names.of(Block::X, s.n_q + s.n_v + i);
            let h = h.ok_or_else(|| Error::State(format!("{}: there is no rate of {name}; set it", s.name)))?;
            self.check_value(&format!("the rate of {name}"), h)?;
            out.push(h);
        }
        Ok(out)
    }

    /// Refuses what depends on states beside coordinates and velocities: only forces, bounds of friction and rates of such states do.
    fn check_beside(&self, what: &str, id: Id) -> Result<()> {
        let s = self.scene;
        if s.order == Order::Second && self.depends(id, Block::X, s.n_q + s.n_v - s.beside) {
            return Err(Error::Range(format!(
                "{what}, {}, depends on states beside coordinates and velocities: only forces, bounds of friction at joints \
                 and the rates of such states may",
                self.text(id)
            )));
        }
        Ok(())
    }

    /// Where expressions of the graph of the scene are differentiated.
    fn frame(&mut self) -> Frame<'_> {
        let (n_q, n_v) = self.scene.sizes();
        Frame { dag: self.dag, n_q, n_v, dims: self.scene.dims() }
    }

    /// Is an expression linear in the velocities?
    fn check_linear(&mut self, what: &str, id: Id) -> Result<()> {
        if !self.frame().is_linear(id)? {
            return Err(Error::Range(format!("{what}, {}, must be linear in the velocities", self.text(id))));
        }
        Ok(())
    }

    fn force(&mut self) -> Result<Vec<Id>> {
        let s = self.scene;
        let mut out = Vec::with_capacity(s.n_v);
        for (i, f) in s.force.iter().enumerate() {
            let name = s.names.of(Block::X, s.n_q + i);
            let f = f.ok_or_else(|| {
                Error::State(format!("{}: there is no force on {name}; set it to 0 if there is none", s.name))
            })?;
            self.check_value(&format!("the force on {name}"), f)?;
            out.push(f);
        }
        Ok(out)
    }

    /// Which contacts can close, within the bounds of the coordinates if there are any, and proofs for the others.
    ///
    /// # Errors
    /// [`Error::Range`] for a gap that is never negative: where it is zero it is smallest, and a smooth function has no
    /// gradient there that a force could follow.
    fn reachable(&self) -> Result<(Vec<Dropped>, Vec<usize>)> {
        let s = self.scene;
        let gaps: Vec<Id> = s.contacts.iter().filter_map(Part::gap).collect();
        let anywhere = Bounds::within(self.dag, &gaps, &|_, _| ALL);
        let within = |block: Block, i: usize| match (block, s.bounds.get(i).copied().flatten()) {
            (Block::X, Some((low, high))) => Interval { low, high },
            _ => ALL,
        };
        let bounded = s.bounds.iter().any(Option::is_some).then(|| Bounds::within(self.dag, &gaps, &within));
        let (mut dropped, mut kept) = (Vec::new(), Vec::new());
        for (k, part) in s.contacts.iter().enumerate() {
            let Part::Contact(c, _) = part else {
                kept.push(k);
                continue;
            };
            if self.dag.as_const(c.gap).is_some() || self.sees_motion(c.gap) {
                // refused below
                kept.push(k);
                continue;
            }
            let least = anywhere.get(c.gap).low;
            let there = bounded.as_ref().map_or(least, |b| b.get(c.gap).low);
            if there > 0.0 {
                let place = if least > 0.0 { "everywhere" } else { "within the bounds of the coordinates" };
                let proof = format!("{} is at least {there} {place}", self.text(c.gap));
                dropped.push(Dropped { contact: k, name: c.name.clone(), proof });
            } else if least >= 0.0 {
                return Err(Error::Range(format!(
                    "the gap of contact {}, {}, is never negative: its gradient vanishes, or there is none, where it \
                     closes; state the gap as a distance that changes its sign where the bodies would overlap, not as a \
                     power or a size of one",
                    c.name,
                    self.text(c.gap)
                )));
            } else {
                kept.push(k);
            }
        }
        Ok((dropped, kept))
    }

    /// Does an expression depend on velocities or controls?
    fn sees_motion(&self, id: Id) -> bool {
        let s = self.scene;
        (s.order == Order::Second && self.depends(id, Block::X, s.n_q)) || self.depends(id, Block::U, 0)
    }

    /// Does an expression depend on these inputs?
    fn depends(&self, id: Id, block: Block, from: usize) -> bool {
        let all = self.dag.reachable(&[id]);
        all.iter()
            .any(|&n| matches!(self.dag.node(n), crate::expr::Node::Input(b, i) if b == block && i as usize >= from))
    }

    fn contact(&mut self, k: usize, rates: &[Id]) -> Result<system::Contact> {
        let s = self.scene;
        let zero = self.dag.constant(0.0);
        let alone = |name: &str, gap: Id| Contact {
            name: name.to_owned(),
            gap,
            tangents: Vec::new(),
            friction: zero,
            restitution: zero,
        };
        let stated = match &s.contacts[k] {
            Part::Contact(c, more) => {
                let mut made = self.unilateral(c, more.stiction, rates)?;
                if let (Some(id), Some(l)) = (more.separation, &mut made.local) {
                    l.separation = Some(self.separation(&c.name, id)?);
                }
                return Ok(made);
            }
            Part::Friction(f) => {
                self.check_friction(f)?;
                let contact = Contact { tangents: vec![f.sliding], friction: f.bound, ..alone(&f.name, zero) };
                Stated { contact, kind: Kind::Joint, stiction: f.stiction }
            }
            Part::Constraint(c) => {
                let what = format!("constraint {}", c.name);
                self.check_moved(&what, c.zero)?;
                Stated { contact: alone(&c.name, c.zero), kind: Kind::Bilateral, stiction: None }
            }
        };
        self.shaped(&stated, rates)
    }

    /// Refuses what is no smooth expression of what moves: coordinates, velocities, parameters and time.
    fn check_moved(&self, what: &str, id: Id) -> Result<()> {
        self.check_smooth(what, id)?;
        self.check_beside(what, id)?;
        if self.depends(id, Block::U, 0) {
            return Err(Error::Range(format!(
                "{what}, {}, depends on controls: it may depend on coordinates, velocities, parameters and time",
                self.text(id)
            )));
        }
        Ok(())
    }

    /// Checks the expressions of dry friction.
    fn check_friction(&self, f: &Friction) -> Result<()> {
        let name = &f.name;
        self.check_moved(&format!("what slides at joint {name}"), f.sliding)?;
        let bounds = [Some(f.bound), f.stiction];
        for bound in bounds.into_iter().flatten() {
            self.check_smooth(&format!("the bound of friction {name}"), bound)?;
            if let Some(v) = self.dag.as_const(bound).filter(|v| !(*v >= 0.0 && v.is_finite())) {
                return Err(Error::Range(format!("the bound of friction {name} is {v}: it must not be negative")));
            }
        }
        self.check_stiction(&format!("joint {name}"), f.bound, f.stiction)
    }

    /// Is what sticks held by no less than what slides, where both are constants?
    fn check_stiction(&self, what: &str, slides: Id, sticks: Option<Id>) -> Result<()> {
        let Some(sticks) = sticks else { return Ok(()) };
        match (self.dag.as_const(slides), self.dag.as_const(sticks)) {
            (Some(a), Some(b)) if b.is_nan() || b < a => {
                Err(Error::Range(format!("{what} sticks by {b} and slides with {a}: what holds must not be less")))
            }
            _ => Ok(()),
        }
    }

    fn unilateral(&mut self, c: &Contact, stiction: Option<Id>, rates: &[Id]) -> Result<system::Contact> {
        let s = self.scene;
        let name = &c.name;
        self.check_smooth(&format!("the gap of contact {name}"), c.gap)?;
        let mut parts = vec![("gap", c.gap), ("friction", c.friction), ("restitution", c.restitution)];
        parts.extend(stiction.map(|id| ("friction for sticking", id)));
        for (what, id) in parts {
            self.check_smooth(&format!("the {what} of contact {name}"), id)?;
            if self.sees_motion(id) {
                return Err(Error::Range(format!(
                    "the {what} of contact {name}, {}, depends on velocities or controls: it may depend on coordinates, \
                     parameters and time",
                    self.text(id)
                )));
            }
        }
        self.check_stiction(&format!("contact {name}"), c.friction, stiction)?;
        for (what, id, most) in [("friction", c.friction, f64::MAX), ("restitution", c.restitution, 1.0)] {
            if let Some(v) = self.dag.as_const(id).filter(|v| !(*v >= 0.0 && *v <= most)) {
                let range = if most == 1.0 { "between 0 and 1" } else { "not negative" };
                return Err(Error::Range(format!("the {what} of contact {name} is {v}: it must be {range}")));
            }
        }
        if s.order == Order::First {
            let zero = self.dag.constant(0.0);
            if !c.tangents.is_empty() || c.friction != zero || c.restitution != zero {
                return Err(Error::Range(format!(
                    "constraint {name} of a projected system has tangents, friction or restitution: there are no velocities"
                )));
            }
            let contact = Contact { tangents: Vec::new(), ..c.clone() };
            return self.shaped(&Stated { contact, kind: Kind::Unilateral, stiction: None }, rates);
        }
        // without friction there is nothing to slide along; friction that nothing slides along would be ignored
        let zero = |id: Id| self.dag.as_const(id) == Some(0.0);
        let frictionless = zero(c.friction) && stiction.is_none_or(zero);
        if !frictionless && c.tangents.is_empty() {
            return Err(Error::Range(format!(
                "contact {} has friction and no tangents: give one in the plane, two in space",
                c.name
            )));
        }
        let tangents: &[Id] = if frictionless { &[] } else { &c.tangents };
        for &tangent in tangents {
            self.check_smooth(&format!("a tangent of contact {name}"), tangent)?;
            self.check_beside(&format!("a tangent of contact {name}"), tangent)?;
        }
        let contact = Contact { tangents: tangents.to_vec(), ..c.clone() };
        let stiction = stiction.filter(|_| !frictionless);
        self.shaped(&Stated { contact, kind: Kind::Unilateral, stiction }, rates)
    }

    /// A lower bound of the gaps of contacts that have this expression.
    fn separation(&mut self, name: &str, id: Id) -> Result<Arc<Separation>> {
        if let Some(s) = self.separations.get(&id) {
            return Ok(s.clone());
        }
        let what = format!("the lower bound of the gap of contact {name}");
        self.check_smooth(&what, id)?;
        if self.sees_motion(id) {
            return Err(Error::Range(format!(
                "{what}, {}, depends on velocities or controls: it may depend on coordinates, parameters and time",
                self.text(id)
            )));
        }
        let inputs = self.dag.reachable(&[id]).into_iter().filter_map(|n| match self.dag.node(n) {
            crate::expr::Node::Input(Block::X, i) => Some(i as usize),
            _ => None,
        });
        let mut coordinates: Vec<usize> = inputs.collect();
        coordinates.sort_unstable();
        let place = |block: Block, i: usize| match block {
            Block::X => coordinates.binary_search(&i).unwrap_or(i),
            _ => i,
        };
        let dims = Dims { x: coordinates.len(), ..self.scene.dims() };
        let key = SavedGraph::new(self.dag, &[id]).map(|g| format!("{:?}", g.renumbered(&place)));
        let known = key.as_ref().ok().and_then(|k| self.distances.get(k).cloned());
        let distance = match known {
            Some(f) => f,
            None => {
                let outputs = self.dag.renumber(&[id], &place);
                let f: SharedFunction =
                    Arc::new(ExprFunction::values("lower bound of gaps", self.dag, dims, &outputs)?);
                key.into_iter().for_each(|k| drop(self.distances.insert(k, f.clone())));
                f
            }
        };
        let made = Arc::new(Separation { coordinates, distance });
        self.separations.insert(id, made.clone());
        Ok(made)
    }

    /// What is wrong with a contact, in words.
    fn flaw(&self, s: &Stated, flaw: Flaw) -> Error {
        let c = &s.contact;
        let name = &c.name;
        match flaw {
            Flaw::Gap if s.kind == Kind::Bilateral => {
                Error::Range(format!("constraint {name}, {}, does not depend on anything that moves", self.text(c.gap)))
            }
            Flaw::Linear => Error::Range(format!(
                "constraint {name}, {}, contains velocities: then it must be linear in them",
                self.text(c.gap)
            )),
            Flaw::Tangent(k, why) if s.kind == Kind::Joint => {
                Error::Range(format!("what slides at joint {name}, {}, {why}", self.text(c.tangents[k])))
            }
            Flaw::Gap if self.scene.order == Order::First => {
                Error::Range(format!("constraint {name}, {}, does not depend on any state", self.text(c.gap)))
            }
            Flaw::Gap => Error::Range(format!(
                "the gap of contact {name}, {}, does not depend on anything that moves",
                self.text(c.gap)
            )),
            Flaw::Tangent(k, why) => {
                Error::Range(format!("a tangent of contact {name}, {}, {why}", self.text(c.tangents[k])))
            }
            Flaw::Other(e) => e,
        }
    }

    /// The functions of a contact: those of another one that is alike, or new ones.
    fn shaped(&mut self, stated: &Stated, rates: &[Id]) -> Result<system::Contact> {
        let (s, dims) = (self.scene, self.scene.dims());
        let c = &stated.contact;
        let Ok(excerpt) = Excerpt::new(self.dag, s, stated, rates) else {
            // what cannot be copied is differentiated where it is
            let parts = Parts {
                kind: stated.kind,
                gap: c.gap,
                friction: c.friction,
                restitution: c.restitution,
                tangents: c.tangents.clone(),
                stiction: stated.stiction,
                rates: rates.to_vec(),
            };
            let made = Shape::new(&mut self.frame(), s.order, &c.name, &parts);
            let shape = made.map_err(|e| self.flaw(stated, e))?;
            return Ok(shape.contact(&c.name, &Places::all([s.n_q, s.n_v, s.states.len()]), dims));
        };
        let key = excerpt.key(&c.name);
        let shape = match self.alike.get(&key) {
            Some(shape) => shape.clone(),
            None => {
                let made = excerpt.shape(self.dag.external_functions(), s.order, &c.name, dims);
                let shape = made.map_err(|e| self.flaw(stated, e))?;
                self.alike.insert(key, shape.clone());
                shape
            }
        };
        Ok(shape.contact(&c.name, &excerpt.places, dims))
    }

    /// What finite elements need of a projected system. Constraints that bounds of the states exclude are there too: elements do not know
    /// these bounds.
    fn projection(&mut self, force: &[Id]) -> Result<Option<Projection>> {
        let (s, dims) = (self.scene, self.scene.dims());
        if s.order != Order::First {
            return Ok(None);
        }
        let moving = |gap: &Id| self.dag.as_const(*gap).is_none();
        let gaps: Vec<Id> = s.contacts.iter().filter_map(Part::gap).filter(moving).collect();
        let x = self.dag.inputs(Block::X, s.n_v);
        let multipliers: Vec<Id> = (0..gaps.len()).map(|i| self.dag.input(Block::X, dims.x + i)).collect();
        let mut push = vec![self.dag.constant(0.0); s.n_v];
        for (i, slope) in self.dag.gradient(&gaps, &multipliers, &x)? {
            push[i] = slope;
        }
        let mut smooth = force.to_vec();
        if let Some(inertia) = &s.inertia {
            smooth = self.dag.solve(inertia, &smooth)?;
            push = self.dag.solve(inertia, &push)?;
        }
        // discrete states rest
        let zero = self.dag.constant(0.0);
        [&mut smooth, &mut push].into_iter().for_each(|f| f.resize(dims.x, zero));
        let wide = Dims { x: dims.x + gaps.len(), ..dims };
        let mut make = |name: &str, dims: Dims, outputs: &[Id]| -> Result<SharedFunction> {
            Ok(Arc::new(ExprFunction::new(name, self.dag, dims, outputs)?))
        };
        Ok(Some(Projection {
            smooth: make("f", dims, &smooth)?,
            push: make("push of the constraints", wide, &push)?,
            constraints: make("constraints", dims, &gaps)?,
        }))
    }

    fn inertia(&mut self) -> Result<Inertia> {
        let (s, dims) = (self.scene, self.scene.dims());
        let Some(entries) = &s.inertia else { return Ok(Inertia::Identity) };
        let n = s.n_v;
        for (k, &e) in entries.iter().enumerate() {
            let (i, j) = (k / n, k % n);
            let what = format!("entry ({i}, {j}) of the inertia");
            self.check_smooth(&what, e)?;
            let velocities = s.order == Order::Second && self.depends(e, Block::X, s.n_q);
            if velocities || self.depends(e, Block::U, 0) {
                return Err(Error::Range(format!(
                    "{what}, {}, depends on velocities or controls: it may depend on coordinates, parameters and time",
                    self.text(e)
                )));
            }
        }
        let values: Option<Vec<f64>> = entries.iter().map(|&e| self.dag.as_const(e)).collect();
        if let Some(m) = values {
            check_symmetric(&s.name, &m, n)?;
            return Ok(Inertia::Constant(m));
        }
        let a: Vec<Id> = (0..n).map(|i| self.dag.input(Block::P, dims.p + i)).collect();
        let product = self.dag.matmul(n, n, 1, entries, &a)?;
        let matrix = self.function("inertia", dims, entries)?;
        let product = self.function("inertia times acceleration", Dims { p: dims.p + n, ..dims }, &product)?;
        Ok(Inertia::Varying { matrix, product })
    }

    fn function(&mut self, name: &str, dims: Dims, outputs: &[Id]) -> Result<SharedFunction> {
        Ok(Arc::new(ExprFunction::first_order(name, self.dag, dims, outputs)?))
    }
}

fn check_symmetric(name: &str, m: &[f64], n: usize) -> Result<()> {
    for i in 0..n {
        for j in 0..i {
            let (a, b) = (m[i * n + j], m[j * n + i]);
            // the same number written twice
            if (a - b).abs() > 4.0 * f64::EPSILON * a.abs().max(b.abs()) {
                return Err(Error::Range(format!(
                    "{name}: the inertia is not symmetric: entry ({i}, {j}) is {a}, entry ({j}, {i}) is {b}"
                )));
            }
        }
    }
    Ok(())
}
