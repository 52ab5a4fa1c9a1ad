//! C code of functions: the same operations in the same order, so the same bits up to the mathematical library.

use std::fmt::Write;
use std::sync::Arc;

use super::c_inner::{self, Inner};
use super::dag::{CallKind, External};
use super::function::ExprFunction;
use super::implicit::Implicit;
use super::op::{Binary, Unary};
use super::piecewise::Piecewise;
use super::tape::{Code, Compound, Tape};
use crate::error::{Error, Result};
use crate::func::Function;
use crate::linalg::csc::Pattern;

/// C code (C99 and later, C++) of functions with all derivatives.
///
/// For a function `f` there are `f_value(t, x, u, p, out)`, `f_jacobian(t, x, u, p, out)` and
/// `f_hessian(t, x, u, p, weights, out)`, which return 0, or 1 where a linear system is singular, or the code of an external function, the sizes `f_nx`,
/// `f_nu`, `f_np`, `f_n_out`, and the patterns `f_jacobian_col_ptr`, `f_jacobian_row_idx` and the same for the
/// Hessian. Included behind `switchback.h`, the code also has `f_create(&function)`.
///
/// Calls of external functions become calls of C functions that are declared and not defined: of a function `g`, those
/// that are needed of `g_value`, `g_jacobian` and `g_hessian` with the same arguments, to be supplied where the code is
/// linked. They return 0, or a code that the caller returns, and write all entries of the patterns that stand
/// beside their declarations.
///
/// Inner problems ([`super::Dag::implicit`] and its like) become C functions that iterate as the library does, with arrays of fixed size: the code
/// is 1 where they have no solution.
///
/// Compile without contraction of products and sums (`-ffp-contract=off`) for the same bits.
///
/// # Errors
/// [`Error::Range`] for a name that is no C identifier or occurs twice.
pub fn write_c(functions: &[&ExprFunction]) -> Result<String> {
    let mut out = String::from(PREAMBLE);
    let tapes = functions.iter().flat_map(|f| [f.value_tape(), f.jacobian_tape(), f.hessian_tape()]);
    let names: Vec<&str> = functions.iter().map(|f| f.name()).collect();
    let inner = declarations(&mut out, &names, tapes, CReal::Double)?;
    for f in functions {
        function(&mut out, f, &inner);
    }
    Ok(out)
}

/// Numbers of C code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum CReal {
    /// `double`
    Double = 0,
    /// `float`
    Float = 1,
}

/// C code of values and Jacobians alone, under these names: what a controller calls. In single precision the functions of
/// `<math.h>` are `sinf` and so on.
///
/// # Errors
/// [`Error::Range`] for a name that is no C identifier or occurs twice, and for constants that single precision does not have.
pub fn write_c_first(functions: &[(&str, &ExprFunction)], real: CReal) -> Result<String> {
    let mut out = String::from(PREAMBLE);
    let tapes = functions.iter().flat_map(|(_, f)| [f.value_tape(), f.jacobian_tape()]);
    let names: Vec<&str> = functions.iter().map(|f| f.0).collect();
    let inner = declarations(&mut out, &names, tapes, real)?;
    for (name, f) in functions {
        out.push('\n');
        pattern(&mut out, &format!("{name}_jacobian"), f.jac_pattern());
        body(&mut out, name, "value", f.value_tape(), false, &inner);
        body(&mut out, name, "jacobian", f.jacobian_tape(), false, &inner);
    }
    match real {
        CReal::Double => Ok(out),
        CReal::Float => single(&out),
    }
}

/// Functions of `<math.h>` that code calls.
const MATHEMATICS: [&str; 16] = [
    "sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "floor", "pow", "atan2",
    "fabs",
];

