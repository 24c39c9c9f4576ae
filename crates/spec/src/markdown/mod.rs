//! The tables as Markdown, for people.

mod page;
mod rmd;
mod st;

use page::Page;

/// The tables of both protocols, a page with tables in the form of GitHub.
pub fn markdown() -> String {
    let mut page = Page::default();
    page.heading(1, "Tables of the protocols");
    page.text("Written by `motorlink spec markdown`. All numbers are little-endian on the wire.");
    st::tables(&mut page);
    rmd::tables(&mut page);
    page.into_text()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_a_table_has_the_cells_of_its_head() {
        let page = markdown();
        for table in page.split("\n\n").filter(|part| part.starts_with('|')) {
            let cells = |line: &str| line.replace("\\|", "").matches('|').count();
            let head = table.lines().next().map(cells);
            assert!(table.lines().all(|line| Some(cells(line)) == head), "{table}");
            assert!(table.lines().count() > 2, "{table}");
        }
    }
}
