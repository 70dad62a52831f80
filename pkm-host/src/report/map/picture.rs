//! The six maps of stiffness, and that of how far a table may be off, as one picture.

use maud::html;
use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::contour::{self, Pixel};
use super::region::{LIMITS, Region, U95};
use crate::error::Result;
use crate::files::machine::MachineFile;
use crate::page::plot::{self, COLOURS, failed};
use crate::plan::map::{Map, Model, Point};
use crate::pose::PoseBox;

/// Bands of colour, at most.
const BANDS: f64 = 14.0;
/// Points along the longer side that a page's script knows the values of, at most.
const VALUES: usize = 54;
/// What stands beside the map itself.
pub struct Legend<'a> {
    /// Of the picture.
    pub title: &'a str,
    /// The table's box, or the machine's without a table.
    pub pose_box: PoseBox,
    /// Whether there is a table: then what lies outside the box is extrapolated.
    pub table: bool,
}

/// Pixels; the picture is drawn for a screen of high resolution or for print.
mod size {
    pub const PLOT: (f64, f64) = (600.0, 560.0);
    pub const SMALL_SCALE: f64 = 0.62;
    pub const MIN_PX: f64 = 120.0;
    pub const LEFT: i32 = 110;
    pub const TICKS: i32 = 44;
    pub const BOTTOM: i32 = 90;
    pub const CAPTION: i32 = 60;
    pub const BAR: i32 = 36;
    pub const RIGHT: i32 = 180;
    pub const TITLE: i32 = 70;
    pub const ENTRY: i32 = 42;
    pub const TEXT: i32 = 24;
    pub const HATCH: f64 = 18.0;
    pub const APART: usize = 95;
}

/// A map as SVG.
pub struct Picture {
    /// All of it.
    pub whole: String,
    /// k11…k66 one by one, and U95 where the table says it, for a page: smaller, with the same letters.
    pub panels: Vec<String>,
    /// Signs of the legend with what they stand for.
    pub signs: Vec<(String, String)>,
}

/// Draws a map.
///
/// # Errors
/// What the drawing library says.
pub fn draw(file: &MachineFile, model: &Model<'_>, map: &Map, legend: &Legend<'_>) -> Result<Picture> {
    let region = Region::new(file, model, map)?;
    let [[x0, x1], [z0, z1]] = map.grid.extent_mm();
    let scale = (size::PLOT.0 / (x1 - x0)).min(size::PLOT.1 / (z1 - z0));
    let at = |scale: f64| [x1 - x0, z1 - z0].map(|mm| (mm * scale).max(size::MIN_PX) as i32);
    let around = |[width, height]: [i32; 2]| (size::LEFT + width + size::RIGHT, size::CAPTION + height + size::BOTTOM);
    let (plot, small) = (at(scale), at(scale * size::SMALL_SCALE));
    let (panel_width, panel_height) = around(plot);
    let entries = entries(file, map, legend, &region);
    let legend_rows = entries.len().div_ceil(3) as i32;
    let shown: Vec<usize> = (0..6).chain(map.u95_extremes().map(|_| U95)).collect();
    let below = size::TITLE + shown.len().div_ceil(3) as i32 * panel_height;
    let total = (3 * panel_width, below + legend_rows * size::ENTRY + 30);
    let whole = plot::svg(legend.title, (total.0 as u32, total.1 as u32), |area| {
        text(area, legend.title, (total.0 / 2, size::TITLE / 2), 34, HPos::Center)?;
        for (n, &k) in shown.iter().enumerate() {
            let corner = (n as i32 % 3 * panel_width, size::TITLE + n as i32 / 3 * panel_height);
            panel(area, corner, plot, &Panel { k, map, legend, region: &region })?;
        }
        for (n, entry) in entries.iter().enumerate() {
            let x = n as i32 % 3 * panel_width + 40;
            let y = below + n as i32 / 3 * size::ENTRY + size::ENTRY / 2;
            entry.mark.line(area, vec![(x, y), (x + 80, y)])?;
            text(area, &entry.name, (x + 96, y), size::TEXT, HPos::Left)?;
        }
        Ok(())
    })?;
    let (small_width, small_height) = around(small);
    let panels = shown.iter().map(|&k| {
        let title = format!("{} over X0 and Z0", quantity(k).0);
        let svg = plot::svg(&title, (small_width as u32, small_height as u32), |area| {
            panel(area, (0, 0), small, &Panel { k, map, legend, region: &region })
        })?;
        Ok(svg.replace("</svg>", &format!("{}</svg>", values(map, k, small))))
    });
    let signs = entries.iter().map(|entry| {
        let svg = plot::svg(&entry.name, (96, 36), |area| entry.mark.line(area, vec![(8, 18), (88, 18)]))?;
        Ok((svg, entry.name.clone()))
    });
    Ok(Picture { whole, panels: panels.collect::<Result<_>>()?, signs: signs.collect::<Result<_>>()? })
}

