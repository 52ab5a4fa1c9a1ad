//! A unit while it runs.

use std::path::Path;

use super::{restored, Data, DATA, MODEL};
use crate::error::{Error, Result};
use crate::event::{Engine, Options, Outcome};
use crate::system::System;

/// Who makes the steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// An integrator outside.
    Exchange,
    /// The engine, from one communication point to the next.
    CoSimulation,
}

/// What an event has led to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Event {
    /// The continuous states have jumped.
    pub moved: bool,
    /// A transition has ended the run.
    pub ended: bool,
    /// The next time at which a function of time is known to bend or to jump.
    pub next: Option<f64>,
}

/// A model with its values, as the standard sees it. Value references count states, derivatives of the continuous ones, controls, parameters, event
/// indicators, and the time.
pub struct Unit {
    engine: Engine,
    system: System,
    kind: Kind,
    data: Data,
    /// Integrators outside know what there is: then there are derivatives.
    open: bool,
    /// Continuous states.
    pub continuous: Vec<usize>,
    x: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    t: f64,
    end: f64,
    f: Vec<f64>,
    watched: Vec<f64>,
    times: Vec<f64>,
    /// The modes of the start are known.
    begun: bool,
    /// Initial values may be set.
    initial: bool,
    /// In event mode: data may jump.
    in_event: bool,
    /// Data were set since the engine was told.
    told: bool,
    ended: bool,
    /// The time of the last event, and how many there were at it.
    crowd: (f64, usize),
}

impl Unit {
    /// The unit of a folder of resources.
    ///
    /// # Errors
    /// [`Error::Range`] for files that cannot be read or belong to another description; [`Error::Unsupported`] where an integrator outside is asked
    /// for what it does not know.
    pub fn open(resources: &Path, token: &str, kind: Kind) -> Result<Unit> {
        let text = |name: &str| {
            let path = resources.join(name);
            std::fs::read_to_string(&path).map_err(|e| Error::Range(format!("{} cannot be read: {e}", path.display())))
        };
        let bad = |e: serde_json::Error| Error::Range(format!("{DATA} is not that of a unit: {e}"));
        let data: Data = serde_json::from_str(&text(DATA)?).map_err(bad)?;
        if data.token != token {
            return Err(Error::Range("description and resources of the unit do not belong together".into()));
        }
        let (_, built) = restored(&text(MODEL)?)?;
        data.start.check(&built)?;
        let engine = Engine::new(&built.system, &data.start.options())?;
        let open = engine.check_outside();
        if kind == Kind::Exchange {
            open.clone()?;
        }
        let discrete = built.system.discrete_states();
        let mut unit = Unit {
            continuous: (0..built.dims.x).filter(|i| !discrete.contains(i)).collect(),
            x: Vec::new(),
            u: Vec::new(),
            p: Vec::new(),
            t: 0.0,
            end: data.start.duration,
            f: vec![0.0; built.dims.x],
            watched: vec![1.0; engine.most_watched()],
            times: built.system.known_times().iter().map(|k| k.0).collect(),
            begun: false,
            initial: true,
            in_event: false,
            told: true,
            ended: false,
            crowd: (f64::NEG_INFINITY, 0),
            open: open.is_ok(),
            engine,
            system: built.system,
            kind,
            data,
        };
        unit.reset()?;
        Ok(unit)
    }

    /// Back to the values of the description.
    ///
    /// # Errors
    /// Those of [`Engine::reinit`].
    pub fn reset(&mut self) -> Result<()> {
        let s = &self.data.start;
        (self.x, self.u, self.p) = (s.x.clone(), s.u.clone(), s.p.clone());
        (self.t, self.end) = (0.0, s.duration);
        (self.begun, self.initial, self.in_event, self.told, self.ended) = (false, true, false, true, false);
        self.crowd = (f64::NEG_INFINITY, 0);
        self.engine.reinit(0.0, &self.data.start.x)
    }

