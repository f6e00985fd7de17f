//! ARCHITECTURE.md is true: every folder that it lists is there, every folder of the sources is listed, code
//! uses what stands further up and nothing that stands further down, and folders do not use each other in a
//! circle.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The crates whose order the page gives; cargo holds the order among them.
const CRATES: [&str; 10] = [
    "dyngen/arm",
    "dyngen/verify",
    "dyngen",
    "powerball/controller",
    "powerball/bus",
    "powerball/logs",
    "powerball/identification",
    "powerball/explanation",
    "powerball/virtual-arm",
    "powerball/commands",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Places of a crate's sources in the order of the page: `log` for the row of `powerball/logs/src/log/`,
/// `model` for that of `dyngen/src/model.rs`; empty for the row of a whole crate. One row may name several;
/// they stand in the order in which it names them.
fn order(page: &str, name: &str) -> Vec<String> {
    let rows = page.lines().filter(|line| line.starts_with('|'));
    let cells = rows.filter_map(|line| line.split('|').nth(1));
    let named = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2));
    let start = format!("{name}/src/");
    let place = |path: &str| path.trim_end_matches('/').trim_end_matches(".rs").to_string();
    named.filter_map(|path| path.strip_prefix(&start)).map(place).collect()
}

/// All source files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// A file's module path below the crate, `["logs", "log", "read"]`; nothing for tests, whose use of other
/// rooms is free.
fn module(source: &Path, file: &Path) -> Option<Vec<String>> {
    let inside = file.strip_prefix(source).unwrap().with_extension("");
    let mut parts: Vec<String> = inside.iter().map(|p| p.to_string_lossy().into_owned()).collect();
    if parts.last().is_some_and(|p| p == "mod") {
        parts.pop();
    }
    let free = |p: &String| p == "tests" || p == "lib" || p == "main";
    (!parts.iter().any(free)).then_some(parts)
}

/// The code of a file without comments and without its unit tests.
fn code(file: &Path) -> String {
    let text = fs::read_to_string(file).unwrap();
    let begins_tests = |line: &&str| line.starts_with("mod ") && line.ends_with("tests {");
    let code = text.lines().take_while(|line| !begins_tests(line));
    code.filter(|line| !line.trim_start().starts_with("//")).map(|line| format!("{line}\n")).collect()
}

/// Every path that begins with `start` (`crate`, `super`), as its segments after that; groups in braces are
/// followed.
fn paths(code: &str, start: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices(&format!("{start}::")) {
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
            continue;
        }
        tree(&code[at + start.len() + 2..], &mut Vec::new(), &mut found);
    }
    found
}

/// Reads what follows `a::`; returns how much of it was read.
fn tree(text: &str, prefix: &mut Vec<String>, found: &mut Vec<Vec<String>>) -> usize {
    if !text.starts_with('{') {
        let name: String = text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        prefix.push(name.clone());
        let rest = &text[name.len()..];
        let used = match rest.strip_prefix("::") {
            Some(more) => name.len() + 2 + tree(more, prefix, found),
            None => {
                found.push(prefix.clone());
                name.len()
            }
        };
        prefix.pop();
        return used;
    }
    let mut at = 1;
    loop {
        let skipped = text[at..].find(|c: char| !c.is_whitespace() && c != ',').unwrap_or(0);
        at += skipped;
        if text[at..].starts_with('}') || at >= text.len() {
            return at + 1;
        }
        let used = tree(&text[at..], prefix, found);
        at += used;
        // `as name` and whatever else stands before the next comma at this depth.
        at += text[at..].find([',', '}']).unwrap_or(text.len() - at);
    }
}

/// The place in the list that a module belongs to: the longest that it lies in.
fn place(order: &[String], module: &[String]) -> Option<usize> {
    (0..=module.len()).rev().find_map(|n| order.iter().position(|place| *place == module[..n].join("/")))
}

