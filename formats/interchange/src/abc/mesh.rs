//! Meshes of an Alembic archive: points, faces, texture coordinates, colours, face sets.

use super::headers::{Archive, Kind, Object, Property, value_of};
use crate::error::SequenceError;
use crate::mesh::{CornerTexture, PolygonMesh, UNTEXTURED};

/// A mesh, found but not read.
#[derive(Clone)]
pub(super) struct AbcMesh {
    pub(super) name: String,
    pub(super) node: Option<usize>,
    pub(super) points: Property,
    /// Vertices of all faces, one after the other, clockwise seen from outside.
    indices: Property,
    /// Corners of each face.
    counts: Property,
    uvs: Option<Values>,
    colors: Option<Values>,
    /// Names and faces of face sets.
    sets: Vec<(String, Property)>,
    pub(super) vertex_count: usize,
    pub(super) face_count: usize,
}

/// Values on vertices or corners, with indices or without.
#[derive(Clone)]
struct Values {
    values: Property,
    indices: Option<Property>,
    is_by_corner: bool,
}

impl Values {
    /// Values of a property that may be a compound of values and indices; none where they lie on neither vertices nor corners.
    fn read(archive: &mut Archive, property: &Property) -> Result<Option<Values>, SequenceError> {
        let scope = value_of(&property.metadata, "geoScope").unwrap_or("fvr").to_owned();
        let is_by_corner = match scope.as_str() {
            "fvr" => true,
            "vtx" | "var" => false,
            _ => return Ok(None),
        };
        if property.kind != Kind::Compound {
            return Ok(Some(Values {
                values: property.clone(),
                indices: None,
                is_by_corner,
            }));
        }
        let mut inside = archive.inside(property)?;
        let mut take = |name: &str| {
            let found = inside.iter().position(|property| property.name == name);
            found.map(|i| inside.swap_remove(i))
        };
        let (values, indices) = (take(".vals"), take(".indices"));
        Ok(values.map(|values| Values {
            values,
            indices,
            is_by_corner,
        }))
    }

    /// Values of `N` numbers, and the value of each vertex or corner; none where they do not fit `item_count` items.
    fn load<const N: usize>(
        &self,
        archive: &mut Archive,
        item_count: usize,
    ) -> Result<Option<(Vec<[f32; N]>, Vec<u32>)>, SequenceError> {
        let (pod, raw) = archive.raw(&self.values, 0)?;
        let Some(floats) = pod.floats(&raw) else {
            return Ok(None);
        };
        let values: Vec<[f32; N]> = floats
            .as_chunks::<N>()
            .0
            .iter()
            .map(|value| value.map(|x| x as f32))
            .collect();
        let indices: Vec<u32> = match &self.indices {
            None => (0..values.len() as u32).collect(),
            Some(indices) => {
                let (pod, raw) = archive.raw(indices, 0)?;
                let indices = pod.integers(&raw).unwrap_or_default();
                indices
                    .into_iter()
                    .map(|i| u32::try_from(i).unwrap_or(u32::MAX))
                    .collect()
            }
        };
        let fits = indices.len() == item_count && indices.iter().all(|&i| (i as usize) < values.len());
        Ok(fits.then_some((values, indices)))
    }
}

