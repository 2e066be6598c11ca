//! Paths that leave the scene, gathered so that a light at infinity is asked for all of them at once: its lookups then
//! wait for memory together and not one after the other.

use crate::base::directions::{DirectionBatch, Directions};
use crate::base::light::Light;
use crate::base::ray::RayBatch;
use crate::color::Rgb;
use crate::scene::Scene;
use crate::scene::desc::Background;
use glam::Vec3;

/// Directions in which paths leave, each with a number of the caller's.
#[derive(Default)]
pub struct Escapes {
    directions: DirectionBatch,
    numbers: Vec<u32>,
    radiance: Vec<Rgb>,
}

/// One that has been answered.
#[derive(Debug, Clone, Copy)]
pub struct Escape {
    /// The number it was given.
    pub number: u32,
    /// Its unit direction.
    pub wi: Vec3,
    /// What the light shows there.
    pub le: Rgb,
}

impl Escapes {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.directions.clear();
        self.numbers.clear();
    }

    /// Appends one.
    #[inline]
    pub fn push(&mut self, number: u32, wi: Vec3) {
        self.directions.push(wi);
        self.numbers.push(number);
    }

    /// The rays of a batch that `wanted` picks by their numbers, and no others. Nobody can foretell which: without a branch.
    pub fn pick(&mut self, rays: &RayBatch, wanted: impl Fn(usize) -> bool) {
        self.directions.clear();
        self.numbers.resize(rays.len(), 0);
        let mut n = 0;
        for i in 0..rays.len() {
            self.numbers[n] = i as u32;
            n += usize::from(wanted(i));
        }
        self.numbers.truncate(n);
        self.directions.extend_picked(rays.directions(), &self.numbers);
    }

    /// All of them with the radiance of a light at infinity.
    pub fn ask(&mut self, light: &dyn Light) -> impl Iterator<Item = Escape> {
        self.radiance.resize(self.numbers.len(), Rgb::BLACK);
        let directions: Directions = self.directions.view();
        if !directions.is_empty() {
            light.le_escaped(directions, &mut self.radiance);
        }
        let all = self.numbers.iter().zip(&self.radiance).enumerate();
        all.map(move |(i, (&number, &le))| Escape { number, wi: directions.get(i), le })
    }

    /// Adds to `li`, by number, what camera rays show that leave the scene.
    pub fn add_background(&mut self, scene: &Scene, li: &mut [Rgb]) {
        match scene.background {
            Background::Sky => {
                for &light in &scene.lights.at_infinity {
                    for e in self.ask(&*scene.lights.list[light as usize]) {
                        li[e.number as usize] += e.le;
                    }
                }
            }
            Background::Transparent => {}
            Background::Color(c) => {
                self.numbers.iter().for_each(|&i| li[i as usize] = Rgb::from(c));
            }
        }
    }

    /// What [`Escapes::add_background`] makes of black where all rays leave, in order: the same bits, nothing copied.
    pub fn fill_background(&mut self, scene: &Scene, wi: Directions, li: &mut [Rgb]) {
        match scene.background {
            Background::Sky => {
                let mut lights = scene.lights.at_infinity.iter().map(|&l| &scene.lights.list[l as usize]);
                if let Some(first) = lights.next() {
                    first.le_escaped(wi, li);
                }
                for light in lights {
                    self.radiance.resize(li.len(), Rgb::BLACK);
                    light.le_escaped(wi, &mut self.radiance);
                    li.iter_mut().zip(&self.radiance).for_each(|(sum, &le)| *sum += le);
                }
            }
            Background::Transparent => {}
            Background::Color(c) => li.fill(Rgb::from(c)),
        }
    }
}
