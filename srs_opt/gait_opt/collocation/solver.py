"""What solves the nonlinear programs: IPOPT unless told otherwise, with the user's own options last."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from srs_opt.errors import InputError
from srs_opt.gait_opt.settings import COLLOCATION

SOLVERS = ("ipopt", "fatrop", "sqpmethod")
_MINIMUM_DEGREE = 0  # MUMPS's ordering: quicker here than its own choice; METIS draws at random, bits differ
_COMMON: dict[str, Any] = {
    "print_time": False, "calc_lam_p": False, "error_on_fail": False, "show_eval_warnings": False,
}  # fmt: skip
# no scaling of IPOPT's own: unknowns and rows are of order one by `guess.state_scales`
_IPOPT = {
    "print_level": 0, "sb": "yes", "mu_strategy": "adaptive", "max_iter": 300, "tol": 1e-6,
    "linear_solver": "mumps", "mumps_pivot_order": _MINIMUM_DEGREE,
    "acceptable_tol": 1e-5, "acceptable_iter": 8, "warm_start_init_point": "no",
    "nlp_scaling_method": "none",
}  # fmt: skip
_SQP: dict[str, Any] = {
    "qpsol": "osqp", "max_iter": 300, "tol_du": 1e-4, "tol_pr": 1e-6, "convexify_strategy": "regularize",
    "print_header": False, "print_iteration": False, "print_status": False,
    "qpsol_options": {"error_on_fail": False, "osqp": {"verbose": False}},
}  # fmt: skip
_FATROP = {"print_level": 0, "tol": 1e-6}


@dataclass(frozen=True)
class Solver:
    """A solver and options that go before the search's own.

    Attributes
    ----------
    name : {"ipopt", "fatrop", "sqpmethod"}
        The search's tolerances and barrier are made for IPOPT. To FATROP a periodic cycle with shared
        unknowns has no stages: it solves one dense problem, to the same optimum in about a hundred times
        IPOPT's time. CasADi's SQP, with OSQP and a regularized Hessian, seldom converges in its iterations.
    options : tuple of (name, value)
        By the solver's own names, as ``("max_iter", 500)``.
    """

    name: str = "ipopt"
    options: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        if self.name not in SOLVERS:
            raise InputError(f"solver must be one of {', '.join(SOLVERS)}, found '{self.name}'")

    @staticmethod
    def of_words(name: str, words: Sequence[str]) -> Solver:
        """Return the solver with options given as KEY=VALUE.

        Raises
        ------
        InputError
            If a word has no equals sign.
        """
        options = []
        for word in words:
            key, equals, value = word.partition("=")
            if not (key and equals):
                raise InputError(f"--solver-option {word}: expected KEY=VALUE, as in max_iter=500")
            options.append((key, _number(value)))
        return Solver(name, tuple(options))


def _number(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def nlp_solver(
    solver: Solver, stage: Mapping[str, Any], nlp: dict[str, ca.MX], derivatives: dict[str, ca.Function]
) -> ca.Function:
    """Return a solver of `nlp`.

    Parameters
    ----------
    stage : mapping
        IPOPT's options of this stage of the search.
    derivatives : dict
        As IPOPT's interface takes them: ``grad_f``, ``jac_g``, ``hess_lag`` (upper triangle).

    Raises
    ------
    InputError
        If the solver takes none of the options.
    """
    own, options = dict(solver.options), dict(_COMMON)
    if solver.name == "ipopt":
        options |= {
            **derivatives,
            "no_nlp_grad": True,
            "ipopt": {**_IPOPT, "theta_max_fact": COLLOCATION.feasible_factor, **stage, **own},
        }
    elif solver.name == "fatrop":
        known = {key: stage[key] for key in ("max_iter", "tol") if key in stage}
        options |= {
            "structure_detection": "none", "cache": _by_name(nlp, derivatives),
            "fatrop": {**_FATROP, **known, **own},
        }  # fmt: skip
    else:
        jacobians = _by_name(nlp, derivatives)["nlp_jac_fg"]
        hessian = _full_hessian(nlp, derivatives)
        options |= {"no_nlp_grad": True, "hess_lag": hessian, "jac_fg": jacobians, **_SQP, **own}
    try:
        return ca.nlpsol("gait", solver.name, nlp, options)
    except RuntimeError as error:
        lines = [
            line for line in str(error).splitlines() if line and not line.startswith((".../", "Error in"))
        ]
        words = ", ".join(f"{k}={v}" for k, v in solver.options) or "none"
        raise InputError(f"solver {solver.name} with options {words}: {' '.join(lines)[:200]}") from error


def _symbols(nlp: dict[str, ca.MX]) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    sizes = nlp["x"].numel(), nlp["p"].numel(), 1, nlp["g"].numel()
    x, p, lam_f, lam_g = (ca.MX.sym(name, size) for name, size in zip(("x", "p", "lam_f", "lam_g"), sizes))
    return x, p, lam_f, lam_g


def _full_hessian(nlp: dict[str, ca.MX], derivatives: dict[str, ca.Function]) -> ca.Function:
    x, p, lam_f, lam_g = _symbols(nlp)
    hessian = ca.triu2symm(derivatives["hess_lag"](x, p, lam_f, lam_g))
    names = ["x", "p", "lam:f", "lam:g"]
    return ca.Function("hess_lag", [x, p, lam_f, lam_g], [hessian], names, ["hess:gamma:x:x"])


def _by_name(nlp: dict[str, ca.MX], derivatives: dict[str, ca.Function]) -> dict[str, ca.Function]:
    """Return the derivatives under the names by which solvers without options for them look for them."""
    x, p, lam_f, lam_g = _symbols(nlp)
    f, gradient = derivatives["grad_f"](x, p)
    g, jacobian = derivatives["jac_g"](x, p)
    of_lagrangian = gradient * lam_f + jacobian.T @ lam_g
    both, two = ["x", "p", "lam:f", "lam:g"], ["x", "p"]
    hessian = _full_hessian(nlp, derivatives)(x, p, lam_f, lam_g)
    all_in = [x, p, lam_f, lam_g]
    return {
        "nlp_grad_f": ca.Function("nlp_grad_f", [x, p], [gradient], two, ["grad:f:x"]),
        "nlp_jac_g": ca.Function("nlp_jac_g", [x, p], [g, jacobian], two, ["g", "jac:g:x"]),
        "nlp_jac_fg": ca.Function(
            "nlp_jac_fg", [x, p], [f, gradient, g, jacobian], two, ["f", "grad:f:x", "g", "jac:g:x"]
        ),
        "nlp_hess_l": ca.Function(
            "nlp_hess_l", all_in, [of_lagrangian, hessian], both, ["grad:gamma:x", "hess:gamma:x:x"]
        ),
        # multipliers of the parameters are not asked for
        "nlp_grad": ca.Function(
            "nlp_grad", all_in, [f, g, of_lagrangian, ca.DM.zeros(p.numel())], both,
            ["f", "g", "grad:gamma:x", "grad:gamma:p"],
        ),
    }  # fmt: skip
