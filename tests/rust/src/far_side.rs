//! The simulated machine on a bus, in its own thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use ilc_rt::fieldbus::transport::Responder;
use ilc_rt::fieldbus::{Bus, BusError};
use ilc_sim::Machine;

/// Interval at which the thread checks for its end; frames are answered at once.
const LOOK: Duration = Duration::from_millis(5);

/// A machine that serves a bus until dropped.
#[derive(Debug)]
pub struct FarSide {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl FarSide {
    /// Starts serving.
    pub fn serve(bus: Box<dyn Bus>, machine: Machine) -> Self {
        Self::serve_with(bus, machine, |_| {})
    }

    /// Starts serving; `meddle` is called before each frame.
    pub fn serve_with(
        mut bus: Box<dyn Bus>,
        mut machine: Machine,
        mut meddle: impl FnMut(&mut Machine) + Send + 'static,
    ) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            while !told.load(Ordering::Relaxed) {
                let frame = match bus.recv(LOOK) {
                    Ok(Some(frame)) => frame,
                    Ok(None) => continue,
                    Err(error) if error.may_pass() => continue,
                    Err(_) => return,
                };
                meddle(&mut machine);
                let mut answers = Vec::new();
                machine.receive(&frame, &mut |answer| answers.push(answer));
                for answer in answers {
                    // A transport with a full queue drops the frame for a moment; lock-step must
                    // not lose it.
                    while bus.send(&answer) == Err(BusError::Full) {
                        std::thread::yield_now();
                    }
                }
            }
        });
        Self { over, thread: Some(thread) }
    }
}

impl Drop for FarSide {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
