//! Choices as callers give them: any number, which a call looks at before it becomes a variant of the enum of the same name.
//! The headers name the enum, whose values are numbers of 32 bits in C.

pub type SinewBoneForm = i32;
pub type SinewCentre = i32;
pub type SinewCommand = i32;
pub type SinewCurve = i32;
pub type SinewFrameOutcome = i32;
pub type SinewKernels = i32;
pub type SinewMidiCoding = i32;
pub type SinewMidiPairing = i32;
pub type SinewProtocol = i32;
pub type SinewReadingKind = i32;
pub type SinewTakeover = i32;
pub type SinewTier = i32;
pub type SinewUnitEncoding = i32;
pub type SinewWinding = i32;
