//! Which sign patterns of switching functions occur at all.
//!
//! Each switching function is an affine combination of terms; terms that are not affine are taken as free variables
//! within the bounds interval arithmetic gives them (`x² ≥ 0`). A pattern without a solution of that relaxation has
//! none at all. By the theorem of Motzkin there is either a point with the signs, or a combination of the switching
//! functions that is nowhere positive though the signs say it is.
//!
//! A linear program in floating point, equilibrated so that units do not matter, proposes the one or the other; what it
//! proposes is checked in rational arithmetic on the coefficients of the model, and where the check fails the linear
//! program is solved in rational arithmetic. A pattern is left out with a [`Conflict`] that was verified, never else.

use std::cell::Cell;
use std::cmp::Ordering;
use std::collections::BTreeMap;

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, Signed, ToPrimitive, Zero};

use super::bounds::Bounds;
use super::certificate::{Affine, Conflict, Term};
use super::simplex::{alternative, Alternative};
use crate::error::Result;
use crate::expr::exact::{exact, magnitude, shifted_f64};
use crate::expr::{Dag, Id};
use crate::stop;

/// Entries of a linear program that is solved in rational arithmetic where floating point leaves a doubt: a second of
/// work at most. Patterns of larger ones stay, which costs cells and is never wrong.
const MAX_EXACT: usize = 4000;

/// Maximum number of linear programs in rational arithmetic for the forms of choices inside of choices, and up to how many forms there
/// is none. Such forms meet in more than general position, which leaves a doubt in thousands of linear programs, and their coefficients
/// are long.
const MOST_EXACT: usize = 24;
const FEW_FORMS: usize = 16;

/// From so many switching functions on those of one quantity are ordered by where they vanish before any linear program is asked.
const ORDERED: usize = 24;
/// Proofs that are kept of what that order excludes: as many as anyone reads.
const PROOFS: usize = 32;

/// What is known of a sign pattern.
pub(super) enum Decision {
    /// It occurs in the relaxation: values of the terms with these signs.
    Point(Vec<BigRational>),
    /// It does not occur.
    Never(Conflict),
    /// Not decided: it stays.
    Open,
}

/// Patterns that can occur, and the proofs that others cannot.
pub(super) struct Patterns {
    /// In the order of binary numbers, positive first.
    pub(super) all: Vec<Vec<bool>>,
    pub(super) conflicts: Vec<Conflict>,
}

/// A switching function as a multiple of a form `L`, but for a constant.
#[derive(Debug, Clone, Copy)]
struct Parallel {
    /// Which form.
    form: usize,
    /// Positive where the form is large?
    rises: bool,
    /// Place of its zero among the zeros of all multiples of the form, in the order of the values of the form.
    place: usize,
}

/// Between which zeros a form lies: places of the zeros, and the switching functions that say so.
#[derive(Debug, Clone, Copy, Default)]
struct Between {
    above: Option<(usize, usize)>,
    below: Option<(usize, usize)>,
}

impl Between {
    /// The sign that a multiple of the form has for certain, and the function from which that follows.
    fn implied(&self, p: Parallel) -> Option<(bool, usize)> {
        match (self.above, self.below) {
            (Some((place, j)), _) if place >= p.place => Some((p.rises, j)),
            (_, Some((place, j))) if place <= p.place => Some((!p.rises, j)),
            _ => None,
        }
    }

    /// Takes note of the sign `s` of function `k`.
    fn note(&mut self, s: bool, k: usize, p: Parallel) {
        if s == p.rises {
            self.above = self.above.filter(|a| a.0 >= p.place).or(Some((p.place, k)));
        } else {
            self.below = self.below.filter(|b| b.0 <= p.place).or(Some((p.place, k)));
        }
    }
}

/// Signs of the first switching functions.
#[derive(Clone)]
struct Begun {
    signs: Vec<bool>,
    /// Values of the terms with these signs, where they are known.
    point: Option<Vec<BigRational>>,
    between: Vec<Between>,
}

