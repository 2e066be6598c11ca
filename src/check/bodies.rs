//! What is examined: the shapes of the user's scene, each once, and a body of needles that is made here.

use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::base::registry::{Node, Params, Value};
use crate::scene::desc::{Content, SceneDesc};
use std::collections::HashSet;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::sync::Arc;

/// Shapes of a scene that are swept each by itself; of more, the first are, and the scene as a whole all the same.
const MAX_BODIES: usize = 8;

/// A shape by itself.
#[derive(Clone)]
pub struct Body {
    /// For people.
    pub name: String,
    /// As scenes describe it.
    pub node: Node,
}

/// The different shapes of a scene.
pub struct Bodies {
    /// Those that are swept.
    pub list: Vec<Body>,
    /// How many more there are.
    pub more: usize,
}

/// Every shape of a scene once, however often and under whatever names it is placed.
pub fn of_scene(scene: &SceneDesc) -> Bodies {
    let objects = scene.objects.iter().chain(scene.groups.iter().flat_map(|g| &g.value));
    let mut seen = HashSet::new();
    let mut bodies = Bodies { list: Vec::new(), more: 0 };
    for o in objects {
        let Content::Shape(node) = &o.content else { continue };
        if !seen.insert(fingerprint(node)) {
            continue;
        }
        if bodies.list.len() == MAX_BODIES {
            bodies.more += 1;
            continue;
        }
        let name = if o.name.is_empty() { format!("{} {}", node.kind, seen.len()) } else { o.name.clone() };
        bodies.list.push(Body { name, node: node.clone() });
    }
    bodies
}

/// The same for nodes that describe the same shape.
fn fingerprint(node: &Node) -> String {
    let mut text = node.kind.clone();
    for p in &node.params.list {
        // Writing to a string cannot fail.
        let _ = match &p.value {
            Value::Mesh(m) => write!(text, " {}={:p}", p.name, Arc::as_ptr(m)),
            Value::Number(x) => write!(text, " {}={x}", p.name),
            Value::Numbers(x) => write!(text, " {}={x:?}", p.name),
            Value::Text(t) => write!(text, " {}={t:?}", p.name),
            Value::Bool(b) => write!(text, " {}={b}", p.name),
            // A kind of value that no shape has today: told apart by where it stands.
            _ => write!(text, " {}={:p}", p.name, p),
        };
    }
    text
}

/// Sides of the prism: each is 10,000 times as high as wide.
const SIDES: u32 = 1000;

/// A closed prism of needles: its sides are as thin as a hair, its ends are fans whose middle has a thousand faces.
/// Every tenth side stands there twice, and every tenth comes with two triangles without area.
pub fn needles() -> Body {
    let radius = 0.1;
    let height = 1e4 * radius * TAU / f64::from(SIDES);
    let ring = |y: f64| {
        (0..SIDES).map(move |i| {
            let (sin, cos) = (f64::from(i) * TAU / f64::from(SIDES)).sin_cos();
            [(radius * cos) as f32, y as f32, (radius * sin) as f32]
        })
    };
    let mut positions: Vec<[f32; 3]> = ring(0.0).chain(ring(height)).collect();
    positions.extend([[0.0, 0.0, 0.0], [0.0, height as f32, 0.0]]);
    let (bottom, top) = (2 * SIDES, 2 * SIDES + 1);
    let mut indices = Vec::new();
    for i in 0..SIDES {
        let j = (i + 1) % SIDES;
        let [a, b, c, d] = [i, j, SIDES + j, SIDES + i];
        indices.extend([[a, d, c], [a, c, b], [bottom, a, b], [top, c, d]]);
        if i % 10 == 0 {
            indices.extend([[c, a, d], [a, a, d], [b, c, c]]);
        }
    }
    let mesh = MeshData {
        positions: Positions::F32(positions),
        normals: Vec::new(),
        uvs: Vec::new(),
        indices,
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    let params = Params::new().with("path", Value::Mesh(Arc::new(mesh)));
    let node = Node { kind: "mesh".into(), params, ..Node::default() };
    Body { name: "a prism of needles".into(), node }
}
