//! Problems with pairs of functions and with boxes, brought into vertical form.
//!
//! A member of a pair that is a function gets a variable `v` of its own and the row `G(w) − v = 0`. A member that is a
//! variable is used as it is, or counted from the bound it is the distance from, unless it is in several pairs: then every
//! pair gets a copy, with a row `w_j − v = 0` behind those of the problem, because a product relaxed in one pair would hold
//! back the others.
//!
//! A box `l ≤ w_j ≤ u ⊥ c_i(w)` is the two pairs `0 ≤ w_j − l ⊥ p ≥ 0` and `0 ≤ u − w_j ⊥ q ≥ 0` with `c_i = p − q`; where
//! a bound is infinite its pair and its part of the row are missing.

use super::problem::Mpcc;
use crate::error::{Error, Result};
use crate::func::{EvalError, EvalResult};
use crate::linalg::csc::Pattern;
use crate::nlp::{Bounds, Nlp, INFINITE};

/// A member of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Member {
    /// Variable `w_j`.
    Variable(usize),
    /// Row `c_i(w)`, which then is no ordinary constraint; its positive part where [`Member::Negative`] is in another pair.
    Row(usize),
    /// Distance `w_j − l_j` of a variable from its lower bound.
    Above(usize),
    /// Distance `u_j − w_j` of a variable from its upper bound.
    Below(usize),
    /// `−c_i(w)`; the negative part of the row where [`Member::Row`] is in another pair: `c_i = p − q`.
    Negative(usize),
}

impl Member {
    fn is_row(self) -> bool {
        matches!(self, Member::Row(_) | Member::Negative(_))
    }

    /// The variable or row it is made of.
    fn index(self) -> usize {
        match self {
            Member::Variable(i) | Member::Above(i) | Member::Below(i) | Member::Row(i) | Member::Negative(i) => i,
        }
    }

    /// The member is this times variable or row, plus a constant.
    fn factor(self) -> f64 {
        match self {
            Member::Below(_) | Member::Negative(_) => -1.0,
            _ => 1.0,
        }
    }

    /// The value of the variable at which the member is zero.
    fn zero(self, of: &Bounds) -> Result<f64> {
        let (bound, j, name) = match self {
            Member::Above(j) => (of.xl[j], j, "lower"),
            Member::Below(j) => (of.xu[j], j, "upper"),
            _ => return Ok(0.0),
        };
        if bound.is_finite() {
            return Ok(bound);
        }
        Err(Error::Range(format!("a pair has the distance of variable {j} from its {name} bound, which is {bound}")))
    }
}

/// A box `l_j ≤ w_j ≤ u_j ⊥ c_i(w)`: the row is not negative where the variable is at its lower bound, not positive at the upper
/// one, and zero between them. Where both are equal any value of the row will do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Boxed {
    /// The variable.
    pub variable: usize,
    /// The row; its own bounds are not used.
    pub row: usize,
    /// The lower bound takes part, if it is finite. If it does not, it is a bound beside the box.
    pub lower: bool,
    /// The upper bound takes part, likewise.
    pub upper: bool,
}

impl Boxed {
    /// The box in which the finite bounds of a variable take part: a mixed complementarity problem has one for every variable.
    pub fn new(variable: usize, row: usize) -> Boxed {
        Boxed { variable, row, lower: true, upper: true }
    }

