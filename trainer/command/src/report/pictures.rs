//! The standard pictures: a shape, a component's heat map, truth beside reconstruction beside error.

use super::color::{ColorMap, Linear};
use super::image::Image;
use super::raster::{Style, Surface};
use super::shade::draw;
use super::view::Camera;

/// One camera, one style, one connectivity: pictures of a studio can be laid side by side.
#[derive(Debug, Clone)]
pub struct Studio<'a> {
    faces: &'a [[u32; 3]],
    camera: Camera,
    style: Style,
}

/// Truth, reconstruction, and where they differ.
#[derive(Debug, Clone)]
pub struct ComparisonPictures {
    /// The shape of the sequence.
    pub truth: Image,
    /// The shape played by the runtime.
    pub reconstruction: Image,
    /// The reconstruction coloured by its distance from the truth, [`ColorMap::Cool`].
    pub error: Image,
}

impl<'a> Studio<'a> {
    /// Looks at `rest` and fits all `shapes` into pictures of the style. Shape: each shape is `[V]`.
    pub fn new(rest: &[[f32; 3]], faces: &'a [[u32; 3]], shapes: &[&[[f32; 3]]], style: Style) -> Self {
        Self {
            faces,
            camera: Camera::fit(rest, faces, shapes, style.aspect()),
            style,
        }
    }

    /// The same view in another size and style.
    pub fn with_style(&self, style: Style) -> Self {
        let mut camera = self.camera;
        // The picture must stay as wide as it was in units of the subject.
        camera.height *= (camera.aspect / style.aspect()).max(1.0);
        camera.aspect = style.aspect();
        Self {
            faces: self.faces,
            camera,
            style,
        }
    }

    /// A plain picture in clay.
    pub fn shape(&self, positions: &[[f32; 3]]) -> Image {
        draw(
            &self.camera,
            &Surface {
                positions,
                faces: self.faces,
                colors: None,
            },
            &self.style,
        )
    }

    /// A picture coloured by a value a vertex; `from` is the map's 0 and `to` its 1. Shape: `values` is `[V]`.
    pub fn heat(&self, positions: &[[f32; 3]], values: &[f32], map: ColorMap, from: f32, to: f32) -> Image {
        let range = if to > from { to - from } else { 1.0 };
        let colors: Vec<Linear> = values.iter().map(|value| map.color((value - from) / range)).collect();
        draw(
            &self.camera,
            &Surface {
                positions,
                faces: self.faces,
                colors: Some(&colors),
            },
            &self.style,
        )
    }

    /// A component: the deformed shape, coloured by how far each vertex went from rest. `most` is the warm end of the scale.
    pub fn component(&self, rest: &[[f32; 3]], deformed: &[[f32; 3]], most: f32) -> Image {
        self.heat(deformed, &distances(rest, deformed), ColorMap::Warm, 0.0, most)
    }

    /// Truth, reconstruction and error in one view; `most` is the dark end of the error's scale.
    pub fn comparison(&self, truth: &[[f32; 3]], reconstruction: &[[f32; 3]], most: f32) -> ComparisonPictures {
        ComparisonPictures {
            truth: self.shape(truth),
            reconstruction: self.shape(reconstruction),
            error: self.heat(
                reconstruction,
                &distances(truth, reconstruction),
                ColorMap::Cool,
                0.0,
                most,
            ),
        }
    }
}

/// How far each vertex is from itself in the other shape, in units of the shapes. Shape: `[V]`.
pub fn distances(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<f32> {
    a.iter()
        .zip(b)
        .map(|(a, b)| (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum::<f32>().sqrt())
        .collect()
}

/// The value that `share` of the finite values do not exceed: the end of a scale that one stray vertex cannot stretch.
pub fn quantile(values: &[f32], share: f64) -> f32 {
    let mut finite: Vec<f32> = values.iter().copied().filter(|value| value.is_finite()).collect();
    finite.sort_by(f32::total_cmp);
    let last = finite.len().saturating_sub(1);
    finite
        .get((last as f64 * share.clamp(0.0, 1.0)).round() as usize)
        .copied()
        .unwrap_or(0.0)
}
