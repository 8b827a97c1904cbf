//! Computes type hashes from the messages' texts, to prove the constants (REP-2016 and
//! `rosidl_generator_type_description`: SHA-256 over the type description as JSON).

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use super::{
    Bool, DiagnosticArray, DynamicJointState, Float64, InertiaStamped, JointState, Message,
    Temperature, WrenchStamped,
};

/// `type_id` of `type_description_interfaces/msg/FieldType`.
const BASE_TYPES: [(&str, u32); 9] = [
    ("nested", 1),
    ("int32", 6),
    ("uint32", 7),
    ("uint8", 3),
    ("float32", 10),
    ("float64", 11),
    ("bool", 15),
    ("byte", 16),
    ("string", 17),
];
const UNBOUNDED_SEQUENCE: u32 = 144;

struct Types(BTreeMap<String, Vec<(String, u32, String)>>);

impl Types {
    /// Every type that `M` speaks of, by its full name.
    fn of<M: Message>() -> Self {
        let mut types = BTreeMap::from([(M::TYPE.to_owned(), fields(M::TYPE, M::TEXT))]);
        for (name, text) in M::DEPENDENCIES {
            let name = name.replace('/', "/msg/");
            types.insert(name.clone(), fields(&name, text));
        }
        Self(types)
    }

    fn json(&self, name: &str) -> String {
        let fields = self.0[name].iter().map(|(field, type_id, nested)| {
            format!(
                r#"{{"name": "{field}", "type": {{"type_id": {type_id}, "capacity": 0, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#
            )
        });
        let fields: Vec<_> = fields.collect();
        format!(
            r#"{{"type_name": "{name}", "fields": [{}]}}"#,
            fields.join(", ")
        )
    }

    fn referenced(&self, name: &str, into: &mut BTreeSet<String>) {
        for (_, _, nested) in &self.0[name] {
            if !nested.is_empty() && into.insert(nested.clone()) {
                self.referenced(nested, into);
            }
        }
    }
}

/// Name, type number and type name of each field in a `.msg` text; constants are no fields.
fn fields(of: &str, text: &str) -> Vec<(String, u32, String)> {
    let package = of.split('/').next().unwrap();
    let field = |line: &str| {
        let (type_name, field) = line.split_once(' ').unwrap();
        let (element, sequence) = match type_name.strip_suffix("[]") {
            Some(element) => (element, UNBOUNDED_SEQUENCE),
            None => (type_name, 0),
        };
        let base = BASE_TYPES.iter().find(|(name, _)| *name == element);
        let nested = match (base, element.split_once('/')) {
            (Some(_), _) => String::new(),
            (None, Some((package, name))) => format!("{package}/msg/{name}"),
            (None, None) => format!("{package}/msg/{element}"),
        };
        let type_id = base.map_or(1, |(_, id)| *id) + sequence;
        (field.to_owned(), type_id, nested)
    };
    let lines = text.lines().filter(|line| !line.contains('='));
    lines.map(field).collect()
}

fn hash<M: Message>() -> String {
    let types = Types::of::<M>();
    let mut referenced = BTreeSet::new();
    types.referenced(M::TYPE, &mut referenced);
    assert_eq!(referenced.len(), M::DEPENDENCIES.len(), "{}", M::TYPE);
    let referenced: Vec<_> = referenced.iter().map(|name| types.json(name)).collect();
    let json = format!(
        r#"{{"type_description": {}, "referenced_type_descriptions": [{}]}}"#,
        types.json(M::TYPE),
        referenced.join(", ")
    );
    let mut hash = String::from("RIHS01_");
    for byte in Sha256::digest(json) {
        write!(hash, "{byte:02x}").unwrap();
    }
    hash
}

#[test]
fn the_type_hashes_follow_from_the_texts() {
    // The first is also published: it proves the computation itself.
    assert_eq!(hash::<JointState>(), JointState::TYPE_HASH);
    assert_eq!(hash::<WrenchStamped>(), WrenchStamped::TYPE_HASH);
    assert_eq!(hash::<InertiaStamped>(), InertiaStamped::TYPE_HASH);
    assert_eq!(hash::<DiagnosticArray>(), DiagnosticArray::TYPE_HASH);
    assert_eq!(hash::<DynamicJointState>(), DynamicJointState::TYPE_HASH);
    assert_eq!(hash::<Bool>(), Bool::TYPE_HASH);
    assert_eq!(hash::<Float64>(), Float64::TYPE_HASH);
    assert_eq!(hash::<Temperature>(), Temperature::TYPE_HASH);
}
