//! Parameter values from a JSON file: `{"parameter": number, …}`.

use super::Failure;
use dyngen::Model;
use dyngen::arm::Parameter;
use dyngen::base::{ParameterSet, SetKind};
use std::collections::BTreeMap;
use std::path::Path;

/// A file of values.
pub(super) struct Values {
    file: String,
    by_name: BTreeMap<String, f64>,
}

impl Values {
    /// Reads a file.
    pub(super) fn read(path: &Path) -> Result<Values, Failure> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|e| Failure::input(format!("{file}: the values cannot be read: {e}")))?;
        let json: serde_json::Value = serde_json::from_str(&text).map_err(|e| {
            Failure::input(format!("{file}:{}:{}: not valid JSON: {e}", e.line(), e.column()))
        })?;
        let Some(object) = json.as_object() else {
            return Err(Failure::input(format!(
                "{file}: values must be one object {{\"parameter\": number, …}}"
            )));
        };
        let mut by_name = BTreeMap::new();
        for (name, value) in object {
            let Some(number) = value.as_f64().filter(|x| x.is_finite()) else {
                return Err(Failure::input(format!(
                    "{file}: the value of '{name}' must be a finite number, found {value}"
                )));
            };
            by_name.insert(name.clone(), number);
        }
        Ok(Values { file, by_name })
    }

    /// The values of a set's parameters in order: given by the set's own names, or as values of the arm's parameters.
    pub(super) fn of_set(&self, model: &Model, set: &ParameterSet) -> Result<Vec<f64>, Failure> {
        let names = set.names();
        if names.iter().any(|n| self.by_name.contains_key(n) && Parameter::parse(n).is_none())
            || names.iter().all(|n| self.by_name.contains_key(n))
        {
            return self.by_names(&names, &names);
        }
        let kept: Vec<String> = model.arm().kept_parameters().iter().map(ToString::to_string).collect();
        let needed: Vec<String> =
            set.parameters.iter().flat_map(|p| p.terms.iter().map(|(q, _)| q.to_string())).collect();
        let mut all = vec![0.0; model.arm().all_parameters().len()];
        let values = self.by_names(&needed, &kept)?;
        for (name, value) in needed.iter().zip(values) {
            if let Some(p) = Parameter::parse(name) {
                all[p.index()] = value;
            }
        }
        Ok(model.set_values(set, &all))
    }

    /// The set whose names the file gives, with the values in its order.
    pub(super) fn recognise(&self, model: &Model) -> Result<(SetKind, Vec<f64>), Failure> {
        let covered = |set: &&ParameterSet| set.names().iter().all(|n| self.by_name.contains_key(n));
        let order = [SetKind::Full, SetKind::Published, SetKind::Minimal, SetKind::Symbolic];
        let found = order.iter().filter_map(|kind| model.sets().get(*kind)).find(covered);
        match found {
            Some(set) => Ok((set.kind, self.by_names(&set.names(), &set.names())?)),
            None => {
                let set = model.set(SetKind::Minimal).map_err(Failure::refused)?;
                Ok((SetKind::Minimal, self.of_set(model, set)?))
            }
        }
    }

    fn by_names(&self, names: &[String], allowed: &[String]) -> Result<Vec<f64>, Failure> {
        let missing: Vec<&str> =
            names.iter().filter(|n| !self.by_name.contains_key(*n)).map(String::as_str).collect();
        if !missing.is_empty() {
            return Err(Failure::input(format!("{}: no value for {}", self.file, missing.join(", "))));
        }
        let unknown: Vec<&str> =
            self.by_name.keys().filter(|n| !allowed.contains(n)).map(String::as_str).collect();
        if !unknown.is_empty() {
            return Err(Failure::input(format!(
                "{}: {} names no parameter here; expected are {}",
                self.file,
                unknown.join(", "),
                allowed.join(", ")
            )));
        }
        Ok(names.iter().map(|n| self.by_name[n]).collect())
    }
}
