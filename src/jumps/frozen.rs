//! Time-freezing: the problem in numerical time, where nothing jumps, as finite elements with switch detection.
//!
//! The scene becomes a piecewise smooth system whose clock stands still while auxiliary dynamics take the velocities through an impact
//! (`freezing`). Numerical and physical control grid are the same: in every stage a control, the *speed of time* `s`, multiplies all
//! rates, and at the ends of stages the clock shows the numerical time (8.58). Running costs are integrals over physical time, states
//! whose rates are frozen with the clock (8.55). Like every search it leads to modes; the exact answer is that of the contact mode
//! program.

use std::sync::Arc;

use super::complementary::{direction, SHARE};
use super::modes::ContactMode;
use super::problem::Problem;
use super::track::{Piece, Track};
use crate::dcs::{Dcs, FormOptions};
use crate::error::{Error, Result};
use crate::expr::{all_inputs, Block, Dag, ExprFunction, Id};
use crate::fesd::{self, Boundary, Element, Fesd, PathAt, PathConstraint, Sizes, Spec, Terminal, Trajectory};
use crate::freezing::{freeze_mechanics, Frozen, Layout, Report};
use crate::func::{Dims, Point};
use crate::nlp::{middles, Bounds};
use crate::settings::{DcsForm, Settings};
use crate::system::SharedFunction;

/// Elements of a control stage: flight, jump, and what follows.
const ELEMENTS: usize = 3;
/// Largest speed of time. A stage whose jump takes two of its elements needs 3.
const FASTEST: f64 = 10.0;
/// Share of the speed of time below which the clock of an element stands still.
const STILL: f64 = 0.2;
/// Share of the largest gap of a contact below which it may be closed, or hit: relaxed motions do not touch.
const NEAR: f64 = 0.05;
/// Sizes of states that are small in the guess, as a share of the largest of their kind.
const SMALL: f64 = 0.1;

/// The program in numerical time.
pub(super) struct Program {
    pub(super) fesd: Fesd,
    pub(super) bounds: Bounds,
    /// Where a solve starts.
    pub(super) start: Vec<f64>,
    layout: Layout,
    /// Rate at which gaps usually close.
    speed: f64,
    /// What stands for the contacts, and how strong it is.
    pub(super) report: Report,
}

/// What is known of the motion in advance.
struct Scales {
    /// Rate at which gaps usually close.
    speed: f64,
    /// Largest normal force of a simulation of the guess.
    force: f64,
    /// Sizes of the states of the scene.
    x: Vec<f64>,
}

/// The program of a problem, from a guess of its motion; `seen` is a simulation of its controls.
///
/// # Errors
/// [`Error::Unsupported`] for what time-freezing cannot express, in the words of the scene, and where nothing is known of the speed at which
/// contacts close; those of building the system.
pub(super) fn transcribe(p: &Problem, (guess, seen): (&Track, &Track), sigma: f64) -> Result<Program> {
    let g = &p.given;
    let scales = Scales::new(p, &[guess, seen])?;
    let mut dag = Dag::new();
    let frozen = freeze(p, &mut dag, &scales)?;
    let mut writer = Writer { dag: &mut dag, from: g.wide, to: frozen.model.dims, layout: &frozen.layout };
    let spec = writer.spec(p, &frozen)?;
    let mut fesd = Fesd::new(spec, g.durations[0])?;
    crate::stop::check_building(crate::nlp::Nlp::n(&fesd))?;
    let bounds = write_data(p, &mut fesd, &frozen.layout)?;
    let sizes = sizes(p, &fesd, &frozen.layout, &scales, &[guess, seen]);
    fesd.set_sizes(&sizes);
    let mut start = vec![0.0; crate::nlp::Nlp::n(&fesd)];
    let l = &frozen.layout;
    let nx = g.dims.x;
    fesd.guess(
        &mut start,
        g.t0,
        |t, x| {
            x.fill(0.0);
            guess.state(g.t0 + t, false, &mut x[..nx]);
            x[l.clock] = g.t0 + t;
        },
        |k, u| {
            u[..g.wide.u].copy_from_slice(&guess.controls[k * g.wide.u..(k + 1) * g.wide.u]);
            u[g.wide.u] = 1.0;
        },
    );
    if fesd.relax_pairs(&mut start, sigma).is_err() {
        // without values the multipliers stay as they were written
        fesd.forget_trouble();
    }
    Ok(Program { fesd, bounds, start, layout: frozen.layout, speed: scales.speed, report: frozen.report })
}

