"""Public names of `phyblock`, for programs and notebooks; the names stand in `phyblock.__all__`."""
