//! The page of `sinew-lab compare`: one self-contained file with the table, the plots, and where each method errs. Figures come
//! from [`Comparison`]; nothing is measured here but the distances that pictures show.

use core::fmt::Write as _;
use std::path::Path;

use sinew_interchange::MeshSequence;

use crate::compare::{ComparedShapes, Comparison, LOCAL_RADIUS, Method, Projection, ProjectionKind};
use sinew_command::report::color::ColorMap;
use sinew_command::report::html::{PAGE_END, ReportError, img, legend, page_head, section, write_facts, write_page};
use sinew_command::report::image::Image;
use sinew_command::report::pictures::{Studio, distances, quantile};
use sinew_command::report::raster::Style;
use sinew_command::report::svg::{Bar, Line, bar_chart, escape, log_chart, number};
use sinew_trainer::features::align::{RigidMotion, widened};
use sinew_trainer::learn::draft::bounding_diagonal;

/// The page, drawn.
#[derive(Debug, Clone)]
pub struct ComparisonPage(String);

impl ComparisonPage {
    /// As text.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Writes it. Errors: unwritable paths.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        write_page(&self.0, path)
    }
}

/// A method's best result, shape by shape.
struct Best<'c> {
    method: &'c Method,
    projection: &'c Projection,
    /// Laid onto the truth. Shape: `[N][V]`.
    shapes: Vec<Vec<[f32; 3]>>,
    /// Distances from the truth. Shape: `[N][V]`.
    errors: Vec<Vec<f32>>,
    /// Root mean square of each row of `errors`.
    means: Vec<f64>,
}

impl Best<'_> {
    fn worst(&self) -> usize {
        greatest(&self.means)
    }
}

/// Draws the page. Errors: a picture that cannot be encoded.
pub fn comparison_page(
    comparison: &Comparison,
    shapes: &ComparedShapes,
    sequence: &MeshSequence,
) -> Result<ComparisonPage, ReportError> {
    let mut page = page_head(
        &format!("{}: methods side by side", comparison.sequence),
        "Every method was trained on the same shapes with the same number of components, and measured on shapes it never saw.",
    );
    write_facts(
        &mut page,
        &[
            ("Mesh".to_owned(), format!("{} vertices", comparison.vertices)),
            (
                "Shapes".to_owned(),
                format!(
                    "{} for training, {} measured",
                    comparison.train_shapes, comparison.test_shapes
                ),
            ),
            ("Components".to_owned(), format!("at most {}", comparison.components)),
            ("Seed".to_owned(), comparison.seed.to_string()),
        ],
    );
    write_bars(&mut page, comparison);
    write_table(&mut page, comparison);
    write_handles(&mut page, comparison);
    write_pictures(&mut page, comparison, shapes, sequence)?;
    page.push_str(PAGE_END);
    Ok(ComparisonPage(page))
}

fn write_bars(page: &mut String, comparison: &Comparison) {
    section(
        page,
        "Errors on unseen shapes",
        "E_rms: root mean square error of a coordinate, in thousandths of the radius of the ball around the mesh. STED: how unevenly \
         edges are longer or shorter than the truth's, around every vertex and from shape to shape, which the eye takes for wobble. \
         Less is better in both. Colours say how the weights of a shape were found; only bars of one colour compare like with like.",
    );
    let colored = [
        (ProjectionKind::Positions, 0, "fitted in positions"),
        (ProjectionKind::Features, 1, "fitted in features"),
        (ProjectionKind::LinearEncoder, 3, "by one linear map of the features"),
        (ProjectionKind::Encoder, 2, "by a network, in one pass"),
    ];
    for (name, of) in [
        ("E_rms", (|p| p.scores.e_rms) as fn(&Projection) -> f64),
        ("STED", |p| p.scores.sted),
    ] {
        let mut bars = Vec::new();
        for (kind, color, _) in colored {
            let rows = comparison.methods.iter().flat_map(|method| {
                let projections = method.projections.iter().filter(|p| p.kind == kind);
                projections.map(|projection| (method.name.as_str(), of(projection)))
            });
            bars.extend(rows.map(|(method, value)| Bar {
                name: method.to_owned(),
                value,
                color,
            }));
        }
        let _ = write!(page, "<h3>{}</h3>", escape(name));
        page.push_str("<p class=\"why\">");
        for (_, color, words) in colored {
            let _ = write!(page, "<span><i class=\"key k{color}\"></i>{words}</span> ");
        }
        page.push_str("</p>");
        page.push_str(&bar_chart(&bars, name));
    }
}

