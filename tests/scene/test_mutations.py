"""Faults 2, 3 and 4 for every key of a study that uses most of them."""

import pytest

from engine.scene.study import load
from engine.scene.sweep import Cases, expand
from tests.scene.mutations import HOW, How, accepted, mutations
from tests.scene.sample import MINIMAL, SAMPLE

OPTIONAL = {
    "title", "gravity", "initial", "sweep", "solver", "output", "carriage.probe", "carriage.load",
    "body.bed.damping_ratio", "body.bed.modes", "body.bed.own_weight", "body.bed.fibre_distance",
    "body.bed.supports.0.stiffness", "body.bed.supports.0.rotational", "body.bed.supports.0.damping",
    "carriage.table.delay", "carriage.load.headway", "carriage.load.motion.after",
    "sensor", "sensor.midspan", "sensor.midspan.quantity", "sensor.table_moment", "sensor.table_moment.quantity",
    "sweep.speed", "sweep.mass", "sweep.speed.spacing",
    "solver.fidelity", "solver.steps", "solver.tolerance", "solver.static_correction", "solver.audit",
    "output.histories",
}  # fmt: skip


def read(text: str) -> Cases:
    return expand(load(text))


def test_samples_are_valid() -> None:
    assert read(SAMPLE).shape == (40, 4)
    assert read(MINIMAL).shape == ()


@pytest.mark.fault(2, 3, 4)
@pytest.mark.parametrize("how", HOW)
def test_every_key(how: How) -> None:
    tried = mutations(SAMPLE)
    assert len(tried) > 350
    found = {".".join(mutation.path) for mutation in accepted(how, tried, read)}
    if how == "drop":
        assert found == OPTIONAL
