"""What must hold in a scene, and the scenes that are good enough for a data set."""
