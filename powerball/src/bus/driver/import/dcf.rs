//! Electronic data sheets (EDS) and device configuration files (DCF) of CiA 306, as makers really write them:
//! latin-1 or UTF-8, any case, `$NODEID + 0x80` anywhere in a number, names that repeat.

use crate::bus::canopen::Object;
use std::collections::BTreeMap;
use std::fmt;

/// What is wrong, and in which line (from 1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DcfError {
    /// Line of the file.
    pub line: usize,
    /// What is wrong, and what to do.
    pub message: String,
}

impl fmt::Display for DcfError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.message)
    }
}

impl std::error::Error for DcfError {}

/// A number that may depend on the node's: `constant + factor·$NODEID`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    constant: i64,
    factor: i64,
}

impl Number {
    /// Its value for node `node`.
    pub fn of(self, node: u8) -> i64 {
        self.constant + self.factor * i64::from(node)
    }

    /// Whether it depends on the node.
    pub fn depends_on_node(self) -> bool {
        self.factor != 0
    }

    /// `0x80`, `0200` (octal, as CiA 306 has it), `-3`, `$NODEID+0x180`, `0x80 + $NodeID`.
    fn parse(text: &str) -> Option<Number> {
        let mut sum = Number { constant: 0, factor: 0 };
        // A sign begins a term; what stands before the first one is a term too.
        let spaced = text.replace('+', " + ").replace('-', " - ");
        let (mut sign, mut terms) = (1, 0);
        for token in spaced.split_whitespace() {
            match token {
                "+" => continue,
                "-" => {
                    sign = -sign;
                    continue;
                }
                name if name.eq_ignore_ascii_case("$NODEID") => sum.factor += sign,
                digits => sum.constant += sign * unsigned(digits)?,
            }
            (sign, terms) = (1, terms + 1);
        }
        (terms > 0).then_some(sum)
    }
}

fn unsigned(digits: &str) -> Option<i64> {
    let lower = digits.to_ascii_lowercase();
    let value = match lower.strip_prefix("0x") {
        Some(hex) => u64::from_str_radix(hex, 16).ok()?,
        None if lower.len() > 1 && lower.starts_with('0') => u64::from_str_radix(&lower, 8).ok()?,
        None => lower.parse().ok()?,
    };
    i64::try_from(value).ok()
}

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
    /// Its name in the file.
    pub name: String,
    /// CiA 301 data type: 0x0005 is u8, and so on.
    pub data_type: u16,
    /// How it may be used.
    pub access: Access,
    /// Whether it can be in a PDO.
    pub mappable: bool,
    /// `DefaultValue`, the maker's, where it is a number.
    pub default: Option<Number>,
    /// `ParameterValue`, the configurer's, where it is a number.
    pub value: Option<Number>,
    /// Line where its section begins.
    pub line: usize,
}

impl Variable {
    /// Bits of the data type, or `None` for strings and domains.
    pub fn bits(&self) -> Option<u8> {
        Some(match self.data_type {
            0x0001 | 0x0002 | 0x0005 => 8,
            0x0003 | 0x0006 => 16,
            0x0004 | 0x0007 | 0x0008 => 32,
            0x0015 | 0x001B | 0x0011 => 64,
            _ => return None,
        })
    }
}

/// A dictionary.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dcf {
    /// The variables: objects without parts, and the parts of the others.
    pub variables: BTreeMap<Object, Variable>,
    /// Keys of `[FileInfo]` and `[DeviceInfo]`, in lower case.
    pub info: BTreeMap<String, String>,
}

/// `[1018]`, `[1018sub2]`, in any case; `None` for sections of other kinds.
fn section_object(name: &str) -> Option<Object> {
    let lower = name.to_ascii_lowercase();
    let (index, sub) = match lower.split_once("sub") {
        Some((index, sub)) => (index, u8::from_str_radix(sub, 16).ok()?),
        None => (lower.as_str(), 0),
    };
    let index = (index.len() == 4).then(|| u16::from_str_radix(index, 16).ok())??;
    Some(Object::new(index, sub))
}

