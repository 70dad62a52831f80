//! Groups of bars on a logarithmic axis, with their intervals.

use std::fmt::Write;

use maud::{Markup, html};

use super::axis::{Axis, plain};
use super::{Drawing, LETTER, LINE, colour, legend, px, unit};
use crate::error::Result;

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 16.0;
/// Bars begin so much below the least value: a logarithmic axis has no zero.
const BELOW: f64 = 0.6;
const ABOVE: f64 = 1.25;

/// A value that is above 0, or nothing where there is none.
#[derive(Clone, Copy)]
pub(crate) struct Bar {
    pub(crate) value: Option<f64>,
    /// Where the value may be, if that is known; infinite: no upper end.
    pub(crate) interval: Option<[f64; 2]>,
}

impl Bar {
    /// Of a series in a group, in words.
    fn words(&self, value: f64, series: &str, group: &str, unit: &str) -> String {
        let mut words = format!("{series}, {group}: {} {unit}", plain(rounded(value)));
        match self.interval {
            Some([low, high]) if high.is_finite() => {
                let _ = write!(words, " ({} to {})", plain(rounded(low)), plain(rounded(high)));
            }
            Some([low, _]) => {
                let _ = write!(words, " ({} or more)", plain(rounded(low)));
            }
            None => {}
        }
        words
    }
}

/// Three digits.
fn rounded(v: f64) -> f64 {
    format!("{v:.2e}").parse().unwrap_or(v)
}

/// A group a label, a bar a series.
pub(in crate::page) fn drawing(
    title: &str,
    y_label: &str,
    labels: &[&str],
    series: &[(&str, Vec<Bar>)],
) -> Result<Drawing> {
    let bars = || series.iter().flat_map(|(_, bars)| bars);
    let ends = |b: &Bar| b.interval.into_iter().flatten().filter(|v| v.is_finite() && *v > 0.0);
    let values = bars().flat_map(|b| b.value.into_iter().filter(|v| *v > 0.0).chain(ends(b)));
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    let (low, high) = if low <= high { (low, high) } else { (1.0, 10.0) };
    let mut axis = Axis::new([low, high].into_iter(), true)?;
    (axis.low, axis.high) = ((BELOW * low).log10(), (ABOVE * high).log10());

    let names: Vec<&str> = series.iter().map(|(name, _)| *name).collect();
    let top = 8.0 + LINE;
    let (legend, band) = legend(&names, WIDTH, top, |_| None);
    let top = top + band + 10.0;
    let bottom = top + HEIGHT;
    let y = |v: f64| px(bottom - HEIGHT * axis.share(v).clamp(0.0, 1.0));
    let group_width = (WIDTH - LEFT - RIGHT) / labels.len() as f64;
    let width = 0.8 * group_width / series.len() as f64;
    let bar = |i: usize, group: usize, bar: &Bar| -> Markup {
        let Some(value) = bar.value.filter(|v| *v > 0.0) else { return html! {} };
        let left = LEFT + group_width * (group as f64 + 0.1) + width * i as f64;
        let middle = px(left + 0.46 * width);
        let cap = px((0.2 * width).min(6.0));
        let whisker = bar.interval.map(|[from, to]| {
            let mut d = format!("M{middle},{}V{}", y(from), y(to));
            for end in [from, to].into_iter().filter(|v| v.is_finite()) {
                let _ = write!(d, "M{},{}h{}", px(middle - cap), y(end), 2.0 * cap);
            }
            d
        });
        html! {
            g {
                title { (bar.words(value, series[i].0, labels[group], unit(y_label).unwrap_or(y_label))) }
                rect x=(px(left)) y=(y(value)) width=(px(0.92 * width)) height=(px(bottom - y(value))) fill=(colour(i)) {}
                @if let Some(d) = whisker {
                    path d=(d) stroke="#FFFFFF" stroke-width="4" fill="none" {}
                    path d=(d) stroke="#000000" stroke-width="1.6" fill="none" {}
                }
            }
        }
    };
    let ticks = axis.ticks(6.0);
    let letters = (group_width / LETTER) as usize;
    let lines: Vec<Vec<String>> = labels.iter().map(|label| super::wrapped(label, letters.max(4))).collect();
    let deepest = lines.iter().map(Vec::len).max().unwrap_or(1) as f64;
    let body = html! {
        g.bars {
            text x=(WIDTH / 2.0) y="19" text-anchor="middle" font-size="16" { (title) }
            (legend)
            @for (v, label) in &ticks {
                path d=(format!("M{LEFT},{}H{}", y(*v), WIDTH - RIGHT)) stroke="#b4b4b4" stroke-width=".6" {}
                text x=(LEFT - 6.0) y=(px(y(*v) + 5.0)) text-anchor="end" { (label) }
            }
            text transform=(format!("translate(20,{}) rotate(-90)", px((top + bottom) / 2.0))) text-anchor="middle" { (y_label) }
            @for (i, (_, bars)) in series.iter().enumerate() {
                g data-series=(i) { @for (group, b) in bars.iter().enumerate() { (bar(i, group, b)) } }
            }
            path d=(format!("M{LEFT},{top}V{bottom}H{}", WIDTH - RIGHT)) stroke="#000000" fill="none" {}
            @for (group, lines) in lines.iter().enumerate() {
                @for (n, line) in lines.iter().enumerate() {
                    text x=(px(LEFT + group_width * (group as f64 + 0.5))) y=(bottom + 20.0 + 17.0 * n as f64) text-anchor="middle" { (line) }
                }
            }
        }
    };
    Ok(Drawing { width: WIDTH, height: bottom + 12.0 + 17.0 * deepest, body })
}
