//! Where a run keeps what it would be sorry to lose: what was chosen (`plan.toml`) and the optimiser's checkpoints.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::components::mix::MixSettings;

/// What a run has decided so far.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Plan {
    /// How training shapes are mixed.
    pub mixes: MixSettings,
    /// Held-out E_rms of the start that these mixes make; `None` where nothing was held out.
    pub held_out_error: Option<f32>,
    /// The fit with held-out shapes, once it is done and another one follows.
    pub first_fit: Option<FirstFit>,
}

/// What the second fit needs to know of the first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FirstFit {
    /// Steps behind its best weights.
    pub best_step: usize,
    /// Steps it took.
    pub steps_run: usize,
    /// Held-out E_rms at its start and at its best.
    pub validation: Option<(f32, f32)>,
    /// Why it ended.
    pub stop_reason: String,
}

#[derive(Serialize, Deserialize)]
struct PlanFile {
    fingerprint: String,
    plan: Plan,
}

/// Why the folder of a run cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunFolderError {
    /// The file system refuses.
    #[error("cannot use {path}: {source}")]
    Io {
        /// What was touched.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The run there is of other shapes or settings.
    #[error(
        "{path} holds a run on other shapes or with other settings: repeat the command it was started with, or use --restart"
    )]
    OtherRun {
        /// The plan.
        path: PathBuf,
    },
    /// The plan there is broken.
    #[error("{path} is damaged ({reason}): use --restart")]
    Damaged {
        /// The plan.
        path: PathBuf,
        /// What the parser says.
        reason: String,
    },
}

/// The folder of one run, or none.
#[derive(Debug)]
pub struct RunFolder {
    folder: Option<PathBuf>,
    fingerprint: String,
    plan: Option<Plan>,
}

impl RunFolder {
    /// Makes the folder, or reads the plan of the run that was stopped there.
    pub fn open(folder: Option<&Path>, fingerprint: &str) -> Result<Self, RunFolderError> {
        let mut opened = Self {
            folder: folder.map(Path::to_path_buf),
            fingerprint: fingerprint.to_owned(),
            plan: None,
        };
        let Some(folder) = folder else { return Ok(opened) };
        std::fs::create_dir_all(folder).map_err(|source| RunFolderError::Io {
            path: folder.to_path_buf(),
            source,
        })?;
        let path = folder.join("plan.toml");
        match std::fs::read_to_string(&path) {
            Ok(text) => {
                let file: PlanFile = toml::from_str(&text).map_err(|e| RunFolderError::Damaged {
                    path: path.clone(),
                    reason: e.message().to_owned(),
                })?;
                if file.fingerprint != fingerprint {
                    return Err(RunFolderError::OtherRun { path });
                }
                opened.plan = Some(file.plan);
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(source) => return Err(RunFolderError::Io { path, source }),
        }
        Ok(opened)
    }

    /// The plan that an earlier run kept.
    pub fn plan(&self) -> Option<Plan> {
        self.plan.clone()
    }

    /// Keeps a plan; temporary name first, so that a kill leaves the old one or the new one.
    pub fn keep_plan(&mut self, plan: &Plan) -> Result<(), RunFolderError> {
        self.plan = Some(plan.clone());
        let Some(folder) = &self.folder else { return Ok(()) };
        let file = PlanFile {
            fingerprint: self.fingerprint.clone(),
            plan: plan.clone(),
        };
        let path = folder.join("plan.toml");
        let io = |source| RunFolderError::Io {
            path: path.clone(),
            source,
        };
        let text = toml::to_string(&file).map_err(|e| io(std::io::Error::other(e)))?;
        let temporary = tempfile::NamedTempFile::new_in(folder).map_err(io)?;
        std::fs::write(temporary.path(), text).map_err(io)?;
        temporary.persist(&path).map_err(|e| io(e.error))?;
        Ok(())
    }

    /// Path of a file in the folder.
    pub fn file(&self, name: &str) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(name))
    }
}
