//! The answer of one mode sequence: its contact mode program is solved, or given up early.

use super::answer::Answer;
use super::guards::{self, Touched};
use super::modal::{self, Held};
use super::modes::Sequence;
use super::overlap::overlaps;
use super::problem::Problem;
use super::track::Track;
use super::transcribe::Transcription;
use crate::error::Result;
use crate::mpcc::{Mpcc, MpccSettings, MpccSolver, NoProposals, Solution, Warm};
use crate::nlp::{Control, IterationInfo, Nlp, Outcome};
use crate::stop;

/// A program and its solver, with the solution they hold.
pub struct Solved {
    pub(super) transcription: Transcription,
    pub(super) solver: MpccSolver,
}

/// When the program of a sequence is given up, and how much its directions are asked for: most sequences next to a good one have no solution or a
/// worse one, and only saying so exactly is expensive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Iterations without half the violation.
    pub(super) patience: usize,
    /// A cost that has to be met, infinite where none has.
    pub(super) cost: f64,
    /// Do directions solve for the rows by themselves? On fine grids, and where a path constraint holds a contact in its place, rows are next to
    /// dependent, and of the last of their violation the usual directions leave all.
    pub(super) exact_rows: bool,
    /// Is the guess next to the solution?
    pub(super) close: bool,
}

impl Limits {
    /// Of a program that nothing is known of but this patience.
    pub(super) fn of_patience(patience: usize) -> Limits {
        Limits { patience, cost: f64::INFINITY, exact_rows: false, close: false }
    }
}

/// How often a motion with bodies that overlap between the points of its program is solved for again, with their gaps held there.
const WITNESSED: usize = 3;

/// Solves for the sequence of an answer with gaps held where bodies overlap in it, as long as there is a solution; the answer, or nothing
/// where it is none any more or bodies still overlap.
pub(super) fn without_overlap(
    p: &Problem,
    first: &Answer,
    settings: MpccSettings,
    limits: Limits,
    control: &mut Control,
) -> Result<Option<(Answer, Solved)>> {
    let mut held = Held::default();
    let mut found: Option<(Answer, Solved)> = None;
    for _ in 0..WITNESSED {
        let last = found.as_ref().map_or(first, |f| &f.0);
        let more = overlaps(p, &last.track);
        if more.is_empty() {
            break;
        }
        held.witnesses.extend(more);
        let (sequence, guess) = (last.sequence.clone(), last.track.clone());
        let next = solve_sequence(p, &sequence, &guess, &held, None, settings, limits, control)?;
        let solved = next.0.is_solved();
        found = Some(next);
        if !solved {
            break;
        }
    }
    Ok(found)
}

/// Solves the contact mode program of a sequence, or gives it up at `limits`.
#[allow(clippy::too_many_arguments)]
pub(super) fn solve_sequence(
    p: &Problem,
    sequence: &Sequence,
    guess: &Track,
    held: &Held,
    point: Option<&[Vec<f64>; 3]>,
    settings: MpccSettings,
    limits: Limits,
    control: &mut Control,
) -> Result<(Answer, Solved)> {
    let mut t = modal::transcribe(p, sequence, guess, held);
    t.bounds.validate(t.program.n(), t.program.m())?;
    stop::check_building(t.program.n())?;
    let mut solver = MpccSolver::new(&mut t.program, settings)?;
    if limits.exact_rows {
        solver.demand_rows();
    }
    let (s, largest) = run(&mut solver, &mut t, point, limits, control);
    let track = t.read(p, &s.x, &|_| Vec::new());
    let cost = t.cost(&s.x).unwrap_or(f64::NAN);
    let trouble = match (s.outcome, t.program.trouble()) {
        (Outcome::Failed, Some((name, _))) => Some(name.to_owned()),
        _ => None,
    };
    let (violation, broken) = match s.outcome {
        Outcome::Solved => (s.residuals.primal, None),
        _ => t.violation(&s.x),
    };
    let known = std::mem::take(&mut t.guards);
    let touched = match s.outcome {
        Outcome::Solved => guards::touched(&known, &mut t, &s.x),
        _ => Vec::new(),
    };
    t.guards = known;
    let params = (0..t.params.len()).filter_map(|j| t.params[j].map(|v| (j, s.x[v]))).collect();
    let lengths = modal::phase_lengths(p, sequence, &track);
    let vanishing = modal::vanishing(&lengths);
    let gradient = t.controls.iter().flat_map(|&u| s.z[u..u + p.given.dims.u].to_vec()).collect();
    let kinks = kinks(p, sequence, &track, &touched);
    let overlap = s.outcome == Outcome::Solved && !overlaps(p, &track).is_empty();
    let planned = sequence.clone();
    let mut sequence = sequence.clone();
    for (stage, lengths) in sequence.stages.iter_mut().zip(&lengths) {
        let whole: f64 = lengths.iter().sum();
        for (phase, length) in stage.iter_mut().zip(lengths) {
            phase.share = if whole > 0.0 { length / whole } else { 1.0 };
        }
    }
    sequence.tidy();
    let answer = Answer {
        outcome: s.outcome,
        x0: t.state(p, t.x0, &s.x),
        sequence,
        track,
        cost,
        largest,
        vanishing,
        touched,
        settled: false,
        overlap,
        kinks,
        gradient,
        residuals: s.residuals,
        certificate: s.certificate,
        stats: s.stats,
        dimensions: (t.program.n(), t.program.m(), t.program.pairs().len()),
        tried: 1,
        violation,
        broken,
        missed: None,
        blame: None,
        paradox: None,
        changes: Vec::new(),
        agreeing: [0; 2],
        effort: 0,
        freezing: None,
        point: [s.x, s.y, s.z],
        planned,
        params,
        trouble,
    };
    Ok((answer, Solved { transcription: t, solver }))
}

