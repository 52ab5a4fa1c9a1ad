//! User functions: C callbacks with `user_data` as [`switchback::func::Function`] objects.

use super::guard::guard;
use super::handle::{self, setting, Object};
use super::raw;
use super::status::swb_status;
use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use switchback::error::{Error, Result};
use switchback::func::trouble::{self, Complaint};
use switchback::func::{check_derivatives, Callback, CheckSettings, Dims, EvalError, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::memory::{self, sizes, sizes::size};
use switchback::system::SharedFunction;

/// Function with first and second derivatives: reference counted inside, so the handle may be freed as
/// soon as the function was handed to a model.
pub struct swb_function(());
impl Object for swb_function {
    type Value = UserFunction;
    const NAME: &'static str = "swb_function";
}

/// Inputs of a function that is evaluated. Derivatives number the inputs in this order: x, u, p, then t.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_point {
    /// Time; NAN during a solve for functions that do not say that they depend on it.
    pub t: f64,
    /// [nx] states, or the variables of a program; NULL if nx is 0.
    pub x: *const f64,
    /// [nu] controls; NULL if nu is 0.
    pub u: *const f64,
    /// [np] parameters; NULL if np is 0.
    pub p: *const f64,
}

/// Value: writes out [n_out], which comes filled with zeros.
///
/// Returns 0; a positive number if the function is not defined at the point, which makes the solver try
/// another one (so do values that are not finite); a negative number to end the call with SWB_ERR_USER.
/// May be called by every thread that uses an object with this function, and by threads of the library where several
/// simulations or solves run at once (swb_batch_run, swb_ocp_solve_starts), unless swb_function_set_flags says SWB_SERIAL.
pub type swb_value_fn =
    Option<unsafe extern "C" fn(at: *const swb_point, out: *mut f64, user_data: *mut c_void) -> i32>;

/// Jacobian: writes out [nnz], the values of the entries of the pattern; comes filled with zeros. Returns
/// as swb_value_fn.
pub type swb_jacobian_fn =
    Option<unsafe extern "C" fn(at: *const swb_point, out: *mut f64, user_data: *mut c_void) -> i32>;

/// Hessian of the sum of the outputs weighted with weights [n_out]: writes out [nnz], the values of the
/// entries of the pattern; comes filled with zeros. Returns as swb_value_fn.
pub type swb_hessian_fn = Option<
    unsafe extern "C" fn(at: *const swb_point, weights: *const f64, out: *mut f64, user_data: *mut c_void) -> i32,
>;

/// Called once when the last user of a function is gone.
pub type swb_destroy_fn = Option<unsafe extern "C" fn(user_data: *mut c_void)>;

/// Input blocks of a function, to be added up.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_input {
    /// States, or variables.
    X = 1,
    /// Controls.
    U = 2,
    /// Parameters.
    P = 4,
    /// Time.
    T = 8,
}

/// Properties of a function, to be added up; see swb_function_set_flags.
///
/// cbindgen:rename-all=None
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_function_flag {
    /// The callbacks are called by the thread that calls the library only, and one at a time: calls that would work on
    /// several threads use one. For functions in languages whose run time does not know the threads of the library, and
    /// for functions that keep something between calls.
    SWB_SERIAL = 1,
}

/// The user's pointer, and how to give it back.
struct UserData {
    pointer: *mut c_void,
    destroy: swb_destroy_fn,
    /// The function was handed out: until then the pointer stays the caller's.
    ours: AtomicBool,
}

impl UserData {
    /// A pointer that is not given back.
    fn borrowed(pointer: *mut c_void) -> Arc<UserData> {
        Arc::new(UserData { pointer, destroy: None, ours: AtomicBool::new(false) })
    }
}

// SAFETY: the pointer is only passed on; the header asks for functions that may be called by every thread
// that uses an object with them.
unsafe impl Send for UserData {}
unsafe impl Sync for UserData {}

impl Drop for UserData {
    fn drop(&mut self) {
        if let Some(destroy) = self.destroy.filter(|_| *self.ours.get_mut()) {
            // SAFETY: the contract of `swb_destroy_fn`.
            unsafe { destroy(self.pointer) }
        }
    }
}

