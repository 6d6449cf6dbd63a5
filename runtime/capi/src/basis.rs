//! The basis handle: an opened package and what it says of its mesh and its controls. Read by all, written by none.

use core::ffi::c_char;

use sinew_formats::package::{NONE, limits::NAME_BYTES};
use sinew_runtime::{Basis, Component, ControlError};

use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Kind, Shared};
use crate::memory::{Access, Out, Region, Regions, SinewLayout, array, handle_memory, present};
use crate::status::SinewStatus;
use crate::structs::{GrowingStruct, StructOut};
use crate::version::check_abi;

/// Bytes of a buffer that holds any control's name, with the NUL.
pub const SINEW_NAME_BYTES: usize = 65;
/// Stands where an index is absent: the parent of a coarse control.
pub const SINEW_NONE: u32 = u32::MAX;

const _: () = assert!(SINEW_NAME_BYTES == NAME_BYTES + 1 && SINEW_NONE == NONE);

/// An opened package, in memory of yours. Refers to the package's bytes: keep both in place, unchanged, until the last
/// use of the basis.
pub struct SinewBasis {
    _opaque: (),
}

pub(crate) struct BasisBody {
    pub(crate) basis: Basis<'static>,
    package: Region,
}

impl Body for BasisBody {
    const KIND: Kind = Kind::Basis;
}

impl BasisBody {
    /// Where the package lies.
    pub(crate) fn package(&self) -> Region {
        self.package
    }
}

/// What a package holds. Set `struct_bytes` to `sizeof(SinewBasisInfo)` before the call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewBasisInfo {
    /// `sizeof(SinewBasisInfo)`.
    pub struct_bytes: usize,
    /// V: elements of positions and normals.
    pub vertex_count: u32,
    /// F: triangles.
    pub face_count: u32,
    /// K: controls, one a component.
    pub control_count: u32,
    /// Levels of components, coarse to fine; at least 1.
    pub level_count: u32,
    /// Identity of the content: packages with the same one play the same.
    pub content_id: [u8; 16],
    /// Identity of the compact package that this one was baked from.
    pub compact_id: [u8; 16],
    /// Nodes of the fast tier; 0: the package has none.
    pub fast_node_count: u32,
    /// R: vertices of the render mesh, split where texture coordinates do; V where the package has none.
    pub render_vertex_count: u32,
    /// Whether the package has texture coordinates: 0 or 1.
    pub has_texture: u32,
    /// Root mean square distance of the fast tier from the exact one in mixed poses, as a share of the diagonal of the
    /// rest shape's bounding box; measured when the package was baked. 0 without fast tier.
    pub fast_error_rms: f32,
    /// Greatest such distance. 0 without fast tier.
    pub fast_error_max: f32,
    /// Root mean square angle between the normals of both tiers in those poses, radians. 0 without fast tier.
    pub fast_error_normals: f32,
}

// SAFETY: `repr(C)`, the size first, numbers only.
unsafe impl GrowingStruct for SinewBasisInfo {
    const NAME: &'static str = "info";
    const FIRST_BYTES: usize = core::mem::offset_of!(Self, fast_node_count);
}

/// Adds handle and package to the regions; nothing a call writes may lie in them.
///
/// # Safety
/// `basis` is null or a basis whose memory and package stand.
pub(crate) unsafe fn share_basis<'h>(
    basis: *const SinewBasis,
    regions: &mut Regions,
) -> Result<Shared<'h, BasisBody>, Fault> {
    // SAFETY: the caller's promise.
    let shared = unsafe { Handle::<BasisBody>::share(basis.cast(), regions)? };
    regions.add(shared.package)?;
    Ok(shared)
}

/// How much memory a basis handle needs; the same for every package.
///
/// Errors: `NULL_POINTER`, `MISALIGNED`.
/// Threads: any.
///
/// # Safety
/// `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_layout(layout: *mut SinewLayout) -> SinewStatus {
    edge(|| {
        let out = Out::required(layout, "layout", &mut Regions::new())?;
        // SAFETY: the caller's promise.
        unsafe { out.write(Handle::<BasisBody>::layout(0)) };
        Ok(())
    })
}

