//! Skin: every vertex follows a few bones, on the processor: for tests, bounds and hosts without a GPU. A shader computes the
//! same.
//!
//! `p = r + sum_b w_b (D_b (r - c) + o_b)`; the normal is that of the rest shape under the cofactors of `I + sum_b w_b D_b`, which
//! is right under shear too, made one long.

use sinew_formats::package::{BonesView, Index, NORMAL_UNIT, SKIN_WEIGHT_SUM};

use super::pose::{Map, centre};
use super::scaled::{cofactors, times};
use crate::basis::{Basis, with_index};
use crate::error::FrameError;
use crate::positions::Bounds;
use crate::simd::all::One;
use crate::simd::generic::normals::unit;

/// A weight of one unit.
const UNIT: f32 = 1.0 / SKIN_WEIGHT_SUM as f32;

/// Skins all vertices. Shape: `maps` `[B]`; `positions` and `normals` `[V]`, source order.
///
/// Errors: [`FrameError::NotFinite`], and then the outputs hold the rest shape.
pub(crate) fn skin(
    basis: &Basis<'_>,
    bones: &BonesView<'_>,
    maps: &[Map],
    positions: &mut [[f32; 3]],
    normals: Option<&mut [[f32; 3]]>,
) -> (Bounds, Result<(), FrameError>) {
    let blend = Blend { basis, bones, maps };
    let (bounds, trace) = match bones.skin.influences {
        8 => blend.skin::<8>(positions, normals),
        _ => blend.skin::<4>(positions, normals),
    };
    if trace == 0.0 {
        return (bounds, Ok(()));
    }
    let lost = positions.iter().position(|p| !p.iter().all(|x| x.is_finite()));
    (
        bounds,
        Err(FrameError::NotFinite {
            vertex: lost.unwrap_or(0),
        }),
    )
}

struct Blend<'b> {
    basis: &'b Basis<'b>,
    bones: &'b BonesView<'b>,
    maps: &'b [Map],
}

impl Blend<'_> {
    /// Bounds of what it wrote, and zero where all of it is finite.
    fn skin<const INFLUENCES: usize>(
        &self,
        positions: &mut [[f32; 3]],
        normals: Option<&mut [[f32; 3]]>,
    ) -> (Bounds, f32) {
        let centre = centre(self.bones);
        let rest = self.basis.rest_positions();
        let skin = &self.bones.skin;
        let rows = skin.bones.as_chunks::<INFLUENCES>().0;
        let weights = skin.weights.as_chunks::<INFLUENCES>().0;
        let (mut bounds, mut trace) = (Bounds::EMPTY, 0.0_f32);
        let mut normals = normals;
        for_each_vertex(self.basis, |slot, v| {
            let mut map = Map::default();
            for (&bone, &weight) in rows[slot].iter().zip(&weights[slot]) {
                let weight = f32::from(weight) * UNIT;
                for (sum, column) in map.iter_mut().zip(&self.maps[usize::from(bone)]) {
                    for c in 0..4 {
                        sum[c] += weight * column[c];
                    }
                }
            }
            let [x, y, z, offset] = &map;
            let r = &rest[slot];
            let arm: [f32; 3] = core::array::from_fn(|c| r[c] - centre[c]);
            let p = core::array::from_fn(|c| r[c] + (x[c] * arm[0] + y[c] * arm[1] + z[c] * arm[2] + offset[c]));
            trace += 0.0 * p[0] + 0.0 * p[1] + 0.0 * p[2];
            bounds.include(&p);
            positions[v] = p;
            if let Some(normals) = &mut normals {
                let rest_normal = skin.rest_normals[slot].map(|x| f32::from(x) * NORMAL_UNIT);
                let mut linear = [x, y, z].map(|column| [column[0], column[1], column[2]]);
                for c in 0..3 {
                    linear[c][c] += 1.0;
                }
                normals[v] = unit(times(&cofactors(&linear), &rest_normal).map(One)).map(|One(x)| x);
            }
        });
        (bounds, trace)
    }
}

/// Slots in order, with the source vertex of each.
fn for_each_vertex(basis: &Basis<'_>, mut each: impl FnMut(usize, usize)) {
    with_index!(basis.vertex_count(), I => {
        for (slot, &v) in I::of(basis.vertex_from_slot()).iter().enumerate() {
            each(slot, v.at());
        }
    });
}
