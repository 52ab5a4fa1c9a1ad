//! Nonlinear programs, with complementarity constraints or without.

use super::diagnosis::{swb_item, Names};
use super::function::{self, shared, shared_optional, swb_function, swb_point};
use super::guard::guard;
use super::handle::{self, running, setting, Interrupt, Object};
use super::log::swb_log_fn;
use super::mpcc_derivatives::changed;
use super::raw;
use super::report::{
    outcome_number, polished_number, swb_iteration_fn, swb_residuals, swb_stats, write_sized, Exclusive, Hooks,
};
use super::settings;
use super::status::swb_status;
use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::Arc;
use std::time::Instant;
use switchback::error::{Error, Result};
use switchback::func::{trouble, EvalError, Point};
use switchback::linalg::csc::Pattern;
use switchback::linalg::kkt::LinearStats;
use switchback::memory::{self, sizes};
use switchback::mpcc::diagnostics::{self, Item};
use switchback::mpcc::{Boxed, Lifted, Local, Member, Mpcc, MpccSettings, MpccSolver, NoProposals, Solution, Warm};
use switchback::nlp::{Bounds, CallbackNlp, LagrangianFn, Nlp, Outcome, Residuals};
use switchback::settings::{LogLevel, Settings, Value};
use switchback::system::SharedFunction;

/// Nonlinear program with complementarity constraints: minimise f(w,p) subject to bounds on w and c(w,p),
/// 0 <= G _|_ H >= 0 for pairs of variables or rows of c, and boxes lower <= w_i <= upper _|_ c_j. Without pairs and boxes, a
/// nonlinear program.
pub struct swb_mpcc(());
impl Object for swb_mpcc {
    type Value = Program;
    const NAME: &'static str = "swb_mpcc";
}

/// Kinds of members of complementarity pairs.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_member {
    /// A variable; its lower bound becomes zero.
    Variable = 0,
    /// A row of the constraints; its own bounds are not used.
    Constraint = 1,
}

pub(super) struct Built {
    pub problem: Lifted<CallbackNlp>,
    /// What it was made of: boxes are other pairs where other bounds are infinite.
    members: Vec<(Member, Member)>,
    pub solver: MpccSolver,
    jac: Arc<Pattern>,
}

/// What is known of the point besides the solution: in the variables and rows of the lifted problem.
struct Facts {
    c: Vec<f64>,
    grad: Vec<f64>,
    jac_values: Vec<f64>,
    bounds: Bounds,
    scaling: diagnostics::Factors,
}

/// What a solve was told.
struct Stated {
    bounds: Bounds,
    boxes: Vec<usize>,
    params: Vec<f64>,
}

/// The last solve.
pub(super) struct Outcome1 {
    pub solution: Solution,
    /// Rows at the solution.
    pub c: Vec<f64>,
    /// The point.
    pub x: Vec<f64>,
    /// Multipliers of the bounds.
    pub z: Vec<f64>,
    /// Variables of the members of the pairs, in the lifted problem: pairs that were added, then those of boxes.
    pub pairs: Vec<(usize, usize)>,
    /// Variables of the lifted problem that are copies, in the order of their rows.
    copies: Vec<usize>,
    /// Box of every pair behind those that were added.
    boxes: Vec<usize>,
    /// The parameters it was solved with.
    params: Vec<f64>,
    pub time_build: f64,
    pub dimensions: (usize, usize, usize),
    pub linear: LinearStats,
    pub residuals: Residuals,
    pub scaled: Residuals,
    jac: Arc<Pattern>,
    facts: Option<Facts>,
}

impl Outcome1 {
    /// The point to first order; nothing where a function has no derivatives there.
    pub fn local(&self) -> Option<Local<'_>> {
        let (s, f) = (&self.solution, self.facts.as_ref()?);
        Some(Local {
            x: &s.x,
            c: &f.c,
            grad: &f.grad,
            jac: &self.jac,
            jac_values: &f.jac_values,
            bounds: &f.bounds,
            pairs: &self.pairs,
            y: &s.y,
            z: &s.z,
        })
    }
}

