//! Several starting points at once. Every start is a solve of its own, so the results do not depend on the number of threads.

use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::nlp::{Control, Outcome};

impl Ocp {
    /// Solves from several guesses of the controls, `[n_stages · nu]` each, on `threads` threads, and keeps the best
    /// solution: the lowest cost among the exact ones, and among equals the first. Returns which one that is, and what
    /// every start found. Functions of the model are called from all threads.
    pub fn solve_starts(&mut self, controls: &[Vec<f64>], threads: usize) -> Result<(usize, Vec<OcpResult>)> {
        if controls.is_empty() {
            return Err(Error::Dimension("no starting point is given".into()));
        }
        let mut problems = Vec::with_capacity(controls.len());
        for u in controls {
            let mut p = self.blank();
            p.set_u_guess(u)?;
            problems.push(Some(p));
        }
        let n = threads.clamp(1, problems.len());
        let mut shares: Vec<Vec<(usize, Ocp)>> = (0..n).map(|_| Vec::new()).collect();
        for (k, p) in problems.iter_mut().enumerate() {
            shares[k % n].extend(p.take().map(|p| (k, p)));
        }
        let work = |share: Vec<(usize, Ocp)>| -> Vec<(usize, Ocp, Result<()>)> {
            let one = |(k, mut p): (usize, Ocp)| {
                let r = p.solve(&mut Control::default()).map(|_| ());
                (k, p, r)
            };
            share.into_iter().map(one).collect()
        };
        let solved: Vec<_> = std::thread::scope(|scope| {
            let handles: Vec<_> = shares.into_iter().map(|s| scope.spawn(move || work(s))).collect();
            handles.into_iter().flat_map(|h| h.join().unwrap_or_default()).collect()
        });
        for (k, p, r) in solved {
            r?;
            problems[k] = Some(p);
        }
        let result = |p: &Option<Ocp>| p.as_ref().and_then(|p| p.result.clone());
        let results: Option<Vec<OcpResult>> = problems.iter().map(result).collect();
        let results = results.ok_or_else(|| Error::Internal("a thread of the starts panicked".into()))?;
        let value =
            |r: &OcpResult| if r.outcome == Outcome::Solved && !r.cost.is_nan() { r.cost } else { f64::INFINITY };
        let order = |a: &usize, b: &usize| value(&results[*a]).total_cmp(&value(&results[*b])).then(a.cmp(b));
        let best = (0..results.len()).min_by(order).unwrap_or(0);
        if let Some(p) = problems[best].take() {
            let own = self.u_guess.take();
            *self = p;
            self.u_guess = own;
        }
        Ok((best, results))
    }

    /// The problem as stated, nothing built and nothing solved.
    pub fn blank(&self) -> Ocp {
        Ocp {
            system: self.system.clone(),
            settings: self.settings,
            horizon: self.horizon,
            n_stages: self.n_stages,
            t0: self.t0,
            durations: self.durations.clone(),
            time: self.time,
            time_bounds: self.time_bounds,
            n_fe: self.n_fe.clone(),
            linear: self.linear.clone(),
            lagrange: self.lagrange.clone(),
            mayer: self.mayer.clone(),
            squares: self.squares.clone(),
            path: self.path.clone(),
            terminal: self.terminal.clone(),
            boundary: self.boundary.clone(),
            soft: self.soft.clone(),
            complementarity: self.complementarity.clone(),
            x_bounds: self.x_bounds.clone(),
            x0_bounds: self.x0_bounds.clone(),
            u_bounds: self.u_bounds.clone(),
            p_bounds: self.p_bounds.clone(),
            params: self.params.clone(),
            stage_params: self.stage_params.clone(),
            x_guess: self.x_guess.clone(),
            u_guess: self.u_guess.clone(),
            modes: self.modes.clone(),
            built: None,
            engine: None,
            result: None,
        }
    }
}
