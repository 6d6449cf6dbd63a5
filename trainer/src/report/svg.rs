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

    let mut svg = format!(
        "<svg class=\"chart\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{} over {}\">",
        SIZE.0,
        SIZE.1,
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
        let _ = write!(
            svg,
            "<text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
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
            i % 4,
            path.join(" ")
        );
        let x = left + 12.0 + 150.0 * i as f64;
        let _ = write!(
            svg,
            "<line class=\"line l{}\" x1=\"{x}\" x2=\"{}\" y1=\"{y}\" y2=\"{y}\"/><text class=\"axis\" x=\"{}\" y=\"{}\">{}</text>",
            i % 4,
            x + 18.0,
            x + 24.0,
            SIZE.1 - 6.0,
            escape(&line.name),
            y = SIZE.1 - 10.0
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
