"""One module a track: what it asks, how replies are read and scored, its baselines and records.

`phyblock.registry` lists the tracks. Outside this package only verbs that belong to one name it.
"""
