//! The command: reads a problem, solves it, writes what was found.

use std::io::Write;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::path::PathBuf;

use crate::nl::{self, Problem};
use crate::options::{self, Options};
use crate::sol::{Kind, Sol, Suffix};
use crate::translate::{translate, Answer, Translated};
use crate::truth::{self, Truth};
use crate::verdict::Verdict;
use switchback::mpcc::{BStationarity, Solution, Stationarity};
use switchback::{memory, Error, IterationInfo, Mpcc, MpccSettings, MpccSolver, Outcome, Result, SolveControl};

/// Name of the command.
pub const NAME: &str = "switchback-mpcc-ampl";

/// Name of the variable of the environment with options.
pub const VARIABLE: &str = "switchback_mpcc_ampl_options";

/// What `-v` prints: name, version, and the date of the ASL whose files are read.
fn version() -> String {
    format!("{NAME} {} (solves programs with complementarity constraints)", env!("CARGO_PKG_VERSION"))
}

const USAGE: &str = "usage: switchback-mpcc-ampl stub [-AMPL] [-s] [-e] [name=value ...]

Solves the problem in stub.nl. With -AMPL or -s the result goes to stub.sol.

flags:
  -AMPL  called by AMPL: write stub.sol, and print no result
  -s     write stub.sol
  -e     do not print the options that are set
  -v     print the version
  -=     print all options
  -?     print this

Options are taken from the variable switchback_mpcc_ampl_options of the environment, too.
";

/// What the command line asks for.
#[derive(Debug, Default)]
struct Call {
    stub: Option<String>,
    from_ampl: bool,
    write: bool,
    quiet: bool,
    assignments: String,
}

fn parse(args: &[String]) -> Result<Call> {
    let mut call = Call::default();
    for arg in args {
        match arg.as_str() {
            "-AMPL" => call.from_ampl = true,
            "-s" => call.write = true,
            "-e" => call.quiet = true,
            flag if flag.starts_with('-') && call.stub.is_none() => {
                return Err(Error::Option(format!("unknown flag {flag}: the flag -? lists all")))
            }
            text if call.stub.is_none() => call.stub = Some(text.to_owned()),
            text => {
                call.assignments.push(' ');
                call.assignments.push_str(text);
            }
        }
    }
    Ok(call)
}

/// Runs the command with these arguments and options from the environment.
///
/// # Errors
/// Where there is no result for AMPL: the file cannot be read or written, or an option is none.
pub fn run(args: &[String], environment: &str, out: &mut dyn Write) -> Result<()> {
    let asks = |flags: &[&str]| args.iter().any(|a| flags.contains(&a.as_str()));
    if asks(&["-v", "--version"]) {
        return print(out, &(version() + "\n"));
    }
    if asks(&["-="]) {
        return print(out, &options::list());
    }
    if asks(&["-?", "-h", "--help"]) {
        return print(out, USAGE);
    }
    let call = parse(args)?;
    let Some(stub) = &call.stub else {
        return Err(Error::Option("no problem given: name the .nl file; the flag -? says how".into()));
    };
    let mut options = Options::default();
    options.assign(environment)?;
    options.assign(&call.assignments)?;
    let (nl, sol) = files(stub);
    let bytes = std::fs::read(&nl).map_err(|e| Error::Library(format!("cannot read {}: {e}", nl.display())))?;
    if options.outlev > 0 && !call.quiet && !call.assignments.is_empty() {
        print(out, &format!("{NAME}: {}\n", call.assignments.trim()))?;
    }
    let max_memory = options.settings.max_memory;
    let problem = memory::bounded(max_memory, || nl::read(&bytes))?;
    drop(bytes);
    let result = solve(&problem, &options, out)?;
    if call.from_ampl || call.write || options.wantsol & 1 != 0 {
        let text = result.text(&problem.header);
        std::fs::write(&sol, text).map_err(|e| Error::Library(format!("cannot write {}: {e}", sol.display())))?;
    }
    if options.outlev > 0 && options.wantsol & 8 == 0 && !call.from_ampl {
        print(out, &format!("{}\n", result.message))?;
    }
    for (wanted, name, values) in [(2, "variable", &result.primals), (4, "dual value", &result.duals)] {
        if options.wantsol & wanted != 0 {
            let lines: String =
                values.iter().enumerate().map(|(k, v)| format!("{name} {k} = {}\n", number(*v))).collect();
            print(out, &lines)?;
        }
    }
    Ok(())
}

