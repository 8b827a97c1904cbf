#!/usr/bin/env python3
"""Counts imports against the order of rooms, circles of imports, long files and long functions.

The reasons are in docs/decisions/0010-folders-follow-the-method.md.

    python3 tests/structure.py                  the work tree
    python3 tests/structure.py --at COMMIT      a commit
    python3 tests/structure.py --check          exit code 1 where a limit of LIMITS is passed
    python3 tests/structure.py --list           also every arrow, circle, file and function that counts

A *module* is a Rust file; `foo/mod.rs` does not occur here. `foo.rs` is the parent of the files in `foo/`.
An *arrow* A -> B: a path in A (`use`, or written out) begins with the module path of B. Code under
`#[cfg(test)] mod` and files named tests.rs are left out. A *room* is one entry of a crate's `src/`: a file
together with the folder of its name, or a folder.

An arrow between rooms *runs up* if it is one of the fewest arrows without which no circle of rooms is left
(a greedy estimate of the minimum feedback arc set; rooms weigh by the number of files that import).
A *circle* is a strongly connected set of files, where a child may name its parent's items: arrows from a
module to one that contains it are not followed.
"""

import argparse
import os
import re
import subprocess
import sys
import tarfile
import tempfile
from collections import defaultdict

LINES_OF_A_FILE = 400
LINES_OF_A_FUNCTION = 80
# No more than this; the aim is none.
LIMITS = {"arrows_up": 2, "circles": 5, "long_files": 0, "long_functions": 0, "quoted_effects": 1}


def strip(text):
    """The code without comments and literals: their characters become spaces, lines stay."""
    pattern = re.compile(
        r'//[^\n]*|/\*.*?\*/|b?r(#*)".*?"\1|b?"(?:\\.|[^"\\])*"|b?\'(?:\\.[^\']*|[^\'\\])\'', re.S
    )
    return pattern.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)


def test_modules(code):
    """Where the inline test modules of `code` (stripped) begin and end."""
    begin = r"#\[cfg\(test\)\]\s*(?:#\[[^\n]*\]\s*)*(?:pub )?mod \w+ \{"
    return [(found.start(), closing(code, found.end() - 1)) for found in re.finditer(begin, code)]


def without_tests(code):
    """`code` (stripped) without its inline test modules."""
    for begin, end in test_modules(code):
        code = code[:begin] + re.sub(r"[^\n]", " ", code[begin:end]) + code[end:]
    return code


def closing(code, brace):
    """The place behind the brace that closes the one at `brace`."""
    depth = 0
    for place in range(brace, len(code)):
        if code[place] == "{":
            depth += 1
        elif code[place] == "}":
            depth -= 1
            if depth == 0:
                return place + 1
    return len(code)


def functions(code):
    """Name and number of lines of each function, from `fn` to its closing brace."""
    for found in re.finditer(r"\bfn (\w+)", code):
        brace = re.compile(r"[{;]").search(code, found.end())
        # A `;` within an array type of the signature is none that ends it.
        while brace and brace.group() == ";" and code.count("[", found.end(), brace.start()) != code.count(
            "]", found.end(), brace.start()
        ):
            brace = re.compile(r"[{;]").search(code, brace.end())
        if brace and brace.group() == "{":
            yield found.group(1), code.count("\n", found.start(), closing(code, brace.start())) + 1


def crates(root):
    """Name and source folder of each crate of the workspace."""
    for folder, folders, files in os.walk(root):
        folders[:] = sorted(d for d in folders if d not in ("target", ".git", "out", "examples", "node_modules", "vendor"))
        if "Cargo.toml" in files and os.path.isdir(os.path.join(folder, "src")):
            with open(os.path.join(folder, "Cargo.toml"), encoding="utf-8") as file:
                name = re.search(r'^name = "([^"]+)"', file.read(), re.M)
            if name:
                yield name.group(1), os.path.join(folder, "src")


def modules(source):
    """Module path -> (file, text, stripped code) of a crate's files that are no tests."""
    held = {}
    for folder, folders, files in os.walk(source):
        folders[:] = sorted(d for d in folders if d not in ("tests", "bin"))
        for name in sorted(files):
            if not name.endswith(".rs") or name == "tests.rs":
                continue
            file = os.path.join(folder, name)
            path = tuple(os.path.relpath(file, source)[:-3].split(os.sep))
            if path in (("lib",), ("main",)):
                path = ()
            with open(file, encoding="utf-8") as handle:
                text = handle.read()
            held[path] = (file, text, without_tests(strip(text)))
    declared_tests = set()
    for path, (_, _, code) in held.items():
        for found in re.finditer(r"#\[cfg\(test\)\]\s*(?:#\[[^\n]*\]\s*)*(?:pub(?:\([^)]*\))? )?mod (\w+);", code):
            declared_tests.add(path + (found.group(1),))
    return {path: m for path, m in held.items() if not any(path[: len(t)] == t for t in declared_tests)}


