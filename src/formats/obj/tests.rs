use super::*;
use crate::base::mesh_data::MeshMaterial;
use crate::testing::TestRng;

fn read(text: impl AsRef<[u8]>) -> Result<MeshData> {
    parse(Path::new("a.obj"), text.as_ref())
}

fn message(text: impl AsRef<[u8]>) -> String {
    read(text).unwrap_err().to_string()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

/// The corners of each triangle, so that meshes compare by shape and not by the order of vertices.
fn shape(mesh: &MeshData) -> Vec<[[f64; 3]; 3]> {
    mesh.indices.iter().map(|t| t.map(|i| mesh.positions.get(i as usize).to_array())).collect()
}

#[test]
fn the_same_square_in_many_spellings() {
    let want = shape(&read(format!("{SQUARE}f 1 2 3\nf 1 3 4\n")).unwrap());
    assert_eq!(want[1], [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let quad = format!("{SQUARE}f 1 2 3 4");
    for text in [
        quad.clone(),
        quad.replace('\n', "\r\n"),
        quad.replace('\n', "\r"),
        quad.replace(' ', " \t "),
        quad.replace("f 1 2 3 4", "f -4 -3 -2 -1"),
        quad.replace("f 1 2 3 4", "f 1 2 3 4 # a comment"),
        quad.replace("f 1 2 3 4", "f 1// 2/ 3 4\n"),
        quad.replace("f 1 2 3 4", "f 1 2 \\\n 3\\\r\n4\n\n"),
        quad.replace("v 1 0 0", "  v 1 0 0 # \\"),
        quad.replace("v 1 0 0", "v 1 0 \\\n0"),
        quad.replace("v 1 0 0", "v 1 0 0 0"),
        quad.replace("v 1 0 0", "v 1 0 0 0.5 0.5 0.5 1"),
        quad.replace("v 1 0 0", "v 1 0 0 255 0"),
        format!("f 1 2 3 4\n{SQUARE}"),
        format!("o a\ng b c\ns off\nmg 1 2\nvp 1 2\ncstype bezier\n{quad}\nend\nfoo bar\n\\\n"),
        format!("{SQUARE}usemtl x\nf 1 2 3\no other\ng group\nusemtl x\nf 1 3 4"),
    ] {
        let mesh = read(&text).unwrap();
        assert_eq!(shape(&mesh), want, "{text:?}");
        assert_eq!(mesh.positions.len(), 4, "corners are shared");
        assert!(mesh.normals.is_empty() && mesh.uvs.is_empty() && mesh.material_ids.is_empty());
    }
    // Bytes that are no UTF-8, in a comment and in a name.
    let mesh = read([b"# \xff\xfe\ng \xe4\n", quad.as_bytes()].concat()).unwrap();
    assert_eq!(shape(&mesh), want);
}

#[test]
fn corners_share_a_vertex_only_if_all_is_shared() {
    let text = format!(
        "{SQUARE}vt 0 0\nvt 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/2/1\nf 1/1/1 3/2/1 4/1/1\nf 1/2/1 2/2/1 4/1/1\n"
    );
    let mesh = read(text).unwrap();
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3], [4, 1, 3]]);
    assert_eq!(mesh.uvs, [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]);
    assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 5]);
    assert_eq!(mesh.positions.get(4), mesh.positions.get(0));
    assert_eq!(mesh.repairs, Repairs::default());
}

#[test]
fn texture_coordinates_may_have_one_or_three_numbers() {
    let text = format!("{SQUARE}vt 0.5\nvt 0.25 0.75 9\nf 1/1 2/2 3/2");
    assert_eq!(read(text).unwrap().uvs, [[0.5, 0.0], [0.25, 0.75], [0.25, 0.75]]);
}

