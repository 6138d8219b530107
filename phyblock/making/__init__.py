"""Making data for phyblock: scenes, candidate sets and questions, and checks of what was made.

Nothing that runs, scores or reports imports this package; `phyblock scenes` and
`phyblock questions` load it when they are called.
"""
