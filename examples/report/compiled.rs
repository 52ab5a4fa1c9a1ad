//! Functions of models as compiled code: the library's own C, and what CasADi made of the same models.
#![allow(unsafe_code)]

use std::ffi::CString;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use switchback::expr::{write_c, ExprFunction};
use switchback::func::{casadi, Callback, Dims, Function, Point};
use switchback::system::SharedFunction;

type Plain = unsafe extern "C" fn(f64, *const f64, *const f64, *const f64, *mut f64) -> i32;
type Weighted = unsafe extern "C" fn(f64, *const f64, *const f64, *const f64, *const f64, *mut f64) -> i32;

/// The functions as C, compiled as it is usual and loaded; nothing without a compiler.
pub fn own(name: &str, functions: &[Arc<ExprFunction>]) -> Option<Vec<SharedFunction>> {
    let dir = std::env::temp_dir().join(format!("switchback-{}", std::process::id()));
    std::fs::create_dir_all(&dir).ok()?;
    let library = compile(&dir, name, functions);
    let handle = library.as_ref().map(|path| {
        let path = CString::new(path.to_string_lossy().as_bytes()).expect("a path without NUL");
        // SAFETY: our own code, which is never unloaded.
        unsafe { libc::dlopen(path.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) }
    });
    let _ = std::fs::remove_dir_all(&dir);
    let handle = handle.filter(|h| !h.is_null())?;
    let symbol = |f: &ExprFunction, part: &str| {
        let name = CString::new(format!("run_{}_{part}", f.name())).expect("a name without NUL");
        // SAFETY: an open library.
        let address = unsafe { libc::dlsym(handle, name.as_ptr()) };
        assert!(!address.is_null(), "{name:?} is missing");
        address
    };
    let loaded = |f: &Arc<ExprFunction>| {
        // SAFETY: the signatures that `compile` writes.
        let value = unsafe { std::mem::transmute::<*mut libc::c_void, Plain>(symbol(f, "value")) };
        let jacobian = unsafe { std::mem::transmute::<*mut libc::c_void, Plain>(symbol(f, "jacobian")) };
        let hessian = unsafe { std::mem::transmute::<*mut libc::c_void, Weighted>(symbol(f, "hessian")) };
        let plain = |code: Plain, at: &Point, out: &mut [f64]| unsafe {
            code(at.t, at.x.as_ptr(), at.u.as_ptr(), at.p.as_ptr(), out.as_mut_ptr())
        };
        let c = Callback::new(f.name(), f.dims(), f.n_out(), move |at, out| plain(value, at, out))
            .with_jacobian(f.jac_pattern().clone(), move |at, out| plain(jacobian, at, out))
            .and_then(|c| {
                c.with_hessian(f.hess_pattern().clone(), move |at, w, out| unsafe {
                    hessian(at.t, at.x.as_ptr(), at.u.as_ptr(), at.p.as_ptr(), w.as_ptr(), out.as_mut_ptr())
                })
            });
        Arc::new(c.expect("patterns of the same function")) as SharedFunction
    };
    Some(functions.iter().map(loaded).collect())
}

fn compile(dir: &Path, name: &str, functions: &[Arc<ExprFunction>]) -> Option<PathBuf> {
    let all: Vec<&ExprFunction> = functions.iter().map(|f| f.as_ref()).collect();
    let mut code = write_c(&all).expect("names of a model");
    // The functions are static; what is loaded is not.
    for f in &all {
        let n = f.name();
        let point = "double t, const double *x, const double *u, const double *p";
        for part in ["value", "jacobian"] {
            let _ =
                writeln!(code, "int run_{n}_{part}({point}, double *out) {{ return {n}_{part}(t, x, u, p, out); }}");
        }
        let _ = writeln!(
            code,
            "int run_{n}_hessian({point}, const double *w, double *out) {{ return {n}_hessian(t, x, u, p, w, out); }}"
        );
    }
    let (source, library) = (dir.join(format!("{name}.c")), dir.join(format!("{name}.so")));
    std::fs::write(&source, code).ok()?;
    let cc = Command::new("cc")
        .args(["-O2", "-shared", "-fPIC", "-o"])
        .arg(&library)
        .arg(&source)
        .arg("-lm")
        .output()
        .ok()?;
    cc.status.success().then_some(library)
}

/// Functions `<model>_0`, `<model>_1`, ... of the folder that `bindings/python/benchmarks/model_eval.py` writes, by
/// CasADi's virtual machine and compiled.
pub fn casadi(folder: &Path, model: &str, dims: &[Dims]) -> [Vec<SharedFunction>; 2] {
    let interpreter = std::fs::read_to_string(folder.join("library.txt")).expect("the path of CasADi's library");
    let load = |k: usize, compiled: bool| -> SharedFunction {
        let name = format!("{model}_{k}");
        // SAFETY: files of CasADi, made for this.
        let f = unsafe {
            match compiled {
                true => casadi::from_library(&folder.join("models.so"), &name, dims[k], None),
                false => {
                    let file = folder.join(format!("{name}.casadi"));
                    casadi::from_file(Path::new(interpreter.trim()), &file, &name, dims[k], None)
                }
            }
        };
        Arc::new(f.unwrap_or_else(|e| panic!("{name}: {e}")))
    };
    [false, true].map(|compiled| (0..dims.len()).map(|k| load(k, compiled)).collect())
}