/// Values at points of the map, for a page's script: see `page.js`. Those with a star are extrapolated.
fn values(map: &Map, k: usize, [width, height]: [i32; 2]) -> String {
    let (name, unit, per_unit) = quantity(k);
    let grid = &map.grid;
    let step = grid.count.into_iter().max().unwrap_or(1).div_ceil(VALUES).max(1);
    let [columns, rows] = grid.count.map(|n| (0..n).step_by(step).collect::<Vec<_>>());
    let written = |point: &Point| {
        let Ok(value) = point.value else { return "-".to_owned() };
        let own = if k == U95 { value.u95_m_per_n } else { Some(value.principal[k]) };
        let star = if value.inside == Some(false) { "*" } else { "" };
        own.map_or("-".to_owned(), |own| format!("{}{star}", rounded(own / per_unit)))
    };
    let row =
        |r: &usize| columns.iter().map(|c| written(&map.points[r * grid.count[0] + c])).collect::<Vec<_>>().join(" ");
    let all: Vec<String> = rows.iter().map(row).collect();
    // cells with the points in their middles, in mm and in pixels
    let [[x0, x1], [z0, z1]] = grid.extent_mm();
    let (left, bottom) = (f64::from(size::LEFT), f64::from(size::CAPTION + height));
    let across = |x: f64| left + f64::from(width) * (x - x0) / (x1 - x0);
    let up = |z: f64| bottom - f64::from(height) * (z - z0) / (z1 - z0);
    let cell = grid.step_mm * step as f64;
    let ends = |least: f64, count: usize| [least - cell / 2.0, least + cell * (count as f64 - 0.5)];
    let ([low_x, high_x], [low_z, high_z]) = (ends(x0, columns.len()), ends(z0, rows.len()));
    let axes = format!("{low_x} {high_x} {} {} {low_z} {high_z} linear", across(low_x), across(high_x));
    let place = format!("{} {}", up(high_z), up(low_z));
    let markup = html! {
        g.heat data-axes=(axes) data-x="X0 in mm" data-y="Z0 in mm" data-name={ (name) " in " (unit) } data-place=(place)
            data-values=(all.join("|")) {}
    };
    markup.into_string()
}

/// Four digits.
fn rounded(v: f64) -> f64 {
    format!("{v:.3e}").parse().unwrap_or(v)
}

/// The same picture as PNG.
///
/// # Errors
/// What the drawing library says.
#[cfg(feature = "png")]
pub fn png(svg: &str) -> Result<Vec<u8>> {
    let mut options = resvg::usvg::Options::default();
    options.fontdb_mut().load_font_data(dejavu::sans::regular().to_vec());
    options.fontdb_mut().set_sans_serif_family("DejaVu Sans");
    let tree = resvg::usvg::Tree::from_str(svg, &options).map_err(failed)?;
    let (width, height) = (tree.size().width() as u32, tree.size().height() as u32);
    let mut pixels = resvg::tiny_skia::Pixmap::new(width, height).ok_or_else(|| failed("no pixels"))?;
    resvg::render(&tree, resvg::tiny_skia::Transform::identity(), &mut pixels.as_mut());
    pixels.encode_png().map_err(failed)
}

