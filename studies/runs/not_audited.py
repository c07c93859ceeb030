"""Why no variant of a run was audited: what the run knows, as an attribute of its archive, and the words for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from engine.batch.plan import Plan
    from engine.march.outcome import Flat
    from studies.protocol.parts import Pieces
    from studies.results.results import Results

WHY = "not_audited"  # the attribute; archives without it leave the reason open
TOO_LONG, NOTHING_FINER, CHOSE, PYTHON = "too long", "nothing finer", "chose models", "run from Python"
_LONG = "it would have taken too long"
_FINER = "nothing finer than what variants were computed with is left to compare them with"
_PYTHON = "studies.run audits none; the command run does"
_CHOSE = "models were chosen by all of them, each beside a finer one"
REASONS = f"{_LONG} (audit = 20, say, audits 20 variants all the same), or {_FINER}"
NONE_AUDITED = f"no variant was audited: {REASONS}"
NONE_COMPARED = f"no variant was audited: those drawn for it have no values, {REASONS}"
NONE_OF_THOSE_ASKED = (
    "no variant was audited, though audit = {}: those drawn for it have no values, or nothing finer than what they "
    "were computed with is left, or the study was run from Python, which audits none"
)


def why_none(plan: Plan, used: Flat | None) -> dict[str, str]:
    """The attribute of an archive of a plan of which no variant was audited; none where the study asks for none. used:
    what all variants took, where that is known."""
    from engine.batch.audit import audit_size, sampled

    if plan.study.solver.audit == 0:
        return {}
    if plan.study.solver.audit == "auto" and not audit_size(plan, used):
        return {WHY: TOO_LONG}
    return {WHY: NOTHING_FINER if sampled(plan, used).size else CHOSE}


def why_none_of_pieces(parts: Pieces, count: int) -> dict[str, str]:
    """The same of a study whose kind computes it in pieces; count: of variants that were to be audited."""
    if parts.study.solver.audit == 0 or not parts.kind.audit_seconds:
        return {}
    return {WHY: NOTHING_FINER if count else TOO_LONG}


def told_none(results: Results) -> str:
    """Why no variant was audited, in a sentence."""
    asked, whole = results.study.solver.audit, bool(results.kept.all())
    known = _known(results) if whole else ""
    if known:
        return f"no variant was audited{'' if asked == 'auto' else f', though audit = {asked}'}: {known}"
    reason = NONE_AUDITED if whole else NONE_COMPARED
    return reason if asked == "auto" else NONE_OF_THOSE_ASKED.format(asked)


def told_none_briefly(results: Results) -> str:
    """The same in a few words."""
    asked, known = results.study.solver.audit, _known(results) if bool(results.kept.all()) else ""
    reasons = {
        0: "as the study asks for none",
        "auto": f"as {known or f'{_LONG}, or nothing finer is left ({_all_the_same(results)})'}",
    }
    though = f"though audit = {asked}: {known or 'nothing finer is left, or those drawn have no values'}"
    return f"no variant was audited, {reasons.get(asked, though)}."


def _known(results: Results) -> str:
    """The reason in words where the archive has it and all variants have values, else ""."""
    told = {TOO_LONG: f"{_LONG} ({_all_the_same(results)})", NOTHING_FINER: _FINER, CHOSE: _CHOSE, PYTHON: _PYTHON}
    return told.get(str(results.dataset.attrs.get(WHY, "")), "")


def _all_the_same(results: Results) -> str:
    few = min(20, results.variants)
    return f"audit = {few} audits {few if few > 1 else 'it'} all the same"
