//! Reads the modules of a crate, and expands the macros that contain declarations.

use crate::modules::{Id, Kind, Module, Modules, ROOT, is_test};
use std::path::{Path, PathBuf};
use syn::spanned::Spanned;
use syn::{Expr, File, Item, ItemMacro, ItemMod, Lit, Meta};

/// Reads a source file, if there is one.
pub type Read<'r> = &'r dyn Fn(&Path) -> Option<String>;

/// The crate whose root is in `file`.
pub fn load(file: &Path, read: Read) -> Modules {
    let mut loader = Loader { read, modules: Modules::default(), invocations: Vec::new() };
    loader.modules.0.push(Module {
        name: "crate".into(),
        file: file.into(),
        folder: folder_of(file),
        ..Module::default()
    });
    loader.read_file(ROOT);
    // A macro may be imported, so all modules must be loaded first.
    while let Some((id, invocation, line)) = loader.invocations.pop() {
        loader.expand(id, invocation, line);
    }
    loader.modules
}

struct Loader<'r> {
    read: Read<'r>,
    modules: Modules,
    invocations: Vec<(Id, ItemMacro, usize)>,
}

impl Loader<'_> {
    fn read_file(&mut self, id: Id) {
        let path = &self.modules.0[id].file;
        let text = (self.read)(path).unwrap_or_else(|| panic!("cannot read {}", path.display()));
        let file = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        self.add(id, file.items, None);
    }

    fn add(&mut self, id: Id, items: Vec<Item>, line: Option<usize>) {
        for item in items.into_iter().filter(|item| !is_test(item)) {
            self.modules.declare(id, &item);
            match item {
                Item::Mod(item) => self.add_module(id, item),
                Item::Macro(item) if item.ident.is_none() => {
                    let line = line.unwrap_or(item.span().start().line);
                    self.invocations.push((id, item, line));
                }
                item => self.modules.0[id].code.push((item, line)),
            }
        }
    }

    fn add_module(&mut self, parent: Id, item: ItemMod) {
        let id = self.modules.0.len();
        let around = &self.modules.0[parent];
        let name = item.ident.to_string();
        let folder = around.folder.join(&name);
        let (file, folder) = if item.content.is_some() {
            (around.file.clone(), folder)
        } else if let Some(path) = path_attribute(&item) {
            let file = folder_of(&around.file).join(path);
            (file.clone(), folder_of(&file))
        } else {
            let beside = folder.with_extension("rs");
            let found = (self.read)(&beside).is_some();
            (if found { beside } else { folder.join("mod.rs") }, folder)
        };
        let name = format!("{}::{name}", around.name);
        self.modules.0.push(Module {
            name,
            file,
            folder,
            parent: Some(parent),
            ..Module::default()
        });
        self.modules.enter(parent, &item.ident, &item.vis, Kind::Module(id));
        if item.attrs.iter().any(|attribute| attribute.path().is_ident("macro_use")) {
            self.modules.0[parent].macro_use.push(id);
        }
        match item.content {
            Some((_, items)) => self.add(id, items, None),
            None => self.read_file(id),
        }
    }

    fn expand(&mut self, id: Id, invocation: ItemMacro, line: usize) {
        let expanded = self.modules.expand(id, &invocation.mac);
        match syn::parse2::<File>(expanded.unwrap_or(invocation.mac.tokens.clone())) {
            Ok(file) => {
                self.modules.0[id].invoked.push((invocation.mac.path, line));
                self.add(id, file.items, Some(line));
            }
            Err(_) => self.modules.0[id].code.push((Item::Macro(invocation), Some(line))),
        }
    }
}

fn folder_of(file: &Path) -> PathBuf {
    file.parent().expect("a file is in a folder").into()
}

fn path_attribute(item: &ItemMod) -> Option<String> {
    item.attrs.iter().find_map(|attribute| match &attribute.meta {
        Meta::NameValue(meta) if meta.path.is_ident("path") => match &meta.value {
            Expr::Lit(value) => match &value.lit {
                Lit::Str(path) => Some(path.value()),
                _ => None,
            },
            _ => None,
        },
        _ => None,
    })
}
