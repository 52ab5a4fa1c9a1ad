//! The MPCC of a FESD step decides where the conditions (6.19) do not.

use super::Simulator;
use crate::error::Result;
use crate::event::Arbiter;
use crate::nlp::{Control, Outcome};
use crate::settings::Settings;
use crate::system::System;

/// Decides for an event-driven simulation ([`Engine::set_arbiter`](crate::event::Engine::set_arbiter)) by a step of
/// length `h` from the point in doubt: the modes of its first element.
pub fn arbiter(system: &System, settings: &Settings, h: f64) -> Result<Arbiter> {
    let mut sim = Simulator::new(system, settings)?;
    Ok(Box::new(move |at| {
        sim.set_state(at.t, at.x).ok()?;
        sim.set_controls(at.u).ok()?;
        sim.set_params(at.p).ok()?;
        let mut r = sim.empty_result();
        sim.advance(h, &mut Control::default(), &mut r);
        if r.outcome != Outcome::Solved {
            return None;
        }
        let mut active = &r.trajectory.elements.first()?.active[..];
        let mut modes = Vec::new();
        for n in &r.trajectory.modes {
            let (own, rest) = active.split_at_checked(*n)?;
            modes.push((0..*n).filter(|m| own[*m]).collect());
            active = rest;
        }
        Some(modes)
    }))
}
