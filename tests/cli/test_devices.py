"""``lfcore devices``: each device is checked, also one whose driver compiles wrongly."""

import json
import re
import sys

import pytest

from lfcore.cli import main
from lfcore.evaluation import device_check

pytestmark = pytest.mark.kernels


def checked(device, monkeypatch, capsys):
    """What the command says of a device, which is chosen by its name."""
    monkeypatch.setenv("LFCORE_DEVICE", device.name)
    assert main(["devices", "--json"]) == 0
    (found,) = (one for one in json.loads(capsys.readouterr().out)["devices"] if one["default"])
    assert found["name"] == device.name
    return found["problem"]


def test_a_device_that_is_tested_passes(device, monkeypatch, capsys):
    assert checked(device, monkeypatch, capsys) == ""
    assert main(["devices"]) == 0
    out = capsys.readouterr().out
    assert f"\n* {device.name}, " in out and out.count("*") == 1


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ("-Dsqrt=fabs -D_cl_sqrt=_cl_fabs", "colours are wrong"),  # PoCL's name, too
        ("-Dfloat=nonsense", "cannot build a kernel.*nonsense.*Update"),
    ],
)
def test_a_driver_that_compiles_wrongly_fails(device, monkeypatch, capsys, options, problem):
    monkeypatch.setenv("PYOPENCL_BUILD_OPTIONS", options)
    assert re.search(problem, checked(device, monkeypatch, capsys))


def test_a_driver_that_ends_the_process_or_never_ends_is_said(monkeypatch):
    for code, said in (("os.abort()", "signal 6"), ("os._exit(3)", "ends the process")):
        command = [sys.executable, "-c", f"import os; {code}"]
        monkeypatch.setattr(device_check, "command", lambda name, line=command: line)
        assert said in device_check.check_apart("any")
    monkeypatch.setattr(device_check, "LONGEST_S", 0.01)
    assert "does not end" in device_check.check_apart("any")
