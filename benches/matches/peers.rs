//! How far other people's renderers are from the base pictures of the course's scenes: as measured by others (README.md
//! of the shared data), with Monte Carlo noise inside.

/// Another renderer's picture against the base.
#[derive(Debug, Clone, Copy)]
pub struct Peer {
    /// Name of the base picture.
    pub picture: &'static str,
    /// Channel means of the base, of 255.
    pub base: [f64; 3],
    /// Channel means of the other picture, of 255.
    pub mean: [f64; 3],
    /// Decibels, data range 255.
    pub psnr: f64,
    /// LDR-FLIP at 67 pixels per degree, mean.
    pub flip: f64,
}

/// What the others say of one picture.
#[derive(Debug, Clone, Copy)]
pub struct Agreement {
    /// How many there are.
    pub peers: usize,
    /// The largest relative difference of a channel's mean from the base.
    pub spread: f64,
    /// The worst.
    pub psnr: f64,
    /// The worst.
    pub flip: f64,
}

/// Agreement of all others about a base picture.
pub fn agreement(picture: &str) -> Agreement {
    let mut all = Agreement { peers: 0, spread: 0.0, psnr: f64::INFINITY, flip: 0.0 };
    for p in PEERS.iter().filter(|p| p.picture == picture) {
        let differences = p.mean.iter().zip(p.base).map(|(m, b)| (m / b - 1.0).abs());
        all.peers += 1;
        all.spread = differences.fold(all.spread, f64::max);
        all.psnr = all.psnr.min(p.psnr);
        all.flip = all.flip.max(p.flip);
    }
    all
}

const fn row(picture: &'static str, base: [f64; 3], mean: [f64; 3], psnr: f64, flip: f64) -> Peer {
    Peer { picture, base, mean, psnr, flip }
}

