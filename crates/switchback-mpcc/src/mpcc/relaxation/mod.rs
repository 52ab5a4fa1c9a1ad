//! Replacements of `0 ≤ a ⊥ b ≥ 0` in the nonlinear programs of the homotopy.
//!
//! A [`Strategy`] says which rows a pair has, their functions of `(a, b; σ)` with first and second derivatives, which
//! terms the objective gets, and which variables are added. `σ` has one meaning for all: `a = b = √σ` is where the
//! diagonal meets the boundary of the relaxed set (or the smoothed curve), so that one schedule serves every strategy;
//! for penalties `σ = 1/ρ`. Limit points: Nurkanović, Table 2.1; functions: sections 2.4.2 and 2.4.3.

mod local;
mod penalty;
mod products;
mod smoothed;

use crate::settings::Relaxation;

/// Value, gradient and Hessian of a function of the two members of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Jet {
    /// Value.
    pub v: f64,
    /// Derivatives in `a` and `b`.
    pub d: (f64, f64),
    /// Second derivatives: `aa`, `ab`, `bb`.
    pub dd: (f64, f64, f64),
}

impl Jet {
    /// `(a + s)(b + s) − c`.
    fn product(a: f64, b: f64, s: f64, c: f64) -> Jet {
        Jet { v: (a + s) * (b + s) - c, d: (b + s, a + s), dd: (0.0, 1.0, 0.0) }
    }

    /// `da a + db b + c`.
    fn linear(a: f64, b: f64, d: (f64, f64), c: f64) -> Jet {
        Jet { v: d.0 * a + d.1 * b + c, d, dd: (0.0, 0.0, 0.0) }
    }
}

/// A row every pair has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
    /// True where its Hessian is that of the product `a b`.
    pub product: bool,
    /// True where the elastic variable of the pair is subtracted.
    pub elastic: bool,
}

impl Row {
    const AT_MOST: Row = Row { lower: f64::NEG_INFINITY, upper: 0.0, product: false, elastic: false };
    const AT_LEAST: Row = Row { lower: 0.0, upper: f64::INFINITY, product: false, elastic: false };
    const EQUAL: Row = Row { lower: 0.0, upper: 0.0, product: false, elastic: false };

    const fn product(self) -> Row {
        Row { product: true, ..self }
    }
    const fn elastic(self) -> Row {
        Row { elastic: true, ..self }
    }
}

/// How far a pair is relaxed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Softness {
    /// Relaxation.
    pub sigma: f64,
    /// `√σ`.
    pub root: f64,
    /// Numbers of this pair alone: lower bounds of `a` and `b`, bound of the product. Zero where a strategy has none.
    pub own: [f64; 3],
}

impl Softness {
    /// One softness for all pairs.
    pub fn new(sigma: f64) -> Softness {
        Softness { sigma, root: sigma.sqrt(), own: [0.0; 3] }
    }
}

/// Place of `σ`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SigmaIn {
    /// The upper bound of the first row: functions do not depend on it.
    Bound,
    /// The functions of the rows, or the objective.
    Functions,
    /// Nowhere.
    None,
}

/// Variables that are added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Elastic {
    /// None.
    None,
    /// One for all pairs.
    Common,
    /// One per pair.
    Each,
}

/// Sequences of problems, one of which belongs to a strategy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sequence {
    /// `σ` falls by its schedule.
    Relaxation,
    /// `σ = 1/ρ` falls when the pairs stay open.
    Penalty,
    /// `σ` is this multiple of the barrier parameter.
    Barrier(f64),
}

/// Multipliers and values of a pair, for strategies with parameters per pair.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seen {
    /// The members.
    pub x: (f64, f64),
    /// Their multipliers `ν`, `ξ`, (2.31).
    pub nu: (f64, f64),
}

