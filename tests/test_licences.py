"""No part of the core is under the GPL, and extras whose parts are say so."""

from __future__ import annotations

import re
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

# Parts under the GPL or the LGPL, by the extra that brings them; "" is the core.
NAMED = {
    # MIT, with parts of its library under the LGPL, which its metadata does not say.
    "": {"nlopt"},
    "heic": {"pi-heif"},
    "neighbours": {"pylops"},
    "peers": {"astra-toolbox", "gratopy", "pylops"},
}
PROJECT = Path(__file__).parents[1] / "pyproject.toml"
# What people who work on the package install, and what draws its pages.
WITHOUT = {"dev", "docs", "test"}
GPL = re.compile(r"\bL?GPL|General Public License", re.IGNORECASE)


def requirements():
    """The requirements of the core and of each extra, as pyproject.toml has them."""
    if sys.version_info < (3, 11):
        pytest.skip("tomllib comes with Python 3.11")
    import tomllib

    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    extras = {k: v for k, v in project["optional-dependencies"].items() if k not in WITHOUT}
    return {"": project["dependencies"], **extras}


def licence(name):
    """What a distribution says of its licence; alternatives count as the freest."""
    metadata = distribution(name).metadata
    classifiers = [c for c in metadata.get_all("Classifier") or [] if c.startswith("License ::")]
    stated = metadata.get("License-Expression") or "; ".join(classifiers)
    stated = stated or (metadata.get("License") or "").split("\n")[0]
    # An expression such as "Apache-2.0 OR LGPL-2.1-or-later" leaves the choice.
    choices = stated.split(" OR ")
    return next((choice for choice in choices if not GPL.search(choice)), stated)


def installed(wanted):
    """What is installed of requirements, and of what these require, by normal names."""
    found, pending = {}, [Requirement(text) for text in wanted]
    while pending:
        each = pending.pop()
        name = re.sub(r"[-_.]+", "-", each.name).lower()
        environments = [{"extra": extra} for extra in (each.extras or {""})]
        if each.marker is not None and not any(map(each.marker.evaluate, environments)):
            continue
        try:
            required = distribution(each.name).requires or []
        except PackageNotFoundError:
            continue
        if name not in found:
            found[name] = licence(each.name)
            plain = [Requirement(text) for text in required]
            pending += [
                r for r in plain if r.marker is None or any(map(r.marker.evaluate, environments))
            ]
    return found


def test_the_core_has_no_part_under_the_gpl():
    found = installed(requirements()[""])
    assert {"numpy", "scipy", "pyopencl", "nlopt"} <= found.keys()
    assert {name for name, said in found.items() if GPL.search(said)} <= NAMED[""]


def test_extras_name_their_parts_under_the_gpl():
    wanted = requirements()
    for extra, listed in wanted.items():
        if extra == "all":
            continue
        copyleft = {name for name, said in installed(listed).items() if GPL.search(said)}
        assert copyleft <= NAMED.get(extra, set()) | NAMED[""], extra
    text = PROJECT.read_text(encoding="utf-8")
    for extra in NAMED.keys() - {""}:
        assert re.search(rf"#[^\n]*GPL[^\n]*\n(#[^\n]*\n)*{extra} = ", text), extra


def test_no_extra_under_the_gpl_is_among_all():
    (listed,) = requirements()["all"]
    assert not {"film", "peers"} & set(Requirement(listed).extras)


def test_alternatives_leave_the_choice():
    assert GPL.search("GNU Lesser General Public License v3 (LGPLv3)") and GPL.search("GPLv3")
    assert not GPL.search("MIT")
