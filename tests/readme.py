"""The documentation that is made from the code: `python -m tests.readme` writes docs/results.md anew."""

from __future__ import annotations

from pathlib import Path

README = Path(__file__).parents[1] / "README.md"
RESULTS = README.parent / "docs" / "results.md"
BEGIN, END = "<!-- declarations: begin -->\n", "<!-- declarations: end -->\n"


def with_declarations(text: str) -> str:
    """A text with the table of all declared results between its marks."""
    from results_schema.results_table import reference_table
    from studies.protocol.study import kind_named, kind_names

    for kind in kind_names():
        kind_named(kind)
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n{reference_table()}\n{END}{after}"


if __name__ == "__main__":
    RESULTS.write_text(with_declarations(RESULTS.read_text(encoding="utf-8")), encoding="utf-8")
