use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use super::*;

/// A part.
#[derive(Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Part {
    /// Mass of the part. More text.
    mass_kg: f64,
    #[serde(default)]
    #[schemars(range(min = 1, max = 3))]
    count: Option<u32>,
    #[serde(default)]
    mode: Option<Mode>,
}

#[derive(Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Mode {
    /// The one.
    Fast,
    /// The other.
    Slow,
}

#[derive(Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Whole {
    #[serde(default)]
    parts: Vec<Part>,
    #[serde(default)]
    named: BTreeMap<String, Part>,
    #[serde(default)]
    one: Option<Part>,
}

fn whole(text: &str) -> Result<Located<Whole>, Report> {
    parse(Path::new("whole.yaml"), text.to_owned())
}

fn error(text: &str) -> String {
    whole(text).unwrap_err().to_string()
}

#[test]
fn a_good_file_is_read_and_its_parts_are_found() {
    let text =
        "parts:\n  - mass_kg: 2\n    mode: slow\nnamed: {ä: {mass_kg: 1.5}, b: {mass_kg: 3}}\n";
    let whole = whole(text).unwrap();
    assert_eq!(whole.value.parts[0].mode, Some(Mode::Slow));
    let place = Place::root().key("named").key("b").key("mass_kg");
    assert_eq!(&whole.text()[whole.span(&place)], "3");
    let item = Place::root().key("parts").index(0);
    assert_eq!(&whole.text()[whole.span(&item)], "mass_kg: 2");
}

#[test]
fn every_mismatch_is_said_at_its_place() {
    let text = "parts:\n  - mas_kg: 2\n  - mass_kg: heavy\n    count: 4\n    mode: fats\none:\n  mass_kg: 1\n  colour: red\n";
    assert_eq!(
        error(text),
        "\
error: unknown key `mas_kg`
 --> whole.yaml:2:5
  |
2 |   - mas_kg: 2
  |     ^^^^^^
  |
  = help: did you mean `mass_kg`?

error: the key `mass_kg` is missing in `parts[0]`
 --> whole.yaml:2:5
  |
2 |   - mas_kg: 2
  |     ^^^^^^^^^
  |
  = help: `mass_kg`: Mass of the part.

error: expected a number, found the text `heavy`
 --> whole.yaml:3:14
  |
3 |   - mass_kg: heavy
  |              ^^^^^ `parts[1].mass_kg`

error: expected at most 3, found the number 4
 --> whole.yaml:4:12
  |
4 |     count: 4
  |            ^ `parts[1].count`

error: expected one of `fast`, `slow`, found the text `fats`
 --> whole.yaml:5:11
  |
5 |     mode: fats
  |           ^^^^
  |
  = help: did you mean `fast`?

error: unknown key `colour`
 --> whole.yaml:8:3
  |
8 |   colour: red
  |   ^^^^^^
  |
  = help: known here are: `count`, `mass_kg`, `mode`"
    );
}

#[test]
fn what_is_not_yaml_is_said_at_its_place() {
    assert!(error("").contains("the file is empty"));
    assert!(error("# nothing but a remark\n").contains("the file is empty"));
    let tabs = error("parts:\n\t- mass_kg: 2\n");
    assert!(tabs.contains("whole.yaml:2:"), "{tabs}");
    assert!(tabs.contains("use spaces"), "{tabs}");
    let open = error("parts: [1, 2\n");
    assert!(open.contains("not valid YAML"), "{open}");
    let twice = error("one: {mass_kg: 1}\none: {mass_kg: 2}\n");
    assert!(twice.contains("the key `one` stands here twice"), "{twice}");
    assert!(
        twice.contains("the first time") && twice.contains("the second time"),
        "{twice}"
    );
    assert!(error("one: {mass_kg: .nan}\n").contains("not a finite number"));
    assert!(error("one: {mass_kg: 1}\n---\nparts: []\n").contains("second document"));
    assert!(error("? [a]\n: 1\n").contains("a key must be a word"));
    assert!(error("[1, 2]").contains("expected a mapping"));
}

#[test]
fn a_hostile_file_is_an_error_and_not_a_hang() {
    let deep = "[".repeat(100_000);
    assert!(error(&deep).contains("recursion limit exceeded"));
    assert!(error(&"[".repeat(100)).contains("nested deeper"));
    let mut deep_block = String::new();
    for level in 0..2000 {
        deep_block.push_str(&" ".repeat(level));
        deep_block.push_str("a:\n");
    }
    assert!(error(&deep_block).contains("nested deeper"));
    let mut bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n".to_owned();
    for level in 1..20 {
        let items = vec![format!("*a{}", level - 1); 10].join(", ");
        bomb.push_str(&format!("a{level}: &a{level} [{items}]\n"));
    }
    assert!(error(&bomb).contains("aliases expand to more than"));
    assert!(error("one: &a [*a]\n").contains("alias"));
    let many = "- \n".repeat(500_000);
    assert!(error(&many).contains("expected a mapping"));
}

#[test]
fn files_that_cannot_be_read_are_said_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none.yaml");
    let text = load::<Whole>(&missing).unwrap_err().to_string();
    assert!(
        text.contains("there is no such file") && text.contains("none.yaml"),
        "{text}"
    );
    assert!(load::<Whole>(folder.path()).is_err());
    let latin = folder.path().join("latin.yaml");
    std::fs::write(&latin, b"one: {mass_kg: 1} # caf\xe9\n").unwrap();
    let text = load::<Whole>(&latin).unwrap_err().to_string();
    assert!(
        text.contains("latin.yaml:1:24") && text.contains("not UTF-8"),
        "{text}"
    );
    let large = folder.path().join("large.yaml");
    std::fs::write(&large, vec![b'#'; 5 << 20]).unwrap();
    assert!(
        load::<Whole>(&large)
            .unwrap_err()
            .to_string()
            .contains("larger than 4 MiB")
    );
}
