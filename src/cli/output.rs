//! Flags that say what is written, and the writing.

use super::args::{TransferArg, number_in};
use super::denoise::{self, DenoiseReport};
use crate::color::Transfer;
use crate::error::Result;
use crate::image::picture::SampleKind;
use crate::image::tonemap::{Look, ToneMap};
use crate::image::write::{WriteOptions, check_writable, write_picture};
use crate::render::Rendered;
use crate::render::aov::{self, AovRow};
use crate::render::film_layers::{self, FilmLayer};
use crate::scene::desc::Background;
use clap::Args;
use std::path::{Path, PathBuf};

/// Flags of what is written.
#[derive(Args)]
#[command(next_help_heading = "Output")]
pub struct OutputArgs {
    /// The picture to write; the extension says how: exr, hdr, pfm and tiff hold radiance, png and jpg what a display shows. May
    /// be given several times
    #[arg(short, long = "output", required_unless_present = "explain", value_name = "OUT.exr|png|...")]
    outputs: Vec<PathBuf>,
    /// Further layers, for EXR (see `skylit list aov`)
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    aov: Vec<String>,
    /// Add the picture without its noise as layer `denoised`, and show that one in PNG and JPEG: fitted to albedo, normal
    /// and depth around, so smooth and near the truth, but not unbiased
    #[arg(long)]
    denoise: bool,
    /// Stops of exposure, for PNG and JPEG [default: 0]
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = |s: &str| number_in(s, -64.0..=64.0))]
    exposure: Option<f64>,
    /// Tone operator, for PNG and JPEG (see `skylit list tonemap`) [default: none]
    #[arg(long, value_name = "NAME")]
    tonemap: Option<String>,
    /// Curve of PNG and JPEG: srgb, linear, or a gamma such as 2.2 [default: the scene's, which is srgb]
    #[arg(long, value_name = "srgb|linear|GAMMA")]
    transfer: Option<TransferArg>,
    /// Floats of 32 instead of 16 bits in EXR
    #[arg(long)]
    full_float: bool,
}

/// Names looked up and outputs tried.
pub struct OutputPlan {
    /// Layers read from first surfaces.
    pub aovs: Vec<&'static AovRow>,
    /// Those that are written.
    written: Vec<&'static AovRow>,
    film_layers: Vec<&'static FilmLayer>,
    /// Whether a layer without noise is made.
    pub denoises: bool,
    /// Whether the picture must know its own error.
    pub moments: bool,
    /// Whether pixels must have points of their own.
    pub independent: bool,
    look: Look,
}

impl OutputArgs {
    /// The first picture that is written.
    pub fn first(&self) -> &Path {
        self.outputs.first().map_or(Path::new(""), PathBuf::as_path)
    }

    /// Errors for unknown names, and where a picture could not be written.
    pub fn check(&self) -> Result<OutputPlan> {
        let names: Vec<&str> = self.aov.iter().map(String::as_str).collect();
        let written = aov::find(&names)?;
        let mut aovs = written.clone();
        if self.denoise {
            let more = aov::find(&denoise::FEATURES)?;
            aovs.extend(more.into_iter().filter(|row| !written.iter().any(|w| w.name == row.name)));
        }
        let tonemap: Option<ToneMap> = self.tonemap.as_deref().map(str::parse).transpose()?;
        self.outputs.iter().try_for_each(|path| check_writable(path))?;
        let exposure = self.exposure.unwrap_or(0.0) as f32;
        let film_layers: Vec<_> = film_layers::REGISTRY.iter().filter(|f| names.contains(&f.name)).collect();
        Ok(OutputPlan {
            denoises: self.denoise,
            moments: self.denoise || film_layers.iter().any(|f| f.needs_moments),
            independent: film_layers.iter().any(|f| f.needs_independence),
            aovs,
            written,
            film_layers,
            look: Look { exposure, tonemap: tonemap.unwrap_or_default(), ..Look::default() },
        })
    }

    /// How pictures of 8 bits show the scene, whose own curve this is.
    pub fn look(&self, plan: &OutputPlan, of_scene: Transfer) -> Look {
        Look { transfer: self.transfer.map_or(of_scene, |TransferArg(t)| t), ..plan.look }
    }

    /// Writes every output, each whole or not at all; tells what was done to the noise.
    pub fn write(
        &self,
        plan: &OutputPlan,
        rendered: &Rendered,
        info: &PictureInfo,
    ) -> Result<Option<DenoiseReport>> {
        let mut picture =
            rendered.film.picture(if self.full_float { SampleKind::Float } else { SampleKind::Half });
        rendered.layers.push_planes(&mut picture);
        plan.film_layers.iter().for_each(|layer| (layer.push)(&rendered.film, &mut picture));
        picture.metadata = info.metadata.clone();
        let report = match self.denoise {
            true => Some(denoise::add_layer(&rendered.film, &mut picture)?),
            false => None,
        };
        denoise::drop_unwanted(&mut picture, &plan.written);
        let has_layers = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        let shows_one = self.denoise && !self.outputs.iter().all(|path| has_layers(path));
        let shown = shows_one.then(|| denoise::shown(&picture));
        let look = self.look(plan, info.transfer);
        let alpha = info.background == Background::Transparent;
        let options = WriteOptions { look, alpha, ..WriteOptions::default() };
        self.outputs.iter().try_for_each(|path| {
            let picture = shown.as_ref().filter(|_| !has_layers(path)).unwrap_or(&picture);
            write_picture(path, picture, &options)?;
            log::info!("wrote {}", path.display());
            Ok(())
        })?;
        Ok(report)
    }
}

/// What a picture says of itself.
pub struct PictureInfo {
    /// PNG gets alpha where the background is to be transparent.
    pub background: Background,
    /// The scene's curve of 8-bit pictures.
    pub transfer: Transfer,
    /// Key and value.
    pub metadata: Vec<(String, String)>,
}
