//! Expressions: evaluation in all its forms, external functions, hostile input.

use std::process::Command;
use std::sync::{Arc, OnceLock, Weak};

use switchback::error::Error;
use switchback::expr::{
    write_c, write_c_first, Block, CReal, Dag, Expr, ExprFunction, Graph, Id, Piecewise, Tape, Unary, CYCLE_CODE, LANES,
};
use switchback::func::{check_derivatives, Callback, CheckSettings, Dims, EvalError, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;

const DIMS: Dims = Dims { x: 3, u: 1, p: 1 };
const X: [f64; 3] = [0.7, -1.3, 2.1];

fn at() -> Point<'static> {
    Point { t: 0.4, x: &X, u: &[0.9], p: &[1.7] }
}

/// Everything there is: elementary functions, powers, tables, a linear system.
fn model(g: &Graph) -> Vec<Expr<'_>> {
    let [x, y, z] = [0, 1, 2].map(|i| g.x(i));
    let (u, p, t) = (g.u(0), g.p(0), g.t());
    let spline = Piecewise::spline(&[-2.0, 0.0, 0.5, 1.5, 4.0], &[1.0, -1.0, 0.3, 2.0, 0.0]).unwrap();
    let steps = Piecewise::steps(&[0.0, 1.0], &[2.0, -1.5, 4.0]).unwrap();
    let m = [z + 2.0, x * y, x * y, u.exp()];
    let a = g.solve(&m, &[t.sin(), p]).unwrap();
    vec![
        (x * y).sin() + z.powi(3) / (1.0 + u * u) - p.sqrt() * 0.1,
        g.piecewise(&spline, x + 0.1 * t) * y.cosh() + g.piecewise(&steps, t) * x,
        a[0] * a[1] + y.atan2(z) + (x / 2.0).asin() + (x / 2.0).acos() * y + y.erf() + z.tanh() * y.sinh(),
        z.powf(p) + (z.ln() * u).exp() - y.tan().atan() * t.cos() + y.powi(-3),
        a[1] - 3.0 * z + 1.0,
    ]
}

fn function(name: &str) -> ExprFunction {
    let g = Graph::new();
    g.function(name, DIMS, &model(&g)).unwrap()
}

/// Values, Jacobian and Hessian, one after the other.
fn all(f: &dyn Function, at: &Point, weights: &[f64]) -> Vec<f64> {
    let mut work = vec![f64::NAN; f.work_len()];
    let mut parts = [vec![0.0; f.n_out()], vec![0.0; f.jac_pattern().nnz()], vec![0.0; f.hess_pattern().nnz()]];
    f.value(at, &mut parts[0], &mut work).unwrap();
    f.jacobian(at, &mut parts[1], &mut work).unwrap();
    f.hessian(at, weights, &mut parts[2], &mut work).unwrap();
    parts.concat()
}

const WEIGHTS: [f64; 5] = [1.0, -0.5, 0.3, 2.0, -1.0];

#[test]
fn derivatives_agree_with_differences() {
    let settings = CheckSettings { parameters: true, ..Default::default() };
    let r = check_derivatives(&function("f"), &at(), &settings).unwrap();
    assert!(r.passed(), "{r}");
    assert!(r.n_compared > 40);
}

#[test]
fn batches_give_the_bits_of_single_points() {
    let f = function("f");
    let n = 2 * LANES + 3;
    let n_in = DIMS.n_in();
    let inputs: Vec<f64> = (0..(n_in + 5) * n).map(|k| 0.6 + 0.9 * ((k * k) as f64).sin().abs()).collect();
    let mut work = f.batch_work();
    let tapes: [(&Tape, usize); 3] = [(f.value_tape(), 0), (f.jacobian_tape(), 0), (f.hessian_tape(), 5)];
    for (tape, n_weights) in tapes {
        let mut out = vec![0.0; tape.n_out() * n];
        tape.run_batch(n, &inputs[..(n_in + n_weights) * n], &mut out, &mut work).unwrap();
        let mut scalar = vec![0.0; tape.work_len()];
        for k in 0..n {
            let z: Vec<f64> = (0..n_in + n_weights).map(|j| inputs[j * n + k]).collect();
            let point = Point { t: z[5], x: &z[..3], u: &z[3..4], p: &z[4..5] };
            let mut one = vec![0.0; tape.n_out()];
            tape.run(&point, &z[n_in..], &mut one, &mut scalar).unwrap();
            for (i, v) in one.iter().enumerate() {
                assert_eq!(v.to_bits(), out[i * n + k].to_bits(), "result {i} of point {k}");
            }
        }
    }
}

