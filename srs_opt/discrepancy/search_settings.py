"""How effects are looked for: effort of the search, which candidates are fitted, what counts as progress."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchSettings:
    """How the best set of effects is searched, and with how many iterations its sets are fitted.

    Attributes
    ----------
    null_iterations : int
        Of the fit of calibration alone, which need not end where it leaves a gap.
    iterations : int
        Of the fit of a set of effects to all open trials.
    polish_iterations : int
        Of a fit that explains the data and had not converged.
    quick_iterations : int
        Of a fit to the first seconds of a few trials, before all are asked.
    most_effects : int
        In a set. Three can already absorb most of any gap.
    most_effects_brief : int
        The same with the first seconds of a few trials.
    rounds : int
        Additions and exchanges of effects in all.
    refits_by_effects : tuple
        Candidates that are fitted, by the number of effects that are there already: fewer as every fit has
        more coordinates. Fewer: the truth may be missed where it is not first in the screen; more: the time
        grows with them.
    refits_before_bending : int
        Fits of the best of the screen before one with a bending body, which costs as much as three of others.
    rival_deviance : float
        Within which two sets of effects cannot be told apart. The truth falls behind a rival by D with
        probability Phi(-sqrt(D)) at worst, whatever separates the two: under 1 % here, so that the sets that
        are kept hold the truth at 95 % with several rivals. Half: 4 %, wrong names; double: 0.03 %, more
        ties.
    rough_gain_share : float
        Share of the misfit that a fit may leave to be gained where it does not explain the data.
    fine_gain_share : float
        The same for all other fits.
    progress_share : float
        Share of the misfit that a second or later effect may leave and still count as progress: what is added
        is the largest of what is missing, so that of three effects the third leaves no more.
    stuck_misfit_ratio : float
        Misfit over its expectation under noise below which a search that makes no progress is not given up:
        little is left then.
    hopeless_share : float
        Share of the gap that the best known effects leave on the first seconds, from which on more data help
        nothing.
    restart_share : float
        Of the size that derivatives promise, from which a fit that ended worse than without the effect is
        begun again.
    certain_sd : float
        Standard deviations from zero at which an effect is not superfluous, without a fit.
    refitted_deviance : float
        Behind the best: sets that are fitted again when the noise turns out to be another.
    most_refitted : int
        Number of those.
    """

    null_iterations: int = 12
    iterations: int = 20
    polish_iterations: int = 40
    quick_iterations: int = 10
    most_effects: int = 4
    most_effects_brief: int = 3
    rounds: int = 6
    refits_by_effects: tuple[int, ...] = (5, 4, 3, 3)
    refits_before_bending: int = 2
    rival_deviance: float = 6.0
    rough_gain_share: float = 0.01
    fine_gain_share: float = 0.001
    progress_share: float = 0.5
    stuck_misfit_ratio: float = 1.2
    hopeless_share: float = 0.1
    restart_share: float = 0.2
    certain_sd: float = 10.0
    refitted_deviance: float = 60.0
    most_refitted: int = 5


@dataclass(frozen=True)
class ScreenSettings:
    """Which candidates of a screen deserve a fit, and where it starts.

    Attributes
    ----------
    contender_share : float
        Of the best expected gain, which earns a fit.
    near_deviance : float
        Or an expected gain so little behind the best, where that is less.
    least_contender_share : float
        But no less than this share of the best.
    relevant_deviance : float
        Expected gain, the noise taken as it was stated, from which a candidate is considered although a fit
        that is far off hides its significance.
    similar_rad : float
        Angle between what two candidates do, below which one that is well behind in the screen is fitted all
        the same: far from the linearisation's point an effect does up to sin^2 of it of something else.
    similar_share : float
        Share of the best expected gain that such a candidate must promise.
    alike_rad : float
        20 degrees: 0.9 of what one effect does the other can do too. Half leaves out pairs that noisier data
        would not tell apart; double lists half of all effects.
    screened_s : float
        Of all trials together, up to which candidates are screened on every one: half the time for sets of a
        dozen trials would lose small effects, and beyond it five trials of 8 s show a third of a typical size
        as clearly.
    start_reach : float
        Typical sizes to which the size is limited that a linearisation expects: farther off it is
        extrapolated.
    soft_start_sizes : tuple of float
        Typical flexibilities from the best of which a bending body's fit starts; from 0.35 alone
        flexibilities up to 200 1/(N m^2) were found and 330 was not.
    """

    contender_share: float = 0.45
    near_deviance: float = 40.0
    least_contender_share: float = 0.25
    relevant_deviance: float = 60.0
    similar_rad: float = 0.8
    similar_share: float = 0.2
    alike_rad: float = 0.35
    screened_s: float = 60.0
    start_reach: float = 2.0
    soft_start_sizes: tuple[float, ...] = (0.35, 1.0, 2.0)


@dataclass(frozen=True)
class SplitSettings:
    """Which trials are fitted, and which are sealed.

    Attributes
    ----------
    sealed_share : float
        Of the trials. More: fewer trials to find the effect; fewer: the gap on sealed trials is known less
        well.
    least_open, least_sealed : int
        Trials without which nothing is tested.
    folds : int
        Into which the open trials are dealt, to predict each other.
    brief_trials : int
        Trials on the first seconds of which a fit is first tried.
    brief_s : float
        Those seconds: a motion that has gone on for less long depends on the parameters less nonlinearly.
    brief_share : float
        Share of all recorded time above which that saves too little.
    """

    sealed_share: float = 0.25
    least_open: int = 3
    least_sealed: int = 1
    folds: int = 3
    brief_trials: int = 5
    brief_s: float = 3.0
    brief_share: float = 0.7


SEARCH = SearchSettings()
SCREEN = ScreenSettings()
SPLIT = SplitSettings()
