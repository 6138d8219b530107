"""PyBullet behind the two protocols: the only package that imports it, and then late."""
