//! FMI 3.0.2.

use super::{exports, get, list, refused, run, set, text, Status};
use std::ffi::{c_char, c_void, CStr};
use std::path::PathBuf;
use switchback::error::{Error, Result};
use switchback::fmu::{Kind, Unit};

type Logger = unsafe extern "C" fn(*mut c_void, i32, *const c_char, *const c_char);

/// A unit of an importer.
pub struct Instance {
    unit: Unit,
    logger: Option<Logger>,
    environment: *mut c_void,
}

unsafe fn tell(logger: Option<Logger>, environment: *mut c_void, message: &CStr) {
    if let Some(log) = logger {
        unsafe { log(environment, Status::Error as i32, c"logStatusError".as_ptr(), message.as_ptr()) };
    }
}

unsafe fn instance(c: *mut Instance, body: impl FnOnce(&mut Unit) -> Result<()>) -> Status {
    let Some(c) = (unsafe { c.as_mut() }) else { return Status::Error };
    let (logger, environment) = (c.logger, c.environment);
    let unit = &mut c.unit;
    run(|m| unsafe { tell(logger, environment, m) }, || body(unit).map(|()| Status::Ok))
}

unsafe fn made(
    kind: Kind,
    [token, resources]: [*const c_char; 2],
    environment: *mut c_void,
    logger: Option<Logger>,
) -> *mut Instance {
    let mut out = std::ptr::null_mut();
    run(
        |m| unsafe { tell(logger, environment, m) },
        || {
            let (token, path) = unsafe { (text(token, "the token")?, text(resources, "the path of resources")?) };
            let unit = Unit::open(&PathBuf::from(path), &token, kind)?;
            out = Box::into_raw(Box::new(Instance { unit, logger, environment }));
            Ok(Status::Ok)
        },
    );
    out
}

/// Variables of other types: there are none.
fn nothing(n: usize) -> Result<()> {
    match n {
        0 => Ok(()),
        _ => Err(Error::Range("there is no variable of this type".into())),
    }
}

