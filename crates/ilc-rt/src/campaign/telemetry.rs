//! Telemetry: the events and samples of a cell, on Zenoh.
//!
//! It has its own thread and session; the campaign passes formatted text through a bounded queue
//! and drops what does not fit. It can neither delay nor command the loop.

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
/// Time that the end of a campaign waits for the queue and for the subscribers. One that no longer reads
/// is left after a second.
const CLOSE_MAX: Duration = Duration::from_secs(6);
/// Time that subscribers may take to acknowledge the last message.
const HEARD_MAX: Duration = Duration::from_secs(3);

/// Time that the token outlives the last message: Zenoh sends declarations before waiting data, and
/// a subscriber leaves when the token disappears.
const LINGER: Duration = Duration::from_millis(250);

/// A message to publish.
struct Message {
    key: &'static str,
    json: String,
    /// A late subscriber gets it as the state.
    is_state: bool,
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

    /// Publishes under `ilc/<cell>/<key>`, unless the queue is full; `is_state` marks what a late subscriber
    /// gets.
    pub(super) fn send(&mut self, key: &'static str, json: String, is_state: bool) {
        let Some(queue) = &self.queue else { return };
        match queue.try_send(Message { key, json, is_state }) {
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
    let latest: Arc<Mutex<Option<String>>> = Arc::default();
    let state_key = format!("{prefix}/state");
    // A late joiner queries the state and receives the latest.
    let answer = {
        let (latest, state_key) = (Arc::clone(&latest), state_key.clone());
        move |query: zenoh::query::Query| {
            let state = latest.lock().ok().and_then(|state| state.clone());
            if let Some(state) = state {
                let _ = query.reply(&state_key, state).wait();
            }
        }
    };
    let queryable = session.declare_queryable(&state_key).callback(answer).wait()?;
    for Message { key, json, is_state } in messages {
        if is_state && let Ok(mut state) = latest.lock() {
            *state = Some(json.clone());
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
    queryable.undeclare().wait()?;
    alive.undeclare().wait()?;
    session.close().wait()
}

/// Waits until the subscribers have received all that was published: a monitor answers on `heard`, and its
/// answer comes after what it was sent before. Those that do not answer get [`LINGER`].
fn await_readers(session: &zenoh::Session, prefix: &str) -> zenoh::Result<()> {
    let asked = Instant::now();
    let answers = session
        .get(format!("{prefix}/heard"))
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .congestion_control(CongestionControl::Block)
        .timeout(HEARD_MAX)
        .wait()?;
    while answers.recv().is_ok() {}
    std::thread::sleep(LINGER.saturating_sub(asked.elapsed()));
    Ok(())
}
