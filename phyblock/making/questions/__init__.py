"""Multiple-choice questions about scenes, with answers derived from geometry and physics."""