/// What every adapter knows of its function.
#[derive(Clone)]
pub(super) struct Caller {
    name: Arc<str>,
    data: Arc<UserData>,
    /// The function does not say that it depends on time: it is not told.
    timeless: bool,
}

impl Caller {
    /// For a callback that is no [`UserFunction`]; `pointer` stays the caller's.
    pub fn new(name: &str, pointer: *mut c_void) -> Caller {
        Caller { name: name.into(), data: UserData::borrowed(pointer), timeless: false }
    }

    /// Calls back with the point in C and notes complaints.
    pub fn call(
        &self,
        part: &'static str,
        at: &Point,
        out: &mut [f64],
        f: impl FnOnce(*const swb_point, *mut f64, *mut c_void) -> i32,
    ) -> i32 {
        if let Some(code) = trouble::fatal() {
            return code;
        }
        let array = |v: &[f64]| if v.is_empty() { ptr::null() } else { v.as_ptr() };
        let blind = self.timeless && trouble::solving();
        let point =
            swb_point { t: if blind { f64::NAN } else { at.t }, x: array(at.x), u: array(at.u), p: array(at.p) };
        let target = if out.is_empty() { ptr::null_mut() } else { out.as_mut_ptr() };
        let code = f(&point, target, self.data.pointer);
        if code == 0 && out.iter().all(|v| v.is_finite()) {
            return 0;
        }
        let bad = out.iter().copied().enumerate().find(|(_, v)| code == 0 && part == "value" && !v.is_finite());
        let place = trouble::place(at, bad);
        trouble::note(Complaint { function: self.name.clone(), part, code, place, timeless: blind });
        if code == 0 {
            1
        } else {
            code
        }
    }
}

/// What is known of a Jacobian.
enum Jacobian {
    /// Nothing.
    Unknown,
    /// The inputs it is dense in, a sum of [`swb_input`]. Its entries are listed when it is needed: a pattern given later takes its place.
    DenseIn(i32),
    /// Its pattern, and its values where they are no differences.
    Given(Pattern, swb_jacobian_fn),
}

/// The pattern of `n_out` rows that is dense in `inputs`, a sum of [`swb_input`].
fn dense_in(name: &str, inputs: i32, dims: Dims, n_out: usize) -> Result<Pattern> {
    let blocks = [(swb_input::X, dims.x), (swb_input::U, dims.u), (swb_input::P, dims.p), (swb_input::T, 1)];
    let blocks = blocks.map(|(block, n)| (inputs & block as i32 != 0, n));
    let columns = blocks.iter().filter(|(takes_part, _)| *takes_part).map(|(_, n)| n).sum();
    let what =
        format!("the Jacobian of '{name}', whose pattern is not given, is dense in its inputs, give the pattern");
    let nnz = sizes::entries(&what, &[n_out, columns])?;
    let (mut col_ptr, mut row_idx) = (memory::with_capacity(dims.n_in() + 1), memory::with_capacity(nnz));
    col_ptr.push(0);
    for (takes_part, n) in blocks {
        for _ in 0..n {
            if takes_part {
                row_idx.extend(0..n_out);
            }
            col_ptr.push(row_idx.len());
        }
    }
    Pattern::new(n_out, dims.n_in(), col_ptr, row_idx)
}

/// A function as the user describes it; made into a [`Callback`] when it is first needed.
pub struct UserFunction {
    name: Arc<str>,
    dims: Dims,
    n_out: usize,
    /// `None` for a function of the library, which is in `callback` from the start.
    value: swb_value_fn,
    data: Arc<UserData>,
    jacobian: Jacobian,
    hessian: Option<(Pattern, swb_hessian_fn)>,
    linear: bool,
    serial: bool,
    callback: OnceLock<SharedFunction>,
    /// A model has it: its description is fixed.
    used: AtomicBool,
}

impl UserFunction {
    /// A function that the library made.
    pub fn ready(f: SharedFunction) -> UserFunction {
        UserFunction {
            name: f.name().into(),
            dims: f.dims(),
            n_out: f.n_out(),
            value: None,
            data: UserData::borrowed(ptr::null_mut()),
            jacobian: Jacobian::Unknown,
            hessian: None,
            linear: false,
            serial: false,
            callback: OnceLock::from(f),
            used: AtomicBool::new(true),
        }
    }

