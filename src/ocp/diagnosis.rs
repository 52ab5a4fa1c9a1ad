//! Why a solve did not end as it should, in the words of the model: a function without a value, a constraint that cannot
//! be met, elements too few for the switches. Stages, elements, rows and states are counted from zero.

use std::fmt::Write as _;

use super::between::Along;
use super::extend::Slacks;
use super::request::Request;
use super::{Norm, Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::event;
use crate::fesd::{Fesd, Part, PathAt, Place, Role, RowMeaning, Trouble, VariableMeaning};
use crate::func::{Callback, EvalError, Point};
use crate::mpcc::{BStationarity, Mpcc, Polish};
use crate::nlp::{Bounds, Control, Nlp, Outcome};
use crate::settings::Discretisation;
use crate::sim::SolveOptions;
use crate::stop;
use crate::system::{combination, System};

/// Evaluations after which a failure of a function has nothing to do with the end of a solve any more.
const RECENT: usize = 30;
/// Switches of a simulation this close to the end of a stage, relative to its length, are at its end.
const AT_END: f64 = 1e-4;
/// Violations up to this, relative to the bound, are none.
const MET: f64 = 1e-6;
/// Constraints named at most.
const NAMED: usize = 4;

/// What a diagnosis looks at.
pub(super) struct Case<'a> {
    pub result: &'a OcpResult,
    pub problem: &'a mut Fesd,
    pub bounds: &'a Bounds,
    /// The point of the result.
    pub w: &'a [f64],
    /// The system as it was discretised.
    pub system: &'a System,
    /// Why the solve was cut, where it was.
    pub cut: Option<stop::Why>,
}

/// What a diagnosis says.
pub(super) struct Diagnosis {
    pub message: String,
    /// The outcome of the result, with what the diagnosis showed.
    pub outcome: Outcome,
    /// A function without a value is the reason.
    pub undefined: bool,
}

impl OcpResult {
    pub(super) fn take(&mut self, d: Diagnosis) {
        (self.message, self.outcome, self.undefined) = (d.message, d.outcome, d.undefined);
    }

    /// Says one thing more.
    pub(super) fn add_remark(&mut self, text: &str) {
        let more = if self.message.is_empty() { "" } else { "; " };
        self.message = format!("{}{more}{text}", self.message);
    }
}

/// What the problem with relaxed constraints showed of the problem itself.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shown {
    Nothing,
    /// The violation of the constraints has a local minimum, and it is not zero.
    Infeasible,
    /// A point that meets them.
    Feasible,
}

impl Ocp {
    /// Tells of controls that were given, where these cost less than the answer in a simulation and meet the constraints as well: no program along
    /// their modes led to an answer then.
    pub(super) fn tell_cheaper_guess(&mut self) -> Result<()> {
        let (Some(u), Some(b), Some(r)) = (&self.u_guess, &self.built, &self.result) else { return Ok(()) };
        if stop::requested().is_some() || !r.is_solution() {
            return Ok(());
        }
        let lower = match self.first_lower(b, r, vec![[u.clone(), u.clone()]]) {
            // the answer is there, and the remark is not worth it
            Err(Error::Interrupted | Error::OutOfTime) => None,
            found => found?,
        };
        if let (Some((_, cost)), Some(r)) = (lower, self.result.as_mut()) {
            r.add_remark(&format!(
                "the controls of the guess cost {cost:.6e} in a simulation, less than this answer, and meet the constraints as well; \
                 no answer with their modes was found: more elements or another grid may have one"
            ));
        }
        Ok(())
    }

    /// Why the result is no exact solution, and what the comparison with the simulation says of one; empty where there is
    /// nothing to say, and where the solve was asked to stop.
    pub(super) fn diagnose(&mut self, case: &mut Case, request: &Request, control: &Control) -> Diagnosis {
        let r = case.result;
        let mut d = Diagnosis { message: String::new(), outcome: r.outcome, undefined: false };
        if r.outcome == Outcome::Stopped {
            return d;
        }
        let crowded = self.crowded(r, case.problem);
        let inexact = r.outcome != Outcome::Solved || r.polish == Polish::Rejected;
        if inexact {
            let text = self.why_not(case, crowded.as_deref(), request, control, &mut d);
            d.message = text;
        }
        if let Some(remark) = self.remark(r, crowded.as_deref().filter(|_| !inexact)) {
            let more = if d.message.is_empty() { "" } else { "; " };
            d.message = format!("{}{more}{remark}", d.message);
        }
        if let Some(text) = self.violated_between(r) {
            let more = if d.message.is_empty() { "" } else { "; " };
            d.message = format!("{}{more}{text}", d.message);
        }
        d
    }

