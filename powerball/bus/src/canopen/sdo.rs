//! Service data objects: the commands of expedited and segmented transfers, encoded and decoded for both
//! ends.
//!
//! Block transfer is not here: this arm's dictionary has nothing that needs it.

use super::Object;
use core::fmt;

/// Up to seven bytes of a transfer.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Chunk {
    bytes: [u8; 7],
    len: u8,
}

impl Chunk {
    /// The first `max` bytes of `data`, seven at most.
    pub fn first(data: &[u8], max: usize) -> Chunk {
        let len = data.len().min(max).min(7);
        let mut bytes = [0; 7];
        bytes.iter_mut().zip(data).take(len).for_each(|(to, from)| *to = *from);
        Chunk { bytes, len: len as u8 }
    }

    /// The bytes.
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&self.bytes)
    }
}

impl fmt::Debug for Chunk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_slice().fmt(f)
    }
}

/// How a transfer begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Transfer {
    /// All of it, one to four bytes, in this frame. A frame that says no size counts as four.
    Expedited(Chunk),
    /// The value comes in segments that follow, with the total number of bytes if it is given.
    Segmented(Option<u32>),
}

/// Client (master) to server (node).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Request {
    /// Write `object`.
    Download {
        /// The object to write.
        object: Object,
        /// The object's value, or that segments follow.
        transfer: Transfer,
    },
    /// The next bytes of a segmented write.
    DownloadSegment {
        /// Alternates, false first.
        toggle: bool,
        /// The bytes.
        chunk: Chunk,
        /// Whether no more follow.
        last: bool,
    },
    /// Read `object`.
    Upload {
        /// The object to read.
        object: Object,
    },
    /// Ask for the next bytes of a segmented read.
    UploadSegment {
        /// Alternates, false first.
        toggle: bool,
    },
    /// Give the transfer up.
    Abort {
        /// Whose transfer.
        object: Object,
        /// Why.
        code: AbortCode,
    },
}

/// Server (node) to client (master).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Response {
    /// The write is done, or its segments may come.
    Download {
        /// The object that was written.
        object: Object,
    },
    /// The segment is taken.
    DownloadSegment {
        /// The toggle bit of the request.
        toggle: bool,
    },
    /// Answer to an upload: the value, or the announcement of segments.
    Upload {
        /// The object that is read.
        object: Object,
        /// The object's value, or that segments follow.
        transfer: Transfer,
    },
    /// The next bytes of a segmented read.
    UploadSegment {
        /// The toggle bit of the request.
        toggle: bool,
        /// The bytes.
        chunk: Chunk,
        /// Whether no more follow.
        last: bool,
    },
    /// Refused, or given up.
    Abort {
        /// Whose transfer.
        object: Object,
        /// Why.
        code: AbortCode,
    },
}

/// A frame that is not an SDO command known here: not eight bytes, or a command of block transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Malformed;

const TOGGLE: u8 = 0x10;

fn addressed(command: u8, object: Object, data: [u8; 4]) -> [u8; 8] {
    let [low, high] = object.index.to_le_bytes();
    let [a, b, c, d] = data;
    [command, low, high, object.sub, a, b, c, d]
}

fn segment(command: u8, chunk: Chunk, toggle: bool, last: bool) -> [u8; 8] {
    let unused = 7 - chunk.len;
    let [a, b, c, d, e, f, g] = chunk.bytes;
    [command | toggled(toggle) | unused << 1 | u8::from(last), a, b, c, d, e, f, g]
}

fn toggled(toggle: bool) -> u8 {
    if toggle { TOGGLE } else { 0 }
}

/// The two layouts that begin a transfer: expedited with size, or segmented with or without size.
fn begin(command: u8, object: Object, transfer: Transfer) -> [u8; 8] {
    match transfer {
        Transfer::Expedited(chunk) => {
            let [a, b, c, d, ..] = chunk.bytes;
            let unused = 4 - chunk.len.min(4);
            addressed(command | unused << 2 | 0x03, object, [a, b, c, d])
        }
        Transfer::Segmented(Some(size)) => addressed(command | 0x01, object, size.to_le_bytes()),
        Transfer::Segmented(None) => addressed(command, object, [0; 4]),
    }
}

