"""Pages: the report of a run, the leaderboard of several runs, the page of human baselines."""
