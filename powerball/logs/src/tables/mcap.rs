//! MCAP files, the default storage of rosbag2 (<https://mcap.dev/spec>).
//!
//! A file with an index is read chunk by chunk, and chunks without a topic that is read stay where they are:
//! their messages are counted by the index, or not at all if only some topics are requested. A file without
//! an index, as a program that crashed leaves it, is read from its beginning. Either way a damaged chunk, by
//! its checksum or by what it unpacks to, loses its own messages only.

use super::messages::Topics;
use ::mcap::records::{ChunkIndex, Record, op};
use ::mcap::sans_io::{
    LinearReadEvent, LinearReader, LinearReaderOptions, SummaryReadEvent, SummaryReader, SummaryReaderOptions,
};
use ::mcap::{McapError, McapResult, Summary, parse_record};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// A chunk that claims to be larger than this, bytes, is damaged.
const LARGEST_CHUNK: usize = 1 << 30;

/// A chunk is unpacked in steps of this many bytes.
const STEP: u64 = 64 << 20;
/// No byte that LZ4 compressed becomes more than this many.
const LZ4_MOST: u64 = 256;

/// Bytes of a message that Zstandard compressed very well.
const SHORTEST: u64 = 2;
/// Bytes that are read ahead where records follow each other.
const AHEAD: u64 = 256 << 10;

/// A source of the bytes of a file.
pub(super) trait Source {
    /// How many there are.
    fn length(&mut self) -> io::Result<u64>;

    /// The bytes from a place on; fewer where the file ends.
    fn range(&mut self, from: u64, length: u64) -> io::Result<Vec<u8>>;
}

impl Source for File {
    fn length(&mut self) -> io::Result<u64> {
        self.metadata().map(|metadata| metadata.len())
    }

    fn range(&mut self, from: u64, length: u64) -> io::Result<Vec<u8>> {
        self.seek(SeekFrom::Start(from))?;
        let mut bytes = Vec::new();
        self.take(length).read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}

/// A place in a file from which it is read on.
struct Cursor<'s, S> {
    source: &'s mut S,
    at: u64,
    /// The bytes that were read ahead, and the offset at which they begin.
    window: (u64, Vec<u8>),
}

impl<'s, S: Source> Cursor<'s, S> {
    fn new(source: &'s mut S) -> Self {
        Cursor { source, at: 0, window: (0, Vec::new()) }
    }

    /// Reads what fits, or less; nothing at the end.
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let held = |(begin, bytes): &(u64, Vec<u8>), at: u64| {
            usize::try_from(at.checked_sub(*begin)?).ok().filter(|from| *from < bytes.len())
        };
        let from = match held(&self.window, self.at) {
            Some(from) => from,
            None => {
                self.window = (self.at, self.source.range(self.at, AHEAD.max(into.len() as u64))?);
                0
            }
        };
        let rest = &self.window.1[from..];
        let count = rest.len().min(into.len());
        into[..count].copy_from_slice(&rest[..count]);
        self.at += count as u64;
        Ok(count)
    }
}

/// Reads the topics of a file; returns a note about its fault.
pub(super) fn read(path: &Path, topics: &mut Topics) -> io::Result<Vec<String>> {
    read_from(&mut File::open(path)?, topics)
}

/// Like [`read`], from any source of bytes.
pub(super) fn read_from(source: &mut impl Source, topics: &mut Topics) -> io::Result<Vec<String>> {
    let mut records = Records::new(topics);
    let all = match summary(source) {
        Ok(Some(summary)) => records.by_index(source, &summary)?,
        _ => None,
    };
    let torn = match all {
        Some(true) => None,
        // A file may have messages outside of its chunks, which its index does not know.
        all => records.record_by_record(source, all.is_none())?,
    };
    Ok(records.done(torn))
}

