//! The simulation by which an answer is judged, stage by stage, and the kinks it meets.

use super::{
    dot, starts, Corner, Crossing, Edge, Judge, Kind, Leg, Moves, Piece, AWAY, DOUBT, MARGIN, OFF, SAME, SLOW, TOUCH,
};
use crate::error::Result;
use crate::event;
use crate::fesd::StatePoint;
use crate::func::Point;
use crate::stop;
use crate::system::SharedFunction;
use std::ops::Range;

/// Share of a piece at whose end a surface is touched, up to which its derivatives are those before.
const SHORT: f64 = 0.9;
/// Share of its distance from a surface that a state must have kept for its velocity to be one on its side.
const STILL: f64 = 0.1;
/// How often the time behind which a velocity is taken is shortened, each time to a tenth.
const SHORTER: usize = 4;

/// By how much the state behind the end of a stage differs, for every unit that a surface which is touched there would be passed by: with
/// the velocities on this side and beyond under the control before, then under the one behind. None where the state, once
/// beyond, does not come back.
fn peak([here, there, back, on]: [&[f64]; 4], speed: impl Fn(&[f64]) -> f64) -> Option<Vec<f64>> {
    let (v, beyond, returns) = (speed(here), speed(there), speed(on));
    let change = |a: &[f64], b: &[f64], share: f64| a.iter().zip(b).map(|(a, b)| (b - a) * share).collect::<Vec<f64>>();
    if beyond <= 0.0 {
        // both sides lead to the surface: it slides up to the end of the stage
        return Some(change(here, there, 1.0 / (v - beyond)));
    }
    let first = change(here, there, 1.0 / v);
    (returns < 0.0).then(|| {
        let second = change(back, on, beyond / (v * -returns));
        first.iter().zip(&second).map(|(a, b)| a + b).collect()
    })
}

/// The region of a simplex that is left, or one that stays, and one that is entered between the active regions `a` and `b`; none where none is
/// entered.
fn change(cells: &Range<usize>, a: &[bool], b: &[bool]) -> Option<(usize, usize)> {
    let to = cells.clone().find(|&c| b[c] && !a[c])?;
    let from = cells.clone().find(|&c| a[c] && !b[c]).or_else(|| cells.clone().find(|&c| a[c]))?;
    Some((from, to))
}

/// A state on the surface between two regions: its point and time, the region it is in and the one beyond, and the size of distances from the
/// surface.
struct Meeting {
    p: StatePoint,
    t: f64,
    of: (usize, usize),
    scale: f64,
}

/// The gradient of what is positive behind a surface, in states and controls, and its derivative with respect to time.
pub(super) struct Surface {
    normal: Vec<f64>,
    controls: Vec<f64>,
    moves: f64,
}

/// A stage of the answer: which one, when it begins, how long it is, its points, the first of which is its start, and the surfaces that it or
/// other stages touch.
#[derive(Clone, Copy)]
pub(super) struct Stage<'a> {
    pub(super) k: usize,
    pub(super) t: f64,
    pub(super) length: f64,
    pub(super) points: &'a [StatePoint],
    pub(super) touched: &'a [Corner],
}

impl<'a> Stage<'a> {
    /// Those of an answer from `t0` on; the start of a stage is the last point of the one before.
    pub(super) fn all(t0: f64, lengths: &[f64], points: &'a [StatePoint], touched: &'a [Corner]) -> Vec<Stage<'a>> {
        let mut first = 0;
        let of = |(k, (t, &length)): (usize, (f64, &f64))| {
            let last = points.iter().rposition(|p| p.stage == k).unwrap_or(first);
            let start = std::mem::replace(&mut first, last);
            Stage { k, t, length, points: &points[start..=last], touched }
        };
        starts(t0, lengths).into_iter().zip(lengths).enumerate().map(of).collect()
    }
}

