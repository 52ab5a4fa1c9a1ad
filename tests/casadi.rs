//! Code that CasADi generated, compiled and loaded: the same problems as by hand, every form, every refusal.

#[path = "../examples/report/models.rs"]
mod models;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use models::{OSCILLATOR_X0, PI, SLIDING_QT, SLIDING_X0};
use switchback::error::{Error, Result};
use switchback::func::casadi::{self, Symbols};
use switchback::func::{check_derivatives, Callback, CheckSettings, Dims, EvalError, Function, Point};
use switchback::nlp::{Control, Outcome};
use switchback::ocp::Ocp;
use switchback::settings::Settings;
use switchback::sim::Simulator;
use switchback::system::{SharedFunction, System};

/// A shared library of C code, in a folder of its own for every test.
fn compile(what: &str, source: &Path, flags: &[&str]) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("casadi");
    std::fs::create_dir_all(&dir).unwrap();
    let library = dir.join(format!("{what}.so"));
    let cc = Command::new("cc")
        .args(["-O1", "-fPIC", "-shared", "-o"])
        .arg(&library)
        .args(flags)
        .arg(source)
        .arg("-lm")
        .output()
        .unwrap_or_else(|e| panic!("cc: {e}"));
    assert!(cc.status.success(), "{}", String::from_utf8_lossy(&cc.stderr));
    library
}

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/casadi").join(file)
}

const NARROW: &str = "-Dcasadi_int=int";

/// Code of both generations of CasADi with integers of both widths.
fn variants(what: &str, test: &str) -> Vec<(String, PathBuf)> {
    let mut out = Vec::new();
    for version in ["36", "38"] {
        for flags in [&[][..], &[NARROW]] {
            let name = format!("{test}_{what}_{version}_{}", if flags.is_empty() { 64 } else { 32 });
            let library = compile(&name, &data(&format!("{what}_{version}.c")), flags);
            out.push((name, library));
        }
    }
    out
}

fn load(library: &Path, name: &str, dims: Dims) -> Result<Callback> {
    unsafe { casadi::from_library(library, name, dims, None) }
}

fn shared(library: &Path, name: &str, dims: Dims) -> SharedFunction {
    let f = load(library, name, dims).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(!f.jacobian_is_approximate() && !f.hessian_is_approximate(), "{name}");
    Arc::new(f)
}

#[test]
fn the_oscillator() {
    let simulate = |s: &System| {
        let mut sim = Simulator::new(s, &Settings { n_s: 3, ..Settings::default() }).unwrap();
        sim.set_state(0.0, &OSCILLATOR_X0).unwrap();
        let r = sim.run(PI / 2.0, 10, &mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved);
        (sim.state().to_vec(), r.trajectory.switches.iter().map(|s| s.t).collect::<Vec<_>>())
    };
    let by_hand = simulate(&models::oscillator());
    for (what, library) in variants("models", "osc") {
        let mut s = System::new(2, 0, 0).unwrap();
        let (modes, c) = (shared(&library, "osc_F", s.dims()), shared(&library, "osc_c", s.dims()));
        models::add_sides(&mut s, &[0, 1], modes, c);
        let found = simulate(&s);
        assert_eq!(found.1.len(), 1);
        for (a, b) in found.0.iter().chain(&found.1).zip(by_hand.0.iter().chain(&by_hand.1)) {
            assert!((a - b).abs() < 1e-12, "{what}: {found:?} {by_hand:?}");
        }
    }
}

