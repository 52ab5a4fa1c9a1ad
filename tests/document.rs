//! Models and problems as documents: what returns is what was written, and hostile texts end with an error.

use std::sync::Arc;

use switchback::document::{read, write_model, write_ocp, write_scene, write_simulation, Document, Simulation};
use switchback::error::{Error, Result};
use switchback::event::{Engine, Options};
use switchback::expr::{Dag, Expr, Graph, Piecewise};
use switchback::fesd::PathAt;
use switchback::func::{Callback, Dims, Function, Point};
use switchback::model::{Built, Model, Names, Transition, Trial};
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{CostAt, Durations, Norm, Ocp};
use switchback::scene::{Contact, Friction, SavedScene, Scene};
use switchback::settings::{InitialGuess, Settings};
use switchback::sim::Simulator;
use switchback::system::{Direction, Effect, ImpactLaw, Inclusion, Rule, SetValued, System};

#[path = "../examples/report/expression_models.rs"]
mod expression_models;
#[path = "../examples/report/models.rs"]
mod models;

/// Something of everything a model can be made of.
fn rich() -> Built {
    let g = Graph::new();
    let (x, v, u, p, t) = (g.x(0), g.x(1), g.u(0), g.p(0), g.t());
    let spline = Piecewise::spline(&[0.0, 0.7, 1.0, 3.0], &[0.1, 0.3, 1.0 / 3.0, 5e-324]).unwrap();
    let mass = [2.0 + x.cos(), 0.1 * x, 0.1 * x, g.constant(1.0) + v.powi(2)];
    let a = g.solve(&mass, &[u - v.sign(), g.constant(0.3) * t.sin()]).unwrap();
    let both = (v.gt(0.1) & !x.gt(1.0)) | x.lt(-2.0);
    let rhs = [
        v + both.select(g.constant(0.1 + 0.2), p.atan2(g.constant(1e-300))),
        a[0] + 1e-3 * a[1] + g.piecewise(&spline, x) + x.clip(g.constant(-1.0), p) + x.exp().powf(p).erf(),
    ];
    let mut m = Model::from_rhs("rich", 1, 1, &rhs).unwrap();
    let names = |all: &[&str]| all.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
    m.set_names(Names { x: names(&["Weg \"q\"", "v"]), u: names(&["u"]), p: names(&["ε"]) });
    m.set_trial(Trial { t: 0.5, x: vec![0.25, -1.0 / 3.0], u: vec![1.0], p: vec![0.7] }).unwrap();
    m.build(&g).unwrap()
}

fn rebuilt(text: &str, supplied: &[Arc<dyn Function>]) -> Result<Built> {
    match read(text, supplied)? {
        Document::Model(m) => {
            let mut dag = Dag::new();
            m.restore(&mut dag, supplied)?.build_in(&mut dag)
        }
        _ => panic!("no model"),
    }
}

fn values(f: &dyn Function) -> [Vec<u64>; 3] {
    let d = f.dims();
    let at = |n: usize, s: f64| (0..n).map(|i| s + 0.17 * i as f64).collect::<Vec<f64>>();
    let (x, u, p) = (at(d.x, 0.4), at(d.u, -0.2), at(d.p, 0.9));
    let point = Point { t: 0.3, x: &x, u: &u, p: &p };
    let mut work = vec![0.0; f.work_len()];
    let weights: Vec<f64> = (0..f.n_out()).map(|i| 1.0 - 0.3 * i as f64).collect();
    let mut out = [vec![0.0; f.n_out()], vec![0.0; f.jac_pattern().nnz()], vec![0.0; f.hess_pattern().nnz()]];
    f.value(&point, &mut out[0], &mut work).unwrap();
    f.jacobian(&point, &mut out[1], &mut work).unwrap();
    f.hessian(&point, &weights, &mut out[2], &mut work).unwrap();
    out.map(|v| v.into_iter().map(f64::to_bits).collect())
}

#[test]
fn models_return_as_they_were() {
    let all = [
        rich(),
        expression_models::oscillator(),
        expression_models::switching('b'),
        expression_models::sliding_mode(),
        expression_models::blocks(),
        expression_models::coulomb(),
        expression_models::stick_slip(),
        expression_models::zeno(),
    ];
    for b in all {
        let text = write_model(b.source().unwrap()).unwrap();
        let again = rebuilt(&text, &[]).unwrap();
        assert_eq!(write_model(again.source().unwrap()).unwrap(), text);
        assert_eq!(again.report.to_string(), b.report.to_string());
        assert_eq!(again.functions.len(), b.functions.len());
        for (f, g) in b.functions.iter().zip(&again.functions) {
            assert_eq!((f.name(), f.jac_pattern(), f.hess_pattern()), (g.name(), g.jac_pattern(), g.hess_pattern()));
            assert_eq!(values(f.as_ref()), values(g.as_ref()), "{} of {}", f.name(), b.report.name);
        }
    }
}

