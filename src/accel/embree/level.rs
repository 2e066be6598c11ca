//! Embree scenes for groups: their leaves, and levels that place groups within groups.

use super::callbacks::{self, FilterData, PortalData, ShapeData, ShapePrimitive};
use super::handles::{Device, GeometryHandle, SceneHandle};
use super::plan::{Placed, Plan};
use crate::accel::failure::Failure;
use crate::accel::tame::{grown, reach};
use crate::base::geometry::Geometry;
use crate::base::intersectable::{BuildQuality, KernelMode, KernelOptions};
use crate::base::mesh::TriangleMesh;
use crate::error::{Error, Result};
use crate::math::aabb::{Aabb, DAabb};
use embree_sys::*;
use glam::DAffine3;
use std::ptr;
use std::sync::Arc;

/// Hits on user geometry carry the leaf in their geometry id, with this bit; ids of Embree's own stay below it.
pub(super) const SHAPE_BIT: u32 = 1 << 31;
/// Geometry id of a hit behind a portal: the path stands in the words of u (low) and v (high).
pub(super) const PORTAL_ID: u32 = INVALID_ID - 1;

/// The leaves of one group as Embree geometries, shared by every scene in which they appear.
#[derive(Default)]
pub(super) struct Leaves {
    /// By geometry id; the last one is the procedural shapes, if there are any.
    geometries: Vec<GeometryHandle>,
    /// Leaf by geometry id, for meshes.
    pub(super) leaf_of: Vec<u32>,
    /// The scene of these leaves alone, for instances; made when one is asked for.
    scene: Option<SceneHandle>,
    /// Whether hits ask code of ours (procedural shapes, filters).
    pub(super) calls_back: bool,
    /// What the geometries' user pointers point at; shared, so that it neither moves nor is borrowed mutably.
    data: LeafData,
}

#[derive(Default)]
struct LeafData {
    shapes: Option<Arc<ShapeData>>,
    filters: Vec<Arc<FilterData>>,
}

/// An instance: what turns its hits into paths, and rays into its space.
pub(super) struct Instance {
    pub(super) group: u32,
    /// Index into [`Level::transforms`], or none if nothing of the group calls back.
    pub(super) transform: u32,
    pub(super) first_path: u64,
}

/// A group with everything below it as one Embree scene, ready for rays in the group's space.
pub(super) struct Level {
    pub(super) scene: SceneHandle,
    pub(super) group: usize,
    /// Of everything in it, grown by a little for rounding.
    pub(super) bounds: DAabb,
    /// See [`reach`].
    pub(super) reach: f64,
    /// Embree's geometry id of instance 0.
    pub(super) first_instance: u32,
    pub(super) instances: Vec<Instance>,
    /// From the level's space into the instance's.
    pub(super) transforms: Vec<DAffine3>,
    /// Whether products of three coordinates overflow f32, so that Embree may report an infinite distance.
    pub(super) is_huge: bool,
    /// If not none, all hits are on this leaf of the level's own group, without instances or portals.
    pub(super) only_leaf: Option<u32>,
    /// Whether queries call code of ours.
    pub(super) calls_back: bool,
    portals: Option<Arc<PortalData>>,
}

/// Everything that is built.
pub(super) struct Levels {
    /// The first is the root's.
    pub(super) levels: Vec<Level>,
    /// By group; empty for groups that appear in no scene.
    pub(super) leaves: Vec<Leaves>,
}

/// What every step of a build needs.
pub(super) struct Builder<'a> {
    pub(super) geometry: &'a Arc<Geometry>,
    pub(super) device: &'a Device,
    pub(super) failure: &'a Arc<Failure>,
    flags: RTCSceneFlags,
    quality: RTCBuildQuality,
}

impl<'a> Builder<'a> {
    pub(super) fn new(
        geometry: &'a Arc<Geometry>,
        device: &'a Device,
        failure: &'a Arc<Failure>,
        options: &KernelOptions,
    ) -> Self {
        let flags = match options.mode {
            KernelMode::Robust => RTC_SCENE_FLAG_ROBUST,
            KernelMode::Fast => RTC_SCENE_FLAG_NONE,
        };
        let quality = match options.quality {
            BuildQuality::Fast => RTC_BUILD_QUALITY_LOW,
            BuildQuality::Balanced => RTC_BUILD_QUALITY_MEDIUM,
            BuildQuality::Best => RTC_BUILD_QUALITY_HIGH,
        };
        Builder { geometry, device, failure, flags, quality }
    }

