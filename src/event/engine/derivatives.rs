//! Sensitivities along a run: forward as it goes, and the record for the adjoint sweep.

use super::algebraic::Folded;
use super::{recover, Engine};
use crate::error::{finite, Error, Result};
use crate::event::adjoint::along::Along;
use crate::event::adjoint::{self, Gradient, Term};
use crate::event::field::Field;
use crate::event::radau::Radau;
use crate::event::tape::{Tape, Time};
use crate::event::Sensitivity;
use crate::func::EvalError;

impl Engine {
    /// Weights of the active modes of every sliding subsystem at the time reached, with their derivatives by the controls: calls
    /// `each(θ, ∂θ/∂u, |D|)` for every one of these modes. `|D|` is the largest change of a component of the velocity from one
    /// mode to another. Does nothing where nothing slides.
    pub(crate) fn sliding_weights(&mut self, each: &mut dyn FnMut(f64, &[f64], f64)) -> Result<()> {
        if self.field.has_contacts() || self.field.n_alg() == 0 || self.field.in_limit_set() {
            return Ok(());
        }
        let first = self.nx + self.field.p.len();
        let controls = first..first + self.field.u.len();
        for k in 0..self.field.subs.len() {
            for i in 0..if self.field.active[k].len() < 2 { 0 } else { self.field.active[k].len() } {
                let cell = self.field.active[k][i];
                let at = (self.t, &self.x[..], &self.f[..]);
                let r = self.field.theta_gradient(cell, at, &mut self.derivatives.time_row);
                if recover(r.map(|()| true), false)? {
                    let apart = self.field.largest_difference();
                    each(self.field.theta(cell), &self.derivatives.time_row[controls.clone()], apart);
                }
            }
        }
        Ok(())
    }

    /// `∂x/∂(x0, p, u)` at the time reached, row-major with one row per state, if the options ask for it, or `∂x/∂(p, u)`. After
    /// [`Engine::set_params`] or [`Engine::set_controls`] the derivatives are those with respect to changes of the
    /// parameters and controls over the whole run.
    pub fn sensitivity(&self) -> Option<&[f64]> {
        // derivatives by inputs that a model does not have are there, and have no columns
        let asked = self.options.sensitivity != Sensitivity::Off;
        let whole = || self.derivatives.sens.as_ref().map(|s| &s.s[..]);
        self.shown_sensitivity().or_else(whole).or(asked.then_some(&[]))
    }

    /// Derivatives are from here on those by the state reached, and by parameters and controls as they are from here on. With `settle` the
    /// active set is found before the first step to `t_stop`, so that [`Engine::derivative`] is that of the motion ahead.
    pub(crate) fn begin_derivatives(&mut self, settle: Option<f64>) -> Result<()> {
        if let Some(s) = &mut self.derivatives.sens {
            s.reset();
        }
        let Some(t_stop) = settle.filter(|t| self.restart && *t > self.t) else { return Ok(()) };
        self.t_stop = t_stop;
        self.begin(t_stop)
    }

    /// True where the motion since the start had several continuations somewhere, one of which was chosen.
    pub fn ambiguous(&self) -> bool {
        self.log.ambiguous
    }

    /// True where the derivatives hold for one side only, see [`Run::one_sided`](crate::event::Run::one_sided).
    pub fn one_sided(&self) -> bool {
        self.log.one_sided
    }

