//! Logs of an arm whose base was mounted in several ways: one parameter vector for all of them.
//!
//! Each log is reduced under the gravity that it was recorded with, in the minimal set of that gravity. Under
//! gravity in a general direction an arm has a set that determines those of all its mountings: their
//! parameters are combinations of its parameters. Factors are converted to its columns and joined there, so
//! that a summary need not know which others it will meet.

use super::estimates::ResidualStats;
use super::reduced::{Solution, solve_reduced};
use super::{FrictionKind, stats_of};
use crate::mounting::together;
use dyngen::Arm;
use powerball_logs::regression::RigidArm;
use powerball_logs::summary::{Bands, SummaryError};

/// The logs of several mountings in one set.
#[derive(Debug)]
pub struct Together {
    /// The arm under gravity in a general direction.
    pub body: RigidArm,
    /// All logs.
    pub bands: Bands,
    /// The logs of each mounting, in the same set.
    pub each: Vec<Bands>,
}

/// Ratio of the residual of the fit to all mountings and that of a fit to one alone, from which on the
/// mountings contradict each other.
const CONTRADICTS: f64 = 2.0;

impl Together {
    /// Joins logs that were reduced under the gravity of their mounting.
    ///
    /// # Errors
    /// Why they are not logs of one arm, or why its set cannot be derived.
    pub fn new(mountings: &[(&RigidArm, &Bands)]) -> Result<Together, String> {
        let arms: Vec<&Arm> = mountings.iter().map(|(body, _)| body.arm()).collect();
        let general = together(&arms)?;
        let filed = mountings.first().map(|(body, _)| body.filed()).ok_or("no mounting was given")?;
        let body = RigidArm::mounted(&general, &filed).map_err(|e| e.to_string())?;
        let undetermined = || {
            "gravity between the mountings does not determine the parameters that each mounting determines"
                .to_string()
        };
        let in_set = |(own, bands): &(&RigidArm, &Bands)| bands.in_set(own, &body).ok_or_else(undetermined);
        let each = mountings.iter().map(in_set).collect::<Result<Vec<_>, _>>()?;
        let mut all = each.iter().cloned();
        let mut bands = all.next().ok_or_else(undetermined)?;
        all.try_for_each(|other| bands.merge(&other)).map_err(|e| e.to_string())?;
        Ok(Together { body, bands, each })
    }

    /// The residuals of a fit to all logs, for the logs of each mounting.
    ///
    /// # Errors
    /// The errors of [`Solution::on`].
    pub fn errors(&self, solution: &Solution, in_band: &[usize]) -> Result<Vec<ResidualStats>, SummaryError> {
        let of = |bands: &Bands| {
            let on = solution.on(&bands.of_joints(in_band))?;
            Ok(stats_of(&on, &on.theta))
        };
        self.each.iter().map(of).collect()
    }

    /// The joints, from 1, on which one parameter vector has a far larger residual on the logs of a mounting
    /// than a separate vector, by mounting: its mounting or another one is stated wrongly, or the arm was not
    /// the same.
    #[must_use]
    pub fn contradictions(
        &self,
        errors: &[ResidualStats],
        in_band: &[usize],
        law: FrictionKind,
    ) -> Vec<Vec<usize>> {
        let of = |(bands, together): (&Bands, &ResidualStats)| {
            let alone = solve_reduced(&bands.of_joints(in_band), law);
            let alone = stats_of(&alone, &alone.theta);
            (1..=alone.rms.len()).filter(|j| together.rms[j - 1] > CONTRADICTS * alone.rms[j - 1]).collect()
        };
        self.each.iter().zip(errors).map(of).collect()
    }
}