/// The scene in numerical time, with a speed of time and the running cost as a state.
fn freeze(p: &Problem, dag: &mut Dag, scales: &Scales) -> Result<Frozen> {
    let g = &p.given;
    let mechanics =
        g.system.mechanics().ok_or_else(|| Error::Internal("a scene without equations of motion".into()))?;
    let inputs = all_inputs(dag, g.wide);
    let costs = match &g.lagrange {
        Some(f) => dag.call(f, &inputs)?,
        None => Vec::new(),
    };
    let shortest = g.durations.iter().copied().fold(f64::INFINITY, f64::min);
    let options = crate::freezing::Options {
        step: shortest / ELEMENTS as f64,
        speed: scales.speed,
        force: scales.force,
        speed_of_time: true,
        costs,
        at: middles(&g.x0_bounds),
        params: g.params[..g.wide.p].to_vec(),
        ..Default::default()
    };
    freeze_mechanics(mechanics, g.wide, dag, &options)
}

/// Functions of costs and constraints in numerical time.
struct Writer<'a> {
    dag: &'a mut Dag,
    /// Sizes of the functions.
    from: Dims,
    /// Sizes of the system in numerical time.
    to: Dims,
    layout: &'a Layout,
}

impl Writer<'_> {
    /// A function with the clock as its time, of `copies` states one after the other.
    fn function(&mut self, f: &SharedFunction, copies: usize) -> Result<SharedFunction> {
        let outputs = self.outputs(f, copies)?;
        let dims = Dims { x: copies * self.to.x, ..self.to };
        Ok(Arc::new(ExprFunction::new(f.name(), self.dag, dims, &outputs)?))
    }

    fn outputs(&mut self, f: &SharedFunction, copies: usize) -> Result<Vec<Id>> {
        let mut inputs = Vec::new();
        for c in 0..copies {
            inputs.extend((0..self.from.x).map(|i| self.dag.input(Block::X, c * self.to.x + i)));
        }
        inputs.extend(self.dag.inputs(Block::U, self.from.u));
        inputs.extend(self.dag.inputs(Block::P, self.from.p));
        inputs.push(self.dag.input(Block::X, (copies - 1) * self.to.x + self.layout.clock));
        self.dag.call(f, &inputs)
    }

    /// The running cost is a state, the others are functions of the end.
    fn terminal_cost(&mut self, mayer: Option<&SharedFunction>) -> Result<Option<SharedFunction>> {
        let mut terms = match mayer {
            Some(f) => self.outputs(f, 1)?,
            None => Vec::new(),
        };
        terms.extend((self.layout.costs.0..self.layout.costs.1).map(|k| self.dag.input(Block::X, k)));
        let Some(&first) = terms.first() else { return Ok(None) };
        let sum = terms[1..].iter().fold(first, |sum, t| self.dag.add(sum, *t));
        Ok(Some(Arc::new(ExprFunction::new("cost", self.dag, self.to, &[sum])?)))
    }

    fn spec(&mut self, p: &Problem, frozen: &Frozen) -> Result<Spec> {
        let g = &p.given;
        let form = FormOptions { form: DcsForm::Heaviside, ..FormOptions::default() };
        let mut dcs = Dcs::new(&frozen.model.system, form)?;
        dcs.require_clock();
        let options = fesd::Options {
            family: g.tableau.family,
            n_s: g.tableau.n_s,
            ..fesd::Options::from_settings(&Settings::default())?
        };
        let mut path = vec![self.equal_clocks()?];
        for c in &g.path {
            path.push(PathConstraint { f: self.function(&c.f, 1)?, ..c.clone() });
        }
        let (mut terminal, mut boundary) = (Vec::new(), Vec::new());
        for c in &g.terminal {
            terminal.push(Terminal { f: self.function(&c.f, 1)?, ..c.clone() });
        }
        for c in &g.boundary {
            boundary.push(Boundary { f: self.function(&c.f, 2)?, ..c.clone() });
        }
        let grid_cost = g.grid_cost.as_ref().map(|f| self.function(f, 1)).transpose()?;
        Ok(Spec {
            durations: g.time,
            free_params: g.free.iter().map(Option::is_some).collect(),
            stage_params: true,
            mayer: self.terminal_cost(g.mayer.as_ref())?,
            grid_cost,
            path,
            terminal,
            boundary,
            ..Spec::new(dcs, options, vec![ELEMENTS; g.durations.len()])
        })
    }

    /// The clock shows the numerical time at the ends of control stages.
    fn equal_clocks(&mut self) -> Result<PathConstraint> {
        let (clock, t) = (self.dag.input(Block::X, self.layout.clock), self.dag.input(Block::T, 0));
        let late = self.dag.sub(clock, t);
        let f = Arc::new(ExprFunction::new("physical time", self.dag, self.to, &[late])?);
        Ok(PathConstraint { f, lower: vec![0.0], upper: vec![0.0], at: PathAt::ControlGrid })
    }
}

