//! What the numbers of the discretisation stand for: rows, variables and function values by stage, element and stage
//! point. All are counted from zero.

use super::inside::Inside;
use super::layout::{ElementIndex, PathAt};
use super::problem::{Call, Fesd};
use crate::func::EvalError;
use crate::system::SharedFunction;

/// Where on the horizon something is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Control stage.
    pub stage: usize,
    /// Element of that stage; none for what belongs to the stage.
    pub element: Option<usize>,
    /// Point of the Runge-Kutta method; none for the end of the element.
    pub point: Option<usize>,
}

/// What a row says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum RowMeaning {
    /// Right-hand side of a state, its integration, or its algebraic equation.
    Dynamics(Place, usize),
    /// Equations of weights and multipliers.
    Complementarity(Place),
    /// Lengths of elements and stages.
    Grid(Place),
    /// Output of a path constraint.
    Path(Place, usize, usize),
    /// Output of a terminal constraint.
    Terminal(usize, usize),
    /// Output of a constraint between both ends.
    Boundary(usize, usize),
    /// Output of a path complementarity: those of one side, then those of the other.
    Pair(Place, usize, usize),
}

/// What a variable is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum VariableMeaning {
    /// Initial value of a state.
    Initial(usize),
    /// A state, or its derivative.
    State(Place, usize),
    /// A control, or its slope.
    Control(usize, usize),
    /// A parameter.
    Param(usize),
    /// Length of a stage, of an element, of the horizon.
    Length(Option<Place>),
    /// Weight or multiplier of a cell.
    Complementarity(Place),
    /// Member of a path complementarity: those of one side, then those of the other.
    Pair(Place, usize, usize),
}

/// Which function of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The smooth part.
    Smooth,
    /// The modes of a subsystem.
    Modes,
    /// An inclusion.
    Inclusion,
    /// What regions are told by.
    Regions,
    /// Cost rate.
    Running,
    /// Cost at the end, or at the ends of stages.
    Ending,
    /// A path constraint.
    Path(usize),
    /// A terminal constraint.
    Terminal(usize),
    /// A constraint between both ends.
    Boundary(usize),
    /// A path complementarity.
    Pair(usize),
}

/// What of a function was wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Its value.
    Value,
    /// Its Jacobian.
    Jacobian,
    /// Its second derivatives.
    Hessian,
}

/// A function without a value.
#[derive(Clone)]
pub struct Trouble {
    /// The function.
    pub f: SharedFunction,
    /// What it is in the model.
    pub role: Role,
    /// Where.
    pub place: Place,
    /// What was wanted.
    pub part: Part,
    /// What it answered.
    pub error: EvalError,
    /// Its inputs: states, controls, parameters, time.
    pub inputs: Vec<f64>,
    /// Time, from the start of the horizon where the function is not told it.
    pub t: f64,
    /// Evaluations of all functions since.
    pub age: usize,
}

/// The last failure, written down while the solver is at work.
#[derive(Debug, Clone, Default)]
pub(super) struct Note {
    pub call: Option<Call>,
    pub part: Option<(Part, EvalError)>,
    pub inputs: Vec<f64>,
    pub t: f64,
    pub age: usize,
}

impl Fesd {
    /// Forgets failures of functions.
    pub fn forget_trouble(&mut self) {
        self.cache.note.call = None;
    }

    /// The last failure of a function since [`Fesd::forget_trouble`].
    pub fn trouble(&self) -> Option<Trouble> {
        let note = &self.cache.note;
        let (call, (part, error)) = (note.call?, note.part?);
        let (role, place) = self.owner(&call)?;
        let f = self.functions[call.f].clone();
        let inputs = note.inputs[..f.dims().n_in()].to_vec();
        Some(Trouble { f, role, place, part, error, inputs, t: note.t, age: note.age })
    }

    /// Time from the start of the horizon, or of the model's clock, at which a call is made.
    pub(super) fn time_of(&self, call: &Call, w: &[f64]) -> f64 {
        self.owner(call).map_or(f64::NAN, |(_, place)| self.time_at(place, w))
    }

