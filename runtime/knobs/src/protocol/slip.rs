//! SLIP (RFC 1055): packets in a stream of bytes, each closed by 0xc0. Before [`super::osc`], for OSC over serial.

/// Longest packet.
pub const SLIP_BYTES_MAX: usize = 1024;

/// Closes a packet.
pub(super) const END: u8 = 0xc0;
const ESCAPE: u8 = 0xdb;
const ESCAPED_END: u8 = 0xdc;
const ESCAPED_ESCAPE: u8 = 0xdd;

/// Puts packets together.
#[derive(Debug, Clone)]
pub(super) struct Slip {
    buffer: [u8; SLIP_BYTES_MAX],
    length: usize,
    escaped: bool,
    too_long: bool,
    broken: bool,
}

/// A packet is over.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Packet<'a> {
    Whole(&'a [u8]),
    /// An escape was followed by a byte that cannot follow one.
    Broken,
    TooLong,
}

impl Slip {
    pub(super) const fn new() -> Self {
        Self {
            buffer: [0; SLIP_BYTES_MAX],
            length: 0,
            escaped: false,
            too_long: false,
            broken: false,
        }
    }

    /// Something was read since the last end.
    pub(super) fn pending(&self) -> bool {
        self.length > 0 || self.escaped || self.broken
    }

    pub(super) fn clear(&mut self) {
        (self.length, self.escaped, self.too_long, self.broken) = (0, false, false, false);
    }

    /// Takes a byte; returns the packet that it ends. Empty ones are none: many senders put an end in front as well.
    pub(super) fn push(&mut self, byte: u8) -> Option<Packet<'_>> {
        if byte == END {
            let (length, pending, too_long) = (self.length, self.pending(), self.too_long);
            let broken = self.broken || self.escaped;
            self.clear();
            return pending.then_some(match (broken, too_long) {
                (true, _) => Packet::Broken,
                (false, true) => Packet::TooLong,
                (false, false) => Packet::Whole(&self.buffer[..length]),
            });
        }
        let escaped = core::mem::replace(&mut self.escaped, false);
        let byte = match (escaped, byte) {
            (false, ESCAPE) => {
                self.escaped = true;
                return None;
            }
            (true, ESCAPED_END) => END,
            (true, ESCAPED_ESCAPE) => ESCAPE,
            (true, _) => {
                self.broken = true;
                return None;
            }
            (false, byte) => byte,
        };
        match self.buffer.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length += 1;
            }
            None => self.too_long = true,
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last(bytes: &[u8]) -> Option<(bool, std::vec::Vec<u8>)> {
        let mut slip = Slip::new();
        let mut found = None;
        for &byte in bytes {
            if let Some(packet) = slip.push(byte) {
                found = Some(match packet {
                    Packet::Whole(bytes) => (true, bytes.to_vec()),
                    Packet::Broken | Packet::TooLong => (false, std::vec::Vec::new()),
                });
            }
        }
        found
    }

    #[test]
    fn escapes_and_ends() {
        assert_eq!(last(b"\xc0\xc0\xc0"), None);
        assert_eq!(
            last(b"\xc0ab\xdb\xdc\xdb\xddc\xc0"),
            Some((true, b"ab\xc0\xdbc".to_vec()))
        );
        for broken in [&b"a\xdbb\xc0"[..], b"a\xdb\xc0", b"\xdb\xc0", b"\xdb\xdb\xc0"] {
            assert_eq!(last(broken), Some((false, std::vec::Vec::new())), "{broken:?}");
        }
        let mut long = std::vec![b'x'; SLIP_BYTES_MAX];
        long.push(END);
        assert_eq!(last(&long).unwrap().1.len(), SLIP_BYTES_MAX);
        long.insert(0, b'x');
        assert!(!last(&long).unwrap().0);
    }
}
