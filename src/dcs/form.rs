//! Complementarity systems as they are discretised: cells with weights and multipliers, whatever the form.
//!
//! A cell has a weight `θ ≥ 0` and a multiplier `λ ≥ 0`, one of which is zero. In Stewart's form (6.8) a cell is a region.
//! In the Heaviside form (6.44) every switching function has two, for `ψ > 0` with the weight `α` and the multiplier
//! `λⁿ`, and for `ψ < 0` with `1 − α` and `λᵖ`; weights of regions are products of theirs, one factor for every sign
//! that matters, with intermediate products for those with many factors (Algorithm 1). Where a region has one factor
//! its weight is that of the cell.

use std::ops::Range;

use super::Stewart;
use crate::error::Result;
use crate::settings::{DcsForm, Settings};
use crate::system::{heaviside_is_better, moving, Inclusion, Regions, SetValued, SharedFunction, Subsystem};

/// How a system is brought into a form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FormOptions {
    /// Which one.
    pub form: DcsForm,
    /// Factors of a product at most, 2 at least.
    pub depth: usize,
}

impl FormOptions {
    /// Reads the options out of the settings.
    pub fn from_settings(s: &Settings) -> Result<FormOptions> {
        s.validate()?;
        Ok(FormOptions { form: s.dcs_form()?, depth: s.lift_depth as usize })
    }
}

impl Default for FormOptions {
    fn default() -> FormOptions {
        FormOptions { form: DcsForm::Auto, depth: 2 }
    }
}

/// `Σ_j weights[j] · f_j + Σ λ-terms − μ = 0`, with the outputs of a source `f`.
#[derive(Debug, Clone, PartialEq)]
pub struct IndicatorRow {
    /// Index into [`Form::sources`].
    pub source: usize,
    /// Factors of its outputs.
    pub weights: Vec<f64>,
    /// Cells with the factors of their `λ`.
    pub lambda: Vec<(usize, f64)>,
    /// Index of the multiplier `μ`, in Stewart's form.
    pub mu: Option<usize>,
}

/// Modes with weights, added to the derivatives of some states.
#[derive(Clone)]
pub struct Term {
    /// States driven.
    pub rows: Vec<usize>,
    /// Mode matrix, column-major `rows.len() × n_modes`.
    pub modes: SharedFunction,
    /// The weight of a mode is the sum of these: cells, then products.
    pub weights: Vec<Vec<usize>>,
}

/// A function of states and weights `α` (6.38), added to the derivatives of some states.
#[derive(Clone)]
pub struct Included {
    /// States driven.
    pub rows: Vec<usize>,
    /// The function; it sees `(x, α)` as its states.
    pub f: SharedFunction,
    /// The cells whose weights are `α`.
    pub alpha: Vec<usize>,
}

/// A complementarity system without its smooth part.
#[derive(Clone, Default)]
pub struct Form {
    /// Functions behind the indicators.
    pub sources: Vec<SharedFunction>,
    /// Equations of the multipliers.
    pub rows: Vec<IndicatorRow>,
    /// Cells whose weights sum to one.
    pub simplices: Vec<Range<usize>>,
    /// Cells whose weights are multipliers of constraints, and whose multipliers are these constraints.
    pub multipliers: Vec<Range<usize>>,
    /// Cells.
    pub n_cells: usize,
    /// Multipliers `μ`.
    pub n_mu: usize,
    /// Weights that are products: the numbers of their factors, cells and earlier products.
    pub products: Vec<Vec<usize>>,
    /// Modes.
    pub terms: Vec<Term>,
    /// Functions of weights.
    pub inclusions: Vec<Included>,
    /// Per subsystem, then per switching function of inclusions: the weights of the modes in the sense of [`Term`]. Constraints have one
    /// mode, whose weight is their multiplier.
    pub reported: Vec<Vec<Vec<usize>>>,
    /// For every region the cells it needs.
    pub region_cells: Vec<Vec<usize>>,
    /// Factors of the outputs of every source that [`Form::measure`] put into the rows; none at first.
    pub scales: Vec<Vec<f64>>,
}

