"""Make the built-in data set anew: `python -m phyblock.generate [FOLDER]`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from phyblock.errors import InputError
from phyblock.generate.dataset import designed_scenes, write_dataset


def main(arguments: list[str] | None = None) -> int:
    """Check and write the data set; returns the exit code (2: a scene or the folder is bad)."""
    parser = argparse.ArgumentParser(prog="python -m phyblock.generate", description=__doc__)
    parser.add_argument(
        "folder", nargs="?", type=Path, default=Path("benchmarks/data/phyblock-mini")
    )
    folder: Path = parser.parse_args(arguments).folder
    try:
        count = write_dataset(folder, designed_scenes())
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{count} scenes, all checks passed: {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
