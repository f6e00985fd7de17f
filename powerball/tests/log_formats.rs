//! Each format at its edges: damaged files, files that others left, and files that others must be able to
//! read.
//!
//! Files of others were written by the formats' own libraries in Python: tests/logs_data/formats.py.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use powerball::Log;
use powerball::logs::log::{ColumnMap, Finding, ServoLog};
use powerball::logs::tables::{Contents, JointState, McapWriter, read_contents};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

const JOINTS: &str = "joints = [\"shoulder\", \"elbow\"]\n";

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/logs_data").join(name)
}

fn arm() -> Arm {
    let joint = "[[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\n";
    let text = format!("name = \"two\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n{joint}{joint}");
    Arm::parse(&text, "two.toml").unwrap()
}

fn read(path: &Path, map: &str) -> (Log, Vec<Finding>) {
    Log::read_as(path, &arm(), &ColumnMap::parse(map, "map").unwrap()).unwrap()
}

fn notes_of(contents: &Contents) -> String {
    contents.notes.iter().map(|note| format!("{note}\n")).collect()
}

/// A folder of a test's own, empty.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("log_formats").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

// MCAP.

fn summary(bytes: &[u8]) -> mcap::Summary {
    mcap::Summary::read(bytes).unwrap().unwrap()
}

/// Where the compressed bytes of a chunk begin, and how many messages its index names.
fn chunk(bytes: &[u8], number: usize) -> (usize, usize) {
    let summary = summary(bytes);
    let index = &summary.chunk_indexes[number];
    let messages = summary.read_message_indexes(bytes, index).unwrap().values().map(Vec::len).sum();
    (index.compressed_data_offset().unwrap() as usize, messages)
}

#[test]
fn a_damaged_chunk_loses_its_own_messages_only() {
    let whole = std::fs::read(data("joint_state.mcap")).unwrap();
    let all = read_contents(&data("joint_state.mcap")).unwrap().tables.remove(0);
    let (at, lost) = chunk(&whole, 1);
    let (first, chunks) = (chunk(&whole, 0).1, summary(&whole).chunk_indexes.len());
    assert!(chunks > 2 && lost > 10);
    let mut damaged = whole.clone();
    damaged[at + 40] ^= 0x10;
    let end = summary(&whole).stats.unwrap();
    let folder = folder("damaged_chunk");
    // With its index, and as a program that died leaves it: without an end.
    let data_ends = damaged.len() - 8 - 29 - 200;
    for (name, bytes) in [("indexed.mcap", &damaged[..]), ("interrupted.mcap", &damaged[..data_ends])] {
        let file = folder.join(name);
        std::fs::write(&file, bytes).unwrap();
        let contents = read_contents(&file).unwrap();
        let (table, notes) = (&contents.tables[0], notes_of(&contents));
        assert_eq!(table.line.len() as u64, end.message_count - lost as u64, "{name}");
        assert!(notes.contains(&format!("1 of {chunks} chunks are damaged (the first: chunk 2")), "{notes}");
        assert!(notes.contains(&format!("{lost} messages are lost")), "{notes}");
        for column in &table.columns {
            let whole = all.column(&column.name).unwrap();
            let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same(&column.values[..first], &whole[..first]), "{name}: {}", column.name);
            assert!(same(&column.values[first..], &whole[first + lost..]), "{name}: {}", column.name);
        }
    }
    // Its checksum alone is wrong.
    let mut wrong = whole.clone();
    wrong[at - 8 - 4 - 4 - 4] ^= 1;
    let file = folder.join("checksum.mcap");
    std::fs::write(&file, wrong).unwrap();
    assert!(notes_of(&read_contents(&file).unwrap()).contains("CRC"));
}

