//! Reading an input file, whole or piece by piece, decompressing gzip and Zstandard data on the way.

use crate::error::{Error, Result};
use crate::memory;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::Path;

const GZIP_MAGIC: &[u8] = &[0x1f, 0x8b];
const ZSTD_MAGIC: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];

/// Compressed data may always grow to this many bytes, whatever its ratio.
const FREE_EXPANSION: u64 = 256 << 20;
/// Beyond that it may grow this many times. Text meshes reach 6, a flat generated grid about 50; bombs 1000 and more.
const MAX_RATIO: u64 = 200;
/// Bytes that are unpacked before the limit is looked at again.
const PIECE: usize = 1 << 20;

/// The bytes of a file, read from start to end; what gzip or Zstandard packed is unpacked on the way, recognised by its
/// first bytes and not by its name. Several packed streams one after another read as one.
pub struct Source<'a> {
    path: &'a Path,
    stream: Box<dyn Read + Send + 'a>,
    /// How it is packed.
    packing: Option<&'static str>,
    /// Bytes that may still come of packed data, and that might in all.
    left: u64,
    limit: u64,
    /// Bytes in all, where known.
    size: Option<u64>,
}

impl<'a> Source<'a> {
    /// Opens the file at `path`.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be opened or read; [`Error::Content`] if it is empty, or not packed though
    /// its name says so.
    pub fn open(path: &'a Path) -> Result<Self> {
        let fail = |e: std::io::Error| Error::file(path, "read", e);
        let file = std::fs::File::open(path).map_err(|e| Error::file(path, "open", e))?;
        let meta = file.metadata().map_err(fail)?;
        if meta.is_dir() {
            return Err(Error::file(path, "read", "it is a folder"));
        }
        #[cfg(unix)]
        if std::os::unix::fs::FileTypeExt::is_char_device(&meta.file_type()) {
            return Err(Error::file(path, "read", "it is a device, which may never end"));
        }
        let size = meta.is_file().then_some(meta.len());
        Source::of_stream(path, file, meta.len(), size)
    }

    /// Of the bytes of a file, packed or not; `path` is for messages and for the extension.
    ///
    /// # Errors
    /// As [`Source::open`], but for those of opening and reading.
    pub fn of_file_bytes(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let size = bytes.len() as u64;
        Source::of_stream(path, bytes, size, Some(size))
    }

    fn of_stream(
        path: &'a Path,
        mut file: impl Read + Send + 'a,
        length: u64,
        size: Option<u64>,
    ) -> Result<Self> {
        let fail = |e: std::io::Error| Error::file(path, "read", e);
        let mut head = Vec::new();
        (&mut file).take(ZSTD_MAGIC.len() as u64).read_to_end(&mut head).map_err(fail)?;
        let limit = FREE_EXPANSION.max(length.saturating_mul(MAX_RATIO));
        let (is_gzip, is_zstd) = (head.starts_with(GZIP_MAGIC), head.starts_with(ZSTD_MAGIC));
        if !is_gzip && !is_zstd {
            refuse_misnamed(path, &head)?;
        }
        let whole = Cursor::new(head).chain(file);
        let (stream, packing): (Box<dyn Read + Send + 'a>, _) = if is_gzip {
            (Box::new(flate2::bufread::MultiGzDecoder::new(BufReader::new(whole))), Some("gzip"))
        } else if is_zstd {
            (Box::new(ZstdFrames::new(BufReader::new(whole))), Some("Zstandard"))
        } else {
            (Box::new(whole), None)
        };
        let size = size.filter(|_| packing.is_none());
        Ok(Source { path, stream, packing, left: limit, limit, size })
    }

    /// Of bytes that are in memory, as they are; `path` is for messages.
    pub fn of_bytes(path: &'a Path, bytes: &'a [u8]) -> Self {
        let size = bytes.len() as u64;
        Source { path, stream: Box::new(bytes), packing: None, left: size, limit: size, size: Some(size) }
    }

    /// Appends the next `count` bytes to `buffer`, or what is left if that is less; returns how many.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read; [`Error::Content`] if packed data is damaged, or expands to more
    /// than 256 MiB and 200 times its size (a decompression bomb).
    pub fn fill(&mut self, buffer: &mut Vec<u8>, count: usize) -> Result<usize> {
        let read = (&mut self.stream).take(count as u64).read_to_end(buffer);
        let read = read.map_err(|e| match self.packing {
            None => Error::file(self.path, "read", e),
            Some(packing) => {
                Error::content(self.path, format!("the {packing} data is damaged or cut short: {e}"))
            }
        })?;
        if let Some(packing) = self.packing {
            self.left = self.left.checked_sub(read as u64).ok_or_else(|| self.too_large(packing))?;
        }
        Ok(read)
    }

