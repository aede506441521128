"""Switch-exact simulation: steps end at valve switches, curvature in closed form."""

from srs_opt.callable_package import make_callable

make_callable(__name__, "srs_opt.simulate.run", "simulate")
