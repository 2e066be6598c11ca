//! The verdict in words.

use super::pair::{Design, Reason};
use super::{Outcome, Place, Region, Share, StatisticalResult};

/// `0.2 %`, two digits that matter.
pub fn percent(share: f64) -> String {
    let value = 100.0 * share;
    if value == 0.0 || !value.is_finite() {
        return format!("{value} %");
    }
    let digits = (1 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    if value.abs() < 1e-4 { format!("{value:.1e} %") } else { format!("{value:.digits$} %") }
}

/// The same with its sign.
pub fn signed(share: f64) -> String {
    let sign = if share > 0.0 { "+" } else { "" };
    format!("{sign}{}", percent(share))
}

fn interval(s: &Share) -> String {
    format!("{} ({} to {})", signed(s.value), signed(s.low), signed(s.high))
}

impl Place {
    /// As a sentence names it.
    pub fn text(&self) -> String {
        match self {
            Place::Whole => "the whole picture".into(),
            Place::Tile { x0, y0, x1, y1 } => format!("the tile x {x0}..{x1}, y {y0}..{y1}"),
            Place::Object { name, .. } => name.clone(),
            Place::Mask { name } => format!("mask {name}"),
        }
    }
}

/// What a region's difference is: of luminance where that says it, of the colours too where they go apart.
pub fn difference(r: &Region) -> String {
    let Some(luminance) = &r.luminance else {
        let largest = r.finding.contrasts[3].difference / r.pixels.max(1) as f64;
        return format!("light of {largest:.2e} a pixel where the reference is black");
    };
    let colours = || {
        let named = ["red", "green", "blue"].into_iter().zip(&r.channels);
        let all = named.filter_map(|(name, s)| s.as_ref().map(|s| format!("{name} {}", interval(s))));
        all.collect::<Vec<_>>().join(", ")
    };
    // Luminance's own interval holds no 0: it says enough, unless channels are apart by more than they are wide.
    let apart = r.channels.iter().flatten().any(|s| s.low > luminance.high || s.high < luminance.low);
    if apart || luminance.low * luminance.high <= 0.0 { colours() } else { interval(luminance) }
}

fn probability(p: Option<f64>) -> String {
    match p {
        None => String::new(),
        Some(p) if p < 1e-4 => format!("p {p:.1e}"),
        Some(p) => format!("p {p:.4}"),
    }
}

/// The verdict in a sentence or two.
pub fn sentence(r: &StatisticalResult) -> String {
    let text = match r.outcome {
        Outcome::Identical => "the same: both have the same bits in every pixel and replicate".into(),
        Outcome::Same => {
            "the same but for rounding: no pixel has noise, and none differs by more than rounding explains"
                .into()
        }
        Outcome::NoDifference => nothing(r),
        Outcome::Different => different(r),
    };
    let left_out = left_out(r);
    text + design(r) + &left_out
}

fn nothing(r: &StatisticalResult) -> String {
    let seen = match r.whole.detectable {
        Some(b) if b < 1.0 => {
            format!("; a bias of {} would have been seen with 95 % probability", percent(b))
        }
        _ => "; the noise is so large that no bias below 100 % would surely have been seen".into(),
    };
    let smallest = r.regions.iter().filter_map(|o| o.detectable.map(|d| (d, o)));
    let weakest = smallest.filter(|(_, o)| o.luminance.is_some()).max_by(|a, b| a.0.total_cmp(&b.0));
    let object = match weakest {
        Some((d, o)) => format!(" (of {}, the least certain: {})", o.place.text(), percent(d)),
        None => String::new(),
    };
    format!("no difference found ({}){seen}{object}", probability(r.p))
}

fn different(r: &StatisticalResult) -> String {
    let exact: Vec<&Region> = r.regions.iter().chain(&r.tiles).filter(|t| t.exact).collect();
    let level = r.alpha;
    let found = r.regions.iter().filter(|o| o.rejected).min_by(by_p);
    let tiles: Vec<&Region> = r.tiles.iter().filter(|t| t.rejected).collect();
    let mut parts = Vec::new();
    if r.p.is_some_and(|p| p <= level) || exact.is_empty() {
        parts.push(format!("in {}, {}", r.whole.place.text(), difference(&r.whole)));
    }
    if let Some(o) = found {
        parts.push(format!("in {} ({} pixels), {}", o.place.text(), o.pixels, difference(o)));
    }
    if let Some(worst) = tiles.iter().copied().min_by(by_p) {
        parts.push(format!(
            "{} of {} tiles differ, most surely {}: {}",
            tiles.len(),
            r.tiles.len(),
            worst.place.text(),
            difference(worst)
        ));
    }
    if let Some(worst) = exact.iter().max_by(|a, b| a.finding.still.cmp(&b.finding.still)) {
        parts.push(format!(
            "{} pixels of {} have no noise and differ by up to {:.2e}, which is exact",
            worst.finding.still,
            worst.place.text(),
            worst.finding.largest_still
        ));
    }
    let p = match r.p {
        Some(p) => format!(" ({})", probability(Some(p))),
        None => String::new(),
    };
    format!("different{p}: {}; shares are test over reference, with their 95 % intervals", parts.join("; "))
}

fn by_p(a: &&Region, b: &&Region) -> std::cmp::Ordering {
    let key = |r: &Region| if r.exact { 0.0 } else { r.p.unwrap_or(1.0) };
    key(a).total_cmp(&key(b)).then(b.finding.t2.total_cmp(&a.finding.t2))
}

fn design(r: &StatisticalResult) -> &'static str {
    match (r.outcome, r.design, r.reason) {
        (Outcome::Identical | Outcome::Same, ..) | (_, Design::Independent, _) => "",
        (_, Design::Paired, Reason::SameSeed) => {
            ". Both were rendered with the same seed, so their noise is not independent: differences of their halves were tested"
        }
        (_, Design::Paired, Reason::SameNoise) => {
            ". Their noise goes together as if both had the same seed: differences of their replicates were tested"
        }
        (_, Design::Paired, _) => ". Differences of their replicates were tested, pair by pair",
    }
}

fn left_out(r: &StatisticalResult) -> String {
    let mut text = String::new();
    if r.not_finite > 0 {
        text += &format!(". {} pixels are not finite in one of them and were left out", r.not_finite);
    }
    if r.no_spread > 0 {
        text += &format!(". {} pixels have less than two replicates and were left out", r.no_spread);
    }
    text
}
