//! A flag in gusty wind: cloth simulated with extended position-based dynamics in small substeps.
//!
//! Shear and bending are distance constraints of given compliance, solved once a substep (Macklin et al. 2016, "XPBD"; 2019,
//! "Small steps in physics simulation": one pass of many substeps beats many passes of one step, and is stable at any
//! stiffness). The threads of the weave do not stretch: each is solved at once as a chain, a tridiagonal system, because passes
//! over single edges lose to the length of the thread on fine grids. Wind pushes every face by drag and lift. The cloth does not
//! collide with itself.

use super::signal::Wander;
use super::{FRAME_SECONDS, Settings, Subject, SynthesizeError, V3, sequence};
use core::f64::consts::TAU;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_interchange::MeshSequence;

/// Length away from the pole and height, in metres.
const LENGTH: f64 = 1.5;
const HEIGHT: f64 = 1.0;
/// Mass of the cloth, kg/m²: a heavy nylon.
const AREA_DENSITY: f64 = 0.16;
const AIR_DENSITY: f64 = 1.2;
const GRAVITY: f64 = 9.81;
/// Shear stiffness of the weave, N/m.
const SHEAR_STIFFNESS: f64 = 120.0;
/// Bending stiffness per squared cell size, N/m³: rows of bending springs overlap, more of them on finer grids.
const BEND_STIFFNESS: f64 = 900.0;
/// Length of the bending springs, in metres; at least two cells. Fixed, so that folds look alike on every grid.
const BEND_LENGTH: f64 = 0.09;
/// Stiffness against creases from one cell to the next, N/m: fine grids would crumple between the ends of the long springs.
const CREASE_STIFFNESS: f64 = 40.0;
/// Give of a thread, as a share of a vertex' mobility: keeps the chain's system well posed where a fold turns back on itself.
const THREAD_GIVE: f64 = 1e-3;
/// Drag and lift coefficients of a face, and friction along it.
const DRAG: f64 = 1.1;
const LIFT: f64 = 0.5;
const FRICTION: f64 = 0.03;
/// Loss of velocity inside the cloth, 1/s.
const DAMPING: f64 = 0.5;
/// Substeps a frame. Measured: more do not change the stretch of the default flag by half a percent.
const SUBSTEP_COUNT: usize = 24;

/// Synthesizes a flag: V vertices on a grid in the xy-plane, x away from the pole, pinned along x = 0; shape 0 is flat.
///
/// Errors: counts out of range.
pub fn flag(settings: &Settings) -> Result<MeshSequence, SynthesizeError> {
    settings.check(Subject::Flag)?;
    let (columns, rows) = grid_for(settings.vertices);
    let mut cloth = Cloth::flat(columns, rows);
    let wind = Wind::new(settings.seed);
    let mut shapes = vec![cloth.positions.clone()];
    // A fold must not cross a cell in a substep.
    let substep_count = SUBSTEP_COUNT.max(columns / 2);
    let substep = FRAME_SECONDS / substep_count as f64;
    // The wind has blown a long way before the first gust reaches the flag; the integral of its speed carries the waves.
    let mut air = Air {
        time: 0.0,
        travelled: 0.0,
    };
    for _ in 1..settings.frames {
        for _ in 0..substep_count {
            cloth.step(substep, &wind, &air);
            air.travelled += substep * wind.speed(air.time);
            air.time += substep;
        }
        shapes.push(cloth.positions.clone());
    }
    Ok(sequence(Subject::Flag, cloth.faces, &shapes))
}

/// Columns and rows whose product is nearest to `vertex_count`, with cells near to square.
fn grid_for(vertex_count: usize) -> (usize, usize) {
    let ideal = (vertex_count as f64 * HEIGHT / LENGTH).sqrt().round() as usize;
    let rows_range = ideal.saturating_sub(ideal / 16).max(2)..=ideal + ideal / 16;
    rows_range
        .map(|rows| ((vertex_count + rows / 2) / rows, rows))
        .min_by_key(|(columns, rows)| ((columns * rows).abs_diff(vertex_count), rows.abs_diff(ideal)))
        .unwrap_or((2, 2))
}

/// Gusts, a slowly turning direction and waves that travel with the air.
struct Wind {
    gust: Wander,
    heading: Wander,
    lift: Wander,
    /// Wavelength in metres, strength as a share of the speed, slope along y, and phase of each travelling wave.
    waves: [[f64; 4]; 4],
}

/// Where the wind is in time.
struct Air {
    time: f64,
    travelled: f64,
}

