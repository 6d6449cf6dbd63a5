//! What a USD layer moves: values between samples, transforms of prims, and the frames of its one clip.

use super::layer::{Attribute, Layer, Raw, Source};
use crate::cache::around_by;
use crate::error::SequenceError;
use crate::scene::ClipEntry;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use std::path::Path;

/// Rates where a layer states none.
const DEFAULT_RATE: f64 = 24.0;
/// Frames of a clip at most; times may be nonsense.
const FRAMES_MAX: f64 = 1e6;

/// The values around a time, and how far it lies towards the second.
pub(super) struct Around {
    pub(super) before: Vec<f64>,
    pub(super) behind: Option<(Vec<f64>, f64)>,
}

impl Around {
    /// Along straight lines.
    pub(super) fn blended(mut self) -> Vec<f64> {
        if let Some((behind, share)) = self.behind.filter(|(behind, _)| behind.len() == self.before.len()) {
            for (a, b) in self.before.iter_mut().zip(behind) {
                *a += share * (b - *a);
            }
        }
        self.before
    }
}

impl Source {
    /// The values of an attribute around a time code; without one, where nothing moves. None where it has none.
    pub(super) fn around(&mut self, attribute: &Attribute, time: Option<f64>) -> Result<Option<Around>, SequenceError> {
        let samples = &attribute.samples;
        let (first, second) = match time {
            Some(time) if !samples.is_empty() => {
                let (before, behind, share) = around_by(samples.len(), |n| samples[n].0, time);
                (
                    Some(samples[before].1),
                    Some((samples[behind].1, share)).filter(|_| share > 0.0),
                )
            }
            _ => (attribute.rest(), None),
        };
        let Some(before) = first.map_or(Ok(None), |raw| self.numbers(raw))? else {
            return Ok(None);
        };
        let behind = match second {
            Some((raw, share)) => self.numbers(raw)?.map(|behind| (behind, share)),
            None => None,
        };
        Ok(Some(Around { before, behind }))
    }

    /// The same, along straight lines.
    pub(super) fn at(&mut self, attribute: &Attribute, time: Option<f64>) -> Result<Option<Vec<f64>>, SequenceError> {
        Ok(self.around(attribute, time)?.map(Around::blended))
    }

    /// Of a prim: numbers of an attribute where nothing moves.
    pub(super) fn still(&mut self, layer: &Layer, prim: usize, name: &str) -> Result<Option<Vec<f64>>, SequenceError> {
        layer.prims[prim]
            .attributes
            .get(name)
            .map_or(Ok(None), |attribute| self.at(attribute, None))
    }

    /// Of a prim: names of an attribute.
    pub(super) fn names(&mut self, layer: &Layer, prim: usize, name: &str) -> Result<Vec<String>, SequenceError> {
        let raw = layer.prims[prim].attributes.get(name).and_then(Attribute::rest);
        raw.map_or(Ok(Vec::new()), |raw| self.strings(raw))
    }
}

/// The operations of a prim's transform.
#[derive(Debug, Default)]
pub(super) struct Operations {
    /// Whether each counts backwards, and its attribute.
    list: Vec<(bool, String)>,
    /// What is above does not move it.
    pub(super) is_reset: bool,
}

impl Operations {
    pub(super) fn read(source: &mut Source, layer: &Layer, prim: usize) -> Result<Operations, SequenceError> {
        let mut operations = Operations::default();
        for name in source.names(layer, prim, "xformOpOrder")? {
            match name.strip_prefix("!invert!") {
                _ if name == "!resetXformStack!" => {
                    operations.list.clear();
                    operations.is_reset = true;
                }
                Some(inverted) => operations.list.push((true, inverted.into())),
                None => operations.list.push((false, name)),
            }
        }
        Ok(operations)
    }

    /// Attributes that say them.
    pub(super) fn attributes<'a>(&'a self, layer: &'a Layer, prim: usize) -> impl Iterator<Item = &'a Attribute> {
        self.list
            .iter()
            .filter_map(move |(_, name)| layer.prims[prim].attributes.get(name))
    }

    /// The transform at a time code.
    pub(super) fn transform(
        &self,
        source: &mut Source,
        layer: &Layer,
        prim: usize,
        time: Option<f64>,
    ) -> Result<DAffine3, SequenceError> {
        let mut whole = DAffine3::IDENTITY;
        for (is_inverted, name) in &self.list {
            let Some(attribute) = layer.prims[prim].attributes.get(name) else {
                continue;
            };
            let Some(around) = source.around(attribute, time)? else {
                continue;
            };
            let kind = name.strip_prefix("xformOp:").unwrap_or(name);
            let kind = kind.split(':').next().unwrap_or_default();
            let own = operation(kind, around).ok_or_else(|| {
                let found = format!("another `{name}`");
                source.refuse(&layer.prims[prim].path, "the numbers of a known transform", found)
            })?;
            whole *= if *is_inverted { own.inverse() } else { own };
        }
        Ok(whole)
    }
}

