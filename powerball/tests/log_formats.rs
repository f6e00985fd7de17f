//! Each format at its edges: damaged files, files that others left, and files that others must be able to read.
//!
//! Files of others were written by the formats' own libraries in Python: tests/logs_data/formats.py.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use powerball::Log;
use powerball::logs::log::{ColumnMap, Finding};
use powerball::logs::tables::{Contents, JointState, McapWriter, read_contents};
use std::path::{Path, PathBuf};

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

fn told(contents: &Contents) -> String {
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
        let (table, told) = (&contents.tables[0], told(&contents));
        assert_eq!(table.line.len() as u64, end.message_count - lost as u64, "{name}");
        assert!(told.contains(&format!("1 of {chunks} chunks are damaged (the first: chunk 2")), "{told}");
        assert!(told.contains(&format!("{lost} messages are lost")), "{told}");
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
    assert!(told(&read_contents(&file).unwrap()).contains("CRC"));
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
            let text = format!("{{\"q\": [{k}, 1.0], \"tau\": [0.1, {k}]}}");
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
    assert!(told(&contents).contains("1 of 90 chunks are damaged"), "{}", told(&contents));
    // Who asks for /a alone does not meet the damage of /b.
    let (log, findings) = read(&file, "topic = \"/a\"\nclock = \"receipt\"");
    assert_eq!(log.t.len(), 30);
    assert!(findings.iter().all(|f| !f.message.contains("damaged")), "{findings:?}");
    // An error names all topics.
    let map = ColumnMap::parse("topic = \"/c\"", "map").unwrap();
    let error = Log::read_as(&file, &arm(), &map).unwrap_err().to_string();
    assert!(error.contains("/camera"), "{error}");
}

/// What rosbag2 and Foxglove need to play a file: chunks, their index, statistics, checksums; joints have their names.
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
