//! Components of an older package that the user wants to keep: each takes the place of one coarse component, with the features
//! that it had, and everything else is learned around it. They stand in the configuration; [`read`] takes them out of their
//! packages before training, the start gives them their rows, the fit and the refinement leave those alone, and
//! [`row_behind`] makes up for what the block's convolution has become.

use core::str::FromStr;
use std::path::PathBuf;

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};
use sinew_formats::package::{CompactView, FEATURE_COUNT, GraphConvRecord, OpenError, ReadError, read_package};
use sinew_interchange::MeshSequence;

use super::fields::{Response, responses_of};
use super::painted::{NAME_LENGTH, PaintedRegion, is_region_name};
use super::rename::{is_place, places};
use crate::bake::Surface;
use crate::features::scaler::FeatureScaler;
use crate::mesh::topology::Topology;

/// A component of an older package, as the configuration names it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptComponent {
    /// Its name in the new package.
    pub name: String,
    /// The compact package that has it.
    pub package: PathBuf,
    /// Its name or place there.
    pub component: String,
}

/// A text that names no component to keep.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not of the form PACKAGE:COMPONENT or PACKAGE:COMPONENT=NAME")]
pub struct KeptTextError(pub String);

impl FromStr for KeptComponent {
    type Err = KeptTextError;

    /// `old.sinew:c3=left-brow`; without a name it keeps its own, or is called after its place, `kept-c3`.
    fn from_str(text: &str) -> Result<Self, KeptTextError> {
        let fail = || KeptTextError(text.to_owned());
        let (package, rest) = text.rsplit_once(':').ok_or_else(fail)?;
        let (component, name) = match rest.split_once('=') {
            Some((component, name)) => (component, name.to_owned()),
            None if is_place(rest) => (rest, format!("kept-{}", rest.replace('.', "-"))),
            None => (rest, rest.replace('.', "-")),
        };
        if package.is_empty() || component.is_empty() || name.is_empty() {
            return Err(fail());
        }
        Ok(Self {
            name,
            package: package.into(),
            component: component.to_owned(),
        })
    }
}

/// Why a component cannot be kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KeepError {
    /// The package cannot be read.
    #[error("{source}{}", because(.source))]
    Read {
        /// As it says.
        #[from]
        source: ReadError,
    },
    /// It is no compact package.
    #[error("{}: {source}", package.display())]
    Open {
        /// The file.
        package: PathBuf,
        /// As it says.
        source: OpenError,
    },
    /// It has no such component.
    #[error("{} has no component `{component}`: it has {known}", package.display())]
    Unknown {
        /// The file.
        package: PathBuf,
        /// What was asked for.
        component: String,
        /// The names of some that it has.
        known: String,
    },
    /// Its mesh is not that of the shapes.
    #[error("{} is of another mesh: {difference}", package.display())]
    Mesh {
        /// The file.
        package: PathBuf,
        /// What is different first.
        difference: String,
    },
    /// It does nothing.
    #[error("component `{component}` of {} moves nothing", package.display())]
    Still {
        /// The file.
        package: PathBuf,
        /// Which.
        component: String,
    },
    /// No component can be called so.
    #[error(
        "`{0}` cannot name a kept component: names are made of letters, digits, `-` and `_`, begin with a letter, have at most \
         {NAME_LENGTH} bytes, and are not those of places such as c0; write PACKAGE:COMPONENT=NAME"
    )]
    Name(String),
    /// Two kept or painted components of one name.
    #[error("two kept or painted components are called `{0}`; write PACKAGE:COMPONENT=NAME")]
    SameName(String),
    /// No component is left for the rest.
    #[error(
        "painted regions and kept components: {claimed}, coarse components: {coarse}; one of these at least must be left for the rest \
         of the mesh"
    )]
    TooMany {
        /// Of both.
        claimed: usize,
        /// Components of the coarsest level.
        coarse: usize,
    },
    /// A random start has no place for them.
    #[error("kept components need start.kind = \"closed-form\": a random start (--recipe paper) has no place for them")]
    RandomStart,
}

