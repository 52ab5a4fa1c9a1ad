//! Settings over the border: the sized struct, the door by name, the option table.
//!
//! A caller may be compiled with a header older or newer than the library. `struct_size` says how many
//! bytes of the struct exist: missing fields have their defaults, unknown ones behind the end of ours are
//! left alone. So the caller's struct is never seen as a Rust reference, only copied or written word by
//! word.

use super::guard::{guard, query};
use super::raw;
use super::status::swb_status;
use std::ffi::{c_char, CString};
use std::mem::size_of;
use std::ptr;
use std::sync::OnceLock;
use switchback::error::{Error, Result};
use switchback::settings::{option, Kind, OptionInfo, Settings, Value, OPTIONS};

/// Kind of an option.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionKind {
    /// Integer.
    Int = 0,
    /// Floating-point number.
    Float = 1,
    /// Integer with value names; see swb_option_value_name.
    Enum = 2,
}

const OURS: u64 = size_of::<Settings>() as u64;
/// No future struct is larger; a larger number is an uninitialised struct.
const LARGEST: u64 = 1 << 16;

/// The caller's settings as far as they reach, completed by defaults. NULL: all defaults. Not validated.
///
/// # Safety
/// `settings` is NULL or points to a struct of the size written in its first word.
pub unsafe fn read(settings: *const Settings) -> Result<Settings> {
    let mut copy = Settings::default();
    if settings.is_null() {
        return Ok(copy);
    }
    let size = unsafe { size_of_callers(settings)? }.min(OURS);
    unsafe {
        ptr::copy_nonoverlapping(settings.cast::<u8>(), (&mut copy as *mut Settings).cast::<u8>(), size as usize);
    }
    copy.struct_size = OURS;
    Ok(copy)
}

unsafe fn size_of_callers(settings: *const Settings) -> Result<u64> {
    raw::check(settings, "settings")?;
    let size = unsafe { settings.cast::<u64>().read() };
    check_size(size)
        .map_err(|_| Error::State(format!("settings has struct_size {size}: call swb_settings_init first")))?;
    Ok(size)
}

fn check_size(size: u64) -> Result<()> {
    if !(8..=LARGEST).contains(&size) || size % 8 != 0 {
        return Err(Error::Dimension(format!("struct_size is {size}, not sizeof(swb_settings)")));
    }
    Ok(())
}

/// Change one option of the caller's struct, leaving all other bytes alone.
unsafe fn change(settings: *mut Settings, name: *const c_char, value: Value) -> Result<()> {
    unsafe {
        let name = raw::text(name, "name")?;
        let size = size_of_callers(settings)?;
        let mut copy = read(settings)?;
        copy.set_by_name(name, value)?;
        let o = option(name)?;
        if o.offset as u64 + 8 > size {
            return Err(Error::Option(format!(
                "option '{name}' is newer than the header of the program, whose settings end at byte {size}"
            )));
        }
        let from = (&copy as *const Settings).cast::<u8>().add(o.offset);
        ptr::copy_nonoverlapping(from, settings.cast::<u8>().add(o.offset), 8);
    }
    Ok(())
}

/// Fill settings with the defaults.
///
/// @param[out] settings    every word is written
/// @param[in]  struct_size sizeof(swb_settings)
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
#[no_mangle]
pub unsafe extern "C" fn swb_settings_init(settings: *mut Settings, struct_size: u64) -> swb_status {
    guard(|| {
        raw::check(settings, "settings")?;
        check_size(struct_size)?;
        let default = Settings { struct_size, ..Settings::default() };
        let known = struct_size.min(OURS) as usize;
        let bytes = settings.cast::<u8>();
        unsafe {
            ptr::copy_nonoverlapping((&default as *const Settings).cast::<u8>(), bytes, known);
            // Fields of a newer header: this library does not read them.
            ptr::write_bytes(bytes.add(known), 0, struct_size as usize - known);
        }
        Ok(())
    })
}

/// Set an integer or enumeration option (or a float one, to an integer) by name.
///
/// @return SWB_OK; SWB_ERR_OPTION if there is no such option (the message names the nearest one);
///         SWB_ERR_RANGE if the value is outside the range; SWB_ERR_STATE without swb_settings_init
#[no_mangle]
pub unsafe extern "C" fn swb_settings_set_int(settings: *mut Settings, name: *const c_char, value: i64) -> swb_status {
    guard(|| unsafe { change(settings, name, Value::Int(value)) })
}

/// Set a float option by name.
///
/// @return as swb_settings_set_int; SWB_ERR_OPTION if the option is an integer
#[no_mangle]
pub unsafe extern "C" fn swb_settings_set_double(
    settings: *mut Settings,
    name: *const c_char,
    value: f64,
) -> swb_status {
    guard(|| unsafe { change(settings, name, Value::Float(value)) })
}

