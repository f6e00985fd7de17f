//! Every threshold that decides what an explanation says, with its reason.

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
    /// names by an experiment. A candidate must exceed all but this share of its time-shift surrogates.
    pub family_wise: f64,
    /// The held-out squared error must fall by this share on average over folds: 1 % of the rms, below which
    /// no user would notice. A signal that explains less of a residual's variance is not reported.
    pub least_gain: f64,
    /// … and it must fall at all in this share of the folds: four of five.
    pub folds_that_must_gain: f64,
    /// No fold may lose more than this share of its squared error.
    pub worst_fold: f64,

    /// What lowers the squared error of its joints by this share, on the validation set and the other way
    /// round, needs no folds: a tenth of the rms. What position servos lack on all logs needs no significance
    /// where it lowers that of the validation set by this share: few seconds of it are too few blocks.
    pub large_gain: f64,
    /// … where either way adds the same: their correlation.
    pub least_correlation: f64,
    /// The zeros of torque sensors are in the model from the start where this many joints gain
    /// [`large_gain`](Self::large_gain) by them, both ways round: one joint alone is an effect like any
    /// other.
    pub joints_with_zeros: usize,
    /// Blocks that count as independent last this many autocorrelation times of what is left …
    pub block_memories: f64,
    /// … but not less, s …
    pub shortest_block: f64,
    /// … and not more, s.
    pub longest_block: f64,

    /// Share of its time-shift surrogates whose score an event of some seconds must exceed: shifted in time
    /// it falls onto others of its kind for at most a quarter of a log.
    pub event_surrogate_level: f64,
    /// Surrogates of a step, and those that state the false-positive rate.
    pub surrogates: usize,
    /// Surrogates for which a search is done again: an effect's for logs and times, that for ripple above the
    /// band.
    pub searched_surrogates: usize,
    /// A shifted column that still correlates so much with the unshifted one (a periodic motion) is no
    /// surrogate.
    pub surrogate_correlation: f64,

    /// A term of the class of an accepted one, on the same joint, that gains less than this share of it
    /// corrects that one's law and is no effect of its own.
    pub only_corrects_class: f64,
    /// That share for a term of another class: laws are wrong by a few percent, and that shows in any guise.
    pub only_corrects_any: f64,
    /// Two events this close count as one whose time is a little off, s.
    pub same_event: f64,

    /// A group with fewer columns is preferred where the better one's score is larger by less than this share
    /// or [`as_good_score`](Self::as_good_score): these data do not tell the two apart.
    pub as_good: f64,
    /// See [`as_good`](Self::as_good): a likelihood ratio of 4.
    pub as_good_score: f64,
    /// Two names whose gains differ by less than this factor cannot be distinguished by these data.
    pub least_margin: f64,
    /// Two names of which one explains this share of what the other does are words for the same part of a
    /// residual. Names for the same thing share 98 % and more of it, names for different things less than 70
    /// % (noise-free trials on other data).
    pub same_part: f64,
    /// A name that is not distinguished ([`least_margin`](Self::least_margin)) from the next best one for
    /// another part ([`same_part`](Self::same_part)) is not given where it leaves more than this share of the
    /// excess over the noise floor: then something else is there, and what fits best only resembles it. The
    /// share is that of an earlier trial on other data. What is in validation logs only must leave no more of
    /// their excess over the fitted logs.
    pub max_unexplained: f64,
    /// What is more than this share is most of a thing: half. An event of some seconds (a push) must explain
    /// most of what its time has more of squared error than others; another log has the same push where it
    /// has it for most of its time; an effect most of which is missing in some octave, by more than
    /// [`missing_errors`](Self::missing_errors), is not the effect that it is called.
    pub most: f64,
    /// See [`most`](Self::most): standard errors that chance exceeds once in 800,
    /// [`family_wise`](Self::family_wise) over eight octaves.
    pub missing_errors: f64,
    /// A change of the held-out squared error by this share, 5 % of the rms, is clear. A name is taken back
    /// where without its effect that error is smaller on its joints, or by this share on all together; what
    /// is in validation logs only must not raise that of any joint by it; and on repeats of one path, where
    /// whoever has more parameters fits the error that is the same in all of them, the per-joint fit is taken
    /// only where it lowers it by more.
    pub clear_change: f64,

    /// Two recordings are one path where their positions over time correlate more than this: a path that
    /// drifts with warmth keeps its shape, and two different paths hardly correlate.
    pub same_path: f64,
    /// A ripple with fewer cycles along the path than this is as good as any other smooth function of the
    /// position.
    pub few_cycles: f64,
    /// Two runs start at the same place where every joint does to this share of its travel in all logs.
    pub same_start: f64,

    /// A validation log whose squared error is this many times that of the fitted logs holds something that
    /// they do not. For position servos a mass or a gain is looked for in such a log; where none takes away
    /// most of its squared error, it is unlike the others from that ratio of the rms on.
    pub odd_log: f64,
    /// A log has the same push if that also explains this share of the force's own torque: a push of another
    /// size or direction is another one.
    pub same_force: f64,

    /// A residual of this many times the noise floor is looked at for what it depends on …
    pub above_floor: f64,
    /// … where the variance of its slow means exceeds that of white noise by this factor.
    pub coloured: f64,

    /// A joint is predicted where no more than this share of its torque's rms is left on the validation set.
    /// Where more than 1 less this share is left, a model predicts next to nothing.
    pub predicted_share: f64,
    /// What is left of a joint below this share of its torque needs no name, whatever it depends on: a law
    /// that is missing often leaves less than [`predicted_share`](Self::predicted_share).
    pub little_share: f64,

    /// Below this time of motion a reader is warned that the folds are too short to tell much, and servos
    /// have no friction that changes with running time, s.
    pub least_time: f64,
    /// A share of accepted surrogates above this is no chance: the residuals are not what the tests take them
    /// for, and a reader is warned.
    pub many_accepted: f64,

    /// Two names whose models differ by less than this share of what either explains say the same.
    pub same_model: f64,
}

