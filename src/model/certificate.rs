//! Proofs that some signs of switching functions never occur together.
//!
//! A combination `Σ y_s σ_s ψ_s` with factors `y ≥ 0`, not all zero, of switching functions with signs `σ_s` is positive
//! wherever all of them have these signs. Where it is at most zero for all inputs, there is no such point. That it is, is
//! checked in rational arithmetic on the coefficients of the model, with bounds of its terms that are facts.

use num_rational::BigRational;
use num_traits::{One, Signed, ToPrimitive, Zero};

use crate::expr::Id;

/// `constant + Σ coefficient · term`, with the number of each term.
#[derive(Debug, Clone)]
pub(super) struct Affine {
    pub(super) terms: Vec<(usize, BigRational)>,
    pub(super) constant: BigRational,
}

/// A term of switching functions, and the bounds it keeps.
#[derive(Debug, Clone)]
pub(super) struct Term {
    pub(super) id: Id,
    pub(super) low: Option<BigRational>,
    pub(super) high: Option<BigRational>,
}

/// Signs of switching functions that exclude each other, with the proof.
#[derive(Debug, Clone)]
pub(super) struct Conflict {
    /// Switching function, sign (true: positive), factor.
    pub(super) signs: Vec<(usize, bool, BigRational)>,
    /// The combination, which is nowhere positive.
    constant: BigRational,
    terms: Vec<(Id, BigRational)>,
    /// Bounds it needs: the term is at least (false), or at most (true), this.
    bounds: Vec<(Id, bool, BigRational)>,
}

impl Conflict {
    /// Checks a proof: `factors` of switching functions of these forms with these signs. None if it proves nothing.
    pub(super) fn verified(
        forms: &[Affine],
        terms: &[Term],
        signs: &[bool],
        factors: &[(usize, BigRational)],
    ) -> Option<Conflict> {
        let lead = factors.iter().find(|f| f.1.is_positive())?.1.clone();
        if factors.iter().any(|f| f.1.is_negative()) {
            return None;
        }
        let mut constant = BigRational::zero();
        let mut sums = vec![BigRational::zero(); terms.len()];
        let mut used = Vec::new();
        for (s, y) in factors.iter().filter(|f| !f.1.is_zero()) {
            let y = y / &lead;
            let signed = if signs[*s] { y.clone() } else { -y.clone() };
            constant += &signed * &forms[*s].constant;
            for (j, c) in &forms[*s].terms {
                sums[*j] += &signed * c;
            }
            used.push((*s, signs[*s], y));
        }
        let mut most = constant.clone();
        let (mut rest, mut bounds) = (Vec::new(), Vec::new());
        for (term, sum) in terms.iter().zip(sums).filter(|t| !t.1.is_zero()) {
            let upper = sum.is_positive();
            let bound = if upper { &term.high } else { &term.low };
            let bound = bound.as_ref()?;
            most += &sum * bound;
            bounds.push((term.id, upper, bound.clone()));
            rest.push((term.id, sum));
        }
        (!most.is_positive()).then_some(Conflict { signs: used, constant, terms: rest, bounds })
    }

    /// Does it exclude these signs?
    pub(super) fn excludes(&self, signs: &[bool]) -> bool {
        self.signs.iter().all(|(s, sign, _)| signs.get(*s) == Some(sign))
    }

    /// The bounds the proof needs, as text; empty if it needs none.
    pub(super) fn bounds_text(&self, name: &dyn Fn(Id) -> String) -> String {
        let one = |(id, upper, v): &(Id, bool, BigRational)| {
            format!("{} {} {}", name(*id), if *upper { "<=" } else { ">=" }, number(v))
        };
        self.bounds.iter().map(one).collect::<Vec<_>>().join(", ")
    }

    /// The proof as text.
    pub(super) fn text(&self, psi: &dyn Fn(usize) -> String, name: &dyn Fn(Id) -> String) -> String {
        let signs = self.signs.iter().map(|(s, sign, _)| format!("{} {} 0", psi(*s), if *sign { ">" } else { "<" }));
        let mut left = String::new();
        for (s, sign, y) in &self.signs {
            let signed = if *sign { y.clone() } else { -y.clone() };
            add_to(&mut left, &signed, &format!("({})", psi(*s)));
        }
        let mut right = if self.constant.is_zero() { String::new() } else { number(&self.constant) };
        for (id, c) in &self.terms {
            add_to(&mut right, c, &name(*id));
        }
        if right.is_empty() {
            right.push('0');
        }
        let since = self.bounds_text(name);
        let since = if since.is_empty() { since } else { format!(", since {since}") };
        let signs = signs.collect::<Vec<_>>().join(" and ");
        format!("not {signs}, because {left} = {right} is never positive{since}")
    }
}

/// Appends `± |c| what` to a sum.
fn add_to(sum: &mut String, c: &BigRational, what: &str) {
    let sign = match (sum.is_empty(), c.is_negative()) {
        (true, true) => "-",
        (true, false) => "",
        (false, true) => " - ",
        (false, false) => " + ",
    };
    let size = c.abs();
    let factor = if size.is_one() { String::new() } else { format!("{}*", number(&size)) };
    sum.push_str(&format!("{sign}{factor}{what}"));
}

fn number(v: &BigRational) -> String {
    let v = v.to_f64().unwrap_or(f64::NAN);
    // as many digits as are needed, without hundreds of zeros
    if v != 0.0 && !(1e-5..1e16).contains(&v.abs()) {
        format!("{v:e}")
    } else {
        format!("{v}")
    }
}
