//! Expressions, and models made of them. Expressions are numbers of nodes in a graph; conditions too.

use super::function::{shared, swb_function, swb_point, UserFunction};
use super::guard::guard;
use super::handle::{self, Object};
use super::raw;
use super::status::swb_status;
use super::system::swb_system;
use std::ffi::c_char;
use std::path::Path;
use switchback::error::{Error, Result};
use switchback::expr::{write_c, Block, Dag, ExprFunction, Id, Operator, Piecewise};
use switchback::fmu::{self, FmiVersion, Start};
use switchback::func::Dims;
use switchback::memory::sizes::{self, size};
use switchback::model::{Built, Model, Names, Trial};

/// Graph of expressions. Every expression is a number in its graph and exists once: equal expressions have equal
/// numbers. Expressions live as long as the graph; functions and models made of them are independent of it.
pub struct swb_expr(());
impl Object for swb_expr {
    type Value = Dag;
    const NAME: &'static str = "swb_expr";
}

/// Model made of expressions: a piecewise smooth system with a report of what it consists of.
pub struct swb_model(());
impl Object for swb_model {
    type Value = Built;
    const NAME: &'static str = "swb_model";
}

/// Operators of expressions. Operands are called a, b and c; conditions are operands of Not, And, Or, and the first
/// of Where.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_operator {
    /// -a
    Neg = 0,
    /// Square root.
    Sqrt = 1,
    /// Exponential.
    Exp = 2,
    /// Natural logarithm.
    Log = 3,
    /// Sine.
    Sin = 4,
    /// Cosine.
    Cos = 5,
    /// Tangent.
    Tan = 6,
    /// Inverse sine.
    Asin = 7,
    /// Inverse cosine.
    Acos = 8,
    /// Inverse tangent.
    Atan = 9,
    /// Hyperbolic sine.
    Sinh = 10,
    /// Hyperbolic cosine.
    Cosh = 11,
    /// Hyperbolic tangent.
    Tanh = 12,
    /// Error function.
    Erf = 13,
    /// The largest whole number that is not larger: in resets of transitions, and nowhere else.
    Floor = 14,
    /// a + b
    Add = 20,
    /// a - b
    Sub = 21,
    /// a b
    Mul = 22,
    /// a / b
    Div = 23,
    /// a to the power of b; for a constant integer b any a is allowed.
    Pow = 24,
    /// Angle of the point (b, a).
    Atan2 = 25,
    /// Condition a > 0; the same as a >= 0, the solution is Filippov's.
    Positive = 40,
    /// Condition: not a.
    Not = 41,
    /// Condition: a and b.
    And = 42,
    /// Condition: a or b.
    Or = 43,
    /// b where the condition a holds, else c.
    Where = 44,
    /// Sign of a. This one and those below switch: they are for the derivatives of models only.
    Sign = 45,
    /// Modulus of a.
    Abs = 46,
    /// The smaller of a and b.
    Min = 47,
    /// The larger of a and b.
    Max = 48,
    /// a limited to the interval from b to c.
    Clip = 49,
    /// b where a > 0, else c.
    Relay = 50,
    /// Distance of a from the interval from -b to b, with sign.
    DeadZone = 51,
}

/// Kinds of tables.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_table {
    /// Constant pieces between breaks, one value more than breaks; jumps without switching functions: for functions of
    /// time with breaks on the grid.
    Steps = 0,
    /// Straight lines through points, constant outside.
    Lines = 1,
    /// Cubic spline through points with two continuous derivatives.
    Spline = 2,
}

pub(super) unsafe fn ids(d: &Dag, p: *const i64, n: i64, what: &str) -> Result<Vec<Id>> {
    let numbers = unsafe { raw::slice(p, n, what)? };
    let wrong = |v: i64| Error::Range(format!("{what} holds {v}: expressions count from 0"));
    numbers.iter().map(|&v| usize::try_from(v).map_err(|_| wrong(v)).and_then(|v| d.id(v))).collect()
}

