//! What a model consists of and costs.

use std::fmt;

use crate::system::heaviside_is_better;

/// Weight of a remark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoteKind {
    /// Something was left out, and why.
    Dropped,
    /// Things that are equal became one.
    Merged,
    /// Worth knowing.
    Info,
    /// The model is probably not what was meant.
    Warning,
}

impl NoteKind {
    /// Name in texts.
    pub fn name(self) -> &'static str {
        match self {
            NoteKind::Dropped => "dropped",
            NoteKind::Merged => "merged",
            NoteKind::Info => "note",
            NoteKind::Warning => "warning",
        }
    }
}

/// A remark.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Weight.
    pub kind: NoteKind,
    /// The text.
    pub text: String,
}

/// One subsystem.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// States whose derivatives switch.
    pub states: Vec<String>,
    /// Switching functions.
    pub switching_functions: Vec<String>,
    /// True for each switching function that depends on the states or the time.
    pub moves: Vec<bool>,
    /// Rows of the sign matrix.
    pub n_regions: usize,
    /// Different vector fields.
    pub n_modes: usize,
    /// Cells of full sign patterns.
    pub n_cells: usize,
    /// Sign matrix, by rows, `n_regions × switching_functions`.
    pub signs: Vec<i8>,
}

/// Sizes of a complementarity form at one point (Table 6.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counts {
    /// Multipliers `θ`.
    pub modes: usize,
    /// Algebraic variables without `θ` for Stewart's form, with `θ` for the Heaviside form, as in Table 6.4.
    pub algebraic: usize,
    /// Complementarity pairs.
    pub pairs: usize,
    /// Equations.
    pub equations: usize,
}

impl Group {
    /// Stewart's form (6.8): `2 n + 1` algebraic variables, `n` pairs, `n + 1` equations for `n` cells.
    pub fn stewart(&self) -> Counts {
        let n = self.n_cells;
        Counts { modes: n, algebraic: 2 * n + 1, pairs: n, equations: n + 1 }
    }

    /// Heaviside form (6.44) with products of at most two factors (Algorithm 1).
    pub fn heaviside(&self) -> Counts {
        let (n_f, n_psi) = (self.n_regions, self.switching_functions.len());
        let n_beta = n_lifted(&self.signs, n_psi, 2);
        Counts { modes: n_f, algebraic: n_f + 3 * n_psi + n_beta, pairs: 2 * n_psi, equations: n_psi + n_beta + n_f }
    }

    /// True where the Heaviside form is the better one, which is taken unless told otherwise.
    pub fn prefers_heaviside(&self) -> bool {
        let n_psi = self.switching_functions.len();
        let factors = |row: &[i8]| row.iter().filter(|s| **s != 0).count();
        let of_modes = self.signs.chunks_exact(n_psi.max(1)).filter(|row| factors(row) > 1).count();
        let products = of_modes + n_lifted(&self.signs, n_psi, 2);
        heaviside_is_better(&self.moves, self.n_cells, products)
    }

    /// Sizes in the form that is taken unless told otherwise.
    pub fn counts(&self) -> Counts {
        if self.prefers_heaviside() {
            self.heaviside()
        } else {
            self.stewart()
        }
    }
}

/// Variables Algorithm 1 adds so that no product has more than `n_d` factors: the different prefixes of `n_d` and more
/// nonzero signs that some row continues.
pub(super) fn n_lifted(signs: &[i8], n_psi: usize, n_d: usize) -> usize {
    let mut rows: Vec<&[i8]> = signs.chunks_exact(n_psi.max(1)).collect();
    rows.sort_unstable();
    // rows with a common prefix are neighbours: of each the prefixes count that none before it has had
    let (mut n, mut before, mut counted) = (0, None, 0);
    for row in rows {
        let common = |other: &[i8]| row.iter().zip(other).take_while(|(a, b)| a == b).count();
        counted = before.map_or(0, common).min(counted);
        let last = row.iter().rposition(|s| *s != 0).unwrap_or(0);
        let mut factors = 0;
        for (j, _) in row[..last].iter().enumerate().filter(|s| *s.1 != 0) {
            factors += 1;
            n += usize::from(factors >= n_d && j >= counted);
        }
        counted = counted.max(last);
        before = Some(row);
    }
    n
}

