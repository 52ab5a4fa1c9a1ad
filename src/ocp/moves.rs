//! Sequences of phases stage by stage, and those next to one: a switch that lies between two control stages goes into the
//! one before or behind, or one stage on, and short phases are left out.
//!
//! The mode program moves switches within their stages and finds the best places for them there. A switch between two
//! stages is held by both: the controls before and behind differ, so the cost has a kink there, and whether it is lower on
//! either side only the sequences on the other side of the kink can say.

use std::ops::Range;

use super::{ModeSequence, Ocp, OcpResult};
use crate::dcs::{Across, Form};

/// Share of the shorter neighbour that a new phase begins with.
const SHARE: f64 = 0.2;
/// Share of a stage below which a phase at its start or end is a remnant: phases cannot become shorter than their least length.
const SLIVER: f64 = 1e-3;
/// Share of a stage below which a phase is no phase.
pub(super) const NOTHING: f64 = 1e-6;
/// How many times as far as the last one a step along a direction goes, and the share of a phase that it leaves at least.
const LONGER: f64 = 2.0;
const LEFT: f64 = 0.5;
/// Steps of switches below this share of a stage are left to the mode program, which moves switches within their stages.
const STEP: f64 = 0.5;

/// Phases of every stage: active cells and length.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Sequence {
    pub stages: Vec<Vec<(Vec<bool>, f64)>>,
}

impl Sequence {
    /// The sequence of a solution.
    pub fn of(r: &OcpResult) -> Sequence {
        let mut stages: Vec<Vec<(Vec<bool>, f64)>> = vec![Vec::new(); r.durations.len()];
        for e in r.trajectory.elements.iter().filter(|e| e.h > NOTHING * r.durations[e.stage]) {
            match stages[e.stage].last_mut() {
                Some((cells, length)) if *cells == e.active_cells => *length += e.h,
                _ => stages[e.stage].push((e.active_cells.clone(), e.h)),
            }
        }
        Sequence { stages }
    }

    /// What it is apart from lengths.
    pub fn sets(&self) -> Vec<Vec<Vec<bool>>> {
        self.stages.iter().map(|s| s.iter().map(|p| p.0.clone()).collect()).collect()
    }

    /// Does one of the subsystems, whose regions are `simplices`, begin on a surface?
    pub fn begins_sliding(&self, simplices: &[Range<usize>]) -> bool {
        let first = self.stages.first().and_then(|s| s.first());
        first.is_some_and(|(set, _)| simplices.iter().any(|c| set[c.clone()].iter().filter(|a| **a).count() > 1))
    }

    /// As times and modes, on stages of these lengths. The phases of a stage have their shares of it: their sum differs from it by what a solver leaves.
    pub fn modes(&self, form: &Form, durations: &[f64]) -> ModeSequence {
        let (mut s, mut begin) = (ModeSequence::default(), 0.0);
        for (stage, duration) in self.stages.iter().zip(durations) {
            let (mut t, sum) = (begin, stage.iter().map(|p| p.1).sum::<f64>());
            let scale = if sum > 0.0 { duration / sum } else { 0.0 };
            for (cells, length) in stage {
                s.times.push(t);
                let modes = form.reported.iter().flatten();
                s.modes.extend(modes.map(|w| w.iter().any(|&w| form.is_active(w, cells))));
                s.cells.extend(cells);
                t += scale * length;
            }
            begin += duration;
        }
        s
    }

    /// Phases over all stages: active cells, and when they begin.
    fn phases(&self) -> Vec<(&[bool], f64)> {
        let (mut out, mut t) = (Vec::<(&[bool], f64)>::new(), 0.0);
        for (set, length) in self.stages.iter().flatten() {
            if out.last().is_none_or(|p| p.0 != set) {
                out.push((set, t));
            }
            t += length;
        }
        out
    }

