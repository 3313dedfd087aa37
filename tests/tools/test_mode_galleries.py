"""Figures 13 to 15: nine modes of each kind, orthonormal, and the same by either basis."""

import json

import numpy as np
import pytest

from rift_cl.report.html_page import Page


class _Quick:
    full = False

    @staticmethod
    def size():
        return {"size": "quick"}


def result_of(figure):
    return json.loads(json.dumps(list(figure.compute(_Quick, None, {}))[-1]))


def pictures(tool, modes):
    decode = tool("paper.images").decode
    return {mode["name"]: decode(mode["image"]) for mode in modes}


def test_laguerre_modes_have_their_rings_and_turns(tool):
    figure = tool("paper.figure_13")
    result = result_of(figure)
    assert result["orthonormality"] < 1e-12
    assert result["conversion"] < 1e-12
    found = pictures(tool, result["modes"])
    assert len(found) == 9
    for p in range(3):
        for turns in range(3):
            image = found[f"LG p={p}, l={turns}"]
            middle = image.shape[0] // 2
            line = image[middle, middle + 1 :]
            strong = line[np.abs(line) > 0.02]
            assert (np.diff(np.sign(strong)) != 0).sum() == p
            # Half a turn changes the sign where l is odd.
            np.testing.assert_allclose(image[::-1, ::-1], (-1) ** turns * image, atol=0.02)
    sums = {one["mode"]: one["terms"] for one in result["sums"]}
    ring = {term["mode"]: term["coefficient"] for term in sums["LG 1 0"]}
    assert ring == {"HG 2 0": pytest.approx(0.5**0.5), "HG 0 2": pytest.approx(0.5**0.5)}
    page = Page("page")
    figure.show(page, result)
    assert page.html().count("<img") == 2
    assert page.html().count("<table") == 1


def test_hermite_modes_have_zeros_along_either_axis(tool):
    figure = tool("paper.figure_14")
    result = result_of(figure)
    assert result["orthonormality"] < 1e-12
    found = pictures(tool, result["modes"])
    for m in range(3):
        for n in range(3):
            image = found[f"HG {m} {n}"]
            for values, zeros in ((image, m), (image.T, n)):
                line = values[np.argmax(np.abs(values).max(axis=1))]
                strong = line[np.abs(line) > 0.02]
                assert (np.diff(np.sign(strong)) != 0).sum() == zeros
    page = Page("page")
    figure.show(page, result)
    assert page.html().count("<img") == 2


def test_nine_of_each_kind_are_on_the_sphere(tool):
    figure = tool("paper.figure_15")
    result = result_of(figure)
    assert [len(result[name]) for name in ("harmonics", "laguerre", "hermite")] == [9, 9, 9]
    constant = pictures(tool, result["harmonics"])["SH 0 0"]
    inside = np.abs(constant) > 0.5
    assert inside.mean() == pytest.approx(np.pi / 4, abs=0.03)
    np.testing.assert_allclose(constant[inside], 1, atol=0.01)
    page = Page("page")
    figure.show(page, result)
    assert page.html().count("<img") == 6


def test_signs_have_colours_and_zero_is_white(tool):
    colors = tool("paper.mode_gallery").signed_colors(np.array([-1.0, 0.0, 1.0]))
    np.testing.assert_allclose(colors[1], 1)
    assert colors[0, 2] > colors[0, 0]
    assert colors[2, 0] > colors[2, 2]
