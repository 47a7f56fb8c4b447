//! CANopen services: NMT, SYNC, SDO, PDO, heartbeat and EMCY, as codecs without a bus.
