//! Sequences of choices: a value of every choice in every control stage.

use crate::error::{Error, Result};
use crate::ocp::{Durations, Ocp};

/// The places of values in their lists, `[n_stages · n_choices]`.
pub(crate) type Sequence = Vec<u16>;

/// A change of a sequence in some entries.
pub(crate) struct Change {
    pub sequence: Sequence,
    /// Entries that are others now.
    pub entries: Vec<usize>,
    /// Is it one value, held for as long as it has to be, where another one was?
    pub is_single: bool,
}

/// A control that chooses, with the values within its bounds.
struct Level {
    control: usize,
    values: Vec<f64>,
    dwell: f64,
}

/// A value that was chosen before the first stage.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PastChoice {
    /// Its place in the list.
    pub at: u16,
    /// For how long it has been held.
    pub time: f64,
}

/// What may be chosen.
pub(crate) struct Levels {
    all: Vec<Level>,
    /// What every choice was before the first stage; nothing where that does not matter.
    before: Vec<Option<PastChoice>>,
    durations: Vec<f64>,
    nu: usize,
}

/// Share of a dwell time by which a value may be held shorter: lengths of stages that add up to it do so up to rounding.
const ROUNDING: f64 = 1e-9;

impl Levels {
    /// Those of a problem.
    ///
    /// # Errors
    /// [`Error::Range`] where no value of a choice is within the bounds of its control; [`Error::Unsupported`] for choices that are linear
    /// within a stage, and for dwell times where the lengths of the stages are free.
    pub fn new(ocp: &Ocp) -> Result<Levels> {
        let all = ocp.system.choices().iter().map(|c| {
            let (lower, upper) = (ocp.u_bounds[0][c.control], ocp.u_bounds[1][c.control]);
            let values: Vec<f64> = c.values.iter().copied().filter(|v| lower <= *v && *v <= upper).collect();
            if values.is_empty() {
                return Err(Error::Range(format!(
                    "control {} has no value to choose between its bounds {lower} and {upper}",
                    c.control
                )));
            }
            if ocp.linear[c.control] {
                return Err(Error::Unsupported(format!(
                    "control {} chooses among values, and cannot be linear within a stage",
                    c.control
                )));
            }
            if c.dwell > 0.0 && ocp.time != Durations::Fixed {
                return Err(Error::Unsupported(format!(
                    "control {} has a dwell time, which needs stages of fixed lengths",
                    c.control
                )));
            }
            Ok(Level { control: c.control, values, dwell: c.dwell })
        });
        let all = all.collect::<Result<Vec<Level>>>()?;
        let before = vec![None; all.len()];
        Ok(Levels { all, before, durations: ocp.durations.clone(), nu: ocp.system.dims().u })
    }

    /// Number of choices in a stage.
    pub fn n(&self) -> usize {
        self.all.len()
    }

    pub fn n_stages(&self) -> usize {
        self.durations.len()
    }

    /// A choice has had a value before the first stage.
    pub fn set_before(&mut self, choice: usize, held: Option<PastChoice>) {
        self.before[choice] = held;
    }

    /// What a choice was before the first stage.
    pub fn before(&self, choice: usize) -> Option<PastChoice> {
        self.before[choice]
    }

    /// The control of a choice.
    pub fn control(&self, choice: usize) -> usize {
        self.all[choice].control
    }

    /// The values of a choice, ascending.
    pub fn values(&self, choice: usize) -> &[f64] {
        &self.all[choice].values
    }

    /// The place of an entry among controls `[n_stages · nu]`.
    pub fn place(&self, entry: usize) -> usize {
        entry / self.n() * self.nu + self.all[entry % self.n()].control
    }

    /// The value of an entry at a place of its list.
    pub fn value(&self, entry: usize, at: u16) -> f64 {
        self.values(entry % self.n())[usize::from(at)]
    }

    /// Writes the values of a sequence into controls `[n_stages · nu]`.
    pub fn write(&self, sequence: &[u16], controls: &mut [f64]) {
        for (e, at) in sequence.iter().enumerate() {
            controls[self.place(e)] = self.value(e, *at);
        }
    }

    /// Bounds of all controls where every choice is between two values.
    pub fn bounds(&self, ocp: &Ocp, low: &[u16], high: &[u16]) -> [Vec<f64>; 2] {
        let mut bounds = [0, 1].map(|side| ocp.u_bounds[side].repeat(self.n_stages()));
        self.write(low, &mut bounds[0]);
        self.write(high, &mut bounds[1]);
        bounds
    }