/// Writes text; a reader that has left is no error.
fn print(out: &mut dyn Write, text: &str) -> Result<()> {
    let _ = out.write_all(text.as_bytes());
    Ok(())
}

/// The files with the problem and the solution.
fn files(stub: &str) -> (PathBuf, PathBuf) {
    let base = stub.strip_suffix(".nl").unwrap_or(stub);
    (PathBuf::from(format!("{base}.nl")), PathBuf::from(format!("{base}.sol")))
}

/// What weights of a conflict, the largest of which is 1, may leave over: they are those of a minimiser, not of an exact one.
const PROOF: f64 = 1e-6;

/// Solves a problem. What goes wrong from here on is a result for AMPL, too.
///
/// # Errors
/// [`Error::Option`] for an objective that is none.
pub fn solve(problem: &Problem, options: &Options, out: &mut dyn Write) -> Result<Sol> {
    let n_objs = problem.objectives.len();
    // the default is the first objective, if there is one
    let objno = if n_objs == 0 && options.objno == 1 { 0 } else { options.objno };
    if objno > n_objs {
        return Err(Error::Option(format!("option 'objno' is {objno}, and the problem has {n_objs} objectives")));
    }
    let max_memory = options.settings.max_memory;
    let found = caught(|| memory::bounded(max_memory, || solved(problem, options, objno.checked_sub(1), out)));
    let sol = found.unwrap_or_else(|e| {
        let code = match e {
            Error::Library(_) => 403,
            Error::Unsupported(_) => 510,
            Error::Internal(_) => 599,
            _ => 511,
        };
        Sol { code, message: heading(&e.to_string()), ..Sol::default() }
    });
    Ok(Sol { objno, ..sol })
}

/// A defect of the solver is a result, too.
fn caught<R>(body: impl FnOnce() -> Result<R>) -> Result<R> {
    catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|_| Err(Error::Internal("the solver has panicked".into())))
}

fn heading(text: &str) -> String {
    format!("{NAME} {}: {text}", env!("CARGO_PKG_VERSION"))
}

fn solved(problem: &Problem, options: &Options, objective: Option<usize>, out: &mut dyn Write) -> Result<Sol> {
    options.settings.validate()?;
    let n_integer = problem.header.n_integer;
    if n_integer > 0 && !options.relax_integrality {
        return Err(Error::Unsupported(format!(
            "{n_integer} variables must be integers: this solver has continuous ones only; relax_integrality=1 lets them be"
        )));
    }
    if problem.bounds.is_empty() {
        return Ok(constant(problem, objective, options.settings.tol));
    }
    if let Some(crossed) = crossed(problem) {
        return Ok(Sol { code: 200, message: heading(&format!("infeasible: {crossed}")), ..Sol::default() });
    }
    let mut t = translate(problem, objective)?;
    t.bounds.validate(t.start.len(), t.bounds.cl.len())?;
    if options.outlev >= 2 {
        print(out, &sizes(problem, &t))?;
    }
    let mut solver = MpccSolver::new(&mut t.program, MpccSettings::from(&options.settings))?;
    let mut log = |i: &IterationInfo| {
        if options.outlev >= 3 {
            let _ = print(out, &iteration(i));
        }
        true
    };
    let mut control = SolveControl { monitor: Some(&mut log), ..SolveControl::default() };
    control.within(options.settings.max_time, |control| {
        solver.solve(&mut t.program, &t.bounds, &t.start, control);
    });
    let found = solver.solution();
    memory::check()?;
    Ok(report(problem, options, objective, &mut t, found))
}