/// How a line is drawn.
#[derive(Clone, Copy)]
struct Mark {
    colour: RGBAColor,
    width: u32,
    /// Dash and gap; `None`: drawn through.
    dash: Option<(i32, i32)>,
    /// Of the legend alone: stripes on a colour.
    striped: bool,
}

impl Mark {
    /// Limb 2 narrow on limb 1 wide: both are seen where they cross at a small angle. The shortest screw is dashed.
    fn limit(limit: usize) -> Self {
        let limb = limit / 2;
        Self {
            colour: [COLOURS[1], COLOURS[5], COLOURS[3]][limb].to_rgba(),
            width: [8, 4, 6][limb],
            dash: limit.is_multiple_of(2).then_some((22, 14)),
            striped: false,
        }
    }

    fn singularity(which: usize) -> Self {
        Self { colour: BLACK.to_rgba(), width: 6, dash: Some([(4, 8), (26, 8)][which]), striped: false }
    }

    const BOX: Self = Self { colour: RGBAColor(0, 0, 0, 1.0), width: 4, dash: Some((14, 8)), striped: false };

    /// Light on dark: one of them is seen on every colour.
    const STRIPES: [Self; 2] = [
        Self { colour: RGBAColor(0, 0, 0, 1.0), width: 4, dash: None, striped: true },
        Self { colour: RGBAColor(255, 255, 255, 1.0), width: 2, dash: None, striped: true },
    ];

    fn line(&self, area: &DrawingArea<SVGBackend<'_>, Shift>, points: Vec<Pixel>) -> Result<()> {
        if self.striped {
            let [(x0, y), (x1, _)] = [points[0], points[1]];
            area.draw(&Rectangle::new([(x0, y - 14), (x1, y + 14)], ViridisRGB.get_color(0.5).filled()))
                .map_err(failed)?;
            let stripes = (x0..=x1 - 28).step_by(18).map(|x| vec![(x, y + 14), (x + 28, y - 14)]);
            return draw_stripes(area, &stripes.collect::<Vec<_>>());
        }
        let style = self.colour.stroke_width(self.width);
        match self.dash {
            Some((dash, gap)) => area.draw(&DashedPathElement::new(points, dash, gap, style)).map_err(failed),
            None => area.draw(&PathElement::new(points, style)).map_err(failed),
        }
    }
}

/// A line of the legend.
struct Entry {
    mark: Mark,
    name: String,
}

fn entries(file: &MachineFile, map: &Map, legend: &Legend<'_>, region: &Region) -> Vec<Entry> {
    let travel = &file.parameters.travel;
    let mut entries = Vec::new();
    for limit in 0..LIMITS {
        let (end, at_m) = if limit % 2 == 0 { ("shortest", travel.min_m) } else { ("longest", travel.max_m) };
        let screws = match region.limbs(limit) {
            [] => continue,
            [limb] => format!("screw {limb} at its"),
            _ => "screws 1 and 2 at their".to_owned(),
        };
        let name = format!("{screws} {end}, {} mm", (at_m[limit / 2] * 1e6).round() / 1e3);
        entries.push(Entry { mark: Mark::limit(limit), name });
    }
    for (which, name) in ["limbs 1 and 2", "limb 3"].into_iter().enumerate() {
        if !region.borders[LIMITS + which].is_empty() {
            entries.push(Entry { mark: Mark::singularity(which), name: format!("direct singularity of {name}") });
        }
    }
    let owner = if legend.table { "table" } else { "machine" };
    if !box_edges(map, legend).is_empty() {
        let [[t0, t1], _, [z0, z1]] = legend.pose_box.ranges();
        let name = format!("box of the {owner}: θ {t0} to {t1}°, Z0 {z0} to {z1} mm");
        entries.push(Entry { mark: Mark::BOX, name });
    }
    if map.points.iter().any(|p| p.status() == "outside_box") {
        entries.push(Entry { mark: Mark::STRIPES[0], name: "outside the table's box: extrapolated".into() });
    }
    entries
}