/// Parameters, lengths and bounds.
fn write_data(p: &Problem, fesd: &mut Fesd, layout: &Layout) -> Result<Bounds> {
    let g = &p.given;
    let n = g.durations.len();
    let mut b = fesd.bounds();
    fesd.set_params(&g.params[..g.wide.p])?;
    for k in 0..if g.wide.p == 0 { 0 } else { n } {
        fesd.set_stage_params(k, &g.params[k * g.wide.p..(k + 1) * g.wide.p])?;
    }
    fesd.set_durations(&g.durations)?;
    fesd.write_durations(&mut b);
    for k in 0..if g.time == fesd::Durations::Horizon { 1 } else { n } {
        fesd.bound_duration(&mut b, k, g.time_bounds[0], g.time_bounds[1]);
    }
    fesd.bound_states(&mut b, &g.x_bounds[0], &g.x_bounds[1]);
    let nx = fesd.spec().dcs.dims().x;
    let mut initial = g.x0_bounds.clone();
    for list in &mut initial {
        list.resize(nx, 0.0);
        list[layout.clock] = g.t0;
    }
    fesd.bound_initial(&mut b, &initial[0], &initial[1], g.t0);
    let [mut lower, mut upper] = g.u_bounds.clone();
    lower.push(1.0);
    upper.push(FASTEST);
    (0..n).for_each(|k| fesd.bound_control(&mut b, k, &lower, &upper));
    for (j, free) in g.free.iter().enumerate() {
        if let Some([l, u]) = free {
            fesd.bound_param(&mut b, j, *l, *u);
        }
    }
    b.validate(crate::nlp::Nlp::n(fesd), crate::nlp::Nlp::m(fesd))?;
    Ok(b)
}

impl Scales {
    fn new(p: &Problem, known: &[&Track]) -> Result<Scales> {
        let target = p.given.target.as_deref();
        let g = &p.given;
        let horizon: f64 = g.durations.iter().sum();
        let (mut speed, mut force, mut x) = (0f64, 0f64, vec![0f64; g.dims.x]);
        for track in known {
            for piece in &track.pieces {
                for state in std::iter::once(&piece.x0[..]).chain(piece.xs.chunks_exact(g.dims.x)) {
                    x.iter_mut().zip(state).for_each(|(size, v)| *size = size.max(v.abs()));
                    let closing = (0..p.n_contacts()).map(|i| -rate(p, i, piece, state, &track.controls));
                    speed = closing.fold(speed, f64::max);
                }
                force = piece.forces.chunks_exact(2).fold(force, |m, f| m.max(f[0]));
            }
        }
        if let Some(first) = known.first().and_then(|t| t.pieces.first()) {
            // what is to close within the horizon, and what is to get to the target
            let closing = (0..p.n_contacts()).map(|i| gap(p, i, first, &first.x0, &known[0].controls) / horizon);
            speed = closing.fold(speed, f64::max);
            let way = target.unwrap_or(&first.x0).iter().zip(&first.x0).take(p.functions.n_q);
            speed = way.map(|(a, b)| (a - b).abs() / horizon).fold(speed, f64::max);
        }
        for (size, v) in x.iter_mut().zip(target.unwrap_or(&[])) {
            *size = size.max(v.abs());
        }
        if !(speed > 0.0 && speed.is_finite()) {
            return Err(Error::Unsupported(
                "time-freezing: nothing is known of the speed at which contacts close: no contact closes in a simulation of the guess, and \
                 nothing moves; give a guess of the states"
                    .into(),
            ));
        }
        let n_q = p.functions.n_q;
        for (range, least) in [(0..n_q, speed * horizon / g.durations.len() as f64), (n_q..g.dims.x, speed)] {
            let largest = x[range.clone()].iter().copied().fold(least, f64::max);
            x[range].iter_mut().for_each(|v| *v = v.max(SMALL * largest));
        }
        Ok(Scales { speed, force, x })
    }
}

