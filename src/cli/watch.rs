//! Who looks on while a picture is rendered: the progress bar, and what shows the picture as it grows.

use super::live::{self, Live, Server, Shown};
use super::preview::{self, Preview, PreviewKind};
use super::progress::Bar;
use crate::base::pixel_rect::PixelRect;
use crate::error::Result;
use crate::image::tonemap::Look;
use crate::render::Progress;
use crate::render::adaptive::Reached;
use crate::render::settings::RenderSettings;
use crate::scene::desc::Background;
use clap::Args;
use std::path::Path;
use std::sync::Arc;

/// Flags of what shows the picture as it grows.
#[derive(Args)]
#[command(next_help_heading = "Watching")]
pub struct WatchArgs {
    /// Show the picture as it grows in a tev that listens there, such as 127.0.0.1:14158
    #[arg(long, value_name = "HOST:PORT")]
    display_server: Option<String>,
    /// Show the picture as it grows on the terminal: by half-block characters, or sixels where the terminal shows them
    #[arg(long, value_name = "auto|blocks|sixel", num_args = 0..=1, require_equals = true, default_missing_value = "auto")]
    preview: Option<PreviewKind>,
}

/// Connected, and waiting for the picture's size.
pub struct Watch {
    server: Option<Server>,
    preview: Option<PreviewKind>,
}

/// What is there to be seen.
pub struct Picture<'a> {
    /// Where it is written.
    pub output: &'a Path,
    /// Its size and window.
    pub settings: &'a RenderSettings,
    /// What is behind everything.
    pub background: Background,
    /// How pictures of 8 bits show it.
    pub look: Look,
}

impl WatchArgs {
    /// Connects to what is named.
    ///
    /// # Errors
    /// See [`live::connect`].
    pub fn check(&self) -> Result<Watch> {
        let server = self.display_server.as_deref().map(live::connect).transpose()?;
        Ok(Watch { server, preview: self.preview })
    }
}

/// All that look on.
pub struct Watchers {
    bar: Arc<Bar>,
    live: Option<Live>,
    preview: Option<Preview>,
}

impl Watchers {
    /// Begins to show a picture; on the terminal nothing if `quiet`.
    ///
    /// # Errors
    /// No room for what is to be shown.
    pub fn new(watch: Watch, picture: &Picture, quiet: bool) -> Result<Self> {
        let Picture { output, settings, background, look } = picture;
        let shown = |server| {
            let shown = Shown {
                name: output.file_name().unwrap_or_default().to_string_lossy().into_owned(),
                frame: settings.size,
                window: settings.crop,
                alpha: *background == Background::Transparent,
            };
            Live::start(server, shown)
        };
        let live = watch.server.map(shown).transpose()?;
        let kind = watch.preview.filter(|_| !quiet && preview::can_show());
        // Two that draw would draw over each other.
        let bar = Arc::new(Bar::new(quiet || kind.is_some(), settings.time));
        let start = |kind| Preview::start(kind, settings.crop, *look, bar.clone());
        let preview = kind.map(start).transpose()?;
        Ok(Watchers { bar, live, preview })
    }

    /// The render is over: leaves the screen.
    pub fn rendered(&mut self) {
        self.bar.finish();
        if let Some(preview) = self.preview.take() {
            preview.finish();
        }
    }

    /// The picture is written: those who are slow may have the rest.
    pub fn finish(self) {
        if let Some(live) = self.live {
            live.finish();
        }
    }
}

impl Progress for Watchers {
    fn begin(&self, samples: u64) {
        self.bar.begin(samples);
    }

    fn advance(&self, samples: u64) {
        self.bar.advance(samples);
    }

    fn reached(&self, error: &Reached, target: f64) {
        self.bar.reached(error, target);
    }

    fn wants_tiles(&self) -> bool {
        self.live.is_some() || self.preview.is_some()
    }

    fn tile(&self, rect: PixelRect, means: &[[f32; 4]]) {
        if let Some(live) = &self.live {
            live.tile(rect, means);
        }
        if let Some(preview) = &self.preview {
            preview.put(rect, means);
        }
    }
}