/// Expressions of which none is a condition.
unsafe fn values(d: &Dag, p: *const i64, n: i64, what: &str) -> Result<Vec<Id>> {
    let ids = unsafe { ids(d, p, n, what)? };
    match ids.iter().position(|&a| d.is_condition(a)) {
        Some(k) => Err(Error::Range(format!("{what}[{k}] is a condition, not a value: choose values with where"))),
        None => Ok(ids),
    }
}

unsafe fn put(p: *mut i64, n: i64, ids: &[Id], what: &str) -> Result<()> {
    let numbers: Vec<i64> = ids.iter().map(|i| i.index() as i64).collect();
    unsafe { raw::write_slice(p, n, &numbers, what) }
}

fn dims(nx: i64, nu: i64, np: i64) -> Result<Dims> {
    Ok(Dims { x: size(nx, "nx")?, u: size(nu, "nu")?, p: size(np, "np")? })
}

/// Create a graph without expressions.
///
/// @param[out] out the new object, NULL on failure; free with swb_expr_free
/// @return SWB_OK; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_expr_create(out: *mut *mut swb_expr) -> swb_status {
    guard(|| unsafe { handle::create(out, |_| Ok(Dag::new())) })
}

/// Constants. Values that are not finite are refused when a function is made of them.
///
/// @param[in]  values [n]
/// @param[out] out    [n_out] the expressions, as many as values
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_expr_constants(
    graph: *mut swb_expr,
    values: *const f64,
    n: i64,
    out: *mut i64,
    n_out: i64,
) -> swb_status {
    guard(|| unsafe {
        let values = raw::slice(values, n, "values")?;
        let ids = handle::with_mut(graph, |d| Ok(values.iter().map(|&v| d.constant(v)).collect::<Vec<Id>>()))?;
        put(out, n_out, &ids, "out")
    })
}

/// Inputs of one block.
///
/// @param[in]  block one value of enum swb_input
/// @param[in]  first index of the first one
/// @param[out] out   [n] the expressions
/// @return SWB_OK; SWB_ERR_RANGE if there is no such block; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_expr_inputs(
    graph: *mut swb_expr,
    block: i32,
    first: i64,
    out: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let block = match block {
            1 => Block::X,
            2 => Block::U,
            4 => Block::P,
            8 => Block::T,
            _ => return Err(Error::Range(format!("block is {block}: it must be one value of enum swb_input"))),
        };
        let (first, count) = (sizes::index(first, "first")?, sizes::index(n, "n")?);
        if block == Block::T && first + count > 1 {
            return Err(Error::Dimension("there is one time: first must be 0 and n 1".into()));
        }
        let ids = handle::with_mut(graph, |d| Ok((0..count).map(|i| d.input(block, first + i)).collect::<Vec<Id>>()))?;
        put(out, n, &ids, "out")
    })
}

/// Apply an operator element by element.
///
/// @param[in]  op  enum swb_operator
/// @param[in]  a   [n]
/// @param[in]  b   [n]; NULL for operators of one operand
/// @param[in]  c   [n]; NULL for operators of one or two operands
/// @param[out] out [n] the expressions
/// @return SWB_OK; SWB_ERR_RANGE if there is no such operator or expression, or for a condition in the place of a
///         value; SWB_ERR_NULL; SWB_ERR_DIMENSION if an operand is too many
#[no_mangle]
pub unsafe extern "C" fn swb_expr_apply(
    graph: *mut swb_expr,
    op: i32,
    a: *const i64,
    b: *const i64,
    c: *const i64,
    out: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let op = Operator::from_number(op)?;
        let arity = op.arity();
        for (k, (p, name)) in [(b, "b"), (c, "c")].into_iter().enumerate() {
            if k + 2 > arity && !p.is_null() {
                return Err(Error::Dimension(format!("{name} is given, but {op:?} takes {arity} operands")));
            }
        }
        let made = handle::with_mut(graph, |d| {
            let mut columns = Vec::with_capacity(arity);
            for (p, name) in [(a, "a"), (b, "b"), (c, "c")].into_iter().take(arity) {
                columns.push(ids(d, p, n, name)?);
            }
            let row = |k: usize| columns.iter().map(|c| c[k]).collect::<Vec<Id>>();
            (0..sizes::index(n, "n")?).map(|k| d.apply(op, &row(k))).collect::<Result<Vec<Id>>>()
        })?;
        put(out, n, &made, "out")
    })
}

