"""Makes and checks scenes and questions; nothing that runs, scores or reports imports it."""