    /// The first `count` bytes (or all, if there are fewer), which stay to be read.
    ///
    /// # Errors
    /// Those of [`Source::fill`].
    pub fn head(&mut self, count: usize) -> Result<Vec<u8>> {
        let mut head = Vec::new();
        self.fill(&mut head, count)?;
        self.left = self.left.saturating_add(head.len() as u64);
        let rest = std::mem::replace(&mut self.stream, Box::new(std::io::empty()));
        self.stream = Box::new(Cursor::new(head.clone()).chain(rest));
        Ok(head)
    }

    /// Bytes in all, where that is known before they are read: not of packed data, nor of a pipe.
    pub fn size(&self) -> Option<u64> {
        self.size
    }

    /// All bytes that are left.
    ///
    /// # Errors
    /// Those of [`Source::read_rest`].
    pub fn read_all(mut self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.read_rest(&mut bytes)?;
        Ok(bytes)
    }

    /// Appends all bytes that are left to `bytes`, which holds those before.
    ///
    /// # Errors
    /// Those of [`Source::fill`]; [`Error::File`] for a file that does not fit in memory.
    pub fn read_rest(&mut self, bytes: &mut Vec<u8>) -> Result<()> {
        let mut room = None;
        if let Some(size) = self.size {
            // A size that memory cannot hold is an error here and not an abort further on. The byte more spares the
            // vector a doubling when it looks for the end.
            let left = size.saturating_add(1).saturating_sub(bytes.len() as u64);
            room = Some(memory::room(left, || self.path.display().to_string())?);
            bytes.try_reserve_exact(usize::try_from(left).unwrap_or(usize::MAX)).map_err(|_| {
                Error::file(self.path, "read", format!("its {} MiB do not fit in memory", size >> 20))
            })?;
        }
        loop {
            // Packed data is asked for piece by piece, so that a bomb ends at its limit.
            let more = if self.packing.is_some() { PIECE } else { usize::MAX };
            if self.packing.is_some() {
                let what = || format!("{}, unpacked", self.path.display());
                drop(memory::room(bytes.len().max(PIECE) as u64, what)?);
            }
            if self.fill(bytes, more)? < more {
                drop(room);
                return Ok(());
            }
        }
    }

    fn too_large(&self, packing: &str) -> Error {
        Error::content(
            self.path,
            format!(
                "the {packing} data expands to more than {} MiB, over {MAX_RATIO} times its size; \
                 if it is to be trusted, unpack it first",
                self.limit >> 20
            ),
        )
    }
}

/// The bytes of the file at `path`, as [`Source`] gives them.
///
/// # Errors
/// Those of [`Source::open`] and [`Source::read_all`].
pub fn read(path: &Path) -> Result<Vec<u8>> {
    Source::open(path)?.read_all()
}

/// As [`read`], of the bytes of a file; `path` is for messages and for the extension.
///
/// # Errors
/// As [`read`], but for those of opening and reading.
pub fn unpacked(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    Source::of_file_bytes(path, bytes)?.read_all()
}

/// The extension that tells what is in the file, in lower case, with `.gz` or `.zst` stripped: `ply` for
/// `dragon.PLY.gz`. `None` where there is none.
pub fn content_extension(path: &Path) -> Option<String> {
    let lower = |p: &Path| p.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
    let last = lower(path)?;
    if is_packer(&last) { lower(Path::new(path.file_stem()?)) } else { Some(last) }
}

fn is_packer(extension: &str) -> bool {
    matches!(extension, "gz" | "zst")
}

fn refuse_misnamed(path: &Path, bytes: &[u8]) -> Result<()> {
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    if !bytes.is_empty() && !is_packer(&extension) {
        return Ok(());
    }
    let message = if bytes.is_empty() {
        "the file is empty".to_string()
    } else {
        format!("named .{extension}, but its first bytes are not those of gzip or Zstandard data")
    };
    Err(Error::content(path, message))
}

/// All frames of Zstandard data, one after another (`cat a.zst b.zst`, or what a parallel packer writes); frames
/// marked to be skipped are (RFC 8878, 3.1.2).
struct ZstdFrames<R> {
    packed: R,
    decoder: ruzstd::decoding::FrameDecoder,
    in_frame: bool,
}

