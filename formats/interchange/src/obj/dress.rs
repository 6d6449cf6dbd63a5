//! Texture coordinates, materials and colours of an OBJ reference: a second, lenient reading of its `vt`, `usemtl`, `v` and `f`
//! lines. Shapes never need them, so a fault costs these and not the sequence.

use crate::mesh::{CornerTexture, Dress, PolygonMesh, UNTEXTURED};
use crate::text::{Lines, decoded, integer, number, tokens};
use std::collections::HashMap;

/// Adds what `mesh`, which was read from the same bytes, wears.
///
/// Errors: the line whose texture coordinate or index is wrong.
pub(super) fn add(bytes: &[u8], mesh: &mut PolygonMesh) -> Result<(), String> {
    let bytes = &*decoded(bytes);
    let mut reading = Reading::default();
    let mut lines = Lines::new(bytes);
    while let Some((line, text)) = lines.next(super::is_continued) {
        reading.take(text, line).ok_or_else(|| refusal(line))?;
    }
    // A face may name texture coordinates that only follow it, so indices are held against their count here.
    if reading.largest as usize > reading.texture.uvs.len() {
        return Err(refusal(reading.largest_line));
    }
    let is_textured = reading.texture.corners.iter().any(|&uv| uv != UNTEXTURED);
    mesh.texture = is_textured.then_some(reading.texture);
    mesh.dress = reading.dress;
    // Colours of some vertices alone are none.
    if mesh.dress.colors.len() != mesh.positions.len() {
        mesh.dress.colors = Vec::new();
    }
    Ok(())
}

fn refusal(line: usize) -> String {
    format!("the reference's line {line} has one that is no finite number, or an index of none")
}

#[derive(Default)]
struct Reading {
    texture: CornerTexture,
    dress: Dress,
    materials: HashMap<Vec<u8>, u32>,
    material: u32,
    face_count: usize,
    /// The largest index of a texture coordinate, counted from 1, and the line that first names one as large.
    largest: u32,
    largest_line: usize,
}

impl Reading {
    /// Takes a line; none if something on it is wrong.
    fn take(&mut self, text: &[u8], line: usize) -> Option<()> {
        let mut words = tokens(text);
        match words.next() {
            Some(b"v") => self.dress.colors.extend(color(words.skip(3))),
            Some(b"vt") => {
                let u = words.next().and_then(number)?;
                // A texture may have one dimension.
                let v = words.next().map_or(Some(0.0), number)?;
                self.texture.uvs.push([u, v]);
            }
            Some(b"usemtl") => self.use_material(words.next().unwrap_or_default()),
            Some(b"f") => self.face(words, line)?,
            _ => {}
        }
        Some(())
    }

    fn use_material(&mut self, name: &[u8]) {
        if self.materials.is_empty() && self.face_count > 0 {
            // Faces before the first word of a material have one without a name.
            self.name_material(b"");
            self.dress.face_materials = vec![0; self.face_count];
        }
        self.material = self.name_material(name);
    }

    fn name_material(&mut self, name: &[u8]) -> u32 {
        let next = self.dress.materials.len() as u32;
        *self.materials.entry(name.to_vec()).or_insert_with(|| {
            self.dress.materials.push(String::from_utf8_lossy(name).into_owned());
            next
        })
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>, line: usize) -> Option<()> {
        let first = self.texture.corners.len();
        for word in words {
            let index = index_of(word, self.texture.uvs.len())?;
            if index != UNTEXTURED && index >= self.largest {
                (self.largest, self.largest_line) = (index + 1, line);
            }
            self.texture.corners.push(index);
        }
        if self.texture.corners.len() - first < 3 {
            self.texture.corners.truncate(first);
            return Some(());
        }
        self.face_count += 1;
        if !self.materials.is_empty() {
            self.dress.face_materials.push(self.material);
        }
        Some(())
    }
}

/// Red, green and blue behind a position, where there are just these three.
fn color<'a>(words: impl Iterator<Item = &'a [u8]>) -> Option<[f32; 4]> {
    let numbers: Vec<Option<f32>> = words.take(4).map(number).collect();
    match numbers[..] {
        [Some(red), Some(green), Some(blue)] => Some([red, green, blue, 1.0]),
        _ => None,
    }
}

