//! Skies by name.
//!
//! Each is exposed as a photographer would: by the brightest channel of a white Lambertian plate turned to where it gets
//! most light, for a coloured light clips in that channel first. It is about 1.1 by day, so that an object of albedo 0.8
//! just stays below 1; 0.5 to 0.8 by night, which is to look like one; and 0.3 at dusk, whose horizon is several times
//! as bright as what it lights. Colours are those of a camera set to daylight, whose white is sunlight with some sky.

use crate::base::registry::{Node, Params, Value};

/// A preset: a kind and the parameters that differ from its defaults.
struct Preset {
    name: &'static str,
    doc: &'static str,
    kind: &'static str,
    numbers: &'static [(&'static str, f64)],
    ground_albedo: Option<[f64; 3]>,
}

static PRESETS: &[Preset] = &[
    Preset {
        name: "midday",
        doc: "a high sun in a clear sky",
        kind: "daylight",
        numbers: &[
            ("sun_elevation_deg", 52.0),
            ("sun_azimuth_deg", 55.0),
            // A sky about as bright as a photographer knows it; above 3 it turns white around the sun.
            ("turbidity", 2.3),
            ("white_k", 5600.0),
            ("scale", 1.22),
        ],
        // Dry grass and soil: light from below is warm.
        ground_albedo: Some([0.18, 0.17, 0.125]),
    },
    Preset {
        name: "sunset",
        doc: "a low red sun",
        kind: "daylight",
        numbers: &[
            ("sun_elevation_deg", 3.5),
            ("sun_azimuth_deg", 20.0),
            // Little haze: with 2 the sky gives two fifths of a plate's light instead of a quarter, most of it from a
            // glow about the sun that is white.
            ("turbidity", 1.5),
            ("white_k", 5800.0),
            ("scale", 3.7),
        ],
        // Sand: in so flat a light anything darker is black.
        ground_albedo: Some([0.30, 0.28, 0.25]),
    },
    Preset {
        name: "dusk",
        doc: "the blue hour, after the sun has set",
        kind: "daylight",
        numbers: &[
            ("sun_elevation_deg", -4.0),
            ("sun_azimuth_deg", 20.0),
            ("turbidity", 1.8),
            ("scale", 370.0),
        ],
        ground_albedo: None,
    },
    Preset {
        name: "night",
        doc: "stars, the Milky Way and a moon",
        kind: "night",
        numbers: &[],
        ground_albedo: None,
    },
    Preset {
        name: "nebula",
        doc: "glowing clouds among stars",
        kind: "nebula",
        numbers: &[],
        ground_albedo: None,
    },
];

/// Names of all presets with what they show.
pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
    PRESETS.iter().map(|p| (p.name, p.doc))
}

/// The sky of this name.
pub fn preset(name: &str) -> Option<Node> {
    expand(&Node { kind: name.to_owned(), ..Node::default() })
}

/// The sky that a node means whose kind is the name of a preset; the node's own parameters win over the preset's.
/// None if there is no preset of that name.
pub fn expand(node: &Node) -> Option<Node> {
    let preset = PRESETS.iter().find(|p| p.name == node.kind)?;
    let mut params = Params { list: Vec::new(), place: node.params.place.clone() };
    for &(name, value) in preset.numbers {
        params = params.with(name, Value::Number(value));
    }
    if let Some(c) = preset.ground_albedo {
        params = params.with("ground_albedo", Value::Numbers(c.to_vec()));
    }
    params.list.retain(|p| node.params.get(&p.name).is_none());
    params.list.extend(node.params.list.iter().cloned());
    Some(Node { kind: preset.kind.to_owned(), params, place: node.place.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::registry::build;
    use crate::base::skybox::Skybox;
    use crate::color::Rgb;
    use crate::skyboxes::REGISTRY;
    use glam::DVec3;
    use std::f64::consts::{PI, TAU};

    /// Radiance of a white plate with this normal.
    fn plate(sky: &dyn Skybox, n: DVec3) -> Rgb {
        let (rows, columns) = (32, 64);
        let mut sum = Rgb::BLACK;
        for i in 0..rows * columns {
            let y = 1.0 - (2 * (i / columns) + 1) as f64 / f64::from(rows);
            let (sin, cos) = (TAU * f64::from(i % columns) / f64::from(columns)).sin_cos();
            let d = DVec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin);
            let cell = 4.0 * PI / f64::from(rows * columns);
            sum += sky.radiance(d.as_vec3()) * (d.dot(n).max(0.0) * cell) as f32;
        }
        for disc in sky.discs() {
            sum += disc.radiance * (disc.solid_angle() * disc.toward.dot(n).max(0.0)) as f32;
        }
        sum * (1.0 / PI) as f32
    }

    #[test]
    fn presets_are_exposed() {
        for (name, _) in names() {
            let mut node = preset(name).unwrap();
            if node.kind != "daylight" {
                node.params = node.params.with("size", Value::Number(64.0));
            }
            let sky = build("sky", REGISTRY, &node).unwrap();
            let toward = |i: i32| {
                let y = f64::from(i / 8) / 4.0;
                let (sin, cos) = (TAU * f64::from(i % 8) / 8.0).sin_cos();
                DVec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin)
            };
            let mut normals: Vec<DVec3> = (0..40).map(toward).collect();
            normals.extend(sky.discs().iter().map(|d| d.toward));
            let brightest = |n: &DVec3| plate(&*sky, *n).max_component();
            let best = normals.iter().map(brightest).fold(0.0, f32::max);
            // What the head of this file says, within a sixth of a stop.
            let range = match name {
                "dusk" => 0.27..0.37,
                "night" | "nebula" => 0.45..0.9,
                _ => 0.98..1.23,
            };
            assert!(range.contains(&best), "{name}: {best}");
        }
    }

    #[test]
    fn white_is_white_at_midday() {
        // Sunlight with some sky on level ground, to a camera set to daylight: no channel is off by more than a tenth of
        // the luminance, of which a viewer takes no note.
        let sky = build("sky", REGISTRY, &preset("midday").unwrap()).unwrap();
        let c = plate(&*sky, DVec3::Y);
        assert!(c.to_array().iter().all(|v| (v / c.luminance() - 1.0).abs() < 0.1), "{c:?}");
    }

    #[test]
    fn own_parameters_win() {
        let params = Params::new().with("turbidity", Value::Number(4.0));
        let node = expand(&Node { kind: "sunset".into(), params, ..Node::default() }).unwrap();
        assert_eq!(node.kind, "daylight");
        assert_eq!(node.params.number_or("turbidity", 0.0).unwrap(), 4.0);
        assert_eq!(node.params.list.iter().filter(|p| p.name == "turbidity").count(), 1);
        assert!(preset("noon").is_none());
    }
}
