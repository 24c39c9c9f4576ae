//! A panel of signals whose values have names: a strip for each, and a legend for what is too narrow
//! for its name.

use indexmap::IndexMap;
use motorlink_testbench::scenario::short;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::figure::{Signal, States};
use super::style::{
    Area, Drawn, LEFT, PLOT, TEXT_LINE, WIDTH, at, rgb, small, thick, tint, width, write,
};
use crate::palette::Meaning;

/// Height of a strip.
const STRIP: i32 = 24;
/// Space below a strip.
const GAP: i32 = 6;
/// Size of a sample of colour.
const SWATCH: i32 = 12;
/// Distance of the lines of a hatch.
const HATCH: i32 = 7;

/// A strip with its place.
pub struct Strip {
    name: String,
    spans: Vec<Span>,
    /// Spans without room for their names: each name with its first moments, line by line.
    legend: Vec<Vec<Entry>>,
}

/// A value as long as it lasts, in pixels from the left end of the picture.
struct Span {
    name: String,
    meaning: Meaning,
    from: i32,
    to: i32,
    /// Where its name has room.
    middle: Option<i32>,
}

struct Entry {
    text: String,
    meaning: Meaning,
}

impl Strip {
    /// A signal whose values have names; `events` are the places of the lines that cross the strip.
    pub fn new(signal: &Signal<'_>, states: &States<'_>, events: &[i32]) -> Self {
        let samples = &signal.samples;
        let place = |n: usize| LEFT + samples.place(n, f64::from(PLOT)) as i32;
        let mut spans = Vec::new();
        let mut narrow: IndexMap<String, (Meaning, Vec<String>)> = IndexMap::new();
        for segment in samples.segments() {
            let mut first = segment.start;
            for same in samples.values[segment.clone()].chunk_by(|a, b| a == b) {
                let next = (first + same.len()).min(segment.end - 1);
                let (from, to) = (place(first), place(next).max(place(first) + 1));
                let (name, meaning) = states(same[0]);
                let middle = room(from, to, width(&name), events);
                if middle.is_none() {
                    let moment = short(samples.place(first, samples.end));
                    let (_, moments) = narrow.entry(name.clone()).or_insert((meaning, Vec::new()));
                    moments.push(moment);
                }
                spans.push(Span { name, meaning, from, to, middle });
                first += same.len();
            }
        }
        // The look of a state is explained where its name has room once.
        narrow.retain(|name, _| {
            !spans.iter().any(|span: &Span| span.middle.is_some() && span.name == *name)
        });
        let legend = flow(narrow.into_iter().map(|(name, (meaning, moments))| Entry {
            text: format!("{name} at {} s", listed(&moments)),
            meaning,
        }));
        Strip { name: signal.name.clone(), spans, legend }
    }

    /// Height of the line for a name that is too wide for the place left of the strip.
    fn name_line(&self) -> i32 {
        if width(&self.name) > LEFT - 12 { TEXT_LINE } else { 0 }
    }

    pub fn height(&self) -> i32 {
        self.name_line() + STRIP + GAP + self.legend.len() as i32 * TEXT_LINE
    }

    /// Draws the strip from `top`, with the lines of events over it.
    pub fn draw(&self, area: &Area<'_>, top: i32, events: &[i32]) -> Drawn {
        match self.name_line() {
            0 => {
                let style = small().pos(Pos::new(HPos::Right, VPos::Center));
                let place = at(LEFT - 8, top + STRIP / 2);
                area.draw(&Text::new(self.name.as_str(), place, style))?;
            }
            line => write(area, &self.name, LEFT, top + line / 2)?,
        }
        let top = top + self.name_line();
        for span in &self.spans {
            fill(area, span.meaning, [span.from, span.to], [top, top + STRIP])?;
        }
        for &x in events {
            let line = [at(x, top), at(x, top + STRIP)];
            area.draw(&PathElement::new(line, thick(rgb(Meaning::Event), 8)))?;
        }
        for span in &self.spans {
            let Some(middle) = span.middle else { continue };
            let half = width(&span.name) / 2 + 3;
            let box_ = [at(middle - half, top + 4), at(middle + half, top + STRIP - 4)];
            area.draw(&Rectangle::new(box_, tint(span.meaning, SHARE).filled()))?;
            let style = small().pos(Pos::new(HPos::Center, VPos::Center));
            let text = Text::new(span.name.as_str(), at(middle, top + STRIP / 2), style);
            area.draw(&text)?;
        }
        for (row, entries) in self.legend.iter().enumerate() {
            let y = top + STRIP + GAP / 2 + row as i32 * TEXT_LINE + TEXT_LINE / 2;
            let mut x = LEFT;
            for Entry { text, meaning } in entries {
                let (from, to) = (y - SWATCH / 2, y + SWATCH / 2);
                fill(area, *meaning, [x, x + SWATCH], [from, to])?;
                write(area, text, x + SWATCH + 5, y)?;
                x += entry_width(text);
            }
        }
        Ok(())
    }
}

