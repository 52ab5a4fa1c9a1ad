//! Clocks: transitions at known times, and pulses whose width an expression says.
//!
//! A clock counts how often it has struck in a discrete state. Its guard is the time less that of the next strike, so the times are those of the formula to the
//! last digit, however many there are, and steps end at them.

use super::{Built, Model, Transition};
use crate::error::{finite, Error, Result};
use crate::expr::{Block, Dag, Id};
use crate::system::{Direction, Rule};

/// When a clock strikes.
#[derive(Debug, Clone, PartialEq)]
pub enum Strikes {
    /// At `offset`, `offset + period`, and so on.
    Every {
        /// From one strike to the next, positive.
        period: f64,
        /// The first one.
        offset: f64,
    },
    /// At these times, which increase.
    At(Vec<f64>),
}

/// What happens at known times.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// The times.
    pub strikes: Strikes,
    /// The discrete state that counts them. A run that begins later begins with the number of times before it.
    pub count: usize,
    /// States and what they become, expressions of the state before: a sampled value, a controller.
    pub reset: Vec<(usize, Id)>,
    /// Discrete states and the values they have behind it.
    pub to: Vec<(usize, f64)>,
}

impl Clock {
    /// One that strikes at `offset`, `offset + period`, and so on, and counts that, and nothing else.
    pub fn every(period: f64, offset: f64, count: usize) -> Clock {
        Clock { strikes: Strikes::Every { period, offset }, count, reset: Vec::new(), to: Vec::new() }
    }

    /// The transitions that it is: one, or one for each time of a list.
    ///
    /// # Errors
    /// [`Error::Range`] for times that are not finite, a period that is not positive, times that do not increase or that there are none of, and where
    /// something else is to change the count.
    pub fn transitions(&self, dag: &mut Dag) -> Result<Vec<Transition>> {
        if self.reset.iter().map(|r| r.0).chain(self.to.iter().map(|t| t.0)).any(|i| i == self.count) {
            let i = self.count;
            return Err(Error::Range(format!("state {i} counts the strikes of the clock: reset another one")));
        }
        let one = |guard: Id, from: Vec<(usize, f64)>, reset: Vec<(usize, Id)>, to: Vec<(usize, f64)>| Transition {
            guard,
            direction: Direction::Rising,
            from,
            reset,
            to,
            rule: Rule::default(),
        };
        let t = dag.input(Block::T, 0);
        match &self.strikes {
            Strikes::Every { period, offset } => {
                let count = dag.input(Block::X, self.count);
                let guard = since(dag, (*period, *offset), count)?;
                let next = dag.constant(1.0);
                let mut reset = self.reset.clone();
                reset.push((self.count, dag.add(count, next)));
                Ok(vec![one(guard, Vec::new(), reset, self.to.clone())])
            }
            Strikes::At(times) => {
                finite("time of a clock", times, times.len())?;
                if times.is_empty() || times.windows(2).any(|w| w[0] >= w[1]) {
                    return Err(Error::Range(
                        "the times of a clock must increase, and there must be one at least".into(),
                    ));
                }
                let all = times.iter().enumerate().map(|(k, &at)| {
                    let at = dag.constant(at);
                    let mut to = self.to.clone();
                    to.push((self.count, (k + 1) as f64));
                    one(dag.sub(t, at), vec![(self.count, k as f64)], self.reset.clone(), to)
                });
                Ok(all.collect())
            }
        }
    }
}

/// A clock counts in a state that there is.
pub(crate) fn is_state(i: usize, nx: usize) -> Result<()> {
    match i < nx {
        true => Ok(()),
        false => {
            Err(Error::Range(format!("the clock counts in state {i}, but there are {nx}: add a discrete state for it")))
        }
    }
}

/// Time since strike number `count` of a clock.
fn since(dag: &mut Dag, (period, offset): (f64, f64), count: Id) -> Result<Id> {
    finite("period and offset of a clock", &[period, offset], 2)?;
    if period <= 0.0 {
        return Err(Error::Range(format!("the period of a clock is {period}: it must be positive")));
    }
    let (t, by, first) = (dag.input(Block::T, 0), dag.constant(period), dag.constant(offset));
    let gone = dag.mul(by, count);
    let at = dag.add(first, gone);
    Ok(dag.sub(t, at))
}

/// Pulse-width modulation: a discrete state that is 1 from every strike of a clock on, until a part `duty` of the period is over, and then 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pwm {
    /// A part of the period, an expression: the pulse ends where the ramp reaches it. Of a value that a clock holds it is that of the start.
    pub duty: Id,
    /// The period, positive.
    pub period: f64,
    /// The first strike.
    pub offset: f64,
    /// The discrete state that is the pulse.
    pub pulse: usize,
    /// The discrete state that counts the strikes.
    pub count: usize,
}

