//! What stands for every contact: where it is free, and the auxiliary dynamics where it is not.

use super::report::{ContactReport, Kind, Report};
use super::{values, Layout, Options};
use crate::error::{Error, Result};
use crate::expr::{Block, Dag, ExprFunction, Id, Unary};
use crate::func::Dims;
use crate::scene::{ContactEquations, Equations};

/// Share of the typical speed below which a contact in space creeps.
const CREEP: f64 = 1e-3;
/// `a_n` in multiples of the largest normal force, at least: the clock runs in contact with `γ = 1/(1 + λ/a_n)`.
const PRESSED: f64 = 2.0;

/// One contact in numerical time.
struct Frozen {
    /// Condition: it is free.
    free: Id,
    /// What it adds to the rates of the velocities where it is not `[n_v]`.
    push: Vec<Id>,
    /// The rate of its depth, where it has one.
    depth: Option<Id>,
    /// Where bodies overlap and move apart: condition that they do not, and what drives the coordinates out `[n_q]`.
    way_out: Option<(Id, Vec<Id>)>,
}

/// All contacts.
pub(super) struct Contacts {
    all: Vec<Frozen>,
    /// `M⁻¹ f_v`.
    free_motion: Vec<Id>,
    pub report: Report,
}

impl Contacts {
    /// Of a scene with these sizes, whose depths stand behind its states.
    pub fn new(dims: Dims, dag: &mut Dag, parts: &Equations, options: &Options) -> Result<Contacts> {
        let (mut all, mut reports) = (Vec::new(), Vec::new());
        let mut depth = dims.x;
        // the clock is behind the states of the scene, and zero where D is taken
        let wide = Dims { x: dims.x + options.costs.len() + parts.contacts.len() + 1, ..dims };
        for c in &parts.contacts {
            let restitution = dag.as_const(c.restitution).ok_or_else(|| {
                Error::Unsupported(format!("time-freezing: the restitution of contact {} must be a number", c.name))
            })?;
            let along = apply_inverse(dag, parts, &c.normal)?;
            let d = dag.dot(&c.normal, &along)?;
            let scale = inverse_mass(wide, dag, d, options, &c.name)?;
            let (frozen, report) = if restitution == 0.0 {
                inelastic(dag, parts, c, options, (along, d), scale)?
            } else {
                depth += 1;
                elastic(dag, c, options, (along, d), restitution, depth - 1)?
            };
            all.push(frozen);
            reports.push(report);
        }
        let free_motion = apply_inverse(dag, parts, &parts.force)?;
        Ok(Contacts { all, free_motion, report: Report { contacts: reports, step: options.step } })
    }

    /// Rates of all states.
    pub fn rhs(&self, dag: &mut Dag, parts: &Equations, costs: &[Id], layout: &Layout) -> Result<Vec<Id>> {
        let (zero, one) = (dag.constant(0.0), dag.constant(1.0));
        let mut free = dag.truth(true);
        for c in &self.all {
            free = dag.and(free, c.free);
        }
        let mut out = Vec::new();
        for (i, &r) in parts.rates.iter().enumerate() {
            let mut rate = r;
            for (open, way) in self.all.iter().filter_map(|c| c.way_out.as_ref()) {
                let push = dag.select(*open, zero, way[i]);
                rate = dag.add(rate, push);
            }
            out.push(dag.select(free, rate, zero));
        }
        for (i, &f) in self.free_motion.iter().enumerate() {
            let mut rate = dag.select(free, f, zero);
            for c in &self.all {
                let push = dag.select(c.free, zero, c.push[i]);
                rate = dag.add(rate, push);
            }
            out.push(rate);
        }
        for c in &self.all {
            if let Some(rate) = c.depth {
                out.push(dag.select(c.free, zero, rate));
            }
        }
        out.push(dag.select(free, one, zero));
        for &cost in costs {
            out.push(dag.select(free, cost, zero));
        }
        if let Some(k) = layout.speed {
            let speed = dag.input(Block::U, k);
            out = out.into_iter().map(|r| dag.mul(speed, r)).collect();
        }
        Ok(out)
    }
}

/// `M⁻¹ b`.
fn apply_inverse(dag: &mut Dag, parts: &Equations, b: &[Id]) -> Result<Vec<Id>> {
    let Some(m) = &parts.inertia else { return Ok(b.to_vec()) };
    let n = b.len();
    // by columns
    let columns: Vec<Id> = (0..n * n).map(|k| m[(k % n) * n + k / n]).collect();
    dag.solve(&columns, b)
}

/// The value of `D` at the point of the options.
fn inverse_mass(dims: Dims, dag: &mut Dag, d: Id, options: &Options, name: &str) -> Result<f64> {
    let f = ExprFunction::new("D", dag, dims, &[d])?;
    let at = if options.at.is_empty() { vec![0.0; dims.x] } else { options.at.clone() };
    let v = values(&f, &at, &options.params, &format!("n M^-1 n of contact {name}"))?[0];
    if v > 0.0 {
        return Ok(v);
    }
    Err(Error::Range(format!(
        "n M^-1 n of contact {name} is {v} at {at:?}: its gap has no gradient there, give another state of the scene"
    )))
}