/// Share of a colour in a strip; the rest is white.
const SHARE: f64 = 0.35;

/// Middle of the widest place between event lines for a text of this width, if it has one.
fn room(from: i32, to: i32, size: i32, events: &[i32]) -> Option<i32> {
    let inside = events.iter().copied().filter(|x| (from..=to).contains(x));
    let mut edges: Vec<i32> = [from, to].into_iter().chain(inside).collect();
    edges.sort_unstable();
    let widest = edges.windows(2).max_by_key(|pair| pair[1] - pair[0])?;
    (widest[1] - widest[0] >= size + 6).then_some((widest[0] + widest[1]) / 2)
}

/// The first moments of a state.
fn listed(moments: &[String]) -> String {
    const FEW: usize = 8;
    match moments.len() {
        0..=FEW => moments.join(", "),
        count => format!("{} and {} more", moments[..FEW].join(", "), count - FEW),
    }
}

fn entry_width(text: &str) -> i32 {
    SWATCH + 5 + width(text) + 18
}

/// Entries in lines that fit the picture.
fn flow(entries: impl Iterator<Item = Entry>) -> Vec<Vec<Entry>> {
    let mut lines: Vec<Vec<Entry>> = Vec::new();
    let mut x = WIDTH;
    for entry in entries {
        let size = entry_width(&entry.text);
        if x + size > WIDTH {
            lines.push(Vec::new());
            x = LEFT;
        }
        x += size;
        lines.last_mut().expect("a line was begun").push(entry);
    }
    lines
}

/// Fills a part of a strip. What the motor does differs in its pattern, too: alignment is hatched to
/// the left, the other states before RUN to the right, a fault has a border.
fn fill(
    area: &Area<'_>,
    meaning: Meaning,
    [left, right]: [i32; 2],
    [top, bottom]: [i32; 2],
) -> Drawn {
    let corners = [at(left, top), at(right, bottom)];
    area.draw(&Rectangle::new(corners, tint(meaning, SHARE).filled()))?;
    let line = |from, to| PathElement::new([from, to], thick(rgb(meaning), 9));
    if matches!(meaning, Meaning::Starting | Meaning::Aligning) {
        let height = bottom - top;
        let mut low = left - height + HATCH;
        while low < right {
            // The part of a line of the hatch within the corners, from its lower to its upper end.
            let (from, to) = (low.max(left), (low + height).min(right));
            let (lower, upper) = (bottom - (from - low), bottom - (to - low));
            let (lower, upper) = match meaning {
                Meaning::Aligning => (top + bottom - lower, top + bottom - upper),
                _ => (lower, upper),
            };
            if from < to {
                area.draw(&line(at(from, lower), at(to, upper)))?;
            }
            low += HATCH;
        }
    }
    if meaning == Meaning::Fault {
        for y in [top, bottom] {
            area.draw(&PathElement::new([at(left, y), at(right, y)], thick(rgb(meaning), 20)))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_its_place_between_event_lines() {
        assert_eq!(room(100, 200, 40, &[]), Some(150));
        assert_eq!(room(100, 200, 40, &[120]), Some(160));
        assert_eq!(room(100, 200, 40, &[150]), Some(175));
        assert_eq!(room(100, 200, 60, &[150]), None, "the line would cross it");
        assert_eq!(room(100, 110, 40, &[]), None);
    }
}
