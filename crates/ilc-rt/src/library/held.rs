//! A library as an object of long life holds it: others may write to its file meanwhile.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use super::error::LibraryError;
use super::file::IN_MEMORY;
use super::store::Library;

/// A library in memory, or a file that is opened for each operation.
#[derive(Debug)]
pub enum Held {
    /// In memory, as long as this value.
    Memory(Box<Mutex<Library>>),
    /// In a file.
    File(PathBuf),
}

impl Held {
    /// Holds the library of a path, `:memory:` for one in memory. A new file is created at once, so that an
    /// unusable name is refused here.
    ///
    /// # Errors
    /// Those of [`Library::read`] and [`Library::open`], except for a missing or empty file.
    pub fn new(path: PathBuf) -> Result<Self, LibraryError> {
        if path.as_os_str() == IN_MEMORY {
            return Ok(Self::Memory(Box::new(Mutex::new(Library::in_memory()?))));
        }
        match Library::read(&path) {
            Ok(_) => {}
            Err(LibraryError::Missing { .. } | LibraryError::Empty { .. }) => {
                Library::open(&path)?;
            }
            Err(refused) => return Err(refused),
        }
        Ok(Self::File(path))
    }

    /// Reads from the library, as [`Library::read_with`] does.
    ///
    /// # Errors
    /// Those of [`Library::read`] and of the work.
    pub fn read<T>(
        &self,
        mut work: impl FnMut(&Library) -> Result<T, LibraryError>,
    ) -> Result<T, LibraryError> {
        match self {
            Self::Memory(library) => work(&library.lock().unwrap_or_else(PoisonError::into_inner)),
            Self::File(path) => Library::read_with(path, work),
        }
    }

    /// Writes to the library.
    ///
    /// # Errors
    /// Those of [`Library::open`] and of the work.
    pub fn write<T>(
        &self,
        work: impl FnOnce(&Library) -> Result<T, LibraryError>,
    ) -> Result<T, LibraryError> {
        match self {
            Self::Memory(library) => work(&library.lock().unwrap_or_else(PoisonError::into_inner)),
            Self::File(path) => work(&Library::open(path)?),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{meta, record};
    use super::*;

    #[test]
    fn a_new_file_is_created_and_opened_for_each_operation() {
        let path = std::env::temp_dir().join(format!("ilc-held-{}.db", std::process::id()));
        let held = Held::new(path.clone()).unwrap();
        assert!(path.exists());
        for held in [held, Held::new(IN_MEMORY.into()).unwrap()] {
            held.write(|library| library.append(&meta("a"), &record(0))).unwrap();
            assert_eq!(held.read(|library| library.count(None)).unwrap(), 1);
        }
        assert_eq!(
            Held::new(path.clone()).unwrap().read(|library| library.count(None)).unwrap(),
            1
        );
        std::fs::remove_file(&path).unwrap();
        let refused = Held::new(std::env::temp_dir()).unwrap_err();
        assert!(!matches!(refused, LibraryError::Missing { .. }), "{refused}");
    }
}
