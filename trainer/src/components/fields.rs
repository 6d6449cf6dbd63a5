//! What each component of a package does to the surface: its features, played alone at the farther stop of its control.
//! Compact package -> [`fields_of`] -> duplicates here, mirror pairs in `symmetry`, labels in `labels`.

use sinew_formats::package::{CompactView, FEATURE_COUNT};

use crate::bake::Surface;
use crate::bake::sparse::unpack_components;
use crate::mesh::topology::Topology;

/// Cosine from which two components of one level count as duplicates.
pub const DUPLICATE_COSINE: f64 = 0.9;

/// Weights of the nine features in the squared distance of two deformation gradients (Frobenius), for small ones: an angle
/// counts twice, and so does a stretch off the diagonal.
const METRIC: [f64; FEATURE_COUNT] = [2.0, 2.0, 2.0, 1.0, 2.0, 2.0, 1.0, 2.0, 1.0];

/// One component's features where it acts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Field {
    /// Level of its block, 0 for the coarse ones.
    pub level: u32,
    /// The farther stop of its control, with its sign.
    pub stop: f32,
    /// Source indices, ascending.
    pub vertices: Vec<u32>,
    /// Log-rotation xyz (radians), then stretch xx xy xz yy yz zz less identity. Shape: that of `vertices`.
    pub values: Vec<[f64; FEATURE_COUNT]>,
}

impl Field {
    /// Energy at each vertex it acts on: squared length of its features times the vertex's area. `areas`: `[V]`.
    pub fn energies<'a>(&'a self, areas: &'a [f64]) -> impl Iterator<Item = f64> + Clone + 'a {
        let energy = |x: &[f64; FEATURE_COUNT]| product(x, x);
        self.vertices
            .iter()
            .zip(&self.values)
            .map(move |(&v, x)| areas[v as usize] * energy(x))
    }

    /// Cosine of the angle between two fields, from -1 to 1; 0 where one of them is zero. `areas`: `[V]`.
    pub fn cosine(&self, other: &Self, areas: &[f64]) -> f64 {
        let (mut i, mut j, mut sum) = (0, 0, 0.0);
        while let (Some(&a), Some(&b)) = (self.vertices.get(i), other.vertices.get(j)) {
            if a == b {
                sum += areas[a as usize] * product(&self.values[i], &other.values[j]);
            }
            i += usize::from(a <= b);
            j += usize::from(b <= a);
        }
        let squared: f64 = self.energies(areas).sum::<f64>() * other.energies(areas).sum::<f64>();
        if squared > 0.0 {
            (sum / squared.sqrt()).clamp(-1.0, 1.0)
        } else {
            0.0
        }
    }
}

fn product(a: &[f64; FEATURE_COUNT], b: &[f64; FEATURE_COUNT]) -> f64 {
    (0..FEATURE_COUNT).map(|c| METRIC[c] * a[c] * b[c]).sum()
}

/// What a component adds to the features for each unit of its weight, to first order at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Source indices, ascending.
    pub vertices: Vec<u32>,
    /// Radians and stretch, in the order of [`Field::values`]. Shape: that of `vertices`.
    pub values: Vec<[f64; FEATURE_COUNT]>,
}

/// Responses of all components. Shape: `[K]`. `surface` is that of the package.
pub fn responses_of(package: &CompactView<'_>, surface: &Surface) -> Vec<Response> {
    let blocks: Vec<_> = package.blocks().collect();
    let scales = scales_of(package);
    let blends = package.components().zip(blends_of(package, &surface.topology));
    blends
        .map(|(component, blend)| {
            let bias = blocks[component.block as usize].decoder.bias;
            let respond = |sum: [f64; FEATURE_COUNT]| {
                core::array::from_fn(|c| scales[c] * (1.0 - f64::from(bias[c]).tanh().powi(2)) * sum[c])
            };
            Response {
                vertices: blend.vertices,
                values: blend.sums.into_iter().map(respond).collect(),
            }
        })
        .collect()
}

/// Plays every component alone at its farther stop, features only: `tanh(bias + stop * (point C + neighbour mean C))` less the
/// same at 0, in radians and stretch. Shape: `[K]`. `surface` is that of the package.
pub fn fields_of(package: &CompactView<'_>, surface: &Surface) -> Vec<Field> {
    let blocks: Vec<_> = package.blocks().collect();
    let scales = scales_of(package);
    let blends = package.components().zip(blends_of(package, &surface.topology));
    blends
        .map(|(component, blend)| {
            let block = &blocks[component.block as usize];
            let stop = if component.maximum >= -component.minimum {
                component.maximum
            } else {
                component.minimum
            };
            let play = |sum: [f64; FEATURE_COUNT]| {
                core::array::from_fn(|c| {
                    let bias = f64::from(block.decoder.bias[c]);
                    scales[c] * ((bias + f64::from(stop) * sum[c]).tanh() - bias.tanh())
                })
            };
            Field {
                level: block.level,
                stop,
                vertices: blend.vertices,
                values: blend.sums.into_iter().map(play).collect(),
            }
        })
        .collect()
}

/// Radians or stretch of a network unit.
fn scales_of(package: &CompactView<'_>) -> [f64; FEATURE_COUNT] {
    core::array::from_fn(|c| {
        f64::from(if c < 3 {
            package.rotation_scale()
        } else {
            package.stretch_scale()
        })
    })
}

