//! From a ray's key back to the sample that it belongs to: keys are hashes of (pixel, sample, depth), and a tile has few
//! enough of those to try them all.

use crate::base::intersectable::QueryKind;
use crate::base::pixel_rect::PixelRect;
use crate::render::block::replicate_indices;
use crate::render::settings::RenderSettings;
use crate::sampler::{SHADOW_KEY, ray_key};
use serde::Serialize;
use std::collections::HashMap;

/// What a ray was for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RayKind {
    /// From the camera.
    Camera,
    /// Scattered, for the closest hit.
    Bounce,
    /// Whether anything is in the way.
    Shadow,
}

impl RayKind {
    /// For people.
    pub fn text(self) -> &'static str {
        match self {
            RayKind::Camera => "camera",
            RayKind::Bounce => "bounce",
            RayKind::Shadow => "shadow",
        }
    }
}

/// Where a ray comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Source {
    /// The pixel, from the left top.
    pub pixel: [u32; 2],
    /// The sample of the pixel.
    pub sample: u32,
    /// Surfaces from the camera on; camera rays have depth 1, as have the shadow rays of what they meet.
    pub depth: u32,
    /// What it was for.
    pub kind: RayKind,
}

/// Deeper rays are not found: tracing so far is possible, but no integrator's default.
const MAX_DEPTH: u32 = 256;

/// The sources of rays of one tile by their keys, for those of `wanted` that are found. Keys have 32 bits: of a tile's
/// hundred thousand, two are alike with a chance of 1e-5 for each ray asked; then the first counts.
pub fn sources(
    rect: PixelRect,
    settings: &RenderSettings,
    wanted: &[(u32, QueryKind)],
) -> HashMap<(u32, QueryKind), Source> {
    let mut left: HashMap<u32, Vec<QueryKind>> = HashMap::new();
    for (key, query) in wanted {
        let queries = left.entry(*key).or_default();
        if !queries.contains(query) {
            queries.push(*query);
        }
    }
    let mut found = HashMap::new();
    let replicates = settings.replicates();
    for depth in 1..=MAX_DEPTH {
        if left.is_empty() {
            break;
        }
        for [x, y] in rect.pixels().map(|(x, y)| [x, y]) {
            for r in 0..replicates {
                for index in replicate_indices(&(0..settings.spp), r, replicates) {
                    let key = ray_key(ray_key(x, y, r), index, depth);
                    for key in [key, key ^ SHADOW_KEY] {
                        let Some(queries) = left.remove(&key) else { continue };
                        let sample = index * replicates + r;
                        for query in queries {
                            let kind = kind_of(query, depth);
                            found.insert((key, query), Source { pixel: [x, y], sample, depth, kind });
                        }
                    }
                }
            }
        }
    }
    found
}

fn kind_of(query: QueryKind, depth: u32) -> RayKind {
    match query {
        QueryKind::Any => RayKind::Shadow,
        QueryKind::Closest if depth == 1 => RayKind::Camera,
        QueryKind::Closest => RayKind::Bounce,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_lead_back_to_their_samples() {
        let rect = PixelRect::new(32, 16, 48, 32);
        let key = |x, y, r, index, depth| ray_key(ray_key(x, y, r), index, depth);
        let (camera, deep) = (key(40, 20, 1, 3, 1), key(33, 31, 0, 0, 9));
        let foreign = key(5, 5, 0, 0, 1);
        let shadow = key(47, 16, 0, 2, 2) ^ SHADOW_KEY;
        let wanted = [
            (camera, QueryKind::Closest),
            (deep, QueryKind::Closest),
            (deep, QueryKind::Any),
            (shadow, QueryKind::Any),
            (foreign, QueryKind::Any),
        ];
        let settings = RenderSettings { spp: 8, moments: true, ..RenderSettings::new([64, 64]) };
        let found = sources(rect, &settings, &wanted);
        let at = |key, query| found.get(&(key, query)).copied();
        let source = |pixel, sample, depth, kind| Some(Source { pixel, sample, depth, kind });
        assert_eq!(at(camera, QueryKind::Closest), source([40, 20], 7, 1, RayKind::Camera));
        assert_eq!(at(deep, QueryKind::Closest), source([33, 31], 0, 9, RayKind::Bounce));
        assert_eq!(at(deep, QueryKind::Any), source([33, 31], 0, 9, RayKind::Shadow));
        assert_eq!(at(shadow, QueryKind::Any), source([47, 16], 4, 2, RayKind::Shadow));
        assert_eq!(found.len(), 4, "a ray of another tile is not found here");
    }
}
