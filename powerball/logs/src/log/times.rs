//! Times of logs: one running time through several logs, as what warms up knows no files; torques whose time
//! stamps are known to be off.

use super::Log;
use super::map::Mapped;
use crate::signal::resample::smooth_at;

/// Sets [`Log::clock`] so that `t + clock` runs through all logs.
///
/// Where the spans of `t` do not overlap, `t` is a common clock already. Otherwise the logs were recorded in
/// the given order, one right after the other.
pub fn common_clock(logs: &mut [Log]) {
    let clocks = clocks(logs.iter().map(|log| log.t.as_slice()));
    logs.iter_mut().zip(clocks).for_each(|(log, clock)| log.clock = clock);
}

/// What is added to the times of each log, s.
pub(super) fn clocks<'t>(times: impl Iterator<Item = &'t [f64]>) -> Vec<f64> {
    let span = |t: &[f64]| (t.first().copied().unwrap_or(0.0), t.last().copied().unwrap_or(0.0));
    let spans: Vec<(f64, f64)> = times.map(span).collect();
    let mut sorted = spans.clone();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let start = sorted.first().map_or(0.0, |s| s.0);
    if sorted.windows(2).all(|pair| pair[0].1 <= pair[1].0) {
        return vec![-start; spans.len()];
    }
    let mut end = 0.0;
    let after = |(first, last): (f64, f64)| {
        let clock = end - first;
        end += last - first;
        clock
    };
    spans.into_iter().map(after).collect()
}

impl Log {
    /// The log with torques whose stamps are moved as a map says. What lies within the longest shift of an
    /// end of a piece is left out there: its torque is not known any more.
    #[must_use]
    pub(super) fn shifted(mut self, map: &Mapped) -> Log {
        let shifts: Vec<f64> = (0..self.torque.len()).map(|j| map.shift_of(j)).collect();
        let longest = shifts.iter().fold(0.0f64, |most, s| most.max(s.abs()));
        if longest == 0.0 {
            return self;
        }
        for (torque, shift) in self.torque.iter_mut().zip(&shifts) {
            let logged = torque.clone();
            for piece in &self.pieces {
                let (t, x) = (&self.t[piece.clone()], &logged[piece.clone()]);
                for (torque, to) in torque[piece.clone()].iter_mut().zip(t) {
                    *torque = smooth_at(t, x, to - shift);
                }
            }
        }
        for piece in &mut self.pieces {
            let t = &self.t[piece.clone()];
            let (from, to) = (t[0] + longest, t[t.len() - 1] - longest);
            let start = piece.start;
            *piece = start + t.partition_point(|t| *t < from)..start + t.partition_point(|t| *t <= to);
        }
        self.pieces.retain(|piece| piece.len() >= 2);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::LogError;
    use super::super::columns::TORQUE_LATE;
    use super::super::map::ColumnMap;
    use super::*;

    #[test]
    fn a_shift_moves_torques_and_nothing_else() {
        let t: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        let wave = |late: f64| -> Vec<f64> { t.iter().map(|t| (60.0 * (t - late)).sin()).collect() };
        let log = Log {
            file: "log.csv".into(),
            q: vec![wave(0.0); 2],
            torque: vec![wave(0.083), wave(0.0)],
            temperature: None,
            motor: None,
            pieces: vec![0..400, 400..1000],
            doubts: Vec::new(),
            clock: 0.0,
            t: t.clone(),
        };
        let map = ColumnMap::parse("tau.shift = [-0.083, 0]", "--map").unwrap();
        let shifted = log.clone().shifted(&map.tau);
        assert_eq!((shifted.pieces.clone(), &shifted.q), (vec![9..391, 409..991], &log.q));
        for k in shifted.pieces.into_iter().flat_map(|piece| piece.start + 4..piece.end - 4) {
            approx::assert_abs_diff_eq!(shifted.torque[0][k], log.torque[1][k], epsilon = 2e-4);
            approx::assert_abs_diff_eq!(shifted.torque[1][k], log.torque[1][k], epsilon = 1e-12);
        }
        assert!(ColumnMap::parse("q.shift = 0.1", "--map").unwrap_err().contains("only `tau` and `i`"));
    }

    /// What a log says about its torques is what a map would say; the map counts where both do.
    #[test]
    fn a_log_says_itself_how_late_its_torques_are() {
        use super::super::columns::Asked;
        use super::super::read::parse;
        let text = "name = \"one\"\nconvention = \"standard\"\ngravity = [0, 0, -9.81]\n[[joint]]\n\
                    kind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\n";
        let arm = dyngen::Arm::parse(text, "one.toml").unwrap();
        let lines = |last: f64| {
            let line = |k: i32| {
                let (t, late) = (0.01 * f64::from(k), if k == 399 { last } else { 0.004 });
                format!("{t:.2},{:.6},{:.6},{late}\n", (3.0 * t).sin(), (3.0 * t).cos())
            };
            "t,q1,tau1,tau_late\n".to_string() + &(0..400).map(line).collect::<String>()
        };
        let read = |text: String, map: &str| {
            let map = ColumnMap::parse(map, "--map").unwrap();
            let asked = Asked { arm: &arm, map: &map, file: "log.csv", header: None, goals: false };
            let mut findings = Vec::new();
            parse(text.as_bytes(), asked, &mut findings).map(|log| (log, findings))
        };
        let ((own, notes), (as_mapped, others)) =
            (read(lines(0.004), "").unwrap(), read(lines(0.004), "tau.shift = -0.004").unwrap());
        assert_eq!((&own.torque, &own.pieces), (&as_mapped.torque, &as_mapped.pieces));
        assert!(notes.iter().any(|note| note.quantity == TORQUE_LATE && note.message.contains("4.00 ms")));
        assert!(others.iter().all(|note| !note.to_string().contains(TORQUE_LATE)));
        let as_logged = read(lines(0.004), "tau.shift = 0").unwrap().0;
        assert!((own.torque[0][200] - as_logged.torque[0][200]).abs() > 1e-3);
        let LogError(errors) = read(lines(0.002), "").unwrap_err();
        assert_eq!((errors[0].line, errors[0].quantity.as_str()), (Some(401), TORQUE_LATE));
    }
}
