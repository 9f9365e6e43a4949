"""Find OpenCL drivers on a bare machine, before ``pyopencl`` is imported.

``pyopencl`` has a loader and no driver.  The Intel CPU runtime is a wheel whose ``.icd`` has a
placeholder path, and a GPU's driver may be installed without an ``.icd``.  The loader reads a
single directory, ``OCL_ICD_VENDORS``: this module fills one with the drivers of the machine.
"""

import atexit
import contextlib
import ctypes
import hashlib
import os
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path

from lfcore.errors import StorageError
from lfcore.files import write_text
from lfcore.opencl.program_cache import cache_home, own_folder

SYSTEM_VENDORS, NVIDIA = Path("/etc/OpenCL/vendors"), "libnvidia-opencl.so.1"


def prepare() -> Path | None:
    """Point the OpenCL loader at every driver found, and return the directory.

    A user's ``OCL_ICD_VENDORS`` stays (returns None).  On Windows the loader reads the libraries in
    ``OCL_ICD_FILENAMES``, then the registry.
    """
    if sys.platform == "win32":
        return _prepare_windows()
    if os.environ.get("OCL_ICD_VENDORS") and "LFCORE_ICD_VENDORS" not in os.environ:
        return None
    entries = _entries()
    if not entries:
        return None
    directory = _write(entries)
    if directory is None:
        return None
    os.environ["OCL_ICD_VENDORS"] = os.environ["LFCORE_ICD_VENDORS"] = f"{directory}/"
    return directory


def _prepare_windows() -> None:
    intel = Path(sys.prefix) / "Library" / "bin" / "intelocl64.dll"
    if intel.exists() and "OCL_ICD_FILENAMES" not in os.environ:
        os.environ["OCL_ICD_FILENAMES"] = str(intel)
        # The runtime's libraries are beside it: its loader needs the first, its compiler the rest.
        if sys.platform == "win32":  # for the type checker: only Windows has this function
            os.add_dll_directory(str(intel.parent))
        os.environ["PATH"] = os.pathsep.join([str(intel.parent), os.environ["PATH"]])


def _entries() -> dict[str, str]:
    """``.icd`` name -> library path, in the order of preference."""
    entries: dict[str, str] = {}
    intel = Path(sys.prefix) / "lib" / "libintelocl.so"
    if intel.exists():
        entries["lfcore-intel.icd"] = str(intel)
    wheel = Path(sysconfig.get_paths()["platlib"]) / "pyopencl" / ".libs"
    environment = Path(sys.prefix) / "etc" / "OpenCL" / "vendors"  # conda's
    for folder in (SYSTEM_VENDORS, environment, wheel):
        for icd in sorted(folder.glob("*.icd")) if folder.is_dir() else ():
            library = icd.read_text(encoding="utf-8", errors="replace").strip()
            exists = library and (not os.path.isabs(library) or os.path.exists(library))
            if exists and library not in entries.values():
                entries[icd.name] = library
    if not any("nvidia" in library for library in entries.values()):
        with contextlib.suppress(OSError):
            ctypes.CDLL(NVIDIA)
            entries["lfcore-nvidia.icd"] = NVIDIA
    return entries


def _write(entries: dict[str, str]) -> Path | None:
    """Write the vendor directory once per set of entries; safe against parallel jobs.

    Only the user can write to it: a predictable name, such as one below ``TMPDIR``, may be another
    user's.
    """
    digest = hashlib.sha256(repr(sorted(entries.items())).encode()).hexdigest()[:16]
    for make in (lambda: own_folder(cache_home() / "lfcore" / f"opencl-vendors-{digest}"), _fresh):
        with contextlib.suppress(StorageError, OSError):
            directory = make()
            for name, library in entries.items():
                path = directory / name
                if not path.exists() or path.read_text(encoding="utf-8") != f"{library}\n":
                    write_text(path, f"{library}\n")
            return directory
    return None


def _fresh() -> Path:
    directory = Path(tempfile.mkdtemp(prefix="lfcore-opencl-"))
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    return directory
