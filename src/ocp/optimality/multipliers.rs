//! Which multipliers prove an answer. At a point, what an answer has to meet is linear in the multipliers of its constraints and in the
//! multiples of the gradients of its kinks: slopes that its bounds do not hold back vanish, and the derivatives towards both sides of a kink are
//! not negative. Where the gradients of the constraints that act depend on each other, as those of a constraint given twice, many
//! multipliers belong to one point, and which of them a program ends with depends on its path. The point is optimal to first order if any of them
//! meet the conditions: a linear program finds those that miss them by least.

use super::slopes::{Free, Quantities};
use super::{Corner, Kind, Sides};
use crate::mpcc::simplex::{Found, Simplex};
use crate::stop;

/// Entries of tableaus that the search for multipliers may go over: a second's work. Programs of the size that control problems have
/// take a thousandth of it.
const WORK: f64 = 1e9;

/// A quantity that is linear in the multipliers and should not be negative.
#[derive(Debug, Clone)]
pub(super) struct Condition {
    value: f64,
    slopes: Vec<f64>,
}

impl Condition {
    pub(super) fn at(&self, c: &[f64]) -> f64 {
        self.value + self.slopes.iter().zip(c).map(|(s, c)| s * c).sum::<f64>()
    }

    fn times(&self, factor: f64) -> Condition {
        Condition { value: factor * self.value, slopes: self.slopes.iter().map(|s| factor * s).collect() }
    }
}

/// What an answer has to meet, relative to what single quantities change the cost by.
pub(super) struct Conditions {
    /// The changes of the cost by single quantities within their bounds.
    slopes: Vec<Condition>,
    /// The derivatives towards the sides of every kink, as those of [`super::Kink`], where they are known.
    pub(super) sides: Vec<[Option<Condition>; 2]>,
}

impl Quantities {
    pub(super) fn conditions(&self, kinks: &[Corner], sides: &[Sides], scale: f64) -> Conditions {
        let mut slopes = Vec::new();
        for f in self.all().filter(|f| f.size > 0.0) {
            let own = Condition { value: f.slopes[0], slopes: f.slopes[1..f.slopes.len() - 1].to_vec() };
            // towards larger values, then towards smaller ones
            for (sign, held) in [(1.0, f.held[1]), (-1.0, f.held[0])] {
                if !held {
                    slopes.push(own.times(sign * f.size / scale));
                }
            }
        }
        let of = |(i, (b, side)): (usize, (&Corner, &Sides))| {
            let reach = self.all().map(|f: &Free| f.size * f.slopes[1 + i].abs()).sum::<f64>() / scale;
            let known = |s: &Option<Vec<f64>>| {
                s.as_ref().map(|s| Condition { value: s[0], slopes: s[1..s.len() - 1].to_vec() })
            };
            let [high, low] = [known(&side[0]), known(&side[1])];
            let own = high.iter().chain(&low).map(|s| s.slopes.len()).max().unwrap_or(0).max(1 + i);
            // the multiple of the gradient itself
            let mut c = Condition { value: 0.0, slopes: vec![0.0; own] };
            c.slopes[i] = 1.0;
            let towards = |s: Option<Condition>, sign: f64| {
                s.map(|mut s| {
                    s.slopes[i] -= 1.0;
                    s.times(sign * reach)
                })
            };
            match b.kind {
                Kind::Touch { .. } => [Some(c.times(reach)), low.map(|s| s.times(self.lasting[b.stage] / scale))],
                Kind::Peak { .. } | Kind::Control { .. } | Kind::Jump { .. } => {
                    [Some(c.times(reach)), towards(high, 1.0)]
                }
                Kind::Switch { .. } => [towards(high, 1.0), towards(low, -1.0)],
            }
        };
        Conditions { slopes, sides: kinks.iter().zip(sides).enumerate().map(of).collect() }
    }
}

impl Conditions {
    fn all(&self) -> impl Iterator<Item = &Condition> {
        self.slopes.iter().chain(self.sides.iter().flatten().flatten())
    }

    /// By how much multipliers miss the conditions.
    pub(super) fn worst(&self, c: &[f64]) -> f64 {
        self.all().fold(0.0, |worst: f64, condition| worst.max(-condition.at(c)))
    }

