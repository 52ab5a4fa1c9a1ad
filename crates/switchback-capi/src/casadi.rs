//! Functions that CasADi generated, from a library, from addresses, or from a file.

use super::function::{swb_function, UserFunction};
use super::guard::guard;
use super::status::swb_status;
use super::{handle, raw};
use std::ffi::c_char;
use std::path::Path;
use std::sync::Arc;
use switchback::error::{Error, Result};
use switchback::func::casadi::{self, Code, Symbols};
use switchback::func::{Callback, Dims};
use switchback::memory::sizes::size;

/// Address of code of any kind.
pub type swb_code = Option<unsafe extern "C" fn()>;

/// Addresses of what CasADi generates for a function f; NULL where there is nothing. SWB_CASADI(f) makes one of code
/// that is linked.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_casadi {
    /// sizeof(swb_casadi)
    pub struct_size: u64,
    /// f
    pub eval: swb_code,
    /// f_n_in
    pub n_in: swb_code,
    /// f_n_out
    pub n_out: swb_code,
    /// f_name_in
    pub name_in: swb_code,
    /// f_sparsity_in
    pub sparsity_in: swb_code,
    /// f_sparsity_out
    pub sparsity_out: swb_code,
    /// f_work
    pub work: swb_code,
    /// f_checkout
    pub checkout: swb_code,
    /// f_release
    pub release: swb_code,
    /// f_incref
    pub incref: swb_code,
    /// f_decref
    pub decref: swb_code,
    /// Size of an integer in the generated file, since CasADi 3.8.
    pub int_size: swb_code,
    /// Size of a number in the generated file, since CasADi 3.8.
    pub real_size: swb_code,
}

unsafe fn symbols(p: *const swb_casadi, what: &str) -> Result<Symbols> {
    raw::check(p, what)?;
    // The first field alone, until the size is known.
    let found = unsafe { raw::read(p.cast::<u64>(), what)? };
    let expected = std::mem::size_of::<swb_casadi>() as u64;
    if found != expected {
        return Err(Error::Dimension(format!("{what}->struct_size is {found}, expected {expected}: set it to sizeof")));
    }
    let s = unsafe { raw::read(p, what)? };
    let code = |c: swb_code| -> Option<Code> { c };
    Ok(Symbols {
        eval: code(s.eval),
        n_in: code(s.n_in),
        n_out: code(s.n_out),
        name_in: code(s.name_in),
        sparsity_in: code(s.sparsity_in),
        sparsity_out: code(s.sparsity_out),
        work: code(s.work),
        checkout: code(s.checkout),
        release: code(s.release),
        incref: code(s.incref),
        decref: code(s.decref),
        int_size: code(s.int_size),
        real_size: code(s.real_size),
    })
}

unsafe fn optional_text<'a>(p: *const c_char, what: &str) -> Result<Option<&'a str>> {
    if p.is_null() {
        return Ok(None);
    }
    unsafe { raw::text(p, what).map(Some) }
}

fn dims(nx: i64, nu: i64, np: i64) -> Result<Dims> {
    Ok(Dims { x: size(nx, "nx")?, u: size(nu, "nu")?, p: size(np, "np")? })
}

fn ready(f: Callback) -> UserFunction {
    UserFunction::ready(Arc::new(f))
}

