//! From a flat basis to a tree: rows that live at the same places are gathered into groups, the main motion of each group
//! becomes its coarse component, and the others go below it. Nothing that the basis spans is lost.

use faer::{Mat, MatRef, Side};

/// Rounds of exchanging members between groups.
const EXCHANGES: usize = 20;

/// A component of the tree and those below it.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// What the component is made of: row of the flat basis and its share.
    pub shares: Vec<(usize, f64)>,
    /// Components below, strongest first.
    pub children: Vec<Node>,
}

/// What the grouping knows of K rows.
pub struct Flat<'a> {
    /// How alike the places of two rows are, 0 to 1. Shape: `[K] x [K]`.
    pub overlap: MatRef<'a, f64>,
    /// Products of codes, summed over the samples. Shape: `[K] x [K]`.
    pub squares: MatRef<'a, f64>,
    /// Products of rows in the metric. Shape: `[K] x [K]`.
    pub gram: MatRef<'a, f64>,
}

/// `sum_v sqrt(e_kv e_lv)` of the rows' energies, each of sum one. Shapes: `rows` `[K]`, each flat `[V][9]`; `areas` `[V]`.
pub fn overlaps(rows: &[Vec<f32>], areas: &[f64]) -> Mat<f64> {
    let roots: Vec<Vec<f32>> = rows
        .iter()
        .map(|row| {
            let places = row.as_chunks::<9>().0.iter().zip(areas);
            let energies: Vec<f64> = places
                .map(|(x, area)| area * x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>())
                .collect();
            let total = energies.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            energies.iter().map(|energy| (energy / total).sqrt() as f32).collect()
        })
        .collect();
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
    Mat::from_fn(rows.len(), rows.len(), |i, j| dot(&roots[i.min(j)], &roots[i.max(j)]))
}

impl Flat<'_> {
    /// A tree of the rows in `members`: `counts[0]` nodes with `counts[1]` below each, and so on. Where members are too few,
    /// groups are smaller; where they are more than the tree has places, the weakest are left out.
    pub fn tree(&self, members: &[usize], counts: &[usize]) -> Vec<Node> {
        let Some((&count, below)) = counts.split_first() else {
            return Vec::new();
        };
        let size = 1 + places_of(below);
        let mut members = members.to_vec();
        members.sort_by(|&a, &b| self.strength(b).total_cmp(&self.strength(a)).then(a.cmp(&b)));
        members.truncate(count * size);
        let capacity = members.len().div_ceil(count.max(1)).max(1);
        let groups = self.groups(&members, count, capacity);
        let mut nodes: Vec<(f64, Node)> = groups
            .iter()
            .filter(|group| !group.is_empty())
            .map(|group| {
                let (energy, shares) = self.main_motion(group);
                let replaced = shares.iter().copied().max_by(|a, b| {
                    let weight = |(k, share): (usize, f64)| share * share * self.gram[(k, k)];
                    weight(*a).total_cmp(&weight(*b)).then(b.0.cmp(&a.0))
                });
                let rest: Vec<usize> = group
                    .iter()
                    .copied()
                    .filter(|&k| Some(k) != replaced.map(|(k, _)| k))
                    .collect();
                let children = self.tree(&rest, below);
                (energy, Node { shares, children })
            })
            .collect();
        nodes.sort_by(|a, b| b.0.total_cmp(&a.0));
        nodes.into_iter().map(|(_, node)| node).collect()
    }

    /// What a row explains of the samples.
    fn strength(&self, k: usize) -> f64 {
        self.squares[(k, k)] * self.gram[(k, k)]
    }

    /// Up to `count` groups of at most `capacity` members whose places overlap.
    fn groups(&self, members: &[usize], count: usize, capacity: usize) -> Vec<Vec<usize>> {
        if capacity == 1 {
            return members.iter().map(|&k| vec![k]).collect();
        }
        // Seeds far from each other, the strongest first.
        let mut seeds: Vec<usize> = members.first().copied().into_iter().collect();
        while seeds.len() < count.min(members.len()) {
            let nearest = |k: usize| seeds.iter().map(|&s| self.overlap[(k, s)]).fold(0.0, f64::max);
            let candidates = members.iter().copied().filter(|k| !seeds.contains(k));
            let next = candidates.min_by(|&a, &b| nearest(a).total_cmp(&nearest(b)));
            match next {
                Some(next) => seeds.push(next),
                None => break,
            }
        }
        let mut groups: Vec<Vec<usize>> = seeds.iter().map(|&s| vec![s]).collect();
        let mut left: Vec<usize> = members.iter().copied().filter(|k| !seeds.contains(k)).collect();
        let mut sums: Vec<Vec<f64>> = left
            .iter()
            .map(|&k| seeds.iter().map(|&s| self.overlap[(k, s)]).collect())
            .collect();
        // The member and the group that fit best, again and again.
        while !left.is_empty() {
            let mut best: Option<(f64, usize, usize)> = None;
            for (i, sums) in sums.iter().enumerate() {
                for (g, group) in groups.iter().enumerate().filter(|(_, group)| group.len() < capacity) {
                    let mean = sums[g] / group.len() as f64;
                    if best.is_none_or(|(most, ..)| mean > most) {
                        best = Some((mean, i, g));
                    }
                }
            }
            let Some((_, i, g)) = best else { break };
            let member = left.remove(i);
            sums.remove(i);
            groups[g].push(member);
            for (sums, &k) in sums.iter_mut().zip(&left) {
                sums[g] += self.overlap[(k, member)];
            }
        }
        for _ in 0..EXCHANGES {
            if !self.exchange(&mut groups) {
                break;
            }
        }
        groups
    }

    /// One round of exchanging two members where both groups together overlap more after it. Whether any was exchanged.
    fn exchange(&self, groups: &mut [Vec<usize>]) -> bool {
        let sum = |k: usize, group: &[usize], but: usize| -> f64 {
            group
                .iter()
                .filter(|&&l| l != but && l != k)
                .map(|&l| self.overlap[(k, l)])
                .sum()
        };
        let mut changed = false;
        for a in 0..groups.len() {
            for b in a + 1..groups.len() {
                for i in 0..groups[a].len() {
                    for j in 0..groups[b].len() {
                        let (p, q) = (groups[a][i], groups[b][j]);
                        let held = sum(p, &groups[a], p) + sum(q, &groups[b], q);
                        let other = sum(q, &groups[a], p) + sum(p, &groups[b], q);
                        if other > held + 1e-9 {
                            (groups[a][i], groups[b][j]) = (q, p);
                            changed = true;
                        }
                    }
                }
            }
        }
        changed
    }

    /// The strongest mode of what the group's rows do together, as shares of its rows, and its energy.
    fn main_motion(&self, group: &[usize]) -> (f64, Vec<(usize, f64)>) {
        let count = group.len();
        let total: f64 = group.iter().map(|&k| self.gram[(k, k)]).sum();
        let gram = Mat::from_fn(count, count, |i, j| {
            let ridge = if i == j { 1e-9 * total } else { 0.0 };
            self.gram[(group[i], group[j])] + ridge
        });
        let squares = Mat::from_fn(count, count, |i, j| self.squares[(group[i], group[j])]);
        let alone = || (self.strength(group[0]), vec![(group[0], 1.0)]);
        let Ok(factor) = gram.llt(Side::Lower) else {
            return alone();
        };
        let lower = factor.L();
        // Modes of C^T S C are those of L^T S L, C C^T = L L^T.
        let folded = lower.transpose() * squares * lower;
        let symmetric = Mat::from_fn(count, count, |i, j| 0.5 * (folded[(i, j)] + folded[(j, i)]));
        let Ok(eigen) = symmetric.self_adjoint_eigen(Side::Lower) else {
            return alone();
        };
        let mode = Mat::from_fn(count, 1, |i, _| eigen.U()[(i, count - 1)]);
        let mut shares = mode;
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(
            lower.transpose(),
            shares.as_mut(),
            faer::Par::Seq,
        );
        // Signs of eigenvectors are arbitrary: the greatest share is positive.
        let greatest = (0..count)
            .map(|i| shares[(i, 0)])
            .fold(0.0, |most: f64, x| if x.abs() > most.abs() { x } else { most });
        let sign = if greatest < 0.0 { -1.0 } else { 1.0 };
        (
            eigen.S()[count - 1],
            group
                .iter()
                .enumerate()
                .map(|(i, &k)| (k, sign * shares[(i, 0)]))
                .collect(),
        )
    }
}