fn problem() -> Ocp {
    let set = Settings { n_fe: 3, n_s: 2, ..Settings::default() };
    let b = expression_models::sliding_mode();
    let mut ocp = Ocp::new(&b.system, 4.0, 4, &set).unwrap();
    ocp.set_lagrange(expression_models::sliding_cost()).unwrap();
    ocp.set_x0(&models::SLIDING_X0).unwrap();
    let inf = f64::INFINITY;
    ocp.set_x_bounds(&[-inf, -inf, -2.0, -2.0], &[inf, inf, 2.0, 2.0]).unwrap();
    ocp.set_u_bounds(&[-10.0; 2], &[10.0; 2]).unwrap();
    let g = Graph::new();
    let f = |name: &str, all: &[Expr]| Arc::new(g.function(name, b.system.dims(), all).unwrap());
    ocp.add_terminal(f("end", &[g.x(0), g.x(1)]), &models::SLIDING_QT, &models::SLIDING_QT).unwrap();
    ocp.add_path(f("path", &[g.x(2) + g.x(3)]), &[-inf], &[3.9], PathAt::Elements).unwrap();
    ocp.set_u_guess(&[0.1; 8]).unwrap();
    ocp
}

#[test]
fn an_optimal_control_problem_returns_and_has_the_same_solution_to_the_last_bit() {
    let mut ocp = problem();
    let text = write_ocp(&ocp, ocp.settings()).unwrap();
    let Document::Ocp(mut again) = read(&text, &[]).unwrap() else { panic!("no problem") };
    assert_eq!(write_ocp(&again, again.settings()).unwrap(), text);
    assert_eq!(again.settings(), ocp.settings());
    let (a, b) = (ocp.solve(&mut Control::default()).unwrap(), again.solve(&mut Control::default()).unwrap());
    assert_eq!(a.outcome, Outcome::Solved);
    assert_eq!((a.outcome, a.cost.to_bits(), &a.controls), (b.outcome, b.cost.to_bits(), &b.controls));
    assert_eq!(a.stats.iterations, b.stats.iterations);
}

fn end(s: &Simulation) -> Vec<f64> {
    let mut sim = Simulator::new(&s.system, &s.settings).unwrap();
    sim.set_state(s.t0, &s.x0).unwrap();
    assert_eq!(sim.run(s.duration, s.n_steps, &mut Control::default()).unwrap().outcome, Outcome::Solved);
    sim.state().to_vec()
}

/// Everything else a problem can have.
#[test]
fn free_lengths_least_squares_and_relaxed_constraints_return() {
    let g = Graph::new();
    let (x, v, u, p) = (g.x(0), g.x(1), g.u(0), g.p(0));
    let b = Model::from_rhs("cart", 1, 1, &[v, p * u - 0.2 * v.sign()]).unwrap().build(&g).unwrap();
    let d = b.system.dims();
    let f = |name: &str, all: &[Expr]| Arc::new(g.function(name, d, all).unwrap());
    let mut ocp = Ocp::new(&b.system, 2.0, 4, &Settings { n_fe: 2, ..Settings::default() }).unwrap();
    ocp.set_x0(&[0.0, 0.0]).unwrap();
    ocp.set_u_bounds(&[-5.0], &[5.0]).unwrap();
    ocp.set_params(&[1.0]).unwrap();
    ocp.add_terminal(f("end", &[x]), &[1.0], &[1.0]).unwrap();
    ocp.add_periodic(&[1]).unwrap();
    ocp.add_least_squares(f("effort", &[u]), &[0.1], &[0.0], CostAt::Running).unwrap();
    ocp.add_least_squares(f("way", &[x, v]), &[1.0, 0.1, 0.1, 2.0], &[0.1; 8], CostAt::ControlGrid).unwrap();
    ocp.add_relaxed(f("speed", &[v]), &[-1.0], &[0.6], Some(PathAt::Elements), Norm::L2, 3.0).unwrap();
    ocp.add_relaxed(f("rest", &[v]), &[0.0], &[0.0], None, Norm::L1, 3.0).unwrap();
    ocp.add_complementarity(f("ahead", &[x + 0.1]), f("slip", &[v - v]), PathAt::Elements).unwrap();
    ocp.set_durations(&[0.4, 0.6, 0.5, 0.5]).unwrap();
    ocp.set_free_time(Durations::Horizon, 1.0, 3.0).unwrap();
    ocp.set_elements(&[2, 3, 2, 2]).unwrap();
    ocp.set_linear_controls(&[true]).unwrap();
    ocp.set_param_bounds(&[0.9], &[f64::INFINITY]).unwrap();
    let text = write_ocp(&ocp, ocp.settings()).unwrap();
    for word in [
        "both_ends",
        "\"l2\"",
        "least_squares",
        "linear_controls",
        "complementarity",
        "\"free\":\"horizon\"",
        "\"inf\"",
    ] {
        assert!(text.contains(word), "{word} is not in {text}");
    }
    let Document::Ocp(mut again) = read(&text, &[]).unwrap() else { panic!("no problem") };
    assert_eq!(write_ocp(&again, again.settings()).unwrap(), text);
    let (a, b) = (ocp.solve(&mut Control::default()).unwrap(), again.solve(&mut Control::default()).unwrap());
    assert_eq!((a.outcome, a.cost.to_bits(), &a.controls), (b.outcome, b.cost.to_bits(), &b.controls));
    let cases = [
        ("\"free\":\"horizon\",", "", "belong together"),
        ("\"elements\":[2,3,2,2]", "\"elements\":[2,3]", "2 numbers"),
        ("\"weight\":3.0", "\"weight\":-3.0", "positive"),
        ("\"place\":\"running\"", "\"place\":\"nowhere\"", "nowhere"),
    ];
    for (from, to, expected) in cases {
        assert!(text.contains(from), "{from} is not in the document");
        let e = read(&text.replacen(from, to, 1), &[]).map(|_| ()).unwrap_err().to_string();
        assert!(e.contains(expected), "{to}: {e}");
    }
}

