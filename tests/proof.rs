//! Every function of every arm and set is proven against the Lagrangian, and a wrong one is not.

use dyngen::base::SetKind;
use dyngen::{Function, Model};
use powerball_workspace::{arm, paper_arm_with_ratios, parse, arm_text};

fn prove_all(name: &str, model: &Model) {
    for set in &model.sets().sets {
        for function in Function::ALL {
            let built = model.function(function, set.kind).unwrap_or_else(|e| panic!("{name} {}: {e}", set.kind));
            println!("{name:10} {:10} {:20} {:?}", set.kind, function, built.graph.operations(&built.outputs));
        }
    }
}

#[test]
fn every_function_of_every_set_is_proven() {
    for name in ["arm", "puma560", "ur5e", "panda", "stanford", "scara"] {
        prove_all(name, &Model::derive(arm(name)).unwrap());
    }
}

#[test]
fn no_rotors() {
        prove_all("norotor", &Model::derive(paper_arm_with_ratios([None; 6])).unwrap());
}

#[test]
fn rotors_on_arms_with_prismatic_joints_and_modified_frames_are_proven() {
    for name in ["stanford", "panda", "scara"] {
        let text = arm_text(name).replace("[[joint]]", "[[joint]]\nrotor_ratio = 50");
        prove_all(name, &Model::derive(parse(&text)).unwrap());
    }
}

#[test]
fn general_angles_are_proven() {
    let text = arm_text("ur5e").replacen("\"pi/2\"", "\"pi/3\"", 1).replace("theta = \"0\"", "theta = 0.7").replace("\"-pi/2\"", "0.3").replacen("alpha = \"0\"", "alpha = \"3*pi/4\"", 1);
    let text = text.replace("gravity = [0, 0, -9.81]", "gravity = [1.5, -2, 9.5]");
    prove_all("general", &Model::derive(parse(&text)).unwrap());
    let text = arm_text("stanford").replace("\"-pi/2\"", "\"pi/5\"");
    prove_all("general", &Model::derive(parse(&text)).unwrap());
}

#[test]
fn published_sums_that_lose_a_parameter_are_refused() {
    let model = Model::derive(paper_arm_with_ratios([1, 1, 1, 1, 1, 100].map(Some))).unwrap();
    let error = model.function(Function::Gravity, SetKind::Published).unwrap_err();
    assert!(error.to_string().contains("Im6"), "{error}");
}
