//! A layer of USD as it stands in a file, text or binary alike: prims with attributes whose values are read when they are wanted.

use super::crates::Crate;
use super::text::Text;
use crate::error::SequenceError;
use std::collections::HashMap;

/// Where a value stands: bytes of a text, or what a binary file keeps in its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Raw {
    Text { start: usize, end: usize },
    Rep(u64),
}

/// An attribute: a value that holds always, and values at times.
#[derive(Debug, Clone, Default)]
pub(super) struct Attribute {
    pub(super) type_name: String,
    pub(super) default: Option<Raw>,
    /// By ascending time code.
    pub(super) samples: Vec<(f64, Raw)>,
    pub(super) interpolation: Option<String>,
    pub(super) element_size: Option<Raw>,
    /// Of a shape between others.
    pub(super) weight: Option<Raw>,
}

/// A prim.
#[derive(Debug, Clone, Default)]
pub(super) struct Prim {
    /// From the root, without the first `/`.
    pub(super) path: String,
    pub(super) parent: Option<usize>,
    pub(super) type_name: String,
    pub(super) attributes: HashMap<String, Attribute>,
    /// Paths that relationships name, as they stand.
    pub(super) relationships: HashMap<String, Vec<String>>,
}

/// A file's prims and what it says of itself.
#[derive(Debug, Default)]
pub(super) struct Layer {
    pub(super) prims: Vec<Prim>,
    pub(super) metadata: HashMap<String, Raw>,
    /// Prims that bring in other prims or files, which are not followed; and the sets of variants, which are not chosen from.
    pub(super) reference_count: usize,
    pub(super) variant_count: usize,
    places: HashMap<String, usize>,
    children: Vec<Vec<usize>>,
}

/// Reads values.
pub(super) enum Source {
    Text(Text),
    Crate(Box<Crate>),
}

impl Source {
    pub(super) fn path(&self) -> &std::path::Path {
        match self {
            Source::Text(text) => text.path(),
            Source::Crate(file) => file.path(),
        }
    }

    /// All numbers of a value, one after the other: of points three each, of a matrix 16 row by row, of a rotation the real part
    /// first. None where the value holds no numbers, or blocks.
    pub(super) fn numbers(&mut self, raw: Raw) -> Result<Option<Vec<f64>>, SequenceError> {
        match (self, raw) {
            (Source::Text(text), Raw::Text { start, end }) => text.numbers(start, end),
            (Source::Crate(file), Raw::Rep(rep)) => file.numbers(rep),
            _ => Ok(None),
        }
    }

    /// All names and strings of a value.
    pub(super) fn strings(&mut self, raw: Raw) -> Result<Vec<String>, SequenceError> {
        match (self, raw) {
            (Source::Text(text), Raw::Text { start, end }) => Ok(text.strings(start, end)),
            (Source::Crate(file), Raw::Rep(rep)) => file.strings(rep),
            _ => Ok(Vec::new()),
        }
    }

    /// The error for something of a prim that cannot be.
    pub(super) fn refuse(&self, prim: &str, expected: impl Into<String>, found: impl Into<String>) -> SequenceError {
        SequenceError::BadMesh {
            path: self.path().into(),
            mesh: prim.into(),
            expected: expected.into(),
            found: found.into(),
        }
    }
}

impl Attribute {
    /// Whether it has values that may differ.
    pub(super) fn varies(&self) -> bool {
        self.samples.len() > 1
    }

    /// The value that holds where nothing moves: the one without time, or the first.
    pub(super) fn rest(&self) -> Option<Raw> {
        self.default.or_else(|| self.samples.first().map(|&(_, raw)| raw))
    }
}

impl Layer {
    /// Learns where prims are, once all have been read.
    pub(super) fn link(&mut self) {
        self.places = self
            .prims
            .iter()
            .enumerate()
            .map(|(i, prim)| (prim.path.clone(), i))
            .collect();
        self.children = vec![Vec::new(); self.prims.len()];
        for (i, prim) in self.prims.iter().enumerate() {
            if let Some(parent) = prim.parent {
                self.children[parent].push(i);
            }
        }
    }

    /// The prim at a path from the root.
    pub(super) fn find(&self, path: &str) -> Option<usize> {
        self.places.get(path).copied()
    }

    /// The prims right below one.
    pub(super) fn children(&self, prim: usize) -> &[usize] {
        &self.children[prim]
    }

    /// A prim and those above it.
    pub(super) fn above(&self, prim: usize) -> impl Iterator<Item = usize> {
        core::iter::successors(Some(prim), |&prim| self.prims[prim].parent)
    }
}

/// The path that a relationship of a prim means, without the first `/`: absolute, or from that prim on.
pub(super) fn resolved(prim: &str, target: &str) -> String {
    if let Some(absolute) = target.strip_prefix('/') {
        return absolute.to_string();
    }
    let mut parts: Vec<&str> = prim.split('/').filter(|part| !part.is_empty()).collect();
    for part in target.split('/').filter(|part| !part.is_empty() && *part != ".") {
        if part == ".." {
            parts.pop();
        } else {
            parts.push(part);
        }
    }
    parts.join("/")
}
