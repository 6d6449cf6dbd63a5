//! From a compact package to a baked one: the mesh's matrix is ordered and factored, the decoder's convolution folded
//! into the components, everything laid out in the order in which a frame reads it.
//!
//! Path of data: compact package -> [`Surface`] (rings, weights) -> [`factor`] (order, factor) and [`sparse`] -> [`fold`]
//! -> [`tier`], the exact one -> [`bones`], where wanted, fitted and [measured](measure) to what the runtime [plays](play) ->
//! [`Baked`] -> baked package, which the runtime opens without allocating.

mod baked;
pub mod bones;
pub mod factor;
pub mod fold;
pub mod measure;
pub mod mesh;
pub mod play;
pub mod slots;
pub mod sparse;
mod surface;
pub mod tier;

use rayon::prelude::*;
use sinew_formats::package::limits;
use sinew_formats::package::{AlignedBytes, CompactView, OpenError, WriteError};
use sinew_runtime::{Basis, TierChoice};

pub use baked::Baked;
use bones::Bones;
pub use bones::{BoneOptions, Influences};
use factor::EliminationOrder;
use fold::{FoldFrame, FoldedComponent};
pub use surface::Surface;
use tier::Tier;

/// Why a package cannot be baked.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// The factor's indices do not fit.
    #[error("the solver's factor of {vertex_count} vertices does not fit into memory: use a mesh with fewer vertices")]
    FactorTooLarge {
        /// V.
        vertex_count: usize,
    },
    /// A part of the mesh is tied to nothing.
    #[error(
        "vertex {vertex} is not connected to the others through faces and bridges: train again, which lays bridges"
    )]
    NotConnected {
        /// Source index of the first such vertex.
        vertex: usize,
    },
    /// The matrix is not positive definite in f64.
    #[error("the mesh's matrix has no factor{}: check the rest shape for extreme coordinates", at(.vertex))]
    NotPositive {
        /// Source index, where it is known.
        vertex: Option<usize>,
    },
    /// A pose within the controls' stops leaves f32.
    #[error(
        "vertex {vertex} leaves the range of numbers within the controls' stops: the package moves it beyond all measure"
    )]
    Overflow {
        /// Source index.
        vertex: usize,
    },
    /// The result lacks a tier that is to be played.
    #[error("the package has no {tier:?} tier to play")]
    NoTier {
        /// Which one.
        tier: TierChoice,
    },
    /// The result breaks a rule of the format, as magnitudes beyond f32 do.
    #[error("the baked package would be refused")]
    Refused(#[source] WriteError),
    /// The bytes are not a compact package.
    #[error("the package cannot be opened")]
    Unreadable(#[source] OpenError),
}

fn at(vertex: &Option<usize>) -> String {
    vertex.map_or_else(String::new, |vertex| format!(" at vertex {vertex}"))
}

/// What to bake. At least one of the two.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BakeOptions {
    /// Whether the package can solve for all vertices.
    pub exact: bool,
    /// What bones it has.
    pub bones: Option<BoneOptions>,
}

impl Default for BakeOptions {
    /// Both tiers, with bones that every engine can skin by.
    fn default() -> Self {
        Self {
            exact: true,
            bones: Some(BoneOptions {
                count: 128,
                influences: Influences::Four,
            }),
        }
    }
}

/// A count of bones on a command line: none, or as many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoneCount(pub Option<u16>);

/// A text that is neither.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected `none`, or a number of bones from 1 to {}: 64, 128 and 250 are usual",
    limits::BONES
)]
pub struct BoneCountError;

impl core::str::FromStr for BoneCount {
    type Err = BoneCountError;

    fn from_str(text: &str) -> Result<Self, BoneCountError> {
        if text == "none" {
            return Ok(Self(None));
        }
        match text.parse() {
            Ok(count) if (1..=limits::BONES).contains(&usize::from(count)) => Ok(Self(Some(count))),
            _ => Err(BoneCountError),
        }
    }
}

/// Bakes the compact package in `bytes`; see [`bake`].
/// Errors: those of [`bake`], and [`BakeError::Unreadable`].
pub fn bake_bytes(bytes: &[u8]) -> Result<AlignedBytes, BakeError> {
    bake(&CompactView::open(bytes).map_err(BakeError::Unreadable)?)
}

