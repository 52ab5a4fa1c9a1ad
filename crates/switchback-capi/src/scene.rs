//! Scenes with contacts: made of expressions, and their impacts and forces in the result of a simulation.

use super::expr::{ids, swb_expr};
use super::guard::guard;
use super::handle::{self, running, setting, Object};
use super::raw;
use super::report::Sized8;
use super::run::{need_derivatives, swb_run, write_structs};
use super::status::swb_status;
use super::system::swb_system;
use std::ffi::c_char;
use switchback::error::{Error, Result};
use switchback::event::Impact;
use switchback::expr::Id;
use switchback::memory::sizes::size;
use switchback::model::Names;
use switchback::scene::{Built, Constraint, Contact, Friction, Scene};
use switchback::system::ImpactLaw;

/// A scene that is being written, and what it became when it was last built.
pub struct SceneObject {
    scene: Scene,
    built: Option<Built>,
    /// The handle of the graph of its expressions: those of another one mean something else.
    graph: Option<*const swb_expr>,
    /// What became of the contacts when it was last frozen.
    frozen: Option<String>,
}

// The handle is compared, never read.
unsafe impl Send for SceneObject {}
unsafe impl Sync for SceneObject {}

impl SceneObject {
    pub(super) fn new(scene: Scene) -> SceneObject {
        SceneObject { scene, built: None, graph: None, frozen: None }
    }

    /// An error if the scene has expressions of another graph.
    pub(super) fn check_graph(&mut self, graph: *const swb_expr) -> Result<()> {
        if *self.graph.get_or_insert(graph) == graph {
            return Ok(());
        }
        Err(Error::State("the expressions of the scene belong to another graph: give that one in all calls".into()))
    }

    pub(super) fn scene(&self) -> &Scene {
        &self.scene
    }

    pub(super) fn frozen(&self) -> Option<&str> {
        self.frozen.as_deref()
    }

    pub(super) fn set_frozen(&mut self, report: String) {
        self.frozen = Some(report);
    }

    pub(super) fn change(&mut self) -> &mut Scene {
        self.built = None;
        self.frozen = None;
        &mut self.scene
    }

    pub(super) fn built(&self) -> Result<&Built> {
        self.built.as_ref().ok_or_else(|| Error::State("the scene is not built: call swb_scene_build first".into()))
    }
}

/// Scene: coordinates q, velocities v, inertia, forces and contacts, made of expressions in which the states are q, then v, then what is
/// beside them.
pub struct swb_scene(());
impl Object for swb_scene {
    type Value = SceneObject;
    const NAME: &'static str = "swb_scene";
}

/// Laws for several contacts that close at once.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_impact_law {
    /// Newton's law for all contacts in one complementarity problem (Moreau).
    Newton = 0,
    /// Newton's law for one contact after the other, the one that closes fastest first.
    Sequential = 1,
}

/// Causes of impacts.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_impact_kind {
    /// A contact closed.
    Collision = 0,
    /// No forces continue the motion (Painleve): sliding stops by an impact without collision.
    Painleve = 1,
    /// Impacts accumulate: this is the last, the contact stays closed.
    Last = 2,
}

/// Modes of a contact.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_contact_mode {
    /// Open: no force.
    Open = 0,
    /// Closed; with friction, sticking. Of a switch: its function stays at zero.
    Closed = 1,
    /// Sliding: in the plane along the tangent, in space in any direction. Of a switch: its function is positive.
    Slides = 2,
    /// Sliding against the tangent, in the plane. Of a switch: its function is negative.
    SlidesBack = 3,
}

/// Create a scene without forces and contacts: the inertia is the unit matrix, and where there are as many coordinates as
/// velocities the rates of the coordinates are the velocities.
///
/// @param[in]  name  for messages
/// @param[in]  n_q   coordinates
/// @param[in]  n_v   velocities
/// @param[in]  nu    controls
/// @param[in]  np    parameters
/// @param[in]  names of coordinates, velocities, controls and parameters, one per line, for messages; may be NULL
/// @param[out] out   the new object, NULL on failure; free with swb_scene_free
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_scene_create(
    name: *const c_char,
    n_q: i64,
    n_v: i64,
    nu: i64,
    np: i64,
    names: *const c_char,
    out: *mut *mut swb_scene,
) -> swb_status {
    unsafe { swb_scene_create_with_states(name, n_q, n_v, 0, nu, np, names, out) }
}

