//! How the creature moves: a walk whose pace and stride wander, and a head, neck and tail that mind their own business.

use super::signal::Wander;
use super::skeleton::{Bone, CHEST, EARS, HEAD, HIPS, LEGS, NECK, Pose, TAIL};
use super::{V3, smoothstep};
use core::f64::consts::TAU;
use nalgebra::Rotation3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Steps a second of one leg.
const PACE_HZ: f64 = 0.92;
/// Way of a foot along the ground, in metres.
const STRIDE: f64 = 0.42;
/// Share of the cycle a foot is on the ground.
const STANCE: f64 = 0.62;
/// Height of a lifted foot, in metres.
const LIFT: f64 = 0.13;
/// When each leg of [`LEGS`] lifts, as a share of the cycle: a walk, left hind, left fore, right hind, right fore.
const LEG_PHASES: [f64; 4] = [0.25, 0.75, 0.0, 0.5];
/// A leg is never quite straight, as a share of its length: straight knees pop.
const REACH_MAX: f64 = 0.985;
/// Seconds from the rest pose into the walk.
const START_SECONDS: f64 = 0.35;

/// The signals of a walk.
pub(super) struct Gait {
    pace: Wander,
    stride: Wander,
    graze: Wander,
    neck_yaw: Wander,
    head: [Wander; 3],
    ears: [Wander; 2],
    wag: Wander,
    tail_lift: Wander,
}

impl Gait {
    pub(super) fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut wander = |hertz: f64| Wander::new(hertz, &mut rng);
        Self {
            pace: wander(0.23),
            stride: wander(0.31),
            graze: wander(0.37),
            neck_yaw: wander(0.41),
            head: [wander(0.53), wander(0.47), wander(0.35)],
            ears: [wander(0.9), wander(0.8)],
            wag: wander(0.6),
            tail_lift: wander(0.45),
        }
    }

    /// The pose at `t` seconds; at 0 it is the rest pose.
    pub(super) fn pose(&self, bones: &[Bone], t: f64) -> Pose {
        let start = smoothstep(0.0, START_SECONDS, t);
        let cycle = PACE_HZ * t + 0.08 * self.pace.at(t);
        let swing = TAU * cycle;
        let mut pose = Pose::rest(bones.len());

        // The body bobs twice a cycle and rolls once.
        pose.shift = V3::new(0.012 * swing.sin(), 0.014 * (2.0 * swing).cos() - 0.025, 0.0) * start;
        let body = [
            0.018 * (2.0 * swing + 0.8).sin(),
            0.055 * swing.sin(),
            0.035 * swing.cos(),
        ];
        pose.turns[HIPS] = turn(body.map(|angle| start * angle));
        pose.turns[CHEST] =
            turn([0.03 * (2.0 * swing).sin(), -0.11 * swing.sin(), -0.05 * swing.cos()].map(|angle| start * angle));

        // Lowering the neck tips the head up again, so that the eyes stay on the path.
        let lowered = 0.28 + 0.62 * self.graze.at(t);
        let neck = [
            lowered + 0.05 * (2.0 * swing + 1.0).sin(),
            0.5 * self.neck_yaw.at(t),
            0.0,
        ];
        pose.turns[NECK] = turn(neck.map(|angle| start * angle));
        let head = [
            0.3 * self.head[0].at(t) - 0.45 * lowered,
            0.55 * self.head[1].at(t),
            0.35 * self.head[2].at(t),
        ];
        pose.turns[HEAD] = turn(head.map(|angle| start * angle));
        for (ear, signal) in EARS.into_iter().zip(&self.ears) {
            pose.turns[ear] = turn([start * 0.45 * signal.at(t), 0.0, 0.0]);
        }
        for (i, bone) in TAIL.into_iter().enumerate() {
            let lag = 0.9 * i as f64;
            let wag = (TAU * 1.9 * t - lag).sin() * (0.26 + 0.2 * self.wag.at(t));
            pose.turns[bone] = turn([start * (0.3 * self.tail_lift.at(t - 0.1 * lag)), start * wag, 0.0]);
        }
        for (leg, phase) in LEGS.into_iter().zip(LEG_PHASES) {
            self.step(bones, &mut pose, leg, cycle + phase, t, start);
        }
        pose
    }

    /// Puts the foot of one leg where the cycle wants it: the knee by the law of cosines, the paw flat on the ground.
    fn step(&self, bones: &[Bone], pose: &mut Pose, leg: usize, cycle: f64, t: f64, start: f64) {
        let share = cycle.rem_euclid(1.0);
        let stride = STRIDE * (1.0 + 0.22 * self.stride.at(t));
        let (along, lift, pitch) = if share < STANCE {
            (0.5 - share / STANCE, 0.0, 0.0)
        } else {
            let swing = (share - STANCE) / (1.0 - STANCE);
            let arc = (0.5 * TAU * swing).sin();
            (smoothstep(0.0, 1.0, swing) - 0.5, arc * arc, 0.6 * (TAU * swing).sin())
        };
        let (upper, lower) = (&bones[leg], &bones[leg + 1]);
        let ankle = lower.tail + V3::new(0.0, LIFT * lift, stride * along) * start;

        // In the frame of the body, and in the plane of the leg.
        let parent = upper.parent.unwrap_or(HIPS);
        let (body_turn, body_head) = pose.motion(bones, parent);
        let hip = body_head + body_turn * (upper.head - bones[parent].head);
        let target = body_turn.inverse() * (ankle - hip);
        let [thigh, shin] = [upper.tail - upper.head, lower.tail - lower.head];
        let planar = |p: &V3| (p.z.atan2(p.y), p.y.hypot(p.z));
        let ((thigh_angle, thigh_length), (shin_angle, shin_length)) = (planar(&thigh), planar(&shin));
        let (angle, distance) = planar(&target);
        let distance = distance.clamp(
            (thigh_length - shin_length).abs() + 1e-3,
            REACH_MAX * (thigh_length + shin_length),
        );
        let corner = |a: f64, b: f64, opposite: f64| {
            ((a * a + b * b - opposite * opposite) / (2.0 * a * b))
                .clamp(-1.0, 1.0)
                .acos()
        };
        // The knee stays on the side it is on at rest.
        let side = (thigh.y * shin.z - thigh.z * shin.y).signum();
        let hip_turn = angle - side * corner(thigh_length, distance, shin_length) - thigh_angle;
        let knee_turn = {
            let bent = core::f64::consts::PI - corner(thigh_length, shin_length, distance);
            (thigh_angle + hip_turn + side * bent) - shin_angle - hip_turn
        };
        let body_pitch = body_turn.euler_angles().0;
        let turns = [
            wrap(hip_turn),
            wrap(knee_turn),
            start * pitch - wrap(hip_turn) - wrap(knee_turn) - body_pitch,
        ];
        for (bone, angle) in (leg..).zip(turns) {
            pose.turns[bone] = Rotation3::from_axis_angle(&V3::x_axis(), start * angle);
        }
    }
}

/// Rotation by pitch (x), yaw (y) and roll (z), in radians; roll first.
fn turn([pitch, yaw, roll]: [f64; 3]) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&V3::y_axis(), yaw)
        * Rotation3::from_axis_angle(&V3::x_axis(), pitch)
        * Rotation3::from_axis_angle(&V3::z_axis(), roll)
}

/// The same angle between -pi and pi.
fn wrap(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}
