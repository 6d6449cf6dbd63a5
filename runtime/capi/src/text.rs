//! Text in structs of the caller's: bounded, ended by NUL, never cut within a character.

use core::ffi::c_char;
use core::fmt::{self, Display, Write};

/// What a value says, cut off where it is too long.
pub(crate) fn of<const N: usize>(value: impl Display) -> [c_char; N] {
    let mut text = Text {
        bytes: [0; N],
        length: 0,
    };
    // An error says that the text was cut off, which is documented.
    let _ = write!(text, "{value}");
    text.bytes.map(|byte| byte as c_char)
}

struct Text<const N: usize> {
    bytes: [u8; N],
    length: usize,
}

impl<const N: usize> Write for Text<N> {
    fn write_str(&mut self, more: &str) -> fmt::Result {
        let room = N - 1 - self.length;
        let taken = more.floor_char_boundary(room);
        self.bytes[self.length..][..taken].copy_from_slice(&more.as_bytes()[..taken]);
        self.length += taken;
        if taken == more.len() { Ok(()) } else { Err(fmt::Error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_cut_between_characters_and_ends_with_nul() {
        let bytes = |text: &str| of::<8>(text).map(|byte| byte as u8);
        assert_eq!(bytes("sevenbb"), *b"sevenbb\0");
        assert_eq!(bytes("eightbbb"), *b"eightbb\0");
        assert_eq!(bytes("sixxxxé"), *b"sixxxx\0\0");
        assert_eq!(bytes(""), [0; 8]);
    }
}
