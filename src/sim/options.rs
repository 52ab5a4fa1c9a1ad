//! What one solve of one discretised problem takes from the settings.

use crate::dcs::FormOptions;
use crate::error::Result;
use crate::fesd::Options;
use crate::mpcc::MpccSettings;
use crate::settings::{InitialGuess, Settings, StageForm};
use crate::tableau::Family;

/// Options of one solve of one discretised problem, of a control problem or of a simulation step.
///
/// Adaptation of the grid, the search of neighbouring mode sequences, and the comparison of an answer with a simulation are
/// made of such solves, so they are not in here: a solve inside another one takes these options and cannot begin them
/// again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolveOptions {
    /// How the system is brought into a complementarity form.
    pub form: FormOptions,
    /// Method, switch detection, step equilibration.
    pub discretisation: Options,
    /// Finite elements of a control stage or a simulation step.
    pub n_fe: usize,
    /// Relaxation path, interior-point method, polish.
    pub solver: MpccSettings,
    /// Origin of a cold start where no guess is given.
    pub initial_guess: InitialGuess,
    /// Seconds.
    pub max_time: f64,
}

impl SolveOptions {
    /// Reads the options out of the settings, which are checked.
    pub fn from_settings(s: &Settings) -> Result<SolveOptions> {
        Ok(SolveOptions {
            form: FormOptions::from_settings(s)?,
            discretisation: Options::from_settings(s)?,
            n_fe: s.n_fe as usize,
            solver: MpccSettings::from(s),
            initial_guess: s.initial_guess()?,
            max_time: s.max_time,
        })
    }

    /// These options with Radau IIA of as many stages.
    pub fn with_radau_iia(self) -> SolveOptions {
        let discretisation = Options { family: Family::RadauIia, stage_form: StageForm::Auto, ..self.discretisation };
        SolveOptions { discretisation, ..self }
    }

    /// True where what was built with these options can be solved with `other`: structure, order of elimination and backend are
    /// the same.
    pub fn fits(&self, other: &SolveOptions) -> bool {
        let structure = |o: &SolveOptions| {
            let s = &o.solver;
            let soft = Options { rho_h: 1.0, ..o.discretisation };
            (o.form, soft, s.linear_solver, s.ordering, s.relaxation)
        };
        structure(self) == structure(other)
    }
}
