//! The peers, trained on the same shapes, for the same table.
//!
//! Path of data: training shapes -> one file a method -> [`linear::LinearBasis`] -> [`model::Model`], which
//! [`crate::compare`] fits to unseen shapes, scores, and moves by handles.

pub mod bernard;
mod face_graph;
mod flat_face;
pub mod gradient_field;
pub mod huang;
pub mod length_angle;
pub mod linear;
pub mod model;
pub mod splocs;
pub mod tan;
pub mod wang;
