//! Small good files of every kind, made here by our own writers, by the libraries below them, or as literals: the
//! beginnings of the fuzz corpora, and what other tests damage.

use exr::prelude::{
    Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, WritableImage,
};
use skylit::base::mesh_data::{MeshData, Positions, Repairs};
use skylit::formats::ply;
use skylit::image::picture::{Picture, SampleKind};
use skylit::image::write::{WriteOptions, write_picture};
use std::io::{Cursor, Write};

/// A good file.
pub struct Seed {
    /// The fuzz target that reads it.
    pub target: &'static str,
    /// Unique within the target.
    pub name: String,
    /// The content.
    pub bytes: Vec<u8>,
}

/// All of them.
pub fn seeds() -> Vec<Seed> {
    let mut all = Vec::new();
    texts(&mut all);
    meshes(&mut all);
    pictures(&mut all);
    hdr(&mut all);
    tiff(&mut all);
    pfm(&mut all);
    exr(&mut all);
    packed(&mut all);
    all
}

fn add(all: &mut Vec<Seed>, target: &'static str, name: &str, bytes: impl Into<Vec<u8>>) {
    all.push(Seed { target, name: name.to_owned(), bytes: bytes.into() });
}

const OBJ: &str = "# two faces\nmtllib a.mtl\no thing\ng part\nv 0 0 0\nv 1 0 0 1 0 0\nv 1 1 0 1.0\nv 0 1 0\n\
                   vt 0 0\nvt 1 0 0\nvt 1 1\nvn 0 0 1\ns 1\nusemtl a\nf 1/1/1 2/2/1 3/3/1\nusemtl b\n\
                   f -4//-1 \\\n-2//-1 -1//-1\nf 1 2 3 4\nf 1/1 2/2 3/3\nl 1 2\np 1\n";
const MTL: &str = "newmtl a\nKa 0 0 0\nKd 0.5 0.25 1\nKs 1 1 1\nNs 10\nd 1\nillum 2\n\
                   map_Kd -o 0.1 0.2 -s 1 1 1 -clamp on my wood.png\nnewmtl b\nKd 0.5 # gray\n";
const TOML: &str = r#"# every section
[film]
size = [8, 6]
filter = "box"
background = [0.1, 0.2, 0.3]
transfer = 2.2
[camera]
type = "perspective"
eye = [0, 1, 5]
look_at = [0, 0, 0]
up = [0, 1, 0]
fov_deg = 40.5
[render]
integrator = "path"
spp = 4
sampler = "owen-sobol"
seed = 3
max_depth = 5
[sky]
type = "constant"
radiance = [1, 0.5, 1e-1]
intensity = 2
rotate_y_deg = -30
[materials.clay]
type = "diffuse"
albedo = [0.5, 0.4, 0.3]
[materials.wood]
type = "diffuse"
albedo = { type = "image", path = "wood.png" }
[groups.pair]
objects = [
  { shape = { type = "sphere", center = [0, 0, 0], radius = 1 }, material = "clay", transform = [{ scale = 2 }] },
  { shape = { type = "mesh", path = "a.ply" }, material = "wood" },
]
[[objects]]
name = "all"
group = "pair"
transform = [{ rotate_deg = 90, axis = [0, 1, 0] }, { translate = [1, 2, 3] }]
"#;
const SCENE: &str = "# the seed's\nsize 8 6\noutput a.png\nmaxdepth 5\nspp 2\ncamera 0 1 5 0 0 0 0 1 0 40.5\n\
    imageformat PNG\nambient 0.1 0.1 0.1\ndiffuse 0.5 0.5 0.5\nspecular 0.2 0.2 0.2\nshininess 20\nemission 0 0 0\n\
    skybox sky folder 0.5\npushTransform\ntranslate 1 0 0\nrotate 0 1 0 45\nscale 1 2 1\nsph 0 0 0 1\nelp 0 0 0 2\n\
    popTransform\nattenuation 1 0 0.1\npoint 0 5 0 1 1 1\ndirectional 0 1 0 0.5 0.5 0.5\ntexture wood.png\n\
    vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\ntri 0 1 2\nmesh one\ntexture None\nmatType Mirror\nOBJ a b.obj\n\
    vertexnormal 0 0 0 0 0 1\nunknown 1 2\n";