/// What excludes something of the last test: stages of free length, parameters by stage, a wall, an order of modes.
#[test]
fn free_stages_parameters_of_stages_and_modes_return() {
    let g = Graph::new();
    let (x, v, u, p) = (g.x(0), g.x(1), g.u(0), g.p(0));
    let b = Model::from_rhs("cart", 1, 1, &[v, u - p * v.sign()]).unwrap().build(&g).unwrap();
    let d = b.system.dims();
    let f = |name: &str, all: &[Expr]| Arc::new(g.function(name, d, all).unwrap());
    let set = Settings { n_fe: 2, n_s: 2, initial_guess: InitialGuess::TimeStepping as i64, ..Settings::default() };
    let mut ocp = Ocp::new(&b.system, 2.0, 3, &set).unwrap();
    ocp.set_x0(&[1.0, -0.5]).unwrap();
    ocp.set_lagrange(f("effort", &[u * u])).unwrap();
    ocp.add_terminal(f("end", &[x, v]), &[0.2, 0.1], &[0.2, 0.1]).unwrap();
    ocp.add_complementarity(f("ahead", &[x]), f("nothing", &[g.constant(0.0) * u]), PathAt::StagePoints).unwrap();
    ocp.set_stage_params(&[0.1, 0.2, 0.3]).unwrap();
    ocp.set_free_time(Durations::Stages, 0.2, 2.0).unwrap();
    let first = ocp.solve(&mut Control::default()).unwrap().clone();
    assert_eq!(first.outcome, Outcome::Solved, "{}", first.message);
    ocp.set_modes(Some(first.modes())).unwrap();
    let text = write_ocp(&ocp, ocp.settings()).unwrap();
    for word in ["\"free\":\"stages\"", "stage_params", "\"modes\":{\"times\":[0.0", "stage_points"] {
        assert!(text.contains(word), "{word} is not in {text}");
    }
    let Document::Ocp(mut again) = read(&text, &[]).unwrap() else { panic!("no problem") };
    assert_eq!(write_ocp(&again, again.settings()).unwrap(), text);
    let (a, b) = (ocp.solve(&mut Control::default()).unwrap(), again.solve(&mut Control::default()).unwrap());
    assert_eq!((a.outcome, a.cost.to_bits(), &a.controls), (b.outcome, b.cost.to_bits(), &b.controls));
    let bad = text.replacen("\"times\":[0.0", "\"times\":[0.5", 1);
    assert!(read(&bad, &[]).map(|_| ()).unwrap_err().to_string().contains("starts at time 0"));
}

#[test]
fn a_simulation_returns_and_ends_at_the_same_state() {
    let s = Simulation {
        system: expression_models::stick_slip().system,
        settings: Settings { n_s: 3, ..Settings::default() },
        t0: 0.25,
        x0: vec![0.5, 0.1 + 0.2],
        u: vec![],
        p: vec![],
        duration: 4.0,
        n_steps: 20,
    };
    let text = write_simulation(&s).unwrap();
    let Document::Simulation(again) = read(&text, &[]).unwrap() else { panic!("no simulation") };
    assert_eq!(write_simulation(&again).unwrap(), text);
    assert_eq!(end(&s), end(&again));
}

/// `x' = 1 − 2α + z` with `α` the step of `x`, `0 = z + x/2`.
#[test]
fn inclusions_and_algebraic_equations_return() {
    let g = Graph::new();
    let (x, z, alpha) = (g.x(0), g.x(1), g.x(2));
    let own = Dims { x: 2, u: 0, p: 0 };
    let f = g.function("f", Dims { x: 3, ..own }, &[1.0 - 2.0 * alpha + z]).unwrap();
    let psi = g.function("psi", own, &[x]).unwrap();
    let residual = g.function("g", own, &[z + 0.5 * x]).unwrap();
    let mut system = System::new(2, 0, 0).unwrap();
    system
        .add_inclusion(Inclusion { rows: vec![0], f: Arc::new(f), psi: Arc::new(psi), set: SetValued::Step })
        .unwrap();
    system.set_algebraic(1, Some(Arc::new(residual))).unwrap();
    let s = Simulation {
        system,
        settings: Settings::default(),
        t0: 0.0,
        x0: vec![-1.0, 0.5],
        u: vec![],
        p: vec![],
        duration: 2.0,
        n_steps: 5,
    };
    let text = write_simulation(&s).unwrap();
    let Document::Simulation(again) = read(&text, &[]).unwrap() else { panic!("no simulation") };
    assert_eq!(write_simulation(&again).unwrap(), text);
    assert_eq!((again.system.inclusions().len(), again.system.n_algebraic()), (1, 1));
    assert_eq!(end(&s), end(&again));
    // −1 grows to 0 before t = 1 and rests there
    assert!(end(&s).iter().all(|v| v.abs() < 1e-8), "{:?}", end(&s));
    let wrong = text.replacen("\"algebraic\":1", "\"algebraic\":2", 1);
    assert!(matches!(read(&wrong, &[]), Err(Error::Dimension(_))));
}

