//! The race of all sources.
//!
//! A source is a local search of its own: it proposes candidates, whose programs are solved, and goes from what it has found to the sequences next to
//! that, the best first. What one source has found leads no other one elsewhere: a sequence that another one has tried counts as if it had been solved for
//! again. So all together find what each of them finds alone with its share of the work. The next step belongs to the source that has gained most for its work, by Laplace's rule of succession: one that has
//! bettered the best solution `k` times in the work `w` has the prospect `(k + 1) / (w + c)` of doing so again, where `c` is what a step takes on
//! average. So sources that never help have equal shares, and what helps has more. By the same rule a source divides its work between new
//! candidates and neighbours. Gains on the way to a solution that nothing next to is better than say nothing of what lies beyond, and are forgotten.
//!
//! The search ends when all sources have ended, when the budget has, or when the best solution is no dearer than all next to it
//! and since the last gain it has done `effort` times the work until then and tried `effort` times eight candidates: by the rule of succession the next
//! one has a chance of 1 in 10 at most then. No decision depends on the budget, so that more of it leads further on the
//! same way, and never to a worse solution.

use std::collections::{BTreeMap, VecDeque};

use super::budget::Budget;
use super::rank::Rank;
use super::space::{Candidate, Limits, Neighbour, Source, Space};
use crate::error::{Error, Result};
use crate::nlp::Control;
use crate::stop;

/// Candidates in a row without a gain after which the next one is a gain with a probability of 1 in 10 at most, by the rule of succession.
const IN_VAIN: f64 = 8.0;
/// Multiple of the usual patience with a program where nothing has a solution: one more try for each, as long as a solver may take.
const PATIENT: usize = 2;

/// What a search is to do.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// Sources in the order of their first steps.
    pub sources: Vec<Source>,
    /// Multiple of the work until the last gain after which the search ends.
    pub effort: f64,
    /// Share of the cost by which a solution has to be better to be a gain: smaller ones are kept, but not worked for.
    pub gain: f64,
    /// Sequences that are tried at least before the search ends of itself.
    pub least_tried: usize,
    /// Does any solution do? Without costs all are as good.
    pub any: bool,
}

/// Why a search has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ended {
    /// No source has anything left.
    Exhausted,
    /// More work is not worth what it costs, by the history of the problem; or any solution does.
    Enough,
    /// As much was spent as is allowed.
    Limit,
}

/// What a search has found.
pub(crate) struct Found<T, S> {
    /// What programs ended at, with their sequences, the best first, solutions before others.
    pub all: Vec<(T, S)>,
    /// Were all local neighbours of the best one tried?
    pub settled: bool,
    /// Sequences that were tried.
    pub tried: usize,
    /// Why it ended.
    pub ended: Ended,
    /// Work of every source.
    #[cfg(test)]
    pub shares: Vec<(Source, f64)>,
}

/// Work and gains of what takes part in a race.
#[derive(Debug, Clone, Copy, Default)]
struct Record {
    spent: f64,
    gains: usize,
}

impl Record {
    /// Gains for the next unit of work, by the rule of succession; `usual` is what a step takes.
    fn prospect(self, usual: f64) -> f64 {
        (self.gains + 1) as f64 / (self.spent + usual)
    }
}

/// The sequences next to a solution that are left, and the motion their programs begin with.
struct Next<S: Space> {
    left: Vec<Neighbour<S::Sequence>>,
    motion: S::Motion,
}

/// The best that a source has found: the number of what its program ended at, and what is left next to it once that was asked for.
struct Own<S: Space> {
    node: usize,
    next: Option<Next<S>>,
}

impl<S: Space> Own<S> {
    /// May it have neighbours left?
    fn has_next(&self) -> bool {
        self.next.as_ref().is_none_or(|n| !n.left.is_empty())
    }
}