/// Point and multipliers of the program's own variables and rows to start from.
#[derive(Clone)]
struct WarmStart {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

/// Where a solve starts.
#[derive(Clone, Copy, PartialEq)]
enum From {
    /// As it was set.
    Start,
    /// At the last solution.
    Last,
}

/// What is behind the handle.
pub struct Program {
    pub(super) n: usize,
    pub(super) m: usize,
    objective: SharedFunction,
    constraints: Option<SharedFunction>,
    hessian: Option<(Pattern, Arc<LagrangianFn>)>,
    pub(super) members: Vec<(Member, Member)>,
    pub(super) boxes: Vec<Boxed>,
    /// Is a constraint in a pair or box? `[m]`
    paired: Vec<bool>,
    pub(super) names: Names,
    bounds: Bounds,
    params: Vec<f64>,
    start: Vec<f64>,
    warm: Option<WarmStart>,
    pub(super) settings: Settings,
    built: Exclusive<Option<Built>>,
    result: Option<Outcome1>,
    pub(super) hooks: Hooks,
}

impl Program {
    fn new(
        (n, np): (usize, usize),
        objective: SharedFunction,
        constraints: Option<SharedFunction>,
        settings: Settings,
        interrupt: &Interrupt,
    ) -> Result<Program> {
        let m = CallbackNlp::check(n, np, &*objective, constraints.as_deref())?;
        Ok(Program {
            n,
            m,
            objective,
            constraints,
            hessian: None,
            members: Vec::new(),
            boxes: Vec::new(),
            paired: vec![false; m],
            names: Names::default(),
            bounds: Bounds::free(n, m),
            params: vec![0.0; np],
            start: vec![0.0; n],
            warm: None,
            settings,
            built: Exclusive::new(None),
            result: None,
            hooks: Hooks::new(interrupt),
        })
    }

    fn set_option(&mut self, name: &str, value: Value) -> Result<()> {
        let mut settings = self.settings;
        settings.set_by_name(name, value)?;
        self.set_settings(settings)
    }

    fn set_settings(&mut self, settings: Settings) -> Result<()> {
        if settings.validate_as_update(&self.settings).is_err() {
            // what is fixed when the solver is made is another one
            *self.built.get() = None;
        }
        self.settings = settings;
        Ok(())
    }

    fn member(&self, kind: i32, index: i64, what: &str) -> Result<Member> {
        let (len, make): (usize, fn(usize) -> Member) = match kind {
            k if k == swb_member::Variable as i32 => (self.n, Member::Variable),
            k if k == swb_member::Constraint as i32 => (self.m, Member::Row),
            _ => return Err(Error::Range(format!("the kind of {what} is {kind}: it must be an enum swb_member"))),
        };
        let i = usize::try_from(index).ok().filter(|i| *i < len);
        i.map(make).ok_or_else(|| Error::Dimension(format!("the index of {what} is {index}, outside 0..{len}")))
    }

    /// Pairs that were added and those of the boxes, the boxes of the latter, and the bounds of what is no pair.
    #[allow(clippy::type_complexity)]
    fn pairs(&self) -> Result<(Vec<(Member, Member)>, Vec<usize>, Bounds)> {
        let (mut members, mut boxes, mut bounds) = (self.members.clone(), Vec::new(), self.bounds.clone());
        for (k, one) in self.boxes.iter().enumerate() {
            one.write(&mut bounds, &mut members)?;
            boxes.resize(members.len() - self.members.len(), k);
        }
        Ok((members, boxes, bounds))
    }

    fn build(&mut self, members: Vec<(Member, Member)>) -> Result<f64> {
        if self.built.get().as_ref().is_some_and(|b| b.members == members) {
            return Ok(0.0);
        }
        let clock = Instant::now();
        let mut inner = CallbackNlp::new(self.n, self.params.len(), self.objective.clone(), self.constraints.clone())?;
        if let Some((pattern, hessian)) = &self.hessian {
            inner = inner.with_lagrangian(pattern.clone(), hessian.clone())?;
        }
        let mut problem = Lifted::new(inner, &members)?;
        let solver = MpccSolver::new(&mut problem, MpccSettings::from(&self.settings))?;
        let jac = Arc::new(problem.jac_pattern().clone());
        *self.built.get() = Some(Built { problem, members, solver, jac });
        Ok(clock.elapsed().as_secs_f64())
    }

    /// Point and multipliers of the lifted problem to start from; nothing for a cold start. `same`: the last solution is one of the
    /// problem as it is now.
    fn warmth(&mut self, from: From, same: bool) -> Result<Option<WarmStart>> {
        let mut own = self.warm.clone();
        if from == From::Last {
            let r = self.result()?;
            let s = &r.solution;
            let usable = !matches!(
                s.outcome,
                Outcome::Failed | Outcome::Infeasible | Outcome::LocallyInfeasible | Outcome::Diverging
            );
            if !usable {
                return Ok(None);
            }
            if same {
                return Ok(Some(WarmStart { x: s.x.clone(), y: s.y.clone(), z: s.z.clone() }));
            }
            own = Some(WarmStart { x: r.x.clone(), y: s.y[..self.m].to_vec(), z: r.z.clone() });
        }
        let (Some(own), Some(Built { problem, .. })) = (own, self.built.get()) else { return Ok(None) };
        let (x, y, z) = problem.warm(&own.x, &own.y, &own.z);
        Ok(Some(WarmStart { x, y, z }))
    }

