//! The rasteriser: which face each sample of a picture sees. A z-buffer over triangles, no more; `shade` colours it.

use super::color::Linear;
use super::view::Camera;
use nalgebra::Vector3;

/// What to draw. V vertices, F faces.
#[derive(Debug, Clone, Copy)]
pub struct Surface<'a> {
    /// Shape: `[V]`. Faces with a vertex that is not finite are left out.
    pub positions: &'a [[f32; 3]],
    /// Shape: `[F]`. Faces with an index of V or more are left out.
    pub faces: &'a [[u32; 3]],
    /// Colour of each vertex, linear light. Shape: `[V]`; `None` is clay.
    pub colors: Option<&'a [Linear]>,
}

/// How to draw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// Pixels across. At least 1.
    pub width: u32,
    /// Pixels down. At least 1.
    pub height: u32,
    /// Samples a side of a pixel: 1 is jagged, 2 good, 3 smooth. At least 1.
    pub samples: u32,
    /// Whether the subject throws a soft shadow on the floor.
    pub shadow: bool,
    /// Darkness of the mesh's edges, 0 (none) to 1.
    pub edges: f32,
}

impl Style {
    /// Smooth, with a shadow, without edges.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            samples: 2,
            shadow: true,
            edges: 0.0,
        }
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.width) / f64::from(self.height.max(1))
    }
}

/// No face.
pub(super) const NOTHING: u32 = u32::MAX;

/// What each sample sees. Shape: `[height][width]`, top row first.
pub(super) struct Seen {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Distance along the view; infinite where nothing is.
    pub(super) depth: Vec<f32>,
    /// Index of the face, or [`NOTHING`].
    pub(super) face: Vec<u32>,
    /// Weights of the face's first two corners.
    pub(super) weights: Vec<[f32; 2]>,
}

/// Samples of the picture from the plane at distance 1: `[x, y]`, y down.
pub(super) fn sample_from_plane(camera: &Camera, width: usize, height: usize, [x, y]: [f64; 2]) -> [f64; 2] {
    let scale = height as f64 / camera.height;
    [
        width as f64 / 2.0 + (x - camera.center[0]) * scale,
        height as f64 / 2.0 - (y - camera.center[1]) * scale,
    ]
}

pub(super) fn rasterize(camera: &Camera, surface: &Surface<'_>, style: &Style) -> Seen {
    let (width, height) = (
        (style.width * style.samples) as usize,
        (style.height * style.samples) as usize,
    );
    let mut seen = Seen {
        width,
        height,
        depth: vec![f32::INFINITY; width * height],
        face: vec![NOTHING; width * height],
        weights: vec![[0.0; 2]; width * height],
    };
    let corners: Vec<[f64; 3]> = surface
        .positions
        .iter()
        .map(|p| {
            let [x, y, depth] = camera.project(&Vector3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])));
            let [x, y] = sample_from_plane(camera, width, height, [x, y]);
            [x, y, depth]
        })
        .collect();
    for (f, face) in surface.faces.iter().enumerate() {
        let Some(corners) = pick(&corners, face) else { continue };
        if corners.iter().flatten().all(|x| x.is_finite()) {
            seen.fill(f as u32, &corners);
        }
    }
    seen
}

/// The corners of a face; `None` for an index out of range.
pub(super) fn pick<T: Copy>(values: &[T], face: &[u32; 3]) -> Option<[T; 3]> {
    let [a, b, c] = face.map(|v| values.get(v as usize).copied());
    Some([a?, b?, c?])
}

impl Seen {
    fn fill(&mut self, f: u32, [a, b, c]: &[[f64; 3]; 3]) {
        let doubled_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if doubled_area.abs() < 1e-12 {
            return;
        }
        let span = |i: usize, limit: usize| {
            let low = a[i].min(b[i]).min(c[i]) - 0.5;
            let high = a[i].max(b[i]).max(c[i]) - 0.5;
            // Casts saturate: what is left of the picture becomes 0.
            (low.ceil().max(0.0) as usize)..((high.floor() + 1.0).max(0.0) as usize).min(limit)
        };
        for row in span(1, self.height) {
            for column in span(0, self.width) {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let wa = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / doubled_area;
                let wb = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / doubled_area;
                let wc = 1.0 - wa - wb;
                if wa < 0.0 || wb < 0.0 || wc < 0.0 {
                    continue;
                }
                // Inverse depth is linear on the picture; weights by it are right in perspective.
                let [ia, ib, ic] = [wa / a[2], wb / b[2], wc / c[2]];
                let inverse = ia + ib + ic;
                let depth = (1.0 / inverse) as f32;
                let n = row * self.width + column;
                if depth < self.depth[n] {
                    self.depth[n] = depth;
                    self.face[n] = f;
                    self.weights[n] = [(ia / inverse) as f32, (ib / inverse) as f32];
                }
            }
        }
    }
}
