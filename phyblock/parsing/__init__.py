"""Parsers from reply text to an answer, with the rule that matched, or a named problem. Pure."""
