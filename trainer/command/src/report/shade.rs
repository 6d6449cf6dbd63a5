//! From what each sample sees to pixels: a key light, a fill light, soft sky, darkened creases and a shadow on the floor.

use super::color::{CLAY, Linear, linear_from_hex, srgb_byte};
use super::image::Image;
use super::raster::{NOTHING, Seen, Style, Surface, pick, rasterize};
use super::view::Camera;
use nalgebra::Vector3;
use rayon::prelude::*;

type V3 = Vector3<f64>;

/// Towards the lights, in the camera's axes (right, up, towards the viewer), and their strength.
const KEY: ([f64; 3], f64) = ([-0.48, 0.62, 0.62], 0.66);
const FILL: ([f64; 3], f64) = ([0.75, 0.05, 0.5], 0.17);
/// Light from everywhere, from below and what the sky adds from above.
const AMBIENT: [f64; 2] = [0.17, 0.15];
/// Strength and sharpness of the highlight.
const HIGHLIGHT: (f64, i32) = (0.07, 32);
/// Reach of creases, as a share of the picture's height, how dark they get, and how many places are looked at.
const CREASE_REACH: f64 = 0.055;
const CREASE_DARKNESS: f64 = 0.85;
const CREASE_LOOKS: usize = 14;
/// Darkness of the shadow where the subject touches the floor.
const SHADOW_DARKNESS: f64 = 0.38;
/// Cells a side of the shadow's map.
const SHADOW_CELLS: usize = 160;

/// Draws a surface on a transparent ground. The same input gives the same pixels.
pub fn draw(camera: &Camera, surface: &Surface<'_>, style: &Style) -> Image {
    let style = Style {
        width: style.width.max(1),
        height: style.height.max(1),
        samples: style.samples.max(1),
        ..*style
    };
    let seen = rasterize(camera, surface, &style);
    shade(camera, surface, &style, &seen)
}

fn shade(camera: &Camera, surface: &Surface<'_>, style: &Style, seen: &Seen) -> Image {
    let scene = Scene {
        camera,
        surface,
        style,
        seen,
        normals: vertex_normals(surface),
        clay: linear_from_hex(CLAY),
        shadow: style.shadow.then(|| Shadow::of(camera, surface)).flatten(),
    };
    let samples = style.samples as usize;
    let rows: Vec<Vec<u8>> = (0..style.height as usize)
        .into_par_iter()
        .map(|y| {
            let mut row = Vec::with_capacity(style.width as usize * 4);
            for x in 0..style.width as usize {
                let mut sum = [0.0f64; 4];
                for n in
                    (0..samples * samples).map(|i| (y * samples + i / samples) * seen.width + x * samples + i % samples)
                {
                    let [r, g, b, alpha] = scene.sample(n);
                    for (sum, part) in sum.iter_mut().zip([r * alpha, g * alpha, b * alpha, alpha]) {
                        *sum += part;
                    }
                }
                let alpha = sum[3].max(1e-9);
                row.extend([0, 1, 2].map(|c| srgb_byte((sum[c] / alpha) as f32)));
                row.push((sum[3] / (samples * samples) as f64 * 255.0 + 0.5) as u8);
            }
            row
        })
        .collect();
    Image {
        width: style.width,
        height: style.height,
        rgba: rows.concat(),
    }
}

fn vector(p: [f32; 3]) -> V3 {
    V3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

/// Means of the face normals around each vertex, weighted by area.
fn vertex_normals(surface: &Surface<'_>) -> Vec<V3> {
    let mut normals = vec![V3::zeros(); surface.positions.len()];
    for face in surface.faces {
        let Some(corners) = pick(surface.positions, face) else {
            continue;
        };
        let [a, b, c] = corners.map(vector);
        let normal = (b - a).cross(&(c - a));
        if normal.iter().all(|x| x.is_finite()) {
            face.iter().for_each(|&v| normals[v as usize] += normal);
        }
    }
    normals
}

struct Scene<'a> {
    camera: &'a Camera,
    surface: &'a Surface<'a>,
    style: &'a Style,
    seen: &'a Seen,
    normals: Vec<V3>,
    clay: Linear,
    shadow: Option<Shadow>,
}

