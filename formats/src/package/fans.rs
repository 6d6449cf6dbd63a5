//! Fans: how the triangles lie around each vertex, as a frame reads them for its normals.
//!
//! A vertex's triangles are walked neighbour by neighbour, so that two in succession and the vertex are a triangle. Where a
//! walk ends (at a boundary, or because the surface branches) the vertex itself stands between it and the next one: it
//! makes triangles without area.

use alloc::{vec, vec::Vec};

use super::FAN_VERTICES;

/// Fields are those of [`super::BakedBasis`].
#[derive(Debug, Clone, Default, PartialEq)]
#[expect(missing_docs, reason = "fields are those of BakedBasis")]
pub struct Fans {
    pub fan_offsets: Vec<u32>,
    pub fans: Vec<[u32; FAN_VERTICES]>,
}

impl Fans {
    /// Walks around every vertex. Shape: `faces` `[F]`, source order; `lane_from_vertex` `[V]`, a permutation.
    pub fn gather(faces: &[[u32; 3]], lane_from_vertex: &[u32]) -> Self {
        let walks = walks(faces, lane_from_vertex);
        let mut fans = Self {
            fan_offsets: vec![0],
            fans: Vec::new(),
        };
        for (quad, walks) in walks.chunks(FAN_VERTICES).enumerate() {
            let longest = walks.iter().map(Vec::len).max().unwrap_or(0);
            for step in 0..longest {
                fans.fans.push(core::array::from_fn(|n| match walks.get(n) {
                    Some(walk) => walk.get(step).copied().unwrap_or((quad * FAN_VERTICES + n) as u32),
                    None => 0,
                }));
            }
            fans.fan_offsets.push(fans.fans.len() as u32);
        }
        fans
    }
}

/// The walk around each lane, in lanes.
fn walks(faces: &[[u32; 3]], lane_from_vertex: &[u32]) -> Vec<Vec<u32>> {
    let mut wedges: Vec<Vec<[u32; 2]>> = vec![Vec::new(); lane_from_vertex.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| lane_from_vertex[v as usize]);
        for [centre, from, to] in [[a, b, c], [b, c, a], [c, a, b]] {
            wedges[centre as usize].push([from, to]);
        }
    }
    let around = wedges.into_iter().enumerate();
    around.map(|(centre, wedges)| walk(centre as u32, wedges)).collect()
}

/// Strings wedges together: open strings first, from their loose ends, then closed ones.
fn walk(centre: u32, mut wedges: Vec<[u32; 2]>) -> Vec<u32> {
    let mut walk = Vec::new();
    while !wedges.is_empty() {
        let entered = |from| wedges.iter().filter(|wedge| wedge[1] == from).count();
        let left = |from| wedges.iter().filter(|wedge| wedge[0] == from).count();
        let start = wedges
            .iter()
            .position(|wedge| left(wedge[0]) > entered(wedge[0]))
            .unwrap_or(0);
        if !walk.is_empty() {
            walk.push(centre);
        }
        let [from, mut end] = wedges.remove(start);
        walk.extend([from, end]);
        while let Some(next) = wedges.iter().position(|wedge| wedge[0] == end) {
            end = wedges.remove(next)[1];
            walk.push(end);
        }
    }
    walk
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed, open, two fans that touch in a vertex, a vertex without a face.
    #[test]
    fn walks_cover_every_corner_once() {
        let closed = [[0, 1, 2], [0, 2, 3], [0, 3, 1]];
        assert_eq!(walks(&closed, &[0, 1, 2, 3])[0], [1, 2, 3, 1]);
        let open = [[0, 2, 3], [0, 1, 2]];
        assert_eq!(walks(&open, &[0, 1, 2, 3])[0], [1, 2, 3]);
        let touching = [[0, 1, 2], [0, 3, 4]];
        let around = walks(&touching, &[5, 0, 1, 2, 3, 4]);
        assert_eq!(around[5], [0, 1, 5, 2, 3]);
        assert!(around[4].is_empty());
    }

    #[test]
    fn columns_are_filled_up_with_their_own_lane() {
        let fans = Fans::gather(&[[0, 1, 2], [1, 3, 2], [4, 0, 2]], &[0, 1, 2, 3, 4]);
        assert_eq!(fans.fan_offsets, [0, 4, 6]);
        let column = |n: usize| fans.fans[..4].iter().map(|step| step[n]).collect::<Vec<_>>();
        assert_eq!(column(0), [1, 2, 4, 0]);
        assert_eq!(column(1), [3, 2, 0, 1]);
        assert_eq!(column(2), [4, 0, 1, 3]);
        assert_eq!(column(3), [2, 1, 3, 3]);
        assert_eq!(fans.fans[4..], [[0, 0, 0, 0], [2, 0, 0, 0]]);
    }
}
