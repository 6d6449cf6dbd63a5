//! The thread of the page: one loop over all connections, woken by the frame loop and by the sockets.

use core::fmt;
use core::time::Duration;
use std::collections::HashMap;
use std::io::ErrorKind;
use std::net::TcpListener as StdListener;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use crossbeam::channel::Sender;
use miette::{IntoDiagnostic, Report, WrapErr};
use mio::net::TcpListener;
use mio::{Events, Interest, Poll, Token as Key, Waker};
use serde_json::Value;
use sinew_formats::package::AlignedBytes;
use tungstenite::Bytes;
use tungstenite::protocol::Message;

use super::address::{PageAddress, Token};
use super::client::{Client, Gone, text};
use super::http::Door;
use super::message::{encode_frame, hello, read_ask, state};
use crate::count::count;
use crate::snapshot::{Board, Labels, Request};

const LISTENER: Key = Key(0);
const WAKER: Key = Key(1);
/// Connections at once; one more is closed as it comes.
const CLIENTS_MAX: usize = 64;
/// Time between two states.
const STATE_TIME: Duration = Duration::from_millis(100);
/// How long the loop sleeps when nothing happens.
const SLEEP: Duration = Duration::from_millis(250);

/// What is served.
pub struct Served {
    /// The package, baked.
    pub package: Arc<AlignedBytes>,
    /// What does not change.
    pub labels: Labels,
    /// What does.
    pub board: Arc<Board>,
    /// Where what the pages ask for goes. Bounded: what a full queue has no room for is left out and counted.
    pub requests: Sender<Request>,
    /// Whether a take is replayed, which nobody can move.
    pub is_replay: bool,
}

/// How the page did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PageSummary {
    /// Pages that connected.
    pub pages: u64,
    /// Most of them at once.
    pub pages_max: usize,
    /// Messages to them.
    pub sent: u64,
    /// Messages left out because a page was slow.
    pub dropped: u64,
    /// Connections that sent what no page sends, and asks that made no sense or found the queue full.
    pub refused: u64,
}

impl fmt::Display for PageSummary {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            out,
            "page: opened {}, {} at once, {} sent, {} left out, {} refused",
            count(self.pages, "time"),
            self.pages_max,
            count(self.sent, "message"),
            self.dropped,
            self.refused
        )
    }
}

/// The page, being served until [`Server::finish`].
pub struct Server {
    url: String,
    board: Arc<Board>,
    summary: Arc<Mutex<PageSummary>>,
    thread: JoinHandle<()>,
}

impl Server {
    /// Starts to serve.
    ///
    /// # Errors
    /// The address cannot be listened on; the system has no thread left.
    pub fn start(address: PageAddress, served: Served) -> Result<Self, Report> {
        let cannot = || {
            format!(
                "the page cannot be served at {}: --page 0 takes any free port",
                address.0
            )
        };
        let listener = StdListener::bind(address.0).into_diagnostic().wrap_err_with(cannot)?;
        listener.set_nonblocking(true).into_diagnostic().wrap_err_with(cannot)?;
        let address = PageAddress(listener.local_addr().into_diagnostic().wrap_err_with(cannot)?);
        let token = if address.is_loopback() {
            None
        } else {
            Some(Token::random()?)
        };
        let url = address.url(token.as_ref());
        let poll = Poll::new().into_diagnostic()?;
        let waker = Arc::new(Waker::new(poll.registry(), WAKER).into_diagnostic()?);
        let (board, summary) = (Arc::clone(&served.board), Arc::new(Mutex::new(PageSummary::default())));
        let door = Door {
            token,
            is_loopback: address.is_loopback(),
            package_bytes: served.package.len(),
        };
        let mut listener = TcpListener::from_std(listener);
        poll.registry()
            .register(&mut listener, LISTENER, Interest::READABLE)
            .into_diagnostic()?;
        let mut serving = Serving {
            hello: text(&hello(&served.labels, served.is_replay)),
            served,
            door,
            poll,
            listener,
            clients: HashMap::new(),
            next_key: WAKER.0 + 1,
            summary: PageSummary::default(),
            shared: Arc::clone(&summary),
            frame: None,
            newest: None,
            state: Value::Null,
            state_number: 0,
            state_at: None,
        };
        board.on_publish(move || {
            // A loop that cannot be woken wakes by itself, four times a second.
            let _ = waker.wake();
        });
        let thread = thread::Builder::new()
            .name("sinew-page".to_owned())
            .spawn(move || serving.run())
            .into_diagnostic()?;
        Ok(Self {
            url,
            board,
            summary,
            thread,
        })
    }

