//! Programs with complementarity constraints of the literature: the answers that are known, and the ones found.

#[path = "../../../tests/common/textbook/mod.rs"]
mod textbook;

use super::short;
use crate::json::{Object, Table};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::mpcc::{MpccSettings, Polish};
use switchback::nlp::Nlp;
use textbook::{all, relative, Expect, Verdict};

pub fn run(c: &Context) {
    let mut table = Table::new(&[
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
    let mut costs = Vec::new();
    let (mut passed, mut local, mut failed) = (0, 0, 0);
    for p in all() {
        for (k, start) in p.starts.iter().enumerate() {
            let clock = Instant::now();
            let found = p.solve(MpccSettings::default(), start);
            let wall_s = clock.elapsed().as_secs_f64();
            let s = &found.solution;
            let (verdict, note) = match p.judge(&found) {
                Verdict::Pass => ("PASS", String::new()),
                Verdict::Local => ("PASS", "a local minimum".to_string()),
                Verdict::Fail(why) => ("FAIL", why),
            };
            match (verdict, note.is_empty()) {
                ("PASS", true) => passed += 1,
                ("PASS", false) => local += 1,
                _ => failed += 1,
            }
            let name = if k == 0 { p.name.clone() } else { format!("{} ({})", p.name, k + 1) };
            let error = if p.known.expect == Expect::Optimal { relative(s.objective, p.known.f) } else { f64::NAN };
            let listed = p.known.stat.map_or("", |t| t.name());
            let kind = found.certificate.map_or("", |t| t.stationarity.name());
            let b = found.certificate.map_or("", |t| t.b.name());
            costs.push((costs.len() as f64, s.stats.iterations as f64));
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
                    .num("known", p.known.f)
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
            table.row(vec![
                name,
                p.program.n().to_string(),
                p.program.m().to_string(),
                p.members.len().to_string(),
                s.outcome.name().into(),
                format!("{:.8}", s.objective),
                format!("{:.8}", p.known.f),
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
    c.say("Programs of the literature with known answers");
    c.say(&table.text());
    c.say(&format!("{passed} global answers, {local} local minima, {failed} failures"));
    costs.sort_by(|a, b| a.1.total_cmp(&b.1));
    let sorted = costs.iter().enumerate().map(|(i, cost)| (i as f64 + 1.0, cost.1)).collect();
    let mut plot = Plot::new("Textbook problems, sorted by cost", "problems", "iterations");
    plot.add("iterations", Mark::Steps, sorted);
    c.plot(&plot, "mpcc-textbook.svg");
}
