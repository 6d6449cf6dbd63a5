//! One browser's connection: the head of its request, then a file on its way out, or a WebSocket. Nothing here waits; every buffer
//! has a limit, and every state a time after which the connection is given up.

use core::time::Duration;
use std::io::{self, ErrorKind, Read, Write};
use std::net::Shutdown;
use std::sync::Arc;
use std::time::Instant;

use mio::net::TcpStream;
use sinew_formats::package::AlignedBytes;
use tungstenite::protocol::{Message, Role, WebSocket, WebSocketConfig};
use tungstenite::{Bytes, Utf8Bytes};

use super::http::{Answer, Body, Door, HEAD_BYTES_MAX};

/// Time for the head of a request, and without progress of an answer.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// A page that has not taken a frame for so long, or not answered a ping, is gone.
const STALL_TIME: Duration = Duration::from_secs(20);
const PING_TIME: Duration = Duration::from_secs(5);
/// Longest message from a page: weights of some thousand components.
const MESSAGE_BYTES_MAX: usize = 64 * 1024;
/// What may wait for a page: a frame of the largest package, its knobs and a state.
const BACKLOG_BYTES: usize = 256 * 1024;
/// Messages that are read of one page between two frames.
const MESSAGES_MAX: usize = 64;

/// Why a connection ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gone {
    /// It was answered, or it left.
    Done,
    /// It sent what no page sends, or nothing in time.
    Refused,
}

impl From<io::Error> for Gone {
    fn from(_: io::Error) -> Self {
        Self::Done
    }
}

enum State {
    Head(Vec<u8>),
    Answer { head: Vec<u8>, body: Body, sent: usize },
    Page(Box<Page>),
}

/// A page that is connected.
struct Page {
    socket: WebSocket<TcpStream>,
    /// A message waits for room in the socket.
    is_behind: bool,
    /// When the last of what was written was taken.
    taken: Instant,
    heard: Instant,
    pinged: Instant,
}

/// One connection.
pub struct Client {
    stream: Option<TcpStream>,
    state: State,
    /// When this state began, or last made progress.
    since: Instant,
    /// Frames that it was too slow for.
    pub dropped: u64,
    /// Number of the newest state that it was sent; 0 before the first.
    pub state_number: u64,
    /// Whether it was too slow for the newest frame.
    pub missed_frame: bool,
}

impl Client {
    /// A connection that has just been accepted.
    pub fn new(stream: TcpStream, now: Instant) -> Self {
        Self {
            stream: Some(stream),
            state: State::Head(Vec::new()),
            since: now,
            dropped: 0,
            state_number: 0,
            missed_frame: false,
        }
    }

    /// Whether it is a page.
    pub fn is_page(&self) -> bool {
        matches!(self.state, State::Page(_))
    }

    /// The socket, to be watched.
    pub fn stream(&mut self) -> &mut TcpStream {
        match &mut self.state {
            State::Page(page) => page.socket.get_mut(),
            _ => self.stream.as_mut().expect("only a page takes the stream over"),
        }
    }

    /// Goes on as far as it can without waiting. `hear` gets what a page says.
    ///
    /// # Errors
    /// The connection is over.
    pub fn advance(
        &mut self,
        now: Instant,
        door: &Door,
        package: &Arc<AlignedBytes>,
        hear: &mut dyn FnMut(&str) -> bool,
    ) -> Result<(), Gone> {
        if let State::Head(_) = self.state {
            self.read_head(now, door)?;
        }
        match &mut self.state {
            State::Head(_) => {
                if now.duration_since(self.since) > HEAD_TIME {
                    return Err(Gone::Refused);
                }
            }
            State::Answer { head, body, sent } => {
                let body = match body {
                    Body::Bytes(bytes) => bytes,
                    Body::Package => &package[..],
                };
                let stream = self.stream.as_mut().ok_or(Gone::Done)?;
                let before = *sent;
                send(stream, head, body, sent)?;
                if *sent > before {
                    self.since = now;
                } else if now.duration_since(self.since) > HEAD_TIME {
                    return Err(Gone::Done);
                }
            }
            State::Page(page) => page.advance(now, hear)?,
        }
        Ok(())
    }

