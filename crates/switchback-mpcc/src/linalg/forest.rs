//! Disjoint sets of numbers as a forest: every number points to another one of its set, the roots to themselves (B. A. Galler, M. J. Fischer,
//! *An improved equivalence algorithm*, Commun. ACM 7, 1964). A forest begins as `0, 1, 2, …`.

/// The number that stands for the set of `i`, the least of it; paths that are walked become shorter.
pub fn root(forest: &mut [usize], mut i: usize) -> usize {
    while forest[i] != i {
        forest[i] = forest[forest[i]];
        i = forest[i];
    }
    i
}

/// Joins the sets of two numbers.
pub fn join(forest: &mut [usize], i: usize, j: usize) {
    let (a, b) = (root(forest, i), root(forest, j));
    forest[a.max(b)] = a.min(b);
}

#[cfg(test)]
mod tests {
    use super::{join, root};

    #[test]
    fn the_least_number_stands_for_its_set() {
        let mut forest: Vec<usize> = (0..7).collect();
        [(6, 5), (5, 4), (2, 6), (1, 3), (3, 1)].iter().for_each(|(i, j)| join(&mut forest, *i, *j));
        let roots: Vec<usize> = (0..7).map(|i| root(&mut forest, i)).collect();
        assert_eq!(roots, [0, 1, 2, 1, 2, 2, 2]);
    }
}
