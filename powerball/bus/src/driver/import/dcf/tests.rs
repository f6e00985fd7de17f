//! Small files, and what is wrong in them.

use super::*;

const SMALL: &str = "[FileInfo]\r\nCreatedBy=M\u{fc}ller\r\n[1014]\r\nParameterName=COB-ID \
    EMCY\r\nObjectType=0x7\r\n\
    DataType=0x0007\r\nAccessType=rw\r\nDefaultValue=$NodeID + \
    0x80\r\n[1016]\r\nObjectType=0x8\r\n[1016Sub1]\r\n\
    DataType=0x0007\r\nAccessType=rw\r\nDefaultValue=0\r\nParameterValue=\r\n";

/// A peer's reader gives 0x80 for every node here: the node's number is lost.
#[test]
fn node_numbers_are_added() {
    let dcf = Dcf::parse(SMALL.as_bytes()).unwrap();
    assert_eq!(dcf.value(Object::new(0x1014, 0), 5), Some(0x85));
    assert_eq!(dcf.value(Object::new(0x1016, 1), 5), Some(0));
    assert!(!dcf.variables.contains_key(&Object::new(0x1016, 0)));
    for text in ["$NODEID+0x180", "0x180 + $NODEID", "$nodeid + 0600"] {
        assert_eq!(Number::parse(text).unwrap().of(3), 0x183, "{text}");
    }
    assert_eq!(Number::parse("-3").unwrap().of(9), -3);
    assert_eq!(Number::parse("0x").or(Number::parse("five")).or(Number::parse("")), None);
}

#[test]
fn latin_1_is_read() {
    let bytes: Vec<u8> = SMALL.chars().map(|c| c as u8).collect();
    assert!(std::str::from_utf8(&bytes).is_err());
    assert_eq!(Dcf::parse(&bytes).unwrap(), Dcf::parse(SMALL.as_bytes()).unwrap());
}

#[test]
fn errors_name_their_line() {
    let error = |text: &str| Dcf::parse(text.as_bytes()).unwrap_err();
    assert_eq!(error("[1000]\nDataType=0x7\nDefaultValue=$NODE+1\n").line, 3);
    assert_eq!(error("[1000\n").line, 1);
    assert_eq!(error("; a comment\n\nrubbish\n").line, 3);
    assert!(error("[1000]\nObjectType=7\n").message.contains("DataType"));
    assert!(error("[1000]\nDataType=7\nAccessType=rx\n").message.contains("rwr"));
}

#[test]
fn overlays_set_what_the_drive_has_and_nothing_else() {
    let mut dcf = Dcf::parse(SMALL.as_bytes()).unwrap();
    let overlay = Dcf::parse(b"[1016sub1]\nDataType=7\nParameterValue=0x10064\n").unwrap();
    dcf.overlay(&overlay).unwrap();
    assert_eq!(dcf.value(Object::new(0x1016, 1), 5), Some(0x10064));
    let foreign = Dcf::parse(b"[6071]\nDataType=3\nParameterValue=1\n").unwrap();
    assert!(dcf.overlay(&foreign).unwrap_err().message.contains("0x6071:0"));
}

/// A compact array as CiA 306 describes it, its lists before it and in other case.
const COMPACT: &str = "[1003name]\nNrOfEntries=1\n2=Older ; not the newest\n[1003VALUE]\nNrOfEntries=2\n\
    1=0x8130;text\n3=$NODEID+1\n[1003]\nParameterName=Errors\nObjectType=0x8\nDataType=0x7\nAccessType=ro\n\
    DefaultValue=7\nPDOMapping=0\nCompactSubObj=3 ; parts\n[1003Sub3]\nParameterName=Own\nDataType=0x7\n\
    DefaultValue=9\n";

#[test]
fn parts_of_a_compact_array_share_its_section() {
    let dcf = Dcf::parse(COMPACT.as_bytes()).unwrap();
    let part = |sub| &dcf.variables[&Object::new(0x1003, sub)];
    let parts: Vec<_> = (0..=3).map(|sub| (part(sub).name.as_str(), part(sub).data_type)).collect();
    assert_eq!(parts, [("NrOfObjects", 5), ("Errors1", 7), ("Older", 7), ("Own", 7)]);
    // The value goes over the default, which is that of all parts but the one with a section of its own.
    let values: Vec<_> = (0..=3).map(|sub| dcf.value(Object::new(0x1003, sub), 4).unwrap()).collect();
    assert_eq!(values, [3, 0x8130, 7, 5]);
    assert_eq!(part(3).default.as_ref().and_then(Value::number).unwrap().of(4), 9);
    assert_eq!((part(1).access, part(1).mappable), (Access::ReadOnly, false));
    assert_eq!(dcf.variables.len(), 4);
}

