//! Descriptions of units: `modelDescription.xml` of both versions.

use std::fmt::Write;

use super::{FmiVersion, Start};
use crate::expr::fingerprint;
use crate::model::{Built, SavedModel};

/// What a variable is to importers.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    /// A state that moves, by its place among these.
    State(usize),
    /// A state that only transitions change.
    Discrete,
    /// The derivative of such a state, by its place among these.
    Derivative(usize),
    Input,
    Parameter,
    Indicator,
}

struct Variable {
    name: String,
    role: Role,
    start: f64,
}

/// A unit, as importers are told of it.
pub(super) struct Description<'a> {
    identifier: &'a str,
    model: &'a str,
    pub(super) token: String,
    start: &'a Start,
    /// Are there steps of others, and with how many event indicators?
    exchange: Option<usize>,
    all: Vec<Variable>,
}

/// The folder of the binary of this machine.
pub(super) fn platform(version: FmiVersion) -> String {
    let (os, arch) = (std::env::consts::OS, std::env::consts::ARCH);
    match version {
        FmiVersion::Two => {
            let os = match os {
                "macos" => "darwin",
                "windows" => "win",
                other => other,
            };
            format!("{os}{}", usize::BITS)
        }
        FmiVersion::Three => format!("{arch}-{}", if os == "macos" { "darwin" } else { os }),
    }
}

/// A text as the value of an attribute.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

