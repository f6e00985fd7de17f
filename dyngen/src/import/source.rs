//! A robot description from the disk: its letters, and the files that it includes in their places.

use super::ImportError;
use super::mjcf::is_mjcf;
use super::urdf::{broken, nested};
use roxmltree::{Document, Node};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The text of a robot description.
///
/// A MuJoCo model has in it what it includes. As in MuJoCo each file may be included once, and its place is
/// looked for from the folder of the model first, from that of the including file then.
#[derive(Clone, Debug)]
pub struct Source {
    /// The whole text.
    pub text: String,
    /// What the file is called in errors.
    pub file: String,
    letters: Letters,
    /// The files that are included, by their names.
    included: Vec<String>,
    /// Notes on those that lie outside of the model's folder.
    outside: Vec<String>,
    /// For each line of the text the file that it is from, 0 the description itself, and its line there.
    lines: Vec<(usize, u32)>,
}

/// How a file writes letters as bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Letters {
    Utf8,
    /// Old files, which mostly do not say it: each byte is the letter of that number.
    Latin1,
    Utf16 {
        big_endian: bool,
    },
}

impl Letters {
    /// As the first bytes say it: a byte order mark, or `<` as a half word.
    fn of(bytes: &[u8]) -> Letters {
        match bytes {
            [0xfe, 0xff, ..] | [0, b'<', ..] => Letters::Utf16 { big_endian: true },
            [0xff, 0xfe, ..] | [b'<', 0, ..] => Letters::Utf16 { big_endian: false },
            _ if std::str::from_utf8(bytes).is_ok() => Letters::Utf8,
            _ => Letters::Latin1,
        }
    }

    fn text(self, bytes: &[u8]) -> Result<String, String> {
        match self {
            Letters::Utf8 | Letters::Latin1 => {
                let latin = || bytes.iter().map(|byte| char::from(*byte)).collect();
                Ok(std::str::from_utf8(bytes).map_or_else(|_| latin(), str::to_string))
            }
            Letters::Utf16 { big_endian } => {
                let (halves, rest) = bytes.as_chunks::<2>();
                let word = if big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
                let words: Vec<u16> = halves.iter().map(|half| word(*half)).collect();
                match String::from_utf16(&words) {
                    Ok(text) if rest.is_empty() => Ok(text),
                    _ => Err("it is UTF-16 that breaks off within a letter: save it as UTF-8".to_string()),
                }
            }
        }
    }

    fn bytes(self, text: &str) -> Vec<u8> {
        match self {
            Letters::Utf8 => text.as_bytes().to_vec(),
            // Letters that Latin-1 does not have can be in comments only.
            Letters::Latin1 => text.chars().map(|c| u8::try_from(c).unwrap_or(b'?')).collect(),
            Letters::Utf16 { big_endian } => text
                .encode_utf16()
                .flat_map(|word| if big_endian { word.to_be_bytes() } else { word.to_le_bytes() })
                .collect(),
        }
    }
}

impl Source {
    /// Reads a file in UTF-8, UTF-16 or Latin-1, and what it includes.
    ///
    /// # Errors
    /// Where a file cannot be read, or an `<include>` cannot be followed: its name, and the line that names
    /// it.
    pub fn read(path: &Path) -> Result<Source, ImportError> {
        let file = path.display().to_string();
        let unreadable = |e: String| ImportError::Unreadable(format!("{file}: {e}"));
        let bytes = crate::file::read(path).map_err(|e| unreadable(format!("cannot be read: {e}")))?;
        let letters = Letters::of(&bytes);
        let text = letters.text(&bytes).map_err(unreadable)?;
        // What is wrong with a text that is no XML is reported by who reads it.
        let followed = nested(&text).is_ok() && is_mjcf(&text) && text.contains("<include");
        let document = if followed { Document::parse(&text).ok() } else { None };
        let Some(document) = document else {
            return Ok(Source { letters, ..Source::of_text(&text, &file) });
        };
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let mut whole = Whole {
            text: String::new(),
            lines: vec![(0, 1)],
            names: vec![file.clone()],
            seen: path.canonicalize().into_iter().collect(),
            folder: folder.clone(),
            outside: Vec::new(),
        };
        whole.append(&text, 0..text.len(), &document, 0, &folder).map_err(ImportError::Unreadable)?;
        let Whole { text, lines, mut names, outside, .. } = whole;
        let included = names.split_off(1);
        Ok(Source { text, file, letters, included, outside, lines })
    }

    /// Whether it is a MuJoCo model, and no URDF.
    pub fn is_mjcf(&self) -> bool {
        is_mjcf(&self.text)
    }

