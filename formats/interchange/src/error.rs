//! Why a sequence is refused: one variant a reason, each naming the file, the place in it, and what to do.

use core::fmt;
use std::io;
use std::path::PathBuf;

/// A place inside a file, for messages. Lines count from 1 as editors do; shapes, vertices, faces and bytes from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A line of a text file.
    Line(usize),
    /// A byte offset in a binary file.
    Byte(usize),
    /// A vertex.
    Vertex(usize),
    /// A face.
    Face(usize),
    /// A vertex of one shape of an array of shapes.
    ShapeVertex {
        /// Index of the shape.
        shape: usize,
        /// Index of the vertex.
        vertex: usize,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line(line) => write!(f, "line {line}"),
            Place::Byte(byte) => write!(f, "byte {byte}"),
            Place::Vertex(v) => write!(f, "vertex {v}"),
            Place::Face(face) => write!(f, "face {face}"),
            Place::ShapeVertex { shape, vertex } => write!(f, "shape {shape}, vertex {vertex}"),
        }
    }
}

/// Why a sequence is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SequenceError {
    /// Nothing lies at the path.
    #[error("{}: no such file or folder; give a folder of OBJ, PLY or OFF files, or a positions.npy", path.display())]
    NoSuchPath {
        /// The path that was asked for.
        path: PathBuf,
    },
    /// The operating system refused to list or read.
    #[error("{}: cannot be read ({source}); check its permissions and the disk", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The folder holds no mesh file and no positions.npy.
    #[error(
        "{}: no shapes in this folder; it needs OBJ, PLY or OFF files, one a shape, or positions.npy and faces.npy{}",
        path.display(),
        nearby.as_ref().map(|folder| format!("; did you mean {}?", folder.display())).unwrap_or_default()
    )]
    EmptyFolder {
        /// The folder.
        path: PathBuf,
        /// A folder inside it that does hold shapes.
        nearby: Option<PathBuf>,
    },
    /// The folder holds mesh files of two kinds.
    #[error(
        "{}: holds both {first} and {second} files (`{first_file}`, `{second_file}`); keep one kind in the folder",
        path.display()
    )]
    MixedKinds {
        /// The folder.
        path: PathBuf,
        /// The first kind.
        first: &'static str,
        /// A file of the first kind.
        first_file: String,
        /// The second kind.
        second: &'static str,
        /// A file of the second kind.
        second_file: String,
    },
    /// The path is a file of a kind that is not read here.
    #[error(
        "{}: not a sequence; give a folder of OBJ, PLY or OFF files, a positions.npy with faces.npy beside it, or one of {}",
        path.display(), super::format::scene_endings()
    )]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// Only one shape: nothing moves, so nothing can be learned.
    #[error(
        "{}: one shape only; a sequence needs the reference and at least one deformed shape, so give the folder \
         that holds all of them, or a file in which the mesh moves",
        path.display()
    )]
    OneShapeOnly {
        /// The file or folder.
        path: PathBuf,
    },
    /// positions.npy without faces.npy.
    #[error("{}: faces.npy is missing beside positions.npy; write the triangles as an integer array [F][3]", path.display())]
    MissingFaces {
        /// Where faces.npy was looked for.
        path: PathBuf,
    },
    /// The file does not follow its format.
    #[error("{}: {place}: expected {expected}, found {found}; export the file again or mend this place", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: Place,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A coordinate is NaN, infinite, or too large for a 32-bit float.
    #[error("{}: {place}: coordinate `{found}` is not a finite 32-bit number; mend or drop this shape", path.display())]
    NonFinite {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: Place,
        /// The coordinate as it stands in the file.
        found: String,
    },
    /// A face names a vertex that does not exist.
    #[error("{}: {place}: vertex index {index} is out of range, the shape has {vertex_count} vertices; export it again", path.display())]
    IndexOutOfRange {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: Place,
        /// The index as the file writes it (OBJ counts from 1, or from the end when negative; the others from 0).
        index: i64,
        /// V.
        vertex_count: usize,
    },
    /// A coordinate of a frame is NaN or infinite.
    #[error("{}: {frame}: vertex {vertex} of mesh `{mesh}` is at {found}, which is no place; leave the frame out or mend it", path.display())]
    NonFiniteVertex {
        /// The file.
        path: PathBuf,
        /// Name of the mesh.
        mesh: String,
        /// What the frame is called.
        frame: String,
        /// Index of the vertex in the mesh.
        vertex: usize,
        /// Where it is.
        found: String,
    },
    /// A frame has another number of vertices than the mesh.
    #[error(
        "{}: {frame}: mesh `{mesh}` has {found} vertices, but {expected} elsewhere; its vertices must stay the same while it \
         moves, so export it with constant topology, or choose other frames with --frames",
        path.display()
    )]
    VertexCountVaries {
        /// The file.
        path: PathBuf,
        /// Name of the mesh.
        mesh: String,
        /// What the frame is called.
        frame: String,
        /// V of the mesh.
        expected: usize,
        /// V of the frame.
        found: usize,
    },
    /// The file's meshes, or clips, are several, or none of them is called as asked.
    #[error(
        "{}: {}; its {what} are {}; choose with {option}",
        path.display(),
        wanted.as_ref().map_or_else(|| format!("several {what}"), |wanted| format!("no {what} or several called `{wanted}`")),
        listed(names)
    )]
    Choose {
        /// The file.
        path: PathBuf,
        /// What there is to choose: `meshes` or `clips`.
        what: &'static str,
        /// The option that chooses.
        option: &'static str,
        /// What was asked for.
        wanted: Option<String>,
        /// What there is.
        names: Vec<String>,
    },
    /// The file holds no mesh.
    #[error("{}: holds no mesh{}; export the surface itself", path.display(), others_listed(others))]
    NoMesh {
        /// The file.
        path: PathBuf,
        /// What it holds instead, by kind and count.
        others: Vec<(String, usize)>,
    },
    /// A frame that the clip has not got.
    #[error("{}: there is no frame {frame}: the clip has {frame_count} frames, counted from 0", path.display())]
    FramesOutOfRange {
        /// The file.
        path: PathBuf,
        /// The frame that was asked for.
        frame: usize,
        /// How many there are.
        frame_count: usize,
    },
    /// A rate was asked for, but the frames have no times.
    #[error("{}: the frames of `{clip}` have no times, so --fps cannot sample them anew; choose frames with --frames", path.display())]
    NoTimes {
        /// The file.
        path: PathBuf,
        /// The clip.
        clip: String,
    },
    /// A rate at which nothing can be sampled.
    #[error("{}: cannot be sampled at {rate} frames a second; --fps wants a positive number, such as 24", path.display())]
    NoSuchRate {
        /// The file.
        path: PathBuf,
        /// The rate.
        rate: f64,
    },
    /// A point cache without the mesh that it moves.
    #[error(
        "{}: holds points without faces; name the mesh that it moves with --surface FILE{}",
        path.display(),
        if candidates.is_empty() { String::new() } else { format!(" (beside it lie {})", listed(candidates)) }
    )]
    NoSurface {
        /// The cache.
        path: PathBuf,
        /// Mesh files beside it.
        candidates: Vec<String>,
    },
    /// No mesh of the file has as many vertices as the cache has points.
    #[error(
        "{}: moves {}, but {} has {}; give the mesh that the cache was made of, with its vertices in their order",
        path.display(), listed(channels), surface.display(), listed(meshes)
    )]
    SurfaceDiffers {
        /// The cache.
        path: PathBuf,
        /// The mesh file.
        surface: PathBuf,
        /// What the cache moves.
        channels: Vec<String>,
        /// What the mesh file has.
        meshes: Vec<String>,
    },
    /// The file is of a kind that is known and not read.
    #[error("{}: is {what} which is not read; {advice}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it is, or holds.
        what: String,
        /// What to do.
        advice: String,
    },
    /// Something in the file cannot be.
    #[error("{}: expected {expected}, found {found}; export it again", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What should be there.
        expected: String,
        /// What is there.
        found: String,
    },
    /// Something about one mesh of the file cannot be.
    #[error("{}: mesh `{mesh}`: expected {expected}, found {found}; export it again", path.display())]
    BadMesh {
        /// The file.
        path: PathBuf,
        /// Name of the mesh.
        mesh: String,
        /// What should be there.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The faces of a mesh change while it moves.
    #[error(
        "{}: the faces of mesh `{mesh}` change at {time} s; a sequence needs the same faces throughout, so export it with constant \
         topology, or choose other frames with --frames",
        path.display()
    )]
    TopologyVaries {
        /// The file.
        path: PathBuf,
        /// Name of the mesh.
        mesh: String,
        /// When, in seconds.
        time: f64,
    },
    /// No room for the positions.
    #[error(
        "{}: no room for its positions ({source}); they go to a file without a name in {} once they are many, and TMPDIR \
         names another folder",
        path.display(), std::env::temp_dir().display()
    )]
    NoRoom {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// No faces: a point cloud.
    #[error("{}: has no faces with three or more corners; Sinew needs a surface, so export the mesh with its faces", path.display())]
    NoFaces {
        /// The file.
        path: PathBuf,
    },
    /// More vertices or triangles than a 32-bit index can count.
    #[error("{}: {count} {what} are more than the 2^32 - 1 that can be indexed; reduce the mesh", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// How many there are.
        count: usize,
        /// Of what.
        what: &'static str,
    },
    /// A shape has another number of vertices than the reference.
    #[error(
        "{}: has {found} vertices, but the reference `{reference}` has {expected}; every shape of a sequence must be \
         the same mesh deformed",
        path.display()
    )]
    VertexCountDiffers {
        /// The file.
        path: PathBuf,
        /// Name of the reference shape.
        reference: String,
        /// V of the reference.
        expected: usize,
        /// V of this file.
        found: usize,
    },
    /// A shape has another number of faces than the reference.
    #[error(
        "{}: has {found} faces, but the reference `{reference}` has {expected}; every shape of a sequence must be the \
         same mesh deformed",
        path.display()
    )]
    FaceCountDiffers {
        /// The file.
        path: PathBuf,
        /// Name of the reference shape.
        reference: String,
        /// F of the reference, polygons counted before triangulation.
        expected: usize,
        /// F of this file.
        found: usize,
    },
    /// A face has other corners than the same face of the reference.
    #[error(
        "{}: face {face} has the corners {found:?}, but in the reference `{reference}` {expected:?} (vertices counted \
         from 0); export every shape from the same mesh without reordering",
        path.display()
    )]
    FacesDiffer {
        /// The file.
        path: PathBuf,
        /// Name of the reference shape.
        reference: String,
        /// The first face that differs.
        face: usize,
        /// Its corners in the reference, at most the first eight.
        expected: Vec<u32>,
        /// Its corners here, at most the first eight.
        found: Vec<u32>,
    },
    /// The reference has no area.
    #[error(
        "{}: the reference shape `{reference}` has no area, every triangle is collapsed; put an undeformed shape first",
        path.display()
    )]
    ZeroArea {
        /// The file or folder.
        path: PathBuf,
        /// Name of the reference shape.
        reference: String,
    },
    /// The edges are scattered as no deformation would: the vertices are in another order.
    #[error(
        "{}: shape {shape} (`{name}`) has its vertices in another order than the reference `{reference}`: {torn} of \
         {edges} edges are torn far apart, for example between vertices {} and {}; export every shape with the \
         vertex order kept",
        path.display(), example[0], example[1]
    )]
    VertexOrderDiffers {
        /// The file or folder.
        path: PathBuf,
        /// Index of the shape.
        shape: usize,
        /// Name of the shape.
        name: String,
        /// Name of the reference shape.
        reference: String,
        /// How many edges are torn.
        torn: usize,
        /// How many edges there are.
        edges: usize,
        /// The two ends of the edge that grew most.
        example: [u32; 2],
    },
}

/// Names that an error lists.
const LISTED_MAX: usize = 20;

fn listed(names: &[String]) -> String {
    let shown = names
        .iter()
        .take(LISTED_MAX)
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(", ");
    match names.len() {
        0 => "none".into(),
        count if count > LISTED_MAX => format!("{shown} and {} more (`sinew inspect` lists all)", count - LISTED_MAX),
        _ => shown,
    }
}

fn others_listed(others: &[(String, usize)]) -> String {
    if others.is_empty() {
        return String::new();
    }
    let kinds: Vec<String> = others.iter().map(|(kind, count)| format!("{count} {kind}")).collect();
    format!(" (only {})", kinds.join(", "))
}
