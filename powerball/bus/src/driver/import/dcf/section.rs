//! The sections of a file, and the content of the section of an object.

use super::value::{NoNumber, Number};
use super::{Access, DcfError, Value, Variable};
use crate::canopen::Object;
use std::collections::BTreeMap;

/// A VAR of CiA 301, which holds one value.
const VARIABLE: i128 = 7;
/// A DOMAIN, which holds bytes.
const DOMAIN: i128 = 2;
/// An ARRAY or a RECORD: its parts have sections of their own, or share its own.
const ARRAY: i128 = 8;
const RECORD: i128 = 9;

/// Data types 0x0001 to this one are those of CiA 301.
const LAST_TYPE: u16 = 0x001B;
/// Data type of a DOMAIN.
const DOMAIN_TYPE: u16 = 0x000F;
/// Data type of a number of entries.
const UNSIGNED8: u16 = 0x0005;
/// Greatest sub-index of a value.
const LAST_SUB: i128 = 254;

/// Types that a file defines itself: their number, and the type of CiA 301 that they rename.
pub(super) type Types = BTreeMap<u16, u16>;

/// The subject of a section.
pub(super) enum About {
    /// `[1018sub2]`, or `[1018]` as sub-index 0.
    Object(Object),
    /// `[1003Name]`: names of the parts of a compact object.
    Names(u16),
    /// `[1003Value]`: values of the parts of a compact object.
    Values(u16),
    /// `[FileInfo]` or `[DeviceInfo]`.
    Info,
    /// `[DeviceCommissioning]`, or with the one m of most files.
    Commissioning,
    /// Something else.
    Other,
}

#[derive(Debug, Default)]
pub(super) struct Section {
    pub(super) name: String,
    pub(super) line: usize,
    /// The keys by their names in lower case, with their values and lines.
    pub(super) keys: BTreeMap<String, (usize, String)>,
}

/// The sections of a text, in their order.
///
/// # Errors
/// The first line that is neither a section, nor a key with its value, nor a comment.
pub(super) fn split(text: &str) -> Result<Vec<Section>, DcfError> {
    let mut sections = vec![Section::default()];
    for (line, text) in text.lines().enumerate().map(|(n, line)| (n + 1, line.trim())) {
        if text.is_empty() || text.starts_with([';', '#']) {
            continue;
        }
        if let Some(rest) = text.strip_prefix('[') {
            let Some((name, _)) = rest.split_once(']') else {
                return Err(DcfError { line, message: format!("\"{text}\" lacks its ]") });
            };
            sections.push(Section { name: name.trim().into(), line, keys: BTreeMap::new() });
        } else if let Some((key, value)) = text.split_once('=') {
            let entry = (line, without_comment(value).to_string());
            // Before the first section stands one without a name.
            if let Some(section) = sections.last_mut() {
                section.keys.insert(key.trim().to_ascii_lowercase(), entry);
            }
        } else {
            return Err(DcfError { line, message: format!("\"{text}\" is neither [section] nor key=value") });
        }
    }
    Ok(sections)
}

/// A `;` begins a comment where a space stands before it: names and paths may hold others.
fn without_comment(value: &str) -> &str {
    let mut before = ' ';
    let comment = value.char_indices().find(|(_, c)| {
        let begins = *c == ';' && before.is_whitespace();
        before = *c;
        begins
    });
    comment.and_then(|(at, _)| value.get(..at)).unwrap_or(value).trim()
}

fn index(digits: &str) -> Option<u16> {
    (digits.len() == 4).then(|| u16::from_str_radix(digits, 16).ok())?
}

impl Section {
    pub(super) fn about(&self) -> About {
        let lower = self.name.to_ascii_lowercase();
        match lower.as_str() {
            "fileinfo" | "deviceinfo" => return About::Info,
            "devicecommissioning" | "devicecomissioning" => return About::Commissioning,
            _ => {}
        }
        let of = |suffix| lower.strip_suffix(suffix).and_then(index);
        let part = lower
            .split_once("sub")
            .and_then(|(index, sub)| Some((self::index(index)?, u8::from_str_radix(sub, 16).ok()?)));
        match (index(&lower), part, of("name"), of("value")) {
            (Some(index), ..) => About::Object(Object::new(index, 0)),
            (_, Some((index, sub)), ..) => About::Object(Object::new(index, sub)),
            (_, _, Some(index), _) => About::Names(index),
            (.., Some(index)) => About::Values(index),
            _ => About::Other,
        }
    }

    /// A type that the file defines, as CANFestival's editor does: `[A0sub1]` has its type of CiA 301 as its
    /// value.
    pub(super) fn defined_type(&self) -> Option<(u16, u16)> {
        let lower = self.name.to_ascii_lowercase();
        let number = u16::from_str_radix(lower.strip_suffix("sub1")?, 16).ok()?;
        let stands_for = self.number("defaultvalue").ok()??.of(0);
        Some((number, u16::try_from(stands_for).ok()?))
    }

    /// A key that is there and says something.
    fn text(&self, key: &str) -> Option<(usize, &str)> {
        self.keys.get(key).map(|(line, text)| (*line, text.as_str())).filter(|(_, text)| !text.is_empty())
    }

    fn wrong<T>(&self, line: usize, key: &str, text: &str, expected: &str) -> Result<T, DcfError> {
        let message = format!("{key} of [{}] is \"{text}\"; {expected} expected", self.name);
        Err(DcfError { line, message })
    }

