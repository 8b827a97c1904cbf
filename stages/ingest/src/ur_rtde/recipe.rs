//! The recipe: outputs that a controller agrees to send, and their order in a package of data. Pure.

use super::fault::Fault;
use super::field::{Field, Part};

/// Number of values in the longest recipe.
const MAX_NUMBERS: usize = 35;
const NOT_FOUND: &str = "NOT_FOUND";

/// Values of a package, in the order of [`Part::ALL`]; 0 for outputs that were not requested.
pub(super) type Numbers = [f64; MAX_NUMBERS];

/// Returns the body of the request for these fields.
pub(super) fn request(fields: &[Field], rate_hz: f64) -> Vec<u8> {
    let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
    let mut body = rate_hz.to_be_bytes().to_vec();
    body.extend_from_slice(names.join(",").as_bytes());
    body
}

/// Outputs that a controller has agreed to send.
#[derive(Debug)]
pub(super) struct Recipe {
    id: u8,
    fields: Vec<Field>,
}

impl Recipe {
    /// Parses a controller's answer: the number of the recipe, and the types of its fields.
    ///
    /// # Errors
    /// [`Fault::NotFound`] with all fields that the controller does not have; [`Fault::Recipe`] if a field has
    /// another type.
    pub fn agreed(answer: &[u8], fields: Vec<Field>) -> Result<Self, Fault> {
        let (&id, types) = answer
            .split_first()
            .ok_or_else(|| Fault::Recipe("it is empty".to_owned()))?;
        let types = String::from_utf8_lossy(types);
        let types: Vec<&str> = types.split(',').map(str::trim).collect();
        if types.len() != fields.len() {
            let reason = format!("{} types for {} fields", types.len(), fields.len());
            return Err(Fault::Recipe(reason));
        }
        let both = || fields.iter().zip(&types);
        let missing = both().filter(|(_, found)| **found == NOT_FOUND);
        let missing: Vec<Field> = missing.map(|(field, _)| *field).collect();
        if !missing.is_empty() {
            return Err(Fault::NotFound(missing));
        }
        for (field, found) in both() {
            let (expected, _) = field.part.type_name();
            if *found != expected {
                let reason = format!("{} is {found}, not {expected}", field.name);
                return Err(Fault::Recipe(reason));
            }
        }
        Ok(Self { id, fields })
    }

    /// Whether it includes this quantity.
    pub fn has(&self, part: Part) -> bool {
        self.fields.iter().any(|field| field.part == part)
    }

    /// Returns the values of a package of data.
    ///
    /// # Errors
    /// [`Fault::Data`] if it is of another recipe, or of another length.
    pub fn numbers(&self, body: &[u8]) -> Result<Numbers, Fault> {
        let count: usize = self
            .fields
            .iter()
            .map(|field| field.part.type_name().1)
            .sum();
        let Some((&id, data)) = body.split_first() else {
            return Err(Fault::Data("it is empty".to_owned()));
        };
        if id != self.id {
            return Err(Fault::Data(format!("recipe {id}, not {}", self.id)));
        }
        let (chunks, rest) = data.as_chunks::<8>();
        if chunks.len() != count || !rest.is_empty() {
            let reason = format!("{} bytes for {count} numbers of 8", data.len());
            return Err(Fault::Data(reason));
        }
        let mut numbers = [0.0; MAX_NUMBERS];
        let mut chunks = chunks.iter();
        for field in &self.fields {
            for (number, chunk) in numbers[field.part.place()].iter_mut().zip(&mut chunks) {
                *number = f64::from_be_bytes(*chunk);
            }
        }
        Ok(numbers)
    }
}
