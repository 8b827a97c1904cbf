"""Constants marked `Tuned:` in Rust sources, and a copy of the tree in which the environment scales each of them.

A constant is found by its doc comment, whose last sentence begins with `Tuned:`. In the copy each use of one, `NAME`, becomes
`crate::vary::of(ID, NAME)`, which multiplies by what TAUSCOPE_VARY says ("3=1.3,17=0.7"): one build serves all variations. What does not
compile so (a length of an array, a pattern) is put back and told.
"""
import collections
import dataclasses
import json
import os
import pathlib
import re
import shutil
import subprocess

CRATES = ["explain", "stages/detect", "dynamics"]
CONST = re.compile(r"^\s*(?:pub(?:\([^)]*\))?\s+)?const\s+([A-Z][A-Z0-9_]*)\s*:\s*([^=]+?)\s*=\s*(.*)$")
TEXT = re.compile(r'"(?:\\.|[^"\\])*"')
MODULE = """//! Scales constants; made by tests/proof/vary.py in a copy of the tree.
#![allow(missing_docs, clippy::all, clippy::pedantic)]
use std::sync::OnceLock;

static FACTORS: OnceLock<Vec<f64>> = OnceLock::new();

fn factor(id: usize) -> f64 {
    let all = FACTORS.get_or_init(|| {
        let mut all = Vec::new();
        for part in std::env::var("TAUSCOPE_VARY").unwrap_or_default().split(',') {
            if let Some((id, factor)) = part.split_once('=') {
                let id: usize = id.parse().unwrap();
                if all.len() <= id { all.resize(id + 1, 1.0); }
                all[id] = factor.parse().unwrap();
            }
        }
        all
    });
    all.get(id).copied().unwrap_or(1.0)
}

pub trait Varied { fn by(self, factor: f64) -> Self; }
impl Varied for f64 { fn by(self, factor: f64) -> Self { self * factor } }
impl Varied for f32 { fn by(self, factor: f64) -> Self { (f64::from(self) * factor) as f32 } }
macro_rules! whole { ($($t:ty),*) => { $(impl Varied for $t {
    fn by(self, factor: f64) -> Self {
        let (near, way) = ((self as f64 * factor).round(), (factor - 1.0).signum());
        // At least by one, where it is varied.
        (if factor != 1.0 && near == self as f64 { near + way } else { near }) as $t
    }
})* } }
whole!(usize, u32, u64, i32, i64);
impl<T: Varied, const N: usize> Varied for [T; N] { fn by(self, factor: f64) -> Self { self.map(|x| x.by(factor)) } }

pub fn of<T: Varied>(id: usize, value: T) -> T { let factor = factor(id); if factor == 1.0 { value } else { value.by(factor) } }
"""


@dataclasses.dataclass
class Constant:
    crate: str
    file: str      # within the tree
    name: str
    kind: str      # its Rust type
    value: str
    tuned: str     # what its mark says
    uses: int = 0  # that were replaced

    def __str__(self):
        return f"{self.file.removeprefix(self.crate + '/src/')}:{self.name}"


def find(tree, pattern="", crates=CRATES):
    """All marked constants whose crate, file or name match."""
    found = []
    for crate in crates:
        for path in sorted((tree / crate / "src").rglob("*.rs")):
            file, doc = str(path.relative_to(tree)), []
            for line in path.read_text().splitlines():
                text = line.strip()
                if text.startswith("///"):
                    doc.append(text[3:].strip())
                    continue
                const = CONST.match(line)
                said = " ".join(doc)
                if const and "Tuned:" in said:
                    one = Constant(crate, file, const[1], const[2], const[3].rstrip(";"), said.partition("Tuned:")[2].strip())
                    if re.search(pattern, f"{file}:{one.name}"):
                        found.append(one)
                if not text.startswith("#["):
                    doc = []
    return found


