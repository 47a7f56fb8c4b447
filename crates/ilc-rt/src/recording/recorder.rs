//! The recorder: from the taps of a loop and the notes of a campaign into the file.
//!
//! In real time on its own thread; in lock-step in line, so that nothing is ever lost. A file that cannot be written
//! ends the recording, never the run.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};

use super::error::RecordingError;
use super::file::{CELL, PROGRAM, RecordFile, SETUP, Topic};
use super::folder;
use super::message::{
    AxisMessage, CycleMessage, FramesMessage, TableMessage, TimingMessage, column_digest,
};
use super::setup::LoopSetup;
use crate::fieldbus::transport::{BusRecord, TapCount};
use crate::record::Event;
use crate::rt::Nanos;
use crate::servo::LoopRecord;

/// Time after which everything recorded is passed to the system.
const FLUSH_EVERY: Duration = Duration::from_millis(400);
/// Time between two looks at the taps.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Time for which the rings have room.
const ROOM_S: f64 = 2.0;
/// Bounds of the rings, in records.
const ROOM: (usize, usize) = (1 << 12, 1 << 18);

/// Place of a recording, and what is kept beside it.
#[derive(Clone, Debug)]
pub struct Place {
    /// File, or folder.
    pub path: PathBuf,
    /// Recordings of the cell that stay in the folder.
    pub files: u32,
    /// Bytes of them, and of the new one.
    pub bytes: Option<u64>,
}

/// Producers for the taps of a loop.
#[derive(Debug)]
pub struct Taps {
    /// Of the loop.
    pub records: Producer<LoopRecord>,
    /// Of its bus.
    pub traffic: Producer<BusRecord>,
    /// Their count.
    pub count: Arc<TapCount>,
}

enum Note {
    Setup(Box<(LoopSetup, String, Vec<u8>)>),
    Event(Box<Event>),
    Table(u32, Vec<f64>),
}

/// Notes of a campaign for its recording; without a recording they are dropped.
#[derive(Clone, Default)]
pub struct Notes(Option<Sender<Note>>);

impl std::fmt::Debug for Notes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Notes").field(&self.0.is_some()).finish()
    }
}

impl Notes {
    fn send(&self, note: impl FnOnce() -> Note) {
        if let Some(notes) = &self.0 {
            // A recording that has ended takes no more.
            let _ = notes.send(note());
        }
    }

    /// Notes the loop, with the text of its cell description and of the file of its program.
    pub fn setup(&self, setup: LoopSetup, cell: String, program: Vec<u8>) {
        self.send(|| Note::Setup(Box::new((setup, cell, program))));
    }

    /// Notes an event.
    pub fn event(&self, event: &Event) {
        if !matches!(event, Event::Progress { .. }) {
            self.send(|| Note::Event(Box::new(event.clone())));
        }
    }

    /// Notes an input table, before it is passed to the loop.
    pub fn table(&self, table: u32, input: &[f64]) {
        self.send(|| Note::Table(table, input.to_vec()));
    }
}

/// The recorder of a session.
pub struct Recorder {
    path: PathBuf,
    notes: Notes,
    taps: Option<Taps>,
    news: Receiver<String>,
    writing: Pace,
    count: Arc<TapCount>,
    /// Lost records that were reported.
    told: u64,
}

