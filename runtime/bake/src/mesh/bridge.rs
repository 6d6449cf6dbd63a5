//! Bridges: extra edges that tie separate pieces and loose vertices into one graph. Called by
//! [`Topology::new`](super::topology::Topology::new), and by the trainer, which has seen what moves with what.
//!
//! Pieces merge in rounds: every group of pieces but the largest ties itself to vertices outside, the nearest unless the
//! caller chooses.

use super::nearest::NearestVertices;
use super::vector::{difference, dot};

/// Bridges from one piece to the rest: enough that it neither tilts nor twists on them.
pub const BRIDGES_A_PIECE: usize = 8;

/// Bridges from a vertex without faces: three fix a point in space.
const BRIDGES_A_LOOSE_VERTEX: usize = 3;

/// Bridges start on this share of a piece's vertices, the ones nearest to the rest.
const NEAR_SHARE: usize = 4;

/// A group of pieces that looks for its place.
#[derive(Clone, Copy)]
pub struct Group<'a> {
    /// Its vertices, ascending.
    pub inside: &'a [u32],
    /// All vertices in faces, and the group of each.
    pub tree: &'a NearestVertices<'a>,
    /// Its number.
    pub number: u32,
    /// The group of each vertex. Shape: `[V]`.
    pub group_of: &'a [u32],
}

/// Pairs `[inside, outside]` of vertices that tie a group to others: at least one.
pub type ChoosePairs<'c> = dyn Fn(&Group<'_>) -> Vec<[u32; 2]> + 'c;

/// Edges `[from, to]`, `from < to`, sorted, each once, that make the graph connected, each group tied where it is nearest to the
/// others. `piece_of[v]` is `None` for a vertex without edges; pieces are numbered from 0 to `piece_count`.
pub(super) fn bridge_edges(rest: &[[f64; 3]], piece_of: &[Option<u32>], piece_count: usize) -> Vec<[u32; 2]> {
    bridge_edges_with(rest, piece_of, piece_count, &|group| spread_pairs(rest, group))
}

/// The same, each group of pieces tied by what `choose` says; vertices without edges are tied to the nearest vertices.
pub fn bridge_edges_with(
    rest: &[[f64; 3]],
    piece_of: &[Option<u32>],
    piece_count: usize,
    choose: &ChoosePairs<'_>,
) -> Vec<[u32; 2]> {
    let loose: Vec<u32> = (0..rest.len() as u32)
        .filter(|&v| piece_of[v as usize].is_none())
        .collect();
    let mut bridges = Vec::new();
    if piece_count == 0 {
        // A cloud of points: each is a piece of one vertex.
        let singles: Vec<u32> = (0..rest.len() as u32).collect();
        bridge_pieces(rest, &singles, &singles, choose, &mut bridges);
    } else {
        let members: Vec<u32> = (0..rest.len() as u32)
            .filter(|&v| piece_of[v as usize].is_some())
            .collect();
        let pieces: Vec<u32> = members.iter().filter_map(|&v| piece_of[v as usize]).collect();
        if piece_count > 1 {
            bridge_pieces(rest, &members, &pieces, choose, &mut bridges);
        }
        if !loose.is_empty() {
            let tree = NearestVertices::new(rest, &members, &vec![0; members.len()]);
            for &v in &loose {
                for (j, _) in tree.nearest(rest[v as usize], None, BRIDGES_A_LOOSE_VERTEX) {
                    bridges.push([v.min(j), v.max(j)]);
                }
            }
        }
    }
    bridges.sort_unstable();
    bridges.dedup();
    bridges
}

/// Ties the pieces of `members` together; `pieces[n]` is the piece of `members[n]`.
fn bridge_pieces(
    rest: &[[f64; 3]],
    members: &[u32],
    pieces: &[u32],
    choose: &ChoosePairs<'_>,
    bridges: &mut Vec<[u32; 2]>,
) {
    let mut groups = pieces.to_vec();
    loop {
        let group_count = renumber(&mut groups);
        if group_count < 2 {
            return;
        }
        let mut group_members: Vec<Vec<u32>> = vec![Vec::new(); group_count];
        for (&v, &group) in members.iter().zip(&groups) {
            group_members[group as usize].push(v);
        }
        // The largest (the first of equals) waits to be found by the others, which halves the groups each round.
        let largest = (0..group_count)
            .rev()
            .max_by_key(|&group| group_members[group].len())
            .unwrap_or(0);
        let tree = NearestVertices::new(rest, members, &groups);
        let mut group_of_vertex = vec![0u32; rest.len()];
        for (&v, &group) in members.iter().zip(&groups) {
            group_of_vertex[v as usize] = group;
        }
        let mut joined: Vec<u32> = (0..group_count as u32).collect();
        for (group, inside) in group_members.iter().enumerate().filter(|&(group, _)| group != largest) {
            let pairs = choose(&Group {
                inside,
                tree: &tree,
                number: group as u32,
                group_of: &group_of_vertex,
            });
            for [from, to] in pairs {
                bridges.push([from.min(to), from.max(to)]);
                let (a, b) = (find(&joined, group as u32), find(&joined, group_of_vertex[to as usize]));
                joined[a.max(b) as usize] = a.min(b);
            }
        }
        for group in &mut groups {
            *group = find(&joined, *group);
        }
    }
}

/// Up to [`BRIDGES_A_PIECE`] pairs from a piece to the nearest vertices outside: the closest pair, then those that
/// start farthest from the ones taken, among the vertices near the rest.
fn spread_pairs(rest: &[[f64; 3]], group: &Group<'_>) -> Vec<[u32; 2]> {
    let mut pairs: Vec<(f64, [u32; 2])> = group
        .inside
        .iter()
        .filter_map(|&v| {
            let &(to, squared) = group.tree.nearest(rest[v as usize], Some(group.number), 1).first()?;
            Some((squared, [v, to]))
        })
        .collect();
    pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    pairs.truncate((pairs.len() / NEAR_SHARE).max(BRIDGES_A_PIECE));
    let mut taken = Vec::new();
    let mut spread = vec![f64::INFINITY; pairs.len()];
    let mut next = 0;
    while taken.len() < BRIDGES_A_PIECE.min(pairs.len()) {
        let pair = pairs[next].1;
        taken.push(pair);
        spread[next] = f64::NEG_INFINITY;
        for (n, (_, other)) in pairs.iter().enumerate() {
            let step = difference(rest[pair[0] as usize], rest[other[0] as usize]);
            spread[n] = spread[n].min(dot(step, step));
        }
        // The first of equals, so that the closer pair wins.
        next = (0..spread.len())
            .rev()
            .max_by(|&a, &b| spread[a].total_cmp(&spread[b]))
            .unwrap_or(0);
    }
    taken
}

/// Renumbers to 0, 1, ... in order of the old numbers; returns how many there are.
fn renumber(groups: &mut [u32]) -> usize {
    let mut old: Vec<u32> = groups.to_vec();
    old.sort_unstable();
    old.dedup();
    for group in groups.iter_mut() {
        *group = old.binary_search(group).unwrap_or(0) as u32;
    }
    old.len()
}

fn find(joined: &[u32], mut group: u32) -> u32 {
    while joined[group as usize] != group {
        group = joined[group as usize];
    }
    group
}
