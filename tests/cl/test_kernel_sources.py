"""Shipped kernels compile on their own and keep to the floor; their faults have an address."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

from rift_cl.cl import Device
from rift_cl.cl.build import source
from rift_cl.cl.build.kernel_features import feature_of
from rift_cl.errors import KernelBuildError

KERNELS = source.kernel_names()
# native_ and half_ differ on GPUs where PoCL shows nothing; fma is slow where there is none; the
# rest is not there on every device.
BANNED = "|".join(
    [
        r"native_\w+",
        r"half_(cos|sin|tan|divide|recip|exp\w*|log\w*|powr|sqrt|rsqrt)",
        r"fma|half\d*|double\d*|float16",
        r"atom\w*_\w+|image[123]d\w*|sub_group\w*|cl_khr_\w+",
        r"v?(load|store)a?_half\w*",
    ]
)


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """A copy of the kernels that a test may damage."""
    folder = tmp_path / "kernels"
    shutil.copytree(source.kernel_folder(), folder)
    monkeypatch.setattr(source, "kernel_folder", lambda: folder)
    source.kernel_source.cache_clear()
    yield folder
    source.kernel_source.cache_clear()


@pytest.fixture
def name(request, device):
    """A shipped kernel that has business on this kind of device."""
    driver = "cpu" if device.traits.is_cpu else "gpu"
    if request.param.endswith(("_cpu", "_gpu")) and not request.param.endswith(driver):
        pytest.skip("a driver for the other kind of device")
    return request.param


every_kernel = pytest.mark.parametrize("name", KERNELS, indirect=True)
# One of every room, with few includes and with many; which line stands where is proved for all of
# them without a compiler, by test_line_directives_map_every_line_to_its_file.
one_of_every_room = pytest.mark.parametrize(
    "name", ["adam", "axpby", "coverage_grad", "fft_pass", "radon_project", "splat_project_grad"]
)


@pytest.fixture
def fresh(device):
    """The same device with nothing built yet."""
    return Device(device._handle, device.selector, traits=device.traits)


def _build(device, name, **macros):
    return device._programs._builder.program((name, tuple(sorted(macros.items()))))


def test_there_are_kernels():
    assert {"radon_project", "radon_backproject", "plane_split", "plane_merge"} <= set(KERNELS)


@every_kernel
def test_kernel_compiles_with_its_own_defaults_for_a_fixed_small_work_group(device, name):
    import pyopencl as cl

    program = _build(device, name)
    assert name in program.kernel_names.split(";")
    kernel = cl.Kernel(program, name)
    info = cl.kernel_work_group_info
    group = kernel.get_work_group_info(info.COMPILE_WORK_GROUP_SIZE, device._handle)
    assert tuple(group) == (device.traits.macros["GROUP"], 1, 1)
    assert np.prod(group) <= 256
    # PoCL accepts local memory that a GPU refuses, so the limit is held here.
    assert kernel.get_work_group_info(info.LOCAL_MEM_SIZE, device._handle) <= 32 << 10


@pytest.mark.parametrize("name", KERNELS)
def test_kernel_keeps_to_the_floor(name):
    text = source.kernel_source(name)
    code = re.sub(r"/\*.*?\*/|//[^\n]*", "", text, flags=re.DOTALL)
    assert re.findall(rf"\bKERNEL\s+void\s+{name}\s*\(", code), "entry point named as its file"
    assert len(re.findall(r"\bKERNEL\s+void\b", code)) == 1, "one entry point"
    assert code.count("__kernel") == 1, "only through the KERNEL macro"
    assert "reqd_work_group_size(GROUP, 1, 1)" in code
    assert code.count("cl_khr_fp64") == 1, "doubles only where a launch asks for them"
    without_doubles = re.sub(r"^#if DOUBLE$.*?^#else$", "", code, flags=re.DOTALL | re.MULTILINE)
    assert not re.findall(rf"\b({BANNED})\b", without_doubles)


@pytest.mark.parametrize("path", sorted(source.kernel_folder().rglob("*.[ch]*"), key=str), ids=str)
def test_kernel_file_opens_with_prose(path):
    text = path.read_text(encoding="utf-8")
    comment = re.match(r"/\*(.+?)\*/", text, re.DOTALL)
    assert comment, "opens with a comment"
    assert len(comment[1].split()) >= 12, "which says what it does"
    assert "\t" not in text
    assert not re.findall(r"\b(TODO|FIXME|XXX)\b", text)


@pytest.mark.parametrize("name", KERNELS)
def test_line_directives_map_every_line_to_its_file(name):
    here, number, seen = "", 0, 0
    for line in source.kernel_source(name).splitlines():
        directive = re.fullmatch(r'#line (\d+) "(.+)"', line)
        if directive:
            here, number = directive[2], int(directive[1])
            continue
        original = (source.kernel_folder() / here).read_text(encoding="utf-8").splitlines()
        # A line that is blank here may be an include that was expanded before.
        assert line == original[number - 1] or original[number - 1].startswith("#include")
        number, seen = number + 1, seen + 1
    assert seen > 10


@pytest.mark.parametrize(
    "log", ["<kernel>:{}:5: error: no", "1:{}:5: Error: no", "x:{}: error: no"]
)
def test_a_compiler_that_counts_all_lines_is_understood(log):
    lines = source.kernel_source("radon_project").splitlines()
    for file in ("tomo/radon_project.cl", "include/transpose.h"):
        wanted = (source.kernel_folder() / file).read_text(encoding="utf-8").splitlines()
        unique = next(line for line in reversed(wanted) if lines.count(line) == 1 and line.strip())
        place = source.fault_place("radon_project", log.format(lines.index(unique) + 1))
        assert place == f"{file}:{wanted.index(unique) + 1}"
    assert source.fault_place("radon_project", "error: out of luck") == "radon_project.cl"
    assert source.fault_place("radon_project", "include/turn.h:7:1: error") == "include/turn.h:7"


def _message(device, name):
    with pytest.raises(KernelBuildError) as caught:
        _build(device, name)
    return str(caught.value)


@one_of_every_room
def test_undeclared_name_is_reported_at_its_own_file_and_line(fresh, kernels, name):
    path = next(kernels.rglob(f"{name}.cl"))
    lines = path.read_text().splitlines()
    # The last line of the kernel is its closing brace; the fault stands just before it.
    last = max(i for i, line in enumerate(lines) if line == "}")
    lines.insert(last, "  no_such_name = 1;")
    path.write_text("\n".join(lines))
    message = _message(fresh, name)
    assert f"at {path.parent.name}/{name}.cl:{last + 1};" in message
    assert "no_such_name" in message
    assert fresh.name in message
    assert "-cl-std=CL1.2" in message


@one_of_every_room
def test_missing_include_is_reported_by_name(fresh, kernels, name):
    path = next(kernels.rglob(f"{name}.cl"))
    path.write_text(path.read_text().replace("include/portable.h", "include/absent.h"))
    message = _message(fresh, name)
    assert "include/absent.h" in message
    assert "reinstall rift-cl" in message


@one_of_every_room
def test_error_in_a_header_is_reported_at_the_header(fresh, kernels, name):
    path = kernels / "include" / "portable.h"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines, "", "static int broken(void) { return no_such_name; }"]))
    assert f"at include/portable.h:{len(lines) + 2};" in _message(fresh, name)


def test_error_in_the_first_line_and_after_an_include(fresh, kernels):
    (kernels / "probe.cl").write_text('#include "include/portable.h"\nnonsense first;\n')
    assert "at probe.cl:2;" in _message(fresh, "probe")
    (kernels / "other.cl").write_text('nonsense\n#include "include/portable.h"\n')
    assert "at other.cl:1;" in _message(fresh, "other")


def test_include_is_expanded_once_and_cycles_end(kernels):
    (kernels / "include" / "a.h").write_text('#include "include/b.h"\nint a;\n')
    (kernels / "include" / "b.h").write_text('#include "include/a.h"\nint b;\n')
    (kernels / "probe.cl").write_text('#include "include/a.h"\n#include "include/b.h"\nint c;\n')
    lines = source.kernel_source("probe").splitlines()
    assert [line for line in lines if line.startswith("int")] == ["int b;", "int a;", "int c;"]
    assert lines[-3:] == ["", "", "int c;"] or '#line 2 "probe.cl"' in lines


def test_every_kernel_is_for_something_that_a_user_knows():
    for name in source.kernel_names():
        assert feature_of(name).endswith(f" (kernel {name})")
        assert not feature_of(name).startswith("RiFT-CL")
    assert (
        feature_of("hermite_dilate")
        == "X-ray fits and splats summed at voxels (kernel hermite_dilate)"
    )


def test_unknown_kernel_is_a_named_error(device):
    message = _message(device, "no_such_kernel")
    assert "no_such_kernel.cl is missing" in message


def test_kernel_without_its_entry_point_is_a_named_error(fresh, kernels):
    from rift_cl.errors import DeviceError

    (kernels / "probe.cl").write_text("__kernel void something_else(__global int *p) { *p = 1; }\n")
    with pytest.raises(DeviceError, match="probe"):
        fresh.launch("probe", (1,), p=fresh.zeros(1, np.int32))


@pytest.mark.full
def test_failed_build_leaves_the_device_usable(fresh, kernels):
    from rift_cl.cl.self_test import self_test

    (kernels / "probe.cl").write_text("nonsense\n")
    _message(fresh, "probe")
    assert self_test(fresh).passed


def test_macros_reach_the_kernel_with_their_type(device, kernels):
    (kernels / "probe.cl").write_text(
        "/* Divides. Buffers: p[1]. */\n"
        "__kernel void probe(__global float *p) { *p = VALUE / 2; }\n"
    )
    target = device.zeros(device.traits.macros["GROUP"])
    for value, wanted in ((3, 1.0), (3.0, 1.5), (np.float32(3), 1.5), (np.int64(3), 1.0)):
        device.launch("probe", (1,), p=target, VALUE=value)
        assert device.get(target)[0] == wanted, value


def test_two_kernels_of_one_name_are_refused(kernels):
    shutil.copy(kernels / "vector" / "axpby.cl", kernels / "train" / "axpby.cl")
    with pytest.raises(KernelBuildError, match=r"two .* axpby, in train/axpby\.cl and vector/axp"):
        source.kernel_source("axpby")


def test_a_misspelt_kernel_is_told_the_near_one():
    with pytest.raises(KernelBuildError, match="no kernel is called axpbi; did you mean axpby"):
        source.kernel_source("axpbi")


@pytest.mark.parametrize("there", ["x[size].", "y[size]"])
def test_a_buffer_without_a_shape_is_refused(kernels, device, there):
    """Its length could not be looked after, and a launch might overrun it."""
    path = kernels / "vector" / "clip_negative.cl"
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub(r"Buffers: [^*]*\*/", f"Buffers: {there} */", text), encoding="utf-8")
    fresh = Device(device._handle, device.selector, traits=device.traits)
    y = fresh.zeros(8)
    with pytest.raises(KernelBuildError, match=r"kernel clip_negative: .*shape"):
        fresh.launch("clip_negative", (1,), y=y, size=8, RUN=8, DOUBLE=0)
