//! The lines of slcan: Lawicel's commands and answers, and what Linux's own slcan driver reads in addition.

use crate::canopen::Frame;

/// Bit rates of the commands S0 to S8, bit/s.
const BITRATES: [u32; 9] = [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// A line longer than this is noise.
const LONGEST: usize = 64;
/// The error answer to a command.
const BELL: u8 = 0x07;

/// The digit of the command that sets a bit rate.
///
/// # Errors
/// What is wrong with the bit rate, with those that there are.
pub(in crate::transport) fn speed(bitrate: u32) -> Result<usize, String> {
    BITRATES.iter().position(|known| *known == bitrate).ok_or_else(|| {
        let known: Vec<String> = BITRATES.iter().map(u32::to_string).collect();
        format!("slcan has no command for {bitrate} bit/s; it has those for {}", known.join(", "))
    })
}

/// State of the adapter's controller on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Active,
    Passive,
    Off,
}

/// The status flags that `F` reads. Reading them clears those that are latched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Flags(pub(super) u8);

impl Flags {
    pub(super) fn with(self, other: Flags) -> Flags {
        Flags(self.0 | other.0)
    }

    /// Received frames were lost: receive FIFO full, or data overrun.
    pub(super) fn overrun(self) -> bool {
        self.0 & 0x09 != 0
    }

    /// Frames were not sent: transmit FIFO full.
    pub(super) fn not_sent(self) -> bool {
        self.0 & 0x02 != 0
    }

    /// Lawicel's flags have none for bus-off. An adapter that refuses a frame because of errors on the bus is
    /// off it; bit 4, which Lawicel leaves free, means bus-off in firmware of other makers.
    pub(super) fn off(self, refused: bool) -> bool {
        self.0 & 0x10 != 0 || refused && self.0 & 0x80 != 0
    }

    pub(super) fn passive(self) -> bool {
        self.0 & 0x20 != 0
    }
}

/// A line from an adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Line {
    Frame(Frame),
    /// A command was done, or a frame taken.
    Done,
    /// A command or a frame was refused.
    Refused,
    Flags(Flags),
    /// The answer to `V`.
    Version,
    /// `sp128000`: passive, with both error counters.
    State(State),
    /// `e1o`, `e1O`: received frames lost, frames not sent.
    Lost {
        received: bool,
        sent: bool,
    },
    /// Extended and remote frames, noise.
    Other,
}

/// Lines out of bytes.
#[derive(Debug, Default)]
pub(super) struct Lines {
    line: Vec<u8>,
    /// The line became too long: what follows of it is noise too.
    noise: bool,
}

impl Lines {
    /// The line that ends with this byte, if one does.
    pub(super) fn push(&mut self, byte: u8) -> Option<Line> {
        match byte {
            b'\r' | BELL => {
                let (line, noise) = (std::mem::take(&mut self.line), std::mem::take(&mut self.noise));
                Some(match byte {
                    BELL => Line::Refused,
                    _ if noise => Line::Other,
                    _ => read(&line),
                })
            }
            _ => {
                self.noise |= self.line.len() >= LONGEST;
                if !self.noise {
                    self.line.push(byte);
                }
                None
            }
        }
    }
}

fn read(line: &[u8]) -> Line {
    match line {
        b"" | b"z" | b"Z" => Line::Done,
        [b'V', _, ..] => Line::Version,
        [b't', ..] => decode(line).map_or(Line::Other, Line::Frame),
        [b'F', digits @ ..] if digits.len() == 2 => {
            hex(digits).map_or(Line::Other, |flags| Line::Flags(Flags(flags as u8)))
        }
        [b's', state, counters @ ..] if counters.len() == 6 && counters.iter().all(u8::is_ascii_digit) => {
            match state {
                b'a' | b'w' => Line::State(State::Active),
                b'p' => Line::State(State::Passive),
                b'b' => Line::State(State::Off),
                _ => Line::Other,
            }
        }
        [b'e', count, errors @ ..] if usize::from(count.wrapping_sub(b'0')) == errors.len() => {
            Line::Lost { received: errors.contains(&b'o'), sent: errors.contains(&b'O') }
        }
        _ => Line::Other,
    }
}

/// `t1234DEADBEEF\r`.
pub(super) fn encode(frame: &Frame) -> Vec<u8> {
    let mut line = format!("t{:03X}{}", frame.raw_id(), frame.bytes().len());
    frame.bytes().iter().for_each(|byte| line.push_str(&format!("{byte:02X}")));
    line.push('\r');
    line.into_bytes()
}

fn hex(digits: &[u8]) -> Option<u16> {
    digits.iter().try_fold(0u16, |sum, d| Some(sum << 4 | char::from(*d).to_digit(16)? as u16))
}