    fn solve(&mut self, from: From) -> Result<Outcome> {
        memory::limited(self.settings.max_memory, || {
            let outcome = self.solve_within(from)?;
            memory::check()?;
            Ok(outcome)
        })
    }

    fn solve_within(&mut self, from: From) -> Result<Outcome> {
        self.settings.validate()?;
        self.bounds.validate(self.n, self.m)?;
        let (members, boxes, bounds) = self.pairs()?;
        let same = self.built.get().as_ref().is_some_and(|b| b.members == members);
        let time_build = self.build(members)?;
        let Some(Built { problem, .. }) = self.built.get() else {
            return Err(Error::Internal("the program was not built".into()));
        };
        problem.inner().set_params(&self.params)?;
        problem.inner().forget_undefined();
        let bounds = problem.bounds(&bounds)?;
        bounds.validate(problem.n(), problem.m())?;
        let warm = self.warmth(from, same)?;
        let Some(Built { problem, solver, jac, .. }) = self.built.get() else {
            return Err(Error::Internal("the program was not built".into()));
        };
        solver.settings = MpccSettings::from(&self.settings);
        let level = self.settings.verbosity();
        let (start, rows, seconds, result) = (&self.start, self.m, self.settings.max_time, &mut self.result);
        let stated = Stated { bounds: bounds.clone(), boxes, params: self.params.clone() };
        *result = None;
        let outcome = self.hooks.run("mpcc", level, |control| {
            control.within(seconds, |control| {
                if let Some(w) = &warm {
                    let warm = Warm { x: &w.x, y: &w.y, z: &w.z };
                    solver.solve_warm(problem, &bounds, &warm, control, &mut NoProposals);
                } else {
                    let w0 = problem.start(start);
                    solver.solve(problem, &bounds, &w0, control);
                }
            });
            let outcome = solver.solution().outcome;
            let undefined = problem.inner().undefined().map(|(f, part)| trouble::undefined(part, f));
            *result = Some(Outcome1::of(problem, solver, jac, stated, (start.len(), rows), time_build));
            undefined.filter(|_| outcome == Outcome::Failed).map_or(Ok(outcome), Err)
        })?;
        let importance = if outcome == Outcome::Solved { LogLevel::Info } else { LogLevel::Warning };
        self.hooks.tell(level, importance, || {
            self.result.as_ref().map_or_else(String::new, |r| {
                let s = &r.solution;
                format!(
                    "mpcc outcome = {}, polish = {:?}, objective = {:.10e}, primal = {:.2e}, dual = {:.2e}, \
                     pair_min = {:.2e}, iterations = {}, time = {:.3e}, time_build = {:.3e}",
                    s.outcome.name(),
                    s.polish,
                    s.objective,
                    r.residuals.primal,
                    r.residuals.dual,
                    r.residuals.pair_min,
                    s.stats.iterations,
                    s.stats.time_total,
                    r.time_build
                )
            })
        });
        if outcome != Outcome::Solved {
            self.hooks.tell(level, LogLevel::Warning, || self.worst_line());
        }
        if matches!(outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) {
            self.hooks.tell(level, LogLevel::Warning, || self.conflict_line());
        }
        Ok(outcome)
    }

    /// What of the program an item of the lifted problem is.
    pub(super) fn own(&self, r: &Outcome1, item: Item) -> (swb_item, usize) {
        let pair = |k: usize| match k.checked_sub(self.members.len()) {
            None => (swb_item::Pair, k),
            Some(k) => (swb_item::Box, r.boxes.get(k).copied().unwrap_or(0)),
        };
        let of_variable = |v: usize| pair(r.pairs.iter().position(|p| p.0 == v || p.1 == v).unwrap_or(0));
        match item {
            Item::Variable(j) if j < self.n => (swb_item::Variable, j),
            Item::Variable(v) => of_variable(v),
            Item::Row(i) if i < self.m => (swb_item::Constraint, i),
            Item::Row(i) => of_variable(r.copies[i - self.m]),
            Item::Pair(k) => pair(k),
        }
    }

    /// Number of parameters.
    pub(super) fn n_params(&self) -> usize {
        self.params.len()
    }

