//! Time-freezing: systems whose state jumps as piecewise smooth systems in a *numerical time* `τ` (chapters 8 and 9 of the
//! thesis of A. Nurkanović).
//!
//! The states get a clock `t`. Where the state of the scene moves, the clock runs; where it jumps, the clock stands still and
//! auxiliary dynamics take the velocities from one side of the jump to the other. What counts is where the clock runs: there the
//! states over `t` are those of the scene.
//!
//! ```text
//! every contact free:   q' = N(q) v,   v' = M⁻¹ f_v,          t' = 1
//! else, a contact e = 0: q' = 0,       v' = M⁻¹ (n − μ B s/|s|) a_n,   t' = 0        (8.31), (8.44)
//!       a contact e > 0: p' = nᵀv,     v' = M⁻¹ n (−k p − c nᵀv)/D,    t' = 0        (8.15), with D = nᵀM⁻¹n
//! ```
//!
//! A contact with `e = 0` is free where its gap or the rate of its gap is positive: closed contacts are sliding modes on both
//! surfaces, in which the clock runs with `γ = D a_n/(D a_n − φ)`. A contact with `e > 0` is free where `g + p > 0`: `p` is how deep
//! the bodies would be in each other, so the surface is crossed on the way in and on the way out, and the coordinates stay where the
//! contact is. The auxiliary force is divided by `D`: without that the restitution is the given one only where `D = 1` (the printed
//! (8.12) and (8.15) lack it).
//!
//! Where bodies overlap and move apart (`g < 0`, `ġ > 0`), which no solution reaches, the coordinates are driven out besides with the
//! typical speed. The thesis has the free motion alone there. On `g = 0`, `ġ = 0` both fields of the free motion are then the same, and only the
//! sum of their weights is determined: Newton's method on such active sets is singular, and simulations by finite elements stall in
//! contact. With the push `dg/dτ = 0` makes the weight of that region zero, and all weights are unique.
//!
//! Cones of friction in space (two tangents) are (8.52): inside a sliding speed `ε_t` the auxiliary force accelerates up to it, so
//! what sticks creeps with `ε_t`.

mod contacts;
mod hysteresis;
mod mechanics;
mod report;

use crate::error::{Error, Result};
use crate::expr::{Block, Dag, Graph, Id};
use crate::func::{Dims, Function, Point};
use crate::model::{self, Model, Names};
use crate::scene::{Equations, Scene};
use crate::system::Mechanics;
pub use hysteresis::{freeze_relay, Relay};
pub use report::{ContactReport, Kind, Report};

/// How a scene is made a piecewise smooth system.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Numerical time that a jump should take: the length of an integration step, or of a finite element. `a_n` and `k` that are
    /// not given follow from it.
    pub step: f64,
    /// Rate at which gaps usually close: `a_n = speed/(D step)`.
    pub speed: f64,
    /// Largest normal force that usually holds a contact closed: `a_n` that is not given is twice that at least, so that the clock
    /// runs in contact at two thirds of its speed or faster; 0: not known.
    pub force: f64,
    /// `a_n` of all contacts with `e = 0`; 0: as recommended.
    pub a_n: f64,
    /// `k` of all contacts with `e > 0`; 0: as recommended, so that a jump takes `step`.
    pub stiffness: f64,
    /// Speed below which a contact in space counts as sticking; 0: a thousandth of `speed`.
    pub creep: f64,
    /// Add a control behind the others by which all rates are multiplied: the speed of time (8.58).
    pub speed_of_time: bool,
    /// Expressions of states, controls, parameters and time of the scene whose integrals over physical time are states behind the
    /// clock (8.55).
    pub costs: Vec<Id>,
    /// State of the scene where `D` is taken; empty: zeros.
    pub at: Vec<f64>,
    /// Parameters there; empty: zeros.
    pub params: Vec<f64>,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            step: 0.1,
            speed: 1.0,
            force: 0.0,
            a_n: 0.0,
            stiffness: 0.0,
            creep: 0.0,
            speed_of_time: false,
            costs: Vec::new(),
            at: Vec::new(),
            params: Vec::new(),
        }
    }
}

/// Places of states and controls in a system in numerical time. The states of the scene come first and keep their numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Depths `p` of contacts with restitution: states `depths.0 .. depths.1`.
    pub depths: (usize, usize),
    /// The clock.
    pub clock: usize,
    /// Integrals of costs.
    pub costs: (usize, usize),
    /// The control that is the speed of time.
    pub speed: Option<usize>,
}

/// A system in numerical time.
#[derive(Clone)]
pub struct Frozen {
    /// The model.
    pub model: model::Built,
    /// Places of its states and controls.
    pub layout: Layout,
    /// Report on every contact.
    pub report: Report,
}

/// Makes a scene a piecewise smooth system in numerical time with the expressions of its [`Graph`].
///
/// # Errors
/// As [`freeze_in`].
pub fn freeze(scene: &Scene, graph: &Graph, options: &Options) -> Result<Frozen> {
    freeze_in(scene, &mut graph.dag(), options)
}

/// Makes a scene a piecewise smooth system in numerical time.
///
/// # Errors
/// Those of [`Scene::build_in`]; [`Error::Range`] for options that are not positive or not finite; [`Error::Unsupported`] for
/// restitution that is no number, and for friction beside restitution; [`Error::Range`] where `D` has no positive value.
pub fn freeze_in(scene: &Scene, dag: &mut Dag, options: &Options) -> Result<Frozen> {
    options.check(scene.dims())?;
    let parts = scene.equations(dag)?;
    freeze_equations(&Source { name: scene.name(), names: scene.names(), dims: scene.dims() }, parts, dag, options)
}

