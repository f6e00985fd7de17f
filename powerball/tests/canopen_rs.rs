//! The codecs and the SDO client against `canopen-rs`, written by others: what one end writes the other must
//! read.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test's helpers may stop the test")]

use canopen_rs::{Address, DataType, Entry, ObjectDictionary, Value as Theirs};
use canopen_rs::{emcy, nmt as theirs, pdo as their_pdo, sdo as their_sdo};
use powerball::bus::canopen::client::{Client, SdoError, Value};
use powerball::bus::canopen::emcy::Emcy;
use powerball::bus::canopen::pdo::{self, Mapping};
use powerball::bus::canopen::sdo::{AbortCode, Chunk, Request, Response, Transfer};
use powerball::bus::canopen::{Cob, Frame, NodeId, Object, nmt};

const NODE: u8 = 5;

fn ours() -> NodeId {
    NodeId::new(NODE).unwrap()
}

fn their_node() -> canopen_rs::NodeId {
    canopen_rs::NodeId::new(NODE).unwrap()
}

fn dictionary() -> ObjectDictionary<16> {
    let mut dictionary = ObjectDictionary::new();
    let mut add = |index, sub, entry| dictionary.insert(Address::new(index, sub), entry).unwrap();
    add(0x1000, 0, Entry::constant(Theirs::Unsigned32(0x0002_0192)));
    add(0x1017, 0, Entry::rw(Theirs::Unsigned16(100)));
    add(0x6041, 0, Entry::ro(Theirs::Unsigned16(0x1237)));
    add(0x6060, 0, Entry::rw(Theirs::Integer8(-1)));
    add(0x6064, 0, Entry::rw(Theirs::Integer32(-170_000)));
    add(0x6077, 0, Entry::rw(Theirs::Integer16(-5)));
    let name = canopen_rs::ByteString::from_str("Powerball ERB 145").unwrap();
    add(0x1008, 0, Entry::constant(Theirs::VisibleString(name)));
    add(0x2003, 0, Entry::rw(Theirs::VisibleString(canopen_rs::ByteString::from_str("x").unwrap())));
    dictionary
}

/// Our client with their server, until the transfer ends.
fn transfer(
    od: &mut ObjectDictionary<16>,
    first: impl FnOnce(&mut Client) -> Frame,
) -> Result<Value, SdoError> {
    let (mut client, mut server) = (Client::new(ours(), 1000), their_sdo::SdoServer::new(their_node()));
    let mut frame = first(&mut client);
    loop {
        assert_eq!(frame.raw_id(), server.request_cob_id());
        let request = frame.bytes().try_into().unwrap();
        let answer = server.handle(od, &request).expect("an answer");
        let step = client.receive(&Frame::from_raw(server.response_cob_id(), &answer).unwrap(), 1);
        match (step.done, step.send) {
            (Some(done), _) => return done,
            (None, Some(next)) => frame = next,
            (None, None) => panic!("stuck after {answer:02X?}"),
        }
    }
}

#[test]
fn our_client_reads_and_writes_their_server() {
    let mut od = dictionary();
    let read = |od: &mut _, index| transfer(od, |client| client.read(Object::new(index, 0), 0));
    assert_eq!(read(&mut od, 0x1000).unwrap().unsigned(), Some(0x0002_0192));
    assert_eq!(read(&mut od, 0x6060).unwrap().signed(), Some(-1));
    assert_eq!(read(&mut od, 0x6064).unwrap().signed(), Some(-170_000));
    assert_eq!(read(&mut od, 0x1008).unwrap().as_slice(), b"Powerball ERB 145");
    let write =
        |od: &mut _, index, value| transfer(od, |client| client.write(Object::new(index, 0), value, 0));
    write(&mut od, 0x1017, Value::number(250, 2)).unwrap();
    assert_eq!(od.read(Address::new(0x1017, 0)), Ok(Theirs::Unsigned16(250)));
    let text = b"twenty-one characters";
    write(&mut od, 0x2003, Value::new(text).unwrap()).unwrap();
    let Ok(Theirs::VisibleString(stored)) = od.read(Address::new(0x2003, 0)) else { panic!() };
    assert_eq!(stored.as_bytes(), text);
}

#[test]
fn their_aborts_are_ours() {
    let mut od = dictionary();
    let aborted = |result: Result<Value, SdoError>| match result {
        Err(SdoError::Aborted(code)) => code,
        other => panic!("{other:?}"),
    };
    let missing = transfer(&mut od, |client| client.read(Object::new(0x6071, 0), 0));
    assert_eq!(aborted(missing), AbortCode::NO_OBJECT);
    let constant = transfer(&mut od, |client| client.write(Object::new(0x1000, 0), Value::number(1, 4), 0));
    assert_eq!(aborted(constant), AbortCode::READ_ONLY);
}