impl Begun {
    /// With the sign `s` of function `k` behind the others.
    fn with(mut self, s: bool, k: usize, p: Option<Parallel>) -> Begun {
        self.signs.push(s);
        if let Some(p) = p {
            self.between[p.form].note(s, k, p);
        }
        self
    }

    /// The functions whose signs imply those of all others: of the multiples of a form the two between whose zeros it lies.
    fn binding(&self, parallels: &[Option<Parallel>]) -> Vec<usize> {
        let binds = |&k: &usize| {
            parallels[k].is_none_or(|p| {
                let Between { above, below } = self.between[p.form];
                above.is_some_and(|a| a.1 == k) || below.is_some_and(|b| b.1 == k)
            })
        };
        (0..self.signs.len()).filter(binds).collect()
    }
}

/// The relaxation of some switching functions.
pub(super) struct Reach {
    terms: Vec<Term>,
    forms: Vec<Affine>,
    /// Constants and coefficients of the forms but for rounding.
    near: Vec<(f64, Vec<f64>)>,
    scaled: Scaled,
    /// Linear programs that may still be solved in rational arithmetic.
    exact_left: Cell<usize>,
}

/// The columns of the linear program in floating point, with entries up to one: rows and columns are multiplied by
/// powers of two so that their entries are of one size.
struct Scaled {
    /// Of the switching functions with positive sign, then of the bounds and the constant.
    switches: Vec<Vec<f64>>,
    rest: Vec<(Vec<f64>, bool)>,
    /// Term of every column of `rest` but the last, and whether it is the upper bound.
    bounded: Vec<(usize, bool)>,
    /// Powers of two the terms were divided by, last that of the constant.
    powers: Vec<i64>,
}

impl Reach {
    /// For these switching functions, with the bounds of everything they consist of.
    pub(super) fn new(dag: &Dag, bounds: &Bounds, psi: &[Id]) -> Reach {
        let split: Vec<(BigRational, Vec<(Id, BigRational)>)> = psi.iter().map(|&p| dag.affine_terms(p)).collect();
        let mut ids: Vec<Id> = split.iter().flat_map(|f| f.1.iter().map(|t| t.0)).collect();
        ids.sort_unstable();
        ids.dedup();
        let place = |id: Id| ids.binary_search(&id).unwrap_or_default();
        let forms: Vec<Affine> = split
            .into_iter()
            .map(|(constant, terms)| Affine {
                terms: terms.into_iter().map(|(id, c)| (place(id), c)).collect(),
                constant,
            })
            .collect();
        let term = |&id: &Id| {
            let b = bounds.get(id);
            Term { id, low: exact(b.low), high: exact(b.high) }
        };
        let terms: Vec<Term> = ids.iter().map(term).collect();
        let scaled = Scaled::new(&forms, &terms);
        let near = |f: &Affine| (near(&f.constant), f.terms.iter().map(|t| self::near(&t.1)).collect());
        let near = forms.iter().map(near).collect();
        Reach { terms, forms, near, scaled, exact_left: Cell::new(usize::MAX) }
    }

    /// Can the first switching functions have these signs (`true`: positive) on an open set?
    pub(super) fn decide(&self, signs: &[bool]) -> Decision {
        self.decide_by(signs, &(0..signs.len()).collect::<Vec<usize>>())
    }

    /// The same where the signs of the functions `binding`, ascending, imply all others.
    fn decide_by(&self, signs: &[bool], binding: &[usize]) -> Decision {
        let m = self.terms.len() + 1;
        let columns = self.scaled.columns(signs, binding);
        let proposed = match alternative(&columns, m, 20 * (m + columns.len())) {
            Some(Alternative::Combination(y)) => {
                let mut all = vec![0.0; signs.len()];
                binding.iter().zip(&y).for_each(|(&k, v)| all[k] = *v);
                all.extend_from_slice(&y[binding.len()..]);
                self.prove(signs, &all).map(Decision::Never)
            }
            Some(Alternative::Separation(v)) => self.point(signs, self.scaled.point(&v)).map(Decision::Point),
            None => None,
        };
        proposed.unwrap_or_else(|| self.decide_exactly(signs))
    }

