//! FMI 2.0.4.

use super::{exports, folder, get, list, refused, run, set, text, Status};
use std::ffi::{c_char, c_void, CStr, CString};
use switchback::error::{Error, Result};
use switchback::fmu::{Kind, Unit};

type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, i32, *const c_char, *const c_char, ...);

/// What an importer supplies.
#[repr(C)]
pub struct Callbacks {
    logger: Option<Logger>,
    allocate: *const c_void,
    free: *const c_void,
    finished: *const c_void,
    environment: *mut c_void,
}

/// A unit of an importer.
pub struct Instance {
    unit: Unit,
    logger: Option<Logger>,
    environment: *mut c_void,
    name: CString,
}

/// What events have led to.
#[repr(C)]
pub struct EventInfo {
    again: i32,
    terminate: i32,
    nominals: i32,
    states: i32,
    next_defined: i32,
    next: f64,
}

unsafe fn tell(logger: Option<Logger>, environment: *mut c_void, name: &CStr, message: &CStr) {
    if let Some(log) = logger {
        // the message is no format
        unsafe {
            log(
                environment,
                name.as_ptr(),
                Status::Error as i32,
                c"logStatusError".as_ptr(),
                c"%s".as_ptr(),
                message.as_ptr(),
            );
        }
    }
}

unsafe fn instance(c: *mut Instance, body: impl FnOnce(&mut Unit) -> Result<()>) -> Status {
    unsafe { answer(c, |u| body(u).map(|()| Status::Ok)) }
}

unsafe fn answer(c: *mut Instance, body: impl FnOnce(&mut Unit) -> Result<Status>) -> Status {
    let Some(c) = (unsafe { c.as_mut() }) else { return Status::Error };
    let (logger, environment, name) = (c.logger, c.environment, c.name.clone());
    let unit = &mut c.unit;
    run(|m| unsafe { tell(logger, environment, &name, m) }, || body(unit))
}

/// Variables of other types: there are none.
fn nothing(n: usize) -> Result<()> {
    match n {
        0 => Ok(()),
        _ => Err(Error::Range("there is no variable of this type".into())),
    }
}