    /// The multipliers within `range` that miss the conditions by least; none where they are not found.
    pub(super) fn best(&self, range: &[[f64; 2]]) -> Option<Vec<f64>> {
        let n = range.len();
        let all: Vec<&Condition> = self.all().collect();
        // the last variable is what the conditions are missed by
        let mut rows = vec![0.0; all.len() * (n + 1)];
        for (row, condition) in rows.chunks_exact_mut(n + 1).zip(&all) {
            row[..condition.slopes.len()].copy_from_slice(&condition.slopes);
            row[n] = 1.0;
        }
        let finite = rows.iter().chain(all.iter().map(|c| &c.value)).all(|v| v.is_finite());
        let open = (0..n).any(|j| range[j][0] < range[j][1]);
        if !finite || !open {
            return finite.then(|| vec![0.0; n]);
        }
        let mut program = Simplex::new(n + 1, all.len(), rows);
        program.allowed = WORK;
        range.iter().enumerate().for_each(|(j, [low, high])| program.bound(j, *low, *high));
        program.bound(n, 0.0, f64::INFINITY);
        all.iter().enumerate().for_each(|(i, c)| program.bound(n + 1 + i, -c.value, f64::INFINITY));
        let mut cost = vec![0.0; n + 1];
        cost[n] = 1.0;
        let goes_on = || stop::requested().is_none();
        let found = program.feasible(&goes_on) == Found::Point && program.minimise(&cost, &goes_on) == Found::Point;
        found.then(|| program.point().take(n).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    /// Slopes `g + A y` that should vanish.
    fn conditions(g: &[f64], columns: &[Vec<f64>]) -> Conditions {
        let own = |i: usize| Condition { value: g[i], slopes: columns.iter().map(|a| a[i]).collect() };
        let both = |i: usize| [own(i), own(i).times(-1.0)];
        Conditions { slopes: (0..g.len()).flat_map(both).collect(), sides: Vec::new() }
    }

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    /// Constraints given several times in units of their own: slopes that are made of multipliers are proved, and where a direction lowers the
    /// cost and violates nothing the conditions are missed by its rate at least.
    #[test]
    fn multipliers_prove_what_is_stationary_and_nothing_else() {
        let mut numbers = SplitMix64::new(11);
        for case in 0..200 {
            let (n, kinds) = (2 + case % 7, 1 + case % 5);
            let mut draw = |n: usize| (0..n).map(|_| 2.0 * numbers.share() - 1.0).collect::<Vec<f64>>();
            let d = draw(n);
            let (mut columns, mut range, mut g) = (Vec::new(), Vec::new(), vec![0.0; n]);
            for k in 0..kinds {
                let (mut a, weight) = (draw(n), draw(4));
                let free = k % 3 == 0;
                if free {
                    let share = dot(&a, &d) / dot(&d, &d);
                    a.iter_mut().zip(&d).for_each(|(a, d)| *a -= share * d);
                } else if dot(&a, &d) > 0.0 {
                    a.iter_mut().for_each(|a| *a = -*a);
                }
                // as many copies, in units apart by orders of magnitude
                for w in &weight[..1 + case % 3] {
                    let unit = 10f64.powf(4.0 * w);
                    columns.push(a.iter().map(|a| a * unit).collect::<Vec<f64>>());
                    range.push([if free { f64::NEG_INFINITY } else { 0.0 }, f64::INFINITY]);
                }
                let y = if free { weight[3] } else { weight[3].abs() };
                g.iter_mut().zip(&a).for_each(|(g, a)| *g -= y * a);
            }
            let proved = conditions(&g, &columns);
            let best = proved.best(&range).unwrap();
            assert!(proved.worst(&best) < 1e-8, "case {case}: {}", proved.worst(&best));
            assert!(best.iter().zip(&range).all(|(c, [low, high])| c >= low && c <= high));
            let rate = 1e-3;
            let along: f64 = d.iter().map(|d| d.abs()).sum();
            let more = -rate * along - dot(&g, &d);
            let share = more / dot(&d, &d);
            g.iter_mut().zip(&d).for_each(|(g, d)| *g += share * d);
            let open = conditions(&g, &columns);
            let best = open.best(&range).unwrap();
            assert!(open.worst(&best) > rate * (1.0 - 1e-6), "case {case}: {}", open.worst(&best));
        }
    }
}
