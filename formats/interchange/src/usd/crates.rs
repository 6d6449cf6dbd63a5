//! USD in binary (`.usdc`, called a crate file): tables of tokens, paths, fields and specs, and values that are read where they stand.

use super::layer::{Attribute, Layer, Prim, Raw};
use super::packed;
use super::values::Rep;
use crate::bytes::Bytes;
use crate::error::{Place, SequenceError};
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

pub(super) const SIGNATURE: &[u8] = b"PXR-USDC";
/// The newest version whose layout is known.
const MINOR_MAX: u8 = 13;
/// Where the offset of the table of contents stands.
const CONTENTS_AT: u64 = 16;
const SECTION_BYTES: u64 = 32;
/// Ends a set of fields.
const END: u32 = u32::MAX;
/// Bytes that tables may unpack to for each byte of the file, beyond a fixed sum.
const GROWTH_MAX: u64 = 64;
const FIXED_BYTES: u64 = 1 << 20;

const ATTRIBUTE: i64 = 1;
const PRIM: i64 = 6;
const PSEUDO_ROOT: i64 = 7;
const RELATIONSHIP: i64 = 8;

/// A binary file, its tables read.
pub(super) struct Crate {
    pub(super) file: Bytes,
    pub(super) minor: u8,
    pub(super) tokens: Vec<Rc<str>>,
    /// The token of each string.
    pub(super) strings: Vec<u32>,
    pub(super) paths: Vec<String>,
    /// What tables may still take.
    budget: u64,
}

impl Crate {
    pub(super) fn path(&self) -> &Path {
        self.file.path()
    }

    pub(super) fn refuse(&self, at: u64, expected: &str, found: &str) -> SequenceError {
        SequenceError::Parse {
            path: self.file.path().into(),
            place: Place::Byte(at as usize),
            expected: expected.into(),
            found: found.into(),
        }
    }

    pub(super) fn u64_at(&mut self, at: &mut u64) -> Result<u64, SequenceError> {
        let value = u64::from_le_bytes(self.file.array_at(*at)?);
        *at += 8;
        Ok(value)
    }

    pub(super) fn u32_at(&mut self, at: &mut u64) -> Result<u32, SequenceError> {
        let value = u32::from_le_bytes(self.file.array_at(*at)?);
        *at += 4;
        Ok(value)
    }

    fn spend(&mut self, at: u64, bytes: u64) -> Result<(), SequenceError> {
        match self.budget.checked_sub(bytes) {
            Some(left) => {
                self.budget = left;
                Ok(())
            }
            None => Err(self.refuse(at, "tables that the file can fill", "larger ones")),
        }
    }

    /// Packed whole numbers behind the number of their bytes.
    pub(super) fn integers(&mut self, at: &mut u64, count: u64, is_wide: bool) -> Result<Vec<i64>, SequenceError> {
        let start = *at;
        let size = self.u64_at(at)?;
        let packed = self.file.vec_at(*at, size)?;
        *at += size;
        let numbers = packed::integers(&packed, count, is_wide);
        numbers.ok_or_else(|| self.refuse(start, &format!("{count} packed whole numbers"), "others"))
    }

    /// Packed bytes behind the number of them.
    fn unpacked(&mut self, at: &mut u64, size: u64) -> Result<Vec<u8>, SequenceError> {
        let start = *at;
        let packed_size = self.u64_at(at)?;
        let packed = self.file.vec_at(*at, packed_size)?;
        *at += packed_size;
        let bytes = packed::unpack(&packed, size).filter(|bytes| bytes.len() as u64 == size);
        bytes.ok_or_else(|| self.refuse(start, &format!("{size} packed bytes"), "others"))
    }

    fn read_tokens(&mut self, mut at: u64) -> Result<(), SequenceError> {
        let start = at;
        let count = self.u64_at(&mut at)?;
        let size = self.u64_at(&mut at)?;
        self.spend(start, size)?;
        let bytes = self.unpacked(&mut at, size)?;
        self.tokens = bytes
            .split(|&b| b == 0)
            .map(|token| String::from_utf8_lossy(token).into())
            .collect();
        // Behind the last zero nothing follows.
        self.tokens.pop();
        if self.tokens.len() as u64 == count {
            return Ok(());
        }
        Err(self.refuse(start, &format!("{count} tokens"), &self.tokens.len().to_string()))
    }

    fn read_strings(&mut self, mut at: u64) -> Result<(), SequenceError> {
        let count = self.u64_at(&mut at)?;
        let raw = self.file.vec_at(at, count.saturating_mul(4))?;
        self.strings = raw.as_chunks().0.iter().map(|&raw| u32::from_le_bytes(raw)).collect();
        Ok(())
    }