    /// The least and the largest value everywhere.
    pub fn widest(&self) -> [Sequence; 2] {
        let largest: Sequence = self.all.iter().map(|l| (l.values.len() - 1) as u16).collect();
        [vec![0; self.n() * self.n_stages()], largest.repeat(self.n_stages())]
    }

    /// Sequences in which every choice keeps one value: the first one of each, the second one, and so on.
    pub fn constant(&self) -> Vec<Sequence> {
        let most = self.all.iter().map(|l| l.values.len()).max().unwrap_or(0);
        let of = |k: usize| self.all.iter().map(move |l| k.min(l.values.len() - 1) as u16);
        (0..most).map(|k| of(k).collect::<Sequence>().repeat(self.n_stages())).collect()
    }

    /// The runs of a choice: the stages in which each begins, with its value.
    fn runs(&self, sequence: &[u16], choice: usize) -> Vec<(usize, u16)> {
        let mut out: Vec<(usize, u16)> = Vec::new();
        for k in 0..self.n_stages() {
            let at = sequence[k * self.n() + choice];
            if out.last().is_none_or(|r| r.1 != at) {
                out.push((k, at));
            }
        }
        out
    }

    /// Is a run of the value at place `at` in these stages as long as the dwell time of its choice, or one that need not be? What was chosen before
    /// the first stage counts, where it is known.
    fn is_long(&self, choice: usize, stages: std::ops::Range<usize>, at: u16) -> bool {
        let dwell = self.all[choice].dwell * (1.0 - ROUNDING);
        let (is_last, mut time) = (stages.end == self.n_stages(), self.durations[stages.clone()].iter().sum::<f64>());
        if stages.start == 0 {
            match self.before[choice] {
                None => return true,
                Some(held) if held.at == at => time += held.time,
                Some(held) if held.time < dwell => return false,
                Some(_) => {}
            }
        }
        is_last || time >= dwell
    }

    /// The first choice and the stages of a run that is too short.
    pub fn short_run(&self, sequence: &[u16]) -> Option<(usize, std::ops::Range<usize>)> {
        (0..self.n()).filter(|&c| self.all[c].dwell > 0.0).find_map(|c| {
            let runs = self.runs(sequence, c);
            let ends = runs.iter().skip(1).map(|r| r.0).chain([self.n_stages()]);
            let mut stages = runs.iter().zip(ends).map(|(a, b)| (a.0..b, a.1));
            stages.find(|(s, at)| !self.is_long(c, s.clone(), *at)).map(|(s, _)| (c, s))
        })
    }

    /// Are all values held for as long as they have to be?
    pub fn is_held(&self, sequence: &[u16]) -> bool {
        self.short_run(sequence).is_none()
    }

    /// May a sequence whose first stages are given go on in this way: does no run that has ended fall short?
    pub fn may_follow(&self, before: &[u16], next: &[u16]) -> bool {
        let k = before.len() / self.n();
        (0..self.n()).filter(|&c| self.all[c].dwell > 0.0).all(|c| {
            if k == 0 {
                // a run that goes on is long enough until it ends
                return self.is_long(c, 0..self.n_stages(), next[c]);
            }
            let at = |k: usize| before[k * self.n() + c];
            if at(k - 1) == next[c] {
                return true;
            }
            let start = (0..k).rev().take_while(|&i| at(i) == at(k - 1)).last().unwrap_or(k - 1);
            self.is_long(c, start..k, at(k - 1))
        })
    }

