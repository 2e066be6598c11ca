//! Peak signal-to-noise ratio.

use super::{Better, Metric, Outcome};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "psnr",
    title: "PSNR",
    doc: "10 log10(peak^2 / MSE): the RMSE as a ratio to the largest value, in decibels. 20 dB are a tenth, 40 dB a hundredth. The \
          peak is 1: of 8-bit pictures 255, of radiance a display's white, so brighten or darken by --exposure first, or say --peak.",
    better: Better::Higher,
    unit: "dB",
    eval: |input| {
        let (peak, note) = input.peak();
        let squares = input.squares();
        let decibels = |mse: f64| if mse == 0.0 { f64::INFINITY } else { 10.0 * (peak * peak / mse).log10() };
        let value = decibels(squares.iter().sum::<f64>() / squares.len().max(1) as f64);
        Ok(Outcome { value, channels: squares.iter().copied().map(decibels).collect(), note, map: None })
    },
};
