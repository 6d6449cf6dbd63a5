//! Output for engines: the positions and normals of a frame as the bytes of a vertex buffer, with the caller's strides and
//! offsets, so that an upload is one copy.

use core::ffi::c_void;

use sinew_runtime::{Attribute, UnitEncoding, VertexLayout, VertexOutput};

use crate::basis::{SinewBasis, share_basis};
use crate::details::SinewDetails;
use crate::edge::edge_with_details;
use crate::fault::Fault;
use crate::memory::{Out, Regions, slice, slice_mut};
use crate::number;
use crate::status::SinewStatus;
use crate::structs::{self, GrowingStruct, choice};

/// How normals and tangents are written. Numbers have the byte order of the machine.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewUnitEncoding {
    /// Floats: three for a normal (12 bytes), four for a tangent (16 bytes).
    Float32 = 0,
    /// Four 16-bit integers, 32767 for 1; a normal's fourth is 0 (8 bytes).
    Snorm16 = 1,
    /// Four 8-bit integers, 127 for 1; a normal's fourth is 0 (4 bytes).
    Snorm8 = 2,
    /// Two unsigned 16-bit integers, 65535 for 1: the place on an unfolded octahedron, as Godot has it (4 bytes). A tangent's second
    /// number holds the sign, too: in its upper half plus, in its lower half, turned over, minus.
    Octahedral16 = 3,
}

/// What is written for every render vertex, and where: element r of an attribute begins at byte
/// `offset + r * stride` of `bytes`. An attribute whose stride is 0 is not written.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewVertexOptions {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Of a frame: xyz for each vertex, source order. Not NULL.
    pub positions: *const f32,
    /// Floats of `positions`: at least 3 V.
    pub position_floats: usize,
    /// Of the same frame; NULL where neither normals nor tangents are written.
    pub normals: *const f32,
    /// Floats of `normals`: at least 3 V.
    pub normal_floats: usize,
    /// The vertex buffer. Bytes that belong to no attribute stay as they are; no alignment is asked for.
    pub bytes: *mut c_void,
    /// Bytes of the vertex buffer.
    pub byte_count: usize,
    /// Memory for tangents, 4 floats a render vertex, at a multiple of 4; NULL where none are written.
    pub scratch: *mut f32,
    /// Floats of `scratch`.
    pub scratch_floats: usize,
    /// First byte of the first position: three floats, 12 bytes.
    pub position_offset: usize,
    /// Bytes from one position to the next.
    pub position_stride: usize,
    /// First byte of the first normal.
    pub normal_offset: usize,
    /// Bytes from one normal to the next.
    pub normal_stride: usize,
    /// First byte of the first tangent: along the texture's u, and the sign of the bitangent.
    pub tangent_offset: usize,
    /// Bytes from one tangent to the next.
    pub tangent_stride: usize,
    /// First byte of the first texture coordinates: two floats, 8 bytes. They do not move: once is enough.
    pub texture_offset: usize,
    /// Bytes from one pair of texture coordinates to the next.
    pub texture_stride: usize,
    /// Of normals and tangents.
    pub encoding: number::SinewUnitEncoding,
}

// SAFETY: `repr(C)`, the size first, raw pointers and integers only.
unsafe impl GrowingStruct for SinewVertexOptions {
    const NAME: &'static str = "options";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// A box. Fixed for ever, hence without a size of its own.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SinewBounds {
    /// Its least corner.
    pub minimum: [f32; 3],
    /// Its greatest corner.
    pub maximum: [f32; 3],
}

impl SinewVertexOptions {
    fn layout(&self) -> Result<VertexLayout, Fault> {
        let at = |offset_bytes, stride_bytes| {
            (stride_bytes > 0).then_some(Attribute {
                offset_bytes,
                stride_bytes,
            })
        };
        let encodings = [
            UnitEncoding::Float32,
            UnitEncoding::Snorm16,
            UnitEncoding::Snorm8,
            UnitEncoding::Octahedral16,
        ];
        Ok(VertexLayout {
            positions: at(self.position_offset, self.position_stride),
            normals: at(self.normal_offset, self.normal_stride),
            tangents: at(self.tangent_offset, self.tangent_stride),
            texture_coordinates: at(self.texture_offset, self.texture_stride),
            encoding: choice("options.encoding", self.encoding, &encodings)?,
        })
    }
}

/// Writes the vertices of a frame into a vertex buffer: `render_vertex_count` of them, those of `sinew_basis_render_faces`.
/// For buffers in separate memory call it once for each.
///
/// `bounds`: NULL, or takes the box around all positions.
///
/// Errors: `NO_NORMALS`, `NO_TEXTURE`, `STRIDE_TOO_SHORT`, `ATTRIBUTES_OVERLAP`, `UNKNOWN_OPTION`.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_vertices_write(
    basis: *const SinewBasis,
    options: *const SinewVertexOptions,
    bounds: *mut SinewBounds,
    details: *mut SinewDetails,
) -> SinewStatus {
    let write = |regions: &mut Regions| {
        let out = Out::optional(bounds, "bounds", regions)?;
        // SAFETY: the caller's promise, both.
        let (shared, options) = unsafe { (share_basis(basis, regions)?, structs::read(options, regions)?) };
        let (basis, layout) = (&shared.basis, options.layout()?);
        let vertex_count = basis.vertex_count();
        // SAFETY: the caller's promise; each is checked, and what is written lies apart from all else.
        let job = unsafe {
            let bytes: *mut u8 = options.bytes.cast();
            VertexOutput {
                basis,
                bytes: slice_mut(bytes, options.byte_count, options.byte_count, "bytes", regions)?,
                positions: vectors(
                    options.positions,
                    options.position_floats,
                    vertex_count,
                    "positions",
                    regions,
                )?,
                normals: match options.normals.is_null() {
                    true => None,
                    false => Some(vectors(
                        options.normals,
                        options.normal_floats,
                        vertex_count,
                        "normals",
                        regions,
                    )?),
                },
                scratch: scratch(&options, basis.render_vertex_count(), regions)?,
                layout,
            }
        };
        let found = job.run()?;
        // SAFETY: the caller's promise.
        unsafe {
            out.write(SinewBounds {
                minimum: found.minimum,
                maximum: found.maximum,
            });
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, write) }
}

/// A frame's vectors, to be read.
///
/// # Safety
/// `floats` is null or readable for `count` floats.
unsafe fn vectors<'b>(
    floats: *const f32,
    count: usize,
    vertex_count: usize,
    name: &'static str,
    regions: &mut Regions,
) -> Result<&'b [[f32; 3]], Fault> {
    // SAFETY: the caller's promise.
    let floats = unsafe { slice(floats, count, 3 * vertex_count, name, regions)? };
    Ok(floats.as_chunks().0)
}

/// # Safety
/// The scratch is null or writable for its floats.
unsafe fn scratch<'b>(
    options: &SinewVertexOptions,
    render_vertex_count: usize,
    regions: &mut Regions,
) -> Result<&'b mut [[f32; 4]], Fault> {
    if options.tangent_stride == 0 {
        return Ok(&mut []);
    }
    let (start, room, floats) = (options.scratch, options.scratch_floats, 4 * render_vertex_count);
    // SAFETY: the caller's promise.
    let floats = unsafe { slice_mut(start, room, floats, "scratch", regions)? };
    Ok(floats.as_chunks_mut().0)
}
