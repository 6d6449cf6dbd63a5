//! A take through a surface again: at the frames that were played, to the bit, or at frames of one's own.

use super::read::{Records, Take};
use super::record::{Record, Stamped};
use crate::{ControlSurface, SurfaceError};
use sinew_runtime::Controls;

/// What a replay did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Replayed {
    /// Frames.
    pub frames: usize,
    /// Records left out: of components that this basis lacks, or weights that are no numbers.
    pub skipped: usize,
}

/// Plays a take as it was played and hands every frame's weights over. On the basis of the take, with its map, its settings
/// and a new surface, they are the live ones to the bit.
///
/// # Errors
/// [`SurfaceError`], before anything moved.
pub fn replay(
    take: &Take<'_>,
    surface: &mut ControlSurface<'_>,
    controls: &mut Controls<'_>,
    mut frame: impl FnMut(u64, &[f32]),
) -> Result<Replayed, SurfaceError> {
    let mut frames = TakeFrames::recorded(take);
    let mut count = 0;
    while let Some(at_us) = frames.next_frame(surface, controls)? {
        frame(at_us, controls.weights());
        count += 1;
    }
    Ok(Replayed {
        frames: count,
        skipped: frames.skipped(),
    })
}

/// Applies a record that is no frame; false if it does not fit this basis.
fn apply(take: &Take<'_>, stamped: Stamped, surface: &mut ControlSurface<'_>, controls: &mut Controls<'_>) -> bool {
    match stamped.record {
        Record::Source(event) => surface.source_event(stamped.at_us, event),
        Record::Command(command) => match take.command_in(controls.basis(), command) {
            Ok(command) => surface.command(command),
            Err(_) => return false,
        },
        Record::Weight { control, weight } => {
            let Ok(control) = take.control_in(controls.basis(), control) else {
                return false;
            };
            return controls.set_unclamped(control.into(), weight).is_ok();
        }
        Record::Frame => {}
    }
    true
}

/// A take frame by frame: at the frames that were played, or at others. One call a frame, so that a caller can pace a take, or
/// stop one whose times make no sense.
#[derive(Debug)]
pub struct TakeFrames<'a> {
    take: Take<'a>,
    records: Records<'a>,
    pending: Option<Stamped>,
    /// `None`: the frames of the take.
    frame_us: Option<u64>,
    next_us: Option<u64>,
    skipped: usize,
}

impl<'a> TakeFrames<'a> {
    /// Frames every `frame_us` from the first record on; 0 counts as 1. For export.
    pub fn new(take: &Take<'a>, frame_us: u64) -> Self {
        Self::start(take, Some(frame_us.max(1)))
    }

    /// The frames that were played: see [`replay`].
    pub fn recorded(take: &Take<'a>) -> Self {
        Self::start(take, None)
    }

    fn start(take: &Take<'a>, frame_us: Option<u64>) -> Self {
        let mut records = take.records();
        let pending = records.next();
        Self {
            take: *take,
            records,
            pending,
            frame_us,
            next_us: pending.map(|first| first.at_us),
            skipped: 0,
        }
    }

    /// The next frame: its time, with the controls moved on to it. `None` after the last frame that was played, or after the
    /// frame of one's own that follows the last record.
    ///
    /// # Errors
    /// [`SurfaceError`].
    pub fn next_frame(
        &mut self,
        surface: &mut ControlSurface<'_>,
        controls: &mut Controls<'_>,
    ) -> Result<Option<u64>, SurfaceError> {
        let Some(frame_us) = self.frame_us else {
            return self.next_recorded(surface, controls);
        };
        let Some(now_us) = self.next_us else { return Ok(None) };
        while let Some(stamped) = self.pending.filter(|stamped| stamped.at_us <= now_us) {
            self.skipped += usize::from(!apply(&self.take, stamped, surface, controls));
            self.pending = self.records.next();
        }
        surface.advance(now_us, controls)?;
        self.next_us = self.pending.and_then(|_| now_us.checked_add(frame_us));
        Ok(Some(now_us))
    }

    fn next_recorded(
        &mut self,
        surface: &mut ControlSurface<'_>,
        controls: &mut Controls<'_>,
    ) -> Result<Option<u64>, SurfaceError> {
        while let Some(stamped) = self.pending {
            self.pending = self.records.next();
            if stamped.record == Record::Frame {
                surface.advance(stamped.at_us, controls)?;
                return Ok(Some(stamped.at_us));
            }
            self.skipped += usize::from(!apply(&self.take, stamped, surface, controls));
        }
        Ok(None)
    }

    /// Records left out so far; see [`Replayed::skipped`].
    pub fn skipped(&self) -> usize {
        self.skipped
    }
}