impl Default for Rule {
    fn default() -> Self {
        Rule {
            most_steps: 12,
            least_score: 10.0,
            per_coefficient: 2.0,
            family_wise: 0.01,
            least_gain: 0.02,
            folds_that_must_gain: 0.8,
            worst_fold: -0.05,
            large_gain: 0.19,
            least_correlation: 0.5,
            joints_with_zeros: 2,
            block_memories: 3.0,
            shortest_block: 0.5,
            longest_block: 2.0,
            event_surrogate_level: 0.75,
            surrogates: 2000,
            searched_surrogates: 200,
            surrogate_correlation: 0.4,
            only_corrects_class: 0.15,
            only_corrects_any: 0.05,
            same_event: 2.0,
            as_good: 0.02,
            as_good_score: 3.0,
            least_margin: 1.1,
            same_part: 0.9,
            max_unexplained: 0.35,
            most: 0.5,
            missing_errors: 3.2,
            clear_change: 0.1,
            same_path: 0.9,
            few_cycles: 5.0,
            same_start: 0.05,
            odd_log: 2.0,
            same_force: 0.8,
            above_floor: 1.2,
            coloured: 2.0,
            predicted_share: 0.1,
            little_share: 0.05,
            least_time: 30.0,
            many_accepted: 0.05,
            same_model: 0.1,
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
            if name != "worst_fold" && value < 0.0 {
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
    fn shares(&self) -> [(&'static str, f64); 21] {
        [
            ("least_gain", self.least_gain),
            ("large_gain", self.large_gain),
            ("only_corrects_class", self.only_corrects_class),
            ("only_corrects_any", self.only_corrects_any),
            ("as_good", self.as_good),
            ("same_part", self.same_part),
            ("max_unexplained", self.max_unexplained),
            ("most", self.most),
            ("same_force", self.same_force),
            ("predicted_share", self.predicted_share),
            ("many_accepted", self.many_accepted),
            ("family_wise", self.family_wise),
            ("folds_that_must_gain", self.folds_that_must_gain),
            ("least_correlation", self.least_correlation),
            ("event_surrogate_level", self.event_surrogate_level),
            ("surrogate_correlation", self.surrogate_correlation),
            ("same_path", self.same_path),
            ("clear_change", self.clear_change),
            ("same_start", self.same_start),
            ("little_share", self.little_share),
            ("same_model", self.same_model),
        ]
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
            (r#"{"clear_change": 1.5}"#, "clear_change is 1.5: it is a share"),
            (r#"{"same_start": 1.5}"#, "same_start is 1.5: it is a share"),
            (r#"{"little_share": 1.5}"#, "little_share is 1.5: it is a share"),
            (r#"{"same_model": 1.5}"#, "same_model is 1.5: it is a share"),
            (r#"{"most_steps": 1.5}"#, "most_steps: invalid type"),
            (r#"{"least_score": NaN}"#, "expected value"),
            (r#"{"shortest_block": 9}"#, "shortest_block (9 s) is longer than longest_block (2 s)"),
            ("7", "invalid type"),
        ] {
            let why = Rule::from_json(text).unwrap_err().to_string();
            assert!(why.starts_with("the rule: ") && why.contains(reason), "{why}");
        }
    }
}
