//! Impacts: the contacts that take part, the velocities behind, and impacts that accumulate.

use super::contact::{SceneRoom, AT_REST, LAST};
use super::search::GRAZES;
use super::{Engine, EPS};
use crate::contact::{mode, Closed, Impulse};
use crate::event::watch::ContactWatch;
use crate::event::{Accumulation, Impact, ImpactKind, Outcome, Zeno};
use crate::func::{EvalError, EvalResult};
use crate::system::ImpactLaw;

/// Impacts at one time at most, one after the other.
const MOST: usize = 1000;

impl Engine {
    /// Makes the impacts at the present point, if there are any. Says whether they are unique.
    pub(super) fn collide(
        &mut self,
        event: Option<(usize, ContactWatch)>,
        recorded: bool,
    ) -> std::result::Result<bool, EvalError> {
        self.touching(event)?;
        if self.field.scene().is_some_and(|c| c.dynamics.is_first_order()) {
            return Ok(true);
        }
        let mut list = std::mem::take(&mut self.contact_events.scene.list);
        self.contact_events.scene.roundings.clear();
        let mut unique = true;
        for made in 0.. {
            let Some((worst, law)) = self.closing(event.filter(|_| made == 0))? else { break };
            if made == MOST {
                let text = format!("{MOST} impacts at one time: with this law the bodies do not come apart");
                self.fail(Outcome::NoContinuation, text);
                return Ok(false);
            }
            list.clear();
            if law == ImpactLaw::Sequential {
                list.push((worst, None));
                // the next contact closes because of the first: another order may have another end
                unique &= !(made == 1 && self.contact_events.scene.touching.len() > 1);
            } else {
                list.extend(self.contact_events.scene.touching.iter().map(|i| (*i, None)));
            }
            self.last_of(&list)?;
            if let (Some((_, rest)), Zeno::Stop) = (self.contact_events.scene.last.first(), self.options.zeno) {
                let limit = self.t + rest;
                self.end_at_accumulation(limit);
                return Ok(false);
            }
            let merges = self.contact_events.scene.merges;
            for c in list.iter_mut().filter(|c| merges || self.contact_events.scene.last.iter().any(|l| l.0 == c.0)) {
                c.1 = Some(0.0);
            }
            let last = merges || !self.contact_events.scene.last.is_empty();
            let kind = if last { ImpactKind::Last } else { ImpactKind::Collision };
            let struck = self.strike(&list, kind, recorded)?;
            self.check_laws(&list);
            if self.log.outcome != Outcome::Reached {
                return Ok(false);
            }
            let Some(one) = struck else {
                self.fail(Outcome::NoContinuation, "no impulses satisfy the conditions of the impact".into());
                return Ok(false);
            };
            unique &= one;
            for k in 0..self.contact_events.scene.last.len() {
                let (t, rest) = (self.t, self.contact_events.scene.last[k].1);
                self.log.stats.accumulations += 1;
                self.accumulations_push(Accumulation { t: t + rest, until: t, steps: 0, error: 0.0 });
                self.log.one_sided = true;
            }
            if self.log.outcome != Outcome::Reached {
                return Ok(false);
            }
        }
        self.contact_events.scene.list = list;
        Ok(unique)
    }

    /// The contact that closes fastest, relative to the size of its rate, if one closes.
    pub(super) fn closing(
        &mut self,
        event: Option<(usize, ContactWatch)>,
    ) -> std::result::Result<Option<(usize, ImpactLaw)>, EvalError> {
        let SceneRoom { touching: all, roundings, .. } = &self.contact_events.scene;
        let r = self.field.with_contacts(self.t, &self.x, |c, at, modes| {
            let mut worst = (0.0, None);
            for &i in all {
                if !c.dynamics.opens(i) {
                    continue;
                }
                c.dynamics.load_gap(at, i)?;
                let rate = c.dynamics.block(i).gap[1];
                let size = c.sizes[i][3];
                // rounding of what is held is no collision, a collision however slow is one
                let open = modes[i][0] == mode::OPEN;
                let struck = roundings.iter().filter(|r| r.0 == i).map(|r| r.1).reduce(f64::max);
                let noise = match struck {
                    // an impact holds what it closes
                    Some(rounding) => rounding.max(AT_REST * size),
                    None if open && event == Some((i, ContactWatch::Gap)) => 0.0,
                    None if open => 64.0 * EPS * size,
                    None => AT_REST * size,
                };
                if rate < -noise && rate / size < worst.0 {
                    worst = (rate / size, Some(i));
                }
            }
            Ok(worst.1.map(|i| (i, c.dynamics.mechanics.law)))
        });
        r.unwrap_or(Ok(None))
    }