fn write_table(page: &mut String, comparison: &Comparison) {
    section(
        page,
        "All figures",
        &format!(
            "K: components that are not zero. Missed: share of a shape's energy, in the method's own features, that its components do \
             not give back, for the worst shape. Local: share of a component's energy within {LOCAL_RADIUS} of the longest distance \
             from its centre. Basis: its numbers alone, at four and two bytes each, zeros left out. Peak: most memory that training held at once, the sequence and its \
             features not counted but in Sinew's own.",
        ),
    );
    page.push_str(
        "<div class=\"scroll\"><table><thead><tr><th>method</th><th class=\"note\">source</th><th class=\"note\">fitted in</th><th>K</th>\
         <th>E<sub>rms</sub></th><th>STED</th><th>missed</th><th>local</th><th>training</th><th>peak</th><th>basis</th><th>package</th></tr></thead><tbody>",
    );
    let kilobytes = |bytes: usize| format!("{:.0} kB", bytes as f64 / 1e3);
    for method in &comparison.methods {
        for (row, projection) in method.projections.iter().enumerate() {
            let first = |text: String| if row == 0 { text } else { String::new() };
            let main = method.package_bytes.is_some() && method.name == "Sinew";
            let _ = write!(
                page,
                "<tr{}><td>{}</td><td class=\"note\">{}</td><td class=\"note\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
                 <td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                if main { " class=\"main\"" } else { "" },
                escape(&first(method.name.clone())),
                escape(&first(method.source.clone())),
                projection.kind.name(),
                first(method.components.to_string()),
                number(projection.scores.e_rms),
                number(projection.scores.sted),
                projection.max_percentage_error.map_or_else(|| "–".to_owned(), number),
                first(format!("{:.0} %", 100.0 * method.locality)),
                first(
                    method
                        .training_seconds
                        .map_or_else(|| "before".to_owned(), |s| format!("{s:.1} s"))
                ),
                first(
                    method
                        .peak_bytes
                        .map_or_else(|| "–".to_owned(), |bytes| format!("{:.1} MB", bytes as f64 / 1e6))
                ),
                first(format!(
                    "{} / {}",
                    kilobytes(method.basis_bytes_f32),
                    kilobytes(method.basis_bytes_f16)
                )),
                first(method.package_bytes.map_or_else(|| "–".to_owned(), kilobytes)),
            );
        }
    }
    let _ = write!(
        page,
        "<tr><td>No components</td><td class=\"note\">positions to features and back</td><td></td><td></td><td>{}</td><td>{}</td>\
         <td></td><td></td><td></td><td></td><td></td><td></td></tr></tbody></table></div>",
        number(comparison.round_trip.e_rms),
        number(comparison.round_trip.sted)
    );
    for (method, note) in comparison.methods.iter().filter_map(|m| Some((m, m.note.as_ref()?))) {
        let _ = write!(page, "<p class=\"why\">{}: {}.</p>", escape(&method.name), escape(note));
    }
}

fn write_handles(page: &mut String, comparison: &Comparison) {
    let lines: Vec<Line> = comparison
        .methods
        .iter()
        .map(|method| Line {
            name: method.name.clone(),
            points: comparison
                .control_points
                .iter()
                .zip(&method.control_point_e_rms)
                .map(|(&count, &error)| (count as f64, error))
                .collect(),
        })
        .collect();
    let chart = log_chart(&lines, "control points", "E_rms");
    if !chart.is_empty() {
        section(
            page,
            "Moved by control points",
            "Only so many vertices, spread over the mesh, are told where to go; the components must know the rest. E_rms of some unseen \
             shapes. A method whose components know what belongs together is good with few points already.",
        );
        page.push_str(&chart);
    }
}