/// The box in the plane as a·X0 + b·Z0 ≥ c; a box that ends before this σ is none.
fn box_planes(map: &Map, legend: &Legend<'_>) -> Option<[[f64; 3]; 4]> {
    let [[t0, t1], [s0, s1], [z0, z1]] = legend.pose_box.ranges();
    let [left, right] = [t0, t1].map(|t| t.to_radians().tan());
    let inside = s0 <= map.sigma_deg && map.sigma_deg <= s1;
    inside.then_some([[1.0, -left, 0.0], [-1.0, right, 0.0], [0.0, 1.0, z0], [0.0, -1.0, -z1]])
}

fn window_planes(map: &Map) -> [[f64; 3]; 4] {
    let [[x0, x1], [z0, z1]] = map.grid.extent_mm();
    [[1.0, 0.0, x0], [-1.0, 0.0, -x1], [0.0, 1.0, z0], [0.0, -1.0, -z1]]
}

/// The sides of the box as far as the window shows them.
fn box_edges(map: &Map, legend: &Legend<'_>) -> Vec<[[f64; 2]; 2]> {
    if box_planes(map, legend).is_none() {
        return Vec::new();
    }
    let [theta, _, z0] = legend.pose_box.ranges();
    let corner = |t: usize, z: usize| [z0[z] * theta[t].to_radians().tan(), z0[z]];
    let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
    let side = |i: usize| {
        let (p, q) = (corners[i], corners[(i + 1) % 4]);
        let d = [q[0] - p[0], q[1] - p[1]];
        let part = contour::chord(&window_planes(map), p, d, [0.0, 1.0])?;
        Some(part.map(|t| [p[0] + t * d[0], p[1] + t * d[1]]))
    };
    (0..4).filter_map(side).collect()
}

fn draw_stripes(area: &DrawingArea<SVGBackend<'_>, Shift>, stripes: &[Vec<Pixel>]) -> Result<()> {
    for mark in Mark::STRIPES {
        for stripe in stripes {
            area.draw(&PathElement::new(stripe.clone(), mark.colour.stroke_width(mark.width))).map_err(failed)?;
        }
    }
    Ok(())
}

/// Stripes over what the machine reaches but for the box.
fn stripes(map: &Map, legend: &Legend<'_>, region: &Region, spacing_mm: f64) -> Vec<[[f64; 2]; 2]> {
    let [[x0, x1], [z0, z1]] = map.grid.extent_mm();
    let count = ((x1 - x0 + z1 - z0) / spacing_mm) as usize;
    let mut stripes = Vec::new();
    for n in 0..=count {
        let p = [x0 - (z1 - z0) + n as f64 * spacing_mm, z0];
        let at = |t: f64| [p[0] + t, p[1] + t];
        let Some([from, to]) = contour::chord(&window_planes(map), p, [1.0, 1.0], [0.0, f64::INFINITY]) else {
            continue;
        };
        let boxed = box_planes(map, legend).and_then(|planes| contour::chord(&planes, p, [1.0, 1.0], [from, to]));
        let [enter, leave] = boxed.unwrap_or([to, to]);
        for [a, b] in contour::within(&region.pieces, p, [1.0, 1.0]) {
            let outside = [[from, enter], [leave, to]].map(|[c, d]| [a.max(c), b.min(d)]);
            stripes.extend(outside.into_iter().filter(|[c, d]| c < d).map(|part| part.map(at)));
        }
    }
    stripes
}

/// Bands of colour with round limits.
struct Bands {
    first: f64,
    step: f64,
    count: usize,
    /// Whether there are values below the first, above the last.
    beyond: [bool; 2],
}

