//! What becomes of the indicators at the end of a control stage, where controls, and parameters that the stages have of their
//! own, jump.

use std::ops::Range;

use super::{Dcs, Form, IndicatorRow, Term};
use crate::func::Dims;
use crate::system::SharedFunction;

/// How the multipliers of a cell go on from one control stage to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Across {
    /// Those at the end are those at the start of the next: the indicators are continuous.
    Tied,
    /// There are none at the start: the indicators depend only on what is constant in a stage, and jump at its end.
    Nothing,
    /// There are others at the start: the indicators depend on states, or the time, and on what jumps.
    Own,
}

/// Columns of a function that jump at the ends of stages: controls that are not `linear` in a stage, and parameters of stages.
fn jumping(d: Dims, linear: &dyn Fn(usize) -> bool, stage_params: bool) -> impl Iterator<Item = usize> + '_ {
    let params = if stage_params { d.x + d.u..d.t_col() } else { 0..0 };
    (0..d.u).filter(move |j| !linear(*j)).map(move |j| d.x + j).chain(params)
}

impl Form {
    /// Of every cell. What jumps at the ends of stages are controls that are not `linear` (empty: none is), and parameters where the
    /// stages have their own.
    pub fn across(&self, linear: &[bool], stage_params: bool) -> Vec<Across> {
        let mut depends = vec![[false; 2]; self.n_cells];
        for r in &self.rows {
            let d = self.sources[r.source].dims();
            let linear = |j: usize| linear.get(j).copied().unwrap_or(false);
            let on = |j: usize| self.depends(r, j);
            let moves = (0..d.x).chain([d.t_col()]).any(on) || (0..d.u).any(|j| linear(j) && on(d.x + j));
            let jumps = jumping(d, &linear, stage_params).any(on);
            for &(c, _) in &r.lambda {
                depends[c] = [depends[c][0] || moves, depends[c][1] || jumps];
            }
        }
        let mut out: Vec<Across> = depends
            .iter()
            .map(|d| match d {
                [false, _] => Across::Nothing,
                [true, false] => Across::Tied,
                [true, true] => Across::Own,
            })
            .collect();
        // the multiplier `μ` of a subsystem is one for all its cells
        for cells in &self.simplices {
            if out[cells.clone()].contains(&Across::Own) {
                out[cells.clone()].fill(Across::Own);
            }
        }
        out
    }

    /// Does a row depend on column `j` of its source?
    fn depends(&self, r: &IndicatorRow, j: usize) -> bool {
        self.sources[r.source].jac_pattern().rows(j).iter().any(|&i| r.weights[i] != 0.0)
    }

    /// Does the multiplier of a cell depend on a state?
    pub fn moves_with(&self, cell: usize, state: usize) -> bool {
        self.row_of(cell).is_some_and(|own| match own.mu {
            // that of a simplex is the distance from the smallest of all indicators
            Some(_) => self.rows.iter().any(|r| r.mu == own.mu && self.depends(r, state)),
            None => self.depends(own, state),
        })
    }

    /// Is one of the `cells`, or a product with one of them, the weight `w`?
    fn has_factor(&self, w: usize, cells: &Range<usize>) -> bool {
        match w.checked_sub(self.n_cells) {
            None => cells.contains(&w),
            Some(product) => self.products[product].iter().any(|f| self.has_factor(*f, cells)),
        }
    }

    /// Of every group of [`Form::groups`]: whether its sets are free to change at the ends of control stages, and there alone.
    pub fn groups_across(&self, linear: &[bool], stage_params: bool) -> Vec<Across> {
        let cells = self.across(linear, stage_params);
        let of = |c: &Range<usize>| match &cells[c.clone()] {
            all if all.contains(&Across::Own) => Across::Own,
            all if all.contains(&Across::Tied) => Across::Tied,
            _ => Across::Nothing,
        };
        self.groups().iter().map(of).collect()
    }
}

