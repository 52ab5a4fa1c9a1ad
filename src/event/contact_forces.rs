//! Modes and forces of the contacts of a scene, read off a run.

use super::Run;
use crate::contact::Dynamics;
use crate::error::{Error, Result};
use crate::func::Point;

impl Run {
    /// Modes of all contacts at a time: 0 open, 1 closed (sticking, where there is friction), 2 sliding, 3 sliding against
    /// the tangent. At the time of an event they are those before it.
    pub fn contact_modes(&self, t: f64) -> Result<&[usize]> {
        let behind = self.phases.partition_point(|p| p.t < t);
        match self.phases.get(behind.saturating_sub(1)) {
            Some(p) => Ok(&p.modes),
            None => Err(Error::State("the run has no contacts: it is not that of a scene".into())),
        }
    }

    /// Contact forces at a time, for every contact the normal force and the tangential ones in the order of the tangents; zero
    /// where it is open. Dry friction at a joint stands behind a zero, and the force of a constraint has either sign. Forces, not impulses:
    /// those are in [`Run::impacts`].
    ///
    /// # Errors
    /// [`Error::State`] without contacts, or without dense output where `t` is not the end.
    pub fn contact_forces(&self, t: f64) -> Result<Vec<[f64; 3]>> {
        let modes: Vec<Vec<usize>> = self.contact_modes(t)?.iter().map(|&m| vec![m]).collect();
        let behind = self.phases.partition_point(|p| p.t < t);
        let (Some(phase), Some(mechanics)) = (self.phases.get(behind.saturating_sub(1)), &self.mechanics) else {
            return Err(Error::State("the run has no contacts: it is not that of a scene".into()));
        };
        let mut x = self.x.clone();
        if t != self.t {
            let path = self.path.as_ref();
            path.ok_or_else(|| Error::State("forces at other times need the dense output: ask for it".into()))?
                .eval(t, 0, &mut x)?;
        }
        x.extend_from_slice(&phase.behind);
        let mut dynamics = Dynamics::new(mechanics);
        // what has just begun to slide has a velocity that is rounding: its direction is that of its acceleration
        for start in &phase.starting {
            dynamics.directions[start.contact] = start.direction;
            dynamics.begins[start.contact] = start.unseen;
        }
        let at = Point { t, x: &x, u: &phase.u, p: &phase.p };
        match dynamics.accelerate(&at, &modes) {
            Ok(()) => Ok((0..).zip(&dynamics.forces).map(|(i, f)| dynamics.of_results(i, *f)).collect()),
            Err(_) => Err(Error::NonFinite(format!("the contact forces are not defined at t = {t}"))),
        }
    }
}
