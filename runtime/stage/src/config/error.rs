//! Refusals of a file, with the place in it: file, line and column in one line, and the lines themselves for a terminal.

use std::path::Path;
use std::sync::Arc;

use miette::{Diagnostic, NamedSource, SourceSpan};

use super::keys::Fault;

/// Why a file of knobs or of calibrations is refused.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{file}:{line}:{column}: {message}")]
pub struct ConfigError {
    /// The file, as the user named it.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1, in characters.
    pub column: usize,
    /// What is wrong.
    pub message: String,
    #[help]
    help: Option<String>,
    #[source_code]
    source_code: Arc<NamedSource<String>>,
    #[label("here")]
    span: SourceSpan,
}

impl ConfigError {
    /// Puts a fault into its file.
    pub fn new(path: &Path, text: &str, fault: Fault) -> Self {
        let start = text.floor_char_boundary(fault.span.start.min(text.len()));
        let end = text.floor_char_boundary(fault.span.end.clamp(start, text.len()));
        let before = &text[..start];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        let file = path.display().to_string();
        Self {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            message: fault.message,
            help: fault.help,
            source_code: Arc::new(NamedSource::new(&file, text.to_owned())),
            // A table's span is all of it; its first line is enough to point at.
            span: (start, text[start..end].find('\n').unwrap_or(end - start)).into(),
            file,
        }
    }

    /// What to do about it.
    pub fn help_text(&self) -> Option<&str> {
        self.help.as_deref()
    }
}
