//! Reads a mesh sequence: finds the files, parses them in natural order, and refuses what is no sequence.

use super::error::SequenceError;
use super::folder::{Folder, file_name};
use super::mesh::{MeshKind, PolygonMesh};
use super::notice::Notice;
use super::npy::NpyArray;
use super::order::{EdgeOrder, diagonal};
use super::sequence::MeshSequence;
use super::texture::read_render_surface;
use super::triangulate::triangulate;
use std::fs;
use std::path::Path;

/// Corners of a face that are quoted when it differs.
const QUOTED_CORNERS_MAX: usize = 8;

/// A sequence and what was odd about its files.
#[derive(Debug, Clone, PartialEq)]
pub struct SequenceRead {
    /// The sequence.
    pub sequence: MeshSequence,
    /// What was handled without refusing, for the user to know; in a fixed order.
    pub notices: Vec<Notice>,
}

/// Reads the sequence at `path`: a folder of OBJ, PLY or OFF files, one a shape, in natural order ("frame2" before
/// "frame10"); or a folder with `positions.npy` `[N][V][3]` and `faces.npy` `[F][3]`, which go before any mesh files there;
/// or that `positions.npy` itself.
///
/// `progress` is called with (shapes read, N) after every shape. Vertex order is kept; polygons are split alike in every
/// shape, by the geometry of the first.
///
/// Errors: see [`SequenceError`]; nothing is changed on disk.
pub fn read_sequence(path: &Path, progress: &mut dyn FnMut(usize, usize)) -> Result<SequenceRead, SequenceError> {
    let metadata = match fs::metadata(path) {
        Ok(metadata) => metadata,
        Err(source)
            if matches!(
                source.kind(),
                std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory
            ) =>
        {
            return Err(SequenceError::NoSuchPath {
                path: path.to_path_buf(),
            });
        }
        Err(source) => {
            return Err(SequenceError::Io {
                path: path.to_path_buf(),
                source,
            });
        }
    };
    if metadata.is_dir() {
        let folder = Folder::list(path)?;
        let positions = path.join("positions.npy");
        if positions.is_file() {
            let beside = folder.files.len() + folder.others.len();
            let mut read = read_arrays(path, &positions, progress)?;
            let is_array = |name: &&String| matches!(name.as_str(), "positions.npy" | "faces.npy");
            let ignored = beside - folder.others.iter().filter(is_array).count();
            let first_mesh = folder.files.first().map(|file| file_name(file));
            let example = first_mesh.or_else(|| folder.others.iter().find(|name| !is_array(name)).cloned());
            if let Some(example) = example {
                read.notices.insert(
                    0,
                    Notice::IgnoredFiles {
                        count: ignored,
                        example,
                    },
                );
            }
            return Ok(read);
        }
        return read_files(path, folder, progress);
    }
    if path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("npy"))
    {
        return read_arrays(path, path, progress);
    }
    if MeshKind::of_path(path).is_some() {
        return Err(SequenceError::OneShapeOnly {
            path: path.to_path_buf(),
        });
    }
    Err(SequenceError::UnknownKind {
        path: path.to_path_buf(),
    })
}

