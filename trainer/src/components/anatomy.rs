//! What a compact package says of its components beyond what it stores: their places in the tree, labels, mirror images and
//! duplicates. Compact package -> [`Anatomy`] -> `sinew inspect`, `sinew rename`, report.

use sinew_formats::package::CompactView;

use super::fields::{Duplicate, duplicates, fields_of};
use super::labels::{Axes, Body, labels};
use super::symmetry::{MirrorImage, MirrorPlane, mirror_images};
use crate::bake::Surface;

/// K components, seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Anatomy {
    /// The mirror plane of the rest shape, where it has one.
    pub plane: Option<MirrorPlane>,
    /// Region and motion of each component; unique. Shape: `[K]`.
    pub labels: Vec<String>,
    /// What each component is on the other side; `None` for all where there is no plane. Shape: `[K]`.
    pub images: Vec<Option<MirrorImage>>,
    /// Pairs that do nearly the same.
    pub duplicates: Vec<Duplicate>,
}

impl Anatomy {
    /// Looks at a package; the same package and axes give the same answer.
    pub fn of(package: &CompactView<'_>, axes: Axes) -> Self {
        let surface = Surface::of_package(package);
        let areas = surface.topology.vertex_areas(&surface.rest);
        let fields = fields_of(package, &surface);
        let plane = MirrorPlane::find(&surface.rest, &areas, &surface.topology);
        let body = Body {
            rest: &surface.rest,
            areas: &areas,
            plane: plane.as_ref(),
            axes,
        };
        Self {
            labels: labels(&fields, &body),
            images: match &plane {
                Some(plane) => mirror_images(&fields, &areas, plane),
                None => vec![None; fields.len()],
            },
            duplicates: duplicates(&fields, &areas),
            plane,
        }
    }
}
