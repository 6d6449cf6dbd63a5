//! One thing that happened to a surface, and its bytes in a chunk.

use super::wire::{Cursor, Small};
use crate::{Command, KnobEvent, Reading, SourceEvent};

/// Everything that goes into a surface and changes what comes out of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Record {
    /// What a source said. Names are not recorded.
    Source(SourceEvent),
    /// What a program asked for. Buttons of the device are knob events.
    Command(Command),
    /// A weight that somebody other than the surface set.
    Weight {
        /// Index of the component.
        control: u16,
        /// Its weight.
        weight: f32,
    },
    /// The surface moved its controls on to this time.
    Frame,
}

/// A record and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamped {
    /// When, µs on the performer's clock.
    pub at_us: u64,
    /// What.
    pub record: Record,
}

/// Tag, time, address, value, scale.
pub(super) const RECORD_BYTES_MAX: usize = 1 + 10 + 3 + 3 + 3;

const POSITION: u8 = 0;
const POSITION_AND_SCALE: u8 = 1;
const STEPS: u8 = 2;
const FRAME: u8 = 3;
const PLUG: u8 = 4;
const COMMAND: u8 = 5;
const WEIGHT: u8 = 6;
const END: u8 = 7;
/// Bit of a tag that says that a time follows; without it the time is the last record's.
const TIME_FOLLOWS: u8 = 8;
/// Argument of a tag that says that the number follows.
const NUMBER_FOLLOWS: u16 = 15;

/// What the coding of a record takes from those before it in its chunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct Context {
    pub(super) at_us: u64,
    full_scale: Option<u16>,
}

impl Context {
    pub(super) fn new(at_us: u64) -> Self {
        Self {
            at_us,
            full_scale: None,
        }
    }
}

/// What a chunk holds next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Entry {
    Record(Stamped),
    /// The take was closed.
    End,
}

fn command_code(command: Command) -> (u16, Option<u16>) {
    match command {
        Command::Stop => (0, None),
        Command::Release => (1, None),
        Command::Next => (2, None),
        Command::Previous => (3, None),
        Command::Into => (4, None),
        Command::Out => (5, None),
        Command::NextFine => (6, None),
        Command::Focus(control) => (7, Some(control)),
        Command::Page(page) => (8, Some(page)),
    }
}

pub(super) fn write_command(command: Command, sink: &mut impl FnMut(&[u8])) {
    let (code, argument) = command_code(command);
    sink(&[code as u8]);
    sink(&argument.unwrap_or(0).to_le_bytes());
}

pub(super) fn command(code: u8, argument: u16) -> Option<Command> {
    Some(match code {
        0 => Command::Stop,
        1 => Command::Release,
        2 => Command::Next,
        3 => Command::Previous,
        4 => Command::Into,
        5 => Command::Out,
        6 => Command::NextFine,
        7 => Command::Focus(argument),
        8 => Command::Page(argument),
        _ => return None,
    })
}

impl Entry {
    pub(super) fn write(self, context: &mut Context) -> Small {
        let mut bytes = Small::new();
        // The map knows its knobs by their addresses.
        if let Self::Record(Stamped {
            record: Record::Source(SourceEvent::Named { .. }),
            ..
        }) = self
        {
            return bytes;
        }
        let at_us = match self {
            Self::Record(stamped) => stamped.at_us,
            Self::End => context.at_us,
        };
        let mut head = |kind: u8, number: u16| {
            let short = number.min(NUMBER_FOLLOWS);
            let since = at_us.wrapping_sub(context.at_us).cast_signed();
            let timed = if since == 0 { 0 } else { TIME_FOLLOWS };
            bytes.push(&[kind | timed | (short as u8) << 4]);
            if since != 0 {
                bytes.signed(since);
            }
            if short == NUMBER_FOLLOWS {
                bytes.varint(number.into());
            }
        };
        match self {
            Self::End => head(END, 0),
            Self::Record(Stamped { record, .. }) => match record {
                Record::Frame => head(FRAME, 0),
                Record::Source(SourceEvent::Named { .. }) => {}
                Record::Source(SourceEvent::Unplugged) => head(PLUG, 0),
                Record::Source(SourceEvent::Replugged) => head(PLUG, 1),
                Record::Source(SourceEvent::Knob(KnobEvent { knob, reading })) => match reading {
                    Reading::Steps(steps) => {
                        head(STEPS, knob);
                        bytes.signed(steps.into());
                    }
                    Reading::Position { value, full_scale } => {
                        let known = context.full_scale == Some(full_scale);
                        head(if known { POSITION } else { POSITION_AND_SCALE }, knob);
                        bytes.varint(value.into());
                        if !known {
                            bytes.varint(full_scale.into());
                            context.full_scale = Some(full_scale);
                        }
                    }
                },
                Record::Command(command) => {
                    let (code, argument) = command_code(command);
                    head(COMMAND, code);
                    if let Some(argument) = argument {
                        bytes.varint(argument.into());
                    }
                }
                Record::Weight { control, weight } => {
                    head(WEIGHT, control);
                    bytes.push(&weight.to_le_bytes());
                }
            },
        }
        context.at_us = at_us;
        bytes
    }

    pub(super) fn read(cursor: &mut Cursor<'_>, context: &mut Context) -> Option<Self> {
        let tag = cursor.u8()?;
        if tag & TIME_FOLLOWS != 0 {
            context.at_us = context.at_us.wrapping_add(cursor.signed()?.cast_unsigned());
        }
        let short = u16::from(tag >> 4);
        let number = if short == NUMBER_FOLLOWS {
            cursor.varint_u16()?
        } else {
            short
        };
        let kind = tag & 7;
        let plain = |record| (number == 0).then_some(record);
        let record = match kind {
            POSITION | POSITION_AND_SCALE => {
                let value = cursor.varint_u16()?;
                if kind == POSITION_AND_SCALE {
                    context.full_scale = Some(cursor.varint_u16()?);
                }
                let full_scale = context.full_scale?;
                knob(number, Reading::Position { value, full_scale })
            }
            STEPS => knob(number, Reading::Steps(i16::try_from(cursor.signed()?).ok()?)),
            FRAME => plain(Record::Frame)?,
            PLUG if number == 1 => Record::Source(SourceEvent::Replugged),
            PLUG => plain(Record::Source(SourceEvent::Unplugged))?,
            COMMAND => {
                let argument = if number >= 7 { cursor.varint_u16()? } else { 0 };
                Record::Command(command(u8::try_from(number).ok()?, argument)?)
            }
            WEIGHT => Record::Weight {
                control: number,
                weight: cursor.f32()?,
            },
            _ => return (number == 0).then_some(Self::End),
        };
        Some(Self::Record(Stamped {
            at_us: context.at_us,
            record,
        }))
    }
}

fn knob(knob: u16, reading: Reading) -> Record {
    Record::Source(SourceEvent::Knob(KnobEvent { knob, reading }))
}