const COURSE: &str = "size 8 6\nintegrator pathtracer\nmaxdepth -1\nspp 4\nnexteventestimation mis\n\
    russianroulette on\nimportancesampling brdf\nlightsamples 4\nlightstratify on\nbrdf ggx\nroughness 0.3\ngamma 2.2\n\
    camera 0 1 5 0 0 0 0 1 0 40\nmaxverts 4\nmaxvertnorms 3\nambient 0.1 0.1 0.1\ndiffuse 0.5 0.5 0.5\n\
    specular 0.2 0.2 0.2\nshininess 20\nemission 1 1 1\nattenuation 1 0 0\npoint 0 5 0 1 1 1\n\
    directional 0 1 0 0.5 0.5 0.5\nquadLight -1 5 -1 2 0 0 0 0 2 1 1 1\npushTransform\ntranslate 1 0 0\nscale 1 2 1\n\
    rotate 0 1 0 45\nsphere 0 0 0 1\npopTransform\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\ntri 0 1 2\n\
    vertexnormal 0 0 0 0 0 1\nvertexnormal 1 0 0 0 0 1\nvertexnormal 0 1 0 0 0 1\ntrinormal 0 1 2\noutput a.png\n";

fn texts(all: &mut Vec<Seed>) {
    add(all, "obj", "all", OBJ);
    add(all, "obj", "plain", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    add(all, "obj", "concave", "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 1 2 3 4 5\n");
    add(all, "obj", "returns", "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r");
    add(all, "mtl", "all", MTL);
    add(all, "toml", "all", TOML);
    add(all, "toml", "short", "[[objects]]\nshape = { type = \"sphere\" }\n");
    add(all, "seed", "all", SCENE);
    add(all, "course", "all", COURSE);
    for integrator in ["raytracer", "analyticdirect", "direct"] {
        let text = format!("integrator {integrator}\nbrdf phong\nlightsamples 9\nsphere 0 0 0 1\n");
        add(all, "course", integrator, text);
    }
}

fn meshes(all: &mut Vec<Seed>) {
    let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.5]];
    let mut mesh = MeshData {
        positions: Positions::F32(corners.iter().map(|p| p.map(|c: f64| c as f32)).collect()),
        normals: vec![[0.0, 0.0, 1.0]; 4],
        uvs: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
        indices: vec![[0, 1, 2], [1, 3, 2]],
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    let written = |mesh: &MeshData| {
        let mut bytes = Vec::new();
        ply::write_ply_to(&mut bytes, mesh).expect("memory takes it");
        bytes
    };
    add(all, "ply", "written", written(&mesh));
    mesh.positions = Positions::F64(corners);
    (mesh.normals, mesh.uvs) = (Vec::new(), Vec::new());
    add(all, "ply", "written-double", written(&mesh));
    let header = |format: &str, more: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\n\
             property float z\nproperty uchar red\n{more}end_header\n"
        )
    };
    let face = "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n";
    let ascii = "0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3 8 0 0 1 0 1 1 0 1\n";
    add(all, "ply", "ascii", header("ascii", face) + ascii);
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n\
                  element edge 1\nproperty int vertex1\nproperty int vertex2\n";
    add(
        all,
        "ply",
        "strips",
        header("ascii", strips) + "0 0 0 9\n1 0 0 9\n0 1 0 9\n1 1 0 9\n5 0 1 2 -1 3\n0 1\n",
    );
    let mut big = header("binary_big_endian", face).into_bytes();
    for c in [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]] {
        c.iter().for_each(|c| big.extend(c.to_be_bytes()));
        big.push(9);
    }
    big.push(3);
    [0i32, 1, 2].iter().for_each(|i| big.extend(i.to_be_bytes()));
    big.push(6);
    [0f32, 0.0, 1.0, 0.0, 1.0, 1.0].iter().for_each(|c| big.extend(c.to_be_bytes()));
    add(all, "ply", "big-endian", big);
}

const SIDES: [u32; 2] = [9, 7];

