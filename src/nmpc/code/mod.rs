//! Controllers and estimators as C files: what the library does between samples and at them, without a heap, threads or a clock.
//!
//! The functions of the problem are written by [`crate::expr::write_c_first`]; sizes and data are tables; the rest is `solver.c`, which
//! is [`crate::qp::Stagewise`] in C99, and `controller.c` with the schemes of real-time iterations, or `estimator.c`. All memory is one static object whose size is known
//! when it is compiled.

mod estimator;
mod fmu;
mod text;

use super::options::{Level, QpMethod, Scheme};
use super::Nmpc;
use crate::error::{Error, Result};
use crate::expr::{CReal, ExprFunction};
use crate::system::SharedFunction;
use std::fmt::Write;
use text::{table, Writer};

/// What does not depend on the problem.
const SOLVER: &str = include_str!("solver.c");
const CONTROLLER: &str = include_str!("controller.c");
/// The memory of a controller next to that of the solver.
const OWN: &str = "#define FREE 0
#define OWN \\
    real x[(N + 1) * NX], u[N * NU], at_x[(N + 1) * NX], at_u[N * NU], params[ROOM(NP)], references[ROOM(REFERENCES)]; \\
    real k[RK * NX], s[NX * NW], sz[NX * NW], sk[RK * NX * NW], jac[ROOM(JACOBIAN)], value[ROOM(VALUES)], line[ROOM(VALUES) * NW]; \\
    real measured[NX], applied[NU], predicted[NX], u_lower[NU], u_upper[NU]; \\
    int ready, prepared, pending, seen, unshifted, has_prediction, violating, entry, started;
";
/// A program that runs the recorded loop.
const MAIN: &str = include_str!("main.c");
const MAKEFILE: &str = include_str!("Makefile.in");
/// What makes units for co-simulation.
const UNITS: &str = include_str!("Makefile.fmu");
/// Samples of the recorded closed loop.
const SAMPLES: usize = 60;
/// States of the record are off their prediction by this share of the largest state of the plan.
const BLOW: f64 = 0.005;

/// The files of a controller or an estimator.
#[derive(Debug, Clone, PartialEq)]
pub struct CCode {
    /// Names and contents: header, source, a program that runs the recorded loop, its data, a Makefile; of a controller functions and descriptions
    /// of a unit for co-simulation, too.
    pub files: Vec<(String, String)>,
}

impl CCode {
    /// Writes the files to a folder, which is made where it is not there.
    ///
    /// # Errors
    /// [`Error::Range`] where a file cannot be written.
    pub fn write(&self, folder: &std::path::Path) -> Result<()> {
        let failed = |what: &std::path::Path, e: std::io::Error| {
            Error::Range(format!("{} cannot be written: {e}", what.display()))
        };
        std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
        for (name, text) in &self.files {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(|e| failed(&path, e))?;
        }
        Ok(())
    }
}

fn refuse<T>(what: &str) -> Result<T> {
    Err(Error::Unsupported(format!("a controller in C does not know {what}")))
}

/// A function of the problem as expressions.
fn expressions(f: &SharedFunction) -> Result<&ExprFunction> {
    match f.as_any().and_then(|f| f.downcast_ref::<ExprFunction>()) {
        Some(e) => Ok(e),
        None => Err(Error::Unsupported(format!(
            "function '{}' is no expression: a controller in C needs dynamics, costs and constraints from expressions",
            f.name()
        ))),
    }
}