/// Nodes of a forest of such counts.
pub fn places_of(counts: &[usize]) -> usize {
    counts
        .iter()
        .rev()
        .fold(0_usize, |below, &count| count.saturating_mul(1 + below))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six rows at two places, three each; the strengths fall.
    fn tree_of(counts: &[usize]) -> Vec<Node> {
        let overlap = Mat::from_fn(6, 6, |i, j| if i % 2 == j % 2 { 0.9 } else { 0.05 });
        let squares = Mat::from_fn(6, 6, |i, j| if i == j { f64::from(6 - i as u32) } else { 0.0 });
        let gram = Mat::from_fn(6, 6, |i, j| if i == j { 1.0 } else { 0.0 });
        let flat = Flat {
            overlap: overlap.as_ref(),
            squares: squares.as_ref(),
            gram: gram.as_ref(),
        };
        flat.tree(&[0, 1, 2, 3, 4, 5], counts)
    }

    fn rows_of(node: &Node) -> Vec<usize> {
        let own = node
            .shares
            .iter()
            .filter(|(_, share)| share.abs() > 0.5)
            .map(|(k, _)| *k);
        own.chain(node.children.iter().flat_map(rows_of)).collect()
    }

    #[test]
    fn rows_of_one_place_are_one_branch_and_none_is_lost() {
        let tree = tree_of(&[2, 2]);
        assert_eq!(tree.len(), 2);
        let mut all = Vec::new();
        for (place, node) in tree.iter().enumerate() {
            let rows = rows_of(node);
            assert_eq!(rows.len(), 3);
            assert!(
                rows.iter().all(|k| k % 2 == place),
                "the stronger place comes first: {rows:?}"
            );
            assert_eq!(rows[0], place, "the strongest of a branch leads it");
            all.extend(rows);
        }
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn trees_with_fewer_or_more_places_than_rows_take_what_there_is() {
        let count = |nodes: &[Node]| nodes.iter().map(rows_of).map(|rows| rows.len()).sum::<usize>();
        assert_eq!(count(&tree_of(&[2, 1])), 4, "the weakest are left out");
        assert_eq!(count(&tree_of(&[4, 4])), 6, "places stay empty");
        assert_eq!(count(&tree_of(&[6])), 6);
        assert_eq!(places_of(&[10, 5]), 60);
        assert_eq!(places_of(&[3, 2, 4]), 3 * (1 + 2 * (1 + 4)));
    }
}
