//! `[[loop]]` in an arm file: which joint follows, and what is reported.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::consistency::check;
use dyngen::{Arm, Function, Model, SetKind};

const CRANK: &str = include_str!("loops/crank.toml");
const LEVEL: &str = include_str!("loops/level.toml");
const REMOTE: &str = include_str!("loops/remote.toml");
const CROSSED: &str = include_str!("loops/crossed.toml");
const ROCKER: &str = include_str!("loops/rocker.toml");

/// The joint that the loop ties may also be the one with the motor.
#[test]
fn either_joint_of_a_loop_may_be_driven() {
    let of = |mimic: &str, at: usize| {
        let row = ["theta = \"-pi/2\", rotor_ratio = 100 }", "theta = \"pi/2\" }"][at];
        let with = row.replace(" }", &format!(", mimic = {mimic} }}"));
        Arm::parse(&LEVEL.replacen(row, &with, 1), "arm.toml")
    };
    let drives = |arm: &Arm| arm.drives().iter().map(|d| d.joint).collect::<Vec<_>>();
    assert_eq!(drives(&Arm::parse(LEVEL, "arm.toml").unwrap()), [0, 1, 1, 3, 3, 5]);
    let outer = of("{ joint = 3, ratio = -1 }", 0).unwrap();
    assert_eq!(drives(&outer), [0, 2, 2, 3, 3, 5]);
    assert!(of("{ joint = 2, ratio = -1 }", 1).is_ok());
    let error = of("{ joint = 2, ratio = 1 }", 1).unwrap_err().to_string();
    assert!(error.contains("makes joint 3 follow joint 2: ratio = -1, offset = 0"), "{error}");
}

/// What the first joint of a loop follows besides makes it no follower of the loop's other joint.
#[test]
fn the_first_joint_of_a_loop_may_follow_another_joint() {
    let row = "theta = \"-pi/2\", rotor_ratio = 100 }";
    let follows = row.replace(" }", ", mimic = { joint = 1, ratio = 2, offset = 0.5 } }");
    let arm = Arm::parse(&LEVEL.replacen(row, &follows, 1), "arm.toml").unwrap();
    let second = arm.joints[2].mimic.as_ref().unwrap();
    let found = (second.joint, second.ratio.to_string(), second.offset.to_string());
    assert_eq!(found, (0, "-2".into(), "-1/2".into()));
}

/// Two parallelograms one behind the other: both plates turn with the first joint, in either order of the
/// loops.
#[test]
fn loops_may_follow_each_other() {
    let chain = r#"
name = "lamp"
convention = "modified"
gravity = [0, 0, -9.81]
joint = [
    { kind = "revolute", a = 0, alpha = 0, d = 0.5, theta = 0 },
    { kind = "revolute", a = 0.3, alpha = "-pi/2", d = 0, theta = 0 },
    { kind = "revolute", a = 1.1, alpha = 0, d = 0, theta = 0 },
    { kind = "revolute", a = 0.4, alpha = 0, d = 0, theta = 0 },
]
"#;
    let of = |first: usize, length: f64, pins: &str| {
        format!(
            "[[loop]]\njoints = [{first}, {}, {pins}]\nlengths = [{length}, 0.2, {length}, 0.2]\ninner = 0.5\n\
             outer = 0.5\n",
            first + 1
        )
    };
    let loops = [of(2, 1.1, "\"a\", \"b\""), of(3, 0.4, "\"c\", \"d\"")];
    for order in [[0, 1], [1, 0]] {
        let text = format!("{chain}{}{}", loops[order[0]], loops[order[1]]);
        let arm = Arm::parse(&text, "arm.toml").unwrap();
        let follows: Vec<_> =
            arm.joints.iter().map(|j| j.mimic.as_ref().map(|m| (m.joint, m.ratio.to_string()))).collect();
        assert_eq!(follows, [None, None, Some((1, "-1".into())), Some((1, "1".into()))]);
    }
    let text = format!("{chain}{}{}", loops[0], loops[1].replace("\"c\", \"d\"", "\"a\", \"b\""));
    let error = Arm::parse(&text, "arm.toml").unwrap_err().to_string();
    assert!(error.contains("loop 2: the name 'a-b' is already that of another bar"), "{error}");
}

/// A bar whose values no body has is called by its name, and so is a link by its number.
#[test]
fn a_bar_is_called_by_its_name() {
    let model = Model::derive(Arm::parse(CRANK, "arm.toml").unwrap()).unwrap();
    let set = model.set(SetKind::Full).unwrap();
    let mut values = vec![0.0; set.parameters.len()];
    for (name, reason) in
        [("m5", "bar tail-rod end: its mass -1 is negative"), ("m3", "link 3: its mass -1 is")]
    {
        let at = set.parameters.iter().position(|p| p.name == name).unwrap();
        values[at] = -1.0;
        let found = check(&model, SetKind::Full, &values).unwrap();
        assert!(found.reasons.iter().any(|r| r.starts_with(reason)), "{:?}", found.reasons);
    }
    let arm = model.arm();
    let last: Vec<Option<usize>> = (0..arm.bodies()).map(|body| arm.last_joint(body)).collect();
    assert_eq!(last, [Some(0), Some(1), Some(2), Some(3), Some(2), Some(2)]);
}

