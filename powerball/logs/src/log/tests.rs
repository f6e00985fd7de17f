use super::columns::Asked;
use super::*;
use dyngen::Arm;
use std::fmt::Write as _;

mod columns;
#[cfg(feature = "parquet")]
mod of_parquet;

const ARM: &str = r#"
name = "two"
convention = "standard"
gravity = [0, 0, -9.81]
[[joint]]
kind = "revolute"
a = 0.3
alpha = "pi/2"
d = 0.1
theta = 0
torque = 50
torque_constant = 2.0
position = [-3.2, 3.2]
[[joint]]
kind = "revolute"
a = 0.2
alpha = 0
d = 0
theta = 0
torque = 50
"#;

fn arm() -> Arm {
    Arm::parse(ARM, "two.toml").unwrap()
}

/// A log of 2 s at 100 Hz, each line passed through `line` first.
fn text(header: &str, mut line: impl FnMut(usize, Vec<String>) -> Option<String>) -> String {
    let mut text = format!("{header}\n");
    for k in 0..200 {
        let t = 0.01 * k as f64;
        let fields = vec![
            format!("{t:.4}"),
            format!("{:.6}", (2.0 * t).sin()),
            format!("{:.6}", (3.0 * t).cos()),
            format!("{:.4}", 5.0 + (7.0 * t).sin()),
            format!("{:.4}", (5.0 * t).cos()),
        ];
        if let Some(line) = line(k, fields) {
            let _ = writeln!(text, "{line}");
        }
    }
    text
}

const HEADER: &str = "t,q1,q2,tau1,tau2";

fn parse(bytes: &[u8], file: &str, arm: &Arm, findings: &mut Vec<Finding>) -> Result<Log, LogError> {
    let asked = Asked { arm, map: &ColumnMap::default(), file, header: None, goals: false };
    #[cfg(feature = "parquet")]
    if bytes.starts_with(b"PAR1") {
        let input = bytes::Bytes::copy_from_slice(bytes);
        let read = |samples: &mut super::read::Samples<'_>, _: &mut Vec<Finding>| {
            crate::tables::columnar::read(input, file, samples).map(|()| false)
        };
        return super::read::rows(asked, findings, super::read::log_of, read);
    }
    super::read::parse(bytes, asked, findings)
}

fn read(text: &str) -> (Result<Log, LogError>, Vec<Finding>) {
    let mut findings = Vec::new();
    let log = parse(text.as_bytes(), "x.csv", &arm(), &mut findings);
    (log, findings)
}

#[test]
fn a_sound_log_is_read_without_findings() {
    let (log, findings) = read(&text(HEADER, |_, f| Some(f.join(","))));
    let log = log.unwrap();
    assert!(findings.is_empty(), "{findings:?}");
    assert_eq!(log.t.len(), 200);
    assert!(matches!(log.pieces.as_slice(), [one] if *one == (0..200)));
    assert_eq!(log.q[1][0], 1.0);
}

/// Recordings of Universal Robots' RTDE: joints from 0, `timestamp`, blanks or commas between columns, and
/// much else.
#[test]
fn rtde_recordings_are_read_by_their_names() {
    let (own, _) = read(&text(HEADER, |_, f| Some(f.join(","))));
    let own = own.unwrap();
    let names = "timestamp target_q_0 target_q_1 actual_q_0 actual_q_1 actual_current_0 actual_current_1 \
                 actual_current_as_torque_0 actual_current_as_torque_1 joint_temperatures_0 \
                 joint_temperatures_1 robot_mode";
    for between in [" ", ",", ";", "\t"] {
        let line = |_: usize, f: Vec<String>| {
            let [t, q1, q2, tau1, tau2] = &f[..] else { return None };
            Some([t, q1, q2, q1, q2, "1", "2", tau1, tau2, "30", "31", "7"].join(between))
        };
        let (log, findings) = read(&text(&names.replace(' ', between), line));
        let log = log.unwrap();
        assert_eq!((&log.t, &log.q, &log.torque), (&own.t, &own.q, &own.torque), "{between:?}");
        assert_eq!(log.temperature.unwrap()[1][0], 31.0);
        assert!(findings.iter().any(|f| f.message.contains("kept out: target_q_0")), "{findings:?}");
        // Without torques currents count, with the arm's constants, and the second joint has none.
        let bare = names.replace("actual_current_as_torque", "target_moment").replace(' ', between);
        let why = read(&text(&bare, line)).0.unwrap_err().to_string();
        assert!(why.contains("no torque_constant") && why.contains("joint 2"), "{why}");
    }
}

