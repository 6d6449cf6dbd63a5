//! One file that holds a fit between two steps, so that a killed fit goes on as if nothing had happened.
//!
//! Layout, little-endian: magic, version, CRC-32C of the payload, identity of the fit (its data and settings), payload
//! length; then counters, the training curve, weights, best weights and both moments of Adam. The shape of the weights
//! is not stored: it belongs to the identity. Written to a temporary file beside the target, then renamed.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crc::{CRC_32_ISCSI, CRC_64_XZ, Crc};
use thiserror::Error;

use super::fit::{FitInput, FitSettings, FitState, HistoryPoint};
use super::optimizer::{Adam, Moments};
use crate::network::loss::LossTerms;
use crate::network::weights::StackWeights;

const MAGIC: [u8; 8] = *b"SINEWCKP";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 32;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);
const IDENTITY: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

/// Why a checkpoint cannot be used.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file system refuses.
    #[error("cannot {action} the checkpoint {}: {source}", path.display())]
    Io {
        /// Read or write.
        action: &'static str,
        /// The checkpoint.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is no checkpoint, of another version, cut short or changed.
    #[error("{} is not a usable checkpoint ({reason}): remove it to train from the start", path.display())]
    Damaged {
        /// The checkpoint.
        path: PathBuf,
        /// What is wrong.
        reason: &'static str,
    },
    /// The file belongs to another sequence or configuration.
    #[error(
        "the checkpoint {} belongs to another sequence or other settings: train with those, or remove it to train from the start",
        path.display()
    )]
    OtherFit {
        /// The checkpoint.
        path: PathBuf,
    },
}

/// Tells fits apart: everything that shapes their steps. Time budget and checkpoint interval do not.
pub(super) fn identity(input: &FitInput<'_>, settings: &FitSettings, start: &StackWeights) -> u64 {
    let steady = FitSettings {
        time_budget_s: None,
        checkpoint_every: 1,
        ..settings.clone()
    };
    let mut digest = IDENTITY.digest();
    let counts = start.component_counts();
    digest.update(format!("{steady:?} {counts:?} {:?}", input.kept_roots).as_bytes());
    digest.update(bytemuck::cast_slice(&input.topology.ring_offsets));
    digest.update(bytemuck::cast_slice(&input.topology.ring));
    for numbers in [
        input.vertex_weights,
        input.position_modes,
        &start.flat_components(),
        &start.flat_convolutions(),
    ] {
        numbers.iter().for_each(|number| digest.update(&number.to_le_bytes()));
    }
    digest.finalize()
}

/// Replaces the checkpoint at `path`.
pub(super) fn write(path: &Path, identity: u64, state: &FitState, optimizer: &Adam) -> Result<(), CheckpointError> {
    let payload = encode(state, optimizer);
    let mut header = Vec::with_capacity(HEADER_BYTES);
    header.extend_from_slice(&MAGIC);
    header.extend_from_slice(&VERSION.to_le_bytes());
    header.extend_from_slice(&CRC.checksum(&payload).to_le_bytes());
    header.extend_from_slice(&identity.to_le_bytes());
    header.extend_from_slice(&(payload.len() as u64).to_le_bytes());
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let replace = || {
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(&header)?;
        file.write_all(&payload)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|error| error.error)
    };
    replace().map_err(|source| CheckpointError::Io {
        action: "write",
        path: path.to_path_buf(),
        source,
    })?;
    Ok(())
}

/// Reads the checkpoint at `path`, which must belong to the fit with this identity and start.
pub(super) fn read(path: &Path, identity: u64, start: &StackWeights) -> Result<(FitState, Adam), CheckpointError> {
    let damaged = |reason| CheckpointError::Damaged {
        path: path.to_path_buf(),
        reason,
    };
    let bytes = fs::read(path).map_err(|source| CheckpointError::Io {
        action: "read",
        path: path.to_path_buf(),
        source,
    })?;
    let mut header = Reader { rest: &bytes };
    let mut next = || header.take::<8>();
    if next() != Some(MAGIC) {
        return Err(damaged("it is another kind of file"));
    }
    let version_and_crc = u64::from_le_bytes(next().ok_or_else(|| damaged("it is cut short"))?);
    let found_identity = u64::from_le_bytes(next().ok_or_else(|| damaged("it is cut short"))?);
    let payload_bytes = u64::from_le_bytes(next().ok_or_else(|| damaged("it is cut short"))?);
    let payload = header.rest;
    if version_and_crc as u32 != VERSION {
        return Err(damaged("it is of another version"));
    }
    if payload.len() as u64 != payload_bytes || CRC.checksum(payload) != (version_and_crc >> 32) as u32 {
        return Err(damaged("it is cut short or changed"));
    }
    if found_identity != identity {
        return Err(CheckpointError::OtherFit {
            path: path.to_path_buf(),
        });
    }
    decode(payload, start).ok_or_else(|| damaged("its content is inconsistent"))
}

