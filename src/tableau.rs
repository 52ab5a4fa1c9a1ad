//! Butcher tableaux of Runge-Kutta methods, generated and not tabulated.
//!
//! Radau IIA, Gauss-Legendre and Lobatto IIIA methods are collocation methods: the nodes are roots of (combinations
//! of) Legendre polynomials, the coefficients integrals of the Lagrange basis on them. Lobatto IIIB methods have
//! the transposed coefficients, `b_i a_ij = b_j (b_i − a*_ji)` with `a*` of the collocation method on the same nodes,
//! which is `D(s)`; Radau IA and Lobatto IIIC methods differ from the collocation method by the rank one that makes the
//! first column `b_1`. The theory and
//! the notation (`B(p)`, `C(q)`, `D(r)`, stiff accuracy, dense output) are those of E. Hairer,
//! S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, sections II.6 and II.7, and
//! E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, section IV.5.

use crate::error::{Error, Result};

/// Family of Runge-Kutta methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Family {
    /// Collocation on the right Radau nodes: order `2s - 1`, stiffly accurate, L-stable; 1 to 9 stages.
    RadauIia,
    /// Collocation on the Gauss-Legendre nodes: order `2s`, A-stable, symplectic; 1 to 9 stages.
    GaussLegendre,
    /// Explicit methods of order `s`: Euler, explicit midpoint, Kutta's third order method and the
    /// classical method of order four; 1 to 4 stages.
    Explicit,
    /// Left Radau nodes: order `2s - 1`, L-stable; 1 to 9 stages.
    RadauIa,
    /// Collocation on the Lobatto nodes: order `2s - 2`, A-stable, first stage explicit; 2 to 9 stages.
    LobattoIiia,
    /// Lobatto nodes, order `2s - 2`, A-stable, the last stage without influence on the others; 2 to 9 stages.
    LobattoIiib,
    /// Lobatto nodes, order `2s - 2`, stiffly accurate, L-stable; 2 to 9 stages.
    LobattoIiic,
}

/// Coefficients of a Runge-Kutta method with `n_s` stages.
///
/// One step from `x_n` with step size `h` is `X_i = x_n + h Σ_j a_ij k_j`, `k_j = f(t_n + c_j h, X_j)`,
/// `x_{n+1} = x_n + h Σ_j b_j k_j`.
#[derive(Debug, Clone, PartialEq)]
pub struct Tableau {
    /// Family the method belongs to.
    pub family: Family,
    /// Number of stages.
    pub n_s: usize,
    /// Coefficients `a_ij`, row-major.
    pub a: Vec<f64>,
    /// Weights.
    pub b: Vec<f64>,
    /// Nodes in `[0, 1]`, ascending (explicit methods may repeat one).
    pub c: Vec<f64>,
    /// Inverse of the coefficient matrix, row-major; absent where the matrix is singular.
    pub a_inv: Option<Vec<f64>>,
    /// Classical order.
    pub order: usize,
    /// Barycentric weights `1 / Π_{k≠j} (c_j - c_k)`; empty for explicit methods.
    bary: Vec<f64>,
    /// Gauss rule on `[0, 1]` that integrates the Lagrange basis exactly; empty for explicit methods.
    rule: Vec<(f64, f64)>,
}

impl Tableau {
    /// Largest number of stages of the collocation families.
    pub const MAX_STAGES: usize = 9;

    /// The method of a family with `n_s` stages.
    ///
    /// Fails with [`Error::Unsupported`] where the family has no such method.
    pub fn new(family: Family, n_s: usize) -> Result<Tableau> {
        let (min, max) = match family {
            Family::Explicit => (1, 4),
            Family::RadauIia | Family::GaussLegendre | Family::RadauIa => (1, Self::MAX_STAGES),
            Family::LobattoIiia | Family::LobattoIiib | Family::LobattoIiic => (2, Self::MAX_STAGES),
        };
        if n_s < min || n_s > max {
            return Err(Error::Unsupported(format!(
                "{family:?} methods have {min} to {max} stages, {n_s} were asked for"
            )));
        }
        match family {
            Family::RadauIia => Ok(Self::collocation(family, radau_nodes(n_s), 2 * n_s - 1)),
            Family::GaussLegendre => {
                let c = gauss_rule(n_s).iter().map(|q| q.0).collect();
                Ok(Self::collocation(family, c, 2 * n_s))
            }
            Family::Explicit => Ok(Self::explicit(n_s)),
            Family::RadauIa => {
                let c = radau_nodes(n_s).iter().rev().map(|c| 1.0 - c).collect();
                Ok(Self::collocation(family, c, 2 * n_s - 1).first_column_b())
            }
            Family::LobattoIiia => Ok(Self::collocation(family, lobatto_nodes(n_s), 2 * n_s - 2)),
            Family::LobattoIiib => Ok(Self::collocation(family, lobatto_nodes(n_s), 2 * n_s - 2).transposed()),
            Family::LobattoIiic => Ok(Self::collocation(family, lobatto_nodes(n_s), 2 * n_s - 2).first_column_b()),
        }
    }

