"""Plans that are learned without the goal, which the tracks about scenes share."""
