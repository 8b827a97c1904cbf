//! Axes and marks of the pictures, as inline SVG that takes its colours from the page.

use std::fmt::Write as _;

use maud::{Markup, html};

use super::number_format::fixed;

/// A range of values, laid over a range of pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    low: f64,
    high: f64,
    from_px: f64,
    to_px: f64,
}

impl Axis {
    /// An axis over the range of all finite `values`; `None` if there are none.
    pub fn over(values: impl IntoIterator<Item = f64>, from_px: f64, to_px: f64) -> Option<Self> {
        let (low, high) = values
            .into_iter()
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        (low <= high).then(|| Self::between(low, high, from_px, to_px))
    }

    /// An axis from `low` to `high`, widened if the range is empty.
    pub fn between(low: f64, high: f64, from_px: f64, to_px: f64) -> Self {
        let enough = 1e-9 * low.abs().max(high.abs()).max(1e-3);
        let (low, high) = if high - low < enough {
            let room = 0.05 * low.abs().max(1e-3);
            (low - room, high + room)
        } else {
            (low, high)
        };
        Self {
            low,
            high,
            from_px,
            to_px,
        }
    }

    /// Extends the axis by `share` of its range at both ends.
    #[must_use]
    pub fn padded(mut self, share: f64) -> Self {
        let room = share * (self.high - self.low);
        self.low -= room;
        self.high += room;
        self
    }

    /// Position of a value, clamped to the ends \[px\].
    pub fn px(&self, value: f64) -> f64 {
        let share = ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0);
        self.from_px + share * (self.to_px - self.from_px)
    }

    /// Whether a value is within the axis.
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// About `count` round values, with their labels.
    pub fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        let rough = (self.high - self.low) / count.max(1) as f64;
        let decade = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|factor| factor * decade)
            .find(|step| *step >= rough * 0.999)
            .unwrap_or(decade);
        if !step.is_normal() {
            return Vec::new();
        }
        let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last)
            .take(3 * count + 3)
            .map(|k| {
                let value = k as f64 * step;
                (value, fixed(value, decimals))
            })
            .collect()
    }
}

/// A rectangle with values along both sides.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Horizontal axis, along the lower side.
    pub x: Axis,
    /// Vertical axis, along the left side.
    pub y: Axis,
}

impl Panel {
    /// Grid, ticks and names of the axes; `x_name` is `None` if the panel below has it.
    pub fn frame(
        &self,
        x_ticks: usize,
        y_ticks: usize,
        x_name: Option<&str>,
        y_name: &str,
    ) -> Markup {
        let (left, right) = (self.x.from_px, self.x.to_px);
        let (bottom, top) = (self.y.from_px, self.y.to_px);
        let middle = f64::midpoint(left, right);
        html! {
            rect.panel x=(r(left)) y=(r(top)) width=(r(right - left)) height=(r(bottom - top)) {}
            @for (value, text) in self.y.ticks(y_ticks) {
                line.grid x1=(r(left)) x2=(r(right)) y1=(r(self.y.px(value))) y2=(r(self.y.px(value))) {}
                text.tick.end x=(r(left - 7.0)) y=(r(self.y.px(value) + 4.0)) { (text) }
            }
            @for (value, text) in self.x.ticks(x_ticks) {
                line.grid x1=(r(self.x.px(value))) x2=(r(self.x.px(value))) y1=(r(top)) y2=(r(bottom)) {}
                @if x_name.is_some() {
                    text.tick.mid x=(r(self.x.px(value))) y=(r(bottom + 16.0)) { (text) }
                }
            }
            @if self.y.holds(0.0) {
                line.zero x1=(r(left)) x2=(r(right)) y1=(r(self.y.px(0.0))) y2=(r(self.y.px(0.0))) {}
            }
            @if let Some(name) = x_name {
                text.name.mid x=(r(middle)) y=(r(bottom + 33.0)) { (name) }
            }
            text.name x=(r(left)) y=(r(top - 8.0)) { (y_name) }
        }
    }