#[test]
fn parts_are_evaluated_alone() {
    let g = Graph::new();
    let (x, y, z) = (g.x(0), g.x(1), g.x(2));
    // The second part is not defined at the point.
    let outputs = g.ids(&[x * y, z.sin(), (-x).ln(), z, y, x * x * z]);
    let f = ExprFunction::with_parts("f", &mut g.dag(), DIMS, &outputs, 2).unwrap();
    let mut work = vec![f64::NAN; f.work_len()];
    let (mut value, mut jac) = (vec![0.0; 6], vec![0.0; f.jac_pattern().nnz()]);
    assert_eq!(f.value(&at(), &mut value, &mut work), Err(EvalError::Recoverable));
    assert_eq!(f.value_rows(&at(), 2..4, &mut value, &mut work), Err(EvalError::Recoverable));
    for rows in [0..2, 4..6] {
        f.value_rows(&at(), rows.clone(), &mut value, &mut work).unwrap();
        f.jacobian_rows(&at(), rows, &mut jac, &mut work).unwrap();
    }
    assert_eq!([value[0], value[1], value[4], value[5]], [X[0] * X[1], X[2].sin(), X[1], X[0] * X[0] * X[2]]);
    let entry = |i, j| jac[f.jac_pattern().get(i, j).unwrap()];
    assert_eq!([entry(0, 0), entry(1, 2), entry(4, 1), entry(5, 0)], [X[1], X[2].cos(), 1.0, 2.0 * X[0] * X[2]]);
}

#[test]
fn affine_and_constant_functions_are_known() {
    let g = Graph::new();
    let (x, u, p) = (g.x(0), g.u(0), g.p(0));
    let f = |e: Expr| g.function("f", DIMS, &[e]).unwrap();
    let is = |e: Expr| (f(e).is_constant(), f(e).is_affine());
    assert_eq!(is((x + 1.0) - x), (true, true));
    assert_eq!(is(2.0 * x - u / 3.0 + p), (false, true));
    assert_eq!(is((x + u) * 2.0 - g.t()), (false, true));
    assert_eq!(is(x * x / x), (false, true));
    assert_eq!(is(p * x), (false, false));
}

#[test]
fn registers_are_used_again() {
    let g = Graph::new();
    let mut e = g.x(0);
    for k in 0..1000 {
        e = (e * g.x(1) + f64::from(k % 7)).sin();
    }
    let tape = Tape::new(&g.dag(), DIMS, 0, &[e.id()]).unwrap();
    // Two inputs, one value that is alive at a time.
    assert_eq!(tape.work_len(), 2 + 1);
    assert!(tape.len() > 2500);
}

#[test]
fn the_same_calls_give_the_same_program() {
    let (a, b) = (function("f"), function("f"));
    let bits = |f: &ExprFunction| all(f, &at(), &WEIGHTS).iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&a), bits(&b));
    assert_eq!(write_c(&[&a]).unwrap(), write_c(&[&b]).unwrap());
}

#[test]
fn generated_c_gives_the_same_numbers() {
    assert_generated_c(&function("model"), "expr_c", "");
}

/// The external function of these tests in C, as the generated declarations ask for it.
const EXTERNAL: &str = "
int ext_value(double t, const double *x, const double *u, const double *p, double *out) {
    (void)t; (void)u; (void)p;
    out[0] = x[0] * x[0] * sin(x[1]);
    out[1] = x[0] + x[1];
    return x[0] > 9 ? -3 : 0;
}
int ext_jacobian(double t, const double *x, const double *u, const double *p, double *out) {
    (void)t; (void)u; (void)p;
    out[0] = 2 * x[0] * sin(x[1]);
    out[1] = out[3] = 1;
    out[2] = x[0] * x[0] * cos(x[1]);
    return 0;
}
int ext_hessian(double t, const double *x, const double *u, const double *p, const double *w, double *out) {
    (void)t; (void)u; (void)p;
    out[0] = w[0] * 2 * sin(x[1]);
    out[1] = w[0] * 2 * x[0] * cos(x[1]);
    out[2] = -w[0] * x[0] * x[0] * sin(x[1]);
    return 0;
}
";

