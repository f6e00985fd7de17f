//! What the pages name is there: files, folders and links. And their words are the field's.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::Path;

/// Without the library of this package, so that .ci/fast can compile this file by itself.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Words in backticks that look like a path of this repository, and targets of links.
fn paths(page: &str) -> Vec<String> {
    let code = page.split('`').skip(1).step_by(2);
    let first_folders = [
        "dyngen/",
        "dyngen-macros/",
        "powerball/",
        "tests/",
        "docs/",
        "examples/",
        "benches/",
        "firmware/",
        ".ci/",
        "python/",
    ];
    let named = code.filter(|w| first_folders.iter().any(|f| w.starts_with(f)) && !w.contains(' '));
    let links = page.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let local = links.filter(|l| !l.contains("://") && !l.starts_with('#'));
    named.chain(local).map(|p| p.split('#').next().unwrap().to_string()).collect()
}

#[test]
fn every_path_that_a_page_names_exists() {
    let mut checked = 0;
    let pages = pages().into_iter().map(|page| format!("docs/{page}"));
    for page in ["README.md", "ARCHITECTURE.md"].map(String::from).into_iter().chain(pages) {
        let text = std::fs::read_to_string(root().join(&page)).unwrap_or_else(|e| panic!("{page}: {e}"));
        let folder = root().join(&page).parent().unwrap().to_path_buf();
        for path in paths(&text) {
            assert!(root().join(&path).exists() || folder.join(&path).exists(), "{page} names {path}");
            checked += 1;
        }
    }
    assert!(checked > 30, "only {checked} paths were found: the test reads nothing");
}

/// The pages of docs/ and of docs/results/.
fn pages() -> Vec<String> {
    let of = |folder: &str| -> Vec<String> {
        let entries = std::fs::read_dir(root().join("docs").join(folder)).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned());
        names.filter(|name| name.ends_with(".md")).map(|name| format!("{folder}{name}")).collect()
    };
    [of(""), of("results/")].concat()
}

#[test]
fn the_site_lists_every_page_once() {
    let site = std::fs::read_to_string(root().join("mkdocs.yml")).unwrap();
    let (_, nav) = site.split_once("\nnav:\n").unwrap();
    let mut listed: Vec<&str> =
        nav.lines().filter_map(|line| Some(line.split_once(": ")?.1.trim())).collect();
    // `.ci/site` makes the first page of README.md.
    let mut pages = [vec![String::from("index.md")], pages()].concat();
    pages.sort();
    listed.sort_unstable();
    assert_eq!(listed, pages);
}

#[test]
fn the_architecture_names_every_folder_of_the_sources() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let crates = ["controller", "bus", "logs", "identification", "explanation", "virtual-arm", "commands"];
    let crates = crates.map(|name| format!("powerball/{name}/src"));
    for krate in
        crates.iter().map(String::as_str).chain(["dyngen/arm/src", "dyngen/verify/src", "dyngen/src"])
    {
        for entry in std::fs::read_dir(root().join(krate)).unwrap() {
            let entry = entry.unwrap();
            if entry.file_type().unwrap().is_dir() {
                let name = format!("{krate}/{}/", entry.file_name().to_string_lossy());
                let named = text.contains(&name) || text.contains(&format!("`{krate}/`"));
                assert!(named, "ARCHITECTURE.md does not name {name}");
            }
        }
    }
}

/// Words of a private vocabulary, each with what to write in its place.
const PLAIN: &str = "told: reported; beside: next to; bears: tolerates; errs: is off by; begun: started; \
    mend: correct; mended: corrected; dearest: longest; is said: is reported; are said: are reported; \
    not said: not reported; so many: the number; asks of: requires of; asked of: required of; \
    of others: other; hang together: depend on each other; held against: compared with; \
    looked at as: checked as; broken off: interrupted; the least with which: the smallest; \
    nobody builds what: each module is a feature; takes it as it is: exits with 0 anyway";

/// Further words that doc comments of the sources avoid.
const PLAIN_IN_SOURCES: &str = "untold: open; as above: the name of the item; speaks for: supports; \
    speak for: support; go on: continue; going on: continuing; hangs together: depends on each other; \
    what it errs: its error";
/// Words of [`PLAIN`] that some sources still have, generated code among them.
const NOT_YET_IN_SOURCES: [&str; 2] = ["of others", "nobody builds what"];

/// What `text` has of the words in `list`, with what to write in their place.
fn not_plain(name: &str, text: &str, list: &str) -> Vec<String> {
    // A mark of code is part of its word, so that keys of a file format are none of these words.
    let words = text.split(|c: char| !c.is_alphanumeric() && c != '`').filter(|word| !word.is_empty());
    let words = format!(" {} ", words.collect::<Vec<_>>().join(" ").to_lowercase());
    let pairs = list.split("; ").map(|pair| pair.split_once(": ").unwrap());
    let found = pairs.filter(|(word, _)| words.contains(&format!(" {word} ")));
    found.map(|(word, better)| format!("{name}: \"{word}\"; write \"{better}\"")).collect()
}

