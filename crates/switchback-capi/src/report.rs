//! How solves end and what they cost; iteration callbacks; what every solving object shares.

use super::guard::query;
use super::handle::Interrupt;
use super::log::{swb_log_fn, LogSink};
use super::raw;
use std::ffi::{c_char, c_void, CStr};
use std::mem::size_of;
use std::ptr;
use std::sync::atomic::Ordering;
use switchback::error::{Error, Result};
use switchback::func::trouble;
use switchback::linalg::kkt::LinearStats;
use switchback::mpcc;
use switchback::nlp::{Control, IterationInfo, Outcome, Residuals, Statistics};
use switchback::settings::LogLevel;
use switchback::stop::Stop;

/// How a solve ended. Numbers are only ever added.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_outcome {
    /// All residuals are below the tolerance.
    Solved = 0,
    /// Out of iterations; the point is the last iterate.
    MaxIter = 1,
    /// Out of time; the point is the last iterate.
    MaxTime = 2,
    /// A callback or an interrupt asked to stop; the point is the last iterate.
    Stopped = 3,
    /// There is no point: all branches show it, or the linear rows of a program without pairs, or a point minimises the violation of the constraints.
    Infeasible = 4,
    /// No progress is possible although the tolerance is not reached.
    Stalled = 5,
    /// The iterates diverge.
    Diverging = 6,
    /// There is no usable point; the call returned an error that says why.
    Failed = 7,
    /// Only for an optimal control problem: its discretised problem is solved, but simulations of the controls, single stages included, are
    /// another motion.
    NotFollowed = 8,
    /// Converged to a point that minimises the violation of the constraints locally; whether there is a point elsewhere is not known.
    LocallyInfeasible = 9,
}

pub(super) const OUTCOMES: &[(Outcome, swb_outcome, &CStr)] = &[
    (Outcome::Solved, swb_outcome::Solved, c"solved"),
    (Outcome::MaxIter, swb_outcome::MaxIter, c"max_iter"),
    (Outcome::MaxTime, swb_outcome::MaxTime, c"max_time"),
    (Outcome::Stopped, swb_outcome::Stopped, c"stopped"),
    (Outcome::Infeasible, swb_outcome::Infeasible, c"infeasible"),
    (Outcome::Stalled, swb_outcome::Stalled, c"stalled"),
    (Outcome::Diverging, swb_outcome::Diverging, c"diverging"),
    (Outcome::Failed, swb_outcome::Failed, c"failed"),
    (Outcome::NotFollowed, swb_outcome::NotFollowed, c"not_followed"),
    (Outcome::LocallyInfeasible, swb_outcome::LocallyInfeasible, c"locally_infeasible"),
];

/// Number of an outcome in the header.
pub fn outcome_number(o: Outcome) -> i32 {
    OUTCOMES.iter().find(|row| row.0 == o).map_or(swb_outcome::Failed as i32, |row| row.1 as i32)
}

/// Name of an outcome, such as "solved"; NULL for any other number. Static.
#[no_mangle]
pub extern "C" fn swb_outcome_name(outcome: i32) -> *const c_char {
    query(ptr::null(), || OUTCOMES.iter().find(|row| row.1 as i32 == outcome).map_or(ptr::null(), |row| row.2.as_ptr()))
}

/// Outcomes of the polish, which identifies the active set and solves the smooth problem that remains.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_polished {
    /// Not asked for, or not reached.
    None = 0,
    /// Yes: the pairs are exactly complementary.
    Done = 1,
    /// The identified branch has no solution; the point is that of the relaxation.
    Rejected = 2,
}

/// Number of a polish in the header.
pub fn polished_number(p: mpcc::Polish) -> i32 {
    (match p {
        mpcc::Polish::None => swb_polished::None,
        mpcc::Polish::Done => swb_polished::Done,
        mpcc::Polish::Rejected => swb_polished::Rejected,
    }) as i32
}

/// Residuals of the optimality conditions, unscaled, maximum norm.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_residuals {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Violation of constraints and bounds.
    pub primal: f64,
    /// Gradient of the Lagrangian; 0 for simulations.
    pub dual: f64,
    /// Products of slacks and multipliers of bounds; 0 for simulations.
    pub complementarity: f64,
    /// Largest product G_i H_i of a pair; 0 for simulations.
    pub pair_product: f64,
    /// Largest min(G_i, H_i) of a pair.
    pub pair_min: f64,
}

