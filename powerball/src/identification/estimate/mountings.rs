//! Logs of an arm whose base was mounted in several ways: one parameter vector for all of them.
//!
//! Each log is reduced under the gravity that it was recorded with, in the minimal set of that gravity. Under
//! gravity in a general direction an arm has a set that determines those of all its mountings: their
//! parameters are combinations of its ones. Factors are put into its columns and joined there, so that a
//! summary need not know which others it will meet.
//!
//! Also here: torque columns that were exchanged between joints, or have the wrong sign.

use super::estimates::ResidualStats;
use super::reduced::{Solution, solve_reduced};
use super::{FrictionKind, stats_of};
use crate::identification::mounting::together;
use crate::logs::log::Log;
use crate::logs::regression::{DataOptions, RigidArm};
use crate::logs::summary::{Bands, Summary, SummaryError};
use dyngen::Arm;

/// The logs of several mountings in one set.
#[derive(Debug)]
pub struct Together {
    /// The arm under gravity in a general direction.
    pub body: RigidArm,
    /// All logs.
    pub bands: Bands,
    /// Those of each mounting, in the same set.
    pub each: Vec<Bands>,
}

/// Left by the fit to all mountings, over what a fit to one alone leaves of its logs, from which on they
/// contradict each other.
const CONTRADICTS: f64 = 2.0;

impl Together {
    /// Joins logs that were reduced under the gravity of their mounting.
    ///
    /// # Errors
    /// Why they are no logs of one arm, or why its set is not to be had.
    pub fn new(mountings: &[(&RigidArm, &Bands)]) -> Result<Together, String> {
        let arms: Vec<&Arm> = mountings.iter().map(|(body, _)| body.arm()).collect();
        let general = together(&arms)?;
        let filed = mountings.first().map(|(body, _)| body.filed()).ok_or("no mounting was given")?;
        let body = RigidArm::mounted(&general, &filed).map_err(|e| e.to_string())?;
        let undetermined =
            || "gravity between the mountings does not determine what they determine".to_string();
        let in_set = |(own, bands): &(&RigidArm, &Bands)| bands.in_set(own, &body).ok_or_else(undetermined);
        let each = mountings.iter().map(in_set).collect::<Result<Vec<_>, _>>()?;
        let mut all = each.iter().cloned();
        let mut bands = all.next().ok_or_else(undetermined)?;
        all.try_for_each(|other| bands.merge(&other)).map_err(|e| e.to_string())?;
        Ok(Together { body, bands, each })
    }

    /// What a fit to all logs leaves of each mounting's.
    ///
    /// # Errors
    /// As [`Solution::on`].
    pub fn spreads(
        &self,
        solution: &Solution,
        in_band: &[usize],
    ) -> Result<Vec<ResidualStats>, SummaryError> {
        let of = |bands: &Bands| {
            let on = solution.on(&bands.of_joints(in_band))?;
            Ok(stats_of(&on, &on.theta))
        };
        self.each.iter().map(of).collect()
    }

    /// The joints, from 1, on which one parameter vector leaves far more of the logs of a mounting than a
    /// vector of their own does, by mounting: its mounting or another one's is told wrong, or the arm was not
    /// the same.
    #[must_use]
    pub fn contradictions(
        &self,
        spreads: &[ResidualStats],
        in_band: &[usize],
        law: FrictionKind,
    ) -> Vec<Vec<usize>> {
        let of = |(bands, together): (&Bands, &ResidualStats)| {
            let alone = solve_reduced(&bands.of_joints(in_band), law);
            let alone = stats_of(&alone, &alone.theta);
            (1..=alone.rms.len()).filter(|j| together.rms[j - 1] > CONTRADICTS * alone.rms[j - 1]).collect()
        };
        self.each.iter().zip(spreads).map(of).collect()
    }
}

// Torque columns that were exchanged between joints, or have the wrong sign: where the fit is bad, and is
// good with them put right.

