//! What becomes of the indicators at the end of a control stage, where controls, and parameters that the stages have of their
//! own, jump.

use super::Form;

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

impl Form {
    /// Of every cell. What jumps at the ends of stages are controls that are not `linear` (empty: none is), and parameters where the
    /// stages have their own.
    pub fn across(&self, linear: &[bool], stage_params: bool) -> Vec<Across> {
        let mut depends = vec![[false; 2]; self.n_cells];
        for r in &self.rows {
            let f = &self.sources[r.source];
            let (d, pattern) = (f.dims(), f.jac_pattern());
            let on = |j: usize| pattern.rows(j).iter().any(|&i| r.weights[i] != 0.0);
            let linear = |j: usize| linear.get(j).copied().unwrap_or(false);
            let moves = (0..d.x).chain([d.t_col()]).any(on) || (0..d.u).any(|j| linear(j) && on(d.x + j));
            let params = if stage_params { d.x + d.u..d.t_col() } else { 0..0 };
            let jumps = (0..d.u).any(|j| !linear(j) && on(d.x + j)) || params.into_iter().any(on);
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

    /// Of every simplex: whether its sets are free to change at the ends of control stages, and there alone.
    pub fn simplices_across(&self, linear: &[bool], stage_params: bool) -> Vec<Across> {
        let cells = self.across(linear, stage_params);
        let of = |c: &std::ops::Range<usize>| match &cells[c.clone()] {
            all if all.contains(&Across::Own) => Across::Own,
            all if all.contains(&Across::Tied) => Across::Tied,
            _ => Across::Nothing,
        };
        self.simplices.iter().map(of).collect()
    }
}