/// The same code in single precision: its type, and a suffix for all functions of `<math.h>`, and for all constants that are no integers.
fn single(code: &str) -> Result<String> {
    let bytes = code.as_bytes();
    let in_word = |b: u8| b.is_ascii_alphanumeric() || b == b'_';
    let (mut out, mut i) = (String::with_capacity(code.len()), 0);
    while i < bytes.len() {
        let from = i;
        if bytes[i].is_ascii_digit() {
            let in_number = |k: usize| {
                in_word(bytes[k]) || bytes[k] == b'.' || (matches!(bytes[k], b'+' | b'-') && bytes[k - 1] == b'e')
            };
            while i < bytes.len() && (i == from || in_number(i)) {
                i += 1;
            }
            let text = &code[from..i];
            out.push_str(text);
            if text.contains(['.', 'e']) && !text.starts_with("0x") {
                let fits = text.parse::<f64>().is_ok_and(|v| (v as f32).is_finite());
                if !fits {
                    return Err(Error::Range(format!(
                        "the constant {text} is too large for single precision: take double"
                    )));
                }
                out.push('f');
            }
        } else if in_word(bytes[i]) {
            while i < bytes.len() && in_word(bytes[i]) {
                i += 1;
            }
            let word = &code[from..i];
            out.push_str(if word == "double" { "float" } else { word });
            if code[i..].starts_with('(') && MATHEMATICS.contains(&word) {
                out.push('f');
            }
        } else {
            // text between tokens may have any characters
            while i < bytes.len() && !in_word(bytes[i]) {
                i += 1;
            }
            out.push_str(&code[from..i]);
        }
    }
    Ok(out)
}

/// Letters, digits and underscores, a digit not first?
pub(crate) fn is_c_identifier(name: &str) -> bool {
    name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && name.chars().next().is_some_and(|c| !c.is_ascii_digit())
}

/// FNV-1a over a text: changes with it, and is the same in every run.
pub(crate) fn fingerprint(text: &str, seed: u64) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325 ^ seed, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

/// Checks all names, declares what is called, and writes the inner problems.
fn declarations<'a>(
    out: &mut String,
    own: &[&str],
    tapes: impl Iterator<Item = &'a Tape> + Clone,
    real: CReal,
) -> Result<Inner> {
    let inner = Inner::new(own.first().copied().unwrap_or_default(), tapes.clone());
    let mut names: Vec<&str> = Vec::new();
    let externals = externals(tapes.collect::<Vec<&Tape>>().into_iter().chain(inner.tapes()));
    let solved = inner.functions().map(|(_, name)| name);
    for name in own.iter().copied().chain(externals.iter().map(|e| e.0.name())).chain(solved) {
        if !is_c_identifier(name) || names.contains(&name) {
            return Err(Error::Range(format!(
                "'{name}' cannot name a function in C: use letters, digits and underscores, each name once"
            )));
        }
        names.push(name);
    }
    for (f, parts) in &externals {
        declaration(out, f.as_ref(), *parts);
    }
    if !inner.is_empty() {
        out.push_str(&c_inner::solvers(real));
    }
    for (f, name) in inner.functions() {
        out.push('\n');
        f.programs().for_each(|(what, tape)| body(out, name, what, tape, false, &inner));
        out.push_str(&c_inner::value(f, name));
    }
    Ok(inner)
}

/// External functions that are to be supplied, each once, with what is called of them: value, Jacobian, Hessian.
fn externals<'a>(tapes: impl Iterator<Item = &'a Tape>) -> Vec<(External, [bool; 3])> {
    let mut found: Vec<(External, [bool; 3])> = Vec::new();
    for compound in tapes.flat_map(|t| &t.compounds) {
        let Compound::Call { f, what, .. } = compound else { continue };
        if Implicit::of(f).is_some() {
            continue;
        }
        let k = found.iter().position(|e| Arc::ptr_eq(&e.0, f)).unwrap_or_else(|| {
            found.push((f.clone(), [false; 3]));
            found.len() - 1
        });
        found[k].1[match what {
            CallKind::Value => 0,
            CallKind::Jacobian => 1,
            CallKind::Hessian(_) => 2,
        }] = true;
    }
    found
}

