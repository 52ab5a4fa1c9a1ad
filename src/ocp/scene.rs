//! Optimal control of scenes: the problem as it was stated becomes one with contacts and jumps, its answer one like any other.

use super::accuracy::{Accuracy, ELSEWHERE};
use super::extend::Extended;
use super::optimality::{Kink, Optimality, OTHER};
use super::request::Request;
use super::simulated::Landed;
use super::solve::{bounded, Start};
use super::{Jumps, Ocp, OcpResult, OcpSensitivity, SLACK};
use crate::error::{Error, Result};
use crate::func::Point;
use crate::jumps::{
    self, Aim, Answer, Blame, Contacts, Findings, Found, Key, Lead, Missed, Of, Options, Problem, Sequence, Solved,
};
use crate::memory;
use crate::mpcc::Polish;
use crate::nlp::middle;
use crate::nlp::{Control, Outcome, Statistics};
use crate::stop;
use crate::tableau::Tableau;

/// How contact modes are found, and what is known of them.
#[derive(Default)]
pub(super) struct SceneControl {
    method: Jumps,
    /// Modes to start from.
    sequence: Option<Sequence>,
    /// The last answer, and what it was found with.
    last: Option<Last>,
}

struct Last {
    answer: Answer,
    problem: Problem,
    solved: Solved,
}

impl SceneControl {
    /// How contact modes are found.
    pub(super) fn method(&self) -> Jumps {
        self.method
    }

    /// Are modes and jumps given to start from?
    pub(super) fn gives_sequence(&self) -> bool {
        self.sequence.is_some()
    }

    /// The same without answers.
    pub(super) fn blank(&self) -> SceneControl {
        SceneControl { method: self.method, sequence: self.sequence.clone(), last: None }
    }
}

/// Elements of a control stage in FESD with jumps.
const ELEMENTS: usize = 2;

impl Ocp {
    /// Sets how the contact modes of a scene are found.
    pub fn set_jumps(&mut self, method: Jumps) {
        self.scene.method = method;
    }

    /// Gives modes and jumps of a scene to start from, or takes them back.
    pub fn set_contact_sequence(&mut self, sequence: Option<Sequence>) {
        self.scene.sequence = sequence;
    }

    /// Solves a problem with contacts.
    pub(super) fn solve_scene(&mut self, start: Start, control: &mut Control) -> Result<&OcpResult> {
        self.system.check_without_choices("optimal control with contacts")?;
        let request = Request::from_settings(&self.settings)?;
        self.complete_params()?;
        self.simulated.last = None;
        let led = std::mem::take(&mut self.simulated.leads) && start == Start::Warm;
        memory::bounded(self.settings.max_memory, || {
            bounded(&request, control, |control| match led {
                true => self.solve_simulated(start, &request, control),
                false => self.run_scene(start, &request, control),
            })
        })?;
        self.conclude()
    }

