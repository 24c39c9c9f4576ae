//! Who may come in: tokens, and the Host and Origin of requests.

use std::net::IpAddr;

use axum::http::header::{COOKIE, HOST, ORIGIN};
use axum::http::uri::{Authority, Scheme};
use axum::http::{HeaderMap, HeaderName, Uri};
use rustix::rand::{GetRandomFlags, getrandom};

use crate::message::Role;

/// 128 random bits as text. It goes into URLs, cookies and names of files.
///
/// # Errors
/// The system has no random numbers.
pub fn random_word() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    getrandom(&mut bytes, GetRandomFlags::empty())?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// What a request needs to come in.
pub struct Auth {
    /// The token of each role.
    tokens: [(Role, String); 2],
    /// The name of the cookie. Cookies of all ports of a machine are in one place.
    cookie: String,
    is_secure: bool,
    /// Names of this machine, besides its addresses.
    names: Vec<String>,
}

impl Auth {
    /// With new tokens, for a server at this port. `names` are names of this machine that
    /// browsers may use.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new(port: u16, is_secure: bool, names: Vec<String>) -> std::io::Result<Self> {
        Ok(Auth {
            tokens: [(Role::Operator, random_word()?), (Role::Viewer, random_word()?)],
            cookie: format!("motorlink-{port}"),
            is_secure,
            names,
        })
    }

    /// The token of a role.
    pub fn token(&self, role: Role) -> &str {
        let [(_, operator), (_, viewer)] = &self.tokens;
        if role == Role::Operator { operator } else { viewer }
    }

    /// The role that a token gives.
    pub fn role_of(&self, token: &str) -> Option<Role> {
        self.tokens.iter().find(|(_, own)| is_same(own, token)).map(|(role, _)| *role)
    }

    /// The role of a request with a cookie.
    pub fn role(&self, headers: &HeaderMap) -> Option<Role> {
        let cookies = headers.get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut tokens = cookies
            .flat_map(|cookies| cookies.split(';'))
            .filter_map(|cookie| cookie.trim().strip_prefix(&self.cookie)?.strip_prefix('='));
        tokens.find_map(|token| self.role_of(token))
    }

    /// The header that gives a browser the cookie.
    pub fn set_cookie(&self, role: Role) -> String {
        let secure = if self.is_secure { "; Secure" } else { "" };
        let (name, token) = (&self.cookie, self.token(role));
        format!("{name}={token}; HttpOnly; SameSite=Strict; Path=/{secure}")
    }

    /// Whether the request was made to this machine: by an address, or by a name that is known to be
    /// its own. Another site can give its own name the address of this machine, but has to send it.
    pub fn is_own_host(&self, headers: &HeaderMap) -> bool {
        let Some(host) = single(headers, HOST) else { return false };
        let Ok(authority) = host.parse::<Authority>() else { return false };
        let name = authority.host();
        let has_port = host.len() > name.len();
        if host.contains('@') || has_port && authority.port_u16().is_none() {
            return false;
        }
        let is_address = address(name).is_some();
        let is_known = |own: &str| own.eq_ignore_ascii_case(name);
        is_address || is_known("localhost") || self.names.iter().any(|own| is_known(own))
    }

    /// The scheme of addresses.
    pub fn scheme(&self) -> &'static str {
        if self.is_secure { "https" } else { "http" }
    }

    /// Whether the request came from a page of this server; `None`: it does not say.
    pub fn is_own_origin(&self, headers: &HeaderMap) -> Option<bool> {
        if !headers.contains_key(ORIGIN) {
            return None;
        }
        let own = single(headers, HOST).map(|host| format!("{}://{host}", self.scheme()));
        let origin = single(headers, ORIGIN);
        Some(own.zip(origin).is_some_and(|(own, origin)| own.eq_ignore_ascii_case(origin)))
    }
}