    /// That a constraint along the horizon is violated between the points at which it is imposed.
    pub(super) fn violated_between(&self, r: &OcpResult) -> Option<String> {
        let b = r.accuracy.as_ref().filter(|_| r.is_solution()).and_then(|a| a.violated())?;
        let what = match b.of {
            Along::Path(k) => format!("row {} of path constraint {k} ('{}')", b.row, self.path[k].f.name()),
            Along::State => format!("a bound of state {}", b.row),
        };
        Some(format!(
            "{what} is violated by {} at t = {} in stage {} of the simulation of the controls, so that nothing is certified: impose it at \
             \"stage_points\", or add stage points (n_s), elements (n_fe) or control stages",
            short(b.value),
            short(b.t),
            b.stage
        ))
    }

    /// Why there is no exact solution.
    fn why_not(
        &self,
        case: &mut Case,
        crowded: Option<&str>,
        request: &Request,
        control: &Control,
        d: &mut Diagnosis,
    ) -> String {
        let r = case.result;
        let failed = r.outcome == Outcome::Failed;
        let trouble = case.problem.trouble().map(|t| (without_value(&t, case.system, self.t0), t.age));
        if let Some((text, _)) = trouble.as_ref().filter(|t| failed || (r.outcome != Outcome::Solved && t.1 <= RECENT))
        {
            d.undefined = failed;
            return text.clone();
        }
        let mut parts: Vec<String> = limit(r.outcome, &request.options).into_iter().collect();
        let infeasible = matches!(r.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible | Outcome::Stalled);
        if let Some(text) = crowded {
            parts.push(text.into());
        } else if infeasible && request.explain {
            let (text, shown) = self.least_violation(r, case.problem, &request.options, control);
            parts.push(text);
            match shown {
                Shown::Infeasible => d.outcome = Outcome::Infeasible,
                Shown::Feasible => d.outcome = Outcome::Stalled,
                Shown::Nothing => {}
            }
        }
        if let Some(why) = case.cut.or(stop::requested()).filter(|_| r.outcome == Outcome::Solved) {
            parts.push(format!(
                "{} in the search for an exact solution: the answer is that of the relaxation",
                why.words()
            ));
        } else if r.outcome == Outcome::Solved && crowded.is_none() {
            parts.push(
                "the order of modes that was identified has no exact solution: the answer is that of the relaxation; more \
                 elements may help"
                    .into(),
            );
        }
        if !failed && r.outcome != Outcome::Solved && (parts.is_empty() || !infeasible) {
            parts.extend(worst(case));
        }
        parts.extend(trouble.map(|t| format!("on the way {}", t.0)));
        parts.join("; ")
    }

    /// The stage whose elements cannot have the switches of the simulated controls, if there is one.
    fn crowded(&self, r: &OcpResult, problem: &Fesd) -> Option<String> {
        r.accuracy.as_ref()?;
        let engine = self.engine.as_ref().filter(|_| problem.detects_switches())?;
        let mut start = self.t0;
        for (stage, (&length, &n_fe)) in r.durations.iter().zip(&problem.spec().n_fe).enumerate() {
            let inside = |t: f64| t > start + AT_END * length && t < start + (1.0 - AT_END) * length;
            let mut times: Vec<f64> = engine.switch_times().into_iter().filter(|t| inside(*t)).collect();
            times.dedup_by(|a, b| (*a - *b).abs() <= AT_END * length);
            if times.len() >= n_fe {
                let elements = r.trajectory.elements.iter().filter(|e| e.stage == stage);
                let within = |t: f64, h: f64| times.iter().filter(|s| **s >= t && **s <= t + h).count();
                let counts: Vec<usize> = elements.map(|e| within(e.t, e.h)).collect();
                let element = (0..counts.len()).max_by_key(|&e| (counts[e], usize::MAX - e))?;
                let many = |n: usize| if n == 1 { "1 switch".to_owned() } else { format!("{n} switches") };
                let list: Vec<String> = times.iter().take(NAMED).map(|t| short(*t)).collect();
                return Some(format!(
                    "stage {stage}, element {element}: {}, add elements: the simulation of the controls has {} in the \
                     stage (t = {}{}), and {} of the stage can have {} between them",
                    many(counts[element]),
                    many(times.len()),
                    list.join(", "),
                    if times.len() > NAMED { ", ..." } else { "" },
                    if n_fe == 1 { "the one element".to_owned() } else { format!("the {n_fe} elements") },
                    n_fe - 1,
                ));
            }
            start += length;
        }
        None
    }

