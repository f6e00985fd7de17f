//! A writer behind a thread of its own: the cycle hands over a line and never waits for a disk.

use std::io::{self, Write};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

/// Lines that may wait. At 200 Hz these are 20 s; a disk that is silent for longer holds the cycle up, and a cycle that
/// is held up stops the arm.
const WAITING: usize = 4000;

/// What is written here is written by another thread, whole and in order, each call by one call there. An error there
/// is the error of a later call here. Dropping it waits until everything is written, as [`close`](Behind::close) does.
#[derive(Debug)]
pub struct Behind<W: Write + Send + 'static> {
    lines: Option<SyncSender<Vec<u8>>>,
    thread: Option<JoinHandle<(W, io::Result<()>)>>,
    done: Option<W>,
}

impl<W: Write + Send + 'static> Behind<W> {
    /// Begins a thread that writes to `writer`.
    pub fn new(mut writer: W) -> Behind<W> {
        let (lines, waiting) = sync_channel::<Vec<u8>>(WAITING);
        let write = move || {
            // It waits for disks, and must not do so with the priority of the cycle.
            #[cfg(target_os = "linux")]
            crate::bus::transport::realtime::resign();
            let done = waiting.iter().try_for_each(|line| writer.write_all(&line));
            let done = done.and_then(|()| writer.flush());
            (writer, done)
        };
        Behind { lines: Some(lines), thread: Some(thread::spawn(write)), done: None }
    }

    /// Waits until everything is written.
    fn finish(&mut self) -> io::Result<()> {
        self.lines = None;
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let (writer, done) = thread.join().map_err(|_| io::Error::other("the log's thread has panicked"))?;
        self.done = Some(writer);
        done
    }

    /// Waits until everything is written, and gives the writer back, where its thread lived, beside the error that
    /// ended it.
    pub fn close(mut self) -> (Option<W>, io::Result<()>) {
        let done = self.finish();
        (self.done.take(), done)
    }
}

impl<W: Write + Send + 'static> Drop for Behind<W> {
    fn drop(&mut self) {
        let _ = self.finish();
    }
}

impl<W: Write + Send + 'static> Write for Behind<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let gone = || io::Error::other("the log is closed");
        if self.lines.as_ref().ok_or_else(gone)?.send(bytes.to_vec()).is_ok() {
            return Ok(bytes.len());
        }
        self.finish().and_then(|()| Err(gone()))
    }

    /// What was handed over is written as soon as it can be; [`close`](Behind::close) waits for it.
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_written_in_order() {
        let mut log = Behind::new(Vec::new());
        (0..10_000).for_each(|k| log.write_all(format!("{k}\n").as_bytes()).unwrap());
        let (written, done) = log.close();
        done.unwrap();
        let expected: String = (0..10_000).map(|k| format!("{k}\n")).collect();
        assert_eq!(String::from_utf8(written.unwrap()).unwrap(), expected);
    }

    /// Takes so many bytes, then the disk is full.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_full_disk_is_told() {
        let mut log = Behind::new(Full(10));
        let told = (0..100_000).find_map(|_| log.write_all(b"1234\n").err()).unwrap();
        assert_eq!(told.kind(), io::ErrorKind::StorageFull);
        assert!(log.write_all(b"5").is_err());
    }
}
