"""One module per track: its requests, the parsing and scoring of replies, baselines and records.

`phyblock.registry` lists the tracks. Outside this package, only commands of a track name it.
"""