/// Sizes of all variables.
fn sizes(p: &Problem, fesd: &Fesd, l: &Layout, scales: &Scales, known: &[&Track]) -> Sizes {
    let g = &p.given;
    let nx = fesd.spec().dcs.dims().x;
    let horizon: f64 = g.durations.iter().sum();
    let mut x = scales.x.clone();
    x.resize(nx, 1.0);
    // how deep a contact gets in the step a jump takes
    x[l.depths.0..l.depths.1].fill(scales.speed * horizon / (ELEMENTS * g.durations.len()) as f64);
    x[l.clock] = horizon;
    let size = |l: f64, u: f64| match (l.is_finite(), u.is_finite()) {
        (true, true) if l.abs().max(u.abs()) > 0.0 => l.abs().max(u.abs()),
        (true, false) if l != 0.0 => l.abs(),
        (false, true) if u != 0.0 => u.abs(),
        _ => 1.0,
    };
    let mut u: Vec<f64> = g.u_bounds[0].iter().zip(&g.u_bounds[1]).map(|(l, u)| size(*l, *u)).collect();
    u.push(1.0);
    let sources = &fesd.spec().dcs.form().sources;
    let mut psi = vec![0f64; sources.iter().map(|f| f.n_out()).sum()];
    for track in known {
        for piece in &track.pieces {
            let mut state = piece.x0.clone();
            state.resize(nx, 0.0);
            state[l.clock] = piece.t;
            let mut control = track.controls[piece.stage * g.wide.u..(piece.stage + 1) * g.wide.u].to_vec();
            control.push(1.0);
            let params = &g.params[piece.stage * g.wide.p..(piece.stage + 1) * g.wide.p];
            let mut first = 0;
            for f in sources {
                let mut out = vec![0.0; f.n_out()];
                let at = Point { t: piece.t, x: &state, u: &control, p: params };
                if f.value(&at, &mut out, &mut vec![0.0; f.work_len()]).is_ok() {
                    psi[first..].iter_mut().zip(&out).for_each(|(m, v)| *m = m.max(v.abs()));
                }
                first += out.len();
            }
        }
    }
    let largest = psi.iter().copied().fold(0.0, f64::max);
    for v in &mut psi {
        *v = if largest > 0.0 && v.is_finite() { v.max(SMALL * largest) } else { 1.0 };
    }
    Sizes { x, u, p: vec![1.0; g.wide.p], psi }
}

/// A function of a contact at a state in a piece; zero where it has no value.
fn value(p: &Problem, f: &SharedFunction, piece: &Piece, x: &[f64], controls: &[f64]) -> f64 {
    let g = &p.given;
    let u = &controls[piece.stage * g.wide.u..piece.stage * g.wide.u + g.dims.u];
    let params = &g.params[piece.stage * g.wide.p..piece.stage * g.wide.p + g.dims.p];
    let mut out = [0.0];
    match f.value(&Point { t: piece.t, x, u, p: params }, &mut out, &mut vec![0.0; f.work_len()]) {
        Ok(()) => out[0],
        Err(_) => 0.0,
    }
}

fn gap(p: &Problem, i: usize, piece: &Piece, x: &[f64], controls: &[f64]) -> f64 {
    value(p, &p.functions.contacts[i].gap, piece, x, controls)
}

fn rate(p: &Problem, i: usize, piece: &Piece, x: &[f64], controls: &[f64]) -> f64 {
    value(p, &p.functions.contacts[i].rate, piece, x, controls)
}

fn slide(p: &Problem, i: usize, piece: &Piece, x: &[f64], controls: &[f64]) -> f64 {
    p.functions.contacts[i].slide.as_ref().map_or(0.0, |f| value(p, f, piece, x, controls))
}

