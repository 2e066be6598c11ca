//! A picture as named float planes: what a film hands out, what an EXR file holds, what a comparison reads.

/// How a plane is stored in an EXR file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SampleKind {
    /// 16-bit float: 11 significant bits, largest value 65504.
    #[default]
    Half,
    /// 32-bit float.
    Float,
}

/// One named channel of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// `R`, `G`, `B`, `A` for the picture itself; `layer.channel` for the rest (`albedo.R`, `normal.X`).
    pub name: String,
    /// Precision in a file; the values here are always `f32`.
    pub kind: SampleKind,
    /// `width * height` values, row-major, the top row first.
    pub data: Vec<f32>,
}

/// Planes of equal size with the facts of how they came to be.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Picture {
    /// In pixels.
    pub width: usize,
    /// In pixels.
    pub height: usize,
    /// Where the left top pixel stands in the full frame, in pixels; not zero for a crop window.
    pub origin: [usize; 2],
    /// Width and height of the full frame, in pixels; at least `origin + size`.
    pub frame: [usize; 2],
    /// In no particular order; names are unique.
    pub planes: Vec<Plane>,
    /// Key and value, written to EXR as string attributes and to PNG as text: software, command, seed, ...
    pub metadata: Vec<(String, String)>,
}

impl Picture {
    /// A picture without planes that fills its frame.
    pub fn new(width: usize, height: usize) -> Self {
        Picture { width, height, frame: [width, height], ..Picture::default() }
    }

    /// The plane of exactly this name.
    pub fn plane(&self, name: &str) -> Option<&Plane> {
        self.planes.iter().find(|p| p.name == name)
    }

    /// Adds a plane; `data` has `width * height` values.
    pub fn push(&mut self, name: impl Into<String>, kind: SampleKind, data: Vec<f32>) {
        debug_assert_eq!(data.len(), self.width * self.height);
        self.planes.push(Plane { name: name.into(), kind, data });
    }
}