    /// Adds the pairs of the box to `members`, and sets the bounds of its row to what is left without them: zero from a side
    /// on which no bound takes part. Bounds of the variable that decide: which are finite, and whether they are equal.
    ///
    /// # Errors
    /// [`Error::Range`] if there is no such variable or row.
    pub fn write(&self, bounds: &mut Bounds, members: &mut Vec<(Member, Member)>) -> Result<()> {
        let Boxed { variable: j, row: i, .. } = *self;
        if j >= bounds.xl.len() || i >= bounds.cl.len() {
            let (n, m) = (bounds.xl.len(), bounds.cl.len());
            return Err(Error::Range(format!("a box of variable {j} and row {i}: the problem has {n} and {m}")));
        }
        let (l, u) = (bounds.xl[j], bounds.xu[j]);
        let (lower, upper) = (self.lower && l > -INFINITE, self.upper && u < INFINITE);
        let fixed = l == u;
        bounds.cl[i] = if fixed && upper { f64::NEG_INFINITY } else { 0.0 };
        bounds.cu[i] = if fixed && lower { f64::INFINITY } else { 0.0 };
        if lower && !fixed {
            members.push((Member::Above(j), Member::Row(i)));
        }
        if upper && !fixed {
            members.push((Member::Below(j), Member::Negative(i)));
        }
        Ok(())
    }
}

/// A variable `v` of a pair that stands for a member: `factor · (row or variable − zero) − v = 0`.
#[derive(Debug, Clone, Copy)]
struct Stand {
    member: Member,
    v: usize,
    zero: f64,
}

impl Stand {
    /// The value of the member where its row or variable has this one.
    fn value(&self, of: f64) -> f64 {
        self.member.factor() * (of - self.zero)
    }
}

/// A nonlinear program some of whose rows and variables form complementarity pairs.
///
/// Its first variables are those of the program, in which a variable that is used as a distance from a bound is that distance;
/// [`Lifted::point`], [`Lifted::bound_multipliers`] and [`Lifted::warm`] lead from one to the other.
pub struct Lifted<P> {
    inner: P,
    pairs: Vec<(usize, usize)>,
    /// Row and variable of every member that is a function, behind those that were given.
    lifts: Vec<(usize, usize)>,
    /// Members that are rows: `c_i = p − q`.
    rows: Vec<Stand>,
    /// Members that are variables in several pairs.
    copies: Vec<Stand>,
    /// Members that are variables and are used as they are.
    direct: Vec<Member>,
    /// `w = offset + factor · v` for the variables of the program by those of this one.
    offset: Vec<f64>,
    factor: Vec<f64>,
    /// Is one of them another?
    shifted: bool,
    n: usize,
    m: usize,
    jac: Pattern,
    jac_map: Vec<usize>,
    jac_factor: Vec<f64>,
    hess: Pattern,
    hess_factor: Vec<f64>,
    jac_values: Vec<f64>,
    w: Vec<f64>,
}

/// Rows and columns of a pattern.
fn entries(p: &Pattern, n: usize) -> (Vec<usize>, Vec<usize>) {
    let list = (0..n).flat_map(|j| p.rows(j).iter().map(move |i| (*i, j)));
    list.unzip()
}