impl Judge<'_> {
    /// Number of states of the simulation.
    pub(super) fn n(&self) -> usize {
        self.places.len()
    }

    /// The state of the answer where its variables begin at `at`.
    pub(super) fn state(&self, at: usize) -> Vec<f64> {
        self.places.iter().map(|p| p.map_or(0.0, |i| self.w[at + i])).collect()
    }

    pub(super) fn start(&mut self, t: f64, x: &[f64], stage: usize, control: usize) -> Result<()> {
        self.engine.reinit(t, x)?;
        self.engine.set_params(&self.params[stage * self.n_p..(stage + 1) * self.n_p])?;
        self.engine.set_controls(&self.controls[control * self.n_u..(control + 1) * self.n_u])
    }

    pub(super) fn advance(&mut self, t: f64) -> Result<bool> {
        stop::check()?;
        let reached = matches!(self.engine.advance(t)?, event::Outcome::Reached);
        stop::check()?;
        Ok(reached)
    }

    /// Velocity under the control of another stage, a little behind `t`.
    pub(super) fn velocity(
        &mut self,
        (t, x): (f64, &[f64]),
        stage: usize,
        control: usize,
        little: f64,
    ) -> Result<Option<Vec<f64>>> {
        self.start(t, x, stage, control)?;
        Ok(self.advance(t + little)?.then(|| self.engine.derivative().to_vec()))
    }

    /// Velocity in a region next to another one, whose surface is near: behind a shorter and shorter time, until the state has not come to it by
    /// then.
    fn velocity_in(
        &mut self,
        (region, other): (usize, usize),
        at: (f64, &[f64]),
        stage: usize,
        mut little: f64,
    ) -> Result<Option<Vec<f64>>> {
        let first = self.n() - self.dcs.dims().x;
        let gap = |judge: &Self, t: f64, x: &[f64]| {
            judge.distances(t, &x[first..], stage).map_or(0.0, |d| d[other] - d[region])
        };
        let far = gap(self, at.0, at.1);
        for _ in 0..SHORTER {
            let found = self.velocity(at, stage, stage, little)?;
            let active = |c: usize| self.engine.cells_of_step().any(|a| a == c);
            let inside = active(region) && !active(other);
            // what ends its time on the surface has the velocity behind it
            if inside && gap(self, self.engine.time(), self.engine.state()) > STILL * far {
                return Ok(found);
            }
            little *= 0.1;
        }
        self.velocity(at, stage, stage, little)
    }

    /// The surface between two regions in a stage.
    pub(super) fn surface(&self, from: usize, to: usize, t: f64, x: &[f64], stage: usize) -> Option<Surface> {
        let form = self.dcs.form();
        let (a, b) = (form.row_of(from)?, form.row_of(to)?);
        let f = form.sources.get(a.source).filter(|_| a.source == b.source)?;
        let first = self.n() - self.dcs.dims().x;
        let d = f.dims();
        let p = &self.params[stage * self.n_p..(stage + 1) * self.n_p];
        let u = &self.controls[stage * self.n_u..(stage + 1) * self.n_u];
        let pattern = f.jac_pattern();
        let mut jac = vec![0.0; pattern.nnz()];
        f.jacobian(&Point { t, x: &x[first..], u, p }, &mut jac, &mut vec![0.0; f.work_len()]).ok()?;
        let weights: Vec<f64> = a.weights.iter().zip(&b.weights).map(|(a, b)| a - b).collect();
        let column = |j: usize| pattern.rows(j).iter().zip(&jac[pattern.range(j)]).map(|(&i, v)| weights[i] * v).sum();
        let normal = (0..self.n()).map(|i| i.checked_sub(first).map_or(0.0, column)).collect();
        Some(Surface { normal, controls: (d.x..d.x + self.n_u).map(column).collect(), moves: column(d.t_col()) })
    }
}

