//! `powerball generate`: a model as a controller's code.

use super::inputs::Known;
use super::{Failure, output};
use clap::{Args, ValueEnum};
use dyngen::{Arm, Function};
use powerball_explanation::torque_model::{Scalar, SourceError};
use powerball_logs::regression::RigidArm;
use std::path::{Path, PathBuf};

/// Write a model with its effects as one Rust file for a controller: no std, no allocation, needs nalgebra
/// alone.
///
/// `TorqueModel::torque` in it is the torque of the report: rigid arm, friction and every effect. The rigid
/// dynamics are proven equal to the Lagrangian before they are written.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  powerball generate --arm arm.toml --model result/model.json -o controller.rs \
        --scalar f32"
)]
pub(crate) struct Generate {
    /// The arm file (TOML) that the model was identified with.
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    /// The model: model.json of `powerball explain` or identified.json of `powerball identify`.
    #[arg(long, value_name = "FILE.json")]
    model: PathBuf,
    /// The file to write.
    #[arg(short, long, value_name = "FILE.rs", required_unless_present = "yaml")]
    output: Option<PathBuf>,
    /// Write friction, gravity and inertial values as a parameter file of ROS 2, for a controller of
    /// ros2_control that computes torques itself.
    #[arg(long, value_name = "FILE.yaml")]
    yaml: Option<PathBuf>,
    /// Write a C header too, for callers in C and C++: the file in Rust then has its functions as extern "C".
    /// Their names begin with the header's: my_arm.h gives my_arm_torque.
    #[arg(long, value_name = "FILE.h", requires = "output")]
    c_header: Option<PathBuf>,
    /// The scalar of the controller.
    #[arg(long, value_enum, default_value = "f64")]
    scalar: ScalarName,
    /// More functions of the rigid arm in addition to the inverse dynamics, separated by commas: those of
    /// `dyngen generate`.
    #[arg(long, value_delimiter = ',', value_parser = function)]
    functions: Vec<Function>,
    /// Print what was written as one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ScalarName {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

fn function(name: &str) -> Result<Function, String> {
    let names = Function::ALL.map(Function::name).join(", ");
    Function::parse(name.trim()).ok_or_else(|| format!("there is no function '{name}': there are {names}"))
}

impl Generate {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let known = Known::read(&self.arm, Some(&self.model))?;
        let body = RigidArm::new(&known.arm).map_err(|e| Failure::Refused(e.to_string()))?;
        let Some(model) = known.model(&body)? else { return Ok(()) };
        let values: Vec<f64> = model.parameters.iter().map(|p| p.value).collect();
        let possibility = body.possibility(&values).map_err(|e| Failure::Refused(e.to_string()))?;
        possibility
            .warnings(&self.model)
            .iter()
            .for_each(|warning| output::notice(&format!("warning: {warning}")));
        let file = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let scalar = match self.scalar {
            ScalarName::F32 => Scalar::F32,
            ScalarName::F64 => Scalar::F64,
        };
        let failure = |e: SourceError| match e {
            SourceError::Changes(_) => Failure::Unusable(format!("{}: {e}", self.model.display())),
            SourceError::Prefix(_) => Failure::Unusable(format!("--c-header: {e}")),
            SourceError::Generator(_) | SourceError::Coupled => Failure::Refused(e.to_string()),
        };
        let outputs: Vec<&PathBuf> =
            [&self.output, &self.c_header, &self.yaml].into_iter().flatten().collect();
        if outputs.iter().enumerate().any(|(k, path)| outputs[..k].contains(path)) {
            return Err(Failure::Unusable("two outputs are one file: choose other names".to_string()));
        }
        let mut written: Vec<(&PathBuf, String)> = Vec::new();
        match (&self.output, &self.c_header) {
            (Some(output), None) => {
                written.push((output, model.source(&file, scalar, &self.functions).map_err(failure)?));
            }
            (Some(output), Some(header)) => {
                let prefix = header.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
                let code = model.source_for_c(&file, scalar, &self.functions, prefix).map_err(failure)?;
                written.extend([(output, code.source), (header, code.header)]);
            }
            (None, _) => {}
        }
        if let Some(yaml) = &self.yaml {
            let text = model.ros_parameters(&file).map_err(|e| failure(SourceError::Changes(e)))?;
            written.push((yaml, text));
        }
        for (path, text) in &written {
            write(path, text)?;
        }
        let notes = model.not_compensated();
        if self.json {
            let terms = model.additions.terms.len();
            let (header, yaml) = (&self.c_header, &self.yaml);
            let what = serde_json::json!({
                "file": self.output, "c_header": header, "yaml": yaml, "terms": terms, "not_compensated": notes,
            });
            output::data(&output::json(&what)?);
        } else {
            notes.iter().for_each(|note| output::print(&format!("note: {note}")));
        }
        Ok(())
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().and_then(|n| n.to_str());
    let name = name.ok_or_else(|| Failure::Unusable(format!("{}: is no file", path.display())))?;
    output::write(folder, name, text.as_bytes())
}