/// Products of what moves with three linkages are too many to be tried one by one.
#[test]
fn an_arm_may_have_many_linkages() {
    let (chain, own) = CROSSED.split_at(CROSSED.find("[[loop]]").unwrap());
    let first = own[..own[1..].find("[[loop]]").unwrap() + 1].replace("\"second\"", "\"first\"");
    let first = first.replace("\"a\", \"b\", \"c\"", "\"g\", \"h\", \"i\"");
    let arm = Arm::parse(&format!("{chain}{first}\n{own}"), "arm.toml").unwrap();
    assert_eq!((arm.linkages().count(), arm.bodies()), (3, 9));
    let model = Model::derive(arm).unwrap();
    model.function(Function::InverseDynamics, SetKind::Minimal).unwrap();
}

/// Of loops that are no parallelograms a joint has one.
#[test]
fn a_joint_turns_one_linkage() {
    let (chain, own) = ROCKER.split_at(ROCKER.find("[[loop]]").unwrap());
    let other = own.replace("\"crank pin\", \"middle\", \"foot\"", "\"a\", \"b\", \"c\"");
    let error = Arm::parse(&format!("{chain}{own}\n{other}"), "arm.toml").unwrap_err().to_string();
    assert!(error.contains("loop 2: its joint has another loop that is no parallelogram"), "{error}");
}

/// A joint with a rod and a rocker may follow another one, and another one may follow it.
#[test]
fn the_joint_of_a_linkage_may_follow_or_be_followed() {
    for joint in [2, 3] {
        let text = format!(
            r#"
name = "tied"
convention = "modified"
gravity = [0, 0, -9.81]
joint = [
    {{ kind = "revolute", a = 0, alpha = 0, d = 0.5, theta = 0 }},
    {{ kind = "revolute", a = 0.3, alpha = "pi/2", d = 0.1, theta = "-pi/2" }},
    {{ kind = "revolute", a = 0.2, alpha = 0, d = 0, theta = 0, mimic = {{ joint = 2, ratio = -2 }} }},
]
[[loop]]
joints = [{joint}, "crank pin", "middle", "foot"]
lengths = [0.2, 0.9, 0.6, 0.8]
inner = 0
outer = "pi/2"
middle = "left"
"#
        );
        let model = Model::derive(Arm::parse(&text, "arm.toml").unwrap()).unwrap();
        for function in [Function::InverseDynamics, Function::CoriolisMatrix, Function::TotalMomentumMatrix] {
            model.function(function, SetKind::Full).unwrap_or_else(|e| panic!("{joint}: {e}"));
        }
        assert_eq!(model.arm().last_joint(4), Some(joint - 1));
    }
}

/// The joint that moves on its own has the limits that count, and a loop has them with its dead points.
#[test]
fn a_loop_closes_within_the_limits_of_the_joint_that_moves() {
    let read = |leader: &str, follower: &str, lengths: &str| {
        let text = format!(
            r#"
name = "tied"
convention = "modified"
gravity = [0, 0, -9.81]
joint = [
    {{ kind = "revolute", a = 0, alpha = 0, d = 0, theta = 0 {leader} }},
    {{ kind = "revolute", a = 0.2, alpha = 0, d = 0, theta = 0 {follower} }},
]
[[loop]]
joints = [2, "a", "b", "c"]
lengths = {lengths}
inner = 0
outer = 0
middle = "left"
"#
        );
        Arm::parse(&text, "arm.toml").map_err(|e| e.to_string())
    };
    let follows = ", mimic = { joint = 1, ratio = -2, offset = 1 }";
    let limited = format!("{follows}, position = [-0.5, 0.5]");
    let lengths = "[0.25, 0.9, 0.4, 1.1]";
    // The loop closes between -2.43 and 2.43 rad.
    for (leader, follower) in [(", position = [-0.7, 1.7]", follows), (", position = [-0.7, 1.7]", &limited)]
    {
        read(leader, follower, lengths).unwrap();
    }
    for leader in ["", ", position = [-0.8, 1.7]"] {
        let error = read(leader, &limited, lengths).unwrap_err();
        assert!(error.contains("of the joint that it follows"), "{error}");
    }
    // A dead point in the middle of the limits, at 0 and whole turns from there.
    let error = read("", ", position = [-0.5, 0.5]", "[0.3, 0.5, 0.4, 0.4]").unwrap_err();
    assert!(error.contains("between -6.283185 and 0.000000 rad"), "{error}");
    let error = read("", ", position = [0.5, 1.5]", "[0.5, 0.6, 0.5, 0.6000000001]").unwrap_err();
    assert!(error.contains("two pairs of equal ones"), "{error}");
}

