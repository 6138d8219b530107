"""Geometry, contact, stability and pictures, on a physics engine and a renderer of one's choice.

`engine` and `renderer` say what is asked of the two, and `registry` lists all that there are.
PyBullet is the engine (`bullet`), loaded when a world is made, never by importing this package; the
renderer is our own (`raster`).
"""
