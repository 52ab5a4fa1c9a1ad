//! Controls that choose: an optimal control has one of some values in every control stage.

use super::System;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// A control that takes values of a list: on or off, a gear, a number of machines.
///
/// Simulations take any value of the control. An optimal control problem keeps to the list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// The control.
    pub control: usize,
    /// Its values, ascending.
    pub values: Vec<f64>,
    /// Time for which a value holds at least once it was chosen, in units of the time; 0 without such a limit. The value at the start of
    /// a horizon may be left at any time, and the end of the horizon may cut the last one short.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub dwell: f64,
}

fn is_zero(v: &f64) -> bool {
    *v == 0.0
}

impl System {
    /// Says that a control chooses among values, in any order, and returns the number of the choice.
    ///
    /// # Errors
    /// [`Error::Range`] for a control that does not exist or chooses already, for values that are not finite, repeat or are none, and for
    /// a dwell time that is negative or not finite.
    pub fn add_choice(&mut self, control: usize, values: &[f64], dwell: f64) -> Result<usize> {
        let n = self.dims.u;
        if control >= n {
            return Err(Error::Range(format!("control {control} is to choose, but there are {n} controls")));
        }
        if self.choices.iter().any(|c| c.control == control) {
            return Err(Error::Range(format!(
                "control {control} chooses among values already: give all of them at once"
            )));
        }
        if values.is_empty() || values.iter().any(|v| !v.is_finite()) {
            return Err(Error::Range(format!("control {control} needs values to choose among, all of them finite")));
        }
        if values.len() > usize::from(u16::MAX) {
            return Err(Error::Range(format!(
                "control {control} chooses among {} values: {} at most",
                values.len(),
                u16::MAX
            )));
        }
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        if let Some(w) = sorted.windows(2).find(|w| w[0] == w[1]) {
            return Err(Error::Range(format!("control {control} chooses among values, and {} is listed twice", w[0])));
        }
        if !(dwell >= 0.0 && dwell.is_finite()) {
            return Err(Error::Range(format!(
                "the dwell time of control {control} is {dwell}: it must be finite and not negative"
            )));
        }
        self.choices.push(Choice { control, values: sorted, dwell });
        Ok(self.choices.len() - 1)
    }

    /// The controls that choose, in the order they were added.
    pub fn choices(&self) -> &[Choice] {
        &self.choices
    }

    /// Choices are an error for what does not make them.
    pub(crate) fn check_without_choices(&self, what: &str) -> Result<()> {
        match self.choices.first() {
            None => Ok(()),
            Some(c) => Err(Error::Unsupported(format!(
                "{what} makes no choices, and control {} chooses among values: fix its values, or solve one optimal control problem",
                c.control
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_sorted_and_wrong_ones_refused() {
        let mut s = System::new(1, 2, 0).unwrap();
        assert_eq!(s.add_choice(1, &[2.0, 0.0, 1.0], 0.5).unwrap(), 0);
        assert_eq!(s.choices()[0], Choice { control: 1, values: vec![0.0, 1.0, 2.0], dwell: 0.5 });
        let wrong: [(usize, &[f64], f64, &str); 7] = [
            (2, &[0.0], 0.0, "there are 2 controls"),
            (1, &[0.0], 0.0, "already"),
            (0, &[], 0.0, "needs values"),
            (0, &[f64::NAN], 0.0, "needs values"),
            (0, &[1.0, 1.0], 0.0, "twice"),
            (0, &[1.0], -1.0, "dwell"),
            (0, &[1.0], f64::INFINITY, "dwell"),
        ];
        for (control, values, dwell, text) in wrong {
            let e = s.add_choice(control, values, dwell).unwrap_err();
            assert!(matches!(&e, Error::Range(m) if m.contains(text)), "{e}");
        }
        assert!(s.check_without_choices("a controller").unwrap_err().to_string().contains("control 1"));
    }
}
