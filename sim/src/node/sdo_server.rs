//! SDO server: answers every request, if necessary with an abort.

use ilc_rt::fieldbus::canopen::AbortCode;
use ilc_rt::fieldbus::canopen::sdo::{
    Data, Expedited, ObjectAddress, SEGMENT_MAX, SdoRequest, SdoResponse, Segment, Turn,
};

use super::value::{Encoded, TEXT_MAX, Value};

/// Objects behind the server.
pub trait Objects {
    /// Reads an object.
    ///
    /// # Errors
    /// The abort code of the answer.
    fn read(&self, address: ObjectAddress) -> Result<Value, AbortCode>;

    /// Returns a value of the type of an object, even if it cannot be read.
    ///
    /// # Errors
    /// The abort code of the answer.
    fn shape(&self, address: ObjectAddress) -> Result<Value, AbortCode>;

    /// Writes an object.
    ///
    /// # Errors
    /// The abort code of the answer.
    fn write(&mut self, address: ObjectAddress, bytes: &[u8]) -> Result<(), AbortCode>;
}

/// The transfer in progress.
#[derive(Clone, Copy, Debug)]
enum Transfer {
    None,
    Upload {
        address: ObjectAddress,
        data: Encoded,
        sent: usize,
        toggle: bool,
    },
    Download {
        address: ObjectAddress,
        buffer: [u8; TEXT_MAX],
        len: usize,
        size: Option<u32>,
        toggle: bool,
    },
}

/// The server's side of one SDO channel.
#[derive(Clone, Copy, Debug)]
pub struct SdoServer {
    transfer: Transfer,
}

impl Default for SdoServer {
    fn default() -> Self {
        Self { transfer: Transfer::None }
    }
}

impl SdoServer {
    /// Handles one request and returns the answer; an abort from the client has none.
    pub fn answer(&mut self, payload: &[u8], objects: &mut dyn Objects) -> Option<SdoResponse> {
        let Some(request) = SdoRequest::decode(payload) else {
            self.transfer = Transfer::None;
            return Some(SdoResponse::Abort(address_of(payload), AbortCode::UnknownCommand));
        };
        let (address, outcome) = match request {
            SdoRequest::Abort(..) => {
                self.transfer = Transfer::None;
                return None;
            }
            SdoRequest::Upload(Turn::Initiate(address)) => {
                (address, self.begin_upload(address, objects))
            }
            SdoRequest::Upload(Turn::Segment(toggle)) => {
                (self.address(), self.upload_segment(toggle))
            }
            SdoRequest::Download(Data::Expedited(address, data)) => {
                self.transfer = Transfer::None;
                (address, write_expedited(address, data, objects))
            }
            SdoRequest::Download(Data::Initiate(address, size)) => {
                (address, self.begin_download(address, size, objects))
            }
            SdoRequest::Download(Data::Segment(segment)) => {
                (self.address(), self.download_segment(segment, objects))
            }
        };
        Some(outcome.unwrap_or_else(|code| {
            self.transfer = Transfer::None;
            SdoResponse::Abort(address, code)
        }))
    }

    fn address(&self) -> ObjectAddress {
        match self.transfer {
            Transfer::None => ObjectAddress::new(0, 0),
            Transfer::Upload { address, .. } | Transfer::Download { address, .. } => address,
        }
    }

    fn begin_upload(
        &mut self,
        address: ObjectAddress,
        objects: &dyn Objects,
    ) -> Result<SdoResponse, AbortCode> {
        self.transfer = Transfer::None;
        let data = objects.read(address)?.encode();
        if let Some(expedited) = Expedited::new(data.as_bytes()) {
            return Ok(SdoResponse::Upload(Data::Expedited(address, expedited)));
        }
        let size = u32::try_from(data.as_bytes().len()).ok();
        self.transfer = Transfer::Upload { address, data, sent: 0, toggle: false };
        Ok(SdoResponse::Upload(Data::Initiate(address, size)))
    }

    fn upload_segment(&mut self, asked_toggle: bool) -> Result<SdoResponse, AbortCode> {
        let Transfer::Upload { data, sent, toggle, .. } = &mut self.transfer else {
            return Err(AbortCode::UnknownCommand);
        };
        if asked_toggle != *toggle {
            return Err(AbortCode::ToggleBit);
        }
        let left = &data.as_bytes()[*sent..];
        let now = &left[..left.len().min(SEGMENT_MAX)];
        let last = now.len() == left.len();
        let segment = Segment::new(*toggle, last, now).ok_or(AbortCode::General)?;
        *sent += now.len();
        *toggle = !*toggle;
        if last {
            self.transfer = Transfer::None;
        }
        Ok(SdoResponse::Upload(Data::Segment(segment)))
    }

    fn begin_download(
        &mut self,
        address: ObjectAddress,
        size: Option<u32>,
        objects: &dyn Objects,
    ) -> Result<SdoResponse, AbortCode> {
        self.transfer = Transfer::None;
        objects.shape(address)?;
        if size.is_some_and(|size| usize::try_from(size).map_or(true, |size| size > TEXT_MAX)) {
            return Err(AbortCode::TooLong);
        }
        self.transfer =
            Transfer::Download { address, buffer: [0; TEXT_MAX], len: 0, size, toggle: false };
        Ok(SdoResponse::Download(Turn::Initiate(address)))
    }

