//! Diagnostics of a result: residuals as the solver saw them, the constraints violated most, and warnings about rank and
//! scaling of the gradients.
//!
//! Everything is computed from the point and its first derivatives; nothing is evaluated.

use super::certificate::Local;
use super::solver::MpccSolver;
use crate::linalg::csc::mul_add_transposed;
use crate::nlp::{Residuals, INFINITE};

/// Something that can be violated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Item {
    /// Bounds of a variable.
    Variable(usize),
    /// Bounds of a row.
    Row(usize),
    /// Complementarity of a pair.
    Pair(usize),
}

/// Warnings about a program at a point.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// A row with bounds has no gradient: it cannot be influenced to first order.
    NoGradient(usize),
    /// Gradients of active rows that depend on those before them, once variables at bounds and members of pairs at
    /// zero are fixed: the constraint qualification MPCC-LICQ fails. Of `active` rows.
    Dependent {
        /// The dependent rows, increasing.
        rows: Vec<usize>,
        /// Number of active rows.
        active: usize,
    },
    /// Gradients of rows that differ much in size (largest entries).
    Spread {
        /// Row with the smallest gradient that is not zero, and its size.
        smallest: (usize, f64),
        /// Row with the largest one, and its size.
        largest: (usize, f64),
    },
    /// The largest multiplier of a row is beyond what exact arithmetic would need.
    HugeMultiplier(usize, f64),
}

/// Gradients whose sizes differ by this factor are worth a warning.
const SPREAD: f64 = 1e8;
/// Multipliers above this are.
const HUGE: f64 = 1e8;
/// Distance at which bounds count as active, relative where they are above 1.
const ACTIVE: f64 = 1e-7;
/// What is left of a gradient, relative to it, when it depends on others.
const DEPENDENT: f64 = 1e-10;
/// Work up to which the rank is examined, in operations.
const RANK_WORK: f64 = 1e7;

fn outside(v: f64, lower: f64, upper: f64) -> f64 {
    // the order makes NaN count as a violation without bound
    if v.is_nan() {
        return f64::INFINITY;
    }
    (lower - v).max(v - upper).max(0.0)
}

/// Largest violation and largest product of a distance and its multiplier `y`, positive at the upper bound.
fn product(v: f64, lower: f64, upper: f64, y: f64) -> f64 {
    let (distance, bound) = if y > 0.0 { (upper - v, upper) } else { (v - lower, lower) };
    // a multiplier of a bound that does not exist is wrong by its size
    y.abs() * if bound.abs() >= INFINITE { 1.0 } else { distance.abs() }
}

/// Factors of the objective and of the rows `[m]`, sizes of the variables `[n]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Factors {
    /// Factor of the objective.
    pub objective: f64,
    /// Factors of the rows.
    pub rows: Vec<f64>,
    /// Sizes of the variables.
    pub sizes: Vec<f64>,
}

/// Residuals of a point, and of the same point in the units of the solver.
pub fn residuals(at: &Local, scaling: &Factors) -> (Residuals, Residuals) {
    let b = at.bounds;
    let size = |j: usize| scaling.sizes[j];
    let (mut plain, mut scaled) = (Residuals::default(), Residuals::default());
    for (i, &c) in at.c.iter().enumerate() {
        let v = outside(c, b.cl[i], b.cu[i]);
        plain.primal = plain.primal.max(v);
        scaled.primal = scaled.primal.max(v * scaling.rows[i]);
        if b.cl[i] < b.cu[i] {
            plain.complementarity = plain.complementarity.max(product(c, b.cl[i], b.cu[i], at.y[i]));
        }
    }
    let mut dual: Vec<f64> = at.grad.iter().zip(at.z).map(|(g, z)| g - z).collect();
    mul_add_transposed(at.jac, at.jac_values, at.y, &mut dual, 1.0);
    for (j, d) in dual.iter().enumerate() {
        let d = if d.is_nan() { f64::INFINITY } else { d.abs() };
        plain.dual = plain.dual.max(d);
        scaled.dual = scaled.dual.max(d * scaling.objective * size(j));
    }
    let mut member = vec![false; at.x.len()];
    for &(a, c) in at.pairs {
        (member[a], member[c]) = (true, true);
        let (g, h) = (at.x[a], at.x[c]);
        plain.pair_product = plain.pair_product.max(g * h);
        plain.pair_min = plain.pair_min.max(g.min(h));
        let (g, h) = (g / size(a), h / size(c));
        scaled.pair_product = scaled.pair_product.max(g * h);
        scaled.pair_min = scaled.pair_min.max(g.min(h));
    }
    for (j, &x) in at.x.iter().enumerate() {
        let v = outside(x, b.xl[j], b.xu[j]);
        plain.primal = plain.primal.max(v);
        scaled.primal = scaled.primal.max(v / size(j));
        // multipliers of members have any sign while the member is zero
        let held = if member[j] { at.z[j].abs() * x.abs() } else { f64::INFINITY };
        if b.xl[j] < b.xu[j] {
            plain.complementarity = plain.complementarity.max(product(x, b.xl[j], b.xu[j], -at.z[j]).min(held));
        }
    }
    scaled.complementarity = plain.complementarity * scaling.objective;
    (plain, scaled)
}

