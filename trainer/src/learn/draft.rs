//! A package in the making: written without provenance, opened, played on all threads.

use rayon::prelude::*;
use sinew_formats::package::{AlignedBytes, CompactView, OpenError, Provenance, Quality, WriteError, write_compact};
use sinew_runtime::{Basis, Workspace, WorkspaceError, WorkspaceLayout};

use crate::bake::BakeError;
use crate::components::extract::LearnedBasis;
use crate::components::rename::RenameError;
use crate::evaluate::{PlayError, Player, ScoreError, UnknownEncoder};

/// Why a learned basis cannot be packaged or measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackageError {
    /// The format refuses it.
    #[error("the package would break a rule of its format: {0}")]
    Write(#[from] WriteError),
    /// It cannot be baked.
    #[error("the package cannot be baked: {0}")]
    Bake(#[from] BakeError),
    /// Its components cannot be named.
    #[error("painted and kept components cannot be named: {0}")]
    Name(#[from] RenameError),
    /// What was just written does not open.
    #[error("the package does not open: {0}")]
    Open(#[from] OpenError),
    /// Its encoder cannot be used.
    #[error(transparent)]
    Encoder(#[from] UnknownEncoder),
    /// The runtime has no workspace for it.
    #[error("no workspace for the package: {0}")]
    Workspace(#[from] WorkspaceError),
    /// The runtime does not play it.
    #[error("the package does not play: {0}")]
    Play(#[from] PlayError),
    /// Its quality cannot be scored.
    #[error("its quality cannot be measured: {0}")]
    Score(#[from] ScoreError),
}

/// A compact package without provenance: for measuring while training.
pub struct Draft(AlignedBytes);

impl Draft {
    /// Opens it.
    pub fn view(&self) -> Result<CompactView<'_>, PackageError> {
        Ok(CompactView::open(&self.0)?)
    }
}

impl LearnedBasis {
    /// Writes a package that says nothing of where it comes from.
    pub fn write_draft(&self) -> Result<Draft, PackageError> {
        let provenance = Provenance {
            tool: "sinew",
            sequence: "draft",
            config: "",
            seed: 0,
            shape_count: 1,
            train_shapes: &[0],
        };
        let quality = Quality {
            validation_e_rms: -1.0,
            steps: 0,
            steps_run: 0,
        };
        Ok(Draft(self.with_records(provenance, quality, write_compact)?))
    }
}

/// Calls `job` for each item with a player of its thread; results keep the order of the items.
pub fn with_players<I: Sync, T: Send>(
    basis: &Basis<'_>,
    items: &[I],
    job: impl Fn(&mut Player<'_>, &I) -> Result<T, PlayError> + Sync,
) -> Result<Vec<T>, PackageError> {
    let layout = WorkspaceLayout::for_basis(basis);
    let share = items.len().div_ceil(rayon::current_num_threads()).max(1);
    let parts: Result<Vec<Vec<T>>, PackageError> = items
        .par_chunks(share)
        .map(|items| {
            let mut memory = vec![0_u8; layout.unaligned_bytes()];
            let mut player = Player::new(basis, Workspace::new(basis, &mut memory)?);
            items.iter().map(|item| Ok(job(&mut player, item)?)).collect()
        })
        .collect();
    Ok(parts?.into_iter().flatten().collect())
}

/// Length of the bounding box's diagonal; 1 for a point.
pub fn bounding_diagonal(positions: &[[f32; 3]]) -> f32 {
    let squared: f32 = (0..3)
        .map(|c| {
            let values = positions.iter().map(|p| p[c]);
            let extent = values.clone().fold(f32::MIN, f32::max) - values.fold(f32::MAX, f32::min);
            extent * extent
        })
        .sum();
    if squared > 0.0 { squared.sqrt() } else { 1.0 }
}