#[test]
fn the_sliding_mode_problem() {
    let set = Settings { n_fe: 4, n_s: 3, ..Settings::default() };
    let mut by_hand = models::sliding_ocp(&set);
    let by_hand = by_hand.solve(&mut Control::default()).unwrap();
    for (what, library) in variants("models", "sliding") {
        let d = Dims { x: 4, u: 2, p: 0 };
        let get = |name: &str| shared(&library, name, d);
        let mut s = System::new(4, 2, 0).unwrap();
        s.set_f0(get("f0")).unwrap();
        models::add_sides(&mut s, &[0], get("sides"), get("c1"));
        models::add_sides(&mut s, &[1], get("sides"), get("c2"));
        let mut o = Ocp::new(&s, 4.0, 6, &set).unwrap();
        o.set_lagrange(get("L")).unwrap();
        o.set_x0(&SLIDING_X0).unwrap();
        let inf = f64::INFINITY;
        o.set_x_bounds(&[-inf, -inf, -2.0, -2.0], &[inf, inf, 2.0, 2.0]).unwrap();
        o.set_u_bounds(&[-10.0; 2], &[10.0; 2]).unwrap();
        o.add_terminal(get("e"), &SLIDING_QT, &SLIDING_QT).unwrap();
        let r = o.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "{what}");
        assert!((r.cost - by_hand.cost).abs() < 1e-10 * by_hand.cost, "{what}: {} {}", r.cost, by_hand.cost);
        for (u, v) in r.controls.iter().zip(&by_hand.controls) {
            assert!((u - v).abs() < 1e-8, "{what}: {u} {v}");
        }
    }
}

const D: Dims = Dims { x: 2, u: 1, p: 1 };
const AT: Point = Point { t: 0.4, x: &[0.7, -1.3], u: &[0.9], p: &[5.0] };

/// Value, dense Jacobian and dense upper Hessian of `w · (x0 u + sin(x1 t), x1², 0)`; columns x0 x1 u p t.
fn exact(w: [f64; 3]) -> (Vec<f64>, [[f64; 5]; 3], [[f64; 5]; 5]) {
    let (x0, x1, u, t) = (0.7, -1.3, 0.9, 0.4);
    let (s, c) = (f64::sin(x1 * t), f64::cos(x1 * t));
    let mut h = [[0.0; 5]; 5];
    h[0][2] = w[0];
    h[1][1] = -w[0] * s * t * t + 2.0 * w[1];
    h[1][4] = w[0] * (c - s * x1 * t);
    h[4][4] = -w[0] * s * x1 * x1;
    let j = [[u, c * t, x0, 0.0, c * x1], [0.0, 2.0 * x1, 0.0, 0.0, 0.0], [0.0; 5]];
    (vec![x0 * u + s, x1 * x1, 0.0], j, h)
}

fn assert_values(f: &dyn Function, what: &str, tol: [f64; 2]) {
    let w = [0.8, -1.1, 2.0];
    let (value, jac, hess) = exact(w);
    let mut work = vec![0.0; f.work_len()];
    let mut out = [7.0; 3];
    f.value(&AT, &mut out, &mut work).unwrap();
    assert_eq!(out.to_vec(), value, "{what}");
    let near = |found: f64, exact: f64, tol: f64, r: usize, c: usize| {
        assert!((found - exact).abs() <= tol, "{what}: ({r}, {c}) is {found}, exact {exact}");
    };
    let mut v = vec![7.0; f.jac_pattern().nnz()];
    f.jacobian(&AT, &mut v, &mut work).unwrap();
    for (r, row) in jac.iter().enumerate() {
        for (c, &exact) in row.iter().enumerate() {
            near(f.jac_pattern().get(r, c).map_or(0.0, |k| v[k]), exact, tol[0], r, c);
        }
    }
    let mut v = vec![7.0; f.hess_pattern().nnz()];
    f.hessian(&AT, &w, &mut v, &mut work).unwrap();
    assert!(f.hess_pattern().is_upper());
    for (r, row) in hess.iter().enumerate() {
        for (c, &exact) in row.iter().enumerate().skip(r) {
            near(f.hess_pattern().get(r, c).map_or(0.0, |k| v[k]), exact, tol[1], r, c);
        }
    }
}

