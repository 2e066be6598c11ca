use super::*;
use crate::base::mesh_data::MeshMaterial;
use glam::DVec3;

fn read(bytes: impl AsRef<[u8]>) -> Result<MeshData> {
    parse(Path::new("a.ply"), bytes.as_ref())
}

fn message(bytes: impl AsRef<[u8]>) -> String {
    read(bytes).unwrap_err().to_string()
}

const VERTEX: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
const FACE: &str = "property list uchar int vertex_indices\nend_header\n";
const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

fn square(faces: usize, lines: &str) -> String {
    format!("ply\nformat ascii 1.0\n{VERTEX}element face {faces}\n{FACE}{SQUARE}{lines}")
}

/// A binary file with every kind of number and with properties and elements to be skipped.
fn binary(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut out = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement camera 1\nproperty double f\nproperty list ushort short l\n\
         element face 2\nproperty uchar flag\nproperty list ushort uint vertex_index\nproperty short group\n\
         element vertex 5\nproperty double x\nproperty char c\nproperty short y\nproperty int z\n\
         property float nx\nproperty double ny\nproperty float nz\nproperty float texture_u\nproperty float texture_v\n\
         end_header\n"
    )
    .into_bytes();
    let mut put = |bytes: &[u8]| if big { out.extend(bytes.iter().rev()) } else { out.extend(bytes) };
    put(&1.5f64.to_le_bytes());
    put(&2u16.to_le_bytes());
    put(&(-7i16).to_le_bytes());
    put(&9i16.to_le_bytes());
    for face in [&[0u32, 1, 2][..], &[0, 2, 3, 4]] {
        put(&[9]);
        put(&(face.len() as u16).to_le_bytes());
        face.iter().for_each(|i| put(&i.to_le_bytes()));
        put(&(-1i16).to_le_bytes());
    }
    for (x, y, z) in [(4e6 + 0.125, -3i16, 70_000i32), (0.0, 1, 2), (1.0, 1, 2), (1.0, 5, 2), (0.5, 7, 2)] {
        put(&f64::to_le_bytes(x));
        put(&[0xff]);
        put(&y.to_le_bytes());
        put(&z.to_le_bytes());
        put(&0f32.to_le_bytes());
        put(&1f64.to_le_bytes());
        put(&0f32.to_le_bytes());
        put(&0.25f32.to_le_bytes());
        put(&(x as f32).to_le_bytes());
    }
    out
}

#[test]
fn ascii_faces_become_triangles() {
    let mesh = read(square(2, "3 0 1 2\n4 0 1 2 3\n")).unwrap();
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
    let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    assert_eq!(mesh.positions, Positions::F32(corners));
    assert_eq!(mesh.repairs, Repairs { triangulated: 1, ..Repairs::default() });
    assert!(mesh.normals.is_empty() && mesh.uvs.is_empty());
}

#[test]
fn a_concave_face_is_not_fanned() {
    // A dart whose corner 1 is reflex: the fan from corner 0 would cover the notch.
    let text = square(1, "4 0 1 2 3\n").replace("1 0 0\n1 1 0", "0.4 0.6 0\n1 1 0");
    assert_eq!(read(text).unwrap().indices, [[1, 2, 3], [1, 3, 0]]);
}

#[test]
fn words_need_not_stand_in_lines() {
    let want = read(square(2, "3 0 1 2\n4 0 1 2 3\n")).unwrap();
    let (head, body) = (square(2, "").replace(SQUARE, ""), SQUARE.to_string() + "3 0 1 2\n4 0 1 2 3");
    for body in [
        body.clone(),
        body.clone() + "\n\n\n",
        body.replace('\n', "\r\n"),
        body.replace('\n', " "),
        body.replace(' ', "\n"),
        body.replace(' ', " \t "),
        body.replace("1 0 0", "+1.0 0e7 -0"),
        format!("\n{body}\n"),
    ] {
        assert_eq!(read(head.clone() + &body).unwrap().indices, want.indices, "{body:?}");
    }
}

