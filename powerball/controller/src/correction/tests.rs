//! The laws against their documentation.

use super::*;

fn along(law: Law<f64>, q: &[f64]) -> Vec<f64> {
    let mut memory = Memory::default();
    let now =
        |q| Instant { q, dq: &[], ddq: &[], rigid: &[2.0], friction: &[], temperature: &[], running: 0.0 };
    q.iter().map(|x| law.value(0, &now(std::slice::from_ref(x)), &mut memory)).collect()
}

/// Wound fully one way and back by δ the state is 1 − 2·(1 − 1/e), whatever the step.
#[test]
fn the_presliding_state_winds_up_over_its_distance_whatever_the_step() {
    let path = |steps: usize| -> Vec<f64> {
        let up = (0..=steps).map(|k| k as f64 / steps as f64 * 0.1);
        let down = (1..=steps).map(|k| 0.1 - k as f64 / steps as f64 * 0.01);
        up.chain(down).collect()
    };
    for steps in [10, 1000] {
        let z = along(Law::Presliding { distance: 0.01 }, &path(steps));
        assert_eq!(z[0], 0.0);
        assert!((z[steps] - 1.0).abs() < 1e-3);
        approx::assert_abs_diff_eq!(z[2 * steps], -1.0 + 2.0 * (-1.0f64).exp(), epsilon = 1e-3);
    }
}

#[test]
fn the_gap_is_crossed_once_after_each_reversal() {
    let q: Vec<f64> = (0..=100).map(|k| 0.01 * f64::from(50 - (k - 50i32).abs())).collect();
    let torque = along(Law::Gap { gap: 0.055 }, &q);
    assert!(torque[..51].iter().all(|x| *x == 0.0), "no gap before the first reversal");
    assert_eq!(torque[51..].iter().filter(|x| **x == -2.0).count(), 5);
    assert!(torque[60..].iter().all(|x| *x == 0.0));
}

/// Under a load of 2 N·m that turns, 0.04 N·m·s² take √(2·0.04/2) s; what the motor did not feel on the way
/// comes back at once at the other flank, and nothing more comes while the load presses the link to it.
#[test]
fn a_link_flies_through_its_play_in_the_time_of_its_fall_and_is_stopped_with_its_momentum() {
    let rate = 1000.0;
    let law = Law::Flight { reach: 0.04 };
    let mut memory = Memory::default();
    let torque: Vec<f64> = (0..1000)
        .map(|k| {
            let load = [if k < 400 { 2.0 } else { -2.0 }];
            let running = f64::from(k) / rate;
            let now =
                Instant { q: &[], dq: &[], ddq: &[], rigid: &load, friction: &[], temperature: &[], running };
            law.value(0, &now, &mut memory)
        })
        .collect();
    assert!(torque[..400].iter().all(|x| *x == 0.0), "the link is pressed to its flank");
    let flying = torque.iter().filter(|x| **x == 2.0).count();
    assert!((flying as f64 / rate - 0.2).abs() < 2.0 / rate, "{flying} ms in flight");
    approx::assert_abs_diff_eq!(torque.iter().sum::<f64>() / rate, 0.0, epsilon = 1e-9);
    assert_eq!(torque.iter().filter(|x| **x < 0.0).count(), 1, "one impulse");
}

/// Single precision is enough for a controller: a millionth of the torque.
#[test]
fn single_precision_agrees() {
    let terms = [
        (
            Law::Stribeck { steepness: 80.0, velocity: 0.05 },
            Law::Stribeck { steepness: 80.0f32, velocity: 0.05 },
        ),
        (Law::Power { steepness: 80.0, power: 0.5 }, Law::Power { steepness: 80.0f32, power: 0.5 }),
        (Law::Cosine { order: 7.0 }, Law::Cosine { order: 7.0f32 }),
        (
            Law::DirectionSine { order: 2.0, steepness: 50.0 },
            Law::DirectionSine { order: 2.0f32, steepness: 50.0 },
        ),
        (Law::Presliding { distance: 0.01 }, Law::Presliding { distance: 0.01f32 }),
    ];
    for (double, single) in terms {
        let (mut a, mut b) = (Memory::default(), Memory::default());
        for k in 0..200 {
            let (q, v) = ((0.05 * f64::from(k)).sin(), (0.05 * f64::from(k)).cos());
            let x = double.value(
                0,
                &Instant {
                    q: &[q],
                    dq: &[v],
                    ddq: &[],
                    rigid: &[],
                    friction: &[],
                    temperature: &[],
                    running: 0.0,
                },
                &mut a,
            );
            let (q, v) = (q as f32, v as f32);
            let y = single.value(
                0,
                &Instant {
                    q: &[q],
                    dq: &[v],
                    ddq: &[],
                    rigid: &[],
                    friction: &[],
                    temperature: &[],
                    running: 0.0,
                },
                &mut b,
            );
            assert!((x - f64::from(y)).abs() < 1e-5, "{double:?} {k}: {x} {y}");
        }
    }
}

