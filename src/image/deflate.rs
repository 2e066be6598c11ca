//! A zlib encoder (RFC 1950, RFC 1951) for what a pixel predictor leaves: bytes that crowd around one value, and
//! long runs. It codes runs and literals with a fresh Huffman table every few ten kilobytes and looks for no other
//! repetition. On rendered half-float pictures that gives files of the size of a general encoder's at a twentieth
//! of its time: what lets a picture be written within a few milliseconds.

/// Largest number of bytes that share a Huffman table; more than 2^16 - 1 would not fit a stored block.
const SEGMENT: usize = 48 << 10;

/// Longest code: four of them and seven waiting bits fit the bit buffer.
const MAX_CODE_BITS: usize = 14;

/// Literals and match lengths; symbol 256 ends a block.
const SYMBOLS: usize = 286;
const END_OF_BLOCK: usize = 256;

/// Longest match of the format.
const MAX_RUN: usize = 258;

/// Compresses `data`. It gets a new table at each of the `cuts` (ascending positions), where its nature changes.
pub(super) fn zlib(data: &[u8], cuts: &[usize]) -> Vec<u8> {
    let mut out = BitWriter::new(data.len() + data.len() / 8 + 64);
    // Deflate with a 32 KiB window, no dictionary, check bits (RFC 1950, section 2.2).
    out.put(0x0178, 16);
    let mut start = 0;
    for end in cuts.iter().copied().chain([data.len()]) {
        let end = end.clamp(start, data.len());
        for segment in data[start..end].chunks(SEGMENT) {
            write_block(&mut out, segment);
        }
        start = end;
    }
    // An empty stored block is the last one: cheaper than knowing beforehand which block that is.
    out.stored(&[], true);
    out.bytes(&adler32(data).to_be_bytes());
    out.finish()
}

/// Either so many literals or a run of the byte before.
#[derive(Clone, Copy)]
enum Token {
    Literals(u32),
    Run(u32),
}

fn write_block(out: &mut BitWriter, data: &[u8]) {
    let tokens = tokenise(data);
    let counts = count_symbols(data, &tokens);
    let lengths = code_lengths(&counts, MAX_CODE_BITS);
    let bits: u64 = counts.iter().zip(&lengths).map(|(&n, &l)| u64::from(n) * u64::from(l)).sum();
    // The table costs up to 250 bytes, a run up to 5 extra bits and one for its distance.
    if bits / 8 + 250 >= data.len() as u64 {
        return out.stored(data, false);
    }
    write_table(out, &lengths);
    let codes = codes(&lengths);
    let mut at = 0;
    for token in tokens {
        match token {
            Token::Literals(n) => {
                out.literals(&data[at..at + n as usize], &codes);
                at += n as usize;
            }
            Token::Run(n) => {
                let symbol = length_symbol(n as usize);
                let code = codes[symbol.symbol];
                out.put(code.bits.into(), code.len.into());
                // The one distance code, of one bit: distance 1.
                out.put(symbol.extra.into(), symbol.extra_bits + 1);
                at += n as usize;
            }
        }
    }
    let end = codes[END_OF_BLOCK];
    out.put(end.bits.into(), end.len.into());
}

/// Runs are looked for eight bytes at a time: shorter ones gain next to nothing over cheap literals.
fn tokenise(data: &[u8]) -> Vec<Token> {
    let mut tokens = Vec::with_capacity(64);
    let mut literals = 0;
    let mut at = 0;
    while at < data.len() {
        let run = if at == 0 { 0 } else { run_length(&data[at..], data[at - 1]) };
        if run < 8 {
            let n = 8.min(data.len() - at);
            literals += n as u32;
            at += n;
            continue;
        }
        if literals > 0 {
            tokens.push(Token::Literals(literals));
            literals = 0;
        }
        // No piece may fall below the format's least match of three.
        let mut left = run;
        while left > MAX_RUN {
            let piece = MAX_RUN.min(left - 3);
            tokens.push(Token::Run(piece as u32));
            left -= piece;
        }
        tokens.push(Token::Run(left as u32));
        at += run;
    }
    if literals > 0 {
        tokens.push(Token::Literals(literals));
    }
    tokens
}

/// How often `value` stands at the start of `data`, in steps of eight.
fn run_length(data: &[u8], value: u8) -> usize {
    let wanted = [value; 8];
    8 * data.chunks_exact(8).take_while(|c| **c == wanted).count()
}

