//! The files in `tests/eds_data` are read as python-canopen reads them.

use super::*;
use serde_json::{Value as Json, json};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/eds_data")
}

fn read(name: &str) -> (Dcf, Json) {
    let file = |ending: &str| std::fs::read(folder().join(format!("{name}.{ending}"))).unwrap();
    (Dcf::parse(&file("eds")).unwrap(), serde_json::from_slice(&file("json")).unwrap())
}

/// A value in the form of the script's.
fn plain(value: Option<&Value>, node: u8) -> Json {
    match value {
        None => Json::Null,
        Some(Value::Number(number)) => match u64::try_from(number.of(node)) {
            Ok(positive) => json!(positive),
            Err(_) => json!(i64::try_from(number.of(node)).unwrap()),
        },
        Some(Value::Real(real)) => json!(real),
        Some(Value::Text(text)) => json!(text),
        Some(Value::Bytes(bytes)) => json!(bytes.iter().map(|b| format!("{b:02x}")).collect::<String>()),
    }
}

fn access(access: Access) -> &'static [&'static str] {
    match access {
        Access::ReadOnly => &["ro"],
        Access::WriteOnly => &["wo"],
        Access::ReadWrite => &["rw", "rwr", "rww"],
        Access::Constant => &["const"],
    }
}

/// Sub-index 0 of an array without sections for its parts: of it python-canopen keeps type and place alone.
fn is_count_of_compact(object: &Json) -> bool {
    object["sub"] == 0 && object["name"] == "Number of entries" && object["default"].is_null()
}

#[test]
fn every_object_is_read_as_python_canopen_reads_it() {
    let mut compared = 0;
    for name in ["sample", "datatypes", "node", "canfestival", "compact"] {
        let (dcf, python) = read(name);
        assert_eq!(json!(dcf.node), python["node"], "{name}");
        assert_eq!(json!(dcf.bitrate), python["bitrate"], "{name}");
        let node = python["evaluated_for"].as_u64().unwrap() as u8;
        for theirs in python["objects"].as_array().unwrap() {
            let number = |key: &str| theirs[key].as_u64().unwrap();
            let object = Object::new(number("index") as u16, number("sub") as u8);
            let ours = &dcf.variables[&object];
            assert_eq!(u64::from(ours.data_type), number("data_type"), "{name}, {object}");
            assert_eq!(json!(ours.mappable), theirs["mappable"], "{name}, {object}");
            compared += 1;
            if is_count_of_compact(theirs) {
                continue;
            }
            // CiA 306 puts the sub-index behind the name where a part of a compact array has none of its own.
            let name_there = theirs["name"].as_str().unwrap();
            let own = ours.name == name_there
                || object == Object::new(0x3006, 1) && ours.name == format!("{name_there}1");
            assert!(own, "{name}, {object}: {}, {name_there}", ours.name);
            assert!(access(ours.access).contains(&theirs["access"].as_str().unwrap()), "{name}, {object}");
            assert_eq!(plain(ours.default.as_ref(), node), theirs["default"], "{name}, {object}: default");
            assert_eq!(plain(ours.value.as_ref(), node), theirs["value"], "{name}, {object}: value");
        }
    }
    assert_eq!(compared, 101 + 28 + 8 + 2 + 5);
}

/// python-canopen makes the parts of an array that no section names when they are requested; here they are
/// there.
#[test]
fn nothing_is_read_that_python_canopen_does_not_read_but_parts_of_arrays() {
    for name in ["sample", "datatypes", "node", "canfestival", "compact"] {
        let (dcf, python) = read(name);
        let theirs: Vec<_> = python["objects"].as_array().unwrap().iter().collect();
        for object in dcf.variables.keys() {
            let same =
                |sub: u8| theirs.iter().any(|their| their["index"] == object.index && their["sub"] == sub);
            assert!(same(object.sub) || object.sub > 1 && same(1), "{name}, {object}");
        }
    }
    let (sample, _) = read("sample");
    let parts = |index| sample.variables.keys().filter(|object| object.index == index).count();
    // 24 valves and their number; three sensors and theirs.
    assert_eq!((parts(0x3006), parts(0x3004)), (25, 4));
}

/// The samples with bytes changed, lost and doubled: read, or refused with a line of the file.
#[test]
fn mutated_samples_are_read_or_refused() {
    use rand::{RngExt, SeedableRng};
    let mut rng = chacha20::ChaCha8Rng::seed_from_u64(1);
    let mut refused = 0;
    for name in ["sample", "node", "compact", "canfestival"] {
        let sample = std::fs::read(folder().join(format!("{name}.eds"))).unwrap();
        for _ in 0..1000 {
            let mut text = sample.clone();
            for _ in 0..rng.random_range(1..8) {
                let (at, from) = (rng.random_range(0..text.len()), rng.random_range(0..sample.len()));
                match rng.random_range(0..3) {
                    0 => text[at] = rng.random(),
                    1 => drop(text.remove(at)),
                    _ => text.insert(at, sample[from]),
                }
            }
            if let Err(error) = Dcf::parse(&text) {
                refused += 1;
                assert!((1..=text.len()).contains(&error.line) && !error.message.is_empty(), "{error}");
            }
        }
    }
    assert!((100..3900).contains(&refused), "{refused}");
}