    /// From a sequence `before` with the same phases to this one, which is better, and twice as far again: moves from stage to stage
    /// then take a number of programs that grows with the logarithm of the number of stages. None where phases differ, or would
    /// vanish, or where no switch leaves its stage.
    pub fn beyond(&self, before: &Sequence) -> Option<Sequence> {
        let (from, now) = (before.phases(), self.phases());
        if from.len() != now.len() || from.iter().zip(&now).any(|(a, b)| a.0 != b.0) {
            return None;
        }
        let stage: Vec<f64> = self.stages.iter().map(|s| s.iter().map(|p| p.1).sum()).collect();
        let end: f64 = stage.iter().sum();
        let moved: Vec<f64> = from.iter().zip(&now).map(|(a, b)| b.1 - a.1).chain([0.0]).collect();
        let times: Vec<f64> = now.iter().map(|p| p.1).chain([end]).collect();
        let mut factor = LONGER;
        for (t, d) in times.windows(2).zip(moved.windows(2)) {
            let (length, shrinks) = (t[1] - t[0], d[0] - d[1]);
            if shrinks * factor > (1.0 - LEFT) * length {
                factor = (1.0 - LEFT) * length / shrinks;
            }
        }
        let usual = end / stage.len() as f64;
        if moved.iter().all(|d| (factor * d).abs() < STEP * usual) {
            return None;
        }
        let times: Vec<f64> = times.iter().zip(&moved).map(|(t, d)| t + factor * d).collect();
        let mut out = Sequence { stages: Vec::with_capacity(stage.len()) };
        let (mut t, mut first) = (0.0, 0);
        for length in stage {
            let (sliver, next) = (SLIVER * length, t + length);
            while first + 1 < now.len() && times[first + 1] <= t + sliver {
                first += 1;
            }
            let inside = (first..now.len()).take_while(|&k| k == first || times[k] < next - sliver);
            let starts: Vec<(usize, f64)> = inside.map(|k| (k, if k == first { t } else { times[k] })).collect();
            let ends = starts.iter().skip(1).map(|s| s.1).chain([next]);
            out.stages.push(starts.iter().zip(ends).map(|(s, e)| (now[s.0].0.to_vec(), e - s.1)).collect());
            t = next;
        }
        Some(out)
    }

    /// Sequences next to this one, the likeliest first; cells of one of `simplices` change at a time. Those that go on as the
    /// indicators do not (`across`) never change inside of a stage.
    pub fn neighbours(&self, simplices: &[Range<usize>], across: &[Across]) -> Vec<Sequence> {
        let inside: Vec<Range<usize>> =
            simplices.iter().zip(across).filter(|s| *s.1 != Across::Nothing).map(|s| s.0.clone()).collect();
        let mut out: Vec<Sequence> = Vec::new();
        let mut add = |s: Sequence| {
            if s.sets() != self.sets() && !out.contains(&s) {
                out.push(s);
            }
        };
        for k in 1..self.stages.len() {
            for cells in &inside {
                let (Some(a), Some(b)) = (self.stages[k - 1].last(), self.stages[k].first()) else { continue };
                if a.0[cells.clone()] == b.0[cells.clone()] {
                    continue;
                }
                let with = |of: &[bool], from: &[bool]| {
                    let mut set = of.to_vec();
                    set[cells.clone()].copy_from_slice(&from[cells.clone()]);
                    set
                };
                let length = SHARE * a.1.min(b.1);
                let mut before = self.clone();
                before.split_last(k - 1, length, with(&a.0, &b.0));
                add(before);
                let mut after = self.clone();
                after.split_first(k, length, with(&b.0, &a.0));
                add(after);
            }
        }
        for k in 1..self.stages.len() {
            for cells in simplices {
                let (Some(a), Some(b)) = (self.stages[k - 1].last(), self.stages[k].first()) else { continue };
                if a.0[cells.clone()] == b.0[cells.clone()] {
                    continue;
                }
                // one stage on, where the stage has one set
                for (stage, from) in [(k - 1, &b.0), (k, &a.0)] {
                    let one = |p: &(Vec<bool>, f64)| p.0[cells.clone()] == self.stages[stage][0].0[cells.clone()];
                    if self.stages[stage].iter().all(one) {
                        let mut s = self.clone();
                        for p in &mut s.stages[stage] {
                            p.0[cells.clone()].copy_from_slice(&from[cells.clone()]);
                        }
                        add(s);
                    }
                }
            }
        }
        for cells in &inside {
            self.without_short(cells, &mut add);
        }
        self.without_slivers(&mut add);
        for (cells, _) in simplices.iter().zip(across).filter(|s| *s.1 == Across::Nothing) {
            self.other_choices(cells, &mut add);
        }
        out
    }

