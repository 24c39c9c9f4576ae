//! The parts of a page.

#[derive(Default)]
pub struct Page(String);

impl Page {
    pub fn into_text(self) -> String {
        self.0
    }

    pub fn heading(&mut self, level: usize, text: &str) {
        if !self.0.is_empty() {
            self.0.push('\n');
        }
        self.0 += &format!("{} {text}\n", "#".repeat(level));
    }

    pub fn text(&mut self, text: &str) {
        self.0 += &format!("\n{text}\n");
    }

    pub fn table<const N: usize>(
        &mut self,
        head: [&str; N],
        rows: impl IntoIterator<Item = [String; N]>,
    ) {
        self.0.push('\n');
        self.row(&head.map(str::to_owned));
        self.row(&[(); N].map(|()| "---".to_owned()));
        rows.into_iter().for_each(|row| self.row(&row));
    }

    fn row(&mut self, cells: &[String]) {
        let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
        self.0 += &format!("| {} |\n", cells.join(" | "));
    }
}

/// The text as code.
pub fn code(text: impl std::fmt::Display) -> String {
    format!("`{text}`")
}

/// A word for a fact, or nothing.
pub fn mark(is_so: bool, word: &str) -> String {
    if is_so { word.to_owned() } else { String::new() }
}

/// A range of values with their unit.
pub fn range(least: f64, most: f64, unit: &str) -> String {
    format!("{least} to {most} {unit}").trim_end().to_owned()
}
