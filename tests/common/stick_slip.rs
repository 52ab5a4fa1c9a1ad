//! Controllers for systems with dry friction: a cart with a pole, two masses on a spring. Costs are integrated along the plant, which
//! is simulated by events with a tolerance of 1e-10.

use std::f64::consts::PI;
use std::sync::Arc;
use switchback::event::{self, Engine};
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::nmpc::*;
use switchback::ocp::{CostAt, Ocp};
use switchback::settings::Settings;
use switchback::system::{Regions, SharedFunction, Subsystem, System};

const STATES: usize = 4;

/// A benchmark: problem, plant with the running cost as fifth state, references, kicks.
pub struct StickSlip {
    pub ocp: Ocp,
    plant: System,
    pub x0: [f64; STATES],
    references: Vec<(usize, [f64; STATES])>,
    kicks: Vec<(usize, [f64; STATES])>,
    pub samples: usize,
}

/// What is different from the model, and from the measurement.
#[derive(Default)]
pub struct Disturbance {
    /// Amplitude of what is added to the state after every sample.
    pub noise: f64,
    /// Samples that a control is late; the state is predicted over them by the model.
    pub delay: usize,
}

/// What a closed loop was.
pub struct Loop {
    pub cost: f64,
    pub controller: Nmpc,
    pub x: Vec<[f64; STATES]>,
    pub u: Vec<f64>,
    /// Seconds of preparation and feedback of every sample.
    pub times: Vec<[f64; 2]>,
    /// Alternatives to the plan that were prepared for every sample.
    pub alternatives: Vec<u64>,
    /// Allocations of preparation and feedback of every sample.
    pub allocations: Vec<usize>,
}

/// Rows, what is added to them where the state with the number at the end is positive, the negative of it where it is not.
type Friction<'g> = (Vec<usize>, Vec<Expr<'g>>, usize);
/// Smooth part and friction, of a given size.
type Dynamics = for<'g> fn(&'g Graph, f64) -> (Vec<Expr<'g>>, Vec<Friction<'g>>);

fn cart_dynamics(g: &Graph, friction: f64) -> (Vec<Expr<'_>>, Vec<Friction<'_>>) {
    let (m2, l, grav) = (0.1, 1.0, 9.81);
    let [th, v, om, force] = [g.x(1), g.x(2), g.x(3), g.u(0)];
    let (a, b, d) = (g.constant(1.0 + m2), th.cos() * (m2 * l), g.constant(m2 * l * l));
    let det = a * d - b * b;
    let (cart, pole) = (force + om * om * th.sin() * (m2 * l), th.sin() * (-m2 * grav * l));
    let smooth = vec![v, om, (d * cart - b * pole) / det, (a * pole - b * cart) / det];
    (smooth, vec![(vec![2, 3], vec![-(d * friction) / det, b * friction / det], 2)])
}

fn mass_dynamics(g: &Graph, friction: f64) -> (Vec<Expr<'_>>, Vec<Friction<'_>>) {
    let spring = (g.x(0) - g.x(1)) * 15.0;
    let smooth = vec![g.x(2), g.x(3), g.u(0) - spring, spring];
    let drag = |row: usize| (vec![row], vec![g.constant(-friction)], row);
    (smooth, vec![drag(2), drag(3)])
}

/// Weights of the cost: diagonals for states, controls, the last state.
type Weights = ([f64; STATES], f64, [f64; STATES]);

/// A cart on a dry track with a pole that hangs; θ = π is upright.
pub fn cart_pole(friction: f64) -> StickSlip {
    let weights = ([1.0, 10.0, 1.0, 1.0], 0.1, [1000.0, 1000.0, 1.0, 1.0]);
    let mut case = case((cart_dynamics, friction), 20.0, weights, [1.0, 0.0, 0.0, 0.0]);
    let far = f64::INFINITY;
    case.ocp.set_x_bounds(&[-10.0, -far, -far, -far], &[10.0, far, far, far]).unwrap();
    case.references = vec![(0, [0.0, PI, 0.0, 0.0]), (60, [-1.0, PI, 0.0, 0.0])];
    case.kicks = vec![(100, [0.0, -1.0, 0.0, 0.0])];
    case.samples = 160;
    case
}

/// Two masses on a dry track with a spring between them; the force acts on the first.
pub fn two_masses(friction: f64) -> StickSlip {
    let weights = ([10.0, 10.0, 1.0, 1.0], 1.0, [100.0, 100.0, 10.0, 10.0]);
    StickSlip { samples: 60, ..case((mass_dynamics, friction), 5.0, weights, [-1.0, 1.0, 0.5, -0.5]) }
}

/// With the running cost as a state behind the others where weights are given; the references are the parameters then.
fn system((dynamics, size): (Dynamics, f64), cost: Option<Weights>) -> System {
    let g = Graph::new();
    let (mut smooth, friction) = dynamics(&g, size);
    if let Some((q, r, _)) = cost {
        let squares = (0..STATES).map(|i| (g.x(i) - g.p(i)) * (g.x(i) - g.p(i)) * q[i]);
        smooth.push(squares.fold(g.u(0) * g.u(0) * r, |s, v| s + v));
    }
    let dims = Dims { x: smooth.len(), u: 1, p: if cost.is_some() { STATES } else { 0 } };
    let mut system = System::new(dims.x, dims.u, dims.p).unwrap();
    system.set_f0(Arc::new(g.function("smooth", dims, &smooth).unwrap())).unwrap();
    for (rows, positive, velocity) in friction {
        let both: Vec<Expr> = positive.iter().copied().chain(positive.iter().map(|p| -*p)).collect();
        let modes = Arc::new(g.function("friction", dims, &both).unwrap());
        let psi = Arc::new(g.function("velocity", dims, &[g.x(velocity)]).unwrap());
        let regions = Regions::Signs { psi, signs: vec![1, -1] };
        system.add_subsystem(Subsystem { rows, modes, n_modes: 2, regions }).unwrap();
    }
    system
}

