//! The stacked, attention-based autoencoder (method section 2). Tensors stay in here and in `training`; the rest of the
//! trainer sees [`weights::StackWeights`].

pub mod weights;
