"""Makes docs/gallery.md, its pictures and the times of `wanderlast list`: python -m tests.gallery [NAME ...]."""

import json
import sys
import tempfile
import time
from pathlib import Path

import engine
from results_schema.store.archive import open_archive
from studies.commands import catalogue
from studies.protocol.library import find_study
from studies.protocol.options import RunOptions
from studies.reporting import summary
from studies.reporting.answers import answer_of, figures_of
from studies.results.results import Results
from studies.runs.archived import results_of
from studies.runs.runner import Outcome, run_to_archive
from tests.readme import README

DOCS = README.parent / "docs"
DOTS = 110  # per inch, of the pictures


def shown() -> list[str]:
    """The built-in studies that stand in the gallery: all but the large ones."""
    return [name for name in catalogue.built_in() if not name.endswith("-large")]


def main(names: list[str]) -> None:
    """Run studies, draw their first figures, and write the page with those that were made before."""
    measured = dict(catalogue.measured())
    with tempfile.TemporaryDirectory() as folder:
        for name in names or shown():
            measured[name] = _made(name, Path(folder))
            print(name, measured[name]["seconds"], flush=True)
    catalogue.MEASURED.write_text(json.dumps(measured, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")


def _made(name: str, folder: Path) -> dict[str, object]:
    """Run one study: its seconds, exit code, question, answer and the caption of its picture, which is drawn."""
    study = engine.load(find_study(name))
    started = time.perf_counter()
    outcome: Outcome = run_to_archive(study, folder / f"{name}.nc", RunOptions())
    seconds = time.perf_counter() - started
    results: Results = results_of(open_archive(folder / f"{name}.nc"))
    first = figures_of(results)[0]
    (DOCS / "gallery").mkdir(exist_ok=True)
    first.drawing.savefig(DOCS / "gallery" / f"{name}.png", dpi=DOTS, metadata={"Software": None})
    return {
        "seconds": round(seconds, 1),
        "code": summary.exit_code(outcome),
        "variants": int(results.size),
        "answer": answer_of(results),
        "picture": first.title,
    }


def page() -> str:
    """The page, from what was measured."""
    measured = catalogue.measured()
    parts = [
        "# Gallery\n",
        "Every built-in study: its question, its answer, its first figure and the seconds that it took on two cores "
        "(`python -m tests.gallery` makes this page). Names with `-large` ask the same of more variants or scenes.\n",
    ]
    for entry in catalogue.entries():
        if entry.name in measured:
            made = measured[entry.name]
            parts += [
                f"## {entry.title}\n",
                f"`wanderlast run {entry.name}`: kind `{entry.kind}`, {made['variants']:,} variants or points, "
                f"{made['seconds']} s, exit code {made['code']}.\n",
                *(f"- {text}" for text in made["answer"]),
                f"\n![{made['picture']}](gallery/{entry.name}.png)\n",
            ]
    return "\n".join(parts)


if __name__ == "__main__":
    main(sys.argv[1:])