impl Scene<'_> {
    /// Linear red, green, blue and alpha of one sample.
    fn sample(&self, n: usize) -> [f64; 4] {
        let face = self.seen.face[n];
        if face == NOTHING {
            return [
                0.0,
                0.0,
                0.0,
                self.shadow.as_ref().map_or(0.0, |shadow| self.shadow_alpha(shadow, n)),
            ];
        }
        let face = &self.surface.faces[face as usize];
        let [a, b] = self.seen.weights[n].map(f64::from);
        let weights = [a, b, 1.0 - a - b];
        let blend = |values: [V3; 3]| values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2];
        let Some(corner_normals) = pick(&self.normals, face) else {
            return [0.0; 4];
        };
        // Faces weigh in by area, so corners may differ in length by much: directions are blended, not sums.
        let normal = blend(corner_normals.map(|normal| normal.try_normalize(0.0).unwrap_or_else(V3::zeros)));
        let in_view = V3::new(
            normal.dot(&self.camera.right),
            normal.dot(&self.camera.up),
            normal.dot(&self.camera.back),
        );
        let in_view = in_view.try_normalize(1e-12).unwrap_or_else(V3::z);
        // Sheets are lit on both sides.
        let facing = if in_view.z < 0.0 { -in_view } else { in_view };
        let color = match self.surface.colors.and_then(|colors| pick(colors, face)) {
            Some(colors) => blend(colors.map(vector)),
            None => vector(self.clay),
        };
        let lit = |(towards, strength): ([f64; 3], f64), wrap: f64| {
            let cosine = facing.dot(&V3::from(towards).normalize());
            strength * ((cosine + wrap) / (1.0 + wrap)).max(0.0)
        };
        let open = 1.0 - CREASE_DARKNESS * self.crease(n, &facing);
        let sky = AMBIENT[0] + AMBIENT[1] * (0.5 + 0.5 * facing.y);
        let light = lit(KEY, 0.12) * (0.35 + 0.65 * open) + (lit(FILL, 0.3) + sky) * open;
        let half = (V3::from(KEY.0).normalize() + V3::z()).normalize();
        let highlight = HIGHLIGHT.0 * facing.dot(&half).max(0.0).powi(HIGHLIGHT.1) * open;
        let ink = if self.style.edges > 0.0 {
            1.0 - f64::from(self.style.edges) * self.edge(n, face, &weights)
        } else {
            1.0
        };
        let color = (color * light + V3::repeat(highlight)) * ink;
        [color.x, color.y, color.z, 1.0]
    }

    /// The point that sample `n` sees at `depth`, in the camera's axes.
    fn point(&self, column: f64, row: f64, depth: f64) -> V3 {
        let scale = self.camera.height / self.seen.height as f64;
        let x = self.camera.center[0] + (column - self.seen.width as f64 / 2.0) * scale;
        let y = self.camera.center[1] - (row - self.seen.height as f64 / 2.0) * scale;
        V3::new(x * depth, y * depth, -depth)
    }

    /// How much of the sky above a sample its neighbours on the picture hide. Range: 0 to 1.
    fn crease(&self, n: usize, normal: &V3) -> f64 {
        let (column, row) = (n % self.seen.width, n / self.seen.width);
        let at =
            |column: usize, row: usize, depth: f32| self.point(column as f64 + 0.5, row as f64 + 0.5, f64::from(depth));
        let here = at(column, row, self.seen.depth[n]);
        let reach = CREASE_REACH * self.seen.height as f64;
        let reach_length = reach * self.camera.height / self.seen.height as f64 * f64::from(self.seen.depth[n]);
        // A golden spiral, turned from sample to sample in a 4 x 4 pattern that the pixel's mean smooths out.
        let start = ((column % 4) * 4 + row % 4) as f64 / 16.0;
        let mut hidden = 0.0;
        for i in 0..CREASE_LOOKS {
            let share = (i as f64 + start) / CREASE_LOOKS as f64;
            let angle = 2.399_963_229_728_653 * i as f64 + core::f64::consts::TAU * start;
            let (x, y) = (
                column as f64 + reach * share * angle.cos(),
                row as f64 + reach * share * angle.sin(),
            );
            if x < 0.0 || y < 0.0 || x >= self.seen.width as f64 || y >= self.seen.height as f64 {
                continue;
            }
            let (x, y) = (x as usize, y as usize);
            let depth = self.seen.depth[y * self.seen.width + x];
            if depth.is_finite() {
                let towards = at(x, y, depth) - here;
                let distance = towards.norm().max(1e-12);
                let near = (1.0 - distance / (1.6 * reach_length)).max(0.0);
                hidden += (towards.dot(normal) / distance - 0.18).max(0.0) * near;
            }
        }
        (1.9 * hidden / CREASE_LOOKS as f64).min(1.0)
    }

    /// 1 on an edge of the mesh, 0 a pixel away.
    fn edge(&self, n: usize, face: &[u32; 3], weights: &[f64; 3]) -> f64 {
        let Some(corners) = pick(self.surface.positions, face) else {
            return 0.0;
        };
        let corners = corners.map(vector);
        let pixel = f64::from(self.seen.depth[n]) * self.camera.height / f64::from(self.style.height);
        let area = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).norm();
        let distance =
            (0..3).map(|c| weights[c] * area / (corners[(c + 1) % 3] - corners[(c + 2) % 3]).norm().max(1e-30));
        (1.0 - distance.fold(f64::INFINITY, f64::min) / (0.6 * pixel)).clamp(0.0, 1.0)
    }

    fn shadow_alpha(&self, shadow: &Shadow, n: usize) -> f64 {
        let (column, row) = ((n % self.seen.width) as f64 + 0.5, (n / self.seen.width) as f64 + 0.5);
        let ray = self.point(column, row, 1.0);
        let ray = self.camera.right * ray.x + self.camera.up * ray.y + self.camera.back * ray.z;
        let fall = ray.dot(&self.camera.floor_up);
        if fall > -1e-6 {
            return 0.0;
        }
        let steps = (self.camera.floor - self.camera.eye.dot(&self.camera.floor_up)) / fall;
        // The shadow fades out before the picture ends.
        let (across, down) = (column / self.seen.width as f64, row / self.seen.height as f64);
        let border = across.min(1.0 - across).min(down).min(1.0 - down);
        SHADOW_DARKNESS * shadow.at(&(self.camera.eye + ray * steps)) * (border / 0.06).clamp(0.0, 1.0)
    }
}

