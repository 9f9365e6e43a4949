"""Run the workflow once for each row of a sweep, and join the tables of all runs.

    python -m workflow.sweep config/sweeps/crf.tsv --cores 2

A sweep is a table of tab-separated values: the column ``case`` names a run, every other column is
a key of the configuration (``encoder.crf`` for a key within a key) and every cell its value, in
YAML.  Case by case the results are in results/sweeps/<sweep>/<case>/, where a second run finds
them; the joined tables are beside them, with the sweep's columns before the table's own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pandas as pd
import yaml

from lfcore.errors import LfcoreError
from lfcore.evaluation.table_files import write_csv
from lfcore.files import write_text
from workflow.settings import SettingsError, check_settings

ROOT = Path(__file__).resolve().parents[1]


def read_sweep(path: Path) -> dict[str, dict[str, object]]:
    """Of each case the keys and values that it overrides, keys with dots as in the file.

    Raises :class:`SettingsError` for a table without cases, and two cases of one name.
    """
    try:
        table = pd.read_csv(path, sep="\t", dtype=str, comment="#", keep_default_na=False)
    except (OSError, ValueError) as error:
        raise SettingsError(f"cannot be read: {error}", file=path) from None
    if "case" not in table.columns or table.empty:
        raise SettingsError("a sweep needs a column 'case' and at least one row", file=path)
    repeated = table.case[table.case.duplicated()]
    if len(repeated):
        raise SettingsError(f"two cases are called {repeated.iloc[0]!r}", file=path)
    return {
        row["case"]: {key: yaml.safe_load(text) for key, text in row.items() if key != "case"}
        for row in table.to_dict("records")
    }


def nested(flat: dict[str, object]) -> dict:
    """``{"encoder.crf": 20}`` as ``{"encoder": {"crf": 20}}``."""
    result: dict = {}
    for key, value in flat.items():
        *above, last = key.split(".")
        inner = result
        for name in above:
            inner = inner.setdefault(name, {})
        inner[last] = value
    return result


def merged(base: dict, overrides: dict) -> dict:
    """``base`` with ``overrides``, mapping by mapping."""
    result = dict(base)
    for key, value in overrides.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = merged(result[key], value) if both else value
    return result


def run_case(folder: Path, config: dict, arguments: list[str]) -> None:
    """One run of the workflow in ``folder``; raises CalledProcessError when it fails."""
    file = folder / "config.yaml"
    write_text(file, yaml.safe_dump(config, sort_keys=False))
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    command += ["--directory", str(folder), *arguments]
    command += ["--configfile", str(file.resolve()), "--", "results/tables/"]
    subprocess.run(command, check=True, cwd=ROOT)


def join_tables(folder: Path, cases: dict[str, dict[str, object]]) -> list[Path]:
    """Write each table of all cases together, with the sweep's columns in front."""
    joined: dict[str, list[pd.DataFrame]] = {}
    for case, overrides in cases.items():
        for csv in sorted((folder / case / "results" / "tables").glob("*.csv")):
            table = pd.read_csv(csv)
            for position, (key, value) in enumerate({"case": case, **overrides}.items()):
                table.insert(position, key if key not in table else f"config.{key}", str(value))
            joined.setdefault(csv.name, []).append(table)
    for name, tables in joined.items():
        write_csv(folder / name, pd.concat(tables, ignore_index=True))
    return [folder / name for name in joined]


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m workflow.sweep",
        description="Run the workflow once for each row of a sweep, and join the tables.",
        epilog="Further arguments go to snakemake, e.g. --cores 2 or --dry-run.",
    )
    parser.add_argument("sweep", type=Path, help="tab-separated table of cases")
    parser.add_argument(
        "--base",
        type=Path,
        default=ROOT / "config" / "config.yaml",
        help="configuration that the cases override (default: %(default)s)",
    )
    options, arguments = parser.parse_known_args(argv)
    try:
        cases = read_sweep(options.sweep)
        base = yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))
        base = merged(base, yaml.safe_load(options.base.read_text(encoding="utf-8")))
        configs = {case: merged(base, nested(values)) for case, values in cases.items()}
        for config in configs.values():
            check_settings(config)
        folder = ROOT / "results" / "sweeps" / options.sweep.stem
        for case, config in configs.items():
            run_case(folder / case, config, arguments or ["--cores", "2"])
        for table in join_tables(folder, cases):
            print(table)
    except LfcoreError as error:
        print(error, file=sys.stderr)
        return 1
    except subprocess.CalledProcessError as error:
        return error.returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
