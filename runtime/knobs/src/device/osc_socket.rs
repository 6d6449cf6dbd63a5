//! OSC over UDP: a thread of its own receives the datagrams, the core's parser reads them.

use core::fmt;
use core::net::{Ipv4Addr, SocketAddr};
use core::time::Duration;
use std::io;
use std::net::UdpSocket;
use std::string::{String, ToString};
use std::vec;

use super::feeder::{Device, feeder};
use super::status::DeviceStatus;
use super::worker::Worker;
use super::{Clock, QUEUE_EVENTS};
use crate::protocol::{DecoderSettings, Protocol};
use crate::{ControlSource, SourceEvent};

/// Longest that a wait for a datagram takes, and so what dropping a source may take.
const RECEIVE_TIMEOUT: Duration = Duration::from_millis(5);
/// The largest datagram there is.
const DATAGRAM_BYTES: usize = 65_536;

/// Where OSC is received, and how it is read.
#[derive(Debug, Clone, Copy)]
pub struct OscSettings {
    /// Address and port to receive on. Default `127.0.0.1:9000`: this machine alone; `0.0.0.0` or an address of this machine
    /// lets others in. Port 0 takes a free one.
    pub address: SocketAddr,
    /// What the decoder cannot learn from the bytes.
    pub decoding: DecoderSettings,
    /// Events that may wait for the frame. Default [`QUEUE_EVENTS`].
    pub queue_events: usize,
}

impl Default for OscSettings {
    fn default() -> Self {
        Self {
            address: SocketAddr::from((Ipv4Addr::LOCALHOST, 9000)),
            decoding: DecoderSettings::default(),
            queue_events: QUEUE_EVENTS,
        }
    }
}

/// Why OSC is not received.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum OscError {
    /// Another program receives there.
    InUse {
        /// The address asked for.
        address: SocketAddr,
    },
    /// The address was refused for another reason: not one of this machine, or a port that needs rights.
    NotBound {
        /// The address asked for.
        address: SocketAddr,
        /// What the system says.
        reason: String,
    },
    /// The thread did not start.
    NoThread {
        /// What the system says.
        reason: String,
    },
}

impl core::error::Error for OscError {}

impl fmt::Display for OscError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InUse { address } => write!(
                out,
                "another program receives on UDP {address}; close it or choose another port"
            ),
            Self::NotBound { address, reason } => write!(out, "OSC cannot be received on UDP {address}: {reason}"),
            Self::NoThread { reason } => write!(out, "the thread that receives OSC did not start: {reason}"),
        }
    }
}

/// Whatever sends OSC to a port of this machine. Numbers of knobs are addresses in order of appearance. A socket does not tell when a
/// sender goes; [`Failsafe::silence_us`](crate::Failsafe::silence_us) does.
#[derive(Debug)]
pub struct OscSource {
    device: Device,
    address: SocketAddr,
}

impl OscSource {
    /// Begins to receive; times are those of `clock`.
    ///
    /// # Errors
    /// [`OscError`].
    pub fn open(settings: OscSettings, clock: Clock) -> Result<Self, OscError> {
        let asked = settings.address;
        let bind = || {
            let socket = UdpSocket::bind(asked)?;
            socket.set_read_timeout(Some(RECEIVE_TIMEOUT))?;
            Ok((socket.local_addr()?, socket))
        };
        let (address, socket) = bind().map_err(|error: io::Error| match error.kind() {
            io::ErrorKind::AddrInUse => OscError::InUse { address: asked },
            _ => OscError::NotBound {
                address: asked,
                reason: error.to_string(),
            },
        })?;
        let protocol = Some(Protocol::Osc);
        let name = address.to_string();
        let (mut feeder, reader, board) =
            feeder(protocol, settings.decoding, clock, settings.queue_events, name.clone());
        feeder.opened(&name, None);
        let worker = Worker::start("sinew-osc", move |halt| {
            let mut datagram = vec![0; DATAGRAM_BYTES];
            while !halt.asked() {
                match socket.recv_from(&mut datagram) {
                    Ok((count, _)) => feeder.feed_packet(&datagram[..count]),
                    Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {}
                    // Such as a note that somebody else's port is closed: of no interest, but no reason to spin.
                    Err(error) => {
                        feeder.failed(error.to_string());
                        halt.sleep(RECEIVE_TIMEOUT);
                    }
                }
                feeder.idle();
            }
        });
        let worker = worker.map_err(|error| OscError::NoThread {
            reason: error.to_string(),
        })?;
        Ok(Self {
            device: Device::new(reader, board, worker),
            address,
        })
    }

    /// The address received on, with the port that was taken.
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Everything that is known of the senders, for people; takes a lock and allocates, so not for the frame.
    pub fn device_status(&self) -> DeviceStatus {
        self.device.status()
    }
}

impl ControlSource for OscSource {
    fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent)) {
        self.device.poll(now_us, sink);
    }
}

#[cfg(test)]
mod tests;
