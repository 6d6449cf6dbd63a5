//! PLY bodies, ascii and binary in both byte orders: `vertex` with x, y, z, and `face` with a list of vertex indices;
//! every other element and property is passed over.

use super::error::{Place, SequenceError};
use super::mesh::PolygonMesh;
use super::ply_header::{self, Element, Encoding, Header, PropertyKind, Scalar};
use super::text::{coordinate, ends_early, integer, unexpected};
use std::path::Path;

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<PolygonMesh, SequenceError> {
    let Header {
        encoding,
        elements,
        body,
        body_line,
    } = ply_header::parse(bytes, path)?;
    let vertices = elements.iter().find(|element| element.name == b"vertex");
    let Some(vertex_count) = vertices.map(|element| element.count) else {
        return Err(unexpected(
            path,
            Place::Line(body_line),
            "an element named vertex in the header",
            None,
        ));
    };
    PolygonMesh::check_vertex_count(vertex_count, path)?;
    let mut body = Body {
        path,
        bytes: body,
        at: 0,
        start: bytes.len() - body.len(),
        line: body_line,
        encoding,
    };
    let mut mesh = PolygonMesh::default();
    for element in &elements {
        let needed = element.count.saturating_mul(element.item_bytes_min(encoding));
        // An ascii file's last number may lack the separator behind it.
        if needed > body.bytes.len() - body.at + usize::from(encoding == Encoding::Ascii) {
            let name = String::from_utf8_lossy(element.name);
            let expected = format!("{} items of the element `{}`", element.count, name.escape_debug());
            return Err(ends_early(path, Place::Line(element.line), &expected));
        }
        match element.name {
            b"vertex" => read_vertices(&mut body, element, &mut mesh)?,
            b"face" => read_faces(&mut body, element, vertex_count, &mut mesh)?,
            // An element without properties takes no bytes, so nothing stands behind its count.
            _ if element.properties.is_empty() => {}
            _ => {
                mesh.ignored_element_count += element.count;
                for _ in 0..element.count {
                    for property in &element.properties {
                        body.skip(property.kind)?;
                    }
                }
            }
        }
    }
    Ok(mesh)
}

fn read_vertices(body: &mut Body<'_>, element: &Element<'_>, mesh: &mut PolygonMesh) -> Result<(), SequenceError> {
    let place = Place::Line(element.line);
    let axis_of = |name: &[u8]| [b"x", b"y", b"z"].iter().position(|axis| name == *axis);
    let single = |kind: PropertyKind| {
        if let PropertyKind::Single(scalar) = kind {
            Some(scalar)
        } else {
            None
        }
    };
    // For each property: the axis it gives, and its type.
    let plan: Vec<_> = element
        .properties
        .iter()
        .map(|p| (p.kind, axis_of(p.name).zip(single(p.kind))))
        .collect();
    for c in 0..3 {
        let given = plan
            .iter()
            .filter(|(_, axis)| axis.is_some_and(|(axis, _)| axis == c))
            .count();
        if given != 1 {
            let expected = format!("one property `{}` of the element vertex", ["x", "y", "z"][c]);
            return Err(unexpected(
                body.path,
                place,
                &expected,
                Some(format!("{given} of them").as_bytes()),
            ));
        }
    }
    if !mesh.positions.is_empty() {
        return Err(unexpected(
            body.path,
            place,
            "one element named vertex",
            Some(b"a second one"),
        ));
    }
    mesh.positions.reserve_exact(element.count);
    for v in 0..element.count {
        let mut position = [0.0f32; 3];
        for &(kind, axis) in &plan {
            match axis {
                Some((c, scalar)) => position[c] = body.coordinate(scalar, v)?,
                None => body.skip(kind)?,
            }
        }
        mesh.positions.push(position);
    }
    Ok(())
}

fn read_faces(
    body: &mut Body<'_>,
    element: &Element<'_>,
    vertex_count: usize,
    mesh: &mut PolygonMesh,
) -> Result<(), SequenceError> {
    let is_corners = |name: &[u8]| matches!(name, b"vertex_indices" | b"vertex_index");
    let list = element
        .properties
        .iter()
        .position(|p| is_corners(p.name) && matches!(p.kind, PropertyKind::List { item, .. } if item.is_integer()));
    let Some(list) = list else {
        let expected = "a list of integers named vertex_indices in the element face";
        return Err(unexpected(body.path, Place::Line(element.line), expected, None));
    };
    for f in 0..element.count {
        for (i, property) in element.properties.iter().enumerate() {
            let PropertyKind::List { count, item } = property.kind else {
                body.skip(property.kind)?;
                continue;
            };
            if i != list {
                body.skip(property.kind)?;
                continue;
            }
            for _ in 0..body.list_count(count, item)? {
                let place = body.place_of(Place::Face(f));
                let index = body.integer(item)?;
                if !(0..vertex_count as i64).contains(&index) {
                    let path = body.path.to_path_buf();
                    return Err(SequenceError::IndexOutOfRange {
                        path,
                        place,
                        index,
                        vertex_count,
                    });
                }
                mesh.corners.push(index as u32);
            }
        }
        mesh.end_face();
    }
    Ok(())
}