    /// What is computed of the last solution, with the bounds of the lifted problem; it calls functions and can be interrupted.
    pub(super) fn of_solution<T>(&mut self, compute: impl FnOnce(&mut Built, &Bounds) -> Result<T>) -> Result<T> {
        let seconds = self.settings.max_time;
        let r = self.result()?;
        let Some(Facts { bounds, .. }) = &r.facts else {
            return Err(Error::State("derivatives of a solution need an exact one: the last solve has none".into()));
        };
        let (bounds, params, sizes) = (bounds.clone(), r.params.clone(), (r.solution.x.len(), r.pairs.len()));
        let mut found = None;
        let Some(built) = self.built.get() else { return Err(changed()) };
        if (built.problem.n(), built.problem.pairs().len()) != sizes {
            return Err(changed());
        }
        built.problem.inner().set_params(&params)?;
        memory::limited(self.settings.max_memory, || {
            self.hooks.run("mpcc", LogLevel::Silent, |control| {
                found = Some(control.within(seconds, |_| compute(built, &bounds))?);
                Ok(Outcome::Solved)
            })?;
            memory::check()
        })?;
        found.ok_or_else(|| Error::Internal("nothing was computed".into()))
    }

    pub(super) fn result(&self) -> Result<&Outcome1> {
        self.result.as_ref().ok_or_else(|| Error::State("there is no result: call swb_mpcc_solve first".into()))
    }
}

impl Outcome1 {
    /// Takes the result out of the solver; `n`, `m` are the sizes of the program before lifting.
    fn of(
        problem: &mut Lifted<CallbackNlp>,
        solver: &MpccSolver,
        jac: &Arc<Pattern>,
        stated: Stated,
        (n, m): (usize, usize),
        time_build: f64,
    ) -> Outcome1 {
        let solution = solver.solution().clone();
        let pairs: Vec<_> = (0..problem.pairs().len()).map(|k| problem.pair(k)).collect();
        let mut r = Outcome1 {
            c: vec![f64::NAN; m],
            dimensions: (problem.n(), problem.m(), pairs.len()),
            linear: solver.linear_statistics(),
            residuals: solution.residuals,
            scaled: solution.residuals,
            jac: jac.clone(),
            facts: None,
            x: problem.point(&solution.x),
            z: problem.bound_multipliers(&solution.z),
            copies: problem.copies(),
            boxes: stated.boxes,
            params: stated.params,
            solution,
            pairs,
            time_build,
        };
        if r.solution.outcome == Outcome::Failed {
            return r;
        }
        if problem.inner().eval(&r.x[..n], &mut r.c).is_err() {
            r.c.fill(f64::NAN);
            return r;
        }
        let x = &r.solution.x;
        let mut facts = Facts {
            c: vec![0.0; problem.m()],
            grad: vec![0.0; problem.n()],
            jac_values: vec![0.0; jac.nnz()],
            bounds: stated.bounds,
            scaling: solver.scaling(),
        };
        let known = problem.eval(x, &mut facts.c).is_ok()
            && problem.derivatives(x, &mut facts.grad, &mut facts.jac_values).is_ok();
        if known {
            r.facts = Some(facts);
            if let (Some(local), Some(facts)) = (r.local(), &r.facts) {
                (r.residuals, r.scaled) = diagnostics::residuals(&local, &facts.scaling);
            }
        }
        r
    }
}

/// Bounds from the caller, checked; `name` of what has them is for messages.
unsafe fn bounds_of<'a>(
    name: impl Fn(usize) -> String,
    (lower, n_lower): (*const f64, i64),
    (upper, n_upper): (*const f64, i64),
) -> Result<(&'a [f64], &'a [f64])> {
    let (lower, upper) = unsafe { (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?) };
    for (i, (l, u)) in lower.iter().zip(upper).enumerate() {
        if l.is_nan() || u.is_nan() {
            return Err(Error::Range(format!("bound of {} is NaN; use an infinity for no bound", name(i))));
        }
        if l > u {
            return Err(Error::Range(format!("{} has lower bound {l} above upper bound {u}", name(i))));
        }
    }
    Ok((lower, upper))
}

fn expect(what: &str, n: usize, expected: usize) -> Result<()> {
    if n != expected {
        return Err(Error::Dimension(format!("{what} has {n} entries, expected {expected}")));
    }
    Ok(())
}

/// Create a program without pairs and bounds, parameters and start zero.
///
/// @param[in]  n           variables, the block x of the functions
/// @param[in]  np          parameters, the block p of the functions
/// @param[in]  objective   one output
/// @param[in]  constraints the rows c; NULL if there are none
/// @param[in]  settings    NULL for the defaults
/// @param[out] out         the new object, NULL on failure; free with swb_mpcc_free
/// @return SWB_OK; SWB_ERR_DIMENSION if the sizes of a function are not (n, 0, np)
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_create(
    n: i64,
    np: i64,
    objective: *const swb_function,
    constraints: *const swb_function,
    settings: *const Settings,
    out: *mut *mut swb_mpcc,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let settings = settings::read(settings)?;
            settings.validate()?;
            let sizes = (sizes::index(n, "n")?, sizes::size(np, "np")?);
            let objective = shared(objective, "objective")?;
            let constraints = shared_optional(constraints, "constraints")?;
            Program::new(sizes, objective, constraints, settings, interrupt)
        })
    })
}

