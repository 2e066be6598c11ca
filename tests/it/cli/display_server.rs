//! `--display-server`, against a server of the test's own that keeps what tev would show. The protocol is tev's
//! (<https://github.com/Tom94/tev>): a packet is its length in bytes, these four among it, a byte for its kind, and
//! fields, all little-endian; strings end in a zero byte.

use super::folder::Folder;
use skylit::image::read::read_planes;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Kinds of packets: create an image, update a part of it (third version).
const CREATE: u8 = 4;
const UPDATE: u8 = 6;

/// What a server was told.
#[derive(Default)]
struct Heard {
    name: String,
    size: [usize; 2],
    channels: Vec<String>,
    /// Row by row, the channels of a pixel together.
    pixels: Vec<f32>,
    /// How often each pixel was sent.
    times: Vec<u32>,
    creates: usize,
}

/// Reads fields off a packet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (head, tail) = self.0.split_first_chunk().expect("a field is cut off");
        self.0 = tail;
        *head
    }

    fn u32(&mut self) -> usize {
        u32::from_le_bytes(self.bytes()) as usize
    }

    fn u64(&mut self) -> usize {
        u64::from_le_bytes(self.bytes()) as usize
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|b| *b == 0).expect("a string without an end");
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }

    fn list<T>(&mut self, n: usize, field: impl Fn(&mut Self) -> T) -> Vec<T> {
        (0..n).map(|_| field(self)).collect()
    }
}

impl Heard {
    fn packet(&mut self, packet: &[u8]) {
        let mut fields = Fields(&packet[4..]);
        let [kind, grabs_focus] = fields.bytes();
        let name = fields.text();
        match kind {
            CREATE => {
                assert_eq!(grabs_focus, 1);
                self.size = [fields.u32(), fields.u32()];
                let n = fields.u32();
                self.channels = fields.list(n, Fields::text);
                let area = self.size[0] * self.size[1];
                (self.pixels, self.times) = (vec![0.0; area * n], vec![0; area]);
                self.name = name;
                self.creates += 1;
            }
            UPDATE => self.update(&name, &mut fields),
            kind => panic!("packet of kind {kind}"),
        }
    }

    fn update(&mut self, name: &str, fields: &mut Fields) {
        assert_eq!(name, self.name);
        let n = fields.u32();
        assert_eq!(fields.list(n, Fields::text), self.channels);
        let [x0, y0, width, height] = [0; 4].map(|_| fields.u32());
        assert!(x0 + width <= self.size[0] && y0 + height <= self.size[1], "beyond the frame");
        let (offsets, strides) = (fields.list(n, Fields::u64), fields.list(n, Fields::u64));
        let data: Vec<f32> =
            fields.0.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        for i in 0..width * height {
            let at = (y0 + i / width) * self.size[0] + x0 + i % width;
            self.times[at] += 1;
            for c in 0..n {
                self.pixels[at * n + c] = data[offsets[c] + i * strides[c]];
            }
        }
    }

    /// Until the other side closes.
    fn all(mut stream: TcpStream) -> Heard {
        let mut heard = Heard::default();
        let mut length = [0; 4];
        while stream.read_exact(&mut length).is_ok() {
            let mut packet = vec![0; u32::from_le_bytes(length) as usize];
            packet[..4].copy_from_slice(&length);
            stream.read_exact(&mut packet[4..]).expect("a packet is cut off");
            heard.packet(&packet);
        }
        heard
    }
}

/// Where it listens, and what `serve` makes of the first that connects.
fn server<T: Send + 'static>(serve: impl FnOnce(TcpStream) -> T + Send + 'static) -> (String, JoinHandle<T>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    (address, thread::spawn(move || serve(listener.accept().unwrap().0)))
}

