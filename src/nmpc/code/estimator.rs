//! Estimators as C files.

use super::text::{self, table, Writer};
use super::{expressions, refuse, CCode, SOLVER};
use crate::error::Result;
use crate::expr::{CReal, ExprFunction};
use crate::func::Function;
use crate::nmpc::Mhe;
use std::fmt::Write;

/// What does not depend on the problem.
const ESTIMATOR: &str = include_str!("estimator.c");
/// A program that repeats the record.
const MAIN: &str = include_str!("estimator_main.c");
/// Samples of the record: windows that are not full yet, and full ones.
const SAMPLES: usize = 60;
/// The memory of an estimator next to that of the solver.
const OWN: &str = "#define FREE 1
#define ARRAY ((NY + NX) * (NY + NX) > NX * (NX + NU) ? (NY + NX) * (NY + NX) : NX * (NX + NU))
#define OWN \\
    real window_x[(N + 1) * NX], window_w[N * NU], window_u[ROOM((N + 1) * MU)], window_p[ROOM((N + 1) * NP)], window_y[(N + 1) * NY]; \\
    real mean[NX], root[NX * NX], array[ARRAY], params[ROOM(NP)]; \\
    real k[RK * NX], s[NX * NX], sz[NX * NX], sk[RK * NX * NX], jac[ROOM(JACOBIAN)], value[NY], line[NY * NX]; \\
    unsigned long samples; \\
    int filled, estimated, ready, started;
";

impl Mhe {
    /// The estimator as C files (C99) whose names begin with `prefix`: no heap, no threads, no clock, all memory in one static object.
    ///
    /// ```text
    /// int prefix_prepare(const real *u);                     1 where there is a program for the next sample
    /// int prefix_estimate(const real *y, real *x);           the source of the state
    /// int prefix_set_params(const real *p);                  from the next preparation on
    /// void prefix_reset(const real *x0);
    /// ```
    ///
    /// The estimator in C begins with the initial state of the problem and the present parameters; it has no deadline. The files hold a record of
    /// this estimator with simulated measurements, some of them missing, and a program that repeats it. The call leaves this estimator as
    /// [`Mhe::reset`] with the initial state does.
    ///
    /// # Errors
    /// [`Error::Unsupported`](crate::error::Error::Unsupported) for systems that switch, implicit methods, deadlines and functions that are no
    /// expressions; [`Error::Range`](crate::error::Error::Range) for a prefix that is no C identifier; those of [`Mhe::prepare`].
    pub fn write_c(&mut self, prefix: &str, real: CReal) -> Result<CCode> {
        text::check_prefix(prefix)?;
        if self.switches {
            return refuse(text::SWITCHES);
        }
        if self.options.deadline.is_finite() {
            return refuse("deadlines: there is no clock");
        }
        let w = Writer { real };
        let source = self.c_source(&w, prefix)?;
        let record = self.c_record(&w, prefix)?;
        Ok(CCode {
            files: vec![
                (format!("{prefix}.h"), self.c_header(real, prefix)),
                (format!("{prefix}.c"), source),
                (format!("{prefix}_main.c"), text::named(MAIN, prefix)),
                (format!("{prefix}_record.h"), record),
                ("Makefile".into(), text::makefile("estimator", prefix, "")),
            ],
        })
    }

    fn c_header(&self, real: CReal, prefix: &str) -> String {
        let (n, nx, nu, np, ny) = (self.n, self.nx, self.nu, self.np, self.ny);
        let body = format!(
            "/* Stages of the window, states, controls, parameters, measurements. */
enum {{ {prefix}_n = {n}, {prefix}_nx = {nx}, {prefix}_nu = {nu}, {prefix}_np = {np}, {prefix}_ny = {ny} }};

/* Where a state comes from: the quadratic program; the same with bounds at a price, since they cannot all be met; an unfinished one; a
   prediction, since functions have no value. */
enum {{ {prefix}_qp = 0, {prefix}_soft_qp = 1, {prefix}_tangent = 2, {prefix}_plan = 3 }};

/* Goes to the next sample under the control u[nu], and does everything that needs no measurement; 1 where there is a program for it. */
int {prefix}_prepare(const {prefix}_real *u);
/* The state x[nx] at the sample of the last preparation, or at the start, from its measurements y[ny]; NAN for what was not measured. A second
   call for one sample gives its state again. Returns the source. */
int {prefix}_estimate(const {prefix}_real *y, {prefix}_real *x);
/* Parameters p[np], from the next preparation on; 0 where they are no numbers. */
int {prefix}_set_params(const {prefix}_real *p);
/* Back to the start with the mean x0[nx]: nothing was measured. */
void {prefix}_reset(const {prefix}_real *x0);
/* States of the window [(n + 1) nx], the last sample at its end, and how many of its stages were. Valid until the next call. */
const {prefix}_real *{prefix}_states(void);
int {prefix}_filled(void);
"
        );
        text::header("estimator", "estimate", prefix, real, &body)
    }

    fn c_source(&self, w: &Writer, prefix: &str) -> Result<String> {
        let Some((dynamics, steps, tableau)) = self.one.explicit() else {
            return refuse("implicit methods: take rk_family \"explicit\"");
        };
        let named = [("f", expressions(dynamics)?), ("y", expressions(self.measured.function())?)];
        let tables = |out: &mut String| {
            self.c_sizes(out, &named, steps, tableau.n_s);
            self.c_tables(w, out, &named, tableau);
        };
        text::source("estimator", prefix, w, &named, tables, &[OWN, SOLVER, ESTIMATOR])
    }

