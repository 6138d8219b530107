"""A run as one file that others can score again: its manifest, its records, and their digests.

`archive` is the file, read within bounds; `about` what it says of itself; `portable` takes what is
of one machine out of a run, by `texts`; `write` makes a bundle and `verify` judges one.
"""

from phyblock.bundle.verify import Verified, opened_bundle
from phyblock.bundle.write import BUNDLE_FILE, bundle_run

__all__ = ["BUNDLE_FILE", "Verified", "bundle_run", "opened_bundle"]