impl<P: Nlp> Lifted<P> {
    /// Lifts what is no variable. Fails when an index does not exist or a row is used twice.
    pub fn new(inner: P, members: &[(Member, Member)]) -> Result<Lifted<P>> {
        let (n0, m) = (inner.n(), inner.m());
        // pairs that count a variable from below, and from above; whether one has a row from a side
        let (mut uses, mut taken) = (vec![[0, 0]; n0], vec![[false; 2]; m]);
        let side = |member: Member| usize::from(member.factor() < 0.0);
        for member in members.iter().flat_map(|m| [m.0, m.1]).filter(|m| !m.is_row()) {
            if let Some(used) = uses.get_mut(member.index()) {
                used[side(member)] += 1;
            }
        }
        // a variable is counted from one bound, the lower one if both are in a pair
        let as_it_is = |member: Member| match uses[member.index()] {
            [1, _] => side(member) == 0,
            [0, above] => above == 1,
            _ => false,
        };
        let (mut rows, mut copies, mut direct): (Vec<Stand>, Vec<Stand>, Vec<Member>) = Default::default();
        let mut next = n0;
        let mut place = |member: Member, k: usize| -> Result<usize> {
            let i = member.index();
            let list = if member.is_row() {
                if i >= m {
                    return Err(Error::Range(format!("pair {k} names row {i}, the problem has {m}")));
                }
                if std::mem::replace(&mut taken[i][side(member)], true) {
                    return Err(Error::Range(format!(
                        "row {i} is in two pairs: lift it to a variable and use that in both"
                    )));
                }
                &mut rows
            } else {
                if i >= n0 {
                    return Err(Error::Range(format!("pair {k} names variable {i}, the problem has {n0}")));
                }
                if as_it_is(member) {
                    direct.push(member);
                    return Ok(i);
                }
                &mut copies
            };
            list.push(Stand { member, v: next, zero: 0.0 });
            next += 1;
            Ok(next - 1)
        };
        let mut pairs = Vec::with_capacity(members.len());
        for (k, &(a, b)) in members.iter().enumerate() {
            let pair = (place(a, k)?, place(b, k)?);
            if a == b {
                return Err(Error::Range(format!("pair {k} pairs a variable with itself")));
            }
            pairs.push(pair);
        }
        let mut factor = vec![1.0; n0];
        for member in &direct {
            factor[member.index()] = member.factor();
        }
        let (n, m_all) = (next, m + copies.len());
        let (mut at_row, mut at_col) = entries(inner.jac_pattern(), n0);
        let nnz = at_row.len();
        let mut jac_factor: Vec<f64> = at_col.iter().map(|j| factor[*j]).collect();
        for r in &rows {
            at_row.push(r.member.index());
            at_col.push(r.v);
            jac_factor.push(-r.member.factor());
        }
        for (k, c) in copies.iter().enumerate() {
            let j = c.member.index();
            at_row.extend([m + k, m + k]);
            at_col.extend([c.v, j]);
            jac_factor.extend([-1.0, c.member.factor() * factor[j]]);
        }
        let (jac, jac_map) = Pattern::from_triplets(m_all, n, &at_row, &at_col);
        let (at_row, at_col) = entries(inner.hess_pattern(), n0);
        let hess_factor = at_row.iter().zip(&at_col).map(|(i, j)| factor[*i] * factor[*j]).collect();
        let (hess, _) = Pattern::from_triplets(n, n, &at_row, &at_col);
        let lifts = rows.iter().map(|r| (r.member.index(), r.v)).collect();
        Ok(Lifted {
            shifted: factor.iter().any(|f| *f != 1.0),
            offset: vec![0.0; n0],
            w: vec![0.0; n0],
            jac_values: vec![0.0; nnz],
            inner,
            pairs,
            lifts,
            rows,
            copies,
            direct,
            factor,
            n,
            m: m_all,
            jac,
            jac_map,
            jac_factor,
            hess,
            hess_factor,
        })
    }

    /// Tells of rows and variables of the program that are such already: rows `G(w) − v = 0` of variables `v` that are members
    /// ([`Mpcc::lifts`]).
    pub fn with_lifts(mut self, lifts: &[(usize, usize)]) -> Lifted<P> {
        self.lifts.splice(0..0, lifts.iter().copied());
        self
    }

