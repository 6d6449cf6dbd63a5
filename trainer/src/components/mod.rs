//! Components: closed-form start, extraction from the trained network, removal of redundant ones.
