//! One of two fits: its values and their errors.

use super::result::CompareError;
use super::strokes::{Stroke, strokes};
use crate::Identified;
use crate::estimate::{
    JointFriction, ParameterEstimate, Uncertainty, distribution::freedom_of, friction_row,
};
use crate::servo::no_torques;
use powerball_controller::friction::TanhFriction;
use powerball_logs::log::Log;
use serde::Deserialize;
use std::path::Path;

/// A fit that is compared with another one.
#[derive(Clone, Debug)]
pub struct Side {
    /// The side's name in messages.
    pub name: String,
    /// The arm's name.
    pub arm: String,
    /// The names of its bars of closed loops; empty where the fit does not give them.
    pub bars: Vec<String>,
    /// The minimal set.
    pub parameters: Vec<ParameterEstimate>,
    /// Friction by joint.
    pub friction: Vec<JointFriction>,
    /// How well all of it is known together; without it the standard errors count one by one.
    pub uncertainty: Option<Uncertainty>,
    /// The strokes of its log by joint; nothing where it is not a fit of one log.
    pub strokes: Vec<Vec<Stroke>>,
    /// Why it should not be used, each a sentence without its full stop; empty where it may be.
    pub unusable: Vec<String>,
}

/// The part of `identified.json` or `model.json` that is read.
#[derive(Deserialize)]
struct File {
    arm: String,
    #[serde(default)]
    bars: Vec<String>,
    parameters: Vec<ParameterEstimate>,
    friction: Vec<JointFriction>,
    #[serde(default)]
    unusable: Vec<String>,
}

/// Degrees of freedom where none are given.
const MANY: f64 = 1000.0;

impl Side {
    /// The result of an identification.
    #[must_use]
    pub fn of(name: &str, identified: &Identified) -> Side {
        Side {
            name: name.to_string(),
            arm: identified.arm.clone(),
            bars: identified.bars.clone(),
            parameters: identified.parameters.clone(),
            friction: identified.friction.clone(),
            uncertainty: Some(identified.uncertainty.clone()),
            strokes: Vec::new(),
            unusable: identified.unusable.clone(),
        }
    }

    /// This side with the log that was fitted, so that friction can be compared along it if the other side
    /// runs the same path.
    #[must_use]
    pub fn along(mut self, log: &Log) -> Side {
        self.strokes = strokes(log);
        self
    }

    /// Reads the result of `powerball identify`: its folder, or `identified.json` in it, or another model of
    /// that form.
    ///
    /// # Errors
    /// [`CompareError::Unreadable`].
    pub fn read(path: &Path) -> Result<Side, CompareError> {
        let name = path.display().to_string();
        let wrong =
            |file: &Path, what: String| CompareError::Unreadable(format!("{}: {what}", file.display()));
        let file = if path.is_dir() { path.join("identified.json") } else { path.to_path_buf() };
        let text = dyngen::file::text(&file).map_err(|e| wrong(&file, format!("cannot be read: {e}")))?;
        if let Some(why) = serde_json::from_str(&text).ok().and_then(|json| no_torques(&json)) {
            return Err(wrong(&file, why));
        }
        let model: File = serde_json::from_str(&text)
            .map_err(|e| wrong(&file, format!("is not a result of `powerball identify`: {e}")))?;
        let covariance = file.with_file_name("covariance.json");
        let own = file.file_name().is_some_and(|name| name == "identified.json");
        let uncertainty = match std::fs::read(&covariance) {
            Ok(bytes) if own => {
                let read: Uncertainty = serde_json::from_slice(&bytes)
                    .map_err(|e| wrong(&covariance, format!("cannot be used: {e}")))?;
                let same = read.parameters.iter().eq(model.parameters.iter().map(|p| &p.name));
                if !(same && read.joints == model.friction.len() && read.is_whole()) {
                    return Err(wrong(&covariance, "does not fit identified.json: identify again".into()));
                }
                Some(read)
            }
            _ => None,
        };
        let File { arm, bars, parameters, friction, unusable } = model;
        Ok(Side { name, arm, bars, parameters, friction, uncertainty, strokes: Vec::new(), unusable })
    }

