//! Reads and writes files; the name `-` means a standard stream.

use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal as _, Read, Write as _};

use crate::cli::error::CliError;

/// Reads a whole file, or standard input for `-`, of at most `bytes_max`.
pub fn read(name: &str, bytes_max: u64) -> Result<Vec<u8>, CliError> {
    let failed = |error: io::Error| CliError::input(format!("{name}: cannot be read: {error}"));
    let mut bytes = Vec::new();
    let limited =
        |reader: &mut dyn Read, bytes: &mut Vec<u8>| reader.take(bytes_max.saturating_add(1)).read_to_end(bytes);
    if name == "-" {
        limited(&mut io::stdin().lock(), &mut bytes).map_err(failed)?;
    } else {
        let mut file = File::open(name).map_err(failed)?;
        // One read into a buffer of the right size. The length is a hint: files may grow, and some
        // have none.
        let length = file.metadata().map_or(0, |metadata| metadata.len()).min(bytes_max);
        bytes
            .try_reserve_exact(usize::try_from(length).unwrap_or(0).saturating_add(1))
            .map_err(|_| CliError::input(format!("{name}: there is no memory for its {length} bytes")))?;
        limited(&mut file, &mut bytes).map_err(failed)?;
    }
    if bytes.len() as u64 > bytes_max {
        let sentence = format!("{name}: is larger than {bytes_max} bytes (raise it with --limit-memory-bytes)");
        return Err(CliError::input(sentence));
    }
    Ok(bytes)
}

/// Writes a whole file, or standard output for `-`.
pub fn write(name: &str, bytes: &[u8]) -> Result<(), CliError> {
    if name == "-" && io::stdout().is_terminal() {
        return Err(CliError::usage("standard output is a terminal, which shows no pictures; give -o FILE, or a pipe"));
    }
    if name == "-" {
        return print(bytes);
    }
    std::fs::write(name, bytes).map_err(|error| {
        let sentence = format!("{name}: cannot be written: {error}");
        match error.kind() {
            ErrorKind::NotFound | ErrorKind::PermissionDenied | ErrorKind::IsADirectory => CliError::usage(sentence),
            _ => CliError::ours(sentence),
        }
    })
}

/// Writes to standard output. A reader that stops early, such as `head`, is not an error.
pub fn print(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(CliError::ours(format!("standard output cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}
