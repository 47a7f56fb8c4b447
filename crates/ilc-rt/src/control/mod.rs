//! Controllers that run in the tick: the position loop and limits.