/// The other crate's client with a server made of our codecs.
#[test]
fn their_client_reads_and_writes_what_we_encode() {
    let text = b"a name that needs segments";
    let mut client = their_sdo::SdoClient::new(their_node());
    let mut request = client.read(Address::new(0x1008, 0), DataType::VisibleString);
    let mut sent = 0;
    let read = loop {
        let answer = match Request::decode(&request).unwrap() {
            Request::Upload { object } => {
                Response::Upload { object, transfer: Transfer::Segmented(Some(text.len() as u32)) }
            }
            Request::UploadSegment { toggle } => {
                let chunk = Chunk::first(&text[sent..], 7);
                sent += chunk.as_slice().len();
                Response::UploadSegment { toggle, chunk, last: sent == text.len() }
            }
            other => panic!("{other:?}"),
        };
        match client.on_response(&answer.encode()) {
            their_sdo::SdoEvent::Send(next) => request = next,
            their_sdo::SdoEvent::Complete(value) => break value,
            their_sdo::SdoEvent::Aborted(code) => panic!("{code:08X}"),
        }
    };
    let Some(Theirs::VisibleString(read)) = read else { panic!() };
    assert_eq!(read.as_bytes(), text);

    let request = client.write(Address::new(0x6064, 0), Theirs::Integer32(-7));
    let Ok(Request::Download { object, transfer: Transfer::Expedited(chunk) }) = Request::decode(&request)
    else {
        panic!()
    };
    assert_eq!((object, chunk.as_slice()), (Object::new(0x6064, 0), &(-7i32).to_le_bytes()[..]));
    let refused = Response::Abort { object, code: AbortCode::VALUE };
    assert_eq!(client.on_response(&refused.encode()), their_sdo::SdoEvent::Aborted(AbortCode::VALUE.0));
}

#[test]
fn network_management_and_heartbeats_agree() {
    let pairs = [
        (nmt::Command::Start, theirs::NmtCommand::StartRemoteNode),
        (nmt::Command::Stop, theirs::NmtCommand::StopRemoteNode),
        (nmt::Command::EnterPreOperational, theirs::NmtCommand::EnterPreOperational),
        (nmt::Command::ResetNode, theirs::NmtCommand::ResetNode),
        (nmt::Command::ResetCommunication, theirs::NmtCommand::ResetCommunication),
    ];
    for (our, their) in pairs {
        for (target, their_target) in [(Some(ours()), their_node()), (None, canopen_rs::NodeId::BROADCAST)] {
            let frame = our.frame(target);
            assert_eq!(frame.raw_id(), theirs::NMT_COMMAND_COB_ID);
            assert_eq!(frame.bytes(), theirs::encode_command(their, their_target));
        }
    }
    let states = [
        (nmt::State::Stopped, theirs::NmtState::Stopped),
        (nmt::State::Operational, theirs::NmtState::Operational),
        (nmt::State::PreOperational, theirs::NmtState::PreOperational),
    ];
    for (our, their) in states {
        let frame = our.frame(ours());
        assert_eq!(frame.raw_id(), theirs::heartbeat_cob_id(their_node()));
        assert_eq!(frame.bytes(), theirs::encode_heartbeat(their));
    }
    assert_eq!(nmt::State::BootUp.frame(ours()).bytes(), theirs::BOOTUP_FRAME);
}

#[test]
fn emergencies_agree() {
    let their = emcy::EmergencyMessage::new(0x3222, emcy::ErrorRegister(0x05), [0x74, 1, 2, 3, 4]);
    let our = Emcy { code: 0x3222, register: 0x05, vendor: [0x74, 1, 2, 3, 4] };
    let frame = our.frame(ours());
    assert_eq!((frame.raw_id(), frame.bytes()), (emcy::emcy_cob_id(their_node()), &their.encode()[..]));
    let decoded = emcy::EmergencyMessage::decode(frame.bytes()).unwrap();
    assert_eq!(decoded, their);
}

#[test]
fn process_data_agree() {
    let objects = [(0x6041, 16u8), (0x6077, 16), (0x6064, 32)];
    let entries = objects.map(|(index, bits)| pdo::Entry::new(Object::new(index, 0), bits));
    let our = Mapping::new(&entries).unwrap();
    let mut their = their_pdo::PdoMapping::<8>::new();
    for (index, bits) in objects {
        their.push(their_pdo::MappingEntry::new(index, 0, bits)).unwrap();
    }
    let raw: Vec<u32> = their.entries().iter().map(|entry| entry.to_u32()).collect();
    assert_eq!(our.entries().iter().map(|entry| entry.to_u32()).collect::<Vec<_>>(), raw);

    let mut buffer = [0; 8];
    let len = their_pdo::pack(&their, &dictionary(), &mut buffer).unwrap();
    let values: Vec<i32> =
        our.unpack(&buffer[..len]).unwrap().map(|(entry, raw)| pdo::sign_extend(raw, entry.bits)).collect();
    assert_eq!(values, [0x1237, -5, -170_000]);
    let (packed, ours_len) = our.pack(|object| match object.index {
        0x6041 => 0x1237,
        0x6077 => -5,
        _ => -170_000,
    });
    assert_eq!((packed, ours_len), (buffer, len));

    for (k, kind) in [(1, their_pdo::PdoKind::Transmit), (4, their_pdo::PdoKind::Transmit)] {
        assert_eq!(Some(Cob::Tpdo(k, ours()).id()), their_pdo::default_cob_id(kind, k, their_node()));
    }
    for k in 1..=4 {
        let kind = their_pdo::PdoKind::Receive;
        assert_eq!(Some(Cob::Rpdo(k, ours()).id()), their_pdo::default_cob_id(kind, k, their_node()));
    }
    assert_eq!(pdo::INVALID, their_pdo::PDO_COB_ID_INVALID);
}
