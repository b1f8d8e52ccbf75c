//! The choice of the process in which decoders written in C or C++ (for FBX and meshoptimizer) read a mesh file. On
//! Linux they run in sandboxed processes of their own, so that a broken or hostile file does not harm this one. On
//! other systems they run in this process.

#[cfg(all(target_os = "linux", any(feature = "fbx", feature = "meshopt")))]
mod here {
    use std::ffi::OsString;
    use std::process::ExitCode;

    use crate::sandbox::{self, Pool};
    use meshsnap_render::import::{answer_in_isolation, isolate};

    /// Most processes that wait. One takes a few milliseconds to start.
    const WAITING_MAX: u64 = 4;

    /// Runs this process as one that decodes a file, if it was started for that.
    pub fn run_if_asked(words: &[OsString]) -> Option<ExitCode> {
        let is_asked = words.get(1).is_some_and(|word| word == sandbox::ARGUMENT) && words.len() == 2;
        is_asked.then(|| sandbox::run(answer_in_isolation))
    }

    /// A process is started when a file needs it.
    pub fn on_demand() {
        isolate::isolate_in(Box::new(Pool::cold()));
    }

    /// Processes are ready ahead. Says what the kernel cannot refuse them.
    pub fn ahead(workers: u64) {
        match Pool::warm(workers.min(WAITING_MAX) as usize) {
            Ok((pool, layers)) => {
                if !layers.has_landlock {
                    tracing::warn!("this kernel has no Landlock: decoders in C are kept from files by seccomp alone");
                }
                if !layers.has_seccomp {
                    tracing::warn!("this kernel has no seccomp filters: decoders in C may make any system call");
                }
                isolate::isolate_in(Box::new(pool));
            }
            Err(error) => {
                // Their files are refused rather than read here.
                tracing::error!(%error, "decoders in C cannot be given a process of their own");
                on_demand();
            }
        }
    }
}

#[cfg(not(all(target_os = "linux", any(feature = "fbx", feature = "meshopt"))))]
mod here {
    use std::ffi::OsString;
    use std::process::ExitCode;

    /// No run of this program is for a single file.
    pub fn run_if_asked(_: &[OsString]) -> Option<ExitCode> {
        None
    }

    /// Importers in C, if there are any, run in this process.
    pub fn on_demand() {}

    /// Says that importers in C, if there are any, run in this process.
    pub fn ahead(_: u64) {
        if cfg!(any(feature = "fbx", feature = "meshopt")) {
            tracing::warn!("this system has no sandbox that is known here: decoders in C run in this process");
        }
    }
}

pub use here::{ahead, on_demand, run_if_asked};
