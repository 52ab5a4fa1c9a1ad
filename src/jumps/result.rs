//! Answers in the terms of the scene: motion with both limits at jumps, impacts, forces, contact modes.

use super::answer::Answer;
use super::modes::{ContactMode, Phase, Sequence};
use super::problem::Problem;
use super::track::{Piece, Track};
use crate::error::{Error, Result};
use crate::event::{Impact, ImpactKind, Run};
use crate::fesd::{Element, Trajectory};
use crate::freezing::Report;
use crate::func::Point;

/// What the contacts do in an answer.
#[derive(Debug, Clone)]
pub struct Contacts {
    /// Names of the contacts.
    pub names: Vec<String>,
    /// The impacts in the order of time, one entry for every contact with an impulse.
    pub impacts: Vec<Impact>,
    /// Modes and jumps of every control stage: to start another solve from.
    pub sequence: Sequence,
    /// Sequences that were solved for.
    pub tried: usize,
    /// What stood for the contacts in numerical time, with strengths and warnings, where the search was by time-freezing.
    pub freezing: Option<Report>,
    motion: Motion,
}

/// What modes and forces are read off.
#[derive(Debug, Clone)]
enum Motion {
    /// The answer of a program.
    Program(Box<Track>),
    /// A simulation, with the modes of its phases.
    Simulation(Box<Run>, Vec<Vec<ContactMode>>),
}

impl Contacts {
    /// Of an answer.
    pub(crate) fn new(p: &Problem, answer: &Answer) -> Contacts {
        let track = answer.track.clone();
        let mut impacts = Vec::new();
        for (k, piece) in track.pieces.iter().enumerate() {
            if piece.impulses.is_empty() {
                continue;
            }
            let before = match k.checked_sub(1).and_then(|k| track.pieces.get(k)) {
                Some(last) => last.xs[last.xs.len() - track.nx..].to_vec(),
                // an impact at the initial time: what was before it has the coordinates behind it
                None => answer.x0.clone(),
            };
            let hit: Vec<usize> = (0..p.n_contacts()).filter(|i| piece.impulses[2 * i] > 0.0).collect();
            for &i in &hit {
                impacts.push(Impact {
                    t: piece.t,
                    contact: i,
                    kind: ImpactKind::Collision,
                    rates: [&before, &piece.x0].map(|x| rate(p, &track, piece, i, x)),
                    impulse: [piece.impulses[2 * i], piece.impulses[2 * i + 1], 0.0],
                    depth: f64::NAN,
                    simultaneous: hit.len() > 1,
                    unique: true,
                    dt: Vec::new(),
                });
            }
        }
        let (sequence, freezing) = (answer.sequence.clone(), answer.freezing.clone());
        Contacts {
            names: p.contact_names(),
            impacts,
            sequence,
            tried: answer.tried,
            freezing,
            motion: Motion::Program(Box::new(track)),
        }
    }

    /// Which modes are active, four for every contact, in the phases that are longer than `shortest`, by the times from the start of the horizon at
    /// which they begin.
    pub(crate) fn active(&self, shortest: f64) -> Vec<(f64, Vec<bool>)> {
        let all = self.phases();
        let t0 = all.first().map_or(0.0, |p| p.0);
        let lasting = all.into_iter().filter(|(from, to, _)| to - from > shortest);
        let flags = |modes: &[ContactMode]| modes.iter().flat_map(|m| (0..4).map(move |k| *m as usize == k)).collect();
        let mut active: Vec<(f64, Vec<bool>)> = lasting.map(|(from, _, m)| (from - t0, flags(&m))).collect();
        active.dedup_by(|b, a| a.1 == b.1);
        if let Some(first) = active.first_mut() {
            first.0 = 0.0;
        }
        active
    }

    /// Of a simulation of a scene with dense output, whose control stages end at these times.
    pub(crate) fn of_run(run: Run, ends: &[f64]) -> Contacts {
        let modes: Vec<Vec<ContactMode>> = run
            .phases
            .iter()
            .map(|p| p.modes.iter().map(|m| ContactMode::from_number(*m).unwrap_or(ContactMode::Open)).collect())
            .collect();
        let start = run.phases.first().map_or(f64::NAN, |p| p.t);
        let mut stages = Vec::with_capacity(ends.len());
        let mut from = start;
        for &to in ends {
            let behind = run.phases.iter().map(|p| p.t).skip(1).chain([f64::INFINITY]);
            let within = run.phases.iter().map(|p| p.t).zip(behind).zip(&modes);
            let phase = |((a, b), modes): ((f64, f64), &Vec<ContactMode>)| {
                let share = (b.min(to) - a.max(from)) / (to - from);
                let hit = a > from && run.impacts.iter().any(|i| i.t == a);
                (share > 0.0).then(|| Phase { modes: modes.clone(), jump: hit.then(|| modes.clone()), share })
            };
            stages.push(within.filter_map(phase).collect());
            from = to;
        }
        let names = run.mechanics.iter().flat_map(|m| m.contacts.iter().map(|c| c.name.clone())).collect();
        let (impacts, sequence) = (run.impacts.clone(), Sequence { stages });
        Contacts {
            names,
            impacts,
            sequence,
            tried: 1,
            freezing: None,
            motion: Motion::Simulation(Box::new(run), modes),
        }
    }

