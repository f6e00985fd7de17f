//! Which column is which quantity of which joint, and in which unit.

use super::*;

#[test]
fn aligned_columns_are_read() {
    let (plain, _) = read(&text(HEADER, |_, f| Some(f.join(","))));
    let aligned = |fields: Vec<String>| fields.iter().map(|f| format!("{f:>12}")).collect::<String>();
    let header = aligned(HEADER.split(',').map(str::to_string).collect());
    for (begin, end) in [("", ""), ("", "  "), ("  ", "\r")] {
        let line = |_, f: Vec<String>| Some(format!("{begin}{}{end}", aligned(f)));
        let (log, findings) = read(&text(&format!("{header}{end}"), line));
        let (log, plain) = (log.unwrap(), plain.as_ref().unwrap());
        assert_eq!((&log.t, &log.q, &log.torque), (&plain.t, &plain.q, &plain.torque), "{end:?}");
        assert!(findings.is_empty(), "{findings:?}");
    }
}

/// An arm whose second joint slides by up to 2 m.
fn sliding() -> Arm {
    let (first, second) = ARM.rsplit_once("[[joint]]").unwrap();
    let second = second.replace("revolute", "prismatic") + "position = [-2, 2]\n";
    Arm::parse(&format!("{first}[[joint]]{second}"), "two.toml").unwrap()
}

#[test]
fn a_unit_is_that_of_joints_that_can_have_it() {
    let read = |scale: [f64; 2], map: &str| {
        let line = |_, mut f: Vec<String>| {
            for (k, scale) in scale.iter().enumerate() {
                f[k + 1] = format!("{:e}", f[k + 1].parse::<f64>().unwrap() * scale);
            }
            Some(f.join(","))
        };
        let map = ColumnMap::parse(map, "map").unwrap();
        let asked = Asked { arm: &sliding(), map: &map, file: "x.csv", header: None, goals: false };
        super::read::parse(text(HEADER, line).as_bytes(), asked, &mut Vec::new())
    };
    let plain = read([1.0, 1.0], "").unwrap();
    let degree = std::f64::consts::PI / 180.0;
    for (scale, map) in [
        ([1.0 / degree, 1.0], "q.unit = \"deg\""),
        ([1.0, 1e3], "q.unit = \"mm\""),
        ([1.0 / degree, 1e3], "q.unit = [\"deg\", \"mm\"]"),
        ([1.0, 1.0], "q.unit = \"rad\""),
    ] {
        let log = read(scale, map).unwrap();
        for (own, other) in plain.q.iter().flatten().zip(log.q.iter().flatten()) {
            assert!((own - other).abs() < 1e-12, "{map}: {own} {other}");
        }
    }
    let said = |scale, map| read(scale, map).unwrap_err().to_string();
    let wrong = said([1.0, 1.0], "q.unit = [\"deg\", \"deg\"]");
    assert!(wrong.contains("q.unit: joint 2 slides: `deg` cannot be its unit"), "{wrong}");
    let wrong = said([1.0, 1e3], "");
    assert!(wrong.contains("q2: reaches 1000.0, the joint 2.000 m") && wrong.contains("\"mm\""), "{wrong}");
}

/// A joint that follows another has no column, and the next column is the next joint's.
#[test]
fn a_joint_that_follows_has_no_column() {
    let (first, second) = ARM.rsplit_once("[[joint]]").unwrap();
    let follower = second.replace("revolute", "prismatic") + "position = [0, 0.3]\nmimic = { joint = 1 }\n";
    let arm = format!("{first}[[joint]]{follower}[[joint]]{second}");
    let arm = Arm::parse(&arm, "three.toml").unwrap();
    let mut findings = Vec::new();
    parse(text(HEADER, |_, f| Some(f.join(","))).as_bytes(), "x.csv", &arm, &mut findings).unwrap();
    assert!(findings.iter().all(|found| found.quantity != "q2"), "{findings:?}");
}

/// The columns of a sound log under other names, in their order.
fn named(header: &str) -> (Result<Log, LogError>, Vec<Finding>) {
    read(&text(header, |_, f| Some(f.join(","))))
}

#[test]
fn columns_of_other_names_are_read_where_each_quantity_has_one() {
    let (plain, _) = named(HEADER);
    for (header, map) in [
        ("t,q0,q1,tau0,tau1", "q.column = [\"q0\", \"q1\"]"),
        ("time,joint_1_pos,joint_2_pos,joint_1_effort,joint_2_effort", "t.column = \"time\""),
        ("timestamp,actualPosition[0],actualPosition[1],motorTorque[0],motorTorque[1]", "motorTorque[1]"),
        ("t,q1,q2,torque_1,torque_2", "tau.column = [\"torque_1\", \"torque_2\"]"),
    ] {
        let (log, findings) = named(header);
        let (log, plain) = (log.unwrap(), plain.as_ref().unwrap());
        assert_eq!((&log.t, &log.q, &log.torque), (&plain.t, &plain.q, &plain.torque), "{header}");
        let said = findings.iter().find(|f| f.message.starts_with("read as --map")).unwrap();
        assert!(said.message.contains(map), "{header}: {said}");
    }
    // A unit in the name is taken with it.
    let (log, _) = named("time_ms,q1,q2,tau1,tau2");
    assert_eq!(log.unwrap().t[10], 1e-3 * plain.unwrap().t[10]);
}

#[test]
fn columns_that_may_be_read_in_two_ways_are_asked_for() {
    for (header, reason) in [
        // Seven columns for an arm of two joints less one.
        ("t,q0,q1,q2,tau1", "which are 3 columns, the arm has 2 joints"),
        ("time,stamp,q1,q2,tau1", "--map 't.column = \"time\"' --map 't.column = \"stamp\"'"),
        ("t,arm_1_pos,arm_2_pos,motor_1_pos,motor_2_pos", "missing: q1, q2"),
        ("t,arm_1_pos,arm_2_pos,motor_1_pos,motor_2_pos", "[\"arm_1_pos\", \"arm_2_pos\"]"),
        ("t,arm_1_pos,arm_2_pos,motor_1_pos,motor_2_pos", "[\"motor_1_pos\", \"motor_2_pos\"]"),
        // What was asked for is no measurement.
        ("t,target_q_1,target_q_2,tau1,tau2", "missing: q1, q2"),
    ] {
        let said = named(header).0.unwrap_err().to_string();
        assert!(said.contains(reason), "{header}: '{reason}' not in '{said}'");
    }
}
