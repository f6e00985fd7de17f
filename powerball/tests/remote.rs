//! Logs at an address, from a server that counts what it sends.

#![allow(clippy::unwrap_used, clippy::panic)]

use powerball::logs::log::{ColumnMap, LogError};
use powerball::{Log, logs::tables::read_contents};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Names the address for [`what_is_at_an_address`].
const ADDRESS: &str = "POWERBALL_TEST_ADDRESS";

/// Files under their paths, and what was asked for and sent.
struct Served {
    at: SocketAddr,
    counts: Arc<Counts>,
}

#[derive(Default)]
struct Counts {
    sent: AtomicU64,
    requests: AtomicU64,
}

impl Served {
    /// Serves files; those below /plain/ without ranges, as the simplest servers do.
    fn new(files: BTreeMap<String, Vec<u8>>) -> Served {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let served = Served { at: listener.local_addr().unwrap(), counts: Arc::default() };
        let counts = Arc::clone(&served.counts);
        // Until the test's process ends.
        std::thread::spawn(move || {
            let files = Arc::new(files);
            for stream in listener.incoming() {
                let (files, counts) = (Arc::clone(&files), Arc::clone(&counts));
                std::thread::spawn(move || answer(stream.unwrap(), &files, &counts));
            }
        });
        served
    }

    fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.at)
    }

    /// Bytes and requests since it was asked last.
    fn taken(&self) -> (u64, u64) {
        (self.counts.sent.swap(0, Ordering::SeqCst), self.counts.requests.swap(0, Ordering::SeqCst))
    }
}

/// One request on each connection.
fn answer(mut stream: TcpStream, files: &BTreeMap<String, Vec<u8>>, counts: &Counts) -> std::io::Result<()> {
    let lines = BufReader::new(stream.try_clone()?).lines().map_while(Result::ok);
    let asked: Vec<String> = lines.take_while(|line| !line.is_empty()).collect();
    let mut words = asked.first().map(String::as_str).unwrap_or_default().split(' ');
    let (method, url) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    if method.is_empty() {
        return Ok(());
    }
    counts.requests.fetch_add(1, Ordering::SeqCst);
    let path = url.split('?').next().unwrap_or_default();
    let Some(bytes) = files.get(path) else {
        return stream.write_all(b"HTTP/1.1 404 Not Found\r\nConnection: close\r\nContent-Length: 0\r\n\r\n");
    };
    let range = asked
        .iter()
        .filter_map(|line| line.split_once(": "))
        .find(|(name, _)| name.eq_ignore_ascii_case("range"))
        .filter(|_| !path.starts_with("/plain/"))
        .map(|(_, value)| bounds(value, bytes.len()));
    let (status, extra) = match &range {
        Some(range) => {
            let place = format!("{}-{}/{}", range.start, range.end - 1, bytes.len());
            ("206 Partial Content", format!("Content-Range: bytes {place}\r\n"))
        }
        None => ("200 OK", String::new()),
    };
    let body = &bytes[range.unwrap_or(0..bytes.len())];
    counts.sent.fetch_add(body.len() as u64, Ordering::SeqCst);
    write!(
        stream,
        "HTTP/1.1 {status}\r\nConnection: close\r\nContent-Length: {}\r\n\
            Last-Modified: Wed, 01 May 2024 12:00:00 GMT\r\nETag: \"a\"\r\n{extra}\r\n",
        body.len()
    )?;
    if method == "HEAD" { Ok(()) } else { stream.write_all(body) }
}

/// `bytes=0-99` of a file of some length.
fn bounds(range: &str, length: usize) -> std::ops::Range<usize> {
    let (from, to) = range.trim_start_matches("bytes=").split_once('-').unwrap();
    from.parse().unwrap()..(to.parse::<usize>().unwrap() + 1).min(length)
}

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/logs_data").join(name)
}

fn arm() -> dyngen::Arm {
    let joint = "[[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\n";
    let text = format!("name = \"two\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n{joint}{joint}");
    dyngen::Arm::parse(&text, "two.toml").unwrap()
}

fn read(path: &str, map: &str) -> Result<Log, LogError> {
    Log::read_as(path, &arm(), &ColumnMap::parse(map, "map").unwrap()).map(|(log, _)| log)
}