/// Opens a baked package: every check that costs more than a few comparisons is here, and no later call can fail because
/// of the package. Copies nothing.
///
/// `abi_version`: pass `SINEW_ABI_VERSION`.
/// `bytes`, `length`: the whole package, `length` exact, starting at a multiple of 16; `malloc` and file maps do.
/// `memory`, `memory_bytes`: at least what `sinew_basis_layout` says.
/// `basis`: takes the handle, which lies at `memory`.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Opening again in the same memory is allowed when nothing uses the old handle; workspaces and controls of other content
/// are then refused.
///
/// Errors: `WRONG_ABI`, `NULL_POINTER`, `MISALIGNED`, `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`, every `PACKAGE_...`.
/// Threads: any; one call for one `memory`.
///
/// # Safety
/// Pointers are NULL or point to memory of the stated lengths. `bytes` and `memory` stay in place, and are written by nobody
/// else, until the last use of the basis.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_open(
    abi_version: u32,
    bytes: *const u8,
    length: usize,
    memory: *mut u8,
    memory_bytes: usize,
    basis: *mut *mut SinewBasis,
    details: *mut SinewDetails,
) -> SinewStatus {
    let open = |regions: &mut Regions| {
        check_abi(abi_version)?;
        let layout = Handle::<BasisBody>::layout(0);
        array(bytes, length, length, "bytes", Access::Read, regions)?;
        let package = Region::new(bytes, length, "package", Access::Read)?;
        handle_memory(memory, memory_bytes, layout, regions)?;
        let out = Out::required(basis, "basis", regions)?;
        // SAFETY: the caller's promise; neither null nor beyond the address space.
        let opened = Basis::open(unsafe { core::slice::from_raw_parts(bytes, length) })?;
        let body = |_: &mut [u8]| Ok(BasisBody { basis: opened, package });
        // SAFETY: the memory was checked against this layout.
        unsafe { out.write(Handle::create(memory, layout, body)?.cast()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, open) }
}

/// Ends a basis: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to free, so
/// this is optional before memory and package are given back.
///
/// Errors: those of a handle.
/// Threads: any, when no other uses the basis; one that does at this moment is noticed.
///
/// # Safety
/// `basis` is NULL or points to a handle's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_close(basis: *mut SinewBasis) -> SinewStatus {
    // SAFETY: the caller's promise.
    edge(|| unsafe { Handle::<BasisBody>::close(basis.cast()) })
}

/// Counts and identities.
///
/// Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `info` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_info(basis: *const SinewBasis, info: *mut SinewBasisInfo) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (out, shared) = unsafe { (StructOut::required(info, regions)?, share_basis(basis, regions)?) };
        let basis = &shared.basis;
        let deepest = basis.components().map(|component| component.level).max();
        out.write(&SinewBasisInfo {
            struct_bytes: size_of::<SinewBasisInfo>(),
            vertex_count: basis.vertex_count() as u32,
            face_count: basis.face_count() as u32,
            control_count: basis.component_count() as u32,
            level_count: deepest.map_or(0, |level| level + 1),
            content_id: basis.id(),
            compact_id: basis.compact_id(),
            fast_node_count: basis.fast_node_count().unwrap_or(0) as u32,
            render_vertex_count: basis.render_vertex_count() as u32,
            has_texture: (!basis.render_mesh().vertices.is_empty()).into(),
            fast_error_rms: basis.fast_error().map_or(0.0, |error| error.mixed_rms),
            fast_error_max: basis.fast_error().map_or(0.0, |error| error.mixed_max),
            fast_error_normals: basis.fast_error().map_or(0.0, |error| error.normal_rms),
        });
        Ok(())
    })
}

/// The triangles: three vertex indices each, counter-clockwise from outside, source order.
///
/// `indices` takes a pointer into the package, good as long as the package stands; `index_count` takes 3 F.
///
/// Errors: those of a handle; `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_faces(
    basis: *const SinewBasis,
    indices: *mut *const u32,
    index_count: *mut usize,
) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe { triangles(basis, indices, index_count, |basis| basis.faces()) }
}

/// The triangles of the render mesh, whose vertices `sinew_vertices_write` writes: those of `sinew_basis_faces` where the
/// package has no texture coordinates.
///
/// `indices` takes a pointer into the package, good as long as the package stands; `index_count` takes 3 F.
///
/// Errors: those of a handle; `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_render_faces(
    basis: *const SinewBasis,
    indices: *mut *const u32,
    index_count: *mut usize,
) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe {
        triangles(basis, indices, index_count, |basis| {
            let render = basis.render_mesh();
            if render.vertices.is_empty() {
                basis.faces()
            } else {
                render.faces
            }
        })
    }
}