/// The frame in a line without its end; `None` for extended and remote frames.
fn decode(line: &[u8]) -> Option<Frame> {
    let (b't', rest) = line.split_first().map(|(kind, rest)| (*kind, rest))? else { return None };
    let (id, rest) = rest.split_at_checked(3)?;
    let (len, rest) = rest.split_at_checked(1)?;
    let len = usize::from(hex(len)?);
    // A time stamp of four digits may follow.
    let data = rest.get(..2 * len)?;
    let bytes: Option<Vec<u8>> = data.chunks_exact(2).map(|pair| Some(hex(pair)? as u8)).collect();
    Frame::from_raw(hex(id)?, &bytes?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use chacha20::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn frames_are_those_of_the_protocol() {
        let frame = Frame::from_raw(0x123, &[0xDE, 0xAD, 0xBE, 0xEF]).unwrap();
        assert_eq!(encode(&frame), b"t1234DEADBEEF\r");
        assert_eq!(decode(b"t1234deadbeef"), Some(frame));
        assert_eq!(decode(b"t1234DEADBEEF0A1B"), Some(frame));
        for line in [
            &b""[..],
            b"z",
            b"t12",
            b"t1234DEAD",
            b"T000001231AA",
            b"r1230",
            b"t12x0",
            b"t1239112233445566778899",
        ] {
            assert_eq!(decode(line), None);
        }
    }

    #[test]
    fn answers_are_distinguished() {
        for (text, expected) in [
            (&b"\r"[..], Line::Done),
            (b"z\r", Line::Done),
            (b"\x07", Line::Refused),
            (b"t12\x07", Line::Refused),
            (b"F28\r", Line::Flags(Flags(0x28))),
            (b"F2x\r", Line::Other),
            (b"F\r", Line::Other),
            (b"V1013\r", Line::Version),
            (b"V\r", Line::Other),
            (b"sb256256\r", Line::State(State::Off)),
            (b"sp128000\r", Line::State(State::Passive)),
            (b"sa057033\r", Line::State(State::Active)),
            (b"sx057033\r", Line::Other),
            (b"s8\r", Line::Other),
            (b"e2ac\r", Line::Lost { received: false, sent: false }),
            (b"e3bcO\r", Line::Lost { received: false, sent: true }),
            (b"e1o\r", Line::Lost { received: true, sent: false }),
            (b"e9o\r", Line::Other),
        ] {
            let mut lines = Lines::default();
            let found: Vec<Line> = text.iter().filter_map(|byte| lines.push(*byte)).collect();
            assert_eq!(found, [expected], "{}", String::from_utf8_lossy(text));
        }
    }

    #[test]
    fn what_follows_noise_is_noise_until_the_line_ends() {
        let mut lines = Lines::default();
        let text = [&[b'x'; 64][..], b"t1230\rt1230\r"].concat();
        let found: Vec<Line> = text.iter().filter_map(|byte| lines.push(*byte)).collect();
        assert_eq!(found, [Line::Other, Line::Frame(Frame::from_raw(0x123, &[]).unwrap())]);
    }

    /// Noise out of letters that lines have: a line that is accepted as a frame is written as that frame.
    #[test]
    fn random_lines_are_read_or_left() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut lines, mut frames) = (Lines::default(), 0);
        for _ in 0..500_000 {
            let letters = b"t0123Fs\rz\x07";
            let byte = match rng.random_range(0..50) {
                0 => rng.random(),
                _ => letters[rng.random_range(0..letters.len())],
            };
            if let Some(Line::Frame(frame)) = lines.push(byte) {
                frames += 1;
                let found: Vec<Line> = encode(&frame).iter().filter_map(|byte| lines.push(*byte)).collect();
                assert_eq!(found, [Line::Frame(frame)]);
            }
        }
        assert!(frames > 50, "{frames}");
    }

    #[test]
    fn bit_rates_are_those_of_the_commands() {
        assert_eq!((speed(10_000), speed(500_000), speed(1_000_000)), (Ok(0), Ok(6), Ok(8)));
        let why = speed(300_000).unwrap_err();
        assert!(why.contains("300000") && why.contains("125000, 250000, 500000"), "{why}");
    }

    #[test]
    fn flags_are_lawicels() {
        assert!(Flags(0x01).overrun() && Flags(0x08).overrun() && !Flags(0xF6).overrun());
        assert!(Flags(0x20).passive() && !Flags(0xDF).passive());
        assert!(Flags(0x02).not_sent() && !Flags(0xFD).not_sent());
        // An error on the bus alone does not mean bus-off.
        assert!(Flags(0x10).off(false) && !Flags(0x80).off(false) && Flags(0x80).off(true));
    }
}