/// What the system says, where it says something.
fn because(error: &ReadError) -> String {
    core::error::Error::source(error).map_or_else(String::new, |source| format!(": {source}"))
}

/// A kept component, taken out of its package.
#[derive(Debug, Clone, PartialEq)]
pub struct KeptResponse {
    /// Its name in the new package.
    pub name: String,
    /// What it does, to first order.
    pub response: Response,
}

/// How far vertices of the two rest shapes may be apart, as a share of the extent: files round differently.
const REST_TOLERANCE: f32 = 1e-4;

/// Component names that an error lists.
const NAMES_SHOWN: usize = 12;

/// Takes the kept components out of their packages. Errors: every [`KeepError`]; `coarse` is the number of components of the
/// coarsest level, `painted` what else stands in the configuration.
pub fn read(
    kept: &[KeptComponent],
    painted: &[PaintedRegion],
    coarse: usize,
    sequence: &MeshSequence,
) -> Result<Vec<KeptResponse>, KeepError> {
    if !kept.is_empty() && kept.len() + painted.len() >= coarse {
        return Err(KeepError::TooMany {
            claimed: kept.len() + painted.len(),
            coarse,
        });
    }
    let named = kept.iter().enumerate().map(|(i, kept_here)| {
        let name = &kept_here.name;
        if !is_region_name(name) {
            return Err(KeepError::Name(name.clone()));
        }
        let earlier = kept[..i].iter().map(|other| &other.name);
        if earlier
            .chain(painted.iter().map(|region| &region.name))
            .any(|other| other == name)
        {
            return Err(KeepError::SameName(name.clone()));
        }
        Ok(KeptResponse {
            name: name.clone(),
            response: response_of(kept_here, sequence)?,
        })
    });
    named.collect()
}

fn response_of(kept: &KeptComponent, sequence: &MeshSequence) -> Result<Response, KeepError> {
    let package = || kept.package.clone();
    let bytes = read_package(&kept.package)?;
    let view = CompactView::open(&bytes).map_err(|source| KeepError::Open {
        package: package(),
        source,
    })?;
    if let Some(difference) = mesh_difference(&view, sequence) {
        return Err(KeepError::Mesh {
            package: package(),
            difference,
        });
    }
    let named = view.components().position(|component| component.name == kept.component);
    let index = named.or_else(|| places(&view).iter().position(|place| *place == kept.component));
    let index = index.ok_or_else(|| {
        let names: Vec<&str> = view.components().map(|component| component.name).collect();
        let mut known = names[..names.len().min(NAMES_SHOWN)].join(", ");
        if names.len() > NAMES_SHOWN {
            known += &format!(" and {} more (sinew inspect lists them)", names.len() - NAMES_SHOWN);
        }
        KeepError::Unknown {
            package: package(),
            component: kept.component.clone(),
            known,
        }
    })?;
    let response = responses_of(&view, &Surface::of_package(&view)).swap_remove(index);
    if response.values.iter().flatten().all(|&x| x == 0.0) {
        return Err(KeepError::Still {
            package: package(),
            component: kept.component.clone(),
        });
    }
    Ok(response)
}

/// What tells the package's mesh from the reference of `sequence`.
fn mesh_difference(view: &CompactView<'_>, sequence: &MeshSequence) -> Option<String> {
    let (own, other) = (sequence.vertex_count(), view.vertex_count());
    if own != other {
        return Some(format!("it has {other} vertices, the shapes have {own}"));
    }
    if !sequence.faces.iter().copied().eq(view.faces().iter()) {
        return Some("its faces are not those of the shapes".to_owned());
    }
    let rest = &sequence.shapes[0];
    let extent = (0..3).map(|c| {
        let values = rest.iter().map(|p| p[c]);
        values.clone().fold(f32::MIN, f32::max) - values.fold(f32::MAX, f32::min)
    });
    let tolerance = REST_TOLERANCE * extent.fold(0.0, f32::max);
    let mut pairs = rest.iter().zip(view.rest_positions());
    let apart = pairs.position(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > tolerance));
    apart.map(|v| format!("vertex {v} of its rest shape is at another place than in the first of the shapes"))
}