def leaves(tree):
    """The paths of a `use` tree such as `a::{b, c::{d, e as f}}`."""
    tree = tree.strip()
    brace = tree.find("{")
    if brace < 0:
        yield tuple(part for part in re.sub(r"\s+as\s+\w+", "", tree).replace(" ", "").split("::") if part)
        return
    head = tuple(part for part in tree[:brace].replace(" ", "").split("::") if part)
    depth, start = 0, brace + 1
    for place in range(brace, len(tree)):
        depth += (tree[place] == "{") - (tree[place] == "}")
        if (tree[place] == "," and depth == 1) or depth == 0:
            if tree[start:place].strip():
                for leaf in leaves(tree[start:place]):
                    yield head + leaf
            start = place + 1
        if depth == 0:
            return


def absolute(path, module, held):
    """A path of the crate as parts below its root, or none if it leads elsewhere."""
    if not path:
        return None
    if path[0] == "crate":
        return path[1:]
    if path[0] == "self":
        return module + path[1:]
    if path[0] == "super":
        up = 0
        while up < len(path) and path[up] == "super":
            up += 1
        return module[: len(module) - up] + path[up:] if up <= len(module) else None
    if module + path[:1] in held or any(known[: len(module) + 1] == module + path[:1] for known in held):
        return module + path
    return None


def arrows(held):
    """(from, to) between module paths."""
    # What a module re-exports by `pub use` is found where it is defined, not where it is handed on.
    handed_on = {}
    taken = {}
    for module, (_, _, code) in held.items():
        paths = []
        rest = code
        for found in reversed(list(re.finditer(r"(pub(?:\([^)]*\))? )?\buse ([^;]+);", code))):
            for leaf in leaves(found.group(2)):
                target = absolute(leaf, module, held)
                if target is None:
                    continue
                if found.group(1):
                    handed_on[module + leaf[-1:]] = target
                # The root only hands on: its `pub use` is no import.
                if not (found.group(1) and module == ()):
                    paths.append(target)
            rest = rest[: found.start()] + " " * (found.end() - found.start()) + rest[found.end() :]
        for found in re.finditer(r"(?<![\w:])((?:crate|super|self|[a-z_][a-z0-9_]*)(?:::\w+)+)", rest):
            target = absolute(tuple(found.group(1).split("::")), module, held)
            if target is not None:
                paths.append(target)
        taken[module] = paths
    found = set()
    for module, paths in taken.items():
        for path in paths:
            for _ in range(4):
                for length in range(len(path), 0, -1):
                    if path[:length] in handed_on and handed_on[path[:length]] != path[:length]:
                        path = handed_on[path[:length]] + path[length:]
                        break
                else:
                    break
            target = next((path[:n] for n in range(len(path), -1, -1) if path[:n] in held), None)
            if target is not None and target != module and not (target == () and path):
                found.add((module, target))
            elif target == () and path and module != () and path not in held:
                found.add((module, ()))
    return found


def components(nodes, edges):
    """Strongly connected sets of more than one node (Tarjan 1972)."""
    onward = defaultdict(list)
    for a, b in edges:
        onward[a].append(b)
    index, low, stack, held, out = {}, {}, [], set(), []

    def visit(root):
        work = [(root, iter(onward[root]))]
        index[root] = low[root] = len(index)
        stack.append(root)
        held.add(root)
        while work:
            node, rest = work[-1]
            for nxt in rest:
                if nxt not in index:
                    index[nxt] = low[nxt] = len(index)
                    stack.append(nxt)
                    held.add(nxt)
                    work.append((nxt, iter(onward[nxt])))
                    break
                if nxt in held:
                    low[node] = min(low[node], index[nxt])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    circle = []
                    while True:
                        last = stack.pop()
                        held.discard(last)
                        circle.append(last)
                        if last == node:
                            break
                    if len(circle) > 1:
                        out.append(sorted(circle))

    for node in sorted(nodes):
        if node not in index:
            visit(node)
    return out


def running_up(nodes, edges):
    """Arrows that stand against the order of Eades, Lin and Smyth (1993), improved by moving single nodes."""
    inside = set()
    for circle in components(nodes, edges):
        inside.update((a, b) for a, b in edges if a in circle and b in circle)
    left, head, tail = {n for e in inside for n in e}, [], []
    while left:
        live = [(a, b) for a, b in inside if a in left and b in left]
        outward, inward = defaultdict(int), defaultdict(int)
        for a, b in live:
            outward[a] += 1
            inward[b] += 1
        sinks = sorted(n for n in left if not outward[n])
        sources = sorted(n for n in left if outward[n] and not inward[n])
        if sinks:
            tail[:0] = sinks
            left -= set(sinks)
        elif sources:
            head += sources
            left -= set(sources)
        else:
            best = max(sorted(left), key=lambda n: outward[n] - inward[n])
            head.append(best)
            left.discard(best)
    order = head + tail

    def against(order):
        place = {n: i for i, n in enumerate(order)}
        return [(a, b) for a, b in inside if place[a] > place[b]]

    fewest = len(against(order))
    improved = True
    while improved:
        improved = False
        for node in list(order):
            rest = [n for n in order if n != node]
            for place in range(len(order)):
                tried = rest[:place] + [node] + rest[place:]
                count = len(against(tried))
                if count < fewest:
                    order, fewest, improved = tried, count, True
                    break
    return sorted(against(order))


