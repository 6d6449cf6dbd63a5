//! A performance: live, from a device, or again, from a take.

mod follow;
mod live;
mod replay;
mod scene;
mod take_file;
mod typed;

pub use follow::Follow;
pub use live::{Live, LiveOutcome};
pub use replay::{Replay, ReplayOutcome, TakeParts};
pub use scene::{Scene, SceneMemory};
pub use take_file::TakeSummary;
pub use typed::{parse_line, start_typed_lines};
