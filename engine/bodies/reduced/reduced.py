"""A reduced body out of a file, as the user describes it."""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from engine.bodies.frame.refusals import refuse
from engine.bodies.modal.description import Body, Spot, check_spot_name
from engine.bodies.modal.modal_body import ModalBody
from results_schema.errors import BadInput, WanderlastError, shortened
from results_schema.store.bodies import read_body, read_numbers


class Reduced(Body):
    """A body that `save_body` wrote: `file` is its path, from the working folder. modes: the lowest so many of it."""

    derived: ClassVar[tuple[str, ...]] = ("length",)
    names_files: ClassVar[bool] = True

    kind: Literal["reduced"]
    file: str = Field(min_length=1, max_length=1000)

    @cached_property
    def numbers(self) -> dict[str, float]:
        """The numbers in the file. Raises BadInput and ArchiveError."""
        assert self.recorded is None, "what an archive holds is told without the files of its models"
        return read_numbers(self.file)

    @property
    def length(self) -> float:
        """Of the track, m."""
        return self.numbers["length"] if self.recorded is None else self.recorded.length

    @cached_property
    def content(self) -> str:
        """SHA-256 of the file."""
        return hashlib.sha256(Path(self.file).read_bytes()).hexdigest()

    @property
    def hashes(self) -> tuple[tuple[str, str], ...]:
        return ((self.file, self.content),)

    @cached_property
    def untold(self) -> tuple[str, ...]:
        if self.recorded is not None:
            return ()  # the archive's sensors were looked at before they were read
        fibres = read_body(self.file).arrays["fibre_distance"][:, 1]
        return () if np.isfinite(fibres).all() else ("stress", "strain")

    @model_validator(mode="after")
    def _readable(self, info: ValidationInfo) -> Reduced:
        if self.take(info.context):
            return self
        try:
            read_body(self.file)  # as a whole, so that it is refused here where it is damaged
            if not self.length > 0.0:
                refuse(("file",), "this body has no track", received=shortened(self.file))
        except (WanderlastError, OSError) as error:
            what = getattr(error, "what", str(error))
            refuse(("file",), f"no reduced body can be read: {what}", received=shortened(self.file))
        return self

    def check_spot(self, spot: Spot) -> None:
        if spot.support:
            super().check_spot(spot)
        if spot.point is None:
            what, remedy = f"a reduced body has no {spot.key}s", "save it with a point there, and read point = its name"
            raise BadInput(what, where=spot.key, expected="one of its points", remedy=remedy)
        if self.recorded is None:
            points = read_body(self.file).points
            check_spot_name("point", spot.point, (p.removeprefix("point.") for p in points if p.startswith("point.")))

    def with_more_modes(self, times: int) -> Reduced:
        """The same body with more of the modes in its file."""
        if self.modes == "auto":
            return self
        return self.model_copy(
            update={"modes": min(times * int(self.modes), read_body(self.file).arrays["omega"].size)}
        )

    def finer(self) -> Reduced:
        """Raises BadInput where its file has no more modes, as what these leave out is not in it."""
        found = self.with_more_modes(2)
        if found == self:
            raise BadInput("the file of this body has no more modes", where="modes")
        return found

    def build(self) -> ModalBody:
        from engine.bodies.reduced.body import load_body

        return load_body(self.file, self.modes)
