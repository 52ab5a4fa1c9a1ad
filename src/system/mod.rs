//! Piecewise smooth systems as the user states them.
//!
//! ```text
//! ẋ = f0(x,u,p,t) + Σ_k Σ_i θ_i^k f_i^k(x,u,p,t),   θ^k in the Filippov set of subsystem k       (6.22)
//! ```
//!
//! A [`Subsystem`] has its own modes and regions: switching functions `ψ` with a sign matrix, or Stewart's
//! indicator functions. Subsystems add: `n` of them with two modes cost `2n` modes, not `2^n`.

mod algebraic;
mod choice;
mod complementary;
mod contact;
mod eliminated;
mod eliminated_scene;
mod held;
mod linear;
mod on_demand;
mod smoothed;
mod smoothed_whole;
mod steps;
mod steps_scene;
mod transition;

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::func::{Dims, Function};
use crate::memory::sizes;

pub(crate) use algebraic::{Algebraic, Guess};
pub use choice::Choice;
pub(crate) use complementary::with_zeros;
pub use contact::{Contact, ImpactLaw, Inertia, Kind, Local, Mechanics, Order, Projection, Separation};
pub(crate) use eliminated::Elimination;
pub(crate) use linear::{combination, input, Linear};
pub use on_demand::{OnDemand, Signed};
pub use smoothed::Widths;
pub use transition::{Direction, Effect, Reset, Rule, Transition, Trigger};

/// A function that may be shared by models and threads.
pub type SharedFunction = Arc<dyn Function>;

/// How the regions of a subsystem are given.
#[derive(Clone)]
pub enum Regions {
    /// Region `i` is where `signs[i][j] ψ_j(x) > 0` for every `j` with `signs[i][j] ≠ 0` (Definition 6.3);
    /// 0 means that `ψ_j` does not matter. Row-major, `n_modes × n_psi`, entries −1, 0, 1.
    Signs {
        /// Switching functions.
        psi: SharedFunction,
        /// Sign matrix.
        signs: Vec<i8>,
    },
    /// Region `i` is where `g_i(x)` is the smallest indicator (6.4); `n_modes` functions.
    Indicators(SharedFunction),
}

/// Modes that exclude each other, up to convex combination.
#[derive(Clone)]
pub struct Subsystem {
    /// States the modes drive; the mode matrix has one row for each.
    pub rows: Vec<usize>,
    /// Mode vector fields `F`, column-major `rows.len() × n_modes`.
    pub modes: SharedFunction,
    /// Number of modes.
    pub n_modes: usize,
    /// Region of each mode.
    pub regions: Regions,
}

/// Kinds of the variables `α` of an inclusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum SetValued {
    /// Steps of switching functions: `α_j ∈ γ(ψ_j)`.
    #[default]
    Step,
    /// Multipliers of constraints: `0 ≤ α_j ⊥ ψ_j ≥ 0`.
    Multiplier,
}

/// `f(x, α, u, p, t)` with `α_j ∈ γ(ψ_j(x))`, the set-valued step of a switching function (6.38): an inclusion of
/// Aizerman and Pyatnitskii's kind; or with multipliers of constraints `ψ ≥ 0`: a projected system (section 4.3.6).
#[derive(Clone)]
pub struct Inclusion {
    /// States driven, one per output of `f`.
    pub rows: Vec<usize>,
    /// The function; its states are those of the system, then one `α` for every switching function.
    pub f: SharedFunction,
    /// Switching functions, or constraints.
    pub psi: SharedFunction,
    /// Kind of the inclusion, which `psi` belongs to.
    pub set: SetValued,
}

/// Is the Heaviside form of a subsystem the better one? `moves` tells of each switching function whether it depends on the states or
/// the time.
///
/// It is where it is smaller: it has fewer pairs, and its variables (two weights and two multipliers per switching function, and the
/// products of weights) are not more than `θ`, `λ` and `μ`. And it is where some switching functions move and others do not: those are
/// chosen for a whole control stage, so their weights are tied to nothing but themselves there, while in Stewart's form each weight
/// belongs to all surfaces and the choice is tied to the switches of the others.
pub(crate) fn heaviside_is_better(moves: &[bool], n_cells: usize, n_products: usize) -> bool {
    let n_psi = moves.len();
    let smaller = 2 * n_psi < n_cells && 4 * n_psi + n_products <= 2 * n_cells + 1;
    smaller || moves.contains(&true) && moves.contains(&false)
}

