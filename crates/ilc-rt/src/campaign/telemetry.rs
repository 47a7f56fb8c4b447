//! Telemetry: the events and samples of a cell, on Zenoh.
//!
//! It has its own thread and session; the campaign passes formatted text through a bounded queue
//! and drops what does not fit. It can neither delay nor command the loop.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use zenoh::Wait;
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, QueryTarget};

use super::error::CampaignError;
use crate::config::{Cell, Telemetry as Settings};
use crate::fieldbus::transport::opening::zenoh_reach::{self, Reach};

/// Messages that may wait for the network.
const QUEUE: usize = 1024;
/// Runs, decisions and faults of the campaign that a late joiner can ask for.
const HISTORY_MAX: usize = 1000;
/// Time that the end of a campaign waits for the queue and for the subscribers. One that no longer reads
/// is left after a second.
const CLOSE_MAX: Duration = Duration::from_secs(6);
/// Time that subscribers may take to acknowledge the last message.
const HEARD_MAX: Duration = Duration::from_secs(3);

/// Time that the token outlives the last message: Zenoh sends declarations before waiting data, and
/// a subscriber leaves when the token disappears.
const LINGER: Duration = Duration::from_millis(250);
/// Same, if a subscriber has not acknowledged the last message: a busy computer may need longer.
const LINGER_UNHEARD: Duration = Duration::from_millis(1500);

/// Use of a message for a late joiner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kept {
    /// Nothing: it is of the moment.
    No,
    /// The start of the campaign.
    Start,
    /// The state, until the next one.
    State,
    /// The newest one of its key.
    Latest,
    /// A run, a decision or a fault.
    Past,
}

/// A message to publish.
struct Message {
    key: &'static str,
    json: String,
    kept: Kept,
}

/// The campaign so far, for late joiners.
#[derive(Default)]
struct History {
    start: Option<String>,
    past: VecDeque<String>,
    /// Events before the oldest one in `past`.
    n_left_out: usize,
    state: Option<String>,
    /// Newest messages of their keys.
    latest: BTreeMap<&'static str, String>,
}

impl History {
    fn keep(&mut self, key: &'static str, json: &str, kept: Kept) {
        match kept {
            Kept::No => {}
            Kept::Start => {
                *self = Self { start: Some(json.to_owned()), ..Self::default() };
                self.state.clone_from(&self.start);
            }
            Kept::State => self.state = Some(json.to_owned()),
            Kept::Latest => {
                self.latest.insert(key, json.to_owned());
            }
            Kept::Past => {
                if self.past.len() == HISTORY_MAX {
                    self.past.pop_front();
                    self.n_left_out += 1;
                }
                self.past.push_back(json.to_owned());
            }
        }
    }

    /// Returns the events in order, each with the end of its key.
    fn copied(&self) -> Vec<(String, String)> {
        let start = self.start.iter().map(|json| ("start".to_owned(), json.clone()));
        let past = self.past.iter().enumerate();
        let past =
            past.map(|(number, json)| ((self.n_left_out + number).to_string(), json.clone()));
        let latest = self.latest.iter().map(|(key, json)| ((*key).to_owned(), json.clone()));
        start.chain(past).chain(latest).collect()
    }
}

/// A running publisher.
pub(super) struct Telemetry {
    queue: Option<SyncSender<Message>>,
    thread: Option<JoinHandle<()>>,
    /// Receives nothing: it closes when the thread ends.
    ended: Receiver<()>,
    dropped: u64,
}

impl Telemetry {
    /// Starts the thread, which opens the session. A missing network is logged, not fatal.
    pub(super) fn start(cell: &Cell) -> Result<Self, CampaignError> {
        let (queue, messages) = sync_channel(QUEUE);
        let (end, ended) = sync_channel::<()>(0);
        let settings = cell.telemetry.clone();
        let prefix = format!("ilc/{}", cell.cell.name);
        let thread = std::thread::Builder::new()
            .name("ilc-telemetry".to_owned())
            .spawn(move || {
                let _end = end;
                if let Err(error) = publish(&settings, &prefix, &messages) {
                    let reason = zenoh_reach::reason(&error);
                    tracing::warn!("[telemetry]: {reason}; the cell runs unseen");
                }
            })
            .map_err(|source| CampaignError::Thread { what: "telemetry", source })?;
        Ok(Self { queue: Some(queue), thread: Some(thread), ended, dropped: 0 })
    }

    /// Publishes under `ilc/<cell>/<key>`, unless the queue is full.
    pub(super) fn send(&mut self, key: &'static str, json: String, kept: Kept) {
        let Some(queue) = &self.queue else { return };
        match queue.try_send(Message { key, json, kept }) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => self.dropped += 1,
            // The thread has ended, and has logged the reason.
            Err(TrySendError::Disconnected(_)) => self.queue = None,
        }
    }
}

