//! The table that gives a named knob its number: labels of lines and OSC addresses in order of appearance, names of a
//! HELLO by their index. Beside the parsers; what it holds can be read back for a user interface or a mapping file.

/// Names that are kept. Knobs beyond work by number.
pub const NAMES_MAX: usize = 64;
/// Bytes of a name that are kept. Of a longer one the end is kept behind a `~`, because the ends of addresses differ.
pub const NAME_BYTES_MAX: usize = 32;

#[derive(Debug, Clone, Copy)]
struct Entry {
    /// FNV-1a of the whole name, not just of the part that is kept.
    hash: u32,
    full_bytes: u32,
    kept_bytes: u8,
    text: [u8; NAME_BYTES_MAX],
}

impl Entry {
    const EMPTY: Self = Self {
        hash: 0,
        full_bytes: 0,
        kept_bytes: 0,
        text: [0; NAME_BYTES_MAX],
    };

    /// `parts` in a row are one UTF-8 text.
    fn new(parts: &[&[u8]]) -> Self {
        let mut entry = Self {
            hash: 0x811c_9dc5,
            ..Self::EMPTY
        };
        let all = || parts.iter().flat_map(|part| part.iter().copied());
        for byte in all() {
            entry.hash = (entry.hash ^ u32::from(byte)).wrapping_mul(0x0100_0193);
            entry.full_bytes = entry.full_bytes.saturating_add(1);
        }
        let full_bytes = entry.full_bytes as usize;
        let mut length = 0;
        let mut skip = 0;
        if full_bytes > NAME_BYTES_MAX {
            entry.text[0] = b'~';
            length = 1;
            skip = full_bytes + 1 - NAME_BYTES_MAX;
        }
        // A continuation byte at the cut would leave half a character.
        for byte in all().skip(skip).skip_while(|byte| skip > 0 && byte & 0xc0 == 0x80) {
            entry.text[length] = byte;
            length += 1;
        }
        entry.kept_bytes = length as u8;
        entry
    }

    fn text(&self) -> &[u8] {
        &self.text[..usize::from(self.kept_bytes)]
    }

    fn is(&self, other: &Self) -> bool {
        self.hash == other.hash && self.full_bytes == other.full_bytes && self.text() == other.text()
    }
}

/// Names of knobs, by number.
#[derive(Debug, Clone)]
pub(super) struct Names {
    entries: [Entry; NAMES_MAX],
    count: usize,
}

impl Names {
    pub(super) const fn new() -> Self {
        Self {
            entries: [Entry::EMPTY; NAMES_MAX],
            count: 0,
        }
    }

    /// Number of the knob whose name is the parts in a row, a new one for a new name, and whether the table knows it.
    ///
    /// With the table full, the number comes from the name alone (`NAMES_MAX` and above): the same on every run, and
    /// never that of a knob in the table. Two such names meet with a chance of 1 in 65472.
    pub(super) fn number(&mut self, parts: &[&[u8]]) -> (u16, bool) {
        let wanted = Entry::new(parts);
        if let Some(known) = self.entries[..self.count].iter().position(|entry| entry.is(&wanted)) {
            return (known as u16, true);
        }
        if self.count < NAMES_MAX {
            self.entries[self.count] = wanted;
            self.count += 1;
            return ((self.count - 1) as u16, true);
        }
        let numbers_left = u32::from(u16::MAX) + 1 - NAMES_MAX as u32;
        ((NAMES_MAX as u32 + wanted.hash % numbers_left) as u16, false)
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

    pub(super) fn get(&self, knob: u16) -> Option<&str> {
        let entry = self.entries[..self.count].get(usize::from(knob))?;
        core::str::from_utf8(entry.text()).ok().filter(|name| !name.is_empty())
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.entries = [Entry::EMPTY; NAMES_MAX];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn numbers_follow_the_order_of_appearance() {
        let mut names = Names::new();
        assert_eq!(names.number(&[b"jaw"]), (0, true));
        assert_eq!(names.number(&[b"br", b"ow"]), (1, true));
        assert_eq!(names.number(&[b"brow"]), (1, true));
        assert_eq!(names.get(1), Some("brow"));
        assert_eq!(names.get(2), None);
    }

    #[test]
    fn long_names_keep_their_ends_and_stay_apart() {
        let mut names = Names::new();
        let long = |first: char| format!("/{first}/avatar/parameters/v2/MouthSmileLeft");
        assert_eq!(names.number(&[long('a').as_bytes()]), (0, true));
        assert_eq!(names.number(&[long('b').as_bytes()]), (1, true));
        assert_eq!(names.number(&[long('a').as_bytes()]), (0, true));
        assert_eq!(names.get(0), Some("~ar/parameters/v2/MouthSmileLeft"));
        let umlauts = "ü".repeat(30);
        let (knob, _) = names.number(&[umlauts.as_bytes()]);
        assert_eq!(names.get(knob), Some(format!("~{}", "ü".repeat(15)).as_str()));
    }

    #[test]
    fn a_full_table_still_numbers() {
        let mut names = Names::new();
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
