//! Output on the tiny package, whose texture is torn and mirrored along the middle column, and on one without texture.

use std::vec;
use std::vec::Vec;

use sinew_formats::package::{AlignedBytes, fixture::tiny_baked, write_baked};

use super::*;
use crate::error::FrameError;
use crate::fixture::{Package, memory_for, open, workspace_in};
use crate::{Controls, Frame};

/// Roundings of a unit vector.
const TOLERANCE: f32 = 1e-6;
/// Half a step of the encoding.
const SNORM16_TOLERANCE: f32 = 0.5 / 32767.0 + TOLERANCE;
const SNORM8_TOLERANCE: f32 = 0.5 / 127.0 + TOLERANCE;
const UNTOUCHED: u8 = 0xa5;

fn torn() -> AlignedBytes {
    write_baked(&tiny_baked().basis()).unwrap()
}

/// Positions and normals with every control at `weight`.
fn frame(basis: &Basis<'_>, weight: f32) -> [Vec<[f32; 3]>; 2] {
    let mut memory = memory_for(basis);
    let mut workspace = workspace_in(basis, &mut memory);
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(basis, &mut weights).unwrap();
    for k in 0..basis.component_count() {
        controls.set(k, weight).unwrap();
    }
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    let job = Frame {
        basis,
        controls: &controls,
        positions: &mut positions,
        normals: Some(&mut normals),
    };
    job.run(&mut workspace).unwrap();
    [positions, normals]
}

fn write(
    basis: &Basis<'_>,
    [positions, normals]: &[Vec<[f32; 3]>; 2],
    layout: VertexLayout,
    bytes: &mut [u8],
) -> Bounds {
    let mut scratch = vec![[f32::NAN; 4]; basis.render_vertex_count()];
    let job = VertexOutput {
        basis,
        positions,
        normals: Some(normals),
        scratch: &mut scratch,
        layout,
        bytes,
    };
    job.run().unwrap()
}

fn at(offset_bytes: usize, stride_bytes: usize) -> Option<Attribute> {
    Some(Attribute {
        offset_bytes,
        stride_bytes,
    })
}

fn floats<const N: usize>(bytes: &[u8], at: Option<Attribute>, r: usize) -> [f32; N] {
    let first = at.unwrap().offset_bytes + r * at.unwrap().stride_bytes;
    core::array::from_fn(|c| f32::from_le_bytes(bytes[first + 4 * c..][..4].try_into().unwrap()))
}

#[test]
fn interleaved_and_separate_buffers_hold_the_frame() {
    let package = torn();
    let basis = Basis::open(&package).unwrap();
    let frame = frame(&basis, 0.6);
    let (surface, count) = (basis.surface(), basis.render_vertex_count());
    assert!(count > basis.vertex_count());
    // 3 bytes in front, 50 a vertex of which 2 belong to nothing.
    let interleaved = VertexLayout {
        positions: at(3, 50),
        normals: at(15, 50),
        tangents: at(29, 50),
        texture_coordinates: at(45, 50),
        encoding: UnitEncoding::Float32,
    };
    let separate = VertexLayout {
        positions: Some(Attribute::packed(0, 12)),
        normals: Some(Attribute::packed(12 * count, 12)),
        tangents: Some(Attribute::packed(24 * count, 16)),
        texture_coordinates: Some(Attribute::packed(40 * count, 8)),
        encoding: UnitEncoding::Float32,
    };
    for (layout, length) in [(interleaved, 53 + 50 * count), (separate, 48 * count)] {
        let mut bytes = vec![UNTOUCHED; length];
        write(&basis, &frame, layout, &mut bytes);
        for (r, v) in basis.render_vertices().enumerate() {
            assert_eq!(floats::<3>(&bytes, layout.positions, r), frame[0][v as usize]);
            assert_eq!(floats::<3>(&bytes, layout.normals, r), frame[1][v as usize]);
            assert_eq!(floats::<2>(&bytes, layout.texture_coordinates, r), surface.uvs[r]);
        }
        if layout == interleaved {
            let gaps = (0..count).map(|r| &bytes[3 + 50 * r + 24..][..2]);
            assert!(gaps.chain([&bytes[..3]]).flatten().all(|&byte| byte == UNTOUCHED));
        }
    }
}

