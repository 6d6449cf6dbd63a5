//! Writes USD as text: one mesh whose points have a sample a frame.

use crate::mesh::Dress;
use crate::scene::UpAxis;
use crate::write::{FrameWriter, Output, OutputSurface, WriteError, check_length, corners};
use core::fmt::Write as _;
use std::path::Path;

/// Room for the number of the last frame, which is known at the end.
const NUMBER_WIDTH: usize = 10;

struct UsdWriter {
    out: Output,
    /// Where the number of the last frame stands.
    end_at: u64,
    vertex_count: usize,
    frame_count: usize,
    /// Lowest and highest corner of each frame's box.
    boxes: Vec<[[f32; 3]; 2]>,
    /// What stands behind the points.
    rest: String,
}

/// A name as USD allows it: letters, digits and `_`, the first no digit.
fn identifier(name: &str) -> String {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut own: String = name.chars().map(|c| if is_part(c) { c } else { '_' }).collect();
    if own.is_empty() || own.starts_with(|c: char| c.is_ascii_digit()) {
        own.insert(0, '_');
    }
    own
}

fn list<T>(items: impl Iterator<Item = T>, mut write: impl FnMut(&mut String, T)) -> String {
    let mut text = String::from("[");
    for (i, item) in items.enumerate() {
        if i > 0 {
            text.push_str(", ");
        }
        write(&mut text, item);
    }
    text.push(']');
    text
}

/// A tuple; numbers in the fewest digits that read back to the same bits.
fn tuple(text: &mut String, values: &[f32]) {
    text.push('(');
    for (i, value) in values.iter().enumerate() {
        let _ = write!(text, "{}{value:?}", if i > 0 { ", " } else { "" });
    }
    text.push(')');
}

fn numbers(items: impl Iterator<Item = u32>) -> String {
    list(items, |text, item| {
        let _ = write!(text, "{item}");
    })
}

pub(super) fn open(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    let is_text = path.extension().is_some_and(|extension| {
        ["usda", "usd"]
            .iter()
            .any(|written| extension.eq_ignore_ascii_case(written))
    });
    if !is_text {
        return Err(WriteError::UnknownKind { path: path.into() });
    }
    let name = identifier(surface.name);
    let mut out = Output::create(path)?;
    let mut head = format!(
        "#usda 1.0\n(\n    defaultPrim = \"{name}\"\n    doc = \"Sinew {}\"\n",
        env!("CARGO_PKG_VERSION")
    );
    let _ = writeln!(head, "    startTimeCode = 0");
    head.push_str("    endTimeCode = ");
    out.put(head.as_bytes())?;
    let end_at = out.length();
    let mut head = format!("{:NUMBER_WIDTH$}\n", 0);
    let fps = surface.fps;
    let _ = write!(head, "    timeCodesPerSecond = {fps}\n    framesPerSecond = {fps}\n");
    // Left out, they would mean centimetres with y up.
    let letter = match surface.up {
        Some(UpAxis::X) => "X",
        Some(UpAxis::Y) | None => "Y",
        Some(UpAxis::Z) => "Z",
    };
    let metres = surface.unit_metres.unwrap_or(1.0);
    let _ = write!(head, "    metersPerUnit = {metres}\n    upAxis = \"{letter}\"\n");
    let _ = write!(
        head,
        ")\n\ndef Mesh \"{name}\" (\n    prepend apiSchemas = [\"MaterialBindingAPI\"]\n)\n{{\n"
    );
    let faces = corners(surface);
    let _ = writeln!(head, "    uniform token subdivisionScheme = \"none\"");
    let _ = writeln!(
        head,
        "    int[] faceVertexCounts = {}",
        numbers(faces.faces.iter().map(|_| 3))
    );
    let _ = writeln!(
        head,
        "    int[] faceVertexIndices = {}",
        numbers(faces.faces.as_flattened().iter().copied())
    );
    if !faces.uvs.is_empty() {
        let uvs = list(faces.uvs.iter(), |text, uv| tuple(text, uv));
        let _ = writeln!(
            head,
            "    texCoord2f[] primvars:st = {uvs} (\n        interpolation = \"faceVarying\"\n    )"
        );
        let _ = writeln!(
            head,
            "    int[] primvars:st:indices = {}",
            numbers(faces.uv_faces.as_flattened().iter().copied())
        );
    }
    if !surface.dress.colors.is_empty() {
        let colors = list(surface.dress.colors.iter(), |text, color| tuple(text, &color[..3]));
        let _ = writeln!(
            head,
            "    color3f[] primvars:displayColor = {colors} (\n        interpolation = \"vertex\"\n    )"
        );
    }
    head.push_str("    point3f[] points.timeSamples = {\n");
    out.put(head.as_bytes())?;
    Ok(Box::new(UsdWriter {
        out,
        end_at,
        vertex_count: surface.vertex_count,
        frame_count: 0,
        boxes: Vec::new(),
        rest: materials(&name, surface.dress, faces.faces.len()),
    }))
}

/// Subsets of faces and the materials bound to them.
fn materials(mesh: &str, dress: &Dress, face_count: usize) -> String {
    let mut text = String::new();
    if dress.materials.iter().all(String::is_empty) || dress.face_materials.len() != face_count {
        return text;
    }
    text.push_str("    uniform token subsetFamily:materialBind:familyType = \"partition\"\n");
    let mut looks = String::from("\n    def Scope \"Looks\"\n    {\n");
    let mut taken: Vec<String> = Vec::new();
    for (material, name) in dress.materials.iter().enumerate() {
        let mut own = identifier(if name.is_empty() { "unnamed" } else { name });
        while taken.contains(&own) {
            own.push('_');
        }
        let faces = (0..face_count as u32).filter(|&face| dress.face_materials[face as usize] == material as u32);
        let _ = write!(
            text,
            "\n    def GeomSubset \"{own}\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {{\n        \
             uniform token elementType = \"face\"\n        uniform token familyName = \"materialBind\"\n        \
             int[] indices = {}\n        rel material:binding = </{mesh}/Looks/{own}>\n    }}\n",
            numbers(faces)
        );
        let _ = write!(looks, "        def Material \"{own}\"\n        {{\n        }}\n");
        taken.push(own);
    }
    looks.push_str("    }\n");
    text + &looks
}

impl FrameWriter for UsdWriter {
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        check_length(self.out.path(), "a frame", positions.len(), self.vertex_count)?;
        let points = list(positions.iter(), |text, p| tuple(text, p));
        self.out
            .put(format!("        {}: {points},\n", self.frame_count).as_bytes())?;
        let mut edges = [[f32::MAX; 3], [f32::MIN; 3]];
        for p in positions {
            for c in 0..3 {
                edges[0][c] = edges[0][c].min(p[c]);
                edges[1][c] = edges[1][c].max(p[c]);
            }
        }
        self.boxes.push(edges);
        self.frame_count += 1;
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), WriteError> {
        let mut text = String::from("    }\n    float3[] extent.timeSamples = {\n");
        for (frame, edges) in self.boxes.iter().enumerate() {
            let edges = list(edges.iter(), |text, edge| tuple(text, edge));
            let _ = writeln!(text, "        {frame}: {edges},");
        }
        text.push_str("    }\n");
        text.push_str(&self.rest);
        text.push_str("}\n");
        self.out.put(text.as_bytes())?;
        let last = format!("{:NUMBER_WIDTH$}", self.frame_count.saturating_sub(1));
        self.out.patch(self.end_at, last.as_bytes())?;
        self.out.commit()
    }
}