/// The summary at the end of a file; `None` if there is none.
fn summary(source: &mut impl Source) -> McapResult<Option<Summary>> {
    let length = source.length()?;
    let mut reader = SummaryReader::new_with_options(SummaryReaderOptions::default().with_file_size(length));
    let mut file = Cursor::new(source);
    while let Some(event) = reader.next_event() {
        match event? {
            SummaryReadEvent::ReadRequest(n) => {
                let read = file.read(reader.insert(n))?;
                reader.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => {
                let to = match to {
                    SeekFrom::Start(at) => Some(at),
                    SeekFrom::End(by) => length.checked_add_signed(by),
                    SeekFrom::Current(by) => file.at.checked_add_signed(by),
                };
                file.at = to.ok_or_else(|| io::Error::other("it is shorter than an MCAP"))?;
                reader.notify_seeked(file.at);
            }
        }
    }
    Ok(reader.finish())
}

struct Records<'t> {
    topics: &'t mut Topics,
    /// Types of messages by their number: name, language and definition.
    schemas: HashMap<u16, (String, String, Vec<u8>)>,
    /// Messages that were taken or counted.
    messages: u64,
    /// Messages of topics that are read.
    taken: u64,
    /// Whether a chunk was skipped, with its index.
    passed_over: bool,
    chunks: usize,
    /// Chunks that could not be read.
    lost: Vec<Lost>,
    /// Whether index records that follow are those of a lost chunk.
    behind_lost: bool,
}

/// A chunk that could not be read: its number in the file, from 1, how many messages its index names, and
/// why.
struct Lost {
    chunk: usize,
    messages: usize,
    reason: String,
}

