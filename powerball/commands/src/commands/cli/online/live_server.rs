//! The server behind `--serve`.
//!
//! The server runs in the process that moves the arm, so it accepts little: only GET, no bodies, short
//! requests, few connections, short waits; and it shows its page only to a client with the token of the
//! printed address. It has its own thread, and the cycle never waits for it.

use crate::report::stream_page;
use hyper::body::{Body, Bytes, Frame, Incoming, SizeHint};
use hyper::header::{HOST, HeaderName, HeaderValue, ORIGIN};
use hyper::rt::ReadBufCursor;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use std::cell::{Cell, RefCell};
use std::convert::Infallible;
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::{Pin, pin};
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Context, Poll, Waker, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::sync::mpsc::Receiver;
use tokio::task::{LocalSet, spawn_local};
use tokio::time::{Sleep, sleep, timeout};

/// Request line and headers together, bytes: the least that hyper takes.
const REQUEST: usize = 8192;
/// Connections at one time, pages that are fed among them; further ones are closed at once.
const CONNECTIONS: usize = 16;
/// For a request to be there as a whole, and for a reader to take something of what waits for him.
const PATIENCE: Duration = Duration::from_secs(3);
/// Messages that late pages still get; the oldest samples go first.
const MOST: usize = 50_000;

/// Answers at `listener` until all senders of messages are gone; every page gets every message.
///
/// # Errors
/// If the system cannot wait for connections.
pub(super) fn serve(
    listener: std::net::TcpListener,
    token: &str,
    mut messages: Receiver<String>,
) -> io::Result<()> {
    let at = listener.local_addr()?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    LocalSet::new().block_on(&runtime, async {
        listener.set_nonblocking(true)?;
        let listener = TcpListener::from_std(listener)?;
        let page =
            Rc::new(Page { hosts: hosts(at), query: format!("token={token}"), history: Rc::default() });
        let history = Rc::clone(&page.history);
        spawn_local(accept(listener, page));
        while let Some(message) = messages.recv().await {
            history.borrow_mut().push(format!("data: {message}\n\n").into());
        }
        Ok(())
    })
}

/// The host names of the server for a browser on this machine; a name of another domain that points here is
/// not among them.
fn hosts(at: SocketAddr) -> Vec<String> {
    let port = at.port();
    let names = ["127.0.0.1".to_string(), "[::1]".to_string(), "localhost".to_string()];
    let mut hosts: Vec<String> = names.iter().map(|name| format!("{name}:{port}")).collect();
    hosts.push(at.to_string());
    // Browsers leave the port of http out.
    if port == 80 {
        hosts.extend(names);
    }
    hosts
}

async fn accept(listener: TcpListener, page: Rc<Page>) {
    let room = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // No file is left for it: others must go first.
            sleep(Duration::from_millis(100)).await;
            continue;
        };
        let Ok(place) = Arc::clone(&room).try_acquire_owned() else { continue };
        let page = Rc::clone(&page);
        spawn_local(async move {
            converse(stream, &page).await;
            drop(place);
        });
    }
}

/// One request and its answer.
async fn converse(stream: TcpStream, page: &Page) {
    let asked = Cell::new(false);
    let service = service_fn(|request: Request<Incoming>| {
        asked.set(true);
        let answer = page.answer(&request);
        async move { Ok::<_, Infallible>(answer) }
    });
    let connection = http1::Builder::new()
        .keep_alive(false)
        .header_read_timeout(None)
        .max_buf_size(REQUEST)
        .serve_connection(Line { stream, stalled: None }, service);
    let mut connection = pin!(connection);
    // An error on a connection affects only its reader.
    if timeout(PATIENCE, connection.as_mut()).await.is_err() && asked.get() {
        let _ = connection.await;
    }
}

/// The page, and who may see it.
struct Page {
    hosts: Vec<String>,
    query: String,
    history: Rc<RefCell<History>>,
}

