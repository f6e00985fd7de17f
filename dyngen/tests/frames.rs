//! Frames that are fixed on links: the tool's functions at any of them.

#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use dyngen::{Arm, Evaluator, Function, Model, SetKind};
use rand::SeedableRng;
use support::{State, evaluate, model};

/// A turning, a sliding and a turning joint, one that follows, and one more.
const ARM: &str = r#"
name = "five"
convention = "standard"
gravity = [0, 0, -9.81]
joint = [
    { kind = "revolute", a = 0.1, alpha = "pi/2", d = 0.3, theta = 0, rotor_ratio = 100 },
    { kind = "prismatic", a = 0, alpha = "-pi/2", d = 0.2, theta = "pi/2" },
    { kind = "revolute", a = 0.25, alpha = 0.7, d = 0.05, theta = 0 },
    { kind = "revolute", a = 0.2, alpha = "pi/2", d = 0, theta = "pi/2", mimic = { joint = 3, ratio = -1 } },
    { kind = "revolute", a = 0, alpha = 0, d = 0.1, theta = 0 },
]
[base]
xyz = [0, 0.1, 0.4]
rpy = [0, 0, "pi/2"]
"#;

const PLACE: &str = "xyz = [0.1, -0.02, 0.3]\nrpy = [0.4, \"pi/3\", \"-pi/2\"]\n";

fn with_frames(text: &str) -> String {
    let frame = |link: usize| format!("[[frame]]\nname = \"on_{link}\"\nlink = {link}\n{PLACE}");
    text.to_string() + &(1..=5).map(frame).collect::<String>()
}

/// The arm that ends at a link, with its tool where the frame is.
fn cut(text: &str, links: usize) -> Arm {
    let mut arm = Arm::parse(&(text.to_string() + "[tool]\n" + PLACE), "cut.toml").unwrap();
    arm.joints.truncate(links);
    arm
}

fn modified(text: &str) -> String {
    text.replace("\"standard\"", "\"modified\"")
}

fn of_tool() -> Vec<Function> {
    Function::ALL.into_iter().filter(|f| f.is_kinematic()).collect()
}

/// What comes behind a frame's link does not move it: the functions are those of an arm that ends there.
#[test]
fn a_frame_moves_as_the_tool_of_an_arm_that_ends_at_its_link() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(71);
    for text in [ARM.to_string(), modified(ARM)] {
        let whole = Model::kinematic(Arm::parse(&with_frames(&text), "arm.toml").unwrap());
        let state = State::draw(&mut random, whole.arm().dof(), 1.2);
        for links in 1..=5 {
            let at = whole.at_frame(&format!("on_{links}")).unwrap();
            let alone = Model::kinematic(cut(&text, links));
            let n = alone.arm().dof();
            let mut of_cut = state.clone();
            [&mut of_cut.q, &mut of_cut.dq, &mut of_cut.ddq].into_iter().for_each(|x| x.truncate(n));
            for function in of_tool() {
                let result = |model: &Model, state: &State| {
                    let evaluator = Evaluator::new(model, function, SetKind::Full).unwrap();
                    (evaluator.shape(), evaluate(&evaluator, &state.samples(&[])))
                };
                let ((rows, columns), found) = result(&at, &state);
                let ((fewer_rows, fewer), expected) = result(&alone, &of_cut);
                for i in 0..rows {
                    for j in 0..columns {
                        let there = i < fewer_rows && j < fewer;
                        let expected = if there { expected[i * fewer + j] } else { 0.0 };
                        let miss = (found[i * columns + j] - expected).abs();
                        assert!(miss < 1e-12, "{function} of link {links}, row {i}, column {j}: {miss:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn dynamics_do_not_change_and_the_tool_s_inertia_is_asked_at_a_frame() {
    // With angles that are no multiples of pi sets take long.
    let text = ARM.replace("0.7", "\"pi/4\"");
    let (plain, framed) = (model(&text), model(&with_frames(&text)));
    let names = |model: &Model| model.set(SetKind::Minimal).unwrap().names();
    assert_eq!(names(&plain), names(&framed));
    let at = framed.at_frame("on_3").unwrap();
    assert!(Evaluator::new(&at, Function::TaskInertiaInverse, SetKind::Minimal).is_ok());
    assert!(framed.at_frame("hand").is_none());
}

#[test]
fn frames_that_cannot_be_are_refused_with_their_line() {
    let error = |frame: &str| Arm::parse(&(ARM.to_string() + frame), "arm.toml").unwrap_err().to_string();
    for (frame, words) in [
        ("[[frame]]\nname = \"a\"\nlink = 6\n", "link must be one of the links 1 to 5"),
        ("[[frame]]\nname = \"a\"\nlink = 0\n", "link must be one of the links 1 to 5"),
        ("[[frame]]\nname = \"a\"\n", "the key 'link' is missing"),
        ("[[frame]]\nlink = 1\n", "the key 'name' is missing"),
        ("[[frame]]\nname = \"Left hand\"\nlink = 1\n", "lowercase letters, digits and _"),
        (
            "[[frame]]\nname = \"a\"\nlink = 1\n[[frame]]\nname = \"a\"\nlink = 2\n",
            "the name of another frame",
        ),
        ("[[frame]]\nname = \"a\"\nlink = 1\nmass = 2\n", "unknown key 'mass'"),
        ("[[frame]]\nname = \"a\"\nlink = 1\nxyz = [1]\n", "xyz must be three numbers"),
    ] {
        let message = error(frame);
        assert!(message.contains(words) && message.contains("arm.toml:1"), "{frame}: {message}");
    }
}