#[test]
fn generated_c_calls_external_functions() {
    let g = Graph::new();
    let ext = external();
    let once = g.call(&ext, &[g.x(0) * g.u(0), g.x(1), g.t()]).unwrap();
    let twice = g.call(&ext, &[once[0], once[1] * g.p(0), g.t()]).unwrap();
    let outputs = [once[0], once[1].sin(), twice[0], twice[1] * g.x(2), g.x(2)];
    let f = g.function("model", DIMS, &outputs).unwrap();
    assert_generated_c(&f, "expr_c_external", EXTERNAL);
    let code = write_c(&[&f]).unwrap();
    assert_eq!(code.matches("extern int ext_value(").count(), 1);
    assert!(code.contains("ext_jacobian_row_idx[] = {0, 1, 0, 1}"), "{code}");
    // What is not called is not asked for.
    let f = g.function("affine", DIMS, &[g.x(0)]).unwrap();
    assert!(!write_c(&[&f]).unwrap().contains("extern"));
}

#[test]
fn generated_c_solves_inner_problems() {
    let g = Graph::new();
    let [x, y, z] = [0, 1, 2].map(|i| g.x(i));
    let u = g.u(0);
    let outputs = {
        let mut d = g.dag();
        // w³ + w = v, once by itself and once within a least value
        let root = |d: &mut Dag, v: Id| {
            let w = d.unknowns(1);
            let cube = d.powi(w[0], 3);
            let sum = d.add(cube, w[0]);
            let equation = d.sub(sum, v);
            d.implicit(&[equation], &w, &[v]).unwrap()[0]
        };
        let product = d.mul(x.id(), y.id());
        let once = root(&mut d, product);
        let w = d.unknowns(2);
        let inside = root(&mut d, w[0]);
        let mut squares = [inside, w[1]].map(|v| d.powi(v, 2));
        let fourth = d.powi(inside, 4);
        squares[0] = d.add(squares[0], fourth);
        let both = d.mul(w[0], w[1]);
        let tenth = d.constant(0.1);
        let both = d.mul(tenth, both);
        let cost = d.add(squares[0], squares[1]);
        let cost = d.add(cost, both);
        let terms = [(w[0], y.id()), (w[1], z.id())].map(|(a, b)| d.mul(a, b));
        let cost = d.sub(cost, terms[0]);
        let cost = d.sub(cost, terms[1]);
        let (least, at) = d.inner_minimum(cost, &w, &[z.id(), y.id()]).unwrap();
        // an ellipse and a disc
        let way = d.unknowns(2);
        let [a, b] = [0, 1].map(|i| d.powi(way[i], 2));
        let four = d.constant(4.0);
        let wide = d.mul(four, a);
        let sum = [(wide, b), (a, b)].map(|(a, b)| d.add(a, b));
        let [long, round] = sum.map(|s| d.unary(Unary::Sqrt, s));
        let support = d.add(long, round);
        let between = [z.id(), u.id()];
        let (gap, normal) = d.signed_distance(&between, support, &way, &between, 2.0).unwrap();
        [once, least, at[1], gap, normal[0]]
    };
    let f = ExprFunction::new("model", &mut g.dag(), DIMS, &outputs).unwrap();
    assert_generated_c(&f, "expr_c_inner", "");
    let code = write_c(&[&f]).unwrap();
    // one function for the root that is there twice, and no memory but that of the stack
    assert!(code.contains("model_inner2_value(double") && !code.contains("model_inner3") && !code.contains("malloc"));
    // single precision has steps and halvings of its own
    let single = write_c_first(&[("model", &f)], CReal::Float).unwrap();
    assert!(single.contains("1.1920928955078125e-7f") && !single.contains("double"), "{single}");
}