/// Product of matrices stored by columns: a is m times k, b is k times n.
///
/// @param[in]  a   [n_a] m * k expressions
/// @param[in]  b   [n_b] k * n expressions
/// @param[out] out [n_out] m * n expressions
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_expr_matmul(
    graph: *mut swb_expr,
    m: i64,
    k: i64,
    n: i64,
    a: *const i64,
    n_a: i64,
    b: *const i64,
    n_b: i64,
    out: *mut i64,
    n_out: i64,
) -> swb_status {
    guard(|| unsafe {
        let made = handle::with_mut(graph, |d| {
            let (a, b) = (values(d, a, n_a, "a")?, values(d, b, n_b, "b")?);
            d.matmul(sizes::size(m, "m")?, sizes::size(k, "k")?, sizes::size(n, "n")?, &a, &b)
        })?;
        put(out, n_out, &made, "out")
    })
}

/// Solution of a small linear system. The matrix is decomposed numerically where the solution is evaluated, once for
/// all right-hand sides and derivatives.
///
/// @param[in]  matrix [n_matrix] n * n expressions by columns
/// @param[in]  rhs    [n]
/// @param[out] out    [n] the expressions
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if the matrix is singular whatever its entries are
#[no_mangle]
pub unsafe extern "C" fn swb_expr_solve(
    graph: *mut swb_expr,
    matrix: *const i64,
    n_matrix: i64,
    rhs: *const i64,
    out: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let made = handle::with_mut(graph, |d| {
            let (a, b) = (values(d, matrix, n_matrix, "matrix")?, values(d, rhs, n, "rhs")?);
            d.solve(&a, &b)
        })?;
        put(out, n, &made, "out")
    })
}

/// Unknowns of an inner problem: they stand for what swb_expr_implicit, swb_expr_inner_minimum and swb_expr_signed_distance find, and occur
/// nowhere else.
///
/// @param[out] out [n] the expressions
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_expr_unknowns(graph: *mut swb_expr, out: *mut i64, n: i64) -> swb_status {
    guard(|| unsafe {
        let n_unknowns = sizes::index(n, "n")?;
        let made = handle::with_mut(graph, |d| Ok(d.unknowns(n_unknowns)))?;
        put(out, n, &made, "out")
    })
}

/// Solution of n equations G = 0 of n unknowns, found by a damped Newton method where it is evaluated. Its derivatives are exact and of any
/// order (implicit function theorem). Where none is found the expression is not defined.
///
/// @param[in]  equations [n] what is zero
/// @param[in]  unknowns  [n] from swb_expr_unknowns, each once
/// @param[in]  start     [n] where they are looked for, without unknowns
/// @param[out] out       [n] the expressions
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
#[no_mangle]
pub unsafe extern "C" fn swb_expr_implicit(
    graph: *mut swb_expr,
    equations: *const i64,
    unknowns: *const i64,
    start: *const i64,
    out: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let made = handle::with_mut(graph, |d| {
            let g = values(d, equations, n, "equations")?;
            let (w, s) = (values(d, unknowns, n, "unknowns")?, values(d, start, n, "start")?);
            d.implicit(&g, &w, &s)
        })?;
        put(out, n, &made, "out")
    })
}