#[test]
fn code_uses_what_stands_above_it_on_the_page() {
    let page = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let mut wrong = BTreeSet::new();
    for name in CRATES {
        let source = root().join(name).join("src");
        let order = order(&page, name);
        assert!(!order.is_empty(), "ARCHITECTURE.md lists nothing of {name}");
        for place in &order {
            let there = source.join(place).is_dir() || source.join(format!("{place}.rs")).is_file();
            assert!(there, "ARCHITECTURE.md names {name}/src/{place}, which is not there");
        }
        for file in sources(&source) {
            let Some(own) = module(&source, &file) else { continue };
            let shown = file.strip_prefix(root()).unwrap().display().to_string();
            let Some(here) = place(&order, &own) else {
                // A room's own `mod.rs` only says what lives in it.
                let room = order.iter().any(|place| place.starts_with(&format!("{}/", own.join("/"))));
                if !room {
                    wrong.insert(format!("{shown} has no row in ARCHITECTURE.md"));
                }
                continue;
            };
            for path in paths(&code(&file), "crate") {
                if let Some(there) = place(&order, &path).filter(|there| *there > here) {
                    let (a, b) = (&order[here], &order[there]);
                    wrong.insert(format!(
                        "{shown}: {a} uses {b} ({}), which stands below it",
                        path.join("::")
                    ));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.into_iter().collect::<Vec<_>>().join("\n"));
}

type Arrows = BTreeMap<Vec<String>, BTreeSet<Vec<String>>>;

/// Whether a way along the arrows leads from one folder to another.
fn reaches(arrows: &Arrows, from: &Vec<String>, goal: &Vec<String>) -> bool {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(next) = open.pop() {
        if next == goal {
            return true;
        }
        if seen.insert(next) {
            open.extend(arrows.get(next).into_iter().flatten());
        }
    }
    false
}

/// All modules that a file names, as paths below the crate; `parent` is the folder's.
fn used(code: &str, parent: &[String]) -> Vec<Vec<String>> {
    let relative = paths(code, "super").into_iter().filter_map(|path| {
        let up = path.iter().take_while(|p| *p == "super").count();
        let from = parent.get(..parent.len().checked_sub(up)?)?;
        Some(from.iter().chain(&path[up..]).cloned().collect())
    });
    paths(code, "crate").into_iter().chain(relative).collect()
}

/// Files of one folder tell one thing together and may use each other; a folder and what lies in it as well.
#[test]
fn folders_do_not_use_each_other_in_a_circle() {
    let mut circles = Vec::new();
    for name in CRATES {
        let source = root().join(name).join("src");
        let mut arrows = Arrows::new();
        let files: Vec<(Vec<String>, PathBuf)> =
            sources(&source).into_iter().filter_map(|f| Some((module(&source, &f)?, f))).collect();
        let folder = |(module, file): &(Vec<String>, PathBuf)| match file.ends_with("mod.rs") {
            true => module.clone(),
            false => module[..module.len() - 1].to_vec(),
        };
        // That of the longest module which a path begins with.
        let folder_of = |path: &[String]| {
            let own = files.iter().filter(|(module, _)| path.starts_with(module));
            own.max_by_key(|(module, _)| module.len()).map(folder)
        };
        for file in files.iter().filter(|(_, f)| !f.ends_with("mod.rs")) {
            let own = folder(file);
            let others = used(&code(&file.1), &own).into_iter().filter_map(|path| folder_of(&path));
            let apart = |other: &Vec<String>| !other.starts_with(&own) && !own.starts_with(other);
            arrows.entry(own.clone()).or_default().extend(others.filter(apart));
        }
        for (from, to) in &arrows {
            for to in to.iter().filter(|to| reaches(&arrows, to, from)) {
                circles.push(format!("{name}: {} uses {}", from.join("/"), to.join("/")));
            }
        }
    }
    assert!(circles.is_empty(), "each of these arrows is part of a circle:\n{}", circles.join("\n"));
}

/// What stands below itself in the table of a folder's `mod.rs`, which gives its files in the order in which
/// they may use each other.
fn against_the_table(crate_source: &str, folder: &str) -> BTreeSet<String> {
    let source = root().join(crate_source);
    let page = fs::read_to_string(source.join(folder).join("mod.rs")).unwrap();
    let rows = page.lines().filter_map(|line| line.strip_prefix("//! |")?.split('|').next());
    let order: Vec<String> =
        rows.flat_map(|cell| cell.split('`').skip(1).step_by(2)).map(str::to_string).collect();
    assert!(order.len() > 5, "{folder}/mod.rs has no table of its files: {order:?}");
    let mut wrong = BTreeSet::new();
    for file in sources(&source.join(folder)) {
        let Some(own) = module(&source, &file).filter(|own| own.len() > 1) else { continue };
        let Some(here) = order.iter().position(|name| *name == own[1]) else {
            wrong.insert(format!("{folder}/{} has no row", own[1]));
            continue;
        };
        let parent = if file.ends_with("mod.rs") { &own[..] } else { &own[..own.len() - 1] };
        for path in used(&code(&file), parent) {
            let there =
                (path[0] == folder).then(|| order.iter().position(|other| path.get(1) == Some(other)));
            if let Some(there) = there.flatten().filter(|there| *there > here) {
                wrong.insert(format!("{} uses {}, which stands below it", own.join("/"), order[there]));
            } else if there == Some(None) {
                wrong.insert(format!("{} uses {} of mod.rs: name its file", own.join("/"), path[1]));
            }
        }
    }
    wrong
}

#[test]
fn files_use_what_stands_above_them_in_the_table_of_their_folder() {
    let folders = [("powerball/explanation/src", "explain"), ("powerball/bus/src", "driver")];
    let wrong: Vec<String> =
        folders.iter().flat_map(|(source, name)| against_the_table(source, name)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn paths_are_read_as_the_compiler_reads_them() {
    let code = "use crate::a::{self, b::{C, d}, e as f};\nlet x = crate::g::h(1); xcrate::no::no; $crate::y;";
    let found: Vec<String> = paths(code, "crate").iter().map(|p| p.join("::")).collect();
    assert_eq!(found, ["a::self", "a::b::C", "a::b::d", "a::e", "g::h", "y"]);
}

/// Files of the runtime that compare something with chance by themselves: each is a judge of its own. Whoever
/// asks whether columns explain rows calls `powerball/identification/src/evidence/`, and adds none here.
const JUDGES: [&str; 13] = [
    "powerball/commands/src/procedure/settling.rs",
    "powerball/explanation/src/experiment/decide.rs",
    "powerball/explanation/src/explain/above_band.rs",
    "powerball/explanation/src/explain/comparison/withhold.rs",
    "powerball/explanation/src/explain/results/conclude.rs",
    "powerball/explanation/src/explain/search/evidence.rs",
    "powerball/explanation/src/servo/by_log.rs",
    "powerball/explanation/src/servo/candidates.rs",
    "powerball/explanation/src/servo/mod.rs",
    "powerball/identification/src/comparison/cause.rs",
    "powerball/identification/src/comparison/differences.rs",
    "powerball/identification/src/comparison/strokes.rs",
    "powerball/identification/src/transmission/search.rs",
];

#[test]
fn no_further_file_compares_with_chance_by_itself() {
    let words = ["f_tail", "t_critical", "t_quantile_975", "p_of_sum", "p_of_coefficients"];
    let mut found = BTreeSet::new();
    for folder in ["controller", "bus", "logs", "identification", "explanation", "commands"] {
        for file in sources(&root().join("powerball").join(folder).join("src")) {
            let name = file.strip_prefix(root()).unwrap().to_string_lossy().into_owned();
            let is_shared = ["/evidence/", "/estimate/", "/tests/"].iter().any(|room| name.contains(room));
            let text = fs::read_to_string(&file).unwrap();
            let mut names = text.split(|c: char| !c.is_alphanumeric() && c != '_');
            if !is_shared && !name.ends_with("tests.rs") && names.any(|name| words.contains(&name)) {
                found.insert(name);
            }
        }
    }
    assert_eq!(found, JUDGES.map(String::from).into(), "ask powerball_identification::evidence instead");
}
