//! One function of CasADi behind its C interface: everything is read and checked when it is bound.
//!
//! The interface as CasADi 3.5 to 3.8 generate it: `f(arg, res, iw, w, mem)` with `f_n_in`, `f_sparsity_in` and so on.
//! Integers have 32 or 64 bits by an option of the generator; what is written by `f_work` tells them apart.
//! CasADi's own library has the same functions with a leading number of the function (`casadi_c.h`).

use std::ffi::{c_char, c_int, CStr};
use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::library::Library;
use crate::error::{Error, Result};
use crate::linalg::csc::Pattern;

/// An address of code; cast to what it is where it is called.
pub type Code = unsafe extern "C" fn();

/// Addresses of what belongs to one function `f`; `None` where there is nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Symbols {
    /// `f` itself.
    pub eval: Option<Code>,
    /// `f_n_in`
    pub n_in: Option<Code>,
    /// `f_n_out`
    pub n_out: Option<Code>,
    /// `f_name_in`
    pub name_in: Option<Code>,
    /// `f_sparsity_in`
    pub sparsity_in: Option<Code>,
    /// `f_sparsity_out`
    pub sparsity_out: Option<Code>,
    /// `f_work`
    pub work: Option<Code>,
    /// `f_checkout`
    pub checkout: Option<Code>,
    /// `f_release`
    pub release: Option<Code>,
    /// `f_incref`
    pub incref: Option<Code>,
    /// `f_decref`
    pub decref: Option<Code>,
    /// `casadi_int_size` of the generated file, since CasADi 3.8.
    pub int_size: Option<Code>,
    /// `casadi_real_size` of the generated file, since CasADi 3.8.
    pub real_size: Option<Code>,
}

/// An input or output.
pub(super) struct Io {
    pub(super) name: Option<String>,
    pub(super) pattern: Pattern,
}

impl Io {
    /// Entries, the structural zeros included.
    pub(super) fn numel(&self) -> usize {
        self.pattern.n_rows() * self.pattern.n_cols()
    }
    pub(super) fn is_dense(&self) -> bool {
        self.pattern.nnz() == self.numel()
    }
}

/// A function that may be called.
pub(super) struct Object {
    pub(super) name: String,
    pub(super) inputs: Vec<Io>,
    pub(super) outputs: Vec<Io>,
    call: Call,
    /// Lengths of `arg`, `res`, `iw`, `w`.
    sizes: [usize; 4],
    memory: Memory,
    /// Keeps the code in memory.
    _library: Option<Arc<Library>>,
}

/// The memory of a function: a number.
enum Memory {
    /// The same for all calls.
    Stateless(c_int),
    /// One for each call that runs at the same time.
    Pool(Mutex<Vec<c_int>>),
}

/// Setting up and tearing down is not thread-safe in generated code.
static SETUP: Mutex<()> = Mutex::new(());

pub(super) fn setup_lock() -> MutexGuard<'static, ()> {
    SETUP.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Rows and columns beyond this are refused.
const LIMIT: i64 = i32::MAX as i64;
/// Entries of a matrix that the pattern lists, columns, and numbers of memory beyond this are refused: they are a mistake, and half a
/// gigabyte. The shape of a sparse matrix says nothing of its size.
const MAX_ENTRIES: i64 = 1 << 26;
/// No number a computation arrives at: a NaN with a payload.
const UNTOUCHED: u64 = 0x7ff4_5b1c_7ff4_5b1c;

/// Calls of C functions, with the number of the function before the other arguments if it has one.
#[derive(Clone, Copy)]
struct Call {
    code: Symbols,
    id: Option<c_int>,
    wide: bool,
}

macro_rules! invoke {
    ($self:ident, $code:expr, ($($kind:ty: $value:expr),*) -> $result:ty) => {{
        let code: Code = $code;
        match $self.id {
            None => {
                // SAFETY: the caller of `Object::bind` says that the addresses are those of such functions.
                #[allow(clippy::useless_transmute)]
                let f = unsafe { std::mem::transmute::<Code, unsafe extern "C" fn($($kind),*) -> $result>(code) };
                unsafe { f($($value),*) }
            }
            Some(id) => {
                // SAFETY: as above.
                let f = unsafe { std::mem::transmute::<Code, unsafe extern "C" fn(c_int, $($kind),*) -> $result>(code) };
                unsafe { f(id, $($value),*) }
            }
        }
    }};
}

