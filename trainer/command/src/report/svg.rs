//! Charts as inline SVG, coloured by the page's style sheet, so that they follow light and dark.

use core::fmt::Write;

/// One line of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Name in the legend.
    pub name: String,
    /// Points (x, y). Those that are not finite, or not positive in y, are left out.
    pub points: Vec<(f64, f64)>,
}

/// Size of a chart in its own units; the page scales it.
const SIZE: (f64, f64) = (760.0, 300.0);
/// Room for labels: left, right, top, bottom.
const MARGINS: (f64, f64, f64, f64) = (64.0, 18.0, 16.0, 44.0);
/// Colours that the style sheet has for lines.
const COLOR_COUNT: usize = 10;
/// Lines that the legend has room for beside the name of the x axis; more go below, so many a row.
const LEGEND_BESIDE_AXIS: usize = 3;
/// See [`LEGEND_BESIDE_AXIS`].
const LEGEND_PER_ROW: usize = 4;
/// Height of a row of the legend, or of a bar.
const ROW_HEIGHT: f64 = 20.0;
/// Points drawn of one line; more would not be seen.
const POINT_COUNT_MAX: usize = 600;

/// A line chart with a logarithmic y axis; empty where no line has a point to draw.
pub fn log_chart(lines: &[Line], x_name: &str, y_name: &str) -> String {
    let drawable = |&(x, y): &(f64, f64)| x.is_finite() && y.is_finite() && y > 0.0;
    let points = || {
        lines
            .iter()
            .flat_map(|line| line.points.iter().copied().filter(drawable))
    };
    let fold = |pick: fn(f64, f64) -> f64, of: fn((f64, f64)) -> f64| points().map(of).reduce(pick);
    let (Some(x_low), Some(x_high)) = (fold(f64::min, |p| p.0), fold(f64::max, |p| p.0)) else {
        return String::new();
    };
    let (Some(y_low), Some(y_high)) = (fold(f64::min, |p| p.1), fold(f64::max, |p| p.1)) else {
        return String::new();
    };
    let (low, high) = (y_low.log10() - 0.05, y_high.log10() + 0.05);
    let x_range = if x_high > x_low { x_high - x_low } else { 1.0 };
    let (left, right, top, bottom) = MARGINS;
    let x_of = |x: f64| left + (x - x_low) / x_range * (SIZE.0 - left - right);
    let y_of = |y: f64| top + (high - y.log10()) / (high - low) * (SIZE.1 - top - bottom);

    let legend_rows = if lines.len() > LEGEND_BESIDE_AXIS {
        lines.len().div_ceil(LEGEND_PER_ROW)
    } else {
        0
    };
    let mut svg = format!(
        "<svg class=\"chart\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{} over {}\">",
        SIZE.0,
        SIZE.1 + ROW_HEIGHT * legend_rows as f64,
        escape(y_name),
        escape(x_name)
    );
    for y in log_ticks(low, high) {
        let at = y_of(y);
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{left}\" x2=\"{:.1}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
             <text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            SIZE.0 - right,
            left - 8.0,
            at + 4.0,
            number(y)
        );
    }
    for i in 0..=4 {
        let x = x_low + x_range * f64::from(i) / 4.0;
        // A long last number would leave the picture.
        let anchor = if i == 4 { "end" } else { "middle" };
        let _ = write!(
            svg,
            "<text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
            x_of(x),
            SIZE.1 - bottom + 20.0,
            number(x)
        );
    }
    let _ = write!(
        svg,
        "<text class=\"axis\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
        SIZE.0 - right,
        SIZE.1 - 6.0,
        escape(x_name)
    );
    for (i, line) in lines.iter().enumerate() {
        let kept: Vec<_> = line.points.iter().copied().filter(drawable).collect();
        let step = kept.len().div_ceil(POINT_COUNT_MAX).max(1);
        let path: Vec<String> = kept
            .iter()
            .step_by(step)
            .map(|&(x, y)| format!("{:.1},{:.1}", x_of(x), y_of(y)))
            .collect();
        let _ = write!(
            svg,
            "<polyline class=\"line l{}\" points=\"{}\"/>",
            i % COLOR_COUNT,
            path.join(" ")
        );
        let (x, base) = if legend_rows > 0 {
            let row = (i / LEGEND_PER_ROW) as f64;
            (
                12.0 + (SIZE.0 - 12.0) / LEGEND_PER_ROW as f64 * (i % LEGEND_PER_ROW) as f64,
                SIZE.1 + ROW_HEIGHT * (row + 0.5),
            )
        } else {
            (left + 12.0 + 150.0 * i as f64, SIZE.1 - 6.0)
        };
        let _ = write!(
            svg,
            "<line class=\"line l{}\" x1=\"{x}\" x2=\"{}\" y1=\"{y}\" y2=\"{y}\"/><text class=\"axis\" x=\"{}\" y=\"{}\">{}</text>",
            i % COLOR_COUNT,
            x + 18.0,
            x + 24.0,
            base,
            escape(&line.name),
            y = base - 4.0
        );
    }
    svg.push_str("</svg>");
    svg
}

