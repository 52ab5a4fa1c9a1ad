//! Programs whose functions are sums of constants, products of at most two variables, and exponentials of one.

use switchback_mpcc::func::{EvalError, EvalResult};
use switchback_mpcc::linalg::csc::Pattern;
use switchback_mpcc::mpcc::Member;
use switchback_mpcc::nlp::{Bounds, Nlp};

/// A function: `constant + Σ aⱼ xⱼ + Σ qᵢⱼ xᵢ xⱼ + Σ w exp(s xⱼ)`.
#[derive(Debug, Clone, Default)]
pub struct Expr {
    pub constant: f64,
    pub linear: Vec<(usize, f64)>,
    pub products: Vec<(usize, usize, f64)>,
    pub exponentials: Vec<(usize, f64, f64)>,
}

impl Expr {
    pub fn of(constant: f64) -> Expr {
        Expr { constant, ..Expr::default() }
    }

    pub fn plus(mut self, a: f64, j: usize) -> Expr {
        self.linear.push((j, a));
        self
    }

    pub fn times(mut self, q: f64, i: usize, j: usize) -> Expr {
        self.products.push((i.min(j), i.max(j), q));
        self
    }

    pub fn exp(mut self, weight: f64, slope: f64, j: usize) -> Expr {
        self.exponentials.push((j, weight, slope));
        self
    }

    /// Plus `weight (Σ aⱼ xⱼ + constant)²`.
    pub fn square(mut self, weight: f64, terms: &[(usize, f64)], constant: f64) -> Expr {
        self.constant += weight * constant * constant;
        for (k, &(i, a)) in terms.iter().enumerate() {
            self = self.plus(2.0 * weight * a * constant, i).times(weight * a * a, i, i);
            for &(j, b) in &terms[..k] {
                self = self.times(2.0 * weight * a * b, i, j);
            }
        }
        self
    }

    fn value(&self, x: &[f64]) -> f64 {
        self.constant
            + self.linear.iter().map(|&(j, a)| a * x[j]).sum::<f64>()
            + self.products.iter().map(|&(i, j, q)| q * x[i] * x[j]).sum::<f64>()
            + self.exponentials.iter().map(|&(j, w, s)| w * (s * x[j]).exp()).sum::<f64>()
    }

    /// Derivatives by variable, one entry for every term.
    fn slopes<'a>(&'a self, x: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let products = self.products.iter().flat_map(|&(i, j, q)| [(i, q * x[j]), (j, q * x[i])]);
        let exponentials = self.exponentials.iter().map(|&(j, w, s)| (j, w * s * (s * x[j]).exp()));
        self.linear.iter().copied().chain(products).chain(exponentials)
    }

    /// Second derivatives of the upper triangle, one entry for every term.
    fn curvatures<'a>(&'a self, x: &'a [f64]) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
        let products = self.products.iter().map(|&(i, j, q)| (i, j, if i == j { 2.0 * q } else { q }));
        products.chain(self.exponentials.iter().map(|&(j, w, s)| (j, j, w * s * s * (s * x[j]).exp())))
    }

    /// The function times `factor`, of variables that are the ones given in units of `unit`.
    fn in_units(&mut self, factor: f64, unit: &[f64]) {
        self.constant *= factor;
        self.linear.iter_mut().for_each(|t| t.1 *= factor * unit[t.0]);
        self.products.iter_mut().for_each(|t| t.2 *= factor * unit[t.0] * unit[t.1]);
        self.exponentials.iter_mut().for_each(|t| (t.1, t.2) = (t.1 * factor, t.2 * unit[t.0]));
    }

    pub fn is_linear(&self) -> bool {
        self.products.is_empty() && self.exponentials.is_empty()
    }
}

/// A program, its pairs and where a solve begins.
#[derive(Debug, Clone)]
pub struct Program {
    pub objective: Expr,
    pub rows: Vec<Expr>,
    pub bounds: Bounds,
    pub pairs: Vec<(Member, Member)>,
    pub x0: Vec<f64>,
    /// Is the objective known to be convex?
    pub convex: bool,
    jac: Pattern,
    jac_slots: Vec<usize>,
    hess: Pattern,
    hess_slots: Vec<usize>,
    at: Vec<f64>,
}

