//! The help: all keys.

use ratatui::text::Line;

use super::super::keys::{HELP, View};
use super::parts::Theme;
use crate::text::fit;

const KEY: usize = 20;
const PLACE: usize = 11;

pub fn lines(theme: &Theme, width: usize) -> Vec<Line<'static>> {
    let title = "Keys; any key closes this help, q ends the program";
    let mut lines = vec![Line::styled(fit(title, width), theme.bold())];
    for key in HELP {
        let place = match key.view {
            None => "everywhere",
            Some(View::Motors) => "motors",
            Some(View::Details) => "details",
            Some(View::Settings) => "registers",
        };
        let text = format!("{} {} {}", fit(key.key, KEY), fit(place, PLACE), key.does);
        lines.push(Line::raw(fit(&text, width)));
    }
    for text in [
        "",
        "This program starts no motor. When it ends, motors that turn go on turning.",
        "got/asked: reads a second. -: no value now. ?: see details. Times are UTC.",
    ] {
        lines.push(Line::raw(fit(text, width)));
    }
    lines
}
