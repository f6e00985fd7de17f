//! Every threshold that decides what an explanation says, with its reason.

use powerball_identification::evidence::penalty;
use serde::{Deserialize, Serialize};

/// The thresholds of the rule that accepts, names or refuses effects.
///
/// The defaults are those of every published figure (`docs/study.md`, `docs/measured.md`). A gain is a fall
/// of χ², the squared error in units of independent samples; a score is a gain after penalties for
/// coefficients and for having searched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rule {
    /// Effects added at most.
    pub most_steps: usize,

    /// Least score of an effect, in units of χ²: e^(−10/2) is a likelihood ratio of 150 after the penalties.
    /// An experiment must promise it, and a log has the payload or the push of another one where that
    /// explains so much more.
    pub least_score: f64,
    /// Penalty for each coefficient: what one coefficient gains by chance, twice over (Akaike). A
    /// setting is refined for more than half of it.
    pub per_coefficient: f64,
    /// Probability of accepting anything at all where nothing is missing, over all joints and candidates;
    /// above the band that of a ripple, over all joints and orders; that of a wrong decision between two
    /// names by an experiment; that of calling an effect missing in one of eight octaves of time. A
    /// candidate must exceed all but this share of its time-shift surrogates.
    pub family_wise: f64,

    /// The held-out squared error must fall by this share on average over folds: 1 % of the rms, below which
    /// no user would notice. A signal that explains less of a residual's variance is not reported, and a
    /// group with fewer columns is preferred where the better one's score is larger by less than this share
    /// or [`as_good_score`](Self::as_good_score).
    pub least_gain: f64,
    /// What is below this share of a whole is next to nothing: what one fold may lose of its squared error;
    /// what is left of a joint's torque and needs no name; what a term of another class gains of an accepted
    /// one whose law it corrects, since laws are wrong by a few percent; how far apart the starts of two runs
    /// are, of each joint's travel; the share of accepted surrogates, above which a reader is warned.
    pub negligible: f64,
    /// What is below this share is little, and a change by more is clear. A joint is predicted where no more
    /// of its torque's rms is left; where all but this share is left, a model predicts almost nothing. What
    /// lowers the rms of its joints by more needs no folds where it does so on the validation set and the
    /// other way round, and position servos need no significance for it, as few seconds are too few blocks.
    /// A name is taken back where without its effect the held-out squared error of all joints is smaller by
    /// more; what is in validation logs only must not raise that of a joint by more; on repeats of one path,
    /// where whoever has more parameters fits the error that is the same in all of them, the per-joint fit
    /// must lower it by more. Two paths, two parts of a residual, or the models of two names are the same
    /// but for this share. A force in all but this share of a log's rests is that of a carried body.
    pub little: f64,
    /// What is more than this share is most of a thing: half. An event of some seconds (a push) must explain
    /// most of what its time has more of squared error than others; another log has the same push where it
    /// has it for most of its time; an effect most of which is missing in some octave is not the effect that
    /// it is called; what either way round adds must be mostly the same, by their correlation.
    pub most: f64,
    /// What is more than this share is nearly all of a thing: four of five. The held-out squared error must
    /// fall in nearly all folds; a log has the same push if that also explains nearly all of the force's own
    /// torque, since a push of another size or direction is another one.
    pub nearly_all: f64,
    /// Squared errors that differ by this factor are unlike. A validation log whose error is larger than that
    /// of the fitted logs by it holds something that they do not; for position servos a mass or a gain is
    /// looked for in such a log, and where none takes away most of its squared error, it is unlike the others
    /// from that ratio of the rms on. A residual is coloured where the variance of its slow means is larger
    /// than that of white noise by it.
    pub unlike: f64,

    /// Blocks that count as independent last this many autocorrelation times of what is left …
    pub block_memories: f64,
    /// … but not less, s …
    pub shortest_block: f64,
    /// … and not more, s. Two events this close count as one whose time is a little off.
    pub longest_block: f64,

    /// Share of its time-shift surrogates whose score an event of some seconds must exceed: shifted in time
    /// it falls onto others of its kind for at most a quarter of a log.
    pub event_surrogate_level: f64,
    /// Surrogates of a step, and those that state the false-positive rate. A tenth of it where a search is
    /// done again for each (an effect's for logs and times, that for ripple above the band): these must be
    /// enough for [`family_wise`](Self::family_wise).
    pub surrogates: usize,
    /// A shifted column that still correlates so much with the unshifted one (a periodic motion) is no
    /// surrogate.
    pub surrogate_correlation: f64,

    /// A term of the class of an accepted one, on the same joint, that gains less than this share of it
    /// corrects that one's law and is no effect of its own.
    pub only_corrects_class: f64,
    /// Scores that differ by less are as good: a likelihood ratio of 4.
    pub as_good_score: f64,
    /// Two names whose gains differ by less than this factor cannot be distinguished by these data.
    pub least_margin: f64,
    /// A name that is not distinguished ([`least_margin`](Self::least_margin)) from the next best one for
    /// another part of the residual is not given where it leaves more than this share of the excess over the
    /// noise floor: then something else is there, and what fits best only resembles it. The share is that of
    /// an earlier trial on other data. What is in validation logs only must leave no more of their excess
    /// over the fitted logs.
    pub max_unexplained: f64,

    /// A ripple with fewer cycles along the path than this is as good as any other smooth function of the
    /// position.
    pub few_cycles: f64,
    /// A residual of this many times the noise floor is looked at for what it depends on, where it is
    /// coloured ([`unlike`](Self::unlike)).
    pub above_floor: f64,
    /// Below this time of motion a reader is warned that the folds are too short to tell much, names are less
    /// probable, and servos have no friction that changes with running time, s.
    pub least_time: f64,
}

