//! API keys: who may do what. Keys without a name come from a setting, named ones from a file ([`mod@file`]), which is
//! read again on SIGHUP. The key of a request is looked up by its digest.
//!
//! Architecture invariant: a missing or faulty file prevents the start, and later changes nothing. So such a mistake
//! neither opens the server nor locks everybody out.

mod file;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};

pub use file::KEYS_MAX;

use super::digest::Digest;
use super::jobs::Owner;

/// What a key may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Draw pictures, and see jobs and meshes.
    Render,
    /// Store and delete meshes.
    Store,
    /// Read `/metrics`.
    Metrics,
    /// See and delete the jobs and meshes of all keys, and all of the above.
    Admin,
}

impl Scope {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Render, Self::Store, Self::Metrics, Self::Admin];

    /// Its word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Render => "render",
            Self::Store => "store",
            Self::Metrics => "metrics",
            Self::Admin => "admin",
        }
    }
}

/// A key, without the key itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    /// The name for messages; empty for one of the setting.
    pub name: String,
    /// The party that it stands for.
    pub owner: Owner,
    /// The digest in hexadecimal digits, which signs addresses.
    pub signs_with: String,
    scopes: Vec<Scope>,
}

/// What the sender of a request may do and see.
#[derive(Clone, Debug, Default)]
pub struct Access {
    /// The party.
    pub owner: Owner,
    sees_all: bool,
    is_open: bool,
}

/// The keys at one moment.
#[derive(Clone, Debug, Default)]
pub struct KeySet(HashMap<Digest, Arc<Key>>);

/// The keys, which may change while the server runs.
#[derive(Debug)]
pub struct Keys {
    unnamed: Vec<String>,
    file: Option<PathBuf>,
    current: RwLock<Arc<KeySet>>,
}

/// Reasons why a file of keys was not read.
#[derive(Debug, thiserror::Error)]
pub enum KeysError {
    /// It cannot be opened or read.
    #[error("the file of API keys {path} cannot be read: {error}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        error: std::io::Error,
    },
    /// Its content is wrong.
    #[error("the file of API keys {path} is not used: {detail}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        detail: String,
    },
}

impl Key {
    /// A key of the setting: it may do everything but see what is others'.
    fn unnamed(key: &str) -> (Digest, Self) {
        let digest = Digest::of(key.as_bytes());
        // The owner's name is stored and listed in many places, and the digest signs addresses: another one stands for the key.
        let owner = Owner::new(&format!("key {}", Digest::of(format!("owner {digest}").as_bytes())));
        let scopes = vec![Scope::Render, Scope::Store, Scope::Metrics];
        (digest, Self { name: String::new(), owner, signs_with: digest.to_string(), scopes })
    }

    fn named(name: &str, digest: Digest, scopes: Vec<Scope>) -> Self {
        // The owner is the name, so that a key can be replaced by another without a loss of jobs and meshes.
        let owner = Owner::new(&format!("name {name}"));
        Self { name: name.to_owned(), owner, signs_with: digest.to_string(), scopes }
    }

    /// True if it has the scope.
    pub fn may(&self, scope: Scope) -> bool {
        self.scopes.contains(&scope) || self.scopes.contains(&Scope::Admin)
    }

    /// What its holder may see.
    pub fn access(&self) -> Access {
        Access { owner: self.owner.clone(), sees_all: self.scopes.contains(&Scope::Admin), is_open: false }
    }
}

impl Access {
    /// The access of an accepted job: whether its owner sees its mesh was asked before.
    pub fn of_job(owner: Owner) -> Self {
        Self { owner, sees_all: true, is_open: false }
    }

    /// The access of everybody where there are no keys.
    pub fn open(owner: Owner) -> Self {
        Self { owner, sees_all: true, is_open: true }
    }

    /// True if what is this owner's is seen.
    pub fn sees(&self, owner: &Owner) -> bool {
        self.sees_all || self.owner == *owner
    }

    /// True if the sender may treat everything as its own.
    pub fn sees_all(&self) -> bool {
        self.sees_all
    }

    /// True where there are no keys, so that the owner is an address and no identity.
    pub fn is_open(&self) -> bool {
        self.is_open
    }
}

impl KeySet {
    /// True if there are no keys, so that no request needs one.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The key with this text. What is looked up is its digest: nobody can try keys that nearly match.
    pub fn find(&self, key: &str) -> Option<&Arc<Key>> {
        self.0.get(&Digest::of(key.as_bytes()))
    }

    /// All keys.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<Key>> {
        self.0.values()
    }
}

