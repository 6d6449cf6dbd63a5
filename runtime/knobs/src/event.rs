//! What a control device says, whatever its protocol: this knob stands there, or was turned by so much. Between the
//! protocols, which make these events, and everything that gives a knob its feel.

/// One reading of one knob.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct KnobEvent {
    /// Address of the knob on its device; the protocol says what it counts (columns, controllers, pins, names in order of
    /// appearance).
    pub knob: u16,
    /// What it reads.
    pub reading: Reading,
}

/// What a knob says of itself. Integers as the device sent them, so that a recording replays to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reading {
    /// It stands at `value` of `full_scale`. Range: `0 <= value <= full_scale`, `full_scale >= 1`.
    Position {
        /// Steps from the lower end of the converter.
        value: u16,
        /// The largest value that this device sends: 1023 for ten bits.
        full_scale: u16,
    },
    /// It was turned by this many steps; clockwise is positive. Encoders know no position.
    Steps(i16),
}
