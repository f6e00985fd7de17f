//! Robot descriptions from the disk: what a model includes is in it, and letters are read as they were
//! written.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::export::{self, Known};
use dyngen::import::{self, Imported, Options, Source};
use std::fs;
use std::path::{Path, PathBuf};

const ARM: &str = include_str!("mjcf/arm.xml");
const PUMA: &str = include_str!("urdf/puma.urdf");

/// An empty folder of a test's own.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("source").join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(folder.join("parts")).unwrap();
    folder
}

fn imported(path: &Path) -> Imported {
    import::source(&Source::read(path).unwrap(), &Options::default()).unwrap()
}

/// What is wrong with a model of which these are the files, the first the model.
fn error(name: &str, files: &[(&str, &str)]) -> String {
    let folder = folder(name);
    files.iter().for_each(|(file, text)| fs::write(folder.join(file), text).unwrap());
    let source = Source::read(&folder.join(files[0].0));
    let message = match source {
        Ok(source) => import::source(&source, &Options::default()).unwrap_err().to_string(),
        Err(e) => e.to_string(),
    };
    message.replace(&format!("{}/", folder.display()), "")
}

/// The arm in four files: its classes, a body, and the actuators, which the body's file includes from the
/// model's folder.
fn in_parts(folder: &Path) -> PathBuf {
    let piece = |from: &str, to: &str| {
        let start = ARM.find(from).unwrap();
        ARM[start..start + ARM[start..].find(to).unwrap() + to.len()].to_string()
    };
    let classes = piece("<default>", "\n  </default>\n");
    let hand = piece("<body name=\"hand\"", "</body>");
    let model = ARM
        .replace(&classes, "<include file=\"parts/classes.xml\"/>\n")
        .replace(&hand, "<include file='parts/hand.xml'></include>");
    assert_eq!(model.matches("<include").count(), 2);
    // Alone in its file: MuJoCo takes what lies below the root element, whatever that is called.
    let inertial = piece("<inertial pos=\"0.02 0 0.03\"", "/>");
    let hand = hand.replace(&inertial, "<include file=\"inertia.xml\"/>");
    fs::write(folder.join("parts/classes.xml"), format!("<mujoco>\n{classes}</mujoco>\n")).unwrap();
    fs::write(folder.join("parts/hand.xml"), format!("<mujocoinclude>{hand}\n</mujocoinclude>")).unwrap();
    fs::write(folder.join("parts/inertia.xml"), format!("<x>{inertial}</x>")).unwrap();
    let path = folder.join("model.xml");
    fs::write(&path, model).unwrap();
    path
}

#[test]
fn a_model_in_parts_is_the_model() {
    let path = in_parts(&folder("parts"));
    let (parts, whole) = (imported(&path), import::mjcf(ARM, "arm.xml", &Options::default()).unwrap());
    assert_eq!(parts.arm, whole.arm);
    assert_eq!(parts.values, whole.values);
    let source = Source::read(&path).unwrap();
    assert_eq!(source.included(), ["parts/classes.xml", "parts/hand.xml", "inertia.xml"]);

    // The way back holds all parts.
    let known = Known::read(&parts.arm, (&parts.values_json(), "v.json"), None).unwrap();
    let new = export::mjcf(&source.text, "model.xml", &parts.arm, &known, &Options::default()).unwrap();
    let again = import::mjcf(&new.text, "new.xml", &Options::default()).unwrap();
    assert_eq!(again.arm, parts.arm);
}

/// MuJoCo looks in the model's folder first.
#[test]
fn a_part_next_to_the_model_is_before_one_next_to_the_part() {
    let path = in_parts(&folder("beside"));
    let heavy = "<x><inertial pos=\"0 0 0\" mass=\"80\" diaginertia=\"1 1 1\"/></x>";
    fs::write(path.with_file_name("inertia.xml"), heavy).unwrap();
    let mass = imported(&path).values.iter().find(|(p, _)| p.to_string() == "m4").unwrap().1;
    assert_eq!(mass, 80.0);
}

#[test]
fn what_cannot_be_included_is_reported_with_file_and_line() {
    let model = "<mujoco>\n  <include file=\"parts/a.xml\"/>\n</mujoco>";
    let missing = error("missing", &[("m.xml", model)]);
    assert!(
        missing.starts_with("m.xml: line 2: <include file=\"parts/a.xml\"> cannot be read: "),
        "{missing}"
    );
    let circle =
        error("circle", &[("m.xml", model), ("parts/a.xml", "<x>\n\n<include file=\"m.xml\"/></x>")]);
    assert_eq!(
        circle,
        "m.xml: line 2: <include file=\"parts/a.xml\">: parts/a.xml: line 3: <include file=\"m.xml\"> is \
         included already, once is all that MuJoCo allows"
    );
    let empty = error("empty", &[("m.xml", model), ("parts/a.xml", "<x/>")]);
    assert_eq!(empty, "m.xml: line 2: <include file=\"parts/a.xml\"> has nothing to include");
    let broken = error("broken", &[("m.xml", model), ("parts/a.xml", "<x>\n<body>\n</x>")]);
    assert!(broken.starts_with("m.xml: line 2: <include file=\"parts/a.xml\">: line 3: "), "{broken}");
    let unnamed = error("unnamed", &[("m.xml", "<mujoco>\n\n<include/></mujoco>")]);
    assert_eq!(unnamed, "m.xml: line 3: <include> names no file");
}