/// (8.28), (8.31), (8.44), (8.52).
fn inelastic(
    dag: &mut Dag,
    parts: &Equations,
    c: &ContactEquations,
    options: &Options,
    (along, inverse): (Vec<Id>, Id),
    d: f64,
) -> Result<(Frozen, ContactReport)> {
    let recommended = (options.speed / (d * options.step)).max(PRESSED * options.force);
    let a_n = if options.a_n > 0.0 { options.a_n } else { recommended };
    let strength = dag.constant(a_n);
    let mut push: Vec<Id> = along.iter().map(|n| dag.mul(*n, strength)).collect();
    let friction = dag.mul(c.friction, strength);
    let mut add = |dag: &mut Dag, column: &[Id], factor: Id| -> Result<()> {
        let sideways = apply_inverse(dag, parts, column)?;
        for (p, b) in push.iter_mut().zip(sideways) {
            let term = dag.mul(b, factor);
            *p = dag.sub(*p, term);
        }
        Ok(())
    };
    match &c.sliding[..] {
        [] => {}
        [s] => {
            let sign = dag.sign(s.rate);
            let factor = dag.mul(friction, sign);
            add(dag, &s.along, factor)?;
        }
        all => {
            let creep = if options.creep > 0.0 { options.creep } else { CREEP * options.speed };
            let rates: Vec<Id> = all.iter().map(|s| s.rate).collect();
            let square = dag.dot(&rates, &rates)?;
            let (least, minus) = (dag.constant(creep * creep), dag.constant(-1.0 / creep));
            let above = dag.sub(square, least);
            let slides = dag.positive(above);
            // never zero: where it is small the other branch counts
            let tiny = dag.constant(creep * creep * 1e-6);
            let sum = dag.add(square, tiny);
            let size = dag.unary(Unary::Sqrt, sum);
            for s in all {
                let unit = dag.div(s.rate, size);
                let inside = dag.mul(minus, s.rate);
                let direction = dag.select(slides, unit, inside);
                let factor = dag.mul(friction, direction);
                add(dag, &s.along, factor)?;
            }
        }
    }
    let (open, leaves) = (dag.positive(c.gap), dag.positive(c.rate));
    let free = dag.or(open, leaves);
    let report = ContactReport {
        name: c.name.clone(),
        kind: Kind::Inelastic { a_n, tangents: c.sliding.len() },
        recommended,
        given: a_n,
        jump: options.speed / (d * a_n),
    };
    let way = way_out(dag, parts, &along, inverse, options.speed)?;
    Ok((Frozen { free, push, depth: None, way_out: Some((open, way)) }, report))
}

/// Rates of the coordinates by which the gap opens with `speed`: `N M⁻¹ n / D`.
fn way_out(dag: &mut Dag, parts: &Equations, along: &[Id], d: Id, speed: f64) -> Result<Vec<Id>> {
    let (n_q, n_v) = (parts.rates.len(), along.len());
    let v: Vec<Id> = (0..n_v).map(|i| dag.input(Block::X, n_q + i)).collect();
    let speed = dag.constant(speed);
    let factor = dag.div(speed, d);
    let mut out = Vec::with_capacity(n_q);
    for row in 0..n_q {
        let gradient = dag.dense_jacobian(&[parts.rates[row]], &v)?;
        let sum = dag.dot(&gradient, along)?;
        out.push(dag.mul(sum, factor));
    }
    Ok(out)
}

/// (8.15) with the force divided by `D`, and `g + p` as the switching function.
fn elastic(
    dag: &mut Dag,
    c: &ContactEquations,
    options: &Options,
    (along, d): (Vec<Id>, Id),
    restitution: f64,
    place: usize,
) -> Result<(Frozen, ContactReport)> {
    if !c.sliding.is_empty() {
        return Err(Error::Unsupported(format!(
            "time-freezing: contact {} has friction and restitution; one of them must be zero",
            c.name
        )));
    }
    // (8.13), (8.14)
    let log = restitution.ln();
    let pi = std::f64::consts::PI;
    let recommended = (pi * pi + log * log) / (options.step * options.step);
    let k = if options.stiffness > 0.0 { options.stiffness } else { recommended };
    let damping = 2.0 * log.abs() * (k / (log * log + pi * pi)).sqrt();
    let p = dag.input(Block::X, place);
    let (stiffness, damper) = (dag.constant(-k), dag.constant(damping));
    let spring = dag.mul(stiffness, p);
    let damped = dag.mul(damper, c.rate);
    let force = dag.sub(spring, damped);
    let force = dag.div(force, d);
    let push = along.iter().map(|n| dag.mul(*n, force)).collect();
    let depth = dag.add(c.gap, p);
    let free = dag.positive(depth);
    let report = ContactReport {
        name: c.name.clone(),
        kind: Kind::Elastic { stiffness: k, damping, restitution },
        recommended,
        given: k,
        jump: ((pi * pi + log * log) / k).sqrt(),
    };
    Ok((Frozen { free, push, depth: Some(c.rate), way_out: None }, report))
}