#[test]
fn every_form_of_derivatives() {
    for (what, library) in variants("forms", "forms") {
        for (name, approximate, tol) in [
            ("one", [false, false], [1e-15; 2]),
            ("two", [false, false], [1e-15; 2]),
            ("pattern", [true, true], [1e-9, 1e-5]),
            ("bare", [true, true], [1e-9, 1e-5]),
        ] {
            let f = load(&library, name, D).unwrap();
            let what = format!("{what} {name}");
            assert_eq!([f.jacobian_is_approximate(), f.hessian_is_approximate()], approximate, "{what}");
            assert_values(&f, &what, tol);
            // Exact patterns where they are known; nothing for p, of which the function knows nothing.
            let nnz = if name == "bare" { 12 } else { 5 };
            assert_eq!((f.jac_pattern().nnz(), f.jac_pattern().rows(3).len()), (nnz, 0), "{what}");
            let report = check_derivatives(&f, &AT, &CheckSettings::default()).unwrap();
            assert!(report.passed(), "{what}: {report}");
        }
        let named = unsafe { casadi::from_library(&library, "unnamed", D, Some("t, x u")) }.unwrap();
        assert_values(&named, "unnamed", [1e-9, 1e-5]);

        // A Jacobian made of the value, a solver inside.
        let d = Dims { x: 2, u: 0, p: 0 };
        let f = load(&library, "wants", d).unwrap();
        let (mut work, mut jac) = (vec![0.0; f.work_len()], [0.0; 2]);
        let at = Point { t: 0.0, x: &[0.5, -1.0], u: &[], p: &[] };
        f.jacobian(&at, &mut jac, &mut work).unwrap();
        assert_eq!(jac, [f64::exp(0.5), f64::exp(-1.0)]);
        let f = load(&library, "root", Dims { x: 1, u: 0, p: 0 }).unwrap();
        let (mut work, mut y, mut jac) = (vec![0.0; f.work_len()], [0.0], [0.0]);
        let at = Point { t: 0.0, x: &[10.0], u: &[], p: &[] };
        f.value(&at, &mut y, &mut work).unwrap();
        f.jacobian(&at, &mut jac, &mut work).unwrap();
        assert!((y[0] - 2.0).abs() < 1e-8 && (jac[0] - 1.0 / 13.0).abs() < 1e-8, "{y:?} {jac:?}");
        assert!(!f.jacobian_is_approximate() && f.hessian_is_approximate());
    }
}