impl<R: BufRead> ZstdFrames<R> {
    fn new(packed: R) -> Self {
        ZstdFrames { packed, decoder: ruzstd::decoding::FrameDecoder::new(), in_frame: false }
    }

    /// Enters the next frame; `false` at the end of the data.
    fn next_frame(&mut self) -> std::io::Result<bool> {
        use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
        while !self.packed.fill_buf()?.is_empty() {
            match self.decoder.init(&mut self.packed) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                    length,
                    ..
                })) => {
                    std::io::copy(&mut (&mut self.packed).take(u64::from(length)), &mut std::io::sink())?;
                }
                Err(e) => return Err(std::io::Error::other(e)),
            }
        }
        Ok(false)
    }
}

impl<R: BufRead> Read for ZstdFrames<R> {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        use ruzstd::decoding::BlockDecodingStrategy::UptoBlocks;
        loop {
            if !self.in_frame {
                if !self.next_frame()? {
                    return Ok(0);
                }
                self.in_frame = true;
            }
            if self.decoder.can_collect() > 0 {
                return self.decoder.read(buf);
            }
            if self.decoder.is_finished() {
                self.in_frame = false;
            } else {
                self.decoder.decode_blocks(&mut self.packed, UptoBlocks(1)).map_err(std::io::Error::other)?;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn gzip(data: &[u8]) -> Vec<u8> {
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        packer.write_all(data).unwrap();
        packer.finish().unwrap()
    }

    fn zstd(data: &[u8]) -> Vec<u8> {
        ruzstd::encoding::compress_to_vec(data, ruzstd::encoding::CompressionLevel::Fastest)
    }

    fn file(dir: &tempfile::TempDir, name: &str, bytes: &[u8]) -> std::path::PathBuf {
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    #[test]
    fn packed_files_read_as_their_content() {
        let dir = tempfile::tempdir().unwrap();
        let text: Vec<u8> =
            (0..20_000u32).flat_map(|i| format!("v {i} {} 0\n", i * i).into_bytes()).collect();
        for packed in [text.clone(), gzip(&text), zstd(&text)] {
            assert_eq!(read(&file(&dir, "any name", &packed)).unwrap(), text);
        }
        // Two streams in a row, with a skippable frame of five bytes between the Zstandard ones.
        let twice = [text.clone(), text.clone()].concat();
        assert_eq!(read(&file(&dir, "two", &[gzip(&text), gzip(&text)].concat())).unwrap(), twice);
        let skip = [0x50, 0x2a, 0x4d, 0x18, 5, 0, 0, 0, 1, 2, 3, 4, 5].to_vec();
        assert_eq!(read(&file(&dir, "two", &[zstd(&text), skip, zstd(&text)].concat())).unwrap(), twice);
    }

    #[test]
    fn a_bomb_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let bomb = gzip(&vec![0u8; (FREE_EXPANSION + (1 << 20)) as usize]);
        let e = read(&file(&dir, "bomb.ply.gz", &bomb)).unwrap_err();
        assert!(e.to_string().contains("expands to more than 256 MiB"), "{e}");
        assert_eq!(e.exit_code(), 2);
    }

    #[test]
    fn damaged_and_misnamed_files_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        let text = b"ply\nformat ascii 1.0\n".repeat(100);
        for packed in [gzip(&text), zstd(&text)] {
            for cut in [4, 6, packed.len() / 2, packed.len() - 5] {
                assert_eq!(
                    read(&file(&dir, "cut", &packed[..cut])).unwrap_err().exit_code(),
                    2,
                    "cut at {cut}"
                );
            }
        }
        let e = read(&file(&dir, "a.ply.gz", b"ply\n")).unwrap_err();
        assert!(e.to_string().contains("not those of gzip"), "{e}");
        assert!(read(&file(&dir, "a.ply", b"")).unwrap_err().to_string().contains("empty"));
        assert_eq!(read(&dir.path().join("absent.ply")).unwrap_err().exit_code(), 3);
        assert_eq!(read(dir.path()).unwrap_err().exit_code(), 3);
    }

    #[test]
    fn the_content_extension_ignores_packing_and_case() {
        for (name, want) in [
            ("a.ply", Some("ply")),
            ("a.b.OBJ.GZ", Some("obj")),
            ("x/a.Ply.zst", Some("ply")),
            ("a.gz", None),
            ("a", None),
        ] {
            assert_eq!(content_extension(Path::new(name)).as_deref(), want, "{name}");
        }
    }
}
