//! Processors that threads of this program may run on.
//!
//! Used where the loop's thread is set up (`thread`); imports nothing.

use std::io;

/// Binds the calling thread to one processor, and keeps every other thread of the program off it; threads
/// born later inherit that.
///
/// # Errors
/// That of the system, e.g. if there is no such processor.
pub fn claim(cpu: usize) -> io::Result<()> {
    let own = thread_id();
    set(0, &only(cpu)?)?;
    for thread in others(own)? {
        // One that has ended meanwhile, or may run nowhere else, stays as it is.
        if let Ok(mut allowed) = get(thread) {
            remove(&mut allowed, cpu);
            let _ = set(thread, &allowed);
        }
    }
    Ok(())
}

/// Returns the number of processors that the calling thread may run on.
///
/// # Errors
/// That of the system.
pub fn n_allowed() -> io::Result<usize> {
    let allowed = get(0)?;
    #[expect(unsafe_code, reason = "CPU_ISSET has no safe wrapper")]
    // SAFETY: every index is below the size of the set.
    let is_set = |cpu: usize| unsafe { libc::CPU_ISSET(cpu, &allowed) };
    Ok((0..N_MAX).filter(|cpu| is_set(*cpu)).count())
}

/// Processors that a set can hold.
const N_MAX: usize = 8 * size_of::<libc::cpu_set_t>();

fn only(cpu: usize) -> io::Result<libc::cpu_set_t> {
    if cpu >= N_MAX {
        return Err(io::Error::from_raw_os_error(libc::EINVAL));
    }
    #[expect(unsafe_code, reason = "sets of processors have no safe wrapper")]
    // SAFETY: zeros are an empty set, and the index is below its size.
    let set = unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(cpu, &mut set);
        set
    };
    Ok(set)
}

fn remove(set: &mut libc::cpu_set_t, cpu: usize) {
    #[expect(unsafe_code, reason = "sets of processors have no safe wrapper")]
    // SAFETY: the index is below the size of the set, as `only` has checked.
    unsafe {
        libc::CPU_CLR(cpu, set);
    }
}

#[expect(unsafe_code, reason = "gettid has no safe wrapper in the standard library")]
fn thread_id() -> libc::pid_t {
    // SAFETY: always succeeds.
    unsafe { libc::gettid() }
}

fn others(own: libc::pid_t) -> io::Result<Vec<libc::pid_t>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/proc/self/task")? {
        let name = entry?.file_name();
        if let Some(thread) = name.to_str().and_then(|name| name.parse().ok())
            && thread != own
        {
            found.push(thread);
        }
    }
    Ok(found)
}

#[expect(unsafe_code, reason = "sched_getaffinity has no safe wrapper")]
fn get(thread: libc::pid_t) -> io::Result<libc::cpu_set_t> {
    // SAFETY: zeros are an empty set.
    let mut set: libc::cpu_set_t = unsafe { std::mem::zeroed() };
    // SAFETY: `set` is a valid, exclusively borrowed set of the size given.
    let done = unsafe { libc::sched_getaffinity(thread, size_of_val(&set), &raw mut set) };
    if done == 0 { Ok(set) } else { Err(io::Error::last_os_error()) }
}

#[expect(unsafe_code, reason = "sched_setaffinity has no safe wrapper")]
fn set(thread: libc::pid_t, set: &libc::cpu_set_t) -> io::Result<()> {
    // SAFETY: `set` is a valid set of the size given.
    let done = unsafe { libc::sched_setaffinity(thread, size_of_val(set), set) };
    if done == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_processor_that_is_not_there_is_refused() {
        assert!(claim(N_MAX).is_err());
        assert!(claim(N_MAX - 1).is_err());
    }

    #[test]
    fn the_thread_runs_on_its_processor_alone() {
        // In a thread of its own; the others of the test may lose the first processor, not all.
        let allowed = std::thread::spawn(|| claim(0).and_then(|()| n_allowed())).join().unwrap();
        if let Ok(n) = allowed {
            assert_eq!(n, 1);
        }
        assert!(n_allowed().unwrap() >= 1);
    }
}
