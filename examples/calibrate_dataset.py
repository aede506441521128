"""Calibrate: the robot's true friction, curvature and time constants from twelve filmed runs.

The data set comes from the virtual laboratory, so the truth is known: generated data stand for a lab's.
"""

import json
from pathlib import Path

from srs_opt.calibrate.run import calibrate
from srs_opt.measurement.dataset import load_dataset
from virtual_lab.__main__ import main as virtual_lab


def main(out: Path = Path("out/examples")) -> float:
    """Return the largest error of an estimate, in its own standard deviations."""
    folder = out / "calibrate_data"
    virtual_lab(["--seed", "5", "--quiet", "--out", str(folder)])
    truth = json.loads(folder.with_name(folder.name + ".truth.json").read_text(encoding="utf-8"))["truth"]
    dataset = load_dataset(folder)
    found = calibrate(dataset)
    errors = []
    for name, estimate in found.parameters.items():
        bench, true, sd = getattr(dataset.robot, name), truth["parameters"][name], found.sd[name]
        errors.append(abs(estimate - true) / sd)
        print(f"{name:32s} bench {bench:.4f}  calibrated {estimate:.4f} +- {sd:.4f}  true {true:.4f}")
    print(f"misfit over noise: {found.before:.2f} before, {found.after:.2f} after")
    return max(errors)


if __name__ == "__main__":
    main()