impl Nmpc {
    /// The controller as C files (C99) whose names begin with `prefix`: no heap, no threads, no clock, all memory in one static object.
    ///
    /// ```text
    /// int prefix_prepare(void);                                  1 where there is a program for the next sample
    /// int prefix_feedback(const real *x, real *u);               the source of the control
    /// int prefix_set_reference(int term, const real *y);         for all nodes; 1 if it was taken
    /// int prefix_set_control_bounds(const real *lower, const real *upper);
    /// int prefix_set_params(const real *p);                      from the next preparation on
    /// void prefix_reset(void);
    /// ```
    ///
    /// `make fmu` makes a unit for co-simulation of them (FMI 2.0), `make fmu3` one of FMI 3.0: inputs are the state and the references, outputs the control and its source.
    ///
    /// Quadratic programs are solved stage by stage. The controller in C begins with the present plan, parameters and references, as this one
    /// does after [`Nmpc::set_iterate`] with its plan, which is where the call leaves it. The files hold a loop of this controller, recorded with
    /// states that are off their predictions, and a program that repeats it.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for systems that switch, implicit methods, algebraic states, costs that are no least squares, functions that are no
    /// expressions, and other schemes than [`Scheme::Rti`] and [`Scheme::AsRti`] with [`Level::D0`]; [`Error::State`] where the controller does not
    /// solve its programs stage by stage; [`Error::Range`] for a prefix that is no C identifier.
    pub fn write_c(&mut self, prefix: &str, real: CReal) -> Result<CCode> {
        text::check_prefix(prefix)?;
        self.check_c()?;
        let (x, u) = {
            let plan = self.plan();
            (plan.x().to_vec(), plan.u().to_vec())
        };
        let w = Writer { real };
        let source = self.c_source(&w, prefix, &x, &u)?;
        let record = self.c_record(&w, prefix, &x, &u)?;
        let unit = self.fmu(prefix, &source, [&x, &u]);
        let mut files = vec![
            (format!("{prefix}.h"), self.c_header(real, prefix)),
            (format!("{prefix}.c"), source),
            (format!("{prefix}_main.c"), text::named(MAIN, prefix)),
            (format!("{prefix}_record.h"), record),
        ];
        files.extend(unit);
        files.push(("Makefile".into(), text::makefile("controller", prefix, UNITS)));
        Ok(CCode { files })
    }

    /// What the kernel does not know.
    fn check_c(&self) -> Result<()> {
        let o = self.options();
        if self.model.switches {
            return refuse(text::SWITCHES);
        }
        if self.model.nodes.nz > 0 {
            return refuse("algebraic states");
        }
        if self.model.stage.explicit().is_none() {
            return refuse("implicit methods: take rk_family \"explicit\"");
        }
        if !matches!(o.scheme, Scheme::Rti | Scheme::AsRti) || o.level != Level::D0 {
            return refuse("schemes other than \"rti\" and \"as_rti\", and levels other than \"d0\"");
        }
        if !self.model.costs.general.is_empty() || self.model.costs.squares.is_empty() {
            return refuse("costs other than least squares");
        }
        if self.model.nodes.p.chunks_exact(self.model.nodes.np.max(1)).any(|p| p != &self.model.nodes.p[..p.len()]) {
            return refuse("parameters that differ from stage to stage");
        }
        if o.max_changes > 0 {
            return refuse("max_changes");
        }
        if o.qp != QpMethod::Stagewise {
            return Err(Error::State(
                "the files solve quadratic programs stage by stage: make the controller with qp_solver \"stagewise\""
                    .into(),
            ));
        }
        Ok(())
    }

    fn c_header(&self, real: CReal, prefix: &str) -> String {
        let (n, nx, nu, np) = (self.n(), self.nx(), self.nu(), self.model.nodes.np);
        let terms = self.model.costs.squares.len();
        let body = format!(
            "/* Stages, states, controls, parameters, least-squares terms. */
enum {{ {prefix}_n = {n}, {prefix}_nx = {nx}, {prefix}_nu = {nu}, {prefix}_np = {np}, {prefix}_terms = {terms} }};

/* Where a control comes from: the quadratic program; the same with rows at a price, since they cannot all be met; an unfinished one, cut off at
   the bounds of the controls; the last plan; the last control again. */
enum {{ {prefix}_qp = 0, {prefix}_soft_qp = 1, {prefix}_tangent = 2, {prefix}_plan = 3, {prefix}_hold = 4 }};

/* Everything for the next sample that needs no measurement; 1 where there is a program for it. */
int {prefix}_prepare(void);
/* The control u[nu] for a measured state x[nx]; there always is one. Returns its source. */
int {prefix}_feedback(const {prefix}_real *x, {prefix}_real *u);
/* The reference of a least-squares term, for all its nodes. Between a preparation and its feedback it counts at once. 0 where it is not taken:
   no such term, or no numbers. */
int {prefix}_set_reference(int term, const {prefix}_real *y);
/* Bounds of the controls, [nu] each, INFINITY for none. Between a preparation and its feedback they count at once. 0 where they are not taken: a
   lower one above the upper one, or no numbers. */
int {prefix}_set_control_bounds(const {prefix}_real *lower, const {prefix}_real *upper);
/* Parameters p[np], from the next preparation on; 0 where they are no numbers. */
int {prefix}_set_params(const {prefix}_real *p);
/* Back to the start, with the plan, parameters, references and bounds that were written. */
void {prefix}_reset(void);
/* The plan from the last sample on: x[(n + 1) nx], u[n nu]. Valid until the next call. */
const {prefix}_real *{prefix}_plan_x(void);
const {prefix}_real *{prefix}_plan_u(void);
"
        );
        text::header("controller", "feedback", prefix, real, &body)
    }

