//! KNOWN_GAPS.md is true: each gap that can be tried is still one, and what it quotes stands where it says.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::import::{self, Options};
use dyngen::{Arm, Function, Model, SetKind, Values};
use powerball::bus::canopen::Frame;
use powerball::bus::transport::msgpack;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Whether a gap is still one; else what happened.
type Check = fn() -> Result<(), String>;

const CHECKS: [(&str, Check); 8] = [
    ("floating-base", || refused_import(&urdf("floating", ""), "floating")),
    ("loops", loops),
    ("one-chain", || refused_import(&urdf("revolute", FORK), "tree")),
    ("xacro", || {
        refused_import(
            "<robot xmlns:xacro=\"http://ros.org/wiki/xacro\" name=\"a\"><link \
            name=\"${base}\"/><xacro:arm/></robot>",
            "xacro",
        )
    }),
    ("ball-joints", ball_joints),
    ("rounding-of-divisions", rounding_of_divisions),
    ("can-fd", can_fd),
    ("six-joints-on-the-bus", six_joints),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The names of a section's gaps with their texts.
fn gaps(section: &str) -> Vec<(String, String)> {
    let page = std::fs::read_to_string(root().join("KNOWN_GAPS.md")).unwrap();
    let text =
        page.split("\n## ").find(|part| part.starts_with(section)).unwrap_or_else(|| panic!("no {section}"));
    let items = text.split("\n* `").skip(1);
    items.map(|item| item.split_once("`: ").unwrap()).map(|(a, b)| (a.to_string(), b.to_string())).collect()
}

#[test]
fn every_gap_that_can_be_tried_is_one() {
    let listed: BTreeSet<String> = gaps("Tried").into_iter().map(|(name, _)| name).collect();
    let checked: BTreeSet<String> = CHECKS.iter().map(|(name, _)| (*name).to_string()).collect();
    assert_eq!(listed, checked, "gaps of KNOWN_GAPS.md and checks of this file");
    for (name, check) in CHECKS {
        if let Err(found) = check() {
            panic!("{name} is closed: take it off KNOWN_GAPS.md and say so in CHANGELOG.md. Found: {found}");
        }
    }
}

#[test]
fn what_is_quoted_stands_on_its_page() {
    let quoted = gaps("Measured");
    assert!(quoted.len() >= 5);
    for (name, text) in quoted {
        let page = text.split("](").nth(1).and_then(|rest| rest.split(')').next()).unwrap();
        let words = text.split('"').nth(1).unwrap_or_else(|| panic!("{name} quotes nothing"));
        let found = std::fs::read_to_string(root().join(page)).unwrap().replace('\n', " ");
        assert!(found.contains(words), "{name}: {page} does not say \"{words}\"");
    }
}

const LINK: &str = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" \
    iyz=\"0\"/></inertial>";
const FORK: &str = "<joint name=\"other\" type=\"revolute\"><parent link=\"base\"/><child \
    link=\"second\"/><axis xyz=\"0 1 0\"/>\
    <limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint><link name=\"second\"/>";

/// A robot of one joint of a kind, and more.
fn urdf(kind: &str, more: &str) -> String {
    format!(
        "<robot name=\"a\"><link name=\"base\"/><link name=\"link\">{LINK}</link>\
         <joint name=\"turn\" type=\"{kind}\"><parent link=\"base\"/><child link=\"link\"/><axis xyz=\"0 0 \
         1\"/>\
         <limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>{more}</robot>"
    )
}

fn refused_import(text: &str, with: &str) -> Result<(), String> {
    match import::any(text, "robot.urdf", &Options::default()) {
        Err(e) if e.to_string().contains(with) => Ok(()),
        Err(e) => Err(format!("refused for another reason: {e}")),
        Ok(_) => Err("it is imported".to_string()),
    }
}

fn mjcf(joint: &str, more: &str) -> String {
    format!(
        "<mujoco><worldbody><body name=\"one\"><inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"1 1 \
        1\"/>{joint}\
         <body name=\"two\" pos=\"1 0 0\"><inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"1 1 1\"/>\
         <joint name=\"second\" type=\"hinge\"/></body></body></worldbody>{more}</mujoco>"
    )
}

fn loops() -> Result<(), String> {
    let four_bar = "name = \"a\"\nconvention = \"modified\"\ngravity = [0, 0, -9.81]\n\
        joint = [{ kind = \"revolute\", a = 0, alpha = 0, d = 0, theta = 0 },\n\
        { kind = \"revolute\", a = 1, alpha = 0, d = 0, theta = 0 }]\n\
        [[loop]]\njoints = [1, 2, \"c\", \"d\"]\nlengths = [1, 2, 1.5, 2]\ninner = 0\nouter = 0\n";
    match Arm::parse(four_bar, "arm.toml") {
        Err(e) if e.to_string().contains("opposite bars are equal") => {}
        other => return Err(format!("a general loop of four bars on two joints: {other:?}")),
    }
    let text = mjcf(
        "<joint name=\"first\" type=\"hinge\"/>",
        "<equality><connect body1=\"two\" anchor=\"0 0 0\"/></equality>",
    );
    match import::mjcf(&text, "robot.xml", &Options::default()) {
        Err(e) if e.to_string().contains("connect") => Ok(()),
        Err(e) => Err(format!("refused for another reason: {e}")),
        Ok(imported) if imported.notes.iter().any(|note| note.contains("connect")) => Ok(()),
        Ok(imported) => Err(format!("imported with the notes {:?}", imported.notes)),
    }
}

fn ball_joints() -> Result<(), String> {
    let text = mjcf("<joint name=\"first\" type=\"ball\"/>", "");
    match import::mjcf(&text, "robot.xml", &Options::default()) {
        Err(e) if e.to_string().contains("ball") => Ok(()),
        other => Err(format!("{:?}", other.map(|imported| imported.notes))),
    }
}

fn rounding_of_divisions() -> Result<(), String> {
    let arm = Arm::parse(include_str!("../lwa4p.toml"), "lwa4p.toml").unwrap_or_else(|e| panic!("{e}"));
    let model = Model::derive(arm).unwrap();
    let values = Values::parse(include_str!("../../examples/cpp-controller/model.json"), "model.json");
    let values = values.unwrap().of_set(&model, model.set(SetKind::Minimal).unwrap()).unwrap();
    for function in [Function::TaskInertia, Function::ConsistentInverse] {
        let built = model.function(function, SetKind::Minimal).unwrap();
        let bounds = dyngen::rounding::bounds(&model, &built, Some(&values));
        let bounds = bounds.map_err(|why| format!("{} has no bound: {why}", function.name()))?;
        match (bounds.double[0].is_finite(), bounds.single[0].is_finite()) {
            (true, false) => {}
            (true, true) => return Err(format!("{} has a bound in f32", function.name())),
            (false, _) => return Err(format!("{} has no bound in f64", function.name())),
        }
    }
    Ok(())
}

fn can_fd() -> Result<(), String> {
    if Frame::from_raw(0x800, &[]).is_some() {
        return Err("a frame has an identifier of 12 bits".to_string());
    }
    let mut datagram = msgpack::encode(&Frame::from_raw(0x123, &[1]).unwrap(), 0.0);
    let key = b"is_fd";
    let at = datagram.windows(key.len()).position(|w| w == key).unwrap() + key.len();
    datagram[at] = 0xC3;
    match msgpack::decode(&datagram) {
        None => Ok(()),
        Some(frame) => Err(format!("a CAN FD frame is read: {frame:?}")),
    }
}

fn powerball(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments).output().unwrap()
}

/// A file of this test.
fn file(name: &str, text: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("known_gaps");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(name), text).unwrap();
    folder.join(name).to_str().unwrap().to_string()
}

fn six_joints() -> Result<(), String> {
    let path = file("path.csv", "t,q1,q2\n0,0,0\n0.005,0,0\n0.01,0,0\n");
    let out = PathBuf::from(&path).with_file_name("log.csv");
    let output = powerball(&["record", "--trajectory", &path, "--out", out.to_str().unwrap(), "--force"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    match output.status.code() {
        Some(2) if said.contains("q6") || said.contains("6 joints") => Ok(()),
        code => Err(format!("ended with {code:?}: {said}")),
    }
}
