//! `sinew inspect`: what is in a package.

use core::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, WrapErr};
use serde_json::json;
use sinew_formats::package::{BakedView, CompactView, ComponentRecord, NONE, PackageKind};

use super::{Failure, load_package};

/// Arguments of `sinew inspect`.
#[derive(Args)]
#[command(
    after_help = "scale      how far from its centre a component was asked to stay, as a share of the longest distance on the surface
strength   mean displacement of the vertices it moves, at its farther stop, as a share of the bounding box's diagonal
locality   share of its energy inside `scale`
range      weights seen on the training shapes and their mixes; the stops of the control"
)]
pub struct InspectArguments {
    /// Compact or baked package
    package: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Print the configuration it was trained with, as TOML, and nothing else
    #[arg(long, conflicts_with = "json")]
    config: bool,
}

/// Runs `sinew inspect`.
pub fn run(arguments: &InspectArguments) -> Result<(), Failure> {
    let bytes = load_package(&arguments.package)?;
    let refuse = || format!("{} is no usable package", arguments.package.display());
    let kind = PackageKind::of(&bytes).into_diagnostic().wrap_err_with(refuse)?;
    let mut out = String::new();
    if kind == PackageKind::Baked {
        let view = BakedView::open(&bytes).into_diagnostic().wrap_err_with(refuse)?;
        if arguments.config {
            return Err(miette::miette!(
                "a baked package holds no configuration: ask the compact one it was baked from"
            )
            .into());
        }
        print_baked(&mut out, &view, bytes.len(), arguments.json);
        print(&out);
        return Ok(());
    }
    let view = CompactView::open(&bytes).into_diagnostic().wrap_err_with(refuse)?;
    if arguments.config {
        out.push_str(view.provenance().config);
    } else if arguments.json {
        out = format!("{:#}\n", compact_json(&view, bytes.len()));
    } else {
        print_compact(&mut out, &view, bytes.len());
    }
    print(&out);
    Ok(())
}

/// Writes to standard output; a reader such as `head` may have heard enough.
fn print(text: &str) {
    let _ = std::io::stdout().write_all(text.as_bytes());
}

