"""Running a suite: plan it, execute it, keep every record, read and score it again."""
