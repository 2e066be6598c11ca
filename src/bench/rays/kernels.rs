//! Which kernels are asked, in which modes and instruction sets, and what their builds took.

use super::forms::{self, CallForm, FORMS};
use crate::accel::{self, KERNELS};
use crate::base::geometry::{Geometry, Group};
use crate::base::intersectable::{BuildQuality, Intersectable, KernelMode, KernelOptions};
use crate::error::{Error, Result, unknown_name};
use crate::math::simd::Level;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::sync::Arc;
use std::time::Instant;

#[cfg(feature = "embree")]
use crate::accel::embree;

/// What is chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Names of kernels; empty for all but the oracle.
    pub backends: Vec<String>,
    /// Names of forms; empty for all.
    pub forms: Vec<String>,
    /// Modes, where a kernel tells them apart.
    pub modes: Vec<KernelMode>,
    /// Instruction sets, where a kernel tells them apart; empty for its own choice.
    pub levels: Vec<Level>,
    /// How carefully they build.
    pub quality: BuildQuality,
    /// Threads of builds; 0 means all.
    pub threads: usize,
}

/// A kernel to be built.
#[derive(Debug, Clone, Copy)]
pub struct Variant {
    /// Its name in the table.
    pub backend: &'static str,
    /// How it is built.
    pub options: KernelOptions,
}

/// What a record says of a kernel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KernelInfo {
    /// As it describes itself, "embree 3.13.5 robust".
    pub name: String,
    /// Its name on the command line.
    pub backend: String,
    /// "robust" or "fast".
    pub mode: String,
    /// The instruction set that was asked for, if any.
    pub simd: Option<String>,
    /// "fast", "balanced" or "best".
    pub quality: String,
    /// Whether another program runs it.
    pub peer: bool,
    /// Seconds to build; of several builds the median.
    pub build_seconds: f64,
    /// How often it was built.
    pub builds: u32,
    /// Bytes held beyond the geometry.
    pub memory: u64,
    /// Nodes, leaves and primitives that the surface area heuristic expects of a line that nothing stops, if it counts.
    #[serde(default)]
    pub predicted: Option<[f64; 3]>,
}

/// A kernel that was built.
pub struct Built {
    kernel: Arc<dyn Intersectable>,
    #[cfg(feature = "embree")]
    embree: Option<Arc<embree::Kernel>>,
    /// For the record.
    pub info: KernelInfo,
}

/// The word for a mode.
pub fn mode_name(mode: KernelMode) -> &'static str {
    match mode {
        KernelMode::Robust => "robust",
        KernelMode::Fast => "fast",
    }
}

/// The word for a quality.
pub fn quality_name(quality: BuildQuality) -> &'static str {
    match quality {
        BuildQuality::Fast => "fast",
        BuildQuality::Balanced => "balanced",
        BuildQuality::Best => "best",
    }
}

impl Choice {
    /// The kernels to be built: each mode and level under which a kernel gives itself another name.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that no kernel has, and where nothing is chosen.
    pub fn variants(&self) -> Result<Vec<Variant>> {
        let known = || KERNELS.iter().map(|k| k.name);
        if let Some(name) = self.backends.iter().find(|b| !known().any(|k| k == b.as_str())) {
            return Err(Error::Usage(unknown_name("backend", name, known())));
        }
        let chosen = |name: &str| match self.backends.as_slice() {
            // The oracle answers a few rays a second.
            [] => name != "brute" || KERNELS.len() == 1,
            some => some.iter().any(|b| b == name),
        };
        let levels: Vec<Option<Level>> = match self.levels.as_slice() {
            [] => vec![None],
            some => some.iter().copied().map(Some).collect(),
        };
        let nothing = Arc::new(Geometry { groups: vec![Group::default()] });
        let mut all = Vec::new();
        for backend in known().filter(|n| chosen(n)) {
            let mut names = HashSet::new();
            for &mode in &self.modes {
                for &simd in &levels {
                    let options = KernelOptions {
                        mode,
                        simd,
                        quality: self.quality,
                        threads: self.threads,
                        ..KernelOptions::default()
                    };
                    let probe = accel::build_kernel(backend, nothing.clone(), &options)?;
                    if names.insert(probe.describe()) {
                        all.push(Variant { backend, options });
                    }
                }
            }
        }
        Ok(all)
    }

    /// The forms to be asked in.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that no form has.
    pub fn forms(&self) -> Result<Vec<&'static CallForm>> {
        if self.forms.is_empty() {
            return Ok(FORMS.iter().collect());
        }
        let find = |name: &String| {
            forms::find(name)
                .ok_or_else(|| Error::Usage(unknown_name("form of call", name, FORMS.iter().map(|f| f.name))))
        };
        self.forms.iter().map(find).collect()
    }
}

/// A build that takes less than this is repeated, since the clock of one is mostly noise: seconds.
const QUICK: f64 = 0.5;
/// Builds of which the median is told.
const BUILDS: usize = 3;

impl Built {
    /// Builds a kernel, and takes the time.
    ///
    /// # Errors
    /// Those of the kernel.
    pub fn new(variant: &Variant, geometry: &Arc<Geometry>) -> Result<Built> {
        let mut built = Built::once(variant, geometry)?;
        let mut seconds = vec![built.info.build_seconds];
        while seconds.len() < BUILDS && seconds.iter().all(|s| *s < QUICK) {
            // The old one goes first, so that two never hold memory together.
            drop(built);
            built = Built::once(variant, geometry)?;
            seconds.push(built.info.build_seconds);
        }
        built.info.builds = seconds.len() as u32;
        seconds.sort_by(f64::total_cmp);
        built.info.build_seconds = seconds[seconds.len() / 2];
        Ok(built)
    }

    fn once(variant: &Variant, geometry: &Arc<Geometry>) -> Result<Built> {
        let start = Instant::now();
        #[cfg(feature = "embree")]
        let (kernel, embree): (Arc<dyn Intersectable>, _) = if variant.backend == embree::ROW.name {
            let own = Arc::new(embree::Kernel::new(geometry.clone(), &variant.options)?);
            (own.clone(), Some(own))
        } else {
            (accel::build_kernel(variant.backend, geometry.clone(), &variant.options)?.into(), None)
        };
        #[cfg(not(feature = "embree"))]
        let kernel: Arc<dyn Intersectable> =
            accel::build_kernel(variant.backend, geometry.clone(), &variant.options)?.into();
        let build_seconds = start.elapsed().as_secs_f64();
        let info = KernelInfo {
            name: kernel.describe(),
            backend: variant.backend.to_owned(),
            mode: mode_name(variant.options.mode).to_owned(),
            simd: variant.options.simd.map(|l| l.name().to_owned()),
            quality: quality_name(variant.options.quality).to_owned(),
            peer: false,
            build_seconds,
            builds: 1,
            memory: kernel.memory(),
            predicted: kernel.predicted_visits(),
        };
        Ok(Built {
            kernel,
            #[cfg(feature = "embree")]
            embree,
            info,
        })
    }

    /// The kernel.
    pub fn kernel(&self) -> &dyn Intersectable {
        self.kernel.as_ref()
    }

    /// The kernel, if it is Embree.
    #[cfg(feature = "embree")]
    pub fn embree(&self) -> Option<&embree::Kernel> {
        self.embree.as_deref()
    }
}
