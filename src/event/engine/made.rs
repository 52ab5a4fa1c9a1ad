//! How an engine is made, and how it begins anew.

use std::time::Instant;

use super::accumulation::Recent;
use super::algebraic::Follower;
use super::chatter::Window;
use super::contact::SceneRoom;
use super::control::{Cut, FirstStep, Pace};
use super::foresight::Foresight;
use super::limit_set::Shrinking;
use super::notes::Notes;
use super::parts::{Calendar, ContactEvents, Derivatives, EventFunctions, Log, Stepper};
use super::record::Sampled;
use super::worth::Worth;
use super::{Engine, Polls, EPS};
use crate::dcs::Dcs;
use crate::error::{finite, Error, Result};
use crate::event::bernstein::{Sampler, NODES};
use crate::event::calendar::UnitEvents;
use crate::event::explicit::Pair;
use crate::event::field::{Apart, Field};
use crate::event::guard::Reset;
use crate::event::path::Path;
use crate::event::radau::Radau;
use crate::event::sens::Sens;
use crate::event::step::Step;
use crate::event::tape::Tape;
use crate::event::{Ambiguity, Method, Options, Outcome, Sensitivity, Statistics};
use crate::system::System;

impl Engine {
    /// Prepares the simulation of a system. State, controls and parameters are zero until they are set.
    pub fn new(system: &System, options: &Options) -> Result<Engine> {
        let switched = system.with_switches();
        let system = switched.as_ref();
        let (elimination, stated) = (system.eliminated()?, system);
        let system = elimination.as_ref().map_or(system, |e| &e.system);
        let dcs = Dcs::with_modes_on_demand(system)?;
        let nx = dcs.dims().x;
        let n_shown = stated.dims().x;
        options.validate(n_shown)?;
        if system.on_demand().is_some() && (options.sensitivity != Sensitivity::Off || options.adjoint) {
            return Err(Error::Unsupported(
                "derivatives of simulations whose modes are formed on demand: the model has too many coupled switching functions for \
                 a list of its modes"
                    .into(),
            ));
        }
        let mut field = Field::new(&dcs, system);
        field.selection = options.selection;
        field.traces.keeps_columns = options.sensitivity != Sensitivity::Off || options.adjoint;
        let spread = |v: &[f64]| (0..nx).map(|i| v[i % v.len()]).collect::<Vec<f64>>();
        let (n_q, n_z, n_cells) = (field.q.len(), field.n_z, field.n_cells);
        let most = n_cells.saturating_sub(field.subs.len());
        let (mut rtol, mut atol) = (spread(&options.rtol), spread(&options.atol));
        let follower = elimination.as_ref().map(|e| Box::new(Follower::new(e, stated)));
        let mut options = options.clone();
        if let Some(a) = &follower {
            options.preferred = a.preferred(&options.preferred);
        }
        check_preferred(&options, &field)?;
        if let Some(a) = &follower {
            // errors are means of squares over all states, and those of algebraic ones are zero
            let share = ((n_shown - a.states().len()) as f64 / nx as f64).sqrt();
            rtol.iter_mut().chain(&mut atol).for_each(|v| *v *= share);
        }
        // a relative tolerance near rounding makes nothing of a state count as large
        field.floor = rtol.iter().zip(&atol).map(|(r, a)| a / r.max(EPS.sqrt())).collect();
        let finest = rtol.iter().fold(f64::INFINITY, |m, v| m.min(*v));
        let pair = match options.method {
            Method::Dp5 => Pair::Dp5,
            Method::Auto if finest > 1e-5 => Pair::Dp5,
            _ => Pair::Dop853,
        };
        let (n_w, n_dq) = (n_q + n_cells, field.dq.len());
        let first = if options.sensitivity == Sensitivity::Inputs { nx } else { 0 };
        let mut sens =
            (options.sensitivity != Sensitivity::Off && n_z > 1 + first).then(|| Sens::new(nx, n_z, most, first));
        if let Some(s) = sens.as_mut().filter(|_| field.guards.all.is_empty() && !field.has_contacts()) {
            s.use_supports(&field.supports());
        }
        Ok(Engine {
            nx,
            rtol,
            atol,
            set: Vec::with_capacity(2),
            apart: Apart::default(),
            candidates: Vec::new(),
            kept: vec![false; field.subs.len()],
            keeps: false,
            ruled_out: vec![0; n_cells],
            before: Vec::new(),
            arrived: false,
            known_end: false,
            t: 0.0,
            x: vec![0.0; nx],
            f: vec![0.0; nx],
            f_before: vec![0.0; nx],
            restart: true,
            t_start: 0.0,
            t_stop: 0.0,
            decider: None,
            arbiter: None,
            discrete: system.discrete_states(),
            known_times: (system.known_times().to_vec(), 0),
            notes: Notes::new(system),
            algebraic: follower,
            unmade: false,
            interrupt: None,
            polls: Polls { ask: None, next: Instant::now(), to_end: false },
            refused: false,
            stepper: Stepper {
                step: Step::new(nx),
                step_sets: field.subs.iter().map(|s| Vec::with_capacity(s.cells.len())).collect(),
                step_implicit: false,
                dense_ready: false,
                radau: Radau::new(&field, most)?,
                pair,
                next_pair: pair,
                usual_pair: pair,
                cut: Cut::default(),
                tried: 0.0,
                implicit: false,
                stiff: vec![Pace::Unknown; n_cells + 1],
                stiff_mode: false,
                stiff_slides: vec![false; field.subs.len()],
                stiff_steps: 0,
                stiffness: 0.0,
                damped: false,
                mild_steps: 0,
                weights: vec![0.0; nx],
                node: vec![0.0; nx],
                h: 0.0,
                given: 0.0,
                first_steps: vec![FirstStep::default(); n_cells],
                entered: None,
                err_before: 1e-4,
                coarse: 0.0,
                clear: 0.0,
                clears: false,
                alpha_start: Vec::with_capacity(most),
                alpha_end: Vec::with_capacity(most),
                fresh: true,
                timed: system.depends_on_time(),
                slid: 0,
            },
            foresight: Foresight::new(n_w, most),
            functions: EventFunctions {
                sampler: Sampler::new(),
                samples: vec![[0.0; NODES]; n_w],
                watches: Vec::with_capacity(n_w),
                looked: Vec::with_capacity(n_w),
                depart: vec![0; n_w],
                w0: vec![0.0; n_w],
                w1: vec![0.0; n_w],
                suspect: vec![false; n_w],
                suspects: Vec::with_capacity(n_w),
                zeros: Vec::new(),
                resting: vec![false; n_w],
                q0: vec![0.0; n_q],
                q1: vec![0.0; n_q],
                dq0: vec![0.0; n_dq],
                dq1: vec![0.0; n_dq],
                zero: vec![false; n_q],
                touched: None,
                grazed: f64::INFINITY,
                flat: None,
                levels: vec![0.0; n_q],
                reached: vec![0.0; n_q],
            },
            calendar: Calendar {
                within_steps: false,
                // algebraic states follow the others in whole steps
                units: UnitEvents::new(&field, &system.discrete_states())
                    .filter(|_| elimination.is_none())
                    .map(Box::new),
                worth: Worth::default(),
                shrinking: Shrinking::default(),
                limits: (f64::NEG_INFINITY, 0),
                recent: Recent::new(n_q, n_cells, field.floor.clone()),
                behind: false,
                passages: 0,
                passage_work: 0.0,
                passage: (f64::NEG_INFINITY, f64::NEG_INFINITY),
                window: Window::default(),
                crowd: 0,
            },
            contact_events: ContactEvents {
                wanted: vec![false; field.active.len()],
                scene: SceneRoom::default(),
                passes_bounds: false,
                burst: (f64::NEG_INFINITY, 0),
                phases: Vec::new(),
            },
            log: Log {
                heard: 0,
                outcome: Outcome::Reached,
                reason: String::new(),
                stopped_by: None,
                switches: Vec::new(),
                jumps: Vec::new(),
                notes: Vec::new(),
                impacts: Vec::new(),
                branchings: Vec::new(),
                contacts: Vec::new(),
                accumulations: Vec::new(),
                stats: Statistics::default(),
                path: options.dense.then(|| Path::new(n_shown, options.dense_steps)),
                sampled: Sampled::default(),
                one_sided: false,
                ambiguous: false,
            },
            derivatives: Derivatives {
                sens,
                tape: options.adjoint.then(Tape::default),
                reset: Reset::new(nx, n_z),
                time_row: vec![0.0; n_z],
                powers: std::array::from_fn(|_| vec![0.0; nx]),
                nonzero: Vec::new(),
                variational: (f64::INFINITY, 0),
                held_back: 0,
            },
            field,
            options,
        })
    }