    /// By how much the constraints are violated at best: the problem without cost, each constraint relaxed.
    fn least_violation(
        &self,
        r: &OcpResult,
        problem: &Fesd,
        options: &SolveOptions,
        control: &Control,
    ) -> (String, Shown) {
        let mut options = *options;
        options.solver.certify = true;
        let mut soft = self.blank();
        soft.n_fe.clone_from(&problem.spec().n_fe);
        (soft.lagrange, soft.mayer) = (None, None);
        for list in [&mut soft.path as &mut dyn Clear, &mut soft.terminal, &mut soft.boundary, &mut soft.squares] {
            list.empty();
        }
        soft.soft.clear();
        let mut names: Vec<(&str, String, Vec<f64>)> = Vec::new();
        let mut ok = true;
        let mut add = |o: &mut Ocp, what: &'static str, f, lower: &[f64], upper: &[f64], at, name: String| {
            ok &= o.add_relaxed(f, lower, upper, at, Norm::L1, 1.0).is_ok();
            let size =
                |(l, u): (&f64, &f64)| [l, u].into_iter().filter(|b| b.is_finite()).fold(1f64, |m, b| m.max(b.abs()));
            names.push((what, name, lower.iter().zip(upper).map(size).collect()));
        };
        for (k, c) in self.path.iter().enumerate() {
            let name = format!("path constraint {k} ('{}')", c.f.name());
            add(&mut soft, "row", c.f.clone(), &c.lower, &c.upper, Some(c.at), name);
        }
        for (k, c) in self.terminal.iter().enumerate() {
            let name = format!("terminal constraint {k} ('{}')", c.f.name());
            add(&mut soft, "row", c.f.clone(), &c.lower, &c.upper, None, name);
        }
        let d = self.system.dims();
        if self.x_bounds[0].iter().chain(&self.x_bounds[1]).any(|b| b.is_finite()) {
            let f = combination("x", d, (0..d.x).map(|i| vec![(i, 1.0)]).collect());
            let [lower, upper] = &self.x_bounds;
            add(&mut soft, "state", f, lower, upper, Some(PathAt::StagePoints), "the bound of".into());
            soft.x_bounds = [vec![f64::NEG_INFINITY; d.x], vec![f64::INFINITY; d.x]];
        }
        // from where the solve ended; what is not finite is refused, and the guess stays as it was
        let _ = soft.set_u_guess(&r.controls);
        let elements = || r.trajectory.elements.iter().filter(|e| e.h > 0.0);
        let times: Vec<f64> = elements().map(|e| e.t - self.t0).collect();
        let x: Vec<f64> = elements().flat_map(|e| e.x0.iter().copied()).collect();
        let _ = soft.set_x_guess(&times, &x);
        let mut inner = control.quiet();
        let solved = ok
            && soft.solve_inside(&options, &mut inner).is_ok()
            && soft.result.as_ref().is_some_and(|r| r.outcome == Outcome::Solved);
        if !solved && stop::requested().is_some() {
            let text = "there was no time left to look for the constraint that cannot be met";
            return (text.into(), Shown::Nothing);
        }
        if !solved {
            return (nothing_found(r), Shown::Nothing);
        }
        let found = soft.slack_values();
        let mut all: Vec<(f64, String)> = Vec::new();
        let mut positive = false;
        for ((what, name, sizes), violations) in names.iter().zip(found) {
            for (row, stage, v) in violations {
                positive |= v > MET * sizes[row];
                let place = stage.map_or(String::new(), |k| format!(" in stage {k}"));
                all.push((v, format!("{name} {what} {row} cannot be met{place}: off by {} at best", short(v))));
            }
        }
        all.retain(|v| v.0 > MET);
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        if !all.is_empty() {
            let text = all.into_iter().take(NAMED).map(|v| v.1).collect::<Vec<_>>().join("; ");
            let shown = positive && soft.result.as_ref().is_some_and(is_minimum);
            return (text, if shown { Shown::Infeasible } else { Shown::Nothing });
        }
        if let Some(c) = self.boundary.first() {
            let text =
                format!("the constraint '{}' between both ends contradicts the others, which can be met", c.f.name());
            return (text, Shown::Nothing);
        }
        ("a point that meets all constraints exists: start from other controls".into(), Shown::Feasible)
    }

    /// What the comparison with the simulation says, where it is worth a word; elements that are too few are named before all else.
    fn remark(&self, r: &OcpResult, crowded: Option<&str>) -> Option<String> {
        let a = r.accuracy.as_ref().filter(|_| r.outcome == Outcome::Solved)?;
        if !a.reached() {
            let stage = a.stages.iter().position(|s| s.is_nan()).unwrap_or(0);
            return Some(match a.outcome {
                None => format!(
                    "{} in the comparison with the simulation of the controls, stage {stage}: the accuracy is not known",
                    a.reason
                ),
                Some(end) => format!(
                    "the accuracy is not known: the simulation of the controls ends in stage {stage} ({}); {}",
                    a.reason,
                    after(end)
                ),
            });
        }
        if a.cost.is_nan() || a.terminal_violation.is_nan() {
            return Some(
                "the cost of the simulation is not known: a cost or a constraint at the end of a stage has no value at the \
                 state that was simulated; keep away from the border of its domain"
                    .into(),
            );
        }
        let help = crowded.unwrap_or_else(|| self.what_helps());
        let Some(d) = a.apart else {
            if !a.costs_otherwise(self.cost_size(r.priced)) {
                return crowded.map(str::to_owned);
            }
            let (simulated, own) = (short(a.cost), short(r.cost_reached));
            return Some(format!(
                "the simulation of the controls costs {simulated} and not {own}: nothing is certified; {help}"
            ));
        };
        let (n, own) = (a.n_switches, r.trajectory.switches.len());
        let switches = if n == own { String::new() } else { format!(", which switches {n} times and not {own} times") };
        Some(format!(
            "state {} is off by {} at the end of stage {} (its size is {}) in the simulation of the controls{switches}, so that nothing is \
             certified: {}",
            d.state,
            short(d.value),
            d.stage,
            short(d.size),
            help
        ))
    }

    /// What brings an answer closer to its simulation.
    fn what_helps(&self) -> &'static str {
        let switches = !self.system.subsystems().is_empty();
        if switches && self.settings.discretisation == Discretisation::Standard as i64 {
            "fixed steps do not find switches: set discretisation to fesd, or take many more elements (n_fe)"
        } else if self.settings.adapt_tol > 0.0 {
            "raise adapt_rounds and adapt_elements, or n_s; of an unstable system simulate shorter horizons"
        } else {
            "set adapt_tol, or more stage points (n_s) or elements (n_fe); of an unstable system simulate shorter horizons"
        }
    }

    /// Of every relaxed constraint the slacks of the last solution: row, stage where it is in one, value.
    fn slack_values(&self) -> Vec<Vec<(usize, Option<usize>, f64)>> {
        let Some(b) = &self.built else { return Vec::new() };
        let w = &b.solver.solution().x;
        let (controls, params) = (b.problem.controls(w), b.problem.params_at(w));
        let wide = b.extended.system.dims().u.max(1);
        let of = |at: &Slacks| -> Vec<(usize, Option<usize>, f64)> {
            match at {
                Slacks::Params(p) => params[p.clone()].iter().enumerate().map(|(i, v)| (i, None, *v)).collect(),
                Slacks::Controls(c) => {
                    let worst = |i: usize| {
                        let values = controls.chunks_exact(wide).map(|u| u[c.start + i]).enumerate();
                        values.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, v)| (i, Some(k), v))
                    };
                    (0..c.len()).filter_map(worst).collect()
                }
            }
        };
        b.extended.slacks.iter().map(of).collect()
    }
}

