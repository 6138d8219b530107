"""Pages: the report of a run, the leaderboard of several, the page where a person answers."""
