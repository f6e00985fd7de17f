//! Logs of several mountings of the virtual arm, whose dynamics are Newton and Euler's.

use super::plant::{record_mounted, sensors};
use crate::estimate::{
    Estimates, FrictionKind, ResidualStats, Solution, Together, estimates, reduce_in_bands, solve_in_band,
    standard_errors,
};
use crate::mounting::Mounting;
use crate::{IdentifyOptions, Source, identify};
use dyngen::SetKind;
use nalgebra::Vector3;
use powerball_logs::log::Log;
use powerball_logs::regression::{DataOptions, RigidArm};
use powerball_logs::summary::Bands;
use powerball_virtual_arm::{Body, lwa4p};

const LAW: FrictionKind = FrictionKind::Symmetric;

/// The virtual arm's links with the second one's centre 4 cm further along its z: the moments whose sum only
/// one mounting sees would cancel else.
fn links() -> Vec<Body> {
    let mut links = lwa4p::links();
    links[1] = links[1].moved(Vector3::new(0.0, 0.0, 0.04));
    links
}

/// Logs as the base stood, reduced for the mounting that is stated.
fn reduced(stood: &str, stated: &str, seed: u64, still: &[usize]) -> (RigidArm, Bands) {
    let arm = lwa4p::arm().unwrap();
    let [stood, stated] = [stood, stated].map(|text| text.parse::<Mounting>().unwrap());
    let body = RigidArm::mounted(&stated.of(&arm).unwrap(), &arm).unwrap();
    let options = DataOptions::default();
    let mut bands = Bands::new(&body, &options);
    let logs: Vec<Log> = record_mounted(stood.gravity(&arm), links(), &sensors(), 2, 4, seed, still);
    for log in &logs {
        bands.merge(&reduce_in_bands(&body, log, &options).unwrap().0).unwrap();
    }
    (body, bands)
}

fn together(parts: &[(RigidArm, Bands)]) -> Together {
    Together::new(&parts.iter().map(|(body, bands)| (body, bands)).collect::<Vec<_>>()).unwrap()
}

fn fitted(all: &Together) -> (Estimates, Solution, Vec<ResidualStats>, Vec<Vec<usize>>) {
    let found = solve_in_band(&all.bands, LAW);
    let identified = estimates(all.body.names(), &found.solution, &standard_errors(&found.solution));
    let errors = all.errors(&found.solution, &found.bands).unwrap();
    let contradictions = all.contradictions(&errors, &found.bands, LAW);
    (identified, found.solution, errors, contradictions)
}

/// Upright only a sum of Ixz2 and of moments is seen; with the base on its side as well, all of them apart.
#[test]
fn two_mountings_determine_what_one_does_not() {
    let parts = [reduced("filed", "filed", 1, &[]), reduced("90,0", "90,0", 2, &[])];
    let all = together(&parts);
    let (found, solution, errors, contradictions) = fitted(&all);
    let links: Vec<f64> = links().iter().flat_map(Body::parameters).collect();
    let truth = all.body.model().set_values(all.body.model().set(SetKind::Minimal).unwrap(), &links);
    let upright = parts[0].0.names();
    let mut unseen = 0;
    for (estimate, truth) in found.parameters.iter().zip(&truth) {
        let miss = (estimate.value - truth).abs() / estimate.std.unwrap();
        assert!(miss < 4.0, "{}: {miss} standard errors", estimate.name);
        if !upright.contains(&estimate.name) {
            let [low, high] = estimate.interval.unwrap();
            assert!(low <= *truth && *truth <= high, "{}", estimate.name);
            if estimate.name == "mz2 + my3" {
                assert!(truth.abs() > 20.0 * estimate.std.unwrap(), "next to nothing: {truth}");
            }
            unseen += 1;
        }
    }
    assert_eq!((found.parameters.len(), upright.len(), unseen), (24, 23, 2));
    assert!(contradictions.iter().all(Vec::is_empty), "{contradictions:?}");
    // In the columns of the set that both have in common the logs of one mounting are fitted as in their own.
    let alone = solve_in_band(&parts[0].1, LAW).solution;
    let own = alone.mean_squares(1, &alone.theta).0.sqrt();
    approx::assert_relative_eq!(errors[0].rms[1], own, max_relative = 0.02);
    assert_eq!(solution.inertial().len(), 24);
}

/// A joint that moves in one mounting alone has its friction from there.
#[test]
fn friction_comes_from_the_mounting_in_which_a_joint_moves() {
    let all = together(&[reduced("filed", "filed", 3, &[1]), reduced("90,0", "90,0", 4, &[])]);
    let (found, ..) = fitted(&all);
    let friction = &lwa4p::plant().unwrap().friction()[1].clone();
    let f = &found.friction[1];
    let law =
        powerball_controller::friction::TanhFriction::new([f.gamma1, f.gamma2, f.gamma3, f.gamma4, f.gamma5]);
    for velocity in [0.1, 0.3, 0.6] {
        approx::assert_relative_eq!(law.torque(velocity), friction.torque(velocity), max_relative = 0.03);
    }
}

/// A mounting that is stated wrongly is reported.
#[test]
fn a_wrong_mounting_contradicts_the_others() {
    let right = reduced("filed", "filed", 1, &[]);
    let own = solve_in_band(&right.1, LAW);
    let own = crate::estimate::stats_of(&own.solution, &own.solution.theta);
    let (_, _, errors, contradictions) = fitted(&together(&[right, reduced("90,0", "0,90", 2, &[])]));
    assert!(contradictions.iter().any(|joints| !joints.is_empty()));
    assert!(errors[1].rms[1] > 5.0 * own.rms[1], "{:?} {:?}", errors[1].rms, own.rms);
}

/// The torque columns of two joints are exchanged in the logs of the second mounting alone: its warning says
/// so.
#[test]
fn columns_that_are_exchanged_in_one_mounting_are_named() {
    let arm = lwa4p::arm().unwrap();
    let mounting: Mounting = "90,0".parse().unwrap();
    let mut sources: Vec<Source<'_>> = Vec::new();
    for (stood, seed) in [(Mounting::Filed, 1), (mounting, 2)] {
        for mut log in record_mounted(stood.gravity(&arm), links(), &sensors(), 2, 4, seed, &[]) {
            if stood == mounting {
                log.torque.swap(1, 2);
            }
            sources.push(Source::from(log).mounted(stood));
        }
    }
    let found = identify(&arm, sources, Vec::<Source<'_>>::new(), &IdentifyOptions::default()).unwrap();
    let warning = found.warnings.iter().find(|w| w.starts_with("the logs with the base rolled by 90°"));
    let text = warning.unwrap_or_else(|| panic!("{:?}", found.warnings));
    assert!(text.contains("The torque columns of joints 2 and 3 are exchanged"), "{text}");
}
