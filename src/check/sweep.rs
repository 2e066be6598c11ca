//! Where a shape is put: as it is, far away, large and small, sheared, and through instances that cancel.

use crate::base::geometry::{Child, Geometry, Group, Leaf};
use crate::base::registry::{Node, Params, Value, build as build_node};
use crate::error::Result;
use crate::math::aabb::DAabb;
use crate::scene::build::{BuildOptions, build};
use crate::scene::desc::{Content, Named, ObjectDesc, SceneDesc};
use crate::shapes;
use glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// One way to put a shape.
#[derive(Debug, Clone)]
pub struct Placement {
    /// For people.
    pub name: String,
    how: How,
}

#[derive(Debug, Clone, Copy)]
enum How {
    /// By the scene builder, which bakes the transform and recentres.
    Baked(DAffine3),
    /// By the scene builder, moved by so many of its sizes, with a ball as far away on the other side, so that the
    /// middle of the two is the origin and recentring gains nothing.
    Beside(f64),
    /// The same, in a group of its own, which the builder recentres and places.
    GroupBeside(f64),
    /// Straight to the kernel: baked by the map, with lengths in sizes of the shape, and placed by its inverse.
    Cancelled(DAffine3),
}

/// Every placement of the sweep; the first is as it is.
pub fn placements() -> Vec<Placement> {
    let mut all = Vec::new();
    let mut add = |name: String, how| all.push(Placement { name, how });
    add("as it is".into(), How::Baked(DAffine3::IDENTITY));
    for distance in [1e3, 1e5, 1e7] {
        let by = DVec3::new(1.0, -0.7, 0.3) * distance;
        add(format!("moved by {distance:.0e} m"), How::Baked(DAffine3::from_translation(by)));
    }
    for scale in [1e-6, 1e-3, 1e3, 1e6] {
        add(format!("scaled by {scale:.0e}"), How::Baked(DAffine3::from_scale(DVec3::splat(scale))));
    }
    for shear in [3.0, 30.0] {
        add(format!("sheared by {shear:.0}"), How::Baked(DAffine3::from_mat3(sheared(shear))));
    }
    add("flattened to 1:1000, turned".into(), How::Baked(DAffine3::from_mat3(turned() * flattened())));
    add("mirrored".into(), How::Baked(DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0))));
    for sizes in [10.0, 1e3] {
        add(format!("{sizes:.0e} sizes off the origin"), How::Beside(sizes));
    }
    for sizes in [10.0, 1e3] {
        add(format!("instance {sizes:.0e} sizes off the origin"), How::GroupBeside(sizes));
    }
    for sizes in [1e2, 1e4] {
        let by = DAffine3::from_translation(DVec3::new(1.0, -0.7, 0.3) * sizes);
        add(format!("instance that cancels {sizes:.0e} sizes"), How::Cancelled(by));
    }
    for scale in [1e-4, 1e4] {
        let by = DAffine3::from_scale(DVec3::splat(scale));
        add(format!("instance that cancels a scale of {scale:.0e}"), How::Cancelled(by));
    }
    let bent = DAffine3 { matrix3: turned() * sheared(5.0), translation: DVec3::new(10.0, 3.0, -20.0) };
    add("instance that cancels a shear of 5 and 20 sizes".into(), How::Cancelled(bent));
    all
}

fn sheared(by: f64) -> DMat3 {
    DMat3::from_cols(DVec3::X, DVec3::new(by, 1.0, 0.0), DVec3::new(0.0, 0.3, 1.0))
}

fn turned() -> DMat3 {
    DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7)
}

fn flattened() -> DMat3 {
    DMat3::from_diagonal(DVec3::new(1.0, 1e-3, 1.0))
}

impl Placement {
    /// The geometry with the shape of a node so placed. The mesh of the node may be shared: it is copied.
    ///
    /// # Errors
    /// Those of the scene builder: a placement in which nothing of the shape can be represented.
    pub fn build(&self, shape: &Node) -> Result<Arc<Geometry>> {
        let object = |node: Node, transform| ObjectDesc {
            name: "shape".into(),
            content: Content::Shape(node),
            materials: Vec::new(),
            transform,
            place: Default::default(),
        };
        if let How::Cancelled(by) = self.how {
            return cancelled(shape, by);
        }
        let mut scene = SceneDesc::default();
        match self.how {
            How::Baked(by) => scene.objects.push(object(shape.clone(), by)),
            How::Beside(sizes) | How::GroupBeside(sizes) => {
                let bounds = build_node("shape", shapes::REGISTRY, shape)?.bounds();
                let away = DVec3::new(1.0, 0.4, -0.3) * (2.0 * bounds.radius() * sizes);
                let to = DAffine3::from_translation(away - bounds.center());
                match self.how {
                    How::Beside(_) => scene.objects.push(object(shape.clone(), to)),
                    _ => {
                        let group = object(shape.clone(), DAffine3::IDENTITY);
                        let named = Named { name: "g".into(), value: vec![group], place: Default::default() };
                        scene.groups.push(named);
                        let content = Content::Group("g".into());
                        scene.objects.push(ObjectDesc { content, ..object(Node::default(), to) });
                    }
                }
                let radius = Value::Number(bounds.radius().clamp(1e-30, 1e30));
                let params = Params::new().with("radius", radius);
                let ball = Node { kind: "sphere".into(), params, ..Node::default() };
                scene.objects.push(object(ball, DAffine3::from_translation(-away)));
            }
            How::Cancelled(_) => unreachable!("done above"),
        }
        Ok(build(scene, &no_kernel())?.geometry)
    }
}

/// The kernel that needs no build: the geometry is all that is wanted.
fn no_kernel() -> BuildOptions {
    BuildOptions { backend: "brute".into(), ..BuildOptions::default() }
}

fn cancelled(shape: &Node, by: DAffine3) -> Result<Arc<Geometry>> {
    let source = build_node("shape", shapes::REGISTRY, shape)?;
    let bounds = source.bounds();
    let size = 2.0 * bounds.radius();
    // In units of the shape, about its middle; the result is a shape of size one about the origin.
    let to_unit =
        DAffine3::from_scale(DVec3::splat(1.0 / size)) * DAffine3::from_translation(-bounds.center());
    let placed = source.place(&(by * to_unit))?.shape;
    let inner = placed.bounds();
    let leaf = Leaf { shape: placed, filter: None, object: 0 };
    let group = Group { leaves: vec![leaf], children: Vec::new(), bounds: inner, paths: 1 };
    let to_parent = by.inverse();
    let outer = DAabb::from(inner).transformed(&to_parent).to_f32();
    let child = Child { group: 0, to_parent, from_parent: by, first_path: 0 };
    let root = Group { leaves: Vec::new(), children: vec![child], bounds: outer, paths: 1 };
    Ok(Arc::new(Geometry { groups: vec![group, root] }))
}
