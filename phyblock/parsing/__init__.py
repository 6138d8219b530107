"""Reply text -> what the model meant, with the rule that matched, or a named problem. Pure."""
