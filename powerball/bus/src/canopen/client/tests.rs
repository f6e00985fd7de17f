//! The client against a server of its own kind, and against one that misbehaves.

use super::*;

const NODE: NodeId = NodeId::clamped(5);
const NAME: Object = Object::new(0x1008, 0);
const TIMEOUT: Micros = 50_000;

fn client() -> Client {
    Client::new(NODE, TIMEOUT)
}

fn answer(response: Response) -> Frame {
    Frame::fixed(Cob::SdoResponse(NODE).id(), response.encode())
}

fn request(frame: Frame) -> Request {
    assert_eq!(frame.raw_id(), 0x605);
    Request::decode(frame.bytes()).unwrap()
}

/// A server that holds one value.
fn serve(value: &mut Vec<u8>, at: &mut usize, asked: Request) -> Response {
    match asked {
        Request::Upload { object } => {
            *at = 0;
            let transfer = match value.len() {
                1..=4 => Transfer::Expedited(Chunk::first(value, 4)),
                len => Transfer::Segmented(Some(len as u32)),
            };
            Response::Upload { object, transfer }
        }
        Request::UploadSegment { toggle } => {
            let chunk = Chunk::first(&value[*at..], 7);
            *at += chunk.as_slice().len();
            Response::UploadSegment { toggle, chunk, last: *at == value.len() }
        }
        Request::Download { object, transfer } => {
            value.clear();
            if let Transfer::Expedited(chunk) = transfer {
                value.extend(chunk.as_slice());
            }
            Response::Download { object }
        }
        Request::DownloadSegment { toggle, chunk, .. } => {
            value.extend(chunk.as_slice());
            Response::DownloadSegment { toggle }
        }
        Request::Abort { object, code } => Response::Abort { object, code },
    }
}

#[test]
fn values_of_every_length_are_read_and_written() {
    for len in 1..=CAPACITY {
        let data: Vec<u8> = (0..len as u8).collect();
        for write in [false, true] {
            let mut server = if write { vec![] } else { data.clone() };
            let (mut at, mut client) = (0, client());
            let mut frame = match write {
                true => client.write(NAME, Value::new(&data).unwrap(), 0),
                false => client.read(NAME, 0),
            };
            let result = loop {
                let step = client.receive(&answer(serve(&mut server, &mut at, request(frame))), 1);
                if let Some(done) = step.done {
                    break done.unwrap();
                }
                frame = step.send.unwrap();
            };
            assert_eq!(server, data);
            assert_eq!(result.as_slice(), if write { &[][..] } else { &data[..] });
            assert!(client.is_idle());
        }
    }
}

#[test]
fn an_abort_is_reported_in_words() {
    let mut client = client();
    client.read(Object::new(0x6071, 0), 0);
    let abort = Response::Abort { object: Object::new(0x6071, 0), code: AbortCode::NO_OBJECT };
    let error = client.receive(&answer(abort), 1).done.unwrap().unwrap_err();
    assert_eq!(error.to_string(), "SDO abort 0x06020000: the object does not exist");
}

#[test]
fn silence_ends_with_an_abort_to_the_node() {
    let mut client = client();
    client.read(NAME, 1000);
    assert_eq!(client.poll(1000 + TIMEOUT - 1), Step::NOTHING);
    let step = client.poll(1000 + TIMEOUT);
    assert_eq!(step.done, Some(Err(SdoError::Timeout)));
    assert_eq!(request(step.send.unwrap()), Request::Abort { object: NAME, code: AbortCode::TIMEOUT });
    assert_eq!(client.poll(u64::MAX), Step::NOTHING);
}

/// An answer doubled by the bus must not be taken for the next segment.
#[test]
fn a_doubled_segment_is_a_toggle_error() {
    let mut client = client();
    client.read(NAME, 0);
    client.receive(&answer(Response::Upload { object: NAME, transfer: Transfer::Segmented(None) }), 1);
    let segment = Response::UploadSegment { toggle: false, chunk: Chunk::first(b"0123456", 7), last: false };
    assert_eq!(client.receive(&answer(segment), 2).done, None);
    let step = client.receive(&answer(segment), 3);
    assert_eq!(step.done, Some(Err(SdoError::Protocol(AbortCode::TOGGLE))));
    assert!(step.send.is_some());
}

/// The answer to a transfer that was given up must not end the next one.
#[test]
fn late_answers_for_other_objects_are_ignored() {
    let mut client = client();
    client.read(NAME, 0);
    let late = Response::Upload {
        object: Object::new(0x1000, 0),
        transfer: Transfer::Expedited(Chunk::first(&[1], 4)),
    };
    assert_eq!(client.receive(&answer(late), 1), Step::NOTHING);
    let abort = Response::Abort { object: Object::new(0x1000, 0), code: AbortCode::GENERAL };
    assert_eq!(client.receive(&answer(abort), 1), Step::NOTHING);
    assert!(!client.is_idle());
}

#[test]
fn a_wrong_size_and_a_value_too_long_are_errors() {
    let mut client = client();
    client.read(NAME, 0);
    client.receive(&answer(Response::Upload { object: NAME, transfer: Transfer::Segmented(Some(5)) }), 1);
    let segment = Response::UploadSegment { toggle: false, chunk: Chunk::first(b"0123", 7), last: true };
    assert_eq!(client.receive(&answer(segment), 2).done, Some(Err(SdoError::Protocol(AbortCode::LENGTH))));
    client.read(NAME, 0);
    let long = Response::Upload { object: NAME, transfer: Transfer::Segmented(Some(1000)) };
    assert_eq!(client.receive(&answer(long), 1).done, Some(Err(SdoError::Protocol(AbortCode::MEMORY))));
}

#[test]
fn frames_of_others_do_nothing() {
    let mut client = client();
    client.read(NAME, 0);
    let other = Frame::fixed(0x586, Response::Download { object: NAME }.encode());
    assert_eq!(client.receive(&other, 1), Step::NOTHING);
}