    /// Times of the experiment, and the relative tolerance that co-simulation is asked for. Only before the first step.
    ///
    /// # Errors
    /// [`Error::State`] later; [`Error::Range`] for tolerances that are not positive.
    pub fn set_up(&mut self, start: f64, stop: Option<f64>, tolerance: Option<f64>) -> Result<()> {
        if self.begun {
            return Err(Error::State("the experiment has begun".into()));
        }
        self.t = start;
        self.end = stop.filter(|s| *s > start).unwrap_or(start + self.data.start.duration);
        if let Some(r) = tolerance {
            self.engine = Engine::new(&self.system, &Options::with_tolerance(r, self.data.start.atol))?;
            self.told = true;
        }
        Ok(())
    }

    /// Initial values are complete.
    ///
    /// # Errors
    /// Those of the start of a simulation.
    pub fn finish_initial(&mut self) -> Result<()> {
        self.begin()?;
        self.initial = false;
        self.in_event = self.kind == Kind::Exchange;
        Ok(())
    }

    /// Time.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// Has a transition ended the run?
    pub fn is_ended(&self) -> bool {
        self.ended
    }

    fn tell(&mut self) -> Result<()> {
        if std::mem::take(&mut self.told) {
            self.engine.set_params(&self.p)?;
            self.engine.set_controls(&self.u)?;
        }
        Ok(())
    }

    /// Finds the modes of the start, once.
    fn begin(&mut self) -> Result<()> {
        if self.begun {
            return Ok(());
        }
        self.engine.reinit(self.t, &self.x)?;
        self.told = true;
        self.tell()?;
        self.begun = true;
        if self.open {
            let r = self.engine.go_on_outside(self.t, &self.x, self.end - self.t, false)?;
            self.settle(r)?;
        }
        Ok(())
    }

    /// Takes the state of the engine over.
    fn settle(&mut self, outcome: Outcome) -> Result<()> {
        self.x.copy_from_slice(self.engine.state());
        match outcome {
            Outcome::Reached => Ok(()),
            Outcome::Event => {
                self.ended = true;
                Ok(())
            }
            other => Err(Error::Numeric(format!("{}: {}", other.name(), self.engine.reason()))),
        }
    }

    fn n(&self) -> [usize; 6] {
        let derivatives = if self.open { self.continuous.len() } else { 0 };
        [self.x.len(), derivatives, self.u.len(), self.p.len(), self.n_indicators(), 1]
    }

    /// Number of event indicators.
    pub fn n_indicators(&self) -> usize {
        if self.open {
            self.watched.len()
        } else {
            0
        }
    }

    /// The block of a value reference, and the place in it.
    fn place(&self, reference: usize) -> Result<(usize, usize)> {
        let mut left = reference;
        for (block, n) in self.n().into_iter().enumerate() {
            if left < n {
                return Ok((block, left));
            }
            left -= n;
        }
        Err(Error::Range(format!("there is no variable with the value reference {reference}")))
    }

    /// The value of a variable.
    ///
    /// # Errors
    /// [`Error::Range`] for one that there is not; [`Error::Numeric`] where it is not defined.
    pub fn get(&mut self, reference: usize) -> Result<f64> {
        let (block, i) = self.place(reference)?;
        Ok(match block {
            0 => self.x[i],
            1 => {
                self.velocity()?;
                self.f[self.continuous[i]]
            }
            2 => self.u[i],
            3 => self.p[i],
            4 => self.indicators()?[i],
            _ => self.t,
        })
    }

    /// Sets a variable: controls and parameters at any time, in model exchange parameters in event mode only; states before the start.
    ///
    /// # Errors
    /// [`Error::Range`] for one that there is not, and for what is not finite; [`Error::State`] where it cannot be set now.
    pub fn set(&mut self, reference: usize, value: f64) -> Result<()> {
        let (block, i) = self.place(reference)?;
        crate::error::finite("value", &[value], 1)?;
        let old = match block {
            0 if self.initial => &mut self.x[i],
            2 => &mut self.u[i],
            3 => &mut self.p[i],
            _ => {
                return Err(Error::State(format!(
                    "the variable with the value reference {reference} cannot be set now"
                )))
            }
        };
        if *old != value {
            *old = value;
            self.told = true;
            // the start is looked for anew
            self.begun &= !self.initial;
        }
        Ok(())
    }

