"""MuJoCo behind the protocol of engines: the only package that imports it, and then late."""
