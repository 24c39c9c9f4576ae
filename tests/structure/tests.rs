//! Small crates in memory, with and without cycles.

use crate::cycles::of_modules;
use crate::load::load;
use crate::names::names;
use crate::workspace::{Package, dependencies};
use std::path::Path;

/// The cycles of a crate of these files, each as its modules; `lib.rs` is the root.
fn cycles(files: &[(&str, &str)]) -> Vec<String> {
    let mut modules = read(files);
    let names = names(&mut modules);
    let members = |cycle: &crate::cycles::Cycle| {
        let names = cycle.members.iter().map(|&member| modules.0[member].name.clone());
        names.collect::<Vec<_>>().join(" ")
    };
    of_modules(&modules, &names).iter().map(members).collect()
}

/// What modules of a crate name of others: `module > item line`.
fn named(files: &[(&str, &str)]) -> Vec<String> {
    let mut modules = read(files);
    let names = names(&mut modules);
    let sentence = |name: &crate::names::Name| {
        let (from, to) = (&modules.0[name.from].name, &modules.0[name.to].name);
        format!("{from} > {to}::{} {}", name.item, name.line)
    };
    names.iter().map(sentence).collect()
}

fn read(files: &[(&str, &str)]) -> crate::modules::Modules {
    let read = |path: &Path| {
        let found = files.iter().find(|(name, _)| Path::new(name) == path);
        found.map(|(_, text)| text.to_string())
    };
    load(Path::new("lib.rs"), &read)
}

const ROOT: (&str, &str) = ("lib.rs", "mod a;\nmod b;\nmod c;");

#[test]
fn modules_that_name_each_other_are_a_cycle() {
    let a = ("a.rs", "use crate::b::B;\npub struct A(B);");
    let c = ("c.rs", "pub struct C;");
    assert_eq!(
        cycles(&[ROOT, a, ("b.rs", "pub struct B(super::a::A);"), c]),
        ["crate::a crate::b"]
    );
    assert_eq!(cycles(&[ROOT, a, ("b.rs", "pub struct B(super::c::C);"), c]), [""; 0]);
}

#[test]
fn a_parent_that_uses_its_child_is_in_a_cycle_with_it() {
    let child = ("a/child.rs", "use super::Limit;\npub struct Child(Limit);");
    let uses =
        ("a/mod.rs", "mod child;\npub use child::Child;\npub struct Limit;\npub type T = Child;");
    let exports = ("a/mod.rs", "mod child;\npub use child::Child;\npub struct Limit;");
    let root = ("lib.rs", "mod a;");
    assert_eq!(cycles(&[root, child, uses]), ["crate::a crate::a::child"]);
    assert_eq!(cycles(&[root, child, exports]), [""; 0]);
}

#[test]
fn a_re_export_of_a_module_elsewhere_counts() {
    let files = [
        ROOT,
        ("a.rs", "pub use crate::b::B;\npub struct A;"),
        ("b.rs", "pub struct B(crate::a::A);"),
        ("c.rs", ""),
    ];
    assert_eq!(cycles(&files), ["crate::a crate::b"]);
}

#[test]
fn re_exports_are_followed_to_the_definition() {
    let files = [
        ("lib.rs", "mod a;\nmod b;\npub use b::*;\npub use b::inner::Deep as Renamed;"),
        ("a.rs", "use crate::{Renamed, Shown};\nfn f(_: crate::b::Wide) {}"),
        ("b/mod.rs", "pub mod inner;\npub use inner::{Deep as Shown, more::*};"),
        ("b/inner.rs", "pub struct Deep;\npub mod more { pub struct Wide; }"),
    ];
    let expected =
        ["crate::a > crate::b::inner::Deep 1", "crate::a > crate::b::inner::more::Wide 2"];
    assert_eq!(named(&files), expected);
}

#[test]
fn only_the_names_used_of_a_glob_count() {
    let files = [
        ("lib.rs", "mod a;\nmod b;\nuse b::Private;\npub fn used() {}\npub fn unused() {}"),
        ("a.rs", "use super::*;\nfn f() { used(); let _: Private; }"),
        ("b.rs", "use super::*;\npub struct Private;"),
    ];
    let expected = [
        "crate > crate::b::Private 3",
        "crate::a > crate::used 2",
        "crate::a > crate::b::Private 2",
    ];
    assert_eq!(named(&files), expected);
}

#[test]
fn private_names_do_not_pass_a_glob() {
    let files = [
        ("lib.rs", "mod a;\nmod b;\nmod c;\nmod d;\npub use a::*;\npub use b::*;\npub use c::*;"),
        ("a.rs", "use crate::d::Same;"),
        ("b.rs", "use crate::d::*;"),
        ("c.rs", "pub struct Same;\nmod e { type T = crate::Same; }"),
        ("d.rs", "pub struct Same;"),
    ];
    let expected = ["crate::a > crate::d::Same 1", "crate::c::e > crate::c::Same 2"];
    assert_eq!(named(&files), expected);
}

#[test]
fn a_module_may_have_the_name_of_a_function() {
    let files = [
        ("lib.rs", "mod a;\nmod clock;\npub fn clock() {}"),
        ("a.rs", "type T = crate::clock::Tick;\nfn f() { crate::clock() }"),
        ("clock.rs", "pub struct Tick;"),
    ];
    assert_eq!(named(&files), ["crate::a > crate::clock::Tick 1", "crate::a > crate::clock 2"]);
}

