use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use serde_json::Value;
use x509_parser::extensions::GeneralName;
use x509_parser::pem::Pem;

use super::*;

/// A folder for a site. It is removed after the test.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        let name = format!("motorlink-site-{}", Name::random().unwrap());
        Folder(std::env::temp_dir().join(name))
    }

    fn plan(&self, members: &[(Role, &str)]) -> Plan {
        let members = members.iter().map(|(role, name)| (*role, name.parse().unwrap())).collect();
        let router = ["127.0.0.1", "plant.local:7000"].map(|it| it.parse().unwrap()).to_vec();
        Plan { folder: self.0.clone(), router, members, days: 30 }
    }

    /// All files and folders below.
    fn paths(&self) -> Vec<PathBuf> {
        let (mut paths, mut next) = (Vec::new(), vec![self.0.clone()]);
        while let Some(path) = next.pop() {
            if path.is_dir() {
                next.extend(fs::read_dir(&path).unwrap().map(|it| it.unwrap().path()));
            }
            paths.push(path);
        }
        paths.sort();
        paths
    }

    fn texts(&self) -> Vec<(PathBuf, String)> {
        let files = self.paths().into_iter().filter(|it| it.is_file());
        files.map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
    }

    /// Who has rights in the router's file.
    fn subjects(&self) -> Vec<String> {
        let access = member(&self.0.join("router.json5"), "access_control");
        let subjects = access["subjects"].as_array().unwrap();
        subjects.iter().map(|it| it["id"].as_str().unwrap().to_owned()).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

const ALL: [(Role, &str); 3] =
    [(Role::Node, "arm1"), (Role::Operator, "alice"), (Role::Viewer, "bob")];

fn member(path: &Path, name: &str) -> Value {
    json5::from_str::<Value>(&fs::read_to_string(path).unwrap()).unwrap()[name].take()
}

/// The certificate in a file, in PEM.
fn pem(path: &Path, side: &str) -> Vec<u8> {
    let text =
        member(path, "transport")["link"]["tls"][format!("{side}_certificate_base64")].take();
    BASE64_STANDARD.decode(text.as_str().unwrap()).unwrap()
}

#[test]
fn each_file_is_a_zenoh_configuration() {
    let folder = Folder::new();
    let site = init(&folder.plan(&ALL)).unwrap();
    let files = site.members.values().map(|it| &it.file).chain([&site.router]);
    for file in files {
        zenoh::Config::from_file(file).unwrap();
    }
    let alice = crate::network::Network::File(folder.0.join("operators/alice.json5"));
    assert_eq!(alice.name(), Some("alice".parse().unwrap()));
    assert_eq!(alice.role(), Some(Role::Operator));
    let places = ["tls/127.0.0.1:7447", "tls/plant.local:7000"];
    assert_eq!(
        member(&site.members[&"arm1".parse().unwrap()].file, "connect")["endpoints"][1],
        places[1]
    );
    assert_eq!(site.addresses, places);
}

#[test]
fn certificates_name_their_owner_and_are_for_one_side_of_a_connection() {
    let folder = Folder::new();
    init(&folder.plan(&ALL)).unwrap();
    let router = pem(&folder.0.join("router.json5"), "listen");
    let alice = pem(&folder.0.join("operators/alice.json5"), "connect");
    let authority = fs::read(folder.0.join("ca/ca.pem")).unwrap();
    let parsed = |pem: &[u8]| Pem::iter_from_buffer(pem).next().unwrap().unwrap();
    let [router, alice, authority] = [&router, &alice, &authority].map(|it| parsed(it));
    let [router, alice, authority] =
        [&router, &alice, &authority].map(|it| it.parse_x509().unwrap());

    let name = |it: &x509_parser::certificate::X509Certificate<'_>| it.subject().to_string();
    assert_eq!(
        [name(&router), name(&alice), name(&authority)],
        ["CN=router", "CN=alice", "CN=Motorlink site"]
    );
    for member in [&router, &alice] {
        assert_eq!(member.issuer(), authority.subject());
        assert!(!member.is_ca());
        assert_eq!(member.validity().time_to_expiration().map(|it| it.whole_days()), Some(29));
    }
    assert!(authority.is_ca());
    let usage = router.extended_key_usage().unwrap().unwrap().value;
    assert!(usage.server_auth && !usage.client_auth);
    let usage = alice.extended_key_usage().unwrap().unwrap().value;
    assert!(usage.client_auth && !usage.server_auth);
    let hosts = &router.subject_alternative_name().unwrap().unwrap().value.general_names;
    let expected = [GeneralName::IPAddress(&[127, 0, 0, 1]), GeneralName::DNSName("plant.local")];
    assert_eq!(**hosts, expected);
}

#[test]
fn only_the_owner_reads_a_site() {
    let folder = Folder::new();
    init(&folder.plan(&ALL)).unwrap();
    for path in folder.paths() {
        let expected = if path.is_dir() { 0o700 } else { 0o600 };
        let mode = fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, expected, "{}", path.display());
    }
}

