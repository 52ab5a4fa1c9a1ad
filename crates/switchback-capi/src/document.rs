//! Documents: models and problems in JSON.

use super::expr::{swb_expr, swb_model};
use super::function::{shared, swb_function};
use super::guard::guard;
use super::handle;
use super::ocp::{self, swb_ocp};
use super::raw;
use super::scene::{swb_scene, SceneObject};
use super::simulator::{swb_simulator, Simulation};
use super::status::swb_status;
use std::ffi::c_char;
use switchback::document::{read, write_model, write_scene, Document};
use switchback::error::{check_run, Error, Result};
use switchback::expr::Id;
use switchback::memory::sizes;
use switchback::model::SavedModel;
use switchback::scene::SavedScene;
use switchback::system::SharedFunction;

unsafe fn supplied(functions: *const *const swb_function, n: i64) -> Result<Vec<SharedFunction>> {
    let all = unsafe { raw::slice(functions, n, "functions")? };
    all.iter().enumerate().map(|(k, &f)| unsafe { shared(f, &format!("functions[{k}]")) }).collect()
}

fn other(found: &Document, wanted: &str, reader: &str) -> Error {
    let what = match found {
        Document::Model(_) => "a model: read it with swb_model_from_json",
        Document::Scene(_) => "a scene: read it with swb_scene_from_json",
        Document::Simulation(_) => "a simulation: read it with swb_simulator_from_json",
        Document::Ocp(_) => "an optimal control problem: read it with swb_ocp_from_json",
        _ => "something else",
    };
    Error::Range(format!("{reader} reads {wanted}, the document holds {what}"))
}

fn model_of(document: Document) -> Result<Box<SavedModel>> {
    match document {
        Document::Model(m) => Ok(m),
        d => Err(other(&d, "models", "swb_model_from_json")),
    }
}

/// A model as a document in JSON, for bug reports and to pass it on: its expressions, names and trial point, its discrete
/// states with the values they begin with, and its transitions. Functions that are called are named.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if the buffer is
///         too short
#[no_mangle]
pub unsafe extern "C" fn swb_model_to_json(
    model: *const swb_model,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_ref(model, |m| write_model(m.source()?))?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// Build a model from a document; its expressions become expressions of the graph.
///
/// @param[in]  graph     may hold other expressions, which stay
/// @param[in]  text      of swb_model_to_json
/// @param[in]  functions [n_functions] those that the document calls by name
/// @param[out] rhs       [n_rhs] the derivatives of the states; NULL with n_rhs 0 if not wanted
/// @param[out] out       the new object, NULL on failure; free with swb_model_free
/// @return SWB_OK; SWB_ERR_RANGE if the text is no such document, with the place; SWB_ERR_UNSUPPORTED for other versions;
///         SWB_ERR_STATE if a function is missing; SWB_ERR_DIMENSION; else as swb_model_create
#[no_mangle]
pub unsafe extern "C" fn swb_model_from_json(
    graph: *mut swb_expr,
    text: *const c_char,
    functions: *const *const swb_function,
    n_functions: i64,
    rhs: *mut i64,
    n_rhs: i64,
    out: *mut *mut swb_model,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let (text, functions) = (raw::text(text, "text")?, supplied(functions, n_functions)?);
            let saved = model_of(read(text, &functions)?)?;
            let wanted = n_rhs != 0 || !rhs.is_null();
            handle::with_mut(graph, |dag| {
                let model = saved.restore(dag, &functions)?;
                let built = model.build_in(dag)?;
                if wanted {
                    let numbers: Vec<i64> =
                        model.derivatives().iter().flatten().map(|id: &Id| id.index() as i64).collect();
                    raw::write_slice(rhs, n_rhs, &numbers, "rhs")?;
                }
                Ok(built)
            })
        })
    })
}

/// A scene, or a projected system, as a document in JSON: its sizes, names and expressions, contacts, friction, constraints, discrete states
/// and transitions. Functions that are called are named.
///
/// @param[in]  graph  the graph of its expressions
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_STATE for another graph; SWB_ERR_UNSUPPORTED if two functions that are called have one name;
///         SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_scene_to_json(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let saved = handle::with_mut(scene, |s| {
            s.check_graph(graph)?;
            handle::with_ref(graph, |dag| SavedScene::new(s.scene(), dag))
        })?;
        raw::write_text(write_scene(&saved)?.as_bytes(), buf, len, needed)
    })
}

