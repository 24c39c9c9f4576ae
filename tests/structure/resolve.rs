//! Where the item that a path names is defined.

use crate::expand::Macro;
use crate::modules::{Id, Kind, Modules, ROOT, Scope};
use proc_macro2::TokenStream;
use std::rc::Rc;

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    Module(Id),
    /// An item, or what belongs to one: a module and the item's name in it.
    Item(Id, String),
}

/// The names that are being looked up: where, which, and for whom.
type Pending = Vec<(Id, String, Id)>;

impl Modules {
    /// What a path may mean in a module; nothing if it leads to another crate or to a local name.
    pub fn resolve(&self, from: Id, path: &[String]) -> Vec<Target> {
        self.follow(from, path, &mut Pending::new())
    }

    /// What a macro that the crate declares writes; `None` for the macro of another crate.
    pub fn expand(&self, from: Id, invocation: &syn::Macro) -> Option<TokenStream> {
        let (id, name, found) = self.find_macro(from, &invocation.path)?;
        let expanded = found.expand(&invocation.tokens);
        let module = &self.0[id].name;
        Some(expanded.unwrap_or_else(|| panic!("cannot expand {module}::{name}!")))
    }

    /// Where a macro of this crate is declared.
    pub fn find_macro(&self, from: Id, path: &syn::Path) -> Option<(Id, String, Rc<Macro>)> {
        let path = segments(path);
        let in_scope = || match &path[..] {
            [name] => self.around(from).find_map(|id| self.macro_of(id, name)),
            _ => None,
        };
        let by_path = || {
            self.resolve(from, &path).into_iter().find_map(|target| match target {
                Target::Item(id, name) => self.macro_of(id, &name),
                Target::Module(_) => None,
            })
        };
        in_scope().or_else(by_path)
    }

    fn macro_of(&self, id: Id, name: &str) -> Option<(Id, String, Rc<Macro>)> {
        let module = &self.0[id];
        match module.macros.get(name) {
            Some(found) => Some((id, name.into(), found.clone())),
            None => module.macro_use.iter().find_map(|&id| self.macro_of(id, name)),
        }
    }

    fn follow(&self, from: Id, path: &[String], pending: &mut Pending) -> Vec<Target> {
        let Some((first, rest)) = path.split_first() else { return Vec::new() };
        let mut targets = match first.as_str() {
            "crate" => vec![Target::Module(ROOT)],
            "self" => vec![Target::Module(self.owner(from))],
            "super" => self.parent_of(self.owner(from)),
            name => {
                let owner = self.owner(from);
                let mut scopes = self.around(from).take_while(|&id| self.owner(id) == owner);
                let mut found = scopes.by_ref().map(|id| self.look_up(id, name, from, pending));
                found.find(|found| !found.is_empty()).unwrap_or_default()
            }
        };
        for name in rest {
            let modules = targets.iter().any(|target| matches!(target, Target::Module(_)));
            targets = targets
                .into_iter()
                .flat_map(|target| match target {
                    Target::Module(id) if name == "super" => self.parent_of(id),
                    Target::Module(id) => self.look_up(id, name, from, pending),
                    // The item has the name of a module, which goes before `::`.
                    Target::Item(..) if modules => Vec::new(),
                    item => vec![item],
                })
                .collect();
        }
        targets
    }

    fn parent_of(&self, id: Id) -> Vec<Target> {
        self.0[id].parent.map(|id| Target::Module(self.owner(id))).into_iter().collect()
    }

    /// What `name` is in a module, as far as the module `viewer` sees it.
    fn look_up(&self, id: Id, name: &str, viewer: Id, pending: &mut Pending) -> Vec<Target> {
        let key = (id, name.to_string(), viewer);
        if pending.contains(&key) {
            return Vec::new();
        }
        pending.push(key);
        let visible = |scope: Scope| scope.is_none_or(|scope| self.within(viewer, scope));
        let module = &self.0[id];
        let mut found = Vec::new();
        for entry in module.entries.get(name).into_iter().flatten() {
            match &entry.kind {
                _ if !visible(entry.scope) => {}
                Kind::Item => found.push(Target::Item(id, name.into())),
                Kind::Module(inner) => found.push(Target::Module(*inner)),
                Kind::Import(path) => found.extend(self.follow(id, path, pending)),
            }
        }
        if found.is_empty() {
            for (path, _) in module.globs.iter().filter(|(_, scope)| visible(*scope)) {
                for target in self.follow(id, path, pending) {
                    if let Target::Module(inner) = target {
                        found.extend(self.look_up(inner, name, id, pending));
                    }
                }
            }
        }
        pending.pop();
        found
    }

    /// Whether a module is another one or in it.
    pub fn within(&self, id: Id, around: Id) -> bool {
        self.around(id).any(|id| id == around)
    }
}

/// The names in a path; the first is empty if it begins with `::`.
pub fn segments(path: &syn::Path) -> Vec<String> {
    let start = path.leading_colon.map(|_| String::new());
    start.into_iter().chain(path.segments.iter().map(|s| s.ident.to_string())).collect()
}
