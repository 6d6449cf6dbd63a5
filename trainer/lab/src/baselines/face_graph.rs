//! The graph of faces that frames are handed along: hinges, ties between pieces, and a tree over both. For
//! [`super::length_angle`].

use std::collections::{BTreeMap, VecDeque};

use nalgebra::UnitQuaternion;

use super::gradient_field::FaceField;

/// What ties the frames of two faces.
#[derive(Debug, Clone, Copy)]
pub(super) enum Link {
    /// An edge between them.
    Hinge { edge: usize, faces: [usize; 2] },
    /// No edge, but another piece: they turn alike.
    Tie {
        faces: [usize; 2],
        turn: UnitQuaternion<f64>,
    },
}

impl Link {
    /// The faces it ties.
    pub(super) fn faces(&self) -> [usize; 2] {
        match self {
            Self::Hinge { faces, .. } | Self::Tie { faces, .. } => *faces,
        }
    }
}

/// Pairs of faces that join pieces which no edge joins: across bridges, then around vertices, then in order.
pub(super) fn ties(field: &FaceField, links: &[Link]) -> Vec<[usize; 2]> {
    let faces = field.faces();
    let with_area: Vec<usize> = (0..faces.len()).filter(|&f| field.has_area(f)).collect();
    let mut faces_of: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for &f in &with_area {
        for &v in &faces[f] {
            faces_of.entry(v).or_default().push(f);
        }
    }
    let first_of = |v: &u32| faces_of.get(v).and_then(|faces| faces.first().copied());
    let bridges = field
        .bridges()
        .iter()
        .filter_map(|[a, b]| Some([first_of(a)?, first_of(b)?]));
    let around = faces_of
        .values()
        .flat_map(|faces| faces.windows(2).map(|pair| [pair[0], pair[1]]));
    let listed = with_area.windows(2).map(|pair| [pair[0], pair[1]]);
    let mut parent: Vec<usize> = (0..faces.len()).collect();
    let mut join = |[f, g]: [usize; 2]| {
        let mut roots = [f, g];
        for root in &mut roots {
            while parent[*root] != *root {
                parent[*root] = parent[parent[*root]];
                *root = parent[*root];
            }
        }
        parent[roots[1]] = roots[0];
        roots[0] != roots[1]
    };
    links.iter().for_each(|link| {
        join(link.faces());
    });
    bridges.chain(around).chain(listed).filter(|&pair| join(pair)).collect()
}

/// Breadth first over the links: the walk, and the faces that it starts from.
pub(super) fn spanning_tree(face_count: usize, links: &[Link]) -> (Vec<(usize, bool)>, Vec<usize>) {
    let mut links_of = vec![Vec::new(); face_count];
    for (n, link) in links.iter().enumerate() {
        let [f, g] = link.faces();
        links_of[f].push((n, true, g));
        links_of[g].push((n, false, f));
    }
    let mut reached = vec![false; face_count];
    let (mut tree, mut roots) = (Vec::new(), Vec::new());
    for root in 0..face_count {
        if core::mem::replace(&mut reached[root], true) {
            continue;
        }
        roots.push(root);
        let mut open = VecDeque::from([root]);
        while let Some(f) = open.pop_front() {
            for &(link, forwards, g) in &links_of[f] {
                if !core::mem::replace(&mut reached[g], true) {
                    tree.push((link, forwards));
                    open.push_back(g);
                }
            }
        }
    }
    (tree, roots)
}