    /// From the modes of an answer of before, where these have a solution; else descents on simulations say which orders of contacts there are, and programs
    /// along these are exact and say what is next to them.
    fn run_scene(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<()> {
        let clock = std::time::Instant::now();
        let extended = self.extended()?;
        let problem = self.scene_problem(&extended, request)?;
        self.check_start(&problem)?;
        let options = self.scene_options(&problem, &extended, request);
        let time_build = clock.elapsed().as_secs_f64();
        let mut spent = Statistics::default();
        let known = match self.scene.last.as_ref().filter(|_| start == Start::Warm) {
            Some(last) => jumps::go_on_from(&last.answer, &problem, &options, control)?,
            None => None,
        };
        let mut landed = match (known.is_none() && options.sequence.is_none(), options.method) {
            (true, Jumps::Auto | Jumps::Shots) => self.landed(None, request, &mut spent, control)?,
            _ => None,
        };
        if let Some(cut) = landed.take_if(|l| l.result.ended.is_some()) {
            self.adopt_end(cut);
            return Ok(());
        }
        let (problem, options) = match &landed {
            Some(l) => self.led_by(&l.result, problem, options),
            None => (problem, options),
        };
        let incumbent = landed.as_ref().map_or(f64::INFINITY, |l| l.result.priced);
        let given = (&options, &extended, request);
        let found = control.with_incumbent(incumbent, |control| {
            let found = match known {
                Some(found) => found,
                None => jumps::solve(&problem, &options, control)?,
            };
            self.best_of_orders(&problem, found, given, control)
        });
        match (found, landed) {
            // what is known stays known
            (Err(Error::Interrupted | Error::OutOfTime), Some(landed)) => self.adopt_end(landed),
            (found, landed) => {
                let (last, result) = found?;
                spent.add(&result.stats);
                let is_followed = result.is_exact() && result.ended.is_none();
                let lower = match (is_followed, landed) {
                    (true, Some(landed)) => self.lower_than(&result, Some(landed), request, &mut spent, control)?,
                    (_, landed) => landed,
                };
                match lower {
                    Some(landed) => self.adopt_end(landed),
                    None => {
                        if last.answer.is_solved() {
                            self.scene.last = Some(last);
                        }
                        self.result = Some(result);
                    }
                }
            }
        }
        if let Some(r) = self.result.as_mut() {
            r.time_build = time_build;
            r.stats = Statistics { time_total: clock.elapsed().as_secs_f64() - time_build, ..spent };
            stop::requested().into_iter().for_each(|why| r.tell_cut(why));
        }
        Ok(())
    }

    /// Makes the end of descents the answer; no program is its own.
    fn adopt_end(&mut self, landed: Landed) {
        self.scene.last = None;
        self.adopt_landed(landed);
    }

    /// A problem and what a search starts from, at an answer of descents on simulations.
    fn led_by(&self, r: &OcpResult, problem: Problem, mut options: Options) -> (Problem, Options) {
        let (own, wide) = (self.system.dims().u.max(1), problem.given().wide.u.max(1));
        for (all, known) in options.controls.chunks_mut(wide).zip(r.controls.chunks(own)) {
            all[..own].copy_from_slice(known);
        }
        if let Some(first) = r.trajectory.elements.first() {
            options.x0.clone_from(&first.x0);
        }
        options.lead = Lead::Descents { optimum: r.is_optimum(), size: self.cost_size(r.priced) };
        let params: Vec<(usize, f64)> = r.params.iter().copied().enumerate().collect();
        (problem.restated_at(r.durations.clone(), &params), options)
    }

    /// Of what a search found the cheapest answer that is a motion, with its result.
    fn best_of_orders(
        &self,
        problem: &Problem,
        Findings { best, others }: Findings,
        given: (&Options, &Extended, &Request),
        control: &mut Control,
    ) -> Result<(Last, OcpResult)> {
        let mut visited = Vec::new();
        let (mut last, mut result, mut followed) =
            self.compared(problem.of(&best.0), best, given, &mut visited, control)?;
        if last.answer.is_solved() {
            // what is dearer may be a motion that there is
            for mut other in others {
                if followed || stop::requested().is_some() {
                    break;
                }
                (other.0.stats, other.0.tried) = (last.answer.stats, last.answer.tried);
                let next = self.compared(problem.of(&other.0), other, given, &mut visited, control)?;
                if next.2 {
                    (last, result, followed) = next;
                } else {
                    (last.answer.stats, last.answer.tried) = (next.0.answer.stats, next.0.answer.tried);
                    result.stats = last.answer.stats;
                }
            }
            let known = self.scene_optimality(&last.answer, followed);
            result.optimality = Some(self.or_by_descent(known, &result));
        } else {
            if let Some(paradox) = last.answer.paradox {
                let what = no_forces(&last.problem, paradox.contact, paradox.t);
                let whose = if paradox.of_guess { "guessed controls" } else { "controls of the closest try" };
                result.message = format!("under the {whose} {what}; {}", result.message);
            }
            if let (Jumps::FesdJ, Some(more)) = (self.scene.method, too_few(&last.answer.changes)) {
                result.message.push_str(&more);
            }
        }
        Ok((last, result))
    }

    /// An answer, refined where its simulation leaves it, with its result, and whether it is a motion of the control problem; `visited` are the orders of
    /// contacts that answers have been refined through.
    fn compared(
        &self,
        problem: Problem,
        (answer, solved): Found,
        (options, extended, request): (&Options, &Extended, &Request),
        visited: &mut Vec<Key>,
        control: &mut Control,
    ) -> Result<(Last, OcpResult, bool)> {
        let mut last = Last { answer, problem, solved };
        let mut result = self.replayed(&last, extended, request)?;
        result.message = self.scene_message(&last.problem, &last.answer);
        let compares = request.comparison.filter(|_| last.answer.is_solved() && !is_its_motion(&last, &result));
        let Some(c) = compares else { return Ok((last, result, true)) };
        let largest = largest_state(&last.problem, &last.answer);
        let aim = Aim { within: AIM * largest, tol: c.tol };
        let finer = jumps::refine(last.problem, (last.answer, last.solved), options, aim, visited, control)?;
        last = Last { answer: finer.answer, problem: finer.problem, solved: finer.solved };
        result = self.replayed(&last, extended, request)?;
        let left = self.departure(&last, &result, finer.off);
        result.message = self.scene_message(&last.problem, &last.answer);
        if result.message.is_empty() {
            result.message = left.as_ref().map_or_else(String::new, |l| l.0.clone());
        }
        if finer.off > ELSEWHERE * largest_state(&last.problem, &last.answer) {
            result.ended = Some(Outcome::NotFollowed);
        }
        Ok((last, result, left.is_none_or(|l| l.1)))
    }

    /// How a simulation of the controls leaves a motion whose stages, simulated one by one, are off by as much as `off`: in words, and whether the
    /// answer is one of the control problem all the same; nothing where it does not leave it.
    fn departure(&self, last: &Last, result: &OcpResult, off: f64) -> Option<(String, bool)> {
        if is_its_motion(last, result) {
            return None;
        }
        let (p, a) = (&last.problem, &last.answer);
        if off <= OFF_IN_A_STAGE * largest_state(p, a) {
            return Some((unstable(off), true));
        }
        let met = jumps::met(p, &a.x0, a.controls(), &result.durations).ok();
        let text = match met.as_ref().and_then(|m| m.paradox) {
            Some((contact, t)) => format!("under its controls {}", no_forces(p, contact, t)),
            None => {
                let changes = met.map_or_else(Vec::new, |m| m.changes);
                not_followed(last, result, &changes)
            }
        };
        Some((text, false))
    }

    /// The result of an answer, with a simulation of its controls.
    fn replayed(&self, last: &Last, extended: &Extended, request: &Request) -> Result<OcpResult> {
        let Last { answer, problem, .. } = last;
        let mut result = self.scene_result(problem, extended, answer);
        if let (Some(c), true) = (request.comparison, answer.is_solved()) {
            result.accuracy = Some(self.replay(problem, answer, &result, c.tol)?);
        }
        Ok(result)
    }

    /// Derivatives of the last answer of a problem with contacts.
    pub(super) fn scene_sensitivity(&mut self) -> Result<OcpSensitivity> {
        let Some(last) = self.scene.last.as_mut() else {
            return Err(Error::State("there is no solution to differentiate: solve the problem first".into()));
        };
        let d = last.solved.derivatives(&last.problem)?;
        Ok(OcpSensitivity { cost: d.cost, controls: d.controls, variables: d.variables, one_sided: d.one_sided })
    }

    fn scene_problem(&self, e: &Extended, request: &Request) -> Result<Problem> {
        if self.linear.contains(&true) {
            return Err(Error::Unsupported(
                "controls of scenes are constant on every stage: make the rate a control, and the control a state of the scene \
                 beside coordinates and velocities"
                    .into(),
            ));
        }
        if !e.complementarity.is_empty() {
            return Err(Error::Unsupported(
                "complementarity conditions of your own are not possible beside contacts: write them as contacts"
                    .into(),
            ));
        }
        let o = &request.options;
        let d = self.system.dims();
        let wide = e.system.dims();
        let n_fe = self.elements(o);
        let tableau = Tableau::new(o.discretisation.family, o.discretisation.n_s)?;
        let mut free: Vec<Option<[f64; 2]>> = vec![None; wide.p];
        if let Some([lower, upper]) = &self.p_bounds {
            for (j, (l, u)) in lower.iter().zip(upper).enumerate().filter(|(_, (l, u))| l < u) {
                free[j] = Some([*l, *u]);
            }
        }
        free[e.slack_params.clone()].fill(Some([0.0, f64::INFINITY]));
        let more = wide.u - d.u;
        let slacks = |v: f64| vec![v; more];
        Problem::new(jumps::Statement {
            system: self.system.clone(),
            dims: d,
            wide,
            tableau,
            n_fe,
            durations: self.durations.clone(),
            time: self.time,
            time_bounds: self.time_bounds,
            t0: self.t0,
            lagrange: e.lagrange.clone(),
            mayer: e.mayer.clone(),
            grid_cost: e.grid_cost.clone(),
            path: e.path.clone(),
            terminal: e.terminal.clone(),
            boundary: e.boundary.clone(),
            x_bounds: self.x_bounds.clone(),
            x0_bounds: self.x0_bounds.clone(),
            u_bounds: [
                [&self.u_bounds[0][..], &slacks(0.0)].concat(),
                [&self.u_bounds[1][..], &slacks(f64::INFINITY)].concat(),
            ],
            params: self.extended_params(e),
            free,
            target: self.target(),
        })
    }

    /// The first state of the guess where there is one, the middle of the bounds elsewhere.
    pub(super) fn initial_guess_state(&self) -> Vec<f64> {
        let bounds = self.x0_bounds[0].iter().zip(&self.x0_bounds[1]);
        match &self.x_guess {
            Some((_, x)) => bounds.zip(x).map(|((l, u), x)| x.max(*l).min(*u)).collect(),
            None => bounds.map(|(l, u)| middle(*l, *u)).collect(),
        }
    }

    fn scene_options(&self, p: &Problem, e: &Extended, request: &Request) -> Options {
        let d = self.system.dims();
        let wide = e.system.dims();
        let own = self.control_guess();
        let mut controls = vec![SLACK; self.n_stages * wide.u];
        for k in 0..self.n_stages {
            controls[k * wide.u..k * wide.u + d.u].copy_from_slice(&own[k * d.u..(k + 1) * d.u]);
        }
        let o = &request.options;
        Options {
            method: self.scene.method,
            solver: o.solver,
            n_fe: ELEMENTS,
            rho_h: o.discretisation.rho_h,
            effort: self.settings.search_effort,
            gain: self.settings.search_gain,
            least_tried: request.search,
            has_costs: self.has_costs(),
            lead: Lead::Guess,
            controls,
            x0: self.initial_guess_state(),
            states: self.x_guess.clone(),
            sequence: self.scene.sequence.clone().filter(|s| s.stages.len() == p.n_stages()),
        }
    }

    /// A negative gap at a start that is given, in the words of the scene.
    fn check_start(&self, p: &Problem) -> Result<()> {
        let fixed = self.x0_bounds[0].iter().zip(&self.x0_bounds[1]).all(|(l, u)| l == u);
        if !fixed {
            return Ok(());
        }
        let x0 = &self.x0_bounds[0];
        let u = vec![0.0; self.system.dims().u];
        let at = Point { t: self.t0, x: x0, u: &u, p: self.params_of(0) };
        for ((name, gap), size) in p.gaps(&at).into_iter().zip(p.sizes_of_gaps(&at)) {
            if gap < -OVERLAP * size {
                return Err(Error::Range(format!(
                    "the gap of contact {name} is {gap} at the initial state: bodies may touch there, but not overlap"
                )));
            }
        }
        Ok(())
    }

    fn scene_result(&self, p: &Problem, e: &Extended, a: &Answer) -> OcpResult {
        let d = self.system.dims();
        let wide = e.system.dims().u;
        let all = a.controls();
        let controls: Vec<f64> = (0..self.n_stages).flat_map(|k| all[k * wide..k * wide + d.u].to_vec()).collect();
        let durations = a.durations(self.n_stages);
        let mut params = self.params_of(0).to_vec();
        let mut slack_params = vec![0.0; e.system.dims().p];
        for &(j, v) in &a.params {
            slack_params[j] = v;
            if let Some(p) = params.get_mut(j) {
                *p = v;
            }
        }
        let (violation, penalty) = self.relaxation(e, &slack_params, all, &durations);
        let cost = a.cost - penalty;
        let contacts = Contacts::new(p, a);
        OcpResult {
            outcome: a.outcome,
            polish: if a.is_solved() { Polish::Done } else { Polish::None },
            message: String::new(),
            cost: if a.is_solved() { cost } else { f64::NAN },
            cost_reached: cost,
            priced: a.cost,
            controls: controls.clone(),
            control_ends: controls,
            durations,
            params,
            violation,
            trajectory: jumps::trajectory(a),
            residuals: a.residuals,
            certificate: a.certificate,
            stats: a.stats,
            time_build: 0.0,
            dimensions: a.dimensions,
            accuracy: None,
            optimality: None,
            undefined: a.trouble.is_some(),
            ended: None,
            adaptation: None,
            jumps: Vec::new(),
            phases: contacts.active(self.same_time()),
            contacts: Some(contacts),
        }
    }

    /// Simulates the controls of an answer with contacts and compares the states at the ends of the stages.
    fn replay(&self, p: &Problem, a: &Answer, r: &OcpResult, tol: f64) -> Result<Accuracy> {
        let (n, nx) = (self.n_stages, self.system.dims().x);
        let run = match jumps::replay(p, a, &r.durations, tol) {
            Err(Error::Interrupted) => return Ok(Accuracy::stopped(n, nx, crate::stop::Why::Interrupted)),
            Err(Error::OutOfTime) => return Ok(Accuracy::stopped(n, nx, crate::stop::Why::OutOfTime)),
            r => r?,
        };
        let mut found = Accuracy::unknown(n, nx);
        found.outcome = Some(run.outcome);
        found.reason = run.reason;
        found.n_switches = run.events;
        for (k, d) in run.differences.iter().enumerate() {
            found.stages[k] = *d;
        }
        if run.differences.len() == n {
            found.terminal = run.differences[n - 1];
            found.x_end = run.x_end;
            found.cost = run.cost;
            found.cost_error = r.cost_reached - run.cost;
        }
        Ok(found)
    }

    /// What is known of a solution as a point of the control problem: that of its contact mode program is the optimum among the motions
    /// with its order of contacts, and where the motion leaves that order to no side it is one of the control problem. Elsewhere the
    /// orders on the other sides were solved for.
    fn scene_optimality(&self, a: &Answer, followed: bool) -> Optimality {
        let doubt = if !followed {
            Some(OTHER)
        } else if a.overlap {
            Some("bodies overlap between the points at which their gaps are held")
        } else if !a.vanishing.is_empty() {
            Some("a phase is as short as it may be")
        } else if !a.settled {
            Some("not every order of contacts next to it was tried")
        } else {
            None
        };
        let kinks = a.kinks.iter().map(|&(stage, t, touch)| Kink::without_derivatives(stage, t, touch)).collect();
        let compared = "the orders of contacts next to it were tried, and none is better";
        Optimality::of_one_order(doubt, compared, a.residuals.dual, a.gradient.clone(), kinks)
    }

    /// Why there is no exact answer.
    fn scene_message(&self, p: &Problem, a: &Answer) -> String {
        let names = p.contact_names();
        if let Some(f) = &a.trouble {
            return format!("function '{f}' has no value where one is needed");
        }
        let why = match a.blame {
            Some(Blame::InTheWay(c)) => {
                // without a contact its friction is gone as well
                let what = if p.has_friction(c) { " or its friction" } else { "" };
                format!("contact {}{what} is in the way: without it there would be a motion. ", names[c])
            }
            Some(Blame::Slippery(c)) => {
                format!("the friction of contact {} is too small: if it held there would be a motion. ", names[c])
            }
            None => String::new(),
        };
        let time = if a.outcome == Outcome::MaxTime { "the time (max_time) is over: " } else { "" };
        match a.outcome {
            Outcome::Solved if a.vanishing.is_empty() => String::new(),
            Outcome::Solved => {
                let (stage, _) = a.vanishing[0];
                format!(
                    "a phase of control stage {stage} is as short as it may be: the optimum has an event at the end of that \
                     stage, or one less"
                )
            }
            Outcome::Infeasible | Outcome::LocallyInfeasible | Outcome::Stalled | Outcome::MaxIter | Outcome::MaxTime => format!(
                "{time}{why}no motion was found that meets all constraints, after {} orders of contacts; the one closest to it violates \
                 them by {:.3e} of their sizes{}{}{}. Its contacts: {}",
                a.tried,
                a.violation,
                agreement(a.agreeing),
                a.broken.as_ref().map_or_else(String::new, |b| {
                    format!(", most in control stage {}, where it is a matter of the {}", b.stage, b.functions.join(", the "))
                }),
                a.missed.as_ref().map_or_else(String::new, missed_text),
                a.sequence.text(&names)
            ),
            _ => String::new(),
        }
    }
}

/// Share of the size of a gap by which it may be negative at the initial state: rounding.
const OVERLAP: f64 = 1e-9;
/// Share of the largest state of a motion by which its simulation may be off.
const OFF: f64 = 1e-2;
/// Share of the largest state of a motion by which the simulation of a single control stage may be off, where that of all of them is further off.
const OFF_IN_A_STAGE: f64 = 1e-4;
/// Share of the usual size of states below which the largest of a motion says nothing of their size.
const AT_REST: f64 = 1e-6;
/// Share that grids are refined for.
const AIM: f64 = 1e-6;

/// What is said of an answer that its simulation leaves, which has as many changes of contacts in every control stage: where that is, and what there is
/// of both.
fn not_followed(last: &Last, result: &OcpResult, changes: &[usize]) -> String {
    let largest = largest_state(&last.problem, &last.answer);
    let stages = result.accuracy.iter().flat_map(|a| &a.stages);
    let first = stages.enumerate().find(|(_, d)| d.is_nan() || **d > OFF * largest).map(|(k, _)| k);
    let place = first.and_then(|k| Some((k, *changes.get(k)?))).map_or_else(String::new, |(k, met)| {
        let own = last.answer.sequence.stages[k].len() - 1;
        let elements = last.problem.given().n_fe[k];
        format!(
            " in control stage {k}, where it has {met} contact changes and the answer {own} inside of the stage, on {elements} elements"
        )
    });
    format!(
        "a simulation of the controls leaves the motion of the answer{place}: more elements of a control stage, or more stages, follow its \
         contacts more accurately (see accuracy)"
    )
}

/// What is said where finite elements with a given number in a control stage have no room for the contact changes that a simulation has.
fn too_few(changes: &[usize]) -> Option<String> {
    let (stage, most) = changes.iter().enumerate().max_by_key(|c| (c.1, std::cmp::Reverse(c.0)))?;
    (*most >= ELEMENTS).then(|| {
        format!(
            "; a simulation of its controls has {most} contact changes in control stage {stage}, and this search has {ELEMENTS} elements in a \
             stage, with room for {}: more stages have more, and so has the default search",
            ELEMENTS - 1
        )
    })
}

/// What is said of an answer whose stages are followed one by one, but not in a row.
fn unstable(off: f64) -> String {
    format!(
        "the motion is unstable: a simulation of the controls from the initial state leaves it, while every control stage simulated \
         from the state of the answer at its start ends within {off:.1e} of the state of the answer at its end; to be followed, it \
         needs feedback"
    )
}

/// Whether starts of the search agree on the least violation there is.
fn agreement([close, all]: [usize; 2]) -> String {
    match (close, all) {
        (2.., _) => format!(" ({close} of {all} starts of the search come within a tenth of that)"),
        (_, 2..) => format!(" (of {all} starts of the search no two come within a tenth of that)"),
        _ => String::new(),
    }
}

/// What a simulation misses, in the unit of the user.
fn missed_text(m: &Missed) -> String {
    let what = match &m.of {
        Of::Function(name, i) => format!("output {i} of {name}"),
        Of::State(i) => format!("state {i}"),
    };
    format!("; in a simulation its controls miss the bounds of {what} by {:.4e}: it is {:.4e}", m.by, m.value)
}

/// That no forces continue a motion at a time, in words.
fn no_forces(p: &Problem, contact: usize, t: f64) -> String {
    format!(
        "no forces continue the motion at t = {t:.6}: friction and normal force of contact {} contradict each other there (Painlevé), and \
         sliding stops by an impact without collision, which no order of contacts of an answer has",
        p.contact_names()[contact]
    )
}

/// Largest modulus of a state of an answer, or [`AT_REST`] of what states of the problem usually have: the states of bodies that stay where
/// they are are rounding, and so is by how much a simulation differs from them.
fn largest_state(p: &Problem, a: &Answer) -> f64 {
    let nx = p.given().dims.x;
    let elements = jumps::trajectory(a).elements;
    let least = AT_REST * p.largest_size(&a.x0);
    elements.iter().flat_map(|e| &e.x1[..nx]).chain(&a.x0).fold(least, |m, v| m.max(v.abs()))
}

/// Is a simulation of the controls of an answer, where there is one, its motion, but for the error of the method? At the end of a stage at which
/// an event is, one of them may be before it and the other behind.
fn is_its_motion(last: &Last, result: &OcpResult) -> bool {
    let Some(simulated) = &result.accuracy else { return true };
    let largest = largest_state(&last.problem, &last.answer);
    let is_event = |k: usize| last.answer.kinks.iter().any(|&(stage, _, touch)| stage == k && !touch);
    let stages = simulated.stages.iter().enumerate();
    simulated.reached() && stages.filter(|(k, _)| !is_event(k + 1)).all(|(_, d)| *d <= OFF * largest)
}