/// Events between control stages, and conditions of modes that are reached: the control stage, the time, and whether it is the latter.
fn kinks(p: &Problem, s: &Sequence, track: &Track, touched: &[Touched]) -> Vec<(usize, f64, bool)> {
    let phases = modal::phases_of_plan(p, s);
    let start = |phase: (usize, usize)| {
        let first = phases.iter().position(|at| *at == phase);
        first.and_then(|k| track.pieces.get(k)).map_or(f64::NAN, |piece| piece.t)
    };
    let between = s.events().into_iter().filter(|e| e.5 && e.4 > 0).map(|e| (e.4, start((e.4, 0)), false));
    let reached = touched.iter().map(|t| (t.phase.0, start(t.phase), true));
    let mut out: Vec<(usize, f64, bool)> = between.chain(reached).collect();
    out.sort_by(|a, b| (a.0, a.2).cmp(&(b.0, b.2)).then(a.1.total_cmp(&b.1)));
    out.dedup();
    out
}

fn run(
    solver: &mut MpccSolver,
    t: &mut Transcription,
    point: Option<&[Vec<f64>; 3]>,
    limits: Limits,
    control: &mut Control,
) -> (Solution, f64) {
    let mut ended = false;
    let mut prospects = Prospects::new(limits, solver.row_tolerance());
    let stop = control.stop.clone();
    let user = &mut control.monitor;
    let mut monitor = |i: &IterationInfo| {
        ended = !user.as_mut().is_none_or(|f| f(i));
        !ended && !prospects.are_over(i)
    };
    let mut inner = Control { stop: stop.clone(), monitor: Some(&mut monitor) };
    let (start, bounds) = (&t.start, &t.bounds);
    let mut s = stop.scope_apart(|| {
        match point.filter(|w| w[0].len() == t.program.n() && w[1].len() == t.program.m()) {
            Some([x, y, z]) => {
                solver.solve_warm(&mut t.program, bounds, &Warm { x, y, z }, &mut inner, &mut NoProposals)
            }
            None if limits.close => solver.solve_close(&mut t.program, bounds, start, &mut inner),
            None => solver.solve(&mut t.program, bounds, start, &mut inner),
        }
        .clone()
    });
    if ended {
        stop::raise();
    } else if prospects.over && s.outcome == Outcome::Stopped {
        s.outcome = Outcome::MaxIter;
    }
    (s, prospects.largest)
}

/// Violation below which patience is this many times as long; below which a program is not given up for it, and its cost says something.
const CLOSE: f64 = 1e-2;
const CLOSE_PATIENCE: usize = 3;
const FEASIBLE: f64 = 1e-4;
/// Barrier parameter up to which costs are those of the program but for what [`WINDOW`] iterations change.
const SMALL_BARRIER: f64 = 1e-4;
/// Iterations over which a cost is watched, and share of what is missing by which it has to fall in them.
const WINDOW: usize = 4;
const FALL: f64 = 0.25;
/// Share of a step from which it counts as a whole one, change of the violation in it, as a share, that counts as none, and for how many
/// iterations such a step counts: whole steps of Newton's method that leave a violation as it is are at the least there is.
const WHOLE: f64 = 0.5;
const SAME: f64 = 0.1;
const STATIONARY: usize = 2;
/// Length from which linear rows hold after a step, and share of its last value by which a violation has to fall in it; steps in a row
/// without that after which the rows of a program with a small barrier contradict each other. What is left of them is then what the
/// regularisation leaves of rows that cannot hold, and their multipliers grow without end.
const WHOLE_STEP: f64 = 0.95;
const FALLS: f64 = 0.02;
const CONTRADICTED: usize = 5;
/// Trials of the line search from which a step counts as cut, and such steps, beyond those that were not, after which a program whose constraints nearly
/// hold creeps: a force at its bound in a phase without length leaves rows that say the same twice.
const CUT: usize = 3;
const CREEPING: usize = 15;

