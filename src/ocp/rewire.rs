//! A system as part of one with more states, controls or parameters.

use super::terms::{Places, Stack};
use crate::error::Result;
use crate::func::Dims;
use crate::system::{combination, with_zeros};
use crate::system::{
    Contact, Inclusion, Inertia, Kind, Local, Mechanics, Regions, Reset, SharedFunction, Subsystem, System, Transition,
};

/// Where the inputs of functions of sizes `from` are among inputs of sizes `to`.
pub(super) struct Rewire {
    from: Dims,
    to: Dims,
    /// Of every input `(x, u, p, t)`.
    columns: Vec<usize>,
    /// First row of the states.
    first: usize,
}

impl Rewire {
    /// Controls and parameters are added behind the others.
    pub fn widen(from: Dims, to: Dims) -> Rewire {
        Rewire { from, to, columns: Places::leading(to).columns(from, to), first: 0 }
    }

    /// States are added in front of the others; some controls become states: `(control, state)`.
    pub fn behind(from: Dims, to: Dims, controls: &[(usize, usize)]) -> Rewire {
        let first = to.x - from.x;
        let mut columns = Places { x: first, u: to.x, p: to.x + to.u }.columns(from, to);
        for &(control, state) in controls {
            columns[from.x + control] = state;
        }
        Rewire { from, to, columns, first }
    }

    fn is_plain(&self) -> bool {
        self.from == self.to && self.columns.iter().enumerate().all(|(i, c)| i == *c)
    }

    /// A function of the old inputs as one of the new.
    pub fn function(&self, f: &SharedFunction) -> SharedFunction {
        if self.is_plain() {
            return f.clone();
        }
        Stack::gather(f, self.to, self.columns.clone())
    }

    /// The same of a function with `n` more states behind those of the system: the steps of an inclusion, the weights of modes.
    fn with_steps(&self, f: &SharedFunction, n: usize) -> SharedFunction {
        if self.is_plain() {
            return f.clone();
        }
        let (x, rest) = self.columns.split_at(self.from.x);
        let steps = self.to.x..self.to.x + n;
        let rest = rest.iter().map(|&c| if c < self.to.x { c } else { c + n });
        let columns = x.iter().copied().chain(steps).chain(rest).collect();
        Stack::gather(f, Dims { x: self.to.x + n, ..self.to }, columns)
    }

    /// The same of a function with more parameters behind those of the system: weights of switches, accelerations, forces.
    fn with_params(&self, f: &SharedFunction) -> SharedFunction {
        if self.is_plain() {
            return f.clone();
        }
        let more = f.dims().p - self.from.p;
        let to = Dims { p: self.to.p + more, ..self.to };
        let own = &self.columns[..self.from.t_col()];
        let behind = self.to.t_col()..self.to.t_col() + more;
        Stack::gather(f, to, own.iter().copied().chain(behind).chain([to.t_col()]).collect())
    }

    /// A contact, with the coordinates that are added in front of its own.
    fn contact(&self, c: &Contact, n_v: usize) -> Contact {
        let motion = self.with_params(&c.motion);
        let motion = match c.kind {
            // the gradient of its switching function has a place for every state
            Kind::Switch if self.first > 0 => with_zeros(&motion, &[Contact::motion_len(n_v, 1) + n_v], self.first),
            _ => motion,
        };
        // what it touches has controls of its own
        let has_ramps = self.columns[self.from.x..].iter().any(|c| *c < self.to.x);
        let local = c.local.as_ref().filter(|_| !has_ramps).map(|l| self.local(l));
        Contact { gap: self.function(&c.gap), motion, reaction: self.with_params(&c.reaction), local, ..c.clone() }
    }

    fn local(&self, l: &Local) -> Local {
        let x = l.coordinates.len() + l.velocities.len() + l.others.len();
        let (from, to) = (Dims { x, ..self.from }, Dims { x, ..self.to });
        let widened = Rewire::widen(from, to);
        Local {
            coordinates: l.coordinates.iter().map(|i| i + self.first).collect(),
            // it has other coordinates here, and is of use with very many contacts alone
            separation: None,
            gap: widened.function(&l.gap),
            rows: widened.function(&l.rows),
            ..l.clone()
        }
    }