#[test]
fn missing_attributes_are_filled_in_and_counted() {
    // The first face has neither, the second both, by indices from the end; a corner of the third has no normal.
    let text = format!("{SQUARE}vt 0.5 1\nvn 0 3 0\nf 1 2 3\nf -4/-1/-1 3/1/1 4/1/1\nf 1/1/1 2/1 3/1/1\n");
    let mesh = read(text).unwrap();
    assert_eq!(mesh.indices, [[0, 1, 2], [3, 4, 5], [3, 6, 4]]);
    assert_eq!(mesh.uvs[..3], [[0.0; 2]; 3]);
    assert_eq!(mesh.uvs[3..], [[0.5, 1.0]; 4]);
    let (flat, own) = ([0.0, 0.0, 1.0], [0.0, 3.0, 0.0]);
    assert_eq!(mesh.normals, [flat, flat, flat, own, own, own, flat]);
    assert_eq!(mesh.repairs, Repairs { bad_normals: 4, bad_attributes: 3, ..Repairs::default() });
}

#[test]
fn references_to_attributes_that_the_file_has_not_are_left_out() {
    let mesh = read(format!("{SQUARE}f 1/1/1 2/2/2 3/3/3\nf 1//7 3//8 4//9")).unwrap();
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3]]);
    assert!(mesh.normals.is_empty() && mesh.uvs.is_empty());
    assert_eq!(mesh.repairs, Repairs { bad_attributes: 9, ..Repairs::default() });
}

#[test]
fn polygons_are_cut_and_materials_follow() {
    // A concave polygon between faces of other materials.
    let text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\nf 1 2 3\nusemtl red\nf 1 2 3 4 5\nusemtl blue\nf 3 4 5\n\
        usemtl red\nf 1 2 4\nusemtl unused\n";
    let mesh = read(text).unwrap();
    assert_eq!(mesh.indices.len(), 6);
    assert_eq!(mesh.material_ids, [0, 1, 1, 1, 2, 1]);
    let names: Vec<&str> = mesh.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["", "red", "blue"]);
    assert_eq!(mesh.repairs.triangulated, 1);
    let area = |t: &[[f64; 3]; 3]| {
        let [a, b, c] = t.map(DVec3::from_array);
        (b - a).cross(c - a).z / 2.0
    };
    let pentagon: Vec<f64> = shape(&mesh)[1..4].iter().map(area).collect();
    // 2 x 2 without the notch of base 2 and depth 1.5: exact in binary.
    assert!(pentagon.iter().all(|&a| a > 0.0) && pentagon.iter().sum::<f64>() == 2.5, "{pentagon:?}");
}

#[test]
fn what_is_no_surface_is_counted() {
    let mesh = read(format!("{SQUARE}f 1 2 3\nl 1 2 3 4\np 1\nf 1 2\nf\nf 3\ncurv2 1 2\n")).unwrap();
    assert_eq!(mesh.indices.len(), 1);
    assert_eq!(mesh.repairs, Repairs { not_surface: 3, bad_faces: 3, ..Repairs::default() });
    assert!(message(format!("{SQUARE}l 1 2\np 4")).contains("4 points, 2 points and lines"));
    assert!(message("# nothing\n").contains("no vertices and no faces"));
}

#[test]
fn errors_name_the_line_and_what_is_wrong() {
    let cases = [
        ("f 1 2 5\n", "a.obj:5:7: there is no position 5; the file has 4"),
        ("f 1/1 2/2 3/1\nvt 0 0", "a.obj:5:7: there is no texture coordinate 2; the file has 1"),
        ("f 1//2 2//1 3//1\nvn 0 0 1\nf 1//1 2//1 3//1", "a.obj:5:3: there is no normal 2; the file has 1"),
        ("\nf 1 2 0\n", "a.obj:6:7: \"0\" is no corner of a face: indices count from 1"),
        (
            "f 1 2 -5\n",
            "a.obj:5:7: \"-5\" is no corner of a face: it counts back over the start; so far there are 4",
        ),
        ("f 1 2 x\n", "a.obj:5:7: \"x\" is no corner of a face"),
        ("f 1 2 3/1/1/1\n", "it must be position, position/uv"),
        ("f 1 2 \\\n 3 \\\n 4.5\nf 1 2 3", "a.obj:7:2: \"4.5\" is no corner"),
        ("v 1 2\nf 1 2 3", "a.obj:5:1: a position needs 3 numbers, here are 2"),
        ("vn 1 # 2 3\nf 1 2 3", "a.obj:5:1: a normal needs 3 numbers, here are 1"),
        ("vt\nf 1 2 3", "a texture coordinate needs 2 numbers, here are 0"),
        ("v 1 x 2\nf 1 2 3", "a.obj:5:5: a position is \"v x y z\" with three numbers"),
        ("vn 1 \u{e4} 2\nf 1 2 3", "a.obj:5:6: a normal is"),
        ("vt 1,5 2\nf 1 2 3", "a.obj:5:4: a texture coordinate is"),
    ];
    for (text, want) in cases {
        let got = message(format!("{SQUARE}{text}"));
        assert!(got.contains(want), "{got}\nwanted {want}");
    }
    assert!(message([SQUARE.as_bytes(), b"v 1 \xff 2\nf 1 2 3"].concat()).contains("a.obj:5:"));
}

