//! Packages that get past the checksums, opened and played through the C functions: nothing that opens may end a call
//! with `INTERNAL` (a panic), give a number that is not finite, or touch memory that is not its own.
//!
//! Bytes of an input: one for the number of edits, eight for each edit of the hand-made package, then five for each
//! setting of a control. Header, checksum and content id are made to fit, so coverage leads into the rules and the frame.
#![no_main]

use core::ptr::{null, null_mut};
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use sinew::*;
use sinew_formats::package::{AlignedBytes, HEADER_BYTES, Header, PackageKind, fixture::tiny_baked, write_baked};

/// Aligned as every layout asks.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct Line([u8; 64]);

fn memory(byte_count: usize) -> Vec<Line> {
    vec![Line([0; 64]); byte_count.div_ceil(64)]
}

fn layout_bytes(ask: impl FnOnce(*mut SinewLayout) -> SinewStatus) -> usize {
    let mut layout = SinewLayout {
        size_bytes: 0,
        alignment: 0,
    };
    assert_eq!(ask(&mut layout), SinewStatus::Ok);
    layout.size_bytes
}

static PACKAGE: LazyLock<AlignedBytes> = LazyLock::new(|| {
    let mut baked = tiny_baked();
    baked.bones = Some(baked.three_bones());
    write_baked(&baked.basis()).expect("the fixture is valid")
});

/// The hand-made package with words written over; an edit is place and value, both in full.
fn edited(edits: &[[u8; 8]]) -> AlignedBytes {
    let mut package = PACKAGE.clone();
    let (header, payload) = package.as_mut_slice().split_at_mut(HEADER_BYTES);
    for edit in edits {
        let [a, b, c, d, value @ ..] = *edit;
        // The last byte of the place says how many bytes of the value are written.
        let (at, length) = (u32::from_le_bytes([a, b, c, 0]) as usize, 1 + usize::from(d % 4));
        let at = at % (payload.len() - length);
        payload[at..at + length].copy_from_slice(&value[..length]);
    }
    header.copy_from_slice(&Header::for_payload(PackageKind::Baked, payload).to_bytes());
    package
}

fuzz_target!(|data: &[u8]| {
    let Some((&edit_count, data)) = data.split_first() else {
        return;
    };
    let (edits, _) = data.as_chunks::<8>();
    let edits = &edits[..edits.len().min(usize::from(edit_count % 32))];
    play(&edited(edits), &data[8 * edits.len()..]);
});

fn play(package: &[u8], settings: &[u8]) {
    // SAFETY: all memory is as long as the layouts say and outlives the calls.
    unsafe {
        let (start, length) = (package.as_ptr().cast(), package.len());
        let mut layout = SinewLayout {
            size_bytes: 0,
            alignment: 0,
        };
        let status = sinew_player_layout(start, length, null(), &mut layout, null_mut());
        if status != SinewStatus::Ok {
            // An edit can take the exact tier out of a package that stays valid.
            assert!(
                matches!(status, SinewStatus::PackageRefused | SinewStatus::NeedsExactTier),
                "{status:?}"
            );
            return;
        }
        let mut room = memory(layout.size_bytes);
        let (at, bytes) = (room.as_mut_ptr().cast(), 64 * room.len());
        let mut player: SinewPlayer = core::mem::zeroed();
        player.struct_bytes = size_of::<SinewPlayer>();
        let status = sinew_player_open(
            SINEW_ABI_VERSION,
            start,
            length,
            null(),
            at,
            bytes,
            &mut player,
            null_mut(),
        );
        assert_eq!(status, SinewStatus::Ok);
        let SinewPlayer {
            basis,
            workspace,
            controls,
            ..
        } = player;
        // SAFETY: numbers only.
        let mut info: SinewBasisInfo = core::mem::zeroed();
        info.struct_bytes = size_of::<SinewBasisInfo>();
        assert_eq!(sinew_basis_info(basis, &mut info), SinewStatus::Ok);
        for control in 0..info.control_count {
            let mut name = [0; SINEW_NAME_BYTES];
            let mut found = 0;
            assert_eq!(
                sinew_control_name(basis, control, name.as_mut_ptr(), name.len()),
                SinewStatus::Ok
            );
            assert_eq!(sinew_control_find(basis, name.as_ptr(), &mut found), SinewStatus::Ok);
            assert_eq!(found, control);
        }

        let floats = 3 * info.vertex_count as usize;
        let (mut positions, mut normals) = (vec![0.0_f32; floats], vec![0.0_f32; floats]);
        let options = SinewFrameOptions {
            struct_bytes: size_of::<SinewFrameOptions>(),
            positions: positions.as_mut_ptr(),
            position_floats: floats,
            normals: normals.as_mut_ptr(),
            normal_floats: floats,
        };
        for &[control, weight @ ..] in settings.as_chunks::<5>().0 {
            let (control, weight) = (u32::from(control), f32::from_le_bytes(weight));
            if control & 0x80 == 0 {
                sinew_control_set(controls, control, weight, null_mut());
            } else {
                sinew_control_set_unclamped(controls, control & 0x7f, weight);
            }
            let status = sinew_frame(basis, workspace, controls, &options, null_mut(), null_mut());
            assert!(
                matches!(status, SinewStatus::Ok | SinewStatus::FrameOverflow),
                "{status:?}"
            );
            assert!(positions.iter().chain(&normals).all(|x| x.is_finite()));
        }
        write_vertices(basis, &info, &positions, &normals);
        drag(basis, &info, workspace, controls, settings);
        if info.bone_count > 0 {
            play_bones(basis, controls, &mut positions, &mut normals);
        }
    }
}

