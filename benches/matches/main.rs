//! Our pictures against what others rendered of the same scenes.
//!
//!     cargo bench --bench matches [-- FILTER] [--write] [--list] [--save DIR] [--spp N] [--threads N]
//!     cargo bench --bench matches -- --contact-sheet OUT.png [FILTER]
//!
//! Renders every scene of `entries.rs` whose scene or reference has FILTER in its name, compares, and prints the table;
//! `--write` puts it into tests/README.md, where rows of scenes that were not run stay. `--save` keeps our pictures and the
//! differences as EXR. Exit code 1 if a row misses its limit or a scene cannot be rendered.
//!
//! `--contact-sheet` renders every complete scene and mesh of the shared data, small, into one picture.

mod entries;
mod flip;
mod font;
mod means;
mod peers;
mod picture;
mod pixel_test;
mod psnr;
mod sheet;
mod shot;
mod table;
mod tiles;

use entries::{Check, Entry, Kernel, Metric};
use picture::{Encoding, Pixels};
use skylit::error::{Error, Result};
use skylit::image::picture::{Picture, SampleKind};
use skylit::image::write::{WriteOptions, write_picture};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;
use table::{Row, Verdict};

#[derive(Default)]
struct Options {
    filter: String,
    write: bool,
    list: bool,
    sheet: Option<PathBuf>,
    save: Option<PathBuf>,
    spp: Option<u32>,
    threads: usize,
}

fn options() -> Result<Options> {
    let mut o = Options::default();
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(a) = args.next() {
        let mut value = || args.next().ok_or_else(|| Error::Usage(format!("{a} takes a value")));
        let number =
            |v: String| v.parse::<u32>().map_err(|_| Error::Usage(format!("{a} takes a number, not {v}")));
        match a.as_str() {
            "--write" => o.write = true,
            "--list" => o.list = true,
            "--contact-sheet" => o.sheet = Some(value()?.into()),
            "--save" => o.save = Some(value()?.into()),
            "--spp" => o.spp = Some(number(value()?)?.max(1)),
            "--threads" => o.threads = number(value()?)? as usize,
            flag if flag.starts_with('-') => {
                let known = "--write, --list, --contact-sheet, --save, --spp, --threads";
                return Err(Error::Usage(format!("unknown flag {flag}; known: {known}")));
            }
            _ => o.filter = a,
        }
    }
    if o.write && o.spp.is_some() {
        return Err(Error::Usage("--write is for the samples that the entries name: leave out --spp".into()));
    }
    Ok(o)
}

fn main() -> ExitCode {
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::from(2)
        }
    }
}

/// The crate's own folder.
fn home() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The shared data: `SKYLIT_DATA`, or beside the crate as the tests have it.
fn data() -> PathBuf {
    std::env::var_os("SKYLIT_DATA").map_or_else(|| home().join("../shared/data"), PathBuf::from)
}

/// Says whether nothing missed.
fn run() -> Result<bool> {
    let o = options()?;
    if let Some(out) = &o.sheet {
        return sheet::make(&data(), &o.filter, out, o.threads);
    }
    let all = entries::all();
    let wanted = |e: &&Entry| e.scene.contains(&o.filter) || e.reference.contains(&o.filter);
    let mut rows = Vec::new();
    print!("{}", table::head());
    for entry in all.iter().filter(wanted) {
        for kernel in entry.kernels {
            let new = if o.list { listed(entry, kernel) } else { rows_of(entry, kernel, &o) };
            new.iter().for_each(|row| print!("{}", row.line()));
            rows.extend(new);
        }
    }
    if rows.is_empty() {
        return Err(Error::Usage(format!("no scene or reference has \"{}\" in its name", o.filter)));
    }
    if o.write && !o.list {
        let order: Vec<_> = all.iter().map(|e| [e.scene, e.reference]).collect();
        table::write(&home().join("tests/README.md"), &rows, &order)?;
    }
    Ok(!rows.iter().any(|r| matches!(r.verdict, Verdict::Miss | Verdict::Failed)))
}

fn row(entry: &Entry, metric: String, verdict: Verdict) -> Row {
    let (value, limit) = Default::default();
    Row { scene: entry.scene, reference: entry.reference, metric, value, limit, verdict }
}

/// What would be measured.
fn listed(entry: &Entry, kernel: &Kernel) -> Vec<Row> {
    let of = |c: &Check| Row { limit: limit(c), ..row(entry, metric(c, kernel), Verdict::Skipped) };
    entry.checks.iter().map(of).collect()
}

/// Renders and compares; all that can go wrong is a row.
fn rows_of(entry: &Entry, kernel: &Kernel, o: &Options) -> Vec<Row> {
    let scene = match entry.scene.strip_prefix("tests/") {
        Some(_) => home().join(entry.scene),
        None => data().join(entry.scene),
    };
    let reference = data().join(entry.reference);
    if !scene.exists() || !reference.exists() {
        return vec![row(entry, kernel.name.into(), Verdict::Skipped)];
    }
    let start = Instant::now();
    let result = compare(entry, kernel, o, [&scene, &reference]);
    eprintln!("{}, {}: {:.1} s", entry.scene, kernel.name, start.elapsed().as_secs_f64());
    result.unwrap_or_else(|e| {
        // Paths of the machine it ran on say nothing to others.
        let value = e.to_string().replace(&format!("{}/", data().display()), "");
        let value = value.replace(&format!("{}/", home().display()), "");
        vec![Row { value, ..row(entry, kernel.name.into(), Verdict::Failed) }]
    })
}