impl Form {
    /// Measures switching functions that are compared with each other by their sizes, those of all sources one after the other:
    /// Stewart's indicators `g = Σ_j ± ψ_j` become `Σ_j ± ψ_j s / s_j` with the largest size `s`. Regions and solutions stay the
    /// same; without this a function in small units would not count among the others. Indicators that are given as such are in
    /// one unit.
    pub fn measure(&mut self, sizes: &[f64]) {
        let mut first = 0;
        self.scales.resize(self.sources.len(), Vec::new());
        for (k, f) in self.sources.iter().enumerate() {
            let n = f.n_out();
            let own = |j: usize| sizes.get(first + j).copied().filter(|s| *s > 0.0 && s.is_finite()).unwrap_or(1.0);
            let compared = |r: &IndicatorRow| r.mu.is_some() && r.weights.iter().all(|w| *w != 0.0);
            if n > 1 && self.rows.iter().filter(|r| r.source == k).all(compared) {
                let largest = (0..n).map(own).fold(0.0, f64::max);
                let scale: Vec<f64> = (0..n).map(|j| largest / own(j)).collect();
                for r in self.rows.iter_mut().filter(|r| r.source == k) {
                    for (j, w) in r.weights.iter_mut().enumerate() {
                        *w *= scale[j] / self.scales[k].get(j).copied().unwrap_or(1.0);
                    }
                }
                self.scales[k] = scale;
            }
            first += n;
        }
    }

    /// Cells that change together: those whose weights sum to one, and every multiplier for itself, in the order of their cells.
    pub fn groups(&self) -> Vec<Range<usize>> {
        let single = self.multipliers.iter().cloned().flatten().map(|c| c..c + 1);
        let mut all: Vec<Range<usize>> = self.simplices.iter().cloned().chain(single).collect();
        all.sort_by_key(|g| g.start);
        all
    }

    /// The row that the multiplier of a cell belongs to.
    pub fn row_of(&self, cell: usize) -> Option<&IndicatorRow> {
        self.rows.iter().find(|r| r.lambda.iter().any(|l| l.0 == cell))
    }

