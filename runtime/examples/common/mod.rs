//! What the examples share: the bytes of a package, ready for the frame path.

use core::error::Error;
use std::path::Path;

use sinew_bake::bake_bytes;
use sinew_formats::package::{AlignedBytes, PackageKind, read_package};
use sinew_peers::subject::Subject;

/// Vertices of the creature that stands in where no package is named. Its components are made up.
const VERTICES: usize = 2500;

/// A baked package: the file itself, or made from a compact one; without a path a creature with made-up components.
pub fn baked_package(path: Option<&String>) -> Result<AlignedBytes, Box<dyn Error>> {
    let Some(path) = path else {
        return Ok(Subject::creature(VERTICES).baked);
    };
    let bytes = read_package(Path::new(path))?;
    Ok(match PackageKind::of(&bytes)? {
        PackageKind::Compact => bake_bytes(&bytes)?,
        _ => bytes,
    })
}