    /// Ends the run where friction or restitution of one of these contacts, which are loaded, is none: they may be expressions
    /// that are fine at the start and not later.
    pub(super) fn check_laws(&mut self, list: &[(usize, Option<f64>)]) {
        let bad = self.field.scene().and_then(|c| {
            list.iter().find_map(|&(i, e)| {
                let (b, name) = (c.dynamics.block(i), &c.dynamics.mechanics.contacts[i].name);
                if let Some(text) = c.flaw_of_friction(i) {
                    return Some(text);
                }
                let fine = e.is_some() || (0.0..=1.0).contains(&b.restitution);
                (!fine).then(|| {
                    format!("contact {name} has restitution {} there: it must lie between 0 and 1", b.restitution)
                })
            })
        });
        if let Some(text) = bad {
            self.fail(Outcome::NoContinuation, text);
        }
    }

    /// Those of closing contacts whose impacts would go on in ever shorter time, but for nothing that the tolerances see,
    /// with the time until they end. With the closing speed `w = −e ġ⁻` behind this impact and the acceleration `−a`, the
    /// flights take `2w/a, 2ew/a, …`: their sum is `2w/(a (1−e))`.
    pub(super) fn last_of(&mut self, list: &[(usize, Option<f64>)]) -> std::result::Result<(), EvalError> {
        let (length, n_z) = (self.usual_step(), self.field.n_z);
        let (rtol, atol) = (&self.rtol, &self.atol);
        let SceneRoom { last: out, closed, row, .. } = &mut self.contact_events.scene;
        out.clear();
        let r = self.field.with_contacts(self.t, &self.x, |c, at, modes| {
            for &(i, _) in list {
                c.dynamics.load_gap(at, i)?;
                c.dynamics.load_contact(at, i)?;
                let (e, rate) = (c.dynamics.block(i).restitution, c.dynamics.block(i).gap[1]);
                if !(e > 0.0 && e < 1.0 && rate < 0.0) {
                    continue;
                }
                // as it flies: the other contacts as they are
                closed.clear();
                for k in (0..modes.len()).filter(|k| *k != i && modes[*k][0] != mode::OPEN) {
                    closed.push(Closed { contact: k, rests: modes[k][0] == mode::CLOSED });
                }
                let sizes = &c.sizes;
                let loaded = c.is_at(at);
                let follow = c.dynamics.follow(at, closed, &|k| sizes[k][1], (length, loaded));
                c.forget();
                let follow = follow?;
                let Some(choice) = follow.all.first() else { continue };
                c.dynamics.begin(choice);
                c.dynamics.accelerate(at, &choice.modes)?;
                c.dynamics.load_contact(at, i)?;
                let a = -c.dynamics.gap_acceleration(i);
                if a <= 0.0 {
                    continue;
                }
                let w = -e * rate;
                let rest = 2.0 * w / (a * (1.0 - e));
                row.clear();
                row.resize(n_z, 0.0);
                c.dynamics.gap_gradient(at, i, row)?;
                let n_q = c.dynamics.mechanics.n_q;
                let states = at.x[..n_q].iter().enumerate();
                let tolerance: f64 = states.map(|(k, x)| row[k].abs() * (rtol[k] * x.abs() + atol[k])).sum();
                if a * rest * rest <= LAST * tolerance.max(EPS * c.sizes[i][0]) {
                    out.push((i, rest));
                }
            }
            Ok(())
        });
        r.unwrap_or(Ok(()))
    }

