"""Checks the pages of the book: docs/SUMMARY.md lists each one once, and each begins with a heading and a sentence.

    python3 docs/check_book.py
"""

import collections
import pathlib
import re
import sys

DOCS = pathlib.Path(__file__).resolve().parent
# First characters of a block that is no paragraph: code, list, table, heading, quotation, picture, HTML.
NO_TEXT = re.compile(r"```|    |[-+*] |\d+\. |[|#>!<]")


def problems():
    """A line for each page that is not listed once, or that does not begin as it should."""
    pages = {path.relative_to(DOCS).as_posix(): path for path in DOCS.rglob("*.md") if path.name != "SUMMARY.md"}
    listed = collections.Counter(re.findall(r"\]\(([^)]+)\)", (DOCS / "SUMMARY.md").read_text(encoding="utf-8")))
    for page in sorted(pages.keys() | listed.keys()):
        if page not in pages:
            yield f"docs/SUMMARY.md lists {page}, which is not there"
        elif listed[page] != 1:
            yield f"docs/SUMMARY.md lists {page} {listed[page]} times"
    for page, path in sorted(pages.items()):
        heading, text, *_ = [*path.read_text(encoding="utf-8").split("\n\n", 2), "", ""]
        if not re.fullmatch(r"# .+", heading):
            yield f"docs/{page} does not begin with a heading"
        elif NO_TEXT.match(text) or not re.search(r"\.(\s|$)", text):
            yield f"docs/{page} has no sentence below its heading"


if __name__ == "__main__":
    found = list(problems())
    print("\n".join(found), file=sys.stderr, end="\n" if found else "")
    sys.exit(1 if found else 0)
