//! An inertial parameter that the arm file declares zero and that is not.

use super::words::{Words, list};
use super::{Axis, Candidate, Class, Context, Effect, Found, Part};
use dyngen::arm::Parameter;
use powerball_controller::JointNumber;
use powerball_logs::regression::Column;
use serde::Serialize;

/// The torque column of one declared-zero parameter, which acts on all joints up to its link.
pub(super) struct BrokenSymmetry;

/// Which parameter it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The parameter that is declared zero.
    pub parameter: Parameter,
}

/// Figures of this effect in a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The parameters' names.
    pub parameters: Vec<String>,
    /// The parameters' values, SI units.
    pub values: Vec<f64>,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, words: &Words<'_>) -> String {
        let one =
            |(k, (name, value)): (usize, (&String, &f64))| format!("{name} = {}", words.size(k, *value));
        format!("{} (SI units)", list(self.parameters.iter().zip(&self.values).enumerate().map(one)))
    }
}

impl Effect for BrokenSymmetry {
    fn name(&self) -> &'static str {
        "broken_symmetry"
    }

    fn class(&self) -> Class {
        Class::Position
    }

    fn of_the_body(&self) -> bool {
        true
    }

    fn shown_by(&self, _: &Candidate) -> Axis {
        Axis::Law
    }

    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        a.joints == b.joints && a.settings == b.settings
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let zero = context.data.declared_zero();
        let arm = context.data.body.arm();
        let on = |parameter: &Parameter| {
            // A bar has no joint of its own: the last one that moves it.
            let joint = JointNumber::from_index(arm.last_joint(parameter.link).unwrap_or(0));
            Candidate::on(joint, Settings { parameter: *parameter }, zero.len())
        };
        zero.iter().map(on).collect()
    }

    fn columns(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Column> {
        let Some(Settings { parameter }) = Settings::of(candidate) else { return Vec::new() };
        let place = context.data.declared_zero().iter().position(|zero| zero == parameter);
        let column = place.and_then(|place| context.data.declared_zero_columns().get(place));
        column.cloned().into_iter().collect()
    }

    fn part(&self, _: &Context<'_>, candidate: &Candidate, c: &[f64]) -> Part {
        Settings::of(candidate).map_or(Part::Event, |settings| Part::Parameter(settings.parameter, c[0]))
    }

    fn figures(&self, _: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let name = |f: &Found<'_>| Settings::of(f.candidate).map(|settings| settings.parameter.to_string());
        Figures {
            parameters: found.iter().filter_map(name).collect(),
            values: found.iter().map(|f| f.coefficients[0]).collect(),
        }
        .into()
    }
}