    /// What to open in a browser.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Waits for the thread, which ends once the board is closed.
    pub fn finish(self) -> PageSummary {
        self.board.wake();
        if self.thread.join().is_err() {
            eprintln!("the page failed");
        }
        *self.summary.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

struct Serving {
    served: Served,
    door: Door,
    poll: Poll,
    listener: TcpListener,
    clients: HashMap<Key, Client>,
    next_key: usize,
    hello: Message,
    summary: PageSummary,
    shared: Arc<Mutex<PageSummary>>,
    /// Number of the last frame that was looked at.
    frame: Option<u64>,
    /// The last frame as it was sent, behind its number.
    newest: Option<Bytes>,
    state: Value,
    state_number: u64,
    state_at: Option<Instant>,
}

impl Serving {
    fn run(&mut self) {
        let mut events = Events::with_capacity(128);
        while !self.served.board.is_closed() {
            if let Err(error) = self.poll.poll(&mut events, Some(SLEEP))
                && error.kind() != ErrorKind::Interrupted
            {
                eprintln!("the page ended: {error}");
                break;
            }
            let now = Instant::now();
            if events.iter().any(|event| event.token() == LISTENER) {
                self.accept(now);
            }
            self.advance(now);
            self.publish(now);
            *self.shared.lock().unwrap_or_else(PoisonError::into_inner) = self.summary;
        }
        self.clients.values_mut().for_each(Client::close);
    }

    fn accept(&mut self, now: Instant) {
        while let Ok((mut stream, _)) = self.listener.accept() {
            if self.clients.len() >= CLIENTS_MAX {
                self.summary.refused += 1;
                continue;
            }
            let key = Key(self.next_key);
            self.next_key += 1;
            let interest = Interest::READABLE | Interest::WRITABLE;
            if self.poll.registry().register(&mut stream, key, interest).is_ok() {
                self.clients.insert(key, Client::new(stream, now));
            }
        }
    }

    /// Hears all connections, and gives up those that are over.
    fn advance(&mut self, now: Instant) {
        let component_count = self.served.labels.components.len();
        let mut asked = Vec::new();
        let (requests, door, package) = (&self.served.requests, &self.door, &self.served.package);
        let (summary, hello, registry) = (&mut self.summary, &self.hello, self.poll.registry());
        self.clients.retain(|_, client| {
            let was_page = client.is_page();
            let mut left_out = 0;
            let mut hear = |text: &str| match read_ask(text, component_count, &mut asked) {
                Ok(()) => {
                    left_out += asked
                        .drain(..)
                        .filter(|request| requests.try_send(*request).is_err())
                        .count() as u64;
                    true
                }
                Err(_) => false,
            };
            let mut outcome = client.advance(now, door, package, &mut hear);
            summary.refused += left_out;
            if outcome.is_ok() && client.is_page() && !was_page {
                summary.pages += 1;
                outcome = client.offer(hello.clone()).map(drop);
                summary.sent += 1;
            }
            match outcome {
                Ok(()) => true,
                Err(gone) => {
                    summary.refused += u64::from(gone == Gone::Refused);
                    summary.dropped += client.dropped;
                    client.close();
                    // It leaves with its descriptor in any case.
                    let _ = registry.deregister(client.stream());
                    false
                }
            }
        });
        let pages = self.clients.values().filter(|client| client.is_page()).count();
        self.summary.pages_max = self.summary.pages_max.max(pages);
    }

    /// Sends the newest frame and state to every page that has not seen them.
    fn publish(&mut self, now: Instant) {
        if !self.clients.values().any(Client::is_page) {
            // The first page that comes gets the next frame whole.
            self.newest = None;
            return;
        }
        let snapshot = self.served.board.read();
        let mut frame = None;
        if self.frame != Some(snapshot.frames) {
            self.frame = Some(snapshot.frames);
            let bytes = Bytes::from(encode_frame(&snapshot));
            // Behind version and number: a frame in which nothing moved is not worth a message.
            if self.newest.as_ref().is_none_or(|newest| newest[8..] != bytes[8..]) {
                self.newest = Some(bytes.clone());
                frame = Some(bytes);
            }
        }
        if self.state_at.is_none_or(|at| now.duration_since(at) >= STATE_TIME) {
            self.state_at = Some(now);
            let screens = self.clients.values().filter(|client| client.is_page()).count();
            let value = state(&self.served.labels, &snapshot, screens);
            if value != self.state {
                self.state = value;
                self.state_number += 1;
            }
        }
        let number = self.state_number;
        let mut state_message = None;
        for client in self.clients.values_mut().filter(|client| client.is_page()) {
            let is_new = client.state_number == 0;
            // One that comes late, or was behind, gets the frame that the others have.
            let bytes = if is_new || client.missed_frame {
                self.newest.clone()
            } else {
                frame.clone()
            };
            if let Some(bytes) = bytes {
                let sent = client.offer(Message::Binary(bytes));
                client.missed_frame = sent != Ok(true);
                self.summary.sent += u64::from(sent == Ok(true));
            }
            if client.state_number != number {
                let message = state_message.get_or_insert_with(|| text(&self.state));
                if client.offer(message.clone()) == Ok(true) {
                    client.state_number = number;
                    self.summary.sent += 1;
                }
            }
        }
    }
}
