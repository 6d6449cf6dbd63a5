//! What is unusual about the training shapes, before anything is learned from them: which are left out, and what the user
//! should know of the rest. First stage of a training run.

use rayon::prelude::*;
use sinew_interchange::MeshSequence;

use super::LearnError;
use super::prepare::moves;
use crate::features::align::{RigidMotion, widened};
use crate::mesh::topology::{Topology, is_flat};
use crate::mesh::vector::{difference, length};

/// A shape whose edges are off by less than this share of their length is never taken for broken.
const BROKEN_STRAIN: f64 = 0.9;
/// Nor is one that is off by less than so many times what half of the shapes are.
const BROKEN_TIMES_MEDIAN: f64 = 10.0;
/// A shape of less than this share of the usual size has collapsed.
const COLLAPSED_SIZE: f64 = 0.1;
/// With fewer shapes than this none can be told to be unlike the others.
const JUDGED_SHAPES_MIN: usize = 4;
/// Shapes that a notice names.
const NAMED_MAX: usize = 5;

/// Which shapes to learn from, and what to say.
#[derive(Debug, Clone, PartialEq)]
pub struct Review {
    /// Shapes other than the reference that teach something, ascending.
    pub shapes: Vec<usize>,
    /// Sentences for the user.
    pub notices: Vec<String>,
}

/// Looks at the training shapes of a sequence. Shapes that equal the reference are left out, and those that cannot be of
/// the same subject: their edges are off ten times as much as is usual here, and by nearly their own length, or are a tenth
/// as long as is usual.
/// Errors: no shape besides the reference, a coordinate that is no finite number, nothing that moves.
pub fn review(sequence: &MeshSequence, train_shapes: &[usize], component_count: usize) -> Result<Review, LearnError> {
    let asked: Vec<usize> = train_shapes
        .iter()
        .copied()
        .filter(|&m| m != 0 && m < sequence.shape_count())
        .collect();
    if asked.is_empty() {
        return Err(LearnError::TooFewShapes { found: 0, needed: 1 });
    }
    for &m in [0].iter().chain(&asked) {
        let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite());
        if let Some(vertex) = sequence.shapes[m].iter().position(|p| !finite(p)) {
            let shape = name(sequence, m);
            return Err(LearnError::NotFinite { shape, vertex });
        }
    }
    let rest = widened(&sequence.shapes[0]);
    let topology = Topology::new(&sequence.faces, &rest);
    let mut notices = mesh_notices(&topology);

    let (strains, sizes): (Vec<f64>, Vec<f64>) = edge_measures(sequence, &asked, &topology).into_iter().unzip();
    let (usual_strain, usual_size) = (median(&strains), median(&sizes));
    let broken = |i: &usize| {
        let strained = strains[*i] >= BROKEN_STRAIN && strains[*i] > BROKEN_TIMES_MEDIAN * usual_strain;
        asked.len() >= JUDGED_SHAPES_MIN && (strained || sizes[*i] < COLLAPSED_SIZE * usual_size)
    };
    let (broken, sound): (Vec<usize>, Vec<usize>) = (0..asked.len()).partition(broken);
    if !broken.is_empty() {
        notices.push(format!(
            "left out of training, for edges there are a tenth as long as in the other shapes, or off by ten times as much: {}; look at what is wrong with it, or take it out of the sequence",
            names(sequence, broken.iter().map(|&i| asked[i]))
        ));
    }
    let moved: Vec<bool> = sound
        .par_iter()
        .map(|&i| {
            let shape = widened(&sequence.shapes[asked[i]]);
            let motion = RigidMotion::onto(&rest, &shape);
            let aligned: Vec<[f64; 3]> = shape.into_iter().map(|p| motion.apply(p)).collect();
            moves(&rest, &aligned)
        })
        .collect();
    let (moving, still): (Vec<usize>, Vec<usize>) = (0..sound.len()).partition(|&i| moved[i]);
    let (shapes, still): (Vec<usize>, Vec<usize>) = (
        moving.iter().map(|&i| asked[sound[i]]).collect(),
        still.iter().map(|&i| asked[sound[i]]).collect(),
    );
    if shapes.is_empty() {
        return Err(LearnError::NothingMoves { shapes: asked.len() });
    }
    if !still.is_empty() {
        notices.push(format!(
            "left out of training, for nothing moves there against the reference: {}",
            names(sequence, still.into_iter())
        ));
    }
    notices.extend(flattened_notice(sequence, &shapes, &rest));
    if shapes.len() < component_count {
        notices.push(format!(
            "{component_count} components are asked for and {} shapes teach them: which parts move on their own is then more a \
             guess than seen; components that add nothing are removed, more shapes would help",
            shapes.len()
        ));
    }
    Ok(Review { shapes, notices })
}

