//! C code of inner problems: the iterations of [`Implicit`] with the same steps, on arrays of fixed size.

use std::sync::Arc;

use super::c_code::CReal;
use super::dag::External;
use super::implicit::{self, Implicit};
use super::tape::Tape;

/// Implicit functions that code calls, each once and behind those that it calls itself, with their names in C.
pub(super) struct Inner(Vec<(External, String)>);

impl Inner {
    /// Those of some programs; their names begin with that of a function.
    pub(super) fn new<'a>(name: &str, tapes: impl Iterator<Item = &'a Tape>) -> Inner {
        let mut found = Vec::new();
        tapes.for_each(|t| collect(t, &mut found));
        Inner(found.into_iter().enumerate().map(|(k, f)| (f, format!("{name}_inner{k}"))).collect())
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The name of a function in C.
    pub(super) fn name<'a>(&'a self, f: &'a External) -> &'a str {
        self.0.iter().find(|(g, _)| Arc::ptr_eq(f, g)).map_or(f.name(), |(_, name)| name)
    }

    /// The functions, those first that others call.
    pub(super) fn functions(&self) -> impl Iterator<Item = (&Implicit, &str)> {
        self.0.iter().filter_map(|(f, name)| Implicit::of(f).map(|f| (f, name.as_str())))
    }

    /// All programs of them.
    pub(super) fn tapes(&self) -> impl Iterator<Item = &Tape> {
        self.functions().flat_map(|(f, _)| f.programs()).map(|(_, t)| t)
    }
}

fn collect(tape: &Tape, found: &mut Vec<External>) {
    for f in tape.functions() {
        let Some(inner) = Implicit::of(f) else { continue };
        if found.iter().any(|g| Arc::ptr_eq(f, g)) {
            continue;
        }
        inner.programs().for_each(|(_, t)| collect(t, found));
        found.push(f.clone());
    }
}

/// `NAME_value` of an implicit function, whose programs are there already.
pub(super) fn value(f: &Implicit, name: &str) -> String {
    let n = f.unknowns();
    let (method, parts) = if f.is_least() {
        ("least", format!("{name}_cost, {name}_residual"))
    } else {
        ("root", format!("{name}_residual"))
    };
    let (first, last) = match f.is_least() {
        true => (
            1,
            format!("    if (code == 0)\n        code = swb_code_finite({name}_least(0.0, w, 0, x, out), 1, out);\n"),
        ),
        false => (0, String::new()),
    };
    format!(
        "SWB_CODE_UNUSED static int {name}_value(double t, const double *x, const double *u, const double *p, double *out) {{
    double w[{n}] = {{0.0}}, begin[{n}], work[{work}];
    int code = swb_code_finite({name}_start(0.0, w, 0, x, begin), {n}, begin), i;
    (void)t;
    (void)u;
    (void)p;
    for (i = 0; i < {n}; i++)
        w[i] = begin[i];
    if (code == 0)
        code = swb_code_{method}({n}, {parts}, {name}_matrix, x, w, work);
{last}    for (i = 0; i < {n}; i++)
        out[{first} + i] = w[i];
    return code;
}}
",
        work = 4 * n + 2 * n * n,
    )
}

/// The iterations, with the constants of a precision.
pub(super) fn solvers(real: CReal) -> String {
    let (epsilon, least, halvings) = match real {
        CReal::Double => (f64::EPSILON, f64::MIN_POSITIVE, f64::MANTISSA_DIGITS - 1),
        CReal::Float => (f64::from(f32::EPSILON), f64::from(f32::MIN_POSITIVE), f32::MANTISSA_DIGITS - 1),
    };
    // of the root of rounding, and of rounding, as in double precision
    let last = implicit::LAST_STEP * (epsilon / f64::EPSILON).sqrt();
    let rounded = implicit::ROUNDED_STEP * (epsilon / f64::EPSILON);
    let rounding = implicit::ROUNDING * (epsilon / f64::EPSILON);
    SOLVERS
        .replace("LAST_STEP", &format!("{last:e}"))
        .replace("ROUNDED_STEP", &format!("{rounded:e}"))
        .replace("ROUNDING", &format!("{rounding:e}"))
        .replace("EPSILON", &format!("{epsilon:e}"))
        .replace("MIN_POSITIVE", &format!("{least:e}"))
        .replace("ARMIJO", &format!("{:e}", implicit::ARMIJO))
        .replace("MOST_STEPS", &implicit::MOST_STEPS.to_string())
        .replace("MOST_HALVINGS", &halvings.to_string())
}