    /// Coefficients that satisfy `D(s)` with the same nodes and weights.
    fn transposed(mut self) -> Tableau {
        let (n, star) = (self.n_s, self.a.clone());
        for i in 0..n {
            for j in 0..n {
                // on the last and the first node the integral is that over the whole interval, or none
                let rest = if self.c[j] == 1.0 { 0.0 } else { self.b[i] - star[j * n + i] };
                self.a[i * n + j] = self.b[j] / self.b[i] * rest;
            }
        }
        self.invert()
    }

    /// Coefficients with `a_i1 = b_1` that satisfy `C(s − 1)`: the difference to `C(s)` is orthogonal to polynomials of
    /// degree `s − 2`, as the barycentric weights are.
    fn first_column_b(mut self) -> Tableau {
        let n = self.n_s;
        for i in 0..n {
            let factor = (self.b[0] - self.a[i * n]) / self.bary[0];
            for j in 0..n {
                self.a[i * n + j] += factor * self.bary[j];
            }
            self.a[i * n] = self.b[0];
        }
        if self.c[n - 1] == 1.0 {
            self.a[(n - 1) * n..].copy_from_slice(&self.b);
        }
        self.invert()
    }

    /// Sets the inverse where there is one.
    fn invert(mut self) -> Tableau {
        let m = nalgebra::DMatrix::from_row_slice(self.n_s, self.n_s, &self.a);
        self.a_inv = match self.family {
            Family::LobattoIiib => None,
            _ => m.try_inverse().map(|inv| inv.transpose().as_slice().to_vec()),
        };
        self
    }

    /// Collocation method on given distinct nodes.
    fn collocation(family: Family, c: Vec<f64>, order: usize) -> Tableau {
        let n = c.len();
        let bary = (0..n).map(|j| 1.0 / (0..n).filter(|&k| k != j).map(|k| c[j] - c[k]).product::<f64>()).collect();
        let mut tab = Tableau {
            family,
            n_s: n,
            a: vec![0.0; n * n],
            b: vec![0.0; n],
            c,
            a_inv: None,
            order,
            bary,
            rule: gauss_rule(n.div_ceil(2)),
        };
        let mut row = vec![0.0; n];
        for i in 0..n {
            tab.dense_weights(tab.c[i], &mut row);
            tab.a[i * n..(i + 1) * n].copy_from_slice(&row);
        }
        tab.dense_weights(1.0, &mut row);
        tab.b.copy_from_slice(&row);
        tab.a_inv = (tab.c[0] > 0.0).then(|| differentiation(&tab.c));
        tab
    }