    fn read_head(&mut self, now: Instant, door: &Door) -> Result<(), Gone> {
        let State::Head(bytes) = &mut self.state else {
            return Ok(());
        };
        let stream = self.stream.as_mut().ok_or(Gone::Done)?;
        let mut buffer = [0; 1024];
        loop {
            let room = (HEAD_BYTES_MAX - bytes.len()).min(buffer.len());
            match stream.read(&mut buffer[..room]) {
                Ok(0) => return Err(Gone::Done),
                Ok(read) => bytes.extend_from_slice(&buffer[..read]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(error.into()),
            }
            match door.answer(bytes) {
                None => {}
                Some(Answer::Send { head, body }) => {
                    self.state = State::Answer { head, body, sent: 0 };
                    self.since = now;
                    return Ok(());
                }
                Some(Answer::Upgrade { head }) => {
                    // A few bytes into an empty socket: they go or it is gone.
                    stream.write_all(&head)?;
                    // Each frame is small and wanted now.
                    stream.set_nodelay(true)?;
                    let stream = self.stream.take().ok_or(Gone::Done)?;
                    self.state = State::Page(Box::new(Page::new(stream, now)));
                    return Ok(());
                }
            }
        }
    }

    /// Gives a page a message, unless it is still at an older one: then it is left out.
    ///
    /// # Errors
    /// The connection is over.
    pub fn offer(&mut self, message: Message) -> Result<bool, Gone> {
        let State::Page(page) = &mut self.state else {
            return Ok(false);
        };
        page.flush()?;
        if page.is_behind {
            self.dropped += 1;
            return Ok(false);
        }
        match page.socket.write(message) {
            Ok(()) => {}
            Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => page.is_behind = true,
            Err(_) => return Err(Gone::Done),
        }
        page.flush()?;
        Ok(true)
    }

    /// Says goodbye to a page.
    pub fn close(&mut self) {
        match &mut self.state {
            State::Page(page) => {
                // Whether it hears it or not.
                let _ = page.socket.close(None);
                let _ = page.socket.flush();
            }
            _ => drop(self.stream.as_ref().map(|stream| stream.shutdown(Shutdown::Both))),
        }
    }
}

/// Sends what a socket takes of head and body.
fn send(stream: &mut TcpStream, head: &[u8], body: &[u8], sent: &mut usize) -> Result<(), Gone> {
    loop {
        let rest = match head.get(*sent..) {
            Some(rest) if !rest.is_empty() => rest,
            _ => &body[*sent - head.len()..],
        };
        if rest.is_empty() {
            stream.shutdown(Shutdown::Write)?;
            return Err(Gone::Done);
        }
        match stream.write(rest) {
            Ok(taken) => *sent += taken,
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
}

impl Page {
    fn new(stream: TcpStream, now: Instant) -> Self {
        let config = WebSocketConfig::default()
            .read_buffer_size(4 * 1024)
            .write_buffer_size(0)
            .max_write_buffer_size(BACKLOG_BYTES)
            .max_message_size(Some(MESSAGE_BYTES_MAX))
            .max_frame_size(Some(MESSAGE_BYTES_MAX));
        Self {
            socket: WebSocket::from_raw_socket(stream, Role::Server, Some(config)),
            is_behind: false,
            taken: now,
            heard: now,
            pinged: now,
        }
    }

    fn advance(&mut self, now: Instant, hear: &mut dyn FnMut(&str) -> bool) -> Result<(), Gone> {
        for _ in 0..MESSAGES_MAX {
            match self.socket.read() {
                Ok(Message::Text(text)) if hear(&text) => self.heard = now,
                Ok(Message::Text(_) | Message::Binary(_) | Message::Frame(_)) => return Err(Gone::Refused),
                Ok(Message::Ping(_) | Message::Pong(_)) => self.heard = now,
                Ok(Message::Close(_)) => {
                    // The answer is in the buffer; it goes out or not.
                    let _ = self.socket.flush();
                    return Err(Gone::Done);
                }
                Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => break,
                Err(tungstenite::Error::Io(_) | tungstenite::Error::ConnectionClosed) => return Err(Gone::Done),
                Err(_) => return Err(Gone::Refused),
            }
        }
        self.flush()?;
        if !self.is_behind {
            self.taken = now;
        }
        if now.duration_since(self.heard) > PING_TIME && now.duration_since(self.pinged) > PING_TIME && !self.is_behind
        {
            self.pinged = now;
            // One that cannot be written now is behind, and counts as that.
            let _ = self.socket.write(Message::Ping(Bytes::new()));
            self.flush()?;
        }
        let is_gone = now.duration_since(self.taken) > STALL_TIME || now.duration_since(self.heard) > STALL_TIME;
        if is_gone { Err(Gone::Done) } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), Gone> {
        match self.socket.flush() {
            Ok(()) => self.is_behind = false,
            Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => self.is_behind = true,
            Err(_) => return Err(Gone::Done),
        }
        Ok(())
    }
}

/// A text message that many pages share.
pub fn text(value: &serde_json::Value) -> Message {
    Message::Text(Utf8Bytes::from(value.to_string()))
}