    /// The sequence that is nearest to controls `[n_stages · nu]`: the integral of the squared difference is least, by dynamic programming over the
    /// runs.
    pub fn nearest(&self, controls: &[f64]) -> Sequence {
        let n = self.n_stages();
        let mut out = vec![0; n * self.n()];
        for (c, level) in self.all.iter().enumerate() {
            let v = level.values.len();
            // sums of the squared differences up to every stage
            let mut sums = vec![vec![0.0; v]; n + 1];
            for k in 0..n {
                let u = controls[k * self.nu + level.control];
                for (at, value) in level.values.iter().enumerate() {
                    let d = if u.is_finite() { u - value } else { 0.0 };
                    sums[k + 1][at] = sums[k][at] + self.durations[k] * d * d;
                }
            }
            if level.dwell == 0.0 {
                let least = |k: usize| {
                    (0..v).min_by(|a, b| (sums[k + 1][*a] - sums[k][*a]).total_cmp(&(sums[k + 1][*b] - sums[k][*b])))
                };
                (0..n).for_each(|k| out[k * self.n() + c] = least(k).unwrap_or(0) as u16);
                continue;
            }
            // the least of everything up to a stage at which a run of a value ends, with the start of the run and the value before it
            let mut best = vec![vec![(f64::INFINITY, 0, 0); v]; n + 1];
            for end in 1..=n {
                for start in 0..end {
                    for at in (0..v).filter(|at| self.is_long(c, start..end, *at as u16)) {
                        let others = (0..v).filter(|o| *o != at).map(|o| (best[start][o].0, o));
                        let (before, from) = match start {
                            0 => (0.0, at),
                            _ => others.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, at)),
                        };
                        let all = before + sums[end][at] - sums[start][at];
                        if all < best[end][at].0 {
                            best[end][at] = (all, start, from);
                        }
                    }
                }
            }
            let (mut end, mut at) = (n, (0..v).min_by(|a, b| best[n][*a].0.total_cmp(&best[n][*b].0)).unwrap_or(0));
            while end > 0 {
                let (_, start, from) = best[end][at];
                (start..end).for_each(|k| out[k * self.n() + c] = at as u16);
                (end, at) = (start, from);
            }
        }
        out
    }

    /// Sum-up rounding (S. Sager, 2009): the value of every stage is the one whose integral stays nearest to that of the controls, as long as the
    /// value before it was held.
    pub fn rounded(&self, controls: &[f64]) -> Sequence {
        let mut out: Sequence = Vec::with_capacity(self.n_stages() * self.n());
        let mut owed = vec![0.0; self.n()];
        for k in 0..self.n_stages() {
            let h = self.durations[k];
            let mut row: Vec<u16> = Vec::with_capacity(self.n());
            for (c, level) in self.all.iter().enumerate() {
                owed[c] += h * controls[k * self.nu + level.control];
                let near = |at: &u16| (owed[c] - h * level.values[usize::from(*at)]).abs();
                let wanted = (0..level.values.len() as u16).min_by(|a, b| near(a).total_cmp(&near(b)));
                row.push(wanted.unwrap_or(0));
            }
            for c in 0..self.n() {
                let mut alone = if k == 0 { row.clone() } else { out[(k - 1) * self.n()..].to_vec() };
                alone[c] = row[c];
                if !self.may_follow(&out, &alone) {
                    row[c] = out[(k - 1) * self.n() + c];
                }
                owed[c] -= h * self.all[c].values[usize::from(row[c])];
            }
            out.extend(row);
        }
        out
    }

    /// The sequences next to one. A value takes the place of another one for the shortest time that dwell times allow; or two stages that follow each
    /// other exchange their values.
    pub fn next_to(&self, sequence: &[u16]) -> Vec<Change> {
        let (n, m) = (self.n_stages(), self.n());
        let mut out: Vec<Change> = Vec::new();
        let mut push = |changed: Sequence, is_single: bool| {
            if self.is_held(&changed) && out.iter().all(|o| o.sequence != changed) {
                let entries = (0..changed.len()).filter(|&e| changed[e] != sequence[e]).collect();
                out.push(Change { sequence: changed, entries, is_single });
                return true;
            }
            false
        };
        for k in 0..n {
            for (c, level) in self.all.iter().enumerate() {
                for at in (0..level.values.len() as u16).filter(|at| *at != sequence[k * m + c]) {
                    // to the right, and to the left, until every run is long enough
                    for right in [true, false] {
                        let stages: Vec<usize> = if right { (k..n).collect() } else { (0..=k).rev().collect() };
                        let mut changed = sequence.to_vec();
                        for i in stages {
                            changed[i * m + c] = at;
                            if self.is_held(&changed) {
                                push(changed, true);
                                break;
                            }
                        }
                    }
                }
                if k + 1 < n && sequence[k * m + c] != sequence[(k + 1) * m + c] {
                    let mut changed = sequence.to_vec();
                    changed.swap(k * m + c, (k + 1) * m + c);
                    push(changed, false);
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    fn levels(n: usize, values: &[f64], dwell: f64) -> Levels {
        let all = vec![Level { control: 0, values: values.to_vec(), dwell }];
        Levels { all, before: vec![None], durations: vec![0.5; n], nu: 1 }
    }

    /// All sequences of one choice.
    fn all(n: usize, v: u16) -> Vec<Sequence> {
        (0..n).fold(vec![Vec::new()], |all, _| {
            all.iter().flat_map(|s| (0..v).map(move |at| [&s[..], &[at]].concat())).collect()
        })
    }

    #[test]
    fn values_are_held_but_at_both_ends() {
        let l = levels(6, &[0.0, 1.0], 1.0);
        assert!(l.is_held(&[1, 0, 0, 1, 1, 0]));
        assert_eq!(l.short_run(&[1, 0, 1, 1, 1, 1]), Some((0, 1..2)));
        assert!(!l.may_follow(&[0, 1], &[0]) && l.may_follow(&[0, 1], &[1]) && l.may_follow(&[1], &[0]));
    }

    /// What was chosen before the first stage is held for as long as it has to be, and a new value is.
    #[test]
    fn what_was_chosen_before_counts() {
        let mut l = levels(4, &[0.0, 1.0], 1.0);
        let held = |l: &Levels| all(4, 2).into_iter().filter(|s| l.is_held(s)).collect::<Vec<_>>();
        l.set_before(0, Some(PastChoice { at: 1, time: 0.5 }));
        assert_eq!(held(&l), [[1, 0, 0, 0], [1, 0, 0, 1], [1, 1, 0, 0], [1, 1, 1, 0], [1, 1, 1, 1]]);
        l.set_before(0, Some(PastChoice { at: 1, time: 1.0 }));
        assert_eq!(held(&l).iter().filter(|s| s[0] == 0).count(), 3);
        assert!(held(&l).iter().all(|s| s[0] == 1 || s[1] == 0));
        for time in [0.5, 1.0] {
            l.set_before(0, Some(PastChoice { at: 1, time }));
            let mut begun = vec![Vec::new()];
            for _ in 0..4 {
                let on = |s: &Sequence, at: u16| l.may_follow(s, &[at]).then(|| [&s[..], &[at]].concat());
                begun = begun.iter().flat_map(|s| [on(s, 0), on(s, 1)].into_iter().flatten()).collect();
            }
            assert_eq!(begun.into_iter().filter(|s| l.is_held(s)).collect::<Vec<_>>(), held(&l));
            let near = l.nearest(&[0.0; 4]);
            assert_eq!(near, if time < 1.0 { [1, 0, 0, 0] } else { [0; 4] });
        }
    }

    #[test]
    fn the_nearest_sequence_is_that_of_enumeration() {
        let mut numbers = SplitMix64::new(4);
        for dwell in [0.0, 1.0, 1.5] {
            let l = levels(6, &[0.0, 1.0, 3.0], dwell);
            for _ in 0..20 {
                let u: Vec<f64> = (0..6).map(|_| 4.0 * numbers.share() - 0.5).collect();
                let off = |s: &Sequence| {
                    s.iter().zip(&u).map(|(at, u)| (u - l.values(0)[usize::from(*at)]).powi(2)).sum::<f64>()
                };
                let least =
                    all(6, 3).into_iter().filter(|s| l.is_held(s)).map(|s| off(&s)).fold(f64::INFINITY, f64::min);
                let found = l.nearest(&u);
                assert!(l.is_held(&found) && (off(&found) - least).abs() < 1e-12, "{found:?} {} {least}", off(&found));
            }
        }
    }

    #[test]
    fn sum_up_rounding_keeps_integrals() {
        let mut numbers = SplitMix64::new(9);
        let l = levels(40, &[0.0, 1.0], 0.0);
        let u: Vec<f64> = (0..40).map(|_| numbers.share()).collect();
        let mut off = 0.0f64;
        for (at, u) in l.rounded(&u).iter().zip(&u) {
            off += 0.5 * (u - f64::from(*at));
            // half a stage for two values (Sager, 2009)
            assert!(off.abs() <= 0.25 + 1e-12);
        }
        let held = levels(40, &[0.0, 1.0], 1.5);
        assert!(held.is_held(&held.rounded(&u)));
    }

    #[test]
    fn neighbours_hold_their_values_and_reach_every_sequence() {
        for dwell in [0.0, 1.0] {
            let l = levels(5, &[0.0, 1.0], dwell);
            let mut seen = vec![vec![0; 5]];
            let mut i = 0;
            while i < seen.len() {
                for c in l.next_to(&seen[i].clone()) {
                    assert!(l.is_held(&c.sequence) && !c.entries.is_empty());
                    if c.is_single && !seen.contains(&c.sequence) {
                        seen.push(c.sequence);
                    }
                }
                i += 1;
            }
            assert_eq!(seen.len(), all(5, 2).iter().filter(|s| l.is_held(s)).count());
        }
    }
}