#[test]
fn both_byte_orders_and_all_types_read_alike() {
    let little = read(binary(false)).unwrap();
    assert_eq!(little.indices, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    assert_eq!(little.positions.get(0), DVec3::new(4e6 + 0.125, -3.0, 70_000.0));
    assert_eq!(little.normals, [[0.0, 1.0, 0.0]; 5]);
    assert_eq!(little.uvs[2], [0.25, 1.0]);
    assert_eq!(read(binary(true)).unwrap(), little);
}

#[test]
fn every_cut_of_a_binary_file_is_an_error() {
    for big in [false, true] {
        let whole = binary(big);
        for length in 0..whole.len() {
            assert_eq!(read(&whole[..length]).unwrap_err().exit_code(), 2, "{length} bytes");
        }
    }
}

#[test]
fn every_cut_of_an_ascii_file_is_an_error_or_a_valid_mesh() {
    let whole = square(3, "3 0 1 2\n4 0 1 2 3\n4 3 2 1 0\n");
    for length in 0..whole.trim_end().len() - 1 {
        assert!(read(&whole[..length]).is_err(), "{length} bytes");
    }
}

#[test]
fn errors_name_the_line_and_what_is_wrong() {
    let cases = [
        (square(2, "3 0 1 2\n3 0 1 4\n"), "a.ply:15: face 1 of 2: there is no vertex 4; the file has 4"),
        (square(1, "3 0 1 -1\n"), "a.ply:14: face 0 of 1: there is no vertex -1"),
        (square(1, "3 0 1 x2\n"), "a.ply:14: face 0 of 1: \"x2\" is no number"),
        (square(1, "3 0 1 2\n").replace("1 1 0", "1 1,5 0"), "a.ply:12: vertex 2 of 4: \"1,5\" is no number"),
        (square(2, "3 0 1 2\n"), "face 1 of 2: the file is cut short"),
        (square(1, "-3 0 1 2\n"), "-3 is no length of the list vertex_indices"),
        (square(1, "2.5 0 1 2\n"), "2.5 is no length"),
        (square(1, "4000000000 0 1 2\n"), "goes beyond the end"),
        (square(1, "2 0 1\n"), "none of its faces has three corners"),
        (square(0, ""), "4 points and no faces"),
        (
            square(1, "3 0 1 2").replace("vertex_indices", "vertices"),
            "neither vertex_indices nor vertex_index",
        ),
        (square(1, "3 0 1 2").replace("float z", "float w"), "lacks x, y or z"),
        (
            square(1, "3 0 1 2").replace("element face", "element vertex 1\nproperty int i\nelement face"),
            "two vertex elements",
        ),
        (
            square(1, "3 0 1 2")
                .replace("end_header", "element face 0\nproperty list uchar int i\nend_header"),
            "two face elements",
        ),
        (square(1, "3 0 1 2").replace("int vertex_ind", "float vertex_ind"), "no list of integers"),
        ("ply\nformat ascii 1.0\nend_header\n".to_string(), "no vertex element"),
    ];
    for (text, want) in cases {
        let got = message(&text);
        assert!(got.contains(want), "{got}\nwanted {want}");
    }
}

#[test]
fn damaged_binary_faces_are_refused() {
    let head = |length, item| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\n\
             property float z\nelement face 1\nproperty list {length} {item} vertex_indices\nend_header\n"
        )
    };
    let face = |length, item, bytes: &[u8]| message([head(length, item).as_bytes(), bytes].concat());
    let three = |index: i32| [&[3u8][..], &[index.to_le_bytes(); 3].concat()].concat();
    assert!(face("uchar", "int", &three(7)).contains("there is no vertex 7; the file has 0"));
    assert!(face("uchar", "int", &three(-2)).contains("there is no vertex -2"));
    assert!(face("uchar", "uint", &three(-2)).contains("there is no vertex 4294967294"));
    assert!(face("uchar", "char", &[3, 0xff, 0, 0]).contains("there is no vertex -1"));
    assert!(face("char", "int", &[0xff, 0, 0]).contains("-1 is no length of a list"));
    assert!(face("uint", "int", &[0xff; 8]).contains("cut short"));
}

