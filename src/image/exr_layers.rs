//! Layers of an EXR file: channels of one part whose names agree up to the last dot, and which of them is the picture.
//!
//! In a file of several parts a layer's full name begins with the part's ("Technical Introduction to OpenEXR",
//! section "Multi-Part Files"), unless its channels' names already do.

use crate::error::unknown_name;
use exr::meta::header::Header;

/// Channels that belong together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layer {
    /// Full name; empty for unnamed channels of a file of one part.
    pub name: String,
    /// Index of the header.
    pub part: usize,
    /// Whether the channels stand in their part without a prefix.
    pub bare: bool,
    /// Names without the prefix, `R G B A` in this order and one-letter names in capitals, with indices in the part's
    /// list.
    pub channels: Vec<(String, usize)>,
}

impl Layer {
    fn at(&self, name: &str) -> Option<usize> {
        self.channels.iter().find(|(n, _)| n == name).map(|&(_, at)| at)
    }

    fn rgb(&self) -> Option<[usize; 3]> {
        Some([self.at("R")?, self.at("G")?, self.at("B")?])
    }

    /// The `Y` of brightness, not that of a vector.
    fn gray(&self) -> Option<[usize; 3]> {
        self.at("Y").filter(|_| self.at("X").is_none()).map(|at| [at; 3])
    }

    /// Channels that serve as red, green and blue.
    pub fn colour(&self) -> Option<[usize; 3]> {
        self.rgb().or_else(|| self.gray())
    }

    fn is_called(&self, names: &[&str]) -> bool {
        let last = self.name.rsplit('.').next().unwrap_or_default();
        names.iter().any(|n| last.eq_ignore_ascii_case(n))
    }
}

/// Every layer, part by part.
pub(super) fn layers(headers: &[Header]) -> Vec<Layer> {
    let mut all: Vec<Layer> = Vec::new();
    for (part, header) in headers.iter().enumerate() {
        let first = all.len();
        let part_name = match &header.own_attributes.layer_name {
            Some(name) if headers.len() > 1 => name.to_string(),
            _ => String::new(),
        };
        for (index, channel) in header.channels.list.iter().enumerate() {
            let text = channel.name.to_string();
            let (prefix, bare) = text.rsplit_once('.').unwrap_or(("", &text));
            let name = full_name(&part_name, prefix);
            match all[first..].iter_mut().find(|l| l.name == name) {
                Some(layer) => layer.channels.push((bare.to_owned(), index)),
                None => all.push(Layer {
                    name,
                    part,
                    bare: prefix.is_empty(),
                    channels: vec![(bare.to_owned(), index)],
                }),
            }
        }
    }
    all.iter_mut().for_each(|layer| tidy(&mut layer.channels));
    all
}

fn full_name(part: &str, prefix: &str) -> String {
    let begins = prefix.strip_prefix(part).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
    match (part.is_empty() || begins, prefix.is_empty()) {
        (true, _) => prefix.to_owned(),
        (false, true) => part.to_owned(),
        (false, false) => format!("{part}.{prefix}"),
    }
}

/// One-letter names in capitals, where that makes no two alike; colour first, then vectors.
fn tidy(channels: &mut [(String, usize)]) {
    let mut capitals: Vec<String> = channels.iter().map(|(n, _)| n.to_ascii_uppercase()).collect();
    capitals.sort();
    if capitals.windows(2).all(|pair| pair[0] != pair[1]) {
        channels.iter_mut().filter(|(n, _)| n.len() == 1).for_each(|(n, _)| n.make_ascii_uppercase());
    }
    let rank = |name: &str| ["R", "G", "B", "X", "Y", "A", "Z"].iter().position(|n| *n == name).unwrap_or(7);
    channels.sort_by(|a, b| (rank(&a.0), &a.0).cmp(&(rank(&b.0), &b.0)));
}

/// The layer that most likely is the picture: `R G B` without prefix, then a name that ends in `Combined` (Blender),
/// then one of the names that other programs give, then any colour, then brightness alone, then the first of all.
pub(super) fn main(layers: &[Layer]) -> Option<&Layer> {
    let colour = || layers.iter().filter(|l| l.rgb().is_some());
    let gray = || layers.iter().filter(|l| l.gray().is_some());
    colour()
        .find(|l| l.bare)
        .or_else(|| colour().find(|l| l.name.to_ascii_lowercase().ends_with("combined")))
        .or_else(|| colour().find(|l| l.is_called(&["color", "colour", "<root>", "beauty", "rgba", "rgb"])))
        .or_else(|| colour().next())
        .or_else(|| gray().find(|l| l.bare))
        .or_else(|| gray().next())
        .or_else(|| layers.iter().find(|l| l.bare))
        .or_else(|| layers.first())
}

/// The layer of this name, or whose name ends in it behind a dot, whatever the case; of a full channel name, that
/// channel alone.
///
/// # Errors
/// A message that lists what there is.
pub(super) fn named(layers: &[Layer], wanted: &str) -> Result<Layer, String> {
    if let Some(layer) = layers.iter().find(|l| l.name == wanted) {
        return Ok(layer.clone());
    }
    let ends = |name: &str| {
        let (name, end) = (name.to_ascii_lowercase(), wanted.to_ascii_lowercase());
        name.strip_suffix(&end).is_some_and(|rest| rest.is_empty() || rest.ends_with('.'))
    };
    let found: Vec<&Layer> = layers.iter().filter(|l| !wanted.is_empty() && ends(&l.name)).collect();
    match found[..] {
        [layer] => return Ok(layer.clone()),
        [] => {}
        _ => {
            let names: Vec<&str> = found.iter().map(|l| &*l.name).collect();
            return Err(format!("the layer name \"{wanted}\" is ambiguous: {}", names.join(", ")));
        }
    }
    for layer in layers {
        let is_it = |bare: &str| match layer.name.is_empty() {
            true => bare.eq_ignore_ascii_case(wanted),
            false => format!("{}.{bare}", layer.name).eq_ignore_ascii_case(wanted),
        };
        if let Some(channel) = layer.channels.iter().find(|(bare, _)| is_it(bare)) {
            return Ok(Layer { channels: vec![channel.clone()], ..layer.clone() });
        }
    }
    let shown = layers.iter().map(|l| if l.name.is_empty() { "(unnamed)" } else { &*l.name });
    Err(unknown_name("layer", wanted, shown))
}
