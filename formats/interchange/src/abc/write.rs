//! Writes an Alembic archive: one polygon mesh under one transform, its points sample by sample.

use super::headers::Pod;
use crate::mesh::Dress;
use crate::scene::UpAxis;
use crate::write::{FrameWriter, Output, OutputSurface, WriteError, corners, reversed};
use std::path::Path;
use xxhash_rust::xxh3::xxh3_128;

/// Alembic's version of the container, and of the library whose files these are like.
const VERSIONS: [i32; 2] = [0, 10800];
const IS_DATA: u64 = 1 << 63;
/// Where the offset of the root group stands.
const ROOT_AT: u64 = 8;
/// Number of the sampling with one sample a frame.
const FRAMES: u32 = 1;
const MESH: &str = "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1";
const MESH_OBJECT: &str =
    "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1;schemaObjTitle=AbcGeom_PolyMesh_v1:.geom";
const TRANSFORM: &str = "schema=AbcGeom_Xform_v3";
const TRANSFORM_OBJECT: &str = "schema=AbcGeom_Xform_v3;schemaObjTitle=AbcGeom_Xform_v3:.xform";
const SET: &str = "schema=AbcGeom_FaceSet_v1";
const SET_OBJECT: &str = "schema=AbcGeom_FaceSet_v1;schemaObjTitle=AbcGeom_FaceSet_v1:.faceset";

/// A child of a group that has been written.
type Child = u64;

/// A property that has been written: its header and its group.
struct Written {
    header: Vec<u8>,
    group: Child,
}

/// Writes groups and data, children first.
struct Archive {
    out: Output,
}

impl Archive {
    fn data(&mut self, parts: &[&[u8]]) -> Result<Child, WriteError> {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        if length == 0 {
            return Ok(IS_DATA);
        }
        let at = self.out.length();
        self.out.put(&(length as u64).to_le_bytes())?;
        parts.iter().try_for_each(|part| self.out.put(part))?;
        Ok(at | IS_DATA)
    }

    /// A sample: its key, then its bytes.
    fn sample(&mut self, bytes: &[u8]) -> Result<Child, WriteError> {
        self.data(&[&xxh3_128(bytes).to_le_bytes(), bytes])
    }

    fn group(&mut self, children: &[Child]) -> Result<Child, WriteError> {
        if children.is_empty() {
            return Ok(0);
        }
        let at = self.out.length();
        self.out.put(&(children.len() as u64).to_le_bytes())?;
        children
            .iter()
            .try_for_each(|child| self.out.put(&child.to_le_bytes()))?;
        Ok(at)
    }

    /// A property with one sample.
    fn constant(&mut self, kind: &Values, name: &str, metadata: &str, bytes: &[u8]) -> Result<Written, WriteError> {
        let mut children = vec![self.sample(bytes)?];
        if kind.is_array {
            // Dimensions, which the bytes say for themselves.
            children.push(IS_DATA);
        }
        Ok(Written {
            header: kind.header(name, metadata, 1, None),
            group: self.group(&children)?,
        })
    }

    fn compound(&mut self, name: &str, metadata: &str, properties: Vec<Written>) -> Result<Written, WriteError> {
        let mut header = (2u32 << 2 | 0xff << 20).to_le_bytes().to_vec();
        named(&mut header, name, metadata);
        Ok(Written {
            header,
            group: self.properties(properties)?,
        })
    }

    fn properties(&mut self, properties: Vec<Written>) -> Result<Child, WriteError> {
        if properties.is_empty() {
            return Ok(0);
        }
        let mut children: Vec<Child> = properties.iter().map(|property| property.group).collect();
        let headers: Vec<&[u8]> = properties.iter().map(|property| &property.header[..]).collect();
        children.push(self.data(&headers)?);
        self.group(&children)
    }

    /// An object with its properties and the objects in it: name, metadata, group.
    fn object(&mut self, properties: Vec<Written>, inside: &[(String, &str, Child)]) -> Result<Child, WriteError> {
        let mut children = vec![self.properties(properties)?];
        let mut headers = Vec::new();
        for (name, metadata, group) in inside {
            headers.extend((name.len() as u32).to_le_bytes());
            headers.extend(name.bytes());
            headers.push(0xff);
            headers.extend((metadata.len() as u32).to_le_bytes());
            headers.extend(metadata.bytes());
            children.push(*group);
        }
        let hash = xxh3_128(&headers).to_le_bytes();
        let headers = self.data(&[&headers, &hash, &hash])?;
        children.push(headers);
        self.group(&children)
    }
}

fn named(header: &mut Vec<u8>, name: &str, metadata: &str) {
    header.extend((name.len() as u32).to_le_bytes());
    header.extend(name.bytes());
    header.extend((metadata.len() as u32).to_le_bytes());
    header.extend(metadata.bytes());
}