    fn c_sizes(&self, out: &mut String, functions: &[(&str, &ExprFunction)], steps: usize, n_s: usize) {
        let (n, nx, nu, np, ny, nw) = (self.n, self.nx, self.nu, self.np, self.ny, self.qp.nu);
        let jacobian = functions.iter().map(|(_, f)| f.jac_pattern().nnz()).max().unwrap_or(0);
        let _ = write!(
            out,
            "
enum {{ N = {n}, NX = {nx}, NU = {nw}, NW = NX + NU, MU = {nu}, NP = {np}, NY = {ny}, NOISY = {}, ROWS = {}, ALL = N * NU + ROWS }};
enum {{ STEPS = {steps}, RK = {n_s}, JACOBIAN = {jacobian}, ITERATIONS = {} }};
",
            self.noisy.len(),
            self.qp.rows.len(),
            self.options.iterations,
        );
    }

    fn c_tables(
        &self,
        w: &Writer,
        out: &mut String,
        functions: &[(&str, &ExprFunction)],
        tableau: &crate::tableau::Tableau,
    ) {
        let int = |v: usize| v.to_string();
        w.method(out, functions, tableau);
        w.reals(out, "DEVIATIONS", &self.deviations);
        w.reals(out, "SIGMA", &self.sigma);
        w.reals(out, "PROCESS", &self.process);
        let nw = self.qp.nu;
        w.reals(out, "INVERSE_PROCESS", &(0..nw).map(|j| self.qp.hess_u[j * (nw + 1)]).collect::<Vec<_>>());
        let (n, many) = (self.n, self.bounded.len());
        table(out, "int", "NOISY_STATES", self.noisy.iter().map(|i| int(*i)));
        table(out, "int", "ROW_FIRST", (0..n + 2).map(|k| int(k * many)));
        table(out, "int", "ROW_NODE", (0..(n + 1) * many).map(|r| int(r / many)));
        table(out, "int", "ROW_OUT", (0..(n + 1) * many).map(|r| int(self.bounded[r % many])));
        for (name, bounds) in [("ROW_LOWER", &self.bounds[0]), ("ROW_UPPER", &self.bounds[1])] {
            w.reals(out, name, &(0..(n + 1) * many).map(|r| bounds[self.bounded[r % many]]).collect::<Vec<_>>());
        }
        w.reals(out, "ROW_LINEAR", &vec![f64::INFINITY; (n + 1) * many]);
        w.reals(out, "ROW_QUADRATIC", &vec![0.0; (n + 1) * many]);
        w.reals(out, "START_X", &self.start);
        w.reals(out, "START_P", &self.params);
        for (name, v) in [("LENGTH", self.h), ("START_T", self.t0), ("TOLERANCE", self.options.tol)] {
            let _ = writeln!(out, "#define {name} (({}))", w.number(v));
        }
    }

    /// Estimates from measurements of the model, simulated with controls and noise from a fixed seed.
    fn c_record(&mut self, w: &Writer, prefix: &str) -> Result<String> {
        let (nx, nu, ny) = (self.nx, self.nu, self.ny);
        let mut seed = 1u64;
        let mut draw = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            2.0 * ((seed >> 11) as f64 * 2f64.powi(-53)) - 1.0
        };
        let start = self.start.clone();
        let mut truth: Vec<f64> = start.iter().zip(&self.deviations).map(|(x, d)| x + d * draw()).collect();
        let (low, high) = (self.bounds[0].clone(), self.bounds[1].clone());
        truth.iter_mut().zip(low.iter().zip(&high)).for_each(|(x, (l, h))| *x = x.max(*l).min(*h));
        self.reset(&start)?;
        let (mut us, mut ys, mut xs, mut sources) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (mut y, mut x) = (vec![0.0; ny], vec![0.0; nx]);
        for k in 0..SAMPLES {
            let u: Vec<f64> = (0..nu).map(|_| 0.5 * draw()).collect();
            if k > 0 {
                if !self.simulate(&u, &mut truth)? {
                    break;
                }
                for (i, s) in self.noisy.iter().zip(&self.process) {
                    truth[*i] += s * draw();
                }
                self.prepare(&u)?;
            }
            if !self.measure(&truth, &u, &mut y)? {
                break;
            }
            for (i, y) in y.iter_mut().enumerate() {
                *y += self.sigma[i] * draw();
                if (k + i) % 11 == 5 {
                    *y = f64::NAN;
                }
            }
            let e = self.estimate(&y, &mut x)?;
            us.extend_from_slice(&u);
            ys.extend_from_slice(&y);
            xs.extend_from_slice(&x);
            sources.push(e.source as usize);
        }
        self.reset(&start)?;
        let mut out = format!(
            "/* What the library's estimator made of measurements: controls before them, measurements, states and their sources. */\n#include <math.h>\n\nenum {{ SAMPLES = {} }};\n",
            sources.len()
        );
        let kind = format!("{prefix}_real");
        let number = |v: &f64| if v.is_nan() { "NAN".to_owned() } else { w.number(*v) };
        table(&mut out, &kind, "RECORD_U", us.iter().map(number));
        table(&mut out, &kind, "RECORD_Y", ys.iter().map(number));
        table(&mut out, &kind, "RECORD_X", xs.iter().map(number));
        table(&mut out, "int", "RECORD_SOURCE", sources.iter().map(|v| v.to_string()));
        let largest = (0..nx).map(|i| xs.iter().skip(i).step_by(nx).fold(0.0f64, |m, v| m.max(v.abs())));
        table(&mut out, "double", "RECORD_LARGEST", largest.map(|v| format!("{:e}", if v > 0.0 { v } else { 1.0 })));
        Ok(out)
    }
}
