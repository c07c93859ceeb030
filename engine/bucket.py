"""Variants that share a scene and a step count, and all tables that their marches need."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.checking import Checks, checks_of
from engine.choice import Choice
from engine.envelopes import EnvelopeTables, envelope_tables
from engine.model import SceneModel, simplified
from engine.tables import STATIC_STATIONS, SceneTables
from results_schema.status import Fidelity

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

PACE = 1.2e9  # modes x steps x variants per second and thread, for expected times only
PAIR = 2.5  # times the work of one march: a Richardson pair, 1.5 of it by its steps; for expected times only
PLACE, PLACE_MODES = 0.2, 8.0  # an envelope's place costs as that part of a march with so many more modes; likewise
PAIR_PLACES = 2.5  # times that much again in a Richardson pair, whose histories of all places are made; likewise


@dataclass(frozen=True, eq=False)
class Bucket:
    """Variants that share a scene and a step count; ``reason`` says which rule asked for that many.

    told: what was chosen for them, with the errors that were expected. full_cost: (V,) modes x steps of the full model.
    chosen: bodies whose modes were chosen. compared: with which steps it is marched again, to know its error. added:
    times the steps that were chosen first, where those turned out to be too few. rounds: how often they were improved.
    """

    tables: SceneTables
    variants: Counts
    reason: str
    told: Choice
    full_cost: Array
    chosen: tuple[str, ...] = ()
    compared: Literal["half", "twice", "not"] = "half"
    added: int = 1
    rounds: int = 0
    _finer: dict[tuple[int, int, bool], Bucket] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def scene(self) -> SceneModel:
        """The shared scene."""
        return self.tables.model

    @property
    def steps(self) -> int:
        """Steps over one passage or cycle."""
        return self.tables.steps

    @cached_property
    def envelopes(self) -> tuple[EnvelopeTables, ...]:
        """The tables of the marches that watch the envelopes."""
        return envelope_tables(self.tables)

    @property
    def seconds_per_variant(self) -> float:
        """Expected time on one thread."""
        if self.scene.fidelity is Fidelity.STATIC:
            return 1e-9 * STATIC_STATIONS * len(self.tables.signals)
        signals = 1.0 + 0.1 * len(self.tables.signals)
        ties = self.scene.ties**1.2
        marches, more = (1.0, 1.0) if self.scene.scheme.stride == 1 else (PAIR, PAIR_PLACES)
        modes = self.scene.omega.size
        work = modes * signals * ties
        for part in self.envelopes:
            work += modes * ties + (modes + PLACE_MODES) * PLACE * more * len(part.places) * (1.0 + 0.7 * (ties - 1.0))
        checked = 0.0 if self.checks is None else self.checks.cost(self.tables)
        return float(work * self.tables.timeline.steps * (marches + checked) / PACE)

    @property
    def cost(self) -> float:
        """Modes x steps over one passage or cycle, with all that is marched beside it."""
        if self.checks is None:
            return 0.0
        own = float(self.tables.steps * self.scene.body_modes)
        return own * (1.5 if self.scene.scheme.stride > 1 else 1.0) + own * self.checks.cost(self.tables)

    def forget(self) -> None:
        """Drop the tables, when no chunk needs them any more."""
        for tables in (self.tables, *self.envelopes):
            tables.forget()
        self.__dict__.pop("checks", None)
        self._finer.clear()

    def of(self, variants: Counts) -> Counts:
        """Where some of its variants stand in it."""
        order = np.argsort(self.variants)
        return np.asarray(order[np.searchsorted(self.variants, variants, sorter=order)])

    @cached_property
    def checks(self) -> Checks | None:
        """The marches that its march is compared with; None where nothing is marched."""
        if self.scene.fidelity is Fidelity.STATIC or self.compared == "not":
            return None
        return checks_of(self.tables, self.compared)

    def finer(self, modes: int, by: int) -> Bucket:
        """The same variants with so many modes of the bodies whose modes are chosen (0: as many as now) and ``by``
        times the steps."""
        return self._kept(modes, by, self.told, {f"body.{name}.modes": modes for name in self.chosen if modes})

    def with_own_model(self, by: int) -> Bucket:
        """The same variants with the carriages' own model in place of a simpler one, and ``by`` times the steps."""
        told = self.told._replace(error_fidelity=np.zeros_like(self.told.error_fidelity))
        return self._kept(0, by, told, {"solver.fidelity": "full"})

    def _kept(self, modes: int, by: int, told: Choice, changes: dict[str, object]) -> Bucket:
        key = modes, by, "solver.fidelity" in changes
        with self._lock:
            if key not in self._finer:
                self._finer[key] = self._with_more(by, told, changes)
            return self._finer[key]

    def _with_more(self, by: int, told: Choice, changes: dict[str, object]) -> Bucket:
        model = simplified(self.scene, changes) if changes else self.scene
        tables = self.tables.with_steps(model, by)
        reason = "more than expected was missed"
        return replace(
            self,
            tables=tables,
            reason=reason,
            told=told,
            added=self.added * by,
            rounds=self.rounds + 1,
            _finer={},
            _lock=threading.Lock(),
        )


def uncompared(tables: SceneTables, variants: Counts, reason: str) -> Bucket:
    """Variants that are marched as they are told, without any estimate."""
    none = np.zeros(variants.size)
    told, cost = Choice(*(none for _ in Choice._fields)), none + tables.steps * tables.model.body_modes
    return Bucket(tables, variants, reason, told, cost, compared="not")
