//! Mode sequences next to one: events in other control stages or between two, phases left out, other friction, contacts and impacts
//! left out, impacts put in.

use super::guards::{Condition, Touched};
use super::modes::{ContactMode, Phase, Sequence, LEAST};

/// Share of a stage that a phase begins with where an event moves into the stage.
const ENTERS: f64 = 0.1;

/// A phase and its control stage.
#[derive(Debug, Clone)]
struct Item {
    stage: usize,
    phase: Phase,
}

fn flat(s: &Sequence) -> Vec<Item> {
    let of = |(stage, phases): (usize, &Vec<Phase>)| {
        phases.iter().map(move |phase| Item { stage, phase: phase.clone() }).collect::<Vec<_>>()
    };
    s.stages.iter().enumerate().flat_map(of).collect()
}

fn grouped(items: Vec<Item>, n_stages: usize) -> Option<Sequence> {
    let mut stages = vec![Vec::new(); n_stages];
    for i in items {
        stages[i.stage].push(i.phase);
    }
    if stages.iter().any(Vec::is_empty) {
        return None;
    }
    let mut s = Sequence { stages };
    s.tidy();
    Some(s)
}

/// Is there an event at the start of item `i`?
fn is_event(items: &[Item], i: usize) -> bool {
    i > 0 && i < items.len() && Sequence::is_event(&items[i - 1].phase, &items[i].phase)
}

/// The event at the start of item `i` one place later: from inside a stage to its end, and into the next stage; from between
/// two stages into the second.
fn later(items: &[Item], i: usize) -> Vec<Vec<Item>> {
    let (stage, before) = (items[i].stage, &items[i - 1]);
    let copy = |stage: usize, from: &Phase, share: f64| Item {
        stage,
        phase: Phase { modes: from.modes.clone(), jump: None, share },
    };
    if before.stage != stage {
        let mut inside = items.to_vec();
        inside.insert(i, copy(stage, &before.phase, ENTERS));
        return vec![inside];
    }
    let Some(next) = items.get(i + 1).filter(|n| n.stage == stage + 1 && !is_event(items, i + 1)) else {
        return Vec::new();
    };
    let mut between = items.to_vec();
    between[i + 1].phase.jump.clone_from(&items[i].phase.jump);
    between.remove(i);
    let mut inside = between.clone();
    inside.insert(i, copy(next.stage, &before.phase, ENTERS));
    vec![between, inside]
}

/// The event at the start of item `i` one place earlier.
fn earlier(items: &[Item], i: usize) -> Vec<Vec<Item>> {
    let stage = items[i].stage;
    let enter = |items: &mut Vec<Item>, i: usize| {
        let share = ENTERS / (1.0 - ENTERS);
        let mut phase = items[i].phase.clone();
        phase.share = share;
        items[i].phase.jump = None;
        let stage = items[i].stage - 1;
        items.insert(i, Item { stage, phase });
    };
    if items[i - 1].stage != stage {
        let mut inside = items.to_vec();
        enter(&mut inside, i);
        return vec![inside];
    }
    let first = i >= 2 && items[i - 2].stage + 1 == stage && !is_event(items, i - 1);
    if !first {
        return Vec::new();
    }
    let mut between = items.to_vec();
    between.remove(i - 1);
    let mut inside = between.clone();
    enter(&mut inside, i - 1);
    vec![between, inside]
}

/// Stages by which events are moved at once, where moves to the next stage lead nowhere: the cost as a function of the time of an event has
/// local minima at the ends of stages, where controls may jump.
const FAR: [usize; 4] = [2, 3, 5, 8];

