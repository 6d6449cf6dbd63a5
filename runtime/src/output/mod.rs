//! Output for engines: a frame's positions, normals and tangents as the bytes of a vertex buffer, so that an upload is one copy.
//!
//! Path of data: positions and normals of a [`crate::Frame`] `[V]` -> one element a render vertex `[R]` -> the caller's bytes.
//! Engines split a vertex where texture coordinates do (a seam); [`Basis::surface`] has those render vertices and their
//! triangles. A package without texture coordinates has R = V, in slots.

mod encode;
mod error;
mod layout;
mod tangents;

pub use error::OutputError;
pub use layout::{Attribute, AttributeName, UnitEncoding, VertexLayout};

use crate::basis::Basis;
use crate::error::{Buffer, check_length};
use crate::positions::Bounds;
use encode::{octahedral16, octahedral16_signed, snorm8, snorm16};

/// Writes the vertices of a frame into a vertex buffer. For buffers in separate memory run it once for each.
///
/// ```
/// # use sinew_runtime::{Attribute, Basis, Bounds, OutputError, UnitEncoding, VertexLayout, VertexOutput};
/// # fn upload(basis: &Basis<'_>, positions: &[[f32; 3]], normals: &[[f32; 3]], bytes: &mut [u8]) -> Result<Bounds, OutputError> {
/// let at = |offset_bytes| Some(Attribute { offset_bytes, stride_bytes: 20 });
/// let layout = VertexLayout {
///     positions: at(0),                  // 12 bytes
///     normals: at(12),                   // 8 bytes: x y z 0
///     encoding: UnitEncoding::Snorm16,
///     ..VertexLayout::default()
/// };
/// VertexOutput { basis, positions, normals: Some(normals), scratch: &mut [], layout, bytes }.run()
/// # }
/// ```
#[derive(Debug)]
pub struct VertexOutput<'j> {
    /// The opened package.
    pub basis: &'j Basis<'j>,
    /// Of the frame. Shape: `[V]`, source order.
    pub positions: &'j [[f32; 3]],
    /// Of the frame; needed for normals and tangents. Shape: `[V]`, source order.
    pub normals: Option<&'j [[f32; 3]]>,
    /// For tangents: at least R elements; may be empty where none are written.
    pub scratch: &'j mut [[f32; 4]],
    /// What is written, and where.
    pub layout: VertexLayout,
    /// Output. Bytes that belong to no attribute stay as they are.
    pub bytes: &'j mut [u8],
}

impl VertexOutput<'_> {
    /// Checks lengths, places and overlaps, O(1).
    ///
    /// # Errors
    /// Every [`OutputError`].
    pub fn validate(&self) -> Result<(), OutputError> {
        let count = self.basis.vertex_count();
        check_length(count, Buffer::Positions, self.positions.len()).map_err(OutputError::Input)?;
        if let Some(normals) = self.normals {
            check_length(count, Buffer::Normals, normals.len()).map_err(OutputError::Input)?;
        }
        let layout = &self.layout;
        for (at, attribute) in [
            (layout.normals, AttributeName::Normals),
            (layout.tangents, AttributeName::Tangents),
        ] {
            if at.is_some() && self.normals.is_none() {
                return Err(OutputError::NormalsMissing { attribute });
            }
        }
        for (at, attribute) in [
            (layout.tangents, AttributeName::Tangents),
            (layout.texture_coordinates, AttributeName::TextureCoordinates),
        ] {
            if at.is_some() && !self.basis.surface().has_texture() {
                return Err(OutputError::NoTexture { attribute });
            }
        }
        let (expected, actual) = (self.basis.render_vertex_count(), self.scratch.len());
        if layout.tangents.is_some() && actual < expected {
            return Err(OutputError::ScratchTooShort { expected, actual });
        }
        layout.check(expected, self.bytes.len())
    }

    /// Writes, and returns the box around all positions (all V of them, whatever is written).
    ///
    /// # Errors
    /// Those of [`VertexOutput::validate`]; then nothing was written.
    pub fn run(self) -> Result<Bounds, OutputError> {
        self.validate()?;
        let Self {
            basis,
            positions,
            normals,
            scratch,
            layout,
            bytes,
        } = self;
        let vertices = || basis.render_vertices().map(|v| v as usize);
        if let Some(at) = layout.positions {
            spread(bytes, at, vertices(), positions, |p| bytemuck::cast::<_, [u8; 12]>(*p));
        }
        if let (Some(at), Some(normals)) = (layout.normals, normals) {
            let four = |n: &[f32; 3]| [n[0], n[1], n[2], 0.0];
            match layout.encoding {
                UnitEncoding::Float32 => {
                    spread(bytes, at, vertices(), normals, |n| bytemuck::cast::<_, [u8; 12]>(*n));
                }
                UnitEncoding::Snorm16 => spread(bytes, at, vertices(), normals, |n| snorm16(&four(n))),
                UnitEncoding::Snorm8 => spread(bytes, at, vertices(), normals, |n| snorm8(&four(n))),
                UnitEncoding::Octahedral16 => spread(bytes, at, vertices(), normals, octahedral16),
            }
        }
        if let (Some(at), Some(normals)) = (layout.tangents, normals) {
            let tangents = &mut scratch[..basis.render_vertex_count()];
            tangents::tangents(basis, positions, normals, tangents);
            match layout.encoding {
                UnitEncoding::Float32 => spread(bytes, at, 0.., tangents, |t| bytemuck::cast::<_, [u8; 16]>(*t)),
                UnitEncoding::Snorm16 => spread(bytes, at, 0.., tangents, snorm16),
                UnitEncoding::Snorm8 => spread(bytes, at, 0.., tangents, snorm8),
                UnitEncoding::Octahedral16 => spread(bytes, at, 0.., tangents, octahedral16_signed),
            }
        }
        if let Some(at) = layout.texture_coordinates {
            spread(bytes, at, 0.., basis.surface().uvs, |uv| {
                bytemuck::cast::<_, [u8; 8]>(*uv)
            });
        }
        let mut bounds = Bounds::EMPTY;
        positions.iter().for_each(|p| bounds.include(p));
        Ok(bounds)
    }
}

/// Writes one element for each index, as far as there are elements.
fn spread<T, const N: usize>(
    bytes: &mut [u8],
    at: Attribute,
    indices: impl Iterator<Item = usize>,
    source: &[T],
    encode: impl Fn(&T) -> [u8; N],
) {
    let places = bytes[at.offset_bytes..].chunks_mut(at.stride_bytes);
    for (place, element) in places.zip(indices.map_while(|i| source.get(i))) {
        place[..N].copy_from_slice(&encode(element));
    }
}

#[cfg(test)]
mod tests;