impl AbcMesh {
    /// Finds the parts of a mesh.
    ///
    /// Errors: `BadMesh` where points or faces are missing.
    pub(super) fn read(
        archive: &mut Archive,
        object: &Object,
        name: String,
        node: Option<usize>,
    ) -> Result<AbcMesh, SequenceError> {
        let (mut points, mut indices, mut counts, mut uvs, mut colors) = (None, None, None, None, None);
        let properties = archive.properties(object)?;
        let compound = properties.iter().find(|property| property.name == ".geom");
        let inside = compound.map_or(Ok(Vec::new()), |compound| archive.inside(compound))?;
        for property in inside {
            match property.name.as_str() {
                "P" => points = Some(property),
                ".faceIndices" => indices = Some(property),
                ".faceCounts" => counts = Some(property),
                "uv" => uvs = Values::read(archive, &property)?,
                ".arbGeomParams" => {
                    for extra in archive.inside(&property)? {
                        let is_color = matches!(value_of(&extra.metadata, "interpretation"), Some("rgb" | "rgba"));
                        if colors.is_none() && is_color {
                            colors = Values::read(archive, &extra)?;
                        }
                    }
                }
                _ => {}
            }
        }
        let mut sets = Vec::new();
        for child in archive.children(object)? {
            if value_of(&child.metadata, "schema").is_some_and(|schema| schema.starts_with("AbcGeom_FaceSet")) {
                let properties = archive.properties(&child)?;
                let Some(compound) = properties.iter().find(|property| property.name == ".faceset") else {
                    continue;
                };
                let faces = archive
                    .inside(compound)?
                    .into_iter()
                    .find(|property| property.name == ".faces");
                sets.extend(faces.map(|faces| (child.name.clone(), faces)));
            }
        }
        let refuse = |what: &str| SequenceError::BadMesh {
            path: archive.file.path().into(),
            mesh: name.clone(),
            expected: format!("the property `{what}`"),
            found: "none".into(),
        };
        let points = points.ok_or_else(|| refuse("P"))?;
        let indices = indices.ok_or_else(|| refuse(".faceIndices"))?;
        let counts = counts.ok_or_else(|| refuse(".faceCounts"))?;
        Ok(AbcMesh {
            vertex_count: archive.number_count(&points, 0)? / 3,
            face_count: archive.number_count(&counts, 0)?,
            name,
            node,
            points,
            indices,
            counts,
            uvs,
            colors,
            sets,
        })
    }

    /// Properties of faces that have samples that differ.
    pub(super) fn varying_faces(&self) -> Vec<Property> {
        [&self.indices, &self.counts]
            .into_iter()
            .filter(|property| super::varies(property))
            .cloned()
            .collect()
    }

    fn refuse(&self, archive: &Archive, expected: String, found: String) -> SequenceError {
        SequenceError::BadMesh {
            path: archive.file.path().into(),
            mesh: self.name.clone(),
            expected,
            found,
        }
    }

    /// Points of sample `n`, into `out`, which is emptied first.
    pub(super) fn positions(
        &self,
        archive: &mut Archive,
        n: usize,
        out: &mut Vec<[f32; 3]>,
    ) -> Result<(), SequenceError> {
        let (pod, raw) = archive.raw(&self.points, n)?;
        out.clear();
        if let super::headers::Pod::F32 = pod {
            out.resize(raw.len() / 12, [0.0; 3]);
            crate::cache::points_from(&raw, f32::from_le_bytes, out);
            return Ok(());
        }
        let Some(floats) = pod.floats(&raw) else {
            return Err(self.refuse(archive, "points as floats".into(), format!("{pod:?}")));
        };
        out.extend(floats.as_chunks::<3>().0.iter().map(|p| p.map(|x| x as f32)));
        Ok(())
    }

    fn integers(&self, archive: &mut Archive, property: &Property) -> Result<Vec<i64>, SequenceError> {
        let (pod, raw) = archive.raw(property, 0)?;
        pod.integers(&raw).ok_or_else(|| {
            let expected = format!("`{}` as whole numbers", property.name);
            self.refuse(archive, expected, format!("{pod:?}"))
        })
    }

