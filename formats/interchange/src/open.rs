//! A sequence, open: what was chosen of a file, ready to give its frames one by one, in any order, so that a sequence larger than
//! memory passes through.

use super::choose::{Choice, Plan, plan};
use super::error::SequenceError;
use super::format::{Format, Reading};
use super::mesh::{Dress, PolygonMesh};
use super::notice::Notice;
use super::order::{EdgeOrder, diagonal};
use super::scene::{ClipEntry, Contents, MeshEntry, Moment, Scene};
use super::sequence::RenderSurface;
use super::surface::{Surface, join};
use super::weld::weld;
use super::{folder, npy, still};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What was chosen of a file, ready to give its frames.
pub struct OpenSequence {
    path: PathBuf,
    scene: Box<dyn Scene>,
    plan: Plan,
    choice: Choice,
    surface: Surface,
    order: EdgeOrder,
    names: Vec<String>,
    /// Vertices of each chosen mesh, as the file has it.
    counts: Vec<usize>,
    /// Positions of all chosen meshes, as the file has them, and of one of them.
    joined: Vec<[f32; 3]>,
    single: Vec<[f32; 3]>,
}

/// What a file (or a folder of shapes) holds.
///
/// Errors: see [`SequenceError`]; nothing is changed on disk.
pub fn read_contents(path: &Path, choice: &Choice) -> Result<Contents, SequenceError> {
    Ok(open_scene(path, choice)?.contents().clone())
}

/// Opens whatever lies at the path, by the table of formats.
pub(crate) fn open_scene(path: &Path, choice: &Choice) -> Result<Box<dyn Scene>, SequenceError> {
    let metadata = fs::metadata(path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => SequenceError::NoSuchPath { path: path.into() },
        _ => SequenceError::Io {
            path: path.into(),
            source,
        },
    })?;
    if metadata.is_dir() {
        let positions = path.join("positions.npy");
        return if positions.is_file() {
            npy::open(&positions, Some(path))
        } else {
            folder::open(path)
        };
    }
    let Some(format) = Format::of_path(path) else {
        return Err(SequenceError::UnknownKind { path: path.into() });
    };
    match format.reading {
        Reading::Scene(open) | Reading::Points(open) => open(path, choice),
        Reading::Shape(reader) => still::open(path, format.name, reader),
    }
}

impl OpenSequence {
    /// Opens a file or folder and finds what is wanted of it. Where no clip moves anything, its one frame is the mesh at rest.
    ///
    /// Errors: see [`SequenceError`]; nothing is changed on disk.
    pub fn open(path: &Path, choice: &Choice) -> Result<OpenSequence, SequenceError> {
        let mut scene = open_scene(path, choice)?;
        let mut plan = plan(scene.contents(), choice, path)?;
        if plan.moments.is_empty() {
            plan.moments.push((Moment::Rest, None));
        }
        let mut notices = scene.contents().notices.clone();
        if !plan.left_out.is_empty() {
            let (count, example) = (plan.left_out.len(), plan.left_out[0].clone());
            notices.push(Notice::MeshesLeftOut { count, example });
        }
        let geometry = plan.meshes.iter().map(|&mesh| scene.geometry(mesh)?.checked(path));
        let geometry = geometry.collect::<Result<Vec<_>, _>>()?;
        let name_of = |(_, frame): &(Moment, Option<usize>)| match (frame, plan.clip) {
            (Some(frame), Some(clip)) => scene.frame_name(clip, *frame),
            _ => "rest".to_string(),
        };
        let names = plan.moments.iter().map(name_of).collect();
        let mut sequence = OpenSequence {
            path: path.into(),
            scene,
            plan,
            choice: choice.clone(),
            surface: Surface::default(),
            order: EdgeOrder::default(),
            names,
            counts: geometry.iter().map(|mesh| mesh.positions.len()).collect(),
            joined: Vec::new(),
            single: Vec::new(),
        };
        sequence.build(geometry, notices)?;
        Ok(sequence)
    }