impl Dcs {
    /// Of every simplex: may its weights in a sliding mode jump at the end of a control stage? They follow from `∇ψ·ẋ = 0`, so they
    /// jump with the derivatives of the states that the switching functions depend on; without that a mode can be left only where a
    /// weight has come to zero. What jumps is as in [`Form::across`].
    pub fn weights_jump(&self, linear: &[bool], stage_params: bool) -> Vec<bool> {
        let form = self.form();
        let across = form.across(linear, stage_params);
        let mut jumps: Vec<bool> =
            form.simplices.iter().map(|c| across[c.clone()].iter().any(|a| *a != Across::Tied)).collect();
        if self.n_z > 0 || !form.inclusions.is_empty() {
            // algebraic states jump with the controls
            jumps.fill(true);
        }
        let mut driven = vec![false; self.dims.x];
        let linear = |j: usize| linear.get(j).copied().unwrap_or(false);
        let mut mark = |f: &SharedFunction, rows: &[usize]| {
            for j in jumping(f.dims(), &linear, stage_params) {
                f.jac_pattern().rows(j).iter().for_each(|i| driven[rows[i % rows.len()]] = true);
            }
        };
        self.drifts.iter().for_each(|d| mark(&d.f, &d.rows));
        self.subsystems.iter().for_each(|s| mark(&s.modes, &s.rows));
        let weighs = |t: &Term, cells: &Range<usize>| t.weights.iter().flatten().any(|w| form.has_factor(*w, cells));
        loop {
            let before = jumps.clone();
            for (k, cells) in form.simplices.iter().enumerate() {
                let mut rows = form.rows.iter().filter(|r| r.lambda.iter().any(|(c, _)| cells.contains(c)));
                jumps[k] |= rows.any(|r| driven.iter().enumerate().any(|(j, driven)| *driven && form.depends(r, j)));
                if jumps[k] {
                    // weights that jump take the derivatives along that they add to
                    form.terms
                        .iter()
                        .filter(|t| weighs(t, cells))
                        .for_each(|t| t.rows.iter().for_each(|i| driven[*i] = true));
                }
            }
            if jumps == before {
                return jumps;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::func::Callback;
    use crate::linalg::csc::Pattern;
    use crate::system::{Regions, Subsystem, System};

    const D: Dims = Dims { x: 3, u: 1, p: 0 };

    /// A function whose outputs depend on the columns given, one list for each of them.
    fn depends(rows: &[&[usize]]) -> SharedFunction {
        let columns: Vec<Vec<usize>> =
            (0..=D.t_col()).map(|j| (0..rows.len()).filter(|i| rows[*i].contains(&j)).collect()).collect();
        let mut starts = vec![0];
        columns.iter().for_each(|c| starts.push(starts[starts.len() - 1] + c.len()));
        let pattern = Pattern::new(rows.len(), D.t_col() + 1, starts, columns.concat()).unwrap();
        let f = Callback::new("f", D, rows.len(), |_, out| {
            out.fill(1.0);
            0
        });
        let f = f.with_jacobian(pattern, |_, out| {
            out.fill(1.0);
            0
        });
        Arc::new(f.unwrap())
    }

    /// States `q1`, `q2` with friction on surfaces of their own, driven by `v`, and `v' = u`.
    fn weights_of(f0: &[&[usize]; 3], surfaces: [&[usize]; 2]) -> Vec<bool> {
        let mut s = System::new(D.x, D.u, D.p).unwrap();
        s.set_f0(depends(f0)).unwrap();
        for (row, psi) in surfaces.into_iter().enumerate() {
            let regions = Regions::Signs { psi: depends(&[psi]), signs: vec![1, -1] };
            s.add_subsystem(Subsystem { rows: vec![row], modes: depends(&[&[], &[]]), n_modes: 2, regions }).unwrap();
        }
        Dcs::stewart(&s).unwrap().weights_jump(&[], false)
    }

    #[test]
    fn weights_jump_where_controls_reach_their_surfaces_at_once() {
        let (v, u) = (2, 3);
        // the control acts through the velocity alone
        assert_eq!(weights_of(&[&[v], &[v], &[u]], [&[0], &[1]]), [false, false]);
        // on one of the two states themselves
        assert_eq!(weights_of(&[&[v, u], &[v], &[u]], [&[0], &[1]]), [true, false]);
        // and on the other, whose surface depends on that state
        assert_eq!(weights_of(&[&[v, u], &[v], &[u]], [&[0], &[0, 1]]), [true, true]);
        // on a surface that depends on the velocity
        assert_eq!(weights_of(&[&[v], &[v], &[u]], [&[0, v], &[1]]), [true, false]);
        // controls that are linear in a stage do not jump
        let mut s = System::new(D.x, D.u, D.p).unwrap();
        s.set_f0(depends(&[&[u], &[], &[]])).unwrap();
        let regions = Regions::Signs { psi: depends(&[&[0]]), signs: vec![1, -1] };
        s.add_subsystem(Subsystem { rows: vec![0], modes: depends(&[&[], &[]]), n_modes: 2, regions }).unwrap();
        let dcs = Dcs::stewart(&s).unwrap();
        assert_eq!([dcs.weights_jump(&[], false), dcs.weights_jump(&[true], false)], [[true], [false]]);
    }
}