    fn download_segment(
        &mut self,
        segment: Segment,
        objects: &mut dyn Objects,
    ) -> Result<SdoResponse, AbortCode> {
        let Transfer::Download { address, buffer, len, size, toggle } = &mut self.transfer else {
            return Err(AbortCode::UnknownCommand);
        };
        if segment.toggle != *toggle {
            return Err(AbortCode::ToggleBit);
        }
        let data = segment.data();
        let place = buffer.get_mut(*len..*len + data.len()).ok_or(AbortCode::TooLong)?;
        place.copy_from_slice(data);
        *len += data.len();
        *toggle = !*toggle;
        if segment.last {
            if size.is_some_and(|size| usize::try_from(size) != Ok(*len)) {
                return Err(AbortCode::Length);
            }
            objects.write(*address, &buffer[..*len])?;
            self.transfer = Transfer::None;
        }
        Ok(SdoResponse::Download(Turn::Segment(segment.toggle)))
    }
}

/// Writes an expedited value; without a size the object's own length counts.
fn write_expedited(
    address: ObjectAddress,
    data: Expedited,
    objects: &mut dyn Objects,
) -> Result<SdoResponse, AbortCode> {
    let present = objects.shape(address)?;
    let bytes =
        if data.size_indicated() { data.data() } else { &data.data()[..present.len().min(4)] };
    objects.write(address, bytes)?;
    Ok(SdoResponse::Download(Turn::Initiate(address)))
}

/// Returns the object that a malformed request seems to name.
fn address_of(payload: &[u8]) -> ObjectAddress {
    match payload {
        &[_, low, high, sub, ..] => ObjectAddress::new(u16::from_le_bytes([low, high]), sub),
        _ => ObjectAddress::new(0, 0),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::node::value::Text;

    struct One(Value);

    impl Objects for One {
        fn read(&self, address: ObjectAddress) -> Result<Value, AbortCode> {
            if address.index == 0x2000 { Ok(self.0) } else { Err(AbortCode::NoObject) }
        }

        fn shape(&self, address: ObjectAddress) -> Result<Value, AbortCode> {
            self.read(address)
        }

        fn write(&mut self, _: ObjectAddress, bytes: &[u8]) -> Result<(), AbortCode> {
            self.0 = self.0.decode_like(bytes)?;
            Ok(())
        }
    }

    const LABEL: ObjectAddress = ObjectAddress::new(0x2000, 0);

    fn ask(server: &mut SdoServer, one: &mut One, request: SdoRequest) -> SdoResponse {
        server.answer(&request.encode(), one).unwrap()
    }

    #[test]
    fn a_repeated_toggle_aborts_the_transfer() {
        let (mut server, mut one) =
            (SdoServer::default(), One(Value::Text(Text::new(b"more than seven"))));
        ask(&mut server, &mut one, SdoRequest::Upload(Turn::Initiate(LABEL)));
        ask(&mut server, &mut one, SdoRequest::Upload(Turn::Segment(false)));
        assert_eq!(
            ask(&mut server, &mut one, SdoRequest::Upload(Turn::Segment(false))),
            SdoResponse::Abort(LABEL, AbortCode::ToggleBit)
        );
        assert!(matches!(
            ask(&mut server, &mut one, SdoRequest::Upload(Turn::Segment(true))),
            SdoResponse::Abort(_, AbortCode::UnknownCommand)
        ));
    }

    #[test]
    fn a_text_longer_than_the_object_is_refused_at_once() {
        let (mut server, mut one) = (SdoServer::default(), One(Value::Text(Text::new(b""))));
        assert_eq!(
            ask(&mut server, &mut one, SdoRequest::Download(Data::Initiate(LABEL, Some(33)))),
            SdoResponse::Abort(LABEL, AbortCode::TooLong)
        );
    }

    #[test]
    fn fewer_bytes_than_announced_write_nothing() {
        let (mut server, mut one) = (SdoServer::default(), One(Value::Text(Text::new(b"old"))));
        ask(&mut server, &mut one, SdoRequest::Download(Data::Initiate(LABEL, Some(9))));
        let segment = Segment::new(false, true, b"short").unwrap();
        assert_eq!(
            ask(&mut server, &mut one, SdoRequest::Download(Data::Segment(segment))),
            SdoResponse::Abort(LABEL, AbortCode::Length)
        );
        assert_eq!(one.0, Value::Text(Text::new(b"old")));
    }

    #[test]
    fn block_transfer_is_refused_by_name() {
        let (mut server, mut one) = (SdoServer::default(), One(Value::U8(0)));
        let answer = server.answer(&[0xC6, 0x00, 0x20, 0, 0, 0, 0, 0], &mut one);
        assert_eq!(answer, Some(SdoResponse::Abort(LABEL, AbortCode::UnknownCommand)));
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn everything_but_an_abort_is_answered(
            payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..=8), 1..40)
        ) {
            let (mut server, mut one) =
                (SdoServer::default(), One(Value::Text(Text::new(b"a text of some length"))));
            for payload in payloads {
                let is_abort = payload.len() == 8 && payload[0] >> 5 == 4;
                prop_assert_eq!(server.answer(&payload, &mut one).is_none(), is_abort);
            }
        }
    }
}
