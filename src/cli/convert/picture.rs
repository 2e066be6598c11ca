//! Pictures as pictures of other formats.

use super::PictureArgs;
use crate::cli::Setting;
use crate::error::{Error, Result, unknown_name};
use crate::image::false_color::{FalseColour, Range, paint};
use crate::image::load::{LoadOptions, load, load_whole};
use crate::image::picture::{Picture, SampleKind};
use crate::image::tonemap::Look;
use crate::image::write::{WriteOptions, check_writable, holds_radiance, write_picture};
use std::path::Path;

/// Writes the picture, or its false colours.
pub fn run(input: &Path, output: &Path, args: &PictureArgs, setting: &Setting) -> Result<()> {
    check_writable(output)?;
    let scale: Option<FalseColour> = args.false_colour.as_deref().map(str::parse).transpose()?;
    check_look(output, args)?;
    let exr = super::ends_in(output, "exr");
    let mut picture = read(input, args, exr && scale.is_none())?;
    if let Some(scale) = scale {
        picture = in_colours(input, &picture, scale, args, setting)?;
    } else if !exr {
        stand_for_colour(&mut picture);
    }
    write(picture, output, args)
}

/// Refuses flags of a look where there is none, and unknown tone operators.
fn check_look(output: &Path, args: &PictureArgs) -> Result<Look> {
    let radiance = holds_radiance(output, args.bits)?;
    let has = |flag: &str, why: &str| Err(Error::Usage(format!("{flag} does not go with {why}")));
    let of_radiance = format!("{}: it holds radiance", output.display());
    match (args.tonemap.is_some(), args.transfer.is_some()) {
        (true, _) if radiance => return has("--tonemap", &of_radiance),
        (_, true) if radiance => return has("--transfer", &of_radiance),
        (true, _) if args.false_colour.is_some() => return has("--tonemap", "--false-colour"),
        _ => {}
    }
    if args.exposure.is_some() && args.false_colour.is_some() {
        return has("--exposure", "--false-colour; --range says what is shown");
    }
    Ok(Look {
        exposure: args.exposure.unwrap_or(0.0) as f32,
        tonemap: args.tonemap.as_deref().map(str::parse).transpose()?.unwrap_or_default(),
        transfer: args.transfer.map_or_else(Default::default, |t| t.0),
    })
}

/// Writes a linear picture as the flags say.
pub fn write(mut picture: Picture, output: &Path, args: &PictureArgs) -> Result<()> {
    let mut look = check_look(output, args)?;
    if holds_radiance(output, args.bits)? && look.exposure != 0.0 {
        expose(&mut picture, look.exposure.exp2());
        look.exposure = 0.0;
    }
    if let (true, Some(bits)) = (super::ends_in(output, "exr"), args.bits) {
        let kind = if bits == 16 { SampleKind::Half } else { SampleKind::Float };
        picture.planes.iter_mut().for_each(|p| p.kind = kind);
    }
    // A fourth channel of PFM is not what most programs read.
    let alpha = !super::ends_in(output, "pfm") && is_covered_in_part(&picture);
    write_picture(output, &picture, &WriteOptions { look, alpha, bits: args.bits })
}

fn read(input: &Path, args: &PictureArgs, whole: bool) -> Result<Picture> {
    let encoding = args.encoding();
    match &args.layer {
        None if whole => load_whole(input, encoding),
        layer => load(input, &LoadOptions { layer: layer.clone(), encoding }).map(|l| l.into_linear()),
    }
}

fn is_covered_in_part(picture: &Picture) -> bool {
    picture.plane("A").is_some_and(|a| a.data.iter().any(|v| *v != 1.0))
}

/// Formats without names hold colour or gray: a vector's components are shown as colours, a layer's only channel as gray.
fn stand_for_colour(picture: &mut Picture) {
    let has = |name: &str| picture.plane(name).is_some();
    if has("X") && has("Y") && has("Z") && !has("R") {
        for plane in &mut picture.planes {
            let name = match &*plane.name {
                "X" => "R",
                "Y" => "G",
                "Z" => "B",
                _ => continue,
            };
            name.clone_into(&mut plane.name);
        }
    } else if let [only] = &mut picture.planes[..] {
        "Y".clone_into(&mut only.name);
    }
}

/// Multiplies the picture's own light; albedos, normals and the like are none.
fn expose(picture: &mut Picture, factor: f32) {
    for plane in picture.planes.iter_mut().filter(|p| ["R", "G", "B", "Y"].contains(&&*p.name)) {
        plane.data.iter_mut().for_each(|v| *v *= factor);
    }
}

fn in_colours(
    input: &Path,
    picture: &Picture,
    scale: FalseColour,
    args: &PictureArgs,
    setting: &Setting,
) -> Result<Picture> {
    let (what, values) = numbers(input, picture, args.channel.as_deref())?;
    let range = match args.range {
        Some(super::Ends([low, high])) => Range { low, high, log: args.log },
        None => Range::of(&values, args.log).ok_or_else(|| {
            let positive = if args.log { " positive and" } else { "" };
            Error::content(
                input,
                format!("no value of {what} is{positive} finite: --range must say the ends"),
            )
        })?,
    };
    if args.log && (range.low <= 0.0 || range.high <= 0.0) {
        return Err(Error::Usage("--log wants a --range of positive numbers".into()));
    }
    if !setting.quiet {
        let why = if args.range.is_none() { " (its 1 % and 99 % quantiles)" } else { "" };
        let how = if args.log { ", by ratios" } else { "" };
        eprintln!("{what} from {} to {}{why}{how}, in {scale}", range.low, range.high);
    }
    let nan = values.iter().filter(|v| v.is_nan()).count();
    if nan > 0 {
        log::warn!("{}: {nan} pixels are no numbers, and shown in magenta", input.display());
    }
    let mut shown = Picture { planes: Vec::new(), ..picture.clone() };
    for (name, data) in ["R", "G", "B"].into_iter().zip(paint(&values, scale, &range)) {
        shown.push(name, SampleKind::Float, data);
    }
    Ok(shown)
}

/// The numbers to show, and what they are called.
fn numbers(input: &Path, picture: &Picture, channel: Option<&str>) -> Result<(String, Vec<f32>)> {
    let names = || picture.planes.iter().map(|p| &*p.name);
    if let Some(wanted) = channel {
        let plane = picture.planes.iter().find(|p| p.name.eq_ignore_ascii_case(wanted));
        let plane = plane.ok_or_else(|| Error::content(input, unknown_name("channel", wanted, names())))?;
        return Ok((plane.name.clone(), plane.data.clone()));
    }
    if let [r, g, b] = ["R", "G", "B"].map(|n| picture.plane(n).map(|p| &p.data))
        && let (Some(r), Some(g), Some(b)) = (r, g, b)
    {
        let luminance = |i: usize| crate::color::Rgb::new(r[i], g[i], b[i]).luminance();
        return Ok(("luminance".to_owned(), (0..r.len()).map(luminance).collect()));
    }
    let others: Vec<_> = picture.planes.iter().filter(|p| p.name != "A").collect();
    match others[..] {
        [only] => Ok((only.name.clone(), only.data.clone())),
        _ => {
            let names: Vec<&str> = names().collect();
            Err(Error::Usage(format!("--channel must choose one of {}", names.join(", "))))
        }
    }
}
