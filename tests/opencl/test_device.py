"""Devices and their drivers; programs, and the cache of built ones."""

import logging
import os
import stat
import subprocess
import sys
import tempfile
import threading

import numpy as np
import pytest
from plain_scenes import refused

from lfcore import DeviceError
from lfcore.opencl import device as devices
from lfcore.opencl import drivers, program_cache, programs
from lfcore.opencl.device import cl, open_device
from lfcore.opencl.interface import SHARED
from lfcore.opencl.programs import build_early, build_program
from lfcore.progress import watching

IMPORTS = """
import importlib, os, pkgutil, signal, sys
import lfcore
def load():
    for module in pkgutil.walk_packages(lfcore.__path__, "lfcore."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
load()  # what others need of the system is not ours to mend
for name in [name for name in sys.modules if name.split(".")[0] == "lfcore"]:
    del sys.modules[name]
for name in "fcntl grp pty pwd resource syslog termios tty".split():
    sys.modules[name] = None
POSIX = "execv fork geteuid getpgid getuid killpg mkfifo nice sched_getaffinity setsid wait4"
for name in POSIX.split():
    delattr(os, name)
for name in "SIGALRM SIGHUP SIGKILL SIGPIPE SIGQUIT SIGUSR1 SIGUSR2 alarm pthread_kill".split():
    delattr(signal, name)
import lfcore
load()
print(len([name for name in sys.modules if name.split(".")[0] == "lfcore"]))
"""


