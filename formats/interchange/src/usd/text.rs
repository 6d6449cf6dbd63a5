//! USD as text (`.usda`): prims, attributes and relationships; values are left where they stand until they are wanted.

use super::layer::{Layer, Prim, Raw};
use crate::error::{Place, SequenceError};
use crate::text::{quote, unexpected};
use std::path::{Path, PathBuf};

pub(super) const SIGNATURE: &[u8] = b"#usda ";
/// Prims inside prims: more are a fault or a trap.
const DEPTH_MAX: usize = 128;

/// The bytes of a file.
pub(super) struct Text {
    bytes: Vec<u8>,
    path: PathBuf,
}

impl Text {
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn numbers(&self, start: usize, end: usize) -> Result<Option<Vec<f64>>, SequenceError> {
        let mut numbers = Vec::new();
        let is_apart = |b: u8| b.is_ascii_whitespace() || b"()[],".contains(&b);
        let mut at = start;
        while at < end {
            if is_apart(self.bytes[at]) {
                at += 1;
                continue;
            }
            let word_end = (at..end).find(|&i| is_apart(self.bytes[i])).unwrap_or(end);
            let word = &self.bytes[at..word_end];
            let number = match word {
                b"true" => Some(1.0),
                b"false" => Some(0.0),
                b"None" => return Ok(None),
                _ => core::str::from_utf8(word).ok().and_then(|word| word.parse().ok()),
            };
            let Some(number) = number else {
                return Err(unexpected(&self.path, Place::Byte(at), "a number", Some(word)));
            };
            numbers.push(number);
            at = word_end;
        }
        Ok(Some(numbers))
    }

    pub(super) fn strings(&self, start: usize, end: usize) -> Vec<String> {
        let mut scanner = Scanner { text: self, at: start };
        let mut strings = Vec::new();
        while scanner.at < end {
            let from = scanner.at;
            match self.bytes[from] {
                b'"' | b'\'' => {
                    if scanner.skip_string().is_err() {
                        break;
                    }
                    let is_long = self.bytes[from..].starts_with(b"\"\"\"") || self.bytes[from..].starts_with(b"'''");
                    let edge = if is_long { 3 } else { 1 };
                    let inside = self.bytes.get(from + edge..scanner.at - edge).unwrap_or_default();
                    strings.push(String::from_utf8_lossy(inside).into_owned());
                }
                _ => scanner.at += 1,
            }
        }
        strings
    }
}

/// Reads the layer of a text.
///
/// Errors: `Parse` with the byte where it does not follow the format.
pub(super) fn read(bytes: Vec<u8>, path: &Path) -> Result<(Text, Layer), SequenceError> {
    let text = Text {
        bytes,
        path: path.into(),
    };
    let mut layer = Layer::default();
    let mut scanner = Scanner {
        text: &text,
        at: SIGNATURE.len(),
    };
    scanner.skip_line();
    scanner.skip_space();
    if scanner.peek() == Some(b'(') {
        scanner.metadata(&mut |key, raw| {
            layer.metadata.insert(key.into(), raw);
        })?;
    }
    scanner.prims(&mut layer, None, 0)?;
    Ok((text, layer))
}

struct Scanner<'a> {
    text: &'a Text,
    at: usize,
}

impl<'a> Scanner<'a> {
    fn peek(&self) -> Option<u8> {
        self.text.bytes.get(self.at).copied()
    }

