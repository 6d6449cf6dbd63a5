//! Input: from the bytes of a knob box to the weights of the components, without a heap and without ever blocking.
//!
//! Path of data: bytes in any chunking -> protocol -> [`KnobEvent`] -> calibration, filter, takeover, map -> [`crate::Controls`].

mod counters;
mod event;
pub mod protocol;

pub use counters::{Counters, Fault};
pub use event::{KnobEvent, Reading};
pub use protocol::{Decoder, Finding, FullScale, Protocol, Settings};