    /// Values of the terms within their bounds, if they give these signs.
    fn point(&self, signs: &[bool], mut at: Vec<BigRational>) -> Option<Vec<BigRational>> {
        for (v, term) in at.iter_mut().zip(&self.terms) {
            match (&term.low, &term.high) {
                (Some(low), _) if *v < *low => v.clone_from(low),
                (_, Some(high)) if *v > *high => v.clone_from(high),
                _ => {}
            }
        }
        let near = rounded(&at);
        let holds =
            |(k, &s): (usize, &bool)| self.sign(k, &at, &near) == if s { Ordering::Greater } else { Ordering::Less };
        signs.iter().enumerate().all(holds).then_some(at)
    }

    /// Sign of switching function `k` where its terms have the values `at`, which are `near` but for rounding. Floating point decides
    /// where rounding cannot change the sign, rational arithmetic elsewhere.
    fn sign(&self, k: usize, at: &[BigRational], near: &[f64]) -> Ordering {
        /// Far more than the rounding of coefficients, values and the sum of a few thousand terms.
        const DOUBT: f64 = 1e-11;
        let (constant, coefficients) = &self.near[k];
        let (mut sum, mut size) = (*constant, constant.abs());
        for ((j, _), c) in self.forms[k].terms.iter().zip(coefficients) {
            // what is not as precise as its exponent allows has the sum of a NaN
            let v = c * near[*j];
            sum += if v == 0.0 || v.is_normal() { v } else { f64::NAN };
            size += v.abs();
        }
        if sum.abs() > DOUBT * size && coefficients.len() < 4000 {
            return if sum > 0.0 { Ordering::Greater } else { Ordering::Less };
        }
        let zero = BigRational::zero();
        self.value(k, at).cmp(&zero)
    }

    /// Switching function `k` where its terms have these values.
    fn value(&self, k: usize, at: &[BigRational]) -> BigRational {
        let form = &self.forms[k];
        form.terms.iter().fold(form.constant.clone(), |sum, (j, c)| sum + c * &at[*j])
    }

    /// The exact factors of a combination that floating point proposes: those that make all terms vanish which no
    /// bound is used of.
    fn prove(&self, signs: &[bool], y: &[f64]) -> Option<Conflict> {
        let k = signs.len();
        let most = y.iter().fold(0.0f64, |m, v| m.max(*v));
        let counts = |v: f64| v > 1e-9 * most;
        let support: Vec<usize> = (0..k).filter(|&s| counts(y[s])).collect();
        // the bounds the combination uses
        let mut used: Vec<Option<&BigRational>> = vec![None; self.terms.len()];
        for (&(j, upper), _) in self.scaled.bounded.iter().zip(&y[k..]).filter(|b| counts(*b.1)) {
            used[j] = if upper { self.terms[j].high.as_ref() } else { self.terms[j].low.as_ref() };
        }
        let signed = |s: usize, c: BigRational| if signs[s] { c } else { -c };
        let mut equations = vec![vec![BigRational::zero(); support.len()]; self.terms.len()];
        for (i, &s) in support.iter().enumerate() {
            for (j, c) in self.forms[s].terms.iter().filter(|t| used[t.0].is_none()) {
                equations[*j][i] = signed(s, c.clone());
            }
        }
        // without weight on the constant the combination is zero where the terms are at these bounds
        if !counts(*y.last()?) {
            let at_bounds = |&s: &usize| {
                let form = &self.forms[s];
                let at = form.terms.iter().filter_map(|(j, c)| used[*j].map(|b| c * b));
                signed(s, at.fold(form.constant.clone(), |sum, v| sum + v))
            };
            equations.push(support.iter().map(at_bounds).collect());
        }
        let factors = kernel(equations, support.len())?;
        let factors: Vec<(usize, BigRational)> = support.into_iter().zip(factors).collect();
        Conflict::verified(&self.forms, &self.terms, signs, &factors)
    }

    /// The proof that the signs of two multiples of one form exclude each other: the combination without that form.
    fn prove_order(&self, j: usize, k: usize, signs: &[bool]) -> Option<Conflict> {
        let lead = |f: usize| self.forms[f].terms.first().map(|t| t.1.abs());
        let factors = [(j, lead(k)?), (k, lead(j)?)];
        Conflict::verified(&self.forms, &self.terms, signs, &factors)
    }

