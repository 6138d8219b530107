"""Pure scoring: plans against AOV graphs, errors, losses, counts and micro averages."""
