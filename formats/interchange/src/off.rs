//! OFF, text: `OFF` with the prefixes `ST`, `C` and `N`, whose extra columns are ignored.

use super::error::{Place, SequenceError};
use super::format::{Format, Reading, ShapeReader};
use super::mesh::PolygonMesh;
use super::text::{Lines, coordinate, decoded, ends_early, integer, tokens, unexpected};
use core::fmt::Display;
use std::path::Path;

/// The fewest bytes a vertex line can have: `0 0 0` and a line end.
const VERTEX_BYTES_MIN: usize = 6;
/// The fewest bytes a face line can have: `0` and a line end.
const FACE_BYTES_MIN: usize = 2;

pub(super) const FORMAT: Format = Format {
    name: "OFF",
    extensions: &["off"],
    reading: Reading::Shape(ShapeReader {
        shape: parse,
        dress: |_, _, _| Ok(()),
    }),
    writing: None,
};

fn parse(bytes: &[u8], path: &Path) -> Result<PolygonMesh, SequenceError> {
    let bytes = &*decoded(bytes);
    let mut lines = Lines::new(bytes);
    let (place, line) = next(&mut lines, path, "the keyword OFF")?;
    let mut words = tokens(line);
    let keyword = words.next().unwrap_or_default();
    let known = [
        &b"OFF"[..],
        b"COFF",
        b"NOFF",
        b"CNOFF",
        b"NCOFF",
        b"STOFF",
        b"STCOFF",
        b"STNOFF",
        b"STCNOFF",
    ];
    if !known.contains(&keyword) {
        return Err(unexpected(
            path,
            place,
            "the keyword OFF, COFF, NOFF or CNOFF",
            Some(keyword),
        ));
    }
    // The counts may stand behind the keyword.
    let mut counts: Vec<&[u8]> = words.take(3).collect();
    let mut place = place;
    if counts.is_empty() {
        let (counts_place, line) = next(&mut lines, path, "the numbers of vertices, faces and edges")?;
        (place, counts) = (counts_place, tokens(line).take(3).collect());
    }
    let count = |i: usize| {
        let word = counts.get(i).copied();
        let value = word.and_then(integer).and_then(|value| usize::try_from(value).ok());
        value.ok_or_else(|| unexpected(path, place, "the numbers of vertices, faces and edges as text", word))
    };
    let (vertex_count, face_count) = (count(0)?, count(1)?);
    PolygonMesh::check_vertex_count(vertex_count, path)?;
    let needed = vertex_count
        .saturating_mul(VERTEX_BYTES_MIN)
        .saturating_add(face_count.saturating_mul(FACE_BYTES_MIN));
    // The last line may lack its end.
    if needed > lines.rest().len() + 1 {
        let expected = format!("{vertex_count} vertices and {face_count} faces");
        return Err(ends_early(path, place, &expected));
    }

    let mut mesh = PolygonMesh {
        positions: Vec::with_capacity(vertex_count),
        ..PolygonMesh::default()
    };
    for v in 0..vertex_count {
        let (place, line) = next(&mut lines, path, format_args!("vertex {v} of {vertex_count}"))?;
        let mut words = tokens(line);
        let x = coordinate(words.next(), path, place)?;
        let y = coordinate(words.next(), path, place)?;
        let z = coordinate(words.next(), path, place)?;
        mesh.positions.push([x, y, z]);
    }
    for f in 0..face_count {
        let (place, line) = next(&mut lines, path, format_args!("face {f} of {face_count}"))?;
        let mut words = tokens(line);
        let word = words.next();
        let Some(corner_count) = word.and_then(integer).filter(|&count| count >= 0) else {
            return Err(unexpected(
                path,
                place,
                "a face: its number of corners, then their vertices",
                word,
            ));
        };
        for _ in 0..corner_count {
            let word = words.next();
            let Some(index) = word.and_then(integer) else {
                return Err(unexpected(path, place, &format!("{corner_count} vertex indices"), word));
            };
            if !(0..vertex_count as i64).contains(&index) {
                return Err(SequenceError::IndexOutOfRange {
                    path: path.to_path_buf(),
                    place,
                    index,
                    vertex_count,
                });
            }
            mesh.corners.push(index as u32);
        }
        mesh.end_face();
    }
    Ok(mesh)
}

/// The next line with content, or the error that names what it should have held.
fn next<'a>(lines: &mut Lines<'a>, path: &Path, expected: impl Display) -> Result<(Place, &'a [u8]), SequenceError> {
    let line = lines.next_filled();
    line.map(|(number, line)| (Place::Line(number), line))
        .map_err(|number| ends_early(path, Place::Line(number), &expected.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PolygonMesh, SequenceError> {
        PolygonMesh::parse(text.as_bytes(), Path::new("a.off"))
    }

    #[test]
    fn variants_comments_and_polygons() {
        let body = "0 0 0 9 9 9\n1 0 0\n# between\n\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n3 0 1 2 # red\n";
        for head in [
            "OFF\n4 2 0\n",
            "COFF # c\n# d\n4 2 5\n",
            "NOFF 4 2 0\n",
            "OFF\r\n4 2\r\n",
        ] {
            let mesh = read(&format!("{head}{body}")).unwrap();
            assert_eq!(mesh.positions[2], [1., 1., 0.], "{head}");
            assert_eq!((mesh.face(0), mesh.face(1)), (&[0, 1, 2, 3][..], &[0, 1, 2][..]));
        }
    }

    #[test]
    fn refusals() {
        let line = |result: Result<PolygonMesh, SequenceError>| match result {
            Err(SequenceError::Parse {
                place: Place::Line(line),
                ..
            }) => line,
            other => panic!("{other:?}"),
        };
        assert_eq!(line(read("")), 1);
        assert_eq!(line(read("PFF\n")), 1);
        assert_eq!(line(read("4OFF\n1 1 0\n")), 1);
        assert_eq!(line(read("OFF BINARY\n\0\0")), 1);
        assert_eq!(line(read("OFF\n4000000000 1 0\n0 0 0\n")), 2);
        assert_eq!(line(read("OFF\n3 18446744073709551615 0\n0 0 0\n")), 2);
        assert_eq!(line(read("OFF\n1 1 0\n0 0 0\n3 0 0\n")), 4);
        assert_eq!(line(read("OFF\n1 1 0\n0 0 0\n-1\n\n")), 4);
        let outside = read("OFF\n1 1 0\n0 0 0\n3 0 0 1\n");
        assert!(matches!(
            outside,
            Err(SequenceError::IndexOutOfRange {
                index: 1,
                place: Place::Line(4),
                ..
            })
        ));
    }
}
