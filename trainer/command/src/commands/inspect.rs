//! `sinew inspect`: what is in a package; what is in another program's file stands in `inspect_file`.

use core::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, WrapErr};
use serde_json::json;
use sinew_formats::package::{BakedView, BonesView, CompactView, ComponentRecord, NONE, PackageKind, PoseError};
use sinew_trainer::components::anatomy::Anatomy;
use sinew_trainer::components::fields::DUPLICATE_COSINE;
use sinew_trainer::components::rename::places;

use super::{Standing, inspect_file};
use sinew_command::inputs::{Failure, load_package};

/// Arguments of `sinew inspect`.
#[derive(Args)]
#[command(
    after_help = "scale      how far from its centre it was asked to stay, over the longest distance on the surface
strength   mean displacement of what it moves at its farther stop, over the bounding box's diagonal
locality   share of its energy inside `scale`
range      weights seen on the training shapes and their mixes; the stops of the control
mirror     what does the same on the other side of the mirror plane, `self` where that is the
           component itself; with a minus where it takes the opposite weight
label      where it acts and how: its side (where the rest shape has a mirror plane), back or front,
           low or high; then
           swing     about one axis, one way         bend    about one axis, both ways
           twist     about the length of the region  turn    about several axes
           stretch, squash (mostly one way), swell, shrink (all around), at the farther stop

A label is a description; the name is what --set, knobs and takes use. `sinew rename` gives names, and labels as names.
Baked packages hold no more of components than the runtime needs: labels and mirror images are those of compact ones."
)]
pub struct InspectArguments {
    /// Compact or baked package; or a sequence: a folder of shapes, or a file with a moving mesh
    #[arg(value_name = "FILE")]
    package: PathBuf,
    /// The mesh that a point cache moves [default: the mesh file beside the cache]
    #[arg(long, value_name = "FILE")]
    surface: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Print the configuration it was trained with, as TOML, and nothing else
    #[arg(long, conflicts_with = "json")]
    config: bool,
    #[command(flatten)]
    standing: Standing,
}

/// Runs `sinew inspect`.
pub fn run(arguments: &InspectArguments) -> Result<(), Failure> {
    if inspect_file::is_sequence(&arguments.package) {
        return run_on_sequence(arguments);
    }
    if arguments.surface.is_some() {
        return Err(miette::miette!(
            "--surface is for point caches, and {} is none",
            arguments.package.display()
        )
        .into());
    }
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
        print(&out);
        return Ok(());
    }
    let anatomy = Anatomy::of(&view, arguments.standing.axes()?);
    if arguments.json {
        out = format!("{:#}\n", compact_json(&view, &anatomy, bytes.len()));
    } else {
        print_compact(&mut out, &view, &anatomy, bytes.len());
    }
    print(&out);
    Ok(())
}