fn count_symbols(data: &[u8], tokens: &[Token]) -> [u32; SYMBOLS] {
    // Four tables, so that equal neighbours do not wait for each other's store.
    let mut tables = [[0u32; 256]; 4];
    let mut counts = [0u32; SYMBOLS];
    let mut at = 0;
    for &token in tokens {
        match token {
            Token::Literals(n) => {
                let literals = &data[at..at + n as usize];
                let quads = literals.chunks_exact(4);
                quads.remainder().iter().for_each(|&b| tables[0][usize::from(b)] += 1);
                for quad in quads {
                    (0..4).for_each(|i| tables[i][usize::from(quad[i])] += 1);
                }
                at += n as usize;
            }
            Token::Run(n) => {
                counts[length_symbol(n as usize).symbol] += 1;
                at += n as usize;
            }
        }
    }
    for table in &tables {
        counts.iter_mut().zip(table).for_each(|(sum, n)| *sum += n);
    }
    counts[END_OF_BLOCK] = 1;
    counts
}

struct LengthSymbol {
    symbol: usize,
    extra: u32,
    extra_bits: u32,
}

/// RFC 1951, section 3.2.5: from length 11 on, four symbols for each number of extra bits.
fn length_symbol(length: usize) -> LengthSymbol {
    if length == MAX_RUN {
        return LengthSymbol { symbol: 285, extra: 0, extra_bits: 0 };
    }
    let from_three = length as u32 - 3;
    if from_three < 8 {
        return LengthSymbol { symbol: 257 + from_three as usize, extra: 0, extra_bits: 0 };
    }
    let extra_bits = from_three.ilog2() - 2;
    let symbol = 257 + 4 * extra_bits as usize + (from_three >> extra_bits) as usize;
    LengthSymbol { symbol, extra: from_three & ((1 << extra_bits) - 1), extra_bits }
}

/// Lengths of a Huffman code for these counts, none longer than `limit`; 0 for symbols that do not occur. At least
/// two symbols must occur.
fn code_lengths<const N: usize>(counts: &[u32; N], limit: usize) -> [u8; N] {
    let mut used: Vec<(u32, u16)> =
        counts.iter().enumerate().filter(|(_, n)| **n > 0).map(|(symbol, &n)| (n, symbol as u16)).collect();
    used.sort_unstable();
    let mut of_length = huffman_depths(&used);
    limit_depths(&mut of_length, limit);
    let mut lengths = [0; N];
    // The rarest symbols take the longest codes.
    let mut symbols = used.iter();
    for length in (1..of_length.len()).rev() {
        for &(_, symbol) in symbols.by_ref().take(of_length[length]) {
            lengths[usize::from(symbol)] = length as u8;
        }
    }
    lengths
}

/// Number of leaves at each depth of the Huffman tree over ascending weights, by the two-queue method (van Leeuwen
/// 1976): merged nodes come out in ascending order, so each step takes the two least of two queue heads.
fn huffman_depths(used: &[(u32, u16)]) -> Vec<usize> {
    let n = used.len();
    let mut weights: Vec<u64> = used.iter().map(|u| u64::from(u.0)).collect();
    let mut parent = vec![0usize; 2 * n - 1];
    let (mut leaf, mut merged) = (0, n);
    for node in n..2 * n - 1 {
        let mut sum = 0;
        for _ in 0..2 {
            let take_leaf = leaf < n && (merged >= node || weights[leaf] <= weights[merged]);
            let least = if take_leaf { &mut leaf } else { &mut merged };
            sum += weights[*least];
            parent[*least] = node;
            *least += 1;
        }
        weights.push(sum);
    }
    let mut depth = vec![0usize; 2 * n - 1];
    for node in (0..2 * n - 2).rev() {
        depth[node] = depth[parent[node]] + 1;
    }
    let mut of_length = vec![0; depth[..n].iter().max().map_or(1, |d| d + 1)];
    depth[..n].iter().for_each(|&d| of_length[d] += 1);
    of_length
}

/// Makes the code no deeper than `limit`: what is deeper moves up to it, and then, until the Kraft sum is 1 again,
/// a leaf of the limit goes down beside a shallower one.
fn limit_depths(of_length: &mut Vec<usize>, limit: usize) {
    if of_length.len() <= limit + 1 {
        return;
    }
    of_length[limit] += of_length[limit + 1..].iter().sum::<usize>();
    of_length.truncate(limit + 1);
    let mut kraft: usize = (1..=limit).map(|l| of_length[l] << (limit - l)).sum();
    while kraft > 1 << limit {
        let shallow =
            (1..limit).rev().find(|&l| of_length[l] > 0).expect("some code is shorter than the limit");
        of_length[limit] -= 1;
        of_length[shallow] -= 1;
        of_length[shallow + 1] += 2;
        kraft -= 1;
    }
}

#[derive(Clone, Copy, Default)]
struct Code {
    /// Reversed, as the format wants codes from their most significant bit on.
    bits: u16,
    len: u8,
}

/// The canonical code of these lengths (RFC 1951, section 3.2.2).
fn codes<const N: usize>(lengths: &[u8; N]) -> [Code; N] {
    let mut next = [0u16; 16];
    let mut code = 0;
    for len in 1..16u8 {
        next[usize::from(len)] = code;
        code = (code + lengths.iter().filter(|&&l| l == len).count() as u16) << 1;
    }
    lengths.map(|len| {
        if len == 0 {
            return Code::default();
        }
        let code = next[usize::from(len)];
        next[usize::from(len)] += 1;
        Code { bits: code.reverse_bits() >> (16 - len), len }
    })
}

