//! Are the answers optimal? The problems of `benches/optima` from the default start, compared with exact or best known costs.
//!
//! The documents come from `bindings/python/benchmarks/optima_problems.py`, the costs from `optima.py` beside it.

use crate::json::{Object, Table};
use crate::Context;
use std::path::Path;
use std::time::Instant;
use switchback::document::{read, Document};
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Ocp, OcpResult, Verdict};
use switchback::settings::Settings;

/// Costs this close to the best known, relative, are as good, and so are differences as small as the second number.
const SAME: f64 = 1e-3;
const TINY: f64 = 1e-7;
/// An answer that far below the best known is none of the control problem.
const BELOW: f64 = 1e-2;
/// A simulation that ends this close to the answer confirms it.
const CONFIRMED: f64 = 1e-5;
/// Seconds for one problem.
const LIMIT: f64 = 60.0;
/// One of so many is the sample.
const SAMPLE: usize = 8;

/// A line of `costs.tsv`.
struct Known {
    name: String,
    /// NaN where no cost is known.
    cost: f64,
    /// Derived, not the best of what was found?
    exact: bool,
    /// Is the motion stable, so that errors do not grow?
    stable: bool,
}

fn known(folder: &Path) -> Vec<Known> {
    let text = std::fs::read_to_string(folder.join("costs.tsv")).expect("costs.tsv lies beside the documents");
    let lines = text.lines().skip(1).map(|line| {
        let fields: Vec<&str> = line.split('\t').collect();
        Known {
            name: fields[0].to_owned(),
            cost: fields[1].parse().unwrap_or(f64::NAN),
            exact: fields[2] == "exact",
            stable: fields[3] == "stable",
        }
    });
    lines.collect()
}

fn load(folder: &Path, name: &str) -> Ocp {
    let path = folder.join(format!("{name}.json"));
    let text = std::fs::read_to_string(&path).expect("every line has its document");
    let Document::Ocp(mut ocp) = read(&text, &[]).expect("the document is sound") else {
        panic!("{} is no optimal control problem", path.display())
    };
    let set = Settings { max_time: LIMIT, ..*ocp.settings() };
    ocp.set_settings(&set).expect("the settings fit");
    *ocp
}

/// How far a cost is above the best one, relative; far below it is an answer that errors of the discretisation made.
fn gap(cost: f64, best: f64) -> f64 {
    if (cost - best).abs() <= TINY {
        0.0
    } else {
        (cost - best) / best.abs()
    }
}

/// What the answer is as a point of the control problem.
fn verdict(r: &OcpResult) -> Verdict {
    r.optimality.as_ref().map_or(Verdict::Unknown, |o| o.verdict)
}

/// Is the answer shown to be one that no direction improves?
fn certified(r: &OcpResult) -> bool {
    matches!(verdict(r), Verdict::LocalOptimum | Verdict::Kink)
}

#[derive(Default)]
struct Totals {
    problems: usize,
    solved: usize,
    polished: usize,
    certified: usize,
    rated: usize,
    optimal: usize,
    stable: usize,
    confirmed: usize,
    iterations: usize,
    log_seconds: f64,
    seconds: f64,
}

impl Totals {
    fn fraction(part: usize, all: usize) -> f64 {
        part as f64 / all as f64
    }
    fn mean(&self) -> f64 {
        (self.log_seconds / self.problems as f64).exp()
    }
    fn object(&self) -> Object {
        Object::new()
            .text("case", "optima")
            .text("problem", "")
            .int("problems", self.problems)
            .num("solved", Self::fraction(self.solved, self.problems))
            .num("optimal", Self::fraction(self.optimal, self.rated))
            .num("certified", Self::fraction(self.certified, self.problems))
            .num("polished", Self::fraction(self.polished, self.problems))
            .num("confirmed", Self::fraction(self.confirmed, self.stable))
            .int("iterations", self.iterations)
            .num("seconds", self.seconds)
            .num("mean_s", self.mean())
    }
    fn text(&self) -> String {
        format!(
            "{} problems: {} solved, {} of {} within {SAME:.0e} of the best known cost, {} certified, {} polished, \
             E(T) <= {CONFIRMED:.0e} in {} of {} stable ones, {} iterations, {:.1} s, geometric mean {:.3} s",
            self.problems,
            self.solved,
            self.optimal,
            self.rated,
            self.certified,
            self.polished,
            self.confirmed,
            self.stable,
            self.iterations,
            self.seconds,
            self.mean()
        )
    }
}

pub fn run(c: &Context) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches").join("optima");
    let mut table = Table::new(&["problem", "cost", "gap", "outcome", "polished", "certificate", "E(T)", "it", "ms"]);
    let mut totals = Totals::default();
    for k in known(&folder).iter().step_by(if c.all { SAMPLE } else { 1 }) {
        let mut ocp = load(&folder, &k.name);
        let clock = Instant::now();
        let r = ocp.solve(&mut Control::default()).expect("the problem is well posed");
        let seconds = clock.elapsed().as_secs_f64();
        let error = r.accuracy.as_ref().map_or(f64::NAN, |a| a.terminal);
        let (solved, polished) = (r.outcome == Outcome::Solved, r.polish == Polish::Done);
        let far = gap(r.cost, k.cost);
        let optimal = solved && (-BELOW..=SAME).contains(&far);
        totals.problems += 1;
        totals.solved += usize::from(solved);
        totals.polished += usize::from(solved && polished);
        totals.certified += usize::from(solved && certified(r));
        totals.rated += usize::from(k.cost.is_finite());
        totals.optimal += usize::from(optimal);
        totals.stable += usize::from(k.stable);
        totals.confirmed += usize::from(k.stable && solved && error <= CONFIRMED);
        totals.iterations += r.stats.iterations;
        totals.seconds += seconds;
        totals.log_seconds += seconds.ln();
        table.row(vec![
            k.name.clone(),
            format!("{:.8}", r.cost),
            format!("{far:.1e}{}", if optimal || !k.cost.is_finite() { "" } else { " *" }),
            r.outcome.name().into(),
            format!("{:?}", r.polish).to_lowercase(),
            verdict(r).name().into(),
            format!("{error:.1e}"),
            r.stats.iterations.to_string(),
            format!("{:.0}", 1e3 * seconds),
        ]);
        let o = Object::new().text("case", "optima").text("problem", &k.name).text("outcome", r.outcome.name());
        let o =
            o.num("cost", r.cost).num("best", k.cost).flag("exact", k.exact).num("gap", far).flag("optimal", optimal);
        let o = o.flag("polished", polished).text("certificate", verdict(r).name()).flag("certified", certified(r));
        let o = o.num("terminal_error", error).flag("stable", k.stable).int("iterations", r.stats.iterations);
        c.record(&o.num("wall_s", seconds));
    }
    c.record(&totals.object());
    c.say(&table.text());
    c.say(&totals.text());
}
