"""What is my model missing? A hidden effect is found, named, and the gap shrinks on sealed trials.

The data set comes from the virtual laboratory: generated data stand for a lab's.
"""

from pathlib import Path

from srs_opt.discrepancy.answer import corrected_robot
from srs_opt.discrepancy.pipeline import diagnose
from srs_opt.measurement.dataset import load_dataset
from srs_opt.robot import save_robot
from virtual_lab.__main__ import main as virtual_lab

CONSIDERED = ("tether_drag", "viscous_rolling", "stribeck", "gap_length", "head_mass", "curvature_stiffening")


def main(out: Path = Path("out/examples"), hidden: str = "gap_length") -> float:
    """Return the share of the gap that is left once the effect is in the model."""
    folder = out / "missing_data"
    virtual_lab(["--effect", hidden, "--seed", "2", "--quiet", "--out", str(folder)])
    found = diagnose(load_dataset(folder), CONSIDERED)
    print(f"{found.verdict.word}: {found.verdict.why}")
    assert found.gap is not None and found.gap.ratio is not None
    robot = corrected_robot(found)
    if robot is not None:
        for effect in robot.effects:
            print("in the corrected robot:", dict(effect))
        save_robot(robot, out / "corrected_robot.yaml")
    print(f"left of the gap on sealed trials: {found.gap.ratio:.1%}")
    return found.gap.ratio


if __name__ == "__main__":
    main()
