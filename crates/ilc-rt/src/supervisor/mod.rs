//! The campaign: iterations, learning between them, faults and stops.