/// A device never ends: it is no part of a model. A file from elsewhere is one, and said.
#[cfg(unix)]
#[test]
fn what_is_included_from_elsewhere_is_a_file_and_said() {
    let device = error("device", &[("m.xml", "<mujoco>\n<include file=\"/dev/zero\"/>\n</mujoco>")]);
    assert!(device.starts_with("m.xml: line 2: <include file=\"/dev/zero\"> cannot be read: "), "{device}");
    assert!(device.contains("a pipe or a device"), "{device}");
    let itself = Source::read(Path::new("/dev/zero")).unwrap_err().to_string();
    assert!(itself.contains("a pipe or a device"), "{itself}");

    let path = in_parts(&folder("elsewhere/model"));
    let parts = path.with_file_name("parts");
    assert!(imported(&path).notes.iter().all(|note| !note.contains("outside")));
    fs::rename(parts.join("hand.xml"), path.parent().unwrap().join("../hand.xml")).unwrap();
    fs::copy(parts.join("inertia.xml"), path.with_file_name("inertia.xml")).unwrap();
    let model = fs::read_to_string(&path).unwrap().replace("parts/hand.xml", "../hand.xml");
    fs::write(&path, model).unwrap();
    let notes = imported(&path).notes;
    let said = notes.iter().find(|note| note.contains("outside of the model's folder")).unwrap();
    assert!(
        said.starts_with("<include file=\"../hand.xml\">") && said.ends_with("elsewhere/hand.xml"),
        "{said}"
    );
}

/// Lines are those of the file in which somebody has to look.
#[test]
fn lines_are_those_of_the_part() {
    let path = in_parts(&folder("lines"));
    let hand = path.with_file_name("parts").join("hand.xml");
    let text = fs::read_to_string(&hand).unwrap().replace("range=\"-10 10\"", "damping=\"much\"");
    let line = text.lines().position(|l| l.contains("much")).unwrap() + 1;
    fs::write(&hand, text).unwrap();
    let message = import::source(&Source::read(&path).unwrap(), &Options::default()).unwrap_err().to_string();
    assert!(message.contains(&format!("line {line} of parts/hand.xml: joint 'turn'")), "{message}");

    // Behind a part the model's own lines go on.
    let model = fs::read_to_string(&path).unwrap().replace("<actuator>", "<attach/><actuator>");
    let line = model.lines().position(|l| l.contains("<attach/>")).unwrap() + 1;
    fs::write(&path, model).unwrap();
    let message = import::source(&Source::read(&path).unwrap(), &Options::default()).unwrap_err().to_string();
    assert!(message.contains(&format!("line {line}: <attach>")), "{message}");
}

fn utf16(text: &str, big_endian: bool, mark: bool) -> Vec<u8> {
    let words = mark.then_some(0xfeff).into_iter().chain(text.encode_utf16());
    words.flat_map(|w| if big_endian { w.to_be_bytes() } else { w.to_le_bytes() }).collect()
}

#[test]
fn letters_are_read_as_they_were_written() {
    let folder = folder("letters");
    let text = PUMA.replace("waist", "taille é");
    let plain = import::urdf(&text, "robot.urdf", &Options::default()).unwrap();
    let latin: Vec<u8> = text.chars().map(|c| u8::try_from(c).unwrap_or(b'?')).collect();
    let mut marked = b"\xef\xbb\xbf".to_vec();
    marked.extend(text.as_bytes());
    let mut all = vec![text.as_bytes().to_vec(), latin, marked];
    for big_endian in [false, true] {
        all.extend([true, false].map(|mark| utf16(&text, big_endian, mark)));
    }
    for (k, bytes) in all.into_iter().enumerate() {
        let path = folder.join(format!("{k}.urdf"));
        fs::write(&path, &bytes).unwrap();
        let source = Source::read(&path).unwrap();
        let imported = import::source(&source, &Options::default()).unwrap();
        assert_eq!(imported.arm, plain.arm, "{k}");
        // What is written has the letters that were read.
        if k != 1 {
            assert_eq!(source.bytes(&source.text), bytes, "{k}");
        }
        let known = Known::read(&plain.arm, (&plain.values_json(), "v.json"), None).unwrap();
        let new = export::urdf(&source.text, "", &plain.arm, &known, &Options::default()).unwrap().text;
        fs::write(&path, source.bytes(&new)).unwrap();
        assert_eq!(self::imported(&path).arm, plain.arm, "{k}");
    }
    let path = folder.join("torn.urdf");
    let mut torn = utf16(&text, false, true);
    torn.pop();
    fs::write(&path, torn).unwrap();
    let message = Source::read(&path).unwrap_err().to_string();
    assert!(
        message.ends_with("torn.urdf: it is UTF-16 that breaks off within a letter: save it as UTF-8"),
        "{message}"
    );
}