/// Declares what is called of an external function, with the patterns of its derivatives.
fn declaration(out: &mut String, f: &dyn Function, [value, jacobian, hessian]: [bool; 3]) {
    let (name, d) = (f.name(), f.dims());
    put(
        out,
        format_args!(
            "\n/* To be supplied: {name}, of {} x, {} u, {} p and t, with {} outputs. */\n",
            d.x,
            d.u,
            d.p,
            f.n_out()
        ),
    );
    if jacobian {
        pattern(out, &format!("{name}_jacobian"), f.jac_pattern());
    }
    if hessian {
        pattern(out, &format!("{name}_hessian"), f.hess_pattern());
    }
    let point = "double t, const double *x, const double *u, const double *p";
    out.push_str("#ifdef __cplusplus\nextern \"C\" {\n#endif\n");
    for (part, weights) in [
        (value.then_some("value"), ""),
        (jacobian.then_some("jacobian"), ""),
        (hessian.then_some("hessian"), "const double *weights, "),
    ] {
        if let Some(part) = part {
            put(out, format_args!("extern int {name}_{part}({point}, {weights}double *out);\n"));
        }
    }
    out.push_str("#ifdef __cplusplus\n}\n#endif\n");
}

fn function(out: &mut String, f: &ExprFunction, inner: &Inner) {
    let (name, d) = (f.name(), f.dims());
    let sizes = [("nx", d.x), ("nu", d.u), ("np", d.p), ("n_out", f.n_out())];
    for (what, n) in sizes {
        put(out, format_args!("\nenum {{ {name}_{what} = {n} }};"));
    }
    out.push('\n');
    pattern(out, &format!("{name}_jacobian"), f.jac_pattern());
    pattern(out, &format!("{name}_hessian"), f.hess_pattern());
    for (what, tape, weights) in
        [("value", f.value_tape(), false), ("jacobian", f.jacobian_tape(), false), ("hessian", f.hessian_tape(), true)]
    {
        body(out, name, what, tape, weights, inner);
    }
    put(
        out,
        format_args!(
            "
#ifdef SWITCHBACK_H
static int32_t {name}_swb_value(const swb_point *at, double *out, void *user_data) {{
    (void)user_data;
    return {name}_value(at->t, at->x, at->u, at->p, out);
}}
static int32_t {name}_swb_jacobian(const swb_point *at, double *out, void *user_data) {{
    (void)user_data;
    return {name}_jacobian(at->t, at->x, at->u, at->p, out);
}}
static int32_t {name}_swb_hessian(const swb_point *at, const double *weights, double *out, void *user_data) {{
    (void)user_data;
    return {name}_hessian(at->t, at->x, at->u, at->p, weights, out);
}}
SWB_CODE_UNUSED static swb_status {name}_create(swb_function **out) {{
    swb_status s = swb_function_create(\"{name}\", {name}_nx, {name}_nu, {name}_np, {name}_n_out, {name}_swb_value, 0, 0, out);
    if (s == SWB_OK)
        s = swb_function_set_jacobian(*out, {name}_jacobian_col_ptr, {cols}, {name}_jacobian_row_idx, {nj}, {name}_swb_jacobian);
    if (s == SWB_OK)
        s = swb_function_set_hessian(*out, {name}_hessian_col_ptr, {cols}, {name}_hessian_row_idx, {nh}, {name}_swb_hessian);
    if (s != SWB_OK) {{
        swb_function_free(*out);
        *out = 0;
    }}
    return s;
}}
#endif
",
            cols = d.n_in() + 1,
            nj = f.jac_pattern().nnz(),
            nh = f.hess_pattern().nnz(),
        ),
    );
}

/// Writing to a string cannot fail.
fn put(out: &mut String, args: std::fmt::Arguments) {
    let _ = out.write_fmt(args);
}

fn pattern(out: &mut String, name: &str, p: &Pattern) {
    let list = |v: &[usize]| v.iter().map(|k| k.to_string()).collect::<Vec<_>>().join(", ");
    put(out, format_args!("SWB_CODE_UNUSED static const int64_t {name}_col_ptr[] = {{{}}};\n", list(p.col_ptr())));
    // An array has an element at least.
    let rows = if p.nnz() == 0 { "0".into() } else { list(p.row_idx()) };
    put(out, format_args!("SWB_CODE_UNUSED static const int64_t {name}_row_idx[] = {{{rows}}};\n"));
}

fn number(v: f64) -> String {
    // The shortest text that reads back as the same number.
    format!("{v:e}")
}

fn table(out: &mut String, name: &str, p: &Piecewise, order: u8) {
    let list = |v: &[f64]| v.iter().map(|&v| number(v)).collect::<Vec<_>>().join(", ");
    put(out, format_args!("static double {name}(double s) {{\n"));
    let (n, terms) = (p.breaks().len(), p.degree() + 1 - usize::from(order));
    let c: Vec<f64> = (0..=n).flat_map(|piece| p.derivative(piece, order)).collect();
    let breaks = if n == 0 { "0".into() } else { list(p.breaks()) };
    put(out, format_args!("    static const double breaks[] = {{{breaks}}};\n"));
    put(out, format_args!("    static const double origins[] = {{{}}};\n", list(p.origins())));
    put(out, format_args!("    static const double c[] = {{{}}};\n", list(&c)));
    put(
        out,
        format_args!(
            "    int piece = 0, k;\n    double v = 0.0, z;\n    if (s != s)\n        return s;\n    while (piece < {n} && breaks[piece] <= s)\n        \
             piece++;\n    z = s - origins[piece];\n    for (k = {terms} - 1; k >= 0; k--)\n        v = v * z + \
             c[piece * {terms} + k];\n    return v;\n}}\n"
        ),
    );
}

fn body(out: &mut String, name: &str, what: &str, tape: &Tape, weights: bool, inner: &Inner) {
    // Tables first, once for every derivative that is used.
    let mut tables: Vec<u32> = tape.code.iter().filter(|i| i.code == Code::Piecewise).map(|i| i.b).collect();
    tables.sort_unstable();
    tables.dedup();
    for b in tables {
        table(out, &format!("{name}_{what}_table{b}"), &tape.piecewise[(b >> 4) as usize], (b & 15) as u8);
    }
    let extra = if weights { "const double *weights, " } else { "" };
    put(
        out,
        format_args!(
            "SWB_CODE_UNUSED static int {name}_{what}(double t, const double *x, const double *u, const double *p, {extra}double *out) {{\n"
        ),
    );
    let constant = |v: f64| {
        let v = number(v);
        if v.starts_with('-') {
            format!("({v})")
        } else {
            v
        }
    };
    let operand = |r: u32| -> String {
        let r = r as usize;
        if let Some(l) = tape.loads.get(r) {
            return match l.block {
                3 => "t".into(),
                block => format!("{}[{}]", ["x", "u", "p", "t", "weights"][block as usize], l.index),
            };
        }
        match tape.constants.get(r - tape.loads.len()) {
            Some(&v) => constant(v),
            None => format!("r[{}]", r - tape.first_register()),
        }
    };
    let n_registers = tape.work_len() - tape.first_register();
    if n_registers > 0 {
        put(out, format_args!("    double r[{n_registers}];\n"));
    }
    for used in ["t", "x", "u", "p"].iter().chain(if weights { &["weights"][..] } else { &[] }) {
        put(out, format_args!("    (void){used};\n"));
    }
    for i in &tape.code {
        let (dst, a) = (operand(i.dst), || operand(i.a));
        let b = || operand(i.b);
        let c = || constant(tape.immediates[i.b as usize]);
        let value = match i.code {
            Code::Add => format!("{} {} {}", a(), Binary::Add.name(), b()),
            Code::Sub => format!("{} {} {}", a(), Binary::Sub.name(), b()),
            Code::Mul => format!("{} {} {}", a(), Binary::Mul.name(), b()),
            Code::Div => format!("{} {} {}", a(), Binary::Div.name(), b()),
            Code::AddConstant => format!("{} + {}", c(), a()),
            Code::ConstantMinus => format!("{} - {}", c(), a()),
            Code::Scale => format!("{} * {}", c(), a()),
            Code::ConstantOver => format!("{} / {}", c(), a()),
            Code::Neg => format!("-{}", a()),
            Code::Square => format!("{0} * {0}", a()),
            Code::Sqrt => format!("sqrt({})", a()),
            Code::Pow => format!("pow({}, {})", a(), b()),
            Code::Atan2 => format!("atan2({}, {})", a(), b()),
            Code::Unary(Unary::Erf) => format!("swb_code_erf({})", a()),
            Code::Unary(op) => format!("{}({})", op.name(), a()),
            Code::PowI => format!("swb_code_powi({}, {})", a(), i.b as i32),
            Code::Piecewise => format!("{name}_{what}_table{}({})", i.b, a()),
            Code::Block => {
                compound(out, &tape.compounds[i.a as usize], &dst, &operand, inner);
                continue;
            }
        };
        put(out, format_args!("    {dst} = {value};\n"));
    }
    if tape.outputs.is_empty() {
        out.push_str("    (void)out;\n");
    }
    for (k, &o) in tape.outputs.iter().enumerate() {
        put(out, format_args!("    out[{k}] = {};\n", operand(o)));
    }
    out.push_str("    return 0;\n}\n");
}

fn compound(out: &mut String, c: &Compound, dst: &str, operand: &dyn Fn(u32) -> String, inner: &Inner) {
    let at = |k: usize| format!("(&{dst})[{k}]");
    let copy = |out: &mut String, v: &[u32]| {
        for (k, &r) in v.iter().enumerate() {
            put(out, format_args!("    {} = {};\n", at(k), operand(r)));
        }
    };
    match c {
        Compound::Factor { n, matrix } => {
            copy(out, matrix);
            put(out, format_args!("    if (!swb_code_factor({n}, &{dst}))\n        return 1;\n"));
        }
        Compound::Solve { n, lu, transposed, rhs } => {
            copy(out, rhs);
            let f = if *transposed { "swb_code_solve_transposed" } else { "swb_code_solve" };
            put(out, format_args!("    {f}({n}, &{}, &{dst});\n", operand(*lu as u32)));
        }
        Compound::Call { f, what, args, .. } => {
            let d = f.dims();
            let list = |v: &[u32]| v.iter().map(|&r| operand(r)).collect::<Vec<_>>().join(", ");
            out.push_str("    {\n        int code;\n");
            let blocks = [("x", 0, d.x), ("u", d.x, d.u), ("p", d.x + d.u, d.p)].map(|(block, first, n)| {
                if n == 0 {
                    return "0".to_owned();
                }
                put(
                    out,
                    format_args!("        const double call_{block}[] = {{{}}};\n", list(&args[first..first + n])),
                );
                format!("call_{block}")
            });
            let (part, weights) = match what {
                CallKind::Value => ("value", ""),
                CallKind::Jacobian => ("jacobian", ""),
                CallKind::Hessian(output) => {
                    let unit: Vec<&str> =
                        (0..f.n_out()).map(|i| if i == *output as usize { "1" } else { "0" }).collect();
                    put(out, format_args!("        const double call_weights[] = {{{}}};\n", unit.join(", ")));
                    ("hessian", "call_weights, ")
                }
            };
            put(
                out,
                format_args!(
                    "        code = {}_{part}({}, {}, {weights}&{dst});\n        if (code != 0)\n            return code;\n    }}\n",
                    inner.name(f),
                    operand(args[d.t_col()]),
                    blocks.join(", "),
                ),
            );
        }
    }
}

/// What the functions share.
const PREAMBLE: &str = "\
/* Written by switchback. */
#include <math.h>
#include <stdint.h>

#ifndef SWB_CODE_HELPERS
#define SWB_CODE_HELPERS
#if defined(__GNUC__)
#define SWB_CODE_UNUSED __attribute__((unused))
#else
#define SWB_CODE_UNUSED
#endif

SWB_CODE_UNUSED static double swb_code_powi(double base, int n) {
    unsigned k = n < 0 ? 0u - (unsigned)n : (unsigned)n;
    double out = 1.0;
    for (;;) {
        if (k & 1u)
            out *= base;
        k >>= 1;
        if (k == 0u)
            break;
        base *= base;
    }
    return n < 0 ? 1.0 / out : out;
}

SWB_CODE_UNUSED static double swb_code_erf(double x) {
    const double c = 1.1283791670955126;
    double a = fabs(x), f;
    int k;
    if (a < 2.4) {
        double y = 2.0 * x * x, term = 1.0, sum = 1.0, n = 3.0;
        while (term > 1e-17 * sum) {
            term *= y / n;
            sum += term;
            n += 2.0;
        }
        return c * x * sum * exp(-x * x);
    }
    if (a > 6.0)
        return x > 0.0 ? 1.0 : -1.0;
    f = a;
    for (k = 60; k >= 1; k--)
        f = a + 0.5 * (double)k / f;
    f = 0.5 * c * exp(-a * a) / f;
    return x > 0.0 ? 1.0 - f : f - 1.0;
}

SWB_CODE_UNUSED static int swb_code_factor(int n, double *a) {
    int i, j, k;
    for (k = 0; k < n; k++) {
        int p = k;
        double pivot;
        for (i = k + 1; i < n; i++)
            if (fabs(a[i + n * k]) > fabs(a[p + n * k]))
                p = i;
        a[k + n * n] = (double)p;
        pivot = a[p + n * k];
        if (!(pivot != 0.0 && pivot - pivot == 0.0))
            return 0;
        for (j = 0; p != k && j < n; j++) {
            double s = a[k + n * j];
            a[k + n * j] = a[p + n * j];
            a[p + n * j] = s;
        }
        for (i = k + 1; i < n; i++)
            a[i + n * k] /= pivot;
        for (j = k + 1; j < n; j++)
            for (i = k + 1; i < n; i++)
                a[i + n * j] -= a[i + n * k] * a[k + n * j];
    }
    return 1;
}

SWB_CODE_UNUSED static void swb_code_swap(double *b, int k, int p) {
    double s = b[k];
    b[k] = b[p];
    b[p] = s;
}

SWB_CODE_UNUSED static void swb_code_solve(int n, const double *a, double *b) {
    int i, k;
    for (k = 0; k < n; k++)
        swb_code_swap(b, k, (int)a[k + n * n]);
    for (k = 0; k < n; k++)
        for (i = k + 1; i < n; i++)
            b[i] -= a[i + n * k] * b[k];
    for (k = n - 1; k >= 0; k--) {
        b[k] /= a[k + n * k];
        for (i = 0; i < k; i++)
            b[i] -= a[i + n * k] * b[k];
    }
}

SWB_CODE_UNUSED static void swb_code_solve_transposed(int n, const double *a, double *b) {
    int i, k;
    for (k = 0; k < n; k++) {
        for (i = 0; i < k; i++)
            b[k] -= a[i + n * k] * b[i];
        b[k] /= a[k + n * k];
    }
    for (k = n - 1; k >= 0; k--)
        for (i = k + 1; i < n; i++)
            b[k] -= a[i + n * k] * b[i];
    for (k = n - 1; k >= 0; k--)
        swb_code_swap(b, k, (int)a[k + n * n]);
}
#endif
";
