"""Every variant of the search for defaults is one that a fit takes, and no two are the same."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from rift_cl.commands.fit_photos.settings import FitPhotosSettings

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def search(monkeypatch):
    monkeypatch.syspath_prepend(TOOLS)
    yield importlib.import_module("search_defaults")
    sys.modules.pop("search_defaults", None)


def test_every_variant_is_taken_and_no_two_are_the_same(search):
    made = [
        FitPhotosSettings.of(Path("capture"), Path("out"), **values)
        for values in search.VARIANTS.values()
    ]
    for number, settings in enumerate(made):
        settings.check()
        assert settings not in made[:number], [*search.VARIANTS][number]


def test_a_factor_is_of_what_was_found_or_of_the_default(search):
    found = search.times(2, "learning_rates.means", "learning_rates.logits")
    assert found["learning_rates.means"] == 2 * search.FOUND["learning_rates.means"]
    settings = FitPhotosSettings.of(Path("capture"), Path("out")).training
    assert found["learning_rates.logits"] == 2 * settings.learning_rates.logits
