//! How values of flags are written.

use crate::color::Transfer;
use crate::formats::native::GAMMAS;
use std::num::NonZero;
use std::str::FromStr;
use std::time::Duration;

/// How many threads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Threads {
    /// So many.
    Count(NonZero<usize>),
    /// Half of what the machine runs at once.
    Half,
    /// All of it.
    Max,
}

/// More threads than any machine has are a slip of the finger.
const MAX_THREADS: usize = 4096;

impl Threads {
    /// At least 1.
    pub fn count(self) -> usize {
        let all = std::thread::available_parallelism().map_or(1, NonZero::get);
        match self {
            Threads::Count(n) => n.get(),
            Threads::Half => all.div_ceil(2),
            Threads::Max => all,
        }
    }
}

impl FromStr for Threads {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        match s {
            "half" => Ok(Threads::Half),
            "max" => Ok(Threads::Max),
            _ => s
                .parse()
                .ok()
                .filter(|n: &NonZero<usize>| n.get() <= MAX_THREADS)
                .map(Threads::Count)
                .ok_or_else(|| format!("takes a number from 1 to {MAX_THREADS}, half or max")),
        }
    }
}

/// `1920x1080`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size(pub [u32; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let (w, h) = s.split_once(['x', 'X']).ok_or("takes WIDTHxHEIGHT in pixels, such as 1920x1080")?;
        let side = |t: &str| t.parse().map_err(|_| format!("\"{t}\" is not a number of pixels"));
        let size = [side(w)?, side(h)?];
        crate::formats::native::check_film(size)?;
        Ok(Size(size))
    }
}

/// `srgb`, `linear` or a gamma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransferArg(pub Transfer);

impl FromStr for TransferArg {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        match s {
            "srgb" => Ok(TransferArg(Transfer::Srgb)),
            "linear" => Ok(TransferArg(Transfer::Gamma(1.0))),
            _ => number_in(s, GAMMAS).map(|gamma| TransferArg(Transfer::Gamma(gamma as f32))).map_err(|_| {
                format!("takes srgb, linear or a gamma from {} to {}", GAMMAS.start(), GAMMAS.end())
            }),
        }
    }
}

/// `60s`, `1.5m`, `2h`, `500ms`; a bare number is seconds.
pub fn duration(s: &str) -> Result<Duration, String> {
    let digits = s.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match &s[digits.len()..] {
        "ms" => 1e-3,
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        unit => return Err(format!("unknown unit \"{unit}\": ms, s, m or h")),
    };
    match digits.parse::<f64>() {
        Ok(v) if v > 0.0 && v * unit <= 1e9 => Ok(Duration::from_secs_f64(v * unit)),
        _ => Err("takes a time of more than 0, such as 60s, 5m or 1.5h".into()),
    }
}

/// A count within `range`: `871414`, `300k`, `1.5M`, `20M`, `1G`.
pub fn amount(s: &str, range: std::ops::RangeInclusive<u64>) -> Result<u64, String> {
    let digits = s.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match &s[digits.len()..] {
        "" => 1.0,
        "k" | "K" => 1e3,
        "M" => 1e6,
        "G" => 1e9,
        unit => return Err(format!("unknown unit \"{unit}\": k, M or G")),
    };
    let read = digits.parse::<f64>().ok().map(|v| (v * unit).round());
    match read {
        // Whole numbers of this size are exact.
        Some(v) if v >= *range.start() as f64 && v <= *range.end() as f64 => Ok(v as u64),
        _ => Err(format!("takes a count from {} to {}, such as 300k or 1M", range.start(), range.end())),
    }
}

/// `N` numbers between commas.
fn numbers<const N: usize>(s: &str, form: &str) -> Result<[f64; N], String> {
    let read = s.split(',').map(|t| t.trim().parse().ok().filter(|v: &f64| v.is_finite()));
    let list: Option<Vec<f64>> = read.collect();
    list.and_then(|l| l.try_into().ok()).ok_or_else(|| format!("takes {form}"))
}

/// `x0,x1,y0,y1`, fractions of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CropWindow(pub [f64; 4]);

impl FromStr for CropWindow {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        numbers(s, "x0,x1,y0,y1: four fractions of the picture").map(CropWindow)
    }
}