/// Chunks of an arm, of a camera and of another topic with numbers; how many bytes the arm's have, with their
/// indexes.
fn recording() -> (Vec<u8>, u64) {
    let options = mcap::WriteOptions::new().compression(None).chunk_size(None);
    let mut writer = options.create(std::io::Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema("Log", "jsonschema", b"{}").unwrap();
    let nothing = BTreeMap::new();
    let [arm, camera, other] = [("/arm", "json"), ("/camera", "jpeg"), ("/other", "json")]
        .map(|(topic, encoding)| writer.add_channel(schema, topic, encoding, &nothing).unwrap());
    for k in 0..40u32 {
        for (channel_id, size) in [(arm, 0), (camera, 100_000), (other, 20_000)] {
            let time = 1_000_000 * u64::from(10 * k);
            let header =
                mcap::records::MessageHeader { channel_id, sequence: k, log_time: time, publish_time: time };
            let text =
                format!("{{\"q\": [{k}e-2, 1.0], \"tau\": [0.1, {k}], \"more\": \"{}\"}}", "x".repeat(size));
            writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let own = summary.chunk_indexes.iter().filter(|index| index.message_index_offsets.contains_key(&arm));
    let size = own.map(|index| index.chunk_length + index.message_index_length).sum();
    (bytes, size)
}

#[test]
fn of_an_mcap_with_an_index_only_what_is_needed_is_fetched() {
    let (bytes, own) = recording();
    let length = bytes.len() as u64;
    let folder = tempfile("remote");
    let file = folder.join("run.mcap");
    std::fs::write(&file, &bytes).unwrap();
    let here = read(file.to_str().unwrap(), "topic = \"/arm\"\nclock = \"receipt\"").unwrap();
    let served =
        Served::new([("/a run.mcap".to_string(), bytes.clone()), ("/a%20run.mcap".into(), bytes)].into());
    let there = read(&served.url("/a%20run.mcap?token=1"), "topic = \"/arm\"\nclock = \"receipt\"").unwrap();
    assert_eq!((there.t.len(), &there.q, &there.torque), (40, &here.q, &here.torque));
    let (sent, requests) = served.taken();
    // What the file begins with, its end, its summary, and each of the arm's chunks.
    let around = 4096 + 37 + (length - summary_start(&file));
    assert!(
        sent <= own + around,
        "{sent} bytes were sent for {own} of the arm and {around} around them, of {length}"
    );
    assert!(own + around < length / 50 && requests <= 4 + 40, "{own} {around} {length} {requests}");
    // All topics with numbers: the camera's stay there.
    let contents = read_contents(Path::new(&served.url("/a%20run.mcap"))).unwrap();
    assert_eq!(contents.tables.iter().map(|t| t.line.len()).collect::<Vec<_>>(), [40, 40, 40]);
    assert!(served.taken().0 < length / 4);
}

fn summary_start(file: &Path) -> u64 {
    let bytes = std::fs::read(file).unwrap();
    let footer = mcap::read::footer(&bytes).unwrap();
    footer.summary_start
}

fn tempfile(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn other_formats_are_copied_and_every_failure_says_what_it_is() {
    let files =
        ["log.csv", "types.parquet", "alone.npy", "bag.db3", "split/split_2.mcap.zstd", "joint_state.mcap"];
    let all = |below: &'static str| {
        files.map(|name| (format!("{below}{name}"), std::fs::read(data(name)).unwrap()))
    };
    let served = Served::new(all("/").into_iter().chain(all("/plain/")).collect());
    for name in files {
        let here = read_contents(&data(name)).unwrap();
        for below in ["/", "/plain/"] {
            let there = read_contents(Path::new(&served.url(&format!("{below}{name}")))).unwrap();
            assert_eq!(there.format, here.format, "{below}{name}");
            for (a, b) in there.tables.iter().zip(&here.tables) {
                assert_eq!((a.names(), a.line.len()), (b.names(), b.line.len()), "{below}{name}");
            }
        }
    }
    let error = |address: &str| read(address, "").unwrap_err().to_string();
    let missing = error(&served.url("/missing.mcap"));
    assert!(missing.contains("there is no such file") && missing.contains("missing.mcap"), "{missing}");
    let nobody = error("http://127.0.0.1:9/log.csv");
    assert!(nobody.contains("cannot be reached"), "{nobody}");
    assert!(error("s3://").contains("address"), "{}", error("s3://"));
}

/// The next test runs this one in processes of its own, whose environment says where S3 is.
#[test]
#[ignore = "needs an address in the environment"]
fn what_is_at_an_address() {
    let address = std::env::var(ADDRESS).expect("an address");
    match read_contents(Path::new(&address)) {
        Ok(contents) => println!("{} samples", contents.tables[0].line.len()),
        Err(e) => panic!("{e}"),
    }
}

#[test]
fn buckets_are_read_and_a_lack_of_credentials_is_said() {
    let csv = std::fs::read(data("log.csv")).unwrap();
    let served = Served::new([("/logs/day/log.csv".to_string(), csv)].into());
    let run = |address: &str, signed: bool| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--ignored", "--exact", "--nocapture", "what_is_at_an_address"]).env(ADDRESS, address);
        command.env("AWS_ENDPOINT", served.url("")).env("AWS_ALLOW_HTTP", "true");
        command
            .env_remove("AWS_ACCESS_KEY_ID")
            .env_remove("AWS_SECRET_ACCESS_KEY")
            .env("AWS_METADATA_ENDPOINT", served.url(""));
        if signed {
            command.env("AWS_ACCESS_KEY_ID", "a").env("AWS_SECRET_ACCESS_KEY", "b");
        }
        let done = command.output().unwrap();
        let text = String::from_utf8_lossy(&[done.stdout, done.stderr].concat()).into_owned();
        (done.status.success(), text)
    };
    let (read, text) = run("s3://logs/day/log.csv", true);
    assert!(read && text.contains("120 samples"), "{text}");
    let (read, text) = run("s3://logs/day/none.csv", true);
    assert!(!read && text.contains("there is no such file"), "{text}");
    let (read, text) = run("s3://logs/day/log.csv", false);
    assert!(!read && text.contains("there are no credentials: set AWS_ACCESS_KEY_ID"), "{text}");
}
