"""Small sets of the virtual laboratory, and a laboratory's own effect whose physics the laboratory knows."""

import numpy as np

from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design

PLUGIN = """
from srs_opt.effects import register_effect
from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter
register_effect(Effect("my_rolling", "ground", (EffectParameter("damping", "N s/m", 0.06, lower=0),),
                       what="wheels in mud", look="look at the wheels",
                       rolling_force=lambda e, v: -e["damping"] * v))
"""


def small_set(folder, hidden, seed=3, trials=8, seconds=2.0, scale=1.0):
    """Write a set; return what is hidden."""
    truth = draw_truth(hidden, np.random.default_rng([seed, 4]), (scale, scale))
    design = small_design(np.random.default_rng([seed, 5]), seconds)[:trials]
    write_dataset(folder, truth, design, seed, Recording(rate_hz=60.0))
    return truth
