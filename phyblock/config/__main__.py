"""`python -m phyblock.config [FOLDER]`: rewrite the JSON Schemas from the models."""

from __future__ import annotations

import sys
from pathlib import Path

from phyblock.config.schema import write_schemas

if __name__ == "__main__":
    beside = Path(__file__).parents[2] / "benchmarks" / "schemas"
    for written in write_schemas(Path(sys.argv[1]) if len(sys.argv) > 1 else beside):
        sys.stdout.write(f"{written}\n")
