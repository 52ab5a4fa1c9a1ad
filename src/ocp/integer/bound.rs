//! Branch and bound over choices, where problems with choices between their values are convex.
//!
//! What such a problem costs is the least that any sequence between these values does. The set with the least bound is divided: the choice that is furthest
//! from one of its values is below it in one half and above in the other. Sets whose bound is no lower than the best sequence are left.

use super::levels::{Levels, Sequence};
use super::space::{Choices, Ended};
use super::Proof;
use crate::error::Result;
use crate::nlp::{Control, Outcome};
use crate::ocp::{Ocp, OcpResult};
use crate::search::Budget;

/// Share of the cost up to which two costs are the same: a hundred times the tolerance of the solver.
const GAP: f64 = 1e-6;
/// Share of the distance of two values up to which a choice is at one of them.
const AT_VALUE: f64 = 1e-6;

/// All sequences between two.
struct Set {
    low: Sequence,
    high: Sequence,
    /// The least that one of them costs.
    least: f64,
}

impl Ocp {
    /// Divides the sets of sequences within a limit of work, from the best sequence that is known.
    pub(super) fn bound_choices(
        &self,
        space: &mut Choices,
        best: Option<&Ended>,
        (most, budget): (f64, &mut Budget),
        control: &mut Control,
    ) -> Result<Proof> {
        let levels = space.levels.clone();
        let mut incumbent = best.map_or(f64::INFINITY, |b| b.result.priced);
        let mut better = None;
        // one sequence that is neither solved for nor proven impossible
        let mut doubt = false;
        let [low, high] = levels.widest();
        let mut open = vec![Set { low, high, least: f64::NEG_INFINITY }];
        // the least bound of what was left because it is not lower than the best
        let mut left = f64::INFINITY;
        let share = |incumbent: f64, least: f64| ((incumbent - least) / self.cost_size(incumbent)).max(0.0);
        loop {
            let first = (0..open.len()).min_by(|a, b| open[*a].least.total_cmp(&open[*b].least));
            let Some(set) = first.map(|k| open.swap_remove(k)) else { break };
            if incumbent.is_finite() && share(incumbent, set.least) <= GAP {
                left = left.min(set.least);
                break;
            }
            if budget.is_over() || budget.spent() >= most {
                let gap = if incumbent.is_finite() { share(incumbent, left.min(set.least)) } else { f64::INFINITY };
                return Ok(Proof { better, gap, is_complete: false });
            }
            let r = space.solve_between([&set.low, &set.high], None, budget, control)?;
            if matches!(r.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) {
                // of a convex problem the one is the other
                continue;
            }
            let known = r.outcome == Outcome::Solved;
            let least = if known { set.least.max(r.priced) } else { set.least };
            if incumbent.is_finite() && share(incumbent, least) <= GAP {
                left = left.min(least);
                continue;
            }
            let at = if known { levels.nearest_values(&r.controls) } else { set.low.clone() };
            if known && levels.furthest(&r, &set.low, &set.high).is_none() && levels.is_held(&at) {
                let ended = space.solve_sequence(at, budget, control)?;
                left = left.min(least);
                doubt |= ended.as_ref().is_none_or(|e| !e.is_solution());
                if let Some(one) = ended.filter(|e| e.is_solution() && e.result.priced < incumbent) {
                    incumbent = one.result.priced;
                    better = Some(one);
                }
                continue;
            }
            let halves = levels.divide(&Set { least, ..set }, known.then_some(&r), &at);
            doubt |= halves.is_empty() && !known;
            open.extend(halves);
        }
        let gap = if left.is_finite() && incumbent.is_finite() { share(incumbent, left) } else { 0.0 };
        match doubt {
            true => Ok(Proof { better, ..Proof::none() }),
            false => Ok(Proof { better, gap, is_complete: true }),
        }
    }
}

impl Levels {
    /// Of every entry the value that is nearest to controls `[n_stages · nu]`, however long it is held.
    fn nearest_values(&self, controls: &[f64]) -> Sequence {
        let nearest = |e: usize| {
            let u = controls[self.place(e)];
            let values = self.values(e % self.n());
            let off = |at: &usize| (values[*at] - u).abs();
            (0..values.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0) as u16
        };
        (0..self.n() * self.n_stages()).map(nearest).collect()
    }

    /// The entry that is furthest from its values, as a share of the distance of the two next to it, and the value below it; nothing where all are
    /// at one.
    fn furthest(&self, r: &OcpResult, low: &[u16], high: &[u16]) -> Option<(usize, u16)> {
        let off = |e: usize| {
            let u = r.controls[self.place(e)];
            let values = self.values(e % self.n());
            let below = values.partition_point(|v| *v <= u).saturating_sub(1).clamp(low[e].into(), high[e].into());
            let (a, b) = (values[below], values[(below + 1).min(values.len() - 1)]);
            let share = if b > a { ((u - a).min(b - u) / (b - a)).max(0.0) } else { 0.0 };
            (share, below as u16)
        };
        let open = (0..low.len()).filter(|&e| low[e] < high[e]);
        let far = open.map(|e| (e, off(e))).filter(|f| f.1 .0 > AT_VALUE);
        far.max_by(|a, b| a.1 .0.total_cmp(&b.1 .0).then(b.0.cmp(&a.0))).map(|(e, (_, below))| (e, below))
    }

    /// The two halves of a set: at the entry furthest from its values, or where none is, at one that the values of a run depend on which is too
    /// short, or at any. Nothing where one sequence is left.
    fn divide(&self, set: &Set, r: Option<&OcpResult>, at: &[u16]) -> Vec<Set> {
        let is_open = |e: usize| set.low[e] < set.high[e];
        let short = || {
            let (c, stages) = self.short_run(at)?;
            let around = stages.start.saturating_sub(1)..(stages.end + 1).min(self.n_stages());
            around.map(|k| k * self.n() + c).find(|e| is_open(*e))
        };
        let any = || (0..at.len()).find(|e| is_open(*e));
        let below = |e: usize| (e, at[e].clamp(set.low[e], set.high[e] - 1));
        let far = r.and_then(|r| self.furthest(r, &set.low, &set.high));
        let Some((e, below)) = far.or_else(|| short().or_else(any).map(below)) else { return Vec::new() };
        let below = below.min(set.high[e] - 1);
        let mut halves = [0, 1].map(|_| Set { low: set.low.clone(), high: set.high.clone(), least: set.least });
        halves[0].high[e] = below;
        halves[1].low[e] = below + 1;
        halves.into()
    }
}