/// Reads numbers off the body, in either writing.
struct Body<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    /// Bytes of the file before the body.
    start: usize,
    /// Line of `at`, if ascii.
    line: usize,
    encoding: Encoding,
}

impl<'a> Body<'a> {
    /// The place of the next number: its line in text, its item in a binary body.
    fn place_of(&mut self, item: Place) -> Place {
        if self.encoding == Encoding::Ascii {
            self.pass_white_space();
            Place::Line(self.line)
        } else {
            item
        }
    }

    fn place(&self) -> Place {
        if self.encoding == Encoding::Ascii {
            Place::Line(self.line)
        } else {
            Place::Byte(self.start + self.at)
        }
    }

    fn pass_white_space(&mut self) {
        while let Some(byte) = self.bytes.get(self.at).filter(|byte| byte.is_ascii_whitespace()) {
            self.line += usize::from(*byte == b'\n');
            self.at += 1;
        }
    }

    fn word(&mut self) -> Result<&'a [u8], SequenceError> {
        self.pass_white_space();
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        if length == 0 {
            return Err(ends_early(self.path, self.place(), "a number"));
        }
        self.at += length;
        Ok(&rest[..length])
    }

    fn raw<const N: usize>(&mut self) -> Result<[u8; N], SequenceError> {
        let Some(raw) = self.bytes[self.at..].first_chunk::<N>() else {
            return Err(ends_early(self.path, self.place(), "a number"));
        };
        self.at += N;
        let mut raw = *raw;
        if self.encoding == Encoding::BinaryBigEndian {
            raw.reverse();
        }
        Ok(raw)
    }

    fn coordinate(&mut self, scalar: Scalar, v: usize) -> Result<f32, SequenceError> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return coordinate(Some(word), self.path, self.place());
        }
        let number = match scalar {
            Scalar::F32 => f32::from_le_bytes(self.raw()?),
            Scalar::F64 => f64::from_le_bytes(self.raw()?) as f32,
            _ => self.integer(scalar)? as f32,
        };
        if !number.is_finite() {
            let path = self.path.to_path_buf();
            return Err(SequenceError::NonFinite {
                path,
                place: Place::Vertex(v),
                found: number.to_string(),
            });
        }
        Ok(number)
    }

    fn integer(&mut self, scalar: Scalar) -> Result<i64, SequenceError> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return integer(word).ok_or_else(|| unexpected(self.path, self.place(), "a whole number", Some(word)));
        }
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.raw()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.raw()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.raw()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.raw()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.raw()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.raw()?).into(),
            // The header was checked: lists count and index in integers.
            Scalar::F32 | Scalar::F64 => return Err(unexpected(self.path, self.place(), "a whole number", None)),
        })
    }

    /// The length of a list, held against the bytes that are left.
    fn list_count(&mut self, count: Scalar, item: Scalar) -> Result<usize, SequenceError> {
        let place = self.place_of(self.place());
        let claimed = self.integer(count)?;
        let Ok(length) = usize::try_from(claimed) else {
            return Err(unexpected(
                self.path,
                place,
                "the length of a list",
                Some(claimed.to_string().as_bytes()),
            ));
        };
        let item_bytes = if self.encoding == Encoding::Ascii {
            2
        } else {
            item.size_bytes()
        };
        if length.saturating_mul(item_bytes) > self.bytes.len() - self.at + 1 {
            return Err(ends_early(self.path, place, &format!("a list of {length} numbers")));
        }
        Ok(length)
    }

    fn skip(&mut self, kind: PropertyKind) -> Result<(), SequenceError> {
        let (count, scalar) = match kind {
            PropertyKind::Single(scalar) => (1, scalar),
            PropertyKind::List { count, item } => (self.list_count(count, item)?, item),
        };
        if self.encoding == Encoding::Ascii {
            for _ in 0..count {
                self.word()?;
            }
        } else {
            let length_bytes = count.saturating_mul(scalar.size_bytes());
            if length_bytes > self.bytes.len() - self.at {
                return Err(ends_early(self.path, self.place(), "a number"));
            }
            self.at += length_bytes;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interchange::MeshKind;

    fn read(bytes: &[u8]) -> Result<PolygonMesh, SequenceError> {
        PolygonMesh::parse(MeshKind::Ply, bytes, Path::new("a.ply"))
    }

    /// A quad with a colour before x, y as double, an edge element between, and a list behind the corners.
    fn header(format: &str) -> String {
        format!(
            "ply\nMade by hand\nformat {format} 1.0\ncomment c\nelement vertex 4\nproperty uchar red\nproperty float x\n\
             property double y\nproperty float z\nelement edge 1\nproperty int vertex1\nproperty int vertex2\n\
             element face 2\nproperty uchar flags\nproperty list uchar uint vertex_indices\n\
             property list int float texcoord\nend_header\n"
        )
    }

    fn binary(big: bool) -> Vec<u8> {
        let order = |mut bytes: Vec<u8>| {
            if big {
                bytes.reverse();
            }
            bytes
        };
        let mut file = header(if big {
            "binary_big_endian"
        } else {
            "binary_little_endian"
        })
        .into_bytes();
        for (x, y) in [(0.0f32, 0.0f64), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            file.push(255);
            file.extend(order(x.to_le_bytes().into()));
            file.extend(order(y.to_le_bytes().into()));
            file.extend(order(0.25f32.to_le_bytes().into()));
        }
        file.extend(order(0i32.to_le_bytes().into()));
        file.extend(order(1i32.to_le_bytes().into()));
        for corners in [&[0u32, 1, 2, 3][..], &[0, 1]] {
            file.extend([7, corners.len() as u8]);
            corners
                .iter()
                .for_each(|corner| file.extend(order(corner.to_le_bytes().into())));
            file.extend(order(1i32.to_le_bytes().into()));
            file.extend(order(0.5f32.to_le_bytes().into()));
        }
        file
    }

    #[test]
    fn every_writing_gives_the_same_mesh() {
        let ascii = header("ascii")
            + "255 0 0 0.25\n255 1 0 0.25\n255 1 1 0.25\n255 0 1 0.25\n0 1\n7 4 0 1 2 3 1 0.5\n7 2 0 1 1 0.5";
        let mesh = read(ascii.as_bytes()).unwrap();
        assert_eq!(
            mesh.positions,
            [[0., 0., 0.25], [1., 0., 0.25], [1., 1., 0.25], [0., 1., 0.25]]
        );
        assert_eq!(
            (mesh.face(0), mesh.face_count(), mesh.ignored_element_count),
            (&[0, 1, 2, 3][..], 1, 2)
        );
        assert_eq!(read(&binary(false)).unwrap(), mesh);
        assert_eq!(read(&binary(true)).unwrap(), mesh);
        assert_eq!(read(ascii.replace('\n', "\r\n").as_bytes()).unwrap(), mesh);
    }

    #[test]
    fn every_truncation_is_refused() {
        for file in [binary(false), binary(true)] {
            for length in 0..file.len() {
                assert!(read(&file[..length]).is_err(), "{length} bytes");
            }
        }
    }

    #[test]
    fn lying_counts_are_refused() {
        let head = "ply\nformat binary_little_endian 1.0\n";
        let vertex = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
        let face = "element face 1\nproperty list int int vertex_index\nend_header\n";
        let zeros = [0u8; 12];
        for text in [
            format!("{head}{}{face}", vertex.replace(" 1\n", " 4000000000\n")),
            format!("{head}{}{face}", vertex.replace(" 1\n", " 18446744073709551615\n")),
            format!("{head}{vertex}{}", face.replace(" 1\n", " 4000000000\n")),
            format!("{head}{vertex}element none 18446744073709551615\nproperty int a\n{face}"),
            format!("{head}{vertex}{}", face.replace("vertex_index", "corner")),
            format!("{head}{}{face}", vertex.replace("float z", "float y")),
            format!("{head}{vertex}{vertex}{face}"),
        ] {
            assert!(read(&[text.as_bytes(), &zeros].concat()).is_err(), "{text}");
        }
        let text = format!("{head}{vertex}{face}");
        for length in [i32::MAX, -1, 3] {
            let file = [text.as_bytes(), &zeros, &length.to_le_bytes()].concat();
            assert!(matches!(read(&file), Err(SequenceError::Parse { .. })), "{length}");
        }
    }

    #[test]
    fn wrong_numbers_name_their_vertex_or_face() {
        let mut file = binary(false);
        let start = header("binary_little_endian").len();
        file[start + 17 + 1..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(matches!(
            read(&file),
            Err(SequenceError::NonFinite {
                place: Place::Vertex(1),
                ..
            })
        ));
        let mut file = binary(false);
        file[start + 4 * 17 + 8 + 2..][..4].copy_from_slice(&4u32.to_le_bytes());
        let outside = read(&file);
        assert!(matches!(
            outside,
            Err(SequenceError::IndexOutOfRange {
                place: Place::Face(0),
                index: 4,
                ..
            })
        ));
    }
}