    fn explicit(n_s: usize) -> Tableau {
        let (a, b, c): (Vec<f64>, Vec<f64>, Vec<f64>) = match n_s {
            1 => (vec![0.0], vec![1.0], vec![0.0]),
            2 => (vec![0.0, 0.0, 0.5, 0.0], vec![0.0, 1.0], vec![0.0, 0.5]),
            3 => (
                vec![0.0, 0.0, 0.0, 0.5, 0.0, 0.0, -1.0, 2.0, 0.0],
                vec![1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
                vec![0.0, 0.5, 1.0],
            ),
            _ => (
                vec![
                    0.0, 0.0, 0.0, 0.0, //
                    0.5, 0.0, 0.0, 0.0, //
                    0.0, 0.5, 0.0, 0.0, //
                    0.0, 0.0, 1.0, 0.0,
                ],
                vec![1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
                vec![0.0, 0.5, 0.5, 1.0],
            ),
        };
        Tableau { family: Family::Explicit, n_s, a, b, c, a_inv: None, order: n_s, bary: Vec::new(), rule: Vec::new() }
    }

    /// Coefficient `a_ij`.
    pub fn a(&self, i: usize, j: usize) -> f64 {
        self.a[i * self.n_s + j]
    }

    /// Classical order `p`: the local error is `O(h^{p+1})`.
    pub fn order(&self) -> usize {
        self.order
    }

    /// True for collocation methods, whose stages are values of one polynomial.
    pub fn is_collocation(&self) -> bool {
        matches!(self.family, Family::RadauIia | Family::GaussLegendre | Family::LobattoIiia)
    }

    /// True where the last row of `A` equals `b` and `c_s = 1`, so that `x_{n+1} = X_s`.
    pub fn stiffly_accurate(&self) -> bool {
        const TOL: f64 = 1e-13;
        let last = &self.a[(self.n_s - 1) * self.n_s..];
        (self.c[self.n_s - 1] - 1.0).abs() <= TOL && last.iter().zip(&self.b).all(|(a, b)| (a - b).abs() <= TOL)
    }

    /// Weights `d = A^{-T} b` of `x_{n+1} = (1 - Σ d) x_n + Σ_j d_j X_j`; `None` where `A` is singular.
    pub fn boundary_weights(&self) -> Option<Vec<f64>> {
        let n = self.n_s;
        let mut d = vec![0.0; n];
        let inv = self.a_inv.as_ref()?;
        if self.state_weights(1.0, &mut d).is_err() {
            for (j, d) in d.iter_mut().enumerate() {
                *d = (0..n).map(|i| self.b[i] * inv[i * n + j]).sum();
            }
        }
        Some(d)
    }

    /// Weights `d_j(θ)` of the collocation polynomial in terms of the stage values,
    /// `x(t_n + θ h) = (1 - Σ d) x_n + Σ_j d_j X_j`, written into `out[n_s]`.
    ///
    /// These are the Lagrange polynomials on the nodes `0, c_1, ..., c_s` without the first. Fails with
    /// [`Error::Unsupported`] for methods that are no collocation methods, and where `c_1 = 0`.
    pub fn state_weights(&self, theta: f64, out: &mut [f64]) -> Result<()> {
        self.lagrange_at(theta, out)?;
        if self.c[0] == 0.0 {
            return Err(Error::Unsupported(format!(
                "the first stage of {:?} methods is the start itself",
                self.family
            )));
        }
        for (o, c) in out.iter_mut().zip(&self.c) {
            *o *= theta / c;
        }
        Ok(())
    }

    /// Lagrange basis on the nodes `c`, evaluated at `tau` into `out[n_s]`.
    ///
    /// Fails with [`Error::Unsupported`] for methods that are no collocation methods.
    pub fn lagrange_at(&self, tau: f64, out: &mut [f64]) -> Result<()> {
        if !self.is_collocation() {
            return Err(Error::Unsupported(format!("{:?} methods have no collocation polynomial", self.family)));
        }
        for (j, o) in out[..self.n_s].iter_mut().enumerate() {
            *o = self.lagrange(j, tau);
        }
        Ok(())
    }

    /// Weights of the stage values in the polynomial through them, for quantities without a derivative: written into
    /// `out[n_s]`. Explicit methods take the value at the stage before.
    pub fn interpolation_weights(&self, theta: f64, out: &mut [f64]) {
        for (j, o) in out[..self.n_s].iter_mut().enumerate() {
            *o = if self.bary.is_empty() { 0.0 } else { self.lagrange(j, theta) };
        }
        if self.bary.is_empty() {
            out[self.c.iter().rposition(|c| *c <= theta).unwrap_or(0)] = 1.0;
        }
    }

    /// Lagrange polynomial `j` in product form: exactly zero at the other nodes, one up to rounding at its own.
    fn lagrange(&self, j: usize, tau: f64) -> f64 {
        let others = self.c.iter().enumerate().filter(|&(k, _)| k != j);
        others.fold(self.bary[j], |v, (_, c)| v * (tau - c))
    }

    /// Order of the dense output [`Tableau::dense_weights`], uniformly in θ: its local error is `O(h^{q+1})`.
    ///
    /// `s` for collocation methods, Radau IA and Lobatto IIIC, `s - 1` for Lobatto IIIB, 1, 2, 2, 3 for the explicit methods with 1 to 4 stages.
    pub fn dense_order(&self) -> usize {
        match self.family {
            Family::LobattoIiib => self.n_s - 1,
            Family::RadauIia | Family::GaussLegendre | Family::LobattoIiia | Family::RadauIa | Family::LobattoIiic => {
                self.n_s
            }
            Family::Explicit => [1, 2, 2, 3][self.n_s - 1],
        }
    }

    /// Weights `B_j(θ)` of the dense output `x(t_n + θ h) ≈ x_n + h Σ_j B_j(θ) k_j`, written into `out[n_s]`.
    ///
    /// - Collocation methods: the collocation polynomial, `B_j(θ) = ∫_0^θ ℓ_j`. Other implicit methods: the same integral
    ///   of the polynomial through the stage derivatives.
    /// - Euler: linear, order 1.
    /// - Explicit midpoint: order 2, `B = (θ - θ², θ²)`.
    /// - Kutta's third order method: the integral of the parabola through the stages, order 2 (three stages
    ///   admit no continuous extension of order 3); exact for pure quadrature up to cubics.
    /// - Classical method of order 4: the extension of order 3 of Hairer, Nørsett, Wanner, section II.6.
    ///
    /// `B(0) = 0` and `B(1) = b` always hold. θ outside `[0, 1]` extrapolates.
    pub fn dense_weights(&self, theta: f64, out: &mut [f64]) {
        let out = &mut out[..self.n_s];
        let t = theta;
        match self.family {
            Family::RadauIia
            | Family::GaussLegendre
            | Family::RadauIa
            | Family::LobattoIiia
            | Family::LobattoIiib
            | Family::LobattoIiic => {
                out.fill(0.0);
                for &(node, weight) in &self.rule {
                    for (j, o) in out.iter_mut().enumerate() {
                        *o += t * weight * self.lagrange(j, t * node);
                    }
                }
            }
            Family::Explicit => match self.n_s {
                1 => out[0] = t,
                2 => {
                    out[0] = t * (1.0 - t);
                    out[1] = t * t;
                }
                3 => {
                    out[0] = t * (1.0 + t * (-1.5 + t * (2.0 / 3.0)));
                    out[1] = t * t * (2.0 - t * (4.0 / 3.0));
                    out[2] = t * t * (-0.5 + t * (2.0 / 3.0));
                }
                _ => {
                    out[0] = t * (1.0 + t * (-1.5 + t * (2.0 / 3.0)));
                    out[1] = t * t * (1.0 - t * (2.0 / 3.0));
                    out[2] = out[1];
                    out[3] = t * t * (-0.5 + t * (2.0 / 3.0));
                }
            },
        }
    }
}

/// Legendre polynomials `P_n` and `P_{n-1}` with their derivatives at `x`: `(P_n, P_n', P_{n-1}, P_{n-1}')`.
fn legendre(n: usize, x: f64) -> (f64, f64, f64, f64) {
    let (mut p0, mut d0) = (0.0, 0.0);
    let (mut p1, mut d1) = (1.0, 0.0);
    for k in 0..n {
        let k = k as f64;
        let p2 = ((2.0 * k + 1.0) * x * p1 - k * p0) / (k + 1.0);
        let d2 = d0 + (2.0 * k + 1.0) * p1;
        (p0, d0, p1, d1) = (p1, d1, p2, d2);
    }
    (p1, d1, p0, d0)
}

/// Newton's method to the limit of the arithmetic: stops when the step no longer shrinks.
fn newton(mut x: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut last = f64::INFINITY;
    for _ in 0..50 {
        let (v, d) = f(x);
        let step = v / d;
        if step == 0.0 || (step.abs() < 1e-10 && step.abs() >= last) {
            break;
        }
        x -= step;
        last = step.abs();
    }
    x
}

/// Gauss-Legendre nodes (ascending) and weights on `[0, 1]`.
pub(crate) fn gauss_rule(n: usize) -> Vec<(f64, f64)> {
    let mut rule = vec![(0.5, 0.0); n];
    for i in 0..n.div_ceil(2) {
        // Roots come in pairs ±x; the one in the middle of an odd rule is exactly zero.
        let guess = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let x = if 2 * i + 1 == n {
            0.0
        } else {
            newton(guess, |x| {
                let (p, d, _, _) = legendre(n, x);
                (p, d)
            })
        };
        let d = legendre(n, x).1;
        let w = 1.0 / ((1.0 - x * x) * d * d);
        rule[i] = (0.5 * (1.0 - x), w);
        rule[n - 1 - i] = (0.5 * (1.0 + x), w);
    }
    rule
}

/// Right Radau nodes on `(0, 1]`, ascending: roots of `P_s - P_{s-1}`, the last exactly one.
fn radau_nodes(n: usize) -> Vec<f64> {
    let mut c = vec![1.0; n];
    for k in 1..n {
        let guess = (2.0 * std::f64::consts::PI * k as f64 / (2.0 * n as f64 - 1.0)).cos();
        let x = newton(guess, |x| {
            let (p, d, q, e) = legendre(n, x);
            (p - q, d - e)
        });
        c[n - 1 - k] = 0.5 * (1.0 + x);
    }
    c
}

/// Lobatto nodes on `[0, 1]`: the ends and the roots of `P'_{s-1}`.
fn lobatto_nodes(n: usize) -> Vec<f64> {
    let mut c = vec![0.0; n];
    c[n - 1] = 1.0;
    let m = (n - 1) as f64;
    for k in 1..n - 1 {
        let guess = (std::f64::consts::PI * k as f64 / m).cos();
        // the derivatives satisfy Legendre's equation, (1 − x²) P'' = 2 x P' − m (m + 1) P
        let x = if 2 * k + 1 == n {
            0.0
        } else {
            newton(guess, |x| {
                let (p, d, _, _) = legendre(n - 1, x);
                (d, (2.0 * x * d - m * (m + 1.0) * p) / (1.0 - x * x))
            })
        };
        c[n - 1 - k] = 0.5 * (1.0 + x);
    }
    c
}

/// Inverse of the collocation matrix: derivatives of the Lagrange basis on `0, c_1, ..., c_s` at the `c_i`.
///
/// `X - x_n = h A k` says that the polynomial through `x_n, X_1, ..., X_s` has the derivatives `k`, so
/// `A^{-1}` is the differentiation matrix without the row and the column of the node zero.
fn differentiation(c: &[f64]) -> Vec<f64> {
    let n = c.len();
    let omega: Vec<f64> =
        (0..n).map(|j| c[j] * (0..n).filter(|&k| k != j).map(|k| c[j] - c[k]).product::<f64>()).collect();
    let mut d = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            d[i * n + j] = if i == j {
                1.0 / c[i] + (0..n).filter(|&k| k != i).map(|k| 1.0 / (c[i] - c[k])).sum::<f64>()
            } else {
                omega[i] / (omega[j] * (c[i] - c[j]))
            };
        }
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOBATTO: [Family; 3] = [Family::LobattoIiia, Family::LobattoIiib, Family::LobattoIiic];

    fn all() -> Vec<Tableau> {
        let mut v = Vec::new();
        for s in 1..=9 {
            v.push(Tableau::new(Family::RadauIia, s).unwrap());
            v.push(Tableau::new(Family::GaussLegendre, s).unwrap());
            v.push(Tableau::new(Family::RadauIa, s).unwrap());
        }
        for s in 2..=9 {
            v.extend(LOBATTO.map(|f| Tableau::new(f, s).unwrap()));
        }
        for s in 1..=4 {
            v.push(Tableau::new(Family::Explicit, s).unwrap());
        }
        v
    }

    /// Stage order.
    fn c_order(t: &Tableau) -> usize {
        match t.family {
            Family::RadauIia | Family::GaussLegendre | Family::LobattoIiia => t.n_s,
            Family::RadauIa | Family::LobattoIiic => t.n_s - 1,
            Family::LobattoIiib => t.n_s - 2,
            Family::Explicit => 1,
        }
    }

    /// The largest `r` of `D(r)`.
    fn d_order(t: &Tableau) -> usize {
        match t.family {
            Family::GaussLegendre | Family::RadauIa | Family::LobattoIiib => t.n_s,
            Family::RadauIia | Family::LobattoIiic => t.n_s - 1,
            Family::LobattoIiia => t.n_s - 2,
            Family::Explicit => 0,
        }
    }

    fn collocations() -> impl Iterator<Item = Tableau> {
        all().into_iter().filter(|t| t.is_collocation())
    }

    fn close(a: &[f64], b: &[f64], tol: f64) {
        assert_eq!(a.len(), b.len());
        for (x, y) in a.iter().zip(b) {
            assert!((x - y).abs() <= tol, "{a:?} against {b:?}");
        }
    }

    #[test]
    fn known_values() {
        let t = Tableau::new(Family::RadauIia, 1).unwrap();
        close(&t.a, &[1.0], 1e-16);
        let t = Tableau::new(Family::RadauIia, 2).unwrap();
        close(&t.c, &[1.0 / 3.0, 1.0], 2e-16);
        close(&t.a, &[5.0 / 12.0, -1.0 / 12.0, 0.75, 0.25], 3e-16);
        let t = Tableau::new(Family::RadauIia, 3).unwrap();
        let r = 6f64.sqrt();
        close(&t.c, &[(4.0 - r) / 10.0, (4.0 + r) / 10.0, 1.0], 2e-16);
        close(
            &t.a,
            &[
                (88.0 - 7.0 * r) / 360.0,
                (296.0 - 169.0 * r) / 1800.0,
                (-2.0 + 3.0 * r) / 225.0,
                (296.0 + 169.0 * r) / 1800.0,
                (88.0 + 7.0 * r) / 360.0,
                (-2.0 - 3.0 * r) / 225.0,
                (16.0 - r) / 36.0,
                (16.0 + r) / 36.0,
                1.0 / 9.0,
            ],
            4e-16,
        );
        let t = Tableau::new(Family::GaussLegendre, 1).unwrap();
        close(&t.a, &[0.5], 1e-16);
        let t = Tableau::new(Family::GaussLegendre, 2).unwrap();
        let r = 3f64.sqrt() / 6.0;
        close(&t.c, &[0.5 - r, 0.5 + r], 2e-16);
        close(&t.a, &[0.25, 0.25 - r, 0.25 + r, 0.25], 3e-16);
        let t = Tableau::new(Family::GaussLegendre, 3).unwrap();
        let r = 15f64.sqrt();
        close(&t.c, &[0.5 - r / 10.0, 0.5, 0.5 + r / 10.0], 2e-16);
        close(&t.b, &[5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0], 3e-16);
        close(
            &t.a,
            &[
                5.0 / 36.0,
                2.0 / 9.0 - r / 15.0,
                5.0 / 36.0 - r / 30.0,
                5.0 / 36.0 + r / 24.0,
                2.0 / 9.0,
                5.0 / 36.0 - r / 24.0,
                5.0 / 36.0 + r / 30.0,
                2.0 / 9.0 + r / 15.0,
                5.0 / 36.0,
            ],
            4e-16,
        );
    }

    #[test]
    fn limits() {
        for (f, s) in [
            (Family::RadauIia, 0),
            (Family::RadauIia, 10),
            (Family::GaussLegendre, 10),
            (Family::Explicit, 5),
            (Family::LobattoIiia, 1),
            (Family::LobattoIiic, 10),
        ] {
            assert!(matches!(Tableau::new(f, s), Err(Error::Unsupported(_))));
        }
    }

    #[test]
    fn nodes_ascend_and_rows_sum_to_nodes() {
        for t in all() {
            assert!(t.c.windows(2).all(|w| w[0] < w[1] || t.family == Family::Explicit));
            // Radau IA with one stage and Lobatto IIIB with two do not satisfy C(1)
            for i in 0..if c_order(&t) > 0 { t.n_s } else { 0 } {
                let sum: f64 = (0..t.n_s).map(|j| t.a(i, j)).sum();
                assert!((sum - t.c[i]).abs() < 1e-15, "{:?} {}", t.family, t.n_s);
            }
        }
    }

    #[test]
    fn simplifying_assumptions() {
        for t in all() {
            let n = t.n_s;
            let power = |x: f64, q: usize| x.powi(q as i32);
            // B(p)
            for q in 1..=t.order() {
                let s: f64 = (0..n).map(|j| t.b[j] * power(t.c[j], q - 1)).sum();
                assert!((s - 1.0 / q as f64).abs() < 1e-14, "B({q}) of {:?} {n}: {s}", t.family);
            }
            for q in 1..=c_order(&t) {
                for i in 0..if t.family == Family::Explicit { 0 } else { n } {
                    let s: f64 = (0..n).map(|j| t.a(i, j) * power(t.c[j], q - 1)).sum();
                    let e = power(t.c[i], q) / q as f64;
                    assert!((s - e).abs() < 1e-14, "C({q}) of {:?} {n}: {s} {e}", t.family);
                }
            }
            for q in 1..=d_order(&t) {
                for j in 0..n {
                    let s: f64 = (0..n).map(|i| t.b[i] * power(t.c[i], q - 1) * t.a(i, j)).sum();
                    let e = t.b[j] * (1.0 - power(t.c[j], q)) / q as f64;
                    assert!((s - e).abs() < 1e-14, "D({q}) of {:?} {n}: {s} {e}", t.family);
                }
            }
        }
    }

    #[test]
    fn structure_of_the_other_families() {
        for s in 2..=9 {
            let [a, b, c] = LOBATTO.map(|f| Tableau::new(f, s).unwrap());
            assert!((0..s).all(|j| a.a(0, j) == 0.0));
            assert!((0..s).all(|i| b.a(i, s - 1) == 0.0 && (b.a(i, 0) - b.b[0]).abs() < 1e-15));
            assert!((0..s).all(|i| c.a(i, 0) == c.b[0]));
            let t = Tableau::new(Family::RadauIa, s).unwrap();
            assert!((0..s).all(|i| (t.a(i, 0) - t.b[0]).abs() < 1e-15) && t.c[0] == 0.0);
        }
        let t = Tableau::new(Family::RadauIa, 2).unwrap();
        close(&t.a, &[0.25, -0.25, 0.25, 5.0 / 12.0], 3e-16);
        let t = Tableau::new(Family::LobattoIiic, 3).unwrap();
        let r = |p: f64, q: f64| p / q;
        close(
            &t.a,
            &[r(1., 6.), r(-1., 3.), r(1., 6.), r(1., 6.), r(5., 12.), r(-1., 12.), r(1., 6.), r(2., 3.), r(1., 6.)],
            3e-16,
        );
    }

    #[test]
    fn order_four_conditions_of_explicit_methods() {
        for s in 1..=4 {
            let t = Tableau::new(Family::Explicit, s).unwrap();
            let ac: Vec<f64> = (0..s).map(|i| (0..s).map(|j| t.a(i, j) * t.c[j]).sum()).collect();
            let ac2: Vec<f64> = (0..s).map(|i| (0..s).map(|j| t.a(i, j) * t.c[j] * t.c[j]).sum()).collect();
            let aac: Vec<f64> = (0..s).map(|i| (0..s).map(|j| t.a(i, j) * ac[j]).sum()).collect();
            let dot = |v: &[f64]| t.b.iter().zip(v).map(|(b, v)| b * v).sum::<f64>();
            if s >= 3 {
                assert!((dot(&ac) - 1.0 / 6.0).abs() < 1e-15);
            }
            if s >= 4 {
                let cac: Vec<f64> = (0..s).map(|i| t.c[i] * ac[i]).collect();
                assert!((dot(&cac) - 1.0 / 8.0).abs() < 1e-15);
                assert!((dot(&ac2) - 1.0 / 12.0).abs() < 1e-15);
                assert!((dot(&aac) - 1.0 / 24.0).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn inverse() {
        for t in all() {
            let n = t.n_s;
            let Some(inv) = t.a_inv.as_ref() else {
                assert!(matches!(t.family, Family::Explicit | Family::LobattoIiia | Family::LobattoIiib));
                continue;
            };
            for i in 0..n {
                for j in 0..n {
                    let s: f64 = (0..n).map(|k| t.a(i, k) * inv[k * n + j]).sum();
                    assert!((s - f64::from(i == j)).abs() < 1e-13, "{:?} {n} {s}", t.family);
                }
            }
        }
    }

    #[test]
    fn boundary_weights_solve_their_system() {
        for t in all() {
            let Some(d) = t.boundary_weights() else {
                assert!(t.a_inv.is_none());
                continue;
            };
            for j in 0..t.n_s {
                let s: f64 = (0..t.n_s).map(|i| t.a(i, j) * d[i]).sum();
                assert!((s - t.b[j]).abs() < 2e-14, "{:?} {}", t.family, t.n_s);
            }
            if t.family == Family::RadauIia {
                for (j, d) in d.iter().enumerate() {
                    assert!((d - f64::from(j + 1 == t.n_s)).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn stiff_accuracy() {
        for t in all() {
            let is = matches!(t.family, Family::RadauIia | Family::LobattoIiia | Family::LobattoIiic);
            assert_eq!(t.stiffly_accurate(), is);
        }
    }

    /// `1 + z bᵀ (I - z A)^{-1} 1` by elimination.
    fn stability(t: &Tableau, z: f64) -> f64 {
        let n = t.n_s;
        let m = nalgebra::DMatrix::from_fn(n, n, |i, j| f64::from(i == j) - z * t.a(i, j));
        let k = m.lu().solve(&nalgebra::DVector::from_element(n, 1.0)).unwrap();
        1.0 + z * (0..n).map(|j| t.b[j] * k[j]).sum::<f64>()
    }

    #[test]
    fn stability_functions() {
        let t = Tableau::new(Family::RadauIia, 3).unwrap();
        assert!((stability(&t, -3.0) - 0.25 / 4.6).abs() < 1e-15);
        // Padé approximations: |R| = 1 at infinity for Gauss, 0 for Radau IIA.
        for t in all().into_iter().filter(|t| t.family != Family::Explicit) {
            let r = stability(&t, -1e8).abs();
            let e = f64::from(matches!(t.family, Family::GaussLegendre | Family::LobattoIiia | Family::LobattoIiib));
            assert!((r - e).abs() < 1e-5, "{:?} {} {r}", t.family, t.n_s);
        }
        for s in 1..=4 {
            let t = Tableau::new(Family::Explicit, s).unwrap();
            let (mut e, mut term) = (1.0, 1.0);
            for k in 1..=s {
                term *= -0.7 / k as f64;
                e += term;
            }
            assert!((stability(&t, -0.7) - e).abs() < 1e-15);
        }
    }

    #[test]
    fn basis_is_cardinal_and_partitions_unity() {
        for t in collocations() {
            let mut l = vec![0.0; t.n_s];
            for i in 0..t.n_s {
                t.lagrange_at(t.c[i], &mut l).unwrap();
                for (j, v) in l.iter().enumerate() {
                    assert!((v - f64::from(i == j)).abs() < 1e-14);
                }
            }
            for tau in [0.0, 0.123, 0.77, 1.0] {
                t.lagrange_at(tau, &mut l).unwrap();
                assert!((l.iter().sum::<f64>() - 1.0).abs() < 1e-13);
            }
        }
        let t = Tableau::new(Family::Explicit, 4).unwrap();
        assert!(t.lagrange_at(0.5, &mut [0.0; 4]).is_err());
    }

    #[test]
    fn state_weights_and_dense_weights_agree() {
        // Stage values of x' = k with arbitrary k: both forms are the same polynomial.
        for t in collocations().filter(|t| t.c[0] > 0.0) {
            let n = t.n_s;
            let k: Vec<f64> = (0..n).map(|j| (1.3 * j as f64 + 0.4).sin()).collect();
            let (x0, h) = (0.7, 0.3);
            let xs: Vec<f64> = (0..n).map(|i| x0 + h * (0..n).map(|j| t.a(i, j) * k[j]).sum::<f64>()).collect();
            let (mut d, mut w) = (vec![0.0; n], vec![0.0; n]);
            for theta in [0.0, 0.2, 0.5, 0.9, 1.0] {
                t.state_weights(theta, &mut d).unwrap();
                t.dense_weights(theta, &mut w);
                let by_state: f64 = x0 + (0..n).map(|j| d[j] * (xs[j] - x0)).sum::<f64>();
                let by_rate = x0 + h * (0..n).map(|j| w[j] * k[j]).sum::<f64>();
                assert!((by_state - by_rate).abs() < 1e-14, "{:?} {n}", t.family);
            }
        }
    }

    #[test]
    fn dense_output_ends_at_the_step_and_has_its_order() {
        for t in all() {
            let n = t.n_s;
            let mut w = vec![0.0; n];
            t.dense_weights(0.0, &mut w);
            assert!(w.iter().all(|v| *v == 0.0));
            t.dense_weights(1.0, &mut w);
            close(&w, &t.b, 1e-15);
            for theta in [0.25, 0.6, 0.83] {
                t.dense_weights(theta, &mut w);
                for q in 1..=t.dense_order() {
                    let s: f64 = (0..n).map(|j| w[j] * t.c[j].powi(q as i32 - 1)).sum();
                    assert!((s - theta.powi(q as i32) / q as f64).abs() < 1e-14);
                }
                // the order with stage values of a lower one shows in the conditions of quadrature alone
                if t.dense_order() >= 3 && c_order(&t) >= 2 {
                    let s: f64 = (0..n).map(|i| w[i] * (0..n).map(|j| t.a(i, j) * t.c[j]).sum::<f64>()).sum();
                    assert!((s - theta.powi(3) / 6.0).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn explicit_dense_output_converges_at_its_order() {
        // x' = x cos t, x = exp(sin t), one step from t = 0.3, value at θ = 0.4.
        for s in 1..=4 {
            let t = Tableau::new(Family::Explicit, s).unwrap();
            let error = |h: f64| {
                let t0: f64 = 0.3;
                let x0 = t0.sin().exp();
                let mut k = [0.0; 4];
                for i in 0..s {
                    let x = x0 + h * (0..i).map(|j| t.a(i, j) * k[j]).sum::<f64>();
                    k[i] = x * (t0 + t.c[i] * h).cos();
                }
                let mut w = [0.0; 4];
                t.dense_weights(0.4, &mut w);
                let x = x0 + h * (0..s).map(|j| w[j] * k[j]).sum::<f64>();
                (x - (t0 + 0.4 * h).sin().exp()).abs()
            };
            let slope = (error(0.02) / error(0.01)).log2();
            let expected = t.dense_order() as f64 + 1.0;
            assert!((slope - expected).abs() < 0.2, "{s}: {slope}");
        }
    }
}
