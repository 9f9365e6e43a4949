"""Where the tests have run: a row per system, Python, driver and choice of tests, kept by the run.

make test SUPPORT=yes
"""

import platform

import pandas as pd

from benchmarks.results import RESULTS, Result, of_this_run, with_kept

KEY = ["system", "Python", "OpenCL drivers", "tests"]


def keep(devices: list[str], chosen: str, counts: dict[str, int]) -> None:
    """Replace or add the row of this run in ``published/support.csv``.

    A device is ``NAME (DRIVER)``; a row has the driver.
    """
    run = of_this_run(f"SUPPORT=yes pytest {chosen}")
    system = f"{platform.system()} {platform.machine()}"
    names = [device.partition(" (")[2].removesuffix(")") for device in devices]
    identity = [system, platform.python_version(), ", ".join(names), chosen]
    row = dict(zip(KEY, identity, strict=True)) | {
        name: str(counts.get(name, 0)) for name in ("passed", "failed", "skipped")
    }
    file = RESULTS / "support.csv"
    Result(run, with_kept(pd.DataFrame([row | {"date": run["date"]}]), file, *KEY)).write(file)