    /// The linear program in rational arithmetic.
    fn decide_exactly(&self, signs: &[bool]) -> Decision {
        let n = self.terms.len();
        let unit = |j: usize, v: BigRational, constant: BigRational| {
            let mut column = vec![BigRational::zero(); n + 1];
            column[j] = v;
            column[n] = constant;
            column
        };
        let mut columns = Vec::new();
        for (form, &s) in self.forms.iter().zip(signs) {
            let sign = |v: &BigRational| if s { v.clone() } else { -v };
            let mut column = unit(n, BigRational::zero(), sign(&form.constant));
            for (j, c) in &form.terms {
                column[*j] = sign(c);
            }
            columns.push((column, true));
        }
        for (j, term) in self.terms.iter().enumerate() {
            columns.extend(term.low.as_ref().map(|low| (unit(j, BigRational::one(), -low), false)));
            columns.extend(term.high.as_ref().map(|high| (unit(j, -BigRational::one(), high.clone()), false)));
        }
        columns.push((unit(n, BigRational::zero(), BigRational::one()), true));
        if (columns.len() + n) * n > MAX_EXACT || self.exact_left.get() == 0 {
            return Decision::Open;
        }
        self.exact_left.set(self.exact_left.get() - 1);
        match alternative(&columns, n + 1, 1000) {
            Some(Alternative::Combination(y)) => {
                let factors: Vec<(usize, BigRational)> = y.into_iter().take(signs.len()).enumerate().collect();
                let proof = Conflict::verified(&self.forms, &self.terms, signs, &factors);
                proof.map_or(Decision::Open, Decision::Never)
            }
            Some(Alternative::Separation(v)) => {
                let at = v[..n].iter().map(|w| w / &v[n]).collect();
                self.point(signs, at).map_or(Decision::Open, Decision::Point)
            }
            None => Decision::Open,
        }
    }

    /// The switching functions that are multiples of one form `L` but for a constant, where there are several: which form, whether the
    /// function rises with it, and the place of its zero among the zeros of these functions.
    fn parallels(&self) -> Vec<Option<Parallel>> {
        // the function, whether it rises with the form, the value of the form at its zero
        type Multiple = (usize, bool, BigRational);
        let mut groups: BTreeMap<Vec<(usize, BigRational)>, Vec<Multiple>> = BTreeMap::new();
        for (k, form) in self.forms.iter().enumerate() {
            let Some(lead) = form.terms.first().map(|t| t.1.clone()).filter(|c| !c.is_zero()) else { continue };
            let key = form.terms.iter().map(|(j, c)| (*j, c / &lead)).collect();
            groups.entry(key).or_default().push((k, lead.is_positive(), -&form.constant / &lead));
        }
        let mut out = vec![None; self.forms.len()];
        for (form, mut group) in groups.into_values().filter(|g| g.len() > 1).enumerate() {
            group.sort_by(|a, b| a.2.cmp(&b.2));
            let mut place = 0;
            for i in 0..group.len() {
                place += usize::from(i > 0 && group[i].2 != group[i - 1].2);
                out[group[i].0] = Some(Parallel { form, rises: group[i].1, place });
            }
        }
        out
    }

    /// Linear programs that are worth solving in search of at most `limit` patterns. Where planes in general position have far more
    /// patterns than that, as a rule these have too, and it does not take long to see; least of all for the forms of choices inside of
    /// choices (`nested`), whose linear programs are the most expensive ([`MOST_EXACT`]).
    fn patience(&self, limit: usize, nested: bool) -> usize {
        let (n, d) = (self.forms.len(), self.terms.len());
        let (mut expected, mut binomial) = (1.0f64, 1.0f64);
        for k in 1..=d.min(n) {
            binomial *= (n + 1 - k) as f64 / k as f64;
            expected += binomial;
        }
        if nested && expected > limit as f64 {
            limit / 32
        } else if expected > 16.0 * limit as f64 {
            limit / 4
        } else {
            4 * limit
        }
    }

