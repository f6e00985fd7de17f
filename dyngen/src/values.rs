//! Parameter values from a JSON file: `{"parameter": number, …}`, or a model with `"parameters": [{"name",
//! "value"}, …]`.

use crate::arm::Parameter;
use crate::arm::sum::parse_sum;
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::exact::rational::to_f64;
use crate::model::Model;
use crate::parameters::span::{Sum, combinations};
use crate::parameters::{ParameterSet, SetKind};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

mod twice;

/// Of a value with a standard error above this share of it, logs say little.
const LITTLE: f64 = 0.3;

/// Named values, as a file gives them.
#[derive(Clone, Debug)]
pub struct Values {
    file: String,
    by_name: BTreeMap<String, f64>,
}

impl Values {
    /// Whether logs show a value that cannot be zero: by its standard error, which is in the value's unit and
    /// `None` where they do not show it alone.
    #[must_use]
    pub fn is_shown(value: f64, std: Option<f64>) -> bool {
        std.is_some_and(|std| std < LITTLE * value.abs())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// Where the file cannot be read, is no JSON object, holds a key twice, or anything but finite numbers:
    /// all of these at once.
    pub fn read(path: &Path) -> Result<Values, Diagnostics> {
        let file = path.display().to_string();
        let text = crate::file::text(path)
            .map_err(|e| Diagnostics::whole_file(&file, format!("the values cannot be read: {e}")))?;
        Self::parse(&text, &file)
    }

    /// Reads values from text; `file` names it in errors.
    ///
    /// # Errors
    /// Those of [`Values::read`].
    pub fn parse(text: &str, file: &str) -> Result<Values, Diagnostics> {
        let json: Value = serde_json::from_str(text).map_err(|e| {
            let message = format!("not valid JSON: {e}");
            Diagnostics(vec![Diagnostic {
                file: file.to_string(),
                line: e.line(),
                column: e.column(),
                message,
            }])
        })?;
        let Some(object) = json.as_object() else {
            return Err(Diagnostics::whole_file(
                file,
                "values must be one object {\"parameter\": number, …}",
            ));
        };
        let twice = twice::keys(text);
        if !twice.is_empty() {
            let diagnostic =
                |(line, column, message)| Diagnostic { file: file.to_string(), line, column, message };
            return Err(Diagnostics(twice.into_iter().map(diagnostic).collect()));
        }
        let (mut by_name, mut wrong) = (BTreeMap::new(), Vec::new());
        let mut given: Vec<(&str, &Value)> = Vec::new();
        match object.get("parameters").and_then(Value::as_array) {
            // The form that `powerball identify` and `explain` write; its other keys do not belong to the
            // rigid arm.
            Some(list) => {
                let mut seen = BTreeSet::new();
                for name in list.iter().filter_map(|entry| entry["name"].as_str()) {
                    if !seen.insert(name) {
                        wrong.push(format!("'{name}' has two values: which one is meant?"));
                    }
                }
                for entry in list {
                    match entry["name"].as_str() {
                        Some(name) => given.push((name, &entry["value"])),
                        None => wrong.push(format!("'parameters' has an entry without a name: {entry}")),
                    }
                }
            }
            None => given.extend(object.iter().map(|(name, value)| (name.as_str(), value))),
        }
        for (name, value) in given {
            match value.as_f64().filter(|x| x.is_finite()) {
                Some(number) => {
                    by_name.insert(name.to_string(), number);
                }
                None => wrong.push(format!("the value of '{name}' must be a finite number, found {value}")),
            }
        }
        if wrong.is_empty() {
            return Ok(Values { file: file.to_string(), by_name });
        }
        let diagnostic = |message| Diagnostic { file: file.to_string(), line: 0, column: 0, message };
        Err(Diagnostics(wrong.into_iter().map(diagnostic).collect()))
    }

    /// Values with 0 for the names for which `is` holds.
    #[must_use]
    pub fn with_zero(&self, is: impl Fn(&str) -> bool) -> Values {
        let by_name = self.by_name.iter().map(|(name, x)| (name.clone(), if is(name) { 0.0 } else { *x }));
        Values { file: self.file.clone(), by_name: by_name.collect() }
    }

    /// The names that have values.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.by_name.keys().map(String::as_str)
    }