/// Add the pair 0 <= G _|_ H >= 0.
///
/// A constraint may be in one pair only; a variable in several.
///
/// @param[in] kind_g  an enum swb_member: what G is
/// @param[in] index_g its index
/// @param[in] kind_h  an enum swb_member: what H is
/// @param[in] index_h its index
/// @return SWB_OK; SWB_ERR_RANGE if there is no such kind or a member cannot be used; SWB_ERR_DIMENSION if
///         there is no such index
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_add_pair(
    mpcc: *mut swb_mpcc,
    kind_g: i32,
    index_g: i64,
    kind_h: i32,
    index_h: i64,
) -> swb_status {
    setting(mpcc, || unsafe {
        handle::with_mut(mpcc, |p| {
            let pair = (p.member(kind_g, index_g, "G")?, p.member(kind_h, index_h, "H")?);
            if pair.0 == pair.1 {
                return Err(Error::Range("both members of the pair are the same".into()));
            }
            for member in [pair.0, pair.1] {
                let Member::Row(i) = member else { continue };
                if p.paired[i] {
                    return Err(in_use(i));
                }
            }
            for member in [pair.0, pair.1] {
                if let Member::Row(i) = member {
                    p.paired[i] = true;
                }
            }
            p.members.push(pair);
            p.names.set_len(swb_item::Pair, p.members.len());
            *p.built.get() = None;
            p.result = None;
            Ok(())
        })
    })
}

/// A constraint may be a member once.
fn in_use(i: usize) -> Error {
    Error::Range(format!(
        "constraint {i} is in a pair or box already: make it a variable of its own and use that in both"
    ))
}

/// Add the box lower <= w_i <= upper _|_ c_j: the constraint is not negative where the variable is at its lower bound, not positive
/// at its upper bound, and zero between them. The bounds are those of the variable (swb_mpcc_set_bounds) at the time of a solve;
/// infinite ones take no part. Where both are equal any value of the constraint will do. A mixed complementarity
/// problem (MCP) is a box for every variable with an objective that is zero; lower bounds zero and upper bounds infinite make a
/// nonlinear complementarity problem.
///
/// @param[in] variable   its index; it may be in several boxes and pairs
/// @param[in] constraint its index; its own bounds are not used, and it may be in one box or pair only
/// @return SWB_OK; SWB_ERR_RANGE if the constraint is in a pair or box; SWB_ERR_DIMENSION if there is no such index
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_add_box(mpcc: *mut swb_mpcc, variable: i64, constraint: i64) -> swb_status {
    setting(mpcc, || unsafe {
        handle::with_mut(mpcc, |p| {
            let (Member::Variable(j), Member::Row(i)) = (
                p.member(swb_member::Variable as i32, variable, "the variable")?,
                p.member(swb_member::Constraint as i32, constraint, "the constraint")?,
            ) else {
                return Err(Error::Internal("members of a box".into()));
            };
            if std::mem::replace(&mut p.paired[i], true) {
                return Err(in_use(i));
            }
            p.boxes.push(Boxed::new(j, i));
            p.names.set_len(swb_item::Box, p.boxes.len());
            p.result = None;
            Ok(())
        })
    })
}

/// Hessian of the Lagrangian, weight times the objective plus y times the constraints: writes out [nnz], the
/// values of the entries of the pattern; comes filled with zeros. y is [m], NULL if m is 0. Returns as
/// swb_value_fn.
pub type swb_lagrangian_fn = Option<
    unsafe extern "C" fn(
        at: *const swb_point,
        weight: f64,
        y: *const f64,
        out: *mut f64,
        user_data: *mut c_void,
    ) -> i32,
>;

/// Give second derivatives in one piece, in place of the Hessians of objective and constraints.
///
/// For functions described with swb_function_set_linear nothing else is prepared, although they are not linear.
///
/// @param[in] col_ptr   [n + 1] where the columns start; the last one is nnz
/// @param[in] row_idx   [nnz] rows from 0, increasing within each column, upper triangle (row <= column)
/// @param[in] hessian   NULL: back to the Hessians of the functions; the pattern is not read
/// @param[in] user_data passed on unchanged; must stay valid as long as the program has the callback
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION or SWB_ERR_RANGE if this is no such pattern
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_hessian(
    mpcc: *mut swb_mpcc,
    col_ptr: *const i64,
    n_col_ptr: i64,
    row_idx: *const i64,
    nnz: i64,
    hessian: swb_lagrangian_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(mpcc, || unsafe {
        handle::with_mut(mpcc, |p| {
            p.hessian = match hessian {
                None => None,
                Some(f) => {
                    const WHAT: &str = "Hessian of the Lagrangian";
                    let columns = "the variables";
                    let shape = (p.n, p.n);
                    let pattern = function::pattern(WHAT, columns, shape, (col_ptr, n_col_ptr), (row_idx, nnz))?;
                    if !pattern.is_upper() {
                        return Err(Error::Range(format!(
                            "{WHAT}: entries below the diagonal; give the upper triangle only"
                        )));
                    }
                    let caller = function::Caller::new("Lagrangian", user_data);
                    Some((pattern, Arc::new(lagrangian(caller, f))))
                }
            };
            *p.built.get() = None;
            Ok(())
        })
    })
}

