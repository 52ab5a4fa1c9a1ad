//! The one order of what a search finds.

use std::cmp::Ordering;

/// Bits of a cost that do not count: two costs within a share of `2^(22 - 52)`, 1e-9, are the same but for borders between such shares. Solvers
/// return costs to about their tolerance, 1e-9 by default.
const ROUNDING: u32 = 22;

/// What a solution is ordered by: first whether it is feasible and a simulation of its controls is its motion, then the cost, then how simple
/// it is. What is not feasible is ordered by its violation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rank {
    /// Does it meet all constraints?
    pub feasible: bool,
    /// Does a simulation of its controls contradict it?
    pub contradicted: bool,
    /// Cost, as a simulation says it where that can be compared.
    pub cost: f64,
    /// Largest violation of a constraint.
    pub violation: f64,
    /// Phases without length, and what else is not needed.
    pub idle: usize,
    /// Rounding of the cost: that of the largest on the way to it. Costs of motions that end at zero are differences of that.
    pub rounding: f64,
}

impl Rank {
    /// What is worse than everything that was found.
    pub const NOTHING: Rank = Rank {
        feasible: false,
        contradicted: false,
        cost: f64::INFINITY,
        violation: f64::INFINITY,
        idle: 0,
        rounding: 0.0,
    };

    fn class(&self) -> u8 {
        match (self.feasible, self.contradicted) {
            (true, false) => 0,
            (true, true) => 1,
            _ => 2,
        }
    }

    /// Compares two: [`Ordering::Less`] is better. It is a total order as long as all that are compared have one `rounding`.
    pub fn order(&self, other: &Rank) -> Ordering {
        let by = |r: &Rank, value: f64| significant(value, r.rounding);
        let rounding = self.rounding.max(other.rounding);
        let (a, b) = (Rank { rounding, ..*self }, Rank { rounding, ..*other });
        let class = a.class().cmp(&b.class());
        let rest = match a.class() {
            2 => ordered(a.violation).cmp(&ordered(b.violation)),
            _ => by(&a, a.cost).cmp(&by(&b, b.cost)).then(a.idle.cmp(&b.idle)),
        };
        class.then(rest)
    }

    /// Is it better than another one?
    pub fn is_better(&self, other: &Rank) -> bool {
        self.order(other) == Ordering::Less
    }

    /// Is it better by more than a share of the cost? A first feasible point always is, and a violation that is less than half.
    pub fn gains(&self, other: &Rank, share: f64) -> bool {
        match (self.class(), other.class()) {
            (a, b) if a != b => a < b,
            (2, _) => self.violation < 0.5 * other.violation,
            _ => self.cost < other.cost - (share * other.cost.abs()).max(self.rounding.max(other.rounding)),
        }
    }
}

/// The bits of a number as an integer of the same order; what is no number is last.
fn ordered(v: f64) -> i64 {
    if v.is_nan() {
        return i64::MAX;
    }
    let bits = (v + 0.0).to_bits() as i64;
    if bits < 0 {
        i64::MIN.wrapping_sub(bits)
    } else {
        bits
    }
}

/// The order of numbers that are the same up to their rounding.
fn significant(v: f64, rounding: f64) -> i64 {
    let v = if rounding > 0.0 && v.is_finite() { (v / rounding).round() * rounding } else { v };
    ordered(v) >> ROUNDING
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    fn rank(cost: f64) -> Rank {
        Rank { feasible: true, contradicted: false, cost, violation: 0.0, idle: 0, rounding: 0.0 }
    }

    #[test]
    fn the_order_is_total() {
        let mut numbers = SplitMix64::new(5);
        let mut one = || {
            let mut of = |values: &[f64]| values[(numbers.share() * values.len() as f64) as usize];
            let cost = of(&[1.0, 1.0 + 9e-10, 1.0 + 1.8e-9, -3.0, 0.0, f64::NAN, f64::INFINITY, 1e-20]);
            let violation = of(&[3e-5, 2e-5, 1e-5, f64::NAN]);
            let (feasible, contradicted) = (of(&[0.0, 1.0]) > 0.0, of(&[0.0, 1.0]) > 0.0);
            Rank { feasible, contradicted, cost, violation, idle: of(&[0.0, 1.0]) as usize, rounding: 1e-15 }
        };
        let all: Vec<Rank> = (0..60).map(|_| one()).collect();
        for a in &all {
            assert_eq!(a.order(a), Ordering::Equal);
            for b in &all {
                assert_eq!(a.order(b), b.order(a).reverse());
                for c in &all {
                    if a.order(b) != Ordering::Greater && b.order(c) != Ordering::Greater {
                        assert_ne!(a.order(c), Ordering::Greater, "{a:?} {b:?} {c:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn solutions_come_first_then_the_cheaper_then_the_simpler() {
        let open = Rank { feasible: false, violation: 1e-8, cost: -1.0, ..rank(0.0) };
        let astray = Rank { contradicted: true, ..rank(1.0) };
        let idle = Rank { idle: 1, ..rank(2.0) };
        let sorted = [rank(2.0 - 1e-6), rank(2.0), idle, rank(3.0), astray, open, Rank { violation: 1.0, ..open }];
        for (i, a) in sorted.iter().enumerate() {
            for (j, b) in sorted.iter().enumerate() {
                assert_eq!(a.order(b), i.cmp(&j), "{i} {j}");
            }
        }
        assert!(rank(1.0).gains(&rank(1.1), 0.05) && !rank(1.0).gains(&rank(1.01), 0.05));
        assert!(rank(1.0).gains(&open, 0.05) && !open.gains(&rank(1.0), 0.05));
    }

    #[test]
    fn costs_at_zero_have_the_rounding_of_those_on_the_way() {
        let is_lower =
            |a: f64, b: f64, rounding: f64| Rank { rounding, ..rank(a) }.is_better(&Rank { rounding, ..rank(b) });
        // 1e-17 is none the worse than 1e-20 where costs of 3 were seen, and is where none above 1e-12 was
        let of_three = 3.0 * f64::EPSILON;
        assert!(!is_lower(1e-20, 1e-17, of_three) && !is_lower(-1e-17, 1e-17, of_three));
        let of_little = 1e-12 * f64::EPSILON;
        assert!(is_lower(1e-20, 1e-17, of_little) && !is_lower(1e-17, 1e-20, of_little));
        assert!(is_lower(1.0 - 1e-8, 1.0, of_three) && !is_lower(1.0 + 1e-11, 1.0, of_three));
        assert!(is_lower(-1.0 - 1e-8, -1.0, of_three) && !is_lower(f64::NAN, 1.0, of_three));
    }
}
