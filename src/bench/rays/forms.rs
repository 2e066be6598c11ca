//! How a kernel can be asked.

use super::kernels::Built;
use super::sets::Workload;
use crate::base::hit::{Hit, HitBatch, NO_PRIMITIVE};
use crate::base::intersectable::{Intersectable, QueryKind};
use crate::base::ray::{Coherence, Ray, RayBatch};
use std::hint::black_box;

#[cfg(feature = "embree")]
use crate::accel::embree::forms::{Form, Laid};

/// A form of call.
pub struct CallForm {
    /// Its name on the command line and in records.
    pub name: &'static str,
    /// One line for people.
    pub doc: &'static str,
    /// How it is done.
    how: How,
}

/// What tells forms apart.
#[derive(Clone, Copy)]
enum How {
    /// A loop over rays.
    Single,
    /// Batches; whether the hint is the one that integrators give, or none.
    Batch { hint: bool },
    /// Embree's own.
    #[cfg(feature = "embree")]
    Embree(Form),
}

/// All forms, in the order of the tables. Rays lie as the form wants them before the clock starts.
pub const FORMS: &[CallForm] = &[
    CallForm { name: "single", doc: "one call a ray, through the trait", how: How::Single },
    CallForm {
        name: "batch",
        doc: "batches of 2,048 as the renderer sends them, with the hint that it gives",
        how: How::Batch { hint: true },
    },
    CallForm {
        name: "batch-incoherent",
        doc: "the same without the hint that camera rays are coherent",
        how: How::Batch { hint: false },
    },
    #[cfg(feature = "embree")]
    CallForm {
        name: "rtc-single",
        doc: "bare rtcIntersect1 and rtcOccluded1 over records",
        how: How::Embree(Form::Single),
    },
    #[cfg(feature = "embree")]
    CallForm {
        name: "rtc-packet",
        doc: "bare rtcIntersect16 and rtcOccluded16 over packets",
        how: How::Embree(Form::Packet),
    },
    #[cfg(feature = "embree")]
    CallForm {
        name: "rtc-stream",
        doc: "bare rtcIntersect1M over 1,024 records (Embree 4: a loop)",
        how: How::Embree(Form::Stream),
    },
    #[cfg(feature = "embree")]
    CallForm {
        name: "rtc-packet-stream",
        doc: "bare rtcIntersectNM over 64 packets (Embree 4: a loop)",
        how: How::Embree(Form::PacketStream),
    },
    #[cfg(feature = "embree")]
    CallForm {
        name: "rtc-arrays",
        doc: "bare rtcIntersectNp over columns (Embree 4: a loop over packets)",
        how: How::Embree(Form::Arrays),
    },
];

/// The form of this name.
pub fn find(name: &str) -> Option<&'static CallForm> {
    FORMS.iter().find(|f| f.name == name)
}

/// What rays were answered: primitive (or [`NO_PRIMITIVE`]) and path; primitive 0 of a hit that only asks for any.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Answers {
    /// By ray.
    pub prim: Vec<u32>,
    /// By ray.
    pub path: Vec<u64>,
}

impl Answers {
    /// Appends an answer.
    pub fn push(&mut self, hit: Option<(u32, u64)>) {
        let (prim, path) = hit.unwrap_or((NO_PRIMITIVE, 0));
        self.prim.push(prim);
        self.path.push(path);
    }

    /// The number of rays that met something.
    pub fn hits(&self) -> usize {
        self.prim.iter().filter(|p| **p != NO_PRIMITIVE).count()
    }

    /// Appends others.
    pub fn append(&mut self, mut other: Answers) {
        self.prim.append(&mut other.prim);
        self.path.append(&mut other.path);
    }
}

/// A piece of a workload, laid out for one run.
pub struct Pass<'a>(Laying<'a>);

enum Laying<'a> {
    Single {
        kernel: &'a dyn Intersectable,
        rays: Vec<Ray>,
        query: QueryKind,
    },
    Batch {
        kernel: &'a dyn Intersectable,
        batches: &'a [RayBatch],
        query: QueryKind,
        hint: Coherence,
        room: Room,
    },
    #[cfg(feature = "embree")]
    Embree(Laid<'a>),
}

