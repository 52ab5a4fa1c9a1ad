//! From a piecewise smooth system to a dynamic complementarity system. Stewart's form (6.8):
//!
//! ```text
//! ẋ = f0 + Σ_k F^k θ^k,   g^k(x) − λ^k − μ^k e = 0,   eᵀθ^k = 1,   0 ≤ θ^k ⊥ λ^k ≥ 0
//! ```
//!
//! [`Form`] is what is discretised: this, the Heaviside form, or one subsystem in the one and one in the other.
//!
//! Here the model loses what it does not need: a subsystem with one mode becomes part of the smooth
//! right-hand side, a clock state appears only when a function depends on time, and rows of the sign matrix
//! with zeros are split into the cells they stand for only where there are any. Proposition 6.4 (`g = −Sψ`)
//! holds for full rows alone: with zeros, `−S_i ψ` can exceed `−S_j ψ` inside region `i`.

mod across;
mod fields;
pub mod filippov;
mod form;
mod relaxed;

pub use across::Across;
pub use fields::DcsFields;
pub use form::{Form, FormOptions, Included, IndicatorRow, Term};

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::func::Dims;
use crate::settings::DcsForm;
use crate::system::{Regions, SharedFunction, Subsystem, System};

/// A function that adds to the derivative of some states.
#[derive(Clone)]
pub struct Drift {
    /// States driven, one per output.
    pub rows: Vec<usize>,
    /// The function.
    pub f: SharedFunction,
}

/// A region with all signs fixed: the unit that has its own `θ` and `λ`.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Mode valid in the cell.
    pub mode: usize,
    /// Indicator `g = Σ_j weights[j] · functions_j`.
    pub weights: Vec<f64>,
}

/// One subsystem in Stewart's form.
#[derive(Clone)]
pub struct Stewart {
    /// States driven.
    pub rows: Vec<usize>,
    /// Mode matrix, column-major `rows.len() × n_modes`.
    pub modes: SharedFunction,
    /// Functions the indicators are combined of: `ψ`, or `g` itself.
    pub indicators: SharedFunction,
    /// Cells; several may share a mode.
    pub cells: Vec<Cell>,
}

impl Stewart {
    /// Do the indicators come from signs of switching functions? These are compared with zero and not with each other.
    pub fn by_signs(&self) -> bool {
        self.cells.iter().all(|c| c.weights.iter().all(|w| *w != 0.0))
    }
}

/// A dynamic complementarity system.
#[derive(Clone)]
pub struct Dcs {
    dims: Dims,
    clock: bool,
    n_z: usize,
    regions: bool,
    drifts: Vec<Drift>,
    subsystems: Vec<Stewart>,
    form: Form,
    combined: Option<Included>,
}

impl Dcs {
    /// Brings `system` into Stewart's form. Fails for systems that have none: with inclusions in `α`, or with algebraic
    /// equations, which those who ask for this form cannot integrate.
    pub fn stewart(system: &System) -> Result<Dcs> {
        if !system.inclusions().is_empty() {
            return Err(Error::Unsupported(
                "inclusions in the steps of switching functions have no modes: simulate the system with finite \
                 elements, they take them in the Heaviside form"
                    .into(),
            ));
        }
        if system.n_algebraic() > 0 {
            return Err(Error::Unsupported(
                "this method takes ordinary differential equations only: leave the algebraic equations out, or solve them for the \
                 algebraic states"
                    .into(),
            ));
        }
        Dcs::new(system, FormOptions { form: DcsForm::Stewart, ..FormOptions::default() })
    }

    /// Brings `system` into Stewart's form, for those who can form modes on demand: a right-hand side of that kind
    /// ([`System::on_demand`]) is left to them.
    pub fn with_modes_on_demand(system: &System) -> Result<Dcs> {
        if system.on_demand().is_none() {
            return Dcs::stewart(system);
        }
        system.validate_for_events()?;
        Ok(Dcs {
            dims: system.dims(),
            clock: false,
            n_z: 0,
            regions: false,
            drifts: Vec::new(),
            subsystems: Vec::new(),
            form: Form::default(),
            combined: None,
        })
    }