    fn build(&self) -> Result<Callback> {
        let value = self.value.ok_or_else(|| Error::Internal("a function without callback".into()))?;
        let timeless = match &self.jacobian {
            Jacobian::Unknown => true,
            Jacobian::DenseIn(inputs) => inputs & swb_input::T as i32 == 0,
            Jacobian::Given(pattern, _) => pattern.rows(self.dims.t_col()).is_empty(),
        };
        let caller = Caller { name: self.name.clone(), data: self.data.clone(), timeless };
        let c = caller.clone();
        // SAFETY: here and below, the functions obey the contracts of their types, the pointers live as long
        // as the call and have the lengths the header promises.
        let mut f = Callback::new(&self.name, self.dims, self.n_out, move |at, out| {
            c.call("value", at, out, |p, o, d| unsafe { value(p, o, d) })
        });
        f = match &self.jacobian {
            Jacobian::Unknown => f,
            Jacobian::DenseIn(inputs) => {
                f.with_jacobian_pattern(dense_in(&self.name, *inputs, self.dims, self.n_out)?)?
            }
            Jacobian::Given(pattern, None) => f.with_jacobian_pattern(pattern.clone())?,
            &Jacobian::Given(ref pattern, Some(jacobian)) => {
                let c = caller.clone();
                f.with_jacobian(pattern.clone(), move |at, out| {
                    c.call("Jacobian", at, out, |p, o, d| unsafe { jacobian(p, o, d) })
                })?
            }
        };
        if let Some((pattern, hessian)) = &self.hessian {
            f = match *hessian {
                None => f.with_hessian_pattern(pattern.clone())?,
                Some(hessian) => f.with_hessian(pattern.clone(), move |at, weights, out| {
                    caller.call("Hessian", at, out, |p, o, d| unsafe { hessian(p, weights.as_ptr(), o, d) })
                })?,
            };
        }
        let f = if self.linear { f.linear() } else { f };
        Ok(if self.serial { f.serial() } else { f })
    }

    fn callback(&self) -> Result<&SharedFunction> {
        if self.callback.get().is_none() {
            let built: SharedFunction = Arc::new(self.build()?);
            // another thread may have been faster, with the same result
            let _ = self.callback.set(built);
        }
        self.callback.get().ok_or_else(|| Error::Internal("a function without callback".into()))
    }

    /// The description may change: nobody uses the function yet.
    fn open(&mut self) -> Result<&mut UserFunction> {
        if self.value.is_none() {
            return Err(Error::State(format!(
                "function '{}' was made with its derivatives: they cannot be given again",
                self.name
            )));
        }
        if self.used.load(Ordering::Relaxed) {
            return Err(Error::State(format!(
                "function '{}' belongs to a model already: describe its derivatives before handing it over",
                self.name
            )));
        }
        self.callback.take();
        Ok(self)
    }

    /// Evaluates directly, with the point of the caller.
    fn evaluate<R>(&self, body: impl FnOnce(&dyn Function, &mut [f64]) -> R) -> Result<(R, trouble::Troubles)> {
        let f = self.callback()?.as_ref();
        let mut work = vec![0.0; f.work_len()];
        Ok(trouble::collect(false, || body(f, &mut work)))
    }

    fn values(
        &self,
        len: impl FnOnce(&dyn Function) -> usize,
        body: impl FnOnce(&dyn Function, &mut [f64], &mut [f64]) -> EvalResult,
    ) -> Result<Vec<f64>> {
        let mut out = vec![0.0; len(self.callback()?.as_ref())];
        let (result, troubles) = self.evaluate(|f, work| body(f, &mut out, work))?;
        match result {
            Ok(()) => Ok(out),
            Err(e) => Err(match (troubles.fatal.or(troubles.last), e) {
                (Some(complaint), _) => complaint.error(),
                (None, EvalError::Fatal(code)) => Error::User { code, what: format!("function '{}'", self.name) },
                (None, EvalError::Stopped) => switchback::stop::error(),
                (None, EvalError::Recoverable) => {
                    Error::NonFinite(format!("function '{}' is not defined at the point", self.name))
                }
            }),
        }
    }

    /// The point of the caller.
    unsafe fn point(&self, at: *const swb_point) -> Result<Point<'_>> {
        unsafe { point(at, self.dims) }
    }
}