/// Bakes the compact package in `bytes`; see [`bake_with`].
/// Errors: those of [`bake_bytes`].
pub fn bake_bytes_with(bytes: &[u8], options: &BakeOptions) -> Result<AlignedBytes, BakeError> {
    bake_with(&CompactView::open(bytes).map_err(BakeError::Unreadable)?, options)
}

/// Bakes the exact tier alone: what a program needs that bakes and plays at once.
/// Errors: those of [`bake_with`].
pub fn bake(package: &CompactView<'_>) -> Result<AlignedBytes, BakeError> {
    let options = BakeOptions {
        exact: true,
        bones: None,
    };
    bake_with(package, &options)
}

/// Bakes a compact package; the same bytes give the same bytes, whatever the thread count. Bones cost about a thousand poses
/// of the exact tier: they are fitted to them, and their error is measured on others.
/// Errors: a mesh that is not one connected graph, or a result that the format cannot hold.
/// Source: the frame path's design: fold, order (approximate minimum degree), factor in f64, store in f32.
pub fn bake_with(package: &CompactView<'_>, options: &BakeOptions) -> Result<AlignedBytes, BakeError> {
    let surface = Surface::of_package(package);
    let anchor_vertex = package.anchor_vertex() as usize;
    let laplacian = surface.laplacian(anchor_vertex);
    let order = EliminationOrder::new(&laplacian)?;
    let folded = fold_package(package, &surface, &order);
    let block_of_component: Vec<u32> = package.components().map(|component| component.block).collect();
    let exact = Tier::new(
        &laplacian,
        order,
        package.rest_positions(),
        &folded,
        &block_of_component,
    )?;
    let mut baked = Baked::new(package, &surface, &folded, exact);
    if let Some(bones) = &options.bones {
        let made = make_bones(package, &surface, &folded, &block_of_component, &mut baked, bones)?;
        baked.bones = Some(made);
    }
    baked.has_exact = options.exact;
    baked.write()
}

/// Bones of a package that has its exact tier, and how far they are from it.
fn make_bones(
    package: &CompactView<'_>,
    surface: &Surface,
    folded: &[FoldedComponent],
    block_of_component: &[u32],
    baked: &mut Baked<'_>,
    options: &BoneOptions,
) -> Result<Bones, BakeError> {
    let bytes = baked.write()?;
    let played = Basis::open(&bytes).map_err(refused)?;
    let source = bones::Source {
        played: &played,
        surface,
        exact: &baked.exact,
        components: folded,
        block_of_component,
        prior: package.prior(),
    };
    let mut bones = Bones::new(&source, options, |bones, poses| {
        let with_nodes = Baked {
            has_exact: false,
            bones: Some(bones.clone()),
            ..baked.clone()
        };
        let bytes = with_nodes.write()?;
        let basis = Basis::open(&bytes).map_err(refused)?;
        let of_pose = |weights: &Vec<f32>| {
            let nodes = play::pose(&basis, weights)?.nodes;
            Ok(nodes.iter().map(bones::from_rows).collect())
        };
        poses.par_iter().map(of_pose).collect()
    })?;
    baked.bones = Some(bones.clone());
    let bytes = baked.write()?;
    bones.error = measure::bones_error(&Basis::open(&bytes).map_err(refused)?, &package.prior())?;
    Ok(bones)
}

/// What was written opens, for writing opens it; the error is there for the types.
fn refused(error: OpenError) -> BakeError {
    BakeError::Refused(WriteError::Refused(error))
}

fn fold_package(package: &CompactView<'_>, surface: &Surface, order: &EliminationOrder) -> Vec<FoldedComponent> {
    let blocks: Vec<_> = package.blocks().collect();
    let decoders: Vec<_> = package
        .components()
        .map(|component| &blocks[component.block as usize].decoder)
        .collect();
    let frame = FoldFrame {
        ring_offsets: &surface.topology.ring_offsets,
        ring: &surface.topology.ring,
        areas: &surface.gradient_areas(),
        rounding_order: &surface.towards(package.anchor_vertex() as usize),
        solver_from_vertex: &order.solver_from_vertex,
    };
    frame.fold(&sparse::unpack_components(package), &decoders)
}

#[cfg(any(test, feature = "fixture"))]
pub mod fixture;
#[cfg(test)]
mod tests;
