//! The basis handle: an opened package and what it says of its mesh and its controls. Read by all, written by none.

use core::ffi::{c_char, c_void};

use sinew_formats::package::{NONE, limits::NAME_BYTES};
use sinew_runtime::{Basis, Component, ControlError, Faces, PoseError, TierChoice};

use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Shared};
use crate::kind::Kind;
use crate::memory::{Access, Out, Region, Regions, SinewLayout, handle_memory, present, slice, slice_mut, write_text};
use crate::number;
use crate::status::SinewStatus;
use crate::structs::{GrowingStruct, StructOut, choice};
use crate::version::check_abi;

/// Bytes of a buffer that holds any control's name, with the NUL.
pub const SINEW_NAME_BYTES: usize = 65;
/// Stands where an index is absent: the parent of a coarse control.
pub const SINEW_NONE: u32 = u32::MAX;

const _: () = assert!(SINEW_NAME_BYTES == NAME_BYTES + 1 && SINEW_NONE == NONE);

/// An opened package. Refers to the package's bytes.
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

/// What a package holds.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewBasisInfo {
    /// Set by `SINEW_INIT`.
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
    /// R: vertices that an engine draws, split where texture coordinates do; V where the package has none.
    pub render_vertex_count: u32,
    /// Whether the package has texture coordinates: 0 or 1.
    pub has_texture: u32,
    /// B: bones of the package; 0: it has none, and what follows is 0.
    pub bone_count: u32,
    /// Bones that a vertex follows at most: 4 or 8.
    pub bone_influences: u32,
    /// Root mean square distance of the bones from the exact tier, half of the controls anywhere within 70 % of their ranges,
    /// as a share of the diagonal of the rest shape's bounding box; measured when the package was baked.
    pub bone_error_rms: f32,
    /// Greatest such distance.
    pub bone_error_max: f32,
    /// Root mean square angle between the normals of both tiers in those poses, radians.
    pub bone_error_normals: f32,
    /// Whether the package has the exact tier: 0 or 1. Without it workspaces play the bones, and nothing can be held.
    pub has_exact_tier: u32,
}

// SAFETY: `repr(C)`, the size first, numbers only.
unsafe impl GrowingStruct for SinewBasisInfo {
    const NAME: &'static str = "info";
    const FIRST_BYTES: usize = size_of::<Self>();
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

/// Checks a package in the caller's memory and opens it.
///
/// # Safety
/// `bytes` is null or readable for `length`, and stays in place, unchanged, as long as the result is used.
pub(crate) unsafe fn open_package(
    bytes: *const c_void,
    length: usize,
    regions: &mut Regions,
) -> Result<BasisBody, Fault> {
    // SAFETY: the caller's promise.
    let package = unsafe { slice(bytes.cast::<u8>(), length, length, "bytes", regions)? };
    Ok(BasisBody {
        package: Region::new(package.as_ptr(), length, "package", Access::Read)?,
        basis: Basis::open(package)?,
    })
}

/// How much memory a basis needs; the same for every package.
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
/// of the package. Copies nothing. Some milliseconds for some ten thousand vertices.
///
/// `abi_version`: pass `SINEW_ABI_VERSION`.
/// `bytes`, `length`: the whole package, at a multiple of 16; frames are fastest where it is one of 64.
///
/// Opening again in the same memory is allowed when nothing uses the old handle.
///
/// Errors: `WRONG_ABI`, `PACKAGE_REFUSED`.
///
/// # Safety
/// Pointers are NULL or point to memory of the stated lengths. `bytes` and `memory` stay in place, and are written by nobody
/// else, until the last use of the basis.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_open(
    abi_version: u32,
    bytes: *const c_void,
    length: usize,
    memory: *mut c_void,
    memory_bytes: usize,
    basis: *mut *mut SinewBasis,
    details: *mut SinewDetails,
) -> SinewStatus {
    let open = |regions: &mut Regions| {
        check_abi(abi_version)?;
        let layout = Handle::<BasisBody>::layout(0);
        let memory = handle_memory(memory, memory_bytes, layout, regions)?;
        let out = Out::required(basis, "basis", regions)?;
        // SAFETY: the caller's promise; the memory was checked against this layout.
        unsafe {
            let body = open_package(bytes, length, regions)?;
            out.write(Handle::create(memory, layout, |_| Ok(body))?.cast());
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, open) }
}