#[test]
fn generated_c_of_inner_problems_agrees_at_random_points() {
    let g = Graph::new();
    let x = [0, 1, 2].map(|i| g.x(i).id());
    let f = {
        let mut d = g.dag();
        let w = d.unknowns(3);
        // the way from an ellipsoid, for points on all sides of it
        let squares: Vec<Id> = w.iter().map(|&w| d.powi(w, 2)).collect();
        let mut inside = d.constant(0.0);
        for (k, s) in squares.iter().enumerate() {
            let size = d.constant(0.3 + 0.4 * k as f64);
            let term = d.mul(size, *s);
            inside = d.add(inside, term);
        }
        let support = d.unary(Unary::Sqrt, inside);
        let (gap, normal) = d.signed_distance(&x, support, &w, &x, 1.0).unwrap();
        ExprFunction::new("model", &mut d, DIMS, &[gap, normal[0], normal[1], normal[2]]).unwrap()
    };
    let dir = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("expr_c_inner_random");
    std::fs::create_dir_all(&dir).unwrap();
    std::fs::write(dir.join("model.c"), write_c(&[&f]).unwrap()).unwrap();
    let (nj, nh) = (f.jac_pattern().nnz(), f.hess_pattern().nnz());
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        4.0 * ((state >> 11) as f64 / (1_u64 << 53) as f64) - 2.0
    };
    let points: Vec<[f64; 3]> = (0..200).map(|_| [random(), random(), random()]).collect();
    let rows: Vec<String> = points.iter().map(|p| format!("{{{:?}, {:?}, {:?}}}", p[0], p[1], p[2])).collect();
    let driver = format!(
        "#include \"model.c\"\n#include <stdio.h>\nstatic const double x[][3] = {{{}}};\nint main(void) {{\n\
         const double u[] = {{0.9}}, p[] = {{1.7}}, w[] = {{1.0, -0.5, 0.3, 2.0}};\n\
         static double out[{n}];\nint k, i;\nfor (k = 0; k < 200; k++) {{\n\
         int code = model_value(0.4, x[k], u, p, out) || model_jacobian(0.4, x[k], u, p, out + 4) || \
         model_hessian(0.4, x[k], u, p, w, out + {h});\n\
         printf(\"%d\\n\", code);\nfor (i = 0; i < {n}; i++) printf(\"%.17g\\n\", code ? 0.0 : out[i]);\n}}\nreturn 0;\n}}\n",
        rows.join(", "),
        n = 4 + nj + nh,
        h = 4 + nj,
    );
    std::fs::write(dir.join("driver.c"), driver).unwrap();
    let flags = ["-std=c99", "-O2", "-ffp-contract=off", "-o", "driver", "driver.c", "-lm"];
    assert!(Command::new("cc").args(flags).current_dir(&dir).status().unwrap().success());
    let result = Command::new(dir.join("driver")).output().unwrap();
    let text = String::from_utf8(result.stdout).unwrap();
    let mut numbers = text.lines().map(|l| l.parse::<f64>().unwrap());
    let (mut work, mut solved) = (vec![0.0; f.work_len()], 0);
    for x in &points {
        let at = Point { t: 0.4, x, u: &[0.9], p: &[1.7] };
        let mut exact = vec![0.0; 4 + nj + nh];
        let (value, rest) = exact.split_at_mut(4);
        let (jacobian, hessian) = rest.split_at_mut(nj);
        let fine = f.value(&at, value, &mut work).is_ok()
            && f.jacobian(&at, jacobian, &mut work).is_ok()
            && f.hessian(&at, &[1.0, -0.5, 0.3, 2.0], hessian, &mut work).is_ok();
        assert_eq!(numbers.next().unwrap() == 0.0, fine, "{x:?}");
        solved += usize::from(fine);
        let size = exact.iter().fold(1.0, |m: f64, v| v.abs().max(m));
        for v in exact {
            let got = numbers.next().unwrap();
            assert!(!fine || (got - v).abs() <= 1e-13 * size, "{x:?}: {got} {v}");
        }
    }
    assert!(solved > 150, "{solved}");
}

