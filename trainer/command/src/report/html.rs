//! The report: one self-contained HTML file with pictures, tables and words that say what they show.
//!
//! Plain data in ([`Report`]), text out ([`Report::render`]); nothing is measured or drawn here.

use super::color::ColorMap;
use super::image::{Image, ImageError};
use super::svg::{Line, escape, log_chart, number};
use core::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Everything a report shows. Empty lists leave their section out.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Headline.
    pub title: String,
    /// One or two sentences below it.
    pub intro: String,
    /// Facts of the sequence, the training and the package: name and value, in reading order.
    pub facts: Vec<(String, String)>,
    /// Some shapes of the sequence.
    pub sample_shapes: Vec<Picture>,
    /// Components, parents before children.
    pub tree: Vec<ComponentPicture>,
    /// The warm end of the components' scale, with unit, as "0.31 m"; empty where each picture has its own.
    pub component_scale: String,
    /// Shapes not trained on.
    pub comparisons: Vec<Comparison>,
    /// The dark end of the errors' scale, with unit.
    pub error_scale: String,
    /// Errors of this package and of its peers.
    pub error_table: Vec<ErrorRow>,
    /// Training history.
    pub curve: Vec<CurvePoint>,
    /// Configuration, versions, seeds: shown word for word.
    pub provenance: String,
    /// What a reader should bear in mind.
    pub notes: Vec<String>,
}

/// A picture and its caption.
#[derive(Debug, Clone)]
pub struct Picture {
    /// What is seen.
    pub image: Image,
    /// What to see in it; also the alternative text.
    pub caption: String,
}

/// A component in its tree.
#[derive(Debug, Clone)]
pub struct ComponentPicture {
    /// Name of its control.
    pub name: String,
    /// Level l; 0 is the coarsest.
    pub level: usize,
    /// Place in [`Report::tree`] of the component it refines; `None` for the coarsest.
    pub parent: Option<usize>,
    /// The mesh at the component's positive weight, as a heat map of how far each vertex goes.
    pub positive: Image,
    /// The same at its negative weight.
    pub negative: Option<Image>,
    /// Mean length of what it moves in feature space (method.md section 2, I).
    pub strength: f64,
    /// Share of its energy inside its region. Range: 0 to 1.
    pub locality: f64,
    /// Least and largest weight seen in training.
    pub range: [f64; 2],
    /// Where it acts and how, in words.
    pub label: String,
    /// Name of the component that does the same on the other side, where there is one.
    pub mirror: Option<String>,
}

/// One shape, truth beside reconstruction.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// Name of the shape.
    pub shape_name: String,
    /// The shape of the sequence.
    pub truth: Image,
    /// The shape played by the runtime.
    pub reconstruction: Image,
    /// The reconstruction coloured by its distance from the truth.
    pub error: Image,
    /// Error of this shape alone, in thousandths of the bounding ball.
    pub e_rms: f64,
}

/// One method in the table of errors. Numbers that were not measured are `None`.
#[derive(Debug, Clone, Default)]
pub struct ErrorRow {
    /// Name of the method.
    pub method: String,
    /// Number of components, as text: "10 + 38".
    pub components: String,
    /// Error of positions, in thousandths of the bounding ball.
    pub e_rms: Option<f64>,
    /// Spatio-temporal edge difference and its two parts.
    pub sted: Option<f64>,
    /// See `sted`.
    pub sted_spatial: Option<f64>,
    /// See `sted`.
    pub sted_temporal: Option<f64>,
    /// How it was measured.
    pub note: String,
    /// Whether the row is this package's main result.
    pub is_main: bool,
}

/// One point of the training history.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// Step of the optimiser.
    pub step: u64,
    /// Training loss.
    pub loss: f64,
    /// Error on the held-out training shapes, where measured at this step.
    pub validation: Option<f64>,
}

