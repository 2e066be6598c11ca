//! The plan of groups: which shapes stand where, in which order groups depend on each other, and where each
//! group's own origin lies. All of it in double precision.

use super::desc::{Content, ObjectDesc, SceneDesc};
use crate::base::registry::{Node, Row, Value, build as build_node};
use crate::base::shape::ShapeSource;
use crate::base::space::RenderSpace;
use crate::error::{Error, Place, Result, unknown_name};
use crate::math::aabb::DAabb;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Deepest nesting of groups that is accepted.
pub const MAX_NESTING: usize = 64;

/// The largest coordinate of any group in world units: the cube of its inverse, the determinant of the map that scales it
/// to one, must not underflow.
const LARGEST: f64 = 1e100;

/// All groups, children before parents, the root last.
pub struct GroupPlan<'a> {
    /// See above.
    pub groups: Vec<PlannedGroup<'a>>,
    /// Whether the scene places any shape at all.
    pub has_objects: bool,
}

/// One group.
pub struct PlannedGroup<'a> {
    /// Shapes it holds itself.
    pub shapes: Vec<PlannedShape<'a>>,
    /// Groups it places.
    pub children: Vec<PlannedChild>,
    /// From the group's space as described to its recentred and scaled space.
    pub to_local: DAffine3,
    /// Bounds in the space as described.
    bounds: DAabb,
}

/// A shape and its object.
pub struct PlannedShape<'a> {
    /// The shape before placement.
    pub source: Arc<dyn ShapeSource>,
    /// Its kind, for names.
    pub kind: &'a str,
    /// The object it belongs to.
    pub object: &'a ObjectDesc,
    /// From object space to that of the group.
    pub transform: DAffine3,
}

/// A group placed in another.
pub struct PlannedChild {
    /// Index into [`GroupPlan::groups`].
    pub group: usize,
    /// From the child's space as described to the parent's as described.
    pub transform: DAffine3,
    /// Where it is placed.
    pub place: Place,
}

impl GroupPlan<'_> {
    /// Bounds of everything, in world space.
    pub fn world_bounds(&self) -> DAabb {
        self.groups.last().map_or(DAabb::EMPTY, |g| g.bounds)
    }

    /// For each direction the largest p . d of anything, in world space; that of placed groups by their bounds.
    pub fn support(&self, directions: &[DVec3]) -> Vec<f64> {
        let mut most = vec![f64::NEG_INFINITY; directions.len()];
        let Some(root) = self.groups.last() else { return most };
        let mut take = |support: Vec<f64>| most.iter_mut().zip(support).for_each(|(m, s)| *m = m.max(s));
        for s in &root.shapes {
            let local: Vec<DVec3> = directions.iter().map(|d| s.transform.matrix3.transpose() * *d).collect();
            let offsets = directions.iter().map(|d| s.transform.translation.dot(*d));
            take(s.source.support(&local).into_iter().zip(offsets).map(|(s, o)| s + o).collect());
        }
        for c in &root.children {
            let bounds = self.groups[c.group].bounds.transformed(&c.transform);
            if !bounds.is_empty() {
                let corners = bounds.corners();
                let reach = |d: &DVec3| corners.iter().fold(f64::NEG_INFINITY, |a, c| a.max(c.dot(*d)));
                take(directions.iter().map(reach).collect());
            }
        }
        most
    }

    /// World to render space: the root group's own recentring.
    pub fn render_space(&self) -> RenderSpace {
        let to_local = self.groups.last().map_or(DAffine3::IDENTITY, |g| g.to_local);
        let scale = to_local.matrix3.x_axis.x;
        RenderSpace { center: -to_local.translation / scale, scale }
    }
}

/// Orders groups, measures and recentres them.
pub fn plan_groups(desc: &SceneDesc, sources: Sources) -> Result<GroupPlan<'_>> {
    let mut planner = Planner {
        desc,
        sources,
        by_name: HashMap::new(),
        state: vec![Visit::New; desc.groups.len()],
        groups: Vec::new(),
        shared: HashMap::new(),
    };
    for (i, g) in desc.groups.iter().enumerate() {
        if planner.by_name.insert(g.name.as_str(), i).is_some() {
            return Err(at(&g.place, format!("there are two groups named \"{}\"", g.name)));
        }
    }
    let root = planner.plan(&desc.objects, &mut Vec::new())?;
    debug_assert_eq!(root + 1, planner.groups.len());
    let has_objects = planner.groups.iter().any(|g| !g.shapes.is_empty());
    Ok(GroupPlan { groups: planner.groups, has_objects })
}