impl Call {
    fn count(&self, code: Code) -> i64 {
        match self.wide {
            true => invoke!(self, code, () -> i64),
            false => i64::from(invoke!(self, code, () -> i32)),
        }
    }

    fn pointer<T>(&self, code: Code, k: usize) -> *const T {
        match self.wide {
            true => invoke!(self, code, (i64: k as i64) -> *const T),
            false => invoke!(self, code, (i32: k as i32) -> *const T),
        }
    }

    /// Lengths of `arg`, `res`, `iw`, `w` as they are written by the function, high words untouched by narrow integers.
    fn work(&self, code: Code) -> Option<[i64; 4]> {
        let mut sizes = [-1i64; 4];
        let [a, r, i, w] = &mut sizes;
        let failed = invoke!(self, code, (*mut i64: a, *mut i64: r, *mut i64: i, *mut i64: w) -> c_int);
        (failed == 0).then_some(sizes)
    }

    fn eval(
        &self,
        code: Code,
        arg: *mut *const f64,
        res: *mut *mut f64,
        (iw, w): (*mut f64, *mut f64),
        memory: c_int,
    ) -> c_int {
        invoke!(self, code, (*mut *const f64: arg, *mut *mut f64: res, *mut f64: iw, *mut f64: w, c_int: memory) -> c_int)
    }

    /// Element `k` of an array of CasADi's integers.
    ///
    /// # Safety
    /// The array is that long.
    unsafe fn integer(&self, array: *const u8, k: usize) -> i64 {
        unsafe {
            match self.wide {
                true => array.cast::<i64>().add(k).read_unaligned(),
                false => i64::from(array.cast::<i32>().add(k).read_unaligned()),
            }
        }
    }
}