impl Default for Rule {
    fn default() -> Self {
        Rule {
            most_steps: 12,
            least_score: 10.0,
            per_coefficient: 2.0,
            family_wise: 0.01,
            least_gain: 0.02,
            negligible: 0.05,
            little: 0.1,
            most: 0.5,
            nearly_all: 0.8,
            unlike: 2.0,
            block_memories: 3.0,
            shortest_block: 0.5,
            longest_block: 2.0,
            event_surrogate_level: 0.75,
            surrogates: 2000,
            surrogate_correlation: 0.4,
            only_corrects_class: 0.15,
            as_good_score: 3.0,
            least_margin: 1.1,
            max_unexplained: 0.35,
            few_cycles: 5.0,
            above_floor: 1.2,
            least_time: 30.0,
        }
    }
}

/// Why thresholds are no rule.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the rule: {0}")]
pub struct RuleError(String);

impl Rule {
    /// From JSON: an object with the fields that differ from the defaults.
    ///
    /// # Errors
    /// [`RuleError`] where a field is unknown or has a value that no threshold can have.
    pub fn from_json(text: &str) -> Result<Rule, RuleError> {
        let fields: serde_json::Map<String, serde_json::Value> =
            serde_json::from_str(text).map_err(|e| RuleError(e.to_string()))?;
        let read = |fields| serde_json::from_value::<Rule>(serde_json::Value::Object(fields));
        // One by one, as a wrong value does not say whose it is.
        for (name, value) in &fields {
            let one = [(name.clone(), value.clone())].into_iter().collect();
            read(one).map_err(|e| RuleError(format!("{name}: {e}")))?;
        }
        let rule = read(fields).map_err(|e| RuleError(e.to_string()))?;
        for (name, value) in rule.numbers() {
            if value < 0.0 {
                return Err(RuleError(format!("{name} is {value}: give 0 or more")));
            }
        }
        for (name, share) in rule.shares() {
            if share > 1.0 {
                return Err(RuleError(format!("{name} is {share}: it is a share, give at most 1")));
            }
        }
        if rule.shortest_block > rule.longest_block {
            return Err(RuleError(format!(
                "shortest_block ({} s) is longer than longest_block ({} s)",
                rule.shortest_block, rule.longest_block
            )));
        }
        let least = 10.0 * (1.0 / rule.family_wise - 1.0).ceil();
        if (rule.surrogates as f64) < least {
            return Err(RuleError(format!(
                "surrogates is {}: a family_wise of {} needs {least} or more",
                rule.surrogates, rule.family_wise
            )));
        }
        Ok(rule)
    }

