//! What MIDI bytes cannot say of themselves: which controllers are encoders and in which coding they count, and whether
//! controllers come in pairs. The caller's settings for [`super::midi`].

/// MIDI channels.
pub(super) const CHANNELS: usize = 16;
/// Controllers of a channel.
pub(super) const CONTROLLERS: usize = 128;

/// How the data byte of a control change is meant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Coding {
    /// A position, 0 to 127.
    #[default]
    Absolute,
    /// Steps in two's complement of seven bits: 1 is one clockwise, 127 one back. Also sold as "relative 1".
    TwosComplement,
    /// Steps with a sign bit: 1 is one clockwise, 65 one back. Mackie Control; also "relative 3".
    SignedBit,
    /// Steps around 64: 65 is one clockwise, 63 one back. Also "relative 2".
    BinaryOffset,
}

impl Coding {
    /// Steps of a relative coding; positive is clockwise. `None` for [`Coding::Absolute`]. `data` is a data byte, 0 to 127.
    pub fn steps(self, data: u8) -> Option<i16> {
        let data = i16::from(data & 0x7f);
        match self {
            Self::Absolute => None,
            Self::TwosComplement => Some(if data < 64 { data } else { data - 128 }),
            Self::SignedBit => Some(if data < 64 { data } else { 64 - data }),
            Self::BinaryOffset => Some(data - 64),
        }
    }

    const fn code(self) -> u8 {
        match self {
            Self::Absolute => 0,
            Self::TwosComplement => 1,
            Self::SignedBit => 2,
            Self::BinaryOffset => 3,
        }
    }
}

/// Whether the controllers 0 to 31 have their lower seven bits in 32 to 63.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Pairing {
    /// Learned a controller at a time: `n + 32` directly behind `n`, four times in a row, makes a pair.
    #[default]
    Learned,
    /// All are pairs.
    Always,
    /// None is: 32 to 63 are knobs of their own.
    Never,
}

/// Settings of a MIDI device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MidiSettings {
    /// Whether there are 14-bit controllers.
    pub pairing: Pairing,
    /// Two bits a controller.
    codings: [u8; CHANNELS * CONTROLLERS / 4],
    /// A channel: bit `n` for a controller `n + 32` that is a knob of its own.
    own: [u32; CHANNELS],
}

impl MidiSettings {
    /// All controllers absolute, pairs learned.
    pub const fn new() -> Self {
        Self {
            pairing: Pairing::Learned,
            codings: [0; CHANNELS * CONTROLLERS / 4],
            own: [0; CHANNELS],
        }
    }

    /// Says that a controller from 32 to 63 is a knob or a button of its own and never the lower half of another. `knob` is
    /// `channel * 128 + controller`; others are left alone.
    pub fn set_own(&mut self, knob: u16) {
        let (channel, controller) = (usize::from(knob) / CONTROLLERS, usize::from(knob) % CONTROLLERS);
        if let (Some(own), 32..64) = (self.own.get_mut(channel), controller) {
            *own |= 1 << (controller - 32);
        }
    }

    pub(super) fn is_own(&self, knob: u16) -> bool {
        let (channel, controller) = (usize::from(knob) / CONTROLLERS, usize::from(knob) % CONTROLLERS);
        let own = self.own.get(channel).copied().unwrap_or(0);
        (32..64).contains(&controller) && own & 1 << (controller - 32) != 0
    }

    /// Says how one controller counts. `knob` is `channel * 128 + controller`, with channels from 0; others have no coding
    /// and are left alone.
    pub fn set_coding(&mut self, knob: u16, coding: Coding) {
        let shift = 2 * (knob % 4);
        if let Some(four) = self.codings.get_mut(usize::from(knob / 4)) {
            *four = *four & !(3 << shift) | coding.code() << shift;
        }
    }

    /// Says how all controllers count.
    pub fn set_all_codings(&mut self, coding: Coding) {
        self.codings = [coding.code() * 0b0101_0101; CHANNELS * CONTROLLERS / 4];
    }

    /// How a controller counts.
    pub fn coding(&self, knob: u16) -> Coding {
        let four = self.codings.get(usize::from(knob / 4)).copied().unwrap_or(0);
        match four >> (2 * (knob % 4)) & 3 {
            1 => Coding::TwosComplement,
            2 => Coding::SignedBit,
            3 => Coding::BinaryOffset,
            _ => Coding::Absolute,
        }
    }
}

impl Default for MidiSettings {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_codings() {
        let cases = [
            (
                Coding::TwosComplement,
                [(1, 1), (63, 63), (127, -1), (65, -63), (64, -64), (0, 0)],
            ),
            (
                Coding::SignedBit,
                [(1, 1), (63, 63), (65, -1), (127, -63), (64, 0), (0, 0)],
            ),
            (
                Coding::BinaryOffset,
                [(65, 1), (127, 63), (63, -1), (1, -63), (0, -64), (64, 0)],
            ),
        ];
        for (coding, pairs) in cases {
            for (data, steps) in pairs {
                assert_eq!(coding.steps(data), Some(steps), "{coding:?} {data}");
            }
        }
        assert_eq!(Coding::Absolute.steps(3), None);
    }

    #[test]
    fn each_controller_has_its_own() {
        let mut settings = MidiSettings::new();
        settings.set_all_codings(Coding::BinaryOffset);
        settings.set_coding(130, Coding::SignedBit);
        settings.set_coding(131, Coding::Absolute);
        settings.set_coding(u16::MAX, Coding::SignedBit);
        assert_eq!(settings.coding(129), Coding::BinaryOffset);
        assert_eq!(settings.coding(130), Coding::SignedBit);
        assert_eq!(settings.coding(131), Coding::Absolute);
        assert_eq!(settings.coding(u16::MAX), Coding::Absolute);
    }
}