impl<'t> Records<'t> {
    fn new(topics: &'t mut Topics) -> Records<'t> {
        Records {
            topics,
            schemas: HashMap::new(),
            messages: 0,
            taken: 0,
            passed_over: false,
            chunks: 0,
            lost: Vec::new(),
            behind_lost: false,
        }
    }

    /// Reads by the index, if there is one; false if it does not list all messages.
    fn by_index(&mut self, file: &mut impl Source, summary: &Summary) -> io::Result<Option<bool>> {
        let Some(stats) = &summary.stats else { return Ok(None) };
        if summary.chunk_indexes.len() != stats.chunk_count as usize {
            return Ok(None);
        }
        let mut channels: Vec<_> = summary.channels.values().collect();
        channels.sort_by_key(|channel| channel.id);
        for channel in channels {
            let schema = channel.schema.as_deref();
            let kind = schema.map(|s| (s.name.as_str(), s.encoding.as_str(), s.data.as_ref()));
            self.topics.add(
                i64::from(channel.id),
                &channel.topic,
                kind.unwrap_or_default(),
                &channel.message_encoding,
            );
        }
        // No message is shorter.
        let most = file.length()? / SHORTEST;
        for (id, count) in &stats.channel_message_counts {
            self.topics.expect(i64::from(*id), usize::try_from((*count).min(most)).unwrap_or(0));
        }
        for index in &summary.chunk_indexes {
            self.indexed_chunk(file, index)?;
        }
        let expected = match self.passed_over {
            false => stats.message_count,
            true => stats
                .channel_message_counts
                .iter()
                .filter(|(id, _)| self.topics.reads(i64::from(**id)))
                .map(|(_, n)| n)
                .sum(),
        };
        let taken = if self.passed_over { self.taken } else { self.messages };
        Ok(Some(taken >= expected || !self.lost.is_empty()))
    }

    fn indexed_chunk(&mut self, file: &mut impl Source, index: &ChunkIndex) -> io::Result<()> {
        let needed = |id: &u16| self.topics.reads(i64::from(*id)) || !self.topics.knows(i64::from(*id));
        let skipped = index.message_index_length > 0 && !index.message_index_offsets.keys().any(needed);
        if skipped && self.topics.counts_no_others() {
            self.chunks += 1;
            self.passed_over = true;
            return Ok(());
        }
        let (mut from, mut length) = (index.chunk_start_offset, index.message_index_length);
        match skipped {
            true => from = from.saturating_add(index.chunk_length),
            false => length = length.saturating_add(index.chunk_length),
        }
        let bytes = file.range(from, length)?;
        let mut rest = bytes.as_slice();
        self.behind_lost = false;
        self.chunks += 1;
        if !skipped {
            let size = usize::try_from(index.chunk_length).unwrap_or(usize::MAX);
            match rest.split_at_checked(size) {
                Some((chunk, index)) => {
                    rest = index;
                    self.chunk(chunk)?;
                }
                None => self.lose("the file ends before it".into()),
            }
        }
        while let Some((number, body, after)) = record(rest) {
            rest = after;
            match parse_record(number, body) {
                Ok(Record::MessageIndex(entries)) if skipped => {
                    let received = entries.records.iter().map(|entry| entry.log_time as i64);
                    received.for_each(|t| self.topics.take(i64::from(entries.channel_id), t, &[]));
                    self.messages += entries.records.len() as u64;
                }
                Ok(known) => self.record(known),
                Err(_) => break,
            }
        }
        Ok(())
    }

    /// Reads record by record, with chunks or without; where the file ends too early, what that means.
    fn record_by_record(&mut self, source: &mut impl Source, chunks: bool) -> io::Result<Option<String>> {
        let length = usize::try_from(source.length()?).unwrap_or(usize::MAX);
        let mut file = Cursor::new(source);
        let options = LinearReaderOptions::default().with_emit_chunks(true);
        let mut reader = LinearReader::new_with_options(options.with_record_length_limit(length));
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(n)) => {
                    let read = file.read(reader.insert(n))?;
                    reader.notify_read(read);
                }
                Ok(LinearReadEvent::Record { opcode: op::DATA_END, .. }) => return Ok(None),
                Ok(LinearReadEvent::Record { opcode: op::CHUNK, .. }) if !chunks => {}
                Ok(LinearReadEvent::Record { opcode: op::CHUNK, data }) => {
                    self.chunks += 1;
                    let head = [&[op::CHUNK][..], &(data.len() as u64).to_le_bytes()].concat();
                    self.chunk(&[&head, data].concat())?;
                }
                Ok(LinearReadEvent::Record { opcode, data }) => match parse_record(opcode, data) {
                    Ok(known) => self.record(known),
                    Err(e) => return self.torn(&e),
                },
                Err(e) => return self.torn(&e),
            }
        }
        Ok(None)
    }

    /// The result for a file that cannot be read further.
    fn torn(&self, error: &McapError) -> io::Result<Option<String>> {
        Ok(Some(match error {
            McapError::UnexpectedEof | McapError::RecordTooLarge { .. } | McapError::ChunkTooLarge(_) => {
                "the file ends before its end is marked: the recording was interrupted; it was read up to \
                there"
                    .into()
            }
            _ if self.messages == 0 => return Err(io::Error::other(error.to_string())),
            other => format!("it is torn ({other}): it was read up to there"),
        }))
    }

    /// The records of a chunk, all or none of them. `bytes` is the chunk as a record.
    fn chunk(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.behind_lost = false;
        let unpacked = match self.unpacked(bytes)? {
            Ok(unpacked) => unpacked,
            Err(reason) => {
                self.lose(reason);
                return Ok(());
            }
        };
        let bytes = unpacked.as_deref().unwrap_or(bytes);
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LARGEST_CHUNK);
        let (mut reader, mut rest) = (LinearReader::new_with_options(options), bytes);
        while let Some(event) = reader.next_event() {
            let done = match event {
                Ok(LinearReadEvent::ReadRequest(n)) => {
                    let (some, after) = rest.split_at(n.min(rest.len()));
                    reader.insert(some.len()).copy_from_slice(some);
                    reader.notify_read(some.len());
                    rest = after;
                    Ok(())
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    parse_record(opcode, data).map(|known| self.record(known))
                }
                Err(e) => Err(e),
            };
            if let Err(e) = done {
                self.lose(e.to_string());
                return Ok(());
            }
        }
        Ok(())
    }

    /// Unpacks a chunk that Zstandard compressed: its real size counts, not the size that it states. `None`
    /// for any other chunk that states no more than it can hold, and the reason of the damage for one that
    /// states more. A chunk beyond the memory limit ends the file.
    fn unpacked(&self, bytes: &[u8]) -> io::Result<Result<Option<Vec<u8>>, String>> {
        let Some(chunk) = Chunk::of(bytes) else { return Ok(Ok(None)) };
        if chunk.size > LARGEST_CHUNK as u64 {
            return Ok(Err(format!("it says that it unpacks to {} bytes", chunk.size)));
        }
        let packed = chunk.records.len() as u64;
        match chunk.compression {
            b"zstd" => {
                let mut records = Vec::new();
                let mut decoder = zstd::Decoder::new(chunk.records)?.take(chunk.size.saturating_add(1));
                // In steps, so that one that is too large is refused on its way.
                while (&mut decoder).take(STEP).read_to_end(&mut records).is_ok_and(|read| read > 0) {
                    self.topics.holds(2 * records.len() as u64).map_err(io::Error::other)?;
                }
                match records.len() as u64 == chunk.size {
                    true => Ok(Ok(Some(chunk.stored(&records)))),
                    false => {
                        Ok(Err(format!("it unpacks to other than the {} bytes that it says", chunk.size)))
                    }
                }
            }
            b"lz4" if chunk.size > packed.saturating_mul(LZ4_MOST) => {
                Ok(Err(format!("it says that {packed} bytes unpack to {}", chunk.size)))
            }
            _ => {
                self.topics.holds(chunk.size).map_err(io::Error::other)?;
                Ok(Ok(None))
            }
        }
    }

    fn lose(&mut self, reason: String) {
        self.lost.push(Lost { chunk: self.chunks, messages: 0, reason });
        self.behind_lost = true;
    }

    fn record(&mut self, record: Record<'_>) {
        match record {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id);
                let kind =
                    schema.map(|(name, language, text)| (name.as_str(), language.as_str(), text.as_slice()));
                let id = i64::from(channel.id);
                self.topics.add(id, &channel.topic, kind.unwrap_or_default(), &channel.message_encoding);
            }
            Record::Message { header, data } => {
                self.messages += 1;
                self.taken += u64::from(self.topics.reads(i64::from(header.channel_id)));
                self.topics.take(i64::from(header.channel_id), header.log_time as i64, &data);
            }
            Record::MessageIndex(index) if self.behind_lost => {
                if let Some(lost) = self.lost.last_mut() {
                    lost.messages += index.records.len();
                }
            }
            Record::MessageIndex(_) => {}
            _ => self.behind_lost = false,
        }
    }

    fn done(self, torn: Option<String>) -> Vec<String> {
        let lost = self.lost.first().map(|first| {
            let messages: usize = self.lost.iter().map(|lost| lost.messages).sum();
            let how_many = if messages > 0 { format!("{messages} messages") } else { "its messages".into() };
            format!(
                "{} of {} chunks are damaged (the first: chunk {}, {}): {how_many} are lost, the others were \
                read",
                self.lost.len(),
                self.chunks,
                first.chunk,
                first.reason,
            )
        });
        lost.into_iter().chain(torn).collect()
    }
}