/// Of every shape, over the root mean square of edge lengths at rest: that of what edges gain or lose, and that of their
/// lengths.
fn edge_measures(sequence: &MeshSequence, shapes: &[usize], topology: &Topology) -> Vec<(f64, f64)> {
    let rest = widened(&sequence.shapes[0]);
    let mut edges = topology.edges();
    edges.retain(|&[a, b]| !topology.is_bridge(a, b));
    let length_of =
        |positions: &[[f64; 3]], &[a, b]: &[u32; 2]| length(difference(positions[a as usize], positions[b as usize]));
    let total: f64 = edges.iter().map(|edge| length_of(&rest, edge).powi(2)).sum();
    let measures = |&m: &usize| {
        let positions = widened(&sequence.shapes[m]);
        let lengths = edges
            .iter()
            .map(|edge| (length_of(&positions, edge), length_of(&rest, edge)));
        let (off, long) = lengths.fold((0.0, 0.0), |(off, long), (found, rest)| {
            (off + (found - rest).powi(2), long + found * found)
        });
        let share = |sum: f64| (sum / total.max(f64::MIN_POSITIVE)).sqrt();
        (share(off), share(long))
    };
    shapes.par_iter().map(measures).collect()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn mesh_notices(topology: &Topology) -> Vec<String> {
    let findings = &topology.findings;
    let mut notices = Vec::new();
    if findings.piece_count > 1 {
        notices.push(format!(
            "the mesh has {} separate pieces: extra edges tie each to what it moves with in the shapes, so that it follows that",
            findings.piece_count
        ));
    }
    if findings.non_manifold_edge_count > 0 {
        notices.push(format!(
            "edges with more than two faces: {}; all of their faces count",
            findings.non_manifold_edge_count
        ));
    }
    if findings.non_manifold_vertex_count > 0 {
        notices.push(format!(
            "vertices where parts of the surface meet in a point alone: {}; one deformation there serves all parts",
            findings.non_manifold_vertex_count
        ));
    }
    if findings.zero_area_face_count > 0 {
        notices.push(format!(
            "faces without area in the reference: {}; they follow the faces around them",
            findings.zero_area_face_count
        ));
    }
    notices
}

/// Faces that lose their area in some shape but have one at rest.
fn flattened_notice(sequence: &MeshSequence, shapes: &[usize], rest: &[[f64; 3]]) -> Option<String> {
    let faces: Vec<&[u32; 3]> = sequence.faces.iter().filter(|face| !is_flat(face, rest)).collect();
    let flattened: Vec<usize> = shapes
        .par_iter()
        .map(|&m| {
            let positions = widened(&sequence.shapes[m]);
            faces.iter().filter(|face| is_flat(face, &positions)).count()
        })
        .collect();
    let most = flattened.iter().copied().max().filter(|&most| most > 0)?;
    let where_ = shapes
        .iter()
        .zip(&flattened)
        .filter(|(_, count)| **count > 0)
        .map(|(&m, _)| m);
    Some(format!(
        "faces lose their area in some shapes, up to {most} in one: {}; they are learned as they are, squeezed flat",
        names(sequence, where_)
    ))
}

/// The number of a shape and, where it says more, where it comes from.
fn name(sequence: &MeshSequence, m: usize) -> String {
    match sequence.shape_names.get(m) {
        Some(name) => format!("shape {m} ({name})"),
        None => format!("shape {m}"),
    }
}

fn names(sequence: &MeshSequence, shapes: impl Iterator<Item = usize>) -> String {
    let all: Vec<String> = shapes.map(|m| name(sequence, m)).collect();
    match all.len() {
        count if count > NAMED_MAX => format!("{} and {} more", all[..NAMED_MAX].join(", "), count - NAMED_MAX),
        _ => all.join(", "),
    }
}