    /// Finds what stays the same in every frame, and how edges look in the reference.
    fn build(&mut self, pieces: Vec<PolygonMesh>, mut notices: Vec<Notice>) -> Result<(), SequenceError> {
        let mut mesh = join(pieces);
        PolygonMesh::check_vertex_count(mesh.positions.len(), &self.path)?;
        let welded = if mesh.is_split && !self.choice.keep_split {
            let rest = core::mem::take(&mut mesh.positions);
            let frames = self.plan.moments.len();
            let welded = weld(self.counts.clone().into_iter(), &rest, frames, |n, out| {
                self.gather(n, out)
            })?;
            mesh.positions = rest;
            welded
        } else {
            None
        };
        // Polygons are split by the geometry of the reference.
        let mut reference = core::mem::take(&mut self.joined);
        self.gather(0, &mut reference)?;
        mesh.positions = reference;
        self.surface = Surface::new(&mesh, welded.as_deref(), &self.path)?;
        self.joined = mesh.positions;
        if welded.is_some() {
            let (from, to) = (self.joined.len(), self.surface.vertices.len());
            notices.push(Notice::SeamsWelded { from, to });
        }
        notices.append(&mut self.surface.notices);
        self.surface.notices = notices;
        let reference: Vec<[f32; 3]> = self.surface.vertices.iter().map(|&v| self.joined[v as usize]).collect();
        check_reference(&self.path, &self.names[0], &self.surface.faces, &reference)?;
        self.order = EdgeOrder::new(&self.surface.faces, &reference);
        self.note_odd_vertices(&reference);
        Ok(())
    }

    /// Positions of frame `n` of all chosen meshes, as the file has them; all finite.
    fn gather(&mut self, n: usize, out: &mut Vec<[f32; 3]>) -> Result<(), SequenceError> {
        let (moment, _) = self.plan.moments[n];
        out.clear();
        for (&mesh, &expected) in self.plan.meshes.iter().zip(&self.counts) {
            self.scene
                .positions(mesh, moment, self.choice.space, &mut self.single)?;
            if self.single.len() != expected {
                return Err(SequenceError::VertexCountVaries {
                    path: self.path.clone(),
                    mesh: self.scene.contents().meshes[mesh].name.clone(),
                    frame: self.names[n].clone(),
                    expected,
                    found: self.single.len(),
                });
            }
            let stray = self.single.iter().position(|p| !p.iter().all(|x| x.is_finite()));
            if let Some(vertex) = stray {
                let [x, y, z] = self.single[vertex];
                return Err(SequenceError::NonFiniteVertex {
                    path: self.path.clone(),
                    mesh: self.scene.contents().meshes[mesh].name.clone(),
                    frame: self.names[n].clone(),
                    vertex,
                    found: format!("({x}, {y}, {z})"),
                });
            }
            out.extend_from_slice(&self.single);
        }
        Ok(())
    }

    /// Positions of frame `n`, the reference being frame 0, into `out` of V vertices.
    ///
    /// Errors: damage of the file, `NonFinite`, `NonFiniteVertex`, `VertexOrderDiffers`. Panics past the last frame.
    pub fn frame(&mut self, n: usize, out: &mut [[f32; 3]]) -> Result<(), SequenceError> {
        let mut joined = core::mem::take(&mut self.joined);
        let gathered = self.gather(n, &mut joined);
        self.joined = joined;
        gathered?;
        for (place, &v) in out.iter_mut().zip(&self.surface.vertices) {
            *place = self.joined[v as usize];
        }
        if n > 0
            && let Some(torn) = self.order.check(out)
        {
            return Err(self.order.refusal(torn, &self.path, n, &self.names));
        }
        Ok(())
    }

    /// N.
    pub fn frame_count(&self) -> usize {
        self.names.len()
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.surface.vertices.len()
    }

