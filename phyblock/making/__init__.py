"""Making data for phyblock: scenes, candidate sets and questions, and their checks.

Nothing that runs, scores or reports imports it; `phyblock scenes` and `questions` load it.
"""
