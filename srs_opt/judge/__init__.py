"""A second opinion: gaits and drives played in somebody else's physics engine.

The robot is built there from bodies, joints, wheels and servos or springs (package ``dart_snake``); no
equation of motion, friction law or integrator of ``srs_opt.model`` takes part.
"""

from srs_opt.callable_package import make_callable

make_callable(__name__, "srs_opt.judge.gaits", "judge_gait")
