"""Several runs as one leaderboard: a static folder that opens from disk or from any web server.

`runs` opens run folders and bundles, `alike` refuses what cannot stand in one table, `entries` are
its rows and `board` its numbers; `samples` is all that single samples show. `write` puts a folder
together out of these.
"""

from phyblock.site.write import INDEX, SiteWritten, write_site

__all__ = ["INDEX", "SiteWritten", "write_site"]
