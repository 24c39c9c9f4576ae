//! All keys.

use ratatui::text::Line;

use super::super::keys::{HELP, View};
use super::parts::Theme;
use super::text::fit;

const KEY: usize = 20;
const PLACE: usize = 11;

pub fn lines(theme: &Theme, width: usize) -> Vec<Line<'static>> {
    let mut lines = vec![Line::styled(fit("Keys; any key closes this help", width), theme.bold())];
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
        "This view starts no motor. When it ends, motors that others started go on.",
        "`got/asked`: reads a second. `-`: no present value. `?`: see details. Times: UTC.",
    ] {
        lines.push(Line::raw(fit(text, width)));
    }
    lines
}
