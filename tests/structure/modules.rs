//! The modules of a crate, with what each declares and imports.

use crate::expand::Macro;
use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;
use syn::spanned::Spanned;
use syn::{Attribute, Ident, Item, Stmt, UseTree, Visibility};

/// Index of a module.
pub type Id = usize;

/// The module `crate`.
pub const ROOT: Id = 0;

/// The modules of a crate. A block of code that declares something is one, too.
#[derive(Default)]
pub struct Modules(pub Vec<Module>);

#[derive(Default)]
pub struct Module {
    /// Such as `crate::st::master`.
    pub name: String,
    pub file: PathBuf,
    pub parent: Option<Id>,
    /// A block of code, which belongs to the module around it.
    pub block: bool,
    /// Where the files of its modules are.
    pub folder: PathBuf,
    pub entries: HashMap<String, Vec<Entry>>,
    /// Modules whose names are names here, too.
    pub globs: Vec<(Vec<String>, Scope)>,
    pub uses: Vec<Use>,
    pub macros: HashMap<String, Rc<Macro>>,
    /// Modules whose macros are declared here, too.
    pub macro_use: Vec<Id>,
    /// Macros that wrote a part of it, with the lines.
    pub invoked: Vec<(syn::Path, usize)>,
    /// What it declares, with the line to show for what a macro wrote.
    pub code: Vec<(Item, Option<usize>)>,
}

/// What a name means in a module.
pub struct Entry {
    pub kind: Kind,
    pub scope: Scope,
}

pub enum Kind {
    Item,
    Module(Id),
    Import(Vec<String>),
}

/// The module that, with those in it, sees a name; `None`: all do.
pub type Scope = Option<Id>;

/// A path behind `use`, without the `::*`.
pub struct Use {
    pub path: Vec<String>,
    /// Whether there is a `pub`.
    pub exported: bool,
    pub line: usize,
}

impl Modules {
    /// The module that `id` is or, as a block, belongs to.
    pub fn owner(&self, id: Id) -> Id {
        self.around(id).find(|&id| !self.0[id].block).expect("a block is in a module")
    }

    /// The module and those around it, from the inside.
    pub fn around(&self, id: Id) -> impl Iterator<Item = Id> {
        std::iter::successors(Some(id), |&id| self.0[id].parent)
    }

    /// A module for what the items among `statements` declare; `parent` if there is nothing.
    pub fn block(&mut self, parent: Id, statements: &[Stmt]) -> Id {
        let id = self.0.len();
        for statement in statements {
            match statement {
                Stmt::Item(item) if !is_test(item) => {
                    if id == self.0.len() {
                        let parent = Some(parent);
                        self.0.push(Module { parent, block: true, ..Module::default() });
                    }
                    self.declare(id, item);
                }
                _ => {}
            }
        }
        if id == self.0.len() { parent } else { id }
    }

    /// Enters the names that an item declares in a module.
    pub fn declare(&mut self, id: Id, item: &Item) {
        if let (_, Some((name, vis))) = parts(item) {
            self.enter(id, name, vis, Kind::Item);
        }
        match item {
            Item::Use(item) => {
                let start = item.leading_colon.map(|_| String::new());
                self.import(id, start.as_slice(), &item.tree, &item.vis);
            }
            Item::Macro(item) => {
                let Some(name) = &item.ident else { return };
                let exported = item.attrs.iter().any(|a| a.path().is_ident("macro_export"));
                let id = if exported { ROOT } else { id };
                let rules = Macro::new(item.mac.tokens.clone());
                let rules = rules.unwrap_or_else(|e| panic!("macro_rules! {name}: {e}"));
                self.0[id].macros.insert(name.to_string(), Rc::new(rules));
                self.enter(id, name, &Visibility::Inherited, Kind::Item);
            }
            _ => {}
        }
    }

    pub fn enter(&mut self, id: Id, name: &Ident, vis: &Visibility, kind: Kind) {
        let entry = Entry { kind, scope: self.scope(id, vis) };
        self.0[id].entries.entry(name.to_string()).or_default().push(entry);
    }

    fn import(&mut self, id: Id, path: &[String], tree: &UseTree, vis: &Visibility) {
        let to = |name: &Ident| match path {
            [_, ..] if name == "self" => path.to_vec(),
            _ => [path, &[name.to_string()]].concat(),
        };
        let (path, name) = match tree {
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.import(id, path, tree, vis));
            }
            UseTree::Path(step) => return self.import(id, &to(&step.ident), &step.tree, vis),
            UseTree::Name(leaf) => (to(&leaf.ident), to(&leaf.ident).pop()),
            UseTree::Rename(leaf) => (to(&leaf.ident), Some(leaf.rename.to_string())),
            UseTree::Glob(_) => (path.to_vec(), None),
        };
        let exported = !matches!(vis, Visibility::Inherited);
        let line = tree.span().start().line;
        self.0[id].uses.push(Use { path: path.clone(), exported, line });
        let scope = self.scope(id, vis);
        match name {
            Some(name) => {
                let entry = Entry { kind: Kind::Import(path), scope };
                self.0[id].entries.entry(name).or_default().push(entry);
            }
            None => self.0[id].globs.push((path, scope)),
        }
    }

    fn scope(&self, id: Id, vis: &Visibility) -> Scope {
        match vis {
            Visibility::Inherited => Some(id),
            Visibility::Restricted(within) if within.path.is_ident("super") => self.0[id].parent,
            _ => None,
        }
    }
}

/// Whether an item is for tests only.
pub fn is_test(item: &Item) -> bool {
    has_test(parts(item).0)
}

/// Whether attributes leave what they are at to tests.
pub fn has_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg")
                && attribute.parse_args::<Ident>().is_ok_and(|name| name == "test")
    })
}

/// The attributes of an item, and its name where that is all that it declares.
fn parts(item: &Item) -> (&[Attribute], Option<(&Ident, &Visibility)>) {
    match item {
        Item::Const(item) => (&item.attrs, Some((&item.ident, &item.vis))),
        Item::Enum(item) => (&item.attrs, Some((&item.ident, &item.vis))),
        Item::Fn(item) => (&item.attrs, Some((&item.sig.ident, &item.vis))),
        Item::Static(item) => (&item.attrs, Some((&item.ident, &item.vis))),
        Item::Struct(item) => (&item.attrs, Some((&item.ident, &item.vis))),
        Item::Trait(item) => (&item.attrs, Some((&item.ident, &item.vis))),
        Item::Type(item) => (&item.attrs, Some((&item.ident, &item.vis))),
        Item::Union(item) => (&item.attrs, Some((&item.ident, &item.vis))),
        Item::Impl(item) => (&item.attrs, None),
        Item::Macro(item) => (&item.attrs, None),
        Item::Mod(item) => (&item.attrs, None),
        Item::Use(item) => (&item.attrs, None),
        _ => (&[], None),
    }
}