    /// Time from the start of the horizon.
    pub(super) fn time_at(&self, place: Place, w: &[f64]) -> f64 {
        let lengths = self.stage_lengths(w);
        let start: f64 = lengths[..place.stage].iter().sum();
        let Some(element) = place.element else { return start };
        let elements = self.l.stage(place.stage);
        let before: f64 = elements[..element].iter().map(|e| self.h_of(e, w)).sum();
        let share = place.point.map_or(1.0, |i| self.tableau.c[i]);
        start + before + share * self.h_of(&elements[element], w)
    }

    /// Time from a point inside of an element to the end of that.
    pub(super) fn time_left(&self, inside: &Inside, w: &[f64]) -> f64 {
        (1.0 - inside.share) * self.h_of(&self.l.elements[inside.element], w)
    }

    /// What a call is for, and where.
    fn owner(&self, call: &Call) -> Option<(Role, Place)> {
        let is = |c: &Call| (c.f, c.val, c.jac, c.hess) == (call.f, call.val, call.jac, call.hess);
        let any = |calls: &[Call]| calls.iter().any(is);
        let first = Place { stage: 0, element: None, point: None };
        if let Some(at) = self.ind_start.iter().position(|calls| any(calls)) {
            let stage = self.l.elements[self.l.starts[at].element].stage;
            return Some((Role::Regions, Place { stage, ..first }));
        }
        if any(&self.drift_start) {
            return Some((Role::Smooth, first));
        }
        for (e, ec) in self.l.elements.iter().zip(&self.ecalls) {
            let here = |point| Place { stage: e.stage, element: Some(e.n), point };
            for i in 0..self.tableau.n_s {
                let groups = [
                    (Role::Smooth, &ec.drift[i][..]),
                    (Role::Modes, &ec.modes[i][..]),
                    (Role::Inclusion, &ec.included[i][..]),
                    (Role::Regions, &ec.ind[i][..]),
                    (Role::Running, ec.lagrange.get(i..=i).unwrap_or(&[])),
                ];
                if let Some((role, _)) = groups.iter().find(|g| any(g.1)) {
                    return Some((*role, here(Some(i))));
                }
            }
            if any(&ec.ind_end) {
                return Some((Role::Regions, here(None)));
            }
        }
        if let Some(k) = self.path.iter().position(is) {
            return self.path_points().nth(k).map(|(constraint, place)| (Role::Path(constraint), place));
        }
        if let Some(k) = self.complementarity.iter().position(is) {
            return self.pair_points().nth(k).map(|(pairs, place)| (Role::Pair(pairs), place));
        }
        let last = self.end_of_stage(self.spec.n_stages() - 1);
        let at_end = |calls: &[Call]| calls.iter().position(is);
        if let Some(k) = at_end(&self.terminal) {
            return Some((Role::Terminal(k), last));
        }
        if let Some(k) = at_end(&self.boundary) {
            return Some((Role::Boundary(k), last));
        }
        let k = at_end(&self.mayer)?;
        let n_ends = usize::from(self.spec.mayer.is_some());
        Some((Role::Ending, if k < n_ends { last } else { self.end_of_stage(k - n_ends) }))
    }

    fn end_of_stage(&self, stage: usize) -> Place {
        Place { stage, element: Some(self.spec.n_fe[stage] - 1), point: None }
    }

