//! A run as a picture: panels over a common time, with what happened marked through all of them.

use motorlink_testbench::scenario::{Kind, Mark, Names, Panel, Run, Scenario, Signal, short};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// The drawing library rounds to whole pixels, so the picture is drawn this much larger.
const FINE: i32 = 8;

/// Measures in pixels of the picture as it is shown.
const WIDTH: i32 = 960;
const LEFT: i32 = 76;
const RIGHT: i32 = 24;
const TITLE: i32 = 40;
const LABEL_ROW: i32 = 17;
const PANEL_TITLE: i32 = 26;
const PANEL: i32 = 170;
const STRIP: i32 = 30;
const TIME_AXIS: i32 = 40;

const TEXT: RGBColor = RGBColor(0x24, 0x29, 0x2F);
const FAINT: RGBColor = RGBColor(0xE4, 0xE7, 0xEB);
const MARK: RGBColor = RGBColor(0x8B, 0x94, 0x9E);
/// Colours that people with any eyes tell apart (Okabe and Ito).
const LINES: [RGBColor; 6] = [
    RGBColor(0x00, 0x72, 0xB2),
    RGBColor(0xD5, 0x5E, 0x00),
    RGBColor(0x00, 0x9E, 0x73),
    RGBColor(0xCC, 0x79, 0xA7),
    RGBColor(0xE6, 0x9F, 0x00),
    RGBColor(0x56, 0xB4, 0xE9),
];
/// Colours of states, so that those which follow each other differ.
const STATES: [RGBColor; 4] = [LINES[4], LINES[5], LINES[2], LINES[0]];
const FAULT: RGBColor = LINES[1];

/// Draws the panels of a scenario as SVG.
///
/// # Errors
/// What the drawing library could not do.
pub fn draw(scenario: &Scenario, run: &Run) -> Result<String, String> {
    let labels = place_labels(&run.marks, scenario.duration.0 as f64 / 1e6);
    let rows = labels.iter().map(|label| label.row + 1).max().unwrap_or(0);
    let head = TITLE + rows * LABEL_ROW;
    let height = scenario.panels.iter().map(|panel| panel_height(panel, run)).sum::<i32>();
    let height = head + height + TIME_AXIS;
    let mut svg = String::new();
    let size = ((WIDTH * FINE) as u32, (height * FINE) as u32);
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        paint(&root, scenario, run, &labels, head, height)
            .and_then(|()| Ok(root.present()?))
            .map_err(|error| format!("cannot draw: {error}"))?;
    }
    let drawn = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
    Ok(svg.replacen(&drawn, &format!("width=\"{WIDTH}\" height=\"{height}\""), 1))
}

fn panel_height(panel: &Panel, run: &Run) -> i32 {
    let body = match is_named(panel, run) {
        true => STRIP * panel.signals.len() as i32,
        false => PANEL,
    };
    PANEL_TITLE + body
}

fn is_named(panel: &Panel, run: &Run) -> bool {
    panel.signals.iter().any(|&n| matches!(run.signals[n].kind, Kind::Named(_)))
}

fn paint(
    root: &Area<'_>,
    scenario: &Scenario,
    run: &Run,
    labels: &[Label],
    head: i32,
    height: i32,
) -> Drawn {
    root.fill(&WHITE)?;
    root.draw(&Text::new(scenario.title.as_str(), at(LEFT, 12), bold(17)))?;
    for label in labels {
        let y = TITLE + label.row * LABEL_ROW;
        let line = [at(label.x, y + 2), at(label.x, height - TIME_AXIS)];
        root.draw(&PathElement::new(line, MARK.mix(0.7).stroke_width(FINE as u32)))?;
    }
    for label in labels {
        let y = TITLE + label.row * LABEL_ROW;
        let (side, x) = match label.leftwards {
            true => (HPos::Right, label.x - 4),
            false => (HPos::Left, label.x + 4),
        };
        root.draw(&Text::new(
            label.text.as_str(),
            at(x, y),
            small().pos(Pos::new(side, VPos::Top)),
        ))?;
    }
    let (_, mut rest) = root.split_vertically(head * FINE);
    for (n, panel) in scenario.panels.iter().enumerate() {
        let last = n + 1 == scenario.panels.len();
        let axis = if last { TIME_AXIS } else { 0 };
        let (area, below) = rest.split_vertically((panel_height(panel, run) + axis) * FINE);
        match is_named(panel, run) {
            true => strips(&area, panel, run, scenario, axis)?,
            false => lines(&area, panel, run, scenario, axis)?,
        }
        rest = below;
    }
    Ok(())
}