/// What inner problems share. Codes are those of functions: 1 where there is no value, less than 0 for an error that ends everything.
const SOLVERS: &str = "
#ifndef SWB_CODE_INNER
#define SWB_CODE_INNER
typedef int (*swb_code_part)(double t, const double *x, const double *u, const double *p, double *out);

SWB_CODE_UNUSED static int swb_code_finite(int code, int n, const double *v) {
    int i;
    for (i = 0; i < n && code == 0; i++)
        if (!(v[i] - v[i] == 0.0))
            code = 1;
    return code;
}

SWB_CODE_UNUSED static double swb_code_largest(int n, const double *v) {
    double most = 0.0;
    int i;
    for (i = 0; i < n; i++)
        if (fabs(v[i]) > most)
            most = fabs(v[i]);
    return most;
}

SWB_CODE_UNUSED static double swb_code_norm(int n, const double *v) {
    double sum = 0.0;
    int i;
    for (i = 0; i < n; i++)
        sum += v[i] * v[i];
    return sqrt(sum);
}

SWB_CODE_UNUSED static int swb_code_cholesky(int n, double *a, double size) {
    int i, j, k;
    for (k = 0; k < n; k++) {
        double known = 0.0, pivot;
        for (j = 0; j < k; j++)
            known += a[k + n * j] * a[k + n * j];
        pivot = a[k + n * k] - known;
        if (!(pivot > EPSILON * size))
            return 0;
        a[k + n * k] = sqrt(pivot);
        for (i = k + 1; i < n; i++) {
            known = 0.0;
            for (j = 0; j < k; j++)
                known += a[i + n * j] * a[k + n * j];
            a[i + n * k] = (a[i + n * k] - known) / a[k + n * k];
        }
    }
    return 1;
}

SWB_CODE_UNUSED static int swb_code_positive_step(int n, const double *h, const double *g, double *l, double *step) {
    double size = swb_code_largest(n * n, h), tau = 0.0;
    int i, j;
    if (size < MIN_POSITIVE)
        size = MIN_POSITIVE;
    for (;;) {
        for (i = 0; i < n * n; i++)
            l[i] = h[i];
        for (i = 0; i < n; i++)
            l[i + n * i] += tau;
        if (swb_code_cholesky(n, l, size))
            break;
        tau = tau == 0.0 ? 1e-3 * size : 2.0 * tau;
        if (!(tau - tau == 0.0))
            break;
    }
    for (i = 0; i < n; i++) {
        double known = 0.0;
        for (j = 0; j < i; j++)
            known += l[i + n * j] * step[j];
        step[i] = (-g[i] - known) / l[i + n * i];
    }
    for (i = n - 1; i >= 0; i--) {
        double known = 0.0;
        for (j = i + 1; j < n; j++)
            known += l[j + n * i] * step[j];
        step[i] = (step[i] - known) / l[i + n * i];
    }
    return tau != 0.0;
}