    /// Brings `system` into the form that `options` ask for.
    pub fn new(system: &System, options: FormOptions) -> Result<Dcs> {
        system.validate()?;
        system.check_modes_known()?;
        let dims = system.dims();
        let mut drifts = Vec::new();
        let mut clock = false;
        let mut note = |f: &SharedFunction| clock |= !f.jac_pattern().rows(f.dims().t_col()).is_empty();
        if let Some(f) = system.f0() {
            note(f);
            drifts.push(Drift { rows: (0..dims.x).collect(), f: f.clone() });
        }
        let n_z = system.n_algebraic();
        if let Some(f) = system.algebraic() {
            note(f);
            drifts.push(Drift { rows: (dims.x - n_z..dims.x).collect(), f: f.clone() });
        }
        let mut subsystems = Vec::new();
        let mut form = Form::default();
        for s in system.subsystems() {
            note(&s.modes);
            if s.n_modes == 1 {
                drifts.push(Drift { rows: s.rows.clone(), f: s.modes.clone() });
                continue;
            }
            let st = stewart(s);
            note(&st.indicators);
            form.add(s, &st, options);
            subsystems.push(st);
        }
        for i in system.inclusions() {
            note(&i.f);
            note(&i.psi);
            form.add_inclusion(i);
        }
        let combined = system.combined().and_then(|f| combined(f, system, &form));
        Ok(Dcs { dims, clock, n_z, regions: system.inclusions().is_empty(), drifts, subsystems, form, combined })
    }

    /// Drifts and terms of the form as one function of states and weights, where there is one ([`System::combined`]).
    pub fn combined(&self) -> Option<&Included> {
        self.combined.as_ref()
    }

    /// What is discretised.
    pub fn form(&self) -> &Form {
        &self.form
    }

    /// See [`Form::measure`].
    pub fn measure(&mut self, sizes: &[f64]) {
        self.form.measure(sizes);
    }

    /// Algebraic states: the last of the user's. Their right-hand side is a residual.
    pub fn n_algebraic(&self) -> usize {
        self.n_z
    }

    /// Do the smooth equations determine the algebraic states wherever the others are given, as far as their pattern
    /// says?
    pub fn determines_algebraic(&self) -> bool {
        let z = self.dims.x - self.n_z..self.dims.x;
        let drives = |rows: &[usize]| rows.iter().any(|r| z.contains(r));
        let switched =
            self.form.terms.iter().any(|t| drives(&t.rows)) || self.form.inclusions.iter().any(|i| drives(&i.rows));
        let row_has = |r: usize| {
            let entry = |d: &Drift| z.clone().any(|c| d.f.jac_pattern().rows(c).iter().any(|&o| d.rows[o] == r));
            self.drifts.iter().any(entry)
        };
        !z.is_empty() && !switched && z.clone().all(row_has)
    }

    /// Can (6.19) tell which cells follow at a switch?
    pub fn predicts(&self) -> bool {
        self.regions && self.n_z == 0
    }

    /// The cells of the form that are active where these regions are.
    pub fn from_regions(&self, regions: &[bool]) -> Vec<bool> {
        let mut out = vec![false; self.form.n_cells];
        for (cells, _) in self.form.region_cells.iter().zip(regions).filter(|(_, on)| **on) {
            cells.iter().for_each(|&c| out[c] = true);
        }
        out
    }

    /// The regions that may be active where these cells of the form are.
    pub fn to_regions(&self, cells: &[bool]) -> Vec<bool> {
        self.form.region_cells.iter().map(|r| r.iter().all(|&c| cells[c])).collect()
    }

    /// Sizes of the user's states, controls and parameters.
    pub fn dims(&self) -> Dims {
        self.dims
    }

    /// States integrated: the user's, then the clock if any function depends on time.
    pub fn nx(&self) -> usize {
        self.dims.x + self.clock as usize
    }

    /// Index of the clock state.
    pub fn clock(&self) -> Option<usize> {
        self.clock.then_some(self.dims.x)
    }

    /// Adds the clock state although no dynamics ask for it, for costs and constraints that depend on time.
    pub fn require_clock(&mut self) {
        self.clock = true;
    }

    /// The smooth part.
    pub fn drifts(&self) -> &[Drift] {
        &self.drifts
    }

    /// The subsystems that switch.
    pub fn subsystems(&self) -> &[Stewart] {
        &self.subsystems
    }

    /// Regions of all subsystems: the cells of Stewart's form.
    pub fn n_cells(&self) -> usize {
        self.subsystems.iter().map(|s| s.cells.len()).sum()
    }
}

/// The combined right-hand side with the weights of the form; none where a weight that it asks for is a sum of several.
fn combined(f: &SharedFunction, system: &System, form: &Form) -> Option<Included> {
    let of = |weights: &Vec<usize>| match weights[..] {
        [w] => Some(w),
        _ => None,
    };
    let alpha: Vec<usize> = form.terms.iter().flat_map(|t| &t.weights).map(of).collect::<Option<_>>()?;
    let dims = system.dims();
    (f.dims().x == dims.x + alpha.len()).then(|| Included { rows: (0..dims.x).collect(), f: f.clone(), alpha })
}