/// Temperatures are those of every sample or none, and what is missing is reported.
#[test]
fn temperatures_that_lack_samples_are_reported() {
    let header = format!("{HEADER},temp1,temp2");
    for (holes, reported) in [(0, false), (1, true), (2, true)] {
        let (log, findings) = read(&text(&header, |k, mut f| {
            let hole = k < holes;
            f.extend(["30".to_string(), if hole { String::new() } else { "31".to_string() }]);
            Some(f.join(","))
        }));
        let log = log.unwrap();
        assert_eq!((log.temperature.is_none(), log.t.len()), (reported, 200));
        let found: Vec<String> = findings.iter().map(ToString::to_string).collect();
        let expected = format!("temp2: {holes} of 200 samples are no number: the log's temperatures are not");
        assert_eq!(found.iter().filter(|one| one.contains(&expected)).count(), found.len(), "{found:?}");
        assert_eq!(found.len(), usize::from(reported), "{found:?}");
    }
}

#[test]
fn faults_are_found_with_their_line_and_taken_out() {
    let spoilt = text(&format!("{HEADER},mode"), |k, mut f| {
        f.push("run".into());
        match k {
            10 => f[2] = "nan".into(),
            20 => f[0] = "0.19".into(),
            100..150 => return None,
            199 => return Some("1.99,0.1".into()),
            _ => {}
        }
        Some(f.join(","))
    });
    let (log, findings) = read(&spoilt);
    let log = log.unwrap();
    let said = findings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    for part in [
        "kept out: mode",
        "x.csv:12: q2",
        "x.csv:22: t: 1 of",
        "torn",
        "x.csv:102: t: at 0.990 s: a gap of 0.5",
    ] {
        assert!(said.contains(part), "{part} not in\n{said}");
    }
    assert_eq!(log.pieces.len(), 2);
    assert!(log.q.iter().flatten().all(|v| v.is_finite()));
}

#[test]
fn wraps_are_undone() {
    let wrapped = text(HEADER, |k, mut f| {
        let q = 2.0 + 0.02 * k as f64;
        f[1] = format!("{:.6}", if q > std::f64::consts::PI { q - 2.0 * std::f64::consts::PI } else { q });
        Some(f.join(","))
    });
    let (log, findings) = read(&wrapped);
    let log = log.unwrap();
    assert!((log.q[0][199] - 5.98).abs() < 1e-3);
    assert!(findings.iter().any(|f| f.quantity == "q1" && f.message.contains("unwrapped")));
}

