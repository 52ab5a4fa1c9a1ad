//! A controller as a unit for co-simulation: FMI 2.0 and 3.0 (Modelica Association, *Functional Mock-up Interface*, 2.0.4 and 3.0.2).

use super::text::table;
use crate::expr::fingerprint;
use crate::nmpc::Nmpc;
use std::fmt::Write;
use std::ops::Range;

/// The functions of the standard around the controller.
const FUNCTIONS: &str = include_str!("fmu.c");

/// Where FMI 3.0 finds the sources of a unit.
const BUILD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<fmiBuildDescription fmiVersion=\"3.0\">
  <BuildConfiguration modelIdentifier=\"@prefix@\">
    <SourceFileSet language=\"C99\">
      <SourceFile name=\"@prefix@_fmu.c\"/>
      <SourceFile name=\"@prefix@.c\"/>
      <PreprocessorDefinition name=\"FMI_VERSION\" value=\"3\"/>
    </SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
";

/// A scalar of the unit.
struct Scalar {
    name: String,
    /// Causality and variability.
    how: &'static str,
    start: f64,
}

const INPUT: &str = "causality=\"input\" variability=\"discrete\"";
const OUTPUT: &str = "causality=\"output\" variability=\"discrete\" initial=\"exact\"";
const TUNABLE: &str = "causality=\"parameter\" variability=\"tunable\" initial=\"exact\"";

impl Nmpc {
    /// Terms with one reference for all nodes: those that the unit has as inputs.
    fn fmu_terms(&self) -> Vec<usize> {
        let same = |k: &usize| {
            let s = &self.model.costs.squares[*k];
            let n = s.f.n_out();
            n > 0 && s.references.chunks_exact(n).all(|y| y == &s.references[..n])
        };
        (0..self.model.costs.squares.len()).filter(same).collect()
    }

    /// Starts of all numbers: states, controls, references, parameters.
    fn fmu_starts(&self, terms: &[usize], x: &[f64], u: &[f64]) -> Vec<f64> {
        let (nx, nu, nodes) = (self.nx(), self.nu(), &self.model.nodes);
        let mut start = [&x[..nx], &u[..nu]].concat();
        for k in terms {
            let s = &self.model.costs.squares[*k];
            start.extend_from_slice(&s.references[..s.f.n_out()]);
        }
        start.extend_from_slice(&nodes.p[..nodes.np]);
        start
    }

    /// The functions of the standard, and the descriptions of the unit, for a controller whose source is given: files with their names.
    pub(super) fn fmu(&self, prefix: &str, source: &str, [x, u]: [&[f64]; 2]) -> Vec<(String, String)> {
        let (nx, nu, np) = (self.nx(), self.nu(), self.model.nodes.np);
        let terms = self.fmu_terms();
        let sizes: Vec<usize> = terms.iter().map(|k| self.model.costs.squares[*k].f.n_out()).collect();
        let guid = format!("{{{:016x}-{:016x}}}", fingerprint(source, 0), fingerprint(source, 1));
        let sample = self.model.nodes.h[0];
        let starts = self.fmu_starts(&terms, x, u);
        let mut data = format!(
            "#define GUID \"{guid}\"\nstatic const double SAMPLE = {sample:e};\nenum {{ N_TERMS = {}, N_REFERENCES = {} }};\n",
            terms.len(),
            sizes.iter().sum::<usize>()
        );
        table(&mut data, "int", "TERMS", terms.iter().map(usize::to_string));
        table(&mut data, "int", "SIZES", sizes.iter().map(usize::to_string));
        table(&mut data, "double", "START", starts.iter().map(|v| format!("{v:e}")));
        let functions = FUNCTIONS.replace("@data@", &data).replace("@prefix@", prefix);

        let mut all: Vec<Scalar> = Vec::with_capacity(starts.len());
        let mut put = |name: String, how| all.push(Scalar { name, how, start: starts[all.len()] });
        (1..=nx).for_each(|i| put(format!("x[{i}]"), INPUT));
        (1..=nu).for_each(|i| put(format!("u[{i}]"), OUTPUT));
        for (k, n) in terms.iter().zip(&sizes) {
            (1..=*n).for_each(|i| put(format!("reference_{}[{i}]", k + 1), INPUT));
        }
        (1..=np).for_each(|i| put(format!("p[{i}]"), TUNABLE));
        let controls = nx..nx + nu;
        let experiment = format!(
            "<DefaultExperiment startTime=\"0\" stopTime=\"{:e}\" stepSize=\"{sample:e}\"/>",
            sample * self.n() as f64
        );
        vec![
            (format!("{prefix}_fmu.c"), functions),
            ("modelDescription.xml".into(), two(prefix, &guid, &experiment, &all, controls.clone())),
            ("modelDescription_fmi3.xml".into(), three(prefix, &guid, &experiment, &all, controls)),
            ("buildDescription.xml".into(), BUILD.replace("@prefix@", prefix)),
        ]
    }
}