impl Page {
    fn answer(&self, request: &Request<Incoming>) -> Response<Answer> {
        let (status, kind, answer) = match (self.refusal(request), request.uri().path()) {
            (Some((status, why)), _) => (status, "text/plain", Answer::text(format!("{why}\n"))),
            (None, "/") => (StatusCode::OK, "text/html; charset=utf-8", Answer::text(stream_page())),
            (None, "/events") => {
                let feed = Feed { history: Rc::clone(&self.history), next: 0 };
                (StatusCode::OK, "text/event-stream", Answer::Events(feed))
            }
            (None, _) => {
                (StatusCode::NOT_FOUND, "text/plain", Answer::text("not found; the page is at /\n".into()))
            }
        };
        let mut response = Response::new(answer);
        *response.status_mut() = status;
        for (name, value) in [
            ("content-type", kind),
            ("cache-control", "no-store"),
            ("referrer-policy", "no-referrer"),
            ("x-content-type-options", "nosniff"),
            ("x-frame-options", "DENY"),
        ] {
            let name = HeaderName::from_static(name);
            response.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        if status == StatusCode::METHOD_NOT_ALLOWED {
            response.headers_mut().insert(hyper::header::ALLOW, HeaderValue::from_static("GET"));
        }
        response
    }

    /// Why somebody sees nothing.
    fn refusal(&self, request: &Request<Incoming>) -> Option<(StatusCode, &'static str)> {
        if request.method() != Method::GET {
            return Some((StatusCode::METHOD_NOT_ALLOWED, "only GET is answered"));
        }
        // It is never read.
        if !request.body().is_end_stream() {
            return Some((StatusCode::PAYLOAD_TOO_LARGE, "a request with a body is not answered"));
        }
        let mut named = request.headers().get_all(HOST).iter();
        let host = match (named.next().and_then(|host| host.to_str().ok()), named.next()) {
            (Some(host), None) if request.uri().authority().is_none() => host.to_ascii_lowercase(),
            _ => return Some((StatusCode::FORBIDDEN, "exactly one Host is needed, and none in the path")),
        };
        if !self.hosts.contains(&host) {
            return Some((StatusCode::FORBIDDEN, "this Host does not belong to this page"));
        }
        let own = format!("http://{host}");
        if request.headers().get_all(ORIGIN).iter().any(|origin| origin.as_bytes() != own.as_bytes()) {
            return Some((StatusCode::FORBIDDEN, "this Origin does not belong to this page"));
        }
        if request.uri().query() != Some(&self.query) {
            return Some((StatusCode::FORBIDDEN, "the token of the printed address is missing"));
        }
        None
    }
}

/// Messages so far, as server-sent events (HTML, §9.2), and who waits for the next one.
#[derive(Default)]
struct History {
    messages: Vec<Bytes>,
    /// Messages after the first that are gone.
    dropped: usize,
    waiting: Vec<Waker>,
}

impl History {
    fn push(&mut self, message: Bytes) {
        if self.messages.len() >= MOST {
            // The first message stays.
            self.dropped += self.messages.drain(1..MOST / 10).count();
        }
        self.messages.push(message);
        self.waiting.drain(..).for_each(Waker::wake);
    }

    /// The message number `next`, or the first after it that is still there; with the number of the one
    /// behind it.
    fn get(&self, next: usize) -> Option<(Bytes, usize)> {
        let place = if next == 0 { 0 } else { next.saturating_sub(self.dropped).max(1) };
        let message = self.messages.get(place)?;
        let number = if place == 0 { 0 } else { place + self.dropped };
        Some((message.clone(), number + 1))
    }
}

/// A page's place in the history: a slow page lags behind, and nothing is kept for it.
struct Feed {
    history: Rc<RefCell<History>>,
    next: usize,
}

/// An answer of the server.
enum Answer {
    Text(Option<Bytes>),
    Events(Feed),
}

impl Answer {
    fn text(text: String) -> Answer {
        Answer::Text(Some(text.into()))
    }
}

impl Body for Answer {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        let feed = match self.get_mut() {
            Answer::Text(text) => return Poll::Ready(text.take().map(|text| Ok(Frame::data(text)))),
            Answer::Events(feed) => feed,
        };
        let mut history = feed.history.borrow_mut();
        match history.get(feed.next) {
            Some((message, next)) => {
                feed.next = next;
                Poll::Ready(Some(Ok(Frame::data(message))))
            }
            None => {
                if !history.waiting.iter().any(|waker| waker.will_wake(cx.waker())) {
                    history.waiting.push(cx.waker().clone());
                }
                Poll::Pending
            }
        }
    }