/// A cart with friction that a spring pushes to and fro: a discrete state says which way, another counts, and the speed jumps.
fn cart() -> Built {
    let g = Graph::new();
    let (x, v, push, count, t) = (g.x(0), g.x(1), g.x(2), g.x(3), g.t());
    let table = Piecewise::steps(&[-0.5, 0.5], &[-1.0, 0.0, 1.0 / 3.0]).unwrap();
    let zero = g.constant(0.0);
    let force = g.piecewise(&table, push) * (1.0 + g.p(0) * (2.0 * t).sin());
    let mut m = Model::from_rhs("cart", 0, 1, &[v, force - 0.1 * v.sign() - 0.2 * x, zero, zero]).unwrap();
    let names = |all: &[&str]| all.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
    m.set_names(Names { x: names(&["x", "v", "push", "count"]), u: vec![], p: names(&["a"]) });
    m.set_discrete(&[1.0, 0.0]).unwrap();
    for (from, direction) in [(1.0, Direction::Rising), (-1.0, Direction::Falling)] {
        let t = Transition {
            guard: (x - from * (0.3 + 0.1 * g.p(0) * t)).id(),
            direction,
            from: vec![(2, from)],
            reset: vec![(3, (count + 1.0).id()), (1, (v * 0.9 + 0.1 * t.cos()).id())],
            to: vec![(2, -from)],
            rule: Rule::default(),
        };
        m.add_transition(t);
    }
    m.build(&g).unwrap()
}

/// Everything a run says, to the last bit.
fn run_of(system: &System) -> (Vec<u64>, usize) {
    let mut e =
        Engine::new(system, &Options { sensitivity: true.into(), ..Options::with_tolerance(1e-10, 1e-10) }).unwrap();
    e.reinit(0.0, &[0.0, 0.4, 1.0, 0.0]).unwrap();
    e.set_params(&[0.2]).unwrap();
    e.advance(12.0).unwrap();
    let mut all = e.state().to_vec();
    all.extend_from_slice(e.sensitivity().unwrap());
    for j in e.jumps() {
        all.push(j.t);
        all.extend([&j.before, &j.after, &j.dt].into_iter().flatten());
    }
    all.extend(e.switches().iter().map(|s| s.t));
    (all.into_iter().map(f64::to_bits).collect(), e.jumps().len())
}

#[test]
fn transitions_and_discrete_states_return_and_run_alike_to_the_last_bit() {
    let b = cart();
    let text = write_model(b.source().unwrap()).unwrap();
    let again = rebuilt(&text, &[]).unwrap();
    // nodes that only transitions need are younger now, so the text is another one, once
    let second = write_model(again.source().unwrap()).unwrap();
    assert_eq!(write_model(rebuilt(&second, &[]).unwrap().source().unwrap()).unwrap(), second);
    let report = b.report.to_string();
    assert_eq!(again.report.to_string(), report);
    assert!(report.contains("discrete: push, count\n"), "{report}");
    assert!(report.contains("transition 0: push 1 -> -1, count := "), "{report}");
    // what never moves by itself needs no warning
    assert!(!report.contains("constant") && !report.contains("jumps or has kinks"), "{report}");
    assert_eq!((again.discrete(), again.transitions().len()), (&[1.0, 0.0][..], 2));
    assert_eq!(again.functions.len(), b.functions.len());
    for (f, g) in b.functions.iter().zip(&again.functions) {
        assert_eq!((f.name(), values(f.as_ref())), (g.name(), values(g.as_ref())));
    }
    let (run, n) = run_of(&b.system);
    assert!(n > 3, "{n} jumps");
    assert_eq!(run_of(&again.system).0, run);

    // as part of a system of functions
    let s = Simulation {
        system: b.system,
        settings: Settings::default(),
        t0: 0.0,
        x0: vec![0.0, 0.4, 1.0, 0.0],
        u: vec![],
        p: vec![0.2],
        duration: 1.0,
        n_steps: 1,
    };
    let text = write_simulation(&s).unwrap();
    let Document::Simulation(again) = read(&text, &[]).unwrap() else { panic!("no simulation") };
    assert_eq!(write_simulation(&again).unwrap(), text);
    assert_eq!(run_of(&again.system).0, run);
    for (from, to, expected) in [
        ("\"from\":[{\"state\":2", "\"from\":[{\"state\":9", "names the state 9"),
        ("\"direction\":\"rising\"", "\"direction\":\"upwards\"", "unknown variant `upwards`"),
        ("\"to\":[{", "\"to\":[{\"state\":2,\"value\":4},{", "names the state 2 twice"),
    ] {
        assert!(text.contains(from), "{from} is not in the document");
        let e = read(&text.replacen(from, to, 1), &[]).map(|_| ()).unwrap_err().to_string();
        assert!(e.contains(expected), "{to}: {e}");
    }
}

