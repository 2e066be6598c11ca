//! A file cut into blocks of whole statements, so that it need not be in memory as a whole.

use super::statements::is_continued;
use crate::error::Result;
use crate::formats::source::Source;

/// Bytes of a block, about: what a core's own cache holds beside what is made of it. Nothing depends on it but speed.
const BLOCK: usize = 1 << 18;

/// The blocks of a file, one after another.
pub struct Blocks<'a> {
    source: Source<'a>,
    /// What is read of the next block.
    rest: Vec<u8>,
    size: usize,
    started: bool,
    ended: bool,
}

impl<'a> Blocks<'a> {
    /// Of all that `source` gives.
    pub fn new(source: Source<'a>) -> Self {
        Self::of_size(source, BLOCK)
    }

    /// With blocks of about `size` bytes.
    pub fn of_size(source: Source<'a>, size: usize) -> Self {
        Blocks { source, rest: Vec::new(), size, started: false, ended: false }
    }

    /// At most `count` more blocks; none at the end.
    ///
    /// # Errors
    /// Those of [`Source::fill`].
    pub fn next(&mut self, count: usize) -> Result<Vec<Vec<u8>>> {
        let mut blocks = Vec::with_capacity(count);
        while blocks.len() < count {
            match self.next_block()? {
                Some(block) => blocks.push(block),
                None => break,
            }
        }
        Ok(blocks)
    }

    fn next_block(&mut self) -> Result<Option<Vec<u8>>> {
        let mut block = Vec::with_capacity(self.size + self.rest.len());
        block.append(&mut self.rest);
        while !self.ended {
            // Doubling, so that a line of any length is looked through but a few times.
            let more = self.size.max(block.len());
            self.ended = self.source.fill(&mut block, more)? < more;
            if !self.ended
                && let Some(end) = last_statement_end(&block)
            {
                self.rest.extend_from_slice(&block[end..]);
                block.truncate(end);
                break;
            }
        }
        if !self.started && self.ended {
            end_lines_by_line_feeds(&mut block);
        }
        self.started = true;
        Ok(if block.is_empty() { None } else { Some(block) })
    }
}

/// Behind the last line end that surely ends a statement.
fn last_statement_end(text: &[u8]) -> Option<usize> {
    let mut end = memchr::memrchr(b'\n', text)?;
    loop {
        let before = memchr::memrchr(b'\n', &text[..end]);
        if !is_continued(&text[before.map_or(0, |b| b + 1)..end]) {
            return Some(end + 1);
        }
        end = before?;
    }
}

/// In the text of an old Macintosh, lines end in CR alone. `text` is a whole file: without a line feed there is but one
/// block.
fn end_lines_by_line_feeds(text: &mut [u8]) {
    if memchr::memchr(b'\n', text).is_none() {
        text.iter_mut().filter(|b| **b == b'\r').for_each(|b| *b = b'\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn blocks(text: &[u8], size: usize) -> Vec<Vec<u8>> {
        let mut blocks = Blocks::of_size(Source::of_bytes(Path::new("a.obj"), text), size);
        let mut all = Vec::new();
        loop {
            let more = blocks.next(2).unwrap();
            if more.is_empty() {
                return all;
            }
            all.extend(more);
        }
    }

    #[test]
    fn blocks_hold_whole_statements_and_all_of_them() {
        let text = b"v 1 2 3\nf 1 2 \\\n 3 \\ \r\n 4\nf 1 2 3\n\n\\\n\\\nlast \\";
        for size in 1..text.len() + 2 {
            let blocks = blocks(text, size);
            assert_eq!(blocks.concat(), text, "{size}");
            for block in &blocks[..blocks.len() - 1] {
                let line = block.strip_suffix(b"\n").expect("ends with a line");
                assert!(!is_continued(line), "{size}: {block:?}");
            }
        }
        assert!(blocks(text, 1).len() > 2);
        assert!(blocks(b"", 4).is_empty());
    }

    #[test]
    fn carriage_returns_alone_end_lines() {
        assert_eq!(blocks(b"v 1\rf 2\r", 2), [b"v 1\nf 2\n"]);
        assert_eq!(blocks(b"v 1\r\nf\r2\r\n", 1).concat(), b"v 1\r\nf\r2\r\n");
    }
}