/// How dark the floor is below the subject, on a square grid.
struct Shadow {
    axes: [V3; 2],
    origin: [f64; 2],
    cell: f64,
    darkness: Vec<f64>,
}

impl Shadow {
    fn of(camera: &Camera, surface: &Surface<'_>) -> Option<Self> {
        let up = camera.floor_up;
        let first = up.cross(&camera.back).try_normalize(1e-9)?;
        let axes = [first, up.cross(&first)];
        let on_floor: Vec<[f64; 3]> = surface
            .positions
            .iter()
            .map(|p| vector(*p))
            .map(|p| [p.dot(&axes[0]), p.dot(&axes[1]), p.dot(&up) - camera.floor])
            .collect();
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in on_floor.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
            for c in 0..3 {
                low[c] = low[c].min(p[c]);
                high[c] = high[c].max(p[c]);
            }
        }
        let size = (high[0] - low[0]).max(high[1] - low[1]);
        if !(size.is_finite() && size > 0.0) {
            return None;
        }
        // A third of the map is border for the blur.
        let cell = 1.5 * size / SHADOW_CELLS as f64;
        let origin = [0, 1].map(|c| (low[c] + high[c]) / 2.0 - 0.75 * size);
        let softness = 0.22 * (high[2] - low[2]).max(0.25 * size);
        let mut darkness = vec![0.0f64; SHADOW_CELLS * SHADOW_CELLS];
        for face in surface.faces {
            let Some(corners) = pick(&on_floor, face) else { continue };
            if corners.iter().flatten().all(|x| x.is_finite()) {
                let corners = corners.map(|p| {
                    [
                        (p[0] - origin[0]) / cell,
                        (p[1] - origin[1]) / cell,
                        (-p[2] / softness).exp(),
                    ]
                });
                splat(&mut darkness, &corners);
            }
        }
        for _ in 0..3 {
            darkness = blurred(&blurred(&darkness, 1, SHADOW_CELLS), SHADOW_CELLS, 1);
        }
        Some(Self {
            axes,
            origin,
            cell,
            darkness,
        })
    }

    fn at(&self, p: &V3) -> f64 {
        let [x, y] = [0, 1].map(|c| (p.dot(&self.axes[c]) - self.origin[c]) / self.cell - 0.5);
        let limit = (SHADOW_CELLS - 1) as f64;
        if !(x >= 0.0 && y >= 0.0 && x < limit && y < limit) {
            return 0.0;
        }
        let (i, j) = (x as usize, y as usize);
        let (u, w) = (x - i as f64, y - j as f64);
        let cell = |i: usize, j: usize| self.darkness[j * SHADOW_CELLS + i];
        (cell(i, j) * (1.0 - u) + cell(i + 1, j) * u) * (1.0 - w)
            + (cell(i, j + 1) * (1.0 - u) + cell(i + 1, j + 1) * u) * w
    }
}

/// Keeps the darkest of what is over each cell that the face covers.
fn splat(darkness: &mut [f64], [a, b, c]: &[[f64; 3]; 3]) {
    let doubled_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let span = |i: usize| {
        let (low, high) = (a[i].min(b[i]).min(c[i]), a[i].max(b[i]).max(c[i]));
        (low.floor().max(0.0) as usize)..(high.ceil().max(0.0) as usize).min(SHADOW_CELLS)
    };
    for row in span(1) {
        for column in span(0) {
            let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
            // Cells that the centre of a thin face misses still count: weights are clamped, not refused, near the edges.
            let (wa, wb) = if doubled_area.abs() < 1e-9 {
                (1.0 / 3.0, 1.0 / 3.0)
            } else {
                (
                    ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / doubled_area,
                    ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / doubled_area,
                )
            };
            let wc = 1.0 - wa - wb;
            if wa.min(wb).min(wc) >= -0.05 {
                let here = (wa * a[2] + wb * b[2] + wc * c[2]).clamp(0.0, 1.0);
                let cell = &mut darkness[row * SHADOW_CELLS + column];
                *cell = cell.max(here);
            }
        }
    }
}

/// Running mean along one axis of the square map.
fn blurred(map: &[f64], step: usize, line_step: usize) -> Vec<f64> {
    const REACH: usize = 3;
    let mut out = vec![0.0; map.len()];
    for line in 0..SHADOW_CELLS {
        for i in 0..SHADOW_CELLS {
            let (from, to) = (i.saturating_sub(REACH), (i + REACH).min(SHADOW_CELLS - 1));
            let sum: f64 = (from..=to).map(|k| map[line * line_step + k * step]).sum();
            out[line * line_step + i * step] = sum / (2 * REACH + 1) as f64;
        }
    }
    out
}
