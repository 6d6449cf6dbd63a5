//! The table that gives a named knob its number: labels of lines and OSC addresses in order of appearance, names of a
//! HELLO by their index. Beside the parsers; what it holds can be read back for a user interface or a mapping file.

use core::fmt;

/// Names that lines and packets keep. Knobs beyond work by number.
pub const NAMES_MAX: usize = 64;
/// Names that OSC keeps: a tracked face alone has 52.
pub const OSC_NAMES_MAX: usize = 256;
/// Bytes of a name that are kept. Of a longer one the end is kept behind a `~`, because the ends of addresses differ.
pub const NAME_BYTES_MAX: usize = 32;

/// FNV-1a, the hash by which whole names are compared.
const HASH_START: u32 = 0x811c_9dc5;
const HASH_PRIME: u32 = 0x0100_0193;

/// Hash of a whole name.
pub(super) fn hash(name: impl Iterator<Item = u8>) -> u32 {
    name.fold(HASH_START, |hash, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(HASH_PRIME)
    })
}

/// What is kept of a knob's name.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Name {
    text: [u8; NAME_BYTES_MAX],
    bytes: u8,
}

impl Name {
    const EMPTY: Self = Self {
        text: [0; NAME_BYTES_MAX],
        bytes: 0,
    };

    /// A name, cut as the table cuts it.
    pub fn new(name: &str) -> Self {
        Entry::new(&[name.as_bytes()]).name
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        // What is kept of UTF-8 is UTF-8, but devices may send anything.
        core::str::from_utf8(&self.text[..usize::from(self.bytes)]).unwrap_or("")
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_str().fmt(out)
    }
}

impl fmt::Display for Name {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.as_str())
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Entry {
    /// Of the whole name, not just of the part that is kept.
    hash: u32,
    full_bytes: u32,
    name: Name,
}

impl Entry {
    const EMPTY: Self = Self {
        hash: 0,
        full_bytes: 0,
        name: Name::EMPTY,
    };

    /// `parts` in a row are one UTF-8 text.
    fn new(parts: &[&[u8]]) -> Self {
        let all = || parts.iter().flat_map(|part| part.iter().copied());
        let full_bytes = all().count();
        let mut name = Name::EMPTY;
        let mut length = 0;
        let mut skip = 0;
        if full_bytes > NAME_BYTES_MAX {
            name.text[0] = b'~';
            length = 1;
            skip = full_bytes + 1 - NAME_BYTES_MAX;
        }
        // A continuation byte at the cut would leave half a character.
        for byte in all().skip(skip).skip_while(|byte| skip > 0 && byte & 0xc0 == 0x80) {
            name.text[length] = byte;
            length += 1;
        }
        name.bytes = length as u8;
        Self {
            hash: hash(all()),
            full_bytes: u32::try_from(full_bytes).unwrap_or(u32::MAX),
            name,
        }
    }
}

/// Names of knobs, by number; `N` are kept.
#[derive(Debug, Clone)]
pub(super) struct Names<const N: usize> {
    entries: [Entry; N],
    count: usize,
}

impl<const N: usize> Names<N> {
    pub(super) const fn new() -> Self {
        Self {
            entries: [Entry::EMPTY; N],
            count: 0,
        }
    }

    /// Number of the knob whose name is the parts in a row, a new one for a new name, and whether the table knows it.
    ///
    /// With the table full, the number comes from the name alone (`N` and above): the same on every run, and never that of a
    /// knob in the table. Two such names meet with a chance of 1 in 65,536 less `N`.
    pub(super) fn number(&mut self, parts: &[&[u8]]) -> (u16, bool) {
        let wanted = Entry::new(parts);
        if let Some(known) = self.entries[..self.count].iter().position(|entry| *entry == wanted) {
            return (known as u16, true);
        }
        if self.count < N {
            self.entries[self.count] = wanted;
            self.count += 1;
            return ((self.count - 1) as u16, true);
        }
        let numbers_left = u32::from(u16::MAX) + 1 - N as u32;
        ((N as u32 + wanted.hash % numbers_left) as u16, false)
    }

    /// Names one knob; an empty name takes its name away. Returns whether the table has room for it.
    pub(super) fn set(&mut self, knob: usize, name: &[u8]) -> bool {
        let Some(entry) = self.entries.get_mut(knob) else {
            return name.is_empty();
        };
        *entry = Entry::new(&[name]);
        self.count = self.count.max(knob + 1);
        true
    }

    pub(super) fn get(&self, knob: u16) -> Option<&Name> {
        let entry = self.entries[..self.count].get(usize::from(knob))?;
        Some(&entry.name).filter(|name| !name.as_str().is_empty())
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.entries = [Entry::EMPTY; N];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn numbers_follow_the_order_of_appearance() {
        let mut names = Names::<NAMES_MAX>::new();
        assert_eq!(names.number(&[b"jaw"]), (0, true));
        assert_eq!(names.number(&[b"br", b"ow"]), (1, true));
        assert_eq!(names.number(&[b"brow"]), (1, true));
        assert_eq!(names.get(1).map(Name::as_str), Some("brow"));
        assert_eq!(names.get(2), None);
    }

    #[test]
    fn long_names_keep_their_ends_and_stay_apart() {
        let mut names = Names::<NAMES_MAX>::new();
        let long = |first: char| format!("/{first}/avatar/parameters/v2/MouthSmileLeft");
        assert_eq!(names.number(&[long('a').as_bytes()]), (0, true));
        assert_eq!(names.number(&[long('b').as_bytes()]), (1, true));
        assert_eq!(names.number(&[long('a').as_bytes()]), (0, true));
        assert_eq!(names.get(0).map(Name::as_str), Some("~ar/parameters/v2/MouthSmileLeft"));
        let umlauts = "ü".repeat(30);
        let (knob, _) = names.number(&[umlauts.as_bytes()]);
        assert_eq!(names.get(knob), Some(&Name::new(&umlauts)));
        assert_eq!(Name::new(&umlauts).as_str(), format!("~{}", "ü".repeat(15)));
    }

    #[test]
    fn a_full_table_still_numbers() {
        let mut names = Names::<NAMES_MAX>::new();
        for i in 0..NAMES_MAX {
            assert_eq!(names.number(&[format!("k{i}").as_bytes()]), (i as u16, true));
        }
        let (knob, known) = names.number(&[b"one more"]);
        assert!(!known && usize::from(knob) >= NAMES_MAX);
        assert_eq!(names.number(&[b"one more"]), (knob, false));
        assert_eq!(names.number(&[b"k5"]), (5, true));
        assert_eq!(names.get(knob), None);
    }
}