    /// Cells of a simplex between two of it that lie on different sides of two surfaces: on the one's side of the one and on the other's
    /// side of the other.
    pub fn between(&self, simplex: Range<usize>, a: usize, b: usize) -> impl Iterator<Item = usize> + '_ {
        let row = |c: usize| self.row_of(c).filter(|r| r.mu.is_some());
        let sides = move |c: usize, d: usize| {
            let (c, d) = (row(c)?, row(d)?);
            Some(c.weights.iter().zip(&d.weights).filter(|(x, y)| x != y).count())
        };
        simplex.filter(move |&c| sides(a, b) == Some(2) && [a, b].iter().all(|&d| sides(c, d) == Some(1)))
    }

    /// Weights of a point: cells, then products.
    pub fn n_weights(&self) -> usize {
        self.n_cells + self.products.len()
    }

    /// Adds a subsystem in the form asked for; indicators given as such have Stewart's form only.
    pub(super) fn add(&mut self, s: &Subsystem, st: &Stewart, options: FormOptions) {
        match &s.regions {
            Regions::Signs { psi, signs } if wants_heaviside(s, st, psi, signs, options) => {
                self.add_heaviside(s, st, psi, signs, options.depth)
            }
            _ => self.add_stewart(st),
        }
    }

    fn add_stewart(&mut self, st: &Stewart) {
        let first = self.n_cells;
        let source = self.sources.len();
        self.sources.push(st.indicators.clone());
        for (c, cell) in st.cells.iter().enumerate() {
            let lambda = vec![(first + c, -1.0)];
            self.rows.push(IndicatorRow { source, weights: cell.weights.clone(), lambda, mu: Some(self.n_mu) });
            self.region_cells.push(vec![first + c]);
        }
        self.n_mu += 1;
        let n_modes = 1 + st.cells.iter().map(|c| c.mode).max().unwrap_or(0);
        let of = |mode| st.cells.iter().enumerate().filter(|(_, c)| c.mode == mode).map(|(c, _)| first + c).collect();
        let weights: Vec<Vec<usize>> = (0..n_modes).map(of).collect();
        self.simplex(st.cells.len());
        self.term(Term { rows: st.rows.clone(), modes: st.modes.clone(), weights });
    }

    /// Appends cells whose weights sum to one.
    fn simplex(&mut self, n: usize) {
        let cells = self.append(n);
        self.simplices.push(cells);
    }

    /// Appends cells. Products move behind them.
    fn append(&mut self, n: usize) -> Range<usize> {
        let first = self.n_cells;
        let shift = |v: &mut usize| *v += if *v >= first { n } else { 0 };
        self.products.iter_mut().flatten().for_each(shift);
        self.terms.iter_mut().flat_map(|t| &mut t.weights).flatten().for_each(shift);
        self.reported.iter_mut().flatten().flatten().for_each(shift);
        self.n_cells += n;
        first..first + n
    }

    fn term(&mut self, t: Term) {
        self.reported.push(t.weights.clone());
        self.terms.push(t);
    }

    /// Two cells for every output of `psi`; returns the first.
    fn steps(&mut self, psi: &SharedFunction) -> usize {
        let (first, source) = (self.n_cells, self.sources.len());
        self.sources.push(psi.clone());
        for j in 0..psi.n_out() {
            let (above, below) = (first + 2 * j, first + 2 * j + 1);
            let weights = (0..psi.n_out()).map(|i| f64::from(u8::from(i == j))).collect();
            self.rows.push(IndicatorRow { source, weights, lambda: vec![(below, -1.0), (above, 1.0)], mu: None });
            self.simplex(2);
        }
        first
    }

    fn add_heaviside(&mut self, s: &Subsystem, st: &Stewart, psi: &SharedFunction, signs: &[i8], depth: usize) {
        let first = self.steps(psi);
        let n_psi = psi.n_out();
        let cell = |j: usize, positive: bool| first + 2 * j + usize::from(!positive);
        let weights = (0..s.n_modes)
            .map(|i| {
                let row = signs[i * n_psi..(i + 1) * n_psi].iter().enumerate();
                let factors: Vec<usize> = row.filter(|(_, s)| **s != 0).map(|(j, s)| cell(j, *s > 0)).collect();
                vec![self.product(&factors, depth)]
            })
            .collect();
        for c in &st.cells {
            // indicators are −Sψ
            self.region_cells.push(c.weights.iter().enumerate().map(|(j, w)| cell(j, *w < 0.0)).collect());
        }
        self.term(Term { rows: s.rows.clone(), modes: s.modes.clone(), weights });
    }

    /// The weight that is the product of these, made of products of at most `depth` factors that exist once.
    fn product(&mut self, factors: &[usize], depth: usize) -> usize {
        if factors.len() == 1 {
            return factors[0];
        }
        let depth = depth.max(2);
        let list = if factors.len() <= depth {
            factors.to_vec()
        } else {
            let inner = self.product(&factors[..factors.len() - 1], depth);
            vec![inner, factors[factors.len() - 1]]
        };
        let k = self.products.iter().position(|p| *p == list).unwrap_or_else(|| {
            self.products.push(list);
            self.products.len() - 1
        });
        self.n_cells + k
    }

    pub(super) fn add_inclusion(&mut self, i: &Inclusion) {
        if i.set == SetValued::Multiplier {
            return self.add_multipliers(i);
        }
        let first = self.steps(&i.psi);
        let n = i.psi.n_out();
        let alpha = (0..n).map(|j| first + 2 * j).collect();
        self.inclusions.push(Included { rows: i.rows.clone(), f: i.f.clone(), alpha });
        self.reported.extend((0..n).map(|j| vec![vec![first + 2 * j], vec![first + 2 * j + 1]]));
    }

    /// A cell for every constraint: its multiplier is the constraint, its weight what pushes. As with contacts without velocities, one of
    /// both is zero in every element.
    fn add_multipliers(&mut self, i: &Inclusion) {
        let (n, source) = (i.psi.n_out(), self.sources.len());
        self.sources.push(i.psi.clone());
        let cells = self.append(n);
        for (j, cell) in cells.clone().enumerate() {
            let weights = (0..n).map(|i| f64::from(u8::from(i == j))).collect();
            self.rows.push(IndicatorRow { source, weights, lambda: vec![(cell, -1.0)], mu: None });
            self.reported.push(vec![vec![cell]]);
        }
        self.inclusions.push(Included { rows: i.rows.clone(), f: i.f.clone(), alpha: cells.clone().collect() });
        self.multipliers.push(cells);
    }

    /// Calls `f` with every cell that a weight, a cell or a product, is made of.
    pub fn factors(&self, weight: usize, f: &mut dyn FnMut(usize)) {
        match weight.checked_sub(self.n_cells) {
            None => f(weight),
            Some(k) => self.products[k].iter().for_each(|&w| self.factors(w, f)),
        }
    }

    /// Is a weight, a cell or a product, positive where these cells are active?
    pub fn is_active(&self, weight: usize, cells: &[bool]) -> bool {
        match weight.checked_sub(self.n_cells) {
            None => cells[weight],
            Some(k) => self.products[k].iter().all(|&f| self.is_active(f, cells)),
        }
    }
}