/// Least value of an expression over n unknowns near a start, and where it is. Newton's method descends in every step. Derivatives are exact and
/// of any order (envelope theorem), where the second derivatives of the cost are positive definite.
///
/// @param[in]  cost     what is least
/// @param[in]  unknowns [n] from swb_expr_unknowns, each once
/// @param[in]  start    [n] where they are looked for, without unknowns
/// @param[out] least    [1] the least value
/// @param[out] out      [n] where it is
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
#[no_mangle]
pub unsafe extern "C" fn swb_expr_inner_minimum(
    graph: *mut swb_expr,
    cost: i64,
    unknowns: *const i64,
    start: *const i64,
    least: *mut i64,
    out: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let (value, made) = handle::with_mut(graph, |d| {
            let cost = values(d, &cost, 1, "cost")?[0];
            let (w, s) = (values(d, unknowns, n, "unknowns")?, values(d, start, n, "start")?);
            d.inner_minimum(cost, &w, &s)
        })?;
        put(least, 1, &[value], "least")?;
        put(out, n, &made, "out")
    })
}

/// Signed distance of two strictly convex bodies A and B, and the unit normal from B to A: the largest value of d . between - support over unit
/// vectors d. It is smooth through zero, and its derivatives are exact.
///
/// @param[in]  between   [n] the way from the origin of B to that of A
/// @param[in]  support   expression of the direction d: the support function of A at -d plus that of B at d, where the support function of a body
///                       is the largest value of d . x over its points x from its origin; of an ellipsoid sqrt(d . S d)
/// @param[in]  direction [n] from swb_expr_unknowns: the components of d
/// @param[in]  start     [n] a first guess of the normal, such as between, without unknowns
/// @param[in]  size      a length of the order of the bodies, positive: it scales the iteration
/// @param[out] gap       [1] the signed distance
/// @param[out] normal    [n] the normal
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_UNSUPPORTED for operators that switch
#[no_mangle]
pub unsafe extern "C" fn swb_expr_signed_distance(
    graph: *mut swb_expr,
    between: *const i64,
    support: i64,
    direction: *const i64,
    start: *const i64,
    size: f64,
    gap: *mut i64,
    normal: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let (value, made) = handle::with_mut(graph, |d| {
            let support = values(d, &support, 1, "support")?[0];
            let (c, w) = (values(d, between, n, "between")?, values(d, direction, n, "direction")?);
            let s = values(d, start, n, "start")?;
            d.signed_distance(&c, support, &w, &s, size)
        })?;
        put(gap, 1, &[value], "gap")?;
        put(normal, n, &made, "normal")
    })
}

/// Forces of Lagrange's equations that follow from an inertia matrix M and a potential V: with T = v' M v / 2 these are
/// -dV/dq + dT/dq - d(M v)/dq v - dM/dt v, what stands beside M v' where q' = v. Add to them what else there is.
///
/// @param[in]  inertia   [n_inertia] n times n expressions of coordinates, parameters and time, symmetric
/// @param[in]  potential expression of the same
/// @param[in]  q         [n] the coordinates, inputs
/// @param[in]  v         [n] the velocities, inputs
/// @param[out] out       [n] the forces
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_UNSUPPORTED for operators that switch
#[no_mangle]
pub unsafe extern "C" fn swb_expr_lagrangian_forces(
    graph: *mut swb_expr,
    inertia: *const i64,
    n_inertia: i64,
    potential: i64,
    q: *const i64,
    v: *const i64,
    out: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let made = handle::with_mut(graph, |d| {
            let (m, p) = (values(d, inertia, n_inertia, "inertia")?, values(d, &potential, 1, "potential")?[0]);
            let (q, v) = (values(d, q, n, "q")?, values(d, v, n, "v")?);
            d.lagrangian_forces(&m, p, &q, &v)
        })?;
        put(out, n, &made, "out")
    })
}

