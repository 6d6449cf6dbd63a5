//! Interchange with other programs: readers of mesh sequences and writers of results.

mod sequence;

pub use sequence::MeshSequence;
