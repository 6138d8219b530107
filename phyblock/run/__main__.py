"""`python -m phyblock.run`: rewrite what the documentation says of lines of runs and data."""

import sys
from pathlib import Path

from phyblock.run.documents import write_documents

if __name__ == "__main__":
    for written in write_documents(Path(__file__).parents[2]):
        sys.stdout.write(f"{written}\n")
