//! Controls drawn at random: one design for every space, one seed.

use crate::random::SplitMix64;

/// Draws controls that are constant on pieces of the horizon. The pieces are one, two, four and so on, up to one for every stage: what coarse controls lead
/// to is spread further than what controls do that change in every stage, which cancel each other. On a piece a control is at its lower bound,
/// at its upper one, as known, or anywhere between, each with the same probability: optimal controls are at their bounds on much of the horizon.
pub(crate) struct Sampler {
    numbers: SplitMix64,
    drawn: usize,
    rounds: usize,
}

/// Rounds of samples at most: where many random controls lead to no solution, more of them do not either.
const ROUNDS: usize = 4;

impl Sampler {
    /// The same seed gives the same controls.
    pub fn new(seed: u64) -> Sampler {
        Sampler { numbers: SplitMix64::new(seed), drawn: 0, rounds: 0 }
    }

    /// Begins a round of samples; false where there were enough.
    pub fn begin_round(&mut self) -> bool {
        self.rounds += 1;
        self.rounds <= ROUNDS
    }

    /// The next controls of `n` stages within finite ranges, `[n · ranges]`; `known` are controls of as many, or none.
    pub fn draw(&mut self, n: usize, ranges: &[[f64; 2]], known: &[f64]) -> Vec<f64> {
        let levels = n.next_power_of_two().trailing_zeros() as usize + 1;
        let pieces = 1 << (self.drawn % levels);
        self.drawn += 1;
        let drawn = self.numbers.on_pieces(n, pieces, ranges.len());
        let value = |(k, ((which, between), [l, u])): (usize, ((f64, f64), &[f64; 2]))| match (4.0 * which) as usize {
            0 => *l,
            1 => *u,
            2 => known.get(k).map_or(l + between * (u - l), |v| v.max(*l).min(*u)),
            _ => l + between * (u - l),
        };
        drawn.into_iter().zip(ranges.iter().cycle()).enumerate().map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_within_their_ranges_and_coarse_in_turn() {
        let mut s = Sampler::new(3);
        let ranges = [[-1.0, 2.0], [0.0, 0.5]];
        let known = vec![0.25; 12];
        let mut changes = Vec::new();
        for _ in 0..8 {
            let u = s.draw(6, &ranges, &known);
            assert!(u.chunks(2).all(|u| (-1.0..=2.0).contains(&u[0]) && (0.0..=0.5).contains(&u[1])));
            changes.push(u.chunks(2).collect::<Vec<_>>().windows(2).filter(|w| w[0] != w[1]).count());
        }
        // one, two, four and six pieces
        assert!(changes.chunks(4).all(|c| c[0] == 0 && c[1] <= 1 && c[2] <= 3 && c[3] <= 5), "{changes:?}");
        assert!(changes.iter().sum::<usize>() > 8);
    }
}