/// The description of FMI 2.0.
fn two(prefix: &str, guid: &str, experiment: &str, all: &[Scalar], controls: Range<usize>) -> String {
    let mut variables = String::new();
    let mut put = |name: &str, number: usize, how: &str, kind: String| {
        let _ = writeln!(
            variables,
            "    <ScalarVariable name=\"{name}\" valueReference=\"{number}\" {how}><{kind}/></ScalarVariable>"
        );
    };
    for (k, s) in all.iter().enumerate() {
        put(&s.name, k, s.how, format!("Real start=\"{:e}\"", s.start));
    }
    put("source", 0, OUTPUT, "Integer start=\"3\"".into());
    let outputs = controls.map(|k| k + 1).chain([all.len() + 1]);
    let unknowns: String = outputs.map(|i| format!("      <Unknown index=\"{i}\"/>\n")).collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{prefix}\" guid=\"{guid}\" description=\"A model predictive controller\" \
         generationTool=\"switchback {version}\" variableNamingConvention=\"structured\" numberOfEventIndicators=\"0\">
  <CoSimulation modelIdentifier=\"{prefix}\" canHandleVariableCommunicationStepSize=\"true\" \
         canBeInstantiatedOnlyOncePerProcess=\"true\" canNotUseMemoryManagementFunctions=\"true\">
    <SourceFiles>
      <File name=\"{prefix}_fmu.c\"/>
      <File name=\"{prefix}.c\"/>
    </SourceFiles>
  </CoSimulation>
  {experiment}
  <ModelVariables>
{variables}  </ModelVariables>
  <ModelStructure>
    <Outputs>
{unknowns}    </Outputs>
  </ModelStructure>
</fmiModelDescription>
",
        version = env!("CARGO_PKG_VERSION"),
    )
}

/// The description of FMI 3.0, in which value references count variables of all types.
fn three(prefix: &str, guid: &str, experiment: &str, all: &[Scalar], controls: Range<usize>) -> String {
    let mut variables = String::new();
    for (k, s) in all.iter().enumerate() {
        let _ = writeln!(
            variables,
            "    <Float64 name=\"{}\" valueReference=\"{k}\" {} start=\"{:e}\"/>",
            s.name, s.how, s.start
        );
    }
    let n = all.len();
    let _ = writeln!(variables, "    <Int32 name=\"source\" valueReference=\"{n}\" {OUTPUT} start=\"3\"/>");
    let _ = writeln!(
        variables,
        "    <Float64 name=\"time\" valueReference=\"{}\" causality=\"independent\" variability=\"continuous\"/>",
        n + 1
    );
    let outputs: String = controls.chain([n]).map(|k| format!("    <Output valueReference=\"{k}\"/>\n")).collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{prefix}\" instantiationToken=\"{guid}\" \
         description=\"A model predictive controller\" generationTool=\"switchback {version}\" variableNamingConvention=\"structured\">
  <CoSimulation modelIdentifier=\"{prefix}\" canHandleVariableCommunicationStepSize=\"true\" \
         canBeInstantiatedOnlyOncePerProcess=\"true\"/>
  {experiment}
  <ModelVariables>
{variables}  </ModelVariables>
  <ModelStructure>
{outputs}  </ModelStructure>
</fmiModelDescription>
",
        version = env!("CARGO_PKG_VERSION"),
    )
}