    /// Gradient of a function of the final state, whose derivative with respect to it is `v`, plus `terms`, by the
    /// transpose of the forward derivatives in reverse order. The options have to ask for it: the run is recorded with
    /// `nx (n_s + 1)` numbers for an explicit step of `n_s` stages (3, 6 or 12; one more where it ends at a switch on its dense output), in a sliding mode that moves other states than those
    /// its surfaces depend on alone also `n_s` for every algebraic variable and for every state that its subsystem drives, `4 nx` and three
    /// for every algebraic variable for an implicit one, and `2 nx + np + nu` for a switch. A sweep costs about as much as the run,
    /// whatever the number of parameters.
    pub fn adjoint(&mut self, v: &[f64], terms: &[Term]) -> Result<Gradient> {
        finite("derivative with respect to the state", v, self.n_shown())?;
        for t in terms {
            if let (Term::State { v, .. }, true) = (t, self.algebraic.is_some()) {
                finite("derivative of a term", v, self.n_shown())?;
            }
            if let Term::Switch { index, .. } = t {
                if *index >= self.log.switches.len() {
                    let n = self.log.switches.len();
                    return Err(Error::Range(format!("switch {index} is not in the log, which has {n}")));
                }
            }
            if let Term::Jump { index, .. } = t {
                if *index >= self.log.jumps.len() {
                    let n = self.log.jumps.len();
                    return Err(Error::Range(format!("transition {index} is not in the log, which has {n}")));
                }
            }
        }
        match self.fold(v, terms)? {
            None => self.with_tape(|tape, radau, field| adjoint::sweep(tape, radau, field, v, terms)),
            Some(Folded { v, terms, direct }) => {
                let mut g = self.with_tape(|tape, radau, field| adjoint::sweep(tape, radau, field, &v, &terms))?;
                self.unfold(&mut g, &direct);
                Ok(g)
            }
        }
    }

    /// The gradient by [`Engine::adjoint`] and its derivative in a direction, of changes of initial state, parameters and controls: the product of the
    /// Hessian with it, where `v` does not change. What `v` changes by adds a gradient of its own.
    ///
    /// The derivative has about half of the digits, and costs about ten gradients.
    ///
    /// # Errors
    /// Those of [`Engine::adjoint`]; [`Error::Unsupported`] where the run has implicit steps, contacts, zeros of higher order, or transitions that
    /// follow another event at the same time.
    pub fn adjoint_along(&mut self, v: &[f64], direction: &Gradient) -> Result<Along> {
        finite("derivative with respect to the state", v, self.n_shown())?;
        finite("direction of the initial state", &direction.x0, self.n_shown())?;
        finite("direction of the parameters", &direction.p, self.field.p.len())?;
        finite("direction of the controls", &direction.u, self.field.u.len())?;
        if self.field.has_contacts() {
            return Err(Error::Unsupported("runs with contacts have no second derivatives".into()));
        }
        let Some(Folded { v: moving, direct, .. }) = self.fold(v, &[])? else {
            return self.with_tape(|tape, radau, field| adjoint::along::sweep(tape, radau, field, v, direction));
        };
        let mut direction = direction.clone();
        self.unfold(&mut direction, &Gradient::default());
        direction.x0.resize(self.nx, 0.0);
        let mut along =
            self.with_tape(|tape, radau, field| adjoint::along::sweep(tape, radau, field, &moving, &direction))?;
        self.unfold(&mut along.gradient, &direct);
        let nx = self.n_shown();
        if let Some((change, direct)) = self.fold_along(v, &direction, &mut along)? {
            let g = self.with_tape(|tape, radau, field| adjoint::sweep(tape, radau, field, &change, &[]))?;
            let d = &mut along.derivative;
            for (to, own) in [(&mut d.x0, &g.x0), (&mut d.p, &g.p), (&mut d.u, &g.u)] {
                to.iter_mut().zip(own).for_each(|(t, g)| *t += g);
            }
            self.unfold(&mut along.derivative, &direct);
        }
        along.state.truncate(nx);
        Ok(along)
    }

    /// Goes over the record, and puts everything back.
    fn with_tape<T>(&mut self, go: impl FnOnce(&Tape, &Radau, &mut Field) -> Result<T>) -> Result<T> {
        // the dense output of the last step may need functions at values that change below
        self.save_dense()?;
        let Some(tape) = self.derivatives.tape.take() else {
            return Err(Error::State("the run is not recorded: ask for the adjoint in the options".into()));
        };
        let held = self.field.hold();
        let r = go(&tape, &self.stepper.radau, &mut self.field);
        self.field.release(held);
        self.derivatives.tape = Some(tape);
        if self.field.active.iter().all(|a| !a.is_empty()) {
            // weights belong to the present point again
            let there = self.field.rhs(self.t, &self.x, &mut self.stepper.node);
            recover(there.map(|()| true), false)?;
        }
        r
    }