impl Object {
    /// Checks everything a function says of itself, and calls it once at zero.
    ///
    /// # Safety
    /// The addresses are those of functions that CasADi generated, or that behave alike; the library that has them is
    /// kept open by `library`, or by the caller.
    pub(super) unsafe fn bind(
        name: &str,
        code: Symbols,
        id: Option<c_int>,
        library: Option<Arc<Library>>,
    ) -> Result<Object> {
        let lock = setup_lock();
        let missing = |what: &str| {
            Error::Library(format!(
                "{name}: there is no {name}{what}: generate the code with CasADi's CodeGenerator or Function.generate"
            ))
        };
        let eval = code.eval.ok_or_else(|| missing(""))?;
        let n_in = code.n_in.ok_or_else(|| missing("_n_in"))?;
        let n_out = code.n_out.ok_or_else(|| missing("_n_out"))?;
        let sparsity_in = code.sparsity_in.ok_or_else(|| missing("_sparsity_in"))?;
        let sparsity_out = code.sparsity_out.ok_or_else(|| missing("_sparsity_out"))?;
        let mut call = Call { code, id, wide: true };
        refuse_real_numbers_of_another_size(name, &call)?;
        call.wide = wide_integers(name, &call, sparsity_out)?;

        let count = |what: &str, f: Code| match call.count(f) {
            n @ 0..=65536 => Ok(n as usize),
            n => Err(Error::Library(format!("{name}: {name}{what} says {n}"))),
        };
        let (n_in, n_out) = (count("_n_in", n_in)?, count("_n_out", n_out)?);
        let read = |what: &str, k: usize, f: Code| {
            let array = call.pointer::<u8>(f, k);
            // SAFETY: an array of this layout, by contract.
            unsafe { pattern(&call, array) }
                .map_err(|e| Error::Library(format!("{name}: the sparsity pattern of {what} {k} is broken: {e}")))
        };
        let named = |k: usize| {
            let text = call.pointer::<c_char>(code.name_in?, k);
            // SAFETY: NULL or a text that lives as long as the code.
            (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
        };
        let inputs = (0..n_in)
            .map(|k| Ok(Io { name: named(k), pattern: read("input", k, sparsity_in)? }))
            .collect::<Result<_>>()?;
        let outputs = (0..n_out)
            .map(|k| Ok(Io { name: None, pattern: read("output", k, sparsity_out)? }))
            .collect::<Result<_>>()?;
        let sizes = lengths(name, &call, n_in, n_out)?;

        if let Some(f) = code.incref {
            invoke!(call, f, () -> ());
        }
        // From here on the object gives back what it has.
        let mut object = Object {
            name: name.to_owned(),
            inputs,
            outputs,
            call,
            sizes,
            memory: Memory::Stateless(0),
            _library: library,
        };
        let memory = object.check_out().and_then(|memory| {
            object.memory = memory;
            object.probe(eval)
        });
        // The object takes the lock when it is dropped.
        drop(lock);
        memory.map(|()| object)
    }

    /// Two calls of `checkout` with one result: there is nothing to keep apart.
    fn check_out(&self) -> Result<Memory> {
        let (Some(out), Some(_)) = (self.call.code.checkout, self.call.code.release) else {
            return Ok(Memory::Stateless(0));
        };
        let [a, b] = [(); 2].map(|()| self.invoke_checkout(out));
        if a < 0 || b < 0 {
            return Err(Error::Library(format!("{0}: {0}_checkout failed with {1}", self.name, a.min(b))));
        }
        Ok(if a == b { Memory::Stateless(a) } else { Memory::Pool(Mutex::new(vec![b, a])) })
    }

    fn invoke_checkout(&self, code: Code) -> c_int {
        let call = &self.call;
        invoke!(call, code, () -> c_int)
    }

    /// Calls the function with all inputs zero: single precision shows in outputs that are half written.
    fn probe(&self, eval: Code) -> Result<()> {
        let zeros = vec![0.0; self.inputs.iter().map(|i| i.pattern.nnz()).max().unwrap_or(0)];
        let ends: Vec<usize> = self
            .outputs
            .iter()
            .scan(0, |end, o| {
                *end += o.pattern.nnz();
                Some(*end)
            })
            .collect();
        let mut out = vec![f64::from_bits(UNTOUCHED); ends.last().copied().unwrap_or(0)];
        let starts: Vec<Option<usize>> =
            self.outputs.iter().zip(&ends).map(|(o, end)| Some(end - o.pattern.nnz())).collect();
        let mut work = vec![0.0; self.work_len()];
        let code = self.run(eval, |k| Some(&zeros[..self.inputs[k].pattern.nnz()]), &starts, &mut out, &mut work);
        if code != 0 {
            // It is not defined at zero.
            return Ok(());
        }
        if !out.is_empty() && out.iter().all(|v| v.to_bits() == UNTOUCHED) {
            return Err(Error::Library(format!("{}: it reports success and writes no outputs", self.name)));
        }
        let half = |k: usize| out[k].to_bits() >> 32 == UNTOUCHED >> 32;
        let last = self.outputs.iter().zip(&ends).filter(|(o, _)| o.pattern.nnz() > 0).map(|(_, end)| end - 1);
        let mut last = last.peekable();
        if last.peek().is_some() && last.all(half) {
            return Err(Error::Unsupported(format!(
                "{}: it does not compute in double precision: generate it without the option casadi_real, or with \
                 casadi_real: 'double'",
                self.name
            )));
        }
        Ok(())
    }

    /// The first `n` patterns that a function of this object's library says, by [`Call::pointer`].
    pub(super) fn patterns(&self, code: Code, n: usize) -> Result<Vec<Pattern>> {
        let call = &self.call;
        let read = |k: usize| {
            // SAFETY: an array of this layout, by the contract of `bind`.
            unsafe { pattern(call, call.pointer::<u8>(code, k)) }
                .map_err(|e| Error::Library(format!("{}: pattern {k} of its Jacobian is broken: {e}", self.name)))
        };
        (0..n).map(read).collect()
    }

    /// Length of the memory of [`Object::eval`].
    pub(super) fn work_len(&self) -> usize {
        self.sizes.iter().sum()
    }

    /// Calls the function: 0 if it worked.
    ///
    /// `argument(k)` has the nonzeros of input `k`, or nothing for zeros; output `k` is written to `out` from `starts[k]`
    /// on, if it is wanted; `work` has [`Object::work_len`] numbers.
    pub(super) fn eval<'a>(
        &self,
        argument: impl Fn(usize) -> Option<&'a [f64]>,
        starts: &[Option<usize>],
        out: &mut [f64],
        work: &mut [f64],
    ) -> i32 {
        self.call.code.eval.map_or(1, |code| self.run(code, argument, starts, out, work))
    }

