//! Which of many sign patterns differ in one place only.
//!
//! Every pattern has a number that is a sum over its places, so that the number of a pattern without one place is a subtraction: what
//! differs in one place only is found in a time that grows with the patterns, not with their pairs.

use std::collections::HashMap;

/// A row of signs.
pub(super) type Signs = Vec<i8>;

/// Part of the number of a pattern that sign `s` at place `j` contributes (the finaliser of splitmix64).
fn part(j: usize, s: i8) -> u64 {
    let mut z = (3 * j as u64 + (s + 1) as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// The numbers of some patterns.
pub(super) struct Numbers(Vec<u64>);

impl Numbers {
    pub(super) fn new<'a>(patterns: impl Iterator<Item = &'a Signs>) -> Numbers {
        let number = |p: &Signs| p.iter().enumerate().fold(0u64, |n, (j, s)| n.wrapping_add(part(j, *s)));
        Numbers(patterns.map(number).collect())
    }

    /// Pattern `i` has another sign at place `j` from now on.
    pub(super) fn change(&mut self, i: usize, j: usize, from: i8, to: i8) {
        self.0[i] = self.0[i].wrapping_sub(part(j, from)).wrapping_add(part(j, to));
    }

    /// Groups of patterns that are equal without place `j`, in the order of their first members; numbers of `signs` which `skip` leaves
    /// out have none.
    pub(super) fn equal_without<'a>(
        &self,
        j: usize,
        signs: impl Fn(usize) -> &'a Signs,
        skip: impl Fn(usize) -> bool,
    ) -> Vec<Vec<usize>> {
        let mut place: HashMap<u64, usize> = HashMap::with_capacity(self.0.len());
        let mut out: Vec<Vec<usize>> = Vec::new();
        for i in (0..self.0.len()).filter(|i| !skip(*i)) {
            let p = signs(i);
            let key = self.0[i].wrapping_sub(part(j, p[j]));
            let equal = |q: &Signs| p[..j] == q[..j] && p[j + 1..] == q[j + 1..];
            match place.get(&key) {
                // of two patterns with one number that are not equal, which is no more than possible, one stays alone
                Some(&g) if equal(signs(out[g][0])) => out[g].push(i),
                _ => {
                    place.insert(key, out.len());
                    out.push(vec![i]);
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_that_differ_in_one_place_are_found() {
        let mut rows: Vec<Signs> =
            (0..64u32).map(|b| (0..6).map(|j| if b >> j & 1 == 1 { 1 } else { -1 }).collect()).collect();
        rows.retain(|r| r.iter().map(|s| i32::from(*s)).sum::<i32>() != 4);
        let mut numbers = Numbers::new(rows.iter());
        for round in 0..2 {
            for j in 0..6 {
                let groups = numbers.equal_without(j, |i| &rows[i], |i| i == 3);
                let mut pairs: Vec<(usize, usize)> =
                    groups.iter().filter(|g| g.len() == 2).map(|g| (g[0], g[1])).collect();
                pairs.sort_unstable();
                let apart = |a: usize, b: usize| (0..6).all(|i| i == j || rows[a][i] == rows[b][i]);
                let all: Vec<(usize, usize)> = (0..rows.len())
                    .flat_map(|a| (a + 1..rows.len()).map(move |b| (a, b)))
                    .filter(|&(a, b)| a != 3 && b != 3 && apart(a, b))
                    .collect();
                assert_eq!(pairs, all, "{j} {round}");
            }
            let from = rows[7][2];
            rows[7][2] = 0;
            numbers.change(7, 2, from, 0);
        }
    }
}
