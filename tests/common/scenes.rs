//! Scenes of the reference solutions in `tests/data/reference/scenes`.

use std::path::Path;
use switchback::expr::{Expr, Graph};
use switchback::scene::{Contact, Scene};
use switchback::system::System;

pub const GRAVITY: f64 = 9.81;

/// Reads a file of references.
pub fn reference(name: &str) -> serde_json::Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/reference/scenes").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// All numbers below a value, in order; strings are read as numbers.
pub fn numbers(v: &serde_json::Value) -> Vec<f64> {
    let one = |v: &serde_json::Value| v.as_f64().or_else(|| v.as_str().and_then(|s| s.parse().ok())).unwrap();
    v.as_array().map_or_else(|| vec![one(v)], |a| a.iter().flat_map(numbers).collect())
}

pub fn number(v: &serde_json::Value) -> f64 {
    numbers(v)[0]
}

/// A contact with friction `mu` and restitution `e`.
pub fn contact(g: &Graph, name: &str, gap: Expr, tangents: &[Expr], mu: f64, e: f64) -> Contact {
    Contact {
        tangents: tangents.iter().map(|t| t.id()).collect(),
        friction: g.constant(mu).id(),
        restitution: g.constant(e).id(),
        ..Contact::new(g, name, gap)
    }
}

/// A scene with a diagonal inertia and `q̇ = v`.
pub fn scene(g: &Graph, name: &str, inertia: &[f64], force: &[Expr], nu: usize, np: usize) -> Scene {
    let n = force.len();
    let mut s = Scene::new(name, n, n, nu, np).unwrap();
    let entries: Vec<_> =
        (0..n * n).map(|k| g.constant(if k / n == k % n { inertia[k / n] } else { 0.0 }).id()).collect();
    s.set_inertia(&entries).unwrap();
    force.iter().enumerate().for_each(|(i, f)| s.set_force(i, f.id()).unwrap());
    s
}

fn built(s: &Scene, g: &Graph) -> System {
    s.build(g).unwrap().system
}

/// A point in a box of the walls bottom, right, top, left, without gravity.
pub fn box_elastic() -> System {
    let g = Graph::new();
    let (x, y, zero) = (g.x(0), g.x(1), g.constant(0.0));
    let mut s = scene(&g, "box", &[1.0; 2], &[zero, zero], 0, 0);
    for (name, gap) in [("bottom", y + 1.05), ("right", 1.1 - x), ("top", 1.15 - y), ("left", x + 1.2)] {
        s.add_contact(contact(&g, name, gap, &[], 0.0, 1.0)).unwrap();
    }
    built(&s, &g)
}

/// A point above a parabola, with the coefficient of restitution as parameter 0.
pub fn parabola() -> System {
    let g = Graph::new();
    let (x, y, zero) = (g.x(0), g.x(1), g.constant(0.0));
    let mut s = scene(&g, "parabola", &[1.0; 2], &[zero, g.constant(-GRAVITY)], 0, 1);
    let c = Contact { restitution: g.p(0).id(), ..Contact::new(&g, "curve", y - 0.3 * x * x) };
    s.add_contact(c).unwrap();
    built(&s, &g)
}

/// A particle on a rough floor with a horizontal force `p1` and friction `p0`.
pub fn slider() -> System {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let mut s = scene(&g, "slider", &[1.0; 2], &[g.p(1), g.constant(-GRAVITY)], 0, 2);
    let c = Contact { friction: g.p(0).id(), tangents: vec![x.id()], ..Contact::new(&g, "floor", y) };
    s.add_contact(c).unwrap();
    built(&s, &g)
}

/// A point on an inclined plane, shaken: `F sin w t` downwards.
pub fn slope(angle: f64, mu: f64, f: f64, w: f64) -> System {
    let g = Graph::new();
    let (s, n) = (g.x(0), g.x(1));
    let force = [GRAVITY * angle.sin() + f * (w * g.t()).sin(), g.constant(-GRAVITY * angle.cos())];
    let mut scene = scene(&g, "slope", &[1.0; 2], &force, 0, 0);
    scene.add_contact(contact(&g, "plane", n, &[s], mu, 0.0)).unwrap();
    built(&scene, &g)
}

/// A disc of mass 1 on a rough floor; its coordinate `y` is the height of the lowest point.
pub fn disc(r: f64, mu: f64) -> System {
    let g = Graph::new();
    let (x, y, phi, zero) = (g.x(0), g.x(1), g.x(2), g.constant(0.0));
    let mut s = scene(&g, "disc", &[1.0, 1.0, 0.5 * r * r], &[zero, g.constant(-GRAVITY), zero], 0, 0);
    s.add_contact(contact(&g, "floor", y, &[x + r * phi], mu, 0.0)).unwrap();
    built(&s, &g)
}