/// The result of a solution.
fn report(problem: &Problem, options: &Options, objective: Option<usize>, t: &mut Translated, found: &Solution) -> Sol {
    let answer = t.answer(found);
    let truth = truth::look(problem, objective, &answer.x);
    let has_pairs = !t.program.pairs().is_empty();
    let mut own = found.clone();
    own.objective = t.objective(found.objective);
    let mut verdict = Verdict::of(&own, has_pairs, &truth, &options.settings);
    if let (Outcome::Failed, Some(part)) = (found.outcome, t.program.inner().undefined()) {
        verdict.text += &format!(" (no {part})");
    }
    let mut message = heading(&verdict.text);
    if let Some(f) = truth.objective {
        message += &format!("\nobjective {}", number(f));
    }
    message += &format!("\n{} iterations; largest violation {:.1e}", found.stats.iterations, truth.violation);
    if problem.header.n_integer > 0 {
        message += &format!("\n{} variables that must be integers were relaxed", problem.header.n_integer);
    }
    let suffixes = suffixes(t, found, &answer, has_pairs);
    Sol { message, duals: answer.duals, primals: answer.x, code: verdict.code, suffixes, ..Sol::default() }
}

/// A number as it is read most easily, all digits of it.
fn number(v: f64) -> String {
    let (plain, short) = (format!("{v}"), format!("{v:e}"));
    if plain.len() <= short.len() + 4 {
        plain
    } else {
        short
    }
}

fn suffixes(t: &Translated, found: &Solution, answer: &Answer, has_pairs: bool) -> Vec<Suffix> {
    let mut out = vec![Suffix::real("bound_dual", Kind::Variables, &answer.reduced_costs)];
    if has_pairs {
        out.push(Suffix::of_problem("stationarity", word(found.certificate.stationarity)));
        out.push(Suffix::of_problem(
            "b_stationary",
            match found.certificate.b {
                BStationarity::Yes => 1,
                BStationarity::No => 2,
                _ => 3,
            },
        ));
    }
    // weights that prove nothing are not given
    if let Some(conflict) = found.conflict.as_ref().filter(|c| c.gap > 0.0 && c.residual <= PROOF) {
        let (rows, variables) = t.conflict(conflict);
        out.push(Suffix::real("conflict", Kind::Constraints, &rows));
        out.push(Suffix::real("conflict", Kind::Variables, &variables));
    }
    out
}

/// The type of stationarity as a number that is not zero, which suffixes are where nothing is said.
fn word(s: Stationarity) -> i64 {
    match s {
        Stationarity::S => 1,
        Stationarity::M => 2,
        Stationarity::C => 3,
        Stationarity::A => 4,
        Stationarity::W => 5,
        Stationarity::None => 6,
        _ => 7,
    }
}

/// A problem without variables.
fn constant(problem: &Problem, objective: Option<usize>, tol: f64) -> Sol {
    let truth = truth::look(problem, objective, &[]);
    let Truth { violation, place, .. } = &truth;
    let (code, text) = if *violation <= tol {
        (0, "optimal solution (there are no variables)".to_owned())
    } else {
        (200, format!("infeasible: there are no variables, and {place} violates its bounds by {violation:.1e}"))
    };
    Sol { code, message: heading(&text), duals: vec![0.0; problem.rows.len()], ..Sol::default() }
}

/// Bounds with nothing between them.
fn crossed(problem: &Problem) -> Option<String> {
    let text =
        |what: &str, k: usize, l: f64, u: f64| format!("{what} {k} has the lower bound {l} above the upper bound {u}");
    let of_variables = problem.bounds.iter().enumerate().map(|(j, b)| ("variable", j, *b));
    let of_rows = problem.rows.iter().enumerate().filter_map(|(i, r)| match r {
        nl::Row::Within(l, u) => Some(("constraint", i, (*l, *u))),
        nl::Row::Complements { .. } => None,
    });
    of_variables.chain(of_rows).find(|(_, _, (l, u))| l > u).map(|(what, k, (l, u))| text(what, k, l, u))
}

fn sizes(problem: &Problem, t: &Translated) -> String {
    let (n, m) = (t.program.pairs().len(), problem.rows.len());
    format!(
        "{} variables, {m} constraints, {n} pairs, {} of them for expressions with kinks or conditions\n",
        problem.bounds.len(),
        t.n_kinks
    )
}

fn iteration(i: &IterationInfo) -> String {
    format!(
        "{}{:5} f {:15.8e} primal {:8.1e} dual {:8.1e} pairs {:8.1e} mu {:7.1e} sigma {:7.1e} step {:8.1e} {:7.1e}\n",
        char::from(i.phase),
        i.iter,
        i.objective,
        i.inf_pr,
        i.inf_du,
        i.inf_cc,
        i.mu,
        i.sigma,
        i.step,
        i.alpha_pr
    )
}
