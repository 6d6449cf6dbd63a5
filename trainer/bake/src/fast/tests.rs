//! The fast tier against its definitions: the graph's matrix, its rules of motion, and the error it states.

use rayon::ThreadPoolBuilder;
use sinew_formats::package::{BakedView, CompactView, FEATURE_COUNT, SKIN_WEIGHT_SUM};

use super::graph::NEGLIGIBLE;
use crate::{BakeOptions, FastNodes, bake_bytes_with, fixture};

fn baked(seed: u64, vertices_a_node: u32) -> sinew_formats::package::AlignedBytes {
    let options = BakeOptions {
        fast_nodes: FastNodes::OneIn(vertices_a_node),
    };
    bake_bytes_with(&fixture::compact(seed, false), &options).unwrap()
}

#[test]
fn nodes_are_vertices_with_their_components() {
    let bytes = baked(1, 4);
    let view = BakedView::open(&bytes).unwrap();
    let (exact, fast) = (view.exact(), view.fast().unwrap());
    let nodes = fast.nodes();
    assert_eq!(nodes.node_count(), view.vertex_count() / 4);
    // A node's own vertex follows it alone.
    let mut node_of = vec![None; view.vertex_count()];
    for (lane, (row, weights)) in fast.skin_nodes().iter().zip(fast.skin_weights()).enumerate() {
        let at_node = nodes.rest_positions()[usize::from(row[0])] == exact.rest_positions()[lane];
        if u32::from(weights[0]) == SKIN_WEIGHT_SUM && at_node {
            node_of[lane] = Some(u32::from(row[0]));
        }
    }
    assert_eq!(node_of.iter().flatten().count(), nodes.node_count());
    let sorted = |mut entries: Vec<(usize, u32, [u16; FEATURE_COUNT])>| {
        entries.sort_unstable();
        entries
    };
    let expected = exact
        .entries()
        .filter_map(|entry| node_of[entry.lane].map(|node| (entry.component, node, entry.values)));
    let found = nodes
        .entries()
        .map(|entry| (entry.component, entry.lane as u32, entry.values));
    assert_eq!(sorted(found.collect()), sorted(expected.collect()));
}

/// `W^T L W` but for what is negligible, entry by entry, from the stored skin and the exact tier's rings.
#[test]
fn the_graphs_weights_are_the_galerkin_product() {
    /// Stored in f32, of weights near one.
    const TOLERANCE: f64 = 1e-5;
    let bytes = baked(2, 6);
    let view = BakedView::open(&bytes).unwrap();
    let (exact, fast) = (view.exact(), view.fast().unwrap());
    let node_count = fast.nodes().node_count();
    let skin: Vec<Vec<f64>> = (0..view.vertex_count())
        .map(|v| {
            let mut row = vec![0.0; node_count];
            for (&node, &weight) in fast.skin_nodes()[v].iter().zip(&fast.skin_weights()[v]) {
                row[node as usize] += f64::from(weight) / f64::from(SKIN_WEIGHT_SUM);
            }
            row
        })
        .collect();
    let mut product = vec![vec![0.0; node_count]; node_count];
    for i in 0..view.vertex_count() {
        for e in exact.ring_offsets()[i] as usize..exact.ring_offsets()[i + 1] as usize {
            let (j, weight) = (exact.ring()[e] as usize, f64::from(exact.ring_weights()[e]));
            for a in 0..node_count {
                for b in 0..node_count {
                    product[a][b] += 0.5 * weight * (skin[i][a] - skin[j][a]) * (skin[i][b] - skin[j][b]);
                }
            }
        }
    }
    let nodes = fast.nodes();
    let sum = |a: usize| {
        (0..node_count)
            .filter(|&b| b != a)
            .map(|b| product[a][b].abs())
            .sum::<f64>()
    };
    for a in 0..node_count {
        let row = nodes.ring_offsets()[a] as usize..nodes.ring_offsets()[a + 1] as usize;
        for b in (0..node_count).filter(|&b| b != a) {
            let stored = nodes.ring()[row.clone()]
                .binary_search(&(b as u32))
                .map_or(0.0, |place| f64::from(nodes.ring_weights()[row.start + place]));
            let negligible = NEGLIGIBLE * sum(a).min(sum(b));
            let left_out = stored == 0.0 && product[a][b].abs() < negligible + TOLERANCE;
            assert!(
                left_out || (stored + product[a][b]).abs() < TOLERANCE,
                "{a} {b}: {stored} {}",
                product[a][b]
            );
        }
    }
}

#[test]
fn more_nodes_are_nearer_to_the_exact_tier() {
    let errors = [16, 4, 1].map(|vertices| {
        let bytes = baked(3, vertices);
        BakedView::open(&bytes).unwrap().fast().unwrap().error()
    });
    let [coarse, fine, own] = errors;
    assert!(fine.mixed_rms < 0.7 * coarse.mixed_rms, "{errors:?}");
    assert!(fine.normal_rms < coarse.normal_rms, "{errors:?}");
    // Every vertex a node: the tiers are one, but for negligible edges.
    assert!(own.mixed_max < 5e-4 && own.single_max < 5e-4, "{errors:?}");
    for error in errors {
        assert!(error.mixed_rms <= error.mixed_p99 && error.mixed_p99 <= error.mixed_max);
        assert!(error.single_rms <= error.single_max);
    }
}

#[test]
fn same_bytes_on_one_thread_and_on_four() {
    let on = |thread_count| {
        let pool = ThreadPoolBuilder::new().num_threads(thread_count).build().unwrap();
        pool.install(|| baked(5, 8))
    };
    assert_eq!(on(1), on(4));
}

#[test]
fn any_node_count_makes_a_tier() {
    let compact = fixture::compact(1, false);
    let vertex_count = CompactView::open(&compact).unwrap().vertex_count();
    for (vertices_a_node, expected) in [(0, vertex_count), (u32::MAX, 1), (40, vertex_count / 40)] {
        let bytes = baked(1, vertices_a_node);
        let view = BakedView::open(&bytes).unwrap();
        assert_eq!(view.fast().unwrap().nodes().node_count(), expected);
    }
}