#[test]
fn loops_that_are_none_are_reported() {
    let cases = [
        (CRANK, "\"elbow\", \"tail\"", "\"elbw\", \"tail\"", "has no joint of the chain"),
        (
            CRANK,
            "\"elbow\", \"tail\"",
            "9, \"tail\"",
            "names 9, which is no joint of this arm: they are 1 to 4",
        ),
        (CRANK, "\"tail\", \"rod end\"", "\"tail\", \"tail\"", "names the pin 'tail' twice"),
        (CRANK, ", \"crank\"]", "]", "the four joints around the loop"),
        (CRANK, "\"elbow\", \"tail\"", "\"tail\", \"elbow\"", "must begin with those of the chain"),
        (CRANK, "1.1, 0.25, 1.1]", "1.1, 0.25, 3.1]", "do not close: 3.1 m"),
        (CRANK, "1.1, 0.25, 1.1]", "1.1, 0.3, 1.1]", "say with middle = \"left\" or \"right\""),
        (CRANK, "0.25, 1.1, 0.25, 1.1]", "1.1, 1.1, 0.25, 0.25]", "of such loops only parallelograms"),
        (CRANK, "outer = \"pi\"", "outer = \"pi\"\nmiddle = \"left\"", "of such loops only parallelograms"),
        (CRANK, "outer = \"pi\"", "outer = \"pi\"\nmiddle = \"up\"", "must be \"left\" or \"right\", found"),
        (
            CRANK,
            "1.1, 0.25, 1.1]\n",
            "0.9, 0.4, 1.1]\nmiddle = \"left\"\n",
            "it closes only where q of joint 3 is between -2.432712 and 2.432712 rad",
        ),
        (
            LEVEL,
            "1.1, 0.3, 1.1, 0.3]",
            "1.1, 0.3, 1.0, 0.3]",
            "with two joints of the chain only loops whose",
        ),
        (CRANK, "1.1, 0.25, 1.1]", "1.1, 0.25]", "must be four lengths in m"),
        (CRANK, "1.1, 0.25, 1.1]", "1.1, 0.25, -1.1]", "must be greater than zero"),
        (CRANK, "inner = \"pi\"", "", "the key 'inner' is missing"),
        (CRANK, "outer = \"pi\"", "outer = \"half\"", "outer: 'half' is not an angle"),
        (CRANK, "outer = \"pi\"", "outer = \"pi\"\nbar = [{}, {}, {}]", "3 tables [[loop.bar]]"),
        (
            CRANK,
            "outer = \"pi\"",
            "outer = \"pi\"\nbar = { }",
            "write [[loop.bar]] with two brackets: each bar",
        ),
        (
            CRANK,
            "outer = \"pi\"",
            "outer = \"pi\"\nbar = 2",
            "bar must be a list of tables: write [[loop.bar]]",
        ),
        (CRANK, "outer = \"pi\"", "outer = \"pi\"\nbar = [2]", "bar 1 must be a table: write [[loop.bar]]"),
        (
            CRANK,
            "outer = \"pi\"",
            "outer = \"pi\"\nbar = [{ name = \"rod\" }, { name = \"rod\" }]",
            "loop 1: the name 'rod' is already that of another bar",
        ),
        (CRANK, "outer = \"pi\"", "outer = \"pi\"\nbar = [{ zero = [\"Im\"] }]", "bars have none"),
        (
            CRANK,
            "outer = \"pi\"",
            "outer = \"pi\"\nbar = [{ zero = [\"mw\"] }]",
            "loop 1: bar 1: zero names \"mw\"",
        ),
        (
            CRANK,
            "\"elbow\", \"tail\", \"rod end\"",
            "\"shoulder\", \"turn\", \"rod end\"",
            "must be neighbours",
        ),
        (
            CRANK,
            "\"elbow\", \"tail\", \"rod end\"",
            "\"elbow\", \"wrist\", \"rod end\"",
            "is not planar: the axes of joints 3 and 4",
        ),
        (LEVEL, "[1.1, 0.3, 1.1, 0.3]", "[1.2, 0.3, 1.2, 0.3]", "joints 2 and 3 are 1.1 m apart"),
        (REMOTE, "\"pitch\", \"top front\"", "\"insertion\", \"top front\"", "joint 3 slides"),
    ];
    for (text, from, to, words) in cases {
        assert!(text.contains(from), "{from}");
        let message = Arm::parse(&text.replacen(from, to, 1), "arm.toml").unwrap_err().to_string();
        assert!(message.contains(words), "{to}: {message}");
        assert!(message.contains("arm.toml:"), "{to}: {message}");
    }
}
