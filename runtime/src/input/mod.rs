//! Input: from the bytes of a knob box to the weights of the components, without a heap and without ever blocking.
//!
//! Path of data: bytes in any chunking -> protocol -> [`KnobEvent`] -> [`ControlSource`] -> [`ControlSurface`]: calibration,
//! deadband, filter, [`ControlMap`] and pages, takeover, response, failsafe -> [`crate::Controls`].
//!
//! With the features `serial`, `midi` and `osc` (all need std) threads read the devices, and their sources hand over what
//! came without a lock.

mod calibrate;
mod counters;
#[cfg(feature = "std")]
mod device;
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
#[cfg(feature = "std")]
pub use device::{Clock, DeviceStatus, KnobName, Link, QUEUE_EVENTS};
#[cfg(all(feature = "std", feature = "midi"))]
pub use device::{MidiError, MidiPortSettings, MidiSource, midi_ports};
#[cfg(all(feature = "std", feature = "osc"))]
pub use device::{OscError, OscSettings, OscSource};
#[cfg(all(feature = "std", feature = "serial"))]
pub use device::{SerialError, SerialPort, SerialSelector, SerialSettings, SerialSource, UsbIdentity, serial_ports};
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