    /// Scenes for the root and for every group that a portal leads to.
    pub(super) fn build(&self, mut budget: usize) -> Result<Levels> {
        let groups = &self.geometry.groups;
        let mut leaves: Vec<Option<Leaves>> = groups.iter().map(|_| None).collect();
        let mut level_of: Vec<Option<u32>> = vec![None; groups.len()];
        let mut wanted = vec![groups.len() - 1];
        level_of[groups.len() - 1] = Some(0);
        let mut levels = Vec::new();
        while levels.len() < wanted.len() {
            let group = wanted[levels.len()];
            // Half of what is left to each level: the nearest levels matter most, and none starves the next.
            let mut share = budget / 2;
            let plan = Plan::new(self.geometry, group, reach(groups[group].bounds), &mut share);
            budget -= budget / 2 - share;
            for portal in &plan.portals {
                level_of[portal.group].get_or_insert_with(|| {
                    wanted.push(portal.group);
                    wanted.len() as u32 - 1
                });
            }
            levels.push(self.level(group, plan, &level_of, &mut leaves)?);
        }
        let leaves = leaves.into_iter().map(Option::unwrap_or_default).collect();
        Ok(Levels { levels, leaves })
    }

    fn level(
        &self,
        group: usize,
        plan: Plan,
        level_of: &[Option<u32>],
        leaves: &mut [Option<Leaves>],
    ) -> Result<Level> {
        let bounds = self.geometry.groups[group].bounds;
        let own = self.leaves(group, leaves)?;
        let alone = plan.instances.is_empty() && plan.portals.is_empty();
        let only_leaf = match own.leaf_of[..] {
            [leaf] if alone && own.geometries.len() == 1 => Some(leaf),
            _ => None,
        };
        let mut calls_back = own.calls_back || !plan.portals.is_empty();
        if alone {
            let scene = self.leaf_scene(own)?;
            let level = Level { only_leaf, ..Level::empty(scene, group, bounds, calls_back) };
            return Ok(level);
        }
        let mut scene = self.device.new_scene();
        for (id, g) in own.geometries.iter().enumerate() {
            scene.attach(g, id as u32);
        }
        let mut next_id = own.geometries.len() as u32;
        let portals =
            if plan.portals.is_empty() { None } else { Some(self.portals(&plan.portals, level_of)) };
        if let Some((geometry, _)) = &portals {
            scene.attach(geometry, next_id);
            next_id += 1;
        }
        let (mut instances, mut transforms) = (Vec::new(), Vec::new());
        for (k, placed) in plan.instances.iter().enumerate() {
            let below = self.leaves(placed.group, leaves)?;
            let transform = transforms.len() as u32;
            if below.calls_back {
                transforms.push(placed.from_level);
                calls_back = true;
            }
            let child = self.leaf_scene(below)?;
            scene.attach(&self.instance(&child, placed), next_id + k as u32);
            instances.push(Instance { group: placed.group as u32, transform, first_path: placed.first_path });
        }
        self.commit(&mut scene)?;
        let portals = portals.map(|(_, data)| data);
        let level = Level::empty(scene, group, bounds, calls_back);
        Ok(Level { first_instance: next_id, instances, transforms, portals, ..level })
    }

    fn commit(&self, scene: &mut SceneHandle) -> Result<()> {
        scene.commit(self.flags, self.quality);
        self.failure.take()?;
        self.device.check("building a scene")
    }

    /// The scene of a group's leaves alone.
    fn leaf_scene(&self, leaves: &mut Leaves) -> Result<SceneHandle> {
        if let Some(scene) = &leaves.scene {
            return Ok(scene.clone());
        }
        let mut scene = self.device.new_scene();
        for (id, g) in leaves.geometries.iter().enumerate() {
            scene.attach(g, id as u32);
        }
        self.commit(&mut scene)?;
        Ok(leaves.scene.insert(scene).clone())
    }