#[test]
fn tangents_follow_the_texture_and_say_where_it_is_mirrored() {
    let package = torn();
    let basis = Basis::open(&package).unwrap();
    let layout = VertexLayout {
        tangents: at(0, 16),
        ..VertexLayout::default()
    };
    for weight in [0.0, 0.5] {
        let frame = frame(&basis, weight);
        let mut bytes = vec![0; 16 * basis.render_vertex_count()];
        write(&basis, &frame, layout, &mut bytes);
        for (r, v) in basis.render_vertices().enumerate() {
            let [x, y, z, sign] = floats(&bytes, layout.tangents, r);
            let n = frame[1][v as usize];
            assert!((x * x + y * y + z * z - 1.0).abs() < TOLERANCE);
            assert!((n[0] * x + n[1] * y + n[2] * z).abs() < TOLERANCE);
            // Left of the fold u grows with x, right of it against it.
            let is_mirrored = basis
                .surface()
                .drawn_faces()
                .iter()
                .zip(basis.faces().iter())
                .any(|(corners, face)| corners.contains(&(r as u32)) && face.iter().any(|v| v % 3 == 2));
            assert_eq!(sign, if is_mirrored { -1.0 } else { 1.0 });
            assert!(x * sign > 0.5, "render vertex {r}: {x} {sign}");
        }
    }
}

#[test]
fn integers_are_the_nearest() {
    let package = torn();
    let basis = Basis::open(&package).unwrap();
    let frame = frame(&basis, 0.6);
    let count = basis.render_vertex_count();
    let exact = VertexLayout {
        normals: at(0, 28),
        tangents: at(12, 28),
        ..VertexLayout::default()
    };
    let mut floating = vec![0; 28 * count];
    write(&basis, &frame, exact, &mut floating);
    for (encoding, size, tolerance) in [
        (UnitEncoding::Snorm16, 8, SNORM16_TOLERANCE),
        (UnitEncoding::Snorm8, 4, SNORM8_TOLERANCE),
    ] {
        let layout = VertexLayout {
            normals: at(0, 2 * size),
            tangents: at(size, 2 * size),
            encoding,
            ..VertexLayout::default()
        };
        assert_eq!(layout.size_bytes(AttributeName::Normals), size);
        let mut bytes = vec![0; 2 * size * count];
        write(&basis, &frame, layout, &mut bytes);
        let number = |first: usize, c: usize| match encoding {
            UnitEncoding::Snorm16 => {
                f32::from(i16::from_le_bytes(bytes[first + 2 * c..][..2].try_into().unwrap())) / 32767.0
            }
            _ => f32::from(bytes[first + c] as i8) / 127.0,
        };
        for r in 0..count {
            let normal = floats::<3>(&floating, exact.normals, r);
            let tangent = floats::<4>(&floating, exact.tangents, r);
            let first = 2 * size * r;
            assert!((0..3).all(|c| (number(first, c) - normal[c]).abs() <= tolerance));
            assert_eq!(number(first, 3), 0.0);
            assert!((0..4).all(|c| (number(first + size, c) - tangent[c]).abs() <= tolerance));
        }
    }
}

#[test]
fn without_texture_the_render_vertices_are_the_slots() {
    let package = Package::small(1);
    let basis = open(&package);
    let frame = frame(&basis, 0.4);
    assert_eq!(basis.render_vertex_count(), basis.vertex_count());
    let layout = VertexLayout {
        positions: at(0, 12),
        ..VertexLayout::default()
    };
    let mut bytes = vec![0; 12 * basis.vertex_count()];
    let found = write(&basis, &frame, layout, &mut bytes);
    for (v, p) in frame[0].iter().enumerate() {
        let slot = basis.slot_from_vertex().at(v) as usize;
        assert_eq!(floats::<3>(&bytes, layout.positions, slot), *p);
    }
    let drawn = basis.surface().drawn_faces();
    assert!(
        drawn
            .iter()
            .flatten()
            .all(|slot| (slot as usize) < basis.vertex_count())
    );
    for c in 0..3 {
        let values = || frame[0].iter().map(|p| p[c]);
        assert_eq!(found.minimum[c], values().fold(f32::MAX, f32::min));
        assert_eq!(found.maximum[c], values().fold(f32::MIN, f32::max));
    }
}

