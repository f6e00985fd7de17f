//! The arm as it moves, for simulators of systems: an FMU (FMI 3.0, Co-Simulation) with τ in and q, q̇ out.
//!
//! The sources of the FMU are the rigid arm as dyngen writes it in C, the model's numbers and terms, and
//! three files that are the same for every model: the motion ([`crate::simulate`] in C), laws with a memory,
//! and the functions of FMI.

mod description;
mod terms;
#[cfg(test)]
mod tests;

use crate::torque_model::{SourceError, TorqueModel};
use dyngen::emit::{self, Options};
use dyngen::{Arm, Function, Model, SetKind};
use powerball_controller::correction::Law;
use std::fmt::Write;
use std::hash::{DefaultHasher, Hasher};

/// What stands in an FMU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fmu {
    /// The model identifier, which the library in `binaries/` is named after.
    pub identifier: String,
    /// Names within the archive and texts: the model description is the first.
    pub files: Vec<(String, String)>,
    /// What it cannot hold.
    pub notes: Vec<String>,
}

impl Fmu {
    /// The folder of the sources within the archive.
    pub const SOURCES: &str = "sources/";
}

/// Sources that are the same for every model.
const FIXED: [(&str, &str); 4] = [
    ("fmi3.c", include_str!("fmi3.c")),
    ("motion.h", include_str!("motion.h")),
    ("motion.c", include_str!("motion.c")),
    ("laws.c", include_str!("laws.c")),
];

/// In C, things of the rigid arm are named after this.
const PREFIX: &str = "arm";

impl TorqueModel {
    /// The FMU of the model of an arm file's arm, without its library. `by` says what made it.
    ///
    /// # Errors
    /// [`SourceError`]: also where motors turn with several joints.
    pub fn fmu(&self, arm: &Arm, by: &str) -> Result<Fmu, SourceError> {
        let arm = self.additions.arm_changes.of(arm).map_err(SourceError::Changes)?;
        if !arm.transmissions.is_empty() {
            return Err(SourceError::Coupled);
        }
        let rigid = self.rigid_in_c(&arm)?;
        let numbers = self.numbers(&arm);
        let mut hash = DefaultHasher::new();
        [&rigid.source, &numbers].iter().for_each(|text| hash.write(text.as_bytes()));
        let token = format!("{:016x}{:016x}", arm.hash(), hash.finish());
        let numbers = format!("{numbers}\nconst char model_token[] = \"{token}\";\n");
        let identifier = identifier(&arm.name);
        let notes = self.not_simulated();
        let own = [("arm.h", rigid.header), ("arm.c", rigid.source), ("model.c", numbers)];
        let fixed = FIXED.map(|(name, text)| (name, text.to_string()));
        let sources: Vec<(&str, String)> = own.into_iter().chain(fixed).collect();
        let compiled = sources.iter().map(|(name, _)| *name).filter(|name| name.ends_with(".c"));
        let head = description::Head { arm: &arm, identifier: &identifier, token: &token, by, notes: &notes };
        let mut files = vec![
            ("modelDescription.xml".to_string(), head.model_description()),
            (format!("{}buildDescription.xml", Fmu::SOURCES), head.build_description(compiled)),
        ];
        files.extend(sources.into_iter().map(|(name, text)| (format!("{}{name}", Fmu::SOURCES), text)));
        Ok(Fmu { identifier, files, notes })
    }

    /// What moves the rigid arm, with the model's values.
    fn rigid_in_c(&self, arm: &Arm) -> Result<emit::CFiles, SourceError> {
        let named = Arm { name: PREFIX.to_string(), ..arm.clone() };
        let model = Model::derive(named).map_err(SourceError::Generator)?;
        let functions = vec![Function::MassMatrix, Function::CoriolisTimesVelocity, Function::Gravity];
        let values = Some(self.inertial());
        let options = Options { parameters: SetKind::Minimal, functions, values, ..Options::default() };
        emit::c_files(&model, &options, "arm.h").map_err(SourceError::Generator)
    }

    /// Friction, encoder offsets and terms.
    fn numbers(&self, arm: &Arm) -> String {
        let mut text = format!("/* The model of the arm {:?}. */\n\n", arm.name.replace("*/", "* /"));
        // Writing to a String cannot fail.
        let _ = self.tables_in_c(&mut text);
        text
    }

    fn tables_in_c(&self, text: &mut String) -> std::fmt::Result {
        let terms = self.terms();
        writeln!(text, "#include \"motion.h\"\n#include <math.h>\n")?;
        writeln!(text, "const unsigned model_terms = {};\n", terms.len())?;
        writeln!(text, "const double model_friction[JOINTS][5] = {{")?;
        for gamma in self.gammas() {
            writeln!(text, "    {{ {} }},", gamma.map(|g| format!("{g:?}")).join(", "))?;
        }
        let offsets: Vec<String> =
            (0..self.friction.len()).map(|j| format!("{:?}", self.additions.log_changes.offset(j))).collect();
        writeln!(text, "}};\n\nconst double model_encoder_offset[JOINTS] = {{ {} }};\n", offsets.join(", "))?;
        terms::effects(text, &terms)
    }

    /// What of the model does not move the arm of the FMU.
    fn not_simulated(&self) -> Vec<String> {
        let mut notes = vec![
            "limits are not in it: no joint stops at its end, and no torque is too large".to_string(),
            "time counts as the time since the arm began to work, as cold as it was recorded: it matters to \
             friction that warmth changes"
                .to_string(),
        ];
        for t in self.terms() {
            let why = match t.term.law {
                Law::HotFriction { .. } | Law::HotVelocity { .. } => {
                    "the temperature of the joint is not an input"
                }
                Law::Compliance | Law::HangingBack { .. } => "links do not give way here",
                _ => continue,
            };
            notes.push(format!("left out: joint {}: {}: {why}", t.term.joint + 1, t.effect));
        }
        for (j, delay) in self.additions.log_changes.delay.iter().enumerate().filter(|(_, d)| **d != 0.0) {
            notes.push(format!(
                "left out: joint {}: torque was logged {:.2} ms late; the torque here is that of the motor",
                j + 1,
                1e3 * delay
            ));
        }
        if !self.additions.payloads.is_empty() {
            notes.push("left out: the payload of some logs: this is the bare arm".to_string());
        }
        notes
    }
}

/// A name that C can have.
fn identifier(name: &str) -> String {
    let plain = name.replace(|c: char| !c.is_ascii_alphanumeric() && c != '_', "_");
    match plain.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => plain,
        false => format!("arm_{plain}"),
    }
}
