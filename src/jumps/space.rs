//! What is searched where there are contacts: orders of them, the programs of orders, and the orders next to one.

use std::cmp::Ordering;
use std::rc::Rc;

use super::answer::{Answer, Found};
use super::exact::{solve_sequence, without_overlap, Limits, Solved};
use super::guards::Condition;
use super::modal::{self, Held};
use super::modes::{Key, Sequence};
use super::neighbours::{in_turn, neighbours, with_impact, Move, Neighbour};
use super::options::{Lead, Options};
use super::problem::{Problem, CONTRADICTION};
use super::sources::Sources;
use super::track::Track;
use crate::error::Result;
use crate::func::Point;
use crate::mpcc::MpccSettings;
use crate::nlp::{Control, Outcome};
use crate::search::{self, Budget, Candidate, Rank, Source, Space};
use crate::stop;

/// First barrier parameter of the program of an order: its guess is a motion.
const NEAR_BARRIER: f64 = 1e-2;
/// Iterations without half the violation after which the program of an order is given up, and the multiple of that for orders that are given, and where
/// nothing has a solution.
const PATIENCE: usize = 10;
const PATIENT: usize = 10;
/// Violation up to which the program of an order that got stuck goes on from there, where its cost exceeds the best one by no more than this share.
const PROMISING: f64 = 1e-2;
/// Places in which an impact of a contact is put in.
const PUT_IN: usize = 3;

/// Did a program end for want of steps that lead on?
fn is_stuck(a: &Answer) -> bool {
    !a.is_solved() && matches!(a.outcome, Outcome::MaxIter | Outcome::Stalled)
}

/// An order of contacts. It is its modes and jumps; lengths of phases are what a program begins with.
#[derive(Debug, Clone)]
pub(super) struct Order {
    pub(super) sequence: Sequence,
    key: Key,
}

impl Order {
    pub(super) fn new(sequence: Sequence) -> Order {
        Order { key: sequence.key(), sequence }
    }
}

impl PartialEq for Order {
    fn eq(&self, other: &Order) -> bool {
        self.key == other.key
    }
}

impl Eq for Order {}

impl PartialOrd for Order {
    fn partial_cmp(&self, other: &Order) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Order {
    fn cmp(&self, other: &Order) -> Ordering {
        self.key.cmp(&other.key)
    }
}

/// Where the program of an order begins.
#[derive(Clone)]
pub(super) struct Motion {
    pub(super) track: Rc<Track>,
    /// Variables and multipliers, where the program has as many.
    pub(super) point: Option<Rc<[Vec<f64>; 3]>>,
    /// Number of the start that it comes from.
    pub(super) start: usize,
    /// Is the order one that was given, and not one among many?
    pub(super) given: bool,
    /// Is it next to the solution?
    pub(super) close: bool,
}

/// What the program of an order ended at.
pub(super) struct Ended {
    pub(super) answer: Answer,
    pub(super) solved: Solved,
    start: usize,
}

/// Which orders next to a solution are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reach {
    /// Those that phases without length lead to.
    Wanted,
    /// Those whose motions are next to the present one.
    Local,
    All,
}

/// The orders of contacts of a problem.
pub(super) struct Contacts<'a> {
    p: &'a Problem,
    options: &'a Options,
    pub(super) sources: Sources<'a>,
    reach: Reach,
    /// Is an answer that is known solved for on another grid?
    refines: bool,
    /// Largest cost on the way to a solution: costs have the rounding of that, also where they end at zero.
    largest: f64,
    /// The problem with room for constraints that contradict each other by next to nothing, once an order asks for it.
    with_room: Option<Problem>,
    /// Variables, rows and pairs of the program with the most.
    pub(super) dimensions: (usize, usize, usize),
    /// Least violation that every start has led to, where it has led to no solution.
    pub(super) least: Vec<f64>,
}

