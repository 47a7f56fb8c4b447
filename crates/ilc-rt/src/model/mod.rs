//! Linear models: state space, discretisation, delays, feedback.
