//! Controls that are choices: modes that a control decides by itself, and pairs of controls alone.
//!
//! Where a switching function sees a control and no state, the control of every stage lies on one side of it or the other, and where the rates
//! differ there no small change leads from one to the other: an answer is an optimum of one of `2^n` choices. Nothing compares these yet, so the
//! report names them. On the border itself the discretised problem takes any convex combination of both sides, which the control is not.

use super::{Ocp, OcpResult};
use crate::error::Result;
use crate::func::Point;
use crate::nlp::Outcome;
use crate::system::{Regions, SharedFunction, Subsystem};

/// Why nothing is known of an answer that lies on the border of a choice.
const ON_BORDER: &str = "a control that decides a mode by itself lies on the border between two, where it is neither";
/// Difference of the rates of two modes, as a share of the largest, that is a jump.
const JUMP: f64 = 1e-6;
/// Distance of a control from a border, as a share of its size, up to which it is on it.
const AT_BORDER: f64 = 1e-6;

/// What a choice is.
pub(super) struct Choice {
    /// In words.
    pub text: String,
    /// Why there is no verdict; none where every stage has chosen.
    pub doubt: Option<&'static str>,
}

/// The states, controls and parameters of a stage.
struct Stage<'a> {
    at: Point<'a>,
    /// Controls that may change.
    free: &'a [bool],
}

/// A motion: the controls of every stage, parameters, and time and states where the stages begin.
pub(super) struct Controlled<'a> {
    pub controls: &'a [f64],
    pub params: &'a [f64],
    pub starts: Vec<(f64, Vec<f64>)>,
}

impl Ocp {
    /// The first choice of the problem, if it has one, at its answer.
    pub(super) fn choice(&self, r: &OcpResult) -> Result<Option<Choice>> {
        if r.outcome != Outcome::Solved {
            return Ok(None);
        }
        let nx = self.system.dims().x;
        let mut starts: Vec<(f64, Vec<f64>)> = Vec::with_capacity(self.n_stages);
        for e in &r.trajectory.elements {
            if e.stage == starts.len() {
                starts.push((e.t, e.x0[..nx].to_vec()));
            }
        }
        self.choice_of(&Controlled { controls: &r.controls, params: &r.params, starts })
    }

    /// The same of a motion.
    pub(super) fn choice_of(&self, m: &Controlled) -> Result<Option<Choice>> {
        let declared = |j: usize| self.system.choices().iter().any(|c| c.control == j);
        let bounds = self.u_bounds[0].iter().zip(&self.u_bounds[1]).enumerate();
        let free: Vec<bool> = bounds.map(|(j, (l, u))| l < u && !declared(j)).collect();
        let sees = |f: &SharedFunction, row: usize, columns: std::ops::Range<usize>| {
            columns.into_iter().any(|c| f.jac_pattern().rows(c).contains(&row))
        };
        let d = self.system.dims();
        let decides = |f: &SharedFunction, row: usize| -> Option<usize> {
            let control = (0..d.u).find(|&i| free[i] && sees(f, row, d.x + i..d.x + i + 1));
            control.filter(|_| !sees(f, row, 0..d.x))
        };
        for (k, c) in self.complementarity.iter().enumerate() {
            let row = (0..c.a.n_out()).find(|&i| decides(&c.a, i).is_some() && decides(&c.b, i).is_some());
            if let Some(control) = row.and_then(|i| decides(&c.a, i)) {
                let text = format!(
                    "pair {k} ('{}') is of controls alone: which of its sides is zero is a choice in every stage, with control {control}, and \
                     other choices were not compared; declare the choice instead of the pair to have them compared",
                    c.a.name()
                );
                return Ok(Some(Choice { text, doubt: None }));
            }
        }
        for (k, s) in self.system.subsystems().iter().enumerate() {
            let Regions::Signs { psi, signs } = &s.regions else { continue };
            for j in 0..psi.n_out() {
                let Some(control) = decides(psi, j) else { continue };
                let Some(border) = self.at_jump(m, s, (psi, signs, j), &free)? else { continue };
                let mut text = format!(
                    "control {control} decides a mode by itself (switching function {j} of subsystem {k} sees no state): it is a choice in \
                     every stage, and other choices were not compared; declare it to have them compared"
                );
                if let Some(stage) = border {
                    text +=
                        &format!("; in stage {stage} the control lies on the border between two modes, and is neither");
                }
                return Ok(Some(Choice { text, doubt: border.map(|_| ON_BORDER) }));
            }
        }
        Ok(None)
    }

