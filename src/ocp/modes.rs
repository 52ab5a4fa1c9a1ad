//! Mode sequences in and out.

use super::identify::shares;
use super::{JumpMade, Ocp, OcpResult};
use crate::dcs::Form;
use crate::error::{finite, Error, Result};
use crate::mpcc::Side;

/// A transition of a sequence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransitionAt {
    /// Time from the start of the horizon.
    pub t: f64,
    /// The transition, in the order they were added to the system.
    pub transition: usize,
    /// The control stage it is made in.
    pub stage: usize,
    /// Its guard is beyond zero where its discrete state begins, or where the control changes: it does not pass zero.
    pub at_once: bool,
}

/// The active modes along a horizon, phase by phase: one mode of every subsystem, or several while it slides.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModeSequence {
    /// Start of every phase, seconds from the start of the horizon; the first is 0, and they do not fall.
    pub times: Vec<f64>,
    /// Active modes `[times.len() · n_modes]`, in the order of [`crate::fesd::Trajectory::modes`].
    pub modes: Vec<bool>,
    /// Active cells, which modes consist of, `[times.len() · n_cells]`; may be empty where modes say all: a mode whose
    /// region takes several sign patterns does not say which, and in the Heaviside form a mode that does not depend on
    /// the sign of a switching function does not say that sign.
    pub cells: Vec<bool>,
    /// Transitions in the order of time, of systems that have some.
    pub transitions: Vec<TransitionAt>,
}

impl ModeSequence {
    fn check(&self) -> Result<()> {
        let n = self.times.len();
        finite("start of a phase", &self.times, n)?;
        if n == 0 || self.times[0] != 0.0 {
            return Err(Error::Range("a mode sequence has phases, the first of which starts at time 0".into()));
        }
        if let Some(k) = self.times.windows(2).position(|t| t[0] > t[1]) {
            return Err(Error::Range(format!("phase {} starts before phase {k}: the times must rise", k + 1)));
        }
        if self.modes.len() % n != 0 || self.cells.len() % n != 0 {
            return Err(Error::Dimension(format!(
                "{} modes and {} cells for {n} phases: give one entry for every mode of every phase",
                self.modes.len(),
                self.cells.len()
            )));
        }
        finite(
            "time of a transition",
            &self.transitions.iter().map(|t| t.t).collect::<Vec<_>>(),
            self.transitions.len(),
        )?;
        if let Some(k) = self.transitions.windows(2).position(|t| t[0].stage > t[1].stage) {
            return Err(Error::Range(format!(
                "transition {} of the sequence is in an earlier stage than the one before",
                k + 1
            )));
        }
        Ok(())
    }

    /// The active set of phase `k` as sides of the cells.
    fn sides(&self, k: usize, form: &Form) -> Result<Vec<Side>> {
        let side = |active: bool| if active { Side::First } else { Side::Second };
        let n = self.times.len();
        if self.cells.len() == n * form.n_cells && form.n_cells > 0 {
            return Ok(self.cells[k * form.n_cells..][..form.n_cells].iter().map(|&a| side(a)).collect());
        }
        let n_modes: usize = form.reported.iter().map(Vec::len).sum();
        if self.modes.len() != n * n_modes {
            return Err(Error::Dimension(format!(
                "the mode sequence has {} modes in a phase, the model {n_modes}",
                self.modes.len() / n
            )));
        }
        let mut active = vec![false; form.n_cells];
        let modes = form.reported.iter().enumerate().flat_map(|(s, modes)| modes.iter().map(move |m| (s, m)));
        for (mode, (subsystem, weights)) in modes.enumerate().filter(|(m, _)| self.modes[k * n_modes + m]) {
            let [weight] = weights[..] else {
                return Err(Error::Range(format!(
                    "mode {mode} of the sequence (subsystem {subsystem}) has several sign patterns: give the cells too"
                )));
            };
            form.factors(weight, &mut |c| active[c] = true);
        }
        if form.simplices.iter().any(|cells| !active[cells.clone()].contains(&true)) {
            return Err(Error::Range(format!(
                "the modes of phase {k} leave the sign of a switching function open: every subsystem needs an active mode, \
                 or give the cells too"
            )));
        }
        Ok(active.into_iter().map(side).collect())
    }

    /// Sides and lengths of all elements of a grid.
    pub(super) fn on_grid(&self, form: &Form, durations: &[f64], n_fe: &[usize]) -> Result<(Vec<Side>, Vec<f64>)> {
        let (mut sides, mut lengths) = (Vec::new(), Vec::new());
        let mut from = 0.0;
        for (stage, (&duration, &n)) in durations.iter().zip(n_fe).enumerate() {
            let (to, tol) = (from + duration, 1e-9 * duration);
            let mut phases: Vec<(Vec<Side>, f64)> = Vec::new();
            for (k, &start) in self.times.iter().enumerate() {
                let end = self.times.get(k + 1).copied().filter(|&t| t < to).unwrap_or(to);
                let length = end - start.max(from);
                if length > tol && start < to {
                    phases.push((self.sides(k, form)?, length));
                }
            }
            if phases.len() != n {
                phases.dedup_by(|b, a| {
                    let same = a.0 == b.0;
                    a.1 += if same { b.1 } else { 0.0 };
                    same
                });
            }
            if phases.len() > n {
                return Err(Error::Range(format!(
                    "stage {stage} has {} phases and {n} elements: give it as many elements as phases",
                    phases.len()
                )));
            }
            let of_phases: Vec<f64> = phases.iter().map(|p| p.1).collect();
            for ((set, length), n) in phases.iter().zip(shares(&of_phases, n)) {
                for _ in 0..n {
                    sides.extend_from_slice(set);
                    lengths.push(length / n as f64);
                }
            }
            from = to;
        }
        Ok((sides, lengths))
    }
}

