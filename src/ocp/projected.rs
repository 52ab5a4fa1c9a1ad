//! Answers of projected systems judged by descents on simulations. The multipliers of their constraints are no subsystem with
//! indicators that costates could be followed through; but the event-driven engine knows derivatives through constraints that come
//! and go, and a descent in the controls alone says whether something is to be gained, kinks included.

use super::accuracy::with_cost;
use super::extend::Extended;
use super::optimality::{Kink, Optimality, Verdict, NONE as NO_SLOPE, OTHER};
use super::rewire::Rewire;
use super::solve::Built;
use super::terms::{combination, Stack};
use super::{Ocp, OcpResult};
use crate::error::Result;
use crate::func::Dims;
use crate::system::{Contact, Inertia, Mechanics, SharedFunction, System};

/// Why nothing is known of an answer whose gain may be the error of its discretisation.
const WITHIN_ERROR: &str = "a descent on simulations gains no more than the answer is off its simulation";
/// Why nothing is known of one that no descent begins at.
const NO_DESCENT: &str = "no descent on simulations leads from the answer to one that meets the constraints";
/// Multiples of the difference between an answer and its simulation that a gain must be to be one.
const BEYOND_ERROR: f64 = 10.0;

impl Ocp {
    /// The system that answers are simulated with for derivatives: the cost, then linear controls, then the states.
    pub(super) fn system_with_cost(&self, e: &Extended) -> Result<System> {
        match &self.projected {
            Some(projected) => projected_with_cost(projected, e.system.dims(), e.lagrange.as_ref(), &self.linear),
            None => with_cost(&e.system, e.lagrange.as_ref(), &self.linear),
        }
    }

    /// Judges an answer of a projected system by a descent from it.
    pub(super) fn judge_by_descent(&self, r: &OcpResult, b: &Built) -> Result<Optimality> {
        let known = self.known_or_own_sizes()?;
        let controls = (&r.controls[..], &r.control_ends[..]);
        let Some((found, moved)) = self.lowest_from(b, r, controls, &known)? else {
            return Ok(Optimality::unknown(NO_DESCENT));
        };
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
}

/// A projected system with more parameters and controls, behind the integral of `lagrange` and its linear controls, whose rates are controls then.
/// These are coordinates: contacts act on the states behind them alone.
pub(super) fn projected_with_cost(
    system: &System,
    wide: Dims,
    lagrange: Option<&SharedFunction>,
    linear: &[bool],
) -> Result<System> {
    let from = system.dims();
    let ramps: Vec<(usize, usize)> = (0..linear.len()).filter(|&j| linear[j]).zip(1..).collect();
    let first = 1 + ramps.len();
    let to = Dims { x: from.x + first, ..wide };
    let Some(m) = system.mechanics() else { return Ok(system.clone()) };
    // what is behind the parameters of the system stays behind those of the wider one
    let gather = |f: &SharedFunction| {
        let more = f.dims().p - from.p;
        let places = Dims { p: to.p + more, ..to };
        let states = (0..from.x).map(|i| first + i);
        let ramp = |j: usize| ramps.iter().find(|r| r.0 == j).map(|r| r.1);
        let controls = (0..from.u).map(|j| ramp(j).unwrap_or(to.x + j));
        let own = (0..from.p).map(|k| to.x + to.u + k);
        let behind = (0..more).map(|k| to.t_col() + k);
        let columns = states.chain(controls).chain(own).chain(behind).chain([places.t_col()]).collect();
        Stack::gather(f, places, columns)
    };
    let cost = match lagrange {
        Some(l) => Rewire::behind(wide, to, &ramps).function(l),
        None => combination("0", to, vec![Vec::new()]),
    };
    let slopes = combination("slopes", to, ramps.iter().map(|&(j, _)| vec![(to.x + j, 1.0)]).collect());
    let all = || (0..to.n_in()).collect::<Vec<usize>>();
    let smooth = Stack::of("f0", to, vec![(cost, all()), (slopes, all()), (gather(&m.smooth), all())]);
    let contact = |c: &Contact| Contact {
        name: c.name.clone(),
        n_tangents: c.n_tangents,
        gap: gather(&c.gap),
        motion: gather(&c.motion),
        reaction: gather(&c.reaction),
        local: None,
    };
    let inertia = match &m.inertia {
        Inertia::Varying { matrix, product } => Inertia::Varying { matrix: gather(matrix), product: gather(product) },
        other => other.clone(),
    };
    let contacts = m.contacts.iter().map(contact).collect();
    let wider = Mechanics {
        n_q: first,
        smooth,
        inertia,
        contacts,
        bounds: Vec::new(),
        projection: None,
        ..Mechanics::clone(m)
    };
    System::of_mechanics(wider, to.u, to.p)
}
