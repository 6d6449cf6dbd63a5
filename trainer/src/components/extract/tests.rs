//! Tests of extraction: the order of components.

use super::*;
use sinew_formats::package::GraphConvRecord;

fn block(path: &[usize], strengths: &[f32]) -> LearnedBlock {
    let conv = GraphConvRecord {
        point: [[0.0; 9]; 9],
        neighbour: [[0.0; 9]; 9],
        bias: [0.0; 9],
    };
    LearnedBlock {
        path: path.to_vec(),
        record: BlockRecord {
            level: path.len() as u32,
            parent_component: NONE,
            first_component: 0,
            component_count: 0,
            encoder: conv,
            decoder: conv,
        },
        components: strengths
            .iter()
            .enumerate()
            .map(|(i, &strength)| LearnedComponent {
                path: path.iter().copied().chain([i]).collect(),
                row: vec![[0.0; 9]; 3],
                centre_vertex: 0,
                scale: 1.0,
                locality: 1.0,
                strength,
                minimum: -1.0,
                maximum: 1.0,
                kept: None,
            })
            .collect(),
    }
}

#[test]
fn siblings_are_ordered_by_strength_and_keep_their_children() {
    let mut basis = LearnedBasis {
        encoder: None,
        rest_positions: vec![[0.0; 3]; 3],
        faces: vec![[0, 1, 2]],
        bridges: Vec::new(),
        anchor_vertex: 0,
        rotation_scale: 1.0,
        stretch_scale: 1.0,
        render: None,
        pieces: None,
        prior: None,
        // A component without a child block, as pruning leaves them, in the middle.
        blocks: vec![
            block(&[], &[0.1, 0.3, 0.2]),
            block(&[0], &[0.04, 0.05]),
            block(&[2], &[0.01, 0.02, 0.02]),
        ],
    };
    basis.order_by_strength();
    let seen: Vec<(String, f32)> = basis
        .components()
        .map(|c| (component_name(&c.path), c.strength))
        .collect();
    let expected = [
        ("c0", 0.3),
        ("c1", 0.2),
        ("c2", 0.1),
        ("c1.0", 0.02),
        ("c1.1", 0.02),
        ("c1.2", 0.01),
        ("c2.0", 0.05),
        ("c2.1", 0.04),
    ];
    assert!(
        seen.iter().map(|(name, s)| (name.as_str(), *s)).eq(expected),
        "{seen:?}"
    );
}
