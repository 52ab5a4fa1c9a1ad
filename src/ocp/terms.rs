//! Functions made of other functions: inputs taken from elsewhere, outputs stacked, sums of squares.

use std::ops::Range;
use std::sync::Arc;

use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;
use crate::system::{input, SharedFunction};

/// Columns of a function for the blocks of a larger set of inputs: `x`, `u` and `p` begin at these places there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Places {
    pub x: usize,
    pub u: usize,
    pub p: usize,
}

impl Places {
    /// Columns of a function with sizes `inner` among inputs of sizes `outer`.
    pub fn columns(self, inner: Dims, outer: Dims) -> Vec<usize> {
        let blocks = [(self.x, inner.x), (self.u, inner.u), (self.p, inner.p), (outer.t_col(), 1)];
        blocks.iter().flat_map(|&(from, n)| from..from + n).collect()
    }

    /// The blocks begin as in the function itself, after what is in front of them in `outer`.
    pub fn leading(outer: Dims) -> Places {
        Places { x: 0, u: outer.x, p: outer.x + outer.u }
    }
}

/// Functions of common inputs, one below the other or added.
pub(super) struct Stack {
    name: String,
    dims: Dims,
    parts: Vec<Part>,
    n_out: usize,
    jac: Pattern,
    hess: Pattern,
    work: usize,
    adds: bool,
}

struct Part {
    f: SharedFunction,
    /// Column of the stack behind every column of the function.
    columns: Vec<usize>,
    /// Where its states, controls and parameters begin in those of the stack, where they stand there side by side: nothing has to be gathered.
    spans: Option<[Range<usize>; 3]>,
    first: usize,
    /// Entries of the stack's derivatives behind those of the function, and the factor of the latter.
    jac: Vec<usize>,
    hess: Vec<(usize, f64)>,
}

impl Stack {
    /// `parts`: functions with the columns of `dims` their inputs are.
    pub fn of(name: &str, dims: Dims, parts: Vec<(SharedFunction, Vec<usize>)>) -> SharedFunction {
        Stack::make(name, dims, parts, false)
    }

    /// The sum of functions with as many outputs each.
    pub fn sum(name: &str, dims: Dims, parts: Vec<SharedFunction>) -> SharedFunction {
        let all = || (0..dims.n_in()).collect();
        Stack::make(name, dims, parts.into_iter().map(|f| (f, all())).collect(), true)
    }

    fn make(name: &str, dims: Dims, parts: Vec<(SharedFunction, Vec<usize>)>, adds: bool) -> SharedFunction {
        let n_in = dims.n_in();
        let mut s = Stack {
            name: name.to_owned(),
            dims,
            parts: Vec::new(),
            n_out: 0,
            jac: Pattern::empty(0, n_in),
            hess: Pattern::empty(n_in, n_in),
            work: 0,
            adds,
        };
        let (mut jac, mut hess) = ((Vec::new(), Vec::new()), (Vec::new(), Vec::new()));
        for (f, columns) in parts {
            let first = if adds { 0 } else { s.n_out };
            let (inner_jac, inner_hess) = (f.jac_pattern(), f.hess_pattern());
            for j in 0..inner_jac.n_cols() {
                for &i in inner_jac.rows(j) {
                    jac.0.push(first + i);
                    jac.1.push(columns[j]);
                }
            }
            let mut factors = Vec::with_capacity(inner_hess.nnz());
            for j in 0..inner_hess.n_cols() {
                for &i in inner_hess.rows(j) {
                    let (a, b) = (columns[i].min(columns[j]), columns[i].max(columns[j]));
                    hess.0.push(a);
                    hess.1.push(b);
                    // two inputs that are one: both halves of the symmetric matrix fall on the diagonal
                    factors.push(if a == b && i != j { 2.0 } else { 1.0 });
                }
            }
            let buffer = inner_jac.nnz().max(inner_hess.nnz()).max(f.n_out());
            s.work = s.work.max(f.work_len() + buffer + f.dims().n_in());
            let spans = spans(f.dims(), dims, &columns);
            let n_jac = inner_jac.nnz();
            let n_out = f.n_out();
            s.parts.push(Part {
                f,
                columns,
                spans,
                first,
                jac: vec![0; n_jac],
                hess: factors.into_iter().map(|v| (0, v)).collect(),
            });
            s.n_out = first + n_out;
        }
        let (p, map) = Pattern::from_triplets(s.n_out, n_in, &jac.0, &jac.1);
        s.jac = p;
        let targets = s.parts.iter_mut().flat_map(|p| &mut p.jac);
        targets.zip(map).for_each(|(to, k)| *to = k);
        let (p, map) = Pattern::from_triplets(n_in, n_in, &hess.0, &hess.1);
        s.hess = p;
        let targets = s.parts.iter_mut().flat_map(|p| &mut p.hess);
        targets.zip(map).for_each(|(to, k)| to.0 = k);
        Arc::new(s)
    }