/// The parts of a chunk as a record.
struct Chunk<'b> {
    /// The times of its first and last message.
    times: &'b [u8],
    /// The unpacked size of its records that it states, bytes.
    size: u64,
    checksum: &'b [u8],
    compression: &'b [u8],
    records: &'b [u8],
}

impl<'b> Chunk<'b> {
    fn of(bytes: &'b [u8]) -> Option<Chunk<'b>> {
        let (_, body, _) = record(bytes)?;
        let (times, rest) = body.split_at_checked(16)?;
        let (size, rest) = rest.split_first_chunk::<8>()?;
        let (checksum, rest) = rest.split_at_checked(4)?;
        let (length, rest) = rest.split_first_chunk::<4>()?;
        let (compression, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        let (length, rest) = rest.split_first_chunk::<8>()?;
        let records = rest.get(..usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        Some(Chunk { times, size: u64::from_le_bytes(*size), checksum, compression, records })
    }

    /// As a record, its records as they are.
    fn stored(&self, records: &[u8]) -> Vec<u8> {
        let length = (records.len() as u64).to_le_bytes();
        let body = (self.times.len() + 8 + self.checksum.len() + 4 + 8 + records.len()) as u64;
        let head = [&[op::CHUNK][..], &body.to_le_bytes(), self.times, &length, self.checksum];
        [&head.concat()[..], &0u32.to_le_bytes(), &length, records].concat()
    }
}

/// The first record of some bytes: its number, its body and what follows.
fn record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (head, rest) = bytes.split_first_chunk::<9>()?;
    let (number, size) = head.split_first()?;
    let size = u64::from_le_bytes(size.try_into().ok()?);
    let (body, after) = rest.split_at_checked(usize::try_from(size).ok()?)?;
    Some((*number, body, after))
}
