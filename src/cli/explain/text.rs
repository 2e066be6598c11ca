//! The explanation for people.

use super::record::{LegRecord, LitRecord, MetRecord, OnwardRecord, Record, SurfaceRecord};
use std::fmt::{self, Display, Formatter};

/// Numbers between spaces, each with as many digits as it takes to read it again.
struct Row<'a, T>(&'a [T]);

impl<T: Display> Display for Row<'_, T> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.0.iter().enumerate().try_for_each(|(i, v)| {
            let gap = if i > 0 { " " } else { "" };
            write!(f, "{gap}{v}")
        })
    }
}

impl Display for Record {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let [x, y] = self.pixel;
        let (number, replicate, index) = (self.sample, self.replicate, self.index);
        write!(f, "sample   {number} of pixel {x},{y}, which takes {}", self.samples)?;
        if self.samples_decided {
            write!(f, " if all take as many (here, what is sampled decides)")?;
        }
        if self.samples_for_one_of_another > 1 {
            write!(
                f,
                ", {} for each of another as an outline runs through",
                self.samples_for_one_of_another
            )?;
        }
        writeln!(f, "\npoints   number {index} of randomisation {replicate}; film {}", Row(&self.film))?;
        writeln!(f, "radiance {}, alpha {}", Row(&self.radiance), self.alpha)?;
        if let Some(radiance) = self.spared {
            writeln!(
                f,
                "note     the render takes no sample here: no geometry is near, and the filter's integral of the sky is {}",
                Row(&radiance)
            )?;
        }
        if !self.decided.is_empty() {
            writeln!(f, "pilot    {}", self.decided)?;
        }
        match &self.path {
            Some(path) => {
                path.legs.iter().try_for_each(|leg| write!(f, "{leg}"))?;
                let equal = match path.exact {
                    true => "which is the sample's radiance, bit for bit",
                    false => {
                        "which is NOT the sample's radiance, or not by the steps of the integrator: please report this"
                    }
                };
                writeln!(f, "sum      {}, {equal}", Row(&path.sum))?;
            }
            None => {
                writeln!(f, "rays     (this integrator tells no more than its rays)")?;
                for r in &self.rays {
                    writeln!(f, "  {} {}: {}", r.query, r.ray, r.answer)?;
                }
            }
        }
        writeln!(f, "again    {}", self.replay)?;
        match &self.replay_ray {
            Some(line) => writeln!(f, "camera   {line}\n         (and so with any other ray of these)"),
            None => Ok(()),
        }
    }
}

impl Display for LegRecord {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let LegRecord { number, depth, ray, throughput, .. } = self;
        match self.from {
            None => writeln!(f, "ray {number}    from the camera, depth {depth}: {ray}")?,
            Some(from) => writeln!(f, "ray {number}    from the end of ray {from}, depth {depth}: {ray}")?,
        }
        write!(f, "  throughput {}", Row(throughput))?;
        match self.pdf {
            Some(pdf) => writeln!(f, ", density {pdf}")?,
            None => writeln!(f, ", no light sample competes")?,
        }
        match (&self.surface, self.end) {
            (Some(surface), _) => surface.meet(f)?,
            (None, "escaped") => writeln!(f, "  leaves the scene")?,
            (None, _) => writeln!(f, "  last ray: something is in the way of what lies at infinity")?,
        }
        self.emitted.iter().try_for_each(|met| write!(f, "{met}"))?;
        if self.emitted.is_empty() && self.surface.is_none() {
            writeln!(f, "  brings nothing")?;
        }
        self.surface.as_ref().map_or(Ok(()), |surface| surface.leave(f))
    }
}

impl Display for MetRecord {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let MetRecord { light, light_pdf, weight, .. } = self;
        write!(f, "  {light} shows {}", Row(&self.radiance))?;
        if *light_pdf > 0.0 || *weight != 1.0 {
            write!(f, ", density of light samples {light_pdf}, weight {weight}")?;
        }
        writeln!(f, "\n    brings {}", Row(&self.brings))
    }
}

impl SurfaceRecord {
    fn meet(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "  meets {} at t {}; material {}", self.what, self.t, self.material)?;
        write!(f, "  point {}", Row(&self.point))?;
        // Render space is the world's own in most scenes.
        if self.world_point.map(|v| v as f32) != self.point {
            write!(f, " (in the world {})", Row(&self.world_point.map(|v| format!("{v:.7}"))))?;
        }
        writeln!(f)?;
        write!(f, "  normal {}", Row(&self.normal))?;
        if self.normal != self.shading_normal {
            write!(f, ", shading normal {}", Row(&self.shading_normal))?;
        }
        writeln!(f, ", uv {}", Row(&self.uv))
    }

    fn leave(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.light_samples.iter().try_for_each(|lit| write!(f, "{lit}"))?;
        self.onward.iter().try_for_each(|on| write!(f, "{on}"))?;
        if !self.goes_on {
            writeln!(f, "  ends here: nothing is scattered, or the path is as long as it may be")?;
        }
        Ok(())
    }
}

impl Display for LitRecord {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "  light sample of {}, choice {}", self.light, self.choice)?;
        if let (Some(direction), Some(pdf)) = (&self.direction, self.light_pdf) {
            write!(f, ", direction {}", Row(direction))?;
            self.distance.map_or(Ok(()), |d| write!(f, ", distance {d}"))?;
            write!(f, ", {} {pdf}", if self.delta { "of a single direction," } else { "density" })?;
        }
        writeln!(f)?;
        if let (Some(f_cos), Some(pdf), Some(bsdf), Some(weight)) =
            (&self.f_cos, self.pdf, self.bsdf_pdf, self.weight)
        {
            writeln!(
                f,
                "    f cos {}, density {pdf} against {} of scattered rays of {bsdf}: weight {weight}",
                Row(f_cos),
                self.scattered_rays
            )?;
        }
        if let Some(ray) = &self.shadow_ray {
            writeln!(f, "    shadow ray {ray}")?;
        }
        write!(f, "    {}", self.verdict)?;
        if self.verdict == "free" {
            write!(f, ", radiance {}\n    brings {}", Row(&self.radiance), Row(&self.brings))?;
        }
        writeln!(f)
    }
}

impl Display for OnwardRecord {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if let (Some(direction), Some(weight), Some(pdf)) = (&self.direction, &self.weight, self.pdf) {
            let of = if self.delta { "probability of a Dirac lobe" } else { "density" };
            writeln!(f, "  scattered to {}, weight {}, {of} {pdf}", Row(direction), Row(weight))?;
        }
        if let Some([q, u]) = self.roulette {
            writeln!(f, "    roulette: survives if {u} < {q}")?;
        }
        match self.leg {
            Some(leg) => writeln!(f, "    goes on as ray {leg}"),
            None => writeln!(f, "    {}", self.fate),
        }
    }
}
