"""How long the buffers of a kernel must be: read from its source, and asked of every launch."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.cl.bounds import bounds, declared
from rift_cl.cl.preprocessor import Macros
from rift_cl.errors import KernelArgumentError


def _least(length, numbers=(6, 4), **macros):
    """What an expression of n and m is, of a kernel that takes a buffer and these two."""
    known = Macros({name: str(value) for name, value in macros.items()})
    (bound,) = bounds(["x", "n", "m"], [0], {"x": length}, known)
    return bound.least([None, *numbers, 7, 1, 1])


@pytest.mark.each
@pytest.mark.parametrize(
    ("length", "wanted"),
    [
        ("n, 3", 18),
        ("n - 1 - 2", 3),
        ("2 * n - m / 3, m", 44),
        ("(n + m - 1) / m", 2),
        ("n > m ? n : m", 6),
        ("n < m ? n : n == 6 && m != 4 ? 1 : 2", 2),
        ("1 << m, 1", 16),
        ("min(n, m) + max(1, n % m)", 6),
        ("-m + n", 2),
        ("along0, along1", 7),
    ],
)
def test_lengths_are_expressions_of_c(length, wanted):
    assert _least(length) == wanted


def test_lengths_know_the_macros_of_a_variant():
    macros = Macros({"ORDER": "2"})
    modes, row = "#define MODES(order) ((order) + \\\n 1)", "#define ROW (MODES(ORDER) * 2)"
    assert list(macros.active(f"#if ORDER > 1\n{modes}\n{row}\n#endif")) == []
    (bound,) = bounds(["x", "n"], [0], {"x": "n, ROW"}, macros)
    assert bound.least([None, 5, 1, 1, 1]) == 30


@pytest.mark.each
@pytest.mark.parametrize("length", ["n +", "n m", "other", "n, (m", "x", "n; m", "1.5"])
def test_what_is_no_length_is_named_where_a_kernel_is_built(length):
    with pytest.raises(ValueError, match="length of a buffer"):
        _least(length)


def test_shapes_are_read_from_the_comment_that_opens_a_file():
    text = "/* Doubles.\n *\n * Buffers: x, y[count,\n * 3], z[*]. */\nint f(void);"
    assert declared(text) == {"x": "count, 3", "y": "count, 3", "z": "*"}
    assert declared("/* Nothing. */") == {}
    for wrong in ("/* Buffers: x[3]. y[4]. */", "/* Buffers: x[3], x[4]. */", "/* Buffers: x. */"):
        with pytest.raises(ValueError, match="buffer"):
            declared(wrong)


def test_a_short_buffer_is_refused_before_anything_runs(device):
    x, y = device.array(np.ones(4)), device.array(np.ones(5))
    given = {"a": 2, "b": 3.0, "RUN": 4}
    with pytest.raises(KernelArgumentError, match=r"axpby.*\bx has 4 numbers.*\b5 \[size\]"):
        device.launch("axpby", (2,), x=x, y=y, size=5, **given)
    device.launch("axpby", (1,), x=x, y=y, size=4, **given)
    # What was long enough for one launch is not for the next.
    with pytest.raises(KernelArgumentError, match=r"\bx has 4"):
        device.launch("axpby", (2,), x=x, y=y, size=5, **given)
    with pytest.raises(KernelArgumentError, match=r"\bx has 3"):
        device.launch("axpby", (1,), x=x[:3], y=y, size=4, **given)
    assert device.get(y).tolist() == [5, 5, 5, 5, 1]


def test_a_count_that_is_no_number_is_named(device):
    x = device.array(np.ones(4))
    for wrong in ("4", None, np.ones(4), 4.0):
        with pytest.raises(KernelArgumentError, match=r"\bargument size\b"):
            device.launch("axpby", (1,), x=x, y=x, a=1, b=1, size=wrong, RUN=4)
