//! Layout of the datagrams: a head of 28 bytes, then floats, little endian; one frame takes as many datagrams as it needs.

/// Floats of a datagram: with its head it stays under an Ethernet frame. A multiple of three: no vertex is cut.
pub const DATAGRAM_FLOATS: usize = 348;

/// Starts every datagram.
const MAGIC: [u8; 4] = *b"SNST";

/// What the floats are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Weights of the components.
    Weights = 0,
    /// x, y, z of each vertex.
    Positions = 1,
}

/// Writes the datagrams of one frame, one after the other, into `buffer` and hands each to `send`.
///
/// # Errors
/// The first of `send`; the rest of the frame is not sent.
pub fn write_datagrams<E>(
    kind: Kind,
    frame: u64,
    at_us: u64,
    values: &[f32],
    buffer: &mut Vec<u8>,
    mut send: impl FnMut(&[u8]) -> Result<(), E>,
) -> Result<(), E> {
    for (n, chunk) in values.chunks(DATAGRAM_FLOATS).enumerate() {
        buffer.clear();
        buffer.extend_from_slice(&MAGIC);
        // Version, kind, two bytes for later.
        buffer.extend_from_slice(&[1, kind as u8, 0, 0]);
        // The number wraps after two years at sixty frames a second.
        buffer.extend_from_slice(&(frame as u32).to_le_bytes());
        buffer.extend_from_slice(&((n * DATAGRAM_FLOATS) as u32).to_le_bytes());
        buffer.extend_from_slice(&at_us.to_le_bytes());
        buffer.extend_from_slice(&(values.len() as u32).to_le_bytes());
        for value in chunk {
            buffer.extend_from_slice(&value.to_le_bytes());
        }
        send(buffer)?;
    }
    Ok(())
}