    /// Do the rates jump where switching function `j` is zero? Then the first stage whose controls are there, if any.
    fn at_jump(
        &self,
        m: &Controlled,
        s: &Subsystem,
        (psi, signs, j): (&SharedFunction, &[i8], usize),
        free: &[bool],
    ) -> Result<Option<Option<usize>>> {
        let d = self.system.dims();
        let (mut jumps, mut border) = (false, None);
        for (k, (t, x)) in m.starts.iter().enumerate() {
            let u = &m.controls[k * d.u..(k + 1) * d.u];
            let p = if self.stage_params.is_some() { self.params_of(k) } else { m.params };
            let stage = Stage { at: Point { t: *t, x, u, p }, free };
            let Some((there, distance)) = stage.nearest(psi, j) else { continue };
            jumps |= stage.jumps(s, (psi.n_out(), signs, j), &there);
            let size = u.iter().chain(&self.u_bounds[0]).chain(&self.u_bounds[1]);
            let size = size.filter(|v| v.is_finite()).fold(0f64, |m, v| m.max(v.abs()));
            if distance <= AT_BORDER * size && border.is_none() {
                border = Some(k);
            }
        }
        Ok(jumps.then_some(border))
    }
}

impl Stage<'_> {
    /// Controls with a zero of a switching function, to first order, and how far they are away.
    fn nearest(&self, psi: &SharedFunction, j: usize) -> Option<(Vec<f64>, f64)> {
        let pattern = psi.jac_pattern();
        let (mut v, mut work) = (vec![0.0; psi.n_out()], vec![0.0; psi.work_len()]);
        let mut jac = vec![0.0; pattern.nnz()];
        psi.value(&self.at, &mut v, &mut work).ok()?;
        psi.jacobian(&self.at, &mut jac, &mut work).ok()?;
        let of =
            |i: usize| if self.free[i] { pattern.get(j, self.at.x.len() + i).map_or(0.0, |e| jac[e]) } else { 0.0 };
        let gradient: Vec<f64> = (0..self.at.u.len()).map(of).collect();
        let square: f64 = gradient.iter().map(|g| g * g).sum();
        let step = -v[j] / square;
        let there = self.at.u.iter().zip(&gradient).map(|(u, g)| u + step * g).collect();
        step.is_finite().then_some((there, v[j].abs() / square.sqrt()))
    }

    /// Do modes on both sides of a switching function, of so many, have other rates with these controls?
    fn jumps(&self, s: &Subsystem, (n_psi, signs, j): (usize, &[i8], usize), controls: &[f64]) -> bool {
        let n = s.rows.len();
        let (mut rates, mut work) = (vec![0.0; n * s.n_modes], vec![0.0; s.modes.work_len()]);
        if s.modes.value(&Point { u: controls, ..self.at }, &mut rates, &mut work).is_err() {
            return false;
        }
        let largest = rates.iter().fold(0f64, |m, v| m.max(v.abs()));
        let sign = |m: usize, k: usize| signs[m * n_psi + k];
        let beside = |a: usize, b: usize| {
            (0..n_psi).all(|k| k == j || sign(a, k) * sign(b, k) >= 0) && sign(a, j) * sign(b, j) < 0
        };
        let differ = |a: usize, b: usize| (0..n).any(|i| (rates[a * n + i] - rates[b * n + i]).abs() > JUMP * largest);
        (0..s.n_modes).any(|a| (0..a).any(|b| beside(a, b) && differ(a, b)))
    }
}