#[test]
fn far_away_coordinates_in_text_keep_their_digits() {
    let near = square(1, "4 0 1 2 3");
    assert!(matches!(read(&near).unwrap().positions, Positions::F32(_)));
    let far = near.replace(SQUARE, "4512345.125 0 0\n4512346.125 0.1 0\n4512346.125 1 0\n4512345.125 1 0\n");
    // Also by the reader of words, which an empty line calls.
    for text in [far.clone(), far.replace("end_header\n", "end_header\n\n")] {
        assert_eq!(read(&text).unwrap().positions.get(1), DVec3::new(4_512_346.125, 0.1, 0.0));
    }
}

#[test]
fn numbers_that_are_none_stay_in_positions_and_are_mended_in_normals() {
    let text = square(2, "3 0 1 2\n3 1 2 3")
        .replace("float z\n", "float z\nproperty float nx\nproperty float ny\nproperty float nz\n")
        .replace(SQUARE, "nan inf -1.#IND 0 0 0\n1 0 0 0 0 2\n1 1 0 -nan(ind) 0 1\n0 1 0 0 0 1\n");
    let mesh = read(text).unwrap();
    assert!(mesh.positions.get(0).is_nan() && mesh.positions.get(0).y == f64::INFINITY);
    assert_eq!(mesh.normals[1], [0.0, 0.0, 2.0], "normals need not have length 1");
    assert_eq!(mesh.normals[2], [0.0, 0.0, 1.0]);
    assert_eq!(mesh.repairs.bad_normals, 2);
}

#[test]
fn corners_with_different_texture_coordinates_are_split() {
    let text = square(3, "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 .5 1 0 1\n3 0 2 3 0\n")
        .replace("indices\nend_header", "indices\nproperty list uchar float texcoord\nend_header");
    let mesh = read(text).unwrap();
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 3, 4], [0, 5, 6]]);
    assert_eq!(mesh.positions.get(2), mesh.positions.get(3));
    assert_eq!(mesh.uvs[2..5], [[1.0, 1.0], [0.5, 1.0], [0.0, 1.0]]);
    assert_eq!(mesh.repairs.bad_attributes, 1);
}

#[test]
fn strips_beside_corners_with_texture_coordinates_keep_their_vertices() {
    let text = square(1, "3 0 1 2 6 0 0 1 0 1 1\n4 0 1 2 3\n").replace(
        "indices\nend_header",
        "indices\nproperty list uchar float texcoord\n\
         element tristrips 1\nproperty list uchar int vertex_indices\nend_header",
    );
    let mesh = read(text).unwrap();
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 1, 2], [2, 1, 3]]);
    assert!(mesh.positions.len() == 4 && mesh.uvs.is_empty());
}

#[test]
fn lines_may_hold_more_than_is_declared() {
    // As in a file by MeshLab, which declares four colours a face and writes nine.
    let text = square(3, "3 0 1 2 9 8 7\n4 0 1 2 3 9 8 7\n3 1 2 3\n");
    let mesh = read(&text).unwrap();
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 1, 2], [0, 2, 3], [1, 2, 3]]);
    assert_eq!(mesh.repairs.bad_attributes, 2);
    // Words behind the last record are nothing to us.
    assert_eq!(read(square(1, "3 0 1 2\n\n") + "and so on\n").unwrap().indices, [[0, 1, 2]]);
    assert_eq!(
        read(square(1, "3 0 1 2\n\n").replace('\n', "\n\n").replace("\n\nend", "\nend") + "x")
            .unwrap()
            .indices,
        [[0, 1, 2]]
    );
}

#[test]
fn long_files_read_alike_in_pieces_and_word_by_word() {
    // More lines than several pieces hold, a face of four corners now and then, and colours to skip.
    let count = 50_000;
    let mut body = String::new();
    for i in 0..count {
        body += &format!("{} {}e-3 {} {}\n", i % 7, i, f64::from(i) * 0.37, i % 256);
    }
    for i in 0..count - 3 {
        body += &if i % 5 == 0 {
            format!("4 {i} {} {} {}\n", i + 1, i + 2, i + 3)
        } else {
            format!("3 {i} 0 1\n")
        };
    }
    let head = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nelement face {}\n{FACE}",
        count - 3
    );
    let fast = read(head.clone() + &body).unwrap();
    assert_eq!(fast.indices.len(), 59_997);
    let slow = read(head.clone() + "\n" + &body).unwrap();
    assert_eq!(fast, slow);
    // Without the last line end, and with one line too few.
    assert_eq!(read(head.clone() + body.trim_end()).unwrap(), fast);
    let cut = &body.trim_end()[..body.trim_end().rfind('\n').unwrap()];
    assert!(message(head + cut).contains("face 49996 of 49997: the file is cut short"));
}

