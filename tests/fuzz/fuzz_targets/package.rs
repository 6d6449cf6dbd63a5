//! Packages that get past the checksums, opened and played through the C functions: nothing that opens may end a call
//! with `INTERNAL` (a panic), give a number that is not finite, or touch memory that is not its own.
//!
//! Bytes of an input: one for the number of edits, eight for each edit of the hand-made package, then five for each
//! setting of a control. Header, checksum and content id are made to fit, so coverage leads into the rules and the frame.
#![no_main]

use core::ptr::null_mut;
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

static PACKAGE: LazyLock<AlignedBytes> =
    LazyLock::new(|| write_baked(&tiny_baked().basis()).expect("the fixture is valid"));

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
        let (mut basis, mut workspace, mut controls) = (null_mut(), null_mut(), null_mut());
        let mut room = memory(layout_bytes(|layout| sinew_basis_layout(layout)));
        let (at, bytes) = (room.as_mut_ptr().cast(), 64 * room.len());
        let (start, length) = (package.as_ptr(), package.len());
        let status = sinew_basis_open(SINEW_ABI_VERSION, start, length, at, bytes, &mut basis, null_mut());
        if status != SinewStatus::Ok {
            assert_ne!(status, SinewStatus::Internal);
            return;
        }
        let mut info = SinewBasisInfo {
            struct_bytes: size_of::<SinewBasisInfo>(),
            vertex_count: 0,
            face_count: 0,
            control_count: 0,
            level_count: 0,
            content_id: [0; 16],
            compact_id: [0; 16],
        };
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

        let mut room = memory(layout_bytes(|layout| sinew_workspace_layout(basis, layout)));
        let (at, bytes) = (room.as_mut_ptr().cast(), 64 * room.len());
        let status = sinew_workspace_create(basis, at, bytes, &mut workspace, null_mut());
        assert_eq!(status, SinewStatus::Ok);
        let mut room = memory(layout_bytes(|layout| sinew_controls_layout(basis, layout)));
        let (at, bytes) = (room.as_mut_ptr().cast(), 64 * room.len());
        let status = sinew_controls_create(basis, at, bytes, &mut controls, null_mut());
        assert_eq!(status, SinewStatus::Ok);

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
    }
}
