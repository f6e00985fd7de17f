//! Names of an arm's items in languages without modules.

use crate::dynamics::Function;

/// How an arm's things are called.
pub(super) struct Names {
    /// Before every name.
    pub(super) prefix: String,
    /// Before every macro.
    pub(super) upper: String,
}

impl Names {
    /// The arm's name in lowercase letters, digits and `_`; `arm_` before a digit.
    pub(super) fn new(arm: &str) -> Names {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' };
        let text: String = arm.chars().map(plain).collect();
        let mut prefix = text.split_whitespace().collect::<Vec<_>>().join("_");
        if !prefix.starts_with(|c: char| c.is_ascii_lowercase()) {
            prefix = format!("arm_{prefix}").trim_end_matches('_').to_string();
        }
        Names { upper: prefix.to_uppercase(), prefix }
    }

    /// At a frame its name stands between the prefix and the function's name.
    pub(super) fn function(&self, frame: Option<&str>, function: Function) -> String {
        let within = frame.map(|frame| format!("{frame}_")).unwrap_or_default();
        format!("{}_{within}{function}", self.prefix)
    }

    /// What the documentation in Rust says, with the names in C.
    pub(super) fn words(&self, text: &str) -> String {
        let names = [
            ("[`PARAMETER_NAMES`]", "`NAME_parameter_names`"),
            ("[`friction_columns`]", "`NAME_friction_columns`"),
            ("`MOTOR_VELOCITIES[", "`NAME_motor_velocities["),
        ];
        names
            .iter()
            .fold(text.to_string(), |text, (rust, c)| text.replace(rust, &c.replace("NAME", &self.prefix)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_begin_with_the_arm_s() {
        let prefix = |arm: &str| Names::new(arm).prefix;
        assert_eq!(prefix("Schunk Powerball LWA 4P"), "schunk_powerball_lwa_4p");
        assert_eq!(prefix("2R (planar)"), "arm_2r_planar");
        assert_eq!((prefix("ärm-7"), prefix("腕")), ("rm_7".to_string(), "arm".to_string()));
    }
}