#[derive(Default)]
struct Section {
    name: String,
    line: usize,
    keys: BTreeMap<String, (usize, String)>,
}

impl Section {
    fn number(&self, key: &str) -> Result<Option<Number>, DcfError> {
        let Some((line, text)) = self.keys.get(key).filter(|(_, text)| !text.is_empty()) else {
            return Ok(None);
        };
        match Number::parse(text) {
            Some(number) => Ok(Some(number)),
            None => Err(DcfError {
                line: *line,
                message: format!(
                    "{key} of [{}] is \"{text}\"; a number, $NODEID or their sum is expected",
                    self.name
                ),
            }),
        }
    }

    /// A variable, or `None` where the section is an object with parts (its parts have sections of their
    /// own).
    fn variable(&self) -> Result<Option<Variable>, DcfError> {
        let object_type = self.number("objecttype")?.map_or(7, |number| number.of(0));
        if object_type != 7 && object_type != 2 {
            return Ok(None);
        }
        let Some(data_type) = self.number("datatype")? else {
            let message = format!("[{}] has no DataType", self.name);
            return Err(DcfError { line: self.line, message });
        };
        let data_type = data_type.of(0) as u16;
        let (line, access) = self.keys.get("accesstype").cloned().unwrap_or((self.line, "rw".into()));
        let access = match access.to_ascii_lowercase().as_str() {
            "ro" => Access::ReadOnly,
            "wo" => Access::WriteOnly,
            "rw" | "rwr" | "rww" => Access::ReadWrite,
            "const" => Access::Constant,
            other => {
                let message = format!("AccessType \"{other}\"; ro, wo, rw, rwr, rww or const are expected");
                return Err(DcfError { line, message });
            }
        };
        let numeric = !matches!(data_type, 0x0008 | 0x0009 | 0x000A | 0x000F | 0x0011);
        let value = |key| if numeric { self.number(key) } else { Ok(None) };
        Ok(Some(Variable {
            name: self.keys.get("parametername").map(|(_, text)| text.clone()).unwrap_or_default(),
            data_type,
            access,
            mappable: self.number("pdomapping")?.is_some_and(|number| number.of(0) != 0),
            default: value("defaultvalue")?,
            value: value("parametervalue")?,
            line: self.line,
        }))
    }
}