    /// The geometries of a group's leaves, made when first asked for.
    fn leaves<'b>(&self, group: usize, made: &'b mut [Option<Leaves>]) -> Result<&'b mut Leaves> {
        let leaves = match made[group].take() {
            Some(leaves) => leaves,
            None => self.make_leaves(group)?,
        };
        Ok(made[group].insert(leaves))
    }

    fn make_leaves(&self, group: usize) -> Result<Leaves> {
        let mut leaves = Leaves::default();
        let mut shapes = Vec::new();
        for (i, leaf) in self.geometry.groups[group].leaves.iter().enumerate() {
            let i = i as u32;
            if i >= SHAPE_BIT - 1 {
                return Err(Error::Usage("a group holds more than 2^31 shapes".to_owned()));
            }
            match leaf.shape.triangles() {
                Some(mesh) if mesh.indices.is_empty() => {}
                Some(mesh) => {
                    let mut g = self.mesh(mesh)?;
                    if leaf.filter.is_some() {
                        let data = Arc::new(FilterData {
                            geometry: self.geometry.clone(),
                            group,
                            leaf: i,
                            failure: self.failure.clone(),
                        });
                        callbacks::set_filter(&g, &data);
                        leaves.data.filters.push(data);
                        leaves.calls_back = true;
                    }
                    g.commit();
                    leaves.geometries.push(g);
                    leaves.leaf_of.push(i);
                }
                None => shapes
                    .extend((0..leaf.shape.primitive_count()).map(|prim| ShapePrimitive { leaf: i, prim })),
            }
        }
        if !shapes.is_empty() {
            let count = u32::try_from(shapes.len())
                .map_err(|_| Error::Usage("a group holds more than 2^32 primitives of shapes".to_owned()))?;
            let (geometry, failure) = (self.geometry.clone(), self.failure.clone());
            let data = Arc::new(ShapeData { geometry, group, primitives: shapes, failure });
            let mut g = self.device.new_geometry(RTC_GEOMETRY_TYPE_USER);
            callbacks::set_shapes(&g, &data, count);
            g.commit();
            leaves.geometries.push(g);
            leaves.data.shapes = Some(data);
            leaves.calls_back = true;
        }
        self.device.check("taking over the geometry")?;
        Ok(leaves)
    }

    /// A mesh over the arrays as they are.
    fn mesh(&self, mesh: &TriangleMesh) -> Result<GeometryHandle> {
        let g = self.device.new_geometry(RTC_GEOMETRY_TYPE_TRIANGLE);
        let (vertices, indices) = (mesh.padded_positions(), &mesh.indices);
        let count = vertices.len() - 1;
        if u32::try_from(indices.len()).is_err() {
            return Err(Error::Usage(format!(
                "{} triangles in one mesh; Embree holds 4294967295",
                indices.len()
            )));
        }
        // SAFETY: the arrays live as long as the geometry: the kernel owns an Arc of the scene's geometry, within
        // which a shape is shared and so cannot change. The last vertex is padding, so that 16 bytes from the start
        // of each one are readable. Embree leaves out triangles with an index past `count`.
        unsafe {
            let (v, i) = (vertices.as_ptr().cast(), indices.as_ptr().cast());
            rtcSetSharedGeometryBuffer(
                g.raw(),
                RTC_BUFFER_TYPE_VERTEX,
                0,
                RTC_FORMAT_FLOAT3,
                v,
                0,
                12,
                count,
            );
            rtcSetSharedGeometryBuffer(
                g.raw(),
                RTC_BUFFER_TYPE_INDEX,
                0,
                RTC_FORMAT_UINT3,
                i,
                0,
                12,
                indices.len(),
            );
        }
        Ok(g)
    }

    fn instance(&self, child: &SceneHandle, placed: &Placed) -> GeometryHandle {
        let mut g = self.device.new_geometry(RTC_GEOMETRY_TYPE_INSTANCE);
        let to_level: [f32; 12] = placed.to_level.to_cols_array().map(|x| x as f32);
        // SAFETY: the child is committed; the twelve numbers are read during the call.
        unsafe {
            rtcSetGeometryInstancedScene(g.raw(), child.raw());
            let format = RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR;
            rtcSetGeometryTransform(g.raw(), 0, format, to_level.as_ptr().cast());
        }
        g.commit();
        g
    }

    fn portals(&self, placed: &[Placed], level_of: &[Option<u32>]) -> (GeometryHandle, Arc<PortalData>) {
        let portals = placed
            .iter()
            .map(|p| {
                let bounds = grown(self.geometry.groups[p.group].bounds).transformed(&p.to_level);
                callbacks::Portal {
                    bounds: bounds.to_f32(),
                    from_level: p.from_level,
                    first_path: p.first_path,
                    level: level_of[p.group].unwrap_or_default(),
                }
            })
            .collect();
        let data = Arc::new(PortalData { portals, failure: self.failure.clone() });
        let mut g = self.device.new_geometry(RTC_GEOMETRY_TYPE_USER);
        callbacks::set_portals(&g, &data);
        g.commit();
        (g, data)
    }
}

impl Level {
    fn empty(scene: SceneHandle, group: usize, bounds: Aabb, calls_back: bool) -> Self {
        Level {
            scene,
            group,
            bounds: grown(bounds),
            reach: reach(bounds),
            is_huge: reach(bounds) > 1e12,
            first_instance: 0,
            instances: Vec::new(),
            transforms: Vec::new(),
            only_leaf: None,
            calls_back,
            portals: None,
        }
    }
}

impl Levels {
    /// Bytes of the tables beside Embree's own.
    pub(super) fn memory(&self) -> u64 {
        let of_level = |l: &Level| {
            let portals = l.portals.as_ref().map_or(0, |p| size_of_val(&p.portals[..]));
            size_of_val(&l.instances[..]) + size_of_val(&l.transforms[..]) + portals
        };
        let of_leaves = |l: &Leaves| {
            let shapes = l.data.shapes.as_ref().map_or(0, |s| size_of_val(&s.primitives[..]));
            size_of_val(&l.leaf_of[..]) + shapes + l.data.filters.len() * size_of::<FilterData>()
        };
        (self.levels.iter().map(of_level).sum::<usize>() + self.leaves.iter().map(of_leaves).sum::<usize>())
            as u64
    }
}

/// The pointer that a callback casts back.
pub(super) fn user_data<T>(data: &T) -> *mut std::ffi::c_void {
    ptr::from_ref(data).cast_mut().cast()
}
