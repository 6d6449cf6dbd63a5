//! From the bytes of a knob box to the weights of the components, without a heap and without ever blocking. `no_std`.
//!
//! Path of data: bytes in any chunking -> protocol -> [`KnobEvent`] -> [`ControlSource`] -> [`ControlSurface`]: calibration,
//! deadband, filter, [`ControlMap`] and pages, takeover, response, failsafe -> [`Controls`](sinew_runtime::Controls).
//! [`take`] records what came and replays it to the same bits.
//!
//! With the features `serial`, `midi` and `osc` (all need std) threads read the devices ([`device`]), and their sources hand over what
//! came without a lock.
//!
//! A program that reads its port itself:
//!
//! ```
//! use sinew_knobs::{
//!     Binding, ControlMap, ControlSurface, Decoder, DecoderSettings, Knob, KnobState, SlotState, SurfaceMemory, SurfaceSettings,
//! };
//! use sinew_runtime::{Basis, Controls};
//!
//! # fn play(package: &[u8], port: &mut dyn FnMut() -> Vec<u8>) -> Result<(), Box<dyn std::error::Error>> {
//! let basis = Basis::open(package)?;
//! let mut weights = [0.0; 64];
//! let mut controls = Controls::new(&basis, &mut weights[..basis.component_count()])?;
//!
//! // The first knob moves the first component; it waits until it has passed the place where that stands.
//! let knobs = [Knob::new(0, "jaw")];
//! let bindings = [Binding { knob: 0, control: 0, ..Binding::default() }];
//! let map = ControlMap::new(basis, &knobs, &bindings, &[], None)?;
//! let (mut states, mut slots, mut left) = ([KnobState::default()], [SlotState::default()], [0.0; 64]);
//! let memory = SurfaceMemory { knobs: &mut states, slots: &mut slots, left: &mut left };
//! let mut surface = ControlSurface::new(map, SurfaceSettings::default(), memory)?;
//!
//! let mut decoder = Decoder::new(None, DecoderSettings::default()); // its first bytes say which protocol it is
//! for frame in 0..600 {
//!     let now_us = frame * 16_667;
//!     decoder.feed(&port(), &mut |event| surface.event(now_us, event));
//!     surface.advance(now_us, &mut controls)?; // `controls` are the weights of this frame
//! }
//! # Ok(())
//! # }
//! # let package = sinew_formats::package::write_baked(&sinew_formats::package::fixture::tiny_baked().basis()).unwrap();
//! # play(&package, &mut || b"0|240|1023\r\n".to_vec()).unwrap();
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod calibrate;
mod counters;
#[cfg(feature = "std")]
pub mod device;
mod event;
mod failsafe;
mod filter;
mod map;
mod pages;
pub mod protocol;
mod response;
mod source;
mod surface;
pub mod take;
mod takeover;

#[cfg(test)]
mod fixture;

pub use calibrate::KnobCalibration;
pub use counters::{Counters, Fault};
pub use event::{KnobEvent, Reading};
pub use failsafe::{Failsafe, Health, SurfaceStatus};
pub use filter::{Deadband, OneEuro, REST_DISTANCE, Smoothing};
pub use map::{BUTTONS_MAX, Binding, Button, Command, ControlMap, Knob, MapError, OnPage, TreePages};
pub use pages::TreeView;
pub use protocol::{Decoder, DecoderSettings, FullScale, Protocol};
pub use response::{Centre, Curve, ResolvedResponse, Response, ResponseFault};
pub use source::{ControlSource, Slider, SliderError, SliderSource, SourceEvent};
#[cfg(feature = "std")]
pub use surface::SurfaceBuffers;
pub use surface::{
    Assignment, CONFIRM_US, ControlSurface, FRAME_US_MAX, KnobState, SlotState, SurfaceError, SurfaceLayout,
    SurfaceMemory, SurfaceSettings,
};
pub use takeover::{Direction, Takeover, TakeoverState};