/* Least value of a cost; work[4 n + 2 n n]. */
SWB_CODE_UNUSED static int swb_code_least(int n, swb_code_part cost, swb_code_part gradient, swb_code_part matrix,
                                          const double *z, double *w, double *work) {
    double *step = work, *trial = work + n, *g = work + 2 * n, *h = work + 3 * n, *l = h + n * n;
    double last = -1.0, scale = 0.0;
    int k, j, i, code;
    for (k = 0; k < MOST_STEPS; k++) {
        double f0 = 0.0, size, slope = 0.0, t = 1.0, rounding;
        int shifted, certain, stays, defined = 1;
        code = swb_code_finite(cost(0.0, w, 0, z, &f0), 1, &f0);
        if (code == 0)
            code = swb_code_finite(gradient(0.0, w, 0, z, g), n, g);
        if (code == 0)
            code = swb_code_finite(matrix(0.0, w, 0, z, h), n * n, h);
        if (code != 0)
            return code;
        shifted = swb_code_positive_step(n, h, g, l, step);
        size = swb_code_largest(n, step);
        if (swb_code_largest(n, w) > scale)
            scale = swb_code_largest(n, w);
        for (i = 0; i < n; i++)
            slope += step[i] * g[i];
        rounding = ROUNDING * (fabs(f0) + swb_code_largest(n * n, h) * scale * scale);
        certain = fabs(slope) > rounding;
        stays = last >= 0.0 && size >= 0.5 * last;
        if (!shifted && (size <= LAST_STEP * swb_code_largest(n, w) || (stays && size <= ROUNDED_STEP * scale))) {
            for (i = 0; i < n; i++)
                w[i] += step[i];
            return 0;
        }
        if (!shifted && stays && !certain)
            return 0;
        last = shifted ? -1.0 : size;
        for (j = 0; j < MOST_HALVINGS; j++) {
            double v = 0.0;
            for (i = 0; i < n; i++)
                trial[i] = w[i] + t * step[i];
            code = swb_code_finite(cost(0.0, trial, 0, z, &v), 1, &v);
            if (code < 0)
                return code;
            if (code == 0 && (!certain || v <= f0 + ARMIJO * t * slope))
                break;
            defined &= code == 0;
            t *= 0.5;
        }
        if (j == MOST_HALVINGS)
            return 1;
        for (i = 0; i < n; i++)
            w[i] = trial[i];
        if (certain && defined && t * fabs(slope) <= rounding)
            return 0;
    }
    return 1;
}

/* Solution of equations; work[4 n + 2 n n]. */
SWB_CODE_UNUSED static int swb_code_root(int n, swb_code_part residual, swb_code_part matrix, const double *z, double *w,
                                         double *work) {
    double *step = work, *trial = work + n, *g = work + 2 * n, *l = work + 3 * n;
    double last = -1.0, scale = 0.0;
    int k, j, i, code;
    for (k = 0; k < MOST_STEPS; k++) {
        double size, g0, t = 1.0;
        int rounded;
        code = swb_code_finite(residual(0.0, w, 0, z, g), n, g);
        if (code == 0)
            code = swb_code_finite(matrix(0.0, w, 0, z, l), n * n, l);
        if (code != 0)
            return code;
        if (!swb_code_factor(n, l))
            return 1;
        for (i = 0; i < n; i++)
            step[i] = -g[i];
        swb_code_solve(n, l, step);
        size = swb_code_largest(n, step);
        if (swb_code_largest(n, w) > scale)
            scale = swb_code_largest(n, w);
        rounded = size <= ROUNDED_STEP * scale;
        if (size <= LAST_STEP * swb_code_largest(n, w) || (rounded && last >= 0.0 && size >= 0.5 * last)) {
            for (i = 0; i < n; i++)
                w[i] += step[i];
            return 0;
        }
        last = size;
        g0 = swb_code_norm(n, g);
        for (j = 0; j < MOST_HALVINGS; j++) {
            for (i = 0; i < n; i++)
                trial[i] = w[i] + t * step[i];
            code = swb_code_finite(residual(0.0, trial, 0, z, g), n, g);
            if (code < 0)
                return code;
            if (code == 0 && (rounded || swb_code_norm(n, g) <= (1.0 - ARMIJO * t) * g0))
                break;
            t *= 0.5;
        }
        if (j == MOST_HALVINGS)
            return 1;
        for (i = 0; i < n; i++)
            w[i] = trial[i];
    }
    return 1;
}
#endif
";