/// Create a scene that has states z beside coordinates and velocities, z' = h(q, v, z, u, p, t): currents of motors, controllers,
/// temperatures. Forces and the bounds of friction at joints may depend on them. They stand behind the velocities among the states.
///
/// @param[in]  name  for messages
/// @param[in]  n_q   coordinates
/// @param[in]  n_v   velocities
/// @param[in]  n_z   states beside these
/// @param[in]  nu    controls
/// @param[in]  np    parameters
/// @param[in]  names of coordinates, velocities, other states, controls and parameters, one per line, for messages; may be NULL
/// @param[out] out   the new object, NULL on failure; free with swb_scene_free
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_scene_create_with_states(
    name: *const c_char,
    n_q: i64,
    n_v: i64,
    n_z: i64,
    nu: i64,
    np: i64,
    names: *const c_char,
    out: *mut *mut swb_scene,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let (n_q, n_v, n_z) = (size(n_q, "n_q")?, size(n_v, "n_v")?, size(n_z, "n_z")?);
            let (nu, np) = (size(nu, "nu")?, size(np, "np")?);
            let mut scene = Scene::with_states(raw::text(name, "name")?, n_q, n_v, n_z, nu, np)?;
            set_names(&mut scene, names, [n_q + n_v + n_z, nu, np])?;
            Ok(SceneObject::new(scene))
        })
    })
}

/// Create a projected system, or first-order sweeping process, without right-hand side and constraints:
/// x' = f(x, u, p, t) + sum of the gradients of c_i(x, p, t) times multipliers, 0 <= multiplier, c_i >= 0, one of them zero.
///
/// It is a scene whose states are in the place of velocities: swb_scene_set_force sets f, swb_scene_add_contact adds a
/// constraint c_i, without tangents, friction and restitution; multipliers are the forces in the results.
///
/// @param[in]  name  for messages
/// @param[in]  nx    states
/// @param[in]  nu    controls
/// @param[in]  np    parameters
/// @param[in]  names of states, controls and parameters, one per line, for messages; may be NULL
/// @param[out] out   the new object, NULL on failure; free with swb_scene_free
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_scene_create_projected(
    name: *const c_char,
    nx: i64,
    nu: i64,
    np: i64,
    names: *const c_char,
    out: *mut *mut swb_scene,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            let (nx, nu, np) = (size(nx, "nx")?, size(nu, "nu")?, size(np, "np")?);
            let mut scene = Scene::projected(raw::text(name, "name")?, nx, nu, np)?;
            set_names(&mut scene, names, [nx, nu, np])?;
            Ok(SceneObject::new(scene))
        })
    })
}

/// Names of states, controls and parameters, one per line.
unsafe fn set_names(scene: &mut Scene, names: *const c_char, [nx, nu, np]: [usize; 3]) -> Result<()> {
    if !names.is_null() {
        let all: Vec<String> = unsafe { raw::text(names, "names")? }.split('\n').map(str::to_owned).collect();
        let mut rest = all.into_iter();
        let mut take = |n: usize| rest.by_ref().take(n).collect::<Vec<String>>();
        scene.set_names(Names { x: take(nx), u: take(nu), p: take(np) });
    }
    Ok(())
}

unsafe fn with_ids(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    (list, n): (*const i64, i64),
    what: &str,
    f: impl FnOnce(&mut Scene, Vec<Id>) -> Result<()>,
) -> Result<()> {
    let all = unsafe { handle::with_ref(graph, |dag| ids(dag, list, n, what))? };
    unsafe {
        handle::with_mut(scene, |s| {
            s.check_graph(graph)?;
            f(s.change(), all)
        })
    }
}

