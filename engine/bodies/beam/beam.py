"""A uniform Euler-Bernoulli beam as the user describes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, Tag

from engine.bodies.modal.description import AUTO_MODES, MAX_MODES, Body, Growing, Rayleigh, Spot, Spots
from engine.bodies.modal.modal_body import SAME_PLACE, Array, ModalBody
from engine.bodies.modal.outline import ALONG, HELD_AT, Elastic, Held, Outline, straight
from engine.bodies.modal.section_doubts import Doubt, section_doubts
from engine.study_file.checks import Check, on_body
from engine.study_file.spec import LIST, WORD, Several, Spec, by_form, one_of
from engine.study_file.units import (
    Area,
    Damping,
    Density,
    Length,
    Pressure,
    RotationalStiffness,
    SecondMoment,
    Stiffness,
    fault,
)
from results_schema.errors import BadInput

__all__ = ["MAX_MODES", "Beam", "Body", "Rayleigh", "Spring"]

END_WORDS = ("pinned", "clamped", "free")


class Spring(Spec):
    """Springs and a damper to ground at a place of the beam (m): N/m, N m/rad, N s/m, not all zero."""

    looked_for: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("kind", "type", "support"), 'this list holds springs; stiff ends are words: supports = "pinned-pinned"'
    )

    at: Length = Field(ge=0)
    stiffness: Stiffness = Field(default=0.0, ge=0)
    rotational: RotationalStiffness = Field(default=0.0, ge=0)
    damping: Damping = Field(default=0.0, ge=0)


_ENDS = tuple("-".join(ends) for ends in product(END_WORDS, repeat=2))
_OTHERS = {"fixed": "clamped", "built-in": "clamped", "hinged": "pinned", "simple": "pinned", "simply": "pinned"}
_WORDS = _OTHERS | {word: word for word in END_WORDS}  # words for ends that others use, and ours
_MEANT = {
    **{word: f"{end}-{end}" for word, end in _WORDS.items()},
    **{"-".join(words): "-".join(_WORDS[word] for word in words) for words in product(_WORDS, repeat=2)},
    "simply-supported": "pinned-pinned",
    "cantilever": "clamped-free",
}
SOFT_END = (
    'of a soft and a stiff end two springs: supports = [{ at = 0, stiffness = "1e12 N/m" }, { at = 24, stiffness = '
    '"5e7 N/m" }], with numbers of your own'
)


def _without_words(value: Any) -> Any:
    """The springs of a list, in which words for ends have no place."""
    words = [one for one in value if isinstance(one, str)] if isinstance(value, list | tuple) else []
    if words:
        raise fault("this list holds springs", expected="tables", received=f'"{words[0]}"', remedy=SOFT_END)
    return value


def _without_springs(word: str) -> str:
    """A word for both ends, which tells of no spring."""
    if any(end.startswith(("elastic", "spring", "sprung", "soft")) for end in word.lower().split("-")):
        raise fault(
            "springs at ends are a list",
            expected=" or ".join(END_WORDS) + " for each end",
            received=f'"{word}"',
            remedy=SOFT_END,
        )
    return word


Ends = Annotated[str, AfterValidator(_without_springs), AfterValidator(one_of(*_ENDS, meant=_MEANT))]
Springs = Annotated[Several[Spring], Field(min_length=1, max_length=100), BeforeValidator(_without_words)]
Supports = Annotated[Annotated[Ends, Tag(WORD)] | Annotated[Springs, Tag(LIST)], by_form]


class Beam(Body):
    """A uniform beam. SI units; `supports` names both ends or lists springs, between which all is free.

    fibre_distance: of the extreme fibre, for stress.

    >>> bed = Beam(kind="beam", length="15 m", area=0.01, second_moment=8.33e-6, youngs_modulus="210 GPa",
    ...            density=7850, supports="pinned-pinned", damping_ratio=0.02)
    >>> bed.bending_stiffness, bed.mass, bed.ends
    (1749300.0, 1177.5, ('pinned', 'pinned'))
    """

    looked_for: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("EI", "bending_stiffness", "mass_per_metre", "mass_per_length", "linear_density", "mu"),
        "for E I and kg/m alone write second_moment = 1, youngs_modulus = E I, area = 1, density = the mass per metre",
    ) | dict.fromkeys(
        ("frequency", "natural_frequency", "first_frequency"),
        "of a pinned beam with the first frequency f and the mass per metre m: second_moment = 1, area = 1, "
        "density = m, youngs_modulus = 4 f^2 length^4 m/pi^2",
    )

    kind: Literal["beam"]
    length: Length = Field(gt=0)
    area: Area = Field(gt=0)
    second_moment: SecondMoment = Field(gt=0)
    youngs_modulus: Pressure = Field(gt=0)
    density: Density = Field(gt=0)
    supports: Supports
    fibre_distance: Length | None = Field(default=None, gt=0)

    @property
    def bending_stiffness(self) -> float:
        """E I, N m2."""
        return self.youngs_modulus * self.second_moment

    @property
    def mass_per_length(self) -> float:
        """rho A, kg/m."""
        return self.density * self.area

    @property
    def mass(self) -> float:
        """Of the whole beam, kg."""
        return self.mass_per_length * self.length

    @property
    def ends(self) -> tuple[str, str]:
        """How the ends at 0 and at the length are held; both free on springs."""
        left, right = self.supports.split("-") if isinstance(self.supports, str) else ("free", "free")
        return left, right

    @property
    def springs(self) -> tuple[Spring, ...]:
        """Springs to ground; none where the ends are named."""
        return () if isinstance(self.supports, str) else self.supports

    @property
    def is_free(self) -> bool:
        return self.ends == ("free", "free") and not self.springs

    @property
    def grows_with(self) -> Growing:
        if self.springs:  # whose stiffness stays
            return Growing()
        return Growing((("youngs_modulus",), ("second_moment",)), (("density",), ("area",)))

    @property
    def is_simply_supported(self) -> bool:
        return self.supports == "pinned-pinned"

    @property
    def is_one_span(self) -> bool:
        return not any(0.0 < s.at < self.length and s.stiffness > 0.0 for s in self.springs)

    @property
    def tells_supports(self) -> bool:
        return True

    @property
    def untold(self) -> tuple[str, ...]:
        return ("axial_force",)  # loads act across it

    @property
    def lacks_for_stress(self) -> str:
        return "fibre_distance" if self.fibre_distance is None else ""

    @property
    def modes_are_open(self) -> bool:
        return self.modes == "auto"

    @property
    def whole(self) -> Beam:
        return self

    def build(self) -> ModalBody:
        return self.read_at(())

    def read_at(self, spots: Spots) -> ModalBody:
        from engine.bodies.beam.modes import restraints_of, uniform_beam
        from engine.bodies.beam.supports import support_gauge

        modal = uniform_beam(self, AUTO_MODES if self.modes == "auto" else int(self.modes))
        if not spots:
            return modal
        held = restraints_of(self)
        return replace(modal, gauges={name: support_gauge(modal, held, modal.dampers, s.at) for name, s in spots})

    def spot_place(self, spot: Spot) -> Array:
        return np.asarray(spot.at * ALONG)

    def check_spot(self, spot: Spot) -> None:
        if not spot.support:
            super().check_spot(spot)
        if spot.node is not None:
            raise BadInput("supports of a uniform beam have no nodes", where="node", expected="at = metres along it")

    def spot_checks(self, spot: Spot, sensor: str, here: str) -> list[Check]:
        """A support that carries something stands where its reaction is read."""
        at, length = f"{sensor}.at", f"{here}.length"
        springs = [f"{here}.supports.{number}" for number in range(len(self.springs))]
        keys = [f"{spring}.{key}" for spring in springs for key in ("at", "stiffness")]
        held = [end != "free" for end in self.ends]
        places = [s.at for s in self.springs if s.stiffness > 0.0]
        places += [place for place, end in zip((0.0, self.length), held, strict=True) if end]

        def stands(x: Any, length: Any, *springs: Any) -> Any:
            found = (held[0] & (x == 0.0)) | (held[1] & (x == length))
            for place, stiffness in zip(springs[::2], springs[1::2], strict=True):
                found = found | ((np.abs(x - place) <= SAME_PLACE * length) & (stiffness > 0.0))
            return found

        expected = " or ".join(f"{place:.10g} m" for place in places) or "a body with supports"
        return [Check(at, (at, length, *keys), stands, "no support stands here", expected)]

    def outline(self, modal: ModalBody) -> Outline:
        ends = zip(self.ends, (0.0, self.length), (-ALONG, ALONG), strict=True)
        springs = [
            Elastic(f"at {s.at:.10g} m", s.at * ALONG, (0.0, 0.0, s.stiffness), (0.0, s.rotational, 0.0), s.damping > 0)
            for s in self.springs
        ]
        return replace(
            straight(modal),
            held=tuple(Held(f"at {s:.10g} m", s * ALONG, HELD_AT[end], out) for end, s, out in ends if end in HELD_AT),
            springs=tuple(springs),
        )

    def dampers(self) -> list[tuple[str, float | str, float]]:
        return [(f"supports.{number}.damping", s.at, s.damping) for number, s in enumerate(self.springs)]

    def doubts(self, here: str) -> list[Doubt]:
        fibres = () if self.fibre_distance is None else ("fibre_distance",)
        return section_doubts(here, f"{here}.length", *fibres)

    def checks(self, here: str) -> list[Check]:
        checks = []
        for index in range(len(self.springs)):
            spring = f"{here}.supports.{index}"
            parts = tuple(f"{spring}.{key}" for key in ("stiffness", "rotational", "damping"))
            checks.append(on_body(f"{spring}.at", (f"{spring}.at", f"{here}.length"), "a support off the beam"))
            what, remedy = "a support that holds nothing", "of a support that does not give way make a frame's node"
            checks.append(Check(spring, parts, lambda k, r, c: k + r + c > 0, what, "one of them > 0", remedy=remedy))
        return checks