    /// The points of all path complementarities in the order of their calls: which one, and where.
    fn pair_points(&self) -> impl Iterator<Item = (usize, Place)> + '_ {
        let n_s = self.tableau.n_s;
        self.spec.complementarity.iter().enumerate().flat_map(move |(k, p)| {
            (0..self.spec.n_stages()).flat_map(move |stage| {
                let n_fe = self.spec.n_fe[stage];
                let place = |element, point| Place { stage, element: Some(element), point };
                let points: Vec<Place> = match p.at {
                    PathAt::ControlGrid => vec![self.end_of_stage(stage)],
                    PathAt::Elements => (0..n_fe).map(|n| place(n, None)).collect(),
                    PathAt::StagePoints => (0..n_fe * n_s).map(|i| place(i / n_s, Some(i % n_s))).collect(),
                };
                points.into_iter().map(move |place| (k, place))
            })
        })
    }

    /// The points of all path constraints in the order of their calls: which constraint, and where.
    pub(super) fn path_points(&self) -> impl Iterator<Item = (usize, Place)> + '_ {
        let n_s = self.tableau.n_s;
        let regular = self.spec.path.iter().enumerate().flat_map(move |(k, p)| {
            (0..self.spec.n_stages()).flat_map(move |stage| {
                let n_fe = self.spec.n_fe[stage];
                let mut points = vec![Place { stage, element: Some(0), point: None }];
                points[0].element = None;
                match p.at {
                    PathAt::ControlGrid => points.push(self.end_of_stage(stage)),
                    PathAt::Elements => {
                        points.extend((0..n_fe).map(|n| Place { stage, element: Some(n), point: None }))
                    }
                    PathAt::StagePoints => points.extend((0..n_fe * n_s).map(|i| Place {
                        stage,
                        element: Some(i / n_s),
                        point: Some(i % n_s),
                    })),
                }
                points.into_iter().map(move |place| (k, place))
            })
        });
        regular.chain(self.spec.inside.iter().map(|i| (i.path, self.place_inside(i.element))))
    }

    /// The place of a point inside of an element.
    fn place_inside(&self, element: usize) -> Place {
        let e = &self.l.elements[element];
        Place { stage: e.stage, element: Some(e.n), point: None }
    }

    /// What every row says `[m]`.
    pub fn row_meanings(&self) -> Vec<RowMeaning> {
        let l = &self.l;
        let start = Place { stage: 0, element: None, point: None };
        // what is not named below couples the weights and multipliers of the start
        let mut out = vec![RowMeaning::Complementarity(start); l.m];
        let mut set = |from: usize, n: usize, what: &dyn Fn(usize) -> RowMeaning| {
            (0..n).for_each(|r| out[from + r] = what(r));
        };
        for s in &l.starts {
            let at = Place { stage: l.elements[s.element].stage, ..start };
            set(s.row, s.rows.len(), &|_| RowMeaning::Complementarity(at));
        }
        if let Some(row) = l.row_z0 {
            set(row, l.z.len(), &|r| RowMeaning::Dynamics(start, l.z.start + r));
        }
        let form = self.spec.dcs.form();
        for e in &l.elements {
            let here = |point| Place { stage: e.stage, element: Some(e.n), point };
            for i in 0..self.tableau.n_s {
                let at = here(Some(i));
                set(e.row_dyn[i], l.nx, &|r| RowMeaning::Dynamics(at, r));
                if let Some(&row) = e.row_conv.get(i) {
                    set(row, l.nx, &|r| RowMeaning::Dynamics(at, r));
                }
                for (row, n) in [(&e.row_alg, form.rows.len()), (&e.row_norm, form.simplices.len())] {
                    set(row[i], n, &|_| RowMeaning::Complementarity(at));
                }
                set(e.row_prod[i], form.products.len(), &|_| RowMeaning::Complementarity(at));
            }
            let end = here(None);
            if let Some(row) = e.row_end {
                set(row, l.nx, &|r| RowMeaning::Dynamics(end, r));
            }
            if e.lambda_end.is_some() {
                set(e.row_end_alg, form.rows.len(), &|_| RowMeaning::Complementarity(end));
            }
            for row in [e.row_sum_theta, e.row_sum_lambda, e.row_slope].into_iter().flatten() {
                set(row, l.n_cells, &|_| RowMeaning::Complementarity(end));
            }
            let grid = |_| RowMeaning::Grid(end);
            [e.row_equal, e.row_tied, e.row_eta].into_iter().flatten().for_each(|row| set(row, 1, &grid));
            if let Some(row) = e.row_range {
                set(row, 2, &grid);
            }
        }
        for (stage, &row) in l.row_time.iter().enumerate() {
            set(row, 1, &|_| RowMeaning::Grid(Place { stage, element: None, point: None }));
        }
        for ((k, at), &row) in self.path_points().zip(&self.path_rows) {
            set(row, self.spec.path[k].f.n_out(), &|r| RowMeaning::Path(at, k, r));
        }
        for (k, (t, &row)) in self.spec.terminal.iter().zip(&l.row_terminal).enumerate() {
            set(row, t.f.n_out(), &|r| RowMeaning::Terminal(k, r));
        }
        for (k, (t, &row)) in self.spec.boundary.iter().zip(&l.row_boundary).enumerate() {
            set(row, t.f.n_out(), &|r| RowMeaning::Boundary(k, r));
        }
        for ((k, at), &row) in self.pair_points().zip(&l.row_members) {
            set(row, self.spec.complementarity[k].f.n_out(), &|r| RowMeaning::Pair(at, k, r));
        }
        out
    }

    /// What every variable is `[n]`.
    pub fn variable_meanings(&self) -> Vec<VariableMeaning> {
        let l = &self.l;
        let mut out = vec![VariableMeaning::Length(None); l.n];
        let mut set = |from: usize, n: usize, what: &dyn Fn(usize) -> VariableMeaning| {
            (0..n).for_each(|r| out[from + r] = what(r));
        };
        for (j, v) in l.params.iter().enumerate() {
            if let Some(v) = *v {
                set(v, 1, &|_| VariableMeaning::Param(j));
            }
        }
        let start = Place { stage: 0, element: None, point: None };
        set(l.x0, l.nx, &VariableMeaning::Initial);
        for s in &l.starts {
            let at = Place { stage: l.elements[s.element].stage, ..start };
            set(s.lambda, l.n_cells, &|_| VariableMeaning::Complementarity(at));
            set(s.mu, l.n_mu, &|_| VariableMeaning::Complementarity(at));
        }
        for (stage, (&u, time)) in l.u.iter().zip(&l.time).enumerate() {
            set(u, l.nu, &|j| VariableMeaning::Control(stage, j));
            if let (Some(v), true) = (*time, self.spec.durations == super::Durations::Stages) {
                let place = Place { stage, element: None, point: None };
                set(v, 1, &|_| VariableMeaning::Length(Some(place)));
            }
        }
        for e in &l.elements {
            self.element_meanings(e, &mut set);
        }
        for ((k, at), &v) in self.pair_points().zip(&l.members) {
            set(v, self.spec.complementarity[k].f.n_out(), &|r| VariableMeaning::Pair(at, k, r));
        }
        out
    }

    fn element_meanings(
        &self,
        e: &ElementIndex,
        set: &mut impl FnMut(usize, usize, &dyn Fn(usize) -> VariableMeaning),
    ) {
        let l = &self.l;
        let here = |point| Place { stage: e.stage, element: Some(e.n), point };
        let end = here(None);
        if let Some(h) = e.h {
            set(h, 1, &|_| VariableMeaning::Length(Some(end)));
        }
        for i in 0..self.tableau.n_s {
            let at = here(Some(i));
            for x in e.v.get(i).into_iter().chain([&e.x[i]]) {
                set(*x, l.nx, &|r| VariableMeaning::State(at, r));
            }
            for (from, n) in [(e.theta[i], l.n_weights), (e.lambda[i], l.n_cells), (e.mu[i], l.n_mu)] {
                set(from, n, &|_| VariableMeaning::Complementarity(at));
            }
        }
        if e.row_end.is_some() {
            set(e.x_end, l.nx, &|r| VariableMeaning::State(end, r));
        }
        if let Some(lambda) = e.lambda_end {
            set(lambda, l.n_cells, &|_| VariableMeaning::Complementarity(end));
            set(e.mu_end, l.n_mu, &|_| VariableMeaning::Complementarity(end));
        }
        if e.row_sum_lambda.is_some() {
            set(e.sum_lambda, l.n_cells, &|_| VariableMeaning::Complementarity(end));
        }
        if e.row_sum_theta.is_some() {
            set(e.sum_theta, l.n_cells, &|_| VariableMeaning::Complementarity(end));
        }
    }
}
