//! The transport on a pseudo terminal, with an emulated adapter at its other end.

use super::*;
use std::fs::File;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// What an adapter does, and what it was given.
#[derive(Debug)]
struct Adapter {
    /// Commands that it refuses with a bell, by their first letters.
    refuses: Vec<&'static str>,
    /// The answer to `F`, which clears it; `None` where it has no such command.
    flags: Option<u8>,
    /// The adapter answers nothing at all.
    silent: bool,
    heard: Vec<String>,
}

impl Default for Adapter {
    fn default() -> Self {
        Adapter { refuses: Vec::new(), flags: Some(0), silent: false, heard: Vec::new() }
    }
}

impl Adapter {
    fn answer(&mut self, command: &str) -> Vec<u8> {
        self.heard.push(command.to_string());
        let refused = self.refuses.iter().any(|begin| command.starts_with(begin));
        match (command, self.flags) {
            _ if self.silent => Vec::new(),
            _ if refused => vec![0x07],
            ("F", Some(flags)) => {
                self.flags = Some(0);
                format!("F{flags:02X}\r").into_bytes()
            }
            ("F", None) => vec![0x07],
            ("V", _) => b"V1013\r".to_vec(),
            (command, _) if command.starts_with('t') => b"z\r".to_vec(),
            _ => b"\r".to_vec(),
        }
    }
}

/// The other end of a pseudo terminal.
struct Port {
    path: PathBuf,
    adapter: Arc<Mutex<Adapter>>,
    end: File,
    thread: JoinHandle<()>,
}