/// What can still become of a program.
struct Prospects {
    limits: Limits,
    /// Violation of the rows that a program aims at.
    tolerance: f64,
    least: f64,
    last: f64,
    since: usize,
    costs: [f64; WINDOW],
    seen: usize,
    /// Steps that were cut, less those that were not.
    cut: usize,
    /// Whole steps in a row that have left the violation as it was.
    stationary: usize,
    begun: bool,
    over: bool,
    /// Largest modulus of the cost.
    largest: f64,
}

impl Prospects {
    fn new(limits: Limits, tolerance: f64) -> Prospects {
        let costs = [f64::INFINITY; WINDOW];
        Prospects {
            limits,
            tolerance,
            least: f64::INFINITY,
            last: f64::INFINITY,
            since: 0,
            costs,
            seen: 0,
            cut: 0,
            stationary: 0,
            begun: false,
            over: false,
            largest: 0.0,
        }
    }

    fn are_over(&mut self, i: &IterationInfo) -> bool {
        if i.phase == b'c' {
            // a linear program of the certificate says nothing of the sequence
            return false;
        }
        if i.phase == b' ' && i.objective.is_finite() {
            self.largest = self.largest.max(i.objective.abs());
        }
        if i.iter == 0 && std::mem::replace(&mut self.begun, true) {
            // the first point of a restoration has no violation, in a program of its own
            return self.over;
        }
        if i.inf_pr <= 0.5 * self.least {
            self.least = i.inf_pr;
            self.since = 0;
        } else {
            let stationary = i.alpha_pr > WHOLE && (i.inf_pr - self.last).abs() <= SAME * self.last;
            self.since += if stationary { STATIONARY } else { 1 };
        }
        let idle = i.alpha_pr > WHOLE_STEP && i.inf_pr > self.tolerance && i.mu <= SMALL_BARRIER;
        let idle = idle && self.last.is_finite() && (i.inf_pr - self.last).abs() <= FALLS * self.last;
        self.stationary = if idle { self.stationary + 1 } else { 0 };
        self.last = i.inf_pr;
        let far = self.since > self.limits.patience && self.least > CLOSE;
        let near = self.since > CLOSE_PATIENCE * self.limits.patience && self.least > FEASIBLE;
        self.cut = if i.trials >= CUT && i.inf_pr <= FEASIBLE { self.cut + 1 } else { self.cut.saturating_sub(1) };
        self.over = far || near || self.cut > CREEPING || self.stationary >= CONTRADICTED || self.is_too_expensive(i);
        self.over
    }

    /// Does the cost of a point that meets the constraints stay above the one that has to be met?
    fn is_too_expensive(&mut self, i: &IterationInfo) -> bool {
        if i.inf_pr > FEASIBLE || i.mu > SMALL_BARRIER {
            self.seen = 0;
            return false;
        }
        let before = std::mem::replace(&mut self.costs[self.seen % WINDOW], i.objective);
        self.seen += 1;
        let missing = i.objective - self.limits.cost;
        self.seen > WINDOW && missing > 0.0 && before - i.objective < FALL * missing
    }
}

#[cfg(test)]
mod tests {
    use super::{Limits, Prospects, CONTRADICTED};
    use crate::nlp::IterationInfo;

    /// The iterations after which a program is given up whose violation is `of(k)` at iteration `k`, all of them behind steps of length
    /// `alpha` and at the barrier parameter `mu`; at most `most`.
    fn given_up_after(of: impl Fn(usize) -> f64, (alpha, mu): (f64, f64), most: usize) -> usize {
        let mut p = Prospects::new(Limits::of_patience(1000), 1e-9);
        let info = |k: usize| IterationInfo {
            iter: k,
            inf_pr: of(k),
            alpha_pr: alpha,
            mu,
            trials: 1,
            phase: b' ',
            ..Default::default()
        };
        (0..most).find(|&k| p.are_over(&info(k))).unwrap_or(most)
    }

    #[test]
    fn rows_that_whole_steps_leave_as_they_are_contradict_each_other() {
        let stays = |_: usize| 1e-7;
        // the first iteration has no step that could have left it
        assert_eq!(given_up_after(stays, (1.0, 1e-8), 40), CONTRADICTED);
        // steps that are cut say nothing, nor do those at a large barrier
        assert_eq!(given_up_after(stays, (0.9, 1e-8), 40), 40);
        assert_eq!(given_up_after(stays, (1.0, 1e-2), 40), 40);
        // a fall by a tenth in every fourth step is a fall, and what is below the tolerance is a solution
        assert_eq!(given_up_after(|k| 1e-7 * 0.9f64.powi((k / 4) as i32), (1.0, 1e-8), 40), 40);
        assert_eq!(given_up_after(|_| 1e-10, (1.0, 1e-8), 40), 40);
    }
}