/// A panel of numbers.
fn lines(area: &Area<'_>, panel: &Panel, run: &Run, scenario: &Scenario, axis: i32) -> Drawn {
    let end = scenario.duration.0 as f64 / 1e6;
    let [low, high] = panel.range.unwrap_or_else(|| whole_range(panel, run));
    let mut chart =
        chart(area, axis).y_label_area_size(LEFT * FINE).build_cartesian_2d(0.0..end, low..high)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(FAINT.stroke_width(FINE as u32))
        .axis_style(MARK.stroke_width(FINE as u32))
        .label_style(small())
        .x_labels(11)
        .y_labels(5)
        .x_label_formatter(&|time| short(*time))
        .y_label_formatter(&|value| short(*value))
        .x_desc(if axis > 0 { "time (s)" } else { "" })
        .set_all_tick_mark_size(3 * FINE)
        .draw()?;
    // The first signal lies on top.
    let coloured: Vec<_> = panel.signals.iter().zip(LINES.iter().cycle()).collect();
    for (&n, colour) in coloured.into_iter().rev() {
        let points = thin(&run.columns[n], end, low, high);
        let style = colour.stroke_width(3 * FINE as u32 / 2);
        chart.draw_series(LineSeries::new(points, style))?;
    }
    heading(area, panel, run, true)
}

/// A panel of signals whose values have names: a strip each.
fn strips(area: &Area<'_>, panel: &Panel, run: &Run, scenario: &Scenario, axis: i32) -> Drawn {
    let end = scenario.duration.0 as f64 / 1e6;
    let count = panel.signals.len();
    let mut chart = chart(area, axis)
        .y_label_area_size(LEFT * FINE)
        .build_cartesian_2d(0.0..end, 0.0..count as f64)?;
    for (row, &n) in panel.signals.iter().enumerate() {
        let top = (count - row) as f64;
        strip(&mut chart, &run.signals[n], &run.columns[n], end, top)?;
        let y = PANEL_TITLE + STRIP * row as i32 + STRIP / 2;
        let name = run.signals[n].name.as_str();
        let style = small().pos(Pos::new(HPos::Right, VPos::Center));
        area.draw(&Text::new(name, at(LEFT - 8, y), style))?;
    }
    chart
        .configure_mesh()
        .disable_mesh()
        .axis_style(MARK.stroke_width(FINE as u32))
        .label_style(small())
        .x_labels(11)
        .y_labels(0)
        .x_label_formatter(&|time| short(*time))
        .x_desc(if axis > 0 { "time (s)" } else { "" })
        .set_all_tick_mark_size(3 * FINE)
        .draw()?;
    heading(area, panel, run, false)
}

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// The values of a signal one after the other, each as long as it lasted.
fn strip(chart: &mut Chart<'_, '_>, signal: &Signal, column: &[f64], end: f64, top: f64) -> Drawn {
    let moment = |n: usize| end * n as f64 / (column.len() - 1) as f64;
    let mut first = 0;
    for run in column.chunk_by(|a, b| a == b) {
        let next = (first + run.len()).min(column.len() - 1);
        let (from, to) = (moment(first), moment(next));
        let name = signal.kind.show(run[0]);
        let colour = match (run[0], signal.kind) {
            (0.0, _) => FAINT.to_rgba(),
            (_, Kind::Named(Names::Faults | Names::Errors)) => FAULT.mix(0.45),
            _ if name.starts_with("FAULT") => FAULT.mix(0.45),
            (value, _) => STATES[value as usize % STATES.len()].mix(0.35),
        };
        let corners = [(from, top - 0.12), (to, top - 0.88)];
        chart.draw_series(std::iter::once(Rectangle::new(corners, colour.filled())))?;
        let room = (to - from) / end * f64::from(WIDTH - LEFT - RIGHT);
        if f64::from(width(&name)) + 6.0 < room {
            let style = small().pos(Pos::new(HPos::Center, VPos::Center));
            let text = Text::new(name, ((from + to) / 2.0, top - 0.5), style);
            chart.draw_series(std::iter::once(text))?;
        }
        first += run.len();
    }
    Ok(())
}