fn transfer(command: u8, data: [u8; 4]) -> Transfer {
    let (expedited, sized) = (command & 0x02 != 0, command & 0x01 != 0);
    match (expedited, sized) {
        (true, true) => Transfer::Expedited(Chunk::first(&data, 4 - usize::from(command >> 2 & 3))),
        (true, false) => Transfer::Expedited(Chunk::first(&data, 4)),
        (false, true) => Transfer::Segmented(Some(u32::from_le_bytes(data))),
        (false, false) => Transfer::Segmented(None),
    }
}

/// A command's parts, read in every way in which the specifiers may need them.
struct Parts {
    specifier: u8,
    command: u8,
    object: Object,
    data: [u8; 4],
    toggle: bool,
    chunk: Chunk,
    last: bool,
}

fn parts(bytes: &[u8]) -> Result<Parts, Malformed> {
    let &[command, low, high, sub, a, b, c, d] = bytes else { return Err(Malformed) };
    let object = Object::new(u16::from_le_bytes([low, high]), sub);
    let chunk = Chunk::first(&[low, high, sub, a, b, c, d], 7 - usize::from(command >> 1 & 7));
    let (toggle, last) = (command & TOGGLE != 0, command & 1 != 0);
    Ok(Parts { specifier: command >> 5, command, object, data: [a, b, c, d], toggle, chunk, last })
}

impl Request {
    /// The bytes of the frame.
    pub fn encode(&self) -> [u8; 8] {
        match *self {
            Request::DownloadSegment { toggle, chunk, last } => segment(0x00, chunk, toggle, last),
            Request::Download { object, transfer } => begin(0x20, object, transfer),
            Request::Upload { object } => addressed(0x40, object, [0; 4]),
            Request::UploadSegment { toggle } => [0x60 | toggled(toggle), 0, 0, 0, 0, 0, 0, 0],
            Request::Abort { object, code } => addressed(0x80, object, code.0.to_le_bytes()),
        }
    }

    /// The request in a frame's bytes.
    ///
    /// # Errors
    /// If they are not a command known here.
    pub fn decode(bytes: &[u8]) -> Result<Request, Malformed> {
        let Parts { specifier, command, object, data, toggle, chunk, last } = parts(bytes)?;
        Ok(match specifier {
            0 => Request::DownloadSegment { toggle, chunk, last },
            1 => Request::Download { object, transfer: transfer(command, data) },
            2 => Request::Upload { object },
            3 => Request::UploadSegment { toggle },
            4 => Request::Abort { object, code: AbortCode(u32::from_le_bytes(data)) },
            _ => return Err(Malformed),
        })
    }
}

impl Response {
    /// The bytes of the frame.
    pub fn encode(&self) -> [u8; 8] {
        match *self {
            Response::UploadSegment { toggle, chunk, last } => segment(0x00, chunk, toggle, last),
            Response::DownloadSegment { toggle } => [0x20 | toggled(toggle), 0, 0, 0, 0, 0, 0, 0],
            Response::Upload { object, transfer } => begin(0x40, object, transfer),
            Response::Download { object } => addressed(0x60, object, [0; 4]),
            Response::Abort { object, code } => addressed(0x80, object, code.0.to_le_bytes()),
        }
    }

    /// The response in a frame's bytes.
    ///
    /// # Errors
    /// If they are not a command known here.
    pub fn decode(bytes: &[u8]) -> Result<Response, Malformed> {
        let Parts { specifier, command, object, data, toggle, chunk, last } = parts(bytes)?;
        Ok(match specifier {
            0 => Response::UploadSegment { toggle, chunk, last },
            1 => Response::DownloadSegment { toggle },
            2 => Response::Upload { object, transfer: transfer(command, data) },
            3 => Response::Download { object },
            4 => Response::Abort { object, code: AbortCode(u32::from_le_bytes(data)) },
            _ => return Err(Malformed),
        })
    }
}