#[test]
fn transitions_that_make_no_sense_are_refused_in_words() {
    let text = write_model(cart().source().unwrap()).unwrap();
    let cases = [
        ("\"state\":2", "\"state\":4", "transition 0: `from` names the state 4, but there are 4"),
        ("\"state\":2", "\"state\":18446744073709551615", "names the state 18446744073709551615"),
        ("\"state\":2", "\"state\":-1", "invalid value: integer `-1`"),
        ("\"from\":[{", "\"from\":[{\"state\":2,\"value\":1.0},{", "`from` names the state 2 twice"),
        ("\"to\":[{", "\"to\":[{\"state\":2,\"value\":1.0},{", "`to` names the state 2 twice"),
        ("\"value\":-1.0", "\"value\":NaN", "line 1"),
        ("\"value\":-1.0", "\"value\":1e999", "number out of range"),
        ("\"value\":-1.0", "\"value\":null", "invalid type: null"),
        ("\"direction\":\"rising\"", "\"direction\":\"up\"", "unknown variant `up`, expected `rising` or `falling`"),
        ("\"direction\":\"rising\",", "", "missing field `direction`"),
        ("\"reset\":[3,1]", "\"reset\":[3,3]", "the reset names the state 3 twice"),
        ("\"reset\":[3,1]", "\"reset\":[3,4]", "the reset names the state 4, but there are 4"),
        ("\"reset\":[3,1]", "\"reset\":[3]", "transition 0: a transition that resets 1 states has 3 expressions"),
        ("\"discrete\":[1.0,0.0]", "\"discrete\":[1.0,0.0,0.0]", "state v is discrete"),
        ("\"discrete\":[1.0,0.0]", "\"discrete\":[0,0,0,0,0,0]", "6 discrete states, but the model has 4"),
        ("\"discrete\":[1.0,0.0]", "\"discrete\":[1.0,1e999]", "number out of range"),
    ];
    for (from, to, expected) in cases {
        assert!(text.contains(from), "{from} is not in the document {text}");
        let said = refusal(&text.replacen(from, to, 1));
        assert!(said.contains(expected), "{to}: {said}");
    }
    let with = |list: &str| {
        let plain = model(r#"["x",0],["x",1],["const",0],["positive",0]"#, "1,2", "");
        plain.replace("}}}", &format!("}},\"transitions\":[{list}]}}}}"))
    };
    let jump = |nodes: &str, roots: &str, rest: &str| {
        with(&format!(r#"{{"expressions":{{"nodes":[{nodes}],"roots":[{roots}]}},"direction":"rising"{rest}}}"#))
    };
    let to = r#","to":[{"state":1,"value":1}]"#;
    rebuilt(&jump(r#"["x",0]"#, "0", to), &[]).unwrap();
    for (text, expected) in [
        (jump(r#"["x",0]"#, "0", ""), "transition 0 changes nothing"),
        (jump(r#"["x",0]"#, "", to), "0 states has 0 expressions"),
        (jump(r#"["x",0]"#, "7", to), "transition 0: refers to node 7"),
        (jump(r#"["x",2]"#, "0", to), "x[2]"),
        (jump(r#"["x",0],["positive",0]"#, "0,1", &format!("{to},\"reset\":[0]")), "is a condition"),
        (jump(r#"["x",0]"#, "0", ",\"rule\":{\"effect\":\"stop\"}"), "trigger edge"),
        (
            jump(r#"["x",0]"#, "0", &format!("{to},\"rule\":{{\"effect\":\"note\",\"trigger\":\"edge\"}}")),
            "second transition",
        ),
        (jump(r#"["x",0]"#, "0", ",\"rule\":{\"effect\":\"end\"}"), "unknown variant `end`"),
        (jump(r#"["x",0],["positive",0],["const",1],["neg",2],["where",1,2,3]"#, "4", to), "switches itself, by sign"),
        (jump(r#"["x",0]"#, "0", &format!("{to},\"more\":1")), "unknown field `more`"),
    ] {
        let said = refusal(&text);
        assert!(said.contains(expected), "{said}\nexpected: {expected}\n{text}");
    }
    // many resets of many states are many outputs
    let roots = vec!["0"; 1 << 14].join(",");
    let one = r#"{"expressions":{"nodes":[["x",0]],"roots":[0,0]},"direction":"rising","reset":[0]}"#;
    let many = vec![one; 1 << 13].join(",");
    let large = model(r#"["x",0]"#, &roots, "").replace("}}}", &format!("}},\"transitions\":[{many}]}}}}"));
    let said = refusal(&large);
    assert!(said.contains("the resets: 8192 times 16384 entries"), "{said}");
}

/// A block that slides over a rough floor on a cart, with a lamp that is switched on where it passes.
fn block(g: &Graph) -> Scene {
    let (x, y, vx) = (g.x(0), g.x(1), g.x(2));
    let mut s = Scene::new("block", 2, 2, 1, 1).unwrap();
    s.set_inertia(
        &[g.constant(2.0) + 0.1 * x.sin(), g.constant(0.0), g.constant(0.0), g.constant(1.5)].map(|e| e.id()),
    )
    .unwrap();
    let lamp = s.add_discrete("lamp", 0.0).unwrap();
    s.set_force(0, (g.u(0) - 0.2 * (vx - 0.4).sign() + 0.1 * g.x(lamp)).id()).unwrap();
    s.set_force(1, g.constant(-9.81).id()).unwrap();
    let floor = Contact { tangents: vec![x.id()], friction: g.p(0).id(), ..Contact::new(g, "floor", y) };
    let k = s.add_contact(floor).unwrap();
    s.set_stiction(k, (1.25 * g.p(0)).id()).unwrap();
    s.add_contact(Contact { restitution: g.constant(0.5).id(), ..Contact::new(g, "wall", 1.0 - x) }).unwrap();
    s.add_friction(Friction::new("joint", x, g.constant(0.05))).unwrap();
    s.set_law(ImpactLaw::Sequential);
    s.set_bounds(1, -1.0, INF).unwrap();
    s.add_transition(Transition {
        to: vec![(lamp, 1.0)],
        from: vec![(lamp, 0.0)],
        ..Transition::event("on", Effect::Jump, (x - 0.3).id())
    })
    .unwrap();
    s
}

const INF: f64 = f64::INFINITY;

/// What a simulation of the block says, to the last bit.
fn slide(system: &System) -> Vec<u64> {
    let mut e =
        Engine::new(system, &Options { sensitivity: true.into(), ..Options::with_tolerance(1e-10, 1e-10) }).unwrap();
    e.reinit(0.0, &[0.0, 0.2, 0.6, 0.0, 0.0]).unwrap();
    e.set_params(&[0.1]).unwrap();
    e.set_controls(&[2.6]).unwrap();
    e.advance(2.0).unwrap();
    assert!(!e.jumps().is_empty());
    e.state().iter().chain(e.sensitivity().unwrap()).map(|v| v.to_bits()).collect()
}

#[test]
fn a_scene_and_problems_of_its_system_return_and_move_alike_to_the_last_bit() {
    let g = Graph::new();
    let scene = block(&g);
    let built = scene.build(&g).unwrap();
    let text = write_scene(&SavedScene::new(&scene, &g.dag()).unwrap()).unwrap();
    let Document::Scene(saved) = read(&text, &[]).unwrap() else { panic!("no scene") };
    let mut dag = Dag::new();
    let again = saved.restore(&mut dag, &[]).unwrap();
    assert_eq!(again.expressions().len(), scene.expressions().len());
    let first = slide(&built.system);
    assert_eq!(slide(&again.build_in(&mut dag).unwrap().system), first);
    // the system alone, in a simulation
    let system = built.system.clone();
    let (settings, x0) = (Settings::default(), vec![0.0; 5]);
    let s = Simulation { system, settings, t0: 0.0, x0, u: vec![0.0], p: vec![0.1], duration: 1.0, n_steps: 1 };
    let Document::Simulation(s) = read(&write_simulation(&s).unwrap(), &[]).unwrap() else { panic!("no simulation") };
    assert_eq!(slide(&s.system), first);
}

fn drag(name: &str, n_out: usize) -> Arc<dyn Function> {
    let dims = Dims { x: 1, u: 0, p: 0 };
    Arc::new(Callback::new(name, dims, n_out, |at, out| {
        out.fill(-at.x[0] * at.x[0]);
        0
    }))
}

#[test]
fn functions_of_others_are_supplied_by_name() {
    let f = drag("drag", 1);
    let g = Graph::new();
    let (v, t) = (g.x(0), g.t());
    let d = g.call(&f, &[v, t]).unwrap()[0];
    let b = Model::from_rhs("car", 0, 0, &[d - v.sign()]).unwrap().build(&g).unwrap();
    let text = write_model(b.source().unwrap()).unwrap();
    assert!(text.contains("\"name\":\"drag\""), "{text}");
    let e = rebuilt(&text, &[]).map(|_| ()).unwrap_err();
    assert!(matches!(e, Error::State(_)) && e.to_string().contains("'drag': supply it"), "{e}");
    let again = rebuilt(&text, &[drag("other", 1), f.clone()]).unwrap();
    assert_eq!(values(again.functions[0].as_ref()), values(b.functions[0].as_ref()));
    let e = rebuilt(&text, &[drag("drag", 2)]).map(|_| ()).unwrap_err();
    assert!(matches!(e, Error::Dimension(_)), "{e}");
    let e = rebuilt(&text, &[f.clone(), drag("drag", 1)]).map(|_| ()).unwrap_err();
    assert!(matches!(e, Error::Range(_)) && e.to_string().contains("two functions"), "{e}");
    // Two functions of one name cannot be told apart: nothing is written.
    let e = g.call(&drag("drag", 1), &[v, t]).unwrap()[0];
    let b = Model::from_rhs("car", 0, 0, &[d + e]).unwrap().build(&g).unwrap();
    assert!(matches!(b.source(), Err(Error::Unsupported(_))));
    let s = Simulation {
        system: b.system,
        settings: Settings::default(),
        t0: 0.0,
        x0: vec![1.0],
        u: vec![],
        p: vec![],
        duration: 1.0,
        n_steps: 1,
    };
    assert!(matches!(write_simulation(&s), Err(Error::Unsupported(_))));
    // A system of callbacks has nothing but names.
    let mut system = System::new(1, 0, 0).unwrap();
    system.set_f0(f.clone()).unwrap();
    let text = write_simulation(&Simulation { system, ..s }).unwrap();
    assert!(matches!(read(&text, &[]), Err(Error::State(_))));
    assert!(matches!(read(&text, &[f]), Ok(Document::Simulation(_))));
}

/// A document with these nodes and roots.
fn model(nodes: &str, roots: &str, more: &str) -> String {
    format!(
        r#"{{"format":"switchback","version":1,"library":"0","model":{{"name":"m","controls":0,"parameters":0,"derivatives":{{"nodes":[{nodes}],"roots":[{roots}]{more}}}}}}}"#
    )
}

fn refusal(text: &str) -> String {
    match rebuilt(text, &[]) {
        Ok(_) => panic!("accepted: {text}"),
        Err(e) => e.to_string(),
    }
}

#[test]
fn what_is_wrong_is_said() {
    rebuilt(&model(r#"["x",0],["positive",0],["const",1],["neg",2],["where",1,3,2]"#, "4", ""), &[]).unwrap();
    let cases = [
        (model(r#"["x",0],["sin",1]"#, "1", ""), "node 1: refers to node 1"),
        (model(r#"["x",0],["+",0,2],["+",0,1]"#, "1", ""), "node 1: refers to node 2"),
        (model(r#"["x",0]"#, "3", ""), "node 3"),
        (model(r#"["x",0],["sinus",0]"#, "1", ""), "no operator 'sinus'"),
        (model(r#"["x",0],["+",0]"#, "1", ""), "too few"),
        (model(r#"["x",0],["sin",0,0]"#, "1", ""), "too many"),
        (model(r#"["x",0],["sin",-1]"#, "1", ""), "invalid value"),
        (model(r#"["x",0],["not",0]"#, "1", ""), "operand 0 is a value, not a condition"),
        (model(r#"["x",0],["positive",0],["sin",1]"#, "1", ""), "is a condition"),
        (model(r#"["weight",0]"#, "0", ""), "no operator 'weight'"),
        (model(r#"["t",1]"#, "0", ""), "there is one"),
        (model(r#"["x",1]"#, "0", ""), "x[1]"),
        (model(r#"["const",NaN]"#, "0", ""), "expected"),
        (model(r#"["const",1e999]"#, "0", ""), "out of range"),
        (model(r#"["const",null]"#, "0", ""), "null"),
        (model(r#"["x",0],["powi",0,-2147483648]"#, "1", ""), "too high"),
        (model(r#"["x",0],["table",0,0,0]"#, "1", ""), "table 0 does not exist"),
        (model(r#"["x",0],["component",0,0]"#, "1", ""), "group 0 does not exist"),
        (
            model(
                r#"["x",0],["component",0,5]"#,
                "1",
                r#","groups":[{"solve":{"matrix":[0],"transposed":false,"rhs":[0]}}]"#,
            ),
            "component 5",
        ),
        (
            model(
                r#"["x",0],["component",0,0]"#,
                "1",
                r#","groups":[{"solve":{"matrix":[0,0],"transposed":false,"rhs":[0]}}]"#,
            ),
            "1 rows has 2 entries",
        ),
        (
            model(
                r#"["x",0],["component",0,0]"#,
                "1",
                r#","groups":[{"solve":{"matrix":[1],"transposed":false,"rhs":[0]}}]"#,
            ),
            "refers to node 1",
        ),
        (
            model(r#"["x",0],["component",0,0]"#, "1", r#","groups":[{"call":{"function":7,"args":[0]}}]"#),
            "function 7 does not exist",
        ),
        (
            model(
                r#"["x",0],["table",0,0,0]"#,
                "1",
                r#","tables":[{"breaks":[1,0],"degree":0,"coefficients":[1,2,3],"smoothness":-1}]"#,
            ),
            "not above",
        ),
        (
            model(
                r#"["x",0],["table",0,0,0]"#,
                "1",
                r#","tables":[{"breaks":[],"degree":18446744073709551615,"coefficients":[],"smoothness":2147483647}]"#,
            ),
            "degree",
        ),
        (model(r#"["x",0]"#, "", ""), "at least one state"),
        (model(r#"["x",0]"#, "0", r#","more":1"#), "unknown field `more`"),
        (model("", "0", "").replace("\"controls\":0", "\"controls\":1e9"), "invalid type"),
        (
            model(r#"["x",0]"#, "0", "").replace("\"controls\":0", "\"controls\":9000000000000"),
            "controls and parameters: 9000000000000 is too large, up to",
        ),
        (model(r#"["x",0]"#, "0", "").replace("\"version\":1", "\"version\":2"), "reads version 1"),
        (model(r#"["x",0]"#, "0", "").replace("\"version\":1", "\"version\":0"), "reads version 1"),
        (model(r#"["x",0]"#, "0", "").replace("\"switchback\"", "\"other\""), "format is 'other'"),
        (model(r#"["x",0]"#, "0", "").replace("\"name\":\"m\"", "\"name\":\"m\",\"name\":\"n\""), "duplicate field"),
        ("{\"format\":\"switchback\",\"version\":1,\"library\":\"\"}".into(), "holds one of"),
        (String::new(), "EOF"),
        ("[".repeat(100_000), "invalid"),
        (format!("{{\"format\":{}", "[".repeat(100_000)), "invalid"),
        (format!("{{\"format\":\"switchback\",\"version\":1,\"x\":{}", "[".repeat(100_000)), "EOF"),
        (
            format!("{{\"format\":\"switchback\",\"version\":1,\"x\":{}{}}}", "[".repeat(9999), "]".repeat(9999)),
            "unknown field `x`",
        ),
        ("\u{0}".into(), "line 1"),
    ];
    for (text, expected) in &cases {
        let said = refusal(text);
        assert!(said.contains(expected), "{said}\nexpected: {expected}\n{:.300}", text);
    }
}

#[test]
fn sizes_of_problems_are_judged_before_anything_is_allocated() {
    let ocp = problem();
    let text = write_ocp(&ocp, ocp.settings()).unwrap();
    let cases = [
        ("\"n_stages\":4", "\"n_stages\":4000000000", "too large"),
        ("\"states\":4", "\"states\":4000000000", "too large"),
        ("\"n_modes\":2", "\"n_modes\":9223372036854775807", "too large"),
        ("\"horizon\":4.0", "\"horizon\":-4.0", "positive"),
        ("\"n_fe\":3", "\"n_fe\":3000000", "n_fe"),
        ("\"n_fe\":3", "\"n_feet\":3", "n_feet"),
        ("\"control_guess\":[0.1,", "\"control_guess\":[", "7"),
        ("\"-inf\"", "\"infinite\"", "untagged"),
        ("\"at\":\"elements\"", "\"at\":\"everywhere\"", "everywhere"),
    ];
    for (from, to, expected) in cases {
        assert!(text.contains(from), "{from} is not in the document");
        let e = read(&text.replacen(from, to, 1), &[]).map(|_| ()).unwrap_err().to_string();
        assert!(e.contains(expected), "{to}: {e}");
    }
}

/// Every truncation, and thousands of documents with bytes or numbers changed: an error or an object, never a panic.
#[test]
fn damaged_documents_end_with_an_error_or_an_object() {
    let ocp = problem();
    let texts = [rich(), cart()].map(|b| write_model(b.source().unwrap()).unwrap());
    let g = Graph::new();
    let scene = write_scene(&SavedScene::new(&block(&g), &g.dag()).unwrap()).unwrap();
    let steered = Ocp::new(&block(&g).build(&g).unwrap().system, 1.0, 2, &Settings::default()).unwrap();
    let steered = write_ocp(&steered, steered.settings()).unwrap();
    let texts = [&texts[0], &texts[1], &write_ocp(&ocp, ocp.settings()).unwrap(), &scene, &steered];
    let try_it = |text: &str| match read(text, &[]) {
        Ok(Document::Model(m)) => {
            let mut dag = Dag::new();
            m.restore(&mut dag, &[]).and_then(|m| m.build_in(&mut dag)).is_ok()
        }
        Ok(Document::Scene(s)) => {
            let mut dag = Dag::new();
            s.restore(&mut dag, &[]).and_then(|s| s.build_in(&mut dag)).is_ok()
        }
        Ok(_) => true,
        Err(e) => {
            assert!(!matches!(e, Error::Internal(_)), "{e}");
            false
        }
    };
    let mut state = 9u64;
    let mut below = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % n as u64) as usize
    };
    let replacements: [&str; 12] = ["0", "1", "7", "-", "\"", "[", "]", "4294967295", "1e308", "-1", "null", "[[1]]"];
    for text in texts {
        let cuts =
            (0..text.len()).filter(|&k| text.is_char_boundary(k)).step_by(if text.len() > 4000 { 23 } else { 1 });
        for k in cuts {
            assert!(!try_it(&text[..k]), "a text cut at {k} was accepted");
        }
        let (mut accepted, n) = (0, 1500);
        for _ in 0..n {
            let mut damaged = text.clone();
            for _ in 0..1 + below(3) {
                let at = below(damaged.len());
                if damaged.is_char_boundary(at) && damaged.is_char_boundary(at + 1) {
                    damaged.replace_range(at..=at, replacements[below(replacements.len())]);
                }
            }
            accepted += usize::from(try_it(&damaged));
        }
        // A digit changed is another document, a bracket is none.
        assert!(accepted > 5 && accepted < n, "{accepted} of {n}");
    }
}
