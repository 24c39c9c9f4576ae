//! Writes Lua tables.

use std::fmt::{Display, Write as _};

/// A table in the making.
pub(crate) struct Lua {
    text: String,
    depth: usize,
}

impl Lua {
    /// The content of a table, indented once.
    pub(crate) fn new() -> Self {
        Lua { text: String::new(), depth: 1 }
    }

    pub(crate) fn finish(self) -> String {
        self.text
    }

    /// A field: a number, a truth value, or what [`text`] returns.
    pub(crate) fn set(&mut self, key: &str, value: impl Display) {
        self.line(format_args!("{key} = {value},"));
    }

    /// A value at an index.
    pub(crate) fn entry(&mut self, index: u8, value: impl Display) {
        self.line(format_args!("[{index:#04x}] = {value},"));
    }

    /// A table in a field.
    pub(crate) fn table(&mut self, key: &str, content: impl FnOnce(&mut Lua)) {
        self.nested(format_args!("{key} = "), content);
    }

    /// A table at an index.
    pub(crate) fn numbered(&mut self, index: u8, content: impl FnOnce(&mut Lua)) {
        self.nested(format_args!("[{index:#04x}] = "), content);
    }

    /// A table at the next index.
    pub(crate) fn row(&mut self, content: impl FnOnce(&mut Lua)) {
        self.nested(format_args!(""), content);
    }

    fn nested(&mut self, begin: impl Display, content: impl FnOnce(&mut Lua)) {
        self.line(format_args!("{begin}{{"));
        self.depth += 1;
        content(self);
        self.depth -= 1;
        self.line("},");
    }

    fn line(&mut self, line: impl Display) {
        let _ = writeln!(self.text, "{:indent$}{line}", "", indent = self.depth * 4);
    }
}

/// A string of Lua.
pub(crate) fn text(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            '\n' => quoted.push_str("\\n"),
            _ => quoted.push(letter),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_reads_like_lua() {
        let mut lua = Lua::new();
        lua.table("a", |lua| {
            lua.set("b", 1);
            lua.numbered(2, |lua| lua.row(|lua| lua.set("c", text("\"\\°\n"))));
        });
        let expected = "    a = {\n        b = 1,\n        [0x02] = {\n            {\n                c = \
                        \"\\\"\\\\°\\n\",\n            },\n        },\n    },\n";
        assert_eq!(lua.finish(), expected);
    }
}
