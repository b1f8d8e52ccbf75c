//! The file of named keys, in TOML: a table `[[keys]]` for each, with its name, the SHA-256 of the key, and its
//! scopes (`render` and `store` where none are given).

use std::collections::HashSet;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use serde::Deserialize;

use super::{Key, KeysError, Scope};
use crate::digest::Digest;

/// Most keys in a file: a signed address is compared with each.
pub const KEYS_MAX: usize = 1000;

/// Largest file, bytes.
const FILE_BYTES_MAX: u64 = 1 << 20;

/// Longest name of a key.
const NAME_CHARS_MAX: usize = 64;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileOfKeys {
    #[serde(default)]
    keys: Vec<KeyOfFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyOfFile {
    name: String,
    sha256: String,
    scopes: Option<Vec<String>>,
}

/// Reads a file. At least one key is in it, and no two have one name or one digest.
pub fn read(path: &Path) -> Result<Vec<(Digest, Key)>, KeysError> {
    let io = |error| KeysError::Io { path: path.to_owned(), error };
    let mut text = String::new();
    File::open(path).map_err(io)?.take(FILE_BYTES_MAX + 1).read_to_string(&mut text).map_err(io)?;
    parse(&text).map_err(|detail| KeysError::Content { path: path.to_owned(), detail })
}

fn parse(text: &str) -> Result<Vec<(Digest, Key)>, String> {
    if text.len() as u64 > FILE_BYTES_MAX {
        return Err(format!("it has more than {FILE_BYTES_MAX} bytes"));
    }
    // The text of the file stays out of messages: they may go to a log that others read.
    let file: FileOfKeys = toml::from_str(text).map_err(|error| {
        let line =
            error.span().map_or(1, |span| text.bytes().take(span.start).filter(|&byte| byte == b'\n').count() + 1);
        format!("line {line}: {}", error.message().replace('\n', " "))
    })?;
    if file.keys.is_empty() {
        // A slip must not open the server to everybody.
        return Err("it has no key; each is a table [[keys]] with `name` and `sha256`".to_owned());
    }
    if file.keys.len() > KEYS_MAX {
        return Err(format!("it has {} keys, and at most {KEYS_MAX} are read", file.keys.len()));
    }
    let (mut names, mut digests) = (HashSet::new(), HashSet::new());
    let mut keys = Vec::with_capacity(file.keys.len());
    for (index, key) in file.keys.iter().enumerate() {
        let (digest, key) = check(key).map_err(|detail| format!("key {}: {detail}", index + 1))?;
        if !names.insert(key.name.clone()) {
            return Err(format!("two keys are named \"{}\"", key.name));
        }
        if !digests.insert(digest) {
            return Err(format!("the key of \"{}\" has another name, too", key.name));
        }
        keys.push((digest, key));
    }
    Ok(keys)
}

fn check(key: &KeyOfFile) -> Result<(Digest, Key), String> {
    let is_name = |name: &str| {
        (1..=NAME_CHARS_MAX).contains(&name.len())
            && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte))
    };
    if !is_name(&key.name) {
        return Err(format!("`name` must be 1 to {NAME_CHARS_MAX} letters, digits, `.`, `_` or `-`"));
    }
    let digest = Digest::parse(&key.sha256).ok_or_else(|| {
        format!("`sha256` of \"{}\" must be 64 lower-case hexadecimal digits: printf %s KEY | sha256sum", key.name)
    })?;
    if digest == Digest::of(b"") {
        return Err(format!("`sha256` of \"{}\" is that of an empty text", key.name));
    }
    let scopes = match &key.scopes {
        None => vec![Scope::Render, Scope::Store],
        Some(words) => words.iter().map(|word| scope(&key.name, word)).collect::<Result<_, _>>()?,
    };
    if scopes.is_empty() {
        return Err(format!("`scopes` of \"{}\" is empty; leave the key out instead", key.name));
    }
    Ok((digest, Key::named(&key.name, digest, scopes)))
}

fn scope(name: &str, word: &str) -> Result<Scope, String> {
    Scope::ALL.into_iter().find(|scope| scope.name() == word).ok_or_else(|| {
        let known = Scope::ALL.map(Scope::name).join(", ");
        let word: String = word.chars().take(40).collect();
        format!("\"{name}\" has the scope {word:?}, and allowed are {known}")
    })
}