    /// Continuous states from outside.
    ///
    /// # Errors
    /// [`Error::Range`] for what is not finite.
    pub fn set_states(&mut self, x: &[f64]) -> Result<()> {
        crate::error::finite("state", x, self.continuous.len())?;
        for (i, v) in self.continuous.iter().zip(x) {
            self.x[*i] = *v;
        }
        Ok(())
    }

    /// Continuous states.
    pub fn states(&self, out: &mut [f64]) {
        out.iter_mut().zip(&self.continuous).for_each(|(o, i)| *o = self.x[*i]);
    }

    /// Sizes of the continuous states: the tolerances of the unit are relative to these.
    pub fn nominals(&self, out: &mut [f64]) {
        out.fill(1.0);
    }

    /// Time from outside.
    pub fn set_time(&mut self, t: f64) {
        self.t = t;
    }

    fn velocity(&mut self) -> Result<()> {
        self.begin()?;
        if self.kind == Kind::Exchange {
            self.engine.set_data_outside(&self.u, &self.p)?;
        } else {
            self.tell()?;
        }
        match self.engine.velocity_outside(self.t, &self.x, &mut self.f)? {
            true => Ok(()),
            false => Err(Error::Numeric(format!("the derivatives are not defined at t = {}", self.t))),
        }
    }

    /// Derivatives of the continuous states under the present modes.
    ///
    /// # Errors
    /// [`Error::Numeric`] where they are not defined.
    pub fn derivatives(&mut self, out: &mut [f64]) -> Result<()> {
        self.velocity()?;
        out.iter_mut().zip(&self.continuous).for_each(|(o, i)| *o = self.f[*i]);
        Ok(())
    }

    /// Event indicators under the present modes, positive as long as these hold.
    ///
    /// # Errors
    /// [`Error::Numeric`] where they are not defined.
    pub fn indicators(&mut self) -> Result<&[f64]> {
        self.begin()?;
        let outside = self.kind == Kind::Exchange;
        if outside {
            self.engine.set_data_outside(&self.u, &self.p)?;
        }
        match self.engine.watched_outside(self.t, &self.x, outside, &mut self.watched)? {
            true => Ok(&self.watched),
            false => Err(Error::Numeric(format!("the event indicators are not defined at t = {}", self.t))),
        }
    }

    /// Data may jump from here on.
    pub fn enter_event(&mut self) {
        self.in_event = true;
        self.told = false;
    }

    /// Integration goes on.
    pub fn leave_event(&mut self) {
        self.in_event = false;
    }

    /// The modes behind what has happened.
    ///
    /// # Errors
    /// [`Error::Numeric`] where the motion does not go on.
    pub fn event(&mut self) -> Result<Event> {
        self.begin()?;
        let before = self.x.clone();
        let at_known = self.times.iter().any(|k| (k - self.t).abs() <= 1e-12 * self.t.abs());
        let anew = at_known || (self.in_event && self.told);
        self.told = false;
        self.engine.set_data_outside(&self.u, &self.p)?;
        if !self.ended {
            let mut r = self.engine.go_on_outside(self.t, &self.x, (self.end - self.t).abs(), anew)?;
            if r == Outcome::Reached {
                r = self.engine.note_outside(&mut self.crowd);
            }
            self.settle(r)?;
        }
        Ok(Event {
            moved: self.continuous.iter().any(|i| self.x[*i] != before[*i]),
            ended: self.ended,
            next: self.times.iter().copied().find(|k| *k > self.t + 1e-12 * self.t.abs()),
        })
    }

    /// Goes to a time with the engine: controls and parameters are constant on the way. Where a transition ends the run, the time is that of it.
    ///
    /// # Errors
    /// [`Error::Range`] for times that lie behind; [`Error::Numeric`] where the motion does not go on.
    pub fn advance(&mut self, t: f64) -> Result<()> {
        self.begin()?;
        self.tell()?;
        if self.ended {
            return Ok(());
        }
        let r = self.engine.advance(t)?;
        self.t = self.engine.time();
        self.settle(r)
    }
}