impl Program {
    /// The motion over physical time at a point of the program: elements in which the clock stands still are jumps.
    pub(super) fn read(&self, p: &Problem, w: &[f64]) -> Track {
        let g = &p.given;
        let nx = g.dims.x;
        let mut found = Trajectory::new(&self.fesd.spec().dcs, self.fesd.tableau());
        found.append(&self.fesd, w, None, g.t0);
        let all = self.fesd.controls(w);
        let wide = g.wide.u + 1;
        let controls: Vec<f64> = all.chunks_exact(wide).flat_map(|u| u[..g.wide.u].to_vec()).collect();
        let params = self.fesd.params_at(w);
        let free = g.free.iter().zip(&params).filter(|(f, _)| f.is_some()).map(|(_, v)| *v).collect();
        let mut track = Track { tableau: g.tableau.clone(), nx, pieces: Vec::new(), controls, free };
        let clock = self.layout.clock;
        let runs = |e: &Element| e.x1[clock] - e.x0[clock] > STILL * all[(e.stage + 1) * wide - 1] * e.h;
        let n_c = p.n_contacts();
        // states before the jumps that lead to the next piece
        let mut before: Vec<Option<Vec<f64>>> = Vec::new();
        let mut jumping: Option<Vec<f64>> = None;
        for e in &found.elements {
            if !runs(e) {
                jumping.get_or_insert_with(|| e.x0[..nx].to_vec());
                continue;
            }
            before.push(jumping.take());
            track.pieces.push(Piece {
                t: e.x0[clock],
                h: e.x1[clock] - e.x0[clock],
                stage: e.stage,
                modes: vec![ContactMode::Open; n_c],
                x0: e.x0[..nx].to_vec(),
                xs: e.xs.chunks_exact(e.x0.len()).flat_map(|x| x[..nx].to_vec()).collect(),
                forces: vec![0.0; g.tableau.n_s * n_c * 2],
                ..Piece::default()
            });
        }
        for i in 0..n_c {
            self.read_contact(p, i, &before, &mut track);
        }
        for k in 1..track.pieces.len() {
            let [last, q] = &mut track.pieces[k - 1..=k] else { continue };
            let Some(jump) = &mut q.jump else { continue };
            // what stays closed holds against the impact
            for (part, (was, is)) in jump.iter_mut().zip(last.modes.iter().zip(&q.modes)) {
                if was.is_closed() && is.is_closed() && !part.is_closed() {
                    *part = *is;
                }
            }
        }
        track
    }

    /// Modes and jumps of a contact.
    fn read_contact(&self, p: &Problem, i: usize, before: &[Option<Vec<f64>>], track: &mut Track) {
        let (nx, controls) = (track.nx, &track.controls);
        let gaps = |q: &Piece| -> f64 {
            let states = std::iter::once(&q.x0[..]).chain(q.xs.chunks_exact(nx));
            states.map(|x| gap(p, i, q, x, controls).abs()).fold(0.0, f64::max)
        };
        let largest = track.pieces.iter().map(gaps).fold(0.0, f64::max);
        let slow = SHARE * self.speed;
        let bounces = p.restitutions(track.pieces.first().map_or(&[], |q| &q.x0))[i] > 0.0;
        let n_c = p.n_contacts();
        let mut closed = false;
        let mut changes = Vec::with_capacity(track.pieces.len());
        for (k, q) in track.pieces.iter().enumerate() {
            let rests = q.xs.chunks_exact(nx).map(|x| rate(p, i, q, x, controls).abs()).fold(0.0, f64::max);
            let is_closed = !bounces && gaps(q) <= NEAR * largest && rests <= NEAR * self.speed;
            let last = &q.xs[q.xs.len() - nx..];
            let along = |x: &[f64]| direction(&[slide(p, i, q, x, controls)], slow);
            let mode = if is_closed { along(last) } else { ContactMode::Open };
            let jump = before[k].as_ref().filter(|x| {
                let (was, is) = (rate(p, i, q, x, controls), rate(p, i, q, &q.x0, controls));
                was < -slow && is - was > slow && gap(p, i, q, x, controls) <= NEAR * largest
            });
            let lands = is_closed && !closed && k > 0;
            changes.push((mode, (jump.is_some() || lands).then(|| along(&q.x0))));
            closed = is_closed;
        }
        for (q, (mode, part)) in track.pieces.iter_mut().zip(changes) {
            q.modes[i] = mode;
            let Some(part) = part else { continue };
            q.jump.get_or_insert_with(|| vec![ContactMode::Open; n_c])[i] = part;
            q.impulses.resize(2 * n_c, 0.0);
        }
    }
}