    /// All patterns that can occur; `None` if there are more than `limit`, or it takes too long to find them. `nested` says that the
    /// functions come from choices inside of choices.
    pub(super) fn patterns(&self, limit: usize, nested: bool) -> Result<Option<Patterns>> {
        let mut patience = self.patience(limit, nested);
        self.exact_left.set(if nested && self.forms.len() > FEW_FORMS { MOST_EXACT } else { usize::MAX });
        let mut out = Patterns { all: Vec::new(), conflicts: Vec::new() };
        let parallels = if self.forms.len() < ORDERED { vec![None; self.forms.len()] } else { self.parallels() };
        let n_forms = parallels.iter().flatten().map(|p| p.form + 1).max().unwrap_or(0);
        let mut stack = vec![Begun { signs: Vec::new(), point: None, between: vec![Between::default(); n_forms] }];
        while let Some(begun) = stack.pop() {
            stop::check()?;
            let k = begun.signs.len();
            if k == self.forms.len() {
                out.all.push(begun.signs);
                continue;
            }
            if let Some((s, j)) = parallels[k].and_then(|p| begun.between[p.form].implied(p)) {
                if out.conflicts.len() < PROOFS {
                    let mut excluded = begun.signs.clone();
                    excluded.push(!s);
                    out.conflicts.extend(self.prove_order(j, k, &excluded));
                }
                stack.push(begun.with(s, k, parallels[k]));
                continue;
            }
            // the sign that the next one has at a point where those before have theirs needs no search
            let here = begun.point.as_ref().map(|p| self.sign(k, p, &rounded(p)));
            for s in [false, true] {
                let next = begun.clone().with(s, k, parallels[k]);
                if here == Some(if s { Ordering::Greater } else { Ordering::Less }) {
                    stack.push(next);
                    continue;
                }
                if out.conflicts.iter().any(|c| c.excludes(&next.signs)) {
                    continue;
                }
                if patience == 0 || self.exact_left.get() == 0 {
                    return Ok(None);
                }
                patience -= 1;
                match self.decide_by(&next.signs, &next.binding(&parallels)) {
                    Decision::Point(p) => stack.push(Begun { point: Some(p), ..next }),
                    Decision::Open => stack.push(Begun { point: None, ..next }),
                    Decision::Never(c) => out.conflicts.push(c),
                }
            }
            // each of those still open has a pattern at least
            if out.all.len() + stack.len() > limit {
                return Ok(None);
            }
        }
        Ok(Some(out))
    }
}

/// A number but for rounding; NaN where it is too large or too small for that.
fn near(v: &BigRational) -> f64 {
    v.to_f64().filter(|f| f.is_normal() || v.is_zero()).unwrap_or(f64::NAN)
}

fn rounded(at: &[BigRational]) -> Vec<f64> {
    at.iter().map(near).collect()
}

/// The vector with `A y = 0`, if there is one direction only and no entry has another sign than the others.
fn kernel(mut rows: Vec<Vec<BigRational>>, n: usize) -> Option<Vec<BigRational>> {
    let mut pivots: Vec<usize> = Vec::new();
    let mut free = None;
    for j in 0..n {
        let r = pivots.len();
        let Some(p) = (r..rows.len()).find(|&i| !rows[i][j].is_zero()) else {
            if free.replace(j).is_some() {
                return None;
            }
            continue;
        };
        rows.swap(r, p);
        let pivot = rows[r][j].clone();
        rows[r].iter_mut().for_each(|v| *v /= &pivot);
        let row = rows[r].clone();
        for (i, other) in rows.iter_mut().enumerate() {
            if i != r && !other[j].is_zero() {
                let f = other[j].clone();
                other.iter_mut().zip(&row).filter(|v| !v.1.is_zero()).for_each(|(v, p)| *v -= &f * p);
            }
        }
        pivots.push(j);
    }
    let free = free?;
    let mut y = vec![BigRational::zero(); n];
    y[free] = BigRational::one();
    for (row, &j) in rows.iter().zip(&pivots) {
        y[j] = -&row[free];
    }
    y.iter().all(|v| !v.is_negative()).then_some(y)
}

