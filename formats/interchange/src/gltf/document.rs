//! The JSON of a glTF file and its buffers. Only what meshes and their motion need is read: a fault in a material or a camera is no
//! reason to refuse a shape.

use crate::bytes::Bytes;
use crate::error::{Place, SequenceError};
use crate::text::unexpected;
use base64::Engine;
use serde::Deserialize;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

const GLB_SIGNATURE: &[u8; 4] = b"glTF";
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";
const GLB_HEADER_BYTES: u64 = 12;
const CHUNK_HEADER_BYTES: u64 = 8;

/// Required extensions that are read.
const KNOWN: [&str; 3] = [
    "KHR_mesh_quantization",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
];
/// Beginnings of the names of extensions that change no shape.
const HARMLESS: [&str; 9] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "EXT_texture_",
    "EXT_lights_",
    "MSFT_texture_",
    "VRM",
    "ADOBE_materials_",
];

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) accessors: Vec<Accessor>,
    pub(super) animations: Vec<Animation>,
    buffers: Vec<Buffer>,
    pub(super) buffer_views: Vec<View>,
    pub(super) materials: Vec<Named>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) nodes: Vec<Node>,
    pub(super) skins: Vec<Skin>,
    extensions_required: Vec<String>,
    asset: Asset,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Asset {
    version: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Named {
    pub(super) name: Option<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<Box<Sparse>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparsePart,
    pub(super) values: SparsePart,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct SparsePart {
    pub(super) buffer_view: usize,
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Buffer {
    uri: Option<String>,
    byte_length: u64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct View {
    buffer: usize,
    byte_offset: u64,
    byte_length: u64,
    pub(super) byte_stride: Option<u64>,
    extensions: Option<Box<ViewExtensions>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression", alias = "KHR_meshopt_compression")]
    meshopt: Option<Compressed>,
}

/// A view whose bytes are packed by meshoptimizer.
#[derive(Debug, Default, Clone, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Compressed {
    buffer: usize,
    byte_offset: u64,
    byte_length: u64,
    pub(super) byte_stride: u64,
    pub(super) count: u64,
    pub(super) mode: String,
    pub(super) filter: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) name: Option<String>,
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Vec<f64>,
    pub(super) extras: MeshExtras,
}

/// By custom, names of morph targets stand here.
#[derive(Debug, Default)]
pub(super) struct MeshExtras {
    pub(super) target_names: Vec<String>,
}

impl<'de> Deserialize<'de> for MeshExtras {
    /// Takes names where they are, whatever else stands there.
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        let names = value.get("targetNames").and_then(serde_json::Value::as_array);
        let target_names = names
            .into_iter()
            .flatten()
            .map(|name| name.as_str().unwrap_or_default().to_owned())
            .collect();
        Ok(MeshExtras { target_names })
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: HashMap<String, usize>,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: Option<u32>,
    pub(super) targets: Vec<HashMap<String, usize>>,
    extensions: HashMap<String, serde::de::IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) name: Option<String>,
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) matrix: Option<Box<[f64; 16]>>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Vec<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) joints: Vec<usize>,
    pub(super) inverse_bind_matrices: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    pub(super) name: Option<String>,
    pub(super) channels: Vec<Channel>,
    pub(super) samplers: Vec<Sampler>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Channel {
    pub(super) sampler: usize,
    pub(super) target: Target,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Target {
    pub(super) node: Option<usize>,
    pub(super) path: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Sampler {
    pub(super) input: usize,
    pub(super) output: usize,
    pub(super) interpolation: Option<String>,
}

/// A document and the buffers behind it, opened where they are wanted.
pub(super) struct Store {
    pub(super) document: Document,
    path: PathBuf,
    buffers: Vec<Option<Bytes>>,
    /// Bytes of the file, the JSON and all buffers: no damage makes more of them than a multiple.
    pub(super) total_bytes: u64,
}

impl Store {
    /// Opens a `.gltf`, `.glb` or `.vrm` file.
    pub(super) fn open(path: &Path) -> Result<Store, SequenceError> {
        let mut bytes = Bytes::open(path)?;
        let mut binary = None;
        let total_bytes = bytes.len();
        let json = if bytes.head(4)? == GLB_SIGNATURE {
            let (json, chunk) = chunks(&mut bytes)?;
            binary = chunk.map(|(start, length)| bytes.part(start, length, path.into()));
            json
        } else {
            bytes.head(u64::MAX)?
        };
        let document = parse(&json, path)?;
        let buffers = (0..document.buffers.len()).map(|_| None).collect();
        let mut store = Store {
            document,
            path: path.into(),
            buffers,
            total_bytes,
        };
        store.check()?;
        // The first buffer without a place of its own is the binary chunk.
        if let (Some(binary), Some(buffer)) = (binary, store.document.buffers.first())
            && buffer.uri.is_none()
        {
            store.buffers[0] = Some(binary);
        }
        Ok(store)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The error for something in the document that cannot be.
    pub(super) fn refuse(&self, expected: impl Into<String>, found: impl Into<String>) -> SequenceError {
        SequenceError::Content {
            path: self.path.clone(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// Refuses what would be read wrongly.
    fn check(&self) -> Result<(), SequenceError> {
        let unsupported = |what: String, advice: &str| SequenceError::Unsupported {
            path: self.path.clone(),
            what,
            advice: advice.into(),
        };
        let version = &self.document.asset.version;
        if !version.starts_with("2.") {
            return Err(unsupported(
                format!("glTF of version `{version}`,"),
                "export it as glTF 2.0",
            ));
        }
        let primitives = self.document.meshes.iter().flat_map(|mesh| &mesh.primitives);
        let mut extensions = primitives.flat_map(|primitive| primitive.extensions.keys());
        let required = &self.document.extensions_required;
        let draco = "KHR_draco_mesh_compression";
        if required.iter().any(|name| name == draco) || extensions.any(|name| name == draco) {
            let advice = "export it without Draco compression, or unpack it with `gltf-transform copy IN OUT`";
            return Err(unsupported(
                "a glTF file with Draco-compressed meshes (KHR_draco_mesh_compression),".into(),
                advice,
            ));
        }
        let strange = required
            .iter()
            .find(|name| !KNOWN.contains(&name.as_str()) && !HARMLESS.iter().any(|start| name.starts_with(start)));
        match strange {
            Some(name) => Err(unsupported(
                format!("a glTF file that needs the extension {name},"),
                "export it without",
            )),
            None => Ok(()),
        }
    }

    /// The bytes of a buffer.
    fn buffer(&mut self, index: usize) -> Result<&mut Bytes, SequenceError> {
        let Some(buffer) = self.document.buffers.get(index) else {
            return Err(self.refuse(
                format!("one of {} buffers", self.document.buffers.len()),
                format!("buffer {index}"),
            ));
        };
        if self.buffers[index].is_none() {
            let Some(uri) = buffer.uri.as_deref() else {
                return Err(self.refuse(
                    "a binary chunk, or a buffer with a place",
                    format!("buffer {index} without one"),
                ));
            };
            let bytes = if let Some(data) = uri.strip_prefix("data:") {
                let text = data.split_once(";base64,").map(|(_, text)| text);
                let decoded = text.and_then(|text| base64::engine::general_purpose::STANDARD.decode(text).ok());
                let decoded = decoded.ok_or_else(|| self.refuse("base64 in a data URI", format!("buffer {index}")))?;
                Bytes::of_memory(decoded, &self.path)
            } else if uri.contains("://") {
                return Err(self.refuse(
                    "buffers beside the file",
                    format!("`{uri}`, which would have to be downloaded"),
                ));
            } else {
                let bytes = Bytes::open(&self.path.with_file_name(unescaped(uri)))?;
                self.total_bytes += bytes.len();
                bytes
            };
            if bytes.len() < buffer.byte_length {
                let found = format!("{} bytes", bytes.len());
                return Err(unexpected(
                    bytes.path(),
                    Place::Byte(bytes.len() as usize),
                    &format!("{} bytes of buffer {index}", buffer.byte_length),
                    Some(found.as_bytes()),
                ));
            }
            self.buffers[index] = Some(bytes);
        }
        match &mut self.buffers[index] {
            Some(bytes) => Ok(bytes),
            None => Err(SequenceError::UnknownKind {
                path: self.path.clone(),
            }),
        }
    }

    /// How a view is packed, if it is.
    pub(super) fn compressed(&self, view: usize) -> Option<Compressed> {
        let view = self.document.buffer_views.get(view)?;
        view.extensions
            .as_ref()
            .and_then(|extensions| extensions.meshopt.clone())
    }

    /// The packed bytes of a view.
    pub(super) fn packed(&mut self, compressed: &Compressed) -> Result<Vec<u8>, SequenceError> {
        self.buffer(compressed.buffer)?
            .vec_at(compressed.byte_offset, compressed.byte_length)
    }

    /// Bytes of a view that is not packed.
    pub(super) fn view(&mut self, index: usize, offset: u64, length: u64) -> Result<Vec<u8>, SequenceError> {
        let Some(view) = self.document.buffer_views.get(index) else {
            let count = self.document.buffer_views.len();
            return Err(self.refuse(format!("one of {count} buffer views"), format!("buffer view {index}")));
        };
        let (buffer, start, whole) = (view.buffer, view.byte_offset, view.byte_length);
        if offset.checked_add(length).is_none_or(|end| end > whole) {
            let expected = format!("{length} bytes from byte {offset} of buffer view {index} on");
            return Err(self.refuse(expected, format!("{whole} bytes")));
        }
        match start.checked_add(offset) {
            Some(at) => self.buffer(buffer)?.vec_at(at, length),
            None => Err(self.refuse("a buffer view inside its buffer", format!("byte {start}"))),
        }
    }
}

/// The JSON of a binary file, and where its binary chunk lies.
fn chunks(bytes: &mut Bytes) -> Result<(Vec<u8>, Option<(u64, u64)>), SequenceError> {
    let path = bytes.path().to_path_buf();
    let version = u32::from_le_bytes(bytes.array_at(4)?);
    if version != 2 {
        return Err(SequenceError::Unsupported {
            path,
            what: format!("binary glTF of version {version},"),
            advice: "export it as glTF 2.0".into(),
        });
    }
    let (kind, start, length) = chunk(bytes, GLB_HEADER_BYTES)?;
    if &kind != JSON_CHUNK {
        return Err(unexpected(
            &path,
            Place::Byte(GLB_HEADER_BYTES as usize + 4),
            "a chunk of JSON",
            Some(&kind),
        ));
    }
    let json = bytes.vec_at(start, length)?;
    let next = start + length;
    if next + CHUNK_HEADER_BYTES > bytes.len() {
        return Ok((json, None));
    }
    let (kind, start, length) = chunk(bytes, next)?;
    Ok((json, (&kind == BINARY_CHUNK).then_some((start, length))))
}

/// Kind, start and length of the chunk at `at`.
fn chunk(bytes: &mut Bytes, at: u64) -> Result<([u8; 4], u64, u64), SequenceError> {
    let length = u64::from(u32::from_le_bytes(bytes.array_at(at)?));
    let kind = bytes.array_at(at + 4)?;
    let start = at + CHUNK_HEADER_BYTES;
    if length > bytes.len() - start {
        let found = format!("{} bytes", bytes.len() - start);
        let expected = format!("a chunk of {length} bytes");
        return Err(unexpected(
            bytes.path(),
            Place::Byte(at as usize),
            &expected,
            Some(found.as_bytes()),
        ));
    }
    Ok((kind, start, length))
}

fn parse(json: &[u8], path: &Path) -> Result<Document, SequenceError> {
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    serde_json::from_slice(json).map_err(|error| SequenceError::Parse {
        path: path.into(),
        place: Place::Line(error.line()),
        expected: "the JSON of a glTF file".into(),
        found: error.to_string(),
    })
}

/// A path in which `%20` stands for a space, and so on.
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, behind @ ..] = rest {
        let code = if *first == b'%' {
            behind.first_chunk::<2>()
        } else {
            None
        };
        let code = code
            .and_then(|code| core::str::from_utf8(code).ok())
            .and_then(|code| u8::from_str_radix(code, 16).ok());
        match code {
            Some(code) => {
                bytes.push(code);
                rest = &behind[2..];
            }
            None => {
                bytes.push(*first);
                rest = behind;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::unescaped;

    #[test]
    fn escapes_in_names_of_buffers() {
        assert_eq!(unescaped("my%20data%2.bin%C3%A4%"), "my data%2.bin\u{e4}%");
    }
}