/// Of every output of a function: does it depend on the states or the time?
pub(crate) fn moving(psi: &dyn Function) -> Vec<bool> {
    let (d, pattern) = (psi.dims(), psi.jac_pattern());
    let mut moves = vec![false; psi.n_out()];
    for j in (0..d.x).chain([d.t_col()]) {
        pattern.rows(j).iter().for_each(|&i| moves[i] = true);
    }
    moves
}

/// A piecewise smooth system.
#[derive(Clone)]
pub struct System {
    dims: Dims,
    f0: Option<SharedFunction>,
    subsystems: Vec<Subsystem>,
    inclusions: Vec<Inclusion>,
    n_z: usize,
    first_z: usize,
    algebraic: Option<SharedFunction>,
    transitions: Vec<Transition>,
    choices: Vec<Choice>,
    known_times: Vec<(f64, bool)>,
    mechanics: Option<Arc<Mechanics>>,
    combined: Option<SharedFunction>,
    on_demand: Option<Arc<OnDemand>>,
}

impl System {
    /// Times at which functions of the system are not smooth, ascending, and whether the right-hand side jumps there.
    pub fn known_times(&self) -> &[(f64, bool)] {
        &self.known_times
    }

    /// Adds times at which functions of the system are not smooth, as the knots of a table of time are, in any order; `true` where the right-hand
    /// side jumps. Event-driven simulation ends its steps there, and begins anew where something jumps.
    ///
    /// # Errors
    /// [`Error::Range`] for times that are not finite.
    pub fn add_known_times(&mut self, times: &[(f64, bool)]) -> Result<()> {
        if let Some(t) = times.iter().find(|t| !t.0.is_finite()) {
            return Err(Error::Range(format!("a known time is {}: it must be finite", t.0)));
        }
        self.known_times.extend_from_slice(times);
        self.known_times.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.known_times.dedup_by(|b, a| {
            let same = a.0 == b.0;
            a.1 |= same && b.1;
            same
        });
        Ok(())
    }

    /// A system without dynamics: `nx` states, `nu` controls, `np` parameters.
    pub fn new(nx: usize, nu: usize, np: usize) -> Result<System> {
        if nx == 0 {
            return Err(Error::Dimension("a system needs at least one state".into()));
        }
        sizes::check("states, controls or parameters", &[nx, nu, np])?;
        Ok(System {
            dims: Dims { x: nx, u: nu, p: np },
            f0: None,
            subsystems: Vec::new(),
            inclusions: Vec::new(),
            n_z: 0,
            first_z: nx,
            algebraic: None,
            transitions: Vec::new(),
            choices: Vec::new(),
            known_times: Vec::new(),
            mechanics: None,
            combined: None,
            on_demand: None,
        })
    }

    /// Sizes of states, controls and parameters.
    pub fn dims(&self) -> Dims {
        self.dims
    }

    /// Smooth part of the right-hand side, `nx` outputs.
    pub fn f0(&self) -> Option<&SharedFunction> {
        self.f0.as_ref()
    }

    /// The subsystems in the order they were added.
    pub fn subsystems(&self) -> &[Subsystem] {
        &self.subsystems
    }

    /// Sets the part of the right-hand side that does not switch.
    pub fn set_f0(&mut self, f0: SharedFunction) -> Result<()> {
        self.check(f0.as_ref(), self.dims.x)?;
        self.check_modes_known()?;
        self.combined = None;
        self.f0 = Some(f0);
        Ok(())
    }

    /// The inclusions in the order they were added.
    pub fn inclusions(&self) -> &[Inclusion] {
        &self.inclusions
    }

    /// Set-valued steps of all inclusions: their switching functions.
    pub fn n_steps(&self) -> usize {
        self.inclusions.iter().filter(|i| i.set == SetValued::Step).map(|i| i.psi.n_out()).sum()
    }

    /// Number of algebraic states, the last of all but for the discrete ones.
    pub fn n_algebraic(&self) -> usize {
        self.n_z
    }