fn encode(state: &FitState, optimizer: &Adam) -> Vec<u8> {
    let mut bytes = Vec::new();
    for count in [
        state.step,
        state.best_step,
        state.stale,
        state.rollbacks as usize,
        optimizer.time as usize,
        state.history.len(),
    ] {
        bytes.extend_from_slice(&(count as u64).to_le_bytes());
    }
    bytes.extend_from_slice(&state.seconds.to_le_bytes());
    // NaN stands for absent: a validation error that is kept is finite.
    put(
        &mut bytes,
        &[state.rate_scale, state.best_validation.unwrap_or(f32::NAN)],
    );
    for point in &state.history {
        let loss = point.loss;
        bytes.extend_from_slice(&(point.step as u64).to_le_bytes());
        let validation = point.validation.unwrap_or(f32::NAN);
        put(
            &mut bytes,
            &[
                loss.block,
                loss.total,
                loss.position,
                loss.sparsity,
                loss.range,
                validation,
            ],
        );
    }
    for weights in [&state.weights, &state.best] {
        put(&mut bytes, &weights.flat_components());
        put(&mut bytes, &weights.flat_convolutions());
    }
    for part in [&optimizer.components, &optimizer.convolutions] {
        put(&mut bytes, &part.first);
        put(&mut bytes, &part.second);
    }
    bytes
}

fn decode(payload: &[u8], start: &StackWeights) -> Option<(FitState, Adam)> {
    let mut reader = Reader { rest: payload };
    let [step, best_step, stale, rollbacks, time, point_count] = [0; 6].map(|_| reader.count());
    let (step, best_step, stale, rollbacks) = (step?, best_step?, stale?, rollbacks?);
    let seconds = f64::from_le_bytes(reader.take()?);
    let (rate_scale, best_validation) = (reader.number()?, reader.optional_number()?);
    let mut history = Vec::new();
    for _ in 0..point_count? {
        let step = reader.count()?;
        let loss = LossTerms {
            block: reader.number()?,
            total: reader.number()?,
            position: reader.number()?,
            sparsity: reader.number()?,
            range: reader.number()?,
        };
        history.push(HistoryPoint {
            step,
            loss,
            validation: reader.optional_number()?,
        });
    }
    let component_len = start.blocks().map(|block| block.components.len()).sum();
    let convolution_len = start.flat_convolutions().len();
    let mut weights = || {
        let mut weights = start.clone();
        weights.set_flat_components(&reader.numbers(component_len)?);
        weights.set_flat_convolutions(&reader.numbers(convolution_len)?);
        Some(weights)
    };
    let (weights, best) = (weights()?, weights()?);
    let mut moments = |len| {
        Some(Moments {
            first: reader.numbers(len)?,
            second: reader.numbers(len)?,
        })
    };
    let optimizer = match time? {
        0 => Adam::default(),
        time => Adam {
            time: time as u64,
            components: moments(component_len)?,
            convolutions: moments(convolution_len)?,
        },
    };
    let rollbacks = u32::try_from(rollbacks).ok()?;
    let state = FitState {
        weights,
        best,
        best_validation,
        best_step,
        step,
        stale,
        rate_scale,
        rollbacks,
        seconds,
        history,
    };
    reader.rest.is_empty().then_some((state, optimizer))
}

fn put(bytes: &mut Vec<u8>, numbers: &[f32]) {
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
}

struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn take<const LEN: usize>(&mut self) -> Option<[u8; LEN]> {
        let (own, rest) = self.rest.split_first_chunk::<LEN>()?;
        self.rest = rest;
        Some(*own)
    }

    fn count(&mut self) -> Option<usize> {
        usize::try_from(u64::from_le_bytes(self.take()?)).ok()
    }

    fn number(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }

    fn optional_number(&mut self) -> Option<Option<f32>> {
        self.number()
            .map(|number| Some(number).filter(|number| number.is_finite()))
    }

    /// Nothing is allocated before the length is known to be there.
    fn numbers(&mut self, len: usize) -> Option<Vec<f32>> {
        let (own, rest) = self.rest.split_at_checked(len.checked_mul(4)?)?;
        self.rest = rest;
        let (chunks, _) = own.as_chunks::<4>();
        Some(chunks.iter().map(|chunk| f32::from_le_bytes(*chunk)).collect())
    }
}
