//! Baking against its definitions: factor against matrix, folded values against stored ones.

use rayon::ThreadPoolBuilder;
use sinew_formats::package::{BakedView, CompactView, FEATURE_COUNT};

use super::{fixture, *};

/// f64 factor stored in f32.
const FACTOR_TOLERANCE: f64 = 1e-5;

#[test]
fn factor_reproduces_the_laplacian() {
    let compact = fixture::compact(1, false);
    let compact = CompactView::open(&compact).unwrap();
    let baked = bake(&compact).unwrap();
    let baked = BakedView::open(&baked).unwrap();
    let (exact, vertex_count) = (baked.exact(), baked.vertex_count());
    let mut lower = vec![vec![0.0_f64; vertex_count]; vertex_count];
    for column in 0..vertex_count {
        lower[column][column] = 1.0;
        for e in exact.factor_offsets()[column] as usize..exact.factor_offsets()[column + 1] as usize {
            lower[exact.factor_rows()[e] as usize][column] = f64::from(exact.factor_values()[e]);
        }
    }
    let surface = Surface::of_package(&compact);
    let laplacian = surface.laplacian(compact.anchor_vertex() as usize);
    let diagonal = laplacian.diagonal();
    let largest = diagonal.iter().fold(0.0_f64, |largest, &d| largest.max(d));
    for i in 0..vertex_count {
        for j in 0..vertex_count {
            let (v, w) = (baked.vertex_from_solver()[i] as usize, baked.vertex_from_solver()[j]);
            let expected = match surface.topology.entry(v, w) {
                Some(entry) => -surface.weights.weights[entry],
                None if v == w as usize => diagonal[v],
                None => 0.0,
            };
            let product: f64 = (0..vertex_count)
                .map(|c| lower[i][c] * lower[j][c] / f64::from(exact.inverse_pivots()[c]))
                .sum();
            assert!(
                (product - expected).abs() < FACTOR_TOLERANCE * largest,
                "{i} {j}: {product} {expected}"
            );
        }
    }
}

#[test]
fn identity_convolution_changes_no_value() {
    let bytes = fixture::compact(3, true);
    let compact = CompactView::open(&bytes).unwrap();
    let baked = bake(&compact).unwrap();
    let baked = BakedView::open(&baked).unwrap();
    let components = sparse::unpack_components(&compact);
    for (k, (component, stored)) in baked.components().zip(&components).enumerate() {
        let support = baked.exact().support_of(component.block as usize);
        let (slots, values) = baked.exact().entries_of(k);
        assert_eq!(slots.len(), stored.vertices.len(), "component {k} keeps its support");
        for (&slot, bits) in slots.iter().zip(values) {
            let vertex = baked.vertex_from_solver()[support[slot as usize] as usize];
            let place = stored.vertices.binary_search(&vertex).unwrap();
            let value: [f32; FEATURE_COUNT] =
                bits.map(|bits| half::f16::from_bits(bits).to_f32() * component.value_scale);
            assert_eq!(value, stored.values[place], "component {k}, vertex {vertex}");
        }
    }
}

#[test]
fn same_bytes_on_one_thread_and_on_four() {
    let bytes = fixture::compact(5, false);
    let baked_on = |thread_count| {
        let pool = ThreadPoolBuilder::new().num_threads(thread_count).build().unwrap();
        pool.install(|| bake_bytes(&bytes)).unwrap()
    };
    assert_eq!(baked_on(1), baked_on(4));
}

#[test]
fn refusals() {
    assert!(matches!(bake_bytes(&[0; 16]), Err(BakeError::Unreadable(_))));
    // Two vertices without an edge: nothing ties the second one down.
    let apart = AnchoredLaplacian {
        ring_offsets: &[0, 0, 0],
        ring: &[],
        weights: &[],
        anchor_vertex: 0,
    };
    let order = EliminationOrder::new(&apart).unwrap();
    assert!(matches!(
        Factor::new(&apart, &order),
        Err(BakeError::NotPositive { .. })
    ));
}

#[test]
fn render_vertices_are_passed_on() {
    let compact = fixture::compact(1, false);
    let compact = CompactView::open(&compact).unwrap();
    let baked = bake(&compact).unwrap();
    let baked = BakedView::open(&baked).unwrap();
    assert!(baked.render_mesh().vertices.len() > baked.vertex_count());
    assert_eq!(baked.render_mesh(), compact.render_mesh());
}
