"""Where the tests have run: a row per system, Python, driver and choice of tests, kept by the run.

make test SUPPORT=yes
"""

import datetime
import platform

import pandas as pd

from benchmarks.publish import RESULTS, Result, of_this_run, read_result

KEY = ["system", "Python", "OpenCL drivers", "tests"]


def keep(devices: list[str], chosen: str, counts: dict[str, int]) -> None:
    """Replace or add the row of this run in ``published/support.csv``.

    A device is ``NAME (DRIVER)``; a row has the driver.
    """
    run = of_this_run(f"SUPPORT=yes pytest {chosen}")
    system = f"{platform.system()} {platform.machine()}"
    today = datetime.date.today().isoformat()
    names = [device.partition(" (")[2].removesuffix(")") for device in devices]
    identity = [system, platform.python_version(), ", ".join(names), chosen]
    row = dict(zip(KEY, identity, strict=True)) | {
        name: str(counts.get(name, 0)) for name in ("passed", "failed", "skipped")
    }
    rows = pd.DataFrame([row | {"date": today, "commit": run["commit"]}])
    file = RESULTS / "support.csv"
    if file.exists():
        rows = pd.concat([read_result(file).rows, rows]).drop_duplicates(KEY, keep="last")
    Result(run, rows).write(file)
