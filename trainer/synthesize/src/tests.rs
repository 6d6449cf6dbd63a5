//! What every synthesized sequence promises.

use super::*;
use std::collections::BTreeMap;

fn small(subject: Subject) -> Settings {
    Settings {
        vertices: 900,
        ..subject.default_settings()
    }
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3)
        .map(|c| f64::from(a[c] - b[c]))
        .map(|d| d * d)
        .sum::<f64>()
        .sqrt()
}

/// Faces on each side of every undirected edge.
fn edge_faces(faces: &[[u32; 3]]) -> BTreeMap<[u32; 2], u32> {
    let mut edges = BTreeMap::new();
    for &[a, b, c] in faces {
        for [i, j] in [[a, b], [b, c], [c, a]] {
            *edges.entry([i.min(j), i.max(j)]).or_insert(0) += 1;
        }
    }
    edges
}

fn piece_count(vertex_count: usize, faces: &[[u32; 3]]) -> usize {
    let mut root: Vec<usize> = (0..vertex_count).collect();
    fn find(root: &mut [usize], v: usize) -> usize {
        let mut v = v;
        while root[v] != v {
            root[v] = root[root[v]];
            v = root[v];
        }
        v
    }
    for face in faces {
        for pair in face.windows(2) {
            let (a, b) = (find(&mut root, pair[0] as usize), find(&mut root, pair[1] as usize));
            root[a] = b;
        }
    }
    (0..vertex_count).filter(|&v| find(&mut root, v) == v).count()
}

fn volume(faces: &[[u32; 3]], shape: &[[f32; 3]]) -> f64 {
    let at = |v: u32| V3::from_fn(|c, _| f64::from(shape[v as usize][c]));
    faces
        .iter()
        .map(|&[a, b, c]| at(a).dot(&at(b).cross(&at(c))) / 6.0)
        .sum()
}

#[test]
fn counts_and_numbers_are_sound() {
    for subject in Subject::ALL {
        let settings = small(subject);
        let sequence = subject.synthesize(&settings).unwrap();
        assert_eq!(sequence.shape_count(), settings.frames);
        assert_eq!(sequence.shape_names.len(), settings.frames);
        let vertex_count = sequence.vertex_count();
        let off = vertex_count.abs_diff(settings.vertices) as f64 / settings.vertices as f64;
        assert!(off < 0.03, "{}: {vertex_count} vertices", subject.name());
        assert!(sequence.shapes.iter().all(|shape| shape.len() == vertex_count));
        assert!(
            sequence.shapes.iter().flatten().flatten().all(|x| x.is_finite()),
            "{}",
            subject.name()
        );
        assert!(sequence.faces.iter().flatten().all(|&v| (v as usize) < vertex_count));
        assert_eq!(piece_count(vertex_count, &sequence.faces), 1, "{}", subject.name());
        let corner = |pick: fn(f32, f32) -> f32, start: f32| {
            core::array::from_fn(|c| sequence.shapes[0].iter().map(|p| p[c]).fold(start, pick))
        };
        let diagonal = distance(corner(f32::max, f32::MIN), corner(f32::min, f32::MAX));
        for (m, (shape, next)) in sequence.shapes.iter().zip(sequence.shapes.iter().skip(1)).enumerate() {
            let moved = shape
                .iter()
                .zip(next)
                .map(|(a, b)| distance(*a, *b))
                .fold(0.0, f64::max);
            // A hundredth of a millimetre a frame is standing still.
            assert!(moved > 1e-5, "{}: shapes {m} and {} are equal", subject.name(), m + 1);
            // A fifth of the diagonal in a thirtieth of a second would be a jump, not a motion.
            assert!(
                moved < diagonal / 5.0,
                "{}: a vertex jumps by {moved} m after shape {m}",
                subject.name()
            );
        }
    }
}

#[test]
fn same_settings_same_bits_and_another_seed_another_motion() {
    for subject in Subject::ALL {
        let settings = Settings {
            frames: 6,
            ..small(subject)
        };
        let first = subject.synthesize(&settings).unwrap();
        assert_eq!(first, subject.synthesize(&settings).unwrap(), "{}", subject.name());
        let other = subject.synthesize(&Settings { seed: 7, ..settings }).unwrap();
        assert_eq!(first.shapes[0], other.shapes[0]);
        assert_ne!(first.shapes[5], other.shapes[5], "{}", subject.name());
    }
}

#[test]
fn bar_and_creature_are_closed_and_face_outwards() {
    for subject in [Subject::Bar, Subject::Creature] {
        for vertices in [*subject.vertex_range().start(), 1000, 2500, 4100] {
            let sequence = subject
                .synthesize(&Settings {
                    frames: 2,
                    vertices,
                    seed: 0,
                })
                .unwrap();
            let edges = edge_faces(&sequence.faces);
            assert!(
                edges.values().all(|&faces| faces == 2),
                "{} of {vertices}",
                subject.name()
            );
            // A sphere: V - E + F = 2.
            assert_eq!(sequence.vertex_count() + sequence.faces.len(), edges.len() + 2);
            assert!(
                volume(&sequence.faces, &sequence.shapes[0]) > 0.1,
                "{} of {vertices}",
                subject.name()
            );
            let off = sequence.vertex_count().abs_diff(vertices) as f64 / vertices as f64;
            assert!(
                off < 0.05,
                "{} of {vertices}: {}",
                subject.name(),
                sequence.vertex_count()
            );
        }
    }
}

