//! Disturbances by distance: an R*Tree of SQLite, searched from its root, the nearest box first.
//!
//! A box has a cell's key and the first four numbers of a disturbance, with a margin, as float32. So
//! it bounds the distance from below, whatever the rounding, and the numbers themselves decide. The
//! search reads only those nodes that may hold one of the nearest: `O(log n_places + n_found)`.
//!
//! Source: G. R. Hjaltason, H. Samet, "Distance browsing in spatial databases", ACM Transactions on
//! Database Systems 24(2), 1999; the nodes are those of SQLite's documentation of its R*Tree module.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashSet};

use rusqlite::{Connection, OptionalExtension, params};

use super::row::{as_integer, numbers};
use super::schema;

/// Numbers of a disturbance in a box; further ones are only compared afterwards.
const NUMBERS: usize = 4;
/// Limits of a box, each with both ends: those of the cell and of the numbers.
const LIMITS: usize = 2 * (1 + NUMBERS);
/// Margin of a box in units of its number, larger than the rounding of float32; and the least one, as
/// boxes without an extent are not told apart by the tree.
const MARGIN: f64 = 1e-6;
const LEAST_MARGIN: f64 = 1e-30;
/// Largest number of a box.
const FAR: f64 = 3e38;
/// Bytes of a node before its entries, and of an entry.
const HEAD: usize = 4;
const ENTRY: usize = 8 + 4 * LIMITS;

/// Adds the box of a place.
pub(super) fn insert(
    connection: &Connection,
    id: i64,
    cell: i64,
    disturbance: &[f64],
) -> rusqlite::Result<()> {
    let mut limits = [0.0; LIMITS];
    let numbers = std::iter::once(cell as f64).chain(disturbance.iter().copied());
    for (ends, number) in limits.chunks_exact_mut(2).zip(numbers.chain([0.0; NUMBERS])) {
        let number = number.clamp(-FAR, FAR);
        let margin = (MARGIN * number.abs()).max(LEAST_MARGIN);
        (ends[0], ends[1]) = (number - margin, number + margin);
    }
    let [c0, c1, a0, a1, b0, b1, d0, d1, e0, e1] = limits;
    connection
        .prepare_cached("INSERT INTO near VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)")?
        .execute(params![id, c0, c1, a0, a1, b0, b1, d0, d1, e0, e1])
        .map(drop)
}

/// Deletes the boxes of places that are no more.
pub(super) fn delete(connection: &Connection, gone: &[i64]) -> rusqlite::Result<()> {
    let most = "SELECT count(*) < ?1 FROM (SELECT 1 FROM place LIMIT ?1)";
    if connection.query_row(most, [as_integer(gone.len())], |row| row.get(0))? {
        return build(connection);
    }
    let mut delete = connection.prepare_cached("DELETE FROM near WHERE id = ?1")?;
    gone.iter().try_for_each(|id| delete.execute([id]).map(drop))
}

/// Creates the tree from the places that are left: deleting a box takes longer than inserting one.
pub(super) fn build(connection: &Connection) -> rusqlite::Result<()> {
    connection.execute_batch("DROP TABLE near")?;
    schema::create(connection)?;
    let mut places = connection.prepare("SELECT id FROM place")?;
    let ids: Vec<i64> = places.query_map([], |row| row.get(0))?.collect::<rusqlite::Result<_>>()?;
    for id in ids {
        let (cell, disturbance) = of_place(connection, id)?;
        insert(connection, id, cell, &disturbance)?;
    }
    Ok(())
}

/// Reads cell and disturbance of a place.
fn of_place(connection: &Connection, id: i64) -> rusqlite::Result<(i64, Vec<f64>)> {
    connection
        .prepare_cached("SELECT cell, disturbance FROM place WHERE id = ?1")?
        .query_row([id], |row| {
            Ok((row.get(0)?, numbers(row.get::<_, Option<String>>(1)?.as_deref())))
        })
}

