//! Meshes of USD: points, faces, texture coordinates, colours, materials.

use super::layer::{Attribute, Layer, Source};
use crate::error::SequenceError;
use crate::mesh::{CornerTexture, PolygonMesh};

/// The numbers of a mesh's points as points.
pub(super) fn points(values: &[f64]) -> Vec<[f32; 3]> {
    values.as_chunks::<3>().0.iter().map(|p| p.map(|x| x as f32)).collect()
}

/// Reads a mesh as it stands at rest.
///
/// Errors: `BadMesh` where faces and points do not fit.
pub(super) fn geometry(source: &mut Source, layer: &Layer, prim: usize) -> Result<PolygonMesh, SequenceError> {
    let path = layer.prims[prim].path.clone();
    let mut numbers = |name: &str| Ok::<_, SequenceError>(source.still(layer, prim, name)?.unwrap_or_default());
    let (positions, counts, indices) = (
        points(&numbers("points")?),
        numbers("faceVertexCounts")?,
        numbers("faceVertexIndices")?,
    );
    let is_reversed = source
        .names(layer, prim, "orientation")?
        .iter()
        .any(|name| name == "leftHanded");
    let corner_count: f64 = counts.iter().filter(|&&count| count > 0.0).sum();
    if corner_count != indices.len() as f64 {
        let found = format!("{} corners", indices.len());
        return Err(source.refuse(&path, format!("{corner_count} corners, as its faces count"), found));
    }
    let mut mesh = PolygonMesh {
        positions,
        ..PolygonMesh::default()
    };
    // The corner of the file that each kept corner is, and the face of the file that each face is.
    let (mut places, mut faces) = (Vec::new(), Vec::new());
    let mut start = 0;
    for (face, &count) in counts.iter().enumerate().filter(|&(_, &count)| count > 0.0) {
        let end = start + count as usize;
        let mut own: Vec<usize> = (start..end).collect();
        if is_reversed {
            own[1..].reverse();
        }
        for &place in &own {
            let index = indices[place];
            if !(0.0..mesh.positions.len() as f64).contains(&index) {
                let expected = format!("one of {} vertices in face {face}", mesh.positions.len());
                return Err(source.refuse(&path, expected, format!("vertex {index}")));
            }
            mesh.corners.push(index as u32);
        }
        if mesh.end_face() {
            places.extend(own);
            faces.push(face);
        }
        start = end;
    }
    texture(source, layer, prim, &places, indices.len(), &mut mesh)?;
    colors(source, layer, prim, &mut mesh)?;
    materials(source, layer, prim, &faces, counts.len(), &mut mesh)?;
    Ok(mesh)
}

fn interpolation(attribute: &Attribute) -> &str {
    attribute.interpolation.as_deref().unwrap_or("constant")
}

/// Values of a primvar with its indices applied.
fn primvar<const N: usize>(
    source: &mut Source,
    layer: &Layer,
    prim: usize,
    name: &str,
) -> Result<Option<Vec<[f32; N]>>, SequenceError> {
    let Some(values) = source.still(layer, prim, name)? else {
        return Ok(None);
    };
    let values: Vec<[f32; N]> = values
        .as_chunks::<N>()
        .0
        .iter()
        .map(|value| value.map(|x| x as f32))
        .collect();
    let Some(indices) = source.still(layer, prim, &format!("{name}:indices"))? else {
        return Ok(Some(values));
    };
    Ok(indices
        .iter()
        .map(|&index| values.get(index as usize).copied())
        .collect())
}

/// Adds texture coordinates: `st`, or the first primvar that is some. What does not fit is left out.
fn texture(
    source: &mut Source,
    layer: &Layer,
    prim: usize,
    places: &[usize],
    corner_count: usize,
    mesh: &mut PolygonMesh,
) -> Result<(), SequenceError> {
    let attributes = &layer.prims[prim].attributes;
    let is_texture = |name: &str| {
        let named = name.starts_with("primvars:") && !name.ends_with(":indices");
        named && attributes[name].type_name.starts_with("texCoord2") || name == "primvars:st"
    };
    let mut names: Vec<&String> = attributes.keys().filter(|name| is_texture(name)).collect();
    names.sort_by_key(|name| (name.as_str() != "primvars:st", name.as_str()));
    let Some(&name) = names.first() else { return Ok(()) };
    let Some(uvs) = primvar::<2>(source, layer, prim, name)? else {
        return Ok(());
    };
    if !uvs.as_flattened().iter().all(|x| x.is_finite()) || mesh.corners.is_empty() {
        return Ok(());
    }
    let corners: Vec<u32> = match interpolation(&attributes[name]) {
        "faceVarying" if uvs.len() == corner_count => places.iter().map(|&place| place as u32).collect(),
        "vertex" | "varying" if uvs.len() == mesh.positions.len() => {
            mesh.is_split = true;
            mesh.corners.clone()
        }
        _ => return Ok(()),
    };
    // Corners that share their values share them in the mesh, so that what is drawn is not split at every corner.
    let mut texture = CornerTexture::default();
    let mut known = std::collections::HashMap::new();
    for place in corners {
        let uv = uvs[place as usize];
        let next = texture.uvs.len() as u32;
        let own = *known.entry(uv.map(f32::to_bits)).or_insert(next);
        if own == next {
            texture.uvs.push(uv);
        }
        texture.corners.push(own);
    }
    mesh.texture = Some(texture);
    Ok(())
}

fn colors(source: &mut Source, layer: &Layer, prim: usize, mesh: &mut PolygonMesh) -> Result<(), SequenceError> {
    const NAME: &str = "primvars:displayColor";
    let Some(attribute) = layer.prims[prim].attributes.get(NAME) else {
        return Ok(());
    };
    if !matches!(interpolation(attribute), "vertex" | "varying") {
        return Ok(());
    }
    let colors = primvar::<3>(source, layer, prim, NAME)?.unwrap_or_default();
    if colors.len() == mesh.positions.len() {
        mesh.dress.colors = colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect();
    }
    Ok(())
}

/// The name of the material that is bound to a prim.
fn bound(layer: &Layer, prim: usize) -> Option<String> {
    let targets = layer.prims[prim].relationships.get("material:binding")?;
    let name = targets.first()?.rsplit('/').next()?;
    (!name.is_empty()).then(|| name.to_string())
}

/// Materials of all faces, or of subsets of them.
fn materials(
    source: &mut Source,
    layer: &Layer,
    prim: usize,
    faces: &[usize],
    face_count: usize,
    mesh: &mut PolygonMesh,
) -> Result<(), SequenceError> {
    let whole = bound(layer, prim);
    let mut of_face = vec![0u32; face_count];
    let mut names = vec![whole.clone().unwrap_or_default()];
    for &child in layer.children(prim) {
        let own = &layer.prims[child];
        if own.type_name != "GeomSubset" {
            continue;
        }
        let name = bound(layer, child).unwrap_or_else(|| own.path.rsplit('/').next().unwrap_or_default().into());
        for index in source.still(layer, child, "indices")?.unwrap_or_default() {
            if let Some(place) = of_face.get_mut(index as usize) {
                *place = names.len() as u32;
            }
        }
        names.push(name);
    }
    if whole.is_none() && names.len() == 1 {
        return Ok(());
    }
    mesh.dress.face_materials = faces.iter().map(|&face| of_face[face]).collect();
    if !mesh.dress.face_materials.contains(&0) && names.len() > 1 {
        names.remove(0);
        mesh.dress.face_materials.iter_mut().for_each(|material| *material -= 1);
    }
    mesh.dress.materials = names;
    Ok(())
}