/// One bar of [`bar_chart`].
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    /// What stands before it.
    pub name: String,
    /// Its length. Bars that are not finite, or negative, are left out.
    pub value: f64,
    /// Number of its colour.
    pub color: usize,
}

/// Horizontal bars from zero, each with its number; empty where there is none to draw.
pub fn bar_chart(bars: &[Bar], name: &str) -> String {
    let bars: Vec<&Bar> = bars
        .iter()
        .filter(|bar| bar.value.is_finite() && bar.value >= 0.0)
        .collect();
    let most = bars.iter().map(|bar| bar.value).fold(0.0, f64::max);
    if bars.is_empty() {
        return String::new();
    }
    let (label_width, number_width) = (250.0, 70.0);
    let scale = if most > 0.0 {
        (SIZE.0 - label_width - number_width) / most
    } else {
        0.0
    };
    let mut svg = format!(
        "<svg class=\"chart\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">",
        SIZE.0,
        ROW_HEIGHT * (bars.len() + 1) as f64,
        escape(name)
    );
    for (row, bar) in bars.iter().enumerate() {
        let y = ROW_HEIGHT * (row as f64 + 0.5);
        let length = scale * bar.value;
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\
             <rect class=\"bar b{}\" x=\"{label_width}\" y=\"{:.1}\" width=\"{length:.1}\" height=\"12\" rx=\"2\"/>\
             <text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            label_width - 10.0,
            y + 14.0,
            escape(&bar.name),
            bar.color % COLOR_COUNT,
            y + 4.0,
            label_width + length + 8.0,
            y + 14.0,
            number(bar.value)
        );
    }
    svg.push_str("</svg>");
    svg
}

/// 1, 2 and 5 times powers of ten inside the range; powers alone where the range is wide.
fn log_ticks(low: f64, high: f64) -> Vec<f64> {
    let factors: &[f64] = if high - low > 2.5 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    (low.floor() as i32..=high.ceil() as i32)
        .flat_map(|power| factors.iter().map(move |factor| factor * 10f64.powi(power)))
        .filter(|tick| (low..=high).contains(&tick.log10()))
        .collect()
}

/// A number with three digits that count, for people.
pub fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return if x == 0.0 { "0".to_owned() } else { "–".to_owned() };
    }
    match x.abs() {
        size if !(1e-4..9999.5).contains(&size) => format!("{x:.2e}"),
        size if size >= 99.95 => format!("{x:.0}"),
        size if size >= 9.995 => format!("{x:.1}"),
        size if size >= 0.9995 => format!("{x:.2}"),
        _ => format!("{x:.4}"),
    }
}

/// Text that is safe inside HTML and its attributes.
pub fn escape(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut safe, c| {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c => safe.push(c),
        }
        safe
    })
}
