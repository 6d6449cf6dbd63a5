//! MD2, the animated mesh of Quake II and of what came after it: one mesh, its frames as bytes with a scale and an offset each. All
//! frames are one clip; their names ("run3") are kept.

use super::bytes::Bytes;
use super::error::{Place, SequenceError};
use super::folder::file_name;
use super::format::{Format, Reading};
use super::mesh::{CornerTexture, PolygonMesh};
use super::scene::{ClipEntry, Contents, MeshEntry, Moment, Motion, Scene, Space, UpAxis};
use super::text::unexpected;
use std::path::Path;

pub(super) const FORMAT: Format = Format {
    name: "MD2",
    extensions: &["md2"],
    reading: Reading::Scene(|path, _| Ok(Box::new(Md2::open(Bytes::open(path)?)?))),
    writing: None,
};

/// Seventeen little-endian i32.
const HEADER_BYTES: usize = 68;
/// Scale, offset and name in front of a frame's points.
const FRAME_HEAD_BYTES: u64 = 40;
const NAME_AT: u64 = 24;
const NAME_BYTES: usize = 16;
/// Three bytes and the number of a normal.
const POINT_BYTES: u64 = 4;
/// Three u16 for points, three for texture coordinates.
const TRIANGLE_BYTES: u64 = 12;
/// Two i16, in pixels of the skin.
const TEXTURE_BYTES: u64 = 4;

struct Md2 {
    bytes: Bytes,
    mesh: PolygonMesh,
    contents: Contents,
    frame_names: Vec<String>,
    /// Bytes from the start of the file, and from frame to frame.
    frames_at: u64,
    frame_bytes: u64,
}

/// The fields of the header that are read.
struct Header {
    skin: [i32; 2],
    frame_bytes: u64,
    points: u64,
    textures: u64,
    triangles: u64,
    frames: u64,
    textures_at: u64,
    triangles_at: u64,
    frames_at: u64,
}

impl Header {
    fn read(bytes: &mut Bytes) -> Result<Header, SequenceError> {
        let path = bytes.path().to_path_buf();
        let raw: [u8; HEADER_BYTES] = bytes.array_at(0)?;
        if raw[..4] != *b"IDP2" {
            return Err(unexpected(&path, Place::Byte(0), "the signature IDP2", Some(&raw[..4])));
        }
        let number = |field: usize| {
            let at = 4 * field;
            i32::from_le_bytes([raw[at], raw[at + 1], raw[at + 2], raw[at + 3]])
        };
        if number(1) != 8 {
            let found = number(1).to_string();
            return Err(unexpected(&path, Place::Byte(4), "version 8", Some(found.as_bytes())));
        }
        let count = |field: usize, what: &str| {
            u64::try_from(number(field)).map_err(|_| {
                let found = number(field).to_string();
                unexpected(&path, Place::Byte(4 * field), what, Some(found.as_bytes()))
            })
        };
        Ok(Header {
            skin: [number(2), number(3)],
            frame_bytes: count(4, "bytes of a frame")?,
            points: count(6, "a count of vertices")?,
            textures: count(7, "a count of texture coordinates")?,
            triangles: count(8, "a count of triangles")?,
            frames: count(10, "a count of frames")?,
            textures_at: count(12, "where texture coordinates are")?,
            triangles_at: count(13, "where triangles are")?,
            frames_at: count(14, "where frames are")?,
        })
    }
}

impl Md2 {
    fn open(mut bytes: Bytes) -> Result<Md2, SequenceError> {
        let path = bytes.path().to_path_buf();
        let header = Header::read(&mut bytes)?;
        // Before anything is made as large as a count says.
        let fits = |at: u64, count: u64, each: u64| {
            count
                .checked_mul(each)
                .and_then(|size| size.checked_add(at))
                .is_some_and(|end| end <= bytes.len())
        };
        for (what, byte, at, count, each) in [
            ("triangles", 32, header.triangles_at, header.triangles, TRIANGLE_BYTES),
            (
                "texture coordinates",
                28,
                header.textures_at,
                header.textures,
                TEXTURE_BYTES,
            ),
            ("frames", 40, header.frames_at, header.frames, header.frame_bytes),
        ] {
            if !fits(at, count, each) {
                return Err(SequenceError::Parse {
                    path,
                    place: Place::Byte(byte),
                    expected: format!("{what} that the file holds"),
                    found: format!(
                        "{count} of {each} bytes from byte {at} on, in a file of {} bytes",
                        bytes.len()
                    ),
                });
            }
        }
        let least = FRAME_HEAD_BYTES + POINT_BYTES * header.points;
        if header.points == 0 || header.frames == 0 || header.frame_bytes < least {
            return Err(SequenceError::Parse {
                path,
                place: Place::Byte(16),
                expected: "frames with vertices".into(),
                found: format!(
                    "{} frames of {} vertices in {} bytes",
                    header.frames, header.points, header.frame_bytes
                ),
            });
        }
        let mut mesh = read_faces(&mut bytes, &header, &path)?;
        let mut frame_names = Vec::new();
        for frame in 0..header.frames {
            let name: [u8; NAME_BYTES] = bytes.array_at(header.frames_at + frame * header.frame_bytes + NAME_AT)?;
            let end = name.iter().position(|&byte| byte == 0).unwrap_or(NAME_BYTES);
            frame_names.push(String::from_utf8_lossy(&name[..end]).into_owned());
        }
        let mut md2 = Md2 {
            contents: Contents::default(),
            mesh: PolygonMesh::default(),
            frame_names,
            frames_at: header.frames_at,
            frame_bytes: header.frame_bytes,
            bytes,
        };
        mesh.positions = vec![[0.0; 3]; header.points as usize];
        md2.read_frame(0, &mut mesh.positions)?;
        md2.mesh = mesh.checked(&path)?;
        md2.contents = Contents {
            format: FORMAT.name,
            meshes: vec![MeshEntry {
                name: file_name(&path),
                vertex_count: md2.mesh.positions.len(),
                face_count: md2.mesh.face_count(),
                joint_count: 0,
                morphs: Vec::new(),
                motion: if header.frames > 1 {
                    Motion::Deforms
                } else {
                    Motion::Still
                },
            }],
            clips: vec![ClipEntry::untimed(file_name(&path), header.frames as usize)],
            up: Some(UpAxis::Z),
            ..Contents::default()
        };
        Ok(md2)
    }

