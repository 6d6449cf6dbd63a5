//! Rigid motion of each shape onto the reference.