/// Shape sources by the address of their node, which must not move while they are in use.
pub struct Sources(HashMap<*const Node, Source>);

struct Source {
    source: Arc<dyn ShapeSource>,
    /// Whether several objects show it.
    is_shared: bool,
}

/// Builds every shape's source in parallel, and takes the shapes' parameters out of the description, so that the
/// source alone holds a mesh and can give up its memory. Nodes that name the same loaded mesh with the same
/// parameters share one source: they become instances of one group.
pub fn build_sources(desc: &mut SceneDesc, shapes: &[Row<dyn ShapeSource>]) -> Result<Sources> {
    let objects = desc.objects.iter_mut().chain(desc.groups.iter_mut().flat_map(|g| &mut g.value));
    let mut nodes: Vec<&mut Node> = objects
        .filter_map(|o| match &mut o.content {
            Content::Shape(node) => Some(node),
            Content::Group(_) => None,
        })
        .collect();
    let mut first_of: HashMap<MeshKey, usize> = HashMap::new();
    let same_as: Vec<usize> = nodes
        .iter()
        .enumerate()
        .map(|(i, n)| mesh_key(n).map_or(i, |key| *first_of.entry(key).or_insert(i)))
        .collect();
    let built = nodes
        .par_iter()
        .enumerate()
        .map(|(i, n)| (same_as[i] == i).then(|| build_node("shape", shapes, n)).transpose())
        .collect::<Result<Vec<_>>>()?;
    let mut uses = vec![0usize; nodes.len()];
    same_as.iter().for_each(|&i| uses[i] += 1);
    let mut sources = HashMap::with_capacity(nodes.len());
    for (node, &i) in nodes.iter_mut().zip(&same_as) {
        node.params.list = Vec::new();
        let source = built[i].clone().expect("the first node of a key is built");
        sources.insert(&raw const **node, Source { source, is_shared: uses[i] > 1 });
    }
    Ok(Sources(sources))
}

/// A loaded mesh and the words beside it.
type MeshKey = (usize, Vec<(String, String)>);

/// What makes two nodes the same mesh; None for shapes that are not loaded from a file.
fn mesh_key(node: &Node) -> Option<MeshKey> {
    let mut mesh = None;
    let mut rest = Vec::new();
    for p in &node.params.list {
        match &p.value {
            Value::Mesh(m) => mesh = Some(Arc::as_ptr(m) as usize),
            Value::Text(t) => rest.push((p.name.clone(), t.clone())),
            Value::Bool(b) => rest.push((p.name.clone(), b.to_string())),
            Value::Number(x) => rest.push((p.name.clone(), x.to_string())),
            _ => return None,
        }
    }
    mesh.map(|m| (m, rest))
}

#[derive(Clone, Copy, PartialEq)]
enum Visit {
    New,
    Open,
    Done(usize),
}

struct Planner<'a> {
    desc: &'a SceneDesc,
    sources: Sources,
    by_name: HashMap<&'a str, usize>,
    state: Vec<Visit>,
    groups: Vec<PlannedGroup<'a>>,
    /// The group of each mesh that is placed more than once, by its source and its materials.
    shared: HashMap<(*const (), &'a [String]), usize>,
}

impl<'a> Planner<'a> {
    /// Plans a group after all it depends on; returns its index. `open` names the groups being planned, for the
    /// message about a cycle; its length is bounded by [`MAX_NESTING`].
    fn plan(&mut self, objects: &'a [ObjectDesc], open: &mut Vec<&'a str>) -> Result<usize> {
        let mut shapes = Vec::new();
        let mut children = Vec::new();
        for object in objects {
            check_transform(object)?;
            match &object.content {
                Content::Shape(node) => {
                    let built =
                        self.sources.0.remove(&(&raw const *node)).expect("every shape has its source");
                    let source = built.source;
                    let shape =
                        PlannedShape { source, kind: &node.kind, object, transform: object.transform };
                    if built.is_shared {
                        children.push(self.shared_child(shape)?);
                    } else {
                        shapes.push(shape);
                    }
                }
                Content::Group(name) => {
                    let group = self.plan_named(name, object, open)?;
                    children.push(PlannedChild {
                        group,
                        transform: object.transform,
                        place: object.place.clone(),
                    });
                }
            }
        }
        let mut bounds = DAabb::EMPTY;
        for s in &shapes {
            bounds = bounds.union(s.source.bounds().transformed(&s.transform));
        }
        for c in &children {
            bounds = bounds.union(self.groups[c.group].bounds.transformed(&c.transform));
        }
        self.push(shapes, children, bounds)
    }

