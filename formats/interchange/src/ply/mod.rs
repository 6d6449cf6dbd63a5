//! PLY bodies, ascii and binary in both byte orders: `vertex` with x, y, z, and `face` with a list of vertex indices;
//! every other element and property is passed over.

mod body;
mod header;
mod write;

use super::error::{Place, SequenceError};
use super::format::{Format, Reading, ShapeReader};
use super::mesh::{CornerTexture, PolygonMesh, UNTEXTURED};
use super::text::{decoded, ends_early, unexpected};
use body::Body;
use header::{Element, Encoding, Header, Property, PropertyKind, Scalar};
use std::path::Path;
pub use write::write_ply;

pub(super) const FORMAT: Format = Format {
    name: "PLY",
    extensions: &["ply"],
    reading: Reading::Shape(ShapeReader {
        shape: |bytes, path| parse(bytes, path, false),
        dress: |bytes, path, mesh| {
            *mesh = parse(bytes, path, true).map_err(|error| error.to_string())?;
            Ok(())
        },
    }),
    writing: Some(write::open),
};

/// Reads a shape; with `dress`, its texture coordinates and colours too.
fn parse(bytes: &[u8], path: &Path, dress: bool) -> Result<PolygonMesh, SequenceError> {
    let bytes = &*decoded(bytes);
    let Header {
        encoding,
        elements,
        body,
        body_line,
    } = header::parse(bytes, path)?;
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
            b"vertex" => read_vertices(&mut body, element, dress, &mut mesh)?,
            b"face" => read_faces(&mut body, element, vertex_count, dress, &mut mesh)?,
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
    // Texture coordinates of vertices: corners use those of their vertex.
    if mesh.is_split
        && let Some(texture) = &mut mesh.texture
    {
        texture.corners.clone_from(&mesh.corners);
    }
    Ok(mesh)
}

/// What a property of a vertex is.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Position(usize),
    Texture(usize),
    Color(usize),
    Other,
}

impl Part {
    fn of_name(name: &[u8], dress: bool) -> Part {
        match name {
            b"x" => Part::Position(0),
            b"y" => Part::Position(1),
            b"z" => Part::Position(2),
            b"s" | b"u" | b"texture_u" if dress => Part::Texture(0),
            b"t" | b"v" | b"texture_v" if dress => Part::Texture(1),
            b"red" if dress => Part::Color(0),
            b"green" if dress => Part::Color(1),
            b"blue" if dress => Part::Color(2),
            b"alpha" if dress => Part::Color(3),
            _ => Part::Other,
        }
    }
}

fn read_vertices(
    body: &mut Body<'_>,
    element: &Element<'_>,
    dress: bool,
    mesh: &mut PolygonMesh,
) -> Result<(), SequenceError> {
    let place = Place::Line(element.line);
    // For each property: what it is and its type.
    let plan: Vec<(PropertyKind, Part)> = element
        .properties
        .iter()
        .map(|property| {
            let is_single = matches!(property.kind, PropertyKind::Single(_));
            let part = if is_single {
                Part::of_name(property.name, dress)
            } else {
                Part::Other
            };
            (property.kind, part)
        })
        .collect();
    let count_of = |wanted: Part| plan.iter().filter(|(_, part)| *part == wanted).count();
    for c in 0..3 {
        let given = count_of(Part::Position(c));
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
    let textured = (0..2).all(|c| count_of(Part::Texture(c)) == 1);
    let colored = (0..3).all(|c| count_of(Part::Color(c)) == 1);
    mesh.positions.reserve_exact(element.count);
    let mut uvs = Vec::new();
    for v in 0..element.count {
        let (mut position, mut uv, mut color) = ([0.0f32; 3], [0.0f32; 2], [1.0f32; 4]);
        for &(kind, part) in &plan {
            let PropertyKind::Single(scalar) = kind else {
                body.skip(kind)?;
                continue;
            };
            match part {
                Part::Position(c) => position[c] = body.coordinate(scalar, v)?,
                Part::Texture(c) => uv[c] = body.coordinate(scalar, v)?,
                Part::Color(c) => color[c] = body.coordinate(scalar, v)? / scalar.color_scale(),
                Part::Other => body.skip(kind)?,
            }
        }
        mesh.positions.push(position);
        if textured {
            uvs.push(uv);
        }
        if colored {
            mesh.dress.colors.push(color);
        }
    }
    if textured {
        mesh.is_split = true;
        mesh.texture = Some(CornerTexture {
            uvs,
            corners: Vec::new(),
        });
    }
    Ok(())
}

fn read_faces(
    body: &mut Body<'_>,
    element: &Element<'_>,
    vertex_count: usize,
    dress: bool,
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
    let is_texture = |property: &Property<'_>| {
        property.name == b"texcoord"
            && matches!(
                property.kind,
                PropertyKind::List {
                    item: Scalar::F32 | Scalar::F64,
                    ..
                }
            )
    };
    let wedges = element
        .properties
        .iter()
        .position(is_texture)
        .filter(|_| dress && mesh.texture.is_none());
    let mut texture = CornerTexture::default();
    for f in 0..element.count {
        let mut own_uvs = Vec::new();
        for (i, property) in element.properties.iter().enumerate() {
            match property.kind {
                PropertyKind::List { count, item } if i == list => {
                    read_corners(body, count, item, vertex_count, f, mesh)?
                }
                PropertyKind::List { count, item } if Some(i) == wedges => {
                    for _ in 0..body.list_count(count, item)? {
                        own_uvs.push(body.coordinate(item, f)?);
                    }
                }
                kind => body.skip(kind)?,
            }
        }
        let start = mesh.face_ends.last().map_or(0, |&end| end as usize);
        let corner_count = mesh.corners.len() - start;
        if mesh.end_face() && wedges.is_some() {
            // A texture coordinate for each corner, or none for this face.
            let first = texture.uvs.len() as u32;
            let is_whole = own_uvs.len() == 2 * corner_count;
            let number = |i: usize| if is_whole { first + i as u32 } else { UNTEXTURED };
            texture.corners.extend((0..corner_count).map(number));
            if is_whole {
                texture.uvs.extend(own_uvs.as_chunks::<2>().0);
            }
        }
    }
    if wedges.is_some() {
        mesh.texture = Some(texture);
    }
    Ok(())
}