impl<'a> Contacts<'a> {
    pub(super) fn new(p: &'a Problem, options: &'a Options, reach: Reach, refines: bool) -> Contacts<'a> {
        Contacts {
            p,
            options,
            sources: Sources::new(p, options),
            reach,
            refines,
            largest: match options.lead {
                Lead::Descents { size, .. } => size,
                Lead::Guess => 0.0,
            },
            with_room: None,
            dimensions: (0, 0, 0),
            least: Vec::new(),
        }
    }

    /// The problem as stated, or with room for constraints that contradict each other by next to nothing.
    fn problem(&mut self, has_room: bool) -> &Problem {
        if has_room && !self.p.has_room {
            self.with_room.get_or_insert_with(|| self.p.with_room())
        } else {
            self.p
        }
    }

    /// Solves the program of an order, with room for constraints that contradict each other by next to nothing or as stated.
    fn program(
        &mut self,
        (sequence, has_room): (&Sequence, bool),
        (track, point): (&Track, Option<&[Vec<f64>; 3]>),
        limits: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<(Answer, Solved)> {
        let (held, settings) = (Held::default(), self.settings());
        let p = self.problem(has_room);
        let found = solve_sequence(p, sequence, track, &held, point, settings, limits, control)?;
        self.count(&found.0, budget);
        Ok(found)
    }

    /// Solves for an order: once more where that is close to a solution, with room where constraints contradict each other by next to nothing, and with gaps
    /// held where bodies overlap.
    fn answer(
        &mut self,
        order: &Sequence,
        from: (&Track, Option<&[Vec<f64>; 3]>),
        limits: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Found> {
        let (mut answer, mut solved) = self.program((order, false), from, limits, budget, control)?;
        if limits.close && !answer.is_solved() {
            (answer, solved) =
                self.program((order, false), from, Limits { close: false, ..limits }, budget, control)?;
        }
        let limits = Limits { close: false, ..limits };
        let cheaper = limits.cost.is_infinite() || answer.cost < limits.cost + PROMISING * limits.cost.abs();
        if is_stuck(&answer) && cheaper && answer.violation < PROMISING && answer.vanishing.is_empty() {
            // again from where it got to: steps that the filter of the last solve refuses are often the right ones
            let last = answer.point.clone();
            let again = self.program((order, false), (from.0, Some(&last)), limits, budget, control)?;
            if again.0.is_solved() || again.0.violation < answer.violation {
                (answer, solved) = again;
            }
        }
        if is_stuck(&answer) && cheaper && answer.violation <= CONTRADICTION && !self.p.has_room {
            let last = answer.point.clone();
            let again = self.program((order, true), (from.0, Some(&last)), limits, budget, control)?;
            if again.0.is_solved() {
                (answer, solved) = again;
            }
        }
        if answer.overlap && answer.cost < limits.cost {
            // the cost of a motion that cannot be is none to compare with
            let settings = self.settings();
            let p = self.problem(answer.has_room);
            if let Some(apart) = without_overlap(p, &answer, settings, limits, control)? {
                self.count(&apart.0, budget);
                if apart.0.is_solved() || limits.cost.is_finite() {
                    (answer, solved) = apart;
                }
            }
        }
        Ok((answer, solved))
    }

    fn settings(&self) -> MpccSettings {
        MpccSettings { mu_init: NEAR_BARRIER, ..self.options.solver }
    }

    fn count(&mut self, a: &Answer, budget: &mut Budget) {
        budget.solved(a.dimensions.0, &a.stats);
        self.largest = self.largest.max(a.largest);
        if a.dimensions.0 > self.dimensions.0 {
            self.dimensions = a.dimensions;
        }
    }

    /// Orders with one impact more, where an open contact comes closest to closing.
    fn with_impacts(&self, best: &Answer) -> Vec<Neighbour> {
        let g = &self.p.given;
        let mut out = Vec::new();
        let planned = &best.sequence;
        let places: Vec<(usize, usize)> =
            planned.stages.iter().enumerate().flat_map(|(k, s)| (0..s.len()).map(move |j| (k, j))).collect();
        // gaps at the ends of stages, where every stage has an end
        let ends: Vec<Vec<f64>> = (0..self.p.n_stages())
            .filter_map(|k| {
                let piece = best.track.pieces.iter().rev().find(|p| p.stage == k)?;
                let x = &piece.xs[piece.xs.len() - g.dims.x..];
                let at = Point {
                    t: piece.t + piece.h,
                    x,
                    u: &best.track.controls[k * g.wide.u..k * g.wide.u + g.dims.u],
                    p: &g.params[k * g.wide.p..k * g.wide.p + g.dims.p],
                };
                Some(self.p.gaps(&at).iter().map(|gap| gap.1).collect())
            })
            .collect();
        for c in 0..self.p.n_contacts() {
            let gap = |k: usize| ends.get(k).map_or(f64::INFINITY, |e| e[c]);
            let mut low: Vec<usize> =
                (1..ends.len()).filter(|&k| gap(k) <= gap(k - 1) && gap(k) <= gap(k + 1)).collect();
            low.sort_by(|a, b| gap(*a).total_cmp(&gap(*b)));
            for k in low.into_iter().take(PUT_IN) {
                let open = places.iter().rev().find(|(i, j)| *i == k && !planned.stages[k][*j].modes[c].is_closed());
                let sequence = open.and_then(|&(k, j)| with_impact(planned, k, j, c));
                let local = best.touched.iter().any(|t| (t.contact, t.condition, t.phase.0) == (c, Condition::Gap, k));
                let with =
                    |sequence| Neighbour { sequence, moved: Move::Impact(c), wanted: false, local, class: u8::MAX };
                out.extend(sequence.map(with));
            }
        }
        out
    }

    /// Orders next to that of an answer within reach, those that are next to its motion first.
    fn next_to(&self, a: &Answer) -> Vec<Neighbour> {
        let frictional: Vec<bool> = self.p.functions.contacts.iter().map(|c| c.n_tangents > 0).collect();
        let mut near = neighbours(&a.sequence, &a.vanishing, &a.touched, &frictional, !a.is_solved());
        near.extend(self.with_impacts(a));
        near.retain(|n| match self.reach {
            Reach::Wanted => n.wanted,
            Reach::Local => n.local || !a.is_solved(),
            Reach::All => true,
        });
        near.sort_by_key(|n| (!n.wanted, n.class));
        if a.is_solved() && self.reach == Reach::All {
            in_turn(&mut near);
        }
        near.retain(|n| modal::can_begin(self.p, &n.sequence));
        near
    }
}

impl Space for Contacts<'_> {
    type Sequence = Order;
    type Motion = Motion;
    type Solution = Ended;

    fn propose(
        &mut self,
        source: Source,
        best: Option<&Ended>,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<Candidate<Order, Motion>>> {
        let best = best.map(|b| &b.answer);
        self.sources.next(source, best, budget, control)
    }

    fn expected(&self, source: Source) -> Option<f64> {
        self.sources.expected(source)
    }

    fn solve(
        &mut self,
        c: &Candidate<Order, Motion>,
        limits: search::Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<(Order, Ended)>> {
        let Candidate { sequence: order, motion, .. } = c;
        if !modal::can_begin(self.p, &order.sequence) || stop::requested().is_some() {
            return Ok(Vec::new());
        }
        let patience = if motion.given || limits.patience > 1 { PATIENT * PATIENCE } else { PATIENCE };
        let limits = Limits { patience, cost: limits.cost, exact_rows: self.refines, close: motion.close };
        let from = (&*motion.track, motion.point.as_deref());
        let (answer, solved) = self.answer(&order.sequence, from, limits, budget, control)?;
        let start = motion.start;
        if !answer.is_solved() {
            self.least.resize(self.least.len().max(start + 1), f64::INFINITY);
            self.least[start] = self.least[start].min(answer.violation);
        }
        Ok(vec![(order.clone(), Ended { answer, solved, start })])
    }

    fn rank(&self, s: &Ended) -> Rank {
        let a = &s.answer;
        let (idle, rounding) = (a.vanishing.len(), f64::EPSILON * self.largest);
        let (feasible, cost, violation) = (a.is_solved(), a.cost, a.violation);
        Rank { feasible, contradicted: false, cost, violation, idle, rounding }
    }

    fn neighbours(&self, s: &Ended) -> (Vec<search::Neighbour<Order>>, Motion) {
        let kind = |n: &Neighbour| match n.wanted {
            true => 2 * Move::KINDS,
            false => 2 * n.moved.kind() + usize::from(n.local),
        };
        let of = |n: Neighbour| search::Neighbour {
            promise: 0.0,
            kind: kind(&n),
            is_local: n.local,
            sequence: Order::new(n.sequence),
        };
        let motion =
            Motion { track: Rc::new(s.answer.track.clone()), point: None, start: s.start, given: false, close: false };
        (self.next_to(&s.answer).into_iter().map(of).collect(), motion)
    }
}
