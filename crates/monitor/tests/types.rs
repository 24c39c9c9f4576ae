//! The types of the messages in TypeScript: web/src/wire.ts is written from those in Rust.
#![cfg(feature = "typescript")]

use std::any::TypeId;
use std::collections::BTreeMap;
use std::path::Path;

use motorlink_monitor::message;
use motorlink_telemetry::share::message as share;
use ts_rs::{TS, TypeVisitor};

/// Types by name, with their definitions. Both sides have some names: those of the share begin with it.
#[derive(Default)]
struct Types(BTreeMap<String, String>, Vec<TypeId>);

impl TypeVisitor for Types {
    fn visit<T: TS + 'static + ?Sized>(&mut self) {
        if T::output_path().is_none() || self.1.contains(&TypeId::of::<T>()) {
            return;
        }
        self.1.push(TypeId::of::<T>());
        assert!(self.0.insert(T::name(), T::decl()).is_none(), "two types are {}", T::name());
        T::visit_dependencies(self);
    }
}

#[test]
fn the_page_has_the_types_of_the_server() {
    let mut types = Types::default();
    types.visit::<message::FromPage>();
    types.visit::<message::Text>();
    types.visit::<message::RecordingPart>();
    types.visit::<share::Text>();
    let mut text =
        "// Written by `make web-types` from crates/monitor and crates/telemetry.\n".to_owned();
    for definition in types.0.values() {
        text += &format!("\nexport {definition}\n");
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/src/wire.ts");
    if std::env::var_os("MOTORLINK_UPDATE_WEB").is_some() {
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("the folder");
        std::fs::write(&path, &text).expect("web/src/wire.ts can be written");
    }
    let is = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(is == text, "web/src/wire.ts is not up to date: make web-types");
}
