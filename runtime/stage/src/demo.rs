//! A package that needs no file: a sea worm, made by formulas, for a first look and for a box that is not yet finished. Its components
//! are what a trained package has, a tree from coarse to fine; only nobody learned them.

use core::f32::consts::TAU;

use miette::{IntoDiagnostic, Report};
use sinew_bake::bake_bytes;
use sinew_formats::package::{
    After, AlignedBytes, BlockRecord, CompactBasis, ComponentRecord, FEATURE_COUNT, GraphConvRecord, NONE, Prior,
    Provenance, Quality, Surface, ValueScales, write_compact,
};

/// What it is called where a file has a name.
pub const NAME: &str = "sea worm";

const RINGS: usize = 64;
const SIDES: usize = 28;
const VERTICES: usize = RINGS * SIDES + 2;
const HEIGHT: f32 = 4.0;
/// Radians of a value of 1. Values stay far below: the network's tanh is nearly straight there.
const ROTATION_SCALE: f32 = 8.0;
const STRETCH_SCALE: f32 = 4.0;

/// What a component does along the body, from 0 at the foot to 1 at the head.
#[derive(Clone, Copy)]
enum Shape {
    /// Turns about an axis, radians at a weight of 1: nothing below `from`, all of it above `to`.
    Turn { axis: [f32; 3], from: f32, to: f32 },
    /// Grows across the body, as a factor less 1, about a place, over a width.
    Swell { at: f32, width: f32, factor: f32 },
}

const ASIDE: [f32; 3] = [0.0, 0.0, -1.0];
const AHEAD: [f32; 3] = [1.0, 0.0, 0.0];
const AROUND: [f32; 3] = [0.0, 1.0, 0.0];

const fn turn(axis: [f32; 3], from: f32, to: f32) -> Shape {
    Shape::Turn { axis, from, to }
}

const fn swell(at: f32, width: f32, factor: f32) -> Shape {
    Shape::Swell { at, width, factor }
}

/// Block, name, radians or factor at either end of the range, shape. A block's components stand together, the coarse ones first.
const COMPONENTS: [(u32, &str, f32, Shape); 12] = [
    (0, "sway", 2.2, turn(ASIDE, 0.0, 1.0)),
    (0, "nod", 2.2, turn(AHEAD, 0.0, 1.0)),
    (0, "twist", 2.4, turn(AROUND, 0.0, 0.9)),
    (0, "breathe", 0.8, swell(0.45, 0.35, 1.0)),
    (1, "sway-foot", 1.2, turn(ASIDE, 0.0, 0.3)),
    (1, "sway-middle", 1.2, turn(ASIDE, 0.3, 0.65)),
    (1, "sway-neck", 1.2, turn(ASIDE, 0.65, 0.9)),
    (2, "nod-middle", 1.2, turn(AHEAD, 0.3, 0.65)),
    (2, "nod-neck", 1.2, turn(AHEAD, 0.65, 0.9)),
    (3, "belly", 0.9, swell(0.3, 0.15, 1.0)),
    (3, "chest", 0.9, swell(0.6, 0.15, 1.0)),
    (3, "head", 0.7, swell(0.92, 0.12, 1.0)),
];

/// Component above each block.
const PARENTS: [u32; 4] = [NONE, 0, 1, 3];

