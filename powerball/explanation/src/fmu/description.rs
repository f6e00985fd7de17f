//! What is in an FMU, as XML: variables with their units, and how the sources are compiled.

use dyngen::Arm;
use dyngen::arm::JointKind;
use std::fmt::Write;

/// What is known of all files.
pub(super) struct Head<'a> {
    pub(super) arm: &'a Arm,
    pub(super) identifier: &'a str,
    pub(super) token: &'a str,
    pub(super) by: &'a str,
    pub(super) notes: &'a [String],
}

/// Units of SI with their exponents.
const UNITS: [(&str, &str); 7] = [
    ("s", "s=\"1\""),
    ("rad", "rad=\"1\""),
    ("rad/s", "rad=\"1\" s=\"-1\""),
    ("N.m", "kg=\"1\" m=\"2\" s=\"-2\""),
    ("m", "m=\"1\""),
    ("m/s", "m=\"1\" s=\"-1\""),
    ("N", "kg=\"1\" m=\"1\" s=\"-2\""),
];

/// A variable of each joint: its name in logs, what it is, its units by kind of joint, its causality.
const VARIABLES: [(&str, &str, [&str; 2], &str); 3] = [
    ("tau", "torque of the motor of joint", ["N.m", "N"], "causality=\"input\" variability=\"continuous\""),
    (
        "q",
        "position of joint",
        ["rad", "m"],
        "causality=\"output\" variability=\"continuous\" initial=\"exact\"",
    ),
    (
        "dq",
        "velocity of joint",
        ["rad/s", "m/s"],
        "causality=\"output\" variability=\"continuous\" initial=\"exact\"",
    ),
];

/// References of variables in the order of [`VARIABLES`] begin after time and the largest step.
const FIRST: usize = 2;

impl Head<'_> {
    /// modelDescription.xml.
    pub(super) fn model_description(&self) -> String {
        let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        // Writing to a String cannot fail.
        let _ = self.model(&mut text);
        text
    }

    fn model(&self, text: &mut String) -> std::fmt::Result {
        let Head { arm, identifier, token, by, notes } = self;
        writeln!(text, "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{}\"", escaped(&arm.name))?;
        writeln!(text, "    instantiationToken=\"{token}\" generationTool=\"{}\"", escaped(by))?;
        let about = "The arm as its model says: torques of the motors in, positions and velocities out";
        writeln!(text, "    description=\"{}\"", escaped(&format!("{about}. {}.", notes.join(". "))))?;
        writeln!(text, "    variableNamingConvention=\"flat\">")?;
        writeln!(text, "  <CoSimulation modelIdentifier=\"{identifier}\"")?;
        writeln!(
            text,
            "      canHandleVariableCommunicationStepSize=\"true\" canGetAndSetFMUState=\"true\"/>"
        )?;
        writeln!(text, "  <UnitDefinitions>")?;
        for (name, exponents) in UNITS {
            writeln!(text, "    <Unit name=\"{name}\"><BaseUnit {exponents}/></Unit>")?;
        }
        writeln!(text, "  </UnitDefinitions>")?;
        writeln!(text, "  <DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"0.002\"/>")?;
        writeln!(text, "  <ModelVariables>")?;
        let time = "causality=\"independent\" variability=\"continuous\" unit=\"s\"";
        writeln!(text, "    <Float64 name=\"time\" valueReference=\"0\" {time}/>")?;
        let step = "causality=\"parameter\" variability=\"fixed\" initial=\"exact\" unit=\"s\" \
                    start=\"0.0002\" description=\"longest step of the integration\"";
        writeln!(text, "    <Float64 name=\"max_step\" valueReference=\"1\" {step}/>")?;
        let joints: Vec<_> = arm.moving_joints().zip(arm.joint_names()).collect();
        for (block, (prefix, what, units, causality)) in VARIABLES.iter().enumerate() {
            for (j, (joint, name)) in joints.iter().enumerate() {
                let unit = units[usize::from(joint.kind == JointKind::Prismatic)];
                let own = match arm.has_joint_names() {
                    true => format!("{prefix}.{name}"),
                    false => format!("{prefix}{name}"),
                };
                let reference = FIRST + block * joints.len() + j;
                let description = escaped(&format!("{what} {}", j + 1));
                writeln!(
                    text,
                    "    <Float64 name=\"{}\" valueReference=\"{reference}\" {causality}",
                    escaped(&own)
                )?;
                writeln!(text, "        unit=\"{unit}\" start=\"0\" description=\"{description}\"/>")?;
            }
        }
        writeln!(text, "  </ModelVariables>\n  <ModelStructure>")?;
        for reference in FIRST + joints.len()..FIRST + 3 * joints.len() {
            writeln!(text, "    <Output valueReference=\"{reference}\"/>")?;
        }
        writeln!(text, "  </ModelStructure>\n</fmiModelDescription>")
    }

    /// buildDescription.xml.
    pub(super) fn build_description<'a>(&self, sources: impl Iterator<Item = &'a str>) -> String {
        let files: String = sources.map(|name| format!("      <SourceFile name=\"{name}\"/>\n")).collect();
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<fmiBuildDescription fmiVersion=\"3.0\">
  <BuildConfiguration modelIdentifier=\"{}\">
    <SourceFileSet language=\"C99\">
{files}    </SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
",
            self.identifier
        )
    }
}

/// A text as an attribute's value.
fn escaped(text: &str) -> String {
    let text = text.replace(|c: char| c.is_control(), " ");
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