#[test]
fn paths_count_wherever_they_stand() {
    let files = [
        ROOT,
        (
            "a.rs",
            "use crate::b::{self, c as alias};
            fn f<T: b::Bound>(x: u8) -> u8 {
                match x { b::LIMIT => 1, _ => { use b::{Extra as _, function}; function() } }
            }
            #[with(b::check)]
            impl b::Kind { fn g() { alias::in_c(); Self::g(); b::Kind::First; } }",
        ),
        (
            "b.rs",
            "pub use crate::c;
            pub trait Bound {}
            pub trait Extra {}
            pub const LIMIT: u8 = 1;
            pub fn function() -> u8 { 1 }
            pub fn check() {}
            pub enum Kind { First }",
        ),
        ("c.rs", "pub fn in_c() {}"),
    ];
    let expected = [
        "crate::a > crate::b::Bound 2",
        "crate::a > crate::b::LIMIT 3",
        "crate::a > crate::b::Extra 3",
        "crate::a > crate::b::function 3",
        "crate::a > crate::b::check 5",
        "crate::a > crate::b::Kind 6",
        "crate::a > crate::c::in_c 6",
    ];
    assert_eq!(named(&files), expected);
}

#[test]
fn modules_are_found_in_files_and_braces() {
    let files = [
        (
            "lib.rs",
            "mod a { pub mod b; pub fn a() { b::b(); } }\n#[path = \"odd/place.rs\"]\nmod c;",
        ),
        ("a/b.rs", "pub fn b() { super::super::c::d::e() }"),
        ("odd/place.rs", "pub mod d;"),
        ("odd/d.rs", "pub fn e() { crate::a::a() }"),
    ];
    assert_eq!(cycles(&files), ["crate::a crate::a::b crate::c::d"]);
}

#[test]
fn macros_declare_and_name_where_they_are_invoked() {
    let files = [
        ("lib.rs", "#[macro_use]\nmod a;\nmod b;\nmod c;"),
        (
            "a.rs",
            "macro_rules! declare {
                ($($(#[$meta:meta])* $name:ident: $type:ty = $value:expr),+ $(,)?) => {
                    $( pub const $name: $type = { $crate::b::check(); $value }; )+
                };
            }",
        ),
        (
            "b.rs",
            "pub fn check() {}
            macro_rules! last {
                (@one $e:expr) => { $e };
                ($a:literal $b:expr) => { $crate::b::last!(@one $b) };
            }
            pub(crate) use last;",
        ),
        (
            "c.rs",
            "declare! {
                /// One.
                ONE: u8 = 1, TWO: u8 = 2
            }
            mod d {
                use crate::b::last;
                fn f() { last!(0 super::TWO); }
            }",
        ),
    ];
    let expected = [
        "crate::c > crate::a::declare 1",
        "crate::c > crate::b::check 1",
        "crate::c::d > crate::b::last 6",
        "crate::c::d > crate::c::TWO 7",
    ];
    assert_eq!(named(&files), expected);
}

#[test]
fn arguments_of_macros_from_other_crates_are_read() {
    let files = [
        ("lib.rs", "mod a;\npub const MAX: u8 = 1;\npub fn f() {}\npub mod m { pub struct S; }"),
        (
            "a.rs",
            r#"use super::*;
            fn g(x: u8) {
                assert!(x < MAX);
                json!({ "a": m::S, "b": f(), "c": x.f() });
            }"#,
        ),
    ];
    let expected = ["crate::a > crate::MAX 3", "crate::a > crate::m::S 4", "crate::a > crate::f 4"];
    assert_eq!(named(&files), expected);
}

#[test]
fn the_report_shows_what_to_move() {
    let files = [
        ROOT,
        ("a.rs", "pub use super::b::*;\npub struct Shared;\nfn a(_: One) {}\nfn aa(_: Two) {}"),
        ("b.rs", "use super::a::Shared;\npub struct One(Shared);\npub struct Two;"),
        ("c.rs", "use super::a::Shared;\npub struct Three(Shared);"),
    ];
    let mut modules = read(&files);
    let names = names(&mut modules);
    let reports: Vec<_> =
        of_modules(&modules, &names).iter().map(|cycle| cycle.report(Path::new(""))).collect();
    let expected = "2 modules depend on each other:\n  crate::a\n  crate::b\n\
        The cycle ends without these names:\n\
        \x20 b.rs names crate::a::Shared (line 1)\n\
        \x20   while a.rs names crate::b::One (line 3)\n";
    assert_eq!(reports, [expected]);
}

#[test]
fn a_dependency_for_tests_may_close_a_cycle_of_crates() {
    let package = |name: &str, dependencies: &str| {
        let text = format!(
            r#"{{"name": "{name}", "manifest_path": "/{name}/Cargo.toml", "targets": [],
                "dependencies": [{dependencies}]}}"#
        );
        serde_json::from_str(&text).expect("a package")
    };
    let on_b = package("a", r#"{"name": "b", "kind": null, "path": "/b"}"#);
    let for_tests = r#"{"name": "a", "kind": "dev", "path": "/a"}, {"name": "syn", "kind": null}"#;
    let packages: [Package; 3] = [on_b, package("b", for_tests), package("c", for_tests)];
    let pairs = dependencies(&packages);
    assert_eq!(pairs, [(0, 1), (1, 0), (2, 0)]);
    assert_eq!(crate::cycles::cycles(pairs.into_iter()), [[0, 1].into()]);
}
