"""The compile gate: what is in order passes, and each of its faults is found."""

import json
import re

import pytest
import touched


@pytest.fixture
def gate(tool):
    gate = tool("compile_gate")
    missing = tool("portability.offline").why_not()
    if missing:
        pytest.skip(missing)
    return gate


def run(gate, *kernels):
    return gate.main(gate.Options(only=kernels))


def test_kernels_compile_and_fit(gate):
    assert run(gate, "radon_project", "radon_resample", "splat_raster_gpu", "rays_unweigh") == 0


def test_what_is_no_opencl_c_fails_on_every_target(gate, tool, monkeypatch, capsys):
    offline = tool("portability.offline")
    source = offline.kernel_source("axpby").replace("get_global_id", "no_such_function")
    monkeypatch.setattr(offline, "kernel_source", lambda name: source)
    assert run(gate, "axpby") == 1
    printed = capsys.readouterr().out
    for target in offline.TARGETS:
        assert f"{target}: axpby gpu: vector/axpby.cl:" in printed


@pytest.mark.parametrize(("kernel", "what"), [("rays_read", "vgprs"), ("ssim_map", "local")])
def test_more_than_is_held_fails(gate, monkeypatch, kernel, what, capsys):
    held = gate._held()
    held[kernel][what] //= 2
    monkeypatch.setattr(gate, "_held", lambda: held)
    assert run(gate, kernel) == 1
    assert f"{kernel}: " in capsys.readouterr().out


def test_a_kernel_that_is_held_nowhere_fails(gate, monkeypatch):
    monkeypatch.setattr(gate, "_held", dict)
    assert run(gate, "axpby") == 1


def test_every_kernel_has_variants_for_its_kinds_of_device(tool):
    found = tool("portability.variants").variants()
    kinds = {"splat_raster_gpu": {"gpu"}, "splat_raster_cpu": {"cpu"}, "adam": {"cpu", "gpu"}}
    for kernel, wanted in kinds.items():
        assert {variant.kind for variant in found if variant.kernel == kernel} == wanted
    assert len(set(found)) == len(found)


def test_kernels_are_built_with_macros_that_they_read(tool):
    """One that a kernel does not read has it compiled again for each of its values."""
    source = tool("portability.offline").kernel_source
    words = {}
    for variant in tool("portability.variants").variants():
        if variant.kernel not in words:
            words[variant.kernel] = set(re.findall(r"\w+", source(variant.kernel)))
        names = {macro.partition("=")[0] for macro in variant.macros}
        assert names <= words[variant.kernel], variant


def test_a_record_grows_and_forgets_kernels_that_are_gone(tmp_path, monkeypatch):
    path = tmp_path / "variants.json"
    path.write_text(json.dumps(["adam gpu OLD=1", "no_such_kernel cpu"]))
    monkeypatch.setattr(touched, "_variants", {"axpby cpu", "adam gpu OLD=1"})
    touched._record(path)
    assert json.loads(path.read_text()) == ["adam gpu OLD=1", "axpby cpu"]