    /// Makes room for what any mode needs: from here on a run of a system without contacts and transitions allocates nothing, as long as rates leave no doubt about
    /// its modes and no rule selects their weights, but for its log.
    pub(crate) fn reserve(&mut self) {
        self.field.reserve();
        let cells: Vec<usize> = self.field.subs.iter().map(|s| s.cells.len()).collect();
        self.apart.reserve(&cells, self.nx);
        let sets = || cells.iter().map(|c| Vec::with_capacity(*c));
        (self.before, self.candidates) = (sets().collect(), sets().collect());
        self.functions.zeros.reserve(self.functions.w0.len());
        self.derivatives.nonzero.reserve(self.nx * self.nx);
        self.set.reserve(cells.iter().copied().max().unwrap_or(0));
        if let Some(s) = &mut self.derivatives.sens {
            s.reserve();
        }
    }

    /// The same for those that look at steps one by one: a step of all states ends at every event, and all of them are known there.
    ///
    /// # Errors
    /// Those of [`Engine::new`].
    pub(crate) fn stopping_for_all(system: &System, options: &Options) -> Result<Engine> {
        let mut engine = Engine::new(system, options)?;
        engine.calendar.units = None;
        Ok(engine)
    }

    /// Goes on beyond the bounds that contacts of a scene were left out for: of a motion that is only a guess nothing but that it is close to one within
    /// them is wanted.
    pub(crate) fn pass_bounds(&mut self) {
        self.contact_events.passes_bounds = true;
    }