/// Returns the Euclidean distance, always computed in this order, so that equal ones compare equal.
pub(super) fn distance(here: &[f64], there: &[f64]) -> f64 {
    here.iter().zip(there).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// An entry of the search.
#[derive(Debug)]
struct Entry {
    /// Distance, or a bound from below.
    distance: f64,
    what: What,
}

/// Meaning of an entry; of equally near ones, those that may hold others come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum What {
    /// A node, and its height above the leaves.
    Node(i64, u16),
    /// The box of a place.
    Box(i64),
    /// A place whose distance is known.
    Place(i64),
}

impl Ord for Entry {
    /// The nearest entry is the greatest one.
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance.total_cmp(&self.distance).then_with(|| other.what.cmp(&self.what))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

/// Places around a disturbance, one after the other.
#[derive(Debug)]
pub(super) struct Search<'a> {
    connection: &'a Connection,
    here: &'a [f64],
    cell: Option<i64>,
    waiting: BinaryHeap<Entry>,
    /// Nodes that were read: those of a damaged tree may be in a circle.
    seen: HashSet<i64>,
}

impl<'a> Search<'a> {
    /// Begins at the root; with a cell, only its places are found.
    pub(super) fn new(connection: &'a Connection, here: &'a [f64], cell: Option<i64>) -> Self {
        let mut search =
            Self { connection, here, cell, waiting: BinaryHeap::new(), seen: HashSet::new() };
        // The height of the tree is in its root, which is read as if it were the highest node.
        search.waiting.push(Entry { distance: 0.0, what: What::Node(1, u16::MAX) });
        search
    }

    /// Returns distance and key of the next place with as many numbers as `here`; equally near
    /// ones in the order of their keys.
    pub(super) fn next(&mut self) -> rusqlite::Result<Option<(f64, i64)>> {
        while let Some(Entry { distance: near, what }) = self.waiting.pop() {
            match what {
                What::Place(id) => return Ok(Some((near, id))),
                What::Box(id) => {
                    let (cell, there) = of_place(self.connection, id)?;
                    // The cells of a box are rounded.
                    let is_wanted = self.cell.is_none_or(|wanted| wanted == cell);
                    if is_wanted && there.len() == self.here.len() {
                        let distance = distance(self.here, &there);
                        self.waiting.push(Entry { distance, what: What::Place(id) });
                    }
                }
                What::Node(number, height) => {
                    if self.seen.insert(number) {
                        self.open(number, height)?;
                    }
                }
            }
        }
        Ok(None)
    }

    /// Reads a node, and adds its entries.
    fn open(&mut self, number: i64, height: u16) -> rusqlite::Result<()> {
        let node: Option<Vec<u8>> = self
            .connection
            .prepare_cached("SELECT data FROM near_node WHERE nodeno = ?1")?
            .query_row([number], |row| row.get(0))
            .optional()?;
        let Some((head, entries)) = node.as_ref().and_then(|node| node.split_at_checked(HEAD))
        else {
            return Ok(());
        };
        let height = if number == 1 { u16::from_be_bytes([head[0], head[1]]) } else { height };
        let n_entries = usize::from(u16::from_be_bytes([head[2], head[3]]));
        for entry in entries.chunks_exact(ENTRY).take(n_entries) {
            let (key, limits) = entry.split_at(8);
            let key = key.try_into().map_or(0, i64::from_be_bytes);
            let what = if height == 0 { What::Box(key) } else { What::Node(key, height - 1) };
            if let Some(distance) = self.bound(limits) {
                self.waiting.push(Entry { distance, what });
            }
        }
        Ok(())
    }

    /// Returns the least distance of a box; `None` for one of another cell.
    fn bound(&self, limits: &[u8]) -> Option<f64> {
        let (words, _) = limits.as_chunks();
        let mut ends = words
            .chunks_exact(2)
            .map(|pair| [pair[0], pair[1]].map(|end| f64::from(f32::from_be_bytes(end))));
        let [low, high] = ends.next()?;
        if self.cell.is_some_and(|cell| (cell as f64) < low || cell as f64 > high) {
            return None;
        }
        let apart = |(here, [low, high]): (&f64, [f64; 2])| {
            let here = here.clamp(-FAR, FAR);
            let apart = (low - here).max(here - high).max(0.0);
            apart * apart
        };
        Some(self.here.iter().zip(ends).map(apart).sum::<f64>().sqrt())
    }
}