/// Create a scene, or a projected system, from a document; its expressions become expressions of the graph. It is not built yet.
///
/// @param[in]  graph     may hold other expressions, which stay
/// @param[in]  text      of swb_scene_to_json
/// @param[in]  functions [n_functions] those that the document calls by name
/// @param[out] roots     [n_roots] expressions: of every contact the gap, then the tangents, of friction what slides, of a constraint what is
///                       zero; then of every transition the guard, and what its reset makes of states; NULL with n_roots 0 if not wanted
/// @param[out] out       the new object, NULL on failure; free with swb_scene_free
/// @return SWB_OK; SWB_ERR_RANGE if the text is no such document, with the place; SWB_ERR_UNSUPPORTED for other versions;
///         SWB_ERR_STATE if a function is missing; SWB_ERR_DIMENSION; else as the functions that make a scene
#[no_mangle]
pub unsafe extern "C" fn swb_scene_from_json(
    graph: *mut swb_expr,
    text: *const c_char,
    functions: *const *const swb_function,
    n_functions: i64,
    roots: *mut i64,
    n_roots: i64,
    out: *mut *mut swb_scene,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let (text, functions) = (raw::text(text, "text")?, supplied(functions, n_functions)?);
            let saved = match read(text, &functions)? {
                Document::Scene(s) => s,
                d => return Err(other(&d, "scenes", "swb_scene_from_json")),
            };
            let wanted = n_roots != 0 || !roots.is_null();
            let scene = handle::with_mut(graph, |dag| saved.restore(dag, &functions))?;
            if wanted {
                let numbers: Vec<i64> = scene.expressions().iter().map(|id| id.index() as i64).collect();
                raw::write_slice(roots, n_roots, &numbers, "roots")?;
            }
            let mut made = SceneObject::new(scene);
            made.check_graph(graph)?;
            Ok(made)
        })
    })
}

/// Numbers of states, controls and parameters of a model. Any output may be NULL.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_model_sizes(
    model: *const swb_model,
    nx: *mut i64,
    nu: *mut i64,
    np: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(model, |m| {
            raw::write_optional(nx, m.dims.x as i64);
            raw::write_optional(nu, m.dims.u as i64);
            raw::write_optional(np, m.dims.p as i64);
            Ok(())
        })
    })
}

/// A simulation as a document in JSON: system, options, and time, state, controls and parameters where the simulator stands.
/// Functions that are not made of expressions are named only.
///
/// @param[in]  duration of the run that is to be repeated
/// @param[in]  n_steps  of that run
/// @param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed   length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if
///         the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_to_json(
    sim: *const swb_simulator,
    duration: f64,
    n_steps: i64,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        check_run(duration, n_steps)?;
        let n = sizes::size(n_steps, "n_steps")?;
        let text = handle::with_ref(sim, |s| s.json(duration, n))?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// Create a simulator from a document; it stands where the simulation begins.
///
/// @param[in]  text      of swb_simulator_to_json
/// @param[in]  functions [n_functions] those that the document names
/// @param[out] duration  of the run; may be NULL
/// @param[out] n_steps   of the run; may be NULL
/// @param[out] out       the new object, NULL on failure; free with swb_simulator_free
/// @return as swb_model_from_json
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_from_json(
    text: *const c_char,
    functions: *const *const swb_function,
    n_functions: i64,
    duration: *mut f64,
    n_steps: *mut i64,
    out: *mut *mut swb_simulator,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let (text, functions) = (raw::text(text, "text")?, supplied(functions, n_functions)?);
            let d = match read(text, &functions)? {
                Document::Simulation(d) => d,
                d => return Err(other(&d, "simulations", "swb_simulator_from_json")),
            };
            let run = (d.duration, d.n_steps as i64);
            let made = Simulation::of_document(*d, interrupt)?;
            raw::write_optional(duration, run.0);
            raw::write_optional(n_steps, run.1);
            Ok(made)
        })
    })
}

/// An optimal control problem as a document in JSON: system, costs, constraints, bounds, parameters, options, and what is
/// given to start from. Functions that are not made of expressions are named only.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_UNSUPPORTED if two functions that are called have one name; SWB_ERR_DIMENSION if the buffer is
///         too short
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_to_json(
    ocp: *mut swb_ocp,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_mut(ocp, |o| o.json())?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// Create an optimal control problem from a document.
///
/// @param[in]  text      of swb_ocp_to_json
/// @param[in]  functions [n_functions] those that the document names
/// @param[out] out       the new object, NULL on failure; free with swb_ocp_free
/// @return as swb_model_from_json
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_from_json(
    text: *const c_char,
    functions: *const *const swb_function,
    n_functions: i64,
    out: *mut *mut swb_ocp,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let (text, functions) = (raw::text(text, "text")?, supplied(functions, n_functions)?);
            match read(text, &functions)? {
                Document::Ocp(o) => Ok(ocp::new(*o, interrupt)),
                d => Err(other(&d, "optimal control problems", "swb_ocp_from_json")),
            }
        })
    })
}