    /// One function with its inputs taken from `columns` of `dims`.
    pub fn gather(f: &SharedFunction, dims: Dims, columns: Vec<usize>) -> SharedFunction {
        Stack::of(f.name(), dims, vec![(f.clone(), columns)])
    }
}

/// Where the blocks of inputs of sizes `inner` are in the same blocks of inputs of sizes `outer`, if each is one piece of its own.
fn spans(inner: Dims, outer: Dims, columns: &[usize]) -> Option<[Range<usize>; 3]> {
    let own = [0, inner.x, inner.x + inner.u, inner.t_col()];
    let all = [0, outer.x, outer.x + outer.u, outer.t_col()];
    if columns[inner.t_col()] != outer.t_col() {
        return None;
    }
    let span = |k: usize| -> Option<Range<usize>> {
        let columns = &columns[own[k]..own[k + 1]];
        let Some(&first) = columns.first() else { return Some(0..0) };
        let follow = columns.iter().zip(first..).all(|(c, at)| *c == at);
        let within = first >= all[k] && first + columns.len() <= all[k + 1];
        (follow && within).then(|| first - all[k]..first - all[k] + columns.len())
    };
    Some([span(0)?, span(1)?, span(2)?])
}

impl Part {
    /// Calls `body` with the inputs of the function and a workspace.
    fn with(&self, at: &Point, work: &mut [f64], body: impl FnOnce(&Point, &mut [f64]) -> EvalResult) -> EvalResult {
        if let Some([x, u, p]) = &self.spans {
            let inner = Point { t: at.t, x: &at.x[x.clone()], u: &at.u[u.clone()], p: &at.p[p.clone()] };
            return body(&inner, work);
        }
        let d = self.f.dims();
        let (z, work) = work.split_at_mut(d.n_in());
        for (v, &c) in z.iter_mut().zip(&self.columns) {
            *v = input(at, c);
        }
        let (x, u, p) = (&z[..d.x], &z[d.x..d.x + d.u], &z[d.x + d.u..d.t_col()]);
        body(&Point { t: z[d.t_col()], x, u, p }, work)
    }
}

impl Function for Stack {
    fn name(&self) -> &str {
        &self.name
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.n_out
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        self.work
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        if self.adds {
            out.fill(0.0);
        }
        for p in &self.parts {
            if self.adds {
                let (value, work) = work.split_at_mut(out.len());
                p.with(at, work, |at, work| p.f.value(at, value, work))?;
                out.iter_mut().zip(&*value).for_each(|(o, v)| *o += v);
            } else {
                let out = &mut out[p.first..p.first + p.f.n_out()];
                p.with(at, work, |at, work| p.f.value(at, out, work))?;
            }
        }
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        for p in &self.parts {
            let (inner, work) = work.split_at_mut(p.jac.len());
            p.with(at, work, |at, work| p.f.jacobian(at, inner, work))?;
            for (&k, v) in p.jac.iter().zip(&*inner) {
                out[k] += v;
            }
        }
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        for p in self.parts.iter().filter(|p| !p.hess.is_empty()) {
            let (inner, work) = work.split_at_mut(p.hess.len());
            let weights = &weights[p.first..p.first + p.f.n_out()];
            p.with(at, work, |at, work| p.f.hessian(at, weights, inner, work))?;
            for (&(k, factor), v) in p.hess.iter().zip(&*inner) {
                out[k] += factor * v;
            }
        }
        Ok(())
    }
    fn is_serial(&self) -> bool {
        self.parts.iter().any(|p| p.f.is_serial())
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.parts.iter().any(|p| p.f.jacobian_is_approximate())
    }
    fn hessian_is_approximate(&self) -> bool {
        self.parts.iter().any(|p| p.f.hessian_is_approximate())
    }
}

