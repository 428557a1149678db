"""Write the list of all pages into docs/README.md.

Run ``python docs/docs_index.py`` from the root of the checkout; `make docs` does this last. A test
checks that every page is in the list.
"""

from pathlib import Path

from page_parts import with_part

DOCS = Path(__file__).parent
INDEX = DOCS / "README.md"


def index() -> str:
    """Text of docs/README.md with the titles of all pages, sorted by folder."""
    pages = sorted(DOCS.rglob("*.md"), key=lambda page: (len(page.parents), page.as_posix()))
    entries = [
        f"- [{_title(page)}]({page.relative_to(DOCS).as_posix()})"
        for page in pages
        if page != INDEX
    ]
    return with_part(INDEX.read_text(encoding="utf-8"), "pages", "\n".join(entries))


def _title(page: Path) -> str:
    """First heading of a page."""
    lines = page.read_text(encoding="utf-8").splitlines()
    return next(line for line in lines if line.startswith("# ")).removeprefix("# ").strip()


if __name__ == "__main__":
    INDEX.write_text(index(), encoding="utf-8")
