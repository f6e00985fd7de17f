//! By how much emitted code may be off, of every function.

use crate::arm::{Arm, Joint};
use crate::dynamics::Function;
use crate::rounding::{Bounds, Where};
use serde_json::{Map, Value, json};

/// For which parameters bounds hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterRange {
    /// For given values.
    Values,
    /// For every value from −1 to 1.
    Unit,
}

impl ParameterRange {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            ParameterRange::Values => {
                "the given values; each number of e, f, a direction and a payload within ±1, a payload of \
                 forward_dynamics_with_payload as a body can have it"
            }
            ParameterRange::Unit => {
                "each within ±1 SI unit, as no values are given; so is each number of e, f, a direction and a \
                 payload"
            }
        }
    }
}

/// Bounds of |emitted − exact| of each function, with the minimal set as arguments.
#[derive(Clone, Debug)]
pub struct Rounding {
    /// For which parameters they hold.
    pub parameters: ParameterRange,
    /// Whether they are of code with contraction.
    pub contracted: bool,
    /// Each function with its bounds, or with the limit that the arm file lacks for it.
    pub functions: Vec<(Function, Result<Bounds, String>)>,
}

impl Rounding {
    /// None yet; no bounds are to be had where no joint has limits of its position.
    pub(super) fn of(arm: &Arm, values: Option<&[f64]>, contracted: bool) -> Option<Rounding> {
        let limited = |joint: &Joint| joint.mimic.is_none() && joint.position.is_some();
        let parameters = if values.is_some() { ParameterRange::Values } else { ParameterRange::Unit };
        arm.joints.iter().any(limited).then(|| Rounding { parameters, contracted, functions: Vec::new() })
    }

    /// By function, `f32` and `f64` by output; null with the reason where there is no bound.
    pub(super) fn json(&self) -> Value {
        let of = |(function, bounds): &(Function, Result<Bounds, String>)| {
            let mut object = match bounds {
                Ok(bounds) => json!({"f32": numbers(&bounds.single), "f64": numbers(&bounds.double)}),
                Err(_) => json!({"f32": null, "f64": null}),
            };
            if let Some(poses) = poses_of(bounds) {
                object["where"] = json!({
                    "task_inertia_diagonal_at_most": numbers(&poses.largest_inertia),
                    "share_of_poses": poses.share,
                });
            }
            if let Some(why) = why_unbounded(bounds) {
                object["why"] = json!(why);
            }
            (function.name().to_string(), object)
        };
        Value::Object(self.functions.iter().map(of).collect::<Map<_, _>>())
    }
}

/// The poses for which a function's bounds hold, if that is not all of them.
pub fn poses_of(bounds: &Result<Bounds, String>) -> Option<&Where> {
    let bounds = bounds.as_ref().ok().filter(|bounds| bounds.double.iter().any(|x| x.is_finite()))?;
    bounds.poses.as_ref()
}

/// Why a function has no bound, or one of its outputs has none in `f32`.
pub fn why_unbounded(bounds: &Result<Bounds, String>) -> Option<&str> {
    let is_bounded = |all: &[f64]| all.iter().all(|x| x.is_finite());
    match bounds {
        Err(why) => Some(why),
        Ok(bounds) if is_bounded(&bounds.single) => None,
        Ok(bounds) if is_bounded(&bounds.double) => {
            Some("in f32: its rounding may change B or Λ⁻¹ by more than this proof allows")
        }
        Ok(bounds) if bounds.poses.is_some() => {
            Some("in f32 and f64: rounding may change B or Λ⁻¹ by more than this proof allows")
        }
        Ok(_) => Some("intervals of these states do not exclude a division by zero"),
    }
}

/// JSON has no infinity.
fn numbers(bounds: &[f64]) -> Vec<Value> {
    bounds.iter().map(|x| if x.is_finite() { json!(x) } else { Value::Null }).collect()
}
