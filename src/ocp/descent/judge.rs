//! Answers judged by descents on simulations, where costates do not follow what happens in them: a descent in the controls alone says whether something is
//! to be gained, kinks included.

use crate::error::Result;
use crate::ocp::optimality::{Kink, Optimality, Verdict, NONE as NO_SLOPE, OTHER};
use crate::ocp::solve::Built;
use crate::ocp::{Ocp, OcpResult};
use crate::stop;

/// Why nothing is known of an answer whose gain may be the error of its discretisation.
const WITHIN_ERROR: &str = "a descent on simulations gains no more than the answer is off its simulation";
/// Why nothing is known of one that no descent begins at.
const NO_DESCENT: &str = "no descent on simulations leads from the answer to one that meets the constraints";
/// Why nothing is known where derivatives and descents contradict each other.
const NO_LOWER: &str = "its derivatives lead down, and no descent on simulations ends lower";
/// Multiples of the difference between an answer and its simulation that a gain must be to be one.
const BEYOND_ERROR: f64 = 10.0;
impl Ocp {
    /// Judges an answer by a descent on simulations from it: of a program `b` that was discretised, or of another one.
    pub(in crate::ocp) fn judge_by_descent(&self, r: &OcpResult, b: Option<&Built>) -> Result<Optimality> {
        let found = match b {
            Some(b) => self.lowest_from(b, r, &self.known_or_own_sizes()?)?,
            None => self.lowest_of_simulated(&self.base(Some(r))?, r)?,
        };
        let Some((found, moved)) = found else { return Ok(Optimality::unknown(NO_DESCENT)) };
        let own = r.priced;
        // what the discretisation makes of the cost, in the unit of the gain
        let error = (found.before - own).abs() / found.unit;
        if error > NO_SLOPE.sqrt() {
            return Ok(Optimality::unknown(OTHER));
        }
        let verdict = match (found.stationary, found.gain) {
            (true, gain) if gain <= NO_SLOPE && found.kink => Verdict::Kink,
            (true, gain) if gain <= NO_SLOPE => Verdict::LocalOptimum,
            (_, gain) if gain > BEYOND_ERROR * error.max(found.violated) && gain > NO_SLOPE => Verdict::NotOptimal,
            _ => return Ok(Optimality::unknown(if found.gain > NO_SLOPE { WITHIN_ERROR } else { NO_DESCENT })),
        };
        let kinks: Vec<Kink> = Vec::new();
        let mut out = Optimality::of_one_order(None, "", found.gain, Vec::new(), kinks);
        out.certify_by_descent(verdict);
        if verdict == Verdict::NotOptimal {
            out.reason = "a descent on simulations leads to less";
            out.direction = moved.controls.iter().zip(&r.controls).map(|(a, b)| a - b).collect();
        }
        Ok(out)
    }

    /// Says of the last answer what its derivatives do not, where a descent on simulations does.
    pub(in crate::ocp) fn judge_again_by_descent(&mut self) -> Result<()> {
        let Some(mut r) = self.result.take() else { return Ok(()) };
        if let Some(mut known) = r.optimality.take() {
            if known.verdict == Verdict::NotOptimal {
                known.withdraw(NO_LOWER);
            }
            r.optimality = Some(self.or_by_descent(known, &r));
            self.withhold_verdict(&mut r);
        }
        self.result = Some(r);
        Ok(())
    }

    /// What the conditions of an answer leave open, as a descent on simulations judges it, unless these are other motions or there is no time.
    pub(in crate::ocp) fn or_by_descent(&self, known: Optimality, r: &OcpResult) -> Optimality {
        if known.verdict != Verdict::Unknown || known.reason == OTHER || stop::requested().is_some() {
            return known;
        }
        match self.judge_by_descent(r, None) {
            Ok(found) if found.verdict != Verdict::Unknown => found,
            _ => known,
        }
    }
}