impl Program {
    /// Variables within the bounds `x`, and the objective.
    pub fn new(x: &[(f64, f64)], objective: Expr, convex: bool) -> Program {
        let mut bounds = Bounds::free(x.len(), 0);
        (bounds.xl, bounds.xu) = x.iter().copied().unzip();
        Program {
            objective,
            rows: Vec::new(),
            bounds,
            pairs: Vec::new(),
            x0: vec![0.0; x.len()],
            convex,
            jac: Pattern::from_triplets(0, x.len(), &[], &[]).0,
            jac_slots: Vec::new(),
            hess: Pattern::from_triplets(x.len(), x.len(), &[], &[]).0,
            hess_slots: Vec::new(),
            at: vec![0.0; x.len()],
        }
    }

    /// A row within bounds; its number.
    pub fn row(&mut self, e: Expr, lo: f64, hi: f64) -> usize {
        self.rows.push(e);
        self.bounds.cl.push(lo);
        self.bounds.cu.push(hi);
        self.rows.len() - 1
    }

    /// `0 ≤ x_j ⊥ e ≥ 0`.
    pub fn pair(&mut self, j: usize, e: Expr) {
        let i = self.row(e, 0.0, f64::INFINITY);
        self.pairs.push((Member::Variable(j), Member::Row(i)));
    }

    /// Derives the structure: to be called when everything is said.
    pub fn finish(mut self) -> Program {
        let (n, x) = (self.bounds.xl.len(), &self.x0);
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for (i, e) in self.rows.iter().enumerate() {
            for (j, _) in e.slopes(x) {
                rows.push(i);
                cols.push(j);
            }
        }
        (self.jac, self.jac_slots) = Pattern::from_triplets(self.rows.len(), n, &rows, &cols);
        rows.clear();
        cols.clear();
        for (i, j, _) in std::iter::once(&self.objective).chain(&self.rows).flat_map(|e| e.curvatures(x)) {
            rows.push(i);
            cols.push(j);
        }
        (self.hess, self.hess_slots) = Pattern::from_triplets(n, n, &rows, &cols);
        self
    }

    /// The same program in other units: of the objective, of its rows, and of its variables.
    pub fn in_units(mut self, objective: f64, rows: &[f64], variables: &[f64]) -> Program {
        self.objective.in_units(objective, variables);
        for (i, e) in self.rows.iter_mut().enumerate() {
            e.in_units(rows[i], variables);
            self.bounds.cl[i] *= rows[i];
            self.bounds.cu[i] *= rows[i];
        }
        for (j, u) in variables.iter().enumerate() {
            self.bounds.xl[j] /= u;
            self.bounds.xu[j] /= u;
            self.x0[j] /= u;
        }
        self
    }

    pub fn has_linear_rows(&self) -> bool {
        self.rows.iter().all(Expr::is_linear)
    }
}

impl Nlp for Program {
    fn n(&self) -> usize {
        self.at.len()
    }
    fn m(&self) -> usize {
        self.rows.len()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> Result<f64, EvalError> {
        c.iter_mut().zip(&self.rows).for_each(|(c, e)| *c = e.value(x));
        Ok(self.objective.value(x))
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        self.at.copy_from_slice(x);
        grad.fill(0.0);
        self.objective.slopes(x).for_each(|(j, v)| grad[j] += v);
        jac.fill(0.0);
        let slopes = self.rows.iter().flat_map(|e| e.slopes(x));
        slopes.zip(&self.jac_slots).for_each(|((_, v), k)| jac[*k] += v);
        Ok(())
    }
    fn hessian(&mut self, _: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        hess.fill(0.0);
        let all = std::iter::once((w, &self.objective)).chain(y.iter().copied().zip(&self.rows));
        let curvatures = all.flat_map(|(f, e)| e.curvatures(&self.at).map(move |(_, _, v)| f * v));
        curvatures.zip(&self.hess_slots).for_each(|(v, k)| hess[*k] += v);
        Ok(())
    }
}