    /// With another choice in one stage, where controls alone choose: on another side of a surface that no motion leads across, so that
    /// it need not be next to where the choice changes.
    fn other_choices(&self, cells: &Range<usize>, add: &mut dyn FnMut(Sequence)) {
        for (k, stage) in self.stages.iter().enumerate() {
            for c in cells.clone().filter(|&c| stage.iter().any(|p| !p.0[c])) {
                let mut s = self.clone();
                for p in &mut s.stages[k] {
                    p.0[cells.clone()].fill(false);
                    p.0[c] = true;
                }
                add(s);
            }
        }
    }

    /// Without the first or the last phase of a stage where that is a sliver: the switch would rather be between the stages.
    fn without_slivers(&self, add: &mut dyn FnMut(Sequence)) {
        for (k, stage) in self.stages.iter().enumerate().filter(|(_, s)| s.len() > 1) {
            let sliver = SLIVER * stage.iter().map(|p| p.1).sum::<f64>();
            for (at, to) in [(0, 1), (stage.len() - 1, stage.len() - 2)] {
                if stage[at].1 < sliver {
                    let mut s = self.clone();
                    s.stages[k][to].1 += stage[at].1;
                    s.stages[k].remove(at);
                    add(s);
                }
            }
        }
    }

    fn split_last(&mut self, stage: usize, length: f64, set: Vec<bool>) {
        if let Some(last) = self.stages[stage].last_mut() {
            last.1 -= length;
        }
        self.stages[stage].push((set, length));
    }

    fn split_first(&mut self, stage: usize, length: f64, set: Vec<bool>) {
        if let Some(first) = self.stages[stage].first_mut() {
            first.1 -= length;
        }
        self.stages[stage].insert(0, (set, length));
    }

    /// Without one of the phases of `cells` that are shorter than a stage: what is around it takes its place.
    fn without_short(&self, cells: &Range<usize>, add: &mut dyn FnMut(Sequence)) {
        let all: Vec<(usize, usize)> =
            self.stages.iter().enumerate().flat_map(|(k, s)| (0..s.len()).map(move |j| (k, j))).collect();
        let set = |at: (usize, usize)| &self.stages[at.0][at.1].0[cells.clone()];
        let mut runs: Vec<Range<usize>> = Vec::new();
        for (i, &at) in all.iter().enumerate() {
            match runs.last_mut() {
                Some(r) if set(all[r.start]) == set(at) => r.end = i + 1,
                _ => runs.push(i..i + 1),
            }
        }
        let stage: f64 = self.stages.iter().flatten().map(|p| p.1).sum::<f64>() / self.stages.len() as f64;
        for (i, r) in runs.iter().enumerate() {
            let length: f64 = all[r.clone()].iter().map(|&(k, j)| self.stages[k][j].1).sum();
            let around = [i.checked_sub(1), (i + 1 < runs.len()).then_some(i + 1)];
            for other in around.into_iter().flatten().filter(|_| length < stage) {
                let new = set(all[runs[other].start]).to_vec();
                let mut s = self.clone();
                for &(k, j) in &all[r.clone()] {
                    s.stages[k][j].0[cells.clone()].copy_from_slice(&new);
                }
                for stage in &mut s.stages {
                    stage.dedup_by(|b, a| {
                        let same = a.0 == b.0;
                        a.1 += if same { b.1 } else { 0.0 };
                        same
                    });
                }
                add(s);
            }
        }
    }
}