fn chart<'a, 'b>(area: &'a Area<'b>, axis: i32) -> ChartBuilder<'a, 'b, SVGBackend<'b>> {
    let mut builder = ChartBuilder::on(area);
    builder
        .margin_top(PANEL_TITLE * FINE)
        .margin_right(RIGHT * FINE)
        .x_label_area_size(axis * FINE);
    builder
}

/// The panel's title, and what each line is.
fn heading(area: &Area<'_>, panel: &Panel, run: &Run, legend: bool) -> Drawn {
    let mut x = LEFT;
    let style = small().pos(Pos::new(HPos::Left, VPos::Center));
    let title = match (run.signals[panel.signals[0]].kind, &panel.title) {
        (Kind::Number { unit, .. }, Some(title)) => format!("{title} ({unit})"),
        (Kind::Number { quantity, unit }, None) => format!("{quantity} ({unit})"),
        (Kind::Named(_), title) => title.clone().unwrap_or_default(),
    };
    x += width(&title) * 13 / 11 + 24;
    area.draw(&Text::new(title, at(LEFT, 14), bold(13).pos(style.pos)))?;
    let signals = panel.signals.iter().zip(LINES.iter().cycle()).filter(|_| legend);
    for (&n, colour) in signals {
        let name = &run.signals[n].name;
        let line = [at(x, 14), at(x + 18, 14)];
        area.draw(&PathElement::new(line, colour.stroke_width(5 * FINE as u32 / 2)))?;
        area.draw(&Text::new(name.as_str(), at(x + 24, 14), style.clone()))?;
        x += 24 + width(name) + 20;
    }
    Ok(())
}

/// Least and greatest value of the panel's signals, with some room around.
fn whole_range(panel: &Panel, run: &Run) -> [f64; 2] {
    let values = panel.signals.iter().flat_map(|&n| &run.columns[n]).filter(|v| v.is_finite());
    let range = values.fold(None, |range: Option<[f64; 2]>, &value| {
        let [low, high] = range.unwrap_or([value; 2]);
        Some([low.min(value), high.max(value)])
    });
    let [low, high] = range.unwrap_or([0.0, 1.0]);
    let room = match high - low {
        flat if flat <= 1e-9 * high.abs().max(1e-3) => high.abs().max(1.0) / 2.0,
        span => span * 0.06,
    };
    [low - room, high + room]
}

/// The points of a line, within the range: of each pixel's samples those that can be seen.
fn thin(column: &[f64], end: f64, low: f64, high: f64) -> Vec<(f64, f64)> {
    let step = end / (column.len() - 1) as f64;
    let pixels = (WIDTH - LEFT - RIGHT) as usize;
    let every = column.len().div_ceil(2 * pixels).max(1);
    let mut points = Vec::new();
    for (n, samples) in column.chunks(every).enumerate() {
        let order = |a: &usize, b: &usize| samples[*a].total_cmp(&samples[*b]);
        let least = (0..samples.len()).min_by(order);
        let most = (0..samples.len()).max_by(order);
        let mut seen = [least, most].map(Option::unwrap_or_default);
        seen.sort_unstable();
        let seen = if seen[0] == seen[1] { &seen[..1] } else { &seen };
        let point = |&k: &usize| ((n * every + k) as f64 * step, samples[k].clamp(low, high));
        points.extend(seen.iter().map(point));
    }
    points
}

