//! Every relaxation and penalty with both homotopies over the collection of small programs: how many are solved, at
//! what cost, and how many without the help of the polish.

use super::mpcc_textbook::textbook::{all, Expect, Problem, Verdict};
use crate::json::{Object, Table};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::mpcc::{MpccSettings, Polish};
use switchback::settings::{Homotopy, Relaxation};

/// A run that is longer has failed.
const MAX_ITER: usize = 1000;

/// What a strategy did over the collection.
#[derive(Default)]
struct Score {
    global: usize,
    local: usize,
    identified: usize,
    wall_s: f64,
    /// Iterations of the runs that ended as they should.
    iterations: Vec<usize>,
    /// Problems that ended otherwise, and how.
    failed: Vec<String>,
}

impl Score {
    fn run(settings: MpccSettings, problems: &[Problem]) -> Score {
        let mut out = Score::default();
        for p in problems {
            for (k, start) in p.starts.iter().enumerate() {
                let clock = Instant::now();
                let found = p.solve(settings, start);
                out.wall_s += clock.elapsed().as_secs_f64();
                out.identified += usize::from(found.solution.polish == Polish::Done);
                match p.judge(&found) {
                    Verdict::Pass => out.global += 1,
                    Verdict::Local => out.local += 1,
                    Verdict::Fail(why) => {
                        out.failed.push(format!("{} ({}): {why}", p.name, k + 1));
                        continue;
                    }
                }
                out.iterations.push(found.solution.stats.iterations);
            }
        }
        out.iterations.sort_unstable();
        out
    }

    fn median(&self) -> usize {
        self.iterations.get(self.iterations.len() / 2).copied().unwrap_or(0)
    }

    /// Solved runs over iterations.
    fn profile(&self) -> Vec<(f64, f64)> {
        self.iterations.iter().enumerate().map(|(i, n)| (((*n).max(1) as f64).log10(), i as f64 + 1.0)).collect()
    }
}

pub fn run(c: &Context) {
    let problems: Vec<Problem> =
        all().into_iter().filter(|p| !p.members.is_empty() && p.known.expect == Expect::Optimal).collect();
    let runs: usize = problems.iter().map(|p| p.starts.len()).sum();
    let head =
        ["relaxation", "homotopy", "global", "local", "failed", "identified", "median its", "total its", "ms", ""];
    let mut table = Table::new(&head);
    for homotopy in [Homotopy::Coupled, Homotopy::Outer] {
        let mut plot = Plot::new("Solved runs", "log10 of iterations", "runs");
        for relaxation in (0..).map_while(Relaxation::from_i64) {
            let settings = MpccSettings { relaxation, homotopy, max_iter: MAX_ITER, ..MpccSettings::default() };
            let s = Score::run(settings, &problems);
            let total: usize = s.iterations.iter().sum();
            c.record(
                &Object::new()
                    .text("case", "relaxations")
                    .text("relaxation", relaxation.name())
                    .text("homotopy", homotopy.name())
                    .int("runs", runs)
                    .int("global", s.global)
                    .int("local", s.local)
                    .int("identified", s.identified)
                    .int("median_iterations", s.median())
                    .int("iterations", total)
                    .num("wall_s", s.wall_s)
                    .text("failed", &s.failed.join("; ")),
            );
            table.row(vec![
                relaxation.name().into(),
                homotopy.name().into(),
                s.global.to_string(),
                s.local.to_string(),
                s.failed.len().to_string(),
                s.identified.to_string(),
                s.median().to_string(),
                total.to_string(),
                format!("{:.1}", 1e3 * s.wall_s),
                s.failed.first().cloned().unwrap_or_default(),
            ]);
            plot.add(relaxation.name(), Mark::Line, s.profile());
        }
        c.plot(&plot, &format!("relaxations-{}.svg", homotopy.name()));
    }
    c.say(&format!("{runs} runs of small programs with known answers, every relaxation and penalty"));
    c.say(&table.text());
}