fn stewart(s: &Subsystem) -> Stewart {
    let (indicators, cells) = match &s.regions {
        Regions::Indicators(g) => {
            let unit = |i: usize| (0..s.n_modes).map(|j| f64::from(u8::from(i == j))).collect();
            (Arc::clone(g), (0..s.n_modes).map(|mode| Cell { mode, weights: unit(mode) }).collect())
        }
        Regions::Signs { psi, signs } => {
            let n_psi = psi.n_out();
            let cells = (0..s.n_modes)
                .flat_map(|mode| {
                    expand(&signs[mode * n_psi..(mode + 1) * n_psi])
                        .into_iter()
                        .map(move |w| Cell { mode, weights: w.iter().map(|v| -v).collect() })
                })
                .collect();
            (Arc::clone(psi), cells)
        }
    };
    Stewart { rows: s.rows.clone(), modes: Arc::clone(&s.modes), indicators, cells }
}

/// All full rows a row with zeros stands for.
fn expand(row: &[i8]) -> Vec<Vec<f64>> {
    let mut out = vec![Vec::with_capacity(row.len())];
    for &s in row {
        if s != 0 {
            out.iter_mut().for_each(|v| v.push(f64::from(s.signum())));
            continue;
        }
        let with = |mut v: Vec<f64>, sign: f64| {
            v.reserve_exact(row.len() - v.len());
            v.push(sign);
            v
        };
        out = out.into_iter().flat_map(|v| [with(v.clone(), 1.0), with(v, -1.0)]).collect();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::Callback;

    fn psi(n: usize) -> SharedFunction {
        Arc::new(Callback::new("psi", Dims { x: 1, u: 0, p: 0 }, n, |_, out| {
            out.fill(1.0);
            0
        }))
    }

    fn argmin(cells: &[Cell], v: &[f64]) -> usize {
        let g = |c: &Cell| c.weights.iter().zip(v).map(|(w, v)| w * v).sum::<f64>();
        cells.iter().min_by(|a, b| g(a).total_cmp(&g(b))).map(|c| c.mode).unwrap_or(usize::MAX)
    }

    #[test]
    fn the_smallest_indicator_is_that_of_the_region_for_rows_with_and_without_zeros() {
        let cases: [(usize, usize, Vec<i8>); 3] =
            [(2, 1, vec![1, -1]), (4, 2, vec![1, 1, 1, -1, -1, 1, -1, -1]), (3, 2, vec![1, 0, -1, 1, -1, -1])];
        for (n_modes, n_psi, signs) in cases {
            let modes = Arc::new(Callback::new("F", Dims { x: 1, u: 0, p: 0 }, n_modes, |_, out| {
                out.fill(0.0);
                0
            }));
            let regions = Regions::Signs { psi: psi(n_psi), signs: signs.clone() };
            let st = stewart(&Subsystem { rows: vec![0], modes, n_modes, regions });
            for a in [-3.0, -0.1, 0.2, 5.0] {
                for b in [-7.0, -0.3, 0.1, 4.0] {
                    let v = &[a, b][..n_psi];
                    let inside = (0..n_modes)
                        .find(|i| v.iter().enumerate().all(|(j, v)| f64::from(signs[i * n_psi + j]) * v >= 0.0));
                    assert_eq!(Some(argmin(&st.cells, v)), inside, "{signs:?} at {v:?}");
                }
            }
        }
    }

    #[test]
    fn one_mode_costs_nothing_and_time_adds_a_clock() {
        let d = Dims { x: 1, u: 0, p: 0 };
        let one = Arc::new(Callback::new("F", d, 1, |_, out| {
            out[0] = 1.0;
            0
        }));
        let mut s = System::new(1, 0, 0).unwrap();
        let regions = Regions::Signs { psi: psi(1), signs: vec![1] };
        s.add_subsystem(Subsystem { rows: vec![0], modes: one, n_modes: 1, regions }).unwrap();
        let dcs = Dcs::stewart(&s).unwrap();
        assert_eq!((dcs.n_cells(), dcs.drifts().len(), dcs.nx()), (0, 1, 1));
        let t = crate::linalg::csc::Pattern::new(1, 2, vec![0, 0, 1], vec![0]).unwrap();
        let timed = Callback::new("f0", d, 1, |at, out| {
            out[0] = at.t;
            0
        })
        .with_jacobian(t, |_, out| {
            out[0] = 1.0;
            0
        })
        .unwrap();
        s.set_f0(Arc::new(timed)).unwrap();
        assert_eq!(Dcs::stewart(&s).unwrap().clock(), Some(1));
    }
}