impl swb_residuals {
    pub(super) fn of(r: &Residuals) -> swb_residuals {
        swb_residuals {
            struct_size: 0,
            primal: r.primal,
            dual: r.dual,
            complementarity: r.complementarity,
            pair_product: r.pair_product,
            pair_min: r.pair_min,
        }
    }
}

/// Work and time of a solve, or of all steps of a simulation.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_stats {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Interior-point iterations, restoration included.
    pub iterations: i64,
    /// Numeric factorisations.
    pub factorisations: i64,
    /// Evaluations of objective and constraints.
    pub evaluations: i64,
    /// Iterations inside the restoration phase.
    pub restoration_iterations: i64,
    /// Iterations spent in the polish.
    pub polish_iterations: i64,
    /// Largest perturbation of the Hessian.
    pub max_delta_w: f64,
    /// Seconds in functions and derivatives.
    pub time_eval: f64,
    /// Seconds in factorisations and solves.
    pub time_linalg: f64,
    /// Seconds in all.
    pub time_total: f64,
    /// Seconds to build the problem, not part of time_total; 0 when an earlier structure was used again.
    pub time_build: f64,
    /// Variables of the solved program; 0 for simulations.
    pub n_variables: i64,
    /// Constraints of the solved program; 0 for simulations.
    pub n_constraints: i64,
    /// Complementarity pairs of the solved program; 0 for simulations.
    pub n_pairs: i64,
    /// Steps of a simulation; else 0.
    pub n_steps: i64,
    /// Steps of a simulation that the homotopy had to decide; else 0.
    pub n_homotopies: i64,
    /// Bounds that were moved outwards by 1e-9, relative to them or to the unit of the scaled problem, because constraints left no room
    /// between them; the polish is under those given.
    pub moved_bounds: i64,
}

/// The linear systems of a solve: sizes, and work since the program was built.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_linear_stats {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Order of the matrix.
    pub n: i64,
    /// Entries of its upper triangle.
    pub nnz_k: i64,
    /// Entries of the factor below the diagonal.
    pub nnz_l: i64,
    /// Floating-point operations of one factorisation.
    pub flops: f64,
    /// Smallest modulus of a pivot of the last factorisation, of the equilibrated matrix.
    pub min_abs_pivot: f64,
    /// Largest one.
    pub max_abs_pivot: f64,
    /// Shift of the diagonal in the last factorisation, of the equilibrated matrix.
    pub shift: f64,
    /// Numeric factorisations.
    pub factorisations: i64,
    /// Solutions.
    pub solves: i64,
    /// Steps of refinement in all solutions.
    pub refinement_steps: i64,
    /// Times the scaling was computed.
    pub equilibrations: i64,
}

impl swb_linear_stats {
    pub(super) fn of(s: &LinearStats) -> swb_linear_stats {
        swb_linear_stats {
            struct_size: 0,
            n: s.n as i64,
            nnz_k: s.nnz_k as i64,
            nnz_l: s.nnz_l as i64,
            flops: s.flops,
            min_abs_pivot: s.min_abs_pivot,
            max_abs_pivot: s.max_abs_pivot,
            shift: s.shift,
            factorisations: s.factorisations as i64,
            solves: s.solves as i64,
            refinement_steps: s.refinement_steps as i64,
            equilibrations: s.equilibrations as i64,
        }
    }
}

impl swb_stats {
    pub(super) fn of(s: &Statistics) -> swb_stats {
        swb_stats {
            iterations: s.iterations as i64,
            factorisations: s.factorisations as i64,
            evaluations: s.evaluations as i64,
            restoration_iterations: s.restoration_iterations as i64,
            polish_iterations: s.polish_iterations as i64,
            max_delta_w: s.max_delta_w,
            moved_bounds: s.moved_bounds as i64,
            time_eval: s.time_eval,
            time_linalg: s.time_linalg,
            time_total: s.time_total,
            ..swb_stats::default()
        }
    }
}

/// One iteration of a solve.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_iteration_info {
    /// Size of this struct in bytes, as the library knows it.
    pub struct_size: u64,
    /// Iteration number; starts again with every step of a simulation.
    pub iter: i64,
    /// Objective.
    pub objective: f64,
    /// Primal infeasibility.
    pub inf_pr: f64,
    /// Dual infeasibility.
    pub inf_du: f64,
    /// Barrier parameter.
    pub mu: f64,
    /// Relaxation of the complementarity, 0 without one.
    pub sigma: f64,
    /// Largest product of a pair.
    pub inf_cc: f64,
    /// Length of the last primal step.
    pub step: f64,
    /// Perturbation of the Hessian.
    pub delta_w: f64,
    /// Dual step length.
    pub alpha_du: f64,
    /// Primal step length.
    pub alpha_pr: f64,
    /// Trial points of the line search.
    pub trials: i64,
    /// Character: ' ' main phase, 'r' restoration, 'p' polish, 'j' relaxation raised after a jam,
    /// 's' step that lowers the error as a whole, 'c' linear program of a certificate, numbered on its own.
    pub phase: i64,
    /// Cost of the best solution that a search around this solve has verified so far; infinite where there is none.
    pub incumbent: f64,
}

