use super::*;
use std::io::Write;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// An `.npy` file as NumPy writes it, header version 1.
fn npy(kind: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}");
    while !(10 + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn archive(method: CompressionMethod, members: &[(&str, Vec<u8>)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let mut zip = ZipWriter::new(File::create(&path).unwrap());
    for (name, bytes) in members {
        let options = SimpleFileOptions::default().compression_method(method);
        zip.start_file(format!("{name}.npy"), options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
    (folder, path)
}

#[test]
fn reads_every_width_order_and_byte_order_stored_and_deflated() {
    // The matrix [[1, 2, 3], [4, 5, 6]].
    let c = [1u8, 2, 3, 4, 5, 6];
    let f = [1u8, 4, 2, 5, 3, 6];
    let wide = |values: &[u8], convert: &dyn Fn(u8) -> Vec<u8>| {
        values.iter().flat_map(|x| convert(*x)).collect::<Vec<u8>>()
    };
    let cases: Vec<(&str, bool, Vec<u8>)> = vec![
        ("|i1", false, c.to_vec()),
        ("|u1", true, f.to_vec()),
        ("<i2", true, wide(&f, &|x| i16::from(x).to_le_bytes().to_vec())),
        (">u4", false, wide(&c, &|x| u32::from(x).to_be_bytes().to_vec())),
        ("<i8", false, wide(&c, &|x| i64::from(x).to_le_bytes().to_vec())),
        ("<f4", true, wide(&f, &|x| f32::from(x).to_le_bytes().to_vec())),
        (">f8", true, wide(&f, &|x| f64::from(x).to_be_bytes().to_vec())),
        ("<f8", false, wide(&c, &|x| f64::from(x).to_le_bytes().to_vec())),
    ];
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        for (kind, fortran, data) in &cases {
            let (_folder, path) = archive(method, &[("m", npy(kind, *fortran, "(2, 3)", data))]);
            let array = NpzFile::open(&path).unwrap().numbers("m", "").unwrap();
            assert_eq!(
                array,
                Array { shape: vec![2, 3], data: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0] },
                "{kind}"
            );
        }
    }
}

#[test]
fn fortran_order_holds_in_three_dimensions() {
    // Element (i, j, k) of shape (2, 3, 4) has the value 100 i + 10 j + k.
    let mut data = Vec::new();
    for k in 0..4 {
        for j in 0..3 {
            for i in 0..2 {
                data.extend(((100 * i + 10 * j + k) as f32).to_le_bytes());
            }
        }
    }
    let (_folder, path) =
        archive(CompressionMethod::Deflated, &[("a", npy("<f4", true, "(2, 3, 4)", &data))]);
    let array = NpzFile::open(&path).unwrap().numbers_f32("a", "").unwrap();
    for (at, x) in array.data.iter().enumerate() {
        assert_eq!(*x, (100 * (at / 12) + 10 * (at / 4 % 3) + at % 4) as f32);
    }
}

#[test]
fn half_floats_have_their_ieee_values() {
    let cells = [
        (0x3c00u16, 1.0),
        (0xc000, -2.0),
        (0x3555, 0.333251953125),
        (0x0001, 2f64.powi(-24)),
        (0x7bff, 65504.0),
    ];
    let data: Vec<u8> = cells.iter().flat_map(|(bits, _)| bits.to_le_bytes()).collect();
    let (_folder, path) = archive(CompressionMethod::Stored, &[("a", npy("<f2", false, "(5,)", &data))]);
    let array = NpzFile::open(&path).unwrap().numbers("a", "").unwrap();
    assert_eq!(array.data, cells.map(|(_, value)| value));
}

#[test]
fn writer_and_reader_agree() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("w.npz");
    let mut npz = NpzWriter::new();
    npz.f32("a", &[2, 2], &[1.0, 2.0, 3.0, 4.0]).f64("s", &[], &[2.5]).u32("u", &[3], &[0, 7, u32::MAX]);
    npz.i64("i", &[1], &[-9]).strings("t", &[2], &["ab", "Zoë"]).f64("e", &[0, 3], &[]);
    npz.save(&path).unwrap();
    let mut file = NpzFile::open(&path).unwrap();
    assert_eq!(file.keys(), ["a", "e", "i", "s", "t", "u"]);
    assert_eq!(file.numbers("a", "").unwrap(), Array { shape: vec![2, 2], data: vec![1.0, 2.0, 3.0, 4.0] });
    assert_eq!(file.numbers("s", "").unwrap(), Array { shape: vec![], data: vec![2.5] });
    assert_eq!(file.numbers("u", "").unwrap().data, [0.0, 7.0, f64::from(u32::MAX)]);
    assert_eq!(file.numbers("i", "").unwrap().data, [-9.0]);
    assert_eq!(file.strings("t", "").unwrap().data, ["ab", "Zoë"]);
    assert_eq!(file.numbers("e", "").unwrap().shape, [0, 3]);
    let mut wrong = NpzWriter::new();
    wrong.f32("a", &[3], &[1.0]);
    assert!(wrong.save(&path).unwrap_err().to_string().contains("1 values for shape [3]"));
}

#[test]
fn pickles_are_listed_but_never_read_and_damage_is_named() {
    let members = [
        ("joint2num", npy("|O", false, "()", b"\x80\x04}.")),
        ("short", npy("<f8", false, "(4,)", &[0; 16])),
        ("huge", npy("<f8", false, "(4611686018427387904, 4)", &[0; 16])),
        ("text", npy("<U2", false, "(1,)", &[97, 0, 0, 0, 0, 0, 0, 0])),
        ("bytes", npy("|S6", false, "()", b"female")),
        ("wide", npy("|S20000000", false, "()", b"female")),
        ("void", npy("|V600000000", false, "()", b"female")),
        ("junk", b"not an array".to_vec()),
    ];
    let (_folder, path) = archive(CompressionMethod::Stored, &members);
    let mut file = NpzFile::open(&path).unwrap();
    let message = file.numbers("joint2num", "").unwrap_err().to_string();
    assert!(message.contains("pickle") && message.contains("joint2num"), "{message}");
    assert!(file.numbers("short", "").unwrap_err().to_string().contains("truncated: 16 of 32"));
    assert!(file.numbers("huge", "").is_err());
    // What claims to be too large is not even begun.
    for key in ["wide", "void"] {
        let message = file.strings(key, "").unwrap_err().to_string();
        assert!(message.contains(key) && message.contains("does not fit in memory"), "{message}");
    }
    assert!(file.numbers("text", "").unwrap_err().to_string().contains("<U2"));
    assert!(file.numbers("junk", "").unwrap_err().to_string().contains("'junk'"));
    assert_eq!(file.strings("text", "").unwrap().data, ["a"]);
    assert_eq!(file.strings("bytes", "").unwrap().data, ["female"]);
    let missing = file.numbers("v_template", "a body is …").unwrap_err().to_string();
    assert!(missing.contains("'v_template'") && missing.contains("a body is …") && missing.contains("short"));
}

#[test]
fn headers_that_would_exhaust_memory_or_stack_are_refused() {
    let deep = npy("<f8", false, &"(".repeat(5000), b"");
    let bomb = npy("|u1", false, "(4294967296,)", &[0; 64]);
    let mut long = b"\x93NUMPY\x02\x00".to_vec();
    long.extend(u32::MAX.to_le_bytes());
    let members =
        [("deep", deep), ("bomb", bomb), ("long", long), ("object", npy("|O", false, "()", b"\x80\x04}."))];
    let (_folder, path) = archive(CompressionMethod::Deflated, &members);
    let mut file = NpzFile::open(&path).unwrap();
    for (key, part) in [("deep", "nested"), ("bomb", "does not fit in memory"), ("long", "not a NumPy array")]
    {
        let message = file.numbers(key, "").unwrap_err().to_string();
        assert!(message.contains(&format!("'{key}'")) && message.contains(part), "{message}");
        assert!(!file.is_pickled(key));
    }
    assert!(file.is_pickled("object") && !file.is_pickled("absent"));
    assert_eq!(file.shape("bomb").unwrap(), [1 << 32]);
    assert!(file.shape("absent").is_err());
}
