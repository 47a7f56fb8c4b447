//! The program that started this one, and what to do when it is gone.

use std::io::Read;

/// Does something when the other end of standard input closes, as it does when the program that holds it
/// ends, however it ends.
///
/// # Errors
/// If the thread that waits cannot be started.
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
