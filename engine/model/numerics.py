"""What a variant is computed with: a value that stands beside the study and changes nothing in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from engine.bodies.modal.description import Body
    from engine.kernels.schemes import Scheme
    from engine.scene.study import Study


_SPRUNG = ("auto", "static", "full")  # models that know the springs of carriages


class Numerics(NamedTuple):
    """Which terms act, how many modes are kept, how time is stepped.

    fidelity: as `solver.fidelity` ("auto" and "full": all terms that the carriages have). modes: of every body whose
    number is left open; 0: as the study says. more: times the modes of all other bodies, as far as they have them.
    elements: times those of bodies that the study cuts into some.

    >>> from engine.scene.study import Study
    >>> study = Study(kind="passage", solver={"fidelity": "force"})
    >>> Numerics.of(study).fidelity, Numerics.of(study).scheme.name
    ('force', 'average-acceleration')
    """

    fidelity: str
    scheme: Scheme
    static_correction: bool
    modes: int = 0
    more: int = 1
    elements: int = 1

    @property
    def knows_springs(self) -> bool:
        """Whether carriages move on their springs."""
        return self.fidelity in _SPRUNG

    @classmethod
    def of(cls, study: Study) -> Numerics:
        """What the study says."""
        solver = study.solver
        return cls(solver.fidelity, solver.integration, solver.static_correction)

    def body(self, study: Study, name: str) -> Body:
        """A body of the study with as many modes as it keeps."""
        body = study.body[name]
        if self.elements > 1:
            body = body.with_more_elements(self.elements)
        if name in open_bodies(study):
            return body.with_modes(self.modes) if self.modes else body
        return body.with_more_modes(self.more) if self.more > 1 else body


def open_bodies(study: Study) -> tuple[str, ...]:
    """Bodies whose number of modes is left open: those that carry loads, ride on nothing, and name none."""
    ridden = {name for carriage in study.carriage.values() for name in carriage.ridden}
    riding = {carriage.riding_body for carriage in study.carriage.values()}
    return tuple(name for name, body in study.body.items() if name in ridden - riding and body.modes_are_open)
