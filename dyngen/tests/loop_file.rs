//! `[[loop]]` in an arm file: which joint follows, and what is reported.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;

const CRANK: &str = include_str!("loops/crank.toml");
const LEVEL: &str = include_str!("loops/level.toml");
const REMOTE: &str = include_str!("loops/remote.toml");

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
        (CRANK, "1.1, 0.25, 1.1]", "1.1, 0.3, 1.1]", "only loops whose opposite bars are equal"),
        (CRANK, "1.1, 0.25, 1.1]", "1.1, 0.25]", "must be four lengths in m"),
        (CRANK, "1.1, 0.25, 1.1]", "1.1, 0.25, -1.1]", "must be greater than zero"),
        (CRANK, "inner = \"pi\"", "", "the key 'inner' is missing"),
        (CRANK, "outer = \"pi\"", "outer = \"half\"", "outer: 'half' is not an angle"),
        (CRANK, "outer = \"pi\"", "outer = \"pi\"\nbar = [{}, {}, {}]", "3 tables [[loop.bar]]"),
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
