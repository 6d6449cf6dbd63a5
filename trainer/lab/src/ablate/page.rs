//! The page of `sinew-lab ablate`: one self-contained file with a table for every question, curves over λ and the grid of
//! distances. Figures come from [`Ablation`]; nothing is measured here.

use core::fmt::Write as _;
use std::path::Path;

use crate::ablate::plan::Group;
use crate::ablate::{Ablation, Figures, Outcome, Row};
use sinew_command::report::html::{PAGE_END, ReportError, page_head, section, write_facts, write_page};
use sinew_command::report::svg::{Line, escape, log_chart, number};

/// The page, drawn.
#[derive(Debug, Clone)]
pub struct AblationPage(String);

impl AblationPage {
    /// Draws the page.
    pub fn new(ablation: &Ablation) -> Self {
        let mut page = page_head(
            &format!("{}: what each choice is worth", ablation.sequence),
            "Every row was trained on the same shapes with one choice changed, and measured on shapes it never saw.",
        );
        let length = if ablation.quick {
            "cut short: rough comparisons only"
        } else {
            "whole"
        };
        let recipe = serde_json::to_string(&ablation.recipe).unwrap_or_default();
        write_facts(
            &mut page,
            &[
                ("Mesh".to_owned(), format!("{} vertices", ablation.vertices)),
                (
                    "Shapes".to_owned(),
                    format!(
                        "{} for training, {} measured",
                        ablation.train_shapes, ablation.test_shapes
                    ),
                ),
                ("Recipe".to_owned(), recipe.trim_matches('"').to_owned()),
                ("Trainings".to_owned(), length.to_owned()),
                ("Seed".to_owned(), ablation.seed.to_string()),
            ],
        );
        for group in Group::ALL {
            let rows: Vec<&Row> = ablation.rows.iter().filter(|row| row.group == group).collect();
            if rows.is_empty() {
                continue;
            }
            section(&mut page, group.title(), group.words());
            if matches!(group, Group::Lambda1 | Group::Lambda2) {
                page.push_str(&curve(
                    &rows,
                    if group == Group::Lambda1 {
                        "log10 λ1"
                    } else {
                        "log10 λ2"
                    },
                ));
            }
            if group == Group::Reach {
                write_grid(&mut page, &rows);
            }
            write_table(&mut page, &rows);
        }
        page.push_str(PAGE_END);
        Self(page)
    }

    /// As text.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Writes it. Errors: unwritable paths.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        write_page(&self.0, path)
    }
}

fn figures(row: &Row) -> Option<&Figures> {
    match &row.outcome {
        Outcome::Measured(figures) => Some(figures),
        Outcome::Failed(_) => None,
    }
}

/// E_rms over the logarithm of the weight; a weight of zero has no place there and stands in the table alone.
fn curve(rows: &[&Row], name: &str) -> String {
    let of: [(&str, fn(&Figures) -> f64); 3] = [
        ("encoder", |f| f.encoder.e_rms),
        ("features", |f| f.feature_projection.e_rms),
        ("positions", |f| f.position_projection.e_rms),
    ];
    let lines: Vec<Line> = of
        .iter()
        .map(|(name, value)| Line {
            name: (*name).to_owned(),
            points: rows
                .iter()
                .filter_map(|row| Some((row.place.first()?.log10(), value(figures(row)?))))
                .collect(),
        })
        .collect();
    log_chart(&lines, name, "E_rms")
}