    pub(super) fn number(&self, key: &str) -> Result<Option<Number>, DcfError> {
        let Some((line, text)) = self.text(key) else { return Ok(None) };
        match Number::parse(text) {
            Some(number) => Ok(Some(number)),
            None => self.wrong(line, key, text, "a number, $NODEID or their sum is"),
        }
    }

    /// A number of a range that does not depend on the node.
    pub(super) fn number_within(&self, key: &str, low: i128, high: i128) -> Result<Option<i128>, DcfError> {
        let Some(number) = self.number(key)? else { return Ok(None) };
        match self.text(key) {
            Some((line, text)) if number.depends_on_node() || !(low..=high).contains(&number.of(0)) => {
                self.wrong(line, key, text, &format!("{low} to {high} is"))
            }
            _ => Ok(Some(number.of(0))),
        }
    }

    pub(super) fn value(&self, key: &str, data_type: u16) -> Result<Option<Value>, DcfError> {
        let Some((line, text)) = self.text(key) else { return Ok(None) };
        match Value::parse(data_type, text) {
            Ok(value) => Ok(value),
            Err(NoNumber) => self.wrong(line, key, text, "a number, $NODEID or their sum is"),
        }
    }

    fn object_type(&self) -> Result<i128, DcfError> {
        Ok(self.number("objecttype")?.map_or(VARIABLE, |number| number.of(0)))
    }

    /// Whether the section is an object that holds a value itself.
    pub(super) fn is_variable(&self) -> Result<bool, DcfError> {
        Ok([VARIABLE, DOMAIN].contains(&self.object_type()?))
    }

    /// How many parts share this section: `CompactSubObj`, 0 where the parts have sections of their own.
    pub(super) fn shared_parts(&self) -> Result<u8, DcfError> {
        if ![ARRAY, RECORD].contains(&self.object_type()?) {
            return Ok(0);
        }
        Ok(self.number_within("compactsubobj", 0, LAST_SUB)?.unwrap_or(0) as u8)
    }

    /// The parts that share this section, from sub-index 0 on.
    pub(super) fn parts(&self, types: &Types) -> Result<Vec<Variable>, DcfError> {
        let count = self.shared_parts()?;
        let part = self.variable(types)?;
        let first = Variable {
            name: "NrOfObjects".into(),
            data_type: UNSIGNED8,
            access: Access::ReadOnly,
            mappable: false,
            default: Some(Value::Number(Number::constant(i128::from(count)))),
            value: None,
            line: self.line,
        };
        let others = (1..=count).map(|sub| Variable { name: format!("{}{sub}", part.name), ..part.clone() });
        Ok([first].into_iter().chain(others).collect())
    }

    fn data_type(&self, types: &Types) -> Result<u16, DcfError> {
        let Some(code) = self.number_within("datatype", 0, i128::from(u16::MAX))? else {
            if self.object_type()? == DOMAIN {
                return Ok(DOMAIN_TYPE);
            }
            let message = format!("[{}] has no DataType", self.name);
            return Err(DcfError { line: self.line, message });
        };
        let code = code as u16;
        // The content of a maker's own type is not known here: bytes.
        Ok(if code > LAST_TYPE { types.get(&code).copied().unwrap_or(DOMAIN_TYPE) } else { code })
    }

    fn access(&self) -> Result<Access, DcfError> {
        let (line, text) = self.text("accesstype").unwrap_or((self.line, "rw"));
        Ok(match text.to_ascii_lowercase().as_str() {
            "ro" => Access::ReadOnly,
            "wo" => Access::WriteOnly,
            "rw" | "rwr" | "rww" => Access::ReadWrite,
            "const" => Access::Constant,
            _ => return self.wrong(line, "AccessType", text, "ro, wo, rw, rwr, rww or const is"),
        })
    }

    /// The variable that the section describes.
    pub(super) fn variable(&self, types: &Types) -> Result<Variable, DcfError> {
        let data_type = self.data_type(types)?;
        Ok(Variable {
            name: self.text("parametername").map(|(_, text)| text.to_string()).unwrap_or_default(),
            data_type,
            access: self.access()?,
            mappable: self.number("pdomapping")?.is_some_and(|number| number.of(0) != 0),
            default: self.value("defaultvalue", data_type)?,
            value: self.value("parametervalue", data_type)?,
            line: self.line,
        })
    }

    /// Line, sub-index and text of what `[1003Name]` or `[1003Value]` lists.
    pub(super) fn listed(&self) -> Result<Vec<(&str, u8)>, DcfError> {
        let listed = self.keys.keys().filter(|key| *key != "nrofentries").map(|key| {
            let sub =
                Number::parse(key).map(|number| number.of(0)).filter(|sub| (1..=LAST_SUB).contains(sub));
            match (sub, self.keys.get(key)) {
                (Some(sub), _) => Ok((key.as_str(), sub as u8)),
                (None, entry) => {
                    let line = entry.map_or(self.line, |(line, _)| *line);
                    let message = format!(
                        "\"{key}\" of [{}] is not a sub-index; 1 to {LAST_SUB} is expected",
                        self.name
                    );
                    Err(DcfError { line, message })
                }
            }
        });
        listed.collect()
    }

    pub(super) fn name_of(&self, key: &str) -> Option<String> {
        self.text(key).map(|(_, text)| text.to_string())
    }

    pub(super) fn line_of(&self, key: &str) -> usize {
        self.keys.get(key).map_or(self.line, |(line, _)| *line)
    }
}
