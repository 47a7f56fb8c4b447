//! SDO messages of both directions: expedited and segmented transfers and aborts.
//!
//! One request and one response type, used by the client of the controller and by the server of the
//! simulated nodes. Block transfer is not supported: it decodes to `None`, which a server answers
//! with [`AbortCode::UnknownCommand`].

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::sdo_abort::AbortCode;

/// Largest number of bytes in a segment.
pub const SEGMENT_MAX: usize = 7;

/// Index and sub-index of an object; displayed as `0x6041:00`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ObjectAddress {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub sub: u8,
}

impl ObjectAddress {
    /// Creates the address of the object at `index`, `sub`.
    pub const fn new(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }
}

impl std::fmt::Display for ObjectAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "0x{:04X}:{:02X}", self.index, self.sub)
    }
}

/// The 1 to 4 bytes of an expedited transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Expedited {
    bytes: [u8; 4],
    len: u8,
    size_indicated: bool,
}

impl Expedited {
    /// Returns the data, or `None` if `data` is not 1 to 4 bytes.
    pub fn new(data: &[u8]) -> Option<Self> {
        let len = u8::try_from(data.len()).ok().filter(|len| (1..=4).contains(len))?;
        let mut bytes = [0; 4];
        bytes[..data.len()].copy_from_slice(data);
        Some(Self { bytes, len, size_indicated: true })
    }

    /// Returns the data; all four bytes if the size is not indicated.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.len)]
    }

    /// Returns true if the sender stated the number of valid bytes.
    pub fn size_indicated(&self) -> bool {
        self.size_indicated
    }

    fn command_bits(self) -> u8 {
        if self.size_indicated { (4 - self.len) << 2 | 0b11 } else { 0b10 }
    }

    fn decode(command: u8, bytes: [u8; 4]) -> Self {
        let size_indicated = command & 1 != 0;
        let len = if size_indicated { 4 - (command >> 2 & 3) } else { 4 };
        let mut kept = [0; 4];
        kept[..usize::from(len)].copy_from_slice(&bytes[..usize::from(len)]);
        Self { bytes: kept, len, size_indicated }
    }
}

/// The 0 to 7 bytes of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Alternates from segment to segment, first `false`.
    pub toggle: bool,
    /// True for the last segment.
    pub last: bool,
    bytes: [u8; SEGMENT_MAX],
    len: u8,
}

impl Segment {
    /// Returns the segment, or `None` if `data` exceeds 7 bytes.
    pub fn new(toggle: bool, last: bool, data: &[u8]) -> Option<Self> {
        let len = u8::try_from(data.len()).ok().filter(|&len| usize::from(len) <= SEGMENT_MAX)?;
        let mut bytes = [0; SEGMENT_MAX];
        bytes[..data.len()].copy_from_slice(data);
        Some(Self { toggle, last, bytes, len })
    }

    /// Returns the data.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.len)]
    }

    fn encode(self, specifier: u8) -> [u8; 8] {
        let command =
            specifier | u8::from(self.toggle) << 4 | (7 - self.len) << 1 | u8::from(self.last);
        let [a, b, c, d, e, f, g] = self.bytes;
        [command, a, b, c, d, e, f, g]
    }

    fn decode(message: [u8; 8]) -> Self {
        let [command, rest @ ..] = message;
        let len = 7 - (command >> 1 & 7);
        let mut bytes = [0; SEGMENT_MAX];
        bytes[..usize::from(len)].copy_from_slice(&rest[..usize::from(len)]);
        Self { toggle: command & 0x10 != 0, last: command & 1 != 0, bytes, len }
    }
}

/// The side of a transfer that carries its data: a download of the client, an upload of the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Data {
    /// All 1 to 4 bytes of an object.
    Expedited(ObjectAddress, Expedited),
    /// Start of a segmented transfer, with the number of bytes if indicated.
    Initiate(ObjectAddress, Option<u32>),
    /// One segment of the object.
    Segment(Segment),
}

impl Data {
    fn encode(self, initiate: u8) -> [u8; 8] {
        match self {
            Self::Expedited(address, data) => {
                addressed(initiate | data.command_bits(), address, data.bytes)
            }
            Self::Initiate(address, size) => sized(initiate, address, size),
            Self::Segment(segment) => segment.encode(0x00),
        }
    }