/// The event at the start of item `i` some stages later or earlier, inside of a stage.
fn far(items: &[Item], i: usize, forward: bool) -> Vec<Vec<Item>> {
    let mut out = Vec::new();
    let (mut now, mut at) = (items.to_vec(), i);
    let target = |d: usize| if forward { Some(items[i].stage + d) } else { items[i].stage.checked_sub(d) };
    while let Some(next) = if forward { later(&now, at) } else { earlier(&now, at) }.pop() {
        at = match (forward, now[at - 1].stage == now[at].stage) {
            (true, _) => at + 1,
            (false, true) => at - 1,
            (false, false) => at,
        };
        now = next;
        let Some(event) = now.get(at) else { break };
        if FAR.iter().any(|&d| target(d) == Some(event.stage)) {
            out.push(now.clone());
        }
    }
    out
}

/// Control stages of events that follow each other with no stage without one between them: the first and the last stage of every such
/// group. The many small bounces of a blow are one.
fn groups(s: &Sequence) -> Vec<(usize, usize)> {
    let mut out: Vec<(usize, usize)> = Vec::new();
    for (.., k, _) in s.events() {
        match out.last_mut() {
            Some((_, last)) if k <= *last + 1 => *last = k,
            _ => out.push((k, k)),
        }
    }
    out
}

/// The events of the stages `first` to `last` by `by` stages later or earlier, all of them: one by one they cannot move, as each has the
/// next one in its way. Stages that they leave and stages that they come to have no other events.
fn group_moved(s: &Sequence, (first, last): (usize, usize), by: usize, forward: bool) -> Option<Sequence> {
    let n = s.stages.len();
    let (from, to) = if forward { (first, last + by) } else { (first.checked_sub(by)?, last) };
    let empty = if forward { last + 1..to + 1 } else { from..first };
    let is_empty = |k: usize| {
        let before = k.checked_sub(1).and_then(|k| s.stages[k].last());
        let [phase] = &s.stages[k][..] else { return false };
        before.map_or(phase.jump.is_none(), |b| !Sequence::is_event(b, phase))
    };
    if to >= n || !empty.clone().all(is_empty) {
        return None;
    }
    // what there is before the first of them, and behind the last
    let modes = match (forward, first.checked_sub(1)) {
        (false, _) => &s.stages[last].last()?.modes,
        (true, Some(k)) => &s.stages[k].last()?.modes,
        (true, None) => &s.stages[0].first().filter(|p| p.jump.is_none())?.modes,
    };
    let rest = vec![Phase { modes: modes.clone(), jump: None, share: 1.0 }];
    let mut out = s.clone();
    if forward {
        out.stages[from..=to].rotate_right(by);
        out.stages[from..from + by].fill(rest);
    } else {
        out.stages[from..=to].rotate_left(by);
        out.stages[to + 1 - by..=to].fill(rest);
    }
    Some(out)
}

/// The events of two stages that follow each other, all of them in the first, or in the second: of a chain of bounces with the end of a stage in
/// it every bounce has a place of its own there, and one by one they pass it with two programs each.
fn gathered(s: &Sequence, (first, last): (usize, usize), forward: bool) -> Option<Sequence> {
    if last != first + 1 || s.stages[first].first()?.jump.is_some() {
        return None;
    }
    let modes = |p: &Phase| Phase { modes: p.modes.clone(), jump: None, share: 1.0 };
    let mut all = [&s.stages[first][..], &s.stages[last][..]].concat();
    let mut out = s.clone();
    if forward {
        // what there was before the first event takes the stage
        all[0].share = ENTERS;
        out.stages[first] = vec![modes(all.first()?)];
        out.stages[last] = all;
    } else {
        all.last_mut()?.share = ENTERS;
        out.stages[last] = vec![modes(all.last()?)];
        out.stages[first] = all;
    }
    out.tidy();
    (out.key() != s.key()).then_some(out)
}

/// Stages by which groups of events are moved.
const GROUPS_BY: [usize; 5] = [1, 2, 3, 5, 8];

