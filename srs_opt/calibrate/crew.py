"""Who linearises trials: this process, several with fixed shares, or a cluster; same results."""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from srs_opt.calibrate.gram import TrialGram
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial
from srs_opt.processes import workers_deaf_to_interrupts

if TYPE_CHECKING:
    from srs_opt.calibrate.experiment import Experiment, Request


def helped(
    experiment: Experiment,
    jobs: int = 1,
    cluster: str | None = None,
    groups: Sequence[Sequence[Trial]] = (),
) -> AbstractContextManager[object]:
    """Return a context in which `jobs` processes, or the cluster at that address, share the trials."""
    if cluster is not None:
        from srs_opt.calibrate.cluster import ClusterCrew

        return ClusterCrew(experiment, cluster)
    return Crew(experiment, jobs, groups) if jobs > 1 else nullcontext()


class Crew:
    """Worker processes that linearise trials; a context manager.

    Parameters
    ----------
    experiment : Experiment
        Its model, trials and noise go to the workers.
    jobs : int
        Number of processes, the calling one included.
    groups : sequence of sequences of Trial
        Trials that are asked for together, the most important first; default: all at once.
    """

    def __init__(self, experiment: Experiment, jobs: int, groups: Sequence[Sequence[Trial]] = ()) -> None:
        self.experiment = experiment
        shares = fair_shares(groups or (experiment.trials,), jobs)
        self.own = {t.name for t in shares[0]}
        self._members: list[tuple[Any, Connection, set[str]]] = []
        context = multiprocessing.get_context("spawn")
        for share in shares[1:]:
            if share:
                here, there = context.Pipe()
                noise = (experiment.sd_m, experiment.tolerance_m_s, experiment.keeps)
                setup = (experiment.model.robot, experiment.model.full.model, share, *noise)
                process = context.Process(target=_serve, args=(there, *setup), daemon=True)
                with workers_deaf_to_interrupts():
                    process.start()
                there.close()
                self._members.append((process, here, {t.name for t in share}))

    def __enter__(self) -> Crew:
        self.experiment.crew = self
        return self

    def __exit__(self, *error: object) -> None:
        self.experiment.crew = None
        for process, connection, _ in self._members:
            try:
                connection.send(None)
            except OSError:
                process.terminate()
            if error[0] is not None:  # nobody waits for the work in hand
                process.terminate()
            process.join(timeout=10)
            connection.close()

    def grams(self, trials: Sequence[Trial], request: Request) -> dict[str, TrialGram]:
        """Return the Gram matrices of `trials`, every process working on its share.

        Raises
        ------
        NoAnswerError
            If a trial cannot be simulated at the point.
        """
        asked = []
        for _, connection, share in self._members:
            names = [t.name for t in trials if t.name in share]
            if names:
                connection.send((names, request))
                asked.append(connection)
        found: dict[str, TrialGram] = {}
        failure: NoAnswerError | None = None
        try:
            own = [t for t in trials if t.name in self.own]
            found.update(self.experiment.own_grams(own, request))
        except NoAnswerError as error:
            failure = error
        for connection in asked:
            reply = connection.recv()
            if isinstance(reply, dict):
                found.update(reply)
            else:
                failure = NoAnswerError(reply)
        if failure is not None:
            raise failure
        return {t.name: found[t.name] for t in trials}


def fair_shares(groups: Sequence[Sequence[Trial]], jobs: int) -> list[list[Trial]]:
    """Return the trials of every process: of each group, which is asked for together, as many to all.

    Who gets one more of a group gets one less of a later one.
    """
    shares: list[list[Trial]] = [[] for _ in range(jobs)]
    load = [0.0] * jobs
    for group in groups:
        counts = [0] * jobs
        for trial in sorted(group, key=lambda t: -t.frequency_hz):
            fewest = min(counts)
            k = min((k for k in range(jobs) if counts[k] == fewest), key=lambda k: load[k])
            shares[k].append(trial)
            counts[k] += 1
            load[k] += float(trial.time_s[-1])
    return shares


def _serve(
    connection: Connection,
    robot: Any,
    model: str,
    trials: list[Trial],
    sd_m: float,
    tolerance_m_s: float,
    keeps: bool,
) -> None:
    """Answer requests until told to stop."""
    from srs_opt.calibrate.experiment import Experiment
    from srs_opt.calibrate.model import Model

    experiment = Experiment(Model(robot, model), trials, sd_m, tolerance_m_s=tolerance_m_s, keeps=keeps)
    known = {t.name: t for t in trials}
    # a parent that has gone, between two requests or in the middle of one, is no failure of this process
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while (request := connection.recv()) is not None:
            names, wanted = request
            try:
                answer: object = experiment.own_grams([known[n] for n in names], wanted)
            except NoAnswerError as error:
                answer = str(error)
            connection.send(answer)
