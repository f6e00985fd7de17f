//! What these logs cannot show, and what to record instead.

use super::apart::APART;
use super::forward::Session;

/// Said where the logs to judge on are repeats.
const ONE_PATH: &str = "the logs of --validate run the same path as those of --log: what depends on \
    positions (springs, zeros, \
                        gravity, broken symmetries, slow ripple) was not considered; record another path";
/// Below this time of motion the folds are too short to tell much, s.
const LEAST_TIME: f64 = 30.0;
/// A share of accepted placebos above this is no chance: the residuals are not what the tests take them for.
const MANY: f64 = 0.05;

impl Session<'_> {
    /// Everything that a reader should know before believing the result.
    pub(super) fn doubts(&self) -> Vec<String> {
        let mut doubts: Vec<String> = Vec::new();
        for note in self.data.notes.iter().chain(&self.other.notes) {
            if !doubts.contains(note) {
                doubts.push(note.clone());
            }
        }
        let unseen: Vec<&str> = (self.data.body.names().iter().enumerate())
            .filter(|(c, _)| {
                !self.fit.free[..self.fit.design.inertial]
                    .iter()
                    .skip(*c)
                    .step_by(self.fit.design.set)
                    .any(|f| *f)
            })
            .map(|(_, name)| name.as_str())
            .collect();
        if !unseen.is_empty() {
            doubts.push(format!(
                "these logs do not determine {}: an effect that resembles them cannot be told from them; \
                    record a motion that excites \
                 them (powerball excite)",
                unseen.join("; ")
            ));
        }
        let seconds: f64 = self.data.recordings.iter().map(|r| r.len() as f64 / r.rate).sum();
        if seconds < LEAST_TIME {
            doubts.push(format!(
                "the logs to fit hold {seconds:.0} s: too little to tell small effects from chance; record \
                    several paths of 20 s or more"
            ));
        }
        if self.data.joints_apart {
            doubts.push(APART.to_string());
        }
        if self.one_path {
            doubts.push(ONE_PATH.to_string());
        }
        doubts.extend(self.clock.note().map(str::to_string));
        let placebos = &self.false_positives;
        if placebos.accepted as f64 > MANY * placebos.placebos as f64 && placebos.accepted > 2 {
            doubts.push(format!(
                "{} of {} effects that cannot be there were accepted: what the model leaves on these logs is \
                    large and smooth, and names \
                 given here may be wrong; see what is unattributed, and whether the logs and the arm file \
                 belong together",
                placebos.accepted, placebos.placebos
            ));
        }
        doubts
    }
}
