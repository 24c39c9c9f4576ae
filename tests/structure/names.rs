//! The items of other modules that the code of a module names.
//!
//! Not detected: methods and other associated items; the braces of format strings; the strings in
//! attributes; and, in attributes and other tokens that are not code, a lower-case name without
//! `::` that is not called.

use crate::modules::{Id, Modules, has_test, is_test};
use crate::resolve::{Target, segments};
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::HashSet;
use syn::parse::Parser;
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{
    Attribute, Block, Expr, ImplItemFn, Item, ItemFn, ItemMod, Macro, Meta, PatIdent, Path, Stmt,
    Token, TraitItemFn, Visibility,
};

/// A module names an item of another module.
#[derive(Debug, Clone)]
pub struct Name {
    pub from: Id,
    pub to: Id,
    pub item: String,
    pub line: usize,
}

/// The names in every module, each once.
pub fn names(modules: &mut Modules) -> Vec<Name> {
    let mut all = Vec::new();
    for id in 0..modules.0.len() {
        let mut names = Names {
            modules,
            at: id,
            line: None,
            locals: HashSet::new(),
            known: HashSet::new(),
            found: Vec::new(),
        };
        names.module();
        all.append(&mut names.found);
    }
    all
}

struct Names<'m> {
    modules: &'m mut Modules,
    /// The module or block that is read.
    at: Id,
    /// The line of the invocation, in code that a macro wrote.
    line: Option<usize>,
    /// Lower-case names that the patterns of the function declare.
    locals: HashSet<String>,
    known: HashSet<(Id, String)>,
    found: Vec<Name>,
}

impl Names<'_> {
    fn module(&mut self) {
        self.imports();
        for (path, line) in std::mem::take(&mut self.modules.0[self.at].invoked) {
            self.line = Some(line);
            self.macro_name(&path);
        }
        for (item, line) in std::mem::take(&mut self.modules.0[self.at].code) {
            self.line = line;
            self.visit_item(&item);
        }
    }

    /// The names in `use`, except re-exports of what is defined in modules within.
    fn imports(&mut self) {
        for import in std::mem::take(&mut self.modules.0[self.at].uses) {
            for target in self.modules.resolve(self.at, &import.path) {
                let Target::Item(to, item) = target else { continue };
                if !import.exported || !self.modules.within(to, self.at) {
                    self.add(to, item, import.line);
                }
            }
        }
    }

    fn add(&mut self, to: Id, item: String, line: usize) {
        let (from, to) = (self.modules.owner(self.at), self.modules.owner(to));
        let line = self.line.unwrap_or(line);
        if from != to && self.known.insert((to, item.clone())) {
            self.found.push(Name { from, to, item, line });
        }
    }

    fn name(&mut self, path: &[String], line: usize) {
        if let [name] = path
            && self.locals.contains(name)
        {
            return;
        }
        for target in self.modules.resolve(self.at, path) {
            if let Target::Item(to, item) = target {
                self.add(to, item, line);
            }
        }
    }

    fn macro_name(&mut self, path: &Path) {
        if let Some((to, name, _)) = self.modules.find_macro(self.at, path) {
            self.add(to, name, line_of(path));
        }
    }

    fn statements(&mut self, statements: &[Stmt]) {
        let block = self.modules.block(self.at, statements);
        let around = std::mem::replace(&mut self.at, block);
        if block != around {
            self.imports();
        }
        statements.iter().for_each(|statement| self.visit_stmt(statement));
        self.at = around;
    }

    /// The expansion of a macro, or the arguments of one that another crate declares.
    fn code(&mut self, tokens: TokenStream) {
        let list = Punctuated::<Expr, Token![,]>::parse_terminated;
        if let Ok(statements) = Block::parse_within.parse2(tokens.clone()) {
            self.statements(&statements);
        } else if let Ok(list) = list.parse2(tokens.clone()) {
            list.iter().for_each(|expression| self.visit_expr(expression));
        } else {
            self.tokens(tokens);
        }
    }

    fn tokens(&mut self, tokens: TokenStream) {
        let tokens: Vec<_> = tokens.into_iter().collect();
        let mut rest = &tokens[..];
        let mut field = false;
        while let [first, after @ ..] = rest {
            rest = after;
            match first {
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Ident(ident) if !field => {
                    let mut path = vec![ident.to_string()];
                    while let [colon, other, TokenTree::Ident(next), after @ ..] = rest
                        && is(colon, ':')
                        && is(other, ':')
                    {
                        path.push(next.to_string());
                        rest = after;
                    }
                    let called = matches!(rest, [TokenTree::Group(arguments), ..]
                        if arguments.delimiter() == Delimiter::Parenthesis);
                    if path.len() > 1 || called || capital(&path[0]) {
                        self.name(&path, ident.span().start().line);
                    }
                }
                _ => {}
            }
            field = is(first, '.') || is(first, '\'');
        }
    }

    /// Reads a function with its local names.
    fn function(&mut self, locals: Locals, read: impl FnOnce(&mut Self)) {
        let around = self.locals.clone();
        self.locals.extend(locals.0);
        read(self);
        self.locals = around;
    }
}

