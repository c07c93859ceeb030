"""Small studies, one of each way in which studies are computed, and archives compared bit for bit."""

import numpy as np
import xarray as xr

from engine.scene.study import Study
from results_schema.store.archive import Archive
from tests.floating.scenes import sliding_mass
from tests.robots.scenes import scene
from tests.studies import at_rest
from tests.studies.small import SCENES

# The only attributes in which a resumed archive may differ from an uninterrupted one.
OF_TIME_AND_MACHINE = ("history", "machine", "run_seconds")


def sliding() -> str:
    """A mass that slides by itself, on beams of two densities: a piece of each."""
    sweep = {"density": {"of": "body.beam.density", "values": [7000.0, 8500.0]}}
    data = sliding_mass().data | {"kind": "sliding-mass", "question": {"duration": 0.5}, "sweep": sweep}
    data |= {"solver": {"steps": 100}}
    return Study(**data).source.text


def portal() -> str:
    """Robots on rails, with two payloads: a piece of each."""
    payload = {"payload": {"of": ["robot.portal.payload_scale"], "values": [0.0, 2.0]}}
    return scene(solver={"tolerance": 1e-2}, sweep=payload, question={"after": 0.2}).source.text


TEXTS = {
    "marched": SCENES.replace("count = 8", "count = 3").replace('"auto"\naudit = 2', "200\naudit = 1"),
    "at rest": at_rest.text_of("influence", "positions = 3"),
    "frames that move": sliding(),
    "robots": portal(),
}


def assert_same_results(first: xr.Dataset, second: xr.Dataset) -> None:
    """Equal to the last bit, but for the time and the machine."""
    for dataset in (first, second):
        assert set(OF_TIME_AND_MACHINE) <= set(dataset.attrs)
    strip = [d.assign_attrs({key: "" for key in OF_TIME_AND_MACHINE}) for d in (first, second)]
    xr.testing.assert_identical(*strip)
    compared = [name for name, array in first.data_vars.items() if array.dtype.kind == "f"]
    assert len(compared) > 3
    for name in compared:
        assert first[name].values.tobytes() == second[name].values.tobytes()


def assert_same_archives(first: Archive, second: Archive) -> None:
    """The same of the root and of all groups."""
    assert_same_results(first.root, second.root)
    assert set(first.groups) == set(second.groups)
    for name, group in first.groups.items():
        for variable in group.variables:
            one, two = (np.asarray(archive.groups[name][variable].values) for archive in (first, second))
            same = (one == two).all() if one.dtype == object else one.tobytes() == two.tobytes()
            assert same, (name, variable)