/// Chunks without a topic that is read are counted by the index and stay on the disk.
#[test]
fn chunks_of_other_topics_are_not_read() {
    let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let nothing = std::collections::BTreeMap::new();
    let schema = writer.add_schema("Log", "jsonschema", b"{}").unwrap();
    let ids = ["/a", "/b", "/camera"].map(|topic| {
        let encoding = if topic == "/camera" { "jpeg" } else { "json" };
        writer.add_channel(schema, topic, encoding, &nothing).unwrap()
    });
    for k in 0..30u32 {
        for (j, channel_id) in ids.into_iter().enumerate() {
            let time = 1_000_000 * u64::from(10 * k) + j as u64;
            let header =
                mcap::records::MessageHeader { channel_id, sequence: k, log_time: time, publish_time: time };
            let text = format!("{{\"q\": [{k}e-2, 1.0], \"tau\": [0.1, {k}]}}");
            writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
    let mut bytes = writer.into_inner().into_inner();
    // Damage in the last chunk of the camera and of /b.
    for number in [89, 88] {
        let at = chunk(&bytes, number).0;
        bytes[at + 12] ^= 0xff;
    }
    let folder = folder("other_topics");
    let file = folder.join("topics.mcap");
    std::fs::write(&file, &bytes).unwrap();
    let contents = read_contents(&file).unwrap();
    let samples = contents.tables.iter().map(|t| (t.name.as_str(), t.line.len())).collect::<Vec<_>>();
    assert_eq!(samples, [("/a", 30), ("/b", 29), ("/camera", 30)]);
    assert_eq!(contents.tables[2].received[29], 1e-9 * 290_000_002.0);
    assert!(notes_of(&contents).contains("1 of 90 chunks are damaged"), "{}", notes_of(&contents));
    // Who asks for /a alone does not meet the damage of /b.
    let (log, findings) = read(&file, "topic = \"/a\"\nclock = \"receipt\"");
    assert_eq!(log.t.len(), 30);
    assert!(findings.iter().all(|f| !f.message.contains("damaged")), "{findings:?}");
    // An error names all topics.
    let map = ColumnMap::parse("topic = \"/c\"", "map").unwrap();
    let error = Log::read_as(&file, &arm(), &map).unwrap_err().to_string();
    assert!(error.contains("/camera"), "{error}");
}

/// What rosbag2 and Foxglove need to play a file: chunks, their index, statistics, checksums; joints have
/// their names.
#[test]
fn what_is_written_as_mcap_has_chunks_an_index_statistics_and_checksums() {
    let names = ["shoulder", "elbow"].map(String::from);
    let mut writer = McapWriter::new(Vec::new()).unwrap();
    let states = writer.joint_states("/joint_states").unwrap();
    let numbers = writer.numbers("/log", "Log", &["a"]).unwrap();
    let rows = 20_000u32;
    for k in 0..rows {
        let t = 0.001 * f64::from(k);
        let (position, effort) = ([t.sin(), t.cos()], [t, -t]);
        let state = JointState { position: &position, velocity: &[], effort: &effort };
        writer.state(states, t, &names, &state).unwrap();
        writer.object(numbers, t, [("a", t)]).unwrap();
    }
    let bytes = writer.finish().unwrap();

    let summary = summary(&bytes);
    let stats = summary.stats.as_ref().unwrap();
    assert_eq!(stats.message_count, 2 * u64::from(rows));
    assert!(stats.chunk_count > 1 && summary.chunk_indexes.len() == stats.chunk_count as usize);
    assert!(summary.chunk_indexes.iter().all(|index| index.compression == "zstd"));
    let schema =
        summary.channels.values().find(|c| c.topic == "/joint_states").unwrap().schema.clone().unwrap();
    assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("sensor_msgs/msg/JointState", "ros2msg"));
    let indexed: usize = summary
        .chunk_indexes
        .iter()
        .flat_map(|index| summary.read_message_indexes(&bytes, index).unwrap().into_values())
        .map(|entries| entries.len())
        .sum();
    assert_eq!(indexed as u64, stats.message_count);
    assert_eq!(checked(&bytes).unwrap(), stats.message_count);
    // A reader that checks finds a byte that is wrong.
    let mut wrong = bytes.clone();
    let at = chunk(&bytes, 0).0 + 1000;
    wrong[at] ^= 1;
    assert!(checked(&wrong).is_err());

    let file = folder("written").join("log.mcap");
    std::fs::write(&file, &bytes).unwrap();
    let (log, _) = read(&file, JOINTS);
    assert_eq!((log.t.len(), log.q[0][1000], log.torque[1][1000]), (20_000, 1f64.sin(), -1.0));
}

/// The number of messages in a file, all of whose checksums are there and right.
fn checked(bytes: &[u8]) -> Result<u64, mcap::McapError> {
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let (mut reader, mut rest, mut messages) = (LinearReader::new_with_options(options), bytes, 0);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(n) => {
                let (some, after) = rest.split_at(n.min(rest.len()));
                reader.insert(some.len()).copy_from_slice(some);
                reader.notify_read(some.len());
                rest = after;
            }
            LinearReadEvent::Record { opcode: mcap::records::op::MESSAGE, .. } => messages += 1,
            LinearReadEvent::Record { opcode: mcap::records::op::DATA_END, data } => {
                assert_ne!(data[..4], [0; 4], "the data has no checksum");
            }
            LinearReadEvent::Record { opcode: mcap::records::op::FOOTER, data } => {
                assert_ne!(data[16..20], [0; 4], "the summary has no checksum");
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(messages)
}

/// A log of an arm whose joints have names is an MCAP with those names, and read without a map.
#[test]
fn the_joints_of_an_arm_keep_their_names_in_mcap() {
    let (log, _) = read(&data("joint_state.mcap"), JOINTS);
    let file = folder("names").join("log.mcap");
    log.write_for(&file, &["shoulder".into(), "elbow".into()]).unwrap();
    let table = read_contents(&file).unwrap().tables.remove(0);
    assert_eq!(table.names()[..2], ["position.shoulder", "position.elbow"]);
    let (back, _) = read(&file, JOINTS);
    assert_eq!((back.q, back.torque), (log.q, log.torque));
}

// rosbag2's SQLite.

/// What a crash left next to a bag is brought in, or taken back, on a copy: the bag's folder stays as it was.
#[test]
fn a_bag_that_a_crash_left_is_read_and_its_folder_stays_as_it_is() {
    let (csv, _) = read(&data("log.csv"), "");
    for (name, ending, samples) in [("waiting.db3", "-wal", 120), ("half_written.db3", "-journal", 60)] {
        let folder = folder(name);
        for file in [name.to_string(), format!("{name}{ending}")] {
            std::fs::copy(data(&file), folder.join(&file)).unwrap();
        }
        let before = listing(&folder);
        let (log, findings) = read(&folder.join(name), JOINTS);
        assert_eq!(listing(&folder), before, "{name}");
        assert_eq!((log.t.len(), findings.len()), (samples, 0), "{name}: {findings:?}");
        for (own, wanted) in log.q.iter().zip(&csv.q).chain(log.torque.iter().zip(&csv.torque)) {
            assert_eq!(own[..], wanted[..samples], "{name}");
        }
    }
    // A bag that was closed is read where nobody may write, and without a file next to it.
    let folder = folder("closed");
    let file = folder.join("bag #1?.db3");
    std::fs::copy(data("bag.db3"), &file).unwrap();
    let before = listing(&folder);
    assert_eq!(read(&file, JOINTS).0.t.len(), 120);
    assert_eq!(listing(&folder), before);
}

/// The files of a folder with what is in them.
fn listing(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    let mut files: Vec<_> = entries.map(|path| (name(&path), std::fs::read(&path).unwrap())).collect();
    files.sort();
    files
}

#[test]
fn an_sqlite_file_that_is_torn_or_no_bag_says_so() {
    let folder = folder("torn_sqlite");
    let whole = std::fs::read(data("bag.db3")).unwrap();
    let file = folder.join("bag.db3");
    let error = |bytes: &[u8]| {
        std::fs::write(&file, bytes).unwrap();
        read_contents(&file).unwrap_err().to_string()
    };
    assert!(error(&whole[..600]).contains("torn"), "{}", error(&whole[..600]));
    // What stands before the damage is read.
    std::fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    let contents = read_contents(&file).unwrap();
    let (samples, notes) = (contents.tables[0].line.len(), notes_of(&contents));
    assert!(samples > 30 && samples < 132 && notes.contains("damaged after message"), "{samples}: {notes}");
    // Another program's database.
    let mut other = whole.clone();
    for at in 0..other.len() - 8 {
        if &other[at..at + 8] == b"messages" {
            other[at..at + 8].copy_from_slice(b"massages");
        }
    }
    assert!(error(&other).contains("without the table messages is not a rosbag2"), "{}", error(&other));
}

// Messages by the definition that stands in their file.

/// Types that nobody knows beforehand: in CDR by mcap-ros2-support, in both forms of XCDR2 by Cyclone DDS.
#[test]
fn messages_of_any_type_are_read_by_the_definition_in_their_file() {
    let (csv, _) = read(&data("log.csv"), "");
    for (name, topic) in
        [("defined.mcap", "/arm"), ("xcdr2.mcap", "/final"), ("xcdr2.mcap", "/grown"), ("iron.db3", "/grown")]
    {
        let (log, findings) = read(&data(name), &format!("{JOINTS}topic = \"{topic}\""));
        assert_eq!((log.t.len(), &log.q, &log.torque), (csv.t.len(), &csv.q, &csv.torque), "{name} {topic}");
        // Where there is no header, the time of receipt counts.
        let late = if topic == "/grown" { 0.0021 } else { 1e-6 };
        for (k, t) in log.t.iter().enumerate() {
            assert!((t - log.t[0] - csv.t[k]).abs() < late, "{name} {topic}");
        }
        assert!(findings.iter().all(|f| !f.message.contains("could not be read")), "{findings:?}");
    }
    let arm = read_contents(&data("defined.mcap")).unwrap().tables.remove(0);
    assert_eq!((arm.kind.as_str(), &arm.unreadable), ("arm_msgs/msg/ArmState", &None));
    let at = |name: &str| {
        arm.columns.iter().find(|c| c.name == name).unwrap_or_else(|| panic!("{name}")).values[77]
    };
    let named = ["mode", "extra.on", "extra.count", "extra.force1", "extra.force3", "extra.big", "extra.age"];
    assert_eq!(named.map(at), [1.0, 0.0, -77.0, 1.5, 77.0, (2f64).powi(40) + 77.0, 1.5]);
    assert_eq!((at("temperature.shoulder"), at("temperature.elbow")), (31.0, 30.0));
    // Lists of messages are no signals.
    assert!(arm.columns.iter().all(|c| !c.name.starts_with("cloud")), "{:?}", arm.names());
}

/// Messages of Protocol Buffers by mcap-protobuf-support, and objects of JSON: lists with their names, and
/// joints each with its name.
#[test]
fn messages_of_protobuf_and_json_are_read_whatever_names_their_joints() {
    let (csv, _) = read(&data("log.csv"), "");
    for (name, topic) in [
        ("protobuf.mcap", "/state"),
        ("protobuf.mcap", "/joints"),
        ("json_forms.mcap", "/joints"),
        ("json_forms.mcap", "/named"),
    ] {
        let (log, findings) = read(&data(name), &format!("{JOINTS}topic = \"{topic}\""));
        assert_eq!((&log.q, &log.torque), (&csv.q, &csv.torque), "{name} {topic}");
        // By the messages' own time.
        let late = |k: usize| (log.t[k] - 1_700_000_000.0 - csv.t[k]).abs();
        assert!((0..120).all(|k| late(k) < 5e-7), "{name} {topic}");
        assert!(findings.iter().all(|f| !f.message.contains("could not be read")), "{findings:?}");
    }
    let tables = read_contents(&data("protobuf.mcap")).unwrap().tables;
    let (state, joints) = (&tables[0], &tables[1]);
    assert_eq!((state.kind.as_str(), joints.kind.as_str()), ("arm.State", "arm.Joints"));
    let at = |name: &str| state.column(name).unwrap_or_else(|| panic!("{name}: {:?}", state.names()))[77];
    // Numbers that are zero are not in the message, and zero all the same.
    let named = ["mode", "on", "count", "force1", "force3", "tip.x", "tip.y", "sent"].map(at);
    assert_eq!(named, [1.0, 0.0, -77.0, 1.5, 77.0, 77.0, 0.5, 3.5]);
    assert_eq!(state.column("mode").unwrap()[76], 0.0);
    assert!(state.columns.iter().all(|c| !c.name.starts_with("cloud")), "{:?}", state.names());
    // What may be absent, and is, is no number.
    assert_eq!(joints.names(), ["position.shoulder", "effort.shoulder", "position.elbow", "effort.elbow"]);
}

// CSV.

/// Whole seconds have no fraction as Python prints them.
#[test]
fn dates_are_times_in_csv() {
    let (csv, _) = read(&data("log.csv"), "");
    for map in ["", "t.column = \"iso\"", "t.column = \"numpy\""] {
        let (log, _) = read(&data("dates.csv"), map);
        assert_eq!((log.t[0], &log.q, &log.torque), (1_700_000_000.0, &csv.q, &csv.torque), "{map}");
        // Seconds since 1970 have steps of 0.24 µs.
        assert!(log.t.iter().zip(&csv.t).all(|(a, b)| (a - log.t[0] - b).abs() < 3e-7), "{map}");
    }
}

// Parquet.

/// A column's name, and its value in row k.
type Made = (&'static str, fn(f64) -> f64);

/// Every type that holds numbers, in row groups of 25 rows, by pyarrow.
#[test]
fn every_type_of_parquet_that_holds_numbers_is_numbers() {
    let table = read_contents(&data("types.parquet")).unwrap().tables.remove(0);
    let start = 1_700_000_000.0;
    let wanted: [Made; 23] = [
        ("t", |k| 0.005 * k),
        ("t_us", |k| 0.005 * k),
        ("t_ms", |k| 0.005 * k),
        ("day", |_| -80_000.0),
        ("clock", |_| 0.0),
        ("half", |k| k / 8.0),
        ("single", |k| k),
        ("cents", |k| k / 100.0),
        ("long_cents", |k| k / 100.0),
        ("short_cents", |k| k / 100.0),
        ("on", |k| f64::from(k % 2.0 == 0.0)),
        ("byte", |k| k - 30.0),
        ("word", |k| 2f64.powi(63) + k),
        ("some", |k| k),
        ("list1", |k| k),
        ("list2", |k| k + 0.5),
        ("large1", |k| k),
        ("large2", |k| k + 0.5),
        ("fixed1", |k| k),
        ("fixed2", |k| k + 0.5),
        ("struct.a", |k| k),
        ("struct.b", |k| -k),
        ("word_of", |_| f64::NAN),
    ];
    assert_eq!((table.line.len(), table.columns.len()), (60, wanted.len()));
    for (name, value) in wanted {
        let values = table.column(name).unwrap_or_else(|| panic!("{name} is not among {:?}", table.names()));
        let missing = |k: usize| k == 7 && ["single", "some", "list1", "list2"].contains(&name);
        for (k, own) in values.iter().enumerate() {
            let of = if ["t", "t_us", "t_ms", "day"].contains(&name) { start } else { 0.0 };
            let wanted = if missing(k) { f64::NAN } else { of + value(k as f64) };
            // Seconds since 1970 have steps of 0.24 µs.
            let within = if of > 0.0 { 3e-7 } else { 0.0 };
            let same = (own.is_nan() && wanted.is_nan()) || (own - wanted).abs() <= within;
            assert!(same, "{name} {k}: {own} for {wanted}");
        }
    }
}

// LeRobot.

/// For an arm on position servos the actions of a dataset are set-points, in the unit of its positions.
#[test]
fn actions_of_lerobot_are_set_points_of_servos() {
    let (csv, _) = read(&data("log.csv"), "");
    let map = ColumnMap::parse(&format!("{JOINTS}q.unit = \"deg\""), "map").unwrap();
    for name in ["lerobot_v21", "lerobot_v30"] {
        let (log, _) = ServoLog::read(&data(name), &arm(), &map).unwrap();
        assert_eq!(log.pieces, [0..40, 40..90, 90..120], "{name}");
        assert_eq!((log.goal.len(), log.goal[1].len()), (2, 120), "{name}");
        let off = |(a, b): (&f64, &f64)| (a - b).abs();
        for own in [&log.q, &log.goal] {
            let worst = own.iter().flatten().zip(csv.q.iter().flatten()).map(off).fold(0.0, f64::max);
            assert!(worst < 1e-7, "{name}: {worst}");
        }
    }
}

/// A dataset's folder, or its description, of both layouts: episodes are pieces, joints go by name, and what
/// LeRobot does not say is asked for.
#[test]
fn datasets_of_lerobot_are_read_as_they_are() {
    let (csv, _) = read(&data("log.csv"), "");
    let degrees = format!("{JOINTS}q.unit = \"deg\"");
    for name in ["lerobot_v21", "lerobot_v21/meta/info.json", "lerobot_v30"] {
        let (log, findings) = read(&data(name), &degrees);
        assert_eq!(log.pieces, [0..40, 40..90, 90..120], "{name}");
        assert_eq!(log.torque, csv.torque, "{name}");
        let off = |(a, b): (&f64, &f64)| (a - b).abs();
        let worst = log.q.iter().flatten().zip(csv.q.iter().flatten()).map(off).fold(0.0, f64::max);
        assert!(worst < 1e-7, "{name}: {worst}");
        for piece in &log.pieces {
            let own = |k: usize| log.t[k] - log.t[piece.start] - 0.01 * (k - piece.start) as f64;
            assert!(piece.clone().all(|k| own(k).abs() < 1e-6), "{name}");
        }
        let notes = findings.iter().map(|f| format!("{f}\n")).collect::<String>();
        assert!(notes.contains("3 episodes") && notes.contains("even frames at 100 Hz"), "{notes}");
    }
    let asked = |path: &Path, map: &str| {
        let map = ColumnMap::parse(map, "map").unwrap();
        Log::read_as(path, &arm(), &map).unwrap_err().to_string()
    };
    let error = asked(&data("lerobot_v30"), JOINTS);
    assert!(error.contains("in which unit observation.state is"), "{error}");
    // Without torques.
    let error = asked(&data("lerobot_v30"), &format!("{degrees}\ntau.column = \"observation.load\""));
    assert!(
        error.contains("missing: observation.load") && error.contains("`action` is a set-point"),
        "{error}"
    );

    // Not all of it is there.
    let folder = folder("lerobot");
    std::fs::create_dir_all(folder.join("meta")).unwrap();
    std::fs::copy(data("lerobot_v30/meta/info.json"), folder.join("meta/info.json")).unwrap();
    std::fs::create_dir_all(folder.join("data/chunk-000")).unwrap();
    assert!(asked(&folder, &degrees).contains("has no Parquet file"), "{}", asked(&folder, &degrees));
    let file = folder.join("data/chunk-000/file-000.parquet");
    std::fs::write(&file, "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n").unwrap();
    assert!(asked(&folder, &degrees).contains("git lfs pull"), "{}", asked(&folder, &degrees));
    std::fs::copy(data("lerobot_v30/data/chunk-000/file-000.parquet"), &file).unwrap();
    let notes = notes_of(&read_contents(&folder).unwrap());
    assert!(notes.contains("lists 3 episodes, but 2 are there"), "{notes}");
    // A file of another dataset among them.
    std::fs::copy(data("types.parquet"), folder.join("data/chunk-000/file-001.parquet")).unwrap();
    assert!(asked(&folder, &degrees).contains("other columns"), "{}", asked(&folder, &degrees));
}

/// Goals and positions of two joints, simulated by MuJoCo (logs_data/so101/make.py): its constants come out,
/// and nothing is named.
#[test]
fn a_dataset_of_lerobot_gives_the_servos_of_its_arm() {
    let (out, of) = (folder("so101"), |name: &str| data("so101").join(name).display().to_string());
    let (arm, fit, validate) = (of("arm.toml"), of("fit"), of("validate"));
    let run = |command: &str| {
        let arguments = [command, "--arm", &arm, "--log", &fit, "--validate", &validate];
        let mut call = Command::new(env!("CARGO_BIN_EXE_powerball"));
        call.args(arguments).args(["--map", "q.unit = \"deg\"", "--json", "--out"]).arg(&out);
        let output = call.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let found = run("identify");
    let truth = [("torque", 3.0), ("armature", 0.028), ("viscous", 0.6), ("delay", 0.03)];
    for joint in found["servo"].as_array().unwrap() {
        let of = |name: &str| {
            let all = joint["parameters"].as_array().unwrap();
            all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{joint}"))["value"]
                .as_f64()
                .unwrap()
        };
        for (name, value) in truth {
            assert!((of(name) / value - 1.0).abs() < 0.06, "{name}: {} {value}", of(name));
        }
        assert!((of("torque") * of("gain") / 17.8 - 1.0).abs() < 0.03, "{joint}");
    }
    let error = |of: &Value, j: usize| of["position_error"][j].as_f64().unwrap();
    assert!((0..2).all(|j| error(&found["validate"], j) < 0.005), "{}", found["validate"]);
    let explained = run("explain");
    assert_eq!(explained["effects"], serde_json::json!([]), "{explained}");
}

// NumPy.

#[test]
fn arrays_of_every_type_and_a_single_one_are_read() {
    let (csv, _) = read(&data("log.csv"), "");
    // An archive as those beyond 4 GB are, with times as dates.
    let (log, findings) = read(&data("types.npz"), JOINTS);
    assert_eq!((&log.q, &log.torque), (&csv.q, &csv.torque), "{findings:?}");
    assert!(log.t.iter().zip(&csv.t).all(|(a, b)| (a - log.t[0] - b).abs() < 5e-7));
    let table = read_contents(&data("types.npz")).unwrap().tables.remove(0);
    let at = |name: &str, k: usize| table.column(name).unwrap_or_else(|| panic!("{name}"))[k];
    let named = ["half", "single", "on", "byte", "word"].map(|name| at(name, 3));
    assert_eq!(named, [0.375, 0.375, 0.0, -57.0, 3.0 + 2f64.powi(40)]);
    assert!(at("late", 5).is_nan() && (at("late", 6) - 1_700_000_000.06).abs() < 5e-7);
    assert_eq!(at("since", 7), 0.07);
    // Records: a column a field.
    let (log, _) = read(&data("records.npy"), "");
    assert_eq!((&log.t, &log.torque), (&csv.t, &csv.torque));
    assert!(log.q.iter().flatten().zip(csv.q.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-7));
    // One array has the name of its file.
    let table = read_contents(&data("alone.npy")).unwrap().tables.remove(0);
    assert_eq!(
        (table.names(), table.column("alone2").unwrap()),
        (vec!["alone1".into(), "alone2".into()], &csv.q[1][..])
    );
}

#[test]
fn an_archive_whose_checksum_is_wrong_is_refused() {
    let mut bytes = std::fs::read(data("stored.npz")).unwrap();
    let file = folder("checksum").join("stored.npz");
    // In the middle of an array: nothing but the checksum can tell.
    let at = bytes.len() / 2;
    bytes[at] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    let error = read_contents(&file).unwrap_err().to_string();
    assert!(error.contains("npz: cannot be read: the archive is torn"), "{error}");
}

// Recordings in folders and compressed as a whole; ROS 1.

#[test]
fn folders_of_bags_are_read_as_they_are() {
    let (csv, _) = read(&data("log.csv"), "");
    let same = |path: &Path| {
        let (log, findings) = read(path, &format!("{JOINTS}topic = \"/joint_states\""));
        assert_eq!((&log.q, &log.torque), (&csv.q, &csv.torque), "{}: {findings:?}", path.display());
        findings.iter().map(|f| format!("{f}\n")).collect::<String>()
    };
    // Compressed as a whole, message by message, and split; split_2 is before split_10.
    for name in ["packed_file", "packed_messages", "split", "packed_file/packed_file.db3.zstd"] {
        assert_eq!(same(&data(name)), "", "{name}");
    }
    // An interrupted recording has no metadata.yaml.
    let folder = folder("interrupted");
    for name in ["split_2.mcap.zstd", "split_10.mcap.zstd"] {
        std::fs::copy(data("split").join(name), folder.join(name)).unwrap();
    }
    let notes = same(&folder);
    assert!(notes.contains("has no metadata.yaml"), "{notes}");
    // One of its files is missing.
    std::fs::copy(data("split/metadata.yaml"), folder.join("metadata.yaml")).unwrap();
    std::fs::remove_file(folder.join("split_10.mcap.zstd")).unwrap();
    let contents = read_contents(&folder).unwrap();
    assert_eq!(contents.tables[0].line.len(), 60);
    assert!(notes_of(&contents).contains("split_10.mcap.zstd is not there"), "{}", notes_of(&contents));
    std::fs::remove_file(folder.join("split_2.mcap.zstd")).unwrap();
    let error = read_contents(&folder).unwrap_err().to_string();
    assert!(error.contains("the files of metadata.yaml are not there"), "{error}");
    std::fs::remove_file(folder.join("metadata.yaml")).unwrap();
    let error = read_contents(&folder).unwrap_err().to_string();
    assert!(error.contains("is a folder without a recording"), "{error}");
}

#[test]
fn bags_of_ros_1_are_read() {
    let (csv, _) = read(&data("log.csv"), "");
    for name in ["ros1_lz4.bag", "ros1_bz2.bag"] {
        let (log, _) = read(&data(name), &format!("{JOINTS}topic = \"/JointState\""));
        assert_eq!((&log.q, &log.torque), (&csv.q, &csv.torque), "{name}");
        // By its definition, with positions in single precision.
        let (log, _) = read(&data(name), &format!("{JOINTS}topic = \"/State\""));
        assert_eq!(log.torque, csv.torque, "{name}");
        assert!(
            log.q.iter().flatten().zip(csv.q.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-7),
            "{name}"
        );
        assert!(log.t.iter().zip(&csv.t).all(|(a, b)| (a - log.t[0] - b).abs() < 5e-7), "{name}");
    }
    // Not closed, not whole, damaged: said, and nothing stops the program.
    let whole = std::fs::read(data("ros1_bz2.bag")).unwrap();
    let file = folder("ros1").join("x.bag");
    let read = |bytes: &[u8]| {
        std::fs::write(&file, bytes).unwrap();
        read_contents(&file)
    };
    let error = read(&whole[..whole.len() / 2]).unwrap_err().to_string();
    assert!(error.contains("rosbag reindex"), "{error}");
    let mut damaged = whole.clone();
    damaged[whole.len() / 2] ^= 0x55;
    let contents = read(&damaged).unwrap();
    let samples = contents.tables[0].line.len();
    assert!(
        samples > 40 && samples < 120 && notes_of(&contents).contains("chunks are damaged"),
        "{}",
        notes_of(&contents)
    );
}

// HDF5.

#[test]
fn hdf5_and_matlabs_version_7_3_are_read() {
    let (csv, _) = read(&data("log.csv"), "");
    for name in ["v73.mat", "log.h5"] {
        let (log, findings) = read(&data(name), JOINTS);
        assert_eq!((&log.t, &log.q, &log.torque), (&csv.t, &csv.q, &csv.torque), "{name}: {findings:?}");
    }
    // Demonstrations are tables; pictures are left out.
    let contents = read_contents(&data("demonstrations.hdf5")).unwrap();
    let names: Vec<&str> = contents.tables.iter().map(|t| t.name.as_str()).collect();
    assert_eq!(names, ["/data/demo_0", "/data/demo_1", "/mask"]);
    let demo = &contents.tables[1];
    assert_eq!(
        demo.names(),
        ["actions1", "actions2", "actions3", "dones", "obs.robot0_joint_pos1", "obs.robot0_joint_pos2"]
    );
    assert_eq!(demo.column("obs.robot0_joint_pos2").unwrap()[9], csv.q[1][9] + 1.0);
    assert_eq!(demo.column("dones").unwrap().iter().sum::<f64>(), 19.0);
    assert!(notes_of(&contents).contains("obs.picture"), "{}", notes_of(&contents));
}

/// Cut off or damaged anywhere, a file is refused or read, and nothing stops the program.
#[test]
fn whatever_a_byte_is_there_is_an_answer() {
    let folder = folder("any_byte");
    for name in [
        "defined.mcap",
        "xcdr2.mcap",
        "protobuf.mcap",
        "iron.db3",
        "ros1_lz4.bag",
        "ros1_bz2.bag",
        "types.parquet",
        "types.npz",
        "records.npy",
        "log.h5",
        "v73.mat",
        "packed_file/packed_file.db3.zstd",
        "split/split_2.mcap.zstd",
    ] {
        let whole = std::fs::read(data(name)).unwrap();
        let file = folder.join(Path::new(name).file_name().unwrap());
        let step = (whole.len() / 150).max(1);
        for (n, k) in (0..whole.len()).step_by(step).enumerate() {
            let mut damaged = whole.clone();
            damaged[k] ^= [0xff, 0x01, 0x80][n % 3];
            for bytes in [&damaged[..], &whole[..k]] {
                std::fs::write(&file, bytes).unwrap();
                let _ = read_contents(&file);
            }
        }
    }
}
