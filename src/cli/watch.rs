//! Who looks on while a picture is rendered: the progress bar, and what shows the picture as it grows.

use super::live::{self, Live, Server, Shown};
use super::progress::Bar;
use crate::base::pixel_rect::PixelRect;
use crate::error::Result;
use crate::render::Progress;
use crate::render::adaptive::Reached;
use crate::render::settings::RenderSettings;
use crate::scene::desc::Background;
use clap::Args;
use std::path::Path;

/// Flags of what shows the picture as it grows.
#[derive(Args)]
#[command(next_help_heading = "Watching")]
pub struct WatchArgs {
    /// Show the picture as it grows in a tev that listens there, such as 127.0.0.1:14158
    #[arg(long, value_name = "HOST:PORT")]
    display_server: Option<String>,
}

/// Connected, and waiting for the picture's size.
pub struct Watch {
    server: Option<Server>,
}

impl WatchArgs {
    /// Connects to what is named.
    ///
    /// # Errors
    /// See [`live::connect`].
    pub fn check(&self) -> Result<Watch> {
        Ok(Watch { server: self.display_server.as_deref().map(live::connect).transpose()? })
    }
}

/// All that look on.
pub struct Watchers {
    bar: Bar,
    live: Option<Live>,
}

impl Watchers {
    /// For a picture that is written to `output`.
    ///
    /// # Errors
    /// No room for what is to be shown.
    pub fn new(
        watch: Watch,
        bar: Bar,
        output: &Path,
        settings: &RenderSettings,
        background: Background,
    ) -> Result<Self> {
        let shown = |server| {
            let shown = Shown {
                name: output.file_name().unwrap_or_default().to_string_lossy().into_owned(),
                frame: settings.size,
                window: settings.crop,
                alpha: background == Background::Transparent,
            };
            Live::start(server, shown)
        };
        Ok(Watchers { bar, live: watch.server.map(shown).transpose()? })
    }

    /// The render is over: clears the screen.
    pub fn rendered(&self) {
        self.bar.finish();
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
        self.live.is_some()
    }

    fn tile(&self, rect: PixelRect, means: &[[f32; 4]]) {
        if let Some(live) = &self.live {
            live.tile(rect, means);
        }
    }
}
