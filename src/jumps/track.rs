//! Piecewise polynomial motions with jumps: what programs start from, and what they find.

use crate::tableau::Tableau;

use super::modes::{ContactMode, Phase, Sequence};

/// Share of a piece by which its end and a time may differ and be the same.
const ROUNDING: f64 = 1e-9;

/// A part of a motion between two jumps or changes of modes: values at its start and at the nodes of the method.
#[derive(Debug, Clone, Default)]
pub(super) struct Piece {
    pub(super) t: f64,
    pub(super) h: f64,
    /// Control stage.
    pub(super) stage: usize,
    pub(super) modes: Vec<ContactMode>,
    /// Contacts that take part in the impact at the start.
    pub(super) jump: Option<Vec<ContactMode>>,
    /// State behind the start `[nx]`.
    pub(super) x0: Vec<f64>,
    /// States at the nodes `[n_s · nx]`.
    pub(super) xs: Vec<f64>,
    /// Normal and tangential force of every contact at the nodes `[n_s · n_c · 2]`.
    pub(super) forces: Vec<f64>,
    /// Normal and tangential impulse of every contact at the start `[n_c · 2]`; empty without a jump.
    pub(super) impulses: Vec<f64>,
}

/// A motion.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub(super) tableau: Tableau,
    pub(super) nx: usize,
    pub(super) pieces: Vec<Piece>,
    /// Controls `[n_stages · nu]`.
    pub(super) controls: Vec<f64>,
    /// Parameters of the whole horizon that are variables, in their order; empty where nothing is known.
    pub(super) free: Vec<f64>,
}

impl Track {
    /// The piece a time falls into; at an end of a piece the one before it, or, `behind` it, the next. Times that come from lengths added up
    /// in another order are the same up to rounding.
    pub(super) fn piece(&self, t: f64, behind: bool) -> Option<&Piece> {
        let n = self.pieces.len();
        let k = self.pieces.partition_point(|p| {
            let (end, rounding) = (p.t + p.h, ROUNDING * p.h);
            if behind {
                end <= t + rounding
            } else {
                end < t - rounding
            }
        });
        self.pieces.get(k.min(n.wrapping_sub(1)))
    }

    /// State at a time, before or behind a jump there.
    pub(super) fn state(&self, t: f64, behind: bool, out: &mut [f64]) {
        let Some(p) = self.piece(t, behind) else { return };
        let theta = if p.h > 0.0 { ((t - p.t) / p.h).clamp(0.0, 1.0) } else { 0.0 };
        let mut w = [0.0; Tableau::MAX_STAGES];
        let n_s = self.tableau.n_s;
        if self.tableau.state_weights(theta, &mut w[..n_s]).is_err() {
            return;
        }
        let first = 1.0 - w[..n_s].iter().sum::<f64>();
        for (i, o) in out.iter_mut().enumerate() {
            *o = first * p.x0[i] + (0..n_s).map(|j| w[j] * p.xs[j * self.nx + i]).sum::<f64>();
        }
    }

    /// Normal and tangential force of a contact at a time.
    pub(super) fn force(&self, t: f64, contact: usize) -> [f64; 2] {
        let Some(p) = self.piece(t, false) else { return [0.0; 2] };
        let theta = if p.h > 0.0 { ((t - p.t) / p.h).clamp(0.0, 1.0) } else { 0.0 };
        let n_s = self.tableau.n_s;
        let n_c = p.modes.len();
        let mut w = [0.0; Tableau::MAX_STAGES];
        self.tableau.interpolation_weights(theta, &mut w[..n_s]);
        [0, 1].map(|k| (0..n_s).map(|j| w[j] * p.forces[(j * n_c + contact) * 2 + k]).sum())
    }

    /// Its mode sequence on `n_stages` control stages, with chains of bounces that end where the bounces are too short to count.
    pub(super) fn sequence(&self, n_stages: usize) -> Sequence {
        let mut stages: Vec<Vec<Phase>> = vec![Vec::new(); n_stages];
        for p in &self.pieces {
            let length = self.pieces.iter().filter(|q| q.stage == p.stage).map(|q| q.h).sum::<f64>();
            let share = if length > 0.0 { p.h / length } else { 1.0 };
            stages[p.stage].push(Phase { modes: p.modes.clone(), jump: p.jump.clone(), share });
        }
        let n_c = self.pieces.first().map_or(0, |p| p.modes.len());
        for k in 0..n_stages {
            if stages[k].is_empty() {
                let before = k.checked_sub(1).and_then(|k| stages[k].last()).map(|p| p.modes.clone());
                let modes = before.unwrap_or_else(|| vec![ContactMode::Open; n_c]);
                stages[k].push(Phase { modes, jump: None, share: 1.0 });
            }
        }
        let mut s = Sequence { stages };
        s.end_chains();
        s.tidy();
        s
    }
}

/// Linear interpolation of states at rising times.
pub(super) fn interpolate(times: &[f64], x: &[f64], t: f64, nx: usize) -> Vec<f64> {
    let k = times.partition_point(|s| *s <= t);
    if k == 0 || k == times.len() {
        let k = k.saturating_sub(1);
        return x[k * nx..(k + 1) * nx].to_vec();
    }
    let w = (t - times[k - 1]) / (times[k] - times[k - 1]);
    (0..nx).map(|i| (1.0 - w) * x[(k - 1) * nx + i] + w * x[k * nx + i]).collect()
}
