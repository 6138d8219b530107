"""Our renderer: triangles to pixels in numpy, with shadows, the same bytes on every machine."""
