//! The page: serves `runtime/web` to any browser and speaks with it over a WebSocket, so that a performance is seen, and moved by
//! mouse and touch, on as many screens as there are.
//!
//! Path of data: the frame loop publishes on its board and wakes the thread of the [`Server`] -> a message of weights to every
//! page, which solves the mesh itself; what a page asks -> the queue of requests -> the frame loop. A page that reads slowly
//! loses frames and costs nobody else anything.

mod address;
mod client;
mod files;
mod http;
mod message;
mod server;

pub use address::{PageAddress, Token};
pub use message::{Ask, FRAME_VERSION, encode_frame, hello, read_ask, state};
pub use server::{PageSummary, Served, Server};
