//! What can be wrong with a map.

use core::fmt;

use crate::response::ResponseFault;

/// What is wrong with a map. Indices count the caller's records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MapError {
    /// Two knobs or buttons have one address.
    SameAddress {
        /// The address.
        address: u16,
    },
    /// A knob's calibration leaves no range.
    Calibration {
        /// Index of the knob.
        knob: usize,
    },
    /// A number of a knob's smoothing is out of range.
    Smoothing {
        /// Index of the knob.
        knob: usize,
    },
    /// The step of an encoder is not in `(0, 1]`.
    Step {
        /// Index of the knob.
        knob: usize,
    },
    /// The acceleration of an encoder is not in `[1, 100]`.
    Acceleration {
        /// Index of the knob.
        knob: usize,
    },
    /// A binding names a knob that is not listed.
    NoSuchKnob {
        /// Index of the binding.
        binding: usize,
        /// The knob it names.
        knob: u16,
    },
    /// A binding, or a button, names a component that the basis lacks.
    NoSuchControl {
        /// The component.
        control: u16,
        /// Components of the basis.
        component_count: usize,
    },
    /// A binding's response does not fit its component.
    Response {
        /// Index of the binding.
        binding: usize,
        /// What is wrong.
        fault: ResponseFault,
    },
    /// Two bindings move one control on the same page.
    TwoHands {
        /// Index of the first.
        first: usize,
        /// Index of the second.
        second: usize,
    },
    /// The tree's knobs are none, or more than are listed.
    TreeKnobs,
    /// A knob of the tree has a binding as well.
    TreeKnobBound {
        /// Index of the binding.
        binding: usize,
    },
    /// The tree's response does not fit a component.
    TreeResponse {
        /// The component.
        control: usize,
        /// What is wrong.
        fault: ResponseFault,
    },
    /// A button names a page on which no binding holds.
    NoSuchPage {
        /// The page.
        page: u16,
    },
    /// More than [`BUTTONS_MAX`](super::BUTTONS_MAX) buttons, 65,535 knobs or bindings.
    TooMany,
}

impl core::error::Error for MapError {}

impl fmt::Display for MapError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::SameAddress { address } => write!(out, "two knobs or buttons have the address {address}"),
            Self::Calibration { knob } => write!(out, "the calibration of knob {knob} leaves no range to turn in"),
            Self::Smoothing { knob } => write!(out, "a number in the smoothing of knob {knob} is out of range"),
            Self::Step { knob } => write!(out, "the step of knob {knob} must be over 0 and at most 1"),
            Self::Acceleration { knob } => write!(out, "the acceleration of knob {knob} must be from 1 to 100"),
            Self::NoSuchKnob { binding, knob } => {
                write!(out, "binding {binding} names knob {knob}, which is not listed")
            }
            Self::NoSuchControl {
                control,
                component_count,
            } => write!(out, "there is no component {control}: the basis has {component_count}"),
            Self::Response { binding, fault } => write!(out, "binding {binding}: {fault}"),
            Self::TwoHands { first, second } => {
                write!(out, "bindings {first} and {second} move one control on the same page")
            }
            Self::TreeKnobs => write!(
                out,
                "the tree needs at least one coarse knob and only knobs that are listed"
            ),
            Self::TreeKnobBound { binding } => write!(out, "binding {binding} is for a knob that the tree has"),
            Self::TreeResponse { control, fault } => write!(out, "the tree's response, component {control}: {fault}"),
            Self::NoSuchPage { page } => write!(out, "no binding is on page {page}"),
            Self::TooMany => write!(out, "more than 64 buttons, or more than 65535 knobs or bindings"),
        }
    }
}