fn hex(id: [u8; 16]) -> String {
    id.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Supported vertices of each component.
fn support_counts(view: &CompactView<'_>) -> Vec<u32> {
    let words = view.vertex_count().div_ceil(32).max(1);
    view.support_bits()
        .chunks(words)
        .map(|bits| bits.iter().map(|word| word.count_ones()).sum())
        .collect()
}

fn compact_json(view: &CompactView<'_>, byte_count: usize) -> serde_json::Value {
    let provenance = view.provenance();
    let quality = view.quality();
    let blocks: Vec<_> = view.blocks().collect();
    let supports = support_counts(view);
    let components: Vec<_> = view
        .components()
        .zip(&supports)
        .map(|(c, support)| {
            let block = &blocks[c.block as usize];
            let parent = (block.parent_component != NONE).then(|| view.component(block.parent_component as usize).name);
            json!({
                "name": c.name, "level": block.level, "parent": parent, "centre_vertex": c.centre_vertex,
                "scale": c.scale, "strength": c.strength, "locality": c.locality,
                "range": [c.minimum, c.maximum], "vertices": support,
            })
        })
        .collect();
    json!({
        "kind": "compact",
        "content_id": hex(view.content_id()),
        "bytes": byte_count,
        "vertices": view.vertex_count(),
        "faces": view.faces().len(),
        "bridges": view.bridges().len(),
        "blocks": blocks.len(),
        "components": components,
        "provenance": {
            "tool": provenance.tool, "sequence": provenance.sequence, "seed": provenance.seed,
            "shapes": provenance.shape_count, "train_shapes": provenance.train_shapes, "config": provenance.config,
        },
        "quality": {
            "validation_e_rms": (quality.validation_e_rms >= 0.0).then_some(quality.validation_e_rms),
            "steps": quality.steps, "steps_run": quality.steps_run,
        },
    })
}

fn print_compact(out: &mut String, view: &CompactView<'_>, byte_count: usize) {
    let provenance = view.provenance();
    let quality = view.quality();
    let words = view.support_bits().len() * 4;
    let _ = writeln!(out, "compact package {}", hex(view.content_id()));
    let _ = writeln!(
        out,
        "  {:.2} MB: values {:.2}, supports {:.2}, mesh {:.2}",
        byte_count as f64 / 1e6,
        (view.values().len() * 18) as f64 / 1e6,
        words as f64 / 1e6,
        (view.vertex_count() * 12 + view.faces().len() * 12) as f64 / 1e6
    );
    let _ = writeln!(
        out,
        "  {} vertices, {} faces, {} components in {} blocks",
        view.vertex_count(),
        view.faces().len(),
        view.component_count(),
        view.block_count()
    );
    let _ = writeln!(
        out,
        "  by {} from `{}`: {} of {} shapes, seed {}, {} of {} steps kept",
        provenance.tool,
        provenance.sequence,
        provenance.train_shapes.len(),
        provenance.shape_count,
        provenance.seed,
        quality.steps,
        quality.steps_run
    );
    if quality.validation_e_rms >= 0.0 {
        let _ = writeln!(out, "  held-out E_rms while training: {:.2}", quality.validation_e_rms);
    }
    let _ = writeln!(out);
    let _ = writeln!(
        out,
        "{:<18} {:>6} {:>9} {:>9} {:>18} {:>9}",
        "component", "scale", "strength", "locality", "range", "vertices"
    );
    let blocks: Vec<_> = view.blocks().collect();
    let rows: Vec<(ComponentRecord<'_>, u32)> = view.components().zip(support_counts(view)).collect();
    if let Some(root) = blocks.first() {
        print_block(out, &blocks, &rows, root.first_component, root.component_count, 0);
    }
}

/// Depth-first, so that the children of a component stand under it.
fn print_block(
    out: &mut String,
    blocks: &[sinew_formats::package::BlockRecord],
    rows: &[(ComponentRecord<'_>, u32)],
    first: u32,
    count: u32,
    depth: usize,
) {
    for k in first..first + count {
        let (c, support) = &rows[k as usize];
        let _ = writeln!(
            out,
            "{:<18} {:>6.2} {:>9.4} {:>9.3} {:>8.2} .. {:>6.2} {:>9}",
            format!("{}{}", "  ".repeat(depth), c.name),
            c.scale,
            c.strength,
            c.locality,
            c.minimum,
            c.maximum,
            support
        );
        for child in blocks.iter().filter(|block| block.parent_component == k) {
            print_block(
                out,
                blocks,
                rows,
                child.first_component,
                child.component_count,
                depth + 1,
            );
        }
    }
}

fn print_baked(out: &mut String, view: &BakedView<'_>, byte_count: usize, as_json: bool) {
    let exact = view.exact();
    let components: Vec<_> = view
        .components()
        .enumerate()
        .map(|(k, c)| {
            json!({ "name": c.name, "range": [c.minimum, c.maximum], "vertices": exact.entries_of(k).0.len() })
        })
        .collect();
    if as_json {
        let summary = json!({
            "kind": "baked", "content_id": hex(view.content_id()), "compact_id": hex(view.compact_id()), "bytes": byte_count,
            "vertices": view.vertex_count(), "faces": view.faces().len(), "blocks": view.block_count(),
            "factor_entries": exact.factor_rows().len(), "components": components,
        });
        let _ = writeln!(out, "{summary:#}");
        return;
    }
    let _ = writeln!(
        out,
        "baked package {} of compact package {}",
        hex(view.content_id()),
        hex(view.compact_id())
    );
    let _ = writeln!(
        out,
        "  {:.2} MB: factor {:.2} ({} entries), components {:.2}",
        byte_count as f64 / 1e6,
        (exact.factor_rows().len() * 8) as f64 / 1e6,
        exact.factor_rows().len(),
        (exact.entry_values().len() * 22) as f64 / 1e6
    );
    let _ = writeln!(
        out,
        "  {} vertices, {} faces, {} components in {} blocks",
        view.vertex_count(),
        view.faces().len(),
        view.component_count(),
        view.block_count()
    );
    let _ = writeln!(out);
    let _ = writeln!(out, "{:<18} {:>18} {:>9}", "component", "range", "vertices");
    for (k, c) in view.components().enumerate() {
        let _ = writeln!(
            out,
            "{:<18} {:>8.2} .. {:>6.2} {:>9}",
            c.name,
            c.minimum,
            c.maximum,
            exact.entries_of(k).0.len()
        );
    }
}
