//! MCAP files, the default storage of rosbag2 (<https://mcap.dev/spec>): records one after the other, some of
//! them in compressed chunks. The index at the end is not needed, so that a recording whose program died can
//! be read.
//!
//! The crate `mcap` would bring fifteen others, among them C libraries for the compression.

use super::messages::Topics;
use super::table::Table;
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufReader, Read};

/// What a file begins and ends with.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// A chunk that claims to be larger than this, bytes, is torn.
const LARGEST_CHUNK: u64 = 1 << 30;

// Records by their number.
pub(super) const FOOTER: u8 = 0x02;
pub(super) const SCHEMA: u8 = 0x03;
pub(super) const CHANNEL: u8 = 0x04;
pub(super) const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
pub(super) const DATA_END: u8 = 0x0f;

/// The topics of a file, each a table, and where it is torn what that means.
pub(super) fn read(file: File) -> io::Result<(Vec<Table>, Option<String>)> {
    let mut left = file.metadata()?.len().saturating_sub(MAGIC.len() as u64);
    let mut reader = BufReader::with_capacity(1 << 16, file);
    reader.read_exact(&mut [0; 8])?;
    let mut records = Records::default();
    let mut body = Vec::new();
    loop {
        let mut head = [0; 9];
        if left < 9 {
            break;
        }
        reader.read_exact(&mut head)?;
        let size = u64::from_le_bytes(head[1..].try_into().unwrap_or_default());
        if matches!(head[0], DATA_END | FOOTER) {
            return Ok((records.topics.tables(), None));
        }
        left -= 9;
        if size > left {
            break;
        }
        left -= size;
        match head[0] {
            SCHEMA | CHANNEL | MESSAGE | CHUNK => {
                body.clear();
                (&mut reader).take(size).read_to_end(&mut body)?;
                records.record(head[0], &body)?;
            }
            // Attachments may be large.
            _ => {
                io::copy(&mut (&mut reader).take(size), &mut io::sink())?;
            }
        }
    }
    let torn =
        "the file ends before its end is marked: the recording was interrupted; it was read up to there";
    Ok((records.topics.tables(), Some(torn.into())))
}

#[derive(Default)]
struct Records {
    topics: Topics,
    /// Names of types by their number.
    schemas: HashMap<u16, String>,
}

impl Records {
    fn record(&mut self, number: u8, body: &[u8]) -> io::Result<()> {
        let mut fields = Fields(body);
        match number {
            SCHEMA => {
                let id = fields.u16()?;
                self.schemas.insert(id, fields.text()?);
            }
            CHANNEL => {
                let (id, schema) = (fields.u16()?, fields.u16()?);
                let (topic, encoding) = (fields.text()?, fields.text()?);
                let kind = self.schemas.get(&schema).map_or("", String::as_str);
                self.topics.add(i64::from(id), &topic, kind, &encoding);
            }
            MESSAGE => {
                let (channel, _, received, _) = (fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?);
                self.topics.take(i64::from(channel), received as i64, fields.0);
            }
            CHUNK => {
                let (_, _, size, _) = (fields.u64()?, fields.u64()?, fields.u64()?, fields.u32()?);
                let compression = fields.text()?;
                let stored = fields.u64()?;
                let stored = fields.take(usize::try_from(stored).map_err(|_| torn())?)?;
                let records = decompress(&compression, stored, size)?;
                let mut rest = Fields(&records);
                while !rest.0.is_empty() {
                    let number = rest.take(1)?[0];
                    let size = usize::try_from(rest.u64()?).map_err(|_| torn())?;
                    let body = rest.take(size)?;
                    if number != CHUNK {
                        self.record(number, body)?;
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }
}

fn decompress(compression: &str, stored: &[u8], size: u64) -> io::Result<Vec<u8>> {
    if size > LARGEST_CHUNK {
        return Err(torn());
    }
    let mut out = Vec::new();
    // The chunk's word for its size is a bound, so that a torn file cannot ask for all memory.
    match compression {
        "" => return Ok(stored.to_vec()),
        "zstd" => {
            let decoder = ruzstd::decoding::StreamingDecoder::new(stored);
            decoder.map_err(io::Error::other)?.take(size + 1).read_to_end(&mut out)?;
        }
        "lz4" => {
            lz4_flex::frame::FrameDecoder::new(stored).take(size + 1).read_to_end(&mut out)?;
        }
        other => {
            return Err(io::Error::other(format!(
                "a chunk is compressed by {other}, which nobody knows here"
            )));
        }
    }
    if out.len() as u64 == size { Ok(out) } else { Err(torn()) }
}

fn torn() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "a record of the MCAP file is torn")
}

/// The fields of a record, from the front.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, size: usize) -> io::Result<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(size).ok_or_else(torn)?;
        self.0 = rest;
        Ok(taken)
    }

    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        self.take(N)?.try_into().map_err(|_| torn())
    }

    fn u16(&mut self) -> io::Result<u16> {
        self.bytes().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> io::Result<u32> {
        self.bytes().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> io::Result<u64> {
        self.bytes().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> io::Result<String> {
        let size = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(size)?).into_owned())
    }
}
