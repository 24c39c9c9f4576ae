//! Tables for a terminal and for Markdown.

/// How a report is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Style {
    /// Aligned columns.
    Plain,
    /// Markdown.
    Markdown,
}

/// A table with a title and an explanation.
pub struct Section {
    pub title: &'static str,
    pub note: String,
    pub columns: Vec<&'static str>,
    /// As many cells as there are columns.
    pub rows: Vec<Vec<String>>,
}

impl Section {
    pub fn print(&self) {
        print!("\n{}", self.text(Style::Plain));
    }

    fn text(&self, style: Style) -> String {
        let widths = self.widths();
        let head = self.columns.iter().map(|name| (*name).to_owned()).collect();
        let rule = widths.iter().enumerate().map(|(column, &width)| match (style, column) {
            (Style::Plain, _) | (Style::Markdown, 0) => "-".repeat(width),
            // Numbers are right-aligned.
            (Style::Markdown, _) => format!("{}:", "-".repeat(width - 1)),
        });
        let mut text = match style {
            Style::Plain => format!("{}\n{}\n\n", self.title, self.note),
            Style::Markdown => format!("## {}\n\n{}\n\n", self.title, self.note),
        };
        for row in [&head, &rule.collect()].into_iter().chain(&self.rows) {
            text.push_str(&line(row, &widths, style));
        }
        text
    }

    fn widths(&self) -> Vec<usize> {
        let width = |column: usize| {
            let cells = self.rows.iter().map(|row| row[column].chars().count());
            cells.chain([self.columns[column].chars().count()]).max().unwrap_or(0)
        };
        (0..self.columns.len()).map(width).collect()
    }
}

fn line(cells: &[String], widths: &[usize], style: Style) -> String {
    let padded =
        cells.iter().zip(widths).enumerate().map(|(column, (cell, &width))| match column {
            0 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
    let padded: Vec<String> = padded.collect();
    match style {
        Style::Plain => format!("  {}\n", padded.join("  ").trim_end()),
        Style::Markdown => format!("| {} |\n", padded.join(" | ")),
    }
}

/// A goal for a result.
pub struct Goal {
    pub what: String,
    pub wanted: String,
    /// The result and whether it reaches the goal; `None` if it could not be measured.
    pub reached: Option<(String, bool)>,
}

/// The goals and their results.
pub fn goals(goals: &[Goal]) -> Section {
    let row = |goal: &Goal| {
        let (figure, verdict) = match &goal.reached {
            Some((figure, true)) => (figure.as_str(), "met"),
            Some((figure, false)) => (figure.as_str(), "missed"),
            None => ("-", "not measured"),
        };
        vec![goal.what.clone(), goal.wanted.clone(), figure.to_owned(), verdict.to_owned()]
    };
    Section {
        title: "Goals",
        note: "The goals of this project.".to_owned(),
        columns: vec!["figure", "wanted", "measured", "goal"],
        rows: goals.iter().map(row).collect(),
    }
}

/// A page with these lines of its head and these sections in place of those that it has. It keeps its
/// other text, and the tables of other commands.
pub fn updated(mut page: String, head: &[(&str, String)], sections: &[Section]) -> String {
    for (name, value) in head {
        replace(&mut page, &format!("- {name}: "), "\n", format!("- {name}: `{value}`"));
    }
    for section in sections {
        replace(
            &mut page,
            &format!("## {}\n", section.title),
            "\n\n## ",
            section.text(Style::Markdown),
        );
    }
    page
}

/// Replaces what begins with `begin` at the start of a line, up to `end`; appends it if nothing does.
fn replace(page: &mut String, begin: &str, end: &str, text: String) {
    let text = text.trim_end();
    let Some(at) = page.find(&format!("\n{begin}")) else {
        page.push_str(&format!("\n{text}\n"));
        return;
    };
    let behind = page[at + 1..].find(end).map_or(page.trim_end().len(), |size| at + 1 + size);
    page.replace_range(at + 1..behind, text);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Section {
        goals(&[
            Goal {
                what: "ratio".into(),
                wanted: ">= 0.90".into(),
                reached: Some(("0.95".into(), true)),
            },
            Goal { what: "instructions".into(), wanted: "< 1500".into(), reached: None },
        ])
    }

    #[test]
    fn plain_columns_are_aligned() {
        let text = example().text(Style::Plain);
        let lines: Vec<&str> = text.lines().skip(3).collect();
        assert_eq!(
            lines,
            [
                "  figure         wanted  measured          goal",
                "  ------------  -------  --------  ------------",
                "  ratio         >= 0.90      0.95           met",
                "  instructions   < 1500         -  not measured",
            ]
        );
    }

    #[test]
    fn markdown_is_a_table_with_figures_at_the_right() {
        let text = example().text(Style::Markdown);
        assert!(text.starts_with("## Goals\n\n"));
        assert!(text.contains("| ------------ | ------: | -------: | -----------: |\n"));
        assert!(text.contains("| ratio        | >= 0.90 |     0.95 |          met |\n"));
    }

    #[test]
    fn a_page_gets_the_new_sections_and_keeps_the_rest() {
        let page = "# Page\n\n- kernel: `old`\n\n## Goals\n\nold\n\n## Others\n\nkept\n".to_owned();
        let page = updated(page, &[("kernel", "new".to_owned())], &[example()]);
        assert!(page.starts_with("# Page\n\n- kernel: `new`\n\n## Goals\n\nThe goals"), "{page}");
        assert!(page.ends_with("not measured |\n\n## Others\n\nkept\n"), "{page}");
        let again = updated(page.clone(), &[], &[example()]);
        assert_eq!(again, page);
        let last = updated("# Page\n\n## Goals\n\nold\n".to_owned(), &[], &[example()]);
        assert!(last.ends_with("not measured |\n") && !last.contains("old"), "{last}");
    }
}