/// One operation; none where its numbers are not enough.
fn operation(kind: &str, around: Around) -> Option<DAffine3> {
    if kind == "orient" {
        let key = |q: &[f64]| (q.len() == 4).then(|| rotation(q));
        let before = key(&around.before)?;
        let turned = match &around.behind {
            Some((behind, share)) => before.slerp(key(behind)?, *share),
            None => before,
        };
        return Some(DAffine3::from_quat(turned));
    }
    let values = around.blended();
    let vector = || values.first_chunk::<3>().map(|&v| DVec3::from(v));
    let first = || values.first().copied();
    let axis = |suffix: &str| {
        Some(match suffix {
            "X" => DVec3::X,
            "Y" => DVec3::Y,
            "Z" => DVec3::Z,
            _ => return None,
        })
    };
    Some(match kind {
        "translate" => DAffine3::from_translation(vector()?),
        "scale" => DAffine3::from_scale(vector()?),
        "transform" => matrix(values.first_chunk::<16>()?),
        _ => {
            if let Some(suffix) = kind.strip_prefix("translate") {
                return Some(DAffine3::from_translation(axis(suffix)? * first()?));
            }
            if let Some(suffix) = kind.strip_prefix("scale") {
                let along = axis(suffix)?;
                return Some(DAffine3::from_scale(DVec3::ONE + along * (first()? - 1.0)));
            }
            let order = kind.strip_prefix("rotate")?;
            let angles = if order.len() == 1 {
                vec![first()?]
            } else {
                vector()?.to_array().to_vec()
            };
            let mut whole = DQuat::IDENTITY;
            for letter in order.chars() {
                let along = axis(&letter.to_string())?;
                let angle = if angles.len() == 1 {
                    angles[0]
                } else {
                    along.dot(DVec3::from_slice(&angles))
                };
                // The first letter turns first.
                whole = DQuat::from_axis_angle(along, angle.to_radians()) * whole;
            }
            DAffine3::from_quat(whole)
        }
    })
}

/// A matrix whose rows are the images of the axes, as USD writes it.
pub(super) fn matrix(values: &[f64; 16]) -> DAffine3 {
    DAffine3::from_mat4(DMat4::from_cols_array(values))
}

/// A rotation whose real part stands first; none at all where there is no direction.
pub(super) fn rotation(q: &[f64]) -> DQuat {
    let whole = DQuat::from_xyzw(q[1], q[2], q[3], q[0]);
    let length = whole.length();
    if length > 0.0 && length.is_finite() {
        whole / length
    } else {
        DQuat::IDENTITY
    }
}

/// Time codes and frames of a layer.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock {
    /// Time codes a second.
    pub(super) codes: f64,
    frames: f64,
    range: Option<(f64, f64)>,
}

impl Clock {
    pub(super) fn read(source: &mut Source, layer: &Layer) -> Result<Clock, SequenceError> {
        let mut number = |name: &str| -> Result<Option<f64>, SequenceError> {
            let raw: Option<Raw> = layer.metadata.get(name).copied();
            Ok(raw
                .map_or(Ok(None), |raw| source.numbers(raw))?
                .and_then(|values| values.first().copied()))
        };
        let is_rate = |rate: &f64| *rate > 0.0 && rate.is_finite();
        let frames = number("framesPerSecond")?.filter(is_rate);
        let codes = number("timeCodesPerSecond")?
            .filter(is_rate)
            .or(frames)
            .unwrap_or(DEFAULT_RATE);
        let range = number("startTimeCode")?.zip(number("endTimeCode")?);
        Ok(Clock {
            codes,
            frames: frames.unwrap_or(codes),
            range: range.filter(|(start, end)| start < end && (end - start).is_finite()),
        })
    }

    /// The clip: frames over the range that the layer states, or where samples are. `codes` of all of these, in any order.
    pub(super) fn clip(&self, name: String, mut codes: Vec<f64>, path: &Path) -> Result<ClipEntry, SequenceError> {
        codes.sort_by(f64::total_cmp);
        codes.dedup();
        let mut entry = ClipEntry::timed(name, codes.iter().map(|code| code / self.codes).collect());
        let Some((start, end)) = self.range else {
            return Ok(entry);
        };
        let step = self.codes / self.frames;
        let count = ((end - start) / step + 1e-6).floor();
        if count >= FRAMES_MAX {
            return Err(SequenceError::Content {
                path: path.into(),
                expected: "a clip of some minutes".into(),
                found: format!("time codes from {start} to {end}"),
            });
        }
        entry.times = (0..=count as usize)
            .map(|n| (start + n as f64 * step) / self.codes)
            .collect();
        entry.fps = Some(self.frames);
        Ok(entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_turn_in_the_order_of_their_letters() {
        let around = |before: &[f64]| Around {
            before: before.to_vec(),
            behind: None,
        };
        let turned = operation("rotateXYZ", around(&[90.0, 0.0, 90.0])).unwrap();
        assert!((turned.transform_point3(DVec3::Y) - DVec3::Z).length() < 1e-12);
        assert!((turned.transform_point3(DVec3::Z) - DVec3::X).length() < 1e-12);
        let turned = operation("rotateY", around(&[90.0])).unwrap();
        assert!((turned.transform_point3(DVec3::Z) - DVec3::X).length() < 1e-12);
        let moved = operation(
            "transform",
            around(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 5., 6., 7., 1.]),
        );
        assert_eq!(moved.unwrap().translation, DVec3::new(5.0, 6.0, 7.0));
        let grown = operation("scaleY", around(&[3.0])).unwrap();
        assert_eq!(grown.transform_point3(DVec3::ONE), DVec3::new(1.0, 3.0, 1.0));
        for (kind, values) in [
            ("rotateXYW", &[1.0, 2.0, 3.0][..]),
            ("scale", &[1.0]),
            ("skew", &[1.0]),
            ("orient", &[1.0]),
        ] {
            assert!(operation(kind, around(values)).is_none(), "{kind}");
        }
    }
}