impl Judge<'_> {
    /// Simulates a stage of the answer, on this side of the surfaces that it touches. `None` where the simulation is not that of the answer.
    pub(super) fn leg(&mut self, stage: Stage) -> Result<Option<Leg>> {
        let Stage { k, t: t0, length, points, touched } = stage;
        let [first, inner @ ..] = points else { return Ok(None) };
        let (Some(next), Some(last)) = (inner.first(), inner.last()) else { return Ok(None) };
        let (x0, x1) = (self.state(first.at), self.state(last.at));
        // a state on a surface may go on to either side: that of the answer is where its next point is
        let toward = |share: f64| -> Vec<f64> {
            let part = (share / next.share.max(share)).min(1.0);
            x0.iter().zip(self.state(next.at)).map(|(a, b)| a + part * (b - a)).collect()
        };
        let (near, ahead) = (toward(MARGIN[0]), toward(0.5 * MARGIN[1]));
        self.start(t0 + MARGIN[0] * length, &near, k, k)?;
        if !self.advance(t0 + length)? {
            return Ok(None);
        }
        let off = self.off(&x1);
        if off.is_nan() || off > OFF {
            return Ok(None);
        }
        // where the answer and the simulation differ their switches do too: the margin is as wide
        let share = (DOUBT * off).clamp(MARGIN[0], MARGIN[1]);
        let part = 0.5 * share / (0.5 * MARGIN[1]);
        let near: Vec<f64> = x0.iter().zip(&ahead).map(|(a, b)| a + part * (b - a)).collect();
        self.start(t0 + 0.5 * length * share, &near, k, k)?;
        if !self.advance(t0 + length * share)? {
            return Ok(None);
        }
        let start = self.edge();
        let mut pieces: Vec<Piece> = Vec::with_capacity(inner.len());
        for (i, p) in inner.iter().enumerate() {
            let (x, here) = (self.engine.state().to_vec(), self.engine.time());
            let (mut to, margin) = (t0 + length * p.share.clamp(share, 1.0 - share), length * share);
            let acts = i + 1 < inner.len() && self.places.iter().flatten().any(|i| self.acts[p.at + i]);
            let switch = if acts { self.switch_near(k, (here, &x), [to - margin, to + margin])? } else { None };
            if switch.is_some() {
                to -= margin;
            }
            let touched = touched.iter().find(|c| matches!(c.kind, Kind::Peak { at, .. } if at == Some(p.at)));
            let x = match touched {
                Some(c) => self.short_of(&c.normal, k, (here, &x), to, off)?,
                None => x,
            };
            self.start(here, &x, k, k)?;
            if to > here && !self.advance(to)? {
                return Ok(None);
            }
            let Some(s) = self.engine.sensitivity() else { return Ok(None) };
            let rate = if to > here { self.engine.derivative() } else { &start.rate };
            let moves = switch.and_then(|s: Surface| {
                let speed = self.speed_towards(&s.normal, s.moves, rate);
                let arrival = || rate.iter().map(|f| f / speed).collect();
                (speed > 0.0).then(|| Moves { normal: s.normal, controls: s.controls, arrival: arrival() })
            });
            pieces.push(Piece { s: s.to_vec(), rate: rate.to_vec(), at: *p, moves });
        }
        Ok(Some(Leg { off, margin: length * share, start, end: self.edge(), pieces }))
    }

    /// A state next to `x` from which the motion does not come to a surface that it touches at the end of a piece: as near as the simulation,
    /// off by `off`, and the tolerance of touching tell them apart. The derivatives are those of this side then.
    fn short_of(&mut self, normal: &[f64], k: usize, (here, x): (f64, &[f64]), to: f64, off: f64) -> Result<Vec<f64>> {
        self.start(here, x, k, k)?;
        let (n, n_z) = (self.n(), self.n() + self.n_p + self.n_u);
        let mut back = vec![0.0; n];
        if to > here && self.advance(here + SHORT * (to - here))? {
            let rows = self.engine.sensitivity().map_or(&[][..], |s| s);
            for (row, w) in rows.chunks_exact(n_z).zip(normal) {
                back.iter_mut().zip(&row[..n]).for_each(|(b, s)| *b += w * s);
            }
        }
        let usual: f64 = normal.iter().zip(&self.ranges).map(|(n, r)| (n * r).abs()).sum();
        let step = (self.touch + DOUBT * off) * usual / dot(&back, &back);
        Ok(match step.is_finite() {
            true => x.iter().zip(&back).map(|(x, b)| x - step * b).collect(),
            false => x.to_vec(),
        })
    }

    /// The surface that the motion of a stage from a point on crosses or enters between two times, if there is one.
    fn switch_near(&mut self, k: usize, (here, x): (f64, &[f64]), ends: [f64; 2]) -> Result<Option<Surface>> {
        if ends[0] <= here {
            return Ok(None);
        }
        self.start(here, x, k, k)?;
        let mut regions = [Vec::new(), Vec::new()];
        for (end, regions) in ends.into_iter().zip(&mut regions) {
            if !self.advance(end)? {
                return Ok(None);
            }
            *regions = self.regions();
        }
        let [a, b] = &regions;
        let changed = self.dcs.form().simplices.iter().find_map(|cells| change(cells, a, b));
        let (t, x) = (self.engine.time(), self.engine.state());
        Ok(changed.and_then(|(from, to)| self.surface(from, to, t, x, k)))
    }

    /// The regions of the last step.
    fn regions(&self) -> Vec<bool> {
        let mut regions = vec![false; self.dcs.n_cells()];
        self.engine.cells_of_step().for_each(|c| regions[c] = true);
        regions
    }

    pub(super) fn edge(&self) -> Edge {
        let regions = self.regions();
        let (x, rate) = (self.engine.state().to_vec(), self.engine.derivative().to_vec());
        Edge { t: self.engine.time(), x, rate, regions }
    }

    /// Largest difference of the simulated state from `x`, in ranges of the states.
    pub(super) fn off(&self, x: &[f64]) -> f64 {
        let pairs = self.engine.state().iter().zip(x).zip(&self.ranges);
        pairs
            .filter(|(_, r)| **r > 0.0)
            .fold(0.0, |m, ((a, b), r)| if m >= (a - b).abs() / r { m } else { (a - b).abs() / r })
    }

    /// Indicators of all cells at a point, less the smallest of their subsystem.
    pub(super) fn distances(&self, t: f64, x: &[f64], stage: usize) -> Option<Vec<f64>> {
        let form = self.dcs.form();
        let p = &self.params[stage * self.n_p..(stage + 1) * self.n_p];
        let u = &self.controls[stage * self.n_u..(stage + 1) * self.n_u];
        let at = |f: &SharedFunction| {
            let mut out = vec![0.0; f.n_out()];
            f.value(&Point { t, x, u, p }, &mut out, &mut vec![0.0; f.work_len()]).ok().map(|()| out)
        };
        let values: Vec<Vec<f64>> = form.sources.iter().map(at).collect::<Option<_>>()?;
        let mut out = vec![0.0; form.n_cells];
        for r in &form.rows {
            let g = dot(&r.weights, &values[r.source]);
            r.lambda.iter().for_each(|&(c, _)| out[c] = g);
        }
        for cells in &form.simplices {
            let least = out[cells.clone()].iter().copied().fold(f64::INFINITY, f64::min);
            out[cells.clone()].iter_mut().for_each(|g| *g -= least);
        }
        Some(out)
    }

    /// Surfaces that the states touch at one of the points and leave to the side they came from, where the velocity on the
    /// other side is another one.
    pub(super) fn touches(&mut self, t0: f64, lengths: &[f64], points: &[StatePoint]) -> Result<Vec<Corner>> {
        let starts = starts(t0, lengths);
        let time = |p: &StatePoint| starts[p.stage] + p.share * lengths[p.stage];
        let mut all: Vec<(StatePoint, Vec<f64>)> = Vec::with_capacity(points.len());
        for p in points {
            let apart = all.last().is_none_or(|(q, _)| time(p) - time(q) > MARGIN[0] * lengths[p.stage]);
            if let Some(d) = self.distances(time(p), &self.state(p.at), p.stage).filter(|_| apart) {
                all.push((*p, d));
            }
        }
        let n = self.dcs.n_cells();
        let scale: Vec<f64> = (0..n).map(|c| all.iter().fold(0.0, |m, (_, d)| d[c].max(m))).collect();
        let (mut out, touch) = (Vec::new(), self.touch);
        for cells in self.dcs.form().simplices.clone() {
            for c in cells.clone() {
                let near = |i: usize| all[i].1[c] <= touch * scale[c];
                let active = |i: usize| cells.clone().find(|&a| all[i].1[a] == 0.0);
                for i in 1..all.len() {
                    let comes = near(i) && !near(i - 1);
                    let alone = comes && (i + 1 == all.len() || !near(i + 1) && active(i - 1) == active(i + 1));
                    // what an answer keeps a distance from acts on all points at that distance
                    let kept = self.keeps_clear && near(i) && active(i - 1) == active(i);
                    let Some(a) = active(i - 1).filter(|a| (alone || kept) && *a != c) else { continue };
                    let (p, t) = (all[i].0, time(&all[i].0));
                    if let Some(corner) = self.touch(&Meeting { p, t, of: (a, c), scale: scale[c] }, lengths)? {
                        out.push(corner);
                    }
                }
            }
        }
        out.extend(self.left_at_start(&starts, lengths, points, &scale)?);
        Ok(out)
    }

    /// Surfaces that the state is on at the start of a stage because of the controls there, and leaves at once: had it been beyond, it
    /// would have come across a little later.
    fn left_at_start(
        &mut self,
        starts: &[f64],
        lengths: &[f64],
        points: &[StatePoint],
        scale: &[f64],
    ) -> Result<Vec<Corner>> {
        let mut out = Vec::new();
        for (k, &t) in starts.iter().enumerate() {
            let first = points.iter().position(|p| p.share > MARGIN[1] && p.stage == k);
            let Some(next) = first.filter(|&i| i > 0) else { continue };
            let at_start = |p: &&StatePoint| p.stage < k || p.share <= MARGIN[0];
            let Some(from) = points[..next].iter().rev().find(at_start) else { continue };
            let x = self.state(from.at);
            let ahead = (t + points[next].share * lengths[k], self.state(points[next].at));
            let (Some(on), Some(off)) = (self.distances(t, &x, k), self.distances(ahead.0, &ahead.1, k)) else {
                continue;
            };
            for cells in self.dcs.form().simplices.clone() {
                let scale = scale[cells.clone()].iter().fold(0f64, |m, s| m.max(*s));
                let near = |d: &[f64], c: usize| d[c] <= TOUCH * scale;
                let Some(a) = cells.clone().find(|&c| off[c] == 0.0 && near(&on, c)) else { continue };
                for c in cells.filter(|&c| c != a && near(&on, c) && !near(&off, c)) {
                    let p = StatePoint { stage: k, share: 0.0, at: from.at };
                    out.extend(self.start_on(&Meeting { p, t, of: (a, c), scale }, lengths)?);
                }
            }
        }
        Ok(out)
    }

    /// The surface that a stage begins on, where the controls move it.
    fn start_on(&mut self, at: &Meeting, lengths: &[f64]) -> Result<Option<Corner>> {
        let Some(surface) = self.surface_at(at) else { return Ok(None) };
        if surface.controls.iter().all(|c| *c == 0.0) {
            return Ok(None);
        }
        let Some([here, there]) = self.beside(&surface, at, at.p.stage, lengths)? else { return Ok(None) };
        let [away, back] = [&here, &there].map(|f| self.speed_towards(&surface.normal, surface.moves, f));
        if away >= 0.0 {
            return Ok(None);
        }
        // where the state would stay beyond it that is no small change
        let beyond = (back < 0.0).then(|| here.iter().zip(&there).map(|(a, b)| (b - a) / -back).collect());
        let Surface { normal, controls, .. } = surface;
        let stage = at.p.stage;
        Ok(Some(Corner { stage, t: at.t, normal, controls, own: stage, kind: Kind::Peak { at: None, beyond } }))
    }

    /// The surface that a state meets.
    fn surface_at(&self, at: &Meeting) -> Option<Surface> {
        self.surface(at.of.0, at.of.1, at.t, &self.state(at.p.at), at.p.stage)
    }

    /// Velocities on this side of a surface that a state meets, and beyond, under the controls of a stage.
    fn beside(
        &mut self,
        surface: &Surface,
        &Meeting { p, t, of, scale }: &Meeting,
        stage: usize,
        lengths: &[f64],
    ) -> Result<Option<[Vec<f64>; 2]>> {
        let x = self.state(p.at);
        let own = stage * self.n_u..(stage + 1) * self.n_u;
        let held = self.controls[own.clone()].to_vec();
        let by_states = surface.normal.iter().any(|n| *n != 0.0);
        // no state is beside a surface that controls and time alone move: other controls are
        let (from, along) = if by_states { (&x, &surface.normal) } else { (&held, &surface.controls) };
        let step = self.touch * scale / dot(along, along);
        if !step.is_finite() {
            return Ok(None);
        }
        let mut at = |sign: f64, side: (usize, usize)| {
            let moved: Vec<f64> = from.iter().zip(along).map(|(a, d)| a + sign * step * d).collect();
            let little = MARGIN[0] * lengths[stage];
            if by_states {
                return self.velocity_in(side, (t, &moved), stage, little);
            }
            self.controls[own.clone()].copy_from_slice(&moved);
            let found = self.velocity_in(side, (t, &x), stage, little);
            self.controls[own.clone()].copy_from_slice(&held);
            found
        };
        let here = at(-1.0, of)?;
        Ok(here.zip(at(1.0, (of.1, of.0))?).map(|(here, there)| [here, there]))
    }

    /// A touched surface; none where the velocity is the same on both sides.
    fn touch(&mut self, at: &Meeting, lengths: &[f64]) -> Result<Option<Corner>> {
        let Some(surface) = self.surface_at(at) else { return Ok(None) };
        let &Meeting { p, t, .. } = at;
        let ends = p.share >= 1.0 - MARGIN[0];
        if !ends && surface.normal.iter().all(|n| *n == 0.0) {
            // inside of a stage controls and time alone touch it tangentially
            return Ok(None);
        }
        let Some([here, there]) = self.beside(&surface, at, p.stage, lengths)? else { return Ok(None) };
        let behind = p.stage + 1;
        let last = ends && behind == lengths.len();
        let next = if ends && !last { self.beside(&surface, at, behind, lengths)? } else { None };
        let beyond: Vec<f64> = there.iter().zip(&here).map(|(b, a)| b - a).collect();
        let horizon: f64 = lengths.iter().sum();
        // the cost has no range: its rate is compared with itself
        let usual = |i: usize| (self.ranges[i] / horizon).max(there[i].abs().max(here[i].abs()));
        if !beyond.iter().enumerate().any(|(i, f)| f.abs() > SAME * usual(i)) {
            return Ok(None);
        }
        let Surface { normal, controls, moves } = surface;
        let towards = |f: &[f64]| self.speed_towards(&normal, moves, f);
        if last || ends && controls.iter().any(|c| *c != 0.0) {
            // nothing comes behind, or the surface is another one under the next control: it is reached a little before the end of the stage, or
            // not at all
            let v = towards(&here);
            let speed = v - towards(&there).min(0.0);
            if v > 0.0 || last && v == 0.0 && speed > 0.0 {
                let kind = Kind::Peak { at: None, beyond: Some(beyond.iter().map(|b| b / speed).collect()) };
                return Ok(Some(Corner { stage: behind, t, normal, controls, own: p.stage, kind }));
            }
            if last {
                return Ok(None);
            }
        } else if let Some([back, on]) = next {
            // it comes to the surface with the control before, and leaves it with the one behind
            let turns = towards(&here) > 0.0 && towards(&back) < 0.0;
            let beyond = if turns { peak([&here, &there, &back, &on], towards) } else { None };
            if beyond.is_some() {
                let kind = Kind::Peak { at: None, beyond };
                return Ok(Some(Corner { stage: behind, t, normal, controls, own: p.stage, kind }));
            }
        }
        // touched from this side along the surface, and led back to it from beyond: it would slide until the motion leads away
        let back = towards(&here) - towards(&there);
        let kind = if back > 0.0 && towards(&there) < 0.0 {
            Kind::Peak { at: Some(p.at), beyond: Some(beyond.iter().map(|b| b / back).collect()) }
        } else {
            Kind::Touch { at: p.at, beyond }
        };
        Ok(Some(Corner { stage: p.stage, t, normal, controls, own: p.stage, kind }))
    }

    /// Speed towards a surface with the gradient `normal` that moves by itself by `moves`; zero where it is that of rounding errors.
    fn speed_towards(&self, normal: &[f64], moves: f64, rate: &[f64]) -> f64 {
        let speed = dot(normal, rate) + moves;
        let terms = normal.iter().zip(rate).map(|(n, f)| (n * f).abs()).sum::<f64>() + moves.abs();
        // what the ranges of the states over the horizon make of it
        let usual = normal.iter().zip(&self.ranges).map(|(n, r)| (n * r).abs()).sum::<f64>() / self.horizon;
        if speed.abs() > SLOW * terms.max(usual) {
            speed
        } else {
            0.0
        }
    }

    /// Is a region another one in stage `k` because the controls are, and not because the state comes to its surface?
    fn controls_choose(&self, k: usize, (from, to): (usize, usize), end: &Edge) -> bool {
        let first = self.n() - self.dcs.dims().x;
        let gap = |stage: usize| self.distances(end.t, &end.x[first..], stage).map(|d| d[to] - d[from]);
        let (Some(before), Some(behind)) = (gap(k - 1), gap(k)) else { return false };
        before.abs() > SAME * (behind - before).abs() && behind != before
    }

    /// The switches between two stages: regions that are active behind, and were not before.
    pub(super) fn between(&mut self, k: usize, before: &Leg, behind: &Leg) -> Result<Vec<Corner>> {
        let simplices = self.dcs.form().simplices.clone();
        let mut out = Vec::new();
        for cells in simplices {
            let (a, b) = (&before.end.regions, &behind.start.regions);
            let Some((from, to)) = change(&cells, a, b) else { continue };
            let surface = self.surface(from, to, before.end.t, &before.end.x, k - 1);
            let Some(Surface { normal, controls, moves }) = surface else { continue };
            if normal.iter().all(|n| *n == 0.0) && moves == 0.0 || self.controls_choose(k, (from, to), &before.end) {
                continue;
            }
            let over = |at: &Self, fa: &[f64], fb: &[f64]| -> Option<Crossing> {
                let v = at.speed_towards(&normal, moves, fa);
                let jump = || fa.iter().zip(fb).map(|(a, b)| (b - a) / v).collect();
                (v > 0.0).then(|| Crossing { jump: jump(), arrival: fa.iter().map(|a| a / v).collect() })
            };
            let little = 0.1 * before.margin.min(behind.margin);
            let (end, start) = (&before.end, &behind.start);
            let new_before = self.velocity((start.t, &start.x), k, k - 1, little)?;
            let old_behind = self.velocity((end.t, &end.x), k - 1, k, little)?;
            // where the surface is another one under the control behind, that alone says what is active there
            let after = match controls.iter().any(|c| *c != 0.0) {
                true => Some(Crossing { jump: vec![0.0; self.n()], arrival: vec![0.0; self.n()] }),
                false => old_behind.and_then(|fa| over(self, &fa, &behind.start.rate)),
            };
            let kind = Kind::Switch { before: new_before.and_then(|fb| over(self, &before.end.rate, &fb)), after };
            let t = 0.5 * (before.end.t + behind.start.t);
            out.push(Corner { stage: k, t, normal, controls, own: k - 1, kind });
        }
        Ok(out)
    }
}