impl Scaled {
    fn new(forms: &[Affine], terms: &[Term]) -> Scaled {
        let n = terms.len();
        let one = BigRational::one();
        // rows of the system: entries with their places, the constant at place n
        let mut rows: Vec<Vec<(usize, &BigRational)>> = Vec::new();
        for f in forms {
            rows.push(f.terms.iter().map(|(j, c)| (*j, c)).chain([(n, &f.constant)]).collect());
        }
        let mut bounded = Vec::new();
        for (j, t) in terms.iter().enumerate() {
            for (bound, upper) in [(&t.low, false), (&t.high, true)] {
                if let Some(b) = bound {
                    rows.push(vec![(j, &one), (n, b)]);
                    bounded.push((j, upper));
                }
            }
        }
        let sizes: Vec<Vec<(usize, i64)>> =
            rows.iter().map(|r| r.iter().filter_map(|(j, c)| Some((*j, magnitude(c)?))).collect()).collect();
        let powers = equilibrated(&sizes, n + 1);
        let dense = |row: &[(usize, &BigRational)], sizes: &[(usize, i64)]| {
            let most = sizes.iter().map(|(j, e)| e + powers[*j]).max().unwrap_or(0);
            let mut out = vec![0.0; n + 1];
            for (j, c) in row {
                out[*j] = shifted_f64(c, powers[*j] - most);
            }
            out
        };
        let mut all: Vec<Vec<f64>> = rows.iter().zip(&sizes).map(|(r, s)| dense(r, s)).collect();
        let mut rest: Vec<(Vec<f64>, bool)> = all.split_off(forms.len()).into_iter().map(|r| (r, false)).collect();
        // low: t − low ≥ 0, high: high − t ≥ 0
        for ((row, _), &(j, upper)) in rest.iter_mut().zip(&bounded) {
            let flipped = if upper { j } else { n };
            row[flipped] = -row[flipped];
        }
        let mut constant = vec![0.0; n + 1];
        constant[n] = 1.0;
        rest.push((constant, true));
        Scaled { switches: all, rest, bounded, powers }
    }

    fn columns(&self, signs: &[bool], binding: &[usize]) -> Vec<(Vec<f64>, bool)> {
        let signed = |&k: &usize| (self.switches[k].iter().map(|v| if signs[k] { *v } else { -v }).collect(), true);
        binding.iter().map(signed).chain(self.rest.iter().cloned()).collect()
    }

    /// Values of the terms of a direction.
    fn point(&self, v: &[f64]) -> Vec<BigRational> {
        let n = v.len() - 1;
        let last = v[n];
        let value = |(j, w): (usize, &f64)| {
            let q = exact(w / last).unwrap_or_else(BigRational::zero);
            let power = self.powers[j] - self.powers[n];
            let factor = BigRational::from_integer(BigInt::one() << power.unsigned_abs() as usize);
            if power >= 0 {
                q * factor
            } else {
                q / factor
            }
        };
        v[..n].iter().enumerate().map(value).collect()
    }
}