/// Two pictures of one size and encoding, and the variances of ours where its unit is radiance.
struct Pair {
    ours: Pixels,
    reference: Pixels,
    variances: Option<Vec<[f32; 3]>>,
}

fn compare(entry: &Entry, kernel: &Kernel, o: &Options, [scene, reference]: [&Path; 2]) -> Result<Vec<Row>> {
    let wish = shot::Wish {
        backend: kernel.name,
        spp: o.spp.or(entry.spp),
        max_depth: entry.max_depth,
        sampler: entry.sampler,
        crop: kernel.crop,
        threads: o.threads,
        ..shot::Wish::default()
    };
    let theirs = Pixels::read(reference)?;
    let desc = skylit::formats::load(scene)?;
    let (size, whole) = (desc.film.size, [theirs.width, theirs.height]);
    if size.map(|v| v as usize) != whole {
        return Err(Error::Failed(format!("the scene's film is {size:?}, the reference {whole:?}")));
    }
    let film = shot::render_desc(desc, &wish)?;
    let linear = shot::pixels(&film);
    let variances = (entry.encoding == Encoding::Linear).then(|| shot::variances(&film));
    let pair =
        Pair { ours: encoded(&linear, entry.encoding), reference: theirs.cropped(film.window())?, variances };
    if let Some(folder) = &o.save {
        save(folder, entry, kernel, &linear, &pair)?;
    }
    Ok(entry.checks.iter().map(|c| judge(entry, kernel, c, &pair)).collect())
}

/// Our radiance, and the difference in the reference's unit.
fn save(folder: &Path, entry: &Entry, kernel: &Kernel, linear: &Pixels, pair: &Pair) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e))?;
    let stem = Path::new(entry.reference).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let scene = Path::new(entry.scene).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = |what: &str| folder.join(format!("{scene}-{stem}-{}-{what}.exr", kernel.name));
    let both = pair.ours.data.iter().zip(&pair.reference.data);
    let data = both.map(|(a, b)| [0, 1, 2].map(|c| a[c] - b[c])).collect();
    write(linear, &name("ours"))?;
    write(&Pixels { data, ..pair.ours }, &name("difference"))
}

/// After the reference's encoding.
fn encoded(radiance: &Pixels, encoding: Encoding) -> Pixels {
    let data = radiance.data.iter().map(|p| p.map(|v| encoding.encode(v))).collect();
    Pixels { data, ..*radiance }
}

/// Writes the values as they are (EXR).
fn write(pixels: &Pixels, path: &Path) -> Result<()> {
    let mut picture = Picture::new(pixels.width, pixels.height);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        picture.push(name, SampleKind::Float, pixels.data.iter().map(|p| p[c]).collect());
    }
    write_picture(path, &picture, &WriteOptions::default())
}

/// The kernel that was asked for, where it matters which; and how much it saw.
fn metric(check: &Check, kernel: &Kernel) -> String {
    let name = match check.metric {
        Metric::Mean => "channel means, largest difference",
        Metric::Psnr => "PSNR",
        Metric::Flip => "FLIP",
        Metric::Tiles(_) => "tiles, rms score",
        Metric::WorstTile(_) => "tiles, worst score",
        Metric::Outliers(_) => "pixels that stand out",
    };
    match (kernel.name, kernel.crop) {
        ("auto", None) => name.to_owned(),
        (kernel, None) => format!("{name}; {kernel}"),
        (kernel, Some([x0, x1, y0, y1])) => {
            format!("{name}; {kernel}, {:.0} % of the film", 100.0 * (x1 - x0) * (y1 - y0))
        }
    }
}

fn figure(metric: Metric, value: f64) -> String {
    match metric {
        Metric::Mean => format!("{:.3} %", 100.0 * value),
        Metric::Psnr => format!("{value:.2} dB"),
        Metric::Flip => format!("{value:.5}"),
        Metric::Tiles(_) | Metric::WorstTile(_) => format!("{value:.2}"),
        Metric::Outliers(_) => format!("{:.2} %", 100.0 * value),
    }
}

fn limit(check: &Check) -> String {
    let word = if check.metric == Metric::Psnr { "at least" } else { "at most" };
    format!("{word} {}: {}", figure(check.metric, check.limit), check.why)
}

fn judge(entry: &Entry, kernel: &Kernel, check: &Check, pair: &Pair) -> Row {
    let (ours, theirs) = (&pair.ours, &pair.reference);
    let scores = |allowed| tiles::scores(ours, theirs, pair.variances.as_deref(), allowed);
    let mut place = String::new();
    let value = match &check.metric {
        Metric::Mean => means::relative_difference(ours, theirs),
        Metric::Psnr => psnr::psnr(ours, theirs),
        Metric::Flip => flip::mean(ours, theirs),
        Metric::Tiles(allowed) => scores(allowed).rms,
        Metric::WorstTile(allowed) => {
            let s = scores(allowed);
            place = format!(" at {}, {} of {} tiles", s.at[0], s.at[1], s.count);
            s.worst
        }
        Metric::Outliers(absolute) => pixel_test::outliers(ours, theirs, *absolute),
    };
    let within = match check.metric {
        Metric::Psnr => value >= check.limit,
        _ => value.abs() <= check.limit,
    };
    let verdict = if within { Verdict::Match } else { Verdict::Miss };
    let value = figure(check.metric, value) + &place;
    Row { value, limit: limit(check), ..row(entry, metric(check, kernel), verdict) }
}
