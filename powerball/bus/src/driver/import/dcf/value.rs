//! Values as they are written in a file: numbers with the node's in them, real numbers, text and bytes.

/// A number that may depend on the node's: `constant + factor·$NODEID`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    constant: i128,
    factor: i128,
}

impl Number {
    pub(super) const fn constant(constant: i128) -> Number {
        Number { constant, factor: 0 }
    }

    /// The number's value for node `node`. Wide enough for integers of 64 bits with and without sign.
    pub fn of(self, node: u8) -> i128 {
        self.constant + self.factor * i128::from(node)
    }

    /// Whether it depends on the node.
    pub fn depends_on_node(self) -> bool {
        self.factor != 0
    }

    /// `0x80`, `0200` (octal, as CiA 306 has it), `-3`, `$NODEID+0x180`, `0x80 + $NodeID`; what follows a `;`
    /// is a comment.
    pub(super) fn parse(text: &str) -> Option<Number> {
        let mut sum = Number::constant(0);
        // A sign begins a term; what stands before the first one is a term too.
        let text = text.split(';').next()?;
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
                digits => sum.constant += sign * i128::from(unsigned(digits)?),
            }
            (sign, terms) = (1, terms + 1);
        }
        (terms > 0).then_some(sum)
    }

    /// This number as a signed number of `bits` bits where it was written as these bits: 0xFF is −1 in 8
    /// bits.
    fn signed(self, bits: u8) -> Number {
        let half = 1i128 << (bits - 1);
        if !self.depends_on_node() && (half..2 * half).contains(&self.constant) {
            return Number::constant(self.constant - 2 * half);
        }
        self
    }
}

fn unsigned(digits: &str) -> Option<u64> {
    let lower = digits.to_ascii_lowercase();
    match lower.strip_prefix("0x") {
        Some(hex) => u64::from_str_radix(hex, 16).ok(),
        None if lower.len() > 1 && lower.starts_with('0') => u64::from_str_radix(&lower, 8).ok(),
        None => lower.parse().ok(),
    }
}

/// A text that should be a number and is not one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NoNumber;

/// The value of an object in a file, by its data type.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A whole number, a truth or a time.
    Number(Number),
    /// A real number.
    Real(f64),
    /// Text.
    Text(String),
    /// Bytes, written in hexadecimal.
    Bytes(Vec<u8>),
}

impl Value {
    /// A value of `data_type`. Bytes that are not written in hexadecimal, and reals that are, have a form of
    /// the maker's own: no value.
    pub(super) fn parse(data_type: u16, text: &str) -> Result<Option<Value>, NoNumber> {
        let number = || Number::parse(text).ok_or(NoNumber);
        Ok(Some(match (data_type, bits(data_type)) {
            (0x0008 | 0x0011, _) => match text.split(';').next().unwrap_or(text).trim().parse() {
                Ok(real) => Value::Real(real),
                Err(_) => return number().map(|_| None),
            },
            (0x0002..=0x0004 | 0x0010 | 0x0012..=0x0015, Some(bits)) => Value::Number(number()?.signed(bits)),
            (_, Some(_)) => Value::Number(number()?),
            (0x0009 | 0x000B, None) => Value::Text(text.to_string()),
            (_, None) => return Ok(bytes(text).map(Value::Bytes)),
        }))
    }

    /// The number, where it is one.
    pub fn number(&self) -> Option<Number> {
        match self {
            Value::Number(number) => Some(*number),
            _ => None,
        }
    }
}

/// `0A FF` or `0AFF`.
fn bytes(text: &str) -> Option<Vec<u8>> {
    let digits: Option<Vec<u32>> =
        text.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_digit(16)).collect();
    let pairs = digits.filter(|digits| digits.len().is_multiple_of(2))?;
    Some(
        pairs.chunks_exact(2).map(|pair| pair.iter().fold(0, |sum, digit| sum << 4 | *digit) as u8).collect(),
    )
}

/// Bits of a data type of CiA 301, or `None` for text, bytes and domains.
pub(super) fn bits(data_type: u16) -> Option<u8> {
    Some(match data_type {
        0x0001 | 0x0002 | 0x0005 => 8,
        0x0003 | 0x0006 => 16,
        0x0010 | 0x0016 => 24,
        0x0004 | 0x0007 | 0x0008 => 32,
        0x0012 | 0x0018 => 40,
        // Times of day and differences of time are of 48 bits.
        0x000C | 0x000D | 0x0013 | 0x0019 => 48,
        0x0014 | 0x001A => 56,
        0x0011 | 0x0015 | 0x001B => 64,
        _ => return None,
    })
}