/// Without the contact `i` begins with: an impact that contact `c` leaves at once, or a time in which it is closed.
fn untouched(items: &[Item], i: usize, c: usize) -> Option<Vec<Item>> {
    let lands = items[i].phase.modes[c].is_closed() && i > 0 && !items[i - 1].phase.modes[c].is_closed();
    let hits = takes_part(&items[i].phase, c);
    let held = i > 0 && items[i - 1].phase.modes[c].is_closed();
    if held || !(lands || hits) {
        return None;
    }
    let mut out = items.to_vec();
    let leave = |phase: &mut Phase| {
        if let Some(parts) = &mut phase.jump {
            parts[c] = ContactMode::Open;
            if !parts.iter().any(|p| p.is_closed()) {
                phase.jump = None;
            }
        }
    };
    leave(&mut out[i].phase);
    for item in &mut out[i..] {
        if !item.phase.modes[c].is_closed() {
            break;
        }
        item.phase.modes[c] = ContactMode::Open;
        leave(&mut item.phase);
    }
    Some(out)
}

/// With an impact of contact `c` in the middle of phase `j` of stage `k`, which it leaves at once.
pub(super) fn with_impact(s: &Sequence, k: usize, j: usize, c: usize) -> Option<Sequence> {
    let phase = s.stages.get(k)?.get(j)?;
    let mut behind = phase.clone();
    behind.share *= 0.5;
    // what is closed holds against the impact
    let mut parts = behind.modes.clone();
    parts[c] = ContactMode::Closed;
    behind.jump = Some(parts);
    let mut out = s.clone();
    out.stages[k][j].share *= 0.5;
    out.stages[k].insert(j + 1, behind);
    Some(out)
}

/// Without item `i`: the phases on both sides meet, and where both begin with an impact it is one of all contacts in either of them, or
/// one of them alone.
fn without(items: &[Item], i: usize) -> Vec<Vec<Item>> {
    let alone = !items.iter().enumerate().any(|(k, o)| k != i && o.stage == items[i].stage);
    if alone {
        return Vec::new();
    }
    let mut rest = items.to_vec();
    let gone = rest.remove(i).phase.jump;
    let own = rest.get(i).and_then(|next| next.phase.jump.clone());
    let jumps = match (gone, own) {
        // who is not closed any more has no part in the impact, unless it bounces off
        (Some(parts), None) => vec![Some(parts)],
        (Some(first), Some(second)) if first != second => {
            let part = |(a, b): (&ContactMode, &ContactMode)| if b.is_closed() { *b } else { *a };
            let both = first.iter().zip(&second).map(part).collect();
            vec![Some(both), Some(first), Some(second)]
        }
        (_, own) => vec![own],
    };
    let with = |jump: Option<Vec<ContactMode>>| {
        let mut out = rest.clone();
        if let Some(next) = out.get_mut(i) {
            next.phase.jump = jump;
        }
        out
    };
    jumps.into_iter().map(with).collect()
}

/// Contact `c`, which is closed, open in item `i`: it lands again behind it, or is open as long as it was closed.
fn opening(items: &[Item], i: usize, c: usize) -> Vec<Vec<Item>> {
    let run = (i..items.len())
        .take_while(|&k| items[k].phase.modes[c].is_closed() && (k == i || !takes_part(&items[k].phase, c)));
    let run: Vec<usize> = run.collect();
    let Some(&last) = run.last() else { return Vec::new() };
    let mut out = Vec::new();
    if last > i {
        let mut lands = items.to_vec();
        lands[i].phase.modes[c] = ContactMode::Open;
        let next = &mut lands[i + 1].phase;
        let parts = next.jump.get_or_insert_with(|| next.modes.clone());
        parts[c] = next.modes[c];
        out.push(lands);
    }
    let mut open = items.to_vec();
    run.iter().for_each(|&k| open[k].phase.modes[c] = ContactMode::Open);
    out.push(open);
    out
}

/// Other friction of contact `c`, from item `i` as long as it stays in one mode.
fn other_friction(items: &[Item], i: usize, c: usize, mode: ContactMode) -> Vec<Item> {
    let mut out = items.to_vec();
    let was = items[i].phase.modes[c];
    let mut k = i;
    while k < out.len() && out[k].phase.modes[c] == was && (k == i || !takes_part(&out[k].phase, c)) {
        out[k].phase.modes[c] = mode;
        k += 1;
    }
    if let Some(parts) = out[i].phase.jump.as_mut().filter(|p| p[c].is_closed()) {
        parts[c] = mode;
    }
    out
}

