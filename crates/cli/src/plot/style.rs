//! Measures and texts.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::palette::Meaning;

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Drawn = Result<(), Box<dyn std::error::Error>>;

/// The drawing library rounds to whole pixels, so the picture is drawn this much larger.
pub const FINE: i32 = 8;

/// Measures in pixels of the picture as it is shown.
pub const WIDTH: i32 = 760;
pub const LEFT: i32 = 98;
pub const RIGHT: i32 = 18;
/// Width of the plots.
pub const PLOT: i32 = WIDTH - LEFT - RIGHT;
/// Height of a line of text.
pub const TEXT_LINE: i32 = 18;
/// The drawing library makes letters smaller by a quarter.
const FONT: i32 = 15;
const BOLD_FONT: i32 = 16;

/// About how wide a text is.
pub fn width(text: &str) -> i32 {
    text.chars().map(|c| if c.is_uppercase() || c == '_' { 8 } else { 7 }).sum()
}

/// About how wide a bold text is.
pub fn bold_width(text: &str) -> i32 {
    text.chars().count() as i32 * 9
}

pub fn at(x: i32, y: i32) -> (i32, i32) {
    (x * FINE, y * FINE)
}

pub fn thick(colour: RGBColor, eighths: i32) -> ShapeStyle {
    colour.stroke_width((eighths * FINE / 8) as u32)
}

pub fn rgb(meaning: Meaning) -> RGBColor {
    let (red, green, blue) = meaning.colour();
    RGBColor(red, green, blue)
}

/// A colour on white, without what is behind it.
pub fn tint(meaning: Meaning, share: f64) -> RGBColor {
    let mix = |part: u8| (255.0 - (255.0 - f64::from(part)) * share).round() as u8;
    let (red, green, blue) = meaning.colour();
    RGBColor(mix(red), mix(green), mix(blue))
}

pub fn small() -> TextStyle<'static> {
    ("sans-serif", FONT * FINE).into_font().color(&rgb(Meaning::Text))
}

pub fn bold(size: i32) -> TextStyle<'static> {
    let font = FontDesc::new(FontFamily::SansSerif, f64::from(size * FINE), FontStyle::Bold);
    font.color(&rgb(Meaning::Text))
}

/// Writes a text on white from its left end; `y` is its middle.
pub fn write(area: &Area<'_>, text: &str, x: i32, y: i32) -> Drawn {
    write_as(area, text, [x, y], small(), width(text))
}

/// The same in bold letters.
pub fn write_bold(area: &Area<'_>, text: &str, x: i32, y: i32) -> Drawn {
    write_as(area, text, [x, y], bold(BOLD_FONT), bold_width(text))
}

fn write_as(
    area: &Area<'_>,
    text: &str,
    [x, y]: [i32; 2],
    style: TextStyle<'_>,
    size: i32,
) -> Drawn {
    let corners = [at(x - 2, y - TEXT_LINE / 2), at(x + size + 2, y + TEXT_LINE / 2)];
    area.draw(&Rectangle::new(corners, WHITE.filled()))?;
    let style = style.pos(Pos::new(HPos::Left, VPos::Center));
    Ok(area.draw(&Text::new(text, at(x, y), style))?)
}