exports! {
    fn fmi2GetTypesPlatform() -> *const c_char { c"default".as_ptr() }
    fn fmi2GetVersion() -> *const c_char { c"2.0".as_ptr() }
    fn fmi2SetDebugLogging(c: *mut Instance, on: i32, n: usize, categories: *const *const c_char) -> Status {
        let _ = (c, on, n, categories);
        Status::Ok
    }
    fn fmi2Instantiate(
        name: *const c_char,
        kind: i32,
        guid: *const c_char,
        resources: *const c_char,
        callbacks: *const Callbacks,
        visible: i32,
        logging: i32,
    ) -> *mut Instance {
        let _ = (visible, logging);
        let (logger, environment) = match unsafe { callbacks.as_ref() } {
            Some(c) => (c.logger, c.environment),
            None => (None, std::ptr::null_mut()),
        };
        let name = match name.is_null() {
            true => CString::default(),
            false => unsafe { CStr::from_ptr(name) }.to_owned(),
        };
        let mut made = std::ptr::null_mut();
        run(|m| unsafe { tell(logger, environment, &name, m) }, || {
            let kind = if kind == 0 { Kind::Exchange } else { Kind::CoSimulation };
            let (guid, resources) = unsafe { (text(guid, "the GUID")?, text(resources, "the location of resources")?) };
            let unit = Unit::open(&folder(&resources)?, &guid, kind)?;
            made = Box::into_raw(Box::new(Instance { unit, logger, environment, name: name.clone() }));
            Ok(Status::Ok)
        });
        made
    }
    fn fmi2FreeInstance(c: *mut Instance) -> () {
        if !c.is_null() {
            drop(unsafe { Box::from_raw(c) });
        }
    }
    fn fmi2SetupExperiment(
        c: *mut Instance,
        has_tolerance: i32,
        tolerance: f64,
        start: f64,
        has_stop: i32,
        stop: f64,
    ) -> Status {
        unsafe {
            instance(c, |u| {
                u.set_up(start, (has_stop != 0).then_some(stop), (has_tolerance != 0).then_some(tolerance))
            })
        }
    }
    fn fmi2EnterInitializationMode(c: *mut Instance) -> Status { unsafe { instance(c, |_| Ok(())) } }
    fn fmi2ExitInitializationMode(c: *mut Instance) -> Status { unsafe { instance(c, Unit::finish_initial) } }
    fn fmi2Terminate(c: *mut Instance) -> Status { unsafe { instance(c, |_| Ok(())) } }
    fn fmi2Reset(c: *mut Instance) -> Status { unsafe { instance(c, Unit::reset) } }
    fn fmi2GetReal(c: *mut Instance, vr: *const u32, n: usize, value: *mut f64) -> Status {
        unsafe { instance(c, |u| get(u, vr, n, value)) }
    }
    fn fmi2SetReal(c: *mut Instance, vr: *const u32, n: usize, value: *const f64) -> Status {
        unsafe { instance(c, |u| set(u, vr, n, value)) }
    }
    fn fmi2GetInteger(c: *mut Instance, vr: *const u32, n: usize, value: *mut i32) -> Status {
        let _ = (vr, value);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi2GetBoolean(c: *mut Instance, vr: *const u32, n: usize, value: *mut i32) -> Status {
        let _ = (vr, value);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi2GetString(c: *mut Instance, vr: *const u32, n: usize, value: *mut *const c_char) -> Status {
        let _ = (vr, value);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi2SetInteger(c: *mut Instance, vr: *const u32, n: usize, value: *const i32) -> Status {
        let _ = (vr, value);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi2SetBoolean(c: *mut Instance, vr: *const u32, n: usize, value: *const i32) -> Status {
        let _ = (vr, value);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi2SetString(c: *mut Instance, vr: *const u32, n: usize, value: *const *const c_char) -> Status {
        let _ = (vr, value);
        unsafe { instance(c, |_| nothing(n)) }
    }
    fn fmi2EnterEventMode(c: *mut Instance) -> Status {
        unsafe {
            instance(c, |u| {
                u.enter_event();
                Ok(())
            })
        }
    }
    fn fmi2NewDiscreteStates(c: *mut Instance, info: *mut EventInfo) -> Status {
        unsafe {
            instance(c, |u| {
                let e = u.event()?;
                if !info.is_null() {
                    *info = EventInfo {
                        again: 0,
                        terminate: i32::from(e.ended),
                        nominals: 0,
                        states: i32::from(e.moved),
                        next_defined: i32::from(e.next.is_some()),
                        next: e.next.unwrap_or(0.0),
                    };
                }
                Ok(())
            })
        }
    }
    fn fmi2EnterContinuousTimeMode(c: *mut Instance) -> Status {
        unsafe {
            instance(c, |u| {
                u.leave_event();
                Ok(())
            })
        }
    }
    fn fmi2CompletedIntegratorStep(c: *mut Instance, no_return: i32, event: *mut i32, terminate: *mut i32) -> Status {
        let _ = no_return;
        unsafe {
            instance(c, |u| {
                *event = 0;
                *terminate = i32::from(u.is_ended());
                Ok(())
            })
        }
    }
    fn fmi2SetTime(c: *mut Instance, t: f64) -> Status {
        unsafe {
            instance(c, |u| {
                u.set_time(t);
                Ok(())
            })
        }
    }
    fn fmi2SetContinuousStates(c: *mut Instance, x: *const f64, n: usize) -> Status {
        unsafe { instance(c, |u| u.set_states(list(x.cast_mut(), n, u.continuous.len())?)) }
    }
    fn fmi2GetContinuousStates(c: *mut Instance, x: *mut f64, n: usize) -> Status {
        unsafe {
            instance(c, |u| {
                u.states(list(x, n, u.continuous.len())?);
                Ok(())
            })
        }
    }
    fn fmi2GetNominalsOfContinuousStates(c: *mut Instance, x: *mut f64, n: usize) -> Status {
        unsafe {
            instance(c, |u| {
                u.nominals(list(x, n, u.continuous.len())?);
                Ok(())
            })
        }
    }
    fn fmi2GetDerivatives(c: *mut Instance, out: *mut f64, n: usize) -> Status {
        unsafe { instance(c, |u| u.derivatives(list(out, n, u.continuous.len())?)) }
    }
    fn fmi2GetEventIndicators(c: *mut Instance, out: *mut f64, n: usize) -> Status {
        unsafe {
            instance(c, |u| {
                let values = u.indicators()?;
                list(out, n, values.len())?.copy_from_slice(values);
                Ok(())
            })
        }
    }
    fn fmi2DoStep(c: *mut Instance, t: f64, h: f64, no_return: i32) -> Status {
        let _ = no_return;
        unsafe {
            answer(c, |u| {
                u.advance(t + h)?;
                Ok(if u.is_ended() { Status::Discard } else { Status::Ok })
            })
        }
    }
    fn fmi2CancelStep(c: *mut Instance) -> Status {
        unsafe { instance(c, |_| Err(Error::State("steps are over when they return".into()))) }
    }
    fn fmi2GetRealStatus(c: *mut Instance, kind: i32, value: *mut f64) -> Status {
        const LAST_SUCCESSFUL_TIME: i32 = 2;
        unsafe {
            answer(c, |u| {
                if kind != LAST_SUCCESSFUL_TIME {
                    return Ok(Status::Discard);
                }
                *value = u.time();
                Ok(Status::Ok)
            })
        }
    }
    fn fmi2GetBooleanStatus(c: *mut Instance, kind: i32, value: *mut i32) -> Status {
        const TERMINATED: i32 = 3;
        unsafe {
            answer(c, |u| {
                if kind != TERMINATED {
                    return Ok(Status::Discard);
                }
                *value = i32::from(u.is_ended());
                Ok(Status::Ok)
            })
        }
    }
    fn fmi2FreeFMUstate(c: *mut Instance, state: *mut *mut c_void) -> Status {
        let _ = state;
        unsafe { instance(c, |_| Ok(())) }
    }
}

refused! {
    fmi2GetFMUstate(state: *mut *mut c_void);
    fmi2SetFMUstate(state: *mut c_void);
    fmi2SerializedFMUstateSize(state: *mut c_void, size: *mut usize);
    fmi2SerializeFMUstate(state: *mut c_void, bytes: *mut c_char, size: usize);
    fmi2DeSerializeFMUstate(bytes: *const c_char, size: usize, state: *mut *mut c_void);
    fmi2GetDirectionalDerivative(of: *const u32, n: usize, by: *const u32, k: usize, dv: *const f64, out: *mut f64);
    fmi2SetRealInputDerivatives(vr: *const u32, n: usize, order: *const i32, value: *const f64);
    fmi2GetRealOutputDerivatives(vr: *const u32, n: usize, order: *const i32, value: *mut f64);
    fmi2GetStatus(kind: i32, value: *mut i32);
    fmi2GetIntegerStatus(kind: i32, value: *mut i32);
    fmi2GetStringStatus(kind: i32, value: *mut *const c_char);
}
