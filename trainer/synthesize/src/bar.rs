//! A rounded bar, clamped at its foot, that bends in two directions, twists past half a turn, swells, and mixes them.
//!
//! The bar is a rod: curvature and twist rate along the centre line are integrated into a moving frame (the rod's section), and
//! the sections ride on it. Every motion has a signal of its own, so that they are learnable apart.

use super::signal::Wander;
use super::{FRAME_SECONDS, Settings, Subject, SynthesizeError, V3, sequence, smoothstep};
use core::f64::consts::{PI, TAU};
use nalgebra::Rotation3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sinew_interchange::MeshSequence;
use std::collections::BTreeMap;

/// Height of the bar and width of its square section, in metres.
const HEIGHT: f64 = 6.0;
const WIDTH: f64 = 1.0;
/// Radius of the rounded edges.
const ROUNDING: f64 = 0.22;
/// Largest bend of half the bar, in radians.
const BEND_MAX: f64 = 1.1;
/// Largest twist from foot to head, in radians: well past half a turn.
const TWIST_MAX: f64 = 1.45 * PI;
/// Frames of one programme of bending, twisting and both; longer sequences repeat the programme, never the motion.
const PROGRAMME_FRAMES: usize = 60;
/// Seconds from the rest pose into the first bend.
const START_SECONDS: f64 = 0.3;
/// Steps of the integration along the centre line.
const STEP_COUNT: usize = 480;

/// Synthesizes a bar along y, foot at y = 0; shape 0 is straight. Closed and in one piece.
///
/// The first third of 60 frames mostly bends, the second mostly twists, the last does both; shorter sequences hurry.
/// Errors: counts out of range.
pub fn bar(settings: &Settings) -> Result<MeshSequence, SynthesizeError> {
    settings.check(Subject::Bar)?;
    let (across, along) = cells_for(settings.vertices);
    let (rest, faces) = rounded_box(across, along);
    let motion = Motion::new(settings.seed);
    let shapes: Vec<Vec<V3>> = (0..settings.frames)
        .map(|m| {
            if m == 0 {
                return rest.clone();
            }
            let act_share = m as f64 / settings.frames.min(PROGRAMME_FRAMES) as f64;
            let pose = motion.at(m as f64 * FRAME_SECONDS, act_share.fract());
            let rod = Rod::integrate(&pose);
            rest.iter().map(|p| rod.place(p, &pose)).collect()
        })
        .collect();
    Ok(sequence(Subject::Bar, faces, &shapes))
}

/// Cells across and along whose box has the nearest vertex count, with cells near to square.
fn cells_for(vertex_count: usize) -> (usize, usize) {
    let slenderness = HEIGHT / WIDTH;
    (2..=120)
        .map(|across: usize| {
            let rest = vertex_count.saturating_sub(2 * (across - 1) * (across - 1));
            let along = (rest as f64 / (4 * across) as f64 - 1.0).round().max(2.0) as usize;
            (across, along)
        })
        .min_by(|a, b| {
            let cost = |(across, along): &(usize, usize)| {
                let count = 4 * across * (along + 1) + 2 * (across - 1) * (across - 1);
                let shape = (*along as f64 / (*across as f64 * slenderness)).ln().abs();
                count.abs_diff(vertex_count) as f64 / vertex_count as f64 + shape
            };
            cost(a).total_cmp(&cost(b))
        })
        .unwrap_or((4, 24))
}

/// The surface of a box of `across` x `along` x `across` cells, its edges rounded. Normals point outwards.
fn rounded_box(across: usize, along: usize) -> (Vec<V3>, Vec<[u32; 3]>) {
    let cells = [across, along, across];
    let half = V3::new(WIDTH, HEIGHT, WIDTH) / 2.0;
    let mut indices: BTreeMap<[usize; 3], u32> = BTreeMap::new();
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    let mut vertex = |corner: [usize; 3]| -> u32 {
        *indices.entry(corner).or_insert_with(|| {
            let p = V3::from_fn(|c, _| (2.0 * corner[c] as f64 / cells[c] as f64 - 1.0) * half[c]);
            let core = half.map(|h| h - ROUNDING);
            let inner = V3::from_fn(|c, _| p[c].clamp(-core[c], core[c]));
            let rounded = inner + (p - inner).normalize() * ROUNDING;
            positions.push(rounded + V3::y() * half.y);
            (positions.len() - 1) as u32
        })
    };
    // Axes (u, w, normal) in cyclic order: u x w = normal.
    for normal in 0..3 {
        let (u, w) = ((normal + 1) % 3, (normal + 2) % 3);
        for far in [false, true] {
            for i in 0..cells[u] {
                for j in 0..cells[w] {
                    let mut at = |du: usize, dw: usize| {
                        let mut corner = [0; 3];
                        corner[normal] = if far { cells[normal] } else { 0 };
                        corner[u] = i + du;
                        corner[w] = j + dw;
                        vertex(corner)
                    };
                    let quad = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
                    let [a, b, c, d] = if far {
                        quad
                    } else {
                        [quad[0], quad[3], quad[2], quad[1]]
                    };
                    if (i + j) % 2 == 0 {
                        faces.extend([[a, b, c], [a, c, d]]);
                    } else {
                        faces.extend([[a, b, d], [b, c, d]]);
                    }
                }
            }
        }
    }
    (positions, faces)
}

