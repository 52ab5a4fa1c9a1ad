//! What is discretised: a scene with costs and constraints on a grid of control stages.

use super::answer::Answer;
use super::functions::SceneFunctions;
use super::reach;
use super::scales;
use crate::error::{Error, Result};
use crate::fesd::{Boundary, Durations, PathConstraint, Terminal};
use crate::func::{Dims, Point};
use crate::nlp::middles;
use crate::system::{SharedFunction, System};
use crate::tableau::{Family, Tableau};

/// A scene with costs and constraints. Functions of costs and constraints have the sizes `wide`: controls and parameters of the scene come first, what
/// stands behind them belongs to costs and constraints alone.
#[derive(Clone)]
pub struct Statement {
    /// The scene.
    pub system: System,
    /// Sizes of the scene.
    pub dims: Dims,
    /// Sizes of costs and constraints.
    pub wide: Dims,
    /// The method, one that ends an element with a stage.
    pub tableau: Tableau,
    /// Elements of every control stage in which no contact changes.
    pub n_fe: Vec<usize>,
    /// Lengths of the control stages; to start from where they are variables.
    pub durations: Vec<f64>,
    /// Which lengths are variables.
    pub time: Durations,
    /// Bounds of the horizon or of a stage, where these are variables.
    pub time_bounds: [f64; 2],
    /// Initial time.
    pub t0: f64,
    /// Cost rate.
    pub lagrange: Option<SharedFunction>,
    /// Terminal cost.
    pub mayer: Option<SharedFunction>,
    /// Cost at the end of every stage.
    pub grid_cost: Option<SharedFunction>,
    /// Constraints along the horizon.
    pub path: Vec<PathConstraint>,
    /// Constraints at its end.
    pub terminal: Vec<Terminal>,
    /// Constraints between both ends.
    pub boundary: Vec<Boundary>,
    /// Bounds of the states behind the initial time, `[nx]` each.
    pub x_bounds: [Vec<f64>; 2],
    /// Bounds of the initial state.
    pub x0_bounds: [Vec<f64>; 2],
    /// Bounds of the controls, those behind the scene's included.
    pub u_bounds: [Vec<f64>; 2],
    /// Parameters of every stage `[n_stages · wide.p]`.
    pub params: Vec<f64>,
    /// Bounds of the parameters that are variables, of all `wide.p`.
    pub free: Vec<Option<[f64; 2]>>,
    /// A state at which the conditions at the end hold, where there is one: it says how large states are, and where they are to go.
    pub target: Option<Vec<f64>>,
}

#[cfg(test)]
impl Statement {
    /// A scene over control stages of these lengths, with one element each, without costs, constraints, bounds and parameters.
    pub(super) fn bare(system: System, dims: Dims, durations: Vec<f64>) -> Statement {
        let free = |n: usize| [vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]];
        Statement {
            system,
            dims,
            wide: dims,
            tableau: Tableau::new(Family::RadauIia, 2).unwrap(),
            n_fe: vec![1; durations.len()],
            durations,
            time: Durations::Fixed,
            time_bounds: [0.0, f64::INFINITY],
            t0: 0.0,
            lagrange: None,
            mayer: None,
            grid_cost: None,
            path: Vec::new(),
            terminal: Vec::new(),
            boundary: Vec::new(),
            x_bounds: free(dims.x),
            x0_bounds: free(dims.x),
            u_bounds: free(dims.u),
            params: Vec::new(),
            free: Vec::new(),
            target: None,
        }
    }
}

/// Stage points of an element on grids that are refined, at most, and how many more each of them has.
const MOST_POINTS: usize = 5;
const MORE_POINTS: usize = 2;

/// Share of their sizes by which constraints contradict each other by next to nothing: a body that is to stop at a height of 0.3, and lies on a step that is so
/// high but for the tail of a function that rounds its edge, is there.
pub(super) const CONTRADICTION: f64 = 1e-8;

/// A statement with the functions that programs are made of.
#[derive(Clone)]
pub struct Problem {
    pub(super) given: Statement,
    pub(super) functions: SceneFunctions,
    pub(super) knows_time: bool,
    /// How far forces take the states in the horizon.
    pub(super) reach: Vec<f64>,
    /// Do the constraints leave room for contradictions of next to nothing?
    pub(super) has_room: bool,
}

impl Problem {
    /// Builds the functions of the scene.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for methods without a stage at the end of an element, for friction in space, and for scenes
    /// that are not made of expressions.
    pub fn new(given: Statement) -> Result<Problem> {
        let t = &given.tableau;
        if !t.stiffly_accurate() || !t.is_collocation() || t.c[0] == 0.0 {
            return Err(Error::Unsupported(
                "optimal control of scenes takes Radau IIA methods: contacts are held at the ends of elements, where \
                 other methods have no stage"
                    .into(),
            ));
        }
        let mechanics = given.system.mechanics();
        let mechanics = mechanics.ok_or_else(|| Error::Internal("a scene without equations of motion".into()))?;
        let functions = SceneFunctions::new(mechanics, given.dims)?;
        let g = &given;
        let outer = g.lagrange.iter().chain(&g.mayer).chain(&g.grid_cost).chain(g.path.iter().map(|c| &c.f));
        let mut outer = outer.chain(g.terminal.iter().map(|c| &c.f)).chain(g.boundary.iter().map(|c| &c.f));
        let knows_time = functions.knows_time || outer.any(|f| !f.jac_pattern().rows(f.dims().t_col()).is_empty());
        let reach = reach::of_forces(&given, &functions);
        Ok(Problem { given, functions, knows_time, reach, has_room: false })
    }

