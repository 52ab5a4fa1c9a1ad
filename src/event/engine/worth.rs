//! Which costs less: to follow events unit by unit, or to end steps of all states at them.
//!
//! Work is counted in velocities of single states, so that the choice is the same on every machine. What a switch costs, with the steps between, is
//! measured in the way that is in use. Of the other one it is known from the last time. Before it was in use at all, steps that end at switches
//! are taken to cost one that is thrown away, and one that ends there.

/// Switches that the work for one is the mean of.
const WINDOW: usize = 16;
/// So many of these pass until the other way is tried again, the first time; each further time twice as many, so that trials cost ever less.
const WAIT: usize = 8;

/// A way to go on at switches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// Single units are integrated anew within a step.
    Units,
    /// Every switch ends the step of all states.
    Steps,
}

/// Counts the work of both ways, and chooses.
#[derive(Debug, Clone)]
pub(super) struct Worth {
    way: Way,
    /// Work and switches where the window began.
    start: (usize, usize),
    /// Work for a switch, where it is known.
    units: f64,
    steps: Option<f64>,
    /// Windows until the other way is tried, and how many there are from one trial to the next.
    left: usize,
    wait: usize,
}

impl Default for Worth {
    fn default() -> Worth {
        Worth { way: Way::Units, start: (0, 0), units: 0.0, steps: None, left: WAIT, wait: WAIT }
    }
}

impl Worth {
    /// The way that costs less, as far as is known.
    pub(super) fn way(&self) -> Way {
        self.way
    }

    /// A step has ended, with so much work and so many switches since the start of the run. A step of all states takes the work `step`.
    pub(super) fn note(&mut self, work: usize, switches: usize, step: usize) {
        let n = switches.saturating_sub(self.start.1);
        if n < WINDOW {
            return;
        }
        let each = work.saturating_sub(self.start.0) as f64 / n as f64;
        self.start = (work, switches);
        let (other, rival, least) = match self.way {
            Way::Units => {
                self.units = each;
                // no switch costs less than the step that ends at it
                (Way::Steps, self.steps.unwrap_or(2.0 * step as f64), step as f64)
            }
            Way::Steps => {
                self.steps = Some(each);
                (Way::Units, self.units, 0.0)
            }
        };
        let worse = each > rival;
        self.left = self.left.saturating_sub(1);
        if !worse && (self.left > 0 || each <= least) {
            return;
        }
        if !worse {
            self.wait *= 2;
        }
        (self.way, self.left) = (other, self.wait);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Work for a switch of both ways, which may change in time.
    fn run(n: usize, step: usize, work: impl Fn(usize) -> (usize, usize)) -> (Vec<Way>, usize) {
        let (mut w, mut spent, mut ways) = (Worth::default(), 0, Vec::new());
        for k in 0..n {
            let (units, steps) = work(k);
            spent += if w.way() == Way::Units { units } else { steps };
            w.note(spent, k + 1, step);
            ways.push(w.way());
        }
        (ways, spent)
    }

    #[test]
    fn units_that_cost_less_than_a_step_are_never_left() {
        assert!(run(10_000, 600, |_| (500, 1)).0.iter().all(|w| *w == Way::Units));
    }

    /// Whatever is cheaper, trials of the other way cost little in the long run.
    #[test]
    fn the_cheaper_way_is_found_and_kept() {
        for (units, steps) in [(300, 200), (150, 200), (1000, 200), (110, 1000)] {
            let (ways, spent) = run(20_000, 100, |_| (units, steps));
            let best = units.min(steps);
            let cheap = if units < steps { Way::Units } else { Way::Steps };
            assert_eq!(ways[19_999], cheap, "{units} {steps}");
            assert!((spent as f64) < 1.06 * (20_000 * best) as f64, "{units} {steps}: {spent}");
        }
    }

    /// What changes on the way is noticed by a trial, or by the way itself.
    #[test]
    fn a_change_is_noticed() {
        let (ways, _) = run(8000, 100, |k| if k < 1000 { (400, 300) } else { (150, 300) });
        assert_eq!((ways[900], ways[7999]), (Way::Steps, Way::Units));
        let (ways, _) = run(8000, 100, |k| if k < 1000 { (150, 300) } else { (900, 300) });
        assert_eq!((ways[900], ways[1100]), (Way::Units, Way::Steps));
    }
}
