//! Time stepping: a pile that is hit, and tables of balls of which all pairs are contacts.

use crate::json::{Object, Table};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::sync::Arc;
use std::time::Instant;
use switchback::expr::Graph;
use switchback::func::{Dims, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::scene::{Contact, Scene};
use switchback::stepping::{Options, Stepper};
use switchback::system::{self, Inertia, Local, Mechanics, SharedFunction, System};

const G: f64 = 9.81;

/// Positions of the discs 17, 18, 19 at t = 0.30, from the impacts of `tests/data/reference/scenes/pile_of_20.json`.
const EXACT: [f64; 6] = [0.392832299, 6.938744702, 0.443264398, 7.534668907, -0.036096967, 7.012916054];

/// Twenty discs, one on the other, and one that flies at them: 210 gaps.
fn pile(o: &Options) -> Stepper {
    let (n, g) = (20, Graph::new());
    let mut s = Scene::new("pile", 2 * n, 2 * n, 0, 0).unwrap();
    for i in 0..n {
        s.set_force(2 * i, g.constant(0.0).id()).unwrap();
        s.set_force(2 * i + 1, g.constant(-G).id()).unwrap();
        s.add_contact(Contact::new(&g, &format!("ground-{i}"), g.x(2 * i + 1) - 0.2)).unwrap();
        for j in 0..i {
            let (dx, dy) = (g.x(2 * i) - g.x(2 * j), g.x(2 * i + 1) - g.x(2 * j + 1));
            s.add_contact(Contact::new(&g, &format!("{j}-{i}"), (dx * dx + dy * dy).sqrt() - 0.4)).unwrap();
        }
    }
    let mut x = vec![0.0; 4 * n];
    (0..n - 1).for_each(|i| x[2 * i + 1] = 0.2 + 0.4 * i as f64);
    (x[2 * n - 2], x[2 * n - 1], x[4 * n - 2]) = (-2.2, 7.4, 10.0);
    let mut stepper = Stepper::new(&s.build(&g).unwrap().system, o).unwrap();
    stepper.reset(0.0, &x).unwrap();
    stepper
}

/// What nobody asks a stepper for.
struct Nothing {
    dims: Dims,
    n_out: usize,
    pattern: Pattern,
}

impl Nothing {
    fn shared(dims: Dims, n_out: usize) -> SharedFunction {
        Arc::new(Nothing { dims, n_out, pattern: Pattern::empty(0, 0) })
    }
}

impl Function for Nothing {
    fn name(&self) -> &str {
        "nothing"
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.n_out
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.pattern
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.pattern
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, _: &Point, _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
    fn jacobian(&self, _: &Point, _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
}

/// `n` balls on a table with walls, all pairs as contacts: the equations of motion with functions that contacts share, without
/// the parts that time stepping does not use, whose size grows with the table.
fn table(n: usize, o: &Options) -> Stepper {
    let side = (n as f64).sqrt().ceil();
    let g = Graph::new();
    let one = |kind: &str, outputs: &[switchback::expr::Expr], x: usize| -> SharedFunction {
        Arc::new(g.function(kind, Dims { x, u: 0, p: 0 }, outputs).unwrap())
    };
    let c = |v: f64| g.constant(v);
    // two balls: coordinates x1 y1 x2 y2, then velocities
    let (dx, dy) = (g.x(2) - g.x(0), g.x(3) - g.x(1));
    let r = (dx * dx + dy * dy).sqrt();
    let (nx, ny) = (dx / r, dy / r);
    let rate = nx * (g.x(6) - g.x(4)) + ny * (g.x(7) - g.x(5));
    let pair = [one("gap", &[r - 0.4], 8), one("rows", &[rate, c(0.0), c(0.9), -nx, -ny, nx, ny], 8)];
    // a wall: one coordinate and its velocity
    let low = [one("gap", &[g.x(0) - 0.2], 2), one("rows", &[g.x(1), c(0.0), c(0.9), c(1.0)], 2)];
    let high = [one("gap", &[side - 0.2 - g.x(0)], 2), one("rows", &[-g.x(1), c(0.0), c(0.9), c(-1.0)], 2)];
    let n_v = 2 * n;
    let dims = Dims { x: 2 * n_v, u: 0, p: 0 };
    let contact = |name: String, touched: Vec<usize>, f: &[SharedFunction; 2]| system::Contact {
        name,
        kind: system::Kind::Unilateral,
        stiction: false,
        n_tangents: 0,
        gap: Nothing::shared(dims, 2),
        motion: Nothing::shared(dims, system::Contact::motion_len(n_v, 0)),
        reaction: Nothing::shared(Dims { p: n_v + 1, ..dims }, n_v + 1),
        local: Some(Local {
            coordinates: touched.clone(),
            velocities: touched,
            others: Vec::new(),
            separation: None,
            gap: f[0].clone(),
            rows: f[1].clone(),
        }),
    };
    let mut contacts = Vec::new();
    for i in 0..n {
        for k in 0..2 {
            contacts.push(contact(format!("low {i} {k}"), vec![2 * i + k], &low));
            contacts.push(contact(format!("high {i} {k}"), vec![2 * i + k], &high));
        }
        for j in 0..i {
            contacts.push(contact(format!("{j}-{i}"), vec![2 * j, 2 * j + 1, 2 * i, 2 * i + 1], &pair));
        }
    }
    let zero = c(0.0);
    let smooth: Vec<_> = (0..n_v).map(|i| g.x(n_v + i)).chain((0..n_v).map(|_| zero)).collect();
    let mechanics = Mechanics {
        n_q: n_v,
        n_z: 0,
        n_switches: 0,
        products: Vec::new(),
        n_v,
        smooth: Arc::new(g.function("smooth", dims, &smooth).unwrap()),
        inertia: Inertia::Identity,
        contacts,
        law: system::ImpactLaw::Newton,
        order: system::Order::Second,
        bounds: Vec::new(),
        projection: None,
    };
    let system = System::of_mechanics(mechanics, 0, 0).unwrap();
    // balls on a grid with unequal velocities
    let mut x = vec![0.0; 2 * n_v];
    for i in 0..n {
        let (row, column) = (i / side as usize, i % side as usize);
        (x[2 * i], x[2 * i + 1]) = (0.5 + column as f64, 0.5 + row as f64);
        let a = 2.4 * i as f64 + 0.3;
        (x[n_v + 2 * i], x[n_v + 2 * i + 1]) = (2.0 * a.cos(), 2.0 * a.sin());
    }
    let mut s = Stepper::new(&system, o).unwrap();
    s.reset(0.0, &x).unwrap();
    s
}

pub fn run(c: &Context) {
    let mut rows =
        Table::new(&["scene", "h", "error at 0.30", "penetration", "ms per second", "gaps per step", "sweeps", "cg"]);
    let mut plot = Plot::new("pile of 20: error over step", "h", "error").log_log();
    for correct in [true, false] {
        let mut line = Vec::new();
        for h in [4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4] {
            let o = Options { h, correct, ..Options::default() };
            let mut s = pile(&o);
            s.advance(0.30).unwrap();
            let x = &s.state()[34..40];
            let error =
                (0..3).map(|k| (x[2 * k] - EXACT[2 * k]).hypot(x[2 * k + 1] - EXACT[2 * k + 1])).fold(0.0, f64::max);
            // a second of it, the best of a few
            let mut seconds = f64::INFINITY;
            let mut stats = s.statistics();
            for _ in 0..3 {
                let mut s = pile(&o);
                let clock = Instant::now();
                s.advance(1.0).unwrap();
                seconds = seconds.min(clock.elapsed().as_secs_f64());
                stats = s.statistics();
            }
            let per_step = |v: u64| v as f64 / stats.steps as f64;
            let name = if correct { "pile of 20" } else { "pile of 20, not corrected" };
            rows.row(vec![
                name.into(),
                format!("{h:.2e}"),
                format!("{:.2} mm", 1e3 * error),
                format!("{:.2} mm", 1e3 * stats.penetration),
                format!("{:.1}", 1e3 * seconds),
                format!("{:.1}", per_step(stats.gaps)),
                format!("{:.1}", per_step(stats.sweeps)),
                format!("{:.1}", per_step(stats.gradients)),
            ]);
            c.record(
                &Object::new()
                    .text("case", "stepping")
                    .text("scene", name)
                    .num("h", h)
                    .num("error", error)
                    .num("penetration", stats.penetration)
                    .num("wall_s", seconds)
                    .int("unconverged", stats.unconverged as usize),
            );
            line.push((h, error));
        }
        plot.add(if correct { "corrected" } else { "not corrected" }, Mark::Line, line);
    }
    for n in [20, 50, 100, 200] {
        let mut s = table(n, &Options::default());
        s.advance(0.2).unwrap();
        let before = s.statistics();
        let clock = Instant::now();
        s.advance(1.2).unwrap();
        let seconds = clock.elapsed().as_secs_f64();
        let stats = s.statistics();
        let steps = (stats.steps - before.steps) as f64;
        let per_step = |a: u64, b: u64| (a - b) as f64 / steps;
        let pairs = n * (n - 1) / 2 + 4 * n;
        let gaps = per_step(stats.gaps, before.gaps);
        rows.row(vec![
            format!("table of {n}: {pairs} gaps"),
            "1.00e-3".into(),
            format!("{:.2} us a step", 1e6 * seconds / steps),
            format!("{:.2} mm", 1e3 * stats.penetration),
            format!("{:.1}", 1e3 * seconds),
            format!("{gaps:.1}"),
            format!("{:.1}", per_step(stats.sweeps, before.sweeps)),
            format!("{:.1}", per_step(stats.gradients, before.gradients)),
        ]);
        c.record(
            &Object::new()
                .text("case", "stepping")
                .text("scene", "table")
                .int("balls", n)
                .int("pairs", pairs)
                .num("gaps_per_step", gaps)
                .num("bounds_per_step", per_step(stats.bounds, before.bounds))
                .num("contacts_per_step", per_step(stats.contacts, before.contacts))
                .num("wall_s", seconds),
        );
    }
    c.plot(&plot, "stepping-pile.svg");
    c.say("time stepping, h = 1 ms where nothing else is said");
    c.say(&rows.text());
}
