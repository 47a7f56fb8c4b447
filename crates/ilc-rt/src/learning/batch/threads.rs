//! Groups of plants, handed to the threads as these become free.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use super::lanes::LANES;
use super::trials::{Bench, Case};
use super::{BatchError, Figures, Laws, Task};
use crate::interrupt;

/// Values of a signal up to which plants are simulated side by side: the workspace of more would not stay in a cache.
const LONG: usize = 100_000;
/// Interval at which a caller that waits for the other threads is asked whether it still does.
const ASK_EVERY: Duration = Duration::from_millis(20);

/// Makes all runs of all plants, on this thread and others, as many as the laws are for.
///
/// # Real Time
/// Cold path. `O(n_plants trials n_samples)` time; memory for a group of eight plants per thread, besides
/// the figures and the signals that are to be kept.
/// # Errors
/// - [`BatchError`]
pub fn learn(task: &Task, laws: &Laws) -> Result<Figures, BatchError> {
    task.check(laws)?;
    let (n_inputs, n_outputs) = task.channels();
    let n_plants = task.plants.len();
    let unknown = |each: usize| vec![f64::INFINITY; n_plants * each];
    let kept = task.kept.map(|runs| runs.min(task.trials) * task.n_samples);
    let mut found = Figures {
        rms: unknown(task.trials),
        inf: unknown(task.trials),
        errors: unknown(kept[0] * n_outputs),
        inputs: unknown(kept[1] * n_inputs),
    };
    let threads = laws.threads().min(n_plants.max(1));
    let queue = Queue::new(groups(task, &mut found, threads));
    thread::scope(|scope| {
        // Also if this thread unwinds, as the scope waits for the others.
        let _over = Over(&queue.is_over);
        for _ in 1..threads {
            let waiting = thread::current();
            let queue = &queue;
            queue.working.fetch_add(1, Ordering::Relaxed);
            scope.spawn(move || {
                let _done = Done(&queue.working, waiting);
                queue.work(task, laws);
            });
        }
        queue.work(task, laws);
        while queue.working.load(Ordering::Acquire) > 0 {
            interrupt::point();
            thread::park_timeout(ASK_EVERY);
        }
    });
    match queue.failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some((_, error)) => Err(error),
        None => Ok(found),
    }
}

/// Returns the plants in groups of the same shape, with the places of their figures.
fn groups<'a>(task: &Task, found: &'a mut Figures, threads: usize) -> Vec<Vec<Case<'a>>> {
    let n_plants = task.plants.len();
    let is_long = task.reference.len().max(task.initial_input.len()) > LONG;
    let width = if is_long { 1 } else { n_plants.div_ceil(threads).clamp(1, LANES) };
    let each = [
        rows(&mut found.rms, n_plants),
        rows(&mut found.inf, n_plants),
        rows(&mut found.errors, n_plants),
        rows(&mut found.inputs, n_plants),
    ];
    let [mut all_rms, mut all_inf, mut all_errors, mut all_inputs] = each.map(Vec::into_iter);
    let mut cases: Vec<Case> = (0..n_plants)
        .filter_map(|plant| {
            let (rms, inf) = (all_rms.next()?, all_inf.next()?);
            Some(Case { plant, rms, inf, errors: all_errors.next()?, inputs: all_inputs.next()? })
        })
        .collect();
    let n_states = |case: &Case| task.plants[case.plant].n_states();
    cases.sort_by_key(n_states);
    let mut groups: Vec<Vec<Case>> = Vec::new();
    for case in cases {
        match groups.last_mut() {
            Some(group) if group.len() < width && n_states(&group[0]) == n_states(&case) => {
                group.push(case);
            }
            _ => groups.push(vec![case]),
        }
    }
    groups
}

/// Returns the row of each plant, which may be empty.
fn rows(values: &mut [f64], n_plants: usize) -> Vec<&mut [f64]> {
    let width = values.len() / n_plants.max(1);
    let mut rest = values;
    let mut rows = Vec::with_capacity(n_plants);
    for _ in 0..n_plants {
        let (row, others) = rest.split_at_mut(width);
        rows.push(row);
        rest = others;
    }
    rows
}

/// Groups that no thread has taken yet.
struct Queue<'a> {
    groups: Mutex<std::vec::IntoIter<Vec<Case<'a>>>>,
    is_over: AtomicBool,
    /// Number of other threads at work.
    working: AtomicUsize,
    /// The failure of the first plant that failed, by its index.
    failed: Mutex<Option<(usize, BatchError)>>,
}

impl<'a> Queue<'a> {
    fn new(groups: Vec<Vec<Case<'a>>>) -> Self {
        Self {
            groups: Mutex::new(groups.into_iter()),
            is_over: AtomicBool::new(false),
            working: AtomicUsize::new(0),
            failed: Mutex::new(None),
        }
    }

    /// Works until no group is left, or one fails.
    fn work(&self, task: &Task, laws: &Laws) {
        let mut bench = Bench::new(task);
        while !self.is_over.load(Ordering::Relaxed) {
            // Not held during the work.
            let group = self.groups.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(mut group) = group else { return };
            let first = group[0].plant;
            if let Err(error) = bench.learn(task, laws, &mut group, &self.is_over) {
                self.is_over.store(true, Ordering::Relaxed);
                let mut failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
                if failed.as_ref().is_none_or(|(earlier, _)| first < *earlier) {
                    *failed = Some((first, error));
                }
            }
        }
    }
}

/// Ends the work of all threads.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Announces the end of a thread's work, also if it panics.
struct Done<'a>(&'a AtomicUsize, thread::Thread);

impl Drop for Done<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Release);
        self.1.unpark();
    }
}