impl Dcf {
    /// The dictionary in a file's bytes. Bytes that are no UTF-8 are read as latin-1.
    ///
    /// # Errors
    /// The first line that cannot be read, with what was expected.
    pub fn parse(bytes: &[u8]) -> Result<Dcf, DcfError> {
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{feff}').to_string(),
            Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
        };
        let (mut dcf, mut section) = (Dcf::default(), Section::default());
        for (number, line) in text.lines().enumerate().map(|(n, line)| (n + 1, line.trim())) {
            if line.is_empty() || line.starts_with([';', '#']) {
                continue;
            }
            if let Some(rest) = line.strip_prefix('[') {
                let Some((name, _)) = rest.split_once(']') else {
                    return Err(DcfError { line: number, message: format!("\"{line}\" lacks its ]") });
                };
                dcf.close(std::mem::take(&mut section))?;
                section = Section { name: name.trim().into(), line: number, keys: BTreeMap::new() };
            } else if let Some((key, value)) = line.split_once('=') {
                section.keys.insert(key.trim().to_ascii_lowercase(), (number, value.trim().into()));
            } else {
                let message = format!("\"{line}\" is neither [section] nor key=value");
                return Err(DcfError { line: number, message });
            }
        }
        dcf.close(section)?;
        Ok(dcf)
    }

    fn close(&mut self, section: Section) -> Result<(), DcfError> {
        if let Some(object) = section_object(&section.name) {
            if let Some(variable) = section.variable()? {
                self.variables.insert(object, variable);
            }
        } else if ["fileinfo", "deviceinfo"].contains(&section.name.to_ascii_lowercase().as_str()) {
            self.info.extend(section.keys.into_iter().map(|(key, (_, text))| (key, text)));
        }
        Ok(())
    }

    /// Takes `overlay`'s values (`ParameterValue`, else `DefaultValue`) for this dictionary's objects.
    ///
    /// # Errors
    /// Where `overlay` has an object that this dictionary has not.
    pub fn overlay(&mut self, overlay: &Dcf) -> Result<(), DcfError> {
        for (object, variable) in &overlay.variables {
            let Some(own) = self.variables.get_mut(object) else {
                let message = format!("the overlay sets {object}, which the drive has not");
                return Err(DcfError { line: variable.line, message });
            };
            own.value = variable.value.or(variable.default).or(own.value);
        }
        Ok(())
    }

    /// The value of `object` for node `node`: the configurer's, else the maker's.
    pub fn value(&self, object: Object, node: u8) -> Option<i64> {
        let variable = self.variables.get(&object)?;
        variable.value.or(variable.default).map(|number| number.of(node))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "[FileInfo]\r\nCreatedBy=M\u{fc}ller\r\n[1014]\r\nParameterName=COB-ID \
        EMCY\r\nObjectType=0x7\r\n\
        DataType=0x0007\r\nAccessType=rw\r\nDefaultValue=$NodeID + \
        0x80\r\n[1016]\r\nObjectType=0x8\r\n[1016Sub1]\r\n\
        DataType=0x0007\r\nAccessType=rw\r\nDefaultValue=0\r\nParameterValue=\r\n";

    /// A peer's reader gives 0x80 for every node here: the node's number is lost.
    #[test]
    fn node_numbers_are_added() {
        let dcf = Dcf::parse(SMALL.as_bytes()).unwrap();
        assert_eq!(dcf.value(Object::new(0x1014, 0), 5), Some(0x85));
        assert_eq!(dcf.value(Object::new(0x1016, 1), 5), Some(0));
        assert!(!dcf.variables.contains_key(&Object::new(0x1016, 0)));
        for text in ["$NODEID+0x180", "0x180 + $NODEID", "$nodeid + 0600"] {
            assert_eq!(Number::parse(text).unwrap().of(3), 0x183, "{text}");
        }
        assert_eq!(Number::parse("-3").unwrap().of(9), -3);
        assert_eq!(Number::parse("0x").or(Number::parse("five")).or(Number::parse("")), None);
    }

    #[test]
    fn latin_1_is_read() {
        let bytes: Vec<u8> = SMALL.chars().map(|c| c as u8).collect();
        assert!(std::str::from_utf8(&bytes).is_err());
        assert_eq!(Dcf::parse(&bytes).unwrap(), Dcf::parse(SMALL.as_bytes()).unwrap());
    }

    #[test]
    fn errors_name_their_line() {
        let error = |text: &str| Dcf::parse(text.as_bytes()).unwrap_err();
        assert_eq!(error("[1000]\nDataType=0x7\nDefaultValue=$NODE+1\n").line, 3);
        assert_eq!(error("[1000\n").line, 1);
        assert_eq!(error("; a comment\n\nrubbish\n").line, 3);
        assert!(error("[1000]\nObjectType=7\n").message.contains("DataType"));
        assert!(error("[1000]\nDataType=7\nAccessType=rx\n").message.contains("rwr"));
    }

    #[test]
    fn overlays_set_what_the_drive_has_and_nothing_else() {
        let mut dcf = Dcf::parse(SMALL.as_bytes()).unwrap();
        let overlay = Dcf::parse(b"[1016sub1]\nDataType=7\nParameterValue=0x10064\n").unwrap();
        dcf.overlay(&overlay).unwrap();
        assert_eq!(dcf.value(Object::new(0x1016, 1), 5), Some(0x10064));
        let foreign = Dcf::parse(b"[6071]\nDataType=3\nParameterValue=1\n").unwrap();
        assert!(dcf.overlay(&foreign).unwrap_err().message.contains("0x6071:0"));
    }
}
