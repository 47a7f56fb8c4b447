//! The Zenoh side of a `zenoh:` bus: session, publisher thread and subscriber. Cold.
//!
//! Zenoh allocates and locks, so it stays behind two ring buffers; `transport::zenoh` holds their
//! other ends.

use std::sync::atomic::{AtomicBool, Ordering, fence};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::{Locality, Sample};
use zenoh::{Session, Wait};

use super::error::OpenError;
use super::zenoh::ZenohSettings;
use super::zenoh_reach::{self, Reach};
use crate::fieldbus::Frame;
use crate::fieldbus::transport::doorbell::{Bell, Ringer, bell};
use crate::fieldbus::transport::queue::{Inbox, Outbox};
use crate::fieldbus::transport::zenoh::{decode, encode};

/// Frames per ring buffer.
const RING_FRAMES: usize = 4096;

/// Polling period of [`Link::wait_for_peer`].
const POLL: Duration = Duration::from_millis(1);

/// Time that a peer may leave its frames unread before they are dropped: longer than a busy host lets a thread
/// wait, as a lost frame would end the motion.
const STALL_US: u32 = 1_000_000;

/// Multicast group for the discovery of bus endpoints. Not that of all Zenoh programs: a bus must
/// not be found by a mere monitor, and be carried off the host by it.
const GROUP: &str = "224.0.0.224:7448";

/// The caller's ends of an open link.
pub(in crate::fieldbus::transport) struct Ends {
    pub(in crate::fieldbus::transport) outgoing: Outbox,
    pub(in crate::fieldbus::transport) incoming: Inbox,
    pub(in crate::fieldbus::transport) link: Link,
}

/// An open session with its publisher thread; closes both when dropped.
pub(in crate::fieldbus::transport) struct Link {
    session: Session,
    publisher: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
}

/// Flags between the threads of a link.
#[derive(Debug, Default)]
struct Shared {
    closing: AtomicBool,
    /// True while the publisher sleeps or is about to; set before its last check of the buffer.
    parked: AtomicBool,
    matched: AtomicBool,
}

impl Link {
    /// Opens its own session and joins the bus.
    ///
    /// # Errors
    /// [`OpenError::Zenoh`] with the failed step.
    pub(in crate::fieldbus::transport) fn open(
        settings: &ZenohSettings,
    ) -> Result<Ends, OpenError> {
        let refused = |action| {
            move |reason: zenoh::Error| OpenError::Zenoh {
                key: settings.key.clone(),
                action,
                reason: zenoh_reach::reason(&reason),
            }
        };
        let config = config(settings).map_err(refused("configuring the session"))?;
        let session = zenoh::open(config).wait().map_err(refused("opening the session"))?;
        let (bell, incoming) =
            subscribe(&session, settings).map_err(refused("subscribing to the key"))?;
        let publisher = session
            .declare_publisher(format!("{}/{}", settings.key, session.zid()))
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .express(true)
            .allowed_destination(Locality::Remote)
            .wait()
            .map_err(refused("publishing on the key"))?;
        let shared = Arc::new(Shared::default());
        watch_matching(&publisher, &shared).map_err(refused("watching for subscribers"))?;

        let (outgoing, to_publish) = RingBuffer::new(RING_FRAMES);
        let publisher = std::thread::Builder::new()
            .name("bus-zenoh".to_owned())
            .spawn({
                let shared = Arc::clone(&shared);
                move || publish(&publisher, to_publish, &shared)
            })
            .map_err(|error| refused("starting the publisher's thread")(error.into()))?;
        let link = Self { session, publisher: Some(publisher), shared };
        Ok(Ends { outgoing: Outbox::new(outgoing), incoming: Inbox::new(incoming, bell), link })
    }

    /// Waits until another endpoint receives the published frames; returns false after the timeout.
    pub(in crate::fieldbus::transport) fn wait_for_peer(&self, timeout: Duration) -> bool {
        let end = Instant::now() + timeout;
        while !self.shared.matched.load(Ordering::Acquire) {
            if Instant::now() >= end {
                return false;
            }
            std::thread::sleep(POLL);
        }
        true
    }