#[test]
fn what_cannot_be_used_is_refused_with_its_reason() {
    let plain = |header: &str| text(header, |_, f| Some(f.join(",")));
    let cases = [
        (plain("t,q1,q3,tau1,tau2"), "missing: q2"),
        (plain("seconds_at,q1,q2,tau1,tau2"), "no column t"),
        (plain("t,q1,q2,i1,i2"), "torque_constant (N·m/A at the joint) for joint 2"),
        (plain("t,q1,q2,tau1,tau1"), "twice"),
        (
            text(HEADER, |k, mut f| {
                f[0] = format!("{}", 10 * k);
                Some(f.join(","))
            }),
            "this looks like ms",
        ),
        (
            text(HEADER, |k, mut f| {
                f[1] = format!("{}", k as f64 * 0.9 - 90.0);
                Some(f.join(","))
            }),
            "degrees",
        ),
        (
            text(HEADER, |k, mut f| {
                f[3] = format!("{}", 4000 + k);
                Some(f.join(","))
            }),
            "mN·m",
        ),
        (
            text(HEADER, |k, mut f| {
                if k % 3 == 0 {
                    f[1] = "".into()
                }
                Some(f.join(","))
            }),
            "no finite number",
        ),
        (
            text(HEADER, |k, mut f| {
                f[0] = format!("{}", -0.01 * k as f64);
                Some(f.join(","))
            }),
            "do not rise",
        ),
        (HEADER.to_string(), "too few"),
        (String::new(), "x.csv: file: is empty"),
        ("\n \n".to_string(), "is empty"),
        ("\0".repeat(5000), "holds bytes that are no text"),
        (plain("t,q1,q2,q3,tau1"), "q3: the header has q3, the arm has 2 joints"),
        (
            decimal_commas(","),
            "has 10 fields where the header names 5 columns: decimal commas between commas",
        ),
    ];
    for (text, reason) in cases {
        let (log, _) = read(&text);
        let said = log.err().map(|e| e.to_string()).unwrap_or_default();
        assert!(said.contains(reason), "'{reason}' not in '{said}'");
    }
}

/// Torque limits of URDFs are often placeholders: a log beyond such a limit is read, and the limit reported.
#[test]
fn a_torque_limit_that_is_a_placeholder_is_reported() {
    let beyond = |scale: f64| {
        read(&text(HEADER, |k, mut f| {
            f[3] = format!("{}", scale * (50.0 + (k % 2) as f64));
            Some(f.join(","))
        }))
    };
    let (log, findings) = beyond(4.0);
    assert!(log.is_ok());
    let found = findings.iter().find(|f| f.quantity == "tau1").expect("a finding about tau1");
    assert!(found.message.contains("the limit is a placeholder"), "{}", found.message);
    let (log, _) = beyond(1000.0);
    assert!(log.err().is_some_and(|e| e.to_string().contains("mN·m")));
}

/// A position at which a loop of four bars cannot close is reported with its line and the loop's range.
#[test]
fn a_position_at_which_a_loop_does_not_close_is_reported() {
    let text = include_str!("../../../../dyngen/tests/loops/double.toml");
    let arm = Arm::parse(text, "double.toml").unwrap();
    let log = |way: f64| {
        let line = |k: u32| {
            let t = 0.01 * f64::from(k);
            format!("{t},{},{},0.1,1,2,{}\n", way * t - 0.9, 0.2 * t, t.cos())
        };
        let text = "t,q1,q2,q3,tau1,tau2,tau3\n".to_string() + &(0..100).map(line).collect::<String>();
        parse(text.as_bytes(), "x.csv", &arm, &mut Vec::new())
    };
    log(1.8).unwrap();
    let why = log(3.9).unwrap_err().to_string();
    assert!(why.starts_with("x.csv:") && why.contains("does not close (it closes between "), "{why}");
}

/// A log with decimal commas.
fn decimal_commas(between: &str) -> String {
    let line = |_, f: Vec<String>| Some(f.join(between).replace('.', ","));
    text(&HEADER.replace(',', between), line)
}

#[test]
fn decimal_commas_are_read_where_other_signs_stand_between_numbers() {
    let (plain, _) = read(&text(HEADER, |_, f| Some(f.join(","))));
    for between in [";", "\t"] {
        let (log, findings) = read(&decimal_commas(between));
        let (log, plain) = (log.unwrap(), plain.as_ref().unwrap());
        assert_eq!((&log.t, &log.q, &log.torque), (&plain.t, &plain.q, &plain.torque));
        assert!(findings.iter().any(|f| f.message.contains("decimal commas")), "{findings:?}");
    }
}