    /// A text that includes nothing; `file` names it in errors.
    pub fn of_text(text: &str, file: &str) -> Source {
        let letters = Letters::Utf8;
        Source {
            text: text.to_string(),
            file: file.to_string(),
            letters,
            included: vec![],
            outside: vec![],
            lines: vec![],
        }
    }

    /// The bytes of a text that takes this one's place.
    pub fn bytes(&self, text: &str) -> Vec<u8> {
        self.letters.bytes(text)
    }

    /// The files that are in the text.
    pub fn included(&self) -> &[String] {
        &self.included
    }

    /// Notes on included files that lie outside of the model's folder.
    pub(super) fn outside(&self) -> &[String] {
        &self.outside
    }

    /// A message about the text, with its lines as those of the files that they are from.
    pub fn placed(&self, message: &str) -> String {
        let mut pieces = message.split("line ");
        let mut placed = pieces.next().unwrap_or("").to_string();
        for piece in pieces {
            let digits = piece.len() - piece.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            let (number, rest) = piece.split_at(digits);
            let line = number.parse::<usize>().ok().and_then(|n| self.lines.get(n.checked_sub(1)?));
            placed += "line ";
            placed += &match line {
                Some((0, line)) => line.to_string(),
                Some((file, line)) => format!("{line} of {}", self.included[file - 1]),
                None => number.to_string(),
            };
            placed += rest;
        }
        placed
    }
}

/// A model that is put together.
struct Whole {
    text: String,
    lines: Vec<(usize, u32)>,
    /// Of all files, that of the model first.
    names: Vec<String>,
    seen: BTreeSet<PathBuf>,
    /// Of the model.
    folder: PathBuf,
    /// Notes on included files that lie elsewhere.
    outside: Vec<String>,
}

impl Whole {
    /// Adds a part of a file, which lies in `folder`, with what it includes.
    fn append(
        &mut self,
        text: &str,
        part: std::ops::Range<usize>,
        document: &Document<'_>,
        file: usize,
        folder: &Path,
    ) -> Result<(), String> {
        let mut at = part.start;
        let includes = document.descendants().filter(|n| n.has_tag_name("include"));
        for node in includes {
            let place = node.range();
            self.verbatim(&text[at..place.start], document.text_pos_at(at).row, file);
            let line = document.text_pos_at(place.start).row;
            self.include(node, folder).map_err(|e| format!("{}: line {line}: {e}", self.names[file]))?;
            at = place.end;
        }
        self.verbatim(&text[at..part.end], document.text_pos_at(at).row, file);
        Ok(())
    }

    fn verbatim(&mut self, text: &str, first: u32, file: usize) {
        self.text += text;
        let breaks = text.matches('\n').count() as u32;
        self.lines.extend((1..=breaks).map(|k| (file, first + k)));
    }

    fn include(&mut self, node: Node<'_, '_>, folder: &Path) -> Result<(), String> {
        let name = node.attribute("file").ok_or("<include> names no file")?;
        let this = format!("<include file=\"{name}\">");
        let here = self.folder.join(name);
        let path = if here.exists() { here } else { folder.join(name) };
        let unreadable = |e: std::io::Error| {
            format!("{this} cannot be read: {e}: its place is relative to the model's folder")
        };
        let bytes = crate::file::read(&path).map_err(unreadable)?;
        let place = path.canonicalize().map_err(unreadable)?;
        let inside = self.folder.join(".").canonicalize().is_ok_and(|own| place.starts_with(own));
        if !inside {
            let what = format!("{this} lies outside of the model's folder: {}", place.display());
            self.outside.push(what);
        }
        if !self.seen.insert(place) {
            return Err(format!("{this} is included already, once is all that MuJoCo allows"));
        }
        let text = Letters::of(&bytes).text(&bytes).map_err(|e| format!("{this}: {e}"))?;
        nested(&text).map_err(|e| format!("{this}: {e}"))?;
        let document = Document::parse(&text).map_err(|e| format!("{this}: {}", broken(&text, &e)))?;
        let root = document.root_element();
        let (Some(first), Some(last), Some(_)) =
            (root.first_child(), root.last_child(), root.first_element_child())
        else {
            return Err(format!("{this} has nothing to include"));
        };
        // The row of the first piece is that of the include; what follows is the other file's.
        self.names.push(name.to_string());
        let file = self.names.len() - 1;
        let part = first.range().start..last.range().end;
        let below = path.parent().unwrap_or(Path::new("")).to_path_buf();
        self.append(&text, part, &document, file, &below).map_err(|e| format!("{this}: {e}"))
    }
}