/// Type of a property's values.
struct Values {
    pod: Pod,
    extent: u32,
    is_array: bool,
}

impl Values {
    const fn array(pod: Pod, extent: u32) -> Values {
        Values {
            pod,
            extent,
            is_array: true,
        }
    }

    const fn scalar(pod: Pod, extent: u32) -> Values {
        Values {
            pod,
            extent,
            is_array: false,
        }
    }

    /// See `headers.rs` for the bits.
    fn header(&self, name: &str, metadata: &str, count: u32, sampling: Option<u32>) -> Vec<u8> {
        let kind = if self.is_array { 2 } else { 1 };
        let mut bits = kind | 2 << 2 | (self.pod as u32) << 4 | 0x400 | self.extent << 12 | 0xff << 20;
        if count == 1 {
            bits |= 0x800;
        }
        if sampling.is_some() {
            bits |= 0x100;
        }
        let mut header = bits.to_le_bytes().to_vec();
        header.extend(count.to_le_bytes());
        header.extend(sampling.into_iter().flat_map(u32::to_le_bytes));
        named(&mut header, name, metadata);
        header
    }
}

fn bytes_of<T, const N: usize>(values: impl IntoIterator<Item = T>, of: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    values.into_iter().flat_map(of).collect()
}

/// Writes frames as they come; faces and headers at the end.
struct AbcWriter {
    archive: Archive,
    name: String,
    fps: f64,
    up: Option<UpAxis>,
    faces: Vec<[u32; 3]>,
    uvs: Vec<[f32; 2]>,
    uv_faces: Vec<[u32; 3]>,
    dress: Dress,
    vertex_count: usize,
    points: Vec<Child>,
    bounds: Vec<Child>,
    buffer: Vec<u8>,
}

pub(super) fn open(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    let corners = corners(surface);
    let mut archive = Archive {
        out: Output::create(path)?,
    };
    // Signature, finished, version, root: the last is filled in at the end.
    archive.out.put(b"Ogawa\xff\0\x01")?;
    archive.out.put(&[0; 8])?;
    Ok(Box::new(AbcWriter {
        archive,
        // A slash parts names.
        name: surface.name.replace('/', "_"),
        fps: surface.fps,
        up: surface.up,
        faces: corners.faces.to_vec(),
        uvs: corners.uvs.to_vec(),
        uv_faces: corners.uv_faces.to_vec(),
        dress: surface.dress.clone(),
        vertex_count: surface.vertex_count,
        points: Vec::new(),
        bounds: Vec::new(),
        buffer: Vec::new(),
    }))
}

impl FrameWriter for AbcWriter {
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        crate::write::check_length(self.archive.out.path(), "a frame", positions.len(), self.vertex_count)?;
        self.buffer.clear();
        self.buffer
            .extend(positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        let sample = self.archive.sample(&self.buffer)?;
        self.points.extend([sample, IS_DATA]);
        let edge = |pick: fn(f32, f32) -> f32, start: f32| {
            (0..3)
                .map(move |c| positions.iter().map(|p| p[c]).fold(start, pick))
                .collect::<Vec<f32>>()
        };
        let corners = [edge(f32::min, f32::MAX), edge(f32::max, f32::MIN)].concat();
        let bounds = bytes_of(corners, |x| f64::from(x).to_le_bytes());
        self.bounds.push(self.archive.sample(&bounds)?);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), WriteError> {
        let frame_count = self.bounds.len();
        let Ok(count) = u32::try_from(frame_count) else {
            return Err(WriteError::TooLarge {
                path: self.archive.out.path().into(),
                format: super::FORMAT.name,
                count: frame_count,
                what: "frames",
            });
        };
        let geometry = self.geometry(count)?;
        let sets = self.sets()?;
        let mesh = self.archive.object(vec![geometry], &sets)?;
        let transform = self.transform()?;
        let inside = (format!("{}Shape", self.name), MESH_OBJECT, mesh);
        let node = self.archive.object(vec![transform], &[inside])?;
        let top = self
            .archive
            .object(Vec::new(), &[(self.name.clone(), TRANSFORM_OBJECT, node)])?;
        let [container, library] = VERSIONS.map(i32::to_le_bytes);
        let versions = [self.archive.data(&[&container])?, self.archive.data(&[&library])?];
        let about = format!("_ai_Application=Sinew {}", env!("CARGO_PKG_VERSION"));
        let about = self.archive.data(&[about.as_bytes()])?;
        let samplings = self.samplings(count)?;
        let root = self
            .archive
            .group(&[versions[0], versions[1], top, about, samplings, IS_DATA])?;
        self.archive.out.patch(ROOT_AT, &root.to_le_bytes())?;
        self.archive.out.commit()
    }
}

