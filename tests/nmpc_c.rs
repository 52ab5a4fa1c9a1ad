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
use switchback::ocp::{CostAt, Norm, Ocp};
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

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
    let known = [
        "sin", "cos", "sincos", "sqrt", "pow", "exp", "sinf", "cosf", "sincosf", "sqrtf", "memcpy", "memset", "memmove",
    ];
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

/// A mass against a load, which is a parameter; the place it is to be at is a reference.
#[test]
fn references_and_parameters_at_run_time() {
    let g = Graph::new();
    let dims = Dims { x: 2, u: 1, p: 1 };
    let f: SharedFunction = Arc::new(g.function("f", dims, &[g.x(1), g.u(0) - g.p(0)]).unwrap());
    let all: SharedFunction = Arc::new(g.function("all", dims, &[g.x(0), g.x(1), g.u(0)]).unwrap());
    let mut system = System::new(2, 1, 1).unwrap();
    system.set_f0(f).unwrap();
    let mut ocp = Ocp::new(&system, 2.0, 20, &Settings::default()).unwrap();
    ocp.add_least_squares(all, &[1.0, 0.1, 0.02], &[0.0; 3], CostAt::Running).unwrap();
    ocp.set_u_bounds(&[-1.0], &[1.0]).unwrap();
    ocp.set_params(&[0.1]).unwrap();
    let explicit = Options { family: Some(Family::Explicit), n_s: 4, steps: 1, ..Options::default() };
    let mut c = Nmpc::new(&ocp, &Options { qp: QpMethod::Stagewise, shift: true, ..explicit }).unwrap();
    let dir = folder("set");
    c.write_c("set", CReal::Double).unwrap().write(&dir).unwrap();
    // what both do: at sample 3 another place between preparation and feedback, at sample 5 other bounds, at sample 7 another load, at
    // sample 10 a measurement that is none
    let driver = r#"
#include "set.h"
#include <math.h>
#include <stdio.h>
int main(void) {
    const double y[] = {0.5, 0.0, 0.0}, p[] = {-0.2}, bad[] = {NAN, 0.0, 0.0}, lower[] = {-0.3}, upper[] = {0.4};
    int k;
    for (k = 0; k < 12; k++) {
        double x[] = {0.3 * cos(k), 0.1 * sin(3.0 * k)}, u;
        if (k == 7 && (!set_set_params(p) || set_set_params(bad)))
            return 1;
        set_prepare();
        if (k == 3 && (!set_set_reference(0, y) || set_set_reference(0, bad) || set_set_reference(1, y)))
            return 2;
        if (k == 5 && (!set_set_control_bounds(lower, upper) || set_set_control_bounds(upper, lower) || set_set_control_bounds(bad, upper)))
            return 3;
        if (k == 10)
            x[0] = NAN;
        printf("%d ", set_feedback(x, &u));
        printf("%.17g\n", u);
    }
    return 0;
}
"#;
    std::fs::write(dir.join("driver.c"), driver).unwrap();
    run(&dir, "make", &["-s", "set.o"]);
    run(&dir, "cc", &["-std=c99", "-Wall", "-Werror", "driver.c", "set.o", "-o", "driver", "-lm"]);
    let said = run(&dir, "./driver", &[]);
    std::fs::remove_dir_all(&dir).unwrap();
    let (mut lines, mut limited) = (said.lines(), 0);
    for k in 0..12 {
        let time = f64::from(k);
        let mut x = [0.3 * time.cos(), 0.1 * (3.0 * time).sin()];
        if k == 7 {
            c.set_params(&[-0.2]).unwrap();
        }
        c.prepare(None).unwrap();
        if k == 3 {
            c.set_references(0, &[0.5, 0.0, 0.0]).unwrap();
        }
        if k == 5 {
            c.set_control_bounds(&[-0.3], &[0.4]).unwrap();
        }
        if k == 10 {
            x[0] = f64::NAN;
        }
        let mut u = [0.0];
        let source = c.feedback(&x, &mut u).unwrap().source;
        let (in_c, control) = lines.next().unwrap().split_once(' ').unwrap();
        assert_eq!(in_c, (source as usize).to_string(), "{k}");
        let control: f64 = control.trim().parse().unwrap();
        limited += usize::from(k >= 5 && (control == -0.3 || control == 0.4));
        assert!((control - u[0]).abs() < 1e-12, "{k}: {control} {}", u[0]);
    }
    assert!(limited > 0, "no control is at the new bounds");
}

/// A program that steps the unit for co-simulation through the recorded loop.
const DRIVER: &str = r#"#include "unit_fmu.c"
#include "unit_record.h"

#include <stdio.h>

int main(void) {
    fmi2ValueReference of_x[NX], of_u[NU];
    double x[NX], u[NU], worst = 0.0;
    int i, k;
    fmi2Component c = fmi2Instantiate("one", fmi2CoSimulation, GUID, "", NULL, 0, 0);
    if (!c || fmi2Instantiate("two", fmi2CoSimulation, GUID, "", NULL, 0, 0)) {
        return 2;
    }
    for (i = 0; i < NX; i++) {
        of_x[i] = (fmi2ValueReference)i;
    }
    for (i = 0; i < NU; i++) {
        of_u[i] = (fmi2ValueReference)(FIRST_U + i);
    }
    for (k = 0; k < SAMPLES; k++) {
        int source;
        const fmi2ValueReference zero = 0;
        for (i = 0; i < NX; i++) {
            x[i] = RECORD_X[k * NX + i];
        }
        if (fmi2SetReal(c, of_x, NX, x) != fmi2OK || fmi2DoStep(c, k * SAMPLE, SAMPLE, 1) != fmi2OK ||
            fmi2GetReal(c, of_u, NU, u) != fmi2OK || fmi2GetInteger(c, &zero, 1, &source) != fmi2OK || source != RECORD_SOURCE[k]) {
            return 3;
        }
        for (i = 0; i < NU; i++) {
            worst = fmax(worst, fabs(u[i] - RECORD_U[k * NU + i]));
        }
    }
    if (fmi2SetReal(c, of_u, NU, u) != fmi2Error || fmi2DoStep(c, 0.0, -1.0, 1) != fmi2Error || fmi2CancelStep(c) != fmi2Error) {
        return 4;
    }
    x[0] = NAN;
    k = fmi2SetReal(c, of_x, 1, x) == fmi2OK && fmi2DoStep(c, SAMPLES * SAMPLE, SAMPLE, 1) == fmi2OK && fmi2GetReal(c, of_u, NU, u) == fmi2OK;
    fmi2FreeInstance(c);
    printf("%s\n", k && isfinite(u[0]) && worst <= 1e-9 * RECORD_LARGEST ? "the same" : "another");
    return 0;
}
"#;

/// The unit for co-simulation compiles strictly, gives the recorded controls, and says what it does not know.
#[test]
fn a_unit_for_co_simulation() {
    let mut c = controller(&pendulum(), Scheme::Rti, true);
    let dir = folder("unit");
    c.write_c("unit", CReal::Double).unwrap().write(&dir).unwrap();
    std::fs::write(dir.join("driver.c"), DRIVER).unwrap();
    run(&dir, "make", &["-s", "unit.o"]);
    let strict = "-std=c99 -Wall -Wextra -Wpedantic -Werror -O1 driver.c unit.o -o driver -lm";
    run(&dir, "cc", &strict.split(' ').collect::<Vec<_>>());
    assert_eq!(run(&dir, "./driver", &[]), "the same\n");
    std::fs::remove_dir_all(&dir).unwrap();
}
