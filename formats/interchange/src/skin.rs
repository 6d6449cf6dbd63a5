//! Joints and their hold on vertices, carried from file to file beside the shapes they made.

use glam::{DAffine3, DMat3, DVec3};
use std::collections::HashMap;

/// Joints of a skin at rest and their hold on vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Skin {
    /// The joints.
    pub joints: Vec<Joint>,
    /// Where the influences of each vertex end in `influences`. Shape: `[V]`.
    pub ends: Vec<u32>,
    /// Joint and weight; the weights of a vertex sum to one, or it has none.
    pub influences: Vec<(u32, f32)>,
}

/// A joint of a skin.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// The joint it hangs from.
    pub parent: Option<u32>,
    /// From joint to mesh in the bind pose: the images of the three axes, and the origin.
    pub bind: [[f64; 3]; 4],
}

impl Joint {
    /// [`Joint::bind`] as a map.
    pub(super) fn bind_map(&self) -> DAffine3 {
        let [x, y, z, origin] = self.bind.map(DVec3::from);
        DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin)
    }
}

impl Skin {
    /// V.
    pub fn vertex_count(&self) -> usize {
        self.ends.len()
    }

    /// Joints and weights of vertex `v`, which must be < V.
    pub fn of_vertex(&self, v: usize) -> &[(u32, f32)] {
        let start = if v == 0 { 0 } else { self.ends[v - 1] };
        &self.influences[start as usize..self.ends[v] as usize]
    }

    /// Ends the vertex whose influences were pushed since the last one: those without weight go, the others are sorted by
    /// joint, joined where a joint is named twice, and scaled to sum to one.
    pub fn end_vertex(&mut self) {
        let start = self.ends.last().map_or(0, |&end| end as usize);
        let own = &mut self.influences[start..];
        own.sort_by_key(|&(joint, _)| joint);
        let mut kept = start;
        for i in start..self.influences.len() {
            let (joint, weight) = self.influences[i];
            if !weight.is_finite() || weight <= 0.0 {
                continue;
            }
            if kept > start && self.influences[kept - 1].0 == joint {
                self.influences[kept - 1].1 += weight;
            } else {
                self.influences[kept] = (joint, weight);
                kept += 1;
            }
        }
        self.influences.truncate(kept);
        let sum: f64 = self.influences[start..]
            .iter()
            .map(|&(_, weight)| f64::from(weight))
            .sum();
        for (_, weight) in &mut self.influences[start..] {
            *weight = (f64::from(*weight) / sum) as f32;
        }
        self.ends.push(self.influences.len() as u32);
    }

    /// The same joints with the influences of some vertices only.
    pub(super) fn of_vertices(&self, vertices: &[u32]) -> Skin {
        let mut skin = Skin {
            joints: self.joints.clone(),
            ..Skin::default()
        };
        for &v in vertices {
            skin.influences.extend(self.of_vertex(v as usize));
            skin.ends.push(skin.influences.len() as u32);
        }
        skin
    }

    /// Adds the vertices of a piece; one without a skin has `vertex_count` vertices without influences. Equal joints become one.
    pub(super) fn append(&mut self, piece: Option<Skin>, vertex_count: usize) {
        let Some(piece) = piece else {
            self.ends
                .resize(self.ends.len() + vertex_count, self.influences.len() as u32);
            return;
        };
        let mut places = Vec::with_capacity(piece.joints.len());
        let known: HashMap<String, usize> = self
            .joints
            .iter()
            .enumerate()
            .map(|(j, joint)| (joint.name.clone(), j))
            .collect();
        for joint in &piece.joints {
            let same = known
                .get(&joint.name)
                .copied()
                .filter(|&j| self.joints[j].bind == joint.bind);
            places.push(same.unwrap_or_else(|| {
                self.joints.push(Joint {
                    parent: None,
                    ..joint.clone()
                });
                self.joints.len() - 1
            }) as u32);
        }
        for (joint, &place) in piece.joints.iter().zip(&places) {
            let own = &mut self.joints[place as usize];
            own.parent = own
                .parent
                .or(joint.parent.map(|parent| places[parent as usize]))
                .filter(|&parent| parent != place);
        }
        let start = self.influences.len() as u32;
        self.influences.extend(
            piece
                .influences
                .iter()
                .map(|&(joint, weight)| (places[joint as usize], weight)),
        );
        self.ends.extend(piece.ends.iter().map(|end| end + start));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(name: &str, parent: Option<u32>) -> Joint {
        Joint {
            name: name.into(),
            parent,
            bind: [[0.0; 3]; 4],
        }
    }

    #[test]
    fn influences_are_sorted_joined_and_sum_to_one() {
        let mut skin = Skin::default();
        skin.influences
            .extend([(2, 0.5), (1, 1.0), (2, 0.5), (0, 0.0), (3, f32::NAN)]);
        skin.end_vertex();
        skin.end_vertex();
        assert_eq!(skin.of_vertex(0), [(1, 0.5), (2, 0.5)]);
        assert_eq!((skin.of_vertex(1).len(), skin.vertex_count()), (0, 2));
        assert_eq!(skin.of_vertices(&[1, 0]).of_vertex(1), skin.of_vertex(0));
    }

    #[test]
    fn pieces_of_one_skeleton_share_its_joints() {
        let piece = |names: [&str; 2]| Skin {
            joints: vec![joint(names[0], None), joint(names[1], Some(0))],
            ends: vec![1],
            influences: vec![(1, 1.0)],
        };
        let mut whole = Skin::default();
        whole.append(Some(piece(["hip", "knee"])), 1);
        whole.append(None, 2);
        whole.append(Some(piece(["hip", "tail"])), 1);
        let names: Vec<&str> = whole.joints.iter().map(|joint| joint.name.as_str()).collect();
        assert_eq!(names, ["hip", "knee", "tail"]);
        assert_eq!(whole.joints[2].parent, Some(0));
        assert_eq!(
            (whole.of_vertex(0), whole.of_vertex(2), whole.of_vertex(3)),
            (&[(1, 1.0)][..], &[][..], &[(2, 1.0)][..])
        );
    }
}