/// Set the rates of the coordinates, linear in the velocities: q' = N(q) v.
///
/// @param[in] graph the graph of the expressions
/// @param[in] rates [n] n_q expressions
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE for numbers that are no expressions
#[no_mangle]
pub unsafe extern "C" fn swb_scene_set_rates(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    rates: *const i64,
    n: i64,
) -> swb_status {
    setting(scene, || unsafe { with_ids(scene, graph, (rates, n), "rates", |s, all| s.set_rates(&all)) })
}

/// Set the inertia matrix M: symmetric and positive definite; it may depend on coordinates, parameters and time.
///
/// @param[in] graph   the graph of the expressions
/// @param[in] entries [n] n_v times n_v expressions
/// @return as swb_scene_set_rates
#[no_mangle]
pub unsafe extern "C" fn swb_scene_set_inertia(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    entries: *const i64,
    n: i64,
) -> swb_status {
    setting(scene, || unsafe { with_ids(scene, graph, (entries, n), "entries", |s, all| s.set_inertia(&all)) })
}

/// Set the forces f_v(q, v, u, p, t): all that stands beside M v' but contact forces. They may switch; switches are listed behind the contacts.
///
/// @param[in] graph the graph of the expressions
/// @param[in] force [n] n_v expressions
/// @return as swb_scene_set_rates
#[no_mangle]
pub unsafe extern "C" fn swb_scene_set_force(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    force: *const i64,
    n: i64,
) -> swb_status {
    setting(scene, || unsafe {
        with_ids(scene, graph, (force, n), "force", |s, all| {
            let n_v = s.sizes().1;
            if all.len() != n_v {
                return Err(Error::Dimension(format!("there are {} forces, expected {n_v}", all.len())));
            }
            all.into_iter().enumerate().try_for_each(|(i, f)| s.set_force(i, f))
        })
    })
}

/// Set the rates of the states beside coordinates and velocities, expressions of states, controls, parameters and time, which may switch.
///
/// @param[in] graph the graph of the expressions
/// @param[in] rates [n] n_z expressions
/// @return as swb_scene_set_rates
#[no_mangle]
pub unsafe extern "C" fn swb_scene_set_state_rates(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    rates: *const i64,
    n: i64,
) -> swb_status {
    setting(scene, || unsafe {
        with_ids(scene, graph, (rates, n), "rates", |s, all| {
            let n_z = s.n_states() - s.discrete().len();
            if all.len() != n_z {
                return Err(Error::Dimension(format!("there are {} rates of states, expected {n_z}", all.len())));
            }
            all.into_iter().enumerate().try_for_each(|(i, h)| s.set_state_rate(i, h))
        })
    })
}