fn pictures(all: &mut Vec<Seed>) {
    use image::{DynamicImage, ImageFormat};
    let [w, h] = SIDES;
    let value = |x: u32, y: u32| (x * 25 + y * 3) as u8;
    let color = DynamicImage::from(image::RgbaImage::from_fn(w, h, |x, y| {
        image::Rgba([value(x, y), value(y, x), 7, 200 + y as u8])
    }));
    let forms: [(&str, DynamicImage); 7] = [
        ("gray", color.to_luma8().into()),
        ("gray-alpha", color.to_luma_alpha8().into()),
        ("rgb", color.to_rgb8().into()),
        ("rgba", color.to_rgba8().into()),
        ("gray16", color.to_luma16().into()),
        ("rgb16", color.to_rgb16().into()),
        ("rgba16", color.to_rgba16().into()),
    ];
    for (name, form) in forms {
        let encode = |format| {
            let mut bytes = Cursor::new(Vec::new());
            form.write_to(&mut bytes, format).ok().map(|()| bytes.into_inner())
        };
        add(all, "png", name, encode(ImageFormat::Png).expect("PNG takes all of them"));
        if let ("gray" | "rgb", Some(bytes)) = (name, encode(ImageFormat::Jpeg)) {
            add(all, "jpg", name, bytes);
        }
    }
    for (name, kind, depth) in
        [("palette", png::ColorType::Indexed, 2u8), ("bits", png::ColorType::Grayscale, 1)]
    {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 8, 4);
        encoder.set_color(kind);
        encoder.set_depth(png::BitDepth::from_u8(depth).expect("a depth of PNG"));
        if kind == png::ColorType::Indexed {
            encoder.set_palette(vec![0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 255]);
            encoder.set_trns(vec![0, 128]);
        }
        let rows = vec![0x1b; 4 * usize::from(depth)];
        encoder.write_header().and_then(|mut w| w.write_image_data(&rows)).expect("memory takes it");
        add(all, "png", name, bytes);
    }
    let dir = tempfile::tempdir().expect("a temporary folder");
    for extension in ["png", "jpg", "exr"] {
        let path = dir.path().join(format!("a.{extension}"));
        write_picture(&path, &picture(), &WriteOptions::default()).expect("writes");
        add(all, extension, "written", std::fs::read(path).expect("was written"));
    }
}

fn picture() -> Picture {
    let [w, h] = SIDES.map(|s| s as usize);
    let mut picture = Picture::new(w, h);
    for (i, name) in ["R", "G", "B", "A", "normal.X"].into_iter().enumerate() {
        let kind = if i < 4 { SampleKind::Half } else { SampleKind::Float };
        picture.push(name, kind, (0..w * h).map(|p| ((p * (i + 3)) % 16) as f32 / 16.0).collect());
    }
    picture.metadata.push(("software".into(), "skylit".into()));
    picture
}

fn hdr(all: &mut Vec<Seed>) {
    let [w, h] = SIDES.map(|s| s as usize);
    let pixels: Vec<image::Rgb<f32>> = (0..w * h).map(|i| image::Rgb([i as f32, 0.5, 1e-3])).collect();
    let mut bytes = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, w, h).expect("memory takes it");
    add(all, "hdr", "runs", bytes);
    let mut flat = b"#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n+Y 2 -X 3\n".to_vec();
    flat.extend([[1u8, 2, 3, 128], [1, 1, 1, 2], [4, 5, 6, 130], [7, 8, 9, 120], [1, 1, 1, 1]].concat());
    add(all, "hdr", "old-runs", flat);
}

fn tiff(all: &mut Vec<Seed>) {
    use ::tiff::encoder::{Compression, DeflateLevel, Predictor, TiffEncoder, colortype::*};
    let forms = [
        ("plain", Compression::Uncompressed, Predictor::None),
        ("deflate", Compression::Deflate(DeflateLevel::Best), Predictor::Horizontal),
        ("lzw", Compression::Lzw, Predictor::None),
        ("packbits", Compression::Packbits, Predictor::None),
    ];
    let [w, h] = SIDES;
    let values: Vec<u16> = (0..4 * w * h).map(|i| (i * 771 % 65536) as u16).collect();
    let floats: Vec<f32> = values.iter().map(|&v| f32::from(v) / 8.0).collect();
    let bytes: Vec<u8> = values.iter().map(|&v| (v >> 8) as u8).collect();
    for (name, compression, predictor) in forms {
        let mut all_kinds = [(); 4].map(|()| Cursor::new(Vec::new()));
        let begin = |out| {
            let encoder = TiffEncoder::new(out).expect("begins");
            encoder.with_compression(compression).with_predictor(predictor)
        };
        let pixels = (w * h) as usize;
        let [gray, rgb, deep, float] = &mut all_kinds;
        begin(gray).write_image::<Gray8>(w, h, &bytes[..pixels]).expect("memory takes it");
        begin(rgb).write_image::<RGB8>(w, h, &bytes[..3 * pixels]).expect("memory takes it");
        begin(deep).write_image::<RGBA16>(w, h, &values).expect("memory takes it");
        let mut kinds = vec!["gray", "rgb", "rgba16"];
        // Differences of floats have a predictor of their own.
        if predictor == Predictor::None {
            begin(float).write_image::<RGB32Float>(w, h, &floats[..3 * pixels]).expect("memory takes it");
            kinds.push("float");
        }
        for (kind, bytes) in kinds.into_iter().zip(all_kinds) {
            add(all, "tiff", &format!("{name}-{kind}"), bytes.into_inner());
        }
    }
    let mut big = b"MM\0*\0\0\0\x08\0\x06".to_vec();
    // Tags of TIFF 6.0, section 3: size, bits, no compression, black is 0, one strip of four bytes behind.
    let tags = [
        [256, 3, 1, 2 << 16],
        [257, 3, 1, 2 << 16],
        [258, 3, 1, 8 << 16],
        [262, 3, 1, 1 << 16],
        [273, 4, 1, 86],
    ];
    for [tag, kind, count, value] in tags.into_iter().chain([[279, 4, 1, 4]]) {
        big.extend([(tag as u16).to_be_bytes(), (kind as u16).to_be_bytes()].concat());
        big.extend([(count as u32).to_be_bytes(), (value as u32).to_be_bytes()].concat());
    }
    big.extend([0, 0, 0, 0, 1, 2, 3, 4]);
    add(all, "tiff", "big-endian", big);
}