    /// Bounds of the lifted problem from those of the original: members are non-negative, lifted rows become
    /// equalities. Distances are counted from these bounds from now on: call it before [`Lifted::start`] and before a solve.
    /// Fails when a member that is a variable may be negative only (`xu < 0`), or a bound that is counted from is infinite.
    pub fn bounds(&mut self, original: &Bounds) -> Result<Bounds> {
        let mut b = Bounds::free(self.n, self.m);
        let (n0, m0) = (original.xl.len(), original.cl.len());
        b.xl[..n0].copy_from_slice(&original.xl);
        b.xu[..n0].copy_from_slice(&original.xu);
        b.cl[..m0].copy_from_slice(&original.cl);
        b.cu[..m0].copy_from_slice(&original.cu);
        for r in &self.rows {
            (b.cl[r.member.index()], b.cu[r.member.index()]) = (0.0, 0.0);
        }
        for member in &self.direct {
            let (j, zero, factor) = (member.index(), member.zero(original)?, member.factor());
            self.offset[j] = zero;
            let (l, u) = (factor * (original.xl[j] - zero), factor * (original.xu[j] - zero));
            (b.xl[j], b.xu[j]) = if factor > 0.0 { (l, u) } else { (u, l) };
        }
        self.shifted = self.factor.iter().any(|f| *f != 1.0) || self.offset.iter().any(|o| *o != 0.0);
        for (k, c) in self.copies.iter_mut().enumerate() {
            c.zero = c.member.zero(original)?;
            // factor · (w − zero) − v = 0 with w = offset + ..., without its constants
            let at = -c.value(self.offset[c.member.index()]);
            (b.cl[m0 + k], b.cu[m0 + k]) = (at, at);
        }
        for &(x, y) in &self.pairs {
            for j in [x, y] {
                b.xl[j] = b.xl[j].max(0.0);
                if b.xu[j] < 0.0 {
                    return Err(Error::Range(format!(
                        "variable {j} is in a complementarity pair but has the upper bound {}",
                        b.xu[j]
                    )));
                }
                if b.xl[j] > 0.0 {
                    return Err(Error::Unsupported(format!(
                        "variable {j} is in a complementarity pair but has the lower bound {} > 0: the other member \
                         is zero, fix it instead",
                        b.xl[j]
                    )));
                }
            }
        }
        Ok(b)
    }

    /// Starting point `[n]` from one of the original problem.
    pub fn start(&mut self, x0: &[f64]) -> Vec<f64> {
        let mut w = vec![0.0; self.n];
        let mut c = vec![0.0; self.inner.m()];
        for ((v, x), (o, f)) in w.iter_mut().zip(x0).zip(self.offset.iter().zip(&self.factor)) {
            *v = f * (x - o);
        }
        if self.inner.eval(x0, &mut c).is_ok() {
            for r in &self.rows {
                w[r.v] = r.value(c[r.member.index()]).max(0.0);
            }
        }
        for c in &self.copies {
            w[c.v] = c.value(x0[c.member.index()]).max(0.0);
        }
        w
    }

    /// The variables of the program `[n0]` at a point of this one.
    pub fn point(&self, x: &[f64]) -> Vec<f64> {
        self.offset.iter().zip(&self.factor).zip(x).map(|((o, f), v)| o + f * v).collect()
    }

    /// The multipliers of the bounds of the program's variables `[n0]`, of those `z[n]` of this one: those of the distances
    /// of a variable count together.
    pub fn bound_multipliers(&self, z: &[f64]) -> Vec<f64> {
        let mut own: Vec<f64> = self.factor.iter().zip(z).map(|(f, z)| f * z).collect();
        for c in &self.copies {
            own[c.member.index()] += c.member.factor() * z[c.v];
        }
        own
    }

    /// A point of this problem with multipliers, `(x[n], y[m], z[n])`, of one of the program with those of its rows and bounds.
    pub fn warm(&mut self, x: &[f64], y: &[f64], z: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let start = self.start(x);
        let (mut to_y, mut to_z) = (y.to_vec(), vec![0.0; self.n]);
        to_y.resize(self.m, 0.0);
        for ((t, z), f) in to_z.iter_mut().zip(z).zip(&self.factor) {
            *t = f * z;
        }
        for r in &self.rows {
            // the row c − v = 0 has the multiplier of the constraint, and v takes it up
            to_z[r.v] = -r.member.factor() * y[r.member.index()];
        }
        // of the members that are one variable that closest to zero has its multiplier
        let mut holders: Vec<Option<(f64, Option<usize>)>> = vec![None; x.len()];
        for member in &self.direct {
            holders[member.index()] = Some((start[member.index()], None));
        }
        for (k, c) in self.copies.iter().enumerate() {
            let holder = &mut holders[c.member.index()];
            if holder.is_none_or(|(least, _)| start[c.v] < least) {
                *holder = Some((start[c.v], Some(k)));
            }
        }
        for (j, holder) in holders.into_iter().enumerate() {
            if let Some((_, Some(k))) = holder {
                let Stand { member, v, .. } = self.copies[k];
                to_z[j] = 0.0;
                to_z[v] = member.factor() * z[j];
                to_y[y.len() + k] = -to_z[v];
            }
        }
        (start, to_y, to_z)
    }