/// The baked package.
///
/// # Errors
/// None, unless the format's rules change.
pub fn package() -> Result<AlignedBytes, Report> {
    let (rest, faces) = mesh();
    let words = VERTICES.div_ceil(32);
    let mut support_bits = vec![0_u32; COMPONENTS.len() * words];
    let (mut values, mut components) = (Vec::new(), Vec::new());
    for (k, &(block, name, most, shape)) in COMPONENTS.iter().enumerate() {
        let all: Vec<[f32; FEATURE_COUNT]> = (0..VERTICES).map(|v| features(shape, along(&rest[v]))).collect();
        let is_moved = |v: usize| all[v].iter().any(|feature| *feature != 0.0);
        let own: Vec<_> = (0..VERTICES).filter(|v| is_moved(*v)).map(|v| all[v]).collect();
        for v in (0..VERTICES).filter(|v| is_moved(*v)) {
            support_bits[k * words + v / 32] |= 1 << (v % 32);
        }
        let value_scales = ValueScales::for_values(&own);
        values.extend(own.iter().map(|value| value_scales.round(value)));
        let size = |v: usize| all[v].iter().map(|feature| feature * feature).sum::<f32>();
        let centre = (0..VERTICES).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0);
        components.push(ComponentRecord {
            name,
            block,
            centre_vertex: centre as u32,
            scale: 1.0,
            strength: 1.0,
            locality: 1.0,
            // What swells does not shrink as far.
            minimum: if matches!(shape, Shape::Swell { .. }) {
                -0.5 * most
            } else {
                -most
            },
            maximum: most,
            value_scales,
        });
    }
    let compact = write_compact(&CompactBasis {
        rest_positions: &rest,
        surface: Surface::plain(VERTICES, &faces),
        bridges: &[],
        // The lower pole: it stands where it stands.
        anchor_vertex: (RINGS * SIDES) as u32,
        rotation_scale: ROTATION_SCALE,
        stretch_scale: STRETCH_SCALE,
        blocks: &blocks(),
        components: &components,
        support_bits: &support_bits,
        values: &values,
        after: After::NONE,
        prior: Prior::NONE,
        encoder: &[],
        provenance: Provenance {
            tool: concat!("sinew-stage ", env!("CARGO_PKG_VERSION")),
            sequence: NAME,
            config: "",
            seed: 0,
            shape_count: 2,
            train_shapes: &[0, 1],
        },
        // Nothing was learned, so nothing was measured.
        quality: Quality {
            validation_e_rms: -1.0,
            steps: 0,
            steps_run: 0,
        },
    });
    bake_bytes(&compact.into_diagnostic()?).into_diagnostic()
}

fn blocks() -> Vec<BlockRecord> {
    let unit = |diagonal: f32| core::array::from_fn(|i| core::array::from_fn(|j| if i == j { diagonal } else { 0.0 }));
    let same = GraphConvRecord {
        point: unit(1.0),
        neighbour: unit(0.0),
        bias: [0.0; FEATURE_COUNT],
    };
    let block = |(b, &parent_component): (usize, &u32)| {
        let own = |component: &&(u32, &str, f32, Shape)| component.0 == b as u32;
        BlockRecord {
            level: u32::from(parent_component != NONE),
            parent_component,
            first_component: COMPONENTS.iter().position(|component| own(&component)).unwrap_or(0) as u32,
            component_count: COMPONENTS.iter().filter(own).count() as u32,
            encoder: same,
            decoder: same,
        }
    };
    PARENTS.iter().enumerate().map(block).collect()
}

/// Place along the body.
fn along(position: &[f32; 3]) -> f32 {
    (position[1] / HEIGHT).clamp(0.0, 1.0)
}