exports! {
    fn fmi3GetVersion() -> *const c_char { c"3.0".as_ptr() }
    fn fmi3SetDebugLogging(c: *mut Instance, on: bool, n: usize, categories: *const *const c_char) -> Status {
        let _ = (c, on, n, categories);
        Status::Ok
    }
    fn fmi3InstantiateModelExchange(
        name: *const c_char,
        token: *const c_char,
        resources: *const c_char,
        visible: bool,
        logging: bool,
        environment: *mut c_void,
        logger: Option<Logger>,
    ) -> *mut Instance {
        let _ = (name, visible, logging);
        unsafe { made(Kind::Exchange, [token, resources], environment, logger) }
    }
    fn fmi3InstantiateCoSimulation(
        name: *const c_char,
        token: *const c_char,
        resources: *const c_char,
        visible: bool,
        logging: bool,
        event_mode: bool,
        early_return: bool,
        intermediate: *const u32,
        n_intermediate: usize,
        environment: *mut c_void,
        logger: Option<Logger>,
        update: *const c_void,
    ) -> *mut Instance {
        let _ = (name, visible, logging, event_mode, early_return, intermediate, n_intermediate, update);
        unsafe { made(Kind::CoSimulation, [token, resources], environment, logger) }
    }
    fn fmi3InstantiateScheduledExecution(
        name: *const c_char,
        token: *const c_char,
        resources: *const c_char,
        visible: bool,
        logging: bool,
        environment: *mut c_void,
        logger: Option<Logger>,
        clock: *const c_void,
        lock: *const c_void,
        unlock: *const c_void,
    ) -> *mut Instance {
        let _ = (name, token, resources, visible, logging, clock, lock, unlock);
        unsafe { tell(logger, environment, c"there is no scheduled execution") };
        std::ptr::null_mut()
    }
    fn fmi3FreeInstance(c: *mut Instance) -> () {
        if !c.is_null() {
            drop(unsafe { Box::from_raw(c) });
        }
    }
    fn fmi3EnterInitializationMode(
        c: *mut Instance,
        has_tolerance: bool,
        tolerance: f64,
        start: f64,
        has_stop: bool,
        stop: f64,
    ) -> Status {
        unsafe { instance(c, |u| u.set_up(start, has_stop.then_some(stop), has_tolerance.then_some(tolerance))) }
    }
    fn fmi3ExitInitializationMode(c: *mut Instance) -> Status { unsafe { instance(c, Unit::finish_initial) } }
    fn fmi3EnterEventMode(c: *mut Instance) -> Status {
        unsafe {
            instance(c, |u| {
                u.enter_event();
                Ok(())
            })
        }
    }
    fn fmi3Terminate(c: *mut Instance) -> Status { unsafe { instance(c, |_| Ok(())) } }
    fn fmi3Reset(c: *mut Instance) -> Status { unsafe { instance(c, Unit::reset) } }
    fn fmi3GetFloat64(c: *mut Instance, vr: *const u32, n: usize, values: *mut f64, n_values: usize) -> Status {
        let _ = n_values;
        unsafe { instance(c, |u| get(u, vr, n, values)) }
    }
    fn fmi3SetFloat64(c: *mut Instance, vr: *const u32, n: usize, values: *const f64, n_values: usize) -> Status {
        let _ = n_values;
        unsafe { instance(c, |u| set(u, vr, n, values)) }
    }
    fn fmi3GetBinary(
        c: *mut Instance,
        vr: *const u32,
        n: usize,
        sizes: *mut usize,
        values: *mut *const u8,
        n_values: usize,
    ) -> Status {
        let _ = (vr, sizes, values, n_values);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi3SetBinary(
        c: *mut Instance,
        vr: *const u32,
        n: usize,
        sizes: *const usize,
        values: *const *const u8,
        n_values: usize,
    ) -> Status {
        let _ = (vr, sizes, values, n_values);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi3GetClock(c: *mut Instance, vr: *const u32, n: usize, values: *mut bool) -> Status {
        let _ = (vr, values);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi3SetClock(c: *mut Instance, vr: *const u32, n: usize, values: *const bool) -> Status {
        let _ = (vr, values);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi3EnterConfigurationMode(c: *mut Instance) -> Status { unsafe { instance(c, |_| Ok(())) } }
    fn fmi3ExitConfigurationMode(c: *mut Instance) -> Status { unsafe { instance(c, |_| Ok(())) } }
    fn fmi3EnterStepMode(c: *mut Instance) -> Status { unsafe { instance(c, |_| Ok(())) } }
    fn fmi3EvaluateDiscreteStates(c: *mut Instance) -> Status { unsafe { instance(c, |_| Ok(())) } }
    fn fmi3UpdateDiscreteStates(
        c: *mut Instance,
        again: *mut bool,
        terminate: *mut bool,
        nominals: *mut bool,
        states: *mut bool,
        next_defined: *mut bool,
        next: *mut f64,
    ) -> Status {
        unsafe {
            instance(c, |u| {
                let e = u.event()?;
                (*again, *nominals) = (false, false);
                (*terminate, *states, *next_defined) = (e.ended, e.moved, e.next.is_some());
                *next = e.next.unwrap_or(0.0);
                Ok(())
            })
        }
    }
    fn fmi3EnterContinuousTimeMode(c: *mut Instance) -> Status {
        unsafe {
            instance(c, |u| {
                u.leave_event();
                Ok(())
            })
        }
    }
    fn fmi3CompletedIntegratorStep(c: *mut Instance, no_return: bool, event: *mut bool, terminate: *mut bool) -> Status {
        let _ = no_return;
        unsafe {
            instance(c, |u| {
                (*event, *terminate) = (false, u.is_ended());
                Ok(())
            })
        }
    }
    fn fmi3SetTime(c: *mut Instance, t: f64) -> Status {
        unsafe {
            instance(c, |u| {
                u.set_time(t);
                Ok(())
            })
        }
    }
    fn fmi3SetContinuousStates(c: *mut Instance, x: *const f64, n: usize) -> Status {
        unsafe { instance(c, |u| u.set_states(list(x.cast_mut(), n, u.continuous.len())?)) }
    }
    fn fmi3GetContinuousStates(c: *mut Instance, x: *mut f64, n: usize) -> Status {
        unsafe {
            instance(c, |u| {
                u.states(list(x, n, u.continuous.len())?);
                Ok(())
            })
        }
    }
    fn fmi3GetNominalsOfContinuousStates(c: *mut Instance, x: *mut f64, n: usize) -> Status {
        unsafe {
            instance(c, |u| {
                u.nominals(list(x, n, u.continuous.len())?);
                Ok(())
            })
        }
    }
    fn fmi3GetContinuousStateDerivatives(c: *mut Instance, out: *mut f64, n: usize) -> Status {
        unsafe { instance(c, |u| u.derivatives(list(out, n, u.continuous.len())?)) }
    }
    fn fmi3GetEventIndicators(c: *mut Instance, out: *mut f64, n: usize) -> Status {
        unsafe {
            instance(c, |u| {
                let values = u.indicators()?;
                list(out, n, values.len())?.copy_from_slice(values);
                Ok(())
            })
        }
    }
    fn fmi3GetNumberOfEventIndicators(c: *mut Instance, n: *mut usize) -> Status {
        unsafe {
            instance(c, |u| {
                *n = u.n_indicators();
                Ok(())
            })
        }
    }
    fn fmi3GetNumberOfContinuousStates(c: *mut Instance, n: *mut usize) -> Status {
        unsafe {
            instance(c, |u| {
                *n = u.continuous.len();
                Ok(())
            })
        }
    }
    fn fmi3DoStep(
        c: *mut Instance,
        t: f64,
        h: f64,
        no_return: bool,
        event: *mut bool,
        terminate: *mut bool,
        early: *mut bool,
        last: *mut f64,
    ) -> Status {
        let _ = no_return;
        unsafe {
            instance(c, |u| {
                u.advance(t + h)?;
                // an early return is one that the importer may go on from
                (*event, *terminate, *early, *last) = (false, u.is_ended(), false, u.time());
                Ok(())
            })
        }
    }
    fn fmi3FreeFMUState(c: *mut Instance, state: *mut *mut c_void) -> Status {
        let _ = state;
        unsafe { instance(c, |_| Ok(())) }
    }
}

/// Getters and setters of types that no variable has.
macro_rules! without {
    ($($get:ident $set:ident $type:ty;)*) => {
        exports! {
            $(
                fn $get(c: *mut Instance, vr: *const u32, n: usize, values: *mut $type, n_values: usize) -> Status {
                    let _ = (vr, values, n_values);
                    unsafe { instance(c, |_| nothing(n)) }
                }
                fn $set(c: *mut Instance, vr: *const u32, n: usize, values: *const $type, n_values: usize) -> Status {
                    let _ = (vr, values, n_values);
                    unsafe { instance(c, |_| nothing(n)) }
                }
            )*
        }
    };
}

without! {
    fmi3GetFloat32 fmi3SetFloat32 f32;
    fmi3GetInt8 fmi3SetInt8 i8;
    fmi3GetUInt8 fmi3SetUInt8 u8;
    fmi3GetInt16 fmi3SetInt16 i16;
    fmi3GetUInt16 fmi3SetUInt16 u16;
    fmi3GetInt32 fmi3SetInt32 i32;
    fmi3GetUInt32 fmi3SetUInt32 u32;
    fmi3GetInt64 fmi3SetInt64 i64;
    fmi3GetUInt64 fmi3SetUInt64 u64;
    fmi3GetBoolean fmi3SetBoolean bool;
    fmi3GetString fmi3SetString *const c_char;
}

refused! {
    fmi3GetNumberOfVariableDependencies(vr: u32, n: *mut usize);
    fmi3GetVariableDependencies(
        vr: u32, of: *mut usize, by: *mut u32, places: *mut usize, kinds: *mut i32, n: usize,
    );
    fmi3GetFMUState(state: *mut *mut c_void);
    fmi3SetFMUState(state: *mut c_void);
    fmi3SerializedFMUStateSize(state: *mut c_void, size: *mut usize);
    fmi3SerializeFMUState(state: *mut c_void, bytes: *mut u8, size: usize);
    fmi3DeserializeFMUState(bytes: *const u8, size: usize, state: *mut *mut c_void);
    fmi3GetDirectionalDerivative(
        of: *const u32, n: usize, by: *const u32, k: usize, seed: *const f64, n_seed: usize, out: *mut f64, n_out: usize,
    );
    fmi3GetAdjointDerivative(
        of: *const u32, n: usize, by: *const u32, k: usize, seed: *const f64, n_seed: usize, out: *mut f64, n_out: usize,
    );
    fmi3GetOutputDerivatives(vr: *const u32, n: usize, orders: *const i32, out: *mut f64, n_out: usize);
    fmi3ActivateModelPartition(clock: u32, t: f64);
    fmi3GetIntervalDecimal(vr: *const u32, n: usize, intervals: *mut f64, qualifiers: *mut i32);
    fmi3GetIntervalFraction(vr: *const u32, n: usize, counters: *mut u64, resolutions: *mut u64, qualifiers: *mut i32);
    fmi3GetShiftDecimal(vr: *const u32, n: usize, shifts: *mut f64);
    fmi3GetShiftFraction(vr: *const u32, n: usize, counters: *mut u64, resolutions: *mut u64);
    fmi3SetIntervalDecimal(vr: *const u32, n: usize, intervals: *const f64);
    fmi3SetIntervalFraction(vr: *const u32, n: usize, counters: *const u64, resolutions: *const u64);
    fmi3SetShiftDecimal(vr: *const u32, n: usize, shifts: *const f64);
    fmi3SetShiftFraction(vr: *const u32, n: usize, counters: *const u64, resolutions: *const u64);
}