    fn run<'a>(
        &self,
        code: Code,
        argument: impl Fn(usize) -> Option<&'a [f64]>,
        starts: &[Option<usize>],
        out: &mut [f64],
        work: &mut [f64],
    ) -> i32 {
        let [n_arg, n_res, n_iw, n_w] = self.sizes;
        let (arg, rest) = work.split_at_mut(n_arg);
        let (res, rest) = rest.split_at_mut(n_res);
        let (iw, rest) = rest.split_at_mut(n_iw);
        let w = &mut rest[..n_w];
        let arg = arg.as_mut_ptr().cast::<*const f64>();
        let res = res.as_mut_ptr().cast::<*mut f64>();
        for k in 0..n_arg {
            let given = self.inputs.get(k).and_then(|input| argument(k).filter(|v| v.len() >= input.pattern.nnz()));
            // An empty slice has an address where nothing is.
            let given = given.filter(|v| !v.is_empty());
            // SAFETY: a number has room for a pointer.
            unsafe { arg.add(k).write(given.map_or(ptr::null(), <[f64]>::as_ptr)) };
        }
        for k in 0..n_res {
            let wanted = self.outputs.get(k).zip(starts.get(k).copied().flatten());
            let target = wanted.and_then(|(output, start)| out.get_mut(start..start + output.pattern.nnz()));
            let target = target.filter(|v| !v.is_empty());
            // SAFETY: as above.
            unsafe { res.add(k).write(target.map_or(ptr::null_mut(), <[f64]>::as_mut_ptr)) };
        }
        let pool = match &self.memory {
            Memory::Stateless(m) => return self.call.eval(code, arg, res, (iw.as_mut_ptr(), w.as_mut_ptr()), *m),
            Memory::Pool(pool) => pool,
        };
        let ready = pool.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let memory = ready.or_else(|| {
            let _lock = setup_lock();
            self.call.code.checkout.map(|f| self.invoke_checkout(f))
        });
        let Some(m) = memory.filter(|&m| m >= 0) else { return 1 };
        let failed = self.call.eval(code, arg, res, (iw.as_mut_ptr(), w.as_mut_ptr()), m);
        pool.lock().unwrap_or_else(PoisonError::into_inner).push(m);
        failed
    }
}

impl Drop for Object {
    fn drop(&mut self) {
        let _lock = setup_lock();
        let call = self.call;
        if let (Memory::Pool(pool), Some(release)) = (&self.memory, call.code.release) {
            for m in pool.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
                invoke!(call, release, (c_int: m) -> ());
            }
        }
        if let Some(f) = call.code.decref {
            invoke!(call, f, () -> ());
        }
    }
}

fn refuse_real_numbers_of_another_size(name: &str, call: &Call) -> Result<()> {
    let Some(f) = call.code.real_size else { return Ok(()) };
    // It has no number of the function before it.
    let f = Call { id: None, ..*call }.size(f);
    if f == 8 {
        return Ok(());
    }
    Err(Error::Unsupported(format!(
        "{name}: its numbers have {f} bytes: generate it without the option casadi_real, or with casadi_real: 'double'"
    )))
}

impl Call {
    fn size(&self, code: Code) -> c_int {
        invoke!(self, code, () -> c_int)
    }
}

