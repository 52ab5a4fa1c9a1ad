//! Mode sequences of scenes: which contacts are closed in which part of the horizon, and where velocities jump.

/// What a contact does in a part of the horizon. The numbers are those of the event engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
#[non_exhaustive]
pub enum ContactMode {
    /// No force.
    Open = 0,
    /// Closed; with friction, sticking.
    Closed = 1,
    /// Closed and sliding along its tangent.
    Slides = 2,
    /// Closed and sliding against its tangent.
    SlidesBack = 3,
}

impl ContactMode {
    /// From its number.
    pub fn from_number(k: usize) -> Option<ContactMode> {
        [ContactMode::Open, ContactMode::Closed, ContactMode::Slides, ContactMode::SlidesBack].get(k).copied()
    }

    /// Is there a force?
    pub fn is_closed(self) -> bool {
        self != ContactMode::Open
    }

    /// Sign of the sliding velocity, 0 where there is none.
    pub fn sign(self) -> f64 {
        match self {
            ContactMode::Slides => 1.0,
            ContactMode::SlidesBack => -1.0,
            _ => 0.0,
        }
    }
}

/// Part of a control stage in which no contact changes its mode.
#[derive(Debug, Clone, PartialEq)]
pub struct Phase {
    /// Mode of every contact.
    pub modes: Vec<ContactMode>,
    /// What contacts do in the impact at the start of the phase, none where velocities do not jump: a contact that is open
    /// takes no part, one that is closed or slides has an impulse, and sticks or slides behind it.
    pub jump: Option<Vec<ContactMode>>,
    /// Share of the control stage it takes, to start from.
    pub share: f64,
}

/// Phases of every control stage. A phase that is longer than a stage is one phase in every stage it touches.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// Phases of every stage in the order of time, at least one in each.
    pub stages: Vec<Vec<Phase>>,
}

/// What identifies a sequence: modes and jumps, without lengths.
pub type Key = Vec<Vec<(Vec<ContactMode>, Option<Vec<ContactMode>>)>>;

/// A change of one contact: its number, the modes before and behind, what it does in an impact, the control stage, and whether
/// it is at the start of that.
pub(super) type Event = (usize, ContactMode, ContactMode, ContactMode, usize, bool);

/// Shares of a stage below which a phase starts with this length: one of no length has no equations that say something.
pub(super) const LEAST: f64 = 0.02;

/// Shortest phase, as a share of its control stage. One that gets there wants to vanish: another sequence is to be tried.
pub(super) const SHORTEST: f64 = 1e-4;

impl Sequence {
    /// Leaves bounces out that are shorter than a phase may be, at the end of chains that end at rest: there is no end of them, and the motion
    /// without them lands a little earlier. Of two impacts after which the bodies part, each counts.
    pub(super) fn end_chains(&mut self) {
        for stage in &mut self.stages {
            for k in (1..stage.len()).rev() {
                let rests = |(part, mode): (&ContactMode, &ContactMode)| !part.is_closed() || mode.is_closed();
                let at_rest = stage[k].jump.as_ref().is_some_and(|parts| parts.iter().zip(&stage[k].modes).all(rests));
                let bounces = stage[k - 1].jump == stage[k].jump;
                if at_rest && bounces && stage[k - 1].share < SHORTEST {
                    stage[k].share += stage[k - 1].share;
                    stage.remove(k - 1);
                }
            }
        }
    }

    /// One phase with these modes in every stage.
    pub fn constant(n_stages: usize, modes: Vec<ContactMode>) -> Sequence {
        Sequence { stages: vec![vec![Phase { modes, jump: None, share: 1.0 }]; n_stages] }
    }

    /// Modes and jumps alone.
    pub fn key(&self) -> Key {
        let stage = |s: &Vec<Phase>| s.iter().map(|p| (p.modes.clone(), p.jump.clone())).collect();
        self.stages.iter().map(stage).collect()
    }

    /// Number of phases.
    pub fn n_phases(&self) -> usize {
        self.stages.iter().map(Vec::len).sum()
    }

    /// The same without impacts in which only contacts take part that were closed before: their velocities have nothing to jump from, and with nothing
    /// that happens in it the time of such an impact is any. On coarse grids a search goes on from them to other orders; on a fine one
    /// the program of an order that has them has no end.
    pub(super) fn without_idle_impacts(&self) -> Sequence {
        let mut found = self.clone();
        let mut before: Option<Vec<ContactMode>> = None;
        for phase in found.stages.iter_mut().flatten() {
            if let (Some(before), Some(parts)) = (&before, &phase.jump) {
                if parts.iter().zip(before).all(|(part, mode)| !part.is_closed() || mode.is_closed()) {
                    phase.jump = None;
                }
            }
            before = Some(phase.modes.clone());
        }
        found.tidy();
        found
    }