type RawLagrangian = unsafe extern "C" fn(*const swb_point, f64, *const f64, *mut f64, *mut c_void) -> i32;

fn lagrangian(
    caller: function::Caller,
    f: RawLagrangian,
) -> impl Fn(&Point, f64, &[f64], &mut [f64]) -> switchback::func::EvalResult {
    move |at, weight, y, out| {
        let y = if y.is_empty() { ptr::null() } else { y.as_ptr() };
        // SAFETY: the function obeys the contract of its type, the pointers have the lengths the header promises.
        match caller.call("Hessian", at, out, |p, o, d| unsafe { f(p, weight, y, o, d) }) {
            0 => Ok(()),
            code if code > 0 => Err(EvalError::Recoverable),
            code => Err(EvalError::Fatal(code)),
        }
    }
}

/// Set bounds of the variables.
///
/// @param[in] lower [n_lower] n
/// @param[in] upper [n_upper] n
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a lower bound is above the upper one or NaN
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_bounds(
    mpcc: *mut swb_mpcc,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(mpcc, || unsafe {
        handle::with_mut(mpcc, |p| {
            let name = |i| p.names.label(swb_item::Variable, i);
            let (lower, upper) = bounds_of(name, (lower, n_lower), (upper, n_upper))?;
            expect("lower", lower.len(), p.n)?;
            expect("upper", upper.len(), p.n)?;
            p.bounds.xl.copy_from_slice(lower);
            p.bounds.xu.copy_from_slice(upper);
            Ok(())
        })
    })
}

/// Set bounds of the constraints; equal bounds make an equation. Those of rows in pairs are not used.
///
/// @param[in] lower [n_lower] rows
/// @param[in] upper [n_upper] rows
/// @return as swb_mpcc_set_bounds
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_constraint_bounds(
    mpcc: *mut swb_mpcc,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(mpcc, || unsafe {
        handle::with_mut(mpcc, |p| {
            let name = |i| p.names.label(swb_item::Constraint, i);
            let (lower, upper) = bounds_of(name, (lower, n_lower), (upper, n_upper))?;
            expect("lower", lower.len(), p.m)?;
            expect("upper", upper.len(), p.m)?;
            p.bounds.cl.copy_from_slice(lower);
            p.bounds.cu.copy_from_slice(upper);
            Ok(())
        })
    })
}

/// Set the parameters.
///
/// @param[in] values [np]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_params(mpcc: *mut swb_mpcc, values: *const f64, np: i64) -> swb_status {
    setting(mpcc, || unsafe {
        let values = raw::slice(values, np, "values")?;
        handle::with_mut(mpcc, |p| {
            switchback::error::finite("parameter", values, p.params.len())?;
            p.params.copy_from_slice(values);
            Ok(())
        })
    })
}

/// Set the point to start from.
///
/// @param[in] w [n]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_start(mpcc: *mut swb_mpcc, w: *const f64, n: i64) -> swb_status {
    setting(mpcc, || unsafe {
        let w = raw::slice(w, n, "w")?;
        handle::with_mut(mpcc, |p| {
            switchback::error::finite("start", w, p.n)?;
            p.start.copy_from_slice(w);
            p.warm = None;
            Ok(())
        })
    })
}

/// Start the next solves from a point with multipliers, as a solution of a program nearby has them; swb_mpcc_set_start
/// goes back to starting from a point alone.
///
/// @param[in] w [n]
/// @param[in] y [m] multipliers of the constraints; NULL with m = 0 for none
/// @param[in] z [n_z] n multipliers of the bounds, both as swb_mpcc_get_multipliers has them; NULL with n_z = 0 for
///                  none
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_warm_start(
    mpcc: *mut swb_mpcc,
    w: *const f64,
    n: i64,
    y: *const f64,
    m: i64,
    z: *const f64,
    n_z: i64,
) -> swb_status {
    setting(mpcc, || unsafe {
        let (w, y, z) = (raw::slice(w, n, "w")?, raw::slice(y, m, "y")?, raw::slice(z, n_z, "z")?);
        handle::with_mut(mpcc, |p| {
            let optional = |values: &[f64], len: usize, what: &str| {
                if values.is_empty() {
                    return Ok(vec![0.0; len]);
                }
                switchback::error::finite(what, values, len).map(|()| values.to_vec())
            };
            switchback::error::finite("start", w, p.n)?;
            let (y, z) = (optional(y, p.m, "y")?, optional(z, p.n, "z")?);
            p.start.copy_from_slice(w);
            p.warm = Some(WarmStart { x: w.to_vec(), y, z });
            Ok(())
        })
    })
}

