//! Two folders of pictures, compared name by name.

use crate::error::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Endings of files that are looked at.
const PICTURES: &[&str] = &["exr", "hdr", "png", "jpg", "jpeg", "tif", "tiff", "pfm"];

/// What two folders have.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Matched {
    /// Reference and test of one name, in order of names.
    pub pairs: Vec<[PathBuf; 2]>,
    /// Pictures that only one of the folders has.
    pub alone: Vec<PathBuf>,
}

/// Pairs pictures of equal names; where there is none, of equal names but for the ending, if there is one alone.
///
/// # Errors
/// A folder that cannot be read; folders without a picture in common.
pub fn matched(reference: &Path, test: &Path) -> Result<Matched> {
    let (references, mut tests) = (pictures(reference)?, pictures(test)?);
    let mut found = Matched::default();
    for (name, path) in references {
        let stem = |n: &str| Path::new(n).file_stem().map(ToOwned::to_owned);
        let other = match tests.remove(&name) {
            Some(same) => Some(same),
            None => {
                let alike: Vec<String> = tests.keys().filter(|t| stem(t) == stem(&name)).cloned().collect();
                match alike.as_slice() {
                    [only] => tests.remove(only),
                    _ => None,
                }
            }
        };
        match other {
            Some(other) => found.pairs.push([path, other]),
            None => found.alone.push(path),
        }
    }
    found.alone.extend(tests.into_values());
    if found.pairs.is_empty() {
        let text = format!("has no picture of the name of one in {}", reference.display());
        return Err(Error::content(test, text));
    }
    Ok(found)
}

/// Pictures of a folder by their names.
fn pictures(folder: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let fail = |e: std::io::Error| Error::file(folder, "read", e);
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let is_picture = ending.is_some_and(|e| PICTURES.contains(&e.as_str()));
        if let Some(name) = path.file_name().filter(|_| is_picture && path.is_file()) {
            all.insert(name.to_string_lossy().into_owned(), path.clone());
        }
    }
    Ok(all)
}
