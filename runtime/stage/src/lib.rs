//! Performs Sinew packages live: knobs, takes and streams. What the `sinew-stage` command is made of.
//!
//! Path of data: device (thread) -> [`wiring`]: addresses of the map -> surface -> weights -> frame -> [`stream`]s (threads);
//! beside it a take on disk and a [`snapshot`] for the [`view`] and the [`page`]. [`config`] and [`calibration`] say how.

pub mod calibration;
pub mod checksum;
pub mod commands;
pub mod config;
pub mod count;
pub mod demo;
pub mod device;
pub mod export;
pub mod model;
pub mod pace;
pub mod page;
pub mod play;
pub mod snapshot;
pub mod stream;
pub mod view;
pub mod wiring;