/// Parts of a model, their costs, and what it did not need.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// Name of the model.
    pub name: String,
    /// States.
    pub n_states: usize,
    /// Controls.
    pub n_controls: usize,
    /// Parameters.
    pub n_parameters: usize,
    /// True if the discretisation needs a state for the time.
    pub clock: bool,
    /// States with a part that does not switch.
    pub n_smooth: usize,
    /// Subsystems.
    pub groups: Vec<Group>,
    /// Names of the discrete states.
    pub discrete: Vec<String>,
    /// Names of the values of each of them; none where they have no names.
    pub value_names: Vec<Vec<String>>,
    /// The transitions in words.
    pub transitions: Vec<String>,
    /// The choices in words.
    pub choices: Vec<String>,
    /// Remarks.
    pub notes: Vec<Note>,
}

impl Report {
    /// Switching functions of all subsystems.
    pub fn n_switching_functions(&self) -> usize {
        self.groups.iter().map(|g| g.switching_functions.len()).sum()
    }

    /// Regions of all subsystems.
    pub fn n_regions(&self) -> usize {
        self.groups.iter().map(|g| g.n_regions).sum()
    }

    /// Complementarity pairs at each point, every subsystem in the form that is taken unless told otherwise.
    pub fn n_pairs(&self) -> usize {
        self.groups.iter().map(|g| g.counts().pairs).sum()
    }

    /// Algebraic variables at each point, in the same forms.
    pub fn n_algebraic(&self) -> usize {
        self.groups.iter().map(|g| g.counts().algebraic).sum()
    }

    /// Remarks of one kind.
    pub fn notes_of(&self, kind: NoteKind) -> impl Iterator<Item = &str> {
        self.notes.iter().filter(move |n| n.kind == kind).map(|n| n.text.as_str())
    }

    /// The report as one object of JSON.
    pub fn json(&self) -> String {
        let list = |v: &[String]| format!("[{}]", v.iter().map(|s| quoted(s)).collect::<Vec<_>>().join(","));
        let groups: Vec<String> = self
            .groups
            .iter()
            .map(|g| {
                let count = |c: Counts| {
                    format!(
                        "{{\"modes\":{},\"algebraic\":{},\"pairs\":{},\"equations\":{}}}",
                        c.modes, c.algebraic, c.pairs, c.equations
                    )
                };
                let signs: Vec<String> = g.signs.iter().map(|s| s.to_string()).collect();
                format!(
                    "{{\"states\":{},\"switching_functions\":{},\"regions\":{},\"modes\":{},\"cells\":{},\"signs\":[{}],\
                     \"form\":\"{}\",\"stewart\":{},\"heaviside\":{}}}",
                    list(&g.states),
                    list(&g.switching_functions),
                    g.n_regions,
                    g.n_modes,
                    g.n_cells,
                    signs.join(","),
                    if g.prefers_heaviside() { "heaviside" } else { "stewart" },
                    count(g.stewart()),
                    count(g.heaviside())
                )
            })
            .collect();
        let notes: Vec<String> = self
            .notes
            .iter()
            .map(|n| format!("{{\"kind\":{},\"text\":{}}}", quoted(n.kind.name()), quoted(&n.text)))
            .collect();
        format!(
            "{{\"name\":{},\"states\":{},\"controls\":{},\"parameters\":{},\"clock\":{},\"smooth\":{},\
             \"switching_functions\":{},\"regions\":{},\"algebraic\":{},\"pairs\":{},\"groups\":[{}],\
             \"discrete\":{},\"value_names\":[{}],\"transitions\":{},\"choices\":{},\"notes\":[{}]}}",
            quoted(&self.name),
            self.n_states,
            self.n_controls,
            self.n_parameters,
            self.clock,
            self.n_smooth,
            self.n_switching_functions(),
            self.n_regions(),
            self.n_algebraic(),
            self.n_pairs(),
            groups.join(","),
            list(&self.discrete),
            self.value_names.iter().map(|names| list(names)).collect::<Vec<_>>().join(","),
            list(&self.transitions),
            list(&self.choices),
            notes.join(",")
        )
    }
}