impl Port {
    fn new(adapter: Adapter) -> Port {
        use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
        let end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&end).unwrap();
        unlockpt(&end).unwrap();
        let path = PathBuf::from(ptsname(&end, Vec::new()).unwrap().into_string().unwrap());
        // Kept open, so that the terminal outlives the transport as a device does.
        let kept = SerialPort::open(&path, |mut s: Settings| {
            s.set_raw();
            Ok(s)
        });
        let adapter = Arc::new(Mutex::new(adapter));
        let (end, shared) = (File::from(end), Arc::clone(&adapter));
        let mut wire = end.try_clone().unwrap();
        let thread = std::thread::spawn(move || {
            let _kept = kept;
            let (mut byte, mut line) = ([0], String::new());
            while wire.read(&mut byte).is_ok_and(|len| len > 0) {
                match byte[0] {
                    // A sign of the test's: the adapter is unplugged.
                    0x04 => return,
                    b'\r' => {
                        let answer = shared.lock().unwrap().answer(&std::mem::take(&mut line));
                        wire.write_all(&answer).unwrap();
                    }
                    other => line.push(char::from(other)),
                }
            }
        });
        Port { path, adapter, end, thread }
    }

    fn open(&self) -> Slcan {
        Slcan::open(&self.path, 500_000).unwrap()
    }

    fn says(&mut self, text: &[u8]) {
        self.end.write_all(text).unwrap();
    }

    fn heard(&self) -> Vec<String> {
        self.adapter.lock().unwrap().heard.clone()
    }

    /// What it is given but for empty lines, once it has `last`.
    fn heard_until(&self, last: &str) -> Vec<String> {
        let start = std::time::Instant::now();
        loop {
            let heard = self.heard();
            if heard.last().is_some_and(|line| line == last) {
                return heard.into_iter().filter(|line| !line.is_empty()).collect();
            }
            assert!(start.elapsed().as_secs() < 10, "{heard:?}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn frame(id: u16) -> Frame {
    Frame::from_raw(id, &[1, 2]).unwrap()
}

/// What comes in `ms`.
fn events(bus: &mut Slcan, ms: Micros) -> Vec<Event> {
    let end = bus.now() + 1000 * ms;
    std::iter::from_fn(|| bus.receive(end).unwrap().map(|(_, event)| event)).collect()
}

/// What comes until there are `count`, for ten seconds at most.
fn first(bus: &mut Slcan, count: usize) -> Vec<Event> {
    let end = bus.now() + 10_000_000;
    std::iter::from_fn(|| bus.receive(end).unwrap().map(|(_, event)| event)).take(count).collect()
}

#[test]
fn the_channel_is_set_opened_used_and_closed() {
    for (bitrate, speed) in [(10_000, "S0"), (125_000, "S4"), (1_000_000, "S8")] {
        let mut port = Port::new(Adapter::default());
        let mut bus = Slcan::open(&port.path, bitrate).unwrap();
        assert_eq!(port.heard_until("F"), ["C", "V", speed, "O", "F"]);
        bus.send(&frame(0x123)).unwrap();
        assert_eq!(port.heard_until("t12320102").last().unwrap(), "t12320102");
        port.says(b"t12320102\rT0000012320102\rt45600A1B\r");
        let empty = Frame::from_raw(0x456, &[]).unwrap();
        assert_eq!(first(&mut bus, 2), [Event::Frame(frame(0x123)), Event::Frame(empty)]);
        drop(bus);
        port.heard_until("C");
    }
}

#[test]
fn what_the_adapter_refuses_is_named() {
    for (refused, named) in [("S6", "refuses 500000 bit/s (S6)"), ("O", "does not open its channel (O)")] {
        let port = Port::new(Adapter { refuses: vec![refused], ..Adapter::default() });
        let error = Slcan::open(&port.path, 500_000).unwrap_err().to_string();
        assert!(error.contains(named) && error.contains("slcan:/dev/pts/"), "{error}");
    }
    let port = Port::new(Adapter::default());
    let error = Slcan::open(&port.path, 400_000).unwrap_err().to_string();
    assert!(
        error.contains("400000") && error.contains("500000, 800000") && port.heard().is_empty(),
        "{error}"
    );
    // A channel that is closed already refuses to be closed.
    Port::new(Adapter { refuses: vec!["C"], ..Adapter::default() }).open();
    // And one may have no version.
    Port::new(Adapter { refuses: vec!["V"], ..Adapter::default() }).open();
}

#[test]
fn flags_become_events() {
    let port = Port::new(Adapter { flags: Some(0x20), ..Adapter::default() });
    let mut bus = port.open();
    assert_eq!(first(&mut bus, 1), [Event::ErrorPassive]);
    // Reported once as long as it lasts; an error on the bus alone is none.
    port.adapter.lock().unwrap().flags = Some(0xA0);
    assert_eq!(events(&mut bus, 300), []);
    port.adapter.lock().unwrap().flags = Some(0x08);
    assert_eq!(first(&mut bus, 1), [Event::Overrun]);
    port.adapter.lock().unwrap().flags = Some(0x02);
    assert_eq!(first(&mut bus, 1), [Event::NotSent]);
    assert_eq!(bus.send(&frame(1)), Ok(()));
}

#[test]
fn a_frame_that_is_refused_for_errors_on_the_bus_means_bus_off() {
    let port = Port::new(Adapter { refuses: vec!["t"], ..Adapter::default() });
    let mut bus = port.open();
    // Refused without a reason of the bus.
    bus.send(&frame(1)).unwrap();
    assert_eq!(first(&mut bus, 1), [Event::NotSent]);
    bus.send(&frame(1)).unwrap();
    port.adapter.lock().unwrap().flags = Some(0x80);
    assert_eq!(first(&mut bus, 1), [Event::BusOff]);
    assert_eq!(bus.send(&frame(1)), Err(BusError::Off));
    // The reason is not lost where a question has just cleared it.
    let mut port = Port::new(Adapter { refuses: vec!["t"], ..Adapter::default() });
    let mut later = port.open();
    port.says(b"F80\r");
    later.send(&frame(1)).unwrap();
    assert_eq!(first(&mut later, 1), [Event::BusOff]);
    // Flags that are clear again are not a sign that it is back.
    assert_eq!(events(&mut bus, 600), []);
    assert_eq!(bus.send(&frame(1)), Err(BusError::Off));
}

#[test]
fn an_adapter_that_tells_its_state_is_believed() {
    let mut port = Port::new(Adapter { flags: None, ..Adapter::default() });
    let mut bus = port.open();
    port.says(b"sp128000\rsp129000\rsb256256\re1o\r");
    assert_eq!(first(&mut bus, 3), [Event::ErrorPassive, Event::BusOff, Event::Overrun]);
    assert_eq!(bus.send(&frame(1)), Err(BusError::Off));
    port.says(b"sa000000\r");
    assert_eq!(first(&mut bus, 1), [Event::Restarted]);
    assert_eq!(bus.send(&frame(1)), Ok(()));
    // It has no flags, and was asked once.
    assert_eq!(events(&mut bus, 600), []);
    assert_eq!(port.heard().iter().filter(|line| *line == "F").count(), 1);
}

#[test]
fn a_garbled_line_costs_itself_alone() {
    let mut port = Port::new(Adapter::default());
    let mut bus = port.open();
    port.says(b"t12320\xFFx02\rt1232010\rt12320102\r");
    port.says(&[b'#'; 5000]);
    port.says(b"\rt45620102\r");
    assert_eq!(first(&mut bus, 2), [Event::Frame(frame(0x123)), Event::Frame(frame(0x456))]);
    assert_eq!(events(&mut bus, 50), []);
}

#[test]
fn what_answers_nothing_is_a_bus_all_the_same() {
    let mut port = Port::new(Adapter { silent: true, ..Adapter::default() });
    let mut bus = port.open();
    bus.send(&frame(0x123)).unwrap();
    assert_eq!(port.heard_until("t12320102"), ["C", "V", "S6", "O", "t12320102"]);
    port.says(b"t12320102\r");
    assert_eq!(first(&mut bus, 1), [Event::Frame(frame(0x123))]);
    assert_eq!(events(&mut bus, 600), []);
}

#[test]
fn an_adapter_that_falls_silent_or_vanishes_is_an_error() {
    let port = Port::new(Adapter::default());
    let mut bus = port.open();
    port.adapter.lock().unwrap().silent = true;
    let end = bus.now() + 10_000_000;
    let error = bus.receive(end).unwrap_err().to_string();
    assert!(error.contains("slcan:/dev/pts/") && error.contains("no answer for 1 s"), "{error}");
    // Unplugged: nobody is at the other end of the terminal any more.
    let mut port = Port::new(Adapter::default());
    let mut bus = port.open();
    port.says(b"t12320102\r");
    assert_eq!(first(&mut bus, 1), [Event::Frame(frame(0x123))]);
    bus.port.write(b"\x04").unwrap();
    let Port { end, thread, .. } = port;
    thread.join().unwrap();
    drop(end);
    let until = bus.now() + 10_000_000;
    let error = bus.receive(until).unwrap_err().to_string();
    assert!(error.contains("the device was removed"), "{error}");
    assert!(bus.send(&frame(1)).is_err());
}

#[test]
fn a_flush_ends_half_a_frame() {
    let port = Port::new(Adapter { refuses: vec!["t777"], ..Adapter::default() });
    let mut bus = port.open();
    bus.port.write(b"t7778AABB").unwrap();
    // Long enough for the adapter to take it, and no matter where it was not.
    std::thread::sleep(Duration::from_millis(20));
    bus.flush();
    bus.send(&frame(0x000)).unwrap();
    assert_eq!(port.heard_until("t00020102").last().unwrap(), "t00020102");
    // Its own refusal is not news; that of a later frame is.
    assert_eq!(events(&mut bus, 300), []);
    bus.send(&frame(0x777)).unwrap();
    assert_eq!(first(&mut bus, 1), [Event::NotSent]);
}