    /// The covariance of two parameters of the minimal set.
    pub(super) fn covariance(&self, a: usize, b: usize) -> f64 {
        match &self.uncertainty {
            Some(all) => all.covariance(a, b),
            None if a == b => self.parameters[a].std.map_or(0.0, |std| std * std),
            None => 0.0,
        }
    }

    /// The degrees of freedom of a parameter's error; `None` where it is not determined.
    pub(super) fn freedom(&self, parameter: usize) -> Option<f64> {
        let p = &self.parameters[parameter];
        let std = p.std.filter(|std| *std > 0.0)?;
        match &self.uncertainty {
            Some(all) => Some(all.freedom[parameter]).filter(|freedom| *freedom > 0.0),
            None => Some(p.interval.map_or(MANY, |[low, high]| freedom_of(0.5 * (high - low) / std))),
        }
    }

    /// The rms velocity of a joint in the fitted logs, where it is known and not 0.
    pub(super) fn velocity(&self, joint: usize) -> Option<f64> {
        let all = self.uncertainty.as_ref()?;
        let path = &all.path[joint];
        let at = path.columns.iter().position(|c| *c == all.friction(joint, 2))?;
        Some(path.products[at][at].sqrt()).filter(|v| *v > 0.0)
    }

    /// Whether anything is known of a joint's friction.
    pub(super) fn knows_friction(&self, joint: usize) -> bool {
        self.friction[joint].std.iter().any(Option::is_some)
    }

    fn shape(&self, joint: usize) -> [f64; 2] {
        let f = &self.friction[joint];
        [f.gamma2, f.gamma4]
    }

    /// The friction of a joint at a velocity, its variance, and the degrees of freedom of that.
    pub(super) fn friction_at(&self, joint: usize, velocity: f64) -> (f64, f64, f64) {
        let gamma = self.friction[joint].gamma();
        let value = TanhFriction::new(gamma).torque(velocity);
        match &self.uncertainty {
            Some(all) => {
                let variance = self.friction_covariance(joint, &[velocity]).map_or(0.0, |c| c[0][0]);
                let freedom = (0..5)
                    .map(|k| all.freedom[all.friction(joint, k)])
                    .filter(|f| *f > 0.0)
                    .fold(MANY, f64::min);
                (value, variance, freedom)
            }
            None => {
                // The correlation of the errors is unknown: the worst case is taken.
                let [g1, g2, g3, g4, g5] = self.friction[joint].std.map(|std| std.unwrap_or(0.0));
                let relative = |std: f64, gamma: f64| if gamma > 0.0 { std / gamma } else { 0.0 };
                let row = friction_row(self.shape(joint), velocity);
                let own = [g1, g3, g5, gamma[0] * relative(g2, gamma[1]), gamma[2] * relative(g4, gamma[3])];
                let std: f64 = own.iter().zip(row).map(|(std, row)| std * row.abs()).sum();
                (value, std * std, MANY)
            }
        }
    }

    /// The covariance of a joint's friction at some velocities; `None` where only standard errors are known.
    pub(super) fn friction_covariance(&self, joint: usize, velocities: &[f64]) -> Option<Vec<Vec<f64>>> {
        let all = self.uncertainty.as_ref()?;
        let at = |k: usize| all.friction(joint, k);
        let rows: Vec<_> = velocities.iter().map(|v| friction_row(self.shape(joint), *v)).collect();
        let of = |a: &[f64; 5], b: &[f64; 5]| -> f64 {
            let terms = (0..5).flat_map(|i| (0..5).map(move |k| (i, k)));
            terms.map(|(i, k)| a[i] * b[k] * all.covariance(at(i), at(k))).sum()
        };
        let mut covariance: Vec<Vec<f64>> =
            rows.iter().map(|a| rows.iter().map(|b| of(a, b)).collect()).collect();
        covariance.iter_mut().enumerate().for_each(|(k, row)| row[k] = row[k].max(0.0));
        Some(covariance)
    }

    /// The constant torque of a joint, its variance and the degrees of freedom of that, where it was fitted.
    pub(super) fn constant(&self, joint: usize) -> Option<(f64, f64, f64)> {
        let all = self.uncertainty.as_ref()?;
        let at = all.constant(joint)?;
        let freedom = Some(all.freedom[at]).filter(|f| *f > 0.0)?;
        Some((self.friction[joint].offset?, all.covariance(at, at), freedom))
    }
}