impl Drop for Telemetry {
    fn drop(&mut self) {
        drop(self.queue.take());
        if self.ended.recv_timeout(CLOSE_MAX) == Err(RecvTimeoutError::Timeout) {
            tracing::info!(
                "telemetry: somebody who watches does not read; left without a good-bye"
            );
        } else if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        if self.dropped > 0 {
            tracing::info!("telemetry: {} messages dropped as the network was slow", self.dropped);
        }
    }
}

fn publish(settings: &Settings, prefix: &str, messages: &Receiver<Message>) -> zenoh::Result<()> {
    let reach = Reach {
        listen: &settings.listen,
        connect: &settings.connect,
        scouting: settings.scouting,
        scouting_off_host: true,
        group: None,
    };
    let session = zenoh::open(reach.configuration()?).wait()?;
    let alive = session.liveliness().declare_token(format!("{prefix}/alive")).wait()?;
    let history: Arc<Mutex<History>> = Arc::default();
    let (state_key, past_key) = (format!("{prefix}/state"), format!("{prefix}/history"));
    let state = {
        let (history, key) = (Arc::clone(&history), state_key.clone());
        move |query: zenoh::query::Query| {
            let state = history.lock().ok().and_then(|history| history.state.clone());
            if let Some(state) = state {
                let _ = query.reply(&key, state).wait();
            }
        }
    };
    let past = {
        let (history, key) = (Arc::clone(&history), past_key.clone());
        move |query: zenoh::query::Query| {
            // Copied first: one that reads its answers slowly must not hold up what others hear.
            let Ok(events) = history.lock().map(|history| history.copied()) else { return };
            for (end, json) in events {
                let _ = query.reply(format!("{key}/{end}"), json).wait();
            }
        }
    };
    let state = session.declare_queryable(&state_key).callback(state).wait()?;
    let past = session.declare_queryable(format!("{past_key}/*")).callback(past).wait()?;
    for Message { key, json, kept } in messages {
        if let Ok(mut history) = history.lock() {
            history.keep(key, &json, kept);
        }
        session
            .put(format!("{prefix}/{key}"), json)
            .congestion_control(if key == "servo" {
                CongestionControl::Drop
            } else {
                // Rare and not repeated, so worth waiting for a slow subscriber, in this thread.
                CongestionControl::Block
            })
            .encoding(zenoh::bytes::Encoding::APPLICATION_JSON)
            .wait()?;
    }
    await_readers(&session, prefix)?;
    state.undeclare().wait()?;
    past.undeclare().wait()?;
    alive.undeclare().wait()?;
    session.close().wait()
}

/// Waits until the subscribers have received all that was published: a monitor answers on `heard`, and its
/// answer comes after what it was sent before. Those that do not answer get [`LINGER_UNHEARD`].
fn await_readers(session: &zenoh::Session, prefix: &str) -> zenoh::Result<()> {
    let info = session.info();
    let n_others = info.peers_zid().wait().count() + info.routers_zid().wait().count();
    if n_others == 0 {
        return Ok(());
    }
    let asked = Instant::now();
    let answers = session
        .get(format!("{prefix}/heard"))
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .congestion_control(CongestionControl::Block)
        .timeout(HEARD_MAX)
        .wait()?;
    let mut n_heard = 0;
    while let Ok(answer) = answers.recv() {
        n_heard += usize::from(answer.result().is_ok());
    }
    let linger = if n_heard < n_others { LINGER_UNHEARD } else { LINGER };
    std::thread::sleep(linger.saturating_sub(asked.elapsed()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(history: &History) -> Vec<String> {
        history.copied().iter().map(|(end, json)| format!("{end} {json}")).collect()
    }

    #[test]
    fn a_late_joiner_gets_the_start_and_what_came_after_it() {
        let mut history = History::default();
        history.keep("state", "bringing up", Kept::State);
        history.keep("state", "start", Kept::Start);
        history.keep("drives", "switched on", Kept::Latest);
        history.keep("state", "progress", Kept::No);
        history.keep("iteration", "run 0", Kept::Past);
        history.keep("drives", "enabled", Kept::Latest);
        assert_eq!(ends(&history), ["start start", "0 run 0", "drives enabled"]);
        assert_eq!(history.state.as_deref(), Some("start"));
        history.keep("state", "running", Kept::State);
        assert_eq!(history.state.as_deref(), Some("running"));
        history.keep("state", "another start", Kept::Start);
        assert_eq!(ends(&history), ["start another start"]);
    }

    #[test]
    fn the_history_is_bounded_and_keeps_its_numbers() {
        let mut history = History::default();
        for number in 0..HISTORY_MAX + 2 {
            history.keep("iteration", &number.to_string(), Kept::Past);
        }
        let ends = ends(&history);
        assert_eq!((ends.len(), ends[0].as_str()), (HISTORY_MAX, "2 2"));
    }
}