#[test]
fn georeferenced_coordinates_keep_their_digits() {
    let mesh = read("v 4512345.123456 5432100.000001 -12.5\nv 0 0 0\nv 0 1 0\nf 1 2 3").unwrap();
    assert_eq!(mesh.positions.get(0), DVec3::new(4_512_345.123_456, 5_432_100.000_001, -12.5));
}

#[test]
fn positions_that_are_no_number_stay() {
    let mesh = read(format!("{SQUARE}v nan 1.#QNAN -1.#IND\nf 1 2 3\nf 1 3 5")).unwrap();
    assert!(mesh.positions.get(3).is_nan() && mesh.positions.get(3).z.is_nan());
}

#[test]
fn libraries_are_found_beside_the_file_and_may_be_missing() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(
        dir.path().join("my colours.mtl"),
        "newmtl red paint\nKd 1 0 0\nmap_Kd -s 2 2 red one.png\n",
    )
    .unwrap();
    std::fs::write(dir.path().join("b.mtl"), "newmtl blue\nKd 0 0 1\n").unwrap();
    let path = dir.path().join("a.obj");
    let text = format!(
        "mtllib my colours.mtl\nmtllib absent.mtl b.mtl\nmtllib .\n{SQUARE}usemtl  red paint \nf 1 2 3\nusemtl blue\nf 1 2 4\n\
         usemtl gone\nf 2 3 4\n"
    );
    let mesh = parse(&path, text.as_bytes()).unwrap();
    let material = |name: &str, diffuse, map: Option<&str>| MeshMaterial {
        name: name.to_string(),
        diffuse,
        diffuse_map: map.map(|m| dir.path().join(m)),
    };
    let want = [
        material("red paint", Some([1.0, 0.0, 0.0]), Some("red one.png")),
        material("blue", Some([0.0, 0.0, 1.0]), None),
        material("gone", None, None),
    ];
    assert_eq!(mesh.materials, want);
    assert_eq!(mesh.material_ids, [0, 1, 2]);
    // One material for all needs no ids.
    let one = parse(&path, format!("mtllib b.mtl\n{SQUARE}usemtl blue\nf 1 2 3 4").as_bytes()).unwrap();
    assert_eq!((one.materials, one.material_ids), (vec![want[1].clone()], vec![]));
}

#[test]
fn no_cut_and_no_changed_byte_panics() {
    let whole = format!(
        "mtllib x.mtl\n{SQUARE}vt 0.5 1\nvn 0 3 0\nusemtl a\nf 1 2 3\nf -4/-1/-1 3/1/1 \\\n 4/1/1 # c\nl 1 2\nf 1//1 2 3 4\n"
    )
    .into_bytes();
    let check = |bytes: &[u8]| match read(bytes) {
        Ok(mesh) => assert!(mesh.indices.iter().flatten().all(|&i| (i as usize) < mesh.positions.len())),
        Err(e) => assert_eq!(e.exit_code(), 2, "{e}"),
    };
    for length in 0..whole.len() {
        check(&whole[..length]);
    }
    for i in 0..whole.len() {
        for byte in [b'0', b'9', b'-', b'/', b'#', b'\\', b' ', b'\n', b'f', 0, 0xff] {
            let mut changed = whole.clone();
            changed[i] = byte;
            check(&changed);
        }
    }
}

