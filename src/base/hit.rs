//! What a kernel reports: which primitive, along which path of instances, and roughly where.

/// Primitive number of a miss.
pub const NO_PRIMITIVE: u32 = u32::MAX;

/// A hit as a kernel gives it. `t` is provisional: the shape's `refine` computes the point again in shared code,
/// so that two kernels that find the same primitive give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Hit {
    /// Provisional distance in lengths of the ray's direction.
    pub t: f32,
    /// Primitive within its shape.
    pub prim: u32,
    /// Which leaf, through which instances: see [`crate::base::geometry::Geometry::resolve`].
    pub path: u64,
}

/// Hits as a structure of arrays; `prim == NO_PRIMITIVE` is a miss, whose other fields mean nothing.
#[derive(Debug, Clone, Default)]
pub struct HitBatch {
    /// See [`Hit::t`].
    pub t: Vec<f32>,
    /// See [`Hit::prim`].
    pub prim: Vec<u32>,
    /// See [`Hit::path`].
    pub path: Vec<u64>,
}

impl HitBatch {
    /// Makes room for `n` hits, all of them misses.
    pub fn reset(&mut self, n: usize) {
        self.t.clear();
        self.t.resize(n, f32::INFINITY);
        self.prim.clear();
        self.prim.resize(n, NO_PRIMITIVE);
        self.path.clear();
        self.path.resize(n, 0);
    }

    /// Whether all are misses.
    pub fn none(&self) -> bool {
        // By pieces without a branch inside, which is vector code.
        self.prim.chunks(64).all(|c| c.iter().fold(true, |none, &p| none & (p == NO_PRIMITIVE)))
    }

    /// Hit `i`, or none.
    #[inline]
    pub fn get(&self, i: usize) -> Option<Hit> {
        (self.prim[i] != NO_PRIMITIVE).then(|| Hit { t: self.t[i], prim: self.prim[i], path: self.path[i] })
    }

    /// Sets hit `i`.
    #[inline]
    pub fn set(&mut self, i: usize, hit: Option<Hit>) {
        let h = hit.unwrap_or(Hit { t: f32::INFINITY, prim: NO_PRIMITIVE, path: 0 });
        self.t[i] = h.t;
        self.prim[i] = h.prim;
        self.path[i] = h.path;
    }
}