/// Powers of two for the columns of a matrix with entries of these sizes (place, power of two): after dividing the rows
/// by their mean size too, entries are of size one in the mean (Curtis and Reid's scaling by a few sweeps).
fn equilibrated(rows: &[Vec<(usize, i64)>], n: usize) -> Vec<i64> {
    let mut powers = vec![0i64; n];
    for _ in 0..4 {
        let (mut sums, mut counts) = (vec![0i64; n], vec![0i64; n]);
        for row in rows.iter().filter(|r| !r.is_empty()) {
            let mean = row.iter().map(|(j, e)| e + powers[*j]).sum::<i64>() / row.len() as i64;
            for (j, e) in row {
                sums[*j] += e - mean;
                counts[*j] += 1;
            }
        }
        for (p, (s, c)) in powers.iter_mut().zip(sums.iter().zip(&counts)) {
            *p = if *c > 0 { -s / c } else { 0 };
        }
    }
    powers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::{Expr, Graph};

    fn reach(g: &Graph, psi: &[Expr]) -> Reach {
        let ids = g.ids(psi);
        let dag = g.dag();
        Reach::new(&dag, &Bounds::new(&dag, &ids), &ids)
    }

    fn patterns(g: &Graph, psi: &[Expr]) -> Vec<String> {
        let all = reach(g, psi).patterns(1000, false).unwrap().unwrap().all;
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
        // nothing is said of what is close to a bound
        assert_eq!(patterns(&g, &[x.atan() - std::f64::consts::FRAC_PI_2]).len(), 2);
        assert_eq!(patterns(&g, &[x.sin() - 1.0f64.next_down()]).len(), 2);
    }

    #[test]
    fn large_and_small_numbers_are_numbers() {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        for k in [1e11, 1e12, 1e60, 1e300] {
            for psi in [x - k, x * 1e-6 - k, x.powi(3) - k, x.powi(4) - k, x * x + y * y - k, x.exp() * k - 1.0] {
                assert_eq!(patterns(&g, &[psi]), ["+", "-"], "{psi:?}");
            }
            assert_eq!(patterns(&g, &[x.sin() - k]), ["-"]);
            assert_eq!(patterns(&g, &[x * x + k]), ["+"]);
            assert_eq!(patterns(&g, &[x - k, x + k, x - 2.0 * k, x * 3.0 + 7.0 * k]).len(), 5);
            assert_eq!(patterns(&g, &[x - k, x - k.next_up()]), ["++", "+-", "--"]);
            assert_eq!(patterns(&g, &[x * k - 1.0, y - x * k]).len(), 4);
        }
    }

    #[test]
    fn general_position() {
        // n lines in the plane through different points: 1 + n + n(n−1)/2 cells, whatever the units.
        for (a, b) in [(1.0, 1.0), (1e12, 1e-12), (1e-12, 1e-9), (1e100, 1e-100)] {
            let g = Graph::new();
            let (x, y) = (g.x(0) * a, g.x(1) * b);
            for n in 1..=6usize {
                let lines: Vec<Expr> = (0..n)
                    .map(|k| {
                        let a = 0.3 + k as f64;
                        (x * a.cos() + y * a.sin() - 0.1 * (k * k) as f64 - 0.2) * 10f64.powi(5 * k as i32)
                    })
                    .collect();
                assert_eq!(patterns(&g, &lines).len(), 1 + n + n * (n - 1) / 2);
            }
        }
    }

    /// Three lines through one point have six cells; a triangle of the size of rounding has seven.
    #[test]
    fn a_cell_as_small_as_rounding_is_a_cell() {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        assert_eq!(patterns(&g, &[x - 1.0, y - 1.0, x + y - 2.0]).len(), 6);
        assert_eq!(patterns(&g, &[x - 1.0, y - 1.0, x + y - 2.0f64.next_up()]).len(), 7);
        assert_eq!(patterns(&g, &[x - 1.0, y - 1.0, x + y - 2.0f64.next_down()]).len(), 7);
    }

    #[test]
    fn proofs_can_be_read() {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let psi = [x - 1.0, x * 2.0 + 2.0, -(y * y) - 0.5];
        let found = reach(&g, &psi).patterns(100, false).unwrap().unwrap();
        let dag = g.dag();
        let text = |c: &Conflict| c.text(&|s| dag.text(psi[s].id()), &|id| dag.text(id));
        let texts: Vec<String> = found.conflicts.iter().map(text).collect();
        assert_eq!(
            texts,
            [
                "not x[0] - 1 > 0 and 2*x[0] + 2 < 0, because (x[0] - 1) - 0.5*(2*x[0] + 2) = -2 is never positive",
                "not -0.5 - x[1]^2 > 0, because (-0.5 - x[1]^2) = -0.5 - x[1]^2 is never positive, since x[1]^2 >= 0",
            ]
        );
    }

    #[test]
    fn too_many_are_refused() {
        let g = Graph::new();
        let many: Vec<Expr> = (0..40).map(|k| g.x(k)).collect();
        assert!(reach(&g, &many).patterns(100, false).unwrap().is_none());
    }
}
