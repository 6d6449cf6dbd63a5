//! New names for the components of a compact package. A component has one name, which is that of its control everywhere:
//! `--set`, mapping files, takes. Until somebody renames it, that is its place in the tree: `c0`, its children `c0.0`, `c0.1`.
//! Names of that form are kept for the places themselves, so that `c0.1` never means another component.

use sinew_formats::package::{
    AlignedBytes, CompactBasis, CompactView, NONE, Surface, WriteError, limits, write_compact,
};

use super::extract::component_name;

/// Why names are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RenameError {
    /// No component has the old name, or stands at that place.
    #[error("the package has no component `{0}`")]
    Unknown(String),
    /// A component is given two names.
    #[error("`{0}` is renamed twice")]
    Twice(String),
    /// The new name is not made as names are.
    #[error(
        "`{0}` cannot be a name: names are made of letters, digits, `-`, `_` and `.`, begin with a letter, and have at most {most} bytes",
        most = limits::NAME_BYTES
    )]
    Malformed(String),
    /// The new name is a place in the tree, and not that of the component.
    #[error("`{name}` cannot be the name of `{place}`: names such as c0.1 are kept for the component at that place")]
    Place {
        /// The new name.
        name: String,
        /// Where the component stands.
        place: String,
    },
    /// Two components would have one name.
    #[error("`{name}` would be the name of both `{first}` and `{second}`")]
    Taken {
        /// The new name.
        name: String,
        /// Where the first of them stands.
        first: String,
        /// Where the second of them stands.
        second: String,
    },
    /// The package cannot be written again.
    #[error("the renamed package cannot be written")]
    Write(#[from] WriteError),
}

/// The place of each component in the tree, `c0`, `c0.1`, as the trainer names them. Shape: `[K]`.
pub fn places(package: &CompactView<'_>) -> Vec<String> {
    let mut paths: Vec<Vec<usize>> = Vec::with_capacity(package.component_count());
    for block in package.blocks() {
        let parent = match block.parent_component {
            NONE => Vec::new(),
            // Parents come before children.
            parent => paths.get(parent as usize).cloned().unwrap_or_default(),
        };
        paths.extend((0..block.component_count as usize).map(|i| {
            let mut path = parent.clone();
            path.push(i);
            path
        }));
    }
    paths.iter().map(|path| component_name(path)).collect()
}

/// The names of all components once each pair's first, a name or a place, is called by its second. Shape: `[K]`.
/// Errors: every [`RenameError`] but `Write`. Names that stay are not looked at, but that no new one is the same.
pub fn new_names(package: &CompactView<'_>, pairs: &[(String, String)]) -> Result<Vec<String>, RenameError> {
    let places = places(package);
    let mut names: Vec<String> = package
        .components()
        .map(|component| component.name.to_owned())
        .collect();
    let mut renamed = vec![false; names.len()];
    for (old, new) in pairs {
        let named = package.components().position(|component| component.name == old);
        let k = named
            .or_else(|| places.iter().position(|place| place == old))
            .ok_or_else(|| RenameError::Unknown(old.clone()))?;
        if core::mem::replace(&mut renamed[k], true) {
            return Err(RenameError::Twice(old.clone()));
        }
        if !is_name(new) {
            return Err(RenameError::Malformed(new.clone()));
        }
        if is_place(new) && *new != places[k] {
            return Err(RenameError::Place {
                name: new.clone(),
                place: places[k].clone(),
            });
        }
        names[k].clone_from(new);
    }
    for (second, name) in names.iter().enumerate() {
        if let Some(first) = names[..second].iter().position(|other| other == name) {
            return Err(RenameError::Taken {
                name: name.clone(),
                first: places[first].clone(),
                second: places[second].clone(),
            });
        }
    }
    Ok(names)
}

/// Whether a text is made as names are.
pub(super) fn is_name(text: &str) -> bool {
    text.len() <= limits::NAME_BYTES
        && text.starts_with(char::is_alphabetic)
        && text.chars().all(|c| c.is_alphanumeric() || "-_.".contains(c))
}