/// Where the words for an event stand.
struct Label {
    text: String,
    x: i32,
    row: i32,
    /// Whether it stands left of its moment, for want of room on the right.
    leftwards: bool,
}

/// Places labels in as few rows as they need so that none covers another.
fn place_labels(marks: &[Mark], end: f64) -> Vec<Label> {
    let mut ends: Vec<i32> = Vec::new();
    let mut labels = Vec::new();
    for marks in marks.chunk_by(|a, b| a.at == b.at) {
        let words: Vec<&str> = marks.iter().map(|mark| mark.label.as_str()).collect();
        let text = words.join(", ");
        let x = LEFT + (f64::from(WIDTH - LEFT - RIGHT) * marks[0].at / end).round() as i32;
        let size = width(&text) + 8;
        let leftwards = x + size > WIDTH;
        let (from, to) = if leftwards { (x - size, x + 4) } else { (x - 2, x + size) };
        let row = ends.iter().position(|end| *end <= from).unwrap_or(ends.len());
        ends.resize(ends.len().max(row + 1), 0);
        ends[row] = to;
        labels.push(Label { text, x, row: row as i32, leftwards });
    }
    labels
}

/// About how wide a small text is.
fn width(text: &str) -> i32 {
    text.chars().count() as i32 * 6
}

fn at(x: i32, y: i32) -> (i32, i32) {
    (x * FINE, y * FINE)
}

fn small() -> TextStyle<'static> {
    ("sans-serif", 11 * FINE).into_font().color(&TEXT)
}

fn bold(size: i32) -> TextStyle<'static> {
    FontDesc::new(FontFamily::SansSerif, f64::from(size * FINE), FontStyle::Bold).color(&TEXT)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(at: f64, label: &str) -> Mark {
        Mark { at, label: label.to_owned() }
    }

    #[test]
    fn labels_do_not_cover_each_other_and_stay_in_the_picture() {
        let marks = [
            mark(0.0, "a long label at the beginning"),
            mark(0.1, "another one beside it"),
            mark(0.1, "at the same moment"),
            mark(5.0, "far away"),
            mark(10.0, "a long label at the end"),
        ];
        let labels = place_labels(&marks, 10.0);
        let seen: Vec<(&str, i32, bool)> =
            labels.iter().map(|label| (&*label.text, label.row, label.leftwards)).collect();
        assert_eq!(seen[0], ("a long label at the beginning", 0, false));
        assert_eq!(seen[1], ("another one beside it, at the same moment", 1, false));
        assert_eq!(seen[2], ("far away", 0, false));
        assert_eq!(seen[3], ("a long label at the end", 0, true));
        assert!(labels.iter().all(|label| (LEFT..=WIDTH - RIGHT).contains(&label.x)));
    }

    #[test]
    fn a_thinned_line_keeps_its_peaks_and_its_order() {
        let mut column: Vec<f64> = (0..100_001).map(|n| f64::from(n % 7)).collect();
        column[12_345] = 50.0;
        column[77_777] = -50.0;
        let points = thin(&column, 10.0, -20.0, 100.0);
        assert!(points.len() < 4000);
        assert!(points.is_sorted_by(|a, b| a.0 < b.0));
        assert!(points.contains(&(12_345.0 * 1e-4, 50.0)));
        assert!(points.contains(&(77_777.0 * 1e-4, -20.0)), "the range ends there");
        assert_eq!(thin(&[1.0, 2.0, 3.0], 2.0, 0.0, 9.0), [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]);
    }
}