/// A relaxation or penalty. Functions depend on the members of one pair only.
pub trait Strategy: Sync {
    /// Rows of a pair.
    fn rows(&self) -> &'static [Row];
    /// Function of row `i`, without elastic variable and `σ` of [`SigmaIn::Bound`].
    fn jet(&self, i: usize, a: f64, b: f64, q: &Softness) -> Jet;
    /// Place of `σ`.
    fn sigma_in(&self) -> SigmaIn {
        SigmaIn::Functions
    }
    /// True where rows have other second derivatives than `∂²/∂a∂b`.
    fn curved(&self) -> bool {
        false
    }
    /// True where the first rows of the pairs are added up, group by group (in all, where pairs form no groups).
    fn lumped(&self) -> bool {
        false
    }
    /// Lower bound of the members when `σ` starts at `sigma`.
    fn lower(&self, _sigma: f64) -> f64 {
        0.0
    }
    /// Variables that are added; all have the bounds `[0, 10]`.
    fn elastic(&self) -> Elastic {
        Elastic::None
    }
    /// True where the ordinary rows are relaxed by the elastic variable.
    fn relaxes_rows(&self) -> bool {
        false
    }
    /// Weights in the objective: of the products, of the elastic variables.
    fn weights(&self, _sigma: f64) -> (f64, f64) {
        (0.0, 0.0)
    }
    /// Sequence of problems that belongs to it.
    fn sequence(&self) -> Sequence {
        Sequence::Relaxation
    }
    /// First parameters of a pair, for strategies that have them pair by pair.
    fn open(&self, _sigma: f64) -> Option<[f64; 3]> {
        None
    }
    /// Changes the parameters of a pair at a new `σ`.
    fn adapt(&self, _sigma: f64, _seen: &Seen, _own: &mut [f64; 3]) {}
}

