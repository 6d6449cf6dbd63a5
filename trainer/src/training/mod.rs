//! Fits the network: data, loss, optimiser, checkpoints.