    /// Equations of motion with contacts: what is added in front of the states are coordinates, with these rates.
    fn mechanics(&self, m: &Mechanics, front: Option<SharedFunction>) -> Mechanics {
        let own = self.with_params(&m.smooth);
        let smooth = match front {
            Some(f) => {
                let d = own.dims();
                let columns = Places::leading(self.to).columns(self.to, d);
                Stack::of("smooth", d, vec![(f, columns), (own, (0..d.n_in()).collect())])
            }
            None => own,
        };
        let inertia = match &m.inertia {
            Inertia::Varying { matrix, product } => {
                Inertia::Varying { matrix: self.function(matrix), product: self.with_params(product) }
            }
            other => other.clone(),
        };
        let free = if m.bounds.is_empty() { 0 } else { self.first };
        Mechanics {
            n_q: self.first + m.n_q,
            smooth,
            inertia,
            contacts: m.contacts.iter().map(|c| self.contact(c, m.n_v)).collect(),
            bounds: vec![None; free].into_iter().chain(m.bounds.iter().copied()).collect(),
            projection: None,
            ..m.clone()
        }
    }

    /// The system with the new inputs behind states with these rates, in front of its own.
    pub fn behind_rates(&self, s: &System, rates: SharedFunction) -> Result<System> {
        if let Some(m) = s.mechanics() {
            let mut out = System::of_mechanics(self.mechanics(m, Some(rates)), self.to.u, self.to.p)?;
            self.add_rest(s, &mut out)?;
            return Ok(out);
        }
        let all = || (0..self.to.n_in()).collect::<Vec<usize>>();
        let own = match s.f0() {
            Some(f) => self.function(f),
            None => combination("0", self.to, vec![Vec::new(); self.from.x]),
        };
        self.system_with(s, Some(Stack::of("f0", self.to, vec![(rates, all()), (own, all())])))
    }

    /// What every kind of system may have.
    fn add_rest(&self, s: &System, out: &mut System) -> Result<()> {
        for i in s.inclusions() {
            let (f, psi) = (self.with_steps(&i.f, i.psi.n_out()), self.function(&i.psi));
            out.add_inclusion(Inclusion { rows: self.rows(&i.rows), f, psi, set: i.set })?;
        }
        for t in s.transitions() {
            out.add_transition(self.transition(t))?;
        }
        out.add_known_times(s.known_times())?;
        // states that transitions alone change stand behind the algebraic ones
        if s.n_algebraic() > 0 {
            out.set_algebraic(s.n_algebraic(), s.algebraic().map(|g| self.function(g)))?;
        }
        Ok(())
    }

    fn rows(&self, rows: &[usize]) -> Vec<usize> {
        rows.iter().map(|r| r + self.first).collect()
    }

    /// The system with the new inputs and another smooth part, which knows them.
    fn system_with(&self, s: &System, f0: Option<SharedFunction>) -> Result<System> {
        let mut out = System::new(self.to.x, self.to.u, self.to.p)?;
        if let Some(f0) = f0 {
            out.set_f0(f0)?;
        }
        for sub in s.subsystems() {
            let regions = match &sub.regions {
                Regions::Signs { psi, signs } => Regions::Signs { psi: self.function(psi), signs: signs.clone() },
                Regions::Indicators(g) => Regions::Indicators(self.function(g)),
            };
            let (modes, n_modes) = (self.function(&sub.modes), sub.n_modes);
            out.add_subsystem(Subsystem { rows: self.rows(&sub.rows), modes, n_modes, regions })?;
        }
        self.add_rest(s, &mut out)?;
        Ok(out)
    }

    /// A transition of the old system as one of the new: the states in front stay as they are.
    fn transition(&self, t: &Transition) -> Transition {
        let values = |list: &[(usize, f64)]| list.iter().map(|&(i, v)| (i + self.first, v)).collect();
        let reset =
            t.reset.as_ref().map(|r| Reset { rows: self.rows(&r.rows), f: self.function(&r.f), switches: r.switches });
        let guard = self.function(&t.guard);
        Transition {
            guard,
            clauses: t.clauses.clone(),
            direction: t.direction,
            from: values(&t.from),
            reset,
            to: values(&t.to),
            rule: t.rule.clone(),
        }
    }

    /// The system with the new inputs.
    pub fn system(&self, s: &System) -> Result<System> {
        if self.is_plain() {
            return Ok(s.clone());
        }
        if let Some(m) = s.mechanics() {
            let mut out = System::of_mechanics(self.mechanics(m, None), self.to.u, self.to.p)?;
            self.add_rest(s, &mut out)?;
            return Ok(out);
        }
        let mut out = self.system_with(s, s.f0().map(|f| self.function(f)))?;
        if let (Some(f), 0) = (s.combined(), self.first) {
            out.set_combined(self.with_steps(f, f.dims().x - self.from.x))?;
        }
        Ok(out)
    }
}