impl Wind {
    fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let gust = Wander::new(0.45, &mut rng);
        let heading = Wander::new(0.3, &mut rng);
        let lift = Wander::new(0.35, &mut rng);
        let waves = [[1.7, 0.22], [1.05, 0.2], [0.62, 0.12], [0.41, 0.07]].map(|[length, strength]| {
            [
                length,
                strength,
                1.6 * rng.random::<f64>() - 0.8,
                TAU * rng.random::<f64>(),
            ]
        });
        Self {
            gust,
            heading,
            lift,
            waves,
        }
    }

    /// Metres a second.
    fn speed(&self, t: f64) -> f64 {
        4.6 * (1.0 + 0.4 * self.gust.at(t))
    }

    /// Velocity of the air at `p`.
    fn velocity(&self, p: &V3, air: &Air) -> V3 {
        let speed = self.speed(air.time);
        let heading = 0.35 * self.heading.at(air.time);
        let mut across = 0.0;
        for [length, strength, slope, phase] in self.waves {
            // Eddies near the cloth travel slower than the free stream.
            across += strength * (TAU * (p.x + slope * p.y - 0.6 * air.travelled) / length + phase).sin();
        }
        V3::new(heading.cos(), 0.12 * self.lift.at(air.time), heading.sin() + across) * speed
    }
}

/// A distance constraint.
struct Spring {
    ends: [u32; 2],
    rest: f64,
    /// Metres a newton.
    compliance: f64,
}

/// A thread of the weave: every `stride`-th vertex from `first` on, `link_count` links of one length.
struct Thread {
    first: usize,
    stride: usize,
    link_count: usize,
    rest: f64,
}

struct Cloth {
    faces: Vec<[u32; 3]>,
    springs: Vec<Spring>,
    threads: Vec<Thread>,
    chain: Chain,
    positions: Vec<V3>,
    velocities: Vec<V3>,
    /// 1/kg; 0 for pinned vertices.
    inverse_masses: Vec<f64>,
    forces: Vec<V3>,
    previous: Vec<V3>,
}

impl Cloth {
    fn flat(columns: usize, rows: usize) -> Self {
        let cell = [LENGTH / (columns - 1) as f64, HEIGHT / (rows - 1) as f64];
        let at = |c: usize, r: usize| (r * columns + c) as u32;
        let positions: Vec<V3> = (0..rows * columns)
            .map(|v| V3::new((v % columns) as f64 * cell[0], (v / columns) as f64 * cell[1], 0.0))
            .collect();
        let vertex_mass = AREA_DENSITY * LENGTH * HEIGHT / positions.len() as f64;
        let inverse_masses = (0..positions.len())
            .map(|v| if v % columns == 0 { 0.0 } else { 1.0 / vertex_mass })
            .collect();

        let mut faces = Vec::new();
        let mut springs = Vec::new();
        let mut tie = |from: (usize, usize), to: (usize, usize), compliance: f64| {
            if to.0 < columns && to.1 < rows {
                let ends = [at(from.0, from.1), at(to.0, to.1)];
                let rest = (positions[ends[0] as usize] - positions[ends[1] as usize]).norm();
                springs.push(Spring { ends, rest, compliance });
            }
        };
        let shear = 1.0 / SHEAR_STIFFNESS;
        let bend = 1.0 / (BEND_STIFFNESS * cell[0] * cell[1]);
        let crease = 1.0 / CREASE_STIFFNESS;
        let span = cell.map(|size| ((BEND_LENGTH / size).round() as usize).max(2));
        for r in 0..rows {
            for c in 0..columns {
                tie((c, r), (c + span[0], r), bend);
                tie((c, r), (c, r + span[1]), bend);
                if span != [2, 2] {
                    tie((c, r), (c + 2, r), crease);
                    tie((c, r), (c, r + 2), crease);
                }
                tie((c, r), (c + 1, r + 1), shear);
                if r > 0 && c + 1 < columns {
                    tie((c, r), (c + 1, r - 1), shear);
                }
                if c + 1 < columns && r + 1 < rows {
                    let [a, b, d, e] = [at(c, r), at(c + 1, r), at(c, r + 1), at(c + 1, r + 1)];
                    // Diagonals alternate, so that the weave has no preferred direction.
                    if (c + r) % 2 == 0 {
                        faces.extend([[a, b, e], [a, e, d]]);
                    } else {
                        faces.extend([[a, b, d], [b, e, d]]);
                    }
                }
            }
        }
        // The column along the pole is pinned.
        let warp = (1..columns).map(|c| Thread {
            first: c,
            stride: columns,
            link_count: rows - 1,
            rest: cell[1],
        });
        let weft = (0..rows).map(|r| Thread {
            first: r * columns,
            stride: 1,
            link_count: columns - 1,
            rest: cell[0],
        });
        let threads = warp.chain(weft).collect();
        let rest = vec![V3::zeros(); positions.len()];
        let previous = positions.clone();
        let (velocities, forces) = (rest.clone(), rest);
        Self {
            faces,
            springs,
            threads,
            chain: Chain::default(),
            positions,
            velocities,
            inverse_masses,
            forces,
            previous,
        }
    }

