//! The transports: SocketCAN, UDP multicast, Zenoh and in-process loopback.