/// A point of the caller with so many values.
pub(super) unsafe fn point<'a>(at: *const swb_point, dims: Dims) -> Result<Point<'a>> {
    unsafe {
        let at = raw::read(at, "at")?;
        Ok(Point {
            t: at.t,
            x: raw::slice(at.x, dims.x as i64, "at->x")?,
            u: raw::slice(at.u, dims.u as i64, "at->u")?,
            p: raw::slice(at.p, dims.p as i64, "at->p")?,
        })
    }
}

/// The function behind a handle, shared with a model.
pub unsafe fn shared(f: *const swb_function, what: &str) -> Result<SharedFunction> {
    let f = unsafe { shared_cost(f, what) }?;
    if f.kinked().is_some() {
        return Err(Error::Unsupported(format!(
            "{what}: function '{}' has abs, min or max in it, which only the costs of an optimal control problem may have. A constraint is stated \
             without: abs(a) <= b as -b <= a <= b, max(a, b) <= c as a <= c and b <= c; a model of the dynamics turns them into switching \
             functions",
            f.name()
        )));
    }
    Ok(f)
}

/// [`shared`] where the function may have kinks.
pub unsafe fn shared_cost(f: *const swb_function, what: &str) -> Result<SharedFunction> {
    if f.is_null() {
        return Err(Error::Null(format!("{what} is NULL{}", handle::why_null::<swb_function>())));
    }
    handle::require(f)?;
    unsafe {
        handle::with_ref(f, |f| {
            let callback = f.callback()?.clone();
            f.used.store(true, Ordering::Relaxed);
            Ok(callback)
        })
    }
}

/// [`shared`] where NULL means that there is no function.
pub unsafe fn shared_optional(f: *const swb_function, what: &str) -> Result<Option<SharedFunction>> {
    if f.is_null() {
        return Ok(None);
    }
    unsafe { shared(f, what).map(Some) }
}

const COLUMNS: &str = "x, u, p and t";

/// The pattern of the caller, `rows × cols`; `columns` says what the columns stand for.
pub(super) unsafe fn pattern(
    what: &str,
    columns: &str,
    (rows, cols): (usize, usize),
    (col_ptr, n_col_ptr): (*const i64, i64),
    (row_idx, nnz): (*const i64, i64),
) -> Result<Pattern> {
    let (col_ptr, row_idx) =
        unsafe { (raw::slice(col_ptr, n_col_ptr, "col_ptr")?, raw::slice(row_idx, nnz, "row_idx")?) };
    let index = |v: &[i64], name: &str| -> Result<Vec<usize>> {
        let negative = |k: usize| Error::Range(format!("{what}: {name}[{k}] is {}: indices count from 0", v[k]));
        v.iter().enumerate().map(|(k, &i)| usize::try_from(i).map_err(|_| negative(k))).collect()
    };
    if col_ptr.len() != cols + 1 {
        return Err(Error::Dimension(format!(
            "{what}: col_ptr has {} entries, expected {}: one for each of {columns}, and the number of entries last",
            col_ptr.len(),
            cols + 1
        )));
    }
    Pattern::new(rows, cols, index(col_ptr, "col_ptr")?, index(row_idx, "row_idx")?).map_err(|e| match e {
        Error::Dimension(s) => Error::Dimension(format!("{what}: {s}")),
        Error::Range(s) => Error::Range(format!("{what}: {s}")),
        other => other,
    })
}

/// Create a function given by its values.
///
/// Derivatives are added by swb_function_set_jacobian and swb_function_set_hessian; without them they are
/// finite differences of a function of all x, u and p that does not depend on t (swb_function_set_inputs says
/// otherwise, and fewer inputs make cheaper differences).
///
/// @param[in]  name      used in messages, such as "f0"
/// @param[in]  value     the callback
/// @param[in]  user_data passed on to all callbacks unchanged
/// @param[in]  destroy   called with user_data when handle and models are gone; may be NULL. Not called if
///                       this call fails.
/// @param[out] out       the new object, NULL on failure; free with swb_function_free
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if a size is negative
#[no_mangle]
pub unsafe extern "C" fn swb_function_create(
    name: *const c_char,
    nx: i64,
    nu: i64,
    np: i64,
    n_out: i64,
    value: swb_value_fn,
    user_data: *mut c_void,
    destroy: swb_destroy_fn,
    out: *mut *mut swb_function,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let name: Arc<str> = raw::text(name, "name")?.into();
            let dims = Dims { x: size(nx, "nx")?, u: size(nu, "nu")?, p: size(np, "np")? };
            let n_out = size(n_out, "n_out")?;
            let value = value.ok_or_else(|| Error::Null("value is NULL".into()))?;
            Ok(UserFunction {
                name,
                dims,
                n_out,
                value: Some(value),
                data: Arc::new(UserData { pointer: user_data, destroy, ours: AtomicBool::new(false) }),
                jacobian: Jacobian::Unknown,
                hessian: None,
                linear: false,
                serial: false,
                callback: OnceLock::new(),
                used: AtomicBool::new(false),
            })
        })?;
        handle::with_ref(*out, |f| {
            f.data.ours.store(true, Ordering::Relaxed);
            Ok(())
        })
    })
}

