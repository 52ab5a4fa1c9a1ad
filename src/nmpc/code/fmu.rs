//! A controller as a unit for co-simulation: FMI 2.0 (Modelica Association, *Functional Mock-up Interface for Model Exchange and Co-Simulation*, 2.0.4).

use super::table;
use crate::nmpc::Nmpc;
use std::fmt::Write;

/// The functions of the standard around the controller.
const FUNCTIONS: &str = include_str!("fmu.c");

/// A scalar of the unit.
fn scalar(out: &mut String, name: &str, number: usize, how: &str, kind: &str, start: &str) {
    let _ = writeln!(
        out,
        "    <ScalarVariable name=\"{name}\" valueReference=\"{number}\" {how}><{kind} start=\"{start}\"/></ScalarVariable>"
    );
}

/// FNV-1a over a text: changes with it, and is the same in every run.
fn hash(text: &str, seed: u64) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325 ^ seed, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

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

    /// The functions of the standard, and the description of the unit, for a controller whose source is given.
    pub(super) fn fmu(&self, prefix: &str, source: &str, [x, u]: [&[f64]; 2]) -> [String; 2] {
        let (nx, nu, np) = (self.nx(), self.nu(), self.model.nodes.np);
        let terms = self.fmu_terms();
        let sizes: Vec<usize> = terms.iter().map(|k| self.model.costs.squares[*k].f.n_out()).collect();
        let guid = format!("{{{:016x}-{:016x}}}", hash(source, 0), hash(source, 1));
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

        let mut all = String::new();
        let mut number = 0;
        let mut put = |name: String, how: &str| {
            scalar(&mut all, &name, number, how, "Real", &format!("{:e}", starts[number]));
            number += 1;
        };
        let input = "causality=\"input\" variability=\"discrete\"";
        let output = "causality=\"output\" variability=\"discrete\" initial=\"exact\"";
        (1..=nx).for_each(|i| put(format!("x[{i}]"), input));
        (1..=nu).for_each(|i| put(format!("u[{i}]"), output));
        for (k, n) in terms.iter().zip(&sizes) {
            (1..=*n).for_each(|i| put(format!("reference_{}[{i}]", k + 1), input));
        }
        let tunable = "causality=\"parameter\" variability=\"tunable\" initial=\"exact\"";
        (1..=np).for_each(|i| put(format!("p[{i}]"), tunable));
        scalar(&mut all, "source", 0, output, "Integer", "3");
        let outputs = (nx + 1..=nx + nu).chain([number + 1]);
        let unknowns: String = outputs.map(|i| format!("      <Unknown index=\"{i}\"/>\n")).collect();
        let description = format!(
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
  <DefaultExperiment startTime=\"0\" stopTime=\"{stop:e}\" stepSize=\"{sample:e}\"/>
  <ModelVariables>
{all}  </ModelVariables>
  <ModelStructure>
    <Outputs>
{unknowns}    </Outputs>
  </ModelStructure>
</fmiModelDescription>
",
            version = env!("CARGO_PKG_VERSION"),
            stop = sample * self.n() as f64,
        );
        [functions, description]
    }
}