impl Judge<'_> {
    /// Simulates all stages. `None` where that does not lead to the states of the answer.
    pub(super) fn simulate(&mut self, stages: &[Stage]) -> Result<Option<(Vec<Leg>, Vec<Corner>)>> {
        let (mut legs, mut kinks): (Vec<Leg>, Vec<Corner>) = (Vec::new(), Vec::new());
        for &stage in stages {
            let k = stage.k;
            let Some(leg) = self.leg(stage)? else { return Ok(None) };
            if let Some(before) = legs.last() {
                kinks.extend(self.between(k, before, &leg)?);
            }
            legs.push(leg);
        }
        Ok(Some((legs, kinks)))
    }

    /// The state of the answer at the end of a stage.
    fn end_of(&self, leg: &Leg) -> Vec<f64> {
        leg.pieces.last().map_or_else(Vec::new, |p| self.state(p.at.at))
    }

    /// Does a simulation of the whole horizon leave the answer by more than what the derivatives make of their difference, or might
    /// it as well? Where several motions go on from a point, on a surface that both sides lead away from, an answer takes
    /// the cheapest, and what its controls lead to is another one.
    ///
    /// A surface that is reached exactly at the end of a stage, under its control, and that both sides lead away from under the next one
    /// is none of these: the answer is the limit of motions that reach it a little earlier.
    pub(super) fn departs(
        &mut self,
        t0: f64,
        lengths: &[f64],
        first: usize,
        legs: &[Leg],
        kinks: &[Corner],
    ) -> Result<bool> {
        let n = self.n();
        let n_z = n + self.n_p + self.n_u;
        let (mut t, mut x, mut apart) = (t0, self.state(first), vec![0.0; n]);
        for (k, (leg, length)) in legs.iter().zip(lengths).enumerate() {
            let reached = |c: &Corner| c.stage == k && matches!(c.kind, Kind::Switch { before: Some(_), after: None });
            if kinks.iter().any(reached) {
                // on the side of the motions that it is the limit of
                let at = self.end_of(&legs[k - 1]);
                let moved: Vec<f64> =
                    leg.start.x.iter().zip(x.iter().zip(&at)).map(|(s, (x, at))| s + (x - at)).collect();
                self.start(leg.start.t, &moved, k, k)?;
            } else {
                self.start(t, &x, k, k)?;
            }
            t += length;
            let end = self.end_of(leg);
            if !self.advance(t)? || self.engine.ambiguous() {
                return Ok(true);
            }
            for piece in &leg.pieces {
                apart = piece.s.chunks_exact(n_z).map(|row| dot(&row[..n], &apart)).collect();
            }
            let sizes = apart.iter().zip(&self.ranges).filter(|(_, r)| **r > 0.0);
            let expected = sizes.fold(0f64, |m, (d, r)| m.max(d.abs() / r));
            let off = self.off(&end);
            if off.is_nan() || off > OFF && off > AWAY * (leg.off + expected) {
                return Ok(true);
            }
            if off > OFF {
                // too far for derivatives to say more
                return Ok(false);
            }
            x = self.engine.state().to_vec();
            apart = x.iter().zip(&end).map(|(a, b)| a - b).collect();
        }
        Ok(false)
    }
}