/// Whether the request came from a page of this computer; `None`: from no page.
pub fn is_local_origin(headers: &HeaderMap) -> Option<bool> {
    if !headers.contains_key(ORIGIN) {
        return None;
    }
    let uri = single(headers, ORIGIN).and_then(|origin| origin.parse::<Uri>().ok());
    let is_local = |uri: Uri| {
        let is_web = uri.scheme().is_some_and(|it| *it == Scheme::HTTP || *it == Scheme::HTTPS);
        let is_bare = uri.path() == "/" && uri.query().is_none();
        let name = uri.host().unwrap_or_default();
        is_web && is_bare && (name.eq_ignore_ascii_case("localhost") || is_loopback(name))
    };
    Some(uri.is_some_and(is_local))
}

/// Whether the host of an address is an address of this computer alone.
fn is_loopback(host: &str) -> bool {
    address(host).is_some_and(|ip| ip.is_loopback())
}

fn address(host: &str) -> Option<IpAddr> {
    let inner = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
    inner.unwrap_or(host).parse().ok()
}

/// A header that is there once.
fn single(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    values.next().filter(|_| values.next().is_none())?.to_str().ok()
}

/// Whether two texts are the same, in a time that does not say where they differ.
fn is_same(own: &str, given: &str) -> bool {
    let difference = own.bytes().zip(given.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
    own.len() == given.len() && std::hint::black_box(difference) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn auth() -> Auth {
        Auth::new(8707, false, vec!["bench.local".to_owned()]).expect("random numbers")
    }

    fn headers(list: &[(HeaderName, &str)]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in list {
            headers.append(name.clone(), value.parse().expect("a header"));
        }
        headers
    }

    #[test]
    fn hosts_are_addresses_and_known_names() {
        let own = ["127.0.0.1:8707", "[::1]:8707", "localhost:9000", "LOCALHOST", "10.1.2.3:1"];
        for host in own.into_iter().chain(["bench.local:8707"]) {
            assert!(auth().is_own_host(&headers(&[(HOST, host)])), "{host}");
        }
        let others =
            ["evil.example:8707", "127.0.0.1.evil.example", "a@127.0.0.1", "", "2130706433x"];
        let more = ["localhost.evil.example:8707", "[::1", "127.1:8707"];
        let ports = ["127.0.0.1:8707.evil.example", "localhost:evil", "[::1]:99999", "localhost:"];
        for host in others.into_iter().chain(more).chain(ports) {
            assert!(!auth().is_own_host(&headers(&[(HOST, host)])), "{host}");
        }
        assert!(!auth().is_own_host(&headers(&[])));
        assert!(!auth().is_own_host(&headers(&[(HOST, "localhost"), (HOST, "evil.example")])));
    }

    #[test]
    fn an_origin_is_the_host_itself() {
        let check = |list: &[(HeaderName, &str)]| auth().is_own_origin(&headers(list));
        let host = (HOST, "127.0.0.1:8707");
        assert_eq!(check(std::slice::from_ref(&host)), None);
        assert_eq!(check(&[host.clone(), (ORIGIN, "http://127.0.0.1:8707")]), Some(true));
        for other in
            ["http://127.0.0.1:3000", "https://127.0.0.1:8707", "null", "http://evil.example"]
        {
            assert_eq!(check(&[host.clone(), (ORIGIN, other)]), Some(false), "{other}");
        }
        let twice = [host, (ORIGIN, "http://127.0.0.1:8707"), (ORIGIN, "null")];
        assert_eq!(check(&twice), Some(false));
    }

    #[test]
    fn a_cookie_has_one_token_of_two() {
        let auth = auth();
        for role in [Role::Operator, Role::Viewer] {
            let set = auth.set_cookie(role);
            assert!(set.ends_with("; HttpOnly; SameSite=Strict; Path=/"), "{set}");
            let cookie = format!("other=1; {}", set.split(';').next().unwrap_or_default());
            assert_eq!(auth.role(&headers(&[(COOKIE, &cookie)])), Some(role));
        }
        let token = auth.token(Role::Operator);
        assert_eq!(token.len(), 32);
        assert_ne!(token, auth.token(Role::Viewer));
        for cookie in
            [format!("motorlink-8708={token}"), format!("motorlink-8707={token}0"), String::new()]
        {
            assert_eq!(auth.role(&headers(&[(COOKIE, &cookie)])), None, "{cookie}");
        }
        assert_eq!(auth.role_of(""), None);
        assert_eq!(auth.role_of(&token[1..]), None);
    }
}