/// Add a contact.
///
/// @param[in]  graph       the graph of the expressions
/// @param[in]  name        of its own, for messages and results
/// @param[in]  gap         expression of coordinates, parameters and time, positive where the bodies are apart; with friction a
///                         length
/// @param[in]  tangents    [n_tangents] no, one (in the plane) or two (in space) expressions whose rates are the sliding
///                         velocity, or which are its components, linear in the velocities
/// @param[in]  friction    expression, coefficient of friction; -1: none
/// @param[in]  restitution expression, coefficient of restitution between 0 and 1; -1: 0
/// @param[out] index       number of the contact; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or too many tangents; SWB_ERR_STATE for a name or a gap
///         that is there already
#[no_mangle]
pub unsafe extern "C" fn swb_scene_add_contact(
    scene: *mut swb_scene,
    graph: *mut swb_expr,
    name: *const c_char,
    gap: i64,
    tangents: *const i64,
    n_tangents: i64,
    friction: i64,
    restitution: i64,
    index: *mut i64,
) -> swb_status {
    setting(scene, || unsafe {
        let contact = handle::with_mut(graph, |dag| {
            let zero = dag.constant(0.0);
            let one = |v: i64, what: &str| ids(dag, &v, 1, what).map(|all| all[0]);
            let optional = |v: i64, what: &str| if v == -1 { Ok(zero) } else { one(v, what) };
            Ok(Contact {
                name: raw::text(name, "name")?.to_owned(),
                gap: one(gap, "gap")?,
                tangents: ids(dag, tangents, n_tangents, "tangents")?,
                friction: optional(friction, "friction")?,
                restitution: optional(restitution, "restitution")?,
            })
        })?;
        let k = handle::with_mut(scene, |s| {
            s.check_graph(graph)?;
            s.change().add_contact(contact)
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Set the coefficient of friction by which a contact sticks, where it is larger than that by which it slides. Impacts know the
/// coefficient of sliding only.
///
/// @param[in] graph    the graph of the expressions
/// @param[in] contact  its number, one with tangents
/// @param[in] stiction expression of coordinates, parameters and time, not less than the friction of the contact
/// @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or no contact with tangents
#[no_mangle]
pub unsafe extern "C" fn swb_scene_set_stiction(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    contact: i64,
    stiction: i64,
) -> swb_status {
    setting(scene, || unsafe {
        let k = size(contact, "contact")?;
        with_ids(scene, graph, (&stiction, 1), "stiction", |s, all| s.set_stiction(k, all[0]))
    })
}

/// Give a lower bound of the gap of a contact. Contacts with the same expression are not looked at while it is positive, as those of two bodies
/// that are far apart: for scenes with very many contacts. Nothing checks that the gap is not less; a contact may be missed where it is.
///
/// @param[in] graph      the graph of the expressions
/// @param[in] contact    its number
/// @param[in] separation expression of coordinates, parameters and time: of two bodies the distance of spheres around them
/// @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions or no contact
#[no_mangle]
pub unsafe extern "C" fn swb_scene_set_separation(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    contact: i64,
    separation: i64,
) -> swb_status {
    setting(scene, || unsafe {
        let k = size(contact, "contact")?;
        with_ids(scene, graph, (&separation, 1), "separation", |s, all| s.set_separation(k, all[0]))
    })
}

/// Add dry friction at a joint: a force opposite to a sliding velocity, with a bound that is given. It is counted among the
/// contacts, and in results its force stands at the first tangent, behind a zero in the place of the normal force.
///
/// @param[in]  graph    the graph of the expressions
/// @param[in]  name     of its own, for messages and results
/// @param[in]  sliding  expression of coordinates, parameters and time whose rate is the sliding velocity, or which is that
///                      velocity, linear in the velocities
/// @param[in]  bound    expression of states, controls, parameters and time, not negative: the force where it slides
/// @param[in]  stiction expression like bound, not less than it: what holds where it sticks; -1: the same
/// @param[out] index    number among the contacts; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions; SWB_ERR_STATE for a name that is there already;
///         SWB_ERR_UNSUPPORTED for projected systems
#[no_mangle]
pub unsafe extern "C" fn swb_scene_add_friction(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    name: *const c_char,
    sliding: i64,
    bound: i64,
    stiction: i64,
    index: *mut i64,
) -> swb_status {
    setting(scene, || unsafe {
        let given = [sliding, bound, stiction];
        let n = if stiction == -1 { 2 } else { 3 };
        let name = raw::text(name, "name")?.to_owned();
        let mut k = 0;
        with_ids(scene, graph, (given.as_ptr(), n), "sliding, bound or stiction", |s, all| {
            k = s.add_friction(Friction { name, sliding: all[0], bound: all[1], stiction: all.get(2).copied() })?;
            Ok(())
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Add a constraint: a contact that never opens, whose force has either sign. The state at the start must satisfy it, and its rate.
/// It is counted among the contacts.
///
/// @param[in]  graph the graph of the expressions
/// @param[in]  name  of its own, for messages and results
/// @param[in]  zero  expression of coordinates, parameters and time that is zero; or one that contains velocities, linear in them
/// @param[out] index number among the contacts; may be NULL
/// @return as swb_scene_add_friction
#[no_mangle]
pub unsafe extern "C" fn swb_scene_add_constraint(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    name: *const c_char,
    zero: i64,
    index: *mut i64,
) -> swb_status {
    setting(scene, || unsafe {
        let name = raw::text(name, "name")?.to_owned();
        let mut k = 0;
        with_ids(scene, graph, (&zero, 1), "zero", |s, all| {
            k = s.add_constraint(Constraint { name, zero: all[0] })?;
            Ok(())
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// State that a coordinate stays between bounds: contacts that cannot close there are left out when the scene is built, with a
/// proof in the report. A simulation that leaves the bounds ends with an error if something was left out for them.
///
/// @param[in] coordinate from 0
/// @param[in] low        lower bound, -INFINITY if none is known
/// @param[in] high       upper bound, INFINITY if none is known
/// @return SWB_OK; SWB_ERR_RANGE if there is no such coordinate, or a bound is NaN, or no number is between the bounds
#[no_mangle]
pub unsafe extern "C" fn swb_scene_set_bounds(
    scene: *mut swb_scene,
    coordinate: i64,
    low: f64,
    high: f64,
) -> swb_status {
    setting(scene, || unsafe {
        let i = size(coordinate, "coordinate")?;
        handle::with_mut(scene, |s| s.change().set_bounds(i, low, high))
    })
}

/// Set what happens where several contacts close at once.
///
/// @param[in] law enum swb_impact_law
/// @return SWB_OK; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_scene_set_impact_law(scene: *mut swb_scene, law: i32) -> swb_status {
    setting(scene, || unsafe {
        let law = match law {
            0 => ImpactLaw::Newton,
            1 => ImpactLaw::Sequential,
            _ => return Err(Error::Range(format!("law is {law}: give an enum swb_impact_law"))),
        };
        handle::with_mut(scene, |s| {
            s.change().set_law(law);
            Ok(())
        })
    })
}

/// Build the scene: derivatives, normals, and which contacts cannot close. Any change needs another call.
///
/// @param[in] graph the graph of all expressions of the scene; it grows
/// @return SWB_OK; SWB_ERR_STATE if forces are missing; SWB_ERR_RANGE, SWB_ERR_UNSUPPORTED for expressions that do not fit,
///         with a message that names them
#[no_mangle]
pub unsafe extern "C" fn swb_scene_build(scene: *mut swb_scene, graph: *mut swb_expr) -> swb_status {
    running(scene, || unsafe {
        handle::with_mut(scene, |s| {
            s.check_graph(graph)?;
            s.built = Some(handle::with_mut(graph, |dag| s.scene.build_in(dag))?);
            Ok(())
        })
    })
}

/// The system of a scene that is built; its states are the coordinates, then the velocities. Simulate it event-driven.
///
/// @param[out] out the new object, NULL on failure; free with swb_system_free
/// @return SWB_OK; SWB_ERR_STATE if the scene is not built
#[no_mangle]
pub unsafe extern "C" fn swb_scene_system(scene: *const swb_scene, out: *mut *mut swb_system) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            handle::require(scene)?;
            handle::with_ref(scene, |s| Ok(s.built()?.system.clone()))
        })
    })
}

/// Report of a scene that is built: contacts with what they cost, and which were left out and why.
///
/// @param[in]  json   0 for text, 1 for an object of JSON
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE if the scene is not built
#[no_mangle]
pub unsafe extern "C" fn swb_scene_report(
    scene: *const swb_scene,
    json: i32,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_ref(scene, |s| {
            let r = &s.built()?.report;
            Ok(if json == 0 { r.to_string() } else { r.json() })
        })?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// Free; systems made of the scene stay. NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_scene_free(scene: *mut swb_scene) {
    unsafe { handle::free(scene) }
}

/// The part of one contact in an impact.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_impact {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// The contact; those that were left out do not count.
    pub contact: i64,
    /// An enum swb_impact_kind.
    pub kind: i64,
    /// 1 if other contacts had impulses at the same time.
    pub simultaneous: i64,
    /// 1 if velocities behind it and impulses are unique.
    pub unique: i64,
    /// Rate of the gap before.
    pub rate_before: f64,
    /// Rate of the gap behind.
    pub rate_after: f64,
    /// Normal impulse.
    pub normal: f64,
    /// Impulse along the first tangent.
    pub tangential: f64,
    /// Impulse along the second tangent.
    pub tangential2: f64,
    /// How far the bodies would overlap without the impact: small where the contact is grazing.
    pub depth: f64,
}
unsafe impl Sized8 for swb_impact {}

/// An impact as a struct.
pub(super) fn impact_of(i: &Impact) -> swb_impact {
    swb_impact {
        struct_size: 0,
        t: i.t,
        contact: i.contact as i64,
        kind: i.kind as i64,
        simultaneous: i.simultaneous.into(),
        unique: i.unique.into(),
        rate_before: i.rates[0],
        rate_after: i.rates[1],
        normal: i.impulse[0],
        tangential: i.impulse[1],
        tangential2: i.impulse[2],
        depth: i.depth,
    }
}

/// The impacts of a run in the order they happened; their number is n_impacts of swb_run_info.
///
/// @param[out] impacts     [n] n_impacts
/// @param[in]  struct_size sizeof(swb_impact)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_impacts(
    run: *const swb_run,
    impacts: *mut swb_impact,
    n: i64,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| write_structs(&r.run.impacts, impact_of, impacts, n, struct_size, "impacts"))
    })
}

/// Derivatives of the time of an impact with respect to initial states, parameters and controls.
///
/// @param[in]  index its place in swb_run_impacts, from 0
/// @param[out] dt    [n] n_columns
/// @return as swb_run_sensitivity
#[no_mangle]
pub unsafe extern "C" fn swb_run_impact_sensitivity(
    run: *const swb_run,
    index: i64,
    dt: *mut f64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            need_derivatives(r.run.sensitivity.as_ref())?;
            let n_impacts = r.run.impacts.len();
            let found = usize::try_from(index).ok().and_then(|i| r.run.impacts.get(i));
            let impact = found
                .ok_or_else(|| Error::Dimension(format!("there is no impact {index}, the run has {n_impacts}")))?;
            raw::write_slice(dt, n, &impact.dt, "dt")
        })
    })
}