/// What people give by mistake is named by what it is.
#[test]
fn files_of_other_kinds_are_named() {
    let spreadsheet: Vec<u8> = b"\xff\xfe".iter().copied().chain(*b"t\0,\0q\0").collect();
    for (bytes, what) in [
        (b"\x89PNG\r\n\x1a\n\0\0".as_slice(), "is no log: it is a PNG picture"),
        (b"\x1f\x8b\x08\0", "compressed by gzip"),
        (&spreadsheet, "UTF-16"),
    ] {
        let said = parse(bytes, "x.csv", &arm(), &mut Vec::new()).unwrap_err().to_string();
        assert!(said.contains(what), "'{what}' not in '{said}'");
    }
}

/// A log of 40 s at 100 Hz with velocities and friction, its columns passed through `change`: t, q1, q2, dq1,
/// dq2, tau1, tau2.
fn swings(mut change: impl FnMut(usize, &mut [f64; 7])) -> String {
    let mut text = String::from("t,q1,q2,dq1,dq2,tau1,tau2\n");
    for k in 0..4000 {
        let t = 0.01 * k as f64;
        let (w1, w2) = (1.3, 1.9);
        let (v1, v2) = (w1 * (w1 * t).cos(), -w2 * (w2 * t).sin());
        let tau = |v: f64, q: f64| 4.0 * (20.0 * v).tanh() + 2.0 * v + 9.0 * q.cos();
        let (q1, q2) = ((w1 * t).sin(), (w2 * t).cos());
        let mut row = [t, q1, q2, v1, v2, tau(v1, q1 + q2), tau(v2, q2)];
        change(k, &mut row);
        let row: Vec<String> = row.iter().map(|x| format!("{x:.6}")).collect();
        let _ = writeln!(text, "{}", row.join(","));
    }
    text
}

/// What is reported about a log: findings, or why it cannot be used.
fn said(text: &str) -> Vec<String> {
    let (log, findings) = read(text);
    let errors = log.err().map(|e| e.0).unwrap_or_default();
    findings.iter().chain(&errors).map(ToString::to_string).collect()
}

#[test]
fn each_doubt_finds_its_fault_and_no_other() {
    assert_eq!(said(&swings(|_, _| ())), Vec::<String>::new());
    let round = |x: &mut f64, step: f64| *x = (*x / step).round() * step;
    let cases: [(&str, &[&str]); 12] = [
        (
            &swings(|_, r| r.swap(3, 4)),
            &["dq1: is not the slope of q1, but dq2 is", "dq2: is not the slope of q2"],
        ),
        (&swings(|_, r| r[3] = -r[3]), &["dq1: is -1.000 times the slope of q1: their signs differ"]),
        (&swings(|_, r| r[4] *= 57.2958), &["dq2: is 57.2", "deg/s"]),
        (&swings(|k, r| r[4] = (0.001 * (k * k) as f64).sin()), &["dq2: does not follow q2"]),
        (&swings(|_, r| r[0] *= 1.02), &["t: passes 2.0 % too fast for the joints' velocities"]),
        (
            &swings(|_, r| r[0] += 2e-4 * r[0] * r[0]),
            &["drifts against the joints' velocities", "x.csv:2668: t: at 26.8"],
        ),
        (&swings(|_, r| r[5] = r[5].clamp(-100.0, 12.0)), &["tau1: at ", "stays at its extreme 12 for"]),
        (&swings(|_, r| round(&mut r[6], 1.5)), &["tau2: has 12 levels", "1.500e0 apart"]),
        (&swings(|_, r| round(&mut r[1], 0.02)), &["q1: has 101 levels, 2.000e-2 apart: accelerations"]),
        (&swings(|_, r| r[5] = -r[5]), &["tau1: is ", "friction would have to drive the joint"]),
        (&swings(|_, r| (r[1], r[3]) = (-r[1], -r[3])), &["tau1: is ", "or that of q1"]),
        (&swings(|_, r| r[6] = 3.0), &["tau2: never changes"]),
    ];
    for (text, parts) in cases {
        let found = said(text);
        let all = found.join("\n");
        assert!(parts.iter().all(|part| all.contains(part)), "{parts:?} not in\n{all}");
        // Of the kind that is meant, and of no other; a drifting clock is off altogether too.
        assert!(found.len() <= 3, "{parts:?}:\n{all}");
    }
}