    fn push(
        &mut self,
        shapes: Vec<PlannedShape<'a>>,
        children: Vec<PlannedChild>,
        bounds: DAabb,
    ) -> Result<usize> {
        if !bounds.is_empty() && !bounds.min.abs().max(bounds.max.abs()).cmple(DVec3::splat(LARGEST)).all() {
            let place = shapes.first().map_or(Place::default(), |s| s.object.place.clone());
            let message =
                format!("the objects are too large or too far away: coordinates go up to {LARGEST:e}");
            return Err(at(&place, message));
        }
        let to_local = local_space(&bounds);
        self.groups.push(PlannedGroup { shapes, children, to_local, bounds });
        Ok(self.groups.len() - 1)
    }

    fn plan_named(&mut self, name: &str, object: &'a ObjectDesc, open: &mut Vec<&'a str>) -> Result<usize> {
        let Some(&i) = self.by_name.get(name) else {
            let known = self.desc.groups.iter().map(|g| g.name.as_str());
            return Err(at(&object.place, unknown_name("group", name, known)));
        };
        match self.state[i] {
            Visit::Done(group) => return Ok(group),
            Visit::Open => {
                let chain = open.iter().skip_while(|n| **n != name).copied().collect::<Vec<_>>().join(" > ");
                return Err(at(&object.place, format!("a group cannot contain itself: {chain} > {name}")));
            }
            Visit::New => {}
        }
        if open.len() >= MAX_NESTING {
            return Err(at(&object.place, format!("groups are nested deeper than {MAX_NESTING}")));
        }
        self.state[i] = Visit::Open;
        let group = &self.desc.groups[i];
        open.push(&group.name);
        let planned = self.plan(&group.value, open)?;
        open.pop();
        self.state[i] = Visit::Done(planned);
        Ok(planned)
    }

    /// A mesh that several objects show stands once, in a group of its own for each list of materials; the
    /// objects place that group.
    fn shared_child(&mut self, shape: PlannedShape<'a>) -> Result<PlannedChild> {
        let (transform, place) = (shape.object.transform, shape.object.place.clone());
        let key = (Arc::as_ptr(&shape.source) as *const (), shape.object.materials.as_slice());
        let group = match self.shared.get(&key) {
            Some(&group) => group,
            None => {
                let bounds = shape.source.bounds();
                let shape = PlannedShape { transform: DAffine3::IDENTITY, ..shape };
                let group = self.push(vec![shape], Vec::new(), bounds)?;
                self.shared.insert(key, group);
                group
            }
        };
        Ok(PlannedChild { group, transform, place })
    }
}

/// Recentres a group whose coordinates would cost single precision more than two bits, and scales one whose size
/// is far from one by a power of two, so that no product inside a kernel can overflow or vanish.
fn local_space(bounds: &DAabb) -> DAffine3 {
    if bounds.is_empty() {
        return DAffine3::IDENTITY;
    }
    let center = bounds.center();
    let half = ((bounds.max - bounds.min) * 0.5).max_element();
    let far = center.abs().max_element() > 3.0 * half;
    let center = if far { center } else { DVec3::ZERO };
    let size = half.max(f64::MIN_POSITIVE);
    let scale = if (1e-4..=1e5).contains(&size) { 1.0 } else { (-size.log2().round()).exp2() };
    DAffine3::from_scale(DVec3::splat(scale)) * DAffine3::from_translation(-center)
}

fn check_transform(object: &ObjectDesc) -> Result<()> {
    let t = &object.transform;
    let det = t.matrix3.determinant();
    if !t.is_finite() || det == 0.0 || !det.is_finite() {
        return Err(at(
            &object.place,
            "the transform has no inverse: a scale is zero, or a number is not finite",
        ));
    }
    Ok(())
}

fn at(place: &Place, message: impl Into<String>) -> Error {
    Error::Content { place: place.clone(), message: message.into() }
}