    /// The same with implicit Euler, the method of one stage point.
    pub(super) fn with_one_stage_point(&self) -> Result<Problem> {
        let given = Statement { tableau: Tableau::new(Family::RadauIia, 1)?, ..self.given.clone() };
        Ok(Problem { given, ..self.clone() })
    }

    /// The same on a finer grid: with more stage points up to [`MOST_POINTS`], then with so many times the elements of every control stage.
    pub(super) fn finer(&self, times: impl Fn(usize) -> usize) -> Result<Problem> {
        let mut given = self.given.clone();
        if given.tableau.n_s < MOST_POINTS {
            given.tableau = Tableau::new(Family::RadauIia, (given.tableau.n_s + MORE_POINTS).min(MOST_POINTS))?;
        } else {
            given.n_fe.iter_mut().enumerate().for_each(|(k, n)| *n *= times(k));
        }
        Ok(Problem { given, ..self.clone() })
    }

    /// The same with other lengths and values of parameters, by their number among all, to start from.
    pub fn restated_at(&self, durations: Vec<f64>, params: &[(usize, f64)]) -> Problem {
        let mut given = Statement { durations, ..self.given.clone() };
        for &(j, value) in params {
            given.params.iter_mut().skip(j).step_by(given.wide.p).for_each(|p| *p = value);
        }
        Problem { given, ..self.clone() }
    }

    /// The same with conditions along the way and at its end, and bounds of states behind the start, that leave room for contradictions of next to nothing: each by
    /// that share of the size of its value at the start.
    pub(super) fn with_room(&self) -> Problem {
        let mut given = self.given.clone();
        let x0 = middles(&given.x0_bounds);
        let sizes = scales::of_states(self, &x0);
        let zeros = vec![0.0; given.wide.u];
        let ends = [&x0[..], &x0].concat();
        let room = |f: &SharedFunction, x: &[f64]| -> Vec<f64> {
            let at = Point { t: given.t0, x, u: &zeros, p: &given.params[..given.wide.p] };
            scales::of_values(f, &at, &sizes).into_iter().map(|size| CONTRADICTION * size).collect()
        };
        let widen = |lower: &mut [f64], upper: &mut [f64], room: &[f64]| {
            lower.iter_mut().zip(upper).zip(room).for_each(|((l, u), r)| (*l, *u) = (*l - r, *u + r));
        };
        let (mut path, mut terminal, mut boundary) =
            (given.path.clone(), given.terminal.clone(), given.boundary.clone());
        path.iter_mut().for_each(|c| widen(&mut c.lower, &mut c.upper, &room(&c.f, &x0)));
        terminal.iter_mut().for_each(|c| widen(&mut c.lower, &mut c.upper, &room(&c.f, &x0)));
        boundary.iter_mut().for_each(|c| widen(&mut c.lower, &mut c.upper, &room(&c.f, &ends)));
        let [mut lower, mut upper] = given.x_bounds.clone();
        widen(&mut lower, &mut upper, &sizes.iter().map(|s| CONTRADICTION * s).collect::<Vec<f64>>());
        (given.path, given.terminal, given.boundary, given.x_bounds) = (path, terminal, boundary, [lower, upper]);
        Problem { given, has_room: true, ..self.clone() }
    }

    /// The problem that an answer to this one is a solution of: itself, or the one with room for contradictions of next to nothing.
    pub fn of(&self, answer: &Answer) -> Problem {
        if answer.has_room && !self.has_room {
            self.with_room()
        } else {
            self.clone()
        }
    }

    /// What was stated.
    pub fn given(&self) -> &Statement {
        &self.given
    }

    /// Control stages.
    pub fn n_stages(&self) -> usize {
        self.given.durations.len()
    }

    /// Contacts of the scene.
    pub fn n_contacts(&self) -> usize {
        self.functions.contacts.len()
    }

    /// Names of the contacts.
    pub fn contact_names(&self) -> Vec<String> {
        self.functions.contacts.iter().map(|c| c.name.clone()).collect()
    }

    /// Has a contact friction?
    pub fn has_friction(&self, contact: usize) -> bool {
        self.functions.contacts[contact].n_tangents > 0
    }

    /// Coefficients of restitution of all contacts at an initial state; zero where they have no value.
    pub(super) fn restitutions(&self, x0: &[f64]) -> Vec<f64> {
        let g = &self.given;
        let u = vec![0.0; g.dims.u];
        let at = Point { t: g.t0, x: x0, u: &u, p: &g.params[..g.dims.p] };
        let of = |f: &SharedFunction| {
            let mut e = [0.0];
            f.value(&at, &mut e, &mut vec![0.0; f.work_len()]).map_or(0.0, |()| e[0])
        };
        self.functions.contacts.iter().map(|c| of(&c.restitution)).collect()
    }

    /// Sizes of the gaps of all contacts at a point, an initial state: what states of their sizes make of them.
    pub fn sizes_of_gaps(&self, at: &Point) -> Vec<f64> {
        let sizes = scales::of_states(self, at.x);
        self.functions.contacts.iter().map(|c| scales::of_value(&c.gap, at, &sizes)).collect()
    }

    /// The largest size of a state, with an initial state.
    pub fn largest_size(&self, x0: &[f64]) -> f64 {
        scales::of_states(self, x0).into_iter().fold(0.0, f64::max)
    }

    /// Gaps of all contacts at a point, with their names; NaN where a gap has no value.
    pub fn gaps(&self, at: &Point) -> Vec<(&str, f64)> {
        let of = |c: &'_ super::functions::ContactFunctions| {
            let mut gap = [f64::NAN];
            match c.gap.value(at, &mut gap, &mut vec![0.0; c.gap.work_len()]) {
                Ok(()) => gap[0],
                Err(_) => f64::NAN,
            }
        };
        self.functions.contacts.iter().map(|c| (&c.name[..], of(c))).collect()
    }
}
