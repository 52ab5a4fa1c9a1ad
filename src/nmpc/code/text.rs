//! What the files of controllers and estimators share.

use super::MAKEFILE;
use crate::error::{Error, Result};
use crate::expr::{is_c_identifier, write_c_first, CReal, ExprFunction};
use crate::tableau::Tableau;
use std::fmt::Write;

/// What the files do not have: stages through switches.
pub(super) const SWITCHES: &str = "systems that switch: their stages are simulated through every switch by events, which the files do not. Write one for \
                                   every mode without the switches, or call the library";

/// Names that begin with an underscore are those of the implementation of C.
pub(super) fn check_prefix(prefix: &str) -> Result<()> {
    if is_c_identifier(prefix) && !prefix.starts_with('_') {
        return Ok(());
    }
    Err(Error::Range(format!("'{prefix}' cannot begin names in C: use letters, digits and underscores")))
}

/// A template with the prefix filled in.
pub(super) fn named(template: &str, prefix: &str) -> String {
    template.replace("@PREFIX@", &prefix.to_ascii_uppercase()).replace("@prefix@", prefix)
}

/// The Makefile of `what`, with rules for `units`.
pub(super) fn makefile(what: &str, prefix: &str, units: &str) -> String {
    named(&MAKEFILE.replace("@units@", units), prefix).replace("@what@", what)
}

fn article(what: &str) -> &str {
    if what.starts_with('e') {
        "An"
    } else {
        "A"
    }
}

/// The header of `what`, whose `call` solves programs; `body` has sizes, sources and functions.
pub(super) fn header(what: &str, call: &str, prefix: &str, real: CReal, body: &str) -> String {
    let (upper, article) = (prefix.to_ascii_uppercase(), article(what));
    let kind = if real == CReal::Float { "float" } else { "double" };
    format!(
        "/* {article} {what}, written by switchback. */
#ifndef {upper}_H
#define {upper}_H

#ifdef __cplusplus
extern \"C\" {{
#endif

typedef {kind} {prefix}_real;

/* Bytes of memory, all of it static. */
extern const unsigned long {prefix}_arena_bytes;

{body}/* Steps of the active set and iterations of the interior point in the last {call}. */
int {prefix}_iterations(void);

#ifdef __cplusplus
}}
#endif
#endif
"
    )
}

/// The source of `what`: functions of the problem, what `tables` writes, and the kernel.
pub(super) fn source(
    what: &str,
    prefix: &str,
    w: &Writer,
    functions: &[(&str, &ExprFunction)],
    tables: impl FnOnce(&mut String),
    kernel: &[&str],
) -> Result<String> {
    let article = article(what);
    let mut out = format!("/* {article} {what}, written by switchback. C99; no heap, no threads, no clock. */\n#include \"{prefix}.h\"\n\n#include <float.h>\n");
    out.push_str(&write_c_first(functions, w.real)?);
    let _ = write!(
        out,
        "\n#define PREFIX(name) {prefix}_##name\n#define ROOM(n) ((n) > 0 ? (n) : 1)\ntypedef {prefix}_real real;\n"
    );
    out.push_str(match w.real {
        CReal::Float => FLOAT,
        _ => DOUBLE,
    });
    tables(&mut out);
    out.push_str(&calls(functions));
    kernel.iter().for_each(|part| out.push_str(part));
    Ok(out)
}

/// One table of C.
pub(super) fn table(out: &mut String, kind: &str, name: &str, values: impl Iterator<Item = String>) {
    let mut values: Vec<String> = values.collect();
    if values.is_empty() {
        values.push("0".into());
    }
    let _ = write!(out, "static const {kind} {name}[] = {{");
    for (i, v) in values.iter().enumerate() {
        let _ = write!(
            out,
            "{}{v}",
            if i == 0 {
                ""
            } else if i % 12 == 0 {
                ",\n    "
            } else {
                ", "
            }
        );
    }
    out.push_str("};\n");
}

/// Writes numbers of a precision.
pub(super) struct Writer {
    pub real: CReal,
}

impl Writer {
    pub fn number(&self, v: f64) -> String {
        if v == f64::INFINITY {
            return "INFINITY".into();
        }
        if v == f64::NEG_INFINITY {
            return "-INFINITY".into();
        }
        match self.real {
            CReal::Float => format!("{:e}f", v as f32),
            _ => format!("{v:e}"),
        }
    }

    pub fn reals(&self, out: &mut String, name: &str, values: &[f64]) {
        table(out, "real", name, values.iter().map(|v| self.number(*v)));
    }

    /// Bounds on the work of solving, the Runge-Kutta method, and where entries of Jacobians of functions are.
    pub fn method(&self, out: &mut String, functions: &[(&str, &ExprFunction)], tableau: &Tableau) {
        out.push_str(WORK);
        self.reals(out, "RK_A", &tableau.a);
        self.reals(out, "RK_B", &tableau.b);
        self.reals(out, "RK_C", &tableau.c);
        for (what, name) in [("FUN_COLS", "col_ptr"), ("FUN_ROWS", "row_idx")] {
            table(out, "int64_t *const", what, functions.iter().map(|(f, _)| format!("{f}_jacobian_{name}")));
        }
    }
}

/// Calls of functions by their numbers.
fn calls(functions: &[(&str, &ExprFunction)]) -> String {
    let mut out = String::new();
    for what in ["value", "jacobian"] {
        let _ = write!(
            out,
            "\nstatic int call_{what}(int fun, real t, const real *x, const real *u, const real *p, real *out) {{\n    switch (fun) {{\n"
        );
        for (i, (name, _)) in functions.iter().enumerate() {
            let _ = writeln!(out, "    case {i}:\n        return {name}_{what}(t, x, u, p, out);");
        }
        out.push_str("    default:\n        return 1;\n    }\n}\n");
    }
    out.push('\n');
    out
}

const WORK: &str = "/* Bounds on work: steps of an active set and iterations of the interior point, corrections of active rows, steps in vain. */
enum { MOST = 60, CORRECTIONS = 4, PATIENCE = 1 };
";

/// Precisions: rounding unit, weights and tolerances as in the library; those of single precision leave the same share of its digits.
const DOUBLE: &str = "#define SQRT sqrt
#define EPSILON DBL_EPSILON
#define STIFF 6.7e7
#define FEASIBLE 1e-10
#define NEARLY 1e-11
#define FARKAS 1e-9
#define BOUNDARY 0.995
#define ELASTIC 1e3
#define APART 10.0
#define FLOOR 1e-6
";
const FLOAT: &str = "#define SQRT sqrtf
#define EPSILON FLT_EPSILON
#define STIFF 2.9e3f
#define FEASIBLE 4e-5f
#define NEARLY 1e-5f
#define FARKAS 1e-4f
#define BOUNDARY 0.995f
#define ELASTIC 1e3f
#define APART 10.0f
#define FLOOR 1e-6f
";