#[test]
fn cloth_keeps_its_length_and_its_pole() {
    // A few frames into the wind, on a coarse, a middling and a fine grid.
    for (vertices, frames) in [(100, 60), (1600, 60), (6000, 12)] {
        let flag = flag(&Settings {
            frames,
            vertices,
            seed: 1,
        })
        .unwrap();
        let edges = edge_faces(&flag.faces);
        let rest = &flag.shapes[0];
        for (m, shape) in flag.shapes.iter().enumerate().skip(4) {
            let mut threads = Vec::new();
            let mut diagonals = Vec::new();
            for (i, j) in edges.keys().map(|&[i, j]| (i as usize, j as usize)) {
                let stretch = (distance(shape[i], shape[j]) / distance(rest[i], rest[j]) - 1.0).abs();
                let along_thread = rest[i][0] == rest[j][0] || rest[i][1] == rest[j][1];
                if along_thread {
                    threads.push(stretch)
                } else {
                    diagonals.push(stretch)
                }
            }
            // Threads do not stretch (measured: 0.1 %); across the weave cloth gives a few per cent.
            for (kind, stretches, most) in [("threads", &mut threads, 0.005), ("diagonals", &mut diagonals, 0.04)] {
                stretches.sort_by(f64::total_cmp);
                let stretch = stretches[stretches.len() * 95 / 100];
                assert!(
                    stretch < most,
                    "{vertices} vertices, shape {m}: 95 % of the {kind} within {stretch}"
                );
            }
        }
        let pinned = rest.iter().enumerate().filter(|(_, p)| p[0] == 0.0).map(|(v, _)| v);
        for v in pinned {
            assert!(
                flag.shapes.iter().all(|shape| shape[v] == rest[v]),
                "vertex {v} left the pole"
            );
        }
    }
}

#[test]
fn bar_twists_past_half_a_turn_and_bends() {
    let bar = bar(&Subject::Bar.default_settings()).unwrap();
    // Two opposite vertices of the top turn about it by the full twist.
    let top = bar.shapes[0].iter().map(|p| p[1]).fold(0.0, f32::max);
    let corner = |sign: f32| {
        let reach = |v: &usize| sign * (bar.shapes[0][*v][0] + bar.shapes[0][*v][2]) + 4.0 * bar.shapes[0][*v][1];
        (0..bar.vertex_count())
            .max_by(|a, b| reach(a).total_cmp(&reach(b)))
            .unwrap()
    };
    let (a, b) = (corner(1.0), corner(-1.0));
    let (mut angle, mut widest, mut lean) = (0.0f64, 0.0f64, 0.0f64);
    let heading = |shape: &[[f32; 3]]| f64::from(shape[a][2] - shape[b][2]).atan2(f64::from(shape[a][0] - shape[b][0]));
    for (shape, next) in bar.shapes.iter().zip(bar.shapes.iter().skip(1)) {
        let step = heading(next) - heading(shape);
        angle += step.sin().atan2(step.cos());
        widest = widest.max(angle.abs());
        lean = lean.max(f64::from(next[a][0].hypot(next[a][2])));
    }
    assert!(
        widest > core::f64::consts::PI,
        "the head turned by {widest} radians at most"
    );
    assert!(lean > 0.25 * f64::from(top), "the head leaned by {lean} at most");
}

#[test]
fn creature_keeps_its_volume_and_its_feet_on_the_ground() {
    let creature = creature(&Subject::Creature.default_settings()).unwrap();
    let at_rest = volume(&creature.faces, &creature.shapes[0]);
    for (m, shape) in creature.shapes.iter().enumerate() {
        let ratio = volume(&creature.faces, shape) / at_rest;
        // Linear blend skinning loses a little at bent joints.
        assert!((0.95..1.05).contains(&ratio), "shape {m}: {ratio} of its volume");
        let lowest = shape.iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
        assert!((-0.06..0.05).contains(&lowest), "shape {m}: lowest point at {lowest} m");
    }
}

#[test]
fn no_gait_cycle_repeats() {
    let creature = creature(&Settings {
        frames: 120,
        vertices: 900,
        seed: 3,
    })
    .unwrap();
    for (m, shape) in creature.shapes.iter().enumerate() {
        for (n, earlier) in creature.shapes.iter().take(m).enumerate() {
            let apart = shape
                .iter()
                .zip(earlier)
                .map(|(a, b)| distance(*a, *b))
                .fold(0.0, f64::max);
            assert!(apart > 5e-3, "shapes {n} and {m} are within {apart} m");
        }
    }
}

#[test]
fn counts_out_of_range_are_refused() {
    for subject in Subject::ALL {
        let settings = subject.default_settings();
        let (least, most) = (*subject.vertex_range().start(), *subject.vertex_range().end());
        for vertices in [0, least - 1, most + 1] {
            let refused = subject.synthesize(&Settings { vertices, ..settings });
            assert!(matches!(refused, Err(SynthesizeError::VertexCount { .. })));
        }
        for frames in [0, 1, *FRAME_RANGE.end() + 1] {
            let refused = subject.synthesize(&Settings { frames, ..settings });
            assert!(matches!(refused, Err(SynthesizeError::FrameCount { .. })));
        }
    }
}