/// Have the integers 64 bits? By what the file says, by what `work` writes, by the shape of an output.
fn wide_integers(name: &str, call: &Call, sparsity_out: Code) -> Result<bool> {
    let told = match call.code.int_size.map(|f| Call { id: None, ..*call }.size(f)) {
        None => None,
        Some(4) => Some(false),
        Some(8) => Some(true),
        Some(n) => return Err(Error::Unsupported(format!("{name}: its integers have {n} bytes, not 4 or 8"))),
    };
    let written = call.code.work.and_then(|f| call.work(f)).and_then(|sizes| {
        // The high word is still all ones where 32 bits were written.
        let narrow = sizes.map(|s| if cfg!(target_endian = "little") { s >> 32 == -1 } else { s as i32 == -1 });
        (narrow == [narrow[0]; 4]).then_some(!narrow[0])
    });
    let seen = written.or_else(|| {
        let array = call.pointer::<u64>(sparsity_out, 0);
        // SAFETY: three integers at least, by contract; a shape of two narrow integers looks like a huge wide one.
        (!array.is_null()).then(|| unsafe { array.read_unaligned() } <= LIMIT as u64)
    });
    match (told, seen) {
        (Some(a), Some(b)) if a != b => Err(Error::Library(format!(
            "{name}: it says that its integers have {} bytes, and writes others: were its parts compiled with different \
             options?",
            if a { 8 } else { 4 }
        ))),
        (a, b) => Ok(a.or(b).unwrap_or(true)),
    }
}

fn lengths(name: &str, call: &Call, n_in: usize, n_out: usize) -> Result<[usize; 4]> {
    let Some(f) = call.code.work else { return Ok([n_in, n_out, 0, 0]) };
    let failed = || Error::Library(format!("{name}: {name}_work failed, or says lengths that are none"));
    let mut sizes = call.work(f).ok_or_else(failed)?;
    if !call.wide {
        sizes = sizes.map(|s| i64::from(if cfg!(target_endian = "little") { s as i32 } else { (s >> 32) as i32 }));
    }
    if sizes.iter().any(|s| !(0..=MAX_ENTRIES).contains(s)) {
        return Err(failed());
    }
    let [arg, res, iw, w] = sizes.map(|s| s as usize);
    Ok([arg.max(n_in), res.max(n_out), iw, w])
}

/// Reads a compressed pattern in any of the three forms: dense by a 1 in the third place, dense by its number of
/// entries, or with rows.
///
/// # Safety
/// `array` is NULL or such a pattern.
unsafe fn pattern(call: &Call, array: *const u8) -> std::result::Result<Pattern, String> {
    if array.is_null() {
        return Err("it is missing".into());
    }
    let at = |k: usize| unsafe { call.integer(array, k) };
    let (m, n) = (at(0), at(1));
    let dense = at(2) == 1;
    let size = if dense { m.saturating_mul(n) } else { n };
    if !(0..=LIMIT).contains(&m) || !(0..=LIMIT).contains(&n) || size > MAX_ENTRIES {
        return Err(format!("its shape is {m} x {n}"));
    }
    let (m, n) = (m as usize, n as usize);
    match at(2) {
        1 => return Ok(Pattern::dense(m, n)),
        0 => {}
        first => return Err(format!("its first column starts at {first}")),
    }
    let mut col_ptr = vec![0usize];
    for j in 0..n {
        // Stop at the first thing that is wrong: what follows may not be there.
        let (last, next) = (col_ptr[j] as i64, at(3 + j));
        if next < last || next > last + m as i64 {
            return Err(format!("column {j} ends at {next} and starts at {last}"));
        }
        if next > MAX_ENTRIES {
            return Err(format!("it has more than {MAX_ENTRIES} entries"));
        }
        col_ptr.push(next as usize);
    }
    let nnz = col_ptr[n];
    if nnz == m * n {
        return Ok(Pattern::dense(m, n));
    }
    let row = |k: usize| usize::try_from(at(3 + n + k)).map_err(|_| format!("row {k} is negative"));
    let row_idx = (0..nnz).map(row).collect::<std::result::Result<Vec<usize>, String>>()?;
    Pattern::new(m, n, col_ptr, row_idx).map_err(|e| e.to_string())
}