/// The signals of the independent motions.
struct Motion {
    lower_bend: [Wander; 2],
    upper_bend: [Wander; 2],
    twist: Wander,
    swell: Wander,
    swell_place: Wander,
}

/// One pose of the rod.
struct Pose {
    /// Bend of the lower and the upper half about x and z, radians over the half.
    lower_bend: [f64; 2],
    upper_bend: [f64; 2],
    /// Twist from foot to head, radians.
    twist: f64,
    /// Relative growth of the section at the bulge, and where the bulge is as a share of the height.
    swell: f64,
    swell_place: f64,
}

impl Motion {
    fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut wander = |hertz: f64| Wander::new(hertz, &mut rng);
        Self {
            lower_bend: [wander(0.31), wander(0.26)],
            upper_bend: [wander(0.43), wander(0.37)],
            twist: wander(0.35),
            swell: wander(0.55),
            swell_place: wander(0.2),
        }
    }

    /// The pose at `t` seconds, `share` of the way through the programme.
    fn at(&self, t: f64, share: f64) -> Pose {
        let start = smoothstep(0.0, START_SECONDS, t);
        let bending = start * (1.0 - 0.9 * smoothstep(0.26, 0.46, share) + 0.9 * smoothstep(0.58, 0.78, share));
        // One wave from 0.3 on: one way while straight, the other way while bent.
        let sweep = (TAU * (share - 0.3).max(0.0) / 0.7).sin();
        Pose {
            lower_bend: [0, 1].map(|c| BEND_MAX * bending * self.lower_bend[c].at(t)),
            upper_bend: [0, 1].map(|c| BEND_MAX * bending * self.upper_bend[c].at(t)),
            twist: TWIST_MAX * (0.9 * sweep + 0.1 * start * self.twist.at(t)),
            swell: 0.28 * start * self.swell.at(t),
            swell_place: 0.5 + 0.25 * self.swell_place.at(t),
        }
    }
}

/// The centre line, its bent frame and the twist about it at evenly spaced heights. Shape: `[STEP_COUNT + 1]`.
struct Rod {
    centers: Vec<V3>,
    frames: Vec<Rotation3<f64>>,
    twists: Vec<f64>,
}

impl Rod {
    fn integrate(pose: &Pose) -> Self {
        let step = HEIGHT / STEP_COUNT as f64;
        let (mut center, mut frame, mut twist) = (V3::zeros(), Rotation3::<f64>::identity(), 0.0);
        let mut rod = Self {
            centers: vec![center],
            frames: vec![frame],
            twists: vec![twist],
        };
        for i in 0..STEP_COUNT {
            let share = (i as f64 + 0.5) / STEP_COUNT as f64;
            let (lower, upper) = (bump(0.04, 0.56, share), bump(0.44, 0.96, share));
            let [bend_x, bend_z] = [0, 1].map(|c| pose.lower_bend[c] * lower + pose.upper_bend[c] * upper);
            let turn = V3::new(bend_x, 0.0, bend_z) / STEP_COUNT as f64;
            // Half of the turn before the step and half after: the mid-point rule.
            let half_turn = Rotation3::new(turn / 2.0);
            frame *= half_turn;
            center += frame * V3::y() * step;
            frame *= half_turn;
            twist += pose.twist * bump(0.04, 0.96, share) / STEP_COUNT as f64;
            rod.centers.push(center);
            rod.frames.push(frame);
            rod.twists.push(twist);
        }
        rod
    }

    /// Where a point of the straight bar goes.
    fn place(&self, rest: &V3, pose: &Pose) -> V3 {
        let place = (rest.y / HEIGHT).clamp(0.0, 1.0) * STEP_COUNT as f64;
        let i = (place as usize).min(STEP_COUNT - 1);
        let part = place - i as f64;
        let center = self.centers[i].lerp(&self.centers[i + 1], part);
        let frame = self.frames[i].slerp(&self.frames[i + 1], part);
        let twist = self.twists[i] + part * (self.twists[i + 1] - self.twists[i]);
        let from_bulge = (rest.y / HEIGHT - pose.swell_place) / 0.13;
        let scale = 1.0 + pose.swell * (-from_bulge * from_bulge).exp();
        let section = V3::new(rest.x, 0.0, rest.z) * scale;
        center + frame * (Rotation3::from_axis_angle(&V3::y_axis(), twist) * section)
    }
}

/// A raised cosine between `from` and `to` that integrates to 1: bending and twisting fade in and out without a kink.
fn bump(from: f64, to: f64, share: f64) -> f64 {
    if share <= from || share >= to {
        return 0.0;
    }
    (1.0 - (TAU * (share - from) / (to - from)).cos()) / (to - from)
}