fn message<T>(r: Result<T>) -> String {
    match r {
        Ok(_) => panic!("no error"),
        Err(e) => e.to_string(),
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let library = compile("refusals", &data("forms_38.c"), &[]);
    let load =
        |name: &str, d: Dims, inputs: Option<&str>| message(unsafe { casadi::from_library(&library, name, d, inputs) });
    assert!(load("nothing", D, None).contains("has no function 'nothing'"));
    assert!(load("", D, None).contains("has no function ''"));
    assert!(load("a\0b", D, None).contains("has no function"));
    assert!(load("unnamed", D, None).contains("named 'i0'"));
    assert!(load("unnamed", D, Some("t x")).contains("2 inputs are listed, the function has 3"));
    assert!(load("unnamed", D, Some("t x x")).contains("a second time"));
    assert!(load("unnamed", D, Some("t x y")).contains("named 'y'"));
    assert!(load("one", Dims { x: 3, ..D }, None).contains("has 2 entries, expected 3"));

    let float = compile("float", &data("forms_38.c"), &["-Dcasadi_real=float"]);
    assert!(matches!(self::load(&float, "one", D), Err(Error::Unsupported(s)) if s.contains("double")));
    assert!(matches!(self::load(Path::new("/no/such.so"), "one", D), Err(Error::Library(_))));
}

/// A function of two states in C whose lines can be replaced.
const SOURCE: &str = r#"
#include <math.h>
typedef long long casadi_int;
typedef double real;
static const casadi_int s_in[] = {2, 1, 1}, s_out[] = {2, 1, 0, 2};
static int out_there, released, counted;
int f(const real **arg, real **res, casadi_int *iw, real *w, int mem) {
    if (res[0]) { res[0][0] = arg[0] ? sqrt(arg[0][0]) : 0; res[0][1] = arg[0] ? arg[0][1] : 0; }
    iw[2] = 1; w[3] = 1; arg[3] = 0; res[2] = 0; (void)mem;
    return arg[0] && arg[0][1] < -5 ? -1 : 0;
}
casadi_int f_n_in(void) { return 1; }
casadi_int f_n_out(void) { return 1; }
const char *f_name_in(casadi_int i) { return i == 0 ? "x" : 0; }
const casadi_int *f_sparsity_in(casadi_int i) { return i == 0 ? s_in : 0; }
const casadi_int *f_sparsity_out(casadi_int i) { return i == 0 ? s_out : 0; }
int f_work(casadi_int *a, casadi_int *r, casadi_int *iw, casadi_int *w) { *a = 4; *r = 3; *iw = 3; *w = 4; return 0; }
int f_checkout(void) { return out_there++; }
void f_release(int mem) { (void)mem; released++; }
void f_incref(void) { counted++; }
void f_decref(void) { counted--; }
int balance(void) { return out_there == released && counted == 0 && released > 1; }
"#;

fn broken(what: &str, replace: &[(&str, &str)]) -> Result<Callback> {
    let mut source = SOURCE.to_owned();
    for (old, new) in replace {
        assert!(source.contains(old), "{old}");
        source = source.replace(old, new);
    }
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("casadi");
    std::fs::create_dir_all(&dir).unwrap();
    let file = dir.join(format!("{what}.c"));
    std::fs::write(&file, source).unwrap();
    load(&compile(what, &file, &[]), "f", Dims { x: 2, u: 0, p: 0 })
}

#[test]
fn broken_objects_are_refused() {
    let patterns = [
        ("dense form with another number", "{2, 1, 7, 2}", "starts at 7"),
        ("negative shape", "{-2, 1, 0, 2}", "its shape is -2 x 1"),
        ("huge shape", "{2000000000, 2000000000, 0}", "its shape is"),
        ("more entries than there is memory", "{46340, 46340, 1}", "its shape is"),
        ("decreasing columns", "{2, 2, 0, 2, 1, 0, 1}", "column 1 ends at 1"),
        ("too many entries", "{2, 1, 0, 3, 0, 1, 2}", "column 0 ends at 3"),
        ("row outside", "{3, 1, 0, 2, 0, 3}", "pattern of output 0 is broken"),
        ("negative row", "{3, 1, 0, 2, -1, 1}", "row 0 is negative"),
        ("unsorted rows", "{3, 1, 0, 2, 1, 0}", "pattern of output 0 is broken"),
    ];
    for (k, (what, pattern, expected)) in patterns.into_iter().enumerate() {
        let text = message(broken(&format!("pattern{k}"), &[("{2, 1, 0, 2}", pattern)]));
        assert!(text.contains(expected), "{what}: {text}");
    }
    let lines = [
        ("n_in(void) { return 1; }", "n_in(void) { return -1; }", "f_n_in says -1"),
        ("n_out(void) { return 1; }", "n_out(void) { return 2; }", "output 1 is broken: it is missing"),
        ("? s_in : 0", "? 0 : s_in", "input 0 is broken: it is missing"),
        ("f_sparsity_in(", "g_sparsity_in(", "there is no f_sparsity_in"),
        ("f_n_in(", "g_n_in(", "there is no f_n_in"),
        ("*w = 4; return 0", "*w = -4; return 0", "f_work failed, or says lengths that are none"),
        ("*w = 4; return 0", "*w = 4; return 1", "f_work failed"),
        ("*w = 4; return 0", "*w = 1LL << 40; return 0", "f_work failed"),
        ("if (res[0])", "if (mem > 99)", "writes no outputs"),
        ("{2, 1, 1}", "{2, 1, 0, 1, 1}", "input 0 is sparse"),
        ("return out_there++", "return -1", "f_checkout failed with -1"),
        ("typedef double real", "typedef float real", "double precision"),
        (
            "typedef long long casadi_int;",
            "typedef long long casadi_int; int f_casadi_int_size(void) { return 2; }",
            "2 bytes",
        ),
        (
            "typedef long long casadi_int;",
            "typedef long long casadi_int; int f_casadi_int_size(void) { return 4; }",
            "writes others",
        ),
        (
            "typedef long long casadi_int;",
            "typedef long long casadi_int; int f_casadi_real_size(void) { return 4; }",
            "4 bytes",
        ),
    ];
    for (k, (old, new, expected)) in lines.into_iter().enumerate() {
        let text = message(broken(&format!("line{k}"), &[(old, new)]));
        assert!(text.contains(expected), "{new}: {text}");
    }
    // Derivatives of another shape.
    let tail = |of: &str, outputs: &str| {
        format!(
            "int balance(void); static const casadi_int s_d[] = {outputs};\n\
             int {of}(const real **a, real **r, casadi_int *iw, real *w, int m) {{ (void)a; (void)r; (void)iw; (void)w; \
             (void)m; return 1; }}\n\
             casadi_int {of}_n_in(void) {{ return 2; }} casadi_int {of}_n_out(void) {{ return 1; }}\n\
             const casadi_int *{of}_sparsity_in(casadi_int i) {{ (void)i; return s_in; }}\n\
             const casadi_int *{of}_sparsity_out(casadi_int i) {{ (void)i; return s_d; }}\nint balance("
        )
    };
    let text = message(broken("jac_shape", &[("int balance(", &tail("jac_f", "{3, 2, 1}"))]));
    assert!(text.contains("the Jacobian is 3 x 2, expected 2 x 2"), "{text}");
    let text = message(broken("hess_shape", &[("int balance(", &tail("f_hess", "{2, 1, 1}"))]));
    assert!(text.contains("the Hessian is 2 x 1, expected 2 x 2"), "{text}");
}

#[test]
fn narrow_integers_are_told_without_work_and_without_declarations() {
    for (k, replace) in [("f_work(", "g_work("), ("nothing", "")].into_iter().enumerate() {
        let mut lines = vec![("typedef long long casadi_int", "typedef int casadi_int")];
        if k == 0 {
            // Without lengths there is no memory to write to.
            lines.extend([replace, ("iw[2] = 1; w[3] = 1; arg[3] = 0; res[2] = 0;", "(void)iw; (void)w;")]);
        }
        let f = broken(&format!("narrow{k}"), &lines).unwrap();
        let (mut out, mut work) = ([0.0; 2], vec![0.0; f.work_len()]);
        f.value(&Point { t: 0.0, x: &[4.0, 3.0], u: &[], p: &[] }, &mut out, &mut work).unwrap();
        assert_eq!(out, [2.0, 3.0]);
    }
}

#[test]
fn failures_and_memory() {
    let library = compile(
        "memory",
        &{
            let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("casadi");
            std::fs::create_dir_all(&dir).unwrap();
            let file = dir.join("memory.c");
            std::fs::write(&file, SOURCE).unwrap();
            file
        },
        &[],
    );
    // Opened a second time, by this test.
    let handle = unsafe { libc::dlopen(format!("{}\0", library.display()).as_ptr().cast(), libc::RTLD_NOW) };
    assert!(!handle.is_null());
    let f: SharedFunction = Arc::new(load(&library, "f", Dims { x: 2, u: 0, p: 0 }).unwrap());
    let threads: Vec<_> = (0..4)
        .map(|k| {
            let f = f.clone();
            std::thread::spawn(move || {
                let (mut out, mut work) = ([0.0; 2], vec![0.0; f.work_len()]);
                for i in 0..1000 {
                    let x = [f64::from(i), f64::from(k)];
                    f.value(&Point { t: 0.0, x: &x, u: &[], p: &[] }, &mut out, &mut work).unwrap();
                    assert_eq!(out, [x[0].sqrt(), x[1]]);
                }
            })
        })
        .collect();
    threads.into_iter().for_each(|t| t.join().unwrap());
    let (mut out, mut work) = ([0.0; 2], vec![0.0; f.work_len()]);
    for x in [[-1.0, 0.0], [1.0, -6.0]] {
        let r = f.value(&Point { t: 0.0, x: &x, u: &[], p: &[] }, &mut out, &mut work);
        assert_eq!(r, Err(EvalError::Recoverable), "{x:?}");
    }
    drop(f);
    let balance = unsafe { libc::dlsym(handle, c"balance".as_ptr()) };
    assert!(!balance.is_null());
    let balance = unsafe { std::mem::transmute::<*mut libc::c_void, extern "C" fn() -> i32>(balance) };
    assert_eq!(balance(), 1);
}

#[test]
fn addresses_instead_of_names() {
    assert!(message(unsafe { casadi::from_symbols("f", Symbols::default(), None, None, D, None) })
        .contains("there is no f"));
}
