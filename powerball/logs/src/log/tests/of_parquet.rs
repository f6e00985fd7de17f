//! Logs in Parquet say the same as in CSV.

use super::*;

/// Parquet with these columns of doubles; NaN stands for a missing value.
fn parquet_of(csv: &str) -> Vec<u8> {
    use parquet::data_type::DoubleType;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    use std::sync::Arc;

    let mut lines = csv.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<Option<f64>>> = lines.map(|l| l.split(',').map(|x| x.parse().ok()).collect()).collect();
    let fields: String = names.iter().map(|n| format!("OPTIONAL DOUBLE {n};")).collect();
    let schema = Arc::new(parse_message_type(&format!("message log {{ {fields} }}")).unwrap());
    let properties = WriterProperties::builder().set_compression(parquet::basic::Compression::SNAPPY).build();
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties)).unwrap();
    let mut group = writer.next_row_group().unwrap();
    for k in 0..names.len() {
        let levels: Vec<i16> = rows.iter().map(|r| i16::from(r[k].is_some())).collect();
        let values: Vec<f64> = rows.iter().filter_map(|r| r[k]).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&values, Some(&levels), None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
    bytes
}

#[test]
fn parquet_says_the_same_as_csv() {
    // One value is missing in line 50.
    let csv = text("t,q1,q2,tau1,tau2", |k, mut fields| {
        if k == 50 {
            fields[3] = "nothing".into();
        }
        Some(fields[..5].join(","))
    });
    let (mut of_csv, mut of_parquet) = (Vec::new(), Vec::new());
    let a = parse(csv.as_bytes(), "log", &arm(), &mut of_csv).unwrap();
    let b = parse(&parquet_of(&csv), "log", &arm(), &mut of_parquet).unwrap();
    assert_eq!((a.t, a.q, a.torque, a.pieces), (b.t, b.q, b.torque, b.pieces));
    let messages = |f: &[Finding]| f.iter().map(|f| f.message.clone()).collect::<Vec<_>>();
    assert_eq!(messages(&of_csv), messages(&of_parquet));
    // Row 51 is line 52.
    assert_eq!((of_csv[0].line, of_parquet[0].line), (Some(52), Some(51)));
    let missing = parse(&parquet_of("t,q1,q2,tau1\n0,0,0,0\n"), "log", &arm(), &mut of_parquet);
    assert!(missing.unwrap_err().to_string().contains("missing: tau2"));
    let torn = parse(&parquet_of(&csv)[..500], "torn.parquet", &arm(), &mut of_parquet);
    assert!(torn.unwrap_err().to_string().contains("torn.parquet: Parquet: cannot be read"));
}

/// What pyarrow wrote (`tests/data/README.md`), in both versions of data pages, with a dictionary and a
/// missing value.
#[test]
fn columns_compressed_with_zstandard_are_read() {
    for file in [
        include_bytes!("../../../../../tests/data/zstd_v1.parquet").as_slice(),
        include_bytes!("../../../../../tests/data/zstd_v2.parquet"),
    ] {
        let mut findings = Vec::new();
        let log = parse(file, "zstd.parquet", &arm(), &mut findings).unwrap();
        assert_eq!(log.t.len(), 299);
        for (k, t) in log.t.iter().enumerate() {
            let row = if k < 50 { k } else { k + 1 };
            assert_eq!(*t, row as f64 * 0.004);
            assert!((log.q[0][k] - 0.5 * (1.3 * t).sin()).abs() < 1e-15);
            assert!((log.torque[0][k] - 3.0 * t.cos()).abs() < 1e-15);
            assert_eq!(log.torque[1][k], (row / 20) as f64);
        }
        assert!(findings.iter().any(|f| f.message.contains("note")), "{findings:?}");
        // Cut or damaged anywhere, the file is refused or read, and nothing panics.
        for end in (0..file.len()).step_by(97) {
            let _ = parse(&file[..end], "torn.parquet", &arm(), &mut Vec::new());
            let mut damaged = file.to_vec();
            damaged[end] ^= 0x55;
            let _ = parse(&damaged, "damaged.parquet", &arm(), &mut Vec::new());
        }
    }
}
