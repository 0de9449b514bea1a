//! Memory that is given back once it is freed.
//!
//! The GNU C library keeps what a program frees, ever more of it the larger the pieces are that come and go ("Malloc Tunable
//! Parameters", The GNU C Library Reference Manual): a third of the peak of a bake. Fixed limits are read from the
//! environment when a process starts, so that the program starts itself anew with them, as the same process.

/// Pieces of 1 MiB or more are given back at once; of smaller ones, 16 MiB may be kept. Tighter limits save 8 MB of 110 for 5 %
/// more time: what is given back must be cleared again by the system.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LIMITS: [(&str, &str); 3] =
    [("MALLOC_MMAP_THRESHOLD_", "1048576"), ("MALLOC_TRIM_THRESHOLD_", "16777216"), ("MALLOC_TOP_PAD_", "4194304")];

/// Starts the program anew with limits on what is kept, unless it was started with some. Where that fails it goes on,
/// taking more memory.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(super) fn limit() {
    use std::os::unix::process::CommandExt;

    let is_limited = LIMITS.iter().any(|(name, _)| std::env::var_os(name).is_some());
    let mut arguments = std::env::args_os();
    if let (false, Ok(program), Some(name)) = (is_limited, std::env::current_exe(), arguments.next()) {
        let _ = std::process::Command::new(program).arg0(name).args(arguments).envs(LIMITS).exec();
    }
}

/// Other libraries give memory back as they are.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn limit() {}