/// `weight Σ z_c²` over input columns `c`.
pub(super) fn sum_of_squares(name: &str, dims: Dims, columns: Vec<usize>, weight: f64) -> SharedFunction {
    let zeros = vec![0; columns.len()];
    let mut sorted = columns;
    sorted.sort_unstable();
    let jac = Pattern::from_triplets(1, dims.n_in(), &zeros, &sorted).0;
    let hess = Pattern::from_triplets(dims.n_in(), dims.n_in(), &sorted, &sorted).0;
    Arc::new(Quadratic { name: name.to_owned(), dims, columns: sorted, weight, jac, hess })
}

struct Quadratic {
    name: String,
    dims: Dims,
    columns: Vec<usize>,
    weight: f64,
    jac: Pattern,
    hess: Pattern,
}

impl Function for Quadratic {
    fn name(&self) -> &str {
        &self.name
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        1
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out[0] = self.weight * self.columns.iter().map(|&c| input(at, c).powi(2)).sum::<f64>();
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out.iter_mut().zip(&self.columns).for_each(|(o, &c)| *o = 2.0 * self.weight * input(at, c));
        Ok(())
    }
    fn hessian(&self, _: &Point, weights: &[f64], out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out.fill(2.0 * self.weight * weights[0]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::{check_derivatives, Callback, CheckSettings};
    use crate::system::{combination, with_zeros};

    fn inner() -> SharedFunction {
        let d = Dims { x: 2, u: 1, p: 1 };
        let f = Callback::new("r", d, 2, |at, o| {
            o[0] = at.x[0] * at.x[1] + at.u[0] * at.p[0];
            o[1] = at.x[1].sin() * at.u[0];
            0
        });
        Arc::new(f)
    }

    fn agree(f: &dyn Function, x: &[f64], u: &[f64], p: &[f64]) {
        let at = Point { t: 0.3, x, u, p };
        let r = check_derivatives(f, &at, &CheckSettings::default()).unwrap();
        assert!(r.mismatches.is_empty(), "{}: {:?}", f.name(), r.mismatches);
    }

    #[test]
    fn inputs_from_elsewhere_also_twice() {
        let d = Dims { x: 4, u: 0, p: 1 };
        // x = (x3, x1), u = x3
        let g = Stack::gather(&inner(), d, vec![3, 1, 3, 4, 5]);
        agree(&*g, &[0.0, 0.7, 0.0, 1.3], &[], &[0.4]);
        let both = Stack::of("both", d, vec![(g.clone(), (0..6).collect()), (inner(), vec![0, 1, 2, 4, 5])]);
        agree(&*both, &[0.2, 0.7, -0.5, 1.3], &[], &[0.4]);
        let mut out = [0.0; 4];
        let at = Point { t: 0.0, x: &[0.2, 0.7, -0.5, 1.3], u: &[], p: &[0.4] };
        both.value(&at, &mut out, &mut vec![0.0; both.work_len()]).unwrap();
        assert_eq!(out[0], 1.3 * 0.7 + 1.3 * 0.4);
        assert_eq!(out[2], 0.2 * 0.7 - 0.5 * 0.4);
    }

    #[test]
    fn zeros_between_outputs() {
        for at in 0..=2 {
            let spaced = with_zeros(&inner(), &[at], 3);
            agree(&*spaced, &[0.2, 0.7], &[-0.5], &[0.4]);
            let (mut out, mut own) = ([f64::NAN; 5], [0.0; 2]);
            let point = Point { t: 0.0, x: &[0.2, 0.7], u: &[-0.5], p: &[0.4] };
            spaced.value(&point, &mut out, &mut vec![0.0; spaced.work_len()]).unwrap();
            inner().value(&point, &mut own, &mut vec![0.0; inner().work_len()]).unwrap();
            assert_eq!([&out[..at], &out[at + 3..]].concat(), own);
            assert_eq!(out[at..at + 3], [0.0; 3]);
        }
    }

    #[test]
    fn sums_of_functions() {
        let d = Dims { x: 2, u: 1, p: 1 };
        let twice = Stack::sum("twice", d, vec![inner(), inner(), combination("l", d, vec![vec![(1, 3.0)], vec![]])]);
        agree(&*twice, &[0.2, 0.7], &[-0.5], &[0.4]);
        let at = Point { t: 0.0, x: &[0.2, 0.7], u: &[-0.5], p: &[0.4] };
        let mut out = [0.0; 2];
        twice.value(&at, &mut out, &mut vec![0.0; twice.work_len()]).unwrap();
        assert!((out[0] - 2.0 * (0.14 - 0.2) - 2.1).abs() < 1e-15);
        agree(&*sum_of_squares("q", d, vec![2, 0], 3.0), &[0.2, 0.7], &[-0.5], &[0.4]);
    }
}
