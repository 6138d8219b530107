"""Running a suite: plan it, execute it, keep every record, rescore it."""