/// Violations, the worst first: bounds of rows and variables by how much they are exceeded, pairs by
/// `min(G, H)`.
pub fn worst(at: &Local) -> Vec<(Item, f64)> {
    let b = at.bounds;
    let rows = at.c.iter().enumerate().map(|(i, &c)| (Item::Row(i), outside(c, b.cl[i], b.cu[i])));
    let variables = at.x.iter().enumerate().map(|(j, &x)| (Item::Variable(j), outside(x, b.xl[j], b.xu[j])));
    let pairs = at.pairs.iter().enumerate().map(|(k, &(g, h))| (Item::Pair(k), at.x[g].min(at.x[h])));
    let mut list: Vec<(Item, f64)> = rows.chain(variables).chain(pairs).filter(|v| v.1 > 0.0).collect();
    list.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    list
}

/// Warnings about gradients and multipliers at a point.
pub fn warnings(at: &Local) -> Vec<Warning> {
    let m = at.c.len();
    let mut size = vec![0f64; m];
    for (&i, v) in at.jac.row_idx().iter().zip(at.jac_values) {
        size[i] = size[i].max(v.abs());
    }
    let bounded: Vec<usize> = (0..m).filter(|&i| at.bounds.cl[i] > -INFINITE || at.bounds.cu[i] < INFINITE).collect();
    let mut found: Vec<Warning> =
        bounded.iter().filter(|&&i| size[i] == 0.0).map(|&i| Warning::NoGradient(i)).collect();
    let by_size = |a: &&usize, b: &&usize| size[**a].total_cmp(&size[**b]);
    let nonzero = || bounded.iter().filter(|&&i| size[i] > 0.0);
    if let (Some(&low), Some(&high)) = (nonzero().min_by(by_size), nonzero().max_by(by_size)) {
        if size[high] > SPREAD * size[low] {
            found.push(Warning::Spread { smallest: (low, size[low]), largest: (high, size[high]) });
        }
    }
    if let Some(w) = dependent(at, &bounded, &size) {
        found.push(w);
    }
    let largest = (0..m).max_by(|&a, &b| at.y[a].abs().total_cmp(&at.y[b].abs()).then(b.cmp(&a)));
    if let Some(i) = largest.filter(|&i| at.y[i].abs() > HUGE) {
        found.push(Warning::HugeMultiplier(i, at.y[i]));
    }
    found
}