/// Sound logs of real arms are not doubted beyond what is so: uneven steps and columns that are not known.
#[test]
fn measured_logs_give_no_false_findings() {
    for (name, most) in [("ur10e", 11), ("lwa4p_rollouts", 74)] {
        let Some(folder) = crate::measured::measured(name) else { return };
        let arm = Arm::read(&folder.join("arm.toml")).unwrap();
        let mut count = 0;
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|e| e != "csv") {
                continue;
            }
            let mut findings = Vec::new();
            read_log(&path, &arm, &mut findings).unwrap();
            for finding in &findings {
                let known = ["kept out:", "of the steps differ from the median", "never changes"];
                assert!(known.iter().any(|part| finding.message.contains(part)), "{finding}");
            }
            count += 1;
        }
        assert_eq!(count, most);
    }
}

#[test]
fn garbage_is_no_panic() {
    use rand::{RngExt, SeedableRng};
    let sound = text(HEADER, |_, f| Some(f.join(","))).into_bytes();
    for seed in 0..200 {
        let mut rng = chacha20::ChaCha8Rng::seed_from_u64(seed);
        let mut bytes = sound.clone();
        for _ in 0..rng.random_range(1..40) {
            let at = rng.random_range(0..bytes.len());
            match rng.random_range(0..3) {
                0 => bytes[at] = rng.random(),
                1 => bytes.truncate(at.max(1)),
                _ => drop(bytes.remove(at)),
            }
            if bytes.len() < 2 {
                break;
            }
        }
        let mut findings = Vec::new();
        if let Ok(log) = parse(&bytes, "x.csv", &arm(), &mut findings) {
            assert!(log.q.iter().chain(&log.torque).flatten().all(|v| v.is_finite()));
        }
    }
}

#[test]
fn a_clock_that_runs_on_is_common_and_others_follow_each_other() {
    let log = |from: f64, to: f64| Log {
        file: String::new(),
        t: vec![from, to],
        q: vec![],
        torque: vec![],
        temperature: None,
        motor: None,
        pieces: vec![],
        doubts: Vec::new(),
        clock: 0.0,
    };
    let mut running = [log(10.0, 20.0), log(40.0, 50.0), log(20.5, 30.0)];
    common_clock(&mut running);
    assert_eq!(running.map(|l| l.t[0] + l.clock), [0.0, 30.0, 10.5]);
    let mut restarted = [log(0.0, 20.0), log(0.0, 10.0), log(1.0, 5.0)];
    common_clock(&mut restarted);
    assert_eq!(restarted.map(|l| l.t[0] + l.clock), [0.0, 20.0, 30.0]);
}

/// Signals of [`text`] in memory: a log from them is the log from the file.
fn signals(text: &str) -> (Vec<f64>, [Vec<Vec<f64>>; 2]) {
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    let column = |c: usize| -> Vec<f64> { rows.iter().map(|row| row[c]).collect() };
    (column(0), [vec![column(1), column(2)], vec![column(3), column(4)]])
}