/// Set any option by name from text: a number, or the value name of an enumeration.
///
/// @return as swb_settings_set_int; SWB_ERR_OPTION if the text is no value of the option
#[no_mangle]
pub unsafe extern "C" fn swb_settings_set_string(
    settings: *mut Settings,
    name: *const c_char,
    value: *const c_char,
) -> swb_status {
    guard(|| unsafe { change(settings, name, Value::Text(raw::text(value, "value")?.to_owned())) })
}

/// Get an integer or enumeration option by name.
///
/// @param[in] settings NULL for the defaults
/// @return SWB_OK; SWB_ERR_OPTION if there is no such option or it is a float
#[no_mangle]
pub unsafe extern "C" fn swb_settings_get_int(
    settings: *const Settings,
    name: *const c_char,
    value: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let name = raw::text(name, "name")?;
        match read(settings)?.get_by_name(name)? {
            Value::Int(v) => raw::write(value, v, "value"),
            _ => Err(Error::Option(format!("option '{name}' is a float"))),
        }
    })
}

/// Get an option by name as a number.
///
/// @param[in] settings NULL for the defaults
/// @return SWB_OK; SWB_ERR_OPTION if there is no such option
#[no_mangle]
pub unsafe extern "C" fn swb_settings_get_double(
    settings: *const Settings,
    name: *const c_char,
    value: *mut f64,
) -> swb_status {
    guard(|| unsafe {
        match read(settings)?.get_by_name(raw::text(name, "name")?)? {
            Value::Int(v) => raw::write(value, v as f64, "value"),
            Value::Float(v) => raw::write(value, v, "value"),
            Value::Text(_) => Err(Error::Internal("an option without a number".into())),
        }
    })
}

/// Get an option by name as text that reads back to the same value; enumerations as value name.
///
/// @param[in]  settings NULL for the defaults
/// @param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed   length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_OPTION if there is no such option; SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_settings_get_string(
    settings: *const Settings,
    name: *const c_char,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = option(raw::text(name, "name")?)?.get_text(&read(settings)?);
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// Check every option against its range, and those that belong together.
///
/// @return SWB_OK; SWB_ERR_RANGE with option, value and range in the message
#[no_mangle]
pub unsafe extern "C" fn swb_settings_validate(settings: *const Settings) -> swb_status {
    guard(|| unsafe { read(settings)? }.validate())
}

/// Write all options as one JSON object; enumerations as value name, infinite values as "inf".
///
/// @param[in]  settings NULL for the defaults
/// @param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed   length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_settings_to_json(
    settings: *const Settings,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe { raw::write_text(read(settings)?.to_json().as_bytes(), buf, len, needed) })
}

/// The texts of the option table with their final NUL.
struct Texts {
    name: CString,
    doc: CString,
    symbol: CString,
    values: Vec<CString>,
}

fn texts(index: i64) -> Option<&'static Texts> {
    static TEXTS: OnceLock<Vec<Texts>> = OnceLock::new();
    let all = TEXTS.get_or_init(|| {
        let row = |o: &OptionInfo| Texts {
            name: raw::c_string(o.name),
            doc: raw::c_string(o.doc),
            symbol: raw::c_string(o.symbol),
            values: match o.kind {
                Kind::Enum(names) => names.iter().map(|n| raw::c_string(n)).collect(),
                _ => Vec::new(),
            },
        };
        OPTIONS.iter().map(row).collect()
    });
    all.get(usize::try_from(index).ok()?)
}

fn info(index: i64) -> Result<&'static OptionInfo> {
    usize::try_from(index)
        .ok()
        .and_then(|i| OPTIONS.get(i))
        .ok_or_else(|| Error::Dimension(format!("option index {index} is outside 0..{}", OPTIONS.len() - 1)))
}

/// Number of options; their indices are 0 to count - 1, in the order of the fields of swb_settings.
#[no_mangle]
pub extern "C" fn swb_option_count() -> i64 {
    OPTIONS.len() as i64
}

/// Index of an option by name.
///
/// @return SWB_OK; SWB_ERR_OPTION if there is no such option (the message names the nearest one)
#[no_mangle]
pub unsafe extern "C" fn swb_option_find(name: *const c_char, index: *mut i64) -> swb_status {
    guard(|| unsafe {
        let found = option(raw::text(name, "name")?)?;
        let i = OPTIONS.iter().position(|o| o.name == found.name).unwrap_or(0);
        raw::write(index, i as i64, "index")
    })
}

/// Name of an option; NULL if there is no such index. Static.
#[no_mangle]
pub extern "C" fn swb_option_name(index: i64) -> *const c_char {
    query(ptr::null(), || texts(index).map_or(ptr::null(), |t| t.name.as_ptr()))
}

