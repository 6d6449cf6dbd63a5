//! The stacked, attention-based autoencoder (method section 2). Tensors stay in here and in `training`; the rest of the
//! trainer sees [`weights::StackWeights`].

pub mod activation;
pub mod attention;
pub mod device;
pub mod kernel;
pub mod loss;
pub mod ring;
pub mod stack;
pub mod weights;
