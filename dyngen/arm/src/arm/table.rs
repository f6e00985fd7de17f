//! The values of an arm file's tables, each read or an error with its place.

use crate::diagnostic::{Collector, is_unseen, unseen};
use crate::exact::angle::Angle;
use crate::exact::rational::{self, Rational};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A turn, as it may be rounded, rad.
const LARGEST_ANGLE: f64 = std::f64::consts::TAU * 1.00001;

pub(super) type Value<'i> = Spanned<DeValue<'i>>;

/// Reads a file and collects what is wrong with it.
pub(super) struct Reader<'t> {
    pub(super) errors: Collector<'t>,
}

/// A table with the words that name it in an error.
pub(super) struct Table<'d, 'i> {
    pub(super) table: &'d DeTable<'i>,
    pub(super) span: Range<usize>,
    pub(super) place: String,
}

impl Reader<'_> {
    /// The three items of a list, or an error that starts with `what`.
    pub(super) fn three<'d, 'i>(&mut self, v: &'d Value<'i>, what: &str) -> Option<[&'d Value<'i>; 3]> {
        let list = v.get_ref().as_array().map(|a| a.iter().collect::<Vec<_>>()).unwrap_or_default();
        if let [x, y, z] = list[..] {
            return Some([x, y, z]);
        }
        self.errors.error(v.span(), format!("{what}, found {}", describe(v)));
        None
    }

    /// An angle in rad: more than a turn as a number is degrees.
    pub(super) fn angle(&mut self, v: &Value<'_>, quantity: &str) -> Option<Angle> {
        let angle = match v.get_ref().as_str() {
            Some(text) => {
                Angle::parse(text).map_err(|e| self.errors.error(v.span(), format!("{quantity}: {e}"))).ok()
            }
            None => self.number(v, quantity, "rad, or text such as \"pi/2\"").map(Angle::from_radians),
        }?;
        if let Angle::Radians(number) = &angle
            && angle.radians().abs() > LARGEST_ANGLE
        {
            let exact = Angle::PiMultiple(number / rational::integer(180));
            self.errors.error(
                v.span(),
                format!(
                    "{quantity} = {} rad is more than a turn: if degrees are meant, write \"{exact}\"",
                    rational::to_f64(number)
                ),
            );
            return None;
        }
        Some(angle)
    }

    pub(super) fn number(&mut self, v: &Value<'_>, quantity: &str, unit: &str) -> Option<Rational> {
        let parsed = match v.get_ref() {
            DeValue::Integer(i) if i.radix() == 10 => rational::parse_rational(i.as_str()),
            DeValue::Float(f) => rational::parse_rational(f.as_str()),
            _ => Err(format!("found {}", describe(v))),
        };
        parsed
            .map_err(|e| {
                self.errors.error(v.span(), format!("{quantity} must be a finite number ({unit}): {e}"))
            })
            .ok()
    }

    pub(super) fn text(&mut self, v: &Value<'_>, quantity: &str) -> Option<String> {
        match v.get_ref().as_str() {
            Some(text) if !text.trim().is_empty() => {
                // Written as an escape; as itself it is refused before.
                let Some(c) = text.chars().find(|c| c.is_control() || is_unseen(*c)) else {
                    return Some(text.to_string());
                };
                self.errors.error(v.span(), format!("{quantity} holds {}", unseen(c)));
                None
            }
            _ => {
                self.errors.error(
                    v.span(),
                    format!("{quantity} must be text that is not empty, found {}", describe(v)),
                );
                None
            }
        }
    }

    pub(super) fn required<'d, 'i>(&mut self, t: &Table<'d, 'i>, key: &str) -> Option<&'d Value<'i>> {
        let value = t.table.get(key);
        if value.is_none() {
            self.errors.error(t.span.clone(), format!("{}: the key '{key}' is missing", t.place));
        }
        value
    }

    /// `Some(None)` where the key is absent, `None` where its value is wrong.
    pub(super) fn optional<T>(
        &mut self,
        t: &Table<'_, '_>,
        key: &str,
        read: impl FnOnce(&mut Self, &Value<'_>) -> Option<T>,
    ) -> Option<Option<T>> {
        match t.table.get(key) {
            Some(value) => read(self, value).map(Some),
            None => Some(None),
        }
    }

    /// The tables of a list, by its header in the file: that of a list within another one names both.
    pub(super) fn tables<'d, 'i>(&mut self, t: &Table<'d, 'i>, header: &str) -> Vec<Table<'d, 'i>> {
        let key = last_key(header);
        let Some(value) = t.table.get(key) else { return Vec::new() };
        let Some(list) = value.get_ref().as_array() else {
            let message = match value.get_ref().is_table() {
                true => two_brackets(header),
                false => format!("{key} must be a list of tables: write [[{header}]]"),
            };
            self.errors.error(value.span(), message);
            return Vec::new();
        };
        let mut tables = Vec::new();
        for (i, item) in list.iter().enumerate() {
            match item.get_ref().as_table() {
                Some(table) => {
                    tables.push(Table { table, span: item.span(), place: format!("{key} {}", i + 1) })
                }
                None => self
                    .errors
                    .error(item.span(), format!("{key} {} must be a table: write [[{header}]]", i + 1)),
            }
        }
        tables
    }

    pub(super) fn unknown_keys(&mut self, t: &Table<'_, '_>, known: &[&str]) {
        for (key, _) in t.table.iter() {
            if !known.contains(&key.get_ref().as_ref()) {
                let message =
                    format!("{}: unknown key '{}': known are {}", t.place, key.get_ref(), known.join(", "));
                self.errors.error(key.span(), message);
            }
        }
    }
}

/// What stands there, for an error.
pub(super) fn describe(v: &Value<'_>) -> String {
    match v.get_ref() {
        DeValue::String(s) => format!("\"{s}\""),
        DeValue::Integer(i) => i.to_string(),
        DeValue::Float(f) => f.to_string(),
        DeValue::Array(a) => format!("a list of {}", a.iter().count()),
        other => format!("a value of type {}", other.type_str()),
    }
}

/// What a table in one bracket should be.
pub(super) fn two_brackets(header: &str) -> String {
    format!("write [[{header}]] with two brackets: each {} is one entry of a list", last_key(header))
}

fn last_key(header: &str) -> &str {
    header.rsplit('.').next().unwrap_or(header)
}
