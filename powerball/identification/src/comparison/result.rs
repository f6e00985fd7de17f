//! Input and result of a comparison.

use serde::Serialize;

/// All settings of [`compare`](super::compare).
#[derive(Clone, Debug)]
pub struct CompareOptions {
    /// Share of comparisons in which equal arms may be called different.
    pub level: f64,
}

impl Default for CompareOptions {
    fn default() -> Self {
        CompareOptions { level: 0.01 }
    }
}

/// Two fits side by side; as JSON it is `comparison.json`. Differences are `b` less `a`; intervals hold all
/// at once.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The one.
    pub a: String,
    /// The other.
    pub b: String,
    /// The arm's name.
    pub arm: String,
    /// Whether they differ beyond what their errors explain.
    pub differ: bool,
    /// Share of comparisons in which equal arms are called different.
    pub level: f64,
    /// How many numbers were compared.
    pub comparisons: usize,
    /// The minimal set, as far as both determine it.
    pub parameters: Vec<ParameterDifference>,
    /// Friction curves, joint by joint.
    pub friction: Vec<FrictionDifference>,
    /// Constant torques, where both laws have them.
    pub constants: Vec<ConstantDifference>,
    /// The differences in torque along the logs of `a`, joint by joint.
    pub torque_difference: Vec<TorqueDifference>,
    /// The causes that would explain the differences.
    pub causes: Vec<Cause>,
    /// All of it in words.
    pub sentence: String,
    /// Why it should not be used, each a sentence without its full stop; empty where it may be.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unusable: Vec<String>,
    /// Warnings about the fits.
    pub warnings: Vec<String>,
}

/// One parameter of the minimal set.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterDifference {
    /// The parameter's name: its sum of parameters.
    pub name: String,
    /// The value in `a`, SI units.
    pub a: f64,
    /// The value in `b`.
    pub b: f64,
    /// b − a.
    pub difference: f64,
    /// Interval of the difference.
    pub interval: [f64; 2],
    /// How often equal arms would differ so in this parameter.
    pub p_value: f64,
    /// Whether it differs.
    pub differs: bool,
}

/// The friction of one joint.
#[derive(Clone, Debug, Serialize)]
pub struct FrictionDifference {
    /// Joint, from 1.
    pub joint: usize,
    /// Velocities at which the curves are compared, rad/s or m/s: shares of the rms velocity of the logs.
    pub velocities: Vec<f64>,
    /// Friction there in `a`, N·m or N.
    pub a: Vec<f64>,
    /// The values in `b`.
    pub b: Vec<f64>,
    /// b − a.
    pub difference: Vec<f64>,
    /// Intervals of the differences.
    pub interval: Vec<[f64; 2]>,
    /// Interval of (b − a)/a: for two logs of one path its mean along it, else at the velocity at which the
    /// difference is most certain, or at the fastest one if only the slope shows a difference.
    pub change: [f64; 2],
    /// How often equal arms would differ so in the curve.
    pub p_value: f64,
    /// Whether it differs.
    pub differs: bool,
}

/// The constant torque of one joint.
#[derive(Clone, Debug, Serialize)]
pub struct ConstantDifference {
    /// Joint, from 1.
    pub joint: usize,
    /// The joint's constant torque in `a`, N·m or N.
    pub a: f64,
    /// The value in `b`.
    pub b: f64,
    /// b − a.
    pub difference: f64,
    /// Interval of the difference.
    pub interval: [f64; 2],
    /// How often equal arms would differ so in it.
    pub p_value: f64,
    /// Whether it differs.
    pub differs: bool,
}

/// The difference of two models in the torque of one joint, along the logs of `a`.
#[derive(Clone, Debug, Serialize)]
pub struct TorqueDifference {
    /// Joint, from 1.
    pub joint: usize,
    /// rms of the difference, N·m or N.
    pub rms: f64,
    /// Expected value of the difference from the errors of both fits alone.
    pub expected: f64,
    /// rms of the difference over the rms of the measured torque.
    pub relative: f64,
}

impl TorqueDifference {
    /// The difference in words.
    #[must_use]
    pub fn in_words(&self) -> String {
        let TorqueDifference { joint, rms, expected, relative } = self;
        let torque = rms / relative;
        if *expected > torque {
            return format!(
                "joint {joint}: its torque along the logs of A is not determined by the two fits"
            );
        }
        format!(
            "joint {joint}: the torques of the two models differ by {rms:.3} N·m rms along the logs of A, \
             {:.1} % of the torque; errors of the fits alone give about {expected:.3} N·m",
            100.0 * relative
        )
    }
}

/// One reason for a difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "cause", rename_all = "snake_case")]
pub enum Cause {
    /// Another body on a link, or on a bar of a closed loop.
    Payload {
        /// The link, from 1: the last where the difference is as well one of it. A bar by its number after
        /// the links, where no link explains the difference as well.
        link: usize,
        /// The bar's name; its number where the fit does not give one. `None` for a link.
        #[serde(skip_serializing_if = "Option::is_none")]
        bar: Option<String>,
        /// How much heavier `b` is, kg, and its standard error, if the logs determine it.
        mass: Option<[f64; 2]>,
        /// The size of the difference of first moments about the link's frame, kg·m: of the parts that the
        /// logs determine.
        first_moment: f64,
        /// All of it, where it is on the last link and the logs determine mass and centre.
        body: Option<Body>,
    },
    /// Inertial parameters differ, and not as a body on one link would make them.
    Inertia {
        /// Which.
        parameters: Vec<String>,
    },
    /// Friction changed.
    Friction {
        /// Joint, from 1.
        joint: usize,
        /// Relative change, from and to.
        change: [f64; 2],
    },
    /// The zero of a torque sensor or a constant torque changed.
    SensorZero {
        /// Joint, from 1.
        joint: usize,
        /// N·m or N, from and to.
        change: [f64; 2],
    },
    /// Friction differs on most joints and nothing else does: another unit of the same kind, or another
    /// temperature.
    AnotherUnit,
}

/// A rigid body on the last link.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Body {
    /// Mass, kg.
    pub mass: f64,
    /// Standard error of the mass, kg.
    pub mass_std: f64,
    /// Centre of mass in the last link's frame of the arm file's table, m.
    pub com: [f64; 3],
    /// Tensor of inertia about the centre of mass along the axes of that frame, kg·m²: xx, xy, xz, yy, yz,
    /// zz. `None` where the logs do not determine all of it.
    pub inertia: Option<[f64; 6]>,
    /// Standard errors of these.
    pub inertia_std: Option<[f64; 6]>,
}

/// Why two fits cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// A file cannot be read or is not a fit.
    #[error("{0}")]
    Unreadable(String),
    /// The fits are of different arms or parameter sets.
    #[error("{0}")]
    Different(String),
    /// The fits have no standard errors in common.
    #[error("{0}")]
    NoErrors(String),
    /// A setting out of its range.
    #[error("{0}")]
    Setting(String),
}
