//! Which sign patterns of switching functions occur at all.
//!
//! Each switching function is an affine combination of terms; terms that are not affine are taken as free variables
//! within the bounds interval arithmetic gives them (`x² ≥ 0`). A pattern without a solution of that relaxation has
//! none at all. By Gordan's theorem `B v > 0` has no solution exactly if a convex combination of the rows of `B`
//! vanishes, which a small linear program decides.

use crate::expr::{Binary, Dag, Id, Node, Unary};

/// Rows of the homogeneous system `B (v, 1) > 0`.
#[derive(Debug, Clone)]
pub(super) struct Reach {
    terms: Vec<Id>,
    /// `(coefficients over terms, constant)` of every switching function.
    switches: Vec<Vec<f64>>,
    /// Bounds of terms, in the same form.
    bounds: Vec<Vec<f64>>,
}

impl Reach {
    /// For these switching functions.
    pub(super) fn new(dag: &Dag, psi: &[Id]) -> Reach {
        let forms: Vec<(f64, Vec<(Id, f64)>)> = psi.iter().map(|&p| dag.affine_terms(p)).collect();
        let mut terms: Vec<Id> = forms.iter().flat_map(|f| f.1.iter().map(|t| t.0)).collect();
        terms.sort_unstable();
        terms.dedup();
        let row = |constant: f64, entries: &[(Id, f64)]| {
            let mut row = vec![0.0; terms.len() + 1];
            for (id, c) in entries {
                if let Ok(k) = terms.binary_search(id) {
                    row[k] += c;
                }
            }
            row[terms.len()] = constant;
            row
        };
        let switches = forms.iter().map(|f| row(f.0, &f.1)).collect();
        let mut bounds = Vec::new();
        for &t in &terms {
            let (low, high) = range(dag, t);
            if low.is_finite() {
                bounds.push(row(-low, &[(t, 1.0)]));
            }
            if high.is_finite() {
                bounds.push(row(high, &[(t, -1.0)]));
            }
        }
        // The factor of the constants is positive.
        bounds.push(row(1.0, &[]));
        Reach { terms, switches, bounds }
    }

    /// Can the first switching functions have these signs (`true`: positive) on an open set?
    pub(super) fn possible(&self, signs: &[bool]) -> bool {
        let rows = signs.iter().zip(&self.switches).map(|(&s, row)| {
            let s = if s { 1.0 } else { -1.0 };
            row.iter().map(|v| s * v).collect::<Vec<f64>>()
        });
        let mut all: Vec<Vec<f64>> = rows.chain(self.bounds.iter().cloned()).collect();
        for row in &mut all {
            let size = row.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            row.iter_mut().for_each(|v| *v /= size.max(f64::MIN_POSITIVE));
        }
        !zero_in_hull(&all, self.terms.len() + 1)
    }

    /// All patterns that can occur, in the order of binary numbers with positive first; `None` if there are more
    /// than `limit`.
    pub(super) fn patterns(&self, limit: usize) -> Option<Vec<Vec<bool>>> {
        let mut stack = vec![Vec::new()];
        let mut out = Vec::new();
        while let Some(signs) = stack.pop() {
            if signs.len() == self.switches.len() {
                out.push(signs);
                if out.len() > limit {
                    return None;
                }
                continue;
            }
            for s in [false, true] {
                let mut next = signs.clone();
                next.push(s);
                if self.possible(&next) {
                    stack.push(next);
                }
            }
        }
        Some(out)
    }
}

/// Is zero a convex combination of the rows? Phase one of the simplex method with Bland's rule.
fn zero_in_hull(rows: &[Vec<f64>], n: usize) -> bool {
    const TOL: f64 = 1e-11;
    // Columns: one weight for each row, then artificial variables; equations: n sums that vanish, weights that add to 1.
    let (m, k) = (n + 1, rows.len());
    let mut t = vec![vec![0.0; k + 1]; m];
    for (j, row) in rows.iter().enumerate() {
        for i in 0..n {
            t[i][j] = row[i];
        }
        t[n][j] = 1.0;
    }
    t[n][k] = 1.0;
    let mut basis: Vec<usize> = (k..k + m).collect();
    // Rounding may defeat Bland's rule; a pattern that is not excluded costs a cell.
    for _ in 0..50 * (m + k) {
        // Reduced costs of the sum of the artificial variables still in the basis.
        let cost = |j: usize| (0..m).filter(|&i| basis[i] >= k).map(|i| t[i][j]).sum::<f64>();
        let Some(enter) = (0..k).find(|&j| !basis.contains(&j) && cost(j) > TOL) else {
            return cost(k) < 1e-9;
        };
        let mut leave: Option<(usize, f64)> = None;
        for i in 0..m {
            // Artificial variables at zero must not grow, whatever the sign.
            let d = t[i][enter];
            let ratio = if d > TOL {
                t[i][k] / d
            } else if d < -TOL && basis[i] >= k && t[i][k].abs() <= TOL {
                0.0
            } else {
                continue;
            };
            let better = leave.is_none_or(|(l, r)| ratio < r - TOL || (ratio <= r + TOL && basis[i] < basis[l]));
            if better {
                leave = Some((i, ratio));
            }
        }
        let Some((r, _)) = leave else { return false };
        let pivot = t[r][enter];
        t[r].iter_mut().for_each(|v| *v /= pivot);
        let row = t[r].clone();
        for (i, other) in t.iter_mut().enumerate() {
            if i != r && other[enter] != 0.0 {
                let f = other[enter];
                other.iter_mut().zip(&row).for_each(|(v, p)| *v -= f * p);
            }
        }
        basis[r] = enter;
    }
    false
}