impl Keys {
    /// Reads the file, if there is one.
    pub fn open(unnamed: &[String], file: Option<&Path>) -> Result<Self, KeysError> {
        let keys = Self { unnamed: unnamed.to_vec(), file: file.map(Path::to_owned), current: RwLock::default() };
        keys.reload()?;
        Ok(keys)
    }

    /// The keys at this moment.
    pub fn current(&self) -> Arc<KeySet> {
        self.current.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Reads the file again. After an error, the keys are those of before. The number of named keys; None if there is no
    /// file.
    pub fn reload(&self) -> Result<Option<usize>, KeysError> {
        let mut keys: HashMap<_, _> =
            self.unnamed.iter().map(|key| Key::unnamed(key)).map(|(digest, key)| (digest, Arc::new(key))).collect();
        let named = self.file.as_deref().map(file::read).transpose()?;
        let count = named.as_ref().map(Vec::len);
        // One that is in both has the rights that the file says.
        keys.extend(named.into_iter().flatten().map(|(digest, key)| (digest, Arc::new(key))));
        *self.current.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(KeySet(keys));
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use crate::keys::*;

    #[test]
    fn a_broken_file_changes_nothing_and_a_new_one_everything() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("keys.toml");
        assert!(matches!(Keys::open(&[], Some(&path)), Err(KeysError::Io { .. })));
        let line = |name: &str, key: &str, rest: &str| {
            format!("[[keys]]\nname = \"{name}\"\nsha256 = \"{}\"\n{rest}\n", Digest::of(key.as_bytes()))
        };
        std::fs::write(&path, line("ci", "one", "") + &line("boss", "two", "scopes = [\"admin\"]")).unwrap();
        let keys = Keys::open(&["three".to_owned()], Some(&path)).unwrap();
        let rights = |key: &str| {
            let set = keys.current();
            set.find(key).map(|key| (key.name.clone(), Scope::ALL.map(|scope| key.may(scope))))
        };
        let before = || {
            assert_eq!(rights("one"), Some(("ci".to_owned(), [true, true, false, false])));
            assert_eq!(rights("two"), Some(("boss".to_owned(), [true; 4])));
            assert_eq!(rights("three"), Some((String::new(), [true, true, true, false])));
            assert_eq!((rights("four"), rights("")), (None, None));
        };
        before();
        let many: String = (0..=KEYS_MAX).map(|n| line(&format!("k{n}"), &n.to_string(), "")).collect();
        let broken = [
            String::new(),
            "keys = []".to_owned(),
            "[[keys]]\nname = \"a\"".to_owned(),
            "[[keys".to_owned(),
            line("a", "x", "scopes = []"),
            line("a", "x", "scopes = [\"draw\"]"),
            line("a", "x", "scope = [\"render\"]"),
            line("", "x", ""),
            line("a b", "x", ""),
            line("a", "x", "") + &line("a", "y", ""),
            line("a", "x", "") + &line("b", "x", ""),
            line("a", "x", "").replace("sha256 = \"", "sha256 = \"0"),
            line("a", "", ""),
            many,
            "#".repeat(2 << 20),
        ];
        for text in broken {
            std::fs::write(&path, &text).unwrap();
            let error = keys.reload().unwrap_err().to_string();
            assert!(error.contains("keys.toml") && !error.contains('\n'), "{error}");
            before();
        }
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(keys.reload(), Err(KeysError::Io { .. })));
        before();
        std::fs::write(&path, line("ci", "four", "scopes = [\"metrics\"]")).unwrap();
        assert_eq!(keys.reload().unwrap(), Some(1));
        assert_eq!((rights("one"), rights("two")), (None, None));
        assert_eq!(rights("four"), Some(("ci".to_owned(), [false, false, true, false])));
        assert!(Keys::open(&[], None).unwrap().current().is_empty());
    }

    #[test]
    fn an_owner_sees_its_own_and_an_admin_all() {
        let [one, two] = ["one", "two"].map(Owner::new);
        let access = |scopes: &[Scope]| Key::named("one", Digest::of(b""), scopes.to_vec()).access();
        let owner = access(&[Scope::Render]).owner;
        assert!(access(&[Scope::Render]).sees(&owner) && !access(&[Scope::Render, Scope::Metrics]).sees(&two));
        assert!(access(&[Scope::Admin]).sees(&two) && Access::open(one).sees(&two));
        assert!(!Access::default().sees(&two));
    }

    #[test]
    fn the_name_of_an_owner_signs_nothing() {
        let (digest, key) = Key::unnamed("secret");
        assert_eq!(key.signs_with, digest.to_string());
        assert!(!key.owner.to_string().contains(&key.signs_with));
        assert_ne!(key.owner, Key::unnamed("other").1.owner);
    }
}