/// What a component adds to the network's values a unit of its weight, as a unit row, by the `scaler` of the new training.
/// Shape: flat `[V][9]`.
pub fn network_row(response: &Response, scaler: &FeatureScaler, vertex_count: usize) -> Vec<f32> {
    let scales = scaler.scales();
    let mut row = vec![0.0; vertex_count * FEATURE_COUNT];
    let squared: f64 = response
        .values
        .iter()
        .flat_map(|x| (0..FEATURE_COUNT).map(|c| (x[c] / scales[c]).powi(2)))
        .sum();
    let length = squared.sqrt();
    for (&v, x) in response.vertices.iter().zip(&response.values) {
        let place = &mut row[FEATURE_COUNT * v as usize..][..FEATURE_COUNT];
        for c in 0..FEATURE_COUNT {
            place[c] = (x[c] / (scales[c] * length)) as f32;
        }
    }
    row
}

/// Share of a component's greatest energy at a vertex above which the vertex is its own, and no found region's.
const OWN_ENERGY: f32 = 0.1;

/// Gives vertices that no label claims to the kept row that is strongest there, label `first` being the first row's. Shapes:
/// `labels` `[V]`, `rows` flat `[V][9]` each.
pub fn claim(labels: &mut [Option<u32>], rows: &[Vec<f32>], first: usize) {
    let energies: Vec<Vec<f32>> = rows
        .iter()
        .map(|row| {
            let energy = row
                .chunks_exact(FEATURE_COUNT)
                .map(|x| x.iter().map(|x| x * x).sum::<f32>());
            let greatest = energy.clone().fold(f32::MIN_POSITIVE, f32::max);
            energy.map(|energy| energy / greatest).collect()
        })
        .collect();
    for (v, label) in labels.iter_mut().enumerate().filter(|(_, label)| label.is_none()) {
        let strongest = (0..rows.len()).max_by(|&a, &b| energies[a][v].total_cmp(&energies[b][v]).then(b.cmp(&a)));
        *label = strongest
            .filter(|&r| energies[r][v] >= OWN_ENERGY)
            .map(|r| (first + r) as u32);
    }
}

/// Rounds of [`row_behind`]: the neighbours' part is a small share of the point's, and shrinks by it with every one.
const ROUNDS: usize = 20;

