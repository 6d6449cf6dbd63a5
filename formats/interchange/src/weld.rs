//! Welds vertices that a format had to split along seams: those that lie on one another, to the bit, at rest and in every frame.

use super::error::SequenceError;

/// Groups of vertices that have not been told apart yet.
pub(super) struct Weld {
    /// The lowest vertex of the group of each.
    group: Vec<u32>,
    /// Vertices in groups of two and more.
    shared: Vec<u32>,
}

impl Weld {
    /// All of `vertex_count` vertices in one group, or, where vertices belong to several pieces, a group a piece: pieces are never
    /// welded to one another.
    pub(super) fn new(pieces: impl Iterator<Item = usize>) -> Weld {
        let mut group = Vec::new();
        for vertex_count in pieces {
            let first = group.len() as u32;
            group.resize(group.len() + vertex_count, first);
        }
        Weld {
            shared: (0..group.len() as u32).collect(),
            group,
        }
    }

    /// Parts the vertices that lie apart in this frame.
    pub(super) fn part(&mut self, positions: &[[f32; 3]]) {
        // Adding zero makes -0 and 0 one.
        let key = |v: u32| {
            (
                self.group[v as usize],
                positions[v as usize].map(|x| (x + 0.0).to_bits()),
                v,
            )
        };
        self.shared.sort_unstable_by_key(|&v| key(v));
        let groups: Vec<&[u32]> = self
            .shared
            .chunk_by(|&a, &b| (key(a).0, key(a).1) == (key(b).0, key(b).1))
            .collect();
        let lowest: Vec<(u32, u32)> = groups
            .iter()
            .flat_map(|group| group.iter().map(|&v| (v, group[0])))
            .collect();
        let shared = groups
            .iter()
            .filter(|group| group.len() > 1)
            .flat_map(|group| group.iter().copied())
            .collect();
        for (v, first) in lowest {
            self.group[v as usize] = first;
        }
        self.shared = shared;
    }

    /// The vertex of the sequence that each becomes, numbered in the order of the first of each group; none if all stay apart.
    pub(super) fn finish(self) -> Option<Vec<u32>> {
        if self.shared.is_empty() {
            return None;
        }
        let mut count = 0;
        let mut number = vec![0; self.group.len()];
        for (v, &first) in self.group.iter().enumerate() {
            number[v] = if first as usize == v {
                count += 1;
                count - 1
            } else {
                number[first as usize]
            };
        }
        Some(number)
    }
}

/// Parts vertices by frame after frame until none are left to part or the frames end.
pub(super) fn weld(
    pieces: impl Iterator<Item = usize>,
    rest: &[[f32; 3]],
    frames: usize,
    mut frame: impl FnMut(usize, &mut Vec<[f32; 3]>) -> Result<(), SequenceError>,
) -> Result<Option<Vec<u32>>, SequenceError> {
    let mut weld = Weld::new(pieces);
    weld.part(rest);
    let mut positions = Vec::new();
    for n in 0..frames {
        if weld.shared.is_empty() {
            break;
        }
        frame(n, &mut positions)?;
        weld.part(&positions);
    }
    Ok(weld.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_that_ever_part_stay_apart_and_pieces_do() {
        let rest = [[0.0; 3], [1.0; 3], [-0.0; 3], [1.0; 3], [0.0; 3], [0.0; 3]];
        let mut moved = rest;
        moved[3][2] = 2.0;
        let found = weld([5, 1].into_iter(), &rest, 1, |_, out| {
            *out = moved.to_vec();
            Ok(())
        });
        assert_eq!(found.unwrap(), Some(vec![0, 1, 0, 2, 0, 3]));
        let apart = [[0.0; 3], [1.0; 3]];
        let never = weld([2].into_iter(), &apart, 1, |_, _| panic!("no frame is wanted"));
        assert_eq!(never.unwrap(), None);
    }
}
