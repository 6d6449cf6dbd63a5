//! Baking against its definitions: factor against matrix, folded values against stored ones.

use rayon::ThreadPoolBuilder;
use sinew_formats::package::{BakedView, CompactView, FEATURE_COUNT, TILE_ENTRIES, TILE_SIDE};

use super::factor::{AnchoredLaplacian, Factor};
use super::{fixture, *};

/// f64 factor stored in f32, times a condition of about 1e2.
const FACTOR_TOLERANCE: f64 = 2e-5;

#[test]
fn factor_inverts_the_laplacian() {
    let compact = fixture::compact(1, false);
    let compact = CompactView::open(&compact).unwrap();
    let baked = bake(&compact).unwrap();
    let baked = BakedView::open(&baked).unwrap();
    let (exact, vertex_count) = (baked.exact(), baked.vertex_count());
    // F^-T (1/D) F^-1 is the inverse of the matrix: apply it to each column of the matrix by the definition of the tiles.
    let blocks = exact.tile_column_count();
    let padded = TILE_SIDE * blocks;
    let tiles_of = |column: usize| {
        let range = exact.tile_offsets()[column] as usize..exact.tile_offsets()[column + 1] as usize;
        range.map(|t| (exact.tile_rows()[t] as usize, &exact.tiles()[t]))
    };
    let solve = |x: &mut [f64]| {
        for column in 0..blocks {
            for (row, tile) in tiles_of(column) {
                for n in 0..TILE_ENTRIES {
                    x[TILE_SIDE * row + n / TILE_SIDE] -= f64::from(tile[n]) * x[TILE_SIDE * column + n % TILE_SIDE];
                }
            }
        }
        for column in (0..blocks).rev() {
            let mut own = [0.0; TILE_SIDE];
            for (n, &value) in exact.inverse_diagonals()[column].iter().enumerate() {
                own[n / TILE_SIDE] += f64::from(value) * x[TILE_SIDE * column + n % TILE_SIDE];
            }
            for (row, tile) in tiles_of(column) {
                for n in 0..TILE_ENTRIES {
                    own[n % TILE_SIDE] -= f64::from(tile[n]) * x[TILE_SIDE * row + n / TILE_SIDE];
                }
            }
            x[TILE_SIDE * column..][..TILE_SIDE].copy_from_slice(&own);
        }
    };
    let surface = Surface::of_package(&compact);
    let laplacian = surface.laplacian(compact.anchor_vertex() as usize);
    let diagonal = laplacian.diagonal();
    let vertex_of = |s: usize| baked.vertex_from_lane()[baked.exact().lane_from_solver()[s] as usize] as usize;
    for j in 0..vertex_count {
        let w = vertex_of(j);
        let mut x = vec![0.0; padded];
        for i in 0..vertex_count {
            let v = vertex_of(i);
            x[i] = match surface.topology.entry(v, w as u32) {
                Some(entry) => -surface.weights.weights[entry],
                None if v == w => diagonal[v],
                None => 0.0,
            };
        }
        solve(&mut x);
        for (i, found) in x.iter().enumerate() {
            let expected = if i == j { 1.0 } else { 0.0 };
            assert!((found - expected).abs() < FACTOR_TOLERANCE, "{i} {j}: {found}");
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
        let own: Vec<_> = baked.exact().entries().filter(|entry| entry.component == k).collect();
        assert_eq!(own.len(), stored.vertices.len(), "component {k} keeps its support");
        for entry in own {
            let vertex = baked.vertex_from_lane()[entry.lane];
            let place = stored.vertices.binary_search(&vertex).unwrap();
            let value: [f32; FEATURE_COUNT] = entry
                .values
                .map(|bits| half::f16::from_bits(bits).to_f32() * component.value_scale);
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
fn node_counts_are_read_as_they_are_written() {
    assert_eq!("none".parse(), Ok(FastNodes::None));
    assert_eq!("V/8".parse(), Ok(FastNodes::OneIn(8)));
    assert_eq!("V/1".parse(), Ok(FastNodes::OneIn(1)));
    for wrong in ["", "8", "V/0", "V/-8", "V/8.5", "v/8", "V/99999999999", "None"] {
        assert_eq!(wrong.parse::<FastNodes>(), Err(FastNodesError), "{wrong}");
    }
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