    /// The algebraic states.
    pub fn algebraic_states(&self) -> std::ops::Range<usize> {
        self.first_z..self.first_z + self.n_z
    }

    /// The algebraic equations that are not part of `f0`.
    pub fn algebraic(&self) -> Option<&SharedFunction> {
        self.algebraic.as_ref()
    }

    /// Makes the last `n_z` states algebraic: what stands in their rows of the right-hand side, and the `n_z` outputs of
    /// `g` where it is given, adds up to zero. Their initial values are guesses where the equations determine them. States that
    /// transitions alone change, and that stand behind all others as those of a model do, are not counted: add the transitions before.
    pub fn set_algebraic(&mut self, n_z: usize, g: Option<SharedFunction>) -> Result<()> {
        if n_z > 0 {
            self.check_modes_known()?;
        }
        let discrete = self.discrete_states();
        // equations that are rows of the right-hand side depend on something, and states that clocks count with do not
        let rests = |i: &usize| g.is_none() && !self.transitions.is_empty() && !self.is_driven(*i);
        let is_discrete = |i: &usize| discrete.binary_search(i).is_ok() || rests(i);
        let behind = (0..self.dims.x).rev().take_while(is_discrete).count();
        if n_z > 0 && n_z + behind >= self.dims.x {
            return Err(Error::Dimension(format!(
                "{n_z} of {} states are algebraic: one at least must have a derivative",
                self.dims.x - behind
            )));
        }
        if let Some(g) = &g {
            self.check(g.as_ref(), n_z)?;
        }
        (self.n_z, self.first_z) = (n_z, self.dims.x - behind - n_z);
        self.algebraic = g;
        self.combined = None;
        Ok(())
    }

    /// Does a derivative of this state, or an equation in its place, depend on anything?
    fn is_driven(&self, i: usize) -> bool {
        let by_modes = self.subsystems.iter().map(|s| &s.rows).chain(self.inclusions.iter().map(|i| &i.rows));
        let flows = self.f0.iter().chain(self.mechanics.as_ref().map(|m| &m.smooth));
        let by_f0 = flows.into_iter().any(|f| f.jac_pattern().row_idx().contains(&i));
        by_f0 || by_modes.into_iter().any(|rows| rows.contains(&i))
    }

    /// The whole right-hand side as one function, see [`System::set_combined`].
    pub fn combined(&self) -> Option<&SharedFunction> {
        self.combined.as_ref()
    }

    /// The right-hand side `f0 + Σ_k Σ_i θ_i^k f_i^k` once more, as one function of the states and the weights `θ` of all modes,
    /// those of the first subsystem first, wherever the weights of each subsystem sum to one. Smooth part and modes that have a costly
    /// part in common, as the inertia of a mechanism that is factored, are evaluated and differentiated together then. It is forgotten
    /// where dynamics are added or changed.
    ///
    /// # Errors
    /// [`Error::Dimension`] where its sizes are others; [`Error::State`] with inclusions or algebraic states.
    pub fn set_combined(&mut self, f: SharedFunction) -> Result<()> {
        if self.n_z > 0 || !self.inclusions.is_empty() {
            return Err(Error::State(
                "with inclusions or algebraic states there is no combined right-hand side".into(),
            ));
        }
        let n_weights: usize = self.subsystems.iter().map(|s| s.n_modes).sum();
        let expected = Dims { x: self.dims.x + n_weights, ..self.dims };
        if f.dims() != expected || f.n_out() != self.dims.x {
            return Err(Error::Dimension(format!(
                "the combined right-hand side '{}' takes {:?} and has {} outputs, expected {expected:?} and {}: the states, \
                 then a weight for every mode",
                f.name(),
                f.dims(),
                f.n_out(),
                self.dims.x
            )));
        }
        self.combined = Some(f);
        Ok(())
    }

