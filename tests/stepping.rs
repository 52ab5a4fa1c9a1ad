//! Time stepping of scenes: closed forms, convergence, conservation, units, bad input.

use switchback::expr::{Expr, Graph};
use switchback::scene::{Contact, Scene};
use switchback::stepping::{simulate_steps, Options, Statistics, Stepper};
use switchback::system::{ImpactLaw, System};

const G: f64 = 9.81;

/// Points of unit mass in the plane under gravity, with contacts of gaps and tangents.
struct Plane {
    g: &'static Graph,
    scene: Scene,
}

impl Plane {
    fn new(n: usize, mass: &[f64], gravity: f64) -> Plane {
        let g: &'static Graph = Box::leak(Box::new(Graph::new()));
        let mut scene = Scene::new("plane", 2 * n, 2 * n, 0, 0).unwrap();
        let mut inertia = vec![g.constant(0.0).id(); 4 * n * n];
        for i in 0..n {
            let m = mass.get(i).copied().unwrap_or(1.0);
            scene.set_force(2 * i, g.constant(0.0).id()).unwrap();
            scene.set_force(2 * i + 1, g.constant(-m * gravity).id()).unwrap();
            inertia[2 * i * (2 * n + 1)] = g.constant(m).id();
            inertia[(2 * i + 1) * (2 * n + 1)] = g.constant(m).id();
        }
        scene.set_inertia(&inertia).unwrap();
        Plane { g, scene }
    }

    fn contact(&mut self, name: &str, gap: Expr<'static>, tangents: &[Expr<'static>], mu: f64, e: f64) {
        let ids = tangents.iter().map(|t| t.id()).collect();
        let (friction, restitution) = (self.g.constant(mu).id(), self.g.constant(e).id());
        let c = Contact { tangents: ids, friction, restitution, ..Contact::new(self.g, name, gap) };
        self.scene.add_contact(c).unwrap();
    }

    fn build(&self) -> System {
        self.scene.build(self.g).unwrap().system
    }
}

fn options(h: f64) -> Options {
    Options { h, ..Options::default() }
}

/// State at `t1`.
fn end(system: &System, o: &Options, x0: &[f64], t1: f64) -> (Vec<f64>, Statistics) {
    let mut s = Stepper::new(system, o).unwrap();
    s.reset(0.0, x0).unwrap();
    s.advance(t1).unwrap();
    (s.state().to_vec(), s.statistics())
}

/// Slope of a straight line through `log error` over `log h`.
fn slope(h: &[f64], error: &[f64]) -> f64 {
    let n = h.len() as f64;
    let (x, y): (Vec<f64>, Vec<f64>) = h.iter().zip(error).map(|(h, e)| (h.ln(), e.max(1e-16).ln())).unzip();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (a, b) = x.iter().zip(&y).fold((0.0, 0.0), |s, (x, y)| (s.0 + (x - mx) * (y - my), s.1 + (x - mx) * (x - mx)));
    a / b
}

fn pile(look_at_all: bool, h: f64, correct: bool, theta: f64) -> Stepper {
    let n = 20;
    let mut p = Plane::new(n, &[], G);
    for i in 0..n {
        let y = p.g.x(2 * i + 1);
        p.contact(&format!("ground-{i}"), y - 0.2, &[], 0.0, 0.0);
        for j in 0..i {
            let (dx, dy) = (p.g.x(2 * i) - p.g.x(2 * j), p.g.x(2 * i + 1) - p.g.x(2 * j + 1));
            p.contact(&format!("{j}-{i}"), (dx * dx + dy * dy).sqrt() - 0.4, &[], 0.0, 0.0);
        }
    }
    let system = p.build();
    let mut x = vec![0.0; 4 * n];
    for i in 0..n - 1 {
        x[2 * i + 1] = 0.2 + 0.4 * i as f64;
    }
    (x[2 * n - 2], x[2 * n - 1], x[4 * n - 2]) = (-2.2, 7.4, 10.0);
    let mut s = Stepper::new(&system, &Options { look_at_all, correct, theta, ..options(h) }).unwrap();
    s.reset(0.0, &x).unwrap();
    s
}

/// Positions of the discs 17, 18 and 19 at t = 0.30, in free flight behind the second impact.
fn pile_reference() -> [f64; 6] {
    [0.3928321, 6.9387453, 0.4432636, 7.5346694, -0.0360961, 7.0129157]
}

#[test]
fn explore() {
    for correct in [true, false] {
        for theta in [0.5, 1.0] {
            for h in [4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 6e-5] {
                let mut s = pile(false, h, correct, theta);
                s.advance(0.30).unwrap();
                let x = s.state().to_vec();
                let r = pile_reference();
                let e: Vec<f64> = (0..6).map(|i| 1e3 * (x[34 + i] - r[i])).collect();
                println!(
                    "pile {correct} {theta} h {h:.2e} mm {:.1?} v {:.3?} pen {:?}",
                    e,
                    &x[40 + 34..40 + 40],
                    s.statistics().penetration
                );
            }
        }
    }
    for h in [1e-3, 5e-4] {
        let mut s = pile(false, h, true, 0.5);
        let t0 = std::time::Instant::now();
        s.advance(1.0).unwrap();
        println!("pile 1 s {:?} {:?}", t0.elapsed(), s.statistics());
        let mut a = pile(true, h, true, 0.5);
        a.advance(1.0).unwrap();
        assert_eq!(a.state(), s.state());
    }
}
