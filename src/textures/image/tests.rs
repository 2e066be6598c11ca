use super::*;

fn texture(extra: &[(&str, Value)]) -> Arc<dyn Texture> {
    // Top row: red, green; bottom row: blue, white.
    let texels = vec![[255, 0, 0, 0], [0, 255, 0, 0], [0, 0, 255, 0], [255, 255, 255, 0]];
    let image = ImageData { width: 2, height: 2, texels: Texels::Srgb8(texels) };
    let params = Params::new().with("path", Value::image(image));
    (ROW.build)(&extra.iter().fold(params, |p, (n, v)| p.with(n, v.clone()))).expect("builds")
}

#[test]
fn v_points_up_and_texel_centres_are_exact() {
    let t = texture(&[]);
    let at = |u, v| t.eval(Vec2::new(u, v), 0.0).to_array();
    assert_eq!(at(0.25, 0.75), [1.0, 0.0, 0.0]);
    assert_eq!(at(0.75, 0.75), [0.0, 1.0, 0.0]);
    assert_eq!(at(0.25, 0.25), [0.0, 0.0, 1.0]);
    assert_eq!(at(0.75, 0.25), [1.0, 1.0, 1.0]);
    assert_eq!(at(0.5, 0.75), [0.5, 0.5, 0.0]);
    assert_eq!(at(0.5, 0.5), [0.5, 0.5, 0.5]);
}

#[test]
fn nearest_shows_whole_texels() {
    let t = texture(&[("filter", Value::Text("nearest".into()))]);
    let at = |u, v| t.eval(Vec2::new(u, v), 0.3).to_array();
    for (u, v) in [(0.0, 0.5), (0.49, 0.99), (0.25, 0.75), (1.0, 0.75)] {
        assert_eq!(at(u, v), [1.0, 0.0, 0.0], "{u} {v}");
    }
    assert_eq!(at(0.5, 0.5), [0.0, 1.0, 0.0]);
    assert_eq!(at(0.999, 0.499), [1.0, 1.0, 1.0]);
    assert_eq!(at(-0.75, -0.75), [0.0, 0.0, 1.0]);
    assert!(!t.uses_footprint());
}

#[test]
fn the_unit_square_is_continued_as_asked() {
    let word = |w: &str| ("wrap", Value::Text(w.into()));
    let red = [1.0, 0.0, 0.0];
    let at = |t: &Arc<dyn Texture>, u, v| t.eval(Vec2::new(u, v), 0.0).to_array();
    let t = texture(&[word("repeat")]);
    assert_eq!(at(&t, 3.25, -5.25), red);
    assert_eq!(at(&t, 0.0, 0.75), [0.5, 0.5, 0.0], "the seam blends the ends");
    let t = texture(&[word("clamp")]);
    assert_eq!(at(&t, -3.0, 7.0), red);
    assert_eq!(at(&t, 0.0, 0.75), red);
    let t = texture(&[word("mirror")]);
    assert_eq!(at(&t, -0.25, 0.75), red);
    assert_eq!(at(&t, 2.25, 1.25), red);
    assert_eq!(at(&t, 1.25, 0.75), [0.0, 1.0, 0.0]);
}

#[test]
fn scale_and_offset_move_the_picture() {
    let pair = |a, b| Value::Numbers(vec![a, b]);
    let t = texture(&[("uv_scale", pair(-1.0, 2.0)), ("uv_offset", pair(0.5, 0.25))]);
    // (0.25, 0.25) -> (0.25, 0.75)
    assert_eq!(t.eval(Vec2::new(0.25, 0.25), 0.0).to_array(), [1.0, 0.0, 0.0]);
}

#[test]
fn encodings_differ_where_they_should() {
    let grey = |extra: Option<&str>, texels| {
        let image = ImageData { width: 1, height: 1, texels };
        let mut p = Params::new().with("path", Value::image(image));
        if let Some(e) = extra {
            p = p.with("encoding", Value::Text(e.into()));
        }
        (ROW.build)(&p).expect("builds").mean().r
    };
    let bytes = vec![[128; 4]];
    // IEC 61966-2-1: code 128 is linear 0.2158605.
    for (encoding, texels, want) in [
        (None, Texels::Srgb8(bytes.clone()), 0.2158605),
        (None, Texels::Linear8(bytes.clone()), 128.0 / 255.0),
        (Some("linear"), Texels::Srgb8(bytes.clone()), 128.0 / 255.0),
        (Some("srgb"), Texels::Linear8(bytes), 0.2158605),
        (Some("srgb"), Texels::F32(vec![[2.5; 3]]), 2.5),
    ] {
        assert!((grey(encoding, texels) - want).abs() < 1e-6);
    }
}

#[test]
fn the_chain_keeps_the_mean_of_odd_sizes() {
    for (width, height) in [(7, 5), (1, 9), (64, 3), (16, 16), (1, 1)] {
        let texels = (0..width * height).map(|i| [(i * 7 % 11) as f32, 1.0, i as f32]).collect::<Vec<_>>();
        let mean = |t: &[[f32; 3]], c: usize| t.iter().map(|t| t[c] as f64).sum::<f64>() / t.len() as f64;
        let image = ImageData { width, height, texels: Texels::F32(texels.clone()) };
        let levels = mip::chain(&image, &SRGB8_TO_LINEAR);
        assert_eq!(levels.len() as u32, width.max(height).ilog2());
        for level in &levels {
            let Texels::F32(t) = &level.texels else { panic!("floats stay floats") };
            assert_eq!(t.len(), level.width * level.height);
            for c in 0..3 {
                // f32 weights, a few roundings a level.
                assert!((mean(t, c) / mean(&texels, c) - 1.0).abs() < 1e-5);
            }
        }
    }
}

#[test]
fn bytes_average_linearly_and_are_rounded_once() {
    let texels = (0..64 * 64).map(|i| if (i + i / 64) % 2 == 0 { [255; 4] } else { [0; 4] }).collect();
    let image = ImageData { width: 64, height: 64, texels: Texels::Srgb8(texels) };
    for level in mip::chain(&image, &SRGB8_TO_LINEAR) {
        // Linear 0.5 is code 187.5 of the curve.
        assert!((level.texel(0, 0).r - 0.5).abs() < 0.004, "half a code is 0.0036 there");
    }
}