/// Active rows that depend on others, by elimination; nothing where that would take too long.
fn dependent(at: &Local, bounded: &[usize], size: &[f64]) -> Option<Warning> {
    let b = at.bounds;
    let near = |v: f64, bound: f64| bound.abs() < INFINITE && (v - bound).abs() <= ACTIVE * bound.abs().max(1.0);
    let mut fixed: Vec<bool> =
        (0..at.x.len()).map(|j| near(at.x[j], b.xl[j]) || near(at.x[j], b.xu[j]) || b.xl[j] == b.xu[j]).collect();
    for &(a, c) in at.pairs {
        for j in [a, c] {
            fixed[j] = fixed[j] || at.x[j] <= ACTIVE;
        }
    }
    let active: Vec<usize> =
        bounded.iter().copied().filter(|&i| near(at.c[i], b.cl[i]) || near(at.c[i], b.cu[i])).collect();
    let free: Vec<usize> = (0..at.x.len()).filter(|&j| !fixed[j]).collect();
    let (r, n) = (active.len(), free.len());
    if r == 0 || (r * r) as f64 * n as f64 > RANK_WORK {
        return None;
    }
    let mut place = vec![usize::MAX; at.c.len()];
    active.iter().enumerate().for_each(|(k, &i)| place[i] = k);
    let mut a = vec![0.0; r * n];
    for (column, &j) in free.iter().enumerate() {
        for k in at.jac.range(j) {
            let row = at.jac.row_idx()[k];
            if place[row] != usize::MAX && size[row] > 0.0 {
                a[place[row] * n + column] = at.jac_values[k] / size[row];
            }
        }
    }
    let mut pivots: Vec<(usize, usize)> = Vec::new();
    let mut rows = Vec::new();
    for k in 0..r {
        let (above, below) = a.split_at_mut(k * n);
        let row = &mut below[..n];
        for &(p, column) in &pivots {
            let pivot = &above[p * n..(p + 1) * n];
            let factor = row[column] / pivot[column];
            if factor != 0.0 {
                row.iter_mut().zip(pivot).for_each(|(v, q)| *v -= factor * q);
                row[column] = 0.0;
            }
        }
        match (0..n).max_by(|&i, &j| row[i].abs().total_cmp(&row[j].abs())).filter(|&c| row[c].abs() > DEPENDENT) {
            Some(column) => pivots.push((k, column)),
            // rows without any gradient have a warning of their own
            None if size[active[k]] > 0.0 => rows.push(active[k]),
            None => {}
        }
    }
    (!rows.is_empty()).then_some(Warning::Dependent { rows, active: r })
}

impl Warning {
    /// In words, with `name` of a row.
    pub fn text(&self, name: &dyn Fn(usize) -> String) -> String {
        match self {
            Warning::NoGradient(i) => format!("the gradient of {} is zero: nothing can change it", name(*i)),
            Warning::Dependent { rows, active } => {
                const SHOWN: usize = 5;
                let mut list: Vec<String> = rows.iter().take(SHOWN).map(|&i| name(i)).collect();
                if rows.len() > SHOWN {
                    list.push(format!("{} more", rows.len() - SHOWN));
                }
                format!(
                    "the gradients of {active} active constraints are dependent; those that add nothing: {}",
                    list.join(", ")
                )
            }
            Warning::Spread { smallest, largest } => format!(
                "gradients differ much in size, from {:.1e} ({}) to {:.1e} ({}): scale the constraints",
                smallest.1,
                name(smallest.0),
                largest.1,
                name(largest.0)
            ),
            Warning::HugeMultiplier(i, y) => {
                format!(
                    "the multiplier of {} is {y:.1e}: gradients of active constraints are nearly dependent",
                    name(*i)
                )
            }
        }
    }
}

