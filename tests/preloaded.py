"""All that commands import: imported once, by the server that forks `tests.fork_server`'s."""

import contextlib
import gc
import importlib
import pkgutil

import phyblock.cli
from phyblock.config.suite import suite_model
from phyblock.models.litellm_client import _litellm
from phyblock.records.files import known_records
from phyblock.results.text import latex_template

_PRELOADED = (
    *("PIL.GifImagePlugin", "PIL.JpegPresets", "aiohttp", "matplotlib.backends.backend_agg"),
    *("matplotlib.backends.backend_svg", "matplotlib.pyplot", "pandas.core.methods.to_dict"),
    *("pandas.io.formats.csvs", "phyblock.run.runner", "phyblock.results.tables"),
    *("phyblock.making.cli", "phyblock.sim.pybullet", "phyblock.web.pages"),
    *("pyarrow.pandas_compat", "sqlite3", "yarl"),
)

for module in pkgutil.iter_modules(phyblock.cli.__path__, "phyblock.cli."):
    importlib.import_module(module.name)
for name in _PRELOADED:
    # Other Pythons have neither PyBullet nor what only development needs.
    with contextlib.suppress(ModuleNotFoundError):
        importlib.import_module(name)
for prepare in (_litellm, suite_model, known_records, latex_template):
    prepare()
gc.collect()
gc.freeze()