impl Pwm {
    /// The two transitions that it is: the pulse ends, and begins.
    ///
    /// # Errors
    /// Those of [`Clock::transitions`]; [`Error::Range`] for a number as `duty` that is not between 0 and 1.
    pub fn transitions(&self, dag: &mut Dag) -> Result<Vec<Transition>> {
        if let Some(d) = dag.as_const(self.duty).filter(|d| !(0.0..=1.0).contains(d)) {
            return Err(Error::Range(format!("the duty is {d}: a part of the period is between 0 and 1")));
        }
        let clock = Clock { to: vec![(self.pulse, 1.0)], ..Clock::every(self.period, self.offset, self.count) };
        let begins = clock.transitions(dag)?;
        let (count, next) = (dag.input(Block::X, self.count), dag.constant(1.0));
        let last = dag.sub(count, next);
        let ramp = since(dag, (self.period, self.offset), last)?;
        let period = dag.constant(self.period);
        let width = dag.mul(period, self.duty);
        let ends = Transition {
            guard: dag.sub(ramp, width),
            direction: Direction::Rising,
            from: vec![(self.pulse, 1.0)],
            reset: Vec::new(),
            to: vec![(self.pulse, 0.0)],
            rule: Rule::default(),
        };
        Ok([ends].into_iter().chain(begins).collect())
    }
}

impl Model {
    /// Adds a clock, with expressions of the graph that the model is built with, and returns the index of its first transition.
    ///
    /// # Errors
    /// Those of [`Clock::transitions`]. What is wrong with the states is said when the model is built.
    pub fn add_clock(&mut self, dag: &mut Dag, clock: &Clock) -> Result<usize> {
        is_state(clock.count, self.dims.x)?;
        let (first, all) = (self.transitions.len(), clock.transitions(dag)?);
        self.transitions.extend(all);
        Ok(first)
    }

    /// Adds pulse-width modulation, see [`Model::add_clock`].
    ///
    /// # Errors
    /// Those of [`Pwm::transitions`].
    pub fn add_pwm(&mut self, dag: &mut Dag, pwm: &Pwm) -> Result<usize> {
        is_state(pwm.count, self.dims.x)?;
        let (first, all) = (self.transitions.len(), pwm.transitions(dag)?);
        self.transitions.extend(all);
        Ok(first)
    }
}

impl Built {
    /// Adds a clock to a model that is built already, with expressions of its graph, and returns the index of its first transition.
    ///
    /// # Errors
    /// Those of [`Clock::transitions`] and of [`Built::add_transition`].
    pub fn add_clock(&mut self, dag: &mut Dag, clock: &Clock) -> Result<usize> {
        is_state(clock.count, self.dims.x)?;
        let all = clock.transitions(dag)?;
        self.add_all(dag, all)
    }

    /// Adds pulse-width modulation, see [`Built::add_clock`].
    ///
    /// # Errors
    /// Those of [`Pwm::transitions`] and of [`Built::add_transition`].
    pub fn add_pwm(&mut self, dag: &mut Dag, pwm: &Pwm) -> Result<usize> {
        is_state(pwm.count, self.dims.x)?;
        let all = pwm.transitions(dag)?;
        self.add_all(dag, all)
    }

    fn add_all(&mut self, dag: &mut Dag, all: Vec<Transition>) -> Result<usize> {
        let first = self.transitions.len();
        for t in all {
            self.add_transition(dag, t)?;
        }
        Ok(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Graph;

    #[test]
    fn what_is_no_clock_is_refused() {
        let (g, mut m) = (Graph::new(), Model::new("none", 2, 0, 0).unwrap());
        let mut refused = |c: Clock| matches!(m.add_clock(&mut g.dag(), &c), Err(Error::Range(_)));
        assert!(refused(Clock::every(0.0, 0.0, 1)) && refused(Clock::every(f64::NAN, 0.0, 1)));
        assert!(refused(Clock::every(1.0, f64::INFINITY, 1)) && refused(Clock::every(1.0, 0.0, 2)));
        assert!(refused(Clock { to: vec![(1, 0.0)], ..Clock::every(1.0, 0.0, 1) }));
        for times in [vec![], vec![1.0, 1.0], vec![2.0, 1.0], vec![f64::NAN]] {
            assert!(refused(Clock { strikes: Strikes::At(times), ..Clock::every(1.0, 0.0, 1) }));
        }
        let duty = g.constant(1.5).id();
        assert!(m.add_pwm(&mut g.dag(), &Pwm { duty, period: 1.0, offset: 0.0, pulse: 0, count: 1 }).is_err());
    }
}