    fn rest(&self) -> &'a [u8] {
        &self.text.bytes[self.at.min(self.text.bytes.len())..]
    }

    fn refuse(&self, expected: &str) -> SequenceError {
        let line = 1 + memchr::memchr_iter(b'\n', &self.text.bytes[..self.at.min(self.text.bytes.len())]).count();
        let found = self.rest();
        SequenceError::Parse {
            path: self.text.path.clone(),
            place: Place::Line(line),
            expected: expected.into(),
            found: if found.is_empty() {
                "the end of the file".into()
            } else {
                quote(&found[..found.len().min(64)])
            },
        }
    }

    fn skip_line(&mut self) {
        let end = memchr::memchr2(b'\n', b'\r', self.rest());
        self.at = end.map_or(self.text.bytes.len(), |end| self.at + end);
    }

    /// Over white space, separators and remarks.
    fn skip_space(&mut self) {
        while let Some(byte) = self.peek() {
            match byte {
                b'#' => self.skip_line(),
                b';' => self.at += 1,
                _ if byte.is_ascii_whitespace() => self.at += 1,
                _ => return,
            }
        }
    }

    fn expect(&mut self, byte: u8) -> Result<(), SequenceError> {
        self.skip_space();
        if self.peek() == Some(byte) {
            self.at += 1;
            return Ok(());
        }
        Err(self.refuse(&format!("`{}`", byte as char)))
    }

    /// The next word: a name, with `:`, `.` and `[]` as types and attributes have them. Empty where there is none.
    fn word(&mut self) -> &'a str {
        self.skip_space();
        let is_part = |b: &u8| b.is_ascii_alphanumeric() || b"_:.![]".contains(b) || *b >= 0x80;
        let length = self.rest().iter().take_while(|b| is_part(b)).count();
        let word = &self.rest()[..length];
        self.at += length;
        core::str::from_utf8(word).unwrap_or_default()
    }

    fn skip_string(&mut self) -> Result<(), SequenceError> {
        let quote = self.rest()[0];
        let edge: &[u8] = if self.rest().starts_with(&[quote; 3]) {
            &[quote, quote, quote]
        } else {
            &[quote]
        };
        let mut at = self.at + edge.len();
        let bytes = &self.text.bytes;
        while at < bytes.len() {
            if bytes[at] == b'\\' {
                at += 2;
            } else if bytes[at..].starts_with(edge) {
                self.at = at + edge.len();
                return Ok(());
            } else {
                at += 1;
            }
        }
        self.at = bytes.len();
        Err(self.refuse("the end of a string"))
    }

    /// Over one value: a word, a string, an asset, a path, or whatever brackets hold. Gives where it stands.
    fn value(&mut self) -> Result<Raw, SequenceError> {
        self.skip_space();
        let start = self.at;
        let mut open = Vec::new();
        loop {
            let Some(byte) = self.peek() else {
                return Err(self.refuse("a value"));
            };
            match byte {
                b'(' | b'[' | b'{' => {
                    open.push(byte);
                    self.at += 1;
                }
                b')' | b']' | b'}' => {
                    let pair = match byte {
                        b')' => b'(',
                        b']' => b'[',
                        _ => b'{',
                    };
                    if open.pop() != Some(pair) {
                        return Err(self.refuse("a value with as many closing brackets as opening ones"));
                    }
                    self.at += 1;
                }
                b'"' | b'\'' => self.skip_string()?,
                b'@' => self.skip_asset()?,
                b'<' => {
                    let end = memchr::memchr(b'>', self.rest()).ok_or_else(|| self.refuse("the end of a path, `>`"))?;
                    self.at += end + 1;
                }
                b'#' => self.skip_line(),
                _ if byte.is_ascii_whitespace() || byte == b',' || byte == b';' => {
                    if open.is_empty() {
                        return Err(self.refuse("a value"));
                    }
                    self.at += 1;
                    continue;
                }
                _ => {
                    let is_part = |b: &u8| !b.is_ascii_whitespace() && !b"()[]{},;\"'@<#".contains(b);
                    self.at += self.rest().iter().take_while(|b| is_part(b)).count().max(1);
                }
            }
            if open.is_empty() {
                break;
            }
        }
        Ok(Raw::Text { start, end: self.at })
    }

    fn skip_asset(&mut self) -> Result<(), SequenceError> {
        let edge: &[u8] = if self.rest().starts_with(b"@@@") { b"@@@" } else { b"@" };
        let inside = &self.rest()[edge.len()..];
        let end = memchr::memmem::find(inside, edge).ok_or_else(|| self.refuse("the end of an asset's name, `@`"))?;
        self.at += 2 * edge.len() + end;
        // `@file@</Prim>`
        if self.peek() == Some(b'<') {
            let end = memchr::memchr(b'>', self.rest()).ok_or_else(|| self.refuse("the end of a path, `>`"))?;
            self.at += end + 1;
        }
        Ok(())
    }

    /// Metadata in round brackets: `each` gets keys and values.
    fn metadata(&mut self, each: &mut dyn FnMut(&str, Raw)) -> Result<(), SequenceError> {
        self.expect(b'(')?;
        loop {
            self.skip_space();
            match self.peek() {
                Some(b')') => {
                    self.at += 1;
                    return Ok(());
                }
                Some(b'"' | b'\'') => self.skip_string()?,
                _ => {
                    let mut key = self.word();
                    // `prepend references = ...`
                    if matches!(key, "prepend" | "append" | "delete" | "add" | "reorder") {
                        key = self.word();
                    }
                    if key.is_empty() {
                        return Err(self.refuse("the name of some metadata"));
                    }
                    self.skip_space();
                    if self.peek() == Some(b'=') {
                        self.at += 1;
                        each(key, self.value()?);
                        self.skip_space();
                        // A list of payloads may have offsets behind each.
                        if self.peek() == Some(b'(') {
                            self.value()?;
                        }
                    }
                }
            }
        }
    }

    /// Prims up to the closing bracket of the one they are in, or the end of the file.
    fn prims(&mut self, layer: &mut Layer, parent: Option<usize>, depth: usize) -> Result<(), SequenceError> {
        if depth > DEPTH_MAX {
            return Err(self.refuse(&format!("prims up to {DEPTH_MAX} deep")));
        }
        loop {
            self.skip_space();
            match self.peek() {
                None if parent.is_none() => return Ok(()),
                Some(b'}') if parent.is_some() => {
                    self.at += 1;
                    return Ok(());
                }
                _ => {}
            }
            let word = self.word();
            match (word, parent) {
                ("def" | "over" | "class", _) => self.prim(word, layer, parent, depth)?,
                ("variantSet", Some(_)) => {
                    layer.variant_count += 1;
                    self.value()?;
                    self.expect(b'=')?;
                    self.value()?;
                }
                ("reorder", _) => {
                    self.word();
                    self.expect(b'=')?;
                    self.value()?;
                }
                ("", _) | (_, None) => return Err(self.refuse("def, over or class, a prim")),
                (_, Some(prim)) => self.property(word, layer, prim)?,
            }
        }
    }

    fn prim(
        &mut self,
        specifier: &str,
        layer: &mut Layer,
        parent: Option<usize>,
        depth: usize,
    ) -> Result<(), SequenceError> {
        self.skip_space();
        let type_name = self.word().to_string();
        self.skip_space();
        if !matches!(self.peek(), Some(b'"' | b'\'')) {
            return Err(self.refuse("the name of a prim in quotes"));
        }
        let start = self.at;
        self.skip_string()?;
        let name = String::from_utf8_lossy(&self.text.bytes[start + 1..self.at - 1]).into_owned();
        let path = match parent {
            Some(parent) => format!("{}/{name}", layer.prims[parent].path),
            None => name,
        };
        let (mut references, mut is_active) = (0, true);
        self.skip_space();
        if self.peek() == Some(b'(') {
            let bytes = &self.text.bytes;
            self.metadata(&mut |key, raw| {
                let Raw::Text { start, end } = raw else { return };
                match key {
                    "references" | "payload" | "inherits" | "specializes" => {
                        references += usize::from(&bytes[start..end] != b"None");
                    }
                    "active" => is_active = &bytes[start..end] != b"false",
                    _ => {}
                }
            })?;
        }
        layer.reference_count += references;
        self.expect(b'{')?;
        layer.prims.push(Prim {
            path,
            parent,
            // What a class or an inactive prim is, is never seen.
            type_name: if specifier == "class" || !is_active {
                String::new()
            } else {
                type_name
            },
            ..Prim::default()
        });
        self.prims(layer, Some(layer.prims.len() - 1), depth + 1)
    }

    /// An attribute or relationship whose first word was read.
    fn property(&mut self, first: &str, layer: &mut Layer, prim: usize) -> Result<(), SequenceError> {
        let mut word = first;
        while matches!(
            word,
            "custom" | "uniform" | "varying" | "config" | "prepend" | "append" | "delete" | "add" | "reorder"
        ) {
            word = self.word();
        }
        let name = self.word();
        if name.is_empty() {
            return Err(self.refuse("the name of a property"));
        }
        self.skip_space();
        let mut value = None;
        let timed = name.strip_suffix(".timeSamples");
        if self.peek() == Some(b'=') {
            self.at += 1;
            if timed.is_some() {
                let samples = self.samples()?;
                let attribute = layer.prims[prim]
                    .attributes
                    .entry(timed.unwrap_or(name).into())
                    .or_default();
                attribute.type_name = word.into();
                attribute.samples = samples;
                return Ok(());
            }
            value = Some(self.value()?);
        }
        let (mut interpolation, mut element_size, mut weight) = (None, None, None);
        self.skip_space();
        if self.peek() == Some(b'(') {
            let text = self.text;
            self.metadata(&mut |key, raw| {
                let Raw::Text { start, end } = raw else { return };
                match key {
                    "interpolation" => interpolation = text.strings(start, end).pop(),
                    "elementSize" => element_size = Some(raw),
                    "weight" => weight = Some(raw),
                    _ => {}
                }
            })?;
        }
        let prim = &mut layer.prims[prim];
        if word == "rel" {
            if let Some(Raw::Text { start, end }) = value {
                prim.relationships
                    .insert(name.into(), paths(&self.text.bytes[start..end]));
            }
            return Ok(());
        }
        // Links between shaders.
        if name.contains('.') {
            return Ok(());
        }
        let attribute = prim.attributes.entry(name.into()).or_default();
        attribute.type_name = word.into();
        attribute.default = value.or(attribute.default);
        attribute.interpolation = interpolation.or(attribute.interpolation.take());
        attribute.element_size = element_size.or(attribute.element_size);
        attribute.weight = weight.or(attribute.weight);
        Ok(())
    }

    /// Values by their times, in curly brackets.
    fn samples(&mut self) -> Result<Vec<(f64, Raw)>, SequenceError> {
        self.expect(b'{')?;
        let mut samples = Vec::new();
        loop {
            self.skip_space();
            match self.peek() {
                Some(b',') => self.at += 1,
                Some(b'}') => {
                    self.at += 1;
                    break;
                }
                _ => {
                    let length = self.rest().iter().take_while(|b| !b":}".contains(b)).count().min(64);
                    let time = core::str::from_utf8(&self.rest()[..length])
                        .ok()
                        .and_then(|word| word.trim().parse().ok());
                    let Some(time) = time.filter(|time: &f64| time.is_finite()) else {
                        return Err(self.refuse("the time of a sample"));
                    };
                    self.at += length;
                    self.expect(b':')?;
                    samples.push((time, self.value()?));
                }
            }
        }
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        samples.dedup_by(|later, kept| later.0 == kept.0);
        Ok(samples)
    }
}

/// Paths in angle brackets.
fn paths(bytes: &[u8]) -> Vec<String> {
    let pieces = bytes.split(|&b| b == b'<').skip(1);
    let inside = pieces.filter_map(|piece| piece.split(|&b| b == b'>').next());
    inside.map(|path| String::from_utf8_lossy(path).into_owned()).collect()
}
