//! Manual pages.

use std::io;
use std::path::Path;

use clap::Command;
use clap::builder::Resettable;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};

use crate::failure::Failure;
use crate::output::print_line;

/// Writes a manual page for the program and each of its commands.
pub fn write_manual(command: Command, folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| Failure::file(folder, &error))?;
    let mut command = command.disable_help_subcommand(true);
    command.build();
    write_pages(&command, folder)?;
    print_line(&folder.join("motorlink.1").display())
}

fn write_pages(command: &Command, folder: &Path) -> Result<(), Failure> {
    for command in command.get_subcommands().filter(|command| !command.is_hide_set()) {
        write_pages(command, folder)?;
    }
    let man = Man::new(command.clone().after_help(Resettable::Reset));
    let path = folder.join(man.get_filename());
    let page = page(command, &man).map_err(|error| Failure::file(&path, &error))?;
    std::fs::write(&path, page).map_err(|error| Failure::file(&path, &error))
}

/// The page of a command. [`Man::render`] would fill the lines of tables and examples behind the options.
fn page(command: &Command, man: &Man) -> io::Result<Vec<u8>> {
    let mut page = Vec::new();
    man.render(&mut page)?;
    if let Some(help) = command.get_after_help() {
        notes(&help.to_string()).to_writer(&mut page)?;
    }
    Ok(page)
}

/// Text behind the options: indented lines are kept as they are, others are filled.
fn notes(text: &str) -> Roff {
    let mut roff = Roff::new();
    roff.control("SH", ["NOTES"]);
    let mut is_kept = false;
    for line in text.lines() {
        let keeps = line.starts_with(' ');
        if keeps != is_kept {
            keep(&mut roff, keeps);
            is_kept = keeps;
        }
        match line.is_empty() {
            true => roff.control("PP", []),
            false => roff.text([roman(line)]),
        };
    }
    if is_kept {
        keep(&mut roff, false);
    }
    roff
}

/// From here on lines are kept. They are less indented than a section: tables have up to 76 columns.
fn keep(roff: &mut Roff, keeps: bool) {
    match keeps {
        true => roff.control("nf", []).control("in", ["2n"]),
        false => roff.control("fi", []).control("in", []),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indented_lines_keep_their_shape_in_a_manual_page() {
        let text = "Ports:\n  a   first\n  bb  second\nThen\nmore.\n\n  end";
        let table = [".nf", ".in 2n", "  a   first", "  bb  second", ".fi", ".in"];
        let end = [".PP", ".nf", ".in 2n", "  end", ".fi", ".in"];
        let expected = [&[".SH NOTES", "Ports:"], &table[..], &["Then", "more."], &end].concat();
        let page = notes(text).to_roff();
        assert_eq!(page.lines().filter(|line| !line.is_empty()).collect::<Vec<_>>(), expected);
    }
}