fn pfm(all: &mut Vec<Seed>) {
    for (name, kind, channels) in [("gray", "Pf", 1), ("colour", "PF", 3), ("alpha", "PF4", 4)] {
        for (order, scale) in [("little", "-1.0"), ("big", "1")] {
            let mut bytes = format!("{kind}\n3 2\n{scale}\n").into_bytes();
            for value in (0..6 * channels).map(|i| i as f32 / 4.0) {
                bytes.extend(if order == "big" { value.to_be_bytes() } else { value.to_le_bytes() });
            }
            add(all, "pfm", &format!("{name}-{order}"), bytes);
        }
    }
}

fn exr(all: &mut Vec<Seed>) {
    let forms = [
        ("raw", Compression::Uncompressed, Blocks::ScanLines),
        ("rle", Compression::RLE, Blocks::ScanLines),
        ("zip1", Compression::ZIP1, Blocks::ScanLines),
        ("zip16", Compression::ZIP16, Blocks::Tiles(exr::prelude::Vec2(4, 4))),
        ("piz", Compression::PIZ, Blocks::ScanLines),
        ("pxr24", Compression::PXR24, Blocks::ScanLines),
        ("b44", Compression::B44, Blocks::ScanLines),
        ("b44a", Compression::B44A, Blocks::Tiles(exr::prelude::Vec2(8, 8))),
        ("dwaa", Compression::DWAA(None), Blocks::ScanLines),
        ("dwab", Compression::DWAB(None), Blocks::ScanLines),
    ];
    for (name, compression, blocks) in forms {
        let channels = SpecificChannels::rgb(|p: exr::prelude::Vec2<usize>| {
            (half::f16::from_f32(p.x() as f32 / 8.0), p.y() as f32, 0.25f32)
        });
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let size = (SIDES[0] as usize, SIDES[1] as usize);
        let layer = Layer::new(size, LayerAttributes::named("main"), encoding, channels);
        let mut bytes = Cursor::new(Vec::new());
        // What the library cannot write, it may still read; the fuzzer gets there by the byte that says which.
        if Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).is_ok() {
            add(all, "exr", name, bytes.into_inner());
        }
    }
}

fn packed(all: &mut Vec<Seed>) {
    for (name, data) in [("text", OBJ.as_bytes()), ("zeros", &[0; 1000]), ("nothing", b"")] {
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        packer.write_all(data).expect("memory takes it");
        add(all, "gzip", name, packer.finish().expect("memory takes it"));
        let level = ruzstd::encoding::CompressionLevel::Fastest;
        add(all, "zstd", name, ruzstd::encoding::compress_to_vec(data, level));
    }
    let skipped = [0x50, 0x2a, 0x4d, 0x18, 2, 0, 0, 0, 1, 2];
    let mut twice = all.last().expect("some").bytes.clone();
    twice.extend(skipped);
    twice.extend(ruzstd::encoding::compress_to_vec(
        &b"again"[..],
        ruzstd::encoding::CompressionLevel::Fastest,
    ));
    add(all, "zstd", "frames", twice);
}