/// A source in the race.
struct Arm<S: Space> {
    source: Source,
    queue: VecDeque<Candidate<S::Sequence, S::Motion>>,
    /// Has it no more to propose?
    ended: bool,
    all: Record,
    /// Of candidates, and of neighbours.
    parts: [Record; 2],
    steps: usize,
    /// Of every kind of neighbour: how often it was better than what it was next to, and how often it was tried.
    kinds: BTreeMap<usize, [usize; 2]>,
    best: Option<Own<S>>,
}

impl<S: Space> Arm<S> {
    fn has_candidate(&self) -> bool {
        !self.ended || !self.queue.is_empty()
    }

    fn has_neighbour(&self) -> bool {
        self.best.as_ref().is_some_and(Own::has_next)
    }

    /// The part with the next step.
    fn next_part(&self) -> usize {
        let usual = self.all.spent / self.steps.max(1) as f64 + 1.0;
        let has = [self.has_candidate(), self.has_neighbour()];
        let prospect = |part: usize| if has[part] { self.parts[part].prospect(usual) } else { 0.0 };
        usize::from(prospect(1) > prospect(0))
    }
}

/// What is known of a sequence.
#[derive(Debug, Clone, Default)]
struct Known {
    /// Sources whose motions its program has begun with.
    from: Vec<Source>,
    /// The number of what the program ended at.
    node: Option<usize>,
    /// Work of its programs, and the arms that have paid for it.
    work: f64,
    arms: Vec<usize>,
}

/// A candidate without a solution: its violation, the arm it is from, and itself.
type Failed<S> = (f64, usize, Candidate<<S as Space>::Sequence, <S as Space>::Motion>);

struct Race<'a, S: Space> {
    space: &'a mut S,
    plan: &'a Plan,
    budget: &'a mut Budget,
    arms: Vec<Arm<S>>,
    /// What programs ended at, with their sequences.
    nodes: Vec<(S::Solution, S::Sequence)>,
    /// Numbers of them, the best first.
    order: Vec<usize>,
    tried: BTreeMap<S::Sequence, Known>,
    failed: Vec<Failed<S>>,
    attempts: usize,
    /// Candidates of sources, those among them that lead to what is known.
    candidates: usize,
    steps: usize,
    /// Work that was done before it.
    began: f64,
    /// Its work and candidates at the last gain.
    gained_at: (f64, usize),
}

/// Searches for the best solution of a space, beginning with what is known of it.
///
/// # Errors
/// Those of the space, unless they are interrupts behind a first solution.
pub(crate) fn explore<S: Space>(
    space: &mut S,
    plan: &Plan,
    known: Vec<(S::Solution, S::Sequence)>,
    budget: &mut Budget,
    control: &mut Control,
) -> Result<Found<S::Solution, S::Sequence>> {
    let arm = |source: &Source| Arm {
        source: *source,
        queue: VecDeque::new(),
        ended: false,
        all: Record::default(),
        parts: [Record::default(); 2],
        steps: 0,
        kinds: BTreeMap::new(),
        best: None,
    };
    let mut race = Race {
        arms: plan.sources.iter().map(arm).collect(),
        space,
        plan,
        began: budget.spent(),
        budget,
        nodes: Vec::new(),
        order: Vec::new(),
        tried: BTreeMap::new(),
        failed: Vec::new(),
        attempts: 0,
        candidates: 0,
        steps: 0,
        gained_at: (0.0, 0),
    };
    for (solution, sequence) in known {
        let rank = race.space.rank(&solution);
        race.keep(solution, sequence, rank);
    }
    let ended = loop {
        // where nothing was found yet the first program is an answer of sorts
        if race.budget.is_over() && (!race.nodes.is_empty() || stop::requested().is_some()) {
            break Ended::Limit;
        }
        if race.is_enough() {
            break Ended::Enough;
        }
        let best = race.best();
        let incumbent = if best.feasible && !best.contradicted { best.cost } else { f64::INFINITY };
        match control.with_incumbent(incumbent, |control| race.step(control)) {
            Ok(true) => {}
            Ok(false) => break Ended::Exhausted,
            Err(Error::Interrupted | Error::OutOfTime) if !race.nodes.is_empty() => break Ended::Limit,
            Err(e) => return Err(e),
        }
    };
    #[cfg(test)]
    let shares = race.arms.iter().map(|a| (a.source, a.all.spent)).collect();
    let (settled, tried, order) = (race.is_settled(), race.attempts, race.order);
    let mut nodes: Vec<Option<(S::Solution, S::Sequence)>> = race.nodes.into_iter().map(Some).collect();
    let all = order.into_iter().filter_map(|k| nodes[k].take()).collect();
    Ok(Found {
        all,
        settled,
        tried,
        ended,
        #[cfg(test)]
        shares,
    })
}