/// Create a function from a shared library made of C code that CasADi generated.
///
/// A function f of CasADi has inputs named x, u, p and t, those it needs, with dense entries; the value is all its
/// outputs, one after the other, by columns. Derivatives are further functions of the library: jac_f or f_jac, as
/// f.jacobian() makes it, or one matrix with a column for each entry of the inputs; hess_f or f_hess of the inputs and
/// weights, one for each output, with the Hessian of the weighted sum, any triangle; or jac_adj1_f, as
/// f.reverse(1).jacobian() makes it. Those that are missing are finite differences. Integers may have 32 or 64 bits,
/// numbers must be double. What the library says of itself is checked; it is called once with zeros. It stays open as
/// long as the function is used. A code that is not 0 counts as not defined at the point.
///
/// The code must be smooth: what jumps or has a kink (sign, fabs, if_else, fmin, floor ...) is stated by modes and
/// switching functions. Compiled code does not show what is inside of it; simulations notice that they chatter, solves of
/// optimal control problems take many iterations. The library must be the whole file: those that end too early are
/// refused, but a file that is damaged otherwise, or changes while it is loaded, can end the process, as with dlopen.
///
/// @param[in]  path   of the library, as for dlopen
/// @param[in]  name   f
/// @param[in]  inputs what the inputs are, such as "x u"; NULL: they have the names x, u, p, t
/// @param[out] out    the new object, NULL on failure; free with swb_function_free
/// @return SWB_OK; SWB_ERR_LIBRARY if the library cannot be loaded or has no such function, or says of itself what
///         cannot be; SWB_ERR_DIMENSION or SWB_ERR_RANGE if sizes or names do not fit; SWB_ERR_UNSUPPORTED for numbers
///         that are not double
#[no_mangle]
pub unsafe extern "C" fn swb_function_from_casadi_library(
    path: *const c_char,
    name: *const c_char,
    inputs: *const c_char,
    nx: i64,
    nu: i64,
    np: i64,
    out: *mut *mut swb_function,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let path = Path::new(raw::text(path, "path")?);
            let (name, inputs) = (raw::text(name, "name")?, optional_text(inputs, "inputs")?);
            casadi::from_library(path, name, dims(nx, nu, np)?, inputs).map(ready)
        })
    })
}

/// Create a function from C code that CasADi generated and that is linked to the program; as
/// swb_function_from_casadi_library.
///
/// @param[in]  name     used in messages
/// @param[in]  value    addresses of f
/// @param[in]  jacobian addresses of jac_f, of any of the forms; NULL: finite differences
/// @param[in]  hessian  addresses of hess_f or jac_adj1_f; NULL: finite differences
/// @param[in]  inputs   what the inputs are, such as "x u"; NULL: they have the names x, u, p, t
/// @param[out] out      the new object, NULL on failure; free with swb_function_free
/// @return as swb_function_from_casadi_library
#[no_mangle]
pub unsafe extern "C" fn swb_function_from_casadi_pointers(
    name: *const c_char,
    value: *const swb_casadi,
    jacobian: *const swb_casadi,
    hessian: *const swb_casadi,
    inputs: *const c_char,
    nx: i64,
    nu: i64,
    np: i64,
    out: *mut *mut swb_function,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let (name, inputs) = (raw::text(name, "name")?, optional_text(inputs, "inputs")?);
            let optional = |p: *const swb_casadi, what| (!p.is_null()).then(|| symbols(p, what)).transpose();
            let value = symbols(value, "value")?;
            let (jacobian, hessian) = (optional(jacobian, "jacobian")?, optional(hessian, "hessian")?);
            casadi::from_symbols(name, value, jacobian, hessian, dims(nx, nu, np)?, inputs).map(ready)
        })
    })
}

/// Create a function from a file of functions that CasADi saved, evaluated by CasADi itself: no compiler is needed. Else
/// as swb_function_from_casadi_library.
///
/// The functions of the file stay loaded until the program ends.
///
/// @param[in]  casadi path of CasADi's library, such as ".../casadi/libcasadi.so"
/// @param[in]  file   a list of functions, f and its derivatives, written by CasADi's FileSerializer
/// @param[in]  name   f
/// @param[in]  inputs what the inputs are, such as "x u"; NULL: they have the names x, u, p, t
/// @param[out] out    the new object, NULL on failure; free with swb_function_free
/// @return as swb_function_from_casadi_library
#[no_mangle]
pub unsafe extern "C" fn swb_function_from_casadi_file(
    casadi: *const c_char,
    file: *const c_char,
    name: *const c_char,
    inputs: *const c_char,
    nx: i64,
    nu: i64,
    np: i64,
    out: *mut *mut swb_function,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let (library, file) = (Path::new(raw::text(casadi, "casadi")?), Path::new(raw::text(file, "file")?));
            let (name, inputs) = (raw::text(name, "name")?, optional_text(inputs, "inputs")?);
            casadi::from_file(library, file, name, dims(nx, nu, np)?, inputs).map(ready)
        })
    })
}