    fn decode_initiate(message: [u8; 8]) -> Self {
        let (address, data) = split(message);
        match message[0] {
            command if command & 2 != 0 => {
                Self::Expedited(address, Expedited::decode(command, data))
            }
            command => Self::Initiate(address, indicated_size(command, data)),
        }
    }
}

/// The side of a transfer that requests or confirms data: an upload of the client, a download of
/// the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Request for, or confirmation of, the start of a transfer.
    Initiate(ObjectAddress),
    /// A segment, by its toggle bit: the next one requested, or the one confirmed.
    Segment(bool),
}

impl Turn {
    fn encode(self, initiate: u8, segment: u8) -> [u8; 8] {
        match self {
            Self::Initiate(address) => addressed(initiate, address, [0; 4]),
            Self::Segment(toggle) => [segment | u8::from(toggle) << 4, 0, 0, 0, 0, 0, 0, 0],
        }
    }
}

/// A message from client to server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoRequest {
    /// Write.
    Download(Data),
    /// Read.
    Upload(Turn),
    /// Abort.
    Abort(ObjectAddress, AbortCode),
}

/// A message from server to client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoResponse {
    /// Data of a read.
    Upload(Data),
    /// Confirmation of a write, or permission to send its segments.
    Download(Turn),
    /// Abort.
    Abort(ObjectAddress, AbortCode),
}

impl SdoRequest {
    /// Returns the message of 8 bytes.
    pub fn encode(self) -> [u8; 8] {
        match self {
            Self::Download(data) => data.encode(0x20),
            Self::Upload(turn) => turn.encode(0x40, 0x60),
            Self::Abort(address, code) => addressed(0x80, address, code.code().to_le_bytes()),
        }
    }

    /// Returns the request, or `None` if `payload` is not 8 bytes or of an unsupported service.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let message: [u8; 8] = payload.try_into().ok()?;
        Some(match message[0] >> 5 {
            0 => Self::Download(Data::Segment(Segment::decode(message))),
            1 => Self::Download(Data::decode_initiate(message)),
            2 => Self::Upload(Turn::Initiate(split(message).0)),
            3 => Self::Upload(Turn::Segment(message[0] & 0x10 != 0)),
            4 => {
                let (address, code) = abort(message);
                Self::Abort(address, code)
            }
            _ => return None,
        })
    }
}

impl SdoResponse {
    /// Returns the message of 8 bytes.
    pub fn encode(self) -> [u8; 8] {
        match self {
            Self::Upload(data) => data.encode(0x40),
            Self::Download(turn) => turn.encode(0x60, 0x20),
            Self::Abort(address, code) => addressed(0x80, address, code.code().to_le_bytes()),
        }
    }

    /// Returns the response, or `None` if `payload` is not 8 bytes or of an unsupported service.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let message: [u8; 8] = payload.try_into().ok()?;
        Some(match message[0] >> 5 {
            0 => Self::Upload(Data::Segment(Segment::decode(message))),
            1 => Self::Download(Turn::Segment(message[0] & 0x10 != 0)),
            2 => Self::Upload(Data::decode_initiate(message)),
            3 => Self::Download(Turn::Initiate(split(message).0)),
            4 => {
                let (address, code) = abort(message);
                Self::Abort(address, code)
            }
            _ => return None,
        })
    }
}

fn abort(message: [u8; 8]) -> (ObjectAddress, AbortCode) {
    let (address, code) = split(message);
    (address, AbortCode::from_code(u32::from_le_bytes(code)))
}

fn addressed(command: u8, address: ObjectAddress, data: [u8; 4]) -> [u8; 8] {
    let [low, high] = address.index.to_le_bytes();
    let [a, b, c, d] = data;
    [command, low, high, address.sub, a, b, c, d]
}

fn sized(command: u8, address: ObjectAddress, size: Option<u32>) -> [u8; 8] {
    let indicated = u8::from(size.is_some());
    addressed(command | indicated, address, size.unwrap_or(0).to_le_bytes())
}

fn indicated_size(command: u8, data: [u8; 4]) -> Option<u32> {
    (command & 1 != 0).then(|| u32::from_le_bytes(data))
}

