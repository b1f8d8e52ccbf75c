//! The rights that a process of the sandbox gives up before it reads a file: opening files, the network, other
//! processes, new rights, and most system calls. From then on the Linux kernel refuses them, or ends the process that
//! tries, by resource limits, Landlock and seccomp, as far as it has these. The memory and the processor time of the
//! process are bounded, too.

use std::io;

use landlock::{
    ABI, Access as _, AccessFs, AccessNet, CompatLevel, Compatible as _, Ruleset, RulesetAttr as _, RulesetStatus,
    Scope,
};
use rustix::process::{DumpableBehavior, Resource, Rlimit, set_dumpable_behavior, setrlimit};
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter, SeccompRule, TargetArch,
};

/// The layers of a sandbox that the kernel has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layers {
    /// Files and connections are refused by Landlock.
    pub has_landlock: bool,
    /// Other system calls than those for memory and for the answer end the process.
    pub has_seccomp: bool,
}

/// The newest rules that are asked for; older kernels keep those that they know.
const RULES: ABI = ABI::V6;

/// Seconds of processor time for one file, and bytes of it that get one more: many times what honest files take.
const CPU_S: u64 = 10;
const BYTES_PER_CPU_S: u64 = 4 << 20;
/// Memory beside that of the job: the decoder's stack, what the allocator keeps, and the answer's first pages.
const SLACK_BYTES: u64 = 256 << 20;

/// Gives up everything that can be given up before a file is known.
pub fn confine() -> io::Result<Layers> {
    for resource in [Resource::Core, Resource::Fsize, Resource::Nproc] {
        set(resource, 0)?;
    }
    set_dumpable_behavior(DumpableBehavior::NotDumpable)?;
    rustix::thread::set_no_new_privs(true)?;
    Ok(Layers { has_landlock: landlock()?, has_seccomp: seccomp()? })
}

/// Bounds time and memory for a file of this length. `memory_bytes` are on top of what the process has now.
pub fn bound(file_bytes: u64, mapped_bytes: u64, memory_bytes: u64) -> io::Result<()> {
    let cpu_s = CPU_S + file_bytes / BYTES_PER_CPU_S;
    // The first is a signal that says what happened, the second ends a process that does not listen.
    setrlimit(Resource::Cpu, Rlimit { current: Some(cpu_s), maximum: Some(cpu_s + 1) })?;
    // The mesh is there twice while it is written into the answer.
    set(Resource::As, mapped_bytes.saturating_add(memory_bytes.saturating_mul(2)).saturating_add(SLACK_BYTES))
}

/// Memory that is mapped now, bytes. To be asked before the process is confined.
pub fn mapped_bytes() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let pages = pages.and_then(|text| text.split_whitespace().next()?.parse::<u64>().ok());
    pages.unwrap_or(1 << 18) * rustix::param::page_size() as u64
}

fn set(resource: Resource, most: u64) -> io::Result<()> {
    Ok(setrlimit(resource, Rlimit { current: Some(most), maximum: Some(most) })?)
}

/// Refuses every access to files, sockets and other processes. True if the kernel holds at least the rules for
/// files.
fn landlock() -> io::Result<bool> {
    let rules = Ruleset::default()
        .set_compatibility(CompatLevel::BestEffort)
        .handle_access(AccessFs::from_all(RULES))
        .and_then(|rules| rules.handle_access(AccessNet::from_all(RULES)))
        .and_then(|rules| rules.scope(Scope::from_all(RULES)))
        .and_then(Ruleset::create)
        .and_then(landlock::RulesetCreated::restrict_self);
    Ok(rules.map_err(io::Error::other)?.ruleset != RulesetStatus::NotEnforced)
}

/// The processor, if filters are known for it.
fn architecture() -> Option<TargetArch> {
    if cfg!(target_arch = "x86_64") {
        Some(TargetArch::x86_64)
    } else if cfg!(target_arch = "aarch64") {
        Some(TargetArch::aarch64)
    } else {
        None
    }
}