#[test]
fn a_second_run_adds_members_and_keeps_all_else() {
    let folder = Folder::new();
    init(&folder.plan(&ALL)).unwrap();
    let before = folder.texts();
    init(&folder.plan(&[])).unwrap();
    assert_eq!(folder.texts(), before);
    // A run that was killed has left this.
    fs::write(folder.0.join("nodes/arm2.new"), "half").unwrap();
    let site = init(&folder.plan(&[(Role::Node, "arm1"), (Role::Node, "arm2")])).unwrap();
    let new: Vec<_> = site.members.iter().filter(|(_, it)| it.is_new).collect();
    assert_eq!(new.len(), 1);
    for (path, text) in before.iter().filter(|(path, _)| !path.ends_with("router.json5")) {
        assert_eq!(&fs::read_to_string(path).unwrap(), text, "{}", path.display());
    }
    assert_eq!(folder.subjects(), ["alice", "arm1", "arm2", "bob"]);
}

#[test]
fn runs_at_the_same_time_wait_for_each_other() {
    let folder = Folder::new();
    std::thread::scope(|scope| {
        for number in 0..6 {
            let name = format!("arm{number}");
            let plan = folder.plan(&[(Role::Node, &name)]);
            scope.spawn(move || init(&plan).unwrap());
        }
    });
    let subjects: Vec<_> = (0..6).map(|number| format!("arm{number}")).collect();
    assert_eq!(folder.subjects(), subjects);
    let authority = fs::read_to_string(folder.0.join("ca/ca.pem")).unwrap();
    for name in subjects {
        let path = folder.0.join(format!("nodes/{name}.json5"));
        let tls = member(&path, "transport")["link"]["tls"].take();
        let trusted = tls["root_ca_certificate_base64"].as_str().unwrap();
        assert_eq!(BASE64_STANDARD.decode(trusted).unwrap(), authority.as_bytes());
    }
}

#[test]
fn a_file_that_is_removed_withdraws_access_and_needs_no_authority() {
    let folder = Folder::new();
    init(&folder.plan(&ALL)).unwrap();
    let router = folder.0.join("router.json5");
    let text = fs::read_to_string(&router).unwrap();
    fs::write(&router, text.replace("\"lease\": 3000", "\"lease\": 4000")).unwrap();
    fs::remove_file(folder.0.join("operators/alice.json5")).unwrap();
    fs::remove_dir_all(folder.0.join("ca")).unwrap();
    init(&Plan { router: Vec::new(), ..folder.plan(&[]) }).unwrap();
    assert_eq!(folder.subjects(), ["arm1", "bob"]);
    assert!(!fs::read_to_string(&router).unwrap().contains("alice"));
    // What its owner has changed stays.
    assert_eq!(member(&router, "transport")["link"]["tx"]["lease"], 4000);
    assert!(!folder.0.join("ca").exists());
}

#[test]
fn what_cannot_be_is_refused_before_anything_is_written() {
    let folder = Folder::new();
    let refused = |plan: &Plan| {
        let before = if folder.0.exists() { folder.texts() } else { Vec::new() };
        let error = init(plan).unwrap_err();
        let after = if folder.0.exists() { folder.texts() } else { Vec::new() };
        assert_eq!(after, before, "{error}");
        error
    };
    let twice = [(Role::Operator, "alice"), (Role::Viewer, "alice")];
    assert!(matches!(refused(&folder.plan(&twice)), SiteError::TwoRoles { .. }));
    let router = [(Role::Node, "router")];
    assert!(matches!(refused(&folder.plan(&router)), SiteError::NameOfRouter));
    let nowhere = Plan { router: Vec::new(), ..folder.plan(&ALL) };
    assert!(matches!(refused(&nowhere), SiteError::NoRouter(_)));
    init(&folder.plan(&ALL)).unwrap();
    assert!(matches!(refused(&folder.plan(&twice[1..])), SiteError::TwoRoles { .. }));
    let elsewhere = Plan { router: vec!["10.0.0.9".parse().unwrap()], ..folder.plan(&[]) };
    assert!(matches!(refused(&elsewhere), SiteError::OtherRouter(_)));
    // A certificate has no rights under the name of another file.
    fs::copy(folder.0.join("viewers/bob.json5"), folder.0.join("operators/eve.json5")).unwrap();
    assert!(
        refused(&folder.plan(&[])).to_string().contains("the certificate in it is that of bob")
    );
}

#[test]
fn a_router_listens_at_ip_addresses_and_for_names_at_all() {
    let listened = |texts: &[&str]| {
        let places: Vec<RouterAddress> = texts.iter().map(|it| it.parse().unwrap()).collect();
        RouterAddress::listened(&places)
    };
    assert_eq!(listened(&["10.0.0.5", "localhost:1"]), ["tls/10.0.0.5:7447", "tls/127.0.0.1:1"]);
    assert_eq!(listened(&["10.0.0.5", "plant.local"]), ["tls/0.0.0.0:7447"]);
    for bad in [
        "::1",
        "[::1]:7",
        "",
        "a b",
        "plant:",
        "plant:x",
        "plant:70000",
        "tls/plant",
        "plant,other",
        "a..b",
        "*",
    ] {
        assert_eq!(bad.parse::<RouterAddress>(), Err(BadAddress), "{bad}");
    }
}