#[test]
fn arrays_and_samples_pass_the_checks_of_files() {
    // An angle that wraps, and a hole.
    let text = text(HEADER, |k, mut fields| {
        if k >= 100 {
            let q: f64 = fields[2].parse().unwrap();
            fields[2] = format!("{:.6}", q - 2.0 * std::f64::consts::PI);
        }
        if k == 50 {
            fields[3] = "NaN".into();
        }
        Some(fields.join(","))
    });
    let (from_file, expected) = read(&text);
    let from_file = from_file.unwrap();
    let (t, [q, torque]) = signals(&text);
    let arrays = Arrays { t: &t, q: &q, torque: &torque, ..Arrays::default() };
    let by_array = Log::from_arrays("x.csv", &arm(), &arrays).unwrap();
    let rows: Vec<[Vec<f64>; 2]> =
        (0..t.len()).map(|k| [&q, &torque].map(|x| x.iter().map(|x| x[k]).collect())).collect();
    let samples: Vec<Sample<'_>> = t
        .iter()
        .zip(&rows)
        .map(|(t, [q, torque])| Sample { t: *t, q, torque, ..Sample::default() })
        .collect();
    let by_sample = Log::from_samples("x.csv", &arm(), samples).unwrap();
    for (log, findings) in [by_array, by_sample] {
        assert_eq!((&log.t, &log.q, &log.torque), (&from_file.t, &from_file.q, &from_file.torque));
        assert_eq!(log.pieces, from_file.pieces);
        // Findings are those of the file; a sample counts from 1 where a line counts its header.
        let quantities = |all: &[Finding]| all.iter().map(|f| f.quantity.clone()).collect::<Vec<_>>();
        assert_eq!(quantities(&findings), quantities(&expected));
        let hole = |all: &[Finding]| all.iter().find(|f| f.quantity == "tau1").cloned().unwrap();
        assert_eq!(hole(&findings).line.map(|sample| sample + 1), hole(&expected).line);
        assert!(hole(&findings).message.starts_with("1 of 200 samples"), "{findings:?}");
    }
}

#[test]
fn arrays_that_are_no_log_name_quantity_and_sample() {
    let (t, [q, torque]) = signals(&text(HEADER, |_, fields| Some(fields.join(","))));
    let of = |q: &[Vec<f64>], torque: &[Vec<f64>]| {
        Log::from_arrays("run", &arm(), &Arrays { t: &t, q, torque, ..Arrays::default() })
            .unwrap_err()
            .to_string()
    };
    let short = vec![q[0].clone(), q[1][..99].to_vec()];
    assert_eq!(of(&short, &torque), "run: q2: has 99 values for 200 times t: give one for each");
    assert!(of(&q[..1], &torque).contains("missing: q2"));
    assert!(of(&q, &[]).contains("missing: tau1, tau2"));
    let degrees: Vec<Vec<f64>> = q.iter().map(|q| q.iter().map(|x| 900.0 * x).collect()).collect();
    // All joints in one line.
    let said = of(&degrees, &torque);
    assert!(
        said.starts_with("run: q1, q2: q1 reaches") && said.contains("angles must be in radians"),
        "{said}"
    );
    assert_eq!(said.lines().count(), 1, "{said}");
    let holes = vec![torque[0].iter().map(|_| f64::NAN).collect(), torque[1].clone()];
    assert!(of(&q, &holes).starts_with("run:1: tau1: 200 of 200 samples"), "{}", of(&q, &holes));
}

#[test]
fn a_clock_that_restarts_makes_pieces_whose_times_go_on() {
    let restarting = |k: usize, mut f: Vec<String>| {
        f[0] = format!("{}", 0.01 * (k % 70) as f64);
        Some(f.join(","))
    };
    let (log, findings) = read(&text(HEADER, restarting));
    let log = log.unwrap();
    assert_eq!((log.t.len(), log.pieces.as_slice()), (200, &[0..70, 70..140, 140..200][..]));
    assert!(log.t.windows(2).all(|w| w[0] < w[1]));
    let said: Vec<String> = findings.iter().map(ToString::to_string).collect();
    assert_eq!(said.iter().filter(|s| s.contains("the clock restarts 2 times")).count(), 1, "{said:?}");
    assert!(!said.iter().any(|s| s.contains("a gap")), "{said:?}");
}