def code_lines(text):
    """Yields (index, line) of those in which a use may stand: no comments, imports or declarations of constants."""
    imported = False
    for i, line in enumerate(text.splitlines()):
        bare = line.strip()
        imported = imported or bool(re.match(r"(pub(\([^)]*\))?\s+)?use\s", bare))
        if not imported and not bare.startswith("//") and not re.match(r"(pub(\([^)]*\))?\s+)?(const|static)\s+[A-Z_]", bare):
            yield i, line
        imported = imported and not bare.endswith(";")


def replaced(line, name, ident):
    """A line with its uses of a constant scaled, texts left alone, and how many there were."""
    use = re.compile(rf"(?<![\w.'])((?:\w+::)*){name}(?!\w|\s*::)")
    count, out, end = 0, "", 0
    for text in [*TEXT.finditer(line), None]:
        part = line[end:text.start() if text else len(line)]
        part, n = use.subn(rf"crate::vary::of({ident}, \g<0>)", part)
        count, out = count + n, out + part + (text[0] if text else "")
        end = text.end() if text else end
    return out, count


def imports(text, name):
    return any(re.search(rf"\b{name}\b", use) for use in re.findall(r"\buse\s[^;]*;", text))


def instrument(tree, constants):
    """Scales every use in the tree; by (file, line) the line as it was and the constants in it."""
    undo = {}
    declared = collections.Counter((c.crate, c.name) for c in find(tree, crates=sorted({c.crate for c in constants})))
    for crate in sorted({c.crate for c in constants}):
        source = tree / crate / "src"
        (source / "vary.rs").write_text(MODULE)
        root = source / "lib.rs"
        root.write_text(re.sub(r"^((?:pub |pub\(crate\) )?mod )", r"#[doc(hidden)]\npub mod vary;\n\1", root.read_text(), count=1, flags=re.M))
        for path in sorted(source.rglob("*.rs")):
            file, text = str(path.relative_to(tree)), path.read_text()
            lines = text.splitlines()
            here = set(m[1] for m in map(CONST.match, lines) if m)
            for ident, c in enumerate(constants):
                elsewhere = c.name not in here and declared[crate, c.name] == 1 and (imports(text, c.name) or f"::{c.name}" in text)
                if c.crate != crate or c.name not in text or not (c.file == file or elsewhere):
                    continue
                for i, _ in code_lines("\n".join(lines)):
                    new, count = replaced(lines[i], c.name, ident)
                    if count:
                        was = undo.setdefault((file, i + 1), [lines[i], []])
                        was[1].append(c)
                        lines[i], c.uses = new, c.uses + count
            path.write_text("\n".join(lines) + "\n")
    return undo


def build(tree, copy, target, constants, say):
    """The program with every constant scaled by TAUSCOPE_VARY. What does not compile so is put back, until all does."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(tree, copy, ignore=shutil.ignore_patterns("target", "out", ".git"))
    undo = instrument(copy, constants)
    command = ["cargo", "build", "--release", "--message-format=json", "--quiet", "-p", "tauscope"]
    for _ in range(12):
        run = subprocess.run(command, cwd=copy, env={**os.environ, "CARGO_TARGET_DIR": str(target)}, capture_output=True, text=True)
        if run.returncode == 0:
            return pathlib.Path(target) / "release" / "tauscope"
        put_back(copy, undo, run, say)
    raise SystemExit("the copy does not compile")


def put_back(copy, undo, run, say):
    """Undoes the lines that a compiler complains of."""
    places, said = set(), [run.stderr[-3000:]]
    for message in map(json.loads, filter(lambda x: x.startswith("{"), run.stdout.splitlines())):
        if message.get("reason") == "compiler-message" and message["message"]["level"] == "error":
            said.append(message["message"]["rendered"])
            places |= {(s["file_name"], line) for s in message["message"]["spans"] for line in range(s["line_start"], s["line_end"] + 1)}
    back = [place for place in places if place in undo]
    if not back:
        raise SystemExit("the copy does not compile:\n" + "\n".join(said))
    for file, line in back:
        lines = (copy / file).read_text().splitlines()
        was, constants = undo.pop((file, line))
        lines[line - 1] = was
        (copy / file).write_text("\n".join(lines) + "\n")
        for c in constants:
            c.uses -= 1
            say(f"put back: {c} in {file}:{line}")