    /// Wakes the publisher if it sleeps; called after the outgoing buffer was filled. Hot: one
    /// fence, and a system call only if the publisher sleeps.
    pub(in crate::fieldbus::transport) fn wake_publisher(&self) {
        // Orders the filling before the read of `parked`, against the reverse order in `publish`.
        fence(Ordering::SeqCst);
        if self.shared.parked.load(Ordering::Relaxed)
            && let Some(publisher) = &self.publisher
        {
            publisher.thread().unpark();
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::SeqCst);
        if let Some(publisher) = self.publisher.take() {
            publisher.thread().unpark();
            // It panics only if Zenoh does, and the bus is closing anyway.
            let _ = publisher.join();
        }
        let _ = self.session.close().wait();
    }
}

fn config(settings: &ZenohSettings) -> zenoh::Result<zenoh::Config> {
    let reach = Reach {
        listen: &settings.listen,
        connect: &settings.connect,
        scouting: settings.scouting,
        // Endpoints on other hosts are given, never discovered.
        scouting_off_host: false,
        group: Some(GROUP),
    };
    let mut config = reach.configuration()?;
    let mut set =
        |key: &str, value: serde_json::Value| config.insert_json5(key, &value.to_string());
    // Express frames are sent one by one, so the queue counts frames; Zenoh takes 16 at most.
    set("transport/link/tx/queue/size/real_time", 16.into())?;
    // The publisher's thread may wait where the caller's may not. After this time a peer counts as
    // stalled, and its frames are dropped so that the others receive theirs.
    set("transport/link/tx/queue/congestion_control/drop/wait_before_drop", STALL_US.into())?;
    Ok(config)
}

fn subscribe(
    session: &Session,
    settings: &ZenohSettings,
) -> zenoh::Result<(Bell, Consumer<Frame>)> {
    let payload_max = settings.format.payload_max();
    let (ringer, bell) = bell()?;
    let (sink, incoming) = RingBuffer::new(RING_FRAMES);
    // Zenoh may call from several of its threads; only they contend for this lock.
    let sink = Mutex::new((sink, ringer));
    session
        .declare_subscriber(format!("{}/*", settings.key))
        .allowed_origin(Locality::Remote)
        .callback(move |sample| deliver(&sink, &sample, payload_max))
        .background()
        .wait()?;
    Ok((bell, incoming))
}

fn deliver(sink: &Mutex<(Producer<Frame>, Ringer)>, sample: &Sample, payload_max: usize) {
    if let Some(frame) = decode(&sample.payload().to_bytes(), payload_max) {
        let mut sink = sink.lock().unwrap_or_else(PoisonError::into_inner);
        // A receiver that is a whole buffer behind loses the newest frame, as on any CAN
        // controller.
        if sink.0.push(frame).is_ok() {
            sink.1.ring();
        }
    }
}

fn watch_matching(publisher: &Publisher<'_>, shared: &Arc<Shared>) -> zenoh::Result<()> {
    let watched = Arc::clone(shared);
    publisher
        .matching_listener()
        .callback(move |status| watched.matched.store(status.matching(), Ordering::Release))
        .background()
        .wait()?;
    // Subscribers that existed before the listener.
    if publisher.matching_status().wait()?.matching() {
        shared.matched.store(true, Ordering::Release);
    }
    Ok(())
}

/// Publishes outgoing frames, in the link's own thread, until the link closes.
fn publish(publisher: &Publisher<'_>, mut to_publish: Consumer<Frame>, shared: &Shared) {
    loop {
        while let Ok(frame) = to_publish.pop() {
            let (bytes, len) = encode(&frame);
            if publisher.put(&bytes[..len]).wait().is_err() {
                // The session is closed; dropping the buffer closes the bus for the caller.
                return;
            }
        }
        if shared.closing.load(Ordering::SeqCst) {
            return;
        }
        shared.parked.store(true, Ordering::Relaxed);
        fence(Ordering::SeqCst);
        if to_publish.is_empty() && !shared.closing.load(Ordering::SeqCst) {
            std::thread::park();
        }
        shared.parked.store(false, Ordering::Relaxed);
    }
}
