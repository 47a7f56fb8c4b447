//! Python bindings of `ilc-rt`: conversion, shape checks and error mapping only.
