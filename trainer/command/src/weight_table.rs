//! Tables of weights, a row a frame: what `sinew encode` writes, what a spreadsheet makes of it, and what `sinew frame` plays.

use std::path::Path;

use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_interchange::NpyArray;

/// The column of names in front of the weights.
const SHAPE: &str = "shape";

/// A line of names, then a line a shape, to a temporary name first. Shapes: `weights` `[N][K]`, `names` `[K]`.
///
/// # Errors
/// A file that cannot be written.
pub fn write_csv(path: &Path, names: &[&str], shapes: &[String], weights: &[Vec<f64>]) -> Result<(), Report> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let store = || -> std::io::Result<()> {
        let mut builder = tempfile::Builder::new();
        // Temporary files are private by default; a table is to be read by others, as far as the umask lets them.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(folder.unwrap_or(Path::new(".")))?;
        let mut table = csv::Writer::from_writer(file);
        table.write_record([SHAPE].iter().chain(names))?;
        for (m, weights) in weights.iter().enumerate() {
            table.write_field(shapes.get(m).map_or_else(|| m.to_string(), Clone::clone))?;
            for &weight in weights {
                table.write_field((weight as f32).to_string())?;
            }
            table.write_record(None::<&[u8]>)?;
        }
        let file = table.into_inner().map_err(csv::IntoInnerError::into_error)?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    };
    store()
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", path.display()))
}

/// Weights of every frame, from a table with a line of names (.csv; a component without a column stays at rest) or an array of frames x
/// components (.npy). Shape: `[N][K]`, in the order of `names` `[K]`.
///
/// # Errors
/// A file that cannot be read, is neither, has no frames, a column that is no component's, or a value that is no finite number: with line
/// and column.
pub fn read_weights(path: &Path, names: &[&str]) -> Result<Vec<Vec<f32>>, Report> {
    let extension = path.extension().and_then(|text| text.to_str()).unwrap_or("");
    let refuse = || format!("cannot use {} as weights", path.display());
    match extension.to_ascii_lowercase().as_str() {
        "csv" => read_csv(path, names).wrap_err_with(refuse),
        "npy" => read_npy(path, names.len()).wrap_err_with(refuse),
        _ => Err(miette!(
            help = "`sinew encode` writes both",
            "{} ends neither in .csv nor in .npy",
            path.display()
        )),
    }
}

fn read_npy(path: &Path, component_count: usize) -> Result<Vec<Vec<f32>>, Report> {
    let bytes = std::fs::read(path).into_diagnostic()?;
    let (values, columns) = NpyArray::parse(bytes, path)
        .and_then(NpyArray::into_matrix)
        .into_diagnostic()?;
    if columns != component_count {
        return Err(miette!(
            help = "a table with names (.csv) may have fewer",
            "it has {columns} columns, and the package {component_count} components"
        ));
    }
    let rows: Vec<Vec<f32>> = values.chunks_exact(columns).map(<[f32]>::to_vec).collect();
    for (n, row) in rows.iter().enumerate() {
        if let Some(k) = row.iter().position(|weight| !weight.is_finite()) {
            return Err(miette!("row {n}, column {k} holds {}: no finite number", row[k]));
        }
    }
    Ok(rows)
}

fn read_csv(path: &Path, names: &[&str]) -> Result<Vec<Vec<f32>>, Report> {
    let mut table = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .into_diagnostic()?;
    let headers = table.headers().into_diagnostic()?.clone();
    // Where each column goes; the names of the shapes nowhere.
    let mut columns = Vec::new();
    for (column, header) in headers.iter().enumerate() {
        let k = names.iter().position(|name| *name == header);
        if k.is_none() && !(column == 0 && header == SHAPE) {
            return Err(miette!(
                help = format!("it has {}", names.join(", ")),
                "column {}: the package has no component `{header}`",
                column + 1
            ));
        }
        if k.is_some() && columns.contains(&k) {
            return Err(miette!("column {}: `{header}` is there twice", column + 1));
        }
        columns.push(k);
    }
    let mut rows = Vec::new();
    for record in table.records() {
        let record = record.into_diagnostic()?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut row = vec![0.0; names.len()];
        for (field, k) in record.iter().zip(&columns) {
            let Some(k) = *k else { continue };
            row[k] = match field.parse::<f32>() {
                Ok(weight) if weight.is_finite() => weight,
                _ => return Err(miette!("line {line}, `{}`: `{field}` is no finite number", names[k])),
            };
        }
        rows.push(row);
    }
    if rows.is_empty() {
        return Err(miette!("it has a line of names and no frames"));
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_commas_and_quotes_stay_one_field() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("weights.csv");
        let shapes = ["a, b".to_owned(), "say \"c\"".to_owned()];
        let weights = [vec![0.5, -1.0], vec![0.1, 3e-9]];
        let names = ["c0", "left,arm"];
        write_csv(&path, &names, &shapes, &weights).expect("written");
        let text = std::fs::read_to_string(&path).expect("read");
        assert_eq!(
            text,
            "shape,c0,\"left,arm\"\n\"a, b\",0.5,-1\n\"say \"\"c\"\"\",0.1,0.000000003\n"
        );
        let rows = read_weights(&path, &names).expect("read again");
        assert_eq!(rows, [[0.5, -1.0], [0.1, 3e-9]]);
    }

    #[test]
    fn columns_go_by_name_and_what_is_wrong_is_said() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("weights.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).expect("written");
            read_weights(&path, &["a", "b", "c"]).map_err(|error| format!("{error:?}"))
        };
        assert_eq!(
            read("c,a\n1, 2\n3,4\n"),
            Ok(vec![vec![2.0, 0.0, 1.0], vec![4.0, 0.0, 3.0]])
        );
        for (text, said) in [
            ("a,d\n1,2\n", "no component `d`"),
            ("a,a\n1,2\n", "twice"),
            ("a\n1\nnan\n", "line 3, `a`"),
            ("a,b\n1\n", "line"),
            ("a,b\n", "no frames"),
        ] {
            let refused = read(text).expect_err("refused");
            assert!(refused.contains(said), "{text:?}: {refused}");
        }
    }
}