    /// Adds an inclusion and returns its index.
    pub fn add_inclusion(&mut self, i: Inclusion) -> Result<usize> {
        let k = self.inclusions.len();
        self.check_modes_known()?;
        self.check_rows(&format!("inclusion {k}"), &i.rows)?;
        self.check(i.psi.as_ref(), i.psi.n_out())?;
        let (given, own) = (i.f.dims(), self.dims);
        let expected = Dims { x: own.x + i.psi.n_out(), ..own };
        if given != expected {
            return Err(Error::Dimension(format!(
                "function '{}' takes (x, u, p) of sizes ({}, {}, {}), expected ({}, {}, {}): the states, then one \
                 step for each of the {} switching functions",
                i.f.name(),
                given.x,
                given.u,
                given.p,
                expected.x,
                expected.u,
                expected.p,
                i.psi.n_out()
            )));
        }
        if i.f.n_out() != i.rows.len() {
            return Err(Error::Dimension(format!(
                "function '{}' has {} outputs, expected {}",
                i.f.name(),
                i.f.n_out(),
                i.rows.len()
            )));
        }
        self.combined = None;
        self.inclusions.push(i);
        Ok(k)
    }

    fn check_rows(&self, what: &str, rows: &[usize]) -> Result<()> {
        if rows.is_empty() {
            return Err(Error::Dimension(format!("{what} drives no state: list the states its modes drive")));
        }
        for (i, &r) in rows.iter().enumerate() {
            if r >= self.dims.x {
                return Err(Error::Range(format!("{what} drives state {r}, but there are {}", self.dims.x)));
            }
            if rows[..i].contains(&r) {
                return Err(Error::Range(format!("{what} lists state {r} twice")));
            }
        }
        Ok(())
    }

    /// Adds a subsystem and checks everything that can be checked without evaluating it. Returns its index.
    pub fn add_subsystem(&mut self, s: Subsystem) -> Result<usize> {
        let k = self.subsystems.len();
        self.check_modes_known()?;
        if s.n_modes == 0 {
            return Err(Error::Dimension(format!("subsystem {k} has no modes")));
        }
        self.check_rows(&format!("subsystem {k}"), &s.rows)?;
        self.check(s.modes.as_ref(), s.rows.len() * s.n_modes)?;
        match &s.regions {
            Regions::Indicators(g) => self.check(g.as_ref(), s.n_modes)?,
            Regions::Signs { psi, signs } => {
                self.check(psi.as_ref(), psi.n_out())?;
                check_signs(k, s.n_modes, psi.n_out(), signs)?;
            }
        }
        self.combined = None;
        self.subsystems.push(s);
        Ok(k)
    }

    /// Checks that there is something to integrate.
    pub fn validate(&self) -> Result<()> {
        self.check_alone()?;
        self.validate_for_events()
    }

    /// The same for event-driven simulation, which follows algebraic states and inclusions beside contacts.
    pub fn validate_for_events(&self) -> Result<()> {
        if self.mechanics.is_some() {
            self.check_no_flow_beside()?;
            return self.check_discrete();
        }
        let driven = self.f0.is_some() || !self.subsystems.is_empty() || !self.inclusions.is_empty();
        if !driven && self.on_demand.is_none() {
            return Err(Error::State("the system has no dynamics: set f0 or add a subsystem".into()));
        }
        self.check_discrete()
    }

    /// Is it without algebraic states and inclusions: are rates known where the modes are?
    pub(crate) fn is_of_modes_alone(&self) -> bool {
        self.n_z == 0 && self.inclusions.is_empty()
    }

    /// Subsystems with more than one mode.
    pub fn n_switching(&self) -> usize {
        self.subsystems.iter().filter(|s| s.n_modes > 1).count()
    }

    /// Modes of the subsystems that can switch, those of contacts behind them: open, closed, sliding either way; and of the steps of inclusions
    /// behind those: 1, where their function is positive, and 0.
    pub fn mode_counts(&self) -> Vec<usize> {
        let system = self.with_switches();
        let contacts = system.mechanics().map_or(0, |m| m.contacts.len());
        let contacts = std::iter::repeat_n(4, contacts);
        let steps = std::iter::repeat_n(2, system.n_steps());
        system.subsystems.iter().map(|s| s.n_modes).filter(|&n| n > 1).chain(contacts).chain(steps).collect()
    }

    /// True where functions of the system must be called by one thread only ([`Function::is_serial`]).
    pub fn is_serial(&self) -> bool {
        self.mechanics.as_ref().is_some_and(|m| m.any_function(&|f| f.is_serial()))
            || self.on_demand.as_ref().is_some_and(|d| d.rhs.is_serial() || d.psi.is_serial())
            || self.any_function(&|f| f.is_serial())
    }

