//! FBX in a build without its reader: files are known by their name and refused with what to do.

use super::choose::Choice;
use super::error::SequenceError;
use super::format::{Format, Reading};
use super::scene::Scene;
use std::path::Path;

pub(super) const FORMAT: Format = Format {
    name: "FBX",
    extensions: &["fbx"],
    reading: Reading::Scene(open),
    writing: None,
};

fn open(path: &Path, _: &Choice) -> Result<Box<dyn Scene>, SequenceError> {
    Err(SequenceError::Unsupported {
        path: path.into(),
        what: "an FBX file, for which this build was made without a reader,".into(),
        advice: "build with the feature `fbx`, which needs a C compiler, or export it as Alembic, USD or glTF".into(),
    })
}
