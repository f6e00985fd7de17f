//! Which files a command may replace: those that the same command made, and others with `--force`.
//!
//! A page names in its head or its foot the program that made it; a JSON object is recognised by the keys of
//! its result, any other text by its first line, which is its header. A log is never recognised: it may be
//! the only one of its kind.

use super::Failure;
use serde_json::Value;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Text in every file that `powerball export` writes for a simulator.
pub(super) const EXPORTED: &str = "written by powerball export";

/// Whether `--force` was given to this process.
static FORCE: AtomicBool = AtomicBool::new(false);

/// Lets every file be replaced.
pub(super) fn replace_all() {
    FORCE.store(true, Ordering::Relaxed);
}

/// Results by name, with a key that no other file of this name has; of flat values all are numbers.
const RESULTS: [(&str, &str); 9] = [
    ("identified.json", "friction"),
    ("explained.json", "verdict"),
    ("model.json", "parameters"),
    ("covariance.json", "covariance"),
    ("comparison.json", "differ"),
    ("verified.json", "joints"),
    ("follow.json", "tracking_error"),
    ("log.json", "files"),
    ("consistent.json", ""),
];

/// Refuses a folder that has files with a result's names but from another source, before anything is
/// computed.
pub(super) fn check_folder(folder: &Path) -> Result<(), Failure> {
    let pages = std::iter::once("report.html");
    let mut names = RESULTS.iter().map(|(name, _)| *name).chain(pages);
    names.try_for_each(|name| check(&folder.join(name), None))
}

/// Refuses to replace a file that is not of the kind of `new`; without it by its name alone.
pub(super) fn check(target: &Path, new: Option<&[u8]>) -> Result<(), Failure> {
    // A pipe or a terminal holds nothing that could be lost.
    if FORCE.load(Ordering::Relaxed) || !target.is_file() {
        return Ok(());
    }
    // A file that cannot be read gives an error when it is written.
    let Ok(old) = std::fs::read(target) else { return Ok(()) };
    match old.is_empty() || is_alike(target, &old, new) {
        true => Ok(()),
        false => Err(refused(target)),
    }
}

/// Refuses to replace any file by a log, and always those that it is made of.
pub(super) fn check_log(target: &Path, inputs: &[&Path]) -> Result<(), Failure> {
    let same =
        |input: &&Path| matches!((input.canonicalize(), target.canonicalize()), (Ok(a), Ok(b)) if a == b);
    if inputs.iter().any(same) {
        let reason = format!("{}: is also an input: choose another file", target.display());
        return Err(Failure::Unusable(reason));
    }
    match target.is_file() && !FORCE.load(Ordering::Relaxed) {
        true => Err(refused(target)),
        false => Ok(()),
    }
}

fn refused(target: &Path) -> Failure {
    Failure::Unusable(format!(
        "{}: exists already, and this command may not have made it; --force overwrites it",
        target.display()
    ))
}

fn is_alike(target: &Path, old: &[u8], new: Option<&[u8]>) -> bool {
    let name = target.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let object = |bytes: &[u8]| match serde_json::from_slice(bytes) {
        Ok(Value::Object(object)) => Some(object),
        _ => None,
    };
    if name.ends_with(".html") {
        let page = String::from_utf8_lossy(old);
        return page.contains(crate::report::MADE_BY) || page.contains(" UTC, powerball ");
    }
    if let Some(own) = object(old) {
        let flat = |object: &serde_json::Map<String, Value>| object.values().all(Value::is_number);
        return match (RESULTS.iter().find(|(known, _)| *known == name), new.and_then(object)) {
            (Some((_, "")), _) => flat(&own),
            (Some((_, key)), _) => own.contains_key(*key),
            (None, Some(new)) => flat(&own) == flat(&new) && (flat(&new) || own.keys().eq(new.keys())),
            (None, None) => false,
        };
    }
    // The head of a summary is of its logs.
    if [Some(old), new].iter().all(|text| text.is_some_and(|text| text.starts_with(b"{\"format\""))) {
        return true;
    }
    let exported = |bytes: &[u8]| bytes.windows(EXPORTED.len()).any(|part| part == EXPORTED.as_bytes());
    if exported(old) {
        return new.is_some_and(exported);
    }
    let first = |bytes: &[u8]| bytes.split(|b| *b == b'\n').next().map(<[u8]>::to_vec);
    new.is_some_and(|new| first(old) == first(new))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_by_one_of_its_kind() {
        let page = format!("<!doctype html>{}<title>x</title>", crate::report::MADE_BY);
        for (name, old, new, alike) in [
            ("report.html", page.as_str(), "", true),
            ("report.html", "<!doctype html><title>my report</title>", "", false),
            ("identified.json", "{\"friction\": []}", "", true),
            ("identified.json", "{\"notes\": 1}", "", false),
            ("identified.json", "my notes", "", false),
            ("consistent.json", "{\"m1\": 1.5}", "", true),
            ("near.json", "{\"m1\": 1.5}", "{\"m1\": 2.0, \"m2\": 1}", true),
            ("near.json", "{\"m1\": \"mine\"}", "{\"m1\": 2.0}", false),
            ("path.csv", "t,q1\n0,1\n", "t,q1\n0,2\n", true),
            ("path.csv", "t,q1,tau1\n0,1,2\n", "t,q1\n0,2\n", false),
            ("model.rs", "fn main() {}\n", "//! A model.\n", false),
            (
                "a.sdf",
                "<?xml?><!-- written by powerball export, 1 -->",
                "<?xml?><!-- written by powerball export, 2 -->",
                true,
            ),
            ("a.sdf", "<?xml?>", "<?xml?><!-- written by powerball export, 2 -->", false),
        ] {
            assert_eq!(
                is_alike(Path::new(name), old.as_bytes(), Some(new.as_bytes())),
                alike,
                "{name}: {old}"
            );
        }
    }
}