/// Give the Jacobian, n_out rows and a column for each of x, u, p and t.
///
/// Entries outside the pattern are zero for the library.
///
/// @param[in] col_ptr   [nx + nu + np + 2] where the columns start; the last one is nnz
/// @param[in] row_idx   [nnz] rows from 0, increasing within each column
/// @param[in] jacobian  NULL: the pattern alone; the values are differences
/// @return SWB_OK; SWB_ERR_DIMENSION or SWB_ERR_RANGE if this is no such pattern; SWB_ERR_STATE if the
///         function belongs to a model already
#[no_mangle]
pub unsafe extern "C" fn swb_function_set_jacobian(
    f: *mut swb_function,
    col_ptr: *const i64,
    n_col_ptr: i64,
    row_idx: *const i64,
    nnz: i64,
    jacobian: swb_jacobian_fn,
) -> swb_status {
    setting(f, || unsafe {
        handle::with_mut(f, |f| {
            let f = f.open()?;
            let what = format!("Jacobian of '{}'", f.name);
            let shape = (f.n_out, f.dims.n_in());
            let pattern = pattern(&what, COLUMNS, shape, (col_ptr, n_col_ptr), (row_idx, nnz))?;
            f.jacobian = Jacobian::Given(pattern, jacobian);
            Ok(())
        })
    })
}

/// Give the Hessian of the weighted sum of the outputs, upper triangle (row <= column); a row and a column
/// for each of x, u, p and t.
///
/// @param[in] col_ptr   [nx + nu + np + 2] where the columns start; the last one is nnz
/// @param[in] row_idx   [nnz] rows from 0, increasing within each column
/// @param[in] hessian   NULL: the pattern alone; the values are differences
/// @return as swb_function_set_jacobian
#[no_mangle]
pub unsafe extern "C" fn swb_function_set_hessian(
    f: *mut swb_function,
    col_ptr: *const i64,
    n_col_ptr: i64,
    row_idx: *const i64,
    nnz: i64,
    hessian: swb_hessian_fn,
) -> swb_status {
    setting(f, || unsafe {
        handle::with_mut(f, |f| {
            let f = f.open()?;
            let what = format!("Hessian of '{}'", f.name);
            let n = f.dims.n_in();
            let pattern = pattern(&what, COLUMNS, (n, n), (col_ptr, n_col_ptr), (row_idx, nnz))?;
            if !pattern.is_upper() {
                return Err(Error::Range(format!("{what}: entries below the diagonal; give the upper triangle only")));
            }
            f.hessian = Some((pattern, hessian));
            f.linear = false;
            Ok(())
        })
    })
}

/// Say that all second derivatives vanish.
///
/// @return SWB_OK; SWB_ERR_STATE if the function belongs to a model already
#[no_mangle]
pub unsafe extern "C" fn swb_function_set_linear(f: *mut swb_function) -> swb_status {
    setting(f, || unsafe {
        handle::with_mut(f, |f| {
            let f = f.open()?;
            f.hessian = None;
            f.linear = true;
            Ok(())
        })
    })
}

