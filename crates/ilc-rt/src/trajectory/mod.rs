//! From a program of segments to set points, and the geometry of contours.