fn takes_part(p: &Phase, c: usize) -> bool {
    p.jump.as_ref().is_some_and(|parts| parts[c].is_closed())
}

/// A contact that slides until the end of item `i` sticks there: a phase behind it, in the same stage.
fn sticking(items: &[Item], i: usize, c: usize) -> Vec<Item> {
    let mut out = items.to_vec();
    let mut phase = items[i].phase.clone();
    phase.modes[c] = ContactMode::Closed;
    phase.jump = None;
    phase.share *= 0.5;
    out[i].phase.share *= 0.5;
    out.insert(i + 1, Item { stage: items[i].stage, phase });
    out
}

/// How a sequence differs from the one it is next to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Move {
    /// Events that phases want to get rid of are where those phases end, all of them at once.
    Vanish,
    /// An event is later, or earlier.
    Shift {
        /// Its number in the order of time.
        event: usize,
        /// Later?
        later: bool,
    },
    /// A phase is left out.
    Without(usize),
    /// Friction of a contact is another in a phase.
    Friction(usize, usize),
    /// A contact takes no part any more, from a phase on.
    Untouched(usize, usize),
    /// An impact of a contact is put in.
    Impact(usize),
    /// A contact whose force is zero is open.
    Opens(usize, usize),
    /// Events that follow each other closely are later, or earlier, all of them.
    Group {
        /// The number of the group in the order of time.
        group: usize,
        /// Later?
        later: bool,
    },
}

impl Move {
    /// Kinds of moves.
    pub(super) const KINDS: usize = 8;

    /// The number of its kind.
    pub(super) fn kind(self) -> usize {
        match self {
            Move::Vanish => 0,
            Move::Shift { .. } => 1,
            Move::Without(_) => 2,
            Move::Friction(..) => 3,
            Move::Untouched(..) => 4,
            Move::Impact(_) => 5,
            Move::Opens(..) => 6,
            Move::Group { .. } => 7,
        }
    }
}

/// A sequence next to another one.
#[derive(Debug, Clone)]
pub(super) struct Neighbour {
    pub(super) sequence: Sequence,
    /// What was changed.
    pub(super) moved: Move,
    /// Does a phase that is as short as it may be lead to it?
    pub(super) wanted: bool,
    /// Is its motion next to the present one: has that reached a condition of its modes, or an end of a stage, behind which this one lies?
    pub(super) local: bool,
    /// How many candidates of better prospects there are: the lower the sooner it is tried.
    pub(super) class: u8,
}

/// Prospects of neighbours. An event between two stages has a kink of the cost there; one inside of a stage is where it wants to be as long
/// as it stays in that stage, so that moves to the next stages are as far as any.
const BETWEEN: u8 = 1;
const OTHER: u8 = 2;
const AWAY: u8 = 3;

/// The last of the moves of an event: into the next stage, where there are two.
fn furthest(moves: Vec<Vec<Item>>) -> Option<Vec<Item>> {
    moves.into_iter().last()
}

/// Events that phases want to get rid of, all moved on at once.
fn without_vanishing(items: &[Item], wants: &[bool]) -> Option<Vec<Item>> {
    let mut now = items.to_vec();
    let mut moved = 0;
    // from the end: what is moved there leaves the numbers before as they are
    for i in (1..items.len()).rev() {
        if !is_event(items, i) || items[i - 1].stage != items[i].stage {
            continue;
        }
        let next = match (wants[i], wants[i - 1]) {
            (true, false) => furthest(later(&now, i)),
            (false, true) => furthest(earlier(&now, i)),
            _ => None,
        };
        if let Some(next) = next {
            now = next;
            moved += 1;
        }
    }
    (moved > 1).then_some(now)
}