/// Solve.
///
/// @param[out] outcome an enum swb_outcome; may be NULL
/// @return SWB_OK, however the solver ended; SWB_ERR_USER if a user function returned a negative code;
///         SWB_ERR_NONFINITE if one has no value at the start; SWB_ERR_NUMERIC; SWB_ERR_RANGE,
///         SWB_ERR_UNSUPPORTED if bounds and pairs do not go together
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_solve(mpcc: *mut swb_mpcc, outcome: *mut i32) -> swb_status {
    running(mpcc, || unsafe {
        let reached = handle::with_mut(mpcc, |p| p.solve(From::Start))?;
        raw::write_optional(outcome, outcome_number(reached));
        Ok(())
    })
}

/// Solve from the last solution and its multipliers, as after a change of parameters or bounds. After a solve that
/// failed, diverged or ended infeasible this is swb_mpcc_solve.
///
/// @param[out] outcome an enum swb_outcome; may be NULL
/// @return as swb_mpcc_solve; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_resolve(mpcc: *mut swb_mpcc, outcome: *mut i32) -> swb_status {
    running(mpcc, || unsafe {
        let reached = handle::with_mut(mpcc, |p| p.solve(From::Last))?;
        raw::write_optional(outcome, outcome_number(reached));
        Ok(())
    })
}

/// How the last solve ended.
///
/// @param[out] outcome an enum swb_outcome
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_outcome(mpcc: *const swb_mpcc, outcome: *mut i32) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| raw::write(outcome, outcome_number(p.result()?.solution.outcome), "outcome"))
    })
}

/// Outcome of the polish, which identifies the active set and solves the smooth program that remains.
///
/// @param[out] polished an enum swb_polished
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_polished(mpcc: *const swb_mpcc, polished: *mut i32) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| raw::write(polished, polished_number(p.result()?.solution.polish), "polished"))
    })
}

/// Objective.
///
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_objective(mpcc: *const swb_mpcc, objective: *mut f64) -> swb_status {
    guard(|| unsafe { handle::with_ref(mpcc, |p| raw::write(objective, p.result()?.solution.objective, "objective")) })
}

/// The point.
///
/// @param[out] w [n]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_solution(mpcc: *const swb_mpcc, w: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(mpcc, |p| raw::write_slice(w, n, &p.result()?.x, "w")) })
}

/// Constraints at the point.
///
/// @param[out] c [m] rows; NaN where the solve failed
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_constraints(mpcc: *const swb_mpcc, c: *mut f64, m: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(mpcc, |p| raw::write_slice(c, m, &p.result()?.c, "c")) })
}

/// Multipliers: grad f + J' y - z = 0, with J the Jacobian of the constraints.
///
/// @param[out] y [m] of the constraints
/// @param[out] z [n] of the bounds, lower minus upper; for variables in pairs the multiplier of the pair, and
///                   the sum of them for a variable in several
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_multipliers(
    mpcc: *const swb_mpcc,
    y: *mut f64,
    m: i64,
    z: *mut f64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| {
            let r = p.result()?;
            raw::check_slice(z, n, r.z.len(), "z")?;
            raw::write_slice(y, m, &r.solution.y[..p.m], "y")?;
            raw::write_slice(z, n, &r.z, "z")
        })
    })
}

/// Values of the members of the pairs, and their multipliers (nu of G, xi of H) at the point, in the order
/// the pairs were added.
///
/// @param[out] g  [n_pairs] may be NULL
/// @param[out] h  [n_pairs] may be NULL
/// @param[out] nu [n_pairs] may be NULL
/// @param[out] xi [n_pairs] may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_pairs(
    mpcc: *const swb_mpcc,
    g: *mut f64,
    h: *mut f64,
    nu: *mut f64,
    xi: *mut f64,
    n_pairs: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| {
            let r = p.result()?;
            let own = &r.pairs[..p.members.len()];
            if usize::try_from(n_pairs) != Ok(own.len()) {
                return Err(Error::Dimension(format!("n_pairs is {n_pairs}, not {}", own.len())));
            }
            let s = &r.solution;
            let column = |values: &[f64], first: bool| -> Vec<f64> {
                own.iter().map(|(a, b)| values[if first { *a } else { *b }]).collect()
            };
            let outputs = [(g, &s.x, true), (h, &s.x, false), (nu, &s.z, true), (xi, &s.z, false)];
            for (out, _, _) in outputs.iter().filter(|o| !o.0.is_null()) {
                raw::check(*out, "an output")?;
            }
            for (out, values, first) in outputs.into_iter().filter(|o| !o.0.is_null()) {
                raw::write_slice(out, n_pairs, &column(values, first), "an output")?;
            }
            Ok(())
        })
    })
}