    /// A line through the points, interrupted at points that are not finite.
    pub fn line(&self, class: &str, xs: &[f64], ys: &[f64]) -> Markup {
        let mut path = String::new();
        // Relative coordinates in tenths of a pixel: half as long as absolute floats.
        let mut before: Option<(i64, i64)> = None;
        for (&x, &y) in xs.iter().zip(ys) {
            if !(x.is_finite() && y.is_finite()) {
                before = None;
                continue;
            }
            let here = (tenths(self.x.px(x)), tenths(self.y.px(y)));
            let _ = match before {
                Some(before) if here == before => continue,
                Some((x, y)) => write!(path, "l{} {}", px(here.0 - x), px(here.1 - y)),
                None => write!(path, "M{} {}", px(here.0), px(here.1)),
            };
            before = Some(here);
        }
        html! { path class=(class) d=(path) {} }
    }

    /// A dot for each point.
    pub fn dots(&self, class: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Markup {
        let mut path = String::new();
        for (x, y) in points {
            if x.is_finite() && y.is_finite() {
                let (x, y) = (tenths(self.x.px(x)), tenths(self.y.px(y)));
                let _ = write!(path, "M{} {}h.01", px(x), px(y));
            }
        }
        html! { path class={ "dots " (class) } d=(path) {} }
    }

    /// A band between two values over the whole width.
    pub fn band(&self, class: &str, low: f64, high: f64) -> Markup {
        let (top, bottom) = (self.y.px(high), self.y.px(low));
        html! {
            rect class=(class) x=(r(self.x.from_px)) y=(r(top))
                width=(r(self.x.to_px - self.x.from_px)) height=(r(bottom - top)) {}
        }
    }

    /// A band between two instants over the whole height.
    pub fn span(&self, from: f64, to: f64) -> Markup {
        let (left, right) = (self.x.px(from), self.x.px(to));
        let (top, bottom) = (self.y.to_px, self.y.from_px);
        html! {
            rect.span x=(r(left)) y=(r(top)) width=(r((right - left).max(1.0))) height=(r(bottom - top)) {}
        }
    }
}

/// A coordinate in pixels, rounded to a tenth.
pub fn r(value: f64) -> String {
    px(tenths(value))
}

fn tenths(value: f64) -> i64 {
    (value * 10.0).round() as i64
}

fn px(tenths: i64) -> String {
    let sign = if tenths < 0 { "-" } else { "" };
    match (tenths.abs() / 10, tenths.abs() % 10) {
        (whole, 0) => format!("{sign}{whole}"),
        (0, tenth) => format!("{sign}.{tenth}"),
        (whole, tenth) => format!("{sign}{whole}.{tenth}"),
    }
}

/// Range of the values without the outermost `share` at both ends, so that a few outliers do not compress the plot;
/// `None` if no value is finite.
pub fn bulk(values: impl IntoIterator<Item = f64>, share: f64) -> Option<[f64; 2]> {
    let mut values: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let out = (share * values.len() as f64) as usize;
    Some([
        *values.get(out)?,
        *values.get(values.len().checked_sub(out + 1)?)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::between(-0.31, 1.07, 0.0, 100.0);
        let texts: Vec<_> = axis.ticks(5).into_iter().map(|(_, text)| text).collect();
        assert_eq!(texts, ["0.0", "0.5", "1.0"]);
        assert!(Axis::between(3.0, 3.0, 0.0, 1.0).ticks(4).len() > 1);
        assert!(Axis::over([f64::NAN], 0.0, 1.0).is_none());
    }

    #[test]
    fn a_line_breaks_at_what_is_no_number() {
        let panel = Panel {
            x: Axis::between(0.0, 4.0, 0.0, 40.0),
            y: Axis::between(0.0, 1.0, 10.0, 0.0),
        };
        let line = panel.line("after", &[0.0, 1.0, 2.0, 3.0], &[0.0, 1.0, f64::NAN, 0.0]);
        assert_eq!(
            line.into_string(),
            r#"<path class="after" d="M0 10l10 -10M30 10"></path>"#
        );
    }
}