    fn piece(track: &Track, t: f64) -> Result<&Piece> {
        let (first, last) = (track.pieces.first(), track.pieces.last());
        let (Some(first), Some(last)) = (first, last) else {
            return Err(Error::State("there is no motion: solve first".into()));
        };
        let end = last.t + last.h;
        check_time(t, first.t, end)?;
        track.piece(t, false).ok_or_else(|| Error::Internal("a motion without pieces".into()))
    }

    /// Modes of all contacts at a time; at the time of an event those before it.
    pub fn modes(&self, t: f64) -> Result<&[ContactMode]> {
        match &self.motion {
            Motion::Program(track) => Ok(&Contacts::piece(track, t)?.modes),
            Motion::Simulation(run, modes) => {
                let t = within(run, t)?;
                let behind = run.phases.partition_point(|p| p.t < t);
                let known = modes.get(behind.saturating_sub(1));
                known.map(|m| &m[..]).ok_or_else(|| Error::Internal("a motion without phases".into()))
            }
        }
    }

    /// Normal and tangential forces of all contacts at a time: forces, not impulses.
    pub fn forces(&self, t: f64) -> Result<Vec<[f64; 3]>> {
        let track = match &self.motion {
            Motion::Program(track) => track,
            Motion::Simulation(run, _) => return run.contact_forces(within(run, t)?),
        };
        let n = Contacts::piece(track, t)?.modes.len();
        let of = |i: usize| {
            let [normal, tangential] = track.force(t, i);
            [normal, tangential, 0.0]
        };
        Ok((0..n).map(of).collect())
    }

    /// Parts of the horizon with their modes: start, end, modes.
    pub fn phases(&self) -> Vec<(f64, f64, Vec<ContactMode>)> {
        let track = match &self.motion {
            Motion::Program(track) => track,
            Motion::Simulation(run, modes) => {
                let ends = run.phases.iter().map(|p| p.t).skip(1).chain([run.t]);
                return run.phases.iter().zip(ends).zip(modes).map(|((p, end), m)| (p.t, end, m.clone())).collect();
            }
        };
        let mut out: Vec<(f64, f64, Vec<ContactMode>)> = Vec::new();
        for p in &track.pieces {
            match out.last_mut() {
                Some(last) if last.2 == p.modes && p.jump.is_none() => last.1 = p.t + p.h,
                _ => out.push((p.t, p.t + p.h, p.modes.clone())),
            }
        }
        out
    }
}

/// Is a time one of a motion, but for the rounding of times that are sums of lengths?
fn check_time(t: f64, start: f64, end: f64) -> Result<()> {
    let slack = 1e-12 * end.abs().max(start.abs()).max(end - start);
    if t >= start - slack && t <= end + slack {
        return Ok(());
    }
    Err(Error::Range(format!("time {t} is outside of the motion, {start} to {end}")))
}

/// A time of a simulation.
fn within(run: &Run, t: f64) -> Result<f64> {
    let start = run.phases.first().map_or(run.t, |p| p.t);
    check_time(t, start, run.t)?;
    Ok(t.max(start).min(run.t))
}

/// Rate of the gap of contact `i` at a state at the start of a piece.
fn rate(p: &Problem, track: &Track, piece: &Piece, i: usize, x: &[f64]) -> f64 {
    let g = &p.given;
    let u = &track.controls[piece.stage * g.wide.u..piece.stage * g.wide.u + g.dims.u];
    let params = &g.params[piece.stage * g.wide.p..piece.stage * g.wide.p + g.dims.p];
    let f = &p.functions.contacts[i].rate;
    let mut out = [f64::NAN];
    let at = Point { t: piece.t, x, u, p: params };
    match f.value(&at, &mut out, &mut vec![0.0; f.work_len()]) {
        Ok(()) => out[0],
        Err(_) => f64::NAN,
    }
}

/// The motion of an answer: the state at the start of an element is the one behind a jump there.
pub(crate) fn trajectory(answer: &Answer) -> Trajectory {
    let track = &answer.track;
    let element = |p: &Piece| Element::of_states(&track.tableau, p.stage, (p.t, p.h), p.x0.clone(), p.xs.clone());
    Trajectory::of_elements(&track.tableau, track.nx, track.pieces.iter().map(element).collect())
}