/// A joint whose error is more than this share of its torque is suspected.
const SUSPECT: f64 = 0.3;
/// Put right, its error falls below this share of what it was.
const RIGHT: f64 = 0.5;

/// What is wrong with the torques of the logs, in words; `None` where nothing is suspected, or no exchange of
/// two joints and no change of one sign corrects it. `found` are the errors of the fit to them.
#[must_use]
pub fn exchanged(
    body: &RigidArm,
    logs: &[Log],
    options: &DataOptions,
    found: &ResidualStats,
) -> Option<String> {
    let suspects: Vec<usize> = (0..body.dof()).filter(|j| found.relative[*j] > SUSPECT).collect();
    let changes = suspects.iter().enumerate().flat_map(|(k, j)| suspects[k..].iter().map(|l| (*j, *l)));
    let mut best: Option<(f64, (usize, usize))> = None;
    for (j, k) in changes {
        let mut changed: Vec<Log> = logs.to_vec();
        for log in &mut changed {
            match j == k {
                true => log.torque[j].iter_mut().for_each(|tau| *tau = -*tau),
                false => log.torque.swap(j, k),
            }
        }
        let mut summary = Summary::new(body, options);
        for log in &changed {
            // What cannot be used was said before.
            let _ = summary.push(body, log, options);
        }
        let solution = solve_reduced(&summary, FrictionKind::Symmetric);
        let errors = stats_of(&solution, &solution.theta);
        let share = [j, k].map(|i| errors.relative[i] / found.relative[i]).into_iter().fold(0.0, f64::max);
        if share < RIGHT && best.is_none_or(|(least, _)| share < least) {
            best = Some((share, (j, k)));
        }
    }
    best.map(|(share, (j, k))| match j == k {
        true => format!(
            "joint {}: its torque seems to have the wrong sign: with the other sign its error falls to {:.0} \
                % of what it is. Check the log; nothing was changed",
            j + 1,
            100.0 * share
        ),
        false => format!(
            "the torques of joints {} and {} seem to be exchanged: put right, both errors fall to {:.0} % of \
                what they are or less. Check the columns of the logs; nothing was changed",
            j + 1,
            k + 1,
            100.0 * share
        ),
    })
}

#[cfg(test)]
#[cfg(feature = "virtual-arm")]
mod exchanged_tests {
    use super::*;
    use crate::identification::excite::{Settings, optimise};
    use crate::virtual_arm::lwa4p;
    use dyngen::SetKind;

    #[test]
    fn exchanged_torques_and_wrong_signs_are_named_and_sound_ones_are_not() {
        let body = RigidArm::new(&lwa4p::arm().unwrap()).unwrap();
        let settings = Settings { evaluations: 60, ..Settings::default() };
        let path = optimise(body.model(), SetKind::Minimal, &settings).unwrap().paths.swap_remove(0);
        let sound = lwa4p::plant().unwrap().record(&path.sample(200.0), 0.0, 5).log("made.csv");
        let options = DataOptions::default();
        let said = |log: &Log| {
            let mut summary = Summary::new(&body, &options);
            summary.push(&body, log, &options).unwrap();
            let solution = solve_reduced(&summary, FrictionKind::Symmetric);
            exchanged(&body, std::slice::from_ref(log), &options, &stats_of(&solution, &solution.theta))
        };
        assert_eq!(said(&sound), None);
        for (j, k) in [(1, 2), (0, 3), (2, 4)] {
            let mut wrong = sound.clone();
            wrong.torque.swap(j, k);
            let names = format!("the torques of joints {} and {} seem to be exchanged", j + 1, k + 1);
            assert!(said(&wrong).is_some_and(|said| said.starts_with(&names)), "{names}: {:?}", said(&wrong));
        }
        let mut wrong = sound.clone();
        wrong.torque[1].iter_mut().for_each(|tau| *tau = -*tau);
        assert!(
            said(&wrong)
                .is_some_and(|said| said.starts_with("joint 2: its torque seems to have the wrong sign"))
        );
    }
}