fn write_pictures(
    page: &mut String,
    comparison: &Comparison,
    shapes: &ComparedShapes,
    sequence: &MeshSequence,
) -> Result<(), ReportError> {
    let bests: Vec<Best<'_>> = comparison
        .methods
        .iter()
        .zip(&shapes.reconstructions)
        .filter_map(|(method, found)| best(method, found, &shapes.truth))
        .collect();
    if bests.is_empty() {
        return Ok(());
    }
    let rest = &sequence.shapes[0];
    let all: Vec<&[[f32; 3]]> = shapes.truth.iter().map(Vec::as_slice).collect();
    let studio = Studio::new(rest, &sequence.faces, &all, Style::new(360, 270));
    // One scale for all pictures, that one bad method cannot stretch.
    let ends: Vec<f32> = bests
        .iter()
        .map(|best| quantile(&best.errors[best.worst()], 0.99))
        .collect();
    let most = quantile(&ends, 0.6);
    let scale = format!("{:.1} % of the bounding box", 100.0 * most / bounding_diagonal(rest));
    let picture = |best: &Best<'_>, n: usize| studio.heat(&best.shapes[n], &best.errors[n], ColorMap::Cool, 0.0, most);
    let caption = |best: &Best<'_>, n: usize| {
        format!(
            "{} · shape {} · fitted in {} · {} of the bounding box",
            best.method.name,
            shapes.shapes[n],
            best.projection.kind.name(),
            percent(best.means[n] / f64::from(bounding_diagonal(rest)))
        )
    };
    // The shape that is hard for most.
    let medians: Vec<f64> = (0..shapes.truth.len())
        .map(|n| {
            let mut errors: Vec<f64> = bests.iter().map(|best| best.means[n]).collect();
            errors.sort_by(f64::total_cmp);
            errors[errors.len() / 2]
        })
        .collect();
    let hard = greatest(&medians);
    section(
        page,
        "One shape, all methods",
        "The unseen shape that is hardest for most: first the truth, then each method by its best way to find weights, every vertex \
         coloured by its distance from the truth.",
    );
    legend(page, ColorMap::Cool, "exact", &scale);
    page.push_str("<div class=\"grid\">");
    figure(
        page,
        &studio.shape(&shapes.truth[hard]),
        &format!("Truth · shape {}", shapes.shapes[hard]),
    )?;
    for best in &bests {
        figure(page, &picture(best, hard), &caption(best, hard))?;
    }
    page.push_str("</div>");
    section(
        page,
        "The worst of each",
        "For every method the unseen shape that it misses most, on the same scale.",
    );
    legend(page, ColorMap::Cool, "exact", &scale);
    page.push_str("<div class=\"grid\">");
    for best in &bests {
        let worst = best.worst();
        figure(page, &picture(best, worst), &caption(best, worst))?;
    }
    page.push_str("</div>");
    Ok(())
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

fn figure(page: &mut String, image: &Image, caption: &str) -> Result<(), ReportError> {
    let _ = write!(
        page,
        "<figure>{}<figcaption>{}</figcaption></figure>",
        img(image, caption)?,
        escape(caption)
    );
    Ok(())
}

/// The projection with the least E_rms.
fn best<'c>(method: &'c Method, found: &[Vec<Vec<[f32; 3]>>], truth: &[Vec<[f32; 3]>]) -> Option<Best<'c>> {
    let pairs = method.projections.iter().zip(found);
    let (projection, found) = pairs.min_by(|a, b| a.0.scores.e_rms.total_cmp(&b.0.scores.e_rms))?;
    let laid = |(shape, truth): (&Vec<[f32; 3]>, &Vec<[f32; 3]>)| -> Vec<[f32; 3]> {
        let shape = widened(shape);
        let motion = RigidMotion::onto(&widened(truth), &shape);
        shape.iter().map(|&p| motion.apply(p).map(|x| x as f32)).collect()
    };
    let shapes: Vec<Vec<[f32; 3]>> = found.iter().zip(truth).map(laid).collect();
    let errors: Vec<Vec<f32>> = shapes
        .iter()
        .zip(truth)
        .map(|(shape, truth)| distances(truth, shape))
        .collect();
    let mean = |errors: &Vec<f32>| {
        let squares: f64 = errors.iter().map(|&e| f64::from(e) * f64::from(e)).sum();
        (squares / errors.len().max(1) as f64).sqrt()
    };
    Some(Best {
        method,
        projection,
        means: errors.iter().map(mean).collect(),
        shapes,
        errors,
    })
}

/// The first of the greatest.
fn greatest(values: &[f64]) -> usize {
    (0..values.len())
        .rev()
        .max_by(|&a, &b| values[a].total_cmp(&values[b]))
        .unwrap_or(0)
}
