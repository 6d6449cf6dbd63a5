//! The package to play: baked as it is, or compact and baked here, in memory.

use std::path::Path;

use miette::{IntoDiagnostic, Report, WrapErr};
use sinew_bake::bake_bytes;
use sinew_formats::package::{AlignedBytes, PackageKind, read_package};
use sinew_runtime::Basis;

/// The bytes of a baked package.
///
/// # Errors
/// The file cannot be read, is no package, or cannot be baked.
pub fn load(path: &Path) -> Result<AlignedBytes, Report> {
    let refuse = || format!("{} is no usable package", path.display());
    // The error names the file.
    let bytes = read_package(path).into_diagnostic()?;
    match PackageKind::of(&bytes).into_diagnostic().wrap_err_with(refuse)? {
        PackageKind::Compact => bake_bytes(&bytes).into_diagnostic().wrap_err_with(refuse),
        _ => Ok(bytes),
    }
}

/// Opens what [`load`] gave.
///
/// # Errors
/// A baked package that breaks a rule of its format.
pub fn open<'a>(bytes: &'a [u8], path: &Path) -> Result<Basis<'a>, Report> {
    Basis::open(bytes)
        .into_diagnostic()
        .wrap_err_with(|| format!("{} is no usable package", path.display()))
}