/// Without all phases that want to vanish, from the last to the first, where there are several: the bounces at the end of a chain, of which
/// each is a share of the one before, vanish together, and the program of each that is left out alone is as degenerate as the one before.
fn without_all(items: &[Item], wants: &[bool]) -> Option<Vec<Item>> {
    let mut now = items.to_vec();
    let mut gone = 0;
    for i in (0..items.len()).rev().filter(|&i| wants[i]) {
        if let Some(next) = without(&now, i).into_iter().next() {
            now = next;
            gone += 1;
        }
    }
    (gone > 1).then_some(now)
}

/// The event at the start of item `i`, which is between two stages, between the next two, or the last two.
fn stage_away(items: &[Item], i: usize, forward: bool) -> Option<Vec<Item>> {
    if items[i - 1].stage == items[i].stage {
        return None;
    }
    let (once, at) = if forward { (later(items, i), i + 1) } else { (earlier(items, i), i) };
    let inside = once.into_iter().next()?;
    let twice = if forward { later(&inside, at) } else { earlier(&inside, at) };
    twice.into_iter().next()
}

/// Sequences next to one, whose motion has reached the conditions `touched`; `frictional` says which contacts have friction, `friction_first` that other friction is likelier than events
/// elsewhere.
pub(super) fn neighbours(
    s: &Sequence,
    vanishing: &[(usize, usize)],
    touched: &[Touched],
    frictional: &[bool],
    friction_first: bool,
) -> Vec<Neighbour> {
    let items = flat(s);
    let n = s.stages.len();
    let places: Vec<(usize, usize)> =
        s.stages.iter().enumerate().flat_map(|(k, stage)| (0..stage.len()).map(move |j| (k, j))).collect();
    let wants: Vec<bool> = places.iter().map(|place| vanishing.contains(place)).collect();
    let reached = |i: usize, c: usize, condition: Condition| {
        touched.contains(&Touched { contact: c, phase: places[i], condition })
    };
    let mut out: Vec<Neighbour> = Vec::new();
    let mut add = |items: Vec<Item>, moved: Move, wanted: bool, local: bool, class: u8| {
        if let Some(sequence) = grouped(items, n) {
            out.push(Neighbour { sequence, moved, wanted, local: wanted || local, class });
        }
    };
    if let Some(all) = without_all(&items, &wants) {
        add(all, Move::Vanish, true, true, 0);
    }
    if let Some(all) = without_vanishing(&items, &wants) {
        add(all, Move::Vanish, true, true, 0);
    }
    let mut event = 0;
    for i in 0..items.len() {
        if is_event(&items, i) {
            // what vanishes behind an event lets it move later, what vanishes before it earlier
            let inside = items[i - 1].stage == items[i].stage;
            let class = if inside { AWAY } else { BETWEEN };
            for forward in [true, false] {
                let moved = Move::Shift { event, later: forward };
                let wanted = inside && if forward { wants[i] } else { wants[i - 1] };
                let class = if wanted { 0 } else { class };
                stage_away(&items, i, forward).into_iter().for_each(|m| add(m, moved, false, true, class));
                let moves = if forward { later(&items, i) } else { earlier(&items, i) };
                moves.into_iter().for_each(|m| add(m, moved, wanted, !inside, class));
            }
            event += 1;
        }
        if wants[i] {
            without(&items, i).into_iter().for_each(|m| add(m, Move::Without(i), true, true, 0));
        }
    }
    for i in 0..items.len() {
        if !wants[i] && (is_event(&items, i) || is_event(&items, i + 1)) {
            // a motion without a phase that is next to nothing of its stage is next to the present one
            let short = items[i].phase.share <= LEAST;
            let class = if short { BETWEEN } else { OTHER };
            without(&items, i).into_iter().for_each(|m| add(m, Move::Without(i), false, short, class));
        }
        for c in (0..frictional.len()).filter(|&c| reached(i, c, Condition::Force)) {
            opening(&items, i, c).into_iter().for_each(|m| add(m, Move::Opens(i, c), false, true, BETWEEN));
        }
        for (c, _) in frictional.iter().enumerate().filter(|f| *f.1) {
            let mode = items[i].phase.modes[c];
            let moved = Move::Friction(i, c);
            let slows = reached(i, c, Condition::Speed);
            let local = slows || reached(i, c, Condition::Cone);
            let class = if friction_first || local { BETWEEN } else { OTHER };
            let begins = i == 0 || items[i - 1].phase.modes[c] != mode || takes_part(&items[i].phase, c);
            let ends = items.get(i + 1).is_none_or(|n| !n.phase.modes[c].is_closed() || takes_part(&n.phase, c));
            if mode.sign() != 0.0 && ends {
                add(sticking(&items, i, c), moved, false, slows, class);
            }
            if mode.is_closed() && begins {
                let others = [ContactMode::Closed, ContactMode::Slides, ContactMode::SlidesBack];
                for other in others.into_iter().filter(|o| *o != mode) {
                    add(other_friction(&items, i, c, other), moved, false, local, class);
                }
            }
        }
    }
    for i in 1..items.len() {
        for c in 0..frictional.len() {
            let local = reached(i, c, Condition::Force) || reached(i, c, Condition::Closing);
            untouched(&items, i, c).into_iter().for_each(|m| add(m, Move::Untouched(i, c), false, local, OTHER));
        }
    }
    for (event, i) in (1..items.len()).filter(|&i| is_event(&items, i)).enumerate() {
        for forward in [true, false] {
            let moved = Move::Shift { event, later: forward };
            far(&items, i, forward).into_iter().for_each(|m| add(m, moved, false, false, AWAY));
        }
    }
    let (groups, events) = (groups(s), s.events());
    // of a single event this is known already
    let several = |g: &(usize, usize)| events.iter().filter(|e| (g.0..=g.1).contains(&e.4)).count() > 1;
    for (group, &stages) in groups.iter().enumerate().filter(|(_, g)| several(g)) {
        for later in [true, false] {
            let moved = Move::Group { group, later };
            let sequence = gathered(s, stages, later);
            out.extend(sequence.map(|sequence| Neighbour {
                sequence,
                moved,
                wanted: false,
                local: true,
                class: BETWEEN,
            }));
        }
    }
    for by in GROUPS_BY {
        for (group, &stages) in groups.iter().enumerate().filter(|(_, g)| several(g)) {
            for later in [true, false] {
                let moved = Move::Group { group, later };
                let sequence = group_moved(s, stages, by, later);
                let near = |sequence| Neighbour { sequence, moved, wanted: false, local: false, class: AWAY };
                out.extend(sequence.map(near));
            }
        }
    }
    out.sort_by_key(|n| n.class);
    out
}