#[test]
fn pages_and_help_are_in_plain_words() {
    let read = |name: &str| std::fs::read_to_string(root().join(name)).unwrap();
    let mut texts = vec![("CHANGELOG.md".into(), read("CHANGELOG.md").split("\n## ").take(2).collect())];
    let pages = pages().into_iter().filter(|page| !page.contains('/')).map(|page| format!("docs/{page}"));
    for page in ["README.md", "KNOWN_GAPS.md"].map(String::from).into_iter().chain(pages) {
        texts.push((page.clone(), read(&page).split("```").step_by(2).collect::<String>()));
    }
    let mut commands = Vec::new();
    for folder in ["powerball/commands/src/commands/cli", "dyngen/src/cli"] {
        sources(folder, &mut commands);
    }
    for file in commands {
        let help = read(&file).lines().filter_map(|line| line.trim().strip_prefix("///")).collect();
        texts.push((file, help));
    }
    let wrong: Vec<String> = texts.iter().flat_map(|(name, text)| not_plain(name, text, PLAIN)).collect();
    assert!(texts.len() > 40 && wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The Rust files below a folder of the repository.
fn sources(folder: &str, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(root().join(folder)).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{folder}/{}", entry.file_name().to_string_lossy());
        if entry.file_type().unwrap().is_dir() {
            sources(&name, found);
        } else if name.ends_with(".rs") {
            found.push(name);
        }
    }
}

#[test]
fn doc_comments_are_in_plain_words() {
    let mut files = Vec::new();
    for krate in ["controller", "bus", "logs", "identification", "explanation", "virtual-arm", "commands"] {
        sources(&format!("powerball/{krate}/src"), &mut files);
    }
    for folder in [
        "powerball/src",
        "dyngen/arm/src",
        "dyngen/verify/src",
        "dyngen/src",
        "dyngen-macros/src",
        "xtask/src",
        "ros2_control/src",
    ] {
        sources(folder, &mut files);
    }
    let pairs = PLAIN.split("; ").chain(PLAIN_IN_SOURCES.split("; "));
    let gone = |pair: &&str| !NOT_YET_IN_SOURCES.contains(&pair.split_once(": ").unwrap().0);
    let list = pairs.filter(gone).collect::<Vec<_>>().join("; ");
    let mut wrong = Vec::new();
    for file in &files {
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        // A line of code stands between two comments, so that no words are taken from both.
        let docs = text
            .lines()
            .map(str::trim)
            .map(|line| line.strip_prefix("///").or_else(|| line.strip_prefix("//!")).unwrap_or("`"));
        wrong.extend(not_plain(file, &docs.collect::<Vec<_>>().join(" "), &list));
    }
    assert!(files.len() > 400 && wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Comments are as wide as rustfmt lets code be: it leaves them alone. Tables and code in them may be wider.
#[test]
fn comments_are_at_most_110_columns_wide() {
    let mut files = Vec::new();
    for folder in ["powerball", "dyngen", "dyngen-macros", "xtask", "ros2_control", "tests", "benches"] {
        sources(folder, &mut files);
    }
    files.retain(|file| !file.contains("/target/") && !file.contains("/golden/"));
    let mut wide = Vec::new();
    for file in &files {
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        let mut is_code = false;
        for (k, line) in text.lines().enumerate() {
            let Some(words) = line.trim().strip_prefix("//") else { continue };
            let words = words.trim_start_matches(['/', '!']).trim_start();
            is_code ^= words.starts_with("```");
            if line.chars().count() > 110 && !is_code && !words.starts_with('|') {
                wide.push(format!("{file}:{}", k + 1));
            }
        }
    }
    assert!(files.len() > 500 && wide.is_empty(), "wider than 110 columns: {}", wide.join(", "));
}

/// Python's `Rule` is written from the one of Rust: the same fields, words and defaults. With
/// `POWERBALL_BLESS` set it is written anew.
#[test]
fn the_thresholds_of_python_are_those_of_rust() {
    let source = std::fs::read_to_string(root().join("powerball/explanation/src/rule.rs")).unwrap();
    let (fields, rest) = source.split_once("pub struct Rule {\n").unwrap().1.split_once("\n}\n").unwrap();
    let (_, defaults) = rest.split_once("        Rule {\n").unwrap();
    let (defaults, _) = defaults.split_once("\n        }\n").unwrap();
    let default_of = |name: &str| {
        let given = defaults.lines().find_map(|line| line.trim().strip_prefix(name)?.strip_prefix(": "));
        given.unwrap_or_else(|| panic!("{name} has no default")).trim_end_matches(',').to_string()
    };
    let mut class = String::new();
    let mut words: Vec<String> = Vec::new();
    for line in fields.lines().map(str::trim) {
        if let Some(said) = line.strip_prefix("/// ") {
            let plain = said.replace("[`", "``").replace("`]", "``");
            words.extend(plain.split(' ').filter(|w| !w.is_empty()).map(
                |w| match w.split_once("``(Self::") {
                    Some((name, link)) => format!("{name}``{}", link.split_once(')').unwrap().1),
                    None => w.to_string(),
                },
            ));
        } else if let Some((name, kind)) = line.strip_prefix("pub ").and_then(|field| field.split_once(": "))
        {
            class += &wrapped(&words);
            words.clear();
            let kind = if kind.starts_with("usize") { "int" } else { "float" };
            class += &format!("    {name}: {kind} = {}\n", default_of(name));
        }
    }
    let path = root().join("python/package/powerball/rule.py");
    let page = std::fs::read_to_string(&path).unwrap();
    let (head, now) = page.split_once("    #: ").unwrap();
    let (_, foot) = now.split_once("\n\n\n").unwrap();
    let made = format!("{head}{class}\n\n{foot}");
    if std::env::var_os("POWERBALL_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
        return;
    }
    let run = "POWERBALL_BLESS=1 cargo test --release -p powerball-workspace --test docs";
    assert!(made == page, "{} is not what rule.rs says; run {run}", path.display());
}

/// Words as a comment of Python, 108 wide.
fn wrapped(words: &[String]) -> String {
    let mut lines = vec![String::from("    #:")];
    for word in words {
        if lines.last().unwrap().chars().count() + 1 + word.chars().count() > 108 {
            lines.push("    #:".into());
        }
        *lines.last_mut().unwrap() += &format!(" {word}");
    }
    lines.iter().map(|line| format!("{line}\n")).collect()
}
