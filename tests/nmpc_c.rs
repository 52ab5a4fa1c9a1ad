//! Controllers as C files: compiled strictly, without a heap, and the same controls as the library's.

#[allow(dead_code)]
#[path = "common/nmpc.rs"]
mod problems;

use problems::{chain, pendulum, scheme, Case};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use switchback::error::Error;
use switchback::expr::{CReal, Graph};
use switchback::func::Dims;
use switchback::nmpc::{Level, Nmpc, Options, QpMethod, Scheme};
use switchback::ocp::Norm;
use switchback::system::SharedFunction;

fn folder(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("nmpc-c-{name}"));
    let _ = std::fs::remove_dir_all(&dir);
    dir
}

/// Output of a command that must succeed.
fn run(dir: &Path, program: &str, args: &[&str]) -> String {
    let done = Command::new(program).args(args).current_dir(dir).output().unwrap();
    let text = format!("{}{}", String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{program} {args:?} in {}: {text}", dir.display());
    text
}

/// Writes, compiles and runs; returns what the program says, and the symbols the controller does not define.
fn built(c: &mut Nmpc, name: &str, real: CReal) -> (String, Vec<String>) {
    let dir = folder(name);
    c.write_c(name, real).unwrap().write(&dir).unwrap();
    let text = run(&dir, "make", &["-s", "test"]);
    println!("{name}: {}{}", text, run(&dir, "size", &[&format!("{name}.o")]));
    let symbols = run(&dir, "nm", &["-u", &format!("{name}.o")]);
    let undefined = symbols.split_whitespace().filter(|s| *s != "U").map(str::to_owned).collect();
    std::fs::remove_dir_all(&dir).unwrap();
    (text, undefined)
}

fn controller(case: &Case, which: Scheme, shift: bool) -> Nmpc {
    let options = Options { qp: QpMethod::Stagewise, shift, ..scheme(which, Level::D0, 1) };
    let mut c = Nmpc::new(&case.ocp, &options).unwrap();
    // a record from any plan will do
    let _ = c.initialise(&case.x0, 200);
    c
}

/// Nothing but functions of the mathematical library, and what a compiler may make of loops.
fn only_mathematics(symbols: &[String]) {
    let known = ["sin", "cos", "sincos", "sqrt", "pow", "exp", "sinf", "cosf", "sincosf", "sqrtf", "memcpy", "memset", "memmove"];
    let other: Vec<_> = symbols.iter().filter(|s| !known.contains(&s.as_str())).collect();
    assert!(other.is_empty(), "calls of {other:?}");
}

#[test]
fn the_same_controls_as_the_library() {
    for (name, case) in [("pendulum", pendulum()), ("chain", chain(3))] {
        for (which, shift) in [(Scheme::Rti, false), (Scheme::AsRti, true)] {
            let (_, symbols) = built(&mut controller(&case, which, shift), name, CReal::Double);
            only_mathematics(&symbols);
        }
    }
}

#[test]
fn single_precision() {
    let (_, symbols) = built(&mut controller(&chain(3), Scheme::Rti, false), "single", CReal::Float);
    only_mathematics(&symbols);
}

/// Bounds of states that the recorded loop cannot always meet, rows at both prices, a constraint of controls and states.
#[test]
fn rows_of_all_kinds() {
    let mut case = pendulum();
    let g = Graph::new();
    let dims = Dims { x: 4, u: 1, p: 0 };
    let speed: SharedFunction = Arc::new(g.function("speed", dims, &[g.x(2), g.x(3)]).unwrap());
    let power: SharedFunction = Arc::new(g.function("power", dims, &[g.u(0) * g.x(2)]).unwrap());
    let at = switchback::fesd::PathAt::ControlGrid;
    case.ocp.add_relaxed(speed.clone(), &[-1.0, -4.0], &[1.0, 4.0], Some(at), Norm::L1, 3.0).unwrap();
    case.ocp.add_relaxed(speed, &[-1.0, -4.0], &[1.0, 4.0], Some(at), Norm::L2, 5.0).unwrap();
    case.ocp.add_path(power, &[-20.0], &[20.0], at).unwrap();
    case.ocp.set_x_bounds(&[-0.6, -10.0, -50.0, -50.0], &[0.6, 10.0, 50.0, 50.0]).unwrap();
    built(&mut controller(&case, Scheme::Rti, true), "rows", CReal::Double);
}

#[test]
fn what_is_not_known_is_said() {
    let case = pendulum();
    let refused = |options: Options, prefix: &str| {
        let mut c = Nmpc::new(&case.ocp, &options).unwrap();
        match c.write_c(prefix, CReal::Double) {
            Err(Error::Unsupported(what) | Error::State(what) | Error::Range(what)) => what,
            other => panic!("{other:?}"),
        }
    };
    let good = Options { qp: QpMethod::Stagewise, ..scheme(Scheme::Rti, Level::D0, 1) };
    assert!(refused(good.clone(), "1st").contains("digits"));
    assert!(refused(good.clone(), "").contains("letters"));
    assert!(refused(Options { qp: QpMethod::Condensing, ..good.clone() }, "c").contains("stagewise"));
    assert!(refused(Options { level: Level::D2, ..good.clone() }, "c").contains("d0"));
    assert!(refused(Options { scheme: Scheme::Asc, ..good.clone() }, "c").contains("as_rti"));
    let mut c = Nmpc::new(&case.ocp, &good).unwrap();
    let unwritable = c.write_c("c", CReal::Double).unwrap().write(Path::new("/dev/null/here"));
    assert!(matches!(unwritable, Err(Error::Range(what)) if what.contains("cannot be written")));
}
