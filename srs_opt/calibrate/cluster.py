"""Trials linearised by the workers of a Dask cluster, bit for bit as here, whichever worker is lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from srs_opt.calibrate.experiment import Experiment, Request, Slopes
from srs_opt.calibrate.gram import TrialGram
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.nominal import Meshes
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial
from srs_opt.robot import Robot
from srs_opt.sweep import chunks, connect

if TYPE_CHECKING:
    from distributed import Client

SHARE = 4  # trials of one task, simulated side by side
Setup = tuple[Robot, str, float, float, bool]
Memory = tuple[Meshes, Slopes | None]


class ClusterCrew:
    """Has a cluster linearise an experiment's trials; a context manager.

    A task carries all that it depends on, the trials' last meshes and slopes included, so that it can be done
    again elsewhere.

    Parameters
    ----------
    experiment : Experiment
    address : str
        Of the scheduler, ``host:port``.
    """

    def __init__(self, experiment: Experiment, address: str) -> None:
        self.experiment = experiment
        model = experiment.model
        noise = (experiment.sd_m, experiment.tolerance_m_s, experiment.keeps)
        self._setup: Setup = (model.robot, model.full.model, *noise)
        self._client: Client = connect(address)

    def __enter__(self) -> ClusterCrew:
        self.experiment.crew = self
        return self

    def __exit__(self, *error: object) -> None:
        self.experiment.crew = None
        self._client.close()

    def grams(self, trials: Sequence[Trial], request: Request) -> dict[str, TrialGram]:
        """Return the Gram matrices of `trials`.

        Raises
        ------
        NoAnswerError
            If a trial cannot be simulated at the point.
        """
        runs, slopes = self.experiment.runs, self.experiment.slopes
        tasks = []
        for share in chunks(trials, SHARE):
            known = slopes if request.stale else {}
            memory = {t.name: (runs[t.name].meshes, known.get(t.name)) for t in share}
            task = self._client.submit(_linearise, self._setup, tuple(share), memory, request, pure=False)
            tasks.append(task)
        found: dict[str, TrialGram] = {}
        failure: str | None = None
        for grams, memory in self._client.gather(tasks):
            for name, (meshes, own) in memory.items():
                runs[name].meshes = meshes
                if own is not None:
                    slopes[name] = own
            if isinstance(grams, str):
                failure = grams
            else:
                found.update(grams)
        if failure is not None:
            raise NoAnswerError(failure)
        return found


def _linearise(
    setup: Setup,
    trials: tuple[Trial, ...],
    memory: Mapping[str, Memory],
    request: Request,
) -> tuple[dict[str, TrialGram] | str, dict[str, Memory]]:
    """Return the Gram matrices, or why there are none, and what to go on with; runs on a worker.

    Where the task carries slopes they are used, and not sent back.
    """
    robot, model, sd_m, tolerance_m_s, keeps = setup
    experiment = Experiment(_model(robot, model), trials, sd_m, tolerance_m_s=tolerance_m_s, keeps=keeps)
    stale = False
    for t in trials:
        meshes, slopes = memory[t.name]
        experiment.runs[t.name].meshes = dict(meshes)
        if slopes is not None:
            experiment.slopes[t.name], stale = slopes, True
    grams: dict[str, TrialGram] | str
    try:
        grams = experiment.own_grams(trials, replace(request, stale=stale))
    except NoAnswerError as error:
        grams = str(error)
    back = {} if stale else experiment.slopes
    return grams, {t.name: (experiment.runs[t.name].meshes, back.get(t.name)) for t in trials}


@lru_cache(maxsize=4)
def _model(robot: Robot, model: str) -> Model:
    return Model(robot, model)
