//! Solutions in the terms of the model: elements, switches, dense output.

use super::problem::Fesd;
use crate::dcs::Dcs;
use crate::error::{Error, Result};
use crate::memory;
use crate::mpcc::Side;
use crate::tableau::Tableau;

/// One finite element of a solution.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Element {
    /// Start.
    pub t: f64,
    /// Length.
    pub h: f64,
    /// Control stage.
    pub stage: usize,
    /// State at the start, the user's states only `[nx]`.
    pub x0: Vec<f64>,
    /// State at the end `[nx]`.
    pub x1: Vec<f64>,
    /// States at the stage points `[n_s · nx]`.
    pub xs: Vec<f64>,
    /// `h` times the derivatives at the stage points `[n_s · nx]`.
    pub hk: Vec<f64>,
    /// `θ` per mode at the stage points `[n_s · n_modes]`, all subsystems one after the other.
    pub theta: Vec<f64>,
    /// `λ` per cell at the stage points `[n_s · n_cells]`.
    pub lambda: Vec<f64>,
    /// `μ` per subsystem at the stage points `[n_s · n_sub]`.
    pub mu: Vec<f64>,
    /// Is the mode part of the active set? `[n_modes]`.
    pub active: Vec<bool>,
    /// The same for the cells the modes consist of `[n_cells]`.
    pub active_cells: Vec<bool>,
}

impl Element {
    /// One in control stage `stage`, from a time on and so long, with states at its start `[nx]` and at the stage points `[n_s · nx]`, and without modes.
    pub(crate) fn of_states(
        tableau: &Tableau,
        stage: usize,
        (t, h): (f64, f64),
        x0: Vec<f64>,
        xs: Vec<f64>,
    ) -> Element {
        let (nx, n_s) = (x0.len(), tableau.n_s);
        let a_inv = tableau.a_inv.as_deref().unwrap_or(&[]);
        let slope = |k: usize| -> f64 {
            let (i, r) = (k / nx, k % nx);
            (0..n_s).map(|j| a_inv[i * n_s + j] * (xs[j * nx + r] - x0[r])).sum()
        };
        let hk = (0..n_s * nx).map(slope).collect();
        let x1 = xs[(n_s - 1) * nx..].to_vec();
        Element { t, h, stage, x0, x1, xs, hk, ..Element::default() }
    }
}

/// What happens at a switch, by the active sets before and after.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum SwitchKind {
    /// Modes leave the active set and others enter it.
    Cross = 0,
    /// Modes enter: a sliding mode begins, or gets another mode.
    Enter = 1,
    /// Modes leave: a sliding mode ends, or loses a mode.
    Leave = 2,
}

impl SwitchKind {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            SwitchKind::Cross => "cross",
            SwitchKind::Enter => "enter",
            SwitchKind::Leave => "leave",
        }
    }
}

/// A change of the active set of one subsystem.
#[derive(Debug, Clone, PartialEq)]
pub struct Switch {
    /// Time.
    pub t: f64,
    /// Index of the element that begins here.
    pub element: usize,
    /// Subsystem.
    pub subsystem: usize,
    /// Kind.
    pub kind: SwitchKind,
    /// Modes active before.
    pub before: Vec<usize>,
    /// Modes active after.
    pub after: Vec<usize>,
}

/// A piecewise polynomial solution.
#[derive(Debug, Clone)]
pub struct Trajectory {
    tableau: Tableau,
    nx: usize,
    n_z: usize,
    /// Number of modes per subsystem; subsystems with one mode are part of the smooth dynamics and not listed. Switching
    /// functions of inclusions follow, with the two modes `ψ > 0` and `ψ < 0`, and constraints of projected systems with one, whose weight
    /// is the multiplier.
    pub modes: Vec<usize>,
    /// The elements in the order of time.
    pub elements: Vec<Element>,
    /// The switches in the order of time.
    pub switches: Vec<Switch>,
}

impl Trajectory {
    /// An empty one for a model.
    pub fn new(dcs: &Dcs, tableau: &Tableau) -> Trajectory {
        Trajectory {
            tableau: tableau.clone(),
            nx: dcs.dims().x,
            n_z: dcs.n_algebraic(),
            modes: dcs.form().reported.iter().map(Vec::len).collect(),
            elements: Vec::new(),
            switches: Vec::new(),
        }
    }

    /// Elements that were found elsewhere, without modes; the start of one need not be the end of the last.
    pub(crate) fn of_elements(tableau: &Tableau, nx: usize, elements: Vec<Element>) -> Trajectory {
        Trajectory { tableau: tableau.clone(), nx, n_z: 0, modes: Vec::new(), elements, switches: Vec::new() }
    }

    /// Times of the element boundaries, one more than elements.
    pub fn times(&self) -> Vec<f64> {
        let mut t: Vec<f64> = self.elements.iter().map(|e| e.t).collect();
        if let Some(e) = self.elements.last() {
            t.push(e.t + e.h);
        }
        t
    }

    /// The Runge-Kutta method behind the dense output.
    pub fn tableau(&self) -> &Tableau {
        &self.tableau
    }

    /// Number of states.
    pub fn nx(&self) -> usize {
        self.nx
    }