/// Why a transfer was given up (CiA 301).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct AbortCode(pub u32);

impl AbortCode {
    /// Toggle bit not alternated.
    pub const TOGGLE: AbortCode = AbortCode(0x0503_0000);
    /// The other side did not answer in time.
    pub const TIMEOUT: AbortCode = AbortCode(0x0504_0000);
    /// Command specifier unknown.
    pub const COMMAND: AbortCode = AbortCode(0x0504_0001);
    /// Out of memory: here, more bytes than the receiver holds.
    pub const MEMORY: AbortCode = AbortCode(0x0504_0005);
    /// Read of a write-only object.
    pub const WRITE_ONLY: AbortCode = AbortCode(0x0601_0001);
    /// Write of a read-only object.
    pub const READ_ONLY: AbortCode = AbortCode(0x0601_0002);
    /// No such object.
    pub const NO_OBJECT: AbortCode = AbortCode(0x0602_0000);
    /// The object cannot be mapped to a PDO.
    pub const NOT_MAPPABLE: AbortCode = AbortCode(0x0604_0041);
    /// The mapped objects are longer than a PDO.
    pub const PDO_LENGTH: AbortCode = AbortCode(0x0604_0042);
    /// The value has another length than the object.
    pub const LENGTH: AbortCode = AbortCode(0x0607_0010);
    /// The value is too long.
    pub const TOO_LONG: AbortCode = AbortCode(0x0607_0012);
    /// The value is too short.
    pub const TOO_SHORT: AbortCode = AbortCode(0x0607_0013);
    /// No such sub-index.
    pub const NO_SUB_INDEX: AbortCode = AbortCode(0x0609_0011);
    /// The value is out of range.
    pub const VALUE: AbortCode = AbortCode(0x0609_0030);
    /// General error.
    pub const GENERAL: AbortCode = AbortCode(0x0800_0000);
    /// Abort code: data cannot be transferred because of local control.
    pub const LOCAL_CONTROL: AbortCode = AbortCode(0x0800_0021);
    /// Abort code: data cannot be transferred in the device's present state.
    pub const DEVICE_STATE: AbortCode = AbortCode(0x0800_0022);

    /// The code in words.
    pub const fn text(self) -> &'static str {
        match self.0 {
            0x0503_0000 => "toggle bit not alternated",
            0x0504_0000 => "SDO protocol timed out",
            0x0504_0001 => "command specifier not valid or unknown",
            0x0504_0002 => "invalid block size",
            0x0504_0003 => "invalid sequence number",
            0x0504_0004 => "CRC error",
            0x0504_0005 => "out of memory",
            0x0601_0000 => "unsupported access to an object",
            0x0601_0001 => "read of a write-only object",
            0x0601_0002 => "write of a read-only object",
            0x0602_0000 => "the object does not exist",
            0x0604_0041 => "the object cannot be mapped to a PDO",
            0x0604_0042 => "the mapped objects are longer than a PDO",
            0x0604_0043 => "general parameter incompatibility",
            0x0604_0047 => "general internal incompatibility in the device",
            0x0606_0000 => "access failed because of a hardware error",
            0x0607_0010 => "length of the value does not match",
            0x0607_0012 => "the value is too long",
            0x0607_0013 => "the value is too short",
            0x0609_0011 => "the sub-index does not exist",
            0x0609_0030 => "the value is out of range",
            0x0609_0031 => "the value is too high",
            0x0609_0032 => "the value is too low",
            0x0609_0036 => "maximum less than minimum",
            0x060A_0023 => "resource not available: SDO connection",
            0x0800_0000 => "general error",
            0x0800_0020 => "data cannot be transferred or stored",
            0x0800_0021 => "data cannot be transferred or stored because of local control",
            0x0800_0022 => "data cannot be transferred or stored in the present device state",
            0x0800_0023 => "no object dictionary",
            0x0800_0024 => "no data",
            _ => "abort code unknown to CiA 301",
        }
    }
}

