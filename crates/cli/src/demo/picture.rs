//! The demo's screen as a picture, for the README.

use std::fmt::Write;

use super::line::{Ink, Line};
use crate::palette::Meaning;

/// Measures in pixels.
const FONT: f64 = 14.0;
const COLUMN: f64 = 8.43;
const LINE: usize = 19;
const MARGIN: usize = 18;
const COLUMNS: usize = 80;

/// The lines as SVG.
pub fn draw(title: &str, lines: &[Line]) -> String {
    let width = 2 * MARGIN + (COLUMNS as f64 * COLUMN).ceil() as usize;
    let height = 2 * MARGIN + LINE * lines.len();
    let grid = Meaning::Grid.css();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"ui-monospace, SFMono-Regular, Menlo, Consolas, \
         'DejaVu Sans Mono', monospace\" font-size=\"{FONT}\">\n<title>{}</title>\n\
         <rect x=\"0.5\" y=\"0.5\" width=\"{}\" height=\"{}\" rx=\"8\" fill=\"#ffffff\" stroke=\"{grid}\"/>\n",
        escaped(title),
        width - 1,
        height - 1,
    );
    for (row, line) in lines.iter().enumerate() {
        let y = MARGIN + LINE * row + LINE - 5;
        let mut column = 0;
        for (ink, text) in line.parts() {
            let x = MARGIN as f64 + column as f64 * COLUMN;
            let size = text.chars().count();
            column += size;
            if text.trim().is_empty() {
                continue;
            }
            let (meaning, more) = look(ink);
            // With its length, text has its columns in every font. Writing to a string does not fail.
            let _ = writeln!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y}\" textLength=\"{:.1}\" fill=\"{}\"{more} \
                 xml:space=\"preserve\">{}</text>",
                size as f64 * COLUMN,
                meaning.css(),
                escaped(text)
            );
        }
    }
    svg + "</svg>\n"
}

/// Colour, and other attributes.
fn look(ink: Ink) -> (Meaning, &'static str) {
    match ink {
        Ink::Plain => (Meaning::Text, ""),
        Ink::Dim => (Meaning::Text, " fill-opacity=\"0.65\""),
        Ink::Bold => (Meaning::Text, " font-weight=\"bold\""),
        Ink::Running => (Meaning::Running, ""),
        Ink::Fault => (Meaning::Fault, " font-weight=\"bold\""),
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