    /// The next run begins with a step of this length, not of one that the state asks for: what came before it is the same motion.
    pub(crate) fn begin_with_step(&mut self, h: f64) {
        self.stepper.given = h;
    }

    /// How long the next step would be; zero where that says nothing of a run that begins, since implicit steps were made.
    pub(crate) fn next_step(&self) -> f64 {
        if self.stepper.implicit || self.stepper.step_implicit {
            0.0
        } else {
            self.stepper.h
        }
    }

    /// Sets time and state and clears log, statistics and dense output.
    pub fn reinit(&mut self, t: f64, x: &[f64]) -> Result<()> {
        finite("time", &[t], 1)?;
        let n_shown = self.n_shown();
        finite("state", x, n_shown)?;
        (self.t, self.t_start) = (t, t);
        self.x[..n_shown].copy_from_slice(x);
        self.x[n_shown..].fill(0.0);
        for a in &mut self.field.active {
            a.clear();
        }
        (self.restart, self.unmade) = (true, false);
        (self.stepper.h, self.stepper.given) = (0.0, 0.0);
        self.stepper.first_steps.fill(FirstStep::default());
        self.stepper.entered = None;
        self.foresight.reset();
        if let Some(c) = &mut self.calendar.units {
            c.reset();
            self.calendar.worth = Worth::default();
        }
        self.stepper.stiff.fill(Pace::Unknown);
        self.stepper.stiff_mode = false;
        self.stepper.stiff_slides.fill(false);
        (self.stepper.next_pair, self.stepper.cut) = (self.stepper.usual_pair, Cut::default());
        self.keeps = false;
        self.calendar.recent.forget();
        self.calendar.recent.series = Default::default();
        self.calendar.recent.falling = Default::default();
        self.set_sizes(1.0);
        self.calendar.shrinking = Shrinking::default();
        self.calendar.limits = (f64::NEG_INFINITY, 0);
        self.calendar.recent.last = t;
        self.field.guards.reset(&self.x);
        self.known_times.1 = 0;
        if let Some(n) = &mut self.notes {
            n.reset();
        }
        if let Some(a) = &mut self.algebraic {
            a.reset();
        }
        self.functions.levels.fill(0.0);
        self.functions.reached.fill(0.0);
        self.calendar.crowd = 0;
        self.contact_events.burst = (f64::NEG_INFINITY, 0);
        self.contact_events.scene.forget();
        self.derivatives.variational = (f64::INFINITY, 0);
        self.derivatives.held_back = 0;
        (self.stepper.stiffness, self.stepper.damped, self.stepper.stiff_steps, self.stepper.mild_steps) =
            (0.0, false, 0, 0);
        (self.stepper.tried, self.stepper.coarse, self.stepper.clear) = (0.0, 0.0, 0.0);
        self.calendar.behind = false;
        self.calendar.passages = 0;
        self.calendar.passage_work = 0.0;
        self.calendar.passage = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        self.functions.touched = None;
        self.log.outcome = Outcome::Reached;
        self.log.reason.clear();
        self.log.stopped_by = None;
        self.log.switches.clear();
        self.log.jumps.clear();
        self.log.notes.clear();
        self.log.impacts.clear();
        self.contact_events.phases.clear();
        self.log.branchings.clear();
        self.log.contacts.clear();
        self.log.accumulations.clear();
        self.log.stats = Statistics::default();
        self.calendar.window = Window { t, ..Window::default() };
        self.field.counts = Default::default();
        self.stepper.radau.newton = 0;
        self.stepper.radau.factorisations = 0;
        self.stepper.dense_ready = false;
        self.stepper.step.h = 0.0;
        self.log.sampled = Sampled::default();
        if let Some(p) = &mut self.log.path {
            p.clear();
        }
        if let Some(s) = &mut self.derivatives.sens {
            s.reset();
        }
        if let Some(tape) = &mut self.derivatives.tape {
            tape.reset(t, &self.field);
        }
        self.log.one_sided = false;
        self.log.ambiguous = false;
        Ok(())
    }
}

fn check_preferred(options: &Options, field: &Field) -> Result<()> {
    let (n, n_sub) = (options.preferred.len(), field.active.len());
    if n != n_sub && (n > 0 || options.ambiguity == Ambiguity::Prefer) {
        return Err(Error::Dimension(format!(
            "preferred has {n} lists of modes: give one for each of the {n_sub} subsystems with more than one mode"
        )));
    }
    for (k, (list, s)) in options.preferred.iter().zip(&field.subs).enumerate() {
        if let Some(m) = list.iter().find(|m| !s.cells.iter().any(|c| c.mode == **m)) {
            return Err(Error::Range(format!("preferred holds {m} for subsystem {k}, which has no such mode")));
        }
    }
    Ok(())
}
