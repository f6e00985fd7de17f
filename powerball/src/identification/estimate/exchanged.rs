//! Torque columns that were exchanged between joints, or have the wrong sign: where the fit is bad, and is
//! good with them put right.

use super::{FrictionKind, ResidualStats, solve_reduced, stats_of};
use crate::logs::log::Log;
use crate::logs::regression::{DataOptions, RigidArm};
use crate::logs::summary::Summary;

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
mod tests {
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
