//! Polar decomposition T = R S.