/// Sequences next to the present motion before others, and of those one of every kind in turn: which kind helps says the problem.
pub(super) fn in_turn(near: &mut Vec<Neighbour>) {
    let mut seen = [0usize; Move::KINDS];
    let mut rank = |n: &Neighbour| {
        let turn = &mut seen[n.moved.kind()];
        *turn += usize::from(!n.local);
        if n.local {
            0
        } else {
            *turn
        }
    };
    let mut ranked: Vec<(usize, Neighbour)> = near.drain(..).map(|n| (rank(&n), n)).collect();
    ranked.sort_by_key(|r| r.0);
    near.extend(ranked.into_iter().map(|r| r.1));
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPEN: ContactMode = ContactMode::Open;
    const CLOSED: ContactMode = ContactMode::Closed;

    fn phase(mode: ContactMode, jump: bool) -> Phase {
        Phase { modes: vec![mode], jump: jump.then(|| vec![CLOSED]), share: 0.5 }
    }

    /// A contact closes inside of the second of three stages.
    fn landing() -> Sequence {
        let mut s = Sequence {
            stages: vec![
                vec![phase(OPEN, false)],
                vec![phase(OPEN, false), phase(CLOSED, true)],
                vec![phase(CLOSED, false)],
            ],
        };
        s.tidy();
        s
    }

    #[test]
    fn an_event_moves_to_the_next_stages_and_between_them() {
        let shapes: Vec<Vec<usize>> = neighbours(&landing(), &[], &[], &[false], false)
            .iter()
            .map(|s| s.sequence.stages.iter().map(Vec::len).collect())
            .collect();
        // the end of stage 1, stage 2, the start of stage 1, stage 0; without either phase it is between stages too
        for wanted in [vec![1, 1, 1], vec![1, 1, 2], vec![2, 1, 1]] {
            assert!(shapes.contains(&wanted), "{shapes:?}");
        }
        for Neighbour { sequence: s, .. } in neighbours(&landing(), &[], &[], &[false], false) {
            // it moves with its impact, or is left out
            let jumps = s.stages.iter().flatten().filter(|p| p.jump.is_some()).count();
            let closed = s.stages.iter().flatten().any(|p| p.modes[0].is_closed());
            assert_eq!(jumps, usize::from(closed), "{s:?}");
        }
    }

    #[test]
    fn an_event_moves_far() {
        let mut s = Sequence::constant(9, vec![OPEN]);
        s.stages[1] = vec![phase(OPEN, false), phase(OPEN, true)];
        let places: Vec<usize> = neighbours(&s, &[], &[], &[false], false)
            .iter()
            .filter_map(|s| s.sequence.stages.iter().position(|k| k.iter().any(|p| p.jump.is_some())))
            .collect();
        for wanted in [0, 2, 3, 4, 6] {
            assert!(places.contains(&wanted), "{places:?}");
        }
        // and without it
        assert!(neighbours(&s, &[], &[], &[false], false).iter().any(|s| s.sequence.events().is_empty()));
        let s = with_impact(&Sequence::constant(3, vec![OPEN]), 1, 0, 0).unwrap();
        assert_eq!(s.stages.iter().map(Vec::len).collect::<Vec<_>>(), [1, 2, 1]);
        assert!(s.stages[1][1].jump == Some(vec![CLOSED]) && s.stages[1][1].modes == [OPEN]);
    }

    #[test]
    fn bounces_that_follow_each_other_move_together() {
        let mut s = Sequence::constant(6, vec![OPEN]);
        s.stages[1] = vec![phase(OPEN, false), phase(OPEN, true), phase(OPEN, true), phase(CLOSED, true)];
        s.stages[2..].fill(vec![phase(CLOSED, false)]);
        let bounces = |s: &Sequence| s.stages.iter().position(|k| k.len() == 4);
        let moved = |n: &Neighbour| match n.moved {
            Move::Group { later, .. } => bounces(&n.sequence).map(|k| (later, k)),
            _ => None,
        };
        let near = neighbours(&s, &[], &[], &[false], false);
        assert_eq!(near.iter().filter_map(moved).collect::<Vec<_>>(), [(true, 2), (false, 0), (true, 3), (true, 4)]);
        for n in near.iter().filter(|n| moved(n).is_some()) {
            // free before, closed behind
            let k = bounces(&n.sequence).unwrap();
            assert!(n.sequence.stages[..k].iter().all(|p| p.len() == 1 && p[0].modes == [OPEN]));
            assert!(n.sequence.stages[k + 1..].iter().all(|p| p.len() == 1 && p[0].modes == [CLOSED]));
        }
    }

    #[test]
    fn bounces_on_both_sides_of_an_end_of_a_stage_come_together() {
        let mut s = Sequence::constant(4, vec![OPEN]);
        s.stages[1] = vec![phase(OPEN, false), phase(OPEN, true), phase(OPEN, true)];
        s.stages[2] = vec![phase(OPEN, true), phase(CLOSED, true)];
        s.stages[3] = vec![phase(CLOSED, false)];
        let shapes: Vec<Vec<usize>> = [true, false]
            .iter()
            .map(|&later| gathered(&s, (1, 2), later).unwrap().stages.iter().map(Vec::len).collect())
            .collect();
        assert_eq!(shapes, [[1, 1, 5, 1], [1, 5, 1, 1]]);
        for later in [true, false] {
            let events = |s: &Sequence| s.events().into_iter().map(|e| (e.0, e.1, e.2, e.3)).collect::<Vec<_>>();
            assert_eq!(events(&gathered(&s, (1, 2), later).unwrap()), events(&s));
        }
        assert!(gathered(&landing(), (1, 1), true).is_none());
    }

    #[test]
    fn bounces_that_want_to_vanish_do_so_together() {
        let bounce = || phase(OPEN, true);
        let s = Sequence { stages: vec![vec![phase(OPEN, false), bounce(), bounce(), bounce(), phase(CLOSED, true)]] };
        let first = &neighbours(&s, &[(0, 2), (0, 3)], &[], &[false], false)[0];
        assert!(first.wanted && first.moved == Move::Vanish);
        assert_eq!(first.sequence.stages[0].len(), 3);
        assert!(first.sequence.stages[0][2].modes[0].is_closed() && first.sequence.stages[0][2].jump.is_some());
    }

    #[test]
    fn a_phase_that_wants_to_vanish_comes_first() {
        let s = neighbours(&landing(), &[(1, 0)], &[], &[false], false);
        // an event that wants to be earlier: between stages 0 and 1
        assert_eq!(s[0].sequence.stages[1].len(), 1);
        assert!(s[0].wanted && s[0].sequence.stages[1][0].jump.is_some());
    }

    #[test]
    fn impacts_that_meet_are_one_of_both_contacts() {
        let hit = |parts: [ContactMode; 2]| Phase { modes: vec![OPEN, OPEN], jump: Some(parts.to_vec()), share: 0.5 };
        let s = Sequence { stages: vec![vec![hit([CLOSED, OPEN]), hit([OPEN, CLOSED])]] };
        let jumps: Vec<_> =
            without(&flat(&s), 0).into_iter().map(|items| items[0].phase.jump.clone().unwrap()).collect();
        assert_eq!(jumps, [vec![CLOSED, CLOSED], vec![CLOSED, OPEN], vec![OPEN, CLOSED]]);
    }

    #[test]
    fn motions_without_a_phase_that_is_next_to_nothing_are_next_to_the_present_one() {
        let with = |share: f64| {
            let hop = Phase { share, ..phase(OPEN, false) };
            let mut s = Sequence { stages: vec![vec![phase(CLOSED, false), hop, phase(CLOSED, true)]] };
            s.tidy();
            let near = neighbours(&s, &[], &[], &[false], false);
            let found: Vec<Neighbour> = near.into_iter().filter(|n| n.moved == Move::Without(1)).collect();
            let left = found.iter().map(|n| n.sequence.without_idle_impacts());
            assert!(left.into_iter().all(|s| s.n_phases() == 1 && s.events().is_empty()));
            found.iter().map(|n| n.local).collect::<Vec<_>>()
        };
        assert_eq!(with(0.1 * LEAST), [true]);
        assert_eq!(with(5.0 * LEAST), [false]);
    }

    #[test]
    fn a_contact_that_wants_to_pull_opens_and_lands_again() {
        let s = Sequence::constant(3, vec![CLOSED]);
        let touched = [Touched { contact: 0, phase: (1, 0), condition: Condition::Force }];
        let near = neighbours(&s, &[], &touched, &[false], false);
        let opens: Vec<&Sequence> =
            near.iter().filter(|n| n.local && n.moved == Move::Opens(1, 0)).map(|n| &n.sequence).collect();
        let modes = |s: &Sequence| s.stages.iter().map(|k| k[0].modes[0]).collect::<Vec<_>>();
        assert_eq!(opens.iter().map(|s| modes(s)).collect::<Vec<_>>(), [[CLOSED, OPEN, CLOSED], [CLOSED, OPEN, OPEN]]);
        assert_eq!(opens[0].stages[2][0].jump, Some(vec![CLOSED]));
        // nothing is next to a motion whose conditions are all away from their limits
        assert!(neighbours(&s, &[], &[], &[false], false).iter().all(|n| !n.local));
    }
}