/// A rod of mass 1 above a rough floor, with both ends.
pub fn rod(l: f64, j: f64, mu: f64) -> System {
    let g = Graph::new();
    let (x, y, th, zero) = (g.x(0), g.x(1), g.x(2), g.constant(0.0));
    let mut s = scene(&g, "rod", &[1.0, 1.0, j], &[zero, g.constant(-GRAVITY), zero], 0, 0);
    let (cx, cy) = (0.5 * l * th.sin(), 0.5 * l * th.cos());
    s.add_contact(contact(&g, "lower", y - cy, &[x - cx], mu, 0.0)).unwrap();
    s.add_contact(contact(&g, "upper", y + cy, &[x + cx], mu, 0.0)).unwrap();
    built(&s, &g)
}

/// A block `2b × 2h` of mass 1 with two corners on a floor; coordinates of the centre and the angle.
pub fn block(b: f64, h: f64, mu: f64) -> System {
    let g = Graph::new();
    let (x, y, th, zero) = (g.x(0), g.x(1), g.x(2), g.constant(0.0));
    let inertia = (b * b + h * h) / 3.0;
    let mut s = scene(&g, "block", &[1.0, 1.0, inertia], &[zero, g.constant(-GRAVITY), zero], 0, 0);
    for (name, side) in [("left", -1.0), ("right", 1.0)] {
        let corner_x = x + side * b * th.cos() + h * th.sin();
        let corner_y = y + side * b * th.sin() - h * th.cos();
        s.add_contact(contact(&g, name, corner_y, &[corner_x], mu, 0.0)).unwrap();
    }
    built(&s, &g)
}

/// Two balls with a spring between them above a floor.
pub fn two_balls() -> System {
    let g = Graph::new();
    let (a, b) = (g.x(0), g.x(1));
    let spring = 1e4 * (b - a - 1.0);
    let mut s = scene(&g, "two balls", &[1.0; 2], &[spring - GRAVITY, -spring - GRAVITY], 0, 0);
    s.add_contact(contact(&g, "floor", a - 0.2, &[], 0.0, 0.8)).unwrap();
    built(&s, &g)
}

/// A ball on a shaken table.
pub fn table(a: f64, w: f64, e: f64) -> System {
    let g = Graph::new();
    let mut s = scene(&g, "table", &[1.0], &[g.constant(-GRAVITY)], 0, 0);
    s.add_contact(contact(&g, "table", g.x(0) - a * (w * g.t()).sin(), &[], 0.0, e)).unwrap();
    built(&s, &g)
}

/// A driven oscillator with a stop at parameter 0.
pub fn impact_oscillator(z: f64, f: f64, w: f64, e: f64) -> System {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    let mut s = scene(&g, "oscillator", &[1.0], &[f * (w * g.t()).cos() - x - 2.0 * z * v], 0, 1);
    s.add_contact(contact(&g, "stop", g.p(0) - x, &[], 0.0, e)).unwrap();
    built(&s, &g)
}

/// A puck in space on a rough floor with a force that turns.
pub fn puck(mu: f64, f: f64, w: f64) -> System {
    let g = Graph::new();
    let [x, y, z] = [g.x(0), g.x(1), g.x(2)];
    let force = [f * (w * g.t()).cos(), f * (w * g.t()).sin(), g.constant(-GRAVITY)];
    let mut s = scene(&g, "puck", &[1.0; 3], &force, 0, 0);
    s.add_contact(contact(&g, "floor", z, &[x, y], mu, 0.0)).unwrap();
    built(&s, &g)
}

/// Discs of mass 1 and radius `r`, frictionless, with a floor and a gap for every pair.
pub fn discs(n: usize, r: f64) -> System {
    let g = Graph::new();
    let at = |i: usize| (g.x(2 * i), g.x(2 * i + 1));
    let force: Vec<Expr> = (0..2 * n).map(|k| g.constant(if k % 2 == 1 { -GRAVITY } else { 0.0 })).collect();
    let mut s = scene(&g, "discs", &vec![1.0; 2 * n], &force, 0, 0);
    for i in 0..n {
        s.add_contact(contact(&g, &format!("g{i}"), at(i).1 - r, &[], 0.0, 0.0)).unwrap();
        for j in 0..i {
            let ((a, b), (c, d)) = (at(i), at(j));
            let distance = ((a - c).powi(2) + (b - d).powi(2)).sqrt();
            s.add_contact(contact(&g, &format!("{j}-{i}"), distance - 2.0 * r, &[], 0.0, 0.0)).unwrap();
        }
    }
    built(&s, &g)
}

