use super::*;

fn air(elevation_deg: f64) -> Atmosphere {
    let e = elevation_deg.to_radians();
    Atmosphere::new(DVec3::new(e.cos(), e.sin(), 0.0), 2.0, [0.2; LANES])
}

#[test]
fn vertical_columns_are_scale_heights() {
    let c = rising(GROUND, 1.0);
    // exp(-80 / 8) of the molecules lie above the top; the steps err by under a per cent.
    assert!((f64::from(c.rayleigh) / RAYLEIGH_HEIGHT - 1.0).abs() < 3e-3, "{c:?}");
    assert!((f64::from(c.haze) / HAZE_HEIGHT - 1.0).abs() < 1e-2, "{c:?}");
    assert!((f64::from(c.ozone) / OZONE_HALF_WIDTH - 1.0).abs() < 1e-2, "{c:?}");
}

#[test]
fn air_mass_at_the_horizon_is_that_of_chapman() {
    // Chapman's grazing incidence function at 90 degrees: sqrt(pi R / 2 H) for R much larger than H.
    let c = rising(GROUND, 0.0);
    let want = (PI * GROUND / (2.0 * RAYLEIGH_HEIGHT)).sqrt();
    assert!((f64::from(c.rayleigh) / RAYLEIGH_HEIGHT / want - 1.0).abs() < 1e-2, "{c:?} {want}");
}

#[test]
fn the_table_of_columns_holds_what_integration_gives() {
    let a = air(30.0);
    // Heights between those of the table, about the ends of the ozone layer, and above; down to the horizon.
    for height in [0.0, 0.3, 2.0, 11.0, 24.0, 38.0, 39.8, 40.0, 55.0] {
        let r = GROUND + height;
        for mu in [horizon(r), 0.5 * horizon(r), 0.0, 0.005, 0.02, 0.1, 0.3, 0.7, 1.0] {
            let want = if mu >= 0.0 {
                rising(r, mu)
            } else {
                let lowest = rising(r * (1.0 - mu * mu).sqrt(), 0.0);
                lowest.zip(rising(r, -mu), |whole, behind| 2.0 * whole - behind)
            };
            let got = a.columns_at(r, mu);
            let strongest = |s: &Spectrum| s.iter().copied().fold(0.0, f32::max);
            // Bilinear interpolation of masses: 0.6 % off at worst where they bend most, next to the ground and the
            // horizon. Where ozone's layer ends its masses have no limit, but what is left of it is less than a
            // thousandth of an optical depth.
            for (g, w, per_km) in [
                (got.rayleigh, want.rayleigh, strongest(&a.rayleigh)),
                (got.haze, want.haze, strongest(&a.haze)),
                (got.ozone, want.ozone, strongest(&a.ozone)),
            ] {
                assert!((g - w).abs() < 0.01 * w + 1e-3 / per_km, "{height} {mu}: {got:?} {want:?}");
            }
        }
    }
}

#[test]
fn light_is_not_made_from_nothing() {
    // Without absorption, what one square metre of the top is given comes back or heats the ground: the radiance
    // anywhere stays below that of a white plate facing the sun, but for the haze's forward peak.
    let a = air(60.0);
    for y in [0.05, 0.3, 0.9] {
        let r = f64::sqrt(1.0 - y * y);
        let l = a.arriving(0.0, DVec3::new(-r, y, 0.0), 32);
        for i in 0..LANES {
            let scattered = (l.rayleigh[i] + l.haze[i]) * 0.25 * FRAC_1_PI + l.multiple[i];
            assert!(scattered > 0.0 && scattered < FRAC_1_PI, "{y} {i}: {scattered}");
            assert!(l.transmittance[i] > 0.0 && l.transmittance[i] < 1.0);
        }
        assert!(l.multiple[0] > l.multiple[LANES - 1], "the sky is not blue");
    }
}

#[test]
fn the_sun_sets() {
    assert!(air(-2.0).sunlight(0.0) == [0.0; LANES]);
    let (low, high) = (air(3.0).sunlight(0.0), air(60.0).sunlight(0.0));
    // A low sun is dimmer and redder.
    assert!(low[15] < high[15] && low[0] / low[15] < 0.2 * high[0] / high[15]);
}
