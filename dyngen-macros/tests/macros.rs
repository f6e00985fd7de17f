//! The macros give the code of every other door: compiled here, called here, compared with the library.

use dyngen::{Arm, Evaluator, Function, Model, SetKind};
use nalgebra::{SMatrix, SVector};

mod slider {
    #![deny(warnings, missing_docs)]
    //! From a file, everything.
    dyngen_macros::arm!("tests/arms/slider.toml");
}

mod slider_full {
    //! From a file, a choice.
    dyngen_macros::arm! {
        file = "tests/arms/slider.toml", parameters = full, functions = [regressor, gravity]
    }
}

#[dyngen_macros::model("tests/arms/slider.toml")]
mod slider_model {
    pub(super) const KEPT: &str = "what the module holds stays";
}

mod baked {
    //! With the values of its parameters.
    dyngen_macros::arm! {
        file = "tests/arms/slider.toml",
        values = "tests/arms/slider.values.json",
        functions = [gravity],
        parameters = full,
    }
}

mod inline {
    dyngen_macros::arm! {
        toml = r#"
            name = "pendulum"
            convention = "standard"
            gravity = [0, -9.81, 0]
            [[joint]]
            kind = "revolute"
            a = 1
            alpha = 0
            d = 0
            theta = 0
        "#,
        parameters = full,
    }
}

#[test]
fn a_file_gives_every_function_of_its_arm() {
    let text = include_str!("arms/slider.toml");
    let model = Model::derive(Arm::parse(text, "slider").unwrap()).unwrap();
    assert_eq!(slider::PARAMETER_NAMES.to_vec(), model.set(SetKind::Minimal).unwrap().names());
    let (q, dq, ddq) = (SVector::from([0.3, -0.2]), SVector::from([1.1, 0.7]), SVector::from([-0.4, 2.0]));
    let parameters = SVector::<f64, { slider::PARAMETERS }>::from_fn(|i, _| 0.5 + i as f64);
    let torque = slider::inverse_dynamics(&q, &dq, &ddq, &parameters);
    let evaluator = Evaluator::new(&model, Function::InverseDynamics, SetKind::Minimal).unwrap();
    let mut expected = [0.0; 2];
    evaluator.evaluate(q.as_slice(), dq.as_slice(), ddq.as_slice(), parameters.as_slice(), &mut expected);
    for i in 0..2 {
        assert!((torque[i] - expected[i]).abs() < 1e-13, "{torque} {expected:?}");
    }
    assert_eq!(slider_model::inverse_dynamics(&q, &dq, &ddq, &parameters), torque);
    assert_eq!(slider_model::KEPT.len(), 27);
}

#[test]
fn a_choice_is_kept() {
    assert_eq!(slider_full::PARAMETERS, 20);
    let y = slider_full::regressor(
        &SVector::from([0.0, 0.1]),
        &SVector::from([0.0, 0.0]),
        &SVector::from([0.0, 0.0]),
    );
    let parameters = SVector::<f64, 20>::from_fn(|i, _| (i as f64).sin());
    let gravity = slider_full::gravity(&SVector::from([0.0, 0.1]), &parameters);
    assert!((y * parameters - gravity).norm() < 1e-12);
}

#[test]
fn values_of_a_file_are_baked_in() {
    let parameters = SVector::<f64, { slider_full::PARAMETERS }>::from(baked::PARAMETER_VALUES);
    assert_eq!(parameters[10], 1.25);
    let q = SVector::from([0.4, 0.1]);
    assert!((baked::gravity(&q) - slider_full::gravity(&q, &parameters)).norm() < 1e-13);
}

#[test]
fn a_table_in_place_is_an_arm() {
    // A point of 2 kg at the far end of a rod of 1 m that lies level: its frame's origin.
    let mut parameters = SVector::<f64, { inline::PARAMETERS }>::zeros();
    parameters[0] = 2.0;
    assert_eq!(inline::PARAMETER_NAMES[0], "m1");
    assert!((inline::gravity(&SVector::from([0.0]), &parameters)[0] - 2.0 * 9.81).abs() < 1e-12);
    assert!(inline::gravity(&SVector::from([std::f64::consts::FRAC_PI_2]), &parameters)[0].abs() < 1e-12);
}

mod rubbing {
    dyngen_macros::arm! {
        file = "tests/arms/slider.toml",
        functions = [gravity],
        friction = ["viscous", "coulomb", "tanh:30:2"],
    }
}

#[test]
fn friction_is_the_sum_of_its_columns() {
    let dq = SVector::from([-0.2, 0.0]);
    let columns = rubbing::friction_columns(&dq);
    let tanh = |x: f64| (x.exp() - (-x).exp()) / (x.exp() + (-x).exp());
    let expected = [[-0.2, -1.0, tanh(-0.2 * 30.0)], [0.0; 3]];
    for (i, row) in expected.iter().enumerate() {
        for (k, value) in row.iter().enumerate() {
            assert!((columns[(i, k)] - value).abs() < 1e-15, "{i} {k}: {}", columns[(i, k)]);
        }
    }
    let coefficients = SMatrix::<f64, 2, 3>::from_row_slice(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let torque = rubbing::friction(&dq, &coefficients);
    assert!((torque[0] - (-0.2 - 2.0 + 3.0 * expected[0][2])).abs() < 1e-15);
    assert_eq!(torque[1], 0.0);
    // The second joint's own shape.
    let moving = rubbing::friction_columns(&SVector::from([0.0, 0.5]));
    assert!((moving[(1, 2)] - tanh(1.0)).abs() < 1e-15);
}

mod wrist {
    #![deny(warnings, missing_docs)]
    //! A motor that turns with two joints, and friction.
    dyngen_macros::arm! {
        toml = r#"
            name = "wrist"
            convention = "modified"
            gravity = [0, 0, -9.81]
            joint = [
                { kind = "revolute", a = 0, alpha = 0, d = 0.1, theta = 0, rotor_ratio = 100 },
                { kind = "revolute", a = 0.3, alpha = "pi/2", d = 0, theta = 0, rotor_ratio = 80 },
                { kind = "revolute", a = 0.2, alpha = "pi/2", d = 0, theta = 0, rotor_ratio = 50 },
            ]
            [[transmission]]
            joints = [2, 3]
            matrix = [[1, 0], [-1.5, 1]]
        "#,
        functions = [gravity],
        friction = ["viscous", "coulomb", "tanh:20"],
    }
}

/// Friction sits on the motors: what they lose is what the joints bring up.
#[test]
fn friction_is_that_of_the_motors() {
    let dq = SVector::from([0.4, -0.3, 0.2]);
    let motors = [0.4, -0.3, 1.5 * 0.3 + 0.2];
    let coefficients = SMatrix::<f64, 3, 3>::from_fn(|i, k| 1.0 + i as f64 + 0.25 * k as f64);
    let of_motor = |i: usize| {
        let v: f64 = motors[i];
        coefficients[(i, 0)] * v
            + coefficients[(i, 1)] * v.signum()
            + coefficients[(i, 2)] * (20.0 * v).tanh()
    };
    let torque = wrist::friction(&dq, &coefficients);
    let expected = [of_motor(0), of_motor(1) - 1.5 * of_motor(2), of_motor(2)];
    for (found, expected) in torque.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{torque} {expected:?}");
    }
    let power: f64 = (0..3).map(|i| motors[i] * of_motor(i)).sum();
    assert!((torque.dot(&dq) - power).abs() < 1e-12);
    assert_eq!(wrist::MOTOR_VELOCITIES, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.5, 1.0]]);
}
