//! The arm of a result in the form of a simulator: SDF, USD, FMU.

use super::{Failure, fmu, output, replace};
use clap::ValueEnum;
use dyngen::export::{self, Known};
use dyngen::{Arm, SetKind, Values};
use powerball_explanation::torque_model::{ModelFile, SourceError, TorqueModel};
use powerball_identification::mounting::Mounting;
use powerball_identification::{KnownModel, nearest_arm};
use powerball_logs::Progress;
use powerball_logs::regression::RigidArm;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Which simulators.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum ArmForm {
    /// SDFormat: Gazebo, Drake.
    Sdf,
    /// USD with UsdPhysics and PhysX's joints: Isaac Sim.
    Usd,
    /// FMI 3.0, Co-Simulation: torques in, positions and velocities out.
    Fmu,
}

/// An arm with its model.
pub(super) struct ArmResult {
    /// As its file says.
    filed: Arm,
    /// As the model has it.
    arm: Arm,
    /// With values that a real arm can have.
    model: TorqueModel,
    known: Known,
    notes: Vec<String>,
}

impl ArmResult {
    /// Reads a result and the arm file.
    pub(super) fn read(result: &Path, arm: Option<&Path>) -> Result<ArmResult, Failure> {
        // Of a demo it is next to the result.
        let next_to_it = result.with_file_name("arm.toml");
        let (file, text, result, recorded) = model_of(result)?;
        let recorded = recorded.into_iter().chain([next_to_it]).find(|path| path.is_file());
        let needed = || {
            let what =
                "names no arm file that is there: give the one that it was identified with (--arm ARM.toml)";
            Failure::Unusable(format!("{}: {what}", file.display()))
        };
        let path = arm.or(recorded.as_deref()).ok_or_else(needed)?;
        let filed = Arm::read(path).map_err(|e| Failure::Unusable(e.to_string()))?;
        let read = ModelFile::parse(&text, &file).map_err(|e| Failure::Unusable(e.to_string()))?;
        if !read.model.arm.is_empty() && read.model.arm != filed.name {
            return Err(Failure::Unusable(format!(
                "{}: is a model of the arm '{}', and the arm file is of '{}': take the arm file that it was \
                 identified with",
                file.display(),
                read.model.arm,
                filed.name
            )));
        }
        let arm = read.arm(&filed, Mounting::Filed).map_err(Failure::Unusable)?;
        let body = RigidArm::new(&arm).map_err(|e| Failure::Refused(e.to_string()))?;
        let mut model = read.checked(&body).map_err(|e| Failure::Unusable(e.to_string()))?;
        let known = known(&arm, &model, &result, &text, &file)?;
        let mut notes = Vec::new();
        let possible = body.possibility(&model.inertial()).map_err(|e| Failure::Refused(e.to_string()))?;
        if !possible.possible {
            notes.push(format!(
                "no real arm can have the fitted values: these are the nearest that one can have ({})",
                possible.reasons.join("; ")
            ));
            let set = body.model().set(SetKind::Minimal).map_err(|e| Failure::Refused(e.to_string()))?;
            let values = body.model().set_values(set, &known.values);
            model.parameters.iter_mut().zip(values).for_each(|(parameter, value)| parameter.value = value);
        }
        Ok(ArmResult { filed, arm, model, known, notes })
    }

    /// The file of a form, and what it cannot hold.
    pub(super) fn export(self, form: ArmForm) -> Result<(Vec<u8>, Vec<String>), Failure> {
        let by = format!("{}, powerball {}", replace::EXPORTED, env!("CARGO_PKG_VERSION"));
        let write = match form {
            ArmForm::Sdf => export::sdf,
            ArmForm::Usd => export::usd,
            ArmForm::Fmu => {
                let made = self.model.fmu(&self.filed, &by).map_err(|e| match e {
                    SourceError::Changes(_) => Failure::Unusable(e.to_string()),
                    _ => Failure::Refused(e.to_string()),
                })?;
                let (bytes, more) = fmu::packed(&made)?;
                return Ok((bytes, [self.notes, made.notes, more].concat()));
            }
        };
        let more = [self.notes, undescribed(&self.model)].concat();
        let exported = write(&self.arm, &self.known, &by, &more).map_err(Failure::Refused)?;
        Ok((exported.text.into_bytes(), exported.notes))
    }
}

/// The file with the model of a result, its text and its JSON (for explained.json those of model.json next to
/// it), and the arm file that the result names.
fn model_of(result: &Path) -> Result<(PathBuf, String, Value, Option<PathBuf>), Failure> {
    let read = |path: &Path| -> Result<(String, Value), Failure> {
        let wrong = |what: String| Failure::Unusable(format!("{}: {what}", path.display()));
        let text = dyngen::file::text(path).map_err(|e| wrong(format!("cannot be read: {e}")))?;
        let json: Value = serde_json::from_str(&text).map_err(|e| wrong(format!("is no JSON: {e}")))?;
        Ok((text, json))
    };
    let (text, json) = read(result)?;
    let wrong = |what: &str| format!("{}: {what}", result.display());
    if json.get("differ").is_some() {
        let what = "compares two results: give identified.json or model.json of the arm that is meant";
        return Err(Failure::Refused(wrong(what)));
    }
    let arm = json["arm_file"].as_str().map(PathBuf::from);
    match ["parameters", "friction", "effects"].map(|key| json[key].is_array()) {
        [true, true, _] => Ok((result.to_path_buf(), text, json, arm)),
        [_, _, true] => {
            let path = result.with_file_name("model.json");
            let (text, json) = read(&path)?;
            Ok((path, text, json, arm))
        }
        _ => Err(Failure::Unusable(wrong("is neither identified.json, model.json nor explained.json"))),
    }
}

/// A body for each link: those of the result, or of the nearest real arm where it has none.
fn known(arm: &Arm, model: &TorqueModel, result: &Value, text: &str, file: &Path) -> Result<Known, Failure> {
    let name = file.display().to_string();
    let read =
        |values: &str| Known::read(arm, (values, &name), Some((text, &name))).map_err(Failure::Refused);
    if result["consistent"]["parameters"].is_object() {
        return read(text);
    }
    let named = Values::named(model.parameters.iter().map(|p| (p.name.as_str(), p.value)), &name);
    let terminal = output::Progress::new();
    let say = |what: &str| terminal.say(what);
    let nearest =
        nearest_arm(arm, &named, Progress::to(&say)).map_err(|e| Failure::Refused(format!("{name}: {e}")))?;
    // Of an explained model no standard errors are known.
    let sums = result["parameters"].as_array().into_iter().flatten().filter(|sum| sum["std"].is_number());
    let sums: Vec<&Value> = sums.collect();
    let values = json!({"parameters": sums, "consistent": {"parameters": nearest.parameters}});
    read(&values.to_string())
}

/// What descriptions of robots have no place for, in addition to the effects among the terms.
fn undescribed(model: &TorqueModel) -> Vec<String> {
    let mut notes = Vec::new();
    for joint in &model.friction {
        if let Some(offset) = joint.offset.filter(|offset| *offset != 0.0) {
            notes.push(format!("left out: joint {}: a constant torque of {offset:.4e} N·m", joint.joint));
        }
    }
    for (j, offset) in model.additions.log_changes.encoder_offset.iter().enumerate() {
        if *offset != 0.0 {
            notes.push(format!("left out: joint {}: its encoder shows {offset:.4e} rad too much", j + 1));
        }
    }
    if !model.additions.payloads.is_empty() {
        notes.push("left out: the payload of some logs: this is the bare arm".to_string());
    }
    notes
}
