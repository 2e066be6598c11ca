//! What is in a picture, in words.

use crate::error::Result;
use crate::image::about::{Part, parts};
use std::path::Path;

/// Prints it.
pub fn run(path: &Path) -> Result<()> {
    let (kind, parts) = parts(path)?;
    println!("{}: {kind}", path.display());
    let several = parts.len() > 1;
    for (i, part) in parts.iter().enumerate() {
        if several {
            println!("part {} \"{}\"", i + 1, part.name);
        }
        print_part(part);
    }
    Ok(())
}

fn print_part(part: &Part) {
    let [width, height] = part.size;
    println!("  size         {width} x {height}");
    if part.frame != part.size || part.origin != part.frame_origin {
        let ([x, y], [fx, fy], [w, h]) = (part.origin, part.frame_origin, part.frame);
        println!("  window       from {x}, {y}, in a frame of {w} x {h} from {fx}, {fy}");
    }
    if !part.compression.is_empty() {
        println!("  compression  {}", part.compression);
    }
    // Layers in the order of their first channels, each with its precisions.
    let mut layers: Vec<(&str, Vec<String>)> = Vec::new();
    for (name, precision) in &part.channels {
        let (layer, bare) = name.rsplit_once('.').unwrap_or(("", name));
        let text = format!("{bare} ({precision})");
        match layers.iter_mut().find(|(l, _)| *l == layer) {
            Some((_, list)) => list.push(text),
            None => layers.push((layer, vec![text])),
        }
    }
    for (layer, channels) in layers {
        let name = if layer.is_empty() { "(unnamed)" } else { layer };
        println!("  layer        {name}: {}", channels.join(" "));
    }
    for (key, value) in &part.metadata {
        println!("  {key} = {value}");
    }
}