impl<'a> Description<'a> {
    pub(super) fn new(
        identifier: &'a str,
        saved: &'a SavedModel,
        built: &Built,
        start: &'a Start,
        exchange: Option<usize>,
        document: &str,
    ) -> Description<'a> {
        let names = saved.names();
        let named = |list: &[String], i: usize, letter: &str| {
            list.get(i).filter(|n| !n.is_empty()).cloned().unwrap_or_else(|| format!("{letter}[{i}]"))
        };
        let discrete = built.system.discrete_states();
        let moves = |i: &usize| !discrete.contains(i);
        let mut all = Vec::new();
        let mut n = 0;
        for i in 0..built.dims.x {
            let role = if moves(&i) { Role::State(n) } else { Role::Discrete };
            n += usize::from(moves(&i));
            all.push(Variable { name: named(&names.x, i, "x"), role, start: start.x[i] });
        }
        for (k, i) in (0..built.dims.x).filter(moves).enumerate().filter(|_| exchange.is_some()) {
            let name = format!("der({})", named(&names.x, i, "x"));
            all.push(Variable { name, role: Role::Derivative(k), start: 0.0 });
        }
        for (list, letter, role, values) in
            [(&names.u, "u", Role::Input, &start.u), (&names.p, "p", Role::Parameter, &start.p)]
        {
            all.extend(values.iter().enumerate().map(|(i, v)| Variable {
                name: named(list, i, letter),
                role,
                start: *v,
            }));
        }
        all.extend((0..exchange.unwrap_or(0)).map(|i| Variable {
            name: format!("indicator[{i}]"),
            role: Role::Indicator,
            start: 1.0,
        }));
        // names that are no name of the model stay apart from those that are
        let mut taken = std::collections::HashSet::new();
        for v in &mut all {
            while !taken.insert(v.name.clone()) {
                v.name.push('_');
            }
        }
        let content = format!("{document}{:?}", (start, exchange, identifier));
        let token = format!("{{{:016x}-{:016x}}}", fingerprint(&content, 0), fingerprint(&content, 1));
        Description { identifier, model: saved.name(), token, start, exchange, all }
    }

    pub(super) fn text(&self, version: FmiVersion) -> String {
        match version {
            FmiVersion::Two => self.two(),
            FmiVersion::Three => self.three(),
        }
    }

    fn experiment(&self) -> String {
        format!(
            "  <DefaultExperiment startTime=\"0\" stopTime=\"{:e}\" tolerance=\"{:e}\"/>\n",
            self.start.duration, self.start.rtol
        )
    }

    /// Places of states that move.
    fn states(&self) -> Vec<usize> {
        (0..self.all.len()).filter(|k| matches!(self.all[*k].role, Role::State(_))).collect()
    }

    fn places(&self, is: fn(Role) -> bool) -> impl Iterator<Item = usize> + '_ {
        (0..self.all.len()).filter(move |k| is(self.all[*k].role))
    }

    fn two(&self) -> String {
        let (states, mut variables) = (self.states(), String::new());
        let seen = self.all.iter().enumerate().filter(|(_, v)| v.role != Role::Indicator);
        for (k, v) in seen {
            let (how, more) = match v.role {
                Role::State(_) => ("causality=\"output\" variability=\"continuous\" initial=\"exact\"", String::new()),
                Role::Discrete => ("causality=\"output\" variability=\"discrete\" initial=\"exact\"", String::new()),
                Role::Derivative(of) => (
                    "causality=\"local\" variability=\"continuous\" initial=\"calculated\"",
                    format!("derivative=\"{}\"", states[of] + 1),
                ),
                Role::Input => ("causality=\"input\" variability=\"continuous\"", String::new()),
                _ => ("causality=\"parameter\" variability=\"tunable\" initial=\"exact\"", String::new()),
            };
            let start = if more.is_empty() { format!("start=\"{:e}\"", v.start) } else { more };
            let _ = writeln!(
                variables,
                "    <ScalarVariable name=\"{}\" valueReference=\"{k}\" {how}><Real {start}/></ScalarVariable>",
                escaped(&v.name)
            );
        }
        let unknowns = |places: &mut dyn Iterator<Item = usize>| -> String {
            places.fold(String::new(), |mut all, k| {
                let _ = writeln!(all, "      <Unknown index=\"{}\"/>", k + 1);
                all
            })
        };
        let outputs = unknowns(&mut self.places(|r| matches!(r, Role::State(_) | Role::Discrete)));
        let derivatives = unknowns(&mut self.places(|r| matches!(r, Role::Derivative(_))));
        let mut structure = format!("    <Outputs>\n{outputs}    </Outputs>\n");
        if !derivatives.is_empty() {
            let _ = write!(
                structure,
                "    <Derivatives>\n{derivatives}    </Derivatives>\n    <InitialUnknowns>\n{derivatives}    </InitialUnknowns>\n"
            );
        }
        let exchange = self.exchange.map_or_else(String::new, |_| {
            format!(
                "  <ModelExchange modelIdentifier=\"{}\" completedIntegratorStepNotNeeded=\"true\"/>\n",
                self.identifier
            )
        });
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{model}\" guid=\"{token}\" generationTool=\"switchback {library}\" \
             variableNamingConvention=\"flat\" numberOfEventIndicators=\"{indicators}\">
{exchange}  <CoSimulation modelIdentifier=\"{id}\" canHandleVariableCommunicationStepSize=\"true\"/>
{experiment}  <ModelVariables>
{variables}  </ModelVariables>
  <ModelStructure>
{structure}  </ModelStructure>
</fmiModelDescription>
",
            model = escaped(self.model),
            token = self.token,
            library = env!("CARGO_PKG_VERSION"),
            indicators = self.exchange.unwrap_or(0),
            id = self.identifier,
            experiment = self.experiment(),
        )
    }

    fn three(&self) -> String {
        let (states, mut variables) = (self.states(), String::new());
        for (k, v) in self.all.iter().enumerate() {
            let how = match v.role {
                Role::State(_) => "causality=\"output\" variability=\"continuous\" initial=\"exact\"".into(),
                Role::Discrete => "causality=\"output\" variability=\"discrete\" initial=\"exact\"".into(),
                Role::Derivative(of) => {
                    format!(
                        "causality=\"local\" variability=\"continuous\" initial=\"calculated\" derivative=\"{}\"",
                        states[of]
                    )
                }
                Role::Indicator => "causality=\"local\" variability=\"continuous\" initial=\"calculated\"".into(),
                Role::Input => "causality=\"input\" variability=\"continuous\"".into(),
                Role::Parameter => "causality=\"parameter\" variability=\"tunable\" initial=\"exact\"".to_string(),
            };
            let start = match v.role {
                Role::Derivative(_) | Role::Indicator => String::new(),
                _ => format!(" start=\"{:e}\"", v.start),
            };
            let _ =
                writeln!(variables, "    <Float64 name=\"{}\" valueReference=\"{k}\" {how}{start}/>", escaped(&v.name));
        }
        let mut time = "time".to_owned();
        while self.all.iter().any(|v| v.name == time) {
            time.push('_');
        }
        let _ = writeln!(
            variables,
            "    <Float64 name=\"{time}\" valueReference=\"{}\" causality=\"independent\" variability=\"continuous\"/>",
            self.all.len()
        );
        let mut structure = String::new();
        let mut list = |tag: &str, is: fn(Role) -> bool| {
            for k in self.places(is) {
                let _ = writeln!(structure, "    <{tag} valueReference=\"{k}\"/>");
            }
        };
        list("Output", |r| matches!(r, Role::State(_) | Role::Discrete));
        list("ContinuousStateDerivative", |r| matches!(r, Role::Derivative(_)));
        list("InitialUnknown", |r| matches!(r, Role::Derivative(_)));
        list("EventIndicator", |r| r == Role::Indicator);
        let exchange = self.exchange.map_or_else(String::new, |_| {
            format!(
                "  <ModelExchange modelIdentifier=\"{}\" needsCompletedIntegratorStep=\"false\"/>\n",
                self.identifier
            )
        });
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{model}\" instantiationToken=\"{token}\" \
             generationTool=\"switchback {library}\" variableNamingConvention=\"flat\">
{exchange}  <CoSimulation modelIdentifier=\"{id}\" canHandleVariableCommunicationStepSize=\"true\"/>
{experiment}  <ModelVariables>
{variables}  </ModelVariables>
  <ModelStructure>
{structure}  </ModelStructure>
</fmiModelDescription>
",
            model = escaped(self.model),
            token = self.token,
            library = env!("CARGO_PKG_VERSION"),
            id = self.identifier,
            experiment = self.experiment(),
        )
    }
}
