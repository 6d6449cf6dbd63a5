//! Point caches: files that hold where the vertices of a mesh go, but not its faces. A mesh file beside them, or named by the user,
//! gives those.

use super::choose::Choice;
use super::error::SequenceError;
use super::folder::{file_name, read_file};
use super::format::{Format, Reading};
use super::mesh::PolygonMesh;
use super::notice::Notice;
use super::open::open_scene;
use super::scene::{ClipEntry, Contents, MeshEntry, Moment, Motion, Scene, Space};
use std::fs;
use std::path::{Path, PathBuf};

/// Points of one mesh over time.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    /// Name of the mesh, where the cache knows it.
    pub(crate) name: String,
    /// V.
    pub(crate) point_count: usize,
}

/// A point cache, open.
pub(crate) trait PointCache {
    /// Meshes that it moves.
    fn channels(&self) -> &[Channel];

    /// Its frames; one clip for all channels.
    fn clip(&self) -> &ClipEntry;

    /// Points of a channel in one frame of the clip into `out`, which has as many as the channel has points.
    fn points(&mut self, channel: usize, frame: usize, out: &mut [[f32; 3]]) -> Result<(), SequenceError>;
}

/// A cache on its mesh.
struct OnMesh {
    cache: Box<dyn PointCache>,
    cache_name: String,
    /// One for each channel that has a mesh, with its number.
    meshes: Vec<(usize, PolygonMesh)>,
    contents: Contents,
    /// Points of a frame to blend with.
    other: Vec<[f32; 3]>,
}

/// Puts a cache on its mesh.
///
/// Errors: `NoSurface`, and whatever is wrong with the mesh file.
pub(crate) fn on_mesh(
    cache: Box<dyn PointCache>,
    format: &'static str,
    path: &Path,
    choice: &Choice,
) -> Result<Box<dyn Scene>, SequenceError> {
    let surface_path = match &choice.surface {
        Some(path) => path.clone(),
        None => beside(path)?,
    };
    let mut surface = Surface::read(&surface_path)?;
    let mut meshes = Vec::new();
    let mut missing = Vec::new();
    for (c, channel) in cache.channels().iter().enumerate() {
        match surface.take(channel, cache.channels().len() == 1)? {
            Some(mesh) => meshes.push((c, mesh)),
            None => missing.push(format!("`{}` ({} points)", channel.name, channel.point_count)),
        }
    }
    if meshes.is_empty() {
        return Err(SequenceError::SurfaceDiffers {
            path: path.into(),
            surface: surface_path,
            channels: missing,
            meshes: surface.described(),
        });
    }
    let entry = |(c, mesh): &(usize, PolygonMesh)| MeshEntry {
        name: cache.channels()[*c].name.clone(),
        vertex_count: mesh.positions.len(),
        face_count: mesh.face_count(),
        joint_count: 0,
        morphs: Vec::new(),
        motion: Motion::Deforms,
    };
    let mut notices = vec![Notice::Remark(format!("faces come from {}", surface_path.display()))];
    if let Some(example) = missing.first() {
        let count = missing.len();
        notices.push(Notice::Remark(format!(
            "{count} channels have no mesh there and were left out: {example}"
        )));
    }
    let contents = Contents {
        format,
        meshes: meshes.iter().map(entry).collect(),
        clips: vec![cache.clip().clone()],
        unit_metres: surface.unit_metres(),
        up: surface.up(),
        notices,
        ..Contents::default()
    };
    Ok(Box::new(OnMesh {
        cache,
        cache_name: file_name(path),
        meshes,
        contents,
        other: Vec::new(),
    }))
}

/// The mesh file beside a cache: one of the same name, or the only one.
fn beside(path: &Path) -> Result<PathBuf, SequenceError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let io = |source| SequenceError::Io {
        path: folder.into(),
        source,
    };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let file = entry.map_err(io)?.path();
        let is_surface = Format::of_path(&file).is_some_and(|format| {
            !matches!(format.reading, Reading::Points(_)) && format.name != super::npy::FORMAT.name
        });
        if is_surface && file.is_file() {
            files.push(file);
        }
    }
    files.sort();
    let same_name = files.iter().position(|file| file.file_stem() == path.file_stem());
    match (same_name, &files[..]) {
        (Some(i), _) => Ok(files.swap_remove(i)),
        (None, [_]) => Ok(files.swap_remove(0)),
        (None, _) => Err(SequenceError::NoSurface {
            path: path.into(),
            candidates: files.iter().map(|file| file_name(file)).collect(),
        }),
    }
}

/// Meshes of a file.
enum Surface {
    Shape(Box<PolygonMesh>),
    Scene(Box<dyn Scene>),
}