/// Counts and identities.
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
        let error = basis
            .bones()
            .map_or(PoseError::default(), |bones| bones.error().sliders);
        let deepest = basis.components().map(|component| component.level).max();
        out.write(&SinewBasisInfo {
            struct_bytes: size_of::<SinewBasisInfo>(),
            vertex_count: basis.vertex_count() as u32,
            face_count: basis.face_count() as u32,
            control_count: basis.component_count() as u32,
            level_count: deepest.map_or(0, |level| level + 1),
            content_id: basis.id(),
            compact_id: basis.compact_id(),
            render_vertex_count: basis.render_vertex_count() as u32,
            has_texture: basis.surface().has_texture().into(),
            bone_count: basis.bones().map_or(0, |bones| bones.count()) as u32,
            bone_influences: basis.bones().map_or(0, |bones| bones.influences()) as u32,
            bone_error_rms: error.rms,
            bone_error_max: error.max,
            bone_error_normals: error.normal_rms,
            has_exact_tier: basis.has_tier(TierChoice::Exact).into(),
        });
        Ok(())
    })
}

/// The way round in which a triangle's corners are written.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewWinding {
    /// As in the source: counter-clockwise, seen from outside.
    CounterClockwise = 0,
    /// The other way: for engines whose front faces are clockwise, or for axes that mirror; not for both.
    Clockwise = 1,
}

/// The triangles by vertices: three indices each, in the order of the source.
///
/// `indices`, `index_count`: take 3 F.
///
/// Errors: `UNKNOWN_OPTION`.
///
/// # Safety
/// `basis` is NULL or a basis; `indices` is NULL or writable for `index_count`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_faces(
    basis: *const SinewBasis,
    winding: number::SinewWinding,
    indices: *mut u32,
    index_count: usize,
) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe { triangles(basis, winding, indices, index_count, |basis| basis.faces()) }
}

/// The triangles by render vertices, which `sinew_vertices_write` writes: what an engine draws.
///
/// `indices`, `index_count`: take 3 F.
///
/// Errors: `UNKNOWN_OPTION`.
///
/// # Safety
/// `basis` is NULL or a basis; `indices` is NULL or writable for `index_count`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_basis_render_faces(
    basis: *const SinewBasis,
    winding: number::SinewWinding,
    indices: *mut u32,
    index_count: usize,
) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe {
        triangles(basis, winding, indices, index_count, |basis| {
            basis.surface().drawn_faces()
        })
    }
}

/// # Safety
/// As for the functions above.
unsafe fn triangles(
    basis: *const SinewBasis,
    winding: number::SinewWinding,
    indices: *mut u32,
    index_count: usize,
    faces: impl FnOnce(&Basis<'static>) -> Faces<'static>,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let corners = choice("winding", winding, &[[0, 1, 2], [0, 2, 1]])?;
        let faces = faces(&shared.basis);
        // SAFETY: the caller's promise.
        let out = unsafe { slice_mut(indices, index_count, 3 * faces.len(), "indices", regions)? };
        for (out, face) in out.as_chunks_mut::<3>().0.iter_mut().zip(faces.iter()) {
            *out = corners.map(|corner: usize| face[corner]);
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
/// Errors: `NO_SUCH_CONTROL`.
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
        // SAFETY: the caller's promise, both.
        unsafe {
            let shared = share_basis(basis, regions)?;
            let text = component(&shared.basis, control)?.name;
            write_text(text, name, name_bytes, "name", regions)
        }
    })
}

/// The control of this name, which ends with NUL. Looks at one name after the other.
///
/// Errors: `NO_SUCH_NAME`.
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
/// Errors: `NO_SUCH_CONTROL`.
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
/// Errors: `NO_SUCH_CONTROL`.
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
