//! Addresses of shared queues: `nats://HOST:PORT/NAME`, or `tls://` for a connection that must be encrypted.

use percent_encoding::percent_decode_str;

/// The name of a queue whose address has none.
const DEFAULT_NAME: &str = "meshsnap";

/// Longest name, characters.
const NAME_CHARS_MAX: usize = 32;

/// The error of an address that names no queue.
#[derive(Debug, thiserror::Error)]
pub enum AddressError {
    /// The address has another form.
    #[error(
        "--queue `{0}` is no address of a shared queue: write nats://HOST:PORT/NAME, or tls://HOST:PORT/NAME; several \
         hosts are separated by commas, and NAME is 1 to 32 of a-z, A-Z, 0-9, - and _"
    )]
    Form(String),
    /// Jobs are kept in the store.
    #[error("--queue needs --store: the jobs of the queue are kept in the store that all servers share")]
    NoStore,
    /// The program was built without NATS.
    #[cfg(not(feature = "cluster"))]
    #[error("--queue: this program was built without NATS (the feature `cluster`)")]
    Absent,
}

/// A NATS server, or several of one cluster, and the name of the queue there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// The addresses of the servers, without users.
    pub servers: Vec<String>,
    /// User and password.
    pub login: Option<(String, String)>,
    /// The name of the queue.
    pub name: String,
}

impl Address {
    /// Reads an address.
    pub fn read(text: &str) -> Result<Self, AddressError> {
        let error = || AddressError::Form(without_secrets(text));
        let (scheme, rest) = text.split_once("://").filter(|(scheme, _)| is_scheme(scheme)).ok_or_else(error)?;
        let (hosts, name) = rest.split_once('/').unwrap_or((rest, ""));
        let name = if name.is_empty() { DEFAULT_NAME } else { name };
        let is_name = |text: &str| text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
        let login = hosts.split(',').find_map(|host| host.rsplit_once('@')).map(|(login, _)| login);
        let decoded = |text: &str| percent_decode_str(text).decode_utf8().map(String::from).map_err(|_| error());
        let login = match login.map(|login| login.split_once(':').ok_or_else(error)).transpose()? {
            Some((user, password)) => Some((decoded(user)?, decoded(password)?)),
            None => None,
        };
        let hosts = without_users(hosts);
        let is_host = |host: &str| !host.is_empty() && !host.contains(|c: char| c.is_whitespace() || c.is_control());
        if name.len() > NAME_CHARS_MAX || !is_name(name) || !hosts.split(',').all(is_host) {
            return Err(error());
        }
        let servers = hosts.split(',').map(|host| format!("{scheme}://{host}")).collect();
        Ok(Self { servers, login, name: name.to_owned() })
    }

    /// The address for messages.
    pub fn words(&self) -> String {
        format!("{}/{}", self.servers.join(","), self.name)
    }
}

fn is_scheme(scheme: &str) -> bool {
    ["nats", "tls"].contains(&scheme)
}

/// An address without what is before each `@`: logs are no place for passwords.
fn without_secrets(address: &str) -> String {
    match address.split_once("://") {
        Some((scheme, hosts)) => format!("{scheme}://{}", without_users(hosts)),
        None => address.to_owned(),
    }
}

fn without_users(hosts: &str) -> String {
    hosts.split(',').map(|host| host.rsplit_once('@').map_or(host, |(_, host)| host)).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_name_servers_and_a_queue() {
        let of = |text: &str| Address::read(text).map(|address| (address.servers.join(" "), address.name)).ok();
        let is = |servers: &str, name: &str| Some((servers.to_owned(), name.to_owned()));
        assert_eq!(of("nats://a:4222"), is("nats://a:4222", "meshsnap"));
        assert_eq!(of("nats://a:4222/farm-2"), is("nats://a:4222", "farm-2"));
        assert_eq!(of("tls://u:p@a,b:1/x"), is("tls://a tls://b:1", "x"));
        let login = Address::read("nats://u:p%40ss@a,u:p%40ss@b/x").unwrap().login;
        assert_eq!(login, Some(("u".to_owned(), "p@ss".to_owned())));
        let wrong = [
            "nats://u@a",
            "a:4222",
            "http://a",
            "nats://",
            "nats://a,,b",
            "nats://a/x.y",
            "nats://a/b/c",
            "nats://a b",
        ];
        assert_eq!(wrong.map(of), [const { None }; 8]);
        assert_eq!(of(&format!("nats://a/{}", "n".repeat(33))), None);
    }

    #[test]
    fn messages_have_no_passwords() {
        let address = Address::read("nats://user:secret@a,user:secret@b/x").unwrap();
        assert_eq!(address.words(), "nats://a,nats://b/x");
        let error = Address::read("nats://user:secret@a/x y").unwrap_err().to_string();
        assert!(!error.contains("secret") && error.contains("nats://a/x y"), "{error}");
    }
}
