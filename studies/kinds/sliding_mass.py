"""Where does a mass slide that lies on a bending beam? Section 2.3 of Hartweg and Heckmann (2012)."""

import numpy as np

from engine.scene.study import Study
from results_schema.variables import declare
from studies.kinds.moving_frames import MovingFrames
from studies.moving import findings
from studies.moving.question import Question
from studies.moving.variables import RESULTS
from studies.protocol.study import question_of
from studies.results.formatting import quantity
from studies.results.results import Results

declare("sliding-mass", *RESULTS)

#: What the paper gives, and the largest |a_z - g| that it tells, m/s2.
OF_PAPER = {"mass": 100.0, "motion.start": 2.0, "motion.speed": 0.0}
DAMPING, LARGEST_TOLD = 0.02, 20.0
BODY = {"length": 15.0, "area": 0.01, "second_moment": 8.33e-6, "youngs_modulus": 2.1e11, "density": 7850.0, "modes": 1}


class SlidingMass(MovingFrames):
    """The kind "sliding-mass"."""

    name = "sliding-mass"
    summary = "where a mass slides that lies on a bending beam, its period, what it feels"
    question = "Where does the mass slide, and what does it feel?"

    def check(self, study: Study) -> None:
        super().check(study)
        if len(study.carriage) != 1 or not next(iter(study.carriage.values())).motion.slides:
            expected = 'one table [carriage.NAME] whose motion is of the kind "free"'
            raise study.source.fault("carriage", "one carriage slides here", expected=expected)

    def findings(self, results: Results) -> list[str]:
        seconds = question_of(results.study, Question).duration
        return [*findings.sliding(results), *_beside_the_paper(results), *findings.others(results, seconds)]


KIND = SlidingMass()


def _beside_the_paper(results: Results) -> list[str]:
    """What of the paper's figure 3 is there, where its numbers are among the variants."""
    name = results.carriage_name
    body = results.study.carriage[name].on
    if not _is_papers(results, body):
        return []
    wanted = {f"carriage.{name}.{key}": value for key, value in OF_PAPER.items()}
    wanted |= {f"body.{body}.{key}": value for key, value in BODY.items()}
    peaks = {damping: _peak(results, wanted | {f"body.{body}.damping_ratio": damping}) for damping in (DAMPING, 0.0)}
    if np.isnan(peaks[DAMPING]):
        return []
    reached = quantity(peaks[DAMPING], "m s-2", 4)
    told = (
        f"With the numbers of Hartweg and Heckmann (2012) |a_z - g| reaches {reached}: their "
        f'"up to {LARGEST_TOLD:.0f} m/s²" is not what comes at their damping of 2 %'
    )
    undamped = f" (without damping it is {quantity(peaks[0.0], 'm s-2', 4)})" if np.isfinite(peaks[0.0]) else ""
    return [
        f"{told}{undamped}. Their equation (30) has its sign reversed and takes the tangent of what is one already: "
        "here s'' = w' (g - a_z), by which energy is kept."
    ]


def _is_papers(results: Results, body: str) -> bool:
    """Whether a body has the numbers of the paper's, and its supports."""
    table = results.study.data["body"][body]
    pinned = table.get("kind") == "beam" and table.get("supports") == "pinned-pinned"
    return pinned and all(isinstance(results.study.value(f"body.{body}.{key}"), int | float) for key in BODY)


def _peak(results: Results, wanted: dict[str, float]) -> float:
    """The largest contact force per mass of the variant with these numbers; NaN where there is none."""
    force = results.dataset[f"{results.carriage_name}_contact_force_max"].values
    here = np.ones(force.shape, dtype=np.bool_)
    for path, value in wanted.items():
        here &= np.isclose(results.everywhere(results.parameter(path)), value, atol=1e-12)
    return float(force[here][0] / wanted[f"carriage.{results.carriage_name}.mass"]) if here.any() else np.nan