/// Say which inputs the function depends on; the Jacobian is dense in them and made by differences.
///
/// @param[in] inputs sum of enum swb_input, such as SWB_INPUT_X + SWB_INPUT_T
/// @return SWB_OK; SWB_ERR_RANGE if there are no such inputs; SWB_ERR_STATE if the function belongs to a
///         model already
#[no_mangle]
pub unsafe extern "C" fn swb_function_set_inputs(f: *mut swb_function, inputs: i32) -> swb_status {
    setting(f, || unsafe {
        handle::with_mut(f, |f| {
            let f = f.open()?;
            if !(0..16).contains(&inputs) {
                return Err(Error::Range(format!("inputs is {inputs}: it must be a sum of enum swb_input")));
            }
            f.jacobian = Jacobian::DenseIn(inputs);
            Ok(())
        })
    })
}

/// Set properties of a function; those that are not given are taken back.
///
/// @param[in] flags sum of enum swb_function_flag; 0: none
/// @return SWB_OK; SWB_ERR_RANGE if there are no such flags; SWB_ERR_STATE if the function belongs to a model already, or
///         was made by the library
#[no_mangle]
pub unsafe extern "C" fn swb_function_set_flags(f: *mut swb_function, flags: i32) -> swb_status {
    setting(f, || unsafe {
        handle::with_mut(f, |f| {
            let f = f.open()?;
            let serial = swb_function_flag::SWB_SERIAL as i32;
            if flags & !serial != 0 {
                return Err(Error::Range(format!("flags is {flags}: it must be a sum of enum swb_function_flag")));
            }
            f.serial = flags & serial != 0;
            Ok(())
        })
    })
}

/// Sizes of a function. Any output may be NULL.
///
/// @param[out] jacobian_nnz entries of the Jacobian pattern, declared or derived
/// @param[out] hessian_nnz  entries of the Hessian pattern, declared or derived
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_function_sizes(
    f: *const swb_function,
    nx: *mut i64,
    nu: *mut i64,
    np: *mut i64,
    n_out: *mut i64,
    jacobian_nnz: *mut i64,
    hessian_nnz: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(f, |f| {
            let c = f.callback()?;
            raw::write_optional(nx, f.dims.x as i64);
            raw::write_optional(nu, f.dims.u as i64);
            raw::write_optional(np, f.dims.p as i64);
            raw::write_optional(n_out, f.n_out as i64);
            raw::write_optional(jacobian_nnz, c.jac_pattern().nnz() as i64);
            raw::write_optional(hessian_nnz, c.hess_pattern().nnz() as i64);
            Ok(())
        })
    })
}

/// Name of a function.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_function_name(
    f: *const swb_function,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(f, |f| raw::write_text(f.name.as_bytes(), buf, len, needed)) })
}

unsafe fn write_pattern(p: &Pattern, col_ptr: *mut i64, n_col_ptr: i64, row_idx: *mut i64, nnz: i64) -> Result<()> {
    let wide = |v: &[usize]| v.iter().map(|&i| i as i64).collect::<Vec<_>>();
    if n_col_ptr != p.col_ptr().len() as i64 || nnz != p.nnz() as i64 {
        return Err(Error::Dimension(format!(
            "room for {n_col_ptr} column pointers and {nnz} rows, the pattern has {} and {}",
            p.col_ptr().len(),
            p.nnz()
        )));
    }
    raw::check_slice(col_ptr, n_col_ptr, p.col_ptr().len(), "col_ptr")?;
    unsafe {
        raw::write_slice(row_idx, nnz, &wide(p.row_idx()), "row_idx")?;
        raw::write_slice(col_ptr, n_col_ptr, &wide(p.col_ptr()), "col_ptr")
    }
}

/// Pattern of the Jacobian, declared or derived.
///
/// @param[out] col_ptr [nx + nu + np + 2]
/// @param[out] row_idx [nnz]
/// @return SWB_OK; SWB_ERR_DIMENSION if a length is not that of the pattern
#[no_mangle]
pub unsafe extern "C" fn swb_function_jacobian_pattern(
    f: *const swb_function,
    col_ptr: *mut i64,
    n_col_ptr: i64,
    row_idx: *mut i64,
    nnz: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(f, |f| write_pattern(f.callback()?.jac_pattern(), col_ptr, n_col_ptr, row_idx, nnz))
    })
}