    fn step(&mut self, dt: f64, wind: &Wind, air: &Air) {
        self.blow(wind, air);
        for (v, &inverse_mass) in self.inverse_masses.iter().enumerate() {
            self.previous[v] = self.positions[v];
            if inverse_mass > 0.0 {
                self.velocities[v] += dt * (self.forces[v] * inverse_mass - V3::y() * GRAVITY);
                self.positions[v] += dt * self.velocities[v];
            }
        }
        self.hold(dt);
        let keep = (1.0 - DAMPING * dt) / dt;
        for v in 0..self.positions.len() {
            self.velocities[v] = (self.positions[v] - self.previous[v]) * keep;
        }
    }

    /// Drag along the relative wind and lift across it, a third of each face to each of its corners.
    fn blow(&mut self, wind: &Wind, air: &Air) {
        self.forces.fill(V3::zeros());
        for face in &self.faces {
            let [a, b, c] = face.map(|v| v as usize);
            let [pa, pb, pc] = [self.positions[a], self.positions[b], self.positions[c]];
            let center = (pa + pb + pc) / 3.0;
            let relative =
                wind.velocity(&center, air) - (self.velocities[a] + self.velocities[b] + self.velocities[c]) / 3.0;
            let normal = (pb - pa).cross(&(pc - pa));
            let (speed, doubled_area) = (relative.norm(), normal.norm());
            if speed < 1e-9 || doubled_area < 1e-15 {
                continue;
            }
            let (direction, normal) = (relative / speed, normal / doubled_area);
            let facing = direction.dot(&normal);
            // The side of the face that the wind meets; the air pushes away from it.
            let (away, cosine) = if facing < 0.0 {
                (-normal, -facing)
            } else {
                (normal, facing)
            };
            let push = direction * (DRAG * cosine + FRICTION) + (away - direction * cosine) * (LIFT * cosine);
            let share = push * (0.5 * AIR_DENSITY * speed * speed * 0.5 * doubled_area / 3.0);
            for v in [a, b, c] {
                self.forces[v] += share;
            }
        }
    }

    /// One pass of Gauss-Seidel over the springs, then over the threads: what is solved last holds best.
    fn hold(&mut self, dt: f64) {
        for spring in &self.springs {
            let [a, b] = spring.ends.map(|v| v as usize);
            let weight = self.inverse_masses[a] + self.inverse_masses[b];
            let between = self.positions[b] - self.positions[a];
            let length = between.norm();
            if weight == 0.0 || length < 1e-12 {
                continue;
            }
            let pull = between * ((length - spring.rest) / (length * (weight + spring.compliance / (dt * dt))));
            self.positions[a] += pull * self.inverse_masses[a];
            self.positions[b] -= pull * self.inverse_masses[b];
        }
        for thread in &self.threads {
            self.chain.hold(thread, &mut self.positions, &self.inverse_masses);
        }
    }
}

/// Room for the tridiagonal system of one thread.
#[derive(Default)]
struct Chain {
    directions: Vec<V3>,
    /// Upper diagonal and right-hand side after elimination.
    upper: Vec<f64>,
    pulls: Vec<f64>,
}

impl Chain {
    /// One Newton step for all links of a thread at once: (J W Jᵀ) λ = C, p += W Jᵀ λ, with W the inverse masses.
    fn hold(&mut self, thread: &Thread, positions: &mut [V3], inverse_masses: &[f64]) {
        let at = |i: usize| thread.first + i * thread.stride;
        self.directions.clear();
        self.upper.clear();
        self.pulls.clear();
        for i in 0..thread.link_count {
            let between = positions[at(i + 1)] - positions[at(i)];
            let length = between.norm().max(1e-12);
            let direction = between / length;
            let (near, far) = (inverse_masses[at(i)], inverse_masses[at(i + 1)]);
            let mut diagonal = (near + far) * (1.0 + THREAD_GIVE);
            let mut pull = length - thread.rest;
            if i > 0 {
                let lower = -near * direction.dot(&self.directions[i - 1]);
                diagonal -= lower * self.upper[i - 1];
                pull -= lower * self.pulls[i - 1];
            }
            let next = if i + 1 < thread.link_count {
                let onward = positions[at(i + 2)] - positions[at(i + 1)];
                -far * direction.dot(&onward) / onward.norm().max(1e-12)
            } else {
                0.0
            };
            self.directions.push(direction);
            self.upper.push(next / diagonal);
            self.pulls.push(pull / diagonal);
        }
        for i in (0..thread.link_count).rev() {
            if i + 1 < thread.link_count {
                self.pulls[i] -= self.upper[i] * self.pulls[i + 1];
            }
            let pull = self.directions[i] * self.pulls[i];
            positions[at(i)] += pull * inverse_masses[at(i)];
            positions[at(i + 1)] -= pull * inverse_masses[at(i + 1)];
        }
    }
}