/// The same in blocks of any size and by any number of threads.
fn read_in_blocks(text: &[u8], size: usize, threads: usize) -> Result<MeshData> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let path = Path::new("a.obj");
    pool.install(|| read_blocks(path, Blocks::of_size(Source::of_bytes(path, text), size), None))
}

#[test]
fn neither_blocks_nor_threads_change_the_mesh_or_the_error() {
    let head = format!("{SQUARE}vt 0 0.5\nvt 1 0.5\nvn 0 0 1\nvn 0 1 1\nvn 0 0 2\n");
    let good = format!(
        "{head}f 1 2 3\nusemtl a\nf 1/1 2/1 3/2\n# \\\nf -4//-1 -3//-2 -2//-3 -1//-1\nv 0 0 1\nl 1 2\nf 1//1 2//2\n\
         f 1/1/1 2/2/2 \\\n 3/1/3 \\\n\nusemtl b\nvt 0.5 0.5\nvt 0.25 0.25\nvt 0 0\nf 1/1/1 2/2/2 5/5/1\nusemtl a\nf -1/-1/-1 -2/-2/-2 -3/-3/-3\n"
    );
    let bad = [
        "f 1 2 3\nf 1 2 77 # the highest\nf 1 2 9\n",
        "f 1/3 2/9 3/1\nf 1//4 2 3\n",
        "f 1 2 3\nf -4 -3 -5\nf 1 2 x\nv\n",
        "f 1 2 3\nv 1 2 x\nf -4 -3 -9\n",
        "p 1\n",
    ];
    let texts = bad.map(|tail| format!("{head}{tail}"));
    for text in std::iter::once(&good).chain(&texts) {
        let want = read(text);
        assert_eq!(want.is_ok(), *text == good, "{want:?}");
        for size in [1, 7, 16, 33, 100, 1000] {
            for threads in [1, 2, 5] {
                let got = read_in_blocks(text.as_bytes(), size, threads);
                assert_eq!(format!("{got:?}"), format!("{want:?}"), "{text:?} {size} {threads}");
            }
        }
    }
}

/// A mesh as the `tobj` crate reads it.
fn read_by_tobj(text: &str) -> MeshData {
    let options = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials).unwrap();
    let [model] = &models[..] else { panic!("one model") };
    let mesh = &model.mesh;
    MeshData {
        positions: Positions::F64(mesh.positions.as_chunks().0.to_vec()),
        normals: mesh.normals.as_chunks().0.iter().map(|n| n.map(|c| c as f32)).collect(),
        uvs: mesh.texcoords.as_chunks().0.iter().map(|t| t.map(|c| c as f32)).collect(),
        indices: mesh.indices.as_chunks().0.to_vec(),
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    }
}

#[test]
fn random_meshes_are_as_another_reader_has_them() {
    let mut rng = TestRng::new(11);
    for case in 0..400 {
        let mut below = |n: usize| (rng.f64() * n as f64) as usize;
        let count = 3 + below(60);
        let mut text = String::new();
        for _ in 0..count {
            let mut number = || {
                let x = (below(2_000_001) as f64 - 1e6) / 3e5;
                [format!("{x}"), format!("{x:.3}"), format!("{x:e}"), format!("{}", x as f32)][below(4)]
                    .clone()
            };
            text += &format!("v {} {} {}\n", number(), number(), number());
            text += &format!("vt {} {}\nvn {} {} 1\n", number(), number(), number(), number());
        }
        for _ in 0..1 + below(100) {
            text += "f";
            for _ in 0..3 {
                let [p, t, n] = [0; 3].map(|_| 1 + below(count));
                // All numbers equal, none but the first, two kinds, any three; counted back.
                text += &match case % 6 {
                    0 => format!(" {p}/{p}/{p}"),
                    1 => format!(" {p}"),
                    2 => format!(" {p}//{n}"),
                    3 => format!(" {p}/{t}"),
                    4 => format!(" {p}/{t}/{n}"),
                    _ => format!(" -{p}/-{t}/-{n}"),
                };
            }
            text += "\n";
        }
        assert_eq!(read(&text).unwrap(), read_by_tobj(&text), "{text}");
    }
}
