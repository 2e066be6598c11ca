//! `skylit render --pixel X,Y --explain`: what one sample's path went through, and how to get there again.

mod record;
mod text;

use super::print;
use super::scene_args::SceneArgs;
use crate::base::ray::Ray;
use crate::crosscheck::replay::write_ray;
use crate::error::{Error, Result};
use crate::image::write::{check_file, write_file};
use crate::render::Renderer;
use crate::render::explain::{Asked, Explainer, Which};
use crate::report::machine;
use crate::scene::Scene;
use clap::Args;
use record::Record;
use std::path::Path;

/// Flags of the explanation of a sample.
#[derive(Args)]
#[command(next_help_heading = "One sample")]
pub struct ExplainArgs {
    /// Print the path of one sample of --pixel instead of rendering: surfaces, light samples and their shadow rays, densities,
    /// weights, what each brings, and the commands that ask again. Nothing is written but --stats, which gets it as JSON
    #[arg(long, requires = "pixel")]
    explain: bool,
    /// Which pixel, from the left top of the whole picture
    #[arg(long, value_name = "X,Y", requires = "explain", value_parser = pixel)]
    pixel: Option<[u32; 2]>,
    /// Which of its samples, from 0. Pixels that outlines run through count all that they take; where the render decides how
    /// many a pixel gets, later ones may not be taken [default: 0]
    #[arg(long, value_name = "N", requires = "explain")]
    sample: Option<u64>,
    /// Its brightest sample, of as many as it takes if all take as many
    #[arg(long, requires = "explain", conflicts_with = "sample")]
    worst: bool,
}

fn pixel(s: &str) -> Result<[u32; 2], String> {
    let read = |t: &str| t.trim().parse().map_err(|_| format!("\"{t}\" is not a number of pixels"));
    let (x, y) = s.split_once(',').ok_or("takes X,Y in pixels, such as 320,180")?;
    Ok([read(x)?, read(y)?])
}

impl ExplainArgs {
    /// The pixel, if one is to be explained.
    pub fn wanted(&self) -> Option<[u32; 2]> {
        self.pixel.filter(|_| self.explain)
    }

    /// Prints the explanation, and writes it to `stats`.
    ///
    /// # Errors
    /// See [`Explainer`]; a file that cannot be written.
    pub fn run(
        &self,
        pixel: [u32; 2],
        renderer: &Renderer,
        scene: &mut Scene,
        (input, stats): (&SceneArgs, Option<&Path>),
    ) -> Result<()> {
        stats.map_or(Ok(()), check_file)?;
        let which = if self.worst { Which::Brightest } else { Which::Number(self.sample.unwrap_or(0)) };
        let asked = Asked::instead_of_kernel(scene)?;
        let explained = Explainer::new(renderer, scene, &asked)?.explain(pixel, which)?;
        let first = explained.rays.first().map(|(ray, _)| *ray);
        let record =
            Record::new(&explained, scene, again(explained.number), first.map(|r| of_ray(input, &r)));
        if let Some(path) = stats {
            let json = serde_json::to_string_pretty(&record);
            let json = json.map_err(|e| Error::Internal(format!("cannot write the record: {e}")))?;
            write_file(path, (json + "\n").as_bytes())?;
        }
        print(record.to_string().as_bytes())
    }
}

/// This command, for the sample of this number.
fn again(number: u64) -> String {
    let mut words = Vec::new();
    let mut args = std::env::args_os().map(|a| a.to_string_lossy().into_owned());
    while let Some(word) = args.next() {
        match word.as_str() {
            "--worst" => {}
            "--sample" => drop(args.next()),
            w if w.starts_with("--sample=") => {}
            _ => words.push(word),
        }
    }
    words.extend(["--sample".to_owned(), number.to_string()]);
    machine::command(words.into_iter())
}

/// The command that asks every kernel of a ray in the same scene.
fn of_ray(scene: &SceneArgs, ray: &Ray) -> String {
    let flags = SceneArgs::augment_args(clap::Command::new(""));
    let mut words = vec!["skylit".into(), "crosscheck".into(), scene.input.display().to_string()];
    let mut args = std::env::args_os().map(|a| a.to_string_lossy().into_owned());
    while let Some(word) = args.next() {
        let name = word.split('=').next().unwrap_or("");
        let Some(flag) =
            flags.get_arguments().find(|a| a.get_long().is_some_and(|l| name == format!("--{l}")))
        else {
            continue;
        };
        let takes_next = flag.get_action().takes_values() && name == word;
        words.push(word);
        words.extend(takes_next.then(|| args.next()).flatten());
    }
    words.extend(["--ray".into(), write_ray(ray, true)]);
    machine::command(words.into_iter())
}
