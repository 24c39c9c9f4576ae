//! Who may do what: the access control of a router.
//!
//! What comes in decides. What goes out is limited to the same keys, so that a member that connects as a
//! router itself learns no more than others.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::role::Role;
use crate::key::{self, MotorQuery, Name, Scope};

/// The rules for these members. All else is denied.
pub(super) fn control(members: &BTreeMap<Name, Role>) -> Value {
    let (seeing, answering) = (seeing(), [answering(), meeting()].concat());
    let mut rules = [&seeing[..], &answering].concat();
    let (mut subjects, mut policies) = (Vec::new(), Vec::new());
    for (name, role) in members {
        let (shared, own) = match role {
            Role::Node => (&answering, of_node(name)),
            Role::Operator => (&seeing, of_program(name, &Scope::ALL)),
            Role::Viewer => (&seeing, of_program(name, &[Scope::See])),
        };
        let name = name.as_str();
        let ids: Vec<_> = shared.iter().chain(&own).map(|rule| &rule["id"]).collect();
        policies.push(json!({"rules": ids, "subjects": [name]}));
        subjects.push(json!({"id": name, "cert_common_names": [name]}));
        rules.extend(own);
    }
    json!({
        "enabled": true, "default_permission": "deny",
        "rules": rules, "subjects": subjects, "policies": policies,
    })
}

/// What all programs see: nodes, what they publish, and what they answer to all.
fn seeing() -> Vec<Value> {
    let any = Name::any();
    let nodes = [key::all_alive()];
    let published = [
        key::state(&any),
        key::events(&any, Some("*")),
        key::of_all_motors(&any, key::SAMPLES),
        key::of_all_motors(&any, key::COLUMNS),
    ];
    let asked = asked_of_all();
    vec![
        coming("nodes", &["liveliness_query", "declare_liveliness_subscriber"], &nodes),
        coming("published", &["declare_subscriber"], &published),
        coming("asked", &["query"], &asked),
        going("nodes", &["liveliness_token"], &nodes),
        going("published", &["put"], &published),
        going("answers", &["reply"], &asked),
    ]
}

/// What all programs may ask of all nodes.
fn asked_of_all() -> Vec<String> {
    let any = Name::any();
    let about = MotorQuery::ALL.map(|about| key::of_all_motors(&any, about.words()));
    [&[key::info(&any, &any), key::of_all_motors(&any, key::COLUMNS)][..], &about].concat()
}

/// What all nodes are asked. Whether a program may ask it was decided before.
fn answering() -> Vec<Value> {
    let any = Name::any();
    let asks = Scope::ALL.map(|scope| key::ask(&any, &any, scope, &any, &any));
    let asked = [&asks[..], &asked_of_all()].concat();
    vec![going("questions", &["query"], &asked)]
}

/// What all nodes see of each other: who is there, and who ends.
fn meeting() -> Vec<Value> {
    let any = Name::any();
    let nodes = [key::all_alive()];
    let ends = [key::ended(&any, &any)];
    vec![
        coming("others", &["declare_liveliness_subscriber"], &nodes),
        coming("ends", &["declare_subscriber"], &ends),
        going("others", &["liveliness_token"], &nodes),
        going("ends", &["put"], &ends),
    ]
}

/// What a node says in its own name.
fn of_node(name: &Name) -> Vec<Value> {
    let any = Name::any();
    let alive = [key::alive_of(name)];
    let here = [key::session_token(name, &any, &any, &any)];
    let says = ["put", "reply", "declare_queryable"];
    vec![
        coming(&format!("says {name}"), &says, &[key::all_of(name)]),
        coming(&format!("alive {name}"), &["liveliness_token", "liveliness_query"], &alive),
        coming(&format!("programs {name}"), &["declare_liveliness_subscriber"], &here),
        going(&format!("tokens {name}"), &["liveliness_token"], &here),
    ]
}

/// What a program asks of all nodes in its own name.
fn of_program(name: &Name, scopes: &[Scope]) -> Vec<Value> {
    let any = Name::any();
    let ask = |scope: &Scope| key::ask(&any, &any, *scope, name, &any);
    let asks: Vec<_> = scopes.iter().map(ask).collect();
    let here = [key::session_token(&any, &any, name, &any)];
    vec![
        coming(&format!("asks {name}"), &["query"], &asks),
        coming(&format!("here {name}"), &["liveliness_token"], &here),
        going(&format!("answers {name}"), &["reply"], &asks),
    ]
}

/// What may come to the router.
fn coming(what: &str, messages: &[&str], keys: &[String]) -> Value {
    rule("ingress", what, messages, keys)
}

/// What may go from the router.
fn going(what: &str, messages: &[&str], keys: &[String]) -> Value {
    rule("egress", what, messages, keys)
}

fn rule(flow: &str, what: &str, messages: &[&str], keys: &[String]) -> Value {
    json!({
        "id": format!("{flow} {what}"), "permission": "allow", "flows": [flow],
        "messages": messages, "key_exprs": keys,
    })
}