/// A scene with its reference solution.
pub struct Case {
    pub name: &'static str,
    pub system: System,
    pub x0: Vec<f64>,
    pub p: Vec<f64>,
    pub t: f64,
    /// State at `t`.
    pub x: Vec<f64>,
    /// Its derivatives with respect to `x0`, row-major; empty if the reference has none.
    pub derivatives: Vec<f64>,
    /// Times of impacts and switches, in order, each once; empty if the reference has none.
    pub events: Vec<f64>,
    /// The coarsest tolerance at which the engine must see all of them: what grazes by less is a matter of the tolerances.
    pub coarsest: f64,
}

/// The references that a whole run can be compared with.
pub fn cases() -> Vec<Case> {
    let case = |name, system, x0: &[f64], p: &[f64], t, x: &[f64], derivatives: &[f64], events: &[f64]| Case {
        name,
        system,
        x0: x0.to_vec(),
        p: p.to_vec(),
        t,
        x: x.to_vec(),
        derivatives: derivatives.to_vec(),
        events: events.to_vec(),
        coarsest: 1.0,
    };
    let of = |r: &serde_json::Value, key: &str| numbers(&r[key]);
    let mut out = Vec::new();
    let r = reference("box_elastic.json");
    let times: Vec<f64> = r["impacts"].as_array().unwrap().iter().map(|i| number(&i[0])).collect();
    out.push(case("box", box_elastic(), &of(&r, "x0"), &[], 4.0, &of(&r, "x_T"), &of(&r, "dxT_dx0"), &times));
    let r = reference("parabola.json");
    let times: Vec<f64> = r["impacts"].as_array().unwrap().iter().map(|i| number(&i["t"])).collect();
    let (x, d) = (of(&r, "x_T"), of(&r, "dxT_dx0"));
    out.push(case("parabola", parabola(), &of(&r, "x0"), &of(&r, "e"), number(&r["T"]), &x, &d, &times));
    let r = reference("particle_slide_stop_stick.json");
    let (x0, p) = (of(&r["params"], "x0"), [number(&r["params"]["mu"]), number(&r["params"]["u1"])]);
    let (x, d, events) = (of(&r, "x_T"), of(&r, "dxT_dx0"), of(&r, "events"));
    out.push(case("slider", slider(), &x0, &p, number(&r["params"]["T"]), &x, &d, &events));
    let r = reference("slope_sticks_between.json");
    let system = slope(number(&r["angle"]), number(&r["mu"]), number(&r["F"]), number(&r["w"]));
    let (x, d, events) = (of(&r, "x_T"), of(&r, "dxT_dx0"), of(&r, "events"));
    out.push(case("slope", system, &of(&r, "x0"), &[], number(&r["T"]), &x, &d, &events));
    let r = &reference("disc.json")["slide_then_roll"];
    let (radius, mu) = (number(&r["r"]), number(&r["mu"]));
    let x0 = [0.0, 0.0, 0.0, number(&r["v0"]), 0.0, number(&r["w0"])];
    let (x, events) = (numbers(&r["sol"][0]), numbers(&r["sol"][1]));
    out.push(case("disc", disc(radius, mu), &x0, &[], number(&r["T"]), &x, &[], &events));
    let r = reference("two_balls_spring.json");
    let (x, d, events) = (of(&r, "x_T"), of(&r, "dxT_dx0"), of(&r, "impacts"));
    out.push(case("two balls", two_balls(), &of(&r, "x0"), &[], 1.0, &x, &d, &events));
    let r = reference("cone_3d.json");
    let system = puck(number(&r["mu"]), number(&r["F"]), number(&r["w"]));
    out.push(case("puck", system, &of(&r, "x0"), &[], number(&r["T"]), &of(&r, "x_T"), &[], &of(&r, "events")));
    let r = reference("table_chatter.json");
    let system = table(number(&r["A"]), number(&r["w"]), number(&r["e"]));
    out.push(case("table", system, &of(&r, "x0"), &[], number(&r["T"]), &of(&r, "x_T"), &[], &[]));
    let r = reference("grazing.json");
    let amplitude = number(&r["steady_amplitude"]);
    for (name, row) in ["grazing 1e-2", "grazing 1e-4", "grazing 1e-6"].into_iter().zip(r["rows"].as_array().unwrap()) {
        let p = [amplitude - number(&row["stop_below_amplitude"])];
        let (x, d, events) = (of(row, "x_T6"), of(row, "dxT_dx0"), of(row, "impacts"));
        let system = impact_oscillator(0.1, 1.0, 1.2, 0.7);
        let coarsest = 1e-2 * number(&row["stop_below_amplitude"]);
        let all = case(name, system, &of(&r, "x0_on_steady_state"), &p, 6.0, &x, &d, &events);
        out.push(Case { coarsest, ..all });
    }
    out
}

/// Times of impacts and of changes of contact modes, in order, each once.
pub fn event_times(impacts: impl Iterator<Item = f64>, switches: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = impacts.chain(switches).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}
