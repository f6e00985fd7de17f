//! Torques that are not an effect of the library: reported as a formula, and no name is given in their place.

use super::numbered;
use super::plant::{Noise, Truth, arm, record};
use crate::ExplainOptions;
use crate::explain::{Explained, explain_body};
use powerball_logs::log::Log;
use powerball_logs::regression::RigidArm;

/// Clean logs with `torque` N·m added on a joint (from 0), a function of all positions.
fn explained(joint: usize, torque: impl Fn(&[f64]) -> f64) -> Explained {
    let body = RigidArm::new(&arm()).unwrap();
    let mut logs: Vec<Log> = record(body.arm(), Truth::Clean, 0.0, Noise::White, 7, 22.0, 5);
    for log in &mut logs {
        for k in 0..log.t.len() {
            let q: Vec<f64> = log.q.iter().map(|of_joint| of_joint[k]).collect();
            log.torque[joint][k] += torque(&q);
        }
    }
    let (fit, validate) = logs.split_at(5);
    explain_body(&body, fit, validate, &ExplainOptions::default()).unwrap()
}

/// A hose over joints 2 and 3 and a counterweight linkage: the formula is the true one, its coefficients are
/// within four standard errors of it, and nothing is left.
#[test]
fn a_torque_of_two_positions_is_reported_as_its_formula() {
    let hose = explained(1, |q| 6.0 * (q[1] - 0.3) * (q[2] + 0.5));
    let linkage = explained(2, |q| 5.0 * (q[1] + q[2] + 0.4).sin());
    for (explained, joint, starts, true_values) in [
        (&hose, 2, "tau2 = c1·q2·q3 + ", vec![6.0, 3.0, -1.8, -0.9]),
        (
            &linkage,
            3,
            "tau3 = c1·cos(q2 + q3) + c2·sin(q2 + q3)",
            vec![5.0 * 0.4f64.sin(), 5.0 * 0.4f64.cos()],
        ),
    ] {
        assert!(explained.effects.is_empty(), "{:?}", explained.effects);
        let [law] = explained.laws.as_slice() else { panic!("{:?}", explained.laws) };
        assert_eq!(law.joints, numbered(&[joint]));
        assert!(law.formula.starts_with(starts), "{}", law.formula);
        for (coefficient, value) in law.coefficients.iter().zip(true_values) {
            let off = (coefficient.value - value).abs();
            assert!(off < 4.0 * coefficient.std, "{coefficient:?} {value}");
        }
        assert!(law.held_out_change[0] < -0.8, "{:?}", law.held_out_change);
        let (rms, floor) = (explained.after.validate.rms[joint - 1], explained.noise_floor[joint - 1]);
        assert!(rms < 1.3 * floor, "{rms} {floor}");
    }
    // The model computes what was found.
    let terms = &hose.model.additions.terms;
    assert_eq!(terms.len(), 4, "{terms:?}");
    assert!(terms.iter().all(|term| term.effect == "law"));
}

/// Where nothing is missing there is no law, and an effect that has a name keeps it.
#[test]
fn nothing_is_made_a_law_that_is_noise_or_has_a_name() {
    let clean = explained(1, |_| 0.0);
    assert!(clean.laws.is_empty() && clean.effects.is_empty(), "{:?} {:?}", clean.laws, clean.effects);
    let spring = explained(1, |q| 4.0 * (q[1] - 0.2));
    assert!(spring.laws.is_empty(), "{:?}", spring.laws);
    let names: Vec<&str> = spring.effects.iter().map(|e| e.effect.as_str()).collect();
    assert_eq!(names, ["spring"]);
}

/// A smooth bump over two positions is not a name: parts of it look like ripple and a constant torque, and
/// one surface has all of it.
#[test]
fn a_bump_of_two_positions_is_a_surface_and_no_name() {
    let square = |x: f64| x * x;
    let bump = |q: &[f64]| 8.0 * (-(square(q[1] - 0.2) + square(q[2] + 0.3)) / (2.0 * square(0.4))).exp();
    let explained = explained(1, bump);
    assert!(explained.effects.is_empty(), "{:?}", explained.effects);
    let [law] = explained.laws.as_slice() else { panic!("{:?}", explained.laws) };
    assert_eq!(law.joints, numbered(&[2]));
    assert!(law.formula.contains("1.5·q2 + 1.5·q3"), "{}", law.formula);
    let (before, after) = (explained.before.validate.rms[1], explained.after.validate.rms[1]);
    assert!(after < 0.15 * before, "{before} {after}");
}