#[test]
fn least_values_of_costs_that_are_nearly_flat_or_bend_at_once() {
    let g = Graph::new();
    let [offset, end] = [g.x(0), g.x(1)].map(|e| e.id());
    let f = {
        let mut d = g.dag();
        let w = d.unknowns(1);
        // (w - nearest point of [-h, h])^2 + 1e-9 (w - 1)^2 + offset, with h = end: flat inside, and least just behind the end
        let clamp = Piecewise::lines(&[-1.0, 1.0], &[-1.0, 1.0]).unwrap();
        let share = d.div(w[0], end);
        let inside = d.piecewise(&clamp, share);
        let inside = d.mul(end, inside);
        let away = d.sub(w[0], inside);
        let one = d.constant(1.0);
        let off = d.sub(w[0], one);
        let squares = [away, off].map(|v| d.powi(v, 2));
        let weight = d.constant(1e-9);
        let tiny = d.mul(weight, squares[1]);
        let cost = d.add(squares[0], tiny);
        let cost = d.add(cost, offset);
        let start = d.constant(-0.3);
        let (least, at) = d.inner_minimum(cost, &w, &[start]).unwrap();
        ExprFunction::new("f", &mut d, DIMS, &[least, at[0]]).unwrap()
    };
    let mut work = vec![0.0; f.work_len()];
    for k in 0..200 {
        let (offset, h) = (10.0_f64.powi(k % 8 - 3), 0.05 + 0.004 * f64::from(k));
        let mut out = [0.0; 2];
        f.value(&Point { t: 0.0, x: &[offset, h, 0.0], u: &[0.0], p: &[0.0] }, &mut out, &mut work).unwrap();
        let exact = if h < 1.0 { (h + 1e-9) / (1.0 + 1e-9) } else { 1.0 };
        let value = (exact - h).max(0.0).powi(2) + 1e-9 * (exact - 1.0) * (exact - 1.0) + offset;
        assert!((out[0] - value).abs() <= 1e-13 * offset + 1e-13, "{h}: {} {value}", out[0]);
        // by the value its place is known to the root of rounding
        assert!(out[1] <= exact + 1e-6 * (1.0 + offset.sqrt()), "{h}: {} {exact}", out[1]);
    }
}

/// Compiles the code with the strictest flags, runs it and compares; `definitions` of functions go before it.
fn assert_generated_c(f: &ExprFunction, folder: &str, definitions: &str) {
    let dir = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    std::fs::create_dir_all(&dir).unwrap();
    let driver = format!(
        "#include \"model.c\"\n#include <stdio.h>\n{definitions}\
         static double out[{n}];\n\
         int main(void) {{\n\
         const double x[] = {{0.7, -1.3, 2.1}}, u[] = {{0.9}}, p[] = {{1.7}}, w[] = {{1.0, -0.5, 0.3, 2.0, -1.0}};\n\
         int i;\n\
         if (model_value(0.4, x, u, p, out) || model_jacobian(0.4, x, u, p, out + {j}) || \
         model_hessian(0.4, x, u, p, w, out + {h})) return 1;\n\
         for (i = 0; i < {n}; i++) printf(\"%.17g\\n\", out[i]);\n\
         return model_n_out != 5 || model_jacobian_col_ptr[6] != {nj};\n}}\n",
        n = 5 + f.jac_pattern().nnz() + f.hess_pattern().nnz(),
        j = 5,
        h = 5 + f.jac_pattern().nnz(),
        nj = f.jac_pattern().nnz(),
    );
    std::fs::write(dir.join("model.c"), write_c(&[f]).unwrap()).unwrap();
    std::fs::write(dir.join("driver.c"), driver).unwrap();
    let run = |program: &str, args: &[&str]| {
        Command::new(program).args(args).current_dir(&dir).output().unwrap_or_else(|e| panic!("{program}: {e}"))
    };
    let flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-ffp-contract=off", "-o", "driver"];
    let cc = run("cc", &[&flags[..], &["driver.c", "-lm"]].concat());
    assert!(cc.status.success(), "{}", String::from_utf8_lossy(&cc.stderr));
    // Behind the header of the library the code makes functions of it, in C and in C++.
    for (language, standard) in [("c", "-std=c11"), ("c++", "-std=c++17")] {
        let header = concat!(env!("CARGO_MANIFEST_DIR"), "/include/switchback.h");
        let strict = ["-fsyntax-only", "-Wall", "-Wextra", "-Werror", standard, "-include", header, "-x", language];
        let cc = run("cc", &[&strict[..], &["model.c"]].concat());
        assert!(cc.status.success(), "{language}: {}", String::from_utf8_lossy(&cc.stderr));
    }
    let result = run("./driver", &[]);
    assert!(result.status.success());
    let got: Vec<f64> = String::from_utf8(result.stdout).unwrap().lines().map(|l| l.parse().unwrap()).collect();
    let exact = all(f, &at(), &WEIGHTS);
    assert_eq!(got.len(), exact.len());
    for (k, (a, b)) in got.iter().zip(&exact).enumerate() {
        assert!((a - b).abs() <= f64::EPSILON * b.abs(), "number {k}: {a} {b}");
    }
}

