//! The iteration library: every run kept in SQLite.
