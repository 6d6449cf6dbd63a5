//! Weights per frame as a table for other programs: CSV with times and names, or an npy array.

use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::package::save_package;
use sinew_interchange::write_npy_matrix;

/// Collects frames, then writes them.
pub struct WeightsTable {
    path: PathBuf,
    csv: bool,
    names: Vec<String>,
    times_us: Vec<u64>,
    /// Shape: `[T][K]`.
    weights: Vec<f32>,
}

impl WeightsTable {
    /// For a file whose name says what is written.
    ///
    /// # Errors
    /// Another ending than `.csv` and `.npy`.
    pub fn new(path: &Path, names: Vec<String>) -> Result<Self, Report> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("");
        let csv = match extension.to_ascii_lowercase().as_str() {
            "csv" => true,
            "npy" => false,
            _ => {
                return Err(miette!(
                    "{}: the file name must end in .csv or .npy, which says what is written",
                    path.display()
                ));
            }
        };
        Ok(Self {
            path: path.to_path_buf(),
            csv,
            names,
            times_us: Vec::new(),
            weights: Vec::new(),
        })
    }

    /// Adds a frame. Shape: `weights` is `[K]`.
    pub fn frame(&mut self, at_us: u64, weights: &[f32]) {
        self.times_us.push(at_us);
        self.weights.extend_from_slice(weights);
    }

    /// Writes the file, whole or not at all; returns how many frames it holds.
    ///
    /// # Errors
    /// The system's.
    pub fn finish(&self) -> Result<usize, Report> {
        let refuse = || format!("the weights are not written to {}", self.path.display());
        if self.csv {
            save_package(&self.path, self.text().as_bytes())
                .into_diagnostic()
                .wrap_err_with(refuse)?;
        } else {
            write_npy_matrix(&self.path, &self.weights, self.names.len())
                .into_diagnostic()
                .wrap_err_with(refuse)?;
        }
        Ok(self.times_us.len())
    }

    /// Times count from the first frame, in seconds; weights read back to the same bits.
    fn text(&self) -> String {
        let mut text = String::from("time_s");
        for name in &self.names {
            text.push(',');
            text.push_str(&csv_field(name));
        }
        text.push_str("\r\n");
        let first_us = self.times_us.first().copied().unwrap_or(0);
        for (at_us, weights) in self.times_us.iter().zip(self.weights.chunks(self.names.len().max(1))) {
            text.push_str(&format!("{:.6}", (at_us.saturating_sub(first_us)) as f64 * 1e-6));
            for weight in weights {
                text.push_str(&format!(",{weight}"));
            }
            text.push_str("\r\n");
        }
        text
    }
}

fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\r', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_a_row_a_frame_and_reads_back_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let names = vec!["c0".to_owned(), "a,\"b\"".to_owned()];
        let frames = [
            (1_000_000, [0.1_f32, -2.0]),
            (1_016_667, [f32::MIN_POSITIVE, 0.333_333_34]),
        ];
        let csv = folder.path().join("w.csv");
        let npy = folder.path().join("w.npy");
        for path in [&csv, &npy] {
            let mut table = WeightsTable::new(path, names.clone()).unwrap();
            for (at_us, weights) in &frames {
                table.frame(*at_us, weights);
            }
            assert_eq!(table.finish().unwrap(), 2);
        }
        let text = std::fs::read_to_string(csv).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "time_s,c0,\"a,\"\"b\"\"\"");
        assert_eq!(lines[1], "0.000000,0.1,-2");
        let read: Vec<f32> = lines[2]
            .split(',')
            .skip(1)
            .map(|field| field.parse().unwrap())
            .collect();
        assert_eq!(read, frames[1].1);
        assert!(lines[2].starts_with("0.016667,"));
        let bytes = std::fs::read(npy).unwrap();
        assert_eq!(bytes.len(), 128 + 2 * 2 * 4);
        assert_eq!(bytes[128..132], 0.1_f32.to_le_bytes());
        assert!(WeightsTable::new(Path::new("w.txt"), names).is_err());
    }
}
