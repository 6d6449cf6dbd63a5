//! Wavefront OBJ, by hand: other readers renumber vertices by their texture coordinates, which a sequence cannot bear.
//! Those of the reference are read by [`dress`].

mod dress;
mod write;

use super::error::{Place, SequenceError};
use super::format::{Format, Reading, ShapeReader};
use super::mesh::PolygonMesh;
use super::text::{Lines, coordinate, decoded, integer, tokens, unexpected};
use std::path::Path;
pub(crate) use write::write_folder;
pub use write::{write_obj, write_sequence_obj};

pub(super) const FORMAT: Format = Format {
    name: "OBJ",
    extensions: &["obj"],
    reading: Reading::Shape(ShapeReader {
        shape: parse,
        dress: |bytes, _, mesh| dress::add(bytes, mesh),
    }),
    writing: Some(write::open),
};

/// Only data lines are continued: a comment or a Windows path may end in a backslash by chance.
fn is_continued(start: &[u8]) -> bool {
    matches!(start.first(), Some(b'v' | b'f' | b'l' | b'p'))
}

/// Reads `v` and `f`, counts `p`, `l` and free-form geometry, passes over everything else (groups, materials, normals,
/// texture coordinates, colours behind a position).
fn parse(bytes: &[u8], path: &Path) -> Result<PolygonMesh, SequenceError> {
    let bytes = &*decoded(bytes);
    let mut mesh = PolygonMesh::default();
    // A face may name vertices that only follow it, so positive indices are held against the count at the end.
    let mut largest = Largest { index: 0, line: 0 };
    let mut lines = Lines::new(bytes);
    while let Some((number, line)) = lines.next(is_continued) {
        let place = Place::Line(number);
        let mut words = tokens(line);
        match words.next() {
            Some(b"v") => {
                let x = coordinate(words.next(), path, place)?;
                let y = coordinate(words.next(), path, place)?;
                let z = coordinate(words.next(), path, place)?;
                mesh.positions.push([x, y, z]);
            }
            Some(b"f") => {
                for word in words {
                    let corner = corner(word, mesh.positions.len(), path, number, &mut largest)?;
                    mesh.corners.push(corner);
                }
                mesh.end_face();
            }
            Some(b"l" | b"p" | b"curv" | b"curv2" | b"surf") => mesh.ignored_element_count += 1,
            _ => {}
        }
    }
    PolygonMesh::check_vertex_count(mesh.positions.len(), path)?;
    if largest.index > mesh.positions.len() as i64 {
        let (index, vertex_count) = (largest.index, mesh.positions.len());
        let place = Place::Line(largest.line);
        return Err(SequenceError::IndexOutOfRange {
            path: path.to_path_buf(),
            place,
            index,
            vertex_count,
        });
    }
    Ok(mesh)
}

/// The largest index met so far, counted from 1, and its line.
struct Largest {
    index: i64,
    line: usize,
}

/// Vertex of one corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 0.
fn corner(word: &[u8], so_far: usize, path: &Path, line: usize, largest: &mut Largest) -> Result<u32, SequenceError> {
    let vertex = word.split(|&b| b == b'/').next().unwrap_or_default();
    let Some(index) = integer(vertex) else {
        return Err(unexpected(
            path,
            Place::Line(line),
            "a corner such as 7, 7/1, 7//1 or 7/1/1",
            Some(word),
        ));
    };
    let from_one = if index < 0 {
        so_far as i64 + 1 + index.max(-(u32::MAX as i64))
    } else {
        index
    };
    if !(1..u32::MAX as i64).contains(&from_one) {
        let place = Place::Line(line);
        return Err(SequenceError::IndexOutOfRange {
            path: path.to_path_buf(),
            place,
            index,
            vertex_count: so_far,
        });
    }
    if from_one > largest.index {
        *largest = Largest { index: from_one, line };
    }
    Ok((from_one - 1) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PolygonMesh, SequenceError> {
        PolygonMesh::parse(text.as_bytes(), Path::new("a.obj"))
    }

    #[test]
    fn corners_in_every_form_and_groups_and_colours() {
        let text = "# C:\\dir\\\nmtllib m.mtl\no x\nv 0 0 0 1 0.5 0\r\nv 1 0 0\nv 1 1 0 # corner\nvt 0 0\nvn 0 0 1\nv 0 1 0\n\
                    g part\nf 1/1 2/1 3/1\nf -4//1 -2//1 -1//1\ns off\nf 1/1/1 2/1/1 \\\n 3/1/1 \\\r\n 4/1/1\np 1\nl 1 2\nf 1 2";
        let mesh = read(text).unwrap();
        assert_eq!(mesh.positions, [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]);
        assert_eq!(
            (mesh.face(0), mesh.face(1), mesh.face(2)),
            (&[0, 1, 2][..], &[0, 2, 3][..], &[0, 1, 2, 3][..])
        );
        assert_eq!((mesh.face_count(), mesh.ignored_element_count), (3, 3));
    }

    #[test]
    fn a_face_may_come_before_its_vertices() {
        assert_eq!(read("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0").unwrap().corners, [0, 1, 2]);
    }

    #[test]
    fn refusals_name_line_and_index() {
        let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for (face, wrong) in [
            ("f 1 2 4", 4),
            ("f 0 1 2", 0),
            ("f -4 1 2", -4),
            ("f 1 2 9999999999", 9999999999),
        ] {
            match read(&format!("{triangle}{face}\n")) {
                Err(SequenceError::IndexOutOfRange {
                    place: Place::Line(4),
                    index,
                    vertex_count: 3,
                    ..
                }) => {
                    assert_eq!(index, wrong);
                }
                other => panic!("{face}: {other:?}"),
            }
        }
        assert!(matches!(
            read("v 0 0\n"),
            Err(SequenceError::Parse {
                place: Place::Line(1),
                ..
            })
        ));
        assert!(matches!(
            read("\nv 0 0 nan\n"),
            Err(SequenceError::NonFinite {
                place: Place::Line(2),
                ..
            })
        ));
        assert!(matches!(
            read(&format!("{triangle}f 1 x 3")),
            Err(SequenceError::Parse {
                place: Place::Line(4),
                ..
            })
        ));
        assert!(matches!(read(triangle), Err(SequenceError::NoFaces { .. })));
    }
}