/// E_rms of encoder and position projection, d1 down and d2 across.
fn write_grid(page: &mut String, rows: &[&Row]) {
    let sorted = |axis: usize| {
        let mut values: Vec<f64> = rows.iter().filter_map(|row| row.place.get(axis).copied()).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    let (down, across) = (sorted(0), sorted(1));
    page.push_str("<div class=\"scroll\"><table><thead><tr><th>E<sub>rms</sub>, encoder / positions</th>");
    for d2 in &across {
        let _ = write!(page, "<th>d2 {d2}</th>");
    }
    page.push_str("</tr></thead><tbody>");
    for d1 in &down {
        let _ = write!(page, "<tr><td>d1 {d1}</td>");
        for d2 in &across {
            let row = rows.iter().find(|row| row.place == [*d1, *d2]);
            let text = row.copied().and_then(figures).map_or_else(
                || "–".to_owned(),
                |f| format!("{} / {}", number(f.encoder.e_rms), number(f.position_projection.e_rms)),
            );
            let _ = write!(page, "<td>{text}</td>");
        }
        page.push_str("</tr>");
    }
    page.push_str("</tbody></table></div>");
}

fn write_table(page: &mut String, rows: &[&Row]) {
    page.push_str(
        "<div class=\"scroll\"><table><thead><tr><th></th><th>K</th><th>encoder E<sub>rms</sub></th><th>STED</th>\
         <th>features E<sub>rms</sub></th><th>STED</th><th>positions E<sub>rms</sub></th><th>STED</th>\
         <th>missed, trained</th><th>missed, unseen</th><th>steps</th><th>training</th></tr></thead><tbody>",
    );
    for row in rows {
        let class = if row.is_base { " class=\"main\"" } else { "" };
        let _ = write!(page, "<tr{class}><td>{}</td>", escape(&row.name));
        match &row.outcome {
            Outcome::Failed(why) => {
                let _ = write!(page, "<td class=\"note\" colspan=\"11\">failed: {}</td>", escape(why));
            }
            Outcome::Measured(f) => {
                let _ = write!(page, "<td>{} of {}</td>", f.components, f.components_asked);
                for scores in [&f.encoder, &f.feature_projection, &f.position_projection] {
                    let _ = write!(
                        page,
                        "<td>{}</td><td>{}</td>",
                        number(scores.e_rms),
                        number(scores.sted)
                    );
                }
                let _ = write!(
                    page,
                    "<td>{}</td><td>{}</td><td>{}</td><td>{:.0} s</td>",
                    number(f.missed_training),
                    number(f.missed_unseen),
                    f.steps,
                    f.training_seconds
                );
            }
        }
        page.push_str("</tr>");
    }
    page.push_str("</tbody></table></div>");
}

#[cfg(test)]
mod tests {
    use super::*;
    use sinew_trainer::config::Recipe;
    use sinew_trainer::evaluate::Scores;

    #[test]
    fn curves_grids_failures_and_the_base_are_on_the_page() {
        let scores = Scores {
            e_rms: 4.25,
            sted: 0.02,
            sted_s: 0.02,
            sted_t: 0.03,
        };
        let measured = Outcome::Measured(Box::new(Figures {
            components_asked: 60,
            components: 57,
            encoder: scores,
            feature_projection: scores,
            position_projection: scores,
            missed_training: 0.01,
            missed_unseen: 0.04,
            steps: 300,
            stop_reason: "all steps done".to_owned(),
            training_seconds: 12.0,
            package_bytes: 1000,
        }));
        let row = |group, name: &str, place: &[f64], is_base, outcome: &Outcome| Row {
            group,
            name: name.to_owned(),
            place: place.to_vec(),
            is_base,
            outcome: outcome.clone(),
        };
        let failed = Outcome::Failed("no <luck>".to_owned());
        let ablation = Ablation {
            sequence: "walk".to_owned(),
            vertices: 100,
            train_shapes: 5,
            test_shapes: 20,
            seed: 0,
            recipe: Recipe::Local,
            quick: true,
            rows: vec![
                row(Group::Reach, "d1 0.2, d2 0.1", &[0.2, 0.1], false, &measured),
                row(Group::Reach, "d1 0.4, d2 0.2", &[0.4, 0.2], true, &failed),
                row(Group::Lambda2, "λ2 0", &[0.0], false, &measured),
                row(Group::Lambda2, "λ2 1", &[1.0], true, &measured),
                row(Group::Lambda2, "λ2 10", &[10.0], false, &measured),
            ],
        };
        let page = AblationPage::new(&ablation);
        let text = page.text();
        assert_eq!(text.matches("<polyline").count(), 3, "three curves");
        assert!(text.contains("d2 0.1") && text.contains("4.25 / 4.25") && text.contains("57 of 60"));
        assert!(text.contains("failed: no &lt;luck&gt;") && text.contains("cut short"));
        assert_eq!(text.matches("<tr class=\"main\">").count(), 2);
        assert!(
            !text.contains(Group::Levels.words()),
            "what was not asked has no section"
        );
    }
}
