//! Signals as a picture: panels over a common time, with the moments of events as lines through all of
//! them.

mod figure;
mod labels;
mod png;
mod points;
mod state;
mod strips;
mod style;

use std::path::Path;

use motorlink_link::printable;
use motorlink_testbench::scenario::short;
use plotters::prelude::*;

use crate::failure::Failure;
use crate::palette::Meaning;
use crate::text::flow;
pub use figure::{Figure, Panel, Samples, Signal, States, Times};
use labels::Label;
use points::{thin, whole_range};
pub use state::state;
use strips::Strip;
use style::{
    Area, Drawn, FINE, LEFT, PLOT, RIGHT, TEXT_LINE, WIDTH, at, bold, bold_width, rgb, small,
    thick, width, write, write_bold,
};

const TITLE_FONT: i32 = 21;
/// Characters of the title in a line.
const TITLE_LINE: usize = 64;
const MARGIN: i32 = 14;
/// Height of a panel of numbers.
const PANEL: i32 = 150;
const TIME_AXIS: i32 = 44;
/// Length of a line in the legend.
const SAMPLE: i32 = 26;

/// Refuses the name of a file that promises another format than SVG and PNG. Names without an extension and
/// devices may have any content. `who` writes it.
///
/// # Errors
/// The extension is that of another format.
pub fn check_format(who: &str, plot: &Path) -> Result<(), Failure> {
    let extension = plot.extension().and_then(|extension| extension.to_str());
    let extension = extension.unwrap_or_default().to_ascii_uppercase();
    match &*extension {
        "JPG" | "JPEG" | "GIF" | "BMP" | "WEBP" | "TIF" | "TIFF" | "PDF" | "EPS" | "PS" => {
            let name = printable(&plot.display().to_string());
            let why = format!("{who} writes SVG and PNG, not {extension}: `{name}`");
            Err(Failure::usage(why).trying(
                "give a name that ends in .svg or .png; Inkscape and rsvg-convert convert SVG to other \
                 formats",
            ))
        }
        _ => Ok(()),
    }
}

/// Draws a figure: as PNG if the name of the file ends so, otherwise as SVG.
///
/// # Errors
/// What the drawing library could not do.
pub fn draw(figure: &Figure<'_>, path: &Path) -> Result<Vec<u8>, String> {
    let picture = svg(figure)?;
    match path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        true => png::png(&picture),
        false => Ok(picture.into_bytes()),
    }
}

fn svg(figure: &Figure<'_>) -> Result<String, String> {
    let picture = Picture::new(figure);
    let height = picture.height();
    let mut svg = String::new();
    let size = ((WIDTH * FINE) as u32, (height * FINE) as u32);
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        picture
            .paint(&root)
            .and_then(|()| Ok(root.present()?))
            .map_err(|error| format!("cannot draw: {error}"))?;
    }
    let drawn = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
    Ok(svg.replacen(&drawn, &format!("width=\"{WIDTH}\" height=\"{height}\""), 1))
}

/// A picture with the places of its parts.
struct Picture<'a> {
    figure: &'a Figure<'a>,
    title: Vec<String>,
    labels: Vec<Label>,
    /// Places of the lines of events.
    events: Vec<i32>,
    panels: Vec<Part<'a>>,
}

/// A panel with its heading.
struct Part<'a> {
    panel: &'a Panel,
    heading: Heading,
    /// Of a panel whose signals have names.
    strips: Vec<Strip>,
}

/// Title of a panel, and what its lines are, line by line.
struct Heading {
    title: String,
    legend: Vec<Vec<Look>>,
}

/// What the line of a signal looks like.
struct Look {
    signal: usize,
    meaning: Meaning,
    /// 0 is a whole line, others are dashed: a panel has several of this meaning.
    dash: usize,
    x: i32,
}