/// Makes the equations of motion of a scene that is built a piecewise smooth system in numerical time; `dims` has the sizes of the scene, or
/// more controls and parameters behind those of the scene, which only costs know.
///
/// # Errors
/// As [`freeze_in`], and [`Error::Unsupported`] for functions that are no expressions.
pub fn freeze_mechanics(m: &Mechanics, dims: Dims, dag: &mut Dag, options: &Options) -> Result<Frozen> {
    options.check(dims)?;
    let parts = mechanics::equations(dag, m)?;
    freeze_equations(&Source { name: "scene", names: &Names::default(), dims }, parts, dag, options)
}

/// What is frozen.
struct Source<'a> {
    name: &'a str,
    names: &'a Names,
    dims: Dims,
}

fn freeze_equations(source: &Source, parts: Equations, dag: &mut Dag, options: &Options) -> Result<Frozen> {
    let d = source.dims;
    let elastic = parts.contacts.iter().filter(|c| dag.as_const(c.restitution) != Some(0.0)).count();
    let clock = d.x + elastic;
    let layout = Layout {
        depths: (d.x, clock),
        clock,
        costs: (clock + 1, clock + 1 + options.costs.len()),
        speed: options.speed_of_time.then_some(d.u),
    };
    let (parts, costs) = on_the_clock(dag, parts, &options.costs, clock);
    let made = contacts::Contacts::new(d, dag, &parts, options)?;
    let rhs = made.rhs(dag, &parts, &costs, &layout)?;
    let nu = d.u + usize::from(options.speed_of_time);
    let mut model = Model::new(&format!("{}, time frozen", source.name), rhs.len(), nu, d.p)?;
    model.set_names(names(source, &parts, dag, &layout, nu));
    for (i, id) in rhs.into_iter().enumerate() {
        model.set_derivative(i, id)?;
    }
    Ok(Frozen { model: model.build_in(dag)?, layout, report: made.report })
}

impl Options {
    fn check(&self, d: Dims) -> Result<()> {
        for (name, v, least) in [
            ("step", self.step, f64::MIN_POSITIVE),
            ("speed", self.speed, f64::MIN_POSITIVE),
            ("force", self.force, 0.0),
            ("a_n", self.a_n, 0.0),
            ("stiffness", self.stiffness, 0.0),
            ("creep", self.creep, 0.0),
        ] {
            if !(v >= least && v.is_finite()) {
                let word = if least > 0.0 { "positive" } else { "positive, or 0 where it is not given" };
                return Err(Error::Range(format!("{name} is {v}: it must be {word}")));
            }
        }
        for (what, given, n) in [("states", self.at.len(), d.x), ("parameters", self.params.len(), d.p)] {
            if given != 0 && given != n {
                return Err(Error::Dimension(format!(
                    "{given} {what} of the point where D is taken, the scene has {n}"
                )));
            }
        }
        Ok(())
    }
}

/// The expressions of a scene with its time read from the clock.
fn on_the_clock(dag: &mut Dag, parts: Equations, costs: &[Id], clock: usize) -> (Equations, Vec<Id>) {
    let place = move |block: Block, i: usize| if block == Block::T { (Block::X, clock) } else { (block, i) };
    let mut moved = |all: &[Id]| dag.move_inputs(all, &place);
    let mut out = Equations { rates: moved(&parts.rates), force: moved(&parts.force), ..parts };
    out.inertia = out.inertia.as_deref().map(&mut moved);
    for c in &mut out.contacts {
        let one = moved(&[c.gap, c.rate, c.friction, c.restitution]);
        (c.gap, c.rate, c.friction, c.restitution) = (one[0], one[1], one[2], one[3]);
        c.normal = moved(&c.normal);
        for s in &mut c.sliding {
            s.along = moved(&s.along);
            s.rate = moved(&[s.rate])[0];
        }
    }
    let costs = moved(costs);
    (out, costs)
}

fn names(source: &Source, parts: &Equations, dag: &Dag, layout: &Layout, nu: usize) -> Names {
    let (own, d) = (source.names, source.dims);
    let mut x: Vec<String> = (0..d.x).map(|i| own.x.get(i).cloned().unwrap_or_default()).collect();
    let elastic = parts.contacts.iter().filter(|c| dag.as_const(c.restitution) != Some(0.0));
    x.extend(elastic.map(|c| format!("depth of {}", c.name)));
    x.push("physical time".into());
    x.extend((0..layout.costs.1 - layout.costs.0).map(|k| format!("cost {k}")));
    let mut u: Vec<String> = (0..d.u).map(|i| own.u.get(i).cloned().unwrap_or_default()).collect();
    if nu > d.u {
        u.push("speed of time".into());
    }
    Names { x, u, p: own.p.clone() }
}

/// Values of a function of the scene's states and parameters at a point; an error where there is none.
fn values(f: &dyn Function, x: &[f64], p: &[f64], what: &str) -> Result<Vec<f64>> {
    let d = f.dims();
    let u = vec![0.0; d.u];
    let mut params = p.to_vec();
    params.resize(d.p, 0.0);
    let mut wide = x.to_vec();
    wide.resize(d.x, 0.0);
    let mut out = vec![f64::NAN; f.n_out()];
    let at = Point { t: 0.0, x: &wide, u: &u, p: &params };
    let found = f.value(&at, &mut out, &mut vec![0.0; f.work_len()]);
    if found.is_err() || out.iter().any(|v| !v.is_finite()) {
        return Err(Error::Range(format!("{what} has no value at {x:?}: give a state of the scene where it has one")));
    }
    Ok(out)
}
