#!/usr/bin/env bash
# Checks the pages of the book and builds it into target/book:
#
#     docs/book.sh
#
# Needs Python 3 and mdbook. Neither the build nor the book needs a network.
set -euo pipefail

cd "$(dirname "$0")/.."
python3 docs/check_book.py
if ! command -v mdbook >/dev/null; then
    echo "mdbook is not installed. To install it: cargo install mdbook --locked" >&2
    exit 1
fi
mdbook build
echo "target/book/index.html"