/// Stewart's form unless the other one is better ([`heaviside_is_better`]).
fn wants_heaviside(s: &Subsystem, st: &Stewart, psi: &SharedFunction, signs: &[i8], options: FormOptions) -> bool {
    match options.form {
        DcsForm::Stewart => false,
        DcsForm::Heaviside => true,
        DcsForm::Auto => {
            let mut trial = Form::default();
            trial.add_heaviside(s, st, psi, signs, options.depth);
            heaviside_is_better(&moving(&**psi), st.cells.len(), trial.products.len())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::{Callback, Dims};
    use std::sync::Arc;

    fn function(n: usize) -> SharedFunction {
        Arc::new(Callback::new("f", Dims { x: 1, u: 0, p: 0 }, n, |_, out| {
            out.fill(0.0);
            0
        }))
    }

    /// All `2ⁿ` regions of `n` switching functions.
    fn full(n: usize) -> Subsystem {
        let signs = (0..1usize << n).flat_map(|i| (0..n).map(move |j| if i >> (n - 1 - j) & 1 == 0 { 1 } else { -1 }));
        Subsystem {
            rows: vec![0],
            modes: function(1 << n),
            n_modes: 1 << n,
            regions: Regions::Signs { psi: function(n), signs: signs.collect() },
        }
    }

    fn form(s: &Subsystem, form: DcsForm, depth: usize) -> Form {
        let mut f = Form::default();
        f.add(s, &super::super::stewart(s), FormOptions { form, depth });
        f
    }

    #[test]
    fn sizes_are_those_of_table_6_4() {
        for n in 1..=8usize {
            let s = full(n);
            let n_f = 1 << n;
            let st = form(&s, DcsForm::Stewart, 2);
            assert_eq!((st.n_cells, st.n_weights(), st.n_mu, st.rows.len()), (n_f, n_f, 1, n_f));
            for depth in 2..=4 {
                let h = form(&s, DcsForm::Heaviside, depth);
                assert_eq!((h.n_cells, h.n_mu, h.rows.len(), h.simplices.len()), (2 * n, 0, n, n));
                let lifted = if n > depth { n_f - (1 << depth) } else { 0 };
                // with one switching function the weights are α and 1 − α
                let modes = if n == 1 { 0 } else { n_f };
                assert_eq!(h.products.len(), modes + lifted, "n_psi {n}, n_d {depth}");
                assert!(h.products.iter().all(|p| p.len() <= depth));
            }
        }
    }

    #[test]
    fn weights_of_regions_are_those_of_6_43_and_sum_to_one() {
        let alpha = [0.3, 0.9, 0.45];
        for depth in [2, 3] {
            let s = full(3);
            let f = form(&s, DcsForm::Heaviside, depth);
            let mut w: Vec<f64> = alpha.iter().flat_map(|a| [*a, 1.0 - a]).collect();
            for p in &f.products {
                w.push(p.iter().map(|&k| w[k]).product());
            }
            let theta: Vec<f64> = f.terms[0].weights.iter().map(|l| l.iter().map(|&k| w[k]).sum()).collect();
            let Regions::Signs { signs, .. } = &s.regions else { unreachable!() };
            for (i, t) in theta.iter().enumerate() {
                let exact: f64 = (0..3)
                    .map(|j| {
                        let s = f64::from(signs[3 * i + j]);
                        0.5 * (1.0 - s) + s * alpha[j]
                    })
                    .product();
                assert!((t - exact).abs() < 1e-15);
            }
            assert!((theta.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn unions_have_few_factors_and_auto_takes_what_is_smaller() {
        // four switching functions, three regions: ψ1 > 0; ψ1 < 0 and ψ2 > 0; the rest
        let signs = vec![1, 0, 0, 0, -1, 1, 0, 0, -1, -1, 0, 0];
        let regions = Regions::Signs { psi: function(4), signs };
        let s = Subsystem { rows: vec![0], modes: function(3), n_modes: 3, regions };
        let h = form(&s, DcsForm::Auto, 2);
        assert_eq!((h.n_cells, h.products.len(), h.terms[0].weights[0].as_slice()), (8, 2, &[0usize][..]));
        assert_eq!(form(&full(2), DcsForm::Auto, 2).n_mu, 1);
    }

    #[test]
    fn regions_and_cells_translate_into_each_other() {
        let f = form(&full(2), DcsForm::Heaviside, 2);
        assert_eq!(f.region_cells, vec![vec![0, 2], vec![0, 3], vec![1, 2], vec![1, 3]]);
        // on ψ1 = 0 with ψ2 > 0
        let cells = [true, true, true, false];
        let active: Vec<bool> = f.terms[0].weights.iter().map(|w| f.is_active(w[0], &cells)).collect();
        assert_eq!(active, [true, false, true, false]);
    }
}