/// Pattern of the Hessian, upper triangle, declared or derived.
///
/// @param[out] col_ptr [nx + nu + np + 2]
/// @param[out] row_idx [nnz]
/// @return SWB_OK; SWB_ERR_DIMENSION if a length is not that of the pattern
#[no_mangle]
pub unsafe extern "C" fn swb_function_hessian_pattern(
    f: *const swb_function,
    col_ptr: *mut i64,
    n_col_ptr: i64,
    row_idx: *mut i64,
    nnz: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(f, |f| write_pattern(f.callback()?.hess_pattern(), col_ptr, n_col_ptr, row_idx, nnz))
    })
}

/// Evaluate a function.
///
/// @param[out] out [n_out]
/// @return SWB_OK; SWB_ERR_NONFINITE if it is not defined at the point; SWB_ERR_USER if the callback
///         returned a negative code
#[no_mangle]
pub unsafe extern "C" fn swb_function_eval(
    f: *const swb_function,
    at: *const swb_point,
    out: *mut f64,
    n_out: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(f, |f| {
            let at = f.point(at)?;
            let values = f.values(|f| f.n_out(), |f, out, work| f.value(&at, out, work))?;
            raw::write_slice(out, n_out, &values, "out")
        })
    })
}

/// Evaluate the Jacobian of a function.
///
/// @param[out] out [nnz] values of the entries of the pattern
/// @return as swb_function_eval
#[no_mangle]
pub unsafe extern "C" fn swb_function_eval_jacobian(
    f: *const swb_function,
    at: *const swb_point,
    out: *mut f64,
    nnz: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(f, |f| {
            let at = f.point(at)?;
            let values = f.values(|f| f.jac_pattern().nnz(), |f, out, work| f.jacobian(&at, out, work))?;
            raw::write_slice(out, nnz, &values, "out")
        })
    })
}

/// Evaluate the Hessian of the weighted sum of the outputs of a function.
///
/// @param[in]  weights [n_weights] one for each output
/// @param[out] out     [nnz] values of the entries of the pattern
/// @return as swb_function_eval
#[no_mangle]
pub unsafe extern "C" fn swb_function_eval_hessian(
    f: *const swb_function,
    at: *const swb_point,
    weights: *const f64,
    n_weights: i64,
    out: *mut f64,
    nnz: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(f, |f| {
            let at = f.point(at)?;
            let weights = raw::slice(weights, n_weights, "weights")?;
            if weights.len() != f.n_out {
                return Err(Error::Dimension(format!("{} weights given for {} outputs", weights.len(), f.n_out)));
            }
            let values = f.values(|f| f.hess_pattern().nnz(), |f, out, work| f.hessian(&at, weights, out, work))?;
            raw::write_slice(out, nnz, &values, "out")
        })
    })
}

/// Compare the derivatives of a function at a point with finite differences, inside and outside the
/// declared patterns. The work grows with the square of the number of inputs, and no interrupt reaches it: for functions
/// of thousands of inputs it takes minutes, and only a negative code of a callback ends it before.
///
/// @param[out] passed    1 if nothing disagrees; may be NULL
/// @param[out] max_error largest relative error of an entry, accepted ones included; may be NULL
/// @param[out] buf       [len] the report with its final NUL; NULL with len 0 to ask for the length only
/// @param[out] needed    length with the final NUL; may be NULL
/// @return SWB_OK, also if something disagrees; SWB_ERR_RANGE if the point is not finite;
///         SWB_ERR_DIMENSION if the buffer is too short; else as swb_function_eval
#[no_mangle]
pub unsafe extern "C" fn swb_function_check_derivatives(
    f: *const swb_function,
    at: *const swb_point,
    passed: *mut i32,
    max_error: *mut f64,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(f, |f| {
            let at = f.point(at)?;
            let (report, troubles) =
                f.evaluate(|callback, _| check_derivatives(callback, &at, &CheckSettings::default()))?;
            let report = report.map_err(|e| match (e, troubles.fatal.or(troubles.last)) {
                (Error::User { .. } | Error::NonFinite(_), Some(complaint)) => complaint.error(),
                (e, _) => e,
            })?;
            raw::write_text(report.to_string().as_bytes(), buf, len, needed)?;
            raw::write_optional(passed, report.passed().into());
            raw::write_optional(max_error, report.worst_first.max(report.worst_second));
            Ok(())
        })
    })
}

/// Free the handle; models that have the function keep it. NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_function_free(f: *mut swb_function) {
    unsafe { handle::free(f) }
}