/// Called once per iteration by the thread that solves; a return other than 0 stops the solve with the
/// outcome SWB_OUTCOME_STOPPED. `info` is valid during the call only. Must not unwind.
pub type swb_iteration_fn =
    Option<unsafe extern "C" fn(info: *const swb_iteration_info, user_data: *mut c_void) -> i32>;

/// Structs that start with their size, of 8-byte fields only.
///
/// # Safety
/// The type is `repr(C)`, without padding, its first field the size.
pub(super) unsafe trait Sized8: Copy {}
unsafe impl Sized8 for swb_residuals {}
unsafe impl Sized8 for swb_stats {}
unsafe impl Sized8 for swb_linear_stats {}
unsafe impl Sized8 for super::diagnosis::swb_certificate {}
unsafe impl Sized8 for switchback::settings::Settings {}

/// Check that a struct of that size can be written to `out`: for several outputs, check all before the first is written.
pub(super) fn check_sized<T: Sized8>(out: *const T, struct_size: u64, what: &str) -> Result<()> {
    raw::check(out, what)?;
    if !(8..=1 << 16).contains(&struct_size) || struct_size % 8 != 0 {
        return Err(Error::Dimension(format!("struct_size is {struct_size}, not the size of {what}")));
    }
    Ok(())
}

/// Write a struct to a caller whose header may be older or newer: what is new to us becomes zero.
pub(super) unsafe fn write_sized<T: Sized8>(value: &T, out: *mut T, struct_size: u64, what: &str) -> Result<()> {
    check_sized(out, struct_size, what)?;
    let known = (struct_size as usize).min(size_of::<T>());
    unsafe {
        let bytes = out.cast::<u8>();
        ptr::copy_nonoverlapping((value as *const T).cast::<u8>(), bytes, known);
        ptr::write_bytes(bytes.add(known), 0, struct_size as usize - known);
        bytes.cast::<u64>().write(struct_size);
    }
    Ok(())
}

/// A value that is used by one thread at a time only, inside an object that several may read.
pub(super) struct Exclusive<T>(T);

// SAFETY: a shared reference gives no access to the value.
unsafe impl<T: Send> Sync for Exclusive<T> {}

impl<T> Exclusive<T> {
    pub fn new(value: T) -> Exclusive<T> {
        Exclusive(value)
    }
    pub fn get(&mut self) -> &mut T {
        &mut self.0
    }
}

/// What a solving object calls, and what stops it.
pub(super) struct Hooks {
    interrupt: Interrupt,
    iteration: swb_iteration_fn,
    iteration_data: *mut c_void,
    log: Option<LogSink>,
}

// SAFETY: as for `LogSink`.
unsafe impl Send for Hooks {}
unsafe impl Sync for Hooks {}

impl Hooks {
    pub fn new(interrupt: &Interrupt) -> Hooks {
        Hooks { interrupt: interrupt.clone(), iteration: None, iteration_data: ptr::null_mut(), log: None }
    }

    pub fn set_iteration(&mut self, f: swb_iteration_fn, user_data: *mut c_void) {
        (self.iteration, self.iteration_data) = (f, user_data);
    }

    pub fn set_log(&mut self, f: swb_log_fn, user_data: *mut c_void) {
        self.log = LogSink::new(f, user_data);
    }

