//! Random numbers that are the same everywhere: starts drawn from a seed are starts that can be drawn again.

/// SplitMix64: G. L. Steele, D. Lea, C. H. Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014.
#[derive(Debug, Clone)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    pub fn new(seed: u64) -> SplitMix64 {
        SplitMix64(seed)
    }

    /// The next number in [0, 1).
    #[inline]
    pub fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Pairs of numbers for `n` intervals and `width` quantities, `[n · width]`, the same on each of so many pieces of the intervals; 0: as many
    /// pieces as intervals.
    pub fn on_pieces(&mut self, n: usize, pieces: usize, width: usize) -> Vec<(f64, f64)> {
        let pieces = if pieces == 0 { n } else { pieces.min(n) };
        let drawn: Vec<(f64, f64)> = (0..pieces * width).map(|_| (self.share(), self.share())).collect();
        (0..n).flat_map(|i| &drawn[i * pieces / n * width..][..width]).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_share_their_numbers() {
        let (five, two) = (SplitMix64::new(1).on_pieces(5, 2, 3), SplitMix64::new(1).on_pieces(2, 0, 3));
        assert_eq!((&five[..9], &five[9..]), (&[&two[..3]; 3].concat()[..], &[&two[3..]; 2].concat()[..]));
        assert!(SplitMix64::new(1).on_pieces(2, 9, 3) == two && SplitMix64::new(1).on_pieces(4, 1, 0).is_empty());
    }

    #[test]
    fn numbers_are_those_of_the_publication() {
        // the first output of the reference implementation for the seed 0 is 0xe220a8397b1dcdaf
        let share = SplitMix64::new(0).share();
        assert_eq!(share, (0xe220_a839_7b1d_cdafu64 >> 11) as f64 / (1u64 << 53) as f64);
    }
}