/// The vertices of face `f`.
fn read_corners(
    body: &mut Body<'_>,
    count: Scalar,
    item: Scalar,
    vertex_count: usize,
    f: usize,
    mesh: &mut PolygonMesh,
) -> Result<(), SequenceError> {
    for _ in 0..body.list_count(count, item)? {
        let place = body.place_of(Place::Face(f));
        let index = body.integer(item)?;
        if !(0..vertex_count as i64).contains(&index) {
            return Err(SequenceError::IndexOutOfRange {
                path: body.path.to_path_buf(),
                place,
                index,
                vertex_count,
            });
        }
        mesh.corners.push(index as u32);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<PolygonMesh, SequenceError> {
        PolygonMesh::parse(bytes, Path::new("a.ply"))
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
    fn lines_that_end_in_carriage_returns() {
        let ascii =
            header("ascii") + "255 0 0 0.25\n255 1 0 0.25\n255 1 1 0.25\n255 0 1 0.25\n0 1\n7 4 0 1 2 x 1 0.5\n";
        match read(ascii.replace('\n', "\r").as_bytes()) {
            Err(SequenceError::Parse {
                place: Place::Line(line),
                ..
            }) => assert_eq!(line, 23),
            other => panic!("{other:?}"),
        }
        let good = ascii.replace(" x ", " 3 ") + "7 2 0 1 1 0.5";
        let mesh = read(good.as_bytes()).unwrap();
        assert_eq!(read(good.replace('\n', "\r").as_bytes()).unwrap(), mesh);
        // The first coordinate of a binary body may begin with a line feed.
        let text = header("binary_little_endian");
        let mut file = text.replace('\n', "\r").into_bytes();
        file.extend(&binary(false)[text.len()..]);
        file[text.len()] = b'\n';
        assert_eq!(read(&file).unwrap(), mesh);
    }

    #[test]
    fn texture_coordinates_and_colours_of_a_reference() {
        let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
        let by_vertex = format!(
            "{head}property float s\nproperty float t\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 0 .5 1 255 0 51\n1 0 0 0 0 0 0 0\n0 1 0 0 0 0 0 0\n3 2 0 1\n"
        );
        let mesh = parse(by_vertex.as_bytes(), Path::new("a"), true).unwrap();
        let texture = mesh.texture.unwrap();
        assert_eq!(
            (texture.uvs[0], texture.corners, mesh.is_split),
            ([0.5, 1.0], vec![2, 0, 1], true)
        );
        assert_eq!(mesh.dress.colors[0], [1.0, 0.0, 0.2, 1.0]);
        let by_corner = format!(
            "{head}element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n\
             0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 1 0\n"
        );
        let mesh = parse(by_corner.as_bytes(), Path::new("a"), true).unwrap();
        let texture = mesh.texture.unwrap();
        assert_eq!((texture.uvs[1], mesh.is_split), ([1.0, 0.0], false));
        assert_eq!(texture.corners, [0, 1, 2, UNTEXTURED, UNTEXTURED, UNTEXTURED]);
        assert_eq!(
            parse(by_corner.as_bytes(), Path::new("a"), false).unwrap().texture,
            None
        );
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
