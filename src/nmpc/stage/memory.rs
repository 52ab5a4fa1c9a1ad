//! Stages that were simulated before: where nothing moves all stages of a plan are one, plans are one with their alternatives up to where these
//! depart, and a plan that is not changed is simulated at every sample.

/// Results by the bits of what they are results of. A new one takes the place of an older one; nothing is allocated after it was made.
#[derive(Debug, Default)]
pub(super) struct Memory {
    width: usize,
    keys: Vec<u64>,
    results: Vec<f64>,
    known: Vec<bool>,
    n_out: usize,
    /// How often something was found.
    #[cfg(test)]
    pub found: u64,
}

/// Every key may stand in one of so many places, which follow each other.
const WAYS: usize = 4;

impl Memory {
    /// For at least `n` results of `n_out` numbers each, of keys of `width` numbers; for none where `n` is zero.
    pub fn new(n: usize, width: usize, n_out: usize) -> Memory {
        let n = if n == 0 { 0 } else { n.next_power_of_two().max(WAYS) };
        Memory {
            width,
            keys: vec![0; n * width],
            results: vec![0.0; n * n_out],
            known: vec![false; n],
            n_out,
            #[cfg(test)]
            found: 0,
        }
    }

    /// Does it keep anything?
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    fn places(&self, key: &[u64]) -> std::ops::Range<usize> {
        // multiplications bring low bits up, and the sum is turned round for those that come next
        let mix = |h: u64, k: &u64| (h ^ k).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
        let hash = key.iter().fold(key.len() as u64, mix);
        let sets = self.known.len() / WAYS;
        let first = WAYS * ((hash >> 20) as usize & (sets - 1));
        first..first + WAYS
    }

    fn key(&self, place: usize) -> &[u64] {
        &self.keys[place * self.width..(place + 1) * self.width]
    }

    /// The result of a key, if it is known.
    pub fn find(&mut self, key: &[u64]) -> Option<&[f64]> {
        if self.is_empty() {
            return None;
        }
        let place = self.places(key).find(|p| self.known[*p] && self.key(*p) == key)?;
        #[cfg(test)]
        {
            self.found += 1;
        }
        Some(&self.results[place * self.n_out..(place + 1) * self.n_out])
    }

    /// Room for the result of a key that is not known, which is from here on. The last places of a key are those that were taken longest ago.
    pub fn keep(&mut self, key: &[u64]) -> Option<&mut [f64]> {
        if self.is_empty() {
            return None;
        }
        let (places, n) = (self.places(key), self.n_out);
        let first = places.start;
        self.keys.copy_within(first * self.width..(places.end - 1) * self.width, (first + 1) * self.width);
        self.results.copy_within(first * n..(places.end - 1) * n, (first + 1) * n);
        self.known.copy_within(first..places.end - 1, first + 1);
        self.keys[first * self.width..(first + 1) * self.width].copy_from_slice(key);
        self.known[first] = true;
        Some(&mut self.results[first * n..(first + 1) * n])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_found_is_what_was_kept() {
        let mut m = Memory::new(64, 2, 1);
        let key = |k: u64| [k, (k as f64).to_bits()];
        for k in 0..1000 {
            assert!(m.find(&key(k)).is_none());
            m.keep(&key(k)).unwrap()[0] = k as f64;
            assert_eq!(m.find(&key(k)), Some(&[k as f64][..]));
        }
        let known: Vec<u64> = (0..1000).filter(|k| m.find(&key(*k)).is_some_and(|r| r == [*k as f64])).collect();
        assert_eq!(known.len(), 64);
        // most of those that came last are there
        assert!(known.iter().filter(|k| **k >= 936).count() > 32, "{known:?}");
    }

    #[test]
    fn a_memory_for_nothing_keeps_nothing() {
        let mut m = Memory::new(0, 1, 1);
        assert!(m.keep(&[1]).is_none() && m.find(&[1]).is_none());
    }
}
