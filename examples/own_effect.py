"""An effect of your own: wheels that clog, so that rolling resistance grows with the square of speed.

`register_effect` makes it known to robot files, models, calibrate and discrepancy. For the commands, name
the file: ``python -m srs_opt.simulate --plugin examples/own_effect.py --robot my_robot.yaml``.
"""

from pathlib import Path

import casadi as ca

from srs_opt.effects import register_effect
from srs_opt.effects.effect import Effect, Symbols
from srs_opt.effects.parameter import EffectParameter
from srs_opt.gait import published_wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import load_robot


def drag(e: Symbols, speed_m_s: ca.SX) -> ca.SX:
    """Return the extra force along the wheel (N), against the motion."""
    return -e["per_speed2"] * speed_m_s * ca.fabs(speed_m_s)


CLOGGED_WHEELS = register_effect(
    Effect(
        name="clogged_wheels",
        kind="ground",
        parameters=(EffectParameter("per_speed2", "N s^2/m^2", typical=0.1, lower=0),),
        what="wheels clog: rolling resistance grows with the square of speed",
        look="tow the robot at several speeds",
        rolling_force=drag,
    )
)


def main(out: Path = Path("out/examples")) -> float:
    """Return the share of its speed that the published gait keeps on clogged wheels."""
    out.mkdir(parents=True, exist_ok=True)
    file = out / "clogged.yaml"
    file.write_text(
        "name: clogged\neffects:\n  - {name: clogged_wheels, per_speed2: 0.1}\n", encoding="utf-8"
    )
    clean, clogged = load_robot(), load_robot(file)
    gait = published_wave(clean).gait()
    speeds = [steady_gait(robot, gait).speed_m_s for robot in (clean, clogged)]
    print(f"clean wheels {speeds[0]:.4f} m/s, clogged {speeds[1]:.4f} m/s")
    return speeds[1] / speeds[0]


if __name__ == "__main__":
    main()