    /// The step that ends at `t1` moves the derivatives.
    pub(super) fn differentiate_step(&mut self, t1: f64) -> Result<()> {
        if self.field.in_limit_set() {
            self.blur_sensitivity();
            return Ok(());
        }
        if let Some(mut s) = self.derivatives.sens.take() {
            let r = if self.stepper.step_implicit {
                s.implicit(&self.stepper.radau, &mut self.field, &self.stepper.step)
            } else {
                s.explicit(
                    self.stepper.pair,
                    &mut self.field,
                    &self.stepper.step,
                    t1 - (self.stepper.step.t + self.stepper.step.h),
                )
            };
            self.log.one_sided |= !recover(r.map(|()| true), false)?;
            self.derivatives.sens = Some(s);
        }
        if let Some(tape) = &mut self.derivatives.tape {
            if self.stepper.step_implicit {
                tape.implicit(&self.stepper.radau, &self.field, &self.stepper.step, t1);
            } else {
                tape.explicit(self.stepper.pair, &mut self.field, &self.stepper.step, t1);
            }
        }
        Ok(())
    }

    /// Derivatives of the time at which watch `l` vanishes here; the velocity is that before the switch.
    pub(super) fn differentiate_time(&mut self, l: usize) -> std::result::Result<(), EvalError> {
        if self.field.in_limit_set() {
            self.mark_time(Time::Unknown);
            return Ok(());
        }
        if self.derivatives.sens.is_some() || self.derivatives.tape.is_some() {
            match self.functions.flat.as_ref().map(|f| f.beside) {
                Some(beside) => {
                    self.time_gradient_at_flat(l, beside)?;
                    if let Some(tape) = &mut self.derivatives.tape {
                        tape.forget_event();
                    }
                }
                None => {
                    let at = (self.t, &self.x[..], &self.f[..]);
                    self.functions.watches[l].time_gradient(&mut self.field, at, &mut self.derivatives.time_row)?;
                    if let Some(tape) = &mut self.derivatives.tape {
                        tape.announce(&self.field, self.functions.watches[l], self.t, &self.x, &self.f);
                    }
                }
            }
        }
        if let Some(s) = &mut self.derivatives.sens {
            s.time(&self.derivatives.time_row);
        }
        Ok(())
    }

    /// The velocity changes at a switch from `before` to the present one.
    pub(super) fn differentiate_jump(&mut self, before: &[f64]) {
        if let Some(s) = &mut self.derivatives.sens {
            s.jump(before, &self.f);
        }
        if let Some(tape) = &mut self.derivatives.tape {
            let n_c = self.derivatives.time_row.len() - 1;
            let (first, row) = (self.log.switches.len(), &self.derivatives.time_row[..n_c]);
            tape.switch(&self.field, first, row, [before, &self.f]);
        }
    }

    /// What follows in the log is a change at a time that is given, or has no derivative.
    pub(super) fn mark_time(&mut self, time: Time) {
        if let Some(s) = &mut self.derivatives.sens {
            s.dt.fill(if time == Time::Fixed { 0.0 } else { f64::NAN });
        }
        if let Some(tape) = &mut self.derivatives.tape {
            tape.mark(self.log.switches.len(), time);
        }
    }

    /// The derivatives are lost.
    pub(super) fn blur_sensitivity(&mut self) {
        if let Some(s) = &mut self.derivatives.sens {
            s.s.fill(f64::NAN);
        }
        if let Some(tape) = &mut self.derivatives.tape {
            tape.gap(self.t);
        }
    }

    /// A sliding mode that begins ties the derivatives to its surfaces.
    pub(super) fn project_sensitivity(&mut self) -> std::result::Result<(), EvalError> {
        if self.field.n_alg() == 0 || self.field.is_explicit_only() {
            return Ok(());
        }
        if let Some(s) = &mut self.derivatives.sens {
            self.field.hidden(self.t, &self.x)?;
            s.project(&mut self.field);
        }
        if let Some(tape) = &mut self.derivatives.tape {
            tape.project(&self.field, self.t, &self.x);
        }
        Ok(())
    }
}
