//! `--display-server`: the growing picture in a window of tev (<https://github.com/Tom94/tev>), by its protocol over TCP.
//!
//! One thread sends, and the threads that render never wait for it. A server that goes away or takes nothing costs a
//! warning and no more.

use super::canvas::{Canvas, Fetched};
use crate::base::pixel_rect::PixelRect;
use crate::error::{Error, Result};
use crate::render::Progress;
use std::io::ErrorKind;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

/// How long a connection may take.
const CONNECT: Duration = Duration::from_secs(5);
/// A server that takes nothing for so long is given up.
const STALL: Duration = Duration::from_secs(3);
/// After the render is written, what is left is sent for no longer.
const FAREWELL: Duration = Duration::from_secs(60);
/// Most tiles in a packet: 32 KiB of pixels.
const RUN: u32 = 8;
/// tev's own port.
const EXAMPLE: &str = "127.0.0.1:14158";

/// A server that listens.
pub struct Server {
    stream: TcpStream,
    address: String,
}

/// Connects, before anything is loaded.
///
/// # Errors
/// An address that is none, a server that does not answer.
pub fn connect(address: &str) -> Result<Server> {
    let has_port =
        address.rsplit_once(':').is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
    if !has_port {
        let message = format!("--display-server: \"{address}\" is no HOST:PORT, such as {EXAMPLE}");
        return Err(Error::Usage(message));
    }
    let fail = |reason: &dyn std::fmt::Display| {
        Error::file(Path::new(address), "connect to the display server", reason)
    };
    let mut last = None;
    for at in address.to_socket_addrs().map_err(|e| fail(&e))? {
        match TcpStream::connect_timeout(&at, CONNECT) {
            Ok(stream) => {
                stream.set_write_timeout(Some(STALL)).map_err(|e| fail(&e))?;
                // Packets are whole, and shall be seen at once.
                stream.set_nodelay(true).map_err(|e| fail(&e))?;
                return Ok(Server { stream, address: address.to_owned() });
            }
            Err(e) => last = Some(e),
        }
    }
    Err(last.map_or_else(|| fail(&"the name has no address"), |e| fail(&e)))
}

/// What is shown.
pub struct Shown {
    /// The window's title.
    pub name: String,
    /// Size of the whole frame.
    pub frame: [u32; 2],
    /// What of it is rendered.
    pub window: PixelRect,
    /// Whether what is behind everything is transparent.
    pub alpha: bool,
}

/// A picture that is being sent.
pub struct Live {
    canvas: Arc<Canvas>,
    address: String,
    /// Packets that the server took.
    sent: Arc<AtomicU64>,
    /// How it ended.
    end: Mutex<Receiver<Result<(), String>>>,
}

impl Live {
    /// Opens the picture there.
    ///
    /// # Errors
    /// No room for the pixels that wait, no thread.
    pub fn start(server: Server, shown: Shown) -> Result<Live> {
        let canvas = Arc::new(Canvas::new(shown.window)?);
        let sent = Arc::new(AtomicU64::new(0));
        let (tell, end) = mpsc::channel();
        let Server { stream, address } = server;
        let sender =
            Feed { client: TevClient::wrap(stream), canvas: canvas.clone(), sent: sent.clone(), shown };
        let started = thread::Builder::new().name("display-server".into()).spawn(move || sender.run(&tell));
        started.map_err(|e| Error::Internal(format!("cannot start a thread: {e}")))?;
        Ok(Live { canvas, address, sent, end: Mutex::new(end) })
    }

    /// Sends what is left, and says what went wrong; to be called when the picture is safe.
    pub fn finish(self) {
        self.canvas.close();
        let end = self.end.into_inner().unwrap_or_else(PoisonError::into_inner);
        let (start, mut before) = (Instant::now(), u64::MAX);
        let end = loop {
            let sent = self.sent.load(Ordering::Relaxed);
            let stalls = sent == before || start.elapsed() > FAREWELL;
            // Longer than one write may take, which knows better what was wrong.
            match end.recv_timeout(2 * STALL) {
                Ok(end) => break end,
                Err(RecvTimeoutError::Disconnected) => break Err("the sending thread fell".into()),
                Err(RecvTimeoutError::Timeout) if stalls => break Err("it is too slow".into()),
                Err(RecvTimeoutError::Timeout) => before = sent,
            }
        };
        if let Err(reason) = end {
            log::warn!("the display server {} did not get the whole picture: {reason}", self.address);
        }
    }
}

impl Progress for Live {
    fn wants_tiles(&self) -> bool {
        true
    }

    fn tile(&self, rect: PixelRect, means: &[[f32; 4]]) {
        self.canvas.put(rect, means);
    }
}

/// The thread that sends.
struct Feed {
    client: TevClient,
    canvas: Arc<Canvas>,
    sent: Arc<AtomicU64>,
    shown: Shown,
}

impl Feed {
    fn run(mut self, tell: &Sender<Result<(), String>>) {
        let end = self.send_all().map_err(|e| match e.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                format!("it took nothing for {} s", STALL.as_secs())
            }
            _ => e.to_string(),
        });
        // Nobody need fill it any more.
        self.canvas.close();
        // The receiver may have lost its patience.
        let _ = tell.send(end);
    }

    fn send_all(&mut self) -> std::io::Result<()> {
        let Shown { name, frame: [width, height], alpha, .. } = &self.shown;
        let names = &["R", "G", "B", "A"][..if *alpha { 4 } else { 3 }];
        let create = PacketCreateImage {
            image_name: name,
            grab_focus: true,
            width: *width,
            height: *height,
            channel_names: names,
        };
        self.client.send(create)?;
        let (mut pixels, mut data) = (Vec::new(), Vec::new());
        let n = names.len();
        let (offsets, strides) = ([0, 1, 2, 3], [n as u64; 4]);
        loop {
            let rect = match self.canvas.fetch(RUN, Duration::from_secs(3600), &mut pixels) {
                Fetched::Pixels(rect) => rect,
                Fetched::Nothing => continue,
                Fetched::End => return Ok(()),
            };
            data.clear();
            data.extend(pixels.iter().flat_map(|p| &p[..n]));
            let update = PacketUpdateImage {
                image_name: name,
                grab_focus: false,
                channel_names: names,
                channel_offsets: &offsets[..n],
                channel_strides: &strides[..n],
                x: rect.x0,
                y: rect.y0,
                width: rect.width(),
                height: rect.height(),
                data: &data,
            };
            self.client.send(update)?;
            self.sent.fetch_add(1, Ordering::Relaxed);
        }
    }
}
