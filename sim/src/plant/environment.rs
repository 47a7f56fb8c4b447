//! Temperature, payload and external force over time, as `[[simulation.change]]` states them. For the gantry.

use ilc_rt::config::{NOMINAL_TEMPERATURE_K, Simulation};

/// A linear change to a value.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    after_s: f64,
    over_s: f64,
    to: f64,
    /// Value when the change began, once it has.
    from: Option<f64>,
}

/// A quantity that changes at given times.
#[derive(Clone, Debug)]
struct Quantity {
    now: f64,
    ramps: Vec<Ramp>,
}

impl Quantity {
    fn at(&mut self, time_s: f64) -> f64 {
        for ramp in self.ramps.iter_mut().filter(|ramp| time_s >= ramp.after_s) {
            let from = *ramp.from.get_or_insert(self.now);
            let elapsed_s = time_s - ramp.after_s;
            self.now = if elapsed_s < ramp.over_s {
                from + (ramp.to - from) * elapsed_s / ramp.over_s
            } else {
                ramp.to
            };
        }
        self.now
    }
}

/// Conditions of an axis at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conditions {
    /// Additional mass on the carriage.
    pub(super) payload_kg: f64,
    /// External force on the carriage.
    pub(super) force_n: f64,
    /// Temperature above that of the nominal values.
    pub(super) warming_k: f64,
}

/// The conditions of all axes. Without changes they are constant, and cost nothing.
#[derive(Clone, Debug)]
pub(super) struct Environment {
    time_s: f64,
    is_constant: bool,
    temperature_k: Quantity,
    /// Payload and force of each axis.
    axes: Vec<[Quantity; 2]>,
}

impl Environment {
    pub(super) fn new(simulation: &Simulation, names: &[&str]) -> Self {
        let quantity = |now: f64, to: &dyn Fn(usize) -> Option<f64>| Quantity {
            now,
            ramps: (simulation.changes.iter().enumerate())
                .filter_map(|(number, change)| {
                    let (after_s, over_s) = (change.after_s, change.over_s);
                    Some(Ramp { after_s, over_s, to: to(number)?, from: None })
                })
                .collect(),
        };
        let changes = &simulation.changes;
        let axes = names.iter().map(|name| {
            let concerns =
                |number: usize| changes[number].axis.as_deref().is_none_or(|axis| axis == *name);
            [
                quantity(0.0, &|n| changes[n].payload_kg.filter(|_| concerns(n))),
                quantity(0.0, &|n| changes[n].force_n.filter(|_| concerns(n))),
            ]
        });
        Self {
            time_s: 0.0,
            is_constant: changes.iter().all(|change| {
                let quantities = [change.temperature_k, change.payload_kg, change.force_n];
                quantities.iter().all(Option::is_none)
            }),
            temperature_k: quantity(simulation.temperature_k, &|n| changes[n].temperature_k),
            axes: axes.collect(),
        }
    }

    /// Advances the time; returns true if conditions may have changed.
    pub(super) fn advance(&mut self, dt_s: f64) -> bool {
        self.time_s += dt_s;
        !self.is_constant
    }

    /// Returns the conditions of an axis now.
    pub(super) fn of(&mut self, axis: usize) -> Conditions {
        let warming_k = self.temperature_k.at(self.time_s) - NOMINAL_TEMPERATURE_K;
        let time_s = self.time_s;
        match self.axes.get_mut(axis) {
            Some([payload, force]) => {
                Conditions { payload_kg: payload.at(time_s), force_n: force.at(time_s), warming_k }
            }
            None => Conditions { payload_kg: 0.0, force_n: 0.0, warming_k },
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "values that are set, not computed")]
mod tests {
    use ilc_rt::config::SimulationChange;

    use super::*;

    fn change(after_s: f64, over_s: f64) -> SimulationChange {
        SimulationChange {
            after_s,
            over_s,
            axis: None,
            temperature_k: None,
            payload_kg: None,
            force_n: None,
            digital_inputs: None,
            torque_off: None,
        }
    }

    #[test]
    fn changes_begin_from_what_was_and_concern_their_axis() {
        let simulation = Simulation {
            changes: vec![
                SimulationChange { temperature_k: Some(313.15), ..change(1.0, 10.0) },
                SimulationChange {
                    axis: Some("y".to_owned()),
                    payload_kg: Some(4.0),
                    force_n: Some(-9.0),
                    ..change(2.0, 0.0)
                },
                SimulationChange { temperature_k: Some(293.15), ..change(6.0, 5.0) },
            ],
            ..Simulation::default()
        };
        let mut environment = Environment::new(&simulation, &["x", "y"]);
        let mut at = |time_s: f64, axis| {
            environment.time_s = time_s;
            environment.of(axis)
        };
        assert_eq!(at(0.5, 1), Conditions { payload_kg: 0.0, force_n: 0.0, warming_k: 0.0 });
        assert!((at(3.5, 0).warming_k - 5.0).abs() < 1e-9);
        assert_eq!((at(3.5, 0).payload_kg, at(3.5, 1).payload_kg), (0.0, 4.0));
        assert_eq!((at(3.5, 0).force_n, at(3.5, 1).force_n), (0.0, -9.0));
        // The second change of temperature begins at 10 K and is over after five seconds.
        assert!((at(6.0, 0).warming_k - 10.0).abs() < 1e-9);
        assert!((at(8.5, 0).warming_k - 5.0).abs() < 1e-9);
        assert!(at(60.0, 0).warming_k.abs() < 1e-9);
    }
}