/// `point C + neighbour mean C` of one component, where it is not zero.
pub struct Blend {
    /// Ascending.
    pub vertices: Vec<u32>,
    /// Shape: that of `vertices`.
    pub sums: Vec<[f64; FEATURE_COUNT]>,
}

/// The blends of all components, in the order of the package; `topology` is the package's.
pub fn blends_of(package: &CompactView<'_>, topology: &Topology) -> Vec<Blend> {
    let blocks: Vec<_> = package.blocks().collect();
    let mut sums = vec![[0.0; FEATURE_COUNT]; topology.vertex_count];
    let mut touched = vec![false; topology.vertex_count];
    package
        .components()
        .zip(unpack_components(package))
        .map(|(component, sparse)| {
            let decoder = &blocks[component.block as usize].decoder;
            let mut vertices = Vec::with_capacity(sparse.vertices.len());
            let mut add =
                |v: u32, matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT], x: &[f64; FEATURE_COUNT], share: f64| {
                    if !core::mem::replace(&mut touched[v as usize], true) {
                        vertices.push(v);
                    }
                    for (sum, row) in sums[v as usize].iter_mut().zip(matrix) {
                        *sum += share * row.iter().zip(x).map(|(m, x)| f64::from(*m) * x).sum::<f64>();
                    }
                };
            for (&v, x) in sparse.vertices.iter().zip(&sparse.values) {
                add(v, &decoder.point, x, 1.0);
                for &j in topology.ring_of(v as usize) {
                    let share = 1.0 / topology.ring_of(j as usize).len() as f64;
                    add(j, &decoder.neighbour, x, share);
                }
            }
            vertices.sort_unstable();
            let take = |&v: &u32| {
                touched[v as usize] = false;
                core::mem::take(&mut sums[v as usize])
            };
            let sums = vertices.iter().map(take).collect();
            Blend { vertices, sums }
        })
        .collect()
}

/// Two components of one level that do nearly the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Duplicate {
    /// The first of them.
    pub first: usize,
    /// The second of them.
    pub second: usize,
    /// Of their fields; below zero where one does the opposite of the other.
    pub cosine: f64,
}

/// Pairs of components of one level whose fields have a cosine of at least [`DUPLICATE_COSINE`] either way, in order of the first,
/// then the second. `areas`: `[V]`.
pub fn duplicates(fields: &[Field], areas: &[f64]) -> Vec<Duplicate> {
    let mut found = Vec::new();
    for (first, a) in fields.iter().enumerate() {
        for (second, b) in fields.iter().enumerate().skip(first + 1) {
            if a.level == b.level {
                let cosine = a.cosine(b, areas);
                if cosine.abs() >= DUPLICATE_COSINE {
                    found.push(Duplicate { first, second, cosine });
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{bake, fixture};
    use crate::evaluate::Player;
    use sinew_runtime::{Basis, Workspace, WorkspaceLayout};

    /// The runtime decodes in f32 with folded components in half precision.
    const TOLERANCE: f64 = 4e-3;

    #[test]
    fn fields_are_what_the_runtime_decodes() {
        let bytes = fixture::compact(21, false);
        let package = CompactView::open(&bytes).unwrap();
        let fields = fields_of(&package, &Surface::of_package(&package));
        let baked = bake(&package).unwrap();
        let basis = Basis::open(&baked).unwrap();
        let mut memory = vec![0_u8; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
        let mut player = Player::new(&basis, Workspace::new(&basis, &mut memory).unwrap());
        assert_eq!(fields.len(), basis.component_count());
        for (k, field) in fields.iter().enumerate() {
            let mut weights = vec![0.0; fields.len()];
            weights[k] = f64::from(field.stop);
            player.play(&weights).unwrap();
            let mut expected = player.features().unwrap();
            for (&v, x) in field.vertices.iter().zip(&field.values) {
                let scale = |c| {
                    f64::from(if c < 3 {
                        package.rotation_scale()
                    } else {
                        package.stretch_scale()
                    })
                };
                for c in 0..FEATURE_COUNT {
                    let decoded = scale(c) * f64::from(expected[v as usize][c]);
                    assert!(
                        (x[c] - decoded).abs() < TOLERANCE,
                        "component {k}, vertex {v}, feature {c}"
                    );
                }
                expected[v as usize] = [0.0; FEATURE_COUNT];
            }
            assert!(
                expected.iter().flatten().all(|x| x.abs() < 1e-6),
                "component {k} acts elsewhere"
            );
        }
    }

    #[test]
    fn the_same_movement_twice_is_a_duplicate_within_its_level() {
        let field = |level, first: u32, by: f64| Field {
            level,
            stop: 1.0,
            vertices: (first..first + 4).collect(),
            values: vec![[by, 0.0, 0.5 * by, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]; 4],
        };
        let fields = [
            field(0, 0, 1.0),
            field(0, 0, -2.0),
            field(0, 2, 1.0),
            field(1, 0, 1.0),
            field(0, 6, 0.0),
        ];
        let areas = vec![1.0; 10];
        let found = duplicates(&fields, &areas);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].first, found[0].second), (0, 1));
        assert!((found[0].cosine + 1.0).abs() < 1e-12);
        assert!((fields[0].cosine(&fields[2], &areas) - 0.5).abs() < 1e-12);
        assert_eq!(fields[0].cosine(&fields[4], &areas), 0.0);
    }
}