enum Pace {
    InLine(Box<Writing>),
    Thread { ends: Arc<AtomicBool>, thread: Option<JoinHandle<()>> },
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Recorder {
    /// Makes the file of a recording of a cell with these axes, and deletes the oldest ones in its folder.
    ///
    /// # Errors
    /// [`RecordingError::Create`] if it cannot be made, or exists.
    pub fn create(
        place: &Place,
        (cell, campaign): (&str, &str),
        axes: &[String],
        (cycle_s, lockstep): (f64, bool),
    ) -> Result<Self, RecordingError> {
        let (file, path) = folder::create(&place.path, &format!("{cell}@{campaign}"))?;
        if folder::is_folder(&place.path) {
            folder::thin(&path, cell, place.files, place.bytes);
        }
        Self::begin((file, path, true), place.bytes, axes, (cycle_s, lockstep))
    }

    /// Records into an open file, e.g. a pipe; `path` names it.
    ///
    /// # Errors
    /// [`RecordingError::Create`] if its beginning cannot be written.
    pub fn into_open(
        file: File,
        path: &Path,
        axes: &[String],
        pace: (f64, bool),
    ) -> Result<Self, RecordingError> {
        Self::begin((file, path.to_owned(), false), None, axes, pace)
    }

    fn begin(
        (file, path, is_ours): (File, PathBuf, bool),
        bytes_max: Option<u64>,
        axes: &[String],
        (cycle_s, lockstep): (f64, bool),
    ) -> Result<Self, RecordingError> {
        let refused = |reason: String| RecordingError::Create { path: path.clone(), reason };
        let file = RecordFile::begin(file, axes).map_err(|error| refused(error.to_string()))?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded")]
        let room = |per_tick: usize| ((ROOM_S / cycle_s) as usize * per_tick).clamp(ROOM.0, ROOM.1);
        let (records, rows) = RingBuffer::new(room(axes.len() + 2));
        // Two frames to and from each axis, a tool, SYNC.
        let (traffic, frames) = RingBuffer::new(room(4 * axes.len() + 3));
        let count = Arc::new(TapCount::default());
        let (notes_in, notes) = channel();
        let (news_in, news) = channel();
        let mut writing = Writing {
            file: Some(file),
            lockstep,
            notes,
            rows,
            frames,
            count: Arc::clone(&count),
            news: news_in,
            path: path.clone(),
            is_ours,
            bytes_max,
            n_axes: axes.len(),
            now: Nanos(0),
            cycle: 0,
            axis: 0,
            flushed: Instant::now(),
            has_loop: false,
        };
        let writing = if lockstep {
            Pace::InLine(Box::new(writing))
        } else {
            let ends = Arc::new(AtomicBool::new(false));
            let asked = Arc::clone(&ends);
            let thread = std::thread::Builder::new()
                .name("ilc-record".to_owned())
                .spawn(move || {
                    while !asked.load(Ordering::Acquire) {
                        writing.look();
                        std::thread::sleep(LOOK_EVERY);
                    }
                    writing.end();
                })
                .map_err(|error| refused(error.to_string()))?;
            Pace::Thread { ends, thread: Some(thread) }
        };
        let taps = Some(Taps { records, traffic, count: Arc::clone(&count) });
        Ok(Self { path, notes: Notes(Some(notes_in)), taps, news, writing, count, told: 0 })
    }

    /// Returns the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the notes.
    pub fn notes(&self) -> Notes {
        self.notes.clone()
    }

    /// Returns the producers for the taps, once.
    pub fn taps(&mut self) -> Option<Taps> {
        self.taps.take()
    }

    /// Returns the number of records lost so far.
    pub fn lost(&self) -> u64 {
        self.count.lost()
    }

    /// Writes what there is, in lock-step; returns the reason if the recording has ended since, or begins to lose
    /// records, even while its writer is held.
    pub fn poll(&mut self) -> Option<String> {
        if let Pace::InLine(writing) = &mut self.writing {
            writing.look();
        }
        let news = self.news.try_recv().ok();
        if news.is_some() || self.told > 0 {
            return news;
        }
        self.told = self.lost();
        (self.told > 0).then(|| "records are lost: this computer writes too slowly".to_owned())
    }

    /// Ends the file; returns the reason if that failed, or the number of records lost if it has grown.
    pub fn end(&mut self) -> Option<String> {
        match &mut self.writing {
            Pace::InLine(writing) => writing.end(),
            Pace::Thread { ends, thread } => {
                ends.store(true, Ordering::Release);
                if let Some(thread) = thread.take() {
                    let _ = thread.join();
                }
            }
        }
        let (lost, path) = (self.lost(), self.path.display());
        let has_grown = lost > std::mem::replace(&mut self.told, lost);
        let all = has_grown.then(|| format!("{path}: {lost} records are lost in all"));
        self.news.try_recv().ok().or(all)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.end();
    }
}

/// The writing side.
struct Writing {
    file: Option<RecordFile>,
    lockstep: bool,
    notes: Receiver<Note>,
    rows: Consumer<LoopRecord>,
    frames: Consumer<BusRecord>,
    count: Arc<TapCount>,
    news: Sender<String>,
    path: PathBuf,
    /// True for a file of its own, which goes if there is nothing to keep.
    is_ours: bool,
    bytes_max: Option<u64>,
    n_axes: usize,
    /// Time of the last tick.
    now: Nanos,
    cycle: u64,
    /// Next axis of this tick.
    axis: usize,
    flushed: Instant,
    /// True once it holds a loop. Without one, as nothing has moved, there is nothing to keep.
    has_loop: bool,
}

impl Writing {
    /// Writes everything that the taps and the campaign have.
    fn look(&mut self) {
        // Ticks first, notes before them: a table is noted before a tick can use it.
        let ticks: Vec<LoopRecord> = std::iter::from_fn(|| self.rows.pop().ok()).collect();
        let notes: Vec<Note> = self.notes.try_iter().collect();
        let Some(mut file) = self.file.take() else {
            // The loop must not fill rings that are not read.
            while self.frames.pop().is_ok() {}
            return;
        };
        match self.write(&mut file, &ticks, &notes) {
            Ok(()) => self.file = Some(file),
            Err(error) => {
                file.abandon();
                let _ = self.news.send(format!("the recording ends early: {error}"));
                return;
            }
        }
        if let Some(max) = self.bytes_max
            && self.file.as_ref().is_some_and(|file| file.n_bytes() > max)
        {
            self.end();
            let _ = self.news.send(format!("the recording ends early: it has reached {max} bytes"));
        }
    }