    fn read_paths(&mut self, mut at: u64) -> Result<(), SequenceError> {
        let start = at;
        let path_count = self.u64_at(&mut at)?;
        let count = self.u64_at(&mut at)?;
        self.spend(start, path_count.saturating_mul(size_of::<String>() as u64))?;
        let indices = self.integers(&mut at, count, false)?;
        let elements = self.integers(&mut at, count, false)?;
        let jumps = self.integers(&mut at, count, false)?;
        self.paths = vec![String::new(); path_count as usize];
        // Where to go on, and the path above.
        let mut open = vec![(0usize, None::<usize>)];
        let mut left = count;
        while let Some((mut i, mut above)) = open.pop() {
            loop {
                let known = indices.get(i).and_then(|&index| usize::try_from(index).ok());
                let place = known.filter(|&place| place < self.paths.len());
                let (Some(place), Some(fewer)) = (place, left.checked_sub(1)) else {
                    return Err(self.refuse(start, "paths that form a tree", "others"));
                };
                left = fewer;
                if let Some(above) = above {
                    let element = elements[i];
                    let Some(token) = self.tokens.get(element.unsigned_abs() as usize).cloned() else {
                        return Err(self.refuse(start, "paths of known tokens", &format!("token {element}")));
                    };
                    let parent = &self.paths[above];
                    let between = match (element < 0, parent.is_empty()) {
                        (true, _) => ".",
                        (false, true) => "",
                        (false, false) => "/",
                    };
                    let path = format!("{parent}{between}{token}");
                    self.spend(start, path.len() as u64)?;
                    self.paths[place] = path;
                }
                let jump = jumps[i];
                let (has_child, has_sibling) = (jump > 0 || jump == -1, jump >= 0);
                if has_child {
                    if has_sibling {
                        open.push((i.saturating_add(jump as usize), above));
                    }
                    above = Some(place);
                } else if !has_sibling {
                    break;
                }
                i += 1;
            }
        }
        Ok(())
    }
}

/// Reads the tables of a file, and the layer they form.
///
/// Errors: `Parse`; `Unsupported` for versions from before 2017 and from the future.
pub(super) fn read(mut file: Bytes) -> Result<(Crate, Layer), SequenceError> {
    let [major, minor, _] = file.array_at(SIGNATURE.len() as u64)?;
    if major != 0 || !(4..=MINOR_MAX).contains(&minor) {
        return Err(SequenceError::Unsupported {
            path: file.path().into(),
            what: format!("binary USD of version {major}.{minor},"),
            advice: "write it as text with `usdcat IN -o OUT.usda`".into(),
        });
    }
    let budget = file.len().saturating_mul(GROWTH_MAX).saturating_add(FIXED_BYTES);
    let mut file = Crate {
        file,
        minor,
        tokens: Vec::new(),
        strings: Vec::new(),
        paths: Vec::new(),
        budget,
    };
    let mut at = CONTENTS_AT;
    at = file.u64_at(&mut at)?;
    let count = file.u64_at(&mut at)?;
    let table = file.file.vec_at(at, count.saturating_mul(SECTION_BYTES))?;
    let section = |name: &str| {
        let found = table
            .as_chunks::<32>()
            .0
            .iter()
            .find(|entry| entry.starts_with(name.as_bytes()) && entry[name.len()] == 0);
        found.map(|entry| u64::from_le_bytes(core::array::from_fn(|i| entry[16 + i])))
    };
    let places = ["TOKENS", "STRINGS", "PATHS", "FIELDS", "FIELDSETS", "SPECS"].map(section);
    let [
        Some(tokens),
        Some(strings),
        Some(paths),
        Some(fields),
        Some(sets),
        Some(specs),
    ] = places
    else {
        return Err(file.refuse(at, "the tables of a binary USD file", "some of them"));
    };
    file.read_tokens(tokens)?;
    file.read_strings(strings)?;
    file.read_paths(paths)?;
    let layer = file.layer(fields, sets, specs)?;
    Ok((file, layer))
}

/// Fields of a spec, by their names.
type Fields = Vec<(Rc<str>, u64)>;