impl Ocp {
    /// A copy of the problem whose guess is the answer `r` with the sequence `s`, and whose grid has room for it.
    pub(super) fn with_sequence(
        &self,
        r: &OcpResult,
        s: &Sequence,
        form: &Form,
        n_fe: &[usize],
    ) -> crate::error::Result<Box<Ocp>> {
        let mut work = Box::new(self.blank());
        work.carry_over(r)?;
        let rooms: Vec<usize> = n_fe.iter().zip(&s.stages).map(|(n, s)| (*n).max(s.len())).collect();
        work.set_elements(&rooms)?;
        work.modes = Some(s.modes(form, &work.durations));
        Ok(work)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `+` the first of two cells, `-` the second, `0` both; a word for every stage, all phases of the length 1.
    fn sequence(words: &[&str]) -> Sequence {
        let set = |c| vec![c != '-', c != '+'];
        Sequence { stages: words.iter().map(|w| w.chars().map(|c| (set(c), 1.0)).collect()).collect() }
    }

    /// One simplex of two cells.
    fn one() -> Vec<Range<usize>> {
        std::iter::once(0..2).collect()
    }

    fn words(s: &Sequence) -> Vec<String> {
        let of = |c: &Vec<bool>| match c[..] {
            [true, false] => '+',
            [false, true] => '-',
            _ => '0',
        };
        s.stages.iter().map(|s| s.iter().map(|p| of(&p.0)).collect()).collect()
    }

    #[test]
    fn a_switch_between_stages_goes_into_either_or_a_stage_on() {
        let s = sequence(&["+", "+", "-", "-"]);
        let found: Vec<Vec<String>> = s.neighbours(&one(), &[Across::Tied]).iter().map(words).collect();
        assert_eq!(found, [["+", "+-", "-", "-"], ["+", "+", "+-", "-"], ["+", "-", "-", "-"], ["+", "+", "+", "-"]]);
        let total: f64 = s.neighbours(&one(), &[Across::Tied])[0].stages[1].iter().map(|p| p.1).sum();
        assert!((total - 1.0).abs() < 1e-15);
        let chosen: Vec<Vec<String>> = s.neighbours(&one(), &[Across::Nothing]).iter().map(words).collect();
        // where the choice changes first, then every other stage
        let [first, last] = [["-", "+", "-", "-"], ["+", "+", "-", "+"]];
        assert_eq!(chosen, [["+", "-", "-", "-"], ["+", "+", "+", "-"], first, last]);
        assert!(
            sequence(&["+", "+-", "-"]).neighbours(&one(), &[Across::Tied]).is_empty(),
            "no switch is between stages"
        );
    }

    #[test]
    fn steps_that_were_better_are_followed_by_longer_ones() {
        let at = |k: usize| -> Sequence {
            let all: Vec<&str> = (0..20).map(|i| if i < k { "+" } else { "0" }).collect();
            sequence(&all)
        };
        assert_eq!(words(&at(9).beyond(&at(8)).unwrap()), words(&at(11)));
        assert_eq!(words(&at(7).beyond(&at(8)).unwrap()), words(&at(5)));
        // a phase keeps half of its length
        assert_eq!(words(&at(4).beyond(&at(12)).unwrap()), words(&at(2)));
        assert!(at(1).beyond(&at(2)).is_some_and(|s| words(&s)[0] == "+0"));
        // switches inside of stages stay inside
        let inside = |first: f64| {
            let mut s = sequence(&["+", "+", "+", "+", "+", "+0", "0", "0", "0", "0"]);
            (s.stages[5][0].1, s.stages[5][1].1) = (first, 1.0 - first);
            s
        };
        assert!(inside(0.5).beyond(&inside(0.4)).is_none(), "the program moves it by itself");
        assert!(at(9).beyond(&at(9)).is_none());
        let next = inside(0.75).beyond(&sequence(&["+", "+", "+", "+", "+", "0", "0", "0", "0", "0"])).unwrap();
        assert_eq!((words(&next)[7].as_str(), next.stages[7][0].1), ("+0", 0.25));
        assert!((next.stages.iter().flatten().map(|p| p.1).sum::<f64>() - 10.0).abs() < 1e-12);
        let other = sequence(&["+", "-", "0"]);
        assert!(sequence(&["+", "0", "0"]).beyond(&other).is_none());
    }

    #[test]
    fn phases_shorter_than_a_stage_are_left_out() {
        let mut s = sequence(&["0+", "+", "+"]);
        s.stages[0][0].1 = 0.3;
        s.stages[0][1].1 = 0.7;
        let found: Vec<Vec<String>> = s.neighbours(&one(), &[Across::Tied]).iter().map(words).collect();
        assert_eq!(found, [["+", "+", "+"]]);
    }
}