/// What was heard is the frame with the picture in its place, to the bit, and black around it.
fn assert_shows(heard: &Heard, f: &Folder, file: &str) {
    let picture = read_planes(&f.path().join(file)).unwrap();
    assert_eq!((heard.name.as_str(), heard.creates), (file, 1));
    assert_eq!(heard.size, picture.frame);
    for (c, name) in heard.channels.iter().enumerate() {
        let plane = &picture.plane(name).unwrap().data;
        for y in 0..heard.size[1] {
            for x in 0..heard.size[0] {
                let at = y * heard.size[0] + x;
                let [i, j] = [x.wrapping_sub(picture.origin[0]), y.wrapping_sub(picture.origin[1])];
                let inside = i < picture.width && j < picture.height;
                let expected = if inside { plane[j * picture.width + i] } else { 0.0 };
                assert_eq!(
                    heard.pixels[at * heard.channels.len() + c].to_bits(),
                    expected.to_bits(),
                    "{name} ({x}, {y})"
                );
                assert_eq!(heard.times[at] > 0, inside, "({x}, {y})");
            }
        }
    }
}

/// A frame of several tiles whose last are smaller.
const FLAGS: &str = "--size 70x45 --full-float --threads 2 -o a.exr";

#[test]
fn the_assembled_picture_is_the_one_that_is_written() {
    let cases = [
        "--spp 1",
        // In two parts, the second by need.
        "--spp 16",
        // A crop lands in its place.
        "--spp 4 --cropwindow 0.3,0.8,0.25,0.9",
        // Rounds, and a background that is transparent.
        "--max-spp 64 --target-error 2% --background transparent",
    ];
    for flags in cases {
        let f = Folder::new();
        let (address, serving) = server(Heard::all);
        let scene = if flags.contains("--background") { "tri.ply --sky midday" } else { "scene.toml" };
        let run = f.run(&format!("render {scene} {FLAGS} {flags} --display-server {address}")).succeeds();
        assert!(!run.stderr.contains("display server"), "{}", run.stderr);
        let heard = serving.join().unwrap();
        let alpha = flags.contains("transparent");
        assert_eq!(heard.channels.concat(), if alpha { "RGBA" } else { "RGB" });
        assert_shows(&heard, &f, "a.exr");
    }
}

#[test]
fn without_a_server_nothing_is_rendered() {
    let f = Folder::new();
    // A port that was free a moment ago.
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let refused = format!("render scene.toml {FLAGS} --display-server {free}");
    f.refuses(&refused, 3, &["cannot connect to the display server", &free.to_string()]);
    for address in ["localhost", ":14158", "localhost:", "localhost:99999", "here"] {
        f.refuses(
            &format!("render scene.toml {FLAGS} --display-server {address}"),
            2,
            &[address, "HOST:PORT"],
        );
    }
    f.refuses(
        &format!("render scene.toml {FLAGS} --display-server no-such-host.invalid:1"),
        3,
        &["no-such-host"],
    );
}

#[test]
fn a_server_that_leaves_or_sleeps_costs_a_warning() {
    // More than what the two ends of a connection hold for one that does not read.
    let large = "--size 1600x1100 --spp 1 -o a.png --threads 2";
    let f = Folder::new();
    let (address, serving) = server(|mut stream| {
        let _ = stream.read_exact(&mut [0; 8]);
    });
    let run = f.run(&format!("render scene.toml {large} --display-server {address}")).succeeds();
    serving.join().unwrap();
    assert_eq!(run.stderr.matches("warning").count(), 1, "{}", run.stderr);
    assert!(run.stderr.contains(&address) && f.names().contains(&"a.png".into()), "{}", run.stderr);

    let f = Folder::new();
    let (stop, stopped) = std::sync::mpsc::channel::<()>();
    let (address, serving) = server(move |stream| {
        let _ = stopped.recv_timeout(Duration::from_secs(60));
        drop(stream);
    });
    let run = f.run(&format!("render scene.toml {large} --display-server {address}")).succeeds();
    drop(stop);
    serving.join().unwrap();
    assert_eq!(run.stderr.matches("warning").count(), 1, "{}", run.stderr);
    assert!(run.stderr.contains("took nothing") && f.names().contains(&"a.png".into()), "{}", run.stderr);
}
