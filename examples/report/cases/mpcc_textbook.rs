//! Programs with complementarity constraints of the literature: the answers that are known, and the ones found.
//! Recorded problems with known answers join them where there is a folder with a list, `train.json`.

#[path = "../../../crates/switchback-mpcc/tests/common/textbook/mod.rs"]
pub(super) mod textbook;

use super::short;
use crate::json::{Object, Table};
use crate::svg::{Mark, Plot};
use crate::{recorded, Context};
use serde_json::Value;
use std::path::Path;
use std::time::Instant;
use switchback::mpcc::{MpccSettings, Polish};
use switchback::nlp::Nlp;
use textbook::{all, relative, Expect, Known, Problem, Stat, Verdict};

/// Kinds of recorded problems whose answers are known.
const KINDS: [&str; 2] = ["textbook:", "synth:"];

pub fn run(c: &Context) {
    let mut sheet = Sheet::new();
    for p in all() {
        for k in 0..p.starts.len() {
            sheet.solve(c, &p, k);
        }
    }
    match c.problems.as_deref().map(read) {
        Some(Ok(problems)) => problems.iter().for_each(|p| sheet.solve(c, p, 0)),
        Some(Err(e)) => eprintln!("left out: recorded problems: {e}"),
        None => eprintln!("left out: recorded problems (--problems or SWITCHBACK_MPCC_PROBLEMS names their folder)"),
    }
    c.say("Programs of the literature with known answers");
    c.say(&sheet.table.text());
    let [passed, local, failed] = sheet.count;
    c.say(&format!("{passed} global answers, {local} local minima or unknown minima, {failed} failures"));
    sheet.iterations.sort_unstable();
    let sorted = sheet.iterations.iter().enumerate().map(|(i, &k)| (i as f64 + 1.0, k as f64)).collect();
    let mut plot = Plot::new("Textbook problems, sorted by cost", "problems", "iterations");
    plot.add("iterations", Mark::Steps, sorted);
    c.plot(&plot, "mpcc-textbook.svg");
}

struct Sheet {
    table: Table,
    iterations: Vec<usize>,
    /// Passed, passed with a remark, failed.
    count: [usize; 3],
}

impl Sheet {
    fn new() -> Sheet {
        let table = Table::new(&[
            "problem",
            "n",
            "m",
            "pairs",
            "outcome",
            "objective",
            "known",
            "error",
            "listed",
            "type",
            "B",
            "iterations",
            "ms",
            "",
        ]);
        Sheet { table, iterations: Vec::new(), count: [0; 3] }
    }

    fn solve<P: Nlp + Clone>(&mut self, c: &Context, p: &Problem<P>, k: usize) {
        let clock = Instant::now();
        let found = p.solve(MpccSettings::default(), &p.starts[k]);
        let wall_s = clock.elapsed().as_secs_f64();
        let (s, known) = (&found.solution, &p.known);
        let (verdict, note) = match p.judge(&found) {
            Verdict::Pass if known.expect == Expect::Optimal && known.f.is_nan() => {
                ("PASS", "minimum not known".into())
            }
            Verdict::Pass => ("PASS", String::new()),
            Verdict::Local => ("PASS", "a local minimum".into()),
            Verdict::Fail(why) => ("FAIL", why),
        };
        self.count[if verdict == "FAIL" { 2 } else { usize::from(!note.is_empty()) }] += 1;
        self.iterations.push(s.stats.iterations);
        let name = if k == 0 { p.name.clone() } else { format!("{} ({})", p.name, k + 1) };
        let error = if known.expect == Expect::Optimal { relative(s.objective, known.f) } else { f64::NAN };
        let listed = known.stat.map_or("", |t| t.name());
        let kind = found.certificate.map_or("", |t| t.stationarity.name());
        let b = found.certificate.map_or("", |t| t.b.name());
        c.record(
            &Object::new()
                .text("case", "mpcc-textbook")
                .text("problem", &name)
                .text("source", p.source)
                .int("n", p.program.n())
                .int("m", p.program.m())
                .int("pairs", p.members.len())
                .text("outcome", s.outcome.name())
                .num("objective", s.objective)
                .num("known", known.f)
                .num("error", error)
                .text("listed_type", listed)
                .text("type", kind)
                .text("b_stationary", b)
                .flag("identified", s.polish == Polish::Done)
                .num("violation", found.violation)
                .num("pair_min", found.pair_min)
                .int("iterations", s.stats.iterations)
                .num("wall_s", wall_s)
                .text("verdict", verdict)
                .text("note", &note),
        );
        self.table.row(vec![
            name,
            p.program.n().to_string(),
            p.program.m().to_string(),
            p.members.len().to_string(),
            s.outcome.name().into(),
            format!("{:.8e}", s.objective),
            format!("{:.8e}", known.f),
            short(error),
            listed.into(),
            kind.into(),
            b.into(),
            s.stats.iterations.to_string(),
            format!("{:.2}", 1e3 * wall_s),
            format!("{verdict} {note}"),
        ]);
    }
}

/// The recorded problems of a folder whose answers are known.
fn read(folder: &Path) -> Result<Vec<Problem<recorded::Recorded>>, String> {
    let text = std::fs::read_to_string(folder.join("train.json")).map_err(|e| e.to_string())?;
    let list: serde_json::Map<String, Value> = serde_json::from_str(&text).map_err(|e| format!("train.json: {e}"))?;
    let mut out = Vec::new();
    for (name, entry) in list.iter().filter(|p| KINDS.iter().any(|kind| p.0.starts_with(kind))) {
        let file = entry["file"].as_str().ok_or(format!("{name} names no file"))?;
        let f = recorded::read(&folder.join(file)).map_err(|e| format!("{file}: {e}"))?;
        out.push(Problem {
            name: name.clone(),
            source: "recorded",
            program: f.program,
            bounds: f.bounds,
            members: f.members,
            starts: vec![f.start],
            known: known(&entry["known"]),
        });
    }
    Ok(out)
}

fn known(v: &Value) -> Known {
    let expect = match v["expect"].as_str() {
        Some("infeasible") => Expect::Infeasible,
        Some("unbounded") => Expect::Unbounded,
        _ => Expect::Optimal,
    };
    let stat = |s: Option<&str>| {
        Some(match s? {
            "S" => Stat::S,
            "M" => Stat::M,
            "C" => Stat::C,
            "A" => Stat::A,
            _ => Stat::W,
        })
    };
    let mut f = v["f"].as_f64().unwrap_or(f64::NAN);
    let mut local = numbers(&v["local"]).unwrap_or_default();
    if v["global"] == false {
        local.push(f);
        f = f64::NAN;
    }
    let trap = |t: &Value| Some((numbers(&t[0])?, stat(t[1].as_str())?));
    let traps = v["spurious"].as_array().into_iter().flatten().filter_map(trap).collect();
    let x = numbers(&v["x"]);
    Known { expect, f, x, stat: stat(v["stat"].as_str()), local, traps }
}

fn numbers(v: &Value) -> Option<Vec<f64>> {
    v.as_array()?.iter().map(Value::as_f64).collect()
}