impl<'a> Picture<'a> {
    fn new(figure: &'a Figure<'a>) -> Self {
        let labels = labels::place(&figure.marks, figure.end);
        let unnamed = figure.unnamed.iter().map(|at| labels::place_of(*at, figure.end));
        let events: Vec<i32> = labels.iter().map(|label| label.x).chain(unnamed).collect();
        let part = |panel: &'a Panel| {
            let signals = panel.signals.iter().map(|&n| &figure.signals[n]);
            let strip =
                |signal: &Signal<'_>| Some(Strip::new(signal, signal.states.as_ref()?, &events));
            let strips = signals.filter_map(strip).collect();
            Part { panel, heading: Heading::new(panel, figure), strips }
        };
        let panels = figure.panels.iter().map(part).collect();
        let title = flow(figure.title.split_whitespace(), " ", "", TITLE_LINE);
        Picture { figure, title, labels, events, panels }
    }

    /// Height of the title and of the labels.
    fn head(&self) -> i32 {
        let rows = self.labels.iter().map(|label| label.row + 1).max().unwrap_or(0);
        self.labels_top() + rows * TEXT_LINE + 4
    }

    fn labels_top(&self) -> i32 {
        MARGIN + self.title.len().max(1) as i32 * (TITLE_FONT + 5) + 6
    }

    fn height(&self) -> i32 {
        self.head() + self.panels.iter().map(Part::height).sum::<i32>() + TIME_AXIS
    }

    fn paint(&self, root: &Area<'_>) -> Drawn {
        root.fill(&WHITE)?;
        for (n, line) in self.title.iter().enumerate() {
            let y = MARGIN + n as i32 * (TITLE_FONT + 5);
            root.draw(&Text::new(line.as_str(), at(MARGIN, y), bold(TITLE_FONT)))?;
        }
        let row = |label: &Label| self.labels_top() + label.row * TEXT_LINE + TEXT_LINE / 2;
        for label in &self.labels {
            let top = row(label) - TEXT_LINE / 2 + 2;
            let line = [at(label.x, top), at(label.x, self.height() - TIME_AXIS)];
            root.draw(&PathElement::new(line, thick(rgb(Meaning::Event), 8)))?;
        }
        for &x in &self.events[self.labels.len()..] {
            let line = [at(x, self.head()), at(x, self.height() - TIME_AXIS)];
            root.draw(&PathElement::new(line, thick(rgb(Meaning::Event), 8)))?;
        }
        // Texts are on white: no line crosses them.
        for label in &self.labels {
            write(root, &label.text, label.from, row(label))?;
        }
        let (_, mut rest) = root.split_vertically(self.head() * FINE);
        for (n, part) in self.panels.iter().enumerate() {
            let last = n + 1 == self.panels.len();
            let axis = if last { TIME_AXIS } else { 0 };
            let (area, below) = rest.split_vertically((part.height() + axis) * FINE);
            match part.strips.is_empty() {
                true => self.draw_lines(&area, part, axis)?,
                false => self.draw_strips(&area, part, axis)?,
            }
            part.heading.draw(&area, self.figure)?;
            rest = below;
        }
        Ok(())
    }

    /// A panel of numbers.
    fn draw_lines(&self, area: &Area<'_>, part: &Part<'_>, axis: i32) -> Drawn {
        let [low, high] = part.panel.range.unwrap_or_else(|| {
            whole_range(part.panel.signals.iter().map(|&n| &self.figure.signals[n]))
        });
        let mut chart = chart(area, part.heading.height(), axis)
            .y_label_area_size(LEFT * FINE)
            .build_cartesian_2d(0.0..self.figure.end, low..high)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(thick(rgb(Meaning::Grid), 8))
            .axis_style(thick(rgb(Meaning::Event), 8))
            .label_style(small())
            .x_labels(11)
            .y_labels(5)
            .x_label_formatter(&|time| short(*time))
            .y_label_formatter(&|value| short(*value))
            .x_desc(if axis > 0 { "time (s)" } else { "" })
            .set_all_tick_mark_size(3 * FINE)
            .draw()?;
        // The first signal is on top.
        for look in part.heading.legend.iter().flatten().rev() {
            let samples = &self.figure.signals[look.signal].samples;
            let style = look.style();
            for points in thin(samples, low, high, PLOT as usize) {
                if let [point] = points[..] {
                    // A line of one point has no length.
                    chart.draw_series([Circle::new(point, FINE, style.filled())])?;
                    continue;
                }
                match look.dashes() {
                    None => chart.draw_series(LineSeries::new(points, style))?,
                    Some([on, off]) => chart.draw_series(DashedLineSeries::new(
                        points,
                        on * FINE,
                        off * FINE,
                        style,
                    ))?,
                };
            }
        }
        Ok(())
    }

    /// A panel of signals whose values have names.
    fn draw_strips(&self, area: &Area<'_>, part: &Part<'_>, axis: i32) -> Drawn {
        let mut chart = chart(area, part.heading.height(), axis)
            .y_label_area_size(LEFT * FINE)
            .build_cartesian_2d(0.0..self.figure.end, 0.0..1.0)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .axis_style(thick(rgb(Meaning::Event), 8))
            .label_style(small())
            .x_labels(11)
            .y_labels(0)
            .x_label_formatter(&|time| short(*time))
            .x_desc(if axis > 0 { "time (s)" } else { "" })
            .set_all_tick_mark_size(3 * FINE)
            .draw()?;
        let mut top = part.heading.height() + 2;
        for strip in &part.strips {
            strip.draw(area, top, &self.events)?;
            top += strip.height();
        }
        Ok(())
    }
}

