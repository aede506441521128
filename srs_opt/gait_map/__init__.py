"""Speed and turning-radius maps over the paper's gait family (13), like its Figs. 8 and 9."""

from srs_opt.callable_package import make_callable

make_callable(__name__, "srs_opt.gait_map.grid", "gait_map")
