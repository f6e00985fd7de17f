//! The drive's SDO server: expedited and segmented transfers over its dictionary.

use powerball_bus::canopen::Object;
use powerball_bus::canopen::sdo::{AbortCode, Chunk, Request, Response, Transfer};

/// Longest value that a client may write in segments.
const LONGEST: usize = 256;

/// Whose objects the server reads and writes.
pub(super) trait Objects {
    /// The bytes of an object.
    fn read(&mut self, object: Object) -> Result<Vec<u8>, AbortCode>;
    /// Writes an object.
    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode>;
}

/// A transfer in segments.
#[derive(Clone, Debug)]
enum Segments {
    Upload { object: Object, data: Vec<u8>, at: usize, toggle: bool },
    Download { object: Object, data: Vec<u8>, size: Option<u32>, toggle: bool },
}

/// The server's state between frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Server {
    segments: Option<Segments>,
}

impl Server {
    /// Answers a request; an abort of the client's is not answered.
    pub(super) fn answer(&mut self, bytes: &[u8], objects: &mut impl Objects) -> Option<Response> {
        let abort = |object, code| Some(Response::Abort { object, code });
        let Ok(request) = Request::decode(bytes) else {
            let &[_, low, high, sub, ..] = bytes else { return None };
            self.segments = None;
            return abort(Object::new(u16::from_le_bytes([low, high]), sub), AbortCode::COMMAND);
        };
        match (request, self.segments.take()) {
            (Request::Upload { object }, _) => match objects.read(object) {
                Err(code) => abort(object, code),
                Ok(data) if matches!(data.len(), 1..=4) => {
                    Some(Response::Upload { object, transfer: Transfer::Expedited(Chunk::first(&data, 4)) })
                }
                Ok(data) => {
                    let transfer = Transfer::Segmented(Some(data.len() as u32));
                    self.segments = Some(Segments::Upload { object, data, at: 0, toggle: false });
                    Some(Response::Upload { object, transfer })
                }
            },
            (Request::UploadSegment { toggle }, Some(Segments::Upload { object, data, at, toggle: due })) => {
                if toggle != due {
                    return abort(object, AbortCode::TOGGLE);
                }
                let chunk = Chunk::first(&data[at..], 7);
                let at = at + chunk.as_slice().len();
                let last = at == data.len();
                if !last {
                    self.segments = Some(Segments::Upload { object, data, at, toggle: !due });
                }
                Some(Response::UploadSegment { toggle, chunk, last })
            }
            (Request::Download { object, transfer: Transfer::Expedited(chunk) }, _) => {
                match objects.write(object, chunk.as_slice()) {
                    Ok(()) => Some(Response::Download { object }),
                    Err(code) => abort(object, code),
                }
            }
            (Request::Download { object, transfer: Transfer::Segmented(size) }, _) => {
                if size.is_some_and(|size| size as usize > LONGEST) {
                    return abort(object, AbortCode::MEMORY);
                }
                self.segments = Some(Segments::Download { object, data: Vec::new(), size, toggle: false });
                Some(Response::Download { object })
            }
            (
                Request::DownloadSegment { toggle, chunk, last },
                Some(Segments::Download { object, mut data, size, toggle: due }),
            ) => {
                data.extend(chunk.as_slice());
                if toggle != due {
                    return abort(object, AbortCode::TOGGLE);
                } else if data.len() > LONGEST {
                    return abort(object, AbortCode::MEMORY);
                } else if !last {
                    self.segments = Some(Segments::Download { object, data, size, toggle: !due });
                    return Some(Response::DownloadSegment { toggle });
                } else if size.is_some_and(|size| size as usize != data.len()) {
                    return abort(object, AbortCode::LENGTH);
                }
                match objects.write(object, &data) {
                    Ok(()) => Some(Response::DownloadSegment { toggle }),
                    Err(code) => abort(object, code),
                }
            }
            (Request::Abort { .. }, _) => None,
            // A segment without a transfer.
            _ => abort(Object::new(0, 0), AbortCode::COMMAND),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use powerball_bus::canopen::client::{Client, SdoError, Value};
    use powerball_bus::canopen::{Cob, Frame, NodeId};

    /// One object that takes anything but 13 bytes.
    #[derive(Default)]
    struct One(Vec<u8>);

    const OBJECT: Object = Object::new(0x2003, 0);

    impl Objects for One {
        fn read(&mut self, object: Object) -> Result<Vec<u8>, AbortCode> {
            if object == OBJECT { Ok(self.0.clone()) } else { Err(AbortCode::NO_OBJECT) }
        }

        fn write(&mut self, _: Object, bytes: &[u8]) -> Result<(), AbortCode> {
            if bytes.len() == 13 {
                return Err(AbortCode::VALUE);
            }
            self.0 = bytes.to_vec();
            Ok(())
        }
    }

    /// Client and server talk until the transfer is done.
    fn talk(client: &mut Client, first: Frame, one: &mut One) -> Result<Value, SdoError> {
        let (mut server, mut frame) = (Server::default(), first);
        let node = NodeId::clamped(5);
        for _ in 0..100 {
            let answer = server.answer(frame.bytes(), one).unwrap();
            let step =
                client.receive(&Frame::from_raw(Cob::SdoResponse(node).id(), &answer.encode()).unwrap(), 0);
            if let Some(done) = step.done {
                return done;
            }
            frame = step.send.unwrap();
        }
        panic!("the transfer does not end");
    }

    #[test]
    fn values_of_all_lengths_go_there_and_back() {
        for len in 1..60 {
            let (mut client, mut one) = (Client::new(NodeId::clamped(5), 1000), One::default());
            let data: Vec<u8> = (0..len).collect();
            let first = client.write(OBJECT, Value::new(&data).unwrap(), 0);
            let written = talk(&mut client, first, &mut one);
            if len == 13 {
                assert_eq!(written, Err(SdoError::Aborted(AbortCode::VALUE)));
                continue;
            }
            assert!(written.is_ok() && one.0 == data, "{len}");
            let first = client.read(OBJECT, 0);
            assert_eq!(talk(&mut client, first, &mut one).unwrap().as_slice(), data, "{len}");
        }
        let (mut client, mut one) = (Client::new(NodeId::clamped(5), 1000), One::default());
        let first = client.read(Object::new(0x6071, 0), 0);
        assert_eq!(talk(&mut client, first, &mut one), Err(SdoError::Aborted(AbortCode::NO_OBJECT)));
    }

    #[test]
    fn a_segment_out_of_turn_is_refused() {
        let (mut server, mut one) = (Server::default(), One(vec![7; 20]));
        let code = |answer: Option<Response>| match answer {
            Some(Response::Abort { code, .. }) => code,
            other => panic!("{other:?}"),
        };
        let segment = Request::UploadSegment { toggle: true }.encode();
        assert_eq!(code(server.answer(&segment, &mut one)), AbortCode::COMMAND);
        server.answer(&Request::Upload { object: OBJECT }.encode(), &mut one);
        assert_eq!(code(server.answer(&segment, &mut one)), AbortCode::TOGGLE);
        // Block upload is not known.
        assert_eq!(code(server.answer(&[0xA0, 3, 0x20, 0, 0, 0, 0, 0], &mut one)), AbortCode::COMMAND);
        assert!(server.answer(&[0x40, 3], &mut one).is_none());
    }
}
