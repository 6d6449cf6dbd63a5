//! The peers, trained on the same shapes, for the same table.

pub mod pca;