impl Bands {
    /// Over the values that can be trusted: what is extrapolated beyond them has the colours of the ends. Without any, over all.
    fn new(&Panel { k, map, legend, region }: &Panel<'_>, per_unit: f64) -> Self {
        let planes = box_planes(map, legend);
        let inside = |[x, z]: [f64; 2]| planes.is_some_and(|p| p.iter().all(|[a, b, c]| a * x + b * z >= *c));
        let range = |take: &dyn Fn([f64; 2]) -> bool| {
            let corners = region.pieces.iter().flatten().filter(|c| take(c.at));
            let values = corners.map(|c| c.values[k] / per_unit);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
        };
        let all = range(&|_| true);
        let trusted = range(&|at| !legend.table || inside(at));
        let [low, high] = if trusted[0] <= trusted[1] { trusted } else { all };
        let span = (high - low).max(1e-6 * high);
        let power = 10_f64.powf((span / BANDS).log10().floor());
        let fits = |step: &f64| *step * (BANDS - 1.0) >= span;
        let step = [1.0, 2.0, 5.0, 10.0].map(|n| n * power).into_iter().find(fits).unwrap_or(20.0 * power);
        let first = (low / step).floor();
        let last = (high / step).ceil().max(first + 1.0);
        Self {
            first: first * step,
            step,
            count: (last - first) as usize,
            beyond: [all[0] < first * step, all[1] > last * step],
        }
    }

    fn level(&self, n: usize) -> f64 {
        self.first + n as f64 * self.step
    }

    fn colour(&self, n: usize) -> RGBColor {
        ViridisRGB.get_color((n as f32 + 0.5) / self.count as f32)
    }

    fn label(&self, n: usize) -> String {
        let decimals = (-self.step.log10().floor()).clamp(0.0, 9.0) as usize;
        let mark = match n {
            0 if self.beyond[0] => "≤ ",
            n if n == self.count && self.beyond[1] => "≥ ",
            _ => "",
        };
        format!("{mark}{:.decimals$}", self.level(n))
    }
}

/// What is drawn by its place in what is known at a corner: name, unit, and how much of SI that is.
fn quantity(k: usize) -> (String, &'static str, f64) {
    match k {
        U95 => ("U95 of the tip".to_owned(), "µm/kN", 1e-9),
        k if k < 3 => (format!("k{0}{0}", k + 1), "N/µm", 1e6),
        k => (format!("k{0}{0}", k + 1), "N·m/mrad", 1e3),
    }
}

struct Panel<'a> {
    k: usize,
    map: &'a Map,
    legend: &'a Legend<'a>,
    region: &'a Region,
}