impl Surface {
    fn read(path: &Path) -> Result<Surface, SequenceError> {
        let Some(reader) = Format::of_path(path).and_then(Format::shape_reader) else {
            return Ok(Surface::Scene(open_scene(path, &Choice::default())?));
        };
        let bytes = read_file(path)?;
        let mut mesh = (reader.shape)(&bytes, path)?.checked(path)?;
        // What is wrong with its texture is said where the shape itself is the sequence.
        let _ = (reader.dress)(&bytes, path, &mut mesh);
        Ok(Surface::Shape(Box::new(mesh)))
    }

    /// The mesh for a channel: that of its name, or the only one with as many vertices.
    fn take(&mut self, channel: &Channel, is_only: bool) -> Result<Option<PolygonMesh>, SequenceError> {
        match self {
            Surface::Shape(mesh) => {
                let fits = is_only && mesh.positions.len() == channel.point_count;
                Ok(fits.then(|| (**mesh).clone()))
            }
            Surface::Scene(scene) => {
                let entries = scene.contents().meshes.iter().enumerate();
                let fitting: Vec<usize> = entries
                    .filter(|(_, mesh)| mesh.vertex_count == channel.point_count)
                    .map(|(i, _)| i)
                    .collect();
                let named = fitting.iter().copied().find(|&i| {
                    let name = &scene.contents().meshes[i].name;
                    name == &channel.name || name.ends_with(&format!("/{}", channel.name))
                });
                match (named, &fitting[..]) {
                    (Some(mesh), _) | (None, &[mesh]) => scene.geometry(mesh).map(Some),
                    _ => Ok(None),
                }
            }
        }
    }

    fn described(&self) -> Vec<String> {
        match self {
            Surface::Shape(mesh) => vec![format!("{} vertices", mesh.positions.len())],
            Surface::Scene(scene) => {
                let described = |mesh: &MeshEntry| format!("`{}` ({} vertices)", mesh.name, mesh.vertex_count);
                scene.contents().meshes.iter().map(described).collect()
            }
        }
    }

    fn unit_metres(&self) -> Option<f64> {
        match self {
            Surface::Shape(_) => None,
            Surface::Scene(scene) => scene.contents().unit_metres,
        }
    }

    fn up(&self) -> Option<super::scene::UpAxis> {
        match self {
            Surface::Shape(_) => None,
            Surface::Scene(scene) => scene.contents().up,
        }
    }
}

/// The frames around a time, and how far it lies towards the second.
pub(crate) fn around(times: &[f64], time: f64) -> (usize, usize, f64) {
    around_by(times.len(), |n| times[n], time)
}

/// The same for times that a function gives, ascending; there is at least one.
pub(crate) fn around_by(count: usize, time_of: impl Fn(usize) -> f64, time: f64) -> (usize, usize, f64) {
    let (mut next, mut end) = (0, count);
    while next < end {
        let middle = next.midpoint(end);
        if time_of(middle) < time {
            next = middle + 1;
        } else {
            end = middle;
        }
    }
    let next = next.min(count - 1);
    if next == 0 || time_of(next) <= time {
        return (next, next, 0.0);
    }
    let (before, behind) = (time_of(next - 1), time_of(next));
    (next - 1, next, (time - before) / (behind - before))
}

/// Moves `from` towards `to` by a share.
pub(crate) fn blend(from: &mut [[f32; 3]], to: &[[f32; 3]], share: f64) {
    for (a, b) in from.iter_mut().zip(to) {
        for c in 0..3 {
            a[c] = (f64::from(a[c]) + share * (f64::from(b[c]) - f64::from(a[c]))) as f32;
        }
    }
}

impl Scene for OnMesh {
    fn contents(&self) -> &Contents {
        &self.contents
    }

    fn geometry(&mut self, mesh: usize) -> Result<PolygonMesh, SequenceError> {
        Ok(self.meshes[mesh].1.clone())
    }

    fn positions(
        &mut self,
        mesh: usize,
        moment: Moment,
        _: Space,
        out: &mut Vec<[f32; 3]>,
    ) -> Result<(), SequenceError> {
        let (channel, surface) = &self.meshes[mesh];
        out.clear();
        let Moment::At { time, .. } = moment else {
            out.extend_from_slice(&surface.positions);
            return Ok(());
        };
        let (before, behind, share) = around(&self.cache.clip().times, time);
        out.resize(surface.positions.len(), [0.0; 3]);
        self.cache.points(*channel, before, out)?;
        if share > 0.0 {
            self.other.resize(out.len(), [0.0; 3]);
            self.cache.points(*channel, behind, &mut self.other)?;
            blend(out, &self.other, share);
        }
        Ok(())
    }

    fn frame_name(&self, _: usize, frame: usize) -> String {
        format!("{}[{frame}]", self.cache_name)
    }
}

/// Three numbers a point off raw bytes.
pub(crate) fn points_from<const N: usize>(raw: &[u8], of: impl Fn([u8; N]) -> f32, out: &mut [[f32; 3]]) {
    for (place, bytes) in out.as_flattened_mut().iter_mut().zip(raw.as_chunks::<N>().0) {
        *place = of(*bytes);
    }
}
