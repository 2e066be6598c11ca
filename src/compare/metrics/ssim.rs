//! Structural similarity.

use super::{Better, Metric, Outcome};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "ssim",
    title: "SSIM",
    doc: "Structural similarity (Wang et al. 2004) under a Gaussian of sigma 1.5: means, contrast and structure of small windows; 1 is \
          equal. Of colours it is that of what a display shows, the mean of red, green and blue. Noise lowers it most where the \
          picture is smooth.",
    better: Better::Higher,
    unit: "",
    eval: |input| {
        let similarity = input.similarity()?;
        let channels: Vec<f64> = similarity.finest.iter().map(|f| f.mean).collect();
        let count = channels.len().max(1);
        let map = input.maps.then(|| {
            let mut map = vec![0.0; input.pair.pixels()];
            // An error: more is worse.
            let add = |m: &mut f32, v: &f32| *m += (1.0 - v) / count as f32;
            similarity.finest.iter().for_each(|f| map.iter_mut().zip(&f.map).for_each(|(m, v)| add(m, v)));
            map
        });
        let value = channels.iter().sum::<f64>() / count as f64;
        Ok(Outcome { value, channels, note: similarity.note.clone(), map })
    },
};