/// # Safety
/// As for the functions above.
unsafe fn triangles(
    basis: *const SinewBasis,
    indices: *mut *const u32,
    index_count: *mut usize,
    faces: impl FnOnce(&Basis<'static>) -> &'static [[u32; 3]],
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let pointer = Out::required(indices, "indices", regions)?;
        let count = Out::required(index_count, "index_count", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let faces = faces(&shared.basis).as_flattened();
        // SAFETY: the caller's promise, both.
        unsafe {
            pointer.write(faces.as_ptr());
            count.write(faces.len());
        }
        Ok(())
    })
}

fn component(basis: &Basis<'static>, control: u32) -> Result<Component<'static>, Fault> {
    let (component, component_count) = (control as usize, basis.component_count());
    if component < component_count {
        Ok(basis.component(component))
    } else {
        Err(Fault::Control(ControlError::NoSuchComponent {
            component,
            component_count,
        }))
    }
}

/// The name of a control, UTF-8, ended by NUL. `SINEW_NAME_BYTES` are always enough.
///
/// Errors: those of a handle; `NO_SUCH_CONTROL`, `TOO_SHORT` (nothing was written), `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `name` is NULL or writable for `name_bytes`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_control_name(
    basis: *const SinewBasis,
    control: u32,
    name: *mut c_char,
    name_bytes: usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        present(name, "name")?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let text = component(&shared.basis, control)?.name.as_bytes();
        array(name, name_bytes, text.len() + 1, "name", Access::Write, regions)?;
        // SAFETY: the buffer is that long, and apart from the package.
        unsafe {
            text.as_ptr().copy_to_nonoverlapping(name.cast(), text.len());
            name.add(text.len()).write(0);
        }
        Ok(())
    })
}

/// The control of this name, which ends with NUL. Takes time in proportion to the number of controls.
///
/// Errors: those of a handle; `NO_SUCH_NAME`, `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `name` is NULL or readable up to its NUL; `control` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_control_find(
    basis: *const SinewBasis,
    name: *const c_char,
    control: *mut u32,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        present(name, "name")?;
        let out = Out::required(control, "control", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let mut text = [0; NAME_BYTES];
        // SAFETY: nothing is read behind the NUL.
        let name = unsafe { bounded(name, &mut text) }.ok_or(Fault::NoSuchName)?;
        let found = shared.basis.component_named(name).ok_or(Fault::NoSuchName)?;
        // SAFETY: the caller's promise.
        unsafe { out.write(found as u32) };
        Ok(())
    })
}

/// Copies a string, if it is no longer than a name may be.
///
/// # Safety
/// `name` is readable up to its NUL.
unsafe fn bounded(name: *const c_char, text: &mut [u8; NAME_BYTES]) -> Option<&str> {
    for at in 0..=NAME_BYTES {
        // SAFETY: no NUL came before.
        let byte = unsafe { name.add(at).read() } as u8;
        if byte == 0 {
            return core::str::from_utf8(&text[..at]).ok();
        }
        *text.get_mut(at)? = byte;
    }
    None
}

/// The stops of a control: `minimum <= 0 <= maximum`, the range seen in training. 0 is at rest.
///
/// `minimum`, `maximum`: NULL where not wanted.
///
/// Errors: those of a handle; `NO_SUCH_CONTROL`, `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_control_range(
    basis: *const SinewBasis,
    control: u32,
    minimum: *mut f32,
    maximum: *mut f32,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let lower = Out::optional(minimum, "minimum", regions)?;
        let upper = Out::optional(maximum, "maximum", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let component = component(&shared.basis, control)?;
        // SAFETY: the caller's promise, both.
        unsafe {
            lower.write(component.minimum);
            upper.write(component.maximum);
        }
        Ok(())
    })
}

/// Where a control stands in the tree of components.
///
/// `parent` takes the control above it, or `SINEW_NONE` for a coarse one; `level` takes 0 for coarse ones, 1 for their
/// children and so on. Either may be NULL where not wanted.
///
/// Errors: those of a handle; `NO_SUCH_CONTROL`, `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_control_parent(
    basis: *const SinewBasis,
    control: u32,
    parent: *mut u32,
    level: *mut u32,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let above = Out::optional(parent, "parent", regions)?;
        let depth = Out::optional(level, "level", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let component = component(&shared.basis, control)?;
        // SAFETY: the caller's promise, both.
        unsafe {
            above.write(component.parent.map_or(SINEW_NONE, |k| k as u32));
            depth.write(component.level);
        }
        Ok(())
    })
}