/// Results of a batch, as a renderer has them: used again for the next one.
#[derive(Default)]
struct Room {
    hits: HitBatch,
    blocked: Vec<bool>,
}

impl CallForm {
    /// Whether a kernel can be asked for a workload in this form, so that it differs from all other forms.
    #[cfg_attr(
        not(feature = "embree"),
        expect(unused_variables, reason = "the forms left are every kernel's")
    )]
    pub fn fits(&self, kernel: &Built, work: &Workload) -> bool {
        match self.how {
            How::Single | How::Batch { hint: true } => true,
            How::Batch { hint: false } => work.coherence == Coherence::Coherent,
            #[cfg(feature = "embree")]
            How::Embree(_) => kernel.embree().is_some(),
        }
    }

    /// Lays rays out. None where the kernel has no such form, or cannot be given one of the rays in it.
    pub fn lay_out<'a>(
        &self,
        kernel: &'a Built,
        batches: &'a [RayBatch],
        work: &Workload,
    ) -> Option<Pass<'a>> {
        let (query, any) = (work.query, kernel.kernel());
        Some(Pass(match self.how {
            How::Single => {
                let rays = batches.iter().flat_map(|b| (0..b.len()).map(|i| b.get(i))).collect();
                Laying::Single { kernel: any, rays, query }
            }
            How::Batch { hint } => {
                let hint = if hint { work.coherence } else { Coherence::Incoherent };
                Laying::Batch { kernel: any, batches, query, hint, room: Room::default() }
            }
            #[cfg(feature = "embree")]
            How::Embree(form) => {
                Laying::Embree(kernel.embree()?.lay_out(batches, form, query, work.coherence)?)
            }
        }))
    }
}

impl Pass<'_> {
    /// Asks for all rays once; this is what is timed. Answers are looked at by nobody.
    pub fn run(&mut self) {
        match &mut self.0 {
            Laying::Single { kernel, rays, query: QueryKind::Closest } => {
                for r in rays.iter() {
                    black_box(kernel.intersect(r));
                }
            }
            Laying::Single { kernel, rays, query: QueryKind::Any } => {
                for r in rays.iter() {
                    black_box(kernel.occluded(r));
                }
            }
            Laying::Batch { kernel, batches, query, hint, room } => {
                for b in *batches {
                    match query {
                        QueryKind::Closest => kernel.intersect_batch(b, &mut room.hits, *hint),
                        QueryKind::Any => kernel.occluded_batch(b, &mut room.blocked, *hint),
                    }
                    black_box(&room);
                }
            }
            #[cfg(feature = "embree")]
            Laying::Embree(laid) => laid.run(),
        }
    }

    /// Asks for all rays once and keeps the answers; in place of [`Pass::run`].
    pub fn answers(&mut self) -> Answers {
        let mut out = Answers::default();
        let of_hit = |h: Hit| (h.prim, h.path);
        match &mut self.0 {
            Laying::Single { kernel, rays, query: QueryKind::Closest } => {
                rays.iter().for_each(|r| out.push(kernel.intersect(r).map(of_hit)));
            }
            Laying::Single { kernel, rays, query: QueryKind::Any } => {
                rays.iter().for_each(|r| out.push(kernel.occluded(r).then_some((0, 0))));
            }
            Laying::Batch { kernel, batches, query, hint, room } => {
                for b in *batches {
                    match query {
                        QueryKind::Closest => {
                            kernel.intersect_batch(b, &mut room.hits, *hint);
                            (0..b.len()).for_each(|i| out.push(room.hits.get(i).map(of_hit)));
                        }
                        QueryKind::Any => {
                            kernel.occluded_batch(b, &mut room.blocked, *hint);
                            room.blocked.iter().for_each(|b| out.push(b.then_some((0, 0))));
                        }
                    }
                }
            }
            #[cfg(feature = "embree")]
            Laying::Embree(laid) => {
                laid.run();
                laid.answers(|prim, path| out.push((prim != NO_PRIMITIVE).then_some((prim, path))));
            }
        }
        out
    }
}
