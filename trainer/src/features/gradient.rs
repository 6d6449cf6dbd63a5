//! Deformation gradient of every one-ring.