    fn size_hint(&self) -> SizeHint {
        match self {
            Answer::Text(text) => SizeHint::with_exact(text.as_ref().map_or(0, Bytes::len) as u64),
            Answer::Events(_) => SizeHint::default(),
        }
    }
}

/// A connection that ends where its reader takes nothing for [`PATIENCE`].
struct Line {
    stream: TcpStream,
    stalled: Option<Pin<Box<Sleep>>>,
}

impl hyper::rt::Read for Line {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        mut buffer: ReadBufCursor<'_>,
    ) -> Poll<io::Result<()>> {
        let mut bytes = [0; 1024];
        let most = buffer.remaining().min(bytes.len());
        let mut read = ReadBuf::new(&mut bytes[..most]);
        ready!(Pin::new(&mut self.stream).poll_read(cx, &mut read))?;
        buffer.put_slice(read.filled());
        Poll::Ready(Ok(()))
    }
}

impl hyper::rt::Write for Line {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(cx, bytes);
        if written.is_ready() {
            self.stalled = None;
            return written;
        }
        let stalled = self.stalled.get_or_insert_with(|| Box::pin(sleep(PATIENCE)));
        stalled.as_mut().poll(cx).map(|()| Err(io::ErrorKind::TimedOut.into()))
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_lags_gets_the_beginning_and_what_is_still_there() {
        let mut history = History::default();
        let word = |k: usize| Bytes::from(format!("{k}"));
        (0..=MOST).for_each(|k| history.push(word(k)));
        let gone = MOST / 10 - 1;
        assert_eq!(history.messages.len(), MOST + 1 - gone);
        assert_eq!(history.get(0), Some((word(0), 1)));
        // The message that it would have got next is gone.
        assert_eq!(history.get(1), Some((word(gone + 1), gone + 2)));
        assert_eq!(history.get(7), Some((word(gone + 1), gone + 2)));
        assert_eq!(history.get(MOST), Some((word(MOST), MOST + 1)));
        assert_eq!(history.get(MOST + 1), None);
    }

    #[test]
    fn a_reader_who_takes_nothing_is_dropped_and_one_who_reads_gets_all() {
        use std::io::{Read, Write};
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let at = listener.local_addr().unwrap();
        let (send, messages) = tokio::sync::mpsc::channel(10);
        std::thread::spawn(move || serve(listener, "0", messages));
        // More than sockets hold.
        let (count, message) = (20_000, "x".repeat(1000));
        (0..count).for_each(|_| send.blocking_send(message.clone()).unwrap());
        let open = || {
            let mut stream = std::net::TcpStream::connect(at).unwrap();
            write!(stream, "GET /events?token=0 HTTP/1.1\r\nHost: {at}\r\n\r\n").unwrap();
            stream.set_read_timeout(Some(PATIENCE / 2)).unwrap();
            stream
        };
        let taken = |mut stream: std::net::TcpStream| {
            let (mut part, mut taken) = (vec![0; 65_536], 0);
            while let Ok(n @ 1..) = stream.read(&mut part) {
                taken += n;
            }
            taken
        };
        let (idle, reader) = (open(), open());
        assert!(taken(reader) > count * message.len());
        std::thread::sleep(PATIENCE);
        let taken = taken(idle);
        assert!(taken < count * message.len() * 3 / 4, "{taken} bytes");
    }

    #[test]
    fn a_name_of_this_machine_with_its_port_is_taken() {
        let hosts = |at: &str| hosts(at.parse().unwrap());
        assert!(hosts("127.0.0.2:8080").contains(&"127.0.0.2:8080".to_string()));
        assert!(hosts("[::1]:8080").contains(&"localhost:8080".to_string()));
        assert!(!hosts("127.0.0.1:8080").contains(&"localhost".to_string()));
        assert!(hosts("127.0.0.1:80").contains(&"localhost".to_string()));
    }
}
