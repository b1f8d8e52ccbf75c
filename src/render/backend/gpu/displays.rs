//! A switch that turns off Mesa's Vulkan layer that orders GPUs, if all that the layer could do is
//! print an error. The layer asks the Wayland display which GPU the display uses. In containers and
//! services the variable `XDG_RUNTIME_DIR`, by which a display is found, is often not set, and the
//! layer prints that to standard error. Pictures need no display: they are never drawn into a
//! window. In a process that has several threads already, the switch does nothing.

#![allow(unsafe_code)]

use std::ffi::OsStr;
use std::path::Path;

/// Variables by which people choose a GPU with Mesa's layer, or turn it off themselves.
const OF_THE_LAYER: [&str; 2] = ["MESA_VK_DEVICE_SELECT", "NODEVICE_SELECT"];

/// Turns Mesa's layer that orders GPUs off where it could only complain. It asks the Wayland display which GPU it
/// uses, and where `XDG_RUNTIME_DIR` is not set, as in containers and services, it prints that to standard error.
///
/// Does nothing unless this is the only thread of the process.
pub fn ignore_displays() {
    let value = std::env::var_os("XDG_RUNTIME_DIR");
    let can_be_asked = value.as_deref().is_some_and(|folder| Path::new(folder).is_absolute());
    if can_be_asked || OF_THE_LAYER.iter().any(|name| std::env::var_os(name).is_some()) || !is_only_thread() {
        return;
    }
    // SAFETY: no other thread reads the environment meanwhile, because there is none: only a thread starts threads, and
    // this one is here.
    unsafe { std::env::set_var("NODEVICE_SELECT", OsStr::new("1")) };
}

/// True if this thread is known to be the process's only one.
fn is_only_thread() -> bool {
    std::fs::read_dir("/proc/self/task").is_ok_and(|tasks| tasks.count() == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests run on threads beside the one that waits for them.
    #[test]
    fn a_process_with_threads_keeps_its_environment() {
        assert!(!is_only_thread());
        let before = std::env::var_os("NODEVICE_SELECT");
        ignore_displays();
        assert_eq!(std::env::var_os("NODEVICE_SELECT"), before);
    }
}
