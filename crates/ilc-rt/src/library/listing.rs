//! Listing runs: all of them, or a part.

use rusqlite::params;

use super::error::LibraryError;
use super::row::{Row, as_integer, is_old, read_row};
use super::store::Library;

/// A part of the runs of a library, oldest first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Page {
    /// Only runs of this cell.
    pub cell: Option<String>,
    /// Only runs of campaigns whose names begin like this.
    pub campaign: Option<String>,
    /// Number of runs to leave out before.
    pub offset: usize,
    /// Largest number of runs.
    pub limit: Option<usize>,
}

impl Library {
    /// Lists the stored runs, oldest first, without their arrays; optionally those of one campaign.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn list(&self, campaign: Option<&str>) -> Result<Vec<Row>, LibraryError> {
        let condition = "WHERE ?1 IS NULL OR iteration.campaign = ?1 ORDER BY iteration.id";
        self.listed(condition, params![campaign])
    }

    /// Lists a part of the stored runs, oldest first, without their arrays; reads only this part.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn page(&self, page: &Page) -> Result<Vec<Row>, LibraryError> {
        // The keys are chosen first: in an older file the arrays are between these columns and the
        // figures.
        let condition = "WHERE iteration.id IN (SELECT id FROM iteration \
            WHERE (?1 IS NULL OR cell = ?1) \
            AND (?2 IS NULL OR substr(campaign, 1, length(?2)) = ?2) \
            ORDER BY id LIMIT ?3 OFFSET ?4) ORDER BY iteration.id";
        let limit = page.limit.map_or(-1, as_integer);
        let offset = as_integer(page.offset);
        self.listed(condition, params![page.cell, page.campaign, limit, offset])
    }

    /// Returns the number of stored runs, of one cell or of all.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn count(&self, cell: Option<&str>) -> Result<usize, LibraryError> {
        let all = "SELECT count(*) FROM iteration";
        let count = match cell {
            // Counted in the smallest index.
            None => self.connection.query_row(all, [], |row| row.get::<_, i64>(0)),
            Some(cell) => {
                self.connection
                    .query_row(&format!("{all} WHERE cell = ?1"), [cell], |row| row.get(0))
            }
        };
        count.map(|n| usize::try_from(n).unwrap_or(0)).map_err(|source| self.fail(source))
    }

    fn listed(
        &self,
        condition: &str,
        values: impl rusqlite::Params,
    ) -> Result<Vec<Row>, LibraryError> {
        let mut statement = self.select(false, condition)?;
        let rows = statement.query_map(values, |row| read_row(row, false));
        let mut rows: Vec<Row> =
            rows.and_then(Iterator::collect).map_err(|source| self.fail(source))?;
        for row in rows.iter_mut().filter(|row| is_old(row)) {
            row.record.figures = self.figures(row.id)?.record.figures;
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{meta, record};
    use super::*;

    #[test]
    fn a_page_is_a_part_of_the_list() {
        let library = Library::in_memory().unwrap();
        for (campaign, index) in [("a-1", 0), ("b", 0), ("a-1", 1), ("a-2", 0)] {
            library.append(&meta(campaign), &record(index)).unwrap();
        }
        let ids = |page: Page| -> Vec<i64> {
            library.page(&page).unwrap().iter().map(|row| row.id).collect()
        };
        assert_eq!(ids(Page::default()), [1, 2, 3, 4]);
        assert_eq!(ids(Page { offset: 1, limit: Some(2), ..Page::default() }), [2, 3]);
        let of_a = Page { campaign: Some("a-".into()), ..Page::default() };
        assert_eq!(ids(of_a.clone()), [1, 3, 4]);
        assert_eq!(ids(Page { offset: 2, ..of_a }), [4]);
        assert!(ids(Page { cell: Some("other".into()), ..Page::default() }).is_empty());
        assert!(ids(Page { limit: Some(0), ..Page::default() }).is_empty());
        assert_eq!(library.page(&Page::default()).unwrap(), library.list(None).unwrap());
        assert_eq!(library.count(None).unwrap(), 4);
        assert_eq!(library.count(Some("gantry")).unwrap(), 4);
        assert_eq!(library.count(Some("other")).unwrap(), 0);
    }
}