impl Part<'_> {
    fn height(&self) -> i32 {
        let body = match self.strips.is_empty() {
            true => PANEL,
            false => self.strips.iter().map(Strip::height).sum(),
        };
        self.heading.height() + body
    }
}

impl Heading {
    fn new(panel: &Panel, figure: &Figure<'_>) -> Self {
        let title = panel.title.clone();
        let mut legend: Vec<Vec<Look>> = vec![Vec::new()];
        let mut x = LEFT + bold_width(&title) + 22;
        let numbers = panel.signals.iter().filter(|&&n| figure.signals[n].states.is_none());
        for &signal in numbers {
            let meaning = figure.signals[signal].meaning;
            let same = |look: &&Look| look.meaning == meaning;
            let dash = legend.iter().flatten().filter(same).count();
            let size = Look::width(&figure.signals[signal]);
            if x + size > WIDTH {
                legend.push(Vec::new());
                x = LEFT;
            }
            let line = legend.last_mut().expect("there is a first line");
            line.push(Look { signal, meaning, dash, x });
            x += size + 18;
        }
        Heading { title, legend }
    }

    fn height(&self) -> i32 {
        8 + self.legend.len() as i32 * TEXT_LINE
    }

    fn draw(&self, area: &Area<'_>, figure: &Figure<'_>) -> Drawn {
        write_bold(area, &self.title, LEFT, 4 + TEXT_LINE / 2)?;
        for (row, looks) in self.legend.iter().enumerate() {
            let y = 4 + row as i32 * TEXT_LINE + TEXT_LINE / 2;
            for look in looks {
                look.draw_sample(area, y)?;
                write(area, &figure.signals[look.signal].name, look.x + SAMPLE + 5, y)?;
            }
        }
        Ok(())
    }
}

impl Look {
    /// Width of a signal in a legend.
    fn width(signal: &Signal<'_>) -> i32 {
        SAMPLE + 5 + width(&signal.name)
    }

    /// Lengths of a dash and of the space behind it.
    fn dashes(&self) -> Option<[i32; 2]> {
        (self.dash > 0).then(|| [9 / self.dash as i32, 4])
    }

    fn style(&self) -> ShapeStyle {
        let eighths = if self.meaning == Meaning::Reference { 9 } else { 13 };
        thick(rgb(self.meaning), eighths)
    }

    fn draw_sample(&self, area: &Area<'_>, y: i32) -> Drawn {
        let box_ = [at(self.x - 2, y - 6), at(self.x + SAMPLE + 2, y + 6)];
        area.draw(&Rectangle::new(box_, WHITE.filled()))?;
        let [on, off] = self.dashes().unwrap_or([SAMPLE, 0]);
        let mut x = self.x;
        while x < self.x + SAMPLE {
            let line = [at(x, y), at((x + on).min(self.x + SAMPLE), y)];
            area.draw(&PathElement::new(line, self.style()))?;
            x += on + off;
        }
        Ok(())
    }
}

fn chart<'a, 'b>(area: &'a Area<'b>, top: i32, axis: i32) -> ChartBuilder<'a, 'b, SVGBackend<'b>> {
    let mut builder = ChartBuilder::on(area);
    builder.margin_top(top * FINE).margin_right(RIGHT * FINE).x_label_area_size(axis * FINE);
    builder
}