    fn c_source(&self, w: &Writer, prefix: &str, x: &[f64], u: &[f64]) -> Result<String> {
        let Some((dynamics, steps, tableau)) = self.model.stage.explicit() else { return refuse("implicit methods") };
        let costs = &self.model.costs.squares;
        let rows = &self.model.constraints;
        let mut functions = vec![("f".to_owned(), expressions(dynamics)?)];
        for (k, s) in costs.iter().enumerate() {
            functions.push((format!("cost{k}"), expressions(s.f.function())?));
        }
        for (k, g) in rows.groups.iter().enumerate() {
            functions.push((format!("constraint{k}"), expressions(g.function())?));
        }
        let named: Vec<(&str, &ExprFunction)> = functions.iter().map(|(n, f)| (n.as_str(), *f)).collect();
        let tables = |out: &mut String| {
            self.c_sizes(out, &named, steps, tableau.n_s);
            self.c_tables(w, out, &named, tableau, [x, u]);
        };
        text::source("controller", prefix, w, &named, tables, &[OWN, SOLVER, CONTROLLER])
    }

    fn c_sizes(&self, out: &mut String, functions: &[(&str, &ExprFunction)], steps: usize, n_s: usize) {
        use crate::func::Function;
        let (n, nx, nu, np) = (self.n(), self.nx(), self.nu(), self.model.nodes.np);
        let (costs, rows) = (&self.model.costs.squares, self.model.constraints.rows().len());
        let references: usize = costs.iter().map(|s| s.references.len()).sum();
        let jacobian = functions.iter().map(|(_, f)| f.jac_pattern().nnz()).max().unwrap_or(0);
        let values = functions.iter().map(|(_, f)| f.n_out()).max().unwrap_or(0);
        let inner = if self.options().scheme == Scheme::AsRti { self.options().inner } else { 0 };
        let _ = write!(
            out,
            "
enum {{ N = {n}, NX = {nx}, NU = {nu}, NW = NX + NU, NP = {np}, ROWS = {rows}, ALL = N * NU + ROWS, TERMS = {}, REFERENCES = {references} }};
enum {{ STEPS = {steps}, RK = {n_s}, JACOBIAN = {jacobian}, VALUES = {values}, INNER = {inner}, SHIFT = {} }};
",
            costs.len(),
            usize::from(self.options().shift),
        );
    }