    /// Unites neighbours inside a stage that are one phase, and makes shares add up to one, none of them tiny.
    pub fn tidy(&mut self) {
        for stage in &mut self.stages {
            let mut k = 1;
            while k < stage.len() {
                if stage[k].jump.is_none() && stage[k].modes == stage[k - 1].modes {
                    stage[k - 1].share += stage[k].share;
                    stage.remove(k);
                } else {
                    k += 1;
                }
            }
            for p in stage.iter_mut() {
                p.share = p.share.max(LEAST);
            }
            let sum: f64 = stage.iter().map(|p| p.share).sum();
            stage.iter_mut().for_each(|p| p.share /= sum);
        }
    }

    /// All events: contact, modes before and behind, whether it is hit, control stage, and whether that is at its start.
    pub(super) fn events(&self) -> Vec<Event> {
        let mut out = Vec::new();
        let mut last: Option<&Phase> = None;
        for (k, stage) in self.stages.iter().enumerate() {
            for (j, p) in stage.iter().enumerate() {
                for (i, &mode) in p.modes.iter().enumerate() {
                    let hit = p.jump.as_ref().map_or(ContactMode::Open, |parts| parts[i]);
                    let before = last.map_or(mode, |l| l.modes[i]);
                    if before != mode || hit.is_closed() {
                        out.push((i, before, mode, hit, k, j == 0));
                    }
                }
                last = Some(p);
            }
        }
        out
    }

    /// Does the phase begin with an event, a change of modes or a jump? `before` is the one before it.
    pub(super) fn is_event(before: &Phase, phase: &Phase) -> bool {
        phase.jump.is_some() || phase.modes != before.modes
    }

    /// In words, with the names of the contacts: for messages and logs.
    pub fn text(&self, names: &[String]) -> String {
        let mut parts: Vec<String> = Vec::new();
        for (k, stage) in self.stages.iter().enumerate() {
            for p in stage {
                let of = |modes: &[ContactMode]| {
                    let closed = modes.iter().zip(names).filter(|(m, _)| m.is_closed());
                    let words: Vec<String> = closed
                        .map(|(m, name)| match m {
                            ContactMode::Slides => format!("{name} slides"),
                            ContactMode::SlidesBack => format!("{name} slides back"),
                            _ => format!("{name} closed"),
                        })
                        .collect();
                    if words.is_empty() {
                        "free".to_owned()
                    } else {
                        words.join(", ")
                    }
                };
                let mut text = of(&p.modes);
                if let Some(j) = &p.jump {
                    text = format!("impact ({}), then {text}", of(j));
                }
                match parts.last() {
                    Some(last) if last.split_once(": ").map(|l| l.1) == Some(&text) && p.jump.is_none() => {}
                    _ => parts.push(format!("stage {k}: {text}")),
                }
            }
        }
        parts.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_that_are_one_are_united() {
        let open = Phase { modes: vec![ContactMode::Open], jump: None, share: 0.4 };
        let closed = Phase { modes: vec![ContactMode::Closed], jump: Some(vec![ContactMode::Closed]), share: 0.2 };
        let mut s = Sequence { stages: vec![vec![open.clone(), open.clone(), closed.clone()]] };
        s.tidy();
        assert_eq!(s.stages[0].len(), 2);
        assert!((s.stages[0][0].share - 0.8).abs() < 1e-15);
        assert!(Sequence::is_event(&s.stages[0][0], &s.stages[0][1]));
        assert_eq!(s.text(&["floor".into()]), "stage 0: free; stage 0: impact (floor closed), then floor closed");
    }

    #[test]
    fn impacts_of_what_is_closed_before_are_left_out() {
        use ContactMode::{Closed, Open, Slides};
        let phase = |modes: [ContactMode; 2], jump: Option<[ContactMode; 2]>| Phase {
            modes: modes.to_vec(),
            jump: jump.map(|j| j.to_vec()),
            share: 0.5,
        };
        let slides = phase([Slides, Open], None);
        // inside of a stage the phases on both sides are one then, and between two there is no event
        let idle = phase([Slides, Open], Some([Slides, Open]));
        let s = Sequence { stages: vec![vec![slides.clone(), idle.clone()], vec![idle]] };
        let whole = Phase { share: 1.0, ..slides.clone() };
        assert_eq!(s.without_idle_impacts().stages, vec![vec![whole.clone()], vec![whole]]);
        // a contact that lands takes those along that hold against it, and what is hit at the start was not closed by anything
        let lands = phase([Slides, Closed], Some([Slides, Closed]));
        let bounces = phase([Slides, Open], Some([Slides, Closed]));
        for start in [lands.clone(), bounces, slides] {
            let kept = Sequence { stages: vec![vec![start], vec![phase([Open, Open], None), lands.clone()]] };
            assert_eq!(kept.without_idle_impacts().key(), kept.key());
        }
    }
}