/// `0x06020000: the object does not exist`.
impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:08X}: {}", self.0, self.text())
    }
}

impl fmt::Debug for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJECT: Object = Object::new(0x6040, 0);

    fn chunk(data: &[u8]) -> Chunk {
        Chunk::first(data, 7)
    }

    /// Bytes as published traces of real drives have them.
    #[test]
    fn commands_have_the_standards_bytes() {
        let write = Request::Download { object: OBJECT, transfer: Transfer::Expedited(chunk(&[0x0F, 0x00])) };
        assert_eq!(write.encode(), [0x2B, 0x40, 0x60, 0, 0x0F, 0, 0, 0]);
        assert_eq!(Request::Upload { object: OBJECT }.encode(), [0x40, 0x40, 0x60, 0, 0, 0, 0, 0]);
        let abort = Response::Abort { object: OBJECT, code: AbortCode::NO_OBJECT };
        assert_eq!(abort.encode(), [0x80, 0x40, 0x60, 0, 0, 0, 0x02, 0x06]);
        let last = Response::UploadSegment { toggle: true, chunk: chunk(b"abc"), last: true };
        assert_eq!(last.encode(), [0x19, b'a', b'b', b'c', 0, 0, 0, 0]);
    }

    #[test]
    fn every_request_survives_the_wire() {
        let mut requests = vec![Request::Upload { object: OBJECT }];
        for len in 1..=4 {
            let transfer = Transfer::Expedited(chunk(&[1, 2, 3, 4][..len]));
            requests.push(Request::Download { object: OBJECT, transfer });
        }
        for size in [None, Some(70_000)] {
            requests.push(Request::Download { object: OBJECT, transfer: Transfer::Segmented(size) });
        }
        for toggle in [false, true] {
            requests.push(Request::UploadSegment { toggle });
            for (len, last) in [(7, false), (7, true), (0, true), (3, true)] {
                requests.push(Request::DownloadSegment { toggle, chunk: chunk(&[9; 7][..len]), last });
            }
        }
        requests.push(Request::Abort { object: OBJECT, code: AbortCode::TOGGLE });
        for request in requests {
            assert_eq!(Request::decode(&request.encode()), Ok(request));
        }
    }

    #[test]
    fn every_response_survives_the_wire() {
        let mut responses = vec![Response::Download { object: OBJECT }];
        for len in 1..=4 {
            let transfer = Transfer::Expedited(chunk(&[1, 2, 3, 4][..len]));
            responses.push(Response::Upload { object: OBJECT, transfer });
        }
        for size in [None, Some(12)] {
            responses.push(Response::Upload { object: OBJECT, transfer: Transfer::Segmented(size) });
        }
        for toggle in [false, true] {
            responses.push(Response::DownloadSegment { toggle });
            for (len, last) in [(7, false), (7, true), (0, true), (3, true)] {
                responses.push(Response::UploadSegment { toggle, chunk: chunk(&[9; 7][..len]), last });
            }
        }
        responses.push(Response::Abort { object: OBJECT, code: AbortCode::VALUE });
        for response in responses {
            assert_eq!(Response::decode(&response.encode()), Ok(response));
        }
    }

    #[test]
    fn short_frames_and_block_commands_are_malformed() {
        assert_eq!(Request::decode(&[0x40, 0x40, 0x60, 0]), Err(Malformed));
        assert_eq!(Request::decode(&[0xA4, 0, 0, 0, 0, 0, 0, 0]), Err(Malformed));
        assert_eq!(Response::decode(&[0xC0, 0, 0, 0, 0, 0, 0, 0]), Err(Malformed));
    }

    #[test]
    fn an_expedited_frame_without_size_has_four_bytes() {
        let decoded = Response::decode(&[0x42, 0x40, 0x60, 0, 1, 2, 3, 4]);
        let transfer = Transfer::Expedited(chunk(&[1, 2, 3, 4]));
        assert_eq!(decoded, Ok(Response::Upload { object: OBJECT, transfer }));
    }
}
