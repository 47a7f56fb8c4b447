//! What is seen from outside: the events and samples of a cell, on Zenoh.
//!
//! A thread and a session of their own; the supervisor hands over finished text through a bounded
//! queue and drops what does not fit. Nothing here can hold up the loop, and nothing can command it.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use zenoh::Wait;
use zenoh::qos::CongestionControl;

use super::error::SupervisorError;
use crate::config::{Cell, Telemetry as Settings};

/// Messages that may wait for the network.
const QUEUE: usize = 1024;
/// How long the end of a campaign waits for what is still in the queue. A monitor that no longer
/// reads would hold the session up for much longer.
const CLOSE_MAX: Duration = Duration::from_secs(2);

/// Something to publish.
struct Message {
    key: &'static str,
    json: String,
    /// Whether a late joiner is told it as the state.
    is_state: bool,
}

/// A running publisher.
pub(super) struct Telemetry {
    queue: Option<SyncSender<Message>>,
    thread: Option<JoinHandle<()>>,
    /// Never gets anything: the thread's end closes it.
    ended: Receiver<()>,
    dropped: u64,
}

impl Telemetry {
    /// Starts the thread; the session opens there. A network that is not there is logged, not fatal.
    pub(super) fn start(cell: &Cell) -> Result<Self, SupervisorError> {
        let (queue, messages) = sync_channel(QUEUE);
        let (end, ended) = sync_channel::<()>(0);
        let settings = cell.telemetry.clone();
        let prefix = format!("ilc/{}", cell.cell.name);
        let thread = std::thread::Builder::new()
            .name("ilc-telemetry".to_owned())
            .spawn(move || {
                let _end = end;
                if let Err(error) = publish(&settings, &prefix, &messages) {
                    tracing::warn!("[telemetry]: {error}; the cell runs unseen");
                }
            })
            .map_err(|source| SupervisorError::Thread { what: "telemetry", source })?;
        Ok(Self { queue: Some(queue), thread: Some(thread), ended, dropped: 0 })
    }

    /// Publishes under `ilc/<cell>/<key>`, unless the queue is full; `is_state` is what a late joiner
    /// is told.
    pub(super) fn send(&mut self, key: &'static str, json: String, is_state: bool) {
        let Some(queue) = &self.queue else { return };
        match queue.try_send(Message { key, json, is_state }) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => self.dropped += 1,
            // The thread has ended, and has said why.
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

fn configuration(settings: &Settings) -> zenoh::Result<zenoh::Config> {
    let mut config = zenoh::Config::default();
    let list = |endpoints: &[String]| serde_json::to_string(endpoints).unwrap_or_default();
    if !settings.listen.is_empty() {
        config.insert_json5("listen/endpoints", &list(&settings.listen))?;
    }
    if !settings.connect.is_empty() {
        config.insert_json5("connect/endpoints", &list(&settings.connect))?;
    }
    config.insert_json5("scouting/multicast/enabled", &settings.scouting.to_string())?;
    Ok(config)
}

fn publish(settings: &Settings, prefix: &str, messages: &Receiver<Message>) -> zenoh::Result<()> {
    let session = zenoh::open(configuration(settings)?).wait()?;
    let alive = session.liveliness().declare_token(format!("{prefix}/alive")).wait()?;
    let latest: Arc<Mutex<Option<String>>> = Arc::default();
    let state_key = format!("{prefix}/state");
    // A late joiner asks for the state and gets the latest.
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
                // Rare and not repeated, so worth waiting for a slow subscriber, here in this thread.
                CongestionControl::Block
            })
            .encoding(zenoh::bytes::Encoding::APPLICATION_JSON)
            .wait()?;
    }
    queryable.undeclare().wait()?;
    alive.undeclare().wait()?;
    session.close().wait()
}