/// The row of C that a block's decoder makes `wanted` of, to first order at rest and where `wanted` acts:
/// `(1 - tanh^2 b) (W_point C + W_neighbour mean C) = wanted`. Nothing where the point matrix has no inverse. Shapes: flat `[V][9]`.
pub fn row_behind(wanted: &[f32], decoder: &GraphConvRecord, topology: &Topology) -> Option<Vec<f32>> {
    type Vector = SVector<f64, FEATURE_COUNT>;
    let matrix = |of: &[[f32; FEATURE_COUNT]; FEATURE_COUNT]| {
        SMatrix::<f64, FEATURE_COUNT, FEATURE_COUNT>::from_fn(|i, j| f64::from(of[i][j]))
    };
    let (back, neighbour) = (matrix(&decoder.point).try_inverse()?, matrix(&decoder.neighbour));
    let slope = decoder.bias.map(|b| 1.0 - f64::from(b).tanh().powi(2));
    let wanted: Vec<Vector> = wanted
        .chunks_exact(FEATURE_COUNT)
        .map(|x| Vector::from_fn(|c, _| f64::from(x[c]) / slope[c]))
        .collect();
    let mut row: Vec<Vector> = wanted.iter().map(|x| back * x).collect();
    for _ in 0..ROUNDS {
        let next = wanted.iter().enumerate().map(|(v, x)| {
            if x.iter().all(|&x| x == 0.0) {
                return Vector::zeros();
            }
            let ring = topology.ring_of(v);
            let mean: Vector = ring.iter().map(|&j| row[j as usize]).sum::<Vector>() / ring.len().max(1) as f64;
            back * (x - neighbour * mean)
        });
        row = next.collect();
    }
    let flat: Vec<f32> = row.iter().flat_map(|x| x.iter().map(|&x| x as f32)).collect();
    flat.iter().all(|x| x.is_finite()).then_some(flat)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::weights::zero_convolution;

    #[test]
    fn what_to_keep_is_read_from_text() {
        let kept = |text: &str| text.parse::<KeptComponent>();
        let expected = |package: &str, component: &str, name: &str| {
            Ok(KeptComponent {
                name: name.into(),
                package: package.into(),
                component: component.into(),
            })
        };
        assert_eq!(kept("old.sinew:c3=brow"), expected("old.sinew", "c3", "brow"));
        assert_eq!(kept("C:/old.sinew:c0.1"), expected("C:/old.sinew", "c0.1", "kept-c0-1"));
        assert_eq!(kept("old.sinew:ear.0"), expected("old.sinew", "ear.0", "ear-0"));
        for wrong in ["old.sinew", "old.sinew:", ":c0", "old.sinew:c0=", "old.sinew:=x"] {
            assert!(kept(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_row_behind_a_convolution_decodes_to_what_was_wanted() {
        // A strip of triangles.
        let faces: Vec<[u32; 3]> = (0..8).map(|i| [i, i + 1, i + 2]).collect();
        let rest: Vec<[f64; 3]> = (0..10).map(|i| [f64::from(i), f64::from(i % 2), 0.0]).collect();
        let topology = Topology::new(&faces, &rest);
        let mut decoder = zero_convolution();
        for c in 0..FEATURE_COUNT {
            decoder.point[c][c] = 0.9;
            decoder.point[c][(c + 1) % FEATURE_COUNT] = 0.1;
            decoder.neighbour[c][(c + 2) % FEATURE_COUNT] = 0.15;
            decoder.bias[c] = 0.02 * c as f32;
        }
        let wanted: Vec<f32> = (0..90).map(|i| ((i * 37 % 17) as f32 - 8.0) * 0.01).collect();
        let row = row_behind(&wanted, &decoder, &topology).unwrap();
        for v in 0..10 {
            let ring = topology.ring_of(v);
            for o in 0..FEATURE_COUNT {
                let mut sum = 0.0;
                for i in 0..FEATURE_COUNT {
                    let mean: f32 = ring.iter().map(|&j| row[9 * j as usize + i]).sum::<f32>() / ring.len() as f32;
                    sum += decoder.point[o][i] * row[9 * v + i] + decoder.neighbour[o][i] * mean;
                }
                let found = (1.0 - decoder.bias[o].tanh().powi(2)) * sum;
                assert!(
                    (found - wanted[9 * v + o]).abs() < 1e-5,
                    "vertex {v}, feature {o}: {found}"
                );
            }
        }
        assert_eq!(row_behind(&wanted, &zero_convolution(), &topology), None);
    }

    #[test]
    fn vertices_go_to_the_kept_row_that_moves_them_most() {
        let row = |energies: [f32; 4]| -> Vec<f32> {
            let vertices = energies
                .iter()
                .flat_map(|&x| [x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            vertices.collect()
        };
        let mut labels = vec![Some(0), None, None, None];
        claim(&mut labels, &[row([1.0, 1.0, 0.5, 0.1]), row([0.0, 0.2, 2.0, 0.0])], 1);
        assert_eq!(labels, [Some(0), Some(1), Some(2), None]);
    }
}
