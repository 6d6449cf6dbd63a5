//! Fixed poses and one checksum over their frames, for every program that shows the same bits on another target.
//!
//! Path of data: [`knobs`] -> [`sinew_runtime::Controls`] -> [`sinew_runtime::Frame`] -> [`Checksum`].
#![no_std]
#![forbid(unsafe_code)]

use core::fmt;
use core::hash::Hasher;

use fnv::FnvHasher;
use sinew_runtime::{ControlError, Controls, Frame, FrameError, Workspace};

/// What a ten-bit knob reads at its upper stop.
pub const FULL_SCALE: u16 = 1023;
/// Poses of the fixed list.
pub const POSE_COUNT: usize = 40;

/// Where the knobs stand in pose `n`, one for each of `component_count` components. Range: `0..=FULL_SCALE`.
///
/// First all at the lower stop, then all at the upper one, then each in turn far from the others, then scattered.
pub fn knobs(n: usize, component_count: usize) -> impl Iterator<Item = u16> {
    (0..component_count).map(move |k| match n {
        0 => 0,
        1 => FULL_SCALE,
        n if n - 2 < component_count => FULL_SCALE / 8 * if n - 2 == k { 7 } else { 4 },
        _ => {
            // The upper bits of a multiplication by an odd constant: far apart for near numbers.
            let scattered = ((n * 31 + k) as u32).wrapping_mul(0x9e37_79b1) >> 22;
            scattered as u16
        }
    })
}

/// FNV-1a over the bits of points, 64 bits wide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Checksum(pub u64);

impl Checksum {
    /// Of nothing yet.
    pub const START: Self = Self(0xcbf2_9ce4_8422_2325);

    /// With `points` appended.
    #[must_use]
    pub fn with(self, points: &[[f32; 3]]) -> Self {
        let mut hasher = FnvHasher::with_key(self.0);
        points
            .as_flattened()
            .iter()
            .for_each(|x| hasher.write(&x.to_bits().to_le_bytes()));
        Self(hasher.finish())
    }
}

/// Sixteen digits, lower case.
impl fmt::Display for Checksum {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:016x}", self.0)
    }
}

/// A step that refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// A control.
    Control(ControlError),
    /// A frame.
    Frame(FrameError),
}

impl core::error::Error for Refusal {}

impl fmt::Display for Refusal {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Control(error) => error.fmt(out),
            Self::Frame(error) => error.fmt(out),
        }
    }
}

/// Plays the whole list; the checksum is over positions, then normals, of one frame after another.
/// Shape: `positions` and `normals` `[V]`.
///
/// # Errors
/// What the runtime refused.
pub fn play(
    controls: &mut Controls<'_>,
    workspace: &mut Workspace<'_>,
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
) -> Result<Checksum, Refusal> {
    let basis = *controls.basis();
    let mut checksum = Checksum::START;
    for n in 0..POSE_COUNT {
        for (k, knob) in knobs(n, basis.component_count()).enumerate() {
            let share = f32::from(knob) / f32::from(FULL_SCALE);
            controls.set_share(k, share).map_err(Refusal::Control)?;
        }
        let job = Frame {
            basis: &basis,
            controls,
            positions,
            normals: Some(normals),
        };
        job.run(workspace).map_err(Refusal::Frame)?;
        checksum = checksum.with(positions).with(normals);
    }
    Ok(checksum)
}