/// A vertex buffer of everything that the package has.
unsafe fn write_vertices(basis: *const SinewBasis, info: &SinewBasisInfo, positions: &[f32], normals: &[f32]) {
    let count = info.render_vertex_count as usize;
    let (mut bytes, mut scratch) = (vec![0_u8; 48 * count], vec![0.0_f32; 4 * count]);
    let textured = if info.has_texture == 1 { 48 } else { 0 };
    let options = SinewVertexOptions {
        struct_bytes: size_of::<SinewVertexOptions>(),
        positions: positions.as_ptr(),
        position_floats: positions.len(),
        normals: normals.as_ptr(),
        normal_floats: normals.len(),
        bytes: bytes.as_mut_ptr().cast(),
        byte_count: bytes.len(),
        scratch: scratch.as_mut_ptr(),
        scratch_floats: scratch.len(),
        position_offset: 0,
        position_stride: 48,
        normal_offset: 12,
        normal_stride: 48,
        tangent_offset: 24,
        tangent_stride: textured,
        texture_offset: 40,
        texture_stride: textured,
        encoding: 0,
    };
    // SAFETY: all memory stands.
    let status = unsafe { sinew_vertices_write(basis, &options, null_mut(), null_mut()) };
    assert_eq!(status, SinewStatus::Ok);
    assert!(
        bytes
            .as_chunks::<4>()
            .0
            .iter()
            .all(|x| f32::from_ne_bytes(*x).is_finite())
    );
}

/// Pins two vertices and drags them to where the settings say.
unsafe fn drag(
    basis: *const SinewBasis,
    info: &SinewBasisInfo,
    workspace: *mut SinewWorkspace,
    controls: *mut SinewControls,
    settings: &[u8],
) {
    unsafe {
        let mut pins = null_mut();
        let mut room = memory(layout_bytes(|layout| sinew_pins_layout(basis, 2, layout)));
        let (at, bytes) = (room.as_mut_ptr().cast(), 64 * room.len());
        let status = sinew_pins_create(basis, 2, at, bytes, &mut pins, null_mut());
        assert_eq!(status, SinewStatus::Ok);
        for &[vertex, aim @ ..] in settings.as_chunks::<5>().0.iter().take(8) {
            let vertex = u32::from(vertex) % (info.vertex_count + 1);
            let number = f32::from_le_bytes(aim);
            let added = sinew_pins_add(basis, pins, workspace, vertex, null_mut());
            let aimed = sinew_pins_move(pins, vertex, [number, 0.5, -number].as_ptr());
            let dragged = sinew_pins_drag(basis, pins, workspace, controls, null_mut(), null_mut());
            assert!(![added, aimed].contains(&SinewStatus::Internal));
            assert!(
                matches!(dragged, SinewStatus::Ok | SinewStatus::PinOverflow),
                "{dragged:?}"
            );
        }
        let mut weights = vec![f32::NAN; info.control_count as usize];
        let status = sinew_controls_get_all(controls, weights.as_mut_ptr(), weights.len());
        assert_eq!(status, SinewStatus::Ok);
        assert!(weights.iter().all(|weight| weight.is_finite()));
    }
}

/// A frame of the bones, as a batch of one.
unsafe fn play_bones(
    basis: *const SinewBasis,
    controls: *mut SinewControls,
    positions: &mut [f32],
    normals: &mut [f32],
) {
    unsafe {
        let options = SinewWorkspaceOptions {
            struct_bytes: size_of::<SinewWorkspaceOptions>(),
            tier: SinewTier::Bones as i32,
            kernels: 0,
        };
        let (mut workspace, mut batch) = (null_mut(), null_mut());
        let mut room = memory(layout_bytes(|layout| sinew_workspace_layout(basis, &options, layout)));
        let (at, bytes) = (room.as_mut_ptr().cast(), 64 * room.len());
        let status = sinew_workspace_create(basis, &options, at, bytes, &mut workspace, null_mut());
        assert_eq!(status, SinewStatus::Ok);
        let instance = SinewInstance {
            workspace,
            controls,
            positions: positions.as_mut_ptr(),
            position_floats: positions.len(),
            normals: normals.as_mut_ptr(),
            normal_floats: normals.len(),
        };
        let mut room = memory(layout_bytes(|layout| sinew_batch_layout(1, layout)));
        let (at, bytes) = (room.as_mut_ptr().cast(), 64 * room.len());
        let size = size_of::<SinewInstance>();
        let status = sinew_batch_create(basis, &instance, 1, size, at, bytes, &mut batch, null_mut());
        assert_eq!(status, SinewStatus::Ok);
        assert_eq!(sinew_batch_play(basis, batch, null_mut(), null_mut()), SinewStatus::Ok);
        let mut report = SinewInstanceReport {
            struct_bytes: size_of::<SinewInstanceReport>(),
            status: SinewStatus::Internal,
            outcome: 0,
        };
        assert_eq!(sinew_batch_report(batch, 0, &mut report), SinewStatus::Ok);
        let status = report.status;
        assert!(
            matches!(status, SinewStatus::Ok | SinewStatus::FrameOverflow),
            "{status:?}"
        );
        assert!(positions.iter().chain(normals.iter()).all(|x| x.is_finite()));
    }
}