/// The waves of single precision, which are summed here: against the doubles of the standard library.
#[test]
fn sine_and_cosine_in_single_precision_are_within_a_bit() {
    let value = |law: Law<f32>, q: f32| {
        let now =
            Instant { q: &[q], dq: &[], ddq: &[], rigid: &[], friction: &[], temperature: &[], running: 0.0 };
        f64::from(law.value(0, &now, &mut Memory::default()))
    };
    for k in -80_000..=80_000 {
        let q = 0.009_999f32 * k as f32;
        let x = f64::from(q);
        let errors =
            [value(Law::Sine { order: 1.0 }, q) - x.sin(), value(Law::Cosine { order: 1.0 }, q) - x.cos()];
        assert!(errors.iter().all(|e| e.abs() < 1.2e-7), "{q}: {errors:?}");
    }
    assert_eq!([value(Law::Sine { order: 1.0 }, 0.0), value(Law::Cosine { order: 1.0 }, 0.0)], [0.0, 1.0]);
    assert!(value(Law::Sine { order: 1.0 }, f32::INFINITY).is_nan());
}

/// What a slice does not hold is zero and no panic, whatever joint a term names.
#[test]
fn a_joint_that_is_not_there_does_nothing() {
    let mut corrector = Corrector::new([
        Term { joint: 9, coefficient: 1.0, law: Law::Compliance },
        Term { joint: 9, coefficient: 1.0, law: Law::OtherVelocity { other: 12 } },
    ]);
    let mut torque = [1.0, 2.0];
    let now =
        Instant { q: &[], dq: &[], ddq: &[], rigid: &[], friction: &[], temperature: &[], running: 0.0 };
    corrector.move_links(&[1.0], &mut torque);
    corrector.add_torques(&now, &mut torque);
    assert_eq!(torque, [1.0, 2.0]);
}

/// What is documented as the same on every joint is; what depends on the joint's own motion is not.
#[test]
fn laws_that_are_alike_on_all_joints_have_one_value() {
    let (q, dq, ddq) = ([0.3, -0.7, 1.1], [0.5, -0.2, 0.9], [1.0, 2.0, -3.0]);
    let [none, temperature] = [[0.4, 0.5, 0.6], [30.0, 31.0, 32.0]];
    let now = Instant {
        q: &q,
        dq: &dq,
        ddq: &ddq,
        rigid: &none,
        friction: &none,
        temperature: &temperature,
        running: 2.0,
    };
    let (other, joints, orders, steepness) = (2, [1, 2], [1.0, -2.0], 5.0);
    for law in [
        Law::Constant,
        Law::OtherDirection { other, steepness },
        Law::OtherVelocity { other },
        Law::OtherAcceleration { other },
        Law::OtherPosition { other },
        Law::PositionProduct { joints },
        Law::CosineOfTwo { joints, orders },
        Law::SineOfTwo { joints, orders },
        Law::Position,
        Law::Sine { order: 3.0 },
        Law::VelocityProduct { other },
        Law::SumVelocity { other, own: 1.0, theirs: 1.0 },
        Law::Load { steepness },
    ] {
        let [a, b] = [0, 1].map(|j| law.value(j, &now, &mut Memory::default()));
        assert_eq!(law.is_equal_on_all(), a == b, "{law:?}");
    }
}