fn read_files(
    path: &Path,
    folder: Folder,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<SequenceRead, SequenceError> {
    let Folder { files, others } = folder;
    let path_buf = || path.to_path_buf();
    let Some(first) = files.first() else {
        return Err(SequenceError::EmptyFolder {
            path: path_buf(),
            nearby: Folder::nearby(path)?,
        });
    };
    let kinds: Vec<MeshKind> = files.iter().filter_map(|file| MeshKind::of_path(file)).collect();
    let kind = kinds[0];
    if let Some(other) = kinds.iter().position(|&other| other != kind) {
        return Err(SequenceError::MixedKinds {
            path: path_buf(),
            first: kind.name(),
            first_file: file_name(first),
            second: kinds[other].name(),
            second_file: file_name(&files[other]),
        });
    }
    if files.len() == 1 {
        return Err(SequenceError::OneShapeOnly { path: first.clone() });
    }

    let mut notices = Vec::new();
    if let Some(example) = others.first() {
        notices.push(Notice::IgnoredFiles {
            count: others.len(),
            example: example.clone(),
        });
    }
    let shape_names: Vec<String> = files.iter().map(|file| file_name(file)).collect();
    let read_bytes = |file: &Path| {
        fs::read(file).map_err(|source| SequenceError::Io {
            path: file.to_path_buf(),
            source,
        })
    };
    let reference_bytes = read_bytes(first)?;
    let reference = PolygonMesh::parse(kind, &reference_bytes, first)?;
    let triangulation = triangulate(&reference);
    if triangulation.faces.len() >= u32::MAX as usize {
        let count = triangulation.faces.len();
        return Err(SequenceError::TooLarge {
            path: first.clone(),
            count,
            what: "triangles",
        });
    }
    if triangulation.polygon_count > 0 {
        let (count, triangle_count) = (triangulation.polygon_count, triangulation.polygon_triangle_count);
        notices.push(Notice::PolygonsTriangulated { count, triangle_count });
    }
    if triangulation.collapsed_count > 0 {
        notices.push(Notice::CollapsedTriangles {
            count: triangulation.collapsed_count,
        });
    }
    if reference.ignored_element_count > 0 {
        notices.push(Notice::IgnoredElements {
            count: reference.ignored_element_count,
        });
    }
    check_reference(first, &shape_names[0], &triangulation.faces, &reference.positions)?;
    let mut render = None;
    if kind == MeshKind::Obj {
        match read_render_surface(&reference_bytes, &reference, &triangulation.faces) {
            Ok(surface) => render = surface,
            Err(line) => notices.push(Notice::TextureIgnored { line }),
        }
    }
    drop(reference_bytes);
    let edge_order = EdgeOrder::new(&triangulation.faces, &reference.positions);
    progress(1, files.len());

    let mut shapes = Vec::with_capacity(files.len());
    shapes.push(reference.positions.clone());
    for (m, file) in files.iter().enumerate().skip(1) {
        let mesh = PolygonMesh::parse(kind, &read_bytes(file)?, file)?;
        check_same_faces(&reference, &mesh, &shape_names[0], file)?;
        if let Some(torn) = edge_order.check(&mesh.positions) {
            return Err(edge_order.refusal(torn, file, m, &shape_names));
        }
        shapes.push(mesh.positions);
        progress(m + 1, files.len());
    }
    let mut read = finish(path, triangulation.faces, shapes, shape_names, notices);
    read.sequence.render = render;
    Ok(read)
}

/// `source` is the path that the user gave, `positions` the array file.
fn read_arrays(
    source: &Path,
    positions: &Path,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<SequenceRead, SequenceError> {
    let faces_path = positions.with_file_name("faces.npy");
    let read = |path: &Path| {
        fs::read(path).map_err(|source| SequenceError::Io {
            path: path.to_path_buf(),
            source,
        })
    };
    let positions_bytes = read(positions)?;
    let array = NpyArray::parse(&positions_bytes, positions)?;
    if array.is_float() && array.shape().len() == 2 && array.shape()[1] == 3 {
        return Err(SequenceError::OneShapeOnly {
            path: positions.to_path_buf(),
        });
    }
    array.check_float_positions()?;
    let (shape_count, vertex_count) = (array.shape()[0], array.shape()[1]);
    if shape_count < 2 {
        return Err(SequenceError::OneShapeOnly {
            path: positions.to_path_buf(),
        });
    }
    PolygonMesh::check_vertex_count(vertex_count, positions)?;
    if !faces_path.is_file() {
        return Err(SequenceError::MissingFaces { path: faces_path });
    }
    let faces_bytes = read(&faces_path)?;
    let faces_array = NpyArray::parse(&faces_bytes, &faces_path)?;
    faces_array.check_triangles()?;
    let mut faces = faces_array.triangles(vertex_count)?;
    let face_count = faces.len();
    faces.retain(|[a, b, c]| a != b && b != c && c != a);
    let mut notices = Vec::new();
    if faces.len() < face_count {
        notices.push(Notice::CollapsedTriangles {
            count: face_count - faces.len(),
        });
    }
    if face_count == 0 {
        return Err(SequenceError::NoFaces { path: faces_path });
    }
    if faces.len() >= u32::MAX as usize {
        return Err(SequenceError::TooLarge {
            path: faces_path,
            count: faces.len(),
            what: "triangles",
        });
    }

    let array_name = file_name(positions);
    let shape_names: Vec<String> = (0..shape_count).map(|m| format!("{array_name}[{m}]")).collect();
    let reference = array.positions(0)?;
    check_reference(positions, &shape_names[0], &faces, &reference)?;
    let edge_order = EdgeOrder::new(&faces, &reference);
    progress(1, shape_count);
    let mut shapes = vec![reference];
    for m in 1..shape_count {
        let shape = array.positions(m)?;
        if let Some(torn) = edge_order.check(&shape) {
            return Err(edge_order.refusal(torn, positions, m, &shape_names));
        }
        shapes.push(shape);
        progress(m + 1, shape_count);
    }
    Ok(finish(source, faces, shapes, shape_names, notices))
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

/// Refuses a shape with other counts or other faces than the reference.
fn check_same_faces(
    reference: &PolygonMesh,
    mesh: &PolygonMesh,
    reference_name: &str,
    file: &Path,
) -> Result<(), SequenceError> {
    let (path, name) = (file.to_path_buf(), reference_name.to_string());
    let (expected, found) = (reference.positions.len(), mesh.positions.len());
    if expected != found {
        return Err(SequenceError::VertexCountDiffers {
            path,
            reference: name,
            expected,
            found,
        });
    }
    let (expected, found) = (reference.face_count(), mesh.face_count());
    if expected != found {
        return Err(SequenceError::FaceCountDiffers {
            path,
            reference: name,
            expected,
            found,
        });
    }
    if reference.corners == mesh.corners && reference.face_ends == mesh.face_ends {
        return Ok(());
    }
    let differs = (0..expected).find(|&f| reference.face(f) != mesh.face(f)).unwrap_or(0);
    let quoted = |corners: &[u32]| corners[..corners.len().min(QUOTED_CORNERS_MAX)].to_vec();
    Err(SequenceError::FacesDiffer {
        path,
        reference: name,
        face: differs,
        expected: quoted(reference.face(differs)),
        found: quoted(mesh.face(differs)),
    })
}

/// Puts the sequence together and counts isolated and duplicate vertices.
fn finish(
    path: &Path,
    faces: Vec<[u32; 3]>,
    shapes: Vec<Vec<[f32; 3]>>,
    shape_names: Vec<String>,
    mut notices: Vec<Notice>,
) -> SequenceRead {
    let reference = &shapes[0];
    let mut used = vec![false; reference.len()];
    faces.iter().flatten().for_each(|&v| used[v as usize] = true);
    let isolated = used.iter().filter(|used| !**used).count();
    if let Some(first) = used.iter().position(|used| !used) {
        notices.push(Notice::IsolatedVertices { count: isolated, first });
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
        notices.push(Notice::DuplicateVertices {
            count,
            first: first as usize,
        });
    }
    // `.` and `..` have no last part of their own.
    let named = if path.file_name().is_some() {
        path.to_path_buf()
    } else {
        fs::canonicalize(path).unwrap_or_default()
    };
    let is_array = named
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
    let source = if is_array {
        named
            .parent()
            .filter(|parent| parent.file_name().is_some())
            .unwrap_or(&named)
    } else {
        &named
    };
    SequenceRead {
        sequence: MeshSequence {
            name: file_name(source),
            faces,
            shapes,
            shape_names,
            render: None,
        },
        notices,
    }
}