/// Bounds of a value for arbitrary inputs.
pub(super) fn range(dag: &Dag, root: Id) -> (f64, f64) {
    const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
    let ids = dag.reachable(&[root]);
    let mut of: Vec<(f64, f64)> = Vec::with_capacity(ids.len());
    let product = |a: f64, b: f64| if a == 0.0 || b == 0.0 { 0.0 } else { a * b };
    for &id in &ids {
        let at = |a: Id| ids.binary_search(&a).map_or(ALL, |k| of[k]);
        let one_sided = |a: Id, f: fn(f64) -> f64| (f(at(a).0), f(at(a).1));
        let r = match dag.node(id) {
            Node::Const(bits) => (f64::from_bits(bits), f64::from_bits(bits)),
            Node::Unary(op, a) => match op {
                Unary::Neg => (-at(a).1, -at(a).0),
                Unary::Sqrt => (at(a).0.max(0.0).sqrt(), at(a).1.max(0.0).sqrt()),
                Unary::Exp => one_sided(a, f64::exp),
                Unary::Sin | Unary::Cos => (-1.0, 1.0),
                Unary::Atan => one_sided(a, f64::atan),
                Unary::Tanh => one_sided(a, f64::tanh),
                Unary::Sinh => one_sided(a, f64::sinh),
                Unary::Erf => (-1.0, 1.0),
                Unary::Cosh => (1.0, f64::INFINITY),
                Unary::Acos => (0.0, std::f64::consts::PI),
                Unary::Asin => (-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2),
                Unary::Log | Unary::Tan => ALL,
            },
            Node::Binary(op, a, b) => {
                let ((la, ha), (lb, hb)) = (at(a), at(b));
                match op {
                    Binary::Add => (la + lb, ha + hb),
                    Binary::Sub => (la - hb, ha - lb),
                    Binary::Mul => {
                        let all = [product(la, lb), product(la, hb), product(ha, lb), product(ha, hb)];
                        (
                            all.iter().copied().fold(f64::INFINITY, f64::min),
                            all.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                        )
                    }
                    // The sign of a quotient of numbers with signs.
                    Binary::Div if la >= 0.0 && lb >= 0.0 => (0.0, f64::INFINITY),
                    Binary::Pow if la >= 0.0 => (0.0, f64::INFINITY),
                    _ => ALL,
                }
            }
            Node::PowI(a, n) if n % 2 == 0 => {
                let (l, h) = at(a);
                let least = if l > 0.0 {
                    l
                } else if h < 0.0 {
                    -h
                } else {
                    0.0
                };
                if n > 0 {
                    (least.powi(n), l.abs().max(h.abs()).powi(n))
                } else {
                    (0.0, f64::INFINITY)
                }
            }
            Node::PowI(a, n) if n > 0 => (at(a).0.powi(n), at(a).1.powi(n)),
            _ => ALL,
        };
        of.push(if r.0.is_nan() || r.1.is_nan() { ALL } else { r });
    }
    of.last().copied().unwrap_or(ALL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::{Expr, Graph};

    fn patterns(g: &Graph, psi: &[Expr]) -> Vec<String> {
        let ids = g.ids(psi);
        let all = Reach::new(&g.dag(), &ids).patterns(1000).unwrap();
        all.iter().map(|p| p.iter().map(|&s| if s { '+' } else { '-' }).collect()).collect()
    }

    #[test]
    fn patterns_without_a_point_are_left_out() {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        assert_eq!(patterns(&g, &[x, y]), ["++", "+-", "-+", "--"]);
        assert_eq!(patterns(&g, &[x - 1.0, x + 1.0]), ["++", "-+", "--"]);
        assert_eq!(patterns(&g, &[x + y, x - y, x]).len(), 6);
        // Ten parallel thresholds have eleven patterns.
        let ten: Vec<Expr> = (0..10).map(|k| x - f64::from(k)).collect();
        assert_eq!(patterns(&g, &ten).len(), 11);
        // Terms that are not affine count as variables, with their bounds.
        let r = x * x + y * y;
        assert_eq!(patterns(&g, &[r - 1.0, r - 4.0]), ["++", "+-", "--"]);
        assert_eq!(patterns(&g, &[r + 1.0]), ["+"]);
        assert_eq!(patterns(&g, &[x.sin() - 2.0]), ["-"]);
        assert_eq!(patterns(&g, &[-r]), ["-"]);
        assert_eq!(patterns(&g, &[x.exp() * y.cosh(), -x.powi(4) - 1.0]), ["+-"]);
    }

    #[test]
    fn general_position() {
        // n lines in the plane through different points: 1 + n + n(n−1)/2 cells.
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        for n in 1..=6usize {
            let lines: Vec<Expr> = (0..n)
                .map(|k| {
                    let a = 0.3 + k as f64;
                    x * a.cos() + y * a.sin() - 0.1 * (k * k) as f64 - 0.2
                })
                .collect();
            assert_eq!(patterns(&g, &lines).len(), 1 + n + n * (n - 1) / 2);
        }
    }

    #[test]
    fn too_many_are_refused() {
        let g = Graph::new();
        let many: Vec<Expr> = (0..40).map(|k| g.x(k)).collect();
        assert!(Reach::new(&g.dag(), &g.ids(&many)).patterns(100).is_none());
    }
}