#[test]
fn a_number_that_cannot_be_is_named_and_left_out() {
    for (column, value, quantity) in
        [(3, "1e9", "tau1"), (4, "-1e300", "tau2"), (1, "57.0", "q1"), (2, "-400", "q2")]
    {
        let spoilt = |k: usize, mut f: Vec<String>| {
            if k == 120 {
                f[column] = value.to_string();
            }
            Some(f.join(","))
        };
        let (log, findings) = read(&text(HEADER, spoilt));
        let log = log.unwrap();
        assert_eq!((log.t.len(), log.pieces.len()), (199, 1), "{quantity}");
        let said = findings.iter().find(|f| f.quantity == quantity).unwrap();
        // The header is line 1.
        assert_eq!(said.line, Some(122));
        assert!(said.message.contains("cannot be") && said.message.ends_with("left out"), "{said}");
    }
    // Six of a thousand are no rare fault: they stay, and the estimator that tolerates them is named.
    let mut spikes = format!("{HEADER}\n");
    for k in 0..1000 {
        let t = 0.01 * f64::from(k);
        let torque = if k % 180 == 90 { 1e9 } else { t.sin() };
        spikes.push_str(&format!("{t},{},{},{torque},{}\n", (2.0 * t).sin(), (3.0 * t).cos(), t.cos()));
    }
    let (log, findings) = read(&spikes);
    assert_eq!(log.unwrap().t.len(), 1000);
    let said = findings.iter().find(|f| f.quantity == "tau1").unwrap();
    assert!(
        said.message.contains("(6 such samples") && said.message.contains("--estimator robust"),
        "{said}"
    );
    // A wrap of the angle and back is no fault, and neither is a knock.
    let sound = |k: usize, mut f: Vec<String>| {
        if k == 120 {
            f[2] = format!("{}", f[2].parse::<f64>().unwrap() + std::f64::consts::TAU);
            f[3] = "30".to_string();
        }
        Some(f.join(","))
    };
    assert_eq!(read(&text(HEADER, sound)).0.unwrap().t.len(), 200);
}

#[test]
fn one_factor_between_all_velocities_and_slopes_is_a_wrong_time() {
    let header = format!("{HEADER},dq1,dq2");
    let with = |factors: [f64; 2]| {
        let line = move |k: usize, f: Vec<String>| {
            let t = 0.01 * k as f64;
            // q1 = sin 2t and q2 = cos 3t.
            let slopes = [2.0 * (2.0 * t).cos(), -3.0 * (3.0 * t).sin()];
            Some(format!("{},{},{}", f.join(","), factors[0] * slopes[0], factors[1] * slopes[1]))
        };
        read(&text(&header, line)).0.unwrap().doubts
    };
    let doubts = with([0.5, 0.5]);
    assert_eq!(doubts.len(), 1);
    assert_eq!(doubts[0].map.as_deref(), Some("t.scale = 2"));
    assert!(doubts[0].sentence.starts_with("Time runs 2.00 times too fast"), "{}", doubts[0].sentence);
    // As they should be; of one joint alone; degrees a second, rpm.
    for factors in [[1.0, 1.0], [0.5, 1.0], [57.2958, 57.2958], [9.549, 9.549]] {
        assert_eq!(with(factors), [], "{factors:?}");
    }
}

#[test]
fn a_log_that_is_cut_keeps_its_first_samples_and_pieces() {
    let signals = |width: usize| vec![vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]; width];
    let log = Log {
        file: "made".into(),
        t: vec![0.0, 0.1, 0.2, 5.0, 5.1, 5.2],
        q: signals(2),
        torque: signals(2),
        temperature: Some(signals(2)),
        motor: None,
        pieces: vec![0..3, 3..6],
        doubts: Vec::new(),
        clock: 0.0,
    };
    let cut = log.clone().cut(4);
    assert_eq!((cut.t.as_slice(), cut.pieces), (&log.t[..4], vec![0..3, 3..4]));
    let temperature = cut.temperature.unwrap();
    assert!(cut.q.iter().chain(&cut.torque).chain(&temperature).all(|x| x == &[1.0, 2.0, 3.0, 4.0]));
    assert_eq!(log.clone().cut(3).pieces, vec![0..3]);
    assert_eq!(log.clone().cut(100).pieces, log.pieces);
}