/// Is a solution of the problem with relaxed constraints a local minimum of their violation?
fn is_minimum(r: &OcpResult) -> bool {
    let smooth = r.dimensions.2 == 0;
    r.outcome == Outcome::Solved && (smooth || (r.polish == Polish::Done && r.certificate.b == BStationarity::Yes))
}

/// What to do where the simulation of the controls ended early.
fn after(end: event::Outcome) -> &'static str {
    use event::Outcome as E;
    match end {
        E::MaxSteps => "raise accuracy_tol",
        E::StepTooSmall => "keep away by bounds from where the model has no value, or add elements (n_fe)",
        E::Zeno => "the switches accumulate there: start elsewhere, or model what is at rest as a mode of its own",
        E::Reached | E::Ambiguous | E::NoContinuation | E::Event => {
            "more stage points (n_s) or elements (n_fe) bring the answer closer to the system, so does adapt_tol"
        }
    }
}

/// Lists of different kinds.
trait Clear {
    fn empty(&mut self);
}

impl<T> Clear for Vec<T> {
    fn empty(&mut self) {
        self.clear();
    }
}

/// What is said where the problem with all constraints relaxed has no answer either. Controls that are simulated to the end show that the
/// dynamics are not what stands in the way.
fn nothing_found(r: &OcpResult) -> String {
    let simulated = r.accuracy.as_ref().filter(|a| a.reached() && a.terminal_violation.is_finite());
    match simulated {
        Some(a) => format!(
            "no point that meets all constraints was found; the dynamics have solutions: the controls at hand are simulated to the \
             end of the horizon, where terminal constraints are off by {} at most: start from other controls, add elements, or \
             move an end that lies on a switching surface off it",
            short(a.terminal_violation)
        ),
        None => "no feasible point was found, not even for the dynamics alone with the bounds of controls and initial state: \
                 look at the model, or add elements"
            .into(),
    }
}