fn case(dynamics: (Dynamics, f64), limit: f64, weights: Weights, x0: [f64; STATES]) -> StickSlip {
    let (n, ts, (q, r, qn)) = (10, 0.1, weights);
    let mut settings = Settings::default();
    settings.set_by_name("rtol", 1e-6).unwrap();
    settings.set_by_name("atol", 1e-8).unwrap();
    let model = system(dynamics, None);
    let mut ocp = Ocp::new(&model, n as f64 * ts, n, &settings).unwrap();
    let g = Graph::new();
    let all: Vec<Expr> = (0..STATES).map(|i| g.x(i)).chain([g.u(0)]).collect();
    let stage: SharedFunction = Arc::new(g.function("stage", model.dims(), &all).unwrap());
    let end: SharedFunction = Arc::new(g.function("end", model.dims(), &all[..STATES]).unwrap());
    ocp.add_least_squares(stage, &[&q[..], &[r]].concat(), &[0.0; STATES + 1], CostAt::Running).unwrap();
    ocp.add_least_squares(end, &qn, &[0.0; STATES], CostAt::Terminal).unwrap();
    ocp.set_u_bounds(&[-limit], &[limit]).unwrap();
    ocp.set_x0(&x0).unwrap();
    let plant = system(dynamics, Some(weights));
    StickSlip { ocp, plant, x0, references: vec![(0, [0.0; STATES])], kicks: Vec::new(), samples: 0 }
}

impl StickSlip {
    /// The same controller with the plant of another case.
    pub fn on(mut self, other: StickSlip) -> StickSlip {
        self.plant = other.plant;
        self
    }

    pub fn run(&self, options: &Options, disturbance: &Disturbance) -> Loop {
        let mut c = Nmpc::new(&self.ocp, options).unwrap();
        let mut plant = Engine::new(&self.plant, &event::Options::with_tolerance(1e-10, 1e-12)).unwrap();
        let (mut x, mut reference, mut cost) = (self.x0, [0.0; STATES], 0.0);
        let mut done = (vec![x], Vec::new(), Vec::new());
        let mut alternatives = Vec::new();
        let mut waiting = vec![0.0; disturbance.delay];
        let (mut seed, mut allocations) = (1u64, Vec::new());
        for k in 0..self.samples {
            if let Some((_, y)) = self.references.iter().find(|r| r.0 == k) {
                reference = *y;
                c.set_references(0, &[&y[..], &[0.0]].concat()).unwrap();
                c.set_references(1, y).unwrap();
            }
            if let Some((_, kick)) = self.kicks.iter().find(|r| r.0 == k) {
                x.iter_mut().zip(kick).for_each(|(x, d)| *x += d);
            }
            if k == 0 {
                c.initialise(&x, 100).unwrap();
            }
            let before = c.monitor().alternatives;
            let allocated = switchback::memory::allocations();
            let prepared = c.prepare(None).unwrap();
            let allocated = switchback::memory::allocations() - allocated;
            allocations.push(allocated);
            alternatives.push(c.monitor().alternatives - before);
            let mut ahead = x;
            waiting.iter().for_each(|u| step(&mut plant, &mut ahead, *u, &reference, &mut 0.0));
            let mut u = [f64::NAN];
            let allocated = switchback::memory::allocations();
            let info = c.feedback(&ahead, &mut u).unwrap();
            allocations[k] += switchback::memory::allocations() - allocated;
            assert_eq!(info.source, Source::Qp, "{k}");
            waiting.push(u[0]);
            let u = waiting.remove(0);
            step(&mut plant, &mut x, u, &reference, &mut cost);
            for x in &mut x {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                *x += disturbance.noise * (2.0 * ((seed >> 11) as f64 * 2f64.powi(-53)) - 1.0);
            }
            done.0.push(x);
            done.1.push(u);
            done.2.push([prepared.time, info.time]);
        }
        assert_eq!(c.monitor().failed_linearisations, 0);
        Loop { cost, controller: c, x: done.0, u: done.1, times: done.2, alternatives, allocations }
    }
}

/// One sample of the plant; adds its cost.
fn step(plant: &mut Engine, x: &mut [f64; STATES], u: f64, reference: &[f64], cost: &mut f64) {
    let from = [&x[..], &[0.0]].concat();
    plant.reinit(0.0, &from).unwrap();
    plant.set_params(reference).unwrap();
    plant.set_controls(&[u]).unwrap();
    assert_eq!(plant.advance(0.1).unwrap(), event::Outcome::Reached);
    x.copy_from_slice(&plant.state()[..STATES]);
    *cost += plant.state()[STATES];
}

/// A controller for systems that stick.
pub fn options(scheme: Scheme, inner: usize) -> Options {
    Options { scheme, inner, shift: true, ..Options::default() }
}
