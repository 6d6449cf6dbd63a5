//! Nearest vertices in space, outside one's own group: a balanced tree of axis-aligned splits. Used to lay bridges, and to
//! find the vertex on the other side of a mirror plane.

use super::vector::{difference, dot};

/// Vertices in a leaf: small enough that scanning beats descending.
const LEAF_SIZE: usize = 8;

/// Where a node holds vertices of several groups.
const MIXED: u32 = u32::MAX;

/// A search tree over some vertices, each in a group.
pub struct NearestVertices<'p> {
    positions: &'p [[f64; 3]],
    /// Vertex and group, in the order of the leaves.
    items: Vec<(u32, u32)>,
    nodes: Vec<Node>,
}

struct Node {
    low: [f64; 3],
    high: [f64; 3],
    first: usize,
    end: usize,
    /// Group of every vertex below, or [`MIXED`].
    group: u32,
    /// The second child; the first follows its parent. 0 in a leaf.
    second: usize,
}

impl<'p> NearestVertices<'p> {
    /// Tree over `members` (indices into `positions`), `groups[n]` being the group of `members[n]`.
    pub fn new(positions: &'p [[f64; 3]], members: &[u32], groups: &[u32]) -> Self {
        let items = members.iter().copied().zip(groups.iter().copied()).collect::<Vec<_>>();
        let mut tree = NearestVertices {
            positions,
            items,
            nodes: Vec::new(),
        };
        if !tree.items.is_empty() {
            tree.split(0, tree.items.len());
        }
        tree
    }

    fn split(&mut self, first: usize, end: usize) {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let mut group = self.items[first].1;
        for &(v, other) in &self.items[first..end] {
            for c in 0..3 {
                low[c] = low[c].min(self.positions[v as usize][c]);
                high[c] = high[c].max(self.positions[v as usize][c]);
            }
            if other != group {
                group = MIXED;
            }
        }
        let node = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            first,
            end,
            group,
            second: 0,
        });
        if end - first <= LEAF_SIZE {
            return;
        }
        let extent = difference(low, high);
        let axis = (0..3)
            .rev()
            .max_by(|&a, &b| extent[a].total_cmp(&extent[b]))
            .unwrap_or(0);
        let middle = (end - first) / 2;
        let positions = self.positions;
        self.items[first..end].select_nth_unstable_by(middle, |a, b| {
            positions[a.0 as usize][axis]
                .total_cmp(&positions[b.0 as usize][axis])
                .then(a.0.cmp(&b.0))
        });
        self.split(first, first + middle);
        self.nodes[node].second = self.nodes.len();
        self.split(first + middle, end);
    }

    /// Up to `count` vertices nearest to `point` that are not of group `outside`, nearest first (the lower index of
    /// equals), with squared distances.
    pub fn nearest(&self, point: [f64; 3], outside: Option<u32>, count: usize) -> Vec<(u32, f64)> {
        let mut found: Vec<(u32, f64)> = Vec::with_capacity(count + 1);
        let mut open = Vec::new();
        if !self.nodes.is_empty() {
            open.push((0, self.squared_distance(0, point)));
        }
        while let Some((index, bound)) = open.pop() {
            let node = &self.nodes[index];
            let worst = if found.len() == count {
                found[count - 1].1
            } else {
                f64::INFINITY
            };
            if bound > worst || outside == Some(node.group) {
                continue;
            }
            if node.second == 0 {
                for &(v, group) in &self.items[node.first..node.end] {
                    if outside == Some(group) {
                        continue;
                    }
                    let step = difference(point, self.positions[v as usize]);
                    let candidate = (v, dot(step, step));
                    let place = found.partition_point(|held| (held.1, held.0) < (candidate.1, candidate.0));
                    found.insert(place, candidate);
                    found.truncate(count);
                }
            } else {
                let (first, second) = (index + 1, node.second);
                let bounds = (
                    self.squared_distance(first, point),
                    self.squared_distance(second, point),
                );
                if bounds.0 <= bounds.1 {
                    open.extend([(second, bounds.1), (first, bounds.0)]);
                } else {
                    open.extend([(first, bounds.0), (second, bounds.1)]);
                }
            }
        }
        found
    }

    fn squared_distance(&self, node: usize, point: [f64; 3]) -> f64 {
        let Node { low, high, .. } = &self.nodes[node];
        (0..3)
            .map(|c| (low[c] - point[c]).max(point[c] - high[c]).max(0.0).powi(2))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_looking_at_every_vertex() {
        let positions: Vec<[f64; 3]> = (0..300)
            .map(|n| [7, 11, 13].map(|prime| f64::from(n * prime * 31 % 101) / 101.0))
            .collect();
        let members: Vec<u32> = (0..300).collect();
        let groups: Vec<u32> = (0..300).map(|n| n / 100).collect();
        let tree = NearestVertices::new(&positions, &members, &groups);
        for v in 0..300 {
            let mut all: Vec<(u32, f64)> = (0..300)
                .filter(|&j| groups[j] != groups[v])
                .map(|j| {
                    let step = difference(positions[v], positions[j]);
                    (j as u32, dot(step, step))
                })
                .collect();
            all.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            assert_eq!(tree.nearest(positions[v], Some(groups[v]), 3), all[..3]);
        }
    }
}
