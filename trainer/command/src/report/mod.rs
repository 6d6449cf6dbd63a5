//! Pictures and the HTML report: the last station of the path of data.
//!
//! `positions + faces + values -> view -> raster -> Image -> pictures -> html`. All of it is drawn on the CPU and ends in one
//! self-contained file; the same input gives the same bytes.

pub mod color;
pub mod html;
pub mod illustrate;
pub mod image;
pub mod pictures;
pub mod principal;
pub mod raster;
mod shade;
pub mod svg;
pub mod view;

#[cfg(test)]
mod tests;