#[test]
fn what_is_written_reads_back() {
    let mut mesh = read(square(1, "4 0 1 2 3")).unwrap();
    mesh.repairs = Repairs::default();
    mesh.materials = vec![MeshMaterial::default()];
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out.ply");
    for wide in [false, true] {
        for normals in [vec![], vec![[0.0, 0.5, 1.0]; 4]] {
            for uvs in [vec![], vec![[0.25, 0.75]; 4]] {
                if wide {
                    mesh.positions =
                        Positions::F64((0..4).map(|i| mesh.positions.get(i).to_array()).collect());
                }
                (mesh.normals, mesh.uvs) = (normals.clone(), uvs);
                write_ply(&path, &mesh).unwrap();
                let back = crate::formats::load_mesh(&path).unwrap();
                assert_eq!(back, MeshData { materials: vec![], ..mesh.clone() });
            }
        }
    }
    assert_eq!(write_ply(&dir.path().join("absent/out.ply"), &mesh).unwrap_err().exit_code(), 3);
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "no temporary file is left");
}

/// A file of many windows: triangles, here and there a quadrilateral, and (where lengths have four bytes) one polygon of
/// 100,000 corners; as text, or binary.
fn long_file(format: Format, length: &str) -> Vec<u8> {
    let (name, big) = match format {
        Format::Ascii => ("ascii", false),
        Format::LittleEndian => ("binary_little_endian", false),
        Format::BigEndian => ("binary_big_endian", true),
    };
    let (vertices, faces) = (100_000u32, 60_000u32);
    let mut out = format!(
        "ply\nformat {name} 1.0\nelement vertex {vertices}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {faces}\nproperty list {length} int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let text = format == Format::Ascii;
    let bytes = |value: &[u8]| if big { value.iter().rev().copied().collect() } else { value.to_vec() };
    for i in 0..vertices {
        let angle = f64::from(i) / f64::from(vertices) * std::f64::consts::TAU;
        // A circle, which in double precision is convex and so quickly cut.
        let p = [angle.cos(), angle.sin(), 0.0];
        match text {
            true => out.extend(format!("{} {} {}\n", p[0], p[1], p[2]).bytes()),
            false => out.extend(p.iter().flat_map(|c| bytes(&c.to_le_bytes()))),
        }
    }
    for i in 0..faces {
        let corners: Vec<u32> = match i {
            30_000 if length == "int" => (0..vertices).collect(),
            _ if i % 1000 == 7 => (i..i + 4).collect(),
            _ => (i..i + 3).collect(),
        };
        match text {
            true => {
                out.extend(corners.len().to_string().bytes());
                corners.iter().for_each(|c| out.extend(format!(" {c}").bytes()));
                out.push(b'\n');
            }
            false => {
                let count = (corners.len() as u32).to_le_bytes();
                out.extend(if length == "int" { bytes(&count) } else { vec![count[0]] });
                out.extend(corners.iter().flat_map(|c| bytes(&c.to_le_bytes())));
            }
        }
    }
    out
}

#[test]
fn long_binary_files_read_as_text_does() {
    for length in ["uchar", "int"] {
        let want = read(long_file(Format::Ascii, length)).unwrap();
        assert_eq!(want.indices.len(), if length == "int" { 60_060 + 99_997 } else { 60_060 });
        for format in [Format::LittleEndian, Format::BigEndian] {
            let whole = long_file(format, length);
            assert_eq!(read(&whole).unwrap(), want);
            let cut = message(&whole[..whole.len() - 1]);
            let place = format!("face 59999 of 60000: the file is cut short here (at byte {})", {
                whole.len() - if length == "int" { 16 } else { 13 }
            });
            assert!(cut.contains(&place), "{cut}");
            let mut changed = whole.clone();
            *changed.last_mut().unwrap() = 0x70;
            *changed.iter_mut().nth_back(3).unwrap() = 0x70;
            assert!(message(changed).contains("face 59999 of 60000: there is no vertex 18"));
        }
    }
}