/// Residuals of the last solve.
///
/// @param[out] residuals   every field is written
/// @param[in]  struct_size sizeof(swb_residuals)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_residuals(
    mpcc: *const swb_mpcc,
    residuals: *mut swb_residuals,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| {
            write_sized(&swb_residuals::of(&p.result()?.residuals), residuals, struct_size, "residuals")
        })
    })
}

/// Work and time of the last solve.
///
/// @param[out] stats       every field is written
/// @param[in]  struct_size sizeof(swb_stats)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_stats(
    mpcc: *const swb_mpcc,
    stats: *mut swb_stats,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| {
            let r = p.result()?;
            let value = swb_stats {
                time_build: r.time_build,
                n_variables: r.dimensions.0 as i64,
                n_constraints: r.dimensions.1 as i64,
                n_pairs: r.dimensions.2 as i64,
                ..swb_stats::of(&r.solution.stats)
            };
            write_sized(&value, stats, struct_size, "stats")
        })
    })
}

/// Set an integer or enumeration option of a program (or a float one, to an integer) by name.
///
/// @return as swb_settings_set_int
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_int(mpcc: *mut swb_mpcc, name: *const c_char, value: i64) -> swb_status {
    setting(mpcc, || unsafe {
        let name = raw::text(name, "name")?;
        handle::with_mut(mpcc, |o| o.set_option(name, Value::Int(value)))
    })
}

/// Set a float option of a program by name.
///
/// @return as swb_settings_set_double
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_double(mpcc: *mut swb_mpcc, name: *const c_char, value: f64) -> swb_status {
    setting(mpcc, || unsafe {
        let name = raw::text(name, "name")?;
        handle::with_mut(mpcc, |o| o.set_option(name, Value::Float(value)))
    })
}

/// Set any option of a program by name from text: a number, or the value name of an enumeration.
///
/// @return as swb_settings_set_string
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_string(
    mpcc: *mut swb_mpcc,
    name: *const c_char,
    value: *const c_char,
) -> swb_status {
    setting(mpcc, || unsafe {
        let (name, value) = (raw::text(name, "name")?, raw::text(value, "value")?);
        handle::with_mut(mpcc, |o| o.set_option(name, Value::Text(value.to_owned())))
    })
}

/// Set all options of a program.
///
/// @param[in] settings NULL for the defaults
/// @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_settings(mpcc: *mut swb_mpcc, settings: *const Settings) -> swb_status {
    setting(mpcc, || unsafe {
        let settings = settings::read(settings)?;
        settings.validate()?;
        handle::with_mut(mpcc, |o| o.set_settings(settings))
    })
}

/// Options of a program, all of them.
///
/// @param[out] settings    every field is written
/// @param[in]  struct_size sizeof(swb_settings)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_settings(
    mpcc: *const swb_mpcc,
    settings: *mut Settings,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(mpcc, |o| write_sized(&o.settings, settings, struct_size, "settings")) })
}

/// Set who is called once per iteration; NULL for nobody.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_iteration(
    mpcc: *mut swb_mpcc,
    iteration: swb_iteration_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(mpcc, || unsafe {
        handle::with_mut(mpcc, |o| {
            o.hooks.set_iteration(iteration, user_data);
            Ok(())
        })
    })
}

/// Set who gets the log, as much as the option log_level says; NULL for nobody.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_log(mpcc: *mut swb_mpcc, log: swb_log_fn, user_data: *mut c_void) -> swb_status {
    setting(mpcc, || unsafe {
        handle::with_mut(mpcc, |o| {
            o.hooks.set_log(log, user_data);
            Ok(())
        })
    })
}

/// Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
/// thread and from signal handlers; only swb_mpcc_free must not run at the same time. It is heeded in every phase, before the
/// next evaluation of a model function and before the next factorisation: the call ends within the time of one of
/// these, a model function that takes long itself is waited for. What was found before stays the answer.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_interrupt(mpcc: *const swb_mpcc) -> swb_status {
    unsafe { handle::interrupt(mpcc) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_free(mpcc: *mut swb_mpcc) {
    unsafe { handle::free(mpcc) }
}
