"""The documentation that is made from the code: `python -m tests.readme` writes docs/results.md anew."""

from pathlib import Path

from results_schema.status import flag_meanings, flag_values
from results_schema.variables import AXES, EVERY_KIND, Variable, registered
from studies.protocol.study import kind_named, kind_names

README = Path(__file__).parents[1] / "README.md"
RESULTS = README.parent / "docs" / "results.md"
BEGIN, END = "<!-- declarations: begin -->\n", "<!-- declarations: end -->\n"


def with_declarations(text: str) -> str:
    """A text with the table of all declared results between its marks."""
    for kind in kind_names():
        kind_named(kind)
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n{reference_table()}\n{END}{after}"


def reference_table() -> str:
    """All results that are written as a markdown table, for docs/results.md; what most kinds share stands once."""
    rows = ["| variable | in | dimensions | type | unit | meaning |", "|---|---|---|---|---|---|"]
    shared = registered()["march"]
    for kind, variables in registered().items():
        where = {EVERY_KIND: "every kind", AXES: "coordinates", "march": "most kinds"}.get(kind, kind)
        own = [variable for variable in variables if kind == "march" or variable not in shared]
        rows += [_row(where, variable) for variable in own]
    return "\n".join(rows) + "\n"


def _row(where: str, variable: Variable) -> str:
    lead = {
        "grid": ["the sweep's"],
        "history": ["the sweep's or `history`"],
        "some": ["some of the sweep's"],
        "none": [],
    }[variable.lead]
    dims = ", ".join(lead + [" or ".join(f"`{name}`" for name in dim.split("|")) for dim in variable.dims])
    own = {"{sensor}": "the sensor's", "{envelope}": "the envelope's"}
    unit = own.get(variable.units or "", variable.units or "1")
    if variable.flags is not None:
        unit = "flags"
    elif variable.dtype == "str":
        unit = ""
    text = variable.long_name + (f": {variable.meaning}" if variable.meaning else "")
    if variable.flags is not None:
        words = zip(flag_values(variable.flags), flag_meanings(variable.flags).split(), strict=True)
        text += "; " + ", ".join(f"{value} {word}" for value, word in words)
    cells = (f"`{variable.name}`", where, dims, variable.dtype, unit, text.replace("|", "\\|"))
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    RESULTS.write_text(with_declarations(RESULTS.read_text(encoding="utf-8")), encoding="utf-8")
