#!/usr/bin/env python3
"""Draws paragraphs of the documentation at random, to be read by somebody who did not write them.

    python3 tests/paragraphs.py [SEED] [--count 10] [--of README.md docs ...]

A paragraph is a block of running text, an entry of a list or a row of a table with at least twelve words.
Read each one once. If you had to read it twice, rewrite it and draw again with another seed.
"""

import argparse
import os
import random
import re
import textwrap

SEED = 16
WORDS = 12
ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
TEXTS = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs", "deploy", "examples", "tests"]


def markdown(named):
    """The Markdown files of these files and folders, sorted."""
    for name in named:
        path = os.path.join(ROOT, name)
        if os.path.isfile(path):
            yield path
        for folder, folders, files in os.walk(path):
            folders.sort()
            yield from (os.path.join(folder, file) for file in sorted(files) if file.endswith(".md"))


def paragraphs(text):
    """(line number, paragraph) of each paragraph of `text`."""
    block, start, fenced = [], 0, False

    def done():
        joined = " ".join(line.strip() for line in block)
        return [(start, joined)] if len(joined.split()) >= WORDS else []

    for number, line in enumerate(text.split("\n"), 1):
        if line.startswith("```"):
            fenced = not fenced
        code = fenced or line.startswith("```") or line.startswith("    ")
        begins = re.match(r"\s*([-*]|\d+\.) |\|", line)
        if code or begins or not line.strip() or line.startswith("#"):
            yield from done()
            block = []
        if code or not line.strip() or line.startswith("#") or re.fullmatch(r"[|:\- ]+", line):
            continue
        if not block:
            start = number
        block.append(line)
    yield from done()


def main():
    arguments = argparse.ArgumentParser(description="Draws paragraphs of the documentation at random.")
    arguments.add_argument("seed", nargs="?", type=int, default=SEED)
    arguments.add_argument("--count", type=int, default=10)
    arguments.add_argument("--of", nargs="+", default=TEXTS, metavar="FILE")
    asked = arguments.parse_args()
    held = []
    for path in markdown(asked.of):
        with open(path, encoding="utf-8") as file:
            held += [(os.path.relpath(path, ROOT), line, text) for line, text in paragraphs(file.read())]
    drawn = random.Random(asked.seed).sample(held, min(asked.count, len(held)))
    print(f"seed {asked.seed}: {len(drawn)} of {len(held)} paragraphs\n")
    for file, line, text in sorted(drawn):
        print(f"{file}:{line}")
        print(textwrap.fill(text, 100, initial_indent="    ", subsequent_indent="    ") + "\n")


if __name__ == "__main__":
    main()