/// 0 below 0, 1 above 1, without corners between.
fn smooth(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Log-rotation xyz, then stretch xx xy xz yy yz zz, at a weight of 1, in the network's units.
fn features(shape: Shape, along: f32) -> [f32; FEATURE_COUNT] {
    let mut features = [0.0; FEATURE_COUNT];
    match shape {
        Shape::Turn { axis, from, to } => {
            let share = smooth((along - from) / (to - from)) / ROTATION_SCALE;
            for (feature, a) in features.iter_mut().zip(axis) {
                *feature = a * share;
            }
        }
        Shape::Swell { at, width, factor } => {
            let away = (along - at) / width;
            let share = if away.abs() < 1.0 {
                smooth(1.0 - away.abs())
            } else {
                0.0
            };
            for feature in [3, 8] {
                features[feature] = factor * share / STRETCH_SCALE;
            }
        }
    }
    features
}

/// Rings around the y axis, a pole at either end; counter-clockwise from outside.
fn mesh() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let point = |n: usize| {
        let (along, around) = (
            (n / SIDES) as f32 / (RINGS - 1) as f32,
            TAU * (n % SIDES) as f32 / SIDES as f32,
        );
        let radius = radius(along, around);
        [radius * around.sin(), HEIGHT * along, radius * around.cos()]
    };
    let mut rest: Vec<[f32; 3]> = (0..RINGS * SIDES).map(point).collect();
    rest.extend([[0.0, -0.02, 0.0], [0.0, HEIGHT + 0.05, 0.0]]);
    let at = |ring: usize, side: usize| (ring * SIDES + side % SIDES) as u32;
    let mut faces = Vec::new();
    for ring in 0..RINGS - 1 {
        for side in 0..SIDES {
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            let [c, d] = [at(ring + 1, side), at(ring + 1, side + 1)];
            faces.extend([[a, b, d], [a, d, c]]);
        }
    }
    let (foot, crown) = ((RINGS * SIDES) as u32, (RINGS * SIDES + 1) as u32);
    for side in 0..SIDES {
        faces.push([foot, at(0, side + 1), at(0, side)]);
        faces.push([crown, at(RINGS - 1, side), at(RINGS - 1, side + 1)]);
    }
    (rest, faces)
}

/// A foot, a tapering body with rings on it, a head with two eyes that look along z.
fn radius(along: f32, around: f32) -> f32 {
    let body = 0.42 - 0.2 * along + 0.25 * (-along / 0.05).exp();
    let rings = 0.012 * (along * 90.0).sin() * smooth((0.8 - along) / 0.1);
    let head = 0.2 * (-((along - 0.9) / 0.07).powi(2)).exp();
    let eye = |side: f32| {
        let turned = (around + side).sin().powi(2) + ((around + side).cos() - 1.0).powi(2);
        0.13 * (-((along - 0.92) / 0.025).powi(2) - turned / 0.05).exp()
    };
    let crown = (1.0 - smooth((along - 0.94) / 0.06)).max(0.02).sqrt();
    (body + rings + head + eye(0.65) + eye(-0.65)) * crown
}

#[cfg(test)]
mod tests {
    use sinew_runtime::Basis;

    use super::*;
    use crate::play::{Scene, SceneMemory};

    #[test]
    fn every_component_moves_the_worm_and_leaves_its_foot() {
        let bytes = package().unwrap();
        let basis = Basis::open(&bytes).unwrap();
        let mut memory = SceneMemory::for_basis(&basis);
        let mut scene = Scene::new(&basis, &mut memory).unwrap();
        scene.solve().unwrap();
        let rest = scene.positions.clone();
        let farthest = |positions: &[[f32; 3]]| {
            let distance = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt();
            positions.iter().zip(&rest).map(distance).fold(0.0, f32::max)
        };
        for k in 0..basis.component_count() {
            let component = basis.component(k);
            for end in [component.minimum, component.maximum] {
                scene.controls.reset();
                scene.controls.set(k, end).unwrap();
                scene.solve().unwrap();
                let moved = farthest(&scene.positions);
                assert!(
                    (0.03..3.0 * HEIGHT).contains(&moved),
                    "{} at {end}: {moved}",
                    component.name
                );
                let foot = scene.positions[RINGS * SIDES];
                assert!(
                    (0..3).all(|c| (foot[c] - rest[RINGS * SIDES][c]).abs() < 1e-4),
                    "{}",
                    component.name
                );
            }
        }
        // A sway goes to the side, by about as much as an arc of that angle does.
        scene.controls.reset();
        scene.controls.set(0, 1.0).unwrap();
        scene.solve().unwrap();
        let crown = scene.positions[RINGS * SIDES + 1];
        assert!(crown[0] > 0.3 * HEIGHT && crown[2].abs() < 0.1 * HEIGHT, "{crown:?}");
    }
}
