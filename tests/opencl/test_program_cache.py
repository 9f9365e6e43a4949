"""The cache of built programs: whose entries they are, what damage does, who builds, how large."""

import logging
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lfcore.errors import DeviceError
from lfcore.opencl import device as devices
from lfcore.opencl import program_cache
from lfcore.opencl.device import cl, open_device

SOURCE = "kernel void twice(global int *x) { *x *= 2; }"


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache, which this process has not looked into."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    program_cache.folder.cache_clear()
    yield tmp_path / "lfcore" / "programs"
    program_cache.folder.cache_clear()


def twice(device, source=SOURCE):
    """21, doubled by a program that is not in this process's memory."""
    devices._compile.cache_clear()
    program = devices._compile(device.context, source, (), ())
    number, buffer = np.array([21], np.int32), device.changed(np.array([21], np.int32))
    cl.Kernel(program, "twice")(device.queue, (1,), None, buffer)
    cl.enqueue_copy(device.queue, number, buffer)
    return int(number[0])


def entries(cache):
    return sorted(cache.glob("*.bin"))


def count_builds(monkeypatch):
    built = []
    monkeypatch.setattr(program_cache, "_watchers", [lambda begins: begins and built.append(1)])
    return built


DAMAGE = {
    "empty": lambda whole: b"",
    "half written": lambda whole: whole[: len(whole) // 2],
    "a bit": lambda whole: whole[:-1] + bytes([whole[-1] ^ 1]),
    "foreign": lambda whole: b"another program's\n" + whole,
}


@pytest.mark.parametrize("damage", [*DAMAGE, "refused by the driver"])
def test_damaged_entries_are_built_again(device, cache, monkeypatch, damage):
    assert twice(device) == 42
    (entry,) = entries(cache)
    if damage in DAMAGE:
        entry.write_bytes(DAMAGE[damage](entry.read_bytes()))
    else:
        program_cache._write(entry, b"no program of any driver's")
    built = count_builds(monkeypatch)
    assert twice(device) == 42
    assert len(built) == 1
    assert program_cache._read(entry, lambda binary: binary) is not None, "it is whole again"


def test_every_thing_that_a_binary_depends_on_is_in_its_name(device, cache, monkeypatch):
    one = device.device

    def names():
        yield program_cache.key(one, SOURCE, ())
        yield program_cache.key(one, SOURCE + " ", ())
        yield program_cache.key(one, SOURCE, ("-DX=1",))
        with monkeypatch.context() as patch:
            patch.setattr(program_cache, "instruction_set", lambda: "avx2")
            yield program_cache.key(one, SOURCE, ())
        with monkeypatch.context() as patch:
            patch.setenv("CL_CONFIG_CPU_TARGET_ARCH", "any that is not set now")
            yield program_cache.key(one, SOURCE, ())

    assert len(set(names())) == 5
    assert program_cache.instruction_set()


def test_included_files_are_in_the_name_too(tmp_path):
    (tmp_path / "a.cl").write_text('#include "b.cl"\n')
    (tmp_path / "b.cl").write_text("int x;")
    before = program_cache.expanded('#include "a.cl"', [str(tmp_path)])
    assert "int x;" in before
    (tmp_path / "b.cl").write_text("int y;")
    assert program_cache.expanded('#include "a.cl"', [str(tmp_path)]) != before


def test_without_a_folder_one_line_is_logged_and_programs_work(device, monkeypatch, caplog):
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    program_cache.folder.cache_clear()
    with caplog.at_level(logging.WARNING):
        assert [twice(device), twice(device)] == [42, 42]
    program_cache.folder.cache_clear()
    assert [record.message for record in caplog.records if "no folder" in record.message] == [
        line.message for line in caplog.records
    ]
    assert len(caplog.records) == 1


RUN_ONE = """
import numpy as np
from lfcore.opencl.device import build_program, cl, open_device
device = open_device()
buffer = device.buffer(np.ones(16, np.float32))
kernel = cl.Kernel(build_program(device, ["FILE"]), "round_all")
kernel(device.queue, (1,), None, *[buffer] * 2, *[device.empty(64) for _ in range(3)])
device.queue.finish()
"""


def test_kernels_run_without_a_home():
    """pyopencl keeps files of its own there, which fails in other ways."""
    code = RUN_ONE.replace("FILE", str(Path(__file__).with_name("rounding.cl")))
    home = {"HOME": "/dev/null", "PATH": os.environ["PATH"]}
    found = subprocess.run([sys.executable, "-c", code], env=home, capture_output=True, text=True)
    assert found.returncode == 0
    assert len(found.stderr.splitlines()) == 1 and "XDG_CACHE_HOME" in found.stderr


BUILD_ONE = """
import sys, time
from pathlib import Path
from lfcore.opencl import program_cache
def build():
    with open(sys.argv[1], "a") as log:
        log.write("built\\n")
    time.sleep(0.3)
    return "program", b"binary"
print(program_cache.cached("ab" * 32, lambda binary: binary.decode(), build))
"""


def test_of_many_processes_one_builds_and_the_others_wait(cache, tmp_path):
    command = [sys.executable, "-c", BUILD_ONE, str(tmp_path / "log")]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(5)]
    found = sorted(process.communicate()[0].strip() for process in running)
    assert found == ["binary"] * 4 + ["program"]
    assert (tmp_path / "log").read_text() == "built\n"


def test_entries_that_were_not_used_for_longest_make_room(cache, monkeypatch):
    cache.mkdir(parents=True)
    monkeypatch.setattr(program_cache, "LIMIT_BYTES", 10_000)
    for number in range(20):
        entry = cache / f"{number:02}.bin"
        program_cache._write(entry, bytes(900))
        os.utime(entry, (number, number))
        if number > 4 and (cache / "03.bin").exists():
            os.utime(cache / "03.bin", (number, number))  # in use all the time
    left = [entry.name for entry in entries(cache)]
    assert "03.bin" in left and "19.bin" in left and "00.bin" not in left
    assert sum(entry.stat().st_size for entry in entries(cache)) <= 10_000


def test_what_watches_is_told_when_a_program_is_built(device, cache):
    told = []
    with program_cache.watching(told.append):
        twice(device)
        twice(device)
    twice(device, SOURCE + " // another")
    assert told == [True, False]


def test_a_processor_is_the_default(monkeypatch):
    class Kind:
        def __init__(self, name, kind):
            self.name, self.type, self.platform = name, kind, self
            self.driver_version = self.version = "1"

        def get_devices(self):
            return [self]

    names = {"fast": "GPU", "plain": "CPU", "another": "CPU", "best": "CPU"}
    platforms = [Kind(name, getattr(cl.device_type, kind)) for name, kind in names.items()]
    monkeypatch.setattr(cl, "get_platforms", lambda: platforms)
    monkeypatch.setattr(devices, "all_devices", devices.all_devices.__wrapped__)
    monkeypatch.setattr(devices, "_fault", lambda device: "broken" * (device.name == "another"))
    assert devices._choose(None).name == "best"  # the first driver by name
    assert devices._choose("FAST").name == "fast"
    assert devices._choose("plain (plain 1)").name == "plain"
    with pytest.raises(DeviceError, match="broken"):
        devices._choose("another")


def test_threads_where_the_system_does_not_tell_which_processors_are_ours(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert open_device().threads in (7, int(os.environ.get("LFCORE_THREADS") or 7))