/// What ended a solve from outside, or numerically.
fn limit(outcome: Outcome, s: &SolveOptions) -> Option<String> {
    match outcome {
        Outcome::MaxIter => Some(format!("max_iter = {} iterations are not enough", s.solver.max_iter)),
        Outcome::MaxTime => Some(format!("max_time = {} seconds are not enough", s.max_time)),
        Outcome::Diverging => Some("the variables grow without bound: give bounds to controls and states".into()),
        Outcome::Failed => Some("the linear systems cannot be solved: check scaling and derivatives".into()),
        _ => None,
    }
}

/// The row or bound that is violated most, where that is worth a word.
fn worst(case: &mut Case) -> Option<String> {
    let (n, m) = (case.problem.n(), case.problem.m());
    let mut c = vec![0.0; m];
    case.problem.set_polishing(true);
    let evaluated = case.problem.eval(case.w, &mut c);
    case.problem.set_polishing(false);
    evaluated.ok()?;
    let b = case.bounds;
    let outside = |v: f64, l: f64, u: f64| (l - v).max(v - u);
    let rows = (0..m).map(|i| (outside(c[i], b.cl[i], b.cu[i]), true, i));
    let variables = (0..n).map(|j| (outside(case.w[j], b.xl[j], b.xu[j]), false, j));
    let (v, is_row, k) = rows.chain(variables).max_by(|a, b| a.0.total_cmp(&b.0))?;
    if v.is_nan() || v <= MET {
        return None;
    }
    let what = if is_row {
        row_name(case.problem, case.problem.row_meanings()[k])
    } else {
        variable_name(case.problem.variable_meanings()[k])
    };
    Some(format!("the largest violation that is left is {} in {what}", short(v)))
}

fn row_name(problem: &Fesd, row: RowMeaning) -> String {
    let spec = problem.spec();
    match row {
        RowMeaning::Dynamics(at, r) => format!("the dynamics of state {r}, {}", place(at)),
        RowMeaning::Complementarity(at) => format!("the equations of weights and multipliers, {}", place(at)),
        RowMeaning::Grid(at) => format!("the lengths of the elements, stage {}", at.stage),
        RowMeaning::Path(at, k, r) => {
            format!("path constraint {k} ('{}') row {r}, {}", spec.path[k].f.name(), place(at))
        }
        RowMeaning::Terminal(k, r) => format!("terminal constraint {k} ('{}') row {r}", spec.terminal[k].f.name()),
        RowMeaning::Pair(at, k, r) => {
            format!("complementarity {k} ('{}') output {r}, {}", spec.complementarity[k].f.name(), place(at))
        }
        RowMeaning::Boundary(k, r) => format!("boundary constraint {k} ('{}') row {r}", spec.boundary[k].f.name()),
    }
}

fn variable_name(variable: VariableMeaning) -> String {
    match variable {
        VariableMeaning::Initial(r) => format!("the bound of initial state {r}"),
        VariableMeaning::State(at, r) => format!("the bound of state {r}, {}", place(at)),
        VariableMeaning::Control(stage, j) => format!("the bound of control {j}, stage {stage}"),
        VariableMeaning::Param(j) => format!("the bound of parameter {j}"),
        VariableMeaning::Length(at) => {
            at.map_or_else(|| "the bound of the horizon".into(), |at| format!("the bound of a length, {}", place(at)))
        }
        VariableMeaning::Pair(at, k, r) => format!("the sign of complementarity {k} output {r}, {}", place(at)),
        VariableMeaning::Complementarity(at) => format!("the sign of a weight or multiplier, {}", place(at)),
    }
}