/// The strategy of this name.
pub fn strategy(name: Relaxation) -> &'static dyn Strategy {
    match name {
        Relaxation::Scholtes => &products::Scholtes,
        Relaxation::ScholtesEq => &products::Equal,
        Relaxation::ScholtesLumped => &products::Lumped,
        Relaxation::LinFukushima => &products::LinFukushima,
        Relaxation::TwoSided => &products::TwoSided,
        Relaxation::RaghunathanBiegler => &products::Proportional(1.0),
        Relaxation::Direct => &products::Proportional(0.0),
        Relaxation::Kadrani => &local::Kadrani,
        Relaxation::SteffensenUlbrich => &local::SteffensenUlbrich(local::Arc::Sine),
        Relaxation::SteffensenUlbrichPoly => &local::SteffensenUlbrich(local::Arc::Polynomial),
        Relaxation::KanzowSchwartz => &local::KanzowSchwartz,
        Relaxation::FischerBurmeister => &smoothed::FischerBurmeister,
        Relaxation::NaturalResidual => &smoothed::NaturalResidual,
        Relaxation::ChenChenKanzow => &smoothed::ChenChenKanzow,
        Relaxation::L1Penalty => &penalty::L1,
        Relaxation::LinfPenalty => &penalty::Linf,
        Relaxation::L1Elastic => &penalty::L1Elastic,
        Relaxation::Elastic => &penalty::Elasticity,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> impl Iterator<Item = (Relaxation, &'static dyn Strategy)> {
        (0..Relaxation::NAMES.len() as i64).map(|i| Relaxation::from_i64(i).unwrap()).map(|r| (r, strategy(r)))
    }

    const POINTS: [(f64, f64); 9] = [
        (1.2, 0.9),
        (0.3, 0.02),
        (0.02, 0.3),
        (2.0, 0.1),
        (0.1, 0.7),
        (0.05, 0.06),
        (1e-3, 3.0),
        (0.4, 0.35),
        (-0.02, 0.5),
    ];

    /// Derivatives of every function against central differences, on both sides of every seam.
    #[test]
    fn derivatives_against_differences() {
        let h = 1e-6;
        for (name, s) in all() {
            for sigma in [1.0, 0.09, 1e-2] {
                let q = Softness { own: [0.2, 0.3, 0.4], ..Softness::new(sigma) };
                for (i, row) in s.rows().iter().enumerate() {
                    for (a, b) in POINTS {
                        let at = |a: f64, b: f64| s.jet(i, a, b, &q);
                        let j = at(a, b);
                        let (pa, ma, pb, mb) = (at(a + h, b), at(a - h, b), at(a, b + h), at(a, b - h));
                        let pairs = [
                            (j.d.0, (pa.v - ma.v) / (2.0 * h)),
                            (j.d.1, (pb.v - mb.v) / (2.0 * h)),
                            (j.dd.0, (pa.d.0 - ma.d.0) / (2.0 * h)),
                            (j.dd.1, (pa.d.1 - ma.d.1) / (2.0 * h)),
                            (j.dd.1, (pb.d.0 - mb.d.0) / (2.0 * h)),
                            (j.dd.2, (pb.d.1 - mb.d.1) / (2.0 * h)),
                        ];
                        for (exact, difference) in pairs {
                            let close = (exact - difference).abs() <= 1e-5 * (1.0 + exact.abs());
                            assert!(close, "{name:?} row {i} at ({a}, {b}), σ = {sigma}: {exact} {difference}");
                        }
                        assert!(s.curved() || (j.dd.0, j.dd.2) == (0.0, 0.0), "{name:?}");
                        assert!(!row.product || j.dd == (0.0, 1.0, 0.0), "{name:?}");
                    }
                }
            }
        }
    }

    /// Is `(a, b)` in the relaxed set?
    fn inside(s: &dyn Strategy, a: f64, b: f64, sigma: f64) -> bool {
        let q = Softness { own: s.open(sigma).unwrap_or_default(), ..Softness::new(sigma) };
        s.rows().iter().enumerate().all(|(i, row)| {
            let v = s.jet(i, a, b, &q).v;
            let upper = if i == 0 && s.sigma_in() == SigmaIn::Bound { sigma } else { row.upper };
            v >= row.lower - 1e-12 && v <= upper + 1e-12
        })
    }

    /// `σ` means the same for all: the diagonal is cut at `√σ`.
    #[test]
    fn the_diagonal_is_cut_at_the_root_of_sigma() {
        for (name, s) in all() {
            let elastic = s.rows().iter().any(|r| r.elastic) || s.rows().is_empty();
            if elastic || matches!(name, Relaxation::Direct) {
                continue;
            }
            for sigma in [1.0f64, 1e-2, 1e-6] {
                let t = sigma.sqrt();
                let inequality = s.rows().iter().all(|r| r.lower < r.upper);
                assert!(inside(s, t, t, sigma), "{name:?}");
                assert!(!inside(s, 1.01 * t, 1.01 * t, sigma), "{name:?}");
                let corner = inequality && name != Relaxation::Kadrani;
                assert_eq!(inside(s, 0.99 * t, 0.99 * t, sigma), corner, "{name:?}");
                let on_axis = inside(s, 3.0 * t, 0.0, sigma) && inside(s, 0.0, 3.0 * t, sigma);
                assert_eq!(on_axis, inequality, "{name:?}");
            }
        }
    }

    /// The wrong branch of the hyperbola of Lin and Fukushima is cut off.
    #[test]
    fn both_members_may_not_be_very_negative() {
        let s = strategy(Relaxation::LinFukushima);
        assert!(inside(s, -0.05, 3.0, 1e-2));
        for v in [-0.3, -0.25, -3.0] {
            assert!(!inside(s, v, v, 1e-2));
        }
    }

    #[test]
    fn parameters_of_a_pair_follow_the_signs_of_its_multipliers() {
        let s = strategy(Relaxation::TwoSided);
        let change = |nu, x| {
            let open = s.open(1.0).unwrap();
            let mut own = open;
            s.adapt(1e-2, &Seen { x, nu }, &mut own);
            [0, 1, 2].map(|i| own[i] < open[i])
        };
        assert_eq!(change((1.0, 1.0), (0.0, 0.0)), [true, true, false]);
        assert_eq!(change((-1.0, 0.0), (0.0, 1.0)), [false, false, true]);
        assert_eq!(change((1.0, 1e-9), (0.0, 1.0)), [true, false, false]);
        assert_eq!(change((0.0, 0.0), (0.5, 0.5)), [false, false, true], "an open pair");
        assert_eq!(change((0.0, 0.0), (0.0, 0.5)), [false; 3]);
    }
}
