//! The subcommands, one file each.

pub mod bake;
pub mod convert;
pub mod demo;
pub mod encode;
pub mod evaluate;
pub mod export;
pub mod frame;
pub mod inspect;
pub mod inspect_file;
pub mod rename;
pub mod synthesize;
pub mod train;

use clap::Args;
use miette::{IntoDiagnostic, Report};
use sinew_interchange::RenderSurface;
use sinew_runtime::Basis;
use sinew_trainer::components::labels::{Axes, Axis};

/// Which way the rest shape stands, for labels.
#[derive(Args)]
struct Standing {
    /// The axis that points up, for labels [default: y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    up: Option<Axis>,
    /// The axis that points to the front, for labels [default: z; where z is up, -y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    front: Option<Axis>,
}

impl Standing {
    /// Whether an axis was named.
    fn is_said(&self) -> bool {
        self.up.is_some() || self.front.is_some()
    }

    fn axes(&self) -> Result<Axes, Report> {
        Axes::new(self.up, self.front).into_diagnostic()
    }
}

/// What an engine draws of a package, where it has texture coordinates.
fn render_surface(basis: &Basis<'_>) -> Option<RenderSurface> {
    let drawn = basis.surface();
    drawn.has_texture().then(|| RenderSurface {
        vertices: basis.render_vertices().collect(),
        uvs: drawn.uvs.to_vec(),
        faces: drawn.drawn_faces().to_vec(),
    })
}

/// A number above 0.
fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(rate),
        _ => Err(format!("`{text}` is not a number above 0")),
    }
}