/// A string of JSON.
fn quoted(s: &str) -> String {
    let mut out = String::from("\"");
    for c in s.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if (c as u32) < 0x20 => out.push_str(&format!("\\u{:04x}", c as u32)),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        let clock = if self.clock { " and a clock" } else { "" };
        writeln!(
            f,
            "{}: {}{clock}, {}, {}",
            self.name,
            plural(self.n_states, "state"),
            plural(self.n_controls, "control"),
            plural(self.n_parameters, "parameter")
        )?;
        if self.groups.is_empty() {
            writeln!(f, "  smooth: no modes, no complementarity")?;
        }
        for g in &self.groups {
            let (mut s, mut h, mut other) = (g.stewart(), g.heaviside(), "Heaviside");
            if g.prefers_heaviside() {
                (s, h, other) = (h, s, "Stewart's");
            }
            writeln!(
                f,
                "  {} switch with {}: {} in {}",
                g.states.join(", "),
                g.switching_functions.join(", "),
                plural(g.n_modes, "mode"),
                plural(g.n_regions, "region")
            )?;
            writeln!(
                f,
                "    per point: {} pairs, {} algebraic variables, {} equations ({other} form: {}, {}, {})",
                s.pairs, s.algebraic, s.equations, h.pairs, h.algebraic, h.equations
            )?;
        }
        writeln!(
            f,
            "  in all: {}, {}, {}, {} per point",
            plural(self.n_switching_functions(), "switching function"),
            plural(self.n_regions(), "region"),
            plural(self.n_algebraic(), "algebraic variable"),
            plural(self.n_pairs(), "pair")
        )?;
        if !self.discrete.is_empty() {
            let all = self.discrete.iter().zip(&self.value_names);
            let texts: Vec<String> = all
                .map(|(name, values)| match values.len() {
                    0 => name.clone(),
                    _ => format!("{name} ({})", values.join(", ")),
                })
                .collect();
            writeln!(f, "  discrete: {}", texts.join(", "))?;
        }
        for (k, t) in self.transitions.iter().enumerate() {
            writeln!(f, "  transition {k}: {t}")?;
        }
        for c in &self.choices {
            writeln!(f, "  choice: {c}")?;
        }
        for n in &self.notes {
            writeln!(f, "  {}: {}", n.kind.name(), n.text)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All `2^n` sign patterns.
    fn full(n: usize) -> Vec<i8> {
        (0..1usize << n).flat_map(|k| (0..n).map(move |j| if k >> (n - 1 - j) & 1 == 0 { 1 } else { -1 })).collect()
    }

    #[test]
    fn algorithm_1_adds_as_many_variables_as_the_thesis_says() {
        for (n_psi, n_d, n_beta) in [(3, 2, 4), (4, 2, 12), (4, 3, 8), (5, 2, 28), (2, 2, 0), (1, 2, 0)] {
            assert_eq!(n_lifted(&full(n_psi), n_psi, n_d), n_beta);
        }
        // Zeros are no factors.
        assert_eq!(n_lifted(&[1, 0, 1, -1, 1, 0], 3, 2), 0);
    }

    #[test]
    fn counts_of_table_6_4() {
        for n in 1..=10usize {
            let m = 1 << n;
            let g = Group {
                states: vec!["v".into()],
                switching_functions: vec![String::new(); n],
                moves: vec![true; n],
                n_regions: m,
                n_modes: m,
                n_cells: m,
                signs: full(n),
            };
            let n_beta = if n > 2 { m - 4 } else { 0 };
            assert_eq!(g.stewart(), Counts { modes: m, algebraic: 2 * m + 1, pairs: m, equations: m + 1 });
            let h = Counts { modes: m, algebraic: m + 3 * n + n_beta, pairs: 2 * n, equations: n + n_beta + m };
            assert_eq!(g.heaviside(), h);
        }
    }

    #[test]
    fn many_switching_functions_of_few_regions_prefer_the_heaviside_form() {
        let group = |n: usize, signs: Vec<i8>| {
            let n_regions = signs.len() / n;
            let zeros = |row: &[i8]| row.iter().filter(|s| **s == 0).count();
            let n_cells = signs.chunks(n).map(|row| 1 << zeros(row)).sum();
            Group {
                states: vec!["v".into()],
                switching_functions: vec![String::new(); n],
                moves: vec![true; n],
                n_regions,
                n_modes: n_regions,
                n_cells,
                signs,
            }
        };
        // a ladder: one region for each step, and the rest
        let ladder: Vec<i8> = vec![1, 0, 0, 0, -1, 1, 0, 0, -1, -1, 1, 0, -1, -1, -1, 1, -1, -1, -1, -1];
        let g = group(4, ladder);
        assert_eq!(g.n_cells, 16);
        assert!(g.prefers_heaviside());
        assert_eq!(g.counts(), Counts { modes: 5, algebraic: 5 + 12 + 2, pairs: 8, equations: 4 + 2 + 5 });
        for n in 1..=10 {
            // with all regions there is nothing to gain but pairs
            assert!(!group(n, full(n)).prefers_heaviside());
        }
    }

    #[test]
    fn json_is_escaped() {
        assert_eq!(quoted("a\"b\\c\nd"), "\"a\\\"b\\\\c\\u000ad\"");
    }
}
