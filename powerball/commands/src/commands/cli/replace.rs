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
const RESULTS: [(&str, &str); 11] = [
    ("identified.json", "friction"),
    ("explained.json", "verdict"),
    ("model.json", "parameters"),
    ("covariance.json", "covariance"),
    ("comparison.json", "differ"),
    ("verified.json", "joints"),
    ("follow.json", "tracking_error"),
    ("log.json", "files"),
    ("friction.json", "joints"),
    ("warm_up.json", "warm"),
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

/// What the names of the layouts next to an MCAP end with.
const LAYOUTS: [&str; 2] = ["foxglove.json", "plotjuggler.xml"];

/// Refuses to replace any file by a log or by the layouts next to an MCAP, and always those that it is made
/// of.
pub(super) fn check_log(target: &Path, inputs: &[&Path]) -> Result<(), Failure> {
    check_inputs(target, inputs)?;
    let is_mcap = target.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("mcap"));
    let layouts = LAYOUTS.iter().filter(|_| is_mcap).map(|kind| target.with_extension(kind));
    for file in std::iter::once(target.to_path_buf()).chain(layouts) {
        if file.is_file() && !FORCE.load(Ordering::Relaxed) {
            return Err(refused(&file));
        }
    }
    Ok(())
}

/// Refuses to write over an input, also with `--force`.
pub(super) fn check_inputs(target: &Path, inputs: &[&Path]) -> Result<(), Failure> {
    let same =
        |input: &&Path| matches!((input.canonicalize(), target.canonicalize()), (Ok(a), Ok(b)) if a == b);
    if inputs.iter().any(same) {
        let reason = format!("{}: is also an input: choose another file", target.display());
        return Err(Failure::Unusable(reason));
    }
    Ok(())
}

fn refused(target: &Path) -> Failure {
    Failure::Unusable(format!(
        "{}: exists already, and this command may not have made it; --force overwrites it",
        target.display()
    ))
}

/// Whether a text is as this program writes the object.
fn is_own_layout(object: &serde_json::Map<String, Value>, text: &[u8]) -> bool {
    crate::report::files::json(object).is_ok_and(|own| own.as_bytes() == text)
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
            (_, None) if new.is_some_and(|new| !new.is_empty()) => false,
            (Some((_, "")), _) => flat(&own),
            (Some((_, key)), _) => own.contains_key(*key),
            // Values are also what others give to this command: its own have its layout too.
            (None, Some(new)) => own.keys().eq(new.keys()) && (!flat(&new) || is_own_layout(&own, old)),
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

/// Folders of commands that write many files.
#[cfg(feature = "cli")]
pub(super) mod own_folder {
    use super::super::{Cli, Failure};
    use clap::CommandFactory;
    use std::path::{Path, PathBuf};
    use std::sync::atomic::Ordering;

    /// Refuses a folder in which files begin with these names and no page is of this command, before anything
    /// is computed: for results that are many files, of which most are not recognised.
    pub(in super::super) fn check(folder: &Path, names: &[&str]) -> Result<(), Failure> {
        let page = std::fs::read(folder.join("report.html"));
        if super::FORCE.load(Ordering::Relaxed) || page.is_ok_and(|page| is_page_of(own().as_deref(), &page))
        {
            return Ok(());
        }
        let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let named = |file: &PathBuf| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            names.iter().any(|begin| name.starts_with(begin))
        };
        files.filter(|file| file.is_file()).find(named).map_or(Ok(()), |file| Err(super::refused(&file)))
    }

    /// The name of the command that this process runs.
    fn own() -> Option<String> {
        command(std::env::args())
    }

    /// Whether a page is of the command with this name, as its foot says.
    fn is_page_of(own: Option<&str>, page: &[u8]) -> bool {
        let page = String::from_utf8_lossy(page);
        let foot = page.rsplit_once(" UTC, powerball ").map(|(_, foot)| foot);
        let made = foot.and_then(|foot| command(foot.split(['<', ' ']).map(str::to_string)));
        made.is_some() && made.as_deref() == own
    }

    /// The command's name among the words of a command line.
    fn command(mut words: impl Iterator<Item = String>) -> Option<String> {
        let cli = Cli::command();
        words.find(|word| cli.get_subcommands().any(|known| known.get_name() == word.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_by_one_of_its_kind() {
        let page = format!("<!doctype html>{}<title>x</title>", crate::report::MADE_BY);
        let values = "{\n  \"m1\": 1.5,\n  \"m2\": 1.0\n}";
        for (name, old, new, alike) in [
            ("report.html", page.as_str(), "", true),
            ("report.html", "<!doctype html><title>my report</title>", "", false),
            ("identified.json", "{\"friction\": []}", "", true),
            ("identified.json", "{\"notes\": 1}", "", false),
            ("identified.json", "{\"friction\": []}", "fn code() {}", false),
            ("identified.json", "my notes", "", false),
            ("consistent.json", "{\"m1\": 1.5}", "", true),
            ("near.json", values, "{\"m1\": 2.0, \"m2\": 1}", true),
            ("near.json", values, "{\"m1\": 2.0, \"mx1\": 1}", false),
            ("near.json", "{\"m1\": 1.5, \"m2\": 1.0}", "{\"m1\": 2.0, \"m2\": 1}", false),
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
