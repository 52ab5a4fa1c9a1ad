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
use crate::nlp::{Control, Nlp, Outcome};
use crate::search::{watched, EarlyTermination, Patience};
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
    let is_solved = s.outcome == Outcome::Solved;
    let touched = if is_solved { guards::touched(&known, &mut t, &s.x) } else { Vec::new() };
    t.guards = known;
    let params = (0..t.params.len()).filter_map(|j| t.params[j].map(|v| (j, s.x[v]))).collect();
    let lengths = modal::phase_lengths(p, sequence, &track);
    let vanishing = modal::vanishing(&lengths);
    let gradient = t.controls.iter().flat_map(|&u| s.z[u..u + p.given.dims.u].to_vec()).collect();
    let kinks = kinks(p, sequence, &track, &touched);
    let overlap = is_solved && !overlaps(p, &track).is_empty();
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
        has_room: p.has_room,
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

/// Steps that are cut after which a program creeps: a force at its bound in a phase without length leaves rows that say the same twice.
const CREEPING: usize = 15;

fn run(
    solver: &mut MpccSolver,
    t: &mut Transcription,
    point: Option<&[Vec<f64>; 3]>,
    limits: Limits,
    control: &mut Control,
) -> (Solution, f64) {
    let patience = Patience { iterations: limits.patience, stationary: 2, cut: CREEPING };
    let mut watch = EarlyTermination::new(limits.cost, patience, solver.row_tolerance());
    let (start, bounds) = (&t.start, &t.bounds);
    let mut s = watched(&mut watch, control, |inner| {
        match point.filter(|w| w[0].len() == t.program.n() && w[1].len() == t.program.m()) {
            Some([x, y, z]) => solver.solve_warm(&mut t.program, bounds, &Warm { x, y, z }, inner, &mut NoProposals),
            None if limits.close => solver.solve_close(&mut t.program, bounds, start, inner),
            None => solver.solve(&mut t.program, bounds, start, inner),
        }
        .clone()
    });
    if watch.is_over() && s.outcome == Outcome::Stopped {
        s.outcome = Outcome::MaxIter;
    }
    (s, watch.largest)
}