impl MpccSolver {
    /// Factors in the last solve.
    pub fn scaling(&self) -> Factors {
        let s = &self.st.scaling;
        Factors { objective: s.objective, rows: s.rows.clone(), sizes: s.sizes.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::csc::Pattern;
    use crate::nlp::Bounds;

    struct Data {
        x: Vec<f64>,
        c: Vec<f64>,
        grad: Vec<f64>,
        jac: Pattern,
        values: Vec<f64>,
        bounds: Bounds,
        pairs: Vec<(usize, usize)>,
        y: Vec<f64>,
        z: Vec<f64>,
    }

    impl Data {
        fn factors(&self, objective: f64, rows: &[f64]) -> Factors {
            Factors { objective, rows: rows.to_vec(), sizes: vec![1.0; self.x.len()] }
        }
        fn at(&self) -> Local<'_> {
            Local {
                x: &self.x,
                c: &self.c,
                grad: &self.grad,
                jac: &self.jac,
                jac_values: &self.values,
                bounds: &self.bounds,
                pairs: &self.pairs,
                y: &self.y,
                z: &self.z,
            }
        }
    }

    /// Three variables, rows `x0 + x1 ≤ 1` and `2 x2 = 4`, pair `(x0, x1)`.
    fn data() -> Data {
        let mut bounds = Bounds::free(3, 2);
        bounds.xl[0] = 0.0;
        bounds.xl[1] = 0.0;
        (bounds.cl[1], bounds.cu) = (4.0, vec![1.0, 4.0]);
        let (jac, _) = Pattern::from_triplets(2, 3, &[0, 0, 1], &[0, 1, 2]);
        Data {
            x: vec![0.5, 0.25, 3.0],
            c: vec![0.75, 6.0],
            grad: vec![-1.0, 2.0, 1.0],
            jac,
            values: vec![1.0, 1.0, 2.0],
            bounds,
            pairs: vec![(0, 1)],
            y: vec![1.0, -0.5],
            z: vec![0.0, 4.0, 0.0],
        }
    }

    #[test]
    fn residuals_by_hand() {
        let d = data();
        let (plain, scaled) = residuals(&d.at(), &d.factors(0.5, &[1.0, 0.1]));
        // gradient of the Lagrangian: (−1 + 1, 2 + 1 − 4, 1 − 1)
        assert_eq!((plain.primal, plain.dual, plain.pair_product, plain.pair_min), (2.0, 1.0, 0.125, 0.25));
        // 1 · (1 − 0.75) of the row, 4 · 0.25 of the member
        assert_eq!(plain.complementarity, 1.0);
        assert_eq!((scaled.primal, scaled.dual, scaled.complementarity), (0.2, 0.5, 0.5));
        let free = Data { y: vec![-3.0, 0.0], z: vec![0.0; 3], ..data() };
        assert_eq!(
            residuals(&free.at(), &free.factors(1.0, &[1.0, 1.0])).0.complementarity,
            3.0,
            "there is no lower bound"
        );
        let undefined = Data { c: vec![f64::NAN, 4.0], ..data() };
        assert_eq!(residuals(&undefined.at(), &undefined.factors(1.0, &[1.0, 1.0])).0.primal, f64::INFINITY);
    }

    #[test]
    fn the_worst_come_first() {
        let mut d = data();
        assert_eq!(worst(&d.at()), vec![(Item::Row(1), 2.0), (Item::Pair(0), 0.25)]);
        d.x[1] = -3.0;
        d.c[1] = 4.0;
        assert_eq!(worst(&d.at()), vec![(Item::Variable(1), 3.0)]);
    }

    #[test]
    fn gradients_are_looked_at() {
        let mut d = data();
        assert_eq!(warnings(&d.at()), vec![]);
        d.values[2] = 1e-9;
        d.y[0] = -1e9;
        assert_eq!(
            warnings(&d.at()),
            vec![Warning::Spread { smallest: (1, 1e-9), largest: (0, 1.0) }, Warning::HugeMultiplier(0, -1e9)]
        );
        (d.values[2], d.y[0]) = (0.0, 0.0);
        let found = warnings(&d.at());
        assert_eq!(found, vec![Warning::NoGradient(1)]);
        assert!(found[0].text(&|i| format!("row {i}")).contains("row 1"));
    }

    #[test]
    fn dependent_gradients_are_found_in_the_space_that_is_left() {
        // rows (1, 2, 0), (2, 4, 0), (0, 1, 1), all active at x = (1, 1, 1)
        let mut d = data();
        d.jac = Pattern::dense(3, 3);
        d.values = vec![1.0, 2.0, 0.0, 2.0, 4.0, 1.0, 0.0, 0.0, 1.0];
        d.x = vec![1.0; 3];
        d.c = vec![3.0, 6.0, 2.0];
        d.bounds = Bounds::free(3, 3);
        (d.bounds.cl, d.bounds.cu) = (d.c.clone(), d.c.clone());
        (d.y, d.pairs) = (vec![0.0; 3], vec![]);
        assert_eq!(warnings(&d.at()), vec![Warning::Dependent { rows: vec![1], active: 3 }]);
        // (2, 5, 0) is independent of (1, 2, 0), but not when x1 is held by a bound
        d.values[4] = 5.0;
        assert_eq!(warnings(&d.at()), vec![]);
        d.bounds.xl[1] = 1.0;
        assert_eq!(warnings(&d.at()), vec![Warning::Dependent { rows: vec![1], active: 3 }]);
        // a row that is not active says nothing
        d.bounds.cu[1] = 9.0;
        d.bounds.cl[1] = -9.0;
        assert_eq!(warnings(&d.at()), vec![]);
    }
}
