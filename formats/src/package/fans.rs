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
    /// Walks around every vertex. Shape: `faces` `[F]`, source order; `slot_from_vertex` `[V]`, a permutation.
    pub fn gather(faces: &[[u32; 3]], slot_from_vertex: &[u32]) -> Self {
        let walks = walks(faces, slot_from_vertex);
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

/// The walk around each slot, in slots.
fn walks(faces: &[[u32; 3]], slot_from_vertex: &[u32]) -> Vec<Vec<u32>> {
    let mut wedges: Vec<Vec<[u32; 2]>> = vec![Vec::new(); slot_from_vertex.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| slot_from_vertex[v as usize]);
        for [centre, from, to] in [[a, b, c], [b, c, a], [c, a, b]] {
            wedges[centre as usize].push([from, to]);
        }
    }
    let around = wedges.iter().enumerate();
    around.map(|(centre, wedges)| walk(centre as u32, wedges)).collect()
}

/// The wedges that leave one neighbour.
struct Leaving {
    neighbour: u32,
    /// Places in the list of all wedges by neighbour: the first that may still be there, and the end.
    next: usize,
    end: usize,
    /// How many more wedges leave than enter, of those that are left.
    excess: i32,
}

/// Strings wedges together: open strings first, from their loose ends, then closed ones, always the first wedge that fits. Time
/// does not grow faster than `n log n`, however many wedges a vertex has.
fn walk(centre: u32, wedges: &[[u32; 2]]) -> Vec<u32> {
    let mut by_neighbour: Vec<(u32, usize)> = wedges.iter().enumerate().map(|(n, wedge)| (wedge[0], n)).collect();
    by_neighbour.sort_unstable();
    let mut begin = 0;
    let mut leaving: Vec<Leaving> = by_neighbour
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| {
            let next = begin;
            begin += same.len();
            Leaving {
                neighbour: same[0].0,
                next,
                end: begin,
                excess: same.len() as i32,
            }
        })
        .collect();
    let place = |leaving: &[Leaving], neighbour| leaving.binary_search_by_key(&neighbour, |some| some.neighbour).ok();
    for wedge in wedges {
        if let Some(entered) = place(&leaving, wedge[1]) {
            leaving[entered].excess -= 1;
        }
    }

    let mut walk = Vec::new();
    let mut is_walked = vec![false; wedges.len()];
    // One pass each: while wedges leave a neighbour, its excess never rises, so what was passed over stays passed over.
    for from_loose_ends in [true, false] {
        for first in 0..wedges.len() {
            let Some(start) = place(&leaving, wedges[first][0]).filter(|_| !is_walked[first]) else {
                continue;
            };
            if from_loose_ends && leaving[start].excess <= 0 {
                continue;
            }
            leaving[start].excess -= 1;
            if !walk.is_empty() {
                walk.push(centre);
            }
            walk.push(wedges[first][0]);
            let mut string = Some(first);
            while let Some(n) = string {
                is_walked[n] = true;
                walk.push(wedges[n][1]);
                string = place(&leaving, wedges[n][1]).and_then(|end| {
                    let own = &mut leaving[end];
                    while own.next < own.end && is_walked[by_neighbour[own.next].1] {
                        own.next += 1;
                    }
                    (own.next < own.end).then(|| by_neighbour[own.next].1)
                });
            }
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

    /// As [`walk`] says it, looking at every wedge for every step.
    fn walk_by_looking(centre: u32, mut wedges: Vec<[u32; 2]>) -> Vec<u32> {
        let mut walk = Vec::new();
        while !wedges.is_empty() {
            let count = |end: usize, of: u32| wedges.iter().filter(|wedge| wedge[end] == of).count();
            let is_loose = |wedge: &[u32; 2]| count(0, wedge[0]) > count(1, wedge[0]);
            let start = wedges.iter().position(is_loose).unwrap_or(0);
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

    #[test]
    fn every_way_to_lay_five_wedges_among_three_neighbours_is_walked_in_the_same_order() {
        const CENTRE: u32 = 9;
        for way in 0..9_u32.pow(5) {
            let wedges: Vec<[u32; 2]> = (0..5).map(|n| way / 9_u32.pow(n) % 9).map(|w| [w / 3, w % 3]).collect();
            assert_eq!(
                walk(CENTRE, &wedges),
                walk_by_looking(CENTRE, wedges.clone()),
                "{wedges:?}"
            );
        }
    }

    /// A list that is looked through for every step would be looked at some ten billion times.
    #[test]
    fn a_cone_of_a_hundred_thousand_triangles_is_walked_once() {
        const COUNT: u32 = 100_000;
        // Neighbours in an order that does not help.
        let neighbour = |n: u32| n * 7 % COUNT;
        let wedges: Vec<[u32; 2]> = (0..COUNT)
            .map(|n| n * 11 % COUNT)
            .map(|n| [neighbour(n), neighbour((n + 1) % COUNT)])
            .collect();
        let walked = walk(COUNT, &wedges);
        assert_eq!(walked.len(), COUNT as usize + 1);
        assert!((0..=COUNT).all(|n| walked[n as usize] == neighbour(n % COUNT)));
    }

    #[test]
    fn columns_are_filled_up_with_their_own_slot() {
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