/// Why a report was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A picture could not be encoded.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The file could not be written.
    #[error("cannot write the report {path}: {source}; choose a folder you may write to")]
    Write {
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

impl Report {
    /// The page as text. Errors: a picture that cannot be encoded.
    pub fn render(&self) -> Result<String, ReportError> {
        let mut page = page_head(&self.title, &self.intro);
        write_facts(&mut page, &self.facts);
        self.write_samples(&mut page)?;
        self.write_tree(&mut page)?;
        self.write_comparisons(&mut page)?;
        self.write_errors(&mut page);
        self.write_curve(&mut page);
        self.write_end(&mut page);
        page.push_str(PAGE_END);
        Ok(page)
    }

    /// Renders and writes the page: to a temporary name in the same folder first. Errors: as [`Report::render`], and unwritable paths.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        write_page(&self.render()?, path)
    }

    fn write_samples(&self, page: &mut String) -> Result<(), ReportError> {
        if self.sample_shapes.is_empty() {
            return Ok(());
        }
        section(
            page,
            "The sequence",
            "Some of the shapes that went in. All have the same faces; only the vertices move.",
        );
        page.push_str("<div class=\"grid\">");
        for picture in &self.sample_shapes {
            let _ = write!(
                page,
                "<figure>{}<figcaption>{}</figcaption></figure>",
                img(&picture.image, &picture.caption)?,
                escape(&picture.caption)
            );
        }
        page.push_str("</div>");
        Ok(())
    }

    fn write_tree(&self, page: &mut String) -> Result<(), ReportError> {
        if self.tree.is_empty() {
            return Ok(());
        }
        section(
            page,
            "The components, coarse to fine",
            "A component is one learned movement with one control. Each picture shows the mesh with that control turned up and every \
             other at zero. Clay does not move; the darker the colour, the farther a vertex goes. A coarse component on the left \
             moves a large part; the fine ones beside it refine what happens inside its region. Strength says how much a component \
             deforms, locality how much of that stays inside its region, range which weights occurred in training. The words say where it acts and how.",
        );
        legend(page, ColorMap::Warm, "at rest", &self.component_scale);
        for (k, component) in self.tree.iter().enumerate() {
            // Parents stand before children; whoever names no such parent is a root.
            if component.parent.is_none_or(|parent| parent >= k) {
                self.write_family(page, k)?;
            }
        }
        Ok(())
    }

    fn write_family(&self, page: &mut String, k: usize) -> Result<(), ReportError> {
        page.push_str("<div class=\"family\">");
        self.write_component(page, k)?;
        page.push_str("<div class=\"children\">");
        for (child, component) in self.tree.iter().enumerate().skip(k + 1) {
            if component.parent != Some(k) {
                continue;
            }
            if self.tree[child + 1..].iter().any(|below| below.parent == Some(child)) {
                self.write_family(page, child)?;
            } else {
                self.write_component(page, child)?;
            }
        }
        page.push_str("</div></div>");
        Ok(())
    }

    fn write_component(&self, page: &mut String, k: usize) -> Result<(), ReportError> {
        let component = &self.tree[k];
        let alt = |sign: &str| {
            format!(
                "Component {} at its {sign} weight, coloured by how far the mesh moves",
                component.name
            )
        };
        page.push_str("<figure>");
        if let Some(negative) = &component.negative {
            let _ = write!(
                page,
                "<div class=\"pair\">{}{}</div>",
                img(negative, &alt("negative"))?,
                img(&component.positive, &alt("positive"))?
            );
        } else {
            page.push_str(&img(&component.positive, &alt("positive"))?);
        }
        let _ = write!(
            page,
            "<figcaption><b>{}</b> · level {}<br>{}<br>strength {} · locality {:.0} %<br>range {} to {}",
            escape(&component.name),
            component.level + 1,
            escape(&component.label),
            number(component.strength),
            100.0 * component.locality,
            number(component.range[0]),
            number(component.range[1])
        );
        if let Some(mirror) = &component.mirror {
            let _ = write!(page, "<br>mirror image of {}", escape(mirror));
        }
        page.push_str("</figcaption></figure>");
        Ok(())
    }

    fn write_comparisons(&self, page: &mut String) -> Result<(), ReportError> {
        if self.comparisons.is_empty() {
            return Ok(());
        }
        section(
            page,
            "Shapes it was not trained on",
            "Left the shape of the sequence, in the middle what the runtime plays when its controls are fitted to it, right the same \
             with every vertex coloured by its distance from the truth. All pictures share one scale.",
        );
        legend(page, ColorMap::Cool, "exact", &self.error_scale);
        for comparison in &self.comparisons {
            let name = escape(&comparison.shape_name);
            let figure = |image: &Image, title: &str, words: &str| -> Result<String, ReportError> {
                let alt = format!("{title} of {}", comparison.shape_name);
                Ok(format!(
                    "<figure>{}<figcaption><b>{title}</b> · {words}</figcaption></figure>",
                    img(image, &alt)?
                ))
            };
            let _ = write!(
                page,
                "<div class=\"trio\">{}{}{}</div>",
                figure(&comparison.truth, "Truth", &name)?,
                figure(&comparison.reconstruction, "Reconstruction", &name)?,
                figure(
                    &comparison.error,
                    "Error",
                    &format!("E<sub>rms</sub> {}", number(comparison.e_rms))
                )?
            );
        }
        Ok(())
    }

    fn write_errors(&self, page: &mut String) {
        if self.error_table.is_empty() {
            return;
        }
        section(
            page,
            "How near it comes",
            "Measured on the shapes not trained on. E_rms is the root mean square error of a coordinate, in thousandths of the radius of \
             the ball around the mesh: 1 cannot be seen, 10 can. STED says how unevenly edges are longer or shorter \
             than the truth's, around every vertex and from shape to shape: the eye takes that for wobble and wrinkles, and there may \
             be little of it where E_rms is large. Less is better in both.",
        );
        page.push_str(
            "<div class=\"scroll\"><table><thead><tr><th>method</th><th>components</th><th>E<sub>rms</sub></th><th>STED</th>\
             <th>in space</th><th>in time</th><th class=\"note\">how</th></tr></thead><tbody>",
        );
        for row in &self.error_table {
            let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), number);
            let _ = write!(
                page,
                "<tr{}><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"note\">{}</td></tr>",
                if row.is_main { " class=\"main\"" } else { "" },
                escape(&row.method),
                escape(&row.components),
                cell(row.e_rms),
                cell(row.sted),
                cell(row.sted_spatial),
                cell(row.sted_temporal),
                escape(&row.note)
            );
        }
        page.push_str("</tbody></table></div>");
    }

    fn write_curve(&self, page: &mut String) {
        let line = |name: &str, of: &dyn Fn(&CurvePoint) -> Option<f64>| Line {
            name: name.to_owned(),
            points: self
                .curve
                .iter()
                .filter_map(|point| Some((point.step as f64, of(point)?)))
                .collect(),
        };
        let mut lines = vec![line("training loss", &|point| Some(point.loss))];
        lines.extend(Some(line("validation", &|point| point.validation)).filter(|line| !line.points.is_empty()));
        let chart = log_chart(&lines, "step", "loss");
        if !chart.is_empty() {
            section(
                page,
                "Training",
                "The loss falls on shapes it learns from; validation is measured on training shapes held back, and the weights kept are \
                 those where it was lowest.",
            );
            page.push_str(&chart);
        }
    }

    fn write_end(&self, page: &mut String) {
        if !self.notes.is_empty() {
            page.push_str("<section><h2>Bear in mind</h2><ul>");
            for note in &self.notes {
                let _ = write!(page, "<li>{}</li>", escape(note));
            }
            page.push_str("</ul></section>");
        }
        if !self.provenance.is_empty() {
            let _ = write!(
                page,
                "<section><h2>Where it comes from</h2><details><summary>Configuration and versions</summary><pre>{}</pre></details></section>",
                escape(&self.provenance)
            );
        }
    }
}