#[test]
fn validity() {
    let (package, plain) = (torn(), Package::small(1));
    let (basis, plain) = (Basis::open(&package).unwrap(), open(&plain));
    let (count, vertex_count) = (basis.render_vertex_count(), basis.vertex_count());
    let input = vec![[0.5; 3]; 64];
    let run = |basis: &Basis<'_>, counts: [usize; 4], has_normals: bool, layout| {
        let [positions, normals, scratch, length] = counts;
        let (mut scratch, mut bytes) = (vec![[0.0; 4]; scratch], vec![UNTOUCHED; length]);
        let job = VertexOutput {
            basis,
            positions: &input[..positions],
            normals: has_normals.then_some(&input[..normals]),
            scratch: &mut scratch,
            layout,
            bytes: &mut bytes,
        };
        let checked = job.validate();
        let outcome = job.run();
        assert_eq!(outcome.map(|_| ()), checked);
        let untouched = bytes.iter().all(|&byte| byte == UNTOUCHED);
        assert!(outcome.is_ok() || untouched, "nothing was written");
        outcome.map(|_| ())
    };
    let all = VertexLayout {
        positions: at(0, 48),
        normals: at(12, 48),
        tangents: at(24, 48),
        texture_coordinates: at(40, 48),
        encoding: UnitEncoding::Float32,
    };
    let good = [vertex_count, vertex_count, count, 48 * count];
    assert_eq!(run(&basis, good, true, all), Ok(()));
    let wrong = |buffer| {
        Err(OutputError::Input(FrameError::WrongLength {
            buffer,
            expected: vertex_count,
            actual: vertex_count + 1,
        }))
    };
    let with = |place: usize, value| {
        let mut counts = good;
        counts[place] = value;
        counts
    };
    assert_eq!(
        run(&basis, with(0, vertex_count + 1), true, all),
        wrong(Buffer::Positions)
    );
    assert_eq!(
        run(&basis, with(1, vertex_count + 1), true, all),
        wrong(Buffer::Normals)
    );
    assert_eq!(
        run(&basis, with(2, count - 1), true, all),
        Err(OutputError::ScratchTooShort {
            expected: count,
            actual: count - 1
        })
    );
    let short = run(&basis, with(3, 48 * count - 1), true, all);
    let required_bytes = 48 * count;
    assert_eq!(
        short,
        Err(OutputError::BufferTooShort {
            attribute: AttributeName::TextureCoordinates,
            required_bytes,
            actual_bytes: required_bytes - 1
        })
    );
    let missing = |attribute| Err(OutputError::NormalsMissing { attribute });
    assert_eq!(run(&basis, good, false, all), missing(AttributeName::Normals));
    let only_tangents = VertexLayout { normals: None, ..all };
    assert_eq!(
        run(&basis, good, false, only_tangents),
        missing(AttributeName::Tangents)
    );
    let overlapping = VertexLayout {
        normals: at(8, 48),
        ..all
    };
    let (first, second) = (AttributeName::Positions, AttributeName::Normals);
    assert_eq!(
        run(&basis, good, true, overlapping),
        Err(OutputError::Overlap { first, second })
    );

    let many = [plain.vertex_count(), plain.vertex_count(), 64, 4096];
    let no_texture = |attribute| Err(OutputError::NoTexture { attribute });
    assert_eq!(run(&plain, many, true, all), no_texture(AttributeName::Tangents));
    let without = VertexLayout { tangents: None, ..all };
    assert_eq!(
        run(&plain, many, true, without),
        no_texture(AttributeName::TextureCoordinates)
    );
    let nothing = VertexLayout::default();
    assert_eq!(run(&plain, [30, 30, 0, 0], false, nothing), Ok(()), "the box alone");
}