    /// Run a solve: `body` keeps its result and returns how it ended. A user function that ended it, or a
    /// point without values, is the error of the call.
    pub fn run(
        &self,
        what: &str,
        level: LogLevel,
        body: impl FnOnce(&mut Control) -> Result<Outcome>,
    ) -> Result<Outcome> {
        let level = if self.log.is_some() { level } else { LogLevel::Silent };
        let mut go_on = true;
        let mut monitor = |i: &IterationInfo| {
            if level as i64 >= LogLevel::Debug as i64 {
                self.line(LogLevel::Debug, &iteration_line(i));
            }
            // who asked to stop is not asked again, whatever else is tried
            go_on = go_on
                && self.iteration.is_none_or(|f| {
                    let info = iteration_info(i);
                    // SAFETY: the contract of `swb_iteration_fn`; the struct outlives the call.
                    unsafe { f(&info, self.iteration_data) == 0 }
                });
            go_on
        };
        let watched = self.iteration.is_some() || level as i64 >= LogLevel::Debug as i64;
        let mut control =
            Control { stop: Stop::on(&self.interrupt), monitor: if watched { Some(&mut monitor) } else { None } };
        let stop = control.stop.clone();
        let (result, troubles) = trouble::collect(true, || stop.scope(|| body(&mut control)));
        let result = match (troubles.fatal, result) {
            (Some(complaint), _) => Err(complaint.error()),
            (None, Ok(Outcome::Failed)) => Err(troubles.last.map_or_else(
                || {
                    Error::Numeric(format!(
                        "{what}: the linear systems cannot be solved; check scaling and derivatives"
                    ))
                },
                |complaint| complaint.error(),
            )),
            // a callback has said more
            (None, Err(Error::NonFinite(text))) => {
                Err(troubles.last.map_or(Error::NonFinite(text), |complaint| complaint.error()))
            }
            (None, result) => result,
        };
        // an interrupt is for this solve alone, whatever ended it
        self.interrupt.store(false, Ordering::Relaxed);
        if let Err(e) = &result {
            self.tell(level, LogLevel::Error, || format!("{what} error = {e}"));
        }
        result
    }

    /// Send a line, if there is a sink and `level` lets it pass; no line where there is nothing to say.
    pub fn tell(&self, level: LogLevel, importance: LogLevel, line: impl FnOnce() -> String) {
        if self.log.is_some() && level as i64 >= importance as i64 {
            let line = line();
            if !line.is_empty() {
                self.line(importance, &line);
            }
        }
    }

    fn line(&self, importance: LogLevel, line: &str) {
        if let Some(log) = &self.log {
            log.line(importance, line);
        }
    }
}

fn iteration_info(i: &IterationInfo) -> swb_iteration_info {
    swb_iteration_info {
        struct_size: size_of::<swb_iteration_info>() as u64,
        iter: i.iter as i64,
        objective: i.objective,
        inf_pr: i.inf_pr,
        inf_du: i.inf_du,
        mu: i.mu,
        sigma: i.sigma,
        inf_cc: i.inf_cc,
        step: i.step,
        delta_w: i.delta_w,
        alpha_du: i.alpha_du,
        alpha_pr: i.alpha_pr,
        trials: i.trials as i64,
        phase: i64::from(i.phase),
        incumbent: i.incumbent,
    }
}

fn iteration_line(i: &IterationInfo) -> String {
    format!(
        "iteration phase = {:?}, iter = {}, objective = {:.8e}, inf_pr = {:.2e}, inf_du = {:.2e}, inf_cc = {:.2e}, \
         mu = {:.1e}, sigma = {:.1e}, step = {:.1e}, delta_w = {:.1e}, alpha_du = {:.2e}, alpha_pr = {:.2e}, trials = {}",
        i.phase as char,
        i.iter,
        i.objective,
        i.inf_pr,
        i.inf_du,
        i.inf_cc,
        i.mu,
        i.sigma,
        i.step,
        i.delta_w,
        i.alpha_du,
        i.alpha_pr,
        i.trials
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outcomes_are_those_of_the_solver() {
        for (o, number, name) in OUTCOMES {
            assert_eq!((*o as i32, o.name()), (*number as i32, name.to_str().unwrap()));
        }
        assert!(swb_outcome_name(OUTCOMES.len() as i32).is_null() && swb_outcome_name(-1).is_null());
        for p in [mpcc::Polish::None, mpcc::Polish::Done, mpcc::Polish::Rejected] {
            assert_eq!(p as i32, polished_number(p));
        }
    }

    #[test]
    fn sized_structs_of_other_headers() {
        let ours = size_of::<swb_residuals>();
        for size in [8, 16, ours, ours + 16] {
            let mut memory = vec![u64::MAX; ours / 8 + 3];
            let value = swb_residuals { primal: 1.0, pair_min: 2.0, ..Default::default() };
            unsafe { write_sized(&value, memory.as_mut_ptr().cast(), size as u64, "residuals") }.unwrap();
            assert_eq!(memory[0], size as u64);
            assert_eq!(memory[1] == 1.0f64.to_bits(), size > 8);
            assert!(memory[size / 8..].iter().all(|w| *w == u64::MAX));
        }
        let mut r = swb_residuals::default();
        assert_eq!(unsafe { write_sized(&r.clone(), &mut r, 12, "residuals") }.unwrap_err().code(), -2);
    }
}