    /// One impact of these contacts, without a collision where `kind` says so. Says whether it is unique; none where there is
    /// no impact.
    pub(super) fn strike(
        &mut self,
        list: &[(usize, Option<f64>)],
        kind: ImpactKind,
        recorded: bool,
    ) -> std::result::Result<Option<bool>, EvalError> {
        let mut after = std::mem::take(&mut self.contact_events.scene.after);
        after.clone_from(&self.x);
        if recorded {
            self.derivatives.reset.clear_derivatives();
        }
        let jac = &mut self.derivatives.reset.jac;
        let r = self.field.with_contacts(self.t, &self.x, |c, at, _| {
            let sizes = &c.sizes;
            let collision = kind != ImpactKind::Painleve;
            let found = c.dynamics.impact(at, list, collision, &|i, _| sizes[i][3], &mut after)?;
            if let (Some(impact), true) = (&found, recorded) {
                c.dynamics.impact_jacobian(at, &after, impact, jac)?;
            }
            Ok(found)
        });
        let Some(impact) = r.unwrap_or(Ok(None))? else { return Ok(None) };
        let unique = impact.unique && kind != ImpactKind::Painleve;
        self.contact_events.scene.roundings.extend(impact.parts.iter().map(|p| (p.contact, p.rounding)));
        self.record(&impact.parts, kind, unique && impact.proven && !impact.redundant);
        self.jump_to(&after, recorded)?;
        self.contact_events.scene.after = after;
        Ok(Some(unique))
    }

    /// The state becomes `after` by a reset with the last Jacobian.
    pub(super) fn jump_to(&mut self, after: &[f64], recorded: bool) -> EvalResult {
        self.x.copy_from_slice(after);
        self.settle_jump()?;
        if !recorded {
            return Ok(());
        }
        if let Some(s) = &mut self.derivatives.sens {
            s.reset_by(&self.derivatives.reset.jac);
        }
        if self.derivatives.tape.is_some() {
            self.contact_events.scene.resets.extend_from_slice(&self.derivatives.reset.jac);
        }
        Ok(())
    }

    pub(super) fn record(&mut self, parts: &[Impulse], kind: ImpactKind, unique: bool) {
        let largest = |p: &Impulse| p.impulse.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let noise = 64.0 * EPS * parts.iter().map(largest).fold(0.0, f64::max);
        for p in parts.iter().filter(|p| largest(p) > noise.max(p.noise)) {
            self.log.stats.impacts += 1;
            self.contact_events.scene.hit = self.t;
            // a constraint has an impulse because of others
            let (depth, tolerance) = if self.opens(p.contact) { self.depth(p.contact, p.rates[0]) } else { (0.0, 0.0) };
            // whether there is an impact at all is a matter of the tolerances
            self.log.one_sided |= depth < GRAZES * tolerance && kind == ImpactKind::Collision;
            if self.log.impacts.len() < self.options.max_log {
                let dt = self.shown_dt();
                let Impulse { contact, rates, impulse, .. } = *p;
                self.log.impacts.push(Impact {
                    t: self.t,
                    contact,
                    kind,
                    rates,
                    impulse,
                    depth,
                    simultaneous: false,
                    unique,
                    dt,
                });
            }
        }
    }

    /// Is it a contact that can open?
    pub(super) fn opens(&self, contact: usize) -> bool {
        self.field.scene().is_none_or(|c| c.dynamics.opens(contact))
    }

    /// How far the bodies would overlap without an impact of contact `i` that closes at this rate, and what of it the
    /// tolerances do not see. The velocity is that before.
    pub(super) fn depth(&mut self, i: usize, rate: f64) -> (f64, f64) {
        let rtol = self.rtol.iter().fold(f64::INFINITY, |m, v| m.min(*v));
        let f = &self.f_before;
        let found = self.field.with_contacts(self.t, &self.x, |c, at, _| {
            let known = c.dynamics.load_contact(at, i).is_ok();
            let a = if known { c.dynamics.gap_acceleration_of(i, f) } else { f64::NAN };
            (a, rtol * c.sizes[i][0])
        });
        let (a, tolerance) = found.unwrap_or((f64::NAN, 0.0));
        (0.5 * rate * rate / a.abs(), tolerance)
    }
}
