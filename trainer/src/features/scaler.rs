//! Features into the network's range and back.