/// Whether a name has the form of a place.
pub fn is_place(name: &str) -> bool {
    name.strip_prefix('c').is_some_and(|numbers| {
        numbers
            .split('.')
            .all(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
    })
}

/// The package with other names: nothing else differs. `names`: `[K]`.
/// Errors: [`RenameError::Write`], where the names break a rule of the format.
pub fn renamed(package: &CompactView<'_>, names: &[String]) -> Result<AlignedBytes, RenameError> {
    let blocks: Vec<_> = package.blocks().collect();
    let components: Vec<_> = package
        .components()
        .zip(names)
        .map(|(component, name)| sinew_formats::package::ComponentRecord { name, ..component })
        .collect();
    let (view, corners) = (package.surface(), package.surface().drawn_faces().to_vec());
    let render_points = view.render_points.to_vec();
    let surface = if view.has_texture() {
        Surface::textured(package.vertex_count(), &corners, &render_points, view.uvs)
    } else {
        Surface::plain(package.vertex_count(), &corners)
    };
    Ok(write_compact(&CompactBasis {
        rest_positions: package.rest_positions(),
        surface,
        bridges: package.bridges(),
        anchor_vertex: package.anchor_vertex(),
        rotation_scale: package.rotation_scale(),
        stretch_scale: package.stretch_scale(),
        blocks: &blocks,
        components: &components,
        support_bits: package.support_bits(),
        values: package.values(),
        after: package.after(),
        prior: package.prior(),
        encoder: package.encoder(),
        provenance: package.provenance(),
        quality: package.quality(),
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::fixture;

    fn check(pairs: &[(&str, &str)]) -> Result<Vec<String>, RenameError> {
        let bytes = fixture::compact(3, false);
        let pairs: Vec<(String, String)> = pairs
            .iter()
            .map(|(old, new)| ((*old).to_owned(), (*new).to_owned()))
            .collect();
        new_names(&CompactView::open(&bytes).unwrap(), &pairs)
    }

    #[test]
    fn components_are_called_by_name_or_place() {
        let bytes = fixture::compact(3, false);
        let view = CompactView::open(&bytes).unwrap();
        assert_eq!(places(&view), ["c0", "c1", "c2", "c0.0", "c0.1", "c1.0", "c1.1"]);
        let names = check(&[("c1", "jaw"), ("c0.1", "left-brow"), ("c6", "c1.1")]).unwrap();
        assert_eq!(names, ["c0", "jaw", "c2", "c3", "left-brow", "c5", "c1.1"]);
        // Two may change names in one go.
        assert_eq!(
            check(&[("c0", "b"), ("c1", "a"), ("c2", "ö.2_")]).unwrap()[..3],
            ["b", "a", "ö.2_"]
        );
    }

    #[test]
    fn only_the_names_differ() {
        let bytes = fixture::compact(3, false);
        let view = CompactView::open(&bytes).unwrap();
        let old: Vec<String> = view.components().map(|c| c.name.to_owned()).collect();
        assert_eq!(renamed(&view, &old).unwrap(), bytes);
        let other = renamed(&view, &check(&[("c2", "tail")]).unwrap()).unwrap();
        let other = CompactView::open(&other).unwrap();
        assert_eq!(other.component(2).name, "tail");
        let back: Vec<String> = old.clone();
        assert_eq!(renamed(&other, &back).unwrap(), bytes);
    }

    #[test]
    fn names_that_would_confuse_are_refused() {
        use RenameError::{Malformed, Place, Taken, Twice, Unknown};
        assert_eq!(check(&[("nose", "jaw")]), Err(Unknown("nose".into())));
        assert_eq!(check(&[("c3", "jaw"), ("c0.0", "chin")]), Err(Twice("c0.0".into())));
        let long = "a".repeat(65);
        for text in ["", "a b", "a=b", "-a", "1a", "a/b", "a\n", &long] {
            assert_eq!(check(&[("c0", text)]), Err(Malformed(text.into())));
        }
        assert!(matches!(check(&[("c0", "c9.9")]), Err(Place { .. })));
        assert!(matches!(check(&[("c0", "jaw"), ("c1", "jaw")]), Err(Taken { .. })));
        assert!(matches!(check(&[("c3", "c0.0"), ("c4", "c0.0")]), Err(Place { .. })));
    }
}
