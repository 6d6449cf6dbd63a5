//! Reads a whole mesh sequence: every frame of an open one, into memory or a mapped file.

use super::choose::Choice;
use super::error::SequenceError;
use super::notice::Notice;
use super::open::OpenSequence;
use super::sequence::MeshSequence;
use super::store::ShapeStore;
use std::path::Path;

/// Positions of more bytes than this go to a mapped file: a quarter of what the features of a training may take in memory.
const MAPPED_FROM_BYTES: u64 = super::store::MAPPED_FROM_BYTES / 4;

/// A sequence and what was odd about its files.
#[derive(Debug, Clone, PartialEq)]
pub struct SequenceRead {
    /// The sequence.
    pub sequence: MeshSequence,
    /// What was handled without refusing, for the user to know; in a fixed order.
    pub notices: Vec<Notice>,
}

/// Reads what `choice` wants of the file or folder at `path`: a folder of OBJ, PLY or OFF files, one a shape, in natural order
/// ("frame2" before "frame10"); a folder with `positions.npy` `[N][V][3]` and `faces.npy` `[F][3]`, which go before any mesh files
/// there; that `positions.npy` itself; or a file of any other format of [`crate::FORMATS`].
///
/// `progress` is called with (frames read, N) after every frame. Vertex order is kept; polygons are split alike in every
/// shape, by the geometry of the reference.
///
/// Errors: see [`SequenceError`]; nothing is changed on disk.
pub fn read_sequence(
    path: &Path,
    choice: &Choice,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<SequenceRead, SequenceError> {
    let mut open = OpenSequence::open(path, choice)?;
    let frame_count = open.frame_count();
    if frame_count < 2 {
        return Err(SequenceError::OneShapeOnly { path: path.into() });
    }
    let full = |source| SequenceError::NoRoom {
        path: path.into(),
        source,
    };
    let mut shapes = ShapeStore::zeros(frame_count, open.vertex_count(), MAPPED_FROM_BYTES).map_err(full)?;
    for n in 0..frame_count {
        open.frame(n, &mut shapes[n])?;
        progress(n + 1, frame_count);
    }
    let sequence = MeshSequence {
        name: open.name(),
        faces: open.faces().to_vec(),
        shapes,
        shape_names: open.frame_names().to_vec(),
        render: open.render().cloned(),
        dress: open.dress().clone(),
        unit_metres: open.contents().unit_metres,
        up: open.contents().up,
        fps: open.fps(),
    };
    Ok(SequenceRead {
        sequence,
        notices: open.notices().to_vec(),
    })
}
