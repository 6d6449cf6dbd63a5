//! What every glTF file that is written has in common: arrays behind the JSON, and what is drawn of a surface.

use crate::write::{Output, OutputSurface, WriteError};
use serde_json::{Value, json};

pub(super) const FLOAT: u32 = 5126;
pub(super) const U8: u32 = 5121;
pub(super) const U16: u32 = 5123;
pub(super) const U32: u32 = 5125;
/// What viewers bind vertices and indices to.
pub(super) const ARRAY: u32 = 34962;
pub(super) const ELEMENTS: u32 = 34963;
/// Arrays as they are written, and what the JSON says of them.
pub(super) struct Arrays {
    pub(super) out: Output,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
}

impl Arrays {
    /// Adds an array; gives its number.
    pub(super) fn add(
        &mut self,
        bytes: &[u8],
        component: u32,
        kind: &str,
        count: usize,
        more: Value,
    ) -> Result<usize, WriteError> {
        let at = self.out.length();
        self.out.put(bytes)?;
        // Every array begins at a multiple of four bytes.
        let padding = bytes.len().next_multiple_of(4) - bytes.len();
        self.out.put(&[0; 4][..padding])?;
        let mut view = json!({ "buffer": 0, "byteOffset": at, "byteLength": bytes.len() });
        let mut accessor = json!({
            "bufferView": self.views.len(), "componentType": component, "type": kind, "count": count,
        });
        if let (Some(view), Some(accessor), Value::Object(more)) =
            (view.as_object_mut(), accessor.as_object_mut(), more)
        {
            for (key, value) in more {
                if key == "target" {
                    view.insert(key, value)
                } else {
                    accessor.insert(key, value)
                };
            }
        }
        self.views.push(view);
        self.accessors.push(accessor);
        Ok(self.accessors.len() - 1)
    }

    /// Adds moments in seconds, rising.
    pub(super) fn times(&mut self, times: &[f32]) -> Result<usize, WriteError> {
        let bytes: Vec<u8> = times.iter().flat_map(|time| time.to_le_bytes()).collect();
        let range = json!({ "min": [times.first()], "max": [times.last()] });
        self.add(&bytes, FLOAT, "SCALAR", times.len(), range)
    }

    /// Adds rows of numbers that are no vertices: kinds are those of the specification, `VEC3` and so on.
    pub(super) fn rows<const N: usize>(&mut self, kind: &str, rows: &[[f32; N]]) -> Result<usize, WriteError> {
        let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        self.add(&bytes, FLOAT, kind, rows.len(), json!({}))
    }

    /// Adds vectors of vertices, with the range that the specification wants of positions.
    pub(super) fn vectors(&mut self, vectors: &[[f32; 3]], with_range: bool) -> Result<usize, WriteError> {
        let bytes: Vec<u8> = vectors.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let edge = |pick: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
            (0..3).map(|c| vectors.iter().map(|p| p[c]).fold(start, pick)).collect()
        };
        let more = if with_range && !vectors.is_empty() {
            json!({ "target": ARRAY, "min": edge(f32::min, f32::MAX), "max": edge(f32::max, f32::MIN) })
        } else {
            json!({ "target": ARRAY })
        };
        self.add(&bytes, FLOAT, "VEC3", vectors.len(), more)
    }
}

/// What is drawn: render vertices, the first of each vertex in the order of the vertices, then the others. So those who weld seams again
/// find the vertices in their order.
pub(super) struct Drawn {
    /// The vertex that each stands for.
    pub(super) split: Vec<u32>,
    pub(super) faces: Vec<[u32; 3]>,
    /// None where all are alike: then they only keep seams of normals.
    pub(super) uvs: Option<Vec<[f32; 2]>>,
}

impl Drawn {
    pub(super) fn of(surface: &OutputSurface<'_>) -> Drawn {
        let mut drawn = Drawn {
            split: (0..surface.vertex_count as u32).collect(),
            faces: surface.faces.to_vec(),
            uvs: None,
        };
        let Some(render) = surface.render else { return drawn };
        let mut uvs = vec![[0.0; 2]; drawn.split.len()];
        let mut is_taken = vec![false; drawn.split.len()];
        let mut places = Vec::with_capacity(render.vertices.len());
        for (&v, &uv) in render.vertices.iter().zip(&render.uvs) {
            if core::mem::replace(&mut is_taken[v as usize], true) {
                places.push(drawn.split.len() as u32);
                drawn.split.push(v);
                uvs.push(uv);
            } else {
                places.push(v);
                uvs[v as usize] = uv;
            }
        }
        drawn.faces = render
            .faces
            .iter()
            .map(|face| face.map(|r| places[r as usize]))
            .collect();
        drawn.uvs = render.uvs.iter().any(|uv| *uv != render.uvs[0]).then_some(uvs);
        drawn
    }
}