impl Visit<'_> for Names<'_> {
    fn visit_item(&mut self, item: &Item) {
        if !is_test(item) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &ItemFn) {
        let mut locals = Locals::default();
        locals.visit_item_fn(item);
        self.function(locals, |names| visit::visit_item_fn(names, item));
    }

    fn visit_impl_item_fn(&mut self, item: &ImplItemFn) {
        if has_test(&item.attrs) {
            return;
        }
        let mut locals = Locals::default();
        locals.visit_impl_item_fn(item);
        self.function(locals, |names| visit::visit_impl_item_fn(names, item));
    }

    fn visit_trait_item_fn(&mut self, item: &TraitItemFn) {
        let mut locals = Locals::default();
        locals.visit_trait_item_fn(item);
        self.function(locals, |names| visit::visit_trait_item_fn(names, item));
    }

    fn visit_block(&mut self, block: &Block) {
        self.statements(&block.stmts);
    }

    fn visit_item_macro(&mut self, item: &syn::ItemMacro) {
        // The rules of a macro are read where it is invoked.
        if item.ident.is_none() {
            self.visit_macro(&item.mac);
        }
    }

    fn visit_macro(&mut self, invocation: &Macro) {
        self.macro_name(&invocation.path);
        match self.modules.expand(self.at, invocation) {
            Some(expanded) => {
                let line = self.line.unwrap_or(line_of(&invocation.path));
                let around = self.line.replace(line);
                self.code(expanded);
                self.line = around;
            }
            None => self.code(invocation.tokens.clone()),
        }
    }

    fn visit_path(&mut self, path: &Path) {
        self.name(&segments(path), line_of(path));
        visit::visit_path(self, path);
    }

    /// A constant or a variant without fields looks like a variable in the pattern.
    fn visit_pat_ident(&mut self, pattern: &PatIdent) {
        let name = pattern.ident.to_string();
        if capital(&name) {
            self.name(&[name], pattern.ident.span().start().line);
        }
        visit::visit_pat_ident(self, pattern);
    }

    fn visit_attribute(&mut self, attribute: &Attribute) {
        match &attribute.meta {
            Meta::List(list) => self.tokens(list.tokens.clone()),
            Meta::NameValue(meta) => self.visit_expr(&meta.value),
            Meta::Path(_) => {}
        }
    }

    fn visit_item_mod(&mut self, _: &ItemMod) {}
    fn visit_visibility(&mut self, _: &Visibility) {}
}

/// Names that patterns declare.
#[derive(Default)]
struct Locals(HashSet<String>);

impl Visit<'_> for Locals {
    fn visit_pat_ident(&mut self, pattern: &PatIdent) {
        let name = pattern.ident.to_string();
        if !capital(&name) {
            self.0.insert(name);
        }
        visit::visit_pat_ident(self, pattern);
    }
}

fn capital(name: &str) -> bool {
    name.starts_with(|first: char| first.is_uppercase())
}

fn is(token: &TokenTree, char: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == char)
}

fn line_of(path: &Path) -> usize {
    path.span().start().line
}
