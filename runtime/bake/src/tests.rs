//! Baking against its definitions: factor against matrix, folded values against stored ones.

use rayon::ThreadPoolBuilder;
use sinew_formats::package::{BakedView, CompactView, FEATURE_COUNT, QUAD, TILE_ENTRIES};

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
    let (exact, vertex_count) = (baked.exact().unwrap().solve, baked.vertex_count());
    // F^-T (1/D) F^-1 is the inverse of the matrix: apply it to each column of the matrix by the definition of the tiles.
    let quads = vertex_count.div_ceil(QUAD);
    let padded = QUAD * quads;
    let tiles_of = |column: usize| {
        let range = exact.tile_offsets[column] as usize..exact.tile_offsets[column + 1] as usize;
        range.map(|t| (exact.tile_rows.at(t) as usize, &exact.tiles[t]))
    };
    let solve = |x: &mut [f64]| {
        for column in 0..quads {
            for (row, tile) in tiles_of(column) {
                for n in 0..TILE_ENTRIES {
                    x[QUAD * row + n % QUAD] -= f64::from(tile[n]) * x[QUAD * column + n / QUAD];
                }
            }
        }
        for column in (0..quads).rev() {
            let mut own = [0.0; QUAD];
            for (n, &value) in exact.inverse_diagonals[column].iter().enumerate() {
                own[n / QUAD] += f64::from(value) * x[QUAD * column + n % QUAD];
            }
            for (row, tile) in tiles_of(column) {
                for n in 0..TILE_ENTRIES {
                    own[n / QUAD] -= f64::from(tile[n]) * x[QUAD * row + n % QUAD];
                }
            }
            x[QUAD * column..][..QUAD].copy_from_slice(&own);
        }
    };
    let surface = Surface::of_package(&compact);
    let laplacian = surface.laplacian(compact.anchor_vertex() as usize);
    let diagonal = laplacian.diagonal();
    let mut vertex_from_solver = vec![0; vertex_count];
    for (solver, vertex) in exact.solver_from_slot.iter().zip(baked.vertex_from_slot().iter()) {
        vertex_from_solver[solver as usize] = vertex as usize;
    }
    let vertex_of = |s: usize| vertex_from_solver[s];
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
        let exact = baked.exact().unwrap();
        let own: Vec<_> = exact.patches.entries().filter(|entry| entry.component == k).collect();
        assert_eq!(own.len(), stored.vertices.len(), "component {k} keeps its support");
        for entry in own {
            let vertex = baked.vertex_from_slot().at(entry.slot);
            let place = stored.vertices.binary_search(&vertex).unwrap();
            let scales = component.value_scales.by_feature().map(f64::from);
            let value: [f64; FEATURE_COUNT] = core::array::from_fn(|c| f64::from(entry.values[c]) * scales[c]);
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
    let refused = Factor::new(&apart, &order).err();
    assert_eq!(refused, Some(BakeError::NotConnected { vertex: 1 }));
    // Connected, and indefinite all the same: nobody blames the anchor.
    let indefinite = AnchoredLaplacian {
        ring_offsets: &[0, 1, 2],
        ring: &[1, 0],
        weights: &[-1.0, -1.0],
        anchor_vertex: 0,
    };
    let order = EliminationOrder::new(&indefinite).unwrap();
    let refused = Factor::new(&indefinite, &order).err();
    assert!(
        matches!(refused, Some(BakeError::NotPositive { vertex }) if vertex != Some(0)),
        "{refused:?}"
    );
}

#[test]
fn bone_counts_are_read_as_they_are_written() {
    assert_eq!("none".parse(), Ok(BoneCount(None)));
    assert_eq!("1".parse(), Ok(BoneCount(Some(1))));
    assert_eq!("250".parse(), Ok(BoneCount(Some(250))));
    for wrong in ["", "0", "251", "-8", "64.0", "V/8", "99999999999", "None"] {
        assert_eq!(wrong.parse::<BoneCount>(), Err(BoneCountError), "{wrong}");
    }
}

#[test]
fn render_vertices_are_passed_on() {
    let compact = fixture::compact(1, false);
    let compact = CompactView::open(&compact).unwrap();
    let baked = bake(&compact).unwrap();
    let baked = BakedView::open(&baked).unwrap();
    let (drawn, source) = (baked.surface(), compact.surface());
    assert!(drawn.uvs.len() > baked.vertex_count());
    assert!(baked.faces().iter().eq(compact.faces().iter()));
    // Corner by corner the same texture, whatever the order of the render vertices.
    let texture = |surface: &sinew_formats::package::SurfaceView<'_>| -> Vec<[[f32; 2]; 3]> {
        let corners = surface.drawn_faces();
        corners
            .iter()
            .map(|corners| corners.map(|r| surface.uvs[r as usize]))
            .collect()
    };
    assert_eq!(texture(&drawn), texture(&source));
}

#[test]
fn what_is_added_and_known_is_passed_on_by_slots() {
    let compact = fixture::compact(1, false);
    let compact = CompactView::open(&compact).unwrap();
    let baked = bake(&compact).unwrap();
    let baked = BakedView::open(&baked).unwrap();
    let (source, slots) = (compact.after(), baked.after());
    assert_eq!(
        (slots.piece_offsets, slots.mix, slots.mode_scales),
        (source.piece_offsets, source.mix, source.mode_scales)
    );
    for (slot, vertex) in baked.vertex_from_slot().iter().enumerate() {
        assert_eq!(slots.piece_of[slot], source.piece_of[vertex as usize]);
        assert_eq!(slots.modes[slot], source.modes[vertex as usize]);
    }
    assert_eq!(baked.prior(), compact.prior());
}
