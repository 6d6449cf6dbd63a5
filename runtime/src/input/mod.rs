//! Input: from the bytes of a knob box to the weights of the components, without a heap and without ever blocking.
//!
//! Path of data: bytes in any chunking -> protocol -> [`KnobEvent`] -> [`ControlSource`] -> [`ControlSurface`]: calibration,
//! deadband, filter, [`ControlMap`] and pages, takeover, response, failsafe -> [`crate::Controls`].

mod calibrate;
mod counters;
mod event;
mod failsafe;
mod filter;
mod map;
mod pages;
pub mod protocol;
mod response;
mod source;
mod supply;
mod surface;
mod takeover;

pub use calibrate::{
    CalibrationRefusal, CalibrationSettings, Calibrator, KnobCalibration, KnobProgress, KnobTrial, Progress,
};
pub use counters::{Counters, Fault};
pub use event::{KnobEvent, Reading};
pub use failsafe::{Failsafe, Health, SurfaceStatus};
pub use filter::{Deadband, OneEuro, REST_DISTANCE, Smoothing};
pub use map::{BUTTONS_MAX, Binding, Button, Command, ControlMap, Knob, MapError, OnPage};
pub use pages::{TreePages, TreeView};
pub use protocol::{Decoder, Finding, FullScale, Protocol, Settings};
pub use response::{Centre, Curve, ResolvedResponse, Response, ResponseFault};
pub use source::{ControlSource, Slider, SliderError, SliderSource, SourceEvent, SourceStatus};
pub use supply::{Supply, Witness};
pub use surface::{
    Assignment, ControlSurface, FRAME_US_MAX, KnobState, SlotState, SurfaceError, SurfaceLayout, SurfaceSettings,
};
pub use takeover::{Direction, Takeover, TakeoverState};