    /// All fields by name.
    fn numbers(&self) -> Vec<(String, f64)> {
        let fields = match serde_json::to_value(self) {
            Ok(serde_json::Value::Object(fields)) => fields,
            _ => serde_json::Map::new(),
        };
        fields.into_iter().filter_map(|(name, value)| Some((name, value.as_f64()?))).collect()
    }

    /// What is a probability, a correlation or a share of a whole.
    fn shares(&self) -> [(&'static str, f64); 10] {
        [
            ("family_wise", self.family_wise),
            ("least_gain", self.least_gain),
            ("negligible", self.negligible),
            ("little", self.little),
            ("most", self.most),
            ("nearly_all", self.nearly_all),
            ("event_surrogate_level", self.event_surrogate_level),
            ("surrogate_correlation", self.surrogate_correlation),
            ("only_corrects_class", self.only_corrects_class),
            ("max_unexplained", self.max_unexplained),
        ]
    }

    /// The share by which a squared error falls where its rms falls by [`little`](Self::little).
    pub(crate) fn large_gain(&self) -> f64 {
        1.0 - (1.0 - self.little).powi(2)
    }

    /// The penalty of a score: for coefficients, and for having searched.
    pub(crate) fn penalty(&self, coefficients: usize, searched: f64) -> f64 {
        penalty(self.per_coefficient, coefficients, searched)
    }

    /// Whether one score leads another by too little for a choice between them.
    pub(crate) fn is_as_good(&self, best: f64, other: f64) -> bool {
        other >= best - (self.least_gain * best).max(self.as_good_score)
    }

    /// Surrogates for which a whole search is done again.
    pub(crate) fn searched_surrogates(&self) -> usize {
        self.surrogates / 10
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_is_read_field_by_field() {
        let read = Rule::from_json(r#"{"least_score": 12.5, "most_steps": 3}"#).unwrap();
        assert_eq!(read, Rule { least_score: 12.5, most_steps: 3, ..Rule::default() });
        let whole = serde_json::to_string(&Rule::default()).unwrap();
        assert_eq!(Rule::from_json(&whole).unwrap(), Rule::default());
        assert_eq!(Rule::default().numbers().len(), whole.matches(':').count());
    }

    #[test]
    fn what_is_no_threshold_is_told_by_name() {
        for (text, reason) in [
            (r#"{"least_scores": 1}"#, "unknown field `least_scores`"),
            (r#"{"least_score": -1}"#, "least_score is -1: give 0 or more"),
            (r#"{"family_wise": 2}"#, "family_wise is 2: it is a share"),
            (r#"{"max_unexplained": 5}"#, "max_unexplained is 5: it is a share"),
            (r#"{"negligible": 1.5}"#, "negligible is 1.5: it is a share"),
            (r#"{"little": 1.5}"#, "little is 1.5: it is a share"),
            (r#"{"nearly_all": 1.5}"#, "nearly_all is 1.5: it is a share"),
            (r#"{"most_steps": 1.5}"#, "most_steps: invalid type"),
            (r#"{"least_score": NaN}"#, "expected value"),
            (r#"{"surrogates": 500}"#, "surrogates is 500: a family_wise of 0.01 needs 990 or more"),
            (r#"{"shortest_block": 9}"#, "shortest_block (9 s) is longer than longest_block (2 s)"),
            ("7", "invalid type"),
        ] {
            let why = Rule::from_json(text).unwrap_err().to_string();
            assert!(why.starts_with("the rule: ") && why.contains(reason), "{why}");
        }
    }
}