    /// A frame's points into `out`, which has as many.
    fn read_frame(&mut self, frame: usize, out: &mut [[f32; 3]]) -> Result<(), SequenceError> {
        let at = self.frames_at + frame as u64 * self.frame_bytes;
        let head: [u8; NAME_AT as usize] = self.bytes.array_at(at)?;
        let float = |n: usize| f32::from_le_bytes([head[4 * n], head[4 * n + 1], head[4 * n + 2], head[4 * n + 3]]);
        let raw = self
            .bytes
            .vec_at(at + FRAME_HEAD_BYTES, POINT_BYTES * out.len() as u64)?;
        for (point, raw) in out.iter_mut().zip(raw.as_chunks::<4>().0) {
            *point = core::array::from_fn(|c| f32::from(raw[c]) * float(c) + float(3 + c));
        }
        Ok(())
    }
}

/// Triangles and texture coordinates. The format winds its faces clockwise; here they turn the other way.
fn read_faces(bytes: &mut Bytes, header: &Header, path: &Path) -> Result<PolygonMesh, SequenceError> {
    let raw = bytes.vec_at(header.triangles_at, TRIANGLE_BYTES * header.triangles)?;
    let mut mesh = PolygonMesh::default();
    let mut texture = CornerTexture::default();
    for (t, raw) in raw.as_chunks::<{ TRIANGLE_BYTES as usize }>().0.iter().enumerate() {
        for corner in [0, 2, 1] {
            let number = |at: usize| u32::from(u16::from_le_bytes([raw[at], raw[at + 1]]));
            let (point, uv) = (number(2 * corner), number(6 + 2 * corner));
            for (index, count, what) in [
                (point, header.points, "vertices"),
                (uv, header.textures.max(1), "texture coordinates"),
            ] {
                if u64::from(index) >= count {
                    return Err(SequenceError::Parse {
                        path: path.into(),
                        place: Place::Byte((header.triangles_at + t as u64 * TRIANGLE_BYTES) as usize),
                        expected: format!("an index below {count}, for there are so many {what}"),
                        found: format!("{index} in triangle {t}"),
                    });
                }
            }
            mesh.corners.push(point);
            texture.corners.push(uv);
        }
        mesh.end_face();
    }
    if header.textures > 0 && header.skin.iter().all(|&side| side > 0) {
        let raw = bytes.vec_at(header.textures_at, TEXTURE_BYTES * header.textures)?;
        let side = header.skin.map(|side| side as f32);
        let uvs = raw.as_chunks::<4>().0.iter().map(|raw| {
            let [u, v] = [[raw[0], raw[1]], [raw[2], raw[3]]].map(|x| f32::from(i16::from_le_bytes(x)));
            // Pixels count downwards.
            [u / side[0], 1.0 - v / side[1]]
        });
        texture.uvs = uvs.collect();
        mesh.texture = Some(texture);
    }
    Ok(mesh)
}

impl Scene for Md2 {
    fn contents(&self) -> &Contents {
        &self.contents
    }

    fn geometry(&mut self, _: usize) -> Result<PolygonMesh, SequenceError> {
        Ok(self.mesh.clone())
    }

    fn positions(&mut self, _: usize, moment: Moment, _: Space, out: &mut Vec<[f32; 3]>) -> Result<(), SequenceError> {
        let frame = match moment {
            Moment::Rest => 0,
            // Frames have numbers, not times.
            Moment::At { time, .. } => (time as usize).min(self.frame_names.len() - 1),
        };
        out.clear();
        out.resize(self.mesh.positions.len(), [0.0; 3]);
        self.read_frame(frame, out)
    }

    fn frame_name(&self, _: usize, frame: usize) -> String {
        let name = self.frame_names.get(frame).map_or("", String::as_str);
        format!("{}[{frame}] ({name})", self.contents.meshes[0].name)
    }
}