/// Texture coordinate of the corner `v/vt` or `v/vt/vn`, counted from 0.
fn index_of(word: &[u8], so_far: usize) -> Option<u32> {
    let text = word.split(|&b| b == b'/').nth(1).unwrap_or_default();
    if text.is_empty() {
        return Some(UNTEXTURED);
    }
    let index = integer(text)?;
    let from_one = if index < 0 {
        (so_far as i64 + 1).checked_add(index)?
    } else {
        index
    };
    (1..i64::from(u32::MAX))
        .contains(&from_one)
        .then(|| (from_one - 1) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::RenderSurface;
    use crate::surface::Surface;
    use std::path::Path;

    fn dressed(text: &str) -> Result<PolygonMesh, String> {
        let mut mesh = PolygonMesh::parse(text.as_bytes(), Path::new("a.obj")).unwrap();
        add(text.as_bytes(), &mut mesh)?;
        Ok(mesh)
    }

    fn render(text: &str) -> Option<RenderSurface> {
        let surface = Surface::new(&dressed(text).unwrap(), None, Path::new("a.obj")).unwrap();
        if let Some(render) = &surface.render {
            let corners: Vec<[u32; 3]> = render
                .faces
                .iter()
                .map(|face| face.map(|r| render.vertices[r as usize]))
                .collect();
            assert_eq!(corners, surface.faces);
        }
        surface.render
    }

    const SQUARES: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n";

    #[test]
    fn a_seam_gives_its_vertices_two_render_vertices() {
        let text = format!(
            "{SQUARES}vt 0 0\nvt .5 0 0\nvt .5 1\nvt 0 1\nvt 0.25\nvt 1 0\nf 1/1 2/2 3/3 4/4\nf 1 2\nf 2/5/7 5/-1 6/6 3/3\n"
        );
        let found = render(&text).unwrap();
        assert_eq!(found.vertices, [0, 1, 2, 3, 1, 4, 5]);
        assert_eq!(
            found.uvs[..5],
            [[0.0, 0.0], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0], [0.25, 0.0]]
        );
        assert_eq!(found.uvs[5..], [[1.0, 0.0]; 2]);
        assert_eq!(found.faces.len(), 4);
    }

    #[test]
    fn no_texture_is_none_and_a_part_of_one_is_filled_up() {
        assert_eq!(render(&format!("{SQUARES}vt 0 0\nf 1 2 3\nf 1//1 3//1 4//1\n")), None);
        let found = render(&format!("{SQUARES}f 1 2 3\nf 1/1 3/1 4/1\nvt .5 .5\n")).unwrap();
        assert_eq!(found.vertices, [0, 1, 2, 0, 2, 3]);
        assert_eq!(found.uvs, [[0.0; 2], [0.0; 2], [0.0; 2], [0.5; 2], [0.5; 2], [0.5; 2]]);
    }

    #[test]
    fn polygons_that_name_a_vertex_twice_are_split_alike() {
        // The second corner repeats the first vertex with another texture coordinate: its triangle is dropped all the same.
        let text = format!("{SQUARES}vt 0 0\nvt 1 1\nf 1/1 1/2 2/1\nf 1/1 2/1 3/1 3/2 4/2\nf 1/1 5/1 6/2 3/1 4/1\n");
        assert!(render(&text).is_some());
    }

    #[test]
    fn materials_and_colours() {
        let text = "v 0 0 0 1 .5 0\nv 1 0 0 0 0 0\nv 1 1 0 0 0 1\nf 1 2 3\nusemtl skin\nf 1 2 3\nf 1 2\nusemtl hair\nf 3 2 1\nusemtl skin\nf 2 3 1\n";
        let dress = dressed(text).unwrap().dress;
        assert_eq!(dress.materials, ["", "skin", "hair"]);
        assert_eq!(dress.face_materials, [0, 1, 2, 1]);
        assert_eq!(
            dress.colors,
            [[1.0, 0.5, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]
        );
        assert_eq!(
            dressed(&text.replace("v 1 1 0 0 0 1", "v 1 1 0 1"))
                .unwrap()
                .dress
                .colors
                .len(),
            0
        );
        assert_eq!(
            dressed("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").unwrap().dress,
            Dress::default()
        );
    }

    #[test]
    fn faults_name_their_line() {
        for (rest, line) in [
            ("vt x 0\nf 1/1 2/1 3/1\n", 7),
            ("vt nan 0\nf 1/1 2/1 3/1\n", 7),
            ("vt\nf 1/1 2/1 3/1\n", 7),
            ("vt 0 0\nf 1/1 2/2 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/0 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/-2 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/x 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/-9223372036854775808 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/99999999999999 3/1\n", 8),
        ] {
            assert_eq!(dressed(&format!("{SQUARES}{rest}")), Err(refusal(line)), "{rest}");
        }
        let far = dressed(&format!("{SQUARES}vt 1e30 0\nf 1/1 2/1 3/1\n")).unwrap();
        let surface = Surface::new(&far, None, Path::new("a.obj")).unwrap();
        assert!(
            surface.render.is_none() && surface.notices[0].to_string().contains("1e30"),
            "{:?}",
            surface.notices
        );
    }
}