    /// State at `t` by the dense output of the method, written into `x[nx]`. Fails outside the trajectory.
    pub fn state(&self, t: f64, x: &mut [f64]) -> Result<()> {
        let (Some(first), Some(last)) = (self.elements.first(), self.elements.last()) else {
            return Err(Error::State("the trajectory is empty: solve first".into()));
        };
        let (t0, t1) = (first.t, last.t + last.h);
        let slack = 1e-12 * (1.0 + t1.abs().max(t0.abs()));
        if !(t >= t0 - slack && t <= t1 + slack) {
            return Err(Error::Range(format!("time {t} is outside the trajectory [{t0}, {t1}]")));
        }
        if x.len() != self.nx {
            return Err(Error::Dimension(format!("room for {} states given, the model has {}", x.len(), self.nx)));
        }
        let k = self.elements.partition_point(|e| e.t + e.h < t).min(self.elements.len() - 1);
        let e = &self.elements[k];
        let theta = if e.h > 0.0 { ((t - e.t) / e.h).clamp(0.0, 1.0) } else { 0.0 };
        let n_s = self.tableau.n_s;
        let mut w = [0.0; Tableau::MAX_STAGES];
        self.tableau.dense_weights(theta, &mut w[..n_s]);
        for r in 0..self.nx - self.n_z {
            x[r] = e.x0[r] + (0..n_s).map(|j| w[j] * e.hk[j * self.nx + r]).sum::<f64>();
        }
        if self.n_z > 0 {
            self.tableau.interpolation_weights(theta, &mut w[..n_s]);
            for r in self.nx - self.n_z..self.nx {
                x[r] = (0..n_s).map(|j| w[j] * e.xs[j * self.nx + r]).sum::<f64>();
            }
        }
        Ok(())
    }

    /// Appends the solution `w` of a discretised problem that starts at `t0`, with active sets `sides` where the
    /// problem was polished and the larger of `λ` and `θ` otherwise.
    pub fn append(&mut self, p: &Fesd, w: &[f64], sides: Option<&[Side]>, t0: f64) {
        let l = p.layout();
        let form = p.spec().dcs.form();
        let n_s = self.tableau.n_s;
        let lengths = p.stage_lengths(w);
        let equal = lengths.iter().all(|h| *h == lengths[0]);
        let before = |k: usize| if equal { k as f64 * lengths[0] } else { lengths[..k].iter().sum() };
        let n_modes: usize = self.modes.iter().sum();
        let mut t = t0;
        for (i_e, ei) in l.elements.iter().enumerate() {
            let h = p.h_of(ei, w);
            if ei.n == 0 {
                // the control grid is exact whatever the sums of steps round to
                t = t0 + before(ei.stage);
            }
            let take = |at: usize| w[at..at + self.nx].to_vec();
            let mut e = Element {
                t,
                h,
                stage: ei.stage,
                x0: take(ei.x_start),
                x1: take(ei.x_end),
                xs: ei.x.iter().flat_map(|&x| take(x)).collect(),
                hk: Vec::new(),
                theta: vec![0.0; n_s * n_modes],
                lambda: ei.lambda.iter().flat_map(|&j| w[j..j + l.n_cells].to_vec()).collect(),
                mu: ei.mu.iter().flat_map(|&j| w[j..j + l.n_mu].to_vec()).collect(),
                active: vec![false; n_modes],
                active_cells: vec![false; l.n_cells],
            };
            e.hk = if l.values_form {
                let a_inv = self.tableau.a_inv.as_deref().unwrap_or(&[]);
                (0..n_s * self.nx)
                    .map(|k| {
                        let (i, r) = (k / self.nx, k % self.nx);
                        (0..n_s).map(|j| a_inv[i * n_s + j] * (e.xs[j * self.nx + r] - e.x0[r])).sum()
                    })
                    .collect()
            } else {
                ei.v.iter().flat_map(|&v| w[v..v + self.nx].iter().map(move |d| h * d)).collect()
            };
            for cell in 0..l.n_cells {
                let sum = |at: &[usize]| at.iter().map(|&j| w[j + cell]).sum::<f64>();
                e.active_cells[cell] = match sides {
                    Some(s) if l.fesd => s[i_e * l.n_cells + cell] == Side::First,
                    _ => sum(&ei.theta) > sum(&ei.lambda),
                };
            }
            for (mode, weights) in form.reported.iter().flatten().enumerate() {
                for &c in weights {
                    for (i, &theta) in ei.theta.iter().enumerate() {
                        e.theta[i * n_modes + mode] += w[theta + c];
                    }
                    e.active[mode] |= form.is_active(c, &e.active_cells);
                }
            }
            t += h;
            self.push(e);
        }
    }

    /// Appends one element and logs what switches at its start.
    fn push(&mut self, e: Element) {
        if let Some(last) = self.elements.last() {
            let mut mode0 = 0;
            for (k, &n) in self.modes.iter().enumerate() {
                let set = |e: &Element| (0..n).filter(|&m| e.active[mode0 + m]).collect::<Vec<_>>();
                let (before, after) = (set(last), set(&e));
                if before != after {
                    let enters = after.iter().any(|m| !before.contains(m));
                    let leaves = before.iter().any(|m| !after.contains(m));
                    let kind = match (enters, leaves) {
                        (true, true) => SwitchKind::Cross,
                        (true, false) => SwitchKind::Enter,
                        _ => SwitchKind::Leave,
                    };
                    let element = self.elements.len();
                    self.switches.push(Switch { t: e.t, element, subsystem: k, kind, before, after });
                }
                mode0 += n;
            }
        }
        memory::room(&mut self.elements, 1);
        self.elements.push(e);
    }
}
