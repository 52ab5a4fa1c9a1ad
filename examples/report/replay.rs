//! Solves what a document holds and says what happened, for bug reports.

use switchback::document::{read, Document, Simulation};
use switchback::error::Result;
use switchback::expr::Dag;
use switchback::fesd::Trajectory;
use switchback::nlp::Control;
use switchback::ocp::Ocp;
use switchback::sim::Simulator;

/// Reads the file and replays it.
pub fn run(path: &str) -> std::result::Result<(), String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{path}: {e}"))?;
    let done = match read(&text, &[]).map_err(|e| e.to_string())? {
        Document::Model(m) => {
            let mut dag = Dag::new();
            m.restore(&mut dag, &[]).and_then(|m| m.build_in(&mut dag)).map(|b| println!("{}", b.report))
        }
        Document::Simulation(s) => simulate(&s),
        Document::Ocp(mut o) => solve(&mut o),
        _ => return Err(format!("{path}: this kind of document cannot be replayed")),
    };
    done.map_err(|e| e.to_string())
}

fn simulate(s: &Simulation) -> Result<()> {
    println!("simulation from t = {} over {} in {} steps", s.t0, s.duration, s.n_steps);
    let mut simulator = Simulator::new(&s.system, &s.settings)?;
    simulator.set_params(&s.p)?;
    simulator.set_controls(&s.u)?;
    simulator.set_state(s.t0, &s.x0)?;
    let r = simulator.run(s.duration, s.n_steps, &mut Control::default())?;
    println!(
        "{} after {} steps, {} with a homotopy, {} iterations; residual {:.1e}, pairs {:.1e}",
        r.outcome.name(),
        r.steps,
        r.homotopies,
        r.stats.iterations,
        r.primal,
        r.pair_min
    );
    switches(&r.trajectory);
    println!("x({}) = {:?}", simulator.time(), simulator.state());
    Ok(())
}

fn solve(ocp: &mut Ocp) -> Result<()> {
    println!("optimal control in {} stages", ocp.n_stages());
    let r = ocp.solve(&mut Control::default())?;
    println!(
        "{} after {} iterations, active set {:?}, cost {:.16e}; primal {:.1e}, dual {:.1e}, pairs {:.1e}",
        r.outcome.name(),
        r.stats.iterations,
        r.polish,
        r.cost,
        r.residuals.primal,
        r.residuals.dual,
        r.residuals.pair_min
    );
    if !r.message.is_empty() {
        println!("{}", r.message);
    }
    if let Some(a) = &r.accuracy {
        println!("simulated: {:.1e} off at the end, cost {:.1e}", a.terminal, a.cost_error);
    }
    switches(&r.trajectory);
    println!("controls {:?}", r.controls);
    Ok(())
}

fn switches(t: &Trajectory) {
    for s in &t.switches {
        println!("  t = {:.12}  subsystem {}  {:?}", s.t, s.subsystem, s.kind);
    }
}