/// Values of a table.
///
/// @param[in]  kind   enum swb_table
/// @param[in]  points [n_points] increasing
/// @param[in]  values [n_values]
/// @param[in]  a      [n] arguments
/// @param[out] out    [n] the expressions
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_expr_table(
    graph: *mut swb_expr,
    kind: i32,
    points: *const f64,
    n_points: i64,
    values: *const f64,
    n_values: i64,
    a: *const i64,
    out: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let (points, v) = (raw::slice(points, n_points, "points")?, raw::slice(values, n_values, "values")?);
        let table = match kind {
            0 => Piecewise::steps(points, v)?,
            1 => Piecewise::lines(points, v)?,
            2 => Piecewise::spline(points, v)?,
            _ => return Err(Error::Range(format!("kind is {kind}: it must be a value of enum swb_table"))),
        };
        let made = handle::with_mut(graph, |d| {
            let a = self::values(d, a, n, "a")?;
            Ok(a.into_iter().map(|a| d.piecewise(&table, a)).collect::<Vec<Id>>())
        })?;
        put(out, n, &made, "out")
    })
}

/// Outputs of a function at expressions. Derivatives are those of the function.
///
/// @param[in]  args [n_args] one for each input: x, u, p, then t
/// @param[out] out  [n_out] the expressions, one for each output
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_expr_call(
    graph: *mut swb_expr,
    f: *const swb_function,
    args: *const i64,
    n_args: i64,
    out: *mut i64,
    n_out: i64,
) -> swb_status {
    guard(|| unsafe {
        let f = shared(f, "f")?;
        let made = handle::with_mut(graph, |d| {
            let args = values(d, args, n_args, "args")?;
            d.call(&f, &args)
        })?;
        put(out, n_out, &made, "out")
    })
}

/// Jacobian of expressions as expressions, by columns; entries that vanish are the constant 0.
///
/// @param[in]  outputs [n_outputs]
/// @param[in]  wrt     [n_wrt] inputs, each once
/// @param[out] out     [n_out] n_outputs * n_wrt expressions
/// @return SWB_OK; SWB_ERR_RANGE if wrt holds what is no input; SWB_ERR_UNSUPPORTED for operators that switch
#[no_mangle]
pub unsafe extern "C" fn swb_expr_jacobian(
    graph: *mut swb_expr,
    outputs: *const i64,
    n_outputs: i64,
    wrt: *const i64,
    n_wrt: i64,
    out: *mut i64,
    n_out: i64,
) -> swb_status {
    guard(|| unsafe {
        let made = handle::with_mut(graph, |d| {
            let (f, x) = (values(d, outputs, n_outputs, "outputs")?, values(d, wrt, n_wrt, "wrt")?);
            d.dense_jacobian(&f, &x)
        })?;
        put(out, n_out, &made, "out")
    })
}

/// An expression as text, cut where it is long.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_expr_text(
    graph: *mut swb_expr,
    expression: i64,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_mut(graph, |d| Ok(d.text(ids(d, &expression, 1, "expression")?[0])))?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// A function with exact derivatives. It does not need the graph any more. With one output it may have abs, min and max in it as
/// swb_ocp_set_lagrange says; others than the costs of optimal control problems refuse it then.
///
/// @param[in]  name    used in messages, such as "f0"
/// @param[in]  outputs [n_outputs]
/// @param[out] out     the new object, NULL on failure; free with swb_function_free
/// @return SWB_OK; SWB_ERR_DIMENSION if an input is outside its block; SWB_ERR_NONFINITE for constants that are not
///         finite; SWB_ERR_UNSUPPORTED for other operators that switch
#[no_mangle]
pub unsafe extern "C" fn swb_expr_function(
    graph: *mut swb_expr,
    name: *const c_char,
    nx: i64,
    nu: i64,
    np: i64,
    outputs: *const i64,
    n_outputs: i64,
    out: *mut *mut swb_function,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let (name, dims) = (raw::text(name, "name")?, dims(nx, nu, np)?);
            handle::with_mut(graph, |d| {
                let outputs = ids(d, outputs, n_outputs, "outputs")?;
                Ok(UserFunction::ready(d.function(name, dims, &outputs)?))
            })
        })
    })
}