    /// Derivative of variable `j` of the program by that of this problem: 1, or −1 where it is counted from its upper bound.
    pub fn factor(&self, j: usize) -> f64 {
        self.factor[j]
    }

    /// A weight of the program's variables `[n0]` as one of this problem's `[n]`.
    pub fn weight(&self, of: &[f64]) -> Vec<f64> {
        let mut to = vec![0.0; self.n];
        to.iter_mut().zip(of).zip(&self.factor).for_each(|((to, w), f)| *to = f * w);
        to
    }

    /// Variables of this problem that are copies, in the order of their rows, which are the last ones.
    pub fn copies(&self) -> Vec<usize> {
        self.copies.iter().map(|c| c.v).collect()
    }

    /// Variables of the members of pair `k`, in the lifted numbering.
    pub fn pair(&self, k: usize) -> (usize, usize) {
        self.pairs[k]
    }

    /// The original problem.
    pub fn inner(&mut self) -> &mut P {
        &mut self.inner
    }
}

/// A point of the program in `w`, if its variables are counted from elsewhere.
fn own<'a>(shifted: bool, (offset, factor): (&[f64], &[f64]), x: &'a [f64], w: &'a mut [f64]) -> &'a [f64] {
    if !shifted {
        return &x[..w.len()];
    }
    for ((w, v), (o, f)) in w.iter_mut().zip(x).zip(offset.iter().zip(factor)) {
        *w = o + f * v;
    }
    w
}

impl<P: Nlp> Nlp for Lifted<P> {
    fn n(&self) -> usize {
        self.n
    }
    fn m(&self) -> usize {
        self.m
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        let (c, of_copies) = c.split_at_mut(self.m - self.copies.len());
        let w = own(self.shifted, (&self.offset, &self.factor), x, &mut self.w);
        let f = self.inner.eval(w, c)?;
        for r in &self.rows {
            c[r.member.index()] -= r.member.factor() * x[r.v];
        }
        for (c, copy) in of_copies.iter_mut().zip(&self.copies) {
            let j = copy.member.index();
            *c = copy.member.factor() * self.factor[j] * x[j] - x[copy.v];
        }
        Ok(f)
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let n0 = self.inner.n();
        grad[n0..].fill(0.0);
        let w = own(self.shifted, (&self.offset, &self.factor), x, &mut self.w);
        self.inner.derivatives(w, &mut grad[..n0], &mut self.jac_values)?;
        grad.iter_mut().zip(&self.factor).for_each(|(g, f)| *g *= f);
        for ((v, factor), &k) in self.jac_values.iter().zip(&self.jac_factor).zip(&self.jac_map) {
            jac[k] = v * factor;
        }
        let nnz = self.jac_values.len();
        for (factor, &k) in self.jac_factor[nnz..].iter().zip(&self.jac_map[nnz..]) {
            jac[k] = *factor;
        }
        Ok(())
    }
    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        let m0 = self.m - self.copies.len();
        let at = own(self.shifted, (&self.offset, &self.factor), x, &mut self.w);
        self.inner.hessian(at, w, &y[..m0], hess)?;
        hess.iter_mut().zip(&self.hess_factor).for_each(|(h, f)| *h *= f);
        Ok(())
    }
}

impl<P: Nlp> Mpcc for Lifted<P> {
    fn pairs(&self) -> &[(usize, usize)] {
        &self.pairs
    }
    fn lifts(&self) -> &[(usize, usize)] {
        &self.lifts
    }
}