def measure(root):
    """All that is counted, by crate and over all."""
    table, lists = [], defaultdict(list)
    effects = set()
    held_by_crate = {name: (source, modules(source)) for name, source in crates(root)}
    for name, (source, held) in held_by_crate.items():
        if name == "tauscope-dynamics":
            text = "".join(text for _, text, _ in held.values())
            effects = {
                path[-1]
                for path in held
                if "terms" in path[:-1] and f'"{path[-1]}"' in text
            }
    for name, (source, held) in held_by_crate.items():
        found = arrows(held)
        down = {(a, b) for a, b in found if a[: len(b)] != b}
        rooms = {path[0] for path in held if path}
        between = {(a[0], b[0]) for a, b in found if a and b and a[0] != b[0]}
        circles = components(set(held), down)
        up = running_up(rooms, between)
        long_files, long_functions = [], []
        for file, text, code in held.values():
            where = os.path.relpath(file, root)
            lines = text.count("\n")
            if lines > LINES_OF_A_FILE:
                long_files.append(f"{where}: {lines} lines")
            long_functions += [f"{where}: {f}, {n} lines" for f, n in functions(code) if n > LINES_OF_A_FUNCTION]
            if name != "tauscope-dynamics":
                for effect in sorted(effects):
                    lists["quoted_effects"] += [f'{where}: "{effect}"'] * quoted(text, code, effect)
        table.append((name, len(held), len(rooms), len(between), len(up), len(circles), len(long_files), len(long_functions)))
        lists["arrows_up"] += [f"{name}: {a} -> {b}" for a, b in up]
        lists["circles"] += [f"{name}: " + ", ".join("::".join(path) or "(root)" for path in c) for c in circles]
        lists["long_files"] += long_files
        lists["long_functions"] += long_functions
    return table, lists


def quoted(text, code, effect):
    """How often `effect` is quoted outside comments and tests."""
    count = 0
    tests = test_modules(strip(text)) if f'"{effect}"' in text else []
    for found in re.finditer(f'"{effect}"', text):
        if any(begin <= found.start() < end for begin, end in tests):
            continue
        line = text.rfind("\n", 0, found.start()) + 1
        end = text.find("\n", found.end())
        # What is stripped of literals and comments keeps something on a line of code; a list of names stands alone.
        alone = re.fullmatch(r'\s*("[a-z_0-9]+",?\s*)+', text[line:end])
        comment = "//" in text[line : found.start()]
        count += not comment and bool(alone or code[line:end].strip())
    return count


def main():
    arguments = argparse.ArgumentParser(description="Counts imports against the order of rooms, circles, long files and functions.")
    arguments.add_argument("--at", metavar="COMMIT")
    arguments.add_argument("--check", action="store_true")
    arguments.add_argument("--list", action="store_true")
    asked = arguments.parse_args()
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    with tempfile.TemporaryDirectory() as folder:
        if asked.at:
            packed = os.path.join(folder, "tree.tar")
            subprocess.run(["git", "-C", root, "archive", "-o", packed, asked.at], check=True)
            with tarfile.open(packed) as tar:
                tar.extractall(folder, filter="data")
            root = folder
        table, lists = measure(root)
    head = ("crate", "files", "rooms", "arrows between rooms", "that run up", "circles", "long files", "long functions")
    print("| " + " | ".join(head) + " |")
    print("| --- " + "| ---: " * (len(head) - 1) + "|")
    for row in sorted(table):
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print("| all | " + " | ".join(str(sum(row[i] for row in table)) for i in range(1, len(head))) + " |")
    places = lists["quoted_effects"]
    files = {place.split(":")[0] for place in places}
    print(f"\nEffects quoted by name outside dynamics/ and outside tests: {len(places)} places in {len(files)} files.")
    if asked.list:
        for what in ("arrows_up", "circles", "long_files", "long_functions"):
            print(f"\n{what}:")
            print("\n".join("  " + line for line in lists[what]) or "  none")
        print("\nquoted_effects, by file:")
        for file in sorted(files):
            print(f"  {file}: {sum(place.startswith(file + ':') for place in places)}")
    passed = {what: len(lists[what]) for what, limit in LIMITS.items() if len(lists[what]) > limit}
    if asked.check and passed:
        for what, count in passed.items():
            print(f"{what}: {count}, at most {LIMITS[what]} (see --list)", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
