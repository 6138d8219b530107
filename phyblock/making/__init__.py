"""Making data for phyblock: scenes, candidate sets and questions, and their checks.

Nothing that runs, scores or reports imports this package; `phyblock scenes` and
`phyblock questions` load it on demand.
"""