/// Free the graph; functions and models made of it stay. NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_expr_free(graph: *mut swb_expr) {
    unsafe { handle::free(graph) }
}

/// Build a model from the derivatives of its states; operators that switch become switching functions and modes.
///
/// The time it takes grows with the number of expressions the derivatives consist of, about ten microseconds each. There
/// may be 2097152 of them.
///
/// @param[in]  name  used in messages
/// @param[in]  rhs   [nx] the derivative of every state
/// @param[in]  names names of states, controls and parameters, one in each line, empty lines for x[0] and so on; may be
///                   NULL
/// @param[in]  trial where all functions should be defined, which the report says if not; may be NULL
/// @param[out] out   the new object, NULL on failure; free with swb_model_free
/// @return SWB_OK; SWB_ERR_UNSUPPORTED if too many switching functions are coupled or there are too many expressions; else
///         as swb_expr_function
#[no_mangle]
pub unsafe extern "C" fn swb_model_create(
    graph: *mut swb_expr,
    name: *const c_char,
    nx: i64,
    nu: i64,
    np: i64,
    rhs: *const i64,
    names: *const c_char,
    trial: *const swb_point,
    out: *mut *mut swb_model,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let (name, d) = (raw::text(name, "name")?, dims(nx, nu, np)?);
            let mut model = Model::new(name, d.x, d.u, d.p)?;
            if !names.is_null() {
                let all: Vec<String> = raw::text(names, "names")?.split('\n').map(str::to_owned).collect();
                let mut rest = all.into_iter();
                let mut take = |n: usize| rest.by_ref().take(n).collect::<Vec<String>>();
                model.set_names(Names { x: take(d.x), u: take(d.u), p: take(d.p) });
            }
            if !trial.is_null() {
                let at = raw::read(trial, "trial")?;
                model.set_trial(Trial {
                    t: at.t,
                    x: raw::slice(at.x, nx, "trial->x")?.to_vec(),
                    u: raw::slice(at.u, nu, "trial->u")?.to_vec(),
                    p: raw::slice(at.p, np, "trial->p")?.to_vec(),
                })?;
            }
            handle::with_mut(graph, |dag| {
                for (i, id) in ids(dag, rhs, nx, "rhs")?.into_iter().enumerate() {
                    model.set_derivative(i, id)?;
                }
                model.build_in(dag)
            })
        })
    })
}

/// The system of a model.
///
/// @param[out] out the new object, NULL on failure; free with swb_system_free
/// @return SWB_OK; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_model_system(model: *const swb_model, out: *mut *mut swb_system) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            handle::require(model)?;
            handle::with_ref(model, |m| Ok(m.system.clone()))
        })
    })
}

/// Sizes of the parts of a model. Any output may be NULL.
///
/// @param[out] n_subsystems          groups of terms that switch together
/// @param[out] n_switching_functions of all subsystems
/// @param[out] n_regions             of all subsystems
/// @param[out] n_algebraic           algebraic variables at each point
/// @param[out] n_pairs               complementarity pairs at each point
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_model_counts(
    model: *const swb_model,
    n_subsystems: *mut i64,
    n_switching_functions: *mut i64,
    n_regions: *mut i64,
    n_algebraic: *mut i64,
    n_pairs: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(model, |m| {
            let r = &m.report;
            raw::write_optional(n_subsystems, r.groups.len() as i64);
            raw::write_optional(n_switching_functions, r.n_switching_functions() as i64);
            raw::write_optional(n_regions, r.n_regions() as i64);
            raw::write_optional(n_algebraic, r.n_algebraic() as i64);
            raw::write_optional(n_pairs, r.n_pairs() as i64);
            Ok(())
        })
    })
}

