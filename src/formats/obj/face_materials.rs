//! Which face has which material, as the `usemtl` statements say.

use std::collections::HashMap;

/// Faces in a row under one material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    /// Its number in [`FaceMaterials::names`].
    pub material: u16,
    /// How many faces.
    pub faces: usize,
}

/// Materials are numbered in the order in which faces first use them.
#[derive(Debug, Default)]
pub struct FaceMaterials {
    names: Vec<String>,
    numbers: HashMap<String, u16>,
    runs: Vec<Run>,
    /// What the last `usemtl` said.
    current: String,
    /// Its number, once a face has used it.
    number: Option<u16>,
}

impl FaceMaterials {
    /// Names by number; "" for faces before any `usemtl`.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// All faces, in file order.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// The material of the faces to come.
    pub fn switch_to(&mut self, name: String) {
        self.current = name;
        self.number = None;
    }

    /// So many more faces under the current material. Fails beyond 65536 materials.
    pub fn add_faces(&mut self, faces: usize) -> Result<(), String> {
        if faces == 0 {
            return Ok(());
        }
        let number = match self.number {
            Some(number) => number,
            None => self.number_of_current()?,
        };
        match self.runs.last_mut() {
            Some(run) if run.material == number => run.faces += faces,
            _ => self.runs.push(Run { material: number, faces }),
        }
        Ok(())
    }

    fn number_of_current(&mut self) -> Result<u16, String> {
        let number = match self.numbers.get(&self.current) {
            Some(&number) => number,
            None => {
                let number =
                    u16::try_from(self.names.len()).map_err(|_| "more than 65536 materials".to_string())?;
                self.names.push(self.current.clone());
                self.numbers.insert(self.current.clone(), number);
                number
            }
        };
        self.number = Some(number);
        Ok(number)
    }
}