    fn write(
        &mut self,
        file: &mut RecordFile,
        ticks: &[LoopRecord],
        notes: &[Note],
    ) -> std::io::Result<()> {
        for note in notes {
            match note {
                Note::Setup(parts) => {
                    self.has_loop = true;
                    let (setup, cell, program) = &**parts;
                    file.attach(CELL, "application/toml", cell.as_bytes())?;
                    file.attach(PROGRAM, "application/octet-stream", program)?;
                    let text = serde_json::to_vec(setup).unwrap_or_default();
                    file.attach(SETUP, "application/json", &text)?;
                }
                Note::Event(event) => {
                    let topic = match **event {
                        Event::Iteration { .. } => Topic::Iterations,
                        _ => Topic::Events,
                    };
                    file.write(topic, self.time(), event)?;
                }
                Note::Table(table, input) => {
                    let digest = |axis| column_digest(input, axis, self.n_axes);
                    let message = TableMessage {
                        table: *table,
                        input: input.clone(),
                        digests: (0..self.n_axes).map(digest).collect(),
                    };
                    file.write(Topic::Tables, self.time(), &message)?;
                }
            }
        }
        for tick in ticks {
            match tick {
                LoopRecord::Loop(row) => {
                    (self.now, self.cycle, self.axis) = (row.at, row.tick, 0);
                    self.write_frames(file, row.tick)?;
                    file.write(Topic::Cycle, row.at, &CycleMessage::from(row))?;
                }
                LoopRecord::Axis(row) => {
                    let message = AxisMessage::new(self.cycle, row);
                    file.write(Topic::Axis(self.axis), self.now, &message)?;
                    self.axis += 1;
                }
                LoopRecord::Stamps(stamps) => {
                    file.write(Topic::Timing, self.now, &TimingMessage::from(stamps))?;
                }
            }
        }
        if self.flushed.elapsed() > FLUSH_EVERY {
            file.flush()?;
            self.flushed = Instant::now();
        }
        Ok(())
    }

    /// Writes the traffic up to a tick.
    fn write_frames(&mut self, file: &mut RecordFile, until: u64) -> std::io::Result<()> {
        loop {
            let next = self.frames.peek().ok().map(|record| record.tick);
            let Some(cycle) = next.filter(|tick| *tick <= until) else { return Ok(()) };
            let mut message = FramesMessage { cycle, ..FramesMessage::default() };
            while self.frames.peek().is_ok_and(|record| record.tick == cycle)
                && let Ok(record) = self.frames.pop()
            {
                message.add(&record, self.now);
            }
            if !message.is_empty() {
                file.write(Topic::Frames, self.now, &message)?;
            }
        }
    }

    /// Returns the time of a note.
    fn time(&self) -> Nanos {
        if self.lockstep {
            return self.now;
        }
        let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        since.map(Nanos::from).unwrap_or_default()
    }

    /// Writes the rest, and the end.
    fn end(&mut self) {
        self.look_at_rest();
        if self.is_ours && !self.has_loop && self.file.take().is_some() {
            // A failure is harmless: a short file remains.
            let _ = std::fs::remove_file(&self.path);
        }
        if let Some(mut file) = self.file.take() {
            let lost = self.count.lost();
            let ended = self.write_frames(&mut file, u64::MAX).and_then(|()| file.end(lost));
            if let Err(error) = ended {
                let path = self.path.display();
                let _ = self.news.send(format!("{path}: the recording has no end: {error}"));
            }
        }
    }

    fn look_at_rest(&mut self) {
        let max = self.bytes_max.take();
        self.look();
        self.bytes_max = max;
    }
}
