//! The sentence that goes with a refusal, in memory of its own.

use core::cell::UnsafeCell;
use core::fmt::{self, Write};

/// Longer messages are cut at a character.
const LIMIT_BYTES: usize = 512;

struct Text {
    bytes: [u8; LIMIT_BYTES],
    length: usize,
}

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = LIMIT_BYTES - self.length;
        let taken = text.floor_char_boundary(room);
        self.bytes[self.length..][..taken].copy_from_slice(&text.as_bytes()[..taken]);
        self.length += taken;
        if taken < text.len() { Err(fmt::Error) } else { Ok(()) }
    }
}

struct Slot(UnsafeCell<Text>);

// SAFETY: the module is built without threads, so that only one call is ever inside.
unsafe impl Sync for Slot {}

static MESSAGE: Slot = Slot(UnsafeCell::new(Text {
    bytes: [0; LIMIT_BYTES],
    length: 0,
}));

/// Replaces the message.
pub(crate) fn set(reason: &dyn fmt::Display) {
    // SAFETY: one thread, and the reference does not outlive this call; `reason` cannot reach this module.
    let text = unsafe { &mut *MESSAGE.0.get() };
    text.length = 0;
    // A message that is too long is cut, which is no error.
    let _ = write!(text, "{reason}");
}

/// The message. Empty before the first refusal.
pub(crate) fn bytes() -> &'static [u8] {
    // SAFETY: one thread; the slice is turned into an address or a length before `set` can run.
    let text = unsafe { &*MESSAGE.0.get() };
    &text.bytes[..text.length]
}
