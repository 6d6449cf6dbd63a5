//! Input: from the bytes of a knob box to the weights of the components, without a heap and without ever blocking.
//!
//! Path of data: bytes in any chunking -> protocol -> [`KnobEvent`] -> calibration, filter, takeover, map -> [`crate::Controls`].

mod calibrate;
mod event;
mod filter;
mod response;
mod supply;
mod takeover;

pub use calibrate::{
    CalibrationRefusal, CalibrationSettings, Calibrator, KnobCalibration, KnobProgress, KnobTrial, Progress,
};
pub use event::{KnobEvent, Reading};
pub use filter::{Deadband, OneEuro, REST_DISTANCE, Smoothing};
pub use response::{Centre, Curve, ResolvedResponse, Response, ResponseFault};
pub use supply::{Supply, Witness};
pub use takeover::{Direction, Takeover, TakeoverState};
