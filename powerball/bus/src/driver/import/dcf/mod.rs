//! Electronic data sheets (EDS) and device configuration files (DCF) of CiA 306, as makers really write them:
//! latin-1, UTF-8 or UTF-16 with its mark, any case, `$NODEID + 0x80` anywhere in a number, names that
//! repeat, comments behind values, arrays whose parts share one section (`CompactSubObj`), types that the
//! file defines itself.
//!
//! Not read: `[DummyUsage]` (types that fill a PDO are not objects) and `CompactPDO` (PDOs without sections).

#[cfg(test)]
mod python;
mod section;
#[cfg(test)]
mod tests;
mod value;

pub use value::{Number, Value};

use crate::canopen::Object;
use section::{About, Section, Types};
use std::collections::BTreeMap;
use std::fmt;

/// An error in a file: its line (from 1) and a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DcfError {
    /// Line of the file.
    pub line: usize,
    /// The error, and what to do about it.
    pub message: String,
}

impl fmt::Display for DcfError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.message)
    }
}

impl std::error::Error for DcfError {}

/// How an object may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read.
    ReadOnly,
    /// Written.
    WriteOnly,
    /// Both.
    ReadWrite,
    /// Read; never changes.
    Constant,
}

/// One variable of the dictionary.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// The variable's name in the file.
    pub name: String,
    /// CiA 301 data type: 0x0005 is u8, and so on.
    pub data_type: u16,
    /// How it may be used.
    pub access: Access,
    /// Whether it can be in a PDO.
    pub mappable: bool,
    /// `DefaultValue`, the maker's.
    pub default: Option<Value>,
    /// `ParameterValue`, the configurer's.
    pub value: Option<Value>,
    /// Line where its section begins.
    pub line: usize,
}

impl Variable {
    /// Bits of the data type, or `None` for text, bytes and domains.
    pub fn bits(&self) -> Option<u8> {
        value::bits(self.data_type)
    }
}

/// A dictionary.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dcf {
    /// The variables: objects without parts, and the parts of the others.
    pub variables: BTreeMap<Object, Variable>,
    /// Keys of `[FileInfo]` and `[DeviceInfo]`, in lower case.
    pub info: BTreeMap<String, String>,
    /// Node id of the drive that the file configures, where it configures one.
    pub node: Option<u8>,
    /// Bit rate that the file configures, bit/s.
    pub bitrate: Option<u32>,
}

impl Dcf {
    /// The dictionary in a file's bytes. Bytes that are neither UTF-8 nor begin with the mark of UTF-16 are
    /// latin-1.
    ///
    /// # Errors
    /// The first line that cannot be read, with what was expected.
    pub fn parse(bytes: &[u8]) -> Result<Dcf, DcfError> {
        let wide = |unit: fn([u8; 2]) -> u16, bytes: &[u8]| {
            let units: Vec<u16> = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
            String::from_utf16_lossy(&units)
        };
        let text = match (bytes, std::str::from_utf8(bytes)) {
            ([0xFF, 0xFE, rest @ ..], _) => wide(u16::from_le_bytes, rest),
            ([0xFE, 0xFF, rest @ ..], _) => wide(u16::from_be_bytes, rest),
            (_, Ok(text)) => text.trim_start_matches('\u{feff}').to_string(),
            (_, Err(_)) => bytes.iter().map(|&byte| char::from(byte)).collect(),
        };
        let sections = section::split(&text)?;
        let types: Types = sections.iter().filter_map(Section::defined_type).collect();
        let mut dcf = Dcf::default();
        for section in &sections {
            dcf.take(section, &types)?;
        }
        // What a section states about one part overrides what is stated about all, wherever it stands.
        for section in &sections {
            dcf.take_shared(section, &types)?;
        }
        for section in &sections {
            dcf.take_list(section)?;
        }
        Ok(dcf)
    }

    fn take(&mut self, section: &Section, types: &Types) -> Result<(), DcfError> {
        match section.about() {
            About::Object(object) if section.is_variable()? => {
                self.variables.insert(object, section.variable(types)?);
            }
            About::Info => {
                let keys = section.keys.iter().map(|(key, (_, text))| (key.clone(), text.clone()));
                self.info.extend(keys);
            }
            About::Commissioning => {
                let node = section.number_within("nodeid", 0, 255)?;
                // 0 and 255 mean a node without a number.
                self.node = node.filter(|node| (1..=127).contains(node)).map(|node| node as u8).or(self.node);
                let rate = section.number_within("baudrate", 0, 10_000)?.filter(|rate| *rate > 0);
                self.bitrate = rate.map(|rate| 1000 * rate as u32).or(self.bitrate);
            }
            _ => {}
        }
        Ok(())
    }

    fn take_shared(&mut self, section: &Section, types: &Types) -> Result<(), DcfError> {
        let About::Object(Object { index, sub: 0 }) = section.about() else { return Ok(()) };
        if section.shared_parts()? > 0 {
            for (sub, part) in (0..).zip(section.parts(types)?) {
                self.variables.entry(Object::new(index, sub)).or_insert(part);
            }
        }
        Ok(())
    }

    fn take_list(&mut self, section: &Section) -> Result<(), DcfError> {
        let (index, is_name) = match section.about() {
            About::Names(index) => (index, true),
            About::Values(index) => (index, false),
            _ => return Ok(()),
        };
        for (key, sub) in section.listed()? {
            let Some(variable) = self.variables.get_mut(&Object::new(index, sub)) else {
                let message = format!(
                    "[{}] lists {sub}, which 0x{index:04X} does not have (CompactSubObj)",
                    section.name
                );
                return Err(DcfError { line: section.line_of(key), message });
            };
            if is_name {
                variable.name = section.name_of(key).unwrap_or_default();
            } else {
                variable.value = section.value(key, variable.data_type)?;
            }
        }
        Ok(())
    }

    /// Takes `overlay`'s values (`ParameterValue`, else `DefaultValue`) for this dictionary's objects, and
    /// its node id and bit rate.
    ///
    /// # Errors
    /// Where `overlay` has an object that this dictionary has not.
    pub fn overlay(&mut self, overlay: &Dcf) -> Result<(), DcfError> {
        for (object, variable) in &overlay.variables {
            let Some(own) = self.variables.get_mut(object) else {
                let message = format!("the overlay sets {object}, which the drive does not have");
                return Err(DcfError { line: variable.line, message });
            };
            let value = variable.value.as_ref().or(variable.default.as_ref());
            own.value = value.or(own.value.as_ref()).cloned();
        }
        self.node = overlay.node.or(self.node);
        self.bitrate = overlay.bitrate.or(self.bitrate);
        Ok(())
    }

    /// The number of `object` for node `node`: the configurer's, else the maker's.
    pub fn value(&self, object: Object, node: u8) -> Option<i128> {
        let variable = self.variables.get(&object)?;
        let value = variable.value.as_ref().or(variable.default.as_ref())?;
        value.number().map(|number| number.of(node))
    }

    /// The maker's number, if the file has it.
    pub(super) fn vendor(&self) -> Option<u32> {
        let number = self.info.get("vendornumber").and_then(|text| Number::parse(text))?;
        u32::try_from(number.of(0)).ok().filter(|vendor| *vendor > 0)
    }

    /// Whether the drive offers a bit rate, bit/s.
    pub(super) fn offers(&self, bitrate: u32) -> bool {
        let key = format!("baudrate_{}", bitrate / 1000);
        let flag = self.info.get(&key).and_then(|text| Number::parse(text));
        flag.is_some_and(|number| number.of(0) != 0)
    }
}