/// `AZ,EL`, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewAngles {
    /// About the upright axis.
    pub azimuth_deg: f64,
    /// Above the horizon.
    pub elevation_deg: f64,
}

impl FromStr for ViewAngles {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let [azimuth_deg, elevation_deg] = numbers(s, "azimuth,elevation in degrees, such as 30,15")?;
        if elevation_deg.abs() > 90.0 {
            return Err("the elevation runs from -90 to 90 degrees".into());
        }
        Ok(ViewAngles { azimuth_deg, elevation_deg })
    }
}

/// `sky`, `transparent`, or a colour: `R,G,B` in linear Rec. 709.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Background(pub crate::scene::desc::Background);

impl FromStr for Background {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        use crate::scene::desc::Background as B;
        Ok(Background(match s {
            "sky" => B::Sky,
            "transparent" => B::Transparent,
            _ => {
                let form = "sky, transparent or a colour R,G,B of linear numbers of at least 0";
                let rgb: [f64; 3] = numbers(s, form)?;
                if rgb.iter().any(|c| *c < 0.0 || *c > f64::from(f32::MAX)) {
                    return Err(format!("takes {form}"));
                }
                B::Color(rgb.map(|c| c as f32))
            }
        }))
    }
}

/// A share: `1%` or `0.01`, from 0 to 1.
pub fn share(s: &str) -> Result<f64, String> {
    let read = match s.strip_suffix('%') {
        Some(percent) => percent.trim_end().parse().map(|v: f64| v / 100.0),
        None => s.parse(),
    };
    match read {
        Ok(v) if (0.0..=1.0).contains(&v) => Ok(v),
        Ok(v) if v > 1.0 && v <= 100.0 && !s.ends_with('%') => Err(format!("is more than 1: {s}% is meant?")),
        _ => Err("takes a share such as 1% or 0.01, from 0 to 100%".into()),
    }
}

/// A finite number within `range`.
pub fn number_in(s: &str, range: std::ops::RangeInclusive<f64>) -> Result<f64, String> {
    match s.parse() {
        Ok(v) if range.contains(&v) => Ok(v),
        _ => Err(format!("takes a number from {} to {}", range.start(), range.end())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_or_refused_with_a_reason() {
        assert_eq!("3".parse(), Ok(Threads::Count(NonZero::new(3).unwrap())));
        assert_eq!("half".parse(), Ok(Threads::Half));
        assert!(["0", "-1", "some", "99999999"].iter().all(|s| s.parse::<Threads>().is_err()));
        assert_eq!("1920x1080".parse(), Ok(Size([1920, 1080])));
        assert!(
            ["0x5", "5", "5x", "65536x65536", "70000x1", "-1x5"].iter().all(|s| s.parse::<Size>().is_err())
        );
        assert_eq!(duration("90"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("1.5h"), Ok(Duration::from_secs(5400)));
        assert_eq!(duration("500ms"), Ok(Duration::from_millis(500)));
        assert!(["", "s", "0s", "-3s", "3d", "nans", "1e400", "inf"].iter().all(|s| duration(s).is_err()));
        assert_eq!(["1%", "0.01", "0", "100%"].map(share), [Ok(0.01), Ok(0.01), Ok(0.0), Ok(1.0)]);
        assert!(["-1%", "nan", "nan%", "101%", "5", "1e3%", "%", "", "x"].iter().all(|s| share(s).is_err()));
        assert_eq!(
            [amount("300k", 1..=9_000_000), amount("1.5M", 1..=9_000_000)],
            [Ok(300_000), Ok(1_500_000)]
        );
        assert!(
            ["", "M", "0", "1T", "-1", "nan", "1G", "1e99"].iter().all(|s| amount(s, 1..=9_000_000).is_err())
        );
        assert_eq!("0,0.5,0, 1".parse(), Ok(CropWindow([0.0, 0.5, 0.0, 1.0])));
        assert!(["0,1", "a,b,c,d", "0,1,0,nan"].iter().all(|s| s.parse::<CropWindow>().is_err()));
        assert_eq!("-30,15".parse(), Ok(ViewAngles { azimuth_deg: -30.0, elevation_deg: 15.0 }));
        assert!("0,91".parse::<ViewAngles>().is_err());
        assert!(["blue", "1,2", "-1,0,0", "1e39,0,0"].iter().all(|s| s.parse::<Background>().is_err()));
    }
}