#[test]
fn c_code_needs_names_and_known_operations() {
    let f = function("not a name");
    assert!(matches!(write_c(&[&f]), Err(Error::Range(_))));
    let f = function("f");
    assert!(matches!(write_c(&[&f, &f]), Err(Error::Range(_))));
    // So do external functions: no function may have the name of another.
    let g = Graph::new();
    let out = g.call(&external(), &[g.x(0), g.x(1), g.t()]).unwrap();
    let f = g.function("ext", DIMS, &[out[0]]).unwrap();
    assert!(matches!(write_c(&[&f]), Err(Error::Range(_))));
    let other = g.call(&external(), &[g.x(1), g.x(0), g.t()]).unwrap();
    let f = g.function("f", DIMS, &[out[0] * other[0]]).unwrap();
    assert!(matches!(write_c(&[&f]), Err(Error::Range(_))));
}

fn pattern(m: usize, n: usize, entries: &[(usize, usize)]) -> Pattern {
    let (rows, cols): (Vec<usize>, Vec<usize>) = entries.iter().copied().unzip();
    Pattern::from_triplets(m, n, &rows, &cols).0
}

/// `(a² sin b, a + b)` with exact derivatives.
fn external() -> Arc<dyn Function> {
    let f = Callback::new("ext", Dims { x: 2, u: 0, p: 0 }, 2, |at, out| {
        out[0] = at.x[0] * at.x[0] * at.x[1].sin();
        out[1] = at.x[0] + at.x[1];
        0
    })
    .with_jacobian(pattern(2, 3, &[(0, 0), (1, 0), (0, 1), (1, 1)]), |at, out| {
        out[0] = 2.0 * at.x[0] * at.x[1].sin();
        out[1] = 1.0;
        out[2] = at.x[0] * at.x[0] * at.x[1].cos();
        out[3] = 1.0;
        0
    })
    .unwrap()
    .with_hessian(pattern(3, 3, &[(0, 0), (0, 1), (1, 1)]), |at, w, out| {
        out[0] = w[0] * 2.0 * at.x[1].sin();
        out[1] = w[0] * 2.0 * at.x[0] * at.x[1].cos();
        out[2] = -w[0] * at.x[0] * at.x[0] * at.x[1].sin();
        0
    })
    .unwrap();
    Arc::new(f)
}