fn text(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    words: &str,
    at: Pixel,
    height: i32,
    horizontal: HPos,
) -> Result<()> {
    let style = ("sans-serif", height).into_font().into_text_style(area).pos(Pos::new(horizontal, VPos::Center));
    area.draw_text(words, &style, at).map_err(failed)
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    (left, top): Pixel,
    [width, height]: [i32; 2],
    panel: &Panel<'_>,
) -> Result<()> {
    let &Panel { k, map, legend, region } = panel;
    let (name, unit, per_unit) = quantity(k);
    let name = format!("{name} in {unit}");
    let (x, y) = (left + size::LEFT, top + size::CAPTION);
    text(area, &name, (x + width / 2, top + size::CAPTION / 2), 30, HPos::Center)?;

    let [[x0, x1], [z0, z1]] = map.grid.extent_mm();
    text(area, "Z0 in mm", (left + 20, top + size::CAPTION / 2), size::TEXT, HPos::Left)?;
    text(area, "X0 in mm", (x + width / 2, y + height + size::TICKS + 12), size::TEXT, HPos::Center)?;
    let chart_area = area.clone().shrink((left, y), (size::LEFT + width, height + size::TICKS));
    let mut chart = ChartBuilder::on(&chart_area)
        .x_label_area_size(size::TICKS)
        .y_label_area_size(size::LEFT)
        .build_cartesian_2d(x0..x1, z0..z1)
        .map_err(failed)?;
    let number = |v: &f64| ((v * 1e6).round() / 1e6).to_string();
    chart
        .configure_mesh()
        .disable_mesh()
        .x_labels(1 + width as usize / size::APART)
        .y_labels(1 + height as usize / size::APART)
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .label_style(("sans-serif", size::TEXT))
        .draw()
        .map_err(failed)?;
    let plane = chart.plotting_area().clone();
    let pixel = |at: [f64; 2]| plane.map_coordinate(&(at[0], at[1]));

    let bands = Bands::new(panel, per_unit);
    for band in 0..bands.count {
        let level = if band == 0 { f64::NEG_INFINITY } else { bands.level(band) * per_unit };
        let parts = region.pieces.iter().map(|p| contour::above(p, k, level));
        let edges: Vec<_> =
            parts.flat_map(|p| contour::edges(&p).map(|e| e.map(|c| pixel(c.at))).collect::<Vec<_>>()).collect();
        let outline = one_line(contour::join(edges.into_iter()));
        area.draw(&Polygon::new(outline, bands.colour(band).filled())).map_err(failed)?;
    }
    if legend.table {
        let spacing_mm = size::HATCH * (x1 - x0) / f64::from(width);
        let stripes = stripes(map, legend, region, spacing_mm);
        draw_stripes(area, &stripes.into_iter().map(|s| s.map(pixel).to_vec()).collect::<Vec<_>>())?;
    }
    let border = |border: usize, mark: Mark| {
        let edges = region.borders[border].iter().map(|e| e.map(pixel));
        contour::join(edges).iter().try_for_each(|line| mark.line(area, thinned(line)))
    };
    for limit in (0..LIMITS).filter(|limit| !region.limbs(*limit).is_empty()) {
        border(limit, Mark::limit(limit))?;
    }
    for which in 0..2 {
        border(LIMITS + which, Mark::singularity(which))?;
    }
    for side in box_edges(map, legend) {
        // light under dark: seen on every colour
        area.draw(&PathElement::new(side.map(pixel), WHITE.mix(0.7).stroke_width(8))).map_err(failed)?;
        Mark::BOX.line(area, side.map(pixel).to_vec())?;
    }
    area.draw(&Rectangle::new([(x, y), (x + width, y + height)], BLACK.stroke_width(2))).map_err(failed)?;

    colour_bar(area, (x + width + 24, y), height, &bands)
}

/// What the colours stand for.
fn colour_bar(area: &DrawingArea<SVGBackend<'_>, Shift>, (bar, y): Pixel, height: i32, bands: &Bands) -> Result<()> {
    let at = |n: usize| y + height - (height as usize * n / bands.count) as i32;
    for n in 0..bands.count {
        let band = [(bar, at(n + 1)), (bar + size::BAR, at(n))];
        area.draw(&Rectangle::new(band, bands.colour(n).filled())).map_err(failed)?;
    }
    let every = (bands.count as i32 * (size::TEXT + 6) / height + 1) as usize;
    for n in (0..=bands.count).filter(|n| *n == bands.count || (n % every == 0 && n + every <= bands.count)) {
        area.draw(&PathElement::new(
            vec![(bar + size::BAR, at(n)), (bar + size::BAR + 8, at(n))],
            BLACK.stroke_width(2),
        ))
        .map_err(failed)?;
        text(area, &bands.label(n), (bar + size::BAR + 14, at(n)), size::TEXT, HPos::Left)?;
    }
    area.draw(&Rectangle::new([(bar, y), (bar + size::BAR, y + height)], BLACK.stroke_width(2))).map_err(failed)
}

/// A line without its shortest steps, in which whole pixels would show.
fn thinned(line: &[Pixel]) -> Vec<Pixel> {
    let mut kept: Vec<Pixel> = Vec::new();
    for (i, at) in line.iter().enumerate() {
        let far = kept.last().is_none_or(|last| (at.0 - last.0).abs().max((at.1 - last.1).abs()) >= 8);
        if far || i + 1 == line.len() {
            kept.push(*at);
        }
    }
    kept
}

/// Several closed lines as one, there and back between their starts: a polygon that is filled where they turn about.
fn one_line(lines: Vec<Vec<Pixel>>) -> Vec<Pixel> {
    let start = lines.first().map(|line| line[0]);
    lines.into_iter().flat_map(|line| line.into_iter().chain(start)).collect()
}