/// Modes of the contacts of a scene at times.
///
/// @param[in]  t     [n_t] times; at the time of an event the modes are those before it
/// @param[out] modes [n] n_t times n_scene_contacts, enum swb_contact_mode, those of the first time first
/// @return SWB_OK; SWB_ERR_STATE if the run is not that of a scene; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_run_contact_modes(
    run: *const swb_run,
    t: *const f64,
    n_t: i64,
    modes: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let mut all = Vec::new();
            for &t in raw::slice(t, n_t, "t")? {
                all.extend(r.run.contact_modes(t)?.iter().map(|&m| m as i64));
            }
            raw::write_slice(modes, n, &all, "modes")
        })
    })
}

/// Forces of the contacts of a scene at times: forces, not impulses. Other times than the end need the option dense.
///
/// @param[in]  t      [n_t] times within the run
/// @param[out] forces [n] n_t times n_scene_contacts times 3: the normal force and those along the tangents, zero where the
///                    contact is open or has no tangents; of dry friction at a joint zero and the friction; of a switch zero and
///                    its weight, 1, -1 or between; the contacts of the first time first
/// @return SWB_OK; SWB_ERR_STATE if the run is not that of a scene, or for want of dense output; SWB_ERR_RANGE for times
///         outside; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_run_contact_forces(
    run: *const swb_run,
    t: *const f64,
    n_t: i64,
    forces: *mut f64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let mut all = Vec::new();
            for &t in raw::slice(t, n_t, "t")? {
                all.extend(r.run.contact_forces(t)?.into_iter().flatten());
            }
            raw::write_slice(forces, n, &all, "forces")
        })
    })
}
