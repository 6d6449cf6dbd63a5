//! Vertex normals, four vertices at a time. What is computed is said at the reference, which runs the last vertices that make
//! no four.

use sinew_formats::package::{FAN_VERTICES, Index};
use wide::f32x4;

use super::lanes::{Four, load};
use crate::simd::generic::normals::{Around, normals_from, unit};
use crate::simd::generic::solve::Xyz0;

/// x, y and z of four points.
type Points = [f32x4; 3];

/// See [`normals`](crate::simd::generic::normals::normals).
pub(crate) fn normals<I: Index>(around: &Around<'_, I>, posed: &[Xyz0], normals: &mut [[f32; 3]]) {
    let (rows, _) = around.vertex_from_slot.as_chunks::<FAN_VERTICES>();
    let centres = posed.as_chunks::<FAN_VERTICES>().0;
    for (row, (vertices, centre)) in rows.iter().zip(centres).enumerate() {
        let fan = &around.fans[around.offsets[row] as usize..around.offsets[row + 1] as usize];
        let [x, y, z] = unit(area(posed, centre, fan).map(Four)).map(|Four(n)| n.to_array());
        for (lane, &v) in vertices.iter().enumerate() {
            normals[v.at()] = [x[lane], y[lane], z[lane]];
        }
    }
    normals_from(rows.len() * FAN_VERTICES, around, posed, normals);
}

/// Twice the area vectors around four vertices.
#[inline(always)]
fn area<I: Index>(posed: &[Xyz0], centre: &[Xyz0; FAN_VERTICES], fan: &[[I; FAN_VERTICES]]) -> Points {
    let points = |step: &[I; FAN_VERTICES]| by_coordinate(step.map(|slot| &posed[slot.at()]));
    let p = by_coordinate(centre.each_ref());
    let mut sum = [f32x4::ZERO; 3];
    let mut add = |a: &Points, b: &Points, c: &Points| {
        let mut edge = p;
        let mut across = p;
        for n in 0..3 {
            edge[n] = b[n] - p[n];
            across[n] = c[n] - a[n];
        }
        for n in 0..3 {
            let (i, j) = ((n + 1) % 3, (n + 2) % 3);
            sum[n] += edge[i] * across[j] - edge[j] * across[i];
        }
    };
    if let Some((first, rest)) = fan.split_first() {
        let mut a = points(first);
        let (pairs, last) = rest.as_chunks::<2>();
        for [b, c] in pairs {
            let c = points(c);
            add(&a, &points(b), &c);
            a = c;
        }
        if let [b] = last {
            add(&a, &points(b), &p);
        }
    }
    sum
}

#[inline(always)]
fn by_coordinate(rows: [&Xyz0; FAN_VERTICES]) -> Points {
    let [x, y, z, _] = f32x4::transpose(rows.map(|row| load(row)));
    [x, y, z]
}