    /// The value of a name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.by_name.get(name).copied()
    }

    /// Values that are there already; `file` names them in errors.
    pub fn named<'n>(values: impl IntoIterator<Item = (&'n str, f64)>, file: &str) -> Values {
        let by_name = values.into_iter().map(|(name, value)| (name.to_string(), value)).collect();
        Values { file: file.to_string(), by_name }
    }

    /// The values of a set's parameters in order: given by the set's own names, as values of the arm's
    /// parameters, of which the set's sums are made, or as values of other sums that determine the set's:
    /// those of the same arm under another gravity, say.
    ///
    /// # Errors
    /// Every name that is missing or unknown.
    pub fn of_set(&self, model: &Model, set: &ParameterSet) -> Result<Vec<f64>, Diagnostics> {
        let names = set.names();
        let given = |name: &String| self.by_name.contains_key(name);
        let only_of_set = |name: &String| given(name) && Parameter::parse(name).is_none();
        let complete = names.iter().all(given);
        if complete && names.len() == self.by_name.len() {
            return self.in_order(&names, &names);
        }
        if let Some(values) = self.of_other_sums(model, set) {
            return Ok(values);
        }
        // A set without sums has names of the arm's parameters, and its values may stand among all of them.
        let kept = model.arm().kept_parameters();
        let of_arm = |name: &String| Parameter::parse(name).is_some_and(|p| kept.contains(&p));
        let all_of_arm = self.by_name.keys().all(of_arm);
        if !all_of_arm && (complete || names.iter().any(only_of_set)) {
            return self.in_order(&names, &names);
        }
        let kept: Vec<String> = kept.iter().map(ToString::to_string).collect();
        let mut needed: Vec<Parameter> =
            set.parameters.iter().flat_map(|p| p.terms.iter().map(|(q, _)| *q)).collect();
        // A parameter can stand in several sums.
        needed.sort();
        needed.dedup();
        let needed_names: Vec<String> = needed.iter().map(ToString::to_string).collect();
        let values = self.in_order(&needed_names, &kept)?;
        let mut all = vec![0.0; model.arm().all_parameters().len()];
        for (parameter, value) in needed.iter().zip(values) {
            all[parameter.index()] = value;
        }
        Ok(model.set_values(set, &all))
    }

    /// The set whose names the values have, with the values in its order; the minimal set where they are
    /// values of the arm's parameters.
    ///
    /// # Errors
    /// Those of [`Values::of_set`].
    pub fn recognise(&self, model: &Model) -> Result<(SetKind, Vec<f64>), Diagnostics> {
        let covered = |set: &&ParameterSet| set.names().iter().all(|n| self.by_name.contains_key(n));
        let order = [SetKind::Full, SetKind::Published, SetKind::Minimal, SetKind::Symbolic];
        let sets = order.iter().filter_map(|kind| model.sets().get(*kind));
        let found = sets.clone().find(covered).or_else(|| model.sets().get(SetKind::Minimal));
        match found {
            Some(set) => Ok((set.kind, self.of_set(model, set)?)),
            None => Err(Diagnostics::whole_file(&self.file, "the arm has no parameters")),
        }
    }

    /// From values whose names are sums of parameters, where they determine the set.
    fn of_other_sums(&self, model: &Model, set: &ParameterSet) -> Option<Vec<f64>> {
        if self.by_name.keys().all(|name| Parameter::parse(name).is_some()) {
            return None;
        }
        let sum = |name: &String| -> Option<Sum> {
            Some(parse_sum(name).ok()?.iter().map(|(p, c)| (*p, to_f64(c))).collect())
        };
        let given: Vec<Sum> = self.by_name.keys().map(sum).collect::<Option<_>>()?;
        let of_set = |row: Vec<f64>| row.iter().zip(self.by_name.values()).map(|(c, v)| c * v).sum();
        Some(combinations(&model.sums(set), &given)?.into_iter().map(of_set).collect())
    }

    fn in_order(&self, names: &[String], allowed: &[String]) -> Result<Vec<f64>, Diagnostics> {
        let missing: Vec<&str> =
            names.iter().filter(|n| !self.by_name.contains_key(*n)).map(String::as_str).collect();
        let unknown: Vec<&str> =
            self.by_name.keys().filter(|n| !allowed.contains(n)).map(String::as_str).collect();
        let mut wrong = Vec::new();
        if !missing.is_empty() {
            wrong.push(format!("no value for {}", missing.join(", ")));
        }
        if !unknown.is_empty() {
            wrong.push(format!(
                "{} names no parameter here; expected are {}",
                unknown.join(", "),
                allowed.join(", ")
            ));
        }
        if wrong.is_empty() {
            return Ok(names.iter().filter_map(|n| self.by_name.get(n).copied()).collect());
        }
        let diagnostic = |message| Diagnostic { file: self.file.clone(), line: 0, column: 0, message };
        Err(Diagnostics(wrong.into_iter().map(diagnostic).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Arm;
    use crate::exact::rational::integer;

    /// What gravity in a general direction determines says what any gravity determines, for all values of all
    /// parameters; not the other way round.
    #[test]
    fn a_general_gravity_says_what_others_do() {
        let text = include_str!("../../powerball/lwa4p.toml");
        let of = |gravity: [i64; 3]| {
            let mut arm = Arm::parse(text, "lwa4p.toml").unwrap();
            arm.gravity = gravity.map(integer);
            Model::derive(arm).unwrap()
        };
        let (general, upright) = (of([0, -5, -9]), of([0, 0, -9]));
        let sets = [&general, &upright].map(|m| m.set(SetKind::Minimal).unwrap());
        let sums = [general.sums(sets[0]), upright.sums(sets[1])];
        assert!(sums[0].len() > sums[1].len());
        let combined = combinations(&sums[1], &sums[0]).unwrap();
        let all: Vec<f64> = (0..66).map(|k| f64::from((37 * k + 11) % 101) / 50.0 - 1.0).collect();
        let [values, expected] = [general.set_values(sets[0], &all), upright.set_values(sets[1], &all)];
        for (row, expected) in combined.iter().zip(&expected) {
            let value: f64 = row.iter().zip(&values).map(|(c, v)| c * v).sum();
            assert!((value - expected).abs() < 1e-9 * expected.abs().max(1.0), "{value} {expected}");
        }
        assert_eq!(combinations(&sums[0], &sums[1]), None);

        // By their names alone, as from a file.
        let names = sets[0].names();
        let named = |skip: &str| {
            let pairs = names.iter().map(String::as_str).zip(values.iter().copied());
            Values::named(pairs.filter(|(name, _)| *name != skip), "identified.json")
        };
        let read = named("").of_set(&upright, sets[1]).unwrap();
        for (value, expected) in read.iter().zip(&expected) {
            assert!((value - expected).abs() < 1e-9 * expected.abs().max(1.0), "{value} {expected}");
        }
        // A parameter that stands in several sums is missing once.
        let kept = upright.arm().kept_parameters();
        let others = kept.iter().map(ToString::to_string).filter(|name| name != "my3").collect::<Vec<_>>();
        let others = Values::named(others.iter().map(|name| (name.as_str(), 0.0)), "v.json");
        let missing = others.of_set(&upright, sets[1]).unwrap_err().to_string();
        assert!(missing.ends_with("no value for my3"), "{missing}");

        let missing = named("mz2 + my3").of_set(&upright, sets[1]).unwrap_err().to_string();
        assert!(missing.contains("no value for Ixz2 + 7/20*mz2 + 7/20*my3"), "{missing}");
    }
}