fn place(at: Place) -> String {
    match at.element {
        Some(e) => format!("stage {}, element {e}", at.stage),
        None => format!("start of stage {}", at.stage),
    }
}

/// Which function failed how, where, and what to do.
fn without_value(t: &Trouble, system: &System, t0: f64) -> String {
    let d = t.f.dims();
    let (x, rest) = t.inputs.split_at(d.x);
    let (u, rest) = rest.split_at(d.u);
    let at = Point { t: rest[d.p], x, u, p: &rest[..d.p] };
    let mut out = vec![0.0; t.f.n_out()];
    let mut work = vec![0.0; t.f.work_len()];
    let fails = |r: usize, out: &mut [f64], work: &mut [f64]| {
        t.f.value_rows(&at, r..r + 1, out, work).is_err() || !out[r].is_finite()
    };
    // the first output that has no value alone, or holds none where all fail together
    let failing: Vec<bool> = (0..t.f.n_out()).map(|r| fails(r, &mut out, &mut work)).collect();
    let alone = failing.iter().any(|f| !f);
    let row = failing.iter().position(|f| *f).filter(|_| alone).or_else(|| out.iter().position(|v| !v.is_finite()));
    let value = row.map_or(0.0, |r| out[r]);
    let name = t.f.name();
    let subsystem = system.subsystems().iter().position(|s| std::sync::Arc::ptr_eq(&s.modes, &t.f));
    let mut text = match t.role {
        Role::Smooth => format!("the smooth part '{name}' of the right-hand side"),
        Role::Modes => {
            let rows = subsystem.map(|k| system.subsystems()[k].rows.len().max(1));
            match (row, rows, subsystem) {
                (Some(r), Some(n), Some(k)) => format!("mode {} of subsystem {k} ('{name}')", r / n),
                (None, _, Some(k)) => format!("the modes of subsystem {k} ('{name}')"),
                _ => format!("the modes '{name}'"),
            }
        }
        Role::Inclusion => format!("the inclusion '{name}'"),
        Role::Regions => format!("the switching function '{name}'"),
        Role::Running => format!("the running cost '{name}'"),
        Role::Ending => format!("the cost '{name}' at the end of a stage"),
        Role::Path(k) => format!("path constraint {k} ('{name}')"),
        Role::Terminal(k) => format!("terminal constraint {k} ('{name}')"),
        Role::Boundary(k) => format!("boundary constraint {k} ('{name}')"),
        Role::Pair(k) => format!("complementarity {k} ('{name}')"),
    };
    text += match t.part {
        Part::Value => "",
        Part::Jacobian => ", Jacobian,",
        Part::Hessian => ", Hessian,",
    };
    text += &match t.error {
        EvalError::Fatal(Callback::PANIC_CODE) => " panicked".into(),
        EvalError::Fatal(code) => format!(" returned the code {code}"),
        EvalError::Recoverable if t.part == Part::Value && value.is_nan() => " returned NaN".into(),
        EvalError::Recoverable if t.part == Part::Value && value.is_infinite() => " returned an infinity".into(),
        EvalError::Recoverable => " is not defined".to_owned(),
        EvalError::Stopped => " was not asked any more".to_owned(),
    };
    let n_user = system.dims().x.min(d.x);
    let _ = write!(text, " in {} at t = {}, x = ({})", place(t.place), short(t0 + t.t), list(&x[..n_user]));
    if !u.is_empty() {
        let _ = write!(text, ", u = ({})", list(u));
    }
    text + ": start elsewhere, or keep away from there by bounds"
}

fn list(v: &[f64]) -> String {
    let mut text: Vec<String> = v.iter().take(2 * NAMED).map(|v| short(*v)).collect();
    if v.len() > text.len() {
        text.push("...".into());
    }
    text.join(", ")
}

/// A number as one says it: four digits.
fn short(v: f64) -> String {
    let a = v.abs();
    if v == 0.0 || (1e-3..1e5).contains(&a) {
        let digits = if a >= 1.0 { 3 - a.log10().floor().min(3.0) as usize } else { 4 };
        format!("{v:.digits$}")
    } else {
        format!("{v:.3e}")
    }
}
