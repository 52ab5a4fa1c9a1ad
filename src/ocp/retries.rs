//! Problems without a search of their own, solved from other controls where the guess leads nowhere.
//!
//! A local method may end where constraints cannot be met any better near by although they can elsewhere: on the near side of an
//! obstacle in the middle of the way, say.

use std::time::Instant;

use super::candidates::Candidates;
use super::request::Request;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::nlp::{allowance, Control, Outcome};
use crate::settings::{InitialGuess, OcpStart};
use crate::stop;

/// Other controls that are tried, at random within their bounds: every second of them with the states that they lead to.
const OTHERS: usize = 4;

impl Ocp {
    /// As [`Ocp::run`], and cold solves of problems for which no guess is given that end without a solution are tried from other
    /// controls. Where none of them leads to one the result is that of the first.
    pub(super) fn run_from_several(
        &mut self,
        start: Start,
        request: &Request,
        control: &mut Control,
    ) -> Result<&OcpResult> {
        let clock = Instant::now();
        let given = self.x_guess.is_some() || self.u_guess.is_some() || self.modes.is_some();
        let may = start == Start::Cold && request.start != OcpStart::Homotopy && !given && self.system.dims().u > 0;
        let first = self.run(start, request, control)?;
        if !may
            || !matches!(
                first.outcome,
                Outcome::Infeasible | Outcome::LocallyInfeasible | Outcome::Stalled | Outcome::MaxIter
            )
        {
            return self.last_result();
        }
        let mut found = Candidates::default();
        found.add(first);
        found.known = self.sizes()?;
        let mut inside = request.of_a_part();
        for (k, controls) in self.random_starts(OTHERS + 1, 0).iter().enumerate().skip(1) {
            if stop::requested().is_some() || allowance::is_over() {
                break;
            }
            let mut one = Box::new(self.blank());
            one.set_u_guess(controls)?;
            let states = if k % 2 == 0 { InitialGuess::Simulation } else { request.options.initial_guess };
            inside.options.initial_guess = states;
            let r = match one.run(Start::Cold, &inside, control) {
                Ok(r) => r,
                // the first answer stays one where there is no time for others
                Err(Error::Interrupted | Error::OutOfTime) => break,
                Err(e) => return Err(e),
            };
            found.add(r);
            if r.outcome == Outcome::Solved {
                found.best = Some(one);
                self.adopt(&mut found, request, control)?;
                break;
            }
        }
        self.spent_in_all(&found, clock)
    }
}