    fn c_tables(
        &self,
        w: &Writer,
        out: &mut String,
        functions: &[(&str, &ExprFunction)],
        tableau: &crate::tableau::Tableau,
        [x, u]: [&[f64]; 2],
    ) {
        use crate::func::Function;
        let (nodes, costs, rows) = (&self.model.nodes, &self.model.costs.squares, &self.model.constraints);
        let int = |v: usize| v.to_string();
        w.reals(out, "T", &nodes.t);
        w.reals(out, "H", &nodes.h);
        w.method(out, functions, tableau);
        w.reals(out, "U_LOWER", &self.model.u_lower);
        w.reals(out, "U_UPPER", &self.model.u_upper);
        table(out, "int", "FUN_OUT", functions.iter().map(|(_, f)| int(f.n_out())));
        let offsets = |sizes: Vec<usize>| {
            sizes.iter().scan(0, |sum, v| Some(std::mem::replace(sum, *sum + v))).collect::<Vec<usize>>()
        };
        let ints = |out: &mut String, name: &str, v: Vec<usize>| table(out, "int", name, v.into_iter().map(int));
        ints(out, "TERM_FIRST", costs.iter().map(|s| s.first).collect());
        ints(out, "TERM_COUNT", costs.iter().map(|s| s.f.n).collect());
        ints(out, "TERM_BY_LENGTH", costs.iter().map(|s| usize::from(s.by_length)).collect());
        ints(out, "TERM_WEIGHTS", offsets(costs.iter().map(|s| s.weights.len()).collect()));
        ints(out, "TERM_REFERENCES", offsets(costs.iter().map(|s| s.references.len()).collect()));
        w.reals(out, "WEIGHTS", &costs.iter().flat_map(|s| s.weights.iter().copied()).collect::<Vec<_>>());
        let first = (0..nodes.n + 2).map(|k| rows.rows().partition_point(|r| r.node < k));
        ints(out, "ROW_FIRST", first.collect());
        ints(out, "ROW_NODE", rows.rows().iter().map(|r| r.node).collect());
        let function = |group: Option<usize>| group.map_or(0, |g| 1 + costs.len() + g);
        ints(out, "ROW_FUN", rows.sources.iter().map(|s| function(s.group)).collect());
        ints(out, "ROW_OUT", rows.sources.iter().map(|s| s.out).collect());
        w.reals(out, "ROW_LOWER", &rows.sources.iter().map(|s| s.lower).collect::<Vec<_>>());
        w.reals(out, "ROW_UPPER", &rows.sources.iter().map(|s| s.upper).collect::<Vec<_>>());
        let price = |part: fn(&crate::qp::Price) -> f64, none: f64| -> Vec<f64> {
            rows.rows().iter().map(|r| r.price.as_ref().map_or(none, part)).collect()
        };
        w.reals(out, "ROW_LINEAR", &price(|p| p.linear, f64::INFINITY));
        w.reals(out, "ROW_QUADRATIC", &price(|p| p.quadratic, 0.0));
        w.reals(out, "START_X", x);
        w.reals(out, "START_U", u);
        w.reals(out, "START_P", &nodes.p[..nodes.np]);
        w.reals(out, "START_REFERENCES", &costs.iter().flat_map(|s| s.references.iter().copied()).collect::<Vec<_>>());
        let _ = writeln!(out, "#define GIVEN_PRICE (({}))", w.number(self.options().elastic_price));
    }

    /// A closed loop of this controller from its plan, with the model as plant and states that are off their predictions.
    fn c_record(&mut self, w: &Writer, prefix: &str, x: &[f64], u: &[f64]) -> Result<String> {
        let (nx, nu) = (self.nx(), self.nu());
        let monitor = *self.monitor();
        self.set_iterate(x, u)?;
        let size: Vec<f64> =
            (0..nx).map(|i| x.iter().skip(i).step_by(nx).fold(0.0f64, |m, v| m.max(v.abs()))).collect();
        let mut state = x[..nx].to_vec();
        let mut control = vec![0.0; nu];
        let (mut states, mut controls, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        let mut seed = 1u64;
        for _ in 0..SAMPLES {
            self.prepare(None)?;
            let info = self.feedback(&state, &mut control)?;
            states.extend_from_slice(&state);
            controls.extend_from_slice(&control);
            sources.push(info.source as usize);
            if !self.step_model(&state.clone(), &control, &mut state) {
                break;
            }
            for (v, size) in state.iter_mut().zip(&size) {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                *v += BLOW * size * (2.0 * ((seed >> 11) as f64 * 2f64.powi(-53)) - 1.0);
            }
        }
        self.set_iterate(x, u)?;
        self.monitor = monitor;
        let mut out = format!(
            "/* A loop of the library's controller: states, controls and their sources. */\nenum {{ SAMPLES = {} }};\n",
            sources.len()
        );
        let kind = format!("{prefix}_real");
        table(&mut out, &kind, "RECORD_X", states.iter().map(|v| w.number(*v)));
        table(&mut out, &kind, "RECORD_U", controls.iter().map(|v| w.number(*v)));
        table(&mut out, "int", "RECORD_SOURCE", sources.iter().map(|v| v.to_string()));
        let largest = controls.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let _ = writeln!(out, "#define RECORD_LARGEST ({:e})", largest);
        Ok(out)
    }
}