#[test]
fn external_functions_are_nodes_with_derivatives() {
    let f = external();
    let g = Graph::new();
    let [x, y, z] = [0, 1, 2].map(|i| g.x(i));
    let (a, b) = (x * y, z.exp());
    let called = g.call(&f, &[a, b, g.t()]).unwrap();
    assert_eq!(called[0].id(), g.call(&f, &[a, b, g.t()]).unwrap()[0].id());
    let written = [a * a * b.sin(), a + b];
    let wrap = |e: &[Expr]| [e[0] * e[1] + x, e[1].sin()].map(|e| e.id());
    let (called, written) = (wrap(&called), wrap(&written));
    let f = ExprFunction::new("called", &mut g.dag(), DIMS, &called).unwrap();
    let h = ExprFunction::new("written", &mut g.dag(), DIMS, &written).unwrap();
    assert_eq!((f.jac_pattern(), f.hess_pattern()), (h.jac_pattern(), h.hess_pattern()));
    let (a, b) = (all(&f, &at(), &WEIGHTS), all(&h, &at(), &WEIGHTS));
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() < 1e-13 * b.abs().max(1.0), "{a} {b}");
    }
    assert!(!f.jacobian_is_approximate() && !f.hessian_is_approximate());
    // Batches call the function point by point.
    let inputs: Vec<f64> = [X[0], X[1], X[2], 0.9, 1.7, 0.4].iter().flat_map(|&v| [v; 3]).collect();
    let mut out = vec![0.0; 6];
    f.value_tape().run_batch(3, &inputs, &mut out, &mut f.batch_work()).unwrap();
    assert_eq!(out[2].to_bits(), all(&f, &at(), &WEIGHTS)[0].to_bits());
}

#[test]
fn differences_of_external_functions_are_reported_as_such() {
    let f: Arc<dyn Function> = Arc::new(Callback::new("fd", Dims { x: 1, u: 0, p: 0 }, 1, |at, out| {
        out[0] = at.x[0] * at.x[0];
        0
    }));
    let g = Graph::new();
    let y = g.call(&f, &[g.x(0), g.t()]).unwrap();
    let h = g.function("h", DIMS, &[y[0]]).unwrap();
    assert!(h.jacobian_is_approximate() && h.hessian_is_approximate());
    let e = g.call(&f, &[g.x(0)]).unwrap_err();
    assert!(matches!(e, Error::Dimension(_)), "{e}");
}

/// An external function that evaluates the function it is part of.
struct Cycle {
    target: OnceLock<Weak<ExprFunction>>,
    pattern: Pattern,
}

impl Cycle {
    fn run(&self, at: &Point, out: &mut [f64]) -> EvalResult {
        let f = self.target.get().and_then(Weak::upgrade).unwrap();
        let x = [at.x[0], 0.0, 0.0];
        f.value(&Point { t: 0.0, x: &x, u: &[0.0], p: &[0.0] }, out, &mut vec![0.0; f.work_len()])
    }
}