/// What ends every page.
pub const PAGE_END: &str = "</main></body></html>\n";

/// Everything up to the first section.
pub fn page_head(title: &str, intro: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title}</title><style>{style}</style></head><body><main><h1>{title}</h1><p class=\"lead\">{intro}</p>",
        title = escape(title),
        style = include_str!("report.css"),
        intro = escape(intro)
    )
}

/// Facts, name and value, in reading order; none leaves the list out.
pub fn write_facts(page: &mut String, facts: &[(String, String)]) {
    if facts.is_empty() {
        return;
    }
    page.push_str("<dl class=\"facts\">");
    for (name, value) in facts {
        let _ = write!(page, "<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value));
    }
    page.push_str("</dl>");
}

/// Writes a page: to a temporary name in the same folder first. Errors: unwritable paths.
pub fn write_page(page: &str, path: &Path) -> Result<(), ReportError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let store = || -> std::io::Result<()> {
        let mut builder = tempfile::Builder::new();
        // Temporary files are private by default; a report is to be read by others, as far as the umask lets them.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder.tempfile_in(folder)?;
        file.write_all(page.as_bytes())?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    };
    store().map_err(|source| ReportError::Write {
        path: path.to_owned(),
        source,
    })
}

/// Headline of a section and what to see in it.
pub fn section(page: &mut String, title: &str, words: &str) {
    let _ = write!(
        page,
        "<h2>{}</h2><p class=\"why\">{}</p>",
        escape(title),
        escape(words).replace("E_rms", "E<sub>rms</sub>")
    );
}

/// What the ends of a map of colours mean.
pub fn legend(page: &mut String, map: ColorMap, from: &str, to: &str) {
    let _ = write!(
        page,
        "<div class=\"legend\"><span>{}</span><i style=\"background:{}\"></i><span>{}</span></div>",
        escape(from),
        map.css_gradient(),
        escape(if to.is_empty() { "most" } else { to })
    );
}

/// An image in the page itself. Errors: one that cannot be encoded.
pub fn img(image: &Image, alt: &str) -> Result<String, ReportError> {
    Ok(format!(
        "<img src=\"{}\" width=\"{}\" height=\"{}\" loading=\"lazy\" alt=\"{}\">",
        image.data_uri()?,
        image.width,
        image.height,
        escape(alt)
    ))
}