impl Crate {
    fn layer(&mut self, fields: u64, sets: u64, specs: u64) -> Result<Layer, SequenceError> {
        let mut at = fields;
        let count = self.u64_at(&mut at)?;
        self.spend(fields, count.saturating_mul(24))?;
        let names = self.integers(&mut at, count, false)?;
        let reps = self.unpacked(&mut at, count.saturating_mul(8))?;
        let reps: Vec<u64> = reps.as_chunks().0.iter().map(|&raw| u64::from_le_bytes(raw)).collect();
        at = sets;
        let count = self.u64_at(&mut at)?;
        self.spend(sets, count.saturating_mul(8))?;
        let sets = self.integers(&mut at, count, false)?;
        at = specs;
        let count = self.u64_at(&mut at)?;
        self.spend(specs, count.saturating_mul(24))?;
        let path_indices = self.integers(&mut at, count, false)?;
        let set_indices = self.integers(&mut at, count, false)?;
        let kinds = self.integers(&mut at, count, false)?;
        let mut found: Vec<(String, i64, Fields)> = Vec::new();
        for ((&path, &set), &kind) in path_indices.iter().zip(&set_indices).zip(&kinds) {
            let Some(path) = usize::try_from(path)
                .ok()
                .and_then(|path| self.paths.get(path))
                .cloned()
            else {
                return Err(self.refuse(specs, "specs of known paths", &format!("path {path}")));
            };
            let mut own = Fields::new();
            let start = usize::try_from(set).unwrap_or(usize::MAX).min(sets.len());
            for &field in sets[start..].iter().take_while(|&&field| field as u32 != END) {
                self.spend(specs, 16)?;
                let rep = reps.get(field as u32 as usize).copied();
                let name = names
                    .get(field as u32 as usize)
                    .and_then(|&name| self.tokens.get(name as u32 as usize))
                    .cloned();
                let (Some(rep), Some(name)) = (rep, name) else {
                    return Err(self.refuse(specs, "known fields", &format!("field {field}")));
                };
                own.push((name, rep));
            }
            self.spend(specs, path.len() as u64)?;
            found.push((path, kind, own));
        }
        self.assemble(found)
    }

    /// Makes prims of specs; properties find the prims that they belong to.
    fn assemble(&mut self, specs: Vec<(String, i64, Fields)>) -> Result<Layer, SequenceError> {
        let mut layer = Layer::default();
        let mut places = HashMap::new();
        for (path, kind, fields) in &specs {
            match *kind {
                PSEUDO_ROOT => {
                    layer.metadata = fields
                        .iter()
                        .map(|(name, rep)| (name.to_string(), Raw::Rep(*rep)))
                        .collect()
                }
                PRIM if path.contains('{') => layer.variant_count += 1,
                PRIM => {
                    places.insert(path.as_str(), layer.prims.len());
                    layer.prims.push(self.prim(path, fields, &mut layer.reference_count)?);
                }
                _ => {}
            }
        }
        for prim in &mut layer.prims {
            let above = prim.path.rsplit_once('/').map(|(above, _)| above);
            prim.parent = above.and_then(|above| places.get(above)).copied();
        }
        for (path, kind, fields) in &specs {
            let Some((prim, name)) = path.rsplit_once('.') else {
                continue;
            };
            let Some(&prim) = places.get(prim) else { continue };
            match *kind {
                ATTRIBUTE => {
                    let attribute = self.attribute(fields)?;
                    layer.prims[prim].attributes.insert(name.into(), attribute);
                }
                RELATIONSHIP => {
                    let targets = fields.iter().find(|(name, _)| &**name == "targetPaths");
                    let targets = targets.map_or(Ok(Vec::new()), |&(_, rep)| self.strings(rep))?;
                    layer.prims[prim].relationships.insert(name.into(), targets);
                }
                _ => {}
            }
        }
        Ok(layer)
    }

    fn prim(&mut self, path: &str, fields: &Fields, reference_count: &mut usize) -> Result<Prim, SequenceError> {
        let mut prim = Prim {
            path: path.into(),
            ..Prim::default()
        };
        let mut is_seen = true;
        for (name, rep) in fields {
            match &**name {
                "typeName" => prim.type_name = self.strings(*rep)?.pop().unwrap_or_default(),
                // What a class or an inactive prim is, is never seen.
                "specifier" => is_seen &= Rep::of(*rep).payload != 2,
                "active" => is_seen &= Rep::of(*rep).payload != 0,
                "references" | "payload" | "inheritPaths" | "specializes" => *reference_count += 1,
                _ => {}
            }
        }
        if !is_seen {
            prim.type_name.clear();
        }
        Ok(prim)
    }

    fn attribute(&mut self, fields: &Fields) -> Result<Attribute, SequenceError> {
        let mut attribute = Attribute::default();
        for (name, rep) in fields {
            match &**name {
                "typeName" => attribute.type_name = self.strings(*rep)?.pop().unwrap_or_default(),
                "default" => attribute.default = Some(Raw::Rep(*rep)),
                "timeSamples" => attribute.samples = self.samples(*rep)?,
                "interpolation" => attribute.interpolation = self.strings(*rep)?.pop(),
                "elementSize" => attribute.element_size = Some(Raw::Rep(*rep)),
                "weight" => attribute.weight = Some(Raw::Rep(*rep)),
                _ => {}
            }
        }
        Ok(attribute)
    }
}