    /// Triangles. Shape: `[F]`.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.surface.faces
    }

    /// What an engine draws.
    pub fn render(&self) -> Option<&RenderSurface> {
        self.surface.render.as_ref()
    }

    /// Materials by triangles, colours and skin by vertices.
    pub fn dress(&self) -> &Dress {
        &self.surface.dress
    }

    /// What each frame is called in messages. Shape: `[N]`.
    pub fn frame_names(&self) -> &[String] {
        &self.names
    }

    /// Frames a second, where the file says so or the user did.
    pub fn fps(&self) -> Option<f64> {
        self.plan.fps
    }

    /// What the file holds besides.
    pub fn contents(&self) -> &Contents {
        self.scene.contents()
    }

    /// The chosen meshes.
    pub fn meshes(&self) -> impl Iterator<Item = &MeshEntry> {
        self.plan.meshes.iter().map(|&mesh| &self.scene.contents().meshes[mesh])
    }

    /// The chosen clip.
    pub fn clip(&self) -> Option<&ClipEntry> {
        self.plan.clip.map(|clip| &self.scene.contents().clips[clip])
    }

    /// What was handled without refusing, for the user to know; in a fixed order.
    pub fn notices(&self) -> &[Notice] {
        &self.surface.notices
    }

    /// Name of the sequence: the last part of its path.
    pub fn name(&self) -> String {
        // `.` and `..` have no last part of their own.
        let named = if self.path.file_name().is_some() {
            self.path.clone()
        } else {
            fs::canonicalize(&self.path).unwrap_or_default()
        };
        let is_array = named
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
        let parent = named.parent().filter(|parent| is_array && parent.file_name().is_some());
        folder::file_name(parent.unwrap_or(&named))
    }

    /// Counts isolated and duplicate vertices of the reference.
    fn note_odd_vertices(&mut self, reference: &[[f32; 3]]) {
        let mut used = vec![false; reference.len()];
        self.surface
            .faces
            .iter()
            .flatten()
            .for_each(|&v| used[v as usize] = true);
        let isolated = used.iter().filter(|used| !**used).count();
        if let Some(first) = used.iter().position(|used| !used) {
            self.surface
                .notices
                .push(Notice::IsolatedVertices { count: isolated, first });
        }
        // Adding zero makes -0 and 0 one.
        let key = |v: &u32| reference[*v as usize].map(|x| (x + 0.0).to_bits());
        let mut by_position: Vec<u32> = (0..reference.len() as u32).collect();
        by_position.sort_unstable_by_key(|v| (key(v), *v));
        let duplicates = by_position
            .windows(2)
            .filter(|pair| key(&pair[0]) == key(&pair[1]))
            .map(|pair| pair[1]);
        let (count, first) = duplicates.fold((0, u32::MAX), |(count, first), v| (count + 1, first.min(v)));
        if count > 0 {
            let first = first as usize;
            self.surface.notices.push(Notice::DuplicateVertices { count, first });
        }
    }
}

/// Refuses a reference without area.
fn check_reference(path: &Path, name: &str, faces: &[[u32; 3]], positions: &[[f32; 3]]) -> Result<(), SequenceError> {
    let area2 = faces.iter().map(|face| {
        let [a, b, c] = face.map(|v| positions[v as usize].map(f64::from));
        let (u, w) = (
            [b[0] - a[0], b[1] - a[1], b[2] - a[2]],
            [c[0] - a[0], c[1] - a[1], c[2] - a[2]],
        );
        let normal = [
            u[1] * w[2] - u[2] * w[1],
            u[2] * w[0] - u[0] * w[2],
            u[0] * w[1] - u[1] * w[0],
        ];
        normal.iter().map(|n| n * n).sum::<f64>().sqrt()
    });
    // Beside the mesh's own size: tiny units are no zero, and what rounding leaves of a line is one.
    let has_area = area2.sum::<f64>() > f64::from(f32::EPSILON) * diagonal(positions).powi(2);
    if has_area {
        Ok(())
    } else {
        Err(SequenceError::ZeroArea {
            path: path.to_path_buf(),
            reference: name.into(),
        })
    }
}
