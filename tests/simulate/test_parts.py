"""Generated C that is cut into short functions computes what it did, to the last bit."""

import re

import casadi as ca
import numpy as np
import pytest

from srs_opt.simulate import compiled, parts


def long_function(more: int) -> ca.Function:
    """Values that live long and briefly, results on the way, two outputs."""
    x, y = ca.SX.sym("x", 5), ca.SX.sym("y")
    values = [x[i] for i in range(5)]
    for k in range(more):
        values.append(ca.sin(values[-1]) * values[k // 2] + y / (1 + values[-3] ** 2))
    return ca.Function(
        "long", [x, y], [ca.vertcat(*values[-9:], values[7]), values[more // 2]], {"cse": True}
    )


@pytest.mark.skipif(compiled.compiler() is None, reason="needs a C compiler")
def test_cuts_do_not_touch_the_bits(tmp_path, monkeypatch):
    monkeypatch.setenv("SRS_OPT_CACHE", str(tmp_path))
    function, point = long_function(400), (np.linspace(0.1, 0.9, 5), 0.7)
    results = []
    for length in (10**6, 250, 7):
        monkeypatch.setattr(parts, "PART", length)
        call = compiled.compiled(f"parts of {length}", lambda: function)
        assert call.name() != function.name(), "not compiled"
        results.append([np.asarray(v) for v in call(*point)])
    for other in results[1:]:
        for one, two in zip(results[0], other):
            np.testing.assert_array_equal(one, two)
    for one, two in zip(results[0], function(*point)):
        np.testing.assert_allclose(one, np.asarray(two), rtol=1e-12)


def test_no_function_is_long_and_short_ones_are_left_alone():
    source = compiled._casadi_source(long_function(400), "name")
    bodies = re.findall(r"^static .*?^\}", source, re.DOTALL | re.MULTILINE)
    assert max(body.count("=") for body in bodies) < 3 * parts.PART
    assert source.count("noinline") > 3
    assert "noinline" not in compiled._casadi_source(long_function(5), "name")