@pytest.mark.slow
def test_every_module_is_imported_where_windows_and_macos_have_less():
    run = [sys.executable, "-c", IMPORTS]
    found = subprocess.run(run, capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    assert int(found.stdout) > 150


@pytest.fixture
def windows(tmp_path, monkeypatch):
    """An environment of Windows with Intel's runtime; its loader reads a list of libraries."""
    library = tmp_path / "Library" / "bin" / "intelocl64.dll"
    library.parent.mkdir(parents=True)
    library.touch()
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(os, "add_dll_directory", lambda folder: None, raising=False)
    monkeypatch.delenv("OCL_ICD_FILENAMES", raising=False)
    monkeypatch.setenv("PATH", "before")
    return library


def test_intels_runtime_is_found_on_windows_without_the_registry(windows, monkeypatch):
    drivers.prepare()
    assert os.environ["OCL_ICD_FILENAMES"] == str(windows)
    assert os.environ["PATH"].split(os.pathsep) == [str(windows.parent), "before"]
    monkeypatch.setenv("OCL_ICD_FILENAMES", "mine.dll")
    drivers.prepare()
    assert os.environ["OCL_ICD_FILENAMES"] == "mine.dll"
    monkeypatch.delenv("OCL_ICD_FILENAMES")
    windows.unlink()
    drivers.prepare()
    assert "OCL_ICD_FILENAMES" not in os.environ


def test_drivers_of_an_environment_are_found_and_places_that_are_none_left_out(
    tmp_path, monkeypatch
):
    vendors, library = tmp_path / "etc" / "OpenCL" / "vendors", tmp_path / "libpocl.so"
    vendors.mkdir(parents=True)
    library.touch()
    (vendors / "pocl.icd").write_text(f"{library}\n")
    (vendors / "intel-cpu.icd").write_text("/opt/anaconda1anaconda2/lib/libintelocl.so\n")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(drivers, "SYSTEM_VENDORS", tmp_path / "none")
    found = drivers._entries()
    assert found["pocl.icd"] == str(library) and "intel-cpu.icd" not in found


def test_a_folder_of_drivers_that_others_can_fill_is_not_used(tmp_path, monkeypatch):
    """Neither one of a name that anybody can compute, nor one into which others may write."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    entries = {"a.icd": "liba.so"}
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    first, second = drivers._write(entries), drivers._write(entries)
    assert first != second and {first.parent, second.parent} == {tmp_path}
    assert stat.S_IMODE(first.stat().st_mode) == 0o700
    assert [icd.read_text() for icd in first.iterdir()] == ["liba.so\n"]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    own = drivers._write(entries)
    assert own == drivers._write(entries) and own.is_relative_to(tmp_path / "home")
    own.chmod(0o777)
    (own / "planted.icd").write_text("/tmp/evil.so\n")
    (own / "a.icd").write_text("/tmp/evil.so\n")
    assert drivers._write(entries) == own and stat.S_IMODE(own.stat().st_mode) == 0o700
    assert [icd.read_text() for icd in own.iterdir()] == ["liba.so\n"]
    own.parent.chmod(0o777)
    assert not drivers._write(entries).is_relative_to(tmp_path / "home")


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="needs two users")
def test_a_folder_that_another_user_owns_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    path = tmp_path / "lfcore" / "programs"
    path.mkdir(parents=True)
    os.chown(path, 65534, 65534)
    program_cache.folder.cache_clear()
    assert program_cache.folder() is None
    os.chown(path, 0, 0)
    program_cache.folder.cache_clear()
    assert program_cache.folder() == path
    program_cache.folder.cache_clear()


LANES = "opencl/kernels/lanes.cl"


def test_a_device_is_chosen_by_part_of_its_name_with_threads_and_lanes_that_it_has(device):
    assert open_device(device.name[1:-1].upper()).name == device.name
    refused(r"named like 'abacus'.*Found: .*", open_device, "abacus")
    name = device.name
    assert open_device(name, threads=1).threads == 1
    assert open_device(name, threads=10**6).threads == open_device(name).threads
    assert open_device(name, lanes=4).lanes == 4
    refused("not 3", open_device, name, lanes=3)


@pytest.mark.parametrize("text", ["abc", "-1", "1.5", "٣"])
def test_a_number_of_threads_that_is_none_is_said(device, monkeypatch, text):
    monkeypatch.setenv("LFCORE_THREADS", text)
    refused(r"LFCORE_THREADS: must be a number.*Set this", open_device, device.name)
    monkeypatch.setenv("LFCORE_THREADS", "")
    assert open_device(device.name).threads == device.threads


def test_a_program_is_built_once_for_each_set_of_options(device):
    name = device.name
    again, narrow = open_device(name), open_device(name, lanes=1)
    assert again.queue != device.queue, "threads must not share a queue"
    assert build_program(device, [LANES]) is build_program(again, [LANES])
    assert build_program(device, [LANES], {"X": 1}) is not build_program(device, [LANES])
    assert build_program(narrow, [LANES]) is not build_program(open_device(name, lanes=4), [LANES])


def test_what_cannot_be_built_says_why(device):
    with pytest.raises(DeviceError, match=r"cannot build .*lanes\.cl: .*float5.*Update") as refused:
        build_program(device, [LANES], {"LANES": 5})
    assert device.device.driver_version.strip() in str(refused.value)
    assert len(str(refused.value.__cause__)) > len(str(refused.value))


@pytest.mark.kernels
def test_early_programs_are_those_that_are_built_later(monkeypatch):
    """One is built once, beside the main thread; one that cannot be is tried again there."""
    monkeypatch.setattr(program_cache, "folder", lambda: None)
    device, built = open_device(), []
    programs = [([LANES], {"EARLY": k, "LANES": lanes}, SHARED) for k, lanes in ((1, 4), (2, 5))]

    def tell(name, begins):
        if begins:
            built.append(threading.current_thread() is threading.main_thread())

    with watching(tell):
        build_early(device, programs)
        assert isinstance(build_program(device, *programs[0]), cl.Program)
        with pytest.raises(DeviceError, match="cannot build"):
            build_program(device, *programs[1])
    assert built == [False, False, True]


@pytest.mark.kernels
def test_a_forked_process_does_not_wait_for_early_programs(monkeypatch):
    arguments = programs._arguments(open_device(), [LANES], {"FORKED": 1}, SHARED)
    ended = threading.Thread(target=int)
    ended.start()
    ended.join()
    monkeypatch.setitem(programs._early, arguments, (ended, threading.Event()))
    assert isinstance(build_program(open_device(), [LANES], {"FORKED": 1}), cl.Program)


@pytest.mark.parametrize("nbytes", [0, 8, 5000])
def test_a_buffer_of_zeros_is_read_as_it_is_filled(device, nbytes):
    buffer, count = device.zeros(nbytes), max(nbytes, 64) // 8
    with device.mapped(buffer, (count,), np.uint64) as held:
        assert (held == 0).all()
    changed = np.arange(count, dtype=np.uint64)
    cl.enqueue_copy(device.queue, buffer, changed)
    with device.mapped(buffer, (count,), np.uint64) as held:
        assert (held == changed).all()


def test_zeros_fill_a_buffer_to_its_last_word_on_any_device(device, monkeypatch):
    monkeypatch.setattr(devices, "is_cpu", lambda _: False)
    ones = device.writable(np.full(68, 255, np.uint8))
    monkeypatch.setattr(devices.Device, "empty", lambda self, nbytes: ones)
    with device.mapped(device.zeros(68), (17,), np.int32) as held:
        assert not held.any()


def test_memory_that_is_given_back_holds_zeros_on_linux(device):
    if not (device.is_cpu and sys.platform == "linux"):
        pytest.skip("of a CPU's memory on Linux")
    count = 5 * 1024  # whole pages
    buffer = device.zeros(8 * count, sparse=True)
    cl.enqueue_copy(device.queue, buffer, np.ones(count, np.uint64))
    device.forget(buffer, 1, 2)
    with device.mapped(buffer, (count,), np.uint64) as held:
        assert held[: count // 2].all() and not held[count // 2 :].any()


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
    devices.compiled.cache_clear()
    program = devices.compiled(device.context, source, (), ())
    number, buffer = np.array([21], np.int32), device.writable(np.array([21], np.int32))
    cl.Kernel(program, "twice")(device.queue, (1,), None, buffer)
    cl.enqueue_copy(device.queue, number, buffer)
    return int(number[0])


def entries(cache):
    return sorted(cache.glob("*.bin"))


DAMAGE = {
    "empty": lambda whole: b"",
    "half written": lambda whole: whole[: len(whole) // 2],
    "a bit": lambda whole: whole[:-1] + bytes([whole[-1] ^ 1]),
    "foreign": lambda whole: b"another program's\n" + whole,
}


@pytest.mark.parametrize("damage", [*DAMAGE, "refused by the driver"])
def test_damaged_entries_are_built_again(device, cache, damage):
    assert twice(device) == 42
    (entry,), told = entries(cache), []
    if damage in DAMAGE:
        entry.write_bytes(DAMAGE[damage](entry.read_bytes()))
    else:
        program_cache._write(entry, b"no program of any driver's")
    with watching(lambda name, begins: told.append(begins)):
        assert twice(device) == 42
        assert twice(device) == 42
    twice(device, SOURCE + " // another")
    assert told == [True, False], "built once, whole again, and told while watched"


def test_entries_that_were_exchanged_are_built_again(device, cache):
    other = SOURCE.replace("twice", "thrice")
    assert twice(device) == 42
    (first,) = entries(cache)
    devices.compiled(device.context, other, (), ())
    (second,) = set(entries(cache)) - {first}
    one, two = first.read_bytes(), second.read_bytes()
    first.write_bytes(two)
    second.write_bytes(one)
    assert twice(device) == 42
    assert first.read_bytes() != two


def test_every_thing_that_a_binary_depends_on_is_in_its_name(device, cache, monkeypatch):
    one = device.device

    assert program_cache.instruction_set()
    things = (SOURCE, ()), (SOURCE + " ", ()), (SOURCE, ("-DX=1",))
    names = {program_cache.key(one, *thing) for thing in things}
    monkeypatch.setattr(program_cache, "instruction_set", lambda: "avx2")
    names.add(program_cache.key(one, SOURCE, ()))
    monkeypatch.setenv("CL_CONFIG_CPU_TARGET_ARCH", "any that is not set now")
    names.add(program_cache.key(one, SOURCE, ()))
    assert len(names) == 5


def test_included_files_are_in_the_name_too(tmp_path):
    (tmp_path / "a.cl").write_text('#include "b.cl"\n')
    (tmp_path / "b.cl").write_text("int x;")
    before = program_cache.expanded('#include "a.cl"', [str(tmp_path)])
    assert "int x;" in before
    (tmp_path / "b.cl").write_text("int y;")
    assert program_cache.expanded('#include "a.cl"', [str(tmp_path)]) != before


def test_without_a_folder_one_line_is_logged_and_programs_work(device, monkeypatch, caplog):
    twice(device)  # pyopencl's first call of a kernel makes a folder of its own
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    program_cache.folder.cache_clear()
    with caplog.at_level(logging.WARNING):
        assert [twice(device), twice(device)] == [42, 42]
    program_cache.folder.cache_clear()
    (record,) = caplog.records
    assert "no folder" in record.message and "XDG_CACHE_HOME" in record.message


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
    refused("broken", devices._choose, "another")


def test_threads_where_the_system_does_not_tell_which_processors_are_ours(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert open_device().threads in (7, int(os.environ.get("LFCORE_THREADS") or 7))