#[test]
fn numbers_have_the_width_and_the_sign_of_their_type() {
    for (kind, text, value) in [
        (0x0002, "0xFF", -1),
        (0x0002, "127", 127),
        (0x0005, "0xFF", 255),
        (0x0010, "0xFFFFFE", -2),
        (0x0012, "0x8000000000", -(1i128 << 39)),
        (0x0013, "0xFFFFFFFFFFFF", -1),
        (0x0014, "-3", -3),
        (0x0015, "0xFFFFFFFFFFFFFFF6", -10),
        (0x001B, "0xFFFFFFFFFFFFFFFF", i128::from(u64::MAX)),
        (0x001A, "0x80 ; comment", 128),
        (0x0003, "$NODEID-0x8000", -0x8000 + 9),
    ] {
        let number = Value::parse(kind, text).unwrap().unwrap().number().unwrap();
        assert_eq!(number.of(9), value, "{text} of type 0x{kind:04X}");
    }
}

#[test]
fn what_is_no_whole_number_is_read_by_its_type() {
    assert_eq!(Value::parse(0x0011, "-2.5e3"), Ok(Some(Value::Real(-2500.0))));
    assert_eq!(Value::parse(0x0008, "0x40490FDB"), Ok(None));
    assert_eq!(Value::parse(0x0008, "pi"), Err(value::NoNumber));
    assert_eq!(Value::parse(0x000A, "0a FF"), Ok(Some(Value::Bytes(vec![0x0A, 0xFF]))));
    assert_eq!(Value::parse(0x000F, "file.bin"), Ok(None));
    // A DOMAIN needs no data type; the type 0xA0 is one that the file defines, 0xA1 is not known.
    let text = "[1021]\nObjectType=2\n[2000]\nDataType=0x00A0\nDefaultValue=5\n[A0]\nObjectType=8\n[a0SUB1]\n\
        DataType=5\nDefaultValue=0x6\n[2001]\nDataType=0xA1\n";
    let dcf = Dcf::parse(text.as_bytes()).unwrap();
    let types: Vec<_> =
        dcf.variables.values().map(|variable| (variable.data_type, variable.bits())).collect();
    assert_eq!(types, [(0x000F, None), (0x0006, Some(16)), (0x000F, None)]);
}

#[test]
fn the_commissioned_node_and_rate_are_read_in_both_spellings() {
    for name in ["DeviceCommissioning", "DeviceComissioning", "DEVICECOMISSIONING"] {
        let dcf =
            Dcf::parse(format!("[{name}]\nNodeID=0x10 ; the third\nBaudrate=250\n").as_bytes()).unwrap();
        assert_eq!((dcf.node, dcf.bitrate), (Some(16), Some(250_000)), "{name}");
    }
    let unset = Dcf::parse(b"[DeviceCommissioning]\nNodeID=255\nBaudrate=\n").unwrap();
    assert_eq!((unset.node, unset.bitrate), (None, None));
}

#[test]
fn errors_of_lists_and_counts_name_their_line_and_key() {
    let error = |text: &str| Dcf::parse(text.as_bytes()).unwrap_err().to_string();
    for (text, expected) in [
        (
            "[1003]\nObjectType=8\nDataType=7\nCompactSubObj=255\n",
            "line 4: compactsubobj of [1003] is \"255\"",
        ),
        ("[1003Name]\nNrOfEntries=1\n1=Newest\n", "line 3: [1003Name] lists 1, which 0x1003 does not have"),
        (&COMPACT.replace("0x8130", "first"), "line 6: 1 of [1003VALUE] is \"first;text\""),
        (&COMPACT.replace("2=Older", "0=Older"), "line 3: \"0\" of [1003name] is not a sub-index"),
        ("[DeviceComissioning]\nNodeID=300\n", "line 2: nodeid of [DeviceComissioning] is \"300\"; 0 to 255"),
        ("[2000]\nDataType=0x10000\n", "line 2: datatype of [2000]"),
        ("[2000]\nDataType=7\nPDOMapping=no\n", "line 3: pdomapping of [2000]"),
    ] {
        assert!(error(text).starts_with(expected), "{}", error(text));
    }
}

/// Windows' editors save so; both orders of the bytes.
#[test]
fn utf_16_is_read() {
    let text = "[1008]\nParameterName=Geräte\nDataType=9\n";
    let read = Dcf::parse(text.as_bytes()).unwrap();
    let wide = |mark: [u8; 2], bytes: fn(u16) -> [u8; 2]| {
        let units = text.encode_utf16().flat_map(bytes);
        Dcf::parse(&mark.into_iter().chain(units).collect::<Vec<u8>>()).unwrap()
    };
    assert_eq!(read.variables.values().next().unwrap().name, "Geräte");
    assert_eq!(wide([0xFF, 0xFE], u16::to_le_bytes), read);
    assert_eq!(wide([0xFE, 0xFF], u16::to_be_bytes), read);
}