impl OcpResult {
    /// The modes of every element of the solution, those of elements without length left out, and its transitions.
    pub fn modes(&self) -> ModeSequence {
        let elements = &self.trajectory.elements;
        let t0 = elements.first().map_or(0.0, |e| e.t);
        let mut s = ModeSequence::default();
        for e in elements.iter().filter(|e| e.h > 1e-9 * self.durations[e.stage]) {
            s.times.push(if s.times.is_empty() { 0.0 } else { e.t - t0 });
            s.modes.extend_from_slice(&e.active);
            s.cells.extend_from_slice(&e.active_cells);
        }
        if !self.phases.is_empty() {
            s.times = self.phases.iter().map(|p| p.0).collect();
            s.modes = self.phases.iter().flat_map(|p| p.1.clone()).collect();
        }
        let of = |j: &JumpMade| TransitionAt {
            t: (j.t - t0).max(0.0),
            transition: j.transition,
            stage: j.stage,
            at_once: j.at_once,
        };
        s.transitions = self.jumps.iter().map(of).collect();
        s
    }
}

impl Ocp {
    /// Can these transitions be part of a sequence of modes?
    fn check_sequence(&self, given: &[TransitionAt]) -> Result<()> {
        let n = self.system.transitions().len();
        let Some(t) = given.iter().find(|t| t.transition >= n || t.stage >= self.n_stages) else { return Ok(()) };
        Err(Error::Range(format!(
            "transition {} in stage {} of the given modes: the system has {n} transitions, the problem {} stages",
            t.transition, t.stage, self.n_stages
        )))
    }

    /// Do the discrete states allow the given transitions, one after the other?
    pub(super) fn check_given_transitions(&self) -> Result<()> {
        let Some(given) = &self.modes else { return Ok(()) };
        // initial values of discrete states are given
        let mut x = self.x0_bounds[0].clone();
        for at in &given.transitions {
            let t = &self.system.transitions()[at.transition];
            if let Some((state, value)) = t.from.iter().find(|(state, value)| x[*state] != *value) {
                return Err(Error::Range(format!(
                    "transition {} in stage {} of the given modes cannot follow those before it: the discrete state {state} is {} then, \
                     it is made from {value}",
                    at.transition, at.stage, x[*state]
                )));
            }
            t.to.iter().for_each(|(state, value)| x[*state] = *value);
        }
        Ok(())
    }

    /// Gives the order of modes: the next solves start with its branch problem, from the guesses of states and controls,
    /// and follow the homotopy only where that has no solution. Neighbours of it are tried within the budget
    /// `mode_search` only. `None` forgets it.
    ///
    /// Where simulations alone follow the system, as they do where it has transitions, only motions count that have this order of modes and
    /// transitions; times and stages say nothing then.
    ///
    /// # Errors
    /// [`Error::Range`] for times and stages that fall, for transitions that the system does not have, or that cannot follow each other.
    pub fn set_modes(&mut self, modes: Option<ModeSequence>) -> Result<()> {
        if let Some(m) = &modes {
            m.check()?;
            self.check_sequence(&m.transitions)?;
        }
        self.modes = modes;
        self.shifted = None;
        Ok(())
    }

    /// The order of modes that was given.
    pub fn modes(&self) -> Option<&ModeSequence> {
        self.modes.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequence(times: &[f64], modes: &[bool]) -> ModeSequence {
        ModeSequence { times: times.to_vec(), modes: modes.to_vec(), ..ModeSequence::default() }
    }

    #[test]
    fn what_is_no_sequence_is_refused() {
        let fits = sequence(&[0.0, 1.0], &[true, false, false, true]);
        assert!(fits.check().is_ok());
        for wrong in [
            sequence(&[], &[]),
            sequence(&[0.5], &[true, false]),
            sequence(&[0.0, 2.0, 1.0], &[true, false, true, false, true, false]),
            sequence(&[0.0, 1.0], &[true, false, true]),
            sequence(&[0.0, f64::NAN], &[true, false, true, false]),
        ] {
            assert!(wrong.check().is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn phases_get_shares_of_their_stages() {
        let form = Form {
            n_cells: 2,
            simplices: std::iter::once(0..2).collect(),
            reported: vec![vec![vec![0], vec![1]]],
            ..Form::default()
        };
        let s = sequence(&[0.0, 0.5, 0.75], &[true, false, true, true, false, true]);
        let (sides, lengths) = s.on_grid(&form, &[1.0, 1.0], &[4, 2]).unwrap();
        assert_eq!(lengths, [0.25, 0.25, 0.25, 0.25, 0.5, 0.5]);
        let (a, b) = (Side::First, Side::Second);
        assert_eq!(sides, [a, b, a, b, a, a, b, a, b, a, b, a]);
        let e = s.on_grid(&form, &[1.0], &[2]).unwrap_err().to_string();
        assert!(e.contains("3 phases and 2 elements"), "{e}");
        let none = sequence(&[0.0], &[false, false]);
        assert!(none.on_grid(&form, &[1.0], &[2]).is_err());
    }
}
