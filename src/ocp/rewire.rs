//! A system as part of one with more states, controls or parameters.

use super::terms::{Places, Stack};
use crate::error::Result;
use crate::func::Dims;
use crate::system::{Inclusion, Regions, Reset, SharedFunction, Subsystem, System, Transition};

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

    /// The system with the new inputs and another smooth part, which knows them.
    pub fn system_with(&self, s: &System, f0: Option<SharedFunction>) -> Result<System> {
        let mut out = System::new(self.to.x, self.to.u, self.to.p)?;
        if let Some(f0) = f0 {
            out.set_f0(f0)?;
        }
        let rows = |rows: &[usize]| rows.iter().map(|r| r + self.first).collect();
        for sub in s.subsystems() {
            let regions = match &sub.regions {
                Regions::Signs { psi, signs } => Regions::Signs { psi: self.function(psi), signs: signs.clone() },
                Regions::Indicators(g) => Regions::Indicators(self.function(g)),
            };
            let (modes, n_modes) = (self.function(&sub.modes), sub.n_modes);
            out.add_subsystem(Subsystem { rows: rows(&sub.rows), modes, n_modes, regions })?;
        }
        for i in s.inclusions() {
            let (f, psi) = (self.with_steps(&i.f, i.psi.n_out()), self.function(&i.psi));
            out.add_inclusion(Inclusion { rows: rows(&i.rows), f, psi, set: i.set })?;
        }
        if s.n_algebraic() > 0 {
            out.set_algebraic(s.n_algebraic(), s.algebraic().map(|g| self.function(g)))?;
        }
        for t in s.transitions() {
            out.add_transition(self.transition(t))?;
        }
        Ok(out)
    }

    /// A transition of the old system as one of the new: the states in front stay as they are.
    fn transition(&self, t: &Transition) -> Transition {
        let values = |list: &[(usize, f64)]| list.iter().map(|&(i, v)| (i + self.first, v)).collect();
        let reset = t.reset.as_ref().map(|r| Reset {
            rows: r.rows.iter().map(|i| i + self.first).collect(),
            f: self.function(&r.f),
            switches: r.switches,
        });
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
        let mut out = self.system_with(s, s.f0().map(|f| self.function(f)))?;
        if let (Some(f), 0) = (s.combined(), self.first) {
            out.set_combined(self.with_steps(f, f.dims().x - self.from.x))?;
        }
        Ok(out)
    }
}
