//! A library as an object of long life holds it: others may write to its file meanwhile.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use super::error::LibraryError;
use super::file::IN_MEMORY;
use super::store::Library;

/// A library in memory, or a file that is opened for each operation; for reading, only after another program has
/// written to it.
#[derive(Debug)]
pub enum Held {
    /// In memory, as long as this value.
    Memory(Box<Mutex<Library>>),
    /// In a file.
    File(PathBuf, Opened),
}

/// The connection that was read from last, while the file rests.
#[derive(Debug, Default)]
pub struct Opened(Mutex<Option<Box<Library>>>);

impl Opened {
    /// Takes it away: another thread opens the file for itself meanwhile.
    fn take(&self) -> Option<Box<Library>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn keep(&self, library: Option<Box<Library>>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = library;
    }
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
        Ok(Self::File(path, Opened::default()))
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
            Self::File(path, opened) => {
                if let Some(library) = opened.take().filter(|library| library.rests()) {
                    let answer = work(&library);
                    if library.rests() {
                        opened.keep(Some(library));
                        return answer;
                    }
                }
                let (answer, library) = Library::read_and_keep(path, work)?;
                opened.keep(library.map(Box::new));
                Ok(answer)
            }
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
            Self::File(path, opened) => {
                opened.take();
                work(&Library::open(path)?)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::path::Path;
    use std::time::{Duration, SystemTime};

    use super::super::tests::{Folder, meta, record};
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

    #[test]
    fn a_file_stays_open_for_reading_until_somebody_changes_it() {
        let folder = Folder::new("stays-open");
        let (path, other) = (folder.0.join("a.db"), folder.0.join("b.db"));
        let rest = |path: &Path| {
            let long_ago = SystemTime::now() - Duration::from_secs(60);
            File::options().write(true).open(path).unwrap().set_modified(long_ago).unwrap();
        };
        let append = |path: &Path, index| {
            Library::open(path).unwrap().append(&meta("a"), &record(index)).unwrap();
        };
        let held = Held::new(path.clone()).unwrap();
        let Held::File(_, opened) = &held else { panic!("a file") };
        let count = || held.read(|library| library.count(None));
        let is_open = || opened.0.lock().unwrap().is_some();
        append(&path, 0);
        assert_eq!((count().unwrap(), is_open()), (1, false), "written to a moment ago");
        rest(&path);
        for _ in 0..3 {
            assert_eq!((count().unwrap(), is_open()), (1, true));
        }
        append(&path, 1);
        assert_eq!((count().unwrap(), is_open()), (2, false));
        rest(&path);
        assert_eq!((count().unwrap(), is_open()), (2, true));
        let writer = Library::open(&path).unwrap();
        writer.append(&meta("a"), &record(2)).unwrap();
        assert_eq!((count().unwrap(), is_open()), (3, false), "in the log");
        drop(writer);
        rest(&path);
        assert_eq!((count().unwrap(), is_open()), (3, true));
        append(&other, 0);
        rest(&other);
        std::fs::rename(&other, &path).unwrap();
        assert_eq!((count().unwrap(), is_open()), (1, true), "another file of this name");
        // Work that reads the same library once more, as a law may.
        let both = held.read(|library| Ok((library.count(None)?, count()?)));
        assert_eq!((both.unwrap(), is_open()), ((1, 1), true));
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(count(), Err(LibraryError::Missing { .. })));
    }
}
