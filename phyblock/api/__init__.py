"""What a program or notebook imports from `phyblock`; the names stand in `phyblock.__all__`."""
