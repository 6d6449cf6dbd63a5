//! Finished rows of an ablation, one JSON file each, named by what decides the row: shapes, split, configuration, budget.

use std::path::{Path, PathBuf};

use super::{AblationInput, Figures};
use sinew_trainer::config::TrainConfig;

/// Why rows cannot be kept.
#[derive(Debug, thiserror::Error)]
#[error("cannot keep rows in {path}; choose a folder you may write to (--work)")]
pub struct KeptError {
    path: PathBuf,
    source: std::io::Error,
}

/// The folder of rows, or none.
pub(super) struct KeptRows {
    folder: Option<PathBuf>,
    /// Everything that decides a row but its configuration.
    data: u64,
}

const CHECKSUM: crc::Crc<u64> = crc::Crc::<u64>::new(&crc::CRC_64_XZ);

impl KeptRows {
    /// Makes the folder where there is none.
    pub(super) fn open(folder: Option<&Path>, input: &AblationInput<'_>) -> Result<Self, KeptError> {
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder).map_err(|source| KeptError {
                path: folder.to_path_buf(),
                source,
            })?;
        }
        let mut digest = CHECKSUM.digest();
        digest.update(env!("CARGO_PKG_VERSION").as_bytes());
        digest.update(bytemuck::cast_slice(&input.sequence.faces));
        for shape in &input.sequence.shapes {
            digest.update(bytemuck::cast_slice(shape));
        }
        let budget = input.settings.time_budget;
        digest.update(format!("{:?} {:?} {budget:?}", input.train_shapes, input.test_shapes).as_bytes());
        Ok(Self {
            folder: folder.map(Path::to_path_buf),
            data: digest.finalize(),
        })
    }

    /// Name of the row of a configuration.
    pub(super) fn key(&self, config: &TrainConfig) -> String {
        let mut digest = CHECKSUM.digest();
        digest.update(&self.data.to_le_bytes());
        digest.update(config.to_toml().as_bytes());
        format!("{:016x}", digest.finalize())
    }

    /// The row, where it is there and whole; otherwise it is trained again.
    pub(super) fn read(&self, key: &str) -> Option<Figures> {
        let text = std::fs::read_to_string(self.row_file(key)?).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// Keeps a row, under a temporary name first; its checkpoints have served.
    pub(super) fn keep(&self, key: &str, figures: &Figures) -> Result<(), KeptError> {
        let (Some(folder), Some(path)) = (&self.folder, self.row_file(key)) else {
            return Ok(());
        };
        let fail = |source| KeptError {
            path: folder.clone(),
            source,
        };
        let text = serde_json::to_string_pretty(figures).map_err(|error| fail(error.into()))?;
        let temporary = tempfile::NamedTempFile::new_in(folder).map_err(fail)?;
        std::fs::write(temporary.path(), text).map_err(fail)?;
        temporary.persist(path).map_err(|error| fail(error.error))?;
        if let Some(run) = self.run_folder(key) {
            // What is left of a run that is done costs space and nothing else.
            let _ = std::fs::remove_dir_all(run);
        }
        Ok(())
    }

    /// Where the row's training keeps its checkpoints.
    pub(super) fn run_folder(&self, key: &str) -> Option<PathBuf> {
        self.folder
            .as_ref()
            .map(|folder| folder.join(format!("{key}.training")))
    }

    fn row_file(&self, key: &str) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(format!("{key}.json")))
    }
}
