"""`python -m phyblock` is the `phyblock` command."""

from phyblock.cli.main import main

if __name__ == "__main__":
    main()