    /// Does its motion depend on the time itself, so that one that begins later is another one?
    pub(crate) fn depends_on_time(&self) -> bool {
        let sees = |f: &dyn Function| !f.jac_pattern().rows(f.dims().t_col()).is_empty();
        let on_demand = |f: &Arc<dyn Signed>| !f.jac_pattern().rows(f.dims().t_col()).is_empty();
        !self.known_times.is_empty()
            || self.on_demand.as_ref().is_some_and(|d| [&d.rhs, &d.psi].into_iter().any(on_demand))
            || self.any_function_or_force(&sees)
    }

    /// Is something true of one of the functions, those of modes on demand left out?
    pub(crate) fn any_function_or_force(&self, is: &dyn Fn(&dyn Function) -> bool) -> bool {
        self.mechanics.as_ref().is_some_and(|m| m.any_function(is)) || self.any_function(is)
    }

    /// Is something true of one of the functions, those of mechanics and of modes on demand left out?
    pub(crate) fn any_function(&self, is: &dyn Fn(&dyn Function) -> bool) -> bool {
        let is = |f: &SharedFunction| is(f.as_ref());
        let subsystem = |s: &Subsystem| {
            let (Regions::Signs { psi: regions, .. } | Regions::Indicators(regions)) = &s.regions;
            is(&s.modes) || is(regions)
        };
        let transition = |t: &Transition| is(&t.guard) || t.reset.as_ref().is_some_and(|r| is(&r.f));
        self.transitions.iter().any(transition)
            || self.f0.iter().chain(&self.algebraic).any(is)
            || self.subsystems.iter().any(subsystem)
            || self.inclusions.iter().any(|i| is(&i.f) || is(&i.psi))
    }

    fn check(&self, f: &dyn Function, n_out: usize) -> Result<()> {
        let d = f.dims();
        if d != self.dims {
            return Err(Error::Dimension(format!(
                "function '{}' takes (x, u, p) of sizes ({}, {}, {}), the system has ({}, {}, {})",
                f.name(),
                d.x,
                d.u,
                d.p,
                self.dims.x,
                self.dims.u,
                self.dims.p
            )));
        }
        if f.n_out() != n_out {
            return Err(Error::Dimension(format!(
                "function '{}' has {} outputs, expected {n_out}",
                f.name(),
                f.n_out()
            )));
        }
        Ok(())
    }
}

fn check_signs(k: usize, n_modes: usize, n_psi: usize, signs: &[i8]) -> Result<()> {
    if signs.len() != n_modes * n_psi {
        return Err(Error::Dimension(format!(
            "sign matrix of subsystem {k} has {} entries, expected {n_modes} modes x {n_psi} switching functions",
            signs.len()
        )));
    }
    if let Some(i) = signs.iter().position(|s| !(-1..=1).contains(s)) {
        return Err(Error::Range(format!(
            "sign matrix of subsystem {k} has the entry {} in row {}, column {}: only -1, 0 and 1 have a meaning",
            signs[i],
            i / n_psi,
            i % n_psi
        )));
    }
    // positive and negative signs of a row, 64 to a word
    let words = n_psi.div_ceil(64);
    let mut marks = vec![[0u64; 2]; n_modes * words];
    for i in 0..n_modes {
        let row = &signs[i * n_psi..(i + 1) * n_psi];
        if n_modes > 1 && row.iter().all(|&s| s == 0) {
            return Err(Error::Range(format!(
                "row {i} of the sign matrix of subsystem {k} is zero: the mode would be valid everywhere"
            )));
        }
        for (j, s) in row.iter().enumerate().filter(|s| *s.1 != 0) {
            marks[i * words + j / 64][usize::from(*s < 0)] |= 1 << (j % 64);
        }
        let marked = |i: usize| &marks[i * words..(i + 1) * words];
        for j in 0..i {
            let apart = marked(i).iter().zip(marked(j)).any(|(a, b)| a[0] & b[1] | a[1] & b[0] != 0);
            if !apart {
                return Err(Error::Range(format!(
                    "rows {j} and {i} of the sign matrix of subsystem {k} overlap: \
                     some switching function must have opposite signs in them"
                )));
            }
        }
    }
    Ok(())
}