/// Shows what a sequence's file holds.
fn run_on_sequence(arguments: &InspectArguments) -> Result<(), Failure> {
    if arguments.config || arguments.standing.is_said() {
        return Err(miette::miette!(
            "--config, --up and --front are for packages, and {} is a sequence",
            arguments.package.display()
        )
        .into());
    }
    let choice = sinew_interchange::Choice {
        surface: arguments.surface.clone(),
        ..sinew_interchange::Choice::default()
    };
    print(&inspect_file::describe(&arguments.package, &choice, arguments.json)?);
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

fn compact_json(view: &CompactView<'_>, anatomy: &Anatomy, byte_count: usize) -> serde_json::Value {
    let provenance = view.provenance();
    let quality = view.quality();
    let blocks: Vec<_> = view.blocks().collect();
    let supports = support_counts(view);
    let places = places(view);
    let components: Vec<_> = view
        .components()
        .enumerate()
        .map(|(k, c)| {
            let mirror = anatomy.images[k].map(|image| {
                let name = view.component(image.component).name;
                json!({ "name": name, "cosine": image.cosine, "reversed": image.reversed })
            });
            let block = &blocks[c.block as usize];
            let parent = (block.parent_component != NONE).then(|| view.component(block.parent_component as usize).name);
            json!({
                "name": c.name, "level": block.level, "parent": parent, "centre_vertex": c.centre_vertex,
                "scale": c.scale, "strength": c.strength, "locality": c.locality,
                "range": [c.minimum, c.maximum], "vertices": supports[k], "place": places[k], "label": anatomy.labels[k],
                "mirror": mirror,
            })
        })
        .collect();
    let duplicates: Vec<_> = anatomy
        .duplicates
        .iter()
        .map(|pair| {
            let names = [pair.first, pair.second].map(|k| view.component(k).name);
            json!({ "names": names, "cosine": pair.cosine })
        })
        .collect();
    let plane = anatomy
        .plane
        .as_ref()
        .map(|plane| json!({ "normal": plane.normal, "offset": plane.offset, "share": plane.share }));
    json!({
        "kind": "compact",
        "content_id": hex(view.content_id()),
        "bytes": byte_count,
        "vertices": view.vertex_count(),
        "faces": view.faces().len(),
        "bridges": view.bridges().len(),
        "blocks": blocks.len(),
        "components": components,
        "mirror_plane": plane,
        "duplicates": duplicates,
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

fn print_compact(out: &mut String, view: &CompactView<'_>, anatomy: &Anatomy, byte_count: usize) {
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
    print_alike(out, view, anatomy);
    let _ = writeln!(out);
    let places = places(view);
    let titles = view.components().zip(&places).map(|(c, place)| {
        let depth = place.matches('.').count();
        let known = if c.name == place {
            String::new()
        } else {
            format!(" ({place})")
        };
        format!("{}{}{known}", "  ".repeat(depth), c.name)
    });
    let table = Table {
        blocks: view.blocks().collect(),
        rows: view.components().zip(support_counts(view)).collect(),
        titles: titles.collect(),
        anatomy,
    };
    table.print(out);
}

/// What mirrors what, and what doubles what.
fn print_alike(out: &mut String, view: &CompactView<'_>, anatomy: &Anatomy) {
    if let Some(plane) = &anatomy.plane {
        let [x, y, z] = plane.normal;
        let own = anatomy.images.iter().enumerate();
        let own = own
            .filter(|(k, image)| image.is_some_and(|image| image.component == *k))
            .count();
        let paired = anatomy.images.iter().flatten().count() - own;
        let _ = writeln!(
            out,
            "  mirror plane {x:.3} x {y:+.3} y {z:+.3} z = {:.4}, across which {:.0} % of the surface meets itself: {} pairs of components, \
             {own} their own image, {} without one",
            plane.offset,
            100.0 * plane.share,
            paired / 2,
            anatomy.images.len() - own - paired
        );
    } else {
        let _ = writeln!(out, "  no mirror plane: the rest shape has no left and right");
    }
    if anatomy.duplicates.is_empty() {
        let _ = writeln!(
            out,
            "  no duplicates: no two components of a level have a cosine of {DUPLICATE_COSINE} or more"
        );
    }
    for pair in &anatomy.duplicates {
        let [first, second] = [pair.first, pair.second].map(|k| view.component(k).name);
        let _ = writeln!(out, "  duplicates: {first} and {second}, cosine {:.2}", pair.cosine);
    }
}

/// The tree of components, a line each.
struct Table<'a> {
    blocks: Vec<sinew_formats::package::BlockRecord>,
    rows: Vec<(ComponentRecord<'a>, u32)>,
    titles: Vec<String>,
    anatomy: &'a Anatomy,
}

impl Table<'_> {
    fn print(&self, out: &mut String) {
        let width = self
            .titles
            .iter()
            .map(|title| title.chars().count())
            .fold(18, usize::max);
        let _ = writeln!(
            out,
            "{:<width$} {:>6} {:>9} {:>9} {:>18} {:>9}  {:<8} label",
            "component", "scale", "strength", "locality", "range", "vertices", "mirror"
        );
        if let Some(root) = self.blocks.first() {
            self.print_block(out, root.first_component, root.component_count, width);
        }
    }

    /// Depth-first, so that the children of a component stand under it.
    fn print_block(&self, out: &mut String, first: u32, count: u32, width: usize) {
        for k in first..first + count {
            let (c, support) = &self.rows[k as usize];
            let mirror = self.anatomy.images[k as usize].map_or(String::new(), |image| {
                let name = match image.component == k as usize {
                    true => "self",
                    false => self.rows[image.component].0.name,
                };
                format!("{}{name}", if image.reversed { "-" } else { "" })
            });
            let _ = writeln!(
                out,
                "{:<width$} {:>6.2} {:>9.4} {:>9.3} {:>8.2} .. {:>6.2} {:>9}  {:<8} {}",
                self.titles[k as usize],
                c.scale,
                c.strength,
                c.locality,
                c.minimum,
                c.maximum,
                support,
                mirror,
                self.anatomy.labels[k as usize]
            );
            for child in self.blocks.iter().filter(|block| block.parent_component == k) {
                self.print_block(out, child.first_component, child.component_count, width);
            }
        }
    }
}

fn bones_json(bones: &BonesView<'_>) -> serde_json::Value {
    let figures = |error: &PoseError| {
        json!({
            "rms": error.rms, "p99": error.p99, "max": error.max, "normal_rms": error.normal_rms, "poses": error.poses,
        })
    };
    let error = &bones.error;
    json!({
        "count": bones.rest_places.len(), "nodes": bones.node_count, "influences": bones.skin.influences,
        "error": {
            "sliders": figures(&error.sliders), "sliders_scaled": figures(&error.sliders_scaled),
            "shapes": figures(&error.shapes), "shapes_scaled": figures(&error.shapes_scaled),
        },
    })
}

fn print_baked(out: &mut String, view: &BakedView<'_>, byte_count: usize, as_json: bool) {
    let exact = view.exact();
    let mut vertex_counts = vec![0_usize; view.component_count()];
    if let Some(exact) = &exact {
        exact
            .patches
            .entries()
            .for_each(|entry| vertex_counts[entry.component] += 1);
    }
    let tile_count = exact.map(|exact| exact.solve.tiles.len());
    let components: Vec<_> = view
        .components()
        .enumerate()
        .map(|(k, c)| json!({ "name": c.name, "range": [c.minimum, c.maximum], "vertices": vertex_counts[k] }))
        .collect();
    if as_json {
        let summary = json!({
            "kind": "baked", "content_id": hex(view.content_id()), "compact_id": hex(view.compact_id()), "bytes": byte_count,
            "vertices": view.vertex_count(), "faces": view.faces().len(), "blocks": view.block_count(),
            "factor_tiles": tile_count, "components": components, "bones": view.bones().map(|bones| bones_json(&bones)),
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
    let megabytes = byte_count as f64 / 1e6;
    let _ = match exact {
        Some(exact) => writeln!(
            out,
            "  {megabytes:.2} MB: factor {:.2} ({} tiles), components {:.2}",
            (size_of_val(exact.solve.tiles) + size_of_val(exact.solve.inverse_diagonals)) as f64 / 1e6,
            exact.solve.tiles.len(),
            size_of_val(exact.patches.values) as f64 / 1e6
        ),
        None => writeln!(out, "  {megabytes:.2} MB, without the exact tier"),
    };
    let _ = writeln!(
        out,
        "  {} vertices, {} faces, {} components in {} blocks",
        view.vertex_count(),
        view.faces().len(),
        view.component_count(),
        view.block_count()
    );
    if let Some(bones) = view.bones() {
        let _ = writeln!(out, "  {}", super::bake::describe(&bones).replace('\n', "\n  "));
    }
    let _ = writeln!(out);
    let _ = writeln!(out, "{:<18} {:>18} {:>9}", "component", "range", "vertices");
    for (k, c) in view.components().enumerate() {
        let _ = writeln!(
            out,
            "{:<18} {:>8.2} .. {:>6.2} {:>9}",
            c.name, c.minimum, c.maximum, vertex_counts[k]
        );
    }
}