/// Ends the process at any system call that it does not need. True if the kernel has such filters.
fn seccomp() -> io::Result<bool> {
    // Memory, the answer on the socket that is open already, the clock, and the way to end.
    const NEEDED: &[i64] = &[
        libc::SYS_read,
        libc::SYS_write,
        libc::SYS_recvmsg,
        libc::SYS_sendmsg,
        libc::SYS_recvfrom,
        libc::SYS_sendto,
        libc::SYS_close,
        libc::SYS_lseek,
        libc::SYS_fstat,
        libc::SYS_statx,
        libc::SYS_mmap,
        libc::SYS_munmap,
        libc::SYS_mremap,
        libc::SYS_mprotect,
        libc::SYS_madvise,
        libc::SYS_brk,
        libc::SYS_futex,
        libc::SYS_prlimit64,
        libc::SYS_clock_gettime,
        libc::SYS_getrandom,
        libc::SYS_sched_yield,
        libc::SYS_gettid,
        libc::SYS_getpid,
        libc::SYS_tgkill,
        libc::SYS_sigaltstack,
        libc::SYS_rt_sigaction,
        libc::SYS_rt_sigprocmask,
        libc::SYS_rt_sigreturn,
        libc::SYS_exit,
        libc::SYS_exit_group,
    ];
    let Some(arch) = architecture() else { return Ok(false) };
    // The standard library asks in debug builds whether a file that it closes is open.
    let is_question = SeccompCondition::new(1, SeccompCmpArgLen::Dword, SeccompCmpOp::Eq, libc::F_GETFD as u64)
        .and_then(|is_question| SeccompRule::new(vec![is_question]))
        .map_err(io::Error::other)?;
    let rules = NEEDED.iter().map(|&call| (call, Vec::new())).chain([(libc::SYS_fcntl, vec![is_question])]).collect();
    let filter = SeccompFilter::new(rules, SeccompAction::KillProcess, SeccompAction::Allow, arch);
    let program: BpfProgram = filter.and_then(TryInto::try_into).map_err(io::Error::other)?;
    match seccompiler::apply_filter_all_threads(&program) {
        Ok(()) => Ok(true),
        // A kernel without filters says so.
        Err(seccompiler::Error::Prctl(error) | seccompiler::Error::Seccomp(error))
            if error.raw_os_error() == Some(libc::EINVAL) || error.raw_os_error() == Some(libc::ENOSYS) =>
        {
            Ok(false)
        }
        Err(error) => Err(io::Error::other(error)),
    }
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;
    use std::net::{TcpListener, TcpStream};

    /// Landlock holds for the thread that asks for it, so that this test can. What seccomp refuses ends the process:
    /// `tests/suite/hostile/sandbox.rs` shows it.
    #[test]
    fn landlock_refuses_files_and_connections() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let (old, new) = (folder.path().join("old"), folder.path().join("new"));
        std::fs::write(&old, "x").unwrap();
        let confined = std::thread::spawn(move || {
            let has_landlock = super::landlock().unwrap();
            let read = std::fs::read(&old).map_err(|error| error.kind());
            let written = std::fs::write(&new, "x").map_err(|error| error.kind());
            let connected = TcpStream::connect(address).map(drop).map_err(|error| error.kind());
            (has_landlock, read.map(drop), written, connected)
        });
        let (has_landlock, read, written, connected) = confined.join().unwrap();
        let denied = Err(ErrorKind::PermissionDenied);
        let expected = if has_landlock { [denied; 2] } else { [Ok(()); 2] };
        assert_eq!([read, written], expected, "Landlock: {has_landlock}");
        // Kernels before 6.7 have no rules for connections.
        assert!(connected == denied || connected == Ok(()), "{connected:?}");
        println!("Landlock: {has_landlock}, connections refused: {}", connected == denied);
    }
}