/// Description of an option in one sentence; NULL if there is no such index. Static.
#[no_mangle]
pub extern "C" fn swb_option_doc(index: i64) -> *const c_char {
    query(ptr::null(), || texts(index).map_or(ptr::null(), |t| t.doc.as_ptr()))
}

/// Symbol of an option in the literature, or ""; NULL if there is no such index. Static.
#[no_mangle]
pub extern "C" fn swb_option_symbol(index: i64) -> *const c_char {
    query(ptr::null(), || texts(index).map_or(ptr::null(), |t| t.symbol.as_ptr()))
}

/// Name of a value of an enumeration option; NULL if there is no such value. Static.
#[no_mangle]
pub extern "C" fn swb_option_value_name(index: i64, value: i64) -> *const c_char {
    query(ptr::null(), || {
        let name = texts(index).and_then(|t| t.values.get(usize::try_from(value).ok()?));
        name.map_or(ptr::null(), |n| n.as_ptr())
    })
}

/// Kind of an option.
///
/// @param[out] kind an enum swb_kind
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
#[no_mangle]
pub unsafe extern "C" fn swb_option_kind(index: i64, kind: *mut i32) -> swb_status {
    guard(|| {
        let value = match info(index)?.kind {
            Kind::Int => OptionKind::Int,
            Kind::Float => OptionKind::Float,
            Kind::Enum(_) => OptionKind::Enum,
        };
        unsafe { raw::write(kind, value as i32, "kind") }
    })
}

/// Range of an option. Any output may be NULL.
///
/// @param[out] min_open 1 if min itself is not allowed
/// @param[out] max_open 1 if max itself is not allowed
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
#[no_mangle]
pub unsafe extern "C" fn swb_option_range(
    index: i64,
    min: *mut f64,
    max: *mut f64,
    min_open: *mut i32,
    max_open: *mut i32,
) -> swb_status {
    guard(|| {
        let o = info(index)?;
        unsafe {
            raw::write_optional(min, o.min.value());
            raw::write_optional(max, o.max.value());
            raw::write_optional(min_open, o.min.is_open().into());
            raw::write_optional(max_open, o.max.is_open().into());
        }
        Ok(())
    })
}

/// Default of an option, as a number.
///
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
#[no_mangle]
pub unsafe extern "C" fn swb_option_default(index: i64, value: *mut f64) -> swb_status {
    guard(|| unsafe { raw::write(value, info(index)?.default, "value") })
}

/// Tells whether an option is fixed once an object is built with it.
///
/// @param[out] setup_only 1 if it is fixed, 0 if it may change between solves
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such index
#[no_mangle]
pub unsafe extern "C" fn swb_option_setup_only(index: i64, setup_only: *mut i32) -> swb_status {
    guard(|| unsafe { raw::write(setup_only, info(index)?.setup_only.into(), "setup_only") })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The settings of a header with another number of fields.
    fn words(n: usize) -> Vec<u64> {
        vec![0xdead_beef_dead_beef; n]
    }

    #[test]
    fn older_and_newer_structs() {
        let ours = (OURS / 8) as usize;
        for n in [2, ours - 1, ours, ours + 3] {
            let mut memory = words(n + 1);
            let p = memory.as_mut_ptr().cast::<Settings>();
            unsafe {
                assert_eq!(swb_settings_init(p, 8 * n as u64), swb_status::SWB_OK);
                assert_eq!(read(p).unwrap(), Settings::default());
                assert_eq!(swb_settings_set_int(p, c"rk_family".as_ptr(), 1), swb_status::SWB_OK);
                assert_eq!(read(p).unwrap().rk_family, 1);
                // the field at the end, where every option so far was added
                let last = swb_settings_set_int(p, swb_option_name(swb_option_count() - 1), 0);
                assert_eq!(last == swb_status::SWB_OK, n >= ours);
            }
            assert_eq!(memory[0], 8 * n as u64);
            assert!(memory[..n].iter().all(|w| *w != 0xdead_beef_dead_beef));
            assert_eq!(memory[n], 0xdead_beef_dead_beef);
        }
    }

    #[test]
    fn uninitialised_struct_is_noticed() {
        let mut memory = words((OURS / 8) as usize);
        let p = memory.as_mut_ptr().cast::<Settings>();
        unsafe {
            assert_eq!(swb_settings_validate(p), swb_status::SWB_ERR_STATE);
            assert_eq!(swb_settings_init(p, 7), swb_status::SWB_ERR_DIMENSION);
            assert_eq!(swb_settings_init(p, 0), swb_status::SWB_ERR_DIMENSION);
            assert_eq!(swb_settings_init(ptr::null_mut(), OURS), swb_status::SWB_ERR_NULL);
        }
        assert!(memory.iter().all(|w| *w == 0xdead_beef_dead_beef));
    }
}