    /// Faces and what they wear, with the points of the first sample.
    pub(super) fn geometry(self, archive: &mut Archive) -> Result<PolygonMesh, SequenceError> {
        let mut mesh = PolygonMesh::default();
        self.positions(archive, 0, &mut mesh.positions)?;
        let indices = self.integers(archive, &self.indices)?;
        let counts = self.integers(archive, &self.counts)?;
        // Corners keep their places in the file in `source`, for what lies on them.
        let mut source: Vec<u32> = Vec::with_capacity(indices.len());
        let mut kept_faces = Vec::with_capacity(counts.len());
        let mut at = 0usize;
        for (f, &count) in counts.iter().enumerate() {
            let end = usize::try_from(count)
                .ok()
                .and_then(|count| at.checked_add(count))
                .filter(|&end| end <= indices.len());
            let Some(end) = end else {
                let found = format!("{count} corners of face {f} where {} are left", indices.len() - at);
                return Err(self.refuse(archive, "as many corners as the faces count".into(), found));
            };
            // Clockwise in the file: the first corner stays the first.
            let order = core::iter::once(at).chain((at + 1..end).rev()).take(end - at);
            for corner in order {
                let v = indices[corner];
                if !(0..mesh.positions.len() as i64).contains(&v) {
                    return Err(SequenceError::IndexOutOfRange {
                        path: archive.file.path().into(),
                        place: crate::error::Place::Face(f),
                        index: v,
                        vertex_count: mesh.positions.len(),
                    });
                }
                mesh.corners.push(v as u32);
                source.push(corner as u32);
            }
            if mesh.end_face() {
                kept_faces.push(f);
            } else {
                source.truncate(mesh.corners.len());
            }
            at = end;
        }
        drop(counts);
        self.dress(archive, &mut mesh, &source, &kept_faces, indices.len())?;
        Ok(mesh)
    }

    /// Adds texture coordinates, colours and materials; what does not fit is left out.
    fn dress(
        &self,
        archive: &mut Archive,
        mesh: &mut PolygonMesh,
        source: &[u32],
        faces: &[usize],
        corner_count: usize,
    ) -> Result<(), SequenceError> {
        let vertex_count = mesh.positions.len();
        let item_count = |values: &Values| {
            if values.is_by_corner {
                corner_count
            } else {
                vertex_count
            }
        };
        if let Some(uvs) = &self.uvs
            && let Some((values, of)) = uvs.load::<2>(archive, item_count(uvs))?
        {
            let corners = if uvs.is_by_corner {
                source.iter().map(|&corner| of[corner as usize]).collect()
            } else {
                mesh.corners.iter().map(|&v| of[v as usize]).collect()
            };
            mesh.is_split = !uvs.is_by_corner;
            mesh.texture = Some(CornerTexture { uvs: values, corners });
        }
        if let Some(colors) = &self.colors {
            let count = item_count(colors);
            let loaded = match &colors.values.kind {
                Kind::Samples(samples) if samples.extent == 3 => {
                    let loaded = colors.load::<3>(archive, count)?;
                    loaded.map(|(values, of)| (values.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect::<Vec<_>>(), of))
                }
                _ => colors.load::<4>(archive, count)?,
            };
            if let Some((values, of)) = loaded {
                mesh.dress.colors = vec![[1.0; 4]; vertex_count];
                if colors.is_by_corner {
                    // Of several corners the first one colours the vertex.
                    for (&v, &corner) in mesh.corners.iter().zip(source).rev() {
                        mesh.dress.colors[v as usize] = values[of[corner as usize] as usize];
                    }
                } else {
                    of.iter()
                        .zip(&mut mesh.dress.colors)
                        .for_each(|(&i, color)| *color = values[i as usize]);
                }
            }
        }
        self.materials(archive, mesh, faces)
    }

    /// Face sets are what materials hang on.
    fn materials(&self, archive: &mut Archive, mesh: &mut PolygonMesh, faces: &[usize]) -> Result<(), SequenceError> {
        if self.sets.is_empty() {
            return Ok(());
        }
        let mut of_face = vec![UNTEXTURED; self.face_count];
        for (set, (name, property)) in self.sets.iter().enumerate() {
            mesh.dress.materials.push(name.clone());
            for f in self.integers(archive, property)? {
                if let Some(place) = usize::try_from(f).ok().and_then(|f| of_face.get_mut(f)) {
                    *place = set as u32;
                }
            }
        }
        if of_face.contains(&UNTEXTURED) {
            mesh.dress.materials.push(String::new());
        }
        let none = mesh.dress.materials.len() as u32 - 1;
        mesh.dress.face_materials = faces.iter().map(|&f| of_face[f].min(none)).collect();
        Ok(())
    }
}
