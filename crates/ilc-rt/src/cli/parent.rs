//! The parent program, and the reaction to its end.

use std::io::Read;

/// Calls a function when the other end of standard input closes, which happens whenever the program
/// that holds it ends.
///
/// # Errors
/// If the waiting thread cannot be started.
pub fn when_parent_ends(act: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
    let wait = move || {
        let mut said = [0; 64];
        let mut pipe = std::io::stdin().lock();
        loop {
            match pipe.read(&mut said) {
                Ok(0) => break,
                Err(error) if error.kind() != std::io::ErrorKind::Interrupted => break,
                Ok(_) | Err(_) => {}
            }
        }
        act();
    };
    std::thread::Builder::new().name("parent".to_owned()).spawn(wait).map(drop)
}