/// Report of a model: states, switching functions, modes, algebraic variables and pairs with where they come from, what
/// was dropped or merged and why, and what looks wrong.
///
/// @param[in]  json   0 for text, 1 for an object of JSON
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_model_report(
    model: *const swb_model,
    json: i32,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_ref(model, |m| Ok(if json == 0 { m.report.to_string() } else { m.report.json() }))?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// C code of all functions of a model with their derivatives: f0, then modes0, psi0, modes1, ..., then guard0 and, if there is
/// one, reset0, guard1, ...
///
/// Functions g that are called (swb_expr_call) are declared as g_value, g_jacobian, g_hessian, those that are needed, to
/// be supplied where the code is linked: the arguments are (t, x, u, p, out), of the Hessian (t, x, u, p, weights, out);
/// they write all entries, of the patterns beside the declarations, and return 0, or a code to return.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE if a function that is called has no name in C, or that of another; SWB_ERR_DIMENSION if
///         the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_model_write_c(
    model: *const swb_model,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_ref(model, |m| {
            let all: Vec<&ExprFunction> = m.functions.iter().map(|f| f.as_ref()).collect();
            write_c(&all)
        })?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// Write a model as a functional mock-up unit (FMI) for model exchange and co-simulation. A copy of the shared library is in it: no compiler is
/// needed.
///
/// Variables are the states, their derivatives, the controls (inputs) and the parameters (tunable), by their names. Models with more coupled switching
/// functions than a list of modes can hold become units for co-simulation alone.
///
/// @param[in] path     of the file, UTF-8; its name without the ending .fmu is that of the unit, a C identifier
/// @param[in] library  path of the shared library of switchback, as dlopen or the linker has found it
/// @param[in] version  2 for FMI 2.0, 3 for FMI 3.0
/// @param[in] x0       [nx] states at the start, the discrete ones too
/// @param[in] u0       [nu] controls at the start
/// @param[in] p0       [np] parameters
/// @param[in] rtol     relative tolerance of co-simulation; importers may ask for another one
/// @param[in] atol     absolute tolerance of co-simulation
/// @param[in] duration usual length of a simulation
/// @return SWB_OK; SWB_ERR_RANGE if the name is no C identifier, a value is not finite or not positive, or a file cannot be read or written;
///         SWB_ERR_DIMENSION; SWB_ERR_STATE if the model calls functions of the caller
#[no_mangle]
pub unsafe extern "C" fn swb_model_write_fmu(
    model: *const swb_model,
    path: *const c_char,
    library: *const c_char,
    version: i64,
    x0: *const f64,
    nx: i64,
    u0: *const f64,
    nu: i64,
    p0: *const f64,
    np: i64,
    rtol: f64,
    atol: f64,
    duration: f64,
) -> swb_status {
    guard(|| unsafe {
        let (path, library) = (raw::text(path, "path")?, raw::text(library, "library")?);
        let version = match version {
            2 => FmiVersion::Two,
            3 => FmiVersion::Three,
            _ => return Err(Error::Range(format!("version is {version}: take 2 or 3"))),
        };
        let values = |v, n, what| Ok::<_, Error>(raw::slice(v, n, what)?.to_vec());
        let (x, u, p) = (values(x0, nx, "x0")?, values(u0, nu, "u0")?, values(p0, np, "p0")?);
        let start = Start { x, u, p, rtol, atol, duration };
        handle::with_ref(model, |m| fmu::write(m, version, &start, Path::new(library), Path::new(path)))
    })
}

/// Free; systems made of the model stay. NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_model_free(model: *mut swb_model) {
    unsafe { handle::free(model) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operators_have_the_numbers_of_the_library() {
        macro_rules! same {
            ($($name:ident)*) => {{
                $(assert_eq!(swb_operator::$name as i32, Operator::$name as i32);)*
                [$(Operator::$name),*]
            }};
        }
        let all = same!(Neg Sqrt Exp Log Sin Cos Tan Asin Acos Atan Sinh Cosh Tanh Erf Floor Add Sub Mul Div Pow Atan2
            Positive Not And Or Where Sign Abs Min Max Clip Relay DeadZone);
        assert_eq!(all, Operator::ALL);
    }
}