impl Function for Cycle {
    fn name(&self) -> &str {
        "cycle"
    }
    fn dims(&self) -> Dims {
        Dims { x: 1, u: 0, p: 0 }
    }
    fn n_out(&self) -> usize {
        1
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.pattern
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.pattern
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        self.run(at, out)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        self.run(at, out)
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
}

#[test]
fn a_cycle_through_an_external_function_ends() {
    let cycle = Arc::new(Cycle { target: OnceLock::new(), pattern: Pattern::empty(1, 2) });
    let g = Graph::new();
    let shared: Arc<dyn Function> = cycle.clone();
    let y = g.call(&shared, &[g.x(0), g.t()]).unwrap();
    let f = Arc::new(g.function("f", DIMS, &[y[0] + 1.0]).unwrap());
    assert!(cycle.target.set(Arc::downgrade(&f)).is_ok());
    let mut work = vec![0.0; f.work_len()];
    assert_eq!(f.value(&at(), &mut [0.0], &mut work), Err(EvalError::Fatal(CYCLE_CODE)));
    // The next call starts anew.
    assert_eq!(f.value(&at(), &mut [0.0], &mut work), Err(EvalError::Fatal(CYCLE_CODE)));
}

#[test]
fn errors_of_external_functions_pass_through() {
    let dims = Dims { x: 1, u: 0, p: 0 };
    for (code, expected) in [(1, EvalError::Recoverable), (-7, EvalError::Fatal(-7))] {
        let f: Arc<dyn Function> = Arc::new(Callback::new("bad", dims, 1, move |_, _| code));
        let g = Graph::new();
        let y = g.call(&f, &[g.x(0), g.t()]).unwrap();
        let tape = Tape::new(&g.dag(), DIMS, 0, &[y[0].id()]).unwrap();
        let mut work = vec![0.0; tape.work_len()];
        assert_eq!(tape.run(&at(), &[], &mut [0.0], &mut work), Err(expected));
    }
}

#[test]
fn values_that_are_not_defined_are_recoverable() {
    let g = Graph::new();
    let x = g.x(0);
    let singular = g.solve(&[x, x * 2.0, x * 2.0, x * 4.0], &[x, x]).unwrap();
    for e in [(-x).ln(), 1.0 / (x - 0.7), singular[0]] {
        let f = g.function("f", DIMS, &[e]).unwrap();
        let mut work = vec![0.0; f.work_len()];
        assert_eq!(f.value(&at(), &mut [0.0], &mut work), Err(EvalError::Recoverable));
    }
}

#[test]
fn hostile_input_is_refused() {
    let g = Graph::new();
    let new = |e: &[Expr]| g.function("f", DIMS, e).map(|_| ());
    let x = g.x(0);
    for bad in [g.constant(f64::NAN), g.constant(-1.0).ln() + x, x + f64::INFINITY, x / 0.0] {
        let e = new(&[bad]).unwrap_err();
        assert!(matches!(e, Error::NonFinite(_)) && e.to_string().starts_with("f: "), "{e}");
    }
    for bad in [g.x(3), g.u(1), g.p(7)] {
        let e = new(&[x, bad.sin()]).unwrap_err();
        assert!(matches!(e, Error::Dimension(_)), "{e}");
    }
    let e = new(&[x.abs()]).unwrap_err();
    assert!(matches!(e, Error::Unsupported(_)) && e.to_string().contains("switching functions"), "{e}");
    let c = x.gt(0.0);
    let e = ExprFunction::new("f", &mut g.dag(), DIMS, &[c.id()]).map(|_| ()).unwrap_err();
    assert!(matches!(e, Error::Range(_)), "{e}");
    assert!(g.dag().id(1_000_000).is_err());
    new(&[]).unwrap();
}

#[test]
#[should_panic(expected = "two graphs")]
fn graphs_do_not_mix() {
    let (g, h) = (Graph::new(), Graph::new());
    let _ = g.x(0) + h.x(0);
}

/// A chain of a million operations: nothing recurses.
#[test]
fn huge_graphs() {
    let mut d = Dag::new();
    let (x, y) = (d.input(Block::X, 0), d.input(Block::X, 1));
    let mut e = x;
    for k in 0..350_000 {
        let c = d.constant(0.5 + f64::from(k) * 1e-6);
        let p = d.mul(c, y);
        e = d.add(e, p);
        e = d.unary(switchback::expr::Unary::Sin, e);
    }
    assert!(d.len() > 1_350_000);
    let tape = Tape::new(&d, DIMS, 0, &[e]).unwrap();
    let mut work = vec![0.0; tape.work_len()];
    let mut out = [0.0];
    tape.run(&at(), &[], &mut out, &mut work).unwrap();
    let mut exact = X[0];
    for k in 0..350_000 {
        exact = (exact + (0.5 + f64::from(k) * 1e-6) * X[1]).sin();
    }
    assert_eq!(out[0], exact);
    let entries = d.jacobian(&[e], &[x, y]).unwrap();
    assert_eq!(entries.len(), 2);
    assert!(d.text(e).len() < 300);
    // Long sums stay sums of their terms.
    let s = d.sub(e, x);
    d.positive(s);
}

#[test]
fn operators_take_numbers_and_assign() {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let c = |v: f64| g.constant(v);
    let same = [
        (x.min(2.0), x.min(c(2.0))),
        (x.max(y), y.max(x)),
        (x.clip(-1.0, y), x.clip(c(-1.0), y)),
        (x.relay(1.0, y), x.relay(c(1.0), y)),
        (x.dead_zone(0.5), x.dead_zone(c(0.5))),
        (x.atan2(3.0), x.atan2(c(3.0))),
        (x.powf(2.0), x * x),
        (x.gt(0.0).select(1.0, y), x.lt(0.0).select(y, 1.0)),
    ];
    for (k, (a, b)) in same.iter().enumerate() {
        assert_eq!(a.id(), b.id(), "case {k}: {a:?} {b:?}");
    }
    let mut e = x;
    e += y;
    e *= 2.0;
    e -= 1.0;
    e /= y;
    assert_eq!(e.id(), (((x + y) * 2.0 - 1.0) / y).id());
}