fn split(message: [u8; 8]) -> (ObjectAddress, [u8; 4]) {
    let [_, low, high, sub, a, b, c, d] = message;
    (ObjectAddress::new(u16::from_le_bytes([low, high]), sub), [a, b, c, d])
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const STATUSWORD: ObjectAddress = ObjectAddress::new(0x6041, 0);

    #[test]
    fn known_messages_have_their_known_bytes() {
        let data = Expedited::new(&[0x34, 0x12]).unwrap();
        let table = [
            (SdoRequest::Upload(Turn::Initiate(STATUSWORD)), [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]),
            (
                SdoRequest::Download(Data::Expedited(ObjectAddress::new(0x6040, 0), data)),
                [0x2B, 0x40, 0x60, 0, 0x34, 0x12, 0, 0],
            ),
            (
                SdoRequest::Download(Data::Initiate(ObjectAddress::new(0x1008, 0), Some(10))),
                [0x21, 0x08, 0x10, 0, 10, 0, 0, 0],
            ),
            (SdoRequest::Upload(Turn::Segment(true)), [0x70, 0, 0, 0, 0, 0, 0, 0]),
        ];
        for (request, bytes) in table {
            assert_eq!(request.encode(), bytes, "{request:?}");
            assert_eq!(SdoRequest::decode(&bytes), Some(request));
        }
        let abort = SdoResponse::Abort(STATUSWORD, AbortCode::ReadOnly);
        assert_eq!(abort.encode(), [0x80, 0x41, 0x60, 0, 0x02, 0, 0x01, 0x06]);
    }

    #[test]
    fn block_transfer_and_short_frames_are_not_spoken() {
        assert_eq!(SdoRequest::decode(&[0xC6, 0, 0x10, 0, 0, 0, 0, 0]), None);
        assert_eq!(SdoRequest::decode(&[0xA0, 0, 0x10, 0, 0, 0, 0, 0]), None);
        assert_eq!(SdoRequest::decode(&[0x40, 0x41, 0x60, 0]), None);
        assert_eq!(SdoResponse::decode(&[]), None);
    }

    fn address() -> impl Strategy<Value = ObjectAddress> {
        (any::<u16>(), any::<u8>()).prop_map(|(index, sub)| ObjectAddress::new(index, sub))
    }

    fn expedited() -> impl Strategy<Value = Expedited> {
        prop::collection::vec(any::<u8>(), 1..=4).prop_map(|data| Expedited::new(&data).unwrap())
    }

    fn segment() -> impl Strategy<Value = Segment> {
        (any::<bool>(), any::<bool>(), prop::collection::vec(any::<u8>(), 0..=7))
            .prop_map(|(toggle, last, data)| Segment::new(toggle, last, &data).unwrap())
    }

    fn data() -> impl Strategy<Value = Data> {
        prop_oneof![
            (address(), expedited()).prop_map(|(a, d)| Data::Expedited(a, d)),
            (address(), any::<Option<u32>>()).prop_map(|(a, s)| Data::Initiate(a, s)),
            segment().prop_map(Data::Segment),
        ]
    }

    fn turn() -> impl Strategy<Value = Turn> {
        prop_oneof![address().prop_map(Turn::Initiate), any::<bool>().prop_map(Turn::Segment),]
    }

    fn code() -> impl Strategy<Value = AbortCode> {
        any::<u32>().prop_map(AbortCode::from_code)
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn requests_round_trip(request in prop_oneof![
            data().prop_map(SdoRequest::Download),
            turn().prop_map(SdoRequest::Upload),
            (address(), code()).prop_map(|(a, c)| SdoRequest::Abort(a, c)),
        ]) {
            prop_assert_eq!(SdoRequest::decode(&request.encode()), Some(request));
        }

        #[test]
        fn responses_round_trip(response in prop_oneof![
            data().prop_map(SdoResponse::Upload),
            turn().prop_map(SdoResponse::Download),
            (address(), code()).prop_map(|(a, c)| SdoResponse::Abort(a, c)),
        ]) {
            prop_assert_eq!(SdoResponse::decode(&response.encode()), Some(response));
        }

        #[test]
        fn garbage_never_panics_and_what_decodes_is_stable(
            payload in prop::collection::vec(any::<u8>(), 0..=8)
        ) {
            if let Some(request) = SdoRequest::decode(&payload) {
                prop_assert_eq!(SdoRequest::decode(&request.encode()), Some(request));
            }
            if let Some(response) = SdoResponse::decode(&payload) {
                prop_assert_eq!(SdoResponse::decode(&response.encode()), Some(response));
            }
        }
    }
}
