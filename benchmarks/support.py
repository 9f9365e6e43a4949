"""Where the tests have run: a row per system, Python, driver and choice of tests, kept by the run.

make test SUPPORT=yes
"""

import datetime
import platform

from benchmarks.results import RESULTS, update_result

KEY = ["system", "Python", "OpenCL drivers", "tests"]


def keep(devices: list[str], chosen: str, counts: dict[str, int]) -> None:
    """Replace or add the row of this run in ``published/support.csv``.

    A device is ``NAME (DRIVER)``; a row has the driver.
    """
    system = f"{platform.system()} {platform.machine()}"
    names = [device.partition(" (")[2].removesuffix(")") for device in devices]
    identity = [system, platform.python_version(), ", ".join(names), chosen]
    row = dict(zip(KEY, identity, strict=True))
    row |= {name: str(counts.get(name, 0)) for name in ("passed", "failed", "skipped")}
    row["date"] = datetime.date.today().isoformat()
    update_result(RESULTS / "support.csv", f"SUPPORT=yes pytest {chosen}", [row], *KEY)