impl AbcWriter {
    /// The sampling that everything constant has, and that of the frames.
    fn samplings(&mut self, count: u32) -> Result<Child, WriteError> {
        let mut bytes = Vec::new();
        for (most, seconds) in [(1, 1.0), (count, 1.0 / self.fps)] {
            bytes.extend(u32::to_le_bytes(most));
            bytes.extend(f64::to_le_bytes(seconds));
            bytes.extend(1u32.to_le_bytes());
            bytes.extend(0.0f64.to_le_bytes());
        }
        self.archive.data(&[&bytes])
    }

    fn geometry(&mut self, count: u32) -> Result<Written, WriteError> {
        let points = Written {
            header: Values::array(Pod::F32, 3).header("P", "geoScope=vtx;interpretation=point", count, Some(FRAMES)),
            group: self.archive.group(&self.points)?,
        };
        let bounds = Written {
            header: Values::scalar(Pod::F64, 6).header(".selfBnds", "interpretation=box", count, Some(FRAMES)),
            group: self.archive.group(&self.bounds)?,
        };
        // Clockwise seen from outside.
        let indices = bytes_of(self.faces.iter().flat_map(|&face| reversed(face)), u32::to_le_bytes);
        let counts = bytes_of(core::iter::repeat_n(3u32, self.faces.len()), u32::to_le_bytes);
        let whole = Values::array(Pod::I32, 1);
        let mut properties = vec![
            bounds,
            points,
            self.archive.constant(&whole, ".faceIndices", "", &indices)?,
            self.archive.constant(&whole, ".faceCounts", "", &counts)?,
        ];
        if !self.uvs.is_empty() {
            let values = bytes_of(self.uvs.as_flattened().iter().copied(), f32::to_le_bytes);
            let indices = bytes_of(self.uv_faces.iter().flat_map(|&face| reversed(face)), u32::to_le_bytes);
            let inside = vec![
                self.archive
                    .constant(&Values::array(Pod::F32, 2), ".vals", "interpretation=vector", &values)?,
                self.archive
                    .constant(&Values::array(Pod::U32, 1), ".indices", "", &indices)?,
            ];
            let metadata = "geoScope=fvr;interpretation=vector;isGeomParam=true;podExtent=2;podName=float32_t";
            properties.push(self.archive.compound("uv", metadata, inside)?);
        }
        if !self.dress.colors.is_empty() {
            let values = bytes_of(self.dress.colors.as_flattened().iter().copied(), f32::to_le_bytes);
            let metadata = "geoScope=vtx;interpretation=rgba;isGeomParam=true;podExtent=4;podName=float32_t";
            let colors = self
                .archive
                .constant(&Values::array(Pod::F32, 4), "Col", metadata, &values)?;
            properties.push(self.archive.compound(".arbGeomParams", "", vec![colors])?);
        }
        self.archive.compound(".geom", MESH, properties)
    }

    /// A face set a material.
    fn sets(&mut self) -> Result<Vec<(String, &'static str, Child)>, WriteError> {
        let mut sets = Vec::new();
        for (material, name) in self.dress.materials.iter().enumerate() {
            let own = |&(_, &of): &(usize, &u32)| of as usize == material;
            let faces: Vec<i32> = self
                .dress
                .face_materials
                .iter()
                .enumerate()
                .filter(own)
                .map(|(f, _)| f as i32)
                .collect();
            if faces.is_empty() || name.is_empty() {
                continue;
            }
            let faces = bytes_of(faces, i32::to_le_bytes);
            let faces = self
                .archive
                .constant(&Values::array(Pod::I32, 1), ".faces", "", &faces)?;
            let compound = self.archive.compound(".faceset", SET, vec![faces])?;
            let object = self.archive.object(vec![compound], &[])?;
            sets.push((name.replace('/', "_"), SET_OBJECT, object));
        }
        Ok(sets)
    }

    /// Turns what points up to y, which it is in Alembic by custom.
    fn transform(&mut self) -> Result<Written, WriteError> {
        // Rotations about x and z, by their codes, and degrees.
        let turn = match self.up {
            Some(UpAxis::Z) => Some((0x40u8, -90.0f64)),
            Some(UpAxis::X) => Some((0x60, 90.0)),
            Some(UpAxis::Y) | None => None,
        };
        let mut properties = vec![
            self.archive
                .constant(&Values::scalar(Pod::Bool, 1), ".inherits", "", &[1])?,
        ];
        if let Some((code, degrees)) = turn {
            let angle = degrees.to_le_bytes();
            properties.push(
                self.archive
                    .constant(&Values::scalar(Pod::U8, 1), ".ops", "", &[code])?,
            );
            properties.push(
                self.archive
                    .constant(&Values::scalar(Pod::F64, 1), ".vals", "", &angle)?,
            );
            properties.push(
                self.archive
                    .constant(&Values::scalar(Pod::Bool, 1), "isNotConstantIdentity", "", &[1])?,
            );
        }
        self.archive.compound(".xform", TRANSFORM, properties)
    }
}
