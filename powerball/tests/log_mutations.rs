//! Mutated files of every format: read or refused, without a panic, soon, and within the memory that such a
//! file may take.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use powerball::logs::tables::read_contents;
use rand::{Rng, RngExt, SeedableRng};
use std::path::Path;
use std::time::{Duration, Instant};

/// Mutated files of each.
const COUNT: u64 = 120;
/// What one of them may take; each has less than 60 kB.
const LONGEST: Duration = Duration::from_secs(2);
/// MB above what the program held before: windows of decompression, SQLite's pages.
const MOST_MB: u64 = 16;

const FILES: [&str; 19] = [
    "log.csv",
    "dates.csv",
    "types.parquet",
    "lerobot_v30/data/chunk-000/file-000.parquet",
    "joint_state.mcap",
    "xcdr2.mcap",
    "protobuf.mcap",
    "json_forms.mcap",
    "bag.db3",
    "ros1_lz4.bag",
    "ros1_bz2.bag",
    "types.npz",
    "records.npy",
    "stored.mat",
    "packed.mat",
    "v73.mat",
    "demonstrations.hdf5",
    "packed_file/packed_file.db3.zstd",
    "split/split_2.mcap.zstd",
];

/// One to four changes: bits, numbers at their limits, bytes put in, taken out, moved, and an end too early.
fn mutated(whole: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..random.random_range(1..5) {
        let at = random.random_range(0..bytes.len());
        let span = at..(at + random.random_range(1..40)).min(bytes.len());
        match random.random_range(0..7) {
            0 => bytes[at] ^= 1 << random.random_range(0..8),
            1 => bytes[span].fill(0xff),
            2 => bytes[span].fill(0),
            3 => {
                let large = [u64::MAX, 1 << 31, 1 << 40, (1 << 32) - 1, 1 << 20][random.random_range(0..5)];
                let size = (bytes.len() - at).min(8);
                bytes[at..at + size].copy_from_slice(&large.to_le_bytes()[..size]);
            }
            4 => drop(bytes.drain(span)),
            5 => {
                let copy = bytes[span].to_vec();
                let to = random.random_range(0..=bytes.len());
                bytes.splice(to..to, copy);
            }
            _ => bytes.truncate(at + 1),
        }
        if bytes.is_empty() {
            bytes.push(random.next_u32() as u8);
        }
    }
    bytes
}

/// The most memory that the program has held, MB; none where the system does not tell.
fn most_held() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches(" kB").parse::<u64>().ok()? / 1024)
}

#[test]
fn mutated_files_are_read_or_refused_soon_and_with_little_memory() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/logs_data");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("log_mutations");
    std::fs::create_dir_all(&folder).unwrap();
    for (k, name) in FILES.iter().enumerate() {
        let whole = std::fs::read(data.join(name)).unwrap();
        let file = folder.join(Path::new(name).file_name().unwrap());
        let before = most_held();
        let mut refused = 0;
        for seed in 0..COUNT {
            let mut random = ChaCha8Rng::seed_from_u64(1000 * k as u64 + seed);
            std::fs::write(&file, mutated(&whole, &mut random)).unwrap();
            let start = Instant::now();
            let read = std::panic::catch_unwind(|| read_contents(&file));
            let read = read.unwrap_or_else(|_| panic!("{name}: a panic at seed {seed}"));
            assert!(start.elapsed() < LONGEST, "{name}: seed {seed} takes {:?}", start.elapsed());
            if let Err(error) = read {
                assert!(error.0.iter().all(|reason| !reason.message.is_empty()), "{name}: seed {seed}");
                refused += 1;
            }
        }
        assert!(refused < COUNT, "{name}: every one was refused");
        let held = most_held().zip(before).map_or(0, |(after, before)| after - before);
        assert!(held <= MOST_MB, "{name}: {held} MB were held for a file of {} bytes", whole.len());
    }
}