/// The header of a dynamic block (RFC 1951, section 3.2.7), code lengths one by one.
fn write_table(out: &mut BitWriter, lengths: &[u8; SYMBOLS]) {
    const ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
    let used = lengths.iter().rposition(|&l| l > 0).map_or(257, |last| (last + 1).max(257));
    let all = lengths[..used].iter().copied().chain([1]);
    let mut counts = [0u32; 19];
    all.clone().for_each(|l| counts[usize::from(l)] += 1);
    // A code needs two symbols; the length 0 is always one of them or harmless.
    counts[0] = counts[0].max(1);
    let meta_lengths = code_lengths(&counts, 7);
    let meta = codes(&meta_lengths);
    // Not the last block, dynamic codes.
    out.put(0b100, 3);
    out.put(used as u64 - 257, 5);
    out.put(0, 5);
    out.put(19 - 4, 4);
    ORDER.iter().for_each(|&symbol| out.put(meta_lengths[symbol].into(), 3));
    all.for_each(|l| out.put(meta[usize::from(l)].bits.into(), meta[usize::from(l)].len.into()));
}

struct BitWriter {
    out: Vec<u8>,
    at: usize,
    /// Bits not yet written, the first in the lowest place.
    bits: u64,
    /// Their number, below 8 between calls.
    held: u32,
}

impl BitWriter {
    fn new(capacity: usize) -> Self {
        BitWriter { out: vec![0; capacity], at: 0, bits: 0, held: 0 }
    }

    /// Room for `bytes` more and one whole word.
    fn reserve(&mut self, bytes: usize) {
        if self.at + bytes + 8 > self.out.len() {
            self.out.resize(self.at + bytes + self.out.len() / 2 + 64, 0);
        }
    }

    #[inline(always)]
    fn flush(&mut self) {
        self.out[self.at..self.at + 8].copy_from_slice(&self.bits.to_le_bytes());
        let whole = self.held / 8;
        self.at += whole as usize;
        self.bits >>= 8 * whole;
        self.held &= 7;
    }

    fn put(&mut self, bits: u64, n: u32) {
        self.reserve(8);
        self.bits |= bits << self.held;
        self.held += n;
        self.flush();
    }

    fn literals(&mut self, data: &[u8], codes: &[Code; SYMBOLS]) {
        self.reserve(data.len() * MAX_CODE_BITS / 8 + 8);
        let quads = data.chunks_exact(4);
        let rest = quads.remainder();
        for quad in quads {
            for &byte in quad {
                let code = codes[usize::from(byte)];
                self.bits |= u64::from(code.bits) << self.held;
                self.held += u32::from(code.len);
            }
            self.flush();
        }
        for &byte in rest {
            let code = codes[usize::from(byte)];
            self.put(code.bits.into(), code.len.into());
        }
    }

    /// A block that is not compressed; at most 2^16 - 1 bytes.
    fn stored(&mut self, data: &[u8], last: bool) {
        self.put(last.into(), 3);
        let len = data.len() as u16;
        self.bytes(&len.to_le_bytes());
        self.bytes(&(!len).to_le_bytes());
        self.bytes(data);
    }

    /// Whole bytes, from the next byte boundary on.
    fn bytes(&mut self, data: &[u8]) {
        if self.held > 0 {
            self.put(0, 8 - self.held);
        }
        self.reserve(data.len());
        self.out[self.at..self.at + data.len()].copy_from_slice(data);
        self.at += data.len();
    }

    fn finish(mut self) -> Vec<u8> {
        self.out.truncate(self.at);
        self.out
    }
}

/// RFC 1950, section 8.2, with sums of 32 bytes at a time, which compilers vectorise.
fn adler32(data: &[u8]) -> u32 {
    const LANES: usize = 32;
    const MODULUS: u32 = 65521;
    let (mut a, mut b) = (1u32, 0u32);
    // So many bytes cannot overflow 32 bits (zlib's NMAX, rounded down to whole lanes).
    for piece in data.chunks(5536) {
        let lanes = piece.chunks_exact(LANES);
        let rest = lanes.remainder();
        for lane in lanes {
            let sum: u32 = lane.iter().map(|&v| u32::from(v)).sum();
            let weighted: u32 = lane.iter().zip(0..).map(|(&v, i)| u32::from(v) * (LANES as u32 - i)).sum();
            b += LANES as u32 * a + weighted;
            a += sum;
        }
        for &v in rest {
            a += u32::from(v);
            b += a;
        }
        a %= MODULUS;
        b %= MODULUS;
    }
    b << 16 | a
}

#[cfg(test)]
mod tests;