/// All of them: the programs of TobeyPineda, ayakak172, ZeshanRasul, whlee503 and yuyingyeh against that of
/// abhinandansharma1999.
pub const PEERS: &[Peer] = &[
    row("scene4-ambient.png", [44.43, 68.46, 71.83], [44.43, 68.46, 71.83], 59.65, 0.00004),
    row("scene4-ambient.png", [44.43, 68.46, 71.83], [44.43, 68.46, 71.83], 54.65, 0.00006),
    row("scene4-ambient.png", [44.43, 68.46, 71.83], [44.42, 68.46, 71.83], 51.64, 0.00011),
    row("scene4-diffuse.png", [13.14, 20.70, 22.63], [13.13, 20.69, 22.62], 44.38, 0.00048),
    row("scene4-diffuse.png", [13.14, 20.70, 22.63], [13.14, 20.70, 22.63], 55.85, 0.00005),
    row("scene4-emission.png", [44.43, 68.46, 71.83], [44.43, 68.46, 71.83], 59.65, 0.00004),
    row("scene4-emission.png", [44.43, 68.46, 71.83], [44.43, 68.46, 71.83], 54.65, 0.00006),
    row("scene4-emission.png", [44.43, 68.46, 71.83], [44.42, 68.46, 71.83], 51.64, 0.00011),
    row("scene4-specular.png", [4.28, 6.01, 4.64], [4.28, 6.01, 4.64], 64.07, 0.00004),
    row("scene4-specular.png", [4.28, 6.01, 4.64], [4.28, 6.01, 4.63], 63.18, 0.00008),
    row("scene5.png", [10.58, 14.20, 10.58], [10.59, 14.20, 10.59], 53.35, 0.00094),
    row("scene6.png", [74.67, 74.92, 44.67], [74.67, 74.93, 44.67], 52.35, 0.00006),
    row("scene6.png", [74.67, 74.92, 44.67], [74.67, 74.93, 44.67], 52.33, 0.00007),
    row("scene7.png", [18.31, 6.68, 6.68], [18.31, 6.68, 6.68], 60.16, 0.00003),
    row("scene7.png", [18.31, 6.68, 6.68], [18.31, 6.68, 6.68], 60.09, 0.00004),
    row("analytic.png", [35.52, 35.52, 46.17], [35.52, 35.52, 46.16], 51.86, 0.00003),
    row("analytic.png", [35.52, 35.52, 46.17], [35.52, 35.52, 46.17], 107.78, 0.00000),
    row("analytic.png", [35.52, 35.52, 46.17], [35.52, 35.52, 46.17], 99.33, 0.00000),
    row("analytic.png", [35.52, 35.52, 46.17], [35.52, 35.52, 46.17], 99.99, 0.00000),
    row("cornell.png", [44.15, 39.69, 23.69], [44.12, 39.65, 23.68], 45.57, 0.01163),
    row("cornell.png", [44.15, 39.69, 23.69], [44.12, 39.66, 23.68], 45.48, 0.01162),
    row("cornell.png", [44.15, 39.69, 23.69], [43.43, 39.08, 23.35], 42.02, 0.03154),
    row("cornell.png", [44.15, 39.69, 23.69], [44.12, 39.66, 23.68], 45.57, 0.01167),
    row("direct3x3.png", [35.52, 35.52, 46.17], [35.52, 35.52, 46.16], 39.35, 0.01158),
    row("direct3x3.png", [35.52, 35.52, 46.17], [35.52, 35.52, 46.16], 39.32, 0.01165),
    row("direct3x3.png", [35.52, 35.52, 46.17], [35.49, 35.49, 46.11], 39.25, 0.01176),
    row("direct3x3.png", [35.52, 35.52, 46.17], [35.52, 35.52, 46.17], 39.37, 0.01153),
    row("direct9.png", [35.53, 35.53, 46.18], [35.51, 35.51, 46.15], 30.49, 0.02404),
    row("direct9.png", [35.53, 35.53, 46.18], [35.53, 35.53, 46.18], 30.45, 0.02382),
    row("direct9.png", [35.53, 35.53, 46.18], [35.48, 35.48, 46.10], 30.50, 0.02390),
    row("direct9.png", [35.53, 35.53, 46.18], [35.51, 35.51, 46.15], 30.50, 0.02385),
    row("dragon.png", [46.78, 56.62, 39.06], [46.65, 56.49, 38.90], 45.51, 0.01346),
    row("dragon.png", [46.78, 56.62, 39.06], [46.65, 56.48, 38.90], 45.45, 0.01346),
    row("dragon.png", [46.78, 56.62, 39.06], [46.63, 56.47, 38.87], 44.93, 0.01480),
    row("sphere.png", [58.78, 34.47, 71.08], [58.76, 34.45, 71.05], 40.73, 0.01025),
    row("sphere.png", [58.78, 34.47, 71.08], [58.76, 34.46, 71.05], 40.66, 0.01028),
    row("sphere.png", [58.78, 34.47, 71.08], [58.76, 34.47, 71.06], 40.62, 0.01041),
    row("sphere.png", [58.78, 34.47, 71.08], [58.76, 34.46, 71.06], 40.67, 0.01007),
    row("cornellNEE.png", [88.74, 82.00, 38.23], [88.69, 81.92, 38.22], 22.35, 0.13694),
    row("cornellNEE.png", [88.74, 82.00, 38.23], [88.63, 81.74, 38.15], 21.97, 0.14099),
    row("cornellNEE.png", [88.74, 82.00, 38.23], [88.85, 81.52, 38.07], 21.99, 0.14081),
    row("cornellNEE.png", [88.74, 82.00, 38.23], [88.78, 82.01, 38.22], 22.36, 0.13735),
    row("cornellRR.png", [95.12, 88.24, 38.88], [95.00, 88.09, 38.82], 20.17, 0.18427),
    row("cornellRR.png", [95.12, 88.24, 38.88], [95.03, 88.03, 38.83], 19.92, 0.18808),
    row("cornellRR.png", [95.12, 88.24, 38.88], [95.98, 88.91, 38.90], 19.86, 0.18919),
    row("cornellRR.png", [95.12, 88.24, 38.88], [95.16, 88.25, 38.88], 20.21, 0.18455),
    row("cornellSimple.png", [70.65, 67.97, 34.98], [71.05, 68.44, 35.21], 8.04, 0.43401),
    row("cornellSimple.png", [70.65, 67.97, 34.98], [72.87, 70.32, 35.09], 8.06, 0.43802),
    row("cornellSimple.png", [70.65, 67.97, 34.98], [72.22, 69.70, 35.06], 8.07, 0.43691),
    row("cornellSimple.png", [70.65, 67.97, 34.98], [70.86, 68.55, 35.35], 8.03, 0.43378),
    row("dragonRR.png", [51.88, 67.27, 41.28], [51.75, 67.13, 41.17], 32.90, 0.05020),
    row("dragonRR.png", [51.88, 67.27, 41.28], [51.87, 67.26, 41.28], 33.14, 0.04734),
    row("cornellBRDF.png", [83.35, 73.00, 31.13], [83.26, 72.91, 31.06], 21.83, 0.15934),
    row("cornellBRDF.png", [83.35, 73.00, 31.13], [83.27, 72.74, 31.05], 21.37, 0.16353),
    row("cornellBRDF.png", [83.35, 73.00, 31.13], [80.46, 70.78, 30.43], 21.45, 0.17877),
    row("cornellCosine.png", [79.08, 69.62, 30.70], [79.03, 69.55, 30.71], 17.44, 0.25471),
    row("cornellCosine.png", [79.08, 69.62, 30.70], [78.98, 69.34, 30.61], 17.33, 0.25759),
    row("cornellCosine.png", [79.08, 69.62, 30.70], [77.93, 68.71, 30.20], 17.60, 0.24863),
    row("ggx.png", [176.55, 161.18, 156.40], [181.10, 162.23, 155.18], 23.53, 0.14367),
    row("ggx.png", [176.55, 161.18, 156.40], [175.77, 160.79, 156.09], 24.70, 0.10415),
    row("mis.png", [128.84, 132.48, 135.44], [128.56, 132.21, 135.19], 33.85, 0.03327),
];