impl<S: Space> Race<'_, S> {
    /// Its work so far.
    fn spent(&self) -> f64 {
        self.budget.spent() - self.began
    }

    fn rank(&self, node: usize) -> Rank {
        self.space.rank(&self.nodes[node].0)
    }

    fn best(&self) -> Rank {
        self.order.first().map_or(Rank::NOTHING, |k| self.rank(*k))
    }

    /// The best of an arm.
    fn best_of(&self, k: usize) -> Rank {
        self.arms[k].best.as_ref().map_or(Rank::NOTHING, |o| self.rank(o.node))
    }

    fn is_solved(&self) -> bool {
        self.best().feasible
    }

    /// Is the best a solution that all local neighbours were compared with?
    fn is_settled(&self) -> bool {
        let Some(best) = self.order.first().filter(|k| self.rank(**k).feasible) else { return false };
        let open = |n: &Neighbour<S::Sequence>| n.is_local && !self.tried.contains_key(&n.sequence);
        let own = self.arms.iter().filter_map(|a| a.best.as_ref()).find(|o| o.node == *best && o.next.is_some());
        match own.and_then(|o| o.next.as_ref()) {
            Some(next) => !next.left.iter().any(open),
            None => !self.space.neighbours(&self.nodes[*best].0).0.iter().any(open),
        }
    }

    /// Has so much been done since the last gain that there is little hope of another one?
    fn is_in_vain(&self) -> bool {
        let (work, candidates) = self.gained_at;
        (self.candidates - candidates) as f64 >= self.plan.effort * IN_VAIN
            && self.spent() - work >= self.plan.effort * work
            && self.attempts >= self.plan.least_tried
    }

    /// Is there a solution, and more work not worth it?
    fn is_enough(&self) -> bool {
        let best = self.best();
        best.feasible && (self.plan.any && best.idle == 0 || self.is_in_vain() && self.is_settled())
    }

    /// The arm with the next step, its part, and whether that is for local neighbours alone; nothing where no arm has one.
    fn choose(&self) -> Option<(usize, usize, bool)> {
        let is_in_vain = self.is_in_vain();
        if self.is_solved() && is_in_vain {
            // all that is left to do is to compare the best with what is next to it
            let best = self.order.first();
            let owns = |a: &Arm<S>| a.has_neighbour() && a.best.as_ref().map(|o| &o.node) == best;
            if let Some(k) = self.arms.iter().position(owns) {
                return Some((k, 1, true));
            }
        }
        let usual = self.spent() / self.steps.max(1) as f64 + 1.0;
        // where nothing has a solution, neighbours that have been in vain leave the rest to candidates
        let candidates_only = !self.is_solved() && is_in_vain;
        let has_step = |a: &Arm<S>| a.has_candidate() || a.has_neighbour() && !candidates_only;
        let left = self.arms.iter().enumerate().filter(|(_, a)| has_step(a));
        let expected = |a: &Arm<S>| match a.steps {
            0 => self.space.expected(a.source).unwrap_or(usual),
            _ => usual,
        };
        let prospect = |a: &Arm<S>| a.all.prospect(expected(a));
        let (k, arm) = left.min_by(|(i, a), (j, b)| prospect(b).total_cmp(&prospect(a)).then(i.cmp(j)))?;
        Some((k, if candidates_only { 0 } else { arm.next_part() }, false))
    }

    /// Makes the next step; false where there is none.
    fn step(&mut self, control: &mut Control) -> Result<bool> {
        let Some((k, part, only_local)) = self.choose() else { return self.retry(control) };
        let (work, before) = (self.budget.spent(), self.best());
        let own = self.best_of(k);
        let ended = match part {
            0 => self.ask(k, control),
            _ => self.try_neighbour(k, only_local, control),
        };
        self.steps += 1;
        let work = self.budget.spent() - work + *ended.as_ref().unwrap_or(&0.0);
        let gained = self.best().gains(&before, self.plan.gain);
        let own_gained = self.best_of(k).gains(&own, self.plan.gain);
        let arm = &mut self.arms[k];
        arm.steps += 1;
        arm.all.spent += work;
        arm.parts[part].spent += work;
        arm.all.gains += usize::from(gained);
        arm.parts[part].gains += usize::from(own_gained);
        if !arm.has_neighbour() {
            // at the end of a descent
            (arm.all.gains, arm.parts[0].gains, arm.parts[1].gains) = (0, 0, 0);
        }
        if gained {
            self.gained_at = (self.spent(), self.candidates);
        }
        ended.map(|_| true)
    }

    /// The next candidate of a source; what others have done of its work.
    fn ask(&mut self, k: usize, control: &mut Control) -> Result<f64> {
        let source = self.arms[k].source;
        if self.arms[k].queue.is_empty() {
            let best = self.order.first().map(|b| &self.nodes[*b].0);
            let found = self.space.propose(source, best, self.budget, control)?;
            self.arms[k].ended = found.is_empty();
            self.arms[k].queue = found.into();
        }
        match self.arms[k].queue.pop_front() {
            Some(candidate) => self.attempt(k, candidate, (source, 1), control),
            None => Ok(0.0),
        }
    }

    /// The most promising neighbour of the best that a source has found, of all or of local ones that were not tried; what others have done of its work.
    fn try_neighbour(&mut self, k: usize, only_local: bool, control: &mut Control) -> Result<f64> {
        let (space, nodes, tried) = (&*self.space, &self.nodes, &self.tried);
        let Arm { best: Some(own), kinds, .. } = &mut self.arms[k] else { return Ok(0.0) };
        let rank = space.rank(&nodes[own.node].0);
        let next = own.next.get_or_insert_with(|| {
            let (left, motion) = space.neighbours(&nodes[own.node].0);
            Next { left, motion }
        });
        let rate = |n: &Neighbour<S::Sequence>| {
            let [better, tried] = kinds.get(&n.kind).copied().unwrap_or_default();
            (better + 1) as f64 / (tried + 2) as f64
        };
        // what multipliers promise comes first, then what has helped most often; among equals the order of the space
        let price = |n: &Neighbour<S::Sequence>| n.promise.min(0.0);
        let order = |a: &Neighbour<S::Sequence>, b: &Neighbour<S::Sequence>| {
            price(a).total_cmp(&price(b)).then(rate(b).total_cmp(&rate(a)))
        };
        let counts = |n: &Neighbour<S::Sequence>| !only_local || n.is_local && !tried.contains_key(&n.sequence);
        let left = next.left.iter().enumerate().filter(|(_, n)| counts(n));
        let first = left.min_by(|(i, a), (j, b)| order(a, b).then(i.cmp(j))).map(|f| f.0);
        let Some(first) = first else { return Ok(0.0) };
        let Neighbour { sequence, kind, .. } = next.left.remove(first);
        let motion = space.moved(&nodes[own.node].0, &next.motion, &sequence);
        let candidate = Candidate::new(sequence.clone(), motion);
        let saved = self.attempt(k, candidate, (Source::Neighbours, 1), control)?;
        if let Some(node) = self.tried.get(&sequence).and_then(|t| t.node) {
            let better = self.rank(node).is_better(&rank);
            let count = self.arms[k].kinds.entry(kind).or_default();
            count[1] += 1;
            count[0] += usize::from(better);
        }
        Ok(saved)
    }

    /// Where nothing has a solution: what came closest of every source, the closest first, with more patience. False where none is left.
    fn retry(&mut self, control: &mut Control) -> Result<bool> {
        let first = self.failed.iter().filter(|_| !self.is_solved()).min_by(|a, b| a.0.total_cmp(&b.0)).cloned();
        let Some((_, k, candidate)) = first else { return Ok(false) };
        self.failed.retain(|f| f.1 != k);
        self.attempt(k, candidate, (Source::Retries, PATIENT), control)?;
        if self.is_solved() {
            self.gained_at = (self.spent(), self.candidates);
        }
        Ok(true)
    }

    /// Solves for a candidate of an arm. A sequence without a solution is tried again from the motion of another source, which may be nearer to one; next
    /// to solutions every sequence is tried once. What is known already is the arm's as well; the work that others have done for it.
    fn attempt(
        &mut self,
        k: usize,
        candidate: Candidate<S::Sequence, S::Motion>,
        (source, patience): (Source, usize),
        control: &mut Control,
    ) -> Result<f64> {
        if candidate.promise == f64::INFINITY {
            return Ok(0.0);
        }
        self.candidates += usize::from(source != Source::Neighbours);
        let best = self.best();
        let cost = if best.feasible && !best.contradicted { best.cost } else { f64::INFINITY };
        if cost.is_finite() && candidate.promise >= cost - self.plan.gain * cost.abs() {
            return Ok(0.0);
        }
        let known = self.tried.entry(candidate.sequence.clone()).or_default();
        let is_solved = known.node.is_some_and(|n| self.space.rank(&self.nodes[n].0).feasible);
        let again = !known.from.is_empty() && source == Source::Neighbours;
        if again || is_solved || known.from.contains(&source) {
            // once: an arm does not pay for what it has paid for
            let (node, work) = (known.node, if known.arms.contains(&k) { 0.0 } else { known.work });
            known.arms.push(k);
            node.into_iter().for_each(|node| self.own(k, node));
            return Ok(work);
        }
        known.from.push(source);
        known.arms.push(k);
        let before = self.budget.spent();
        let ended = self.space.solve(&candidate, Limits { cost, patience }, self.budget, control)?;
        self.attempts += ended.len();
        self.tried.entry(candidate.sequence.clone()).or_default().work += self.budget.spent() - before;
        let mut reached = None;
        for (sequence, mut solution) in ended {
            let best = self.best();
            let mut rank = self.space.rank(&solution);
            if rank.feasible && rank.is_better(&best) {
                self.space.verify(&mut solution, self.budget, control)?;
                rank = self.space.rank(&solution);
            }
            if !rank.feasible && source != Source::Retries && !best.feasible {
                self.failed.push((rank.violation, k, Candidate { sequence: sequence.clone(), ..candidate.clone() }));
            }
            let node = self.keep(solution, sequence, rank);
            self.own(k, node);
            if reached.is_none_or(|r| self.rank(node).is_better(&self.rank(r))) {
                reached = Some(node);
            }
        }
        // a program may lead to another sequence, which stands for it from then on
        let known = self.tried.entry(candidate.sequence.clone()).or_default();
        known.node = known.node.or(reached);
        Ok(0.0)
    }

    /// Keeps what was found in the order of ranks, of one sequence what is better; its number.
    fn keep(&mut self, solution: S::Solution, sequence: S::Sequence, rank: Rank) -> usize {
        let before = self.tried.get(&sequence).and_then(|t| t.node);
        if let Some(node) = before.filter(|n| !rank.is_better(&self.rank(*n))) {
            return node;
        }
        let node = match before {
            Some(node) => {
                self.nodes[node].0 = solution;
                self.order.retain(|k| *k != node);
                // it has other neighbours
                let own = self.arms.iter_mut().filter_map(|a| a.best.as_mut());
                own.filter(|o| o.node == node).for_each(|o| o.next = None);
                node
            }
            None => {
                self.nodes.push((solution, sequence.clone()));
                self.nodes.len() - 1
            }
        };
        self.tried.entry(sequence).or_default().node = Some(node);
        let at = self.order.partition_point(|k| !rank.is_better(&self.rank(*k)));
        self.order.insert(at, node);
        node
    }

    /// An arm has found a solution, which may be its best.
    fn own(&mut self, k: usize, node: usize) {
        let better = |o: &Own<S>| self.rank(node).is_better(&self.rank(o.node));
        if self.arms[k].best.as_ref().is_none_or(better) {
            self.arms[k].best = Some(Own { node, next: None });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nlp::Statistics;
    use crate::random::SplitMix64;

    /// Words of letters with random costs of letters and of pairs that follow each other; a third of all words has no solution. Programs take ten
    /// units of work. Samples are drawn at random, simulations propose words that are cheap letter by letter.
    struct Words {
        letters: usize,
        single: Vec<f64>,
        double: Vec<f64>,
        n: usize,
        numbers: SplitMix64,
        asked: BTreeMap<Source, usize>,
    }

    type Word = Vec<usize>;

    impl Words {
        fn new(seed: u64) -> Words {
            let mut numbers = SplitMix64::new(seed);
            let (n, letters) = (6, 3);
            let single = (0..n * letters).map(|_| numbers.share()).collect();
            let double = (0..n * letters * letters).map(|_| 2.0 * numbers.share()).collect();
            Words { letters, single, double, n, numbers, asked: BTreeMap::new() }
        }

        fn cost(&self, w: &Word) -> f64 {
            let single = |k: usize| self.single[k * self.letters + w[k]];
            let double = |k: usize| self.double[(k * self.letters + w[k - 1]) * self.letters + w[k]];
            (0..self.n).map(|k| single(k) + if k > 0 { double(k) } else { 0.0 }).sum()
        }

        fn has_solution(&self, w: &Word) -> bool {
            let number = w.iter().fold(7, |m: usize, l| m.wrapping_mul(31).wrapping_add(*l));
            SplitMix64::new(number as u64).share() < 0.67
        }
    }

    impl Space for Words {
        type Sequence = Word;
        type Motion = ();
        type Solution = (Word, f64, bool);

        fn propose(
            &mut self,
            source: Source,
            _: Option<&Self::Solution>,
            budget: &mut Budget,
            _: &mut Control,
        ) -> Result<Vec<Candidate<Word, ()>>> {
            let asked = self.asked.entry(source).or_default();
            *asked += 1;
            let asked = *asked;
            let of = |sequence: Word| Candidate::new(sequence, ());
            Ok(match source {
                Source::Guess if asked == 1 => vec![of(vec![0; self.n])],
                Source::Samples if asked <= 40 => {
                    budget.simulated(1, 4);
                    let mut one =
                        || (0..self.n).map(|_| (self.numbers.share() * self.letters as f64) as usize).collect();
                    vec![of(one()), of(one())]
                }
                Source::Simulation if asked <= 3 => {
                    budget.simulated(1, 60);
                    let least = |k: usize| {
                        let cost = |l: &usize| self.single[k * self.letters + (l + asked - 1) % self.letters];
                        (0..self.letters).min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap()
                    };
                    vec![of((0..self.n).map(least).collect())]
                }
                _ => Vec::new(),
            })
        }

        fn solve(
            &mut self,
            c: &Candidate<Word, ()>,
            _: Limits,
            budget: &mut Budget,
            _: &mut Control,
        ) -> Result<Vec<(Word, Self::Solution)>> {
            budget.solved(10, &Statistics { iterations: 1, ..Statistics::default() });
            Ok(vec![(c.sequence.clone(), (c.sequence.clone(), self.cost(&c.sequence), self.has_solution(&c.sequence)))])
        }

        fn rank(&self, s: &Self::Solution) -> Rank {
            let violation = if s.2 { 0.0 } else { s.1 };
            Rank { feasible: s.2, contradicted: false, cost: s.1, violation, idle: 0, rounding: 0.0 }
        }

        fn neighbours(&self, s: &Self::Solution) -> (Vec<Neighbour<Word>>, ()) {
            let other = |k: usize, d: usize| {
                let mut w = s.0.clone();
                w[k] = (w[k] + d) % self.letters;
                Neighbour { sequence: w, promise: 0.0, kind: k, is_local: true }
            };
            ((0..self.n).flat_map(|k| (1..self.letters).map(move |d| (k, d))).map(|(k, d)| other(k, d)).collect(), ())
        }
    }

    const ALL: [Source; 3] = [Source::Guess, Source::Simulation, Source::Samples];

    fn plan(sources: &[Source]) -> Plan {
        Plan { sources: sources.to_vec(), effort: 1.0, gain: 1e-3, least_tried: 0, any: false }
    }

    fn run(seed: u64, plan: &Plan, most: f64) -> (f64, f64, Found<(Word, f64, bool), Word>) {
        let mut budget = Budget::new(most);
        let found = explore(&mut Words::new(seed), plan, Vec::new(), &mut budget, &mut Control::default()).unwrap();
        let best = found.all.first().filter(|b| b.0 .2).map_or(f64::INFINITY, |b| b.0 .1);
        (best, budget.spent(), found)
    }

    #[test]
    fn more_work_is_never_worse() {
        for seed in 0..200 {
            let mut last = f64::INFINITY;
            for most in [15.0, 40.0, 100.0, 250.0, 700.0, 2000.0, f64::INFINITY] {
                let (cost, ..) = run(seed, &plan(&ALL), most);
                assert!(cost <= last, "{seed}: {cost} after {last}");
                last = cost;
            }
        }
    }

    #[test]
    fn all_sources_together_are_no_worse_than_one_alone_with_its_share() {
        for seed in 0..200 {
            let (cost, _, found) = run(seed, &plan(&ALL), f64::INFINITY);
            for (source, share) in found.shares {
                let (alone, ..) = run(seed, &plan(&[source]), share);
                assert!(cost <= alone, "{seed} {source:?}: {cost} {alone} in {share}");
            }
        }
    }

    #[test]
    fn what_ends_is_the_best_next_to_which_nothing_is_better() {
        let (mut enough, mut tried, mut work) = (0, 0, 0.0);
        for seed in 0..100 {
            let (cost, spent, found) = run(seed, &plan(&ALL), f64::INFINITY);
            let words = Words::new(seed);
            let mut all: Vec<Word> = vec![Vec::new()];
            for _ in 0..words.n {
                all = all.into_iter().flat_map(|w| (0..3).map(move |l| [&w[..], &[l]].concat())).collect();
            }
            let least =
                all.iter().filter(|w| words.has_solution(w)).map(|w| words.cost(w)).fold(f64::INFINITY, f64::min);
            assert!(found.settled || found.ended == Ended::Enough);
            tried += found.tried;
            work += spent;
            assert!(cost >= least);
            enough += usize::from(cost == least);
            // sorted, and every word once
            assert!(found.all.windows(2).all(|w| !words.rank(&w[1].0).is_better(&words.rank(&w[0].0))));
        }
        // of 729 words each
        assert!(enough >= 50 && tried < 10_000, "{enough} of 100 are the best of all, {tried} words tried with {work}");
    }

    #[test]
    fn any_solution_does_where_there_is_no_cost() {
        let (.., found) = run(3, &Plan { any: true, ..plan(&ALL) }, f64::INFINITY);
        assert_eq!((found.ended, found.all.iter().filter(|s| s.0 .2).count()), (Ended::Enough, 1));
        let (.., found) = run(3, &plan(&ALL), 25.0);
        assert_eq!((found.ended, found.tried), (Ended::Limit, 2));
        let (.., found) = run(3, &plan(&[Source::Retries]), f64::INFINITY);
        assert_eq!((found.ended, found.tried), (Ended::Exhausted, 0));
    }
}
